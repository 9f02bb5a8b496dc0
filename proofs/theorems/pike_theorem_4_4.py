"""[PIKE] Theorem 4.4: partial executions are correct for the augmented plan exactly if they are for the plan."""

from proofs.theorems._library.augmented import EXTENDED_RUN, ONE
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import exists, forall, function, iff
from proofs.theorems.pike_theorem_4_3 import BACKWARDS, FORWARDS
from proofs.theorems.pike_theorem_4_5 import COMPLETE
from proofs.theorems.pike_theorem_4_6 import SPACE

OWN = "the partial execution assigns choices of the plan only: extending it depends on these"
STATEMENT = Statement(
    (
        *SPACE,
        function("agrees", ["Scenario"], "Bool"),
        function("augmented-agrees", ["Extended"], "Bool"),
        function("continues", ["Schedule"], "Bool"),
    ),
    {OWN: forall({"s": "Extended"}, "(= (augmented-agrees s) (agrees (own s)))")},
    iff(
        exists(EXTENDED_RUN, "(and (augmented-agrees s) (continues r) (consistent s r) (complete (own s) r))"),
        exists({"f": "Scenario", "r": "Schedule"}, "(and (agrees f) (continues r) (correct f r))"),
    ),
    {
        "correct in the plan": "(correct scenario run)",
        "correct in the augmented plan": "(and (consistent extended run) (complete (own extended) run))",
        "the scenario agrees": "(agrees scenario)",
        "the extended scenario agrees": "(augmented-agrees extended)",
    },
).citing(FORWARDS, BACKWARDS, COMPLETE)
SMALL = "one scenario, one extension, one schedule"

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
    "correct means that an extending execution is correct (Definition 2.8). Theorems 4.3 and 4.5 enter as "
    "assumptions: the same formulas that their files prove.",
    scope=Scope.GENERAL,
    bound="any scenarios and schedules.",
    lemmas=(
        Lemma(
            "partial executions",
            "Some extension is correct in the one plan if and only if some is in the other.",
            STATEMENT,
            (
                Variant(
                    "the augmented plan loses executions.", STATEMENT.without(FORWARDS.words).with_also(SMALL, ONE)
                ),
                Variant(
                    "the augmented plan gains executions.", STATEMENT.without(BACKWARDS.words).with_also(SMALL, ONE)
                ),
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
            interesting="(and (agrees scenario) (continues run) (correct scenario run) " + ONE + ")",
        ),
    ),
)
