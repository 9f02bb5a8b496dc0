"""`robust bench scaling`: how time grows with the number of actions and of parameters.

Instances of the generating-set domain: its actions are not ordered, every one of them changes the same fluent
continuously, and the envelope is not convex. Each is run as a whole process with β = 1 and the default schedule of IRR.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..catalogue import ScalingOptions
from ..engine.experiment import Experiment, Report, Results
from ..engine.measure import Ending, Run, run_robust
from ..engine.show import BLUE, ORANGE, Table, canvas, count, number
from ..generators.sizes import write_instance
from .recorded import envelope_as_dict


@dataclass(frozen=True, slots=True)
class Series:
    """Instances of which one size grows, the number of `refuels` or of `parameters`; `points` are both sizes."""

    name: str
    title: str
    points: tuple[tuple[int, int], ...]


SERIES = (
    Series(
        "refuels",
        "More actions: refuelings with 2 parameters",
        tuple((refuels, 2) for refuels in (5, 10, 15, 20, 30, 40)),
    ),
    Series(
        "parameters",
        "More parameters: 12 refuelings",
        tuple((12, parameters) for parameters in (1, 2, 4, 6, 8, 10, 12)),
    ),
)


@dataclass(frozen=True, slots=True)
class ScalingTask:
    """One instance of a series."""

    series: str
    refuels: int
    parameters: int
    limit: float | None

    @property
    def label(self) -> str:
        return f"{self.refuels} refuels, {self.parameters} parameters"


def run_size(task: ScalingTask) -> Run:
    """Generate the instance and run it."""
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        files = write_instance(Path(directory), task.refuels, task.parameters)
        return run_robust("envelope", files, ["--method", "irr", "--beta", "1"], limit=task.limit)


@dataclass(frozen=True, slots=True)
class ScalingRow:
    """One instance of a series and our run."""

    series: str
    refuels: int
    parameters: int
    ours: Run

    @property
    def size(self) -> int:
        """The size that grows in its series."""
        return self.refuels if self.series == "refuels" else self.parameters


class ScalingReport(Report[ScalingRow]):
    """All instances, series by series."""

    @property
    def series(self) -> tuple[Series, ...]:
        return self.options.series or SERIES

    def rows_of(self, series: Series) -> list[ScalingRow]:
        return [row for row in self.rows if row.series == series.name]

    @property
    def agrees(self) -> bool:
        """Whether every instance was run and none failed: each answer is a box, or came too late."""
        expected = {Ending.COMPLETE, Ending.TIMEOUT}
        return self.complete and all(row.ours.status in expected for row in self.rows)

    @property
    def notes(self) -> tuple[str, ...]:
        notes = ["measured on this machine, whole processes; β = 1", *self.jobs_notes]
        if not self.complete:
            notes.append(f"incomplete: interrupted after {len(self.rows)} of {self.total} instances")
        return tuple(notes)

    def printed(self, row: ScalingRow) -> dict[str, Any]:
        sizes: Mapping[str, Any] = {"series": row.series, "refuels": row.refuels, "parameters": row.parameters}
        return {**sizes, **envelope_as_dict(row.ours)}

    def table(self, series: Series, *notes: str) -> Table:
        rows = [
            (
                str(row.refuels),
                str(row.parameters),
                number(row.ours.seconds),
                number(row.ours.search_s),
                count(row.ours.checks),
                count(row.ours.queries),
                number(row.ours.memory_mb, 0),
                row.ours.text,
            )
            for row in self.rows_of(series)
        ]
        headings = ("refuels", "parameters", "seconds", "search", "checks", "queries", "MiB", "status")
        return Table(series.title, headings, rows, notes, align=">>>>>>><", whole=False)

    @property
    def tables(self) -> list[Table]:
        """One table for each series."""
        *others, last = self.series
        return [*map(self.table, others), self.table(last, *self.notes)]

    def draw(self, path: Path) -> None:
        """Seconds over the size of the instance, one panel for each series."""
        with canvas(path, 9, 4, len(self.series)) as (_, panels):
            for axes, series in zip(panels, self.series, strict=True):
                rows = self.rows_of(series)
                done = [row for row in rows if row.ours.complete]
                late = [row for row in rows if row.ours.status is Ending.TIMEOUT]
                sizes = [row.size for row in done]
                axes.plot(sizes, [row.ours.seconds for row in done], "o-", color=BLUE, label="whole process")
                searches = [float("nan") if row.ours.search_s is None else row.ours.search_s for row in done]
                axes.plot(sizes, searches, "s--", color=BLUE, markerfacecolor="white", label="search only")
                if late:
                    times = [row.ours.seconds for row in late]
                    axes.plot([row.size for row in late], times, "x", color=ORANGE, label="out of time", clip_on=False)
                for row in done:
                    place, text = (row.size, row.ours.seconds), str(row.ours.checks)
                    axes.annotate(text, place, (0, 6), textcoords="offset points", ha="center", fontsize=7)
                axes.set_title(f"{series.title}\n(numbers: containment checks)", fontsize=9, loc="left")
                axes.set(xlabel=series.name, xticks=[row.size for row in rows])
            panels[0].set_ylim(0, 1.1 * max(row.ours.seconds for row in self.rows))
            panels[0].set_ylabel("seconds")
            panels[0].legend(loc="upper left", fontsize=8, framealpha=1)


def _tasks(options: ScalingOptions, _: object) -> list[ScalingTask]:
    sizes = [(one.name, *point) for one in options.series or SERIES for point in one.points]
    return [ScalingTask(name, refuels, parameters, options.limit) for name, refuels, parameters in sizes]


def _rows(_options: ScalingOptions, _facts: object, results: Results) -> list[ScalingRow]:
    return [ScalingRow(task.series, task.refuels, task.parameters, run) for task, run in results]


SCALING = Experiment(
    "scaling",
    ScalingOptions,
    _tasks,
    run_size,
    Run,
    ScalingReport,
    lambda task, run: f"{task.label}: {run.status.value}, {run.seconds:.2f} s",
    collect=_rows,
)
