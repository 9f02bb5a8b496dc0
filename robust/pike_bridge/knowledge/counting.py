"""Models of labels: how many, and which."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from robust.pike_bridge.environment import Environment, Vocabulary, bits
from robust.pike_bridge.knowledge.labels import Label, Scope, environments, true_label
from robust.smt.limits import Deadline


def count_models(label: Label, scope: Scope, vocabulary: Vocabulary, deadline: Deadline) -> int:
    """How many assignments to the variables of a scope entail some environment of a label about them.

    One variable after the other is given each of its values; what is left to count is looked up if it was met before.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    fields = [vocabulary.field(variable) for variable in vocabulary.variables if vocabulary.field(variable) & scope]
    fields.sort(key=lambda field: -sum(len(members) for each, members in label.items() if each & field))
    combinations = [1]
    for field in reversed(fields):
        combinations.append(combinations[-1] * field.bit_count())
    combinations.reverse()
    known: dict[tuple[int, frozenset[Environment]], int] = {}
    # Depth first; a label waits on the stack until those that it needs are counted.
    stack = [(0, label)]
    while stack:
        deadline.enforce()
        depth, current = stack[-1]
        key = (depth, frozenset(environments(current)))
        if key in known:
            stack.pop()
        elif not current or 0 in current:
            known[key] = combinations[depth] if current else 0
        else:
            parts = [(depth + 1, restrict(current, fields[depth], 1 << at)) for at in bits(fields[depth])]
            keys = [(deeper, frozenset(environments(part))) for deeper, part in parts]
            missing = [part for part, each in zip(parts, keys, strict=True) if each not in known]
            if missing:
                stack.extend(missing)
            else:
                known[key] = sum(known[each] for each in keys)
    return known[0, frozenset(environments(label))]


def restrict(label: Label, field: Scope, assignment: Environment) -> Label:
    """What is left of a label once a variable has the assigned value."""
    result: Label = {}
    for scope, members in label.items():
        if scope & field:
            members = {one ^ assignment for one in members if one & assignment}  # noqa: PLW2901 - the part that is left
            scope ^= field  # noqa: PLW2901
        if members:
            result[scope] = result[scope] | members if scope in result else members
    return true_label() if 0 in result else result


def models(
    parts: Sequence[tuple[Scope, Label]], vocabulary: Vocabulary, deadline: Deadline
) -> Iterator[Mapping[str, str]]:
    """Every assignment to all variables that entails an environment of each label, once.

    Args:
        parts: labels with the scopes that they are about, which share no variables.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    fields = {variable: vocabulary.field(variable) for variable in vocabulary.variables}
    steps: list[tuple[Scope, Label | None]] = []
    """For each variable its bits and, if it is the first of a part, the label of the part."""
    covered = 0
    for scope, label in parts:
        if not label:
            return
        covered |= scope
        own = [field for field in fields.values() if field & scope]
        steps += [(field, None if at else label) for at, field in enumerate(own)]
    steps += [(field, None if at else true_label()) for at, field in enumerate(fields.values()) if not field & covered]
    stack: list[tuple[int, Environment, Label]] = [(0, 0, true_label())]
    while stack:
        deadline.enforce()
        depth, made, label = stack.pop()
        if depth == len(steps):
            yield dict(vocabulary.decode(made))
            continue
        field, begins = steps[depth]
        current = label if begins is None else begins
        for at in bits(field):
            rest = restrict(current, field, 1 << at)
            if rest:
                stack.append((depth + 1, made | 1 << at, rest))
