"""[IRR] Theorem 1: the containment check is correct."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, exists, forall, function, iff, implies, neg, sort

NETWORK = "the quantifier-free description of values that leave a run is exact"
ALLOWED = "(and (network g x) (effects g x))"
VALID = exists({"x": "Run"}, ALLOWED)
ROBUST = conj(VALID, forall({"x": "Run"}, implies(ALLOWED, "(proofs g x)")))

FIRST_CHECK = neg(exists({"g": "Value"}, "(and (box g) (not (valid g)))"))
SECOND_CHECK = forall({"g": "Value", "x": "Run"}, implies(conj(ALLOWED, "(box g)"), "(proofs g x)"))
IN_ENVELOPE = forall({"g": "Value"}, implies("(box g)", ROBUST))

STATEMENT = Statement(
    (
        sort("Value"),
        sort("Run"),
        function("network", ["Value", "Run"], "Bool"),
        function("effects", ["Value", "Run"], "Bool"),
        function("proofs", ["Value", "Run"], "Bool"),
        function("valid", ["Value"], "Bool"),
        function("box", ["Value"], "Bool"),
        const("some", "Value"),
        const("run", "Run"),
    ),
    {NETWORK: forall({"g": "Value"}, iff("(valid g)", VALID))},
    iff(conj(FIRST_CHECK, SECOND_CHECK), IN_ENVELOPE),
    {
        "value in the box": "(box some)",
        "run allowed": "(and (network some run) (effects some run))",
        "value said to leave a run": "(valid some)",
        "run meets all obligations": "(proofs some run)",
    },
)
SMALL = "one value and one run"
ONE = forall({"g": "Value", "x": "Run"}, "(and (= g some) (= x run))")

THEOREM = Theorem(
    name="irr_theorem_1",
    title="The containment check is correct",
    source="[IRR, Theorem 1]",
    words="CheckInEnvelope(R) returns true if and only if R is a valid decoupled robustness envelope: enc_R ∧ "
    "¬enc_valid is "
    "unsatisfiable and (enc_tn ∧ enc_eff ∧ enc_R) → enc_proofs is valid exactly if every point of R leaves a run "
    "and all "
    "runs that it allows meet the obligations.",
    formalisation="`Value` is the set of parameter assignments, `Run` that of all other variables; `network`, "
    "`effects`, "
    "`proofs` are enc_tn, enc_eff, enc_proofs, and `valid` is what quantifier elimination returned. R is any set: "
    "that it is "
    "a box plays no part.",
    scope=Scope.GENERAL,
    bound="any sets of parameter values and runs, any formulas, any region.",
    lemmas=(
        Lemma(
            "check",
            "Both checks succeed if and only if the region is inside the envelope.",
            STATEMENT,
            (
                Variant(
                    "the description of valid values may err: a value without any run is accepted.",
                    STATEMENT.without(NETWORK).with_also(SMALL, ONE),
                ),
                Variant(
                    "only the second check is made: values that leave no run at all pass it.",
                    STATEMENT.claiming(iff(SECOND_CHECK, IN_ENVELOPE)).with_also(SMALL, ONE),
                ),
                Variant(
                    "only the first check is made: values with a run that fails pass it.",
                    STATEMENT.claiming(iff(FIRST_CHECK, IN_ENVELOPE)).with_also(SMALL, ONE),
                ),
            ),
            interesting="(and (box some) (valid some) (network some run) (effects some run) (proofs some run))",
        ),
    ),
)
