"""Networks joined with PDDL: conditions, effects, initial state, goal, durations, and what is refused."""

from fractions import Fraction

import pytest

from robust.errors import InputError, UnsupportedError
from robust.pike_bridge.action_model import team_plan_of
from robust.pike_bridge.builder import act, build, choose, sequence
from robust.pike_bridge.compile import Checking, PlanVerdict
from robust.pike_bridge.cross_check import propositional
from robust.pike_bridge.model import ALWAYS, EPSILON, GOAL, INITIAL, Condition, Effect, Literal, guard
from robust.plan.model import Atom
from tests.pike_bridge.kitchen import DOMAIN, PROBLEM, kitchen

P, Q = Atom("p"), Atom("q")


def plan_of(*, condition="", effect="", duration="", init="", goal="", more="", lower=1, upper=5, action="(a)"):
    """One activity from e1 to e2 with the given action."""
    domain = f"""
    (define (domain d) (:requirements :durative-actions :fluents)
      (:predicates (p) (q) (r) (same ?x ?y)) (:functions (cost) (size) (far))
      (:durative-action a :parameters () :duration (and {duration})
        :condition (and {condition}) :effect (and {effect}))
      {more})"""
    problem = (
        f"(define (problem i) (:domain d) (:objects o) (:init (= (size) 3) (= (cost) 0) {init}) (:goal (and {goal})))"
    )
    return team_plan_of(build("one", act(action, lower, upper)), domain, problem)


def conditions(plan):
    return [(str(one.literal), one.first, one.last) for one in plan.conditions]


def effects(plan):
    return [(str(one.literal), one.event) for one in plan.effects]


def test_the_kitchen():
    plan = team_plan_of(kitchen(), DOMAIN, PROBLEM)
    mug, glass = guard({"xA1": "mug"}), guard({"xA1": "glass"})
    reachable = Literal(Atom("reachable", ("mug",)))
    assert plan.conditions[:2] == (
        Condition(reachable, "e2", "e2", mug, 0),
        Condition(Literal(Atom("filled", ("mug",)), False), "e2", "e2", mug, 0),
    )
    pouring = plan.network.activities[2]
    taken = Literal(Atom("taken", ("mug",)))
    assert Condition(taken, pouring.source, pouring.target, pouring.guard, 2) in plan.conditions
    assert Effect(reachable.negation, "e2", mug, 0) in plan.effects
    assert Effect(Literal(Atom("taken", ("glass",))), "e5", glass, 1) in plan.effects
    initial = [str(one.literal) for one in plan.effects if one.event == INITIAL]
    assert "(reachable mug)" in initial
    assert "(not (taken mug))" in initial
    assert all(one.guard == ALWAYS and one.activity is None for one in plan.effects if one.event == INITIAL)
    goal = [one for one in plan.conditions if one.activity is None]
    assert [str(one.literal) for one in goal] == ["(filled mug)", "(made bagel)"]
    assert {(one.first, one.last) for one in goal} == {(GOAL, GOAL)}


def test_the_kitchen_can_be_executed():
    outcome = Checking(team_plan_of(kitchen(), DOMAIN, PROBLEM), all_scenarios=True).run()
    assert outcome.verdict is PlanVerdict.PROVED
    assert outcome.scenarios == ({"xA1": "mug", "xR1": "mug", "xA2": "bagel"},)


def test_timing():
    plan = plan_of(
        condition="(at start (p)) (over all (q)) (at end (not (r)))",
        effect="(at start (not (p))) (at end (p)) (at end (q)) (at end (r))",
    )
    assert conditions(plan) == [("(p)", "e1", "e1"), ("(q)", "e1", "e2"), ("(not (r))", "e2", "e2")]
    assert effects(plan) == [
        ("(not (p))", INITIAL),
        ("(not (q))", INITIAL),
        ("(not (r))", INITIAL),
        ("(not (p))", "e1"),
        ("(p)", "e2"),
        ("(q)", "e2"),
        ("(r)", "e2"),
    ]


def test_an_add_wins_over_a_delete_at_the_same_event():
    plan = plan_of(effect="(at end (not (p))) (at end (p)) (at start (not (p)))")
    assert effects(plan) == [("(not (p))", INITIAL), ("(p)", "e2"), ("(not (p))", "e1")]


def test_what_never_changes_is_supported_by_the_initial_state():
    plan = plan_of(condition="(at start (p)) (over all (not (q)))", init="(p)", goal="(not (r)) (p)")
    assert conditions(plan) == [
        ("(p)", "e1", "e1"),
        ("(not (q))", "e1", "e2"),
        ("(not (r))", GOAL, GOAL),
        ("(p)", GOAL, GOAL),
    ]
    assert effects(plan) == [("(p)", INITIAL), ("(not (q))", INITIAL), ("(not (r))", INITIAL)]
    assert Checking(plan).run().verdict is PlanVerdict.PROVED
    plan = plan_of(condition="(over all (not (q)))", init="(q)")
    assert effects(plan) == [("(q)", INITIAL)]
    assert Checking(plan).run().verdict is PlanVerdict.REFUTED


