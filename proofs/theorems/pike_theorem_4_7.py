"""[PIKE] Theorem 4.7: an event is executed exactly if the partial execution stays correct."""

from proofs.theorems._library.augmented import EXTENDED_RUN, ONE
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, exists, forall, function, iff, implies
from proofs.theorems.pike_theorem_4_1 import NO_CONFLICT
from proofs.theorems.pike_theorem_4_3 import BACKWARDS, FORWARDS
from proofs.theorems.pike_theorem_4_5 import COMPLETE
from proofs.theorems.pike_theorem_4_6 import SPACE

BY_3_2 = "Theorem 3.2: a scenario meets the required constraints exactly if it has a consistent schedule that continues"
COMMITTED = "what was committed before is true of every scenario with a consistent schedule that continues"
THEORY = conj("(causal s)", "(conflict-free s)", "(committed s)")
STATEMENT = Statement(
    (
        *SPACE,
        *(function(name, ["Extended"], "Bool") for name in ("committed", "required")),
        function("continues", ["Extended", "Schedule"], "Bool"),
    ),
    {
        BY_3_2: conj(
            forall(
                {"s": "Extended"},
                implies(
                    conj("(required s)", THEORY), exists({"r": "Schedule"}, "(and (consistent s r) (continues s r))")
                ),
            ),
            forall(EXTENDED_RUN, "(=> (and (consistent s r) (continues s r)) (required s))"),
        ),
        "whether an execution continues depends on the plan's own choices and the schedule": forall(
            {"s": "Extended", "z": "Extended", "r": "Schedule"},
            "(=> (= (own s) (own z)) (= (continues s r) (continues z r)))",
        ),
        COMMITTED: forall(EXTENDED_RUN, "(=> (and (consistent s r) (continues s r)) (committed s))"),
        "every scenario of the plan extends to one of the augmented plan": forall(
            {"f": "Scenario"}, exists({"s": "Extended"}, "(= (own s) f)")
        ),
    },
    iff(
        exists({"s": "Extended"}, conj(THEORY, "(required s)")),
        exists(EXTENDED_RUN, "(and (continues s r) (correct (own s) r))"),
    ),
    {
        "required constraints met": "(required extended)",
        "theory satisfied": "(and (causal extended) (conflict-free extended) (committed extended))",
        "continues": "(continues extended run)",
        "correct": "(correct (own extended) run)",
    },
).citing(NO_CONFLICT, COMPLETE, FORWARDS, BACKWARDS)
SMALL = "one scenario, one extension, one schedule"
OVER_EXTENDED = iff(
    exists({"s": "Extended"}, conj(THEORY, "(required s)", "(assigned s)")),
    exists(EXTENDED_RUN, "(and (continues s r) (assigned s) (consistent s r) (complete (own s) r))"),
)

THEOREM = Theorem(
    name="pike_theorem_4_7",
    title="An event is executed exactly if the execution stays correct",
    source="[PIKE, Theorem 4.7]",
    words="CanExecuteEventNow?(e, t) returns true if and only if the partial execution with e at t is correct: the "
    "theory "
    "with the required constraints is satisfiable exactly if some correct execution continues it. It is stated of "
    "the plan's own "
    "choices: if a partial execution of the augmented plan may assign support variables, the converse fails, since "
    "it rests on "
    "Theorem 4.6 as printed.",
    formalisation="`required` is F₁ ∧ … ∧ Fₙ, the theory is its causal part, temporal conflicts and what was "
    "committed; "
    "`continues` says that an execution extends the partial one with the event at the present time. The other "
    "theorems enter as "
    "assumptions, in their repaired form: 4.1, 4.3 and 4.5 as the same formulas that their files prove.",
    scope=Scope.GENERAL,
    bound="any scenarios and schedules.",
    trusted="Theorem 3.2 as proved in its file, which is about one scenario. Consistent schedules as in Theorem 4.6.",
    lemmas=(
        Lemma(
            "can execute",
            "Theory and required constraints are satisfiable exactly if a correct execution continues.",
            STATEMENT,
            (
                Variant(
                    "the required constraints are not sufficient for a schedule.",
                    STATEMENT.with_changed(BY_3_2, "true").with_also(SMALL, ONE),
                ),
                Variant("the causal part is not sufficient.", STATEMENT.without(COMPLETE.words).with_also(SMALL, ONE)),
                Variant(
                    "the augmented plan loses executions.", STATEMENT.without(FORWARDS.words).with_also(SMALL, ONE)
                ),
                Variant(
                    "something is committed that is not a consequence of the execution.",
                    STATEMENT.without(COMMITTED).with_also(SMALL, ONE),
                ),
            ),
            (
                Variant(
                    "partial executions of the augmented plan may assign support variables: with ⊥ assigned, an "
                    "execution is "
                    "consistent and complete, and the theory with it is not satisfiable. Repair: partial "
                    "executions assign the "
                    "plan's own choices, as the executive's do.",
                    Statement(
                        (
                            *STATEMENT.declarations,
                            function("assigned", ["Extended"], "Bool"),
                            const("other", "Extended"),
                        ),
                        STATEMENT.assumptions,
                        OVER_EXTENDED,
                        {**STATEMENT.show, "causal part with the values that are assigned": "(causal extended)"},
                    ).with_also(
                        "two extensions of one scenario, one of which has the values that are assigned",
                        conj(
                            "(distinct extended other)",
                            forall(EXTENDED_RUN, "(and (or (= s extended) (= s other)) (= r run))"),
                            forall({"f": "Scenario"}, "(= f scenario)"),
                            "(assigned extended)",
                            "(not (assigned other))",
                        ),
                    ),
                ),
            ),
            interesting=conj("(continues extended run)", "(correct (own extended) run)", ONE),
        ),
    ),
)
