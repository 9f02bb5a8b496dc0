"""Certificates that somebody made up with care: each is rejected for one reason only.

Each class is what would be believed if one of the checker's demands were missing or weaker. The plans are as small as
that takes: an action whose duration is the parameter k, and what the network says besides.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tests.certify.texts import Texts

Line = list[Any]
FORMAT = "robust/certificate/2"
ABSURD: Line = ["refute", [[], [0, [1, 0]]]]
"""Of a literal that is false."""
NOT_NEGATIVE: Line = ["refute", [[2], [1], [[0, 1]]], [[], [0, 1]]]
"""Of k < 0, by the first fact, k >= 0."""


def lasting_k(bounds: str, *constraints: str) -> Texts:
    """One action that takes k."""
    lines = [f"parameter k default 5 {bounds};", "durative-action instance i : (d);", *constraints]
    return Texts(
        "(define (domain d) (:durative-action d :parameters () :duration () :condition () :effect ()))",
        "(define (problem x) (:domain d) (:init) (:goal (and)))",
        "\n".join([*lines, "c: i.end - i.start in [k, k];"]),
    )


PLAIN = lasting_k("lb 0 ub 9")
LONGER = lasting_k("lb 0 ub 9", "c: i.end - i.start in [3, inf];")
"""The envelope is k >= 3; the first constraint says k - 3 >= 0 without any time."""
GUESSED = Texts(
    "(define (domain d) (:types t u) (:predicates (in ?x - (either t u))) (:action d :parameters () :effect ()))",
    "(define (problem x) (:domain d) (:objects a - t) (:init (in_t a)) (:goal (in_t a)))",
    "action instance i : (d);",
)
"""A predicate that is not declared, and no parameters."""
NEGATIVE = lasting_k("lb -5 ub 9")
"""The envelope is k >= 0: the duration must not be negative."""


def both(bound: str, duration: str = "()") -> Texts:
    """Two actions, of k and m; the network says that k is at least 3, and m at least the bound."""
    return Texts(
        LONGER.domain.replace(":duration ()", f":duration {duration}"),
        LONGER.problem,
        "parameter k default 5 lb -5 ub 9; parameter m default 5 lb -5 ub 9;\n"
        "durative-action instance i : (d); c: i.end - i.start in [3, inf]; c: i.end - i.start in [k, k];\n"
        f"durative-action instance j : (d); c: j.end - j.start in [{bound}, inf]; c: j.end - j.start in [m, m];",
    )


def maximal(low: str, bound: str, *faces: Line) -> list[Line]:
    """That [low, 9] x [bound, 9] is maximal."""
    return [
        [FORMAT, "maximal", [[low, True, "9", True], [bound, True, "9", True]]],
        ["orders"],
        ["schedule", [], []],
        ["kept", [[0, 1]], [], [], [[2, 1]], [], [], [], [[0, 1]], [], [[2, 1]]],
        NOT_NEGATIVE,
        ["refute", [[3], [1], [[2, 1]]], [[], [0, 1]]],
        *faces,
        ["face", [low, bound], [low, str(int(bound) - 1)]],
        ["cycle", [3, 5], [[0, 1]]],
    ]


def open_face(beside: str) -> tuple[Texts, list[Line]]:
    """That [5, 9] x (3, 9] is maximal, where durations have to be more than 3; bad values have m = 3."""
    texts = both("1", "(> ?duration 3)")
    reached = [[], [["", "5"], ["~", "-1"]], [], [["", "3"]]]
    proofs: list[Any] = [[[1, 1]], [], [], [], [], [], [], [[1, 1]], [], []]
    refuted = [["refute", [[each], [1], [[fact, 1]]], [[], [0, 1]]] for each, fact in ((2, 0), (3, 0), (4, 2), (5, 2))]
    return texts, [
        [FORMAT, "maximal", [["5", True, "9", True], ["3", False, "9", True]]],
        ["orders"],
        ["schedule", [], []],
        ["kept", [[0, 1]], [], [], [[2, 1]], [], [], [], [[0, 1]], [], [[2, 1]]],
        *refuted,
        ["face", ["5", beside], ["4", beside]],
        ["broken", 3, reached, proofs, None],
        ABSURD,
        ["face", ["5", "3"], ["5", "3"]],
        ["broken", 3, [[], [["", "5"]], [], [["", "3"]]], [[]] * 10, None],
        ABSURD,
    ]


def over(low: str, high: str, closed: bool = True) -> Line:
    return [FORMAT, "box", [[low, closed, high, closed]]]


def at_least(value: int, sign: int = 1, strict: bool = False) -> list[Any]:
    """k >= value, or its like, as the side of a polyhedron."""
    return [[["k", str(sign)], ["", str(-sign * value)]], strict]


def honest() -> Iterator[tuple[str, Texts, list[Line]]]:
    """What the forgeries are made of is accepted where it is true."""
    yield "box", PLAIN, [over("0", "9"), ["orders"], ["schedule", []], ["kept", [], [], [], [[0, 1]]], NOT_NEGATIVE]
    yield (
        "region",
        LONGER,
        [
            [FORMAT, "region", None],
            ["bad", [at_least(3, -1, strict=True)]],
            ["cycle", [0, 2], [[0, 1]]],
            *after_bad(),
        ],
    )

    once: Line = [FORMAT, "plan", None]
    yield "plan without parameters", GUESSED, [once, ["orders"], ["schedule", []], ["kept", []]]
    yield "maximal", both("3"), maximal("3", "3", ["face", ["3", "3"], ["2", "3"]], ["cycle", [0, 2], [[0, 1]]])


def after_bad() -> list[Line]:
    """All other values of k are good: k is at least 3 by the third fact."""
    kept: Line = ["kept", [[2, 1]], [], [], [], [[0, 1]]]
    return [["good"], ["orders"], NOT_NEGATIVE, ["piece", []], ["schedule", []], kept, ["rest"], ABSURD]


def made_up() -> Iterator[tuple[str, Texts, list[Line]]]:
    """None is accepted."""
    start: list[Line] = [over("0", "9"), ["orders"], ["schedule", []]]
    yield (
        "the network is kept because the network says so",
        LONGER,
        [*start, ["kept", [[2, 1]], [], [], [], [[0, 1]]], NOT_NEGATIVE],
    )
    piece: list[Line] = [
        ["piece", [at_least(3)]], ["schedule", []], ["kept", [[0, 1]], [], [], [], [[1, 1]]], ["rest"],
    ]  # fmt: skip
    yield (
        "values without a schedule are in a piece because the network says so",
        LONGER,
        [
            [FORMAT, "region", None], ["good"], ["orders"], NOT_NEGATIVE, *piece,
            ["refute", [[3], [1], [[2, 1]]], [[], [0, 1]]],
        ],
    )  # fmt: skip
    yield (
        "a circle of length zero has no times",
        LONGER,
        [
            [FORMAT, "region", None],
            ["bad", [at_least(3, -1)]],
            ["cycle", [0, 2], [[0, 1]]],
            *after_bad(),
        ],
    )
    either = [["piece", [[[["z", "1"]], False]]], ["piece", [[[["z", "-1"]], True]]]]
    kept: Line = ["kept", [], [], [], [[1, 1]]]
    yield (
        "pieces of something that is no parameter",
        PLAIN,
        [
            [FORMAT, "region", None], ["good"], ["orders"], NOT_NEGATIVE,
            *(each for one in either for each in (one, ["schedule", []], kept)), ["rest"], ABSURD,
        ],
    )  # fmt: skip
    yield (
        "a coefficient of zero",
        PLAIN,
        [over("0", "9"), ["orders"], ["schedule", [["", "0"]]], ["kept", [], [], [], [[0, 1]]], NOT_NEGATIVE],
    )
    for name, limit, beyond in (
        ("beside the box in another direction", ["5", "1"], ["4", "1"]),
        ("far from the face", ["3", "3"], ["2", "3"]),
        ("away from the face", ["5", "1"], ["6", "1"]),
        ("on the face", ["5", "1"], ["5", "1"]),
    ):
        wrong = [
            ["face", limit, beyond],
            ["cycle", [3, 5] if limit[1] == "1" else [0, 2], [] if limit[1] == "1" else [[0, 1]]],
        ]
        yield f"bad values {name}", both("3"), maximal("5", "3", *wrong)
    below: list[Line] = [["face", ["5", "-1"], ["4", "-1"]], ["cycle", [3, 5], []]]
    yield "bad values below zero", both("0"), maximal("5", "0", *below)
    yield "bad values on an open face in another direction", *open_face("3")
    yield "closed by a number", PLAIN, [
        [FORMAT, "box", [["0", 1, "9", 1]]], ["orders"], ["schedule", []], ["kept", [], [], [], [[0, 1]]], NOT_NEGATIVE,
    ]  # fmt: skip
    nowhere: list[Line] = [["face", ["5", "3"], ["4", "3"]], ["cycle", [1, 2], [[0, 1], [1, 1]]]]
    yield "bad values on no segment", both("3"), maximal("5", "3", *nowhere)
    inwards: list[Line] = [["face", ["5", "1"], ["11/2", "1"]], ["cycle", [3, 5], []]]
    yield "bad values inwards", both("3"), maximal("5", "3", *inwards)
    empty = [[["", "-1"]], False]
    for piece_of, root in (([empty], 1), ([at_least(3, -1, strict=True), empty], 2)):
        refuted: Line = ["refute", [[root + 1], [1], [[0, 1]]], [[], [0, root]]]
        rest: list[Line] = [["piece", []], ["schedule", []], ["kept", [], [], [], [[0, 1]]], ["rest"], ABSURD]
        lines: list[Line] = [[FORMAT, "region", None], ["bad", piece_of], ["cycle", [0, 1], [[root - 1, 1]]]]
        yield "a side without parameters", PLAIN, [*lines, ["good"], ["orders"], refuted, *rest]
    yield (
        "between good and bad values there is one that is neither",
        Texts(PLAIN.domain.replace(":duration ()", ":duration (> ?duration 3)"), PLAIN.problem, PLAIN.plan),
        [
            [FORMAT, "region", None],
            ["bad", [at_least(3, -1, strict=True)]],
            ["broken", 1, [[], [["k", "1"]]], [[], [], [], [[1, 1]]], None],
            ["refute", [[-2], [1], [[0, 1]]], [[], [0, 1]]],
            ["good"], ["orders"], NOT_NEGATIVE,
            ["refute", [[3], [1], [[2, 1]]], [[], [0, 1]]],
            ["piece", []], ["schedule", []], ["kept", [], [], [], [[0, 1]]], ["rest"], ABSURD,
        ],
    )  # fmt: skip
    yield from refutations()
    yield from order_lemmas()


def refutations() -> Iterator[tuple[str, Texts, list[Line]]]:
    """That the duration is not negative, although it may be."""
    false: dict[str, list[Any]] = {
        "a literal that counts for nothing": [[[2], [0], []], [[], [0, 1]]],
        "a gate that is none, twice": [[[], [[0, 0], [0, 0]]]],
        "a gate that is none, after another hint": [[[], [0, [0, 0], [0, 0]]]],
        "a negative multiple": [[[2], [1], [[1, -1]]], [[], [0, 1]]],
        "negative multiples as texts": [[[2], [1], [[1, "-1/2"], [1, "-1/2"]]], [[], [0, 1]]],
        "no multiple of a strict fact": [[[], [], [[0, 0]]]],
        "a constraint that is kept exactly is strict": [[[], [], [[2, 1]]]],
        "a literal for nothing": [[[2], [], []], [[], [0, 1]]],
        "a literal that is not there": [[[9], [1], []], [[], [0, 1]]],
        "no step": [],
        "no conflict": [[[], [0, 0]]],
        "a hint before the first": [[[], [-1]]],
        "a clause for nothing": [[[2], []], [[], [0, 1]]],
        "a multiple that leaves k": [[[2], [1], []], [[], [0, 1]]],
        "a lemma with a remark": [[[2], [1], [[0, 1]], 0], [[], [0, 1]]],
    }
    for name, steps in false.items():
        for closed in (True, False):
            start: list[Line] = [over("-5", "9", closed), ["orders"], ["schedule", [["", "5"]]]]
            yield name, NEGATIVE, [*start, ["kept", [], [], [], [[0, 1]]], ["refute", *steps]]


def order_lemmas() -> Iterator[tuple[str, Texts, list[Line]]]:
    """Orders of the two ends that do not follow; the edges are start to end, end to start, and from zero to both."""
    false: dict[str, list[Any]] = {
        "more than the path": [[1, 2, [0], "1", [[0, 1]]]],
        "more than the path, without a multiple": [[1, 2, [0], "1", []]],
        "a path to elsewhere": [[1, 2, [2], "0", []]],
        "a path from elsewhere": [[1, 2, [3], "0", []]],
        "steps that do not follow each other": [[1, 2, [0, 0], "0", [[0, 2]]]],
        "a point before itself": [[1, 1, [], "0", []]],
        "a point before itself by a circle": [[1, 1, [0, 1], "0", []]],
        "twice": [[1, 2, [0], "0", [[0, 1]]], [1, 2, [0], "0", [[0, 1]]]],
        "twice by the lemma before": [[1, 2, [0], "0", [[0, 1]]], [1, 2, [4], "0", []]],
        "a lemma that comes later": [[1, 2, [4], "7", []]],
        "no path": [[1, 2, [], "0", []]],
        "by a fact of the network": [[1, 2, [0], "0", [[2, 1]]]],
    }
    for name, lemmas in false.items():
        start: list[Line] = [over("0", "9"), ["orders", *lemmas], ["schedule", []]]
        rest: list[Line] = [["kept", [], [], [], [[0, 1]]]]
        for refuted in (
            [NOT_NEGATIVE],
            [],
        ):  # the order may make the obligation constant, in a checker that believes it
            yield f"orders: {name}", PLAIN, [*start, *rest, *refuted]


# -- what the checker must not give a meaning to -----------------------------------------------------------------------


def without_meaning() -> Iterator[tuple[str, Texts]]:
    """Plans whose obligations the checker must not write down."""
    for name, effects, goal in (
        ("atoms in a circle", ["(at end (when (p) (q)))", "(at start (when (q) (p)))"], "(p)"),
        ("a fluent in a circle", ["(at start (assign (f) (g)))", "(at end (assign (g) (f)))"], "(> (f) 0)"),
        ("a rate that is assigned", ["(increase (f) (* #t (g)))", "(at end (assign (g) 2))"], "(> (f) 0)"),
        ("a rate that flows", ["(increase (f) (* #t (g)))", "(increase (g) (* #t 1))"], "(> (f) 0)"),
        ("a quotient of times", ["(at end (assign (f) (/ 1 (+ 1 ?duration))))"], "(> (f) 0)"),
        ("a quotient of zero", ["(at end (assign (f) (/ 1 (- 1 1))))"], "(> (f) 0)"),
        ("a product of times", ["(at end (assign (f) (* ?duration ?duration)))"], "(> (f) 0)"),
        ("an effect between two times", ["(at start (when (at end (p)) (at start (q))))"], "(q)"),
        ("a fluent without value", ["(at end (increase (e) 1))"], "(> (e) 0)"),
    ):
        yield name, two_actions(effects, goal)
    for name, effect in (("assigned", "(at end (assign (g) 2))"), ("changed", "(increase (g) (* #t 1))")):
        yield f"a rate that is {name} while it acts", rate_that_changes(effect)


def rate_that_changes(effect: str) -> Texts:
    """Where the rate's value before the action begins is a number."""
    lengths = ("i.start - .zero in [0, 0]", "i.end - i.start in [4, 4]", "j.start - i.start in [1, 1]")
    return Texts(
        "(define (domain d) (:predicates (p)) (:functions (f) (g))\n"
        "(:durative-action d :parameters () :duration () :condition () :effect (increase (f) (* #t (g))))\n"
        f"(:durative-action e :parameters () :duration () :condition () :effect {effect}))",
        "(define (problem x) (:domain d) (:init (= (f) 1) (= (g) 1)) (:goal (> (f) 0)))",
        "durative-action instance i : (d); durative-action instance j : (e);\n"
        + "\n".join(f"c: {length};" for length in (*lengths, "j.end - j.start in [1, 1]")),
    )


def two_actions(effects: list[str], goal: str) -> Texts:
    """Actions with these effects, twice, in any order."""
    return Texts(
        "(define (domain d) (:predicates (p) (q)) (:functions (e) (f) (g))\n"
        f"(:durative-action d :parameters () :duration () :condition () :effect (and {' '.join(effects)})))",
        f"(define (problem x) (:domain d) (:init (= (f) 1) (= (g) 1)) (:goal {goal}))",
        "\n".join(
            [
                "parameter x default 1;",
                "durative-action instance i : (d); c: i.end - i.start in [1, 2];",
                "durative-action instance j : (d); c: j.end - j.start in [1, 2]; c: j.end - i.start in [-inf, x];",
            ]
        ),
    )


_COUNTED = two_actions(["(at end (increase (f) (+ 1)))"], "(>= (f) 3)")
BESIDE = _COUNTED._replace(plan=_COUNTED.plan.replace("[-inf, x]", "[-inf, 9]")), '[parameters.x]\nfluent = "(f)"\n'
"""The initial value of f is the parameter x: 1 is enough."""
