"""Ground actions, goals and initial states."""

from fractions import Fraction

import pytest

from robust.errors import InputError, Location, RobustError, UnsupportedError
from robust.plan.model import (
    ActionInstance,
    And,
    Assignment,
    Atom,
    AtomEffect,
    Comparison,
    Condition,
    ContinuousEffect,
    Duration,
    Expression,
    Fluent,
    Holds,
    NumericEffect,
    Or,
    ParameterReference,
    Relation,
    Timing,
    Truth,
)
from robust.plan.pddl.grounding import (
    fluents_read,
    ground_action,
    ground_goal,
    initial_fluents,
)
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from tests.plan.pddl.sources import DOMAIN, PROBLEM

EVERYTHING = parse_domain(DOMAIN)
TOUR = parse_problem(PROBLEM, EVERYTHING)
PLACE = Location("plan.stn", 3, 1)
P, Q = Atom("p"), Atom("q")
DURATION: Expression = Polynomial.variable(Duration())


def fluent(name: str, *arguments: str) -> Expression:
    return Polynomial.variable(Fluent(name, arguments))


def number(value: int | Fraction) -> Expression:
    return Polynomial.constant(value)


def parameter(name: str) -> Expression:
    return Polynomial.variable(ParameterReference(name))


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


def positive(expression: Expression) -> Comparison:
    return Comparison(expression, Relation.GREATER)


def r(name: str) -> Atom:
    return Atom("r", (name,))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(p)", Holds(P)),
        ("(not (p))", Holds(P, value=False)),
        ("(not (not (p)))", Holds(P)),
        ("(or (p) (or (q) (p)))", some(P, Q)),
        ("(not (or (p) (q)))", And((Holds(P, value=False), Holds(Q, value=False)))),
        ("(not (and (p) (not (q))))", Or((Holds(P, value=False), Holds(Q)))),
        ("(imply (p) (q))", Or((Holds(P, value=False), Holds(Q)))),
        ("(not (imply (p) (q)))", And((Holds(P), Holds(Q, value=False)))),
        ("(exists (?x - t) (r ?x))", some(r("a"), r("b"))),
        ("(exists (?x - (either t u)) (r ?x))", some(r("a"), r("b"), r("c"))),
        ("(not (forall (?x - t) (r ?x)))", Or((Holds(r("a"), value=False), Holds(r("b"), value=False)))),
        ("(not (exists (?x - u) (r ?x)))", Holds(r("c"), value=False)),
        ("(exists (?x - t) (and (r ?x) (not (= ?x a))))", Holds(r("b"))),
        ("(exists (?x) (exists (?x - u) (r ?x)))", Holds(r("c"))),
        ("(or (p) (= a b))", Holds(P)),
        ("(= a b)", Truth(value=False)),
        ("(or)", Truth(value=False)),
        ("(not (and))", Truth(value=False)),
        ("(exists (?x - t ?y - u) (= ?x ?y))", Truth(value=False)),
        ("(>= 1 2)", Truth(value=False)),
        ("(>= (f) 2)", Comparison(fluent("f") - 2, Relation.AT_LEAST)),
        ("(> (f) 2)", Comparison(fluent("f") - 2, Relation.GREATER)),
        ("(<= (f) 2)", Comparison(number(2) - fluent("f"), Relation.AT_LEAST)),
        ("(< (f) 2)", Comparison(number(2) - fluent("f"), Relation.GREATER)),
        ("(= (f) 2)", Comparison(fluent("f") - 2, Relation.EQUAL)),
        ("(not (= f 2))", Comparison(fluent("f") - 2, Relation.DIFFERENT)),
        ("(not (>= (f) 2))", Comparison(number(2) - fluent("f"), Relation.GREATER)),
        ("(not (> (f) 2))", Comparison(number(2) - fluent("f"), Relation.AT_LEAST)),
        ("(not (<= (f) 2))", Comparison(fluent("f") - 2, Relation.GREATER)),
        ("(not (< (f) 2))", Comparison(fluent("f") - 2, Relation.AT_LEAST)),
        ("(> (- (f)) (+ 1 2 (* 2 (h c) 3)))", positive(-fluent("f") - 3 - fluent("h", "c").scaled(6))),
        ("(> (* (f) (k)) ?s)", positive(fluent("f") * fluent("k") - parameter("s"))),
        ("(> (- (f) 1) (/ (k) (* 2 (g))))", positive(fluent("f") - 1 - fluent("k").scaled(Fraction(1, 8)))),
    ],
)
def test_condition(text: str, expected: Condition) -> None:
    assert [condition for condition, _ in precondition(text)] == [expected]


