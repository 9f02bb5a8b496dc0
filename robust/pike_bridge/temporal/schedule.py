"""Schedules of single scenarios: the earliest one, or the constraints that contradict each other.

In one scenario a plan with choices is a simple temporal network [PIKE, Definition 2.5], which has a schedule if and
only if its distance graph has no negative cycle [Dechter, Meiri and Pearl 1991].
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction

from robust.network.differences import Cycle, DifferenceNetwork
from robust.pike_bridge.knowledge.sat import Propositions, satisfiable
from robust.pike_bridge.model import Environment, Guard, Tpnu, entails, guard, union
from robust.pike_bridge.temporal.distance_graph import DistanceEdge, DistanceGraph, distance_graph
from robust.pike_bridge.temporal.labeled_apsp import LabeledElimination
from robust.pike_bridge.theory import Theory
from robust.plan.polynomial import Polynomial
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Session
from robust.smt.terms import Formula, Terms


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


def lower_bounds(count: int, edges: Iterable[DistanceEdge]) -> DifferenceNetwork:
    """The network of `count` events in which all the edges hold."""
    # Seen by its source, an edge is a lower bound: t(source) ≥ t(target) − weight.
    return DifferenceNetwork(count, ((edge.target, edge.source, -edge.weight) for edge in edges))


def _label(cycle: Cycle, edges: Sequence[DistanceEdge]) -> Environment:
    """The environment in which all the edges of a cycle hold."""
    return union(edges[origin].label for origin in cycle.origins)


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
    """That the edges whose label holds carry a circulation of weight −1 (Farkas' lemma)."""
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
        return replace(self.graph, edges=tuple(DistanceEdge(*edge, constraint=DERIVED) for edge in elimination.edges()))

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

    def _generalised(self, conflict: Environment, edges: list[DistanceEdge]) -> Environment:
        """As few of a conflict's assignments as one negative cycle needs, leaving out one after the other."""
        vocabulary, count = self.graph.vocabulary, len(self.graph.events)
        for variable in vocabulary.assigned(conflict):
            self._deadline.enforce()
            if not vocabulary.mentions(conflict, variable):
                continue
            weaker = vocabulary.without(conflict, variable)
            left = [edge for edge in edges if edge.label & weaker == edge.label]
            cycle = lower_bounds(count, left).cycle
            if cycle is not None:
                conflict = _label(cycle, left)
        return conflict


def most_general(conflicts: Iterable[Environment]) -> list[Environment]:
    """The environments that entail no other, in the given order."""
    kept: list[Environment] = []
    for conflict in dict.fromkeys(conflicts):
        if not any(conflict & other == other for other in kept):
            kept = [other for other in kept if other & conflict != conflict]
            kept.append(conflict)
    return kept
