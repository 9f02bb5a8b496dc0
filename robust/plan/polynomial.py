"""Exact multivariate polynomials over any hashable, printable variables.

Numeric expressions of a planning problem are polynomials until everything that is constant has been folded; only then
does the question arise whether they are linear (a rate times a duration is linear as soon as one of them is known).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from fractions import Fraction
from typing import Any, Generic, TypeVar

V_co = TypeVar("V_co", bound=Hashable, covariant=True)
W = TypeVar("W", bound=Hashable)
Monomial = tuple[V_co, ...]
"""The variables of a product in a canonical order, repeated for powers; the empty tuple is the constant monomial."""


_ZERO, _ONE = Fraction(0), Fraction(1)


class Polynomial(Generic[V_co]):
    """An immutable polynomial with rational coefficients; equal polynomials are equal and hash alike."""

    __slots__ = ("_hash", "_variables", "terms")

    def __init__(self, terms: Mapping[Monomial[V_co], Fraction]) -> None:
        self.terms: dict[Monomial[V_co], Fraction] = {m: c for m, c in terms.items() if c}
        self._hash: int | None = None
        self._variables: frozenset[V_co] | None = None

    @staticmethod
    def _of(terms: dict[Monomial[W], Fraction]) -> Polynomial[W]:
        """The polynomial of terms that nobody else has, none of which is zero."""
        made = Polynomial[W].__new__(Polynomial)
        made.terms, made._hash, made._variables = terms, None, None
        return made

    @staticmethod
    def constant(value: Fraction | int) -> Polynomial[Any]:
        return Polynomial({(): Fraction(value)})

    @staticmethod
    def variable(name: W) -> Polynomial[W]:
        return Polynomial._of({(name,): _ONE})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Polynomial) and self.terms == other.terms

    def __hash__(self) -> int:
        if self._hash is None:
            self._hash = hash(frozenset(self.terms.items()))
        return self._hash

    def __add__(self, other: Polynomial[V_co] | Fraction | int) -> Polynomial[V_co]:
        if not isinstance(other, Polynomial):
            other = Polynomial.constant(other)
        terms = dict(self.terms)
        for monomial, coefficient in other.terms.items():
            known = terms.get(monomial)
            terms[monomial] = total = coefficient if known is None else known + coefficient
            if not total:
                del terms[monomial]
        return Polynomial._of(terms)

    def __neg__(self) -> Polynomial[V_co]:
        return Polynomial._of({monomial: -coefficient for monomial, coefficient in self.terms.items()})

    def __sub__(self, other: Polynomial[V_co] | Fraction | int) -> Polynomial[V_co]:
        if not isinstance(other, Polynomial):
            other = Polynomial.constant(other)
        if not other.terms:
            return self
        terms = dict(self.terms)
        for monomial, coefficient in other.terms.items():
            known = terms.get(monomial)
            terms[monomial] = total = -coefficient if known is None else known - coefficient
            if not total:
                del terms[monomial]
        return Polynomial._of(terms)

    def __mul__(self, other: Polynomial[V_co]) -> Polynomial[V_co]:
        terms: dict[Monomial[V_co], Fraction] = {}
        for left, a in self.terms.items():
            for right, b in other.terms.items():
                monomial = tuple(sorted(left + right, key=_order)) if left and right else left + right
                _add(terms, monomial, a * b)
        return Polynomial(terms)

    def scaled(self, factor: Fraction | int) -> Polynomial[V_co]:
        return Polynomial({monomial: coefficient * factor for monomial, coefficient in self.terms.items()})

    @property
    def degree(self) -> int:
        return max((len(monomial) for monomial in self.terms), default=0)

    @property
    def is_constant(self) -> bool:
        return len(self.terms) == (() in self.terms)

    @property
    def is_linear(self) -> bool:
        return all(len(monomial) <= 1 for monomial in self.terms)

    @property
    def constant_term(self) -> Fraction:
        return self.terms.get((), _ZERO)

    @property
    def variables(self) -> frozenset[V_co]:
        if self._variables is None:
            self._variables = frozenset(variable for monomial in self.terms for variable in monomial)
        return self._variables

    def coefficients(self) -> Iterator[tuple[V_co, Fraction]]:
        """The linear part, variable by variable; only meaningful where `is_linear`."""
        for monomial, coefficient in self.terms.items():
            if monomial:
                yield monomial[0], coefficient

    def substitute(self, value: Callable[[V_co], Polynomial[W]]) -> Polynomial[W]:
        """Replace every variable by `value(variable)`."""
        if self.is_constant:
            return Polynomial._of(dict(self.terms))  # type: ignore[arg-type] # the constant monomial only
        if self.is_linear:
            terms: dict[Monomial[W], Fraction] = {}
            for monomial, coefficient in self.terms.items():
                if not monomial:
                    _add(terms, (), coefficient)
                    continue
                for inner, factor in value(monomial[0]).terms.items():
                    _add(terms, inner, coefficient * factor)
            return Polynomial(terms)
        total: Polynomial[W] = Polynomial({})
        for monomial, coefficient in self.terms.items():
            product: Polynomial[W] = Polynomial.constant(coefficient)
            for variable in monomial:
                product = product * value(variable)
            total = total + product
        return total

    def evaluate(self, values: Mapping[V_co, Fraction]) -> Fraction:
        """The value under an assignment of every variable."""
        total = _ZERO
        for monomial, coefficient in self.terms.items():
            product = coefficient
            for variable in monomial:
                product *= values[variable]
            total += product
        return total

    def __str__(self) -> str:
        if not self.terms:
            return "0"
        text = ""
        for monomial, coefficient in sorted(self.terms.items(), key=_last_constant):
            sign, size = ("-" if coefficient < 0 else "+"), abs(coefficient)
            factors = ([] if size == 1 and monomial else [str(size)]) + [str(variable) for variable in monomial]
            text += f" {sign} {'·'.join(factors)}" if text else f"{'-' if sign == '-' else ''}{'·'.join(factors)}"
        return text

    def __repr__(self) -> str:
        return f"Polynomial({self})"


def _add(terms: dict[Monomial[W], Fraction], monomial: Monomial[W], coefficient: Fraction) -> None:
    known = terms.get(monomial)
    terms[monomial] = coefficient if known is None else known + coefficient


def _order(variable: object) -> tuple[str, str]:
    return type(variable).__name__, str(variable)


def _last_constant(term: tuple[Monomial[V_co], Fraction]) -> tuple[bool, list[tuple[str, str]]]:
    return not term[0], [_order(variable) for variable in term[0]]
