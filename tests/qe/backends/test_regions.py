"""Regions of plans: against the verdict of the checker at points, back end against back end, and known envelopes."""

import json
import time
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from robust import api
from robust.api import check
from robust.backends import ELIMINATORS
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError, RobustError, UnsupportedError
from robust.irr.check import Answer
from robust.plan.load import load_plan
from robust.plan.model import ZERO, Condition, DurationConstraint, Parameter, ParametrizedPlan
from robust.qe.box import Box, Interval
from robust.qe.compute import ProblemBuilder, RegionResult, RegionSearch, RegionStatus
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.interface import Solvers
from robust.qe.nnf import FormulaReader, conjunction
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.smt.limits import NEVER, Deadline, one_question
from robust.smt.session import Satisfiability, Session
from tests.children import interrupted_after
from tests.irr.building import shipped
from tests.plan import building
from tests.plan.building import DURATION, RANDOM, START, action, at, at_least, between, drawn, plan_of, reference
from tests.qe.backends import REFEREES
from tests.qe.backends.test_eliminators import OURS
from tests.qe.polyhedra import region_z3, same
from tests.sampling import sample_parameters
from tests.strategies import plans

OTHERS = tuple(name for name in ELIMINATORS if name != "project")


def region(plan: ParametrizedPlan, **options: Any) -> RegionResult:
    """As :func:`robust.region`, also with back ends that users cannot choose."""
    if options.get("backend") not in REFEREES:
        return api.region(plan, **options)
    with one_question():
        return RegionSearch(plan, **options).run()


SPLITTINGS = ("monolithic", "partial", "full")
SLOW = pytest.mark.slow
SMALL = {"linear": True, "instances": 3, "fluents": 1}
TINY = {"linear": True, "instances": 2, "fluents": 1, "parameters": 2}


def differ(left: Region, right: Region) -> bool:
    """Whether two regions differ, by a solver (and not by the regions' own algorithms)."""
    return not same(region_z3(left), region_z3(right))


def is_valid_at(plan: ParametrizedPlan, point: dict[str, Fraction]) -> bool:
    """Whether the checker proves the plan at a point that declared bounds allow."""
    if not all(point[one.name] in Interval(one.lower, one.upper) for one in plan.parameters):
        return False
    try:
        answer = check(plan, at=point).answer
    except InputError:
        return False  # no schedule whatever the parameters are
    assert answer is not Answer.UNKNOWN
    return answer is Answer.PROVED


def points(result: RegionResult) -> list[dict[str, Fraction]]:
    """One of the region, one of each of some pieces."""
    base = result.region.base
    assert base is not None
    inside = (result.region, base, *result.region.pieces[:3])
    return [point for shape in inside if (point := shape.some_point()) is not None]


def supported(plan: ParametrizedPlan, **options: object) -> RegionResult:
    try:
        return region(plan, **options)
    except UnsupportedError:
        assume(False)  # also cvc5 and Boolean symbols
        raise


def complete(plan: ParametrizedPlan) -> RegionResult:
    result = supported(plan)
    assert (result.status, result.is_exact) == (RegionStatus.COMPLETE, True)
    return result


@pytest.mark.parametrize(
    ("count", "options"),
    [
        (12, SMALL),
        pytest.param(600, {"linear": True}, marks=SLOW),
        pytest.param(300, {"linear": True, "instances": 5, "fluents": 0, "timed_literals": True}, marks=SLOW),
    ],
)
def test_points_are_inside_if_and_only_if_the_plan_is_valid_there(count: int, options: dict[str, int]) -> None:
    @settings(drawn(count), derandomize=count < 100)
    @given(plans(**options), RANDOM)
    def run(plan: ParametrizedPlan, random: Random) -> None:
        result = complete(plan)
        for point in [*points(result), *(sample_parameters(plan, random) for _ in range(3 if count < 100 else 6))]:
            assert (point in result.region) == is_valid_at(plan, point), point

    run()


