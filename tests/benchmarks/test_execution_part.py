"""The part about execution, from reports as the commands print them."""

import json
from collections import Counter

import pytest

from benchmarks import parts
from benchmarks.execution_part import execution, table_report
from robust.bench.contenders import IRR, WIDEN
from robust.bench.conversions import ConversionReport, ConversionRow, ConversionTask, Source
from robust.bench.execution_tables import DREEX, TABLE1, TABLE2, ExecutionReport, ExecutionRow
from robust.bench.figure4 import Figure4Report, Figure4Row
from robust.bench.figure4_instances import Instance, Origin
from robust.bench.removals import Kind, Removal

LATE = "dur_n8 exceeds 170; aries: timeout: no valid plan before the deadline"
PROVED = "x; reachability: no plan: the goal is out of reach: (p) ends at 1, and what needs it would end at 2 or later"
SETTINGS = {"problems": 2, "runs": 1, "planner": "aries", "planner_s": 14.0, "drain": False, "seed": 7, "battery": None}


def row(executor, problem, succeeded=True, *, replans=0, reason="", column="1 parameter", **more):
    counts = {"promises": 0, "broken": 0, **more}
    return ExecutionRow(column, executor, problem, 7, succeeded, replans, seconds=0.1, reason=reason, **counts)


def table(design=TABLE1, **more):
    column = design.columns[0]
    rows = (
        row(DREEX, "a", promises=1, column=column),
        row(DREEX, "b", replans=1, column=column),
        row("blex:0", "a", replans=2, column=column),
        row("blex:0", "b", succeeded=False, reason=LATE, column=column),
        row("blex:60", "a", succeeded=False, reason=PROVED, column=column),
        row("blex:60", "b", succeeded=False, reason="x; gave up after 10 re-plans", column=column),
    )
    settings = {**SETTINGS, **more}
    return ExecutionReport(design, (DREEX, "blex:0", "blex:60"), rows, (), complete=True, settings=settings)


def printed(report):
    return json.loads(json.dumps(report.as_dict()))


def conversions():
    task = ConversionTask(Source.DRAWN, 3, 60.0)
    bounds = Counter({(Kind.DURATION, Removal.NEEDED): 4, (Kind.SEPARATION, Removal.IMPLIED): 1})
    return ConversionReport(
        (ConversionRow(task, "0: (a) [1]", 3, True, True, 0, bounds, ("e",), 0.25, 1.0),), (), True, 60.0, ()
    )


def figure4():
    run = {"status": "complete", "seconds": 1.5, "box": None, "unbounded": [], "capped": [], "polyhedra": None}
    run |= {"cpu_s": 1.0, "memory_mb": 80.0, "search_s": 1.0, "message": None}
    widened = {"box": {"a": ["0", None], "b": ["0", "9"]}, "unbounded": ["a above"], "capped": ["b"]}
    runs = {"irr": run, "widen": {**run, **widened, "status": "timeout", "seconds": 10.0}}
    found = {"status": "complete", "dynamic": "yes", "strong": "no", "kept": 0.5, "bounded": 0, "cut": 0, "reason": ""}
    rows = (
        Figure4Row(Instance("own-1", Origin.OWN, 1, ("", "", "")), runs, found),
        Figure4Row(Instance("own-2", Origin.OWN, 2, ("", "", "")), runs, None),
    )
    return Figure4Report(rows, (IRR, WIDEN), (), True, 10.0, 5.0, 1, ())


def test_a_report_comes_back_as_it_was():
    made = table()
    assert table_report(TABLE1, printed(made)).as_dict() == made.as_dict()


def test_tables():
    text = execution([printed(table()), printed(table(TABLE2, battery="520", drain=True))], "2026-01-01")
    assert "### Table 1: uncertain durations, planner aries\n" in text
    assert "### Table 2: uncertain consumption, planner aries, battery 520\n" in text
    assert "| DREEX | 100.0 % [34–100] / 92.2 %; 0.5 / 0.1 |" in text
    assert "| BLEX(0) | 50.0 % [9–91] / 0.0 %; 2.0 / – |" in text
    assert "| BLEX(60) | 2 : 0, 0.5000 |" in text
    assert "| BLEX(0) | 1 | 0 | 0 |" in text  # why runs failed
    assert "| executor | aries: timeout | reachability: no plan | too many re-plans |" in text
    flowing = " ".join(text.split())
    assert "put to the test by 1 plans and kept by 1" in flowing
    assert "more than every other executor in 1 of 1 columns" in flowing
    assert "fewer than 0.3 re-plans on average in 0: 1 in 2 successful runs, 0.5000 on average." in flowing
    assert "BLEX(0) succeeds in 1 runs, 1 of them with re-plans" in flowing
    assert flowing.count("The charge was fixed before the runs, so that about one run in ten") == 1
    assert "1 of 3 failed runs ended because the planner ran out of time" in flowing
    assert (
        "Percentage points from the paper: DREEX +7.8 to +7.8 (mean +7.8), BLEX -78.8 to +50.0 (mean -14.4)" in flowing
    )
    assert max(len(line) for line in text.splitlines() if not line.startswith("|")) <= 120


def test_conversions_and_figure4():
    text = execution([printed(conversions()), printed(figure4())], "2026-01-01")
    assert "| with a removable bound | 1 |" in text
    assert "| seconds to convert, median | 0.25 |" in text
    assert "| duration | 4 | 0 | 0 | 0 |" in text
    assert "| separation of mutex time points | 0 | 1 | 0 | 0 |" in text
    assert "| IRR | 2 of 2, 1.50 s, 1.50 s |" in text
    assert "| exact widening | 0 of 2 |" in text
    flowing = " ".join(text.split())
    assert "Of 1 boxes of exact widening: dynamically controllable: yes 1; strongly: no 1." in flowing
    assert "Of the 8 ends of the 2 boxes of exact widening, 2 are infinite, and 2 are durations" in flowing
    assert "they keep 50.0 % of their widths on average" in flowing
    assert "NOT" not in text


def test_what_is_incomplete_says_so():
    values = [printed(table()), printed(conversions()), printed(figure4())]
    for value in values:
        value["complete"] = False
    assert execution(values, "2026-01-01").count(" NOT all ") == 3


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(parts, "PARTS", tmp_path)
    monkeypatch.setattr(parts, "RESULTS", tmp_path / "RESULTS.md")
    parts.RESULTS.write_text(f"# Own\n\n{parts.MARK}\n", encoding="utf-8")
    files = []
    for number, value in enumerate([table(), figure4()]):
        path = tmp_path / f"{number}.json"
        path.write_text(json.dumps(value.as_dict()), encoding="utf-8")
        files.append(str(path))
    assert parts.main(["execution", *files]) == 0
    assert (tmp_path / "5-execution.md").read_text(encoding="utf-8").startswith("## Execution\n")
    assert "### Figure 4" in parts.RESULTS.read_text(encoding="utf-8")
    for wrong in (["execution"], ["latency", *files]):
        with pytest.raises(SystemExit):
            parts.main(wrong)
        assert "needs FILE.json" in capsys.readouterr().err
    (tmp_path / "0.json").write_text('{"schema": "other"}', encoding="utf-8")
    with pytest.raises(SystemExit):
        parts.main(["execution", files[0]])
    assert "found schema 'other'" in capsys.readouterr().err
