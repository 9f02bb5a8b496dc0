"""The envelope of each independent group of parameters, from outside and from inside at the same time.

Parameters of which no obligation and no statement of the network speaks together are independent: the envelope is the
product of one set for each group, and each is searched alone. In a group, bad pieces are found obligation by
obligation. If that takes long, good cells are found in turn: around a point, the polyhedron beyond one side of each bad
piece that reaches into it, until no obligation can be broken in it; pieces found on the way are bad pieces like others.
When the pieces and the cells cover everything, both bounds are the envelope.

What is symmetric is searched where interchangeable parameters ascend, and pieces are lifted from there: to a polyhedron
around the piece of which every image is bad, so that the pieces of the whole space stay few. Bad pieces are also
widened where several obligations together leave no way out.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from math import factorial, prod

from robust.qe.box import Box, Interval
from robust.qe.conjunctions import Conjunction, half_space, linked, variables_of, without_spare
from robust.qe.constraint import ZERO, LinearConstraint
from robust.qe.eliminate.enumerate import ExclusionSession, PieceSearch, satisfiable
from robust.qe.eliminate.interface import Query, Solvers, outside
from robust.qe.estimate import POINTS, Judged, OpenShare, Samples, open_points, product_share, volumes
from robust.qe.nnf import Nnf, conjunction, disjunction, names_in, negation
from robust.qe.polyhedron import Point, Polyhedron
from robust.qe.region import LONG, Region, absorb
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
        self._base = base
        self._box = set(box_sides(base))
        self._failures = 0
        fine: list[Nnf] = []
        for query in queries:
            definitions = (definition.formula for definition in query.definitions)
            fine += [*query.network, *definitions, query.remainder, negation(query.violation)]
        self._fine = ExclusionSession(context, deadline, *fine)
        """Schedules that break nothing."""

    def exclude(self, piece: Conjunction) -> None:
        """The piece is known to be bad."""
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
        self._known = self._exclusion()
        self._covered = self._exclusion()

    def _exclusion(self) -> ExclusionSession:
        """What is left of the base."""
        return ExclusionSession(self._context, self._deadline, *self._base.constraints)

    def add(self, piece: Conjunction) -> None:
        """A piece that is bad in ascending order; lifted at once if that is quick."""
        self._known.exclude(piece)
        self._pieces.append(piece)
        if not self._covered.excludes(piece):
            images = self._first_images([piece, self._hull(piece)], SOME_IMAGES)
            self.lifted += self._cover(images or [])

    def finish(self) -> bool:
        """Lift the pieces that are needed, again; whether none of them has too many images."""
        self._covered = self._exclusion()
        kept: list[Conjunction] = []
        finished = True
        for piece in self._needed():
            if not self._covered.excludes(piece):
                ordered = (*self._symmetry.ascending, *piece)
                candidates = (self._minimal(sides) for sides in (piece, self._hull(piece), ordered))
                images = self._first_images(candidates, MOST_IMAGES)
                finished = finished and images is not None
                kept += self._cover(images or [])
        if finished:
            self.lifted = kept
        return finished

    def _needed(self) -> list[Conjunction]:
        """The pieces without those that others cover together; simple ones stay rather than others, and come first."""
        simple_first = sorted(self._pieces, key=lambda piece: (len(piece), len(variables_of(piece))))
        beyond = {piece: outside(piece) for piece in simple_first}
        everything = self._exclusion()
        return without_spare(
            simple_first,
            lambda piece, others: everything.excludes(piece, *(beyond[other] for other in others)),
            reversed(simple_first),
        )

    def _first_images(self, candidates: Iterable[Conjunction], most: int) -> list[Conjunction] | None:
        image_lists = (self._images(candidate, most) for candidate in candidates)
        return next((images for images in image_lists if images is not None), None)

    def _cover(self, images: list[Conjunction]) -> list[Conjunction]:
        for image in images:
            self._covered.exclude(image)
        return images

    def _hull(self, piece: Conjunction) -> Conjunction:
        """The sides of the box around a piece in ascending order, without those of the box around everything."""
        return tuple(side for side in box_sides(self._base.restricted(piece)) if side not in self._box)

    def _minimal(self, sides: Conjunction) -> Conjunction:
        """The sides without those that can be left out, tried one after the other."""
        return tuple(without_spare(sides, lambda _, others: self._images(tuple(others), MOST_IMAGES) is not None))

    def _images(self, candidate: Conjunction, most: int) -> list[Conjunction] | None:
        """All images if there are not too many, and all are bad."""
        images = self._symmetry.images(candidate, most)
        if images is None or not self._known.excludes((), disjunction(conjunction(image) for image in images)):
            return None
        return images


def box_sides(polyhedron: Polyhedron) -> list[LinearConstraint]:
    """The sides of the box around a polyhedron."""
    extents = polyhedron.bounding_box()
    return [LinearConstraint.false()] if extents is None else list(Box(extents).constraints())


PATIENCE = 20.0
"""Seconds of looking for bad pieces alone, or a third of the time limit; then as long for good cells, in turn."""
RADII = (Fraction(1, 8), Fraction(1), Fraction(8))
"""Half the widths of first boxes."""
SLICE = 1.0
"""Seconds for each of several groups in turn."""


def independent_groups(
    parameters: Sequence[str], queries: Sequence[Query], facets: Iterable[Conjunction]
) -> list[tuple[tuple[str, ...], tuple[Query, ...]]]:
    """Groups of parameters of which nothing speaks together, in the order of the parameters, with their queries.

    Values of one group neither decide whether those of another leave a schedule, which the `facets` say, nor whether
    one of its queries can be satisfied if they do. Queries without parameters belong to the first group.
    """
    spoken = {query.name: _names_of(query) for query in queries}
    home = linked(
        (
            *(variables_of(facet) for facet in facets),
            *(constraint.parameters for query in queries for constraint in query.network),
            *spoken.values(),
        )
    )
    groups: dict[frozenset[str], tuple[list[str], list[Query]]] = {}
    for name in parameters or ("",):
        groups.setdefault(home.get(name, frozenset({name})), ([], []))[0].append(name)
    for query in queries:
        homes = (home[name] for name in spoken[query.name])
        groups[next((group for group in homes if group in groups), next(iter(groups)))][1].append(query)
    return [(tuple(filter(None, names)), tuple(members)) for names, members in groups.values()]


def _names_of(query: Query) -> list[str]:
    """Unknowns that the query's violation depends on, by definitions or by itself."""
    definition = {definition.symbol: definition.formula for definition in query.definitions}
    names: set[str] = set()
    pending = set(names_in(query.core))
    while pending:
        name = pending.pop()
        names.add(name)
        if name in definition:
            pending |= names_in(definition[name]) - names
    return sorted(names - definition.keys())


