"""Lifted conditions and expressions as PDDL text, with variables replaced by the objects they are bound to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import assert_never

from robust.plan.pddl.declarations import type_text
from robust.plan.pddl.syntax import (
    OBJECT,
    Arithmetic,
    Conjunction,
    Disjunction,
    DurationBound,
    DurationTerm,
    Equality,
    FunctionTerm,
    Implication,
    LiftedCondition,
    Negation,
    Number,
    NumericComparison,
    NumericExpression,
    ParameterTerm,
    Proposition,
    Quantification,
    Term,
    TypedName,
)

Bindings = Mapping[str, str]


def condition_text(  # noqa: PLR0911 (one return for each kind of condition)
    condition: LiftedCondition, bindings: Bindings
) -> str:
    """The condition in PDDL; variables that `bindings` does not have stay variables."""
    match condition:
        case Proposition(predicate, arguments):
            return _application(predicate, arguments, bindings)
        case Equality(left, right):
            return f"(= {_term(left, bindings)} {_term(right, bindings)})"
        case NumericComparison(comparator, left, right):
            return f"({comparator.value} {expression_text(left, bindings)} {expression_text(right, bindings)})"
        case Negation(operand):
            return f"(not {condition_text(operand, bindings)})"
        case Conjunction(operands):
            return _form("and", [condition_text(operand, bindings) for operand in operands])
        case Disjunction(operands):
            return _form("or", [condition_text(operand, bindings) for operand in operands])
        case Implication(premise, conclusion):
            return f"(imply {condition_text(premise, bindings)} {condition_text(conclusion, bindings)})"
        case Quantification(universal, variables, operand):
            hidden = {variable.name for variable in variables}
            inner = {name: value for name, value in bindings.items() if name not in hidden}
            quantifier = "forall" if universal else "exists"
            return f"({quantifier} ({_typed_list(variables)}) {condition_text(operand, inner)})"
        case _:
            assert_never(condition)


def expression_text(expression: NumericExpression, bindings: Bindings) -> str:
    """The expression in PDDL."""
    match expression:
        case Number(_, text):
            return text
        case FunctionTerm(function, arguments):
            return _application(function, arguments, bindings)
        case DurationTerm():
            return "?duration"
        case ParameterTerm(name):
            return f"?{name}"
        case Arithmetic(operator, operands):
            return _form(operator.value, [expression_text(operand, bindings) for operand in operands])
        case _:
            assert_never(expression)


def duration_text(bound: DurationBound, bindings: Bindings) -> str:
    """The duration constraint in PDDL, without its time specifier."""
    return f"({bound.comparator.value} ?duration {expression_text(bound.bound, bindings)})"


def _application(name: str, arguments: Iterable[Term], bindings: Bindings) -> str:
    return _form(name, [_term(argument, bindings) for argument in arguments])


def _form(head: str, operands: list[str]) -> str:
    return f"({' '.join([head, *operands])})"


def _term(term: Term, bindings: Bindings) -> str:
    return bindings.get(term.name, f"?{term.name}") if term.variable else term.name


def _typed_list(variables: Iterable[TypedName]) -> str:
    return " ".join(
        f"?{variable.name}" if variable.types == (OBJECT,) else f"?{variable.name} - {type_text(variable.types)}"
        for variable in variables
    )
