"""The envelope from outside and from inside at the same time, group by group.

Parameters of which no obligation and no statement of the network speaks together are independent: the envelope is the
product of one set for each group, and each is searched alone. In a group, bad pieces are found obligation by obligation.
If that takes long, good cells are found in turn: around a point, the polyhedron beyond one side of each bad piece that
reaches into it, until no obligation can be broken in it; each piece that is found on the way is a bad piece like others.
When the pieces and the cells cover everything, both bounds are the envelope.

What is symmetric is searched where interchangeable parameters ascend, and pieces are lifted from there: to a polyhedron
around the piece of which every image is bad, so that the pieces of the whole space stay few.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import factorial, prod

from robust.qe.box import Box, Interval
from robust.qe.conjunctions import Conjunction, variables_of
from robust.qe.constraint import ZERO, LinearConstraint
from robust.qe.eliminate.enumerate import Outlook, PieceSearch, satisfiable
from robust.qe.eliminate.interface import Context, Query
from robust.qe.nnf import conjunction, disjunction, names_in, negation
from robust.qe.polyhedron import Point, Polyhedron
from robust.qe.region import Region
from robust.qe.share import POINTS, Judged, OpenShare, Samples, open_points, product_share, volumes
from robust.qe.symmetry import Symmetry
from robust.smt.limits import Deadline

import os
HOPELESS = 5
"""Pieces in a row that cannot be widened after which that is not tried any more."""
PATIENCE = float(os.environ.get("PATIENCE","2"))
"""Seconds of looking for bad pieces alone; then as long for good cells, in turn."""
SOME_IMAGES = 300
IMAGES = 3000
"""Images of one piece that are described one by one: while pieces are looked for, and at the end."""


def independent_groups(
    parameters: Sequence[str], queries: Sequence[Query], facets: Iterable[Conjunction]
) -> list[tuple[tuple[str, ...], list[Query]]]:
    """Groups of parameters of which nothing speaks together, in the order of the parameters, with their queries.

    Values of one group neither decide whether those of another leave a schedule, which the `facets` say, nor whether
    one of its queries can be satisfied if they do. Queries without parameters belong to the first group.
    """
    joined: dict[str, str] = {}

    def root(name: str) -> str:
        while joined.setdefault(name, name) != name:
            name = joined[name]
        return name

    def join(names: Iterable[str]) -> None:
        roots = [root(name) for name in names]
        for one in roots:
            joined[root(one)] = root(roots[0])

    for facet in facets:
        join(name for constraint in facet for name in constraint.parameters)
    spoken = {query.name: _names_of(query) for query in queries}
    for query in queries:
        for constraint in query.network:
            join(constraint.parameters)
        join(spoken[query.name])
    groups: dict[str, tuple[list[str], list[Query]]] = {}
    for name in parameters:
        groups.setdefault(root(name), ([], []))[0].append(name)
    for query in queries:
        roots = (root(name) for name in spoken[query.name])
        home = next((one for one in roots if one in groups), next(iter(groups), None))
        if home is None:
            groups[""] = ([], [])
        groups["" if home is None else home][1].append(query)
    return [(tuple(names), found) for names, found in groups.values()] or [((), [])]


def _names_of(query: Query) -> list[str]:
    """Unknowns that the query's violation depends on, by definitions or by itself."""
    definition = {one.symbol: one.formula for one in query.definitions}
    found: set[str] = set()
    pending = set(names_in(query.core))
    while pending:
        name = pending.pop()
        found.add(name)
        if name in definition:
            pending |= names_in(definition[name]) - found
    return sorted(found - definition.keys())


@dataclass(frozen=True)
class Factor:
    """What is known of the values of one independent group of parameters, where the classes of `symmetry` ascend.

    `outer` holds all good values there, and all of `inner` are good. Values elsewhere are what their images in
    ascending order are.
    """

    parameters: tuple[str, ...]
    symmetry: Symmetry
    outer: Region
    inner: Region

    def is_possible(self, point: Point) -> bool:
        """Whether the point is not known to be bad."""
        return self._sorted(point) in self.outer

    def is_proved(self, point: Point) -> bool:
        """Whether the point is known to be good."""
        return self._sorted(point) in self.inner

    def _sorted(self, point: Point) -> dict[str, Fraction]:
        return self.symmetry.sorted({name: Fraction(point[name]) for name in self.parameters})


