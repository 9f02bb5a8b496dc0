"""[PIKE] Theorem 4.6: scenarios of the theory are those with a correct execution, if read about the plan's own "
"choices."""

from proofs.theorems._library.augmented import PLAN, facts, rules, world
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, consts, exists, forall, function, iff, implies, sort

BOTH = {"s": "Extended", "r": "Schedule"}
SPACE = (
    sort("Scenario"),
    sort("Extended"),
    sort("Schedule"),
    function("own", ["Extended"], "Scenario"),
    *(function(name, ["Extended"], "Bool") for name in ("causal", "conflict-free")),
    *(function(name, ["Extended", "Schedule"], "Bool") for name in ("consistent", "complete")),
    function("correct", ["Scenario", "Schedule"], "Bool"),
    function("schedule", ["Extended"], "Schedule"),
    function("traced", ["Scenario", "Schedule"], "Extended"),
    const("scenario", "Scenario"),
    const("extended", "Extended"),
    const("run", "Schedule"),
)
BY_4_1 = "Theorem 4.1: without a temporal conflict there is a consistent schedule, with one there is none"
BY_4_5 = "Theorem 4.5: consistent executions that satisfy the theory are causally complete"
BY_4_3 = (
    "Theorem 4.3: a correct execution has one of the augmented plan that satisfies the theory, with the same schedule"
)
BY_4_3_BACK = "Theorem 4.3, backwards: correct executions of the augmented plan are correct in the plan"
THEOREMS = {
    BY_4_1: conj(
        forall({"s": "Extended"}, "(=> (conflict-free s) (consistent s (schedule s)))"),
        forall(BOTH, "(=> (consistent s r) (conflict-free s))"),
    ),
    BY_4_5: forall(BOTH, "(=> (and (causal s) (consistent s r)) (complete s r))"),
    BY_4_3: forall(
        {"f": "Scenario", "r": "Schedule"},
        implies(
            "(correct f r)",
            "(and (= (own (traced f r)) f) (causal (traced f r)) (consistent (traced f r) r))",
        ),
    ),
    BY_4_3_BACK: forall(BOTH, "(=> (and (consistent s r) (complete s r)) (correct (own s) r))"),
}
THEORY = "(and (causal s) (conflict-free s))"
STATEMENT = Statement(
    SPACE,
    THEOREMS,
    iff(
        exists({"s": "Extended"}, conj("(= (own s) scenario)", THEORY)),
        exists({"r": "Schedule"}, "(correct scenario r)"),
    ),
    {
        "causal part of the theory": "(causal extended)",
        "no temporal conflict": "(conflict-free extended)",
        "consistent": "(consistent extended run)",
        "correct in the plan": "(correct scenario run)",
    },
)
SMALL = "one scenario, one extension, one schedule"
ONE = conj(
    forall({"s": "Extended", "r": "Schedule"}, "(and (= s extended) (= r run))"),
    forall({"f": "Scenario"}, "(= f scenario)"),
)
EVERY = Statement(
    SPACE,
    THEOREMS,
    implies(
        "(and (causal extended) (conflict-free extended))",
        exists({"r": "Schedule"}, "(and (consistent extended r) (complete extended r))"),
    ),
    STATEMENT.show,
)

COMPLETE = "the execution is causally complete: each condition of an active consumer has a support"
VALUES = "the support variables name these supports, the order variables say on which side threats are"
OWN_VALUES = Statement(
    (*PLAN, *rules(), const("condition", "Condition"), *consts("Event", "producer", "idle")),
    {
        **facts(),
        COMPLETE: forall(
            {"q": "Condition"},
            implies("(active (consumer q))", exists({"p": "Event"}, "(supported-by q p)")),
        ),
        "the execution meets the constraints that were added": forall({"q": "Condition"}, "(ordered q)"),
        VALUES: forall(
            {"q": "Condition"},
            implies("(active (consumer q))", "(and (not (none q)) (supported-by q (support q)))"),
        ),
    },
    "(theory condition)",
    {
        "producer at": "(time producer)",
        "consumer at": "(time (consumer condition))",
        "no support": "(none condition)",
        "theory satisfied": "(theory condition)",
    },
)

THEOREM = Theorem(
    name="pike_theorem_4_6",
    title="The theory describes the scenarios with a correct execution",
    source="[PIKE, Theorem 4.6]",
    words="A scenario of the plan's own choices extends to one that satisfies the theory if and only if it has a "
    "correct "
    "execution; and every solution of the theory has a correct execution. Not so the converse as printed: a "
    "correct execution "
    "of the augmented plan may come with values of the support variables that the theory rejects.",
    formalisation="`Scenario` assigns the plan's choices, `Extended` the support and order variables, too; `own` "
    "forgets these. "
    "The other theorems enter as assumptions, each proved in its own file. The third lemma is about one execution, "
    "as in "
    "Theorem 4.5.",
    scope=Scope.GENERAL,
    bound="any scenarios and schedules.",
    trusted="Theorems 4.1, 4.3 and 4.5 as proved in their files.",
    lemmas=(
        Lemma(
            "scenarios",
            "A scenario extends to a solution of the theory if and only if it has a correct execution.",
            STATEMENT,
            (
                Variant(
                    "temporal conflicts are not complete: a solution may have no schedule.",
                    STATEMENT.with_changed(BY_4_1, "true").with_also(SMALL, ONE),
                ),
                Variant(
                    "the causal part is not sufficient: a solution may be consistent and not complete.",
                    STATEMENT.without(BY_4_5).with_also(SMALL, ONE),
                ),
                Variant("the augmented plan loses executions.", STATEMENT.without(BY_4_3).with_also(SMALL, ONE)),
            ),
            interesting="(and (causal extended) (conflict-free extended))",
        ),
        Lemma(
            "solutions",
            "Every solution of the theory has a correct execution.",
            EVERY,
            (
                Variant(
                    "temporal conflicts are not part of the theory.",
                    EVERY.without(BY_4_1).with_also(SMALL, ONE),
                ),
            ),
            interesting="(and (causal extended) (conflict-free extended))",
        ),
        Lemma(
            "correct executions",
            "A correct execution of the augmented plan satisfies the theory if its support variables name supports.",
            OWN_VALUES,
            (
                Variant(
                    "support variables may name any event that the added constraints allow.",
                    OWN_VALUES.with_changed(VALUES, forall({"q": "Condition"}, "(not (none q))")).with_also(
                        "three events, one condition", world("producer", "idle", "(consumer condition)")
                    ),
                ),
            ),
            (
                Variant(
                    "\"φ'_S satisfies KB if and only if there exists a correct execution of φ'_S\": a producer at "
                    "0 and its "
                    "consumer at 1 are a correct execution whatever the support variable says, and with ⊥ the "
                    "theory is not "
                    "satisfied. The proof assumes suitable values of the variables that φ'_S has fixed already. "
                    "Repair: "
                    "state it of the plan's own scenario.",
                    OWN_VALUES.without(VALUES)
                    .with_also("two events, one condition", world("producer", "(consumer condition)"))
                    .with_also(
                        "their times, and ⊥",
                        "(and (= (time producer) 0.0) (= (time (consumer condition)) 1.0) (none condition) "
                        "(active producer))",
                    ),
                ),
            ),
            interesting="(active (consumer condition))",
        ),
    ),
)
