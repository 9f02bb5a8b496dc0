"""Ground plans as certificates state them: network, actions and goal, and where each time point is.

The checker executes witnesses on this, and holds what formulas say of the network against it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeAlias, assert_never

from robust.encode.variables import Linear, Range, TimeVariable, constant, least, over_parameters, variable
from robust.plan.model import (
    ZERO,
    ActionInstance,
    And,
    Atom,
    Comparison,
    Condition,
    Duration,
    DurationConstraint,
    Expression,
    Holds,
    NumericVariable,
    Or,
    ParametrizedPlan,
    Relation,
    TimedCondition,
    TimePoint,
    Timing,
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
    earlier one; `ties` is the constraint that ties it, None if its time is free. `sides` numbers sides of constraints
    as certificates do, and `edges` are their sources, targets and least distances.
    """

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.plan = plan
        self.numbers: Mapping[TimePoint, int] = {point: index for index, point in enumerate(plan.time_points)}
        self.bounds = tuple(self._bounds())
        sides = [(index, side) for index, bound in enumerate(self.bounds) for side, *_ in bound.sides()]
        self.sides: Mapping[tuple[int, str], int] = {each: number for number, each in enumerate(sides)}
        self.edges = tuple(side[1:] for bound in self.bounds for side in bound.sides())
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
        for root_point, first in self.numbers.items():
            if first in self.places:
                continue
            self.places[first] = constant(0) if root_point == ZERO else variable(TimeVariable(root_point))
            self.ties[first] = None
            queue = [first]
            for index_of_point in queue:
                for neighbour, length, index in ties[index_of_point]:
                    if neighbour not in self.places:
                        self.places[neighbour] = self.places[index_of_point] + length
                        self.ties[neighbour] = index
                        queue.append(neighbour)

    def lines(self) -> Iterator[Line]:
        """The plan, one line for each part; `?duration` is written as the difference of two times."""
        for point in self.plan.time_points[1:]:
            yield ["point", str(point), *([True] if point.time is not None else [])]
        for bound in self.bounds:
            for _, source, target, length in bound.sides():
                yield ["constraint", source, target, expression(length)]
        fluents = self.plan.initial_fluents
        atoms = sorted(map(str, self.plan.initial_atoms))
        yield ["initial", atoms, [[str(fluent), expression(value)] for fluent, value in fluents.items()]]
        yield from (["condition", *line] for line, _ in self.conditions)
        for instance in self.plan.instances:
            yield from self._effects(instance)
        for literal in self.plan.timed_literals:
            if isinstance(literal.target, Atom):
                kind, value = ("add" if literal.value else "delete"), Line()
            else:
                kind, value = "assign", [[number(Fraction(literal.value))]]
            yield ["effect", self.numbers[literal.point], kind, str(literal.target), value, True]
        for index, place in self.places.items():
            if index:
                yield ["place", index, self._tie(index) or str(next(iter(place.variables)))]

    def _tie(self, point: int) -> list[int]:
        """The two sides of the equality that ties a time point, the one towards it first; none if it is free."""
        tie = self.ties[point]
        sides = () if tie is None else ("l", "u") if self.bounds[tie].target == point else ("u", "l")
        return [self.sides[tie, side] for side in sides if tie is not None]

    @cached_property
    def conditions(self) -> tuple[tuple[Line, str], ...]:
        """Every obligation other than separations, as start, end, condition and label, with its name.

        The end is None but for over-all conditions, and the start, too, for goals: they are evaluated after everything.
        """
        found: list[tuple[Line, str]] = []

        def add(start: int | None, end: int | None, node: bool | Line, label: str) -> None:
            found.append(([start, end, node, label], label))

        for instance in self.plan.instances:
            start, end = self.numbers[instance.start], self.numbers[instance.end]
            if instance.durative:
                length = Comparison(Polynomial.variable(Duration()), Relation.AT_LEAST)
                label = f"{instance.identifier} {instance.action}: non-negative duration"
                add(start, None, self._condition(length, instance), label)
            parts: tuple[DurationConstraint | TimedCondition, ...] = (*instance.durations, *instance.conditions)
            for part in parts:
                node = self._condition(part.condition, instance)
                if part.timing is Timing.OVER_ALL:
                    add(start, end, node, instance.label(part))
                else:
                    add(self.numbers[instance.at(part.timing)], None, node, instance.label(part))
        for goal in self.plan.goal:
            add(None, None, self._condition(goal.condition, None), goal.label)
        return tuple(found)

    def _effects(self, instance: ActionInstance) -> Iterator[Line]:
        for effect in instance.atom_effects:
            kind = "add" if effect.value else "delete"
            condition = self._condition(effect.condition, instance)
            yield ["effect", self.numbers[instance.at(effect.timing)], kind, str(effect.atom), [], condition]
        for change in instance.numeric_effects:
            amount, condition = (
                self._expression(change.expression, instance),
                self._condition(change.condition, instance),
            )
            point = self.numbers[instance.at(change.timing)]
            yield ["effect", point, change.operator.value, str(change.fluent), amount, condition]
        for rate in instance.continuous_effects:
            ends = self.numbers[instance.start], self.numbers[instance.end]
            yield ["rate", *ends, str(rate.fluent), self._expression(rate.rate, instance)]
        for name, where in sorted(instance.mentioned(), key=str):
            kind = "read" if isinstance(name, Atom) else "look"
            yield ["mention", self.numbers[where], kind, str(name), [], True]

    def _expression(self, polynomial: Expression, instance: ActionInstance | None) -> Line:
        """A polynomial over names: parameters, fluents, and times such as `@7`."""

        def named(unknown: NumericVariable) -> Polynomial[str]:
            if isinstance(unknown, Duration) and instance is not None:
                start, end = self.numbers[instance.start], self.numbers[instance.end]
                return Polynomial.variable(f"@{end}") - Polynomial.variable(f"@{start}")
            return Polynomial.variable(str(unknown))

        return expression(polynomial.substitute(named))

    def _condition(self, node: Condition, instance: ActionInstance | None) -> bool | Line:
        """A condition as JSON, the operands of a junction after its kind."""
        match node:
            case Truth(value):
                return value
            case Holds(atom, value):
                return ["h", str(atom), value]
            case Comparison(polynomial, relation):
                return ["c", self._expression(polynomial, instance), relation.value]
            case And(operands):
                return ["and", *(self._condition(operand, instance) for operand in operands)]
            case Or(operands):
                return ["or", *(self._condition(operand, instance) for operand in operands)]
        assert_never(node)


