"""Difference constraints: schedules, contradictions, and what a network implies, by shortest paths in integers.

Points are numbers from 0, weights are integers: the builder of a network scales all weights by one common denominator,
once; :class:`Distances` does so for points with names and rational weights. A bound (a, b, w) says t_b − t_a ≥ w; an
upper bound is a lower bound of the way back. The origin of a bound is its position among the bounds of its network:
cycles and paths are reported as origins.

One feasible schedule turns every bound into a slack that is not negative (Johnson's potentials), so that rows of
greatest lower bounds come from Dijkstra's algorithm, and only for points that are asked about. Points whose distance
is fixed form one component: cycles without slack are found as strongly connected components of the bounds that the
schedule meets exactly.

Where weights are more than numbers, networks are solved by elimination of points, one after the other: what is left
has, between the other points, the same greatest lower bounds [Dechter, Meiri and Pearl 1991, directional path
consistency].
"""

from abc import ABC, abstractmethod
from collections import defaultdict, deque
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from heapq import heappop, heappush
from math import lcm
from typing import Generic, TypeVar

Bound = tuple[int, int, int]
"""(a, b, w): t_b − t_a ≥ w."""
Following = Sequence[Sequence[tuple[int, int, int]]]
"""For each point the bounds that leave it: the later point, the weight, and the origin."""


@dataclass(frozen=True, slots=True)
class Cycle:
    """Bounds that lead in a circle, in order, and whose weights add up to more than 0: no schedule satisfies them."""

    origins: tuple[int, ...]


def following(size: int, bounds: Iterable[Bound]) -> list[list[tuple[int, int, int]]]:
    """The bounds by the points that they leave."""
    leaving: list[list[tuple[int, int, int]]] = [[] for _ in range(size)]
    for origin, (source, target, weight) in enumerate(bounds):
        leaving[source].append((target, weight, origin))
    return leaving


def delay(times: list[int], bounds: Following, sources: Iterable[int]) -> Cycle | None:
    """Delay times as little as bounds demand, from these sources on [Bellman and Ford, by a queue].

    Returns a cycle if no delay is enough. It shows as a circle among the bounds that delayed each point last, which are
    looked at whenever as many points have been taken from the queue as there are.
    """
    size = len(times)
    waiting = deque(sources)
    waits, before, origins = [False] * size, [-1] * size, [-1] * size
    for point in waiting:
        waits[point] = True
    patience = size
    while waiting:
        if not patience:
            cycle = _circle(before, origins)
            if cycle is not None:
                return cycle
            patience = size
        patience -= 1
        point = waiting.popleft()
        waits[point] = False
        now = times[point]
        for target, weight, origin in bounds[point]:
            if times[target] < now + weight:
                times[target], before[target], origins[target] = now + weight, point, origin
                if not waits[target]:
                    waits[target] = True
                    waiting.append(target)
    return None


def _circle(before: Sequence[int], origins: Sequence[int]) -> Cycle | None:
    """A circle among the points before points, if there is one; it begins at its first point by number."""
    visited = [-1] * len(before)
    for start in range(len(before)):
        point = start
        while point >= 0 and visited[point] < 0:
            visited[point] = start
            point = before[point]
        if point >= 0 and visited[point] == start:
            circle = [point]
            while before[circle[-1]] != point:
                circle.append(before[circle[-1]])
            first = circle.index(min(circle))
            return Cycle(tuple(origins[member] for member in reversed(circle[first:] + circle[:first])))
    return None


UNBOUNDED = 1 << 512
"""Later than any time that counts."""


