"""The augmented plan of [PIKE, Algorithm 5] in its executions: links, orders, and the cases of Figure 12.

A `Scenario` assigns the plan's own choices, an `Extended` scenario the support and order variables, too; `own` forgets
these. A `Schedule` says when events happen.
"""

from __future__ import annotations

from proofs.theorems._library.terms import (
    Command,
    Term,
    conj,
    const,
    define,
    disj,
    exists,
    forall,
    function,
    implies,
    sort,
)

QPT = {"q": "Condition", "p": "Event", "t": "Event"}
RUN = {"f": "Scenario", "r": "Schedule"}
EXTENDED_RUN = {"s": "Extended", "r": "Schedule"}
CASES = ("producer-threat", "threat-producer", "threat-consumer", "consumer-threat")
"""Precedences that the labeled distances tell for a condition, a producer and a threat: first before second, always."""

EXECUTIONS: tuple[Command, ...] = (
    sort("Event"),
    sort("Scenario"),
    sort("Extended"),
    sort("Schedule"),
    function("own", ["Extended"], "Scenario"),
    function("time", ["Schedule", "Event"], "Real"),
)
PLAN: tuple[Command, ...] = (
    *EXECUTIONS,
    sort("Condition"),
    function("meets", ["Scenario", "Schedule"], "Bool"),
    function("active", ["Scenario", "Event"], "Bool"),
    function("consumer", ["Condition"], "Event"),
    *(function(name, ["Event", "Condition"], "Bool") for name in ("adds", "deletes", "kept")),
    *(function(name, ["Condition", "Event", "Event"], "Bool") for name in CASES),
    function("support", ["Extended", "Condition"], "Event"),
    function("none", ["Extended", "Condition"], "Bool"),
    function("order-before", ["Extended", "Condition", "Event", "Event"], "Bool"),
    function("traced", ["Scenario", "Schedule"], "Extended"),
)
"""Events, conditions with their consumers, precedences, and the values of the support and order variables.

`meets` says that a schedule meets the constraints of the plan itself.
"""

STRICTLY = "(< (time r e) (time r g))"
BY_EPSILON = "(<= (+ (time r e) epsilon) (time r g))"
AUGMENTED = "(and (meets (own s) r) (forall ((q Condition)) (ordered s r q)))"
"""The constraints of the augmented plan: those of the plan, and those that Algorithm 5 adds."""
REPLACED = "(forall ((q Condition)) (ordered s r q))"
"""Only those that it adds."""

HOLDS_NOW = "precedences that the distances tell hold in every execution that meets the plan's constraints"
EXCLUDED = "an event that is not considered comes after the consumer, if both are active"


def rules(ahead: Term = STRICTLY, consistent: Term = AUGMENTED) -> tuple[Command, ...]:
    """What Algorithm 5 adds, and what executions are; `ahead` orders two events."""
    undecided = "(and (not (producer-threat q p t)) (not (threat-producer q p t)))"
    loose = "(and (not (threat-consumer q p t)) (not (consumer-threat q p t)))"
    cases = conj(
        implies(conj("(producer-threat q p t)", loose), "(ahead r (consumer q) t)"),
        implies(conj(undecided, "(threat-consumer q p t)"), "(ahead r t p)"),
        implies(conj(undecided, loose), "(ite (order-before s q p t) (ahead r t p) (ahead r (consumer q) t))"),
    )
    linked = "(and (active (own s) (consumer q)) (not (none s q)) (active (own s) (support s q)))"
    threats = "(and (deletes t q) (kept t q) (active (own s) t))"
    ordered = conj(
        "(ahead r (support s q) (consumer q))",
        forall({"t": "Event"}, implies(threats, "(resolved s r q (support s q) t)")),
    )
    theory = conj(
        "(not (none s q))",
        "(adds (support s q) q)",
        "(kept (support s q) q)",
        "(active (own s) (support s q))",
        forall({"t": "Event"}, implies(threats, "(not (definite q (support s q) t))")),
    )
    return (
        const("epsilon", "Real"),
        define("ahead", {"r": "Schedule", "e": "Event", "g": "Event"}, "Bool", ahead),
        define("resolved", {**EXTENDED_RUN, **QPT}, "Bool", cases),
        define("definite", QPT, "Bool", "(and (producer-threat q p t) (threat-consumer q p t))"),
        define("ordered", {**EXTENDED_RUN, "q": "Condition"}, "Bool", implies(linked, ordered)),
        define("theory", {"s": "Extended", "q": "Condition"}, "Bool", implies("(active (own s) (consumer q))", theory)),
        *_supports(),
        define("consistent", EXTENDED_RUN, "Bool", consistent),
        define("causal", {"s": "Extended"}, "Bool", forall({"q": "Condition"}, "(theory s q)")),
    )


def _supports() -> tuple[Command, ...]:
    between = "(or (< (time r t) (time r p)) (< (time r (consumer q)) (time r t)))"
    return (
        define(
            "supported-by",
            {**RUN, "q": "Condition", "p": "Event"},
            "Bool",
            conj(
                "(adds p q)",
                "(active f p)",
                "(< (time r p) (time r (consumer q)))",
                forall({"t": "Event"}, implies("(and (deletes t q) (active f t))", between)),
            ),
        ),
        define(
            "complete",
            RUN,
            "Bool",
            forall(
                {"q": "Condition"}, implies("(active f (consumer q))", exists({"p": "Event"}, "(supported-by f r q p)"))
            ),
        ),
        define("correct", RUN, "Bool", "(and (meets f r) (complete f r))"),
    )


def facts() -> dict[str, Term]:
    """What precedences and the choice of candidates say about executions."""
    return {
        HOLDS_NOW: forall(
            {**RUN, **QPT},
            implies(
                "(and (meets f r) (active f p) (active f t) (active f (consumer q)))",
                conj(
                    "(=> (producer-threat q p t) (< (time r p) (time r t)))",
                    "(=> (threat-producer q p t) (< (time r t) (time r p)))",
                    "(=> (threat-consumer q p t) (< (time r t) (time r (consumer q))))",
                    "(=> (consumer-threat q p t) (< (time r (consumer q)) (time r t)))",
                ),
            ),
        ),
        EXCLUDED: _excluded("(< (time r (consumer q)) (time r e))"),
    }


def _excluded(where: Term) -> Term:
    return forall(
        {**RUN, "q": "Condition", "e": "Event"},
        implies("(and (meets f r) (not (kept e q)) (active f e) (active f (consumer q)))", where),
    )


ITSELF_EXCLUDED: Term = _excluded(disj("(< (time r (consumer q)) (time r e))", "(= e (consumer q))"))
"""Line 5 of Algorithm 5 as printed: the consumer's own event is not looked at."""


def world(*events: str) -> Term:
    """These events, one condition, one execution."""
    among = disj(*(f"(= e {event})" for event in events))
    apart = f"(distinct {' '.join(events)})" if len(events) > 1 else "true"
    return conj(apart, forall({"e": "Event"}, among), forall({"q": "Condition"}, "(= q condition)"), ONE)


ONE = conj(forall(EXTENDED_RUN, "(and (= s extended) (= r run))"), forall({"f": "Scenario"}, "(= f scenario)"))
"""One scenario, one extension, one schedule."""
NAMED: tuple[Command, ...] = (const("scenario", "Scenario"), const("extended", "Extended"), const("run", "Schedule"))
