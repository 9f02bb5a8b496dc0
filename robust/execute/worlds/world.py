"""A simulated world: it carries out what a dispatcher decides, and tells it what comes of that.

How long actions take, how much they consume and when things happen that nobody decides is drawn
(:mod:`robust.execute.worlds.rules`); all else is as the model says. An action whose condition does not hold fails: at
its start, it does not happen at all; later, it ends there and then, without its effects at the end. Conditions over all
are looked at when something happens, and once between any two such moments.

The state is a convenience of the simulation: whether a whole execution was valid is for :mod:`robust.plan.simulate` to
say.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from itertools import count
from typing import TypeVar, assert_never

from robust.execute.dispatch import dispatcher
from robust.execute.dispatch.network import Dispatchable, Means, NaturalLink, written_fluents
from robust.execute.worlds.rules import Luck
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.plan.timeline import Reading, State

Values = Mapping[model.NumericVariable, Fraction]


def variables_of(instance: model.ActionInstance) -> frozenset[model.NumericVariable]:
    """The variables that an instance reads."""
    conditions: list[model.Condition] = [one.condition for one in instance.durations]
    conditions += [one.condition for one in instance.conditions]
    conditions += [one.condition for one in instance.atom_effects]
    conditions += [one.condition for one in instance.numeric_effects]
    compared = (one.expression for condition in conditions for one in model.comparisons(condition))
    return variables_of_effects(instance).union(*(expression.variables for expression in compared))


def variables_of_effects(instance: model.ActionInstance) -> frozenset[model.NumericVariable]:
    """The variables that decide how much an instance changes."""
    changes = (effect.expression.variables for effect in instance.numeric_effects)
    return frozenset[model.NumericVariable]().union(
        *changes, *(flow.rate.variables for flow in instance.continuous_effects)
    )


_Conditional = TypeVar("_Conditional", model.TimedCondition, model.AtomEffect, model.NumericEffect)


def _conditional(parts: Iterable[_Conditional], values: Values) -> tuple[_Conditional, ...]:
    return tuple(replace(one, condition=condition_with(one.condition, values)) for one in parts)


def with_values(instance: model.ActionInstance, values: Values) -> model.ActionInstance:
    """The instance with these variables replaced by their values, in conditions and effects."""
    return replace(
        instance,
        durations=tuple(replace(one, condition=_comparison(one.condition, values)) for one in instance.durations),
        conditions=_conditional(instance.conditions, values),
        atom_effects=_conditional(instance.atom_effects, values),
        numeric_effects=tuple(
            replace(one, expression=expression_with(one.expression, values))
            for one in _conditional(instance.numeric_effects, values)
        ),
        continuous_effects=tuple(
            replace(one, rate=expression_with(one.rate, values)) for one in instance.continuous_effects
        ),
    )


def expression_with(expression: model.Expression, values: Values) -> model.Expression:
    """An expression with these variables replaced by their values."""

    def value(variable: model.NumericVariable) -> model.Expression:
        known = values.get(variable)
        return Polynomial.variable(variable) if known is None else Polynomial.constant(known)

    return expression.substitute(value)


def _comparison(condition: model.Comparison, values: Values) -> model.Comparison:
    return model.Comparison(expression_with(condition.expression, values), condition.relation)


def condition_with(condition: model.Condition, values: Values) -> model.Condition:
    """A condition with these variables replaced by their values."""
    match condition:
        case model.Truth() | model.Holds():
            return condition
        case model.Comparison():
            return _comparison(condition, values)
        case model.And(operands) | model.Or(operands):
            return type(condition)(tuple(condition_with(one, values) for one in operands))
    assert_never(condition)


class WorldState:
    """Atoms, fluents and the moment; `flows` are the rates of running instances by their identifier."""

    def __init__(
        self, atoms: Iterable[model.Atom], fluents: Mapping[model.Fluent, Fraction], time: Fraction = Fraction(0)
    ) -> None:
        self.atoms = set(atoms)
        self.fluents = dict(fluents)
        self.time = time
        self.flows: dict[str, tuple[tuple[model.Fluent, Fraction], ...]] = {}

    def snapshot(self) -> State:
        """A copy that does not change any more."""
        return State(frozenset(self.atoms), dict(self.fluents))

    def advance(self, time: Fraction) -> None:
        """Let time pass: fluents change continuously."""
        if self.flows and time > self.time:
            for flow in self.flows.values():
                for fluent, rate in flow:
                    self.fluents[fluent] += rate * (time - self.time)
        self.time = max(self.time, time)

    def unmet(
        self, instance: model.ActionInstance, timing: model.Timing, duration: Fraction | None = None
    ) -> model.TimedCondition | None:
        """The first condition of an instance, of that timing, that does not hold now.

        Conditions that read `?duration` hold until the duration is known.
        """
        parts = [one for one in instance.conditions if one.timing is timing]
        if duration is None:
            parts = [one for one in parts if not _reads_duration(one.condition)]
        if not parts:
            return None
        reading = self._reading(duration)
        return next((one for one in parts if not reading.holds(one.condition)), None)

    def apply(self, instance: model.ActionInstance, timing: model.Timing, duration: Fraction | None = None) -> None:
        """The effects of an instance at one of its time points; all of them read the state before any."""
        reading = self._reading(duration)
        adds = [one for one in instance.atom_effects if one.timing is timing and reading.holds(one.condition)]
        changes = [
            (one, reading.expression(one.expression))
            for one in instance.numeric_effects
            if one.timing is timing and reading.holds(one.condition)
        ]
        self.atoms.difference_update([one.atom for one in adds if not one.value])
        self.atoms.update([one.atom for one in adds if one.value])
        for effect, value in sorted(changes, key=lambda change: change[0].operator is model.Assignment.INCREASE):
            if effect.operator is model.Assignment.ASSIGN:
                self.fluents[effect.fluent] = value
            else:
                self.fluents[effect.fluent] = reading.variable(effect.fluent) + value

    def begin_flows(self, instance: model.ActionInstance, duration: Fraction | None) -> None:
        """Continuous effects set in; their rates stay as they are now."""
        if instance.continuous_effects:
            reading = self._reading(duration)
            flow = tuple((one.fluent, reading.expression(one.rate)) for one in instance.continuous_effects)
            self.flows[instance.identifier] = flow

    def end_flows(self, instance: model.ActionInstance) -> None:
        self.flows.pop(instance.identifier, None)

    def pass_literal(self, literal: model.TimedLiteral) -> None:
        """A timed initial literal takes effect."""
        match literal.target:
            case model.Fluent():
                self.fluents[literal.target] = Fraction(literal.value)
            case atom if literal.value:
                self.atoms.add(atom)
            case atom:
                self.atoms.discard(atom)

    def _reading(self, duration: Fraction | None) -> Reading:
        return Reading(State(frozenset(self.atoms), self.fluents), {}, duration)


def _reads_duration(condition: model.Condition) -> bool:
    return any(model.Duration() in one.expression.variables for one in model.comparisons(condition))


class Outcome(Enum):
    """What became of an instance."""

    DONE = "done"
    FAILED = "failed"
    """A condition stopped to hold."""
    STOPPED = "stopped"
    """It was running when the plan was given up, and was not waited for."""
    RUNNING = "running"


@dataclass(slots=True)
class Executed:
    """What happened to one instance, with the values that were actual: parameters are replaced in `instance`.

    Times are from the beginning of the plan. `natural` says that the duration was not the dispatcher's to choose.
    """

    instance: model.ActionInstance
    start: Fraction
    end: Fraction | None
    outcome: Outcome
    natural: bool


@dataclass(frozen=True)
class Setting:
    """What a simulated world needs to know of a plan, worked out once for any number of runs."""

    dispatchable: Dispatchable

    @cached_property
    def reads(self) -> dict[str, frozenset[model.NumericVariable]]:
        """The variables that each instance reads."""
        return {one.identifier: variables_of(one) for one in self.dispatchable.plan.instances}

    @cached_property
    def varying(self) -> dict[str, tuple[model.Fluent, ...]]:
        """For each instance the fluents in its effects that nothing changes: what it may consume."""
        plan = self.dispatchable.plan
        changed = written_fluents(plan)
        return {
            one.identifier: tuple(
                sorted(v for v in variables_of_effects(one) if isinstance(v, model.Fluent) and v not in changed)
            )
            for one in plan.instances
        }

    @cached_property
    def parameters_of(self) -> dict[str, tuple[model.ParameterReference, ...]]:
        """The parameters that each instance reads."""
        return {
            identifier: tuple(sorted(v for v in read if isinstance(v, model.ParameterReference)))
            for identifier, read in self.reads.items()
        }

    @cached_property
    def means(self) -> dict[str, Means]:
        """How each parameter is revealed; those that nothing reveals are missing."""
        return {one.parameter: one.means for one in self.dispatchable.observability.revelations}

    @cached_property
    def levels(self) -> dict[model.Fluent, Fraction]:
        """Initial values at nominal parameter values."""
        plan = self.dispatchable.plan
        reading = Reading(State(frozenset(), {}), plan.nominal)
        return {fluent: reading.expression(value) for fluent, value in plan.initial_fluents.items()}


class SimulatedWorld:
    """One run of a plan in a world; see :class:`robust.execute.drive.World`. Time begins at 0.

    Args:
        setting: the plan.
        luck: what nature draws.
        levels_known: whether initial levels are facts, as in a plan for the state that another one has reached; else
            those that are parameters are drawn.
    """

    def __init__(self, setting: Setting, luck: Luck, *, levels_known: bool = False) -> None:
        self.setting = setting
        self.executed: dict[str, Executed] = {}
        plan = setting.dispatchable.plan
        self._luck = luck
        self._values = {one.name: self._drawn(one, levels_known=levels_known) for one in plan.parameters}
        self._consumed: dict[tuple[str, model.Fluent], Fraction] = {}
        self._due: dict[str, Fraction] = {}
        """When what is running will end, where that is known."""
        self._changed = True
        self._given_up = False
        self._messages: list[dispatcher.Message] = []
        self._agenda: list[tuple[Fraction, int, Callable[[Fraction], None]]] = []
        self._order = count()
        self.initial = self._initial_levels()
        """The fluents at time 0 as they really are."""
        self.state = WorldState(plan.initial_atoms, self.initial)
        for literal in plan.timed_literals:
            self._plan_for(literal.time, lambda _, literal=literal: self.state.pass_literal(literal))  # type: ignore[misc]
        self._follow(model.ZERO, Fraction(0))

    @property
    def values(self) -> dict[model.NumericVariable, Fraction]:
        """The actual values of parameters; a duration has its value from the start of its action on."""
        return {model.ParameterReference(name): value for name, value in self._values.items()}

    # -- the world ---------------------------------------------------------------------------------------------------

    def receive(self, now: Fraction, decisions: Sequence[dispatcher.Decision]) -> None:
        for decision in decisions:
            match decision:
                case dispatcher.Dispatch(point):
                    self._start(point, now)
                case dispatcher.Finish(point):
                    self._end(point.instance or "", now)
                case _:
                    self._given_up |= isinstance(decision, dispatcher.Ending)

    @property
    def next_time(self) -> Fraction | None:
        if self._messages:
            return self.state.time
        return self._agenda[0][0] if self._agenda else None

    def messages(self, now: Fraction) -> Sequence[dispatcher.Message]:
        self.pass_until(now)
        messages, self._messages = self._messages, []
        return messages

    def pass_until(self, now: Fraction) -> None:
        """Let everything happen that happens by itself up to a moment, and let time pass."""
        while self._agenda and self._agenda[0][0] <= now:
            time, _, act = heapq.heappop(self._agenda)
            self._pass(time)
            self._check_at(time)
            act(time)
            self._check_at(time)
        self._pass(now)

    def stop(self, now: Fraction) -> None:
        """End what is running, there and then."""
        self.pass_until(now)
        for one in self._running:
            self._finish(one, now, Outcome.STOPPED)

    # -- instances ---------------------------------------------------------------------------------------------------

    def _start(self, point: model.TimePoint, now: Fraction) -> None:
        self._pass(now)
        identifier = point.instance or ""
        planned = self.setting.dispatchable.plan.instance[identifier]
        ending = next(
            (link for link in self.setting.dispatchable.followers.get(point, ()) if link.target == planned.end), None
        )
        duration = None if ending is None or not planned.durative else self._length(ending)
        instance = self._actual(planned, duration)
        unmet = self.state.unmet(instance, model.Timing.AT_START, duration)
        if unmet is not None:
            self._messages.append(dispatcher.Failed(identifier, now, f"{unmet.text} does not hold"))
            return
        self.state.apply(instance, model.Timing.AT_START, duration)
        done = not planned.durative
        outcome = Outcome.DONE if done else Outcome.RUNNING
        self.executed[identifier] = Executed(instance, now, now if done else None, outcome, duration is not None)
        if not done:
            self.state.begin_flows(instance, duration)
        self._check_at(now)
        self._reveal(point)
        if duration is not None:
            self._due[identifier] = now + duration
            self._plan_for(now + duration, lambda time: self._complete(identifier, time))
        self._follow(point, now)

    def _complete(self, identifier: str, time: Fraction) -> None:
        if self.executed[identifier].outcome is Outcome.RUNNING and self._end(identifier, time):
            self._messages.append(dispatcher.Completed(identifier, time))

    def _end(self, identifier: str, now: Fraction) -> bool:
        """Whether the instance ended as it should."""
        one = self.executed.get(identifier)
        if one is None or one.outcome is not Outcome.RUNNING:
            return False
        self._pass(now)
        duration = now - one.start
        unmet = self.state.unmet(one.instance, model.Timing.AT_END, duration)
        if unmet is not None:
            self._fail(one, now, unmet.text)
            return False
        self._finish(one, now, Outcome.DONE)
        self.state.apply(one.instance, model.Timing.AT_END, duration)
        self._check_at(now)
        point = self.setting.dispatchable.plan.instance[identifier].end
        self._reveal(point)
        self._follow(point, now)
        return True

    def _finish(self, one: Executed, now: Fraction, outcome: Outcome) -> None:
        self.state.end_flows(one.instance)
        one.end, one.outcome = now, outcome

    def _fail(self, one: Executed, now: Fraction, condition: str) -> None:
        self._finish(one, now, Outcome.FAILED)
        self._messages.append(dispatcher.Failed(one.instance.identifier, now, f"{condition} does not hold"))

    # -- conditions over all -----------------------------------------------------------------------------------------

    def _pass(self, time: Fraction) -> None:
        """Let time pass. What is running has conditions in between, wherever it ends."""
        begin = self.state.time
        if time <= begin:
            return
        if self._changed or self.state.flows:
            self.state.advance((begin + time) / 2)
            broken = self._broken(self._running)
            self.state.advance(time)
            self._changed = False
            for one, condition in broken:
                self._fail(one, time, condition)
        self.state.advance(time)

    def _check_at(self, now: Fraction) -> None:
        """What is known to be running before and after a moment has its conditions at that moment."""
        self._changed = True
        begun = [one for one in self._running if one.start < now]
        inside = [one for one in begun if self._due.get(one.instance.identifier, now) > now]
        for one, condition in self._broken(inside):
            self._fail(one, now, condition)

    @property
    def _running(self) -> list[Executed]:
        return [one for one in self.executed.values() if one.outcome is Outcome.RUNNING]

    def _broken(self, running: Sequence[Executed]) -> list[tuple[Executed, str]]:
        found = [(one, self.state.unmet(one.instance, model.Timing.OVER_ALL)) for one in running]
        return [(one, unmet.text) for one, unmet in found if unmet is not None]

    # -- what nobody decides -----------------------------------------------------------------------------------------

    def _plan_for(self, time: Fraction, act: Callable[[Fraction], None]) -> None:
        heapq.heappush(self._agenda, (time, next(self._order), act))

    def _follow(self, point: model.TimePoint, now: Fraction) -> None:
        """Starts that happen by themselves after a time point; ends follow from starts."""
        for link in self.setting.dispatchable.followers.get(point, ()):
            if link.target.kind is not model.TimePointKind.END:
                self._plan_for(now + self._length(link), lambda time, link=link: self._begin(link.target, time))  # type: ignore[misc]

    def _begin(self, point: model.TimePoint, time: Fraction) -> None:
        if self._given_up:
            return
        self._messages.append(dispatcher.Started(point.instance or "", time))
        self._start(point, time)

    def _length(self, link: NaturalLink) -> Fraction:
        """The actual length of a distance; the parameter that it reveals gets the value that it has then."""
        plan = self.setting.dispatchable.plan
        nominal = link.length.evaluate(plan.nominal)
        instance = plan.instance[link.target.instance or ""]
        is_duration = link.source == instance.start and link.target == instance.end
        drawn = self._luck.duration(instance, nominal) if is_duration else None
        if drawn is None:
            return max(link.length.evaluate(self._values), Fraction(0))
        if link.parameter is not None:
            self._values[link.parameter] = link.revealed(drawn)
        return drawn

    def _drawn(self, parameter: model.Parameter, *, levels_known: bool) -> Fraction:
        means = self.setting.means.get(parameter.name)
        if means is Means.INITIAL and levels_known:
            return parameter.nominal
        drawn = self._luck.parameter(parameter.name, parameter.nominal, once=means is not Means.TIME)
        return parameter.nominal if drawn is None else drawn

    def _initial_levels(self) -> dict[model.Fluent, Fraction]:
        """Levels as they are; fluents that nothing changes keep the values that the plan expects."""
        levels = dict(self.setting.levels)
        plan = self.setting.dispatchable.plan
        reading = Reading(State(frozenset(), {}), self._values)
        for one in self.setting.dispatchable.expected.get(model.ZERO, ()):
            for fluent, value in plan.initial_fluents.items():
                if model.ParameterReference(one.parameter) in value.variables:
                    levels[fluent] = reading.expression(value)
            self._messages.append(dispatcher.Observed(one.parameter, self._values[one.parameter]))
        return levels

    def _actual(self, instance: model.ActionInstance, duration: Fraction | None) -> model.ActionInstance:
        """The instance with what it will really need and consume."""
        values: dict[model.NumericVariable, Fraction] = {
            reference: self._values[reference.name] for reference in self.setting.parameters_of[instance.identifier]
        }
        plan = self.setting.dispatchable.plan
        for fluent in self.setting.varying[instance.identifier]:
            drawn = self._luck.consumption(instance, fluent, self.setting.levels[fluent])
            if drawn is None and not plan.initial_fluents[fluent].is_constant:
                drawn = plan.initial_fluents[fluent].evaluate(self.values)
            if drawn is not None:
                values[fluent] = drawn
                self._consumed[instance.identifier, fluent] = drawn
        if duration is not None:
            values[model.Duration()] = duration
        if self.setting.reads[instance.identifier].isdisjoint(values):
            return instance
        return with_values(instance, values)

    def _reveal(self, point: model.TimePoint) -> None:
        for one in self.setting.dispatchable.expected.get(point, ()):
            self._messages.append(
                dispatcher.Observed(one.parameter, self._revealed(one.parameter, one.instance), one.instance)
            )

    def _revealed(self, name: str, identifier: str | None) -> Fraction:
        """The value that an instance shows of a parameter: it may have been drawn for this instance alone."""
        plan = self.setting.dispatchable.plan
        reference = model.ParameterReference(name)
        for fluent in self.setting.varying.get(identifier or "", ()):
            value = plan.initial_fluents[fluent]
            if reference in value.variables and value.is_linear and (identifier or "", fluent) in self._consumed:
                factor = dict(value.coefficients())[reference]
                return (self._consumed[identifier or "", fluent] - value.constant_term) / factor
        return self._values[name]
