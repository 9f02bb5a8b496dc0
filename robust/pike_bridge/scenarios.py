"""Scenarios of a plan with choices: counting them, going through them, and what is left of a plan in some of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Set
from dataclasses import replace
from itertools import product
from math import prod
from typing import TypeAlias, TypeVar

from robust.errors import InputError
from robust.pike_bridge.model import (
    ALWAYS,
    Activity,
    Assignment,
    Choice,
    Condition,
    Constraint,
    Effect,
    Event,
    Guard,
    TeamPlan,
    Tpnu,
    assignments,
    contradicts,
    guard_text,
)

Owned = TypeVar("Owned", Condition, Effect)
Guarded = TypeVar("Guarded", Event, Constraint, Activity, Condition, Effect)


# -- team scenarios --------------------------------------------------------------------------------------------------


def team_scenario_count(network: Tpnu) -> int:
    """How many full assignments there are [PIKE, Definition 2.2]."""
    return prod(len(choice.domain) for choice in network.choices)


def team_scenarios(network: Tpnu, environment: Guard = ALWAYS) -> Iterator[dict[str, str]]:
    """Every full assignment that entails the environment, by the order of values [PIKE, Definition 2.4]."""
    names = [choice.name for choice in network.choices]
    domains = [
        [value for value in choice.domain if not contradicts(frozenset({Assignment(choice.name, value)}), environment)]
        for choice in network.choices
    ]
    for values in product(*domains):
        yield dict(zip(names, values, strict=True))


def active_choices(network: Tpnu, scenario: Mapping[str, str]) -> tuple[Choice, ...]:
    """The choices whose event happens in a scenario."""
    assigned = frozenset(scenario.items())
    guards = network.guards
    return tuple(choice for choice in network.choices if choice.event is None or guards[choice.event] <= assigned)


# -- candidate subplans ----------------------------------------------------------------------------------------------

_Component: TypeAlias = frozenset[tuple[str, Guard]]
"""Choices that depend on one another, each with the guard that is left of its event's."""


def candidate_subplans(network: Tpnu) -> int:
    """How many different sets of decisions there are: assignments to the choices that are active under them.

    For plans that are built from sequences, parallel branches and choices it is the number that [PIKE §6.2.2] defines
    by recursion. Choices that do not depend on one another are counted separately, so that time grows with the nesting
    of choices and not with the number of scenarios; many choices at one level that all decide about a common one are
    the exception.

    Raises:
        InputError: if choices depend on one another in a cycle.
    """
    every = frozenset(_direct(network).items())
    counts: dict[_Component, int] = {}
    branches: dict[_Component, list[list[_Component]]] = {}
    parts = _components(every)
    pending = list(parts)
    while pending:
        component = pending[-1]
        if component in counts:
            pending.pop()
            continue
        if component not in branches:
            branches[component] = _branches(component, network.domains)
        missing = [part for branch in branches[component] for part in branch if part not in counts]
        pending.extend(missing)
        if not missing:
            counts[component] = sum(prod(counts[part] for part in branch) for branch in branches[component])
    return prod(counts[part] for part in parts)


def _direct(network: Tpnu) -> dict[str, Guard]:
    """For each choice, what its event needs, without what the choices needed need themselves."""
    guards = network.guards
    needs = {one.name: ALWAYS if one.event is None else guards[one.event] for one in network.choices}
    return {
        name: guard - frozenset[Assignment]().union(*(needs[variable] for variable, _ in guard if variable != name))
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
        group, pending = set(), [next(iter(neighbours))]
        while pending:
            name = pending.pop()
            if name not in group:
                group.add(name)
                pending.extend(neighbours.pop(name))
        groups.append(frozenset((name, guards[name]) for name in group))
    return groups


def _supported(guards: dict[str, Guard]) -> dict[str, Guard]:
    """Without the choices that mention a missing one, or one that is left out itself."""
    mentioning: dict[str, list[str]] = {}
    for name, guard in guards.items():
        for variable, _ in guard:
            mentioning.setdefault(variable, []).append(name)
    missing = {variable for variable in mentioning if variable not in guards}
    pending = list(missing)
    while pending:
        for name in mentioning.get(pending.pop(), ()):
            if name not in missing:
                missing.add(name)
                pending.append(name)
    return {name: guard for name, guard in guards.items() if name not in missing}


# -- restriction -----------------------------------------------------------------------------------------------------


def restrict_network(network: Tpnu, environment: Guard) -> Tpnu:
    """The network in the scenarios of an environment: what contradicts it is gone, and what it decides is not asked.

    Raises:
        InputError: if the environment has two values of one choice.
    """
    return _Restriction(environment).network(network)


def restrict(plan: TeamPlan, environment: Guard) -> TeamPlan:
    """The plan in the scenarios of an environment, as :func:`restrict_network` restricts its network.

    Raises:
        InputError: if the environment has two values of one choice.
    """
    restriction = _Restriction(environment)
    kept = [at for at, activity in enumerate(plan.network.activities) if restriction.keeps(activity.guard)]
    places: dict[int | None, int | None] = {None: None, **{before: after for after, before in enumerate(kept)}}

    def moved(items: tuple[Owned, ...]) -> tuple[Owned, ...]:
        """With the new places of their activities; what is of an activity that is gone goes with it."""
        there = (one for one in restriction.parts(items) if one.activity in places)
        return tuple(replace(one, activity=places[one.activity]) for one in there)

    conditions, effects = moved(plan.conditions), moved(plan.effects)
    mentioned = {variable for variable, _ in assignments(_guards(conditions) + _guards(effects))}
    return replace(plan, network=restriction.network(plan.network, mentioned), conditions=conditions, effects=effects)


def _guards(items: tuple[Guarded, ...]) -> list[Guard]:
    return [one.guard for one in items]


class _Restriction:
    def __init__(self, environment: Guard) -> None:
        if len({variable for variable, _ in environment}) < len(environment):
            raise InputError(f"found two values of one choice in {{{guard_text(environment)}}}, expected one")
        self._environment = environment

    def keeps(self, guard: Guard) -> bool:
        return not contradicts(self._environment, guard)

    def parts(self, parts: tuple[Guarded, ...]) -> tuple[Guarded, ...]:
        """Those that are left, with what is left of their guards."""
        return tuple(replace(one, guard=one.guard - self._environment) for one in parts if self.keeps(one.guard))

    def network(self, network: Tpnu, mentioned: Set[str] = frozenset()) -> Tpnu:
        """What is left of a network; choices in `mentioned` stay although their event may be gone."""
        events, constraints = self.parts(network.events), self.parts(network.constraints)
        activities = self.parts(network.activities)
        guards = _guards(events) + _guards(constraints) + _guards(activities)
        used = {variable for variable, _ in assignments(guards)} | mentioned
        choices = self._choices(network.choices, {event.name for event in events}, used)
        return replace(network, choices=choices, events=events, constraints=constraints, activities=activities)

    def _choices(self, choices: tuple[Choice, ...], events: set[str], used: set[str]) -> tuple[Choice, ...]:
        """The open choices; one whose event is gone stays only if something still depends on it."""
        decided = {variable for variable, _ in self._environment}
        left = []
        for choice in choices:
            if choice.name in decided:
                continue
            if choice.event is None or choice.event in events:
                left.append(choice)
            elif choice.name in used:
                left.append(replace(choice, event=None))
        return tuple(left)
