"""Hand-made plans whose exact envelope is known."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from itertools import product
from pathlib import Path

import pytest

from robust.api import check
from robust.api import envelope as any_envelope
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError, UnsupportedError
from robust.irr.check import Answer
from robust.irr.containment import Containment
from robust.irr.search import Status
from robust.plan.load import load_plan
from robust.plan.model import (
    ZERO,
    Comparison,
    Or,
    Parameter,
    ParameterReference,
    ParametrizedPlan,
    Relation,
    TemporalConstraint,
)
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Interval, Side
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from tests.plan.building import (
    DURATION,
    END,
    START,
    F,
    action,
    at_least,
    at_most,
    flow,
    increase,
    number,
    plan_of,
    value,
)

envelope = partial(any_envelope, method="irr")
EXAMPLES = Path(__file__).parents[2] / "robust" / "examples" / "two_sample_navigation"
both_solvers = pytest.mark.parametrize("solver", ["z3", "cvc5"])


def use(name: str) -> Polynomial:
    return Polynomial.variable(ParameterReference(name))


def parameter(name: str, nominal: Fraction | int, lower: int | None = None, upper: int | None = None) -> Parameter:
    ends = [None if end is None else Fraction(end) for end in (lower, upper)]
    return Parameter(name, Fraction(nominal), lower=ends[0], upper=ends[1])


def timed(*parameters: Parameter, length: Polynomial, pieces=(), **options) -> ParametrizedPlan:
    """One action from 1 to 1 + length."""
    i = action("i", *pieces)
    constraints = (
        TemporalConstraint(ZERO, i.start, number(1), number(1)),
        TemporalConstraint(i.start, i.end, length, length),
    )
    return plan_of(i, parameters=parameters, constraints=constraints, **options)


def between(low: int, high: int):
    return ((END, at_least(DURATION, low)), (END, at_most(DURATION, high)))


# --- the shipped example ----------------------------------------------------------------------------------------------


def in_pentagon(ridge: Fraction, crater: Fraction) -> bool:
    return 20 <= ridge <= 50 and 60 <= ridge + crater <= 85 and ridge + 2 * crater <= 128


@pytest.fixture(scope="module")
def navigation() -> ParametrizedPlan:
    return load_plan(*(EXAMPLES / name for name in ("domain.pddl", "problem.pddl", "plan.stn")))


@both_solvers
def test_navigation_is_valid_exactly_in_the_pentagon(navigation, solver) -> None:
    containment = Containment(RelationalEncoding(navigation), solver=solver)
    small = Fraction(1, 1000)
    corners = [(20, 40), (20, 54), (42, 43), (50, 10), (50, 35), (32, 48)]
    grid = [*product(range(15, 60, 5), range(0, 60, 5)), *corners]
    steps = list(product((-small, 0, small), repeat=2))
    points = [*grid, *((r + dr, c + dc) for r, c in corners for dr, dc in steps)]
    inside = 0
    for ridge, crater in points:
        if crater < 0:
            continue
        point = {"to_ridge": Fraction(ridge), "to_crater": Fraction(crater)}
        found = containment.refute(Box.point(point), Deadline())
        assert (found is None) == in_pentagon(ridge, crater), point
        inside += found is None
    assert 20 < inside < len(points)


@both_solvers
@pytest.mark.parametrize(("ridge", "crater"), [(20, 40), (20, 54), (50, 10), (50, 35), (42, 43), (30, 40)])
def test_check_confirms_what_the_pentagon_says(navigation, solver, ridge, crater) -> None:
    at = {"to_ridge": Fraction(ridge), "to_crater": Fraction(crater)}
    assert check(navigation, at=at, solver=solver).answer is Answer.PROVED
    outside = {**at, "to_crater": Fraction(90 - ridge)}
    result = check(navigation, at=outside, solver=solver)
    assert result.answer is Answer.REFUTED
    (example,) = result.counterexamples.values()
    assert example.parameters == outside


@pytest.mark.parametrize("order", [(), ("to_crater",), ("to_ridge", "to_crater")])
@pytest.mark.parametrize("doubling", [False, True])
def test_navigation_boxes_have_their_corners_in_the_pentagon(navigation, doubling, order) -> None:
    beta = Fraction(1, 16)
    result = envelope(navigation, beta=beta, doubling=doubling, order=order)
    assert result.status is Status.COMPLETE
    ridge, crater = result.box["to_ridge"], result.box["to_crater"]
    assert all(in_pentagon(r, c) for r in (ridge.lower, ridge.upper) for c in (crater.lower, crater.upper))
    gap = 2 * beta if doubling else beta
    assert not all(in_pentagon(ridge.lower - gap, c) for c in (crater.lower, crater.upper))
    assert not all(in_pentagon(ridge.upper + gap, c) for c in (crater.lower, crater.upper))
    assert not all(in_pentagon(r, crater.lower - gap) for r in (ridge.lower, ridge.upper))
    assert not all(in_pentagon(r, crater.upper + gap) for r in (ridge.lower, ridge.upper))


# --- one parameter ----------------------------------------------------------------------------------------------------


@both_solvers
def test_an_interval_is_found_to_the_precision(solver) -> None:
    plan = timed(parameter("k", 6), length=use("k"), pieces=between(3, 11))
    result = envelope(plan, beta=Fraction(1, 64), solver=solver)
    k = result.box["k"]
    assert 3 <= k.lower < 3 + Fraction(1, 64)
    assert 11 - Fraction(1, 64) < k.upper <= 11
    assert result.status is Status.COMPLETE


def test_a_strict_border_is_never_touched() -> None:
    plan = timed(parameter("k", 4), length=use("k"), pieces=((END, at_most(DURATION, 8)),))
    closed = envelope(plan, beta=Fraction(1, 2)).box["k"]
    assert closed.upper == 8
    strict = timed(
        parameter("k", 4), length=use("k"), pieces=((END, Comparison(number(8) - DURATION, Relation.GREATER)),)
    )
    box = envelope(strict, beta=Fraction(1, 2)).box["k"]
    assert Fraction(15, 2) <= box.upper < 8


def test_declared_bounds_stop_the_search_where_the_envelope_goes_on() -> None:
    plan = timed(parameter("k", 6, 5, 9), length=use("k"), pieces=between(3, 11))
    for doubling in (False, True):
        box = envelope(plan, beta=Fraction(1, 8), doubling=doubling).box["k"]
        assert box.is_within(Interval(Fraction(5), Fraction(9)))
        if not doubling:
            assert (box.lower, box.upper) == (5, 9)


def test_a_parameter_declared_at_one_value_stays_there() -> None:
    plan = timed(parameter("k", 6, 6, 6), parameter("m", 1), length=use("k") + use("m"), pieces=between(3, 11))
    result = envelope(plan, beta=Fraction(1, 4))
    assert result.status is Status.COMPLETE
    assert result.box["k"] == Interval(Fraction(6), Fraction(6))
    assert result.box["m"].upper == 5
    assert not any(step.accepted for step in result.trace if step.parameter == "k")


def test_nothing_widens_where_every_parameter_is_declared_at_one_value() -> None:
    result = envelope(timed(parameter("k", 6, 6, 6), length=use("k"), pieces=between(3, 11)))
    assert (result.status, result.box) == (Status.COMPLETE, Box.point({"k": Fraction(6)}))
    assert result.first_widening_seconds is None


@both_solvers
def test_values_of_a_refutation_lie_within_open_ends(solver) -> None:
    """i starts between 0 and k: no schedule below 0. The box (−3, 1] does not hold its worst end."""
    i = action("i")
    constraints = (
        TemporalConstraint(ZERO, i.start, number(0), use("k")),
        TemporalConstraint(i.start, i.end, number(1), number(2)),
    )
    plan = plan_of(i, parameters=(parameter("k", 1),), constraints=constraints)
    containment = Containment(RelationalEncoding(plan), solver=solver)
    broken = Box({"k": Interval(Fraction(-3), Fraction(1), False, True)})
    refutation = containment.refute(broken, Deadline())
    assert refutation is not None
    assert refutation.values in broken
    assert refutation.values["k"] < 0
    assert containment.refute(Box({"k": Interval(Fraction(0), Fraction(1), False, False)}), Deadline()) is None


@both_solvers
@pytest.mark.parametrize("doubling", [False, True])
def test_unbounded_directions_end_and_say_so(solver, doubling) -> None:
    up = timed(parameter("k", 6), length=use("k"), pieces=((END, at_least(DURATION, 2)),))
    box = envelope(up, beta=Fraction(1, 4), doubling=doubling, solver=solver).box["k"]
    assert box.upper is None
    assert 2 <= box.lower < Fraction(5, 2)
    free = timed(parameter("k", 0), length=number(3))
    result = envelope(free, doubling=doubling, solver=solver)
    assert result.box["k"] == Interval(None, None)
    assert result.unbounded_checks == 2
    assert result.convergence() == ()


def test_one_of_two_parameters_may_be_unbounded() -> None:
    """f = 2k − m must be at least 0: k may grow for ever, m only until 2k."""
    plan = timed(parameter("k", 3), parameter("m", 2), length=number(1), f=use("k").scaled(2) - use("m"))
    goal = at_least(value(F), 0)
    plan = plan_of(
        *plan.instances, parameters=plan.parameters, constraints=plan.constraints, f=plan.initial_fluents[F], goal=goal
    )
    result = envelope(plan, beta=Fraction(1, 8))
    k, m = result.box["k"], result.box["m"]
    assert k.upper is None
    assert m.lower is None
    assert 0 <= 2 * k.lower - m.upper < Fraction(1, 4)
    assert result.status is Status.COMPLETE


@pytest.mark.parametrize("doubling", [False, True])
def test_an_envelope_of_one_point(doubling) -> None:
    plan = timed(parameter("k", 6), length=use("k"), pieces=between(6, 6))
    result = envelope(plan, beta=Fraction(1, 4), doubling=doubling)
    assert result.status is Status.COMPLETE
    assert result.box == Box.point({"k": Fraction(6)})
    assert not any(step.accepted for step in result.trace)
    assert result.first_widening_seconds is None
    assert result.convergence() == ()


def test_no_parameters() -> None:
    result = envelope(timed(length=number(4), pieces=between(3, 5)))
    assert (result.status, result.box, result.checks) == (Status.COMPLETE, Box({}), 0)
    broken = envelope(timed(length=number(6), pieces=between(3, 5)))
    assert broken.status is Status.INVALID
    assert broken.reason is not None


def test_an_envelope_in_two_parts_stays_in_the_nominal_one() -> None:
    apart = ((END, Or((at_most(DURATION, 4), at_least(DURATION, 7)))),)
    low = envelope(timed(parameter("k", 2), length=use("k"), pieces=apart), beta=Fraction(1, 8)).box["k"]
    high = envelope(timed(parameter("k", 9), length=use("k"), pieces=apart), beta=Fraction(1, 8)).box["k"]
    assert 4 - Fraction(1, 8) < low.upper <= 4
    assert high.upper is None
    assert 7 <= high.lower < 7 + Fraction(1, 8)
    assert (
        check(
            timed(parameter("k", 9), length=use("k"), pieces=apart), at={"k": Interval(Fraction(3), Fraction(8))}
        ).answer
        is Answer.REFUTED
    )


def test_rates_over_a_fixed_schedule_are_linear() -> None:
    """A tank of 10 drains by k for 4, and by 1 more at once: k ≤ 9/4."""
    pieces = (flow(F, -use("k")), increase(F, -1, START), (END, at_least(value(F), 0)))
    plan = timed(parameter("k", 1), length=number(4), pieces=pieces, f=10)
    k = envelope(plan, beta=Fraction(1, 64)).box["k"]
    assert Fraction(9, 4) - Fraction(1, 64) < k.upper <= Fraction(9, 4)
    assert k.lower is None
    with pytest.raises(UnsupportedError, match="non-linear"):
        envelope(timed(parameter("k", 1), length=use("k"), pieces=pieces, f=10))


def test_epsilon_separation_is_part_of_the_envelope() -> None:
    """i's end reads what its start writes: its duration is at least ε."""
    pieces = (increase(F, 1, START), (END, at_least(value(F), 1)))
    plan = timed(parameter("k", 2), length=use("k"), pieces=pieces)
    epsilon = Fraction(1, 4)
    lower = envelope(plan, beta=Fraction(1, 64), epsilon=epsilon).box["k"].lower
    assert epsilon <= lower < epsilon + Fraction(1, 64)
    assert check(plan, at={"k": epsilon}, epsilon=epsilon).answer is Answer.PROVED
    result = check(plan, at={"k": epsilon - Fraction(1, 10**9)}, epsilon=epsilon)
    assert result.answer is Answer.REFUTED
    assert list(result.counterexamples) == ["separation: i.start, i.end"]


