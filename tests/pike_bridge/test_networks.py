"""Networks: built from programs, validated, counted, restricted and given ends; against all scenarios one by one."""

from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.errors import InputError
from robust.pike_bridge.action_model import with_ends
from robust.pike_bridge.builder import Act, Choose, InParallel, InSequence, Within, act, build, choose, sequence, within
from robust.pike_bridge.compile import candidate_subplans
from robust.pike_bridge.files import validate
from robust.pike_bridge.model import (
    EPSILON,
    GOAL,
    INITIAL,
    Activity,
    Assignment,
    Choice,
    Constraint,
    Event,
    TeamPlan,
    Tpnu,
    guard,
)
from robust.pike_bridge.semantics import restrict, team_scenarios
from tests.pike_bridge.brute_force import admits_correct_execution, candidate_subplan, holds, scenarios
from tests.pike_bridge.kitchen import kitchen
from tests.pike_bridge.knowledge.theories import environments
from tests.pike_bridge.plans import elements, programs, tiny_plans
from tests.pike_bridge.plans import network as handmade


def least(element, scenario):
    """How long an element takes at least, and how many activities it has."""
    match element:
        case Act(_, lower):
            return lower, 1
        case Choose(name, branches):
            length, count = least(dict(branches)[scenario[name]], scenario)
            return length + 2 * EPSILON, count
        case Within(inner, lower):
            length, count = least(inner, scenario)
            return max(length, lower or 0), count
        case InSequence(parts) | InParallel(parts):
            lengths, counts = zip((0, 0), *(least(part, scenario) for part in parts), strict=True)
            if isinstance(element, InSequence):
                return sum(lengths) + EPSILON * max(0, len(parts) - 1), sum(counts)
            return max(EPSILON, *(length + 2 * EPSILON for length in lengths[1:]), 0), sum(counts)


@given(elements())
def test_every_candidate_subplan_means_the_program(element):
    # A sum of nothing happens in no time, so that a program of moments is one moment.
    if isinstance(element, Within) and element.lower and least(element.element, dict.fromkeys("xyz", "1"))[0] == 0:
        return
    network = build("p", sequence(act("(begin)", 1, 1), element, act("(end)", 1, 1)))
    validate(network)
    begin, end = network.activities[0], network.activities[-1]
    for scenario in scenarios(network.domains):
        stn = candidate_subplan(network, scenario)
        length, count = least(element, scenario)
        assert sum(holds(one.guard, scenario) for one in network.activities) == count + 2
        assert not stn.consistent or -stn.bounds[end.source, begin.target][0] == length + 2 * EPSILON


