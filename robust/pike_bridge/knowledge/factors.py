"""The goal of the ATMS: the conjunction of all constraints, as a product of independent factors, and all conflicts.

Constraints and conflicts that share no variables, not even through others, have labels of their own, and that of all is
the product of these. Within a factor, labels are joined two at a time, such that the estimated result is the smallest,
and what manifests a conflict is dropped as soon as a label mentions all of its variables. What entails a label may
manifest one still: so queries look for environments that resolve all conflicts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from math import log2

from robust.pike_bridge.knowledge.interface import Effort
from robust.pike_bridge.knowledge.labels import (
    Label,
    LabelConflict,
    Scope,
    consistent_with,
    environments,
    size,
    true_label,
    weave,
    without_manifest,
)
from robust.pike_bridge.knowledge.orders import connected
from robust.pike_bridge.model import Environment, Vocabulary, bits, union
from robust.smt.limits import Deadline


@dataclass(frozen=True, slots=True)
class LabelFactor:
    """The label of independent constraints and conflicts."""

    scope: Scope
    """All variables of the constraints and conflicts."""
    label: Label
    conflicts: tuple[LabelConflict, ...] = ()
    """Those that an environment of the label may not have resolved."""


FALSITY = LabelFactor(0, {})


def factors(
    labels: Sequence[Label], conflicts: Sequence[LabelConflict], vocabulary: Vocabulary, effort: Effort
) -> list[LabelFactor]:
    """The goal's label, from those of all constraints, and all conflicts.

    Raises:
        OutOfTimeError: if the deadline passes; the statistics then say how large the labels were.
    """
    parts = [(union(label), label) for label in labels if 0 not in label]
    found: list[LabelFactor] = []
    scopes = [scope for scope, _ in parts] + [each.scope for each in conflicts]
    for scope in dict.fromkeys(map(union, connected(scopes, lambda scope: frozenset(bits(scope))))):
        own = [each for each in conflicts if _touch(each.scope, scope)]
        found.append(joined([label for each, label in parts if _touch(each, scope)], own, scope, vocabulary, effort))
    return found


def _touch(first: Scope, second: Scope) -> bool:
    """Whether scopes share variables; falsity, which has none, is apart from everything else."""
    return bool(first & second) or first == second


def joined(
    labels: Sequence[Label], conflicts: Sequence[LabelConflict], scope: Scope, vocabulary: Vocabulary, effort: Effort
) -> LabelFactor:
    """The conjunction of all labels and conflicts, which are about the variables of a scope.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    return LabelFactor(scope, _Join(vocabulary, effort, labels, list(conflicts)).run(), tuple(conflicts))


class _Join:
    def __init__(
        self, vocabulary: Vocabulary, effort: Effort, labels: Sequence[Label], conflicts: list[LabelConflict]
    ) -> None:
        self._effort = effort
        self._parts: dict[int, Label] = {}
        self._scopes: dict[int, Scope] = {}
        self._open = conflicts
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
        return next(iter(self._parts.values()), true_label())

    def _put(self, label: Label) -> None:
        """Add a part, without what manifests conflicts that it knows all variables of."""
        scope = union(label)
        for known in [each for each in self._open if each.scope & scope == each.scope]:
            self._open.remove(known)
            label = without_manifest(label, known, self._effort)
            self._note(label)
        scope = union(label)
        index, self._next = self._next, self._next + 1
        for other in self._parts:
            heappush(self._pairs, (self._cost(label, scope, other), index, other))
        self._parts[index] = label
        self._scopes[index] = scope

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


def could_hold(
    factors: Sequence[LabelFactor], asked: Partial, conflicts: Sequence[LabelConflict], deadline: Deadline
) -> bool:
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
    asked: Partial, conflicts: Sequence[LabelConflict], deadline: Deadline, factors: Sequence[LabelFactor] = ()
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


def resolves(partial: Partial, conflict: LabelConflict) -> bool:
    """Whether some variable has another value than in the conflict."""
    shared = partial.scope & conflict.scope
    return partial.environment & shared != conflict.environment & shared


def extensions(factor: LabelFactor, asked: Partial, deadline: Deadline) -> Iterator[Partial]:
    """What entails an environment of a factor's label and what is asked, and resolves the factor's conflicts.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    for environment, scope in consistent_with(factor.label, asked.environment, asked.scope):
        both = Partial(environment | asked.environment, scope | asked.scope)
        yield from resolutions(both, factor.conflicts, deadline)


def allows(factor: LabelFactor, asked: Partial, deadline: Deadline) -> bool:
    """Whether a factor has a model that extends what is asked."""
    return next(extensions(factor, asked, deadline), None) is not None


def require(factors: Sequence[LabelFactor], asked: Partial, effort: Effort) -> list[LabelFactor]:
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
            label = without_manifest(label, each, effort)
        narrowed.append(LabelFactor(factor.scope, label, factor.conflicts))
    if free:
        narrowed.append(LabelFactor(free, {free: {asked.environment & free}}))
    return narrowed


def exclude(
    factors: Sequence[LabelFactor], conflict: LabelConflict, vocabulary: Vocabulary, effort: Effort
) -> list[LabelFactor]:
    """The factors with one more conflict.

    A conflict about several factors joins them, except where all of a factor's label agrees about it.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    apart, together = [], []
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
            together.append(factor)
    if not scope:
        return [FALSITY]
    left = conflict.within(scope)
    whole = scope | union(factor.scope for factor in together)
    conflicts = [each for factor in together for each in factor.conflicts]
    labels = [factor.label for factor in together]
    return [*apart, joined(labels, [*conflicts, left], whole, vocabulary, effort)]


def _all_resolve(label: Label, conflict: LabelConflict) -> bool:
    """Whether some variable of every environment has another value than in the conflict."""
    for scope, members in label.items():
        shared = scope & conflict.scope
        part = conflict.environment & shared
        if not shared or any(one & shared == part for one in members):
            return False
    return True


def _all_manifest(label: Label, conflict: LabelConflict, within: Scope) -> bool:
    """Whether every environment has all assignments that the conflict makes to variables of a scope."""
    scope = conflict.scope & within
    part = conflict.environment & scope
    return all(each & scope == scope for each in label) and all(one & scope == part for one in environments(label))
