"""Whether a scenario admits a correct execution, by trying every weak order of its events; for tests only."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import combinations
from types import MappingProxyType

from robust.pike_bridge.model import Condition, TeamPlan
from tests.pike_bridge.networks import Stn, candidate_subplan, holds, scenarios

NO_TIMES: Mapping[str, Fraction] = MappingProxyType({})


def correct_scenarios(plan: TeamPlan) -> set[frozenset[tuple[str, str]]]:
    """The team scenarios that admit a correct execution."""
    return {
        frozenset(scenario.items())
        for scenario in scenarios(plan.network.domains)
        if admits_correct_execution(plan, scenario)
    }


def admits_correct_execution(plan: TeamPlan, scenario: Mapping[str, str]) -> bool:
    return next(correct_orders(plan, scenario), None) is not None


def correct_orders(
    plan: TeamPlan, scenario: Mapping[str, str], fixed: Mapping[str, Fraction] = NO_TIMES
) -> Iterator[Stn]:
    """The network of the scenario under each weak order of its events that meets all conditions."""
    conditions = [condition for condition in plan.conditions if holds(condition.guard, scenario)]
    for ranks, ordered in weak_orders(plan, scenario, fixed):
        if all(is_met(plan, scenario, condition, ranks) for condition in conditions):
            yield ordered


def weak_orders(
    plan: TeamPlan, scenario: Mapping[str, str], fixed: Mapping[str, Fraction] = NO_TIMES
) -> Iterator[tuple[dict[str, int], Stn]]:
    """Each consistent weak order of the events that have effects or conditions, with the network that it leaves.

    Some events may have fixed times; all of them must be activated.
    """
    subplan = candidate_subplan(plan.network, scenario).at_times(fixed)
    if subplan.consistent:
        conditions = [condition for condition in plan.conditions if holds(condition.guard, scenario)]
        mentioned = {event for each in conditions for event in (each.first, each.last)}
        mentioned |= {effect.event for effect in plan.effects if holds(effect.guard, scenario)}
        yield from _weak_orders(frozenset(mentioned), {}, frozenset(), subplan)


def _weak_orders(
    left: frozenset[str], ranks: dict[str, int], latest: frozenset[str], stn: Stn
) -> Iterator[tuple[dict[str, int], Stn]]:
    if not left:
        yield ranks, stn
        return
    rank = max(ranks.values(), default=0) + 1
    for size in range(1, len(left) + 1):
        for block in combinations(sorted(left), size):
            ordered = stn.copy()
            for event in block:
                ordered.same(block[0], event)
            for event in latest:
                ordered.strictly(event, block[0])
            if ordered.consistent:
                now = ranks | dict.fromkeys(block, rank)
                yield from _weak_orders(left - set(block), now, frozenset(block), ordered)


def is_met(
    plan: TeamPlan, scenario: Mapping[str, str], condition: Condition, times: Mapping[str, Fraction] | Mapping[str, int]
) -> bool:
    """The definition: a producer, and no threat from it to the end; times may also be ranks."""
    activated = [effect for effect in plan.effects if holds(effect.guard, scenario)]
    threats = [
        times[effect.event]
        for effect in activated
        if effect.literal == condition.literal.negation
        and not (
            effect.activity is not None and effect.activity == condition.activity and effect.event == condition.last
        )
    ]
    for effect in activated:
        if effect.literal != condition.literal:
            continue
        own_start = (
            condition.first != condition.last
            and effect.activity is not None
            and effect.activity == condition.activity
            and effect.event == condition.first
        )
        in_time = own_start or times[effect.event] < times[condition.first]
        if in_time and not any(times[effect.event] <= threat <= times[condition.last] for threat in threats):
            return True
    return False
