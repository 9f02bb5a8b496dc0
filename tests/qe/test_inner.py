"""Both bounds of regions, wherever they are cut short: against other back ends, the checker at points, and counting."""

from collections import Counter
from fractions import Fraction
from itertools import permutations
from math import comb, factorial
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.generators.sizes import write_instance
from robust.api import region
from robust.plan.load import load_plan
from robust.plan.model import Atom, Parameter, ParametrizedPlan
from robust.plan.polynomial import Polynomial
from robust.qe import inner
from robust.qe.box import Box, Interval
from robust.qe.compute import RegionResult, RegionStatus
from robust.qe.constraint import LinearConstraint
from robust.qe.estimate import POINTS, Samples, proportion_bounds
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.qe.symmetry import Symmetry, find_symmetry
from tests.plan import building
from tests.plan.building import ALL, END, RANDOM, F, action, at, at_least, between, drawn, flow, plan_of, reference
from tests.qe.backends.test_regions import differ, is_valid_at, supported
from tests.qe.polyhedra import le, polygon, rectangle
from tests.sampling import sample_parameters
from tests.strategies import plans

SLOW = pytest.mark.slow
SMALL = {"linear": True, "instances": 3, "fluents": 1}
LEVEL = Polynomial.variable(F)


@st.composite
def alike_plans(draw: st.DrawFn) -> ParametrizedPlan:
    """Two or three actions that differ in their names only, with one or two parameters each, and a watch over them."""
    pairs = draw(st.booleans())
    count = 2 if pairs else draw(st.integers(2, 3))
    filled, low, high, change, rate = (draw(st.integers(0, 4)) for _ in range(5))
    upper = draw(st.sampled_from([None, Fraction(3), Fraction(6)]))
    watch = action("watch", (ALL, at_least(LEVEL + high, 2)))
    instances, parameters, constraints = [], [], [at(watch.start, 0), at(watch.end, 20)]
    for index in range(count):
        own = Atom("ready", (f"x{index}",))
        effects = building.delete(own), building.increase(F, change - 2, END), flow(F, rate - 2)
        job = action(f"job{index}", (building.START, at_least(LEVEL, low)), *effects)
        length = reference(f"d{index}") if pairs else 2
        constraints += [at(job.start, reference(f"s{index}")), between(job.start, job.end, length, length)]
        constraints.append(between(job.end, watch.end, 1))
        names = (f"s{index}", f"d{index}") if pairs else (f"s{index}",)
        parameters += [Parameter(name, Fraction(index + 1), lower=Fraction(0), upper=upper) for name in names]
        instances.append(job)
    return plan_of(*instances, watch, f=filled, parameters=tuple(parameters), constraints=tuple(constraints))


def generator(folder: Path, parameters: int) -> ParametrizedPlan:
    return load_plan(*write_instance(folder, parameters, parameters))


def exact(plan: ParametrizedPlan) -> Region:
    """The region in the way that knows neither groups nor symmetry nor cells."""
    result = supported(plan, splitting="partial")
    assert result.status is RegionStatus.COMPLETE
    return result.region


def cut(plan: ParametrizedPlan, steps: int, *, cells_only: bool = False) -> RegionResult:
    """The region, interrupted when so many pieces and cells have been found, or so many cells."""
    shapes: list[Polyhedron] = []

    def count(shape: Polyhedron) -> None:
        shapes.append(shape)
        if len(shapes) >= steps:
            raise KeyboardInterrupt

    return region(plan, on_piece=None if cells_only else count, on_cell=count)


