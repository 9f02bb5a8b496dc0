"""The probability of success and the most probable box: known figures, brute force on drawn plans, and limits."""

from fractions import Fraction
from itertools import combinations, pairwise
from random import Random

import pytest
from hypothesis import given

import robust
from robust import Box, InputError, Interval, Status
from robust.encode.encoding import RelationalEncoding
from robust.execute.learned import distributions_of
from robust.execute.rules import parse_rules
from robust.irr.containment import Containment
from robust.irr.widen import DiscoveredBadSet
from robust.plan.model import ZERO, Parameter
from robust.probability import measure as measures
from robust.probability import risk as risks
from robust.probability.measure import Bounds, box_probability
from robust.probability.packing import Packing
from robust.probability.risk import Risk, RiskStatus
from robust.qe.estimate import proportion_bounds
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from tests.irr.building import lasts, parameter, parametric, shipped, timed
from tests.irr.test_boxes import assert_maximal
from tests.plan.building import action, between, drawn, plan_of, reference

F = Fraction
NAVIGATION = shipped("two_sample_navigation")
NORMAL = {"to_ridge": "normal:30:5", "to_crater": "normal:40:5"}


def holds(bounds: Bounds, value: Fraction) -> bool:
    return bounds.lower <= value <= bounds.upper


@pytest.mark.parametrize(("deviation", "expected"), [(5, "0.8589"), (8, "0.6155")])
def test_the_probability_that_the_rover_succeeds(deviation, expected):
    kinds = {"to_ridge": f"normal:30:{deviation}", "to_crater": f"normal:40:{deviation}"}
    result = robust.risk(NAVIGATION, kinds, draws=3000 if deviation == 5 else None)
    assert (result.status, result.disjoint) == (RiskStatus.COMPLETE, ())
    assert result.probability.width <= F(1, 1000)
    assert abs((result.probability.lower + result.probability.upper) / 2 - F(expected)) <= F(1, 1000)
    # What fails adds up to what is left, and every box keeps less.
    least = sum(one.probability.lower for one in result.shares)
    most = sum(one.probability.upper for one in result.shares)
    assert least <= 1 - result.probability.lower
    assert most >= 1 - result.probability.upper
    assert most - least < F(1, 100)
    assert {one.method for one in result.kept} == {"irr", "widen", "optimal"}
    assert all(one.probability.upper <= result.probability.upper for one in result.kept)
    if deviation == 5:
        assert result.estimate.draws == 3000
        assert 0.83 < result.estimate.lower <= float(expected) <= result.estimate.upper
    else:
        assert result.estimate is None


def test_shares_are_those_of_the_sides_of_the_pentagon():
    """With a constant drive to the ridge the crater is all that is random: shares are those of intervals."""
    result = robust.risk(NAVIGATION, {"to_ridge": "constant:30", "to_crater": "uniform:20:60"}, within="1/1000000")
    assert holds(result.probability, F(19, 40))  # 30 to 49
    shares = {one.name: one.probability for one in result.shares if one.probability.lower}
    (dark,) = [name for name in shares if "lit crater" in name]
    assert holds(shares[dark], F(1, 4))  # 20 to 30
    assert sum(one.lower for one in shares.values()) > F(52, 100)
    plan = shipped("two_sample_navigation", "to_ridge,lb=28,ub=32", "to_crater,lb=40,ub=40")
    declared = robust.risk(plan, {"to_ridge": "uniform:20:40", "to_crater": "constant:40"})
    assert holds(declared.probability, F(1, 5))
    assert [one.name for one in declared.shares if one.probability.lower] == ["declared bounds"]
    assert holds(declared.shares[0].probability, F(4, 5))


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


