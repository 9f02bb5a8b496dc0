"""What a correct execution is [PIKE, Definitions 2.5 to 2.8]: as formulas, as an oracle, and as a referee.

The formulas are over choices and event times. The oracle asks a solver about them. The referee simulates one execution,
and confirms every execution that a solver or a knowledge base gives. Scenarios are enumerated here, and plans
restricted to some of them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, product
from types import MappingProxyType
from typing import TypeAlias, TypeVar

from robust.errors import InputError, SolverError, did_you_mean
from robust.pike_bridge import model
from robust.pike_bridge.knowledge.sat import Propositions, satisfiable
from robust.plan.model import Atom
from robust.plan.polynomial import Polynomial
from robust.presented import NoTruthValue, VerdictEnum
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Formula, Session, Terms, Value

Time: TypeAlias = Polynomial[str] | Fraction
"""A moment that is known, or an expression of one."""


class Semantics(Propositions):
    """The formulas of one plan, and how its choices and times are read from their models.

    Args:
        terms: where formulas are built; plans that share them, and have events of the same names, share formulas.

        epsilon: how much earlier is "before", 0: strictly; that of the plan if not given.

    Raises:
        InputError: if a guard, a constraint, a condition or an effect mentions an unknown choice, value or event.
    """

    def __init__(self, plan: model.TeamPlan, terms: Terms | None = None, *, epsilon: Fraction | None = None) -> None:
        super().__init__(plan.network.domains, terms)
        self._events = plan.network.guards
        self._epsilon = plan.epsilon if epsilon is None else epsilon
        self._orders: dict[tuple[str, str], Formula] = {}
        self._effects: dict[model.Literal, list[model.Effect]] = {}
        for effect in plan.effects:
            self._effects.setdefault(effect.literal, []).append(effect)
        constraints = [self.constraint(constraint) for constraint in plan.network.temporal_constraints]
        self.conditions = tuple(self._condition(condition) for condition in plan.conditions)
        """Of each condition that it is met."""
        self.formulas: tuple[Formula, ...] = (*self.domains, *constraints, *self.conditions)

    def at(self, event: str, time: Fraction) -> Formula:
        """The event's time, outright."""
        return self.terms.equal(self.time_of(event) - time)

    def not_earlier(self, event: str, moment: Time, environment: model.Guard = model.ALWAYS) -> Formula:
        """The formula that the event, if it is activated in the environment, is at a moment or later."""
        return self.unless(self._events[event] | environment, self.terms.at_least(self.time_of(event) - moment))

    def times(self, events: Iterable[str]) -> list[Formula]:
        """The symbols of the events' times."""
        return [self.terms.real(f"time of {event}") for event in events]

    def time(self, event: str, values: Mapping[str, Value]) -> Fraction:
        """The event's time in a model; zero if no formula mentions it."""
        return Fraction(values.get(f"time of {event}", Fraction(0)))

    def time_of(self, event: str) -> Polynomial[str]:
        """The event's time as an expression; InputError for an unknown event."""
        if event not in self._events:
            raise InputError(f"unknown event {event}{did_you_mean(event, self._events)}")
        return super().time_of(event)

    def _condition(self, condition: model.Condition) -> Formula:
        """Some activated producer is before the condition, and every activated threat is before or after both."""
        threats = [
            effect
            for effect in self._effects.get(condition.literal.negation, [])
            if model.may_threaten(effect, condition) and not model.contradicts(condition.guard, effect.guard)
        ]
        supports = (
            self._support(producer, threats, condition)
            for producer in self._effects.get(condition.literal, [])
            if not model.contradicts(condition.guard, producer.guard)
        )
        return self.unless(condition.guard, self.terms.disjunction(supports))

    def _support(self, producer: model.Effect, threats: list[model.Effect], condition: model.Condition) -> Formula:
        first, last = producer.event, condition.last
        in_time = self.terms.true if model.starts_with(producer, condition) else self._before(first, condition.first)
        away = (
            self.unless(
                threat.guard,
                self.terms.disjunction((self._before(threat.event, first), self._before(last, threat.event))),
            )
            for threat in threats
            if not model.contradicts(producer.guard, threat.guard)
        )
        return self.terms.conjunction((self.guard(producer.guard), in_time, *away))

    def _before(self, earlier: str, later: str) -> Formula:
        """The formula that an event is at least ε before another; if ε is 0, that it is strictly before."""
        order = (earlier, later)
        if order not in self._orders:
            difference = self.difference(earlier, later)
            apart = self.terms.at_least(difference - self._epsilon) if self._epsilon else self.terms.greater(difference)
            self._orders[order] = apart
        return self._orders[order]


NO_TIMES: Mapping[str, Fraction] = MappingProxyType({})


