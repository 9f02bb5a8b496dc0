"""Ground plans as certificates state them: network, actions and goal, and where each time point is.

The checker executes witnesses on this, and holds what formulas say of the network against it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias, assert_never

from robust.encode.network import over_parameters
from robust.encode.variables import Linear, TimeVariable, constant, variable
from robust.plan.model import (
    ZERO,
    ActionInstance,
    And,
    Atom,
    Comparison,
    Condition,
    Holds,
    Or,
    ParametrizedPlan,
    TimePoint,
    Truth,
)
from robust.plan.polynomial import Polynomial

Line: TypeAlias = list[Any]


def number(value: Fraction) -> int | str:
    """A rational as JSON: an integer, or text."""
    return value.numerator if value.denominator == 1 else str(value)


def optional(value: Fraction | None) -> int | str | None:
    return None if value is None else number(value)


def expression(polynomial: Polynomial[Any]) -> Line:
    """A polynomial as a list of [coefficient, variables...]."""
    return [[number(factor), *map(str, monomial)] for monomial, factor in polynomial.terms.items()]


def condition(node: Condition) -> bool | Line:
    """A condition as JSON, the operands of a junction after its kind."""
    match node:
        case Truth(value):
            return value
        case Holds(atom, value):
            return ["h", str(atom), value]
        case Comparison(polynomial, relation):
            return ["c", expression(polynomial), relation.value]
        case And(operands):
            return ["and", *map(condition, operands)]
        case Or(operands):
            return ["or", *map(condition, operands)]
    assert_never(node)


@dataclass(frozen=True)
class Bound:
    """One constraint of the network: `lower ≤ t_target − t_source ≤ upper`, by the numbers of time points."""

    source: int
    target: int
    lower: Linear | None
    upper: Linear | None

    def sides(self) -> Iterator[tuple[str, int, int, Linear]]:
        """Each finite side as a lower bound: its name, source, target and least distance."""
        if self.lower is not None:
            yield "l", self.source, self.target, self.lower
        if self.upper is not None:
            yield "u", self.target, self.source, -self.upper


class GroundPlan:
    """A plan with numbered time points and constraints.

    `places` gives each time point's time over parameters and free time points, in an order in which each is tied to an
    earlier one; `ties` is the constraint that ties it, None if its time is free.
    """

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.plan = plan
        self.numbers: Mapping[TimePoint, int] = {point: index for index, point in enumerate(plan.time_points)}
        self.bounds = tuple(self._bounds())
        self.places: dict[int, Linear] = {}
        self.ties: dict[int, int | None] = {}
        self._place()

    def _bounds(self) -> Iterator[Bound]:
        for point in self.plan.time_points:
            if point.time is not None:
                yield Bound(0, self.numbers[point], constant(point.time), constant(point.time))
        for item in self.plan.constraints:
            lower, upper = (None if side is None else over_parameters(side) for side in (item.lower, item.upper))
            yield Bound(self.numbers[item.source], self.numbers[item.target], lower, upper)

    def _place(self) -> None:
        """Along equalities, breadth first, as the encodings do, so that free time points have their names."""
        ties: dict[int, list[tuple[int, Linear, int]]] = {index: [] for index in self.numbers.values()}
        for index, bound in enumerate(self.bounds):
            if bound.lower is not None and bound.lower == bound.upper:
                ties[bound.source].append((bound.target, bound.lower, index))
                ties[bound.target].append((bound.source, -bound.lower, index))
        for root, first in self.numbers.items():
            if first in self.places:
                continue
            self.places[first] = constant(0) if root == ZERO else variable(TimeVariable(root))
            self.ties[first] = None
            queue = [first]
            for point in queue:
                for neighbour, length, index in ties[point]:
                    if neighbour not in self.places:
                        self.places[neighbour] = self.places[point] + length
                        self.ties[neighbour] = index
                        queue.append(neighbour)

    def lines(self) -> Iterator[Line]:
        """The plan, one line for each part."""
        yield from (["point", str(point)] for point in self.plan.time_points[1:])
        for bound in self.bounds:
            sides = (None if side is None else expression(side) for side in (bound.lower, bound.upper))
            yield ["constraint", bound.source, bound.target, *sides]
        yield from (["action", *self._action(instance)] for instance in self.plan.instances)
        fluents = self.plan.initial_fluents
        atoms = sorted(map(str, self.plan.initial_atoms))
        yield ["initial", atoms, [[str(fluent), expression(value)] for fluent, value in fluents.items()]]
        for literal in self.plan.timed_literals:
            value = literal.value if isinstance(literal.target, Atom) else number(Fraction(literal.value))
            yield ["literal", self.numbers[literal.point], str(literal.target), value]
        yield from (["goal", condition(goal.condition), goal.label] for goal in self.plan.goal)
        for point, place in self.places.items():
            if point:
                yield ["place", point, expression(place), self.ties[point]]

    def _action(self, instance: ActionInstance) -> Iterator[Any]:
        yield from (instance.identifier, instance.action)
        yield from (self.numbers[instance.start], self.numbers[instance.end])
        yield [[d.timing.value, condition(d.condition), instance.label(d)] for d in instance.durations]
        yield [[c.timing.value, condition(c.condition), instance.label(c)] for c in instance.conditions]
        yield [[e.timing.value, str(e.atom), e.value, condition(e.condition)] for e in instance.atom_effects]
        yield [
            [e.timing.value, str(e.fluent), e.operator.value, expression(e.expression), condition(e.condition)]
            for e in instance.numeric_effects
        ]
        yield [[str(e.fluent), expression(e.rate)] for e in instance.continuous_effects]
