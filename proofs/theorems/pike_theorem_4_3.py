"""[PIKE] Theorem 4.3: correct executions of the plan and of the augmented plan correspond."""

from proofs.theorems._library.augmented import (
    BY_EPSILON,
    EXCLUDED,
    EXTENDED_RUN,
    HOLDS_NOW,
    NAMED,
    ONE,
    PLAN,
    REPLACED,
    RUN,
    facts,
    rules,
    world,
)
from proofs.theorems._library.model import Lemma, Result, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, consts, exists, forall, implies

FORWARDS = Result(
    "pike_theorem_4_3",
    "forwards",
    "Theorem 4.3: a correct execution has one of the augmented plan that satisfies the theory, with the same schedule",
    forall(
        RUN,
        implies("(correct f r)", "(and (= (own (traced f r)) f) (causal (traced f r)) (consistent (traced f r) r))"),
    ),
)
BACKWARDS = Result(
    "pike_theorem_4_3",
    "backwards",
    "Theorem 4.3, backwards: correct executions of the augmented plan are correct in the plan",
    forall(EXTENDED_RUN, "(=> (and (consistent s r) (complete (own s) r)) (correct (own s) r))"),
)
SHOW = {
    "producer at": "(time run producer)",
    "threat at": "(time run threat)",
    "consumer at": "(time run (consumer condition))",
    "threat said to be before": "(order-before extended condition producer threat)",
}
THREE = "three events, one condition, one execution"
VALUES = (*NAMED, const("condition", "Condition"), *consts("Event", "producer", "threat"))
EXTENDS = "the traced scenario makes the plan's own choices as they were made"
TRACED = "its support variables name a support, if there is one"
SIDES = "its order variables say on which side the threats are"
FORWARD = Statement(
    (*PLAN, *rules(), *VALUES),
    {
        **facts(),
        EXTENDS: forall(RUN, "(= (own (traced f r)) f)"),
        TRACED: forall(
            {**RUN, "q": "Condition"},
            conj(
                "(not (none (traced f r) q))",
                implies(
                    exists({"p": "Event"}, "(supported-by f r q p)"), "(supported-by f r q (support (traced f r) q))"
                ),
            ),
        ),
        SIDES: forall(
            {**RUN, "q": "Condition", "p": "Event", "t": "Event"},
            "(= (order-before (traced f r) q p t) (< (time r t) (time r p)))",
        ),
    },
    FORWARDS.formula,
    SHOW,
)
CORRECT = "(correct scenario run)"
WORLD = conj(world("producer", "threat", "(consumer condition)"), "(= (support extended condition) producer)")
UNTRACED = Statement(
    (*PLAN, *rules(), *NAMED, const("condition", "Condition")),
    {
        "all support variables are ⊥": forall({"q": "Condition"}, "(none extended q)"),
        "the schedule meets the constraints of the plan": "(meets (own extended) run)",
    },
    "(consistent extended run)",
    {"consumer active": "(active (own extended) (consumer condition))", "no support": "(none extended condition)"},
)
BACK = Statement(
    (*PLAN, *rules(), *VALUES),
    {},
    BACKWARDS.formula,
    {
        "constraints of the plan met": "(meets scenario run)",
        "of the augmented plan": "(consistent extended run)",
        "complete": "(complete scenario run)",
    },
)

THEOREM = Theorem(
    name="pike_theorem_4_3",
    title="Executions of the plan and of the augmented plan correspond",
    source="[PIKE, Theorem 4.3]",
    words="An execution of the plan is correct if and only if the augmented plan has a correct execution with the "
    "same schedule "
    "whose scenario extends it; and then there is one whose scenario satisfies the theory, which is what Theorems "
    "4.6 and "
    "4.7 need. Without that addition, the statement holds for an empty reason: all support variables at ⊥. With it, "
    "orderings must be strict: with [ε, ∞) the schedules in which a link is shorter than ε have no counterpart.",
    formalisation="As for Theorem 4.5. The support and order variables are traced from the execution: the support "
    "variable "
    "names a support, the order variable the side on which the threat is.",
    scope=Scope.GENERAL,
    bound="any number of events, conditions, producers and threats; any execution.",
    trusted="Both plans have the same events and effects, so that one schedule is causally complete in both or in "
    "neither.",
    lemmas=(
        Lemma(
            "forwards",
            "A correct execution meets the added constraints and the theory, with the variables traced from it.",
            FORWARD,
            (
                Variant(
                    "the execution is not causally complete.",
                    FORWARD.claiming(FORWARDS.formula.replace("(correct f r)", "(meets f r)")).with_also(THREE, WORLD),
                ),
                Variant("the support may be any event.", FORWARD.without(TRACED).with_also(THREE, WORLD)),
                Variant("the order variable may have any value.", FORWARD.without(SIDES).with_also(THREE, WORLD)),
                Variant("the distances may err.", FORWARD.without(HOLDS_NOW).with_also(THREE, WORLD)),
                Variant("producers may be left out for no reason.", FORWARD.without(EXCLUDED).with_also(THREE, WORLD)),
            ),
            (
                Variant(
                    "orderings by ε = 1/1000, as in Table 1: a producer at 0 and its consumer at 1/2000 are a correct "
                    "execution, which no support other than ⊥ allows in the augmented plan. Repair: strict "
                    "orderings; or claim only that some schedule exists (integer bounds, fewer than 1/ε events).",
                    Statement((*PLAN, *rules(BY_EPSILON), *VALUES), FORWARD.assumptions, FORWARD.claim, SHOW)
                    .with_also(
                        "two events, one condition, one execution",
                        conj(world("producer", "(consumer condition)"), "(= (support extended condition) producer)"),
                    )
                    .with_also(
                        "their times",
                        "(and (= epsilon (/ 1.0 1000.0)) (= (time run producer) 0.0) "
                        "(= (time run (consumer condition)) (/ 1.0 2000.0)) (active scenario (consumer condition)))",
                    ),
                ),
            ),
            interesting=conj(
                CORRECT,
                "(active scenario (consumer condition))",
                "(active scenario threat)",
                "(deletes threat condition)",
                WORLD,
            ),
        ),
        Lemma(
            "empty",
            "With ⊥ for all support variables, every execution meets the constraints that were added.",
            UNTRACED,
            (
                Variant(
                    "support variables name events.",
                    UNTRACED.with_changed("all support variables are ⊥", "(not (none extended condition))").with_also(
                        "one event, one condition, one execution", world("(consumer condition)")
                    ),
                ),
            ),
            interesting=conj("(active scenario (consumer condition))", world("(consumer condition)")),
        ),
        Lemma(
            "backwards",
            "A correct execution of the augmented plan is one of the plan.",
            BACK,
            (
                Variant(
                    "constraints may have been replaced: Algorithm 9 overwrites the entry of two events that have "
                    "one already.",
                    Statement(
                        (*PLAN, *rules(consistent=REPLACED), *VALUES), BACK.assumptions, BACK.claim, BACK.show
                    ).with_also("one execution", ONE),
                ),
            ),
            interesting=conj(CORRECT, WORLD),
        ),
    ),
)
