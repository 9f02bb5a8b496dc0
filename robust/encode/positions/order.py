"""The positions of time points: a total order consistent with their times [IRR §2].

Position 1 is the earliest time point's, position H the latest's; simultaneous time points keep the plan's order. The
choice is a Boolean per time point and position, "by then it has happened", so formulas stay polynomial and the solver
searches the orders.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from robust.encode.positions.network import KnownOrder, Network
from robust.encode.variables import Auxiliary, Linear, variable
from robust.plan.model import TimePoint
from robust.smt.limits import Deadline
from robust.smt.terms import Formula, Terms


class Positions:
    """Who is where, and when each position is.

    What `known` says of the order is taken as given: whoever asserts :meth:`axioms` asserts what it was learnt from.
    """

    def __init__(self, network: Network, known: KnownOrder, terms: Terms) -> None:
        self._network = network
        self._known = known
        self._terms = terms
        self.points = network.plan.time_points[1:]
        self.last = len(self.points)
        """H."""
        self._rank = {point: index for index, point in enumerate(self.points)}
        self._first = {p: 1 + sum(self._surely_precedes(q, p) for q in self.points if q != p) for p in self.points}
        self._final = {
            p: self.last - sum(self._surely_precedes(p, q) for q in self.points if q != p) for p in self.points
        }
        self.by = cache(self._by)
        self.at = cache(self._at)
        self.candidates = cache(self._candidates)
        self.time = cache(self._time)
        self.same = cache(self._same)

    # -- the order -----------------------------------------------------------------------------------------------

    def _surely_precedes(self, first: TimePoint, second: TimePoint) -> bool:
        if self._rank[first] < self._rank[second]:
            return self._known.is_not_after(first, second)
        return self._known.is_before(first, second)

    def precedes(self, first: TimePoint, second: TimePoint) -> Formula:
        """Whether `first` has the earlier position: the order of times, and among equal times the plan's order."""
        if self._rank[first] > self._rank[second]:
            return self._terms.negation(self.precedes(second, first))
        if self._surely_precedes(first, second):
            return self._terms.true
        if self._surely_precedes(second, first):
            return self._terms.false
        return self._terms.at_least(self._network.distance(first, second))

    def _by(self, point: TimePoint, position: int) -> Formula:
        """Whether the time point has this position or an earlier one."""
        if position < self._first[point]:
            return self._terms.false
        if position >= self._final[point]:
            return self._terms.true
        return self._terms.fresh_boolean(f"[{point} by {position}]")

    def _at(self, point: TimePoint, position: int) -> Formula:
        """Whether the time point has this position."""
        return self._terms.conjunction((self.by(point, position), self._terms.negation(self.by(point, position - 1))))

    def _candidates(self, position: int) -> tuple[TimePoint, ...]:
        """The time points that may have a position."""
        return tuple(point for point in self.points if self._first[point] <= position <= self._final[point])

    # -- the times -----------------------------------------------------------------------------------------------

    def _time(self, position: int) -> Linear:
        """The time of a position."""
        candidates = self.candidates(position)
        if len(candidates) == 1:
            return self._network.place[candidates[0]]
        return variable(Auxiliary("time at position", position))

    def _same(self, position: int) -> Formula:
        """Whether a position has the time of the one before it: both belong to one happening."""
        if position == 1:
            return self._terms.false
        pairs = [(a, b) for a in self.candidates(position - 1) for b in self.candidates(position) if a != b]
        if all(self._known.is_before(a, b) for a, b in pairs):
            return self._terms.false
        return self._terms.equal(self.time(position) - self.time(position - 1))

    def axioms(self, deadline: Deadline) -> Iterator[Formula]:
        """What ties positions to times, a formula per time point and per position.

        Positions that increase strictly along a total order of H time points and lie in 1…H are that order.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        for point in self.points:
            parts = [self._monotone(point)]
            for other in self.points[: self._rank[point]]:
                deadline.enforce()
                first = self.precedes(other, point)
                parts.append(self._terms.implication(first, self._strictly(other, point)))
                parts.append(self._terms.implication(self._terms.negation(first), self._strictly(point, other)))
            yield self._terms.conjunction(parts)
        for position in range(1, self.last + 1):
            deadline.enforce()
            yield self._terms.conjunction(self._timing(position))

    def _monotone(self, point: TimePoint) -> Formula:
        positions = range(self._first[point], self._final[point])
        return self._terms.conjunction(
            self._terms.implication(self.by(point, k), self.by(point, k + 1)) for k in positions
        )

    def _strictly(self, earlier: TimePoint, later: TimePoint) -> Formula:
        """The position of one time point is less than the other's."""
        positions = range(self._first[later], self._final[later] + 1)
        return self._terms.conjunction(
            self._terms.implication(self.by(later, k), self.by(earlier, k - 1)) for k in positions
        )

    def _timing(self, position: int) -> Iterator[Formula]:
        time = self.time(position)
        for point in self.candidates(position):
            here = self._terms.equal(time - self._network.place[point])
            yield self._terms.implication(self.at(point, position), here)
        if position > 1:
            yield self._terms.at_least(time - self.time(position - 1))