@pytest.mark.parametrize(
    "text", ["()", "(and)", "(= a a)", "(not (or))", "(or (p) (= a a))", "(< 1 2)", "(imply (= a b) (p))"]
)
def test_conditions_that_always_hold_are_left_out(text: str) -> None:
    assert precondition(text) == []


def test_conjuncts_are_apart_and_have_their_text() -> None:
    conjunction = "(and (P) (and (NOT (q)) (forall (?x - T) (or (r ?x) (> (h ?x) .5)))))"
    assert [text for _, text in precondition(conjunction)] == [
        "(p)",
        "(not (q))",
        "(or (r a) (> (h a) .5))",
        "(or (r b) (> (h b) .5))",
    ]
    nested = "(imply (p) (exists (?y - t) (forall (?z ?y - (either t u)) (not (= ?y ?z)))))"
    assert [text for _, text in precondition(f"(and {nested} (>= (- (f)) (/ ?s 2)))")] == [
        "(imply (p) (exists (?y - t) (forall (?z - (either t u) ?y - (either t u)) (not (= ?y ?z)))))",
        "(>= (- (f)) (/ ?s 2))",
    ]


def test_a_condition_that_is_written_twice_is_one() -> None:
    assert precondition("(and (p) (and (P)) (forall (?x) (p)))") == [(Holds(P), "(p)")]


def test_durative_action() -> None:
    move = ground_action(EVERYTHING, TOUR, "n0", "MOVE", ["R1", "A", "b"], True, PLACE)
    assert (str(move), move.identifier, move.durative, move.location) == ("(move r1 a b)", "n0", True, PLACE)
    assert [(bound.timing, bound.text) for bound in move.durations] == [
        (Timing.AT_START, "(>= ?duration (/ (distance a b) (drag)))"),
        (Timing.AT_END, "(<= ?duration (+ 1e2 ?speed))"),
    ]
    assert [bound.condition for bound in move.durations] == [
        Comparison(DURATION - fluent("distance", "a", "b").scaled(Fraction(1, 2)), Relation.AT_LEAST),
        Comparison(number(100) + parameter("speed") - DURATION, Relation.AT_LEAST),
    ]
    by_text = {timed.text: timed for timed in move.conditions}
    level = by_text["(>= (charge r1) (* ?duration ?rate))"]
    assert level.timing is Timing.OVER_ALL
    expected = fluent("charge", "r1") - DURATION * parameter("n0.rate")
    assert level.condition == Comparison(expected, Relation.AT_LEAST)
    assert "(not (= a b))" not in by_text
    assert [timed.text for timed in move.conditions if timed.timing is Timing.AT_END][:3] == [
        "(open hub)",
        "(open a)",
        "(open b)",
    ]
    assert move.continuous_effects == (
        ContinuousEffect(Fluent("charge", ("r1",)), parameter("n0.rate").scaled(Fraction(-1, 2))),
        ContinuousEffect(Fluent("total"), number(1)),
    )
    assert move.numeric_effects == (
        NumericEffect(Timing.AT_START, Fluent("total"), Assignment.INCREASE, number(-3)),
        NumericEffect(Timing.AT_END, Fluent("total"), Assignment.INCREASE, DURATION, Holds(Atom("busy"))),
    )
    assert AtomEffect(Timing.AT_START, Atom("at", ("r1", "a")), value=False) in move.atom_effects
    hub = Atom("open", ("hub",))
    assert AtomEffect(Timing.AT_START, hub, value=False, condition=Holds(hub)) in move.atom_effects
    assert AtomEffect(Timing.AT_END, Atom("busy"), value=False, condition=Holds(Atom("busy"))) in move.atom_effects


