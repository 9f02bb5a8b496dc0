"""Which durations an instance may have: what its duration constraints say, or what the time-triggered plan says."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from fractions import Fraction
from typing import assert_never

from robust.execute.distances import Edge
from robust.execute.original import Original
from robust.plan.model import (
    ActionInstance,
    Duration,
    DurationConstraint,
    Fluent,
    NumericVariable,
    ParameterReference,
    Relation,
)


def duration_edges(original: Original, instance: ActionInstance, pinned: Collection[str]) -> tuple[Edge, ...]:
    """Bounds on t_end − t_start; at least 0, or ε where start and end are mutex.

    A duration constraint `(= ?duration e)`, and any duration of an instance in `pinned`, is the plan's own. Bounds of
    inequalities are read in the state of the original schedule. Strict ones are taken as if they were not, and what is
    not linear in `?duration` is passed over: these are for :mod:`robust.execute.tighten` to find out.
    """
    own = original.distance(instance.start, instance.end)
    equal = any(one.condition.relation is Relation.EQUAL for one in instance.durations)
    if equal or instance.identifier in pinned:
        return Edge(instance.start, instance.end, own), Edge(instance.end, instance.start, -own)
    lower = certain_duration(original, instance).weight
    upper: Fraction | None = None
    for is_lower, bound in _bounds(original, instance):
        if is_lower:
            lower = max(lower, bound)
        else:
            upper = bound if upper is None else min(upper, bound)
    edges = (Edge(instance.start, instance.end, lower),)
    return edges if upper is None else (*edges, Edge(instance.end, instance.start, -upper))


def settled_durations(original: Original, pinned: Collection[str]) -> frozenset[str]:
    """The instances whose bounds of durations are the same for all schedules and parameter values.

    Not those in `pinned`, nor those with a duration constraint that reads a parameter or a fluent that changes.
    """
    plan = original.plan
    written = {literal.target for literal in plan.timed_literals}
    for instance in plan.instances:
        written |= {effect.fluent for effect in instance.numeric_effects}
        written |= {effect.fluent for effect in instance.continuous_effects}

    def is_settled(variable: NumericVariable) -> bool:
        match variable:
            case Duration():
                return True
            case ParameterReference():
                return False
            case Fluent():
                return variable not in written and not plan.initial_fluents[variable].variables
            case _:
                assert_never(variable)

    return frozenset(
        one.identifier
        for one in plan.instances
        if one.identifier not in pinned
        and all(is_settled(variable) for part in one.durations for variable in part.condition.expression.variables)
    )


def certain_duration(original: Original, instance: ActionInstance) -> Edge:
    """The lower bound of t_end − t_start that holds for every duration: 0, or ε where start and end are mutex."""
    lower = original.epsilon if (instance.start, instance.end) in original.mutex else Fraction(0)
    return Edge(instance.start, instance.end, lower)


def _bounds(original: Original, instance: ActionInstance) -> Iterator[tuple[bool, Fraction]]:
    """Lower (True) and upper bounds."""
    for constraint in instance.durations:
        if constraint.condition.relation is Relation.DIFFERENT:
            continue
        value, slope = _in_duration(original, instance, constraint)
        if slope:
            yield slope > 0, -value / slope


def _in_duration(
    original: Original, instance: ActionInstance, constraint: DurationConstraint
) -> tuple[Fraction, Fraction]:
    """The constraint's expression as `value + slope · ?duration`; the slope is 0 if it is not of this form."""
    expression = constraint.condition.expression
    reading = original.execution.reading(original.before(instance.at(constraint.timing)), instance)
    value, slope = Fraction(0), Fraction(0)
    for monomial, factor in expression.terms.items():
        degree = sum(1 for variable in monomial if isinstance(variable, Duration))
        if degree > 1:
            return Fraction(0), Fraction(0)
        for variable in monomial:
            factor *= 1 if isinstance(variable, Duration) else reading.variable(variable)  # noqa: PLW2901 - a product
        value, slope = (value, slope + factor) if degree else (value + factor, slope)
    return value, slope
