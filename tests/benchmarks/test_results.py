"""The page with results: what the driver writes with a stand-in for the command line, and parts of printed reports."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks import results
from benchmarks.certificates import CERTIFICATES, CertificateReport, Measured
from benchmarks.engine.measure import Ending, Run
from benchmarks.irr.contenders import IRR, WIDEN
from benchmarks.irr.conversions import CONVERSIONS, ConversionReport, ConversionRow, Count, Kind, Removal, Source
from benchmarks.irr.figure4 import FIGURE4, Assessment, Figure4Report, Figure4Row, Origin
from benchmarks.irr.growth import BackendsReport, EncodingsReport, ScalingReport
from benchmarks.irr.tables import DREEX, TABLE1, TABLE2, Table1Report, Table2Report
from benchmarks.pike.figure17_18 import KIntentsRun
from benchmarks.results import MARK, joined, main, part_of
from tests.benchmarks.conftest import example, navigation
from tests.benchmarks.test_execution import row
from tests.benchmarks.test_pike import execution, report_of


def flowing(text: str) -> str:
    return " ".join(text.split())


def assert_wrapped(text: str) -> None:
    assert [line for line in text.splitlines() if line != line.rstrip() or (len(line) > 120 and line[0] != "|")] == []


def test_the_page(make_suite, stand, tmp_path, capsys, monkeypatch):
    stand("")
    monkeypatch.setattr(results, "STARTS", 2)
    for report in (ScalingReport, BackendsReport, EncodingsReport):
        monkeypatch.setattr(report, "SERIES", tuple(replace(each, sizes=each.sizes[:2]) for each in report.SERIES))
    instance = navigation("a|b", irr_box={"a": ["0", "2"]}, irr={"status": "ok", "wall_s": 2, "checks": 3})
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
    assert len(re.findall(r"^\| [0-9]+ \| [0-9]+ \| .*complete \|$", text, re.MULTILINE)) == 4
    for said in (
        "\n## Instances solved over time, and exact methods\n",
        "\n## Convergence of IRR\n",
        "\n## Elimination back ends\n",
        "\n## Start-up\n",
        "| agreeing in box and checks | 1 of 1 with a recorded box |",
        "indicative only",
    ):
        assert said in text
    assert "recorded IRR boxes inside the exact region: 1 of 1" in flowing(text)
    assert_wrapped(text)


@pytest.mark.parametrize(
    ("script", "words", "message"),
    [
        ("sys.exit('broken')", [], "does not start: broken"),
        ("", ["--suite", "absent"], "expected a directory"),
        ("", ["--limit", "0"], "expected a number above 0"),
        ("", ["figures.json"], "expected one of them"),
    ],
)
def test_nothing_is_written_on_errors(make_suite, stand, tmp_path, script, words, message, capsys):
    stand(script)
    output = tmp_path / "RESULTS.md"
    with pytest.raises(SystemExit, match="2"):
        main(["--suite", str(make_suite(navigation())), *words, "--output", str(output)])
    assert message in capsys.readouterr().err
    assert not output.exists()


def test_the_page_shows_the_parts_as_they_are():
    text = results.OUTPUT.read_text(encoding="utf-8")
    assert text == joined(text)
    assert joined(f"# Own\n\n{MARK}\n\n## Old\n").startswith(f"# Own\n\n{MARK}\n\n## ")
    assert "## Old" not in joined(f"# Own\n\n{MARK}\n\n## Old\n")


def printed(name: str, **fields: Any) -> dict[str, Any]:
    complete = {"complete": True, "agrees": True, "limit": 60.0, "seed": 0, "jobs": 1}
    return {**complete, "schema": f"robust/bench-{name}/1", **fields}


def figure20a() -> dict[str, Any]:
    unknown = dict.fromkeys(("candidate_subplans", "prime_implicants", "models", "message"))
    both = {"instance": "a", "satisfiable": True, **unknown}
    oracle = {"contender": "oracle", "seconds": 0.5, "memory_mb": 80.0, "stages": {"formula": 0.1, "search": 0.05}}
    pitms = {"contender": "pitms", "seconds": 0.7, "memory_mb": 90.0, "stages": {"links": 0.1}}
    plans = [{"instance": "a", "activities": 3, "candidate_subplans": 4}]
    runs = [both | oracle, both | pitms | {"prime_implicants": 3, "models": 2}]
    return printed("figure20a", plans=plans, contradicted=[], runs=runs)


def figure20b(**fields: Any) -> dict[str, Any]:
    same = {"preparation_seconds": 0.25, "wake_seconds": [0.002], "decisions": 2, "message": None}
    names = ("backend", "instance", "outcome", "step_seconds")
    executions = (
        ("smt", "a", "succeeded", [0.001, 0.004]),
        ("smt", "b", "failed", [0.003, 0.2]),
        ("bdd", "a", "succeeded", [0.001]),
        ("bdd", "b", "timeout", [0.5]),
    )
    facts = {"delay": "0", "patient": False, "problems": 3, "decided": 3, "admitting": ["a", "b"], "differences": []}
    runs = [same | dict(zip(names, one, strict=True)) for one in executions]
    return printed("figure20b", executions=runs, **{**facts, **fields})


LATE = "dur_n8 exceeds 170; aries: timeout: no valid plan before the deadline"
PROVED = "x; reachability: no plan: the goal is out of reach: (p) ends at 1, and what needs it would end at 2 or later"


def table(experiment: Any = TABLE1, **more: Any) -> dict[str, Any]:
    report: Any = {TABLE1: Table1Report, TABLE2: Table2Report}[experiment]
    rows = (
        row(DREEX, "a", promises=1),
        row(DREEX, "b", replans=1),
        row("blex:0", "a", replans=2),
        row("blex:0", "b", LATE),
        row("blex:60", "a", PROVED),
        row("blex:60", "b", "x; gave up after 10 re-plans"),
    )
    rows = tuple(replace(one, column=report.DESIGN.columns[0]) for one in rows)
    options = experiment.options(problems=2, seed=7, executors=(DREEX, "blex:0", "blex:60"))
    facts = {"planner": "aries", "planner_s": 14.0, "drain": False, "battery": None}
    facts |= {"problems": 2, "runs": 1, "seed": 7}
    answer: dict[str, Any] = report(experiment, options, facts | more, rows).as_dict()
    return answer


def conversions() -> dict[str, Any]:
    bounds = (Count(Kind.DURATION, Removal.NEEDED, 4), Count(Kind.SEPARATION, Removal.IMPLIED, 1))
    row = ConversionRow(Source.DRAWN, 3, "0: (a) [1]", 3, True, True, 0, bounds, ("e",), 0.25, 1.0)
    return ConversionReport(CONVERSIONS, CONVERSIONS.options(), None, (row,)).as_dict()


def figure4() -> dict[str, Any]:
    solved = Run(Ending.COMPLETE, 1.75, 1.5, 80.0, 1.0)
    late = Run(
        Ending.TIMEOUT, 10.0, 1.0, 80.0, box={"a": ("0", "inf"), "b": ("0", "9")}, unbounded=("a",), capped=("b",)
    )
    assessment = Assessment("complete", "yes", "no", 0.5, 0, 0, "")
    runs = {"irr": solved, "widen": late}
    rows = tuple(Figure4Row(f"own-{n}", Origin.OWN, n, runs, assessment if n == 1 else None) for n in (1, 2))
    return Figure4Report(FIGURE4, FIGURE4.options(baseline_limit=5, contenders=(IRR, WIDEN)), None, rows).as_dict()


def certificates() -> dict[str, Any]:
    quick = Measured("a", "plan", 2, solve=1.0, produce=2.0, check=0.5, size=1000, obligations=2, refuted=1)
    slow = replace(quick, instance="b", kind="box", check=2.5, size=2_000_000)
    wrong = replace(quick, instance="c", rejected="line 3: malformed")
    return CertificateReport(CERTIFICATES, CERTIFICATES.options(suite="."), None, (quick, slow, wrong)).as_dict()


HAND_MADE = KIntentsRun(0, (2, 2), execution("15/2", seconds=0.5), execution(10, 2, "5/2", 1.0))
PRINTED: dict[str, list[dict[str, Any]]] = {
    "20a": [figure20a()],
    "20b": [figure20b()],
    "differences": [figure20b(differences=["b: smt and bdd"])],
    # Half of the guesses are wrong: 0.3125 of recovery to 3.5 of activities.
    "17": [report_of(HAND_MADE).as_dict()],
    "tables": [table(), table(TABLE2, battery="520", drain=True)],
    "conversions and 4": [conversions(), figure4()],
    "certificates": [certificates()],
}
SAID = dict(
    part.split("\n", 1)
    for part in Path(__file__).with_name("data").joinpath("said.txt").read_text(encoding="utf-8")[2:].split("\n# ")
)


@pytest.mark.parametrize("name", PRINTED)
def test_parts_of_what_was_printed(name):
    values = json.loads(json.dumps(PRINTED[name]))
    file, text = part_of(values, "2026-01-01")
    assert file[0].isdigit()
    assert_wrapped(text)
    assert [sentence for sentence in SAID[name].splitlines() if sentence not in flowing(text)] == []
    assert "Measured on 2026-01-01." in flowing(text)
    assert "NOT" not in text
    incomplete = part_of([{**value, "complete": False} for value in values], "2026-01-01")[1]
    assert incomplete.count("NOT all was run.") == len(values)


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(results, "PARTS", tmp_path)
    page = tmp_path / "RESULTS.md"
    page.write_text(f"# Own\n\n{MARK}\n", encoding="utf-8")
    files = []
    for place, value in enumerate((table(), figure4(), {"schema": "other"}, {"schema": "robust/bench-figure18/1"})):
        files.append(str(tmp_path / f"{place}.json"))
        Path(files[-1]).write_text(json.dumps(value), encoding="utf-8")
    assert main([*files[:2], "--output", str(page)]) == 0
    assert (tmp_path / "5-execution.md").read_text(encoding="utf-8").startswith("## Execution\n")
    assert "### Figure 4" in page.read_text(encoding="utf-8")
    for words, message in (
        ([files[2]], "found schema 'other'"),
        ([files[3], files[0]], "expected those of one part"),
        ([files[3]], "'runs'"),
    ):
        with pytest.raises(SystemExit):
            main([*words, "--output", str(page)])
        assert message in flowing(capsys.readouterr().err)
