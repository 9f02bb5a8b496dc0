"""Executing a dynamically controllable network while contingent links end when nature likes.

After the check, the graph of all edges that hold whatever happens, with waits taken as if every link that has not ended
took longest, says when each time point may happen at the earliest. Whoever executes time points not before that, and no
later than it says, never gets stuck: an observation only removes waits. Execution at the earliest time is the strategy
of L. Hunsberger (2013), *A faster execution algorithm for dynamically controllable STNUs*.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from fractions import Fraction

from robust.errors import InputError, RefutedError
from robust.execute.controllability.dynamic import Case, DynamicAnswer, dynamic
from robust.execute.controllability.stnu import ContingentLink, Stnu, bounds_text, explain
from robust.plan.model import ZERO, TimePoint


@dataclass(frozen=True, slots=True)
class Bound:
    """`t_source ≥ t_target + delay`, until the contingent link of that index has ended; None for ever.

    Nodes are those of the normal form. A `delay` of None waits until the link has ended.
    """

    source: int
    target: int
    delay: Fraction | None
    label: int | None


class DynamicDispatch:
    """When to execute what: tell it what has happened, ask it what may.

    Args:
        answer: of :func:`robust.execute.controllability.dynamic.dynamic`, for a network that is controllable; or the
            network itself.

    Raises:
        RefutedError: if the network is not dynamically controllable.
    """

    def __init__(self, answer: DynamicAnswer | Stnu) -> None:
        answer = dynamic(answer) if isinstance(answer, Stnu) else answer
        self.stnu = answer.form.stnu
        if answer.cycle is not None:
            raise RefutedError(f"the network is not dynamically controllable: {explain(self.stnu, answer.cycle)}")
        self._node = {point: number for number, point in enumerate(self.stnu.points)}
        self._begin = answer.form.start
        self._from: list[list[Bound]] = [[] for _ in range(answer.form.size)]
        for bound in _bounds(answer):
            self._from[bound.source].append(bound)
        self._ending = {
            link.target: (index, link) for index, link in enumerate(self.stnu.links) if isinstance(link, ContingentLink)
        }
        self._times: dict[int, Fraction] = {}
        self._ended: set[int] = set()
        after = {node: self._node[self.stnu.links[index].source] for index, node in self._begin.items()}
        self._order = sorted(range(answer.form.size), key=lambda node: (after.get(node, node), node))
        self._known: tuple[Fraction, dict[int, Fraction | None]] | None = None
        self._happened(ZERO, Fraction(0))

    @property
    def times(self) -> dict[TimePoint, Fraction]:
        """What has happened, and when."""
        return {point: self._times[node] for point, node in self._node.items() if node in self._times}

    @property
    def waiting(self) -> tuple[TimePoint, ...]:
        """The time points that the dispatcher still has to execute."""
        return tuple(point for point in self.stnu.executable if self._node[point] not in self._times)

    @property
    def pending(self) -> tuple[ContingentLink, ...]:
        """The contingent links that have started and not ended yet."""
        return tuple(
            link
            for end, (_, link) in self._ending.items()
            if self._node[end] not in self._times and self._node[link.source] in self._times
        )

    def earliest(self, point: TimePoint, now: Fraction = Fraction(0)) -> Fraction | None:
        """When the time point may be executed if nothing is observed before; what has not happened follows `now`.

        None if it has to wait for an observation, however long that takes. For the end of a contingent link it is when
        it will have happened at the latest.
        """
        if self._known is None or self._known[0] != now:
            self._known = (now, self._longest(now))
        return self._known[1][self._node[point]]

    def latest(self, point: TimePoint) -> Fraction | None:
        """How long the time point can be put off, as far as is known by now; None is for ever."""
        times: dict[int, Fraction] = dict(self._times)
        queue = deque(self._times)
        while queue:
            node = queue.popleft()
            for bound in self._from[node]:
                # t_target ≤ t_source − delay
                if bound.delay is not None and bound.target not in self._times and bound.label not in self._ended:
                    time = times[node] - bound.delay
                    if bound.target not in times or time < times[bound.target]:
                        times[bound.target] = time
                        queue.append(bound.target)
        return times.get(self._node[point])

    def next_decision(self, now: Fraction = Fraction(0)) -> tuple[Fraction, tuple[TimePoint, ...]] | None:
        """The next moment at which time points are to be executed unless an observation comes first, and which.

        None if there is nothing to do but wait for an observation, or nothing at all.
        """
        found = [(time, point) for point in self.waiting if (time := self.earliest(point, now)) is not None]
        if not found:
            return None
        first = min(time for time, _ in found)
        return first, tuple(point for time, point in found if time == first)

    def execute(self, point: TimePoint, time: Fraction) -> None:
        """Say that the dispatcher has executed a time point.

        Raises:
            InputError: if it is not the dispatcher's, has happened already, or this is too early or too late.
        """
        if point in self._ending and not self._ending[point][1].is_fixed:
            raise InputError(f"found {point} executed at {time}; expected it to be observed, for its time is nature's")
        self._require_new(point, time)
        earliest, latest = self.earliest(point, time), self.latest(point)
        if earliest is None:
            raise InputError(f"found {point} executed at {time}; expected an observation first")
        if time < earliest or (latest is not None and time > latest):
            window = bounds_text(earliest, latest)
            raise InputError(f"found {point} executed at {time}; expected a time in {window}")
        self._happened(point, time)

    def observe(self, point: TimePoint, time: Fraction) -> None:
        """Say that a contingent link has ended.

        Raises:
            InputError: if the time point is not the end of one, or has happened already, or the link has not started,
                or its length is not one that the network allows.
        """
        if point not in self._ending:
            raise InputError(f"found {point} observed at {time}; expected the end of a contingent link")
        index, link = self._ending[point]
        self._require_new(point, time)
        begin = self._times.get(self._node[link.source])
        if begin is None:
            raise InputError(f"found {point} observed at {time}; expected {link.source} before it")
        if not link.allows(time - begin):
            raise InputError(f"found {link.name or link} of length {time - begin}; expected what {link} allows")
        self._ended.add(index)
        self._happened(point, time)

    def _require_new(self, point: TimePoint, time: Fraction) -> None:
        if point not in self._node:
            raise InputError(f"found {point} at {time}; expected a time point of the network")
        if self._node[point] in self._times:
            raise InputError(f"found {point} again at {time}; it happened at {self._times[self._node[point]]}")

    def _happened(self, point: TimePoint, time: Fraction) -> None:
        self._times[self._node[point]] = time
        for index, node in self._begin.items():
            link = self.stnu.links[index]
            if link.source == point:
                self._times[node] = time + (link.lower or 0)
        self._known = None

    def _longest(self, now: Fraction) -> dict[int, Fraction | None]:
        """The earliest time of every node: the longest paths to what has happened; None is infinite.

        Nodes are visited in the order of the last answer, so that mostly one round is enough, and one to see that.
        """
        times: dict[int, Fraction | None] = dict.fromkeys(range(len(self._from)), now)
        times.update(self._times)
        left = [node for node in self._order if node not in self._times]
        changed = True
        while changed:
            changed = False
            for node in left:
                time = self._pushed(node, times)
                if time != times[node]:
                    times[node], changed = time, True
        self._order = sorted(self._order, key=lambda node: _infinite_last(times[node]))
        return times

    def _pushed(self, node: int, times: dict[int, Fraction | None]) -> Fraction | None:
        """The time of a node, or a later one if one of its bounds says so."""
        known = times[node]
        for bound in self._from[node]:
            if known is None:
                break
            if bound.label not in self._ended:
                after = times[bound.target]
                if after is None or bound.delay is None:
                    known = None
                elif after + bound.delay > known:
                    known = after + bound.delay
        return known


def _infinite_last(time: Fraction | None) -> tuple[bool, Fraction]:
    return time is None, time or Fraction(0)


def _bounds(answer: DynamicAnswer) -> tuple[Bound, ...]:
    """All edges but lower-case ones; of equal ones the strongest."""
    strongest: dict[tuple[int, int, int | None], int] = {}
    for edge in (*answer.form.edges, *answer.derived):
        if edge.case is not Case.LOWER:
            key = (edge.source, edge.target, edge.label)
            strongest[key] = min(edge.weight, strongest.get(key, edge.weight))
    found = []
    for (source, target, label), weight in strongest.items():
        length = answer.form.length(weight)
        found.append(Bound(source, target, None if length is None else -length, label))
    return tuple(found)
