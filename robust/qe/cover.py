"""Whether a polyhedron is covered by others: by splitting it along their sides, or by asking a solver."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from robust.errors import SolverError
from robust.plan.model import ParameterReference
from robust.qe.polyhedron import Polyhedron
from robust.smt.session import Session, Verdict
from robust.smt.terms import Terms

SPLITS = 8
"""Splits after which a solver is asked: by then they have taken about as long as a query does (10 to 20 ms).

Points outside are nearly always found within a few splits; proofs that there are none may need very many.
"""


class OutOfWorkError(Exception):
    """The limit on the number of splits was reached."""


def outside(piece: Polyhedron, cover: Sequence[Polyhedron]) -> dict[str, Fraction] | None:
    """A point of the piece that no polyhedron of the cover contains; None if there is none."""
    try:
        return outside_by_splitting(piece, cover, limit=SPLITS)
    except OutOfWorkError:
        return outside_by_solver(piece, cover)


def outside_by_splitting(
    piece: Polyhedron, cover: Sequence[Polyhedron], *, limit: int | None = None
) -> dict[str, Fraction] | None:
    """As `outside`, by exact linear programming alone.

    Raises:
        OutOfWorkError: after `limit` splits.
    """
    if piece.is_empty:
        return None
    pending = [(piece, 0)]
    splits = 0
    while pending:
        current, position = pending.pop()
        while position < len(cover) and current.is_disjoint_from(cover[position]):
            position += 1
        if position == len(cover):
            return current.some_point()
        splits += 1
        if limit is not None and splits > limit:
            raise OutOfWorkError
        pending += [(rest, position + 1) for rest in current.minus(cover[position])]
    return None


def outside_by_solver(
    piece: Polyhedron, cover: Sequence[Polyhedron], *, solver: str = "z3"
) -> dict[str, Fraction] | None:
    """As `outside`, by one query in linear real arithmetic; the answer's point is checked exactly.

    Raises:
        SolverError: if the solver gives up or its point is wrong.
    """
    terms = Terms()
    session = Session(terms, solver=solver)
    session.add(piece.to_formula(terms), *(terms.negation(other.to_formula(terms)) for other in cover))
    match session.check("is a polyhedron covered by others"):
        case Verdict.UNSATISFIABLE:
            return None
        case Verdict.UNKNOWN:
            raise SolverError(f"{solver} could not decide whether a polyhedron is covered by {len(cover)} others")
        case Verdict.SATISFIABLE:
            values = session.values(terms.real(ParameterReference(name)) for name in piece.parameters)
            point = {name: Fraction(values.get(name, 0)) for name in piece.parameters}
            if point not in piece or any(point in other for other in cover):
                raise SolverError(f"{solver} returned a point that does not solve its query: {point}")
            return point
