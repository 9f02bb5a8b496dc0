"""The exact robustness envelope of a plan [IRR §2; Cashmore et al. 2019], by any elimination back end.

The bad set is enumerated as a union of polyhedra and taken away from the declared parameter bounds. What is left after
some of the pieces is an outer bound of the envelope, and the envelope itself once the enumeration is complete.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction

from robust.encode.interface import EPSILON, Encoding, create_encoding
from robust.errors import InputError, did_you_mean
from robust.plan.model import ParametrizedPlan
from robust.qe.eliminate.conjunctions import Conjunction
from robust.qe.eliminate.enumerate import polyhedra_of
from robust.qe.eliminate.interface import Context, Eliminator, Query, create_eliminator, outside, require_eliminator
from robust.qe.existence import Existence
from robust.qe.nnf import FALSE, Reader, conjunction, disjunction
from robust.qe.polyhedron import Polyhedron
from robust.qe.problem import Problem, ProblemBuilder, Splitting, declared_bounds
from robust.qe.region import Region
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.statistics import Statistics


class RegionStatus(Enum):
    """How an enumeration ended: the region is the envelope if COMPLETE, and an outer bound of it otherwise."""

    COMPLETE = "complete"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class RegionResult:
    """The robustness envelope and how it was computed.

    `region` is the envelope itself where `status` is COMPLETE; otherwise every point of the envelope is in it, but not
    every point of it is in the envelope. `pieces` counts the polyhedra of bad values that were found.
    """

    status: RegionStatus
    region: Region
    backend: str
    splitting: str
    learning: bool
    encoding: str
    solver: str
    seconds: float
    pieces: int
    statistics: Statistics = field(default_factory=Statistics)

    @property
    def is_exact(self) -> bool:
        return self.status is RegionStatus.COMPLETE

    @property
    def meaning(self) -> str:
        """What the region is, in a sentence."""
        if self.is_exact:
            return "the robustness envelope"
        reason = "the time limit" if self.status is RegionStatus.TIMEOUT else "an interruption"
        return f"an outer bound of the robustness envelope: {reason} ended the enumeration of bad parameter values"


def region(
    plan: ParametrizedPlan,
    *,
    backend: str = "project",
    splitting: str = "full",
    learning: bool = True,
    epsilon: Fraction = EPSILON,
    solver: str = "z3",
    encoding: str = "relational",
    timeout: float | None = None,
    on_piece: Callable[[Polyhedron], None] | None = None,
) -> RegionResult:
    """All parameter values under which the plan is valid, exactly.

    Args:
        plan: the plan, see :func:`robust.plan.load.load_plan`.
        backend: `project`, `fourier-motzkin`, `loos-weispfenning`, `z3`, `z3-qe`, `cvc5` or `cvc5-whole`.
        splitting: `monolithic`, `partial` or `full`, see :mod:`robust.qe.problem`.
        learning: tell later problems what earlier ones have excluded.
        epsilon: the separation of mutex time points.
        solver: `z3` or `cvc5`, for the queries of our own back ends.
        encoding: `relational` or `positions`.
        timeout: seconds after which what has been found is returned with status TIMEOUT; None never.
        on_piece: called with each polyhedron of bad parameter values when it is found.

    Returns:
        The envelope, or, out of time or after Ctrl-C, an outer bound of it.

    Raises:
        InputError: wrong options.
        UnsupportedError: an expression that is not linear, or one that the back end cannot handle.
        SolverError: a solver is not installed.
    """
    require_eliminator(backend)
    splittings = [one.value for one in Splitting]
    if splitting not in splittings:
        raise InputError(f"unknown splitting {splitting!r}{did_you_mean(splitting, splittings)}")
    started = time.perf_counter()
    deadline = Deadline.after(timeout)
    statistics = Statistics()
    parameters = tuple(parameter.name for parameter in plan.parameters)
    found = _Found(parameters, declared_bounds(plan), on_piece)
    status = RegionStatus.COMPLETE
    try:
        formulas = create_encoding(encoding, plan, epsilon, deadline)
        context = Context(formulas.terms, Reader(formulas.terms), solver, statistics)
        computation = _Computation(formulas, context, create_eliminator(backend, context), learning, found)
        computation.run(Splitting(splitting), deadline)
    except OutOfTimeError:
        status = RegionStatus.TIMEOUT
    except KeyboardInterrupt:
        status = RegionStatus.INTERRUPTED
    return RegionResult(
        status,
        found.region(),
        backend,
        splitting,
        learning,
        encoding,
        solver,
        time.perf_counter() - started,
        len(found.pieces),
        statistics,
    )


class _Found:
    """The bad set so far."""

    def __init__(
        self, parameters: tuple[str, ...], bounds: Conjunction, on_piece: Callable[[Polyhedron], None] | None
    ) -> None:
        self._parameters = parameters
        self._on_piece = on_piece
        self.bounds = bounds
        self.pieces: list[Conjunction] = []

    def add(self, piece: Conjunction) -> None:
        self.pieces.append(piece)
        if self._on_piece is not None:
            self._on_piece(Polyhedron(self._parameters, piece))

    def region(self) -> Region:
        """The bounds without the pieces; half-spaces among these become sides of the polyhedron to subtract from."""
        others = [piece for piece in self.pieces if len(piece) != 1 or piece[0].is_equality]
        sides = [piece[0].negation()[0] for piece in self.pieces if len(piece) == 1 and not piece[0].is_equality]
        base = Polyhedron(self._parameters, (*self.bounds, *sides)).simplified()
        return Region.difference(base, (Polyhedron(self._parameters, piece) for piece in others))


class _Computation:
    """One run over the problems of a plan."""

    def __init__(
        self, encoding: Encoding, context: Context, eliminator: Eliminator, learning: bool, found: _Found
    ) -> None:
        self._encoding = encoding
        self._context = context
        self._eliminator = eliminator
        self._learning = learning
        self._found = found

    def run(self, splitting: Splitting, deadline: Deadline) -> None:
        builder = ProblemBuilder(self._encoding, self._context.reader, self._context.session())
        problem = builder.build(splitting)
        if splitting is Splitting.MONOLITHIC:
            self._run_monolithic(problem, deadline)
            return
        self._add(self._existence(problem, deadline))
        for query in problem.violations:
            self._add(self._eliminator.eliminate(query, self._known(), deadline))

    def _run_monolithic(self, problem: Problem, deadline: Deadline) -> None:
        nothing = Query("no obligation", problem.parameters, (), FALSE)
        query = problem.violations[0] if problem.violations else nothing
        if self._eliminator.alternation:
            self._add(self._eliminator.eliminate_nested(query, problem.exists, deadline))
            return
        # Only one quantifier at a time: the inner one goes first, and its result becomes part of the outer formula.
        beyond = disjunction(conjunction(piece) for piece in self._existence(problem, deadline))
        whole = Query(
            "the whole envelope",
            query.kept,
            query.network,
            disjunction((beyond, conjunction((query.violation, query.remainder)))),
            query.definitions,
        )
        self._add(self._eliminator.eliminate(whole, self._known(), deadline))

    def _existence(self, problem: Problem, deadline: Deadline) -> Iterator[Conjunction]:
        """The bad values that leave no schedule."""
        if self._eliminator.name == "project":
            return Existence(self._encoding, self._context, problem.exists, problem.bounds).pieces(deadline)
        return self._complement(self._eliminator.eliminate(problem.exists, (), deadline), deadline)

    def _complement(self, pieces: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        """What none of the pieces covers, within the declared bounds."""
        covered = list(pieces)
        rest = conjunction(outside(piece) for piece in covered)
        return polyhedra_of(rest, self._context.session, self._context.reader, deadline, self._beyond_bounds())

    def _known(self) -> list[Conjunction]:
        """What a problem need not describe again."""
        return [*self._beyond_bounds(), *self._found.pieces] if self._learning else []

    def _beyond_bounds(self) -> list[Conjunction]:
        return [(half,) for bound in self._found.bounds for half in bound.negation()]

    def _add(self, pieces: Iterable[Conjunction]) -> None:
        for piece in pieces:
            self._found.add(piece)
