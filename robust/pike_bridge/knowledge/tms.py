"""The truth-maintenance systems: πTMS [PIKE §5] and ATMS.

Both label the nodes of the same network, and answer from the goal, which all constraints and conflicts justify. The
goal of the πTMS is a decision diagram. The goal of the ATMS is a product of independent factors, and all conflicts:
constraints and conflicts that share no variables, not even through others, have labels of their own. Within a factor,
labels are joined two at a time, such that the estimated result is the smallest, and environments that manifest a
conflict are dropped as soon as a label mentions all of its variables. An environment that entails a label may still
manifest a conflict, so queries look for environments that resolve all conflicts.
"""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count, product
from math import log2
from typing import Any, ClassVar, NamedTuple

from robust.pike_bridge import theory as logic
from robust.pike_bridge.knowledge import labels as labeling
from robust.pike_bridge.knowledge import sat
from robust.pike_bridge.knowledge.goal import LARGEST_GOAL, Goal, compile_goal
from robust.pike_bridge.model import Assignment, AssignmentVocabulary, Environment, Guard, bits, guard, union
from robust.pike_bridge.theory import FALSE, Effort, Theory, connected
from robust.smt.limits import NEVER, Deadline


@dataclass(frozen=True, slots=True)
class LabelFactor:
    """The label of independent constraints and conflicts."""

    scope: labeling.Scope
    """All variables of the constraints and conflicts."""
    label: labeling.Label
    conflicts: tuple[labeling.LabelConflict, ...] = ()
    """Those that an environment of the label may not have resolved."""


FALSITY = LabelFactor(0, {})


def factors(
    labels: Sequence[labeling.Label],
    conflicts: Sequence[labeling.LabelConflict],
    vocabulary: AssignmentVocabulary,
    effort: Effort,
) -> list[LabelFactor]:
    """The goal's label, from those of all constraints, and all conflicts.

    Raises:
        OutOfTimeError: if the deadline passes; the statistics then say how large the labels were.
    """
    parts = [(union(label), label) for label in labels if 0 not in label]
    independent: list[LabelFactor] = []
    scopes = [scope for scope, _ in parts] + [conflict.scope for conflict in conflicts]
    for scope in dict.fromkeys(map(union, connected(scopes, lambda scope: frozenset(bits(scope))))):
        own = tuple(conflict for conflict in conflicts if _touch(conflict.scope, scope))
        touching = [label for each, label in parts if _touch(each, scope)]
        independent.append(LabelFactor(scope, _joined(touching, own, vocabulary, effort), own))
    return independent


def _touch(first: labeling.Scope, second: labeling.Scope) -> bool:
    """Whether scopes share variables; falsity, which has none, is apart from everything else."""
    return bool(first & second) or first == second


def _joined(
    labels: Sequence[labeling.Label],
    conflicts: Iterable[labeling.LabelConflict],
    vocabulary: AssignmentVocabulary,
    effort: logic.Effort,
) -> labeling.Label:
    """The conjunction of labels, two at a time, such that the estimated result is the smallest.

    What manifests a conflict is dropped as soon as a label mentions all of its variables.
    """
    weights = {vocabulary.field(name): log2(len(values)) for name, values in vocabulary.domains.items()}
    sizes = effort.statistics.sizes
    parts: dict[int, tuple[labeling.Label, labeling.Scope]] = {}
    pairs: list[tuple[float, int, int]] = []
    waiting, numbers = list(conflicts), count()

    def noted(label: labeling.Label) -> labeling.Label:
        sizes["largest label"] = max(sizes.get("largest label", 0), labeling.size(label))
        return label

    def put(label: labeling.Label) -> None:
        scope = union(label)
        for known in [each for each in waiting if each.scope & scope == each.scope]:
            waiting.remove(known)
            label = noted(labeling.without_manifest(label, known, effort))
        scope, number = union(label), next(numbers)
        for other, (partner, partner_scope) in parts.items():
            agreement = sum(weight for field, weight in weights.items() if field & scope & partner_scope)
            size = log2(labeling.size(label)) + log2(labeling.size(partner)) if label and partner else agreement
            heappush(pairs, (size - agreement, number, other))
        parts[number] = label, scope

    for label in labels:
        put(label)
    while len(parts) > 1 and all(label for label, _ in parts.values()):
        _, first, second = heappop(pairs)
        if first in parts and second in parts:
            one, other = noted(parts.pop(first)[0]), noted(parts.pop(second)[0])
            put(labeling.weave(one, other, effort))
    remaining = [label for label, _ in parts.values()]
    return next(iter(remaining), labeling.true_label()) if all(remaining) else {}


