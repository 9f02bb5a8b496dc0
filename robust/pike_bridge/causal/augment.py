"""Augmented plans: conditions turned into choices and constraints, temporal and propositional [PIKE §4.3, Algorithm 5].

Each condition with candidates gets a *support variable*, whose value names the producer that supports it; each threat
that may come on either side of a link gets an *order variable*. Ordering constraints guarded by these variables then
keep producers before consumers and threats out of the way, so that every temporally consistent execution of the
augmented plan that satisfies the theory is correct [PIKE, Theorem 4.5].
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TypeAlias

from robust.pike_bridge.causal.dominance import Dominance, prune
from robust.pike_bridge.causal.links import Contexts, Happening, LabeledCausalLink, OpenCondition, open_conditions
from robust.pike_bridge.causal.threats import Resolution, resolve
from robust.pike_bridge.model import Assignment, Choice, Constraint, Guard, TeamPlan, Tpnu, guard_text
from robust.pike_bridge.temporal.interface import Precedence
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory, conjunction, implies

NO_SUPPORT = "none"
"""The value of a support variable whose consumer has no support, ⊥ in the paper."""
BEFORE = "before"
"""The value of an order variable whose threat comes before the producer, −1 in the paper."""
AFTER = "after"
"""The value of an order variable whose threat comes after the consumer, +1 in the paper."""


Order: TypeAlias = tuple[str, str]
"""An event and a later one."""


class Reason(Enum):
    """Why a constraint was added: the rows of [PIKE, Table 1] (temporal conflicts are found later)."""

    SUPPORT = "at least one activated producer"
    DEFINITE_THREAT = "avoid definite threat"
    PRODUCER_FIRST = "producers precede consumers"
    THREAT_AFTER = "force threat after consumer"
    THREAT_BEFORE = "force threat before producer"
    IDLE = "no support for a consumer that is not activated"
    """Not in the paper; see :class:`Encoding`."""


Statement: TypeAlias = Constraint | Formula | Guard
"""A temporal constraint of the network, or a propositional one: a formula, or a conflict given by its environment."""


@dataclass(frozen=True, slots=True)
class Addition:
    """A constraint that was added, and what for; rows about one link name its producer, those about a threat that."""

    statement: Statement
    reason: Reason
    consumer: OpenCondition
    producer: Happening | None = None
    threat: Happening | None = None


@dataclass(frozen=True, slots=True)
class Encoding:
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


def augment(plan: TeamPlan, precedence: Precedence, encoding: Encoding = Encoding()) -> AugmentedPlan:
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
    encoding: Encoding
    choices: dict[str, Choice] = field(default_factory=dict)
    links: list[LabeledCausalLink] = field(default_factory=list)
    additions: list[Addition] = field(default_factory=list)

    def close(self, question: OpenCondition, contexts: Contexts) -> None:
        """Add what makes an open condition met wherever it is activated."""
        if not question.producers:
            self.additions.append(Addition(question.guard, Reason.SUPPORT, question))
            return
        links = self._links(question)
        self.links += links
        self.additions += (Addition(formula, Reason.SUPPORT, question) for formula in _support(question, links))
        if not self.encoding.idle_supports:
            self.additions += (Addition(formula, Reason.IDLE, question) for formula in _idle(question, links))
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
            yield self._ordering(link, (producer, first), _context(link), Reason.PRODUCER_FIRST)

    def _away(self, link: LabeledCausalLink, threat: Happening, contexts: Contexts) -> Iterator[Addition]:
        """What keeps a threat out of the interval of a link; nothing if the three cannot be activated together."""
        if not contexts.possible(link.label, threat.guard):
            return
        context = _context(link) | threat.guard
        before: Order = (threat.event, link.producer.event)
        after: Order = (link.consumer.last, threat.event)
        match resolve(link.consumer, link.producer, threat, contexts):
            case Resolution.AVOID:
                yield Addition(context, Reason.DEFINITE_THREAT, link.consumer, link.producer)
            case Resolution.BEFORE:
                yield self._ordering(link, before, context, Reason.THREAT_BEFORE)
            case Resolution.AFTER:
                yield self._ordering(link, after, context, Reason.THREAT_AFTER)
            case Resolution.EITHER:
                name = f"o[{link.consumer}, {link.producer.event}, {threat.event}]"
                variable = self._variable(name, context, (BEFORE, AFTER))
                first, last = ({Assignment(variable, value)} for value in (BEFORE, AFTER))
                yield self._ordering(link, before, context | first, Reason.THREAT_BEFORE)
                yield self._ordering(link, after, context | last, Reason.THREAT_AFTER)
            case Resolution.NOTHING:
                pass

    def _ordering(self, link: LabeledCausalLink, order: Order, context: Guard, reason: Reason) -> Addition:
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
