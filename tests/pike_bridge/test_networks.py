"""Networks: built from programs, validated, counted, restricted, given ends, against all scenarios one by one; joined
with PDDL: conditions, effects, initial state, goal, durations, and what is refused."""

from dataclasses import replace
from fractions import Fraction
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.errors import InputError, UnsupportedError
from robust.pike_bridge import builder, model
from robust.pike_bridge.action_model import Instance, with_ends
from robust.pike_bridge.builder import act, build, choose, sequence, within
from robust.pike_bridge.compile import Checking, PlanVerdict, candidate_subplans
from robust.pike_bridge.files import validate
from robust.pike_bridge.model import EPSILON, GOAL, INITIAL, Activity, Assignment, Choice, Constraint, Event, guard
from robust.pike_bridge.semantics import restrict, team_scenarios
from robust.plan.model import Atom
from tests.pike_bridge.brute_force import admits_correct_execution, candidate_subplan, holds, scenarios
from tests.pike_bridge.knowledge.theories import environments
from tests.pike_bridge.plans import DOMAIN, PROBLEM, elements, kitchen, programs, tiny_plans
from tests.pike_bridge.plans import network as handmade
from tests.sampling import often


def least(element, scenario):
    """How long an element takes at least, and how many activities it has."""
    match element:
        case builder.Act(_, lower):
            return lower, 1
        case builder.Choose(name, branches):
            length, count = least(dict(branches)[scenario[name]], scenario)
            return length + 2 * EPSILON, count
        case builder.Within(inner, lower):
            length, count = least(inner, scenario)
            return max(length, lower or 0), count
        case builder.InSequence(parts) | builder.InParallel(parts):
            lengths, counts = zip((0, 0), *(least(part, scenario) for part in parts), strict=True)
            if isinstance(element, builder.InSequence):
                return sum(lengths) + EPSILON * max(0, len(parts) - 1), sum(counts)
            return max(EPSILON, *(length + 2 * EPSILON for length in lengths[1:]), 0), sum(counts)


@settings(max_examples=often(30, 60))
@given(elements())
def test_every_candidate_subplan_means_the_program(element):
    moment = isinstance(element, builder.Within) and least(element.element, dict.fromkeys("xyz", "1"))[0] == 0
    if moment and element.lower:  # a sum of nothing happens in no time, so that a program of moments is one moment
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


def refused(action, message, kind=InputError):
    with pytest.raises(kind) as caught:
        action()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    return caught.value


NO_PROGRAMS = [
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
    (lambda: build("p", sequence(*[choose("x", {"a": sequence()})] * 2)), "'x' is made twice"),
    (lambda: build("p", choose("x", {})), "'x' has no branches"),
    (lambda: act("(go)", "soon", None), "expected a number"),
]
A, B = guard({"x": "a"}), guard({"x": "b"})
ZERO, ONE = Fraction(0), Fraction(1)
BASE = model.Tpnu(
    "base",
    (Choice("x", ("a", "b"), False, "c"), Choice("y", ("1", "2"), True, "d")),
    (Event("c"), Event("d", A), Event("e", A | guard({"y": "1"})), Event("f")),
    (Constraint("c", "d", ZERO, None, A), Constraint("c", "f", None, Fraction(9))),
    (Activity("(go)", "d", "e", ONE, Fraction(2), None, A | guard({"y": "1"})),),
)


def more(*elements, **changes):
    """Changes of the base: choices, events, constraints and activities in addition."""
    for element in elements:
        key = {Choice: "choices", Event: "events", Constraint: "constraints", Activity: "activities"}[type(element)]
        changes[key] = (*changes.get(key, getattr(BASE, key)), element)
    return changes


def run(source, target, lower=ONE, upper=None, label=frozenset()):
    return Activity("(run)", source, target, lower, upper, guard=label)