@dataclass(frozen=True)
class EnvelopeFactor:
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

    def good_pieces(self) -> list[Conjunction]:
        """Polyhedra of good values in any order; those with too many images, or too many holes, are left out."""
        if self.inner.base is not None and len(self.inner.pieces) > LONG:
            return []
        image_lists = (self.symmetry.images(piece.constraints, MOST_IMAGES) for piece in self.inner.as_union().pieces)
        return [image for images in image_lists for image in images or ()]


def inner_region(parameters: tuple[str, ...], factors: Sequence[EnvelopeFactor], at: Point) -> Region:
    """The product of what is good in each group, as a union, with some parameters fixed.

    If that takes too many polyhedra it is only a part of the product.
    """
    rest = tuple(name for name in parameters if name not in at)
    products = [Polyhedron.universe(rest)] if factors else []
    for factor in factors:
        pieces = (Polyhedron(rest, tuple(side.substitute(at) for side in piece)) for piece in factor.good_pieces())
        solid = [piece for piece in pieces if not piece.is_empty]
        met = (product.intersection(piece) for product in products for piece in solid)
        products = list(islice((product for product in met if not product.is_empty), MOST_IMAGES))
    return Region.union_of(rest, absorb(products) if len(products) <= LONG else products)


def outer_side(piece: Polyhedron, point: Point) -> LinearConstraint:
    """The half-space outside of a piece whose side is farthest from a point outside."""
    outer = [half for constraint in piece.constraints for half in constraint.negation() if half.evaluate(point)]
    return max(outer, key=lambda half: (half.constant - half.value(point)) / sum(abs(c) for _, c in half.coefficients))


@dataclass(frozen=True)
class ParameterGroup:
    """What is to be found of one independent group of parameters.

    `queries` are its violations, among the values of `base`, which leave a schedule and are within the declared bounds.
    `known` is the complement of the base, in all parameters. The search begins at `nominal`.
    """

    parameters: tuple[str, ...]
    queries: tuple[Query, ...]
    base: Polyhedron
    known: tuple[Conjunction, ...]
    nominal: Point
    symmetry: Symmetry


