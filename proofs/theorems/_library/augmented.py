"""The augmented plan of [PIKE, Algorithm 5] in one execution: links, orders, and the cases of Figure 12."""

from __future__ import annotations

from proofs.theorems._library.terms import Command, Term, conj, consts, define, disj, forall, function, implies, sort

QPT = {"q": "Condition", "p": "Event", "t": "Event"}
CASES = ("producer-threat", "threat-producer", "threat-consumer", "consumer-threat")
"""Precedences that the labeled distances tell for a condition, a producer and a threat: first before second, always."""

PLAN: tuple[Command, ...] = (
    sort("Event"),
    sort("Condition"),
    function("time", ["Event"], "Real"),
    function("active", ["Event"], "Bool"),
    function("consumer", ["Condition"], "Event"),
    *(function(name, ["Event", "Condition"], "Bool") for name in ("adds", "deletes", "kept")),
    *(function(name, ["Condition", "Event", "Event"], "Bool") for name in CASES),
    function("support", ["Condition"], "Event"),
    function("none", ["Condition"], "Bool"),
    function("order-before", ["Condition", "Event", "Event"], "Bool"),
)
"""Events, conditions with their consumers, precedences, and the values of the support and order variables."""

STRICTLY = "(< (time e) (time f))"
BY_EPSILON = "(<= (+ (time e) epsilon) (time f))"

HOLDS_NOW = "precedences that the distances tell hold in this execution"
EXCLUDED = "an event that is not considered comes after the consumer, if both are active"


def rules(ahead: Term = STRICTLY) -> tuple[Command, ...]:
    """What Algorithm 5 adds, for a condition: temporal constraints on execution, and the theory; `ahead` orders "
    "events."""
    undecided = "(and (not (producer-threat q p t)) (not (threat-producer q p t)))"
    loose = "(and (not (threat-consumer q p t)) (not (consumer-threat q p t)))"
    cases = conj(
        implies(conj("(producer-threat q p t)", loose), "(ahead (consumer q) t)"),
        implies(conj(undecided, "(threat-consumer q p t)"), "(ahead t p)"),
        implies(
            conj(undecided, loose),
            "(ite (order-before q p t) (ahead t p) (ahead (consumer q) t))",
        ),
    )
    linked = "(and (active (consumer q)) (not (none q)) (active (support q)))"
    threats = "(and (deletes t q) (kept t q) (active t))"
    return (
        const_epsilon(),
        define("ahead", {"e": "Event", "f": "Event"}, "Bool", ahead),
        define("resolved", QPT, "Bool", cases),
        define("definite", QPT, "Bool", "(and (producer-threat q p t) (threat-consumer q p t))"),
        define(
            "ordered",
            {"q": "Condition"},
            "Bool",
            implies(
                linked,
                conj(
                    "(ahead (support q) (consumer q))",
                    forall({"t": "Event"}, implies(threats, "(resolved q (support q) t)")),
                ),
            ),
        ),
        define(
            "theory",
            {"q": "Condition"},
            "Bool",
            implies(
                "(active (consumer q))",
                conj(
                    "(not (none q))",
                    "(adds (support q) q)",
                    "(kept (support q) q)",
                    "(active (support q))",
                    forall({"t": "Event"}, implies(threats, "(not (definite q (support q) t))")),
                ),
            ),
        ),
        define(
            "supported-by",
            {"q": "Condition", "p": "Event"},
            "Bool",
            conj(
                "(adds p q)",
                "(active p)",
                "(< (time p) (time (consumer q)))",
                forall(
                    {"t": "Event"},
                    implies(
                        "(and (deletes t q) (active t))",
                        "(or (< (time t) (time p)) (< (time (consumer q)) (time t)))",
                    ),
                ),
            ),
        ),
    )


def const_epsilon() -> Command:
    return consts("Real", "epsilon")[0]


def facts() -> dict[str, Term]:
    """What precedences and the choice of candidates say about this execution."""
    everyone = "(and (active p) (active t) (active (consumer q)))"
    return {
        HOLDS_NOW: forall(
            QPT,
            implies(
                everyone,
                conj(
                    "(=> (producer-threat q p t) (< (time p) (time t)))",
                    "(=> (threat-producer q p t) (< (time t) (time p)))",
                    "(=> (threat-consumer q p t) (< (time t) (time (consumer q))))",
                    "(=> (consumer-threat q p t) (< (time (consumer q)) (time t)))",
                ),
            ),
        ),
        EXCLUDED: forall(
            {"q": "Condition", "e": "Event"},
            implies("(and (not (kept e q)) (active e) (active (consumer q)))", "(< (time (consumer q)) (time e))"),
        ),
    }


ITSELF_EXCLUDED: Term = forall(
    {"q": "Condition", "e": "Event"},
    implies(
        "(and (not (kept e q)) (active e) (active (consumer q)))",
        disj("(< (time (consumer q)) (time e))", "(= e (consumer q))"),
    ),
)
"""Line 5 of Algorithm 5 as printed: the consumer's own event is not looked at."""


def world(*events: str) -> Term:
    """These events, and one condition."""
    among = disj(*(f"(= e {event})" for event in events))
    apart = f"(distinct {' '.join(events)})" if len(events) > 1 else "true"
    return conj(apart, forall({"e": "Event"}, among), forall({"q": "Condition"}, "(= q condition)"))
