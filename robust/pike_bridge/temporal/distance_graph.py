"""What all temporal reasoning over plans with choices shares: precedence, the distance graph and labeled value sets.

Source: [PIKE §2.1.1 for labeled values, §4.1, Definitions 4.1 to 4.3].
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import product
from math import lcm
from operator import itemgetter
from typing import Generic, NamedTuple, Protocol, TypeAlias, TypeVar

from robust.pike_bridge.model import Constraint, Environment, Tpnu, Vocabulary, entails, union
from robust.smt.limits import NEVER, Deadline


class Precedence(Protocol):
    """Which events precede which, as far as some method of temporal reasoning can tell.

    Sound, not necessarily complete: True is a proof, False may be ignorance. Environments are of `vocabulary`, which
    holds the choice variables of the network that was analysed; variables that an augmented plan adds do not matter
    here, so callers leave them out.
    """

    vocabulary: Vocabulary

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        """first ≺ second in the context: in every temporally consistent execution in which both events and the context
        hold, `first` is before `second`, by ε at least where ε is given. The guards of both events are added here."""

    def conflicting(self, environment: Environment) -> bool:
        """Whether the environment is known to be a temporal conflict: no scenario in it has a schedule."""


class DistanceEdge(NamedTuple):
    """t(target) − t(source) ≤ weight in every scenario of the label; events and constraints by their places."""

    source: int
    target: int
    weight: int
    label: Environment
    constraint: int
    """The place in `Tpnu.temporal_constraints` of the constraint that says so."""


@dataclass(frozen=True, slots=True)
class DistanceGraph:
    """Edges between the places of events, over the environments of `vocabulary`."""

    vocabulary: Vocabulary
    events: tuple[str, ...]
    guards: tuple[Environment, ...]
    """The guard of each event, by place."""
    constraints: tuple[Constraint, ...]
    edges: tuple[DistanceEdge, ...]
    scale: int
    """How many units of weight are one unit of time."""

    @property
    def places(self) -> dict[str, int]:
        """The place of each event by its name."""
        return {event: place for place, event in enumerate(self.events)}

    def active(self, environment: Environment) -> list[DistanceEdge]:
        """The edges that hold in all of the environment."""
        return [edge for edge in self.edges if entails(environment, edge.label)]


def distance_graph(network: Tpnu) -> DistanceGraph:
    """The labeled distance graph of a network [PIKE §4.1].

    The label of an edge is the guard of its constraint together with those of its two events, which guards of
    constraints entail anyway [PIKE, Definition 2.1]. Edges whose label contradicts itself never hold and are left out.
    """
    vocabulary = Vocabulary(network.domains)
    places = {event.name: place for place, event in enumerate(network.events)}
    guards = tuple(vocabulary.encode(event.guard) for event in network.events)
    constraints = network.temporal_constraints
    bounds = [bound for entry in constraints for bound in (entry.lower, entry.upper) if bound is not None]
    scale = lcm(*(bound.denominator for bound in bounds))
    edges: list[DistanceEdge] = []
    for number, entry in enumerate(constraints):
        source, target = places[entry.source], places[entry.target]
        label = vocabulary.encode(entry.guard) | guards[source] | guards[target]
        if not vocabulary.consistent(label):
            continue
        if entry.upper is not None:
            edges.append(DistanceEdge(source, target, int(entry.upper * scale), label, number))
        if entry.lower is not None:
            edges.append(DistanceEdge(target, source, int(-entry.lower * scale), label, number))
    events = tuple(event.name for event in network.events)
    return DistanceGraph(vocabulary, events, guards, constraints, tuple(edges), scale)


V = TypeVar("V", int, Fraction)

LabeledValue: TypeAlias = tuple[V, Environment]
"""A value, and where it holds [PIKE, Definition 2.10]."""


class LabeledValueSet(Generic[V]):
    """Labeled upper bounds of which none dominates another, by increasing value [PIKE, Definition 2.12].

    Less is tighter; lower bounds are kept as upper bounds on what is negated.
    """

    __slots__ = ("pairs", "vocabulary")

    def __init__(self, vocabulary: Vocabulary, pairs: Iterable[LabeledValue[V]] = ()) -> None:
        self.vocabulary = vocabulary
        self.pairs: list[LabeledValue[V]] = []
        """By increasing value; not to be kept while the set changes."""
        self.merge(pairs)

    def __iter__(self) -> Iterator[LabeledValue[V]]:
        return iter(self.pairs)

    def __len__(self) -> int:
        return len(self.pairs)

    def unconditional(self) -> V | None:
        """The value that holds in every scenario, which no other exceeds; None if there is none."""
        return self.pairs[-1][0] if self.pairs and not self.pairs[-1][1] else None

    def add(self, value: V, environment: Environment) -> bool:
        """Add a pair unless another dominates it, and drop those that it dominates: AddLVS [PIKE §2.1.1].

        Returns whether it was added.
        """
        pairs = self.pairs
        for known, label in pairs:
            if known > value:
                break
            if environment & label == label:
                return False
        first = bisect_left(pairs, value, key=itemgetter(0))
        pairs[first:] = [pair for pair in pairs[first:] if pair[1] & environment != environment]
        insort(pairs, (value, environment), key=itemgetter(0))
        return True

    def merge(self, pairs: Iterable[LabeledValue[V]]) -> Environment:
        """Add every pair: MergeLVS [PIKE §2.1.1]; all the bits of the labels of those that were added."""
        return union([environment for value, environment in pairs if self.add(value, environment)])

    def query(self, environment: Environment) -> V | None:
        """Q_L(φ), the least value known to hold in all of an environment [PIKE §2.1.1]; None stands for ∞_R."""
        return next((value for value, label in self.pairs if environment & label == label), None)

    def combine(self, other: LabeledValueSet[V], operation: Callable[[V, V], V]) -> LabeledValueSet[V]:
        """The operation on each pair of this set and each of the other, where both labels can hold: LVSBinaryOp."""
        result = LabeledValueSet[V](self.vocabulary)
        for (first, label), (second, other_label) in product(self.pairs, other.pairs):
            if self.vocabulary.consistent(label | other_label):
                result.add(operation(first, second), label | other_label)
        return result

    def completions(self, variable: str) -> LabeledValueSet[V]:
        """What follows by cases on a variable: if it has one of its values anyway, the greatest of the values that hold
        under each of them does [PIKE, Theorem C.1 and Algorithm 8]."""
        cases = []
        for value in self.vocabulary.domains[variable]:
            made = self.vocabulary.assign(variable, value)
            pairs = ((bound, label & ~made) for bound, label in self.pairs if label & made == made)
            cases.append(LabeledValueSet[V](self.vocabulary, pairs))
        return reduce(lambda first, second: first.combine(second, max), cases)

    def complete(self, pending: Environment = -1, deadline: Deadline = NEVER) -> None:
        """Add what follows by cases, until nothing new does [PIKE, Algorithm 10].

        Then queries are tightest for every environment: Q_L(φ) is the greatest of Q_L(φ_S) over all scenarios φ_S of φ.

        Args:
            pending: if the set was closed before, the labels that were added since; their variables are looked at.

        Raises:
            OutOfTimeError: if the deadline passes; the set is sound then, but not closed.
        """
        vocabulary = self.vocabulary
        pending &= vocabulary.made
        while pending:
            deadline.enforce()
            variable = vocabulary.assignments[(pending & -pending).bit_length() - 1].variable
            field = vocabulary.field(variable)
            pending &= ~field
            # Unless every value of the variable occurs in some label, there is nothing to complete.
            if union([label for _, label in self.pairs]) & field == field:
                pending |= self.merge(self.completions(variable)) & vocabulary.made
