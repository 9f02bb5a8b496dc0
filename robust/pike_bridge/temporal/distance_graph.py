"""What all temporal reasoning over plans with choices shares: precedence, the distance graph and labeled value sets.

Source: [PIKE §2.1.1 for labeled values, §4.1, Definitions 4.1 to 4.3].
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import Generic, NamedTuple, Protocol, TypeAlias, TypeVar

from robust.pike_bridge.model import Constraint, Environment, Tpnu, Vocabulary, entails
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
        hold, `first` is strictly before `second`. The guards of both events are added to the context here."""

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
            edges.append(DistanceEdge(source, target, _scaled(entry.upper, scale), label, number))
        if entry.lower is not None:
            edges.append(DistanceEdge(target, source, _scaled(-entry.lower, scale), label, number))
    events = tuple(event.name for event in network.events)
    return DistanceGraph(vocabulary, events, guards, constraints, tuple(edges), scale)


def _scaled(bound: Fraction, scale: int) -> int:
    return bound.numerator * (scale // bound.denominator)


V = TypeVar("V")

LabeledValue: TypeAlias = tuple[V, Environment]
"""A value, and where it holds [PIKE, Definition 2.10]."""


def union(labels: Iterable[Environment]) -> Environment:
    """All the bits of some environments, which need not be consistent with each other."""
    bits = 0
    for label in labels:
        bits |= label
    return bits


class LabeledValueSet(Generic[V]):
    """Labeled values of which none dominates another [PIKE, Definition 2.12].

    `less(a, b)` says that a is tighter than b: a strict order, total or partial. Resolution of cases
    (:meth:`completions`) needs a total one, because it takes maxima.
    """

    __slots__ = ("_less", "_pairs", "vocabulary")

    def __init__(
        self, vocabulary: Vocabulary, less: Callable[[V, V], bool], pairs: Iterable[LabeledValue[V]] = ()
    ) -> None:
        self.vocabulary = vocabulary
        self._less = less
        self._pairs: list[LabeledValue[V]] = []
        for value, environment in pairs:
            self.add(value, environment)

    def __iter__(self) -> Iterator[LabeledValue[V]]:
        return iter(self._pairs)

    def __len__(self) -> int:
        return len(self._pairs)

    def empty(self) -> LabeledValueSet[V]:
        """A set of the same kind without elements."""
        return LabeledValueSet(self.vocabulary, self._less)

    def add(self, value: V, environment: Environment) -> bool:
        """Add a pair unless another dominates it, and drop those that it dominates: AddLVS [PIKE §2.1.1].

        Returns whether it was added.
        """
        less = self._less
        for known, label in self._pairs:
            if environment & label == label and (known == value or less(known, value)):
                return False
        self._pairs = [
            (known, label)
            for known, label in self._pairs
            if label & environment != environment or not (known == value or less(value, known))
        ]
        self._pairs.append((value, environment))
        return True

    def merge(self, pairs: Iterable[LabeledValue[V]]) -> list[LabeledValue[V]]:
        """Add every pair: MergeLVS [PIKE §2.1.1]; those that were added, even if a later one replaced them."""
        return [(value, environment) for value, environment in pairs if self.add(value, environment)]

    def tightest(self, environment: Environment) -> list[V]:
        """The values known to hold in all of an environment that no other such value is less than."""
        holding = [value for value, label in self._pairs if environment & label == label]
        return [value for value in holding if not any(self._less(other, value) for other in holding)]

    def query(self, environment: Environment) -> V | None:
        """Q_L(φ), the tightest value known to hold in all of an environment [PIKE §2.1.1]; None stands for ∞_R.

        If the order is only partial and leaves several, one of them.
        """
        return next(iter(self.tightest(environment)), None)

    def combine(self, other: Iterable[LabeledValue[V]], operation: Callable[[V, V], V]) -> LabeledValueSet[V]:
        """The operation on each pair of this set and each of the other, where both labels can hold: LVSBinaryOp."""
        consistent = self.vocabulary.consistent
        result = self.empty()
        others = list(other)
        for first, first_label in self._pairs:
            for second, second_label in others:
                label = first_label | second_label
                if consistent(label):
                    result.add(operation(first, second), label)
        return result

    def completions(self, variable: str) -> LabeledValueSet[V]:
        """What follows by cases on a variable: if it has one of its values anyway, the greatest of the values that hold
        under each of them does [PIKE, Theorem C.1 and Algorithm 8]."""
        result: LabeledValueSet[V] | None = None
        for value in self.vocabulary.domains[variable]:
            case = self.empty()
            assignment = self.vocabulary.assign(variable, value)
            for bound, label in self._pairs:
                if label & assignment == assignment:
                    case.add(bound, label & ~assignment)
            result = case if result is None else result.combine(case, self._greatest)
            if not len(result):
                break
        return self.empty() if result is None else result

    def merge_with_completions(self, pairs: Iterable[LabeledValue[V]], deadline: Deadline = NEVER) -> None:
        """Add every pair and what follows by cases, until nothing new does [PIKE, Algorithm 10].

        If the set was closed under completions before, it is so afterwards; then queries are tightest for every
        environment: Q_L(φ) is the greatest of Q_L(φ_S) over all scenarios φ_S of φ.

        Raises:
            OutOfTimeError: if the deadline passes; the set is sound then, but not closed.
        """
        self.complete(union(label for _, label in self.merge(pairs)), deadline)

    def close(self, deadline: Deadline = NEVER) -> None:
        """Add what follows by cases, until nothing new does, whatever is in the set.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        self.complete(union(label for _, label in self._pairs), deadline)

    def complete(self, pending: Environment, deadline: Deadline = NEVER) -> None:
        """Close the set after additions whose labels mention only the variables that `pending` assigns.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        vocabulary = self.vocabulary
        pending &= vocabulary.made
        while pending:
            deadline.enforce()
            variable = vocabulary.assignments[(pending & -pending).bit_length() - 1].variable
            field = vocabulary.field(variable)
            pending &= ~field
            if self._covers(field):
                pending |= union(label for _, label in self.merge(self.completions(variable))) & vocabulary.made

    def _covers(self, field: int) -> bool:
        """Whether every value of a variable occurs in some label: without that there is nothing to complete."""
        return union(label for _, label in self._pairs) & field == field

    def _greatest(self, first: V, second: V) -> V:
        return second if self._less(first, second) else first


class LabeledNumbers(LabeledValueSet[int]):
    """Labeled upper bounds, less being tighter, sorted by value: what labeled shortest paths are made of."""

    __slots__ = ()

    def __init__(self, vocabulary: Vocabulary, pairs: Iterable[LabeledValue[int]] = ()) -> None:
        super().__init__(vocabulary, operator.lt, pairs)

    def empty(self) -> LabeledNumbers:
        return LabeledNumbers(self.vocabulary)

    def pairs(self) -> Sequence[LabeledValue[int]]:
        """The pairs by increasing value; not to be kept while the set changes."""
        return self._pairs

    def unconditional(self) -> int | None:
        """The value that holds in every scenario, which no other exceeds; None if there is none."""
        return self._pairs[-1][0] if self._pairs and not self._pairs[-1][1] else None

    def add(self, value: int, environment: Environment) -> bool:
        pairs = self._pairs
        place = 0
        for known, label in pairs:
            if known > value:
                break
            if environment & label == label:
                return False
            place += 1
        # Only from here on are values that the new one can dominate, besides equal ones just before.
        first = place
        while first and pairs[first - 1][0] == value:
            first -= 1
        pairs[first:] = [
            *(pair for pair in pairs[first:place] if pair[1] & environment != environment),
            (value, environment),
            *(pair for pair in pairs[place:] if pair[1] & environment != environment),
        ]
        return True

    def query(self, environment: Environment) -> int | None:
        for value, label in self._pairs:
            if environment & label == label:
                return value
        return None
