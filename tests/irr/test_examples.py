"""Hand-made plans whose exact envelope is known."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from itertools import product

import pytest

from robust.api import check
from robust.api import envelope as any_envelope
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError, UnsupportedError
from robust.irr.check import Answer
from robust.irr.containment import Containment
from robust.plan.model import ZERO, Or
from robust.probability.risk import METHODS
from robust.qe.box import Box, Interval, Side
from robust.searching import Status
from robust.smt.limits import Deadline
from tests.irr.building import fail_at_query, lasts, parameter, shipped, timed
from tests.plan import building
from tests.plan.building import (
    DURATION,
    END,
    START,
    F,
    action,
    at,
    at_least,
    at_most,
    between,
    increase,
    plan_of,
    value,
)

k, m = building.reference("k"), building.reference("m")
envelope = partial(any_envelope, method="irr")
both_solvers = pytest.mark.parametrize("solver", ["z3", "cvc5"])
either_way = pytest.mark.parametrize("doubling", [False, True])
VALID, BROKEN = (timed(parameter("k", nominal), pieces=lasts(3, 11)) for nominal in (6, 2))


# --- the shipped example ----------------------------------------------------------------------------------------------

NAVIGATION = shipped("two_sample_navigation")
CORNERS = [(20, 40), (20, 54), (42, 43), (50, 10), (50, 35), (32, 48)]


def in_pentagon(ridge: Fraction, crater: Fraction) -> bool:
    return 20 <= ridge <= 50 and 60 <= ridge + crater <= 85 and ridge + 2 * crater <= 128


@both_solvers
def test_navigation_is_valid_exactly_in_the_pentagon(solver) -> None:
    containment = Containment(RelationalEncoding(NAVIGATION), solver=solver)
    small = Fraction(1, 1000)
    steps = list(product((-small, 0, small), repeat=2))
    points = [*product(range(15, 60, 5), range(0, 60, 5)), *((r + dr, c + dc) for r, c in CORNERS for dr, dc in steps)]
    inside = 0
    for ridge, crater in points:
        if crater < 0:
            continue
        point = {"to_ridge": Fraction(ridge), "to_crater": Fraction(crater)}
        found = containment.refute(Box.point(point), Deadline())
        assert (found is None) == in_pentagon(ridge, crater), point
        inside += found is None
    assert 20 < inside < len(points)


@pytest.mark.parametrize("order", [(), ("to_crater",), ("to_ridge", "to_crater")])
@either_way
def test_navigation_boxes_have_their_corners_in_the_pentagon(doubling, order) -> None:
    beta = Fraction(1, 16)
    result = envelope(NAVIGATION, beta=beta, doubling=doubling, order=order)
    assert result.status is Status.COMPLETE
    assert all(in_pentagon(*corner) for corner in product(*result.box.ranges.values()))
    for name, side in product(result.box.intervals, Side):
        beyond = result.box[name].end(side) + side.sign * (2 * beta if doubling else beta)
        grown = result.box.moved((name, side), beyond)
        assert not all(in_pentagon(*corner) for corner in product(*grown.ranges.values()))


# --- one parameter ----------------------------------------------------------------------------------------------------


@either_way
def test_declared_bounds_stop_the_search_where_the_envelope_goes_on(doubling) -> None:
    plan = timed(parameter("k", 6, 5, 9), pieces=lasts(3, 11))
    box = envelope(plan, beta=Fraction(1, 8), doubling=doubling).box["k"]
    assert box.is_within(Interval(Fraction(5), Fraction(9)))
    assert doubling or (box.lower, box.upper) == (5, 9)


def test_a_parameter_declared_at_one_value_stays_there() -> None:
    plan = timed(parameter("k", 6, 6, 6), parameter("m", 1), pieces=lasts(3, 11))
    result = envelope(plan, beta=Fraction(1, 4))
    assert (result.status, result.box["k"]) == (Status.COMPLETE, Interval(Fraction(6), Fraction(6)))
    assert result.box["m"].upper == 5
    assert not any(step.accepted for step in result.trace if step.parameter == "k")


@either_way
@pytest.mark.parametrize(
    "plan", [timed(parameter("k", 6, 6, 6), pieces=lasts(3, 11)), timed(parameter("k", 6), pieces=lasts(6, 6))]
)
def test_nothing_widens_around_the_only_value(plan, doubling) -> None:
    result = envelope(plan, beta=Fraction(1, 4), doubling=doubling)
    assert (result.status, result.box) == (Status.COMPLETE, Box.point({"k": Fraction(6)}))
    assert not any(step.accepted for step in result.trace)
    assert (result.first_widening_seconds, result.convergence()) == (None, ())


@both_solvers
def test_values_of_a_refutation_lie_within_open_ends(solver) -> None:
    """i starts between 0 and k: no schedule below 0. The box (−3, 1] does not hold its worst end."""
    i = action("i")
    constraints = (between(ZERO, i.start, 0, k), between(i.start, i.end, 1, 2))
    plan = plan_of(i, parameters=(parameter("k", 1),), constraints=constraints)
    containment = Containment(RelationalEncoding(plan), solver=solver)
    broken = Box({"k": Interval(Fraction(-3), Fraction(1), False, True)})
    refutation = containment.refute(broken, Deadline())
    assert refutation is not None
    assert refutation.values in broken
    assert refutation.values["k"] < 0
    assert containment.refute(Box({"k": Interval(Fraction(0), Fraction(1), False, False)}), Deadline()) is None


@both_solvers
@either_way
def test_unbounded_directions_end_and_say_so(solver, doubling) -> None:
    up = timed(parameter("k", 6), pieces=((END, at_least(DURATION, 2)),))
    box = envelope(up, beta=Fraction(1, 4), doubling=doubling, solver=solver).box["k"]
    assert box.upper is None
    assert 2 <= box.lower < Fraction(5, 2)
    result = envelope(timed(parameter("k", 0), length=building.number(3)), doubling=doubling, solver=solver)
    assert (result.box["k"], result.unbounded_checks, result.convergence()) == (Interval(None, None), 2, ())


def test_one_of_two_parameters_may_be_unbounded() -> None:
    """f = 2k − m must be at least 0: k may grow for ever, m only until 2k."""
    parameters, f = (parameter("k", 3), parameter("m", 2)), k.scaled(2) - m
    result = envelope(
        timed(*parameters, length=building.number(1), f=f, goal=at_least(value(F), 0)), beta=Fraction(1, 8)
    )
    assert (result.status, result.box["k"].upper, result.box["m"].lower) == (Status.COMPLETE, None, None)
    assert 0 <= 2 * result.box["k"].lower - result.box["m"].upper < Fraction(1, 4)


def test_no_parameters() -> None:
    result = envelope(timed(length=building.number(4), pieces=lasts(3, 5)))
    assert (result.status, result.box, result.checks) == (Status.COMPLETE, Box({}), 0)
    broken = envelope(timed(length=building.number(6), pieces=lasts(3, 5)))
    assert broken.status is Status.INVALID
    assert broken.reason is not None


def test_an_envelope_in_two_parts_stays_in_the_nominal_one() -> None:
    apart = ((END, Or((at_most(DURATION, 4), at_least(DURATION, 7)))),)
    near, plan = (timed(parameter("k", nominal), pieces=apart) for nominal in (2, 9))
    low, high = (envelope(each, beta=Fraction(1, 8)).box["k"] for each in (near, plan))
    assert 4 - Fraction(1, 8) < low.upper <= 4
    assert high.upper is None
    assert 7 <= high.lower < 7 + Fraction(1, 8)
    assert check(plan, at={"k": Interval(Fraction(3), Fraction(8))}).answer is Answer.REFUTED


def test_rates_over_a_fixed_schedule_are_linear() -> None:
    """A tank of 10 drains by k for 4, and by 1 more at once: k ≤ 9/4."""
    pieces = (building.flow(F, -k), increase(F, -1, START), (END, at_least(value(F), 0)))
    fixed = timed(parameter("k", 1), length=building.number(4), pieces=pieces, f=10)
    found = envelope(fixed, beta=Fraction(1, 64)).box["k"]
    assert Fraction(9, 4) - Fraction(1, 64) < found.upper <= Fraction(9, 4)
    assert found.lower is None
    with pytest.raises(UnsupportedError, match="non-linear"):
        envelope(timed(parameter("k", 1), pieces=pieces, f=10))


# --- stopping early ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("plan", [VALID, BROKEN], ids=["valid", "invalid"])
def test_no_time_at_all_claims_nothing(plan, method) -> None:
    result = any_envelope(plan, method=method, timeout=0)
    assert (result.status, result.verified, result.trace) == (Status.TIMEOUT, False, ())
    assert check(plan, timeout=0).answer is Answer.UNKNOWN


@pytest.mark.parametrize("error", [KeyboardInterrupt, "time"])
@pytest.mark.parametrize("at", [1, 2, 5, 9])
def test_what_was_accepted_survives_an_early_end(monkeypatch, error, at) -> None:
    complete = envelope(VALID, beta=Fraction(1, 8))
    steps = []
    fail_at_query(monkeypatch, at, error)
    result = envelope(VALID, beta=Fraction(1, 8), on_step=steps.append)
    assert result.status is (Status.TIMEOUT if error == "time" else Status.INTERRUPTED)
    assert list(result.trace) == steps
    seen = [(s.side, s.accepted, s.box) for s in steps]
    assert seen == [(s.side, s.accepted, s.box) for s in complete.trace[: len(steps)]]
    start = Box.point({"k": Fraction(6)}) if result.verified else Box.nothing(VALID.parameters)
    assert result.box == (steps[-1].box if steps else start)
    assert result.verified or not steps
    assert at != 1 or not result.verified


def test_an_interrupted_check_says_what_it_knows(monkeypatch) -> None:
    fail_at_query(monkeypatch, 2, KeyboardInterrupt)
    result = check(VALID, at={"k": Interval(Fraction(4), Fraction(5))})
    assert (result.interrupted, result.answer) == (True, Answer.UNKNOWN)
    assert Answer.UNKNOWN in result.obligations.values()


def test_ctrl_c_in_a_callback_keeps_the_step_that_was_reported() -> None:
    def stop(step) -> None:
        if step.accepted:
            raise KeyboardInterrupt

    result = envelope(VALID, on_step=stop)
    assert (result.status, result.verified) == (Status.INTERRUPTED, True)
    assert result.box == result.trace[-1].box != Box.point({"k": Fraction(6)})


# --- options ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("search", "options", "message"),
    [
        (envelope, {"order": ["kk"]}, r"unknown parameter 'kk'.*'k'"),
        (any_envelope, {"order": ["kk"]}, "unknown parameter"),
        (envelope, {"order": ["k", "k"]}, "more than once"),
        (check, {"at": {"kk": Fraction(1)}}, r"unknown parameter 'kk'.*'k'"),
    ],
)
def test_parameters_are_known_and_named_once(search, options, message) -> None:
    with pytest.raises(InputError, match=message):
        search(VALID, **options)


def test_steps_alternate_between_parameters_and_count() -> None:
    result = envelope(timed(parameter("k", 3), parameter("m", 3), pieces=lasts(3, 11)), order=["m"])
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
    constraints = (at(i.start, 0), *([between(i.start, i.end, 0)] if explicit else []))
    plan = plan_of(i, constraints=constraints)
    assert check(plan).answer is Answer.PROVED
    assert envelope(plan).status is Status.COMPLETE


@pytest.mark.parametrize("every", [False, True])
def test_values_without_a_schedule_are_refuted_with_a_reason(every) -> None:
    """i lasts k: with k = −1 it would end before 0, so there is no schedule that shows the negative duration."""
    i = action("i")
    constraints = (between(ZERO, i.start, 0, Fraction(1, 2)), between(i.start, i.end, k, k))
    plan = plan_of(i, parameters=(parameter("k", 1),), constraints=constraints)
    result = check(plan, at={"k": Fraction(-1)}, every=every)
    assert (result.answer, result.counterexamples) == (Answer.REFUTED, {})
    assert "k = -1" in result.reason
