"""[PIKE] Lemma 5.1: consensus over a variable with a finite domain."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import const, exists, forall, function, sort

EVERY = "the consensus holds in the scenario: what is left of each term, once its assignment to x is taken away, holds"
DOMAIN = "one term for each value of the domain of x"
STATEMENT = Statement(
    (
        sort("Value"),
        function("rest", ["Value"], "Bool"),
        function("covered", ["Value"], "Bool"),
        const("x", "Value"),
        const("other", "Value"),
    ),
    {DOMAIN: forall({"v": "Value"}, "(covered v)"), EVERY: forall({"v": "Value"}, "(=> (covered v) (rest v))")},
    exists({"v": "Value"}, "(and (covered v) (rest v) (= x v))"),
    {"value of x": "x", "covered by a term": "(covered x)", "what is left of its term holds": "(rest x)"},
)
TWO = "the domain has two values"
ONLY_TWO = "(and (distinct x other) (forall ((v Value)) (or (= v x) (= v other))))"

THEOREM = Theorem(
    name="pike_lemma_5_1",
    title="Consensus for finite-domain variables",
    source="[PIKE, Lemma 5.1]",
    words="If a theory in disjunctive normal form has a term φᵢ ∧ x = vᵢ for each value vᵢ of the domain of x, "
    "then the "
    "conjunction of all φᵢ, if consistent, is an implicant of it.",
    formalisation="One arbitrary scenario: `x` is the value of the variable, `rest v` says that φ of the term for "
    "v holds. "
    "`Value` is an arbitrary set.",
    scope=Scope.GENERAL,
    bound="any domain, any terms.",
    lemmas=(
        Lemma(
            "consensus",
            "Where all φᵢ hold, one of the terms does.",
            STATEMENT,
            (
                Variant(
                    "a value of the domain has no term: x may have that value.",
                    STATEMENT.without(DOMAIN).with_also(TWO, ONLY_TWO),
                ),
                Variant(
                    "one φᵢ need not hold: x may have its value.",
                    STATEMENT.with_changed(EVERY, "(rest other)").with_also(TWO, ONLY_TWO),
                ),
            ),
            interesting="(distinct x other)",
        ),
    ),
)
