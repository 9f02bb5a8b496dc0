"""Regions of plans: against the verdict of the checker at points, back end against back end, and known envelopes."""

import json
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import nullcontext, suppress
from fractions import Fraction
from itertools import combinations, permutations
from math import comb, factorial
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from benchmarks.generators.sizes import write_instance
from robust import Answer, Box, InputError, Interval, Region, RobustError, UnsupportedError, api, check, reading
from robust.backends import ELIMINATORS
from robust.encode.encoding import RelationalEncoding
from robust.plan.model import ZERO, Atom, Condition, DurationConstraint, Parameter, ParametrizedPlan
from robust.plan.polynomial import Polynomial
from robust.qe import compute, constraint, estimate, inner, nnf, polyhedron
from robust.qe.eliminate.interface import Solvers
from robust.qe.symmetry import Symmetry, find_symmetry
from robust.reading import load_plan
from robust.smt.limits import NEVER, Deadline, one_question
from robust.smt.session import Satisfiability, Session
from tests.children import interrupted_after
from tests.cli.running import EXAMPLES, example
from tests.irr.building import shipped
from tests.plan import building
from tests.plan.building import ALL, END, RANDOM, START, F, action, at, at_least, between, drawn, plan_of, reference
from tests.qe.backends import REFEREES
from tests.qe.backends.test_eliminators import OURS, side
from tests.qe.polyhedra import le, polygon, rectangle, region_z3, same
from tests.sampling import often, sample_parameters
from tests.strategies import plans

OTHERS = tuple(name for name in ELIMINATORS if name != "project")
DURATION, flow = building.DURATION, building.flow


def region(plan: ParametrizedPlan, **options: Any) -> compute.RegionResult:
    """As :func:`robust.region`, also with back ends that users cannot choose."""
    if options.get("backend") not in REFEREES:
        return api.region(plan, **options)
    with one_question():
        return compute.RegionSearch(plan, **options).run()


SPLITTINGS = ("monolithic", "partial", "full")
SLOW = pytest.mark.slow
SMALL = {"linear": True, "instances": 3, "fluents": 1}
TINY = {"linear": True, "instances": 2, "fluents": 1, "parameters": 2}


def differ(left: Region, right: Region) -> bool:
    """Whether two regions differ, by a solver (and not by the regions' own algorithms)."""
    return not same(region_z3(left), region_z3(right))


def is_valid_at(plan: ParametrizedPlan, point: dict[str, Fraction]) -> bool:
    """Whether the checker proves the plan at a point that declared bounds allow."""
    answer = None
    if all(point[one.name] in Interval(one.lower, one.upper) for one in plan.parameters):
        with suppress(InputError):  # no schedule whatever the parameters are
            answer = check(plan, at=point).answer
    assert answer is not Answer.UNKNOWN
    return answer is Answer.PROVED


def supported(plan: ParametrizedPlan, **options: object) -> compute.RegionResult:
    try:
        return region(plan, **options)
    except UnsupportedError:
        assume(False)  # also cvc5 and Boolean symbols
        raise


def complete(plan: ParametrizedPlan, **options: object) -> compute.RegionResult:
    result = supported(plan, **options)
    assert (result.status, result.is_exact) == (compute.RegionStatus.COMPLETE, True)
    return result


LARGE = {"linear": True, "instances": 5, "fluents": 0, "timed_literals": True}
MANY = [SMALL, *(pytest.param(options, marks=SLOW) for options in ({"linear": True}, LARGE))]


@pytest.mark.parametrize("options", MANY)
@drawn(8, 400)
@given(st.data(), RANDOM)
def test_points_are_inside_if_and_only_if_the_plan_is_valid_there(options, data, random: Random) -> None:
    plan = data.draw(plans(**options))
    region = complete(plan).region
    inside = [shape.some_point() for shape in (region, region.base, *region.pieces[:3])]
    for point in [*inside, *(sample_parameters(plan, random) for _ in range(often(3, 6)))]:
        assert point is None or (point in region) == is_valid_at(plan, point), point