G_A, Y1 = Event("g", A), guard({"y": "1"})
CIRCLE = "found choice 'x' at event c, whose guard depends on the choice itself"
NOTHING = {"constraints": (), "activities": ()}
BROKEN = [
    (more(Choice("x", ("a",), True, "c")), "found a second choice 'x', expected each once"),
    (more(Event("c")), "found a second event 'c', expected each once"),
    (more(Choice("z", ("a",), True, "cc")), "found event 'cc', expected one of the plan; did"),
    (more(Choice("z", (), True, "c")), "found no values for choice 'z'"),
    (more(Choice("z", ("a", "a"), True, "c")), "found a, a for choice 'z'"),
    (more(Constraint("c", "g", ONE, None)), "found event 'g', expected one of the plan"),
    (more(run("gg", "c")), "found event 'gg', expected one of the plan"),
    (more(Event(GOAL, A)), "found guard {x = a} of e_goal, expected none"),
    (more(Event("g", guard({"z": "a"}))), "found choice 'z' in the guard of event g, expected one of the plan"),
    (more(Event("g", guard({"x": "c"}))), "found x = 'c' in the guard of event g, expected a value of x"),
    (more(Event("g", guard({"x": "A"}))), "found x = 'A' in the guard of event g, expected a value of x; known are"),
    (more(Event("g", A | B)), "found x = a and x = b in the guard of event g, expected one value of a choice"),
    (more(Constraint("c", "d", ONE, None)), "found the constraint from c to d without x = a in its guard, expected"),
    (more(run("d", "f")), "found activity (run) without x = a in its guard"),
    (more(Constraint("c", "f", ONE, ZERO)), "found bounds [1, 0] of the constraint from c to f"),
    (more(run("c", "f", ONE, Fraction(1, 2))), "found bounds [1, 0.5] of activity (run)"),
    (more(run("c", "f", ZERO)), "found lower bound 0 of activity (run), expected one above 0"),
    (more(run("c", "c")), "found activity (run) from c to the same event"),
    (more(Event(INITIAL), run(INITIAL, "f")), "found activity (run) at e_initial, expected an event of its own"),
    (more(Event("g", Y1)), "found y in the guard of event g without x = a, expected that too"),
    (more(Event("g", B | Y1)), "of event g, which never holds: event d, where y is chosen, needs"),
    (more(G_A), "found choice x in the guard of event g, which may come before the choice"),
    (more(G_A, Constraint("c", "g", Fraction(-1), None, A)), "add a constraint from c to g with lower bound 0"),
    (more(run("f", "c", label=A)), "found choice x in the guard of activity (run), which is"),
    (
        more(G_A, Constraint("g", "c", ONE, None, A)),
        "choice, expected event c first: let the constraints put c before g",
    ),
    ({"events": (Event("c", Y1), Event("d", A)), **NOTHING}, f"{CIRCLE} (x needs y needs x)"),
    ({"choices": BASE.choices[:1], "events": (Event("c", A),), **NOTHING}, f"{CIRCLE} (x needs x)"),
    ({"events": (Event("c", A), *BASE.events[1:])}, "found the constraint from c to f without x = a in its guard"),
]


NO_PROGRAMS += [(partial(validate, replace(BASE, **changes)), message) for changes, message in BROKEN]


@pytest.mark.parametrize(("make", "message"), NO_PROGRAMS, ids=[message for _, message in NO_PROGRAMS])
def test_what_is_no_program_and_broken_rules_are_named(make, message):
    refused(make, message)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        more(Constraint("f", "c", None, None)),
        more(Constraint("f", "f", ONE, ONE)),  # can never be met, which checking says
        more(Constraint("c", "f", Fraction(10), None)),  # contradicts another constraint, likewise
        more(Choice("z", ("a",), True, "c")),  # two choices at one event
        more(G_A, Constraint("g", "c", None, ZERO, A)),
        more(Choice("z", ("1",), True, None), Event("g", guard({"z": "1"}))),
        more(Choice("z", ("1",), True, INITIAL), Event(INITIAL), Event("g", guard({"z": "1"}))),
    ],
)
def test_what_is_allowed(changes):
    validate(replace(BASE, **changes))
    # `g` is after x in either case of y, which its guard does not mention.
    left, right, given = {"y": "1"}, {"y": "2"}, {"x": "a"}
    orders = [("c", "l", 1, None, left), ("l", "g", 1, None, left | given)]
    orders += [("c", "r", 1, None, right), ("r", "g", 1, None, right | given)]
    events = {"c": {}, "l": left, "r": right, "g": given}
    validate(handmade(events, *orders, choices=[("x", "ab", "c"), ("y", "12", "c")]))


