"""The truth-maintenance systems: πTMS [PIKE §5] and ATMS, and the goal node that both answer from.

The goal is the conjunction of all constraints and conflicts, kept as a product of independent factors.
Constraints and conflicts that share no variables, not even through others, have prime implicants of their own, and
those of all are the products of these. Within a factor, labels are joined two at a time, such that the estimated
result is the smallest, and a conflict is resolved as soon as a label mentions all of its variables.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import product
from math import log2, prod

from robust.pike_bridge.knowledge.interface import (
    LARGEST_LABEL,
    Commitment,
    Effort,
    KnowledgeBase,
    KnowledgeStatistics,
    Narrowing,
    narrowing,
)
from robust.pike_bridge.knowledge.labels import (
    Conflict,
    Label,
    Scope,
    conflict,
    consistent_with,
    count_models,
    environments,
    size,
    split,
    true_label,
    weave,
    without_manifest,
)
from robust.pike_bridge.knowledge.network import Node, Resolve, TruthMaintenance, encode, simplify
from robust.pike_bridge.knowledge.sat import SatKnowledgeBase
from robust.pike_bridge.model import Assignment, Environment, Guard, Vocabulary, union
from robust.pike_bridge.theory import FALSE, Theory
from robust.smt.limits import NEVER, Deadline


@dataclass(frozen=True, slots=True)
class Factor:
    """The label of independent constraints and conflicts."""

    scope: Scope
    """All variables of the constraints and conflicts."""
    label: Label
    conflicts: tuple[Conflict, ...] = ()
    """Those that an environment of the label may not have resolved."""


FALSITY = Factor(0, {})


def factors(labels: Sequence[Label], conflicts: Sequence[Conflict], joining: Joining, effort: Effort) -> list[Factor]:
    """The goal's label, from those of all constraints, and all conflicts.

    Raises:
        OutOfTimeError: if the deadline passes; the statistics then say how large the labels were.
    """
    parts = [(union(label), label) for label in labels if 0 not in label]
    found: list[Factor] = []
    scopes = [scope for scope, _ in parts] + [each.scope for each in conflicts]
    for scope in components(scopes):
        own = [each for each in conflicts if _touch(each.scope, scope)]
        found.append(joining.factor([label for each, label in parts if _touch(each, scope)], own, scope, effort))
    return found


def _touch(first: Scope, second: Scope) -> bool:
    """Whether scopes share variables; falsity, which has none, is apart from everything else."""
    return bool(first & second) or first == second


def components(scopes: Iterable[Scope]) -> list[Scope]:
    """The unions of scopes that share variables, directly or through others; the empty scope is one of its own."""
    found: list[Scope] = []
    for scope in scopes:
        apart = []
        merged = scope
        for each in found:
            if _touch(each, scope):
                merged |= each
            else:
                apart.append(each)
        found = [*apart, merged]
    return found


@dataclass(frozen=True, slots=True)
class Joining:
    """How the labels of one factor are joined."""

    vocabulary: Vocabulary
    resolve: Resolve
    resolved: bool
    """Whether what `resolve` returns resolves the conflict for good."""

    def factor(self, labels: Sequence[Label], conflicts: Sequence[Conflict], scope: Scope, effort: Effort) -> Factor:
        """The conjunction of all labels and conflicts, which are about the variables of a scope.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        label = _Join(self, effort, labels, list(conflicts)).run()
        return Factor(scope, label, () if self.resolved else tuple(conflicts))


