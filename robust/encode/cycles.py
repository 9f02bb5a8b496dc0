"""Cycles of a parametric network of lower bounds: every cycle must sum to at most zero if a schedule is to exist."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.encode.interface import Facet
from robust.encode.network import Difference
from robust.encode.variables import Auxiliary, Linear, Range, TimeVariable, constant, least, variable
from robust.plan.model import ParameterReference, TimePoint

Node = TimeVariable | None
"""A free time point; None is the zero point."""


@dataclass(frozen=True, slots=True)
class Edge:
    """`t_target − t_source ≥ weight` between free time points, with the statement that it comes from."""

    source: Node
    target: Node
    weight: Linear
    origin: str


def edge(expression: Linear, origin: str) -> Edge:
    """`expression ≥ 0` with at most two time variables, of opposite sign, as an edge."""
    source: Node = None
    target: Node = None
    weight = constant(-expression.constant_term)
    for unknown, factor in expression.coefficients():
        match unknown:
            case TimeVariable():
                source, target = (unknown, target) if factor < 0 else (source, unknown)
            case ParameterReference() | Auxiliary():
                weight -= variable(unknown).scaled(factor)
    return Edge(source, target, weight, origin)


def facet_of(cycle: Iterable[Edge]) -> Facet:
    """The inequality that a cycle stands for."""
    edges = list(cycle)
    return Facet(-sum((e.weight for e in edges), constant(0)), tuple(dict.fromkeys(e.origin for e in edges)))


def suspicious_cycle(edges: Sequence[Edge], ranges: Mapping[str, Range]) -> list[Edge] | None:
    """A cycle with a positive sum when every edge has its worst weight in the box; None if there is none.

    None proves that every point of the box has a schedule. A cycle need not be positive at any single point, since its
    edges may be at their worst at different ones.
    """
    worst: list[tuple[Edge, Fraction]] = []
    for candidate in edges:
        floor = least(-candidate.weight, ranges)
        if floor is not None:
            worst.append((candidate, -floor))
        elif (back := _path(edges, candidate.target, candidate.source)) is not None:
            return [candidate, *back]
    return _positive_cycle(worst)


def _positive_cycle(edges: Sequence[tuple[Edge, Fraction]]) -> list[Edge] | None:
    """Bellman–Ford from a virtual source to all nodes."""
    nodes = dict.fromkeys(node for e, _ in edges for node in (e.source, e.target))
    distance = dict.fromkeys(nodes, Fraction(0))
    arrival: dict[Node, Edge] = {}
    last: Node = None
    for _ in range(len(nodes) + 1):
        changed = False
        for candidate, weight in edges:
            reached = distance[candidate.source] + weight
            if reached > distance[candidate.target]:
                distance[candidate.target] = reached
                arrival[candidate.target] = candidate
                last, changed = candidate.target, True
        if not changed:
            return None
    for _ in nodes:
        # Walking back as many steps as there are nodes ends on the cycle.
        last = arrival[last].source
    cycle = [arrival[last]]
    while cycle[-1].source != last:
        cycle.append(arrival[cycle[-1].source])
    return cycle


def _path(edges: Sequence[Edge], start: Node, goal: Node) -> list[Edge] | None:
    """Edges from `start` to `goal`, breadth first; empty if they are the same."""
    outgoing: dict[Node, list[Edge]] = defaultdict(list)
    for candidate in edges:
        outgoing[candidate.source].append(candidate)
    arrival: dict[Node, Edge | None] = {start: None}
    queue = [start]
    for node in queue:
        for candidate in outgoing[node]:
            if candidate.target not in arrival:
                arrival[candidate.target] = candidate
                queue.append(candidate.target)
    if goal not in arrival:
        return None
    path = []
    while (step := arrival[goal]) is not None:
        path.append(step)
        goal = step.source
    return path


def simple_cycles(edges: Sequence[Edge], flows: Sequence[Fraction]) -> Iterator[list[Edge]]:
    """Split a circulation into simple cycles."""
    remaining = dict(enumerate(flows))
    while outgoing := {edges[index].source: index for index, flow in remaining.items() if flow > 0}:
        path: list[int] = []
        visited: dict[Node, int] = {}
        node = next(iter(outgoing))
        while node not in visited:
            visited[node] = len(path)
            path.append(outgoing[node])
            node = edges[outgoing[node]].target
        cycle = path[visited[node] :]
        amount = min(remaining[index] for index in cycle)
        for index in cycle:
            remaining[index] -= amount
        yield [edges[index] for index in cycle]


def without_implied(
    differences: Sequence[Difference], facts: Sequence[Difference], weight: Mapping[Difference, Fraction | None]
) -> list[Difference]:
    """Leave out differences of constant weight that a path of the others implies.

    `facts` may support a path but are not part of the result; `weight` is the least value of each difference's weight,
    None if it has none.
    """
    outgoing: dict[TimePoint, dict[Difference, Fraction]] = defaultdict(dict)
    for difference in (*differences, *facts):
        known = weight[difference]
        if known is not None:
            outgoing[difference.source][difference] = known
    kept = []
    for difference in differences:
        if difference.weight.is_constant:
            own = outgoing[difference.source].pop(difference, None)
            if own is None or _is_implied(difference, own, outgoing):
                continue
            outgoing[difference.source][difference] = own
        kept.append(difference)
    return kept


def _is_implied(
    difference: Difference, weight: Fraction, outgoing: Mapping[TimePoint, Mapping[Difference, Fraction]]
) -> bool:
    """Whether some path from source to target is at least as long; gives up on graphs with positive cycles."""
    if difference.source == difference.target:
        return weight <= 0
    distance = {difference.source: Fraction(0)}
    queue = [difference.source]
    for _ in range(8 * len(outgoing) + 8):
        if not queue:
            break
        node = queue.pop(0)
        for step, length in outgoing.get(node, {}).items():
            reached = distance[node] + length
            if step.target not in distance or reached > distance[step.target]:
                if step.target == difference.target and reached >= weight:
                    return True
                distance[step.target] = reached
                if step.target not in queue:
                    queue.append(step.target)
    return False
