"""Simple temporal networks solved exactly, and correct executions by trying every weak order of events; for tests only.

Strict constraints are expressed through an infinitesimal.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from itertools import combinations, pairwise, product
from types import MappingProxyType
from typing import TypeAlias

from robust.pike_bridge.model import Condition, Constraint, Environment, Guard, TeamPlan, Tpnu, Vocabulary

Bound: TypeAlias = tuple[Fraction, int]
"""A number and how many infinitesimals are added to it."""

ZERO: Bound = (Fraction(0), 0)
STRICTLY_LESS: Bound = (Fraction(0), -1)


class Stn:
    """The tightest upper bound on t(target) − t(source) for each pair of events, kept while constraints are added."""

    def __init__(self, events: Iterable[str]) -> None:
        self.events = tuple(events)
        self.bounds: dict[tuple[str, str], Bound] = {(event, event): ZERO for event in self.events}
        self.consistent = True

    def copy(self) -> Stn:
        other = Stn(())
        other.events, other.bounds, other.consistent = self.events, dict(self.bounds), self.consistent
        return other

    def at_most(self, source: str, target: str, bound: Bound) -> Stn:
        """Add t(target) − t(source) ≤ bound."""
        if (source, target) in self.bounds and self.bounds[source, target] <= bound:
            return self
        before = [(event, self.bounds[event, source]) for event in self.events if (event, source) in self.bounds]
        after = [(event, self.bounds[target, event]) for event in self.events if (target, event) in self.bounds]
        for (first, to_source), (last, from_target) in product(before, after):
            length = (to_source[0] + bound[0] + from_target[0], to_source[1] + bound[1] + from_target[1])
            if (first, last) not in self.bounds or length < self.bounds[first, last]:
                self.bounds[first, last] = length
        self.consistent = self.consistent and all(self.bounds[event, event] >= ZERO for event in self.events)
        return self

    def strictly(self, earlier: str, later: str) -> Stn:
        return self.at_most(later, earlier, STRICTLY_LESS)

    def same(self, one: str, other: str) -> Stn:
        return self.at_most(one, other, ZERO).at_most(other, one, ZERO)

    def at_times(self, times: Mapping[str, Fraction]) -> Stn:
        """Add that these events are as far apart as their times are."""
        for (one, first), (other, second) in pairwise(times.items()):
            self.at_most(one, other, (second - first, 0)).at_most(other, one, (first - second, 0))
        return self

    def add(self, constraints: Iterable[Constraint]) -> Stn:
        for constraint in constraints:
            if constraint.upper is not None:
                self.at_most(constraint.source, constraint.target, (constraint.upper, 0))
            if constraint.lower is not None:
                self.at_most(constraint.target, constraint.source, (-constraint.lower, 0))
        return self

    def schedule(self) -> dict[str, Fraction]:
        """Some times that satisfy all constraints, the earliest of them zero."""
        # The distance from a point that is at or before all events; the infinitesimal is then made small enough.
        times = {
            event: min(self.bounds[origin, event] for origin in self.events if (origin, event) in self.bounds)
            for event in self.events
        }
        small = Fraction(1)
        for (source, target), (number, count) in self.bounds.items():
            gap = number - (times[target][0] - times[source][0])
            slope = times[target][1] - times[source][1] - count
            if gap > 0 and slope > 0:
                small = min(small, gap / slope)
        concrete = {event: number + count * small for event, (number, count) in times.items()}
        start = min(concrete.values(), default=Fraction(0))
        return {event: time - start for event, time in concrete.items()}


def holds(guard: Guard, scenario: Mapping[str, str]) -> bool:
    return all(scenario[variable] == value for variable, value in guard)


def candidate_subplan(network: Tpnu, scenario: Mapping[str, str]) -> Stn:
    """The network of the events and constraints that a scenario activates."""
    stn = Stn(event.name for event in network.events if holds(event.guard, scenario))
    return stn.add(each for each in network.temporal_constraints if holds(each.guard, scenario))


def scenarios(domains: Mapping[str, tuple[str, ...]]) -> Iterable[dict[str, str]]:
    return (dict(zip(domains, values, strict=True)) for values in product(*domains.values()))


class ExactPrecedence:
    """Precedence and temporal conflicts by looking at every scenario."""

    def __init__(self, network: Tpnu) -> None:
        self.vocabulary = Vocabulary(network.domains)
        self._guards = network.guards
        self._subplans = [
            (self.vocabulary.encode(frozenset(scenario.items())), candidate_subplan(network, scenario))
            for scenario in scenarios(network.domains)
        ]

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        environment = context | self.vocabulary.encode(self._guards[first] | self._guards[second])
        return all(
            (second, first) in subplan.bounds and subplan.bounds[second, first] < ZERO
            for scenario, subplan in self._subplans
            if scenario & environment == environment and subplan.consistent
        )

    def conflicting(self, environment: Environment) -> bool:
        return not any(
            subplan.consistent for scenario, subplan in self._subplans if scenario & environment == environment
        )


class Ignorance:
    """A precedence that knows nothing."""

    def __init__(self, network: Tpnu) -> None:
        self.vocabulary = Vocabulary(network.domains)

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        return False

    def conflicting(self, environment: Environment) -> bool:
        return False


class HalfKnowledge(ExactPrecedence):
    """A precedence that is right, but does not see about half of what there is to see."""

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        return sum(map(ord, first + second)) * (context + 7) % 5 < 2 and super().precedes(first, second, context)

    def conflicting(self, environment: Environment) -> bool:
        return environment * 11 % 5 < 2 and super().conflicting(environment)


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
