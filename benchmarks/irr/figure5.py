"""`robust bench figure5`: how quickly IRR converges, in steps [IRR Fig. 5].

The convergence at a step is the total width of the box after that many rectangles were tried, as a share of that of the
final box. A run that has ended counts as 1 from then on. Every instance is run in two schedules: the recorded one
(doubling, in the recorded order of turns) and the default one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from robust.draw.style import BLACK, VERMILION

from ..catalogue import Figure5Options
from ..engine.experiment import Report, Task
from ..engine.measure import FAILURES, Run
from ..engine.show import WINE, Columns, Panel, Series, Table
from ..suite import RecordedInstance
from .contenders import IRR, Contender
from .recorded import on_suite

STEPS = (1, 5, 10, 20, 50, 100, 200)
CLAIM_STEP = 50
CLAIM_SHARE = 0.7
CLAIM = "within 50 steps more than 70 % of the final total width in all cases"


RECORDED_SCHEDULE = replace(IRR, name="doubling", label="doubling, recorded order")
"""Alone to be told the data set's order of turns."""
DEFAULT_SCHEDULE = Contender("default", "default schedule", "envelope", ("--method", "irr", "--beta", "1"))
SCHEDULES = (RECORDED_SCHEDULE, DEFAULT_SCHEDULE)


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


def run_schedule(instance: RecordedInstance, schedule: Contender, limit: float | None) -> Figure5Row:
    """Run IRR with β = 1."""
    order = instance.order_options if schedule == RECORDED_SCHEDULE else []
    run = schedule.run(instance.files, limit=limit, extra=order)
    return Figure5Row(instance.name, schedule.name, run)


@dataclass(frozen=True, slots=True)
class StepSummary:
    """The poorest and the best run after a step, and how many were still going on."""

    step: int
    poorest: float
    best: float
    running: int


COLUMNS: Columns[StepSummary] = {
    "steps": lambda one: one.step,
    "poorest": lambda one: f"{one.poorest:.1%}",
    "best": lambda one: f"{one.best:.1%}",
    "runs still going on": lambda one: one.running,
}


class Figure5Report(Report[Figure5Row]):
    """Total width of the box as a share of the final one, after some steps of IRR with β = 1 [IRR Fig. 5] (`robust
    bench figure5`). A run that has ended counts as 100 %."""

    TITLE = "Convergence of IRR"
    SETTINGS: ClassVar[Mapping[str, str]] = {"suite": "suite", **Report.SETTINGS}
    LAYOUT = (5.2, 4, "lower right")

    @property
    def schedules(self) -> tuple[Contender, ...]:
        return self.options.schedules or SCHEDULES

    def rows_of(self, schedule: Contender, *, converging: bool = True) -> list[Figure5Row]:
        """The runs of a schedule that have a convergence, or those that have none."""
        return self.of(schedule=schedule.name, converges=converging)

    def summary(self, schedule: Contender, steps: Sequence[int] = STEPS) -> list[StepSummary]:
        """The poorest and the best convergence after each of the steps; empty without a run."""
        rows = self.rows_of(schedule)
        shares = {step: [row.share_at(step) for row in rows] for step in steps if rows}
        return [
            StepSummary(step, min(found), max(found), sum(row.steps > step for row in rows))
            for step, found in shares.items()
        ]

    def claim_holds(self, schedule: Contender) -> bool | None:
        """Whether the paper's observation can be made here too; None without a run."""
        rows = self.rows_of(schedule)
        return all(row.share_at(CLAIM_STEP) > CLAIM_SHARE for row in rows) if rows else None

    def sound(self) -> bool:
        """Whether no run failed; the paper's observation is reported, not required."""
        return all(row.run.status not in FAILURES for row in self.rows)

    def remarks(self) -> Sequence[str]:
        notes = [self.verdict(schedule) for schedule in self.schedules]
        for schedule in self.schedules:
            rows = self.rows_of(schedule, converging=False)
            whys = ["zero or infinite width" if row.run.complete else row.run.status.value for row in rows]
            left_out = ", ".join(f"{row.instance} ({why})" for row, why in zip(rows, whys, strict=True))
            notes += [f"{schedule.label}, left out: {left_out}"] if left_out else []
        return notes

    def verdict(self, schedule: Contender) -> str:
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

    def findings(self) -> Mapping[str, Any]:
        schedules = []
        for one in self.schedules:
            counts = {"runs": len(self.rows_of(one)), "claim_holds": self.claim_holds(one)}
            schedules.append({"schedule": one.name, **counts, "steps": self.summary(one)})
        return {"schedules": schedules}

    def printed(self, row: Figure5Row) -> dict[str, Any]:
        run = row.run.printed("status", "seconds", "checks", "message", "convergence")
        place = {"instance": row.instance, "schedule": row.schedule}
        return {**place, **run, "convergence": run["convergence"] if row.converges else None}

    def contents(self) -> list[Table]:
        """Poorest and best convergence after some steps, in each schedule."""
        found = {one.label: self.summary(one) for one in self.schedules}
        return [Table.of(f"Convergence, {name}", COLUMNS, steps, whole=False) for name, steps in found.items()]

    def panels(self) -> list[Panel]:
        """One panel for each schedule: the convergence of every run after each step, the poorest and the best."""
        return [self._panel(one) for one in self.schedules]

    def _panel(self, schedule: Contender) -> Panel:
        rows = self.rows_of(schedule)
        found = self.summary(schedule, range(1, max((row.steps for row in rows), default=0) + 1))
        dots = [dot for row in rows for dot in row.run.convergence]
        poorest, best = [(one.step, one.poorest) for one in found], [(one.step, one.best) for one in found]
        lines = [
            Series(dots, "a run after a step", VERMILION, marker=".", size=2.5),
            Series(poorest, "poorest", WINE, "-"),
            Series(best, "best", BLACK, "--"),
        ]
        look: dict[str, Any] = {"units": {"y": "{:.0%}".format}, "axes": {"ylim": (-0.02, 1.04)}}
        return Panel(f"{schedule.label}, {len(rows)} runs", lines, "steps", "convergence", **look)


def _tasks(options: Figure5Options, instances: Sequence[RecordedInstance]) -> list[Task]:
    return [
        Task(f"{instance.name}, {schedule.name}", (instance, schedule, options.limit))
        for schedule in options.schedules or SCHEDULES
        for instance in instances
    ]


def _describe(row: Figure5Row) -> str:
    return f"{row.run.text}, {row.steps} steps, {row.run.seconds:.2f} s"


FIGURE5 = on_suite("figure5", Figure5Options, _tasks, run_schedule, Figure5Report, _describe)
