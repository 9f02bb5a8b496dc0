"""Labels: minimal sets of environments, and how they are conjoined, split on conflicts and closed under consensus.

An environment is kept by the bits of the assignments that it makes (see :class:`Vocabulary`), and filed under its
*scope*: the bits of all assignments to the variables that it assigns. So one environment entails another if the scope
of the second is contained in that of the first and both agree on it, which is a look-up in a set: subsumption costs one
look-up per scope, not per environment, and conjunctions are hash joins. Source: [PIKE §5.6, Algorithm 7].
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import prod
from typing import TypeAlias

from robust.pike_bridge.knowledge.interface import Effort
from robust.pike_bridge.model import Environment, Vocabulary, bits, union
from robust.pike_bridge.theory import evaluate
from robust.smt.limits import Deadline

Scope: TypeAlias = int
"""The bits of all assignments to some variables."""
Label: TypeAlias = dict[Scope, set[Environment]]
"""A disjunction of environments by scope; none entails another, and no scope is without environments."""
Remainder: TypeAlias = tuple[int, frozenset[Environment]]
"""How many variables have a value already, and what is left of environments then."""

BATCH = 100_000
"""Candidates that a conjunction collects before it drops those that entail others."""


def true_label() -> Label:
    """The label that holds everywhere: the empty environment."""
    return {0: {0}}


def size(label: Label) -> int:
    """How many environments a label has."""
    return sum(map(len, label.values()))


def environments(label: Label) -> Iterator[Environment]:
    """All environments of a label."""
    for members in label.values():
        yield from members


@dataclass(frozen=True, slots=True)
class LabelConflict:
    """An environment that must not hold, with what resolves it: any other assignment to one of its variables."""

    environment: Environment
    scope: Scope
    resolutions: tuple[tuple[Scope, tuple[Environment, ...]], ...]
    """For each variable, its scope and the assignments that differ."""

    def within(self, scope: Scope) -> LabelConflict:
        """The part about the variables of a scope."""
        kept = tuple(each for each in self.resolutions if each[0] & scope)
        return LabelConflict(self.environment & scope, self.scope & scope, kept)


def conflict(environment: Environment, vocabulary: Vocabulary) -> LabelConflict:
    """The conflict of an environment of a vocabulary."""
    made = environment & vocabulary.made
    fields = [vocabulary.field(variable) for variable in vocabulary.assigned(made)]
    resolutions = tuple((field, tuple(1 << at for at in bits(field & ~made))) for field in fields)
    return LabelConflict(made, sum(fields), resolutions)


def weave(first: Label, second: Label, effort: Effort) -> Label:
    """The minimal consistent conjunctions of an environment of each label (ATMS WEAVE).

    Of two labels with all prime implicants of their constraints, these are all prime implicants of the conjunction: a
    prime implicant of the conjunction contains one of each, and their union is an implicant already.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    result: Label = {}
    left = _take_absorbed(first, second, result, effort)
    right = _take_absorbed(second, first, result, effort)
    candidates: Label = {}
    waiting, batch = 0, BATCH
    reach = union(right)
    for scope, members in left.items():
        for projection, ones in _index(members, scope & reach).items():
            for other, rests in _residuals(right, projection, scope, effort).items():
                target = candidates.setdefault(scope | other, set())
                before = len(target)
                for rest in rests:
                    target.update([one | rest for one in ones])
                    effort.create(len(ones))
                    effort.hold(len(target))
                waiting += len(target) - before
            if waiting > batch:
                candidates = minimal(candidates, result, effort)
                waiting = size(candidates)
                effort.hold(waiting)
                batch = waiting + BATCH
    for scope, found in minimal(candidates, result, effort).items():
        result[scope] = result.get(scope, set()) | found
    effort.hold(size(result))
    return result


def _take_absorbed(label: Label, other: Label, absorbed: Label, effort: Effort) -> Label:
    """Move environments that entail some environment of the other label; what is left."""
    left: Label = {}
    for scope, members in label.items():
        rest = _apart(members, scope, other.items(), effort)
        if len(rest) < len(members):
            absorbed.setdefault(scope, set()).update(members - rest)
        if rest:
            left[scope] = rest
    return left


def _apart(
    members: set[Environment], scope: Scope, known: Iterable[tuple[Scope, set[Environment]]], effort: Effort
) -> set[Environment]:
    """The environments of a scope that entail none of those that are known."""
    for smaller, others in known:
        if smaller & scope == smaller:
            if not members:
                break
            effort.pass_by(len(members))
            members = {one for one in members if one & smaller not in others}
    return members


def _residuals(label: Label, environment: Environment, scope: Scope, effort: Effort) -> Label:
    """What an environment of some scope lacks of those of a label that it is consistent with, minimally."""
    residuals: Label = {}
    for other, others in label.items():
        shared = other & scope
        part = environment & shared
        effort.pass_by(len(others))
        rests = {one ^ part for one in others if one & shared == part}
        if rests:
            left = other ^ shared
            residuals[left] = residuals.get(left, set()) | rests
    return minimal(residuals, {}, effort) if len(residuals) > 1 else residuals


def _index(members: set[Environment], shared: Scope) -> dict[Environment, list[Environment]]:
    index: dict[Environment, list[Environment]] = {}
    for one in members:
        index.setdefault(one & shared, []).append(one)
    return index


