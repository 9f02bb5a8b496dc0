"""Comparisons of the recorded instances: every face of every box is explained; and what is left after Ctrl-C."""

import json
from fractions import Fraction
from pathlib import Path

import pytest

import robust
from robust.irr.compare import METHODS, Comparing, Comparison
from robust.irr.search import Status
from robust.qe.box import Side
from tests.cli.running import EXAMPLES, example

BETA = Fraction(1)


def compared(dataset: Path, instance: dict) -> Comparison:
    plan = robust.load_plan(*(dataset / instance[key] for key in ("domain", "problem", "plan")))
    return robust.compare(plan, beta=BETA)


def assert_explained(comparison: Comparison) -> int:
    """Each face has a gap of 0, or below β for IRR, and a point just beyond it that breaks a named obligation."""
    assert comparison.status is Status.COMPLETE
    faces = 0
    for entry in comparison.entries:
        for face in entry.faces:
            where = (entry.method, face.parameter, face.side)
            assert face.gap is not None, where
            assert face.gap < BETA if entry.method == "irr" else face.gap == 0, where
            assert face.witness is not None, where
            assert face.witness.obligation, where
            assert face.witness.values not in entry.result.box, where
            beyond = face.witness.values[face.parameter] - face.end
            assert 0 <= (beyond if face.side is Side.UPPER else -beyond) <= face.gap + Fraction(1, 1000), where
            faces += 1
    return faces


def finite_faces(comparison: Comparison) -> int:
    return sum(
        (interval.lower is not None) + (interval.upper is not None)
        for entry in comparison.entries
        for interval in entry.result.box.intervals.values()
    )


def instances(dataset: Path) -> list[dict]:
    return json.loads((dataset / "recorded-results.json").read_text())


@pytest.mark.parametrize("name", ["auv_mission_10_0_2", "generator_linear_05_2", "solar_rover_02_3"])
def test_faces_of_recorded_instances_are_explained(dataset: Path, name: str) -> None:
    [instance] = [one for one in instances(dataset) if one["instance"] == name]
    comparison = compared(dataset, instance)
    assert assert_explained(comparison) == finite_faces(comparison) > 0


@pytest.mark.slow
def test_faces_of_all_recorded_instances_are_explained(dataset: Path) -> None:
    total = 0
    for instance in instances(dataset):
        comparison = compared(dataset, instance)
        faces = assert_explained(comparison)
        assert faces == finite_faces(comparison), instance["instance"]
        total += faces
    assert total > 700


@pytest.mark.parametrize("stage", [*METHODS, "region", "faces and witnesses"])
def test_interrupted_at_any_stage(stage: str) -> None:
    def interrupt(begun: str) -> None:
        if begun == stage:
            raise KeyboardInterrupt

    plan = robust.load_plan(*example(directory=EXAMPLES / "generator"))
    comparison = Comparing(plan, on_stage=interrupt).run()
    assert comparison.status is Status.INTERRUPTED
    finished = METHODS[: METHODS.index(stage)] if stage in METHODS else METHODS
    assert [entry.method for entry in comparison.entries] == list(finished)
    assert all(entry.result.verified for entry in comparison.entries)
    assert (comparison.region is not None) is (stage == "faces and witnesses")
