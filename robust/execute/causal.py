"""The causal network of a time-triggered plan, and the bounds that counterexamples add to it [IRR §3].

Three kinds of edges, and nothing else:

- durations (bounds of :mod:`robust.execute.parametrization`);
- mutex pairs, separated by ε in the order of the plan (if it is 0, by a distance that the plan itself keeps).
  No-moving-targets makes every writer of an atom mutex with every reader and every contrary writer of it, and the same
  for fluents. So these edges alone settle which value each condition at a start or an end, each conditional effect and
  the goal reads, unless it depends on durations or continuous change;
- over-all conditions, which do not count as readers: the atom keeps its value from its achiever to the end. Contrary
  writers are ordered with the achiever already, so what is to be said is: achiever before start, later threats after
  end.

Timed literals have fixed times: their orders become bounds from zero.

Which achiever? If nothing had made the atom false by then, the initial state: that costs no edge. Otherwise any
achiever since the last contrary writer will do, and each keeps the same threats out, so every choice costs one edge.
One that comes before the start anyway costs none; else the most recent is taken, as the Esterel transformer does: where
the transformer's network is valid, this one then allows all of its schedules.

What depends on numbers that vary with the schedule, and over-all conditions that different literals keep true in turn,
is left to :class:`Tightener`; so is finding the edges of over-all conditions that are true without them,
because their literals are true by turns whatever the order is.

Then, while some allowed schedule breaks an obligation, bounds are added, guided by counterexamples. Such a schedule is
compared with the original one: of the time points that the obligation depends on, in the order of the plan, some follow
each other sooner or later than in the plan. Bounds at the plan's own distances rule that out. The original schedule
keeps all bounds; an obligation whose time points all have the distances of the plan cannot break; and there are two
bounds for each distance: so this ends with a valid network.

Bounds at the plan's own distances say too much. So bounds without which the network is still valid are dropped again,
one by one, and the others are loosened together: each bound becomes a parameter, and exact widening
(:mod:`robust.irr.widen`) finds how far all of them can go before anything breaks.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise

from robust import errors, searching
from robust.encode import create_encoding
from robust.encode.settled import is_proved
from robust.execute import distances, parametrization
from robust.execute.distances import edge
from robust.irr.check import Answer, Checker, CheckResult, Counterexample
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from robust.qe.box import Box
from robust.smt.limits import Deadline


@dataclass(frozen=True, slots=True)
class CausalNetwork:
    """A network in parts; the original schedule satisfies all of them.

    `points` are zero and the time points of instances; `certain` holds whatever the parameters are, and may imply
    others; `durations` are the bounds of durations, `links` are the edges that protect over-all conditions, and `edges`
    are these and the separations of mutex pairs.
    """

    points: tuple[model.TimePoint, ...]
    certain: tuple[distances.DistanceEdge, ...]
    durations: tuple[distances.DistanceEdge, ...]
    edges: tuple[distances.DistanceEdge, ...]
    links: frozenset[distances.DistanceEdge]


def causal_network(
    original: distances.Original, pinned: Collection[str] = (), varying: Collection[str] = ()
) -> CausalNetwork:
    """The network that keeps conditions over atoms true; instances in `pinned` keep the durations of the plan.

    Of these, durations of the `varying` ones are parameters.

    It need not keep conditions over numbers: see :class:`Tightener`.
    """
    durative = [instance for instance in original.plan.instances if instance.durative]
    points = tuple(point for point in original.plan.time_points if point.time is None)
    certain = (
        *(distances.DistanceEdge(model.ZERO, point, Fraction(0)) for point in points if point != model.ZERO),
        *(parametrization.certain_duration(original, instance) for instance in durative),
    )
    durations = tuple(
        bound for instance in durative for bound in parametrization.duration_edges(original, instance, pinned)
    )
    settled = parametrization.settled_durations(original, pinned) | (frozenset(pinned) - frozenset(varying))
    orders = [edge(a, b, original.gap) for a, b in original.mutex if a.instance is None or a.instance != b.instance]
    network = distances.EdgeNetwork(points, (*certain, *orders))
    links = [link for instance in durative for link in _OverAll(original, instance, network).edges()]
    known = tuple(bound for bound in durations if bound.source.instance in settled)
    edges = tuple(dict.fromkeys((*orders, *links)))
    return CausalNetwork(points, (*certain, *known), durations, edges, frozenset(links) - frozenset(orders))


@dataclass(frozen=True)
class _OverAll:
    """The over-all conditions of one instance, and the edges that protect them in a network."""

    original: distances.Original
    instance: model.ActionInstance
    network: distances.EdgeNetwork

    def edges(self) -> Iterator[distances.DistanceEdge]:
        for part in self.instance.conditions:
            if part.timing is model.Timing.OVER_ALL:
                yield from self._all_protected(self._kept(part.condition) or ())

    def _all_protected(self, literals: Iterable[model.Holds]) -> list[distances.DistanceEdge]:
        return [bound for literal in literals for bound in self._protection(literal)]

    def _kept(self, condition: model.Condition) -> tuple[model.Holds, ...] | None:
        """Literals that hold from start to end and make the condition true, with fewest edges; None if no literals do.

        Conjuncts that no literals keep true are passed over. Comparisons are taken for true where all of the condition
        needs them, for false where there is an alternative.
        """
        match condition:
            case model.Truth(value):
                return () if value else None
            case model.NumericCondition():
                return ()
            case model.Holds():
                return (condition,) if self._holds_throughout(condition) else None
            case model.And(operands):
                return tuple(literal for part in map(self._kept, operands) for literal in part or ())
            case model.Or(operands):
                kept = [self._kept(operand) for operand in operands if not isinstance(operand, model.NumericCondition)]
                alternatives = (literals for literals in kept if literals)
                return min(alternatives, key=lambda literals: len(self._all_protected(literals)), default=None)

    def _holds_throughout(self, literal: model.Holds) -> bool:
        """Whether the literal holds from right after the start up to the end."""
        execution, times = self.original.execution, self.original.times
        start, end = times[self.instance.start], times[self.instance.end]
        # where start and end are at the same time, what holds then has to hold
        happenings = [before for before, _ in execution.steps(start, end)] or [execution.at(start)]
        return all((literal.atom in happening.after.atoms) is literal.value for happening in happenings)

    def _protection(self, literal: model.Holds) -> Iterator[distances.DistanceEdge]:
        """Achiever before start, contrary writers not before the end unless they are before the achiever."""
        original, instance = self.original, self.instance
        start, end = original.times[instance.start], original.times[instance.end]
        writes = original.writes(literal.atom)
        contrary = [write for write in writes if write.value is not literal.value]
        broken = max((write.time for write in contrary if write.time <= start), default=None)
        initially = (literal.atom in original.plan.initial_atoms) is literal.value
        if broken is not None or not initially:
            supports = [write for write in writes if write.value is literal.value and write.time <= start]
            achievers = [support for support in supports if broken is None or broken < support.time]
            # one of them, unless one comes before the start anyway
            links = [edge(achiever.point, instance.start, Fraction(0)) for achiever in achievers]
            if links and not any(map(self.network.implies, links)):
                yield links[-1]
        for write in contrary:
            if write.time >= end and write.point != instance.end:
                yield edge(instance.end, write.point, Fraction(0))


@dataclass(frozen=True, slots=True)
class Tightening:
    """A bound that is needed in addition to the edges that keep atoms true.

    `edge` is the bound, `own` the distance that the plan itself has, and `obligation` the first one that broke
    without it.
    """

    edge: distances.DistanceEdge
    own: Fraction
    obligation: str


class UndecidedError(errors.SolverError):
    """The validity of a network is not decided, or not in time."""


@dataclass(frozen=True)
class Tightener:
    """Proves, tightens and loosens networks of one plan.

    Args:
        original: the plan and its schedule.
        solver: `z3` or `cvc5`.
        deadline: after it nothing is proved any more.
        say: called with what is being done.
    """

    original: distances.Original
    solver: str
    deadline: Deadline
    say: Callable[[str], None]

    def loosened(
        self, edges: Sequence[distances.DistanceEdge], tightened: Sequence[Tightening]
    ) -> tuple[Tightening, ...]:
        """The bounds, as few and as loose as the proof allows; unchanged if time runs out.

        Raises:
            KeyboardInterrupt: if interrupted.
        """
        if not tightened:
            return ()
        less = self.in_less_time
        self.say("dropping bounds")
        bounds = [tightening.edge for tightening in tightened]
        needed = less.without_removable(edges, bounds, bounds)
        named = named_bounds([tightening for tightening in tightened if tightening.edge in needed])
        self.say("loosening bounds")
        return tuple(at_lower_ends(named, less._widened(edges, named), self.original.gap))

    def without_removable(
        self,
        fixed: Sequence[distances.DistanceEdge],
        edges: Sequence[distances.DistanceEdge],
        candidates: Collection[distances.DistanceEdge],
    ) -> list[distances.DistanceEdge]:
        """The edges without those candidates, latest first, that the proof does not need; all if time is short.

        Together with the `fixed` edges they are valid.
        """
        kept = list(edges)
        for candidate in reversed(edges):
            if candidate in candidates:
                rest = [other for other in kept if other != candidate]
                every = (*fixed, *rest)
                implied = distances.is_implied(candidate, every)
                if implied or (
                    not self._breaks_without(candidate, every) and self.check(every).answer is Answer.PROVED
                ):
                    kept = rest
        return kept

    def _breaks_without(self, bound: distances.DistanceEdge, others: Sequence[distances.DistanceEdge]) -> bool:
        """Whether one of two schedules that break this edge only breaks an obligation: mostly, and without a solver."""
        plan, epsilon = self.original.plan, self.original.epsilon
        points = [point for point in plan.time_points if point.time is None]
        for slack in (self.original.gap, Fraction(1)):
            broken = distances.DistanceEdge(bound.target, bound.source, slack - bound.weight)
            times = distances.EdgeNetwork(points, (*others, broken)).earliest
            if times is not None and simulate(plan, plan.nominal, times, epsilon=epsilon).violations:
                return True
        return False

    @property
    def in_less_time(self) -> Tightener:
        """A copy with half of the remaining time: a loosened network has to be proved once more afterwards."""
        remaining = self.deadline.remaining
        return self if remaining is None else replace(self, deadline=Deadline.after(remaining / 2))

    def check(self, edges: Iterable[distances.DistanceEdge]) -> CheckResult:
        """Whether the plan is valid for every schedule that satisfies the edges."""
        return check_plan(self._plan(edges), self.original.epsilon, self.solver, self.deadline)

    # -- what counterexamples ask for --------------------------------------------------------------------------------

    def forced(self, edges: Sequence[distances.DistanceEdge]) -> tuple[list[Tightening], CheckResult]:
        """Bounds that make a network valid which the original schedule satisfies, and the proof.

        Raises:
            UndecidedError: if the solver cannot decide, or not in time.
            KeyboardInterrupt: if interrupted.
        """
        plan = self._plan(edges)
        if is_proved(plan, self.original.epsilon, self.original.mutex):
            return [], verdict_of(plan, Answer.PROVED)
        tightened: dict[distances.DistanceEdge, Tightening] = {}
        while True:
            self.say(f"proving the network with {len(tightened)} bounds on distances")
            result = self.check((*edges, *tightened))
            if result.answer is Answer.PROVED:
                return list(tightened.values()), result
            if not result.counterexamples:
                raise UndecidedError(
                    f"found {undecided(result)!r} undecided, expected a proof that the network is valid; "
                    "allow more time or another solver"
                )
            counterexample = next(iter(result.counterexamples.values()))
            new = [bound for bound in self._bounds_against(counterexample) if bound.edge not in tightened]
            if not new:
                raise errors.SolverError(
                    f"found no bound that keeps {counterexample.obligation!r}, which the plan itself does not break; "
                    "please report this plan as a bug"
                )
            tightened |= {tightening.edge: tightening for tightening in new}

    def _bounds_against(self, counterexample: Counterexample) -> list[Tightening]:
        """Bounds at the plan's distances where the schedule has others."""
        plan, times = self.original.plan, self.original.times
        points = parametrization.influences(plan, counterexample.obligation)
        order = {point: i for i, point in enumerate(plan.time_points)}
        ordered = sorted(points, key=lambda point: (times[point], order[point]))
        bounds = []
        for earlier, later in pairwise(ordered):
            planned = self.original.distance(earlier, later)
            other = counterexample.schedule[later] - counterexample.schedule[earlier]
            if other != planned:
                bound = edge(earlier, later, planned) if other < planned else edge(later, earlier, -planned)
                bounds.append(Tightening(bound, planned, counterexample.obligation))
        return bounds

    # -- less of it --------------------------------------------------------------------------------------------------

    def _widened(self, edges: Sequence[distances.DistanceEdge], named: Mapping[str, Tightening]) -> Box:
        """The box of lower bounds that widening finds; the bounds themselves if it does not finish in time."""
        from robust.irr.exact import ExactSearch  # noqa: PLC0415 - most networks are proved without

        plan = self._plan(edges)
        fixed = (replace(parameter, lower=parameter.nominal, upper=parameter.nominal) for parameter in plan.parameters)
        widened = with_free_bounds(replace(plan, parameters=tuple(fixed)), named)
        encoding = create_encoding("relational", widened, self.original.epsilon, self.deadline)
        result = ExactSearch(encoding, solver=self.solver, deadline=self.deadline).run()
        if result.status is searching.Status.INTERRUPTED:
            raise KeyboardInterrupt
        return result.box if result.verified else Box.nominal(widened.parameters)

    def _plan(self, edges: Iterable[distances.DistanceEdge]) -> model.ParametrizedPlan:
        constraints = tuple(at_least(bound, Polynomial.constant(bound.weight)) for bound in edges)
        return replace(self.original.plan, constraints=constraints)


