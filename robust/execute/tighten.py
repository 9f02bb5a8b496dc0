"""From a network that keeps conditions over atoms true to one that is proved valid, guided by counterexamples.

While some allowed schedule breaks an obligation, it is compared with the original one: of the time points that the
obligation depends on, in the order of the plan, some follow each other sooner or later than in the plan. Bounds at
the plan's own distances rule that out. The original schedule keeps all bounds; an obligation whose time points all
have the distances of the plan cannot break; and there are two bounds for each distance: so this ends with a valid
network.

Bounds at the plan's own distances say too much. So bounds without which the network is still valid are dropped again,
one by one, and the others are loosened together: each bound becomes a parameter, and exact widening
(:mod:`robust.irr.widen`) finds how far all of them can go before anything breaks.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise

from robust.encode.interface import create_encoding
from robust.errors import SolverError
from robust.execute.distances import Edge, earliest, edge, is_implied
from robust.execute.influence import influences
from robust.execute.original import Original
from robust.irr.box import Box, Interval
from robust.irr.check import Answer, Checker, CheckResult, Counterexample
from robust.irr.methods import ExactSearch
from robust.irr.result import Status
from robust.plan.model import Parameter, ParameterReference, ParametrizedPlan, TemporalConstraint
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from robust.smt.limits import Deadline


@dataclass(frozen=True, slots=True)
class Tightening:
    """A bound that was needed beyond what keeps atoms true.

    `edge` is the bound, `own` the distance that the plan itself has, and `obligation` the first one that broke
    without it.
    """

    edge: Edge
    own: Fraction
    obligation: str


@dataclass(frozen=True)
class Tightener:
    """Asks about networks of one plan.

    Args:
        original: the plan and its schedule.
        solver: `z3` or `cvc5`.
        deadline: after it nothing is proved any more.
        say: called with what is being done.
    """

    original: Original
    solver: str
    deadline: Deadline
    say: Callable[[str], None]

    def tighten(self, edges: Sequence[Edge]) -> tuple[Tightening, ...]:
        """Bounds that make a network valid which the original schedule satisfies; empty if it is valid.

        Raises:
            SolverError: if the solver cannot decide, or not in time.
            KeyboardInterrupt: if interrupted.
        """
        found = self._forced(edges)
        if not found:
            return ()
        less = replace(self, deadline=self._half())
        self.say("dropping bounds")
        found = less._without_needless(edges, found)
        self.say("loosening bounds")
        return tuple(less._loosened(edges, found))

    def without_removable(
        self, fixed: Sequence[Edge], edges: Sequence[Edge], candidates: Collection[Edge]
    ) -> list[Edge]:
        """The edges without those candidates, latest first, that the proof does not need; all if time is short.

        Together with the `fixed` edges they are valid.
        """
        less = replace(self, deadline=self._half())
        kept = list(edges)
        for one in reversed(edges):
            if one in candidates:
                self.say("dropping edges")
                rest = [other for other in kept if other != one]
                every = (*fixed, *rest)
                if is_implied(one, every) or less._is_needless(one, every):
                    kept = rest
        return kept

    def _is_needless(self, one: Edge, others: Sequence[Edge]) -> bool:
        return not self._breaks_without(one, others) and self.check(others).answer is Answer.PROVED

    def _breaks_without(self, one: Edge, others: Sequence[Edge]) -> bool:
        """Whether one of two schedules that break this edge only breaks an obligation: mostly, and without a solver."""
        plan, epsilon = self.original.plan, self.original.epsilon
        literals = {point: point.time for point in plan.time_points if point.time is not None}
        points = [point for point in plan.time_points if point.time is None]
        for slack in (epsilon, Fraction(1)):
            times = earliest(points, (*others, Edge(one.target, one.source, slack - one.weight)))
            if times is not None and simulate(plan, plan.nominal, {**literals, **times}, epsilon=epsilon).violations:
                return True
        return False

    def _half(self) -> Deadline:
        """Half of the time that is left: what is loosened has to be proved once more afterwards."""
        remaining = self.deadline.remaining
        return self.deadline if remaining is None else Deadline.after(remaining / 2)

    def check(self, edges: Iterable[Edge]) -> CheckResult:
        """Whether the plan is valid for every schedule that satisfies the edges."""
        return check_plan(self._plan(edges), self.original.epsilon, self.solver, self.deadline)

    # -- what counterexamples ask for --------------------------------------------------------------------------------

    def _forced(self, edges: Sequence[Edge]) -> list[Tightening]:
        found: dict[Edge, Tightening] = {}
        while True:
            self.say(f"proving the network with {len(found)} bounds on distances")
            result = self.check((*edges, *found))
            if result.answer is Answer.PROVED:
                return list(found.values())
            if not result.counterexamples:
                raise SolverError(
                    f"found {_undecided(result)!r} undecided, expected a proof that the network is valid; "
                    "allow more time or another solver"
                )
            counterexample = next(iter(result.counterexamples.values()))
            new = [one for one in self._bounds_against(counterexample) if one.edge not in found]
            if not new:
                raise SolverError(
                    f"found no bound that keeps {counterexample.obligation!r}, which the plan itself does not break; "
                    "please report this plan as a bug"
                )
            found |= {one.edge: one for one in new}

    def _bounds_against(self, counterexample: Counterexample) -> list[Tightening]:
        """Bounds at the plan's distances where the schedule has others."""
        plan, times = self.original.plan, self.original.times
        points = influences(plan, counterexample.obligation)
        order = {point: i for i, point in enumerate(plan.time_points)}
        ordered = sorted(points, key=lambda point: (times[point], order[point]))
        bounds = []
        for earlier, later in pairwise(ordered):
            own = self.original.distance(earlier, later)
            other = counterexample.schedule[later] - counterexample.schedule[earlier]
            if other != own:
                bound = edge(earlier, later, own) if other < own else edge(later, earlier, -own)
                bounds.append(Tightening(bound, own, counterexample.obligation))
        return bounds

    # -- less of it --------------------------------------------------------------------------------------------------

    def _without_needless(self, edges: Sequence[Edge], found: list[Tightening]) -> list[Tightening]:
        """The bounds without those, latest first, that the proof does not need."""
        kept = list(found)
        for one in reversed(found):
            rest = [other for other in kept if other is not one]
            if self.check((*edges, *(other.edge for other in rest))).answer is Answer.PROVED:
                kept = rest
        return kept

    def _loosened(self, edges: Sequence[Edge], found: Sequence[Tightening]) -> Iterable[Tightening]:
        """The bounds at the ends of the widest box of bounds; those without end are dropped."""
        box = self._widened(edges, found)
        for name, one in zip(_names(found), found, strict=True):
            weight = _loosest(box.intervals[name], one.edge.weight, self.original.epsilon)
            if weight is not None:
                yield replace(one, edge=replace(one.edge, weight=weight))

    def _widened(self, edges: Sequence[Edge], found: Sequence[Tightening]) -> Box:
        """How far all bounds can be lowered at once; as they are, where widening cannot tell in time."""
        names = _names(found)
        plan = self._plan(edges)
        fixed = [replace(one, lower=one.nominal, upper=one.nominal) for one in plan.parameters]
        free = [Parameter(name, one.edge.weight, upper=one.edge.weight) for name, one in zip(names, found, strict=True)]
        bounds = [
            TemporalConstraint(one.edge.source, one.edge.target, Polynomial.variable(ParameterReference(name)), None)
            for name, one in zip(names, found, strict=True)
        ]
        widened = replace(plan, parameters=(*fixed, *free), constraints=(*plan.constraints, *bounds))
        encoding = create_encoding("relational", widened, self.original.epsilon, self.deadline)
        result = ExactSearch(encoding, solver=self.solver, deadline=self.deadline).widen()
        if result.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return result.box if result.verified else Box.nominal(widened.parameters)

    def _plan(self, edges: Iterable[Edge]) -> ParametrizedPlan:
        constraints = tuple(
            TemporalConstraint(one.source, one.target, Polynomial.constant(one.weight), None) for one in edges
        )
        return replace(self.original.plan, constraints=constraints)


def check_plan(plan: ParametrizedPlan, epsilon: Fraction, solver: str, deadline: Deadline) -> CheckResult:
    """Whether the plan is valid at the nominal parameter values.

    Raises:
        KeyboardInterrupt: if interrupted.
        InputError: if the network has no schedule.
        UnsupportedError: for an expression that is not linear.
    """
    encoding = create_encoding("relational", plan, epsilon, deadline)
    result = Checker(encoding, Box.nominal(plan.parameters), solver=solver, deadline=deadline).run()
    if result.interrupted:
        raise KeyboardInterrupt
    return result


def _names(found: Sequence[Tightening]) -> list[str]:
    return [f"bound {i}" for i in range(len(found))]


def _loosest(interval: Interval, own: Fraction, epsilon: Fraction) -> Fraction | None:
    """The least value of an interval; where its end does not belong to it, one ε above or the plan's own."""
    if interval.lower is None or interval.lower_closed:
        return interval.lower
    return min(interval.lower + epsilon, own)


def _undecided(result: CheckResult) -> str:
    undecided = (name for name, answer in result.obligations.items() if answer is Answer.UNKNOWN)
    return next(undecided, result.reason or "the network")