class Widening:
    """Makes bad pieces larger where several obligations together leave no way out.

    A piece has one obligation that some schedule breaks. Values of which every schedule breaks some obligation, whichever
    it is, are bad as well. Without a schedule values are bad too, so nothing need be known of that.
    """

    def __init__(self, context: Context, base: Polyhedron, queries: Sequence[Query], deadline: Deadline) -> None:
        self._context = context
        self._base = base
        self._box = set(_box_sides(base))
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
        hull = (side for side in _box_sides(self._base.restricted(piece)) if side not in self._box)
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

    def __init__(self, context: Context, base: Polyhedron, symmetry: Symmetry, deadline: Deadline) -> None:
        self._context = context
        self._deadline = deadline
        self._base = base
        self._box = set(_box_sides(base))
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
            self._lift([piece, self._hull(piece)], SOME_IMAGES)

    def finish(self) -> bool:
        """Lift all that is not yet covered, as far as that takes no more than so many images; whether all is."""
        # Few and short pieces have few images: those that all simpler ones together cover need none.
        simple = self._outlook()
        finished = True
        for piece in sorted(self._pieces, key=lambda one: (len(one), len(variables_of(one)))):
            if not simple.excludes(piece):
                finished = self._finished(piece) and finished
                simple.exclude(piece)
        return finished

    def _finished(self, piece: Conjunction) -> bool:
        if self._covered.excludes(piece):
            return True
        ordered = (*self._symmetry.ascending, *piece)
        candidates = (self._minimal(sides) for sides in (piece, self._hull(piece), ordered))
        return self._lift(candidates, IMAGES)

    def _lift(self, candidates: Iterable[Conjunction], most: int) -> bool:
        for candidate in candidates:
            found = self._images(candidate, most)
            if found is not None:
                for image in found:
                    self._covered.exclude(image)
                self.lifted += found
                return True
        return False

    def _hull(self, piece: Conjunction) -> Conjunction:
        """The sides of the box around a piece in ascending order, without those of the box around everything."""
        return tuple(side for side in _box_sides(self._base.restricted(piece)) if side not in self._box)

    def _minimal(self, sides: Conjunction) -> Conjunction:
        """As many of the sides left out as can be, one after the other."""
        for side in sides:
            others = tuple(other for other in sides if other is not side)
            if self._images(others, IMAGES) is not None:
                sides = others
        return sides

    def _images(self, candidate: Conjunction, most: int) -> list[Conjunction] | None:
        """All images if there are not too many, and all are bad."""
        found = self._symmetry.images(candidate, most)
        if found is None or not self._known.excludes((), disjunction(conjunction(image) for image in found)):
            return None
        return found


def _box_sides(polyhedron: Polyhedron) -> list[LinearConstraint]:
    """The sides of the box around a polyhedron."""
    extents = polyhedron.bounding_box()
    return [LinearConstraint.false()] if extents is None else list(Box(extents).constraints())


def _side(piece: Polyhedron, point: Point) -> LinearConstraint:
    """The half-space outside of a piece whose side is farthest from a point outside."""
    outer = [half for constraint in piece.constraints for half in constraint.negation() if half.evaluate(point)]
    return max(outer, key=lambda half: (half.constant - half.value(point)) / sum(abs(c) for _, c in half.coefficients))


