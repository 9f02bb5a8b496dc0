"""MinMaxDispatchTime, online: when each time point may happen, given when others have happened [IRR, Algorithm 2].

Whatever happens narrows the windows of all that its bounds reach. The tables of a closed network hold every bound that
follows from others, so that one pass is exact: a window is that of the network in which all past times are fixed.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from math import lcm

from robust.execute.dispatch.network import DispatchNetwork, Tables


class Windows:
    """The windows of one execution; time points are numbered as in the network. Arithmetic is in integers, exactly."""

    def __init__(self, network: DispatchNetwork, denominator: int = 1) -> None:
        self.network = network
        self._tables: Tables = network.scaled(denominator)
        self._times: dict[int, int] = {}
        size = len(network.points)
        self._lower = [0] * size
        self._upper: list[int | None] = [None] * size
        self._cause: list[int | None] = [None] * size
        self._blockers = [set(blockers) for blockers in network.blockers]
        self._blocked: list[list[int]] = [[] for _ in range(size)]
        for point, blockers in enumerate(self._blockers):
            for blocker in blockers:
                self._blocked[blocker].append(point)
        self._waits: list[list[int]] = [[] for _ in range(size)]
        for number, wait in enumerate(self._tables.waits):
            self._waits[wait.point].append(number)

    # -- what has happened -------------------------------------------------------------------------------------------

    def happened(self, point: int, time: Fraction) -> None:
        """A time point has happened; its time need not be in its window."""
        ticks = self._ticks(time)
        self._times[point] = ticks
        for other, weight in self._tables.above[point]:
            latest = ticks + weight
            known = self._upper[other]
            if known is None or latest < known:
                self._upper[other] = latest
                self._cause[other] = point
        for other, weight in self._tables.below[point]:
            self._lower[other] = max(self._lower[other], ticks + weight)
        for other in self._blocked[point]:
            self._blockers[other].discard(point)

    def has_happened(self, point: int) -> bool:
        return point in self._times

    def time(self, point: int) -> Fraction | None:
        """When a time point happened."""
        ticks = self._times.get(point)
        return None if ticks is None else Fraction(ticks, self._tables.scale)

    @property
    def times(self) -> dict[int, Fraction]:
        return {point: Fraction(ticks, self._tables.scale) for point, ticks in self._times.items()}

    # -- what may happen ---------------------------------------------------------------------------------------------

    def window(self, point: int) -> tuple[Fraction, Fraction | None]:
        """The least and the greatest time at which a time point may happen; None is never too late."""
        upper = self._upper[point]
        scale = self._tables.scale
        return Fraction(self._lower[point], scale), None if upper is None else Fraction(upper, scale)

    def is_late(self, point: int, now: Fraction) -> bool:
        """Whether its greatest time has passed."""
        return self.first_late((point,), now) is not None

    def first_late(self, points: Iterable[int], now: Fraction) -> int | None:
        """The first of these whose greatest time has passed."""
        ticks = self._ticks(now)
        for point in points:
            upper = self._upper[point]
            if upper is not None and upper < ticks:
                return point
        return None

    def first_empty(self, points: Iterable[int]) -> int | None:
        """The first of these that no time is left for."""
        for point in points:
            upper = self._upper[point]
            if upper is not None and upper < self._lower[point]:
                return point
        return None

    def first_ready(self, points: Iterable[int], now: Fraction) -> int | None:
        """The first of these that can be dispatched."""
        ticks = self._ticks(now)
        for point in points:
            ready = self._ready(point)
            if ready is not None and ready <= ticks:
                return point
        return None

    def next_moment(self, points: Iterable[int], now: Fraction, patience: Fraction) -> Fraction | None:
        """When the first of these becomes ready, or its greatest time plus `patience` comes, after now."""
        ticks, grace = self._ticks(now), self._ticks(patience)
        ticks = self._ticks(now)  # in the units that patience may have asked for
        found: int | None = None
        for point in points:
            ready, upper = self._ready(point), self._upper[point]
            for moment in (ready, None if upper is None else upper + grace):
                if moment is not None and moment > ticks and (found is None or moment < found):
                    found = moment
        return None if found is None else Fraction(found, self._tables.scale)

    def ready(self, point: int) -> Fraction | None:
        """From when on a time point can be dispatched, if nothing else happens; None if it waits for something."""
        ready = self._ready(point)
        return None if ready is None else Fraction(ready, self._tables.scale)

    def _ready(self, point: int) -> int | None:
        if self._blockers[point]:
            return None
        ready = self._lower[point]
        for number in self._waits[point]:
            wait = self._tables.waits[number]
            if wait.end in self._times:
                continue
            if wait.delay is None:
                return None
            ready = max(ready, self._times[wait.activation] + wait.delay)
        return ready

    def cause(self, point: int) -> int | None:
        """What its greatest time follows from."""
        return self._cause[point]

    def over(self, network: DispatchNetwork) -> Windows:
        """The same history in another network with the same time points."""
        fresh = Windows(network, self._tables.scale)
        for point, ticks in self._times.items():
            fresh.happened(point, Fraction(ticks, self._tables.scale))
        return fresh

    # -- units -------------------------------------------------------------------------------------------------------

    def _ticks(self, time: Fraction) -> int:
        if self._tables.scale % time.denominator:
            self._rescale(time.denominator)
        return time.numerator * (self._tables.scale // time.denominator)

    def _rescale(self, denominator: int) -> None:
        tables = self.network.scaled(lcm(self._tables.scale, denominator))
        factor = tables.scale // self._tables.scale
        self._times = {point: ticks * factor for point, ticks in self._times.items()}
        self._lower = _times(self._lower, factor)
        self._upper = [None if ticks is None else ticks * factor for ticks in self._upper]
        self._tables = tables


def _times(numbers: Iterable[int], factor: int) -> list[int]:
    return [number * factor for number in numbers]