def test_bounds_agree_with_random_points_on_drawn_plans():
    """The point checker asks the solver of each point; the interval of Clopper and Pearson meets the bounds."""
    between = 0

    @drawn(8)
    @given(parametric().filter(lambda plan: len(plan.parameters) <= 4))
    def run(plan):
        nonlocal between
        random = Random(str(plan.parameters))  # noqa: S311 - reproducible
        kinds = {one.name: some_distribution(one, random) for one in plan.parameters}
        result = robust.risk(plan, kinds, within="1/200", timeout=20)
        distributions = distributions_of(plan, kinds)
        checker = Containment(RelationalEncoding(plan))
        good = 0
        for _ in range(250):
            point = {name: one.settled.draw(random, None) for name, one in distributions.items()}
            good += checker._look_in(Box.point(point), NEVER) is None
        lower, upper = proportion_bounds(good, 250, 0.999)
        assert result.probability.lower <= F(upper)
        assert result.probability.upper >= F(lower)
        between += 0 < good < 250
        assert sum(one.probability.upper for one in result.shares or ()) >= 1 - result.probability.upper

    run()
    assert between >= 2


def searched(plan, kinds, **options):
    """The result with the probability of its box."""
    result = robust.envelope(plan, method="risk", distribution=kinds, **options)
    return result, box_probability(result.box, distributions_of(plan, kinds))


def test_the_most_probable_box_of_drive_times():
    result, kept = searched(NAVIGATION, NORMAL)
    assert result.status is Status.COMPLETE
    assert kept.lower > F("0.5382")
    assert result.bound - F(5, 1000) <= kept.lower <= result.bound < F("0.5434")
    assert_maximal(NAVIGATION, result.box)
    assert len(result.stops) == 4
    away, kept = searched(NAVIGATION, {"to_ridge": "normal:45:1", "to_crater": "normal:30:1"})
    assert kept.lower > F(9, 10)
    assert {"to_ridge": F(45), "to_crater": F(30)} in away.box
    never = {"to_ridge": "uniform:60:70", "to_crater": "uniform:60:70"}
    nothing, kept = searched(NAVIGATION, never)
    assert kept.upper == robust.risk(NAVIGATION, never).probability.upper == 0
    assert nothing.bound in (None, 0)


@pytest.mark.parametrize("crater", ["uniform:20:60", "triangular:20:45:60", "exponential:40:20"])
def test_with_one_random_parameter_the_box_is_all_that_is_valid(crater):
    kinds = {"to_ridge": "constant:30", "to_crater": crater}
    result, kept = searched(NAVIGATION, kinds)
    assert result.box.ranges["to_crater"] == (30, 49)
    success = robust.risk(NAVIGATION, kinds).probability
    assert max(success.lower, kept.lower) <= min(success.upper, kept.upper)
    assert result.bound >= kept.lower


@drawn(12, 60)
@given(parametric().filter(lambda plan: len(plan.parameters) <= 2))
def test_no_random_box_is_more_probable_than_the_bound(plan):
    kinds = {one.name: f"normal:{one.nominal}:{2 + index}" for index, one in enumerate(plan.parameters)}
    try:
        result, kept = searched(plan, kinds, within="0.02", timeout=20)
    except InputError:
        return  # there is no schedule
    if result.status is not Status.COMPLETE or not result.verified:
        return
    containment = Containment(RelationalEncoding(plan))
    assert containment.contains(result.box, NEVER)
    assert result.bound is None or kept.lower <= result.bound
    random, distributions = Random(3), distributions_of(plan, kinds)  # noqa: S311 - reproducible
    for _ in range(40):
        around = ((one, [one.nominal + F(random.randint(-32, 32), 8) for _ in range(2)]) for one in plan.parameters)
        box = Box({one.name: Interval(*sorted(ends)) for one, ends in around})
        if containment.contains(box, NEVER):
            assert result.bound is None or box_probability(box, distributions).lower <= result.bound


def late(count: int):
    """One action whose duration is the sum of so many parameters, and must be at most what it is expected to be."""
    names = [f"p{number}" for number in range(count)]
    parameters = [Parameter(name, F(10)) for name in names]
    return timed(*parameters, pieces=lasts(0, 10 * count + 8)), dict.fromkeys(names, "normal:10:2")


