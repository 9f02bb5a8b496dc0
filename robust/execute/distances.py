"""Lower bounds between time points, their longest paths, and which of them the others imply: exact, in integers.

`t_b − t_a ≤ u` is the lower bound −u from b to a, so one kind of edge is enough. Timed literals have fixed times and no
name in plan files: their edges become edges of zero.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from robust.plan.model import ZERO, TimePoint
from robust.plan.stn import STNConstraint


@dataclass(frozen=True, slots=True)
class Edge:
    """`t_target − t_source ≥ weight`."""

    source: TimePoint
    target: TimePoint
    weight: Fraction

    def holds(self, times: Mapping[TimePoint, Fraction]) -> bool:
        """Whether a schedule satisfies it."""
        return times[self.target] - times[self.source] >= self.weight

    def __str__(self) -> str:
        return f"{self.target} - {self.source} >= {self.weight}"


def edge(source: TimePoint, target: TimePoint, weight: Fraction) -> Edge:
    """The edge; the time of a timed literal at one of its ends goes into the weight."""
    begin, finish = source.time, target.time
    return Edge(
        source if begin is None else ZERO,
        target if finish is None else ZERO,
        weight + (begin or 0) - (finish or 0),
    )


def constraints_of(edges: Iterable[Edge], position: Mapping[TimePoint, int]) -> tuple[STNConstraint, ...]:
    """Edges as constraints of a plan, one for each pair, from the time point of lower `position` to that of higher.

    They are ordered by position of target, then source. Of several edges between the same points the strongest counts.
    """
    lower: dict[tuple[TimePoint, TimePoint], Fraction] = {}
    upper: dict[tuple[TimePoint, TimePoint], Fraction] = {}
    for one in edges:
        if one.source == one.target:
            continue
        if position[one.source] < position[one.target]:
            pair = (one.source, one.target)
            lower[pair] = max(one.weight, lower.get(pair, one.weight))
        else:
            pair = (one.target, one.source)
            upper[pair] = min(-one.weight, upper.get(pair, -one.weight))
    ordered = sorted({*lower, *upper}, key=lambda pair: (position[pair[1]], position[pair[0]]))
    return tuple(
        STNConstraint(target, source, lower.get((source, target)), upper.get((source, target)))
        for source, target in ordered
    )


class Paths:
    """Longest paths between all pairs of time points; weights are integers in units of a common denominator."""

    def __init__(self, points: Sequence[TimePoint], edges: Iterable[Edge]) -> None:
        edges = tuple(edges)
        self._index = {point: i for i, point in enumerate(points)}
        self._scale = lcm(*(one.weight.denominator for one in edges))
        size = len(points)
        self._longest: list[list[int | None]] = [[0 if a == b else None for b in range(size)] for a in range(size)]
        for one in edges:
            row, column = self._longest[self._index[one.source]], self._index[one.target]
            known, weight = row[column], int(one.weight * self._scale)
            row[column] = weight if known is None else max(known, weight)
        for middle, after in enumerate(self._longest):
            reached = [(b, weight) for b, weight in enumerate(after) if weight is not None]
            for row in self._longest:
                first = row[middle]
                if first is not None:
                    for b, weight in reached:
                        known = row[b]
                        if known is None or first + weight > known:
                            row[b] = first + weight

    def implied(self, source: TimePoint, target: TimePoint) -> Fraction | None:
        """The greatest lower bound of t_target − t_source; None if there is none."""
        found = self._longest[self._index[source]][self._index[target]]
        return None if found is None else Fraction(found, self._scale)


def earliest(points: Sequence[TimePoint], edges: Iterable[Edge]) -> dict[TimePoint, Fraction] | None:
    """The earliest schedule from zero that satisfies the edges; None if there is none."""
    outgoing: dict[TimePoint, list[Edge]] = {point: [] for point in points}
    for one in edges:
        outgoing[one.source].append(one)
    times = dict.fromkeys(points, Fraction(0))
    queue, waiting = deque(points), set(points)
    rounds = dict.fromkeys(points, 0)
    while queue:
        point = queue.popleft()
        waiting.discard(point)
        rounds[point] += 1
        if rounds[point] > len(points):  # Bellman and Ford: there is a cycle that never gets late enough
            return None
        for one in outgoing[point]:
            if times[one.target] < times[point] + one.weight:
                times[one.target] = times[point] + one.weight
                if one.target == ZERO:
                    return None
                if one.target not in waiting:
                    waiting.add(one.target)
                    queue.append(one.target)
    return times


def irredundant(points: Sequence[TimePoint], given: Sequence[Edge], edges: Sequence[Edge]) -> list[Edge]:
    """A subset of `edges` that with `given` implies all of them, and none of which the others imply.

    Edges that come first are the first to go. The edges must have a schedule.
    """
    paths = Paths(points, (*given, *edges))
    # A longer path than the edge itself cannot contain it, or there would be no schedule: all these go at once.
    tight = [one for one in dict.fromkeys(edges) if paths.implied(one.source, one.target) == one.weight]
    tight = [one for one in tight if one.source != one.target]
    kept = set(tight)
    adjacency: dict[TimePoint, list[Edge]] = {point: [] for point in points}
    for one in (*given, *tight):
        adjacency[one.source].append(one)
    always = frozenset(given)
    for one in tight:
        if one in always or _reaches(one, adjacency):
            adjacency[one.source].remove(one)
            kept.discard(one)
    return [one for one in tight if one in kept]


def is_implied(one: Edge, others: Iterable[Edge]) -> bool:
    """Whether every schedule of the other edges satisfies the edge; they must have a schedule."""
    adjacency: dict[TimePoint, list[Edge]] = {}
    for other in others:
        if other == one:
            return True
        adjacency.setdefault(other.source, []).append(other)
        adjacency.setdefault(other.target, [])
    return one.source in adjacency and _reaches(one, adjacency)


def _reaches(skipped: Edge, adjacency: Mapping[TimePoint, Sequence[Edge]]) -> bool:
    """Whether a path without that edge is as long."""
    longest = {skipped.source: Fraction(0)}
    queue = deque([skipped.source])
    while queue:
        point = queue.popleft()
        for one in adjacency[point]:
            length = longest[point] + one.weight
            if one != skipped and (one.target not in longest or length > longest[one.target]):
                longest[one.target] = length
                if one.target == skipped.target and length >= skipped.weight:
                    return True
                queue.append(one.target)
    return False
