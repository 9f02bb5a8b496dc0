"""Action instances with actual values in place of parameters and of fluents whose value varies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import assert_never

from robust.plan.model import (
    ActionInstance,
    And,
    Comparison,
    Condition,
    Expression,
    Holds,
    NumericVariable,
    Or,
    Truth,
)
from robust.plan.polynomial import Polynomial
from robust.plan.timeline import leaves

Values = Mapping[NumericVariable, Fraction]


def variables_of(instance: ActionInstance) -> frozenset[NumericVariable]:
    """The variables that an instance reads."""
    return frozenset(variable for expression in _expressions(instance) for variable in expression.variables)


def variables_of_effects(instance: ActionInstance) -> frozenset[NumericVariable]:
    """The variables that decide how much an instance changes."""
    expressions = [effect.expression for effect in instance.numeric_effects]
    expressions += [effect.rate for effect in instance.continuous_effects]
    return frozenset(variable for expression in expressions for variable in expression.variables)


def _expressions(instance: ActionInstance) -> Iterator[Expression]:
    conditions: list[Condition] = [one.condition for one in instance.durations]
    conditions += [one.condition for one in instance.conditions]
    conditions += [one.condition for one in instance.atom_effects]
    conditions += [one.condition for one in instance.numeric_effects]
    for condition in conditions:
        yield from (leaf.expression for leaf in leaves(condition) if isinstance(leaf, Comparison))
    yield from (effect.expression for effect in instance.numeric_effects)
    yield from (effect.rate for effect in instance.continuous_effects)


def with_values(instance: ActionInstance, values: Values) -> ActionInstance:
    """The instance with these variables replaced by their values, in conditions and effects."""
    if not values or variables_of(instance).isdisjoint(values):
        return instance
    return replace(
        instance,
        durations=tuple(replace(one, condition=_comparison(one.condition, values)) for one in instance.durations),
        conditions=tuple(replace(one, condition=condition_with(one.condition, values)) for one in instance.conditions),
        atom_effects=tuple(
            replace(one, condition=condition_with(one.condition, values)) for one in instance.atom_effects
        ),
        numeric_effects=tuple(
            replace(
                one,
                expression=expression_with(one.expression, values),
                condition=condition_with(one.condition, values),
            )
            for one in instance.numeric_effects
        ),
        continuous_effects=tuple(
            replace(one, rate=expression_with(one.rate, values)) for one in instance.continuous_effects
        ),
    )


def expression_with(expression: Expression, values: Values) -> Expression:
    """An expression with these variables replaced by their values."""

    def value(variable: NumericVariable) -> Expression:
        known = values.get(variable)
        return Polynomial.variable(variable) if known is None else Polynomial.constant(known)

    return expression.substitute(value)


def _comparison(condition: Comparison, values: Values) -> Comparison:
    return Comparison(expression_with(condition.expression, values), condition.relation)


def condition_with(condition: Condition, values: Values) -> Condition:
    """A condition with these variables replaced by their values."""
    match condition:
        case Truth() | Holds():
            return condition
        case Comparison():
            return _comparison(condition, values)
        case And(operands):
            return And(tuple(condition_with(one, values) for one in operands))
        case Or(operands):
            return Or(tuple(condition_with(one, values) for one in operands))
    assert_never(condition)
