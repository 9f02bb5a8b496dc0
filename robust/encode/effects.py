"""The effects of a plan by what they change, and mutex pairs of time points [Fox and Long 2003, §8]."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from robust.plan.model import (
    ActionInstance,
    AssignmentKind,
    Atom,
    AtomEffect,
    Condition,
    ContinuousEffect,
    DurationConstraint,
    Expression,
    Fluent,
    Holds,
    NumericCondition,
    NumericEffect,
    ParametrizedPlan,
    TimedCondition,
    TimePoint,
    TimePointKind,
    Timing,
    Truth,
    fluents_in,
    leaves,
)
from robust.plan.polynomial import Polynomial

ZERO_RATE = Polynomial.constant(0)


@dataclass(frozen=True, slots=True)
class AtomWrite:
    """An atom gets a truth value at `point` if `condition` held just before; no instance: a timed literal."""

    point: TimePoint
    value: bool
    condition: Condition
    instance: ActionInstance | None


@dataclass(frozen=True, slots=True)
class FluentWrite:
    """A fluent is assigned or increased at `point` if `condition` held just before; no instance: a timed literal."""

    point: TimePoint
    assigns: bool
    amount: Expression
    condition: Condition
    instance: ActionInstance | None


@dataclass(frozen=True, slots=True)
class Flow:
    """A continuous effect of an instance, with a rate other than zero."""

    instance: ActionInstance
    effect: ContinuousEffect


class Writes:
    """All effects of a plan: on atoms, on fluents in the order of the plan's time points, and continuous ones."""

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.of_atom: dict[Atom, list[AtomWrite]] = defaultdict(list)
        self.of_fluent: dict[Fluent, list[FluentWrite]] = defaultdict(list)
        self.flows: dict[Fluent, list[Flow]] = defaultdict(list)
        for instance in plan.instances:
            for effect in instance.atom_effects:
                point = instance.at(effect.timing)
                self.of_atom[effect.atom].append(AtomWrite(point, effect.value, effect.condition, instance))
            for numeric in instance.numeric_effects:
                point, assigns = instance.at(numeric.timing), numeric.operator is AssignmentKind.ASSIGN
                write = FluentWrite(point, assigns, numeric.expression, numeric.condition, instance)
                self.of_fluent[numeric.fluent].append(write)
            for continuous in instance.continuous_effects:
                if continuous.rate != ZERO_RATE:
                    self.flows[continuous.fluent].append(Flow(instance, continuous))
        for literal in plan.timed_literals:
            match literal.target:
                case Atom():
                    timed = AtomWrite(literal.point, bool(literal.value), Truth(True), None)
                    self.of_atom[literal.target].append(timed)
                case Fluent():
                    amount: Expression = Polynomial.constant(Fraction(literal.value))
                    assigned = FluentWrite(literal.point, True, amount, Truth(True), None)
                    self.of_fluent[literal.target].append(assigned)
        rank = {point: index for index, point in enumerate(plan.time_points)}
        for writes in self.of_fluent.values():
            writes.sort(key=lambda write: rank[write.point])

    def changes(self, fluent: Fluent) -> bool:
        """Whether anything in the plan changes the fluent."""
        return fluent in self.of_fluent or fluent in self.flows


def mutex_pairs(plan: ParametrizedPlan) -> tuple[tuple[TimePoint, TimePoint], ...]:
    """The time points that must be ε apart, in the plan's order: PDDL 2.1's rule of no moving targets.

    Reads are all that a text mentions, even where it cancels; over-all conditions are no reads; a continuous effect
    writes at both ends of its action; increases and decreases of one fluent commute.
    """
    rank = {point: index for index, point in enumerate(plan.time_points)}
    pairs = {
        (min(pair, key=rank.__getitem__), max(pair, key=rank.__getitem__))
        for pair in _conflicts(plan)
        if pair[0] != pair[1] and not all(point.kind is TimePointKind.TIMED_LITERAL for point in pair)
    }
    return tuple(sorted(pairs, key=lambda pair: (rank[pair[0]], rank[pair[1]])))


def _conflicts(plan: ParametrizedPlan) -> Iterator[tuple[TimePoint, TimePoint]]:
    writes = Writes(plan)
    readers = defaultdict[Atom | Fluent, set[TimePoint]](set)
    flowing = defaultdict[Fluent, set[TimePoint]](set)
    for instance in plan.instances:
        for name, points in _reads(instance):
            readers[name].update(points)
        for continuous in instance.continuous_effects:
            flowing[continuous.fluent].update(instance.time_points)
    for atom, changes in writes.of_atom.items():
        adders = {write.point for write in changes if write.value}
        deleters = {write.point for write in changes if not write.value}
        yield from product(adders, deleters)
        yield from product(adders | deleters, readers[atom])
    for fluent in writes.of_fluent | flowing:
        discrete = writes.of_fluent.get(fluent, [])
        touched = {write.point for write in discrete} | flowing[fluent]
        yield from product({write.point for write in discrete if write.assigns}, touched)
        yield from product(touched, readers[fluent])


def _reads(instance: ActionInstance) -> Iterator[tuple[Atom | Fluent, tuple[TimePoint, ...]]]:
    """What the instance reads, and when."""
    parts: tuple[TimedCondition | DurationConstraint | AtomEffect | NumericEffect, ...] = (
        *instance.conditions,
        *instance.durations,
        *instance.atom_effects,
        *instance.numeric_effects,
    )
    for part in parts:
        if part.timing is not Timing.OVER_ALL:
            for name in names_in(part.condition):
                yield name, (instance.at(part.timing),)
    for numeric in instance.numeric_effects:
        for fluent in fluents_in(numeric.expression):
            yield fluent, (instance.at(numeric.timing),)
    for continuous in instance.continuous_effects:
        for fluent in fluents_in(continuous.rate):
            yield fluent, instance.time_points
    for name, point in instance.mentioned():
        yield name, (point,)


def names_in(condition: Condition) -> Iterator[Atom | Fluent]:
    """Atoms and fluents that a condition mentions."""
    for leaf in leaves(condition):
        match leaf:
            case Holds(atom):
                yield atom
            case NumericCondition(expression):
                yield from fluents_in(expression)
