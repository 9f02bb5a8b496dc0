"""The theorems of [PIKE] on generated instances: seeded sweeps that say how many, and what hypothesis draws.

Theorem 4.7 is about execution, and checked where that is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from robust.pike_bridge.model import TeamPlan
from tests.pike_bridge.lemmas import (
    completions_follow,
    consensus_gives_implicants,
    implicants_of_plans,
    labels_are_prime_implicants,
)
from tests.pike_bridge.plans import contested_plans, networks, team_plans, tiny_plans
from tests.pike_bridge.sweeps import ORDERED, random_differences, random_plan
from tests.pike_bridge.theorems import (
    consistent_executions_are_correct,
    dominated_links_are_irrelevant,
    executions_correspond,
    models_are_correct_scenarios,
    partial_executions_correspond,
    temporal_conflicts_are_inconsistency,
)


@dataclass(frozen=True)
class Sweep:
    """A theorem checked on one random instance after another."""

    check: Callable[[Random], Counter[str]]
    quick: int
    slow: int
    share: float
    """Of how many instances the premise must have held, at least: of fewer, the sweep would show little."""


SWEEPS = {
    "theorem 4.1": Sweep(
        lambda random: temporal_conflicts_are_inconsistency(random_differences(random)), 60, 2000, 0.3
    ),
    "theorem 4.2": Sweep(
        lambda random: dominated_links_are_irrelevant(random_plan(random, style=ORDERED)), 120, 6000, 0.07
    ),
    "theorem 4.3": Sweep(lambda random: executions_correspond(random_plan(random), random), 60, 2000, 0.3),
    "theorem 4.4": Sweep(lambda random: partial_executions_correspond(random_plan(random), random), 50, 2000, 0.6),
    "theorem 4.5": Sweep(
        lambda random: consistent_executions_are_correct(random_plan(random), random), 200, 10000, 0.06
    ),
    "theorem 4.6": Sweep(lambda random: models_are_correct_scenarios(random_plan(random), random), 80, 2500, 0.3),
    "lemma 5.1": Sweep(consensus_gives_implicants, 500, 20000, 0.5),
    "invariant 5.2": Sweep(labels_are_prime_implicants, 200, 5000, 0.3),
    "invariant 5.2 of plans": Sweep(
        lambda random: implicants_of_plans(random_plan(random, events=4), random), 40, 2000, 0.15
    ),
    "theorem C.1": Sweep(completions_follow, 80, 4000, 0.3),
}


def run(name: str, seed: str, count: int, record: Callable[[str, object], None]) -> None:
    sweep, seen = SWEEPS[name], Counter[str]()
    for index in range(count):
        try:
            seen += sweep.check(Random(f"{name} {seed} {index}"))  # noqa: S311 - no secrets
        except AssertionError as error:
            error.add_note(f"{name}, seed {seed!r}, instance {index}")
            raise
    for what, number in {"instances": count, **seen}.items():
        record(what, number)
    print(f"\n{name}: {count} instances, {dict(seen)}")  # noqa: T201 - for `pytest -s`
    assert seen["premise"] >= sweep.share * count


@pytest.mark.parametrize("name", SWEEPS)
def test_sweep(name, record_property):
    run(name, "quick", SWEEPS[name].quick, record_property)


@pytest.mark.slow
@pytest.mark.parametrize("name", SWEEPS)
def test_long_sweep(name, record_property):
    run(name, "slow", SWEEPS[name].slow, record_property)


@settings(max_examples=40, deadline=None)
@given(networks(events=4))
def test_theorem_4_1(network):
    temporal_conflicts_are_inconsistency(network)


@settings(max_examples=40, deadline=None)
@given(st.one_of(tiny_plans(), contested_plans()))
def test_theorem_4_2(plan):
    seen = dominated_links_are_irrelevant(plan)
    event("something is dominated" if seen["premise"] else "nothing is")


@settings(max_examples=20, deadline=None)
@given(st.one_of(tiny_plans(), contested_plans()).filter(lambda plan: plan.network.choices), st.randoms())
def test_theorems_4_3_to_4_6(plan: TeamPlan, random: Random):
    for check in (executions_correspond, partial_executions_correspond):
        check(plan, random, most=3)
    consistent_executions_are_correct(plan, random)
    models_are_correct_scenarios(plan, random)


@settings(max_examples=20, deadline=None)
@given(team_plans(), st.randoms())
def test_invariant_5_2_of_plans(plan: TeamPlan, random: Random):
    implicants_of_plans(plan, random)
