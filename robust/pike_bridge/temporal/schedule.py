"""Schedules of single scenarios: the earliest one, or the constraints that contradict each other.

In one scenario a plan with choices is a simple temporal network [PIKE, Definition 2.5], which has a schedule if and
only if its distance graph has no negative cycle [Dechter, Meiri and Pearl 1991].
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from robust.pike_bridge.knowledge.sat import Propositions
from robust.pike_bridge.model import Constraint, Environment, Guard, Tpnu, entails
from robust.pike_bridge.temporal.distance_graph import DistanceEdge, DistanceGraph, distance_graph
from robust.pike_bridge.temporal.labeled_apsp import Elimination
from robust.pike_bridge.theory import Theory
from robust.plan.polynomial import Polynomial
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms


@dataclass(frozen=True, slots=True)
class Schedule:
    """A time for each event that the scenario activates; the earliest possible, if none is negative."""

    times: Mapping[str, Fraction]


@dataclass(frozen=True, slots=True)
class CycleStep:
    """One side of a constraint: t(target) − t(source) ≤ bound, where the constraint may run the other way."""

    source: str
    target: str
    bound: Fraction
    constraint: Constraint


@dataclass(frozen=True, slots=True)
class NegativeCycle:
    """Steps that lead back to their first event, whose bounds add up to less than zero: they contradict each other."""

    steps: tuple[CycleStep, ...]
    guard: Guard
    """Whenever it holds, all the steps do, so that it is a temporal conflict [PIKE, Definition 4.1]."""

    @property
    def total(self) -> Fraction:
        """The sum of the bounds, which is negative."""
        return sum((step.bound for step in self.steps), Fraction(0))


def schedule(network: Tpnu, scenario: Guard) -> Schedule | NegativeCycle:
    """The earliest schedule of a scenario, or why there is none [PIKE, Definition 2.5].

    For an environment that is no full scenario, what holds in all of it counts: then a schedule says nothing of its
    scenarios, and a negative cycle is one of each of them.

    Raises:
        KeyError: if the scenario has an assignment that the network does not know.
    """
    graph = distance_graph(network)
    environment = graph.vocabulary.encode(scenario)
    found = earliest_times(len(graph.events), graph.active(environment))
    if isinstance(found, Cycle):
        return named_cycle(graph, found)
    return Schedule(
        {
            event: Fraction(time, graph.scale)
            for event, guard, time in zip(graph.events, graph.guards, found, strict=True)
            if entails(environment, guard)
        }
    )


def negative_cycle(network: Tpnu, scenario: Guard) -> NegativeCycle | None:
    """Constraints of a scenario that contradict each other; None if it has a schedule.

    Raises:
        KeyError: if the scenario has an assignment that the network does not know.
    """
    found = schedule(network, scenario)
    return found if isinstance(found, NegativeCycle) else None


@dataclass(frozen=True, slots=True)
class Cycle:
    """Edges that lead in a circle, in order, of negative total weight."""

    edges: tuple[DistanceEdge, ...]

    @property
    def label(self) -> Environment:
        """The environment in which all the edges hold."""
        label = 0
        for edge in self.edges:
            label |= edge.label
        return label


def named_cycle(graph: DistanceGraph, cycle: Cycle) -> NegativeCycle:
    """A cycle in the terms of the network."""
    steps = tuple(
        CycleStep(
            graph.events[edge.source],
            graph.events[edge.target],
            Fraction(edge.weight, graph.scale),
            graph.constraints[edge.constraint],
        )
        for edge in cycle.edges
    )
    return NegativeCycle(steps, graph.vocabulary.decode(cycle.label))


def earliest_times(count: int, edges: Iterable[DistanceEdge]) -> list[int] | Cycle:
    """The least times, none negative, of `count` events that satisfy all the edges; or a negative cycle.

    Bellman and Ford's algorithm, looking for a circle among the reasons of the times after each round.
    """
    # Seen by its source, an edge is a lower bound: t(source) ≥ t(target) − weight.
    bounds = sorted(edges, key=lambda edge: (edge.source, edge.target))
    times = [0] * count
    reasons: list[DistanceEdge | None] = [None] * count
    changed = True
    while changed:
        changed = False
        for edge in bounds:
            time = times[edge.target] - edge.weight
            if time > times[edge.source]:
                times[edge.source] = time
                reasons[edge.source] = edge
                changed = True
        cycle = _circle(reasons)
        if cycle is not None:
            return cycle
    return times


def _circle(reasons: Sequence[DistanceEdge | None]) -> Cycle | None:
    """A circle among the edges that gave each event its time; every such circle is negative."""
    visited = [0] * len(reasons)
    for start in range(len(reasons)):
        event = start
        while not visited[event]:
            visited[event] = start + 1
            reason = reasons[event]
            if reason is None:
                break
            event = reason.target
        else:
            if visited[event] == start + 1:
                return _circle_from(event, reasons)
    return None


def _circle_from(start: int, reasons: Sequence[DistanceEdge | None]) -> Cycle:
    circle: list[DistanceEdge] = []
    event = start
    while (reason := reasons[event]) is not None:
        circle.append(reason)
        event = reason.target
        if event == start:
            break
    return Cycle(tuple(circle))


GROWTH = 2
"""How many edges more than an event has may replace it: by measurement, that halves the time of the solver."""
DERIVED = -1
"""Stands for the constraint of an edge that follows from several."""


def temporal_conflicts(
    network: Tpnu, theory: Theory, deadline: Deadline = NEVER, *, solver: str = "z3"
) -> tuple[Guard, ...]:
    """Temporal conflicts of a network that exclude exactly those models of a theory that have no schedule.

    The theory may leave out choices of the network, which then may have any value. No conflict entails another one.

    Raises:
        OutOfTimeError: if the deadline passes first.
        SolverError: if the solver is unknown or not installed.
    """
    search = _Search(network, theory, deadline, solver)
    plain = search.ask(())
    search.exhaust(plain)
    contracted = search.contracted(plain)
    flows = search.ask(circulation(search.terms, search.propositions, contracted))
    flows.add_all(map(search.exclusion, search.conflicts), deadline)
    search.exhaust(flows)
    decode = search.graph.vocabulary.decode
    return tuple(decode(conflict) for conflict in most_general(search.conflicts))


def circulation(terms: Terms, propositions: Propositions, graph: DistanceGraph) -> Iterable[Formula]:
    """That the edges whose label holds carry a circulation of weight −1 (Farkas' lemma)."""
    flows = [Polynomial.variable(f"flow {number}") for number in range(len(graph.edges))]
    balance: dict[int, Polynomial[str]] = defaultdict(lambda: Polynomial({}))
    for edge, flow in zip(graph.edges, flows, strict=True):
        balance[edge.source] = balance[edge.source] - flow
        balance[edge.target] = balance[edge.target] + flow
        yield terms.at_least(flow)
        holds = propositions.environment(graph.vocabulary.decode(edge.label))
        yield terms.disjunction((holds, terms.at_least(-flow)))
    for total in balance.values():
        yield terms.equal(total)
    weighted = (flow.scaled(edge.weight) for edge, flow in zip(graph.edges, flows, strict=True))
    yield terms.equal(sum(weighted, Polynomial.constant(1)))


class _Search:
    """The theory, the network, and the conflicts found so far."""

    def __init__(self, network: Tpnu, theory: Theory, deadline: Deadline, solver: str) -> None:
        self.graph = distance_graph(network)
        self.terms = Terms()
        domains: Mapping[str, tuple[str, ...]] = {**theory.domains, **network.domains}
        self.propositions = Propositions(self.terms, domains)
        self.conflicts: list[Environment] = []
        self._known = set(network.domains)
        self._theory = theory
        self._deadline = deadline
        self._solver = solver

    def contracted(self, session: Session) -> DistanceGraph:
        """The network without those events that are easily eliminated.

        Conflicts that show on the way are noted, if the theory in the session leaves them open.
        """
        elimination = Elimination(self.graph, completions=False, deadline=self._deadline)
        elimination.contract(GROWTH)
        for _, label in elimination.conflicts:
            conflict = self._conflict(label)
            if conflict is not None and self._open(conflict, session):
                self._note(conflict, session)
        return replace(self.graph, edges=tuple(DistanceEdge(*edge, constraint=DERIVED) for edge in elimination.edges()))

    def _open(self, conflict: Environment, session: Session) -> bool:
        with session.frame(self.propositions.environment(self.graph.vocabulary.decode(conflict))):
            verdict = session.check("whether a conflict is possible", self._deadline)
        if verdict is Verdict.UNKNOWN:
            raise OutOfTimeError
        return verdict is Verdict.SATISFIABLE

    def _note(self, conflict: Environment, session: Session) -> None:
        self.conflicts.append(conflict)
        session.add(self.exclusion(conflict))

    def ask(self, further: Iterable[Formula]) -> Session:
        """A session for scenarios that satisfy the theory and something more."""
        session = Session(self.terms, solver=self._solver)
        session.add_all(self.propositions.axioms, self._deadline)
        session.add_all(map(self.propositions.formula, self._theory.constraints), self._deadline)
        session.add_all(map(self.propositions.excluded, self._theory.conflicts), self._deadline)
        session.add_all(further, self._deadline)
        return session

    def exhaust(self, session: Session) -> None:
        """Exclude from a session one conflict after the other, until it has no model or one that has a schedule."""
        while True:
            match session.check("a scenario without schedule", self._deadline):
                case Verdict.UNKNOWN:
                    raise OutOfTimeError
                case Verdict.UNSATISFIABLE:
                    return
                case Verdict.SATISFIABLE:
                    chosen = self.propositions.chosen(session)
            scenario = self.graph.vocabulary.encode(each for each in chosen if each.variable in self._known)
            conflict = self._conflict(scenario)
            if conflict is None:
                return
            self._note(conflict, session)

    def exclusion(self, conflict: Environment) -> Formula:
        return self.propositions.excluded(self.graph.vocabulary.decode(conflict))

    def _conflict(self, scenario: Environment) -> Environment | None:
        """A conflict that the scenario entails, generalised; None if what holds in it has a schedule."""
        edges = self.graph.active(scenario)
        found = earliest_times(len(self.graph.events), edges)
        return self._generalised(found.label, edges) if isinstance(found, Cycle) else None

    def _generalised(self, conflict: Environment, edges: list[DistanceEdge]) -> Environment:
        """As few of a conflict's assignments as one negative cycle needs, leaving out one after the other."""
        vocabulary, count = self.graph.vocabulary, len(self.graph.events)
        for variable in vocabulary.assigned(conflict):
            self._deadline.enforce()
            if not vocabulary.mentions(conflict, variable):
                continue
            weaker = vocabulary.without(conflict, variable)
            found = earliest_times(count, (edge for edge in edges if edge.label & weaker == edge.label))
            if isinstance(found, Cycle):
                conflict = found.label
        return conflict


def most_general(conflicts: Iterable[Environment]) -> list[Environment]:
    """The environments that entail no other, in the given order."""
    kept: list[Environment] = []
    for conflict in dict.fromkeys(conflicts):
        if not any(conflict & other == other for other in kept):
            kept = [other for other in kept if other & conflict != conflict]
            kept.append(conflict)
    return kept
