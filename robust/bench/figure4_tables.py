"""The scaling experiment in the delivery domain as tables for a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from robust.bench.run import Outcome
from robust.bench.tables import NOTHING, figure

if TYPE_CHECKING:
    from robust.bench.figure4 import Figure4Report, Figure4Row

_MARKS = (1.0, 2.0, 5.0, 10.0, 60.0, 3600.0)


def figure4_tables(report: Figure4Report) -> list[Table]:
    """Times of every plan, how many each method solves, and controllability."""
    return [_times(report), _solved(report), _controllability(report)]


def _times(report: Figure4Report) -> Table:
    table = Table(title="Seconds by plan", title_justify="left", caption_justify="left")
    table.caption = escape("\n".join(report.notes))
    table.add_column("plan", no_wrap=True)
    table.add_column("parameters", justify="right")
    for contender in report.contenders:
        table.add_column(contender.name, justify="right")
    table.add_column("unbounded + capped", justify="right")
    for origin in report.origins:
        for row in report.rows_of(origin):
            cells = [_time(row, contender.name) for contender in report.contenders]
            table.add_row(row.instance.name, str(row.instance.parameters), *cells, _unbounded(row))
        table.add_section()
    return table


def _time(row: Figure4Row, method: str) -> str:
    outcome = row.outcome(method)
    if outcome is None:
        return NOTHING
    return figure(row.seconds(method)) if outcome is Outcome.COMPLETE else outcome.value


def _unbounded(row: Figure4Row) -> str:
    """Directions in which the widened box has no end, and those that only the domain's own number ends, of how many."""
    run = row.runs.get("widen")
    if run is None or run["box"] is None:
        return NOTHING
    return f"{len(run['unbounded'])} + {len(run['capped'])} of {2 * len(run['box'])}"


def _solved(report: Figure4Report) -> Table:
    table = Table(title="Plans solved within", title_justify="left")
    table.add_column("plans")
    table.add_column("method")
    limits = [limit for limit in (report.limit, report.baseline_limit) if limit is not None]
    marks = [mark for mark in _MARKS if not limits or mark <= max(limits)]
    for mark in marks:
        table.add_column(f"{mark:g} s", justify="right")
    table.add_column("longest", justify="right")
    for origin in report.origins:
        rows = report.rows_of(origin)
        for contender in report.contenders:
            times = [time for row in rows if (time := row.seconds(contender.name)) is not None]
            counts = [str(sum(time <= mark for time in times)) for mark in marks]
            longest = figure(max(times, default=None))
            table.add_row(f"{origin.value}: {len(rows)}", contender.label, *counts, longest)
        table.add_section()
    return table


def _controllability(report: Figure4Report) -> Table:
    table = Table(title="Controllability of the widened box", title_justify="left")
    for column in ("plan", "parameters", "dynamically", "strongly", "width kept", "faces bounded"):
        table.add_column(column, justify="left" if column == "plan" else "right")
    for row in report.rows:
        found = row.controllability
        if found is not None:
            table.add_row(row.instance.name, str(row.instance.parameters), *_cells(found))
    return table


def _cells(found: Mapping[str, Any]) -> tuple[str, str, str, str]:
    kept = NOTHING if found["kept"] is None else f"{100 * found['kept']:.1f} %"
    bounded = NOTHING if found["bounded"] is None else str(found["bounded"])
    return found["dynamic"] or found["status"], found["strong"] or NOTHING, kept, bounded
