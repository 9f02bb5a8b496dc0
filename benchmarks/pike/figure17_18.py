"""`robust bench figure17` and `figure18`: PIKE against a Kirk that guesses intents, on the k-intents domain.

Both figures of [PIKE §6.2.1] come from the same executions. Each problem is executed once by PIKE and once by Kirk,
with the same human choices and the same durations. Figure 17 is the number of Kirk's re-plans; Figure 18 the time to
completion. Executions that fail count as such, and are left out of what is compared.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import prod
from pathlib import Path
from statistics import fmean
from typing import Any, ClassVar

from robust.errors import InputError
from robust.execute.drive import run_in_world
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online.progress import Message, Succeeded
from robust.pike_bridge.online.reasoners import make_reasoner
from robust.smt.limits import Deadline, OutOfTimeError

from ..catalogue import Figure17Options, Figure18Options
from ..engine.codec import plain
from ..engine.experiment import Experiment, Report
from ..engine.show import BLACK, BLUE, NOTHING, ORANGE, Cells, Table, canvas, number
from ..engine.stats import LineFit, Mean
from ..generators.pike import random_k_intents
from .baselines import (
    KirkDecision,
    Mode,
    Script,
    ScriptedTeam,
    TeamExecutive,
    draw_script,
    execution_faults,
    make_executive,
)

SMALLEST = 2
PAPER = {"improvement": 0.134, "free_recovery": 0.022}
"""Mean improvement of PIKE over Kirk, and the same without the time of recoveries [PIKE §6.2.1]."""


# -- one problem, executed by both in the same world -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class KIntentsTask:
    """A problem of a seed; each executive has `limit` seconds for it."""

    seed: int
    index: int
    largest: int
    reasoner: str
    limit: float | None

    @property
    def label(self) -> str:
        return f"k-intents {self.seed}/{self.index}"


@dataclass(frozen=True, slots=True)
class TeamExecution:
    """One execution: how it ended, after how much time of the plan and of which recoveries, and what it computed.

    `outcome` is succeeded, failed, waiting, timeout, or incorrect: a success that the referee rejects. `seconds` is the
    computing during execution: steps, re-plans, and finding out when to look again. What is computed before, such as
    the first guess, does not count [PIKE §6.2.1].
    """

    outcome: str
    time: Fraction
    replans: int
    recovery: Fraction
    seconds: float

    @property
    def succeeded(self) -> bool:
        return self.outcome == "succeeded"


@dataclass(frozen=True, slots=True)
class KIntentsRun:
    """Both executions of one problem."""

    index: int
    structure: tuple[int, ...]
    pike: TeamExecution
    kirk: TeamExecution

    @property
    def intents(self) -> int:
        return prod(self.structure)

    @property
    def choices(self) -> int:
        """How many uncontrollable choices there are."""
        return len(self.structure)

    @property
    def wrong_guesses(self) -> Fraction:
        """How many guesses are wrong on average, for a human who chooses uniformly."""
        return sum((1 - Fraction(1, options) for options in self.structure), Fraction(0))

    @property
    def compared(self) -> bool:
        return self.pike.succeeded and self.kirk.succeeded

    @property
    def improvement(self) -> float:
        """The share of Kirk's time that PIKE saves, in the time of the plan."""
        return float(1 - self.pike.time / self.kirk.time)

    @property
    def improvement_over_pike(self) -> float:
        """The same difference as a share of PIKE's time."""
        return float(self.kirk.time / self.pike.time - 1)

    @property
    def computed_improvement(self) -> float:
        """With the computing of both added; the unit of the plan is a second."""
        pike, kirk = float(self.pike.time) + self.pike.seconds, float(self.kirk.time) + self.kirk.seconds
        return 1 - pike / kirk

    @property
    def free_improvement(self) -> float:
        """With computing, and recoveries that take no time; in this domain nothing else changes with them."""
        pike = float(self.pike.time) + self.pike.seconds
        return 1 - pike / (float(self.kirk.time - self.kirk.recovery) + self.kirk.seconds)


class _Timed:
    """An executive whose computing is measured."""

    def __init__(self, executive: TeamExecutive) -> None:
        self._executive = executive
        self.seconds = 0.0

    def step(self, now: Fraction, messages: Sequence[Message]) -> Sequence[KirkDecision]:
        started = time.perf_counter()
        decisions = self._executive.step(now, messages)
        self.seconds += time.perf_counter() - started
        return decisions

    @property
    def wake(self) -> Fraction | None:
        started = time.perf_counter()
        wake = self._executive.wake
        self.seconds += time.perf_counter() - started
        return wake

    @property
    def ended(self) -> bool:
        return self._executive.ended


