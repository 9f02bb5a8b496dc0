"""What remains of a plan in the middle of its execution: where it is, and the plan of what is still to come."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

from robust.encode.network import changes
from robust.execute.messages import StepProgress
from robust.numbers import format_number
from robust.plan import model, timeline
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import mutex_pairs, violations_of
from robust.presented import OneLine


@dataclass(frozen=True, slots=True)
class MonitorState(OneLine, ask="time"):
    """Where a plan that runs is; all times are in the plan's unit.

    Attributes:
        time: what time it is at least; what is said here is how things are then.
        steps: how far each step is, by identifier.
        atoms: the atoms that are true.
        fluents: the values of fluents; durations that are not known yet count as planned.
    """

    time: Fraction
    steps: Mapping[str, StepProgress]
    atoms: frozenset[model.Atom]
    fluents: Mapping[model.Fluent, Fraction]

    @property
    def running(self) -> Mapping[str, Fraction]:
        """Since when each step runs that does."""
        return {name: step.start for name, step in self.steps.items() if step.start is not None and step.is_running}


@dataclass(frozen=True)
class History:
    """What has happened to a plan.

    Args:
        plan: the plan.
        planned: how long steps take as planned, by identifier.
        known: how far each step is by all that is known, by identifier.
        observed: what was observed of the state, in the order in which it counts.
        time: nothing that is not known happened before. What happened later is part of what is still to come, except
            for observations and attempts that failed: there must be none.
        mutex: the plan's points that must be apart, as :func:`~robust.plan.simulate.mutex_pairs` has them.
    """

    plan: model.ParametrizedPlan
    planned: Mapping[str, Fraction]
    known: Mapping[str, StepProgress]
    observed: Sequence[model.TimedLiteral]
    time: Fraction
    mutex: Sequence[tuple[model.TimePoint, model.TimePoint]]

    @cached_property
    def steps(self) -> Mapping[str, StepProgress]:
        """How far each step was at the time of the history."""
        return {name: step.by(self.time) for name, step in self.known.items()}

    @property
    def state(self) -> MonitorState:
        """Where the plan is.

        Raises:
            UnsupportedError: if a continuous effect's rate changes while it acts.
        """
        last = self._execution.happenings[-1]
        state = last.after if last.time >= self.time else last.just_before(self.time)
        return MonitorState(self.time, self.steps, state.atoms, state.fluents)

    @property
    def surprises(self) -> Sequence[tuple[model.Atom | model.Fluent, str]]:
        """What was observed and is not as the plan says, and in words."""
        found = []
        for literal in self.observed:
            known, target, value = self._execution.expected[literal.time], literal.target, literal.value
            expected = target in known.atoms if isinstance(target, model.Atom) else known.fluents.get(target)
            if expected != value:
                found.append((target, f"{target} is {_said(value)} and not {_said(expected)}"))
        return found

    @cached_property
    def happened(self) -> Mapping[model.TimePoint, Fraction]:
        """The times of what has happened, zero among them."""
        return {model.ZERO: Fraction(0), **self._times_of(self.steps)}

    @property
    def later(self) -> Mapping[model.TimePoint, Fraction]:
        """The times of what is known to happen later."""
        return {point: time for point, time in self._times_of(self.known).items() if point not in self.happened}

    def _times_of(self, steps: Mapping[str, StepProgress]) -> Mapping[model.TimePoint, Fraction]:
        times: dict[model.TimePoint, Fraction] = {}
        for name, step in steps.items():
            times |= step.times(self.plan.instance[name])
        return times

    def earliest(self, epsilon: Fraction) -> Mapping[model.TimePoint, Fraction]:
        """When at the earliest a point may happen that is mutex with what happened less than `epsilon` ago."""
        running = {self.plan.instance[name].end for name, step in self.steps.items() if step.is_running}
        recent = {p: at for p, at in self._times.items() if p not in running and at + epsilon > self.time}
        recent.pop(model.ZERO, None)
        if not recent:
            return {}
        tried = [each for each, *_ in self._instances if each.identifier not in self.plan.instance]
        every = mutex_pairs(replace(self.plan, instances=(*self.plan.instances, *tried))) if tried else self.mutex
        found: dict[model.TimePoint, Fraction] = {}
        for pair in every:
            for past, open_point in (pair, pair[::-1]):
                if past in recent and (open_point in running or open_point not in self._times):
                    found[open_point] = max(recent[past] + epsilon, found.get(open_point, self.time))
        return found

    def breaches(self, epsilon: Fraction) -> Sequence[str]:
        """What broke in what has happened, in words: conditions and separations of steps, and demands of the plan."""
        open_ends = {str(self.plan.instance[name].end) for name, step in self.steps.items() if step.is_running}
        found = [
            violation
            for violation in violations_of(self._execution, epsilon)
            if open_ends.isdisjoint(violation.obligation.removeprefix("separation: ").split(", "))
        ]
        late = [
            f"{item}, found {format_number(-length if item.target == model.ZERO else length)}"
            for item in self.plan.constraints
            if item.name is not None and item.source in self.happened and item.target in self.happened
            for length in [self.happened[item.target] - self.happened[item.source]]
            if not _is_within(length, item)
        ]
        return [*(f"{each.obligation} at {format_number(each.time)}: {each.detail}" for each in found), *late]

    @cached_property
    def lasted(self) -> Mapping[str, Fraction]:
        """How long the steps take whose ends are known."""
        return {
            name: step.end - step.start
            for name, step in self.known.items()
            if step.end is not None and step.start is not None
        }

    def reading(self, instance: model.ActionInstance) -> model.Values:
        """The fluents as a step read them when it started."""
        fluents = self._execution.before(instance.start).fluents
        return dict[model.NumericVariable, Fraction | model.Expression](fluents.items())

    @cached_property
    def _instances(self) -> Sequence[tuple[model.ActionInstance, Fraction, Fraction]]:
        """What was started, without what comes later: what runs ends now, and what failed had no end.

        Durations are what they are, and what did not hold when an attempt failed broke nothing.
        """
        found = []
        for name, step in self.steps.items():
            instance = self.plan.instance[name]
            if step.start is not None:
                begun = instance if step.end is not None else _without(instance, model.Timing.AT_END)
                end = max(step.start, self.time) if step.end is None else step.end
                found.append((replace(begun, durations=()), step.start, end))
            for number, (start, end) in enumerate(step.attempts):
                begun = replace(_without(instance, model.Timing.AT_END), durations=(), conditions=())
                found.append((replace(begun, identifier=f"{name}.{number}"), start, end))
        return found

    @cached_property
    def _times(self) -> Mapping[model.TimePoint, Fraction]:
        times = {model.ZERO: Fraction(0)}
        times |= {literal.point: literal.time for literal in self.plan.timed_literals if literal.time <= self.time}
        for instance, start, end in self._instances:
            times[instance.start] = start
            if instance.durative:
                times[instance.end] = end
        return times

    @cached_property
    def _execution(self) -> timeline.TimedExecution:
        literals = tuple(literal for literal in self.plan.timed_literals if literal.time <= self.time)
        instances = tuple(instance for instance, _, _ in self._instances)
        plan = replace(self.plan, instances=instances, constraints=(), timed_literals=literals, goal=())
        lasting = {name: self.planned[name] for name, step in self.steps.items() if step.is_running}
        return timeline.TimedExecution(plan, plan.nominal, self._times, lasting, self.observed)


def _is_within(length: Fraction, item: model.TemporalConstraint) -> bool:
    """Whether a distance is as a constraint demands, as far as that is a number."""
    lower, upper = (None if b is None or not b.is_constant else b.constant_term for b in (item.lower, item.upper))
    return (lower is None or lower <= length) and (upper is None or length <= upper)


def _said(value: Fraction | bool | None) -> str:
    return "unknown" if value is None else str(value).lower()


def variables(plan: model.ParametrizedPlan) -> Mapping[str, model.Atom | model.Fluent]:
    """The atoms and fluents that a plan speaks of, by name without brackets."""
    known: dict[model.Atom | model.Fluent, None] = dict.fromkeys((*plan.initial_atoms, *plan.initial_fluents))
    known |= dict.fromkeys(variable for variable, _ in changes(plan))
    known |= dict.fromkeys(read_by(plan.instances, plan.goal))
    return {str(variable)[1:-1]: variable for variable in known}


def read_by(
    instances: Iterable[model.ActionInstance], goal: Iterable[model.GoalCondition]
) -> Iterator[model.Atom | model.Fluent]:
    """The atoms and fluents that steps and the goal read."""
    conditions: list[model.Condition] = [demand.condition for demand in goal]
    expressions: list[model.Expression] = []
    for instance in instances:
        conditions += [part.condition for part in instance.parts]
        expressions += [effect.expression for effect in instance.numeric_effects]
        expressions += [effect.rate for effect in instance.continuous_effects]
    for condition in conditions:
        yield from model.names_in(condition)
    for expression in expressions:
        yield from model.fluents_in(expression)


def remaining_plan(history: History, epsilon: Fraction, *, ordered: bool) -> model.ParametrizedPlan:
    """The plan of what is still to come, in the state that is reached, with times as in the whole plan.

    What has happened is a number in the constraints of the rest, and mutex points stay `epsilon` away from it; what is
    known to happen later has its time. A step
    that runs begins now and has, in its effects and conditions, lasted for a while; its start has nothing to say any
    more. If it is not `ordered`, only durations and deadlines count, and no order of steps.
    """
    plan, now, state = history.plan, history.time, history.state
    times = dict(history.happened)
    running = state.running
    instances, constraints = [], list[model.TemporalConstraint]()
    for instance in plan.instances:
        step = state.steps[instance.identifier]
        if step.end is None and step.start is not None:
            instances.append(_begun(instance, now - step.start, history.reading(instance)))
            at = Polynomial[model.NumericVariable].constant(now)
            constraints.append(model.TemporalConstraint(model.ZERO, instance.start, at, at))
        elif step.end is None:
            instances.append(instance)
    points = {point for instance in instances for point in instance.time_points if point not in times}
    earliest = {**dict.fromkeys(points, now), **history.earliest(epsilon)}
    constraints += [
        model.TemporalConstraint(model.ZERO, point, Polynomial.constant(time), None) for point, time in earliest.items()
    ]
    known = ((point, Polynomial[model.NumericVariable].constant(time)) for point, time in history.later.items())
    constraints += [model.TemporalConstraint(model.ZERO, point, at, at) for point, at in known]
    for item in plan.constraints:
        numbers = all(bound is None or bound.is_constant for bound in (item.lower, item.upper))
        if ordered or not numbers or item.name is not None or item.source.instance == item.target.instance:
            constraints += _continued(item, times)
    values = {name: history.lasted[step] for name, step in plan.lasting.items() if step in history.lasted}
    lasted = {name: now - running[step] for name, step in plan.lasting.items() if step in running}
    parameters = tuple(
        replace(each, nominal=max(each.nominal, lasted.get(each.name, each.nominal))) for each in plan.parameters
    )
    rest = replace(
        plan,
        parameters=parameters,
        instances=tuple(instances),
        constraints=tuple(constraints),
        initial_atoms=state.atoms,
        initial_fluents={fluent: Polynomial.constant(value) for fluent, value in state.fluents.items()},
        timed_literals=tuple(literal for literal in plan.timed_literals if literal.time > now),
    )
    return model.at_values(rest, values)


def _begun(instance: model.ActionInstance, elapsed: Fraction, values: model.Values) -> model.ActionInstance:
    """A step that has lasted for a while, without its start; `values`: what its duration reads."""
    rest = _without(instance, model.Timing.AT_START)
    rest = replace(rest, durations=model.with_values(rest.durations, values))
    longer = Polynomial.variable(model.Duration()) + elapsed
    return model.with_values(rest, {model.Duration(): longer})


def _without(instance: model.ActionInstance, timing: model.Timing) -> model.ActionInstance:
    """A step without what is needed and changed at one of its time points."""
    return replace(
        instance,
        conditions=tuple(part for part in instance.conditions if part.timing is not timing),
        atom_effects=tuple(effect for effect in instance.atom_effects if effect.timing is not timing),
        numeric_effects=tuple(effect for effect in instance.numeric_effects if effect.timing is not timing),
        mentions=frozenset(mention for mention in instance.mentions if mention.timing is not timing),
    )


def _continued(
    item: model.TemporalConstraint, times: Mapping[model.TimePoint, Fraction]
) -> Iterator[model.TemporalConstraint]:
    """What a constraint says about what has not happened."""
    source, target = times.get(item.source), times.get(item.target)
    if source is None and target is None:
        yield item
    elif target is None and source is not None:
        lower, upper = (None if bound is None else bound + source for bound in (item.lower, item.upper))
        yield replace(item, source=model.ZERO, lower=lower, upper=upper)
    elif source is None and target is not None:
        upper, lower = (None if bound is None else -bound + target for bound in (item.lower, item.upper))
        yield replace(item, source=model.ZERO, target=item.source, lower=lower, upper=upper)
