"""Who changes what: the effects of a plan by atom and fluent, in the order in which simultaneous ones count."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from robust.encode.positions.reading import comparisons, fluents_of
from robust.plan.model import (
    ActionInstance,
    Assignment,
    Atom,
    Condition,
    ContinuousEffect,
    Expression,
    Fluent,
    ParametrizedPlan,
    TimePoint,
    Truth,
)
from robust.plan.polynomial import Polynomial


@dataclass(frozen=True, slots=True)
class AtomWrite:
    """At `point` the atom gets a truth value if `condition` holds just before; no instance: a timed literal."""

    point: TimePoint
    value: bool
    condition: Condition
    instance: ActionInstance | None


@dataclass(frozen=True, slots=True)
class FluentWrite:
    """At `point` the fluent is assigned or increased if `condition` holds just before."""

    point: TimePoint
    assigns: bool
    amount: Expression
    condition: Condition
    instance: ActionInstance | None


@dataclass(frozen=True, slots=True)
class Flow:
    """A continuous effect, numbered `index` among those of its instance."""

    instance: ActionInstance
    index: int
    effect: ContinuousEffect


class Writes:
    """All effects of a plan.

    `fluents` are those that are both written and read anywhere: nothing depends on the values of others.
    """

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.of_atom: dict[Atom, list[AtomWrite]] = defaultdict(list)
        self.of_fluent: dict[Fluent, list[FluentWrite]] = defaultdict(list)
        self.flows: dict[Fluent, list[Flow]] = defaultdict(list)
        for instance in plan.instances:
            for effect in instance.atom_effects:
                point = instance.at(effect.timing)
                self.of_atom[effect.atom].append(AtomWrite(point, effect.value, effect.condition, instance))
            for numeric in instance.numeric_effects:
                point, assigns = instance.at(numeric.timing), numeric.operator is Assignment.ASSIGN
                write = FluentWrite(point, assigns, numeric.expression, numeric.condition, instance)
                self.of_fluent[numeric.fluent].append(write)
            for index, continuous in enumerate(instance.continuous_effects):
                self.flows[continuous.fluent].append(Flow(instance, index, continuous))
        always = Truth(True)
        for literal in plan.timed_literals:
            if isinstance(literal.target, Atom):
                self.of_atom[literal.target].append(AtomWrite(literal.point, bool(literal.value), always, None))
            else:
                amount: Expression = Polynomial.constant(Fraction(literal.value))
                self.of_fluent[literal.target].append(FluentWrite(literal.point, True, amount, always, None))
        read = set(_fluents_read(plan))
        self.fluents = tuple(f for f in dict.fromkeys((*self.of_fluent, *self.flows)) if f in read)

    def changes(self, fluent: Fluent) -> bool:
        return fluent in self.of_fluent or fluent in self.flows


def _fluents_read(plan: ParametrizedPlan) -> Iterator[Fluent]:
    conditions: list[Condition] = [goal.condition for goal in plan.goal]
    for instance in plan.instances:
        conditions += [part.condition for part in instance.conditions]
        conditions += [part.condition for part in instance.durations]
        conditions += [effect.condition for effect in instance.atom_effects]
        conditions += [numeric.condition for numeric in instance.numeric_effects]
        for numeric in instance.numeric_effects:
            yield from fluents_of(numeric.expression)
    for condition in conditions:
        for comparison in comparisons(condition):
            yield from fluents_of(comparison.expression)