def same_region(plan: ParametrizedPlan, **options: object) -> None:
    """Another back end, or the same one in another way, finds the region, or an outer bound if it runs out of time."""
    reference, other = complete(plan), supported(plan, **options)
    assert other.status is compute.RegionStatus.COMPLETE or "timeout" in options
    shared = other.region if other.is_exact else reference.region.intersection(other.region)
    assert not differ(reference.region, shared)


@pytest.mark.parametrize("backend", OTHERS)
@drawn(4, 150)
@given(plans(**often(TINY, SMALL)), st.sampled_from(SPLITTINGS), st.booleans())
def test_back_ends_agree(backend: str, plan: ParametrizedPlan, splitting: str, learning: bool) -> None:
    same_region(plan, backend=backend, splitting=splitting, learning=learning, timeout=20)


@pytest.mark.parametrize("encoding", ["relational", pytest.param("positions", marks=SLOW)])
@drawn(5, 60)
@given(plans(**TINY), st.sampled_from(SPLITTINGS), st.booleans(), st.sampled_from(["z3", "cvc5"]))
def test_project_is_the_same_however_it_runs(encoding: str, plan, splitting: str, learning: bool, solver: str) -> None:
    same_region(plan, splitting=splitting, learning=learning, solver=solver, encoding=encoding)


k = reference("k")
SUM = k + reference("m")
NAVIGATION = shipped("two_sample_navigation")


def constrained(names: Iterable[str], *sides: constraint.LinearConstraint) -> Region:
    return Region.union_of(tuple(names), [polyhedron.Polyhedron(tuple(names), sides)])


@pytest.mark.parametrize("backend", ["project", *OTHERS])
@pytest.mark.parametrize("splitting", SPLITTINGS)
def test_two_sample_navigation(backend: str, splitting: str) -> None:
    r, c = NAVIGATION.nominal
    sides = [side(relation, number, **{r: 1}) for relation, number in ((">=", 20), ("<=", 50))]
    sides += [side(relation, number, **{r: 1, c: 1}) for relation, number in ((">=", 60), ("<=", 85))]
    sides.append(side("<=", 128, **{r: 1, c: 2}))
    result = region(NAVIGATION, backend=backend, splitting=splitting)
    assert result.status is compute.RegionStatus.COMPLETE
    assert not differ(result.region, constrained((r, c), *sides))


K, BELOW = (Parameter("k", Fraction(1), upper=upper) for upper in (None, Fraction(9)))
M = Parameter("m", Fraction(1), lower=Fraction(0), upper=Fraction(4))


def fixed_plan(*parameters: Parameter, condition: Condition | None = None, length: object = 2) -> ParametrizedPlan:
    """One action from 0, of that duration, with a condition over parameters at its start."""
    i = action("i", *([] if condition is None else [(START, condition)]))
    return plan_of(i, parameters=parameters, constraints=(at(i.start, 0), between(i.start, i.end, length, length)))


def flexible_plan() -> ParametrizedPlan:
    """i starts between k and 3, ends between 3 and 5, and lasts at most 4."""
    i = action("i", DurationConstraint(START, at_least(4, DURATION), "short"))
    return plan_of(i, parameters=(K,), constraints=(between(ZERO, i.start, k, 3), between(ZERO, i.end, 3, 5)))


NOTHING, LINE = constraint.LinearConstraint.false(), (side("=", 3, k=1, m=1), side(">=", 0, m=1), side("<=", 4, m=1))
HOLES = constrained("k", side("<=", 9, k=1)).minus(constrained("k", side("=", 3, k=1)))


