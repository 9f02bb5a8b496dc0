"""Ground actions, goals and initial states."""

from fractions import Fraction
from functools import partial

import pytest

from robust.errors import Location
from robust.plan.model import (
    ActionInstance,
    And,
    AssignmentKind,
    Atom,
    AtomEffect,
    Condition,
    ContinuousEffect,
    Expression,
    Fluent,
    Holds,
    NumericEffect,
    Or,
    Timing,
    Truth,
)
from robust.plan.pddl.grounding import fluents_read, ground_action, ground_goal
from robust.plan.pddl.reader import parse_domain, parse_problem
from tests.plan.building import (
    DURATION,
    EVERYTHING,
    TOUR,
    P,
    Q,
    above,
    at_least,
    at_most,
    different,
    equal,
    number,
    reference,
    refused,
    value,
)

DOMAIN = parse_domain(EVERYTHING)
PROBLEM = parse_problem(TOUR, DOMAIN)
PLACE = Location("plan.stn", 3, 1)


def fluent(name: str, *arguments: str) -> Expression:
    return value(Fluent(name, arguments))


def ground(body: str, *, durative: bool = False, init: str = "", **options: object) -> ActionInstance:
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


def effects(text: str, **options: object) -> ActionInstance:
    return ground(f":effect {text}", **options)


def some(*atoms: Atom) -> Or:
    return Or(tuple(Holds(atom) for atom in atoms))


def r(name: str) -> Atom:
    return Atom("r", (name,))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(p)", Holds(P)),
        ("(not (p))", Holds(P, False)),
        ("(not (not (p)))", Holds(P)),
        ("(or (p) (or (q) (p)))", some(P, Q)),
        ("(not (or (p) (q)))", And((Holds(P, False), Holds(Q, False)))),
        ("(not (and (p) (not (q))))", Or((Holds(P, False), Holds(Q)))),
        ("(imply (p) (q))", Or((Holds(P, False), Holds(Q)))),
        ("(not (imply (p) (q)))", And((Holds(P), Holds(Q, False)))),
        ("(exists (?x - t) (r ?x))", some(r("a"), r("b"))),
        ("(exists (?x - (either t u)) (r ?x))", some(r("a"), r("b"), r("c"))),
        ("(not (forall (?x - t) (r ?x)))", Or((Holds(r("a"), False), Holds(r("b"), False)))),
        ("(not (exists (?x - u) (r ?x)))", Holds(r("c"), False)),
        ("(exists (?x - t) (and (r ?x) (not (= ?x a))))", Holds(r("b"))),
        ("(exists (?x) (exists (?x - u) (r ?x)))", Holds(r("c"))),
        ("(or (p) (= a b))", Holds(P)),
        ("(= a b)", Truth(False)),
        ("(or)", Truth(False)),
        ("(not (and))", Truth(False)),
        ("(exists (?x - t ?y - u) (= ?x ?y))", Truth(False)),
        ("(>= 1 2)", Truth(False)),
        ("()", None),
        ("(and)", None),
        ("(= a a)", None),
        ("(not (or))", None),
        ("(or (p) (= a a))", None),
        ("(< 1 2)", None),
        ("(imply (= a b) (p))", None),
        ("(>= (f) 2)", at_least(fluent("f"), 2)),
        ("(> (f) 2)", above(fluent("f"), 2)),
        ("(<= (f) 2)", at_most(fluent("f"), 2)),
        ("(< (f) 2)", above(number(2), fluent("f"))),
        ("(= (f) 2)", equal(fluent("f"), 2)),
        ("(not (= f 2))", different(fluent("f"), 2)),
        ("(not (>= (f) 2))", above(number(2), fluent("f"))),
        ("(not (> (f) 2))", at_most(fluent("f"), 2)),
        ("(not (<= (f) 2))", above(fluent("f"), 2)),
        ("(not (< (f) 2))", at_least(fluent("f"), 2)),
        ("(> (- (f)) (+ 1 2 (* 2 (h c) 3)))", above(-fluent("f") - 3 - fluent("h", "c").scaled(6), 0)),
        ("(> (* (f) (k)) ?s)", above(fluent("f") * fluent("k") - reference("s"), 0)),
        ("(> (- (f) 1) (/ (k) (* 2 (g))))", above(fluent("f") - 1 - fluent("k").scaled(Fraction(1, 8)), 0)),
    ],
)
def test_condition(text: str, expected: Condition | None) -> None:
    """What always holds is left out."""
    assert [condition for condition, _ in precondition(text)] == ([] if expected is None else [expected])


