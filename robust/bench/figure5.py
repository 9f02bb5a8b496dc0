"""`robust bench figure5`: how quickly IRR converges, in steps [IRR Fig. 5].

The convergence at a step is the total width of the box after that many rectangles were tried, as a share of that of the
final box. A run that has ended counts as 1 from then on. Every instance is run in two schedules: the recorded one
(doubling, in the recorded order of turns) and the default one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.bench.batch import Progress, run_batch
from robust.bench.contenders import IRR
from robust.bench.figure3 import LIMIT, order_options
from robust.bench.options import check_limit, plotting
from robust.bench.process import Processes
from robust.bench.run import EnvelopeRun, Outcome, run_envelope
from robust.bench.suite import RecordedInstance, read_suite

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "robust/bench-figure5/1"
STEPS = (1, 5, 10, 20, 50, 100, 200)
CLAIM_STEP = 50
CLAIM_SHARE = 0.7
CLAIM = "within 50 steps more than 70 % of the final total width in all cases"


@dataclass(frozen=True, slots=True)
class Schedule:
    """A schedule of IRR; `recorded_order` adds the data set's order of turns."""

    name: str
    label: str
    options: tuple[str, ...]
    recorded_order: bool


SCHEDULES = (
    Schedule("doubling", "doubling, recorded order", IRR.options, recorded_order=True),
    Schedule("default", "default schedule", ("--method", "irr", "--beta", "1"), recorded_order=False),
)


@dataclass(frozen=True, slots=True)
class Figure5Row:
    """One instance in one schedule."""

    instance: str
    schedule: str
    run: EnvelopeRun

    @property
    def converges(self) -> bool:
        """Whether there is a convergence: the run is complete, and its final width neither zero nor infinite."""
        return self.run.outcome is Outcome.COMPLETE and bool(self.run.convergence)

    @property
    def steps(self) -> int:
        return self.run.convergence[-1][0] if self.run.convergence else 0

    def share_at(self, step: int) -> float:
        """The convergence after a step; 1 after the last one."""
        if step >= self.steps:
            return 1.0
        return max((share for check, share in self.run.convergence if check <= step), default=0.0)

    def as_dict(self) -> dict[str, Any]:
        return {
            "instance": self.instance,
            "schedule": self.schedule,
            "status": self.run.outcome.value,
            "seconds": round(self.run.seconds, 4),
            "checks": self.run.checks,
            "message": self.run.message,
            "convergence": [[check, share] for check, share in self.run.convergence] if self.converges else None,
        }


@dataclass(frozen=True, slots=True)
class StepSummary:
    """The poorest and the best run after a step, and how many were still going on."""

    step: int
    poorest: float
    best: float
    running: int


