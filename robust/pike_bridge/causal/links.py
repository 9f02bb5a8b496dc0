"""Who may support a condition, and who may threaten it [PIKE §4.2, Definition 4.4].

What happens at an event is told apart by the guard of the activity whose effect it is, because several activities may
start or end at one event under different guards.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

from robust.pike_bridge.environment import Environment
from robust.pike_bridge.model import Condition, Effect, Guard, Literal, TeamPlan, may_produce, may_threaten
from robust.pike_bridge.temporal.interface import Precedence


class Happening(NamedTuple):
    """An effect on the literal in question: at an event, if the guard holds."""

    event: str
    guard: Guard


@dataclass(frozen=True, slots=True)
class OpenCondition:
    """A literal that must be supported from before `first` to `last` if the guard holds: a consumer, and its rivals.

    A producer at the event `first` itself is the consumer's own effect there, which supports it over all of its
    duration; every other producer must be before `first`.
    """

    literal: Literal
    first: str
    last: str
    guard: Guard
    producers: tuple[Happening, ...]
    threats: tuple[Happening, ...]
    conditions: tuple[Condition, ...]
    """The conditions that are met when this one is; all ask the same."""

    def __str__(self) -> str:
        place = self.first if self.first == self.last else f"{self.first}–{self.last}"
        return f"{self.literal} @ {place}"


@dataclass(frozen=True, slots=True)
class LabeledCausalLink:
    """A producer that may be the support of a consumer [PIKE, Definition 4.4]; its label is the producer's guard."""

    consumer: OpenCondition
    producer: Happening
    selection: Guard
    """What holds if the link is the supporting one: the assignment to the support variable, or nothing if there is no
    such variable because there is no other link."""

    @property
    def label(self) -> Guard:
        return self.producer.guard


class Contexts:
    """Precedence among the happenings of one condition, in the context in which all of them and the condition hold."""

    def __init__(self, precedence: Precedence, condition: Guard) -> None:
        self._precedence = precedence
        self._condition = condition

    def possible(self, *guards: Guard) -> bool:
        """Whether the condition and the guards are not known to exclude each other."""
        environment = self._environment(guards)
        return self._precedence.vocabulary.consistent(environment) and not self._precedence.conflicting(environment)

    def precedes(self, first: str, second: str, *guards: Guard) -> bool:
        """first ≺ second, given the condition and the guards; an event does not precede itself."""
        return first != second and self._precedence.precedes(first, second, self._environment(guards))

    def entails(self, specific: Guard, general: Guard) -> bool:
        """Whether the second guard holds whenever the first and the condition do."""
        return general <= specific | self._condition

    def _environment(self, guards: Iterable[Guard]) -> Environment:
        return self._precedence.vocabulary.encode(self._condition.union(*guards))


def open_conditions(plan: TeamPlan, precedence: Precedence) -> tuple[OpenCondition, ...]:
    """Every condition with its candidates: the effects that the network allows to matter [PIKE, Algorithm 5, line 7].

    Conditions that ask the same of the same candidates are one.
    """
    by_literal: dict[Literal, list[Effect]] = {}
    for effect in plan.effects:
        by_literal.setdefault(effect.literal, []).append(effect)
    merged: dict[OpenCondition, list[Condition]] = {}
    for condition in plan.conditions:
        contexts = Contexts(precedence, condition.guard)
        if not contexts.possible():
            continue
        producers = [e for e in by_literal.get(condition.literal, ()) if may_produce(e, condition)]
        threats = [e for e in by_literal.get(condition.literal.negation, ()) if may_threaten(e, condition)]
        question = OpenCondition(
            condition.literal,
            condition.first,
            condition.last,
            condition.guard,
            _not_after(condition.first, producers, contexts),
            _not_after(condition.last, threats, contexts),
            (),
        )
        merged.setdefault(question, []).append(condition)
    return tuple(replace(question, conditions=tuple(conditions)) for question, conditions in merged.items())


def _not_after(event: str, effects: Iterable[Effect], contexts: Contexts) -> tuple[Happening, ...]:
    """The happenings that can hold together with the condition and are not known to come after an event of it."""
    found = dict.fromkeys(Happening(effect.event, effect.guard) for effect in effects)
    return tuple(
        happening
        for happening in found
        if contexts.possible(happening.guard) and not contexts.precedes(event, happening.event, happening.guard)
    )