def test_conjuncts_are_apart_and_have_their_text() -> None:
    conjunction = "(and (P) (and (NOT (q)) (forall (?x - T) (or (r ?x) (> (h ?x) .5)))) (P) (forall (?x) (p)))"
    each = "(or (r a) (> (h a) .5))", "(or (r b) (> (h b) .5))"
    assert [text for _, text in precondition(conjunction)] == ["(p)", "(not (q))", *each]
    nested = "(imply (p) (exists (?y - t) (forall (?z ?y - (either t u)) (not (= ?y ?z)))))"
    written = nested.replace("?z ?y - ", "?z - (either t u) ?y - ")
    assert [text for _, text in precondition(f"(and {nested} (>= (- (f)) (/ ?s 2)))")] == [
        written,
        "(>= (- (f)) (/ ?s 2))",
    ]


def test_durative_action() -> None:
    move = ground_action(DOMAIN, PROBLEM, "n0", "MOVE", ["R1", "A", "b"], True, PLACE)
    assert (str(move), move.identifier, move.durative, move.location) == ("(move r1 a b)", "n0", True, PLACE)
    least = at_least(DURATION, fluent("distance", "a", "b").scaled(Fraction(1, 2)))
    most = at_least(reference("speed") + 100, DURATION)
    assert [(bound.timing, bound.text, bound.condition) for bound in move.durations] == [
        (Timing.AT_START, "(>= ?duration (/ (distance a b) (drag)))", least),
        (Timing.AT_END, "(<= ?duration (+ 1e2 ?speed))", most),
    ]
    by_text = {timed.text: timed for timed in move.conditions}
    level = by_text["(>= (charge r1) (* ?duration ?rate))"]
    expected = at_least(fluent("charge", "r1"), DURATION * reference("n0.rate"))
    assert (level.timing, level.condition) == (Timing.OVER_ALL, expected)
    assert "(not (= a b))" not in by_text
    at_end = [timed.text for timed in move.conditions if timed.timing is Timing.AT_END]
    assert at_end[:3] == ["(open hub)", "(open a)", "(open b)"]
    total, busy = Fluent("total"), Holds(Atom("busy"))
    assert move.continuous_effects == (
        ContinuousEffect(Fluent("charge", ("r1",)), reference("n0.rate").scaled(Fraction(-1, 2))),
        ContinuousEffect(total, number(1)),
    )
    assert move.numeric_effects == (
        NumericEffect(Timing.AT_START, total, AssignmentKind.INCREASE, number(-3)),
        NumericEffect(Timing.AT_END, total, AssignmentKind.INCREASE, DURATION, busy),
    )
    hub = Atom("open", ("hub",))
    assert set(move.atom_effects) >= {
        AtomEffect(Timing.AT_START, Atom("at", ("r1", "a")), False),
        AtomEffect(Timing.AT_START, hub, False, Holds(hub)),
        AtomEffect(Timing.AT_END, busy.atom, False, busy),
    }


