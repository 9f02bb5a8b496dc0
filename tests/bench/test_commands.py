"""The commands of the comparisons: options reach the drivers, and their reports become text, JSON and exit codes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from rich.table import Table

import robust.bench.figure3
import robust.bench.figure5
import robust.bench.growth
from tests.cli.running import command

DRIVERS = {
    "figure3": (robust.bench.figure3, "run_figure3"),
    "figure5": (robust.bench.figure5, "run_figure5"),
    "backends": (robust.bench.growth, "run_backends"),
    "encodings": (robust.bench.growth, "run_encodings"),
}
WITH_SUITE = {"figure3", "figure5"}


@dataclass
class Report:
    agrees: bool = True
    complete: bool = True

    def as_dict(self) -> dict[str, Any]:
        return {"schema": "test", "agrees": self.agrees}

    def tables(self) -> Sequence[Table]:
        table = Table("method")
        table.add_row("exact widening")
        return [table]


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> dict[str, tuple[tuple[Any, ...], dict[str, Any]]]:
    made: dict[str, tuple[tuple[Any, ...], dict[str, Any]]] = {}
    for name, (module, function) in DRIVERS.items():

        def driver(*arguments: Any, on_result: Any, _name: str = name, **options: Any) -> Report:
            on_result(1, 2, "one: complete")
            made[_name] = (arguments, options)
            return Report(agrees=options["jobs"] != 3, complete=options["jobs"] != 4)

        monkeypatch.setattr(module, function, driver)
    return made


@pytest.mark.parametrize("name", DRIVERS)
def test_options_and_exit_codes(name: str, calls: Any, tmp_path: Path) -> None:
    suite = ["--suite", tmp_path] if name in WITH_SUITE else []
    plot = tmp_path / "plot.svg"
    ended = command("bench", name, *suite, "--limit", "1/2", "--plot", plot, "--jobs", "2")
    assert (ended.code, ended.err) == (0, "")
    assert "exact widening" in ended.out
    assert calls[name] == (tuple(suite[1:]), {"jobs": 2, "limit": 0.5, "plot": plot})
    ended = command("bench", name, *suite, "--json")
    assert json.loads(ended.out) == {"schema": "test", "agrees": True}
    assert calls[name][1] == {"jobs": 1, "limit": 10.0, "plot": None}
    assert command("bench", name, *suite, "--jobs", "3").code == 1
    assert command("bench", name, *suite, "--jobs", "4").code == 3
    ended = command("bench", name, *suite, "--limit", "never")
    assert (ended.code, ended.err.count("\n")) == (2, 1)


@pytest.mark.parametrize("name", sorted(WITH_SUITE))
def test_missing_suite(name: str, tmp_path: Path) -> None:
    ended = command("bench", name, "--suite", tmp_path / "nowhere")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert "nowhere" in ended.err
