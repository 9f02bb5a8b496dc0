"""Producers that may support a condition, and effects that may threaten it [PIKE §4.2, Definition 4.4].

Effects at one event are distinguished by the guards of their activities, because several activities may start or end at
one event under different guards.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, count
from typing import NamedTuple

from robust.pike_bridge import distance_graph, model
from robust.pike_bridge.theory import Formula, Not, Some, Theory, conjunction


class LabeledHappening(NamedTuple):
    """An effect on the literal in question: at an event, if the guard holds."""

    event: str
    guard: model.Guard


@dataclass(frozen=True, slots=True)
class OpenCondition:
    """A literal that must be supported from before `first` to `last` if the guard holds: a consumer, and its rivals.

    A producer at the event `first` itself is the consumer's own effect there, which supports it over all of its
    duration; every other producer must be before `first`.
    """

    literal: model.Literal
    first: str
    last: str
    guard: model.Guard
    producers: tuple[LabeledHappening, ...]
    threats: tuple[LabeledHappening, ...]
    conditions: tuple[model.Condition, ...]
    """The conditions that are met when this one is; all ask the same."""

    def __str__(self) -> str:
        place = self.first if self.first == self.last else f"{self.first}–{self.last}"
        return f"{self.literal} @ {place}"


@dataclass(frozen=True, slots=True)
class LabeledCausalLink:
    """A producer that may be the support of a consumer [PIKE, Definition 4.4]; its label is the producer's guard."""

    consumer: OpenCondition
    producer: LabeledHappening
    selection: model.Guard
    """What holds if the link is the supporting one: the assignment to the support variable."""

    @property
    def label(self) -> model.Guard:
        return self.producer.guard

    @property
    def text(self) -> str:
        """For drawings: the literal, and the label, unless it is always so [PIKE, Figure 2]."""
        return f"{self.consumer.literal}{f' if {model.guard_text(self.label)}' if self.label else ''}"


class Contexts:
    """Precedence among the happenings of one condition, in the context in which all of them and the condition hold."""

    def __init__(self, precedence: distance_graph.Precedence, condition: model.Guard) -> None:
        self._precedence = precedence
        self._condition = condition

    def possible(self, *guards: model.Guard) -> bool:
        """Whether the condition and the guards are not known to exclude each other."""
        environment = self._environment(guards)
        return self._precedence.vocabulary.consistent(environment) and not self._precedence.conflicting(environment)

    def precedes(self, first: str, second: str, *guards: model.Guard) -> bool:
        """first ≺ second, given the condition and the guards; an event does not precede itself."""
        return first != second and self._precedence.precedes(first, second, self._environment(guards))

    def entails(self, specific: model.Guard, general: model.Guard) -> bool:
        """Whether the second guard holds whenever the first and the condition do."""
        return general <= specific | self._condition

    def _environment(self, guards: Iterable[model.Guard]) -> model.Environment:
        return self._precedence.vocabulary.encode(self._condition.union(*guards))


def open_conditions(plan: model.TeamPlan, precedence: distance_graph.Precedence) -> tuple[OpenCondition, ...]:
    """Every condition with its candidates: the effects that the network allows to matter [PIKE, Algorithm 5, line 7].

    Conditions that ask the same of the same candidates are one.
    """
    by_literal: dict[model.Literal, list[model.Effect]] = {}
    for effect in plan.effects:
        by_literal.setdefault(effect.literal, []).append(effect)
    merged: dict[OpenCondition, list[model.Condition]] = {}
    for condition in plan.conditions:
        contexts = Contexts(precedence, condition.guard)
        if not contexts.possible():
            continue
        producers = [e for e in by_literal.get(condition.literal, ()) if model.may_produce(e, condition)]
        threats = [e for e in by_literal.get(condition.literal.negation, ()) if model.may_threaten(e, condition)]
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


def _not_after(event: str, effects: Iterable[model.Effect], contexts: Contexts) -> tuple[LabeledHappening, ...]:
    """The happenings that can hold together with the condition and are not known to come after an event of it."""
    happenings = dict.fromkeys(LabeledHappening(effect.event, effect.guard) for effect in effects)
    return tuple(
        happening
        for happening in happenings
        if contexts.possible(happening.guard) and not contexts.precedes(event, happening.event, happening.guard)
    )


