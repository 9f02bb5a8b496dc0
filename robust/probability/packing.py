"""With many parameters: boxes inside the envelope that have nothing in common, and random points.

Both go without the envelope itself. The boxes are found by exact widening, each from a good point of the most probable
part that none of them covers yet; together they bound the probability from below. Random points estimate it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from heapq import heappop, heappush
from random import Random

from robust.irr.widen import DiscoveredBadSet, Widening, faces_of
from robust.plan.model import Parameter
from robust.probability.distributions import Distribution
from robust.probability.measure import Bounds, box_probability
from robust.qe.box import Box, Interval, Side
from robust.qe.estimate import proportion_bounds
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.smt.limits import Deadline

CONFIDENCE = Fraction(999, 1000)
"""Of the estimate."""
ATTEMPTS = 8
"""Points that are tried in a part before it is divided."""
LEAST = Fraction(1, 10**6)
"""Parts that are less probable are left alone."""


def widen_around(
    point: Mapping[str, Fraction],
    parameters: Sequence[Parameter],
    distributions: Mapping[str, Distribution],
    *,
    bad: DiscoveredBadSet,
    pieces: list[Polyhedron],
    deadline: Deadline,
    on_box: Callable[[Box], None],
) -> None:
    """Exact widening from a good point, each parameter as fast as its values scatter; see :class:`Widening`."""
    scales = {name: distribution.scale for name, distribution in distributions.items()}
    moved = [replace(known, nominal=point[known.name], weight=scales[known.name]) for known in parameters]
    groups = [faces_of(moved)]
    Widening(bad=bad, parameters=moved, pieces=pieces, groups=groups, deadline=deadline, on_box=on_box).run()


class Packing:
    """Boxes without common points, the first around the nominal values if these are good.

    Args:
        bad: the bad set.
        parameters: of the plan.
        distributions: of the parameters.
    """

    def __init__(
        self, bad: DiscoveredBadSet, parameters: Sequence[Parameter], distributions: Mapping[str, Distribution]
    ) -> None:
        self._bad = bad
        self._parameters = parameters
        self._distributions = {name: distribution.settled for name, distribution in distributions.items()}
        self._random = Random(0)  # noqa: S311 - reproducible searches, no secrets
        self._names = tuple(parameter.name for parameter in parameters)
        self._pieces: list[Polyhedron] = []
        self._parts: list[tuple[Fraction, int, Box]] = []
        self._made = 0
        self.boxes: list[Box] = []
        self.lower = Fraction(0)
        self._push(Box.declared(parameters))

    def _push(self, part: Box) -> None:
        probability = box_probability(part, self._distributions).upper
        if probability > LEAST:
            self._made += 1
            heappush(self._parts, (-probability, self._made, part))

    def run(self, deadline: Deadline) -> None:
        """Add boxes until hardly anything is left that could hold one.

        Raises:
            OutOfTimeError: if the deadline passes first; the boxes are good by then.
        """
        while self._parts:
            part = heappop(self._parts)[2]
            point = self._good_point(part, deadline)
            if point is None:
                self._divide(part)
                continue
            box = self._widened(part, point, deadline)
            self.boxes.append(box)
            self.lower += box_probability(box, self._distributions).lower
            for rest in _around(part, box):
                self._push(rest)

    def _good_point(self, part: Box, deadline: Deadline) -> dict[str, Fraction] | None:
        for attempt in range(ATTEMPTS):
            point = {name: self._value(name, part[name], attempt) for name in self._names}
            if not any(point in piece for piece in self._pieces):
                piece = self._bad.piece_in(Box.point(point), deadline)
                if piece is None:
                    return point
                self._pieces.append(piece)
        return None

    def _value(self, name: str, interval: Interval, attempt: int) -> Fraction:
        """First the nominal value, or what is nearest to the middle of the distribution; then random ones."""
        distribution = self._distributions[name]
        if attempt == 0 and distribution.kind != "constant":
            value = next(parameter.nominal for parameter in self._parameters if parameter.name == name)
        else:
            value = distribution.centre if attempt < 2 else distribution.draw(self._random, None)
        if value in interval:
            return value
        if interval.width is None:
            return _near_end(interval, distribution.scale / 2)
        share = Fraction(1, 2) if attempt < 2 else Fraction(self._random.random())
        return interval.some_value() + (share - Fraction(1, 2)) * interval.width

    def _widened(self, part: Box, point: Mapping[str, Fraction], deadline: Deadline) -> Box:
        """A box in a part around a good point that nothing but bad values and the part's own sides stop."""
        walls = [Polyhedron(self._names, (half,)) for side in part.constraints() for half in side.negation()]
        pieces = [*walls, *self._pieces]
        boxes = [Box.point(point)]
        widen_around(
            point,
            self._parameters,
            self._distributions,
            bad=self._bad,
            pieces=pieces,
            deadline=deadline,
            on_box=boxes.append,
        )
        self._pieces += pieces[len(walls) + len(self._pieces) :]
        return boxes[-1]

    def _divide(self, part: Box) -> None:
        """Two halves, if good values are rare in a part: the one parameter that is widest is cut."""
        name = max(self._names, key=lambda name: self._breadth(name, part[name]))
        interval = part[name]
        middle = self._value(name, interval, 1) if interval.width is None else interval.some_value()
        if interval.width != 0 and middle not in (interval.lower, interval.upper):
            self._push(part.replace(name, interval.with_end(Side.UPPER, middle, closed=False)))
            self._push(part.replace(name, interval.with_end(Side.LOWER, middle)))

    def _breadth(self, name: str, interval: Interval) -> Fraction:
        distribution = self._distributions[name]
        if distribution.kind == "constant":
            return Fraction(-1)
        return box_probability(Box({name: interval}), {name: distribution}).upper


