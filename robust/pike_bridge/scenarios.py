"""Scenarios of a plan with choices: counting them, going through them, and what is left of a plan in some of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, product
from math import prod
from typing import TypeAlias, TypeVar

from robust.errors import InputError
from robust.pike_bridge import model
from robust.pike_bridge.theory import evaluate
from robust.smt.limits import NEVER

Owned = TypeVar("Owned", model.Condition, model.Effect)
Guarded = TypeVar("Guarded", model.Event, model.Constraint, model.Activity, model.Condition, model.Effect)


# -- team scenarios --------------------------------------------------------------------------------------------------


def team_scenarios(network: model.Tpnu, environment: model.Guard = model.ALWAYS) -> Iterator[dict[str, str]]:
    """Every full assignment that entails the environment, by the order of values [PIKE, Definition 2.4]."""
    names = [choice.name for choice in network.choices]
    domains = [
        [
            value
            for value in choice.domain
            if not model.contradicts(frozenset({model.Assignment(choice.name, value)}), environment)
        ]
        for choice in network.choices
    ]
    for values in product(*domains):
        yield dict(zip(names, values, strict=True))


# -- candidate subplans ----------------------------------------------------------------------------------------------

_Component: TypeAlias = frozenset[tuple[str, model.Guard]]
"""Choices that depend on one another, each with the guard that is left of its event's."""


def candidate_subplans(network: model.Tpnu) -> int:
    """How many different sets of decisions there are: assignments to the choices that are active under them.

    For plans that are built from sequences, parallel branches and choices it is the number that [PIKE §6.2.2] defines
    by recursion. Choices that do not depend on one another are counted separately, so that time grows with the nesting
    of choices and not with the number of scenarios; many choices at one level that all decide about a common one are
    the exception.

    Raises:
        InputError: if choices depend on one another in a cycle.
    """
    counts: dict[_Component, int] = {}
    branches: dict[_Component, list[list[_Component]]] = {}

    def step(component: _Component) -> int | list[_Component]:
        if component not in branches:
            branches[component] = _branches(component, network.domains)
        missing = [part for branch in branches[component] for part in branch if part not in counts]
        return missing or sum(prod(counts[part] for part in branch) for branch in branches[component])

    parts = _components(frozenset(_direct(network).items()))
    return prod(evaluate(part, counts, step, NEVER) for part in parts)


def _direct(network: model.Tpnu) -> dict[str, model.Guard]:
    """For each choice, what its event needs, without what the choices needed need themselves."""
    guards = network.guards
    needs = {one.name: model.ALWAYS if one.event is None else guards[one.event] for one in network.choices}
    return {
        name: guard
        - frozenset[model.Assignment]().union(*(needs[variable] for variable, _ in guard if variable != name))
        for name, guard in needs.items()
    }


def _branches(component: _Component, domains: Mapping[str, tuple[str, ...]]) -> list[list[_Component]]:
    """For each value of one choice that is certainly made: what is left, in parts that do not depend on one another."""
    mentions = Counter(variable for _, guard in component for variable, _ in guard)
    roots = [name for name, guard in component if not guard]
    if not roots:
        names = ", ".join(sorted(name for name, _ in component))
        raise InputError(f"found choices that depend on one another in a cycle: {names}; expected none")
    root = max(roots, key=lambda name: (mentions[name], name))
    branches = []
    for value in domains[root]:
        left = [
            (name, frozenset(one for one in guard if one.variable != root))
            for name, guard in component
            if name != root and all(one.value == value for one in guard if one.variable == root)
        ]
        branches.append(_components(frozenset(left)))
    return branches


def _components(choices: _Component) -> list[_Component]:
    """Choices in groups; those of different groups do not depend on one another.

    A choice that mentions one that is not there, because that is inactive, is inactive itself.
    """
    guards = _supported(dict(choices))
    neighbours: dict[str, set[str]] = {name: set() for name in guards}
    for name, guard in guards.items():
        for variable, _ in guard:
            neighbours[name].add(variable)
            neighbours[variable].add(name)
    groups = []
    while neighbours:
        group = model.reachable(neighbours, next(iter(neighbours)))
        groups.append(frozenset((name, guards[name]) for name in group))
        neighbours = {name: others for name, others in neighbours.items() if name not in group}
    return groups


def _supported(guards: dict[str, model.Guard]) -> dict[str, model.Guard]:
    """Without the choices that mention a missing one, or one that is left out itself."""
    while missing := {
        name for name, guard in guards.items() if not {variable for variable, _ in guard} <= guards.keys()
    }:
        guards = {name: guard for name, guard in guards.items() if name not in missing}
    return guards


# -- restriction -----------------------------------------------------------------------------------------------------


def moved(parts: Iterable[Owned], kept: Sequence[int]) -> tuple[Owned, ...]:
    """What belongs to activities that are kept, or to none, with the places that these have then."""
    places: dict[int | None, int | None] = {None: None, **{before: after for after, before in enumerate(kept)}}
    return tuple(replace(each, activity=places[each.activity]) for each in parts if each.activity in places)


def restrict(plan: model.TeamPlan, environment: model.Guard) -> model.TeamPlan:
    """The plan in the scenarios of an environment: what contradicts it is gone, and what it decides is not asked.

    A choice whose event is gone stays only if something still depends on it.

    Raises:
        InputError: if the environment has two values of one choice.
    """
    if len(dict(environment)) < len(environment):
        raise InputError(f"found two values of one choice in {{{model.guard_text(environment)}}}, expected one")

    def left(parts: Iterable[Guarded]) -> tuple[Guarded, ...]:
        """Those that can still be activated, with what is left of their guards."""
        kept = (one for one in parts if not model.contradicts(environment, one.guard))
        return tuple(replace(one, guard=one.guard - environment) for one in kept)

    network = plan.network
    kept = [at for at, activity in enumerate(network.activities) if not model.contradicts(environment, activity.guard)]
    events, constraints, activities = left(network.events), left(network.constraints), left(network.activities)
    conditions, effects = moved(left(plan.conditions), kept), moved(left(plan.effects), kept)
    guarded: Iterable[model.Event | model.Constraint | model.Activity | model.Condition | model.Effect] = chain(
        events, constraints, activities, conditions, effects
    )
    used, decided = {variable for one in guarded for variable, _ in one.guard}, {name for name, _ in environment}
    happening = {None, *(event.name for event in events)}
    choices = tuple(
        choice if choice.event in happening else replace(choice, event=None)
        for choice in network.choices
        if choice.name not in decided and (choice.event in happening or choice.name in used)
    )
    whole = replace(network, choices=choices, events=events, constraints=constraints, activities=activities)
    return replace(plan, network=whole, conditions=conditions, effects=effects)
