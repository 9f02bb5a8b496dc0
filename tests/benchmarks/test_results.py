"""The page with results: what the driver writes with a stand-in for the command line, and parts of printed reports."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from benchmarks import results
from benchmarks.catalogue import EXPERIMENTS
from benchmarks.engine.codec import plain
from benchmarks.engine.measure import Ending
from benchmarks.irr.contenders import IRR, WIDEN
from benchmarks.irr.conversions import CONVERSIONS, ConversionReport, ConversionRow, Count, Kind, Removal, Source
from benchmarks.irr.figure4 import FIGURE4, Assessment, Figure4Report, Figure4Row, MethodRun, Origin
from benchmarks.irr.tables import DREEX, TABLE1, TABLE2, ExecutionRow, Table1Report, Table2Report
from benchmarks.results import MARK, joined, main, part_of
from tests.benchmarks.conftest import MakeSuite, Stand, example, navigation

ANSWERS = """
if sys.argv[1] == "check":
    print(json.dumps({"schema": "robust/check/1", "verdict": "proved"}))
elif sys.argv[1] == "envelope":
    ANSWER["convergence"] = [{"check": 3, "share": 1.0}]
    print(json.dumps(ANSWER))
elif sys.argv[1] == "region":
    base = [{"coefficients": {"a": "-1"}, "relation": "<=", "constant": "0"}]
    print(json.dumps({"status": "complete", "parameters": ["a"], "form": "difference", "base": base, "minus": []}))
