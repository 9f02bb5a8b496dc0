"""The hundred problems of the papers' execution experiments [IRR §5, Tables 1 and 2].

One robot, two orders, and the goal to fulfil one of them. The nearer order wants one ring, the other three. Without
delay the first is fulfilled after 414 seconds; if it is given up at the end of its preparation, the second is fulfilled
after 729. The windows close at 416 and 731 seconds, each later by a quantile of a half-normal distribution: a delay
that a preparation step does not exceed with the probability of the level.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from statistics import NormalDist

from robust.execute.delivery.domain import DeliveryVariant
from robust.execute.delivery.problem import DeliveryOptions, Order, delivery_problem

LEVELS = tuple(Fraction(5 + 10 * i, 100) for i in range(10))
"""0.05, 0.15, …, 0.95."""

_PLACES = {
    "dock1": (0, 0),
    "shelf": (20, 0),
    "base_station": (35, 0),
    "ring_station": (70, 0),
    "gate1": (70, 60),
    "gate2": (134, 48),
}
_CLOSING = (Fraction(416), Fraction(731))
_DEVIATIONS = (70, 140)


@dataclass(frozen=True, slots=True)
class TableProblem:
    """One of the problems; `levels` and `deadlines` are those of the nearer and the farther order."""

    name: str
    levels: tuple[Fraction, Fraction]
    deadlines: tuple[Fraction, Fraction]
    options: DeliveryOptions
    text: str


def table_problems(
    variant: DeliveryVariant = DeliveryVariant.DURATIONS, *, battery: Fraction = Fraction(360)
) -> tuple[TableProblem, ...]:
    """All hundred, by the level of the nearer order and then by that of the farther one.

    `battery` is the charge at the start in the variant that has one; fulfilling the first order takes 293 of it.
    """
    return tuple(_problem(variant, battery, near, far) for near in LEVELS for far in LEVELS)


def half_normal_quantile(level: Fraction, deviation: int) -> Fraction:
    """What the size of a normal deviation from zero does not exceed with probability `level`, to a thousandth."""
    quantile = NormalDist(0, deviation).inv_cdf(float((1 + level) / 2))
    return Fraction(round(quantile * 1000), 1000)


def _problem(variant: DeliveryVariant, battery: Fraction, near: Fraction, far: Fraction) -> TableProblem:
    levels = (near, far)
    deadlines = tuple(
        closing + half_normal_quantile(level, deviation)
        for closing, level, deviation in zip(_CLOSING, levels, _DEVIATIONS, strict=True)
    )
    first, second = deadlines
    orders = (Order(1, first), Order(3, second))
    options = DeliveryOptions(variant, orders, battery=battery, places=_PLACES)
    name = f"near{int(near * 100):02}_far{int(far * 100):02}"
    return TableProblem(name, levels, (first, second), options, delivery_problem(options, 0))
