"""The theorems of [PIKE §4, Appendices A and C] about one instance each, by brute force and by the oracle; for tests.

Every function checks a theorem on what it is given, and says how often its premise held there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import product
from math import prod
from random import Random

from robust.pike_bridge.causal import (
    AugmentedPlan,
    Contexts,
    Dominance,
    Happening,
    LinkEncoding,
    augment,
    open_conditions,
    prune,
)
from robust.pike_bridge.compile import Temporal, compile_plan
from robust.pike_bridge.model import Assignment, Condition, Guard, TeamPlan, Tpnu, may_produce
from robust.pike_bridge.semantics import Execution, Existence, Oracle, faults
from robust.pike_bridge.temporal.labeled_apsp import labeled_distances
from robust.pike_bridge.temporal.schedule import temporal_conflicts
from robust.pike_bridge.theory import Theory, is_model
from tests.pike_bridge.brute_force import (
    ExactPrecedence,
    Stn,
    candidate_subplan,
    correct_orders,
    correct_scenarios,
    holds,
    is_met,
    scenarios,
    weak_orders,
)
from tests.pike_bridge.sweeps import random_schedule, random_times
from tests.pike_bridge.test_causal import AugmentedModels

MOST_SCENARIOS = 600
"""Augmented plans with more scenarios than this are asked of a solver only, or left out."""
Scenario = dict[str, str]


def temporal_conflicts_are_inconsistency(network: Tpnu) -> Counter[str]:
    """Theorem 4.1: a candidate subplan has no schedule if and only if it entails a temporal conflict."""
    oracle = Oracle(TeamPlan(network, (), ()))
    found = [labeled_distances(network, completions=completions) for completions in (True, False)]
    conflicts = [[each.vocabulary.decode(one) for one in each.conflicts] for each in found]
    conflicts.append(list(temporal_conflicts(network, Theory(network.domains, (), ()))))
    seen: Counter[str] = Counter()
    for scenario in scenarios(network.domains):
        environment = frozenset(scenario.items())
        consistent = candidate_subplan(network, scenario).consistent
        assert (oracle.decide(environment).verdict is Existence.EXISTS) == consistent
        for several in conflicts:
            assert any(one <= environment for one in several) != consistent
        seen["consistent subplans" if consistent else "inconsistent subplans"] += 1
    seen["premise"] = int(bool(seen["consistent subplans"] and seen["inconsistent subplans"]))
    return seen


def dominated_links_are_irrelevant(plan: TeamPlan) -> Counter[str]:
    """Theorem 4.2: without the effects of what is dominated, the same executions meet the condition.

    The paper takes the effect of one dominated producer away. That matters to other conditions, which it may not be
    dominated for, so that each condition is looked at alone. What pruning drops is then taken away all at once.
    """
    seen: Counter[str] = Counter()
    orders = [(scenario, list(weak_orders(plan, scenario))) for scenario in scenarios(plan.network.domains)]
    ranked = [(scenario, ranks) for scenario, several in orders for ranks, _ in several]
    for condition in plan.conditions:
        alone = replace(plan, conditions=(condition,))
        met = [_meets(alone, condition, scenario, ranks) for scenario, ranks in ranked]
        seen["executions"] += len(met)
        dominated = set(dominated_by_definition(alone, condition))
        taken = [{one} for one in dominated]
        for question in open_conditions(alone, precedence := labeled_distances(plan.network)):
            contexts = Contexts(precedence, question.guard)
            for dominance in (Dominance.EXACT, Dominance.ALGORITHM_5):
                kept = prune(question, contexts, dominance)
                assert dominated.isdisjoint(kept.producers)
                taken.append({*question.producers, *question.threats} - {*kept.producers, *kept.threats})
        for happenings in filter(None, taken):
            removed = _without(alone, condition, happenings)
            assert [_meets(removed, condition, scenario, ranks) for scenario, ranks in ranked] == met
        if dominated:
            left = Oracle(_without(alone, condition, dominated))
            assert _found(left) == _found(Oracle(alone))
            seen["dominated links"] += len(dominated)
        seen["pruned candidates"] += len(taken[-1]) if taken else 0
    seen["premise"] = int(seen["dominated links"] > 0)
    return seen


def dominated_by_definition(plan: TeamPlan, condition: Condition) -> Iterator[Happening]:
    """The producers that Definition 4.5 says another one dominates, scenario by scenario."""
    exact = ExactPrecedence(plan.network)
    producers = {Happening(each.event, each.guard) for each in plan.effects if may_produce(each, condition)}
    for weak, strong in product(sorted(producers, key=str), repeat=2):
        everything = weak.guard | strong.guard | condition.guard
        possible = not exact.conflicting(exact.vocabulary.encode(everything)) and len(dict(everything)) == len(
            everything
        )
        if possible and strong.event != condition.first and strong.guard <= weak.guard:
            label = exact.vocabulary.encode(everything)
            if exact.precedes(weak.event, strong.event, label) and exact.precedes(strong.event, condition.first, label):
                yield weak


def _without(plan: TeamPlan, condition: Condition, happenings: set[Happening]) -> TeamPlan:
    """The plan without these effects on the atom of its condition."""
    kept = tuple(
        each
        for each in plan.effects
        if each.literal.atom != condition.literal.atom or Happening(each.event, each.guard) not in happenings
    )
    return replace(plan, effects=kept)


def _meets(plan: TeamPlan, condition: Condition, scenario: Scenario, ranks: Mapping[str, int]) -> bool:
    return not holds(condition.guard, scenario) or is_met(plan, scenario, condition, ranks)


def _found(oracle: Oracle) -> set[frozenset[tuple[str, str]]]:
    return {frozenset(each.scenario.items()) for each in oracle.scenarios()}


def augmented(plan: TeamPlan, random: Random) -> AugmentedPlan:
    """The plan, augmented in one of the ways that there are."""
    precedence = labeled_distances(plan.network, completions=random.random() < 0.8)
    encoding = LinkEncoding(random.choice(list(Dominance)), random.random() < 0.7, random.random() < 0.7)
    return augment(plan, precedence, encoding)


def executions_correspond(plan: TeamPlan, random: Random, *, most: int = 4) -> Counter[str]:
    """Theorem 4.3: an execution is correct if and only if it extends to a model of KB that the same times satisfy."""
    result = augmented(plan, random)
    models, oracle = AugmentedModels(result), Oracle(plan)
    seen: Counter[str] = Counter()
    for scenario in scenarios(plan.network.domains):
        for schedule in _schedules(plan, scenario, random, most):
            correct = _correct(plan, scenario, schedule)
            assert (faults(plan, Execution(scenario, schedule)) == ()) == correct
            verdict = oracle.decide(frozenset(scenario.items()), schedule).verdict
            assert (verdict is Existence.EXISTS) == correct
            assert (models.extend(scenario, schedule) is not None) == correct
            if prod(map(len, result.network.domains.values())) <= MOST_SCENARIOS:
                extensions = (each for each in _models(result, scenario) if _on_time(result.network, each, schedule))
                assert (next(extensions, None) is not None) == correct
            on_time = _on_time(plan.network, scenario, schedule)
            seen["correct" if correct else "on time, but incomplete" if on_time else "not on time"] += 1
    seen["premise"] = int(bool(seen["correct"] and seen["on time, but incomplete"]))
    return seen


def partial_executions_correspond(plan: TeamPlan, random: Random, *, most: int = 4) -> Counter[str]:
    """Theorem 4.4: a partial execution extends to a correct one of the plan if and only if to one of the other."""
    result = augmented(plan, random)
    models, oracle = AugmentedModels(result), Oracle(plan)
    everything = list(scenarios(plan.network.domains))
    seen: Counter[str] = Counter()
    for _ in range(most):
        begun = random.choice(everything)
        whole = next(_schedules(plan, begun, random, 1), {})
        executed = _begun(whole, random)
        chosen = _chosen(plan, begun, executed, random)
        extending = [each for each in everything if chosen <= frozenset(each.items())]
        correct = any(next(correct_orders(plan, each, executed), None) is not None for each in extending)
        assert (oracle.decide(chosen, executed).verdict is Existence.EXISTS) == correct
        assert (models.extend(dict(chosen), executed) is not None) == correct
        if prod(map(len, result.network.domains.values())) <= MOST_SCENARIOS:
            possible = (each for scenario in extending for each in _models(result, scenario))
            assert any(_subplan(result, each).at_times(executed).consistent for each in possible) == correct
        kind = "whole" if len(executed) == len(whole) else "empty" if not executed else "partial"
        seen[f"{kind}, {'' if correct else 'not '}correct"] += 1
    seen["premise"] = int(bool(seen["partial, correct"] or seen["partial, not correct"]))
    return seen


def consistent_executions_are_correct(plan: TeamPlan, random: Random, *, most: int = 40) -> Counter[str]:
    """Theorem 4.5: a schedule of the augmented plan under any model of KB meets all conditions.

    The same is not so of schedules of the original plan, which is counted, too: else there were nothing to show.
    """
    result = augmented(plan, random)
    seen: Counter[str] = Counter()
    if prod(map(len, result.network.domains.values())) > MOST_SCENARIOS:
        return seen
    found = [each for scenario in scenarios(plan.network.domains) for each in _models(result, scenario)]
    for model in random.sample(found, min(most, len(found))):
        scenario = _original(plan, model)
        subplan = _subplan(result, model)
        schedule = random_schedule(subplan, random) if subplan.consistent else None
        if schedule is not None:
            assert _correct(plan, scenario, schedule)
            assert faults(plan, Execution(scenario, schedule)) == ()
            seen["executions"] += any(holds(each.guard, scenario) for each in plan.conditions)
        free = candidate_subplan(plan.network, scenario)
        schedule = random_schedule(free, random) if free.consistent else None
        seen["others that are not"] += schedule is not None and not _correct(plan, scenario, schedule)
    seen["premise"] = int(bool(seen["executions"] and seen["others that are not"]))
    return seen


def models_are_correct_scenarios(plan: TeamPlan, random: Random) -> Counter[str]:
    """Theorem 4.6: the models of every compiled KB are what satisfies the constraints and has a schedule.

    Literally, the theorem says that each scenario of T′ with a correct execution satisfies KB; but a support variable
    may have a value that KB forbids without any event of the execution being another. So it is about the team scenarios
    of the original plan, as Theorem 4.3 has it: those with a correct execution are those that extend to a model.
    """
    seen: Counter[str] = Counter()
    correct = correct_scenarios(plan)
    assert _found(Oracle(plan)) == correct
    backend, temporal = random.choice(("pitms", "atms", "bdd", "sat")), random.choice(list(Temporal))
    compiled = compile_plan(plan, backend=backend, temporal=temporal)
    result = compiled.augmented
    if prod(map(len, result.network.domains.values())) > MOST_SCENARIOS:
        return seen
    models = {frozenset(each.items()) for each in compiled.knowledge.models()}
    expected = {
        frozenset(each.items())
        for scenario in scenarios(plan.network.domains)
        for each in _models(result, scenario)
        if _subplan(result, each).consistent
    }
    assert models == expected
    assert compiled.knowledge.count_models() == len(expected)
    assert {frozenset(_original(plan, dict(each)).items()) for each in models} == correct
    seen["models"] = len(models)
    total = prod(map(len, plan.network.domains.values()))
    seen["none"], seen["all"] = int(not correct), int(len(correct) == total)
    seen["premise"] = int(0 < len(correct) < total)
    return seen


def _schedules(plan: TeamPlan, scenario: Scenario, random: Random, most: int) -> Iterator[dict[str, Fraction]]:
    """Times for the events of a scenario: mostly such as satisfy the constraints."""
    subplan = candidate_subplan(plan.network, scenario)
    for _ in range(most):
        drawn = random_schedule(subplan, random) if subplan.consistent and random.random() < 0.85 else None
        yield random_times(subplan, random) if drawn is None else drawn


def _begun(whole: dict[str, Fraction], random: Random) -> dict[str, Fraction]:
    """What has been executed by some moment."""
    now = random.choice(sorted(whole.values())) if whole else Fraction(0)
    return {event: time for event, time in whole.items() if time < now or (time == now and random.random() < 0.6)}


def _chosen(plan: TeamPlan, scenario: Scenario, executed: Mapping[str, Fraction], random: Random) -> Guard:
    """The choices that have been made: those that activate what has been executed, and perhaps another one."""
    known: Guard = frozenset().union(*(plan.network.guards[event] for event in executed))
    more = random.choice(plan.network.choices).name
    return known | {Assignment(more, scenario[more])} if random.random() < 0.3 else known


def _models(result: AugmentedPlan, scenario: Scenario) -> Iterator[Scenario]:
    """The extensions of a scenario that satisfy the constraints of KB, temporal conflicts aside."""
    domains = {name: values for name, values in result.network.domains.items() if name not in scenario}
    for added in scenarios(domains):
        whole = scenario | added
        if is_model(whole, result.theory):
            yield whole


def _original(plan: TeamPlan, model: Scenario) -> Scenario:
    return {choice.name: model[choice.name] for choice in plan.network.choices}


def _subplan(result: AugmentedPlan, model: Scenario) -> Stn:
    return candidate_subplan(result.network, model)


def _on_time(network: Tpnu, scenario: Scenario, times: Mapping[str, Fraction]) -> bool:
    return all(
        (each.lower is None or times[each.target] - times[each.source] >= each.lower)
        and (each.upper is None or times[each.target] - times[each.source] <= each.upper)
        for each in network.temporal_constraints
        if holds(each.guard, scenario)
    )


def _correct(plan: TeamPlan, scenario: Scenario, times: Mapping[str, Fraction]) -> bool:
    """Definitions 2.5 and 2.6, outright."""
    return _on_time(plan.network, scenario, times) and all(
        is_met(plan, scenario, condition, times) for condition in plan.conditions if holds(condition.guard, scenario)
    )
