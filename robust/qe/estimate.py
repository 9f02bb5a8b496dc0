"""Sizes of sets of parameter values: certified bounds on volumes, open shares of boxes, random points of regions.

Volumes are bounded by subdividing a bounding box. The open share is the part of a box that is neither proved good nor
proved bad, computed exactly or estimated from random points. The box is the product of boxes of independent groups of
parameters, and a point is good if it is good in every group.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from heapq import heappop, heappush
from itertools import islice
from math import exp, factorial, floor, lcm, lgamma, log, log1p, prod
from random import Random

from robust.qe.box import Box
from robust.qe.conjunctions import Conjunction, SolvedForm
from robust.qe.constraint import ZERO, Coefficients, LinearConstraint, Sense
from robust.qe.polyhedron import Polyhedron, union_volume
from robust.qe.symmetry import Symmetry

POINTS = 1000
"""Random points of an estimate. If none of them is open, at most 0.4 % of the box are."""
CONFIDENCE = Fraction(19, 20)
GRID = 1 << 16
"""Random points have coordinates at this many places of each side."""
EXACT_DIMENSION, EXACT_PIECES = 3, 30
"""Parameters of a group, and polyhedra, up to which volumes are computed."""


@dataclass(frozen=True)
class OpenShare:
    """The part of `box` that is open: exactly `value` if `confidence` is None; else `value` is the share of open ones
    among `points` random points, and `lower` and `upper` hold the true one with that confidence [Clopper and Pearson
    1934]."""

    value: Fraction
    lower: Fraction
    upper: Fraction
    box: Box
    confidence: Fraction | None = None
    points: int | None = None

    @staticmethod
    def estimated(count: int, points: int, box: Box) -> OpenShare:
        """The share estimated from `count` open points among `points`."""
        lower, upper = (
            Fraction(round(end * 10**6), 10**6) for end in proportion_bounds(count, points, float(CONFIDENCE))
        )
        return OpenShare(Fraction(count, points), lower, upper, box, CONFIDENCE, points)


def proportion_bounds(count: int, points: int, confidence: float) -> tuple[float, float]:
    """The two-sided interval of Clopper and Pearson for the chance of an event that was seen `count` times."""
    rest = (1 - confidence) / 2
    lower = 0.0 if count == 0 else _bisected(lambda chance: _at_least(count, points, chance) >= rest)
    upper = 1.0 if count == points else _bisected(lambda chance: 1 - _at_least(count + 1, points, chance) <= rest)
    return lower, upper


def _bisected(reached: Callable[[float], bool]) -> float:
    """Where a condition that holds from some chance on begins to hold."""
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (low, middle) if reached(middle) else (middle, high)
    return (low + high) / 2


def _at_least(count: int, points: int, chance: float) -> float:
    """The probability of at least `count` successes in `points` trials, each with this chance."""
    if not 0 < chance < 1:
        return float(chance >= 1)
    succeeds, fails, ways = log(chance), log1p(-chance), _log_choices(points)
    return sum(exp(ways[n] + n * succeeds + (points - n) * fails) for n in range(count, points + 1))


@cache
def _log_choices(points: int) -> Sequence[float]:
    """Logarithms of the numbers of ways to choose 0, 1, ... of so many points."""
    return [lgamma(points + 1) - lgamma(n + 1) - lgamma(points - n + 1) for n in range(points + 1)]


def volumes(
    base: Polyhedron, bad: Sequence[Conjunction], good: Sequence[Polyhedron]
) -> tuple[Fraction, Fraction] | None:
    """The volumes of what is not bad, and of what is good; None where that is not finite or takes too long."""
    if len(base.parameters) > EXACT_DIMENSION or len(bad) + len(good) > EXACT_PIECES:
        return None
    whole, proved = base.volume(), union_volume(good)
    lost = union_volume([base.restricted(piece) for piece in bad])
    return None if whole is None or proved is None or lost is None else (whole - lost, proved)


class Samples:
    """Random points of a box, and which of them are known to be good or bad.

    Args:
        box: a closed, finite interval for each parameter; other parameters have other points.
        symmetry: each point stands for its images, and is asked about where classes ascend.
    """

    def __init__(self, box: Box, symmetry: Symmetry) -> None:
        random = Random(",".join(box.intervals))  # noqa: S311 - reproducible samples, no secrets
        ends = {name: (interval.lower or ZERO, interval.upper or ZERO) for name, interval in box.intervals.items()}
        self.box = box
        self._scale = GRID * lcm(*(end.denominator for pair in ends.values() for end in pair))
        self._points = [
            symmetry.sorted({name: self._coordinate(*pair, random.randint(0, GRID)) for name, pair in ends.items()})
            for _ in range(POINTS)
        ]
        self.undecided = set(range(POINTS))
        self.good: set[int] = set()

    def _coordinate(self, lower: Fraction, upper: Fraction, place: int) -> int:
        """Times the scale, which makes it whole."""
        return int((lower + (upper - lower) * place / GRID) * self._scale)

    def exclude(self, piece: Conjunction) -> None:
        """Mark the points of the piece as bad."""
        self.undecided -= self._inside(piece)

    def include(self, cell: Polyhedron) -> None:
        """Mark the points of the cell as good."""
        inside = self._inside(cell.constraints)
        self.good |= inside
        self.undecided -= inside

    def point(self, index: int) -> dict[str, Fraction]:
        return {name: Fraction(value, self._scale) for name, value in self._points[index].items()}

    def _inside(self, piece: Conjunction) -> set[int]:
        inside = self.undecided
        for constraint in piece:
            inside = {index for index in inside if self._holds(constraint, self._points[index])}
        return set(inside)

    def _holds(self, constraint: LinearConstraint, point: Mapping[str, int]) -> bool:
        left = sum(factor.numerator * point[name] for name, factor in constraint.coefficients)
        right = constraint.constant.numerator * self._scale
        return constraint.relation.holds(left * constraint.constant.denominator, right)


Judged = tuple[set[int], set[int]]
"""Which random points of a group are not known to be bad, and which are known to be good."""


def open_points(groups: Sequence[Judged]) -> int:
    """How many points are bad in no group, and not good in all."""
    possible = set.intersection(*(group[0] for group in groups))
    return len(possible) - len(possible.intersection(*(group[1] for group in groups)))


def product_share(sizes: Sequence[tuple[Fraction, Fraction, Fraction]], box: Box) -> OpenShare | None:
    """From the volumes of each group's box, of what is not bad there, and of what is good; None if a box has none."""
    whole, possible, proved = (prod(parts, start=Fraction(1)) for parts in zip(*sizes, strict=True))
    share = (possible - proved) / whole if whole else None
    return None if share is None else OpenShare(share, share, share, box)