def test_the_networks_of_a_choice_and_of_bounds_around_an_element():
    network = build("p", choose("x", {"a": act("(GO)", "0.5", 2, agent="robot"), "b": sequence()}, controllable=False))
    a, b = guard({"x": "a"}), guard({"x": "b"})
    assert network.choices == (Choice("x", ("a", "b"), False, "e1"),)
    assert network.events == (Event("e1"), Event("e2", a), Event("e3", a), Event("e4", b), Event("e5"))
    assert network.constraints == (
        Constraint("e1", "e2", EPSILON, None, a),
        Constraint("e3", "e5", EPSILON, None, a),
        Constraint("e1", "e4", EPSILON, None, b),
        Constraint("e4", "e5", EPSILON, None, b),
        Constraint("e1", "e5", EPSILON, None),
    )
    (activity,) = network.activities
    assert (activity.action, activity.source, activity.target, activity.guard) == ("(go)", "e2", "e3", a)
    assert (activity.lower, activity.upper, activity.agent) == (Fraction(1, 2), 2, "robot")
    bounded = build("p", within(act("(go)", 1, 2), lower="1/3", upper=5), epsilon=Fraction(1, 10))
    assert bounded.constraints == (Constraint("e1", "e2", Fraction(1, 3), Fraction(5)),)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: act("get ann cup", 1, 2), "action: found 'get ann cup', expected a ground action such as"),
        (lambda: act(None, 1, 2), "action: found 'None', expected a ground action such as"),
        (lambda: sequence("(get)"), "found \"'(get)'\", expected act, sequence, parallel, choose or within"),
        (lambda: within(None, upper=3), "found 'None', expected act, sequence"),
        (lambda: build("x", 3), "found '3', expected act, sequence"),
        (lambda: choose("x", ["a"]), "branches: found \"['a']\", expected an element for each value"),
        (lambda: choose("x", {"a": "b"}), "found \"'b'\", expected act, sequence"),
        (lambda: choose("x\n", {"a": sequence()}), "expected a text that is not empty and has no control characters"),
        (lambda: choose("x", {1: sequence()}), "choice 'x': found '1', expected a text that is not empty"),
        (lambda: choose("x", {"": sequence()}), "choice 'x': found \"''\", expected a text that is not empty"),
        (lambda: build(None, sequence()), "name: found 'None', expected a text that is not empty"),
        (lambda: build("x", sequence(), epsilon=-1), "epsilon: found '-1', expected a number of at least 0"),
    ],
)
def test_what_is_no_program_is_named(make, says):
    with pytest.raises(InputError) as caught:
        make()
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_mistakes():
    branches = {"a": sequence()}
    with pytest.raises(InputError, match="'x' is made twice"):
        build("p", sequence(choose("x", branches), choose("x", branches)))
    with pytest.raises(InputError, match="'x' has no branches"):
        build("p", choose("x", {}))
    with pytest.raises(InputError, match="expected a number"):
        act("(go)", "soon", None)


A, B = guard({"x": "a"}), guard({"x": "b"})
ZERO, ONE = Fraction(0), Fraction(1)
BASE = Tpnu(
    "base",
    (Choice("x", ("a", "b"), False, "c"), Choice("y", ("1", "2"), True, "d")),
    (Event("c"), Event("d", A), Event("e", A | guard({"y": "1"})), Event("f")),
    (Constraint("c", "d", ZERO, None, A), Constraint("c", "f", None, Fraction(9))),
    (Activity("(go)", "d", "e", ONE, Fraction(2), None, A | guard({"y": "1"})),),
)


def with_event(*events):
    return {"events": (*BASE.events, *events)}


def with_constraint(*args):
    return {"constraints": (*BASE.constraints, Constraint(*args))}


def with_activity(*args, label=frozenset()):
    return {"activities": (*BASE.activities, Activity(*args, guard=label))}


