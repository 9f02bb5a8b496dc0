"""Compilation of plans with choices as tables; the results page shares the cells."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import mean, median
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from robust.bench.tables import figure
from robust.bench.team_plans import STAGES

if TYPE_CHECKING:
    from robust.bench.team_plans import TeamContender, TeamReport, TeamRun

Cells = tuple[str, ...]

SOLVED_HEADINGS = ("back end", "solved", "of", "median, s", "90 %, s", "slowest, s", "out of time", "greatest MiB")
STAGE_HEADINGS = ("back end", *(f"{stage}, s" for stage in STAGES), "search, s")
SIZE_HEADINGS = ("candidate subplans", "plans", "solved", "median, s", "slowest, s")
IMPLICANT_HEADINGS = ("models", "plans", "implicants, median", "implicants, most", "greatest share of models")


def solved_cells(report: TeamReport, contender: TeamContender) -> Cells:
    """One contender over all plans: how many it decided, and the seconds of whole processes that did."""
    runs = report.of(contender)
    times = sorted(run.seconds for run in runs if run.solved)
    late = sum(1 for run in runs if not run.solved)
    return (
        contender.name,
        str(len(times)),
        str(len(runs)),
        figure(median(times) if times else None),
        figure(quantile(times, 0.9)),
        figure(times[-1] if times else None),
        str(late),
        figure(max((run.memory_mb for run in runs), default=None), 0),
    )


def stage_cells(report: TeamReport, contender: TeamContender) -> Cells:
    """Mean seconds of each stage, over the runs that finished."""
    runs = [run for run in report.of(contender) if run.solved]
    return (contender.name, *(figure(_mean(runs, stage), 3) for stage in (*STAGES, "search")))


def size_cells(report: TeamReport, contender: TeamContender) -> list[Cells]:
    """By orders of magnitude of the number of candidate subplans [PIKE, Figure 20a]."""
    rows: list[Cells] = []
    largest = max(report.subplans.values(), default=1)
    low = 1
    while low <= largest:
        runs = [run for run in report.of(contender) if low <= report.subplans[run.instance] < low * 10]
        if runs:
            times = sorted(run.seconds for run in runs if run.solved)
            rows.append(
                (
                    f"{low:,} to {low * 10 - 1:,}",
                    str(len(runs)),
                    str(len(times)),
                    figure(median(times) if times else None),
                    figure(times[-1] if times else None),
                )
            )
        low *= 10
    return rows


def implicant_cells(report: TeamReport) -> list[Cells]:
    """Prime implicants by orders of magnitude of the number of models [PIKE, Figure 21]."""
    found = compact_runs(report)
    rows: list[Cells] = []
    low = 1
    while found and low <= max(run.models or 0 for run in found):
        here = [run for run in found if low <= (run.models or 0) < low * 10]
        if here:
            sizes = [run.prime_implicants or 0 for run in here]
            share = max((run.prime_implicants or 0) / (run.models or 1) for run in here)
            most = str(max(sizes))
            rows.append(
                (
                    f"{low:.0e}".replace("e+0", "e").replace("e+", "e"),
                    str(len(here)),
                    f"{median(sizes):g}",
                    most,
                    f"{share:.2g}",
                )
            )
        low *= 10
    return rows


def compact_runs(report: TeamReport) -> list[TeamRun]:
    """Runs that counted both prime implicants and models of a plan that admits a correct execution, once per plan."""
    found = {
        run.instance: run
        for run in reversed(report.runs)
        if run.prime_implicants is not None and run.models and run.satisfiable
    }
    return list(found.values())


def notes(report: TeamReport) -> tuple[str, ...]:
    """What a reader of the figures has to know."""
    plans = len(report.activities)
    verdicts = [report.verdict(name) for name in report.activities]
    decided = sum(verdict is not None for verdict in verdicts)
    lines = [
        f"{plans} plans of seed {report.seed}: {mean(report.activities.values()):.1f} activities on average, "
        f"{max(report.activities.values())} at most; "
        f"{verdicts.count(True)} of {decided} decided ones admit a correct execution",
        f"seconds of whole processes on this machine, stopped at {report.limit:g} s",
    ]
    if report.contradicted:
        lines.append(f"contradicting answers: {', '.join(report.contradicted)}")
    failures = dict.fromkeys(f"{run.contender}, {run.instance}: {run.message}" for run in report.runs if run.message)
    lines += list(failures)[:5]
    if report.jobs > 1:
        lines.append(f"{report.jobs} processes ran at a time and disturbed each other's timings")
    if not report.complete:
        lines.append("incomplete: interrupted")
    return tuple(lines)


def figure20a_tables(report: TeamReport) -> list[Table]:
    """Who decided how many plans in what time; stages; and time over candidate subplans."""
    first = _table("Compilation of random plans with choices", SOLVED_HEADINGS)
    stages = _table("Mean seconds by stage, of runs that finished", STAGE_HEADINGS)
    for contender in report.contenders:
        first.add_row(*map(escape, solved_cells(report, contender)))
        stages.add_row(*map(escape, stage_cells(report, contender)))
    tables = [first, stages]
    for contender in report.contenders:
        sizes = _table(f"{contender.name}: time over candidate subplans", SIZE_HEADINGS)
        for cells in size_cells(report, contender):
            sizes.add_row(*map(escape, cells))
        tables.append(sizes)
    tables[-1].caption = "\n".join(notes(report))
    return tables


def figure21_tables(report: TeamReport) -> list[Table]:
    """Prime implicants beside models."""
    table = _table("Prime implicants and models of plans that admit a correct execution", IMPLICANT_HEADINGS)
    for cells in implicant_cells(report):
        table.add_row(*map(escape, cells))
    more = sum((run.prime_implicants or 0) > (run.models or 0) for run in compact_runs(report))
    table.caption = "\n".join((*notes(report), f"more implicants than models: {more} plans"))
    return [table]


def quantile(values: Sequence[float], share: float) -> float | None:
    """The least of the ascending values that at least that share of them does not exceed."""
    return values[min(len(values) - 1, int(share * len(values)))] if values else None


def _mean(runs: Sequence[TeamRun], stage: str) -> float | None:
    found = [run.stages[stage] for run in runs if stage in run.stages]
    return mean(found) if found else None


def _table(title: str, headings: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left", caption_justify="left")
    for place, heading in enumerate(headings):
        table.add_column(heading, justify="left" if place == 0 else "right", no_wrap=place == 0)
    return table
