"""Choices and theories over them as booleans of a solver."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import assert_never

from robust.pike_bridge import theory as logic
from robust.pike_bridge.model import Assignment, Guard
from robust.smt.session import Session, Value
from robust.smt.terms import Formula, Terms


class Propositions:
    """One boolean for each assignment of a choice, of which exactly one is true; a choice of two values has only one.

    Formulas are translated with KeyError for assignments that are not of these domains.
    """

    def __init__(self, terms: Terms, domains: Mapping[str, tuple[str, ...]]) -> None:
        self._terms = terms
        self._literals: dict[Assignment, Formula] = {}
        self._translated: dict[logic.Formula, Formula] = {}
        self.domains: tuple[Formula, ...] = tuple(
            formula for variable, values in domains.items() for formula in self._declare(variable, values)
        )
        """What makes each choice have exactly one value, to be asserted."""

    def _declare(self, variable: str, values: tuple[str, ...]) -> Iterator[Formula]:
        terms = self._terms
        if len(values) == 2:
            symbol = terms.fresh_boolean(f"{variable} ")
            literals = [symbol, terms.negation(symbol)]
        else:
            literals = [terms.fresh_boolean(f"{variable} = {value} ") for value in values]
            yield terms.disjunction(literals)
            for pair in combinations(literals, 2):
                yield terms.negation(terms.conjunction(pair))
        for value, literal in zip(values, literals, strict=True):
            self._literals[Assignment(variable, value)] = literal

    def guard(self, guard: Guard) -> Formula:
        """All assignments of a guard."""
        return self._terms.conjunction(self._literals[assignment] for assignment in sorted(guard))

    def chosen(self, session: Session) -> Guard:
        """The assignments that the model of the session's last query makes; a choice that it leaves open gets none."""
        symbols = frozenset[Formula]().union(*map(self._terms.variables, self._literals.values()))
        values = session.values(symbols)
        return frozenset(assignment for assignment, literal in self._literals.items() if _true(literal, values))

    def formula(self, formula: logic.Formula) -> Formula:
        """The translation of a formula, without recursion, as formulas may be deep."""
        pending = [formula]
        while pending:
            top = pending[-1]
            missing = [each for each in _operands(top) if each not in self._translated]
            if missing:
                pending += missing
            else:
                self._translated[pending.pop()] = self._translate(top)
        return self._translated[formula]

    def _translate(self, formula: logic.Formula) -> Formula:
        match formula:
            case logic.Is(assignment):
                return self._literals[assignment]
            case logic.Not(operand):
                return self._terms.negation(self._translated[operand])
            case logic.All(operands):
                return self._terms.conjunction(self._translated[each] for each in operands)
            case logic.Some(operands):
                return self._terms.disjunction(self._translated[each] for each in operands)
            case _:
                assert_never(formula)


def _operands(formula: logic.Formula) -> tuple[logic.Formula, ...]:
    match formula:
        case logic.Is():
            return ()
        case logic.Not(operand):
            return (operand,)
        case logic.All(operands) | logic.Some(operands):
            return operands
        case _:
            assert_never(formula)


def _true(literal: Formula, values: Mapping[str, Value]) -> bool:
    negated = literal.is_not()
    value = values.get((literal.arg(0) if negated else literal).symbol_name())
    return value is not None and bool(value) != negated
