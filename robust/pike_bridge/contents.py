"""What a compilation consists of, for people: labeled causal links with what keeps threats away, labels, distances."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import permutations

from robust.pike_bridge.causal import AugmentedPlan, LabeledHappening
from robust.pike_bridge.knowledge import tms
from robust.pike_bridge.labeled_apsp import LabeledDistances
from robust.pike_bridge.model import Guard, Literal, TeamPlan, Tpnu
from robust.pike_bridge.theory import Formula, interpret
from robust.smt.limits import NEVER, Deadline

Values = Mapping[str, str]
"""A conjunction of assignments: the value of each choice."""


@dataclass(frozen=True, slots=True)
class LinkThreat:
    """an effect that would break a causal link

    Attributes:
        event: at which it is
        actions: that begin or end there and have the effect; none: the initial state
        label: when it is activated
        resolution: before: it is ordered before the producer; after: after the consumer; either: one of the two, as
            `variable` says; never: the link is not used where the effect is activated
        variable: of knowledge bases, with the values before and after
    """

    event: str
    actions: list[str]
    label: Values
    resolution: str
    variable: str | None


@dataclass(frozen=True, slots=True)
class LinkProducer:
    """a labeled causal link of a condition

    Attributes:
        event: that produces what is needed
        actions: that begin or end there and have the effect; none: the initial state
        label: when the event is activated
        value: of the condition's variable that selects the link
        ordered: whether it had to be ordered before the consumer
    """

    event: str
    actions: list[str]
    label: Values
    value: str
    ordered: bool
    threats: list[LinkThreat]


@dataclass(frozen=True, slots=True)
class ConditionLinks:
    """a condition of activities or of the goal, and all labeled causal links that may support it

    Attributes:
        condition: the literal that is needed
        first: the event before which it is needed
        last: the event until which it is needed
        label: when it is needed
        actions: that need it; none: the goal
        variable: of knowledge bases, which says what supports it; null: nothing can
    """

    condition: str
    first: str
    last: str
    label: Values
    actions: list[str]
    variable: str | None
    producers: list[LinkProducer]


@dataclass(frozen=True, slots=True)
class FormulaLabel:
    """the label of a node: the environments in which its formula holds

    Attributes:
        kind: assumption, derived, or contradiction, whose formula must not hold
    """

    formula: str
    kind: str
    environments: list[Values]


@dataclass(frozen=True, slots=True)
class LabeledBound:
    """the time from one event to another is at most `bound` where the label holds"""

    bound: Fraction
    label: Values


@dataclass(frozen=True, slots=True)
class DistancePair:
    """the labeled value set of two events: all shortest paths that no other one dominates"""

    source: str
    target: str
    values: list[LabeledBound]


@dataclass(frozen=True, slots=True)
class PlanDistances:
    """labeled shortest paths of the augmented plan

    Attributes:
        conflicts: environments in which no scenario has a schedule
        pairs: of events with some bound; where both are activated
    """

    conflicts: list[Values]
    pairs: list[DistancePair]


def links_of(augmented: AugmentedPlan) -> list[ConditionLinks]:
    """Every condition with its links, and how the threats of each are kept away [PIKE §4.2 to §4.4, Figure 12]."""
    return list(_links(augmented))


def _links(augmented: AugmentedPlan) -> Iterator[ConditionLinks]:
    plan = augmented.plan
    threats: dict[int, list[LinkThreat]] = {}
    for link, threat, resolution, variable in augmented.threats:
        actions = _doing(plan, threat, link.consumer.literal.negation)
        kept_away = LinkThreat(threat.event, actions, dict(sorted(threat.guard)), resolution, variable)
        threats.setdefault(id(link), []).append(kept_away)
    producers: dict[int, list[LinkProducer]] = {}
    variables: dict[int, str] = {}
    ordered = {(each.source, each.target, each.guard) for each in augmented.added}
    for link in augmented.links:
        question, (event, guard) = link.consumer, link.producer
        [(variables[id(question)], value)] = link.selection
        actions = _doing(plan, link.producer, question.literal)
        added = (event, question.first, link.selection | guard | question.guard) in ordered
        shown = LinkProducer(event, actions, dict(sorted(guard)), value, added, threats.get(id(link), []))
        producers.setdefault(id(question), []).append(shown)
    for question in augmented.conditions:
        needed = _actions(plan, (condition.activity for condition in question.conditions))
        label, variable, own = (
            dict(sorted(question.guard)),
            variables.get(id(question)),
            producers.get(id(question), []),
        )
        yield ConditionLinks(str(question.literal), question.first, question.last, label, needed, variable, own)


def _doing(plan: TeamPlan, happening: LabeledHappening, literal: Literal) -> list[str]:
    """The actions whose effect it is."""
    effects = (each for each in plan.effects if (each.event, each.guard, each.literal) == (*happening, literal))
    return _actions(plan, (effect.activity for effect in effects))


def _actions(plan: TeamPlan, places: Iterable[int | None]) -> list[str]:
    return list(dict.fromkeys(plan.network.activities[place].action for place in places if place is not None))


def labels_of(knowledge: tms.LabelKnowledgeBase, deadline: Deadline = NEVER) -> list[FormulaLabel]:
    """The label of each node [PIKE §5.3, Invariant 5.2].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    return [
        FormulaLabel(formula_text(label.node.formula), label.node.kind.value, _sorted(label.environments))
        for label in knowledge.labels(deadline)
    ]


def _sorted(environments: Iterable[Guard]) -> list[Values]:
    """Short ones first."""
    ordered = sorted((tuple(sorted(each)) for each in environments), key=lambda each: (len(each), each))
    return [dict(each) for each in ordered]


def formula_text(formula: Formula) -> str:
    """A formula for people; parts of more than one word are in brackets."""

    def junction(word: str, nothing: str, parts: list[str]) -> str:
        return word.join(parts) if len(parts) == 1 else f"({word.join(parts)})" if parts else nothing

    return interpret(
        formula,
        str,
        lambda part: f"not {part}",
        lambda parts: junction(" and ", "true", parts),
        lambda parts: junction(" or ", "false", parts),
    )


def distances_of(network: Tpnu, distances: LabeledDistances, deadline: Deadline = NEVER) -> PlanDistances:
    """All labeled shortest paths of a network [PIKE, Algorithm 9].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    decode = distances.vocabulary.decode
    pairs = []
    for source, target in permutations(network.guards, 2):
        deadline.enforce()
        values = [
            LabeledBound(bound, dict(sorted(decode(label)))) for bound, label in distances.labeled(source, target)
        ]
        if values:
            pairs.append(DistancePair(source, target, values))
    return PlanDistances(_sorted(map(decode, distances.conflicts)), pairs)
