"""What the goal's label answers, and how it is narrowed [PIKE §5.7]; environments are kept by their made bits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from robust.pike_bridge.environment import Environment
from robust.pike_bridge.knowledge.goal import FALSITY, Factor, Joining
from robust.pike_bridge.knowledge.labels import Conflict, Label, Scope, consistent_with, environments, weave
from robust.pike_bridge.knowledge.space import Effort
from robust.smt.limits import Deadline


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
    mentioned = asked.scope
    for each in conflicts:
        mentioned |= each.scope
    if any(next(allowing(each, Partial(), deadline), None) is None for each in factors if not each.scope & mentioned):
        return False
    relevant = [each for each in factors if each.scope & mentioned]
    return any(
        all(next(allowing(each, resolved, deadline), None) is not None for each in relevant)
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
        elif all(next(allowing(each, current, deadline), None) is not None for each in factors):
            for field, values in reversed(conflicts[done].resolutions):
                if not field & current.scope:
                    stack.extend((current.with_assignment(value, field), done + 1) for value in reversed(values))


def resolves(partial: Partial, conflict: Conflict) -> bool:
    """Whether some variable has another value than in the conflict."""
    shared = partial.scope & conflict.scope
    return partial.environment & shared != conflict.environment & shared


def allowing(factor: Factor, asked: Partial, deadline: Deadline) -> Iterator[Environment]:
    """Environments of a factor's label that are consistent with what is asked, and can then resolve its conflicts.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    for environment, scope in consistent_with(factor.label, asked.environment, asked.scope):
        if factor.conflicts:
            both = Partial(environment | asked.environment, scope | asked.scope)
            if next(resolutions(both, factor.conflicts, deadline), None) is None:
                continue
        yield environment


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
            if next(allowing(factor, kept, deadline), None) is not None:
                whole |= kept.environment
                continue
            part = next(_extensions(factor, resolved, deadline), None)
            if part is None:
                break
            whole |= part.environment
        else:
            return whole
    return None


def _extensions(factor: Factor, asked: Partial, deadline: Deadline) -> Iterator[Partial]:
    """What entails an environment of a factor's label and what is asked, and resolves the factor's conflicts."""
    for environment, scope in consistent_with(factor.label, asked.environment, asked.scope):
        both = Partial(environment | asked.environment, scope | asked.scope)
        yield from resolutions(both, factor.conflicts, deadline)


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
    whole = scope
    for factor in joined:
        whole |= factor.scope
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