Cell = tuple[tuple[str, Fraction, Fraction], ...]
"""A closed box: parameter, lower and upper end."""
Part = tuple[Polyhedron, tuple[Polyhedron, ...]]
"""A polyhedron and polyhedra to remove from it."""
SPARSE = 10
"""Most parameters of a constraint for which its share of a cell is computed; the time doubles with each."""


@dataclass(frozen=True, slots=True)
class VolumeBounds:
    """The volume is at least `lower` and at most `upper`; `upper` is None if no bounding box is known."""

    lower: Fraction
    upper: Fraction | None


def volume_bounds(parts: Sequence[Part], limit: int) -> VolumeBounds:
    """Bounds on the volume of a union of parts from at most `limit` boxes, the least certain one split first.

    Only the interior of a box matters, so strict sides count like others.
    """
    solid = [(base, removed) for base, removed in parts if base.is_full_dimensional]
    if not solid:
        return VolumeBounds(ZERO, ZERO)
    if not solid[0][0].parameters:
        held = any(all(piece.is_empty for piece in removed) for _, removed in solid)
        return VolumeBounds(Fraction(held), Fraction(held))
    cell = bounding_cell([base for base, _ in solid])
    if cell is None:
        return VolumeBounds(ZERO, None)
    lower, upper = cell_bounds(cell, solid)
    total = [lower, upper]
    heap = [(lower - upper, 0, lower, upper, cell, solid)]
    count = 1
    while count < limit and heap[0][0]:
        _, _, lower, upper, cell, active = heappop(heap)
        total = [total[0] - lower, total[1] - upper]
        for half in _halves(cell):
            count += 1
            rest = _undecided(half, active)
            lower, upper = cell_bounds(half, rest)
            total = [total[0] + lower, total[1] + upper]
            heappush(heap, (lower - upper, count, lower, upper, half, rest))
    return VolumeBounds(*total)