def run_problem(task: KIntentsTask) -> KIntentsRun:
    """Draw the problem and its world, and execute it by both."""
    problem = random_k_intents(task.seed, task.index, task.largest)
    plan = problem.instance.plan()
    script = draw_script(plan, f"{task.seed}/{task.index}")

    def executed(mode: Mode) -> TeamExecution:
        deadline = Deadline.after(task.limit)
        reasoner = make_reasoner(task.reasoner, deadline=deadline)
        recovery = problem.recovery if mode is Mode.KIRK else {}
        return execute(plan, script, lambda: make_executive(mode, plan, reasoner, recovery=recovery, deadline=deadline))

    return KIntentsRun(task.index, problem.structure, executed(Mode.PIKE), executed(Mode.KIRK))


def execute(plan: TeamPlan, script: Script, make: Callable[[], TeamExecutive]) -> TeamExecution:
    """One execution."""
    executive: TeamExecutive | None = None
    seconds = 0.0
    try:
        executive = make()
        executive.prepare()
        timed = _Timed(executive)
        run_in_world(timed, ScriptedTeam(plan, executive, script))
        seconds = timed.seconds
    except OutOfTimeError:
        outcome = "timeout"
    else:
        outcome = "waiting" if executive.outcome is None else type(executive.outcome).__name__.lower()
        if isinstance(executive.outcome, Succeeded) and execution_faults(plan, executive):
            outcome = "incorrect"
    if executive is None:
        return TeamExecution(outcome, Fraction(0), 0, Fraction(0), 0.0)
    return TeamExecution(outcome, executive.progress.now, executive.replans, executive.recovered, round(seconds, 4))


# -- the report --------------------------------------------------------------------------------------------------------


