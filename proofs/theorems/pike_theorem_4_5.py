"""[PIKE] Theorem 4.5: temporally consistent executions of the augmented plan that satisfy its theory are correct."""

from proofs.theorems._library.augmented import (
    EXCLUDED,
    EXTENDED_RUN,
    HOLDS_NOW,
    ITSELF_EXCLUDED,
    NAMED,
    PLAN,
    facts,
    rules,
    world,
)
from proofs.theorems._library.model import Lemma, Result, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import const, consts, forall, implies

COMPLETE = Result(
    "pike_theorem_4_5",
    "complete",
    "Theorem 4.5: consistent executions that satisfy the theory are causally complete",
    forall(EXTENDED_RUN, "(=> (and (causal s) (consistent s r)) (complete (own s) r))"),
)
SHOW = {
    "producer at": "(time run producer)",
    "threat at": "(time run threat)",
    "consumer at": "(time run (consumer condition))",
    "producer active": "(active scenario producer)",
    "threat active": "(active scenario threat)",
    "the support is the producer": "(= (support extended condition) producer)",
    "no support": "(none extended condition)",
}
STATEMENT = Statement(
    (*PLAN, *rules(), *NAMED, const("condition", "Condition"), *consts("Event", "producer", "threat")),
    facts(),
    COMPLETE.formula,
    SHOW,
)
UNCONSTRAINED = Statement(
    (*PLAN, *rules(consistent="(meets (own s) r)"), *STATEMENT.declarations[-6:]), facts(), COMPLETE.formula, SHOW
)
THREE = "three events, one condition, one execution"
WORLD = world("producer", "threat", "(consumer condition)")

THEOREM = Theorem(
    name="pike_theorem_4_5",
    title="Consistent executions of the augmented plan are correct",
    source="[PIKE, Theorem 4.5]",
    words="Every temporally consistent execution of the augmented plan whose scenario satisfies the theory is causally "
    "complete: each condition of an active event has a producer strictly before it and no active threat from the "
    "one to the "
    "other. Algorithm 5 must look at the consumer's own event, too, or a threat there is missed.",
    formalisation="Executions with arbitrarily many events and conditions, the rules of Algorithm 5 and Table 1 "
    "with the "
    "cases of Figure 12 for the precedences that the distances tell; these hold in every execution that meets the "
    "constraints of the plan. Orderings are "
    "strict "
    "(ε → 0).",
    scope=Scope.GENERAL,
    bound="any number of events, conditions, producers and threats; any execution.",
    lemmas=(
        Lemma(
            "complete",
            "Every consistent execution of the augmented plan that satisfies the theory is causally complete.",
            STATEMENT,
            (
                Variant(
                    "the theory is not asked for.",
                    STATEMENT.claiming(
                        forall(EXTENDED_RUN, implies("(consistent s r)", "(complete (own s) r)"))
                    ).with_also(THREE, WORLD),
                ),
                Variant("the added constraints are not met.", UNCONSTRAINED.with_also(THREE, WORLD)),
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
                        "(and (= threat (consumer condition)) (deletes threat condition) (= (time run producer) 0.0) "
                        "(= (time run threat) 1.0) (not (deletes producer condition)))",
                    ),
                ),
            ),
            interesting="(and (causal extended) (consistent extended run) (active scenario (consumer condition)) "
            "(deletes threat condition) (active scenario threat) (< (time run threat) (time run producer)) "
            "(= (support extended condition) producer) " + WORLD + ")",
        ),
    ),
)