@pytest.mark.parametrize("backend", ["project", *OTHERS])
@pytest.mark.parametrize(
    ("plan", "expected"),
    [
        (fixed_plan(), constrained("")),
        (fixed_plan(condition=at_least(0, 1)), constrained("", NOTHING)),
        (fixed_plan(K, condition=at_least(0, 1)), constrained("k", NOTHING)),
        (fixed_plan(K), constrained("k")),
        (fixed_plan(K, condition=building.equal(k, 3)), constrained("k", side("=", 3, k=1))),
        (fixed_plan(K, M, condition=building.equal(SUM, 3)), constrained("km", *LINE)),
        (fixed_plan(BELOW, condition=building.different(k, 3)), HOLES),
        (flexible_plan(), constrained("k", side(">=", 1, k=1), side("<=", 3, k=1))),
        (fixed_plan(K, length=k), constrained("k", side(">=", 0, k=1))),
    ],
    ids=["everything", "nothing", "nowhere", "unbounded", "point", "line", "holes", "between", "durations"],
)
def test_unusual_regions(plan: ParametrizedPlan, expected: Region, backend: str) -> None:
    assert not differ(region(plan, backend=backend).region, expected)


@pytest.mark.parametrize("backend", OURS)
@pytest.mark.parametrize("splitting", SPLITTINGS)
def test_queries_are_named_timed_and_counted(monkeypatch: pytest.MonkeyPatch, backend: str, splitting: str) -> None:
    """Of definitions it is asked before the time is known."""
    asked, original = [], Session.check

    def check_and_note(self: Session, question: str, deadline: Deadline = NEVER) -> Satisfiability:
        assert question.startswith("definition of ") or deadline.moment is not None, question
        asked.append(question)
        return original(self, question, deadline)

    monkeypatch.setattr(Session, "check", check_and_note)
    plan = fixed_plan(K, M, condition=at_least(k - reference("m").scaled(2), 3))
    result = region(plan, backend=backend, splitting=splitting, timeout=60)
    assert (result.backend, result.splitting, result.statistics.queries) == (backend, splitting, len(asked))
    assert str(result.region) == "{ m ≥ 0 ∧ m ≤ 4 ∧ k - 2·m ≥ 3 }"


def test_the_problem_as_a_whole() -> None:
    encoding = RelationalEncoding(fixed_plan(BELOW, condition=at_least(k, 3)))
    builder = compute.ProblemBuilder(encoding, Solvers(encoding.terms, nnf.FormulaReader(encoding.terms)))
    existence = builder.existence()
    assert (existence.name, existence.kept, existence.definitions) == ("some schedule exists", ("k",), ())
    assert existence.formula == nnf.conjunction((*existence.network, existence.remainder))
    with pytest.raises(InputError, match="unknown back end 'projekt'; did you mean 'project'"):
        region(fixed_plan(), backend="projekt")
    with pytest.raises(RobustError, match="unknown solver"):
        region(fixed_plan(), solver="z4")


def test_interruption_keeps_what_was_found() -> None:
    """Each piece takes something away; the region of an interrupted run contains the envelope."""
    for backend in ELIMINATORS:
        result = region(NAVIGATION, backend=backend, timeout=0)
        assert (result.status, result.is_exact, result.pieces) == (compute.RegionStatus.TIMEOUT, False, 0)
        assert "outer bound" in result.meaning
        assert NAVIGATION.nominal in result.region
    pieces: list[polyhedron.Polyhedron] = []
    result, envelope = cut(NAVIGATION, 2, shapes=pieces), region(NAVIGATION)
    assert (result.status, result.pieces, len(pieces)) == (compute.RegionStatus.INTERRUPTED, 2, 2)
    assert (envelope.status, envelope.meaning) == (compute.RegionStatus.COMPLETE, "the robustness envelope")
    assert envelope.region.is_subset_of(result.region)
    assert not result.region.is_subset_of(envelope.region)
    assert all(piece.some_point() not in result.region for piece in pieces)


