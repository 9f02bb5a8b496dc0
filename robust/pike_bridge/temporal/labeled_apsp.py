"""Labeled all-pairs shortest paths [PIKE §4.1, Algorithm 9]: distances between events as functions of choices.

In each scenario that has a schedule the distances are those of Floyd and Warshall's algorithm. The pivots are ordered
and the rows of the matrix computed when they are first asked for; see :mod:`robust.pike_bridge.temporal.structural`.
"""

from __future__ import annotations

from fractions import Fraction
from heapq import heapify, heappop, heappush

from robust.pike_bridge.model import Environment, Tpnu
from robust.pike_bridge.temporal.distance_graph import LabeledNumbers, LabeledValue, distance_graph
from robust.pike_bridge.temporal.structural import Elimination, Entry
from robust.smt.limits import Deadline

NO_LIMIT = Deadline()


class LabeledDistances:
    """D of [PIKE, Algorithm 9], a :class:`~robust.pike_bridge.temporal.distance_graph.Precedence`.

    Rows are computed when they are first needed. So every method that takes events may raise OutOfTimeError, if the
    deadline has passed, and KeyError, if there is no such event.
    """

    def __init__(self, network: Tpnu, deadline: Deadline = NO_LIMIT, *, completions: bool = True) -> None:
        graph = distance_graph(network)
        self.vocabulary = graph.vocabulary
        self._graph = graph
        self._places = graph.places
        self._elimination = Elimination(graph, completions=completions, deadline=deadline)
        self._elimination.eliminate_all()
        self._paths = self._elimination.paths
        self._completions = completions
        self._rank = {event: rank for rank, event in enumerate(self._elimination.order)}
        self._rows: dict[int, list[LabeledNumbers]] = {}
        self._prime_conflicts: LabeledNumbers | None = None
        self._closed: dict[tuple[int, int], LabeledNumbers] = {}

    @property
    def conflicts(self) -> tuple[Environment, ...]:
        """Temporal conflicts of which none entails another [PIKE, Definition 4.1].

        A scenario has no schedule if and only if it entails one of them [PIKE, Theorem 4.1].
        """
        return _labels(self._paths.conflicts.labels)

    @property
    def prime_conflicts(self) -> tuple[Environment, ...]:
        """With completions, all the most general temporal conflicts, which may be many more; else as `conflicts`.

        An environment none of whose scenarios has a schedule entails one of them.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        return _labels(self._primes())

    def conflicting(self, environment: Environment) -> bool:
        """Whether the environment is a temporal conflict; without completions, whether it is known to be one.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        return self._primes().query(environment) is not None

    def _primes(self) -> LabeledNumbers:
        if self._prime_conflicts is None:
            self._prime_conflicts = LabeledNumbers(self.vocabulary, self._paths.conflicts.labels)
            if self._completions:
                self._prime_conflicts.close(self._paths.deadline)
        return self._prime_conflicts

    def query(self, source: str, target: str, environment: Environment = 0) -> Fraction | None:
        """The least known bound on t(target) − t(source) wherever both events and the environment hold; None for ∞.

        For scenarios that have a schedule it is the distance between the events. With completions it is, for every
        environment, the greatest of these distances over its scenarios that have a schedule; without, it may be more.
        Without meaning, though sound, if the environment contradicts the events' guards or is a conflict.
        """
        first, second = self._places[source], self._places[target]
        found = self._distances(first, second).query(environment & ~self._both(first, second))
        return None if found is None else Fraction(found, self._graph.scale)

    def labeled(self, source: str, target: str) -> tuple[LabeledValue[Fraction], ...]:
        """The entry of two events by increasing distance, with labels modulo the guards of both."""
        entry = self._distances(self._places[source], self._places[target])
        return tuple((Fraction(value, self._graph.scale), label) for value, label in entry)

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        """first ≺ second in the context [PIKE, Definition 4.2]; False if the context is impossible with the events."""
        before, after = self._places[first], self._places[second]
        both = self._both(before, after)
        whole = context | both
        if not self.vocabulary.consistent(whole) or self.conflicting(whole):
            return False
        found = self._distances(after, before).query(context & ~both)
        return found is not None and found < 0

    def _both(self, first: int, second: int) -> Environment:
        return self._graph.guards[first] | self._graph.guards[second]

    def _distances(self, source: int, target: int) -> LabeledNumbers:
        if (source, target) not in self._closed:
            if source not in self._rows:
                self._rows[source] = self._row(source)
            self._closed[source, target] = self._close(self._rows[source][target], self._both(source, target))
        return self._closed[source, target]

    def _row(self, source: int) -> list[LabeledNumbers]:
        """The distances from one event to all: along later events first, then back to earlier ones.

        Every shortest path can be had in this form once events are eliminated [Planken et al. 2012].
        """
        row = [LabeledNumbers(self.vocabulary) for _ in self._graph.events]
        row[source].add(0, 0)
        self._climb(source, row)
        for event in reversed(self._elimination.order):
            if event != source:
                for middle, distances in self._elimination.before[event].items():
                    self._extend(row, source, middle, event, distances)
        return row

    def _climb(self, source: int, row: list[LabeledNumbers]) -> None:
        reached, ranks = {source}, [self._rank[source]]
        heapify(ranks)
        while ranks:
            middle = self._elimination.order[heappop(ranks)]
            for event, distances in self._elimination.after[middle].items():
                self._extend(row, source, middle, event, distances)
                if event not in reached:
                    reached.add(event)
                    heappush(ranks, self._rank[event])

    def _extend(
        self, row: list[LabeledNumbers], source: int, middle: int, event: int, distances: LabeledNumbers
    ) -> None:
        if len(row[middle]) and self.vocabulary.consistent(self._both(source, event)):
            self._paths.join(row[middle], distances, middle, Entry(row[event], self._both(source, event)))

    def _close(self, entry: LabeledNumbers, both: Environment) -> LabeledNumbers:
        """The entry with what follows because conflicts do not happen: in them, every bound holds."""
        conflicts = _labels(self._primes())
        if not self._completions or not conflicts or not len(entry):
            return entry
        least = entry.pairs()[0][0] - 1
        whole = LabeledNumbers(self.vocabulary, entry)
        whole.merge((least, conflict & ~both) for conflict in conflicts if self.vocabulary.consistent(conflict | both))
        whole.close(self._paths.deadline)
        return LabeledNumbers(self.vocabulary, (pair for pair in whole if pair[0] > least))


def _labels(conflicts: LabeledNumbers) -> tuple[Environment, ...]:
    return tuple(label for _, label in conflicts)


def labeled_distances(network: Tpnu, deadline: Deadline = NO_LIMIT, *, completions: bool = True) -> LabeledDistances:
    """The labeled shortest paths of a network [PIKE, Algorithm 9], with or without completions [PIKE, Algorithm 10].

    Raises:
        OutOfTimeError: if the deadline passes, now or when a row is first asked for.
    """
    return LabeledDistances(network, deadline, completions=completions)
