"""Measurements as the Markdown of `RESULTS.md`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

from robust.bench.contenders import IRR, OPTIMAL, WIDEN
from robust.bench.figure3 import Figure3Report
from robust.bench.figure5 import Figure5Report
from robust.bench.figure_tables import (
    CHECK_HEADINGS,
    CURVE_HEADINGS,
    STEP_HEADINGS,
    check_row,
    curve_rows,
    growth_headings,
    growth_rows,
    step_rows,
    totals_text,
)
from robust.bench.growth import GrowthReport
from robust.bench.recorded import RecordedReport
from robust.bench.scaling import ScalingReport
from robust.bench.tables import count, figure, recorded_cells

COMMAND = "python -m benchmarks.results --suite DIRECTORY"
EXACT_METHODS = (IRR.name, WIDEN.name, OPTIMAL.name, "project")
"""The methods that the page lists for each instance; they get more time than the others."""


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
    figure3: Figure3Report
    figure5: Figure5Report
    scaling: ScalingReport
    backends: GrowthReport
    encodings: GrowthReport
    deliveries: tuple[Delivery, ...]


def as_markdown(measured: Measurements) -> str:
    """The whole page."""
    sections = [
        _head(measured),
        _recorded(measured.recorded),
        _figure3(measured.figure3),
        _exact(measured.figure3),
        _figure5(measured.figure5),
        _scaling(measured.scaling),
        _growth(measured.backends, "Seconds of `robust region` with each back end (`robust bench backends`)."),
        _growth(measured.encodings, "Seconds of `robust envelope --method irr` (`robust bench encodings`)."),
    ]
    if measured.deliveries:
        sections.append(_deliveries(measured.deliveries))
    sections.append(_start(measured.help_seconds))
    return "\n\n".join(sections) + "\n"


def _head(measured: Measurements) -> str:
    machine = measured.machine
    packages = ", ".join(f"{name} {version}" for name, version in machine.packages.items())
    limit = "no limit" if measured.limit is None else f"a limit of {measured.limit:g} s each unless another is named"
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


def _figure3(report: Figure3Report) -> str:
    own = ", ".join(f"{name} {seconds:g} s" for name, seconds in report.own_limits.items())
    limit = "no limit" if report.limit is None else f"{report.limit:g} s"
    method = (
        "How many instances each method solves within which time [IRR Fig. 3] (`robust bench figure3`). Limits of "
        f"ours: {limit}{f'; {own}' if own else ''}. The optimal box is what the recorded CCMMZ runs computed."
    )
    parts = [_page("## Instances solved over time", method)]
    for domain in report.domains:
        rows = curve_rows(report, domain)
        parts.append(f"{domain}, {len(report.rows_of(domain))} instances:\n\n{_table(CURVE_HEADINGS, rows)}")
    return "\n\n".join(parts)


def _exact(report: Figure3Report) -> str:
    method = (
        "Exact widening, the exact region (`robust region --backend project`) and the optimal box (`robust envelope "
        "--method optimal`), from the same runs. Each box, ours and the recorded one of IRR, is checked to be inside "
        "the exact region where that was found in time; the recorded box is also proved inside without it. The "
        "recorded optimiser was stopped after 30 improvements, so that its box can be smaller."
    )
    table = _table(CHECK_HEADINGS, [check_row(row) for row in report.rows])
    return _page("## Exact methods", method, totals_text(report), table)


def _figure5(report: Figure5Report) -> str:
    method = (
        "Total width of the box as a share of the final one, after some steps of IRR with β = 1 [IRR Fig. 5] (`robust "
        "bench figure5`). A run that has ended counts as 100 %."
    )
    parts = [_page("## Convergence of IRR", method, *(f"{note[0].upper()}{note[1:]}." for note in report.notes))]
    for schedule in report.schedules:
        rows = step_rows(report, schedule)
        parts.append(f"{schedule.label.capitalize()}:\n\n{_table(STEP_HEADINGS, rows)}")
    return "\n\n".join(parts)


def _growth(report: GrowthReport, intro: str) -> str:
    parts = [_page(f"## {report.title}", intro, *(f"{note[0].upper()}{note[1:]}." for note in report.notes))]
    for ladder in report.ladders:
        table = _table(growth_headings(report, ladder), growth_rows(report, ladder))
        parts.append(f"{ladder.title}:\n\n{table}")
    return "\n\n".join(parts)


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