def _near_end(interval: Interval, step: Fraction) -> Fraction:
    """A value of an interval with an infinite end, a step from the other."""
    if interval.upper is not None:
        return interval.upper - step
    return step if interval.lower is None else interval.lower + step


def _around(part: Box, box: Box) -> list[Box]:
    """What a box leaves of a part around it, in boxes without common points; single values are left out."""
    boxes = []
    rest = part
    for name, inner in box.intervals.items():
        outer = rest[name]
        for side, other in ((Side.LOWER, Side.UPPER), (Side.UPPER, Side.LOWER)):
            if (end := inner.end(side)) is not None and end != outer.end(side):
                boxes.append(rest.replace(name, outer.with_end(other, end, closed=False)))
        rest = rest.replace(name, inner)
    return boxes


# -- random points -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class SampledEstimate:
    """The plan succeeded at `successes` of `draws` random points; the probability of success is between `lower` and
    `upper` with `confidence` [Clopper and Pearson 1934]: this is statistics, no proof."""

    draws: int
    successes: int
    lower: float
    upper: float
    confidence: Fraction = CONFIDENCE

    @staticmethod
    def of(successes: int, draws: int) -> SampledEstimate:
        return SampledEstimate(draws, successes, *proportion_bounds(successes, draws, float(CONFIDENCE)))


@dataclass(frozen=True, slots=True)
class LateShare:
    """How probably the plan is late along a chain that ends where a point is due, or that has a duration on it.

    `estimate` is the share of draws in which it is the chain that is latest. `certified` bounds how probably any chain
    that ends there, or has the duration on it, is late.
    """

    name: str
    estimate: float
    certified: Bounds | None = None


@dataclass(frozen=True)
class LatenessDraws:
    """Random draws of all durations, and how late each of them ends: statistics, no proof.

    `gain` is the share of draws that one unit of time more would save; `certified_gain` bounds by how much more
    probable success is with it.
    """

    draws: int
    successes: int
    gain: float
    points: tuple[LateShare, ...]
    durations: tuple[LateShare, ...]
    certified_gain: Bounds | None = None


class Points:
    """Random points and what the plan makes of them: the envelope says so where it is known, else the solver.

    Args:
        bad: the bad set.
        distributions: of the parameters.
        good: boxes of good values.
        region: the envelope, if it is known.
    """

    def __init__(
        self,
        bad: DiscoveredBadSet,
        distributions: Mapping[str, Distribution],
        *,
        good: Sequence[Box] = (),
        region: Region | None = None,
    ) -> None:
        self._bad = bad
        self._distributions = {name: distribution.settled for name, distribution in distributions.items()}
        self._good = good
        self._region = region
        self._pieces: list[Polyhedron] = []
        self._random = Random(0)  # noqa: S311 - a simulation
        self.draws = self.successes = 0

    def run(self, draws: int, deadline: Deadline) -> None:
        """Draw random points until there are `draws`.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        while self.draws < draws:
            deadline.enforce()
            point = {name: distribution.draw(self._random, None) for name, distribution in self._distributions.items()}
            succeeds = self._succeeds(point, deadline)
            self.draws += 1
            self.successes += succeeds

    def _succeeds(self, point: Mapping[str, Fraction], deadline: Deadline) -> bool:
        if self._region is not None:
            return point in self._region
        if any(box.includes(point) for box in self._good):
            return True
        for index, piece in enumerate(self._pieces):
            if point in piece:
                self._pieces.insert(0, self._pieces.pop(index))  # likely to hold others, too
                return False
        obstacle = self._bad.piece_in(Box.point(point), deadline)
        if obstacle is not None:
            self._pieces.insert(0, obstacle)
        return obstacle is None

    @property
    def estimate(self) -> SampledEstimate | None:
        """The estimate from the points drawn so far; None without any point."""
        return SampledEstimate.of(self.successes, self.draws) if self.draws else None
