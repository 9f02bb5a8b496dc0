"""How a controllable network is executed: its minimal dispatchable form, and executions with drawn durations.

In a dispatchable network, a dispatcher looks only at the edges of a time point when that is to happen: it happens
between the bounds that its neighbours give it, and not before it has waited. All edges that follow from reductions make
a network dispatchable (Morris, 2014). Of the ordinary ones, those are enough that no other dominates (Muscettola,
Morris and Tsamardinos, 1998: *Reformulating temporal plans for efficient execution*); of time points at fixed
distances, the first speaks for all, and each later one is tied to the one before it. A wait is left out if the time
point happens long enough after the activation anyway, after the end of the link, or after another one that waits as
long.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from random import Random

from robust.errors import InputError, RefutedError
from robust.execute.dispatchable import DispatchNetwork, NaturalLink, Windows, strategy
from robust.network.uncertain import DynamicAnswer, Wait, dynamic
from robust.numbers import Number
from robust.plan.model import ZERO, TimePoint
from robust.plan.polynomial import Polynomial
from robust.presented import NoTruthValue, Presented
from robust.qe.box import Interval
from robust.stnu.files import Source, deadline, network_of
from robust.stnu.network import Network, instant
from robust.stnu.verdicts import CheckResult, Verdict, check

_NOTHING = Fraction(0)
GRAIN = 10**6
"""Drawn durations are multiples of this part of a contingent link's width."""
UNBOUNDED = 10
"""How far beyond its least length, in multiples of it and 1, a link without an upper bound is drawn."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """`target − source ≤ bound`, an ordinary edge of a dispatchable network."""

    source: str
    target: str
    bound: Fraction


@dataclass(frozen=True, slots=True)
class Event:
    """A time point happens: executed by the dispatcher, or observed."""

    time: Fraction
    point: str
    observed: bool


@dataclass(frozen=True, slots=True)
class Execution(NoTruthValue, ask="violated"):
    """What happened when nature drew these lengths of contingent links, by their ends; `violated` are requirements."""

    seed: int
    lengths: Mapping[str, Fraction]
    events: tuple[Event, ...]
    violated: tuple[str, ...]


@dataclass(frozen=True)
class DispatchResult(Presented, ask="checked"):
    """A minimal dispatchable network: contingent links as they were, requirements, waits; None of it without control.

    `derived` is how many ordinary edges follow from the network in all.
    """

    checked: CheckResult
    requirements: tuple[Requirement, ...]
    waits: tuple[Wait, ...]
    derived: int
    tables: DispatchNetwork | None
    seconds: float

    @property
    def name(self) -> str:
        """Of the network."""
        return self.network.name

    @property
    def network(self) -> Network:
        return self.checked.network

    def execute(self, seed: int = 0) -> Execution:
        """An execution as early as possible; lengths of contingent links are drawn uniformly.

        Raises:
            RefutedError: if the network is not controllable.
        """
        if self.tables is None:
            raise RefutedError(f"{self.network.name} is not controllable; expected a controllable network")
        draw = Random(seed)  # noqa: S311 - a simulation
        lengths = {link.target: _drawn(draw, link) for link in self.tables.natural.values()}
        return self.execute_with(lengths, seed)

    def execute_with(self, lengths: Mapping[TimePoint, Fraction] | Mapping[str, Fraction], seed: int = 0) -> Execution:
        """The same with given lengths of contingent links, by their ends, from where the link begins.

        Raises:
            InputError: unless there is a length of each contingent link, and of nothing else.
            RefutedError: if the network is not controllable.
        """
        if self.tables is None:
            raise RefutedError(f"{self.network.name} is not controllable; expected a controllable network")
        lengths = {instant(end) if isinstance(end, str) else end: length for end, length in lengths.items()}
        if lengths.keys() != self.tables.natural.keys():
            found, expected = (", ".join(map(str, ends)) or "none" for ends in (lengths, self.tables.natural))
            raise InputError(f"found lengths of {found}, expected those of the contingent links: {expected}")
        times = dict(run_early(self.tables, lengths))
        order = {point: number for number, point in enumerate(times)}
        events = tuple(
            Event(moment, str(point), point in self.tables.natural)
            for point, moment in sorted(times.items(), key=lambda item: (item[1], order[item[0]]))
            if point != ZERO
        )
        return Execution(seed, {str(end): size for end, size in lengths.items()}, events, self._violated(times))

    def _violated(self, times: Mapping[TimePoint, Fraction]) -> tuple[str, ...]:
        return tuple(
            str(link)
            for link in self.network.examined.stnu.links
            if not link.is_contingent
            and not (
                (link.lower is None or times[link.target] - times[link.source] >= link.lower)
                and (link.upper is None or times[link.target] - times[link.source] <= link.upper)
            )
        )


def dispatch(network: Source, *, timeout: Number | None = None) -> DispatchResult:
    """The minimal dispatchable form of a network; only the verdict if it is not controllable.

    Args:
        network: a network, or the path of one.
        timeout: seconds after which the verdict is UNKNOWN.

    Raises:
        InputError: if there is anything wrong in the file.
    """
    started = time.perf_counter()
    network = network_of(network)
    checked = check(network, timeout=timeout)
    if checked.verdict is not Verdict.CONTROLLABLE:
        return DispatchResult(checked, (), (), 0, None, time.perf_counter() - started)
    answer = dynamic(network.examined.stnu, deadline(timeout))
    full = _full(answer)
    kept = tuple(_minimal(full))
    waits = tuple(_needed_waits(full))
    index = full.index
    tables = DispatchNetwork(
        full.points,
        full.natural.values(),
        [*kept, *_natural_edges(full)],
        ((index[one.point], index[one.activation], index[one.end], one.delay) for one in waits),
        closed=False,
    )
    natural = set(_natural_edges(full))
    requirements = tuple(
        Requirement(str(full.points[a]), str(full.points[b]), weight)
        for a, b, weight in kept
        if (a, b, weight) not in natural and not (full.points[b] == ZERO and weight >= 0)
    )
    derived = sum(len(found) for found in full.above)
    return DispatchResult(checked, requirements, waits, derived, tables, time.perf_counter() - started)


def _full(answer: DynamicAnswer) -> DispatchNetwork:
    """All that follows from a network."""
    links = [
        NaturalLink(one.source, one.target, Polynomial.variable(one.name), Interval(one.lower, one.upper))
        for one in answer.form.stnu.contingents
    ]
    return strategy(answer, links)


def _natural_edges(full: DispatchNetwork) -> Iterator[tuple[int, int, Fraction]]:
    """What nature keeps to."""
    for link in full.natural.values():
        a, b = full.index[link.source], full.index[link.target]
        if link.allowed.upper is not None:
            yield a, b, link.allowed.upper
        if link.allowed.lower is not None:
            yield b, a, -link.allowed.lower


# -- the minimal network -----------------------------------------------------------------------------------------------


def _minimal(full: DispatchNetwork) -> Iterator[tuple[int, int, Fraction]]:
    """The edges that no other dominates, between the first ones of time points at fixed distances; and their ties."""
    distance = [dict(found) for found in full.above]
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
    """The edges between points without fixed distances that say something beside all others.

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