# Python may drop the exception in a finaliser of a solver's objects; that it is noticed all the same is the point.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("backend", [*OURS, *REFEREES])
def test_time_limits_and_ctrl_c_are_kept(dataset: Path, backend: str) -> None:
    folder = dataset / "generator-linear"
    plan = load_plan(folder / "domain.pddl", folder / "problem_07.pddl", folder / "plan_07_4.stn")
    for limited in (True, False) if backend != "z3-qe" else (True,):
        started = time.monotonic()
        with nullcontext() if limited else interrupted_after(0.2):
            result = region(plan, backend=backend, splitting="partial", timeout=0.2 if limited else 60)
        assert result.status is (compute.RegionStatus.TIMEOUT if limited else compute.RegionStatus.INTERRUPTED)
        assert time.monotonic() - started < 10


QUICK = ("auv_mission_10_0_0", "auv_mission_10_0_4", "auv_mission_10_0_9", "solar_rover_01_4", "generator_linear_05_2")


def computed(dataset: Path, name: str = "", **options: Any) -> Iterator[tuple[dict[str, Any], compute.RegionResult]]:
    """The records of that name, or all, with the complete regions of their plans."""
    for record in json.loads((dataset / "recorded-results.json").read_text()):
        brief = record["instance"].startswith(("auv", "solar")) or record["instance"].endswith("_1")
        if name == record["instance"] or (not name and (brief or options.get("backend", "project") in OURS)):
            plan = load_plan(dataset / record["domain"], dataset / record["problem"], dataset / record["plan"])
            result = region(plan, timeout=300, **options)
            assert result.status is compute.RegionStatus.COMPLETE, record["instance"]
            yield record, result


@pytest.mark.parametrize("name", [*QUICK, pytest.param("", marks=SLOW)])
def test_recorded_boxes_are_inside(dataset: Path, name: str) -> None:
    for record, result in computed(dataset, name):
        for recorded in (record[key] for key in ("irr_box", "ccmmz_box") if record.get(key)):
            if all("inf" not in end for ends in recorded.values() for end in ends):
                box = Box({name: Interval(*map(Fraction, ends)) for name, ends in recorded.items()})
                assert Region.of_box(result.region.parameters, box).is_subset_of(result.region), record["instance"]


AGREEING = [(backend, "generator_linear_05_2") for backend in OURS[1:]]


@pytest.mark.parametrize(("backend", "name"), AGREEING + [pytest.param(one, "", marks=SLOW) for one in OTHERS])
def test_back_ends_agree_on_recorded_instances(dataset: Path, backend: str, name: str) -> None:
    """Our own on all of them, those of solvers on the quick ones; at least two others need less than a minute."""
    for record, other in computed(dataset, name, backend=backend):
        assert backend not in OURS or other.seconds < 60, record["instance"]
        ((_, default),) = computed(dataset, record["instance"])
        assert not differ(other.region, default.region), record["instance"]


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


def exact(plan: ParametrizedPlan) -> Region:
    """The region in the way that knows neither groups nor symmetry nor cells."""
    return complete(plan, splitting="partial").region


def cut(plan: ParametrizedPlan, steps: int, *, cells_only: bool = False, shapes: Any = None) -> compute.RegionResult:
    """The region, interrupted when so many pieces and cells have been found, or so many cells."""
    shapes = [] if shapes is None else shapes

    def count(shape: polyhedron.Polyhedron) -> None:
        shapes.append(shape)
        if len(shapes) >= steps:
            raise KeyboardInterrupt

    return region(plan, on_piece=None if cells_only else count, on_cell=count)


CELLS_FIRST, IN_TURN = -1e9, 0.0  # seconds of looking for bad pieces alone
KINDS = {"any": plans(**SMALL), "alike": alike_plans()}


def by_kind(**counts: int) -> pytest.MarkDecorator:
    """That many plans of each kind, and many more if there is time."""
    many = (pytest.param(kind, 200, marks=SLOW) for kind in counts)
    return pytest.mark.parametrize(("kind", "count"), [*counts.items(), *many])


