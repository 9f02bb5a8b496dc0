"""[PIKE] Theorem 4.5: temporally consistent executions of the augmented plan that satisfy its theory are correct."""

from proofs.theorems._library.augmented import EXCLUDED, HOLDS_NOW, ITSELF_EXCLUDED, PLAN, facts, rules, world
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import const, consts, exists, implies

SHOW = {
    "producer at": "(time producer)",
    "threat at": "(time threat)",
    "consumer at": "(time (consumer condition))",
    "producer active": "(active producer)",
    "threat active": "(active threat)",
    "the support is the producer": "(= (support condition) producer)",
    "no support": "(none condition)",
}
ORDERED = "the execution meets the constraints that were added, for an arbitrary condition"
THEORY = "the scenario satisfies the theory"
STATEMENT = Statement(
    (*PLAN, *rules(), const("condition", "Condition"), *consts("Event", "producer", "threat")),
    {**facts(), ORDERED: "(ordered condition)", THEORY: "(theory condition)"},
    implies("(active (consumer condition))", exists({"p": "Event"}, "(supported-by condition p)")),
    SHOW,
)
THREE = "three events, one condition"
WORLD = world("producer", "threat", "(consumer condition)")

THEOREM = Theorem(
    name="pike_theorem_4_5",
    title="Consistent executions of the augmented plan are correct",
    source="[PIKE, Theorem 4.5]",
    words="Every temporally consistent execution of the augmented plan whose scenario satisfies the theory is causally "
    "complete: each condition of an active event has a producer strictly before it and no active threat from the "
    "one to the "
    "other. Algorithm 5 must look at the consumer's own event, too, or a threat there is missed.",
    formalisation="One execution with arbitrarily many events and conditions, the rules of Algorithm 5 and Table 1 "
    "with the "
    "cases of Figure 12 for the precedences that the distances tell; these hold in this execution. Orderings are "
    "strict "
    "(ε → 0).",
    scope=Scope.GENERAL,
    bound="any number of events, conditions, producers and threats; any execution.",
    lemmas=(
        Lemma(
            "complete",
            "The condition of an active consumer has a support.",
            STATEMENT,
            (
                Variant("the theory is not asked for.", STATEMENT.without(THEORY).with_also(THREE, WORLD)),
                Variant("the added constraints are not met.", STATEMENT.without(ORDERED).with_also(THREE, WORLD)),
                Variant("the distances may err.", STATEMENT.without(HOLDS_NOW).with_also(THREE, WORLD)),
                Variant("threats may be left out for no reason.", STATEMENT.without(EXCLUDED).with_also(THREE, WORLD)),
            ),
            (
                Variant(
                    "line 5 leaves the consumer's own event out. If that event deletes the condition (the end of "
                    "another "
                    "activity may be there), it lies in the closed interval of §4.3 from producer to consumer, and "
                    "nothing "
                    "is added against it: producer at 0, consumer and threat at 1. Repair: a threat at the consumer's "
                    "event is a definite threat.",
                    STATEMENT.with_changed(EXCLUDED, ITSELF_EXCLUDED)
                    .with_also("two events, one condition", world("producer", "(consumer condition)"))
                    .with_also(
                        "the consumer's event deletes the condition",
                        "(and (= threat (consumer condition)) (deletes threat condition) (= (time producer) 0.0) "
                        "(= (time threat) 1.0) (not (deletes producer condition)))",
                    ),
                ),
            ),
            interesting="(and (active (consumer condition)) (deletes threat condition) (active threat) "
            "(< (time threat) (time (support condition))) (distinct threat (support condition)) "
            "(distinct (consumer condition) threat) " + WORLD.replace("producer", "(support condition)") + ")",
        ),
    ),
)