class Partial(NamedTuple):
    """A consistent environment, with the scope of the variables that it assigns."""

    environment: Environment = 0
    scope: labeling.Scope = 0


def could_hold(
    factors: Sequence[LabelFactor], asked: Partial, conflicts: Sequence[labeling.LabelConflict], deadline: Deadline
) -> bool:
    """Whether a model extends an environment and resolves all conflicts.

    Without conflicts, each factor's label must have an environment that is consistent with what is asked. With several
    it is not enough that such an environment manifests none: they may be resolved by different values of one variable.
    So each gets an assignment that resolves it, in turn.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    mentioned = asked.scope | union(conflict.scope for conflict in conflicts)
    relevant = [factor for factor in factors if factor.scope & mentioned]
    return all(factor.scope & mentioned or allows(factor, Partial(), deadline) for factor in factors) and any(
        all(allows(each, resolved, deadline) for each in relevant)
        for resolved in resolutions(asked, conflicts, deadline, relevant)
    )


def resolutions(
    asked: Partial, conflicts: Sequence[labeling.LabelConflict], deadline: Deadline, factors: Sequence[LabelFactor] = ()
) -> Iterator[Partial]:
    """Environments that resolve all conflicts and entail the one asked; each model that does extends one of them.

    What contradicts a factor is not pursued.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    stack = [(asked, 0)]
    while stack:
        deadline.enforce()
        current, done = stack.pop()
        while done < len(conflicts) and resolves(current, conflicts[done]):
            done += 1
        if done == len(conflicts):
            yield current
        elif all(allows(factor, current, deadline) for factor in factors):
            for field, values in reversed(conflicts[done].resolutions):
                if not field & current.scope:
                    more = (Partial(current.environment | value, current.scope | field) for value in reversed(values))
                    stack.extend((extended, done + 1) for extended in more)


def resolves(partial: Partial, conflict: labeling.LabelConflict) -> bool:
    """Whether some variable has another value than in the conflict."""
    shared = partial.scope & conflict.scope
    return partial.environment & shared != conflict.environment & shared


