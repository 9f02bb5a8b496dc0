"""The comparisons of methods, back ends and encodings as tables; the results page shares the cells."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from robust.bench.contenders import IRR, OPTIMAL, WIDEN
from robust.bench.figure3 import MARKS
from robust.bench.run import Outcome
from robust.bench.tables import NOTHING, figure

if TYPE_CHECKING:
    from robust.bench.contenders import Run
    from robust.bench.figure3 import Figure3Report, Figure3Row
    from robust.bench.figure5 import Figure5Report, Schedule
    from robust.bench.growth import GrowthReport, GrowthRow, Ladder
    from robust.bench.suite import RecordedRun

Cells = tuple[str, ...]


def run_cell(run: Run | None) -> str:
    """Seconds of a complete run, else how it ended."""
    if run is None:
        return NOTHING
    return figure(run.seconds) if run.outcome is Outcome.COMPLETE else _ENDED.get(run.outcome, run.outcome.value)


_ENDED = {Outcome.TIMEOUT: "out of time"}


def recorded_cell(run: RecordedRun | None) -> str:
    if run is None:
        return NOTHING
    return figure(run.wall_s) if run.solved else run.status


def width_cell(width: Fraction | None) -> str:
    return NOTHING if width is None else f"{float(width):.10g}"


# -- figure 3 ----------------------------------------------------------------------------------------------------------

CURVE_HEADINGS = ("method", *(f"{mark:g} s" for mark in MARKS), "slowest solved, s")
CHECK_HEADINGS = (
    "instance",
    "widening, s",
    "region, s",
    "optimal, s",
    "CCMMZ recorded, s",
    "recorded IRR box proved",
    "IRR box, recorded / ours, in region",
    "widening / optimal in region",
    "total width, optimal / recorded CCMMZ",
    "widths",
)


def curve_rows(report: Figure3Report, domain: str) -> list[Cells]:
    """For each method of a domain, how many instances are solved within which time."""
    return [
        (
            curve.label,
            *(str(curve.solved_within(mark)) for mark in MARKS),
            figure(curve.times[-1] if curve.times else None),
        )
        for curve in report.curves(domain)
    ]


def check_row(row: Figure3Row) -> Cells:
    """Times of the exact methods on an instance, and what was checked about their answers."""
    checks = row.checks
    optimal = width_cell(checks.optimal_width)
    return (
        row.instance.name,
        run_cell(row.runs.get(WIDEN.name)),
        run_cell(row.runs.get("project")),
        run_cell(row.runs.get(OPTIMAL.name)),
        recorded_cell(row.instance.ccmmz),
        _yes(checks.recorded_proved),
        f"{_yes(checks.recorded_inside)} / {_yes(checks.irr_inside)}",
        f"{_yes(checks.widening_inside)} / {_yes(checks.optimal_inside)}",
        f"{optimal} / {width_cell(checks.recorded_width)}",
        NOTHING if checks.widths is None else checks.widths.value,
    )


def totals_text(report: Figure3Report) -> str:
    """The checks in a sentence."""
    totals = report.totals
    parts = [
        f"{called}: {totals[key]['holds']} of {totals[key]['of']}"
        for key, called in (
            ("recorded_box_proved", "Recorded IRR boxes proved inside the envelope by `robust check`"),
            ("recorded_box_in_region", "recorded IRR boxes inside the exact region"),
            ("irr_in_region", "our IRR boxes inside it"),
            ("widening_in_region", "boxes of exact widening inside it"),
            ("optimal_in_region", "optimal boxes inside it"),
        )
    ]
    widths = ", ".join(f"{number} {kind}" for kind, number in totals["widths"].items())
    return f"{'; '.join(parts)}. Total widths of the recorded CCMMZ boxes beside the optimal ones: {widths}."


def figure3_tables(report: Figure3Report) -> list[Table]:
    """One table for each domain, and the checks."""
    tables = []
    for domain in report.domains:
        title = f"{domain}: solved within, of {len(report.rows_of(domain))}"
        tables.append(_table(title, CURVE_HEADINGS, curve_rows(report, domain)))
    if any(contender.verb == "region" or contender.name != IRR.name for contender in report.contenders):
        tables.append(_table("Exact methods", CHECK_HEADINGS, [check_row(row) for row in report.rows]))
    if tables:
        tables[-1].caption = escape("\n".join([totals_text(report), *report.notes]))
    return tables


def _yes(answer: bool | None) -> str:
    return NOTHING if answer is None else "yes" if answer else "NO"


# -- figure 5 ----------------------------------------------------------------------------------------------------------

STEP_HEADINGS = ("steps", "poorest", "best", "runs still going on")


def step_rows(report: Figure5Report, schedule: Schedule) -> list[Cells]:
    """Poorest and best convergence after some steps."""
    return [
        (str(one.step), f"{one.poorest:.1%}", f"{one.best:.1%}", str(one.running)) for one in report.summary(schedule)
    ]


def figure5_tables(report: Figure5Report) -> list[Table]:
    """One table for each schedule."""
    tables = [
        _table(f"Convergence, {schedule.label}", STEP_HEADINGS, step_rows(report, schedule))
        for schedule in report.schedules
    ]
    if tables:
        tables[-1].caption = escape("\n".join(report.notes))
    return tables


# -- growth ------------------------------------------------------------------------------------------------------------


def growth_headings(report: GrowthReport, ladder: Ladder) -> Cells:
    return (ladder.axis, *(contender.name for contender in report.contenders))


def growth_rows(report: GrowthReport, ladder: Ladder) -> list[Cells]:
    """For each size, the seconds of each alternative; sizes that nothing was run on are left out."""
    found = [[report.row(ladder, contender, size) for contender in report.contenders] for size in ladder.sizes]
    return [
        (str(size), *(_growth_cell(row) for row in rows))
        for size, rows in zip(ladder.sizes, found, strict=True)
        if any(row is not None and row.run is not None for row in rows)
    ]


def growth_tables(report: GrowthReport) -> list[Table]:
    """One table for each series."""
    tables = [_table(one.title, growth_headings(report, one), growth_rows(report, one)) for one in report.ladders]
    if tables:
        tables[-1].caption = escape("\n".join(report.notes))
    return tables


def _growth_cell(row: GrowthRow | None) -> str:
    return NOTHING if row is None else run_cell(row.run)


def _table(title: str, headings: Sequence[str], rows: Sequence[Cells]) -> Table:
    table = Table(title=escape(title), title_justify="left", caption_justify="left")
    for index, heading in enumerate(headings):
        table.add_column(escape(heading), justify="right" if index else "left", overflow="fold")
    for row in rows:
        table.add_row(*map(escape, row))
    return table
