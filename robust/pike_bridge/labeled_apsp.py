"""Labeled all-pairs shortest paths [PIKE §4.1, Algorithm 9]: distances between events as functions of choices.

In each scenario that has a schedule the distances are those of Floyd and Warshall's algorithm, which joins every pair
of events through each pivot. It is enough to join those pairs that come later in some order of the pivots, that is to
eliminate one event after the other: what is left of the graph then has, in every scenario, the same shortest paths and
a negative cycle if and only if there was one [Dechter, Meiri and Pearl 1991, directional path consistency]. The
shortest paths themselves follow from it row by row, when they are first asked for [Planken, de Weerdt and van der
Krogt 2012].

The entry of two events matters only where both are activated. So labels are kept modulo the guards of the two events,
which are joined again wherever a path leads through an event: the guard of a constraint entails those of its events
[PIKE, Definition 2.1], so no path leads through an event that is not activated.

Schedules of single scenarios: the earliest one, or the constraints that contradict each other.

In one scenario a plan with choices is a simple temporal network [PIKE, Definition 2.5], which has a schedule if and
only if its distance graph has no negative cycle [Dechter, Meiri and Pearl 1991].
"""

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from typing import Final, TypeAlias

from robust.network.differences import Cycle, DifferenceNetwork, Elimination
from robust.pike_bridge.distance_graph import DistanceGraph, LabeledEdge, LabeledValue, LabeledValueSet, distance_graph
from robust.pike_bridge.knowledge.sat import Propositions, satisfiable
from robust.pike_bridge.model import Environment, Guard, Tpnu, entails, guard, union
from robust.pike_bridge.theory import Theory
from robust.plan.polynomial import Polynomial
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Formula, Session, Terms

Numbers: TypeAlias = LabeledValueSet[int]


class LabeledElimination(Elimination[Numbers]):
    """A labeled distance graph whose events are eliminated, all or some.

    Raises:
        OutOfTimeError: from the methods that eliminate, if the deadline passes.
    """

    def __init__(self, graph: DistanceGraph, *, completions: bool, deadline: Deadline) -> None:
        super().__init__(len(graph.events))
        self.conflicts: Final = Numbers(graph.vocabulary)
        """Environments in which no scenario has a schedule, only the most general ones [PIKE, Definition 4.1].

        They are not closed under completions as they are found: that every scenario without schedule entails one of
        them is enough to exclude these scenarios, and their closure may be a great many more.
        """
        self._vocabulary = graph.vocabulary
        self._guards = graph.guards
        self._completions = completions
        self._deadline = deadline
        self._read(graph)

    def eliminate_all(self) -> None:
        """Eliminate every event: those with few neighbours first, and of those the deepest inside of choices."""
        while self.remaining:
            self.eliminate(min(self.remaining, key=self._degree))

    def contract(self, growth: int) -> None:
        """Eliminate events as long as each adds at most `growth` more labeled distances than it removes."""
        waiting = deque(self.remaining)
        while waiting:
            event = waiting.popleft()
            if event in self.remaining and self._growth(event) <= growth:
                self.eliminate(event)
                waiting.extend((self.before[event].keys() | self.after[event].keys()) - set(waiting))

    def edges(self) -> Iterator[LabeledEdge]:
        """What is left between the events that are left, with full labels."""
        for source in sorted(self.remaining):
            for target, distances in self.after[source].items():
                guard = self._guards[source] | self._guards[target]
                for value, label in distances:
                    yield LabeledEdge(source, target, value, label | guard)

    def join(self, source: int, first: Numbers, node: int, second: Numbers, target: int) -> None:
        """Replace a path through an event; one that leads back to its source is contradicted where it is negative."""
        both = self._guards[source] | self._guards[target]
        if source == target:
            self._contradict(first, second, both | self._guards[node])
        elif self._vocabulary.consistent(both):
            entry = self._entry(source, target)
            self.add_sums(first, second, node, entry, both)
            if not len(entry):
                self.disconnect(source, target)

    def add_sums(self, first: Numbers, second: Numbers, through: int, target: Numbers, ends: Environment) -> None:
        """Merge the sums of the distances from a source to an event, and from there to a target, into those to the
        target; `ends` are the guards of source and target.

        This is the body of the loops of [PIKE, Algorithm 9].
        """
        consistent, covered = self._vocabulary.consistent, self._covered
        base = ends | self._guards[through]
        if not consistent(base):
            return
        ceiling = target.unconditional()
        added = []
        others = second.pairs
        for value, label in first.pairs:
            self._deadline.enforce()
            start = base | label
            if not consistent(start) or covered(start):
                continue
            for other, other_label in others:
                total = value + other
                if ceiling is not None and total >= ceiling:
                    break
                whole = start | other_label
                if consistent(whole) and not covered(whole) and target.add(total, whole & ~ends):
                    added.append(whole & ~ends)
        if self._completions and added:
            target.complete(union(added), self._deadline)

    def _covered(self, environment: Environment) -> bool:
        """Whether the environment is known to be a conflict."""
        return self.conflicts.query(environment) is not None

    def _contradict(self, forth: Numbers, back: Numbers, guard: Environment) -> None:
        """Note as conflicts where two distances that lead to and fro add up to less than zero."""
        for value, label in forth.pairs:
            for other, other_label in back.pairs:
                if value + other >= 0:
                    break
                whole = guard | label | other_label
                if self._vocabulary.consistent(whole):
                    self.conflicts.add(0, whole)

    def _read(self, graph: DistanceGraph) -> None:
        for edge in graph.edges:
            if edge.source != edge.target:
                both = self._guards[edge.source] | self._guards[edge.target]
                self._entry(edge.source, edge.target).add(edge.weight, edge.label & ~both)
            elif edge.weight < 0:
                self.conflicts.add(0, edge.label)
        if self._completions:
            for neighbours in self.after:
                for distances in neighbours.values():
                    distances.complete(deadline=self._deadline)

    def _entry(self, source: int, target: int) -> Numbers:
        """The distances from one event to another, modulo the guards of both."""
        known = self.after[source].get(target)
        return self.connect(source, target, Numbers(self._vocabulary)) if known is None else known

    def _degree(self, event: int) -> tuple[int, int, int]:
        degree = len(self.after[event].keys() | self.before[event].keys())
        return degree, -self._guards[event].bit_count(), event

    def _growth(self, event: int) -> int:
        """An upper bound on how many labeled distances eliminating the event adds."""
        into = sum(map(len, self.before[event].values()))
        out = sum(map(len, self.after[event].values()))
        return into * out - into - out


