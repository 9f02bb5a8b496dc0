"""The unknowns of the encodings' formulas, linear expressions over them, and symbols that formulas define."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from robust.errors import InputError
from robust.plan.model import Expression, Fluent, NumericVariable, ParameterReference, ParametrizedPlan, TimePoint
from robust.plan.polynomial import Polynomial
from robust.smt.limits import NEVER, Deadline
from robust.smt.terms import Formula, Terms


@dataclass(frozen=True, slots=True)
class TimeVariable:
    """t_τ of a time point that no equality of the network ties to an earlier one."""

    point: TimePoint

    def __str__(self) -> str:
        return f"t({self.point})"


@dataclass(frozen=True, slots=True)
class Auxiliary:
    """A real number that a definition fixes as a function of the other unknowns, or a free instant."""

    name: str
    index: int

    def __str__(self) -> str:
        return f"[{self.name}]{self.index}"


Unknown = TimeVariable | ParameterReference | Auxiliary
Linear = Polynomial[Unknown]
"""A polynomial that is linear by the time it reaches a formula."""

Range = tuple[Fraction | None, Fraction | None]
"""Least and greatest value of a parameter; None is unbounded."""


def constant(value: Fraction | int) -> Linear:
    return Polynomial.constant(value)


def variable(unknown: Unknown) -> Linear:
    return Polynomial.variable(unknown)


def over_parameters(expression: Expression) -> Linear:
    """A bound of the network, or an initial value, as an expression over the encodings' unknowns."""
    return expression.substitute(_parameter)


def _parameter(name: NumericVariable) -> Linear:
    if not isinstance(name, ParameterReference):
        raise TypeError(f"an initial value or a bound of the network can only mention parameters, not {name}")
    return variable(name)


def initial_value(plan: ParametrizedPlan, fluent: Fluent) -> Linear:
    """The value of a fluent at time zero.

    Raises:
        InputError: if it has none.
    """
    if fluent not in plan.initial_fluents:
        raise InputError(f"{fluent} has no initial value; expected (= {fluent} NUMBER) in the problem's :init")
    return over_parameters(plan.initial_fluents[fluent])


def is_over_parameters(expression: Linear) -> bool:
    """Whether nothing but parameters occurs."""
    return all(isinstance(unknown, ParameterReference) for unknown in expression.variables)


def least(expression: Linear, ranges: Mapping[str, Range]) -> Fraction | None:
    """The infimum of a linear expression over a box of its parameters; None if it is −∞.

    Parameters without a range are unbounded; other unknowns make the infimum −∞.
    """
    total = expression.constant_term
    for unknown, factor in expression.coefficients():
        low, high = ranges.get(unknown.name, (None, None)) if isinstance(unknown, ParameterReference) else (None, None)
        extreme = low if factor > 0 else high
        if extreme is None:
            return None
        total += factor * extreme
    return total


class Grid:
    """A box in integers: its ends in multiples of one over `unit`, which is enough for all of them."""

    __slots__ = ("ends", "ranges", "unit")

    def __init__(self, ranges: Mapping[str, Range]) -> None:
        self.ranges = ranges
        finite = {end.denominator for ends in ranges.values() for end in ends if end is not None}
        self.unit = unit = lcm(*finite)
        self.ends = {name: (_multiple(low, unit), _multiple(high, unit)) for name, (low, high) in ranges.items()}


def _multiple(end: Fraction | None, unit: int) -> int | None:
    return None if end is None else end.numerator * (unit // end.denominator)


class IntegerForm:
    """A linear expression over parameters in integers: what it is, times `scale`.

    Without a scale, the least one that will do.
    """

    __slots__ = ("constant", "factors", "scale")

    def __init__(self, expression: Linear, scale: int | None = None) -> None:
        self.scale = scale = scale or lcm(*(factor.denominator for factor in expression.terms.values()))
        self.constant = 0
        self.factors: list[tuple[str, int]] = []
        for monomial, factor in expression.terms.items():
            multiple = factor.numerator * (scale // factor.denominator)
            if monomial:
                self.factors.append((str(monomial[0]), multiple))
            else:
                self.constant = multiple

    def least(self, grid: Grid) -> int | None:
        """The infimum over a box, times `scale` and the unit of the grid; None if it is −∞."""
        total, ends = self.constant * grid.unit, grid.ends
        for name, factor in self.factors:
            extreme = ends[name][factor < 0] if name in ends else None
            if extreme is None:
                return None
            total += factor * extreme
        return total


Case = tuple[Formula, Linear]
"""A value, and when it applies."""


class Definitions:
    """Symbols with the formulas that fix them; whoever asserts a symbol asserts :meth:`needed_by` as well."""

    def __init__(self, terms: Terms) -> None:
        self.terms = terms
        self._definition: dict[Formula, Formula] = {}
        self._count = 0

    def truth(self, name: str, formula: Formula) -> Formula:
        """A Boolean symbol for the formula, unless it is a literal or constant already."""
        atom = self.terms.negation(formula) if formula.is_not() else formula
        if atom.is_symbol() or atom.is_bool_constant():
            return formula
        symbol = self.terms.fresh_boolean(f"[{name}] ")
        self.define(symbol, self.terms.equivalence(symbol, formula))
        return symbol

    def auxiliary(self, name: str) -> Auxiliary:
        """A new symbol of that name and a number; whoever asks for it defines it."""
        self._count += 1
        return Auxiliary(name, self._count)

    def define(self, symbol: Formula, formula: Formula) -> None:
        self._definition[symbol] = formula

    def choice(self, name: str, cases: Iterable[Case], otherwise: Linear | None = None) -> Linear:
        """The value of the case that applies: exactly one does, or none and it is `otherwise`.

        A new symbol unless the value is known.
        """
        open_cases = [(condition, value) for condition, value in cases if condition is not self.terms.false]
        for condition, value in open_cases:
            if condition is self.terms.true:
                return value
        if otherwise is not None:
            none = self.terms.negation(self.terms.disjunction(condition for condition, _ in open_cases))
            open_cases.append((none, otherwise))
        values = {value for _, value in open_cases}
        return values.pop() if len(values) == 1 else self.partial(name, open_cases)

    def partial(self, name: str, cases: Iterable[Case]) -> Linear:
        """A new symbol that has the value of each case that applies."""
        symbol = self.auxiliary(name)
        equations = (self.terms.implication(c, self.terms.equal(variable(symbol) - value)) for c, value in cases)
        self.define(self.terms.real(symbol), self.terms.conjunction(equations))
        return variable(symbol)

    def needed_by(self, formulas: Iterable[Formula], deadline: Deadline = NEVER) -> Iterator[Formula]:
        """The definitions of all symbols in the formulas, and of those in the definitions, each once.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        queue, seen = list(formulas), set[Formula]()
        while queue:
            deadline.enforce()
            for symbol in self.terms.variables(queue.pop()):
                if symbol in self._definition and symbol not in seen:
                    seen.add(symbol)
                    queue.append(self._definition[symbol])
                    yield self._definition[symbol]
