"""The label propagation of the πTMS as [PIKE §5.5 to §5.7] states it: every label is explicit, that of the goal, too.

Each justification is propagated when it is added, and again whenever the label of an antecedent grows: PROPAGATE and
WEAVE are those of the ATMS, UPDATE is that of Algorithm 6. New environments go into a label with all consensuses, and
only what was added goes on. A nogood splits the labels of all nodes. The goal is a node that all constraints justify;
its label lists every prime implicant of the theory, so that plans with many of them are beyond it. Those are for
:class:`~robust.pike_bridge.knowledge.tms.PiTms` with its diagrams, which this is held against.

One thing differs from the letter: an environment of the goal that manifests none of several conflicts is not enough for
CouldCommitToAdditionalConstraints?, because they may exclude all values of one variable. And nogoods come when nothing
waits to be propagated, so that nothing has to be split but labels, which the algorithm leaves open.
"""

from collections import deque
from collections.abc import Iterator
from typing import Final

from robust.pike_bridge import theory as logic
from robust.pike_bridge.knowledge import labels as labeling
from robust.pike_bridge.knowledge import tms
from robust.pike_bridge.knowledge.goal import compile_goal
from robust.pike_bridge.knowledge.labels import Label
from robust.pike_bridge.model import AssignmentVocabulary, Guard, union
from robust.pike_bridge.theory import Effort
from robust.smt.limits import NEVER, Deadline


class LabelPropagation(labeling.TruthMaintenance):
    """Labels that are updated as justifications and nogoods are added; the last one is that of the goal."""

    def __init__(self, network: labeling.JustificationNetwork, vocabulary: AssignmentVocabulary) -> None:
        super().__init__(network, vocabulary, consensus=True, resolve=labeling.split)
        self._goal: Final = len(network.nodes)
        self._consequences: list[list[tuple[tuple[int, ...], int]]] = []
        """By node, the justifications that it is an antecedent of: all antecedents, and the consequent."""
        self._waiting: deque[tuple[tuple[int, ...], int, int | None, Label]] = deque()
        """What is to be propagated: to a consequent, from one antecedent, what its label got."""

    @property
    def goal(self) -> Label:
        """All prime implicants of the constraints and nogoods so far."""
        return self.labels[self._goal]

    def run(self, effort: Effort) -> None:
        """Add the justifications of all nodes, then those of the goal, then those of contradictions.

        Raises:
            OutOfTimeError: if the deadline passes; labels are incomplete then.
        """
        self.labels = [{} for _ in range(self._goal + 1)]
        self._consequences = [[] for _ in self.labels]
        justified = list(zip(self.network.nodes, self.network.justifications, strict=True))
        for node, justifications in justified:
            if node.kind is labeling.NodeKind.ASSUMPTION:
                self._update(node.index, self._assumed(node.index), effort)
            elif node.kind is labeling.NodeKind.DERIVED:
                for antecedents in justifications:
                    self._justify(antecedents, node.index, effort)
        self._justify(tuple(self.network.constraints), self._goal, effort)
        for node, justifications in justified:
            if node.kind is labeling.NodeKind.CONTRADICTION:
                for antecedents in justifications:
                    self._justify(antecedents, node.index, effort)

    def label(self, node: int, effort: Effort) -> Label:
        """The label of a node, which is up to date."""
        return self.labels[node]

    def contradict(self, conflict: Label, effort: Effort) -> None:
        """Justify a contradiction by a conflict.

        Raises:
            OutOfTimeError: if the deadline passes; nothing has changed then.
        """
        before = list(self.labels), {scope: set(members) for scope, members in self.nogoods.items()}
        try:
            self._exclude(conflict, effort)
        except BaseException:
            self.labels, self.nogoods = before
            raise

    def _justify(self, antecedents: tuple[int, ...], consequent: int, effort: Effort) -> None:
        for antecedent in dict.fromkeys(antecedents):
            self._consequences[antecedent].append((antecedents, consequent))
        self._waiting.append((antecedents, consequent, None, labeling.true_label()))
        while self._waiting:  # PROPAGATE and WEAVE
            antecedents, consequent, source, new = self._waiting.popleft()
            for antecedent in dict.fromkeys(antecedents):
                if antecedent != source and new:
                    new = labeling.weave(new, self.labels[antecedent], effort)
            self._update(consequent, new, effort)

    def _update(self, node: int, new: Label, effort: Effort) -> None:
        """UPDATE [PIKE, Algorithm 6]."""
        if not new:
            return
        effort.statistics.propagations += 1
        if node < self._goal and self.network.nodes[node].kind is labeling.NodeKind.CONTRADICTION:
            self._exclude(new, effort)
            return
        label = self.labels[node]
        added = labeling.add_and_generate_prime_implicants(label, new, self._fields, effort)
        effort.hold(labeling.size(label))
        for antecedents, consequent in self._consequences[node] if added else ():
            self._waiting.append((antecedents, consequent, node, added))

    def _exclude(self, new: Label, effort: Effort) -> None:
        """Add nogoods, and split everything on those that were not known: SPLITALLLABELSONCONFLICT."""
        for environment in labeling.environments(labeling.add_minimally(self.nogoods, new, effort)):
            conflict = labeling.conflict_of(environment, self.vocabulary)
            self.labels = [labeling.split(label, conflict, effort) for label in self.labels]


class PropagatedLabels(tms.LabelKnowledgeBase):
    """The πTMS as the paper has it, with the explicit label of its goal [PIKE §5.7]."""

    name = "pitms-labels"
    consensus = True
    simplifying = False
    resolve = staticmethod(labeling.split)
    _maintenance: LabelPropagation

    def prime_implicants(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """Every prime implicant of what is left of the theory, once.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        deadline.enforce()
        return self._decoded(self._maintenance.goal)

    def implicant_count(self, deadline: Deadline = NEVER) -> int:
        """How many prime implicants what is left of the theory has.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        deadline.enforce()
        return labeling.size(self._maintenance.goal)

    def _maintaining(self, network: labeling.JustificationNetwork) -> LabelPropagation:
        return LabelPropagation(network, self._vocabulary)

    def _compile(self, deadline: Deadline) -> None:
        """The label of the goal is there."""

    def _narrow_goal(self, asked: logic.Narrowing, excluded: list[Guard], deadline: Deadline) -> None:
        effort = self._effort(deadline)
        for environment in map(self._partial, map(dict, excluded)):
            self._maintenance.contradict({environment.scope: {environment.environment}}, effort)

    def _measure(self) -> None:
        self.statistics.sizes["environments"] = labeling.size(self._maintenance.goal)

    def _possible(self, asked: logic.Narrowing, deadline: Deadline) -> bool:
        goal = self._maintenance.goal
        conflicts = list(map(self._conflict, asked.conflicts))
        return tms.could_hold([tms.LabelFactor(union(goal), goal)], self._partial(asked.required), conflicts, deadline)

    def _count(self, deadline: Deadline) -> int:
        return compile_goal(self.theory.domains, [list(self._decoded(self._maintenance.goal))], (), deadline).count(
            deadline
        )
