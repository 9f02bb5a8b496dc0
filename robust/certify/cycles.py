"""Paths of the network: circles that leave no schedule, because their least lengths add up to more than zero, and paths
that keep two time points apart all over a box."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from robust.certify.ground import GroundPlan, Line
from robust.encode.variables import Linear, Range, constant, least

Point = Mapping[str, Fraction]
Step = int | Line
"""The number of a constraint, or, in a list, a time point: no time is negative."""


def length_of(ground: GroundPlan, steps: Sequence[Step], point: Point) -> Fraction:
    """What the constraints add up to at one point of parameter space."""
    total = cycle_sum(ground, steps)
    return total.evaluate({unknown: point[str(unknown)] for unknown in total.variables})


def cycle_sum(ground: GroundPlan, steps: Sequence[Step]) -> Linear:
    """What the constraints add up to, over the parameters."""
    return sum((_edge(ground, step)[2] for step in steps), constant(0))


def _edge(ground: GroundPlan, step: Step) -> tuple[int, int, Linear]:
    """Source, target and least length."""
    return (0, step[0], constant(0)) if isinstance(step, list) else ground.edges[step]


def positive_cycle(ground: GroundPlan, point: Point) -> list[Step] | None:
    """Bellman–Ford over all time points at one point of parameter space; None if there is a schedule."""
    steps: list[Step] = [[target] for target in ground.places if target]
    steps += range(len(ground.edges))
    edges = [(*_edge(ground, step)[:2], length_of(ground, [step], point), step) for step in steps]
    distance = dict.fromkeys(ground.places, Fraction(0))
    arrival: dict[int, tuple[int, Step]] = {}
    last: int | None = None
    for _ in range(len(distance) + 1):
        last = None
        for source, target, length, step in edges:
            if distance[source] + length > distance[target]:
                distance[target] = distance[source] + length
                arrival[target], last = (source, step), target
        if last is None:
            return None
    for _ in distance:
        last = arrival[last if last is not None else 0][0]
    first, cycle = last, list[Step]()
    while not cycle or last != first:
        source, step = arrival[last if last is not None else 0]
        cycle.append(step)
        last = source
    return cycle[::-1]


class LongestPaths:
    """Constraints that keep time points apart for all values in a box, each constraint at its worst.

    Args:
        ground: the plan.
        ranges: the box.
    """

    def __init__(self, ground: GroundPlan, ranges: Mapping[str, Range]) -> None:
        self._ground = ground
        floors = ((source, target, least(length, ranges)) for source, target, length in ground.edges)
        self._edges = [(source, target, floor, step) for step, (source, target, floor) in enumerate(floors)]
        self._found: dict[int, tuple[dict[int, Fraction], dict[int, tuple[int, int]]]] = {}

    def between(self, source: int, target: int, distance: Fraction) -> list[int] | None:
        """The numbers of constraints from one time point to another that add up to at least a distance, if any do."""
        if source not in self._found:
            self._found[source] = self._from(source)
        reached, arrival = self._found[source]
        if target not in reached or reached[target] < distance:
            return None
        steps: list[int] = []
        while target != source and len(steps) <= len(self._edges):
            target, step = arrival[target]
            steps.append(step)
        return steps[::-1]

    def _from(self, source: int) -> tuple[dict[int, Fraction], dict[int, tuple[int, int]]]:
        """Bellman–Ford: distances and the last steps towards each time point."""
        reached = {source: Fraction(0)}
        arrival: dict[int, tuple[int, int]] = {}
        for _ in self._ground.places:
            changed = False
            for start, end, floor, step in self._edges:
                if floor is None or start not in reached or end == source:
                    continue
                distance = reached[start] + floor
                if end not in reached or distance > reached[end]:
                    reached[end], arrival[end], changed = distance, (start, step), True
            if not changed:
                break
        return reached, arrival