# --- stopping early ---------------------------------------------------------------------------------------------------


def valid_plan() -> ParametrizedPlan:
    return timed(parameter("k", 6), length=use("k"), pieces=between(3, 11))


def invalid_plan() -> ParametrizedPlan:
    return timed(parameter("k", 2), length=use("k"), pieces=between(3, 11))


@pytest.mark.parametrize("plan", [valid_plan(), invalid_plan()], ids=["valid", "invalid"])
def test_no_time_at_all_claims_nothing(plan) -> None:
    result = envelope(plan, timeout=0)
    assert result.status is Status.TIMEOUT
    assert not result.verified
    assert result.trace == ()
    assert check(plan, timeout=0).answer is Answer.UNKNOWN


@pytest.mark.parametrize("error", [KeyboardInterrupt, "time"])
@pytest.mark.parametrize("at", [1, 2, 5, 9])
def test_what_was_accepted_survives_an_early_end(monkeypatch, error, at) -> None:
    complete = envelope(valid_plan(), beta=Fraction(1, 8))
    steps = []
    _fail_at_query(monkeypatch, at, error)
    result = envelope(valid_plan(), beta=Fraction(1, 8), on_step=steps.append)
    assert result.status is (Status.TIMEOUT if error == "time" else Status.INTERRUPTED)
    assert list(result.trace) == steps
    seen = [(s.side, s.accepted, s.box) for s in steps]
    assert seen == [(s.side, s.accepted, s.box) for s in complete.trace[: len(steps)]]
    assert result.box == (steps[-1].box if steps else Box.point({"k": Fraction(6)}))
    assert result.verified or not steps
    assert at != 1 or not result.verified


