"""The labeled distance graph of a plan with choices [PIKE §4.1], with integer weights.

Both sides of each temporal constraint become edges: an edge from i to j with weight w and label φ says that
t(j) − t(i) ≤ w whenever φ holds. The bounds are multiplied by their least common denominator, so that everything that
computes with distances does so exactly and in integers.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import NamedTuple

from robust.pike_bridge.environment import Environment, Vocabulary, entails
from robust.pike_bridge.model import Constraint, Tpnu


class Edge(NamedTuple):
    """t(target) − t(source) ≤ weight in every scenario of the label; events and constraints by their places."""

    source: int
    target: int
    weight: int
    label: Environment
    constraint: int
    """The place in `Tpnu.temporal_constraints` of the constraint that says so."""


@dataclass(frozen=True, slots=True)
class DistanceGraph:
    """Edges between the places of events, over the environments of `vocabulary`."""

    vocabulary: Vocabulary
    events: tuple[str, ...]
    guards: tuple[Environment, ...]
    """The guard of each event, by place."""
    constraints: tuple[Constraint, ...]
    edges: tuple[Edge, ...]
    scale: int
    """How many units of weight are one unit of time."""

    @property
    def places(self) -> dict[str, int]:
        """The place of each event by its name."""
        return {event: place for place, event in enumerate(self.events)}

    def active(self, environment: Environment) -> list[Edge]:
        """The edges that hold in all of the environment."""
        return [edge for edge in self.edges if entails(environment, edge.label)]


def distance_graph(network: Tpnu) -> DistanceGraph:
    """The labeled distance graph of a network [PIKE §4.1].

    The label of an edge is the guard of its constraint together with those of its two events, which guards of
    constraints entail anyway [PIKE, Definition 2.1]. Edges whose label contradicts itself never hold and are left out.
    """
    vocabulary = Vocabulary(network.domains)
    places = {event.name: place for place, event in enumerate(network.events)}
    guards = tuple(vocabulary.encode(event.guard) for event in network.events)
    constraints = network.temporal_constraints
    bounds = [bound for entry in constraints for bound in (entry.lower, entry.upper) if bound is not None]
    scale = lcm(*(bound.denominator for bound in bounds))
    edges: list[Edge] = []
    for number, entry in enumerate(constraints):
        source, target = places[entry.source], places[entry.target]
        label = vocabulary.encode(entry.guard) | guards[source] | guards[target]
        if not vocabulary.consistent(label):
            continue
        if entry.upper is not None:
            edges.append(Edge(source, target, _scaled(entry.upper, scale), label, number))
        if entry.lower is not None:
            edges.append(Edge(target, source, _scaled(-entry.lower, scale), label, number))
    events = tuple(event.name for event in network.events)
    return DistanceGraph(vocabulary, events, guards, constraints, tuple(edges), scale)


def _scaled(bound: Fraction, scale: int) -> int:
    return bound.numerator * (scale // bound.denominator)