def prune(question: OpenCondition, contexts: Contexts) -> OpenCondition:
    """The open condition without the candidates that are dominated."""
    producers, threats, first, last = question.producers, question.threats, question.first, question.last

    def activated_with(one: LabeledHappening, others: tuple[LabeledHappening, ...]) -> Iterator[LabeledHappening]:
        return (other for other in others if other != one and contexts.entails(one.guard, other.guard))

    def between(one: LabeledHappening, other: LabeledHappening, event: str) -> bool:
        """Whether the other, activated with the one, comes after it, and at the event or before."""
        guards = one.guard, other.guard
        in_time = other.event == event or contexts.precedes(other.event, event, *guards)
        return in_time and contexts.precedes(one.event, other.event, *guards)

    def replaces(other: LabeledHappening, one: LabeledHappening, among: tuple[LabeledHappening, ...]) -> bool:
        """Whether the other of two at one event is activated more often, or else comes first in the list."""
        return not contexts.entails(other.guard, one.guard) or among.index(other) < among.index(one)

    def dominated_producer(one: LabeledHappening) -> bool:
        # What the consumer does at its own start comes after every other support.
        return any(
            replaces(other, one, producers)
            if other.event == one.event
            else other.event == first or between(one, other, first)
            for other in activated_with(one, producers)
        ) or any(
            threat.event in {one.event, first, last} or between(one, threat, last)
            for threat in activated_with(one, threats)
        )

    def dominated_threat(one: LabeledHappening) -> bool:
        return any(
            replaces(other, one, threats) if other.event == one.event else between(one, other, last)
            for other in activated_with(one, threats)
        ) or any(between(one, producer, first) for producer in activated_with(one, producers))

    return replace(
        question,
        producers=tuple(producer for producer in producers if not dominated_producer(producer)),
        threats=tuple(threat for threat in threats if not dominated_threat(threat)),
    )


NO_SUPPORT = "none"
"""The value of a support variable whose consumer has no support, ⊥ in the paper."""
BEFORE = "before"
"""The value of an order variable whose threat comes before the producer, −1 in the paper."""
AFTER = "after"
"""The value of an order variable whose threat comes after the consumer, +1 in the paper."""


EITHER = "either"
"""How a threat is kept away that may come before the producer or after the consumer, as an order variable says."""
NEVER_TOGETHER = "never"
"""How a definite threat is kept away: the link is not used where it is activated."""


class KeptAway(NamedTuple):
    """How a threat is kept out of the interval of a link [PIKE, Figure 12]; the cases C1 and C9 need nothing."""

    link: LabeledCausalLink
    threat: LabeledHappening
    resolution: str
    """BEFORE, AFTER, EITHER or NEVER_TOGETHER."""
    variable: str | None = None
    """The order variable, of EITHER."""


@dataclass(frozen=True, slots=True)
class AugmentedPlan:
    """A plan, its augmented network T′, and the propositional constraints of KB without temporal conflicts."""

    plan: model.TeamPlan
    network: model.Tpnu
    theory: Theory
    links: tuple[LabeledCausalLink, ...]
    conditions: tuple[OpenCondition, ...]
    """All of them, with the candidates that are not dominated."""
    threats: tuple[KeptAway, ...]

    @property
    def added(self) -> tuple[model.Constraint, ...]:
        """The orderings that the plan did not have."""
        return self.network.constraints[len(self.plan.network.constraints) :]


def augment(plan: model.TeamPlan, precedence: distance_graph.Precedence) -> AugmentedPlan:
    """The augmented plan and its theory [PIKE, Algorithm 5, Table 1].

    `precedence` is of the plan's own network. Three things differ from the letter of the algorithm: constraints are
    added to those that join the same events already, they do not replace them; threats at one event with a producer or
    with the condition are definite threats; and a condition without candidates makes its own guard a conflict.

    Raises:
        KeyError: if a guard mentions an assignment that the precedence's vocabulary does not have.
    """
    augmentation = _Augmentation(plan)
    for question in open_conditions(plan, precedence):
        contexts = Contexts(precedence, question.guard)
        augmentation.close(prune(question, contexts), contexts)
    return augmentation.result()


