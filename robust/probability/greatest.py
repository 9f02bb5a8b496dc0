"""The box of greatest probability inside the envelope, with a bound on what any other box can have.

A box misses a bad polyhedron if and only if its ends satisfy one of some linear constraints, see
:mod:`robust.irr.exact`. Where the ends may be is a product of ranges; a part of it is bounded from above by the
probability of the widest box in it, after the constraints have narrowed the ranges, and from below by a box in it that
misses all that is known to be bad. The most promising part is halved until no box can be more probable by more than
asked. The winner is checked, and what is bad in it adds a polyhedron; then each side is moved outwards as far as it
goes, so that no valid box contains the result.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from heapq import heappop, heappush
from math import ceil, floor, lcm
from typing import Unpack

from robust.encode.interface import Encoding
from robust.irr import search, widen
from robust.irr.exact import BoxMethod, ExactSearch, end_of, missing
from robust.plan.model import Parameter
from robust.probability import measure, packing
from robust.probability.distributions import UNIT, ZERO, Distribution, Enclosure, product_of
from robust.qe import constraint
from robust.qe.box import Box, Face, Growing, Interval, Side
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Exporter

FAR = 16
"""Widths of a distribution beyond which an end counts as infinite."""
FINENESS = 24
"""Ends are looked for among multiples of 2⁻²⁴ of the least width of a distribution, or finer."""
PARTS = 20_000
"""Parts after which the best box so far is good enough, if there is no time limit."""
SIDES = 14
"""Constraints of a polyhedron, and ends of boxes that it restricts, up to which it is projected to the ends."""
_SHOWN = 10**12
"""Bounds are rounded up to multiples of one over this."""
ROUNDS = 4
"""How often the constraints narrow the ranges of a part."""


@dataclass(frozen=True, slots=True)
class Limit:
    """`Σ factor · end ≤ limit` over ends by their number, in units: `limit` is rounded down, and `loose` up."""

    factors: tuple[tuple[int, int], ...]
    limit: int
    loose: int


Clause = tuple[Limit, ...]
Ranges = tuple[tuple[int, int], ...]
"""Where each end may be: twice the number of a parameter is its lower end, one more its upper end."""


class ProbableEnds:
    """The search for the ends of the most probable box that misses all that is known to be bad.

    Args:
        parameters: of the plan.
        distributions: of these.
    """

    def __init__(self, parameters: Sequence[Parameter], distributions: Mapping[str, Distribution]) -> None:
        self._names = [parameter.name for parameter in parameters]
        self._distributions = [distributions[name].settled for name in self._names]
        fine = max(-(-(1 << FINENESS) // distribution.scale) for distribution in self._distributions)
        bounds = [end for parameter in parameters for end in (parameter.lower, parameter.upper) if end is not None]
        values = [value for distribution in self._distributions for value in distribution.exact_values]
        self._unit = lcm(*(value.denominator for value in (*bounds, *values))) << max(0, int(fine).bit_length())
        self._index = {
            end_of((name, side)): 2 * number + (side is Side.UPPER)
            for number, name in enumerate(self._names)
            for side in Side
        }
        self._limits = [self._range(*pair) for pair in zip(parameters, self._distributions, strict=True)]
        self._endless = [
            (parameter.lower is None and known.support[0] is None, parameter.upper is None and known.support[1] is None)
            for parameter, known in zip(parameters, self._distributions, strict=True)
        ]
        self._clauses: list[Clause] = []
        self._share = cache(self._between)
        self.is_exact = True
        """Whether every box that misses what is bad satisfies the clauses."""
        self.best: list[int] | None = None
        self.value = 0
        """The probability of the best box, from below."""
        self.bound = UNIT
        """What no box can exceed."""

    def _range(self, parameter: Parameter, distribution: Distribution) -> tuple[int, int]:
        """Where the ends of a parameter may be."""
        reach = FAR * distribution.scale
        lower, upper = distribution.support
        low = distribution.centre - reach if lower is None else lower
        high = distribution.centre + reach if upper is None else upper
        low = low if parameter.lower is None else max(low, parameter.lower)
        high = high if parameter.upper is None else min(high, parameter.upper)
        return floor(low * self._unit), ceil(high * self._unit)

    def add(self, piece: Polyhedron, *, strictly: bool = False) -> None:
        """The piece is bad; `strictly` if a box that only touches it is not good either."""
        if len(piece.constraints) + 2 * len(piece.mentioned) <= SIDES:
            sides: Sequence[constraint.LinearConstraint] = missing(piece, list(self._index))
        else:
            # To be beyond one of its sides is enough to miss it, but not needed.
            self.is_exact = len(piece.constraints) == 1 and self.is_exact
            sides = [_throughout(half) for side in piece.constraints for half in side.negation()]
        self.is_exact = self.is_exact and not strictly
        limits = [self._limit(side, strictly=strictly) for side in sides if not _is_emptiness(side)]
        self._clauses.append(tuple(limits))
        if self.best is not None and not self._satisfies(self.best):
            self.best, self.value = None, 0

    def _limit(self, side: constraint.LinearConstraint, *, strictly: bool) -> Limit:
        """In units. A box without its ends may touch what is bad, unless nothing varies there."""
        factors = tuple((self._index[name], factor) for name, factor in side.coefficients)
        fixed = all(self._limits[at // 2][0] == self._limits[at // 2][1] for at, _ in factors)
        exact = side.constant * self._unit
        limit = floor(exact)
        apart = side.is_strict and (fixed or strictly) and limit == exact
        return Limit(factors, limit - 1 if apart else limit, ceil(exact))

    def offer(self, box: Box) -> None:
        """A box that is good may be the best."""
        ends = []
        for name, (low, high) in zip(self._names, self._limits, strict=True):
            interval = box[name]
            ends.append(low if interval.lower is None else min(high, max(low, ceil(interval.lower * self._unit))))
            ends.append(high if interval.upper is None else max(low, min(high, floor(interval.upper * self._unit))))
        if self._satisfies(ends):
            self._consider(ends)

    def box(self) -> Box | None:
        """The best box, without its ends where there is anything between them."""
        if self.best is None:
            return None
        intervals = {}
        for number, name in enumerate(self._names):
            lower, upper = (Fraction(self.best[2 * number + side], self._unit) for side in (0, 1))
            intervals[name] = Interval(lower, upper, lower == upper, lower == upper)
        return Box(intervals)

    # -- the search ----------------------------------------------------------------------------------------------------

    def run(self, within: Fraction, deadline: Deadline, most: int | None) -> None:
        """Halve parts until the bound is close to the best, or after `most` of them.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        wanted = floor(within * UNIT)
        start: Ranges = tuple(limits for limits in self._limits for _ in range(2))
        parts: list[tuple[int, int, Ranges]] = []
        count = 0
        highest_closed = 0
        pending = [start]
        while True:
            for ranges in pending:
                count += 1
                narrowed = self._narrowed(ranges)
                if narrowed is None:
                    continue
                outer = [narrowed[end][end % 2] for end in range(len(narrowed))]
                value = self._mass(outer)[1]
                if self._satisfies(outer):
                    self._consider(outer)
                    highest_closed = max(highest_closed, value)
                    continue
                self._look_inside(narrowed)
                heappush(parts, (-value, count, narrowed))
            self.bound = max(highest_closed, self.value, -parts[0][0] if parts else 0)
            if not parts or self.bound - self.value <= wanted or (most is not None and count > most):
                return
            deadline.enforce()
            value, _, part = heappop(parts)
            pending = self._halves(part)
            if not pending:
                highest_closed = max(highest_closed, -value)

    def _look_inside(self, ranges: Ranges) -> None:
        """The narrowest box of a part, as far as it can be extended."""
        inner = [ranges[end][1 - end % 2] for end in range(len(ranges))]
        if any(inner[at] > inner[at + 1] for at in range(0, len(inner), 2)):
            middle = [sum(ranges[at]) + sum(ranges[at + 1]) >> 2 for at in range(0, len(inner), 2)]
            inner = [value for value in middle for _ in range(2)]
        if self._satisfies(inner):
            self._consider(self._extended(inner))

    def _extended(self, ends: list[int]) -> list[int]:
        """Each end moved outwards as far as it goes, where most is gained first."""
        extended = list(ends)
        waiting = set(range(len(extended)))
        while waiting:
            moved = {end: self._farthest(extended, end) for end in waiting}
            gains = {end: self._mass([*extended[:end], place, *extended[end + 1 :]])[0] for end, place in moved.items()}
            best = max(waiting, key=lambda end: gains[end])
            extended[best] = moved[best]
            waiting.remove(best)
        return extended

    def _farthest(self, ends: Sequence[int], end: int) -> int:
        """How far an end may move while the others stay."""
        low, high = self._limits[end // 2]
        best = high if end % 2 else low
        for clause in self._clauses:
            reached = []
            for side in clause:
                rest = side.limit - sum(factor * ends[at] for at, factor in side.factors if at != end)
                factor = next((factor for at, factor in side.factors if at == end), 0)
                if factor == 0 or (factor > 0) != (end % 2 == 1):
                    if rest - factor * ends[end] >= 0:
                        reached.append(high if end % 2 else low)
                else:
                    reached.append(rest // factor if factor > 0 else -(rest // -factor))
            best = min(best, max(reached, default=ends[end])) if end % 2 else max(best, min(reached, default=ends[end]))
        return max(best, ends[end]) if end % 2 else min(best, ends[end])

    def _halves(self, ranges: Ranges) -> list[Ranges]:
        """Two parts: the end is divided whose place matters most."""
        outer = [ranges[end][end % 2] for end in range(len(ranges))]

        def left(end: int) -> int:
            inner = ranges[end][1 - end % 2]
            if (end % 2 and inner < outer[end - 1]) or (not end % 2 and inner > outer[end + 1]):
                return -1
            return self._mass([*outer[:end], inner, *outer[end + 1 :]])[1]

        wide = [end for end, (low, high) in enumerate(ranges) if high - low > 1]
        if not wide:
            return []
        end = min(wide, key=left)
        low, high = ranges[end]
        middle = (low + high) // 2
        before, after = ranges[:end], ranges[end + 1 :]
        return [(*before, (low, middle), *after), (*before, (middle, high), *after)]

    def _narrowed(self, ranges: Ranges) -> Ranges | None:
        """The ranges without places that no clause allows; None if there is no box."""
        current = list(ranges)
        for _ in range(ROUNDS):
            before = list(current)
            for at in range(0, len(current), 2):  # the lower end is not above the upper one
                (low, high), (bottom, top) = current[at], current[at + 1]
                current[at], current[at + 1] = (low, min(high, top)), (max(bottom, low), top)
                if current[at][0] > current[at][1] or current[at + 1][0] > current[at + 1][1]:
                    return None
            for clause in self._clauses:
                possible = [side for side in clause if _least(side, current) <= side.loose]
                if not possible:
                    return None
                if len(possible) == 1 and not _narrow(possible[0], current):
                    return None
            if current == before:
                break
        return tuple(current)

    # -- one box -------------------------------------------------------------------------------------------------------

    def _satisfies(self, ends: Sequence[int]) -> bool:
        return all(
            any(sum(factor * ends[at] for at, factor in side.factors) <= side.limit for side in clause)
            for clause in self._clauses
        )

    def _consider(self, ends: list[int]) -> None:
        value = self._mass(ends)[0]
        if self.best is None or value > self.value:
            self.best, self.value = ends, value

    def _mass(self, ends: Sequence[int]) -> Enclosure:
        return product_of(map(self._share, range(len(self._distributions)), ends[::2], ends[1::2]))

    def _between(self, number: int, low: int, high: int) -> Enclosure:
        """The probability between two ends; where nothing is in the way, all that is beyond as well."""
        if low > high:
            return ZERO
        least, most = self._limits[number]
        below, above = self._endless[number]
        lower = None if low == least and below else Fraction(low, self._unit)
        upper = None if high == most and above else Fraction(high, self._unit)
        inside = Interval(lower, upper, lower is not None, upper is not None)
        return measure.interval_probability(inside, self._distributions[number])


def _is_emptiness(side: constraint.LinearConstraint) -> bool:
    """Whether it says that a lower end is above the upper one: no box is like that."""
    return (
        side.is_strict
        and not side.constant
        and sorted(factor for _, factor in side.coefficients) == [-1, 1]
        and (len({name.partition(" end of ")[2] for name in side.parameters}) == 1)
    )


def _throughout(half: constraint.LinearConstraint) -> constraint.LinearConstraint:
    """The constraint on the ends of a box that holds if it holds in all of the box."""
    factors = {end_of((name, Side.UPPER if factor > 0 else Side.LOWER)): factor for name, factor in half.coefficients}
    return constraint.LinearConstraint.of(factors, half.relation, half.constant)


def _least(side: Limit, ranges: Sequence[tuple[int, int]]) -> int:
    return sum(factor * ranges[at][factor < 0] for at, factor in side.factors)


def _narrow(side: Limit, ranges: list[tuple[int, int]]) -> bool:
    """Leave out places of ends that break a side wherever the others are; whether any are left."""
    slack = side.loose - _least(side, ranges)
    for at, factor in side.factors:
        low, high = ranges[at]
        if factor > 0:
            high = min(high, low - (-slack // factor))
        else:
            low = max(low, high + (-slack // -factor))
        if low > high:
            return False
        ranges[at] = low, high
    return True


class GreatestBox(ExactSearch):
    """The most probable box.

    Args:
        encoding: the plan's formulas.
        distributions: of the parameters.
        within: how much more probable another box may be.
        solver: `z3` or `cvc5`.
        exporter: where queries are written, if anywhere.
        conduct: see :class:`Conduct`.
    """

    def __init__(
        self,
        encoding: Encoding,
        distributions: Mapping[str, Distribution],
        *,
        within: Fraction,
        solver: str = "z3",
        exporter: Exporter | None = None,
        **conduct: Unpack[search.Conduct],
    ) -> None:
        super().__init__(encoding, method="risk", solver=solver, exporter=exporter, **conduct)
        self._within = within
        self._distributions = {name: distribution.settled for name, distribution in distributions.items()}
        self._ends = ProbableEnds(encoding.plan.parameters, self._distributions)
        self._proved = False

    @property
    def bound(self) -> Fraction | None:
        """What no box is more probable than."""
        if not self._proved:
            return None
        return Fraction(-(-self._ends.bound * _SHOWN // UNIT), _SHOWN)

    def _search(self) -> None:
        pieces = self._pieces
        self._widen_around(pieces)
        pieces += self._enumerated()
        added = 0
        limit = None if self.deadline.moment is not None else PARTS
        while True:
            for piece in pieces[added:]:
                self._ends.add(piece)
            added = len(pieces)
            if self.verified:
                self._ends.offer(self.box)
            try:
                self._ends.run(self._within, self._half_of_time(), limit)
            except OutOfTimeError:
                self.deadline.enforce()
            self._proved = self._ends.is_exact
            box = self._ends.box()
            if box is None:
                # What the plan's nominal values are, if they are good, is a box without any probability.
                return None if self.verified else self._widen()
            obstacle = self._bad.piece_in(box, self.deadline)
            if obstacle is None:
                self._keep(box)
                self._extend()
                return None
            if obstacle in pieces:
                self._ends.add(obstacle, strictly=True)
            else:
                pieces.append(obstacle)

    def _half_of_time(self) -> Deadline:
        remaining = self.deadline.remaining
        return Deadline.after(None if remaining is None else remaining / 2)

    def _widen_around(self, pieces: list[Polyhedron]) -> None:
        """A good box at once, if the nominal values are good, or the middle of the distributions is."""
        plan = self.encoding.plan
        middle = {parameter.name: self._distributions[parameter.name].centre for parameter in plan.parameters}
        for point in ({parameter.name: parameter.nominal for parameter in plan.parameters}, middle):
            fixed = {name: value if self._distributions[name].kind != "constant" else middle[name]
                     for name, value in point.items()}  # fmt: skip
            piece = self._bad.piece_in(Box.point(fixed), self.deadline)
            if piece is not None:
                pieces.append(piece)
                continue
            packing.widen_around(
                fixed,
                plan.parameters,
                self._distributions,
                bad=self._bad,
                pieces=pieces,
                deadline=self.deadline,
                on_box=self._keep,
            )
            return

    def _extend(self) -> None:
        """Close the ends that may be closed, and move each outwards as far as it goes."""
        for face in widen.faces_of(self.encoding.plan.parameters):
            while (moved := self._moved(face)) != self.box:
                piece = self._bad.piece_in(moved, self.deadline)
                if piece is None:
                    self._keep(moved)
                    break
                if piece in self._pieces:
                    break
                self._pieces.append(piece)

    def _moved(self, face: Face) -> Box:
        """The box with a face as far out as what is known allows."""
        name, side = face
        end = self.box[name].end(side)
        if end is None:
            return self.box
        growing = Growing(self.box, {face: (end, Fraction(1))})
        least = widen.first(widen.least_stretch(piece, growing) for piece in self._pieces)
        if least is None:
            return self.box.moved(face, None)
        return self.box.moved(face, end + side.sign * least.value, closed=not least.attained)


@dataclass(frozen=True)
class RandomBoxMethod(BoxMethod):
    """How the most probable box is found.

    Attributes:
        distributions: of the parameters.
        within: how much more probable another box may be.
    """

    distributions: Mapping[str, Distribution] = field(default_factory=dict)
    within: Fraction = Fraction(1, 200)

    def search(
        self, formulas: Encoding, *, solver: str, exporter: Exporter | None = None, **conduct: Unpack[search.Conduct]
    ) -> GreatestBox:
        return GreatestBox(
            formulas, self.distributions, within=self.within, solver=solver, exporter=exporter, **conduct
        )
