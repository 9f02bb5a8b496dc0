"""PIKE and Kirk on the k-intents domain as tables; the results page shares the cells."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from robust.bench.k_intents import PAPER
from robust.bench.tables import NOTHING, figure

if TYPE_CHECKING:
    from robust.bench.execution_statistics import Mean
    from robust.bench.k_intents import KIntentsReport
    from robust.bench.line_fit import LineFit

Cells = tuple[str, ...]

REPLAN_HEADINGS = ("human choices", "problems", "Kirk's re-plans", "95 %", "most", "expected", "PIKE's re-plans")
TIME_HEADINGS = ("human choices", "problems", "PIKE", "Kirk", "saved, %", "95 %", "least", "most", "PIKE, s", "Kirk, s")
IMPROVEMENT_HEADINGS = ("saved by PIKE", "mean, %", "95 %", "paper, %")


def replan_cells(report: KIntentsReport) -> list[Cells]:
    """Re-plans by the number of uncontrollable choices [PIKE, Figure 17]."""
    rows: list[Cells] = []
    for count in report.choices:
        runs = report.with_choices(count)
        mean = report.mean(lambda run: run.kirk.replans, count)
        rows.append(
            (
                str(count),
                str(len(runs)),
                figure(None if mean is None else mean.value),
                _interval(mean),
                str(max(run.kirk.replans for run in runs)),
                figure(float(sum(run.wrong_guesses for run in runs) / len(runs))),
                str(sum(run.pike.replans for run in runs)),
            )
        )
    return rows


def time_cells(report: KIntentsReport) -> list[Cells]:
    """Mean times to completion by the number of uncontrollable choices [PIKE, Figure 18]."""
    rows: list[Cells] = []
    for count in report.choices:
        runs = report.with_choices(count)
        saved = [run.improvement * 100 for run in runs]
        rows.append(
            (
                str(count),
                str(len(runs)),
                figure(fmean(float(run.pike.time) for run in runs)),
                figure(fmean(float(run.kirk.time) for run in runs)),
                figure(fmean(saved), 1),
                _percentages(report.mean(lambda run: run.improvement, count)),
                figure(min(saved), 1),
                figure(max(saved), 1),
                figure(fmean(run.pike.seconds for run in runs), 3),
                figure(fmean(run.kirk.seconds for run in runs), 3),
            )
        )
    return rows


def improvement_cells(report: KIntentsReport) -> list[Cells]:
    """What PIKE saves, beside the paper's figures, which include its implementation's computing."""
    paper, free = (figure(PAPER[name] * 100, 1) for name in ("improvement", "free_recovery"))
    rows = (
        ("of Kirk's time", report.mean(lambda run: run.improvement), paper),
        ("difference as a share of PIKE's time", report.mean(lambda run: run.improvement_over_pike), NOTHING),
        ("of Kirk's time, with computing", report.mean(lambda run: run.computed_improvement), paper),
        ("the same, recovery taking no time", report.mean(lambda run: run.free_improvement), free),
    )
    return [
        (name, figure(None if mean is None else mean.value * 100, 1), _percentages(mean), printed)
        for name, mean, printed in rows
    ]


def fit_text(fit: LineFit | None) -> str:
    """Slope with its interval, intercept and R²."""
    if fit is None:
        return "no line: all problems have the same number of human choices"
    interval = "" if fit.interval is None else f" ({fit.interval[0]:.3f} to {fit.interval[1]:.3f})"
    return (
        f"{fit.slope:.3f}{interval} more with each human choice, {fit.intercept:.2f} for none; R² {fit.r_squared:.3f}"
    )


def notes(report: KIntentsReport) -> tuple[str, ...]:
    """What a reader of the figures has to know."""
    late = sum("timeout" in {run.pike.outcome, run.kirk.outcome} for run in report.runs)
    lines = [
        f"{len(report.runs)} problems of seed {report.seed}, up to {report.largest} intents; reasoner "
        f"{report.reasoner}; the same choices and durations for both",
        f"PIKE: {report.pike_failures} failures or re-plans in {len(report.runs)} executions",
    ]
    lost = sum(run.kirk.outcome not in {"succeeded", "timeout"} for run in report.runs)
    if lost:
        lines.append(f"Kirk: {lost} executions did not succeed")
    if late:
        lines.append(f"out of time: {late} problems")
    if report.jobs > 1:
        lines.append(f"{report.jobs} processes ran at a time and disturbed each other's timings")
    return (*lines, *report.notes)


def figure17_tables(report: KIntentsReport) -> list[Table]:
    """Re-plans over the number of human choices, and the line through them."""
    table = _table("Re-plans on the k-intents domain", REPLAN_HEADINGS, replan_cells(report))
    table.caption = "\n".join(
        map(
            escape,
            (
                *notes(report),
                f"re-plans, by problems: {fit_text(report.fit)}",
                f"re-plans, by means: {fit_text(report.fit_of_means)}",
            ),
        )
    )
    return [table]


def figure18_tables(report: KIntentsReport) -> list[Table]:
    """Times to completion, and what PIKE saves."""
    times = _table("Time to completion on the k-intents domain", TIME_HEADINGS, time_cells(report))
    saved = _table("Improvement, mean of all problems", IMPROVEMENT_HEADINGS, improvement_cells(report))
    totals = None if report.totals is None else report.totals * 100
    saved.caption = "\n".join(
        map(escape, (*notes(report), f"of the sum of all of Kirk's times PIKE saves {figure(totals, 1)} %"))
    )
    return [times, saved]


def _interval(mean: Mean | None) -> str:
    return NOTHING if mean is None or mean.interval is None else f"{mean.interval[0]:.2f} to {mean.interval[1]:.2f}"


def _percentages(mean: Mean | None) -> str:
    if mean is None or mean.interval is None:
        return NOTHING
    return f"{mean.interval[0] * 100:.1f} to {mean.interval[1] * 100:.1f}"


def _table(title: str, headings: Sequence[str], rows: Sequence[Cells]) -> Table:
    table = Table(title=title, title_justify="left", caption_justify="left")
    for place, heading in enumerate(headings):
        table.add_column(heading, justify="left" if place == 0 else "right", no_wrap=place == 0)
    for row in rows:
        table.add_row(*map(escape, row))
    return table