class ExecutionExistence(VerdictEnum):
    """Whether a correct execution exists; UNKNOWN if the time was not enough."""

    EXISTS = "exists"
    NONE = "none"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class OracleAnswer(NoTruthValue, ask="verdict"):
    """A verdict; if it is EXISTS, with a correct execution as witness."""

    verdict: ExecutionExistence
    witness: Execution | None = None


class Oracle:
    """One incremental solver session for questions about the correct executions of a plan.

    Raises:
        SolverError: if the solver is unknown or not installed.
        InputError: if a guard, a constraint, a condition or an effect mentions an unknown choice, value or event.
    """

    def __init__(self, plan: model.TeamPlan, *, solver: str = "z3") -> None:
        self.plan = plan
        self._solver = solver
        self._semantics = Semantics(plan)
        self._session = self._start()

    def decide(
        self,
        assume: model.Guard = model.ALWAYS,
        schedule: Mapping[str, Fraction] = NO_TIMES,
        *,
        now: Fraction | None = None,
        deadline: Deadline = NEVER,
    ) -> OracleAnswer:
        """Whether the partial execution is correct [PIKE, Definition 2.8]: whether a correct execution extends it.

        The events of `schedule` are executed at their times, in the plan's unit, and therefore activated. Any other
        activated event may have any time or, with `now`, any time from then on.

        Raises:
            InputError: if an assumption or the schedule mentions an unknown choice, value or event.
            SolverError: if the solver fails, or the witness is not correct.
        """
        with self._session.frame(self._semantics.guard(assume), *self._executed(schedule, now)):
            try:
                if not satisfiable(self._session, "correct execution", deadline):
                    return OracleAnswer(ExecutionExistence.NONE)
            except OutOfTimeError:
                return OracleAnswer(ExecutionExistence.UNKNOWN)
            return OracleAnswer(
                ExecutionExistence.EXISTS, self._witness(self._session, movable=not schedule and now is None)
            )

    def scenarios(self, assume: model.Guard = model.ALWAYS, *, deadline: Deadline = NEVER) -> Iterator[Execution]:
        """Each team scenario that admits a correct execution, once, with such an execution, as they are found.

        Choices that a scenario never comes to have a value in it, too [PIKE, Definition 2.2].

        Raises:
            OutOfTimeError: if the deadline passes before all are found.
            InputError: as :meth:`decide`.
            SolverError: as :meth:`decide`.
        """
        session = self._start()
        session.add(self._semantics.guard(assume))
        mentioned = mentions(self.plan, assume)
        seen: list[model.Guard] = []
        while satisfiable(session, "another scenario", deadline):
            witness = self._witness(session, movable=True)
            alike = environment_alike(witness.scenario, mentioned)
            for scenario in team_scenarios(self.plan.network, alike):
                if not any(holds(earlier, scenario) for earlier in seen):
                    deadline.enforce()
                    yield confirmed(self.plan, Execution(scenario, witness.schedule), self._solver)
            seen.append(alike)
            session.add(self._semantics.excluded(alike))

    def _start(self) -> Session:
        session = Session(self._semantics.terms, solver=self._solver)
        session.add(*self._semantics.formulas)
        return session

    def _executed(self, schedule: Mapping[str, Fraction], now: Fraction | None) -> Iterable[Formula]:
        guards = self.plan.network.guards
        for name in schedule:
            if name not in guards:
                raise InputError(f"the schedule gives a time to {name}; expected an event of the plan")
        for name, time in schedule.items():
            yield self._semantics.guard(guards[name])
            yield self._semantics.at(name, time)
        if now is not None:
            yield from (self._semantics.not_earlier(name, now) for name in guards if name not in schedule)

    def _witness(self, session: Session, *, movable: bool) -> Execution:
        """The execution of the last model, confirmed; if nothing fixes its times, it starts at zero."""
        scenario = self._semantics.chosen(session.values(self._semantics.choices))
        activated = [event.name for event in self.plan.network.events if holds(event.guard, scenario)]
        values = session.values(self._semantics.times(activated))
        times = {name: self._semantics.time(name, values) for name in activated}
        start = min(times.values(), default=Fraction(0)) if movable else Fraction(0)
        schedule = {name: time - start for name, time in times.items()}
        return confirmed(self.plan, Execution(scenario, schedule), self._solver)


def mentions(plan: model.TeamPlan, assume: model.Guard = model.ALWAYS) -> dict[str, set[model.Guard]]:
    """By choice, the guards that mention it: every guard that makes a difference to what a scenario activates."""
    guarded: Iterable[model.Event | model.Constraint | model.Condition | model.Effect] = chain(
        plan.network.events, plan.network.temporal_constraints, plan.conditions, plan.effects
    )
    labels: dict[str, set[model.Guard]] = {}
    for label in {*(each.guard for each in guarded), assume}:
        for variable, _ in label:
            labels.setdefault(variable, set()).add(label)
    return labels


