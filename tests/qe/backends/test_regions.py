"""Regions of plans: against the verdict of the checker at points, back end against back end, and known envelopes."""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import robust.examples
from robust.api import check
from robust.errors import InputError, RobustError, UnsupportedError
from robust.irr.check import Answer
from robust.plan.load import load_plan
from robust.plan.model import (
    ZERO,
    ActionInstance,
    Comparison,
    Parameter,
    ParameterReference,
    ParametrizedPlan,
    Relation,
    TemporalConstraint,
    TimedCondition,
    Timing,
)
from robust.plan.polynomial import Polynomial
from robust.qe.compute import RegionResult, RegionStatus
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.smt.session import Session, Verdict
from robust.smt.terms import Terms
from tests.qe.backends.formulas import region
from tests.sampling import sample_parameters
from tests.strategies import plans

EXAMPLES = Path(robust.examples.__file__).parent
OTHERS = ("fourier-motzkin", "loos-weispfenning", "z3", "z3-qe", "cvc5", "cvc5-whole")
SPLITTINGS = ("monolithic", "partial", "full")
relaxed = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
small = plans(linear=True, instances=3, fluents=1)
tiny = plans(linear=True, instances=2, fluents=1, parameters=2)


def differ(left: Region, right: Region) -> bool:
    """Whether two regions differ, by a solver (and not by the regions' own algorithms)."""
    terms = Terms()
    session = Session(terms)
    session.add(terms.negation(terms.equivalence(left.to_formula(terms), right.to_formula(terms))))
    verdict = session.check("difference")
    assert verdict is not Verdict.UNKNOWN
    return verdict is Verdict.SATISFIABLE


def is_valid_at(plan: ParametrizedPlan, point: dict[str, Fraction]) -> bool:
    """Whether the checker proves the plan at a point that declared bounds allow."""
    for parameter in plan.parameters:
        value = point[parameter.name]
        if (parameter.lower is not None and value < parameter.lower) or (
            parameter.upper is not None and value > parameter.upper
        ):
            return False
    try:
        answer = check(plan, at=point).answer
    except InputError:
        return False  # no schedule whatever the parameters are
    assert answer is not Answer.UNKNOWN
    return answer is Answer.PROVED


def points(plan: ParametrizedPlan, result: RegionResult, random: Random, count: int) -> list[dict[str, Fraction]]:
    """Points near the nominal one, one of the region, one of each of some pieces."""
    found = [sample_parameters(plan, random) for _ in range(count)]
    base = result.region.base
    assert base is not None
    inside = [result.region.some_point(), base.some_point(), *(p.some_point() for p in result.region.pieces[:3])]
    return [*found, *(point for point in inside if point is not None)]


def complete(plan: ParametrizedPlan, **options: object) -> RegionResult:
    try:
        result = region(plan, **options)  # type: ignore[arg-type]
    except UnsupportedError:
        assume(False)
        raise
    assert result.status is RegionStatus.COMPLETE
    assert result.is_exact
    return result


def agrees_with_checker(plan: ParametrizedPlan, random: Random, count: int, **options: object) -> None:
    result = complete(plan, **options)
    for point in points(plan, result, random, count):
        assert (point in result.region) == is_valid_at(plan, point), point


@given(small, st.randoms(use_true_random=False))
@settings(relaxed, max_examples=25)
def test_points_are_inside_if_and_only_if_the_plan_is_valid_there(plan: ParametrizedPlan, random: Random) -> None:
    agrees_with_checker(plan, random, 3)


@pytest.mark.slow
@given(plans(linear=True), st.randoms(use_true_random=False))
@settings(relaxed, max_examples=600)
def test_points_exhaustively(plan: ParametrizedPlan, random: Random) -> None:
    agrees_with_checker(plan, random, 6)


@pytest.mark.slow
@given(plans(linear=True, instances=5, fluents=0, timed_literals=True), st.randoms(use_true_random=False))
@settings(relaxed, max_examples=300)
def test_points_of_plans_that_are_mostly_networks(plan: ParametrizedPlan, random: Random) -> None:
    agrees_with_checker(plan, random, 6)


@pytest.mark.parametrize("backend", OTHERS)
@given(tiny, st.sampled_from(SPLITTINGS), st.booleans())
@settings(relaxed, max_examples=4)
def test_back_ends_agree(backend: str, plan: ParametrizedPlan, splitting: str, learning: bool) -> None:
    agree(plan, backend, splitting, learning)


@pytest.mark.slow
@pytest.mark.parametrize("backend", OTHERS)
@given(small, st.sampled_from(SPLITTINGS), st.booleans())
@settings(relaxed, max_examples=150)
def test_back_ends_agree_exhaustively(backend: str, plan: ParametrizedPlan, splitting: str, learning: bool) -> None:
    agree(plan, backend, splitting, learning)


@given(tiny, st.sampled_from(SPLITTINGS), st.booleans(), st.sampled_from(["z3", "cvc5"]))
@settings(relaxed, max_examples=8)
def test_project_is_the_same_however_it_runs(
    plan: ParametrizedPlan, splitting: str, learning: bool, solver: str
) -> None:
    reference = complete(plan)
    assert not differ(reference.region, complete(plan, splitting=splitting, learning=learning, solver=solver).region)


@pytest.mark.slow
@given(tiny)
@settings(relaxed, max_examples=60)
def test_encodings_describe_the_same_region(plan: ParametrizedPlan) -> None:
    assert not differ(complete(plan).region, complete(plan, encoding="positions").region)