@by_kind(any=14, alike=8)
def test_the_envelope_lies_between_both_bounds_wherever_the_search_is_cut(kind, count, monkeypatch):
    met: Counter[tuple[compute.RegionStatus, bool]] = Counter()

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
    assert met.keys() >= {(compute.RegionStatus.INTERRUPTED, True), (compute.RegionStatus.INTERRUPTED, False)}
    assert met[compute.RegionStatus.COMPLETE, True]


@by_kind(any=6, alike=6)
def test_cells_alone_and_symmetry_come_to_the_same_envelope(kind, count, monkeypatch):
    """Bad pieces and good cells cover everything in the end, and share nothing."""
    cells: list[polyhedron.Polyhedron] = []

    @settings(drawn(count), derandomize=count < 100)
    @given(KINDS[kind])
    def run(plan: ParametrizedPlan) -> None:
        envelope, before = exact(plan), len(cells)
        with monkeypatch.context() as patch:
            patch.setattr(inner.FactorSearch, "step", inner.FactorSearch.grow)
            result = region(plan, on_cell=cells.append)
        for again in (result, region(plan)):
            assert again.is_exact
            assert not differ(again.region, envelope)
        if len(result.factors) == 1 and len(cells) > before:
            (only,) = result.factors
            assert not differ(Region.union_of(only.parameters, cells[before:]), only.outer)

    run()
    assert len(cells) > 1


@drawn(4, 6)
@given(alike_plans(), RANDOM)
def test_exchanges_leave_the_envelope_what_it_is(plan: ParametrizedPlan, random: Random) -> None:
    """As a set, and by the checker at points; and every point has an image that ascends."""
    symmetry, envelope = find_symmetry(plan), exact(plan)
    assert symmetry.classes
    assert {name for names in symmetry.classes for name in names} >= {"s0", "s1"}
    for swaps in symmetry.swaps:
        for swap in swaps:
            exchange = {**dict(swap), **{right: left for left, right in swap}}

            def image(piece, exchange=exchange):
                forms = (({exchange.get(n, n): f for n, f in c.coefficients}, c) for c in piece.constraints)
                sides = (constraint.LinearConstraint.of(form, c.relation, c.constant) for form, c in forms)
                return polyhedron.Polyhedron(piece.parameters, tuple(sides))

            assert envelope.base is not None
            mapped = Region.difference(image(envelope.base), map(image, envelope.pieces))
            assert not differ(envelope, mapped)
    point = sample_parameters(plan, random)
    ascending = symmetry.sorted(point)
    assert sorted(ascending.values()) == sorted(point.values())
    assert all(side.evaluate(ascending) for side in symmetry.ascending)
    assert is_valid_at(plan, ascending) == is_valid_at(plan, point)


def test_images_are_all_images() -> None:
    def piece(a: str, b: str, c: str, d: str) -> frozenset[constraint.LinearConstraint]:
        return frozenset((le(1, **{a: 1}), le(1, **{b: 1}), le(2, **{c: 2, d: -1})))

    symmetry = Symmetry((tuple("abcd"),), (tuple((("a", other),) for other in "bcd"),))
    expected = {piece(*order) for order in permutations("abcd")}
    assert {frozenset(image) for image in symmetry.images(tuple(piece(*"abcd")), 100)} == expected
    assert symmetry.images(tuple(piece(*"abcd")), len(expected) - 1) is None