def environment_alike(scenario: Mapping[str, str], mentioned: Mapping[str, set[model.Guard]]) -> model.Guard:
    """An environment of the scenario throughout which every guard in question has the same truth.

    Left out are choices that only such guards mention as are false for another reason.
    """
    kept = dict(scenario)
    for name in scenario:
        others = ([each for each in label if each.variable != name] for label in mentioned.get(name, ()))
        if all(any(kept.get(variable, value) != value for variable, value in rest) for rest in others):
            del kept[name]
    return model.guard(kept)


@dataclass(frozen=True, slots=True)
class Execution:
    """Choices for a whole plan, and times for the events that they activate, in its unit [PIKE, Definition 2.6]."""

    scenario: Mapping[str, str]
    schedule: Mapping[str, Fraction]


@dataclass(frozen=True, slots=True)
class BrokenConstraint:
    """A temporal constraint that the schedule violates."""

    constraint: model.Constraint
    difference: Fraction
    """How much later the target is than the source."""

    def __str__(self) -> str:
        lower = "-∞" if self.constraint.lower is None else self.constraint.lower
        upper = "∞" if self.constraint.upper is None else self.constraint.upper
        distance = f"{self.constraint.target} is {self.difference} after {self.constraint.source}"
        return f"{distance}; expected between {lower} and {upper}"


@dataclass(frozen=True, slots=True)
class UnmetCondition:
    """A condition that does not hold when it must."""

    condition: model.Condition
    action: str
    """Whose condition it is; `the goal` for the goal's."""
    time: Fraction
    """When that shows first."""
    culprit: model.Effect | None
    """The effect that contradicts the condition; None if nothing ever established it."""

    def __str__(self) -> str:
        reason = "nothing has established it"
        if self.culprit is not None:
            reason = f"{self.culprit.event} makes {self.culprit.literal} true"
        return f"{self.action} needs {self.condition.literal} at {self.time}, but {reason}"


Fault: TypeAlias = BrokenConstraint | UnmetCondition


def faults(plan: model.TeamPlan, execution: Execution, *, reported: Collection[str] = ()) -> tuple[Fault, ...]:
    """All that is wrong with an execution; it is correct if and only if there is nothing.

    Each constraint and each condition appears at most once. Events that were reported come after whatever has an
    earlier time, even by less than ε.

    Raises:
        InputError: if the scenario does not give each choice a value of its domain, or the schedule does not give a
            time to exactly the activated events.
    """
    _validate(plan.network, execution)
    simulation = _Simulation(plan, execution, frozenset(reported))
    activated = (condition for condition in plan.conditions if holds(condition.guard, execution.scenario))
    unmet = [fault for condition in activated if (fault := simulation.fault(condition)) is not None]
    return (*_broken(plan.network, execution), *sorted(unmet, key=lambda each: each.time))


def confirmed(plan: model.TeamPlan, execution: Execution, source: str) -> Execution:
    """The execution, if it is correct.

    Raises:
        SolverError: if it is not, so that its source is wrong.
    """
    wrong = faults(plan, execution)
    if wrong:
        raise SolverError(f"{source} gave an execution that is not correct: {wrong[0]}; please report this")
    return execution


def holds(guard: model.Guard, scenario: Mapping[str, str]) -> bool:
    """Whether an assignment entails a guard; choices that are missing from it are open."""
    return all(scenario.get(variable) == value for variable, value in guard)


def _validate(network: model.Tpnu, execution: Execution) -> None:
    for choice in network.choices:
        value = execution.scenario.get(choice.name)
        if value not in choice.domain:
            raise InputError(f"choice {choice.name} has value {value}; expected one of {', '.join(choice.domain)}")
    activated = {event.name for event in network.events if holds(event.guard, execution.scenario)}
    for name in sorted(activated - execution.schedule.keys()):
        raise InputError(f"activated event {name} has no time; expected a time for each activated event")
    for name in sorted(execution.schedule.keys() - activated):
        raise InputError(f"event {name} has a time, but is not activated; expected times for activated events only")


def _broken(network: model.Tpnu, execution: Execution) -> Iterator[BrokenConstraint]:
    for constraint in network.temporal_constraints:
        if holds(constraint.guard, execution.scenario):
            difference = execution.schedule[constraint.target] - execution.schedule[constraint.source]
            too_early = constraint.lower is not None and difference < constraint.lower
            too_late = constraint.upper is not None and difference > constraint.upper
            if too_early or too_late:
                yield BrokenConstraint(constraint, difference)


