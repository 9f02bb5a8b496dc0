"""The page with results: what the driver writes with a stand-in for the command line, and parts of printed reports."""

from __future__ import annotations

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
from benchmarks.irr.tables import DREEX, TABLE1, TABLE2, Table1Report, Table2Report
from benchmarks.pike.figure17_18 import KIntentsRun
from benchmarks.results import MARK, joined, main, part_of
from tests.benchmarks.conftest import example, navigation
from tests.benchmarks.test_execution import row
from tests.benchmarks.test_pike import execution, made


def flowing(text: str) -> str:
    return " ".join(text.split())


def assert_wrapped(text: str) -> None:
    for line in text.splitlines():
        assert line == line.rstrip()
        assert len(line) <= 120 or line.startswith("|"), line


def test_the_page(make_suite, stand, tmp_path, capsys, monkeypatch):
    stand("")
    monkeypatch.setattr(results, "STARTS", 2)
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
    assert len(re.findall(r"^\| [0-9]+ \| [0-9]+ \| .*complete \|$", text, re.MULTILINE)) == 13
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


# -- parts -------------------------------------------------------------------------------------------------------------


def test_the_page_shows_the_parts_as_they_are():
    text = results.OUTPUT.read_text(encoding="utf-8")
    assert text == joined(text)
    assert joined(f"# Own\n\n{MARK}\n\n## Old\n").startswith(f"# Own\n\n{MARK}\n\n## ")
    assert "## Old" not in joined(f"# Own\n\n{MARK}\n\n## Old\n")


COMPLETE = {"complete": True, "agrees": True, "limit": 60.0, "seed": 0, "jobs": 1}


def figure20a() -> dict[str, Any]:
    unknown = dict.fromkeys(("candidate_subplans", "prime_implicants", "models", "message"))
    both = {"instance": "a", "satisfiable": True, **unknown}
    stages = {"formula": 0.1, "search": 0.05}
    counted = {"prime_implicants": 3, "models": 2, "stages": {"links": 0.1}}
    return {
        **COMPLETE,
        "schema": "robust/bench-figure20a/1",
        "plans": [{"instance": "a", "activities": 3, "candidate_subplans": 4}],
        "contradicted": [],
        "runs": [
            {**both, "contender": "oracle", "seconds": 0.5, "memory_mb": 80.0, "stages": stages},
            {**both, "contender": "pitms", "seconds": 0.7, "memory_mb": 90.0, **counted},
        ],
    }


def figure20b(**fields: Any) -> dict[str, Any]:
    same = {"preparation_seconds": 0.25, "wake_seconds": [0.002], "decisions": 2, "message": None}
    executions = (
        ("smt", "a", "succeeded", [0.001, 0.004]),
        ("smt", "b", "failed", [0.003, 0.2]),
        ("bdd", "a", "succeeded", [0.001]),
        ("bdd", "b", "timeout", [0.5]),
    )
    names = ("backend", "instance", "outcome", "step_seconds")
    return {
        **COMPLETE,
        "schema": "robust/bench-figure20b/1",
        "delay": "0",
        "patient": False,
        "problems": 3,
        "decided": 3,
        "admitting": ["a", "b"],
        "differences": [],
        "executions": [same | dict(zip(names, one, strict=True)) for one in executions],
        **fields,
    }


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
    printed: dict[str, Any] = report(experiment, options, facts | more, rows).as_dict()
    return printed


def conversions() -> dict[str, Any]:
    bounds = (Count(Kind.DURATION, Removal.NEEDED, 4), Count(Kind.SEPARATION, Removal.IMPLIED, 1))
    row = ConversionRow(Source.DRAWN, 3, "0: (a) [1]", 3, True, True, 0, bounds, ("e",), 0.25, 1.0)
    return ConversionReport(CONVERSIONS, CONVERSIONS.options(), None, (row,)).as_dict()


def figure4() -> dict[str, Any]:
    solved = Run(Ending.COMPLETE, 1.5, 1.0, 80.0, 1.0)
    box = {"a": ("0", "inf"), "b": ("0", "9")}
    late = Run(Ending.TIMEOUT, 10.0, 1.0, 80.0, box=box, unbounded=("a",), capped=("b",))
    found = Assessment("complete", "yes", "no", 0.5, 0, 0, "")
    runs = {"irr": solved, "widen": late}
    rows = tuple(Figure4Row(f"own-{n}", Origin.OWN, n, runs, found if n == 1 else None) for n in (1, 2))
    options = FIGURE4.options(baseline_limit=5, contenders=(IRR, WIDEN))
    return Figure4Report(FIGURE4, options, None, rows).as_dict()


def certificates() -> dict[str, Any]:
    quick = Measured("a", "plan", 2, solve=1.0, produce=2.0, check=0.5, size=1000, obligations=2, refuted=1)
    slow = replace(quick, instance="b", kind="box", check=2.5, size=2_000_000)
    wrong = replace(quick, instance="c", rejected="line 3: malformed")
    return CertificateReport(CERTIFICATES, CERTIFICATES.options(suite="."), None, (quick, slow, wrong)).as_dict()


