"""`robust bench figure5`: how quickly IRR converges, in steps [IRR Fig. 5].

The convergence at a step is the total width of the box after that many rectangles were tried, as a share of that of the
final box. A run that has ended counts as 1 from then on. Every instance is run in two schedules: the recorded one
(doubling, in the recorded order of turns) and the default one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..catalogue import Figure5Options
from ..engine.experiment import Experiment, Report, Results
from ..engine.measure import FAILURES, Run, run_robust
from ..engine.show import BLACK, ORANGE, WINE, Table, canvas
from ..suite import RecordedInstance, read_suite
from .contenders import IRR

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
class Figure5Task:
    """One instance in one schedule."""

    instance: RecordedInstance
    schedule: Schedule
    limit: float | None

    @property
    def label(self) -> str:
        return f"{self.instance.name}, {self.schedule.name}"


def run_schedule(task: Figure5Task) -> Run:
    """Run IRR with β = 1."""
    order = task.instance.order_options if task.schedule.recorded_order else []
    return run_robust("envelope", task.instance.files, [*task.schedule.options, *order], limit=task.limit)


@dataclass(frozen=True, slots=True)
class Figure5Row:
    """One instance in one schedule."""

    instance: str
    schedule: str
    run: Run

    @property
    def converges(self) -> bool:
        """Whether there is a convergence: the run is complete, and its final width neither zero nor infinite."""
        return self.run.complete and bool(self.run.convergence)

    @property
    def steps(self) -> int:
        return self.run.convergence[-1][0] if self.run.convergence else 0

    def share_at(self, step: int) -> float:
        """The convergence after a step; 1 after the last one."""
        if step >= self.steps:
            return 1.0
        return max((share for check, share in self.run.convergence if check <= step), default=0.0)


@dataclass(frozen=True, slots=True)
class StepSummary:
    """The poorest and the best run after a step, and how many were still going on."""

    step: int
    poorest: float
    best: float
    running: int


class Figure5Report(Report[Figure5Row]):
    """All runs, schedule by schedule, in the order of the data set."""

    SETTINGS: ClassVar[Mapping[str, str]] = {"suite": "suite", **Report.SETTINGS}

    @property
    def schedules(self) -> tuple[Schedule, ...]:
        return self.options.schedules or SCHEDULES

    def rows_of(self, schedule: Schedule, *, converging: bool = True) -> list[Figure5Row]:
        """The runs of a schedule that have a convergence, or those that have none."""
        return [row for row in self.rows if row.schedule == schedule.name and row.converges is converging]

    def summary(self, schedule: Schedule, steps: Sequence[int] = STEPS) -> list[StepSummary]:
        """The poorest and the best convergence after each of the steps; empty without a run."""
        rows = self.rows_of(schedule)
        shares = {step: [row.share_at(step) for row in rows] for step in steps if rows}
        return [
            StepSummary(step, min(found), max(found), sum(row.steps > step for row in rows))
            for step, found in shares.items()
        ]

    def claim_holds(self, schedule: Schedule) -> bool | None:
        """Whether the paper's observation can be made here too; None without a run."""
        rows = self.rows_of(schedule)
        return all(row.share_at(CLAIM_STEP) > CLAIM_SHARE for row in rows) if rows else None

    @property
    def agrees(self) -> bool:
        """Whether every run was made and none failed; the paper's observation is reported, not required."""
        return self.complete and all(row.run.status not in FAILURES for row in self.rows)

    @property
    def notes(self) -> tuple[str, ...]:
        notes = [self.verdict(schedule) for schedule in self.schedules]
        for schedule in self.schedules:
            left_out = ", ".join(
                f"{row.instance} ({'zero or infinite width' if row.run.complete else row.run.status.value})"
                for row in self.rows_of(schedule, converging=False)
            )
            if left_out:
                notes.append(f"{schedule.label}, left out: {left_out}")
        if not self.complete:
            notes.append(f"incomplete: interrupted after {len(self.rows)} of {self.total} runs")
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

    @property
    def findings(self) -> Mapping[str, Any]:
        schedules = [
            {
                "schedule": schedule.name,
                "runs": len(self.rows_of(schedule)),
                "claim_holds": self.claim_holds(schedule),
                "steps": self.summary(schedule),
            }
            for schedule in self.schedules
        ]
        return {"schedules": schedules}

    def printed(self, row: Figure5Row) -> dict[str, Any]:
        run = row.run.printed("status", "seconds", "checks", "message", "convergence")
        place = {"instance": row.instance, "schedule": row.schedule}
        return {**place, **run, "convergence": run["convergence"] if row.converges else None}

    def table(self, schedule: Schedule, *notes: str) -> Table:
        """Poorest and best convergence after some steps."""
        rows = [
            (str(one.step), f"{one.poorest:.1%}", f"{one.best:.1%}", str(one.running)) for one in self.summary(schedule)
        ]
        headings = ("steps", "poorest", "best", "runs still going on")
        return Table(f"Convergence, {schedule.label}", headings, rows, notes, whole=False)

    @property
    def tables(self) -> list[Table]:
        """One table for each schedule."""
        *others, last = self.schedules
        return [*map(self.table, others), self.table(last, *self.notes)]

    def draw(self, path: Path) -> None:
        """One panel for each schedule: the convergence of every run after each step, the poorest and the best."""
        from matplotlib.ticker import PercentFormatter  # noqa: PLC0415 - only where something is drawn

        with canvas(path, 5.2 * len(self.schedules), 4, len(self.schedules)) as (_, panels):
            for axes, schedule in zip(panels, self.schedules, strict=True):
                rows = self.rows_of(schedule)
                axes.set_title(f"{schedule.label}, {len(rows)} runs", fontsize=9, loc="left")
                axes.set_xlabel("steps")
                if rows:
                    dots = [dot for row in rows for dot in row.run.convergence]
                    axes.plot(*zip(*dots, strict=True), ".", color=ORANGE, markersize=2.5, label="a run after a step")
                    steps = range(1, max(row.steps for row in rows) + 1)
                    summary = self.summary(schedule, steps)
                    axes.plot(steps, [one.poorest for one in summary], color=WINE, linewidth=1.4, label="poorest")
                    axes.plot(steps, [one.best for one in summary], color=BLACK, linestyle="--", label="best")
                    axes.set_ylim(-0.02, 1.04)
            panels[0].set_ylabel("convergence")
            panels[0].yaxis.set_major_formatter(PercentFormatter(1.0))
            if panels[0].get_legend_handles_labels()[0]:
                panels[0].legend(loc="lower right", fontsize=8, framealpha=1)


def _tasks(options: Figure5Options, instances: Sequence[RecordedInstance]) -> list[Figure5Task]:
    schedules = options.schedules or SCHEDULES
    return [Figure5Task(instance, schedule, options.limit) for schedule in schedules for instance in instances]


def _rows(_options: Figure5Options, _instances: object, results: Results) -> list[Figure5Row]:
    return [Figure5Row(task.instance.name, task.schedule.name, run) for task, run in results]


def _describe(task: Figure5Task, run: Run) -> str:
    row = Figure5Row(task.instance.name, task.schedule.name, run)
    return f"{task.label}: {run.text}, {row.steps} steps, {run.seconds:.2f} s"


FIGURE5 = Experiment(
    "figure5",
    Figure5Options,
    _tasks,
    run_schedule,
    Run,
    Figure5Report,
    _describe,
    prepare=lambda options, _: read_suite(options.suite),
    collect=_rows,
)
