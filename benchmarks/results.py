"""Measures everything that `RESULTS.md` shows, and writes it.

`python -m benchmarks.results --suite DIRECTORY` runs, one process at a time, the recorded instances of a data set by
every method, the scaling studies, the data set's robot-delivery plans if it has any, and the start of the command line.
It takes about a quarter of an hour on an idle machine. With `--plots DIRECTORY` it
draws the figures, too.

What takes longer is measured by runs of its own: `python -m benchmarks.results FILE.json...` makes a part of the page
of what any number of runs of `robust bench NAME --json` or `python -m benchmarks.certificates` printed. Without
arguments the parts are put at the end of the page as they are.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Any

from robust.errors import RobustError
from robust.sweeps import batch as measure

from .catalogue import EXPERIMENTS
from .certificates import CERTIFICATES
from .engine.experiment import Experiment
from .engine.measure import Run, run_robust
from .engine.show import Columns, Table, number, page
from .suite import DELIVERIES, FILE_NAME, Delivery, directory_with, read_deliveries

COMMAND = "python -m benchmarks.results --suite DIRECTORY"
OUTPUT = Path(__file__).with_name("RESULTS.md")
PARTS = Path(__file__).with_name("parts")
MARK = "<!-- Parts that are measured by runs of their own: see benchmarks/results.py -->"
STARTS = 11
EXACT_METHODS = ("irr", "widen", "optimal", "project")
"""The methods that the page lists for each instance; they get more time than the others."""
PACKAGES = ("z3-solver", "cvc5", "pysmt")
FILES = {
    "figure20a": "1-team-plans.md",
    **dict.fromkeys(("figure20b", "hesitation", "steps"), "3-latency.md"),
    "figure18": "4-k-intents.md",
    "rates": "4-rates.md",
    "strategies": "4-strategies.md",
    **dict.fromkeys(("table1", "table2", "conversions", "figure4"), "5-execution.md"),
    "certificates": "6-certificates.md",
    "logs": "7-logs.md",
    "stnu": "8-stnu.md",
    "envelopes": "9-envelopes.md",
    "risk": "9-risk.md",
}
"""Where the parts of the page are."""


# -- measuring ---------------------------------------------------------------------------------------------------------


def run_all(suite: Path, general: float, comparison: float, exact: float, plots: Path | None) -> str:
    """Run everything with these limits, draw the figures into a directory if there is one, and return the page.

    Raises:
        RobustError: if the data set is malformed, or the run was interrupted.
    """
    suite = directory_with(FILE_NAME, suite)
    machine = _machine()
    start = median(_start() for _ in range(STARTS))
    runs: tuple[tuple[str, float, dict[str, Any]], ...] = (
        ("recorded", general, {"suite": suite}),
        ("figure3", comparison, {"suite": suite, "own_limits": dict.fromkeys(EXACT_METHODS, exact)}),
        ("figure5", exact, {"suite": suite}),
        ("scaling", general, {}),
        ("backends", comparison, {}),
        ("encodings", comparison, {}),
    )
    sections = []
    for name, limit, options in runs:
        plot = None if plots is None else plots / f"{name}.svg"
        report = EXPERIMENTS[name].load().run(limit=limit, plot=plot, on_result=_progress, **options)
        if not report.complete:
            raise RobustError("interrupted; nothing is written")
        report.plot()
        sections.append(report.section())
    if (suite / DELIVERIES).is_file():
        sections.append(_deliveries(suite, general))
    seconds = f"`robust --help`, median of several whole processes: {number(start)} s of the processor."
    return "\n\n".join([_head(machine, general), *sections, page("## Start-up", seconds)]) + "\n"


def _deliveries(suite: Path, limit: float) -> str:
    """Checks of the plans of which nothing is recorded."""
    plans = read_deliveries(suite)
    runs: list[tuple[Delivery, Run]] = []
    for one, files in plans:
        runs.append((one, run_robust("check", files, [], limit=limit)))
        _progress(len(runs), len(plans), f"{one.instance}: {runs[-1][1].text}")
    columns: Columns[tuple[Delivery, Run]] = {
        "plan": lambda one: one[0].instance,
        "parameters": lambda one: one[0].parameters,
        "verdict": lambda one: one[1].text,
        "seconds": lambda one: one[1].cpu_s,
        "MiB": lambda one: number(one[1].memory_mb, 0),
    }
    verdicts = Counter(run.text for _, run in runs)
    summary = ", ".join(f"{count} {verdict}" for verdict, count in sorted(verdicts.items()))
    intro = (
        "`robust check` at the nominal values; all figures are ours, because none are recorded. "
        f"{len(plans)} plans: {summary}."
    )
    return page("## Robot delivery", intro, Table.of("", columns, runs).markdown)


def _start() -> float:
    """Processor seconds of the command line to show its help."""
    found = measure.measured([*measure.COMMAND, "--help"])
    if found.exit_code != 0:
        raise RobustError(f"the command line does not start: {measure.complaint(found)}")
    return found.cpu_s


def _machine() -> str:
    """Where and with what our figures are measured."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    known = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    processor = next(known, platform.processor() or "unknown")
    packages = ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    return (
        f"Measured on {_when()}: {processor}, {os.cpu_count() or 1} cores, {platform.system()} {platform.machine()}, "
        f"Python {platform.python_version()}, {packages}; load before the start: {os.getloadavg()[0]:.1f}."
    )


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _when() -> str:
    """Today, and the commit that this checkout is at, which is what is measured here."""
    command = ["git", "-C", str(PARTS), "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    return f"{datetime.now(UTC).date().isoformat()} at commit {commit or 'unknown'}"


def _progress(done: int, total: int, text: str) -> None:
    print(f"{done}/{total} {text}", file=sys.stderr, flush=True)


# -- the page ----------------------------------------------------------------------------------------------------------


def _head(machine: str, limit: float) -> str:
    reading = (
        "*Ours* are whole processes on this machine, one at a time: start-up, reading, encoding and search, with a "
        f"limit of {limit:g} s each unless another is named. Seconds are of the processor, because others use the "
        "machine, and limits are by the clock; memory is the peak of the process in MiB. *Recorded* figures are "
        "those published with the data set, measured on its authors' machine (Xeon E5-2620 2.1 GHz, limits 3600 s "
        "and 20 GB). What can be compared exactly is the answer. Ratios of times are across machines, and "
        "therefore indicative only."
    )
    return page("# Results", f"Written by `{COMMAND}`; do not edit. {machine}", reading)


def joined(results: str) -> str:
    """The page with the parts as they are now."""
    own = results.split(MARK, maxsplit=1)[0].rstrip()
    parts = (path.read_text(encoding="utf-8").strip() for path in sorted(PARTS.glob("*.md")))
    return "\n\n".join([own, MARK, *parts]) + "\n"


def _experiment(name: str) -> Experiment:
    return CERTIFICATES if name == CERTIFICATES.name else EXPERIMENTS[name].load()


def part_of(answers: Sequence[Mapping[str, Any]], date: str) -> tuple[str, str]:
    """The file of a part, and its text, from what commands printed.

    Raises:
        ValueError: for JSON of another kind, or of several parts.
    """
    names = [str(answer.get("schema")).removeprefix("robust/bench-").removesuffix("/1") for answer in answers]
    for name, answer in zip(names, answers, strict=True):
        if name not in FILES:
            raise ValueError(f"found schema {answer.get('schema')!r}, expected that of one of {', '.join(FILES)}")
    [file, *others] = {FILES[name] for name in names}
    if others:
        raise ValueError(f"found {', '.join(names)}, expected those of one part")
    reports = [_experiment(name).read(answer) for name, answer in zip(names, answers, strict=True)]
    if file != FILES["table1"]:
        return file, "\n\n".join(report.section(date) for report in reports)
    return file, "\n\n".join(["## Execution", *(report.section(date, level=3) for report in reports)])


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.results", description=__doc__)
    parser.add_argument("files", type=Path, nargs="*", metavar="FILE.json", help="what runs of their own printed")
    parser.add_argument("--suite", type=Path, metavar="DIRECTORY", help="the data set of recorded runs")
    for name, seconds, what in (
        ("--limit", 600.0, "for each process"),
        ("--comparison-limit", 10.0, "for each process of the comparisons of back ends and encodings"),
        ("--exact-limit", 60.0, "there for IRR, exact widening, the optimal box and the region by `project`"),
    ):
        parser.add_argument(name, type=float, default=seconds, metavar="SECONDS", help=f"{what}; default: {seconds:g}")
    parser.add_argument("--plots", type=Path, metavar="DIRECTORY", help="draw the figures as well, as .svg")
    parser.add_argument("--output", type=Path, default=OUTPUT, metavar="FILE", help="default: %(default)s")
    options = parser.parse_args(arguments)
    if options.suite is not None and options.files:
        parser.error("found --suite and files, expected one of them")
    try:
        if options.suite is not None:
            limits = (options.limit, options.comparison_limit, options.exact_limit)
            text = run_all(options.suite, *limits, options.plots)
        else:
            if options.files:
                answers = [json.loads(path.read_text(encoding="utf-8")) for path in options.files]
                name, part = part_of(answers, _when())
                (PARTS / name).write_text(part + "\n", encoding="utf-8")
            text = options.output.read_text(encoding="utf-8")
        options.output.write_text(joined(text), encoding="utf-8")
    except (RobustError, OSError, ValueError, KeyError, TypeError) as error:
        parser.error(str(error) if isinstance(error, RobustError | OSError | ValueError) else repr(error))
    except KeyboardInterrupt:
        parser.error("interrupted; nothing is written")
    print(options.output)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