def test_instantaneous_action_is_at_start() -> None:
    toggle = ground_action(EVERYTHING, TOUR, "n0", "toggle", ["b"], False, None)
    parts = (*toggle.conditions, *toggle.atom_effects, *toggle.numeric_effects)
    assert {part.timing for part in parts} == {Timing.AT_START}
    assert toggle.durations == toggle.continuous_effects == ()
    assert [effect.fluent for effect in toggle.numeric_effects] == [Fluent("charge", ("r1",))]


@pytest.mark.parametrize(
    ("text", "operator", "expected"),
    [
        ("(assign (f) (k))", Assignment.ASSIGN, fluent("k")),
        ("(increase (f) 2)", Assignment.INCREASE, number(2)),
        ("(decrease f (* 2 (k)))", Assignment.INCREASE, fluent("k").scaled(-2)),
        ("(scale-up (f) 3)", Assignment.ASSIGN, fluent("f").scaled(3)),
        ("(scale-up (f) (k))", Assignment.ASSIGN, fluent("f") * fluent("k")),
        ("(scale-down (f) 4)", Assignment.ASSIGN, fluent("f").scaled(Fraction(1, 4))),
        ("(scale-down (f) (g))", Assignment.ASSIGN, fluent("f").scaled(Fraction(1, 4))),
    ],
)
def test_numeric_effects(text: str, operator: Assignment, expected: Expression) -> None:
    assert effects(text).numeric_effects == (NumericEffect(Timing.AT_START, Fluent("f"), operator, expected),)


def test_conditional_and_quantified_effects() -> None:
    instance = effects("(forall (?x - t) (when (and (r ?x) (not (= ?x b))) (when (p) (and (q) (increase (h ?x) 1)))))")
    guard = And((Holds(P), Holds(r("a")))), And((Holds(r("a")), Holds(P)))
    assert [(effect.atom, effect.condition in guard) for effect in instance.atom_effects] == [(Q, True)]
    assert [effect.fluent for effect in instance.numeric_effects] == [Fluent("h", ("a",))]
    assert effects("(when (= a b) (q))").atom_effects == ()
    assert effects("(when (= a a) (q))").atom_effects == (AtomEffect(Timing.AT_START, Q, value=True),)


def test_repeated_effects() -> None:
    assert len(effects("(and (p) (p) (not (q)))").atom_effects) == 2
    assert len(effects("(and (assign (f) 1) (assign (f) 1.0))").numeric_effects) == 1
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
        ("(increase (f) (+ #t (* ?s #t)))", parameter("s") + 1),
    ],
)
def test_continuous_effects(text: str, rate: Expression) -> None:
    instance = ground(f":duration () :effect {text}", durative=True)
    assert instance.continuous_effects == (ContinuousEffect(Fluent("f"), rate),)


@pytest.mark.parametrize(
    ("text", "relation", "sign"),
    [
        ("=", Relation.EQUAL, 1),
        (">=", Relation.AT_LEAST, 1),
        (">", Relation.GREATER, 1),
        ("<=", Relation.AT_LEAST, -1),
        ("<", Relation.GREATER, -1),
    ],
)
def test_durations(text: str, relation: Relation, sign: int) -> None:
    (bound,) = ground(f":duration ({text} ?duration (f))", durative=True).durations
    assert bound.condition == Comparison((DURATION - fluent("f")).scaled(sign), relation)
    assert bound.text == f"({text} ?duration (f))"


def test_division_by_what_may_change() -> None:
    for divisor, culprit in {"(k)": "(k)", "?s": "s", "(+ (k) (g))": "(k)", "(h a)": "(h a)"}.items():
        with pytest.raises(UnsupportedError, match="expected a divisor that no action") as caught:
            effects(f"(assign (f) (/ 1 {divisor}))", init="(= (h a) 2) (at 4 (= (h a) 1))")
        assert f"non-linear because {culprit} may vary" in str(caught.value)
    with pytest.raises(UnsupportedError, match=r"non-linear because \(k\)"):
        effects("(scale-down (f) (k))")
    with pytest.raises(UnsupportedError, match=r"non-linear because \(g\)"):
        effects("(scale-down (f) (g))", parametrized={Fluent("g")})
    assert effects("(assign (f) (/ 1 (h a)))", init="(= (h a) 2) (at 4 (= (h b) 1))").numeric_effects[
        0
    ].expression == number(Fraction(1, 2))


