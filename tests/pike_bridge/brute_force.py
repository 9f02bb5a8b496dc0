"""Simple temporal networks solved exactly, and correct executions by trying every weak order of events; for tests only.

Strict constraints are expressed through an infinitesimal: bounds are pairs of a number and how many of it are added.
"""

from copy import copy
from fractions import Fraction
from itertools import combinations, pairwise, product

from robust.pike_bridge.model import AssignmentVocabulary, guard

ZERO = (Fraction(0), 0)
STRICTLY_LESS = (Fraction(0), -1)


class Stn:
    """The tightest upper bound on t(target) − t(source) for each pair of events, kept while constraints are added."""

    def __init__(self, events):
        self.events = tuple(events)
        self.bounds = {(event, event): ZERO for event in self.events}
        self.consistent = True

    def copy(self):
        other = copy(self)
        other.bounds = dict(self.bounds)
        return other

    def at_most(self, source, target, bound):
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

    def strictly(self, earlier, later):
        return self.at_most(later, earlier, STRICTLY_LESS)

    def apart(self, first, second, difference):
        return self.at_most(first, second, (difference, 0)).at_most(second, first, (-difference, 0))

    def at_times(self, times):
        """Add that these events are as far apart as their times are."""
        for (first, time), (second, later) in pairwise(times.items()):
            self.apart(first, second, later - time)
        return self

    def add(self, constraints):
        for constraint in constraints:
            if constraint.upper is not None:
                self.at_most(constraint.source, constraint.target, (constraint.upper, 0))
            if constraint.lower is not None:
                self.at_most(constraint.target, constraint.source, (-constraint.lower, 0))
        return self


def holds(guard, scenario):
    return all(scenario[variable] == value for variable, value in guard)


def broken_constraints(network, scenario, times):
    """The activated constraints that the times do not satisfy."""
    activated = {each for each in network.temporal_constraints if holds(each.guard, scenario)}
    apart = {each: times[each.target] - times[each.source] for each in activated}
    early = {each for each, between in apart.items() if each.lower is not None and between < each.lower}
    return early | {each for each, between in apart.items() if each.upper is not None and between > each.upper}


def candidate_subplan(network, scenario):
    """The network of the events and constraints that a scenario activates."""
    stn = Stn(event.name for event in network.events if holds(event.guard, scenario))
    return stn.add(each for each in network.temporal_constraints if holds(each.guard, scenario))


def scenarios(domains):
    return (dict(zip(domains, values, strict=True)) for values in product(*domains.values()))


def environments(network):
    """Every partial assignment to the choices."""
    for values in scenarios({name: (None, *domain) for name, domain in network.domains.items()}):
        yield guard({name: value for name, value in values.items() if value is not None})


def extending(network, environment=frozenset()):
    """Every full assignment to the choices that extends an environment."""
    return (scenario for scenario in map(guard, scenarios(network.domains)) if environment <= scenario)


def distances(network, scenario):
    """Shortest paths between activated events; None if there is a negative cycle."""
    stn = candidate_subplan(network, dict(scenario))
    return {pair: number for pair, (number, _) in stn.bounds.items()} if stn.consistent else None


class ExactPrecedence:
    """Precedence and temporal conflicts by looking at every scenario."""

    def __init__(self, network):
        self.vocabulary = AssignmentVocabulary(network.domains)
        self._guards = network.guards
        self._subplans = [
            (self.vocabulary.encode(guard(scenario)), candidate_subplan(network, scenario))
            for scenario in scenarios(network.domains)
        ]

    def precedes(self, first, second, context):
        environment = context | self.vocabulary.encode(self._guards[first] | self._guards[second])
        bounds = (subplan.bounds.get((second, first), ZERO) for subplan in self._consistent(environment))
        return all(bound < ZERO for bound in bounds)

    def conflicting(self, environment):
        return not any(self._consistent(environment))

    def _consistent(self, environment):
        extending = (subplan for scenario, subplan in self._subplans if scenario & environment == environment)
        return (subplan for subplan in extending if subplan.consistent)


