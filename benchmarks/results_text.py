"""Measurements as the Markdown of `RESULTS.md`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

from robust.bench.recorded import RecordedReport
from robust.bench.scaling import ScalingReport
from robust.bench.tables import count, figure, recorded_cells

COMMAND = "python -m benchmarks.results --suite DIRECTORY"


@dataclass(frozen=True, slots=True)
class Machine:
    """Where and with what our figures were measured."""

    processor: str
    cores: int
    system: str
    python: str
    packages: Mapping[str, str]
    date: str
    load: float
    """Processes that were running on average during the minute before."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """One `robust check` of a robot-delivery plan, as a whole process."""

    name: str
    parameters: int
    verdict: str
    seconds: float
    memory_mb: float


@dataclass(frozen=True)
class Measurements:
    """Everything that the page shows."""

    machine: Machine
    limit: float | None
    help_seconds: float
    recorded: RecordedReport
    scaling: ScalingReport
    deliveries: tuple[Delivery, ...]


def as_markdown(measured: Measurements) -> str:
    """The whole page."""
    sections = [_head(measured), _recorded(measured.recorded), _scaling(measured.scaling)]
    if measured.deliveries:
        sections.append(_deliveries(measured.deliveries))
    sections.append(_start(measured.help_seconds))
    return "\n\n".join(sections) + "\n"


def _head(measured: Measurements) -> str:
    machine = measured.machine
    packages = ", ".join(f"{name} {version}" for name, version in machine.packages.items())
    limit = "no limit" if measured.limit is None else f"a limit of {measured.limit:g} s each"
    facts = (
        f"Written by `{COMMAND}`; do not edit. Measured on {machine.date}: {machine.processor}, {machine.cores} cores, "
        f"{machine.system}, Python {machine.python}, {packages}; load before the start: {machine.load:.1f}."
    )
    reading = (
        "*Ours* are whole processes on this machine, one at a time: start-up, reading, encoding and search, with "
        f"{limit}. Seconds are wall time and grow with whatever else the machine is doing; memory is the peak of the "
        "process in MiB. *Recorded* figures are those published with the data set, measured on its authors' machine "
        "(Xeon E5-2620 2.1 GHz, limits 3600 s and 20 GB). What can be compared exactly is the answer. Ratios of times "
        "are across machines, and therefore indicative only."
    )
    return _page("# Results", facts, reading)


def _recorded(report: RecordedReport) -> str:
    totals = report.totals
    solved, seconds = totals["solved"], totals["seconds"]
    same = f"{totals['agreeing']} of {totals['compared']}"
    table = _table(
        ("instance", "seconds", "first widening, s", "checks", "MiB", "box and checks"),
        [(*recorded_cells(row), row.verdict) for row in report.rows],
    )
    method = (
        "Incremental robustification with β = 1, the doubling schedule and the recorded order of turns "
        "(`robust bench recorded`). Columns with slashes: ours / recorded IRR / recorded CCMMZ. Our "
        "first widening counts from the start of the process; from when the recorded one counts is not documented."
    )
    summary = (
        f"{same} instances agree with the recorded run in box (fraction by fraction) and number of checks. Solved: "
        f"ours {solved['ours']}, recorded IRR {solved['irr']}, recorded CCMMZ {solved['ccmmz']} of "
        f"{totals['instances']}. For the {seconds['instances']} that both ours and recorded IRR solved: ours "
        f"{figure(seconds['ours'])} s (processor time {figure(seconds['ours_cpu'])} s), recorded "
        f"{figure(seconds['irr'])} s in total. Greatest memory of ours: {figure(totals['memory_mb']['ours'], 0)} MiB."
    )
    return _page("## Recorded instances", method, summary, table)


def _scaling(report: ScalingReport) -> str:
    headings = ("refuels", "parameters", "seconds", "search, s", "checks", "queries", "MiB", "status")
    intro = (
        "Generated instances of the generating-set domain, β = 1, default schedule (`robust bench scaling`). "
        "All figures are ours."
    )
    parts = [_page("## Scaling", intro)]
    for series in report.series:
        rows = [
            (
                str(row.refuels),
                str(row.parameters),
                figure(row.ours.seconds),
                figure(row.ours.search_s),
                count(row.ours.checks),
                count(row.ours.queries),
                figure(row.ours.memory_mb, 0),
                row.ours.text,
            )
            for row in report.rows_of(series)
        ]
        parts.append(f"{series.title}:\n\n{_table(headings, rows)}")
    return "\n\n".join(parts)


def _deliveries(deliveries: Sequence[Delivery]) -> str:
    verdicts = [delivery.verdict for delivery in deliveries]
    summary = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in sorted(set(verdicts)))
    table = _table(
        ("plan", "parameters", "verdict", "seconds", "MiB"),
        [
            (one.name, str(one.parameters), one.verdict, figure(one.seconds), figure(one.memory_mb, 0))
            for one in deliveries
        ],
    )
    intro = (
        "`robust check` at the nominal values; all figures are ours, because none are recorded. "
        f"{len(deliveries)} plans: {summary}."
    )
    return _page("## Robot delivery", intro, table)


def _start(seconds: float) -> str:
    return _page("## Start-up", f"`robust --help`, median of several whole processes: {figure(seconds)} s.")


def _page(*blocks: str) -> str:
    """Headings, paragraphs and tables; paragraphs are wrapped."""
    return "\n\n".join(block if block.startswith(("#", "|")) else _wrapped(block) for block in blocks)


def _wrapped(paragraph: str) -> str:
    return fill(paragraph, 120, break_long_words=False, break_on_hyphens=False)


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    return "\n".join(map(_line, (headings, ["---"] * len(headings), *rows)))


def _line(cells: Sequence[str]) -> str:
    escaped = [cell.replace("|", "\\|") for cell in cells]
    return f"| {' | '.join(escaped)} |"