CELLS_FIRST, IN_TURN = -1e9, 0.0
"""Seconds of looking for bad pieces alone."""


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells are looked for from the beginning, and bad pieces only on the way."""
    monkeypatch.setattr(inner, "PATIENCE", CELLS_FIRST)


# -- both bounds at any time ------------------------------------------------------------------------------------------


KINDS = {"any": plans(**SMALL), "alike": alike_plans()}


def by_kind(**counts: int) -> pytest.MarkDecorator:
    """That many plans of each kind, and many more if there is time."""
    many = (pytest.param(kind, 200, marks=SLOW) for kind in counts)
    return pytest.mark.parametrize(("kind", "count"), [*counts.items(), *many])


@by_kind(any=24, alike=14)
def test_the_envelope_lies_between_both_bounds_wherever_the_search_is_cut(
    kind: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    met: Counter[tuple[RegionStatus, bool]] = Counter()

    @settings(drawn(count), derandomize=count < 100)
    @given(KINDS[kind], st.integers(1, 10), st.sampled_from([CELLS_FIRST, IN_TURN]), RANDOM)
    def run(plan: ParametrizedPlan, steps: int, patience: float, random: Random) -> None:
        monkeypatch.setattr(inner, "PATIENCE", patience)
        envelope = exact(plan)
        result = cut(plan, steps) if patience == IN_TURN else cut(plan, 1 + steps % 2, cells_only=True)
        proved = result.inner()
        assert envelope.is_subset_of(result.region)
        assert proved.is_subset_of(envelope)
        sampled = [sample_parameters(plan, random) for _ in range(3)]
        points = [*sampled, *(piece.some_point() for piece in (*proved.pieces[:2], *result.region.pieces[:2]))]
        for point in (point for point in points if point is not None):
            valid = is_valid_at(plan, point)
            assert valid or not result.is_proved(point)
            assert valid <= (point in result.region)
            if result.factors and envelope.some_point() is not None:
                assert valid <= all(factor.is_possible(point) for factor in result.factors)
        met[result.status, bool(proved.pieces)] += 1
        if result.open_share is not None:
            assert 0 <= result.open_share.lower <= result.open_share.value <= result.open_share.upper <= 1

    run()
    for kind_of_end in (
        (RegionStatus.INTERRUPTED, True),
        (RegionStatus.INTERRUPTED, False),
        (RegionStatus.COMPLETE, True),
    ):
        assert met[kind_of_end] >= 1, met


@by_kind(any=10, alike=6)
def test_cells_alone_and_symmetry_come_to_the_same_envelope(
    kind: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bad pieces and good cells cover everything in the end, and share nothing."""
    cells: list[Polyhedron] = []

    @settings(drawn(count), derandomize=count < 100)
    @given(KINDS[kind])
    def run(plan: ParametrizedPlan) -> None:
        envelope, before = exact(plan), len(cells)
        with monkeypatch.context() as patch:
            patch.setattr(inner.FactorSearch, "step", inner.FactorSearch.grow)
            result = region(plan, on_cell=cells.append)
        for same in (result, region(plan)):
            assert same.is_exact
            assert not differ(same.region, envelope)
        if len(result.factors) == 1 and len(cells) > before:
            (only,) = result.factors
            assert not differ(Region.union_of(only.parameters, cells[before:]), only.outer)

    run()
    assert len(cells) > 1


# -- symmetry ----------------------------------------------------------------------------------------------------------


@drawn(6)
@given(alike_plans(), RANDOM)
def test_exchanges_leave_the_envelope_what_it_is(plan: ParametrizedPlan, random: Random) -> None:
    """As a set, and by the checker at points; and every point has an image that ascends."""
    symmetry, envelope = find_symmetry(plan), exact(plan)
    assert symmetry.classes
    assert {name for names in symmetry.classes for name in names} >= {"s0", "s1"}
    for swaps in symmetry.swaps:
        for swap in swaps:
            exchange = {**dict(swap), **{right: left for left, right in swap}}

            def image(piece: Polyhedron, exchange: dict[str, str] = exchange) -> Polyhedron:
                forms = (({exchange.get(n, n): f for n, f in c.coefficients}, c) for c in piece.constraints)
                sides = tuple(LinearConstraint.of(form, c.relation, c.constant) for form, c in forms)
                return Polyhedron(piece.parameters, sides)

            assert envelope.base is not None
            mapped = Region.difference(image(envelope.base), map(image, envelope.pieces))
            assert not differ(envelope, mapped)
    point = sample_parameters(plan, random)
    ascending = symmetry.sorted(point)
    assert sorted(ascending.values()) == sorted(point.values())
    assert all(side.evaluate(ascending) for side in symmetry.ascending)
    assert is_valid_at(plan, ascending) == is_valid_at(plan, point)


