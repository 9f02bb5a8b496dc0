"""Intervals and boxes of numbers; decoupled robustness envelopes are boxes of parameter values [IRR, Definition 3].

Conjunctions of linear constraints meet boxes in integers, and without a search wherever that is exact. Parallel
constraints are one slab: `low ≤ form ≤ high`, with any side open or missing. A linear form takes the values of an
interval over a box, whose ends are at corners of the box; so a box meets a slab if and only if the one end is not
above `high` and the other not below `low`. Slabs that share no parameter are met together if each of them is. What
boxes run into is almost always of this kind; other conjunctions need the simplex method.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from math import lcm, prod
from typing import Any

from robust.encode.interface import Grid
from robust.errors import InputError, did_you_mean
from robust.numbers import parse_end, readable, shorten
from robust.plan.model import Parameter
from robust.qe.constraint import LinearConstraint, Sense


class Side(Enum):
    """An end of an interval, a face of a box, a bound: the least or the greatest value."""

    LOWER = "lower"
    UPPER = "upper"

    @property
    def sign(self) -> int:
        """1 where outwards is upwards, else −1."""
        return 1 if self is Side.UPPER else -1

    @property
    def opposite(self) -> Side:
        """The other end."""
        return Side.LOWER if self is Side.UPPER else Side.UPPER


Face = tuple[str, Side]
"""A side of a box: a parameter and which end."""


@dataclass(frozen=True, slots=True)
class Interval:
    """The values from `lower` to `upper`; None is an infinite end, which is always open.

    Raises:
        InputError: if there are no such values.
    """

    lower: Fraction | None
    upper: Fraction | None
    lower_closed: bool = True
    upper_closed: bool = True

    def __post_init__(self) -> None:
        if self.lower is None or self.upper is None:
            return
        both = self.lower_closed and self.upper_closed
        if self.lower > self.upper or (self.lower == self.upper and not both):
            raise InputError(f"the interval {self} is empty; expected a lower end below the upper one")

    @staticmethod
    def nothing(at: Fraction) -> Interval:
        """`(at, at)`, in which there is no value."""
        empty = Interval(at, at)
        for closed in ("lower_closed", "upper_closed"):
            object.__setattr__(empty, closed, False)
        return empty

    @staticmethod
    def from_dict(ends: Mapping[str, Any]) -> Interval:
        """The interval of `lower` and `upper`, as text, and whether they are closed, which they are if not said."""
        closed = {name: bool(ends.get(name, True)) for name in ("lower_closed", "upper_closed")}
        return Interval(parse_end(ends["lower"]), parse_end(ends["upper"]), **closed)

    def __contains__(self, value: Fraction) -> bool:
        above = self.lower is None or self.lower < value or (self.lower_closed and self.lower == value)
        below = self.upper is None or value < self.upper or (self.upper_closed and self.upper == value)
        return above and below

    def is_within(self, other: Interval) -> bool:
        """Whether every value of this interval is a value of the other one."""
        above = other.lower is None or (
            self.lower is not None and (other.lower, not other.lower_closed) <= (self.lower, not self.lower_closed)
        )
        below = other.upper is None or (
            self.upper is not None and (self.upper, self.upper_closed) <= (other.upper, other.upper_closed)
        )
        return above and below

    def some_value(self) -> Fraction:
        """Some value of a non-empty interval: the middle of a finite one."""
        if self.lower is None:
            return Fraction(0) if self.upper is None else self.upper - 1
        return self.lower + 1 if self.upper is None else (self.lower + self.upper) / 2

    @property
    def width(self) -> Fraction | None:
        """`upper − lower`; None if infinite."""
        return None if self.lower is None or self.upper is None else self.upper - self.lower

    def end(self, side: Side) -> Fraction | None:
        """The lower or the upper end; None if infinite."""
        return self.upper if side is Side.UPPER else self.lower

    def is_closed_at(self, side: Side) -> bool:
        """Whether a finite end is a value of the interval."""
        return self.upper_closed if side is Side.UPPER else self.lower_closed

    def with_end(self, side: Side, end: Fraction | None, *, closed: bool = True) -> Interval:
        """The interval with another end on one side."""
        if side is Side.UPPER:
            return Interval(self.lower, end, self.lower_closed, closed)
        return Interval(end, self.upper, closed, self.upper_closed)

    def written(self, number: Callable[[Fraction], str], infinity: str = "inf", minus: str = "-") -> str:
        """`[1/3, inf)`, with numbers and infinity in that way."""
        opening = "[" if self.lower is not None and self.lower_closed else "("
        closing = "]" if self.upper is not None and self.upper_closed else ")"
        lower = f"{minus}{infinity}" if self.lower is None else number(self.lower)
        upper = infinity if self.upper is None else number(self.upper)
        return f"{opening}{lower}, {upper}{closing}"

    def __str__(self) -> str:
        return self.written(str)

    def __repr__(self) -> str:
        return f"Interval({self})"


def interval_text(interval: Interval) -> str:
    """`[1, 2)`, `(−∞, 3]`, for people."""
    return interval.written(readable, "∞", "−")


def require_complete(values: Collection[str], names: Collection[str]) -> None:
    """InputError if the values of a point lack one of these parameters."""
    if missing := [name for name in names if name not in values]:
        raise InputError(f"found a point without a value of {', '.join(missing)}, expected one of each parameter")


@dataclass(frozen=True, repr=False)
class Box(Mapping[str, Interval]):
    """An interval for each parameter, in its unit and in the plan's order.

    No values are in one that `is_empty`: nothing was proved.

    A mapping from names to intervals, of which also points are members: `"to_ridge" in box`, and
    `{"to_ridge": 30, "to_crater": 40} in box`.
    """

    intervals: Mapping[str, Interval]
    is_empty: bool = False

    @staticmethod
    def point(values: Mapping[str, Fraction]) -> Box:
        """The degenerate box that holds one point."""
        return Box({name: Interval(value, value) for name, value in values.items()})

    @staticmethod
    def nominal(parameters: Iterable[Parameter]) -> Box:
        """The degenerate box that holds the nominal values."""
        return Box.point({parameter.name: parameter.nominal for parameter in parameters})

    @staticmethod
    def nothing(parameters: Iterable[Parameter]) -> Box:
        """The box of a search that has proved nothing: without values, beside the nominal ones."""
        return Box({parameter.name: Interval.nothing(parameter.nominal) for parameter in parameters}, is_empty=True)

    @staticmethod
    def declared(parameters: Iterable[Parameter]) -> Box:
        """All values within the declared bounds."""
        return Box({parameter.name: Interval(parameter.lower, parameter.upper) for parameter in parameters})

    def __getitem__(self, name: str) -> Interval:
        try:
            return self.intervals[name]
        except KeyError:
            raise KeyError(f"unknown parameter {name!r}{did_you_mean(str(name), self.intervals)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.intervals)

    def __len__(self) -> int:
        return len(self.intervals)

    def __bool__(self) -> bool:
        """True, as of any object: also of a box without parameters."""
        return True

    def __contains__(self, values: object) -> bool:
        """Whether a name is that of a parameter, or the box :meth:`includes` a point; InputError for anything else."""
        if isinstance(values, Mapping):
            return self.includes(values)
        if not isinstance(values, str):
            raise InputError(f"found {shorten(repr(values))}, expected a name, or a point as {{'NAME': VALUE, ...}}")
        return values in self.intervals

    def includes(self, values: Mapping[str, Fraction]) -> bool:
        """Whether a point is in the box, given by values of all its parameters.

        Raises:
            InputError: if the point has no value of some parameter.
        """
        require_complete(values, self.intervals)
        return not self.is_empty and all(values[name] in interval for name, interval in self.intervals.items())

    def is_within(self, other: Box) -> bool:
        """Whether the other box has all values of this one."""
        return all(interval.is_within(other[name]) for name, interval in self.intervals.items())

    def replace(self, name: str, interval: Interval) -> Box:
        """The box with another interval for one parameter."""
        return self.changed({name: interval})

    def changed(self, intervals: Mapping[str, Interval]) -> Box:
        """The box with these intervals for some parameters."""
        return Box({**self.intervals, **intervals}, self.is_empty)

    def without(self, names: Collection[str]) -> Box:
        """The intervals of the other parameters."""
        return Box({name: interval for name, interval in self.intervals.items() if name not in names})

    def moved(self, face: Face, end: Fraction | None, *, closed: bool = True) -> Box:
        """The box with one face elsewhere."""
        return self.with_faces({face: end}, closed=closed)

    def with_faces(self, ends: Mapping[Face, Fraction | None], *, closed: bool = True) -> Box:
        """The box with some faces elsewhere; all of them belong to it, or none does."""
        intervals = dict(self.intervals)
        for (name, side), place in ends.items():
            intervals[name] = intervals[name].with_end(side, place, closed=closed)
        return Box(intervals, self.is_empty)

    @cached_property
    def grid(self) -> Grid:
        """The ends in integers."""
        return Grid(self.ranges)

    @property
    def ranges(self) -> dict[str, tuple[Fraction | None, Fraction | None]]:
        """Ends by parameter."""
        return {name: (interval.lower, interval.upper) for name, interval in self.intervals.items()}

    @property
    def total_width(self) -> Fraction | None:
        """Σ (u − l) [IRR §5, Convergence]; None if a side is infinite."""
        widths = [interval.width for interval in self.intervals.values()]
        finite = [width for width in widths if width is not None]
        return sum(finite, Fraction(0)) if len(finite) == len(widths) else None

    def values_of(self, coefficients: Iterable[tuple[object, Fraction | int]], constant: Fraction | int) -> Interval:
        """All values over the box of a linear form, of which these are the coefficients by parameter."""
        ends: dict[Side, Fraction | None] = dict.fromkeys(Side, Fraction(constant))
        closed = dict.fromkeys(Side, True)
        for unknown, factor in coefficients:
            interval = self.intervals[str(unknown)]
            for side, other in zip(Side, Side if factor > 0 else reversed(Side), strict=True):
                total, end = ends[side], interval.end(other)
                ends[side] = None if total is None or end is None else total + factor * end
                closed[side] = ends[side] is not None and closed[side] and interval.is_closed_at(other)
        return Interval(ends[Side.LOWER], ends[Side.UPPER], closed[Side.LOWER], closed[Side.UPPER])

    @property
    def volume(self) -> Fraction | None:
        """The product of the widths, in the product of their units, 0 if one of them is; None if infinite."""
        widths = [interval.width for interval in self.intervals.values()]
        if 0 in widths:
            return Fraction(0)
        finite = [width for width in widths if width is not None]
        return prod(finite, start=Fraction(1)) if len(finite) == len(widths) else None

    def constraints(self) -> Iterator[LinearConstraint]:
        """The box as linear constraints."""
        for name, interval in self.intervals.items():
            for side in Side:
                end = interval.end(side)
                if end is not None:
                    sense = Sense.AT_MOST if interval.is_closed_at(side) else Sense.LESS
                    yield LinearConstraint(((name, side.sign),), sense, side.sign * end)

    def __str__(self) -> str:
        return ", ".join(f"{name} ∈ {interval}" for name, interval in self.intervals.items()) or "(no parameters)"

    def __repr__(self) -> str:
        return f"Box({self}{', empty' if self.is_empty else ''})"


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

    @property
    def faces(self) -> set[Face]:
        """The faces that come closer to some bound as they move outwards."""
        return {(name, _least_side(factor)) for bound in self.bounds for name, factor in bound.factors}

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
