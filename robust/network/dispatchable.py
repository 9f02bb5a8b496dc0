"""Execution of controllable networks: tables for dispatchers, windows of time points, the minimal dispatchable form.

In a dispatchable network, a dispatcher looks only at the edges of a time point when that is to happen: it happens
between the bounds that its neighbours give it, and not before it has waited. All edges that follow from reductions make
a network dispatchable (Morris, 2014). Of the ordinary ones, those are enough that no other dominates (Muscettola,
Morris and Tsamardinos, 1998: *Reformulating temporal plans for efficient execution*); of time points at fixed
distances, the first speaks for all, and each later one is tied to the one before it. A wait is left out if the time
point happens long enough after the activation anyway, after the end of the link, or after another one that waits as
long.

:class:`Windows` are MinMaxDispatchTime, online: when each time point may happen, given when others have happened.
Whatever happens narrows the windows of all that its bounds reach. The tables of a closed network hold every bound that
follows from others, so that one pass is exact: a window is that of the network in which all past times are fixed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from math import inf, lcm
from typing import Any, Generic, Protocol, TypeVar

from robust.errors import InputError
from robust.network import differences, uncertain
from robust.plan.model import TimePoint


class Span(Protocol):
    """A distance that is not the dispatcher's to choose: `target` is waited for once `source` has happened."""

    @property
    def source(self) -> TimePoint: ...
    @property
    def target(self) -> TimePoint: ...


Natural = TypeVar("Natural", bound=Span)


class DispatchNetwork(Generic[Natural]):
    """Tables of a plan's network, made once and read by any number of executions; time points are numbered.

    `above[x]` has `(y, w)` for t_y ≤ t_x + w, `below[x]` has `(y, w)` for t_y ≥ t_x + w. `waits[x]` has `(activation,
    end, delay)`: x waits until `delay` after `activation` unless `end` has happened; None: however long that takes.
    """

    def __init__(
        self,
        points: Sequence[TimePoint],
        links: Iterable[Natural],
        edges: Iterable[tuple[int, int, Fraction]],
        waits: Iterable[tuple[int, int, int, Fraction | None]],
        *,
        closed: bool,
    ) -> None:
        """`edges` are `(x, y, w)` for t_y − t_x ≤ w; `waits` are point, activation, end and delay.

        Raises:
            InputError: if there is no schedule, as far as a network that is not `closed` shows that.
        """
        self.points = tuple(points)
        self.index: Mapping[TimePoint, int] = {point: i for i, point in enumerate(self.points)}
        self.natural: Mapping[TimePoint, Natural] = {link.target: link for link in links}
        self.closed = closed
        if closed:
            known = differences.Distances(range(len(self.points)), ((y, x, -weight) for x, y, weight in edges))
            if known.network.schedule is None:
                raise InputError(_NO_SCHEDULE)
            edges = ((x, y, Fraction(-weight, known.scale)) for y, x, weight in known.network.closure())
        self._edges = _strongest(edges)
        self._waits = tuple(waits)
        self.above: list[list[tuple[int, Fraction]]] = [[] for _ in self.points]
        self.below: list[list[tuple[int, Fraction]]] = [[] for _ in self.points]
        self.waits: list[list[tuple[int, int, Fraction | None]]] = [[] for _ in self.points]
        for (x, y), weight in self._edges.items():
            self.above[x].append((y, weight))
            self.below[y].append((x, -weight))
        for point, activation, end, delay in self._waits:
            self.waits[point].append((activation, end, delay))

    @cached_property
    def blockers(self) -> tuple[frozenset[int], ...]:
        """For each time point, the time points that must have happened first.

        A time point that may coincide with a natural one waits for it, unless it brings it about: starting first could
        be wrong.
        """
        blockers: list[set[int]] = [set() for _ in self.points]
        for (x, y), weight in self._edges.items():
            first, second = self.points[y], self.points[x]
            chance = first in self.natural and second not in self.natural and not self._follows(first, second)
            if weight < 0 or (weight == 0 and chance):
                blockers[x].add(y)
        for point, activation, _, _ in self._waits:
            blockers[point].add(activation)
        return tuple(map(frozenset, blockers))

    def _follows(self, point: TimePoint, cause: TimePoint) -> bool:
        """Whether a natural time point happens because of another time point."""
        while point in self.natural and point != cause:
            point = self.natural[point].source
        return point == cause

    def tightened(self, edges: Iterable[tuple[int, int, Fraction]]) -> DispatchNetwork[Natural]:
        """The network with more edges, such as those of a parameter that has been observed."""
        every = [*((x, y, w) for (x, y), w in self._edges.items()), *edges]
        return DispatchNetwork(self.points, self.natural.values(), every, self._waits, closed=self.closed)


