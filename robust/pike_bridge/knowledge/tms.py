"""The truth-maintenance systems: πTMS [PIKE §5] and ATMS.

Both label the nodes of the same network, and answer from the goal, which all constraints and conflicts justify.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any, ClassVar

from robust.pike_bridge.knowledge import interface
from robust.pike_bridge.knowledge.factors import FALSITY, Partial, could_hold, exclude, factors, require
from robust.pike_bridge.knowledge.goal import LARGEST_GOAL, compile_goal
from robust.pike_bridge.knowledge.labels import (
    Label,
    LabelConflict,
    conflict,
    count_models,
    environments,
    size,
    split,
    without_manifest,
)
from robust.pike_bridge.knowledge.network import Node, Resolve, TruthMaintenance, encode, simplify
from robust.pike_bridge.knowledge.sat import SatKnowledgeBase
from robust.pike_bridge.model import Assignment, Guard, Vocabulary, union
from robust.pike_bridge.theory import FALSE, Theory
from robust.smt.limits import NEVER, Deadline


@dataclass(frozen=True, slots=True)
class NodeLabel:
    """A node and its label, decoded."""

    node: Node
    environments: frozenset[Guard]


class LabelKnowledgeBase(interface.KnowledgeBase):
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
    resolve: Resolve
    """What conflicts do to labels."""

    def __init__(
        self,
        theory: Theory,
        *,
        shortcut: bool = True,
        solver: str = "z3",
        deadline: Deadline = NEVER,
        statistics: interface.KnowledgeStatistics | None = None,
        largest_label: int = interface.LARGEST_LABEL,
    ) -> None:
        super().__init__(theory, statistics)
        self._vocabulary = Vocabulary(theory.domains)
        self._largest_label = largest_label
        self._committed: tuple[LabelConflict, ...] = ()
        with self._compiling(deadline):
            possible = not shortcut or SatKnowledgeBase(theory, solver=solver, deadline=deadline).satisfiable(deadline)
            self.simplified = simplify(theory, deadline) if possible else Theory(theory.domains, (FALSE,))
            """The equivalent theory that was encoded."""
            self._propagate(self._effort(deadline))
            self._compile(deadline)
        self._measure()

    def commit(self, commitments: Sequence[interface.Commitment], deadline: Deadline = NEVER) -> None:
        deadline.enforce()
        asked = interface.narrowing(commitments, self.theory)
        self._narrow(asked, deadline)
        if asked.consistent:
            # Requiring a value is excluding the others [PIKE §5.7].
            domains = self.theory.domains
            others = [(name, each) for name, value in asked.required.items() for each in domains[name] if each != value]
            excluded = [*asked.conflicts, *(frozenset({Assignment(*each)}) for each in others)]
        else:
            excluded = [frozenset()]
        self._committed += tuple(map(self._conflict, excluded))
        self._measure()

    def labels(self, deadline: Deadline = NEVER) -> list[NodeLabel]:
        """The label of every node, after all conflicts, also those committed to.

        The nodes are those of `simplified`.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        effort = self._effort(deadline)
        found = []
        for node in self._maintenance.network.nodes:
            label = self._maintenance.label(node.index, effort)
            for each in self._committed:
                label = self.resolve(label, each, effort)
            found.append(NodeLabel(node, frozenset(self._decoded(label))))
        return found

    @abstractmethod
    def _compile(self, deadline: Deadline) -> None:
        """Find the goal."""

    @abstractmethod
    def _narrow(self, asked: interface.Narrowing, deadline: Deadline) -> None:
        """Find what is left of the goal."""

    @abstractmethod
    def _measure(self) -> None:
        """Note the size of the goal."""

    def _propagate(self, effort: interface.Effort) -> None:
        network = encode(self.simplified)
        sizes = self.statistics.sizes
        sizes |= {
            "nodes": len(network.nodes),
            "justifications": len(network.justifications),
            "conflicts": len(self.simplified.conflicts),
            "variables": len(self.theory.domains),
        }
        self._maintenance = TruthMaintenance(network, self._vocabulary, consensus=self.consensus, resolve=self.resolve)
        self._maintenance.run(effort)

    def _constraints(self) -> Iterator[Label]:
        """The labels of the goal's antecedents, which are its own only where nothing else has to hold."""
        return map(self._maintenance.own_label, self._maintenance.network.constraints)

    def _effort(self, deadline: Deadline) -> interface.Effort:
        return interface.Effort(self.statistics, deadline, self._largest_label)

    def _conflict(self, environment: Guard) -> LabelConflict:
        return conflict(self._vocabulary.encode(environment), self._vocabulary)

    def _decoded(self, label: Label) -> Iterator[Guard]:
        return map(self._vocabulary.decode, environments(label))