def agree(plan: ParametrizedPlan, backend: str, splitting: str, learning: bool) -> None:
    reference = complete(plan)
    try:
        other = region(plan, backend=backend, splitting=splitting, learning=learning, timeout=20)
    except UnsupportedError:
        assume(False)  # cvc5 and Boolean symbols
        raise
    if other.is_exact:
        assert not differ(reference.region, other.region)
    else:
        assert not differ(reference.region.intersection(other.region), reference.region)


@given(plans(linear=True, instances=2, fluents=1, parameters=1))
@settings(relaxed, max_examples=12)
def test_one_parameter_sweeps(plan: ParametrizedPlan) -> None:
    assume(len(plan.parameters) == 1)
    found = complete(plan).region
    for eighth in range(-8, 56, 4):
        point = {plan.parameters[0].name: Fraction(eighth, 8)}
        assert (point in found) == is_valid_at(plan, point), point


# --- envelopes that are known ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", ["project", *OTHERS])
@pytest.mark.parametrize("splitting", SPLITTINGS)
def test_two_sample_navigation(backend: str, splitting: str) -> None:
    folder = EXAMPLES / "two_sample_navigation"
    plan = load_plan(folder / "domain.pddl", folder / "problem.pddl", folder / "plan.stn")
    r, c = (parameter.name for parameter in plan.parameters)
    sides = [
        LinearConstraint.of({r: 1}, ">=", 20),
        LinearConstraint.of({r: 1}, "<=", 50),
        LinearConstraint.of({r: 1, c: 1}, ">=", 60),
        LinearConstraint.of({r: 1, c: 1}, "<=", 85),
        LinearConstraint.of({r: 1, c: 2}, "<=", 128),
    ]
    result = region(plan, backend=backend, splitting=splitting)
    assert result.status is RegionStatus.COMPLETE
    assert not differ(result.region, Region.union_of((r, c), [Polyhedron((r, c), tuple(sides))]))


def fixed_plan(
    *parameters: Parameter, condition: Comparison | None = None, length: str | None = None
) -> ParametrizedPlan:
    """One action from 0, of duration 2 or of the named parameter, with a condition over parameters at its start."""
    conditions = () if condition is None else (TimedCondition(Timing.AT_START, condition, "condition"),)
    action = ActionInstance("i", "act", (), True, (), conditions)
    bound: Polynomial = Polynomial.constant(2) if length is None else Polynomial.variable(ParameterReference(length))
    constraints = (
        TemporalConstraint(ZERO, action.start, Polynomial.constant(0), Polynomial.constant(0)),
        TemporalConstraint(action.start, action.end, bound, bound),
    )
    return ParametrizedPlan("fixed", parameters, (action,), constraints, frozenset(), {}, (), ())


def k(name: str = "k", lower: int | None = None, upper: int | None = None) -> Parameter:
    bounds = (Fraction(bound) if bound is not None else None for bound in (lower, upper))
    return Parameter(name, Fraction(1), Fraction(1), *bounds)


def compared(expression: dict[str, int], constant: int, relation: Relation) -> Comparison:
    terms = {(ParameterReference(name),): Fraction(factor) for name, factor in expression.items()}
    return Comparison(Polynomial({**terms, (): Fraction(constant)}), relation)


@pytest.mark.parametrize("backend", ["project", *OTHERS])
def test_unusual_regions(backend: str) -> None:
    def of(plan: ParametrizedPlan) -> Region:
        return region(plan, backend=backend).region

    assert {} in of(fixed_plan())
    assert of(fixed_plan(condition=compared({}, -1, Relation.AT_LEAST))).is_empty
    assert of(fixed_plan(k(), condition=compared({}, -1, Relation.AT_LEAST))).is_empty
    unbounded = of(fixed_plan(k()))
    assert not differ(unbounded, Region.universe(("k",)))
    point = of(fixed_plan(k(), condition=compared({"k": 1}, -3, Relation.EQUAL)))
    assert not differ(point, constrained(("k",), [LinearConstraint.of({"k": 1}, "=", 3)]))
    line = of(fixed_plan(k(), k("m", 0, 4), condition=compared({"k": 1, "m": 1}, -3, Relation.EQUAL)))
    sides = [LinearConstraint.of({"k": 1, "m": 1}, "=", 3), LinearConstraint.of({"m": 1}, ">=", 0)]
    assert not differ(line, constrained(("k", "m"), [*sides, LinearConstraint.of({"m": 1}, "<=", 4)]))
    holes = of(fixed_plan(k(upper=9), condition=compared({"k": 1}, -3, Relation.DIFFERENT)))
    assert {"k": Fraction(3)} not in holes
    assert {"k": Fraction(9)} in holes
    assert {"k": Fraction(10)} not in holes
    durations = of(fixed_plan(k(), length="k"))
    assert not differ(durations, constrained(("k",), [LinearConstraint.of({"k": 1}, ">=", 0)]))


def constrained(names: tuple[str, ...], sides: Iterable[LinearConstraint]) -> Region:
    return Region.union_of(names, [Polyhedron(names, tuple(sides))])


def test_wrong_options_are_told() -> None:
    with pytest.raises(InputError, match="unknown back end 'projekt'; did you mean 'project'"):
        region(fixed_plan(), backend="projekt")
    with pytest.raises(InputError, match="unknown splitting 'fully'; did you mean 'full'"):
        region(fixed_plan(), splitting="fully")
    with pytest.raises(RobustError, match="unknown solver"):
        region(fixed_plan(), solver="z4")
