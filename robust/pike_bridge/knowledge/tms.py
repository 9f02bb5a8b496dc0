"""Knowledge bases whose answers come from the label of a truth-maintenance system's goal node [PIKE §5.7]."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

from robust.pike_bridge.environment import Vocabulary
from robust.pike_bridge.knowledge.commitments import Narrowing, narrowing
from robust.pike_bridge.knowledge.counting import count_models, models
from robust.pike_bridge.knowledge.formulas import FALSE, check_assignments, check_theory
from robust.pike_bridge.knowledge.goal import FALSITY, Factor, Joining, factors
from robust.pike_bridge.knowledge.interface import Commitment, KnowledgeBase, KnowledgeStatistics
from robust.pike_bridge.knowledge.labels import Conflict, Label, Scope, conflict, environments, size, split
from robust.pike_bridge.knowledge.nodes import Node, encode
from robust.pike_bridge.knowledge.propagation import TruthMaintenance
from robust.pike_bridge.knowledge.queries import Partial, allowing, could_hold, exclude, find_model, require
from robust.pike_bridge.knowledge.sat import SatKnowledgeBase
from robust.pike_bridge.knowledge.simplify import simplify
from robust.pike_bridge.knowledge.space import LARGEST_LABEL, Effort
from robust.pike_bridge.model import Assignment, Guard
from robust.pike_bridge.theory import Theory
from robust.smt.limits import Deadline

NEVER = Deadline()


@dataclass(frozen=True, slots=True)
class NodeLabel:
    """A node and its label, decoded."""

    node: Node
    environments: frozenset[Guard]


class LabelKnowledgeBase(KnowledgeBase):
    """What the πTMS and the ATMS have in common: the encoding, propagation and the factored goal.

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

    consensus: bool

    def __init__(
        self,
        theory: Theory,
        *,
        shortcut: bool = True,
        solver: str = "z3",
        deadline: Deadline = NEVER,
        statistics: KnowledgeStatistics | None = None,
        largest_label: int = LARGEST_LABEL,
    ) -> None:
        check_theory(theory)
        self.theory = theory
        self.statistics = statistics or KnowledgeStatistics()
        self._vocabulary = Vocabulary(theory.domains)
        self._largest_label = largest_label
        self._joining = self._create_joining()
        self._committed: tuple[Conflict, ...] = ()
        started = time.perf_counter()
        try:
            deadline.enforce()
            possible = not shortcut or SatKnowledgeBase(theory, solver=solver, deadline=deadline).satisfiable(deadline)
            self.simplified = simplify(theory, deadline) if possible else Theory(theory.domains, (FALSE,))
            """The equivalent theory that was encoded."""
            self._factors = self._compile(self._effort(deadline))
        finally:
            self.statistics.seconds += time.perf_counter() - started
        self._measure()

    def satisfiable(self, deadline: Deadline = NEVER) -> bool:
        return self._could_hold(Narrowing({}, (), True), deadline)

    def could_commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> bool:
        return self._could_hold(narrowing(commitments, self.theory), deadline)

    def commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> None:
        deadline.enforce()
        asked = narrowing(commitments, self.theory)
        effort = self._effort(deadline)
        conflicts = [self._conflict(each) for each in asked.conflicts]
        if asked.consistent:
            required = self._partial(asked.required)
            narrowed = require(self._factors, required, self._joining, effort)
            for each in conflicts:
                narrowed = exclude(narrowed, each, self._joining, effort)
            # Requiring a value is excluding the others [PIKE §5.7].
            others = [value for _, values in self._excluded_by(required) for value in values]
            conflicts += [conflict(value, self._vocabulary) for value in others]
        else:
            narrowed = [FALSITY]
            conflicts = [conflict(0, self._vocabulary)]
        self._factors = narrowed
        self._committed += tuple(conflicts)
        self._measure()

    def find_model(
        self, commitments: Sequence[Commitment], preferred: Mapping[str, str], deadline: Deadline = NEVER
    ) -> Mapping[str, str] | None:
        """Independent parts keep all of their preferred values, if they can."""
        deadline.enforce()
        self.statistics.queries += 1
        asked = narrowing(commitments, self.theory)
        if not asked.consistent:
            return None
        kept = {variable: preferred.get(variable, values[0]) for variable, values in self.theory.domains.items()}
        conflicts = [self._conflict(each) for each in asked.conflicts]
        wanted = self._vocabulary.encode(Assignment(*item) for item in kept.items()) & self._vocabulary.made
        found = find_model(self._factors, self._partial(asked.required), conflicts, wanted, deadline)
        return None if found is None else kept | dict(self._vocabulary.decode(found))

    def count_models(self, deadline: Deadline = NEVER) -> int:
        deadline.enforce()
        self.statistics.queries += 1
        covers = self._covers(deadline)
        covered = sum(scope for scope, _ in covers)
        free = prod(len(self.theory.domains[name]) for name in self.theory.domains if not self._field(name) & covered)
        return free * prod(count_models(label, scope, self._vocabulary, deadline) for scope, label in covers)

    def models(self, deadline: Deadline = NEVER) -> Iterator[Mapping[str, str]]:
        deadline.enforce()
        self.statistics.queries += 1
        return models(self._covers(deadline), self._vocabulary, deadline)

    def explain(self, environment: Guard, deadline: Deadline = NEVER) -> Guard | None:
        """An environment of the goal's label that is consistent with the given one; None if there is none.

        Raises:
            InputError: if a variable or a value is unknown.
            OutOfTimeError: if the deadline passes.
        """
        deadline.enforce()
        check_assignments(environment, self.theory, "the environment")
        if not self._vocabulary.consistent(self._vocabulary.encode(environment)):
            return None
        asked = self._partial(dict(environment))
        found = 0
        for factor in self._factors:
            part = next(allowing(factor, asked, deadline), None)
            if part is None:
                return None
            found |= part
        return self._vocabulary.decode(found)

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
                label = self._joining.resolve(label, each, effort)
            found.append(NodeLabel(node, frozenset(map(self._vocabulary.decode, environments(label)))))
        return found

    def goal(self) -> Iterator[Guard]:
        """The environments of the goal's label, as products of those of its factors, one after the other."""
        for parts in product(*(tuple(environments(factor.label)) for factor in self._factors)):
            yield self._vocabulary.decode(sum(parts))

    def goal_size(self) -> int:
        """How many environments the goal's label has."""
        return prod(size(factor.label) for factor in self._factors)

    @abstractmethod
    def _create_joining(self) -> Joining:
        """What conflicts do to labels."""

    def _compile(self, effort: Effort) -> list[Factor]:
        network = encode(self.simplified)
        sizes = self.statistics.sizes
        sizes |= {
            "nodes": len(network.nodes),
            "justifications": len(network.justifications),
            "conflicts": len(self.simplified.conflicts),
            "variables": len(self.theory.domains),
        }
        self._maintenance = TruthMaintenance(
            network, self._vocabulary, consensus=self.consensus, resolve=self._joining.resolve
        )
        self._maintenance.run(effort)
        labels = [self._maintenance.own_label(node) for node in network.constraints]
        return factors(labels, self._maintenance.conflicts(), self._joining, effort)

    def _could_hold(self, asked: Narrowing, deadline: Deadline) -> bool:
        deadline.enforce()
        self.statistics.queries += 1
        if not asked.consistent:
            return False
        conflicts = [self._conflict(each) for each in asked.conflicts]
        return could_hold(self._factors, self._partial(asked.required), conflicts, deadline)

    def _covers(self, deadline: Deadline) -> list[tuple[Scope, Label]]:
        """For each factor its scope, and a label that resolves all conflicts."""
        effort = self._effort(deadline)
        covers = []
        for factor in self._factors:
            label = factor.label
            for each in factor.conflicts:
                label = split(label, each, effort)
            covers.append((factor.scope, label))
        return covers

    def _effort(self, deadline: Deadline) -> Effort:
        return Effort(self.statistics, deadline, self._largest_label)

    def _measure(self) -> None:
        self.statistics.sizes["factors"] = len(self._factors)
        self.statistics.sizes["environments"] = sum(size(factor.label) for factor in self._factors)

    def _field(self, variable: str) -> Scope:
        return self._vocabulary.field(variable)

    def _conflict(self, guard: Guard) -> Conflict:
        return conflict(self._vocabulary.encode(guard), self._vocabulary)

    def _partial(self, required: Mapping[str, str]) -> Partial:
        """An environment; what variables without another value have goes without saying."""
        partial = Partial()
        for variable, value in required.items():
            if len(self.theory.domains[variable]) == 1:
                continue
            made = self._vocabulary.assign(variable, value) & self._vocabulary.made
            partial = partial.with_assignment(made, self._field(variable))
        return partial

    def _excluded_by(self, partial: Partial) -> tuple[tuple[Scope, tuple[int, ...]], ...]:
        return conflict(partial.environment, self._vocabulary).resolutions
