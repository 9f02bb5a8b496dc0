"""[PIKE] Theorem 4.6: the theory has the scenarios with a correct execution, read about the plan's own choices."""

from proofs.theorems._library.augmented import EXECUTIONS, NAMED, ONE, PLAN, facts, rules, world
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, consts, exists, forall, function, iff, implies
from proofs.theorems.pike_theorem_4_1 import NO_CONFLICT, SCHEDULE
from proofs.theorems.pike_theorem_4_3 import BACKWARDS, FORWARDS
from proofs.theorems.pike_theorem_4_5 import COMPLETE

SPACE = (
    *EXECUTIONS,
    *(function(name, ["Extended"], "Bool") for name in ("causal", "conflict-free")),
    function("consistent", ["Extended", "Schedule"], "Bool"),
    *(function(name, ["Scenario", "Schedule"], "Bool") for name in ("complete", "correct")),
    function("schedule", ["Extended"], "Schedule"),
    function("traced", ["Scenario", "Schedule"], "Extended"),
    *NAMED,
)
STATEMENT = Statement(
    SPACE,
    {},
    iff(
        exists({"s": "Extended"}, "(and (= (own s) scenario) (causal s) (conflict-free s))"),
        exists({"r": "Schedule"}, "(correct scenario r)"),
    ),
    {
        "causal part of the theory": "(causal extended)",
        "no temporal conflict": "(conflict-free extended)",
        "consistent": "(consistent extended run)",
        "correct in the plan": "(correct scenario run)",
    },
).citing(NO_CONFLICT, SCHEDULE, COMPLETE, FORWARDS, BACKWARDS)
SMALL = "one scenario, one extension, one schedule"
EVERY = Statement(
    SPACE,
    {},
    implies(
        "(and (causal extended) (conflict-free extended))",
        exists({"r": "Schedule"}, "(and (consistent extended r) (complete (own extended) r))"),
    ),
    STATEMENT.show,
).citing(SCHEDULE, COMPLETE)

SUPPORTED = "the support variables name supports, the order variables say on which side threats are"
OWN_VALUES = Statement(
    (*PLAN, *rules(), *NAMED, const("condition", "Condition"), *consts("Event", "producer", "idle")),
    {
        **facts(),
        SUPPORTED: forall(
            {"q": "Condition"},
            implies(
                "(active (own extended) (consumer q))",
                "(and (not (none extended q)) (supported-by (own extended) run q (support extended q)))",
            ),
        ),
    },
    "(=> (and (consistent extended run) (complete (own extended) run)) (causal extended))",
    {
        "producer at": "(time run producer)",
        "consumer at": "(time run (consumer condition))",
        "no support": "(none extended condition)",
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
    "forgets these. The other theorems enter as assumptions: the same formulas that their files prove, with the same "
    "symbols, which there are defined and are arbitrary here. The third lemma has their definitions.",
    scope=Scope.GENERAL,
    bound="any scenarios and schedules.",
    trusted="Consistent schedules of the augmented plan are defined by bounds in the file of Theorem 4.1, and by the "
    "constraints in those of 4.3 and 4.5; lemma bounds of 4.1 shows that these are the same.",
    lemmas=(
        Lemma(
            "scenarios",
            "A scenario extends to a solution of the theory if and only if it has a correct execution.",
            STATEMENT,
            (
                Variant(
                    "temporal conflicts are not complete: a solution may have no schedule.",
                    STATEMENT.without(SCHEDULE.words).with_also(SMALL, ONE),
                ),
                Variant(
                    "the causal part is not sufficient: a solution may be consistent and not complete.",
                    STATEMENT.without(COMPLETE.words).with_also(SMALL, ONE),
                ),
                Variant(
                    "temporal conflicts are not sound: scenarios with a schedule may have one.",
                    STATEMENT.without(NO_CONFLICT.words).with_also(SMALL, ONE),
                ),
                Variant(
                    "the augmented plan loses executions.", STATEMENT.without(FORWARDS.words).with_also(SMALL, ONE)
                ),
                Variant(
                    "the augmented plan gains executions.", STATEMENT.without(BACKWARDS.words).with_also(SMALL, ONE)
                ),
            ),
            interesting=conj("(causal extended)", "(conflict-free extended)", ONE),
        ),
        Lemma(
            "solutions",
            "Every solution of the theory has a correct execution.",
            EVERY,
            (
                Variant(
                    "temporal conflicts are not part of the theory.",
                    EVERY.without(SCHEDULE.words).with_also(SMALL, ONE),
                ),
            ),
            interesting=conj("(causal extended)", "(conflict-free extended)", ONE),
        ),
        Lemma(
            "correct executions",
            "A correct execution of the augmented plan satisfies the theory if its support variables name supports.",
            OWN_VALUES,
            (
                Variant(
                    "support variables may name any event that the added constraints allow.",
                    OWN_VALUES.with_changed(SUPPORTED, forall({"q": "Condition"}, "(not (none extended q))")).with_also(
                        "three events, one condition, one execution", world("producer", "idle", "(consumer condition)")
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
                    OWN_VALUES.without(SUPPORTED)
                    .with_also("two events, one condition, one execution", world("producer", "(consumer condition)"))
                    .with_also(
                        "their times, and ⊥",
                        "(and (= (time run producer) 0.0) (= (time run (consumer condition)) 1.0) "
                        "(none extended condition) (active scenario producer))",
                    ),
                ),
            ),
            interesting=conj(
                "(consistent extended run)",
                "(active scenario (consumer condition))",
                world("producer", "idle", "(consumer condition)"),
            ),
        ),
    ),
)
