"""The schedule that a conversion starts from [IRR §3], and bounds between its time points, exact and in integers.

Edges are lower bounds; what counts is their longest paths, and which of them the others imply. `t_b − t_a ≤ u` is the
lower bound −u from b to a, so one kind of edge is enough. Timed literals have fixed times and no name in plan files:
their edges become edges of zero.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

from robust.encode.interface import EPSILON
from robust.errors import InputError, Location, RefutedError
from robust.execute.snap import Snapped, Snapping, TooFarError
from robust.network.differences import Distances
from robust.numbers import format_number, round_up
from robust.plan import stn, timed, timeline
from robust.plan.model import ZERO, ActionInstance, Atom, ParametrizedPlan, TimePoint, concerned
from robust.plan.pddl.syntax import Domain
from robust.plan.simulate import Violation, mutex_pairs, simulate

COARSEST = Fraction(1)
"""Planners round at most to whole numbers: times further away than that are wrong, not rounded."""


class DistanceEdge(NamedTuple):
    """`t_target − t_source ≥ weight`."""

    source: TimePoint
    target: TimePoint
    weight: Fraction

    def __str__(self) -> str:
        return f"{self.target} - {self.source} >= {self.weight}"


def edge(source: TimePoint, target: TimePoint, weight: Fraction) -> DistanceEdge:
    """An edge in which the time of a timed literal at one of its ends is part of the weight."""
    first, second = (point if point.time is None else ZERO for point in (source, target))
    return DistanceEdge(first, second, weight + (source.time or 0) - (target.time or 0))


def constraints_of(edges: Iterable[DistanceEdge], position: Mapping[TimePoint, int]) -> tuple[stn.STNConstraint, ...]:
    """Constraints of a plan for edges, one for each pair, from the time point of lower `position` to that of higher.

    They are ordered by position of target, then source. Of several edges between the same points the strongest counts.
    """
    lower: dict[tuple[TimePoint, TimePoint], Fraction] = {}
    upper: dict[tuple[TimePoint, TimePoint], Fraction] = {}
    for bound in edges:
        if bound.source == bound.target:
            continue
        if position[bound.source] < position[bound.target]:
            pair = (bound.source, bound.target)
            lower[pair] = max(bound.weight, lower.get(pair, bound.weight))
        else:
            pair = (bound.target, bound.source)
            upper[pair] = min(-bound.weight, upper.get(pair, -bound.weight))
    ordered = sorted({*lower, *upper}, key=lambda pair: (position[pair[1]], position[pair[0]]))
    return tuple(
        stn.STNConstraint(target, source, lower.get((source, target)), upper.get((source, target)))
        for source, target in ordered
    )


class EdgeNetwork(Distances[TimePoint]):
    """A network of edges and its implications; it must have a schedule unless only :attr:`earliest` is used."""

    def implies(self, bound: DistanceEdge) -> bool:
        """Whether every schedule satisfies the edge, whose weight may have another denominator."""
        least = self.least(bound.source, bound.target)
        return least is not None and least >= bound.weight

    @property
    def earliest(self) -> dict[TimePoint, Fraction] | None:
        """The earliest schedule from zero, which comes first of all points; None if there is none."""
        schedule = self.network.schedule
        return None if schedule is None or schedule[0] else self.times

    def needed(self, edges: Iterable[DistanceEdge], given: Iterable[DistanceEdge]) -> list[DistanceEdge]:
        """An irredundant subset of edges of the network that implies them all together with the given ones.

        Where either of two can, the first one goes.
        """
        bounds = {wanted: self.in_units(*wanted) for wanted in edges}
        kept = set(self.network.needed(reversed(bounds.values()), (self.in_units(*wanted) for wanted in given)))
        return [wanted for wanted, bound in bounds.items() if bound in kept]


def is_implied(bound: DistanceEdge, others: Iterable[DistanceEdge]) -> bool:
    """Whether every schedule of the other edges satisfies the edge; they must have a schedule."""
    others = tuple(others)
    points = dict.fromkeys(point for other in (*others, bound) for point in (other.source, other.target))
    return EdgeNetwork(points, others).implies(bound)


class InvalidPlanError(RefutedError):
    """A time-triggered plan that breaks obligations; `violations` are all that the simulator found."""

    def __init__(self, message: str, location: Location, violations: Sequence[Violation]) -> None:
        super().__init__(message, location)
        self.violations = tuple(violations)


@dataclass(frozen=True, slots=True)
class TruthWrite:
    """A time point that gives an atom a truth value, whether or not it had that value before."""

    time: Fraction
    point: TimePoint
    value: bool


@dataclass(frozen=True)
class Original:
    """A plan without constraints, and the one schedule of it that a planner chose.

    `times` has every time point, zero and timed literals among them. Mutex time points are `epsilon` apart, or at
    different times if it is 0.
    """

    plan: ParametrizedPlan
    times: Mapping[TimePoint, Fraction]
    epsilon: Fraction

    @cached_property
    def gap(self) -> Fraction:
        """Separation of mutex time points in a network: ε.

        Closed bounds cannot say "at different times": if ε is 0 it is a positive distance that the plan itself keeps.
        """
        return self.epsilon or min([EPSILON, *(self.distance(*pair) for pair in self.mutex)])

    @cached_property
    def execution(self) -> timeline.TimedExecution:
        """The states that the schedule passes through, at nominal parameter values."""
        return timeline.TimedExecution(self.plan, self.plan.nominal, self.times)

    def distance(self, source: TimePoint, target: TimePoint) -> Fraction:
        """t_target − t_source."""
        return self.times[target] - self.times[source]

    @cached_property
    def mutex(self) -> tuple[tuple[TimePoint, TimePoint], ...]:
        """The mutex pairs, the earlier time point first."""
        pairs = mutex_pairs(self.plan)
        return tuple((a, b) if self.times[a] <= self.times[b] else (b, a) for a, b in pairs)

    @cached_property
    def stretched(self) -> frozenset[str | None]:
        """The instances whose own start and end are mutex, so that they last at least the gap."""
        return frozenset(start.instance for start, end in self.mutex if start.instance == end.instance)

    def writes(self, atom: Atom) -> tuple[TruthWrite, ...]:
        """The writes of an atom by time; conditional effects that do not happen in the schedule are no writes."""
        return self._writes.get(atom, ())

    @cached_property
    def _writes(self) -> Mapping[Atom, tuple[TruthWrite, ...]]:
        values: dict[tuple[Atom, TimePoint], bool] = {}
        for atom, point, value in (*self._effects(), *self._literals()):
            # at one time point an add wins over a delete
            values[atom, point] = values.get((atom, point), False) or value
        writes: dict[Atom, list[TruthWrite]] = {}
        for (atom, point), value in sorted(values.items(), key=lambda item: (self.times[item[0][1]], str(item[0][1]))):
            writes.setdefault(atom, []).append(TruthWrite(self.times[point], point, value))
        return {atom: tuple(ordered) for atom, ordered in writes.items()}

    def _effects(self) -> Iterator[tuple[Atom, TimePoint, bool]]:
        for instance in self.plan.instances:
            for effect in instance.atom_effects:
                point = instance.at(effect.timing)
                if self.execution.reading(self.execution.before(point), instance).holds(effect.condition):
                    yield effect.atom, point, effect.value

    def _literals(self) -> Iterator[tuple[Atom, TimePoint, bool]]:
        for literal in self.plan.timed_literals:
            if isinstance(literal.target, Atom):
                yield literal.target, literal.point, bool(literal.value)


def declarations(plan: timed.TimedPlan, domain: Domain, epsilon: Fraction) -> tuple[stn.InstanceDeclaration, ...]:
    """An instance for each step, in the order of the plan, by its identifier; InputError for a plan without steps.

    Some planners print a duration of ε after an instantaneous action; one of at most `epsilon` is passed over.
    """
    if not plan.steps:
        raise InputError("empty plan: found no step, expected at least one", Location(plan.file))

    def is_durative(step: timed.TimedStep) -> bool:
        schema = domain.actions.get(step.action)
        short = step.duration is not None and step.duration <= epsilon
        return step.duration is not None and not (short and schema is not None and not schema.durative)

    return tuple(
        stn.InstanceDeclaration(name, step.action, step.arguments, is_durative(step), step.location)
        for name, step in zip(plan.identifiers, plan.steps, strict=True)
    )


def schedule_of(plan: timed.TimedPlan, instances: Sequence[stn.InstanceDeclaration]) -> dict[TimePoint, Fraction]:
    """Start and end of each instance in the plan."""
    times = {ZERO: Fraction(0)}
    for step, instance in zip(plan.steps, instances, strict=True):
        times[instance.start] = step.time
        if instance.durative:
            times[instance.end] = step.time + (step.duration or 0)
    return times


def with_literals(plan: ParametrizedPlan, times: Mapping[TimePoint, Fraction]) -> dict[TimePoint, Fraction]:
    """A schedule completed by the times of timed literals."""
    return {**{literal.point: literal.time for literal in plan.timed_literals}, **times}


def tolerances(
    plan: timed.TimedPlan, instances: Sequence[stn.InstanceDeclaration], epsilon: Fraction, tolerance: Fraction | None
) -> dict[TimePoint, Fraction]:
    """Tolerances of starts, and of durations (by end): one unit of the last printed digit, at most ε, if not given."""
    reach: dict[TimePoint, Fraction] = {}
    for (of_time, of_duration), instance in zip(plan.units, instances, strict=True):
        reach[instance.end] = min(of_duration, epsilon) if tolerance is None else tolerance
        reach[instance.start] = min(of_time, epsilon) if tolerance is None else tolerance
    return reach


def snapped(
    plan: ParametrizedPlan,
    times: Mapping[TimePoint, Fraction],
    tolerances: Mapping[TimePoint, Fraction],
    epsilon: Fraction,
    file: str,
) -> Snapped:
    """The exact schedule that printed times stand for.

    Raises:
        InvalidPlanError: if there is none; the message says what breaks in the printed schedule, and what would do.
        UnsupportedError: if the simulator cannot decide an over-all condition or a continuous effect.
    """
    try:
        return Snapping(plan, with_literals(plan, times), tolerances, tuple(mutex_pairs(plan)), epsilon).run()
    except TooFarError as error:
        near = error.shift is not None and error.shift <= COARSEST
        remedy = f", which --tolerance {format_number(round_up(error.shift or Fraction(0)))} allows" if near else ""
        validated(plan, error.times, epsilon, file, f"; {error}{remedy}")
        raise InvalidPlanError(f"invalid plan: {error}{remedy}", Location(file), ()) from None


def validated(
    plan: ParametrizedPlan, times: Mapping[TimePoint, Fraction], epsilon: Fraction, file: str, remedy: str = ""
) -> Original:
    """The schedule as an original, once the simulator has executed it; `remedy` ends the message if it is invalid.

    Raises:
        InvalidPlanError: if it breaks an obligation; the message names the first one in time, and the step's line.
        UnsupportedError: if the simulator cannot decide an over-all condition or a continuous effect.
    """
    violations = simulate(plan, plan.nominal, times, epsilon=epsilon).violations
    if violations:
        first = min(violations, key=lambda violation: violation.time)
        others = f" (and {len(violations) - 1} more: robust validate names all)" if len(violations) > 1 else ""
        broken = f"{first.obligation!r} broken at time {format_number(first.time)}: {first.detail}{others}"
        message = f"invalid plan: found {broken}, expected a plan that breaks nothing{remedy}"
        raise InvalidPlanError(message, _place(plan.instances, first, file), violations)
    return Original(plan, with_literals(plan, times), epsilon)


def _place(instances: Sequence[ActionInstance], violation: Violation, file: str) -> Location:
    """The line of the step whose obligation breaks, of the later one for a separation; the file for goals."""
    names = concerned(violation.obligation)
    places = (instance.location for instance in instances if instance.identifier in names)
    return ([Location(file), *filter(None, places)])[-1]