@pytest.mark.parametrize(
    ("effect", "init", "message"),
    [
        ("(assign (f) (/ 1 (- (g) 4)))", "", "found a division by (- (g) 4), which is zero"),
        ("(assign (f) (/ 1 (h a)))", "", "found a division by (h a), expected (= (h a) VALUE) in the problem's :init"),
        ("(and (assign (f) 1) (assign (f) 2))", "", "found an assignment and another change of (f)"),
        ("(and (increase (f) 1) (scale-up (f) 2))", "", "found an assignment and another change of (f)"),
    ],
)
def test_effect_is_refused(effect: str, init: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        effects(effect, init=init)
    assert message in str(caught.value)
    assert str(caught.value).startswith("<domain>:1:")


@pytest.mark.parametrize(
    ("action", "arguments", "durative", "message"),
    [
        (
            "mvoe",
            ["r1", "a", "b"],
            True,
            "found action 'mvoe', expected one of domain 'everything'; did you mean 'move'?",
        ),
        ("move", ["r1", "a"], True, "found 'move' with 2 arguments, expected 3 arguments as in (move ?v ?from ?to)"),
        ("move", ["r1", "a", "c"], True, "found 'c', expected an object of problem 'tour'; known are a, b, hub, r1"),
        ("move", ["a", "a", "b"], True, "found 'a' of type place, expected type robot for ?v of (move ?v ?from ?to)"),
        ("move", ["r1", "a", "b"], False, "found 'move' used as an instantaneous action, expected a durative action"),
        ("toggle", ["a"], True, "expected an instantaneous action as defined at <domain>:10:3"),
    ],
)
def test_instance_is_refused(action: str, arguments: list[str], durative: bool, message: str) -> None:
    with pytest.raises(RobustError) as caught:
        ground_action(EVERYTHING, TOUR, "n0", action, arguments, durative, PLACE)
    assert str(caught.value).startswith("plan.stn:3:1: found ")
    assert message in str(caught.value)
    assert caught.value.exit_code == 2


def test_goal() -> None:
    goal = ground_goal(EVERYTHING, TOUR)
    assert [(part.condition, part.text) for part in goal] == [
        (Holds(Atom("at", ("r1", "b"))), "(at r1 b)"),
        (Comparison(fluent("charge", "r1") - parameter("speed"), Relation.AT_LEAST), "(>= (charge r1) ?speed)"),
    ]
    assert goal[0].label == "goal: (at r1 b)"


def test_initial_state() -> None:
    assert TOUR.atoms == {Atom("at", ("r1", "a")), Atom("linked", ("a", "b"))}
    assert initial_fluents(EVERYTHING, TOUR) == {
        Fluent("charge", ("r1",)): number(Fraction(21, 2)),
        Fluent("drag"): number(2),
        Fluent("total"): number(Fraction(-1, 1000)),
        Fluent("distance", ("a", "b")): number(8),
    }
    assert [literal.time for literal in TOUR.timed_literals] == [5, 6, 7]


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
        (":duration (= ?duration (/ 1 (g)))", ""),
    ],
)
def test_fluents_read(body: str, read: str) -> None:
    assert fluents_read(ground(body, durative=True)) == {Fluent(name) for name in read.split()}


def test_same_action_with_other_identifier_has_other_parameters() -> None:
    body = ":parameters (?x) :synth-parameters (?w) :effect (increase (h ?x) (+ ?w ?s))"
    (effect,) = ground(body).numeric_effects
    assert effect.fluent == Fluent("h", ("a",))
    assert effect.expression == parameter("n1.w") + parameter("s")


@pytest.mark.parametrize("opening", ["(not ", "(and ", "(or (q) ", "(imply (q) ", "(forall (?y) ", "(exists (?y - u) "])
def test_deep_conditions_are_ground(opening: str) -> None:
    levels = 100 if opening != "(forall (?y) " else 5  # three objects: 3⁵ copies
    text = opening * levels + "(p)" + ")" * levels
    for condition, _ in precondition(text):
        assert Holds(P) in (condition, *getattr(condition, "operands", ()))
    assert effects("(when (p) " * 100 + "(q)" + ")" * 100).atom_effects == (
        AtomEffect(Timing.AT_START, Q, value=True, condition=Holds(P)),
    )
