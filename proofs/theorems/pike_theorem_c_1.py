"""[PIKE] Theorem C.1: completions of labeled value sets; and what Algorithm 8 must start with."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import const, consts, exists, forall, function, ite, sort

VALUE = {"v": "Value"}
LABELED = "a labeled value for each value v of x: if its label holds, t < a(v)"
LABELS = "what is left of each label, without x, holds"
LOOSEST = "m is the loosest of the values"
STATEMENT = Statement(
    (
        sort("Value"),
        function("rest", ["Value"], "Bool"),
        function("a", ["Value"], "Real"),
        const("x", "Value"),
        const("other", "Value"),
        *consts("Real", "t", "m"),
    ),
    {
        LABELED: forall(VALUE, "(=> (and (rest v) (= x v)) (< t (a v)))"),
        LABELS: forall(VALUE, "(rest v)"),
        LOOSEST: f"(and {forall(VALUE, '(<= (a v) m)')} {exists(VALUE, '(= (a v) m)')})",
    },
    "(< t m)",
    {"x": "x", "t": "t", "m": "m", "bound for x": "(a x)", "bound for another value": "(a other)"},
)
TWO = "the domain has two values"
ONLY_TWO = "(and (distinct x other) (forall ((v Value)) (or (= v x) (= v other))))"
SEED = "the search starts with the identity of the maximum, below every value"


def largest(first: str, second: str) -> str:
    return ite(f"(<= {first} {second})", second, first)


ALGORITHM = Statement(
    consts("Real", "seed", "a-1", "a-2", "completion"),
    {
        SEED: "(and (<= seed a-1) (<= seed a-2))",
        "two values of x, taken in turn": f"(= completion {largest(largest('seed', 'a-1'), 'a-2')})",
    },
    f"(= completion {largest('a-1', 'a-2')})",
    {"seed": "seed", "value for x = 1": "a-1", "value for x = 2": "a-2", "completion": "completion"},
)

THEOREM = Theorem(
    name="pike_theorem_c_1",
    title="Completions of labeled value sets",
    source="[PIKE, Theorem C.1, Algorithm 8]",
    words="If t < aᵢ holds under φᵢ ∧ x = vᵢ for every value vᵢ of x, then t is below the loosest of the aᵢ "
    "wherever all φᵢ "
    "hold. Algorithm 8 computes it if it starts with the identity of the maximum; starting with the weakest value, "
    "as its "
    "explanation says, every completion is the weakest value.",
    formalisation="One arbitrary scenario: x has a value, t and the aᵢ are numbers (any linear order would do), "
    "`rest v` says "
    "that what is left of the label for v holds. The second lemma is the loop of Algorithm 8 for two values.",
    scope=Scope.GENERAL,
    bound="any domain, any labels and values; the loop of Algorithm 8: two values, longer loops repeat the step.",
    lemmas=(
        Lemma(
            "completion",
            "Where what is left of all labels holds, t is below the loosest value.",
            STATEMENT,
            (
                Variant(
                    "what is left of one label need not hold: x may have that value, and t is not bounded.",
                    STATEMENT.with_changed(LABELS, "(rest other)").with_also(TWO, ONLY_TWO),
                ),
                Variant(
                    "the tightest of the values is taken, not the loosest.",
                    STATEMENT.with_changed(
                        LOOSEST, f"(and {forall(VALUE, '(<= m (a v))')} {exists(VALUE, '(= (a v) m)')})"
                    ).with_also(TWO, ONLY_TWO),
                ),
            ),
            interesting="(distinct x other)",
        ),
        Lemma(
            "algorithm 8",
            "The loop finds the loosest value.",
            ALGORITHM,
            (Variant("the search starts with any value.", ALGORITHM.without(SEED)),),
            (
                Variant(
                    '"W starts containing only the weakest possible completion": with a weakest value of 100 '
                    "(for ∞) the "
                    "example {(3, x = 1), (4, x = 2)} gives 100, not 4. Repair: start with −∞.",
                    ALGORITHM.with_changed(SEED, "(= seed 100.0)").with_also(
                        "the example of the appendix", "(and (= a-1 3.0) (= a-2 4.0))"
                    ),
                ),
            ),
        ),
    ),
)
