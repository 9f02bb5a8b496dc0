"""Counting, going through and restricting scenarios, against all of them one by one."""

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.errors import InputError
from robust.pike_bridge.action_model import with_ends
from robust.pike_bridge.model import (
    EPSILON,
    GOAL,
    INITIAL,
    Assignment,
    Choice,
    Constraint,
    Event,
    Tpnu,
    contradicts,
    guard,
)
from robust.pike_bridge.scenarios import (
    active_choices,
    candidate_subplans,
    restrict,
    restrict_network,
    team_scenario_count,
    team_scenarios,
)
from robust.pike_bridge.validate import validate
from tests.pike_bridge.brute_force import admits_correct_execution, candidate_subplan, holds, scenarios
from tests.pike_bridge.kitchen import kitchen
from tests.pike_bridge.plans import networks, programs, tiny_plans


def network_of(guards, ordered=True):
    """Choices with three values, each at an event with the given guard."""
    choices = tuple(Choice(name, ("1", "2", "3"), True, f"at {name}") for name in guards)
    events = tuple(Event(f"at {name}", guard(needs)) for name, needs in guards.items())
    order = tuple(
        Constraint(f"at {needed}", f"at {name}", Fraction(0), None, guard(needs))
        for name, needs in guards.items()
        for needed in needs
        if ordered
    )
    return Tpnu("n", choices, events, order, ())


@st.composite
def nested(draw):
    """Choices whose events depend on earlier choices, on several at a time, and on all that those depend on."""
    needs = {}
    for at in range(draw(st.integers(0, 5))):
        needed = {}
        for name in draw(st.lists(st.sampled_from(sorted(needs)), max_size=2)) if needs else ():
            more = needs[name] | {name: draw(st.sampled_from("123"))}
            if all(needed.get(one, value) == value for one, value in more.items()):
                needed |= more
        needs[f"x{at}"] = needed
    return network_of(needs)


@given(nested())
def test_counting_candidate_subplans(network):
    validate(network)
    decided = {
        frozenset((choice.name, scenario[choice.name]) for choice in active_choices(network, scenario))
        for scenario in scenarios(network.domains)
    }
    assert candidate_subplans(network) == len(decided)
    assert team_scenario_count(network) == 3 ** len(network.choices)


def test_counting_does_not_enumerate_or_recurse():
    assert candidate_subplans(network_of({f"x{at}": {} for at in range(200)})) == 3**200
    chain, needs = {}, {}
    for at in range(300):
        chain[f"x{at}"] = dict(needs)
        needs[f"x{at}"] = "1"
    assert candidate_subplans(network_of(chain, ordered=False)) == 2 * 300 + 1
    assert candidate_subplans(kitchen()) == 8
    with pytest.raises(InputError, match="cycle: x, y"):
        candidate_subplans(network_of({"x": {"y": "1"}, "y": {"x": "1"}}))


@given(nested(), st.frozensets(st.sampled_from([Assignment(f"x{at}", value) for at in (0, 1) for value in "12"])))
def test_going_through_scenarios(network, environment):
    found = list(team_scenarios(network, environment))
    expected = [
        one for one in scenarios(network.domains) if all(one.get(name, value) == value for name, value in environment)
    ]
    assert found == expected
    assert list(team_scenarios(network)) == list(scenarios(network.domains))


def test_contradictions():
    a, b = guard({"x": "1"}), guard({"x": "2", "y": "1"})
    assert contradicts(a, b)
    assert not contradicts(a, guard({"y": "1"}))
    assert not contradicts(frozenset(), b)


# -- restriction -----------------------------------------------------------------------------------------------------


@st.composite
def environments(draw, network):
    assigned = draw(st.lists(st.sampled_from(network.choices), unique=True)) if network.choices else []
    return guard({choice.name: draw(st.sampled_from(choice.domain)) for choice in assigned})


@given(st.one_of(programs(), networks(events=5)), st.data())
def test_restricted_networks_have_the_same_subplans(network, data):
    environment = data.draw(environments(network))
    restricted = restrict_network(network, environment)
    validate(restricted)
    assert not {choice.name for choice in restricted.choices} & {variable for variable, _ in environment}
    for scenario in team_scenarios(network, environment):
        assert candidate_subplan(restricted, scenario).bounds == candidate_subplan(network, scenario).bounds
        before, after = ({choice.name for choice in active_choices(one, scenario)} for one in (network, restricted))
        assert after == before - {variable for variable, _ in environment}


@given(tiny_plans(), st.data())
@settings(deadline=None, max_examples=60)
def test_restricted_plans_have_the_same_executions(plan, data):
    environment = data.draw(environments(plan.network))
    restricted = restrict(plan, environment)
    for scenario in team_scenarios(plan.network, environment):
        assert admits_correct_execution(restricted, scenario) == admits_correct_execution(plan, scenario)
    for one in (*restricted.conditions, *restricted.effects):
        if one.activity is not None:
            activity = restricted.network.activities[one.activity]
            assert activity.guard <= one.guard


def test_restricting_the_kitchen():
    restricted = restrict_network(kitchen(), guard({"xA1": "mug", "xR1": "mug"}))
    assert [choice.name for choice in restricted.choices] == ["xA2"]
    assert [activity.action for activity in restricted.activities] == [
        "(get human mug)",
        "(pour robot mug)",
        "(make human bagel)",
        "(make human cereal)",
    ]
    assert restricted.activities[0].guard == frozenset()
    with pytest.raises(InputError, match="two values of one choice"):
        restrict_network(kitchen(), frozenset({Assignment("xA1", "mug"), Assignment("xA1", "glass")}))


# -- ends ------------------------------------------------------------------------------------------------------------


@given(st.one_of(programs(), networks(events=5)))
def test_everything_is_between_the_ends(network):
    complete = with_ends(network, EPSILON)
    assert with_ends(complete, EPSILON) == complete
    assert complete.choices == network.choices
    for scenario in scenarios(network.domains):
        stn = candidate_subplan(complete, scenario)
        assert (-stn.bounds[GOAL, INITIAL][0] if stn.consistent else EPSILON) >= EPSILON
        for event in network.events:
            if holds(event.guard, scenario) and stn.consistent:
                assert stn.bounds[event.name, INITIAL][0] <= -EPSILON
                assert stn.bounds[GOAL, event.name][0] <= -EPSILON


def test_few_constraints_are_added():
    complete = with_ends(kitchen(), EPSILON)
    added = [one for one in complete.constraints if {one.source, one.target} & {INITIAL, GOAL}]
    assert added == [Constraint("e20", GOAL, EPSILON, None), Constraint(INITIAL, "e1", EPSILON, None)]
    assert with_ends(Tpnu("empty", (), (), (), ()), EPSILON).constraints == (Constraint(INITIAL, GOAL, EPSILON, None),)
    cycle = (Constraint("a", "b", Fraction(0), None), Constraint("b", "a", Fraction(0), None))
    complete = with_ends(Tpnu("cycle", (), (Event("a"), Event("b")), cycle, ()), EPSILON)
    assert len(complete.constraints) == 4


def test_ends_of_the_plan_are_kept_and_separated():
    events = (Event(INITIAL), Event("a"), Event(GOAL))
    near = (Constraint(INITIAL, "a", Fraction(0), None), Constraint("a", GOAL, Fraction(2), Fraction(3)))
    complete = with_ends(Tpnu("n", (), events, near, ()), EPSILON)
    assert complete.events == events
    assert complete.constraints == (*near, Constraint(INITIAL, "a", EPSILON, None))
