"""The temporal network of the positions encoding, and the order of its time points [IRR §2].

Position 1 is the earliest time point's, position H the latest's; simultaneous time points keep the plan's order. The
choice is a Boolean per time point and position, "by then it has happened", so formulas stay polynomial and the solver
searches the orders.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import lcm

from robust.encode.variables import Auxiliary, Linear, Range, TimeVariable, constant, least, over_parameters, variable
from robust.plan.model import (
    ZERO,
    ParameterReference,
    ParametrizedPlan,
    TimePoint,
)
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


@dataclass(frozen=True, slots=True)
class Statement:
    """`expression ≥ 0`, and where that is said."""

    expression: Linear
    origin: str


class Network:
    """The times of a plan's time points and all that the plan demands of them.

    `place` is each time point's time; `statements` are the inequalities that remain, constant true ones left out.
    """

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.plan = plan
        self.ranges: Mapping[str, Range] = {p.name: (p.lower, p.upper) for p in plan.parameters}
        self.place = _places(plan)
        candidates = {statement.expression: statement for statement in reversed([*self._demands()])}
        self.statements = tuple(
            statement
            for expression, statement in reversed(candidates.items())
            if not (expression.is_constant and expression.constant_term >= 0)
        )

    def distance(self, source: TimePoint, target: TimePoint) -> Linear:
        """t_target − t_source."""
        return self.place[target] - self.place[source]

    def _demands(self) -> Iterator[Statement]:
        for point in self.plan.time_points:
            yield Statement(self.place[point], f"{point} ≥ 0")
            if point.time is not None:
                late = self.place[point] - point.time
                yield Statement(late, f"timed initial literal {point}")
                yield Statement(-late, f"timed initial literal {point}")
        for item in self.plan.constraints:
            origin, distance = str(item), self.distance(item.source, item.target)
            if item.lower is not None:
                yield Statement(distance - over_parameters(item.lower), origin)
            if item.upper is not None:
                yield Statement(over_parameters(item.upper) - distance, origin)
        for parameter in self.plan.parameters:
            value = variable(ParameterReference(parameter.name))
            if parameter.lower is not None:
                yield Statement(value - parameter.lower, f"parameter {parameter.name} lb {parameter.lower}")
            if parameter.upper is not None:
                yield Statement(-value + parameter.upper, f"parameter {parameter.name} ub {parameter.upper}")


def _places(plan: ParametrizedPlan) -> dict[TimePoint, Linear]:
    ties: dict[TimePoint, list[tuple[TimePoint, Linear]]] = defaultdict(list)
    for point in plan.time_points:
        if point.time is not None:
            ties[ZERO].append((point, constant(point.time)))
    for item in plan.constraints:
        if item.lower is not None and item.lower == item.upper:
            length = over_parameters(item.lower)
            ties[item.source].append((item.target, length))
            ties[item.target].append((item.source, -length))
    places: dict[TimePoint, Linear] = {}
    for first in plan.time_points:
        if first not in places:
            places[first] = constant(0) if first == ZERO else variable(TimeVariable(first))
            component = [first]
            for point in component:
                for neighbour, length in ties[point]:
                    if neighbour not in places:
                        places[neighbour] = places[point] + length
                        component.append(neighbour)
    return places


class KnownOrder:
    """Lower bounds of distances between time points that hold whatever the parameters are.

    Args:
        network: the network; bounds that depend on parameters count with their least declared value.
        more: further `t_target − t_source ≥ weight` to take as given.
        apart: pairs that are to be `epsilon` apart, in one order or the other; used where the order is known.
        epsilon: the separation.

    Where what is taken as given contradicts itself nothing is claimed: formulas built with it are correct all the same.
    """

    def __init__(
        self,
        network: Network,
        more: Iterable[tuple[TimePoint, TimePoint, Linear]] = (),
        apart: Iterable[tuple[TimePoint, TimePoint]] = (),
        epsilon: Fraction = Fraction(0),
    ) -> None:
        points = network.plan.time_points
        self._index = {point: index for index, point in enumerate(points)}
        bounds = [*_rigid_bounds(network), *_stated_bounds(network, more)]
        self._scale = lcm(epsilon.denominator, *(weight.denominator for _, _, weight in bounds))
        self._rows: list[list[int | None]] = [[None] * len(points) for _ in points]
        for index, row in enumerate(self._rows):
            row[index] = 0
        for source, target, weight in bounds:
            self._raise(self._index[source], self._index[target], int(weight * self._scale))
        self._close()
        self._separate(list(apart), int(epsilon * self._scale))
        if any(row[index] != 0 for index, row in enumerate(self._rows)):
            self._rows = [[0 if a == b else None for b in range(len(points))] for a in range(len(points))]

    def least(self, source: TimePoint, target: TimePoint) -> Fraction | None:
        """The greatest known lower bound of t_target − t_source."""
        value = self._rows[self._index[source]][self._index[target]]
        return None if value is None else Fraction(value, self._scale)

    def is_before(self, first: TimePoint, second: TimePoint) -> bool:
        """Whether t_first < t_second is known."""
        value = self._rows[self._index[first]][self._index[second]]
        return value is not None and value > 0

    def is_not_after(self, first: TimePoint, second: TimePoint) -> bool:
        """Whether t_first ≤ t_second is known."""
        value = self._rows[self._index[first]][self._index[second]]
        return value is not None and value >= 0

    def _raise(self, source: int, target: int, weight: int) -> None:
        known = self._rows[source][target]
        if known is None or known < weight:
            self._rows[source][target] = weight

    def _close(self) -> None:
        for middle in range(len(self._rows)):
            self._pass_through(middle, middle, 0)

    def _pass_through(self, source: int, target: int, weight: int) -> None:
        """Extend every path that ends in `source` by an edge of `weight` and a path that begins in `target`."""
        tail = list(self._rows[target])
        for start, row in enumerate(self._rows):
            head = row[source]
            if head is not None:
                for goal, rest in enumerate(tail):
                    if rest is not None:
                        self._raise(start, goal, head + weight + rest)

    def _separate(self, apart: list[tuple[TimePoint, TimePoint]], epsilon: int) -> None:
        """Two points at least ε apart whose order is known up to less than ε are ε apart in that order."""
        pairs = [(self._index[first], self._index[second]) for first, second in apart]
        ordered = [*pairs, *((second, first) for first, second in pairs)]
        learning = True
        while learning:
            learning = False
            for first, second in ordered:
                known, back = self._rows[first][second], self._rows[second][first]
                if known is not None and -epsilon < known < epsilon and (back is None or back <= -epsilon):
                    self._pass_through(first, second, epsilon)
                    learning = True


def _rigid_bounds(network: Network) -> Iterator[tuple[TimePoint, TimePoint, Fraction]]:
    for source, start in network.place.items():
        for target, end in network.place.items():
            bound = least(end - start, network.ranges)
            if bound is not None:
                yield source, target, bound


def _stated_bounds(
    network: Network, more: Iterable[tuple[TimePoint, TimePoint, Linear]]
) -> Iterator[tuple[TimePoint, TimePoint, Fraction]]:
    stated = [(ZERO, point, constant(0)) for point in network.plan.time_points]
    for item in network.plan.constraints:
        if item.lower is not None:
            stated.append((item.source, item.target, over_parameters(item.lower)))
        if item.upper is not None:
            stated.append((item.target, item.source, -over_parameters(item.upper)))
    for source, target, weight in (*stated, *more):
        bound = least(weight, network.ranges)
        if bound is not None:
            yield source, target, bound