def allows(factor: LabelFactor, asked: Partial, deadline: Deadline) -> bool:
    """Whether a factor has a model that extends what is asked: its label, and the resolution of its conflicts.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    consistent = labeling.consistent_with(factor.label, asked.environment, asked.scope)
    extended = (Partial(one | asked.environment, scope | asked.scope) for one, scope in consistent)
    return any(True for both in extended for _ in resolutions(both, factor.conflicts, deadline))


@dataclass(frozen=True, slots=True)
class NodeLabel:
    """A node and its label, decoded."""

    node: labeling.Node
    environments: frozenset[Guard]


class LabelKnowledgeBase(logic.KnowledgeBase):
    """What the πTMS and the ATMS have in common: the encoding, and propagation to the nodes of all constraints.

    Args:
        theory: what is compiled.
        shortcut: whether a solver is asked first if there is any model; without one, nothing is compiled.
        solver: `z3` or `cvc5`, for the shortcut.
        deadline: for compiling.
        statistics: counters to add to; they tell what was reached if compiling ends early.
        largest_label: the number of environments that no label may exceed.

    Raises:
        InputError: if the theory mentions an unknown variable or value, or a variable without values.
        OutOfTimeError: if the deadline passes, or a label gets too large.
    """

    consensus: ClassVar[bool]
    """Whether labels are closed under consensus, so that what resolves a conflict does so for good."""
    simplifying: ClassVar[bool] = True
    """Whether what follows from single assignments is put into effect before the theory is encoded."""
    resolve: labeling.Resolve
    """What conflicts do to labels."""

    def __init__(
        self,
        theory: Theory,
        *,
        shortcut: bool = True,
        solver: str = "z3",
        deadline: Deadline = NEVER,
        statistics: logic.KnowledgeStatistics | None = None,
        largest_label: int = logic.LARGEST_LABEL,
    ) -> None:
        super().__init__(theory, statistics)
        self._vocabulary = AssignmentVocabulary(theory.domains)
        self._largest_label = largest_label
        self._committed: tuple[labeling.LabelConflict, ...] = ()
        with self._compiling(deadline):
            possible = not shortcut or sat.SatKnowledgeBase(theory, solver=solver, deadline=deadline).satisfiable(
                deadline
            )
            simplified = labeling.simplify(theory, deadline) if self.simplifying else theory
            self.encoded = simplified if possible else Theory(theory.domains, (FALSE,))
            """The equivalent theory that the nodes are those of."""
            network = labeling.encode(self.encoded)
            self.statistics.sizes |= {
                "nodes": len(network.nodes),
                "justifications": sum(map(len, network.justifications)),
                "conflicts": len(self.encoded.conflicts),
                "variables": len(theory.domains),
            }
            self._maintenance = self._maintaining(network)
            self._maintenance.run(self._effort(deadline))
            self._compile(deadline)
        self._measure()

    def _narrow(self, asked: logic.Narrowing, deadline: Deadline) -> None:
        excluded: list[Guard] = [frozenset()]
        if asked.consistent:
            # Requiring a value is excluding the others [PIKE §5.7].
            domains = self.theory.domains
            others = [(name, each) for name, value in asked.required.items() for each in domains[name] if each != value]
            excluded = [*asked.conflicts, *(frozenset({Assignment(*each)}) for each in others)]
        self._narrow_goal(asked, excluded, deadline)
        self._committed += tuple(map(self._conflict, excluded))
        self._measure()

    def labels(self, deadline: Deadline = NEVER) -> list[NodeLabel]:
        """The label of every node, after all conflicts, also those committed to.

        The nodes are those of `encoded`.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        effort = self._effort(deadline)
        node_labels = []
        for node in self._maintenance.network.nodes:
            label = self._maintenance.label(node.index, effort)
            for each in self._committed:
                label = self.resolve(label, each, effort)
            node_labels.append(NodeLabel(node, frozenset(self._decoded(label))))
        return node_labels

    @abstractmethod
    def _compile(self, deadline: Deadline) -> None:
        """Find the goal."""

    @abstractmethod
    def _narrow_goal(self, asked: logic.Narrowing, excluded: list[Guard], deadline: Deadline) -> None:
        """Find what is left of the goal: what is asked, which comes to the environments that are excluded."""

    @abstractmethod
    def _measure(self) -> None:
        """Note the size of the goal."""

    def _maintaining(self, network: labeling.JustificationNetwork) -> labeling.TruthMaintenance:
        return labeling.TruthMaintenance(network, self._vocabulary, consensus=self.consensus, resolve=self.resolve)

    def _constraints(self) -> Iterator[labeling.Label]:
        """The labels of the goal's antecedents, which are its own only where nothing else has to hold."""
        return (self._maintenance.labels[node] for node in self._maintenance.network.constraints)

    def _effort(self, deadline: Deadline) -> logic.Effort:
        return logic.Effort(self.statistics, deadline, self._largest_label)

    def _conflict(self, environment: Guard) -> labeling.LabelConflict:
        return labeling.conflict_of(self._vocabulary.encode(environment), self._vocabulary)

    def _decoded(self, label: labeling.Label) -> Iterator[Guard]:
        return map(self._vocabulary.decode, labeling.environments(label))

    def _partial(self, required: Mapping[str, str]) -> Partial:
        """An environment; what variables without another value have goes without saying."""
        partial = Partial()
        for variable, value in required.items():
            if len(self.theory.domains[variable]) == 1:
                continue
            made = self._vocabulary.assign(variable, value) & self._vocabulary.made
            partial = Partial(partial.environment | made, partial.scope | self._vocabulary.field(variable))
        return partial


