"""`robust bench backends` and `robust bench encodings`: how the time of each alternative grows with a plan's size.

Every run is a whole process with a limit of its own. An alternative that has run out of time, or failed, is not tried
on larger plans of the same series.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import Any

from ..catalogue import BackendsOptions, EncodingsOptions
from ..engine.codec import plain
from ..engine.experiment import Experiment, Report
from ..engine.measure import COST, FAILURES, Ending, Run
from ..engine.show import NOTHING, OTHER, STYLES, Cells, Table, canvas, legend_below, seconds_axis
from ..generators.sizes import time_points, write_instance, write_unordered
from .contenders import REGIONS, Contender, run_cell

WRITERS = {
    "refuels": lambda directory, size: write_instance(directory, max(4, size), size),
    "parameters": lambda directory, size: write_unordered(directory, size, size),
    "points": lambda directory, size: write_unordered(directory, size // 2, 1),
}
"""How to write plans of any size into a directory."""


@dataclass(frozen=True, slots=True)
class Ladder:
    """Plans of growing size, written by the writer of that name."""

    name: str
    title: str
    axis: str
    sizes: tuple[int, ...]
    plans: str


REFUELS = Ladder(
    "refuels",
    "Parameters: starts of refuelings (4 or as many as parameters), whose envelope is not convex",
    "parameters",
    tuple(range(1, 7)),
    "refuels",
)
PARAMETERS = Ladder(
    "parameters",
    "Parameters: as many unordered jobs as parameters",
    "parameters",
    tuple(range(1, 9)),
    "parameters",
)
POINTS = Ladder(
    "points",
    "Unordered time points: jobs in any order, 1 parameter",
    "unordered time points",
    tuple(time_points(jobs) for jobs in (1, 2, 3, 4, 6, 8, 12, 16)),
    "points",
)
ENCODINGS_BY_NAME = tuple(
    Contender(name, name, "envelope", ("--method", "irr", "--beta", "1", "--encoding", name))
    for name in ("relational", "positions")
)


@dataclass(frozen=True, slots=True)
class GrowthTask:
    """One alternative on one plan."""

    ladder: Ladder
    contender: Contender
    size: int
    limit: float | None

    @property
    def label(self) -> str:
        return f"{self.ladder.name} {self.size}, {self.contender.name}"


@dataclass(frozen=True, slots=True)
class GrowthRow:
    """One alternative on one plan; `run` is None where it was not tried, because a smaller one was too much already."""

    series: str
    contender: str
    size: int
    run: Run | None

    @property
    def done(self) -> bool:
        return self.run is not None and self.run.complete


def run_growth(task: GrowthTask) -> GrowthRow:
    """Generate the plan and run the alternative on it."""
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        files = WRITERS[task.ladder.plans](Path(directory), task.size)
        return GrowthRow(task.ladder.name, task.contender.name, task.size, task.contender.run(files, limit=task.limit))


def too_much(task: GrowthTask, rows: Sequence[GrowthRow]) -> GrowthRow | None:
    """What was too late, or failed, is not tried any larger."""
    series = (task.ladder.name, task.contender.name)
    stopped = any((row.series, row.contender) == series and not row.done for row in rows)
    return GrowthRow(*series, task.size, None) if stopped else None


class GrowthReport(Report[GrowthRow]):
    """All runs, series by series."""

    TITLE = ""
    LADDERS: tuple[Ladder, ...] = ()
    CONTENDERS: tuple[Contender, ...] = ()

    @property
    def ladders(self) -> tuple[Ladder, ...]:
        return self.options.series or self.LADDERS

    @property
    def contenders(self) -> tuple[Contender, ...]:
        return self.options.contenders or self.CONTENDERS

    def row(self, ladder: Ladder, contender: Contender, size: int) -> GrowthRow | None:
        return next((row for row in self.rows_of(ladder, contender) if row.size == size), None)

    def rows_of(self, ladder: Ladder, contender: Contender) -> list[GrowthRow]:
        return [row for row in self.rows if (row.series, row.contender) == (ladder.name, contender.name)]

    @property
    def agrees(self) -> bool:
        """Whether everything was run and nothing failed; too late or unsupported is not wrong."""
        return self.complete and all(row.run is None or row.run.status not in FAILURES for row in self.rows)

    @property
    def notes(self) -> tuple[str, ...]:
        limit = self.options.limit
        limited = "without a limit" if limit is None else f"stopped at {limit:g} s"
        notes = [f"seconds of whole processes on this machine, {limited}; what ran out of time is not tried any larger"]
        wrong = FAILURES | {Ending.UNSUPPORTED}
        bad = [row for row in self.rows if row.run is not None and row.run.status in wrong]
        notes += dict.fromkeys(f"{row.contender}: {row.run.text}" for row in bad if row.run is not None)
        notes += self.jobs_notes
        if not self.complete:
            notes.append(f"incomplete: interrupted after {len(self.rows)} of {self.total} runs")
        return tuple(notes)

    @property
    def findings(self) -> Mapping[str, Any]:
        return {"series": [{"name": one.name, "title": one.title, "axis": one.axis} for one in self.ladders]}

    def printed(self, row: GrowthRow) -> dict[str, Any]:
        names = (*COST, "polyhedra")
        run = {**dict.fromkeys(names), "status": "not run"} if row.run is None else row.run.printed(*names)
        return {**plain({"series": row.series, "contender": row.contender, "size": row.size}), **run}

    def table(self, ladder: Ladder, *notes: str) -> Table:
        """For each size, the seconds of each alternative; sizes that nothing was run on are left out."""
        headings = (ladder.axis, *(contender.name for contender in self.contenders))
        rows: list[Cells] = []
        for size in ladder.sizes:
            found = [self.row(ladder, contender, size) for contender in self.contenders]
            if any(row is not None and row.run is not None for row in found):
                rows.append((str(size), *(NOTHING if row is None else run_cell(row.run) for row in found)))
        return Table(ladder.title, headings, rows, notes, whole=False)

    @property
    def tables(self) -> list[Table]:
        """One table for each series."""
        *others, last = self.ladders
        return [*map(self.table, others), self.table(last, *self.notes)]

    def draw(self, path: Path) -> None:
        """One panel for each series: seconds over size for each alternative, and where it ran out of time."""
        with canvas(path, max(5.5, 4.4 * len(self.ladders)), 4.2, len(self.ladders)) as (figure, panels):
            for axes, ladder in zip(panels, self.ladders, strict=True):
                for contender in self.contenders:
                    colour, line, marker = STYLES.get(contender.name, OTHER)
                    runs = [(row.size, row.run) for row in self.rows_of(ladder, contender) if row.run is not None]
                    done = [(size, run.seconds) for size, run in runs if run.complete]
                    if done:
                        style: dict[str, Any] = {"color": colour, "linestyle": line, "marker": marker, "markersize": 4}
                        axes.plot(*zip(*done, strict=True), label=contender.name, **style)
                    late = [(size, run.seconds) for size, run in runs if not run.complete]
                    for size, seconds in late:
                        axes.plot([size], [seconds], "x", color=colour, markersize=7, clip_on=False)
                seconds_axis(axes)
                axes.set_xlabel(f"{ladder.axis} (×: stopped)")
                axes.set_title(fill(ladder.title, 52), fontsize=8, loc="left")
            panels[0].set_ylabel("time")
            legend_below(figure, panels)


class BackendsReport(GrowthReport):
    """Elimination back ends."""

    TITLE = "Elimination back ends"
    LADDERS = (REFUELS, PARAMETERS, POINTS)
    CONTENDERS = REGIONS


class EncodingsReport(GrowthReport):
    """Encodings."""

    TITLE = "Encodings"
    LADDERS = (POINTS,)
    CONTENDERS = ENCODINGS_BY_NAME


def _describe(task: GrowthTask, row: GrowthRow) -> str:
    return f"{task.label}: " + ("not run" if row.run is None else f"{row.run.text}, {row.run.seconds:.2f} s")


def _experiment(name: str, options: type[BackendsOptions], report: type[GrowthReport]) -> Experiment:
    def tasks(chosen: BackendsOptions, _: object) -> list[GrowthTask]:
        return [
            GrowthTask(ladder, contender, size, chosen.limit)
            for ladder in chosen.series or report.LADDERS
            for size in ladder.sizes
            for contender in chosen.contenders or report.CONTENDERS
        ]

    return Experiment(name, options, tasks, run_growth, GrowthRow, report, _describe, settled=too_much)


BACKENDS = _experiment("backends", BackendsOptions, BackendsReport)
ENCODINGS = _experiment("encodings", EncodingsOptions, EncodingsReport)
