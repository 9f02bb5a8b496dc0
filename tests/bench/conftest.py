"""Small data sets made of the shipped examples, and stand-ins for the command line."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from rich.table import Table

from robust.bench import process

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"

MakeSuite = Callable[..., Path]
Stand = Callable[[str], Path]

ENVELOPE = {
    "schema": "robust/envelope/1",
    "status": "complete",
    "checks": 3,
    "first_widening_s": 0.01,
    "seconds": 0.02,
    "parameters": {"a": {"lower": "1/3", "upper": "inf", "lower_closed": True, "upper_closed": False}},
}
"""An answer of `robust envelope --json`, with the keys that the drivers read."""


def navigation(name: str = "navigation", **fields: Any) -> dict[str, Any]:
    """An instance whose result is known by hand.

    The envelope is the pentagon of benchmarks/domains/two_sample_navigation/README.md. From (30, 40), with Δ = 30 and
    40: both fail on both sides and are halved; 45 is accepted for the upper end of to_ridge (45 + 40 = 85), then, after
    another halving, 30 for the lower end of to_crater (30 + 30 = 60). Everything else fails until both Δ are below 1,
    after 26 attempts.
    """
    directory = EXAMPLES / "two_sample_navigation"
    return {
        "instance": name,
        **{part: str(directory / f"{part}.pddl") for part in ("domain", "problem")},
        "plan": str(directory / "plan.stn"),
        "irr": {"status": "ok", "wall_s": 2.5, "memory_mb": 50, "first_widening_s": 0.5, "checks": 26},
        "irr_box": {"to_ridge": ["30", "45"], "to_crater": ["30", "40"]},
        "irr_order": ["to_ridge", "to_crater"],
        "ccmmz": {"status": "out of time", "wall_s": 3600.5, "memory_mb": 9000},
        **fields,
    }


def rendered(tables: Iterable[Table]) -> str:
    """What a wide terminal shows."""
    text = StringIO()
    console = Console(width=160, file=text)
    for table in tables:
        console.print(table)
    return text.getvalue()


@pytest.fixture
def make_suite(tmp_path: Path) -> MakeSuite:
    """Writes instances as a data set and returns its directory."""

    def make(*instances: dict[str, Any]) -> Path:
        directory = tmp_path / "suite"
        directory.mkdir(exist_ok=True)
        (directory / "recorded-results.json").write_text(json.dumps(instances), encoding="utf-8")
        return directory

    return make


@pytest.fixture
def stand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stand:
    """Replaces the command line by a Python script; what it needs is in `ANSWER` and `sys.argv`."""

    def put(script: str) -> Path:
        path = tmp_path / "stand.py"
        head = f"import json, os, sys, time\nANSWER = json.loads({json.dumps(ENVELOPE)!r})\n"
        path.write_text(head + script, encoding="utf-8")
        monkeypatch.setattr(process, "COMMAND", (sys.executable, str(path)))
        return path

    return put