class _Join:
    def __init__(self, joining: Joining, effort: Effort, labels: Sequence[Label], conflicts: list[Conflict]) -> None:
        self._joining = joining
        self._effort = effort
        self._parts: dict[int, Label] = {}
        self._scopes: dict[int, Scope] = {}
        self._open = conflicts
        vocabulary = joining.vocabulary
        self._weights = {vocabulary.field(name): log2(len(values)) for name, values in vocabulary.domains.items()}
        """For each variable, the binary logarithm of the number of its values."""
        self._pairs: list[tuple[float, int, int]] = []
        self._next = 0
        for label in labels:
            self._put(label)

    def run(self) -> Label:
        while len(self._parts) > 1 and all(self._parts.values()):
            first, second = self._best()
            self._put(weave(self._take(first), self._take(second), self._effort))
        if not all(self._parts.values()):
            return {}
        label = next(iter(self._parts.values()), true_label())
        while self._open:
            scope = union(label)
            conflict = min(self._open, key=lambda each: (each.scope & ~scope).bit_count())
            self._open.remove(conflict)
            label = self._resolved(label, conflict)
        return label

    def _put(self, label: Label) -> None:
        """Add a part, with all conflicts resolved that it knows all variables of."""
        scope = union(label)
        for known in [each for each in self._open if each.scope & scope == each.scope]:
            self._open.remove(known)
            label = self._resolved(label, known)
        scope = union(label)
        index, self._next = self._next, self._next + 1
        for other in self._parts:
            heappush(self._pairs, (self._cost(label, scope, other), index, other))
        self._parts[index] = label
        self._scopes[index] = scope

    def _resolved(self, label: Label, conflict: Conflict) -> Label:
        result = self._joining.resolve(label, conflict, self._effort)
        self._note(result)
        return result

    def _note(self, label: Label) -> None:
        sizes = self._effort.statistics.sizes
        sizes["largest label"] = max(sizes.get("largest label", 0), size(label))

    def _cost(self, label: Label, scope: Scope, other: int) -> float:
        """Estimated size of the join, as a logarithm."""
        partner = self._parts[other]
        if not label or not partner:
            return 0.0
        shared = scope & self._scopes[other]
        agreement = sum(weight for field, weight in self._weights.items() if field & shared)
        return log2(size(label)) + log2(size(partner)) - agreement

    def _best(self) -> tuple[int, int]:
        while True:
            _, first, second = heappop(self._pairs)
            if first in self._parts and second in self._parts:
                return first, second

    def _take(self, index: int) -> Label:
        self._note(self._parts[index])
        return self._parts.pop(index)


@dataclass(frozen=True, slots=True)
class Partial:
    """A consistent environment, with the scope of the variables that it assigns."""

    environment: Environment = 0
    scope: Scope = 0

    def with_assignment(self, assignment: Environment, field: Scope) -> Partial:
        """The environment with one more variable assigned."""
        return Partial(self.environment | assignment, self.scope | field)


def could_hold(factors: Sequence[Factor], asked: Partial, conflicts: Sequence[Conflict], deadline: Deadline) -> bool:
    """Whether a model extends an environment and resolves all conflicts.

    Without conflicts, each factor's label must have an environment that is consistent with what is asked. With several
    it is not enough that such an environment manifests none: they may be resolved by different values of one variable.
    So each gets an assignment that resolves it, in turn.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    mentioned = asked.scope | union(each.scope for each in conflicts)
    relevant = [each for each in factors if each.scope & mentioned]
    return all(each.scope & mentioned or allows(each, Partial(), deadline) for each in factors) and any(
        all(allows(each, resolved, deadline) for each in relevant)
        for resolved in resolutions(asked, conflicts, deadline, relevant)
    )


def resolutions(
    asked: Partial, conflicts: Sequence[Conflict], deadline: Deadline, factors: Sequence[Factor] = ()
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
        elif all(allows(each, current, deadline) for each in factors):
            for field, values in reversed(conflicts[done].resolutions):
                if not field & current.scope:
                    stack.extend((current.with_assignment(value, field), done + 1) for value in reversed(values))


def resolves(partial: Partial, conflict: Conflict) -> bool:
    """Whether some variable has another value than in the conflict."""
    shared = partial.scope & conflict.scope
    return partial.environment & shared != conflict.environment & shared


def extensions(factor: Factor, asked: Partial, deadline: Deadline) -> Iterator[Partial]:
    """What entails an environment of a factor's label and what is asked, and resolves the factor's conflicts.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    for environment, scope in consistent_with(factor.label, asked.environment, asked.scope):
        both = Partial(environment | asked.environment, scope | asked.scope)
        yield from resolutions(both, factor.conflicts, deadline)