def test_images_are_all_images() -> None:
    names = ("a", "b", "c", "d")
    symmetry = Symmetry((names,), (tuple((("a", other),) for other in names[1:]),))
    piece = (le(1, a=1), le(1, b=1), le(2, c=2, d=-1))
    images = symmetry.images(piece, 100)
    assert images is not None
    expected = {
        frozenset((le(1, **{a: 1}), le(1, **{b: 1}), le(2, **{c: 2, d: -1}))) for a, b, c, d in permutations(names)
    }
    assert {frozenset(image) for image in images} == expected
    assert symmetry.images(piece, len(expected) - 1) is None


def test_what_is_not_alike_is_not_exchanged() -> None:
    """By bounds, by effects, by the network, by an atom that a goal asks for; names and nominal values do not count."""

    def plan(change: int = 1, upper: int = 9, start: int = 0, goal: bool = False) -> ParametrizedPlan:
        jobs = [
            action(f"j{i}", building.add(Atom("p", (str(i),))), building.increase(F, change if i else 1, END))
            for i in range(2)
        ]
        parameters = tuple(Parameter(f"k{i}", Fraction(i), upper=Fraction(upper if i else 9)) for i in range(2))
        constraints = (
            *(at(job.start, start if i else 0) for i, job in enumerate(jobs)),
            *(between(job.start, job.end, reference(f"k{i}"), None) for i, job in enumerate(jobs)),
        )
        asked = building.model.Holds(Atom("p", ("0",))) if goal else None
        return plan_of(*jobs, parameters=parameters, constraints=constraints, goal=asked)

    assert find_symmetry(plan()).classes == (("k0", "k1"),)
    assert not any(map(find_symmetry, [plan(change=2), plan(upper=8), plan(start=1), plan(goal=True)]))


@pytest.mark.parametrize("parameters", [2, 3, pytest.param(4, marks=SLOW)])
def test_the_generator_needs_so_many_polyhedra(tmp_path: Path, parameters: int) -> None:
    """Any i starts too early for the i-th, any i too late for the i-th from the end; or one polyhedron in order."""
    plan = generator(tmp_path, parameters)
    result = region(plan)
    assert result.is_exact
    base = result.region.base
    assert base is not None
    assert len(base.constraints) + len(result.region.pieces) == 2 ** (parameters + 1) - 2
    (factor,) = result.factors
    assert factor.outer.simplified().pieces == ()
    assert not differ(result.region, exact(plan))
    # Each of these is in the envelope, and none between two of them, so that a union needs a polyhedron for each.
    corners = [
        dict(zip(plan.nominal, (Fraction(36 * i - 32) for i in order), strict=True))
        for order in permutations(range(1, parameters + 1))
    ]
    assert len(corners) == factorial(parameters)
    assert all(corner in result.region for corner in corners)
    for index, left in enumerate(corners):
        for right in corners[:index]:
            assert {name: (left[name] + right[name]) / 2 for name in left} not in result.region