def same_region(plan: ParametrizedPlan, **options: object) -> None:
    """Another back end, or the same one in another way, finds the region, or an outer bound if it runs out of time."""
    reference, other = complete(plan), supported(plan, **options)
    assert other.status is RegionStatus.COMPLETE or "timeout" in options
    shared = other.region if other.is_exact else reference.region.intersection(other.region)
    assert not differ(reference.region, shared)


@pytest.mark.parametrize("backend", OTHERS)
@pytest.mark.parametrize(("count", "options"), [(4, TINY), pytest.param(150, SMALL, marks=SLOW)])
def test_back_ends_agree(backend: str, count: int, options: dict[str, int]) -> None:
    @settings(drawn(count), derandomize=count < 100)
    @given(plans(**options), st.sampled_from(SPLITTINGS), st.booleans())
    def run(plan: ParametrizedPlan, splitting: str, learning: bool) -> None:
        same_region(plan, backend=backend, splitting=splitting, learning=learning, timeout=20)

    run()


@drawn(8)
@given(plans(**TINY), st.sampled_from(SPLITTINGS), st.booleans(), st.sampled_from(["z3", "cvc5"]))
def test_project_is_the_same_however_it_runs(
    plan: ParametrizedPlan, splitting: str, learning: bool, solver: str
) -> None:
    same_region(plan, splitting=splitting, learning=learning, solver=solver)


@SLOW
@drawn(60)
@given(plans(**TINY))
def test_encodings_describe_the_same_region(plan: ParametrizedPlan) -> None:
    same_region(plan, encoding="positions")


# --- envelopes that are known ----------------------------------------------------------------------------------------

k = reference("k")
SUM = k + reference("m")
NAVIGATION = shipped("two_sample_navigation")


def side(relation: str, constant: int, **factors: int) -> LinearConstraint:
    return LinearConstraint.of(factors, relation, constant)


def constrained(names: Iterable[str], *sides: LinearConstraint) -> Region:
    return Region.union_of(tuple(names), [Polyhedron(tuple(names), sides)])


@pytest.mark.parametrize("backend", ["project", *OTHERS])
@pytest.mark.parametrize("splitting", SPLITTINGS)
def test_two_sample_navigation(backend: str, splitting: str) -> None:
    r, c = NAVIGATION.nominal
    sides = [
        *(side(">=", 20, **{r: 1}), side("<=", 50, **{r: 1})),
        *(side(">=", 60, **{r: 1, c: 1}), side("<=", 85, **{r: 1, c: 1}), side("<=", 128, **{r: 1, c: 2})),
    ]
    result = region(NAVIGATION, backend=backend, splitting=splitting)
    assert result.status is RegionStatus.COMPLETE
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


NOTHING, LINE = LinearConstraint.false(), (side("=", 3, k=1, m=1), side(">=", 0, m=1), side("<=", 4, m=1))
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
    asked: list[str] = []
    original = Session.check

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
    builder = ProblemBuilder(encoding, Solvers(encoding.terms, FormulaReader(encoding.terms)))
    existence = builder.existence()
    assert (existence.name, existence.kept, existence.definitions) == ("some schedule exists", ("k",), ())
    assert existence.formula == conjunction((*existence.network, existence.remainder))
    with pytest.raises(InputError, match="unknown back end 'projekt'; did you mean 'project'"):
        region(fixed_plan(), backend="projekt")
    with pytest.raises(RobustError, match="unknown solver"):
        region(fixed_plan(), solver="z4")


# --- time limits and interruption: an outer bound is returned, and nothing is left running ---------------------------


@pytest.mark.parametrize("backend", ELIMINATORS)
def test_no_time_at_all(backend: str) -> None:
    result = region(NAVIGATION, backend=backend, timeout=0)
    assert (result.status, result.is_exact, result.pieces) == (RegionStatus.TIMEOUT, False, 0)
    assert "outer bound" in result.meaning
    assert NAVIGATION.nominal in result.region