"""


def flowing(text: str) -> str:
    return " ".join(text.split())


def assert_wrapped(text: str) -> None:
    for line in text.splitlines():
        assert line == line.rstrip()
        assert len(line) <= 120 or line.startswith("|"), line


def test_the_page(make_suite: MakeSuite, stand: Stand, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stand(ANSWERS)
    instance = navigation("a|b", irr_box={"a": ["1/3", "inf"]}, irr={"status": "ok", "wall_s": 2, "checks": 3})
    suite = make_suite(instance, delivery=[{"instance": "d1", "parameters": 4, **example()}])
    output = tmp_path / "RESULTS.md"
    arguments = ["--suite", str(suite), "--output", str(output), "--limit", "60", "--plots", str(tmp_path)]
    assert main(arguments) == 0
    drawn = {path.stem for path in tmp_path.glob("*.svg")}
    assert drawn == {"recorded", "figure3", "figure5", "scaling", "backends", "encodings"}
    assert capsys.readouterr().out == f"{output}\n"
    text = output.read_text(encoding="utf-8")
    assert re.search(r"^\| a\\\|b \| [0-9.]+ / 2\.00 / out of time \|.*\| 3 / 3 \|.*\| equal \|$", text, re.MULTILINE)
    assert re.search(r"^\| d1 \| 4 \| proved \|", text, re.MULTILINE)
    assert "1 of 1 instances agree" in text
    assert len(re.findall(r"^\| [0-9]+ \| [0-9]+ \| .*complete \|$", text, re.MULTILINE)) == 13
    assert "indicative only" in text
    for heading in ("Instances solved over time", "Exact methods", "Convergence of IRR", "Elimination back ends"):
        assert f"\n## {heading}\n" in text
    assert "recorded IRR boxes inside the exact region: 1 of 1" in flowing(text)
    assert_wrapped(text)


def test_nothing_is_written_on_errors(
    make_suite: MakeSuite, stand: Stand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "RESULTS.md"
    suite = str(make_suite(navigation()))
    for script, words, message in (
        ("sys.exit('broken')", ["--suite", suite], "does not start: broken"),
        (ANSWERS, ["--suite", str(tmp_path / "absent")], "expected a directory"),
        (ANSWERS, ["--suite", suite, "--limit", "0"], "expected a number above 0"),
        (ANSWERS, ["--suite", suite, "figures.json"], "expected one of them"),
    ):
        stand(script)
        with pytest.raises(SystemExit) as stop:
            main([*words, "--output", str(output)])
        assert stop.value.code == 2
        assert message in capsys.readouterr().err
    assert not output.exists()


# -- parts -------------------------------------------------------------------------------------------------------------


def test_the_page_shows_the_parts_as_they_are() -> None:
    text = results.OUTPUT.read_text(encoding="utf-8")
    assert text == joined(text)
    for path in results.PARTS.glob("*.md"):
        assert path.read_text(encoding="utf-8").strip() in text
    assert joined(f"# Own\n\n{MARK}\n\n## Old\n").startswith(f"# Own\n\n{MARK}\n\n## ")
    assert "## Old" not in joined(f"# Own\n\n{MARK}\n\n## Old\n")


def part(*answers: dict[str, Any]) -> str:
    file, text = part_of([json.loads(json.dumps(answer)) for answer in answers], "2026-01-01")
    assert file[0].isdigit()
    assert_wrapped(text)
    return text


def team_run(contender: str, **fields: Any) -> dict[str, Any]:
    unknown = dict.fromkeys(("candidate_subplans", "prime_implicants", "models", "message"))
    return {"contender": contender, "instance": "a", "satisfiable": True, **unknown, **fields}


COMPLETE = {"complete": True, "agrees": True, "limit": 60.0, "seed": 0, "jobs": 1}


def test_team_plans_from_what_was_printed() -> None:
    text = part(
        {
            **COMPLETE,
            "schema": "robust/bench-figure20a/1",
            "plans": [{"instance": "a", "activities": 3, "candidate_subplans": 4}],
            "runs": [
                team_run("oracle", seconds=0.5, memory_mb=80.0, stages={"formula": 0.1, "search": 0.05}),
                team_run("pitms", seconds=0.7, memory_mb=90, prime_implicants=3, models=2, stages={"links": 0.1}),
            ],
        }
    )
    assert "| oracle | 1 | 1 | 0.50 | 0.50 | 0.50 | 0 | 80 |" in text
    assert "0.15 s median, 0.15 s at most" in text
    assert "More implicants than models: 1 of 1 plans" in text


def latency(backend: str, instance: str, outcome: str, steps: list[float]) -> dict[str, Any]:
    seconds = {"preparation_seconds": 0.25, "step_seconds": steps, "wake_seconds": [0.002]}
    return {"backend": backend, "instance": instance, "outcome": outcome, **seconds, "decisions": 2, "message": None}


def test_latencies_from_what_was_printed() -> None:
    printed = {
        **COMPLETE,
        "schema": "robust/bench-figure20b/1",
        "problems": 3,
        "decided": 3,
        "admitting": ["a", "b"],
        "differences": [],
        "executions": [
            latency("smt", "a", "succeeded", [0.001, 0.004]),
            latency("smt", "b", "failed", [0.003, 0.2]),
            latency("bdd", "a", "succeeded", [0.001]),
            latency("bdd", "b", "timeout", [0.5]),
        ],
    }
    text = part(printed)
    assert "| smt | 2 | 2 | 1 | 0 | 250.0 | 250.0 | 2.0 |" in text
    assert "| bdd | 1 | 2 | 1 | 1 | 250.0 | 250.0 | 2.0 |" in text
    assert "| smt | 4 | 3.5 | 102.0 | 200.0 | 200.0 | 1 (50.0%) | 2 (100.0%) |" in text
    assert "same decisions" in text
    assert "| atms |" not in text
    assert "differ between back ends: 1." in part({**printed, "differences": ["b: smt and bdd"]})


def test_guessed_intents_from_what_was_printed() -> None:
    pike = {"outcome": "succeeded", "time": "15/2", "replans": 0, "recovery": "0", "seconds": 0.5}
    kirk = pike | {"time": "10", "replans": 2, "recovery": "5/2", "seconds": 1.0}
    settings = {"problems": 1, "largest": 10, "reasoner": "smt", "notes": []}
    one = {"index": 0, "structure": [2, 2], "intents": 4, "pike": pike, "kirk": kirk}
    text = part({**COMPLETE, "schema": "robust/bench-figure18/1", **settings, "runs": [one]})
    assert "| 2 | 1 | 2.00 | – | 2 | 1.00 | 0 |" in text
    assert "| 2 | 1 | 7.50 | 10.00 | 25.0 | – | 25.0 | 25.0 | 0.500 | 1.000 |" in text
    assert "| of Kirk's time, with computing | 27.3 | – | 13.4 |" in text
    # Half of the guesses are wrong: 0.3125 of recovery to 3.5 of activities.
    assert "0.500 of the guesses are wrong" in flowing(text)
    assert "save 8.2% of Kirk's time" in flowing(text)


# -- execution ---------------------------------------------------------------------------------------------------------

LATE = "dur_n8 exceeds 170; aries: timeout: no valid plan before the deadline"
PROVED = "x; reachability: no plan: the goal is out of reach: (p) ends at 1, and what needs it would end at 2 or later"


def table(experiment: Any = TABLE1, **more: Any) -> dict[str, Any]:
    report: Any = {TABLE1: Table1Report, TABLE2: Table2Report}[experiment]

    def row(executor: str, problem: str, reason: str = "", replans: int = 0, promises: int = 0) -> ExecutionRow:
        column = report.DESIGN.columns[0]
        return ExecutionRow(column, executor, problem, 7, not reason, replans, promises, 0, 0.1, reason)

    rows = (
        row(DREEX, "a", promises=1),
        row(DREEX, "b", replans=1),
        row("blex:0", "a", replans=2),
        row("blex:0", "b", LATE),
        row("blex:60", "a", PROVED),
        row("blex:60", "b", "x; gave up after 10 re-plans"),
    )
    options = experiment.options(problems=2, seed=7, executors=(DREEX, "blex:0", "blex:60"))
    facts = {"planner": "aries", "planner_s": 14.0, "drain": False, "battery": None, **more}
    printed: dict[str, Any] = report(experiment, options, facts, rows).as_dict()
    return printed


def conversions() -> dict[str, Any]:
    bounds = (Count(Kind.DURATION, Removal.NEEDED, 4), Count(Kind.SEPARATION, Removal.IMPLIED, 1))
    row = ConversionRow(Source.DRAWN, 3, "0: (a) [1]", 3, True, True, 0, bounds, ("e",), 0.25, 1.0)
    return ConversionReport(CONVERSIONS, CONVERSIONS.options(), None, (row,)).as_dict()


def figure4() -> dict[str, Any]:
    solved = MethodRun(Ending.COMPLETE, 1.5, 1.0, 80.0, 1.0, None)
    late = MethodRun(Ending.TIMEOUT, 10.0, 1.0, 80.0, None, None, {"a": ("0", "inf"), "b": ("0", "9")}, ("a",), ("b",))
    found = Assessment("complete", "yes", "no", 0.5, 0, 0, "")
    runs = {"irr": solved, "widen": late}
    rows = tuple(Figure4Row(f"own-{n}", Origin.OWN, n, runs, found if n == 1 else None) for n in (1, 2))
    options = FIGURE4.options(baseline_limit=5, contenders=(IRR, WIDEN))
    return Figure4Report(FIGURE4, options, None, rows).as_dict()


def test_a_report_comes_back_as_it_was() -> None:
    for printed in (table(), table(TABLE2, battery="520"), conversions(), figure4()):
        name = printed["schema"].removeprefix("robust/bench-").removesuffix("/1")
        value = json.loads(json.dumps(printed))
        again = plain(EXPERIMENTS[name].load().read(value).as_dict())
        assert json.loads(json.dumps({**again, "notes": 0})) == {**value, "notes": 0}


def test_tables() -> None:
    text = part(table(), table(TABLE2, battery="520", drain=True))
    assert "### Table 1: uncertain durations, planner aries\n" in text
    assert "### Table 2: uncertain consumption, planner aries, battery 520\n" in text
    assert "| executor | 1 parameter |\n" in text
    assert "| DREEX | 100.0 % [34–100] / 92.2 %; 0.5 / 0.1 |" in text
    assert "| BLEX(0) | 50.0 % [9–91] / 0.0 %; 2.0 / – |" in text
    assert "| BLEX(60) | 2 : 0, 0.5000 |" in text
    assert "| BLEX(0) | 1 | 0 | 0 |" in text  # why runs failed
    assert "| executor | aries: timeout | reachability: no plan | too many re-plans |" in text
    for sentence in (
        "put to the test by 1 plans and kept by 1",
        "more than every other executor in 1 of 1 columns",
        "fewer than 0.3 re-plans on average in 0: 1 in 2 successful runs, 0.5000 on average.",
        "BLEX(0) succeeds in 1 runs, 1 of them with re-plans",
        "1 of 3 failed runs ended because the planner ran out of time",
        "Percentage points from the paper: DREEX +7.8 to +7.8 (mean +7.8), BLEX -78.8 to +50.0 (mean -14.4)",
        "2 problems, 1 simulated world each, seed 7; at most 14 s for each plan; actions that run when a plan is given "
        "up are stopped.",
    ):
        assert sentence in flowing(text)
    assert flowing(text).count("The charge was fixed before the runs, so that about one run in ten") == 1


def test_conversions_and_figure4() -> None:
    text = part(conversions(), figure4())
    assert "| with a removable bound | 1 |" in text
    assert "| seconds to convert, median | 0.25 |" in text
    assert "| duration | 4 | 0 | 0 | 0 |" in text
    assert "| separation of mutex time points | 0 | 1 | 0 | 0 |" in text
    assert "| IRR | 2 of 2, 1.50 s, 1.50 s |" in text
    assert "| exact widening | 0 of 2 |" in text
    for sentence in (
        "Of 1 boxes of exact widening: dynamically controllable: yes 1; strongly: no 1.",
        "Of the 8 ends of the 2 boxes of exact widening, 2 are infinite, and 2 are durations",
        "they keep 50.0 % of their widths on average",
        "at most 10 s for IRR, exact widening, and 5 s for optimal box",
    ):
        assert sentence in flowing(text)
    assert "NOT" not in text
    incomplete = ({**printed, "complete": False} for printed in (table(), conversions(), figure4()))
    assert part(*incomplete).count(" NOT all ") == 3


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(results, "PARTS", tmp_path)
    page = tmp_path / "RESULTS.md"
    page.write_text(f"# Own\n\n{MARK}\n", encoding="utf-8")
    files = []
    for place, value in enumerate((table(), figure4(), {"schema": "other"})):
        files.append(str(tmp_path / f"{place}.json"))
        Path(files[-1]).write_text(json.dumps(value), encoding="utf-8")
    assert main([*files[:2], "--output", str(page)]) == 0
    assert (tmp_path / "5-execution.md").read_text(encoding="utf-8").startswith("## Execution\n")
    assert "### Figure 4" in page.read_text(encoding="utf-8")
    one = tmp_path / "18.json"
    one.write_text(json.dumps({"schema": "robust/bench-figure18/1"}), encoding="utf-8")
    for words, message in (
        ([files[2]], "found schema 'other'"),
        ([str(one), str(one)], "expected one of figure20a"),
        ([str(one), files[0]], "or others of one part"),
        ([str(one)], "'runs'"),
    ):
        with pytest.raises(SystemExit):
            main([*words, "--output", str(page)])
        assert message in flowing(capsys.readouterr().err)
