"""The recorded instances: valid as planned, and refuted just outside the recorded boxes."""

import json
from fractions import Fraction
from pathlib import Path

import pytest

import robust
from robust.encode.encoding import RelationalEncoding
from robust.irr.containment import Containment
from robust.qe.box import Box, Interval, Side
from robust.smt.limits import Deadline

STEP = Fraction(2)
"""The doubling schedule with β = 1 leaves less than this between a face and the envelope."""


@pytest.fixture(scope="module")
def recorded(dataset: Path) -> list[dict]:
    return json.loads((dataset / "recorded-results.json").read_text())


def grown(box: Box, name: str, side: Side) -> Box:
    interval = box[name]
    if side is Side.UPPER:
        return box.replace(name, Interval(interval.lower, interval.upper + STEP))
    return box.replace(name, Interval(interval.lower - STEP, interval.upper))


def test_plans_are_proved_and_points_outside_their_boxes_refuted(dataset: Path, recorded: list[dict]) -> None:
    shown = 0
    for instance in recorded:
        plan = robust.load_plan(*(dataset / instance[key] for key in ("domain", "problem", "plan")))
        assert robust.check(plan).answer is robust.Answer.PROVED, instance["instance"]
        box = Box({name: Interval(Fraction(low), Fraction(high)) for name, (low, high) in instance["irr_box"].items()})
        containment = Containment(RelationalEncoding(plan))
        for name in box.intervals:
            for side in Side:
                wider = grown(box, name, side)
                outside = containment.refute(wider, Deadline())
                assert outside is not None, (instance["instance"], name, side)
                assert outside.values in wider
                assert outside.values not in box
                result = robust.check(plan, at=outside.values)
                assert result.answer is robust.Answer.REFUTED, (instance["instance"], outside)
                # Each counterexample has been executed by the simulator; without one there is no schedule at all.
                assert result.counterexamples or "no schedule" in (result.reason or "")
                shown += len(result.counterexamples)
    assert shown > len(recorded)


def test_delivery_plans_are_proved(dataset: Path) -> None:
    instances = json.loads((dataset / "robot-delivery" / "instances.json").read_text())
    assert len(instances) == 27
    for instance in instances:
        plan = robust.load_plan(*(dataset / instance[key] for key in ("domain", "problem", "plan")))
        assert len(plan.parameters) == instance["parameters"]
        assert robust.check(plan).answer is robust.Answer.PROVED, instance["instance"]