BROKEN = [
    ({"choices": (*BASE.choices, Choice("x", ("a",), True, "c"))}, "found a second choice 'x', expected each once"),
    (with_event(Event("c")), "found a second event 'c', expected each once"),
    ({"choices": (*BASE.choices, Choice("z", ("a",), True, "cc"))}, "found event 'cc', expected one of the plan; did"),
    ({"choices": (*BASE.choices, Choice("z", (), True, "c"))}, "found no values for choice 'z'"),
    ({"choices": (*BASE.choices, Choice("z", ("a", "a"), True, "c"))}, "found a, a for choice 'z'"),
    (with_constraint("c", "g", ONE, None), "found event 'g', expected one of the plan"),
    (with_activity("(go)", "gg", "c", ONE, None), "found event 'gg', expected one of the plan"),
    (with_event(Event(GOAL, A)), "found guard {x = a} of e_goal, expected none"),
    (with_event(Event("g", guard({"z": "a"}))), "found choice 'z' in the guard of event g, expected one of the plan"),
    (with_event(Event("g", guard({"x": "c"}))), "found x = 'c' in the guard of event g, expected a value of x"),
    (
        with_event(Event("g", guard({"x": "A"}))),
        "found x = 'A' in the guard of event g, expected a value of x; known are",
    ),
    (with_event(Event("g", A | B)), "found x = a and x = b in the guard of event g, expected one value of a choice"),
    (with_constraint("c", "d", ONE, None), "found the constraint from c to d without x = a in its guard, expected all"),
    (with_activity("(run)", "d", "f", ONE, None), "found activity (run) without x = a in its guard"),
    (with_constraint("c", "f", ONE, ZERO), "found bounds [1, 0] of the constraint from c to f"),
    (with_activity("(run)", "c", "f", ONE, Fraction(1, 2)), "found bounds [1, 0.5] of activity (run)"),
    (with_activity("(run)", "c", "f", ZERO, None), "found lower bound 0 of activity (run), expected one above 0"),
    (with_activity("(run)", "c", "c", ONE, None), "found activity (run) from c to the same event"),
    (
        {**with_event(Event(INITIAL)), **with_activity("(run)", INITIAL, "f", ONE, None)},
        "found activity (run) at e_initial, expected an event of its own",
    ),
    (with_event(Event("g", guard({"y": "1"}))), "found y in the guard of event g without x = a, expected that too"),
    (with_event(Event("g", B | guard({"y": "1"}))), "of event g, which never holds: event d, where y is chosen, needs"),
    (with_event(Event("g", A)), "found choice x in the guard of event g, which may come before the choice"),
    (
        {**with_event(Event("g", A)), **with_constraint("c", "g", Fraction(-1), None, A)},
        "add a constraint from c to g with lower bound 0",
    ),
    (with_activity("(run)", "f", "c", ONE, None, label=A), "found choice x in the guard of activity (run), which is"),
    (
        {**with_event(Event("g", A)), **with_constraint("g", "c", ONE, None, A)},
        "which is ordered before the choice, expected event c first: let the constraints put c before g",
    ),
    (
        {"events": (Event("c", guard({"y": "1"})), Event("d", A)), "constraints": (), "activities": ()},
        "found choice 'x' at event c, whose guard depends on the choice itself (x needs y needs x)",
    ),
    (
        {"choices": BASE.choices[:1], "events": (Event("c", A),), "constraints": (), "activities": ()},
        "found choice 'x' at event c, whose guard depends on the choice itself (x needs x)",
    ),
    ({"events": (Event("c", A), *BASE.events[1:])}, "found the constraint from c to f without x = a in its guard"),
]


@pytest.mark.parametrize(("changes", "message"), BROKEN, ids=[message for _, message in BROKEN])
def test_broken_rules(changes, message):
    network = replace(BASE, **changes)
    with pytest.raises(InputError) as caught:
        validate(network)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


ALLOWED = [
    {},
    with_constraint("f", "c", None, None),
    with_constraint("f", "f", ONE, ONE),  # can never be met, which checking says
    with_constraint("c", "f", Fraction(10), None),  # contradicts another constraint, likewise
    {"choices": (*BASE.choices, Choice("z", ("a",), True, "c"))},  # two choices at one event
    {**with_event(Event("g", A)), **with_constraint("g", "c", None, ZERO, A)},
    {"choices": (*BASE.choices, Choice("z", ("1",), True, None)), **with_event(Event("g", guard({"z": "1"})))},
    {
        **with_event(Event(INITIAL), Event("g", guard({"z": "1"}))),
        "choices": (*BASE.choices, Choice("z", ("1",), True, INITIAL)),
    },
]


@pytest.mark.parametrize("changes", ALLOWED)
def test_what_is_allowed(changes):
    validate(replace(BASE, **changes))


def test_order_through_alternatives():
    # g is after x in either case of y, which its guard does not mention.
    network = handmade(
        {"c": {}, "l": {"y": "1"}, "r": {"y": "2"}, "g": {"x": "a"}},
        ("c", "l", 1, None, {"y": "1"}),
        ("c", "r", 1, None, {"y": "2"}),
        ("l", "g", 1, None, {"y": "1", "x": "a"}),
        ("r", "g", 1, None, {"y": "2", "x": "a"}),
        choices=[("x", "ab", "c"), ("y", "12", "c")],
    )
    validate(network)


def active_choices(network, scenario):
    """The choices whose event happens in a scenario."""
    return {one.name for one in network.choices if one.event is None or holds(network.guards[one.event], scenario)}