def _fail_at_query(monkeypatch, number_: int, error) -> None:
    """The query of that number ends with KeyboardInterrupt, or UNKNOWN as if out of time."""
    original, count = Session.check, []

    def failing(self, question, deadline):
        count.append(question)
        if len(count) < number_:
            return original(self, question, deadline)
        if error == "time":
            return Verdict.UNKNOWN
        raise error

    monkeypatch.setattr(Session, "check", failing)


def test_an_interrupted_check_says_what_it_knows(monkeypatch) -> None:
    _fail_at_query(monkeypatch, 2, KeyboardInterrupt)
    result = check(
        timed(parameter("k", 6), length=use("k"), pieces=between(3, 11)), at={"k": Interval(Fraction(4), Fraction(5))}
    )
    assert result.interrupted
    assert result.answer is Answer.UNKNOWN
    assert Answer.UNKNOWN in result.obligations.values()


def test_ctrl_c_in_a_callback_keeps_the_step_that_was_reported() -> None:
    def stop(step) -> None:
        if step.accepted:
            raise KeyboardInterrupt

    result = envelope(valid_plan(), on_step=stop)
    assert result.status is Status.INTERRUPTED
    assert result.verified
    assert result.box == result.trace[-1].box != Box.point({"k": Fraction(6)})


