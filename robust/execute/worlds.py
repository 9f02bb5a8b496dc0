"""Simulated worlds: they carry out a dispatcher's decisions, and report what happens.

The durations of actions, their consumption and the times of events that no one decides are drawn; all else is as the
model says. An action whose condition does not hold fails: at its start, it does not happen at all; later, it ends there
and then, without its effects at the end. Conditions over all are looked at when something happens, and once between any
two such moments. The state is a convenience of the simulation: whether a whole execution was valid is for
:mod:`robust.plan.simulate` to say.

Draws are multiples of 1/1000, except for constants and observed values. Every draw has a random number of its own, made
of the run's seed, what is drawn, and how often that has been drawn before. So two executors that meet in the same world
with the same seed have the same luck, whatever order they do things in: results can be compared pair by pair.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import count
from random import Random

from robust.execute import dispatcher
from robust.execute.dispatchable import Dispatchable, Means, NaturalLink
from robust.execute.rules import FactorRule, Rule, Rules, named
from robust.plan import model, timeline
from robust.presented import VerdictEnum
from robust.probability.distributions import on_grid


class Luck:
    """The draws of one run; durations are never below 0."""

    def __init__(self, rules: Rules, seed: int | str) -> None:
        self.rules = rules
        self._seed = seed
        self._count: Counter[str] = Counter()
        self._kept: dict[str, Fraction] = {}

    def duration(self, instance: model.ActionInstance, planned: Fraction) -> Fraction | None:
        """The duration of an instance this time; None without a rule."""
        names = named(instance)
        joint = next((part for rule in self.rules.covariances for part in rule.parts(names)), None)
        if joint is None:
            drawn = self._draw(self.rules.duration(instance), f"duration {instance}", planned)
        else:
            drawn = on_grid(sum(share * self._normal(what) for what, share in joint.shares)) + (
                planned if joint.mean is None else joint.mean
            )
        for rule in self.rules.factors:
            if names.intersection(rule.subjects):
                own, factor = planned if drawn is None else drawn, self._factor(rule)
                drawn = own * factor if rule.scales else own + factor
        return None if drawn is None else max(drawn, Fraction(0))

    def _factor(self, rule: FactorRule) -> Fraction:
        """The value of a factor in this run."""
        key = f"factor {rule.name}"
        if key not in self._kept:
            self._kept[key] = rule.distribution.draw(Random(f"{self._seed}/{key}"))  # noqa: S311 - a simulation
        return self._kept[key]

    def _normal(self, what: str) -> float:
        """A standard normal value of this run."""
        return Random(f"{self._seed}/{what}").gauss(0, 1)  # noqa: S311 - a simulation

    def consumption(self, instance: model.ActionInstance, fluent: model.Fluent, planned: Fraction) -> Fraction | None:
        """The value of a fluent for an instance; None without a rule."""
        return self._draw(self.rules.consumption(fluent), f"{fluent} of {instance}", planned)

    def parameter(self, name: str, planned: Fraction, *, once: bool) -> Fraction | None:
        """The value of a parameter; None without a rule. With `once` it stays what it was when it was drawn first."""
        if once and name in self._kept:
            return self._kept[name]
        drawn = self._draw(self.rules.parameter(name), f"parameter {name}", planned)
        if once and drawn is not None:
            self._kept[name] = drawn
        return drawn

    def _draw(self, rule: Rule | None, what: str, planned: Fraction) -> Fraction | None:
        if rule is None:
            return None
        number = self._count[what]
        self._count[what] += 1
        return rule.about(planned).draw(Random(f"{self._seed}/{what}/{number}"))  # noqa: S311 - no secrets here


class WorldState:
    """Atoms, fluents and the moment; `flows` are the rates of running instances by their identifier."""

    def __init__(self, atoms: Iterable[model.Atom], fluents: Mapping[model.Fluent, Fraction]) -> None:
        self.atoms = set(atoms)
        self.fluents = dict(fluents)
        self.time = Fraction(0)
        self.flows: dict[str, tuple[tuple[model.Fluent, Fraction], ...]] = {}

    def snapshot(self) -> timeline.State:
        """A copy that does not change any more."""
        return timeline.State(frozenset(self.atoms), dict(self.fluents))

    def advance(self, time: Fraction) -> None:
        """Let time pass: fluents change continuously."""
        if self.flows and time > self.time:
            for flow in self.flows.values():
                for fluent, rate in flow:
                    self.fluents[fluent] += rate * (time - self.time)
        self.time = max(self.time, time)

    def unmet(
        self, instance: model.ActionInstance, timing: model.Timing, duration: Fraction | None = None
    ) -> str | None:
        """The first condition of an instance, of a given timing, that is false now, as a reason; None if all hold.

        Conditions that read `?duration` hold until the duration is known.
        """

        def is_known(variables: Collection[model.NumericVariable]) -> bool:
            return duration is not None or model.Duration() not in variables

        return dispatcher.unmet(instance, timing, self._reading(duration), is_known)

    def apply(self, instance: model.ActionInstance, timing: model.Timing, duration: Fraction | None = None) -> None:
        """The effects of an instance at one of its time points; all of them read the state before any."""
        reading = self._reading(duration)
        writes = [part for part in instance.atom_effects if part.timing is timing and reading.holds(part.condition)]
        updates = [part for part in instance.numeric_effects if part.timing is timing and reading.holds(part.condition)]
        changes = [(update, reading.expression(update.expression)) for update in updates]
        self.atoms.difference_update([write.atom for write in writes if not write.value])
        self.atoms.update([write.atom for write in writes if write.value])
        for effect, value in sorted(changes, key=lambda change: change[0].operator is model.AssignmentKind.INCREASE):
            if effect.operator is model.AssignmentKind.ASSIGN:
                self.fluents[effect.fluent] = value
            else:
                self.fluents[effect.fluent] = reading.variable(effect.fluent) + value

    def begin_flows(self, instance: model.ActionInstance, duration: Fraction | None) -> None:
        """Continuous effects set in; their rates stay as they are now."""
        reading = self._reading(duration)
        flow = tuple((effect.fluent, reading.expression(effect.rate)) for effect in instance.continuous_effects)
        self.flows.update({instance.identifier: flow} if flow else {})

    def pass_literal(self, literal: model.TimedLiteral) -> None:
        """A timed initial literal takes effect."""
        match literal.target:
            case model.Fluent():
                self.fluents[literal.target] = Fraction(literal.value)
            case atom if literal.value:
                self.atoms.add(atom)
            case atom:
                self.atoms.discard(atom)

    def _reading(self, duration: Fraction | None) -> timeline.Reading:
        return timeline.Reading(timeline.State(frozenset(self.atoms), self.fluents), {}, duration)


class InstanceOutcome(VerdictEnum):
    """Outcome of an instance."""

    DONE = "done"
    FAILED = "failed"
    """A condition stopped to hold."""
    STOPPED = "stopped"
    """The instance was running when the plan was given up, and was not waited for."""
    RUNNING = "running"


@dataclass(slots=True)
class ExecutedInstance:
    """The execution of one instance with actual values: parameters are replaced in `instance`.

    Times are from the beginning of the plan. `natural` says that the duration was not the dispatcher's to choose.
    """

    instance: model.ActionInstance
    start: Fraction
    end: Fraction | None
    outcome: InstanceOutcome
    natural: bool


class SimulatedWorld:
    """One run of a plan in a world; see :class:`robust.execute.drive.World`. Time begins at 0.

    Args:
        dispatchable: the plan.
        luck: what nature draws.
        levels_known: whether initial levels are facts, as in a plan for the state that another one has reached; else
            those that are parameters are drawn.
    """

    def __init__(self, dispatchable: Dispatchable, luck: Luck, *, levels_known: bool = False) -> None:
        self.dispatchable = dispatchable
        self.executed: dict[str, ExecutedInstance] = {}
        plan = dispatchable.plan
        self._luck = luck
        self._values = {drawn.name: self._drawn(drawn, levels_known=levels_known) for drawn in plan.parameters}
        self._consumed: dict[tuple[str, model.Fluent], Fraction] = {}
        self._due: dict[str, Fraction] = {}
        """When what is running will end, where that is known."""
        self._changed = True
        self._given_up = False
        self._messages: list[dispatcher.Message] = []
        self._agenda: list[tuple[Fraction, int, Callable[[], None]]] = []
        self._order = count()
        self.initial = self._initial_levels()
        """The fluents at time 0 as they really are."""
        self.state = WorldState(plan.initial_atoms, self.initial)
        for literal in plan.timed_literals:
            self._plan_for(literal.time, partial(self.state.pass_literal, literal))
        self._follow(model.ZERO, Fraction(0))

    @property
    def values(self) -> dict[model.NumericVariable, Fraction]:
        """The actual values of parameters; a duration has its value from the start of its action on."""
        return {model.ParameterReference(name): value for name, value in self._values.items()}

    # -- the world ---------------------------------------------------------------------------------------------------

    def receive(self, now: Fraction, decisions: Sequence[dispatcher.Decision]) -> None:
        for decision in decisions:
            match decision:
                case dispatcher.Dispatch(point) if point.kind is model.TimePointKind.END:
                    self._end(point.instance or "", now)
                case dispatcher.Dispatch(point):
                    self._start(point, now)
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
            act()
            self._check_at(time)
        self._pass(now)

    def stop(self, now: Fraction) -> None:
        """End what is running, there and then."""
        self.pass_until(now)
        for execution in self._running:
            self._finish(execution, now, InstanceOutcome.STOPPED)

    # -- instances ---------------------------------------------------------------------------------------------------

    def _start(self, point: model.TimePoint, now: Fraction) -> None:
        self._pass(now)
        identifier = point.instance or ""
        planned = self.dispatchable.plan.instance[identifier]
        ending = next((link for link in self.dispatchable.followers.get(point, ()) if link.target == planned.end), None)
        duration = None if ending is None or not planned.durative else self._length(ending)
        instance = self._actual(planned, duration)
        unmet = self.state.unmet(instance, model.Timing.AT_START, duration)
        if unmet is not None:
            self._messages.append(dispatcher.DispatchFailed(identifier, now, unmet))
            return
        self.state.apply(instance, model.Timing.AT_START, duration)
        run = ExecutedInstance(instance, now, None, InstanceOutcome.RUNNING, duration is not None)
        self.executed[identifier] = run
        if planned.durative:
            self.state.begin_flows(instance, duration)
        else:
            self._finish(run, now, InstanceOutcome.DONE)
        self._check_at(now)
        self._reveal(point)
        if duration is not None:
            end = self._due[identifier] = now + duration
            self._plan_for(end, partial(self._complete, identifier, end))
        self._follow(point, now)

    def _complete(self, identifier: str, time: Fraction) -> None:
        if self.executed[identifier].outcome is InstanceOutcome.RUNNING and self._end(identifier, time):
            self._messages.append(dispatcher.Completed(identifier, time))

    def _end(self, identifier: str, now: Fraction) -> bool:
        """Whether the instance ended as it should."""
        execution = self.executed.get(identifier)
        if execution is None or execution.outcome is not InstanceOutcome.RUNNING:
            return False
        self._pass(now)
        duration = now - execution.start
        unmet = self.state.unmet(execution.instance, model.Timing.AT_END, duration)
        if unmet is not None:
            self._fail(execution, now, unmet)
            return False
        self._finish(execution, now, InstanceOutcome.DONE)
        self.state.apply(execution.instance, model.Timing.AT_END, duration)
        self._check_at(now)
        point = self.dispatchable.plan.instance[identifier].end
        self._reveal(point)
        self._follow(point, now)
        return True

    def _finish(self, execution: ExecutedInstance, now: Fraction, outcome: InstanceOutcome) -> None:
        self.state.flows.pop(execution.instance.identifier, None)
        execution.end, execution.outcome = now, outcome

    def _fail(self, running: ExecutedInstance, now: Fraction, reason: str) -> None:
        self._finish(running, now, InstanceOutcome.FAILED)
        self._messages.append(dispatcher.DispatchFailed(running.instance.identifier, now, reason))

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
            for instance, reason in broken:
                self._fail(instance, time, reason)
        self.state.advance(time)

    def _check_at(self, now: Fraction) -> None:
        """Check over-all conditions at a moment, of instances that are known to run before and after it."""
        self._changed = True
        inside = [run for run in self._running if run.start < now < self._due.get(run.instance.identifier, now)]
        for instance, reason in self._broken(inside):
            self._fail(instance, now, reason)

    @property
    def _running(self) -> list[ExecutedInstance]:
        return [execution for execution in self.executed.values() if execution.outcome is InstanceOutcome.RUNNING]

    def _broken(self, running: Sequence[ExecutedInstance]) -> list[tuple[ExecutedInstance, str]]:
        reasons = ((execution, self.state.unmet(execution.instance, model.Timing.OVER_ALL)) for execution in running)
        return [(execution, reason) for execution, reason in reasons if reason is not None]

    # -- nature ------------------------------------------------------------------------------------------------------

    def _plan_for(self, time: Fraction, act: Callable[[], None]) -> None:
        heapq.heappush(self._agenda, (time, next(self._order), act))

    def _follow(self, point: model.TimePoint, now: Fraction) -> None:
        """Starts that happen by themselves after a time point; ends follow from starts."""
        for link in self.dispatchable.followers.get(point, ()):
            if link.target.kind is not model.TimePointKind.END:
                time = now + self._length(link)
                self._plan_for(time, partial(self._begin, link.target, time))

    def _begin(self, point: model.TimePoint, time: Fraction) -> None:
        if self._given_up:
            return
        self._messages.append(dispatcher.Started(point.instance or "", time))
        self._start(point, time)

    def _length(self, link: NaturalLink) -> Fraction:
        """The actual length of a distance; the parameter that it reveals gets the value that it has then."""
        nominal = link.length.evaluate(self.dispatchable.plan.nominal)
        instance = self.dispatchable.plan.instance[link.target.instance or ""]
        is_duration = link.source == instance.start and link.target == instance.end
        drawn = self._luck.duration(instance, nominal) if is_duration else None
        if drawn is None:
            return max(link.length.evaluate(self._values), Fraction(0))
        if link.parameter is not None:
            self._values[link.parameter] = link.revealed(drawn)
        return drawn

    def _drawn(self, parameter: model.Parameter, *, levels_known: bool) -> Fraction:
        means = self.dispatchable.means.get(parameter.name)
        if means is Means.INITIAL and levels_known:
            return parameter.nominal
        drawn = self._luck.parameter(parameter.name, parameter.nominal, once=means is not Means.TIME)
        return parameter.nominal if drawn is None else drawn

    def _initial_levels(self) -> dict[model.Fluent, Fraction]:
        """Levels as they are; fluents that nothing changes keep the values that the plan expects."""
        levels = dict(self.dispatchable.levels)
        plan = self.dispatchable.plan
        reading = timeline.Reading(timeline.State(frozenset(), {}), self._values)
        for revelation in self.dispatchable.expected.get(model.ZERO, ()):
            for fluent, value in plan.initial_fluents.items():
                if model.ParameterReference(revelation.parameter) in value.variables:
                    levels[fluent] = reading.expression(value)
            self._messages.append(dispatcher.Observed(revelation.parameter, self._values[revelation.parameter]))
        return levels

    def _actual(self, instance: model.ActionInstance, duration: Fraction | None) -> model.ActionInstance:
        """The instance with what it will really need and consume."""
        values = self.values
        plan = self.dispatchable.plan
        for fluent in self.dispatchable.varying[instance.identifier]:
            drawn = self._luck.consumption(instance, fluent, self.dispatchable.levels[fluent])
            if drawn is None and not plan.initial_fluents[fluent].is_constant:
                drawn = plan.initial_fluents[fluent].evaluate(self.values)
            if drawn is not None:
                values[fluent] = drawn
                self._consumed[instance.identifier, fluent] = drawn
        if duration is not None:
            values[model.Duration()] = duration
        if self.dispatchable.reads[instance.identifier].isdisjoint(values):
            return instance
        return model.with_values(instance, values)

    def _reveal(self, point: model.TimePoint) -> None:
        for revelation in self.dispatchable.expected.get(point, ()):
            name, instance = revelation.parameter, revelation.instance
            self._messages.append(dispatcher.Observed(name, self._revealed(name, instance), instance))

    def _revealed(self, name: str, identifier: str | None) -> Fraction:
        """The value that an instance shows of a parameter: it may have been drawn for this instance alone."""
        plan = self.dispatchable.plan
        reference = model.ParameterReference(name)
        for fluent in self.dispatchable.varying.get(identifier or "", ()):
            value = plan.initial_fluents[fluent]
            if reference in value.variables and value.is_linear and (identifier or "", fluent) in self._consumed:
                factor = dict(value.coefficients())[reference]
                return (self._consumed[identifier or "", fluent] - value.constant_term) / factor
        return self._values[name]