class _Simulation:
    """The effects of an execution, and the order of its events."""

    def __init__(self, plan: model.TeamPlan, execution: Execution, reported: frozenset[str]) -> None:
        self._plan = plan
        self._time = execution.schedule
        self._reported = reported
        self._effects: dict[Atom, list[model.Effect]] = {}
        """By atom, in the order of time."""
        for effect in sorted(plan.effects, key=lambda effect: self._time.get(effect.event, Fraction(0))):
            if holds(effect.guard, execution.scenario):
                self._effects.setdefault(effect.literal.atom, []).append(effect)

    def fault(self, condition: model.Condition) -> UnmetCondition | None:
        """The latest producer that is early enough decides: what would threaten it would threaten all before it."""
        first = condition.first
        producer: model.Effect | None = None
        undone: model.Effect | None = None
        for effect in self._effects.get(condition.literal.atom, ()):
            if effect.literal == condition.literal:
                if model.starts_with(effect, condition) or (
                    model.may_produce(effect, condition) and self._before(effect.event, first)
                ):
                    producer = effect
            elif self._time[effect.event] < self._time[first]:
                undone = effect
        if producer is None:
            return self._unmet(condition, self._time[first], undone)
        for threat in self._effects[condition.literal.atom]:
            away = self._before(threat.event, producer.event) or self._before(condition.last, threat.event)
            if model.may_threaten(threat, condition) and not away:
                return self._unmet(condition, max(self._time[first], self._time[threat.event]), threat)
        return None

    def _before(self, earlier: str, later: str) -> bool:
        difference = self._time[later] - self._time[earlier]
        return difference > 0 and (difference >= self._plan.epsilon or later in self._reported)

    def _unmet(self, condition: model.Condition, now: Fraction, culprit: model.Effect | None) -> UnmetCondition:
        return UnmetCondition(condition, self._plan.actor(condition.activity), now, culprit)


Owned = TypeVar("Owned", model.Condition, model.Effect)
Guarded = TypeVar("Guarded", model.Event, model.Constraint, model.Activity, model.Condition, model.Effect)


# -- team scenarios --------------------------------------------------------------------------------------------------


def team_scenarios(network: model.Tpnu, environment: model.Guard = model.ALWAYS) -> Iterator[dict[str, str]]:
    """Every full assignment that entails the environment, by the order of values [PIKE, Definition 2.4]."""
    left = [
        [value for value in domain if not model.contradicts(model.guard({name: value}), environment)]
        for name, domain in network.domains.items()
    ]
    for values in product(*left):
        yield dict(zip(network.domains, values, strict=True))


# -- restriction -----------------------------------------------------------------------------------------------------


def moved(parts: Iterable[Owned], kept: Sequence[int]) -> tuple[Owned, ...]:
    """What belongs to activities that are kept, or to none, with the places that these have then."""
    places: dict[int | None, int | None] = {None: None, **{before: after for after, before in enumerate(kept)}}
    return tuple(replace(part, activity=places[part.activity]) for part in parts if part.activity in places)


def restrict(plan: model.TeamPlan, environment: model.Guard) -> model.TeamPlan:
    """The plan in the scenarios of an environment: what contradicts it is gone, and what it decides is not asked.

    A choice whose event is gone stays only if something still depends on it.

    Raises:
        InputError: if the environment has two values of one choice.
    """
    if len(dict(environment)) < len(environment):
        raise InputError(f"found two values of one choice in {{{model.guard_text(environment)}}}, expected one")

    def left(parts: Iterable[Guarded]) -> tuple[Guarded, ...]:
        """The constraints that can still be activated, with what is left of their guards."""
        kept = (part for part in parts if not model.contradicts(environment, part.guard))
        return tuple(replace(part, guard=part.guard - environment) for part in kept)

    network = plan.network
    kept = [at for at, activity in enumerate(network.activities) if not model.contradicts(environment, activity.guard)]
    events, constraints, activities = left(network.events), left(network.constraints), left(network.activities)
    conditions, effects = moved(left(plan.conditions), kept), moved(left(plan.effects), kept)
    guarded: Iterable[model.Event | model.Constraint | model.Activity | model.Condition | model.Effect] = chain(
        events, constraints, activities, conditions, effects
    )
    used, decided = {variable for one in guarded for variable, _ in one.guard}, {name for name, _ in environment}
    happening = {None, *(event.name for event in events)}
    choices = tuple(
        choice if choice.event in happening else replace(choice, event=None)
        for choice in network.choices
        if choice.name not in decided and (choice.event in happening or choice.name in used)
    )
    whole = replace(network, choices=choices, events=events, constraints=constraints, activities=activities)
    return replace(plan, network=whole, conditions=conditions, effects=effects)