def active_choices(network, scenario):
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


def test_counting_does_not_enumerate_and_few_constraints_are_added():
    assert candidate_subplans(network_of({f"x{at}": {} for at in range(200)})) == 3**200
    chain = {f"x{at}": {f"x{earlier}": "1" for earlier in range(at)} for at in range(120)}
    assert candidate_subplans(network_of(chain, ordered=False)) == 2 * 120 + 1
    assert candidate_subplans(kitchen()) == 8
    with pytest.raises(InputError, match="cycle: x, y"):
        candidate_subplans(network_of({"x": {"y": "1"}, "y": {"x": "1"}}))
    complete = with_ends(kitchen(), EPSILON)
    added = [each for each in complete.constraints if {each.source, each.target} & {INITIAL, GOAL}]
    assert added == [Constraint("e20", GOAL, EPSILON, None), Constraint(INITIAL, "e1", EPSILON, None)]
    assert with_ends(handmade(""), EPSILON).constraints == (Constraint(INITIAL, GOAL, EPSILON, None),)
    assert len(with_ends(handmade("a b", ("a", "b", 0, None), ("b", "a", 0, None)), EPSILON).constraints) == 4
    network = handmade(f"{INITIAL} a {GOAL}", (INITIAL, "a", 0, None), ("a", GOAL, 2, 3))
    separated = (*network.constraints, Constraint(INITIAL, "a", EPSILON, None))
    assert with_ends(network, EPSILON) == replace(network, constraints=separated)
    with pytest.raises(InputError, match="two values of one choice"):
        restrict(model.TeamPlan(kitchen(), (), ()), frozenset({Assignment("xA1", "mug"), Assignment("xA1", "glass")}))


@given(nested(), st.frozensets(st.sampled_from([Assignment(f"x{at}", value) for at in (0, 1) for value in "12"])))
def test_going_through_scenarios(network, environment):
    everything = list(scenarios(network.domains))
    extending = (each for each in everything if all(each.get(name, value) == value for name, value in environment))
    assert list(team_scenarios(network, environment)) == list(extending)
    assert list(team_scenarios(network)) == everything


@given(st.one_of(tiny_plans, programs().map(lambda network: model.TeamPlan(network, (), ()))), st.data())
@settings(deadline=None, max_examples=often(30, 60))
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


def plan_of(*, condition="", effect="", duration="", init="", goal="", more="", lower=1, upper=5, action="(a)"):
    """One activity from e1 to e2 with the given action."""
    domain = f"""
    (define (domain d) (:requirements :durative-actions :fluents)
      (:predicates (p) (q) (r) (raining) (same ?x ?y)) (:functions (cost) (size) (far))
      (:durative-action a :parameters () :duration (and {duration})
        :condition (and {condition}) :effect (and {effect}))
      (:action instant :effect (raining)) {more})"""
    state = f"(:objects o) (:init (= (size) 3) (= (cost) 0) {init})"
    problem = f"(define (problem i) (:domain d) {state} (:goal (and {goal})))"
    return Instance(build("one", act(action, lower, upper)), domain, problem).plan()


def conditions(plan):
    return [(str(each.literal), each.first, each.last) for each in plan.conditions]


def effects(plan):
    return [(str(each.literal), each.event) for each in plan.effects]


