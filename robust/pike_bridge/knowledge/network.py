"""From a theory to labels: a smaller theory, the network of nodes that encodes it, and propagation [PIKE §5.3 to §5.5].

What follows from single assignments is put into effect before anything is encoded. Values that cannot hold stay in the
domains, and become conflicts of one assignment: so models and prime implicants remain those of the given theory.

In the network [PIKE, Figure 14] assumptions are single assignments. A conjunction is a node with one justification,
whose antecedents are its conjuncts; a disjunction has one justification for each disjunct; the negation of an
assignment is the disjunction of the other values. Each conflict justifies a contradiction node of its own. Equal
subformulas share a node.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from heapq import heappop, heappush
from typing import TypeAlias, assert_never

from robust.pike_bridge.knowledge import labels
from robust.pike_bridge.knowledge.interface import Effort
from robust.pike_bridge.knowledge.labels import conflict
from robust.pike_bridge.model import Assignment, Guard, Vocabulary, union
from robust.pike_bridge.theory import (
    FALSE,
    TRUE,
    All,
    Formula,
    Is,
    Not,
    Some,
    Theory,
    assignments_of,
    fold,
    is_consistent,
    normal_form,
)
from robust.smt.limits import Deadline


def simplify(theory: Theory, deadline: Deadline) -> Theory:
    """An equivalent theory over the same domains, by unit propagation to a fixed point.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    reduction = _Reduction({variable: set(values) for variable, values in theory.domains.items()})
    possible = reduction.possible
    constraints: list[Formula] = list(theory.constraints)
    conflicts = [each for each in dict.fromkeys(theory.conflicts) if is_consistent(each)]
    before = -1
    while before != (left := sum(map(len, possible.values()))):
        before = left
        deadline.enforce()
        constraints = list(_top_level(normal_form(each, reduction.literal) for each in constraints))
        conflicts = list(reduction.conflicts(conflicts))
        constraints = reduction.learn(constraints, conflicts)
        if not all(possible.values()) or FALSE in constraints or frozenset() in conflicts:
            return Theory(theory.domains, (FALSE,))
    removed = [
        frozenset({Assignment(variable, value)})
        for variable, values in theory.domains.items()
        for value in values
        if value not in possible[variable]
    ]
    return Theory(theory.domains, tuple(constraints), (*removed, *dict.fromkeys(conflicts)))


@dataclass(slots=True)
class _Reduction:
    possible: dict[str, set[str]]

    def conflicts(self, conflicts: Iterable[Guard]) -> Iterator[Guard]:
        """Those that are not resolved, without assignments that hold anyway."""
        for environment in conflicts:
            if all(value in self.possible[variable] for variable, value in environment):
                yield frozenset(each for each in environment if len(self.possible[each.variable]) > 1)

    def learn(self, constraints: Iterable[Formula], conflicts: Iterable[Guard]) -> list[Formula]:
        """Remove the values that a single constraint or conflict excludes; the constraints that say more than that."""
        for environment in conflicts:
            if len(environment) == 1:
                ((variable, value),) = environment
                self.possible[variable].discard(value)
        return [constraint for constraint in constraints if not self._restricts(constraint)]

    def _restricts(self, constraint: Formula) -> bool:
        """If a constraint is about one variable alone, as a disjunction of literals, only those values are left."""
        literals = constraint.operands if isinstance(constraint, Some) else (constraint,)
        allowed: set[str] = set()
        variable: str | None = None
        for literal in literals:
            match literal:
                case Is(assignment):
                    values = {assignment.value}
                case Not(Is(assignment)):
                    values = self.possible[assignment.variable] - {assignment.value}
                case _:
                    return False
            if variable not in {None, assignment.variable}:
                return False
            variable = assignment.variable
            allowed |= values
        if variable is None:
            return False
        self.possible[variable] &= allowed
        return True

    def literal(self, assignment: Assignment, positive: bool) -> Formula:
        """What is known of an assignment or its negation."""
        values = self.possible[assignment.variable]
        if assignment.value not in values:
            return FALSE if positive else TRUE
        if len(values) == 1:
            return TRUE if positive else FALSE
        return Is(assignment) if positive else Not(Is(assignment))


def _top_level(constraints: Iterable[Formula]) -> Iterator[Formula]:
    for constraint in constraints:
        yield from constraint.operands if isinstance(constraint, All) else (constraint,)


class NodeKind(Enum):
    """What a node stands for."""

    ASSUMPTION = "assumption"
    DERIVED = "derived"
    CONTRADICTION = "contradiction"


@dataclass(frozen=True, slots=True)
class Node:
    """A proposition: that its formula holds. For a contradiction, the formula is what is contradictory."""

    index: int
    kind: NodeKind
    formula: Formula


@dataclass(frozen=True, slots=True)
class Justification:
    """The conjunction of the antecedents implies the consequent."""

    antecedents: tuple[int, ...]
    consequent: int


