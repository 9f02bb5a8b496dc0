"""Where each obligation breaks: all parameter values for which some schedule breaks it, obligation by obligation.

The search for the envelope stops at the first obligation that excludes a value. Here every one is enumerated by itself,
so that several can be named at one point. Where the network has no schedule, or a demand on durations over parameters
alone does not hold, nothing is said of other obligations: nothing else is to be examined there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from itertools import islice

from robust.encode import create_encoding
from robust.encode.interface import EPSILON, Facet, Obligation, Stage
from robust.encode.validity import Validity
from robust.plan.model import ParametrizedPlan, Relation
from robust.qe.compute import ProblemBuilder, beyond_bounds
from robust.qe.conjunctions import Conjunction
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate import create_eliminator
from robust.qe.eliminate.interface import Solvers
from robust.qe.nnf import FormulaReader
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline, OutOfTimeError

MOST = 1000
"""Polyhedra of all obligations together, after which the enumeration ends."""


@dataclass(frozen=True, slots=True)
class BrokenObligation:
    """Within the declared bounds, at every value in a piece that leaves a schedule, some schedule breaks `obligation`.

    A `demand` is one on durations over parameters alone; of other obligations pieces say nothing where one breaks.
    """

    obligation: str
    pieces: tuple[Polyhedron, ...]
    demand: bool


@dataclass(frozen=True, slots=True)
class Breaks:
    """What breaks where, in the order in which obligations are examined; all of it, if `complete`."""

    obligations: tuple[BrokenObligation, ...]
    complete: bool


def what_breaks(
    plan: ParametrizedPlan, *, epsilon: Fraction = EPSILON, solver: str = "z3", timeout: float | None = None
) -> Breaks:
    """Enumerate, obligation by obligation; out of time, or beyond :data:`MOST`, what was found by then.

    Raises:
        UnsupportedError: an expression that is not linear.
    """
    broken: list[BrokenObligation] = []
    try:
        for obligation in _enumerated(plan, epsilon, solver, Deadline.after(timeout)):
            broken.append(obligation)
            if sum(len(obligation.pieces) for obligation in broken) > MOST:
                return Breaks(tuple(broken), complete=False)
    except OutOfTimeError:
        return Breaks(tuple(broken), complete=False)
    return Breaks(tuple(broken), complete=True)


def _enumerated(
    plan: ParametrizedPlan, epsilon: Fraction, solver: str, deadline: Deadline
) -> Iterator[BrokenObligation]:
    """Each obligation that can break, when all about it is known."""
    piece_of = partial(Polyhedron, tuple(parameter.name for parameter in plan.parameters))
    causes = Causes(plan, epsilon, solver, deadline)
    demands = causes.demands()
    yield from (BrokenObligation(name, tuple(map(piece_of, halves)), demand=True) for name, halves in demands.items())
    known: list[Conjunction] = [*causes.outside, *causes.without_schedule()]
    for obligation in causes.obligations:
        if obligation.name not in demands:
            pieces = tuple(map(piece_of, islice(causes.pieces(obligation, known), MOST + 1)))
            if pieces:
                yield BrokenObligation(obligation.name, pieces, demand=False)


class Causes:
    """All that can go wrong with a plan, each by itself, as the parameter values with which it does.

    Raises:
        OutOfTimeError: whatever is asked, when the deadline passes.
        UnsupportedError: an expression that is not linear.
    """

    def __init__(self, plan: ParametrizedPlan, epsilon: Fraction, solver: str, deadline: Deadline) -> None:
        self.outside = beyond_bounds(plan)
        """Outside of declared bounds."""
        self._deadline = deadline
        self._encoding = create_encoding("relational", plan, epsilon, deadline)
        self._context = Solvers(self._encoding.terms, FormulaReader(self._encoding.terms), solver)
        self._builder = ProblemBuilder(self._encoding, self._context)

    def demands(self) -> dict[str, list[Conjunction]]:
        """Demands on durations over parameters alone do not hold, by obligation."""
        validity = self._encoding.validity
        demands: dict[str, list[Conjunction]] = {}
        for facet in validity.facets if isinstance(validity, Validity) else ():
            if facet.obligation is not None:
                demands.setdefault(facet.obligation, []).extend(beyond(facet))
        return demands

    def without_schedule(self) -> Iterator[Conjunction]:
        """There is no schedule."""
        return self._builder.without_schedule(self._deadline)

    @cached_property
    def obligations(self) -> list[Obligation]:
        """Those that can break in some schedule."""
        false = self._encoding.terms.false
        return [obligation for obligation in self._encoding.obligations if obligation.violation is not false]

    @cached_property
    def _durations_may_break(self) -> bool:
        """If so, there may be schedules and yet none with all that later obligations assume."""
        return any(obligation.stage is Stage.DURATION for obligation in self.obligations)

    def pieces(self, obligation: Obligation, known: Iterable[Conjunction]) -> Iterator[Conjunction]:
        """An obligation breaks in some schedule, but for what is known already."""
        query = self._builder.query(obligation, whole=self._durations_may_break)
        return create_eliminator("project", self._context).eliminate(query, known, self._deadline)


def beyond(facet: Facet) -> Iterator[Conjunction]:
    """Half-spaces of values that a facet excludes."""
    side = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
    yield from [()] if side.is_false else [(half,) for half in side.negation()]
