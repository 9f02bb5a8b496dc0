"""A time-triggered plan as one schedule of a plan without temporal network: where a conversion starts [IRR §3]."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from robust.errors import InputError, Location, RefutedError
from robust.plan.interference import mutex_pairs
from robust.plan.model import ZERO, ActionInstance, Atom, ParametrizedPlan, TimePoint
from robust.plan.numerals import format_number
from robust.plan.pddl.syntax import Domain
from robust.plan.simulate import Violation, simulate
from robust.plan.stn import InstanceDeclaration
from robust.plan.timed import TimedPlan, TimedStep
from robust.plan.timeline import Execution, State


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
    def _before(self) -> Mapping[TimePoint, State]:
        return {point: happening.before for happening in self.execution.happenings for point in happening.points}

    def before(self, point: TimePoint) -> State:
        """The state that conditions at a time point read."""
        return self._before[point]

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
        found: dict[Atom, dict[TimePoint, bool]] = {}
        for atom, point, value in (*self._effects(), *self._literals()):
            values = found.setdefault(atom, {})
            values[point] = values.get(point, False) or value  # at one time point an add wins over a delete
        return {
            atom: tuple(
                sorted(
                    (Write(self.times[point], point, value) for point, value in values.items()),
                    key=lambda write: (write.time, str(write.point)),
                )
            )
            for atom, values in found.items()
        }

    def _effects(self) -> Iterator[tuple[Atom, TimePoint, bool]]:
        for instance in self.plan.instances:
            for effect in instance.atom_effects:
                point = instance.at(effect.timing)
                if self.execution.reading(self.before(point), instance).holds(effect.condition):
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
