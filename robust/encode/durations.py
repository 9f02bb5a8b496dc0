"""Duration constraints of instances, as obligations and as bounds between start and end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from robust.encode.mutex import fluents_in
from robust.encode.network import Difference
from robust.encode.variables import Auxiliary, Linear, variable
from robust.plan.model import (
    ActionInstance,
    Comparison,
    Duration,
    Fluent,
    NumericVariable,
    ParameterReference,
    ParametrizedPlan,
    Relation,
)
from robust.plan.polynomial import Polynomial

_LENGTH = Auxiliary("duration", 0)


@dataclass(frozen=True, slots=True)
class DurationRule:
    """A duration constraint that does not depend on the state.

    `bounds` are the lower bounds between start and end that follow from it; together they say all of it if `exact`.
    """

    name: str
    instance: ActionInstance
    condition: Comparison
    bounds: tuple[Difference, ...]
    exact: bool


def duration_rules(plan: ParametrizedPlan) -> Iterator[DurationRule]:
    """The rules of all durative instances: not negative, and what the domain says of `?duration`."""
    written = written_fluents(plan)
    positive = Comparison(Polynomial.variable(Duration()), Relation.AT_LEAST)
    for instance in plan.instances:
        if instance.durative:
            yield _rule(plan, f"{instance.identifier} {instance.action}: non-negative duration", instance, positive)
            for duration in instance.durations:
                if written.isdisjoint(fluents_in(duration.condition.expression)):
                    yield _rule(plan, instance.label(duration), instance, duration.condition)


def written_fluents(plan: ParametrizedPlan) -> frozenset[Fluent]:
    """Every fluent that an instance of the plan or a timed initial literal changes."""
    return frozenset(
        [effect.fluent for instance in plan.instances for effect in instance.numeric_effects]
        + [effect.fluent for instance in plan.instances for effect in instance.continuous_effects]
        + [literal.target for literal in plan.timed_literals if isinstance(literal.target, Fluent)]
    )


def _rule(plan: ParametrizedPlan, name: str, instance: ActionInstance, condition: Comparison) -> DurationRule:
    def value(unknown: NumericVariable) -> Linear:
        match unknown:
            case Duration():
                return variable(_LENGTH)
            case ParameterReference():
                return variable(unknown)
            case Fluent():
                initial = plan.initial_fluents[unknown]
                return initial.substitute(value)

    expression = condition.expression.substitute(value)
    factor = expression.terms.get((_LENGTH,), Fraction(0))
    if not factor or not expression.is_linear:
        return DurationRule(name, instance, condition, (), False)
    limit = (variable(_LENGTH).scaled(factor) - expression).scaled(1 / factor)
    bounds = []
    if condition.relation is Relation.EQUAL or (factor > 0 and condition.relation is not Relation.DIFFERENT):
        bounds.append(Difference(instance.start, instance.end, limit, name))
    if condition.relation is Relation.EQUAL or (factor < 0 and condition.relation is not Relation.DIFFERENT):
        bounds.append(Difference(instance.end, instance.start, -limit, name))
    return DurationRule(name, instance, condition, tuple(bounds), condition.relation in _WEAK)


_WEAK = (Relation.AT_LEAST, Relation.EQUAL)
