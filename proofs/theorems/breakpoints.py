"""A condition on a piecewise linear quantity needs checking at breakpoints only, with care for strict inequalities."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, consts, define, forall, function, implies

VALUE = define("value", {"w": "Real"}, "Real", "(+ left (* w (- right left)))")
WITHIN = "a weight strictly between the ends"
STRICTLY = {WITHIN: "(and (< 0.0 w) (< w 1.0))"}
SHOW = {"limit from the right at the left end": "left", "limit at the right end": "right", "weight": "w"}
BASE = (*consts("Real", "left", "right", "w"), VALUE)

GOOD = {
    "at least zero": ("(<= 0.0 {})", "(and (<= 0.0 left) (<= 0.0 right))", "both limits are at least zero"),
    "above zero": (
        "(< 0.0 {})",
        "(and (<= 0.0 left) (<= 0.0 right) (or (< 0.0 left) (< 0.0 right)))",
        "both limits are at least zero, and one is above",
    ),
    "zero": ("(= 0.0 {})", "(and (= 0.0 left) (= 0.0 right))", "both limits are zero"),
    "not zero": (
        "(distinct 0.0 {})",
        "(or (and (<= 0.0 left) (<= 0.0 right) (or (< 0.0 left) (< 0.0 right))) "
        "(and (<= left 0.0) (<= right 0.0) (or (< left 0.0) (< right 0.0))))",
        "both limits are on the same side, and one is not zero",
    ),
}
WEAKER = {
    "at least zero": ("only the left limit is looked at.", "(<= 0.0 left)"),
    "above zero": (
        "the limits are looked at as if the condition were not strict: it fails on a piece that is zero throughout.",
        "(and (<= 0.0 left) (<= 0.0 right))",
    ),
    "zero": ("only the left limit is looked at.", "(= 0.0 left)"),
    "not zero": (
        "the limits are not zero: the quantity may pass through zero between them.",
        "(and (distinct 0.0 left) (distinct 0.0 right))",
    ),
}
STRICTER = {
    "at least zero": ("both limits must be above zero.", "(and (< 0.0 left) (< 0.0 right))"),
    "above zero": (
        "both limits must be above zero: pieces that start or end at zero are rejected, though the ends do not "
        "belong to them.",
        "(and (< 0.0 left) (< 0.0 right))",
    ),
    "zero": ("never accepted.", "(and (= 0.0 left) (distinct 0.0 right))"),
    "not zero": ("both limits must be above zero.", "(and (< 0.0 left) (< 0.0 right))"),
}


def sufficient(name: str) -> Lemma:
    """Limits as required make the condition hold throughout the piece."""
    condition, limits, words = GOOD[name]
    statement = Statement(BASE, {**STRICTLY, f"{words}": limits}, condition.format("(value w)"), SHOW)
    wrong, formula = WEAKER[name]
    return Lemma(
        f"{name}, sufficient",
        f"If {words}, the quantity is {name} on the whole open piece.",
        statement,
        (Variant(wrong, statement.with_changed(words, formula)),),
    )


def necessary(name: str) -> Lemma:
    """A condition that holds throughout the piece has limits as required: some weight of four tells."""
    condition, limits, words = GOOD[name]
    statement = Statement(
        (*BASE, *consts("Real", "middle", "near-left", "near-right", "crossing")),
        {
            "four places in the piece, if it crosses zero; only the middle counts if it does not": conj(
                "(= middle 0.5)",
                implies(
                    "(or (and (< left 0.0) (< 0.0 right)) (and (< right 0.0) (< 0.0 left)))",
                    conj(
                        "(= (* crossing (- left right)) left)",
                        "(= near-left (/ crossing 2.0))",
                        "(= near-right (/ (+ 1.0 crossing) 2.0))",
                    ),
                ),
            ),
            "the condition holds wherever one of these places is inside the piece": all_places(condition),
        },
        limits,
        SHOW,
    )
    wrong, formula = STRICTER[name]
    return Lemma(
        f"{name}, necessary",
        f"If the quantity is {name} on the whole open piece, {words}.",
        statement,
        (Variant(wrong, statement.claiming(formula)),),
    )


def all_places(condition: str) -> str:
    places = ("middle", "near-left", "near-right", "crossing")
    return conj(
        *(implies(f"(and (< 0.0 {place}) (< {place} 1.0))", condition.format(f"(value {place})")) for place in places)
    )


AT_BREAKPOINTS = "the condition holds at all breakpoints inside"
ON_PIECES = "it holds on the open piece between any two neighbours"
PIECES = Statement(
    (
        function("breakpoint", ["Real"], "Bool"),
        function("holds", ["Real"], "Bool"),
        function("neighbours", ["Real", "Real"], "Bool"),
        *consts("Real", "start", "end", "t", "before", "after"),
    ),
    {
        "an instant of the open interval": "(and (< start t) (< t end))",
        "if it is no breakpoint, there are neighbours before and after it: breakpoints, or the ends": implies(
            "(not (breakpoint t))",
            "(and (<= start before) (< before t) (< t after) (<= after end) (neighbours before after))",
        ),
        AT_BREAKPOINTS: forall({"u": "Real"}, "(=> (and (breakpoint u) (< start u) (< u end)) (holds u))"),
        ON_PIECES: forall(
            {"a": "Real", "b": "Real", "u": "Real"}, "(=> (and (neighbours a b) (< a u) (< u b)) (holds u))"
        ),
    },
    "(holds t)",
    {"instant": "t", "is a breakpoint": "(breakpoint t)", "from": "start", "to": "end"},
)
EITHER = Statement(
    (
        *consts("Real", "left", "right", "left-2", "right-2", "w"),
        VALUE,
        define("second", {"w": "Real"}, "Real", "(+ left-2 (* w (- right-2 left-2)))"),
    ),
    {
        **STRICTLY,
        "one and the same comparison holds at both limits": "(or (and (<= 0.0 left) (<= 0.0 right)) "
        "(and (<= 0.0 left-2) (<= 0.0 right-2)))",
    },
    "(or (<= 0.0 (value w)) (<= 0.0 (second w)))",
    {**SHOW, "second quantity, left limit": "left-2", "right limit": "right-2"},
)

THEOREM = Theorem(
    name="breakpoints",
    title="Breakpoints are enough for piecewise linear conditions",
    source="ours",
    words="A comparison of a quantity that is linear between breakpoints holds throughout an open interval if and "
    "only if it "
    "holds at the breakpoints inside, and on each piece between two neighbours the limits at its ends are such: "
    "for ≥ both "
    "at least zero, for > both at least zero and one above, for = both zero, for ≠ both on one side and one not zero.",
    formalisation="A piece is given by its limits at both ends; an instant strictly inside by its weight w, so "
    "that the "
    "quantity is left + w·(right − left): real arithmetic with products. Necessity is shown at four places of the "
    "piece: "
    "the middle, where it crosses zero, and halfway between that and the ends. The union over pieces is the last "
    "lemma.",
    scope=Scope.GENERAL,
    bound="any limits, any number of breakpoints; one comparison of one quantity.",
    lemmas=(
        *(sufficient(name) for name in GOOD),
        *(necessary(name) for name in GOOD),
        Lemma(
            "pieces",
            "Breakpoints and the pieces between neighbours cover the interval.",
            PIECES,
            (
                Variant(
                    "breakpoints inside are not looked at: a quantity may jump there.", PIECES.without(AT_BREAKPOINTS)
                ),
                Variant("only the breakpoints are looked at.", PIECES.without(ON_PIECES)),
            ),
        ),
        Lemma(
            "either",
            "For a disjunction it is enough that one and the same comparison holds at both limits.",
            EITHER,
            (
                Variant(
                    "each limit meets the disjunction, through different comparisons: between them neither may hold. "
                    "Conditions with two comparisons of changing quantities need a free instant.",
                    EITHER.with_changed(
                        "one and the same comparison holds at both limits",
                        "(and (or (<= 0.0 left) (<= 0.0 left-2)) (or (<= 0.0 right) (<= 0.0 right-2)))",
                    ),
                ),
            ),
        ),
    ),
)