def test_boxes_without_common_points_bound_the_probability_from_below(monkeypatch):
    plan, kinds = late(3)
    distributions = distributions_of(plan, kinds)
    packing = Packing(DiscoveredBadSet(RelationalEncoding(plan)), plan.parameters, distributions)
    find = packing._good_point
    out_of_time = Deadline.after(0)
    monkeypatch.setattr(
        packing, "_good_point", lambda part, _: find(part, out_of_time if len(packing.boxes) > 12 else NEVER)
    )
    with pytest.raises(OutOfTimeError):
        packing.run(NEVER)
    assert len(packing.boxes) > 12
    exact = robust.risk(plan, kinds).probability
    assert exact.lower - F(1, 4) < packing.lower <= exact.upper
    checker = Containment(RelationalEncoding(plan))
    assert all(checker.contains(one, NEVER) for one in packing.boxes[:20])
    names = [one.name for one in plan.parameters]
    pieces = [Polyhedron.of_box(names, one) for one in packing.boxes[:40]]
    assert all(one.intersection(other).is_empty for one, other in combinations(pieces, 2))
    assert packing.lower == sum(box_probability(one, distributions).lower for one in packing.boxes)


def test_with_many_parameters_there_is_an_estimate_beside_sound_bounds():
    result = robust.risk(*late(8), timeout=1)
    assert result.status in {RiskStatus.WIDE, RiskStatus.TIMEOUT}
    # The sum is normal: Φ(8 / (2 √8)) = Φ(√2) = 0.92135.
    assert holds(result.probability, F("0.92135"))
    if result.estimate is not None and result.estimate.draws:
        assert result.estimate.lower <= 0.9214
        assert result.estimate.upper >= 0.9213


def test_out_of_time_the_bounds_are_sound():
    result = robust.risk(NAVIGATION, NORMAL, timeout=0, within="1/1000000000")
    assert result.status is RiskStatus.TIMEOUT
    assert holds(result.probability, F("0.8589"))
    search = Risk(NAVIGATION, distributions_of(NAVIGATION, NORMAL))
    assert search.so_far(timed_out=False).status is RiskStatus.INTERRUPTED
    assert search.so_far(timed_out=True).probability == Bounds(F(0), F(1))


def test_bounds_are_those_of_the_moment_when_it_is_interrupted(monkeypatch):
    """Whatever is interrupted in the middle of a split, the bounds hold and are the latest."""
    exact = robust.risk(NAVIGATION, NORMAL).probability
    original, calls = measures.share_of, []

    def interrupting(active, cell):
        calls.append(cell)
        if len(calls) == 120:
            raise KeyboardInterrupt
        return original(active, cell)

    with monkeypatch.context() as patched:
        patched.setattr(measures, "share_of", interrupting)
        reported = []
        result = robust.risk(NAVIGATION, NORMAL, on_bounds=reported.append)
    assert result.status is RiskStatus.INTERRUPTED
    assert result.probability.lower <= exact.lower <= exact.upper <= result.probability.upper
    assert result.probability == reported[-1]
    assert result.probability.width < F(1, 4)
    assert result.cells >= 119
    monkeypatch.setattr(risks, "TICK", 0.001)
    reported.clear()
    robust.risk(NAVIGATION, NORMAL, within="1/50", on_bounds=reported.append)
    assert len(reported) > 5
    assert all(wide.lower <= close.lower and close.upper <= wide.upper for wide, close in pairwise(reported))


def test_a_world_says_how_durations_and_parameters_are_distributed():
    drives = parse_rules('[[draw]]\nduration = "drive"\ndistribution = "normal"\ndeviation = 4\nminimum = 10\n')
    ridge = parse_rules('[[draw]]\nparameter = "to_ridge"\ndistribution = "triangular"\nlower = 20\nupper = 50\n')
    for given_, world, expected in (
        ((), drives, ("normal:30:4:10", "normal:40:4:10")),
        (["to_crater=exponential:40:30"], ridge, ("triangular:20:30:50", "exponential:40:30")),
        ((), ridge, ("triangular:20:30:50", "constant:40")),
    ):
        known = distributions_of(NAVIGATION, given_, world)
        assert {name: str(one) for name, one in known.items()} == dict(zip(NORMAL, expected, strict=True))
    flights = parse_rules('[[draw]]\nduration = "fly"\ndistribution = "uniform"\nlower = 1\nupper = 2\n')
    with pytest.raises(InputError, match="found no distribution of a parameter"):
        distributions_of(NAVIGATION, (), flights)


