"""The goal node: the conjunction of all constraints and conflicts, kept as a product of independent factors.

Constraints and conflicts that share no variables, not even through others, have prime implicants of their own, and
those of all are the products of these. Within a factor, labels are joined two at a time, such that the estimated
result is the smallest, and a conflict is resolved as soon as a label mentions all of its variables.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from math import log2

from robust.pike_bridge.environment import Vocabulary
from robust.pike_bridge.knowledge.labels import Conflict, Label, Scope, scope_of, size, true_label, weave
from robust.pike_bridge.knowledge.propagation import Resolve
from robust.pike_bridge.knowledge.space import Effort


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
    parts = [(scope_of(label), label) for label in labels if 0 not in label]
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

    def weights(self) -> dict[Scope, float]:
        """For each variable, the binary logarithm of the number of its values."""
        return {self.vocabulary.field(name): log2(len(values)) for name, values in self.vocabulary.domains.items()}


class _Join:
    def __init__(self, joining: Joining, effort: Effort, labels: Sequence[Label], conflicts: list[Conflict]) -> None:
        self._joining = joining
        self._effort = effort
        self._parts: dict[int, Label] = {}
        self._scopes: dict[int, Scope] = {}
        self._open = conflicts
        self._weights = joining.weights()
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
            scope = scope_of(label)
            conflict = min(self._open, key=lambda each: (each.scope & ~scope).bit_count())
            self._open.remove(conflict)
            label = self._resolved(label, conflict)
        return label

    def _put(self, label: Label) -> None:
        """Add a part, with all conflicts resolved that it knows all variables of."""
        scope = scope_of(label)
        for conflict in [each for each in self._open if each.scope & scope == each.scope]:
            self._open.remove(conflict)
            label = self._resolved(label, conflict)
        scope = scope_of(label)
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