def test_what_cannot_be_lifted_is_found_without_symmetry(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(inner, "MOST_IMAGES", 1)
    monkeypatch.setattr(inner, "SOME_IMAGES", 1)
    plan = generator(tmp_path, 2)
    result = region(plan)
    assert result.is_exact
    assert not result.factors[0].symmetry
    assert not differ(result.region, exact(plan))


# -- independent groups ------------------------------------------------------------------------------------------------


def apart(count: int, together: int | None = None) -> ParametrizedPlan:
    """Actions with a fluent each that lets them last at most 4; two of them may have to end at the same time."""
    fluents = [building.model.Fluent("f", (str(i),)) for i in range(count)]
    levels = [Polynomial.variable(fluent) for fluent in fluents]
    jobs = [
        action(f"j{i}", (ALL, at_least(levels[i], 0)), flow(fluents[i], -1 - i), (ALL, at_least(4 + i, levels[i])))
        for i in range(count)
    ]
    constraints = [at(job.start, 0) for job in jobs]
    constraints += [between(job.start, job.end, reference(f"k{i}"), None) for i, job in enumerate(jobs)]
    constraints += [between(job.start, job.end, None, reference(f"k{i}") + 1) for i, job in enumerate(jobs)]
    if together is not None:
        constraints.append(between(jobs[0].end, jobs[together].end, 0, 0))
    parameters = tuple(Parameter(f"k{i}", Fraction(1), upper=Fraction(20)) for i in range(count))
    plan = plan_of(*jobs, parameters=parameters, constraints=tuple(constraints))
    initial = {fluent: Polynomial.constant(Fraction(4)) for fluent in fluents}
    return building.replace(plan, initial_fluents={**plan.initial_fluents, **initial})


@pytest.mark.parametrize(
    ("plan", "groups"), [(apart(3), [("k0",), ("k1",), ("k2",)]), (apart(3, together=2), [("k0", "k2"), ("k1",)])]
)
def test_groups_are_found_and_multiplied(plan: ParametrizedPlan, groups: list[tuple[str, ...]]) -> None:
    result = region(plan)
    assert [factor.parameters for factor in result.factors] == groups
    assert not differ(result.region, exact(plan))
    for point in (
        dict(zip(plan.nominal, map(Fraction, ends), strict=True)) for ends in ((1, 1, 0), (9, 1, 1), (3, 1, 3))
    ):
        assert (point in result.region) == all(factor.is_proved(point) for factor in result.factors)


@pytest.mark.usefixtures("impatient")
def test_the_inner_bound_is_a_product() -> None:
    plan = apart(3)
    steps = next(n for n in range(1, 60) if cut(plan, n).inner().pieces)
    result = cut(plan, steps)
    assert result.status is RegionStatus.INTERRUPTED
    proved = result.inner()
    assert proved.is_subset_of(exact(plan))
    name = plan.parameters[0].name
    assert result.inner({name: plan.nominal[name]}).parameters == tuple(plan.nominal)[1:]
    assert all(result.is_proved(point) for point in proved.sample(5))


# -- how much is open --------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("impatient")
def test_open_shares_of_few_parameters_are_exact(tmp_path: Path) -> None:
    """The volume between both bounds, from what the whole space is told, not from where parameters ascend."""
    shares = []
    for steps in range(6, 14, 2):
        result = cut(generator(tmp_path, 2), steps)
        share = result.open_share
        if share is None or result.is_exact or any(not factor.symmetry for factor in result.factors):
            continue
        assert share.confidence is None
        box = Region.of_box(result.region.parameters, share.box)
        (factor,) = result.factors
        possible = [Region.difference(factor.outer.base, factor.outer.pieces)] if factor.outer.base else []
        volumes = [one.intersection(box).volume() for one in (*possible, factor.inner, box)]
        outer, proved, whole = (volume or Fraction(0) for volume in volumes)
        assert share.value == 2 * (outer - proved) / whole
        shares.append(share.value)
    assert len(set(shares)) > 1


@pytest.mark.parametrize(("count", "points"), [(0, 50), (3, 50), (49, 50), (50, 50), (20, 200)])
def test_intervals_of_proportions(count: int, points: int) -> None:
    """At each end, what was seen or more of it has a chance of one in forty."""

    def seen(low: int, high: int, chance: float) -> float:
        exactly = Fraction(chance)
        terms = (comb(points, n) * exactly**n * (1 - exactly) ** (points - n) for n in range(low, high + 1))
        return float(sum(terms))

    lower, upper = proportion_bounds(count, points, 0.95)
    assert lower <= count / points <= upper
    assert lower == 0 if count == 0 else seen(count, points, lower) == pytest.approx(0.025)
    assert upper == 1 if count == points else seen(0, count, upper) == pytest.approx(0.025)


def test_samples_know_what_they_are_told() -> None:
    box = Box({"x": Interval(Fraction(-1, 3), Fraction(1)), "y": Interval(Fraction(0), Fraction(7, 5))})
    samples = Samples(box, Symmetry())
    assert all(samples.point(index) in box for index in samples.undecided)
    left, low = rectangle(-1, 0, -9, 9), polygon(le(0, x=1, y=1))
    samples.exclude(left.constraints)
    samples.include(low)
    undecided = [samples.point(index) for index in samples.undecided]
    assert undecided
    assert not any(point in left or point in low for point in undecided)
    assert all(samples.point(index) in low and samples.point(index) not in left for index in samples.good)
    assert len(samples.good) + len(samples.undecided) == sum(
        point not in left for point in map(Samples(box, Symmetry()).point, range(POINTS))
    )
