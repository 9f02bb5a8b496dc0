"""Simple temporal networks by their shortest distances: d(i, j) is the most that j may come after i."""

from __future__ import annotations

from proofs.theorems._library.terms import Command, Term, forall, function, sort

NETWORK: tuple[Command, ...] = (sort("Event"), function("d", ["Event", "Event"], "Real"))
TRIANGLE = "distances are shortest: no detour is shorter"
ZERO = "no event has a negative distance to itself (no negative cycle)"
SHORTEST: dict[str, Term] = {
    TRIANGLE: forall({"i": "Event", "j": "Event", "k": "Event"}, "(<= (d i k) (+ (d i j) (d j k)))"),
    ZERO: forall({"i": "Event"}, "(= (d i i) 0.0)"),
}
FINITE = (
    "All distances are finite: ∞ stands for a horizon beyond all bounds, within which every consistent network has "
    "a schedule."
)


def only(*events: str) -> Term:
    """There are these events, and no others."""
    among = " ".join(f"(= i {event})" for event in events)
    apart = f"(distinct {' '.join(events)})" if len(events) > 1 else "true"
    return f"(and {apart} {forall({'i': 'Event'}, f'(or {among} false)')})"