class LabeledDistances:
    """D of [PIKE, Algorithm 9], a :class:`~robust.pike_bridge.distance_graph.Precedence`.

    With or without completions [PIKE, Algorithm 10]. Rows are computed when they are first needed. So every method that
    takes events may raise KeyError, if there is no such event.

    Raises:
        OutOfTimeError: if the deadline passes, now or when a row is first asked for.
    """

    def __init__(
        self, network: Tpnu, deadline: Deadline = NEVER, *, completions: bool = True, epsilon: Fraction = Fraction(0)
    ) -> None:
        graph = distance_graph(network)
        self._least = epsilon * graph.scale
        self.vocabulary = graph.vocabulary
        self._graph = graph
        self._places = graph.places
        self._elimination = LabeledElimination(graph, completions=completions, deadline=deadline)
        self._elimination.eliminate_all()
        self._completions = completions
        self._deadline = deadline
        self._rows: dict[int, list[Numbers]] = {}
        self._closed: dict[tuple[int, int], Numbers] = {}

    @property
    def conflicts(self) -> tuple[Environment, ...]:
        """Temporal conflicts of which none entails another [PIKE, Definition 4.1].

        A scenario has no schedule if and only if it entails one of them [PIKE, Theorem 4.1].
        """
        return tuple(label for _, label in self._elimination.conflicts)

    def conflicting(self, environment: Environment) -> bool:
        """Whether the environment is a temporal conflict; without completions, whether it is known to be one.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        return self._primes.query(environment) is not None

    @cached_property
    def _primes(self) -> Numbers:
        """With completions, all the most general temporal conflicts, which may be many more; else those that are known.

        An environment none of whose scenarios has a schedule entails one of them.
        """
        conflicts = Numbers(self.vocabulary, self._elimination.conflicts)
        if self._completions:
            conflicts.complete(deadline=self._deadline)
        return conflicts

    def query(self, source: str, target: str, environment: Environment = 0) -> Fraction | None:
        """The least known bound on t(target) − t(source) wherever both events and the environment hold; None for ∞.

        For scenarios that have a schedule it is the distance between the events. With completions it is, for every
        environment, the greatest of these distances over its scenarios that have a schedule; without, it may be more.
        Without meaning, though sound, if the environment contradicts the events' guards or is a conflict.
        """
        first, second = self._places[source], self._places[target]
        distance = self._distances(first, second).query(environment & ~self._both(first, second))
        return None if distance is None else Fraction(distance, self._graph.scale)

    def labeled(self, source: str, target: str) -> tuple[LabeledValue[Fraction], ...]:
        """The entry of two events by increasing distance, with labels modulo the guards of both."""
        entry = self._distances(self._places[source], self._places[target])
        return tuple((Fraction(value, self._graph.scale), label) for value, label in entry)

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        """first ≺ second in the context, by ε at least [PIKE, Definition 4.2].

        False if the context is impossible with the events.
        """
        before, after = self._places[first], self._places[second]
        both = self._both(before, after)
        whole = context | both
        if not self.vocabulary.consistent(whole) or self.conflicting(whole):
            return False
        distance = self._distances(after, before).query(context & ~both)
        return distance is not None and 0 < -distance >= self._least

    def _both(self, first: int, second: int) -> Environment:
        return self._graph.guards[first] | self._graph.guards[second]

    def _distances(self, source: int, target: int) -> Numbers:
        if (source, target) not in self._closed:
            if source not in self._rows:
                self._rows[source] = self._row(source)
            self._closed[source, target] = self._close(self._rows[source][target], self._both(source, target))
        return self._closed[source, target]

    def _row(self, source: int) -> list[Numbers]:
        """The distances from one event to all: along later events first, then back to earlier ones.

        Every shortest path can be had in this form once events are eliminated [Planken et al. 2012].
        """
        row = [Numbers(self.vocabulary) for _ in self._graph.events]
        row[source].add(0, 0)
        order = self._elimination.order
        for middle in order[order.index(source) :]:
            for event, distances in self._elimination.after[middle].items():
                self._extend(row, source, middle, event, distances)
        for event in reversed(order):
            if event != source:
                for middle, distances in self._elimination.before[event].items():
                    self._extend(row, source, middle, event, distances)
        return row

    def _extend(self, row: list[Numbers], source: int, middle: int, event: int, distances: Numbers) -> None:
        both = self._both(source, event)
        if len(row[middle]) and self.vocabulary.consistent(both):
            self._elimination.add_sums(row[middle], distances, middle, row[event], both)

    def _close(self, entry: Numbers, both: Environment) -> Numbers:
        """The entry with what follows because conflicts do not happen: in them, every bound holds."""
        conflicts = [label for _, label in self._primes]
        if not self._completions or not conflicts or not len(entry):
            return entry
        least = entry.pairs[0][0] - 1
        whole = Numbers(self.vocabulary, entry)
        whole.merge((least, conflict & ~both) for conflict in conflicts if self.vocabulary.consistent(conflict | both))
        whole.complete(deadline=self._deadline)
        return Numbers(self.vocabulary, (pair for pair in whole if pair[0] > least))


def schedule(network: Tpnu, scenario: Guard) -> dict[str, Fraction] | Guard:
    """The earliest schedule of a scenario, or a temporal conflict that it entails [PIKE, Definitions 2.5 and 4.1].

    A schedule gives a time to each event that is activated; none is negative. For an environment that is no full
    scenario, what holds in all of it counts: then a schedule says nothing of its scenarios.

    Raises:
        KeyError: if the scenario has an assignment that the network does not know.
    """
    graph = distance_graph(network)
    environment = graph.vocabulary.encode(scenario)
    edges = graph.active(environment)
    bounds = lower_bounds(len(graph.events), edges)
    if bounds.cycle is not None:
        return graph.vocabulary.decode(_label(bounds.cycle, edges))
    return {
        event: Fraction(time, graph.scale)
        for event, needed, time in zip(graph.events, graph.guards, bounds.times, strict=True)
        if entails(environment, needed)
    }


def lower_bounds(count: int, edges: Iterable[LabeledEdge]) -> DifferenceNetwork:
    """The network of `count` events in which all the edges hold."""
    # Seen by its source, an edge is a lower bound: t(source) ≥ t(target) − weight.
    return DifferenceNetwork(count, ((edge.target, edge.source, -edge.weight) for edge in edges))


def _label(cycle: Cycle, edges: Sequence[LabeledEdge]) -> Environment:
    """The environment in which all the edges of a cycle hold."""
    return union(edges[origin].label for origin in cycle.origins)


GROWTH = 2
"""How many edges more than an event has may replace it: by measurement, that halves the time of the solver."""


def temporal_conflicts(
    network: Tpnu, theory: Theory, deadline: Deadline = NEVER, *, solver: str = "z3"
) -> tuple[Guard, ...]:
    """Temporal conflicts of a network that exclude exactly those models of a theory that have no schedule.

    The theory may leave out choices of the network, which then may have any value. No conflict entails another one.

    Raises:
        OutOfTimeError: if the deadline passes first.
        SolverError: if the solver is unknown or not installed.
    """
    search = _ConflictSearch(network, theory, deadline, solver)
    plain = search.ask(())
    search.exhaust(plain)
    contracted = search.contracted(plain)
    flows = search.ask(circulation(search.terms, search.propositions, contracted))
    flows.add_all(map(search.exclusion, search.conflicts), deadline)
    search.exhaust(flows)
    decode = search.graph.vocabulary.decode
    return tuple(decode(conflict) for conflict in most_general(search.conflicts))


def circulation(terms: Terms, propositions: Propositions, graph: DistanceGraph) -> Iterable[Formula]:
    """The formula that the edges whose label holds carry a circulation of weight −1 (Farkas' lemma)."""
    flows = [Polynomial.variable(f"flow {number}") for number in range(len(graph.edges))]
    balance: dict[int, Polynomial[str]] = defaultdict(lambda: Polynomial({}))
    for edge, flow in zip(graph.edges, flows, strict=True):
        balance[edge.source] = balance[edge.source] - flow
        balance[edge.target] = balance[edge.target] + flow
        yield terms.at_least(flow)
        holds = propositions.guard(graph.vocabulary.decode(edge.label))
        yield terms.disjunction((holds, terms.at_least(-flow)))
    for total in balance.values():
        yield terms.equal(total)
    weighted = (flow.scaled(edge.weight) for edge, flow in zip(graph.edges, flows, strict=True))
    yield terms.equal(sum(weighted, Polynomial.constant(1)))


class _ConflictSearch:
    """The theory, the network, and the conflicts found so far."""

    def __init__(self, network: Tpnu, theory: Theory, deadline: Deadline, solver: str) -> None:
        self.graph = distance_graph(network)
        self.propositions = Propositions({**theory.domains, **network.domains})
        self.terms = self.propositions.terms
        self.conflicts: list[Environment] = []
        self._known = set(network.domains)
        self._theory = theory
        self._deadline = deadline
        self._solver = solver

    def contracted(self, session: Session) -> DistanceGraph:
        """The network without those events that are easily eliminated.

        Conflicts that show on the way are noted, if the theory in the session leaves them open.
        """
        elimination = LabeledElimination(self.graph, completions=False, deadline=self._deadline)
        elimination.contract(GROWTH)
        for _, label in elimination.conflicts:
            conflict = self._conflict(label)
            if conflict is not None and self._open(conflict, session):
                self._note(conflict, session)
        return replace(self.graph, edges=tuple(elimination.edges()))

    def _open(self, conflict: Environment, session: Session) -> bool:
        with session.frame(self.propositions.guard(self.graph.vocabulary.decode(conflict))):
            return satisfiable(session, "whether a conflict is possible", self._deadline)

    def _note(self, conflict: Environment, session: Session) -> None:
        self.conflicts.append(conflict)
        session.add(self.exclusion(conflict))

    def ask(self, further: Iterable[Formula]) -> Session:
        """A session for scenarios that satisfy the theory and something more."""
        session = Session(self.terms, solver=self._solver)
        session.add_all(self.propositions.theory(self._theory), self._deadline)
        session.add_all(further, self._deadline)
        return session

    def exhaust(self, session: Session) -> None:
        """Exclude from a session one conflict after the other, until it has no model or one that has a schedule."""
        while satisfiable(session, "a scenario without schedule", self._deadline):
            chosen = self.propositions.assigned(session.values(self.propositions.choices))
            scenario = guard({name: value for name, value in chosen.items() if name in self._known})
            conflict = self._conflict(self.graph.vocabulary.encode(scenario))
            if conflict is None:
                return
            self._note(conflict, session)

    def exclusion(self, conflict: Environment) -> Formula:
        return self.propositions.excluded(self.graph.vocabulary.decode(conflict))

    def _conflict(self, scenario: Environment) -> Environment | None:
        """A conflict that the scenario entails, generalised; None if what holds in it has a schedule."""
        edges = self.graph.active(scenario)
        cycle = lower_bounds(len(self.graph.events), edges).cycle
        return None if cycle is None else self._generalised(_label(cycle, edges), edges)

    def _generalised(self, conflict: Environment, edges: list[LabeledEdge]) -> Environment:
        """The conflict with only the assignments that one negative cycle needs, leaving out one after the other."""
        vocabulary, count = self.graph.vocabulary, len(self.graph.events)
        for variable in vocabulary.assigned(conflict):
            self._deadline.enforce()
            if not vocabulary.mentions(conflict, variable):
                continue
            weaker = vocabulary.without(conflict, variable)
            active = [edge for edge in edges if edge.label & weaker == edge.label]
            cycle = lower_bounds(count, active).cycle
            if cycle is not None:
                conflict = _label(cycle, active)
        return conflict


def most_general(conflicts: Iterable[Environment]) -> list[Environment]:
    """The environments that entail no other, in the given order."""
    kept: list[Environment] = []
    for conflict in dict.fromkeys(conflicts):
        if not any(conflict & other == other for other in kept):
            kept = [other for other in kept if other & conflict != conflict]
            kept.append(conflict)
    return kept