def cell_bounds(cell: Cell, parts: Sequence[Part]) -> tuple[Fraction, Fraction]:
    """Bounds on the volume of a union of parts inside a cell, from the shares that single half-spaces cut off.

    They are exact for a half-space, a slab, and a cell without either.
    """
    size = _volume(cell)
    lower, upper = ZERO, ZERO
    for base, removed in parts:
        least, most = _polyhedron_bounds(cell, size, base)
        lost = [_polyhedron_bounds(cell, size, piece) for piece in removed]
        most = min([most, *(size - certain for certain, _ in lost)])
        least = max(ZERO, least - sum((possible for _, possible in lost), ZERO))
        lower, upper = max(lower, least), min(size, upper + most)
    return lower, upper


def _polyhedron_bounds(cell: Cell, size: Fraction, piece: Polyhedron) -> tuple[Fraction, Fraction]:
    """The union of what the sides cut off is at most their sum, and at least any of them or any disjoint two."""
    if any(constraint.is_false or constraint.is_equality for constraint in piece.constraints):
        return ZERO, ZERO
    cut: dict[Coefficients, Fraction] = {}
    certain = possible = ZERO
    for constraint in piece.constraints:
        least, most = _cut_off(cell, size, constraint)
        possible += most
        # Both sides of a slab cut off parts that have nothing in common (or the slab is empty, and they all).
        opposite = cut.get(constraint.opposite(Sense.AT_MOST).coefficients, ZERO)
        certain = max(certain, min(size, least + opposite))
        cut[constraint.coefficients] = least
    return max(ZERO, size - possible), size - certain


def _cut_off(cell: Cell, size: Fraction, constraint: LinearConstraint) -> tuple[Fraction, Fraction]:
    """Bounds on the volume of the cell beyond a half-space, exact for up to `SPARSE` parameters.

    With the coefficients made positive by reflection, `{x ∈ [0, w] : a·x ≤ b}` has the volume
    `Σ_S (−1)^|S| max(0, b − Σ_{i∈S} a_i w_i)^n / (n! Π a_i)`, over the subsets S of the coordinates.
    """
    ends = {name: (lower, upper) for name, lower, upper in cell}
    count = len(constraint.coefficients)
    if count > SPARSE:
        return ZERO, size
    # Seen from the far corner, the part beyond `form ≤ constant` is where `Σ |c|·x ≤ most − constant`.
    room = sum((c * ends[n][1 if c > 0 else 0] for n, c in constraint.coefficients), ZERO) - constraint.constant
    reaches = [abs(c) * (ends[n][1] - ends[n][0]) for n, c in constraint.coefficients]
    sums = [(room, 1)] if room > 0 else []
    for reach in reaches:
        sums += [(rest - reach, -sign) for rest, sign in sums if rest > reach]
    share = sum((sign * rest**count for rest, sign in sums), ZERO) / (factorial(count) * prod(reaches))
    return share * size, share * size


def bounding_cell(bases: Sequence[Polyhedron]) -> Cell | None:
    """The smallest box around polyhedra, of which one at least is not empty; None if it is not bounded."""
    cell = []
    for name in bases[0].parameters:
        extents = [extent for extent in (base.extent(name) for base in bases) if extent is not None]
        lower = [extent.lower for extent in extents if extent.lower is not None]
        upper = [extent.upper for extent in extents if extent.upper is not None]
        if len(lower) < len(extents) or len(upper) < len(extents):
            return None
        cell.append((name, min(lower), max(upper)))
    return tuple(cell)


def _volume(cell: Cell) -> Fraction:
    return prod((upper - lower for _, lower, upper in cell), start=Fraction(1))


def _halves(cell: Cell) -> list[Cell]:
    """The cell cut across its longest side: a fixed measure of length keeps cells from degenerating."""
    index = max(range(len(cell)), key=lambda i: cell[i][2] - cell[i][1])
    name, lower, upper = cell[index]
    middle = (lower + upper) / 2
    before, after = cell[:index], cell[index + 1 :]
    return [(*before, (name, lower, middle), *after), (*before, (name, middle, upper), *after)]


