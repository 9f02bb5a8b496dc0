"""The unknowns of the encodings' formulas, and linear expressions over them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from robust.plan.model import Expression, NumericVariable, ParameterReference, TimePoint
from robust.plan.polynomial import Polynomial


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


def parameters_in(expression: Linear) -> frozenset[str]:
    """Names of the parameters that occur."""
    return frozenset(unknown.name for unknown in expression.variables if isinstance(unknown, ParameterReference))


def is_over_parameters(expressions: Iterable[Linear]) -> bool:
    """Whether nothing but parameters occurs."""
    return all(isinstance(unknown, ParameterReference) for e in expressions for unknown in e.variables)


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
