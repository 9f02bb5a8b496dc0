"""A static order of variables in which those that occur together are close to each other."""

from __future__ import annotations

from collections.abc import Collection, Sequence

ROUNDS = 40


def force_order(variables: Sequence[str], groups: Sequence[Collection[str]]) -> list[str]:
    """An order that keeps each group within a small span.

    The FORCE heuristic (Aloul, Markov and Sakallah, 2003): move each variable to the mean of the centres of its groups,
    sort, and repeat; the order with the least sum of spans is the result.
    """
    order = list(variables)
    best, least = order, _spans(order, groups)
    by_variable: dict[str, list[int]] = {variable: [] for variable in variables}
    for index, group in enumerate(groups):
        for variable in group:
            by_variable[variable].append(index)
    for _ in range(ROUNDS):
        place = {variable: at for at, variable in enumerate(order)}
        centres = [sum(place[variable] for variable in group) / len(group) if group else 0.0 for group in groups]
        target = {
            variable: sum(centres[index] for index in indices) / len(indices) if indices else float(place[variable])
            for variable, indices in by_variable.items()
        }
        order = sorted(order, key=lambda variable: (target[variable], place[variable]))
        total = _spans(order, groups)
        if total >= least:
            break
        best, least = order, total
    return best


def _spans(order: Sequence[str], groups: Sequence[Collection[str]]) -> int:
    place = {variable: at for at, variable in enumerate(order)}
    return sum(max(map(place.__getitem__, group)) - min(map(place.__getitem__, group)) for group in groups if group)
