"""The concrete simulator against VAL, on drawn plans and sampled schedules; and the generators themselves."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robust.plan.model import ZERO, Holds, Or, ParametrizedPlan, Timing
from robust.plan.simulate import simulate
from tests.plan.building import (
    F,
    P,
    Q,
    above,
    action,
    add,
    at_least,
    different,
    flow,
    instant,
    plan_of,
    schedule_of,
    value,
)
from tests.sampling import sample_parameters, sample_schedule, sample_schedules
from tests.strategies import plans
from tests.val import judged_by_val, validate

# VAL merges happenings that are nearer than half its tolerance and separates no others, so times are multiples of 1/8
# and mutex time points are to be 1/8 apart: separated unless simultaneous. Binary fractions keep VAL's floats exact.
EPSILON = Fraction(1, 8)
RANDOM = st.randoms(use_true_random=True)
DRAWN = settings(max_examples=130, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])


def compare(plan: ParametrizedPlan, random: Random, agreed: Counter[bool]) -> None:
    for parameters in (plan.nominal, sample_parameters(plan, random)):
        for schedule in sample_schedules(plan, parameters, random, 2, epsilon=EPSILON):
            if any(schedule[i.end] < schedule[i.start] for i in plan.instances):
                continue  # a plan file cannot say a negative duration
            simulation = simulate(plan, parameters, schedule, epsilon=EPSILON)
            assert simulation.network_violations == ()
            if judged_by_val(plan, simulation.violations):
                verdict = validate(plan, parameters, schedule)
                assert verdict.valid == simulation.valid, f"{simulation.violations}\n{verdict.report}"
                agreed[verdict.valid] += 1


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"tame": False, "instances": 3, "atoms": 2},
        {"instances": 3, "atoms": 1, "fluents": 1, "durative_only": True, "conditional": False, "parameters": 0},
    ],
    ids=["all features", "untamed", "continuous"],
)
def test_simulator_agrees_with_val(options):
    agreed: Counter[bool] = Counter()

    @DRAWN
    @given(plans(dyadic=True, **options), RANDOM)
    def check(plan: ParametrizedPlan, random: Random) -> None:
        compare(plan, random, agreed)

    check()
    assert agreed[True] > 25
    assert agreed[False] > 10


ABOVE, BELOW = above(value(F), 0), above(-value(F), 0)
PROFILES = {
    "constantly 0": ([instant("b", add(Q))], 0, {"a": (1, 3), "b": 2}),
    "rising from 0": ([action("b", flow(F, 1))], 0, {"a": (1, 3), "b": (1, 4)}),
    "falling to 0": ([action("b", flow(F, -1))], 2, {"a": (1, 3), "b": (1, 3)}),
    "falling through 0": ([action("b", flow(F, -1))], 1, {"a": (1, 3), "b": (1, 3)}),
    "touching 0": ([action("b", flow(F, -1)), action("c", flow(F, 1))], 1, {"a": (1, 5), "b": (2, 3), "c": (3, 4)}),
    "staying at 0": ([action("b", flow(F, -1)), action("c", flow(F, 1))], 1, {"a": (1, 6), "b": (2, 3), "c": (4, 5)}),
}


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(
    "condition",
    [ABOVE, at_least(value(F), 0), different(value(F), 0), Or((ABOVE, Holds(P))), Or((ABOVE, BELOW))],
    ids=[">", ">=", "!=", "> or an atom", "> or <"],
)
def test_over_all_on_typical_profiles(condition, profile):
    others, initial, times = PROFILES[profile]
    plan = plan_of(action("a", (Timing.OVER_ALL, condition)), *others, f=initial)
    schedule = {ZERO: Fraction(0), **schedule_of(plan, times)}
    simulation = simulate(plan, {}, schedule, epsilon=EPSILON)
    verdict = validate(plan, {}, schedule)
    if judged_by_val(plan, simulation.violations):
        assert verdict.valid == simulation.valid
    else:
        assert not simulation.valid


@settings(max_examples=100, deadline=None)
@given(plans(), RANDOM)
def test_sampled_schedules_satisfy_the_network(plan, random):
    parameters = sample_parameters(plan, random)
    for schedule in sample_schedules(plan, parameters, random, 5):
        assert set(schedule) == set(plan.time_points)
        assert simulate(plan, parameters, schedule).network_violations == ()


@settings(max_examples=50, deadline=None)
@given(plans(), st.integers(0, 1000))
def test_sampling_is_deterministic(plan, seed):
    first, second = (sample_schedule(plan, plan.nominal, Random(seed)) for _ in range(2))  # noqa: S311
    assert first == second


def test_a_good_share_of_drawn_plans_is_valid_at_nominal_and_some_have_no_schedule():
    found: Counter[str] = Counter()

    @settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
    @given(plans(), RANDOM)
    def check(plan: ParametrizedPlan, random: Random) -> None:
        schedules = sample_schedules(plan, plan.nominal, random, 8)
        valid = all(simulate(plan, plan.nominal, schedule).valid for schedule in schedules)
        found["infeasible" if not schedules else "valid" if valid else "invalid"] += 1

    check()
    assert found["valid"] >= 0.4 * found.total()
    assert found["invalid"] >= 0.1 * found.total()
    assert found["infeasible"] >= 1
