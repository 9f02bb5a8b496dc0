"""Distributions of what nature chooses. Draws are made exact: multiples of 1/1000, constants excepted."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from random import Random
from typing import assert_never

GRID = 1000
"""How many values there are from one integer to the next."""


class Below(Enum):
    """What becomes of draws below the minimum: folded up, to as far above it as they were below, or clipped to it."""

    FOLD = "fold"
    CLIP = "clip"


@dataclass(frozen=True, slots=True)
class Constant:
    value: Fraction


@dataclass(frozen=True, slots=True)
class Uniform:
    """From `lower` to `upper`, which is not below it."""

    lower: Fraction
    upper: Fraction


@dataclass(frozen=True, slots=True)
class Normal:
    """Normal with a minimum [IRR §5, "described by a normal distribution with a minimum value"]; None is none."""

    mean: Fraction
    deviation: Fraction
    minimum: Fraction | None = None
    below: Below = Below.FOLD


@dataclass(frozen=True, slots=True)
class HalfNormal:
    """`origin` plus the absolute value of a normal variable with mean 0."""

    origin: Fraction
    deviation: Fraction


Distribution = Constant | Uniform | Normal | HalfNormal


def draw(distribution: Distribution, random: Random) -> Fraction:
    """One value."""
    match distribution:
        case Constant(value):
            return value
        case Uniform(lower, upper):
            drawn = on_grid(random.uniform(float(lower), float(upper)))
            return min(max(drawn, lower), upper)
        case Normal(mean, deviation, minimum, below):
            drawn = on_grid(random.gauss(float(mean), float(deviation)))
            if minimum is None or drawn >= minimum:
                return drawn
            return minimum if below is Below.CLIP else 2 * minimum - drawn
        case HalfNormal(origin, deviation):
            return origin + abs(on_grid(random.gauss(0.0, float(deviation))))
    assert_never(distribution)


def on_grid(value: float) -> Fraction:
    """The nearest multiple of 1/1000."""
    return Fraction(round(value * GRID), GRID)
