"""Boxes of the recorded instances, by the positions encoding: those of the original runs and of the other encoding."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from robust.api import envelope
from robust.irr.search import Status
from robust.plan.load import load_plan

QUICK = [
    *(f"auv_mission_10_0_{n}" for n in range(3)),
    "generator_linear_05_1",
    "generator_linear_05_2",
    "solar_rover_01_1",
    "solar_rover_01_4",
    "solar_rover_02_1",
    "solar_rover_03_1",
]
SLOW = [
    *(f"auv_mission_10_0_{n}" for n in range(3, 6)),
    *(f"generator_linear_0{size}_{n}" for size in (5, 6, 7) for n in (1, 2)),
    *(f"solar_rover_0{size}_{n}" for size in (1, 2, 3) for n in (2, 3, 4)),
]


def reproduces(dataset: Path, name: str) -> None:
    records: list[dict[str, Any]] = json.loads((dataset / "recorded-results.json").read_text())
    record = next(record for record in records if record["instance"] == name)
    plan = load_plan(dataset / record["domain"], dataset / record["problem"], dataset / record["plan"])
    order = record["irr_order"]
    results = [
        envelope(plan, method="irr", doubling=True, order=order, encoding=name) for name in ("relational", "positions")
    ]
    boxes = [{name: (i.lower, i.upper) for name, i in result.box.intervals.items()} for result in results]
    assert [result.status for result in results] == [Status.COMPLETE] * 2
    assert boxes[0] == boxes[1]
    assert results[0].checks == results[1].checks
    if "irr_box" in record:
        assert boxes[1] == {name: (Fraction(low), Fraction(high)) for name, (low, high) in record["irr_box"].items()}
        assert results[1].checks == record["irr"]["checks"]


@pytest.mark.parametrize("name", QUICK)
def test_reproduces_recorded_boxes(dataset: Path, name: str) -> None:
    reproduces(dataset, name)


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_reproduces_recorded_boxes_thoroughly(dataset: Path, name: str) -> None:
    reproduces(dataset, name)