_NO_SCHEDULE = "the network has no schedule; expected one for every value in the box"


def _strongest(edges: Iterable[tuple[int, int, Fraction]]) -> dict[tuple[int, int], Fraction]:
    strongest: dict[tuple[int, int], Fraction] = {}
    for x, y, weight in edges:
        if x != y:
            strongest[x, y] = min(weight, strongest.get((x, y), weight))
        elif weight < 0:
            raise InputError(_NO_SCHEDULE)
    return strongest


class Windows:
    """The windows of one execution; time points are numbered as in the network.

    `times` are those of what has happened. `lower` and `upper` are the least and the greatest time at which each time
    point may happen, None is never too late; `cause` is what the greatest time follows from.
    """

    def __init__(self, network: DispatchNetwork[Any]) -> None:
        self.network = network
        self.times: dict[int, Fraction] = {}
        self.lower = [Fraction(0)] * len(network.points)
        self.upper: list[Fraction | None] = [None] * len(network.points)
        self.cause: list[int | None] = [None] * len(network.points)

    def happened(self, point: int, time: Fraction) -> None:
        """A time point has happened; its time need not be in its window."""
        self.times[point] = time
        for other, weight in self.network.above[point]:
            if other not in self.times:
                latest, known = time + weight, self.upper[other]
                if known is None or latest < known:
                    self.upper[other], self.cause[other] = latest, point
        for other, weight in self.network.below[point]:
            if other not in self.times:
                self.lower[other] = max(self.lower[other], time + weight)

    def window(self, point: int) -> tuple[Fraction, Fraction | None]:
        """The least and the greatest time at which a time point may happen."""
        return self.lower[point], self.upper[point]

    def is_late(self, point: int, now: Fraction) -> bool:
        """Whether the greatest time of a time point has passed."""
        upper = self.upper[point]
        return upper is not None and upper < now

    def ready(self, point: int) -> Fraction | None:
        """The earliest time of dispatch of a time point if nothing else happens; None if it waits for an event."""
        if not self.times.keys() >= self.network.blockers[point]:
            return None
        ready = self.lower[point]
        for activation, end, delay in self.network.waits[point]:
            if end not in self.times:
                if delay is None:
                    return None
                ready = max(ready, self.times[activation] + delay)
        return ready

    def moments(self, points: Iterable[int], patience: Fraction) -> Iterator[Fraction]:
        """Times at which time points become ready, and their greatest times plus `patience`."""
        for point in points:
            ready, upper = self.ready(point), self.upper[point]
            if ready is not None:
                yield ready
            if upper is not None:
                yield upper + patience

    def over(self, network: DispatchNetwork[Any]) -> Windows:
        """A copy of the history for another network with the same time points."""
        fresh = Windows(network)
        for point, time in self.times.items():
            fresh.happened(point, time)
        return fresh


def edges_between(
    source: int, target: int, lower: Fraction | None, upper: Fraction | None
) -> Iterator[tuple[int, int, Fraction]]:
    """`lower ≤ t_target − t_source ≤ upper` as edges."""
    if upper is not None:
        yield source, target, upper
    if lower is not None:
        yield target, source, -lower


