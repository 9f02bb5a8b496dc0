"""Conditional networks of other tools (CSTN, CSTNU, CCTP) as plans with choices: observations are choices of people.

A contingent link is an activity, and a label is a guard. Where its end can happen without it, the activity has an end
of its own, at the same time. A literal about a proposition says as well that its time point
exists, and a link that its two ends do; what can never hold goes. Everything happens at the origin or after it.
"""

import os
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path

from robust.errors import InputError, Location, UnsupportedError
from robust.numbers import shorten
from robust.pike_bridge import model
from robust.pike_bridge.action_model import load_team_plan, with_ends
from robust.stnu.files import read
from robust.stnu.network import ChoicePoint, ConditionalNetwork, Label, Network

_SUFFIXES = (".cstn", ".cstnu", ".stn", ".stnu", ".cctp", ".graphml", ".xml")
"""Of files that hold networks, and no plan with choices."""


def read_any(path: str | os.PathLike[str], *, epsilon: Fraction = model.EPSILON) -> model.TeamPlan:
    """A plan with choices: a `.tpnu.json` file with its domain and problem, or a file with a network, by its suffix.

    Raises:
        InputError: with the place, if a file cannot be read, is wrong, or does not fit the others.
        UnsupportedError: if a plan needs more than conjunctions of literals, or a contingent link may end before it
            starts.
    """
    if isinstance(path, str | os.PathLike) and Path(path).suffix.lower() in _SUFFIXES:
        return read_conditional(path, epsilon)
    return load_team_plan(path, epsilon=epsilon)


def read_conditional(path: str | os.PathLike[str], epsilon: Fraction = model.EPSILON) -> model.TeamPlan:
    """The plan that a file with a network is, whether or not it has choices.

    Raises:
        InputError: at the place of whatever is wrong in it.
        UnsupportedError: for a contingent link that may end before it starts.
    """
    network = read(path)
    if isinstance(network, Network):
        links = tuple((link, Label()) for link in network.links)
        nodes = dict.fromkeys(network.nodes, Label())
        network = ConditionalNetwork(network.name, nodes, links, (), network.origin)
    return plan_of_network(network, epsilon)


def plan_of_network(network: ConditionalNetwork, epsilon: Fraction = model.EPSILON) -> model.TeamPlan:
    """A network as a plan without conditions and effects.

    Raises:
        InputError: if a link ends at the origin or choices depend on each other in a circle.
        UnsupportedError: for a contingent link that may end before it starts.
    """
    for name in network.nodes.keys() & {model.INITIAL, model.GOAL}:
        raise InputError(f"found a time point called {name}, expected another name", Location(network.name))
    known = {choice.name: choice for choice in network.choices}
    guards: dict[str, model.Guard] = {}
    for name, label in network.nodes.items():
        guard = _whole(label, network.nodes, known)
        if guard is not None:
            guards[name] = guard
    constraints, activities = [], []
    for link, label in network.links:
        joint = frozenset[tuple[str, str]]().union(label, network.nodes[link.source], network.nodes[link.target])
        guard = _whole(joint, network.nodes, known)
        if guard is None:
            continue
        if not link.is_contingent:
            constraints.append(model.Constraint(link.source, link.target, link.lower, link.upper, guard))
            continue
        if link.lower is None or link.lower < 0:
            message = f"found contingent link {link}, expected one that ends after it starts"
            raise UnsupportedError(message, link.place or Location(network.name))
        target = link.target
        if guards.get(target) != guard:
            target = f"end of ({link.ends})"
            while target in guards:
                target += "'"
            guards[target] = guard
            constraints.append(model.Constraint(target, link.target, Fraction(0), Fraction(0), guard))
        activities.append(
            model.Activity(f"({link.ends})", link.source, target, link.lower, link.upper, "nature", guard, link.place)
        )
    if network.origin is not None:
        after = (name for name in guards if name != network.origin)
        constraints += [model.Constraint(network.origin, name, Fraction(0), None, guards[name]) for name in after]
    choices = tuple(
        model.Choice(choice.name, choice.values, choice.is_controllable, choice.node)
        for choice in network.choices
        if choice.node in guards
    )
    events = tuple(model.Event(name, guard) for name, guard in guards.items())
    whole = model.Tpnu(network.name, choices, events, tuple(constraints), tuple(activities))
    return model.TeamPlan(with_ends(whole, Fraction(0)), (), (), epsilon)


def _whole(label: Label, nodes: Mapping[str, Label], known: Mapping[str, ChoicePoint]) -> model.Guard | None:
    """A label with those of the time points where its choices are made; None if it can never hold."""
    values, pending = dict[str, str](), list(label)
    while pending:
        name, value = pending.pop()
        if name not in known:
            raise InputError(f"found unknown choice {shorten(name)}, expected one of the network")
        if name not in values:
            pending += nodes[known[name].node]
        if values.setdefault(name, value) != value:
            return None
    return frozenset(model.Assignment(name, value) for name, value in values.items())
