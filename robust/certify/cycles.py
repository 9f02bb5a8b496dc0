"""Constraints of the network that leave no schedule: circles whose least lengths add up to more than zero."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from robust.certify.ground import GroundPlan, Line
from robust.encode.variables import Linear, constant

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
