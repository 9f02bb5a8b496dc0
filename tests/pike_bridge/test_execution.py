"""The referee: its words, and its agreement with the definition on random executions with many ties."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from robust.errors import InputError
from robust.pike_bridge.model import (
    Activity,
    Choice,
    Condition,
    Constraint,
    Effect,
    Event,
    Guard,
    Literal,
    TeamPlan,
    Tpnu,
    guard,
)
from robust.pike_bridge.semantics import Execution, faults
from robust.plan.model import Atom
from tests.pike_bridge.brute_force import is_met
from tests.pike_bridge.networks import holds
from tests.pike_bridge.plans import team_plans

P = Literal(Atom("p"))
ALWAYS: Guard = frozenset()


@settings(max_examples=500, deadline=None)
@given(team_plans(), st.data())
def test_unmet_conditions_are_those_of_the_definition(plan: TeamPlan, data: st.DataObject) -> None:
    network = plan.network
    scenario = {choice.name: data.draw(st.sampled_from(choice.domain)) for choice in network.choices}
    activated = [each.name for each in network.events if holds(each.guard, scenario)]
    times = st.integers(0, 4).map(lambda half: Fraction(half, 2))
    schedule = {name: data.draw(times) for name in activated}
    found = faults(plan, Execution(scenario, schedule))
    broken = {fault.constraint for fault in found if not hasattr(fault, "condition")}
    assert broken == {
        each
        for each in network.temporal_constraints
        if holds(each.guard, scenario) and not _within(each, schedule[each.target] - schedule[each.source])
    }
    # A condition whose end is before its start breaks its activity's duration, and nothing more can be said of it.
    due = [
        each for each in plan.conditions if holds(each.guard, scenario) and schedule[each.first] <= schedule[each.last]
    ]
    unmet = {fault.condition for fault in found if hasattr(fault, "condition")} & set(due)
    assert unmet == {each for each in due if not is_met(plan, scenario, each, schedule)}
    event(f"{len(unmet)} of {len(due)} conditions unmet")


def _within(constraint: Constraint, difference: Fraction) -> bool:
    lower, upper = constraint.lower, constraint.upper
    return (lower is None or lower <= difference) and (upper is None or difference <= upper)


def small_plan() -> TeamPlan:
    """`make` ends with p, `use` needs p throughout and ends without it, `spoil` may end at the same event as `use`."""
    spoiling = guard({"x": "spoil"})
    network = Tpnu(
        "small",
        (Choice("x", ("spoil", "wait"), True, "s1"),),
        tuple(Event(name) for name in ("s1", "e1", "s2", "e2")),
        (Constraint("e1", "s2", Fraction(0), Fraction(5)),),
        (
            Activity("(make)", "s1", "e1", Fraction(1), Fraction(1)),
            Activity("(use)", "s2", "e2", Fraction(1), Fraction(2)),
            Activity("(spoil)", "s1", "e2", Fraction(1), None, guard=spoiling),
        ),
    )
    return TeamPlan(
        network,
        (Condition(P, "s2", "e2", ALWAYS, 1),),
        (
            Effect(P, "e1", ALWAYS, 0),
            Effect(P.negation, "e2", ALWAYS, 1),
            Effect(P.negation, "e2", spoiling, 2),
        ),
    )


def texts(choice: str, s1: int, e1: int, s2: int, e2: int) -> list[str]:
    times = {"s1": s1, "e1": e1, "s2": s2, "e2": e2}
    schedule = {name: Fraction(time) for name, time in times.items()}
    return [str(fault) for fault in faults(small_plan(), Execution({"x": choice}, schedule))]


def test_an_activity_may_end_what_it_needs() -> None:
    assert texts("wait", 0, 1, 2, 3) == []


def test_another_activity_at_the_same_event_may_not() -> None:
    assert texts("spoil", 0, 1, 2, 3) == ["(use) needs (p) at 3, but e2 makes (not (p)) true"]


def test_a_producer_at_the_same_time_is_too_late() -> None:
    assert texts("wait", 0, 1, 1, 2) == ["(use) needs (p) at 1, but nothing has established it"]


def test_temporal_faults_have_words() -> None:
    assert texts("wait", 0, 2, 8, 9) == [
        "s2 is 6 after e1; expected between 0 and 5",
        "e1 is 2 after s1; expected between 1 and 1",
    ]


@pytest.mark.parametrize(
    ("scenario", "schedule", "message"),
    [
        ({}, {}, "choice x has value None; expected one of spoil, wait"),
        ({"x": "sp"}, {}, "choice x has value sp"),
        ({"x": "wait"}, {"s1": 0, "e1": 1, "s2": 2}, "activated event e2 has no time"),
        ({"x": "wait"}, {"s1": 0, "e1": 1, "s2": 2, "e2": 3, "e9": 4}, "event e9 has a time, but is not activated"),
    ],
)
def test_what_is_no_execution_is_an_error(scenario: dict[str, str], schedule: dict[str, int], message: str) -> None:
    with pytest.raises(InputError, match=message):
        faults(small_plan(), Execution(scenario, {name: Fraction(time) for name, time in schedule.items()}))
