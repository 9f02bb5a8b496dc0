"""Sides of a box and how far known bad polyhedra let them go: exact linear programs in parameter space."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

from robust.irr.box import Box, Interval, Side
from robust.plan.model import Parameter
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.simplex import feasible_point, maximize
from robust.smt.limits import Deadline

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


class BadSet(Protocol):
    """The parameter values outside the envelope, discovered piece by piece."""

    def piece_in(self, box: Box, deadline: Deadline) -> Polyhedron | None:
        """A polyhedron of bad values that meets the box; None if the box is inside the envelope.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """


class Widening:
    """One run of exact widening from the nominal point, which must be inside the envelope.

    Args:
        bad: the bad set.
        parameters: the parameters, with nominal values, weights and declared bounds.
        groups: the faces that move together, group after group; by default all at once.
        deadline: when to stop with the best box so far.
        on_box: called with every box that is known to be inside.
    """

    def __init__(
        self,
        bad: BadSet,
        parameters: Sequence[Parameter],
        *,
        groups: Sequence[Sequence[Face]] | None = None,
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
        on_box: Callable[[Box], None] | None = None,
    ) -> None:
        self._bad = bad
        self._parameters = parameters
        self._groups = groups if groups is not None else [faces_of(parameters)]
        self._deadline = deadline
        self._on_box = on_box
        self._nominal = {parameter.name: parameter.nominal for parameter in parameters}
        self._weight = {parameter.name: parameter.weight for parameter in parameters}
        self._limits = {face: Limit(self._nominal[face[0]]) for face in faces_of(parameters)}
        self.pieces: list[Polyhedron] = []
        self.box = Box.nominal(parameters)
        self.checks = 0
        self.first_widening: float | None = None
        self._started = time.perf_counter()

    def run(self) -> Box:
        """Move all faces as far as they go."""
        for group in self._groups:
            moving = list(group)
            while moving:
                moving = self._round(moving)
        return self.box

    # -- one round: move until something blocks, then tell who is blocked -------------------------------------------

    def _round(self, moving: list[Face]) -> list[Face]:
        """Move faces outwards together; returns those that may go on."""
        least = self._farthest(moving)
        if least is None:
            self._limits.update({face: Limit(None) for face in moving})
            return []
        going, stuck = self._split(moving, least)
        self._limits.update({face: self._at(face, least.value, closed=not least.attained) for face in stuck})
        return going

    def _farthest(self, moving: list[Face]) -> Least | None:
        """The least stretch at which the box meets bad values, confirmed; None if it never does."""
        while True:
            least = self._least_stretch(moving)
            if least is None:
                limits = {face: Limit(None) for face in moving}
            else:
                limits = {face: self._at(face, least.value, closed=not least.attained) for face in moving}
            if self._is_inside(self._with(limits)):
                return least

    def _split(self, moving: list[Face], least: Least) -> tuple[list[Face], list[Face]]:
        """Which faces can still go beyond the stretch while the others stay there, confirmed."""
        while True:
            # Pieces farther out leave room for everybody.
            near = [piece for piece, found in self._stretches(moving) if found == least]
            going: list[Face] = []
            for face in moving:
                if self._can_go([*going, face], moving, least, near):
                    going.append(face)
            if self._is_inside(self._with(self._ahead(going, moving, least))):
                return going, [face for face in moving if face not in going]

    def _can_go(self, going: list[Face], moving: list[Face], least: Least, near: list[Polyhedron]) -> bool:
        if least.attained:
            # The value itself is bad for someone: who may include it?
            box = self._with(self._ahead(going, moving, least))
            return not any(meets(piece, box) for piece in near)
        room = self._room(going, moving, least, near)
        return room is None or room > 0

    def _room(
        self, going: list[Face], moving: list[Face], least: Least, pieces: Iterable[Polyhedron]
    ) -> Fraction | None:
        """How much farther some faces can go, by what is known, while the others stay; None is without limit."""
        limits = {face: limit for face, limit in self._limits.items() if face not in moving}
        limits |= {face: self._at(face, least.value, closed=True) for face in moving if face not in going}
        speeds = {face: (self._place(face, least.value), self._weight[face[0]]) for face in going}
        found = [found.value for piece in pieces if (found := least_stretch(piece, limits, speeds)) is not None]
        return min(found, default=None)

    def _ahead(self, going: list[Face], moving: list[Face], least: Least) -> dict[Face, Limit]:
        """Limits with `going` a little farther than the other moving faces: by half the room that is known."""
        if least.attained:
            return {face: self._at(face, least.value, closed=face in going) for face in moving}
        room = self._room(going, moving, least, self.pieces) if going else None
        step = Fraction(1) if room is None else room / 2
        return {face: self._at(face, least.value + (step if face in going else 0), closed=True) for face in moving}

    # -- parts -----------------------------------------------------------------------------------------------------

    def _stretches(self, moving: list[Face]) -> Iterator[tuple[Polyhedron, Least]]:
        """At which stretch each known piece meets the box, if ever."""
        fixed = {face: limit for face, limit in self._limits.items() if face not in moving}
        speeds = {face: (self._nominal[face[0]], self._weight[face[0]]) for face in moving}
        for piece in self.pieces:
            least = least_stretch(piece, fixed, speeds)
            if least is not None:
                yield piece, least

    def _least_stretch(self, moving: list[Face]) -> Least | None:
        found = (least for _, least in self._stretches(moving))
        return min(found, key=lambda least: (least.value, not least.attained), default=None)

    def _place(self, face: Face, stretch: Fraction) -> Fraction:
        name, side = face
        way = stretch * self._weight[name]
        return self._nominal[name] + (way if side is Side.UPPER else -way)

    def _at(self, face: Face, stretch: Fraction, *, closed: bool) -> Limit:
        return Limit(self._place(face, stretch), closed)

    def _with(self, limits: dict[Face, Limit]) -> Box:
        return box_of(self._parameters, {**self._limits, **limits})

    def _is_inside(self, box: Box) -> bool:
        """Ask; a box that is inside is kept, a bad polyhedron that meets it is remembered."""
        self.checks += 1
        piece = self._bad.piece_in(box, self._deadline)
        if piece is not None:
            self.pieces.append(piece)
            return False
        self._keep(box)
        return True

    def _keep(self, box: Box) -> None:
        """Boxes of one run contain each other, so the latest is the best."""
        if self.first_widening is None and any(interval.width != 0 for interval in box.intervals.values()):
            self.first_widening = time.perf_counter() - self._started
        self.box = box
        if self._on_box is not None:
            self._on_box(box)


def faces_of(parameters: Sequence[Parameter]) -> list[Face]:
    """Both faces of every parameter."""
    return [(parameter.name, side) for parameter in parameters for side in (Side.UPPER, Side.LOWER)]
