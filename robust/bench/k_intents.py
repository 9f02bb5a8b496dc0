"""`robust bench figure17` and `figure18`: PIKE against a Kirk that guesses intents, on the k-intents domain.

Both figures of [PIKE §6.2.1] come from the same executions. Each problem is executed once by PIKE and once by Kirk,
with the same human choices and the same durations. Figure 17 is the number of Kirk's re-plans; Figure 18 the time to
completion. Executions that fail count as such, and are left out of what is compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.bench.batch import Progress
from robust.bench.execution_statistics import Mean
from robust.bench.k_intents_work import KIntentsTask, do
from robust.bench.line_fit import LineFit
from robust.bench.options import check_limit, plotting
from robust.bench.sweep import Failure, run_sweep
from robust.errors import InputError
from robust.pike_bridge.generators.k_intents import LARGEST
from robust.pike_bridge.online.reasoners import SMT, make_reasoner

if TYPE_CHECKING:
    from rich.table import Table

FIGURES = {"figure17": "robust/bench-figure17/1", "figure18": "robust/bench-figure18/1"}
FIGURE17 = FIGURES["figure17"]
PROBLEMS = 2000
LIMIT = 60.0
SMALLEST = 2
PAPER = {"improvement": 0.134, "free_recovery": 0.022}
"""Mean improvement of PIKE over Kirk, and the same without the time of recoveries [PIKE §6.2.1]."""


@dataclass(frozen=True, slots=True)
class TeamExecution:
    """One execution: how it ended, after how much time of the plan and of which recoveries, and what it computed.

    `outcome` is succeeded, failed, waiting, timeout, or incorrect: a success that the referee rejects.
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

    def as_dict(self) -> dict[str, Any]:
        return {
            "index": self.index,
            "structure": list(self.structure),
            "intents": self.intents,
            "pike": _printed(self.pike),
            "kirk": _printed(self.kirk),
        }