class FactorSearch:
    """Finds bad pieces and good cells of one group.

    Args:
        context: the solvers.
        parameters: of the group.
        queries: its violations.
        base: values of the group that leave a schedule, within the declared bounds.
        known: what no query needs to speak of; together the complement of the base, in all parameters.
        nominal: a point to begin with.
        deadline: when to end.
        on_piece: called with each bad piece.
        symmetry: of the group.
    """

    def __init__(
        self,
        context: Context,
        parameters: tuple[str, ...],
        queries: Sequence[Query],
        base: Polyhedron,
        known: Sequence[Conjunction],
        nominal: Point,
        deadline: Deadline,
        on_piece: Callable[[Polyhedron], None],
        symmetry: Symmetry,
    ) -> None:
        self._context = context
        self._parameters = parameters
        self._pending = list(queries)
        self._base = base.restricted(symmetry.ascending)
        descending = [(half,) for side in symmetry.ascending for half in side.negation()]
        self._known = [*known, *descending]
        self.symmetry = symmetry
        self._first: Point | None = symmetry.sorted({name: nominal[name] for name in parameters})
        self._deadline = deadline
        self._on_piece = on_piece
        self._searches: dict[str, tuple[PieceSearch, int]] = {}
        self._pieces: list[Polyhedron] = []
        self.good: list[Polyhedron] = []
        self._widening = Widening(context, self._base, queries, deadline)
        for piece in self._known:
            self._widening.exclude(piece)
        self._lifting = Lifting(context, self._base, symmetry, deadline) if symmetry else None
        self._samples: tuple[Polyhedron, Samples | None] | None = None
        self._outside = self._inside = 0.0

    @property
    def bad(self) -> list[Conjunction]:
        """Bad where classes ascend."""
        return [piece.constraints for piece in self._pieces]

    @property
    def done(self) -> bool:
        """Whether the pieces are all that is bad."""
        return not self._pending

    def run(self) -> None:
        """For a while, from outside; after some of those, as long from inside.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        started = time.perf_counter()
        while not self.done and time.perf_counter() - started < PATIENCE:
            before = time.perf_counter()
            if self._outside - PATIENCE < self._inside:
                self.step()
                self._outside += time.perf_counter() - before
            else:
                self.grow()
                self._inside += time.perf_counter() - before

    def step(self) -> None:
        """One more piece, or one query fewer.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        query = self._pending[0]
        piece = self._search(query).next_piece()
        if piece is None:
            self._pending.pop(0)
            del self._searches[query.name]
        else:
            self._add(piece)

    def _search(self, query: Query) -> PieceSearch:
        """The search for violations of a query, which knows all pieces."""
        search, told = self._searches.get(query.name) or (PieceSearch(self._context, query, self._deadline), -1)
        for piece in self._known if told < 0 else ():
            search.exclude(piece)
        for known in self._pieces[max(told, 0) :]:
            search.exclude(known.constraints)
        self._searches[query.name] = search, len(self._pieces)
        return search

    def _add(self, found: Conjunction) -> Polyhedron:
        # The violation and the network's statements about another group say nothing of each other: what a piece says
        # of other groups is that they have a schedule, perhaps a certain one.
        mine = tuple(c for c in found if not set(c.parameters).isdisjoint(self._parameters))
        mine = self._widening.widened(mine)
        self._widening.exclude(mine)
        piece = Polyhedron(self._parameters, mine)
        self._pieces.append(piece)
        if len(mine) == 1 and not mine[0].is_equality:
            self._base = self._base.restricted(mine[0].negation())
        if self._samples is not None and self._samples[1] is not None:
            self._samples[1].exclude(mine)
        self._on_piece(piece)
        if self._lifting is not None:
            self._lifting.add(mine)
        return piece

    @property
    def lifted(self) -> list[Conjunction]:
        """What is bad wherever it is."""
        return self.bad if self._lifting is None else self._lifting.lifted

    def lift(self) -> bool:
        """Whether what is bad could be described without an order of parameters.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        return self._lifting is None or self._lifting.finish()

    # -- cells ---------------------------------------------------------------------------------------------------------

    def grow(self) -> None:
        """A cell of good values where nothing is known yet, or a bad piece; if all is known, the search is done.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        point = self._open_point()
        if point is None:
            self._pending.clear()
            return
        found = self._cell(point)
        if found is not None:
            self.good.append(found)
            if self.samples is not None:
                self.samples.include(found)

    def _open_point(self) -> Point | None:
        """The nominal point, if nothing is known of it; else a random one, or any; None if there is none."""
        first, self._first = self._first, None
        if first is not None and first in self._base and not self._is_known(first):
            return first
        samples = self.samples
        if samples is not None and samples.undecided:
            return samples.point(min(samples.undecided))
        reader, session = self._context.reader, self._context.session()
        session.add(*(reader.write(constraint) for constraint in self._base.constraints))
        for known in (*self._pieces, *self.good):
            session.add(reader.outside(known.constraints))
        if not satisfiable(session, "values of which nothing is known", self._deadline):
            return None
        values = session.values(reader.symbols(self._parameters))
        return {name: Fraction(values.get(name, 0)) for name in self._parameters}

    def _is_known(self, point: Point) -> bool:
        return any(point in known for known in (*self._pieces, *self.good))

    def _cell(self, point: Point) -> Polyhedron | None:
        """A good polyhedron around the point; None if the point is bad, which the pieces tell then."""
        cell, sides = self._base, []
        for piece in [*self._pieces]:
            if not cell.is_disjoint_from(piece):
                side = _side(piece, point)
                cell = cell.restricted([side])
                sides.append(side)
        while (found := self._piece_in(cell)) is not None:
            if point in found:
                return None
            side = _side(found, point)
            cell = cell.restricted([side])
            sides.append(side)
        return self._generalized(sides)

    def _piece_in(self, cell: Polyhedron) -> Polyhedron | None:
        """A new bad piece that reaches into a cell without known ones; None if the cell is good."""
        for query in self._pending:
            found = self._search(query).next_piece(cell.constraints)
            if found is not None:
                return self._add(found)
        return None

    def _generalized(self, sides: list[LinearConstraint]) -> Polyhedron:
        """The cell without sides that it does not need: later ones may do what earlier ones were for."""
        for side in [*sides]:
            others = [other for other in sides if other is not side]
            wider = self._base.restricted(others)
            if all(wider.is_disjoint_from(piece) for piece in self._pieces) and self._piece_in(wider) is None:
                sides = others
        return self._base.restricted(sides).simplified()

    # -- how much is open ----------------------------------------------------------------------------------------------

    @property
    def samples(self) -> Samples | None:
        """Random points of the box around the base; None if it has none."""
        if self._samples is None or self._samples[0] is not self._base:
            box = self.box
            samples = None
            if box is not None:
                samples = Samples(box, self.symmetry)
                for constraint in self._base.constraints:
                    for half in constraint.negation():
                        samples.exclude((half,))
                for piece in self._pieces:
                    samples.exclude(piece.constraints)
                for cell in self.good:
                    samples.include(cell)
            self._samples = self._base, samples
        return self._samples[1]

    def judged(self, *, drawn: bool) -> Judged | None:
        """Which random points are not bad, and which are good; None if there are none, or none yet if `drawn`."""
        samples = (self._samples or (None, None))[1] if drawn else self.samples
        if samples is None:
            return None
        possible = samples.undecided | samples.good
        return possible, possible if self.done else samples.good

    @property
    def box(self) -> Box | None:
        """The smallest box around the base and its images, closed; None if it is infinite, or the base is empty."""
        extents = self._base.bounding_box()
        if extents is None:
            return None
        ends = {}
        for name in self._parameters:
            lower = [extents[other].lower for other in self.symmetry.orbit(name)]
            upper = [extents[other].upper for other in self.symmetry.orbit(name)]
            known = [end for end in (*lower, *upper) if end is not None]
            if len(known) < len(lower) + len(upper):
                return None
            ends[name] = Interval(min(known), max(known))
        return Box(ends)

    @property
    def volumes(self) -> tuple[Fraction, Fraction, Fraction] | None:
        """Of the box around the base, of what is not bad, and of what is good; None where that takes too long."""
        box = self.box
        found = None if box is None else volumes(self._base, self.bad, [self._base] if self.done else self.good)
        if box is None or found is None:
            return None
        orders = Fraction(prod(factorial(len(names)) for names in self.symmetry.classes))
        whole = Polyhedron.of_box(self._parameters, box).volume() or ZERO
        return whole, found[0] * orders, found[0 if self.done else 1] * orders

    def factor(self) -> Factor:
        """What is known by now."""
        outer = Region.difference(self._base, self._pieces)
        inner = outer if self.done else Region.union_of(self._parameters, self.good)
        return Factor(self._parameters, self.symmetry, outer, inner)


def open_share(factors: Sequence[FactorSearch], *, drawn: bool = False) -> OpenShare | None:
    """How much of the box around all bases is open; None if it is not bounded.

    Exactly where volumes are quick to compute; not if only what has been `drawn` already is to be counted.
    """
    sizes = [] if drawn else [factor.volumes for factor in factors]
    exact = [size for size in sizes if size is not None]
    boxes = [factor.box for factor in factors]
    known = [box for box in boxes if box is not None]
    if not factors or len(known) < len(boxes):
        return None
    box = Box({name: interval for one in known for name, interval in one.intervals.items()})
    if len(exact) == len(factors):
        return product_share(exact, box)
    judged = [factor.judged(drawn=drawn) for factor in factors]
    found = [one for one in judged if one is not None]
    return OpenShare.estimated(open_points(found), POINTS, box) if len(found) == len(factors) else None
