"""The schedule that a conversion starts from [IRR §3], and bounds between its time points, exact and in integers.

Edges are lower bounds; what counts is their longest paths, and which of them the others imply. `t_b − t_a ≤ u` is the
lower bound −u from b to a, so one kind of edge is enough. Timed literals have fixed times and no name in plan files:
their edges become edges of zero.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from robust.errors import InputError, Location, RefutedError
from robust.execute.stnu import ShortestPaths
from robust.numbers import format_number
from robust.plan.model import ZERO, ActionInstance, Atom, ParametrizedPlan, TimePoint
from robust.plan.pddl.syntax import Domain
from robust.plan.simulate import Violation, mutex_pairs, simulate
from robust.plan.stn import InstanceDeclaration, STNConstraint
from robust.plan.timed import TimedPlan, TimedStep
from robust.plan.timeline import Execution, State


@dataclass(frozen=True, slots=True)
class Edge:
    """`t_target − t_source ≥ weight`."""

    source: TimePoint
    target: TimePoint
    weight: Fraction

    def __str__(self) -> str:
        return f"{self.target} - {self.source} >= {self.weight}"


def edge(source: TimePoint, target: TimePoint, weight: Fraction) -> Edge:
    """The edge; the time of a timed literal at one of its ends goes into the weight."""
    first, second = (point if point.time is None else ZERO for point in (source, target))
    return Edge(first, second, weight + (source.time or 0) - (target.time or 0))


def constraints_of(edges: Iterable[Edge], position: Mapping[TimePoint, int]) -> tuple[STNConstraint, ...]:
    """Edges as constraints of a plan, one for each pair, from the time point of lower `position` to that of higher.

    They are ordered by position of target, then source. Of several edges between the same points the strongest counts.
    """
    lower: dict[tuple[TimePoint, TimePoint], Fraction] = {}
    upper: dict[tuple[TimePoint, TimePoint], Fraction] = {}
    for one in edges:
        if one.source == one.target:
            continue
        if position[one.source] < position[one.target]:
            pair = (one.source, one.target)
            lower[pair] = max(one.weight, lower.get(pair, one.weight))
        else:
            pair = (one.target, one.source)
            upper[pair] = min(-one.weight, upper.get(pair, -one.weight))
    ordered = sorted({*lower, *upper}, key=lambda pair: (position[pair[1]], position[pair[0]]))
    return tuple(
        STNConstraint(target, source, lower.get((source, target)), upper.get((source, target)))
        for source, target in ordered
    )


class Paths:
    """Longest paths between all pairs of time points."""

    def __init__(self, points: Sequence[TimePoint], edges: Iterable[Edge]) -> None:
        self._index = index = {point: i for i, point in enumerate(points)}
        weights = ((index[one.source], index[one.target], -one.weight) for one in edges)
        self._shortest = ShortestPaths(len(points), weights)

    def implied(self, source: TimePoint, target: TimePoint) -> Fraction | None:
        """The greatest lower bound of t_target − t_source; None if there is none."""
        found = self._shortest.length(self._index[source], self._index[target])
        return None if found is None else -found


def earliest(points: Sequence[TimePoint], edges: Iterable[Edge]) -> dict[TimePoint, Fraction] | None:
    """The earliest schedule from zero that satisfies the edges; None if there is none."""
    outgoing = _adjacency(edges)
    times = dict.fromkeys(points, Fraction(0))
    queue, waiting = deque(points), set(points)
    rounds = dict.fromkeys(points, 0)
    while queue:
        point = queue.popleft()
        waiting.discard(point)
        rounds[point] += 1
        if rounds[point] > len(points):  # Bellman and Ford: there is a cycle that never gets late enough
            return None
        for one in outgoing[point]:
            if times[one.target] < times[point] + one.weight:
                times[one.target] = times[point] + one.weight
                if one.target == ZERO:
                    return None
                if one.target not in waiting:
                    waiting.add(one.target)
                    queue.append(one.target)
    return times


def irredundant(points: Sequence[TimePoint], given: Sequence[Edge], edges: Sequence[Edge]) -> list[Edge]:
    """A subset of `edges` that with `given` implies all of them, and none of which the others imply.

    Edges that come first are the first to go. The edges must have a schedule.
    """
    paths = Paths(points, (*given, *edges))
    # A longer path than the edge itself cannot contain it, or there would be no schedule: all these go at once.
    tight = [one for one in dict.fromkeys(edges) if paths.implied(one.source, one.target) == one.weight]
    tight = [one for one in tight if one.source != one.target]
    adjacency = _adjacency((*given, *tight))
    always, dropped = frozenset(given), set()
    for one in tight:
        if one in always or _reaches(one, adjacency):
            adjacency[one.source].remove(one)
            dropped.add(one)
    return [one for one in tight if one not in dropped]


def is_implied(one: Edge, others: Iterable[Edge]) -> bool:
    """Whether every schedule of the other edges satisfies the edge; they must have a schedule."""
    others = tuple(others)
    return one in others or _reaches(one, _adjacency(others))


def _adjacency(edges: Iterable[Edge]) -> Mapping[TimePoint, list[Edge]]:
    outgoing: defaultdict[TimePoint, list[Edge]] = defaultdict(list)
    for one in edges:
        outgoing[one.source].append(one)
    return outgoing


def _reaches(skipped: Edge, adjacency: Mapping[TimePoint, Sequence[Edge]]) -> bool:
    """Whether a path without that edge is as long."""
    longest = {skipped.source: Fraction(0)}
    queue = deque([skipped.source])
    while queue:
        point = queue.popleft()
        for one in adjacency[point]:
            length = longest[point] + one.weight
            if one != skipped and (one.target not in longest or length > longest[one.target]):
                longest[one.target] = length
                if one.target == skipped.target and length >= skipped.weight:
                    return True
                queue.append(one.target)
    return False


class InvalidPlanError(RefutedError):
    """A time-triggered plan that breaks obligations; `violations` are all that the simulator found."""

    def __init__(self, message: str, location: Location, violations: Sequence[Violation]) -> None:
        super().__init__(message, location)
        self.violations = tuple(violations)


@dataclass(frozen=True, slots=True)
class Write:
    """A time point that gives an atom a truth value, whether or not it had that value before."""

    time: Fraction
    point: TimePoint
    value: bool


@dataclass(frozen=True)
class Original:
    """A plan without constraints, and the one schedule of it that a planner chose.

    `times` has every time point, zero and timed literals among them.
    """

    plan: ParametrizedPlan
    times: Mapping[TimePoint, Fraction]
    epsilon: Fraction

    @cached_property
    def execution(self) -> Execution:
        """The states that the schedule passes through, at nominal parameter values."""
        return Execution(self.plan, self.plan.nominal, self.times)

    @cached_property
    def before(self) -> Mapping[TimePoint, State]:
        """The state that conditions at a time point read."""
        return {point: happening.before for happening in self.execution.happenings for point in happening.points}

    def distance(self, source: TimePoint, target: TimePoint) -> Fraction:
        """t_target − t_source."""
        return self.times[target] - self.times[source]

    @cached_property
    def mutex(self) -> tuple[tuple[TimePoint, TimePoint], ...]:
        """The mutex pairs, the earlier time point first."""
        pairs = mutex_pairs(self.plan)
        return tuple((a, b) if self.times[a] <= self.times[b] else (b, a) for a, b in pairs)

    def writes(self, atom: Atom) -> tuple[Write, ...]:
        """The writes of an atom by time; conditional effects that do not happen in the schedule are no writes."""
        return self._writes.get(atom, ())

    @cached_property
    def _writes(self) -> Mapping[Atom, tuple[Write, ...]]:
        values: dict[tuple[Atom, TimePoint], bool] = {}
        for atom, point, value in (*self._effects(), *self._literals()):
            # at one time point an add wins over a delete
            values[atom, point] = values.get((atom, point), False) or value
        found: dict[Atom, list[Write]] = {}
        for (atom, point), value in values.items():
            found.setdefault(atom, []).append(Write(self.times[point], point, value))
        order = {atom: sorted(writes, key=lambda one: (one.time, str(one.point))) for atom, writes in found.items()}
        return {atom: tuple(writes) for atom, writes in order.items()}

    def _effects(self) -> Iterator[tuple[Atom, TimePoint, bool]]:
        for instance in self.plan.instances:
            for effect in instance.atom_effects:
                point = instance.at(effect.timing)
                if self.execution.reading(self.before[point], instance).holds(effect.condition):
                    yield effect.atom, point, effect.value

    def _literals(self) -> Iterator[tuple[Atom, TimePoint, bool]]:
        for literal in self.plan.timed_literals:
            if isinstance(literal.target, Atom):
                yield literal.target, literal.point, bool(literal.value)


def declarations(plan: TimedPlan, domain: Domain, epsilon: Fraction) -> tuple[InstanceDeclaration, ...]:
    """An instance `n0`, `n1`, … for each step, in the order of the plan; InputError for a plan without steps.

    Some planners print a duration of ε after an instantaneous action; one of at most `epsilon` is passed over.
    """
    if not plan.steps:
        raise InputError("empty plan: found no step, expected at least one", Location(plan.file))
    return tuple(
        InstanceDeclaration(f"n{i}", step.action, step.arguments, _durative(step, domain, epsilon), step.location)
        for i, step in enumerate(plan.steps)
    )


def _durative(step: TimedStep, domain: Domain, epsilon: Fraction) -> bool:
    schema = domain.actions.get(step.action)
    if schema is not None and not schema.durative and step.duration is not None and step.duration <= epsilon:
        return False
    return step.duration is not None


def schedule_of(plan: TimedPlan, instances: Sequence[InstanceDeclaration]) -> dict[TimePoint, Fraction]:
    """When the plan starts and ends each instance."""
    times = {ZERO: Fraction(0)}
    for step, instance in zip(plan.steps, instances, strict=True):
        times[instance.start] = step.time
        if instance.durative:
            times[instance.end] = step.time + (step.duration or 0)
    return times


def validated(plan: ParametrizedPlan, times: Mapping[TimePoint, Fraction], epsilon: Fraction, file: str) -> Original:
    """The schedule as an original, once the simulator has executed it.

    Raises:
        InvalidPlanError: if it breaks an obligation; the message names the first one in time, and the step's line.
        UnsupportedError: if the simulator cannot decide an over-all condition or a continuous effect.
    """
    complete = {**{point: point.time for point in plan.time_points if point.time is not None}, **times}
    violations = simulate(plan, plan.nominal, complete, epsilon=epsilon).violations
    if violations:
        first = min(violations, key=lambda violation: violation.time)
        others = f" (and {len(violations) - 1} more)" if len(violations) > 1 else ""
        broken = f"{first.obligation!r} broken at time {format_number(first.time)}: {first.detail}{others}"
        message = f"invalid plan: found {broken}, expected a plan that breaks nothing"
        raise InvalidPlanError(message, _place(plan.instances, first, file), violations)
    return Original(plan, complete, epsilon)


def _place(instances: Sequence[ActionInstance], violation: Violation, file: str) -> Location:
    """The line of the step whose obligation breaks; the file for separations and goals."""
    owner = next((one for one in instances if violation.obligation.startswith(f"{one.identifier} ")), None)
    return owner.location if owner is not None and owner.location is not None else Location(file)