def windows(
    order: Sequence[int], bounds: Collection[Bound], times: Mapping[int, int], now: int
) -> list[tuple[int, int | None]] | None:
    """The earliest and latest time of each point once some have happened; None if no schedule is left.

    Args:
        order: a schedule of the network, in the order of which bounds are followed.
        bounds: what counts of the network, which has schedules.
        times: what has happened; point 0 is zero.
        now: nothing else happens before.
    """
    size, known = len(order), {0: 0, **times}
    earliest = [known.get(point, now) for point in range(size)]
    in_order = sorted(range(size), key=order.__getitem__)
    cycle = delay(earliest, following(size, bounds), in_order)
    if cycle is not None or any(earliest[point] > time for point, time in known.items()):
        return None
    backwards = [-known.get(point, UNBOUNDED) for point in range(size)]
    reverse = following(size, ((target, source, weight) for source, target, weight in bounds))
    delay(backwards, reverse, (*known, *in_order[::-1]))
    latest = (None if -time > UNBOUNDED // 2 else -time for time in backwards)
    return list(zip(earliest, latest, strict=True))


class DifferenceNetwork:
    """A schedule of the bounds between some points, or why there is none, and the greatest lower bounds that follow.

    Args:
        size: points are 0 … size − 1.
        bounds: the network.

    `schedule` are the least times from 0 that satisfy the bounds. If there are none it is None, `cycle` tells why, and
    nothing else has a meaning.
    """

    def __init__(self, size: int, bounds: Iterable[Bound]) -> None:
        self.size = size
        self._given = tuple(bounds)
        self._bounds: dict[tuple[int, int], int] = {}
        for source, target, weight in self._given:
            self._bounds[source, target] = max(weight, self._bounds.get((source, target), weight))
        schedule = [0] * size
        cycle = delay(schedule, self._steps, range(size))
        self.cycle = None if cycle is None else Cycle(tuple(self._origins[number] for number in cycle.origins))
        self.schedule: Sequence[int] | None = schedule if cycle is None else None

    @cached_property
    def _steps(self) -> Following:
        """The strongest bounds by the points that they leave; in place of origins, which of the strongest."""
        return following(self.size, ((*pair, weight) for pair, weight in self._bounds.items()))

    @cached_property
    def _origins(self) -> list[int]:
        """The origins of the strongest bounds; of equal bounds that of the first."""
        first: dict[tuple[int, int], int] = {}
        for origin, (source, target, weight) in enumerate(self._given):
            if self._bounds[source, target] == weight:
                first.setdefault((source, target), origin)
        return [first[pair] for pair in self._bounds]

    @property
    def times(self) -> Sequence[int]:
        """The schedule.

        Raises:
            ValueError: if there is none.
        """
        if self.schedule is None:
            raise ValueError("a network without schedule implies everything")
        return self.schedule

    # -- components and slack ------------------------------------------------------------------------------------------

    @cached_property
    def component(self) -> list[int]:
        """The component of every point: distances within one are the same in all schedules."""
        times = self.times
        tight: list[list[int]] = [[] for _ in range(self.size)]
        for (source, target), weight in self._bounds.items():
            if times[target] - times[source] == weight:
                tight[source].append(target)
        return strong_components(tight)

    @cached_property
    def _slack(self) -> list[list[tuple[int, int]]]:
        """For each component the components that follow it, with the least slack of a bound between them."""
        times, component = self.times, self.component
        least: dict[tuple[int, int], int] = {}
        for (source, target), weight in self._bounds.items():
            pair = (component[source], component[target])
            if pair[0] != pair[1]:
                slack = times[target] - times[source] - weight
                least[pair] = min(slack, least.get(pair, slack))
        steps: list[list[tuple[int, int]]] = [[] for _ in range(max(component, default=-1) + 1)]
        for (source, target), slack in least.items():
            steps[source].append((target, slack))
        return steps

    @cached_property
    def _searches(self) -> dict[int, tuple[list[int | None], list[tuple[int, int]]]]:
        """The least slacks of paths that are known of each component that was asked about, and where to go on."""
        return {}

    def _slack_to(self, start: int, goal: int, most: int | None = None) -> int | None:
        """The least slack of a path from a component to another; None where there is none, or none of at most this."""
        if start not in self._searches:
            self._searches[start] = [None] * len(self._slack), [(0, start)]
        known, heap = self._searches[start]
        while heap and known[goal] is None and (most is None or heap[0][0] <= most):
            slack, place = heappop(heap)
            if known[place] is None:
                known[place] = slack
                for other, more in self._slack[place]:
                    if known[other] is None:
                        heappush(heap, (slack + more, other))
        return known[goal]

    # -- what follows --------------------------------------------------------------------------------------------------

    def least(self, source: int, target: int) -> int | None:
        """The greatest w with t_target − t_source ≥ w in all schedules; None if there is none."""
        slack = self._slack_to(self.component[source], self.component[target])
        return None if slack is None else self.times[target] - self.times[source] - slack

    def closure(self) -> Iterator[Bound]:
        """The greatest lower bound of each pair of points that has one."""
        times, component = self.times, self.component
        for source in range(self.size):
            for target in range(self.size):
                slack = self._slack_to(component[source], component[target])
                if slack is not None:
                    yield source, target, times[target] - times[source] - slack

    def arrivals(self, source: int) -> Sequence[tuple[int, int]]:
        """For each point the one before it on a greatest lower bound from a source, and the origin of the last bound.

        (−1, −1) for the source, and for points of which nothing is known. Of several the first by number.
        """
        greatest = [self.least(source, target) for target in range(self.size)]
        arrivals, settled = [(-1, -1)] * self.size, [False] * self.size
        heap = [(0, source)]  # by slack, as in Dijkstra's algorithm, but along greatest lower bounds only
        while heap:
            _, point = heappop(heap)
            settled[point] = True
            for other, weight, number in self._steps[point]:
                arrival = point, self._origins[number]
                if settled[other] or greatest[other] != (greatest[point] or 0) + weight:
                    continue
                if arrivals[other][0] < 0:
                    heappush(heap, (self.times[other] - (greatest[other] or 0), other))
                    arrivals[other] = arrival
                arrivals[other] = min(arrival, arrivals[other])
        return arrivals

    def at_least(self, source: int, target: int, weight: int) -> bool:
        """Whether t_target − t_source ≥ weight in all schedules."""
        most = self.times[target] - self.times[source] - weight
        if most < 0:
            return False  # the schedule itself is one in which it is not
        slack = self._slack_to(self.component[source], self.component[target], most)
        return slack is not None and slack <= most

    # -- what can go ---------------------------------------------------------------------------------------------------

    def needed(self, bounds: Iterable[Bound], given: Iterable[Bound] = ()) -> list[Bound]:
        """A subset of bounds of the network that implies them all together with those given.

        No bound between two components is in it that others imply. Of equal ones the first is kept.
        """
        times, component = self.times, self.component
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
        fixed = {(component[step[0]], component[step[1]]): self._slack_of(step) for step in given}
        direct = [dict(leaving) for leaving in self._slack]
        for (source, target), bound in best.items():
            slack = self._slack_of(bound)
            if fixed.get((source, target), slack + 1) <= slack:
                continue
            between = [step for step in self._slack[source] if step[0] != target and step[1] <= slack]
            # Mostly two bounds imply a third one, which takes no search.
            if any(first + direct[middle].get(target, slack + 1) <= slack for middle, first in between):
                continue
            rests = ((first, self._slack_to(middle, target, slack - first)) for middle, first in between)
            if not any(rest is not None and first + rest <= slack for first, rest in rests):
                kept.append(bound)
        fixed_within = [bound for bound in given if component[bound[0]] == component[bound[1]]]
        return [*kept, *(bound for within in inner.values() for bound in _spanning(within, fixed_within, times))]

    def _slack_of(self, bound: Bound) -> int:
        return self.times[bound[1]] - self.times[bound[0]] - bound[2]


NodeT = TypeVar("NodeT", bound=Hashable)


def reachable(steps: Mapping[NodeT, Iterable[NodeT]], *starts: NodeT) -> set[NodeT]:
    """Nodes, and all nodes to which steps lead from them."""
    seen, waiting = set(starts), list(starts)
    while waiting:
        new = set(steps.get(waiting.pop(), ())) - seen
        seen |= new
        waiting += new
    return seen


def strong_components(steps: Sequence[Sequence[int]]) -> list[int]:
    """The number of the strongly connected component of each node [Kosaraju], without recursion."""
    before: list[list[int]] = [[] for _ in steps]
    for node, leaving in enumerate(steps):
        for other in leaving:
            before[other].append(node)
    seen, finished = [False] * len(steps), list[int]()
    work = [(root, False) for root in range(len(steps))]
    while work:
        node, is_done = work.pop()
        if is_done:
            finished.append(node)
        elif not seen[node]:
            seen[node] = True
            work += [(node, True), *((other, False) for other in steps[node])]
    component = [-1] * len(steps)
    for root in reversed(finished):
        waiting = [root]
        while waiting:
            node = waiting.pop()
            if component[node] < 0:
                component[node] = root
                waiting += before[node]
    number = {root: count for count, root in enumerate(dict.fromkeys(component))}
    return [number[root] for root in component]


def _spanning(bounds: Sequence[Bound], given: Sequence[Bound], times: Sequence[int]) -> list[Bound]:
    """A minimal subset of bounds, all met exactly in all schedules, that leaves the distances fixed."""
    kept = list(bounds)
    for bound in reversed(bounds):
        rest = [other for other in kept if other != bound]
        steps: dict[int, list[int]] = defaultdict(list)
        for source, target, weight in (*rest, *given):
            if times[target] - times[source] == weight:
                steps[source].append(target)
        if bound[1] in reachable(steps, bound[0]):
            kept = rest
    return kept


# -- points with names -------------------------------------------------------------------------------------------------

Point = TypeVar("Point", bound=Hashable)


class Distances(Generic[Point]):
    """Difference constraints between named points with rational weights, as integers in units of 1 / `scale`.

    Args:
        points: all points; the network has them by number.
        bounds: (a, b, w) for t_b − t_a ≥ w; origins are positions among them.
        weights: other weights that will be asked about in units.
    """

    def __init__(
        self, points: Iterable[Point], bounds: Iterable[tuple[Point, Point, Fraction]], weights: Iterable[Fraction] = ()
    ) -> None:
        bounds = tuple(bounds)
        self.index = {point: number for number, point in enumerate(points)}
        self.scale = lcm(*(weight.denominator for _, _, weight in bounds), *(weight.denominator for weight in weights))
        self.bounds = [self.in_units(*bound) for bound in bounds]
        self.network = DifferenceNetwork(len(self.index), self.bounds)

    def in_units(self, source: Point, target: Point, weight: Fraction) -> Bound:
        """A bound of the network with numbers for points and an integer for the weight, whose denominator is known."""
        return self.index[source], self.index[target], weight.numerator * (self.scale // weight.denominator)

    @property
    def times(self) -> dict[Point, Fraction]:
        """The least times from 0; ValueError if there is no schedule, and the network's `cycle` is why."""
        return {point: Fraction(time, self.scale) for point, time in zip(self.index, self.network.times, strict=True)}

    def least(self, source: Point, target: Point) -> Fraction | None:
        """The greatest w with t_target − t_source ≥ w in all schedules; None if there is none."""
        weight = self.network.least(self.index[source], self.index[target])
        return None if weight is None else Fraction(weight, self.scale)


def delayed(times: Mapping[Point, Fraction], bounds: Iterable[tuple[Point, Point, Fraction]]) -> dict[Point, Fraction]:
    """Times, delayed as little as bounds (a, b, w) for t_b − t_a ≥ w demand, which have schedules.

    Points that bounds lead to from one with a time have one as well, as early as that; others have none.
    """
    bounds = tuple(bounds)
    points = dict.fromkeys((*times, *(point for bound in bounds for point in bound[:2])))
    known = Distances(points, bounds, times.values())
    scaled = [int(times[point] * known.scale) if point in times else -UNBOUNDED for point in points]
    delay(scaled, following(len(scaled), known.bounds), range(len(scaled)))
    return {
        point: Fraction(time, known.scale) for point, time in zip(points, scaled, strict=True) if time > -UNBOUNDED // 2
    }


# -- elimination -------------------------------------------------------------------------------------------------------

Weight = TypeVar("Weight")


class Elimination(ABC, Generic[Weight]):
    """Edges between numbered nodes, which are eliminated: each path through a node becomes an edge past it.

    `after[a][b]` is the weight of the edge from a to b, whatever weights are, and `before[b][a]` the same one. Once a
    node is eliminated, they have only its edges with nodes that were eliminated later. `order` are those that were.
    """

    def __init__(self, size: int) -> None:
        self.after: list[dict[int, Weight]] = [{} for _ in range(size)]
        self.before: list[dict[int, Weight]] = [{} for _ in range(size)]
        self.order: list[int] = []
        self.remaining = set(range(size))

    @abstractmethod
    def join(self, source: int, first: Weight, node: int, second: Weight, target: int) -> None:
        """Replace a path from a source through a node to a target, which may be the source."""

    def connect(self, source: int, target: int, weight: Weight) -> Weight:
        """Add an edge."""
        self.after[source][target] = self.before[target][source] = weight
        return weight

    def disconnect(self, source: int, target: int) -> None:
        """Remove an edge."""
        del self.after[source][target], self.before[target][source]

    def eliminate(self, node: int) -> None:
        """Eliminate a node."""
        self.remaining.remove(node)
        self.order.append(node)
        before, after = self.before[node], self.after[node]
        for source in before:
            del self.after[source][node]
        for target in after:
            del self.before[target][node]
        for source in before.keys() & after.keys():  # cycles first: they may tell which paths do not matter
            self.join(source, before[source], node, after[source], source)
        for source, first in before.items():
            for target, second in after.items():
                if source != target:
                    self.join(source, first, node, second, target)


def forward_only(size: int, edges: Sequence[tuple[int, int, Hashable | None]]) -> Iterator[tuple[int, int, int]]:
    """A graph whose circles are those of another one that turn back on no interval.

    Args:
        size: points are 0 … size − 1.
        edges: source, target, and the interval that an edge is an end of; where both ends join the same two points, a
            value makes both the same distance, so that to go there and back says nothing.

    Yields:
        Source, target and number of each edge. Nodes are the points, followed by points as they are reached on an
        interval.
    """
    ways = {edge for edge in edges if edge[2] is not None}
    turning = {edge for edge in ways if (edge[1], edge[0], edge[2]) in ways}
    leaving: dict[int, list[int]] = defaultdict(list)
    for number, edge in enumerate(edges):
        leaving[edge[0]].append(number)
    nodes: dict[tuple[int, Hashable | None], int] = {(point, None): point for point in range(size)}
    waiting = list(nodes)
    for point, interval in waiting:
        for number in leaving[point]:
            edge = edges[number]
            if interval is not None and edge[2] == interval:
                continue
            reached = (edge[1], edge[2] if edge in turning else None)
            if reached not in nodes:
                nodes[reached] = len(nodes)
                waiting.append(reached)
            yield nodes[point, interval], nodes[reached], number
