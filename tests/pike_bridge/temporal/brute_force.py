"""Temporal reasoning one scenario at a time, by the definitions: what the algorithms under test must agree with."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import product

from robust.pike_bridge.model import Assignment, Constraint, Guard, Tpnu
from robust.pike_bridge.temporal.distance_graph import Precedence

Distances = dict[tuple[str, str], Fraction]


def scenarios(network: Tpnu, environment: Guard = frozenset()) -> Iterator[Guard]:
    """Every full assignment to the choices that extends an environment."""
    for values in product(*(choice.domain for choice in network.choices)):
        scenario = frozenset(
            Assignment(choice.name, value) for choice, value in zip(network.choices, values, strict=True)
        )
        if environment <= scenario:
            yield scenario


def environments(network: Tpnu) -> Iterator[Guard]:
    """Every partial assignment to the choices."""
    for values in product(*((None, *choice.domain) for choice in network.choices)):
        yield frozenset(
            Assignment(choice.name, value)
            for choice, value in zip(network.choices, values, strict=True)
            if value is not None
        )


def holding(network: Tpnu, scenario: Guard) -> list[Constraint]:
    """The constraints that a scenario activates."""
    return [entry for entry in network.temporal_constraints if entry.guard <= scenario]


def distances(network: Tpnu, scenario: Guard) -> Distances | None:
    """Shortest paths between activated events by Floyd and Warshall; None if there is a negative cycle."""
    names = [event.name for event in network.events if event.guard <= scenario]
    shortest: Distances = {(name, name): Fraction(0) for name in names}

    def improve(source: str, target: str, length: Fraction) -> None:
        if (source, target) not in shortest or length < shortest[source, target]:
            shortest[source, target] = length

    for entry in holding(network, scenario):
        if entry.upper is not None:
            improve(entry.source, entry.target, entry.upper)
        if entry.lower is not None:
            improve(entry.target, entry.source, -entry.lower)
    for middle, source, target in product(names, names, names):
        if (source, middle) in shortest and (middle, target) in shortest:
            improve(source, target, shortest[source, middle] + shortest[middle, target])
    return None if any(shortest[name, name] < 0 for name in names) else shortest


def check_precedence(network: Tpnu, found: Precedence, *, complete: bool) -> None:
    """Whatever is claimed to precede does so in every scenario with a schedule; the reverse, too, if complete."""
    table = {scenario: distances(network, scenario) for scenario in scenarios(network)}
    for context, first, second in product(environments(network), network.events, network.events):
        whole = context | first.guard | second.guard
        shortest = [entry for scenario, entry in table.items() if entry is not None and whole <= scenario]
        gaps = [entry.get((second.name, first.name)) for entry in shortest]
        holds = all(gap is not None and gap < 0 for gap in gaps)
        claimed = found.precedes(first.name, second.name, found.vocabulary.encode(context))
        assert holds or not claimed
        assert not complete or claimed == (holds and bool(gaps))
