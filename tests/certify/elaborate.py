"""A plan that has everything which the checker's reader knows, what it says, other ways to say it, and what is wrong.

What it says is written here by hand, tree by tree, so that nothing which a reader drops, takes for something else or
reads twice goes unseen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from typing import Any

from tests.certify.texts import Texts
from tests.certify.tools import Checker

DOMAIN = """(define (domain Rich) ; Comments (end with the line
 (:requirements :typing :durative-actions :fluents)
 (:types truck ship - vehicle place vehicle - object crate
  - object box - crate)
 (:constants Depot - place)
 (:synth-parameters ?limit)
 (:predicates (at ?v - vehicle ?p - place) (in ?c - crate ?w - (either vehicle place)) (busy) (big ?c) (z)
  (in_place ?c))
 (:functions (fuel ?v - vehicle) (level) (rate) - number (cost) - number (toll ?v - vehicle))
 (:durative-action move
  :parameters (?v - vehicle ?from ?to - place)
  (:synth-parameters ?slack ?more)
  :duration (and (>= ?duration ?slack) (at end (<= ?duration (+ (rate) 2 ?limit))))
  :condition (and
   (at start (at ?v ?from)) (over all (and (not (busy)) (>= (fuel ?v) 0))) (at start (not (= ?from ?to)))
   (forall (?c - crate) (at end (imply (big ?c) (in_vehicle ?c ?v)))))
  :effect (and
   (at start (not (at ?v ?from))) (at end (and (at ?v ?to) (scale-down (level) 2)))
   (decrease (fuel ?v) (* #t (rate))) (increase (cost) (* (+ ?slack (toll ?v)) #t))
   (forall (?c - box) (when (at start (in ?c ?v)) (at start (not (big ?c)))))
   (at end (when (> (- level 1) -3) (forall (?p ?q - place) (when (not (= ?p ?q)) (assign (cost)
     (- (* 2 level ?duration))))))))
 )
 (:action mark
  :parameters (?c - (either box place) ?d)
  :synth-parameters ?much
  :precondition (and (or (busy) (< 1 ?much)) (exists (?v - truck) (in ?c ?v)) () (= ?c ?d))
  :effect (and (when (busy) (decrease level (/ 1 3))) (not (busy)) (scale-up (rate) (+ 3)) ()))
 (:action rest :parameters (?x ?y) :synth-parameters ?z :precondition () :effect (and)))
"""
PROBLEM = """(define (problem one) (:domain RICH) (:requirements :typing)
 (:objects t1 - truck s1 - ship b1 - box c1 - crate hall - place)
 (:init (at t1 depot) (in_vehicle B1 t1) (not (busy)) (= (fuel t1) 5) (= (fuel s1) (- 2)) (= level 1e1) (= (cost) .5)
  (= (rate) +2) (at 4 (not (busy))) (at 2.5 (= (rate) 3)) (at 2.5 (busy)) (at 4 (at t1 hall)) (at 0 (z)) (z)
  (in_place c1) (= (toll t1) 1))
 (:goal (and (at t1 hall) (forall (?c - crate) (or (big ?c) (>= (fuel t1) ?limit)))))
 (:metric minimize (total-time)))
"""
PLAN = """# A plan; of everything.
parameter limit weight 2 default 1/2 lb -inf ub +inf;
parameter k.x default 3 lb 1 ub 5.5;  parameter go-1.slack default 1;
parameter go-1.more lb 0 default 7; parameter m2.much ub inf default -1e0;
durative-action instance go-1 : (MOVE t1 depot Hall);
action instance m2 : (mark b1 b1); # (mark c1 c1)
parameter r.z default 0; action instance r : (rest b1 c1);
c : go-1.start - .zero in [ 0.25 , inf ];
c: go-1.end - go-1.start in [k.x, k.x];
c: m2 - go-1.start in [-inf, k.x]; c: .zero - m2 in [-7/2, +inf];
"""
TEXTS = Texts(DOMAIN, PROBLEM, PLAN)


def _number(value: object) -> tuple[str, Fraction]:
    return "number", Fraction(str(value))


def _all(*parts: Any) -> Any:
    return "and", *parts


DURATION, LEVEL, RATE = ("duration",), ("fluent", "(level)"), ("fluent", "(rate)")
SLACK = ("parameter", "go-1.slack")
BUSY, IN = ("atom", "(busy)"), ("atom", "(in b1 t1)")
DECIDED = _all(True, (">", ("-", LEVEL, _number(1)), _number(-3)))
COST = ("-", ("*", _number(2), LEVEL, DURATION))

SAYS: dict[str, Any] = {
    "points": [".zero", "go-1.start", "go-1.end", "m2", "r", "@0", "@5/2", "@4"],
    "parameters": {
        "limit": (Fraction(1, 2), None, None),
        "k.x": (Fraction(3), Fraction(1), Fraction(11, 2)),
        "go-1.slack": (Fraction(1), None, None),
        "go-1.more": (Fraction(7), Fraction(0), None),
        "m2.much": (Fraction(-1), None, None),
        "r.z": (Fraction(0), None, None),
    },
    "edges": [
        (0, 1, {"": Fraction(1, 4)}),
        (1, 2, {"k.x": Fraction(1)}), (2, 1, {"k.x": Fraction(-1)}),
        (3, 1, {"k.x": Fraction(-1)}),
        (3, 0, {"": Fraction(-7, 2)}),
        (0, 5, {}), (5, 0, {}),
        (0, 6, {"": Fraction(5, 2)}), (6, 0, {"": Fraction(-5, 2)}),
        (0, 7, {"": Fraction(4)}), (7, 0, {"": Fraction(-4)}),
        *((0, point, {}) for point in range(1, 8)),
    ],
    "duties": [
        ((">=", DURATION, _number(0)), 1, None, (1, 2)),
        ((">=", DURATION, SLACK), 1, None, (1, 2)),
        (("<=", DURATION, ("+", RATE, _number(2), ("parameter", "limit"))), 2, None, (1, 2)),
        (("atom", "(at t1 depot)"), 1, None, (1, 2)),
        (("not", BUSY), 1, 2, (1, 2)),
        ((">=", ("fluent", "(fuel t1)"), _number(0)), 1, 2, (1, 2)),
        (("not", False), 1, None, (1, 2)),
        (("or", ("not", ("atom", "(big b1)")), IN), 2, None, (1, 2)),
        (("or", ("not", ("atom", "(big c1)")), ("atom", "(in c1 t1)")), 2, None, (1, 2)),
        (("or", BUSY, ("<", _number(1), ("parameter", "m2.much"))), 3, None, (3, 3)),
        (("or", IN), 3, None, (3, 3)),
        (("atom", "(at t1 hall)"), None, None, None),
        (("or", ("atom", "(big b1)"), (">=", ("fluent", "(fuel t1)"), ("parameter", "limit"))), None, None, None),
        (("or", ("atom", "(big c1)"), (">=", ("fluent", "(fuel t1)"), ("parameter", "limit"))), None, None, None),
    ],
    "effects": {
        0: [],
        1: [
            ("delete", "(at t1 depot)", None, True, (1, 2)),
            ("delete", "(big b1)", None, _all(True, IN), (1, 2)),
        ],
        2: [
            ("add", "(at t1 hall)", None, True, (1, 2)),
            ("assign", "(level)", ("/", LEVEL, _number(2)), True, (1, 2)),
            ("assign", "(cost)", COST, _all(DECIDED, ("not", False)), (1, 2)),
            ("assign", "(cost)", COST, _all(DECIDED, ("not", False)), (1, 2)),
        ],
        3: [
            ("increase", "(level)", ("-", ("/", _number(1), _number(3))), _all(True, BUSY), (3, 3)),
            ("delete", "(busy)", None, True, (3, 3)),
            ("assign", "(rate)", ("*", RATE, ("+", _number(3))), True, (3, 3)),
        ],
        4: [],
        5: [("add", "(z)", ("number", True), True, None)],
        6: [("assign", "(rate)", _number(3), True, None), ("add", "(busy)", ("number", True), True, None)],
        7: [
            ("delete", "(busy)", ("number", False), True, None),
            ("add", "(at t1 hall)", ("number", True), True, None),
        ],
    },
    "flows": [(1, 2, "(fuel t1)", ("-", RATE)), (1, 2, "(cost)", ("+", SLACK, ("fluent", "(toll t1)")))],
    "initial": {
        "(at t1 depot)": True, "(in b1 t1)": True, "(busy)": False, "(z)": True, "(in_place c1)": True,
        "(fuel t1)": Fraction(5), "(fuel s1)": Fraction(-2), "(level)": Fraction(10),
        "(cost)": Fraction(1, 2), "(rate)": Fraction(2), "(toll t1)": Fraction(1),
    },
    "guessed": {"in_vehicle as in"},
    "timed": {5, 6, 7},
}  # fmt: skip

PLAIN = Texts(
    "(define (domain d) (:predicates (p ?x)) (:constants a) (:action b :effect (p a)))",
    "(define (problem x) (:domain d) (:init (at 9 (p a)) (at 1 (p a))) (:goal (exists (?x) (and (p ?x) (= ?x a)))))",
    "action instance i : (b); c: i - .zero in [0, inf];",
)
"""No types and no parameters, one action at one time, and what happens later than what is written after it."""

VARIED = Texts(
    "(define (domain d) (:predicates (p)) (:functions (f)) (:durative-action a :parameters ()"
    " :duration (and (= ?duration (f)) (<= ?duration 9)) :condition () :effect (at end (p))))",
    "(define (problem x) (:domain d) (:init (= (f) 2)) (:goal (p)))",
    "parameter x default 2; parameter y default 3;\n"
    "durative-action instance i : (a); c: i.end - i.start in [x, x]; c: .zero - i.start in [-inf, 0];\n"
    "durative-action instance j : (a); c: j.end - j.start in [2, 2];",
)
BESIDE = '[parameters.x]\nduration = "i"\n[parameters.y]\nfluent = "(f)"\n'
"""A plan with parameters that are written beside it: of how long an action takes, and an initial value."""

OTHERS = (
    "(define (domain d) (:synth-parameters ?s)"
    " (:durative-action a :parameters () :duration (<= ?duration 9) :effect ())"
    " (:durative-action e :parameters () :duration (= ?duration ?s) :effect ()))",
    "(define (problem x) (:domain d) (:init) (:goal (and)))",
    "parameter s default 2; durative-action instance i : (a); c: i.end - i.start in [s, s];"
    " durative-action instance j : (e);",
    '[parameters.s]\nduration = "i"',
)
"""The parameter is how long another action takes, and nothing that the action says."""

WRONG_BESIDE = (
    f"{BESIDE}[other]\na = 1",
    '[parameters.x]\nduration = "j"', '[parameters.x]\nduration = "k"', '[parameters.z]\nduration = "i"',
    '[parameters.z]\nfluent = "(f)"', '[parameters.x]\nfluent = "(g)"', '[parameters.x]\nfluent = "(p)"',
    '[parameters.x]\nfluent = 1', '[parameters.x]\nduration = 1', '[parameters.x]\natom = "(f)"', "[parameters.x]",
    '[parameters.x]\nother = "i"', '[parameters.x]\nduration = "i"\nfluent = "(f)"', "parameters.x = 1",
    'parameters.x = "i"', '[parameters.x]\nduration = "i"\ndefault = 2', '[parameters.y]\nduration = "i"',
    '[parameters.x]\nduration = "i"\n[parameters.y]\nduration = "i"',
    '[parameters.x]\nfluent = "(f)"\n[parameters.y]\nfluent = "(f)"',
)  # fmt: skip
WRONG_VARIED = {
    "[x, x];": [
        "[x, inf];", "[-inf, x];", "[x, x]; c: i.end - i.start in [0, inf];",
        "[x, x]; c: i.start - i.end in [-9, inf];",
        "[x, y];", "[y, x];", "[x, x]; c: i.end - i.start in [x, inf];", "[2, 2];",
    ],
    "(= ?duration (f))": ["(>= ?duration (f))", ""],
}  # fmt: skip
"""What is wrong beside the plan, and in it."""

Changes = dict[str, list[str]]
"""Parts of the texts, and what may stand there instead."""

SAME: Changes = {
    "(define (domain": ["; first (\n(DEFINE (Domain"],
    "(:predicates": ["\n;(:predicates (z))\n(:PREDICATES"],
    "(:functions (fuel ?v - vehicle) (level)": ["(:functions (fuel ?v - vehicle) - number (level)"],
    "(?v - vehicle ?from ?to - place)\n": [
        "(?v - vehicle ?from - place ?to - place)\n", "(?v - (either ship truck) ?from ?to)\n",
    ],
    "(:synth-parameters ?slack ?more)": [":synth-parameters (?slack ?more)", ":synth-parameters ?slack ?more"],
    "(:synth-parameters ?limit)": ["(:synth-parameters (?limit))"],
    "(and (>= ?duration ?slack) (at end (<= ?duration (+ (rate) 2 ?limit))))": [
        "(and (at start (>= ?duration ?slack)) (at end (and (<= ?duration (+ rate 2.0 ?limit)))))",
    ],
    "(+ (rate) 2 ?limit)": ["(+ (rate) 0.2e1 ?limit)"],
    "(<= ?duration (+ (rate) 2 ?limit))": ["(at start (at end (<= ?duration (+ (rate) 2 ?limit))))"],
    "(over all (and (not (busy)) (>= (fuel ?v) 0)))": ["(over all (not (busy))) (and (over all (>= (fuel ?v) 0)))"],
    "(at start (not (= ?from ?to)))": [
        "(at start (forall () (not (= ?from ?to))))", "(at start (not (= ?to ?from)))",
    ],
    "(decrease (fuel ?v) (* #t (rate)))": ["(decrease (fuel ?v) (* rate #t))"],
    "(when (at start (in ?c ?v)) (at start (not (big ?c))))": ["(at start (when (in ?c ?v) (not (big ?c))))"],
    "(at end (and (at ?v ?to) (scale-down (level) 2)))": ["(at end (at ?v ?to)) (at end (scale-down level 2))"],
    "(forall (?p ?q - place) (when": ["(forall (?q ?p - place) (when"],
    "(?c - (either box place) ?d)": ["(?c - (either place box) ?d - object)"],
    "(in_vehicle ?c ?v)": ["(in ?c ?v)"],
    "(or (busy) (< 1 ?much))": ["(or (BUSY) (< +1.0 ?MUCH))"],
    "(:domain RICH) (:requirements :typing)": ["(:domain rich)"],
    "(:objects t1 - truck s1 - ship": ["(:objects s1 - ship t1 - truck"],
    "b1 - box": ["b1 - (either box ship)"],
    "(at t1 depot)": ["(at t1 depot) (at T1 DEPOT)"],
    "(= level 1e1)": ["(= (level) 10)", "(= (level) (- -10)) (= level 10)"],
    "(at 4 (at t1 hall))": ["(at 4.0 (at t1 hall)) (at 4 (at t1 hall))"],
    "(at 2.5 (= (rate) 3))": ["(at 2.5 (= rate 3))"],
    "(:metric minimize (total-time))": ["", "(:metric minimize (total-time)) (:length (:serial 3))"],
    "place vehicle - object crate\n": [
        "place - object crate\n", "object place vehicle - object crate\n",
    ],
    "crate\n  - object box - crate": ["box - crate"],
    "# A plan; of everything.": ["#"],
    "parameter limit weight 2 default 1/2 lb -inf ub +inf;": [
        "parameter limit default 0.5;", "parameter limit lb -inf default 2/4 weight 1;",
    ],
    "go-1.start - .zero in [ 0.25 , inf ]": ["go-1.start-.zero in[1/4,+inf]"],
    "c: go-1.end - go-1.start in [k.x, k.x];": [
        "c: go-1.end - go-1.start in [k.x, inf]; c: go-1.end\n-\tgo-1.start in [-inf, k.x]\n;",
    ],
    "c: .zero - m2 in [-7/2, +inf];\n": ["c: .zero - m2 in [-3.5, inf];"],
    "c: .zero - m2 in [-7/2, +inf];": [
        "c: m2 - .zero in [-inf, 7/2];", "c: .zero - m2 in [-7/2, +inf]; c: m2 - .zero in [-inf, inf];",
    ],
    "(MOVE t1 depot Hall)": ["(  move T1\n DEPOT hall )"],
}  # fmt: skip
"""Other ways to say the same."""

WRONG: Changes = {
    "c: .zero - m2 in [-7/2, +inf];": ["c: .zero - m2 in [-7/2, +inf]; c: m2 - m2 in [1, inf];"],
    "(:domain RICH) (:requirements :typing)": [
        "(:domain RICH) (:requirements :typing :magic)",
        "(:domain RICH) (:requirements :typing) (:requirements :typing)",
    ],
    "(:objects t1 - truck": [
        "(:objects t1 -truck", "(:objects ?y - truck t1 - truck", "(:objects 5 - truck t1 - truck",
        "(:objects t1 - ship t1 - truck",
    ],
    "(define (domain Rich)": [
        "(define (domain Rich))", "(define", "(define domain", "(define (domain)", "(define (domain Rich x)",
        "(define (domain poor)", "(defined (domain Rich)",
    ],
    "(:domain RICH)": [")(:domain RICH)", "(:domain RICH x)", ""],
    "(:metric minimize (total-time)))": [
        "(:metric minimize (total-time))", "(:metric minimize (total-time))) x", "(:metric minimize (total-time))) (x",
        "(:metric minimize (total-time))) (define (problem one) (:domain rich))",
    ],
    "(define (problem one)": ["(define (problem)", "(define (domain Rich)", "((problem one)"],
    "(:metric": ["() (:metric", "((:metric)) (:metric", ":metric", "(:constraints (sometime (busy))) (:metric"],
    "(:constants": ["(:axioms)\n (:constants"],
    "(:constants Depot - place)": [
        "(:constants Depot - place) (:goal (and))", "(:constants Depot - place) (:init)",
        "(:constants Depot - place) (:constants Depot - place)"],
    "(:metric minimize (total-time))": [
        "(:metric minimise (total-time))", "(:metric minimize (toll))", "(:metric minimize)",
        "(:init (busy))", "(:goal (and))", "(:domain rich)", "(:constants hall)"],
    "(:synth-parameters ?limit)": [
        "(:synth-parameters ?limit ?limit)", "(:synth-parameters ?limit - object)",
        "(:synth-parameters ?limit) (:synth-parameters ?limit)", "(:synth-parameters (?limit) ?x)",
        "(:synth-parameters limit ?limit)",
    ],
    "(:goal (and (at t1 hall)": ["(:goal (and (busy)) (and (at t1 hall)"],
    "(:goal (and": ["(:goal) (:goals (and"],
    "(:init": ["(:start", "(:length"],
    "(:goal": ["(:length"],
    "object box - crate": [
        "object box - crate truck - truck", "object box - crate vehicle - truck",
        "object box - crate object - crate", "object box -", "object box - (crate)", "object box - (either)",
        "object box - (or crate)",
        "object box - (either crate (crate))", "object box - (either (either crate))", "object (box) - crate",
    ],
    "(:types truck": ["(:types - truck"],
    "Depot - place": ["Depot - town", "Depot - (either place town)"],
    "(busy) (big ?c)": [
        "(busy) (busy) (big ?c)", "(busy) (level) (big ?c)", "busy (big ?c)", "(busy) () (big ?c)",
        "(busy) ((x)) (big ?c)",
    ],
    "(level) (rate) - number": [
        "(level) (5) (rate) - number", "(level) (?duration) (rate) - number", "(level) (rate) number",
        "(level) (rate) - object", "(level) (level) (rate)", "level (rate)", "f (level) (rate) - number",
        "(level) (rate) - num ber", "(level) (rate) (busy)",
    ],
    "(:action mark": [
        "(:action mar\u212a", "(:action idle :effect (zz))\n (:action mark",
        "(:action idle :precondition (at depot depot))\n (:action mark",
        "(:action idle :effect (in c1 depot))\n (:action mark",
        "(:action move", "(:action", "(:action (mark)", "(:action mark mark", "(:action) (:action mark",
        "(:action mark :effect ()) (:action mark",
        "(:durative-action mark", "(:event mark",
    ],
    "(:durative-action move": ["(:action move"],
    "(?x ?y)": [
        "(x ?y)", "(?x y)", "(?x ?x)", "(?z ?y)", "(?limit ?y)", "(?duration ?y)", "?", "?xy", "(- box ?x ?y)",
        "(?x ?y) (?x ?y)", "(?x ?y -)", "(?x ?y - town)",
    ],
    ":synth-parameters ?z": [":synth-parameters ?z ?z", ":synth-parameters (?z) ?limit", ":synth-parameters z"],
    ":precondition ()": [":precondition z", ":precondition (z) (z)", ":precondition ((z))", ":precondition"],
    ":effect (and)))": [":effect z))", ":effect (when (z) z)))", ":effect (not z)))", ":effect (forall ? (z))))"],
    "  :duration (and (>= ?duration ?slack) (at end (<= ?duration (+ (rate) 2 ?limit))))\n": [""],
    "  :precondition": [
        "  :condition", "  :duration () :precondition", "  :precondition (busy) :precondition",
        "  :precondition (busy)", "  :precondition busy :effects", "  :vars (?z) :precondition",
    ],
    "  :parameters (?c - (either box place) ?d)": [
        "  :parameters (?c - (either box place) d)", "  :parameters (?c - (either box place) ?c)",
        "  :parameters ?c ?d", "  :parameters",
    ],
    "  :synth-parameters ?much": [
        "  :synth-parameters ?much ?much", "  :synth-parameters ?much ?d", "  :synth-parameters ?much much",
        "  :synth-parameters ?much ?limit", "  :synth-parameters ?much :synth-parameters ?much",
    ],
    "(:synth-parameters ?slack ?more)": [
        "(:synth-parameters ?slack ?more) (:synth-parameters ?slack ?more)",
        "(:synth-parameters ?slack ?more ?duration)", "(:synth-parameters ?slack ?more (?less))",
    ],
    "(?v - vehicle ?from ?to - place)\n": ["(?duration - vehicle ?from ?to - place)\n"],
    ":duration (and": [":durations (and"],
    "  :duration (and (>= ?duration ?slack)": ["  :duration (>= ?duration ?slack) (and"],
    "(>= ?duration ?slack)": [
        "(forall () (>= ?duration ?slack))",
        "(at middle (>= ?duration ?slack))", "(at start)",
        "(>= ?slack ?duration)", "(>= ?duration)", "(>= ?duration ?slack 1)", "(not (< ?duration ?slack))",
        "(/= ?duration ?slack)", "?slack", "(over all (>= ?duration ?slack))", "(>= ?duration 1/2)",
        "(at start (>= ?duration ?slack) (busy))", "(or (busy))", "(>= ?duration ?v)", "(>= ?duration ?fast)",
    ],
    "(at start (at ?v ?from))": [
        "(at start (at ?from ?v))", "(at start (at \u017f1 ?from))",
        "(at ?v ?from)", "(over start (at ?v ?from))", "(at all (at ?v ?from))", "(at start (at ?v ?from) (busy))",
        "(at start)", "(at start busy)", "(at (start) (at ?v ?from))", "(or (at start (busy)))",
        "(at start (at end (at ?v ?from)))", "(at start (at ?v))", "(at start (at ?v ?from ?to))",
        "(at start (at ?v (from)))", "(at start (at ?v ?slack))", "(at start (at ?v oz))",
        "(at start (in_box ?v ?from))", "(at start (>= level))", "(at start (>= level 1 1))", "(at start (= ?v))",
        "(at start (= ?v ?v ?v))", "(at start (= ?v 1))", "(at start (not))", "(at start (not (busy) (busy)))",
        "(at start (imply (busy)))", "(at start level)", "(at start (imply (busy) (busy) (busy)))",
        "(at start (level))", "(at start (forall (?z)))", "(at start ((busy)))",
        "(at start (forall (?z) (busy) (busy)))", "(at start (when (busy) (busy)))", "(at start (exists (?z)))",
        "(at start (exists ?z (busy)))", "(at start (exists ? (busy)))", "(at start (< ?v ?v))",
        "(at start (exists (?z ?z) (busy)))", "(at start (exists (?z - town) (busy)))",
        "(at start (exists (?z - (either place town)) (busy)))", "(at start (exists (z) (busy)))",
        "(at start (exists (?duration) (busy)))", "(at start (exists (?slack) (busy)))",
        "(at start (exists (?limit) (busy)))",
    ],
    "(forall (?c - crate) (at end (imply": [
        "(forall (?c - crate) (busy) (at end (imply", "(exists (?c - crate) (at end (imply",
    ],
    "(+ (rate) 2 ?limit)": [
        "(/ 2 0)", "(/ 2 (rate))", "(/ 2 ?limit)",
        "(+)", "(-)", "(- 1 2 3)", "(/ 4)", "(/ 4 2 2)", "(*)", "()", "(^ 2 2)", "1e", "(fuel)", "fuel", "(fuel ?v ?v)",
        "(busy)", "((rate))", "(+ 1 ?to)", "nan", "1_0", "0x1", "1e1000", ".", "+-1", "3/2", "#t", "(fuel (rate))",
    ],
    "(< 1 ?much)": ["(< 1 ?duration)"],
    "(at start (not (at ?v ?from)))": [
        "(not (at ?v ?from))", "(over all (busy))", "(over start (busy))",
        "(at start (at start (busy)))", "(at start busy)",
        "(at end (at start (busy)))", "(at start (busy) (busy))", "(at start (not (not (busy))))", "(at start (not))",
        "(at start (not (busy) (busy)))", "(at start (or (busy)))", "(at start (level))", "(at start (assign (level)))",
        "(at start (assign (level) 1 2))", "(at start (assign (busy) 1))", "(at start (assign ?v 1))",
        "(at start (increase (level) (* #t 1)))", "(at start (exists (?z) (busy)))", "(at start (forall (?z)))",
        "(at start (forall (?z) (busy) (busy)))", "(increase (level) 1)", "(at start (when (busy)))",
        "(at start (when (busy) (busy) (busy)))", "(when (busy) (at start (busy)))", "(when (at start (busy)) (busy))",
        "(when (at start (busy)) (at end (busy)))", "(when (over all (busy)) (over all (busy)))",
        "(when (over start (busy)) (over start (busy)))", "(when (at middle (busy)) (at middle (busy)))",
        "(when (at start (busy)) (increase (level) (* #t 1)))", "(when (at start (busy) (busy)) (at start (busy)))",
        "(when (at start (busy)) (at start (busy) (busy)))", "(when (at start (busy)) (and (at start (busy))))",
        "(when (at start) (at start (busy)))", "(preference x (at start (busy)))",
    ],
    "(decrease (fuel ?v) (* #t (rate)))": [
        "(assign (fuel ?v) (* #t (rate)))", "(scale-up (fuel ?v) (* #t (rate)))", "(decrease (fuel ?v) (+ #t (rate)))",
        "(decrease (fuel ?v) (* #t #t))", "(decrease (fuel ?v) (* (rate) (rate)))", "(decrease (fuel ?v) (* #t))",
        "(decrease (fuel ?v))", "(decrease)", "(decrease (fuel ?v) *#t)",
        "(when (decrease (fuel ?v) (busy)) (decrease (fuel ?v) (* #t 1)))",
        "(decrease (fuel ?v) (* #t (rate) (rate)))", "(decrease (fuel ?v) #t)", "(decrease (fuel ?v) (* #t ?duration))",
        "(decrease (fuel ?v) (* #t (* #t 1)))", "(decrease (fuel ?v) (* #t (rate)) 1)",
        "(decrease (busy) (* #t (rate)))",
    ],
    "(decrease level (/ 1 3))": ["(decrease level ?duration)"],
    "(not (busy)) (scale-up": ["(at end (not (busy))) (scale-up"],
    "(at 2.5 (busy))": [
        "(at (- -2.5) (busy))",
        "(at -1 (busy))", "(at (- 1) (busy))", "(at 2.5 busy)", "(at 2.5 (busy) (busy))", "(at 2.5)",
        "(at soon (busy))", "(at 2.5 (busy)) (at 2.5 (not (busy)))", "(at 2.5 (at 3 (busy)))", "(at 2.5 (= (rate) 4))",
        "(at 2.5 (or (busy)))",
    ],
    "(not (busy)) (=": ["(not (busy)) (busy) (="],
    "(= (cost) .5)": [
        "(= (cost) .5) (= (cost) 0.6)", "(= (cost))", "(= (cost) .5 1)", "(= (cost) (+ 1 2))", "(= (cost) (- 1 2))",
        "(= (cost) (level))", "(= (cost) inf)", "(= (cost) 1/0)", "(= (cost) (-))", "(= busy 1)", "(= (cost t1) 1)",
        "(> (cost) 1)", "(busy t1)", "busy", "()", "(not)", "(not (busy) (busy))", "(not (not (busy)))", "(and (busy))",
        "(at t1 ?v)", "((busy))", "(not z)", "(= (cost) (+ 1))", "(at_vehicle s1 hall)",
        "(at (+ 1) (z))", "(= (fuel oz) 1)",
    ],
    "parameter limit weight 2": [
        "parameter limit weight 0", "parameter limit weight two",
        "parameter limit weight", "parameter limit weight 2 weight 2", "parameter limit wait 2",
        "parameter limited weight 2", "parameter weight 2",
    ],
    "default 1/2 lb": ["default 1/0 lb", "default inf lb"],
    "lb -inf ub +inf": [
        "lb 3 ub +inf", "lb -inf ub 0", "lb +-inf ub 1",
        "lb inf ub +inf", "lb -inf ub -inf", "lb -inf ub top", "lb low ub +inf"],
    "parameter k.x default": ["parameter k.x default 3; parameter k.x default"],
    "# A plan; of everything.": [
        "parameter unused default 1;",
        "A plan; of everything.", ";", "parameter K default 1; parameter K default 1;"],
    "instance go-1 :": ["instance go--1 :", "instance go-1"],
    "instance m2 :": [
        "instance go-1 : (mark b1 b1); action instance m2 :",
        "instance go-1 :"],
    "durative-action instance go-1": ["durative-action go-1", "action instance go-1", "instance go-1"],
    "action instance m2": ["durative-action instance m2"],
    "action instance r": ["durative-action instance r"],
    "action instance m2 : (mark b1 b1);": ["action instance m2 : (mark b1 b1); action instance m2 : (mark b1 b1);"],
    "(MOVE t1 depot Hall)": [
        "(MOVE t1 depot)", "(MOVE t1 depot Hall Hall)", "()", "(go t1 depot Hall)", "(MOVE b1 depot Hall)",
        "(MOVE t1 depot oz)", "(MOVE t1 depot b1)", "(MOVE t1 (depot) Hall)",
    ],
    "(mark b1 b1)": ["(mark c1 b1)"],
    "c : go-1.start - .zero": [
        "c : go-1.begin - .zero", "c : go-1 - .zero", "c : go-1.start - zero", "c : go-1.start - @4", "c : go-1.start",
        "c : go-1.start + .zero", "c : m2.start - .zero",
    ],
    "[ 0.25 , inf ]": [
        "[ 0.25 , 0.2 ]",
        "[inf, inf]", "[+inf, inf]", "[-inf, -inf]", "[0.25]", "0.25, inf", "[0.25, inf] and", "[0.25, y]", "[y, inf]",
        "[0.25, 1/0]", "[0,25, inf]",
    ],
    "[-inf, k.x]; c: .zero": ["[-inf, k.x] c: .zero", "[-inf, k.x];; c: .zero"],
}  # fmt: skip
"""Each is refused: it means nothing, or something that the checker does not know."""

GUARDS = {
    "(busy)": True, "(not (busy))": True, "(= ?c ?d)": True, "(= ?c depot)": False, "(not (= ?c ?d))": False,
    "(and (busy) (= ?c depot))": False, "(or (busy) (= ?c depot))": True, "(or (= ?c depot) (= ?d depot))": False,
    "(or)": False, "(and)": True, "(not (and))": False, "(not (or))": True, "(not (or (busy) (= ?c ?d)))": False,
    "(not (and (busy) (= ?c depot)))": True, "(not (or (busy) (= ?c depot)))": True, "(not (not (= ?c depot)))": False,
    "(imply (= ?c ?d) (= ?c depot))": False, "(imply (= ?c depot) (= ?c depot))": True,
    "(exists (?q - ship) (= ?q ?c))": False, "(forall (?q - box) (= ?q ?c))": True, "(= (level) (rate))": True,
    "(and (not (busy)) (or (z) (= ?c depot)))": True, "(and (= ?c ?d) (or))": False, "(or (= ?c ?d) (busy))": True,
}  # fmt: skip
"""Conditions of an effect, and whether it may happen, by what they say of objects."""

RESERVED = """and or not imply forall exists when preference increase decrease assign scale-up scale-down either"""
PARAMETERS = "inf INF infinity Infinity nan NaN zero Zero 1k k. k- -k limit"
"""What no predicate, and what no parameter may be called."""


def texts_with(old: str, new: str) -> Texts:
    """The texts, where the one place that says `old` says `new`."""
    assert sum(text.count(old) for text in TEXTS) == 1, old
    return Texts(*(text.replace(old, new) for text in TEXTS))


def same_texts() -> Iterator[Texts]:
    return (texts_with(old, new) for old, every in SAME.items() for new in every)


def wrong_texts() -> Iterator[Texts]:
    yield from (texts_with(old, new) for old, every in WRONG.items() for new in every)
    yield from (texts_with("(busy) (big ?c)", f"(busy) (big ?c) ({name} ?x)") for name in RESERVED.split())
    yield from (texts_with("# A plan", f"parameter {name} default 1; #") for name in PARAMETERS.split())
    yield from (Texts(domain, PROBLEM, PLAN) for domain in ("", "()", "x", "define", "(define)", "(define x)"))
    swapped = PROBLEM.replace("(problem one)", "(domain rich)")
    yield Texts(DOMAIN.replace("(domain Rich)", "(problem one)"), swapped, PLAN)
    unlisted = PLAIN.domain.replace("(:action b", "(:action b :parameters ?")
    yield Texts(unlisted, PLAIN.problem, PLAIN.plan.replace("(b)", "(b a)"))
    yield Texts(PLAIN.domain, PLAIN.problem, "")
    yield Texts(PLAIN.domain, PLAIN.problem, "parameter k default 1;")


def said(ground: Any) -> dict[str, Any]:
    """What the checker has read, as `SAYS` writes it."""
    return {
        "points": ground.points,
        "parameters": {name: (one.nominal, one.lower, one.upper) for name, one in ground.parameters.items()},
        "edges": ground.edges,
        "duties": [(duty.condition, duty.first, duty.last, duty.owner) for duty in ground.duties],
        "effects": {
            point: [(each.kind, each.target, each.amount, each.when, each.owner) for each in effects]
            for point, effects in enumerate(ground.effects)
        },
        "flows": ground.flows,
        "initial": ground.model.initial,
        "guessed": ground.model.guessed,
        "timed": ground.timed,
    }


def unordered(value: Any) -> Any:
    """The same, where lists have neither an order nor anything twice."""
    if isinstance(value, dict):
        return {name: unordered(each) for name, each in value.items()}
    return {repr(each) for each in value} if isinstance(value, list | set) else value


def probes() -> Iterator[tuple[str, Callable[[Checker], bool]]]:
    """What a reader has to get right."""
    yield "texts elaborate", _says
    yield "texts plain", _says_plainly
    for guard, known in GUARDS.items():
        texts = texts_with("(when (busy) (decrease", f"(when {guard} (decrease")
        yield f"texts guard {guard}", partial(_may_happen, texts=texts, known=known)
    yield "texts beside", _says_beside
    yield "texts beside another action", partial(refuses, texts=OTHERS)
    for number, beside in enumerate(WRONG_BESIDE):
        yield f"texts wrong beside {number}", partial(refuses, texts=[*VARIED, beside])
    for old, every in WRONG_VARIED.items():
        for new in every:
            yield f"texts varied {new}", partial(refuses, texts=[text.replace(old, new) for text in (*VARIED, BESIDE)])
    for number, texts in enumerate(same_texts()):
        yield f"texts same {number}", partial(_says_the_same, texts=texts)
    for number, texts in enumerate(wrong_texts()):
        yield f"texts wrong {number}", partial(refuses, texts=texts)


def _says(by: Checker) -> bool:
    return said(by.reader.ground(*TEXTS)) == SAYS


def _says_plainly(by: Checker) -> bool:
    ground = by.reader.ground(*PLAIN)
    unknown = by.reader.ground(*PLAIN[:2], f"parameter k lb 0; {PLAIN.plan} c: i - .zero in [k, inf];")
    late = [("add", "(p a)", ("number", True), True, None)]
    one, nine = Fraction(1), Fraction(9)
    timed = [(0, 2, {"": one}), (2, 0, {"": -one}), (0, 3, {"": nine}), (3, 0, {"": -nine})]
    return bool(
        said(ground)["effects"] == {0: [], 1: [("add", "(p a)", None, True, (1, 1))], 2: late, 3: late}
        and [(each.label, each.condition) for each in ground.duties]
        == [("goal 1", ("or", ("and", ("atom", "(p a)"), True)))]
        and ground.points == [".zero", "i", "@1", "@9"]
        and ground.edges == [(0, 1, {}), *timed, (0, 1, {}), (0, 2, {}), (0, 3, {})]
        and said(unknown)["parameters"] == {"k": (None, Fraction(0), None)}
    )


def _says_beside(by: Checker) -> bool:
    ground = by.reader.ground(*VARIED, BESIDE)
    plain = by.reader.ground(*VARIED[:2], VARIED.plan.replace("parameter y default 3;", ""))
    durations: list[Any] = [duty.condition for duty in ground.duties if duty.label.endswith(": duration")]
    others = [duty.condition for duty in plain.duties if duty.label.endswith(": duration")]
    read, most = ("=", DURATION, ("fluent", "(f)")), ("<=", DURATION, _number(9))
    return bool(
        ground.varied == {("duration", "i"): "x", ("fluent", "(f)"): "y"}
        and durations == [("=", DURATION, ("parameter", "x")), most, read, most]
        and (plain.varied, others) == ({}, [read, most, read, most])
    )


def _may_happen(by: Checker, texts: Texts, known: bool) -> bool:
    ground = by.reader.ground(*texts)
    return any(effect.kind == "increase" for effect in ground.effects[3]) == known


def _says_the_same(by: Checker, texts: Texts) -> bool:
    return bool(unordered(said(by.reader.ground(*texts))) == unordered(SAYS))


def refuses(by: Checker, texts: Sequence[str]) -> bool:
    """Whether nothing is proved about what the texts say."""
    try:
        by.reader.ground(*texts)
    except by.reader.Unsupported:
        return True
    return False
