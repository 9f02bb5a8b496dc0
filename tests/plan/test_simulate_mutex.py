"""Which time points the simulator separates: one case per kind of interference of docs/semantics.md."""

from __future__ import annotations

from fractions import Fraction

import pytest

from robust.plan.model import (
    And,
    DurationConstraint,
    Holds,
    Or,
    TimedLiteral,
)
from robust.plan.simulate import Violation, simulate
from tests.plan.building import (
    ALL,
    DURATION,
    END,
    EPSILON,
    START,
    F,
    G,
    P,
    Q,
    action,
    add,
    assign,
    at_least,
    broken,
    delete,
    flow,
    increase,
    instant,
    plan_of,
    run,
    schedule_of,
    separated,
    value,
)

WAITING = instant("w", (START, at_least(value(F), 0)))


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (instant("a", (START, Holds(P))), instant("b", add(P))),
        (instant("a", (START, Holds(P, False))), instant("b", delete(P))),
        (instant("a", (START, Or((Holds(Q), Holds(P))))), instant("b", add(P))),
        (instant("a", add(P)), instant("b", delete(P))),
        (instant("a", add(P), delete(P)), instant("b", add(P))),
        (instant("a", add(Q, START, Holds(P))), instant("b", add(P))),
        (instant("a", add(P, START, at_least(value(F), 9))), instant("b", delete(P))),
        (instant("a", assign(F, 1)), instant("b", assign(F, 1))),
        (instant("a", assign(F, 1)), instant("b", increase(F, 1))),
        (instant("a", (START, at_least(value(F), -9))), instant("b", increase(F, 1))),
        (instant("a", increase(G, value(F))), instant("b", increase(F, 1))),
        (instant("a", add(P, START, at_least(value(F), 0))), instant("b", increase(F, 1))),
    ],
)
def test_mutex_of_instantaneous_actions(a, b):
    assert separated(a, b) == ["a, b"]


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (instant("a", add(P)), instant("b", add(P))),
        (instant("a", delete(P)), instant("b", delete(P))),
        (instant("a", (START, Holds(P))), instant("b", (START, Holds(P, False)), add(Q))),
        (instant("a", increase(F, 1)), instant("b", increase(F, -2))),
        (instant("a", assign(F, 1)), instant("b", assign(G, 1))),
        (instant("a", (START, at_least(value(F), 0))), instant("b", increase(G, value(F)))),
    ],
)
def test_commuting_actions_are_not_mutex(a, b):
    assert separated(a, b) == []


def test_over_all_conditions_are_no_reads():
    assert (
        separated(action("a", (ALL, And((Holds(P), at_least(value(F), 0))))), instant("b", delete(P), assign(F, 1)))
        == []
    )


def test_end_conditions_read_at_the_end_only():
    assert separated(action("a", (END, Holds(P))), instant("b", delete(P))) == ["a.end, b"]


def test_duration_constraints_read_at_their_timing():
    duration = DurationConstraint(START, at_least(DURATION, value(F)), ">= (f)")
    assert separated(action("a", duration), instant("b", increase(F, 1))) == ["a.start, b"]


def test_continuous_effects_increase_at_both_ends():
    pouring = action("a", flow(F, 1))
    assert separated(pouring, instant("b", increase(F, 1))) == []
    assert separated(pouring, action("b", flow(F, 1))) == []
    assert separated(pouring, instant("b", assign(F, 1))) == ["a.start, b", "a.end, b"]
    assert separated(pouring, WAITING) == ["a.start, w", "a.end, w"]


def test_rates_are_read_at_both_ends():
    assert separated(action("a", flow(F, value(G))), instant("b", increase(G, 1))) == ["a.start, b", "a.end, b"]


def test_timed_literals_are_mutex_with_actions_but_not_with_each_other():
    reader = instant("a", (START, Holds(P)), (START, at_least(value(F), 0)))
    at_two = (
        TimedLiteral(Fraction(2), P, False),
        TimedLiteral(Fraction(2), P, True),
        TimedLiteral(Fraction(2), F, Fraction(4)),
    )
    assert separated(reader, literals=at_two) == ["a, @2"]
    assert separated(instant("a", increase(F, 1)), literals=at_two[2:]) == ["a, @2"]
    near = (at_two[0], TimedLiteral(Fraction(20001, 10000), P, True))
    assert run(plan_of(atoms=(P,), literals=near, goal=Holds(P)), {}).valid


def test_separation_of_exactly_epsilon_is_enough():
    plan = plan_of(instant("a", add(P)), instant("b", delete(P)))
    assert run(plan, {"a": 1 + EPSILON, "b": 1}).valid
    close = run(plan, {"a": 1 + EPSILON / 2, "b": 1})
    detail = "a = 2001/2000 and b = 1 are 1/2000 apart, less than 1/1000"
    assert close.violations == (Violation("separation: a, b", Fraction(2001, 2000), detail),)
    schedule = schedule_of(plan, {"a": 1, "b": 2})
    assert broken(simulate(plan, {}, schedule, epsilon=Fraction(3, 2))) == ["separation: a, b"]
