"""The reports as tables for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:
    from robust.bench.recorded import RecordedReport, RecordedRow
    from robust.bench.scaling import ScalingReport

NOTHING = "–"


def figure(value: float | None, digits: int = 2) -> str:
    """A number, or a dash where there is none; large ones without decimals."""
    if value is None:
        return NOTHING
    return f"{value:.0f}" if digits == 0 or abs(value) >= 1000 else f"{value:.{digits}f}"


def count(value: int | None) -> str:
    return NOTHING if value is None else str(value)


def recorded_tables(report: RecordedReport) -> list[Table]:
    """Ours beside the recorded runs, and totals."""
    table = Table(title="Ours / recorded IRR / recorded CCMMZ", title_justify="left", caption_justify="left")
    table.caption = "\n".join(report.notes)
    table.add_column("instance", no_wrap=True)
    table.add_column("seconds", justify="right")
    table.add_column("first widening", justify="right")
    table.add_column("checks", justify="right")
    table.add_column("MiB", justify="right")
    table.add_column("box and checks", overflow="fold")
    for row in report.rows:
        style = {True: "green", False: "red", None: "yellow"}[row.agrees]
        table.add_row(*map(escape, recorded_cells(row)), f"[{style}]{escape(row.verdict)}[/{style}]")
    return [table, _totals(report)]


def recorded_cells(row: RecordedRow) -> tuple[str, str, str, str, str]:
    """Name, seconds, first widening, checks and memory of one instance: ours / recorded IRR / recorded CCMMZ."""
    ours, irr, ccmmz = row.ours, row.instance.irr, row.instance.ccmmz
    recorded = [(run.wall_s if run.solved else None, run.status) if run else (None, NOTHING) for run in (irr, ccmmz)]
    seconds = [figure(value) if value is not None else status for value, status in recorded]
    memory = [figure(run.memory_mb if run else None, 0) for run in (irr, ccmmz)]
    return (
        row.instance.name,
        " / ".join([figure(ours.seconds), *seconds]),
        f"{figure(ours.first_widening_wall_s)} / {figure(irr.first_widening_s if irr else None)}",
        f"{count(ours.checks)} / {count(irr.checks if irr else None)}",
        " / ".join([figure(ours.memory_mb, 0), *memory]),
    )


def _totals(report: RecordedReport) -> Table:
    totals = report.totals
    solved = totals["solved"]
    table = Table(title="Totals", title_justify="left", show_header=False)
    table.add_column()
    table.add_column()
    table.add_row("instances run", f"{totals['run']} of {totals['instances']}")
    table.add_row("agreeing in box and checks", f"{totals['agreeing']} of {totals['compared']} with a recorded box")
    table.add_row("solved", f"ours {solved['ours']}, recorded IRR {solved['irr']}, recorded CCMMZ {solved['ccmmz']}")
    table.add_row("out of time, errors", f"{totals['timeouts']}, {totals['errors']}")
    table.add_row(
        f"seconds for {totals['seconds']['instances']} solved by both",
        f"ours {figure(totals['seconds']['ours'])} (processor {figure(totals['seconds']['ours_cpu'])}), "
        f"recorded IRR {figure(totals['seconds']['irr'])}",
    )
    table.add_row("greatest memory", f"ours {figure(totals['memory_mb']['ours'], 0)} MiB")
    return table


def scaling_tables(report: ScalingReport) -> list[Table]:
    """One table for each series."""
    tables = []
    for series in report.series:
        table = Table(title=series.title, title_justify="left", caption_justify="left")
        for heading in ("refuels", "parameters", "seconds", "search", "checks", "queries", "MiB"):
            table.add_column(heading, justify="right")
        table.add_column("status", overflow="fold")
        for row in report.rows_of(series):
            run = row.ours
            table.add_row(
                str(row.refuels),
                str(row.parameters),
                figure(run.seconds),
                figure(run.search_s),
                count(run.checks),
                count(run.queries),
                figure(run.memory_mb, 0),
                escape(run.text),
            )
        tables.append(table)
    tables[-1].caption = "\n".join(report.notes)
    return tables
