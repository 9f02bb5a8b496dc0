"""Exact volumes of polyhedra, and certified bounds on the volume of regions with many parameters."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from robust.qe.constraint import LinearConstraint, trim
from robust.qe.polyhedron import Polyhedron
from robust.qe.reduction import substitute_equality

ZERO, ONE = Fraction(0), Fraction(1)


def volume(polyhedron: Polyhedron) -> Fraction | None:
    """The volume of a polyhedron; None if infinite."""
    form = polyhedron.normal_form
    if form is None or form.equalities:
        return ZERO
    if not form.parameters:
        return ONE
    if not polyhedron.is_bounded:
        return None
    # With the origin inside, all terms of the formula are positive and facets through it drop out.
    centre = form.interior
    shifted = [
        LinearConstraint(c.coefficients, c.relation, c.constant - c.value(centre)).closed() for c in form.inequalities
    ]
    return _lasserre(form.parameters, trim(shifted))


def _lasserre(names: Sequence[str], constraints: Sequence[LinearConstraint]) -> Fraction:
    """Lasserre's formula: a polytope is the sum of pyramids over its facets with their apex at the origin.

    `vol(P) = 1/n · Σ_i b_i / |a_ij| · vol(P_i)`, where P_i is facet i projected along a coordinate j with a_ij ≠ 0. The
    constraints are bounded and without parallel duplicates; redundant ones contribute nothing.
    """
    if any(constraint.is_false for constraint in constraints):
        return ZERO
    if len(names) == 1:
        return _length(constraints)
    total = ZERO
    for facet in constraints:
        if facet.constant:
            name, factor = max(facet.coefficients, key=lambda pair: abs(pair[1]))
            others = trim(substitute_equality(other, facet, name) for other in constraints if other is not facet)
            rest = [other for other in names if other != name]
            total += facet.constant / abs(factor) * _lasserre(rest, others)
    return total / len(names)


def _length(constraints: Sequence[LinearConstraint]) -> Fraction:
    """The length of a bounded interval."""
    upper = min(c.constant / c.coefficients[0][1] for c in constraints if c.coefficients[0][1] > 0)
    lower = max(c.constant / c.coefficients[0][1] for c in constraints if c.coefficients[0][1] < 0)
    return max(ZERO, upper - lower)


def union_volume(pieces: Sequence[Polyhedron]) -> Fraction | None:
    """The volume of a union; None if infinite.

    Each piece counts without the earlier ones, which are cut out by splitting; splinters without volume are dropped.
    """
    solid = [piece for piece in pieces if piece.is_full_dimensional]
    if any(not piece.is_bounded for piece in solid):
        return None
    total = ZERO
    for index, piece in enumerate(solid):
        rest = [piece]
        for earlier in solid[:index]:
            rest = [part for old in rest for part in old.minus(earlier) if part.is_full_dimensional]
        total += sum((volume(part) or ZERO for part in rest), ZERO)
    return total
