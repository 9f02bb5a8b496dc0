"""The largest part of a box that is dynamically or strongly controllable, exactly.

Both properties get lost as a box grows, and each reason for it is a conjunction of linear inequalities over the ends of
the box: the pieces of a semi-reducible negative cycle are negative, or the worst values of some requirements add up. So
a box that is not controllable tells how far its faces have to come back before that reason is void; there is no
bisection and no tolerance.

As in :mod:`robust.irr.widen`, all faces move outwards from the nominal point together, each at the speed of its
parameter's weight, up to where they stood; those that reasons block stay, the others move on. The result is max–min
fair, and no controllable box between it and the given one contains it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

from robust.errors import InputError
from robust.execute.controllability.dynamic import dynamic
from robust.execute.controllability.strong import (
    NOTHING,
    Difference,
    Ends,
    Form,
    ParametricStnu,
    differences,
    ends_of,
    solve,
    value,
)
from robust.irr.box import Box, Interval, Side
from robust.irr.widen import Face
from robust.plan.model import Parameter
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline

HORIZON = Fraction(1_000_000)
"""How far, in units of its weight, a face goes that may be at any finite place, but not infinitely far out."""

Reason = tuple[Form, ...]
"""A box is not controllable if all these forms over its ends are negative."""


class Property(Protocol):
    """What a box has to have, and every box inside it has then too."""

    def endless(self, ends: Ends) -> frozenset[Face]:
        """Faces that must not be infinitely far out, however the others stand."""

    def reason(self, ends: Ends) -> Reason | None:
        """Why a box does not have the property; None if it does."""


class Dynamically:
    """Dynamic controllability; parameters that the network is vague about are taken to be independent and hidden."""

    def __init__(self, network: ParametricStnu, deadline: Deadline) -> None:
        self._network = network
        self._deadline = deadline
        self.checks = 0

    def endless(self, ends: Ends) -> frozenset[Face]:
        return self._network.endless(ends)

    def reason(self, ends: Ends) -> Reason | None:
        for _, form in self._network.early(ends):
            return (form,)
        self.checks += 1
        answer = dynamic(self._network.at(ends), self._deadline)
        if answer.cycle is None:
            return None
        return tuple(_sum(self._network.form(step) for step in piece) for piece in answer.cycle.pieces)


class Strongly:
    """Strong controllability."""

    def __init__(self, network: ParametricStnu, deadline: Deadline) -> None:
        self._points = network.points
        self._needed: tuple[Difference, ...] = differences(network)
        self._deadline = deadline
        self.checks = 0

    def endless(self, ends: Ends) -> frozenset[Face]:
        return solve(self._points, self._needed, ends).endless

    def reason(self, ends: Ends) -> Reason | None:
        self._deadline.enforce()
        self.checks += 1
        answer = solve(self._points, self._needed, ends)
        return None if answer.is_controllable else (-_sum(one.form for one in answer.cycle),)


def _sum(forms: Iterable[Form]) -> Form:
    total: Form = Polynomial({})
    for form in forms:
        total = total + form
    return total


@dataclass(frozen=True, slots=True)
class Shrunk:
    """The result: a box, and `cut`, its faces that could be at any finite place but were not allowed to be infinite."""

    box: Box
    cut: tuple[Face, ...]
    checks: int


def shrink(parameters: Sequence[Parameter], box: Box, wanted: Dynamically | Strongly) -> Shrunk:
    """The max–min fair part of a box around the nominal point that has a property; see the module's text.

    Where the nominal value is outside the box, faces move from the middle of the interval instead.

    Raises:
        InputError: if not even the point that faces start from has the property: it has no schedule.
        OutOfTimeError: if the property's deadline passes.
    """
    shrinking = _Shrinking(parameters, box, wanted)
    return shrinking.run()


class _Shrinking:
    def __init__(self, parameters: Sequence[Parameter], box: Box, wanted: Dynamically | Strongly) -> None:
        self._box = box
        self._wanted = wanted
        self._weight = {parameter.name: parameter.weight for parameter in parameters}
        self._centre = {
            parameter.name: parameter.nominal
            if parameter.nominal in box[parameter.name]
            else box[parameter.name].some_value()
            for parameter in parameters
        }
        self._outer: dict[Face, Fraction | None] = ends_of(box)
        self._cut = tuple(sorted(wanted.endless(self._outer), key=lambda face: (face[0], face[1].value)))
        for face in self._cut:
            self._outer[face] = self._place(face, HORIZON)
        self._ends: dict[Face, Fraction | None] = {face: self._centre[face[0]] for face in self._outer}
        self._reasons: list[Reason] = []

    def run(self) -> Shrunk:
        if self._wanted.reason(self._outer) is None:
            self._ends = dict(self._outer)
        else:
            if self._wanted.reason(self._ends) is not None:
                raise InputError("the plan's network has no schedule at the nominal values")
            moving = [(name, side) for name in self._box.intervals for side in (Side.UPPER, Side.LOWER)]
            at = Fraction(0)
            while moving:
                moving, at = self._round(moving, at)
        cut = tuple(face for face in self._cut if self._ends[face] == self._outer[face])
        return Shrunk(self._result(), cut, self._wanted.checks)

    def _round(self, moving: list[Face], at: Fraction) -> tuple[list[Face], Fraction]:
        """Move faces outwards together until one arrives or is blocked; returns those that may go on, and where."""
        room = [stretch for face in moving if (stretch := self._stretch(face)) is not None]
        limit = min(room, default=None)
        reached = self._farthest(moving, limit, at)
        if reached is None:
            self._ends.update(dict.fromkeys(moving))
            return [], at
        self._ends.update({face: self._place(face, reached) for face in moving})
        going: list[Face] = []
        for face in moving:
            if self._stretch(face) != reached and self._can_go([*going, face], reached):
                going.append(face)
        return going, reached

    def _can_go(self, going: list[Face], at: Fraction) -> bool:
        limit = min((s for face in going if (s := self._stretch(face)) is not None), default=None)
        farthest = self._farthest(going, limit, at)
        return farthest is None or farthest > at

    def _farthest(self, moving: Sequence[Face], limit: Fraction | None, at: Fraction) -> Fraction | None:
        """The greatest stretch up to a limit at which the box has the property; None is infinite, at least `at`."""
        stretch = limit
        while stretch is None or stretch > at:
            ends = {**self._ends, **{face: self._place(face, stretch) for face in moving}}
            reason = self._known(ends) or self._wanted.reason(ends)
            if reason is None:
                return stretch
            if reason not in self._reasons:
                self._reasons.append(reason)
            stretch = max((root for form in reason if (root := self._root(form, moving)) is not None), default=at)
        return at

    def _known(self, ends: Ends) -> Reason | None:
        return next((r for r in self._reasons if all(value(form, ends) < NOTHING for form in r)), None)

    def _root(self, form: Form, moving: Sequence[Face]) -> Fraction | None:
        """At which stretch a form that falls while faces move out is zero; None if it does not depend on them."""
        slope = Fraction(0)
        for face, factor in form.coefficients():
            if face in moving:
                slope += factor * self._weight[face[0]] * _outwards(face)
        ends = {**self._ends, **{face: self._centre[face[0]] for face in moving}}
        infinite, constant = value(form, ends)
        return None if slope >= 0 or infinite else -constant / slope

    def _stretch(self, face: Face) -> Fraction | None:
        """At which stretch a face has arrived where it stood."""
        end = self._outer[face]
        return None if end is None else (end - self._centre[face[0]]) / self._weight[face[0]] * _outwards(face)

    def _place(self, face: Face, stretch: Fraction | None) -> Fraction | None:
        if stretch is None:
            return None
        return self._centre[face[0]] + stretch * self._weight[face[0]] * _outwards(face)

    def _result(self) -> Box:
        intervals = {}
        for name, old in self._box.intervals.items():
            low, high = self._ends[name, Side.LOWER], self._ends[name, Side.UPPER]
            intervals[name] = Interval(
                low,
                high,
                old.lower_closed if low == old.lower else True,
                old.upper_closed if high == old.upper else True,
            )
        return Box(intervals)


def _outwards(face: Face) -> int:
    return 1 if face[1] is Side.UPPER else -1


@dataclass(frozen=True, slots=True)
class Loss:
    """How much narrower a box has become: by face, and as a share of the total width; None is infinite.

    `share` is None if the total width was infinite; `unbounded` are the faces that were infinitely far out before.
    """

    faces: Mapping[Face, Fraction | None]
    unbounded: tuple[Face, ...]
    share: Fraction | None


def loss(box: Box, shrunk: Box) -> Loss:
    """What a box loses if it is replaced by one inside it."""
    before, after = ends_of(box), ends_of(shrunk)
    faces: dict[Face, Fraction | None] = {}
    for face, old in before.items():
        new = after[face]
        if old is None or new is None:
            faces[face] = Fraction(0) if old == new else None
        else:
            faces[face] = abs(old - new)
    wide, narrow = box.total_width, shrunk.total_width
    share = None if wide is None or narrow is None else ((wide - narrow) / wide if wide else Fraction(0))
    return Loss(faces, tuple(face for face, lost in faces.items() if lost is None), share)
