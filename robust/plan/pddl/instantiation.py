"""Lifted conditions and expressions to ground ones: negation normal form, polynomials."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from itertools import product
from operator import add, mul
from typing import assert_never

from robust.errors import InputError, UnsupportedError
from robust.plan.model import (
    And,
    Atom,
    Comparison,
    Condition,
    Duration,
    Expression,
    Fluent,
    Holds,
    NumericVariable,
    Or,
    ParameterReference,
    Relation,
    Truth,
)
from robust.plan.pddl.check import fits
from robust.plan.pddl.syntax import (
    Arithmetic,
    Comparator,
    Conjunction,
    Disjunction,
    Domain,
    DurationTerm,
    Equality,
    FunctionTerm,
    Implication,
    LiftedCondition,
    Negation,
    Number,
    NumericComparison,
    NumericExpression,
    Operator,
    ParameterTerm,
    Problem,
    Proposition,
    Quantification,
    Term,
    TypedName,
)
from robust.plan.pddl.text import expression_text
from robust.plan.polynomial import Polynomial

_NEGATED = {
    Relation.AT_LEAST: Relation.GREATER,
    Relation.GREATER: Relation.AT_LEAST,
    Relation.EQUAL: Relation.DIFFERENT,
    Relation.DIFFERENT: Relation.EQUAL,
}


@dataclass(frozen=True, slots=True)
class Context:
    """What variables stand for; `identifier` names the action instance whose parameters are meant.

    `parametrized` are the fluents that are made parameters, so that their initial value is not known.
    """

    domain: Domain
    problem: Problem
    identifier: str
    bindings: Mapping[str, str]
    parametrized: Collection[Fluent] = frozenset()

    def instances(self, variables: tuple[TypedName, ...]) -> Iterator[Context]:
        """One context for every choice of objects for quantified variables."""
        hierarchy, objects = self.domain.types, self.problem.objects.values()
        choices = [
            [candidate.name for candidate in objects if fits(candidate.types, variable.types, hierarchy)]
            for variable in variables
        ]
        names = [variable.name for variable in variables]
        for chosen in product(*choices):
            yield replace(self, bindings={**self.bindings, **dict(zip(names, chosen, strict=True))})


def atom(proposition: Proposition, context: Context) -> Atom:
    return Atom(proposition.predicate, _objects(proposition.arguments, context))


def fluent(term: FunctionTerm, context: Context) -> Fluent:
    return Fluent(term.function, _objects(term.arguments, context))


def _objects(terms: Iterable[Term], context: Context) -> tuple[str, ...]:
    return tuple([_object(term, context) for term in terms])


def _object(term: Term, context: Context) -> str:
    return context.bindings[term.name] if term.variable else term.name


def condition(  # noqa: PLR0911 (one return for each kind of condition)
    lifted: LiftedCondition, context: Context, *, positive: bool = True
) -> Condition:
    """The ground condition, or its negation, in negation normal form."""
    match lifted:
        case Proposition():
            return Holds(atom(lifted, context), positive)
        case Equality(left, right):
            return Truth((_object(left, context) == _object(right, context)) == positive)
        case NumericComparison(comparator, left, right):
            return _comparison(comparator, expression(left, context) - expression(right, context), positive)
        case Negation(operand):
            return condition(operand, context, positive=not positive)
        case Conjunction(operands):
            return junction([condition(operand, context, positive=positive) for operand in operands], every=positive)
        case Disjunction(operands):
            return junction(
                [condition(operand, context, positive=positive) for operand in operands], every=not positive
            )
        case Implication(premise, conclusion):
            parts = [
                condition(premise, context, positive=not positive),
                condition(conclusion, context, positive=positive),
            ]
            return junction(parts, every=not positive)
        case Quantification(universal, variables, operand):
            parts = [condition(operand, inner, positive=positive) for inner in context.instances(variables)]
            return junction(parts, every=universal == positive)
        case _:
            assert_never(lifted)


def junction(operands: Iterable[Condition], *, every: bool) -> Condition:
    """Conjunction (`every`) or disjunction, flattened and simplified."""
    kind = And if every else Or
    kept: dict[Condition, None] = {}
    for operand in operands:
        if isinstance(operand, Truth):
            if operand.value != every:
                return operand
        elif isinstance(operand, kind):
            kept.update(dict.fromkeys(operand.operands))
        else:
            kept[operand] = None
    if not kept:
        return Truth(every)
    return kind(tuple(kept)) if len(kept) > 1 else next(iter(kept))


def _comparison(comparator: Comparator, difference: Expression, positive: bool) -> Condition:
    compared = comparison(comparator, difference)
    if not positive:
        compared = _negation(compared)
    if not compared.expression.is_constant:
        return compared
    value = compared.expression.constant_term
    match compared.relation:
        case Relation.AT_LEAST:
            return Truth(value >= 0)
        case Relation.GREATER:
            return Truth(value > 0)
        case Relation.EQUAL:
            return Truth(value == 0)
        case Relation.DIFFERENT:
            return Truth(value != 0)


def comparison(comparator: Comparator, difference: Expression) -> Comparison:
    """`difference comparator 0`."""
    match comparator:
        case Comparator.AT_LEAST:
            return Comparison(difference, Relation.AT_LEAST)
        case Comparator.GREATER:
            return Comparison(difference, Relation.GREATER)
        case Comparator.AT_MOST:
            return Comparison(-difference, Relation.AT_LEAST)
        case Comparator.LESS:
            return Comparison(-difference, Relation.GREATER)
        case Comparator.EQUAL:
            return Comparison(difference, Relation.EQUAL)


def _negation(compared: Comparison) -> Comparison:
    equality = compared.relation in (Relation.EQUAL, Relation.DIFFERENT)
    return Comparison(compared.expression if equality else -compared.expression, _NEGATED[compared.relation])


def expression(lifted: NumericExpression, context: Context) -> Expression:
    """The ground expression."""
    match lifted:
        case Number(value):
            return Polynomial.constant(value)
        case FunctionTerm():
            return _variable(fluent(lifted, context))
        case DurationTerm():
            return _variable(Duration())
        case ParameterTerm(name, local):
            return _variable(ParameterReference(f"{context.identifier}.{name}" if local else name))
        case Arithmetic(operator, operands):
            return _arithmetic(operator, [expression(operand, context) for operand in operands], lifted, context)
        case _:
            assert_never(lifted)


def _variable(variable: NumericVariable) -> Expression:
    return Polynomial.variable(variable)


def _arithmetic(operator: Operator, values: list[Expression], lifted: Arithmetic, context: Context) -> Expression:
    match operator:
        case Operator.PLUS:
            return reduce(add, values)
        case Operator.TIMES:
            return reduce(mul, values)
        case Operator.MINUS:
            return -values[0] if len(values) == 1 else values[0] - values[1]
        case Operator.DIVIDED:
            return quotient(values[0], values[1], lifted.operands[1], context)


def quotient(dividend: Expression, divisor: Expression, lifted: NumericExpression, context: Context) -> Expression:
    """A division by an expression that is constant, at least once fluents that never change have their value."""
    value = divisor.substitute(lambda variable: _never_changing(variable, lifted, context))
    if value.is_constant:
        if not value.constant_term:
            text = expression_text(lifted, context.bindings)
            raise InputError(f"found a division by {text}, which is zero, expected another divisor", lifted.location)
        return dividend.scaled(1 / value.constant_term)
    varying = ", ".join(sorted(str(variable) for variable in value.variables))
    message = f"found a division by {expression_text(lifted, context.bindings)}, which is non-linear because {varying}"
    remedy = "may vary, expected a divisor that no action, timed literal or parameter changes"
    raise UnsupportedError(f"{message} {remedy}", lifted.location)


def _never_changing(variable: NumericVariable, lifted: NumericExpression, context: Context) -> Expression:
    """The initial value of a fluent that nothing changes; anything else as it is."""
    if not isinstance(variable, Fluent) or variable.function in context.domain.written:
        return _variable(variable)
    if variable in context.parametrized or any(timed.target == variable for timed in context.problem.timed_literals):
        return _variable(variable)
    if variable not in context.problem.fluents:
        message = f"found a division by {variable}, expected (= {variable} VALUE) in the problem's :init"
        raise InputError(message, lifted.location)
    return Polynomial.constant(context.problem.fluents[variable])