@dataclass(slots=True)
class JustificationNetwork:
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
            self._assumptions[assignment] = self._node(NodeKind.ASSUMPTION, Is(assignment))
        return self._assumptions[assignment]

    def encode(self, formula: Formula) -> int:
        """The node of a formula, which holds if and only if the formula does."""
        return fold(normal_form(formula, self._literal), self._encode)

    def contradict(self, conflict: Guard) -> int:
        """A new contradiction node, justified by the conflict's assignments."""
        index = self._node(NodeKind.CONTRADICTION, All(tuple(Is(each) for each in sorted(conflict))))
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
            index = self._known[key] = self._node(NodeKind.DERIVED, formula)
            for tail in tails:
                self._justify(tail, index)
        return self._known[key]

    def _node(self, kind: NodeKind, formula: Formula) -> int:
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


def encode(theory: Theory) -> JustificationNetwork:
    """The nodes of a theory's constraints, and contradiction nodes of its conflicts.

    Conflicts that assign two values to a variable never hold, and get no node.
    """
    network = JustificationNetwork(theory)
    network.constraints = list(dict.fromkeys(network.encode(constraint) for constraint in theory.constraints))
    for forbidden in dict.fromkeys(theory.conflicts):
        if is_consistent(forbidden):
            network.contradict(forbidden)
    return network


Resolve: TypeAlias = Callable[[labels.Label, labels.LabelConflict, Effort], labels.Label]
"""What a conflict does to a label: :func:`split` for the πTMS, :func:`without_manifest` for the ATMS."""


class TruthMaintenance:
    """Labels of the nodes of one network.

    Args:
        consensus: whether labels are closed under consensus (πTMS) or only minimal (ATMS).
        resolve: what conflicts do to labels.
    """

    def __init__(
        self, network: JustificationNetwork, vocabulary: Vocabulary, *, consensus: bool, resolve: Resolve
    ) -> None:
        self.network = network
        self.vocabulary = vocabulary
        self.nogoods: labels.Label = {}
        """The minimal environments that hold no more, as the label of falsity."""
        self._consensus = consensus
        self._resolve = resolve
        self._fields = tuple(vocabulary.field(variable) for variable in vocabulary.variables)
        self._labels: list[labels.Label] = []
        self._queue: list[int] = []
        self._pending: dict[int, list[labels.Label]] = {}

    def run(self, effort: Effort) -> None:
        """Propagate every assumption, and what needs no assumptions.

        Raises:
            OutOfTimeError: if the deadline passes; labels are incomplete then.
        """
        self._labels = [{} for _ in self.network.nodes]
        for node in self.network.nodes:
            if node.kind is NodeKind.ASSUMPTION:
                self._enqueue(node.index, self._assumed(node.index))
        for justification in self.network.justifications:
            if not justification.antecedents:
                self._enqueue(justification.consequent, labels.true_label())
        self._work_off(effort)

    def own_label(self, node: int) -> labels.Label:
        """The label of a node as its justifications give it, before conflicts are resolved."""
        return self._labels[node]

    def label(self, node: int, effort: Effort) -> labels.Label:
        """The label of a node: all prime implicants of its formula and all conflicts [PIKE, Invariant 5.2].

        Without consensus, minimal environments that manifest no conflict.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        label = self._labels[node]
        for each in self.conflicts():
            label = self._resolve(label, each, effort)
        return label

    def conflicts(self) -> list[labels.LabelConflict]:
        """The nogoods."""
        return [conflict(environment, self.vocabulary) for members in self.nogoods.values() for environment in members]

    def _assumed(self, node: int) -> labels.Label:
        """The environment of the assignment; the empty one if the variable has no other value."""
        ((variable, value),) = assignments_of(self.network.nodes[node].formula)
        if len(self.vocabulary.domains[variable]) == 1:
            return labels.true_label()
        return {self.vocabulary.field(variable): {self.vocabulary.assign(variable, value) & self.vocabulary.made}}

    def _enqueue(self, node: int, added: labels.Label) -> None:
        if added:
            if node not in self._pending:
                heappush(self._queue, node)
            self._pending.setdefault(node, []).append(added)

    def _work_off(self, effort: Effort) -> None:
        while self._queue:
            effort.deadline.enforce()
            node = heappop(self._queue)
            for new in self._pending.pop(node):
                self._update(node, new, effort)

    def _update(self, node: int, new: labels.Label, effort: Effort) -> None:
        """UPDATE [PIKE, Algorithm 6]."""
        effort.statistics.propagations += 1
        if self.network.nodes[node].kind is NodeKind.CONTRADICTION:
            labels.add_minimally(self._labels[node], new, effort)
            for scope, members in new.items():
                for environment in members:
                    labels.insert(self.nogoods, environment, scope)
            return
        label = self._labels[node]
        if self._consensus and len(self.network.incoming[node]) > 1:
            mentioned = union(label) | union(new)
            fields = [field for field in self._fields if field & mentioned]
            added = labels.add_and_generate_prime_implicants(label, new, fields, effort)
        else:
            added = labels.add_minimally(label, new, effort)
        for justification in self.network.outgoing[node]:
            self._enqueue(justification.consequent, self._propagate(justification, node, added, effort))

    def _propagate(
        self, justification: Justification, source: int, added: labels.Label, effort: Effort
    ) -> labels.Label:
        """PROPAGATE: what new environments of one antecedent mean for the consequent."""
        result = added
        for antecedent in justification.antecedents:
            if antecedent != source and result:
                result = labels.weave(result, self._labels[antecedent], effort)
        return result