@dataclass(slots=True)
class _Augmentation:
    plan: model.TeamPlan
    choices: dict[str, model.Choice] = field(default_factory=dict)
    conditions: list[OpenCondition] = field(default_factory=list)
    links: list[LabeledCausalLink] = field(default_factory=list)
    threats: list[KeptAway] = field(default_factory=list)
    constraints: list[model.Constraint] = field(default_factory=list)
    formulas: list[Formula] = field(default_factory=list)
    conflicts: list[model.Guard] = field(default_factory=list)

    def close(self, question: OpenCondition, contexts: Contexts) -> None:
        """Add what makes an open condition met wherever it is activated."""
        self.conditions.append(question)
        if not question.producers:
            self.conflicts.append(question.guard)
            return
        values = _names(question.producers)
        variable = self._variable(f"s[{question}]", question.guard, (*values, NO_SUPPORT))
        links = [
            LabeledCausalLink(question, producer, frozenset({model.Assignment(variable, value)}))
            for producer, value in zip(question.producers, values, strict=True)
        ]
        self.links += links
        self.formulas.append(_support(question, links))
        for link in links:
            producer, first = link.producer.event, question.first
            if producer != first and not contexts.precedes(producer, first, link.label):
                self._order(producer, first, _context(link))
            for threat in question.threats:
                if contexts.possible(link.label, threat.guard):
                    self._keep_away(link, threat, contexts)

    def result(self) -> AugmentedPlan:
        network = self.plan.network
        choices = (*network.choices, *self.choices.values())
        network = replace(network, choices=choices, constraints=(*network.constraints, *self.constraints))
        formulas, conflicts = tuple(dict.fromkeys(self.formulas)), tuple(dict.fromkeys(self.conflicts))
        theory = Theory(network.domains, formulas, conflicts)
        links, conditions, threats = tuple(self.links), tuple(self.conditions), tuple(self.threats)
        return AugmentedPlan(self.plan, network, theory, links, conditions, threats)

    def _keep_away(self, link: LabeledCausalLink, threat: LabeledHappening, contexts: Contexts) -> None:
        """Keep a threat out of the interval of a link, wherever all three are activated: the cases of Figure 12."""
        context = _context(link) | threat.guard
        producer, last = link.producer.event, link.consumer.last

        def precedes(first: str, second: str) -> bool:
            return contexts.precedes(first, second, link.label, threat.guard)

        touches = threat.event in {producer, link.consumer.first, last}
        if not touches and (precedes(threat.event, producer) or precedes(last, threat.event)):
            return
        not_before = touches or precedes(producer, threat.event)
        not_after = touches or precedes(threat.event, last)
        variable = None
        if not_before and not_after:
            resolution = NEVER_TOGETHER
            self.conflicts.append(context)
        elif not_before:
            resolution = AFTER
            self._order(last, threat.event, context)
        elif not_after:
            resolution = BEFORE
            self._order(threat.event, producer, context)
        else:
            resolution = EITHER
            name = f"o[{link.consumer}, {producer}, {threat.event}]"
            variable = self._variable(name, context, (BEFORE, AFTER))
            self._order(threat.event, producer, context | {model.Assignment(variable, BEFORE)})
            self._order(last, threat.event, context | {model.Assignment(variable, AFTER)})
        self.threats.append(KeptAway(link, threat, resolution, variable))

    def _order(self, earlier: str, later: str, context: model.Guard) -> None:
        self.constraints.append(model.Constraint(earlier, later, self.plan.separation, None, context))

    def _variable(self, name: str, context: model.Guard, domain: tuple[str, ...]) -> str:
        """A new controllable choice variable, named apart from all others by its guard if need be."""
        taken = self.choices.keys() | self.plan.network.domains.keys()
        unique = _unused(name, f"{name}[{model.guard_text(context)}]", taken)
        self.choices[unique] = model.Choice(unique, domain, True, None)
        return unique


def _context(link: LabeledCausalLink) -> model.Guard:
    """When the link is selected, and its producer and its consumer are activated."""
    return link.selection | link.label | link.consumer.guard


def _support(question: OpenCondition, links: list[LabeledCausalLink]) -> Formula:
    """φ_c ⇒ ⋁ (s = e_P ∧ φ_P), without what φ_c says already."""
    selections = [conjunction(link.selection | (link.label - question.guard)) for link in links]
    consequence = selections[0] if len(selections) == 1 else Some(tuple(selections))
    return Some((Not(conjunction(question.guard)), consequence)) if question.guard else consequence


def _names(producers: tuple[LabeledHappening, ...]) -> tuple[str, ...]:
    """The producers' events; where several are at one event, with their guards."""
    names: list[str] = []
    for producer in producers:
        detailed = f"{producer.event}[{model.guard_text(producer.guard)}]"
        names.append(_unused(producer.event, detailed, {NO_SUPPORT, *names}))
    return tuple(names)


def _unused(name: str, detailed: str, taken: set[str]) -> str:
    """The short name, or the detailed one, or that with a number: the first that is not taken."""
    numbered = (f"{detailed}#{number}" for number in count(2))
    return next(each for each in chain((name, detailed), numbered) if each not in taken)