# --- options ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("beta", [Fraction(0), Fraction(-1)])
def test_precision_must_be_positive(beta) -> None:
    with pytest.raises(InputError, match="beta"):
        envelope(valid_plan(), beta=beta)


def test_orders_must_name_each_parameter_at_most_once() -> None:
    with pytest.raises(InputError, match=r"unknown parameter 'kk'.*'k'"):
        envelope(valid_plan(), order=["kk"])
    with pytest.raises(InputError, match="more than once"):
        envelope(valid_plan(), order=["k", "k"])


def test_check_refuses_unknown_parameters_and_empty_intervals() -> None:
    with pytest.raises(InputError, match=r"unknown parameter 'kk'.*'k'"):
        check(valid_plan(), at={"kk": Fraction(1)})
    with pytest.raises(InputError):
        check(invalid_plan(), at={"k": Interval(Fraction(3), Fraction(2))})


def test_steps_alternate_between_parameters_and_count() -> None:
    plan = timed(parameter("k", 3), parameter("m", 3), length=use("k") + use("m"), pieces=between(3, 11))
    result = envelope(plan, order=["m"])
    assert [step.parameter for step in result.trace[:4]] == ["m", "k", "m", "k"]
    assert result.trace[0].side is Side.UPPER
    assert result.checks == len(result.trace)
    shares = [share for _, share in result.convergence()]
    assert shares == sorted(shares)
    assert shares[-1] == 1


@pytest.mark.parametrize("explicit", [False, True])
def test_a_point_that_only_zero_keeps_in_place_stays_there(explicit) -> None:
    """i starts at 0 and ends whenever: that its end is not before 0 must reach every query."""
    i = action("i", (END, at_least(DURATION, 0)))
    constraints = [TemporalConstraint(ZERO, i.start, number(0), number(0))]
    if explicit:
        constraints.append(TemporalConstraint(i.start, i.end, number(0), None))
    plan = plan_of(i, constraints=tuple(constraints))
    assert check(plan).answer is Answer.PROVED
    assert envelope(plan).status is Status.COMPLETE


@pytest.mark.parametrize("every", [False, True])
def test_values_without_a_schedule_are_refuted_with_a_reason(every) -> None:
    """i lasts k: with k = −1 it would end before 0, so there is no schedule that shows the negative duration."""
    i = action("i")
    constraints = (
        TemporalConstraint(ZERO, i.start, number(0), number(Fraction(1, 2))),
        TemporalConstraint(i.start, i.end, use("k"), use("k")),
    )
    plan = plan_of(i, parameters=(parameter("k", 1),), constraints=constraints)
    result = check(plan, at={"k": Fraction(-1)}, every=every)
    assert result.answer is Answer.REFUTED
    assert result.reason is not None
    assert "k = -1" in result.reason
    assert result.counterexamples == {}
