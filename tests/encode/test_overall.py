"""Over-all conditions where they are delicate, and whole plans whose schedule is fixed, against the simulator."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robust.api import check
from robust.encode.encoding import RelationalEncoding, Stage
from robust.errors import InputError
from robust.irr.check import Answer
from robust.plan.model import (
    ZERO,
    And,
    Comparison,
    Condition,
    Holds,
    Or,
    ParametrizedPlan,
    Relation,
    TemporalConstraint,
    TimedLiteral,
    TimePoint,
)
from robust.plan.simulate import simulate
from tests.plan.building import (
    ALL,
    DURATION,
    END,
    START,
    F,
    G,
    P,
    Times,
    above,
    action,
    add,
    assign,
    at_least,
    delete,
    different,
    flow,
    increase,
    instant,
    number,
    plan_of,
    schedule_of,
    value,
)
from tests.sampling import sample_parameters, sample_schedule
from tests.strategies import plans

f, g = value(F), value(G)


def equal(left, right: int) -> Comparison:
    return Comparison(left - right, Relation.EQUAL)


class Case(NamedTuple):
    """What i requires over all between 2 and 6, the rest of the plan, and whether it holds."""

    name: str
    condition: Condition
    others: tuple
    times: Times
    holds: bool
    f: int = 0


CASES = [
    Case("strict bound touched at the open end", above(f, 0), (action("d", flow(F, -1)),), {"d": (2, 6)}, True, 4),
    Case("strict bound touched at the open start", above(f, 0), (action("d", flow(F, 1)),), {"d": (2, 6)}, True),
    Case(
        "strict bound touched at both ends only",
        above(f, 0),
        (action("u", flow(F, 1)), action("d", flow(F, -1))),
        {"u": (2, 4), "d": (4, 6)},
        True,
    ),
    Case(
        "strict bound touched inside",
        above(f, 0),
        (action("d", flow(F, -1)), action("u", flow(F, 1))),
        {"d": (2, 4), "u": (4, 6)},
        False,
        2,
    ),
    Case(
        "bound touched inside",
        at_least(f, 0),
        (action("d", flow(F, -1)), action("u", flow(F, 1))),
        {"d": (2, 4), "u": (4, 6)},
        True,
        2,
    ),
    Case(
        "bound crossed inside and back",
        at_least(f, 0),
        (action("d", flow(F, -1)), action("u", flow(F, 1))),
        {"d": (2, 4), "u": (4, 6)},
        False,
        1,
    ),
    Case("bound crossed just before the end", at_least(f, 0), (action("d", flow(F, -1)),), {"d": (2, 7)}, False, 3),
    Case("bound left just after the end", at_least(f, 0), (action("d", flow(F, -1)),), {"d": (2, 7)}, True, 4),
    Case("flat at a strict bound", above(f, 0), (action("d", flow(F, -1)),), {"d": (6, 7)}, False),
    Case("flat at a bound", at_least(f, 0), (action("d", flow(F, -1)),), {"d": (6, 7)}, True),
    Case("flat at a strict bound, then up", above(f, 0), (action("u", flow(F, 1)),), {"u": (4, 7)}, False),
    Case("up from a strict bound, then flat above", above(f, 0), (action("u", flow(F, 1)),), {"u": (2, 4)}, True),
    Case("down to a strict bound, then flat", above(f, 0), (action("d", flow(F, -1)),), {"d": (2, 5)}, False, 3),
    Case(
        "two flows that cancel, at a strict bound",
        above(f, 0),
        (action("u", flow(F, 1)), action("d", flow(F, -1))),
        {"u": (2, 6), "d": (2, 6)},
        False,
    ),
    Case(
        "two flows that cancel inside, at a strict bound",
        above(f, 0),
        (action("u", flow(F, 1)), action("d", flow(F, -1))),
        {"u": (3, 5), "d": (3, 5)},
        False,
    ),
    Case("a flow of rate 0 inside, at a strict bound", above(f, 0), (action("z", flow(F, 0)),), {"z": (3, 7)}, False),
    Case(
        "the slope only drops inside",
        above(f, 0),
        (action("u", flow(F, 2)), action("d", flow(F, -1))),
        {"u": (1, 4), "d": (3, 6)},
        True,
    ),
    Case(
        "one falls when another stops rising",
        at_least(f, 0),
        (action("u", flow(F, 1)), action("d", flow(F, -1))),
        {"u": (2, 4), "d": (4, 7)},
        True,
    ),
    Case(
        "a jump up at a bound that was touched",
        above(f, 0),
        (action("d", flow(F, -1)), instant("j", increase(F, 3))),
        {"d": (2, 4), "j": 4},
        False,
        2,
    ),
    Case(
        "a jump up in time",
        above(f, 0),
        (action("d", flow(F, -1)), instant("j", increase(F, 3))),
        {"d": (2, 6), "j": 3},
        True,
        2,
    ),
    Case(
        "a jump down to the bound, then up",
        above(f, 0),
        (action("u", flow(F, 1)), instant("j", assign(F, 0))),
        {"u": (1, 7), "j": 4},
        False,
        5,
    ),
    Case(
        "a jump down to the bound at the end",
        above(f, 0),
        (action("u", flow(F, 1)), instant("j", assign(F, 0))),
        {"u": (1, 7), "j": 6},
        True,
        5,
    ),
    Case(
        "a jump down to the bound at the start",
        above(f, 0),
        (action("u", flow(F, 1)), instant("j", assign(F, 0))),
        {"u": (1, 7), "j": 2},
        True,
        5,
    ),
    Case(
        "a jump below at the start",
        at_least(f, 0),
        (action("u", flow(F, 1)), instant("j", assign(F, -1))),
        {"u": (1, 7), "j": 2},
        False,
        5,
    ),
    Case("equal throughout", equal(f, 2), (action("u", flow(F, 1)),), {"u": (1, 2)}, True, 1),
    Case(
        "equal at both ends only",
        equal(f, 0),
        (action("u", flow(F, 1)), action("d", flow(F, -1))),
        {"u": (2, 4), "d": (4, 6)},
        False,
    ),
    Case("different but for one instant", different(f, 2), (action("u", flow(F, 1)),), {"u": (2, 6)}, False),
    Case("different but at the end", different(f, 4), (action("u", flow(F, 1)),), {"u": (2, 6)}, True),
    Case("different but at the start", different(f, 0), (action("u", flow(F, 1)),), {"u": (2, 6)}, True),
    Case(
        "one of two, without a gap",
        Or((at_least(f, 2), at_least(-f, -2))),
        (action("u", flow(F, 1)),),
        {"u": (2, 6)},
        True,
    ),
    Case(
        "one of two, but for one instant",
        Or((above(f, 2), above(-f, -2))),
        (action("u", flow(F, 1)),),
        {"u": (2, 6)},
        False,
    ),
    Case(
        "one of two, with a gap inside",
        Or((at_least(f, 3), at_least(-f, -2))),
        (action("u", flow(F, 1)),),
        {"u": (2, 6)},
        False,
    ),
    Case("both of two", And((above(f, 0), above(-f, -4))), (action("u", flow(F, 1)),), {"u": (2, 6)}, True),
    Case(
        "two fluents, one of them just in time",
        Or((above(f, 0), above(g, 0))),
        (action("d", flow(F, -1)), action("u", flow(G, 1))),
        {"d": (2, 5), "u": (4, 6)},
        True,
        3,
    ),
    Case(
        "two fluents, both at the bound once",
        Or((above(f, 0), above(g, 0))),
        (action("d", flow(F, -1)), action("u", flow(G, 1))),
        {"d": (2, 4), "u": (4, 6)},
        False,
        2,
    ),
    Case(
        "an atom helps where the fluent fails",
        Or((above(f, 0), Holds(P))),
        (action("d", flow(F, -1)), instant("p", add(P))),
        {"d": (2, 5), "p": 4},
        True,
        3,
    ),
    Case(
        "an atom comes when the fluent fails",
        Or((above(f, 0), Holds(P))),
        (action("d", flow(F, -1)), instant("p", add(P))),
        {"d": (2, 4), "p": 4},
        False,
        2,
    ),
    Case(
        "an atom comes when the fluent still holds",
        Or((at_least(f, 0), Holds(P))),
        (action("d", flow(F, -1)), instant("p", add(P))),
        {"d": (2, 5), "p": 4},
        True,
        2,
    ),
    Case(
        "an atom is deleted and added at once",
        Holds(P),
        (instant("a", add(P)), instant("b", delete(P))),
        {"a": 2, "b": 6},
        True,
    ),
    Case(
        "an atom is deleted inside",
        Holds(P),
        (instant("a", add(P)), instant("b", delete(P)), instant("c", add(P))),
        {"a": 1, "b": 4, "c": 5},
        False,
    ),
    Case(
        "elapsed time counts, not the clock",
        at_least(f - DURATION, 0),
        (action("u", flow(F, 1)),),
        {"u": (2, 6)},
        True,
        4,
    ),
]


def pinned(plan: ParametrizedPlan, schedule: dict[TimePoint, Fraction]) -> ParametrizedPlan:
    """The plan with every time point at its time."""
    bounds = {point: number(time) for point, time in schedule.items() if point != ZERO and point.time is None}
    constraints = tuple(TemporalConstraint(ZERO, point, bound, bound) for point, bound in bounds.items())
    return replace(plan, constraints=(*plan.constraints, *constraints))


def windows(plan: ParametrizedPlan, schedule: dict[TimePoint, Fraction]) -> ParametrizedPlan:
    """The plan with every time point at its time, said in a way that leaves all time variables in place."""
    constraints = []
    for point, time in schedule.items():
        if point != ZERO and point.time is None:
            constraints.append(TemporalConstraint(ZERO, point, number(time), None))
            constraints.append(TemporalConstraint(ZERO, point, None, number(time)))
    return replace(plan, constraints=(*plan.constraints, *constraints))


# Mutex time points happen at once in some of the cases, so separation is 0 there.
TOUCHING = Fraction(0)


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
@pytest.mark.parametrize("fix", [pinned, windows])
@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_delicate_conditions(case, fix, solver) -> None:
    plan = plan_of(action("i", (ALL, case.condition)), *case.others, f=case.f)
    schedule = schedule_of(plan, {"i": (2, 6), **case.times})
    label = plan.instances[0].label(plan.instances[0].conditions[0])
    broken = {violation.obligation for violation in simulate(plan, {}, schedule, epsilon=TOUCHING).violations}
    assert (label not in broken) == case.holds, "the simulator"
    result = check(fix(plan, schedule), epsilon=TOUCHING, solver=solver, every=True)
    assert result.obligations[label] is (Answer.PROVED if case.holds else Answer.REFUTED)


@pytest.mark.parametrize("condition", [Holds(P), above(f, 0), different(f, 0), Or((above(f, 0), above(-f, 0)))])
def test_nothing_lies_inside_an_action_of_no_duration(condition) -> None:
    plan = plan_of(action("i", (ALL, condition)), action("u", flow(F, 1)))
    schedule = schedule_of(plan, {"i": (3, 3), "u": (3, 5)})
    assert simulate(plan, {}, schedule).valid
    for fix in (pinned, windows):
        assert check(fix(plan, schedule)).answer is Answer.PROVED


@pytest.mark.parametrize("condition", [above(f, 0), different(f, 0), Or((above(f, 0), above(-f, 0))), Holds(P)])
def test_what_changes_with_the_schedule_is_seen(condition) -> None:
    """u may start any time from 2 to 4, its limit falls inside i or not, so does the literal."""
    literal = TimedLiteral(Fraction(5), P, False)
    plan = plan_of(action("i", (ALL, condition)), action("u", flow(F, 1)), atoms=(P,), f=-3, literals=(literal,))
    i, u = plan.instances

    def between(a, b, low, high):
        return TemporalConstraint(a, b, number(low), number(high))

    def verdict(end: Fraction) -> Answer:
        constraints = (
            between(ZERO, i.start, 1, 1),
            between(ZERO, i.end, end, end),
            between(ZERO, u.start, 2, 4),
            between(u.start, u.end, 6, 6),
        )
        return check(replace(plan, constraints=constraints)).answer

    if condition == above(f, 0):
        assert verdict(Fraction(2)) is Answer.REFUTED
    else:
        assert verdict(Fraction(5)) is Answer.PROVED
        assert verdict(Fraction(51, 10)) is Answer.REFUTED


@pytest.mark.parametrize("encoding", ["relational", "positions"])
@pytest.mark.parametrize(("time", "answer"), [(3, Answer.PROVED), (1, Answer.REFUTED)])
def test_timed_literals_of_fluents_assign(time, answer, encoding) -> None:
    a = instant("a", (START, at_least(f, 7)))
    at = TemporalConstraint(ZERO, a.start, number(time), number(time))
    plan = plan_of(a, literals=(TimedLiteral(Fraction(2), F, Fraction(7)),), constraints=(at,))
    assert check(plan, encoding=encoding).answer is answer


@pytest.mark.parametrize("encoding", ["relational", "positions"])
def test_conditions_are_examined_where_what_is_in_known_order_is_separated(encoding) -> None:
    a, b = instant("a", add(P)), instant("b", (START, Holds(P)))
    later = TemporalConstraint(a.start, b.start, number(0), number(2))
    result = check(plan_of(a, b, constraints=(later,)), every=True, encoding=encoding)
    assert result.obligations == {"separation: a, b": Answer.REFUTED, "b act: c0": Answer.PROVED}


def test_fixed_schedules_break_exactly_what_the_simulator_says() -> None:
    outcomes: Counter[str] = Counter()

    @settings(max_examples=50, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
    @given(plans(linear=True, infeasible=False), st.randoms(use_true_random=True))
    def run(plan, random) -> None:
        outcomes.update(compare_fixed(plan, random))

    run()
    assert outcomes["valid"] >= 3, outcomes
    assert outcomes["broken"] >= 8, outcomes


@pytest.mark.slow
@settings(max_examples=4000, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(plans(linear=True, infeasible=False), st.randoms(use_true_random=True))
def test_many_fixed_schedules_break_exactly_what_the_simulator_says(plan, random) -> None:
    compare_fixed(plan, random)


def compare_fixed(plan: ParametrizedPlan, random) -> list[str]:
    at = sample_parameters(plan, random)
    schedule = sample_schedule(plan, at, random)
    if schedule is None:
        return ["no schedule"]
    simulation = simulate(plan, at, schedule)
    broken = {violation.obligation for violation in simulation.violations}
    fix = random.choice([pinned, windows])
    fixed = fix(plan, schedule)
    stage = {obligation.name: obligation.stage.value for obligation in RelationalEncoding(fixed).obligations}
    earliest = min((stage[name] for name in broken), default=Stage.CONDITION.value)
    expected = {name for name in broken if stage[name] == earliest}
    try:
        result = check(fixed, at=at, every=True)
    except InputError as error:
        raise AssertionError(f"the schedule exists: {schedule}") from error
    refuted = {name for name, answer in result.obligations.items() if answer is Answer.REFUTED}
    # What later stages say of the only schedule is nothing if an earlier stage excludes it.
    assert refuted == expected, schedule
    return ["broken" if broken else "valid", fix.__name__]


def test_start_and_end_conditions_read_the_state_just_before() -> None:
    plan = plan_of(
        action("i", (START, equal(f, 0)), (END, equal(f, 4)), flow(F, 1), increase(F, 10, END)), goal=equal(f, 14)
    )
    schedule = schedule_of(plan, {"i": (3, 7)})
    assert simulate(plan, {}, schedule).valid
    assert check(pinned(plan, schedule), every=True).answer is Answer.PROVED
