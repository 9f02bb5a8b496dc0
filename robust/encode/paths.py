"""What a network of bounds between time points implies, by shortest paths in integers.

Points are numbers from 0, weights are integers: whoever builds a network scales everything by one common denominator,
once. A bound (a, b, w) says t_b − t_a ≥ w; an upper bound is a lower bound of the way back.

One feasible schedule turns every bound into a slack that is not negative (Johnson's potentials), so that rows of
greatest lower bounds come from Dijkstra's algorithm, and only for points that are asked about. Points whose distance
is fixed form one component: cycles without slack are found as strongly connected components of the bounds that the
schedule meets exactly. Most questions are only about order: they are answered by sets of points, one bit each.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from heapq import heappop, heappush
from itertools import pairwise

Bound = tuple[int, int, int]
"""(a, b, w): t_b − t_a ≥ w."""


def delay(times: list[int], following: Sequence[Sequence[tuple[int, int]]], sources: Iterable[int]) -> bool:
    """Delay times as little as bounds that leave these sources demand [Bellman and Ford, by a queue].

    `following` are the bounds of each point, as pairs of a later point and a weight. False if no delay is enough: some
    of the bounds contradict each other.
    """
    size = len(times)
    waiting = deque(sources)
    waits, rounds = [False] * size, [0] * size
    for point in waiting:
        waits[point] = True
    while waiting:
        point = waiting.popleft()
        waits[point] = False
        rounds[point] += 1
        if rounds[point] > size + 1:
            return False
        now = times[point]
        for target, weight in following[point]:
            if times[target] < now + weight:
                times[target] = now + weight
                if not waits[target]:
                    waits[target] = True
                    waiting.append(target)
    return True


class Paths:
    """Greatest lower bounds between the points of a network.

    Args:
        size: points are 0 … size − 1.
        bounds: the network.
        near: the distance, at least 1, that :meth:`at_least` answers without search where it can, as it does 0.
        schedule: times that satisfy the bounds, if some are known.

    `schedule` are the least times from 0 that satisfy the bounds, or those given; None if there are none, and nothing
    else has a meaning then.
    """

    def __init__(
        self, size: int, bounds: Iterable[Bound], *, near: int = 1, schedule: Sequence[int] | None = None
    ) -> None:
        self.size = size
        self._near = near
        strongest: dict[tuple[int, int], int] = {}
        for source, target, weight in bounds:
            pair = (source, target)
            known = strongest.get(pair)
            if known is None or known < weight:
                strongest[pair] = weight
        self._bounds = strongest
        self.schedule: Sequence[int] | None = self._least_times() if schedule is None else schedule

    def _least_times(self) -> list[int] | None:
        following: list[list[tuple[int, int]]] = [[] for _ in range(self.size)]
        for (source, target), weight in self._bounds.items():
            if source != target:
                following[source].append((target, weight))
            elif weight > 0:
                return None
        times = [0] * self.size
        return times if delay(times, following, range(self.size)) else None

    @property
    def _times(self) -> Sequence[int]:
        if self.schedule is None:
            raise ValueError("a network without schedule implies everything")
        return self.schedule

    # -- components and slack ------------------------------------------------------------------------------------------

    @cached_property
    def component(self) -> list[int]:
        """The component of every point: distances within one are the same in all schedules."""
        times = self._times
        tight: list[list[int]] = [[] for _ in range(self.size)]
        for (source, target), weight in self._bounds.items():
            if times[target] - times[source] == weight:
                tight[source].append(target)
        return _strong_components(tight)

    @cached_property
    def _slack(self) -> list[list[tuple[int, int]]]:
        """For each component the components that follow it, with the least slack of a bound between them."""
        times, component = self._times, self.component
        least: dict[tuple[int, int], int] = {}
        for (source, target), weight in self._bounds.items():
            pair = (component[source], component[target])
            if pair[0] != pair[1]:
                slack = times[target] - times[source] - weight
                least[pair] = min(slack, least.get(pair, slack))
        following: list[list[tuple[int, int]]] = [[] for _ in range(max(component, default=-1) + 1)]
        for (source, target), slack in least.items():
            following[source].append((target, slack))
        return following

    @cached_property
    def _rows(self) -> dict[int, list[int | None]]:
        return {}

    def _row(self, start: int) -> list[int | None]:
        """The least slack of a path from a component to each other; None where there is none."""
        row = self._rows.get(start)
        if row is None:
            following = self._slack
            row = self._rows[start] = [None] * len(following)
            row[start] = 0
            heap = [(0, start)]
            while heap:
                slack, one = heappop(heap)
                if row[one] == slack:
                    for other, more in following[one]:
                        known = row[other]
                        if known is None or slack + more < known:
                            row[other] = slack + more
                            heappush(heap, (slack + more, other))
        return row

    # -- what follows --------------------------------------------------------------------------------------------------

    def least(self, source: int, target: int) -> int | None:
        """The greatest w with t_target − t_source ≥ w in all schedules; None if there is none."""
        slack = self._row(self.component[source])[self.component[target]]
        return None if slack is None else self._times[target] - self._times[source] - slack

    def at_least(self, source: int, target: int, weight: int) -> bool:
        """Whether t_target − t_source ≥ weight in all schedules."""
        if self._times[target] - self._times[source] < weight:
            return False  # the schedule itself is one in which it is not
        if weight <= self._near and (self._reached[weight > 0][source] >> target) & 1:
            return True
        known = self.least(source, target)
        return known is not None and known >= weight

    @cached_property
    def _reached(self) -> tuple[list[int], list[int]]:
        """For each point the points surely not before it, and those surely `near` after it, as sets of bits.

        A path is seen if each of its steps leads forward, and for the second set if one of them is `near` long.
        """
        steps: tuple[list[list[int]], ...] = tuple([[] for _ in range(self.size)] for _ in range(2))
        for source, target, weight in self._forward_steps():
            steps[weight >= self._near][source].append(target)
        times = self._times
        order = sorted(range(self.size), key=times.__getitem__, reverse=True)
        reached, apart = [1 << point for point in range(self.size)], [0] * self.size
        changed = True
        while changed:  # steps between equal times may form circles
            changed = False
            for point in order:
                near, far = reached[point], apart[point]
                for target in steps[0][point]:
                    near |= reached[target]
                    far |= apart[target]
                for target in steps[1][point]:
                    far |= reached[target]
                near |= far
                if near != reached[point] or far != apart[point]:
                    reached[point], apart[point], changed = near, far, True
        return reached, apart

    def _forward_steps(self) -> Iterator[Bound]:
        """Steps that lead forward in every schedule; what steps within components imply further is left out."""
        times = self._times
        members: dict[int, list[int]] = defaultdict(list)
        for point in sorted(range(self.size), key=times.__getitem__):
            members[self.component[point]].append(point)
        for points in members.values():
            for first, second in pairwise(points):
                yield first, second, times[second] - times[first]
                if times[first] == times[second]:
                    yield second, first, 0
            yield from self._distant_members(points)
        places = {component: [times[point] for point in points] for component, points in members.items()}
        for source, following in enumerate(self._slack):
            for target, slack in following:
                later, at = members[target], places[target]
                for point in members[source]:
                    for distance in (0, self._near):
                        index = bisect_left(at, times[point] + distance + slack)
                        if index < len(later):
                            yield point, later[index], at[index] - times[point] - slack

    def _distant_members(self, points: Sequence[int]) -> Iterator[Bound]:
        """Within a component, the next point that is `near` away, where steps to neighbours are shorter."""
        times = self._times
        at = [times[point] for point in points]
        for point in points:
            index = bisect_left(at, times[point] + self._near)
            if index < len(points):
                yield point, points[index], at[index] - times[point]

    # -- what can go ---------------------------------------------------------------------------------------------------

    def needed(self, bounds: Iterable[Bound], given: Iterable[Bound] = ()) -> list[Bound]:
        """A subset of bounds of the network that implies them all together with those given.

        No bound between two components is in it that others imply. Of equal ones the first is kept.
        """
        times, component = self._times, self.component
        given = set(given)
        kept: list[Bound] = []
        inner: dict[int, list[Bound]] = defaultdict(list)
        best: dict[tuple[int, int], Bound] = {}
        for bound in dict.fromkeys(bounds):
            source, target, weight = bound
            pair = (component[source], component[target])
            if pair[0] == pair[1]:
                if times[target] - times[source] == weight and source != target:
                    inner[pair[0]].append(bound)
            else:
                best.setdefault(pair, bound)
                if self._slack_of(bound) < self._slack_of(best[pair]):
                    best[pair] = bound
        fixed = {(component[one[0]], component[one[1]]): self._slack_of(one) for one in given}
        direct = [dict(following) for following in self._slack]
        for (source, target), bound in best.items():
            slack = self._slack_of(bound)
            if fixed.get((source, target), slack + 1) <= slack:
                continue
            between = [one for one in self._slack[source] if one[0] != target and one[1] <= slack]
            # Mostly two bounds imply a third one, which takes no search.
            if any(first + direct[middle].get(target, slack + 1) <= slack for middle, first in between):
                continue
            if not any(
                (rest := self._row(middle)[target]) is not None and first + rest <= slack for middle, first in between
            ):
                kept.append(bound)
        for bounds_within in inner.values():
            kept += _spanning(bounds_within, [one for one in given if component[one[0]] == component[one[1]]], times)
        return kept

    def _slack_of(self, bound: Bound) -> int:
        return self._times[bound[1]] - self._times[bound[0]] - bound[2]


def _strong_components(following: Sequence[Sequence[int]]) -> list[int]:
    """The number of the strongly connected component of each node [Tarjan 1972], without recursion."""
    size = len(following)
    number, low, component = [-1] * size, [0] * size, [-1] * size
    stack: list[int] = []
    count = found = 0
    for root in range(size):
        if number[root] >= 0:
            continue
        work = [(root, iter(following[root]))]
        number[root] = low[root] = count
        count += 1
        stack.append(root)
        while work:
            node, rest = work[-1]
            for other in rest:
                if number[other] < 0:
                    number[other] = low[other] = count
                    count += 1
                    stack.append(other)
                    work.append((other, iter(following[other])))
                    break
                if component[other] < 0:
                    low[node] = min(low[node], number[other])
            else:
                work.pop()
                if work:
                    above = work[-1][0]
                    low[above] = min(low[above], low[node])
                if low[node] == number[node]:
                    while component[node] < 0:
                        component[stack.pop()] = found
                    found += 1
    return component


def _spanning(bounds: Sequence[Bound], given: Sequence[Bound], times: Sequence[int]) -> list[Bound]:
    """Of bounds that are met exactly in all schedules, as few as leave the distances fixed, one by one."""
    kept = list(bounds)
    for bound in reversed(bounds):
        rest = [one for one in kept if one != bound]
        following: dict[int, list[int]] = defaultdict(list)
        for source, target, weight in (*rest, *given):
            if times[target] - times[source] == weight:
                following[source].append(target)
        seen, waiting = {bound[0]}, [bound[0]]
        while waiting:
            for other in following[waiting.pop()]:
                if other not in seen:
                    seen.add(other)
                    waiting.append(other)
        if bound[1] in seen:
            kept = rest
    return kept
