"""Exact projection of polyhedra by Fourier–Motzkin elimination."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

from robust.qe.constraint import LinearConstraint, Sense, trim
from robust.qe.reduction import combine, normal_form, substitute_equality


def eliminate(
    parameters: Sequence[str], constraints: Iterable[LinearConstraint], names: Iterable[str]
) -> tuple[LinearConstraint, ...]:
    """Constraints on the other parameters that hold exactly where some values of `names` satisfy all constraints.

    Equalities are used as substitutions; of the inequalities, redundant ones are removed after every parameter, which
    keeps the doubly exponential growth of the plain method away.
    """
    remaining = [name for name in parameters if name not in set(names)]
    doomed = [name for name in parameters if name not in remaining]
    current = tuple(constraints)
    left = list(parameters)
    while doomed:
        form = normal_form(left, current)
        if form is None:
            return (LinearConstraint.false(),)
        current, doomed, left = _without_equalities(form.constraints, doomed, left)
        if doomed:
            name = min(doomed, key=lambda name: _growth(current, name))
            current = _combined(current, name)
            doomed.remove(name)
            left.remove(name)
    return trim(current)


def _without_equalities(
    constraints: Iterable[LinearConstraint], doomed: Sequence[str], left: Sequence[str]
) -> tuple[tuple[LinearConstraint, ...], list[str], list[str]]:
    """Use up equalities that determine a parameter to be eliminated."""
    current = list(constraints)
    doomed, left = list(doomed), list(left)
    while True:
        usable = ((c, n) for c in current if c.is_equality for n in c.parameters if n in doomed)
        equality, name = next(usable, (None, ""))
        if equality is None:
            return trim(current), doomed, left
        current.remove(equality)
        current = [substitute_equality(constraint, equality, name) for constraint in current]
        doomed.remove(name)
        left.remove(name)


def _growth(constraints: Iterable[LinearConstraint], name: str) -> int:
    """By how many constraints the elimination of a parameter changes their number, at most."""
    factors = [dict(constraint.coefficients).get(name, 0) for constraint in constraints]
    above, below = sum(factor > 0 for factor in factors), sum(factor < 0 for factor in factors)
    return above * below - above - below


def _combined(constraints: Iterable[LinearConstraint], name: str) -> tuple[LinearConstraint, ...]:
    """Every upper bound of a parameter, which no equality mentions, paired with every lower bound."""
    result: list[LinearConstraint] = []
    above: list[tuple[LinearConstraint, Fraction]] = []
    below: list[tuple[LinearConstraint, Fraction]] = []
    for constraint in constraints:
        factor = dict(constraint.coefficients).get(name)
        if not factor:
            result.append(constraint)
        else:
            (above if factor > 0 else below).append((constraint, abs(factor)))
    for upper, high in above:
        for lower, low in below:
            relation = Sense.LESS if upper.is_strict or lower.is_strict else Sense.AT_MOST
            result.append(combine(upper, 1 / high, lower, 1 / low, relation))
    return trim(result)