class KIntentsReport(Report[KIntentsRun]):
    """All problems."""

    SETTINGS: ClassVar[Mapping[str, str]] = {
        name: name for name in ("seed", "problems", "largest", "reasoner", "limit", "jobs")
    }
    ROWS = "runs"
    ROW = KIntentsRun

    @cached_property
    def compared(self) -> list[KIntentsRun]:
        return [run for run in self.rows if run.compared]

    @property
    def agrees(self) -> bool:
        """Whether PIKE never failed nor planned anew, Kirk always arrived, and nothing else went wrong."""
        fine = {"succeeded", "timeout"}
        ended = all(one.outcome in fine for run in self.rows for one in (run.pike, run.kirk))
        return super().agrees and ended and not any(run.pike.replans for run in self.rows)

    @property
    def pike_failures(self) -> int:
        """Executions that PIKE would have to plan anew, or that it planned anew."""
        return sum(run.pike.outcome in {"failed", "incorrect", "waiting"} or run.pike.replans > 0 for run in self.rows)

    @property
    def by_choices(self) -> dict[int, list[KIntentsRun]]:
        """What is compared, by the number of uncontrollable choices."""
        counts = sorted({run.choices for run in self.compared})
        return {count: [run for run in self.compared if run.choices == count] for count in counts}

    def mean(self, value: Callable[[KIntentsRun], float], runs: Sequence[KIntentsRun] | None = None) -> Mean | None:
        """Over the problems that are compared, or some of them."""
        return Mean.of(value(run) for run in (self.compared if runs is None else runs))

    @property
    def shown(self) -> bool:
        return bool(self.compared)

    @cached_property
    def fit(self) -> LineFit | None:
        """Kirk's re-plans over the number of uncontrollable choices, problem by problem."""
        return LineFit.of([(run.choices, run.kirk.replans) for run in self.compared])

    @property
    def fit_of_means(self) -> LineFit | None:
        """The same for the means of each number of choices."""
        return LineFit.of([(count, fmean(run.kirk.replans for run in runs)) for count, runs in self.by_choices.items()])

    @property
    def saved_of_totals(self) -> float | None:
        """The share of the sum of Kirk's times that PIKE saves."""
        kirk = sum((run.kirk.time for run in self.compared), Fraction(0))
        return float(1 - sum((run.pike.time for run in self.compared), Fraction(0)) / kirk) if kirk else None

    @property
    def findings(self) -> Mapping[str, Any]:
        means = {
            "improvement": self.mean(lambda run: run.improvement),
            "improvement_over_pike": self.mean(lambda run: run.improvement_over_pike),
            "improvement_with_computing": self.mean(lambda run: run.computed_improvement),
            "improvement_with_free_recovery": self.mean(lambda run: run.free_improvement),
            "replans": self.mean(lambda run: run.kirk.replans),
        }
        return {
            "pike_failures": self.pike_failures,
            "fit": self.fit,
            "fit_of_means": self.fit_of_means,
            "means": means,
            "improvement_of_totals": self.saved_of_totals,
            "paper": PAPER,
        }

    def printed(self, row: KIntentsRun) -> dict[str, Any]:
        place = {"index": row.index, "structure": row.structure, "intents": row.intents}
        found: dict[str, Any] = plain({**place, "pike": row.pike, "kirk": row.kirk})
        return found

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader of the tables has to know."""
        options, runs = self.options, self.rows
        lines = [
            f"{len(runs)} problems of seed {options.seed}, up to {options.largest} intents; reasoner "
            f"{options.reasoner}; the same choices and durations for both",
            f"PIKE: {self.pike_failures} failures or re-plans in {len(runs)} executions",
        ]
        lost = sum(run.kirk.outcome not in {"succeeded", "timeout"} for run in runs)
        if lost:
            lines.append(f"Kirk: {lost} executions did not succeed")
        late = sum("timeout" in {run.pike.outcome, run.kirk.outcome} for run in runs)
        if late:
            lines.append(f"out of time: {late} problems")
        return (*lines, *self.jobs_notes, *self.notes)

    def replans(self, *notes: str) -> Table:
        """Re-plans by the number of uncontrollable choices [PIKE, Figure 17]."""
        rows: list[Cells] = []
        for count, runs in self.by_choices.items():
            mean = self.mean(lambda run: run.kirk.replans, runs)
            rows.append(
                (
                    str(count),
                    str(len(runs)),
                    number(None if mean is None else mean.value),
                    _interval(mean, 2),
                    str(max(run.kirk.replans for run in runs)),
                    number(float(sum(run.wrong_guesses for run in runs) / len(runs))),
                    str(sum(run.pike.replans for run in runs)),
                )
            )
        headings = ("human choices", "problems", "Kirk's re-plans", "95 %", "most", "expected", "PIKE's re-plans")
        return Table("Re-plans on the k-intents domain", headings, rows, notes)

    @property
    def times(self) -> Table:
        """Mean times to completion by the number of uncontrollable choices [PIKE, Figure 18]."""
        rows: list[Cells] = []
        for count, runs in self.by_choices.items():
            saved = [run.improvement * 100 for run in runs]
            rows.append(
                (
                    str(count),
                    str(len(runs)),
                    *(number(fmean(float(one.time) for one in side)) for side in _sides(runs)),
                    number(fmean(saved), 1),
                    _interval(Mean.of(saved), 1),
                    number(min(saved), 1),
                    number(max(saved), 1),
                    *(number(fmean(one.seconds for one in side), 3) for side in _sides(runs)),
                )
            )
        headings = (
            "human choices",
            "problems",
            "PIKE",
            "Kirk",
            "saved, %",
            "95 %",
            "least",
            "most",
            "PIKE, s",
            "Kirk, s",
        )
        return Table("Time to completion on the k-intents domain", headings, rows)

    def improvements(self, *notes: str) -> Table:
        """What PIKE saves, beside the paper's figures, which include its implementation's computing."""
        paper, free = (number(share * 100, 1) for share in PAPER.values())
        lines = (
            ("of Kirk's time", [run.improvement for run in self.compared], paper),
            ("difference as a share of PIKE's time", [run.improvement_over_pike for run in self.compared], NOTHING),
            ("of Kirk's time, with computing", [run.computed_improvement for run in self.compared], paper),
            ("the same, recovery taking no time", [run.free_improvement for run in self.compared], free),
        )
        found = [(name, Mean.of(value * 100 for value in values), theirs) for name, values, theirs in lines]
        rows = [
            (name, number(None if mean is None else mean.value, 1), _interval(mean, 1), theirs)
            for name, mean, theirs in found
        ]
        headings = ("saved by PIKE", "mean, %", "95 %", "paper, %")
        return Table("Improvement, mean of all problems", headings, rows, notes)


def _sides(runs: Sequence[KIntentsRun]) -> tuple[list[TeamExecution], list[TeamExecution]]:
    return [run.pike for run in runs], [run.kirk for run in runs]


def _interval(mean: Mean | None, digits: int) -> str:
    if mean is None or mean.interval is None:
        return NOTHING
    return f"{mean.interval[0]:.{digits}f} to {mean.interval[1]:.{digits}f}"


def fit_text(fit: LineFit | None) -> str:
    """Slope with its interval, intercept and R²."""
    if fit is None:
        return "no line: all problems have the same number of human choices"
    interval = "" if fit.interval is None else f" ({fit.interval[0]:.3f} to {fit.interval[1]:.3f})"
    return (
        f"{fit.slope:.3f}{interval} more with each human choice, {fit.intercept:.2f} for none; R² {fit.r_squared:.3f}"
    )


class Figure17Report(KIntentsReport):
    """Re-plans over the number of human choices, and the line through them."""

    @property
    def tables(self) -> list[Table]:
        lines = [
            f"re-plans, by problems: {fit_text(self.fit)}",
            f"re-plans, by means: {fit_text(self.fit_of_means)}",
        ]
        return [self.replans(*self.remarks, *lines)]

    def draw(self, path: Path) -> None:
        """Re-plans over the number of intents, a dot for each problem, and the number of wrong guesses expected."""
        runs = self.compared
        expected = {run.intents: float(run.wrong_guesses) for run in sorted(runs, key=lambda run: run.intents)}
        with canvas(path, 6.5, 4.4) as (_, [axes]):
            dots = [(run.intents, run.kirk.replans) for run in runs]
            axes.plot(*zip(*dots, strict=True), ".", color=BLUE, alpha=0.25, markersize=5, label="Kirk")
            axes.plot(list(expected), list(expected.values()), "-", color=BLACK, linewidth=0.8, label="Kirk, expected")
            ends, most = [min(expected), max(expected)], max(run.pike.replans for run in runs)
            axes.plot(ends, [most, most], ":", color=ORANGE, linewidth=2, label="PIKE, most")
            axes.set(xscale="log", xlabel="number of intents k", ylabel="re-plans")
            axes.legend(loc="upper left")


class Figure18Report(KIntentsReport):
    """Times to completion, and what PIKE saves."""

    @property
    def tables(self) -> list[Table]:
        saved = None if self.saved_of_totals is None else self.saved_of_totals * 100
        line = f"of the sum of all of Kirk's times PIKE saves {number(saved, 1)} %"
        return [self.times, self.improvements(*self.remarks, line)]

    def draw(self, path: Path) -> None:
        """PIKE's time to completion over Kirk's, shaded by the number of intents; the line is where they are equal."""
        from matplotlib.colors import LogNorm  # noqa: PLC0415 - only where something is drawn

        pike, kirk = ([float(one.time) for one in side] for side in _sides(self.compared))
        with canvas(path, 5.8, 4.6) as (figure, [axes]):
            shades = [run.intents for run in self.compared]
            dots = axes.scatter(kirk, pike, c=shades, norm=LogNorm(), s=6, cmap="viridis")
            ends = [0.0, max(kirk)]
            axes.plot(ends, ends, color=BLACK, linewidth=0.6, linestyle=":", label="as long")
            figure.colorbar(dots, ax=axes, label="number of intents k")
            axes.set(xlabel="Kirk: time to completion", ylabel="PIKE: time to completion")
            axes.legend(loc="upper left")


def _tasks(options: Figure17Options, _: object) -> list[KIntentsTask]:
    if options.problems < 1:
        raise InputError(f"problems is {options.problems}; expected at least 1")
    if options.largest < SMALLEST:
        raise InputError(f"the largest number of intents is {options.largest}; expected at least {SMALLEST}")
    make_reasoner(options.reasoner)  # an unknown one is better found now
    return [
        KIntentsTask(options.seed, index, options.largest, options.reasoner, options.limit)
        for index in range(options.problems)
    ]


def _describe(task: KIntentsTask, run: KIntentsRun) -> str:
    if not run.compared:
        return f"{task.label}: PIKE {run.pike.outcome}, Kirk {run.kirk.outcome}"
    return f"{task.label}, {run.intents} intents: {run.kirk.replans} re-plans, {run.improvement:.1%} saved"


def _experiment(name: str, options: type[Figure17Options], report: type[KIntentsReport]) -> Experiment:
    return Experiment(name, options, _tasks, run_problem, KIntentsRun, report, _describe, lenient=True)


FIGURE17 = _experiment("figure17", Figure17Options, Figure17Report)
FIGURE18 = _experiment("figure18", Figure18Options, Figure18Report)
