"""The referee and the oracle: their words, and their agreement with the definition, brute force and each other."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from robust.errors import InputError, SolverError
from robust.pike_bridge import builder
from robust.pike_bridge.knowledge.interface import Exclude, Require
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
    Vocabulary,
    guard,
)
from robust.pike_bridge.semantics import Execution, Existence, Oracle, faults
from robust.plan.model import Atom
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.brute_force import correct_scenarios, holds, is_met
from tests.pike_bridge.plans import contested_plans, team_plans, tiny_plans

P = Literal(Atom("p"))
ALWAYS: Guard = frozenset()


@settings(max_examples=500)
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
        (Effect(P, "e1", ALWAYS, 0), Effect(P.negation, "e2", ALWAYS, 1), Effect(P.negation, "e2", spoiling, 2)),
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


def scenarios_of(oracle: Oracle) -> set[frozenset[tuple[str, str]]]:
    found = [frozenset(execution.scenario.items()) for execution in oracle.scenarios()]
    assert len(found) == len(set(found))
    return set(found)


@settings(max_examples=300)
@given(st.one_of(tiny_plans(), contested_plans()))
def test_scenarios_are_those_of_brute_force(plan: TeamPlan) -> None:
    correct = correct_scenarios(plan)
    assert scenarios_of(Oracle(plan)) == correct
    count = Vocabulary(plan.network.domains).count()
    event("all" if len(correct) == count else "some" if correct else "none")


@settings(max_examples=40)
@given(team_plans())
def test_every_scenario_comes_with_a_correct_execution(plan: TeamPlan) -> None:
    for execution in Oracle(plan).scenarios():
        assert faults(plan, execution) == ()


@settings(max_examples=40)
@given(tiny_plans())
def test_cvc5_agrees(plan: TeamPlan) -> None:
    assert Oracle(plan, solver="cvc5").decide().verdict is Oracle(plan).decide().verdict


@settings(max_examples=60)
@given(st.one_of(tiny_plans(), contested_plans()))
def test_deciding_under_assumptions_is_looking_among_scenarios(plan: TeamPlan) -> None:
    oracle = Oracle(plan)
    correct = scenarios_of(oracle)
    for choice in plan.network.choices:
        for value in choice.domain:
            environment = guard({choice.name: value})
            with_value = [scenario for scenario in correct if environment <= scenario]
            assert (oracle.decide(environment).verdict is Existence.EXISTS) == bool(with_value)
            assert oracle.could_commit([Require(environment)]) == bool(with_value)
            assert oracle.could_commit([Exclude(environment)]) == (len(with_value) < len(correct))
            assert {frozenset(each.scenario.items()) for each in oracle.scenarios(environment)} == set(with_value)
            excluded = [frozenset(each.scenario.items()) for each in oracle.scenarios([Exclude(environment)])]
            assert len(excluded) == len(set(excluded))
            assert set(excluded) == correct - set(with_value)
    assert not oracle.could_commit([Exclude(frozenset())])


def test_scenarios_that_activate_the_same_appear_once_each() -> None:
    """Only both choices together make a difference, so that the witnesses' environments overlap."""
    both = guard({"x": "1", "y": "1"})
    network = Tpnu(
        "two",
        tuple(Choice(name, ("1", "2", "3"), True, None) for name in "xy"),
        (Event("e1"), Event("e2", both)),
        (Constraint("e1", "e2", Fraction(2), Fraction(1), both),),
        (),
    )
    oracle = Oracle(TeamPlan(network, (), ()))
    assert len(scenarios_of(oracle)) == 8
    assert len(list(oracle.scenarios(guard({"x": "1"})))) == 2
    assert len(list(oracle.scenarios([Exclude(guard({"x": "2", "y": "2"})), Require(guard({"x": "2"}))]))) == 2