def _rigid(full: DispatchNetwork, distance: list[dict[int, Fraction]]) -> list[list[list[int]]]:
    """The time points at fixed distances, in the order of time, and those that happen together.

    Of these, one that nature chooses is first, because others react to it, and one that follows from what is executed
    at a fixed distance is last.
    """
    groups, done = [], set[int]()
    for point in range(len(full.points)):
        if point in done:
            continue
        gaps = {point: _NOTHING}
        gaps |= {other: gap for other, gap in distance[point].items() if distance[other].get(point) == -gap}
        done |= gaps.keys()
        by_time: dict[Fraction, list[int]] = {}
        for one in sorted(gaps):
            by_time.setdefault(gaps[one], []).append(one)
        for together in by_time.values():
            together.sort(key=lambda one: _rank(full, one, gaps))
        groups.append([together for _, together in sorted(by_time.items())])
    return groups


def _rank(full: DispatchNetwork, point: int, group: Mapping[int, Fraction]) -> int:
    """0 for what nature chooses, 1 for what is executed, 2 for what follows from something in the group."""
    link = full.natural.get(full.points[point])
    if link is None:
        return 1
    return 2 if full.index[link.source] in group else 0


def _needed_waits(full: DispatchNetwork) -> Iterator[Wait]:
    """The waits that neither requirements nor other waits imply."""
    distance = [dict(found) for found in full.above]
    by_link: dict[tuple[int, int], dict[int, Fraction | None]] = {}
    for point, found in enumerate(full.waits):
        for activation, end, delay in found:
            waiting = by_link.setdefault((activation, end), {})
            waiting[point] = _longer(delay, waiting[point]) if point in waiting else delay
    for (activation, end), waiting in by_link.items():
        for point, delay in sorted(waiting.items()):
            after = distance[point].get(end)
            since = distance[point].get(activation)
            late_enough = delay is not None and since is not None and -since >= delay
            others = ((distance[point].get(other), beyond) for other, beyond in waiting.items() if other != point)
            if late_enough or (after is not None and after < 0) or any(_covers(*one, delay) for one in others):
                continue
            points = full.points
            yield Wait(points[point], points[activation], delay, points[end])


