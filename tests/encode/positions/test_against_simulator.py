"""The positions encoding against the concrete simulator, one schedule at a time."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robust.api import check
from robust.encode.interface import Stage
from robust.encode.positions.encoding import PositionsEncoding
from robust.errors import UnsupportedError
from robust.irr.check import Answer
from robust.plan.model import ParametrizedPlan
from robust.plan.simulate import simulate
from tests.encode.positions.asking import is_broken
from tests.sampling import sample_parameters, sample_schedules
from tests.strategies import plans

EPSILON = Fraction(1, 8)
RANDOM = st.randoms(use_true_random=True)
DRAWN = settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
THOROUGH = settings(DRAWN, max_examples=200)


def compare(plan: ParametrizedPlan, random: Random, agreed: Counter[bool]) -> None:
    """Every obligation that a schedule reaches, having respected the earlier stages."""
    try:
        encoding = PositionsEncoding(plan, EPSILON)
    except UnsupportedError:
        return
    early = {o.name for o in encoding.obligations if o.stage is not Stage.CONDITION}
    for parameters in (plan.nominal, sample_parameters(plan, random)):
        for schedule in sample_schedules(plan, parameters, random, 3, epsilon=EPSILON):
            try:
                simulation = simulate(plan, parameters, schedule, epsilon=EPSILON)
            except UnsupportedError:
                return
            broken = {violation.obligation for violation in simulation.violations}
            if broken & early:
                continue
            for obligation in encoding.obligations:
                try:
                    answer = is_broken(encoding, obligation, parameters, schedule)
                except UnsupportedError:
                    return
                assert answer == (obligation.name in broken), f"{obligation.name} {parameters} {schedule}"
                agreed[answer] += 1


OPTIONS = [
    {"linear": True},
    {"linear": True, "instances": 3, "atoms": 1, "fluents": 1, "durative_only": True},
]


@pytest.mark.parametrize("options", OPTIONS)
def test_agrees_with_the_simulator(options: dict[str, bool | int]) -> None:
    agreed: Counter[bool] = Counter()

    @DRAWN
    @given(plan=plans(**options), random=RANDOM)
    def run(plan: ParametrizedPlan, random: Random) -> None:
        compare(plan, random, agreed)

    run()
    assert agreed[True] > 1
    assert agreed[False] > 50


@pytest.mark.slow
@pytest.mark.parametrize("options", [*OPTIONS, {}, {"instances": 6, "linear": True, "tame": True}])
def test_agrees_with_the_simulator_thoroughly(options: dict[str, bool | int]) -> None:
    @THOROUGH
    @given(plan=plans(**options), random=RANDOM)
    def run(plan: ParametrizedPlan, random: Random) -> None:
        compare(plan, random, Counter())

    run()


@DRAWN
@given(plan=plans(linear=True, tame=True, instances=3, infeasible=False), random=RANDOM)
def test_schedules_of_proved_plans_are_valid(plan: ParametrizedPlan, random: Random) -> None:
    if check(plan, encoding="positions", epsilon=EPSILON).answer is Answer.PROVED:
        for schedule in sample_schedules(plan, plan.nominal, random, 5, epsilon=EPSILON):
            assert simulate(plan, plan.nominal, schedule, epsilon=EPSILON).valid
