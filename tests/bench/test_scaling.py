"""`bench scaling` on sizes that are quick."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

import jsonschema
import pytest

from robust.bench.generator import write_instance
from robust.bench.run import Outcome
from robust.bench.scaling import SERIES, Point, Series, run_scaling
from robust.errors import InputError
from robust.plan.load import load_plan
from tests.bench.conftest import Stand, rendered

SCHEMA = json.loads(files("robust.bench").joinpath("schemas/bench-scaling.schema.json").read_text(encoding="utf-8"))
SMALL = (
    Series("refuels", "More actions", "refuels", (Point(1, 1), Point(2, 1))),
    Series("parameters", "More parameters", "parameters", (Point(2, 1), Point(2, 2))),
)


def test_small_sizes_by_the_real_command(tmp_path: Path) -> None:
    lines: list[str] = []
    plot = tmp_path / "plot.png"
    report = run_scaling(
        limit=120, jobs=2, plot=plot, series=SMALL, on_result=lambda _n, _total, text: lines.append(text)
    )
    assert [row.ours.outcome for row in report.rows] == [Outcome.COMPLETE] * 4, [
        row.ours.message for row in report.rows
    ]
    assert [(row.series, row.refuels, row.parameters) for row in report.rows] == [
        ("refuels", 1, 1),
        ("refuels", 2, 1),
        ("parameters", 2, 1),
        ("parameters", 2, 2),
    ]
    assert report.agrees
    assert len(lines) == 4
    assert all((row.ours.queries or 0) > 0 for row in report.rows)
    assert all("start_1" in row.ours.box for row in report.rows)
    assert plot.stat().st_size > 0
    value = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    jsonschema.validate(value, SCHEMA)
    text = rendered(report.tables())
    assert "More actions" in text
    assert "More parameters" in text


def test_limit_and_errors(stand: Stand, tmp_path: Path) -> None:
    stand("time.sleep(60)")
    series = (Series("one", "One", "refuels", (Point(1, 1),)),)
    report = run_scaling(limit=0.5, series=series, plot=tmp_path / "plot.svg")
    assert report.rows[0].ours.outcome is Outcome.TIMEOUT
    assert report.agrees  # too late is not wrong
    stand("sys.exit('no such thing')")
    report = run_scaling(series=series)
    assert report.rows[0].ours.text == "error: no such thing"
    assert not report.agrees
    jsonschema.validate(report.as_dict(), SCHEMA)


def test_wrong_options() -> None:
    with pytest.raises(InputError, match="jobs is -1"):
        run_scaling(jobs=-1)
    with pytest.raises(InputError, match="the limit is 0"):
        run_scaling(limit=0)
    with pytest.raises(InputError, match="expected a name that ends in"):
        run_scaling(plot=Path("plot.xyz"))


def test_all_sizes_can_be_generated_and_read(tmp_path: Path) -> None:
    for series in SERIES:
        for point in series.points:
            plan = load_plan(*write_instance(tmp_path, point.refuels, point.parameters))
            assert len(plan.parameters) == point.parameters
            assert len(plan.instances) == point.refuels + 1
