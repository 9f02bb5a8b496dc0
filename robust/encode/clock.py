"""Moments of a plan, and which happenings have passed by then.

An order atom `t_a < t_b` that the network decides for all parameter values is a constant here; the others become linear
atoms. All knowledge about the order of time points in the relational encoding comes through this module.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from robust.encode.network import TemporalNetwork
from robust.encode.orders import Orders
from robust.encode.variables import Auxiliary, Linear, variable
from robust.plan.model import TimePoint
from robust.smt.terms import Formula, Terms


class Side(Enum):
    BEFORE = "before"
    AFTER = "after"


@dataclass(frozen=True, slots=True)
class Moment:
    """Just before or just after all that happens at the time of a time point, or a free instant, or the very end.

    With neither `point` nor `instant` it is the state after all time points.
    """

    side: Side
    point: TimePoint | None = None
    instant: Auxiliary | None = None

    def __str__(self) -> str:
        if self.instant is not None:
            return f"{self.side.value} {self.instant}"
        return f"{self.side.value} {self.point}" if self.point else "finally"


FINALLY = Moment(Side.AFTER)


def before(point: TimePoint) -> Moment:
    return Moment(Side.BEFORE, point)


def after(point: TimePoint) -> Moment:
    return Moment(Side.AFTER, point)


class Clock:
    """Order atoms under what is known of the network."""

    def __init__(self, network: TemporalNetwork, orders: Orders, terms: Terms) -> None:
        self.network = network
        self.orders = orders
        self.terms = terms

    def time(self, moment: Moment) -> Linear:
        """The time of a moment other than the very end."""
        if moment.instant is not None:
            return variable(moment.instant)
        if moment.point is None:
            raise ValueError("the very end has no time")
        return self.network.position(moment.point)

    def earlier(self, first: TimePoint, second: TimePoint) -> Formula:
        """t_first < t_second."""
        if self.orders.surely_before(first, second):
            return self.terms.true
        if self.orders.surely_not_after(second, first):
            return self.terms.false
        return self.terms.greater(self.network.position(second) - self.network.position(first))

    def not_later(self, first: TimePoint, second: TimePoint) -> Formula:
        """t_first ≤ t_second."""
        return self.terms.negation(self.earlier(second, first))

    def passed(self, point: TimePoint, moment: Moment) -> Formula:
        """Whether what happens at `point` belongs to the past of `moment`."""
        if moment.instant is not None:
            gap = variable(moment.instant) - self.network.position(point)
            return self.terms.greater(gap) if moment.side is Side.BEFORE else self.terms.at_least(gap)
        if moment.point is None:
            return self.terms.true
        if moment.side is Side.BEFORE:
            return self.earlier(point, moment.point)
        return self.not_later(point, moment.point)