def allows(factor: Factor, asked: Partial, deadline: Deadline) -> bool:
    """Whether a factor has a model that extends what is asked."""
    return next(extensions(factor, asked, deadline), None) is not None


def find_model(
    factors: Sequence[Factor], asked: Partial, conflicts: Sequence[Conflict], preferred: Environment, deadline: Deadline
) -> Environment | None:
    """Assignments that entail what is asked, resolve all conflicts and have only models as extensions; None if there
    are none.

    Args:
        preferred: an assignment to every variable, of which each factor is given its part if that is allowed.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    for resolved in resolutions(asked, conflicts, deadline, factors):
        whole = resolved.environment
        for factor in factors:
            rest = factor.scope & ~resolved.scope
            kept = Partial(resolved.environment | preferred & rest, resolved.scope | rest)
            if allows(factor, kept, deadline):
                whole |= kept.environment
                continue
            part = next(extensions(factor, resolved, deadline), None)
            if part is None:
                break
            whole |= part.environment
        else:
            return whole
    return None


def require(factors: Sequence[Factor], asked: Partial, joining: Joining, effort: Effort) -> list[Factor]:
    """The factors with all assignments of an environment conjoined.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    narrowed = []
    free = asked.scope
    for factor in factors:
        shared = factor.scope & asked.scope
        free &= ~factor.scope
        if not shared:
            narrowed.append(factor)
            continue
        label = weave(factor.label, {shared: {asked.environment & shared}}, effort)
        for each in factor.conflicts:
            label = joining.resolve(label, each, effort)
        narrowed.append(Factor(factor.scope, label, factor.conflicts))
    if free:
        narrowed.append(Factor(free, {free: {asked.environment & free}}))
    return narrowed