def test_what_is_not_alike_is_not_exchanged() -> None:
    """By bounds, by effects, by the network, by an atom that a goal asks for; names and nominal values do not count."""

    def plan(change: int = 1, upper: int = 9, start: int = 0, goal: bool = False) -> ParametrizedPlan:
        jobs, parameters, constraints = [], [], []
        for i, (by, most, first) in enumerate([(1, 9, 0), (change, upper, start)]):
            job = action(f"j{i}", building.add(Atom("p", (str(i),))), building.increase(F, by, END))
            constraints += [at(job.start, first), between(job.start, job.end, reference(f"k{i}"), None)]
            parameters.append(Parameter(f"k{i}", Fraction(i), upper=Fraction(most)))
            jobs.append(job)
        asked = building.model.Holds(Atom("p", ("0",))) if goal else None
        return plan_of(*jobs, parameters=tuple(parameters), constraints=tuple(constraints), goal=asked)

    assert find_symmetry(plan()).classes == (("k0", "k1"),)
    assert not any(map(find_symmetry, [plan(change=2), plan(upper=8), plan(start=1), plan(goal=True)]))


@pytest.mark.parametrize("parameters", [2, 3, pytest.param(4, marks=SLOW)])
def test_the_generator_needs_so_many_polyhedra(tmp_path: Path, parameters: int) -> None:
    """Any i starts too early for the i-th, any i too late for the i-th from the end; or one polyhedron in order."""
    plan = load_plan(*write_instance(tmp_path, parameters, parameters))
    result = region(plan)
    assert result.is_exact
    assert len(result.region.base.constraints) + len(result.region.pieces) == 2 ** (parameters + 1) - 2
    (factor,) = result.factors
    assert factor.outer.simplified().pieces == ()
    assert not differ(result.region, exact(plan))
    # Each of these is in the envelope, and none between two of them, so that a union needs a polyhedron for each.
    times = [Fraction(36 * i + 4) for i in range(parameters)]
    corners = [dict(zip(plan.nominal, order, strict=True)) for order in permutations(times)]
    assert len(corners) == factorial(parameters)
    assert all(corner in result.region for corner in corners)
    for left, right in combinations(corners, 2):
        assert {name: (left[name] + right[name]) / 2 for name in left} not in result.region


