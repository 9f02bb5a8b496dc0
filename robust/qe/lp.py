"""Exact linear programming over named parameters: feasible points and least upper bounds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from robust.qe.constraint import LinearConstraint
from robust.qe.simplex import Optimum, Tableau

IntegerForm = tuple[tuple[int, ...], int]
"""Coefficients in the order of the parameters, and a constant."""


@dataclass(frozen=True, slots=True)
class Supremum:
    """The least upper bound of a linear form over a polyhedron that is not empty.

    `value` is None if the form is unbounded; `attained` tells whether some point of the polyhedron has the value.
    `point` is a point of the closure with that value (if unbounded: any), not of the polyhedron unless attained there.
    """

    value: Fraction | None
    attained: bool
    point: dict[str, Fraction]


def integer_form(constraint: LinearConstraint, parameters: Sequence[str]) -> IntegerForm:
    """The constraint's coefficients and constant, scaled to integers."""
    by_name = dict(constraint.coefficients)
    scale = constraint.constant.denominator
    form = tuple(by_name[name].numerator * scale if name in by_name else 0 for name in parameters)
    return form, constraint.constant.numerator


def tableau(parameters: Sequence[str], constraints: Iterable[LinearConstraint]) -> Tableau:
    """A tableau of the constraints, equalities first; feasibility is not restored yet."""
    result = Tableau(len(parameters))
    extend(result, parameters, sorted(constraints, key=lambda constraint: not constraint.is_equality))
    return result


def extend(target: Tableau, parameters: Sequence[str], constraints: Iterable[LinearConstraint]) -> list[int]:
    """Add constraints to a tableau; their slack variables."""
    slacks = []
    for constraint in constraints:
        form, constant = integer_form(constraint, parameters)
        slacks.append(target.add(form, constraint.relation, constant))
    return slacks


def feasible_point(parameters: Sequence[str], constraints: Iterable[LinearConstraint]) -> dict[str, Fraction] | None:
    """A point that satisfies every constraint, strict ones included; None if there is none."""
    solved = tableau(parameters, constraints)
    return dict(zip(parameters, solved.point(), strict=True)) if solved.restore() else None


def maximize(
    parameters: Sequence[str], constraints: Iterable[LinearConstraint], objective: Mapping[str, Fraction]
) -> Supremum | None:
    """The least upper bound of `Σ objective · parameter` under the constraints; None if they have no solution."""
    solved = tableau(parameters, constraints)
    return supremum(solved, parameters, objective) if solved.restore() else None


def supremum(solved: Tableau, parameters: Sequence[str], objective: Mapping[str, Fraction]) -> Supremum:
    """As `maximize`, on a tableau whose feasibility has been restored."""
    scale = lcm(*(Fraction(factor).denominator for factor in objective.values()))
    form = [int(objective.get(name, 0) * scale) for name in parameters]
    optimum = solved.maximize(form)
    point = dict(zip(parameters, optimum.point, strict=True))
    value = None if optimum.value is None else optimum.value / scale
    return Supremum(value, optimum.is_attained, point)


def violates(optimum: Optimum, constraint: LinearConstraint) -> bool:
    """Whether some point goes beyond an inequality, given the optimum of its integer form.

    A strict inequality is also violated by a point on its boundary.
    """
    if optimum.value is None or optimum.value > constraint.constant.numerator:
        return True
    return constraint.is_strict and optimum.is_attained and optimum.value == constraint.constant.numerator
