"""The probability of success: known figures, brute force on drawn plans, many parameters, and limits."""

from fractions import Fraction
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given

import robust
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError
from robust.execute.randomness import distributions_of
from robust.execute.worlds import parse_rules
from robust.irr.containment import Containment
from robust.irr.widen import DiscoveredBadSet
from robust.plan.model import Parameter
from robust.probability import measure as measures
from robust.probability import risk as risks
from robust.probability.measure import box_probability
from robust.probability.packing import Packing
from robust.probability.risk import Risk, RiskStatus
from robust.qe.box import Box
from robust.qe.estimate import proportion_bounds
from robust.smt.limits import NEVER, Deadline
from tests.irr.building import lasts, parametric, shipped, timed
from tests.plan.building import drawn

F = Fraction
CONFIDENCE = 0.999


def normal(deviation, **means):
    return {name: f"normal:{mean}:{deviation}" for name, mean in means.items()}


# -- known figures -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("deviation", "expected"), [(5, "0.8589"), (8, "0.6155")])
def test_the_probability_that_the_rover_succeeds(deviation, expected):
    plan = shipped("two_sample_navigation")
    found = robust.risk(plan, normal(deviation, to_ridge=30, to_crater=40))
    assert found.status is RiskStatus.COMPLETE
    assert found.probability.width <= F(1, 1000)
    assert abs((found.probability.lower + found.probability.upper) / 2 - F(expected)) <= F(1, 1000)
    # What fails adds up to what is left, and every box keeps less.
    least = sum(one.probability.lower for one in found.shares)
    most = sum(one.probability.upper for one in found.shares)
    assert least <= 1 - found.probability.lower
    assert most >= 1 - found.probability.upper
    assert most - least < F(1, 100)
    assert {one.method for one in found.kept} == {"irr", "widen", "optimal"}
    assert all(one.probability.upper <= found.probability.upper for one in found.kept)
    assert found.estimate is None
    assert found.disjoint == ()


def test_shares_are_those_of_the_sides_of_the_pentagon():
    """With a constant drive to the ridge the crater is all that is random: shares are those of intervals."""
    plan = shipped("two_sample_navigation")
    found = robust.risk(plan, {"to_ridge": "constant:30", "to_crater": "uniform:20:60"}, within="1/1000000")
    assert found.probability.lower <= F(19, 40) <= found.probability.upper  # 30 to 49
    shares = {one.name: one.probability for one in found.shares if one.probability.lower}
    (dark,) = [name for name in shares if "lit crater" in name]
    assert shares[dark].lower <= F(1, 4) <= shares[dark].upper  # 20 to 30
    assert sum(one.lower for one in shares.values()) > F(52, 100)


def test_values_outside_of_declared_bounds_fail():
    plan = shipped("two_sample_navigation", "to_ridge,lb=28,ub=32", "to_crater,lb=40,ub=40")
    found = robust.risk(plan, {"to_ridge": "uniform:20:40", "to_crater": "constant:40"})
    assert found.probability.lower <= F(1, 5) <= found.probability.upper
    assert [one.name for one in found.shares if one.probability.lower] == ["declared bounds"]
    assert found.shares[0].probability.lower <= F(4, 5) <= found.shares[0].probability.upper


# -- brute force -------------------------------------------------------------------------------------------------------


def some_distribution(parameter: Parameter, random: Random) -> str:
    mean, width = parameter.nominal, random.choice((1, 2, 4))
    return random.choice((
        f"normal:{mean}:{width}",
        f"uniform:{mean - width}:{mean + 2 * width}",
        f"triangular:{mean - width}:{mean}:{mean + width}",
        f"exponential:{mean + width}:{mean}",
        f"normal:{mean}:{width}:{mean - 1}:clip",
        f"half-normal:{mean}:{width}",
        f"truncated-normal:{mean}:{width}:{mean - width}:{mean + width}",
        f"constant:{mean}",
    ))  # fmt: skip


MET = {"between": 0, "all": 0}