def at_least(bound: distances.DistanceEdge, weight: model.Bound) -> model.TemporalConstraint:
    """A lower bound on the distance between the time points of an edge."""
    return model.TemporalConstraint(bound.source, bound.target, weight, None)


def check_plan(plan: model.ParametrizedPlan, epsilon: Fraction, solver: str, deadline: Deadline) -> CheckResult:
    """Whether the plan is valid at the nominal parameter values.

    Raises:
        KeyboardInterrupt: if interrupted.
        InputError: if the network has no schedule.
        UnsupportedError: for an expression that is not linear.
    """
    # Shortest paths prove more about numbers than about parameters.
    encoding = create_encoding("relational", model.at_values(plan, plan.nominal), epsilon, deadline)
    result = Checker(encoding, Box({}), solver=solver, deadline=deadline).run()
    if result.interrupted:
        raise KeyboardInterrupt
    counterexamples = {name: replace(case, parameters=plan.nominal) for name, case in result.counterexamples.items()}
    return replace(result, box=Box.nominal(plan.parameters), counterexamples=counterexamples, plan=plan)


def verdict_of(plan: model.ParametrizedPlan, answer: Answer) -> CheckResult:
    """A result with one answer for all obligations."""
    names = dict.fromkeys(parametrization.obligation_names(plan), answer)
    return CheckResult(answer, Box.nominal(plan.parameters), names, {}, 0.0)


