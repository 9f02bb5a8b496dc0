"""A network of which one point after the other happens: when the rest may, kept up to date by what changes.

A network that has a schedule still has one after some points have happened if and only if the earliest time of each
point is not after its latest. What happens raises earliest times and lowers latest ones along the bounds from there. A
length that is known in the end, and was assumed before, may lower and raise them: those that rested on it are found by
the bounds that they meet exactly, and worked out anew.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from heapq import heapify, heappop, heappush

from robust.network.differences import UNBOUNDED, Bound, windows

_Steps = Sequence[dict[int, int]]


class LiveNetwork:
    """The earliest and latest time of each point of a network.

    Args:
        order: a schedule of the network; following bounds in its order is quick.
        bounds: the network. Each has an owner, or None: what an owner says can be taken back.
        times: what has happened.
        now: nothing else happens before.

    `earliest` and `latest` mean nothing if it is not `open`: then no schedule is left.
    """

    def __init__(
        self, order: Sequence[int], bounds: Collection[tuple[Bound, object]], times: Mapping[int, int], now: int
    ) -> None:
        self._order = order
        self._pairs: dict[tuple[int, int], list[tuple[int, object]]] = {}
        for (source, target, weight), owner in bounds:
            if source != target:
                self._pairs.setdefault((source, target), []).append((weight, owner))
        for known in self._pairs.values():
            known.sort(key=lambda each: -each[0])
        self._owned: dict[object, list[tuple[int, int]]] = {}
        for (source, target, _), owner in bounds:
            if owner is not None and source != target:
                self._owned.setdefault(owner, []).append((source, target))
        self._after: list[dict[int, int]] = [{} for _ in order]
        self._before: list[dict[int, int]] = [{} for _ in order]
        for (source, target), known in self._pairs.items():
            self._after[source][target] = self._before[target][source] = known[0][0]
        self._restart(times, now)

    def _restart(self, times: Mapping[int, int], now: int) -> None:
        self.times, self.now = dict(times), now
        bounds = [(a, b, weight) for a, after in enumerate(self._after) for b, weight in after.items()]
        found = windows(self._order, bounds, times, now)
        self.open = found is not None
        if found is not None:
            self.earliest = [low for low, _ in found]
            self.latest = [UNBOUNDED if high is None else high for _, high in found]
            self._rising = [(low, point) for point, low in enumerate(self.earliest) if point and point not in times]
            heapify(self._rising)

    def window(self, point: int) -> tuple[int, int | None]:
        """The earliest and latest time; None is no limit."""
        latest = self.latest[point]
        return self.earliest[point], None if latest > UNBOUNDED // 2 else latest

    def following(self, point: int) -> Iterable[tuple[int, int]]:
        """The points that bounds lead to from a point, with their weights."""
        return self._after[point].items()

    def lift(self, now: int) -> None:
        """What has not happened does so at this time at the earliest, which is not before the last one."""
        self.now = max(self.now, now)
        if not self.open:
            return
        raised = []
        while self._rising and self._rising[0][0] < now:
            low, point = heappop(self._rising)
            if point not in self.times and self.earliest[point] == low:
                self.earliest[point] = now
                raised.append(point)
        for point in raised:
            heappush(self._rising, (now, point))
        self._spread(raised, rising=True)

    def happen(self, point: int, time: int, gone: object = None) -> None:
        """A point happens; an owner of bounds to and from this point says nothing any more."""
        self._drop(gone)
        if not self.open:
            self._restart({**self.times, point: time}, self.now)
            return
        fallen = self._resting(point, rising=True) if time < self.earliest[point] else set()
        risen = self._resting(point, rising=False) if time > self.latest[point] else set()
        self._work_out(fallen, risen)
        if not self.open or not self.earliest[point] <= time <= self.latest[point]:
            self._restart({**self.times, point: time}, self.now)
            return
        self.times[point] = self.earliest[point] = self.latest[point] = time
        self._spread([point], rising=True)
        self._spread([point], rising=False)

    def _drop(self, owner: object) -> None:
        for pair in self._owned.pop(owner, ()):
            source, target = pair
            known = self._pairs[pair] = [each for each in self._pairs[pair] if each[1] != owner]
            if known:
                self._after[source][target] = self._before[target][source] = known[0][0]
            else:
                self._after[source].pop(target, None)
                self._before[target].pop(source, None)

    def _resting(self, point: int, *, rising: bool) -> set[int]:
        """A point, and the points whose times rest on its."""
        known, steps, sign = self._side(rising)
        found, waiting = {point}, [point]
        while waiting:
            here = waiting.pop()
            for other, weight in steps[here].items():
                is_open = other and other not in found and other not in self.times
                if is_open and known[other] == known[here] + sign * weight:
                    found.add(other)
                    waiting.append(other)
        return found

    def _work_out(self, fallen: Collection[int], risen: Collection[int]) -> None:
        """Earliest times of some points, and latest ones of others, from what stands."""
        for point in fallen:
            steps = self._before[point].items()
            self.earliest[point] = max(
                (self.earliest[a] + weight for a, weight in steps if a not in fallen), default=self.now
            )
            self.earliest[point] = max(self.now, self.earliest[point])
            heappush(self._rising, (self.earliest[point], point))
        for point in risen:
            steps = self._after[point].items()
            self.latest[point] = min(
                (self.latest[b] - weight for b, weight in steps if b not in risen), default=UNBOUNDED
            )
        self._spread(fallen, rising=True)
        self._spread(risen, rising=False)

    def _side(self, rising: bool) -> tuple[list[int], _Steps, int]:
        return (self.earliest, self._after, 1) if rising else (self.latest, self._before, -1)

    def _spread(self, points: Iterable[int], *, rising: bool) -> None:
        """Follow the bounds from points whose times moved, in the order of the schedule."""
        known, steps, sign = self._side(rising)
        other_side = self.latest if rising else self.earliest
        order, times = self._order, self.times
        heap = [(sign * order[point], point) for point in points]
        heapify(heap)
        waiting = {point for _, point in heap}
        while heap and self.open:
            here = heappop(heap)[1]
            waiting.discard(here)
            base = known[here]
            if (base - other_side[here]) * sign > 0:
                self.open = False
                return
            if base >= UNBOUNDED // 2:
                continue
            for other, weight in steps[here].items():
                new = base + sign * weight
                if (new - known[other]) * sign > 0:
                    if not other or other in times:
                        self.open = False
                        return
                    known[other] = new
                    if rising:
                        heappush(self._rising, (new, other))
                    if other not in waiting:
                        waiting.add(other)
                        heappush(heap, (sign * order[other], other))
