"""The network of nodes and justifications that encodes a theory [PIKE §5.3, Figure 14].

Assumptions are single assignments. A conjunction is a node with one justification, whose antecedents are its conjuncts;
a disjunction has one justification for each disjunct; the negation of an assignment is the disjunction of the other
values. Each conflict justifies a contradiction node of its own. Equal subformulas share a node.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from typing import assert_never

from robust.pike_bridge.knowledge.commitments import is_consistent
from robust.pike_bridge.knowledge.formulas import fold, normal_form
from robust.pike_bridge.model import Assignment, Guard
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory


class Kind(Enum):
    """What a node stands for."""

    ASSUMPTION = "assumption"
    DERIVED = "derived"
    CONTRADICTION = "contradiction"


@dataclass(frozen=True, slots=True)
class Node:
    """A proposition: that its formula holds. For a contradiction, the formula is what is contradictory."""

    index: int
    kind: Kind
    formula: Formula


@dataclass(frozen=True, slots=True)
class Justification:
    """The conjunction of the antecedents implies the consequent."""

    antecedents: tuple[int, ...]
    consequent: int


@dataclass(slots=True)
class Network:
    """Nodes, each after its antecedents, and their justifications."""

    theory: Theory
    nodes: list[Node] = field(default_factory=list)
    justifications: list[Justification] = field(default_factory=list)
    incoming: list[list[Justification]] = field(default_factory=list)
    """By node: those that it is the consequent of."""
    outgoing: list[list[Justification]] = field(default_factory=list)
    """By node: those that it is an antecedent of."""
    constraints: list[int] = field(default_factory=list)
    """The nodes of the theory's constraints, each once."""
    _known: dict[tuple[str, frozenset[int]], int] = field(default_factory=dict)
    _assumptions: dict[Assignment, int] = field(default_factory=dict)

    def assumption(self, assignment: Assignment) -> int:
        """The node of an assignment."""
        if assignment not in self._assumptions:
            self._assumptions[assignment] = self._node(Kind.ASSUMPTION, Is(assignment))
        return self._assumptions[assignment]

    def encode(self, formula: Formula) -> int:
        """The node of a formula, which holds if and only if the formula does."""
        return fold(normal_form(formula, self._literal), self._encode)

    def contradict(self, conflict: Guard) -> int:
        """A new contradiction node, justified by the conflict's assignments."""
        index = self._node(Kind.CONTRADICTION, All(tuple(Is(each) for each in sorted(conflict))))
        self._justify([self.assumption(each) for each in sorted(conflict)], index)
        return index

    def _literal(self, assignment: Assignment, positive: bool) -> Formula:
        if positive:
            return Is(assignment)
        variable, excluded = assignment
        others = [Is(Assignment(variable, value)) for value in self.theory.domains[variable] if value != excluded]
        return others[0] if len(others) == 1 else Some(tuple(others))

    def _encode(self, formula: Formula, parts: list[int]) -> int:
        match formula:
            case Is(assignment):
                return self.assumption(assignment)
            case All():
                return self._junction("all", formula, parts, [list(dict.fromkeys(parts))])
            case Some():
                return self._junction("some", formula, parts, [[part] for part in dict.fromkeys(parts)])
            case Not():
                raise ValueError(f"negation in normal form: {formula}")
            case _:
                assert_never(formula)

    def _junction(self, kind: str, formula: Formula, parts: list[int], tails: list[list[int]]) -> int:
        key = (kind, frozenset(parts))
        if len(key[1]) == 1:
            return parts[0]
        if key not in self._known:
            index = self._known[key] = self._node(Kind.DERIVED, formula)
            for tail in tails:
                self._justify(tail, index)
        return self._known[key]

    def _node(self, kind: Kind, formula: Formula) -> int:
        self.nodes.append(Node(len(self.nodes), kind, formula))
        self.incoming.append([])
        self.outgoing.append([])
        return len(self.nodes) - 1

    def _justify(self, antecedents: Iterable[int], consequent: int) -> None:
        justification = Justification(tuple(antecedents), consequent)
        self.justifications.append(justification)
        self.incoming[consequent].append(justification)
        for antecedent in justification.antecedents:
            self.outgoing[antecedent].append(justification)


def encode(theory: Theory) -> Network:
    """The nodes of a theory's constraints, and contradiction nodes of its conflicts.

    Conflicts that assign two values to a variable never hold, and get no node.
    """
    network = Network(theory)
    network.constraints = list(dict.fromkeys(network.encode(constraint) for constraint in theory.constraints))
    for conflict in dict.fromkeys(theory.conflicts):
        if is_consistent(conflict):
            network.contradict(conflict)
    return network
