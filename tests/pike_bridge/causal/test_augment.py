"""Augmented plans against the oracle, the referee and brute force: Theorems 4.2, 4.3, 4.5 and 4.6 of [PIKE]."""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from robust.pike_bridge.causal import AugmentedPlan, Dominance, Encoding, augment
from robust.pike_bridge.model import EPSILON, TeamPlan
from robust.pike_bridge.semantics import Execution, Oracle, faults
from robust.pike_bridge.theory import is_model
from tests.pike_bridge.brute_force import correct_orders, correct_scenarios
from tests.pike_bridge.causal.models import AugmentedModels
from tests.pike_bridge.networks import ExactPrecedence, HalfKnowledge, Ignorance, holds
from tests.pike_bridge.plans import contested_plans, team_plans, tiny_plans

encodings = st.builds(Encoding, st.sampled_from(Dominance), st.booleans(), st.booleans())
precedences = st.sampled_from((ExactPrecedence, HalfKnowledge, Ignorance))


@settings(max_examples=300, deadline=None)
@given(st.one_of(team_plans(), contested_plans()), precedences, encodings)
def test_models_are_the_scenarios_with_a_correct_execution(
    plan: TeamPlan, precedence: type, encoding: Encoding
) -> None:
    augmented = augment(plan, precedence(plan.network), encoding)
    correct = {frozenset(execution.scenario.items()) for execution in Oracle(plan).scenarios()}
    assert AugmentedModels(augmented).projections() == correct
    event(f"{min(3, len(augmented.network.choices) - len(plan.network.choices))} variables, {bool(correct)}")


@settings(max_examples=400, deadline=None)
@given(st.one_of(tiny_plans(), contested_plans(), contested_plans()), precedences, encodings)
def test_models_are_those_of_brute_force(plan: TeamPlan, precedence: type, encoding: Encoding) -> None:
    augmented = augment(plan, precedence(plan.network), encoding)
    assert AugmentedModels(augmented).projections() == correct_scenarios(plan)


@settings(max_examples=200, deadline=None)
@given(st.one_of(team_plans(), contested_plans()), precedences, encodings)
def test_consistent_executions_of_the_augmented_plan_are_correct(
    plan: TeamPlan, precedence: type, encoding: Encoding
) -> None:
    """[PIKE, Theorem 4.5]"""
    augmented = augment(plan, precedence(plan.network), encoding)
    models = AugmentedModels(augmented)
    for scenario in models.projections():
        found = models.extend(dict(scenario))
        assert found is not None
        assert is_model(found.scenario, augmented.theory)
        original = {choice.name: found.scenario[choice.name] for choice in plan.network.choices}
        assert faults(plan, Execution(original, found.schedule)) == ()
        if encoding.dominance is not Dominance.ALGORITHM_5:
            assert threatened_links(augmented, found) == []


def threatened_links(augmented: AugmentedPlan, execution: Execution) -> list[str]:
    """The links that an execution selects although some threat lies in their interval."""
    times = execution.schedule
    return [
        f"{link.producer} {effect}"
        for link in augmented.links
        if holds(link.selection | link.consumer.guard, execution.scenario)
        for effect in augmented.plan.effects
        if effect.literal == link.consumer.literal.negation
        and holds(effect.guard, execution.scenario)
        and times[link.producer.event] <= times[effect.event] <= times[link.consumer.last]
        and not any(
            effect.event == condition.last and effect.activity == condition.activity
            for condition in link.consumer.conditions
        )
    ]


@settings(max_examples=150, deadline=None)
@given(st.one_of(tiny_plans(), contested_plans(), contested_plans()), precedences, encodings)
def test_correct_executions_are_executions_of_the_augmented_plan(
    plan: TeamPlan, precedence: type, encoding: Encoding
) -> None:
    """[PIKE, Theorem 4.3], for events that are ε apart if they are not simultaneous."""
    models = AugmentedModels(augment(plan, precedence(plan.network), encoding))
    for scenario in correct_scenarios(plan):
        for ordered in correct_orders(plan, dict(scenario)):
            schedule = ordered.schedule()
            gaps = [abs(one - other) for one, other in product(schedule.values(), repeat=2)]
            if all(gap == 0 or gap >= EPSILON for gap in gaps):
                assert models.extend(dict(scenario), schedule) is not None
                break


@settings(max_examples=200, deadline=None)
@given(team_plans(), encodings)
def test_knowledge_spares_variables(plan: TeamPlan, encoding: Encoding) -> None:
    sizes = [
        len(augment(plan, precedence(plan.network), encoding).network.choices)
        for precedence in (ExactPrecedence, HalfKnowledge, Ignorance)
    ]
    assert sizes == sorted(sizes)


@settings(max_examples=200, deadline=None)
@given(st.one_of(team_plans(), contested_plans()), precedences, encodings)
def test_additions_are_well_formed(plan: TeamPlan, precedence: type, encoding: Encoding) -> None:
    augmented = augment(plan, precedence(plan.network), encoding)
    guards = augmented.network.guards
    assert augmented.theory.domains == augmented.network.domains
    assert len(augmented.network.domains) == len(augmented.network.choices)
    for constraint in augmented.network.constraints:
        assert guards[constraint.source] | guards[constraint.target] <= constraint.guard
        assert len({variable for variable, _ in constraint.guard}) == len(constraint.guard)
    for choice in augmented.network.choices[len(plan.network.choices) :]:
        assert len(set(choice.domain)) == len(choice.domain) >= 2


@pytest.mark.slow
@settings(max_examples=1500, deadline=None)
@given(st.one_of(team_plans(), contested_plans()), precedences, encodings)
def test_many_models_are_the_scenarios_with_a_correct_execution(
    plan: TeamPlan, precedence: type, encoding: Encoding
) -> None:
    augmented = augment(plan, precedence(plan.network), encoding)
    correct = {frozenset(execution.scenario.items()) for execution in Oracle(plan).scenarios()}
    assert AugmentedModels(augmented).projections() == correct
