"""Which candidates of a condition need not be looked at, because later ones decide [PIKE §4.2, Definition 4.5].

Relative to one condition, a later happening *dominates* an earlier one if it is activated whenever the earlier one and
the condition are, certainly comes after it, and certainly comes in time to matter: a producer before the condition
begins, a threat before it ends. (Definition 4.5 asks that the earlier guard alone entail the later one; with the
condition's guard is enough, since links matter in no other scenarios.) Two happenings at one event differ by their
guards only; there the more general one dominates, and a threat dominates a producer.

What may be dropped, and why:

- *A producer dominated by a producer*: whenever it supports, the later one does too, whose interval is shorter
  [PIKE, Theorem 4.2].
- *A producer dominated by a threat*: it is certainly threatened, so it never supports.
- *A threat dominated by a threat*: a support that the later threat spares comes after that one, which cannot come after
  the condition; so it comes after the earlier threat, too.
- *A threat dominated by a producer*: if the threat lies between the selected support and the condition, then so does
  the dominating producer, later, which nothing threatens that spares the selected support. So the condition is met,
  and Theorems 4.3 to 4.7 hold. But the selected link is then not the one that supports the condition: the world
  contradicts it for a while, as planned. [PIKE, Algorithm 5, line 7] drops such threats, since its labeled value set ξ
  holds producers and threats together; for them the step "any threat e_T cannot occur between e_P and e_c" in the
  proof of Theorem 4.5 is wrong, although the theorem is right.

A dominated happening may be what dominates others: each domination leads to a later moment (or a more general guard),
so that some happening at the end of the chain is kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import Enum

from robust.pike_bridge.causal.links import Contexts, Happening, OpenCondition


class Dominance(Enum):
    """How much to drop."""

    NOTHING = "nothing"
    EXACT = "exact"
    """What leaves every selected link unthreatened in every temporally consistent execution."""
    ALGORITHM_5 = "algorithm 5"
    """Threats that a producer dominates, too: fewer variables and constraints for the same correct executions."""


def prune(question: OpenCondition, contexts: Contexts, dominance: Dominance) -> OpenCondition:
    """The open condition without the candidates that are dominated."""
    if dominance is Dominance.NOTHING:
        return question
    order = _Order(question, contexts)
    return replace(
        question,
        producers=tuple(each for each in question.producers if not any(order.producer_dominators(each))),
        threats=tuple(
            each
            for each in question.threats
            if not any(order.threat_dominators(each, by_producers=dominance is Dominance.ALGORITHM_5))
        ),
    )


class _Order:
    """The relation of dominance among the candidates of one condition; dominators are found one by one."""

    def __init__(self, question: OpenCondition, contexts: Contexts) -> None:
        self._question = question
        self._contexts = contexts

    def producer_dominators(self, producer: Happening) -> Iterator[Happening]:
        for other in self._activated_with(producer, self._question.producers):
            if other.event == producer.event:
                if self._more_general(other, producer, self._question.producers):
                    yield other
            # What the consumer does at its own start comes after every other support.
            elif other.event == self._question.first or (
                self._precedes(producer, other) and self._precedes_event(other, self._question.first, producer)
            ):
                yield other
        for threat in self._activated_with(producer, self._question.threats):
            inside = {producer.event, self._question.first, self._question.last}
            if threat.event in inside or (
                self._precedes(producer, threat) and self._precedes_event(threat, self._question.last, producer)
            ):
                yield threat

    def threat_dominators(self, threat: Happening, *, by_producers: bool) -> Iterator[Happening]:
        for other in self._activated_with(threat, self._question.threats):
            if other.event == threat.event:
                if self._more_general(other, threat, self._question.threats):
                    yield other
            elif self._precedes(threat, other) and self._in_time(other, self._question.last, threat):
                yield other
        if by_producers:
            for producer in self._activated_with(threat, self._question.producers):
                if self._precedes(threat, producer) and self._in_time(producer, self._question.first, threat):
                    yield producer

    def _activated_with(self, happening: Happening, others: tuple[Happening, ...]) -> Iterator[Happening]:
        for other in others:
            if other != happening and self._contexts.entails(happening.guard, other.guard):
                yield other

    def _more_general(self, other: Happening, happening: Happening, among: tuple[Happening, ...]) -> bool:
        """Given that `other` is activated with `happening`: it is so more often, or else comes first in the list."""
        if self._contexts.entails(other.guard, happening.guard):
            return among.index(other) < among.index(happening)
        return True

    def _in_time(self, later: Happening, event: str, earlier: Happening) -> bool:
        return later.event == event or self._precedes_event(later, event, earlier)

    def _precedes(self, earlier: Happening, later: Happening) -> bool:
        return self._contexts.precedes(earlier.event, later.event, earlier.guard, later.guard)

    def _precedes_event(self, later: Happening, event: str, earlier: Happening) -> bool:
        return self._contexts.precedes(later.event, event, earlier.guard, later.guard)