Wait = tuple[int, int, int, Fraction | None]
"""A time point, an activation, an end and a delay, as :class:`DispatchNetwork` has them."""


def strategy(answer: uncertain.DynamicAnswer, links: Iterable[Natural]) -> DispatchNetwork[Natural]:
    """The tables of a dynamically controllable network, in terms of its time points."""
    return DispatchNetwork(answer.form.stnu.points, links, *strategy_edges(answer), closed=True)


def strategy_edges(answer: uncertain.DynamicAnswer) -> tuple[list[tuple[int, int, Fraction]], list[Wait]]:
    """The edges and waits of a dynamically controllable network; starts A′ = A + x become A."""
    form, stnu = answer.form, answer.form.stnu
    index = {point: number for number, point in enumerate(stnu.points)}
    place = {number: (number, Fraction(0)) for number in index.values()}
    for number, node in form.start.items():
        link = stnu.links[number]
        place[node] = index[link.source], link.lower or Fraction(0)
    edges = [
        bound
        for span in stnu.contingents
        for bound in edges_between(index[span.source], index[span.target], span.lower, span.upper)
    ]
    waits: list[Wait] = []
    executed = {index[point] for point in stnu.executable}
    for edge in (*form.edges, *answer.derived):
        length = form.length(edge.weight)
        (source, before), (target, after) = place[edge.source], place[edge.target]
        if edge.case is uncertain.Case.ORDINARY and length is not None:
            # t_target + after − t_source − before ≤ length
            edges.append((source, target, length + before - after))
        elif (
            edge.case is uncertain.Case.UPPER and edge.label is not None and edge.weight < 0 and edge.source in executed
        ):
            end = index[stnu.links[edge.label].target]
            waits.append((source, target, end, None if length is None else after - length))
    return edges, waits


def strategy_bounds(answer: uncertain.DynamicAnswer) -> list[differences.Bound]:
    """The edges of :func:`strategy_edges` as greatest lower bounds between all nodes of the form, in its units."""
    form, links = answer.form, answer.form.stnu.links
    node = {point: number for number, point in enumerate(form.stnu.points)}
    bounds = [
        (edge.target, edge.source, -edge.weight)
        for edge in (*form.edges, *answer.derived)
        if edge.case is uncertain.Case.ORDINARY and 2 * abs(edge.weight) <= form.infinity
    ]
    for source, target, upper in ((links[n].source, links[n].target, links[n].upper) for n in form.start):
        if upper is not None:
            bounds.append((node[target], node[source], -int(upper * form.scale)))
    bounds += ((start, node[links[number].target], 0) for number, start in form.start.items())
    return bounds


# -- the minimal network -----------------------------------------------------------------------------------------------


def minimal_edges(full: DispatchNetwork[Any]) -> Iterator[tuple[int, int, Fraction]]:
    """The edges that no other dominates, between the first ones of time points at fixed distances; and their ties."""
    distance = [dict(bounds) for bounds in full.above]
    groups = _rigid(full, distance)
    first = sorted(group[0][0] for group in groups)
    kept = _undominated(first, distance)
    yield from ((a, b, distance[a][b]) for a, b in sorted(kept))
    for group in groups:
        leader = group[0][0]
        near = {c for pair in kept if leader in pair for c in pair} - {leader}
        for number, (base, *others) in enumerate(group):
            if number:
                near = {group[number - 1][0]}
                yield from _between(distance, base, near)
            for other in others:  # they happen together, each bound by what binds the first of them
                yield from _between(distance, other, {base, *near})


def _between(distance: list[dict[int, Fraction]], a: int, others: Iterable[int]) -> Iterator[tuple[int, int, Fraction]]:
    """All edges between a time point and others."""
    for b in others:
        if b in distance[a]:
            yield a, b, distance[a][b]
        if a in distance[b]:
            yield b, a, distance[b][a]


