"""A plan that has everything which the checker's reader knows, what it says, other ways to say it, and what is wrong.

What it says is written here by hand, tree by tree, so that nothing which a reader drops, takes for something else or
reads twice goes unseen.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

from tests.certify.texts import Texts
from tests.certify.tools import Checker

DATA = Path(__file__).with_name("data")
TABLES: dict[str, Any] = json.loads((DATA / "elaborate.json").read_text(encoding="utf-8"))
DOMAIN, PROBLEM, PLAN = (
    (DATA / name).read_text(encoding="utf-8") for name in ("domain.pddl", "problem.pddl", "plan.stn")
)
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

WRONG_BESIDE: list[str] = TABLES["beside"]
WRONG_VARIED: dict[str, list[str]] = TABLES["varied"]
"""What is wrong beside the plan, and in it."""

Changes = dict[str, list[str]]
"""Parts of the texts, and what may stand there instead."""

SAME: Changes = TABLES["same"]
"""Other ways to say the same."""

WRONG: Changes = TABLES["wrong"]
"""Each is refused: it means nothing, or something that the checker does not know."""

GUARDS: dict[str, bool] = TABLES["guards"]
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
