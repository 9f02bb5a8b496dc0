"""Schedules of single scenarios: the earliest one, or the constraints that contradict each other.

In one scenario a plan with choices is a simple temporal network [PIKE, Definition 2.5], which has a schedule if and
only if its distance graph has no negative cycle [Dechter, Meiri and Pearl 1991].
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.pike_bridge.environment import Environment, entails
from robust.pike_bridge.model import Constraint, Guard, Tpnu
from robust.pike_bridge.temporal.distance_graph import DistanceGraph, Edge, distance_graph


@dataclass(frozen=True, slots=True)
class Schedule:
    """A time for each event that the scenario activates; the earliest possible, if none is negative."""

    times: Mapping[str, Fraction]


@dataclass(frozen=True, slots=True)
class Step:
    """One side of a constraint: t(target) − t(source) ≤ bound, where the constraint may run the other way."""

    source: str
    target: str
    bound: Fraction
    constraint: Constraint


@dataclass(frozen=True, slots=True)
class NegativeCycle:
    """Steps that lead back to their first event, whose bounds add up to less than zero: they contradict each other."""

    steps: tuple[Step, ...]
    guard: Guard
    """Whenever it holds, all the steps do, so that it is a temporal conflict [PIKE, Definition 4.1]."""

    @property
    def total(self) -> Fraction:
        """The sum of the bounds, which is negative."""
        return sum((step.bound for step in self.steps), Fraction(0))


def schedule(network: Tpnu, scenario: Guard) -> Schedule | NegativeCycle:
    """The earliest schedule of a scenario, or why there is none [PIKE, Definition 2.5].

    For an environment that is no full scenario, what holds in all of it counts: then a schedule says nothing of its
    scenarios, and a negative cycle is one of each of them.

    Raises:
        KeyError: if the scenario has an assignment that the network does not know.
    """
    graph = distance_graph(network)
    environment = graph.vocabulary.encode(scenario)
    found = earliest_times(len(graph.events), graph.active(environment))
    if isinstance(found, Cycle):
        return named_cycle(graph, found)
    return Schedule(
        {
            event: Fraction(time, graph.scale)
            for event, guard, time in zip(graph.events, graph.guards, found, strict=True)
            if entails(environment, guard)
        }
    )


def negative_cycle(network: Tpnu, scenario: Guard) -> NegativeCycle | None:
    """Constraints of a scenario that contradict each other; None if it has a schedule.

    Raises:
        KeyError: if the scenario has an assignment that the network does not know.
    """
    found = schedule(network, scenario)
    return found if isinstance(found, NegativeCycle) else None


@dataclass(frozen=True, slots=True)
class Cycle:
    """Edges that lead in a circle, in order, of negative total weight."""

    edges: tuple[Edge, ...]

    @property
    def label(self) -> Environment:
        """The environment in which all the edges hold."""
        label = 0
        for edge in self.edges:
            label |= edge.label
        return label


def named_cycle(graph: DistanceGraph, cycle: Cycle) -> NegativeCycle:
    """A cycle in the terms of the network."""
    steps = tuple(
        Step(
            graph.events[edge.source],
            graph.events[edge.target],
            Fraction(edge.weight, graph.scale),
            graph.constraints[edge.constraint],
        )
        for edge in cycle.edges
    )
    return NegativeCycle(steps, graph.vocabulary.decode(cycle.label))


def earliest_times(count: int, edges: Iterable[Edge]) -> list[int] | Cycle:
    """The least times, none negative, of `count` events that satisfy all the edges; or a negative cycle.

    Bellman and Ford's algorithm, looking for a circle among the reasons of the times after each round.
    """
    # Seen by its source, an edge is a lower bound: t(source) ≥ t(target) − weight.
    bounds = sorted(edges, key=lambda edge: (edge.source, edge.target))
    times = [0] * count
    reasons: list[Edge | None] = [None] * count
    changed = True
    while changed:
        changed = False
        for edge in bounds:
            time = times[edge.target] - edge.weight
            if time > times[edge.source]:
                times[edge.source] = time
                reasons[edge.source] = edge
                changed = True
        cycle = _circle(reasons)
        if cycle is not None:
            return cycle
    return times


def _circle(reasons: Sequence[Edge | None]) -> Cycle | None:
    """A circle among the edges that gave each event its time; every such circle is negative."""
    visited = [0] * len(reasons)
    for start in range(len(reasons)):
        event = start
        while not visited[event]:
            visited[event] = start + 1
            reason = reasons[event]
            if reason is None:
                break
            event = reason.target
        else:
            if visited[event] == start + 1:
                return _circle_from(event, reasons)
    return None


def _circle_from(start: int, reasons: Sequence[Edge | None]) -> Cycle:
    circle: list[Edge] = []
    event = start
    while (reason := reasons[event]) is not None:
        circle.append(reason)
        event = reason.target
        if event == start:
            break
    return Cycle(tuple(circle))