def network_of(guards, ordered=True):
    """Choices with three values, each at an event with the given guard."""
    order = [
        (f"at {needed}", f"at {name}", 0, None, needs) for name, needs in guards.items() for needed in needs if ordered
    ]
    events = {f"at {name}": needs for name, needs in guards.items()}
    return handmade(events, *order, choices=[(name, "123", f"at {name}") for name in guards])


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


@given(nested() | programs())
def test_counting_candidate_subplans(network):
    validate(network)
    decided = {
        frozenset((name, scenario[name]) for name in active_choices(network, scenario))
        for scenario in scenarios(network.domains)
    }
    assert candidate_subplans(network) == len(decided)


def test_counting_does_not_enumerate_or_recurse():
    assert candidate_subplans(network_of({f"x{at}": {} for at in range(200)})) == 3**200
    chain = {f"x{at}": {f"x{earlier}": "1" for earlier in range(at)} for at in range(300)}
    assert candidate_subplans(network_of(chain, ordered=False)) == 2 * 300 + 1
    assert candidate_subplans(kitchen()) == 8
    with pytest.raises(InputError, match="cycle: x, y"):
        candidate_subplans(network_of({"x": {"y": "1"}, "y": {"x": "1"}}))


@given(nested(), st.frozensets(st.sampled_from([Assignment(f"x{at}", value) for at in (0, 1) for value in "12"])))
def test_going_through_scenarios(network, environment):
    def extends(scenario):
        return all(scenario.get(name, value) == value for name, value in environment)

    expected = list(filter(extends, scenarios(network.domains)))
    assert list(team_scenarios(network, environment)) == expected
    assert list(team_scenarios(network)) == list(scenarios(network.domains))


@given(st.one_of(tiny_plans, programs().map(lambda network: TeamPlan(network, (), ()))), st.data())
@settings(deadline=None, max_examples=100)
def test_restricted_plans_have_the_same_subplans_and_executions(plan, data):
    network = plan.network
    environment = data.draw(environments(network.domains))
    restricted = restrict(plan, environment)
    validate(restricted.network)
    assert not restricted.network.domains.keys() & dict(environment).keys()
    for scenario in team_scenarios(network, environment):
        assert candidate_subplan(restricted.network, scenario).bounds == candidate_subplan(network, scenario).bounds
        assert admits_correct_execution(restricted, scenario) == admits_correct_execution(plan, scenario)
        left = active_choices(restricted.network, scenario)
        assert left == active_choices(network, scenario) - dict(environment).keys()
    for one in (*restricted.conditions, *restricted.effects):
        if one.activity is not None:
            assert restricted.network.activities[one.activity].guard <= one.guard


def test_restricting_the_kitchen():
    plan = TeamPlan(kitchen(), (), ())
    restricted = restrict(plan, guard({"xA1": "mug", "xR1": "mug"})).network
    assert [choice.name for choice in restricted.choices] == ["xA2"]
    assert [(activity.action, dict(activity.guard)) for activity in restricted.activities] == [
        ("(get human mug)", {}),
        ("(pour robot mug)", {}),
        ("(make human bagel)", {"xA2": "bagel"}),
        ("(make human cereal)", {"xA2": "cereal"}),
    ]
    with pytest.raises(InputError, match="two values of one choice"):
        restrict(plan, frozenset({Assignment("xA1", "mug"), Assignment("xA1", "glass")}))


@given(st.one_of(tiny_plans.map(lambda plan: plan.network), programs()))
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
    assert with_ends(handmade(""), EPSILON).constraints == (Constraint(INITIAL, GOAL, EPSILON, None),)
    assert len(with_ends(handmade("a b", ("a", "b", 0, None), ("b", "a", 0, None)), EPSILON).constraints) == 4


def test_ends_of_the_plan_are_kept_and_separated():
    network = handmade(f"{INITIAL} a {GOAL}", (INITIAL, "a", 0, None), ("a", GOAL, 2, 3))
    separated = (*network.constraints, Constraint(INITIAL, "a", EPSILON, None))
    assert with_ends(network, EPSILON) == replace(network, constraints=separated)
