"""The concrete simulator against VAL, on drawn plans and sampled schedules; and the generators themselves."""

from collections import Counter
from fractions import Fraction
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.plan.model import ZERO, ParametrizedPlan
from robust.plan.simulate import simulate
from tests.plan.building import OVER_ALL, RANDOM, RESET, delicate, drawn, schedule_of
from tests.sampling import sample_parameters, sample_schedule, sample_schedules
from tests.strategies import plans
from tests.val import judged_by_val, validate

# VAL merges happenings that are nearer than half its tolerance and separates no others, so times are multiples of 1/8
# and mutex time points are to be 1/8 apart: separated unless simultaneous. Binary fractions keep VAL's floats exact.
EPSILON = Fraction(1, 8)


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

    @drawn(130)
    @given(plans(dyadic=True, **options), RANDOM)
    def check(plan: ParametrizedPlan, random: Random) -> None:
        compare(plan, random, agreed)

    check()
    assert agreed[True] > 25
    assert agreed[False] > 10


# VAL does not look at the one instant to which something jumps.
CONTINUOUS = [case for case in OVER_ALL if RESET not in case.others]


@pytest.mark.parametrize("case", CONTINUOUS, ids=[case.name for case in CONTINUOUS])
def test_delicate_over_all_conditions(case):
    plan, times = delicate(case)
    schedule = {ZERO: Fraction(0), **schedule_of(plan, times)}
    simulation = simulate(plan, {}, schedule, epsilon=EPSILON)
    if judged_by_val(plan, simulation.violations):
        assert validate(plan, {}, schedule).valid == simulation.valid
    else:
        assert not simulation.valid


@drawn(100)
@given(plans(), RANDOM, st.integers(0, 1000))
def test_sampled_schedules_satisfy_the_network_and_repeat(plan, random, seed):
    parameters = sample_parameters(plan, random)
    for schedule in sample_schedules(plan, parameters, random, 5):
        assert set(schedule) == set(plan.time_points)
        assert simulate(plan, parameters, schedule).network_violations == ()
    first, second = (sample_schedule(plan, plan.nominal, Random(seed)) for _ in range(2))  # noqa: S311
    assert first == second


def test_a_good_share_of_drawn_plans_is_valid_at_nominal_and_some_have_no_schedule():
    found: Counter[str] = Counter()

    @drawn(150)
    @given(plans(), RANDOM)
    def check(plan: ParametrizedPlan, random: Random) -> None:
        schedules = sample_schedules(plan, plan.nominal, random, 8)
        valid = all(simulate(plan, plan.nominal, schedule).valid for schedule in schedules)
        found["infeasible" if not schedules else "valid" if valid else "invalid"] += 1

    check()
    assert found["valid"] >= 0.4 * found.total()
    assert found["invalid"] >= 0.1 * found.total()
    assert found["infeasible"] >= 1
