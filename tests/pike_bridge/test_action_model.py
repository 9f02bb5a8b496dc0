"""Networks joined with PDDL: conditions, effects, initial state, goal, durations, and what is refused."""

from fractions import Fraction

import pytest

from robust.errors import InputError, UnsupportedError
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.builder import act, build, choose, sequence
from robust.pike_bridge.compile import Checking, PlanVerdict
from robust.pike_bridge.model import ALWAYS, GOAL, INITIAL, Condition, Effect, Literal, guard
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
    return Instance(build("one", act(action, lower, upper)), domain, problem).plan()


def conditions(plan):
    return [(str(one.literal), one.first, one.last) for one in plan.conditions]


def effects(plan):
    return [(str(one.literal), one.event) for one in plan.effects]


def test_the_kitchen():
    plan = Instance(kitchen(), DOMAIN, PROBLEM).plan()
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
    for literal in (reachable, taken.negation):
        assert Effect(literal, INITIAL, ALWAYS, None) in plan.effects
    goal = [(str(one.literal), one.first, one.last) for one in plan.conditions if one.activity is None]
    assert goal == [("(filled mug)", GOAL, GOAL), ("(made bagel)", GOAL, GOAL)]
    assert Checking(plan, all_scenarios=True).run().scenarios == [{"xA1": "mug", "xR1": "mug", "xA2": "bagel"}]


def test_timing():
    """An add wins over a delete at the same event."""
    plan = plan_of(
        condition="(at start (p)) (over all (q)) (at end (not (r)))",
        effect="(at start (not (p))) (at end (p)) (at end (not (p))) (at end (q)) (at end (r))",
    )
    assert conditions(plan) == [("(p)", "e1", "e1"), ("(q)", "e1", "e2"), ("(not (r))", "e2", "e2")]
    made = [("(not (p))", "e1"), ("(p)", "e2"), ("(q)", "e2"), ("(r)", "e2")]
    assert effects(plan) == [*((f"(not ({name}))", INITIAL) for name in "pqr"), *made]


def test_what_never_changes_is_supported_by_the_initial_state():
    plan = plan_of(condition="(at start (p)) (over all (not (q)))", init="(p)", goal="(not (r)) (p)")
    assert conditions(plan)[:2] == [("(p)", "e1", "e1"), ("(not (q))", "e1", "e2")]
    assert conditions(plan)[2:] == [("(not (r))", GOAL, GOAL), ("(p)", GOAL, GOAL)]
    assert effects(plan) == [("(p)", INITIAL), ("(not (q))", INITIAL), ("(not (r))", INITIAL)]
    assert Checking(plan).run().verdict is PlanVerdict.PROVED
    plan = plan_of(condition="(over all (not (q)))", init="(q)")
    assert effects(plan) == [("(q)", INITIAL)]
    assert Checking(plan).run().verdict is PlanVerdict.REFUTED


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


def test_what_never_changes_decides_conditional_effects():
    effect = "(when (at start (r)) (at start (p))) (when (at start (not (r))) (at start (q)))"
    assert effects(plan_of(effect=effect)) == [("(not (q))", INITIAL), ("(q)", "e1")]


EITHER = {"effect": "(at end (p)) (at end (q))"}


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"condition": "(at start (or (p) (q)))", **EITHER}, "a disjunction (or (p) (q)) of (a)"),
        ({"goal": "(or (p) (q))", **EITHER}, "a disjunction (or (p) (q)) of the goal"),
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


@pytest.mark.parametrize(
    ("duration", "bounds"),
    [
        ("", (1, 5)),
        ("(= ?duration 3)", (3, 3)),
        ("(= ?duration (size))", (3, 3)),
        ("(>= ?duration 2) (<= ?duration 4.5)", (2, Fraction(9, 2))),
        ("(<= ?duration 9)", (1, 5)),
        ("(= ?duration (* 2 (- (size) 1)))", (4, 4)),
    ],
)
def test_durations_hold_both(duration, bounds):
    (activity,) = plan_of(duration=duration).network.activities
    assert (activity.lower, activity.upper) == bounds
    (activity,) = plan_of(duration="(<= ?duration 9)", upper=None).network.activities
    assert activity.upper == 9


CONTRADICTION = "found activity (a) with bounds [1, 5], expected some of the durations"


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"duration": "(= ?duration 6)"}, CONTRADICTION),
        ({"duration": "(<= ?duration 0.5)"}, CONTRADICTION),
        ({"duration": "(= ?duration (far))"}, "no initial value of (far)"),
        ({"action": "(b)"}, "found action 'b', expected one of domain 'd'"),
        ({"action": "(a o)"}, "found 'a' with 1 argument, expected no arguments as in (a)"),
        ({"action": "(instant)"}, "found (instant), the instantaneous action defined at <domain>:"),
    ],
)
def test_durations_and_actions_must_fit(parts, message):
    with pytest.raises(InputError) as caught:
        plan_of(more="(:action instant :effect (p))", **parts)
    assert message in str(caught.value)


def test_epsilon():
    network = build("n", act("(make human bagel)", 1, 2))
    plan = Instance(network, DOMAIN, PROBLEM).plan(Fraction(1, 10))
    assert plan.epsilon == Fraction(1, 10)
    assert {one.lower for one in plan.network.constraints} == {Fraction(1, 10)}
    strict = Instance(network, DOMAIN, PROBLEM).plan(Fraction(0))
    assert (strict.epsilon, {one.lower for one in strict.network.constraints}) == (0, {Fraction(0)})


def test_one_action_several_times():
    element = choose("x", {"1": act("(make human bagel)", 1, 2), "2": act("(make human bagel)", 3, 4)})
    plan = Instance(build("n", sequence(element, act("(make human bagel)", 1, 1))), DOMAIN, PROBLEM).plan()
    made = Literal(Atom("made", ("bagel",)))
    assert [one.activity for one in plan.effects if one.literal == made] == [0, 1, 2]
