"""The referee of executions: whether one is correct, found by carrying it out in thought, moment by moment.

Source: [PIKE, Definitions 2.5 and 2.6]. Nothing here reasons about choices, links or formulas.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from robust.errors import InputError
from robust.pike_bridge.model import Condition, Constraint, Effect, Guard, Literal, TeamPlan, Tpnu
from robust.plan.model import Atom


@dataclass(frozen=True, slots=True)
class Execution:
    """Choices for a whole plan, and times for the events that they activate [PIKE, Definition 2.6]."""

    scenario: Mapping[str, str]
    schedule: Mapping[str, Fraction]


@dataclass(frozen=True, slots=True)
class BrokenConstraint:
    """A temporal constraint that the schedule violates."""

    constraint: Constraint
    difference: Fraction
    """How much later the target is than the source."""

    def __str__(self) -> str:
        lower = "-∞" if self.constraint.lower is None else self.constraint.lower
        upper = "∞" if self.constraint.upper is None else self.constraint.upper
        return (
            f"{self.constraint.target} is {self.difference} after {self.constraint.source}; "
            f"expected between {lower} and {upper}"
        )


@dataclass(frozen=True, slots=True)
class UnmetCondition:
    """A condition that does not hold when it must."""

    condition: Condition
    action: str
    """Whose condition it is; `the goal` for the goal's."""
    time: Fraction
    """When that shows first."""
    culprit: Effect | None
    """The effect that contradicts the condition; None if nothing ever established it."""

    def __str__(self) -> str:
        reason = "nothing has established it"
        if self.culprit is not None:
            reason = f"{self.culprit.event} makes {self.culprit.literal} true"
        return f"{self.action} needs {self.condition.literal} at {self.time}, but {reason}"


Fault: TypeAlias = BrokenConstraint | UnmetCondition


def faults(plan: TeamPlan, execution: Execution) -> tuple[Fault, ...]:
    """All that is wrong with an execution; it is correct if and only if there is nothing.

    Each constraint and each condition appears at most once.

    Raises:
        InputError: if the scenario does not give each choice a value of its domain, or the schedule does not give a
            time to exactly the activated events.
    """
    _validate(plan.network, execution)
    return (*_broken(plan.network, execution), *_Simulation(plan, execution).run())


def holds(guard: Guard, scenario: Mapping[str, str]) -> bool:
    """Whether a full assignment entails a guard."""
    return all(scenario[variable] == value for variable, value in guard)


def _validate(network: Tpnu, execution: Execution) -> None:
    for choice in network.choices:
        value = execution.scenario.get(choice.name)
        if value not in choice.domain:
            raise InputError(f"choice {choice.name} has value {value}; expected one of {', '.join(choice.domain)}")
    activated = {event.name for event in network.events if holds(event.guard, execution.scenario)}
    for name in sorted(activated - execution.schedule.keys()):
        raise InputError(f"activated event {name} has no time; expected a time for each activated event")
    for name in sorted(execution.schedule.keys() - activated):
        raise InputError(f"event {name} has a time, but is not activated; expected times for activated events only")


def _broken(network: Tpnu, execution: Execution) -> Iterator[BrokenConstraint]:
    for constraint in network.temporal_constraints:
        if holds(constraint.guard, execution.scenario):
            difference = execution.schedule[constraint.target] - execution.schedule[constraint.source]
            too_early = constraint.lower is not None and difference < constraint.lower
            too_late = constraint.upper is not None and difference > constraint.upper
            if too_early or too_late:
                yield BrokenConstraint(constraint, difference)


class _Simulation:
    """The state of the world and the conditions that are being watched, at the current moment of an execution.

    An atom's state is the literals asserted at the latest moment at which any was. Two opposite ones leave the atom
    neither true nor false, which is what a closed interval from a producer to its consumer demands of threats at the
    very moment of the producer.
    """

    def __init__(self, plan: TeamPlan, execution: Execution) -> None:
        self._plan = plan
        self._time = execution.schedule
        self._conditions = [each for each in plan.conditions if holds(each.guard, execution.scenario)]
        self._effects: dict[Fraction, list[Effect]] = {}
        for effect in plan.effects:
            if holds(effect.guard, execution.scenario):
                self._effects.setdefault(self._time[effect.event], []).append(effect)
        self._state: dict[Atom, dict[Literal, Effect]] = {}
        self._watched: list[Condition] = []

    def run(self) -> Iterator[UnmetCondition]:
        for now in sorted(set(self._time.values())):
            happening = self._effects.get(now, [])
            yield from self._open(now, happening)
            yield from self._watch(now, happening)
            self._apply(happening)
            self._watched = [each for each in self._watched if self._time[each.last] > now]

    def _open(self, now: Fraction, happening: list[Effect]) -> Iterator[UnmetCondition]:
        """Look at the state just before now, for the conditions that begin now."""
        for condition in self._conditions:
            if self._time[condition.first] != now:
                continue
            state = self._state.get(condition.literal.atom, {})
            if set(state) == {condition.literal} or any(_establishes(effect, condition) for effect in happening):
                self._watched.append(condition)
            else:
                yield self._unmet(condition, now, state.get(condition.literal.negation))

    def _watch(self, now: Fraction, happening: list[Effect]) -> Iterator[UnmetCondition]:
        """Drop the watched conditions that an effect of this moment contradicts."""
        for condition in list(self._watched):
            culprit = next((effect for effect in happening if _contradicts(effect, condition)), None)
            if culprit is not None:
                self._watched.remove(condition)
                yield self._unmet(condition, now, culprit)

    def _apply(self, happening: list[Effect]) -> None:
        changed: dict[Atom, dict[Literal, Effect]] = {}
        for effect in happening:
            changed.setdefault(effect.literal.atom, {})[effect.literal] = effect
        self._state.update(changed)

    def _unmet(self, condition: Condition, now: Fraction, culprit: Effect | None) -> UnmetCondition:
        activities = self._plan.network.activities
        action = "the goal" if condition.activity is None else activities[condition.activity].action
        return UnmetCondition(condition, action, now, culprit)


def _establishes(effect: Effect, condition: Condition) -> bool:
    """Whether an activity's effect at its start makes its own condition over all true."""
    own = condition.activity is not None and effect.activity == condition.activity
    over_all = condition.first != condition.last
    return own and over_all and effect.event == condition.first and effect.literal == condition.literal


def _contradicts(effect: Effect, condition: Condition) -> bool:
    own = condition.activity is not None and effect.activity == condition.activity
    return effect.literal == condition.literal.negation and not (own and effect.event == condition.last)
