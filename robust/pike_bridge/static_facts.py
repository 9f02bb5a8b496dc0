"""What never changes in a plan, and conditions, numbers and durations with that decided."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import assert_never

from robust.errors import InputError, UnsupportedError
from robust.plan.model import (
    ActionInstance,
    And,
    Comparison,
    Duration,
    DurationConstraint,
    Expression,
    Fluent,
    Holds,
    NumericVariable,
    Or,
    Relation,
    Truth,
)
from robust.plan.model import (
    Condition as StateCondition,
)
from robust.plan.pddl.instantiation import junction
from robust.plan.pddl.syntax import ActionSchema, Domain, Problem
from robust.plan.polynomial import Polynomial


@dataclass(frozen=True, slots=True)
class Durations:
    """How long an action may take; None is no upper bound."""

    lower: Fraction
    upper: Fraction | None


class StaticFacts:
    """The atoms that no effect of the plan touches, and the fluents that no action of the domain changes."""

    def __init__(self, domain: Domain, problem: Problem, instances: Iterable[ActionInstance]) -> None:
        self._initial = problem.atoms
        self._touched = {effect.atom for instance in instances for effect in instance.atom_effects}
        self._values: Mapping[Fluent, Fraction] = {
            fluent: value for fluent, value in problem.fluents.items() if fluent.function not in domain.written
        }
        self._written = domain.written

    def simplify(self, condition: StateCondition) -> StateCondition:
        """The condition with what never changes decided."""
        match condition:
            case Truth():
                return condition
            case Holds(atom, value):
                return condition if atom in self._touched else Truth((atom in self._initial) == value)
            case Comparison(expression, relation):
                known = self._known(expression)
                return _truth(known.constant_term, relation) if known.is_constant else condition
            case And(operands):
                return junction([self.simplify(operand) for operand in operands], every=True)
            case Or(operands):
                return junction([self.simplify(operand) for operand in operands], every=False)
            case _:
                assert_never(condition)

    def durations(self, instance: ActionInstance, schema: ActionSchema) -> Durations:
        """The durations that the action allows.

        Raises:
            InputError: if a number that decides about the duration has no value.
            UnsupportedError: if the duration depends on what changes or is a parameter, or has a strict bound.
        """
        lower: Fraction = Fraction(0)
        upper: Fraction | None = None
        for constraint in instance.durations:
            slope, limit = self._limit(constraint, instance, schema)
            both = constraint.condition.relation is Relation.EQUAL
            if slope > 0 or both:
                lower = max(lower, limit)
            if slope < 0 or both:
                upper = limit if upper is None else min(upper, limit)
        return Durations(lower, upper)

    def _limit(
        self, constraint: DurationConstraint, instance: ActionInstance, schema: ActionSchema
    ) -> tuple[Fraction, Fraction]:
        """A bound on the duration, and the factor whose sign says on which side it is."""
        expression = self._known(constraint.condition.expression)
        for variable in sorted(expression.variables, key=str):
            if isinstance(variable, Fluent) and variable.function not in self._written:
                reason = f"duration {constraint.text} of {instance} reads it"
                remedy = f"add (= {variable} VALUE) to the problem's :init"
                message = f"found no initial value of {variable}, expected one because {reason}: {remedy}"
                raise InputError(message, schema.location)
        slope = dict(expression.coefficients()).get(Duration(), Fraction(0))
        strict = constraint.condition.relation not in {Relation.AT_LEAST, Relation.EQUAL}
        if expression.variables != {Duration()} or not expression.is_linear or slope == 0 or strict:
            message = f"found duration {constraint.text} of {instance}, expected <=, >= or = and a constant"
            raise UnsupportedError(f"{message} in plans with choices", schema.location)
        return slope, -expression.constant_term / slope

    def _known(self, expression: Expression) -> Expression:
        """With the values of fluents that never change."""

        def value(variable: NumericVariable) -> Expression:
            if isinstance(variable, Fluent) and variable in self._values:
                return Polynomial.constant(self._values[variable])
            return Polynomial.variable(variable)

        return expression.substitute(value)


def _truth(value: Fraction, relation: Relation) -> Truth:
    match relation:
        case Relation.AT_LEAST:
            return Truth(value >= 0)
        case Relation.GREATER:
            return Truth(value > 0)
        case Relation.EQUAL:
            return Truth(value == 0)
        case Relation.DIFFERENT:
            return Truth(value != 0)
        case _:
            assert_never(relation)
