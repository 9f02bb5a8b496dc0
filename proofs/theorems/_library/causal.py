"""Events with times and effects on one condition, in one execution: the vocabulary of [PIKE, §4]."""

from __future__ import annotations

from proofs.theorems._library.terms import Command, Term, conj, consts, define, forall, function, implies, neg, sort

EVENT = {"e": "Event"}
EVENTS: tuple[Command, ...] = (
    sort("Event"),
    function("time", ["Event"], "Real"),
    *(function(name, ["Event"], "Bool") for name in ("active", "adds", "deletes")),
)
"""`adds` and `deletes` are the effects on the condition; `active` says which events the scenario activates."""


def supports(consumer: str, *, name: str = "supports", adds: str = "adds") -> Command:
    """A producer supports the consumer: active, strictly before it, and no active threat from the one to the other.

    Both ends count [PIKE, §4.3].
    """
    between = conj("(deletes t)", "(active t)", "(<= (time p) (time t))", f"(<= (time t) (time {consumer}))")
    return define(
        name,
        {"p": "Event"},
        "Bool",
        conj(f"({adds} p)", "(active p)", f"(< (time p) (time {consumer}))", forall({"t": "Event"}, neg(between))),
    )


def last_producer(last: str, consumer: str) -> Term:
    """If producers come before the consumer at all, one is the last of them: events are finitely many."""
    return forall(
        {"p": "Event"},
        implies(
            f"(and (adds p) (active p) (< (time p) (time {consumer})))",
            conj(
                f"(adds {last})",
                f"(active {last})",
                f"(< (time {last}) (time {consumer}))",
                f"(<= (time p) (time {last}))",
            ),
        ),
    )


def only(*events: str) -> Term:
    """There are these events, and no others."""
    among = " ".join(f"(= e {event})" for event in events)
    return conj(f"(distinct {' '.join(events)})", forall(EVENT, f"(or {among} false)"))


def told(*events: str) -> dict[str, Term]:
    """When the events happen, and which are active."""
    return {f"{event} at": f"(time {event})" for event in events} | {
        f"{event} active": f"(active {event})" for event in events
    }


def events(*names: str) -> tuple[Command, ...]:
    return consts("Event", *names)
