"""Where each obligation breaks: all parameter values for which some schedule breaks it, obligation by obligation.

The search for the envelope stops at the first obligation that excludes a value. Here every one is enumerated by itself,
so that several can be named at one point. Where the network has no schedule, or a demand on durations over parameters
alone does not hold, nothing is said of other obligations: nothing else is to be examined there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

from robust.encode import create_encoding
from robust.encode.interface import EPSILON, Facet
from robust.encode.validity import Validity
from robust.plan.model import ParametrizedPlan, Relation
from robust.qe.compute import Existence, ProblemBuilder, declared_bounds
from robust.qe.conjunctions import Conjunction
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.enumerate import PieceSearch
from robust.qe.eliminate.interface import Context
from robust.qe.nnf import Reader
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline, OutOfTimeError

MOST = 1000
"""Polyhedra of all obligations together, after which the enumeration ends."""


@dataclass(frozen=True, slots=True)
class Broken:
    """Within the declared bounds, at every value in a piece that leaves a schedule, some schedule breaks `obligation`.

    A `demand` is one on durations over parameters alone; of other obligations pieces say nothing where one breaks.
    """

    obligation: str
    pieces: tuple[Polyhedron, ...]
    demand: bool


@dataclass(frozen=True, slots=True)
class Breaks:
    """What breaks where, in the order in which obligations are examined; all of it, if `complete`."""

    found: tuple[Broken, ...]
    complete: bool


def what_breaks(
    plan: ParametrizedPlan, *, epsilon: Fraction = EPSILON, solver: str = "z3", timeout: float | None = None
) -> Breaks:
    """Enumerate, obligation by obligation; out of time, or beyond :data:`MOST`, what was found by then.

    Raises:
        UnsupportedError: an expression that is not linear.
    """
    found: list[Broken] = []
    try:
        for one in _enumerated(plan, epsilon, solver, Deadline.after(timeout)):
            found.append(one)
            if sum(len(each.pieces) for each in found) > MOST:
                return Breaks(tuple(found), complete=False)
    except OutOfTimeError:
        return Breaks(tuple(found), complete=False)
    return Breaks(tuple(found), complete=True)


def _enumerated(plan: ParametrizedPlan, epsilon: Fraction, solver: str, deadline: Deadline) -> Iterator[Broken]:
    """Each obligation that can break, when all about it is known."""
    piece_of = partial(Polyhedron, tuple(parameter.name for parameter in plan.parameters))
    encoding = create_encoding("relational", plan, epsilon, deadline)
    context = Context(encoding.terms, Reader(encoding.terms), solver)
    builder = ProblemBuilder(encoding, context.reader, context.session())
    facets = encoding.validity.facets if isinstance(encoding.validity, Validity) else []
    demands: dict[str, list[Polyhedron]] = {}
    for facet in facets:
        if facet.obligation is not None:
            demands.setdefault(facet.obligation, []).extend(map(piece_of, beyond(facet)))
    yield from (Broken(name, tuple(pieces), demand=True) for name, pieces in demands.items())
    bounds = declared_bounds(plan)
    known: list[Conjunction] = [(half,) for bound in bounds for half in bound.negation()]
    known += Existence(encoding, context, builder.existence(), bounds).pieces(deadline)
    for obligation in encoding.obligations:
        if obligation.violation is encoding.terms.false or obligation.name in demands:
            continue
        search = PieceSearch(context, builder.query(obligation), deadline)
        for piece in known:
            search.exclude(piece)
        pieces: list[Polyhedron] = []
        while (found := search.next_piece()) is not None and len(pieces) <= MOST:
            search.exclude(found)
            pieces.append(piece_of(found))
        if pieces:
            yield Broken(obligation.name, tuple(pieces), demand=False)


def beyond(facet: Facet) -> Iterator[Conjunction]:
    """Half-spaces of values that a facet excludes."""
    side = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
    yield from [()] if side.is_false else [(half,) for half in side.negation()]
