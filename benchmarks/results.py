"""Measures everything that `RESULTS.md` shows, and writes it.

`python -m benchmarks.results --suite DIRECTORY` runs, one process at a time, the recorded instances of a data set by
every method, the scaling studies, the data set's robot-delivery plans if it has any, and the start of the command line.
It takes about a quarter of an hour on an idle machine, which also gives steadier figures. With `--plots DIRECTORY` it
draws the figures, too.

What takes longer is measured by runs of its own: `python -m benchmarks.results FILE.json...` makes a part of the page
of what one of `robust bench figure20a`, `figure20b` and `figure18` printed with `--json`, or of what any number of runs
of `table1`, `table2`, `conversions` and `figure4` did; `python -m benchmarks.certificates` writes another. Without
arguments the parts are put at the end of the page as they are.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Any

from robust.errors import InputError, RobustError

from .catalogue import EXPERIMENTS
from .engine import measure
from .engine.experiment import Report
from .engine.show import Table, markdown, number, page
from .results_parts import execution, k_intents, latencies, team_plans

COMMAND = "python -m benchmarks.results --suite DIRECTORY"
OUTPUT = Path(__file__).with_name("RESULTS.md")
PARTS = Path(__file__).with_name("parts")
MARK = "<!-- Parts that are measured by runs of their own: see benchmarks/results.py -->"
STARTS = 11
COMPARISON_LIMIT = 10.0
EXACT_LIMIT = 60.0
EXACT_METHODS = ("irr", "widen", "optimal", "project")
"""The methods that the page lists for each instance; they get more time than the others."""
PACKAGES = ("z3-solver", "cvc5", "pysmt")


# -- measuring ---------------------------------------------------------------------------------------------------------


def run_all(suite: Path, general: float, comparison: float, exact: float, plots: Path | None) -> str:
    """Run everything with these limits, draw the figures into a directory if there is one, and return the page.

    Raises:
        RobustError: if the data set is malformed, or the run was interrupted.
    """
    plans = list(_delivery_plans(suite))
    machine = _machine()
    start = median(_start() for _ in range(STARTS))

    def run(name: str, limit: float, **options: Any) -> Report[Any]:
        plot = None if plots is None else plots / f"{name}.svg"
        report = EXPERIMENTS[name].load().run(limit=limit, plot=plot, on_result=_progress, **options)
        if not report.complete:
            raise RobustError("interrupted; nothing is written")
        return report

    recorded = run("recorded", general, suite=suite)
    figure3 = run("figure3", comparison, suite=suite, own_limits=dict.fromkeys(EXACT_METHODS, exact))
    figure5 = run("figure5", exact, suite=suite)
    scaling = run("scaling", general)
    backends = run("backends", comparison)
    encodings = run("encodings", comparison)
    checks = []
    for done, (name, parameters, files) in enumerate(plans, 1):
        found = measure.run_robust("check", files, [], limit=general)
        checks.append((name, str(parameters), found.text, number(found.seconds), number(found.memory_mb, 0)))
        _progress(done, len(plans), f"{name}: {found.text}")
    sections = [
        _head(machine, general),
        _recorded(recorded),
        _figure3(figure3),
        _exact(figure3),
        _figure5(figure5),
        _series(
            scaling,
            "Scaling",
            "Generated instances of the generating-set domain, β = 1, default schedule (`robust bench scaling`). All "
            "figures are ours.",
        ),
        _growth(backends, "Seconds of `robust region` with each back end (`robust bench backends`)."),
        _growth(encodings, "Seconds of `robust envelope --method irr` (`robust bench encodings`)."),
        *([_deliveries(checks)] if checks else []),
        page("## Start-up", f"`robust --help`, median of several whole processes: {number(start)} s."),
    ]
    return "\n\n".join(sections) + "\n"


def _delivery_plans(suite: Path) -> Iterable[tuple[str, int, measure.Files]]:
    path = suite / "robot-delivery" / "instances.json"
    if not path.is_file():
        return
    try:
        for entry in json.loads(path.read_text(encoding="utf-8")):
            files = (suite / entry["domain"], suite / entry["problem"], suite / entry["plan"])
            yield entry["instance"], entry["parameters"], files
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not a list of instances ({type(error).__name__}: {error})") from None


def _start() -> float:
    """Seconds of the command line to show its help."""
    found = measure.measured([*measure.COMMAND, "--help"])
    if found.exit_code != 0:
        raise RobustError(f"the command line does not start: {found.last_error}")
    return found.seconds


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
        f"Measured on {datetime.now(UTC).date().isoformat()}: {processor}, {os.cpu_count() or 1} cores, "
        f"{platform.system()} {platform.machine()}, Python {platform.python_version()}, {packages}; load before the "
        f"start: {os.getloadavg()[0]:.1f}."
    )


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _progress(done: int, total: int, text: str) -> None:
    print(f"{done}/{total} {text}", file=sys.stderr, flush=True)


# -- the page ----------------------------------------------------------------------------------------------------------


def _head(machine: str, limit: float) -> str:
    reading = (
        "*Ours* are whole processes on this machine, one at a time: start-up, reading, encoding and search, with a "
        f"limit of {limit:g} s each unless another is named. Seconds are wall time and grow with whatever else the "
        "machine is doing; memory is the peak of the process in MiB. *Recorded* figures are those published with the "
        "data set, measured on its authors' machine (Xeon E5-2620 2.1 GHz, limits 3600 s and 20 GB). What can be "
        "compared exactly is the answer. Ratios of times are across machines, and therefore indicative only."
    )
    return page("# Results", f"Written by `{COMMAND}`; do not edit. {machine}", reading)


def _recorded(report: Report[Any]) -> str:
    totals: Mapping[str, Any] = report.findings["totals"]
    solved, seconds = totals["solved"], totals["seconds"]
    method = (
        "Incremental robustification with β = 1, the doubling schedule and the recorded order of turns "
        "(`robust bench recorded`). Columns with slashes: ours / recorded IRR / recorded CCMMZ. Our "
        "first widening counts from the start of the process; from when the recorded one counts is not documented."
    )
    summary = (
        f"{totals['agreeing']} of {totals['compared']} instances agree with the recorded run in box (fraction by "
        f"fraction) and number of checks. Solved: ours {solved['ours']}, recorded IRR {solved['irr']}, recorded CCMMZ "
        f"{solved['ccmmz']} of {totals['instances']}. For the {seconds['instances']} that both ours and recorded IRR "
        f"solved: ours {number(seconds['ours'])} s (processor time {number(seconds['ours_cpu'])} s), recorded "
        f"{number(seconds['irr'])} s in total. Greatest memory of ours: {number(totals['memory_mb']['ours'], 0)} MiB."
    )
    headings = ("instance", "seconds", "first widening, s", "checks", "MiB", "box and checks")
    return page("## Recorded instances", method, summary, markdown(headings, (row.cells for row in report.rows)))


def _figure3(report: Any) -> str:
    own = ", ".join(f"{name} {seconds:g} s" for name, seconds in (report.options.own_limits or {}).items())
    method = (
        "How many instances each method solves within which time [IRR Fig. 3] (`robust bench figure3`). Limits of "
        f"ours: {report.options.limit:g} s{f'; {own}' if own else ''}. The optimal box is what the recorded CCMMZ runs "
        "computed."
    )
    tables = (
        f"{domain}, {len(report.rows_of(domain))} instances:\n\n{report.curve_table(domain).markdown()}"
        for domain in report.domains
    )
    return "\n\n".join([page("## Instances solved over time", method), *tables])


def _exact(report: Any) -> str:
    method = (
        "Exact widening, the exact region (`robust region --backend project`) and the optimal box (`robust envelope "
        "--method optimal`), from the same runs. Each box, ours and the recorded one of IRR, is checked to be inside "
        "the exact region where that was found in time; the recorded box is also proved inside without it. The "
        "recorded optimiser was stopped after 30 improvements, so that its box can be smaller."
    )
    return page("## Exact methods", method, report.totals_text, report.check_table.markdown())


def _figure5(report: Any) -> str:
    method = (
        "Total width of the box as a share of the final one, after some steps of IRR with β = 1 [IRR Fig. 5] (`robust "
        "bench figure5`). A run that has ended counts as 100 %."
    )
    parts = [page("## Convergence of IRR", method, *_sentences(report.notes))]
    for schedule in report.schedules:
        parts.append(f"{schedule.label.capitalize()}:\n\n{report.table(schedule).markdown()}")
    return "\n\n".join(parts)


def _sentences(notes: Sequence[str]) -> list[str]:
    return [f"{note[0].upper()}{note[1:]}." for note in notes]


def _growth(report: Any, intro: str) -> str:
    return _series(report, report.TITLE, intro, *_sentences(report.notes))


def _series(report: Report[Any], title: str, *paragraphs: str) -> str:
    tables: Sequence[Table] = report.tables
    return "\n\n".join([page(f"## {title}", *paragraphs), *(f"{one.title}:\n\n{one.markdown()}" for one in tables)])


def _deliveries(checks: Sequence[tuple[str, ...]]) -> str:
    verdicts = [verdict for _, _, verdict, _, _ in checks]
    summary = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in sorted(set(verdicts)))
    intro = (
        "`robust check` at the nominal values; all figures are ours, because none are recorded. "
        f"{len(checks)} plans: {summary}."
    )
    return page("## Robot delivery", intro, markdown(("plan", "parameters", "verdict", "seconds", "MiB"), checks))


# -- parts -------------------------------------------------------------------------------------------------------------


def joined(results: str) -> str:
    """The page with the parts as they are now."""
    own = results.split(MARK, maxsplit=1)[0].rstrip()
    parts = (path.read_text(encoding="utf-8").strip() for path in sorted(PARTS.glob("*.md")))
    return "\n\n".join([own, MARK, *parts]) + "\n"


@dataclass(frozen=True, slots=True)
class _Part:
    """Where a part of the page is, and how it is made of reports with their dates."""

    file: str
    write: Callable[..., str]
    several: bool = False


_ONE = {
    "figure20a": _Part("1-team-plans.md", team_plans),
    "figure20b": _Part("3-latency.md", latencies),
    "figure18": _Part("4-k-intents.md", k_intents),
}
_EXECUTION = _Part("5-execution.md", execution, several=True)
_PART = {**_ONE, **dict.fromkeys(("table1", "table2", "conversions", "figure4"), _EXECUTION)}


def part_of(answers: Sequence[Mapping[str, Any]], date: str) -> tuple[str, str]:
    """The file of a part, and its text, from what commands printed.

    Raises:
        ValueError: for JSON of another kind, or of several kinds.
    """
    names = [str(answer.get("schema")).removeprefix("robust/bench-").removesuffix("/1") for answer in answers]
    for name, answer in zip(names, answers, strict=True):
        if name not in _PART:
            raise ValueError(f"found schema {answer.get('schema')!r}, expected that of one of {', '.join(_PART)}")
    parts = {id(_PART[name]): _PART[name] for name in names}
    [part, *others] = parts.values()
    if others or (len(answers) > 1 and not part.several):
        raise ValueError(f"found {', '.join(names)}, expected one of {', '.join(_ONE)}, or others of one part")
    if part.several:
        reports = [EXPERIMENTS[name].load().read(answer) for name, answer in zip(names, answers, strict=True)]
        return part.file, part.write(reports, date)
    return part.file, part.write(EXPERIMENTS[names[0]].load().read(answers[0]), answers[0], date)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.results", description=__doc__)
    parser.add_argument("files", type=Path, nargs="*", metavar="FILE.json", help="what runs of their own printed")
    parser.add_argument("--suite", type=Path, metavar="DIRECTORY", help="the data set of recorded runs")
    parser.add_argument("--limit", type=float, default=600.0, metavar="SECONDS", help="for each process; default: 600")
    for name, seconds, what in (
        ("--comparison-limit", COMPARISON_LIMIT, "for each process of the comparisons of back ends and encodings"),
        ("--exact-limit", EXACT_LIMIT, "there for IRR, exact widening, the optimal box and the region by `project`"),
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
                name, part = part_of(answers, datetime.now(UTC).date().isoformat())
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
