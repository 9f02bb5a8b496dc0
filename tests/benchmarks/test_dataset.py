"""The recorded results are reproduced: boxes fraction by fraction, and the number of checks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path

import pytest

from benchmarks.suite import RecordedInstance, read_suite
from robust.api import envelope
from robust.encode.encoding import RelationalEncoding
from robust.irr.containment import Containment
from robust.irr.search import EnvelopeResult, Status
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Box, Interval, Side
from robust.smt.limits import Deadline
from tests.benchmarks.conftest import MakeSuite, run

SMALL = ("auv_mission_10_0_3", "generator_linear_05_2", "solar_rover_01_3")
BETA = Fraction(1)


def assert_reproduced(instance: RecordedInstance, result: EnvelopeResult) -> None:
    assert instance.irr is not None
    assert result.status is Status.COMPLETE, instance.name
    assert result.box == instance.box, instance.name
    assert result.checks == instance.irr.checks, instance.name


def test_small_instances_by_the_real_command(dataset: Path, make_suite: MakeSuite) -> None:
    wanted = [instance for instance in read_suite(dataset) if instance.name in SMALL]
    entries = [
        {
            "instance": one.name,
            **dict(zip(("domain", "problem", "plan"), (str(path.resolve()) for path in one.files), strict=True)),
            "irr": asdict(one.irr),
            "irr_box": {
                name: [str(interval.lower), str(interval.upper)] for name, interval in one.box.intervals.items()
            },
            "irr_order": list(one.order),
        }
        for one in wanted
        if one.irr is not None and one.box is not None
    ]
    report = run("recorded", suite=make_suite(*entries), limit=300)
    assert [row.instance.name for row in report.rows] == list(SMALL)
    assert [row.verdict for row in report.rows] == ["equal"] * len(SMALL)
    assert report.agrees


def test_all_instances_in_process(dataset: Path) -> None:
    for instance in read_suite(dataset):
        plan = load_plan(*instance.files)
        assert_reproduced(instance, envelope(plan, method="irr", beta=BETA, doubling=True, order=instance.order))


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_all_instances_with_each_solver(dataset: Path, solver: str) -> None:
    """Boxes equal the recorded ones, and a solver that took no part in the search confirms them."""
    other = {"z3": "cvc5", "cvc5": "z3"}[solver]
    for instance in read_suite(dataset):
        plan = load_plan(*instance.files)
        result = envelope(plan, method="irr", beta=BETA, doubling=True, order=instance.order, solver=solver)
        assert_reproduced(instance, result)
        assert is_inside(plan, result.box, other), instance.name


@pytest.mark.slow
def test_the_default_schedule_keeps_its_promise(dataset: Path) -> None:
    """No side can grow by β unless it is at a declared bound, by z3 and by cvc5."""
    for instance in read_suite(dataset):
        plan = load_plan(*instance.files)
        result = envelope(plan, method="irr", beta=BETA)
        assert result.status is Status.COMPLETE
        for solver in ("z3", "cvc5"):
            assert is_inside(plan, result.box, solver), (instance.name, solver)
            for name, side, grown in grown_boxes(plan, result.box):
                assert not is_inside(plan, grown, solver), (instance.name, solver, name, side)


def is_inside(plan: ParametrizedPlan, box: Box, solver: str) -> bool:
    """By a containment check that knows nothing of the search: no proof or refutation is remembered."""
    return Containment(RelationalEncoding(plan), solver=solver).refute(box, Deadline.after(None)) is None


def grown_boxes(plan: ParametrizedPlan, box: Box) -> Iterator[tuple[str, Side, Box]]:
    """The box with one side moved by β, for every side that is finite and not at a declared bound."""
    for parameter in plan.parameters:
        name, interval = parameter.name, box[parameter.name]
        if interval.lower is not None and interval.lower != parameter.lower:
            yield name, Side.LOWER, box.replace(name, Interval(interval.lower - BETA, interval.upper))
        if interval.upper is not None and interval.upper != parameter.upper:
            yield name, Side.UPPER, box.replace(name, Interval(interval.lower, interval.upper + BETA))