def _longer(one: Fraction | None, other: Fraction | None) -> Fraction | None:
    return None if one is None or other is None else max(one, other)


def _covers(gap: Fraction | None, beyond: Fraction | None, delay: Fraction | None) -> bool:
    """Whether another time point, which happens before by more than nothing, has waited long enough."""
    if gap is None or gap >= 0:
        return False
    return beyond is None or (delay is not None and beyond - gap >= delay)


# -- executions --------------------------------------------------------------------------------------------------------


def _drawn(draw: Random, link: NaturalLink) -> Fraction:
    low = link.allowed.lower or _NOTHING
    width = UNBOUNDED * (low + 1) if link.allowed.upper is None else link.allowed.upper - low
    return low + width * Fraction(draw.randint(0, GRAIN), GRAIN)


def run_early(tables: DispatchNetwork, lengths: Mapping[TimePoint, Fraction]) -> Iterable[tuple[TimePoint, Fraction]]:
    """When each time point happens if all happen as early as they may.

    Raises:
        RuntimeError: if nothing may happen although something has to, which is an error of the network.
    """
    windows = Windows(tables)
    waiting = {point for point in tables.points if point not in tables.natural}
    now = _NOTHING
    coming: dict[TimePoint, Fraction] = {}

    def happen(point: TimePoint) -> tuple[TimePoint, Fraction]:
        windows.happened(tables.index[point], now)
        for link in tables.natural.values():
            if link.source == point:
                coming[link.target] = now + lengths[link.target]
        return point, now

    waiting.discard(ZERO)
    yield happen(ZERO)
    while waiting or coming:
        ended = next((point for point, moment in sorted(coming.items()) if moment == now), None)
        if ended is not None:
            del coming[ended]
            yield happen(ended)
            continue
        ready = {point: windows.ready(tables.index[point]) for point in waiting}
        chosen = next((point for point in sorted(waiting) if (at := ready[point]) is not None and at <= now), None)
        if chosen is not None:
            waiting.discard(chosen)
            yield happen(chosen)
            continue
        moments = [moment for moment in (*ready.values(), *coming.values()) if moment is not None]
        if not moments:
            raise RuntimeError(f"nothing may happen, but {', '.join(sorted(map(str, waiting)))} have to")
        now = min(moments)
