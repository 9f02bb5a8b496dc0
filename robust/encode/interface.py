"""The interface of an encoding: named obligations with queries, and a decision of enc_valid [IRR §2, §4].

Two encodings implement it: `relational` and `positions` [docs/semantics.md]. They share what is about times alone
(:mod:`robust.encode.network`), the list of effects, and the unknowns of formulas, linear expressions over them and
symbols that formulas define, which are here. States, mutex pairs, over-all conditions and the decision of enc_valid
have no code in common, so that each encoding is a check of the other.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from math import lcm
from typing import ClassVar, Protocol

from robust.errors import InputError
from robust.plan.model import Expression, Fluent, NumericVariable, ParameterReference, ParametrizedPlan, TimePoint
from robust.plan.polynomial import Polynomial
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Formula, Satisfiability, Session, Terms

EPSILON = Fraction(1, 1000)


class Stage(Enum):
    """The order in which obligations are examined; a stage assumes the earlier ones."""

    DURATION = 0
    SEPARATION = 1
    AGREEMENT = 2
    CONDITION = 3


@dataclass(frozen=True)
class Obligation:
    """One conjunct of enc_proofs, named after its source; `violation` is its negation over the encoding's unknowns.

    None: no schedule breaks it, whatever the parameters are.
    """

    name: str
    stage: Stage
    violation: Formula | None


@dataclass(frozen=True)
class Facet:
    """`expression ≥ 0` over parameters, necessary for membership in the envelope.

    `origins` are the statements that it is the sum of; `obligation` is set if it is not about existence of a schedule
    but is that obligation itself.
    """

    expression: Linear
    origins: tuple[str, ...]
    obligation: str | None = None

    @cached_property
    def form(self) -> IntegerForm:
        """The expression in integers."""
        return IntegerForm(self.expression)

    def breaks_in(self, box: Grid) -> bool:
        """Whether some point of a box lies outside the facet."""
        floor = self.form.least(box)
        return floor is None or floor < 0


class ScheduleExistence(Protocol):
    """enc_valid: for which parameter values some schedule exists."""

    def broken_facet(
        self, box: Grid, make_session: Callable[[], Session], deadline: Deadline
    ) -> Facet | Satisfiability | None:
        """A facet that some point of the box breaks; None if every point has a schedule; UNKNOWN out of time."""

    def known_facet(self, box: Grid) -> Facet | None:
        """A facet of the network alone that some point of the box breaks, of those that a search has met."""

    def contradiction(self, values: Mapping[str, Fraction]) -> Facet | None:
        """Statements of the network that cannot hold together at one point; None if it has a schedule there."""


class Encoding(ABC):
    """enc_tn, enc_eff and enc_proofs of one plan, in formulas over `terms`.

    `obligations` are ordered by stage; `places` is every time point's time over the unknowns. Parameters are the
    symbols of their references; formulas of one encoding belong to its own `terms`. Encodings may build formulas only
    when a query needs them: those raise OutOfTimeError then if the encoding's deadline passes.
    """

    name: ClassVar[str]
    """Which of `robust.backends.ENCODINGS` it is."""
    plan: ParametrizedPlan
    epsilon: Fraction
    terms: Terms
    validity: ScheduleExistence
    obligations: tuple[Obligation, ...]
    places: Mapping[TimePoint, Linear]

    def obligation(self, name: str, stage: Stage, violation: Formula) -> Obligation:
        """The obligation that a formula is the violation of."""
        return Obligation(name, stage, None if violation is self.terms.false else violation)

    def violation(self, obligation: Obligation) -> Formula:
        """What breaks an obligation."""
        return self.terms.false if obligation.violation is None else obligation.violation

    @abstractmethod
    def query(self, obligation: Obligation) -> list[Formula]:
        """Satisfiable, for parameter values within enc_valid, if some schedule breaks the obligation."""

    @abstractmethod
    def full_query(self, obligation: Obligation) -> list[Formula]:
        """The formulas of :meth:`query` over the whole network: a model gives a time to every time point."""

    @abstractmethod
    def network_formulas(self) -> list[Formula]:
        """enc_tn over parameters and free time points."""

    def parameters_in(self, formulas: Iterable[Formula]) -> frozenset[str]:
        """Names of the parameters that occur in formulas."""
        symbols = {symbol for formula in formulas for symbol in self.terms.variables(formula)}
        return frozenset(name for name in self.plan.nominal if self.terms.real(ParameterReference(name)) in symbols)

    def unknowns(self) -> list[Formula]:
        """The symbols whose values determine parameters and schedule: of the parameters and the free time points."""
        used = (unknown for place in self.places.values() for unknown in place.variables)
        times = dict.fromkeys(unknown for unknown in used if isinstance(unknown, TimeVariable))
        return [self.terms.real(unknown) for unknown in (*map(ParameterReference, self.plan.nominal), *times)]

    def schedule(self, values: Mapping[str, Fraction]) -> dict[TimePoint, Fraction]:
        """The time of every time point, from values of :meth:`unknowns` by symbol name."""
        return {
            point: place.evaluate({unknown: values[str(unknown)] for unknown in place.variables})
            for point, place in self.places.items()
        }


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
