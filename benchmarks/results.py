"""Measure everything that `RESULTS.md` shows, and write it.

`python -m benchmarks.results --suite DIRECTORY` runs, one process at a time, the recorded instances of a data set by
every method, the scaling studies, the data set's robot-delivery plans if it has any, and the start of the command line.
It takes about a quarter of an hour on an idle machine, which also gives steadier figures. With `--plots DIRECTORY` it
draws the figures, too.
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
from typing import Protocol

from benchmarks.parts import joined
from benchmarks.results_text import EXACT_METHODS, Delivery, Machine, Measurements, as_markdown
from robust.bench import process
from robust.bench.figure3 import run_figure3
from robust.bench.figure5 import run_figure5
from robust.bench.growth import run_backends, run_encodings
from robust.bench.options import check_limit
from robust.bench.process import Measured, Processes
from robust.bench.recorded import run_recorded
from robust.bench.scaling import run_scaling
from robust.errors import InputError, RobustError

OUTPUT = Path(__file__).with_name("RESULTS.md")
STARTS = 11
COMPARISON_LIMIT = 10.0
EXACT_LIMIT = 60.0
PACKAGES = ("z3-solver", "cvc5", "pysmt")


@dataclass(frozen=True, slots=True)
class _Plan:
    """A plan of the data set's `robot-delivery`."""

    name: str
    parameters: int
    files: tuple[Path, Path, Path]


class _Report(Protocol):
    @property
    def complete(self) -> bool: ...


@dataclass(frozen=True, slots=True)
class _Limits:
    """Seconds for a process: in general, in comparisons, and for the exact methods in these."""

    general: float
    comparison: float
    exact: float


def measure(suite: Path, limits: _Limits, plots: Path | None = None) -> Measurements:
    """Run everything, and draw the figures into a directory if there is one.

    Raises:
        RobustError: if the data set is malformed, or the run was interrupted.
    """
    plans = tuple(_delivery_plans(suite))
    limit, comparison = limits.general, limits.comparison
    own_limits = dict.fromkeys(EXACT_METHODS, limits.exact)
    processes = Processes()
    machine = _machine()
    help_seconds = median(_start(processes) for _ in range(STARTS))
    recorded = run_recorded(suite, limit=limit, plot=_plot(plots, "recorded"), on_result=_progress)
    _require_complete(recorded)
    plot = _plot(plots, "figure3")
    figure3 = run_figure3(suite, limit=comparison, own_limits=own_limits, plot=plot, on_result=_progress)
    _require_complete(figure3)
    figure5 = run_figure5(suite, limit=limits.exact, plot=_plot(plots, "figure5"), on_result=_progress)
    _require_complete(figure5)
    scaling = run_scaling(limit=limit, plot=_plot(plots, "scaling"), on_result=_progress)
    _require_complete(scaling)
    backends = run_backends(limit=comparison, plot=_plot(plots, "backends"), on_result=_progress)
    _require_complete(backends)
    encodings = run_encodings(limit=comparison, plot=_plot(plots, "encodings"), on_result=_progress)
    _require_complete(encodings)
    deliveries = []
    for done, plan in enumerate(plans, 1):
        deliveries.append(_check(processes, plan, limit))
        _progress(done, len(plans), f"{plan.name}: {deliveries[-1].verdict}")
    return Measurements(
        machine=machine,
        limit=limit,
        help_seconds=help_seconds,
        recorded=recorded,
        figure3=figure3,
        figure5=figure5,
        scaling=scaling,
        backends=backends,
        encodings=encodings,
        deliveries=tuple(deliveries),
    )


def _plot(directory: Path | None, name: str) -> Path | None:
    return None if directory is None else directory / f"{name}.svg"


def _require_complete(report: _Report) -> None:
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
    for name, seconds, what in (
        ("--comparison-limit", COMPARISON_LIMIT, "for each process of the comparisons of back ends and encodings"),
        ("--exact-limit", EXACT_LIMIT, "there for IRR, exact widening, the optimal box and the region by `project`"),
    ):
        parser.add_argument(name, type=float, default=seconds, metavar="SECONDS", help=f"{what}; default: {seconds:g}")
    parser.add_argument("--plots", type=Path, metavar="DIRECTORY", help="draw the figures as well, as .svg")
    parser.add_argument("--output", type=Path, default=OUTPUT, metavar="FILE", help="default: %(default)s")
    options = parser.parse_args(arguments)
    try:
        limits = _Limits(options.limit, options.comparison_limit, options.exact_limit)
        for limit in (limits.general, limits.comparison, limits.exact):
            check_limit(limit)
        text = joined(as_markdown(measure(options.suite, limits, options.plots)))
        options.output.write_text(text, encoding="utf-8")
    except (RobustError, OSError) as error:
        parser.error(str(error))
    except KeyboardInterrupt:
        parser.error("interrupted; nothing is written")
    print(options.output)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
