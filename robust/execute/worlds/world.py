"""Action instances with actual values in place of parameters and of fluents whose value varies."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from itertools import count
from typing import assert_never

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
from robust.execute.dispatch.prepare import Dispatchable, Means
from robust.execute.worlds.rules import Luck
from robust.plan.model import (
    ZERO,
    ActionInstance,
    And,
    Assignment,
    Atom,
    Comparison,
    Condition,
    Duration,
    Expression,
    Fluent,
    Holds,
    NumericVariable,
    Or,
    Parameter,
    ParameterReference,
    TimedCondition,
    TimedLiteral,
    TimePoint,
    TimePointKind,
    Timing,
    Truth,
)
from robust.plan.polynomial import Polynomial
from robust.plan.timeline import Reading, State, leaves

Values = Mapping[NumericVariable, Fraction]


def variables_of(instance: ActionInstance) -> frozenset[NumericVariable]:
    """The variables that an instance reads."""
    return frozenset(variable for expression in _expressions(instance) for variable in expression.variables)


def variables_of_effects(instance: ActionInstance) -> frozenset[NumericVariable]:
    """The variables that decide how much an instance changes."""
    expressions = [effect.expression for effect in instance.numeric_effects]
    expressions += [effect.rate for effect in instance.continuous_effects]
    return frozenset(variable for expression in expressions for variable in expression.variables)


def _expressions(instance: ActionInstance) -> Iterator[Expression]:
    conditions: list[Condition] = [one.condition for one in instance.durations]
    conditions += [one.condition for one in instance.conditions]
    conditions += [one.condition for one in instance.atom_effects]
    conditions += [one.condition for one in instance.numeric_effects]
    for condition in conditions:
        yield from (leaf.expression for leaf in leaves(condition) if isinstance(leaf, Comparison))
    yield from (effect.expression for effect in instance.numeric_effects)
    yield from (effect.rate for effect in instance.continuous_effects)


def with_values(instance: ActionInstance, values: Values) -> ActionInstance:
    """The instance with these variables replaced by their values, in conditions and effects."""
    if not values or variables_of(instance).isdisjoint(values):
        return instance
    return replace(
        instance,
        durations=tuple(replace(one, condition=_comparison(one.condition, values)) for one in instance.durations),
        conditions=tuple(replace(one, condition=condition_with(one.condition, values)) for one in instance.conditions),
        atom_effects=tuple(
            replace(one, condition=condition_with(one.condition, values)) for one in instance.atom_effects
        ),
        numeric_effects=tuple(
            replace(
                one,
                expression=expression_with(one.expression, values),
                condition=condition_with(one.condition, values),
            )
            for one in instance.numeric_effects
        ),
        continuous_effects=tuple(
            replace(one, rate=expression_with(one.rate, values)) for one in instance.continuous_effects
        ),
    )


def expression_with(expression: Expression, values: Values) -> Expression:
    """An expression with these variables replaced by their values."""

    def value(variable: NumericVariable) -> Expression:
        known = values.get(variable)
        return Polynomial.variable(variable) if known is None else Polynomial.constant(known)

    return expression.substitute(value)


def _comparison(condition: Comparison, values: Values) -> Comparison:
    return Comparison(expression_with(condition.expression, values), condition.relation)


def condition_with(condition: Condition, values: Values) -> Condition:
    """A condition with these variables replaced by their values."""
    match condition:
        case Truth() | Holds():
            return condition
        case Comparison():
            return _comparison(condition, values)
        case And(operands):
            return And(tuple(condition_with(one, values) for one in operands))
        case Or(operands):
            return Or(tuple(condition_with(one, values) for one in operands))
    assert_never(condition)


class WorldState:
    """Atoms, fluents and the moment; `flows` are the rates of running instances by their identifier."""

    def __init__(self, atoms: Iterable[Atom], fluents: Mapping[Fluent, Fraction], time: Fraction = Fraction(0)) -> None:
        self.atoms = set(atoms)
        self.fluents = dict(fluents)
        self.time = time
        self.flows: dict[str, tuple[tuple[Fluent, Fraction], ...]] = {}

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
        self, instance: ActionInstance, timing: Timing, duration: Fraction | None = None
    ) -> TimedCondition | None:
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

    def apply(self, instance: ActionInstance, timing: Timing, duration: Fraction | None = None) -> None:
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
        for effect, value in sorted(changes, key=lambda change: change[0].operator is Assignment.INCREASE):
            if effect.operator is Assignment.ASSIGN:
                self.fluents[effect.fluent] = value
            else:
                self.fluents[effect.fluent] = reading.variable(effect.fluent) + value

    def begin_flows(self, instance: ActionInstance, duration: Fraction | None) -> None:
        """Continuous effects set in; their rates stay as they are now."""
        if instance.continuous_effects:
            reading = self._reading(duration)
            flow = tuple((one.fluent, reading.expression(one.rate)) for one in instance.continuous_effects)
            self.flows[instance.identifier] = flow

    def end_flows(self, instance: ActionInstance) -> None:
        self.flows.pop(instance.identifier, None)

    def pass_literal(self, literal: TimedLiteral) -> None:
        """A timed initial literal takes effect."""
        match literal.target:
            case Fluent():
                self.fluents[literal.target] = Fraction(literal.value)
            case atom if literal.value:
                self.atoms.add(atom)
            case atom:
                self.atoms.discard(atom)

    def _reading(self, duration: Fraction | None) -> Reading:
        return Reading(State(frozenset(self.atoms), self.fluents), {}, duration)


def _reads_duration(condition: Condition) -> bool:
    return any(isinstance(leaf, Comparison) and Duration() in leaf.expression.variables for leaf in leaves(condition))


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
