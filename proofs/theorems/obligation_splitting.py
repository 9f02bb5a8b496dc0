"""Obligations may be examined one by one, each under those before it."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import apply, conj, const, forall, function, iff, implies, sort

PREMISE = apply("allowed", "x")
ALLOWED = {"x": "Run"}


def holds(which: str) -> str:
    return apply(which, "x")


def always(premise: str, conclusion: str) -> str:
    return forall(ALLOWED, implies(premise, conclusion))


TWO = Statement(
    (
        sort("Run"),
        function("allowed", ["Run"], "Bool"),
        function("first", ["Run"], "Bool"),
        function("second", ["Run"], "Bool"),
        const("some", "Run"),
    ),
    {},
    iff(
        always(PREMISE, conj(holds("first"), holds("second"))),
        conj(always(PREMISE, holds("first")), always(conj(PREMISE, holds("first")), holds("second"))),
    ),
    {"run allowed": "(allowed some)", "first holds in it": "(first some)", "second holds in it": "(second some)"},
)
ONE_RUN = "there is one run only"
CIRCULAR = iff(
    always(PREMISE, conj(holds("first"), holds("second"))),
    conj(
        always(conj(PREMISE, holds("second")), holds("first")), always(conj(PREMISE, holds("first")), holds("second"))
    ),
)
UNASKED = iff(
    always(PREMISE, conj(holds("first"), holds("second"))), always(conj(PREMISE, holds("first")), holds("second"))
)

INDEX = {"i": "Int"}
MANY = Statement(
    (
        sort("Run"),
        function("allowed", ["Run"], "Bool"),
        function("obligation", ["Int", "Run"], "Bool"),
        function("failure", ["Run"], "Int"),
        const("run", "Run"),
        const("number", "Int"),
    ),
    {
        "of the obligations that a run fails, one is the first": forall(
            {"r": "Run", "n": "Int"},
            implies(
                "(and (<= 0 n) (not (obligation n r)))",
                "(and (<= 0 (failure r)) (<= (failure r) n) (not (obligation (failure r) r)))",
            ),
        ),
        "the first one: all before it hold": forall(
            {"r": "Run", "n": "Int"}, implies("(and (<= 0 n) (< n (failure r)))", "(obligation n r)")
        ),
        "each obligation holds in all runs that are allowed and meet the obligations before it": forall(
            {"i": "Int", "r": "Run"},
            implies(
                conj("(<= 0 i)", "(allowed r)", forall({"j": "Int"}, "(=> (and (<= 0 j) (< j i)) (obligation j r))")),
                "(obligation i r)",
            ),
        ),
        "an allowed run, and the number of an obligation": "(and (allowed run) (<= 0 number))",
    },
    "(obligation number run)",
    {"number": "number", "the first obligation that fails": "(failure run)"},
)

THEOREM = Theorem(
    name="obligation_splitting",
    title="Obligation splitting",
    source="ours",
    words="∀X(A → P₁∧P₂) ≡ ∀X(A → P₁) ∧ ∀X(A∧P₁ → P₂), and so on for any sequence of obligations: each may be examined "
    "under the assumption of those that come before it.",
    formalisation="`Run` is an arbitrary set (schedules with states), `allowed` is A, and the obligations are "
    "arbitrary "
    "predicates of runs; the parameters are fixed and arbitrary, too.",
    scope=Scope.GENERAL,
    bound="any set of runs, any premise, any sequence of obligations.",
    lemmas=(
        Lemma(
            "two",
            "Two obligations at once, or the second under the first.",
            TWO,
            (
                Variant(
                    "both are examined, each under the other: a run that fails both is overlooked.",
                    TWO.claiming(CIRCULAR).with_also(ONE_RUN, forall({"x": "Run"}, "(= x some)")),
                ),
                Variant(
                    "the first is never examined: a run that fails it is overlooked.",
                    TWO.claiming(UNASKED).with_also(ONE_RUN, forall({"x": "Run"}, "(= x some)")),
                ),
            ),
            interesting="(and (allowed some) (not (second some)))",
        ),
        Lemma(
            "many",
            "If each obligation of a sequence holds under those before it, all hold.",
            MANY,
            (
                Variant(
                    "each is examined under those up to and including itself: nothing is shown.",
                    MANY.with_changed(
                        "each obligation holds in all runs that are allowed and meet the obligations before it", "true"
                    ).with_also(ONE_RUN, forall({"r": "Run"}, "(= r run)")),
                ),
            ),
        ),
    ),
)