def test_interruption_between_pieces_keeps_what_was_found() -> None:
    """Each piece takes something away; the region of an interrupted run contains the envelope."""
    pieces: list[Polyhedron] = []

    def stop(piece: Polyhedron) -> None:
        pieces.append(piece)
        if len(pieces) == 2:
            raise KeyboardInterrupt

    result, envelope = region(NAVIGATION, on_piece=stop), region(NAVIGATION)
    assert (result.status, result.pieces, len(pieces)) == (RegionStatus.INTERRUPTED, 2, 2)
    assert (envelope.status, envelope.meaning) == (RegionStatus.COMPLETE, "the robustness envelope")
    assert envelope.region.is_subset_of(result.region)
    assert not result.region.is_subset_of(envelope.region)
    assert all(piece.some_point() not in result.region for piece in pieces)


# Python may drop the exception in a finaliser of a solver's objects; that it is noticed all the same is the point.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    ("backend", "status"),
    [
        *((backend, RegionStatus.TIMEOUT) for backend in (*OURS, *REFEREES)),
        *((backend, RegionStatus.INTERRUPTED) for backend in (*OURS, "cvc5-whole")),
    ],
)
def test_time_limits_and_ctrl_c_are_kept(dataset: Path, backend: str, status: RegionStatus) -> None:
    folder = dataset / "generator-linear"
    plan = load_plan(folder / "domain.pddl", folder / "problem_07.pddl", folder / "plan_07_4.stn")
    limited = status is RegionStatus.TIMEOUT
    started = time.monotonic()
    with nullcontext() if limited else interrupted_after(0.4):
        result = region(plan, backend=backend, splitting="partial", timeout=0.4 if limited else None)
    assert result.status is status
    assert time.monotonic() - started < 10


# --- recorded boxes are inside the exact envelope of the instances that they were found for --------------------------

QUICK = ("auv_mission_10_0_0", "auv_mission_10_0_4", "auv_mission_10_0_9", "solar_rover_01_4", "generator_linear_05_2")
SECONDS = 60
"""Within this time at least two other back ends agree with the default one."""


def computed(dataset: Path, name: str = "", **options: Any) -> Iterator[tuple[dict[str, Any], RegionResult]]:
    """The records of that name, or all, with the complete regions of their plans."""
    for record in json.loads((dataset / "recorded-results.json").read_text()):
        brief = record["instance"].startswith(("auv", "solar")) or record["instance"].endswith("_1")
        if name == record["instance"] or (not name and (brief or options.get("backend", "project") in OURS)):
            plan = load_plan(dataset / record["domain"], dataset / record["problem"], dataset / record["plan"])
            result = region(plan, timeout=300, **options)
            assert result.status is RegionStatus.COMPLETE, record["instance"]
            yield record, result


@pytest.mark.parametrize("name", [*QUICK, pytest.param("", marks=SLOW)])
def test_recorded_boxes_are_inside(dataset: Path, name: str) -> None:
    for record, result in computed(dataset, name):
        for recorded in (record[key] for key in ("irr_box", "ccmmz_box") if record.get(key)):
            if all("inf" not in end for ends in recorded.values() for end in ends):
                box = Box({name: Interval(*map(Fraction, ends)) for name, ends in recorded.items()})
                assert Region.of_box(result.region.parameters, box).is_subset_of(result.region), record["instance"]


@pytest.mark.parametrize(
    ("backend", "name"),
    [
        *((backend, "generator_linear_05_2") for backend in OURS[1:]),
        *(pytest.param(backend, "", marks=SLOW) for backend in OTHERS),
    ],
)
def test_back_ends_agree_on_recorded_instances(dataset: Path, backend: str, name: str) -> None:
    """Our own on all of them, those of solvers on the quick ones."""
    for record, other in computed(dataset, name, backend=backend):
        assert backend not in OURS or other.seconds < SECONDS, record["instance"]
        ((_, default),) = computed(dataset, record["instance"])
        assert not differ(other.region, default.region), record["instance"]
