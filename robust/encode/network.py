"""enc_tn: the temporal network of a parametrized STN plan, and what is known of the order of its time points [IRR §2].

Equalities of the network are solved instead of asserted: each time point is a linear expression over the parameters
and the few time points that nothing ties down. In plans whose schedule is fixed up to the parameters no time variable
is left at all.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.encode.variables import Linear, Range, TimeVariable, constant, least, over_parameters, variable
from robust.plan.model import (
    ZERO,
    ParameterReference,
    ParametrizedPlan,
    TimePoint,
    TimePointKind,
)
from robust.smt.terms import Formula, Terms


@dataclass(frozen=True, slots=True)
class Difference:
    """`t_target − t_source ≥ weight`, weight over parameters; `origin` is the statement that it comes from.

    `is_default` marks `t_τ ≥ 0`, which holds for every time point unsaid.
    """

    source: TimePoint
    target: TimePoint
    weight: Linear
    origin: str
    is_default: bool = False


@dataclass(frozen=True, slots=True)
class Inequality:
    """`expression ≥ 0` with the statement that it comes from; for `t_τ ≥ 0`, which τ."""

    expression: Linear
    origin: str
    not_before_zero: TimePoint | None = None


class TemporalNetwork:
    """The network of a plan, with its rigid part solved.

    `positions` gives every time point as a linear expression; `differences` is the whole network as lower bounds;
    `inequalities` is what remains to be asserted: together with the definitions in `positions` it is enc_tn.
    """

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.plan = plan
        self.ranges: dict[str, Range] = {p.name: (p.lower, p.upper) for p in plan.parameters}
        self.differences = tuple(_differences(plan))
        self.positions, equations = _solve_equalities(plan)
        self.inequalities = tuple(self._inequalities(equations))

    def position(self, point: TimePoint) -> Linear:
        """t_τ."""
        return self.positions[point]

    def distance(self, difference: Difference) -> Linear:
        """What must be at least zero for the difference to hold."""
        return self.positions[difference.target] - self.positions[difference.source] - difference.weight

    def surely_at_least(self, weight: Linear) -> Fraction | None:
        """The least value of a weight over all declared parameter values; None if it has none."""
        return least(weight, self.ranges)

    def _inequalities(self, equations: list[Inequality]) -> Iterator[Inequality]:
        seen: set[Linear] = set()
        candidates = [
            *equations,
            # Said before unsaid: what is left out as implied must not be a statement of the plan.
            *(Inequality(self.distance(d), d.origin) for d in self.differences if not d.is_default),
            *(Inequality(self.distance(d), d.origin, d.target) for d in self.differences if d.is_default),
            *self.bounds_of_parameters(),
        ]
        for inequality in candidates:
            expression = inequality.expression
            trivial = expression.is_constant and expression.constant_term >= 0
            if not trivial and expression not in seen:
                seen.add(expression)
                yield inequality

    def bounds_of_parameters(self) -> Iterator[Inequality]:
        """The declared bounds."""
        for parameter in self.plan.parameters:
            value = variable(ParameterReference(parameter.name))
            if parameter.lower is not None:
                yield Inequality(value - parameter.lower, f"parameter {parameter.name} lb {parameter.lower}")
            if parameter.upper is not None:
                yield Inequality(-value + parameter.upper, f"parameter {parameter.name} ub {parameter.upper}")


def _differences(plan: ParametrizedPlan) -> Iterator[Difference]:
    for point in plan.time_points[1:]:
        yield Difference(ZERO, point, constant(0), f"{point} ≥ 0", is_default=True)
        if point.kind is TimePointKind.TIMED_LITERAL:
            time = constant(point.time or Fraction(0))
            yield Difference(ZERO, point, time, f"timed initial literal {point}")
            yield Difference(point, ZERO, -time, f"timed initial literal {point}")
    for item in plan.constraints:
        origin = str(item)
        if item.lower is not None:
            yield Difference(item.source, item.target, over_parameters(item.lower), origin)
        if item.upper is not None:
            yield Difference(item.target, item.source, -over_parameters(item.upper), origin)


def _solve_equalities(plan: ParametrizedPlan) -> tuple[dict[TimePoint, Linear], list[Inequality]]:
    """Tie time points together along equalities, breadth first from zero, then from each point not reached yet.

    A second equality between points that are tied already is an equation over the parameters.
    """
    ties: dict[TimePoint, list[tuple[TimePoint, Linear, str]]] = {point: [] for point in plan.time_points}
    for source, target, length, origin in _equalities(plan):
        ties[source].append((target, length, origin))
        ties[target].append((source, -length, origin))
    positions: dict[TimePoint, Linear] = {}
    equations: list[Inequality] = []
    for root in plan.time_points:
        if root in positions:
            continue
        positions[root] = constant(0) if root == ZERO else variable(TimeVariable(root))
        queue = [root]
        for point in queue:
            for neighbour, length, origin in ties[point]:
                place = positions[point] + length
                if neighbour not in positions:
                    positions[neighbour] = place
                    queue.append(neighbour)
                elif positions[neighbour] != place:
                    gap = place - positions[neighbour]
                    equations += [Inequality(gap, origin), Inequality(-gap, origin)]
    return positions, equations


def _equalities(plan: ParametrizedPlan) -> Iterator[tuple[TimePoint, TimePoint, Linear, str]]:
    for point in plan.time_points:
        if point.kind is TimePointKind.TIMED_LITERAL:
            yield ZERO, point, constant(point.time or Fraction(0)), f"timed initial literal {point}"
    for item in plan.constraints:
        if item.lower is not None and item.lower == item.upper:
            yield item.source, item.target, over_parameters(item.lower), str(item)


# Only ever compared and added: Python compares integers with infinities exactly.
NO_BOUND = -math.inf

Edge = tuple[TimePoint, TimePoint, Fraction]
"""(a, b, w): t_b − t_a ≥ w."""


class Orders:
    """Greatest known lower bounds between time points; more edges may be learnt.

    `consistent` is False if the edges contradict each other; the bounds mean nothing then.
    """

    def __init__(self, points: Sequence[TimePoint], edges: Iterable[Edge], scale: int) -> None:
        """`scale` must make every weight, of these edges and of later ones, an integer."""
        self._index = {point: index for index, point in enumerate(points)}
        self._scale = scale
        size = len(points)
        self._least: list[list[int | float]] = [[NO_BOUND] * size for _ in range(size)]
        for index in range(size):
            self._least[index][index] = 0
        for source, target, weight in edges:
            row, column = self._least[self._index[source]], self._index[target]
            row[column] = max(row[column], self._scaled(weight))
        self._close()
        self.consistent = all(self._least[index][index] == 0 for index in range(size))

    def _scaled(self, weight: Fraction) -> int:
        scaled = weight * self._scale
        return scaled.numerator // scaled.denominator

    def _close(self) -> None:
        least = self._least
        for middle, via in enumerate(least):
            for index, row in enumerate(least):
                first = row[middle]
                if first != NO_BOUND and index != middle:
                    least[index] = [
                        known if known >= first + rest else first + rest for known, rest in zip(row, via, strict=True)
                    ]

    def least(self, source: TimePoint, target: TimePoint) -> Fraction | None:
        """The greatest known w with t_target − t_source ≥ w; None if nothing is known."""
        value = self._least[self._index[source]][self._index[target]]
        return None if value == NO_BOUND else Fraction(int(value), self._scale)

    def learn(self, source: TimePoint, target: TimePoint, weight: Fraction) -> bool:
        """Add t_target − t_source ≥ weight and its consequences.

        Returns False, and changes nothing, if that was known or contradicts what is known.
        """
        a, b, scaled = self._index[source], self._index[target], self._scaled(weight)
        if self._least[a][b] >= scaled or self._least[b][a] + scaled > 0:
            return False
        tail = list(self._least[b])
        for index, row in enumerate(self._least):
            first = row[a]
            if first != NO_BOUND and first + scaled > row[b]:
                first += scaled
                self._least[index] = [
                    known if known >= first + rest else first + rest for known, rest in zip(row, tail, strict=True)
                ]
        return True

    def surely_before(self, first: TimePoint, second: TimePoint) -> bool:
        """Whether t_first < t_second in every schedule."""
        return self._least[self._index[first]][self._index[second]] > 0

    def surely_not_after(self, first: TimePoint, second: TimePoint) -> bool:
        """Whether t_first ≤ t_second in every schedule."""
        return self._least[self._index[first]][self._index[second]] >= 0


def common_scale(numbers: Iterable[Fraction]) -> int:
    """The least integer that makes every number an integer."""
    return math.lcm(*(number.denominator for number in numbers))


class Slices:
    """A conjunction of `expression ≥ 0` split into parts that share no unknown."""

    def __init__(self, terms: Terms, expressions: Iterable[Linear]) -> None:
        self._terms = terms
        self._leader: dict[str, str] = {}
        expressions = list(dict.fromkeys(expressions))
        for expression in expressions:
            names = [str(unknown) for unknown in expression.variables]
            for name in names:
                self._join(names[0], name)
        self._parts: dict[str, list[Formula]] = defaultdict(list)
        for expression in expressions:
            formula = terms.at_least(expression)
            name = next((str(unknown) for unknown in expression.variables), "")
            self._parts[self._find(name)].append(formula)

    def touching(self, formulas: Iterable[Formula]) -> list[Formula]:
        """The inequalities of every part that shares an unknown with the formulas, and those without unknowns."""
        names = {symbol.symbol_name() for formula in formulas for symbol in self._terms.variables(formula)}
        leaders = dict.fromkeys([self._find(""), *(self._find(name) for name in sorted(names))])
        return [formula for leader in leaders for formula in self._parts.get(leader, ())]

    def _find(self, name: str) -> str:
        while (leader := self._leader.get(name, name)) != name:
            self._leader[name] = self._leader.get(leader, leader)
            name = leader
        return name

    def _join(self, left: str, right: str) -> None:
        self._leader[self._find(left)] = self._find(right)
