"""`bench recorded`: agreement, every kind of disagreement, limits, interruption and the report's forms."""

from __future__ import annotations

import json
import time
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from robust.bench.recorded import RecordedReport, run_recorded
from robust.bench.run import Outcome
from tests.bench.conftest import MakeSuite, Stand, navigation, rendered

SCHEMA = json.loads(files("robust.bench").joinpath("schemas/bench-recorded.schema.json").read_text(encoding="utf-8"))
TYPE = "print(json.dumps(ANSWER))"
IRR = {"status": "ok", "wall_s": 1.0, "memory_mb": 10, "checks": 3}


def checked(report: RecordedReport) -> dict[str, Any]:
    """The report as JSON that has passed through text and the schema."""
    value: dict[str, Any] = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    jsonschema.validate(value, SCHEMA)
    return value


def test_agreement_by_the_real_command(make_suite: MakeSuite) -> None:
    lines: list[tuple[int, int, str]] = []
    report = run_recorded(
        make_suite(navigation()), limit=120, on_result=lambda done, total, text: lines.append((done, total, text))
    )
    (row,) = report.rows
    assert row.ours.outcome is Outcome.COMPLETE, row.ours.message
    assert (row.box_agrees, row.checks_agree, row.agrees) == (True, True, True)
    assert row.differences == ()
    assert report.agrees
    assert report.complete
    assert row.ours.memory_mb > 10
    assert row.ours.first_widening_wall_s is not None
    assert 0 < row.ours.first_widening_wall_s <= row.ours.seconds
    assert [(done, total) for done, total, _ in lines] == [(1, 1)]
    assert lines[0][2].startswith("navigation: equal, ")
    value = checked(report)
    assert value["rows"][0]["ours"]["box"] == {"to_ridge": ["30", "45"], "to_crater": ["30", "40"]}
    assert value["totals"]["agreeing"] == value["totals"]["compared"] == 1


def test_the_order_of_turns_matters_and_is_passed_on(make_suite: MakeSuite) -> None:
    other = navigation(irr_order=["to_crater", "to_ridge"])
    (row,) = run_recorded(make_suite(other), limit=120).rows
    assert row.ours.outcome is Outcome.COMPLETE, row.ours.message
    assert row.agrees is False


def test_differing_sides_are_named(make_suite: MakeSuite, stand: Stand) -> None:
    stand(TYPE)
    box = {"a": ["1/3", "2"], "b": ["0", "1"]}
    report = run_recorded(make_suite(navigation(irr_box=box, irr=IRR)))
    (row,) = report.rows
    assert [str(one) for one in row.differences] == [
        "a upper: inf instead of 2",
        "b lower: absent instead of 0",
        "b upper: absent instead of 1",
    ]
    assert (row.agrees, row.box_agrees, row.checks_agree) == (False, False, True)
    assert not report.agrees
    assert "a upper: inf instead of 2" in rendered(report.tables())
    assert checked(report)["rows"][0]["differences"][0] == {
        "parameter": "a",
        "side": "upper",
        "ours": "inf",
        "recorded": "2",
    }


def test_equal_values_in_another_notation_agree(make_suite: MakeSuite, stand: Stand) -> None:
    stand("ANSWER['parameters']['a'].update(lower='0.50', upper='2/4', upper_closed=True)\n" + TYPE)
    report = run_recorded(make_suite(navigation(irr_box={"a": ["1/2", "0.5"]}, irr=IRR)))
    assert report.agrees


def test_an_open_end_is_not_a_closed_one(make_suite: MakeSuite, stand: Stand) -> None:
    stand("ANSWER['parameters']['a'].update(upper='2')\n" + TYPE)
    report = run_recorded(make_suite(navigation(irr_box={"a": ["1/3", "2"]}, irr=IRR)))
    assert [str(one) for one in report.rows[0].differences] == ["a upper: 2 (open) instead of 2"]
    checked(report)


def test_other_number_of_checks(make_suite: MakeSuite, stand: Stand) -> None:
    stand(TYPE)
    report = run_recorded(make_suite(navigation(irr_box={"a": ["1/3", "inf"]})))
    (row,) = report.rows
    assert (row.box_agrees, row.checks_agree, row.agrees) == (True, False, False)
    assert row.verdict == "equal box, other number of checks"
    assert not report.agrees


def test_without_recorded_results_there_is_nothing_to_compare(make_suite: MakeSuite, stand: Stand) -> None:
    stand(TYPE)
    bare = {key: navigation()[key] for key in ("instance", "domain", "problem", "plan")}
    late = navigation("late", irr={"status": "out of time", "wall_s": 3600.1, "memory_mb": 9}, irr_box=None)
    report = run_recorded(make_suite(bare, late))
    assert [row.agrees for row in report.rows] == [None, None]
    assert report.agrees
    assert report.totals["compared"] == 0
    assert "nothing recorded" in rendered(report.tables())
    assert "out of time" in rendered(report.tables())
    checked(report)