def minimal(candidates: Label, base: Label, effort: Effort) -> Label:
    """The candidates that entail neither an environment of the base nor another candidate.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    kept: Label = {}
    for scope in sorted(candidates, key=int.bit_count):
        known = [item for label in (base, kept) for item in label.items() if item[0] & scope == item[0]]
        # What drops most comes first.
        known.sort(key=lambda item: -len(item[1]))
        rest = _apart(candidates[scope], scope, known, effort)
        effort.subsume(len(candidates[scope]) - len(rest))
        if rest:
            kept[scope] = rest
        effort.pass_by(len(kept))
    return kept


def split(label: Label, conflict: LabelConflict, effort: Effort) -> Label:
    """The minimal environments that entail the label and resolve the conflict [PIKE §5.6].

    New environments can entail only such as resolved the conflict before: two that did not are extended in the same
    ways, so that what was incomparable remains so.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    kept: Label = {}
    extended: Label = {}
    for scope, members in label.items():
        shared = scope & conflict.scope
        part = conflict.environment & shared
        open_ones = [one for one in members if one & shared == part]
        effort.pass_by(len(members))
        if len(open_ones) < len(members):
            kept[scope] = members.difference(open_ones) if open_ones else members
        if not open_ones:
            continue
        for field, resolutions in conflict.resolutions:
            if field & scope == 0:
                for resolution in resolutions:
                    new = [one | resolution for one in open_ones]
                    extended.setdefault(scope | field, set()).update(new)
                    effort.create(len(new))
    result = dict(kept)
    for scope, candidates in extended.items():
        rest = _apart(candidates, scope, kept.items(), effort)
        effort.subsume(len(candidates) - len(rest))
        if rest:
            result[scope] = result.get(scope, set()) | rest
    effort.hold(size(result))
    return result


def without_manifest(label: Label, conflict: LabelConflict, effort: Effort) -> Label:
    """The environments that do not manifest the conflict, though more specific ones may: what the ATMS keeps."""
    result: Label = {}
    for scope, members in label.items():
        rest = members
        if conflict.scope & scope == conflict.scope:
            effort.pass_by(len(members))
            rest = {one for one in members if one & conflict.scope != conflict.environment}
        if rest:
            result[scope] = rest
    return result


def insert(label: Label, environment: Environment, scope: Scope) -> bool:
    """Add an environment minimally; False if it entails one that is there already."""
    for smaller, known in label.items():
        if smaller & scope == smaller and environment & smaller in known:
            return False
    for larger in [each for each in label if each & scope == scope]:
        rest = {one for one in label[larger] if one & scope != environment}
        if rest:
            label[larger] = rest
        else:
            del label[larger]
    label.setdefault(scope, set()).add(environment)
    return True


def add_minimally(label: Label, new: Label, effort: Effort) -> Label:
    """Add environments to a label minimally; those that were added and stayed."""
    added: Label = {}
    for scope, members in new.items():
        for one in members:
            effort.pass_by(1 + len(label))
            if insert(label, one, scope):
                insert(added, one, scope)
            else:
                effort.subsume(1)
    return added


def add_and_generate_prime_implicants(label: Label, new: Label, fields: Iterable[Scope], effort: Effort) -> Label:
    """Add environments to a label, and all consensuses [PIKE, Algorithm 7]; what was added and is still needed.

    Args:
        fields: the scope of each variable.

    Raises:
        OutOfTimeError: if the deadline passes; the label is not to be used after that.
    """
    known_fields = tuple(fields)
    added = add_minimally(label, new, effort)
    queue = deque(field for field in known_fields if field & union(added))
    while queue:
        field = queue.popleft()
        found = add_minimally(label, consensus(label, field, effort), effort)
        add_minimally(added, found, effort)
        touched = union(found)
        queue.extend(each for each in known_fields if each & touched and each not in queue)
    return added


def consensus(label: Label, field: Scope, effort: Effort) -> Label:
    """The conjunctions of one environment for each value of a variable, with the variable removed [PIKE §5.6]."""
    result = true_label()
    for at in bits(field):
        satellites = _satellites(label, field, 1 << at)
        if not satellites:
            return {}
        result = weave(result, satellites, effort)
    return result


def _satellites(label: Label, field: Scope, assignment: Environment) -> Label:
    """The environments that make an assignment, without it: none entails another, because all made it."""
    satellites: Label = {}
    for scope, members in label.items():
        if scope & field:
            stripped = {one ^ assignment for one in members if one & assignment}
            if stripped:
                satellites[scope ^ field] = stripped
    return satellites


def consistent_with(label: Label, environment: Environment, scope: Scope) -> Iterator[tuple[Environment, Scope]]:
    """The environments of a label that do not contradict an environment of the given scope, with their scopes."""
    for each, members in label.items():
        shared = each & scope
        part = environment & shared
        if not shared:
            yield from ((one, each) for one in members)
        elif shared == each:
            if part in members:
                yield part, each
        else:
            yield from ((one, each) for one in members if one & shared == part)


def count_models(label: Label, scope: Scope, vocabulary: Vocabulary, deadline: Deadline) -> int:
    """How many assignments to the variables of a scope entail some environment of a label about them.

    One variable after the other is given each of its values; what is left to count is looked up if it was met before.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    fields = [vocabulary.field(variable) for variable in vocabulary.variables if vocabulary.field(variable) & scope]
    fields.sort(key=lambda field: -sum(len(members) for each, members in label.items() if each & field))
    sizes = [field.bit_count() for field in fields]
    known: dict[Remainder, int] = {}

    def step(key: Remainder) -> int | list[Remainder]:
        depth, left = key
        if not left or 0 in left:
            return prod(sizes[depth:]) if left else 0
        field = fields[depth]
        parts = [(depth + 1, _restricted(left, field, 1 << at)) for at in bits(field)]
        return [part for part in parts if part not in known] or sum(known[part] for part in parts)

    return evaluate((0, frozenset(environments(label))), known, step, deadline)


def _restricted(members: frozenset[Environment], field: Scope, assignment: Environment) -> frozenset[Environment]:
    """What is left of environments once a variable has the assigned value."""
    return frozenset(one & ~assignment for one in members if one & assignment or not one & field)
