"""Variants of a plan: with values for what is unknown, and within narrower bounds for some of its parameters."""

from collections.abc import Mapping
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any, TypeVar

from robust.plan import model
from robust.plan.polynomial import Polynomial

Values = Mapping[model.NumericVariable, Fraction]

_Part = TypeVar("_Part")
_READING = {"durations", "conditions", "atom_effects", "numeric_effects", "continuous_effects"} | {
    "condition", "operands", "expression", "rate",
}  # fmt: skip
"""Fields of instances, their parts and conditions that read variables, or hold what does."""


def with_values(part: _Part, values: Values) -> _Part:
    """An instance, or a part of one, with these variables replaced by their values, in conditions and effects."""

    def value(variable: model.NumericVariable) -> model.Expression:
        known = values.get(variable)
        return Polynomial.variable(variable) if known is None else Polynomial.constant(known)

    whole: Any = part
    if isinstance(whole, Polynomial):
        whole = whole if values.keys().isdisjoint(whole.variables) else whole.substitute(value)
    elif isinstance(whole, tuple):
        whole = tuple(with_values(member, values) for member in whole)
    else:
        names = [field.name for field in fields(whole) if field.name in _READING]
        whole = replace(whole, **{name: with_values(getattr(whole, name), values) for name in names})
    replaced: _Part = whole
    return replaced


def at_values(plan: model.ParametrizedPlan, values: Mapping[str, Fraction]) -> model.ParametrizedPlan:
    """The plan at values of some of its parameters, which are none any more."""
    known: Values = {model.ParameterReference(name): value for name, value in values.items()}

    def bound(weight: model.Bound | None) -> model.Bound | None:
        return None if weight is None else with_values(weight, known)

    constraints = (replace(item, lower=bound(item.lower), upper=bound(item.upper)) for item in plan.constraints)
    return replace(
        plan,
        parameters=tuple(parameter for parameter in plan.parameters if parameter.name not in values),
        instances=with_values(plan.instances, known),
        constraints=tuple(constraints),
        initial_fluents={fluent: with_values(value, known) for fluent, value in plan.initial_fluents.items()},
        goal=with_values(plan.goal, known),
    )


def within(
    plan: model.ParametrizedPlan, ranges: Mapping[str, tuple[Fraction | None, Fraction | None]]
) -> model.ParametrizedPlan:
    """The plan with these bounds of parameters in place of the declared ones; None is no bound."""
    bounded = (replace(known, lower=low, upper=high) for known in plan.parameters for low, high in [ranges[known.name]])
    return replace(plan, parameters=tuple(bounded))