def _undecided(cell: Cell, parts: Sequence[Part]) -> list[Part]:
    """The parts inside a cell. Constraints that hold throughout it are dropped: splits simplify them."""
    ends = {name: (lower, upper) for name, lower, upper in cell}
    result: list[Part] = []
    for base, removed in parts:
        here = _clipped(base, ends)
        if here is not None:
            cuts = (_clipped(piece, ends) for piece in removed)
            result.append((here, tuple(cut for cut in cuts if cut is not None)))
    return result


def _clipped(piece: Polyhedron, ends: dict[str, tuple[Fraction, Fraction]]) -> Polyhedron | None:
    """The piece with only those sides that cut the cell; None if the piece misses the cell's interior."""
    kept: list[LinearConstraint] = []
    for constraint in piece.constraints:
        if constraint.is_false or constraint.is_equality:
            return None
        least = sum((c * ends[n][0 if c > 0 else 1] for n, c in constraint.coefficients), ZERO)
        most = sum((c * ends[n][1 if c > 0 else 0] for n, c in constraint.coefficients), ZERO)
        if least >= constraint.constant:
            return None
        if most > constraint.constant:
            kept.append(constraint)
    return piece if len(kept) == len(piece.constraints) else Polyhedron(piece.parameters, tuple(kept))


STEPS = 12
"""Steps of the walk between points that are returned."""
CHANCES = 20
"""Rejected points for each requested one before the region is split into a union."""
FAR = Fraction(100)
"""Where a walk stops in an unbounded direction, in its own steps."""


def sample(
    parts: Sequence[Part], pieces: Callable[[], Sequence[Polyhedron]], count: int, seed: int
) -> list[dict[str, Fraction]]:
    """`count` points of a union of parts, of which `pieces` is the (possibly costly) description as a union."""
    random = Random(seed)  # noqa: S311 - reproducible samples, no secrets
    points = _walks([base for base, _ in parts], random)
    if any(removed for _, removed in parts):
        chosen = []
        for point in islice(points, count * CHANCES):
            if any(point in base and not any(point in piece for piece in removed) for base, removed in parts):
                chosen.append(point)
            if len(chosen) == count:
                return chosen
        points = _walks(pieces(), random)
    return list(islice(points, count))


def _walks(pieces: Iterable[Polyhedron], random: Random) -> Iterator[dict[str, Fraction]]:
    """Points of the union of the pieces without end; none if it is empty."""
    walks = [_walk(form, random) for form in (piece.normal_form for piece in pieces) if form is not None]
    while walks:
        yield next(random.choice(walks))


def _walk(form: SolvedForm, random: Random) -> Iterator[dict[str, Fraction]]:
    """Points of the relative interior of a polyhedron: steps in random directions, to a random place of the chord."""
    current = {name: form.interior[name] for name in form.free}
    while True:
        for _ in range(STEPS if form.free else 0):
            current = _step(form, current, random)
        yield form.complete(current)


def _step(form: SolvedForm, start: dict[str, Fraction], random: Random) -> dict[str, Fraction]:
    along = set(random.sample(form.free, random.randint(1, len(form.free))))
    direction = {name: Fraction(random.randint(-8, 8) if name in along else 0) for name in form.free}
    least, most = -FAR, FAR
    for constraint in form.inequalities:
        speed = constraint.value(direction)
        if speed:
            reach = (constraint.constant - constraint.value(start)) / speed
            least, most = (least, min(most, reach)) if speed > 0 else (max(least, reach), most)
    length = least + (most - least) * Fraction(random.randint(1, 255), 256)
    target = {name: value + length * direction[name] for name, value in start.items()}
    return _rounded(form, target)


def _rounded(form: SolvedForm, point: dict[str, Fraction]) -> dict[str, Fraction]:
    """A nearby point with small denominators, or the point itself; the walk would make them grow without end."""
    for bits in (4, 10, 20, 40):
        scale = 1 << bits
        rounded = {name: Fraction(floor(value * scale), scale) for name, value in point.items()}
        if all(constraint.value(rounded) < constraint.constant for constraint in form.inequalities):
            return rounded
    return point
