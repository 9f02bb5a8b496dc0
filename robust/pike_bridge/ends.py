"""The events of the initial state and of the goal, which are before and after all others [PIKE §4.4]."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction

from robust.pike_bridge.model import GOAL, INITIAL, Constraint, Event, Tpnu


def with_ends(network: Tpnu, epsilon: Fraction) -> Tpnu:
    """The network with `e_initial` and `e_goal`, added if missing, every other event between them.

    An event is constrained to be ε after `e_initial` unless it follows anyway: along constraints with lower bounds of
    at least zero that hold whenever the event is activated, the first of them at least ε after `e_initial`. Likewise
    for `e_goal`.
    """
    names = {event.name for event in network.events}
    before = () if INITIAL in names else (Event(INITIAL),)
    after = () if GOAL in names else (Event(GOAL),)
    complete = replace(network, events=(*before, *network.events, *after))
    inner = [event for event in complete.events if event.name not in {INITIAL, GOAL}]
    to_goal = [
        Constraint(event.name, GOAL, epsilon, None, event.guard)
        for event in _unconnected(inner, GOAL, _Links(complete, epsilon, forward=False))
    ]
    complete = replace(complete, constraints=(*complete.constraints, *to_goal))
    from_initial = [
        Constraint(INITIAL, event.name, epsilon, None, event.guard)
        for event in _unconnected([*inner, Event(GOAL)], INITIAL, _Links(complete, epsilon, forward=True))
    ]
    return replace(complete, constraints=(*complete.constraints, *from_initial))


def _unconnected(events: Iterable[Event], end: str, links: _Links) -> list[Event]:
    """A small set of events from which, with the end, all others are reached."""
    reached: set[str] = set()
    links.reach(end, reached)
    chosen = []
    # Events that nothing leads to first: what is left then lies on cycles, and one event of each cycle will do.
    for event in sorted(events, key=lambda event: event.name in links.entered):
        if event.name not in reached:
            chosen.append(event)
            links.reach(event.name, reached)
    return chosen


class _Links:
    """For each event, those that certainly follow it (or precede it) whenever they are activated themselves."""

    def __init__(self, network: Tpnu, epsilon: Fraction, *, forward: bool) -> None:
        self._following: dict[str, list[str]] = {}
        self.entered: set[str] = set()
        guards = network.guards
        end = INITIAL if forward else GOAL
        for constraint in network.temporal_constraints:
            near, far = constraint.source, constraint.target
            if not forward:
                near, far = far, near
            least = epsilon if near == end else 0
            if constraint.lower is None or constraint.lower < least or near == far:
                continue
            if constraint.guard <= guards[far]:
                self._following.setdefault(near, []).append(far)
                self.entered.add(far)

    def reach(self, start: str, reached: set[str]) -> None:
        """Add all that certainly follows an event."""
        pending = [start]
        while pending:
            event = pending.pop()
            if event not in reached:
                reached.add(event)
                pending.extend(self._following.get(event, ()))
