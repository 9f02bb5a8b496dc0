"""`bench figure20a` and `figure21` on a few plans."""

from __future__ import annotations

import json
from importlib.resources import files

import jsonschema
import pytest

from robust.bench.team_plans import chosen, run_team_plans
from robust.errors import InputError
from tests.bench.conftest import rendered


@pytest.mark.parametrize("figure", ["figure20a", "figure21"])
def test_a_few_plans(figure, tmp_path):
    plot = tmp_path / "plot.svg"
    seen = []
    report = run_team_plans(
        figure=figure,
        contenders=chosen(("oracle", "pitms")),
        instances=3,
        seed=0,
        plot=plot,
        on_result=lambda done, total, line: seen.append((done, total, line)),
    )
    assert report.agrees
    assert len(report.runs) == len(seen) == 6
    assert all(run.solved for run in report.runs)
    value = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    schema = json.loads(files("robust.bench").joinpath(f"schemas/bench-{figure}.schema.json").read_text())
    jsonschema.validate(value, schema)
    text = rendered(report.tables())
    assert "3 plans of seed 0" in text
    assert plot.read_text().startswith("<?xml")


def test_wrong_options(tmp_path):
    with pytest.raises(InputError, match="expected one of oracle, sat"):
        chosen(("z3",))
    with pytest.raises(InputError, match="instances is 0"):
        run_team_plans(figure="figure21", instances=0)