@drawn(10)
@given(parametric())
def test_bounds_agree_with_random_points_on_drawn_plans(plan):
    """The point checker asks the solver of each point; the interval of Clopper and Pearson meets the bounds."""
    if len(plan.parameters) > 4:
        return
    random = Random(str(plan.parameters))  # noqa: S311 - reproducible
    given_ = {one.name: some_distribution(one, random) for one in plan.parameters}
    found = robust.risk(plan, given_, within="1/200", timeout=20)
    distributions = distributions_of(plan, given_)
    checker = Containment(RelationalEncoding(plan))
    good = 0
    for _ in range(250):
        point = {name: one.settled.draw(random, None) for name, one in distributions.items()}
        good += checker._look_in(Box.point(point), NEVER) is None
    lower, upper = proportion_bounds(good, 250, CONFIDENCE)
    assert found.probability.lower <= F(upper)
    assert found.probability.upper >= F(lower)
    MET["all"] += 1
    MET["between"] += 0 < good < 250
    assert sum(one.probability.upper for one in found.shares or ()) >= 1 - found.probability.upper


def test_drawn_plans_were_of_all_kinds():
    assert MET["all"] == 0 or MET["between"] >= 2


# -- many parameters ---------------------------------------------------------------------------------------------------


def late(count: int):
    """One action whose duration is the sum of so many parameters, and must be at most what it is expected to be."""
    names = [f"p{number}" for number in range(count)]
    parameters = [Parameter(name, F(10)) for name in names]
    return timed(*parameters, pieces=lasts(0, 10 * count + 8)), dict.fromkeys(names, "normal:10:2")


def test_boxes_without_common_points_bound_the_probability_from_below():
    plan, kinds = late(3)
    distributions = distributions_of(plan, kinds)
    packing = Packing(DiscoveredBadSet(RelationalEncoding(plan)), plan.parameters, distributions)
    with pytest.raises(robust.smt.limits.OutOfTimeError):
        packing.run(Deadline.after(3))
    assert len(packing.boxes) > 3
    exact = robust.risk(plan, kinds).probability
    assert packing.lower <= exact.upper
    assert packing.lower > exact.lower - F(1, 4)
    checker = Containment(RelationalEncoding(plan))
    for one in packing.boxes[:20]:
        assert checker.contains(one, NEVER)
    for index, one in enumerate(packing.boxes[:40]):
        for other in packing.boxes[:index]:
            shared = [i for i in one.intervals if _apart(one[i], other[i])]
            assert shared, f"{one} and {other} have points in common"
    total = sum(box_probability(one, distributions).lower for one in packing.boxes)
    assert packing.lower == total


def _apart(one, other) -> bool:
    low, high = (one, other) if (one.lower is None or (other.lower is not None and one.lower <= other.lower)) else (
        other, one)  # fmt: skip
    if low.upper is None or high.lower is None:
        return False
    return low.upper < high.lower or (low.upper == high.lower and not (low.upper_closed and high.lower_closed))


def test_with_many_parameters_there_is_an_estimate_beside_sound_bounds():
    plan, kinds = late(8)
    found = robust.risk(plan, kinds, timeout=4)
    assert found.status in {RiskStatus.WIDE, RiskStatus.TIMEOUT}
    # The sum is normal: Φ(8 / (2 √8)) = Φ(√2) = 0.92135.
    assert found.probability.lower <= F("0.92135") <= found.probability.upper
    if found.estimate is not None and found.estimate.draws:
        assert found.estimate.lower <= 0.9214
        assert found.estimate.upper >= 0.9213


def test_asked_for_random_points_are_drawn():
    plan = shipped("two_sample_navigation")
    found = robust.risk(plan, normal(5, to_ridge=30, to_crater=40), draws=3000)
    assert found.estimate.draws == 3000
    assert found.estimate.lower <= 0.8589 <= found.estimate.upper
    assert found.estimate.lower > 0.83


# -- limits, and what is given -----------------------------------------------------------------------------------------