@pytest.mark.parametrize(
    ("text", "operator", "expected"),
    [
        ("(assign (f) (k))", AssignmentKind.ASSIGN, fluent("k")),
        ("(increase (f) 2)", AssignmentKind.INCREASE, number(2)),
        ("(decrease f (* 2 (k)))", AssignmentKind.INCREASE, fluent("k").scaled(-2)),
        ("(scale-up (f) 3)", AssignmentKind.ASSIGN, fluent("f").scaled(3)),
        ("(scale-up (f) (k))", AssignmentKind.ASSIGN, fluent("f") * fluent("k")),
        ("(scale-down (f) 4)", AssignmentKind.ASSIGN, fluent("f").scaled(Fraction(1, 4))),
        ("(scale-down (f) (g))", AssignmentKind.ASSIGN, fluent("f").scaled(Fraction(1, 4))),
        ("(assign (f) (/ 1 (h a)))", AssignmentKind.ASSIGN, number(Fraction(1, 2))),
    ],
)
def test_numeric_effects(text: str, operator: AssignmentKind, expected: Expression) -> None:
    never = "(= (h a) 2) (at 4 (= (h b) 1))"
    assert effects(text, init=never).numeric_effects == (
        NumericEffect(Timing.AT_START, Fluent("f"), operator, expected),
    )


def test_conditional_and_quantified_effects() -> None:
    instance = effects("(forall (?x - t) (when (and (r ?x) (not (= ?x b))) (when (p) (and (q) (increase (h ?x) 1)))))")
    guard = And((Holds(P), Holds(r("a")))), And((Holds(r("a")), Holds(P)))
    assert [(effect.atom, effect.condition in guard) for effect in instance.atom_effects] == [(Q, True)]
    assert [effect.fluent for effect in instance.numeric_effects] == [Fluent("h", ("a",))]
    assert effects("(when (= a b) (q))").atom_effects == ()
    assert effects("(when (= a a) (q))").atom_effects == (AtomEffect(Timing.AT_START, Q, True),)


def test_repeated_effects() -> None:
    assert len(effects("(and (p) (p) (not (q)))").atom_effects) == 2
    assert len(effects("(forall (?x) (increase (f) 1))").numeric_effects) == 3, "equal increases add up"
    assert len(effects("(and (when (p) (assign (f) 1)) (when (q) (assign (f) 2)))").numeric_effects) == 2


@pytest.mark.parametrize(
    ("text", "rate"),
    [
        ("(increase (f) (* #t 2))", number(2)),
        ("(decrease (f) (* (k) #t))", -fluent("k")),
        ("(increase (f) #t)", number(1)),
        ("(increase (f) (* 2 #t (+ (k) 1)))", fluent("k").scaled(2) + 2),
        ("(increase (f) (* (* #t 2) 3))", number(6)),
        ("(increase (f) (/ (* #t (k)) 2))", fluent("k").scaled(Fraction(1, 2))),
        ("(increase (f) (- (* #t 3)))", number(-3)),
        ("(increase (f) (+ #t (* ?s #t)))", reference("s") + 1),
    ],
)
def test_continuous_effects(text: str, rate: Expression) -> None:
    instance = ground(f":duration () :effect {text}", durative=True)
    assert instance.continuous_effects == (ContinuousEffect(Fluent("f"), rate),)


@pytest.mark.parametrize(
    ("effect", "varied", "culprit"),
    [
        *((f"(assign (f) (/ 1 {divisor}))", (), divisor) for divisor in ("(k)", "(h a)")),
        ("(assign (f) (/ 1 ?s))", (), "s"),
        ("(assign (f) (/ 1 (+ (k) (g))))", (), "(k)"),
        ("(scale-down (f) (k))", (), "(k)"),
        ("(scale-down (f) (g))", ("g",), "(g)"),
    ],
)
def test_division_by_what_may_change(effect: str, varied: tuple[str, ...], culprit: str) -> None:
    init = "(= (h a) 2) (at 4 (= (h a) 1))"
    parts = [f"non-linear because {culprit} may vary", "expected a divisor that no action"]
    call = partial(effects, effect, init=init, parametrized=set(map(Fluent, varied)))
    refused(call, "<domain>:1:", parts, exit_code=4)


