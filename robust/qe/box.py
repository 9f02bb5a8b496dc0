"""Intervals and boxes of numbers; decoupled robustness envelopes are boxes of parameter values [IRR, Definition 3]."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from math import prod
from typing import Any

from robust.encode.interface import Grid
from robust.errors import InputError
from robust.numbers import end, parse_end
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

    def written(self, number: Callable[[Fraction], str]) -> str:
        """`[1/3, inf)`, with numbers in that way."""
        opening = "[" if self.lower is not None and self.lower_closed else "("
        closing = "]" if self.upper is not None and self.upper_closed else ")"
        lower = "-inf" if self.lower is None else number(self.lower)
        upper = "inf" if self.upper is None else number(self.upper)
        return f"{opening}{lower}, {upper}{closing}"

    def __str__(self) -> str:
        return self.written(str)


def interval_text(interval: Interval) -> str:
    """`[1, 2)`, `(−∞, 3]`, for people."""
    opening = "[" if interval.lower is not None and interval.lower_closed else "("
    closing = "]" if interval.upper is not None and interval.upper_closed else ")"
    return f"{opening}{end(interval.lower, upper=False)}, {end(interval.upper, upper=True)}{closing}"


@dataclass(frozen=True)
class Box:
    """An interval for each parameter, in the plan's order; no values are in one that `is_empty`: nothing was proved."""

    intervals: Mapping[str, Interval]
    is_empty: bool = False

    @staticmethod
    def point(values: Mapping[str, Fraction]) -> Box:
        """The degenerate box that holds one point."""
        return Box({name: Interval(value, value) for name, value in values.items()})

    @staticmethod
    def nominal(parameters: Iterable[Parameter]) -> Box:
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
        return self.intervals[name]

    def __contains__(self, values: Mapping[str, Fraction]) -> bool:
        return not self.is_empty and all(values[name] in interval for name, interval in self.intervals.items())

    def is_within(self, other: Box) -> bool:
        """Whether the other box has all values of this one."""
        return all(interval.is_within(other[name]) for name, interval in self.intervals.items())

    def replace(self, name: str, interval: Interval) -> Box:
        return self.changed({name: interval})

    def changed(self, intervals: Mapping[str, Interval]) -> Box:
        """The box with these intervals for some parameters."""
        return Box({**self.intervals, **intervals}, self.is_empty)

    def moved(self, face: Face, end: Fraction | None, *, closed: bool = True) -> Box:
        """The box with one face elsewhere."""
        name, side = face
        return self.replace(name, self.intervals[name].with_end(side, end, closed=closed))

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
        """The product of the widths, 0 if one of them is; None if infinite."""
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