def _undominated(points: Sequence[int], distance: list[dict[int, Fraction]]) -> set[tuple[int, int]]:
    """The edges between points without fixed distances that no other edges dominate.

    An edge from a to c is dominated by the one from b to c, if both are not negative, and by the one from a to b, if
    both are negative, where the way over b is not longer.
    """
    scale = lcm(*(weight.denominator for a in points for weight in distance[a].values()))
    row = {a: {b: int(weight * scale) for b, weight in distance[a].items()} for a in points}
    kept = {a: {b for b in row[a] if b in row} for a in points}
    for a in points:
        for c in sorted(kept[a], key=lambda b: (row[a][b], b)):
            whole = row[a][c]
            for b in kept[a] if whole < 0 else row[a]:
                if b == c or b not in row:
                    continue
                second = row[b].get(c)
                if second is None or row[a][b] + second != whole:
                    continue
                if (row[a][b] < 0) if whole < 0 else (second >= 0 and c in kept[b]):
                    kept[a].discard(c)
                    break
    return {(a, b) for a in points for b in kept[a]}


def _rigid(full: DispatchNetwork[Any], distance: list[dict[int, Fraction]]) -> list[list[list[int]]]:
    """The time points at fixed distances, in the order of time, and those that happen together.

    Of these, one that nature chooses is first, because others react to it, and one that follows from what is executed
    at a fixed distance is last.
    """
    groups, done = [], set[int]()
    for point in range(len(full.points)):
        if point in done:
            continue
        gaps = {point: Fraction(0)}
        gaps |= {other: gap for other, gap in distance[point].items() if distance[other].get(point) == -gap}
        done |= gaps.keys()
        by_time: dict[Fraction, list[int]] = {}
        for member in sorted(gaps):
            by_time.setdefault(gaps[member], []).append(member)
        for together in by_time.values():
            together.sort(key=lambda member: _rank(full, member, gaps))
        groups.append([together for _, together in sorted(by_time.items())])
    return groups


def _rank(full: DispatchNetwork[Any], point: int, group: Mapping[int, Fraction]) -> int:
    """0 for what nature chooses, 1 for what is executed, 2 for what follows from something in the group."""
    link = full.natural.get(full.points[point])
    if link is None:
        return 1
    return 2 if full.index[link.source] in group else 0


def waits(answer: uncertain.DynamicAnswer) -> tuple[uncertain.Wait, ...]:
    """The conditional waits with which a dispatcher satisfies a controllable network, in the order of its time points.

    Waits that requirements or other waits imply are left out.
    """
    full = strategy(answer, answer.form.stnu.contingents)
    return tuple(sorted(needed_waits(full), key=lambda wait: (full.index[wait.point], full.index[wait.end])))


def needed_waits(full: DispatchNetwork[Any]) -> Iterator[uncertain.Wait]:
    """The waits that neither requirements nor other waits imply."""
    distance = [dict(bounds) for bounds in full.above]
    by_link: dict[tuple[int, int], dict[int, Fraction | float]] = {}  # an infinite delay: until the end of the link
    for point, waits in enumerate(full.waits):
        for activation, end, delay in waits:
            delays = by_link.setdefault((activation, end), {})
            delays[point] = max(inf if delay is None else delay, delays.get(point, -inf))
    for (activation, end), delays in by_link.items():
        for point, longest in sorted(delays.items()):
            latest = distance[point]
            late_enough = -latest.get(activation, inf) >= longest or latest.get(end, inf) <= 0
            others = ((latest.get(other, inf), beyond) for other, beyond in delays.items() if other != point)
            if not late_enough and not any(gap < 0 and beyond - gap >= longest for gap, beyond in others):
                finite = longest if isinstance(longest, Fraction) else None
                yield uncertain.Wait(full.points[point], full.points[activation], finite, full.points[end])
