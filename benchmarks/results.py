"""Measure everything that `RESULTS.md` shows, and write it.

`python -m benchmarks.results --suite DIRECTORY` runs, one process at a time, the recorded instances of a data set, the
scaling study, the data set's robot-delivery plans if it has any, and the start of the command line. It takes a few
minutes; an idle machine gives steadier figures.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median

from benchmarks.results_text import Delivery, Machine, Measurements, as_markdown
from robust.bench import process
from robust.bench.options import check_limit
from robust.bench.process import Measured, Processes
from robust.bench.recorded import RecordedReport, run_recorded
from robust.bench.scaling import ScalingReport, run_scaling
from robust.errors import InputError, RobustError

OUTPUT = Path(__file__).with_name("RESULTS.md")
STARTS = 11
PACKAGES = ("z3-solver", "cvc5", "pysmt")


@dataclass(frozen=True, slots=True)
class _Plan:
    """A plan of the data set's `robot-delivery`."""

    name: str
    parameters: int
    files: tuple[Path, Path, Path]


def measure(suite: Path, limit: float | None) -> Measurements:
    """Run everything.

    Raises:
        RobustError: if the data set is malformed, or the run was interrupted.
    """
    plans = tuple(_delivery_plans(suite))
    processes = Processes()
    machine = _machine()
    help_seconds = median(_start(processes) for _ in range(STARTS))
    recorded = run_recorded(suite, limit=limit, on_result=_progress)
    _require_complete(recorded)
    scaling = run_scaling(limit=limit, on_result=_progress)
    _require_complete(scaling)
    deliveries = []
    for done, plan in enumerate(plans, 1):
        deliveries.append(_check(processes, plan, limit))
        _progress(done, len(plans), f"{plan.name}: {deliveries[-1].verdict}")
    return Measurements(machine, limit, help_seconds, recorded, scaling, tuple(deliveries))


def _require_complete(report: RecordedReport | ScalingReport) -> None:
    if not report.complete:
        raise RobustError("interrupted; nothing is written")


def _delivery_plans(suite: Path) -> Iterator[_Plan]:
    path = suite / "robot-delivery" / "instances.json"
    if not path.is_file():
        return
    try:
        for entry in json.loads(path.read_text(encoding="utf-8")):
            files = (suite / entry["domain"], suite / entry["problem"], suite / entry["plan"])
            yield _Plan(entry["instance"], entry["parameters"], files)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not a list of instances ({type(error).__name__}: {error})") from None


def _start(processes: Processes) -> float:
    """Seconds of the command line to show its help."""
    measured = processes.run([*process.COMMAND, "--help"])
    if measured.exit_code != 0:
        raise RobustError(f"the command line does not start: {measured.last_error}")
    return measured.seconds


def _check(processes: Processes, plan: _Plan, limit: float | None) -> Delivery:
    command = [*process.COMMAND, "check", *(str(file.resolve()) for file in plan.files), "--json"]
    measured = processes.run(command, limit=limit)
    return Delivery(plan.name, plan.parameters, _verdict(measured), measured.seconds, measured.memory_mb)


def _verdict(measured: Measured) -> str:
    if measured.timed_out:
        return "out of time"
    try:
        return str(json.loads(measured.stdout)["verdict"])
    except (ValueError, KeyError, TypeError):
        return f"error: {measured.last_error}"


def _machine() -> Machine:
    return Machine(
        processor=_processor(),
        cores=os.cpu_count() or 1,
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        packages={name: _version(name) for name in PACKAGES},
        date=datetime.now(UTC).date().isoformat(),
        load=os.getloadavg()[0],
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _progress(done: int, total: int, text: str) -> None:
    print(f"{done}/{total} {text}", file=sys.stderr, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.results", description=__doc__)
    parser.add_argument("--suite", type=Path, required=True, metavar="DIRECTORY", help="the data set of recorded runs")
    parser.add_argument("--limit", type=float, default=600.0, metavar="SECONDS", help="for each process; default: 600")
    parser.add_argument("--output", type=Path, default=OUTPUT, metavar="FILE", help="default: %(default)s")
    options = parser.parse_args(arguments)
    try:
        check_limit(options.limit)
        text = as_markdown(measure(options.suite, options.limit))
        options.output.write_text(text, encoding="utf-8")
    except (RobustError, OSError) as error:
        parser.error(str(error))
    except KeyboardInterrupt:
        parser.error("interrupted; nothing is written")
    print(options.output)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
