"""Certificates that somebody made up with care: each is rejected for one reason only.

Each class is what would be believed if one of the checker's demands were missing or weaker. The plans are as small as
that takes: an action whose duration is the parameter k, and what the network says besides. `data/forgeries.json` has
the plans and the tapes, a line of a tape on a line.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.certify.texts import Texts

Line = list[Any]
FORMAT = "robust/certificate/2"
TABLES = json.loads(Path(__file__).with_name("data").joinpath("forgeries.json").read_text(encoding="utf-8"))
PLANS = {name: Texts(*texts) for name, texts in TABLES["plans"].items()}
PLAIN = PLANS["one action of k, from 0 to 9"]
LONGER = PLANS["one action of k, at least 3"]
"""The envelope is k >= 3; the first constraint says k - 3 >= 0 without any time."""
NOT_NEGATIVE: Line = ["refute", [[2], [1], [[0, 1]]], [[], [0, 1]]]
"""Of k < 0, by the first fact, k >= 0."""


def over(low: str, high: str, closed: bool = True) -> Line:
    return [FORMAT, "box", [[low, closed, high, closed]]]


def honest() -> Iterator[tuple[str, Texts, list[Line]]]:
    """What the forgeries are made of is accepted where it is true."""
    return ((name, PLANS[plan], lines) for name, plan, lines in TABLES["honest"])


def made_up() -> Iterator[tuple[str, Texts, list[Line]]]:
    """Name, plan and tape of each forgery; none is accepted."""
    return ((name, PLANS[plan], lines) for name, plan, lines in TABLES["made up"])


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
