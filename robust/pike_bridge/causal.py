"""Who may support a condition, and who may threaten it [PIKE §4.2, Definition 4.4].

What happens at an event is told apart by the guard of the activity whose effect it is, because several activities may
start or end at one event under different guards.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple, TypeAlias

from robust.pike_bridge.model import (
    Assignment,
    Choice,
    Condition,
    Constraint,
    Effect,
    Environment,
    Guard,
    Literal,
    TeamPlan,
    Tpnu,
    guard_text,
    may_produce,
    may_threaten,
)
from robust.pike_bridge.temporal.distance_graph import Precedence
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory, conjunction, implies


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


class Resolution(Enum):
    """What keeps a threat out of the interval from a producer to its consumer."""

    NOTHING = "nothing required"
    AVOID = "conflict"
    BEFORE = "threat before producer"
    AFTER = "threat after consumer"
    EITHER = "threat before producer or after consumer"


def resolve(question: OpenCondition, producer: Happening, threat: Happening, contexts: Contexts) -> Resolution:
    """The case of Figure 12, in the context in which the producer, the threat and the consumer are all activated."""
    if threat.event in {producer.event, question.first, question.last}:
        return Resolution.AVOID

    def precedes(first: str, second: str) -> bool:
        return contexts.precedes(first, second, producer.guard, threat.guard)

    if precedes(threat.event, producer.event) or precedes(question.last, threat.event):
        return Resolution.NOTHING
    after_producer = precedes(producer.event, threat.event)
    before_consumer = precedes(threat.event, question.last)
    match after_producer, before_consumer:
        case True, True:
            return Resolution.AVOID
        case True, False:
            return Resolution.AFTER
        case False, True:
            return Resolution.BEFORE
        case _:
            return Resolution.EITHER


NO_SUPPORT = "none"
"""The value of a support variable whose consumer has no support, ⊥ in the paper."""
BEFORE = "before"
"""The value of an order variable whose threat comes before the producer, −1 in the paper."""
AFTER = "after"
"""The value of an order variable whose threat comes after the consumer, +1 in the paper."""


EventOrder: TypeAlias = tuple[str, str]
"""An event and a later one."""


class AdditionReason(Enum):
    """Why a constraint was added: the rows of [PIKE, Table 1] (temporal conflicts are found later)."""

    SUPPORT = "at least one activated producer"
    DEFINITE_THREAT = "avoid definite threat"
    PRODUCER_FIRST = "producers precede consumers"
    THREAT_AFTER = "force threat after consumer"
    THREAT_BEFORE = "force threat before producer"
    IDLE = "no support for a consumer that is not activated"
    """Not in the paper; see :class:`LinkEncoding`."""


AddedStatement: TypeAlias = Constraint | Formula | Guard
"""A temporal constraint of the network, or a propositional one: a formula, or a conflict given by its environment."""


@dataclass(frozen=True, slots=True)
class Addition:
    """A constraint that was added, and what for; rows about one link name its producer, those about a threat that."""

    statement: AddedStatement
    reason: AdditionReason
    consumer: OpenCondition
    producer: Happening | None = None
    threat: Happening | None = None


@dataclass(frozen=True, slots=True)
class LinkEncoding:
    """How to augment; the default is as in the paper. The correct executions are the same for all."""

    dominance: Dominance = Dominance.ALGORITHM_5
    sole_supports: bool = True
    """Whether a condition with a single candidate gets a support variable, too; else its support is simply required."""
    idle_supports: bool = True
    """Whether the support of a consumer that is not activated may have any value; else only `none`."""


@dataclass(frozen=True, slots=True)
class AugmentedPlan:
    """A plan, its augmented network T′, and the propositional constraints of KB without temporal conflicts."""

    plan: TeamPlan
    network: Tpnu
    theory: Theory
    links: tuple[LabeledCausalLink, ...]
    additions: tuple[Addition, ...]
    """What was added to the network and the theory, with reasons."""


def augment(plan: TeamPlan, precedence: Precedence, encoding: LinkEncoding = LinkEncoding()) -> AugmentedPlan:
    """The augmented plan and its theory [PIKE, Algorithm 5].

    `precedence` is of the plan's own network. Three things differ from the letter of the algorithm: constraints are
    added to those that join the same events already, they do not replace them; threats at one event with a producer or
    with the condition are definite threats; and a condition without candidates makes its own guard a conflict.

    Raises:
        KeyError: if a guard mentions an assignment that the precedence's vocabulary does not have.
    """
    augmentation = _Augmentation(plan.network, plan, encoding)
    for question in open_conditions(plan, precedence):
        contexts = Contexts(precedence, question.guard)
        augmentation.close(prune(question, contexts, encoding.dominance), contexts)
    return augmentation.result()


@dataclass(slots=True)
class _Augmentation:
    network: Tpnu
    plan: TeamPlan
    encoding: LinkEncoding
    choices: dict[str, Choice] = field(default_factory=dict)
    links: list[LabeledCausalLink] = field(default_factory=list)
    additions: list[Addition] = field(default_factory=list)

    def close(self, question: OpenCondition, contexts: Contexts) -> None:
        """Add what makes an open condition met wherever it is activated."""
        if not question.producers:
            self.additions.append(Addition(question.guard, AdditionReason.SUPPORT, question))
            return
        links = self._links(question)
        self.links += links
        self.additions += (Addition(formula, AdditionReason.SUPPORT, question) for formula in _support(question, links))
        if not self.encoding.idle_supports:
            self.additions += (Addition(formula, AdditionReason.IDLE, question) for formula in _idle(question, links))
        for link in links:
            self.additions += self._producer_first(link, contexts)
            for threat in question.threats:
                self.additions += (replace(each, threat=threat) for each in self._away(link, threat, contexts))

    def result(self) -> AugmentedPlan:
        choices = (*self.network.choices, *self.choices.values())
        constraints = [each.statement for each in self.additions if isinstance(each.statement, Constraint)]
        conflicts = [each.statement for each in self.additions if isinstance(each.statement, frozenset)]
        formulas = [each.statement for each in self.additions if isinstance(each.statement, Is | Not | All | Some)]
        network = replace(self.network, choices=choices, constraints=(*self.network.constraints, *constraints))
        theory = Theory(network.domains, tuple(dict.fromkeys(formulas)), tuple(dict.fromkeys(conflicts)))
        return AugmentedPlan(self.plan, network, theory, tuple(self.links), tuple(self.additions))

    def _links(self, question: OpenCondition) -> list[LabeledCausalLink]:
        if len(question.producers) == 1 and not self.encoding.sole_supports:
            return [LabeledCausalLink(question, question.producers[0], frozenset())]
        values = _names(question.producers)
        variable = self._variable(f"s[{question}]", question.guard, (*values, NO_SUPPORT))
        return [
            LabeledCausalLink(question, producer, frozenset({Assignment(variable, value)}))
            for producer, value in zip(question.producers, values, strict=True)
        ]

    def _producer_first(self, link: LabeledCausalLink, contexts: Contexts) -> Iterator[Addition]:
        producer, first = link.producer.event, link.consumer.first
        if producer != first and not contexts.precedes(producer, first, link.label):
            yield self._ordering(link, (producer, first), _context(link), AdditionReason.PRODUCER_FIRST)

    def _away(self, link: LabeledCausalLink, threat: Happening, contexts: Contexts) -> Iterator[Addition]:
        """What keeps a threat out of the interval of a link; nothing if the three cannot be activated together."""
        if not contexts.possible(link.label, threat.guard):
            return
        context = _context(link) | threat.guard
        before: EventOrder = (threat.event, link.producer.event)
        after: EventOrder = (link.consumer.last, threat.event)
        match resolve(link.consumer, link.producer, threat, contexts):
            case Resolution.AVOID:
                yield Addition(context, AdditionReason.DEFINITE_THREAT, link.consumer, link.producer)
            case Resolution.BEFORE:
                yield self._ordering(link, before, context, AdditionReason.THREAT_BEFORE)
            case Resolution.AFTER:
                yield self._ordering(link, after, context, AdditionReason.THREAT_AFTER)
            case Resolution.EITHER:
                name = f"o[{link.consumer}, {link.producer.event}, {threat.event}]"
                variable = self._variable(name, context, (BEFORE, AFTER))
                first, last = ({Assignment(variable, value)} for value in (BEFORE, AFTER))
                yield self._ordering(link, before, context | first, AdditionReason.THREAT_BEFORE)
                yield self._ordering(link, after, context | last, AdditionReason.THREAT_AFTER)
            case Resolution.NOTHING:
                pass

    def _ordering(self, link: LabeledCausalLink, order: EventOrder, context: Guard, reason: AdditionReason) -> Addition:
        earlier, later = order
        constraint = Constraint(earlier, later, self.plan.epsilon, None, context)
        return Addition(constraint, reason, link.consumer, link.producer)

    def _variable(self, name: str, context: Guard, domain: tuple[str, ...]) -> str:
        """A new controllable choice variable, named apart from all others by its guard if need be."""
        taken = self.choices.keys() | self.network.domains.keys()
        unique = _unused(name, f"{name}[{guard_text(context)}]", taken)
        self.choices[unique] = Choice(unique, domain, True, None)
        return unique


def _context(link: LabeledCausalLink) -> Guard:
    """When the link is selected, and its producer and its consumer are activated."""
    return link.selection | link.label | link.consumer.guard


def _support(question: OpenCondition, links: list[LabeledCausalLink]) -> Iterator[Formula]:
    """φ_c ⇒ ⋁ (s = e_P ∧ φ_P), without what φ_c says already and without what is true anyway."""
    selections = [conjunction(link.selection | (link.label - question.guard)) for link in links]
    if all(selection.operands for selection in selections):
        consequence = selections[0] if len(selections) == 1 else Some(tuple(selections))
        yield implies(conjunction(question.guard), consequence) if question.guard else consequence


def _idle(question: OpenCondition, links: list[LabeledCausalLink]) -> Iterator[Formula]:
    for variable, _ in links[0].selection:
        if question.guard:
            yield Some((conjunction(question.guard), Is(Assignment(variable, NO_SUPPORT))))


def _names(producers: tuple[Happening, ...]) -> tuple[str, ...]:
    """The producers' events, told apart by their guards where several are at one event."""
    names: list[str] = []
    for producer in producers:
        detailed = f"{producer.event}[{guard_text(producer.guard)}]"
        names.append(_unused(producer.event, detailed, {NO_SUPPORT, *names}))
    return tuple(names)


def _unused(name: str, detailed: str, taken: set[str]) -> str:
    """The short name, or the detailed one, or that with a number: the first that is not taken."""
    if name not in taken:
        return name
    candidate, number = detailed, 1
    while candidate in taken:
        number += 1
        candidate = f"{detailed}#{number}"
    return candidate