@pytest.mark.parametrize(
    ("effect", "init", "message"),
    [
        ("(assign (f) (/ 1 (- (g) 4)))", "", "found a division by (- (g) 4), which is zero"),
        ("(assign (f) (/ 1 (h a)))", "", "found a division by (h a), expected (= (h a) VALUE) in the problem's :init"),
        ("(and (assign (f) 1) (assign (f) 2))", "", "found an assignment and another change of (f)"),
        ("(and (assign (f) 1) (assign (f) 1.0))", "", "at start in one action, expected at most one of them; remove"),
        ("(forall (?x) (assign (f) 1))", "", "found an assignment and another change of (f)"),
        ("(and (increase (f) 1) (scale-up (f) 2))", "", "found an assignment and another change of (f)"),
    ],
)
def test_effect_is_refused(effect: str, init: str, message: str) -> None:
    refused(lambda: effects(effect, init=init), "<domain>:1:", [message])


@pytest.mark.parametrize(
    ("action", "durative", "message"),
    [
        ("mvoe r1 a b", True, "'mvoe', expected one of domain 'everything'; did you mean 'move'?"),
        ("move r1 a", True, "'move' with 2 arguments, expected 3 arguments as in (move ?v ?from ?to)"),
        ("move r1 a c", True, "'c', expected an object of problem 'tour'; known are a, b, hub, r1"),
        ("move a a b", True, "'a' of type place, expected type robot for ?v of (move ?v ?from ?to)"),
        ("move r1 a b", False, "'move' used as an instantaneous action, expected a durative action"),
        ("toggle a", True, "expected an instantaneous action as defined at <domain>:10:3"),
    ],
)
def test_instance_is_refused(action: str, durative: bool, message: str) -> None:
    name, *arguments = action.split()
    call = partial(ground_action, DOMAIN, PROBLEM, "n0", name, arguments, durative, PLACE)
    refused(call, "plan.stn:3:1: found ", [message])


def test_goal() -> None:
    goal = ground_goal(DOMAIN, PROBLEM)
    assert [(part.condition, part.text) for part in goal] == [
        (Holds(Atom("at", ("r1", "b"))), "(at r1 b)"),
        (at_least(fluent("charge", "r1"), reference("speed")), "(>= (charge r1) ?speed)"),
    ]
    assert goal[0].label == "goal: (at r1 b)"


@pytest.mark.parametrize(
    ("body", "read"),
    [
        (":duration () :effect (at end (assign (f) 1))", ""),
        (":duration () :effect (at end (assign (f) (k)))", "k"),
        (":duration () :effect (at end (increase (f) (k)))", "f k"),
        (":duration () :effect (at end (scale-up (f) 2))", "f"),
        (":duration () :effect (at end (when (> (k) 0) (p)))", "k"),
        (":duration () :effect (at end (when (> (k) 0) (assign (f) 1)))", "k"),
        (":duration () :effect (increase (f) (* #t (k)))", "f k"),
        (":duration (= ?duration (g))", "g"),
        (":duration () :condition (over all (or (p) (and (> (f) 0) (q)) (> (g) (k))))", "f g k"),
        (":duration (= ?duration (/ 1 (g)))", "g"),
        (":duration (= ?duration (- (g) (g))) :condition (over all (>= (f) (f)))", "f g"),
        (":duration () :condition (at start (or (= a a) (> (f) 0)))", ""),
        (":duration () :condition (at start (imply (> (f) 0) (= a b)))", "f"),
        (":duration () :effect (at end (when (and (= a b) (> (f) (f))) (p)))", ""),
        (":duration () :effect (at end (when (> (f) (f)) (p)))", "f"),
    ],
)
def test_fluents_read(body: str, read: str) -> None:
    assert fluents_read(ground(body, durative=True)) == {Fluent(name) for name in read.split()}


@pytest.mark.parametrize("opening", ["(not ", "(and ", "(or (q) ", "(imply (q) ", "(forall (?y) ", "(exists (?y - u) "])
def test_deep_conditions_are_ground(opening: str) -> None:
    levels = 100 if opening != "(forall (?y) " else 5  # three objects: 3⁵ copies
    for condition, _ in precondition(opening * levels + "(p)" + ")" * levels):
        assert Holds(P) in (condition, *getattr(condition, "operands", ()))
    guarded = effects("(when (p) " * 100 + "(q)" + ")" * 100).atom_effects
    assert guarded == (AtomEffect(Timing.AT_START, Q, True, Holds(P)),)
