"""`robust bench`: options reach the drivers, reports become text, JSON and exit codes."""

import json
from dataclasses import dataclass

import pytest
from rich.table import Table

import robust.bench.recorded
import robust.bench.scaling
from tests.cli.running import command


@dataclass
class Report:
    agrees: bool = True
    complete: bool = True

    def as_dict(self):
        return {"schema": "test", "agrees": self.agrees}

    def tables(self):
        table = Table("instance", "box")
        table.add_row("one", "[green]equal[/green]")
        return [table]


@pytest.fixture
def calls(monkeypatch):
    made = []

    def driver(*arguments, on_result, **options):
        made.append((arguments, options))
        on_result(1, 2, "one: equal")
        return made_report[0]

    made_report = [Report()]
    monkeypatch.setattr(robust.bench.recorded, "run_recorded", driver)
    monkeypatch.setattr(robust.bench.scaling, "run_scaling", driver)
    made.append(made_report)
    return made


def test_recorded(calls, tmp_path):
    plot = tmp_path / "plot.svg"
    ended = command("bench", "recorded", "--suite", tmp_path, "--jobs", "2", "--limit", "1/2", "--plot", plot)
    assert (ended.code, ended.err) == (0, "")
    assert calls[1] == ((tmp_path,), {"jobs": 2, "limit": 0.5, "plot": plot})
    assert "equal" in ended.out
    assert "[green]" not in ended.out


def test_scaling_as_json(calls):
    ended = command("bench", "scaling", "--json")
    assert json.loads(ended.out) == {"schema": "test", "agrees": True}
    assert calls[1] == ((), {"jobs": 1, "limit": None, "plot": None})


@pytest.mark.parametrize(("report", "code"), [(Report(), 0), (Report(agrees=False), 1), (Report(False, False), 3)])
def test_exit_codes(calls, report, code):
    calls[0][0] = report
    assert command("bench", "scaling").code == code


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--limit", "0"], "--limit: found '0', expected a number above 0"),
        (["--jobs", "0"], "jobs is 0; expected at least 1"),
        (["--plot", "plot.txt"], "--plot: found 'plot.txt'"),
        (["--jobs", "many"], "Invalid value for '--jobs'"),
    ],
)
def test_bad_options(options, says):
    ended = command("bench", "scaling", *options)
    assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)
    assert says in ended.err


def test_missing_suite(tmp_path):
    ended = command("bench", "recorded", "--suite", tmp_path / "nowhere")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert "nowhere" in ended.err
