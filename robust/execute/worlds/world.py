"""A simulated world: it carries out what a dispatcher decides, and tells it what comes of that.

How long actions take, how much they consume and when things happen that nobody decides is drawn (:mod:`.luck`); all
else is as the model says. An action whose condition does not hold fails: at its start, it does not happen at all;
later, it ends there and then, without its effects at the end. Conditions over all are looked at when something happens,
and once between any two such moments.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from itertools import count

from robust.execute.dispatch.messages import (
    Completed,
    Contradicted,
    Decision,
    Dispatch,
    Failed,
    Finish,
    LeftBox,
    Message,
    Missed,
    Observed,
    Started,
    Unobserved,
)
from robust.execute.dispatch.network import NaturalLink
from robust.execute.dispatch.observability import Means
from robust.execute.dispatch.prepare import Dispatchable
from robust.execute.worlds.actual import variables_of, variables_of_effects, with_values
from robust.execute.worlds.luck import Luck
from robust.execute.worlds.state import WorldState
from robust.plan.model import (
    ZERO,
    ActionInstance,
    Duration,
    Fluent,
    NumericVariable,
    Parameter,
    ParameterReference,
    TimePoint,
    TimePointKind,
    Timing,
)
from robust.plan.timeline import Reading, State


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

    instance: ActionInstance
    start: Fraction
    end: Fraction | None
    outcome: Outcome
    natural: bool


@dataclass(frozen=True)
class Setting:
    """What a simulated world needs to know of a plan, worked out once for any number of runs."""

    dispatchable: Dispatchable

    @cached_property
    def natural(self) -> Mapping[TimePoint, tuple[NaturalLink, ...]]:
        """What happens by itself once a time point has happened."""
        return self.dispatchable.followers

    @cached_property
    def reads(self) -> dict[str, frozenset[NumericVariable]]:
        """The variables that each instance reads."""
        return {one.identifier: variables_of(one) for one in self.dispatchable.plan.instances}

    @cached_property
    def varying(self) -> dict[str, tuple[Fluent, ...]]:
        """For each instance the fluents in its effects that nothing changes: what it may consume."""
        plan = self.dispatchable.plan
        changed = {effect.fluent for one in plan.instances for effect in one.numeric_effects}
        changed |= {effect.fluent for one in plan.instances for effect in one.continuous_effects}
        return {
            one.identifier: tuple(
                sorted(v for v in variables_of_effects(one) if isinstance(v, Fluent) and v not in changed)
            )
            for one in plan.instances
        }

    @cached_property
    def parameters_of(self) -> dict[str, tuple[ParameterReference, ...]]:
        """The parameters that each instance reads."""
        return {
            identifier: tuple(sorted(v for v in read if isinstance(v, ParameterReference)))
            for identifier, read in self.reads.items()
        }

    @cached_property
    def means(self) -> dict[str, Means]:
        """How each parameter is revealed; those that nothing reveals are missing."""
        return {one.parameter: one.means for one in self.dispatchable.observability.revelations}

    @cached_property
    def levels(self) -> dict[Fluent, Fraction]:
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
        self._consumed: dict[tuple[str, Fluent], Fraction] = {}
        self._due: dict[str, Fraction] = {}
        """When what is running will end, where that is known."""
        self._changed = True
        self._given_up = False
        self._messages: list[Message] = []
        self._agenda: list[tuple[Fraction, int, Callable[[Fraction], None]]] = []
        self._order = count()
        self.initial = self._initial_levels()
        """The fluents at time 0 as they really are."""
        self.state = WorldState(plan.initial_atoms, self.initial)
        for literal in plan.timed_literals:
            self._plan_for(literal.time, lambda _, literal=literal: self.state.pass_literal(literal))  # type: ignore[misc]
        self._follow(ZERO, Fraction(0))

    @property
    def values(self) -> dict[NumericVariable, Fraction]:
        """The actual values of parameters; a duration has its value from the start of its action on."""
        return {ParameterReference(name): value for name, value in self._values.items()}

    # -- the world ---------------------------------------------------------------------------------------------------

    def receive(self, now: Fraction, decisions: Sequence[Decision]) -> None:
        for decision in decisions:
            match decision:
                case Dispatch(point):
                    self._start(point, now)
                case Finish(point):
                    self._end(point.instance or "", now)
                case LeftBox() | Missed() | Unobserved() | Contradicted():
                    self._given_up = True
                case _:
                    pass

    @property
    def next_time(self) -> Fraction | None:
        if self._messages:
            return self.state.time
        return self._agenda[0][0] if self._agenda else None

    def messages(self, now: Fraction) -> Sequence[Message]:
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
        for one in self.executed.values():
            if one.outcome is Outcome.RUNNING:
                self._finish(one, now, Outcome.STOPPED)

    # -- instances ---------------------------------------------------------------------------------------------------

    def _start(self, point: TimePoint, now: Fraction) -> None:
        self._pass(now)
        identifier = point.instance or ""
        planned = self.setting.dispatchable.plan.instance[identifier]
        ending = next((link for link in self.setting.natural.get(point, ()) if link.target == planned.end), None)
        duration = None if ending is None or not planned.durative else self._length(ending)
        instance = self._actual(planned, duration)
        unmet = self.state.unmet(instance, Timing.AT_START, duration)
        if unmet is not None:
            self._messages.append(Failed(identifier, now, f"{unmet.text} does not hold"))
            return
        self.state.apply(instance, Timing.AT_START, duration)
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
            self._messages.append(Completed(identifier, time))

    def _end(self, identifier: str, now: Fraction) -> bool:
        """Whether the instance ended as it should."""
        one = self.executed.get(identifier)
        if one is None or one.outcome is not Outcome.RUNNING:
            return False
        self._pass(now)
        duration = now - one.start
        unmet = self.state.unmet(one.instance, Timing.AT_END, duration)
        if unmet is not None:
            self._fail(one, now, unmet.text)
            return False
        self._finish(one, now, Outcome.DONE)
        self.state.apply(one.instance, Timing.AT_END, duration)
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
        self._messages.append(Failed(one.instance.identifier, now, f"{condition} does not hold"))

    # -- conditions over all -----------------------------------------------------------------------------------------

    def _pass(self, time: Fraction) -> None:
        """Let time pass. What is running has conditions in between, wherever it ends."""
        begin = self.state.time
        if time <= begin:
            return
        if self._changed or self.state.flows:
            self.state.advance((begin + time) / 2)
            broken = self._broken([one for one in self.executed.values() if one.outcome is Outcome.RUNNING])
            self.state.advance(time)
            self._changed = False
            for one, condition in broken:
                self._fail(one, time, condition)
        self.state.advance(time)

    def _check_at(self, now: Fraction) -> None:
        """What is known to be running before and after a moment has its conditions at that moment."""
        self._changed = True
        inside = [one for one in self.executed.values() if one.outcome is Outcome.RUNNING and one.start < now]
        for one, condition in self._broken(
            [one for one in inside if self._due.get(one.instance.identifier, now) > now]
        ):
            self._fail(one, now, condition)

    def _broken(self, running: Sequence[Executed]) -> list[tuple[Executed, str]]:
        found = [(one, self.state.unmet(one.instance, Timing.OVER_ALL)) for one in running]
        return [(one, unmet.text) for one, unmet in found if unmet is not None]

    # -- what nobody decides -----------------------------------------------------------------------------------------

    def _plan_for(self, time: Fraction, act: Callable[[Fraction], None]) -> None:
        heapq.heappush(self._agenda, (time, next(self._order), act))

    def _follow(self, point: TimePoint, now: Fraction) -> None:
        """Starts that happen by themselves after a time point; ends follow from starts."""
        for link in self.setting.natural.get(point, ()):
            if link.target.kind is not TimePointKind.END:
                self._plan_for(now + self._length(link), lambda time, link=link: self._begin(link.target, time))  # type: ignore[misc]

    def _begin(self, point: TimePoint, time: Fraction) -> None:
        if self._given_up:
            return
        self._messages.append(Started(point.instance or "", time))
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

    def _drawn(self, parameter: Parameter, *, levels_known: bool) -> Fraction:
        means = self.setting.means.get(parameter.name)
        if means is Means.INITIAL and levels_known:
            return parameter.nominal
        drawn = self._luck.parameter(parameter.name, parameter.nominal, once=means is not Means.TIME)
        return parameter.nominal if drawn is None else drawn

    def _initial_levels(self) -> dict[Fluent, Fraction]:
        """Levels as they are; fluents that nothing changes keep the values that the plan expects."""
        levels = dict(self.setting.levels)
        plan = self.setting.dispatchable.plan
        reading = Reading(State(frozenset(), {}), self._values)
        for one in self.setting.dispatchable.expected.get(ZERO, ()):
            for fluent, value in plan.initial_fluents.items():
                if ParameterReference(one.parameter) in value.variables:
                    levels[fluent] = reading.expression(value)
            self._messages.append(Observed(one.parameter, self._values[one.parameter]))
        return levels

    def _actual(self, instance: ActionInstance, duration: Fraction | None) -> ActionInstance:
        """The instance with what it will really need and consume."""
        values: dict[NumericVariable, Fraction] = {
            reference: self._values[reference.name] for reference in self.setting.parameters_of[instance.identifier]
        }
        plan = self.setting.dispatchable.plan
        for fluent in self.setting.varying[instance.identifier]:
            drawn = self._luck.consumption(instance, fluent, self.setting.levels[fluent])
            if drawn is None and not plan.initial_fluents[fluent].is_constant:
                drawn = plan.initial_fluents[fluent].evaluate(
                    {ParameterReference(name): value for name, value in self._values.items()}
                )
            if drawn is not None:
                values[fluent] = drawn
                self._consumed[instance.identifier, fluent] = drawn
        if duration is not None:
            values[Duration()] = duration
        if self.setting.reads[instance.identifier].isdisjoint(values):
            return instance
        return with_values(instance, values)

    def _reveal(self, point: TimePoint) -> None:
        for one in self.setting.dispatchable.expected.get(point, ()):
            self._messages.append(Observed(one.parameter, self._revealed(one.parameter, one.instance), one.instance))

    def _revealed(self, name: str, identifier: str | None) -> Fraction:
        """The value that an instance shows of a parameter: it may have been drawn for this instance alone."""
        plan = self.setting.dispatchable.plan
        reference = ParameterReference(name)
        for fluent in self.setting.varying.get(identifier or "", ()):
            value = plan.initial_fluents[fluent]
            if reference in value.variables and value.is_linear and (identifier or "", fluent) in self._consumed:
                factor = dict(value.coefficients())[reference]
                return (self._consumed[identifier or "", fluent] - value.constant_term) / factor
        return self._values[name]