Point = Mapping[str, Fraction]
Step = int | Line
"""The number of a constraint, or, in a list, a time point: no time is negative."""


def length_of(ground: GroundPlan, steps: Sequence[Step], point: Point) -> Fraction:
    """What the constraints add up to at one point of parameter space."""
    total = cycle_sum(ground, steps)
    return total.evaluate({unknown: point[str(unknown)] for unknown in total.variables})


def cycle_sum(ground: GroundPlan, steps: Sequence[Step]) -> Linear:
    """What the constraints add up to, over the parameters."""
    return sum((_edge(ground, step)[2] for step in steps), constant(0))


def _edge(ground: GroundPlan, step: Step) -> tuple[int, int, Linear]:
    """Source, target and least length."""
    return (0, step[0], constant(0)) if isinstance(step, list) else ground.edges[step]


def positive_cycle(ground: GroundPlan, point: Point) -> list[Step] | None:
    """Bellman–Ford over all time points at one point of parameter space; None if there is a schedule."""
    steps: list[Step] = [[target] for target in ground.places if target]
    steps += range(len(ground.edges))
    edges = [(*_edge(ground, step)[:2], length_of(ground, [step], point), step) for step in steps]
    distance = dict.fromkeys(ground.places, Fraction(0))
    arrival: dict[int, tuple[int, Step]] = {}
    last: int | None = None
    for _ in range(len(distance) + 1):
        last = None
        for source, target, length, step in edges:
            if distance[source] + length > distance[target]:
                distance[target] = distance[source] + length
                arrival[target], last = (source, step), target
        if last is None:
            return None
    for _ in distance:
        last = arrival[last if last is not None else 0][0]
    first, cycle = last, list[Step]()
    while not cycle or last != first:
        source, step = arrival[last if last is not None else 0]
        cycle.append(step)
        last = source
    return cycle[::-1]


class LongestPaths:
    """Constraints that keep time points apart for all values in a box, each constraint at its worst.

    Args:
        ground: the plan.
        ranges: the box.
    """

    def __init__(self, ground: GroundPlan, ranges: Mapping[str, Range]) -> None:
        self._ground = ground
        floors = ((source, target, least(length, ranges)) for source, target, length in ground.edges)
        self._edges = [(source, target, floor, step) for step, (source, target, floor) in enumerate(floors)]
        self._found: dict[int, tuple[dict[int, Fraction], dict[int, tuple[int, int]]]] = {}

    def between(self, source: int, target: int, distance: Fraction) -> list[int] | None:
        """The numbers of constraints from one time point to another that add up to at least a distance, if any do."""
        if source not in self._found:
            self._found[source] = self._from(source)
        reached, arrival = self._found[source]
        if target not in reached or reached[target] < distance:
            return None
        steps: list[int] = []
        while target != source and len(steps) <= len(self._edges):
            target, step = arrival[target]
            steps.append(step)
        return steps[::-1]

    def _from(self, source: int) -> tuple[dict[int, Fraction], dict[int, tuple[int, int]]]:
        """Bellman–Ford: distances and the last steps towards each time point."""
        reached = {source: Fraction(0)}
        arrival: dict[int, tuple[int, int]] = {}
        for _ in self._ground.places:
            changed = False
            for start, end, floor, step in self._edges:
                if floor is None or start not in reached or end == source:
                    continue
                distance = reached[start] + floor
                if end not in reached or distance > reached[end]:
                    reached[end], arrival[end], changed = distance, (start, step), True
            if not changed:
                break
        return reached, arrival
