"""`bench backends` and `bench encodings` on sizes that are quick, and the generator of unordered plans."""

from __future__ import annotations

import json
from fractions import Fraction
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from robust.api import envelope
from robust.bench.contenders import REGIONS
from robust.bench.growth import ENCODING_LADDERS, ENCODINGS, POINTS, Ladder, run_backends, run_encodings
from robust.bench.run import Outcome
from robust.bench.unordered import envelope_sum, time_points, unordered_instance, write_unordered
from robust.errors import InputError
from robust.irr.box import Status
from robust.plan.load import load_plan
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from tests.bench.conftest import Stand, rendered


def checked(report: Any) -> dict[str, Any]:
    value: dict[str, Any] = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    name = value["schema"].split("/")[1]
    schema = json.loads(files("robust.bench").joinpath(f"schemas/{name}.schema.json").read_text(encoding="utf-8"))
    jsonschema.validate(value, schema)
    return value


def small(name: str, *sizes: int) -> Ladder:
    return Ladder(name, name.capitalize(), "size", sizes, POINTS.write)


def expected_region(parameters: int) -> Region:
    """The envelope that the generator promises."""
    names = tuple(f"d{i}" for i in range(1, parameters + 1))

    def at_most(coefficients: dict[str, str], constant: int) -> LinearConstraint:
        return LinearConstraint.from_dict(
            {"coefficients": coefficients, "relation": "<=", "constant": str(constant)},
        )

    sides = [at_most({name: "-1"}, 0) for name in names]
    total = at_most(dict.fromkeys(names, "1"), envelope_sum(parameters))
    return Region(names, (Polyhedron(names, (*sides, total)),))


def test_backends_find_the_known_envelope(tmp_path: Path) -> None:
    plot = tmp_path / "plot.svg"
    ladder = Ladder("both", "Both", "parameters", (1, 2), lambda path, size: write_unordered(path, size, size))
    report = run_backends(limit=120, ladders=(ladder,), plot=plot, contenders=REGIONS[:2])
    assert [(row.contender, row.size) for row in report.rows] == [("project", 1), ("z3", 1), ("project", 2), ("z3", 2)]
    for row in report.rows:
        assert row.done, row.run and row.run.text
        region = getattr(row.run, "region", None)
        assert isinstance(region, Region)
        assert region.equals(expected_region(row.size))
    assert report.agrees
    assert all((row["polyhedra"] or 0) >= 1 for row in checked(report)["rows"])
    assert plot.stat().st_size > 0
    assert "fourier" not in rendered(report.tables())


def test_encodings_by_the_real_command(tmp_path: Path) -> None:
    plot = tmp_path / "plot.png"
    report = run_encodings(limit=120, ladders=(small("points", 2, 4),), plot=plot)
    assert [(row.contender, row.size) for row in report.rows] == [
        ("relational", 2),
        ("positions", 2),
        ("relational", 4),
        ("positions", 4),
    ]
    assert [row.run.outcome for row in report.rows if row.run] == [Outcome.COMPLETE] * 4
    assert checked(report)["schema"] == "robust/bench-encodings/1"
    assert plot.stat().st_size > 0


def test_what_is_too_late_is_not_tried_any_larger(stand: Stand, tmp_path: Path) -> None:
    stand("'positions' in sys.argv and time.sleep(60)\nprint(json.dumps(ANSWER))")
    plot = tmp_path / "plot.svg"
    report = run_encodings(limit=2, ladders=(small("first", 2, 4, 6), small("second", 2)), plot=plot)
    outcomes = {(row.ladder, row.contender, row.size): row.run and row.run.outcome for row in report.rows}
    assert outcomes[("first", "positions", 2)] is Outcome.TIMEOUT
    assert outcomes[("first", "positions", 4)] is outcomes[("first", "positions", 6)] is None
    assert outcomes[("second", "positions", 2)] is Outcome.TIMEOUT
    assert outcomes[("first", "relational", 6)] is Outcome.COMPLETE
    assert report.agrees  # too late is not wrong
    assert [row["status"] for row in checked(report)["rows"][:4]] == ["complete", "timeout", "complete", "not run"]
    text = rendered(report.tables())
    assert "out of time" in text
    assert "stopped at 2 s" in text
    assert plot.stat().st_size > 0


def test_failures_are_reported(stand: Stand) -> None:
    stand("sys.exit('no such thing')")
    report = run_backends(ladders=(small("one", 2),), contenders=REGIONS[:1])
    assert not report.agrees
    assert "project: error: no such thing" in report.notes
    checked(report)


def test_wrong_options() -> None:
    with pytest.raises(InputError, match="jobs is -1"):
        run_backends(jobs=-1)
    with pytest.raises(InputError, match="the limit is 0"):
        run_encodings(limit=0)
    with pytest.raises(InputError, match="expected a name that ends in"):
        run_backends(plot=Path("plot.xyz"))


def test_generated_sizes(tmp_path: Path) -> None:
    for jobs, parameters in ((0, 1), (2, 0), (2, 3)):
        with pytest.raises(ValueError, match="expected"):
            unordered_instance(jobs, parameters)
    for ladder in ENCODING_LADDERS:
        for size in ladder.sizes:
            plan = load_plan(*ladder.write(tmp_path / ladder.name, size))
            assert time_points(len(plan.instances) - 1) == size
    assert [contender.name for contender in ENCODINGS] == ["relational", "positions"]


@pytest.mark.parametrize(("jobs", "parameters"), [(1, 1), (3, 2)])
def test_the_generated_envelope_by_widening(jobs: int, parameters: int, tmp_path: Path) -> None:
    result = envelope(load_plan(*write_unordered(tmp_path, jobs, parameters)), method="widen")
    assert result.status is Status.COMPLETE
    uppers = [interval.upper for interval in result.box.intervals.values()]
    assert sum((upper for upper in uppers if upper is not None), Fraction(0)) == envelope_sum(parameters)
    assert {interval.lower for interval in result.box.intervals.values()} == {0}
    assert expected_region(parameters).contains_box(result.box)
