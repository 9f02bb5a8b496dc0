"""Checks and regions where rates and times vary at once: against executions, and points against each other."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

import robust
from robust.errors import UnsupportedError
from robust.irr.check import Answer
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from robust.qe.box import Box
from robust.searching import Status
from tests.cli.running import answer_of, command
from tests.irr.rovers import random_rover, rover
from tests.irr.test_rates import EPSILON, SOLAR, drawn_point, is_valid
from tests.sampling import often

RATES = {"drain": 2, "gain": 3, "load": 1}
SHORT = rover([("work", 2)], {"drain": 2, "gain": 3, "load": 11}, ["load", 0], slack="0.001")
"""Works for d0, which takes load for each unit of time: 60 - load * d0 stays at 5 or more."""


def drawn_box(random, plan):
    """Some parameters in an interval around their nominal values, the others at one value each."""
    box = {}
    for parameter in plan.parameters:
        ends = sorted(parameter.nominal * Fraction(random.randint(60, 140), 100) for _ in range(2))
        box[parameter.name] = ends if random.random() < 0.5 else ends[:1] * 2
    return box


def require_confirmed(plan, shown, box):
    assert box.includes(shown.parameters)
    again = simulate(plan, shown.parameters, shown.schedule, epsilon=EPSILON)
    assert any(violation.obligation == shown.obligation for violation in again.violations)
    assert not again.network_violations


def test_checks_against_executions():
    """Nothing breaks in what is proved, and what is refuted breaks; nothing is left undecided."""
    seen = Counter()
    for seed in often(range(12), range(1000, 1400)):
        random = Random(seed)  # noqa: S311
        plan = random_rover(random)
        at = drawn_box(random, plan)
        found = robust.check(plan, at=at, every=random.random() < 0.3)
        seen[found.answer] += 1
        box = Box.declared(plan.parameters).changed(found.box.intervals)
        for shown in found.counterexamples.values():
            require_confirmed(plan, shown, box)
        assert bool(found.counterexamples) == (found.answer is Answer.REFUTED), seed
        if found.answer is Answer.PROVED:
            assert all(is_valid(plan, drawn_point(random, plan, found.box), random) for _ in range(10)), seed
            assert set(found.obligations.values()) == {Answer.PROVED}
    assert seen[Answer.UNKNOWN] == 0
    assert min(seen[Answer.PROVED], seen[Answer.REFUTED]) > sum(seen.values()) // 10


def test_checks_that_corners_do_not_decide():
    plan = rover([("drive", 4), ("work", 2)], RATES, ["drain", 0], slack="0.001")
    (drain,) = (name for name in plan.initial_fluents if str(name) == "(drain)")
    square = Polynomial.variable(drain) * Polynomial.variable(drain) * Polynomial.constant(Fraction(-1))
    drive, work = plan.instances
    squared = replace(drive, continuous_effects=(replace(drive.continuous_effects[0], rate=square),))
    plan = replace(plan, instances=(squared, work))
    assert robust.check(plan).answer is Answer.PROVED
    open_ = robust.check(plan, at={"drain": ("1", "2.5"), "d0": (3, 4)})
    assert open_.answer is Answer.UNKNOWN
    assert open_.reason is not None
    assert "a rate is multiplied by itself" in open_.reason
    assert open_.reason.endswith("with one value each for drain by --at it is decided")
    refuted = robust.check(plan, at={"drain": (1, 9), "d0": (3, 4)})
    assert refuted.answer is Answer.REFUTED
    require_confirmed(plan, refuted.counterexamples[next(iter(refuted.counterexamples))], refuted.box)
    endless = robust.check(
        rover([("drive", 4), ("work", 2)], RATES, ["load", 1], slack="0.001", reserve=0, charge=4),
        at={"load": (0, "inf"), "d1": (1, 2)},
    )
    assert endless.answer is Answer.REFUTED
    for values in ("0.005", ("0.005", 2)):
        beyond = robust.check(SHORT, at={"d0": values, "load": (1, 2)})
        assert (beyond.answer, beyond.reason) == (
            Answer.REFUTED,
            "no schedule with d0 = 1/200: parameter d0 lb 1/100 cannot hold",
        )
    loose = rover([("drive", 4), ("recharge", 2)], RATES, ["gain", 1], slack="0.001", charge=50)
    assert robust.check(loose, at={"gain": (0, 5), "d1": (1, 2)}).answer is Answer.REFUTED  # nothing is done


def test_regions_against_executions():
    """What is inside is valid and holds the box, what is outside is refuted; little is left between."""
    seen = Counter()
    for seed in often(range(2), range(1000, 1060)):
        random = Random(seed)  # noqa: S311
        plan = random_rover(random)
        found = robust.region(plan)
        seen[found.status] += 1
        inner = found.inner()
        if found.box is not None:
            assert inner.contains_box(found.box), seed
            assert found.region.contains_box(found.box), seed
        declared = Box.declared(plan.parameters)
        around = {p.name: replace(declared[p.name], upper=3 * p.nominal) for p in plan.parameters}
        for _ in range(often(10, 40)):
            point = drawn_point(random, plan, Box(around))
            answer = robust.check(plan, at=point).answer
            if found.is_proved(point):
                assert point in inner
                assert answer is Answer.PROVED, (seed, point)
                assert is_valid(plan, point, random), (seed, point)
                seen["inside"] += 1
            elif point not in found.region:
                assert answer is Answer.REFUTED, (seed, point)
                seen["outside"] += 1
            else:
                seen["open"] += 1
    assert seen[Status.UNKNOWN] > 0
    assert min(seen["inside"], seen["outside"]) > 3
    assert seen["open"] < seen["inside"] + seen["outside"]


def test_regions_say_what_they_are():
    ended = command("region", *SOLAR, "--parameter", "duration:sun")
    assert ended.code == 3
    assert "16 slices of yield, which multiplies times that vary: an outer bound of the envelope" in ended.out
    assert "The plan is certain to be valid for yield ∈ [3.131, 4.88], on_1" in ended.out
    assert "open: 11.8 % of yield ∈ [1.131, 7.32], on_1 ∈ [1, 12], dur_sun ∈ [19.996, 43]" in ended.out
    short = answer_of(command("region", *SOLAR, "--parameter", "duration:sun", "--json", "--timeout", "0.01"))
    assert short["status"] == "timeout"
    answer = robust.region(SHORT).as_dict()
    assert (answer["status"], answer["reason"]) == ("unknown", "16 slices of load, which multiplies times that vary")
    assert answer["meaning"].endswith(answer["reason"])
    assert answer["open_share"] is None  # of an infinite area


def test_regions_that_slices_do_not_bound():
    plan = rover([("drive", 4), ("work", 2)], RATES, [0, 1])
    drive, work = plan.instances
    (effect,) = work.numeric_effects
    (duration,) = effect.expression.variables - {*plan.initial_fluents}
    twice = Polynomial.variable(duration) * Polynomial.variable(duration)
    squared = replace(work, numeric_effects=(replace(effect, expression=twice),))
    with pytest.raises(UnsupportedError, match="found no parameter that multiplies time"):
        robust.region(replace(plan, instances=(drive, squared)))


def test_comparisons_and_risk_use_the_slices():
    """Gaps are those of executions just beyond; the probability is between bounds, and drawn points say the same."""
    compared = robust.compare(SHORT)
    assert [entry.method for entry in compared.entries] == ["irr", "widen"]
    gaps = {(face.parameter, face.side.value): face.gap for face in compared.entries[1].faces}
    assert all(gap <= Fraction(1, 100) for face, gap in gaps.items() if face[1] == "upper")
    assert compared.region.reason == "16 slices of load, which multiplies times that vary"
    random, draws = Random(1), 1000  # noqa: S311
    found = robust.risk(SHORT, {"load": "uniform:0:40", "d0": "uniform:1:4"}, within=Fraction(1, 50))
    points = ({"load": 40 * Fraction(random.random()), "d0": 1 + 3 * Fraction(random.random())} for _ in range(draws))
    share = Fraction(sum(point["load"] * point["d0"] <= 55 for point in points), draws)
    bounds = found.probability
    assert bounds.width < Fraction(1, 10)
    assert bounds.lower - Fraction(1, 20) < share < bounds.upper + Fraction(1, 20)
