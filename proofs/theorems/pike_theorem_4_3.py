"""[PIKE] Theorem 4.3: correct executions of the plan and of the augmented plan correspond."""

from proofs.theorems._library.augmented import BY_EPSILON, EXCLUDED, HOLDS_NOW, PLAN, facts, rules, world
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, consts, forall, function, implies

SHOW = {
    "producer at": "(time producer)",
    "threat at": "(time threat)",
    "consumer at": "(time (consumer condition))",
    "threat said to be before": "(order-before condition producer threat)",
}
COMPLETE = "the execution of the plan is causally complete: each condition of an active consumer has a support"
TRACED = "the support variable names that support"
SIDES = "the order variable says on which side the threat is"
FORWARD = Statement(
    (*PLAN, *rules(), const("condition", "Condition"), *consts("Event", "producer", "threat")),
    {
        **facts(),
        COMPLETE: forall({"q": "Condition"}, implies("(active (consumer q))", "(supported-by q (support q))")),
        TRACED: forall({"q": "Condition"}, "(not (none q))"),
        SIDES: forall({"q": "Condition", "p": "Event", "t": "Event"}, "(= (order-before q p t) (< (time t) (time p)))"),
    },
    "(and (ordered condition) (theory condition))",
    SHOW,
)
THREE = "three events, one condition"
WORLD = conj(world("producer", "threat", "(consumer condition)"), "(= (support condition) producer)")
UNTRACED = Statement(
    (*PLAN, *rules(), const("condition", "Condition")),
    {"all support variables are ⊥": forall({"q": "Condition"}, "(none q)")},
    "(ordered condition)",
    {"consumer active": "(active (consumer condition))", "no support": "(none condition)"},
)
BACK = Statement(
    (
        "(declare-sort Constraint 0)",
        *(function(name, ["Constraint"], "Bool") for name in ("original", "augmented", "activated", "met")),
        *consts("Constraint", "constraint"),
    ),
    {
        "the augmented plan has all constraints of the plan": forall(
            {"c": "Constraint"}, "(=> (original c) (augmented c))"
        ),
        "the execution meets the constraints of the augmented plan that are activated": forall(
            {"c": "Constraint"}, "(=> (and (augmented c) (activated c)) (met c))"
        ),
    },
    "(=> (and (original constraint) (activated constraint)) (met constraint))",
    {"activated": "(activated constraint)", "met": "(met constraint)"},
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
            "A causally complete execution meets the added constraints and the theory, with the variables traced "
            "from it.",
            FORWARD,
            (
                Variant("the execution is not causally complete.", FORWARD.without(COMPLETE).with_also(THREE, WORLD)),
                Variant("the order variable may have any value.", FORWARD.without(SIDES).with_also(THREE, WORLD)),
                Variant("the distances may err.", FORWARD.without(HOLDS_NOW).with_also(THREE, WORLD)),
                Variant("producers may be left out for no reason.", FORWARD.without(EXCLUDED).with_also(THREE, WORLD)),
            ),
            (
                Variant(
                    "orderings by ε = 1/1000, as in Table 1: a producer at 0 and its consumer at 1/2000 are a correct "
                    "execution, which no support other than ⊥ allows in the augmented plan. Repair: strict "
                    "orderings; or claim only that some schedule exists (integer bounds, fewer than 1/ε events).",
                    Statement(
                        (*PLAN, *rules(BY_EPSILON), *FORWARD.declarations[-3:]),
                        FORWARD.assumptions,
                        FORWARD.claim,
                        SHOW,
                    )
                    .with_also(
                        "two events, one condition",
                        conj(world("producer", "(consumer condition)"), "(= (support condition) producer)"),
                    )
                    .with_also(
                        "their times",
                        "(and (= epsilon (/ 1.0 1000.0)) (= (time producer) 0.0) "
                        "(= (time (consumer condition)) (/ 1.0 2000.0)) (active (consumer condition)))",
                    ),
                ),
            ),
            interesting="(and (active (consumer condition)) (active threat) (deletes threat condition))",
        ),
        Lemma(
            "empty",
            "With ⊥ for all support variables, every execution meets the constraints that were added.",
            UNTRACED,
            (
                Variant(
                    "support variables name events.",
                    UNTRACED.with_changed("all support variables are ⊥", "(not (none condition))").with_also(
                        "one event, one condition", world("(consumer condition)")
                    ),
                ),
            ),
            interesting="(active (consumer condition))",
        ),
        Lemma(
            "backwards",
            "An execution that meets the constraints of the augmented plan meets those of the plan.",
            BACK,
            (
                Variant(
                    "constraints may have been replaced: Algorithm 9 overwrites the entry of two events that have "
                    "one already.",
                    BACK.without("the augmented plan has all constraints of the plan"),
                ),
            ),
        ),
    ),
)