@dataclass(frozen=True)
class Figure5Report:
    """All rows in the order of the data set; `complete` is false where Ctrl-C came before the last run."""

    suite: Path
    instances: int
    schedules: tuple[Schedule, ...]
    rows: tuple[Figure5Row, ...]
    complete: bool
    limit: float | None
    jobs: int

    def rows_of(self, schedule: Schedule) -> tuple[Figure5Row, ...]:
        """The runs of a schedule that have a convergence."""
        return tuple(row for row in self.rows if row.schedule == schedule.name and row.converges)

    def left_out(self, schedule: Schedule) -> tuple[Figure5Row, ...]:
        """The runs of a schedule that have none."""
        return tuple(row for row in self.rows if row.schedule == schedule.name and not row.converges)

    def summary(self, schedule: Schedule, steps: Sequence[int] = STEPS) -> tuple[StepSummary, ...]:
        """The poorest and the best convergence after each of the steps; empty without a run."""
        rows = self.rows_of(schedule)
        if not rows:
            return ()
        return tuple(_summary(rows, step) for step in steps)

    def claim_holds(self, schedule: Schedule) -> bool | None:
        """Whether the paper's observation can be made here too; None without a run."""
        rows = self.rows_of(schedule)
        return all(row.share_at(CLAIM_STEP) > CLAIM_SHARE for row in rows) if rows else None

    @property
    def agrees(self) -> bool:
        """Whether every run was made and none failed; the paper's observation is reported, not required."""
        failures = {Outcome.ERROR, Outcome.INVALID}
        return self.complete and all(row.run.outcome not in failures for row in self.rows)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures has to know."""
        notes = [self.verdict(schedule) for schedule in self.schedules]
        for schedule in self.schedules:
            left_out = ", ".join(f"{row.instance} ({_why(row)})" for row in self.left_out(schedule))
            if left_out:
                notes.append(f"{schedule.label}, left out: {left_out}")
        if not self.complete:
            runs = self.instances * len(self.schedules)
            notes.append(f"incomplete: interrupted after {len(self.rows)} of {runs} runs")
        return tuple(notes)

    def verdict(self, schedule: Schedule) -> str:
        """One line about the paper's observation, for people."""
        holds = self.claim_holds(schedule)
        if holds is None:
            return f"{schedule.label}: no run to judge by"
        rows = self.rows_of(schedule)
        poorest = min(rows, key=lambda row: row.share_at(CLAIM_STEP))
        return (
            f"{schedule.label}: {CLAIM} {'holds' if holds else 'does not hold'} for {len(rows)} runs; "
            f"the poorest is {poorest.instance} with {poorest.share_at(CLAIM_STEP):.1%}"
        )

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; shares between 0 and 1."""
        return {
            "schema": SCHEMA,
            "suite": str(self.suite),
            "complete": self.complete,
            "agrees": self.agrees,
            "limit_s": self.limit,
            "jobs": self.jobs,
            "notes": list(self.notes),
            "schedules": [
                {
                    "schedule": schedule.name,
                    "runs": len(self.rows_of(schedule)),
                    "claim_holds": self.claim_holds(schedule),
                    "steps": [
                        {"step": one.step, "poorest": one.poorest, "best": one.best, "running": one.running}
                        for one in self.summary(schedule)
                    ],
                }
                for schedule in self.schedules
            ],
            "rows": [row.as_dict() for row in self.rows],
        }

    def tables(self) -> list[Table]:
        """One table for each schedule."""
        from robust.bench.figure_tables import figure5_tables  # noqa: PLC0415 - rich only when something is shown

        return figure5_tables(self)


def run_figure5(
    suite: Path,
    *,
    jobs: int = 1,
    limit: float | None = LIMIT,
    plot: Path | None = None,
    on_result: Progress | None = None,
    schedules: Sequence[Schedule] = SCHEDULES,
) -> Figure5Report:
    """Run IRR with β = 1 on every instance of a data set in every schedule.

    Args:
        suite: the directory of the data set, see :mod:`robust.bench.suite`.
        jobs: processes at a time; steps do not depend on it.
        limit: seconds after which a run is killed; None never.
        plot: where to draw the figure (SVG, PNG or PDF by suffix).
        on_result: called after each run with the number done, their total and a line about the run.
        schedules: which schedules.

    Returns:
        A report; Ctrl-C ends the running processes and returns what is there, marked incomplete.

    Raises:
        InputError: wrong options, or a data set that is missing or malformed.
    """
    check_limit(limit)
    figures = plotting(plot, "robust.bench.figures")
    instances = read_suite(suite)
    points = [(instance, schedule) for schedule in schedules for instance in instances]
    batch = run_batch(len(points), partial(_run, points, limit), jobs=jobs, describe=_describe, on_result=on_result)
    report = Figure5Report(suite, len(instances), tuple(schedules), batch.results, batch.complete, limit, jobs)
    if figures is not None and plot is not None and report.rows:
        figures.plot_figure5(report, plot)
    return report


def _run(
    points: Sequence[tuple[RecordedInstance, Schedule]], limit: float | None, processes: Processes, index: int
) -> Figure5Row:
    instance, schedule = points[index]
    options = [*schedule.options, *(order_options(instance) if schedule.recorded_order else ())]
    return Figure5Row(instance.name, schedule.name, run_envelope(processes, instance.files, options, limit=limit))


def _summary(rows: Sequence[Figure5Row], step: int) -> StepSummary:
    shares = [row.share_at(step) for row in rows]
    return StepSummary(step, min(shares), max(shares), sum(row.steps > step for row in rows))


def _describe(row: Figure5Row) -> str:
    return f"{row.instance}, {row.schedule}: {row.run.text}, {row.steps} steps, {row.run.seconds:.2f} s"


def _why(row: Figure5Row) -> str:
    return "zero or infinite width" if row.run.outcome is Outcome.COMPLETE else row.run.outcome.value
