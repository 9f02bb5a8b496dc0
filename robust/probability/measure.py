"""The probability of a set of parameter values, from below and from above, by subdivision of the space of parameters.

A cell is a product of intervals and single values. Half-spaces that hold or fail throughout it are settled; of one
that cuts it, the part beyond is computed: over the cell each density is a linear function up to a known factor, and
over the part of a box beyond a half-space, a product of linear functions has an integral in closed form. What several
half-spaces cut off together is at least what any of them does, and at most the sum. The cell with the widest bounds is
split.

Everything is integer arithmetic: ends of cells are multiples of one unit, probabilities are rounded outwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from heapq import heappop, heappush
from itertools import product as every
from math import factorial, floor, lcm, prod

from robust.numbers import readable
from robust.probability.distributions import DISCRETE, UNIT, Distribution, Enclosure, Weights, product_of
from robust.qe.box import Box, Interval
from robust.qe.conjunctions import linked
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline

Part = tuple[Polyhedron, tuple[Polyhedron, ...]]
"""A polyhedron and polyhedra to remove from it."""
SPARSE = 8
"""Most parameters of a half-space of which the part beyond is computed: the time doubles with each."""
FINENESS = 24
"""Ends of cells are multiples of 2⁻²⁴ of the least width of a distribution, or finer."""
WHOLE = 1 << 64
"""One, where shares of a cell are added up."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """A probability is at least `lower` and at most `upper`."""

    lower: Fraction
    upper: Fraction

    def __repr__(self) -> str:
        return f"Bounds({readable(self.lower)}, {readable(self.upper)})"

    @property
    def width(self) -> Fraction:
        """`upper − lower`."""
        return self.upper - self.lower

    def within(self, other: Bounds) -> Bounds:
        """What both say."""
        return Bounds(max(self.lower, other.lower), min(self.upper, other.upper))

    @staticmethod
    def of(enclosure: Enclosure) -> Bounds:
        """The bounds that an enclosure in integers says."""
        return Bounds(Fraction(max(0, enclosure[0]), UNIT), Fraction(min(UNIT, enclosure[1]), UNIT))


@dataclass(frozen=True)
class SuccessProbabilities:
    """How probably a plan succeeds, by what who executes it may know.

    Attributes:
        weak: a schedule exists.
        dynamic: an executor succeeds that sees what has ended, and starts each action as soon as it may.
        strong: the fixed schedule succeeds that is the best of those that were tried.
        best_dynamic: the best executor succeeds that sees what has ended.
        best_strong: the best fixed schedule succeeds.
        starts: the schedule of strong.
    """

    weak: Bounds
    dynamic: Bounds
    strong: Bounds
    best_dynamic: Bounds
    best_strong: Bounds
    starts: Mapping[str, Fraction]


@dataclass(eq=False)
class AxisSpan:
    """A value, or an open interval of values, of one parameter, in units; None is an infinite end."""

    lower: int | None
    upper: int | None
    mass: Enclosure
    weights: Weights | None = None

    @property
    def is_point(self) -> bool:
        return self.lower is not None and self.lower == self.upper

    @property
    def width(self) -> int | None:
        return None if self.lower is None or self.upper is None else self.upper - self.lower


class Axis:
    """One random parameter: its spans, and how they are split.

    Without a density a span has the probability of the values that are in it.
    """

    def __init__(self, distribution: Distribution, unit: int) -> None:
        self._distribution = distribution
        self._unit = unit
        self._parts: dict[AxisSpan, tuple[AxisSpan, ...]] = {}
        self._centre = floor(distribution.centre * unit)
        self._step = floor(2 * distribution.scale * unit)
        self._breaks = [int(value * unit) for value in distribution.breaks]
        self._atoms = [(int(value * unit), mass) for value, mass in distribution.atoms]

    def roots(self) -> list[AxisSpan]:
        """The values with a probability of their own, and all others."""
        if self._distribution.kind in DISCRETE:
            return [self._among(self._atoms)]
        ends = (None if end is None else int(end * self._unit) for end in self._distribution.support)
        return [*(AxisSpan(place, place, mass) for place, mass in self._atoms), self._span(*ends)]

    def _among(self, atoms: Sequence[tuple[int, Enclosure]]) -> AxisSpan:
        """One value; of several, the open interval that just holds them, and no others."""
        apart = len(atoms) > 1
        mass = sum(least for _, (least, _) in atoms), sum(most for _, (_, most) in atoms)
        return AxisSpan(atoms[0][0] - apart, atoms[-1][0] + apart, mass)

    def _span(self, lower: int | None, upper: int | None) -> AxisSpan:
        low, high = (None if end is None else Fraction(end, self._unit) for end in (lower, upper))
        mass = self._distribution.between(low, high)
        smooth = not any((lower is None or lower < at) and (upper is None or at < upper) for at in self._breaks)
        if low is None or high is None or not smooth:
            return AxisSpan(lower, upper, mass)
        return AxisSpan(lower, upper, mass, self._distribution.weights(low, high))

    def split(self, span: AxisSpan) -> tuple[AxisSpan, ...]:
        """Two spans that it consists of, but for the value in between; itself if it is too small."""
        if span not in self._parts and self._distribution.kind in DISCRETE:
            inside = [atom for atom in self._atoms if span.is_point or _is_between(atom[0], span)]
            halves = inside[: len(inside) // 2], inside[len(inside) // 2 :]
            self._parts[span] = (span,) if span.is_point else tuple(self._among(half) for half in halves)
        if span not in self._parts:
            place = self._place(span)
            ends = (span.lower, place), (place, span.upper)
            self._parts[span] = (span,) if place is None else tuple(self._span(*pair) for pair in ends)
        return self._parts[span]

    def _place(self, span: AxisSpan) -> int | None:
        """Where to split it."""
        inside = [at for at in self._breaks if _is_between(at, span)]
        if inside:
            return inside[0]
        if span.lower is not None and span.upper is not None:
            place = (span.lower + span.upper) // 2
        elif span.lower is None and span.upper is None:
            place = self._centre
        else:
            # Two widths farther out: few cells have infinite ends then, and little is in them.
            inner = [self._centre] + [end for end in (span.lower, span.upper) if end is not None]
            place = max(inner) + self._step if span.upper is None else min(inner) - self._step
        return place if _is_between(place, span) else None


def _is_between(place: int, span: AxisSpan) -> bool:
    return (span.lower is None or span.lower < place) and (span.upper is None or place < span.upper)


@dataclass(frozen=True, eq=False)
class Half:
    """`Σ factor · value ≤ limit` over axes by their number, in units; `<` if strict, `=` if an equality."""

    factors: tuple[tuple[int, int], ...]
    limit: int
    strict: bool = False
    equality: bool = False
    shares: dict[tuple[AxisSpan, ...], tuple[int, int]] = field(default_factory=dict)

    @cached_property
    def opposite(self) -> tuple[tuple[int, int], ...]:
        """The factors of what faces it in a slab."""
        return tuple((axis, -factor) for axis, factor in self.factors)


Cell = tuple[AxisSpan, ...]
Active = tuple[tuple[Half, ...], tuple[tuple[Half, ...], ...]]
"""A part in a cell, as far as it is not settled there: sides of the polyhedron, and of those to remove."""


def holds(half: Half, cell: Cell) -> bool | None:
    """Whether it almost surely holds, or fails, throughout a cell; None if it cuts the cell."""
    least: int | None = 0
    most: int | None = 0
    single = True
    for axis, factor in half.factors:
        span = cell[axis]
        low, high = (span.lower, span.upper) if factor > 0 else (span.upper, span.lower)
        least = None if least is None or low is None else least + factor * low
        most = None if most is None or high is None else most + factor * high
        single = single and span.is_point
    if single and least is not None:
        at_limit = not half.strict
        if half.equality:
            return least == half.limit
        return least < half.limit or (at_limit and least == half.limit)
    if half.equality:
        return False  # a hyperplane has no probability
    if most is not None and most <= half.limit:
        return True
    return False if least is not None and least >= half.limit else None


def beyond(half: Half, cell: Cell) -> tuple[int, int]:
    """How much of a cell is beyond a half-space that cuts it, in shares of `WHOLE`."""
    spans = tuple(cell[axis] for axis, _ in half.factors)
    share = half.shares.get(spans)
    if share is None:
        share = half.shares[spans] = _beyond(half, spans)
    return share


def _beyond(half: Half, spans: Cell) -> tuple[int, int]:
    """Seen from the corner where the form is greatest, the part beyond is where `Σ |factor| · distance < room`.

    With distances t from 0 to 1, reaches R and densities p + (q − p) t, its integral is the inverse Laplace transform
    at `room` of 1/s · Π ∫ (p + (q − p) t) e^(−sRt) dt, and each factor is p/sR + (q − p)/(sR)² less e^(−sR) times
    q/sR + (q − p)/(sR)².
    """
    room = -half.limit
    moving: list[tuple[int, int, int]] = []
    spread = Fraction(1)
    for (_, factor), span in zip(half.factors, spans, strict=True):
        if span.lower is None or span.upper is None:
            return 0, WHOLE
        room += factor * (span.upper if factor > 0 else span.lower)
        if span.is_point:
            continue
        if span.weights is None:
            return 0, WHOLE
        first, last, ratio = span.weights
        first, last = (last, first) if factor > 0 else (first, last)
        moving.append((abs(factor) * (span.upper - span.lower), first, last))
        spread *= ratio
    count = len(moving)
    if count > SPARSE:
        return 0, WHOLE
    terms = [(room, [1])]
    for reach, first, last in moving:
        slope = last - first
        shifted = [(rest - reach, _times(series, -last * reach, -slope)) for rest, series in terms if rest > reach]
        terms = [(rest, _times(series, first * reach, slope)) for rest, series in terms] + shifted
    top = factorial(2 * count)
    part = 0
    for rest, series in terms:
        for power, coefficient in enumerate(series):
            part += top // factorial(power) * coefficient * rest**power
    part <<= count
    whole = top * prod(reach * reach * (first + last) for reach, first, last in moving)
    inside = whole - part
    up, down = spread.numerator, spread.denominator
    least = WHOLE * part * down // (part * down + inside * up)
    return least, -(-WHOLE * part * up // (part * up + inside * down))


def _times(series: Sequence[int], first: int, second: int) -> list[int]:
    """A polynomial times `first · x + second · x²`."""
    total = [0] * (len(series) + 2)
    for power, coefficient in enumerate(series):
        total[power + 1] += first * coefficient
        total[power + 2] += second * coefficient
    return total


def _lost(halves: Sequence[Half], cell: Cell) -> tuple[int, int]:
    """How much of a cell is outside of a polyhedron that these sides of it cut."""
    certain = possible = 0
    cut: dict[tuple[tuple[int, int], ...], int] = {}
    for half in halves:
        least, most = beyond(half, cell)
        possible += most
        # Both sides of a slab cut off parts that have nothing in common, or the slab is empty.
        certain = max(certain, min(WHOLE, least + cut.get(half.opposite, 0)))
        cut[half.factors] = least
    return certain, min(WHOLE, possible)


def share_of(active: Sequence[Active], cell: Cell) -> tuple[int, int]:
    """How much of a cell is in a union of parts."""
    lower = upper = 0
    for base, removed in active:
        certain, possible = _lost(base, cell)
        least, most = WHOLE - possible, WHOLE - certain
        for piece in removed:
            kept, missed = _lost(piece, cell)
            least -= WHOLE - kept
            most = min(most, missed)
        lower, upper = max(lower, least), upper + most
    return lower, min(WHOLE, max(lower, upper))


class Measure:
    """Bounds on the probability of a union of parts, which become narrower with each step.

    Args:
        parts: polyhedra with polyhedra to remove, over the same parameters.
        distributions: of these parameters, which are independent.
    """

    def __init__(self, parts: Sequence[Part], distributions: Mapping[str, Distribution]) -> None:
        names = list(parts[0][0].parameters) if parts else []
        settled = {name: distributions[name].settled for name in names}
        unit = _unit(parts, settled.values())
        self._axes = [Axis(settled[name], unit) for name in names]
        index = {name: number for number, name in enumerate(names)}
        known: dict[LinearConstraint, Half] = {}

        def halves(piece: Polyhedron) -> tuple[Half, ...]:
            for constraint in piece.constraints:
                if constraint not in known:
                    factors = tuple((index[name], factor) for name, factor in constraint.coefficients)
                    limit = int(constraint.constant * unit)
                    known[constraint] = Half(factors, limit, constraint.is_strict, constraint.is_equality)
            return tuple(known[constraint] for constraint in piece.constraints)

        active = [(halves(base), tuple(map(halves, removed))) for base, removed in parts]
        self._heap: list[tuple[int, int, int, int, Cell, list[Active]]] = []
        self.cells = 0
        """How many cells were looked at."""
        shares = [self._share(cell, active) for cell in every(*(axis.roots() for axis in self._axes))]
        self._total = sum(lower for lower, _ in shares), sum(upper for _, upper in shares)

    @property
    def bounds(self) -> Bounds:
        """The bounds that are known at the moment."""
        return Bounds.of(self._total)

    @property
    def is_done(self) -> bool:
        """Whether no cell can be split that would make a difference."""
        return not self._heap

    def _share(self, cell: Cell, active: Sequence[Active]) -> tuple[int, int]:
        """Bounds of how much of the parts is in a cell, which is to be split if they differ."""
        self.cells += 1
        rest = _unsettled(active, cell)
        mass = product_of(span.mass for span in cell)
        share = share_of(rest, cell)
        lower, upper = mass[0] * share[0] // WHOLE, -(-mass[1] * share[1] // WHOLE)
        if share[0] < share[1]:
            heappush(self._heap, (lower - upper, self.cells, lower, upper, cell, rest))
        return lower, upper

    def step(self) -> None:
        """Split the cell with the widest bounds."""
        _, _, lower, upper, cell, active = heappop(self._heap)
        axis = self._choice(cell, active)
        if axis is None:
            return
        least, most = self._total[0] - lower, self._total[1] - upper
        for span in self._axes[axis].split(cell[axis]):
            lower, upper = self._share((*cell[:axis], span, *cell[axis + 1 :]), active)
            least, most = least + lower, most + upper
        self._total = least, most  # at once: an interruption must leave bounds that hold

    def _choice(self, cell: Cell, active: Sequence[Active]) -> int | None:
        """The axis to split: what makes several sides cut the cell, or else whose density is least like a line."""
        scores: dict[int, float] = {}
        halves = dict.fromkeys(half for base, removed in active for piece in (base, *removed) for half in piece)
        for half in halves:
            reaches = {axis: abs(factor) * (cell[axis].width or 0) for axis, factor in half.factors}
            whole = sum(reaches.values()) or 1
            for axis, reach in reaches.items():
                span = cell[axis]
                if span.is_point:
                    continue
                bent = 2.0 if span.weights is None else float(span.weights[2] - 1)
                straight = reach / whole if len(halves) > 1 or len(half.factors) > SPARSE else 0.0
                scores[axis] = scores.get(axis, 0.0) + straight + (4 * bent if span.width is not None else 16.0)
        for axis in sorted(scores, key=lambda axis: -scores[axis]):
            if len(self._axes[axis].split(cell[axis])) > 1:
                return axis
        return None

    def run(self, within: Fraction, deadline: Deadline) -> Bounds:
        """Split until the bounds are close.

        Raises:
            OutOfTimeError: if the deadline passes first; `bounds` are what is known then.
        """
        wanted = floor(within * UNIT)
        while self._heap and self._total[1] - self._total[0] > wanted:
            deadline.enforce()
            self.step()
        return self.bounds


def _unsettled(active: Sequence[Active], cell: Cell) -> list[Active]:
    """What of the parts is in a cell, without sides that hold throughout it; parts that fill it leave no others."""
    known: dict[int, bool | None] = {}

    def cutting(halves: Sequence[Half]) -> tuple[Half, ...] | None:
        kept = []
        for half in halves:
            number = id(half)
            if number not in known:
                known[number] = holds(half, cell)
            if known[number] is False:
                return None
            if known[number] is None:
                kept.append(half)
        return tuple(kept)

    parts: list[Active] = []
    for base, removed in active:
        rest = cutting(base)
        if rest is None:
            continue
        cuts = tuple(dict.fromkeys(cut for cut in map(cutting, removed) if cut is not None))
        if () in cuts:
            continue
        if not rest and not cuts:
            return [((), ())]
        parts.append((rest, cuts))
    return parts


def _unit(parts: Iterable[Part], distributions: Iterable[Distribution]) -> int:
    """How many units are one: every number that occurs is a whole number of them."""
    exact = [c.constant for base, removed in parts for piece in (base, *removed) for c in piece.constraints]
    fine = 1
    for distribution in distributions:
        exact += distribution.exact_values
        fine = max(fine, -(-(1 << FINENESS) // distribution.scale))
    shared = lcm(*(value.denominator for value in exact))
    return shared << max(0, (fine // shared).bit_length())


# -- what is known without subdivision ---------------------------------------------------------------------------------


def box_probability(box: Box, distributions: Mapping[str, Distribution]) -> Bounds:
    """The probability of a box, to the last digit that is computed."""
    sides = box.intervals.items()
    return Bounds.of(product_of(interval_probability(side, distributions[name].settled) for name, side in sides))


def interval_probability(interval: Interval, distribution: Distribution) -> Enclosure:
    """The probability of an interval."""
    lower, upper = distribution.between(interval.lower, interval.upper)
    for value, mass in distribution.atoms:
        if value in interval:
            lower, upper = lower + mass[0], upper + mass[1]
    return lower, min(UNIT, upper)


class RegionMeasure:
    """The probability of a polyhedron without others: the product of those of its independent groups of parameters.

    Args:
        base: the polyhedron.
        removed: what is removed from it.
        distributions: of all parameters, which are independent.
    """

    def __init__(
        self, base: Polyhedron, removed: Sequence[Polyhedron], distributions: Mapping[str, Distribution]
    ) -> None:
        self._empty = base.is_empty or any(not piece.constraints for piece in removed)
        groups = [] if self._empty else _groups(base, removed)
        self._measures = [
            Measure([(Polyhedron(names, sides), tuple(Polyhedron(names, piece.constraints) for piece in pieces))],
                    distributions)
            for names, sides, pieces in groups
        ]  # fmt: skip

    @property
    def bounds(self) -> Bounds:
        """The bounds that are known at the moment."""
        if self._empty:
            return Bounds(Fraction(0), Fraction(0))
        bounds = [measure.bounds for measure in self._measures]
        return Bounds(
            prod((bound.lower for bound in bounds), start=Fraction(1)),
            prod((bound.upper for bound in bounds), start=Fraction(1)),
        )

    @property
    def cells(self) -> int:
        """How many cells were looked at."""
        return sum(measure.cells for measure in self._measures)

    def run(self, within: Fraction, deadline: Deadline) -> Bounds:
        """Split, always in the group whose bounds are widest, until the bounds are close.

        Raises:
            OutOfTimeError: if the deadline passes first; `bounds` are what is known then.
        """
        enough = within / (2 * max(1, len(self._measures)))
        while (open_ := [measure for measure in self._measures if not measure.is_done]) and self.bounds.width > within:
            widest = max(open_, key=lambda measure: measure.bounds.width)
            if widest.bounds.width <= enough:
                break
            widest.run(max(widest.bounds.width / 2, enough), deadline)
        return self.bounds


def _groups(
    base: Polyhedron, removed: Sequence[Polyhedron]
) -> list[tuple[tuple[str, ...], tuple[LinearConstraint, ...], tuple[Polyhedron, ...]]]:
    """Groups of parameters of which no side and no polyhedron to remove speaks together; others are free."""
    statements = (*(constraint.parameters for constraint in base.constraints), *(piece.mentioned for piece in removed))
    return [
        (
            tuple(name for name in base.parameters if name in group),
            tuple(constraint for constraint in base.constraints if group.intersection(constraint.parameters)),
            tuple(piece for piece in removed if group & piece.mentioned),
        )
        for group in dict.fromkeys(linked(statements).values())
    ]
