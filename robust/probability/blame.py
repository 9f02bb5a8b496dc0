"""What takes the failing values of random parameters: each is counted for the first thing that goes wrong with it.

First come declared bounds, then demands on durations, then whether there is a schedule at all, then every other
obligation in the order in which they are examined: the same values may break several, but are counted once, so that
shares add up. What breaks an obligation is enumerated apart from what breaks those before it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from robust.plan.model import ParametrizedPlan
from robust.probability.distributions import Distribution
from robust.probability.measure import Bounds, Measure, box_probability
from robust.qe.box import Box
from robust.qe.broken import Causes
from robust.qe.compute import declared_bounds
from robust.qe.conjunctions import Conjunction
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline

DECLARED = "declared bounds"
NO_SCHEDULE = "no schedule"
NOTHING = Bounds(Fraction(0), Fraction(0))


@dataclass(frozen=True, slots=True)
class Share:
    """How much of the probability an obligation takes, by its name, as the first that breaks."""

    name: str
    probability: Bounds


@dataclass
class Broken:
    """What breaks an obligation first: `pieces` without `earlier`; all of it, if it is `complete`."""

    name: str
    earlier: tuple[Polyhedron, ...]
    pieces: list[Polyhedron] = field(default_factory=list)
    complete: bool = False
    bounds: Bounds | None = None


class Attribution:
    """Finds the shares, obligation by obligation.

    Args:
        plan: the plan.
        distributions: of its parameters.
        epsilon: the separation of mutex time points.
        solver: `z3` or `cvc5`.
        deadline: when to stop.
    """

    def __init__(
        self,
        plan: ParametrizedPlan,
        distributions: Mapping[str, Distribution],
        *,
        epsilon: Fraction,
        solver: str,
        deadline: Deadline,
    ) -> None:
        self._plan = plan
        self._distributions = distributions
        self._epsilon = epsilon
        self._solver = solver
        self._deadline = deadline
        self._names = tuple(parameter.name for parameter in plan.parameters)
        self._within = Polyhedron(self._names, declared_bounds(plan))
        self._broken: list[Broken] = []
        self._done = False

    def run(self, within: Fraction) -> None:
        """Enumerate, and measure.

        Raises:
            OutOfTimeError: if the deadline passes first.
            UnsupportedError: an expression that is not linear.
        """
        for one in self._enumerated():
            parts = [(self._within.restricted(piece.constraints), one.earlier) for piece in one.pieces]
            measure = Measure(parts, self._distributions)
            try:
                measure.run(within, self._deadline)
            finally:
                one.bounds = measure.bounds
        self._done = True

    def shares(self, failing: Fraction) -> tuple[Share, ...]:
        """What is known by now, without what takes nothing; `failing` is what all together take at most."""
        inside = box_probability(Box.declared(self._plan.parameters), self._distributions)
        found = {DECLARED: Bounds(1 - inside.upper, 1 - inside.lower)}
        for one in self._broken:
            known = one.bounds or (NOTHING if one.complete and not one.pieces else Bounds(Fraction(0), failing))
            upper = known.upper if one.complete else failing
            before = found.get(one.name, NOTHING)
            found[one.name] = Bounds(before.lower + known.lower, min(failing, before.upper + upper))
        return tuple(Share(name, bounds) for name, bounds in found.items() if bounds.upper)

    @property
    def complete(self) -> bool:
        """Whether nothing but what is named can break."""
        return self._done

    def _enumerated(self) -> Iterator[Broken]:
        """Each thing that can go wrong, when all about it is known."""
        causes = Causes(self._plan, self._epsilon, self._solver, self._deadline)
        known = causes.outside
        for name, halves in causes.demands().items():
            yield self._found(name, halves, known)
        yield self._found(NO_SCHEDULE, causes.without_schedule(), known)
        for obligation in causes.obligations:
            yield self._found(obligation.name, causes.pieces(obligation, known), known)

    def _found(self, name: str, pieces: Iterable[Conjunction], known: list[Conjunction]) -> Broken:
        found = Broken(name, tuple(piece for one in self._broken for piece in one.pieces))
        self._broken.append(found)
        for piece in pieces:
            polyhedron = Polyhedron(self._names, piece)
            if piece not in known and not polyhedron.is_disjoint_from(self._within):
                found.pieces.append(polyhedron)
                known.append(piece)
        found.complete = True
        return found
