"""Label propagation: from assumptions through justifications to every node [PIKE §5.6, Algorithms 6 and 7].

Updates wait in a queue ordered by node, antecedents first, so that a node is woven with whole labels and not with one
environment after the other. Consensus is sought only where it can find something: at nodes with several justifications.
A conjunction of labels that have all prime implicants has them, too (see :func:`weave`), and so has a split one.

Conflicts are kept as nogoods, and a node's label is split on them when it is asked for, not before: inner labels that
resolve every conflict of the theory would be products of the node with all of them, and the goal needs them only once.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from typing import TypeAlias

from robust.pike_bridge.environment import Vocabulary
from robust.pike_bridge.knowledge.formulas import assignments_of
from robust.pike_bridge.knowledge.labels import (
    Conflict,
    Label,
    add_and_generate_prime_implicants,
    add_minimally,
    conflict,
    insert,
    scope_of,
    true_label,
    weave,
)
from robust.pike_bridge.knowledge.nodes import Justification, Kind, Network
from robust.pike_bridge.knowledge.space import Effort

Resolve: TypeAlias = Callable[[Label, Conflict, Effort], Label]
"""What a conflict does to a label: :func:`split` for the πTMS, :func:`without_manifest` for the ATMS."""


class TruthMaintenance:
    """Labels of the nodes of one network.

    Args:
        consensus: whether labels are closed under consensus (πTMS) or only minimal (ATMS).
        resolve: what conflicts do to labels.
    """

    def __init__(self, network: Network, vocabulary: Vocabulary, *, consensus: bool, resolve: Resolve) -> None:
        self.network = network
        self.vocabulary = vocabulary
        self.nogoods: Label = {}
        """The minimal environments that hold no more, as the label of falsity."""
        self._consensus = consensus
        self._resolve = resolve
        self._fields = tuple(vocabulary.field(variable) for variable in vocabulary.variables)
        self._labels: list[Label] = []
        self._queue: list[int] = []
        self._pending: dict[int, list[Label]] = {}

    def run(self, effort: Effort) -> None:
        """Propagate every assumption, and what needs no assumptions.

        Raises:
            OutOfTimeError: if the deadline passes; labels are incomplete then.
        """
        self._labels = [{} for _ in self.network.nodes]
        for node in self.network.nodes:
            if node.kind is Kind.ASSUMPTION:
                self._enqueue(node.index, self._assumed(node.index))
        for justification in self.network.justifications:
            if not justification.antecedents:
                self._enqueue(justification.consequent, true_label())
        self._work_off(effort)

    def own_label(self, node: int) -> Label:
        """The label of a node as its justifications give it, before conflicts are resolved."""
        return self._labels[node]

    def label(self, node: int, effort: Effort) -> Label:
        """The label of a node: all prime implicants of its formula and all conflicts [PIKE, Invariant 5.2].

        Without consensus, minimal environments that manifest no conflict.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        label = self._labels[node]
        for each in self.conflicts():
            label = self._resolve(label, each, effort)
        return label

    def conflicts(self) -> list[Conflict]:
        """The nogoods."""
        return [conflict(environment, self.vocabulary) for members in self.nogoods.values() for environment in members]

    def _assumed(self, node: int) -> Label:
        """The environment of the assignment; the empty one if the variable has no other value."""
        ((variable, value),) = assignments_of(self.network.nodes[node].formula)
        if len(self.vocabulary.domains[variable]) == 1:
            return true_label()
        return {self.vocabulary.field(variable): {self.vocabulary.assign(variable, value) & self.vocabulary.made}}

    def _enqueue(self, node: int, added: Label) -> None:
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

    def _update(self, node: int, new: Label, effort: Effort) -> None:
        """UPDATE [PIKE, Algorithm 6]."""
        effort.statistics.propagations += 1
        if self.network.nodes[node].kind is Kind.CONTRADICTION:
            add_minimally(self._labels[node], new, effort)
            for scope, members in new.items():
                for environment in members:
                    insert(self.nogoods, environment, scope)
            return
        label = self._labels[node]
        if self._consensus and len(self.network.incoming[node]) > 1:
            mentioned = scope_of(label) | scope_of(new)
            fields = [field for field in self._fields if field & mentioned]
            added = add_and_generate_prime_implicants(label, new, fields, effort)
        else:
            added = add_minimally(label, new, effort)
        for justification in self.network.outgoing[node]:
            self._enqueue(justification.consequent, self._propagate(justification, node, added, effort))

    def _propagate(self, justification: Justification, source: int, added: Label, effort: Effort) -> Label:
        """PROPAGATE: what new environments of one antecedent mean for the consequent."""
        result = added
        for antecedent in justification.antecedents:
            if antecedent != source and result:
                result = weave(result, self._labels[antecedent], effort)
        return result
