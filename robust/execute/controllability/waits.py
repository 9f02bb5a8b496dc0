"""The strategy behind dynamic controllability, for people and dispatchers: who waits for whom, and how long."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

from robust.execute.controllability.dynamic import Case, DynamicAnswer, Edge
from robust.execute.controllability.stnu import ContingentLink
from robust.plan.model import TimePoint
from robust.plan.numerals import format_number


@dataclass(frozen=True, slots=True)
class Wait:
    """A time point waits until `delay` after `activation`, or until `end` has happened, whichever comes first.

    A delay of None waits for the end however long it takes.
    """

    point: TimePoint
    activation: TimePoint
    delay: Fraction | None
    end: TimePoint

    def __str__(self) -> str:
        if self.delay is None:
            return f"{self.point} waits for {self.end}"
        return f"{self.point} waits for {self.end}, at most {format_number(self.delay)} after {self.activation}"


def waits(answer: DynamicAnswer) -> tuple[Wait, ...]:
    """The conditional waits with which a dispatcher satisfies a controllable network, in the order of its time points.

    Waits that the others and the requirements imply are left out: what comes after another time point need not say that
    it waits as long, and what comes after the end of a link waits for it anyway.
    """
    form = answer.form
    points, executable = form.stnu.points, set(form.stnu.executable)
    every = [edge for edge in (*form.edges, *answer.derived) if edge.case is not Case.LOWER]
    distance = _distances(form.size, [edge for edge in every if edge.case is Case.ORDINARY])
    link_of = {node: form.stnu.links[index] for index, node in form.start.items()}
    found = []
    for start, link in link_of.items():
        waiting = {edge.source: edge.weight for edge in every if edge.case is Case.UPPER and edge.target == start}
        for edge in every:
            if edge.case is Case.UPPER and edge.target == start:
                waiting[edge.source] = min(edge.weight, waiting[edge.source])
        for node in sorted(waiting, key=lambda node: -node):
            if node >= len(points) or points[node] not in executable:
                continue
            if _is_implied(node, start, waiting, distance):
                del waiting[node]
            elif isinstance(link, ContingentLink):
                length = form.length(waiting[node])
                delay = None if length is None else link.lower - length
                found.append(Wait(points[node], link.source, delay, link.target))
    return tuple(sorted(found, key=lambda wait: (points.index(wait.point), points.index(wait.end))))


def _is_implied(node: int, start: int, waiting: dict[int, int], distance: list[list[int | None]]) -> bool:
    row, weight = distance[node], waiting[node]
    without = row[start]
    if without is not None and without <= weight:
        return True
    others = ((row[other], beyond) for other, beyond in waiting.items() if other != node)
    # Only what happens before the time point has waited when the time point looks.
    return any(before is not None and before <= 0 and before + beyond <= weight for before, beyond in others)


def _distances(size: int, edges: Iterable[Edge]) -> list[list[int | None]]:
    """Shortest paths between all nodes; None where there is none."""
    table: list[list[int | None]] = [[0 if a == b else None for b in range(size)] for a in range(size)]
    for edge in edges:
        known = table[edge.source][edge.target]
        table[edge.source][edge.target] = edge.weight if known is None else min(known, edge.weight)
    for middle, after in enumerate(table):
        reached = [(b, weight) for b, weight in enumerate(after) if weight is not None]
        for row in table:
            first = row[middle]
            if first is not None:
                for b, weight in reached:
                    known = row[b]
                    if known is None or first + weight < known:
                        row[b] = first + weight
    return table