def test_the_kitchen():
    plan = Instance(kitchen(), DOMAIN, PROBLEM).plan()
    mug, glass = guard({"xA1": "mug"}), guard({"xA1": "glass"})
    pouring = plan.network.activities[2]
    reachable, taken, filled = (model.Literal(Atom(name, ("mug",))) for name in ("reachable", "taken", "filled"))
    assert plan.conditions[:2] == (
        model.Condition(reachable, "e2", "e2", mug, 0),
        model.Condition(filled.negation, "e2", "e2", mug, 0),
    )
    assert model.Condition(taken, pouring.source, pouring.target, pouring.guard, 2) in plan.conditions
    assert set(plan.effects) >= {
        model.Effect(reachable.negation, "e2", mug, 0),
        model.Effect(model.Literal(Atom("taken", ("glass",))), "e5", glass, 1),
        *(model.Effect(literal, INITIAL, model.ALWAYS, None) for literal in (reachable, taken.negation)),
    }
    goal = [(str(each.literal), each.first, each.last) for each in plan.conditions if each.activity is None]
    assert goal == [("(filled mug)", GOAL, GOAL), ("(made bagel)", GOAL, GOAL)]
    assert Checking(plan, all_scenarios=True).run().scenarios == [{"xA1": "mug", "xR1": "mug", "xA2": "bagel"}]


def test_timing_one_action_several_times_and_what_never_changes():
    """An add wins over a delete at the same event."""
    plan = plan_of(
        condition="(at start (p)) (over all (q)) (at end (not (r)))",
        effect="(at start (not (p))) (at end (p)) (at end (not (p))) (at end (q)) (at end (r))",
    )
    assert conditions(plan) == [("(p)", "e1", "e1"), ("(q)", "e1", "e2"), ("(not (r))", "e2", "e2")]
    changes = [("(not (p))", "e1"), ("(p)", "e2"), ("(q)", "e2"), ("(r)", "e2")]
    assert effects(plan) == [*((f"(not ({name}))", INITIAL) for name in "pqr"), *changes]
    element = choose("x", {"1": act("(make human bagel)", 1, 2), "2": act("(make human bagel)", 3, 4)})
    plan = Instance(build("n", sequence(element, act("(make human bagel)", 1, 1))), DOMAIN, PROBLEM).plan()
    for epsilon in (Fraction(1, 10), Fraction(0)):
        bare = Instance(build("n", act("(make human bagel)", 1, 2)), DOMAIN, PROBLEM).plan(epsilon)
        assert (bare.epsilon, {each.lower for each in bare.network.constraints}) == (epsilon, {epsilon})
    bagel = model.Literal(Atom("made", ("bagel",)))
    assert [each.activity for each in plan.effects if each.literal == bagel] == [0, 1, 2]
    plan = plan_of(condition="(at start (p)) (over all (not (q)))", init="(p)", goal="(not (r)) (p)")
    own, goal = [("(p)", "e1", "e1"), ("(not (q))", "e1", "e2")], [("(not (r))", GOAL, GOAL), ("(p)", GOAL, GOAL)]
    assert conditions(plan) == own + goal
    assert effects(plan) == [("(p)", INITIAL), ("(not (q))", INITIAL), ("(not (r))", INITIAL)]
    assert Checking(plan).run().verdict is PlanVerdict.PROVED
    plan = plan_of(condition="(over all (not (q)))", init="(q)")
    assert effects(plan) == [("(q)", INITIAL)]
    assert Checking(plan).run().verdict is PlanVerdict.REFUTED
    conditional = "(when (at start (r)) (at start (p))) (when (at start (not (r))) (at start (q)))"
    assert effects(plan_of(effect=conditional)) == [("(not (q))", INITIAL), ("(q)", "e1")]


