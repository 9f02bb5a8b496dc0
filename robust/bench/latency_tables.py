"""The latency of executives as tables; the results page shares the cells."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from robust.bench.figure20b import PAPER_SHARE, REACTIVE, SWIFT, TIMEOUT
from robust.bench.tables import NOTHING, figure
from robust.bench.team_tables import quantile

if TYPE_CHECKING:
    from robust.bench.figure20b import LatencyReport

Cells = tuple[str, ...]

EXECUTED_HEADINGS = (
    "back end",
    "executed",
    "of",
    "succeeded",
    "out of time",
    "preparation, ms: median",
    "most",
    "slowest look ahead, ms",
)
STEP_HEADINGS = (
    "back end",
    "steps",
    "median step, ms",
    "slowest step of each execution, ms: median",
    "90 %",
    "most",
    f"under {SWIFT} s",
    f"up to {REACTIVE} s",
)


def executed_cells(report: LatencyReport, backend: str) -> Cells:
    """How many executions came to an end, and what was spent besides the steps."""
    runs = report.of(backend)
    ended = [run for run in runs if run.executed]
    prepared = sorted(run.preparation for run in ended if run.preparation is not None)
    ahead = max((seconds for run in ended for seconds in run.wakes), default=None)
    return (
        backend,
        str(len(ended)),
        str(len(runs)),
        str(sum(run.outcome == "succeeded" for run in ended)),
        str(sum(run.outcome == TIMEOUT for run in runs)),
        _milliseconds(median(prepared) if prepared else None),
        _milliseconds(prepared[-1] if prepared else None),
        _milliseconds(ahead),
    )


def step_cells(report: LatencyReport, backend: str) -> Cells:
    """Steps, and the slowest one of each execution [PIKE, Figure 20b]."""
    ended = [run for run in report.of(backend) if run.executed]
    steps = [seconds for run in ended for seconds in run.steps]
    slowest = sorted(run.slowest for run in ended if run.slowest is not None)
    return (
        backend,
        str(len(steps)),
        _milliseconds(median(steps) if steps else None),
        _milliseconds(median(slowest) if slowest else None),
        _milliseconds(quantile(slowest, 0.9)),
        _milliseconds(slowest[-1] if slowest else None),
        _share(sum(each < SWIFT for each in slowest), len(slowest)),
        _share(sum(each <= REACTIVE for each in slowest), len(slowest)),
    )


def notes(report: LatencyReport) -> list[str]:
    """What the tables are about."""
    found = [
        f"{report.problems} plans of seed {report.seed}: {len(report.admitting)} of {report.decided} decided ones "
        "admit a correct execution",
        f"limit {report.limit:g} s for each compilation and execution, {report.jobs} at a time",
        f"the paper: the slowest step took up to {REACTIVE} s in {PAPER_SHARE:.1%} of 75 executions",
    ]
    found += [f"different decisions: {difference}" for difference in report.differences]
    found += [f"{run.instance}, {run.backend}: {run.message}" for run in report.executions if run.message is not None]
    if not report.complete:
        found.append("interrupted: not all executions were measured")
    return found


def latency_tables(report: LatencyReport) -> list[Table]:
    """Executions and preparation, then steps."""
    first = _table("Executions of random plans with choices", EXECUTED_HEADINGS)
    steps = _table("Latency of their steps", STEP_HEADINGS)
    for backend in report.backends:
        first.add_row(*map(escape, executed_cells(report, backend)))
        steps.add_row(*map(escape, step_cells(report, backend)))
    steps.caption = "\n".join(notes(report))
    return [first, steps]


def _milliseconds(seconds: float | None) -> str:
    return figure(None if seconds is None else seconds * 1000, 1)


def _share(count: int, total: int) -> str:
    return f"{count} ({count / total:.1%})" if total else NOTHING


def _table(title: str, headings: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left", caption_justify="left")
    for place, heading in enumerate(headings):
        table.add_column(heading, justify="left" if place == 0 else "right", no_wrap=place == 0)
    return table
