"""[PIKE] Theorem 4.4: partial executions are correct for the augmented plan exactly if they are for the plan."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, exists, forall, function, iff, implies, sort

BOTH = {"s": "Extended", "r": "Schedule"}
FORWARD = "Theorem 4.3: a correct execution of the plan has one of the augmented plan with the same schedule"
BACK = "Theorem 4.3, backwards"
OWN = "the partial execution assigns choices of the plan only: extending it depends on these"
STATEMENT = Statement(
    (
        sort("Scenario"),
        sort("Extended"),
        sort("Schedule"),
        function("own", ["Extended"], "Scenario"),
        function("traced", ["Scenario", "Schedule"], "Extended"),
        function("correct", ["Scenario", "Schedule"], "Bool"),
        function("augmented-correct", ["Extended", "Schedule"], "Bool"),
        function("agrees", ["Scenario"], "Bool"),
        function("augmented-agrees", ["Extended"], "Bool"),
        function("continues", ["Schedule"], "Bool"),
        const("scenario", "Scenario"),
        const("extended", "Extended"),
        const("run", "Schedule"),
    ),
    {
        FORWARD: forall(
            {"f": "Scenario", "r": "Schedule"},
            implies("(correct f r)", "(and (= (own (traced f r)) f) (augmented-correct (traced f r) r))"),
        ),
        BACK: forall(BOTH, "(=> (augmented-correct s r) (correct (own s) r))"),
        OWN: forall({"s": "Extended"}, "(= (augmented-agrees s) (agrees (own s)))"),
    },
    iff(
        exists(BOTH, "(and (augmented-agrees s) (continues r) (augmented-correct s r))"),
        exists({"f": "Scenario", "r": "Schedule"}, "(and (agrees f) (continues r) (correct f r))"),
    ),
    {
        "correct in the plan": "(correct scenario run)",
        "correct in the augmented plan": "(augmented-correct extended run)",
        "the scenario agrees": "(agrees scenario)",
        "the extended scenario agrees": "(augmented-agrees extended)",
    },
)
SMALL = "one scenario, one extension, one schedule"
ONE = conj(forall(BOTH, "(and (= s extended) (= r run))"), forall({"f": "Scenario"}, "(= f scenario)"))

THEOREM = Theorem(
    name="pike_theorem_4_4",
    title="Partial executions are correct for both plans or for neither",
    source="[PIKE, Theorem 4.4]",
    words="A partial execution is correct for the augmented plan if and only if it is for the plan, if it assigns "
    "choices of the "
    "plan only. A partial execution of the augmented plan may also assign support variables, and may then be "
    "correct for the plan only.",
    formalisation="`agrees` says that a scenario extends the partial one, `continues` that a schedule extends the "
    "partial one; "
    "correct means that an extending execution is correct (Definition 2.8). Theorem 4.3 enters as an assumption.",
    scope=Scope.GENERAL,
    bound="any scenarios and schedules.",
    trusted="Theorem 4.3 as proved in its file.",
    lemmas=(
        Lemma(
            "partial executions",
            "Some extension is correct in the one plan if and only if some is in the other.",
            STATEMENT,
            (
                Variant("the augmented plan loses executions.", STATEMENT.without(FORWARD).with_also(SMALL, ONE)),
                Variant("the augmented plan gains executions.", STATEMENT.without(BACK).with_also(SMALL, ONE)),
            ),
            (
                Variant(
                    "a partial execution of the augmented plan that assigns a support variable: one scenario has a "
                    "correct "
                    "execution, its only extension does not agree with the value that is assigned. Repair: partial "
                    "executions assign the plan's own choices.",
                    STATEMENT.with_changed(
                        OWN, forall({"s": "Extended"}, "(=> (augmented-agrees s) (agrees (own s)))")
                    ).with_also(SMALL, ONE),
                ),
            ),
            interesting="(and (agrees scenario) (continues run) (correct scenario run))",
        ),
    ),
)
