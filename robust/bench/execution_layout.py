"""Tables 1 and 2 for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from robust.bench.tables import NOTHING, figure

if TYPE_CHECKING:
    from robust.bench.execution_tables import Cell, ExecutionReport


def execution_tables(report: ExecutionReport) -> list[Table]:
    """In the paper's form: ours with intervals, and the paper's; then DREEX against each other executor."""
    return [_coverage(report), _pairs(report)]


def _coverage(report: ExecutionReport) -> Table:
    design = report.design
    title = f"Table {design.number}, {design.title}: coverage [95 %] and re-plans, ours / the paper's"
    table = Table(title=title, title_justify="left", caption_justify="left")
    table.caption = escape("\n".join(report.notes))
    table.add_column("executor", no_wrap=True)
    for column in design.columns:
        table.add_column(column, justify="right")
    for executor in report.executors:
        cells = [report.cell(executor, column) for column in design.columns]
        table.add_row(label(executor), *(_cell(cell) for cell in cells))
    return table


def _cell(cell: Cell | None) -> str:
    if cell is None:
        return NOTHING
    lower, upper = (round(100 * end) for end in cell.coverage.interval())
    ours = f"{100 * float(cell.coverage.share):.1f} % [{lower}–{upper}]"
    replans = figure(None if cell.replans is None else cell.replans.value)
    return f"{ours} / {cell.paper.coverage:.1f} %\n{replans} / {figure(cell.paper.replans, 1)}"


def _pairs(report: ExecutionReport) -> Table:
    table = Table(title="Cases that only DREEX solves : only the other, p", title_justify="left")
    table.add_column("against", no_wrap=True)
    for column in report.design.columns:
        table.add_column(column, justify="right")
    for executor in report.executors[1:]:
        cells = [report.cell(executor, column) for column in report.design.columns]
        table.add_row(label(executor), *(_pair(cell) for cell in cells))
    return table


def _pair(cell: Cell | None) -> str:
    if cell is None or cell.against is None:
        return NOTHING
    p = float(cell.against.p_value)
    return f"{cell.against.first} : {cell.against.second}, {'< 0.0001' if p < 0.0001 else f'{p:.4f}'}"


def label(executor: str) -> str:
    """As the paper writes it: DREEX, BLEX(30)."""
    name, _, share = executor.partition(":")
    return f"{name.upper()}({share})" if share else name.upper()