class Atms(LabelKnowledgeBase):
    """No environment of a label manifests a known conflict, but extensions of it may.

    So a query must look for an extension that resolves all conflicts, which the label alone does not tell.
    """

    name = "atms"
    consensus = False
    resolve = staticmethod(without_manifest)

    def goal(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """The environments of the goal's label, as products of those of its factors, one after the other.

        Raises:
            OutOfTimeError: if the deadline passes before all are listed.
        """
        for parts in product(*(tuple(environments(factor.label)) for factor in self._factors)):
            deadline.enforce()
            yield self._vocabulary.decode(sum(parts))

    def _compile(self, deadline: Deadline) -> None:
        conflicts = self._maintenance.conflicts()
        self._factors = factors(list(self._constraints()), conflicts, self._vocabulary, self._effort(deadline))

    def _narrow(self, asked: interface.Narrowing, deadline: Deadline) -> None:
        effort = self._effort(deadline)
        narrowed = [FALSITY]
        if asked.consistent:
            narrowed = require(self._factors, self._partial(asked.required), effort)
            for each in map(self._conflict, asked.conflicts):
                narrowed = exclude(narrowed, each, self._vocabulary, effort)
        self._factors = narrowed

    def _measure(self) -> None:
        self.statistics.sizes["factors"] = len(self._factors)
        self.statistics.sizes["environments"] = sum(size(factor.label) for factor in self._factors)

    def _possible(self, asked: interface.Narrowing, deadline: Deadline) -> bool:
        conflicts = list(map(self._conflict, asked.conflicts))
        return could_hold(self._factors, self._partial(asked.required), conflicts, deadline)

    def _count(self, deadline: Deadline) -> int:
        effort = self._effort(deadline)
        covered = union(factor.scope for factor in self._factors)
        field = self._vocabulary.field
        count = prod(len(values) for name, values in self.theory.domains.items() if not field(name) & covered)
        for factor in self._factors:
            label = factor.label
            for each in factor.conflicts:
                label = split(label, each, effort)
            count *= count_models(label, factor.scope, self._vocabulary, deadline)
        return count

    def _partial(self, required: Mapping[str, str]) -> Partial:
        """An environment; what variables without another value have goes without saying."""
        partial = Partial()
        for variable, value in required.items():
            if len(self.theory.domains[variable]) == 1:
                continue
            made = self._vocabulary.assign(variable, value) & self._vocabulary.made
            partial = partial.with_assignment(made, self._vocabulary.field(variable))
        return partial


class PiTms(LabelKnowledgeBase):
    """The knowledge base of [PIKE §5]: the goal's label holds the prime implicants of the theory, and no others.

    That label is kept as a decision diagram, those of all other nodes one environment after the other. Queries look for
    a model that extends some implicant, in the diagram of the function that these are the prime implicants of. After
    commitments the goal gets its new label as soon as somebody asks for it, from what is known of the last one.

    Args:
        largest_goal: how many nodes and results the diagrams may remember.
    """

    name = "pitms"
    consensus = True
    resolve = staticmethod(split)

    def __init__(self, theory: Theory, *, largest_goal: int = LARGEST_GOAL, **options: Any) -> None:
        self._largest_goal = largest_goal
        super().__init__(theory, **options)

    def prime_implicants(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """Every prime implicant of what is left of the theory, once; there may be very many.

        Raises:
            OutOfTimeError: if the deadline passes before all are listed.
        """
        return self._goal.prime_implicants(deadline)

    def implicant_count(self, deadline: Deadline = NEVER) -> int:
        """How many prime implicants what is left of the theory has.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        deadline.enforce()
        return self._goal.implicant_count(deadline)

    def _compile(self, deadline: Deadline) -> None:
        labels = [list(self._decoded(label)) for label in self._constraints()]
        conflicts = [self._vocabulary.decode(each.environment) for each in self._maintenance.conflicts()]
        self._goal = compile_goal(self.theory.domains, labels, conflicts, deadline, self._largest_goal)
        self.statistics.sizes["label nodes"] = len(self._goal.diagrams.functions.families)

    def _narrow(self, asked: interface.Narrowing, deadline: Deadline) -> None:
        self._goal = self._goal.narrowed(asked, deadline)

    def _measure(self) -> None:
        self.statistics.sizes["factors"] = len(self._goal.parts)
        self.statistics.sizes["diagram nodes"] = self._goal.size()

    def _possible(self, asked: interface.Narrowing, deadline: Deadline) -> bool:
        return self._goal.possible(asked, deadline)

    def _count(self, deadline: Deadline) -> int:
        return self._goal.count(deadline)
