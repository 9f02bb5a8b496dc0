"""Temporal conflicts without labeled shortest paths: only those that a theory leaves open, found by a solver.

A scenario has no schedule if and only if its constraints contain a negative cycle; by Farkas' lemma, if and only if
its edges carry a circulation of negative weight: flows λ ≥ 0, as much into each event as out of it, none on edges that
do not hold, and Σ λ·w = −1. So one question, over choices and flows at once, asks for a scenario that satisfies the
theory and has no schedule. Each answer gives a conflict [PIKE, Definition 4.1], which is generalised and excluded,
until there is none left: then every model of the theory that resolves the conflicts has a schedule [PIKE, Theorem 4.1].

Events with few constraints are eliminated beforehand, which leaves fewer flows. They still make the question expensive,
though only the last one needs them: as long as a model of the theory that a solver finds by itself has no schedule, it
gives a conflict, too.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace

from robust.pike_bridge.environment import Environment
from robust.pike_bridge.model import Guard, Tpnu
from robust.pike_bridge.temporal.distance_graph import DistanceGraph, Edge, distance_graph
from robust.pike_bridge.temporal.elimination import Elimination
from robust.pike_bridge.temporal.propositions import Propositions
from robust.pike_bridge.temporal.schedule import Cycle, earliest_times
from robust.pike_bridge.theory import Theory
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms

NO_LIMIT = Deadline()
GROWTH = 2
"""How many edges more than an event has may replace it: by measurement, that halves the time of the solver."""
DERIVED = -1
"""Stands for the constraint of an edge that follows from several."""


def temporal_conflicts(
    network: Tpnu, theory: Theory, deadline: Deadline = NO_LIMIT, *, solver: str = "z3"
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
        holds = propositions.guard(graph.vocabulary.decode(edge.label))
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
        for _, label in elimination.paths.conflicts.labels:
            conflict = self._conflict(label)
            if conflict is not None and self._open(conflict, session):
                self._note(conflict, session)
        return replace(self.graph, edges=tuple(Edge(*edge, constraint=DERIVED) for edge in elimination.edges()))

    def _open(self, conflict: Environment, session: Session) -> bool:
        with session.frame(self.propositions.guard(self.graph.vocabulary.decode(conflict))):
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
        session.add_all(self.propositions.domains, self._deadline)
        session.add_all(map(self.propositions.formula, self._theory.constraints), self._deadline)
        session.add_all(
            (self.terms.negation(self.propositions.guard(conflict)) for conflict in self._theory.conflicts),
            self._deadline,
        )
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
                    scenario = self._scenario(session)
            conflict = self._conflict(scenario)
            if conflict is None:
                return
            self._note(conflict, session)

    def exclusion(self, conflict: Environment) -> Formula:
        return self.terms.negation(self.propositions.guard(self.graph.vocabulary.decode(conflict)))

    def _scenario(self, session: Session) -> Environment:
        chosen = self.propositions.chosen(session)
        return self.graph.vocabulary.encode(each for each in chosen if each.variable in self._known)

    def _conflict(self, scenario: Environment) -> Environment | None:
        """A conflict that the scenario entails, generalised; None if what holds in it has a schedule."""
        edges = self.graph.active(scenario)
        found = earliest_times(len(self.graph.events), edges)
        return self._generalised(found.label, edges) if isinstance(found, Cycle) else None

    def _generalised(self, conflict: Environment, edges: list[Edge]) -> Environment:
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
