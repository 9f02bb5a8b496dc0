"""The study of conversions as tables for a terminal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import median
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from robust.bench.removals import Kind, Removal
from robust.bench.tables import figure

if TYPE_CHECKING:
    from robust.bench.conversions import ConversionReport, ConversionRow


def conversion_tables(report: ConversionReport) -> list[Table]:
    """Plans by source, and bounds by what they are for."""
    return [_plans(report), _bounds(report)]


def _plans(report: ConversionReport) -> Table:
    table = Table(title="Converted plans", title_justify="left", caption_justify="left")
    table.add_column("")
    for source in report.sources:
        table.add_column(source.value, justify="right")
    facts: Sequence[tuple[str, Callable[[Sequence[ConversionRow]], str]]] = (
        ("plans", lambda rows: str(len(rows))),
        ("proved valid", lambda rows: str(sum(row.proved for row in rows))),
        ("allow the plan itself", lambda rows: str(sum(row.allowed for row in rows))),
        ("with a removable bound", lambda rows: str(sum(bool(row.removable) for row in rows))),
        ("with bounds that numbers need", lambda rows: str(sum(row.tightened > 0 for row in rows))),
        ("steps, median", lambda rows: figure(median(row.steps for row in rows), 0)),
        ("seconds to convert, median", lambda rows: figure(median(row.convert_s for row in rows))),
        ("seconds to convert, longest", lambda rows: figure(max(row.convert_s for row in rows))),
    )
    for label, fact in facts:
        table.add_row(label, *(fact(report.rows_of(source)) for source in report.sources))
    if report.failures:
        table.add_row("[red]failed[/red]", f"{len(report.failures)} in all")
    table.caption = escape("\n".join(report.notes))
    return table


def _bounds(report: ConversionReport) -> Table:
    table = Table(title="Bounds, removed one at a time", title_justify="left")
    table.add_column("what it is for")
    for column in ("bounds", *(removal.value for removal in Removal)):
        table.add_column(column, justify="right")
    for kind in Kind:
        numbers = [sum(row.count(kind, removal) for row in report.rows) for removal in Removal]
        if any(numbers):
            table.add_row(kind.value, *map(str, (sum(numbers), *numbers)))
    totals = [sum(row.count(kind, removal) for row in report.rows for kind in Kind) for removal in Removal]
    table.add_section()
    table.add_row("all", *map(str, (sum(totals), *totals)))
    return table