def test_what_cannot_be_lifted_is_found_without_symmetry(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(inner, "MOST_IMAGES", 1)
    monkeypatch.setattr(inner, "SOME_IMAGES", 1)
    plan = load_plan(*write_instance(tmp_path, 2, 2))
    result = region(plan)
    assert result.is_exact
    assert not result.factors[0].symmetry
    assert not differ(result.region, exact(plan))


def apart(together: bool = False) -> ParametrizedPlan:
    """Three actions with a fluent each that lets them last at most 4; two may have to end at the same time."""
    jobs, constraints, initial = [], [], {}
    for i in range(3):
        fluent = building.model.Fluent("f", (str(i),))
        k, level = reference(f"k{i}"), Polynomial.variable(fluent)
        job = action(f"j{i}", (ALL, at_least(level, 0)), flow(fluent, -1 - i), (ALL, at_least(4 + i, level)))
        constraints += [at(job.start, 0), between(job.start, job.end, k), between(job.start, job.end, None, k + 1)]
        jobs.append(job)
        initial[fluent] = Polynomial.constant(Fraction(4))
    if together:
        constraints.append(between(jobs[0].end, jobs[2].end, 0, 0))
    parameters = tuple(Parameter(f"k{i}", Fraction(1), upper=Fraction(20)) for i in range(3))
    plan = plan_of(*jobs, parameters=parameters, constraints=tuple(constraints))
    return building.replace(plan, initial_fluents={**plan.initial_fluents, **initial})


@pytest.mark.parametrize(
    ("plan", "groups"), [(apart(), [("k0",), ("k1",), ("k2",)]), (apart(together=True), [("k0", "k2"), ("k1",)])]
)
def test_groups_are_found_and_multiplied(plan: ParametrizedPlan, groups: list[tuple[str, ...]]) -> None:
    result = region(plan)
    assert [factor.parameters for factor in result.factors] == groups
    assert not differ(result.region, exact(plan))
    for ends in ((1, 1, 0), (9, 1, 1), (3, 1, 3)):
        point = dict(zip(plan.nominal, map(Fraction, ends), strict=True))
        assert (point in result.region) == all(factor.is_proved(point) for factor in result.factors)


def test_the_inner_bound_is_a_product(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inner, "PATIENCE", CELLS_FIRST)
    plan = apart()
    steps = next(n for n in range(1, 60) if cut(plan, n).inner().pieces)
    result = cut(plan, steps)
    assert result.status is compute.RegionStatus.INTERRUPTED
    proved = result.inner()
    assert proved.is_subset_of(exact(plan))
    name = plan.parameters[0].name
    assert result.inner({name: plan.nominal[name]}).parameters == tuple(plan.nominal)[1:]
    assert all(result.is_proved(point) for point in proved.sample(5))


def test_open_shares_of_few_parameters_are_exact(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The volume between both bounds, from what the whole space is told, not from where parameters ascend."""
    monkeypatch.setattr(inner, "PATIENCE", CELLS_FIRST)
    shares = []
    for steps in range(6, 14, 2):
        result = cut(load_plan(*write_instance(tmp_path, 2, 2)), steps)
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
        p = Fraction(chance)
        return float(sum(comb(points, n) * p**n * (1 - p) ** (points - n) for n in range(low, high + 1)))

    lower, upper = estimate.proportion_bounds(count, points, 0.95)
    assert lower <= count / points <= upper
    assert lower == 0 if count == 0 else seen(count, points, lower) == pytest.approx(0.025)
    assert upper == 1 if count == points else seen(0, count, upper) == pytest.approx(0.025)


def test_samples_know_what_they_are_told() -> None:
    box = Box({"x": Interval(Fraction(-1, 3), Fraction(1)), "y": Interval(Fraction(0), Fraction(7, 5))})
    samples = estimate.Samples(box, Symmetry())
    assert all(samples.point(index) in box for index in samples.undecided)
    left, low = rectangle(-1, 0, -9, 9), polygon(le(0, x=1, y=1))
    samples.exclude(left.constraints)
    samples.include(low)
    undecided = [samples.point(index) for index in samples.undecided]
    assert undecided
    assert not any(point in left or point in low for point in undecided)
    assert all(samples.point(index) in low and samples.point(index) not in left for index in samples.good)
    assert len(samples.good) + len(samples.undecided) == sum(
        point not in left for point in map(estimate.Samples(box, Symmetry()).point, range(estimate.POINTS))
    )


@pytest.mark.parametrize("name", ["two_sample_navigation", "generator", "delivery"])
def test_what_breaks_is_what_checks_refute(name):
    """Where each obligation breaks, against checks of single points, which share none of the elimination."""
    plan = reading.load_plan(*example(directory=EXAMPLES / name))
    breaks, exact = compute.what_breaks(plan), region(plan).region
    assert breaks.complete
    assert not compute.what_breaks(plan, timeout=0.0).complete
    random, met = Random(5), Counter()  # noqa: S311 - reproducible
    for _ in range(40):
        point = {name: nominal + random.randint(-60, 60) for name, nominal in plan.nominal.items()}
        result = check(plan, at=point, every=True)
        refuted = {name for name, answer in result.obligations.items() if answer is Answer.REFUTED}
        named = [one for one in breaks.obligations if any(point in piece for piece in one.pieces)]
        demands = {one.obligation for one in named if one.demand}
        if result.reason is not None:
            met["no schedule"] += 1
            assert point not in exact
        elif demands:
            met["demand"] += 1
            assert demands <= refuted
        else:
            met["several" if len(refuted) > 1 else "one" if refuted else "valid"] += 1
            assert {one.obligation for one in named} == refuted
            assert (point in exact) is (not refuted)
    assert met.keys() >= {"valid", *(("no schedule",) if name == "delivery" else ("one", "several"))}
    assert sum(met.values()) == 40
