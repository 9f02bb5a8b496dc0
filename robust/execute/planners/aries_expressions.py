"""Conditions and expressions as unified-planning objects, in the part of PDDL that Aries solves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from functools import reduce
from itertools import product
from typing import assert_never

import unified_planning.model as up
from unified_planning.environment import Environment

from robust.errors import Location, UnsupportedError
from robust.plan.numerals import format_number
from robust.plan.pddl.check import fits
from robust.plan.pddl.effects import primitive
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
    NumericUpdate,
    Operator,
    ParameterTerm,
    Problem,
    Proposition,
    Quantification,
    Signature,
    Term,
    TypedName,
)

Bindings = Mapping[str, up.FNode]
"""Variables with what stands for them: a parameter of an action, or an object."""


def unsupported(what: str, location: Location | None) -> UnsupportedError:
    return UnsupportedError(f"found {what}, which Aries does not solve; expected another planner, as kairos", location)


def integer(value: Fraction, what: str, location: Location | None) -> int:
    """The number as an integer; UnsupportedError if it is none."""
    if value.denominator != 1:
        raise unsupported(f"{what} {format_number(value)}, not an integer", location)
    return value.numerator


class Vocabulary:
    """Types, objects and fluents of a problem; `ticked` are functions of time, counted in ticks."""

    def __init__(self, domain: Domain, problem: Problem, ticks: int) -> None:
        self._problem = problem
        self._hierarchy = domain.types
        self.ticks = ticks
        self.environment = Environment()
        self.environment.credits_stream = None
        self._manager = self.environment.expression_manager
        self.bool = self.environment.type_manager.BoolType()
        number = self.environment.type_manager.IntType()
        self._types = self._all_types(domain)
        self.objects = {
            one.name: up.Object(f"o_{one.name}", self.type(one), self.environment) for one in problem.objects.values()
        }
        self.predicates = {one.name: self._fluent("p", one, self.bool) for one in domain.predicates.values()}
        self.functions = {
            name: self._fluent("f", domain.functions[name], number) for name in _functions_elsewhere(domain, problem)
        }
        self.ticked = {
            name: self._fluent("d", domain.functions[name], number) for name in _functions_in_durations(domain)
        }

    def _all_types(self, domain: Domain) -> dict[str, up.types.Type]:
        """Types from the root down; each has one parent."""
        types: dict[str, up.types.Type] = {}
        manager = self.environment.type_manager
        for name, ancestors in sorted(domain.types.items(), key=lambda item: len(item[1])):
            above = [one for one in ancestors if one != name]
            parent = max(above, key=lambda one: len(domain.types[one]), default=None)
            if parent is not None and domain.types[parent] != frozenset(above):
                raise unsupported(f"type {name!r} with more than one parent", domain.location)
            types[name] = manager.UserType(f"t_{name}", None if parent is None else types[parent])
        return types

    def type(self, declared: TypedName) -> up.types.Type:
        if len(declared.types) > 1:
            raise unsupported(f"{declared.name!r} of more than one type", declared.location)
        return self._types[declared.types[0]]

    def _fluent(self, kind: str, signature: Signature, value: up.types.Type) -> up.Fluent:
        parameters = [up.Parameter(f"x_{one.name}", self.type(one), self.environment) for one in signature.parameters]
        return up.Fluent(f"{kind}_{signature.name}", value, parameters, self.environment)

    def ground(self, fluent: up.Fluent, arguments: Iterable[str]) -> up.FNode:
        return fluent(*(self.objects[name] for name in arguments))

    def condition(self, condition: LiftedCondition, bindings: Bindings) -> up.FNode:  # noqa: PLR0911 - one for each kind
        manager = self._manager
        match condition:
            case Proposition(predicate, arguments):
                return self.predicates[predicate](*(self._term(one, bindings) for one in arguments))
            case Equality(left, right):
                return manager.Equals(self._term(left, bindings), self._term(right, bindings))
            case NumericComparison(comparator, left, right):
                return self._comparison(comparator, self.number(left, bindings), self.number(right, bindings))
            case Negation(operand):
                return manager.Not(self.condition(operand, bindings))
            case Conjunction(operands):
                return manager.And([self.condition(one, bindings) for one in operands])
            case Disjunction(operands):
                return manager.Or([self.condition(one, bindings) for one in operands])
            case Implication(premise, conclusion):
                return manager.Or(manager.Not(self.condition(premise, bindings)), self.condition(conclusion, bindings))
            case Quantification(universal, variables, operand):
                parts = [self.condition(operand, bound) for bound in self.expansions(variables, bindings)]
                return manager.And(parts) if universal else manager.Or(parts)
            case _:
                assert_never(condition)

    def _comparison(self, comparator: Comparator, left: up.FNode, right: up.FNode) -> up.FNode:
        manager = self._manager
        match comparator:
            case Comparator.LESS:
                return manager.LT(left, right)
            case Comparator.AT_MOST:
                return manager.LE(left, right)
            case Comparator.EQUAL:
                return manager.Equals(left, right)
            case Comparator.AT_LEAST:
                return manager.GE(left, right)
            case Comparator.GREATER:
                return manager.GT(left, right)
            case _:
                assert_never(comparator)

    def expansions(self, variables: Iterable[TypedName], bindings: Bindings) -> Iterator[Bindings]:
        """The bindings with every choice of objects for the variables of a quantifier."""
        names = tuple(variables)
        choices = [
            [
                self._manager.ObjectExp(self.objects[one.name])
                for one in self._problem.objects.values()
                if fits(one.types, variable.types, self._hierarchy)
            ]
            for variable in names
        ]
        for chosen in product(*choices):
            yield {**bindings, **{one.name: value for one, value in zip(names, chosen, strict=True)}}

    def number(self, expression: NumericExpression, bindings: Bindings) -> up.FNode:
        """An expression of a condition or effect."""
        return self._expression(expression, bindings, self.functions, 1)

    def duration(self, expression: NumericExpression, bindings: Bindings) -> up.FNode:
        """An expression of time, in ticks: a number, a function, or a sum or difference of them."""
        for one in _nodes(expression):
            if isinstance(one, Arithmetic) and one.operator in (Operator.TIMES, Operator.DIVIDED):
                raise unsupported("a product or quotient in a duration", one.location)
        return self._expression(expression, bindings, self.ticked, self.ticks)

    def _term(self, term: Term, bindings: Bindings) -> up.FNode:
        return bindings[term.name] if term.variable else self._manager.ObjectExp(self.objects[term.name])

    def _expression(
        self, expression: NumericExpression, bindings: Bindings, functions: Mapping[str, up.Fluent], factor: int
    ) -> up.FNode:
        match expression:
            case Number(value, _, location):
                return self._manager.Int(integer(value * factor, "the number", location))
            case FunctionTerm(function, arguments):
                return functions[function](*(self._term(one, bindings) for one in arguments))
            case DurationTerm(location):
                raise unsupported("?duration in an expression", location)
            case ParameterTerm(name, _, location):
                raise unsupported(f"synthesis parameter {name!r}", location)
            case Arithmetic(operator, operands):
                values = [self._expression(one, bindings, functions, factor) for one in operands]
                return self._arithmetic(operator, values)
            case _:
                assert_never(expression)

    def _arithmetic(self, operator: Operator, values: list[up.FNode]) -> up.FNode:
        manager = self._manager
        match operator:
            case Operator.PLUS:
                return manager.Plus(values)
            case Operator.TIMES:
                return manager.Times(values)
            case Operator.DIVIDED:
                return manager.Div(*values)
            case Operator.MINUS:
                return reduce(manager.Minus, values if len(values) > 1 else [manager.Int(0), *values])
            case _:
                assert_never(operator)


def _functions_in_durations(domain: Domain) -> list[str]:
    """The functions that durations depend on; UnsupportedError for one that an action changes."""
    names = set()
    for schema in domain.actions.values():
        for bound in schema.durations:
            for term in _functions(bound.bound):
                if term.function in domain.written:
                    raise unsupported(f"a duration that depends on ({term.function} …), which changes", bound.location)
                names.add(term.function)
    return sorted(names)


def _functions_elsewhere(domain: Domain, problem: Problem) -> list[str]:
    """The functions that conditions, effects and the goal depend on."""
    conditions = [problem.goal, *(one.condition for schema in domain.actions.values() for one in schema.conditions)]
    names = {term.function for condition in conditions for term in _functions_of_condition(condition)}
    for schema in domain.actions.values():
        for effect in primitive(schema.effects):
            if isinstance(effect, NumericUpdate):
                names |= {effect.target.function, *(term.function for term in _functions(effect.expression))}
    return sorted(names)


def _functions_of_condition(condition: LiftedCondition) -> Iterator[FunctionTerm]:
    todo = [condition]
    while todo:
        match todo.pop():
            case NumericComparison(_, left, right):
                yield from _functions(left)
                yield from _functions(right)
            case Negation(operand) | Quantification(_, _, operand):
                todo.append(operand)
            case Conjunction(operands) | Disjunction(operands):
                todo.extend(operands)
            case Implication(premise, conclusion):
                todo += [premise, conclusion]
            case Proposition() | Equality():
                pass


def _functions(expression: NumericExpression) -> Iterator[FunctionTerm]:
    return (one for one in _nodes(expression) if isinstance(one, FunctionTerm))


def _nodes(expression: NumericExpression) -> Iterator[NumericExpression]:
    todo = [expression]
    while todo:
        node = todo.pop()
        yield node
        if isinstance(node, Arithmetic):
            todo.extend(node.operands)
