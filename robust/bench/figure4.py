"""`robust bench figure4`: the time of each method over the number of parameters, in the delivery domain [IRR Fig. 4].

Every run of a method is a whole process with a limit of its own. The plans are those that a data set records, if there
is one, and our own of one parameter after another. For each plan it is also asked whether the box of exact widening is
dynamically controllable, and how much of it is lost by making it so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.bench.batch import Progress
from robust.bench.contenders import Contender
from robust.bench.figure4_instances import SIZES, Instance, Origin, own_instance, recorded_instances
from robust.bench.figure4_work import BASELINE, CONTENDERS, CONTROLLABILITY, OURS, Figure4Task, do
from robust.bench.options import check_limit, plotting
from robust.bench.run import Outcome
from robust.bench.sweep import Failure, run_sweep
from robust.errors import InputError

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "robust/bench-figure4/1"
LIMIT = 10.0
_RUN = ("status", "seconds", "cpu_s", "memory_mb", "search_s", "message", "box", "unbounded", "capped", "polyhedra")


@dataclass(frozen=True)
class Figure4Row:
    """One plan: its runs by the names of the methods, and what was found about controllability, as JSON."""

    instance: Instance
    runs: Mapping[str, Mapping[str, Any]]
    controllability: Mapping[str, Any] | None

    def outcome(self, method: str) -> Outcome | None:
        """How a run ended; None if it was not made."""
        return Outcome(self.runs[method]["status"]) if method in self.runs else None

    def seconds(self, method: str) -> float | None:
        """The time of a run that came to an end by itself."""
        return float(self.runs[method]["seconds"]) if self.outcome(method) is Outcome.COMPLETE else None

    def as_dict(self) -> dict[str, Any]:
        return {
            "instance": self.instance.name,
            "origin": self.instance.origin.value,
            "parameters": self.instance.parameters,
            "runs": {name: {key: run[key] for key in _RUN} for name, run in self.runs.items()},
            "controllability": self.controllability,
        }


@dataclass(frozen=True)
class Figure4Report:
    """All plans, by origin and number of parameters; `complete` is false where Ctrl-C came before the last run."""

    rows: tuple[Figure4Row, ...]
    contenders: tuple[Contender, ...]
    failures: tuple[Failure[Figure4Task], ...]
    complete: bool
    limit: float | None
    baseline_limit: float | None
    jobs: int
    sweep_notes: tuple[str, ...]

    @property
    def origins(self) -> tuple[Origin, ...]:
        return tuple(dict.fromkeys(row.instance.origin for row in self.rows))

    def rows_of(self, origin: Origin) -> tuple[Figure4Row, ...]:
        return tuple(row for row in self.rows if row.instance.origin is origin)

    def solved(self, origin: Origin, method: str) -> int:
        return sum(row.seconds(method) is not None for row in self.rows_of(origin))

    @property
    def agrees(self) -> bool:
        """Whether all was run, nothing failed, and IRR and exact widening solved every plan within their limit."""
        wrong = {Outcome.ERROR, Outcome.INVALID}
        sound = all(row.outcome(name) not in wrong for row in self.rows for name in row.runs)
        ours = [one.name for one in self.contenders if one in OURS]
        solved = all(row.seconds(name) is not None for row in self.rows for name in ours)
        return self.complete and not self.failures and sound and solved

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures has to know."""
        notes = [f"whole processes on this machine; limits: IRR and widening {_limit(self.limit)}, "]
        notes[0] += f"the others {_limit(self.baseline_limit)}"
        if self.jobs > 1:
            notes.append(f"{self.jobs} processes ran at a time and disturbed each other's timings")
        wrong = {Outcome.ERROR, Outcome.INVALID}
        for row in self.rows:
            for name, run in row.runs.items():
                if row.outcome(name) in wrong:
                    notes.append(f"{row.instance.name}, {name}: {run['status']}: {run['message']}")
        return (*notes, *self.sweep_notes)

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; times in seconds, memory in MiB, boxes as exact text."""
        return {
            "schema": SCHEMA,
            "complete": self.complete,
            "agrees": self.agrees,
            "limit_s": self.limit,
            "baseline_limit_s": self.baseline_limit,
            "jobs": self.jobs,
            "notes": list(self.notes),
            "failures": [{"task": one.task.label, "reason": one.reason} for one in self.failures],
            "solved": [
                {
                    "origin": origin.value,
                    "plans": len(self.rows_of(origin)),
                    "methods": {one.name: self.solved(origin, one.name) for one in self.contenders},
                }
                for origin in self.origins
            ],
            "rows": [row.as_dict() for row in self.rows],
        }

    def tables(self) -> list[Table]:
        """Times of every plan, controllability, and how many each method solves."""
        from robust.bench.figure4_tables import figure4_tables  # noqa: PLC0415 - rich only when something is shown

        return figure4_tables(self)


def run_figure4(
    suite: Path | None = None,
    *,
    sizes: Sequence[int] = SIZES,
    seed: int = 0,
    limit: float | None = LIMIT,
    baseline_limit: float | None = LIMIT,
    jobs: int = 1,
    cluster: str | None = None,
    store: Path | None = None,
    plot: Path | None = None,
    on_result: Progress | None = None,
    contenders: Sequence[Contender] = CONTENDERS,
) -> Figure4Report:
    """Run every method on the delivery plans.

    Args:
        suite: the directory of a data set with `robot-delivery/instances.json`; None for our own plans only.
        sizes: numbers of parameters of our own plans.
        seed: which plans of ours.
        limit: seconds after which IRR, exact widening and the questions about controllability end; None never.
        baseline_limit: the same for all other methods.
        jobs: processes at a time; more than one disturbs the timings.
        cluster: the address of a Dask scheduler whose workers run the methods instead.
        store: a file from which an interrupted run resumes.
        plot: where to draw time over parameters (SVG, PNG or PDF by suffix).
        on_result: called after each run with the number done, their total and a line about the run.
        contenders: which methods.

    Returns:
        A report; after Ctrl-C of what is there, marked incomplete.

    Raises:
        InputError: wrong options, or a data set that is missing or malformed.
    """
    for seconds in (limit, baseline_limit):
        check_limit(seconds)
    figures = plotting(plot, "robust.bench.figure4_plot")
    recorded = () if suite is None else recorded_instances(suite)
    instances = (*recorded, *(own_instance(size, seed) for size in sizes))
    if not instances:
        raise InputError("found no plan, expected a data set or sizes")
    tasks = [
        Figure4Task(instance, name, baseline_limit if name in {one.name for one in BASELINE} else limit)
        for instance in instances
        for name in (*(one.name for one in contenders), CONTROLLABILITY)
    ]
    sweep = run_sweep(tasks, do, store=store, jobs=jobs, cluster=cluster, describe=_describe, on_result=on_result)
    report = Figure4Report(
        _rows(instances, sweep.results),
        tuple(contenders),
        sweep.failures,
        sweep.complete,
        limit,
        baseline_limit,
        jobs,
        sweep.notes,
    )
    if figures is not None and plot is not None and report.rows:
        figures.plot_figure4(report, plot)
    return report


def _rows(instances: Sequence[Instance], results: Sequence[tuple[Figure4Task, Any]]) -> tuple[Figure4Row, ...]:
    runs: dict[str, dict[str, Any]] = {}
    for task, result in results:
        runs.setdefault(task.instance.name, {})[task.method] = result
    return tuple(
        Figure4Row(
            one, {name: run for name, run in found.items() if name != CONTROLLABILITY}, found.get(CONTROLLABILITY)
        )
        for one in instances
        if (found := runs.get(one.name))
    )


def _limit(seconds: float | None) -> str:
    return "none" if seconds is None else f"{seconds:g} s"


def _describe(task: Figure4Task, result: Mapping[str, Any]) -> str:
    if task.method == CONTROLLABILITY:
        return f"{task.label}: {result['dynamic'] or result['status']}"
    return f"{task.label}: {result['status']}, {result['seconds']:.2f} s"