TOUCHED = {"effect": "(at end (q))"}


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ({"condition": "(at start (or (p) (q)))", **TOUCHED}, ["(q)"]),
        ({"condition": "(at start (or (p) (q)))", "init": "(p)", **TOUCHED}, []),
        ({"condition": "(at start (imply (p) (q)))", **TOUCHED}, []),
        ({"condition": "(at start (or (p) (r)))", **TOUCHED}, ["(never (or (p) (r)))"]),
        ({"condition": "(at start (forall (?x) (not (= ?x ?x))))"}, ["(never (not (= o o)))"]),
        ({"condition": "(at start (>= (size) 3)) (at end (< (size) 9))"}, []),
        ({"condition": "(at start (> (size) 3))"}, ["(never (> (size) 3))"]),
        ({"condition": "(over all (forall (?x) (or (same ?x ?x) (= ?x ?x))))"}, []),
    ],
)
def test_what_never_changes_decides_conditions(parts, expected):
    plan = plan_of(**parts)
    assert conditions(plan) == [(literal, "e1", "e1") for literal in expected]
    if expected != ["(q)"]:
        assert Checking(plan).run().verdict is (PlanVerdict.REFUTED if expected else PlanVerdict.PROVED)


EITHER = {"effect": "(at end (p)) (at end (q))"}
INCREASE = {"effect": "(at end (increase (cost) 1))"}


@pytest.mark.parametrize(
    ("duration", "expected"),
    [
        ("", (1, 5)),
        ("(= ?duration 3)", (3, 3)),
        ("(= ?duration (size))", (3, 3)),
        ("(>= ?duration 2) (<= ?duration 4.5)", (2, Fraction(9, 2))),
        ("(<= ?duration 9)", (1, 5)),
        ("(= ?duration (* 2 (- (size) 1)))", (4, 4)),
    ],
)
def test_durations_hold_both(duration, expected):
    [activity] = plan_of(duration=duration).network.activities
    assert (activity.lower, activity.upper) == expected
    [activity] = plan_of(duration="(<= ?duration 9)", upper=None).network.activities
    assert (activity.lower, activity.upper) == (1, 9)


COSTS = "(= ?duration (cost))"
CONTRADICTION = "found activity (a) with bounds [1, 5], expected some of the durations"
UNSUPPORTED = [
    ({"condition": "(at start (or (p) (q)))", **EITHER}, "a disjunction (or (p) (q)) of (a)"),
    ({"goal": "(or (p) (q))", **EITHER}, "a disjunction (or (p) (q)) of the goal"),
    ({"condition": "(at start (>= (cost) 1))", **INCREASE}, "numeric condition (>= (cost) 1)"),
    (INCREASE, "a change of the number (cost) by (a)"),
    ({"effect": "(increase (cost) (* #t 1))"}, "a change of the number (cost) by (a)"),
    ({"effect": "(when (at start (p)) (at start (not (p))))"}, "a conditional effect on (p) of (a)"),
    ({"init": "(at 5 (p))"}, "a timed initial literal at 5"),
    ({"duration": COSTS, "more": "(:action b :effect (increase (cost) 1))"}, f"duration {COSTS}"),
    ({"duration": "(< ?duration 9)"}, "found duration (< ?duration 9) of (a)"),
]
MISFITS = [
    ({"duration": "(= ?duration 6)"}, CONTRADICTION),
    ({"duration": "(<= ?duration 0.5)"}, CONTRADICTION),
    ({"duration": "(= ?duration (far))"}, "no initial value of (far)"),
    ({"action": "(b)"}, "found action 'b', expected one of domain 'd'"),
    ({"action": "(a o)"}, "found 'a' with 1 argument, expected no arguments as in (a)"),
    ({"action": "(instant)"}, "found (instant), the instantaneous action defined at <domain>:"),
]


@pytest.mark.parametrize(("parts", "message"), [*UNSUPPORTED, *MISFITS])
def test_what_is_not_supported_and_what_does_not_fit(parts, message):
    fits = (parts, message) in UNSUPPORTED
    error = refused(lambda: plan_of(**parts), message, UnsupportedError if fits else InputError)
    assert not fits or error.location.line is not None
