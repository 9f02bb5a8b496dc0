"""The driver that writes RESULTS.md, with a stand-in for the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from benchmarks.results import main
from tests.bench.conftest import MakeSuite, Stand, navigation

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


def add_deliveries(suite: Path) -> None:
    entry = {key: navigation()[key] for key in ("domain", "problem", "plan")}
    (suite / "robot-delivery").mkdir()
    path = suite / "robot-delivery" / "instances.json"
    path.write_text(json.dumps([{"instance": "d1", "parameters": 4, **entry}]), encoding="utf-8")


def test_the_page(make_suite: MakeSuite, stand: Stand, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stand(ANSWERS)
    suite = make_suite(navigation("a|b", irr_box={"a": ["1/3", "inf"]}, irr={"status": "ok", "wall_s": 2, "checks": 3}))
    add_deliveries(suite)
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
    assert "recorded IRR boxes inside the exact region: 1 of 1" in text.replace("\n", " ")
    for line in text.splitlines():
        assert line == line.rstrip()
        assert len(line) <= 120 or line.startswith("|"), line


def test_nothing_is_written_on_errors(
    make_suite: MakeSuite, stand: Stand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "RESULTS.md"
    stand("sys.exit('broken')")
    for suite, message in [
        (make_suite(navigation()), "does not start: broken"),
        (tmp_path / "absent", "does not start"),
    ]:
        with pytest.raises(SystemExit) as stop:
            main(["--suite", str(suite), "--output", str(output)])
        assert stop.value.code == 2
        assert message in capsys.readouterr().err
    stand(ANSWERS)
    for arguments, message in [
        (["--suite", str(tmp_path / "absent")], "expected a directory"),
        (["--suite", str(make_suite(navigation())), "--limit", "0"], "the limit is 0"),
    ]:
        with pytest.raises(SystemExit):
            main([*arguments, "--output", str(output)])
        assert message in capsys.readouterr().err
    assert not output.exists()