@dataclass(eq=False)
class FactorSearch:
    """Finds bad pieces and good cells of one group.

    Args:
        context: the solvers.
        group: what is to be found.
        deadline: when to end.
        on_piece: called with each bad piece.
        on_cell: called with each good cell.
    """

    context: Solvers
    group: ParameterGroup
    deadline: Deadline
    on_piece: Callable[[Polyhedron], None]
    on_cell: Callable[[Polyhedron], None] | None

    def __post_init__(self) -> None:
        group, deadline = self.group, self.deadline
        self._parameters = group.parameters
        self.symmetry = group.symmetry
        self._pending = list(group.queries)
        self._base = group.base.restricted(group.symmetry.ascending)
        descending = [(half,) for side in group.symmetry.ascending for half in side.negation()]
        self._known = [*group.known, *descending]
        self._nominal = {name: group.nominal[name] for name in group.parameters}
        self._first: Point | None = group.symmetry.sorted(self._nominal)
        self._searches: dict[str, tuple[PieceSearch, int]] = {}
        self._pieces: list[Polyhedron] = []
        self.good: list[Polyhedron] = []
        self._widening = PieceWidening(self.context, self._base, group.queries, deadline)
        for piece in self._known:
            self._widening.exclude(piece)
        self._lifting = Lifting(self.context, self._base, group.symmetry, deadline) if group.symmetry else None
        self._samples: tuple[Polyhedron, Samples] | None = None
        remaining = deadline.remaining
        patience = PATIENCE if remaining is None else min(PATIENCE, remaining / 3)
        self._outside, self._inside = -patience, 0.0

    @property
    def bad(self) -> list[Conjunction]:
        """Bad where classes ascend."""
        return [piece.constraints for piece in self._pieces]

    @property
    def done(self) -> bool:
        """Whether the pieces are all that is bad."""
        return not self._pending

    def run(self) -> None:
        """Search for a time slice: first from outside, later in turn from inside.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        started = time.process_time()
        while not self.done and time.process_time() - started < SLICE:
            before = time.process_time()
            if self._outside <= self._inside:
                self.step()
                self._outside += time.process_time() - before
            else:
                self.grow()
                self._inside += time.process_time() - before

    def step(self) -> None:
        """Find one more piece, or close a query.

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
        search, count = self._searches.get(query.name) or (PieceSearch(self.context, query, self.deadline), -1)
        for piece in self._known if count < 0 else ():
            search.exclude(piece)
        for bad in self._pieces[max(count, 0) :]:
            search.exclude(bad.constraints)
        self._searches[query.name] = search, len(self._pieces)
        return search

    def _add(self, sides: Conjunction) -> Polyhedron:
        # The violation and the network's statements about another group say nothing of each other: what a piece says
        # of other groups is that they have a schedule, perhaps a certain one.
        mine = tuple(c for c in sides if not set(c.parameters).isdisjoint(self._parameters))
        mine = self._widening.widened(mine)
        self._widening.exclude(mine)
        piece = Polyhedron(self._parameters, mine)
        self._pieces.append(piece)
        if (half := half_space(mine)) is not None:
            self._base = self._base.restricted(half.negation())
        if self._samples is not None:
            self._samples[1].exclude(mine)
        self.on_piece(piece)
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
        """Find a cell of good values, or a bad piece, where nothing is known yet; if all is known, the search is done.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        point = self._open_point(self.samples)
        if point is None:
            self._pending.clear()
            return
        if not self.good and not self._is_bad(point):
            self._box_around(point)
        if not self._is_bad(point) and (cell := self._cell(point)) is not None:
            self._prove(cell)

    def _prove(self, cell: Polyhedron) -> None:
        self.good = [other for other in self.good if not other.is_subset_of(cell)]
        self.good.append(cell)
        self.samples.include(cell)
        if self.on_cell is not None:
            self.on_cell(cell)

    def _box_around(self, point: Point) -> None:
        """A first box of good values, which is proved sooner than a cell, because it decides
        more of what happens when, and grows as long as nothing bad reaches into it."""
        for radius in RADII:
            ends = {name: Interval(value - radius, value + radius) for name, value in point.items()}
            box = self._base.restricted(Box(ends).constraints())
            if any(not box.is_disjoint_from(piece) for piece in self._pieces) or self._piece_in(box) is not None:
                return
            self._prove(box)

    def _open_point(self, samples: Samples) -> Point | None:
        """The nominal point, if nothing is known of it; else a random one, or any; None if there is none."""
        first, self._first = self._first, None
        if first is not None and first in self._base and not self._is_bad(first):
            return first
        if samples.undecided:
            return samples.point(min(samples.undecided))
        reader, session = self.context.reader, self.context.session()
        session.add(*map(reader.write, self._base.constraints))
        for known in (*self._pieces, *self.good):
            session.add(reader.outside(known.constraints))
        if not satisfiable(session, "values of which nothing is known", self.deadline):
            return None
        values = session.values(reader.symbols(self._parameters))
        return {name: Fraction(values.get(name, 0)) for name in self._parameters}

    def _is_bad(self, point: Point) -> bool:
        return any(point in piece for piece in self._pieces)

    def _cell(self, point: Point) -> Polyhedron | None:
        """A good polyhedron around the point; None if the point is bad, which the pieces tell then."""
        cell, sides, known = self._base, [], iter([*self._pieces])
        while (piece := next(known, None) or self._piece_in(cell)) is not None:
            if not cell.is_disjoint_from(piece):
                if point in piece:
                    return None
                side = outer_side(piece, point)
                cell = cell.restricted([side])
                sides.append(side)
        return self._generalized(sides)

    def _piece_in(self, cell: Polyhedron) -> Polyhedron | None:
        """A new bad piece that reaches into a cell without known ones; None if the cell is good."""
        for query in self._pending:
            piece = self._search(query).next_piece(cell.constraints)
            if piece is not None:
                return self._add(piece)
        return None

    def _generalized(self, sides: list[LinearConstraint]) -> Polyhedron:
        """The cell without sides that it does not need: later ones may do what earlier ones were for."""

        def is_spare(_: LinearConstraint, others: list[LinearConstraint]) -> bool:
            wider = self._base.restricted(others)
            return all(wider.is_disjoint_from(piece) for piece in self._pieces) and self._piece_in(wider) is None

        return self._base.restricted(without_spare(sides, is_spare)).simplified()

    # -- how much is open ----------------------------------------------------------------------------------------------

    @property
    def samples(self) -> Samples:
        """Random points of the box."""
        if self._samples is None or self._samples[0] is not self._base:
            samples = Samples(self.box, self.symmetry)
            for constraint in self._base.constraints:
                for half in constraint.negation():
                    samples.exclude((half,))
            for piece in self._pieces:
                samples.exclude(piece.constraints)
            for cell in self.good:
                samples.include(cell)
            self._samples = self._base, samples
        return self._samples[1]

    def judged(self, *, draw: bool) -> tuple[Box, Judged] | None:
        """The box, and which of its random points are not bad, and which are good; None if none are to be drawn yet."""
        if self._samples is None and not draw:
            return None
        samples = self.samples if draw or self._samples is None else self._samples[1]
        possible = samples.undecided | samples.good
        return samples.box, (possible, possible if self.done else set(samples.good))

    @property
    def box(self) -> Box:
        """The smallest closed box around the base and its images.

        An end that is infinite by what is known is one around the nominal values, as far away again as these are from
        zero and twice.
        """
        extents = self._base.bounding_box() or {}
        ends = {}
        for name in self._parameters:
            orbit = self.symmetry.orbit(name)
            nominal = [self._nominal[other] for other in orbit]
            far = 2 * max(Fraction(1), *map(abs, nominal))
            known = [extents[other] for other in orbit if other in extents]
            lower = [end for end in (extent.lower for extent in known) if end is not None]
            upper = [end for end in (extent.upper for extent in known) if end is not None]
            least = min(lower) if len(lower) == len(orbit) else min([*nominal, *lower, *upper]) - far
            most = max(upper) if len(upper) == len(orbit) else max([*nominal, *lower, *upper]) + far
            ends[name] = Interval(least, most)
        return Box(ends)

    @property
    def volumes(self) -> tuple[Fraction, Fraction, Fraction] | None:
        """The volumes of the box, of what is not bad there, and of what is good; None where that takes too long."""
        whole = Polyhedron.of_box(self._parameters, self.box)
        inside = self._base.intersection(whole)
        good = [inside] if self.done else [inside.intersection(cell) for cell in self.good]
        sizes = volumes(inside, self.bad, good)
        if sizes is None:
            return None
        possible, proved = sizes[0], sizes[0] if self.done else sizes[1]
        orders = prod(factorial(len(names)) for names in self.symmetry.classes)
        return whole.volume() or ZERO, possible * orders, proved * orders

    def factor(self) -> EnvelopeFactor:
        """What is known of the group at the moment."""
        beyond = (piece for piece in self._pieces if half_space(piece.constraints) is None)
        outer = Region.difference(self._base, beyond)
        inner = outer if self.done else Region.union_of(self._parameters, self.good)
        return EnvelopeFactor(self._parameters, self.symmetry, outer, inner)


def open_share(factors: Sequence[FactorSearch], *, draw: bool = True) -> OpenShare | None:
    """How much of the product of the boxes is open, exactly where volumes are quick to compute; None if not known.

    Without `draw`, from random points that have been drawn already, which takes no time.
    """
    sizes = [size for factor in factors if draw and (size := factor.volumes) is not None]
    if factors and len(sizes) == len(factors):
        return product_share(sizes, _product(factor.box for factor in factors))
    judged = [share for factor in factors if (share := factor.judged(draw=draw)) is not None]
    if not judged or len(judged) < len(factors):
        return None
    return OpenShare.estimated(
        open_points([points for _, points in judged]), POINTS, _product(box for box, _ in judged)
    )


def _product(boxes: Iterable[Box]) -> Box:
    return Box({name: interval for box in boxes for name, interval in box.intervals.items()})
