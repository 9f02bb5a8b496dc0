"""Shapes between boxes and regions: bounds on linear forms of the parameters, such as sums and differences of two.

A template names directions; a shape bounds each of them from both sides. In coordinates that are the directions, the
shape is a box, so it is widened as boxes are (:mod:`robust.irr.widen`), from the widened box of the parameters: all
faces move outwards together until bad values stop them, one after the other. What is bad is known, the complement of
the exact region: a shape is inside if linear programming finds no point of it in any of its polyhedra.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, product
from typing import cast

from robust.errors import InputError, Location, did_you_mean
from robust.irr.widen import STRETCH, Obstacle, Widening, faces_of
from robust.numbers import is_number, parse_number, shorten
from robust.plan.model import Parameter
from robust.plan.pddl.forms import read_text
from robust.qe import constraint, simplex
from robust.qe.box import Box, Face, Growing, Interval, Side
from robust.qe.polyhedron import Point, Polyhedron
from robust.qe.region import Region, signed_sum
from robust.smt.limits import Deadline

Direction = tuple[tuple[str, Fraction], ...]
"""Coefficients of parameters."""
Faces = dict[Face, constraint.LinearConstraint]
"""Bounds of forms as constraints on parameters."""


@dataclass(frozen=True)
class Shape:
    """Parameter values between bounds on linear forms.

    Attributes:
        name: that of the template.
        parameters: whose values these are.
        directions: the forms, by the names of their bounds.
        bounds: intervals of the forms; those of forms that other bounds limit enough may be infinite.
        region: in which it is.
    """

    name: str
    parameters: tuple[str, ...]
    directions: Mapping[str, Direction]
    bounds: Box
    region: Region = field(repr=False)

    def __contains__(self, point: Point) -> bool:
        """In time in proportion to the number of faces."""
        forms = self.directions.items()
        values = {name: sum((factor * point[one] for one, factor in form), Fraction(0)) for name, form in forms}
        return self.bounds.includes(values)

    @property
    def bounded(self) -> dict[str, Interval]:
        """The forms with an end that is finite; parameters have the ends that follow from all faces, as in proofs."""
        inside, infinite = self.polyhedron, (None, None)
        shown = {
            name: (inside.extent(name) if name in self.parameters else None) or ends
            for name, ends in self.bounds.intervals.items()
        }
        return {name: ends for name, ends in shown.items() if (ends.lower, ends.upper) != infinite}

    @property
    def polyhedron(self) -> Polyhedron:
        """The points of the shape."""
        return Polyhedron(self.parameters, tuple(standing(self.directions, self.bounds).values()))


def standing(directions: Mapping[str, Direction], bounds: Box, without: Container[Face] = ()) -> Faces:
    """The finite bounds as constraints on parameters, of all faces but some."""
    return {
        (name, side): _face(direction, side.sign, end, strict=not bounds[name].is_closed_at(side))
        for (name, direction), side in product(directions.items(), Side)
        if (name, side) not in without and (end := bounds[name].end(side)) is not None
    }


@lru_cache(maxsize=1 << 14)
def _face(
    direction: Direction, sign: int, end: Fraction, speed: Fraction = Fraction(0), *, strict: bool = False
) -> constraint.LinearConstraint:
    form = {name: sign * factor for name, factor in direction} | ({STRETCH: -speed} if speed else {})
    return constraint.LinearConstraint.of(form, "<" if strict else "<=", sign * end)


@dataclass(eq=False)
class _BadForShapes:
    """A polyhedron of bad values, for shapes; it meets boxes of bounds.

    Some of the faces that keep a shape from it are remembered: most questions differ in others.
    """

    piece: Polyhedron
    directions: Mapping[str, Direction]
    exact: bool = True
    _between: Faces | None = None

    @property
    def mentioned(self) -> frozenset[str]:
        return frozenset(self.directions)

    @property
    def slabs(self) -> _BadForShapes:
        return self

    def meets(self, bounds: Box) -> bool:
        return not self._is_kept_off(standing(self.directions, bounds))

    def least_stretch(self, growing: Growing) -> tuple[Fraction, bool] | None:
        faces = standing(self.directions, growing.box, growing.moving)
        if self._is_kept_off(faces):
            return None
        ends = growing.moving.items()
        moving = (_face(self.directions[name], side.sign, base, speed) for (name, side), (base, speed) in ends)
        constraints = [
            *self.piece.constraints,
            *faces.values(),
            *moving,
            constraint.LinearConstraint.of({STRETCH: 1}, ">=", 0),
        ]
        best = simplex.maximize([*self.piece.parameters, STRETCH], constraints, {STRETCH: Fraction(-1)})
        return None if best is None or best.value is None else (-best.value, best.attained)

    def _is_kept_off(self, faces: Faces) -> bool:
        if self._between is not None and self._between.items() <= faces.items():
            return True
        solved = simplex.tableau(self.piece.parameters, self.piece.constraints)
        slacks = simplex.extend(solved, self.piece.parameters, faces.values())
        if solved.restore():
            return False
        needed = (face for face, slack in zip(faces, slacks, strict=True) if slack in solved.conflict)
        self._between = {face: faces[face] for face in needed}
        return True


@dataclass(frozen=True)
class _KnownBad:
    """Where shapes must not go: outside the region."""

    pieces: Sequence[_BadForShapes]

    def piece_in(self, box: Box, deadline: Deadline) -> Obstacle | None:
        for piece in self.pieces:
            deadline.enforce()
            if piece.meets(box):
                return cast("Obstacle", piece)
        return None


OCTAGON = "octagon"


def template_of(shape: str, names: Sequence[str]) -> list[Direction]:
    """The directions of an octagon, sums and differences of two parameters, or those in a file; and each parameter.

    A line of a file is a form such as `a + 2 b - 1/2 c`, with blanks between words; `#` begins a comment.

    Raises:
        InputError: at the line of a file that is no form over the parameters.
    """
    template: list[Direction] = [((name, Fraction(1)),) for name in names]
    if shape == OCTAGON:
        signs = product(combinations(names, 2), (-1, 1))
        return template + [((first, Fraction(1)), (second, Fraction(sign))) for (first, second), sign in signs]
    text = read_text(shape, expected="octagon, or a readable file of linear forms")
    for number, line in enumerate(text.split("\n"), start=1):
        place = Location(shape, number)
        if words := line.partition("#")[0].split():
            template.append(_direction(words, names, place))
    return template


def _direction(words: Sequence[str], names: Sequence[str], place: Location) -> Direction:
    form: dict[str, Fraction] = {}
    sign = factor = Fraction(1)
    for word in words:
        if word in {"+", "-"}:
            sign = Fraction(1 if word == "+" else -1)
        elif is_number(word):
            factor = parse_number(word, place)
        elif word in names:
            form[word] = form.get(word, Fraction(0)) + sign * factor
            sign = factor = Fraction(1)
        else:
            known = did_you_mean(word, names)
            raise InputError(f"found {shorten(word)}, expected parameters such as a + 2 b, with blanks{known}", place)
    direction = tuple((name, factor) for name, factor in form.items() if factor)
    if not direction or words[-1] not in names:
        raise InputError(f"found {shorten(' '.join(words))}, expected a form such as a + 2 b", place)
    return direction


def widened(
    template: Sequence[Direction],
    parameters: Sequence[Parameter],
    region: Region,
    box: Box,
    *,
    name: str,
    deadline: Deadline,
) -> Shape:
    """The widest shape of a template that contains a box and is inside a region, which contains the box.

    All faces move outwards at a speed in proportion to the weights of their parameters. No face can move farther alone.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    names = tuple(parameter.name for parameter in parameters)
    weight = {parameter.name: parameter.weight for parameter in parameters}
    directions = {signed_sum(direction, "-", str): direction for direction in template}
    forms = [
        Parameter(label, Fraction(0), sum((abs(factor) * weight[one] for one, factor in direction), Fraction(0)))
        for label, direction in directions.items()
    ]
    ((base, removed),) = region.as_difference().parts()
    beyond = (Polyhedron(names, (half,)) for side in base.constraints for half in side.negation())
    start = Box({label: box.values_of(direction, 0) for label, direction in directions.items()})
    found = [start]
    Widening(
        bad=_KnownBad([_BadForShapes(piece, directions) for piece in (*removed, *beyond)]),
        parameters=forms,
        pieces=[],
        groups=[[(label, side) for label, side in faces_of(forms) if start[label].end(side) is not None]],
        deadline=deadline,
        on_box=found.append,
        start=start,
    ).run()
    return Shape(name, names, directions, found[-1], region)
