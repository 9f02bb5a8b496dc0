"""The most probable box: inside, maximal, at least as probable as any other box, and its bound holds."""

from fractions import Fraction
from random import Random

import pytest
from hypothesis import given

import robust
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError
from robust.execute.randomness import distributions_of
from robust.irr.containment import Containment
from robust.probability.measure import box_probability
from robust.qe.box import Box, Interval
from robust.searching import Status
from robust.smt.limits import NEVER
from tests.irr.building import parametric, shipped
from tests.irr.test_boxes import assert_maximal
from tests.plan.building import drawn

F = Fraction


def searched(plan, kinds, **options):
    """The result with the probability of its box."""
    result = robust.envelope(plan, method="risk", distribution=kinds, **options)
    return result, box_probability(result.box, distributions_of(plan, kinds))


def test_the_most_probable_box_of_drive_times():
    plan = shipped("two_sample_navigation")
    result, found = searched(plan, {"to_ridge": "normal:30:5", "to_crater": "normal:40:5"})
    assert result.status is Status.COMPLETE
    assert found.lower > F("0.5382")
    assert result.bound - F(5, 1000) <= found.lower <= result.bound < F("0.5434")
    assert_maximal(plan, result.box)
    assert len(result.stops) == 4


@pytest.mark.parametrize("crater", ["uniform:20:60", "triangular:20:45:60", "exponential:40:20"])
def test_with_one_random_parameter_the_box_is_all_that_is_valid(crater):
    plan = shipped("two_sample_navigation")
    kinds = {"to_ridge": "constant:30", "to_crater": crater}
    result, found = searched(plan, kinds)
    assert result.box["to_crater"].lower == 30
    assert result.box["to_crater"].upper == 49
    success = robust.risk(plan, kinds).probability
    assert success.lower <= found.upper
    assert found.lower <= success.upper
    assert result.bound >= found.lower


def test_distributions_away_from_the_nominal_values():
    plan = shipped("two_sample_navigation")
    result, found = searched(plan, {"to_ridge": "normal:45:1", "to_crater": "normal:30:1"})
    assert found.lower > F(9, 10)
    assert F(45) in result.box["to_ridge"]
    assert F(30) in result.box["to_crater"]


@drawn(12)
@given(parametric())
def test_no_random_box_is_more_probable_than_the_bound(plan):
    if len(plan.parameters) > 2:
        return
    kinds = {one.name: f"normal:{one.nominal}:{2 + index}" for index, one in enumerate(plan.parameters)}
    try:
        result, found = searched(plan, kinds, within="0.02", timeout=20)
    except InputError:
        return  # there is no schedule
    if result.status is not Status.COMPLETE or not result.verified:
        return
    containment = Containment(RelationalEncoding(plan))
    assert containment.contains(result.box, NEVER)
    assert result.bound is None or found.lower <= result.bound
    random = Random(3)  # noqa: S311 - reproducible
    distributions = distributions_of(plan, kinds)
    for _ in range(40):
        box = Box({one.name: around(one.nominal, random) for one in plan.parameters})
        if containment.contains(box, NEVER):
            most = box_probability(box, distributions).lower
            assert result.bound is None or most <= result.bound


def around(value: Fraction, random: Random) -> Interval:
    ends = sorted(value + F(random.randint(-32, 32), 8) for _ in range(2))
    return Interval(*ends)


def test_a_plan_that_always_fails_has_no_box():
    plan = shipped("two_sample_navigation")
    kinds = {"to_ridge": "uniform:60:70", "to_crater": "uniform:60:70"}
    result, found = searched(plan, kinds)
    assert found.upper == 0
    assert robust.risk(plan, kinds).probability.upper == 0
    assert result.bound in (None, 0)
