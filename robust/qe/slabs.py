"""Conjunctions of linear constraints against boxes, in integers and without a search wherever that is exact.

Parallel constraints are one slab: `low ≤ form ≤ high`, with any side open or missing. A linear form takes the values of
an interval over a box, whose ends are at corners of the box; so a box meets a slab if and only if the one end is not
above `high` and the other not below `low`. Slabs that share no parameter are met together if each of them is. What
boxes run into is almost always of this kind; other conjunctions need the simplex method.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from robust.encode.interface import Grid
from robust.qe.box import Box, Face, Side
from robust.qe.constraint import LinearConstraint, Sense


@dataclass(frozen=True, slots=True)
class Bound:
    """`form ≤ limit / scale`, or `<` if it is strict."""

    factors: tuple[tuple[str, int], ...]
    limit: int
    scale: int
    strict: bool

    @staticmethod
    def of(half: LinearConstraint) -> Bound:
        """An inequality, whose coefficients are integers."""
        return Bound(half.coefficients, half.constant.numerator, half.constant.denominator, half.is_strict)

    def is_kept_in(self, box: Box) -> bool:
        """Whether some point of a box satisfies it."""
        total, ends = 0, box.grid.ends
        for name, factor in self.factors:
            end = ends[name][factor < 0]
            if end is None:
                return True
            total += factor * end
        above = total * self.scale - self.limit * box.grid.unit
        return above < 0 or (above == 0 and not self.strict and self._is_attained(box))

    def _is_attained(self, box: Box) -> bool:
        """Whether the corner where the form is least belongs to the box."""
        return all(box[name].is_closed_at(_least_side(factor)) for name, factor in self.factors)

    def least_stretch(self, growing: Growing) -> tuple[Fraction, bool] | None:
        """The least λ ≥ 0 at which the box meets it, and whether it does at that λ; None if it never does."""
        total, speed, ends, speeds = 0, 0, growing.grid.ends, growing.speeds
        attained = not self.strict
        for name, factor in self.factors:
            end = ends[name][factor < 0]
            if end is None:
                return _AT_ONCE
            total += factor * end
            moving = speeds.get((name, _least_side(factor)))
            if moving is not None:
                speed += abs(factor) * moving
            elif attained:
                attained = growing.box[name].is_closed_at(_least_side(factor))
        unit = growing.grid.unit
        above = total * self.scale - self.limit * unit
        if above < 0:
            return _AT_ONCE
        if speed:
            return Fraction(above * growing.pace, unit * self.scale * speed), attained
        return _AT_ONCE if above == 0 and attained else None


def _least_side(factor: int) -> Side:
    """Where a term of the form is least."""
    return Side.UPPER if factor < 0 else Side.LOWER


_AT_ONCE = Fraction(0), True


class Growing:
    """A box some of whose faces stand at `base ± λ · speed`.

    Args:
        box: where the other faces stand.
        moving: faces with base and speed, which is above 0.
    """

    def __init__(self, box: Box, moving: Mapping[Face, tuple[Fraction, Fraction]]) -> None:
        ranges = box.ranges
        for (name, side), (base, _) in moving.items():
            low, high = ranges[name]
            ranges[name] = (low, base) if side is Side.UPPER else (base, high)
        self.box = box
        self.moving = moving
        self.grid = Grid(ranges)
        self.pace = pace = lcm(*(speed.denominator for _, speed in moving.values()))
        self.speeds = {face: speed.numerator * (pace // speed.denominator) for face, (_, speed) in moving.items()}
        """In multiples of one over `pace`."""


class Slabs:
    """A conjunction of constraints as bounds, each of which a box must meet to meet them all.

    `exact`: a box that meets each bound meets the conjunction.
    """

    def __init__(self, constraints: Sequence[LinearConstraint]) -> None:
        halves = [half for constraint in constraints for half in constraint.halves()]
        self.bounds = tuple(map(Bound.of, halves))
        self.exact = _are_apart(halves)

    def all_kept_in(self, box: Box) -> bool:
        """Whether a box meets each bound."""
        return all(bound.is_kept_in(box) for bound in self.bounds)

    def least_stretch(self, growing: Growing) -> tuple[Fraction, bool] | None:
        """The least λ ≥ 0 at which the box meets each bound, and whether it does at that λ; None if it never does."""
        greatest, attained = _AT_ONCE
        for bound in self.bounds:
            met = bound.least_stretch(growing)
            if met is None:
                return None
            if met[0] > greatest:
                greatest, attained = met
            elif met[0] == greatest:
                attained = attained and met[1]
        return greatest, attained


def _are_apart(halves: Iterable[LinearConstraint]) -> bool:
    """Whether constraints are slabs, none of them empty, that share no parameter."""
    slabs: dict[tuple[str, ...], tuple[LinearConstraint, LinearConstraint | None]] = {}
    for half in halves:
        names = half.parameters
        if not names:
            return False
        first, second = slabs.get(names, (half, None))
        if first is half:
            slabs[names] = half, None
        elif second is not None or not _face_each_other(first, half):
            return False
        else:
            slabs[names] = first, half
    return sum(map(len, slabs)) == len({name for names in slabs for name in names})


def _face_each_other(half: LinearConstraint, other: LinearConstraint) -> bool:
    """Whether `−limit ≤ form ≤ limit'` has room in between."""
    if any(a != -b for (_, a), (_, b) in zip(half.coefficients, other.coefficients, strict=True)):
        return False
    room = half.constant + other.constant
    return room > 0 or (room == 0 and Sense.LESS not in (half.relation, other.relation))