def test_the_most_precise_name_counts_and_shares_are_of_the_planned_value():
    for given_, expected in (
        (["*=truncated-normal::15%:50%"], ("truncated-normal:30:4.5:15", "truncated-normal:40:6:20")),
        (["drive=constant:3", "*=constant:1", "duration:*=constant:2"], ("constant:3", "constant:3")),
        (["duration:*=constant:2", "*=constant:1"], ("constant:2", "constant:2")),
        ({"(drive  scout Base ridge)": "constant:4", "drive": "constant:3"}, ("constant:4", "constant:3")),
        (["to_crater=empirical:90%,50:1,3"], ("constant:30", "empirical:36,50:1,3")),
    ):
        assert tuple(map(str, distributions_of(NAVIGATION, given_).values())) == expected
    rules = parse_rules('[[draw]]\nduration = "*"\ndistribution = "normal"\ndeviation = "15%"\nminimum = 1\n')
    known = distributions_of(NAVIGATION, {"to_ridge": "constant:1"}, rules)
    assert tuple(map(str, known.values())) == ("constant:1", "normal:40:6:1")


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        ([], "found no distribution of a parameter, expected one such as normal::10%; known are to_ridge, to_crater"),
        (["fly=normal:30:5"], "found unknown parameter 'fly'"),
        (["duration:(drive ridge base)=normal:30:5"], "found unknown parameter 'duration:(drive ridge base)'"),
        (["*=normal::5", "*=normal::15%"], "found a second distribution of '*'"),
        (["to_ridge"], "found 'to_ridge', expected NAME=DISTRIBUTION"),
        (["to_rigde=normal:30:5"], "did you mean 'to_ridge'?"),
        (["drvie=normal:30:5"], "did you mean 'drive'"),
        (["take-sample=normal:30:5"], "duration of 'take-sample', expected one; 'duration:take-sample' as a parameter"),
        (["to_ridge=normal:30:5", "to_ridge=normal:30:5"], "found a second distribution of 'to_ridge'"),
        ({"to_ridge": "normal:30:-5"}, "found deviation -5, expected a number above 0"),
    ],
)
def test_wrong_distributions_are_one_line(given_, message):
    with pytest.raises(InputError) as caught:
        robust.risk(NAVIGATION, given_)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("wait", "dynamic", "strong"),
    [((0, 3), 1, 0), ((0, 100), 1, 1), ((-5, -5), 0, 0)],
    ids=["seen", "fixed", "foreseen"],
)
def test_where_all_values_succeed_executors_and_schedules_may_not(wait, dynamic, strong):
    """Actions that begin soon after another has ended, some time after it, or shortly before it ends."""
    lengths = [parameter(f"p{number}", 10) for number in range(5)]
    actions = [action(f"i{number}") for number in range(len(lengths))]
    constraints = [between(ZERO, actions[0].start, 0)]
    for one, known in zip(actions, lengths, strict=True):
        constraints.append(between(one.start, one.end, reference(known.name), reference(known.name)))
    for before, one in pairwise(actions):
        constraints.append(between(before.end, one.start, *wait))
    plan = plan_of(*actions, parameters=lengths, constraints=constraints)
    result = robust.risk(plan, {"*": "uniform:8:13"})
    known = result.probabilities
    assert (result.status, result.probability.lower, known.weak.lower) == (RiskStatus.COMPLETE, 1, 1)
    assert (known.dynamic.lower, known.best_dynamic.lower) == (dynamic, dynamic)
    assert (known.strong.lower, known.best_strong.lower) == (strong, strong)
    assert {bounds.upper for bounds in (known.dynamic, known.strong)} == {1}
    assert len(known.starts) == strong * len(actions)
    assert ("one fixed schedule: 1.0000" in str(result)) is bool(strong)
