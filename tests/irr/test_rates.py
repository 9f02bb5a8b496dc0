"""Boxes where rates and durations vary at once: against executions and exact containment; what is not decided."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

import robust
from robust.encode import create_encoding
from robust.errors import InputError, UnsupportedError
from robust.irr.containment import Containment
from robust.irr.corners import CornerContainment, CornerWidening
from robust.irr.rates import rates_of
from robust.plan.model import Holds, Or
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from robust.qe.box import Side
from robust.smt.limits import NEVER
from tests.cli.running import answer_of, command
from tests.irr.rovers import random_rover, rover
from tests.plan.building import between
from tests.sampling import often, sample_schedules

EPSILON = Fraction(1, 1000)
SOLAR = [
    f"benchmarks/domains/solar_rover/{name}" for name in ("domain-yield.pddl", "problem-yield.pddl", "plan-yield.stn")
]


def drawn_value(random, interval, parameter):
    low = interval.lower if interval.lower is not None else -3 * abs(parameter.nominal) - 1
    high = interval.upper if interval.upper is not None else 3 * abs(parameter.nominal) + 1
    return random.choice([low, high, low + (high - low) * Fraction(random.randint(0, 64), 64)])


def drawn_point(random, plan, box):
    return {p.name: drawn_value(random, box[p.name], p) for p in plan.parameters}


def is_valid(plan, point, random, count=2):
    """Whether drawn schedules keep all obligations; at a point without a schedule nothing does."""
    schedules = sample_schedules(plan, point, random, count)
    return bool(schedules) and not any(simulate(plan, point, times, epsilon=EPSILON).violations for times in schedules)


def test_random_plans_against_executions():
    """20 draws in each box and at each of its sides are valid, and something just beyond each side is not."""
    seen = Counter()
    for seed in often(range(6), range(1000, 1220)):
        random = Random(seed)  # noqa: S311
        plan = random_rover(random)
        found = robust.envelope(plan)
        seen[found.status.value, found.inner is not None] += 1
        if not found.verified:
            continue
        for _ in range(20):
            assert is_valid(plan, drawn_point(random, plan, found.box), random), seed
        for (name, side), stop in found.stops.items():
            at_side = found.box.replace(
                name, replace(found.box[name], **{o.value: found.box[name].end(side) for o in Side})
            )
            for _ in range(20):
                assert is_valid(plan, drawn_point(random, plan, at_side), random), (seed, name, side, stop)
        beyond = {(point.parameter, point.side): point for point in found.inner.outer} if found.inner else {}
        for face, stop in found.stops.items():
            if found.inner is None or stop.name.startswith("declared bound"):
                continue
            point, nominal = beyond[face], next(p.nominal for p in plan.parameters if p.name == face[0])
            assert point.gap <= Fraction(1, 1000) * nominal, (seed, face)
            shown = point.counterexample
            assert not is_valid(plan, shown.parameters, random) or shown.simulation.violations
            again = simulate(plan, shown.parameters, shown.schedule, epsilon=EPSILON)
            assert again.violations
            assert not again.network_violations
            seen["executed"] += 1
    assert min(2 * seen["complete", True], seen["executed"] // 2) > 3, seen


def test_corners_decide_as_exact_containment_where_that_is_linear():
    """With fixed durations rates are linear: the box is inside the envelope, no longer if a side moves on by a step."""
    seen = 0
    for seed in often(range(1, 4), range(1000, 1040)):
        random = Random(seed)  # noqa: S311
        steps = [(random.choice(["drive", "recharge"]), random.randint(1, 6)) for _ in range(4)]
        rates = {"drain": 2, "gain": random.randint(2, 5), "load": 1}
        plan = rover([*steps, ("work", 2)], rates, ["drain", "gain", "load"], slack="0.001")
        encoding = create_encoding("relational", plan, EPSILON)
        exact = Containment(encoding)
        search = CornerWidening(CornerContainment(encoding, rates_of(plan)))
        result = search.run()
        if not result.verified:
            continue
        seen += 1
        assert exact.contains(result.box, NEVER)
        for (name, side), stop in result.stops.items():
            if not stop.name.startswith(("declared bound", "nothing up to")):
                wider = result.box.moved((name, side), result.box[name].end(side) + side.sign * search.steps[name])
                assert not exact.contains(wider, NEVER), (seed, name, side)
    assert seen > 1


def test_ends_of_rates_that_can_break_something():
    plan = rover([("drive", 4), ("work", 2)], {"drain": 2, "gain": 3, "load": 1}, ["drain", "load", 0])
    found = rates_of(plan)
    assert {name: found.breaking(name) for name in found.names} == {"drain": (Side.UPPER,), "load": (Side.UPPER,)}
    both = rover([("drive", 4), ("recharge", 3), ("work", 2)], {"drain": 2, "gain": 3, "load": 1}, ["drain", "gain", 0])
    fast, slow = (
        (("drain", (Side.UPPER,)), ("gain", (Side.LOWER,))),
        (("drain", (Side.LOWER,)), ("gain", (Side.UPPER,))),
    )
    assert rates_of(both).demands.keys() == {fast, slow}
    found = robust.envelope(plan).box
    assert found["drain"].lower == found["load"].lower == 0


def test_what_reads_a_level_keeps_apart_from_what_changes_it():
    """Work ends, and takes its share at once, 6.002 after the beginning at the earliest; the charge is read at 7."""
    steps, rates = [("drive", 4), ("work", 2)], {"drain": 2, "gain": 3, "load": 1}
    plan = rover(steps, rates, ["drain", 0, 1], slack="0.001", measured=7)
    found = robust.envelope(plan)
    separation = "separation: s1.end, m.start"
    stops = {face: stop.name for face, stop in found.stops.items()}
    assert stops["d0", Side.UPPER] == stops["d1", Side.UPPER] == separation
    longest = found.box["d0"].upper + found.box["d1"].upper
    assert Fraction(6996, 1000) <= longest <= Fraction(6997, 1000)
    questions, step = CornerContainment(create_encoding("relational", plan, EPSILON), rates_of(plan)), Fraction(1, 100)
    longer, shorter = (("d0", side) for side in (Side.UPPER, Side.LOWER))
    inner = found.box.moved(shorter, found.box["d0"].upper)
    assert questions.ended_by(inner, {longer: step, shorter: step}, NEVER) == {longer: (separation,), shorter: ()}


def test_values_that_leave_no_schedule_refute():
    plan = rover([("drive", 4), ("work", 2)], {"drain": 2, "gain": 3, "load": 1}, ["drain", 0])
    drive = plan.instances[0]

    def limited(longest):
        return replace(plan, constraints=(*plan.constraints, between(drive.start, drive.end, 0, longest)))

    found = robust.check(limited(5), at={"d0": 9})
    assert (found.answer, found.counterexamples) == (robust.Answer.REFUTED, {})
    assert found.reason.startswith("no schedule with ")
    assert "d0 = 9" in found.reason
    stop = robust.envelope(limited(Fraction(9, 2))).stops["d0", Side.UPPER]
    assert (stop.name, len(stop.statements)) == ("no schedule", 1)
    with pytest.raises(InputError, match="the plan's network has no schedule"):
        robust.check(limited(-1), at={"d0": 9})


def test_what_corners_do_not_decide():
    plan = rover([("drive", 4), ("work", 2)], {"drain": 2, "gain": 3, "load": 1}, ["drain", 0])
    (drain,) = (name for name in plan.initial_fluents if str(name) == "(drain)")
    square = Polynomial.variable(drain) * Polynomial.variable(drain)
    drive, work = plan.instances
    squared = replace(drive, continuous_effects=(replace(drive.continuous_effects[0], rate=square),))
    with pytest.raises(UnsupportedError, match="a rate is multiplied by itself"):
        rates_of(replace(plan, instances=(squared, work)))
    decisive = replace(work.numeric_effects[0], condition=work.conditions[1].condition)
    with pytest.raises(UnsupportedError, match="s1 work: a rate decides whether an effect happens"):
        rates_of(replace(plan, instances=(drive, replace(work, numeric_effects=(decisive,)))))
    charged = work.conditions[1]
    either = replace(charged, condition=Or((charged.condition, Holds(work.atom_effects[0].atom))))
    with pytest.raises(UnsupportedError, match="rates in one of several alternatives"):
        rates_of(replace(plan, instances=(drive, replace(work, conditions=(either,)))))
    with pytest.raises(UnsupportedError, match="found no parameter that multiplies time"):
        rates_of(rover([("work", 2)], {"drain": 2, "gain": 3, "load": 1}, [0]))


def test_answers_name_the_inner_box():
    ended = command("envelope", *SOLAR, "--parameter", "duration:sun", "--json")
    answer = answer_of(ended, "robust/envelope/1")
    assert (ended.code, answer["status"], answer["verified"], answer["inner"]["rates"]) == (
        0,
        "complete",
        True,
        ["yield"],
    )
    sides = {(point["parameter"], point["side"]) for point in answer["inner"]["outer"]}
    assert sides == {(name, side) for name in ("yield", "on_1", "dur_sun") for side in ("lower", "upper")}
    assert all(point["counterexample"]["violations"] for point in answer["inner"]["outer"])
    assert "a sound inner box: at most " in command("envelope", *SOLAR, "--parameter", "duration:sun").out
    coarse = answer_of(command("envelope", *SOLAR, "--parameter", "duration:sun", "--method", "irr", "--json"))
    assert (coarse["method"], coarse["inner"]["rates"]) == ("irr", ["yield"])
    refused = command("envelope", *SOLAR, "--parameter", "duration:sun", "--method", "optimal")
    assert (refused.code, "non-linear continuous effect" in refused.err) == (4, True)
