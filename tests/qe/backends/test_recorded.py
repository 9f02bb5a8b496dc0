"""Recorded boxes are inside the exact envelope of the instances that they were found for."""

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from robust.plan.load import load_plan
from robust.qe.compute import RegionResult, RegionStatus
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from tests.qe.backends.formulas import region
from tests.qe.backends.test_regions import differ

QUICK = ("auv_mission_10_0_0", "auv_mission_10_0_4", "auv_mission_10_0_9", "solar_rover_01_4", "generator_linear_05_2")

SECONDS = 60
"""Within this time at least two other back ends agree with the default one."""


def records(dataset: Path) -> list[dict[str, Any]]:
    return list(json.loads((dataset / "recorded-results.json").read_text()))


def computed(dataset: Path, record: dict[str, Any], **options: Any) -> RegionResult:
    plan = load_plan(dataset / record["domain"], dataset / record["problem"], dataset / record["plan"])
    return region(plan, timeout=300, **options)


def box(names: tuple[str, ...], recorded: dict[str, list[str]]) -> Region:
    sides = []
    for name, (lower, upper) in recorded.items():
        sides.append(LinearConstraint.of({name: 1}, ">=", Fraction(lower)))
        sides.append(LinearConstraint.of({name: 1}, "<=", Fraction(upper)))
    return Region.union_of(names, [Polyhedron(names, tuple(sides))])


def holds_recorded_boxes(dataset: Path, record: dict[str, Any]) -> None:
    result = computed(dataset, record)
    assert result.status is RegionStatus.COMPLETE
    names = result.region.parameters
    for key in ("irr_box", "ccmmz_box"):
        recorded = record.get(key)
        if recorded and all("inf" not in end for ends in recorded.values() for end in ends):
            assert box(names, recorded).is_subset_of(result.region), f"{record['instance']}: {key}"


@pytest.mark.parametrize("name", QUICK)
def test_recorded_boxes_are_inside(dataset: Path, name: str) -> None:
    holds_recorded_boxes(dataset, next(record for record in records(dataset) if record["instance"] == name))


@pytest.mark.slow
def test_all_recorded_boxes_are_inside(dataset: Path) -> None:
    for record in records(dataset):
        holds_recorded_boxes(dataset, record)


@pytest.mark.parametrize("backend", ["fourier-motzkin", "loos-weispfenning"])
@pytest.mark.parametrize("name", [f"generator_linear_05_{count}" for count in (2, 3, 4)])
def test_our_back_ends_agree_on_generators(dataset: Path, backend: str, name: str) -> None:
    record = next(record for record in records(dataset) if record["instance"] == name)
    other = computed(dataset, record, backend=backend)
    assert other.status is RegionStatus.COMPLETE
    assert other.seconds < SECONDS
    assert not differ(other.region, computed(dataset, record).region)


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["fourier-motzkin", "loos-weispfenning"])
def test_our_back_ends_agree_on_all_recorded_instances(dataset: Path, backend: str) -> None:
    for record in records(dataset):
        other = computed(dataset, record, backend=backend)
        assert other.status is RegionStatus.COMPLETE, record["instance"]
        assert other.seconds < SECONDS, record["instance"]
        assert other.region.equals(computed(dataset, record).region), record["instance"]


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["fourier-motzkin", "loos-weispfenning", "z3", "z3-qe", "cvc5", "cvc5-whole"])
def test_other_back_ends_agree_on_recorded_instances(dataset: Path, backend: str) -> None:
    quick = [r for r in records(dataset) if r["instance"].startswith(("auv", "solar")) or r["instance"].endswith("_1")]
    for record in quick:
        other = computed(dataset, record, backend=backend)
        assert other.status is RegionStatus.COMPLETE, record["instance"]
        assert not differ(other.region, computed(dataset, record).region), record["instance"]
