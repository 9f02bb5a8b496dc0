"""Stand-ins for what experiments run."""

import json
import os
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from rich.console import Console

import benchmarks
from benchmarks.catalogue import EXPERIMENTS
from benchmarks.engine.experiment import Report
from benchmarks.engine.show import Table
from benchmarks.generators.sizes import envelope_sum
from robust import Region
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.sweeps.sweep import Task, run_sweep

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"
SCHEMAS = Path(benchmarks.__file__).parent / "schemas"

MakeSuite = Callable[..., Path]
Stand = Callable[[str], None]
Trial = Callable[..., Report[Any]]

STAND = Path(__file__).with_name("data").joinpath("stand.txt").read_text(encoding="utf-8")
"""Answers as those of `python -m robust`, with the keys that the experiments read; an exact envelope is a ≤ 3."""


def run(name: str, **options: Any) -> Report[Any]:
    """Run an experiment."""
    return EXPERIMENTS[name].load().run(**options)


def example(name: str = "two_sample_navigation") -> dict[str, str]:
    files = {"domain": "domain.pddl", "problem": "problem.pddl", "plan": "plan.stn"}
    return {key: str(EXAMPLES / name / file) for key, file in files.items()}


def navigation(name: str = "navigation", **fields: Any) -> dict[str, Any]:
    """An instance whose result is known by hand.

    The envelope is the pentagon of benchmarks/domains/two_sample_navigation/README.md. From (30, 40), with Δ = 30 and
    40: both fail on both sides and are halved; 45 is accepted for the upper end of to_ridge (45 + 40 = 85), then, after
    another halving, 30 for the lower end of to_crater (30 + 30 = 60). Everything else fails until both Δ are below 1,
    after 26 attempts.
    """
    return {
        "instance": name,
        **example(),
        "irr": {"status": "ok", "wall_s": 2.5, "memory_mb": 50, "first_widening_s": 0.5, "checks": 26},
        "irr_box": {"to_ridge": ["30", "45"], "to_crater": ["30", "40"]},
        "irr_order": ["to_ridge", "to_crater"],
        "ccmmz": {"status": "out of time", "wall_s": 3600.5, "memory_mb": 9000},
        **fields,
    }


def promised_region(parameters: int) -> Region:
    """The envelope that the generator of unordered jobs promises."""
    names = tuple(f"d{i}" for i in range(1, parameters + 1))
    sides = [LinearConstraint.of({name: -1}, "<=", 0) for name in names]
    total = LinearConstraint.of(dict.fromkeys(names, 1), "<=", envelope_sum(parameters))
    return Region(names, (Polyhedron(names, (*sides, total)),))


def rendered(tables: Iterable[Table]) -> str:
    """What a wide terminal shows."""
    text = StringIO()
    console = Console(width=160, file=text)
    for table in tables:
        console.print(table.rich())
    return text.getvalue()


def checked(report: Report[Any]) -> dict[str, Any]:
    """The report as JSON that has passed through text and its schema."""
    value: dict[str, Any] = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    name = value["schema"].split("/")[1]
    jsonschema.validate(value, json.loads((SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8")))
    return value


@pytest.fixture
def make_suite(tmp_path: Path) -> MakeSuite:
    """Writes instances, delivery plans and logs as a data set and returns its directory."""

    def make(*instances: Any, delivery: Any = None, logs: Any = None) -> Path:
        directory = tmp_path / "suite"
        (directory / "robot-delivery").mkdir(parents=True, exist_ok=True)
        (directory / "recorded-results.json").write_text(json.dumps(instances), encoding="utf-8")
        if delivery is not None:
            path = directory / "robot-delivery" / "instances.json"
            path.write_text(json.dumps(delivery), encoding="utf-8")
        if logs is not None:
            (directory / "plans.json").write_text(json.dumps(logs), encoding="utf-8")
        return directory

    return make


@pytest.fixture
def stand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stand:
    """Replaces `python -m robust` by a script in the current directory, which answers if it comes to its end."""
    directory = tmp_path / "stand"
    directory.mkdir()
    monkeypatch.chdir(directory)

    def put(script: str) -> None:
        (directory / "robust.py").write_text(f"{STAND}{script}\nprint(json.dumps(ANSWER))\n", encoding="utf-8")

    return put


@pytest.fixture
def trial(make_suite: MakeSuite, stand: Stand) -> Trial:
    """Runs an experiment on these instances with a script in place of the command; the report fits its schema."""

    def run_it(name: str, script: str, *instances: Any, delivery: Any = None, **options: Any) -> Report[Any]:
        stand(script)
        if instances or delivery:
            options["suite"] = make_suite(*instances, delivery=delivery)
        report = run(name, **options)
        checked(report)
        return report

    return run_it


@dataclass(frozen=True)
class Squared:
    square: int


def square(number, log, seconds=0.0, *_):
    """Leaves a line in a file for each attempt."""
    with log.open("a") as file:
        file.write(f"{number} {os.getpid()}\n")
    time.sleep(seconds)
    if number < 0:
        raise ValueError("negative\nsecond line")
    return Squared(number**2)


def deadly(number, log, seconds=0.0):
    """Kills its own process for some numbers: always for 3, the first time for 5."""
    made = attempts(log) if log.exists() else Counter()
    result = square(number, log, seconds)
    if number == 3 or (number == 5 and not made[5]):
        os.kill(os.getpid(), signal.SIGKILL)
    return result


def task(number, log, *more):
    return Task(f"square {number}", (number, log, *more))


def attempts(log):
    return Counter(int(line.split()[0]) for line in log.read_text().splitlines())


def sweep_of(some, work=square, **options):
    return run_sweep(some, work, record=Squared, **options)
