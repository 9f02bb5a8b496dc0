"""Which variables constraints have in common: independent groups, and orders of variables for decision diagrams."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from heapq import heapify, heappop, heappush
from typing import Final, TypeVar

from robust.pike_bridge.knowledge.interface import OutOfSpaceError

T = TypeVar("T")

ROUNDS = 40
"""Of the FORCE heuristic."""
FIRST_TRY: Final = 500_000
"""The space that each order gets in the first round of a race."""
MORE: Final = 4
"""Times as much in each further round."""


def race(
    variables: Sequence[str],
    groups: Sequence[Collection[str]],
    largest: int,
    compile_in: Callable[[Sequence[str], int], T],
) -> T:
    """What is compiled in the first of two orders that needs little space: each is given some, and more in each round.

    Elimination is better for plans, whose supports depend on few choices; FORCE is better for constraints in a row.

    Args:
        groups: the variables of each constraint.
        compile_in: compiles in an order and a space; OutOfSpaceError if that is too small.

    Raises:
        OutOfSpaceError: if both orders need more than the largest space.
    """
    orders = (elimination_order(variables, groups), force_order(variables, groups))
    space = min(FIRST_TRY, largest)
    while True:
        for order in orders:
            try:
                return compile_in(order, space)
            except OutOfSpaceError:
                continue
        if space == largest:
            raise OutOfSpaceError
        space = min(MORE * space, largest)


def connected(items: Iterable[T], about: Callable[[T], frozenset[int]]) -> list[list[T]]:
    """Groups of items that share variables, directly or through others; what has none is a group of its own."""
    groups: list[tuple[frozenset[int], list[T]]] = []
    for item in items:
        variables, members = about(item), [item]
        apart = []
        for known, others in groups:
            if known & variables:
                variables, members = variables | known, others + members
            else:
                apart.append((known, others))
        groups = [*apart, (variables, members)]
    return [members for _, members in groups]


def elimination_order(variables: Sequence[str], groups: Sequence[Collection[str]]) -> list[str]:
    """Each variable as soon after those that decide about it as they allow.

    Variables are eliminated, that with the fewest neighbours first, of equals the last one; its neighbours become
    neighbours of each other. Of these, the one that is eliminated next is its parent. The order lists each variable
    before its children, small subtrees first: what is below a variable depends on its ancestors only (the pseudo-trees
    of Freuder and Quinn, 1985). Choices have many neighbours, and the supports of a condition few, so that these follow
    the last choice that they hang on.
    """
    place = {variable: at for at, variable in enumerate(variables)}
    graph: dict[str, set[str]] = {variable: set() for variable in variables}
    for group in groups:
        for variable in group:
            graph[variable].update(group)
    for variable, neighbours in graph.items():
        neighbours.discard(variable)
    queue = [(len(neighbours), -place[variable], variable) for variable, neighbours in graph.items()]
    heapify(queue)
    eliminated: dict[str, set[str]] = {}
    while queue:
        count, _, variable = heappop(queue)
        if variable in eliminated or count != len(graph[variable]):
            continue  # an earlier state of it
        neighbours = eliminated[variable] = graph.pop(variable)
        for other in neighbours:
            graph[other] |= neighbours
            graph[other] -= {variable, other}
            heappush(queue, (len(graph[other]), -place[other], other))
    return _parents_first(eliminated, place)


def _parents_first(eliminated: dict[str, set[str]], place: dict[str, int]) -> list[str]:
    """The variables of a forest; the parent of each is the first to be eliminated of its given neighbours."""
    when = {variable: at for at, variable in enumerate(eliminated)}
    children: dict[str | None, list[str]] = {}
    weight = dict.fromkeys(eliminated, 1)
    for variable, neighbours in eliminated.items():
        parent = min(neighbours, key=when.__getitem__, default=None)
        children.setdefault(parent, []).append(variable)
        if parent is not None:
            weight[parent] += weight[variable]
    order: list[str] = []
    stack: list[str | None] = [None]
    while stack:
        one = stack.pop()
        if one is not None:
            order.append(one)
        stack += sorted(children.get(one, ()), key=lambda child: (-weight[child], -place[child]))
    return order


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
