"""How much of a box of parameter values is neither proved good nor proved bad: exactly, or estimated by random points.

The box is the product of boxes of independent groups of parameters, and a point is good if it is good in every group.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import exp, lcm, lgamma, log, log1p, prod
from random import Random

from robust.qe.box import Box
from robust.qe.conjunctions import Conjunction
from robust.qe.constraint import ZERO, LinearConstraint
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
    def exactly(value: Fraction, box: Box) -> OpenShare:
        return OpenShare(value, value, value, box)

    @staticmethod
    def estimated(count: int, points: int, box: Box) -> OpenShare:
        """So many of these points are open."""
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
    """The probability that an event of this chance is seen so many times or more."""
    if not 0 < chance < 1:
        return float(chance >= 1)
    choices = lgamma(points + 1)
    return sum(
        exp(choices - lgamma(n + 1) - lgamma(points - n + 1) + n * log(chance) + (points - n) * log1p(-chance))
        for n in range(count, points + 1)
    )


def volumes(
    base: Polyhedron, bad: Sequence[Conjunction], good: Sequence[Polyhedron]
) -> tuple[Fraction, Fraction] | None:
    """Of what is not bad, and of what is good; None where that is not finite or takes too long."""
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
        ends = {name: (one.lower or ZERO, one.upper or ZERO) for name, one in box.intervals.items()}
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
        """The points of the piece are bad."""
        self.undecided -= self._inside(piece)

    def include(self, cell: Polyhedron) -> None:
        """The points of the cell are good."""
        found = self._inside(cell.constraints)
        self.good |= found
        self.undecided -= found

    def point(self, index: int) -> dict[str, Fraction]:
        return {name: Fraction(value, self._scale) for name, value in self._points[index].items()}

    def _inside(self, piece: Conjunction) -> set[int]:
        found = self.undecided
        for constraint in piece:
            found = {index for index in found if self._holds(constraint, self._points[index])}
        return set(found)

    def _holds(self, constraint: LinearConstraint, point: Mapping[str, int]) -> bool:
        left = sum(factor.numerator * point[name] for name, factor in constraint.coefficients)
        right = constraint.constant.numerator * self._scale
        return constraint.relation.holds(left * constraint.constant.denominator, right)


Judged = tuple[set[int], set[int]]
"""Of the random points of a group: which are not known to be bad, and which are known to be good."""


def open_points(groups: Sequence[Judged]) -> int:
    """How many points are bad in no group, and not good in all."""
    possible = set.intersection(*(one[0] for one in groups))
    return len(possible) - len(possible.intersection(*(one[1] for one in groups)))


def product_share(sizes: Sequence[tuple[Fraction, Fraction, Fraction]], box: Box) -> OpenShare | None:
    """From the volumes of each group's box, of what is not bad there, and of what is good; None if a box has none."""
    whole, possible, proved = (prod(parts, start=Fraction(1)) for parts in zip(*sizes, strict=True))
    return OpenShare.exactly((possible - proved) / whole, box) if whole else None
