"""Execution monitoring by causal links: what is seen against what is needed later [PIKE §3, CheckActivatedCausalLinks].

A link from an effect to a condition is active from when the effect happens until the condition has been met for
good. It is violated if the state is seen to be otherwise, while the latest effect on the atom says that it should be
so. Then all effects so far that had made it so have lost their worth. What planned effects
bring about is no violation.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from robust.pike_bridge.model import Condition, Effect, Literal, may_produce
from robust.pike_bridge.online.messages import Estimate, Violated
from robust.pike_bridge.online.progress import Progress
from robust.plan.model import Atom


@dataclass(frozen=True, slots=True)
class Violation:
    """What is announced, and the links that it breaks."""

    decision: Violated
    broken: tuple[tuple[Effect, Condition], ...]


class Monitor:
    """Knows the latest planned effect on each atom, and who relies on it."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._effects: dict[str, list[Effect]] = {}
        for effect in progress.plan.effects:
            self._effects.setdefault(effect.event, []).append(effect)
        self._conditions: dict[Literal, list[Condition]] = {}
        for condition in progress.plan.conditions:
            self._conditions.setdefault(condition.literal, []).append(condition)
        self._latest: dict[Atom, Effect] = {}
        self._producers: dict[Literal, list[Effect]] = {}
        self._broken: set[Effect] = set()

    def executed(self, event: str) -> None:
        """Its effects are what is expected of their atoms from now on."""
        happening = [each for each in self._effects.get(event, ()) if self._progress.certain(each.guard)]
        # Deletions first, as PDDL has it where one activity does both.
        for effect in sorted(happening, key=lambda each: each.literal.positive):
            self._latest[effect.literal.atom] = effect
            self._producers.setdefault(effect.literal, []).append(effect)

    def compare(self, estimate: Estimate) -> Iterator[Violation]:
        """Each expectation that is contradicted and that a later condition may rely on."""
        for atom, effect in list(self._latest.items()):
            if effect not in self._broken and self._contradicts(estimate, atom, effect.literal.positive):
                links = tuple(
                    (producer, condition)
                    for producer in self._producers[effect.literal]
                    for condition in self._relying(producer)
                )
                if links:
                    self._broken.add(effect)
                    yield Violation(self._announcement(effect, [condition for _, condition in links]), links)

    def _contradicts(self, estimate: Estimate, atom: Atom, expected: bool) -> bool:
        if expected:
            return atom in estimate.false or (estimate.complete and atom not in estimate.true)
        return atom in estimate.true

    def _relying(self, effect: Effect) -> Iterator[Condition]:
        for condition in self._conditions.get(effect.literal, ()):
            open_still = condition.last in self._progress.pending and self._progress.compatible(condition.guard)
            if open_still and may_produce(effect, condition):
                yield condition

    def _announcement(self, effect: Effect, conditions: Iterable[Condition]) -> Violated:
        activities = self._progress.plan.network.activities
        consumers = (
            "the goal" if condition.activity is None else activities[condition.activity].action
            for condition in conditions
        )
        return Violated(
            effect.literal.atom,
            effect.literal.positive,
            effect.event,
            tuple(dict.fromkeys(consumers)),
            self._progress.now,
        )