def exclude(factors: Sequence[Factor], conflict: Conflict, joining: Joining, effort: Effort) -> list[Factor]:
    """The factors with one more conflict, on which labels are split [PIKE §5.6].

    A conflict about several factors joins them, except where all of a factor's label agrees about it.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    apart, joined = [], []
    scope = conflict.scope
    for factor in factors:
        if not factor.scope & scope:
            apart.append(factor)
        elif _all_resolve(factor.label, conflict):
            return list(factors)
        elif _all_manifest(factor.label, conflict, factor.scope):
            apart.append(factor)
            scope &= ~factor.scope
        else:
            joined.append(factor)
    if not scope:
        return [FALSITY]
    left = conflict.within(scope)
    whole = scope | union(factor.scope for factor in joined)
    conflicts = [each for factor in joined for each in factor.conflicts]
    return [*apart, joining.factor([factor.label for factor in joined], [*conflicts, left], whole, effort)]


def _all_resolve(label: Label, conflict: Conflict) -> bool:
    """Whether some variable of every environment has another value than in the conflict."""
    for scope, members in label.items():
        shared = scope & conflict.scope
        part = conflict.environment & shared
        if not shared or any(one & shared == part for one in members):
            return False
    return True


def _all_manifest(label: Label, conflict: Conflict, within: Scope) -> bool:
    """Whether every environment has all assignments that the conflict makes to variables of a scope."""
    scope = conflict.scope & within
    part = conflict.environment & scope
    return all(each & scope == scope for each in label) and all(one & scope == part for one in environments(label))


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
        statistics: KnowledgeStatistics | None = None,
        largest_label: int = LARGEST_LABEL,
    ) -> None:
        super().__init__(theory, statistics)
        self._vocabulary = Vocabulary(theory.domains)
        self._largest_label = largest_label
        self._joining = Joining(self._vocabulary, self.resolve, resolved=self.consensus)
        self._committed: tuple[Conflict, ...] = ()
        with self._compiling(deadline):
            possible = not shortcut or SatKnowledgeBase(theory, solver=solver, deadline=deadline).satisfiable(deadline)
            self.simplified = simplify(theory, deadline) if possible else Theory(theory.domains, (FALSE,))
            """The equivalent theory that was encoded."""
            self._factors = self._compile(self._effort(deadline))
        self._measure()

    def commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> None:
        deadline.enforce()
        asked = narrowing(commitments, self.theory)
        effort = self._effort(deadline)
        conflicts = self._conflicts(asked)
        if asked.consistent:
            required = self._partial(asked.required)
            narrowed = require(self._factors, required, self._joining, effort)
            for each in conflicts:
                narrowed = exclude(narrowed, each, self._joining, effort)
            # Requiring a value is excluding the others [PIKE §5.7].
            resolutions = conflict(required.environment, self._vocabulary).resolutions
            others = [value for _, values in resolutions for value in values]
            conflicts += [conflict(value, self._vocabulary) for value in others]
        else:
            narrowed = [FALSITY]
            conflicts = [conflict(0, self._vocabulary)]
        self._factors = narrowed
        self._committed += tuple(conflicts)
        self._measure()

    def _possible(self, asked: Narrowing, deadline: Deadline) -> bool:
        return could_hold(self._factors, self._partial(asked.required), self._conflicts(asked), deadline)

    def _model(self, asked: Narrowing, preferred: Mapping[str, str], deadline: Deadline) -> Mapping[str, str] | None:
        """Independent parts keep all of their preferred values, if they can."""
        kept = {variable: preferred.get(variable, values[0]) for variable, values in self.theory.domains.items()}
        wanted = self._vocabulary.encode(Assignment(*item) for item in kept.items()) & self._vocabulary.made
        found = find_model(self._factors, self._partial(asked.required), self._conflicts(asked), wanted, deadline)
        return None if found is None else kept | dict(self._vocabulary.decode(found))

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

    def goal(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """The environments of the goal's label, as products of those of its factors, one after the other.

        Raises:
            OutOfTimeError: if the deadline passes before all are listed.
        """
        for parts in product(*(tuple(environments(factor.label)) for factor in self._factors)):
            deadline.enforce()
            yield self._vocabulary.decode(sum(parts))

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

    def _effort(self, deadline: Deadline) -> Effort:
        return Effort(self.statistics, deadline, self._largest_label)

    def _measure(self) -> None:
        self.statistics.sizes["factors"] = len(self._factors)
        self.statistics.sizes["environments"] = sum(size(factor.label) for factor in self._factors)

    def _conflicts(self, asked: Narrowing) -> list[Conflict]:
        return [conflict(self._vocabulary.encode(each), self._vocabulary) for each in asked.conflicts]

    def _partial(self, required: Mapping[str, str]) -> Partial:
        """An environment; what variables without another value have goes without saying."""
        partial = Partial()
        for variable, value in required.items():
            if len(self.theory.domains[variable]) == 1:
                continue
            made = self._vocabulary.assign(variable, value) & self._vocabulary.made
            partial = partial.with_assignment(made, self._vocabulary.field(variable))
        return partial


class Atms(LabelKnowledgeBase):
    """No environment of a label manifests a known conflict, but extensions of it may.

    So a query must look for an extension that resolves all conflicts, which the label alone does not tell.
    """

    name = "atms"
    consensus = False
    resolve = staticmethod(without_manifest)


class PiTms(LabelKnowledgeBase):
    """The knowledge base of [PIKE §5]: the goal's label holds the prime implicants of the theory, and no others."""

    name = "pitms"
    consensus = True
    resolve = staticmethod(split)

    def prime_implicants(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """Every prime implicant of what is left of the theory, once; there may be very many.

        Raises:
            OutOfTimeError: if the deadline passes before all are listed.
        """
        return self.goal(deadline)

    def implicant_count(self, deadline: Deadline = NEVER) -> int:
        """How many prime implicants what is left of the theory has.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        deadline.enforce()
        return prod(size(factor.label) for factor in self._factors)