@dataclass(frozen=True)
class KIntentsReport:
    """All problems; `complete` is false where Ctrl-C came before the last one."""

    schema: str
    runs: tuple[KIntentsRun, ...]
    failures: tuple[Failure[KIntentsTask], ...]
    problems: int
    seed: int
    largest: int
    reasoner: str
    limit: float | None
    jobs: int
    complete: bool
    notes: tuple[str, ...] = ()

    @cached_property
    def compared(self) -> list[KIntentsRun]:
        return [run for run in self.runs if run.compared]

    @property
    def agrees(self) -> bool:
        """Whether PIKE never failed nor planned anew, Kirk always arrived, and nothing else went wrong."""
        return (
            self.complete
            and not self.failures
            and all(one.outcome in {"succeeded", "timeout"} for run in self.runs for one in (run.pike, run.kirk))
            and not any(run.pike.replans for run in self.runs)
        )

    @property
    def pike_failures(self) -> int:
        """Executions that PIKE would have to plan anew, or that it planned anew."""
        return sum(run.pike.outcome in {"failed", "incorrect", "waiting"} or run.pike.replans > 0 for run in self.runs)

    @property
    def choices(self) -> list[int]:
        """The numbers of uncontrollable choices that occur."""
        return sorted({run.choices for run in self.compared})

    def with_choices(self, count: int) -> list[KIntentsRun]:
        return [run for run in self.compared if run.choices == count]

    def mean(self, value: Callable[[KIntentsRun], float], count: int | None = None) -> Mean | None:
        """Over the problems that are compared, or those with so many uncontrollable choices."""
        return Mean.of(value(run) for run in (self.compared if count is None else self.with_choices(count)))

    @cached_property
    def fit(self) -> LineFit | None:
        """Kirk's re-plans over the number of uncontrollable choices, problem by problem."""
        return LineFit.of([(run.choices, run.kirk.replans) for run in self.compared])

    @property
    def fit_of_means(self) -> LineFit | None:
        """The same for the means of each number of choices."""
        found = [(count, self.mean(lambda run: run.kirk.replans, count)) for count in self.choices]
        return LineFit.of([(count, mean.value) for count, mean in found if mean is not None])

    @property
    def totals(self) -> float | None:
        """The share of the sum of Kirk's times that PIKE saves."""
        kirk = sum((run.kirk.time for run in self.compared), Fraction(0))
        return float(1 - sum((run.pike.time for run in self.compared), Fraction(0)) / kirk) if kirk else None

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; times of plans as exact texts, computing in seconds, improvements as shares of 1."""
        means = {
            "improvement": self.mean(lambda run: run.improvement),
            "improvement_over_pike": self.mean(lambda run: run.improvement_over_pike),
            "improvement_with_computing": self.mean(lambda run: run.computed_improvement),
            "improvement_with_free_recovery": self.mean(lambda run: run.free_improvement),
            "replans": self.mean(lambda run: run.kirk.replans),
        }
        return {
            "schema": self.schema,
            "complete": self.complete,
            "agrees": self.agrees,
            "seed": self.seed,
            "problems": self.problems,
            "largest": self.largest,
            "reasoner": self.reasoner,
            "limit": self.limit,
            "jobs": self.jobs,
            "notes": list(self.notes),
            "failures": [{"task": each.task.label, "reason": each.reason} for each in self.failures],
            "pike_failures": self.pike_failures,
            "fit": _fit(self.fit),
            "fit_of_means": _fit(self.fit_of_means),
            "means": {name: _mean(value) for name, value in means.items()},
            "improvement_of_totals": self.totals,
            "paper": PAPER,
            "runs": [run.as_dict() for run in self.runs],
        }

    def tables(self) -> Sequence[Table]:
        """Tables for people."""
        from robust.bench.k_intents_tables import figure17_tables, figure18_tables  # noqa: PLC0415 - not for JSON

        return figure17_tables(self) if self.schema == FIGURE17 else figure18_tables(self)


def run_k_intents(
    *,
    figure: str,
    problems: int = PROBLEMS,
    seed: int = 0,
    largest: int = LARGEST,
    reasoner: str = SMT,
    limit: float | None = LIMIT,
    jobs: int = 1,
    cluster: str | None = None,
    store: Path | None = None,
    plot: Path | None = None,
    on_result: Progress | None = None,
) -> KIntentsReport:
    """Execute problems by PIKE and by Kirk.

    Args:
        figure: `figure17` or `figure18`: what is tabulated and drawn; the executions are the same.
        largest: how many intents a problem has at most.
        limit: seconds for one execution.
        store: a file that keeps results; both figures can be made of one.

    Raises:
        InputError: wrong options.
    """
    check_limit(limit)
    if problems < 1:
        raise InputError(f"problems is {problems}; expected at least 1")
    if largest < SMALLEST:
        raise InputError(f"the largest number of intents is {largest}; expected at least {SMALLEST}")
    make_reasoner(reasoner)  # an unknown one is better found now
    drawing = plotting(plot, "robust.bench.k_intents_plots")
    tasks = [KIntentsTask(seed, index, largest, reasoner, limit) for index in range(problems)]
    sweep = run_sweep(tasks, do, store=store, jobs=jobs, cluster=cluster, describe=_describe, on_result=on_result)
    report = KIntentsReport(
        FIGURES[figure],
        tuple(run_of(task.index, result) for task, result in sweep.results),
        sweep.failures,
        problems,
        seed,
        largest,
        reasoner,
        limit,
        jobs,
        sweep.complete,
        sweep.notes,
    )
    if drawing is not None and plot is not None and report.compared:
        (drawing.plot_figure17 if report.schema == FIGURE17 else drawing.plot_figure18)(report, plot)
    return report


def run_of(index: int, result: Mapping[str, Any]) -> KIntentsRun:
    """Both executions from what :func:`do` returns."""
    return KIntentsRun(index, tuple(result["structure"]), _execution(result["pike"]), _execution(result["kirk"]))


def report_of(printed: Mapping[str, Any]) -> KIntentsReport:
    """The report that was printed as JSON, without the tasks that failed."""
    return KIntentsReport(
        printed["schema"],
        tuple(run_of(run["index"], run) for run in printed["runs"]),
        (),
        printed["problems"],
        printed["seed"],
        printed["largest"],
        printed["reasoner"],
        printed["limit"],
        printed["jobs"],
        printed["complete"],
        tuple(printed["notes"]),
    )


def _execution(value: Mapping[str, Any]) -> TeamExecution:
    return TeamExecution(
        value["outcome"],
        Fraction(value["time"] or 0),
        value["replans"],
        Fraction(value["recovery"]),
        value["seconds"],
    )


def _printed(one: TeamExecution) -> dict[str, Any]:
    return {
        "outcome": one.outcome,
        "time": str(one.time),
        "replans": one.replans,
        "recovery": str(one.recovery),
        "seconds": round(one.seconds, 4),
    }


def _mean(value: Mean | None) -> dict[str, Any] | None:
    return None if value is None else {"value": value.value, "interval": value.interval and list(value.interval)}


def _fit(fit: LineFit | None) -> dict[str, Any] | None:
    if fit is None:
        return None
    return {
        "slope": fit.slope,
        "interval": fit.interval and list(fit.interval),
        "intercept": fit.intercept,
        "r_squared": fit.r_squared,
    }


def _describe(task: KIntentsTask, result: Mapping[str, Any]) -> str:
    run = run_of(task.index, result)
    if not run.compared:
        return f"{task.label}: PIKE {run.pike.outcome}, Kirk {run.kirk.outcome}"
    return f"{task.label}, {run.intents} intents: {run.kirk.replans} re-plans, {run.improvement:.1%} saved"
