"""The effects of a plan by what they change, and mutex pairs of time points [Fox and Long 2003, §8]."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from robust.plan import model
from robust.plan.polynomial import Polynomial

ZERO_RATE = Polynomial.constant(0)


@dataclass(frozen=True, slots=True)
class AtomWrite:
    """An atom gets a truth value at `point` if `condition` held just before; no instance: a timed literal."""

    point: model.TimePoint
    value: bool
    condition: model.Condition
    instance: model.ActionInstance | None


@dataclass(frozen=True, slots=True)
class FluentWrite:
    """A fluent is assigned or increased at `point` if `condition` held just before; no instance: a timed literal."""

    point: model.TimePoint
    assigns: bool
    amount: model.Expression
    condition: model.Condition
    instance: model.ActionInstance | None


@dataclass(frozen=True, slots=True)
class Flow:
    """A continuous effect of an instance, with a rate other than zero."""

    instance: model.ActionInstance
    effect: model.ContinuousEffect


class Writes:
    """All effects of a plan: on atoms, on fluents in the order of the plan's time points, and continuous ones."""

    def __init__(self, plan: model.ParametrizedPlan) -> None:
        self.of_atom: dict[model.Atom, list[AtomWrite]] = defaultdict(list)
        self.of_fluent: dict[model.Fluent, list[FluentWrite]] = defaultdict(list)
        self.flows: dict[model.Fluent, list[Flow]] = defaultdict(list)
        for instance in plan.instances:
            for effect in instance.atom_effects:
                point = instance.at(effect.timing)
                self.of_atom[effect.atom].append(AtomWrite(point, effect.value, effect.condition, instance))
            for numeric in instance.numeric_effects:
                point, assigns = instance.at(numeric.timing), numeric.operator is model.AssignmentKind.ASSIGN
                write = FluentWrite(point, assigns, numeric.expression, numeric.condition, instance)
                self.of_fluent[numeric.fluent].append(write)
            for continuous in instance.continuous_effects:
                if continuous.rate != ZERO_RATE:
                    self.flows[continuous.fluent].append(Flow(instance, continuous))
        for literal in plan.timed_literals:
            match literal.target:
                case model.Atom():
                    timed = AtomWrite(literal.point, bool(literal.value), model.Truth(True), None)
                    self.of_atom[literal.target].append(timed)
                case model.Fluent():
                    amount: model.Expression = Polynomial.constant(Fraction(literal.value))
                    assigned = FluentWrite(literal.point, True, amount, model.Truth(True), None)
                    self.of_fluent[literal.target].append(assigned)
        rank = {point: index for index, point in enumerate(plan.time_points)}
        for writes in self.of_fluent.values():
            writes.sort(key=lambda write: rank[write.point])

    def changes(self, fluent: model.Fluent) -> bool:
        """Whether anything in the plan changes the fluent."""
        return fluent in self.of_fluent or fluent in self.flows


def mutex_pairs(plan: model.ParametrizedPlan) -> tuple[tuple[model.TimePoint, model.TimePoint], ...]:
    """The time points that must be ε apart, in the plan's order: PDDL 2.1's rule of no moving targets.

    Reads are all that a text mentions, even where it cancels; over-all conditions are no reads; a continuous effect
    writes at both ends of its action; increases and decreases of one fluent commute.
    """
    rank = {point: index for index, point in enumerate(plan.time_points)}
    pairs = {
        (min(pair, key=rank.__getitem__), max(pair, key=rank.__getitem__))
        for pair in _conflicts(plan)
        if pair[0] != pair[1] and not all(point.kind is model.TimePointKind.TIMED_LITERAL for point in pair)
    }
    return tuple(sorted(pairs, key=lambda pair: (rank[pair[0]], rank[pair[1]])))


def _conflicts(plan: model.ParametrizedPlan) -> Iterator[tuple[model.TimePoint, model.TimePoint]]:
    writes = Writes(plan)
    readers = defaultdict[model.Atom | model.Fluent, set[model.TimePoint]](set)
    flowing = defaultdict[model.Fluent, set[model.TimePoint]](set)
    for instance in plan.instances:
        for name, points in reads(instance):
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


def reads(instance: model.ActionInstance) -> Iterator[tuple[model.Atom | model.Fluent, tuple[model.TimePoint, ...]]]:
    """The atoms and fluents that an instance reads, with the time points of the reads."""
    parts: tuple[model.TimedCondition | model.DurationConstraint | model.AtomEffect | model.NumericEffect, ...] = (
        *instance.conditions,
        *instance.durations,
        *instance.atom_effects,
        *instance.numeric_effects,
    )
    for part in parts:
        if part.timing is not model.Timing.OVER_ALL:
            for name in names_in(part.condition):
                yield name, (instance.at(part.timing),)
    for numeric in instance.numeric_effects:
        for fluent in model.fluents_in(numeric.expression):
            yield fluent, (instance.at(numeric.timing),)
    for continuous in instance.continuous_effects:
        for fluent in model.fluents_in(continuous.rate):
            yield fluent, instance.time_points
    for name, point in instance.mentioned():
        yield name, (point,)


def names_in(condition: model.Condition) -> Iterator[model.Atom | model.Fluent]:
    """Atoms and fluents that a condition mentions."""
    for leaf in model.leaves(condition):
        match leaf:
            case model.Holds(atom):
                yield atom
            case model.NumericCondition(expression):
                yield from model.fluents_in(expression)
