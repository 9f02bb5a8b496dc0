"""Bad pieces made larger: by several obligations together, and from ascending order to any order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

from robust.qe.box import Box
from robust.qe.conjunctions import Conjunction, variables_of
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.enumerate import Outlook
from robust.qe.eliminate.interface import Query, Solvers, outside
from robust.qe.nnf import conjunction, disjunction, negation
from robust.qe.polyhedron import Polyhedron
from robust.qe.symmetry import Symmetry
from robust.smt.limits import Deadline

HOPELESS = 5
"""Pieces in a row that cannot be widened after which that is not tried any more."""
SOME_IMAGES, MOST_IMAGES = 300, 3000
"""Images of one piece that are described one by one: while pieces are looked for, and at the end."""


class PieceWidening:
    """Makes bad pieces larger where several obligations together leave no way out.

    In a piece some schedule breaks one obligation. Values of which every schedule breaks some obligation, whichever it
    is, are bad as well. Without a schedule values are bad too, so nothing need be known of that.
    """

    def __init__(self, context: Solvers, base: Polyhedron, queries: Sequence[Query], deadline: Deadline) -> None:
        self._context = context
        self._base = base
        self._box = set(box_sides(base))
        self._queries = queries
        self._deadline = deadline
        self._failures = 0
        self._excluded: list[Conjunction] = []

    @cached_property
    def _fine(self) -> Outlook:
        """Schedules that break nothing; opened once there is something to widen."""
        made = Outlook(self._context.session(), self._context.reader, self._deadline)
        for query in self._queries:
            definitions = (definition.formula for definition in query.definitions)
            made.add(*query.network, *definitions, query.remainder, negation(query.violation))
        for piece in self._excluded:
            made.exclude(piece)
        return made

    def exclude(self, piece: Conjunction) -> None:
        """The piece is known to be bad."""
        self._excluded.append(piece)
        if "_fine" in self.__dict__:
            self._fine.exclude(piece)

    def widened(self, piece: Conjunction) -> Conjunction:
        """A bad piece that holds this one: of its sides, and those of the box around it, as few as suffice."""
        if self._failures >= HOPELESS or len(variables_of(piece)) <= 1:
            return piece
        hull = (side for side in box_sides(self._base.restricted(piece)) if side not in self._box)
        sides = tuple(dict.fromkeys((*piece, *hull)))
        if not self._fine.excludes(sides):
            self._failures += 1
            return piece
        self._failures = 0
        return self._fine.generalize(sides)


class Lifting:
    """Makes pieces that are bad in ascending order into pieces that are bad in any order.

    A piece is lifted to a polyhedron around it of which every image, where classes ascend, is inside the known pieces.
    """

    def __init__(self, context: Solvers, base: Polyhedron, symmetry: Symmetry, deadline: Deadline) -> None:
        self._context = context
        self._deadline = deadline
        self._base = base
        self._box = set(box_sides(base))
        self._symmetry = symmetry
        self._pieces: list[Conjunction] = []
        self.lifted: list[Conjunction] = []
        self._known = self._outlook()
        self._covered = self._outlook()

    def _outlook(self) -> Outlook:
        """What is left of the base."""
        made = Outlook(self._context.session(), self._context.reader, self._deadline)
        made.add(*self._base.constraints)
        return made

    def add(self, piece: Conjunction) -> None:
        """A piece that is bad in ascending order; lifted at once if that is quick."""
        self._known.exclude(piece)
        self._pieces.append(piece)
        if not self._covered.excludes(piece):
            found = self._first_images([piece, self._hull(piece)], SOME_IMAGES)
            self.lifted += self._cover(found or [])

    def finish(self) -> bool:
        """Lift the pieces that are needed, again; whether none of them has too many images."""
        self._covered = self._outlook()
        kept: list[Conjunction] = []
        finished = True
        for piece in self._needed():
            if not self._covered.excludes(piece):
                ordered = (*self._symmetry.ascending, *piece)
                candidates = (self._minimal(sides) for sides in (piece, self._hull(piece), ordered))
                found = self._first_images(candidates, MOST_IMAGES)
                finished = finished and found is not None
                kept += self._cover(found or [])
        if finished:
            self.lifted = kept
        return finished

    def _needed(self) -> list[Conjunction]:
        """The pieces without those that others cover together; simple ones stay rather than others, and come first."""
        simple_first = sorted(self._pieces, key=lambda piece: (len(piece), len(variables_of(piece))))
        beyond = {piece: outside(piece) for piece in simple_first}
        everything = self._outlook()
        for piece in reversed(simple_first):
            others = [side for other, side in beyond.items() if other != piece]
            if everything.excludes(piece, *others):
                del beyond[piece]
        return list(beyond)

    def _first_images(self, candidates: Iterable[Conjunction], most: int) -> list[Conjunction] | None:
        found = (self._images(candidate, most) for candidate in candidates)
        return next((images for images in found if images is not None), None)

    def _cover(self, images: list[Conjunction]) -> list[Conjunction]:
        for image in images:
            self._covered.exclude(image)
        return images

    def _hull(self, piece: Conjunction) -> Conjunction:
        """The sides of the box around a piece in ascending order, without those of the box around everything."""
        return tuple(side for side in box_sides(self._base.restricted(piece)) if side not in self._box)

    def _minimal(self, sides: Conjunction) -> Conjunction:
        """As many of the sides left out as can be, one after the other."""
        for side in sides:
            others = tuple(other for other in sides if other is not side)
            if self._images(others, MOST_IMAGES) is not None:
                sides = others
        return sides

    def _images(self, candidate: Conjunction, most: int) -> list[Conjunction] | None:
        """All images if there are not too many, and all are bad."""
        found = self._symmetry.images(candidate, most)
        if found is None or not self._known.excludes((), disjunction(conjunction(image) for image in found)):
            return None
        return found


def box_sides(polyhedron: Polyhedron) -> list[LinearConstraint]:
    """The sides of the box around a polyhedron."""
    extents = polyhedron.bounding_box()
    return [LinearConstraint.false()] if extents is None else list(Box(extents).constraints())