HAND_MADE = KIntentsRun(0, (2, 2), execution("15/2", seconds=0.5), execution(10, 2, "5/2", 1.0))
SAID: list[tuple[list[dict[str, Any]], list[str]]] = [
    (
        [figure20a()],
        [
            "| oracle | 1 | 1 | – | 0.50 | 0.50 | 0.50 | 0 | 80 |",
            "0.15 s median, 0.15 s at most",
            "more implicants than models: 1 of 1 plans",
        ],
    ),
    (
        [figure20b()],
        [
            "| smt | 2 | 2 | 1 | 0 | 250.0 | 250.0 | 2.0 |",
            "| bdd | 1 | 2 | 1 | 1 | 250.0 | 250.0 | 2.0 |",
            "| smt | 4 | 3.5 | 102.0 | 200.0 | 200.0 | 1 (50.0%) | 2 (100.0%) |",
            "same decisions",
        ],
    ),
    ([figure20b(differences=["b: smt and bdd"])], ["different decisions: b: smt and bdd"]),
    (
        [made(HAND_MADE).as_dict()],
        [
            "| 2 | 1 | 2.00 | – | 2 | 1.00 | 0 |",
            "| 2 | 1 | 7.50 | 10.00 | 25.0 | – | 25.0 | 25.0 | 0.500 | 1.000 |",
            "| of Kirk's time, with computing | 27.3 | – | 13.4 |",
            # Half of the guesses are wrong: 0.3125 of recovery to 3.5 of activities.
            "0.500 of the guesses are wrong",
            "save 8.2% of Kirk's time",
        ],
    ),
    (
        [table(), table(TABLE2, battery="520", drain=True)],
        [
            "### Table 1: uncertain durations",
            "### Table 2: uncertain consumption",
            "planner aries, at most 14 s for each plan, battery 520; 2 problems, 1 simulated world each, seed 7; "
            "actions that run when a plan is given up are waited for",
            "| executor | 1 parameter |",
            "| DREEX | 100.0 % [34–100] / 92.2 %; 0.50 / 0.1 |",
            "| BLEX(0) | 50.0 % [9–91] / 0.0 %; 2.00 / – |",
            "| BLEX(60) | 2 : 0, 0.5000 |",
            "| executor | aries: timeout | reachability: no plan | too many re-plans |",
            "| BLEX(0) | 1 | 0 | 0 |",
            "1 plans had to succeed, because all was observed inside dynamically controllable boxes: 0 did not",
            "more than every other executor in 1 of 1 columns",
            "fewer than 0.3 re-plans on average in 0: 1 in 2 successful runs, 0.5000 on average.",
            "BLEX(0) succeeds in 1 runs, 1 of them with re-plans",
            "1 of 3 failed runs ended because the planner ran out of time",
            "Percentage points from the paper: DREEX +7.8 to +7.8 (mean +7.8), BLEX -78.8 to +50.0 (mean -14.4)",
            "The charge was fixed before the runs: 520, so that about one run in ten",
        ],
    ),
    (
        [conversions(), figure4()],
        [
            "| with a removable bound | 1 |",
            "| seconds to convert, median | 0.25 |",
            "| duration | 4 | 4 | 0 | 0 | 0 |",
            "| separation of mutex time points | 1 | 0 | 1 | 0 | 0 |",
            "own: solved within, of 2:",
            "| IRR | 0 | 0 | 2 | 2 | 2 | 1.50 | 1.50 |",
            "| exact widening | 0 | 0 | 0 | 0 | 0 | – | – |",
            "Of 1 boxes of exact widening: dynamically controllable: yes 1; strongly: no 1.",
            "Of the 8 ends of the 2 boxes of exact widening, 2 are infinite, and 2 are durations",
            "they keep 50.0 % of their widths on average",
            "IRR and widening with a limit of 10 s each, the others with a limit of 5 s each",
        ],
    ),
    (
        [certificates()],
        [
            "2 of 3 certificates of 3 plans are accepted",
            "no box takes longer to check than 2.50 s (b); aim: 1 s",
            "producing takes at most 2.0 times solving (b, box); aim: 3 for boxes",
            "has 2000.0 kB (b, box); aim: less than 100 kB",
            "not accepted: c, plan: line 3: malformed",
            "| b | 2 | – | 1.000, 2.000, 2.500; 2.50; 1 of 2; 2000.0 kB | – |",
        ],
    ),
]


@pytest.mark.parametrize(("answers", "said"), SAID, ids=len)
def test_parts_of_what_was_printed(answers, said):
    values = [json.loads(json.dumps(answer)) for answer in answers]
    file, text = part_of(values, "2026-01-01")
    assert file[0].isdigit()
    assert_wrapped(text)
    for sentence in said:
        assert sentence in flowing(text), sentence
    assert "Measured on 2026-01-01." in flowing(text)
    assert "NOT" not in text
    incomplete = part_of([{**value, "complete": False} for value in values], "2026-01-01")[1]
    assert incomplete.count("NOT all was run.") == len(answers)


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