def test_out_of_time_the_bounds_are_sound():
    plan = shipped("two_sample_navigation")
    found = robust.risk(plan, normal(5, to_ridge=30, to_crater=40), timeout=0, within="1/1000000000")
    assert found.status is RiskStatus.TIMEOUT
    assert found.probability.lower <= F("0.8589") <= found.probability.upper
    search = Risk(plan, distributions_of(plan, normal(5, to_ridge=30, to_crater=40)))
    assert search.so_far(timed_out=False).status is RiskStatus.INTERRUPTED
    assert search.so_far(timed_out=True).probability == robust.Bounds(F(0), F(1))


def test_a_world_says_how_durations_and_parameters_are_distributed():
    plan = shipped("two_sample_navigation")
    world = parse_rules('[[draw]]\nduration = "drive"\ndistribution = "normal"\ndeviation = 4\nminimum = 10\n')
    found = distributions_of(plan, (), world)
    assert {name: str(one) for name, one in found.items()} == {
        "to_ridge": "normal:30:4:10", "to_crater": "normal:40:4:10"}  # fmt: skip
    world = parse_rules('[[draw]]\nparameter = "to_ridge"\ndistribution = "triangular"\nlower = 20\nupper = 50\n')
    found = distributions_of(plan, ["to_crater=exponential:40:30"], world)
    assert str(found["to_ridge"]) == "triangular:20:30:50"
    assert str(found["to_crater"]) == "exponential:40:30"
    assert str(distributions_of(plan, (), world)["to_crater"]) == "constant:40"


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        (["to_ridge=normal:30:5"], "found no distribution of parameter 'to_crater'"),
        (["to_ridge"], "found 'to_ridge', expected NAME=DISTRIBUTION"),
        (["to_rigde=normal:30:5"], "did you mean 'to_ridge'?"),
        (["to_ridge=normal:30:5", "to_ridge=normal:30:5"], "found a second distribution of 'to_ridge'"),
        ({"to_ridge": "normal:30:-5"}, "found deviation -5, expected a number above 0"),
    ],
)
def test_wrong_distributions_are_one_line(given_, message):
    with pytest.raises(InputError) as caught:
        robust.risk(shipped("two_sample_navigation"), given_)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_world_without_a_rule_about_a_parameter_is_an_error():
    world = parse_rules('[[draw]]\nduration = "fly"\ndistribution = "uniform"\nlower = 1\nupper = 2\n')
    with pytest.raises(InputError, match="found no rule about a parameter"):
        distributions_of(shipped("two_sample_navigation"), (), world)


def test_bounds_are_those_of_the_moment_when_it_is_interrupted(monkeypatch):
    """Whatever is interrupted in the middle of a split, the bounds hold and are the latest."""
    plan, kinds = shipped("two_sample_navigation"), normal(5, to_ridge=30, to_crater=40)
    exact = robust.risk(plan, kinds).probability
    original, calls = measures.share_of, []

    def interrupting(active, cell):
        calls.append(cell)
        if len(calls) == 120:
            raise KeyboardInterrupt
        return original(active, cell)

    monkeypatch.setattr(measures, "share_of", interrupting)
    told = []
    found = robust.risk(plan, kinds, on_bounds=told.append)
    assert found.status is RiskStatus.INTERRUPTED
    assert found.probability.lower <= exact.lower <= exact.upper <= found.probability.upper
    assert found.probability == told[-1]
    assert found.probability.width < F(1, 4)
    assert found.cells >= 119


def test_bounds_are_told_while_they_are_computed(monkeypatch):
    monkeypatch.setattr(risks, "TICK", 0.001)
    told = []
    robust.risk(shipped("two_sample_navigation"), normal(5, to_ridge=30, to_crater=40), within="1/50",
                on_bounds=told.append)  # fmt: skip
    assert len(told) > 5
    assert all(wide.lower <= close.lower and close.upper <= wide.upper for wide, close in pairwise(told))
