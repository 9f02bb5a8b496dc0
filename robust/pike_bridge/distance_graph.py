"""Precedence, also by the structure of a plan alone, and what it rests on: distance graph and labeled value sets.

Source: [PIKE §2.1.1 for labeled values, §4.1, Definitions 4.1 to 4.3].
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import product
from math import inf, lcm
from operator import itemgetter
from typing import Generic, NamedTuple, Protocol, TypeAlias, TypeVar

from robust.pike_bridge.model import AssignmentVocabulary, Environment, Tpnu, bits, entails, union
from robust.smt.limits import NEVER, Deadline


class Precedence(Protocol):
    """Which events precede which, as far as some method of temporal reasoning can tell.

    Sound, not necessarily complete: True is a proof, False may be ignorance. Environments are of `vocabulary`, which
    holds the choice variables of the network that was analysed; variables that an augmented plan adds do not matter
    here, so callers leave them out.
    """

    vocabulary: AssignmentVocabulary

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        """first ≺ second in the context: in every temporally consistent execution in which both events and the context
        hold, `first` is before `second`, by ε at least where ε is given. The guards of both events are added here."""

    def conflicting(self, environment: Environment) -> bool:
        """Whether the environment is known to be a temporal conflict: no scenario in it has a schedule."""


class LabeledEdge(NamedTuple):
    """t(target) − t(source) ≤ weight in every scenario of the label; events by their places."""

    source: int
    target: int
    weight: int
    label: Environment


@dataclass(frozen=True, slots=True)
class DistanceGraph:
    """Edges between the places of events, over the environments of `vocabulary`."""

    vocabulary: AssignmentVocabulary
    events: tuple[str, ...]
    guards: tuple[Environment, ...]
    """The guard of each event, by place."""
    edges: tuple[LabeledEdge, ...]
    scale: int
    """How many units of weight are one unit of time."""

    @property
    def places(self) -> dict[str, int]:
        """The place of each event by its name."""
        return {event: place for place, event in enumerate(self.events)}

    def active(self, environment: Environment) -> list[LabeledEdge]:
        """The edges that hold in all of the environment."""
        return [edge for edge in self.edges if entails(environment, edge.label)]


def distance_graph(network: Tpnu) -> DistanceGraph:
    """The labeled distance graph of a network [PIKE §4.1].

    The label of an edge is the guard of its constraint together with those of its two events, which guards of
    constraints entail anyway [PIKE, Definition 2.1]. Edges whose label contradicts itself never hold and are left out.
    """
    vocabulary = AssignmentVocabulary(network.domains)
    places = {event.name: place for place, event in enumerate(network.events)}
    guards = tuple(vocabulary.encode(event.guard) for event in network.events)
    scale = lcm(*(bound.denominator for bound in network.bounds))
    edges: list[LabeledEdge] = []
    for entry in network.temporal_constraints:
        label = vocabulary.encode(entry.guard) | guards[places[entry.source]] | guards[places[entry.target]]
        if vocabulary.consistent(label):
            for one, other, most in entry.upper_bounds:
                edges.append(LabeledEdge(places[one], places[other], int(most * scale), label))
    events = tuple(event.name for event in network.events)
    return DistanceGraph(vocabulary, events, guards, tuple(edges), scale)


V = TypeVar("V", int, Fraction)

LabeledValue: TypeAlias = tuple[V, Environment]
"""A value, and where it holds [PIKE, Definition 2.10]."""


class LabeledValueSet(Generic[V]):
    """Labeled upper bounds of which none dominates another, by increasing value [PIKE, Definition 2.12].

    Less is tighter; lower bounds are kept as upper bounds on what is negated.
    """

    __slots__ = ("pairs", "vocabulary")

    def __init__(self, vocabulary: AssignmentVocabulary, pairs: Iterable[LabeledValue[V]] = ()) -> None:
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
            assigned = self.vocabulary.assign(variable, value)
            pairs = ((bound, label & ~assigned) for bound, label in self.pairs if label & assigned == assigned)
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


# -- precedence by single bounds ---------------------------------------------------------------------------------------


class KnownOrders:
    """Which events come before others whenever both are executed, as chains of single bounds tell; as sets of bits."""

    def __init__(self, network: Tpnu, epsilon: Fraction) -> None:
        guards = network.guards
        self._place = {event: place for place, event in enumerate(guards)}
        needing: list[tuple[int, int, bool]] = []
        needed: list[tuple[int, int, bool]] = []
        for each in network.temporal_constraints:
            for other, one, most in each.upper_bounds:
                if most <= 0:
                    far = 0 < -most >= epsilon
                    source, target = self._place[one], self._place[other]
                    if each.guard | guards[one] <= guards[other]:
                        needing.append((target, source, far))
                    if each.guard | guards[other] <= guards[one]:
                        needed.append((source, target, far))
        needed.sort(reverse=True)
        self._back, self._far_back = _closed(len(guards), needing)
        self._forth, self._far_forth = _closed(len(guards), needed)

    def ordered(self, earlier: str, later: str) -> bool:
        """Whether an event is no later than another."""
        one, other = self._place[earlier], self._place[later]
        return bool(self._forth[one] & self._back[other])

    def apart(self, earlier: str, later: str) -> bool:
        """Whether an event is earlier than another by ε at least."""
        one, other = self._place[earlier], self._place[later]
        return bool(self._far_forth[one] & self._back[other] | self._forth[one] & self._far_back[other])


def _closed(count: int, edges: Iterable[tuple[int, int, bool]]) -> tuple[list[int], list[int]]:
    """For each number those that it leads to, itself included; and those to which a far edge is on the way."""
    reached, far_reached = [1 << number for number in range(count)], [0] * count
    known = list(edges)
    changed = True
    while changed:
        changed = False
        for source, target, far in known:
            near = reached[source] | reached[target]
            distant = far_reached[source] | far_reached[target] | (reached[target] if far else 0)
            if near != reached[source] or distant != far_reached[source]:
                reached[source], far_reached[source], changed = near, distant, True
    return reached, far_reached


# -- precedence by structure -------------------------------------------------------------------------------------------

ROUNDS = 50
"""Rounds over all events after which bounds are taken as they are; more are needed only around positive cycles."""

Arrival: TypeAlias = tuple[int, int]
"""An earlier event, and the least time from it."""
Cases: TypeAlias = Sequence[Sequence[Arrival]]
"""Alternatives of which at least one holds, each of arrivals that then all hold: one for each value of a choice."""


Bounds: TypeAlias = tuple[Sequence[Arrival], Sequence[Cases]]
"""What holds in any case, and by cases."""


class StructuralPrecedence:
    """A :class:`Precedence` by unlabeled lower bounds, by cases on single choices, without labeled distances.

    It is sound and much cheaper than labeled shortest paths, but not complete. Contexts only tell what is impossible:
    what counts are the guards of the two events. All is computed when asked.
    """

    def __init__(self, network: Tpnu, deadline: Deadline = NEVER, *, epsilon: Fraction = Fraction(0)) -> None:
        graph = distance_graph(network)
        self._least = epsilon * graph.scale
        self.vocabulary: AssignmentVocabulary = graph.vocabulary
        self._guards = graph.guards
        self._places = graph.places
        self._deadline = deadline
        self._incoming: dict[int, list[LabeledEdge]] = defaultdict(list)
        for edge in graph.edges:
            # Seen by its source, an edge is a lower bound: t(source) ≥ t(target) − weight.
            self._incoming[edge.source].append(edge)
        self._order = _order(graph)
        self._chains = KnownOrders(network, epsilon)
        self._concerns = [self._concern(event) for event in range(len(graph.events))]
        self._cases: dict[tuple[int, Environment], Bounds] = {}
        self._bounds: dict[Environment, list[tuple[int, Bounds]]] = {}
        self._solvable: dict[Environment, bool] = {}
        self._rows: dict[int, list[float]] = {}

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        """first ≺ second, by a positive lower bound, of at least ε, that holds whenever both events and the context do.

        False if the context is impossible with the events.

        Raises:
            KeyError: if there is no such event.
            OutOfTimeError: if the deadline has passed.
        """
        before, after = self._places[first], self._places[second]
        if self.conflicting(context | self._guards[before] | self._guards[after]):
            return False
        if before not in self._rows and self._feasible(self._guards[before]):
            if self._chains.apart(first, second):
                return True
            if entails(self._guards[before], self._guards[after]) and self._chains.ordered(second, first):
                return False
        if before not in self._rows:
            self._deadline.enforce()
            lower = [-inf] * len(self._guards)
            lower[before] = 0
            self._relax(lower, self._guards[before])
            self._rows[before] = lower
        return 0 < self._rows[before][after] >= self._least

    def conflicting(self, environment: Environment) -> bool:
        """Whether the environment contradicts itself: conflicts of times are not looked for."""
        return not self.vocabulary.consistent(environment)

    def _feasible(self, guard: Environment) -> bool:
        """Whether bounds that hold where the guard does have a solution; then no row tells more than chains contradict.

        Rows of guards that have none grow without end, and say that everything precedes everything.
        """
        if guard not in self._solvable:
            self._deadline.enforce()
            self._solvable[guard] = self._relax([0] * len(self._guards), guard)
        return self._solvable[guard]

    def _relax(self, lower: list[float], guard: Environment) -> bool:
        """Raise lower bounds on the times of all events until nothing changes; False if that takes too long."""
        if guard not in self._bounds:
            self._bounds[guard] = [(event, self._bounds_of(event, guard)) for event in self._order]
        for _ in range(ROUNDS):
            changed = False
            for event, (certain, covered) in self._bounds[guard]:
                best = lower[event]
                for other, delay in certain:
                    best = max(best, lower[other] + delay)
                for cases in covered:
                    best = max(best, min(max(lower[other] + delay for other, delay in arrivals) for arrivals in cases))
                if best > lower[event]:
                    lower[event] = best
                    changed = True
            if not changed:
                return True
        return False

    def _concern(self, event: int) -> Environment:
        """All bits of the variables that matter for the bounds of an event."""
        mentioned = union([self._guards[event], *(edge.label for edge in self._incoming[event])])
        fields = union(map(self.vocabulary.field, self.vocabulary.assigned(mentioned)))
        return fields | fields << self.vocabulary.width

    def _bounds_of(self, event: int, environment: Environment) -> Bounds:
        """What the event's time is at least, in the scenarios of an environment that activate it."""
        key = event, environment & self._concerns[event]
        if key not in self._cases:
            self._cases[key] = self._found(*key)
        return self._cases[key]

    def _found(self, event: int, environment: Environment) -> Bounds:
        whole = environment | self._guards[event]
        if not self.vocabulary.consistent(whole):
            return [], []
        arrivals: dict[int, list[Arrival]] = defaultdict(list)
        """By the bit of an assignment, or 0 for what always holds."""
        for edge in self._incoming[event]:
            missing = edge.label & ~whole & self.vocabulary.made
            if missing & (missing - 1) == 0 and self.vocabulary.consistent(edge.label | whole):
                arrivals[missing].append((edge.target, -edge.weight))
        assigned = [self.vocabulary.assignments[bit.bit_length() - 1].variable for bit in arrivals if bit]
        fields = [self.vocabulary.field(variable) for variable in dict.fromkeys(assigned)]
        by_value = [[1 << position for position in bits(field)] for field in fields]
        covered: list[Cases] = [
            [arrivals[bit] for bit in values] for values in by_value if arrivals.keys() >= set(values)
        ]
        return arrivals.get(0, []), covered


def _order(graph: DistanceGraph) -> list[int]:
    """The events so that most constraints lead forward: by the length of the longest chain of positive lower bounds."""
    depth = [0] * len(graph.events)
    forward = [(edge.target, edge.source) for edge in graph.edges if edge.weight < 0 and edge.source != edge.target]
    for _ in range(len(depth)):
        changed = False
        for before, after in forward:
            if depth[after] <= depth[before] < len(depth):
                depth[after] = depth[before] + 1
                changed = True
        if not changed:
            break
    return sorted(range(len(depth)), key=depth.__getitem__)
