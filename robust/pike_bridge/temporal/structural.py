"""Precedence by the structure of a plan: unlabeled lower bounds, by cases on single choices, without labeled distances.

Sound and much cheaper than labeled shortest paths, but not complete.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from fractions import Fraction
from math import inf
from typing import TypeAlias

from robust.pike_bridge.model import Environment, Tpnu, Vocabulary, bits
from robust.pike_bridge.temporal.distance_graph import DistanceEdge, DistanceGraph, distance_graph
from robust.smt.limits import NEVER, Deadline

ROUNDS = 50
"""Rounds over all events after which bounds are taken as they are; more are needed only around positive cycles."""

Arrival: TypeAlias = tuple[int, int]
"""An earlier event, and the least time from it."""
Cases: TypeAlias = Sequence[Sequence[Arrival]]
"""Alternatives of which at least one holds, each of arrivals that then all hold: one for each value of a choice."""


class StructuralPrecedence:
    """Precedence by unlabeled lower bounds, a :class:`~robust.pike_bridge.temporal.distance_graph.Precedence`.

    Contexts only tell what is impossible: what counts are the guards of the two events. All is computed when asked.
    """

    def __init__(self, network: Tpnu, deadline: Deadline = NEVER, *, epsilon: Fraction = Fraction(0)) -> None:
        graph = distance_graph(network)
        self._least = epsilon * graph.scale
        self.vocabulary: Vocabulary = graph.vocabulary
        self._guards = graph.guards
        self._places = graph.places
        self._deadline = deadline
        self._incoming: dict[int, list[DistanceEdge]] = defaultdict(list)
        for edge in graph.edges:
            # Seen by its source, an edge is a lower bound: t(source) ≥ t(target) − weight.
            self._incoming[edge.source].append(edge)
        self._order = _order(graph)
        self._bounds: dict[Environment, list[tuple[int, Sequence[Cases]]]] = {}
        self._rows: dict[int, list[float]] = {}

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        """first ≺ second, by a positive lower bound, of at least ε, that holds whenever both events and the context do.

        False if the context is impossible with the events.

        Raises:
            KeyError: if there is no such event.
            OutOfTimeError: if the deadline has passed.
        """
        before, after = self._places[first], self._places[second]
        if self.conflicting(context | self._guards[before] | self._guards[after]):
            return False
        if before not in self._rows:
            self._deadline.enforce()
            self._rows[before] = self._longest(before)
        return 0 < self._rows[before][after] >= self._least

    def conflicting(self, environment: Environment) -> bool:
        """Whether the environment contradicts itself: conflicts of times are not looked for."""
        return not self.vocabulary.consistent(environment)

    def _longest(self, source: int) -> list[float]:
        """Lower bounds on the time from one event to all, −∞ for none, by relaxation until nothing changes."""
        guard = self._guards[source]
        if guard not in self._bounds:
            self._bounds[guard] = [(event, self._bounds_of(event, guard)) for event in self._order]
        lower = [-inf] * len(self._guards)
        lower[source] = 0
        for _ in range(ROUNDS):
            changed = False
            for event, bounds in self._bounds[guard]:
                for cases in bounds:
                    found = min(max(lower[other] + delay for other, delay in arrivals) for arrivals in cases)
                    if found > lower[event]:
                        lower[event] = found
                        changed = True
            if not changed:
                break
        return lower

    def _bounds_of(self, event: int, environment: Environment) -> list[Cases]:
        """What the event's time is at least, in the scenarios of an environment that activate it."""
        whole = environment | self._guards[event]
        if not self.vocabulary.consistent(whole):
            return []
        found: dict[int, list[Arrival]] = defaultdict(list)
        """By the bit of an assignment, or 0 for what always holds."""
        for edge in self._incoming[event]:
            missing = edge.label & ~whole & self.vocabulary.made
            if missing & (missing - 1) == 0 and self.vocabulary.consistent(edge.label | whole):
                found[missing].append((edge.target, -edge.weight))
        assigned = [self.vocabulary.assignments[bit.bit_length() - 1].variable for bit in found if bit]
        fields = [self.vocabulary.field(variable) for variable in dict.fromkeys(assigned)]
        by_value = [[1 << position for position in bits(field)] for field in fields]
        covered: list[Cases] = [[found[bit] for bit in values] for values in by_value if found.keys() >= set(values)]
        return [[found[0]], *covered] if 0 in found else covered


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
