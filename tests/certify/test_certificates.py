"""Certificates of plans and boxes: the examples, and the recorded data where it is at hand."""

import random
from fractions import Fraction

import pytest

from benchmarks.suite import read_suite
from robust.certify.document import mismatch
from robust.certify.ground import GroundPlan
from robust.certify.produce import schedule_over
from robust.errors import RefutedError, UnsupportedError
from robust.plan.load import load_plan
from robust.plan.simulate import simulate
from robust.qe.box import Interval
from robust.smt.limits import Deadline
from tests.certify import tools

RECORDED = ("mission_10_0_3", "plan_05_2", "plan_01_3", "plan_g02_w06")
LARGEST = 10_000_000


def recorded(dataset, name):
    """The files of a recorded plan."""
    delivery = dataset / "robot-delivery"
    if (delivery / f"{name}.stn").exists():
        return delivery / "domain.pddl", delivery / f"problem_{name[5:]}.pddl", delivery / f"{name}.stn"
    return next(one.files for one in read_suite(dataset) if one.files[2].stem == name)


def named(files):
    return f"{files[2].parent.name}-{files[2].stem}"


def accepted(files, kind, path):
    plan, _ = tools.certificate(files, path, kind=kind)
    given = {name: str(file) for name, file in tools.by_name(files).items()}
    assert tools.rejection(path, given) is None
    assert mismatch(path, plan, Deadline()) is None
    assert path.stat().st_size < LARGEST


@pytest.mark.parametrize("files", [tools.NAVIGATION, tools.GENERATOR], ids=named)
@pytest.mark.parametrize("kind", ["plan", "maximal"])
def test_certificates_are_accepted(files, kind, tmp_path):
    accepted(files, kind, tmp_path / "made.cert")


@pytest.mark.parametrize("name", RECORDED)
@pytest.mark.parametrize("kind", ["plan", "maximal"])
def test_certificates_of_recorded_plans_are_accepted(dataset, name, kind, tmp_path):
    accepted(recorded(dataset, name), kind, tmp_path / "made.cert")


def test_a_box_that_is_not_valid_has_no_certificate(tmp_path):
    _, box = tools.certificate(tools.GENERATOR, tmp_path / "made.cert", kind="box")
    name = next(iter(box.intervals))
    wider = box.replace(name, Interval(box[name].lower, None, box[name].lower_closed, False))
    with pytest.raises((RefutedError, UnsupportedError)):
        tools.certificate(tools.GENERATOR, tmp_path / "wrong.cert", kind="box", box=wider)


def test_a_certificate_is_not_about_another_plan(tmp_path):
    path = tmp_path / "made.cert"
    tools.certificate(tools.NAVIGATION, path, kind="plan")
    assert "parameters" in mismatch(path, load_plan(*tools.GENERATOR), Deadline())
    lines = tools.lines_of(path)
    place = next(index for index, line in enumerate(lines) if index and line[0] == "constraint")
    for change in ({place: [*lines[place][:3], [[7]]]}, {len(lines) - 1: ["folded", "x"]}):
        tools.write_lines(path, [change.get(index, line) for index, line in enumerate(lines)])
        assert mismatch(path, load_plan(*tools.NAVIGATION), Deadline()) is not None


@pytest.mark.parametrize("files", [tools.NAVIGATION, tools.GENERATOR], ids=named)
def test_schedules_are_ones_that_the_network_allows(files, tmp_path):
    plan, box = tools.certificate(files, tmp_path / "made.cert", kind="box")
    places = schedule_over(GroundPlan(plan), box.ranges)
    source = random.Random(1)
    for _ in range(20):
        values = {}
        for name, each in box.intervals.items():
            low = each.lower if each.lower is not None else Fraction(-5)
            high = each.upper if each.upper is not None else low + 10
            values[name] = low + (high - low) * Fraction(source.randint(1, 9), 10)
        times = {
            point: place.evaluate({unknown: values[str(unknown)] for unknown in place.variables})
            for point, place in zip(plan.time_points, places, strict=True)
        }
        assert not simulate(plan, values, times).network_violations