def test_the_options_of_each_run(make_suite: MakeSuite, stand: Stand, tmp_path: Path) -> None:
    stand(f"open({str(tmp_path / 'argv')!r}, 'w').write(json.dumps(sys.argv[1:]))\n" + TYPE)
    run_recorded(make_suite(navigation(irr_order=["-b", "a"])))
    argv = json.loads((tmp_path / "argv").read_text(encoding="utf-8"))
    paths = [navigation()[key] for key in ("domain", "problem", "plan")]
    options = ["--method", "irr", "--beta", "1", "--doubling", "--order=-b,a", "--json"]
    assert argv == ["envelope", *paths, *options]


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("sys.exit('robust: p.pddl:3: wrong')", "robust: p.pddl:3: wrong"),
        ("os.abort()", "exit code -6 without a message"),
        ("print(json.dumps({'error': {'message': 'p.pddl:3: wrong'}})); sys.exit(2)", "p.pddl:3: wrong"),
        ("print('[]')", "not that of `robust envelope --json`"),
        ("print('{')", "not that of `robust envelope --json`"),
        ("print('null')", "not that of `robust envelope --json`"),
        ("ANSWER['status'] = 'fine'\n" + TYPE, "'fine' is not a valid Outcome"),
        ("del ANSWER['checks']\n" + TYPE, "KeyError: 'checks'"),
        ("ANSWER['parameters']['a']['lower'] = 'x'\n" + TYPE, "found 'x', expected a number"),
        ("ANSWER['parameters']['a']['lower'] = 3\n" + TYPE, "TypeError"),
        ("ANSWER['parameters'] = 3\n" + TYPE, "AttributeError"),
    ],
)
def test_failures_are_rows(make_suite: MakeSuite, stand: Stand, script: str, message: str) -> None:
    stand(script)
    report = run_recorded(make_suite(navigation()))
    (row,) = report.rows
    assert row.ours.outcome is Outcome.ERROR
    assert message in (row.ours.message or "")
    assert row.agrees is False
    assert not report.agrees
    assert report.complete
    assert checked(report)["totals"]["errors"] == 1


def test_invalid_plans_show_the_reason(make_suite: MakeSuite, stand: Stand) -> None:
    stand("ANSWER.update(status='invalid', reason='[goal] breaks', first_widening_s=None)\n" + TYPE + "\nsys.exit(1)")
    report = run_recorded(make_suite(navigation()))
    assert report.rows[0].verdict == "invalid: [goal] breaks"
    assert not report.agrees
    assert "[goal] breaks" in rendered(report.tables())
    checked(report)


def test_the_limit_is_for_each_instance(make_suite: MakeSuite, stand: Stand) -> None:
    stand("if sys.argv[-2] == '--order=slow': time.sleep(60)\n" + TYPE)
    box = {"a": ["1/3", "inf"]}
    slow = navigation("slow", irr_order=["slow"])
    report = run_recorded(make_suite(slow, navigation("quick", irr_box=box, irr=IRR)), limit=1.5)
    assert [row.ours.outcome for row in report.rows] == [Outcome.TIMEOUT, Outcome.COMPLETE]
    assert 1.5 <= report.rows[0].ours.seconds < 20
    assert report.complete
    assert not report.agrees
    totals = checked(report)["totals"]
    assert (totals["timeouts"], totals["agreeing"], totals["solved"]["ours"]) == (1, 1, 1)
    assert totals["seconds"]["instances"] == 1
    assert "timeout" in rendered(report.tables())


def test_two_jobs_run_at_the_same_time_and_keep_the_order(make_suite: MakeSuite, stand: Stand, tmp_path: Path) -> None:
    meet = f"""
mine, other = sys.argv[-2][-1], {{"1": "2", "2": "1"}}[sys.argv[-2][-1]]
open({str(tmp_path)!r} + "/here" + mine, "w").close()
while not os.path.exists({str(tmp_path)!r} + "/here" + other): time.sleep(0.01)
if mine == "1": time.sleep(0.5)
"""
    stand(meet + TYPE)
    done: list[str] = []
    suite = make_suite(*(navigation(f"n{i}", irr_order=[f"p{i}"], irr_box=None) for i in (1, 2)))
    report = run_recorded(suite, jobs=2, limit=60, on_result=lambda _n, _total, text: done.append(text[:2]))
    assert [row.instance.name for row in report.rows] == ["n1", "n2"]
    assert [row.ours.outcome for row in report.rows] == [Outcome.COMPLETE] * 2
    assert done == ["n2", "n1"]
    assert any("2 processes ran at a time" in note for note in report.notes)
    assert checked(report)["jobs"] == 2


def test_two_jobs_by_the_real_command(make_suite: MakeSuite) -> None:
    report = run_recorded(make_suite(*(navigation(f"n{i}") for i in range(3))), jobs=2, limit=120)
    assert report.agrees
    assert len(report.rows) == 3


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interruption_keeps_what_is_there(make_suite: MakeSuite, stand: Stand, jobs: int) -> None:
    stand("if sys.argv[-2] != '--order=quick': time.sleep(60)\n" + TYPE)

    def interrupt(_done: int, _total: int, _text: str) -> None:
        raise KeyboardInterrupt

    slow = (navigation(f"slow{i}", irr_order=["slow"]) for i in range(3))
    started = time.monotonic()
    report = run_recorded(
        make_suite(navigation("quick", irr_order=["quick"], irr_box=None), *slow), jobs=jobs, on_result=interrupt
    )
    assert time.monotonic() - started < 30
    assert [row.instance.name for row in report.rows] == ["quick"]
    assert not report.complete
    assert not report.agrees
    assert "incomplete: interrupted after 1 of 4 instances" in rendered(report.tables())
    assert checked(report)["complete"] is False


@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_plot(make_suite: MakeSuite, stand: Stand, tmp_path: Path, suffix: str) -> None:
    stand(TYPE)
    plot = tmp_path / f"plot{suffix}"
    run_recorded(make_suite(navigation(), navigation("other", irr=None, ccmmz=None)), plot=plot)
    head = plot.read_bytes()[:200]
    assert head.startswith(b"\x89PNG") if suffix == ".png" else b"<?xml" in head


def test_plot_where_nothing_was_solved(make_suite: MakeSuite, stand: Stand, tmp_path: Path) -> None:
    stand("sys.exit(2)")
    plot = tmp_path / "plot.svg"
    run_recorded(make_suite(navigation(irr=None, ccmmz=None)), plot=plot)
    assert plot.stat().st_size > 0
