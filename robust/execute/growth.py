"""Boxes that grow until the envelope or controllability stops every face.

Controllability is lost as a box grows, and each reason for that is a conjunction of linear inequalities over the ends
of the box (:mod:`robust.execute.controllable_boxes`). So a reason stops growing faces as a bad polyhedron does: it says
exactly how far they go. Exact widening (:mod:`robust.irr.widen`) then needs to know nothing else of it. There is no
bisection.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from robust.execute.controllable_boxes import HORIZON, NOTHING, Property, Reason, ends_of, value
from robust.irr.widen import BadSet, Obstacle, Widening, faces_of
from robust.plan.model import Parameter
from robust.qe.box import Box, Face
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.slabs import Growing
from robust.smt.limits import NEVER, Deadline


@dataclass(frozen=True)
class Obstruction:
    """A reason why boxes are not controllable, as what growing boxes run into."""

    forms: Reason
    exact = True

    @property
    def slabs(self) -> Obstruction:
        return self

    @cached_property
    def mentioned(self) -> frozenset[str]:
        return frozenset(name for form in self.forms for (name, _), _ in form.coefficients())

    @property
    def rooms(self) -> list[tuple[Mapping[Face, Fraction], Fraction]]:
        """One of them has to have room."""
        return [(dict(form.coefficients()), form.constant_term) for form in self.forms]

    def meets(self, box: Box) -> bool:
        ends = ends_of(box)
        return all(value(form, ends) < NOTHING for form in self.forms)

    def least_stretch(self, growing: Growing) -> tuple[Fraction, bool] | None:
        """Forms fall as a box grows; the box meets the reason when the last of them has become negative."""
        ends = {**ends_of(growing.box), **{face: base for face, (base, _) in growing.moving.items()}}
        greatest, attained = Fraction(0), True
        for form in self.forms:
            room = value(form, ends)
            if room < NOTHING:
                continue
            speed = sum(
                (-factor * face[1].sign * growing.moving[face][1] for face, factor in form.coefficients()
                 if face in growing.moving),
                Fraction(0),
            )  # fmt: skip
            if not speed:
                return None
            if room[1] / speed >= greatest:
                greatest, attained = room[1] / speed, False
        return greatest, attained


class Controllable:
    """The boxes that are inside another set and have a property, as widening asks for them.

    Args:
        inside: what a box must not meet.
        wanted: what it has to have.
        parameters: the parameters, with weights.
        start: where growing began: faces that must stay finite go no farther than :data:`HORIZON` weights from there.
    """

    def __init__(self, inside: BadSet, wanted: Property, parameters: Sequence[Parameter], start: Box) -> None:
        self._inside = inside
        self._wanted = wanted
        self._weight = {parameter.name: parameter.weight for parameter in parameters}
        self._names = tuple(self._weight)
        self._start = start
        self.cut: set[Face] = set()
        """Faces that could be at any finite place, but must not be infinite."""

    def piece_in(self, box: Box, deadline: Deadline) -> Obstacle | None:
        ends = ends_of(box)
        for face in sorted(self._wanted.endless(ends), key=lambda one: (one[0], one[1].value)):
            self.cut.add(face)
            return self._beyond(face)
        reason = self._wanted.reason(ends)
        return self._inside.piece_in(box, deadline) if reason is None else Obstruction(reason)

    def _beyond(self, face: Face) -> Polyhedron:
        name, side = face
        base = self._start[name].end(side)
        end = (Fraction(0) if base is None else base) + side.sign * HORIZON * self._weight[name]
        return Polyhedron(self._names, (LinearConstraint.of({name: side.sign}, ">", side.sign * end),))


@dataclass(frozen=True)
class KnownSet:
    """Bad polyhedra all of which are known."""

    pieces: tuple[Polyhedron, ...]

    def piece_in(self, box: Box, deadline: Deadline) -> Polyhedron | None:
        deadline.enforce()
        return next((piece for piece in self.pieces if piece.meets(box)), None)


def grow(
    start: Box,
    bad: BadSet,
    known: Iterable[Obstacle],
    *,
    parameters: Sequence[Parameter],
    still: Collection[str] = (),
    deadline: Deadline = NEVER,
    on_box: Callable[[Box], None],
) -> list[Obstacle]:
    """Move the faces of a box outwards together until each is stopped; returns what was met or known.

    No box around the last one is as wanted, but for faces of parameters in `still`, which do not move.

    Args:
        start: a box that `bad` has nothing against.
        bad: where boxes must not go.
        known: some of that.
        parameters: the parameters, with weights.
        still: parameters whose faces stay.
        deadline: when to give up.
        on_box: called with every box on the way; each contains those before.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    met = list(known)
    moving = [face for face in faces_of(parameters) if face[0] not in still and start[face[0]].end(face[1]) is not None]
    Widening(
        bad=bad,
        parameters=parameters,
        pieces=met,
        groups=[moving],
        deadline=deadline,
        on_box=on_box,
        start=start,
    ).run()
    return met