def named_bounds(tightened: Iterable[Tightening]) -> dict[str, Tightening]:
    return {f"bound {i}": tightening for i, tightening in enumerate(tightened)}


def with_free_bounds(plan: model.ParametrizedPlan, named: Mapping[str, Tightening]) -> model.ParametrizedPlan:
    """The plan with a parameter for each bound, which may be looser."""
    edges = {name: tightening.edge for name, tightening in named.items()}
    free = (model.Parameter(name, bound.weight, upper=bound.weight) for name, bound in edges.items())
    bounds = (at_least(bound, Polynomial.variable(model.ParameterReference(name))) for name, bound in edges.items())
    return replace(plan, parameters=(*plan.parameters, *free), constraints=(*plan.constraints, *bounds))


def at_lower_ends(named: Mapping[str, Tightening], box: Box, gap: Fraction) -> Iterator[Tightening]:
    """The bounds at the lower ends of their intervals; those without end are dropped."""
    for name, tightening in named.items():
        end = box[name].lower
        if end is not None:
            # where the end does not belong to it, a little above or the plan's own
            least = end if box[name].lower_closed else min(end + gap, tightening.edge.weight)
            yield replace(tightening, edge=tightening.edge._replace(weight=least))


def undecided(result: CheckResult) -> str:
    undecided = (name for name, answer in result.obligations.items() if answer is Answer.UNKNOWN)
    return next(undecided, result.reason or "the network")