class Atms(LabelKnowledgeBase):
    """No environment of a label manifests a known conflict, but extensions of it may.

    So a query must look for an extension that resolves all conflicts, which the label alone does not tell.
    """

    name = "atms"
    consensus = False
    resolve = staticmethod(labeling.without_manifest)

    def goal(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """The environments of the goal's label, as products of those of its factors, one after the other.

        Raises:
            OutOfTimeError: if the deadline passes before all are listed.
        """
        for parts in product(*(tuple(labeling.environments(factor.label)) for factor in self._factors)):
            deadline.enforce()
            yield self._vocabulary.decode(sum(parts))

    def _compile(self, deadline: Deadline) -> None:
        conflicts = self._maintenance.conflicts()
        self._factors = factors(list(self._constraints()), conflicts, self._vocabulary, self._effort(deadline))
        self._required: dict[str, str] = {}

    def _narrow_goal(self, asked: logic.Narrowing, excluded: list[Guard], deadline: Deadline) -> None:
        """Join what is committed to with the factors about the same variables.

        What is known to hold goes without saying in conflicts, which so join fewer factors.
        """
        known = {**self._required, **asked.required}
        whole = logic.narrowing([logic.Require(guard(known)), *map(logic.Exclude, asked.conflicts)], self.theory)
        narrowed = [FALSITY]
        if asked.consistent and whole.consistent:
            new = [self._partial({variable: value}) for variable, value in asked.required.items()]
            conflicts = list(map(self._conflict, whole.conflicts))
            scope = union([*(partial.scope for partial in new), *(conflict.scope for conflict in conflicts)])
            narrowed = [factor for factor in self._factors if not factor.scope & scope]
            together = [factor for factor in self._factors if factor.scope & scope]
            labels = [*(factor.label for factor in together), *({part.scope: {part.environment}} for part in new)]
            conflicts += (conflict for factor in together for conflict in factor.conflicts)
            narrowed += factors(labels, conflicts, self._vocabulary, self._effort(deadline))
        self._factors, self._required = narrowed, known

    def _measure(self) -> None:
        self.statistics.sizes["factors"] = len(self._factors)
        self.statistics.sizes["environments"] = sum(labeling.size(factor.label) for factor in self._factors)

    def _possible(self, asked: logic.Narrowing, deadline: Deadline) -> bool:
        conflicts = list(map(self._conflict, asked.conflicts))
        return could_hold(self._factors, self._partial(asked.required), conflicts, deadline)

    def _count(self, deadline: Deadline) -> int:
        """The number of solutions, by decision diagrams of what the labels and conflicts of all factors say."""
        labels = [list(self._decoded(factor.label)) for factor in self._factors]
        environments = (conflict.environment for factor in self._factors for conflict in factor.conflicts)
        conflicts = list(map(self._vocabulary.decode, environments))
        return compile_goal(self.theory.domains, labels, conflicts, deadline).count(deadline)


class PiTms(LabelKnowledgeBase):
    """The knowledge base of [PIKE §5]: the goal's label holds the prime implicants of the theory, and no others.

    That label is kept as a decision diagram, those of all other nodes one environment after the other. Queries look for
    a model that extends some implicant, in the diagram of the function that these are the prime implicants of. After
    commitments the goal gets its new label as soon as somebody asks for it, from what is known of the last one.

    Args:
        largest_goal: how many nodes and results the diagrams may remember.
    """

    goal: Goal
    """What is left of the theory."""
    name = "pitms"
    consensus = True
    resolve = staticmethod(labeling.split)

    def __init__(self, theory: Theory, *, largest_goal: int = LARGEST_GOAL, **options: Any) -> None:
        self._largest_goal = largest_goal
        super().__init__(theory, **options)

    def prime_implicants(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """Every prime implicant of what is left of the theory, once; there may be very many.

        Raises:
            OutOfTimeError: if the deadline passes before all are listed.
        """
        return self.goal.prime_implicants(deadline)

    def implicant_count(self, deadline: Deadline = NEVER) -> int:
        """How many prime implicants what is left of the theory has.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        deadline.enforce()
        return self.goal.implicant_count(deadline)

    def _compile(self, deadline: Deadline) -> None:
        labels = [list(self._decoded(label)) for label in self._constraints()]
        conflicts = [self._vocabulary.decode(conflict.environment) for conflict in self._maintenance.conflicts()]
        self.goal = compile_goal(self.theory.domains, labels, conflicts, deadline, self._largest_goal)
        self.goal.label(deadline)
        self.statistics.sizes["label nodes"] = len(self.goal.diagrams.functions.families)

    def _narrow_goal(self, asked: logic.Narrowing, excluded: list[Guard], deadline: Deadline) -> None:
        self.goal = self.goal.narrowed(asked, deadline)

    def _measure(self) -> None:
        self.statistics.sizes["factors"] = len(self.goal.parts)
        self.statistics.sizes["diagram nodes"] = self.goal.size()

    def _possible(self, asked: logic.Narrowing, deadline: Deadline) -> bool:
        return self.goal.possible(asked, deadline)

    def _count(self, deadline: Deadline) -> int:
        return self.goal.count(deadline)