def test_disjunctions_that_what_never_changes_decides():
    touched = "(at end (q))"
    assert conditions(plan_of(condition="(at start (or (p) (q)))", effect=touched)) == [("(q)", "e1", "e1")]
    assert conditions(plan_of(condition="(at start (or (p) (q)))", init="(p)", effect=touched)) == []
    assert conditions(plan_of(condition="(at start (imply (p) (q)))", effect=touched)) == []
    never = plan_of(condition="(at start (or (p) (r)))", effect=touched)
    assert conditions(never) == [("(never (or (p) (r)))", "e1", "e1")]
    assert Checking(never).run().verdict is PlanVerdict.REFUTED
    assert conditions(plan_of(condition="(at start (forall (?x) (not (= ?x ?x))))")) == [
        ("(never (not (= o o)))", "e1", "e1")
    ]
    assert conditions(plan_of(condition="(at start (>= (size) 3)) (at end (< (size) 9))")) == []
    assert conditions(plan_of(condition="(at start (> (size) 3))")) == [("(never (> (size) 3))", "e1", "e1")]
    assert conditions(plan_of(condition="(over all (forall (?x) (or (same ?x ?x) (= ?x ?x))))")) == []


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"condition": "(at start (or (p) (q)))", "effect": "(at end (p)) (at end (q))"},
            "a disjunction (or (p) (q)) of (a)",
        ),
        ({"goal": "(or (p) (q))", "effect": "(at end (p)) (at end (q))"}, "a disjunction (or (p) (q)) of the goal"),
        (
            {"condition": "(at start (>= (cost) 1))", "effect": "(at end (increase (cost) 1))"},
            "numeric condition (>= (cost) 1)",
        ),
        ({"effect": "(at end (increase (cost) 1))"}, "a change of the number (cost) by (a)"),
        ({"effect": "(increase (cost) (* #t 1))"}, "a change of the number (cost) by (a)"),
        ({"effect": "(when (at start (p)) (at start (not (p))))"}, "a conditional effect on (p) of (a)"),
        ({"init": "(at 5 (p))"}, "a timed initial literal at 5"),
        (
            {"duration": "(= ?duration (cost))", "more": "(:action b :effect (increase (cost) 1))"},
            "duration (= ?duration (cost))",
        ),
        ({"duration": "(< ?duration 9)"}, "found duration (< ?duration 9) of (a)"),
    ],
)
def test_what_is_not_supported(parts, message):
    with pytest.raises(UnsupportedError) as caught:
        plan_of(**parts)
    assert message in str(caught.value)
    assert caught.value.location.line is not None


def test_conditional_effects_that_what_never_changes_decides():
    effect = "(when (at start (r)) (at start (p))) (when (at start (not (r))) (at start (q)))"
    assert effects(plan_of(effect=effect)) == [("(not (q))", INITIAL), ("(q)", "e1")]


@pytest.mark.parametrize(
    ("duration", "bounds"),
    [
        ("", (1, 5)),
        ("(= ?duration 3)", (3, 3)),
        ("(= ?duration (size))", (3, 3)),
        ("(>= ?duration 2) (<= ?duration 4.5)", (2, Fraction(9, 2))),
        ("(<= ?duration 9)", (1, 5)),
        ("(= ?duration (* 2 (- (size) 1/1)))".replace("1/1", "1"), (4, 4)),
    ],
)
def test_durations_hold_both(duration, bounds):
    (activity,) = plan_of(duration=duration).network.activities
    assert (activity.lower, activity.upper) == bounds
    (activity,) = plan_of(duration="(<= ?duration 9)", upper=None).network.activities
    assert activity.upper == 9


def test_durations_that_contradict():
    for duration in ("(= ?duration 6)", "(<= ?duration 0.5)"):
        with pytest.raises(
            InputError, match=r"found activity \(a\) with bounds \[1, 5\], expected some of the durations"
        ):
            plan_of(duration=duration)
    with pytest.raises(InputError, match=r"no initial value of \(far\)"):
        plan_of(duration="(= ?duration (far))")


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ("(b)", "found action 'b', expected one of domain 'd'"),
        ("(a o)", "found 'a' with 1 argument, expected no arguments as in (a)"),
        ("(instant)", "found (instant), the instantaneous action defined at <domain>:"),
    ],
)
def test_actions_must_fit(action, message):
    with pytest.raises(InputError) as caught:
        plan_of(action=action, more="(:action instant :effect (p))")
    assert message in str(caught.value)


def test_types_must_fit():
    network = build("n", act("(get mug human)", 1, 2))
    with pytest.raises(InputError, match="'mug' of type vessel, expected type agent"):
        team_plan_of(network, DOMAIN, PROBLEM)


def test_epsilon():
    network = build("n", act("(make human bagel)", 1, 2))
    plan = team_plan_of(network, DOMAIN, PROBLEM, epsilon=Fraction(1, 10))
    assert plan.epsilon == Fraction(1, 10)
    assert {one.lower for one in plan.network.constraints} == {Fraction(1, 10)}
    with pytest.raises(InputError, match="ε = 0"):
        team_plan_of(network, DOMAIN, PROBLEM, epsilon=Fraction(0))


def test_a_plan_and_its_propositional_form_are_the_same():
    plan = team_plan_of(kitchen(), DOMAIN, PROBLEM)
    instance = propositional(plan)
    again = team_plan_of(instance.network, instance.domain, instance.problem)
    assert again.network.events == plan.network.events
    assert again.network.constraints == plan.network.constraints
    assert len(again.conditions) == len(plan.conditions)
    assert [(one.first, one.last, one.guard, one.activity) for one in again.conditions] == [
        (one.first, one.last, one.guard, one.activity) for one in plan.conditions
    ]
    assert len(again.effects) == len(plan.effects)
    assert plan.epsilon == again.epsilon == EPSILON


def test_one_action_several_times():
    element = choose("x", {"1": act("(make human bagel)", 1, 2), "2": act("(make human bagel)", 3, 4)})
    plan = team_plan_of(build("n", sequence(element, act("(make human bagel)", 1, 1))), DOMAIN, PROBLEM)
    made = Literal(Atom("made", ("bagel",)))
    assert [one.activity for one in plan.effects if one.literal == made] == [0, 1, 2]
