"""Sides of a box and how far known bad polyhedra let them go: exact linear programs in parameter space."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.irr.box import Box, Interval
from robust.irr.result import Side
from robust.plan.model import Parameter
from robust.qe.constraint import LinearConstraint
from robust.qe.lp import feasible_point, maximize
from robust.qe.polyhedron import Polyhedron

Face = tuple[str, Side]
"""A side of a box: a parameter and which end."""


@dataclass(frozen=True, slots=True)
class Limit:
    """Where a face stands: None is infinitely far out; `closed` tells whether the value itself belongs to the box."""

    value: Fraction | None
    closed: bool = True


@dataclass(frozen=True, slots=True)
class Least:
    """An infimum and whether it is attained."""

    value: Fraction
    attained: bool


STRETCH = "\u03bb"
"""The variable by which moving faces are scaled; no parameter can have this name."""


def box_of(parameters: Sequence[Parameter], limits: Mapping[Face, Limit]) -> Box:
    """The box whose faces stand at the limits."""
    intervals = {}
    for parameter in parameters:
        low, high = limits[parameter.name, Side.LOWER], limits[parameter.name, Side.UPPER]
        intervals[parameter.name] = Interval(low.value, high.value, low.closed, high.closed)
    return Box(intervals)


def least_stretch(
    piece: Polyhedron,
    fixed: Mapping[Face, Limit],
    moving: Mapping[Face, tuple[Fraction, Fraction]],
) -> Least | None:
    """The least λ ≥ 0 at which a box meets a bad polyhedron; None if it never does.

    Args:
        piece: bad parameter values.
        fixed: faces that stand still.
        moving: faces that stand at `base ± λ · speed`, as pairs (base, speed).
    """
    # Sides of other parameters leave room for every value: a box is nowhere empty.
    used = {name for constraint in piece.constraints for name, _ in constraint.coefficients}
    names = [*(name for name in piece.parameters if name in used), STRETCH]
    constraints = [*piece.constraints, LinearConstraint.of({STRETCH: 1}, ">=", 0)]
    for (name, side), limit in fixed.items():
        if name in used and limit.value is not None:
            constraints.append(_within(name, side, {}, limit.value, limit.closed))
    for (name, side), (base, speed) in moving.items():
        if name in used:
            constraints.append(_within(name, side, {STRETCH: speed}, base, True))
    return infimum(names, constraints, {STRETCH: Fraction(1)})


def _within(name: str, side: Side, stretch: Mapping[str, Fraction], base: Fraction, closed: bool) -> LinearConstraint:
    """`name ≤ base + λ · speed` for an upper face, `name ≥ base − λ · speed` for a lower one."""
    sign = 1 if side is Side.UPPER else -1
    outward = {name: Fraction(sign), **{variable: -speed for variable, speed in stretch.items()}}
    return LinearConstraint.of(outward, "<=" if closed else "<", sign * base)


def meets(piece: Polyhedron, box: Box) -> bool:
    """Whether some point of the box lies in the polyhedron."""
    return feasible_point(piece.parameters, [*piece.constraints, *constraints_of(box)]) is not None


def constraints_of(box: Box) -> Iterable[LinearConstraint]:
    """The box as linear constraints."""
    for name, interval in box.intervals.items():
        if interval.lower is not None:
            yield _within(name, Side.LOWER, {}, interval.lower, interval.lower_closed)
        if interval.upper is not None:
            yield _within(name, Side.UPPER, {}, interval.upper, interval.upper_closed)


def infimum(
    names: Sequence[str], constraints: Iterable[LinearConstraint], objective: Mapping[str, Fraction]
) -> Least | None:
    """The infimum of a linear form that is bounded below on the constraints; None if they cannot be satisfied."""
    best = maximize(names, constraints, {name: -factor for name, factor in objective.items()})
    if best is None:
        return None
    if best.value is None:
        raise ValueError("the form is not bounded below")
    return Least(-best.value, best.attained)
