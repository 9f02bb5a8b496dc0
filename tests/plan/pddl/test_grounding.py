"""Ground actions, goals and initial states."""

from fractions import Fraction
from functools import partial

import pytest

from robust.errors import Location
from robust.plan import model
from robust.plan.model import Atom, AtomEffect, Condition, Fluent, Holds, NumericEffect, Timing, Truth
from robust.plan.pddl.grounding import fluents_read, ground_action, ground_goal
from robust.plan.pddl.reader import parse_domain, parse_problem
from tests.pddl_text import condition_text
from tests.plan import building
from tests.plan.building import EVERYTHING, TOUR, P, Q, at_least, number, reference

DOMAIN = parse_domain(EVERYTHING)
PROBLEM = parse_problem(TOUR, DOMAIN)
PLACE = Location("plan.stn", 3, 1)
GROUPS = building.groups(building.TEXTS / "grounding.txt")
INCREASE = model.AssignmentKind.INCREASE
TOTAL, CHARGE = Fluent("total"), Fluent("charge", ("r1",))


def ground(body: str, *, durative: bool = False, init: str = "", **options: object) -> model.ActionInstance:
    """The only instance of an action with that body; objects are a, b of type t and c of type u."""
    kind = ":durative-action" if durative else ":action"
    domain = parse_domain(
        "(define (domain d) (:types t u) (:constants a b - t c - u) (:predicates (p) (q) (r ?x))"
        "(:functions (f) (g) (h ?x) (k))"
        f"(:synth-parameters ?s) (:action other :effect (increase (k) 1)) ({kind} act {body}))"
    )
    problem = parse_problem(f"(define (problem x) (:domain d) (:init (= (g) 4) {init}) (:goal ()))", domain)
    arguments = ["a"] if ":parameters (?x" in body else []
    return ground_action(domain, problem, "n1", "act", arguments, durative, PLACE, **options)


def precondition(text: str) -> list[tuple[Condition, str]]:
    instance = ground(f":precondition {text}")
    assert {timed.timing for timed in instance.conditions} <= {Timing.AT_START}
    return [(timed.condition, timed.text) for timed in instance.conditions]


def rows(group: str) -> list[list[str]]:
    return [row.split(" => ") for row in GROUPS[group].splitlines()]


@pytest.mark.parametrize(("text", "expected"), rows("conditions"))
def test_condition(text: str, expected: str) -> None:
    assert [condition_text(condition) for condition, _ in precondition(text)] == [expected] * (expected != "nothing")


def test_conjuncts_are_apart_and_have_their_text() -> None:
    conjunction = "(and (P) (and (NOT (q)) (forall (?x - T) (or (r ?x) (> (h ?x) .5)))) (P) (forall (?x) (p)))"
    each = "(or (r a) (> (h a) .5))", "(or (r b) (> (h b) .5))"
    assert [text for _, text in precondition(conjunction)] == ["(p)", "(not (q))", *each]
    nested = "(imply (p) (exists (?y - t) (forall (?z ?y - (either t u)) (not (= ?y ?z)))))"
    written, level = nested.replace("?z ?y - ", "?z - (either t u) ?y - "), "(>= (- (f)) (/ ?s 2))"
    assert [text for _, text in precondition(f"(and {nested} {level})")] == [written, level]


def test_durative_action() -> None:
    move = ground_action(DOMAIN, PROBLEM, "n0", "MOVE", ["R1", "A", "b"], True, PLACE)
    assert (str(move), move.identifier, move.durative, move.location) == ("(move r1 a b)", "n0", True, PLACE)
    least = at_least(building.DURATION, building.value(Fluent("distance", ("a", "b"))).scaled(Fraction(1, 2)))
    most = at_least(reference("speed") + 100, building.DURATION)
    assert [(bound.timing, bound.text, bound.condition) for bound in move.durations] == [
        (Timing.AT_START, "(>= ?duration (/ (distance a b) (drag)))", least),
        (Timing.AT_END, "(<= ?duration (+ 1e2 ?speed))", most),
    ]
    by_text = {timed.text: timed for timed in move.conditions}
    level = by_text["(>= (charge r1) (* ?duration ?rate))"]
    expected = at_least(building.value(CHARGE), building.DURATION * reference("n0.rate"))
    assert (level.timing, level.condition) == (Timing.OVER_ALL, expected)
    assert "(not (= a b))" not in by_text
    at_end = [timed.text for timed in move.conditions if timed.timing is Timing.AT_END]
    assert at_end[:3] == ["(open hub)", "(open a)", "(open b)"]
    flows = building.flow(CHARGE, reference("n0.rate").scaled(Fraction(-1, 2))), building.flow(TOTAL, 1)
    assert move.continuous_effects == flows
    busy, hub = Holds(Atom("busy")), Atom("open", ("hub",))
    at_end = NumericEffect(Timing.AT_END, TOTAL, INCREASE, building.DURATION, busy)
    assert move.numeric_effects == (NumericEffect(Timing.AT_START, TOTAL, INCREASE, number(-3)), at_end)
    assert set(move.atom_effects) >= {
        AtomEffect(Timing.AT_START, Atom("at", ("r1", "a")), False),
        AtomEffect(Timing.AT_START, hub, False, Holds(hub)),
        AtomEffect(Timing.AT_END, busy.atom, False, busy),
    }


