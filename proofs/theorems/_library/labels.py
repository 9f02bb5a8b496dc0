"""Environments over any number of finite-domain variables, and labels: sets of environments [PIKE, §5]."""

from __future__ import annotations

from proofs.theorems._library.terms import Command, Term, conj, consts, define, exists, forall, function, implies, sort

ENTRY = {"e": "Environment"}
PARTS = {"e": "Environment", "part": "Environment"}
ENVIRONMENTS: tuple[Command, ...] = (
    sort("Environment"),
    sort("Variable"),
    sort("Value"),
    function("assigned", ["Environment", "Variable"], "Bool"),
    function("value", ["Environment", "Variable"], "Value"),
    function("domain", ["Variable", "Value"], "Bool"),
    function("first", ["Variable"], "Value"),
    function("with", ["Environment", "Variable", "Value"], "Environment"),
    define(
        "entails",
        PARTS,
        "Bool",
        forall({"y": "Variable"}, "(=> (assigned part y) (and (assigned e y) (= (value e y) (value part y))))"),
    ),
    define("scenario", ENTRY, "Bool", forall({"y": "Variable"}, "(assigned e y)")),
    *consts("Environment", "some"),
    *consts("Variable", "x"),
    *consts("Value", "v"),
)
"""`with` assigns a value to one more variable; a scenario assigns all."""
LABEL: tuple[Command, ...] = (
    function("label", ["Environment"], "Bool"),
    define("says", ENTRY, "Bool", exists({"part": "Environment"}, "(and (label part) (entails e part))")),
    define(
        "implicant",
        ENTRY,
        "Bool",
        forall({"full": "Environment"}, "(=> (and (scenario full) (entails full e)) (says full))"),
    ),
)
"""Environments of which a member of the label is a part, and those that say so in every scenario."""

WITH = "an environment with a value for one more variable has that, and is as before for the others"
FEWER = "it leaves fewer variables free"


def with_one(e: Term, x: Term, v: Term) -> Term:
    """What it means to assign one more variable."""
    more = f"(with {e} {x} {v})"
    return forall(
        {"y": "Variable"},
        conj(
            f"(= (assigned {more} y) (or (assigned {e} y) (= y {x})))",
            f"(= (value {more} y) (ite (= y {x}) {v} (value {e} y)))",
        ),
    )


INDUCTION: tuple[Command, ...] = (function("free", ["Environment"], "Int"),)
"""How many variables are free: what the inductions go down by."""
COUNTED: Term = forall(
    {"e": "Environment", "x": "Variable", "v": "Value"},
    implies("(and (not (assigned e x)) (domain x v))", "(< (free (with e x v)) (free e))"),
)


def if_fewer(holds: Term) -> Term:
    """The statement about `e`, of all environments that leave fewer variables free than `some`."""
    return forall(ENTRY, f"(=> (< (free e) (free some)) {holds})")


def world(*environments: Term) -> Term:
    """One variable with two values, and these environments."""
    return conj(
        forall({"y": "Variable"}, "(= y x)"),
        forall({"w": "Value"}, "(or (= w v) (= w (first x)))"),
        forall(ENTRY, f"(or {' '.join(f'(= e {one})' for one in environments)} false)"),
    )
