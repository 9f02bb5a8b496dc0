"""The parameter values that leave no schedule, facet by facet.

enc_valid is convex: each of its facets is a cycle of the network, and the values beyond one facet are one piece of the
bad set. Facets are asked for boxes around what is left; where a box is too coarse to tell, single points that are left
decide, and those that leave a schedule are generalised by projecting the network at that schedule [as Loos and
Weispfenning 1993 would], so that the search ends without ever describing enc_valid as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction

from robust.encode.interface import Encoding, Facet
from robust.encode.variables import Range
from robust.plan.model import Relation
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.conjunctions import Conjunction, project_at
from robust.qe.eliminate.enumerate import model_of, satisfiable
from robust.qe.eliminate.interface import Context, Query
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict


class Existence:
    """Finds what lies outside enc_valid.

    Args:
        encoding: the plan's formulas; its `validity` may report facets that are duration obligations as well.
        context: the solvers.
        query: ∃ times. enc_tn.
        bounds: the declared parameter bounds.
    """

    def __init__(self, encoding: Encoding, context: Context, query: Query, bounds: Conjunction) -> None:
        self._encoding = encoding
        self._context = context
        self._query = query
        self._left = Polyhedron(query.kept, bounds)

    def pieces(self, deadline: Deadline) -> Iterator[Conjunction]:
        """Half-spaces of bad values that together hold every value that leaves no schedule, within the bounds.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        while not self._left.is_empty:
            deadline.enforce()
            facet = self._facet(self._box(), deadline)
            if facet is None:
                return
            inside = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
            if self._left.satisfies(inside):
                yield from self._by_points(deadline)
                return
            yield from self._cut(inside)

    def _cut(self, inside: LinearConstraint) -> Iterator[Conjunction]:
        self._left = self._left.restricted([inside])
        yield tuple(inside.negation()) if not inside.is_false else ()

    def _box(self) -> dict[str, Range]:
        extents = self._left.bounding_box() or {}
        return {name: (extent.lower, extent.upper) for name, extent in extents.items()}

    def _facet(self, ranges: Mapping[str, Range], deadline: Deadline) -> Facet | None:
        found = self._encoding.validity.broken_facet(ranges, self._context.session, deadline)
        if isinstance(found, Verdict):
            raise OutOfTimeError
        return found

    def _by_points(self, deadline: Deadline) -> Iterator[Conjunction]:
        reader = self._context.reader
        session = self._context.session()
        network = self._context.session()
        network.add(reader.write(self._query.formula))
        for constraint in self._left.constraints:
            session.add(reader.write(constraint))
        while satisfiable(session, "enc_valid: a point that is left", deadline):
            values = model_of(session, reader, self._query.kept)
            point = {name: Fraction(values.get(name, 0)) for name in self._query.kept}
            facet = self._facet({name: (value, value) for name, value in point.items()}, deadline)
            if facet is not None:
                inside = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
                session.add(reader.write(inside))
                yield from self._cut(inside)
            else:
                session.add(reader.outside(self._around(point, network, deadline)))

    def _around(self, point: Mapping[str, Fraction], network: Session, deadline: Deadline) -> Conjunction:
        """Parameter values that leave a schedule, the point's among them."""
        reader = self._context.reader
        fixed = (LinearConstraint.of({name: 1}, "=", value) for name, value in point.items())
        with network.frame(*(reader.write(constraint) for constraint in fixed)):
            if not satisfiable(network, "enc_tn at a point", deadline):
                raise AssertionError("the network has no schedule at a point where no facet breaks")
            values = model_of(network, reader, self._query.eliminated)
        model = {**point, **{name: Fraction(values.get(name, 0)) for name in self._query.eliminated}}
        return project_at(self._query.network, self._query.eliminated, model)
