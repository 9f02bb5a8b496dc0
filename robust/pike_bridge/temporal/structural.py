"""Precedence by the structure of a plan: unlabeled lower bounds, by cases on single choices, without labeled distances.

Sound and much cheaper than labeled shortest paths, but not complete.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from robust.pike_bridge.model import Environment, Tpnu, Vocabulary, bits
from robust.pike_bridge.temporal.distance_graph import DistanceEdge, DistanceGraph, distance_graph
from robust.smt.limits import NEVER, Deadline

ROUNDS = 50
"""Rounds over all events after which bounds are taken as they are; more are needed only around positive cycles."""

Arrival: TypeAlias = tuple[int, int]
"""An earlier event, and the least time from it."""
Cases: TypeAlias = tuple[tuple[Arrival, ...], ...]
"""For each value of a choice, alternatives of which every one holds."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """What an event's time is at least, in the scenarios of one environment that activate it."""

    event: int
    always: tuple[Arrival, ...]
    by_cases: tuple[Cases, ...]


class StructuralPrecedence:
    """Precedence by unlabeled lower bounds, a :class:`~robust.pike_bridge.temporal.distance_graph.Precedence`.

    With `contextual`, bounds are computed for each context that is asked about, instead of for the events' guards only.
    """

    def __init__(self, network: Tpnu, deadline: Deadline = NEVER, *, contextual: bool = False) -> None:
        graph = distance_graph(network)
        self.vocabulary: Vocabulary = graph.vocabulary
        self._graph: DistanceGraph = graph
        self._places = graph.places
        self._contextual = contextual
        self._deadline = deadline
        self._incoming: dict[int, list[DistanceEdge]] = defaultdict(list)
        for edge in graph.edges:
            # Seen by its source, an edge is a lower bound: t(source) ≥ t(target) − weight.
            self._incoming[edge.source].append(edge)
        self._order = _order(graph)
        self._bounds: dict[Environment, list[Bounds]] = {}
        self._rows: dict[tuple[int, Environment], list[int | None]] = {}

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        """first ≺ second, by a positive lower bound that holds whenever both events and the context do.

        False if the context is impossible with the events.

        Raises:
            KeyError: if there is no such event.
            OutOfTimeError: if the deadline has passed.
        """
        before, after = self._places[first], self._places[second]
        guards = self._graph.guards
        if not self.vocabulary.consistent(context | guards[before] | guards[after]):
            return False
        bound = self._row(before, context if self._contextual else 0)[after]
        return bound is not None and bound > 0

    def conflicting(self, environment: Environment) -> bool:
        """Whether the environment contradicts itself: conflicts of times are not looked for."""
        return not self.vocabulary.consistent(environment)

    def _row(self, source: int, context: Environment) -> list[int | None]:
        whole = context | self._graph.guards[source]
        if (source, whole) not in self._rows:
            self._deadline.enforce()
            self._rows[source, whole] = self._longest(source, self._bounds_in(whole))
        return self._rows[source, whole]

    def _longest(self, source: int, bounds: Sequence[Bounds]) -> list[int | None]:
        """Lower bounds on the time from one event to all, by relaxation until nothing changes."""
        lower: list[int | None] = [None] * len(self._graph.events)
        lower[source] = 0
        for _ in range(ROUNDS):
            changed = False
            for bound in bounds:
                found = _best(lower, bound)
                known = lower[bound.event]
                if found is not None and (known is None or found > known):
                    lower[bound.event] = found
                    changed = True
            if not changed:
                break
        return lower

    def _bounds_in(self, environment: Environment) -> list[Bounds]:
        """The bounds that count if the environment and the guard of the later event hold."""
        if environment not in self._bounds:
            found = (self._bounds_of(event, environment) for event in self._order)
            self._bounds[environment] = [bound for bound in found if bound is not None]
        return self._bounds[environment]

    def _bounds_of(self, event: int, environment: Environment) -> Bounds | None:
        whole = environment | self._graph.guards[event]
        if not self.vocabulary.consistent(whole):
            return None
        always: dict[int, int] = {}
        by_assignment: dict[int, list[Arrival]] = defaultdict(list)
        for edge in self._incoming[event]:
            missing = edge.label & ~whole & self.vocabulary.made
            if not missing:
                always[edge.target] = max(-edge.weight, always.get(edge.target, -edge.weight))
            elif missing & (missing - 1) == 0 and self.vocabulary.consistent(edge.label | whole):
                by_assignment[missing].append((edge.target, -edge.weight))
        return Bounds(event, tuple(always.items()), tuple(self._cases(by_assignment)))

    def _cases(self, by_assignment: Mapping[int, list[Arrival]]) -> Iterable[Cases]:
        """The choices for each of whose values something is known, by the bit of the assignment."""
        for bit in by_assignment:
            field = self.vocabulary.field(self.vocabulary.assignments[bit.bit_length() - 1].variable)
            values = [1 << position for position in bits(field)]
            if bit == values[0] and all(value in by_assignment for value in values):
                yield tuple(tuple(by_assignment[value]) for value in values)


def structural_precedence(
    network: Tpnu, deadline: Deadline = NEVER, *, contextual: bool = False
) -> StructuralPrecedence:
    """Precedence by the structure of a network; what it computes, it computes when asked."""
    return StructuralPrecedence(network, deadline, contextual=contextual)


def _best(lower: Sequence[int | None], bound: Bounds) -> int | None:
    """The greatest lower bound that follows for an event from those of the events before it."""
    best = _greatest(lower, bound.always)
    for cases in bound.by_cases:
        least = _least(lower, cases)
        if least is not None and (best is None or least > best):
            best = least
    return best


def _greatest(lower: Sequence[int | None], arrivals: Iterable[Arrival]) -> int | None:
    best: int | None = None
    for event, delay in arrivals:
        known = lower[event]
        if known is not None and (best is None or known + delay > best):
            best = known + delay
    return best


def _least(lower: Sequence[int | None], cases: Cases) -> int | None:
    """The least of what the cases give; None if nothing is known of one of them."""
    least: int | None = None
    for arrivals in cases:
        found = _greatest(lower, arrivals)
        if found is None:
            return None
        least = found if least is None else min(least, found)
    return least


def _order(graph: DistanceGraph) -> list[int]:
    """The events so that most constraints lead forward: by the length of the longest chain of positive lower bounds."""
    depth = [0] * len(graph.events)
    forward = [(edge.target, edge.source) for edge in graph.edges if edge.weight < 0 and edge.source != edge.target]
    for _ in range(len(depth)):
        changed = False
        for before, after in forward:
            if depth[after] <= depth[before] < len(depth):
                depth[after] = depth[before] + 1
                changed = True
        if not changed:
            break
    return sorted(range(len(depth)), key=depth.__getitem__)