@pytest.mark.parametrize(("text", "expected"), rows("numeric effects"))
def test_numeric_effects(text: str, expected: str) -> None:
    (effect,) = ground(f":effect {text}", init="(= (h a) 2) (at 4 (= (h b) 1))").numeric_effects
    assert (effect.timing, effect.fluent, effect.condition) == (Timing.AT_START, Fluent("f"), Truth(True))
    assert f"{effect.operator.value} {effect.expression}" == expected


def test_conditional_quantified_and_repeated_effects() -> None:
    nested = "(forall (?x - t) (when (and (r ?x) (not (= ?x b))) (when (p) (and (q) (increase (h ?x) 1)))))"
    instance, of_a = ground(f":effect {nested}"), Holds(Atom("r", ("a",)))
    guard = model.And((Holds(P), of_a)), model.And((of_a, Holds(P)))
    assert [(effect.atom, effect.condition in guard) for effect in instance.atom_effects] == [(Q, True)]
    assert [effect.fluent for effect in instance.numeric_effects] == [Fluent("h", ("a",))]
    assert ground(":effect (when (= a b) (q))").atom_effects == ()
    assert ground(":effect (when (= a a) (q))").atom_effects == (AtomEffect(Timing.AT_START, Q, True),)
    assert len(ground(":effect (and (p) (p) (not (q)))").atom_effects) == 2
    assert len(ground(":effect (forall (?x) (increase (f) 1))").numeric_effects) == 3, "equal increases add up"
    assert len(ground(":effect (and (when (p) (assign (f) 1)) (when (q) (assign (f) 2)))").numeric_effects) == 2


@pytest.mark.parametrize(("text", "rate"), rows("rates"))
def test_continuous_effects(text: str, rate: str) -> None:
    (effect,) = ground(f":duration () :effect {text}", durative=True).continuous_effects
    assert (effect.fluent, str(effect.rate)) == (Fluent("f"), rate)


@pytest.mark.parametrize(("text", "culprit"), rows("divisions by what may change"))
def test_division_by_what_may_change(text: str, culprit: str) -> None:
    """A second name after the culprit's is that of a fluent whose initial value is a parameter."""
    parts = [f"non-linear because {culprit.removesuffix(' g')} may vary", "expected a divisor that no action"]
    parametrized = {Fluent("g")} if culprit.endswith(" g") else set()
    call = partial(ground, f":effect {text}", init="(= (h a) 2) (at 4 (= (h a) 1))", parametrized=parametrized)
    building.refused(call, "<domain>:1:", parts, exit_code=4)


@pytest.mark.parametrize(("text", "message"), rows("refused effects"))
def test_effect_is_refused(text: str, message: str) -> None:
    building.refused(lambda: ground(f":effect {text}"), "<domain>:1:", [message])


@pytest.mark.parametrize(("action", "message"), rows("refused instances"))
def test_instance_is_refused(action: str, message: str) -> None:
    name, *arguments, kind = action.split()
    call = partial(ground_action, DOMAIN, PROBLEM, "n0", name, arguments, kind == "durative", PLACE)
    building.refused(call, "plan.stn:3:1: found ", [message])


def test_goal() -> None:
    goal = ground_goal(DOMAIN, PROBLEM)
    assert [(part.condition, part.text) for part in goal] == [
        (Holds(Atom("at", ("r1", "b"))), "(at r1 b)"),
        (at_least(building.value(CHARGE), reference("speed")), "(>= (charge r1) ?speed)"),
    ]
    assert goal[0].label == "goal: (at r1 b)"


@pytest.mark.parametrize(("body", "names"), rows("fluents read"))
def test_fluents_read(body: str, names: str) -> None:
    assert fluents_read(ground(body, durative=True)) == {Fluent(name) for name in names.split() if name != "nothing"}


@pytest.mark.parametrize("opening", ["(not ", "(and ", "(or (q) ", "(imply (q) ", "(forall (?y) ", "(exists (?y - u) "])
def test_deep_conditions_are_ground(opening: str) -> None:
    levels = 100 if opening != "(forall (?y) " else 5  # three objects: 3⁵ copies
    for condition, _ in precondition(opening * levels + "(p)" + ")" * levels):
        assert Holds(P) in (condition, *getattr(condition, "operands", ()))
    guarded = ground(":effect " + "(when (p) " * 100 + "(q)" + ")" * 100).atom_effects
    assert guarded == (AtomEffect(Timing.AT_START, Q, True, Holds(P)),)