def threatened_plan() -> TeamPlan:
    """`make` produces p for `use`; a parallel `spoil` makes it false in one of two branches."""
    network = builder.build(
        "threatened",
        builder.parallel(
            builder.sequence(builder.act("(make)", 1, 1), builder.act("(use)", 1, 2)),
            builder.choose("x", {"spoil": builder.act("(spoil)", 1, 1), "wait": builder.sequence()}),
        ),
    )
    make, use, spoil = network.activities
    return TeamPlan(
        network,
        (Condition(P, use.source, use.source, use.guard, 1),),
        (Effect(P, make.target, make.guard, 0), Effect(P.negation, spoil.target, spoil.guard, 2)),
    )


@pytest.mark.parametrize(
    ("spoiled", "expected"),
    [
        (Fraction(1, 2), Existence.EXISTS),
        (Fraction(1), Existence.NONE),
        (Fraction(3, 2), Existence.NONE),
        (Fraction(2), Existence.NONE),
        (Fraction(5, 2), Existence.EXISTS),
    ],
)
def test_a_threat_may_not_lie_between_producer_and_consumer(spoiled: Fraction, expected: Existence) -> None:
    plan = threatened_plan()
    make, use, spoil = plan.network.activities
    executed = {make.source: Fraction(0), make.target: Fraction(1), use.source: Fraction(2), spoil.target: spoiled}
    answer = Oracle(plan).decide(guard({"x": "spoil"}), executed)
    assert answer.verdict is expected
    if answer.witness is not None:
        assert executed.items() <= answer.witness.schedule.items()


def test_what_is_not_executed_yet_lies_in_the_future() -> None:
    plan = threatened_plan()
    make = plan.network.activities[0]
    oracle = Oracle(plan)
    begun = {"e1": Fraction(-1), make.source: Fraction(0), make.target: Fraction(1)}
    answer = oracle.decide(schedule=begun, now=Fraction(7))
    assert answer.witness is not None
    assert all(time >= 7 for event, time in answer.witness.schedule.items() if event not in begun)
    del begun["e1"]
    assert oracle.decide(schedule=begun).verdict is Existence.EXISTS
    assert oracle.decide(schedule=begun, now=Fraction(7)).verdict is Existence.NONE


def test_events_that_are_executed_are_activated() -> None:
    plan = threatened_plan()
    spoil = plan.network.activities[2]
    oracle = Oracle(plan)
    assert oracle.decide(guard({"x": "wait"}), {spoil.source: Fraction(0)}).verdict is Existence.NONE
    answer = oracle.decide(schedule={spoil.source: Fraction(3)})
    assert answer.witness is not None
    assert answer.witness.scenario == {"x": "spoil"}
    assert answer.witness.schedule[spoil.source] == 3


def test_unknown_names_are_errors() -> None:
    oracle = Oracle(threatened_plan())
    with pytest.raises(InputError, match="unknown assignment x = spill; did you mean"):
        oracle.decide(guard({"x": "spill"}))
    with pytest.raises(InputError, match="the schedule gives a time to nowhere"):
        oracle.decide(schedule={"nowhere": Fraction(0)})
    with pytest.raises(SolverError, match="unknown solver"):
        Oracle(threatened_plan(), solver="abacus")


def test_without_time_there_is_no_verdict() -> None:
    oracle = Oracle(threatened_plan())
    assert oracle.decide(deadline=Deadline.after(0)).verdict is Existence.UNKNOWN
    with pytest.raises(OutOfTimeError):
        oracle.could_commit([], deadline=Deadline.after(0))
    with pytest.raises(OutOfTimeError):
        list(oracle.scenarios(deadline=Deadline.after(0)))


def test_a_plan_without_events_is_correct() -> None:
    network = Tpnu("nothing", (), (), (), ())
    answer = Oracle(TeamPlan(network, (), ())).decide()
    assert answer.verdict is Existence.EXISTS
    assert answer.witness is not None
    assert answer.witness.schedule == {}
