"""Elimination of events from a labeled distance graph: the pivots of Algorithm 9, without the full matrix.

Floyd and Warshall's algorithm joins every pair of events through each pivot. It is enough to join those pairs that come
later in some order of the pivots: what is left of the graph then has, in every scenario, the same shortest paths and
a negative cycle if and only if there was one [Dechter, Meiri and Pearl 1991, directional path consistency]. The
shortest paths themselves follow from it row by row [Planken, de Weerdt and van der Krogt 2012].

The entry of two events matters only where both are activated. So labels are kept modulo the guards of the two events,
which are joined again wherever a path leads through an event: the guard of a constraint entails those of its events
[PIKE, Definition 2.1], so no path leads through an event that is not activated.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from robust.pike_bridge.model import Environment, Tpnu, Vocabulary, bits
from robust.pike_bridge.temporal.distance_graph import DistanceGraph, Edge, LabeledNumbers, distance_graph, union
from robust.smt.limits import Deadline

Neighbours: TypeAlias = dict[int, LabeledNumbers]


class Conflicts:
    """Environments in which no scenario has a schedule, only the most general ones [PIKE, Definition 4.1].

    They are not closed under completions as they are found: that every scenario without schedule entails one of them is
    enough to exclude these scenarios, and their closure may be a great many more.
    """

    def __init__(self, graph: DistanceGraph) -> None:
        self.labels: Final = LabeledNumbers(graph.vocabulary)

    def add(self, label: Environment) -> None:
        self.labels.add(0, label)

    def cover(self, environment: Environment) -> bool:
        """Whether the environment is known to be a conflict."""
        return self.labels.query(environment) is not None


class Paths:
    """How labeled distances are joined to longer ones, which is the body of the loops of [PIKE, Algorithm 9]."""

    def __init__(self, graph: DistanceGraph, *, completions: bool, deadline: Deadline) -> None:
        self.graph: Final = graph
        self.completions: Final = completions
        self.deadline: Final = deadline
        self.conflicts: Final = Conflicts(graph)

    def join(self, first: LabeledNumbers, second: LabeledNumbers, through: int, entry: Entry) -> None:
        """Merge the sums of the distances from `entry.source` to an event, and from there to `entry.target`."""
        vocabulary, covered = self.graph.vocabulary, self.conflicts.cover
        target, ends = entry.distances, entry.guard
        base = ends | self.graph.guards[through]
        if not vocabulary.consistent(base):
            return
        ceiling = target.unconditional()
        added = []
        others = second.pairs()
        for value, label in first.pairs():
            self.deadline.enforce()
            start = base | label
            if not vocabulary.consistent(start) or covered(start):
                continue
            for other, other_label in others:
                total = value + other
                if ceiling is not None and total >= ceiling:
                    break
                whole = start | other_label
                if vocabulary.consistent(whole) and not covered(whole) and target.add(total, whole & ~ends):
                    added.append(whole & ~ends)
        if self.completions and added:
            target.complete(union(added), self.deadline)

    def contradict(self, forth: LabeledNumbers, back: LabeledNumbers, guard: Environment) -> None:
        """Note as conflicts where two distances that lead to and fro add up to less than zero."""
        for value, label in forth.pairs():
            for other, other_label in back.pairs():
                if value + other >= 0:
                    break
                whole = guard | label | other_label
                if self.graph.vocabulary.consistent(whole):
                    self.conflicts.add(whole)


class Entry:
    """The distance from one event to another, as a function of choices, modulo the guards of both."""

    __slots__ = ("distances", "guard")

    def __init__(self, distances: LabeledNumbers, guard: Environment) -> None:
        self.distances = distances
        self.guard = guard


class Elimination:
    """A labeled distance graph whose events are eliminated, all or some.

    Raises:
        OutOfTimeError: from the methods that eliminate, if the deadline passes.
    """

    def __init__(self, graph: DistanceGraph, *, completions: bool, deadline: Deadline) -> None:
        self.paths: Final = Paths(graph, completions=completions, deadline=deadline)
        count = len(graph.events)
        self._guards = graph.guards
        self._consistent = graph.vocabulary.consistent
        self.after: Final[list[Neighbours]] = [{} for _ in range(count)]
        """By event, the distances from it to neighbours; once it is eliminated, only to those eliminated later."""
        self.before: Final[list[Neighbours]] = [{} for _ in range(count)]
        """By event, the distances to it from neighbours."""
        self.order: Final[list[int]] = []
        """The events that have been eliminated."""
        self._remaining: Final = set(range(count))
        self._read(graph)

    def eliminate_all(self) -> None:
        """Eliminate every event: those with few neighbours first, and of those the deepest inside of choices."""
        while self._remaining:
            self._eliminate(min(self._remaining, key=self._degree))

    def contract(self, growth: int) -> None:
        """Eliminate events as long as each adds at most `growth` more labeled distances than it removes."""
        waiting = deque(self._remaining)
        while waiting:
            event = waiting.popleft()
            if event in self._remaining and self._growth(event) <= growth:
                self._eliminate(event)
                waiting.extend((self.before[event].keys() | self.after[event].keys()) - set(waiting))

    def edges(self) -> Iterator[tuple[int, int, int, Environment]]:
        """Source, target, distance and full label of what is left between the events that are left."""
        for source in sorted(self._remaining):
            for target, distances in self.after[source].items():
                guard = self._guards[source] | self._guards[target]
                for value, label in distances:
                    yield source, target, value, label | guard

    def _read(self, graph: DistanceGraph) -> None:
        for edge in graph.edges:
            if edge.source != edge.target:
                entry = self._entry(edge.source, edge.target)
                entry.distances.add(edge.weight, edge.label & ~entry.guard)
            elif edge.weight < 0:
                self.paths.conflicts.add(edge.label)
        if self.paths.completions:
            for neighbours in self.after:
                for distances in neighbours.values():
                    distances.close(self.paths.deadline)

    def _entry(self, source: int, target: int) -> Entry:
        distances = self.after[source].get(target)
        if distances is None:
            distances = LabeledNumbers(self.paths.graph.vocabulary)
            self.after[source][target] = self.before[target][source] = distances
        return Entry(distances, self._guards[source] | self._guards[target])

    def _degree(self, event: int) -> tuple[int, int, int]:
        degree = len(self.after[event].keys() | self.before[event].keys())
        return degree, -self._guards[event].bit_count(), event

    def _growth(self, event: int) -> int:
        """At most so many labeled distances more than now are there without the event."""
        into = sum(map(len, self.before[event].values()))
        out = sum(map(len, self.after[event].values()))
        return into * out - into - out

    def _eliminate(self, event: int) -> None:
        guards, paths = self._guards, self.paths
        self._remaining.remove(event)
        self.order.append(event)
        before, after = self.before[event], self.after[event]
        for source in before.keys() & after.keys():
            paths.contradict(before[source], after[source], guards[source] | guards[event])
        for source, first in before.items():
            del self.after[source][event]
            for target, second in after.items():
                if target != source and self._consistent(guards[source] | guards[target]):
                    self._join(source, target, first, second, event)
        for target in after:
            del self.before[target][event]

    def _join(self, source: int, target: int, first: LabeledNumbers, second: LabeledNumbers, event: int) -> None:
        known = target in self.after[source]
        entry = self._entry(source, target)
        self.paths.join(first, second, event, entry)
        if not known and not len(entry.distances):
            del self.after[source][target], self.before[target][source]


NO_LIMIT = Deadline()
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

    def __init__(self, network: Tpnu, deadline: Deadline = NO_LIMIT, *, contextual: bool = False) -> None:
        graph = distance_graph(network)
        self.vocabulary: Vocabulary = graph.vocabulary
        self._graph: DistanceGraph = graph
        self._places = graph.places
        self._contextual = contextual
        self._deadline = deadline
        self._incoming: dict[int, list[Edge]] = defaultdict(list)
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
    network: Tpnu, deadline: Deadline = NO_LIMIT, *, contextual: bool = False
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