def check_precedence(network, precedence, *, complete):
    """Whatever is claimed to precede does so in every scenario with a schedule; the reverse, too, if complete."""
    exact = ExactPrecedence(network)
    for context, first, second in product(environments(network), network.events, network.events):
        encoded = exact.vocabulary.encode(context)
        possible = not exact.conflicting(encoded | exact.vocabulary.encode(first.guard | second.guard))
        precedes = exact.precedes(first.name, second.name, encoded)
        claimed = precedence.precedes(first.name, second.name, encoded)
        assert precedes or not claimed
        assert not complete or claimed == (precedes and possible)


class Ignorance:
    """A precedence that knows nothing."""

    def __init__(self, network):
        self.vocabulary = AssignmentVocabulary(network.domains)

    def precedes(self, first, second, context):
        return False

    def conflicting(self, environment):
        return False


class HalfKnowledge(ExactPrecedence):
    """A precedence that is right, but does not see about half of what there is to see."""

    def precedes(self, first, second, context):
        return sum(map(ord, first + second)) * (context + 7) % 5 < 2 and super().precedes(first, second, context)

    def conflicting(self, environment):
        return environment * 11 % 5 < 2 and super().conflicting(environment)


def correct_scenarios(plan):
    """The team scenarios that admit a correct execution."""
    return {guard(each) for each in scenarios(plan.network.domains) if admits_correct_execution(plan, each)}


def admits_correct_execution(plan, scenario, fixed=None):
    """Whether some weak order of the events meets all conditions; some events may have fixed times."""
    conditions = [condition for condition in plan.conditions if holds(condition.guard, scenario)]
    orders = weak_orders(plan, scenario, fixed)
    return any(all(is_met(plan, scenario, condition, ranks) for condition in conditions) for ranks in orders)


def weak_orders(plan, scenario, fixed=None):
    """The ranks in each consistent weak order of the events that have effects or conditions.

    Some events may have fixed times; all of them must be activated.
    """
    subplan = candidate_subplan(plan.network, scenario).at_times(fixed or {})
    conditions = [condition for condition in plan.conditions if holds(condition.guard, scenario)]
    mentioned = {event for each in conditions for event in (each.first, each.last)}
    mentioned |= {effect.event for effect in plan.effects if holds(effect.guard, scenario)}

    def orders(left, ranks, latest, stn):
        if not left:
            yield ranks
        blocks = (block for size in range(1, len(left) + 1) for block in combinations(sorted(left), size))
        for block in blocks:
            ordered = stn.copy()
            for event in block:
                ordered.apart(block[0], event, 0)
            for event in latest:
                ordered.strictly(event, block[0])
            if ordered.consistent:
                now = ranks | dict.fromkeys(block, max(ranks.values(), default=0) + 1)
                yield from orders(left - set(block), now, block, ordered)

    return orders(mentioned, {}, (), subplan) if subplan.consistent else iter(())


def is_met(plan, scenario, condition, times, epsilon=0):
    """The definition: a producer, and no threat from it to the end; times may also be ranks."""

    def before(earlier, later):
        return times[later] > times[earlier] and times[later] - times[earlier] >= epsilon

    def own(effect, event):
        return condition.activity is not None and (effect.activity, effect.event) == (condition.activity, event)

    effects = [effect for effect in plan.effects if holds(effect.guard, scenario)]
    threats = [each for each in effects if each.literal == condition.literal.negation and not own(each, condition.last)]
    producers = (
        each.event
        for each in effects
        if each.literal == condition.literal
        and (before(each.event, condition.first) or (condition.first != condition.last and own(each, condition.first)))
    )
    return any(
        all(before(threat.event, producer) or before(condition.last, threat.event) for threat in threats)
        for producer in producers
    )


def is_correct(plan, scenario, times, epsilon=0):
    """Definitions 2.5 and 2.6, outright."""
    conditions = (condition for condition in plan.conditions if holds(condition.guard, scenario))
    return not broken_constraints(plan.network, scenario, times) and all(
        is_met(plan, scenario, condition, times, epsilon) for condition in conditions
    )
