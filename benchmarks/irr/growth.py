"""`robust bench scaling`, `backends`, `encodings` and `widening`: how time grows with the size of generated plans.

Every run is a whole process with a limit of its own. An alternative that has run out of time, or failed, is not tried
on larger plans of the same series. The instances of `scaling` are of the generating-set domain: its actions are not
ordered, every one of them changes the same fluent continuously, and the envelope is not convex.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import Any, ClassVar

from robust.draw.style import BLUE, VERMILION
from robust.json_text import plain
from robust.sweeps.sweep import restored

from ..catalogue import BackendsOptions, EncodingsOptions, ScalingOptions, WideningOptions
from ..engine.experiment import Experiment, Task
from ..engine.measure import COST, FAILURES, Ending, Files, Run
from ..engine.show import NOTHING, OTHER, STYLES, Columns, Panel, Series, Table, family, number
from ..generators.sizes import write_instance, write_unordered
from .contenders import OURS, REGIONS, Contender, ContendersReport, run_cell
from .figure4 import own_instance
from .recorded import envelope_as_dict

NUMBERS: Mapping[str, Callable[[int], tuple[int, int]]] = {
    "refuels": lambda size: (size, 2),
    "parameters": lambda size: (12, size),
}
"""Of refuelings and of parameters, in the series of `scaling`."""
Writer = Callable[[Path, int], Files | tuple[Files, Sequence[str]]]


def write_delivery(directory: Path, parameters: int) -> tuple[Files, Sequence[str]]:
    """A delivery plan with so many uncertain durations."""
    instance = own_instance(parameters, 0)
    return instance.write(directory), instance.options


WRITERS: Mapping[str, Writer] = {
    "more-refuels": lambda directory, size: write_instance(directory, *NUMBERS["refuels"](size)),
    "more-parameters": lambda directory, size: write_instance(directory, *NUMBERS["parameters"](size)),
    "refuels": lambda directory, size: write_instance(directory, max(4, size), size),
    "parameters": lambda directory, size: write_unordered(directory, size, size),
    "points": lambda directory, size: write_unordered(directory, size // 2, 1),
    "all-refuels": lambda directory, size: write_instance(directory, size, size),
    "deliveries": write_delivery,
}
"""How to write plans of any size into a directory, with the options of what plan files cannot say."""


@dataclass(frozen=True, slots=True)
class Ladder:
    """Plans of growing size, written by the writer of that name."""

    name: str
    title: str
    axis: str
    sizes: tuple[int, ...]
    plans: str


_LADDERS = json.loads(Path(__file__).with_name("ladders.json").read_text(encoding="utf-8"))
LADDERS: tuple[Ladder, ...] = restored(_LADDERS, tuple[Ladder, ...])
MORE_REFUELS, MORE_PARAMETERS, REFUELS, PARAMETERS, POINTS, DELIVERIES, ALL_REFUELS = LADDERS
BY_DEFAULT = Contender("irr", "IRR, default schedule", "envelope", ("--method", "irr", "--beta", "1"))
ENCODINGS_BY_NAME = tuple(
    Contender(name, name, "envelope", (*BY_DEFAULT.options, "--encoding", name)) for name in ("relational", "positions")
)


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

    def __str__(self) -> str:
        return "not run" if self.run is None else self.run.line


def run_growth(ladder: Ladder, contender: Contender, size: int, limit: float | None) -> GrowthRow:
    """Generate the plan and run the alternative on it."""
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        made = WRITERS[ladder.plans](Path(directory), size)
        files, extra = made if isinstance(made[0], tuple) else (made, ())
        return GrowthRow(ladder.name, contender.name, size, contender.run(files, limit=limit, extra=extra))


def too_much(task: Task, rows: Sequence[GrowthRow]) -> GrowthRow | None:
    """What was too late, or failed, is not tried any larger."""
    ladder, contender, size, _ = task.given
    series = (ladder.name, contender.name)
    stopped = any((row.series, row.contender) == series and not row.done for row in rows)
    return GrowthRow(*series, size, None) if stopped else None


# -- reports -----------------------------------------------------------------------------------------------------------


class SeriesReport(ContendersReport):
    """All runs, series by series, with a table and a panel for each."""

    SERIES: ClassVar[tuple[Ladder, ...]] = ()

    @property
    def series(self) -> tuple[Ladder, ...]:
        """Those that were asked for."""
        return self.options.series or self.SERIES

    def runs(self, ladder: Ladder, contender: Contender) -> dict[int, Run]:
        """What was tried, by size."""
        rows = self.of(series=ladder.name, contender=contender.name)
        return {row.size: row.run for row in rows if row.run is not None}


COLUMNS: Columns[tuple[Ladder, int, Run]] = {
    "refuels": lambda one: NUMBERS[one[0].name](one[1])[0],
    "parameters": lambda one: NUMBERS[one[0].name](one[1])[1],
    "seconds": lambda one: one[2].cpu_s,
    "search": lambda one: one[2].search_s,
    "checks": lambda one: one[2].checks,
    "queries": lambda one: one[2].queries,
    "MiB": lambda one: number(one[2].memory_mb, 0),
    "status": lambda one: one[2].text,
}


class ScalingReport(SeriesReport):
    """Generated instances of the generating-set domain, β = 1, default schedule (`robust bench scaling`). All figures
    are ours."""

    TITLE = "Scaling"
    SERIES = (MORE_REFUELS, MORE_PARAMETERS)
    CONTENDERS = (BY_DEFAULT,)
    LAYOUT = (4.5, 4, "upper left")

    def sound(self) -> bool:
        """Whether no instance failed: each answer is a box, or came too late."""
        fine = {Ending.COMPLETE, Ending.TIMEOUT}
        return all(row.run is not None and row.run.status in fine for row in self.rows)

    def remarks(self) -> Sequence[str]:
        return ["processor time of whole processes on this machine, search by the clock; β = 1"]

    def printed(self, row: GrowthRow) -> dict[str, Any]:
        refuels, parameters = NUMBERS[row.series](row.size)
        run = {} if row.run is None else envelope_as_dict(row.run)
        return {"series": row.series, "refuels": refuels, "parameters": parameters, **run}

    def contents(self) -> list[Table]:
        rows = {one: [(one, *found) for found in self.runs(one, BY_DEFAULT).items()] for one in self.series}
        return [Table.of(one.title, COLUMNS, found, left=("status",), whole=False) for one, found in rows.items()]

    def panels(self) -> list[Panel]:
        """Seconds over the size of the instance, one panel for each series."""
        return [self._panel(one) for one in self.series]

    def _panel(self, series: Ladder) -> Panel:
        runs = self.runs(series, BY_DEFAULT)
        done = {size: run for size, run in runs.items() if run.complete}
        late = [(size, run.seconds) for size, run in runs.items() if run.status is Ending.TIMEOUT]
        whole = [(size, run.cpu_s) for size, run in done.items()]
        search = [(size, run.search_s) for size, run in done.items() if run.search_s is not None]
        top = 1.1 * max((row.run.seconds for row in self.rows if row.run is not None), default=1)
        lines = [
            Series(whole, "whole process", BLUE, "-", "o", numbers=[str(run.checks) for run in done.values()]),
            Series(search, "search only", BLUE, "--", "s", look={"markerfacecolor": "white"}),
            Series(late, "out of time" if late else None, VERMILION, marker="x", look={"clip_on": False}),
        ]
        axes = {"xticks": list(runs), "ylim": (0, top)}
        return Panel(f"{series.title}\n(numbers: containment checks)", lines, series.axis, "seconds", axes=axes)


class GrowthReport(SeriesReport):
    """Of several alternatives."""

    LAYOUT = (4.4, 4.2, "below")

    def sound(self) -> bool:
        """Whether nothing failed; too late or unsupported is not wrong."""
        return all(row.run is None or row.run.status not in FAILURES for row in self.rows)

    def remarks(self) -> Sequence[str]:
        limit = self.options.limit
        limited = "without a limit" if limit is None else f"stopped at {limit:g} s"
        notes = [
            f"processor seconds of whole processes, {limited} by the clock; what ran out of time is not tried larger"
        ]
        wrong = FAILURES | {Ending.UNSUPPORTED}
        runs = [(row.contender, row.run) for row in self.rows if row.run is not None]
        return [*notes, *(f"{name}: {run.text}" for name, run in runs if run.status in wrong)]

    def findings(self) -> Mapping[str, Any]:
        return {"series": [{"name": one.name, "title": one.title, "axis": one.axis} for one in self.series]}

    def printed(self, row: GrowthRow) -> dict[str, Any]:
        names = (*COST, "polyhedra")
        run = {**dict.fromkeys(names), "status": "not run"} if row.run is None else row.run.printed(*names)
        return {**plain({"series": row.series, "contender": row.contender, "size": row.size}), **run}

    def contents(self) -> list[Table]:
        """For each series, the seconds of each alternative; sizes that nothing was run on are left out."""
        return [self._table(one) for one in self.series]

    def _table(self, ladder: Ladder) -> Table:
        runs = {one.name: self.runs(ladder, one) for one in self.contenders}
        tried = {size for found in runs.values() for size in found}
        seconds: Columns[int] = family("{}", runs, lambda name, size: run_cell(runs[name].get(size)))
        columns: Columns[int] = {ladder.axis: str, **seconds}
        return Table.of(ladder.title, columns, [size for size in ladder.sizes if size in tried], whole=False)

    def panels(self) -> list[Panel]:
        """One panel for each series: seconds over size for each alternative, and where it ran out of time."""
        panels = []
        for one in self.series:
            lines = [line for contender in self.contenders for line in self._lines(one, contender)]
            panels.append(Panel(fill(one.title, 52), lines, f"{one.axis} (×: stopped)", "time", seconds="y"))
        return panels

    def _lines(self, ladder: Ladder, contender: Contender) -> list[Series]:
        colour, line, marker = STYLES.get(contender.name, OTHER)
        runs = self.runs(ladder, contender).items()
        done = [(size, run.cpu_s) for size, run in runs if run.complete]
        late = [(size, run.seconds) for size, run in runs if not run.complete]
        curve = [Series(done, contender.name, colour, line, marker, 4)] if done else []
        return [*curve, Series(late, None, colour, marker="x", size=7, look={"clip_on": False})]


class BackendsReport(GrowthReport):
    """Seconds of `robust region` with each back end (`robust bench backends`)."""

    TITLE = "Elimination back ends"
    SERIES = (REFUELS, PARAMETERS, POINTS)
    CONTENDERS = REGIONS


class EncodingsReport(GrowthReport):
    """Seconds of `robust envelope --method irr` (`robust bench encodings`)."""

    TITLE = "Encodings"
    SERIES = (POINTS,)
    CONTENDERS = ENCODINGS_BY_NAME


class WideningReport(GrowthReport):
    """IRR (β = 1, doubling) and exact widening (`robust bench widening`): processor seconds of whole processes, and the
    share of the search that is spent in the solver."""

    TITLE = "Widening beside IRR"
    SERIES = (DELIVERIES, ALL_REFUELS)
    CONTENDERS = OURS

    def printed(self, row: GrowthRow) -> dict[str, Any]:
        return {**super().printed(row), "solver_s": None if row.run is None else row.run.solver_s}

    def _table(self, ladder: Ladder) -> Table:
        runs = {one.name: self.runs(ladder, one) for one in self.contenders}
        seconds: Columns[int] = family("{}, s", runs, lambda name, size: run_cell(runs[name].get(size)))
        shares: Columns[int] = family("{}, solver", runs, lambda name, size: _share(runs[name].get(size)))
        tried = sorted({size for found in runs.values() for size in found})
        return Table.of(ladder.title, {ladder.axis: str, **seconds, **shares}, tried, whole=False)


def _share(run: Run | None) -> str:
    """Of the search, in solvers."""
    return NOTHING if run is None or run.solver_s is None or not run.search_s else f"{run.solver_s / run.search_s:.0%}"


def _tasks(report: type[SeriesReport], options: ScalingOptions, _: object) -> list[Task]:
    return [
        Task(f"{ladder.name} {size}, {contender.name}", (ladder, contender, size, options.limit))
        for ladder in options.series or report.SERIES
        for size in ladder.sizes
        for contender in getattr(options, "contenders", None) or report.CONTENDERS
    ]


def _experiment(name: str, options: type[ScalingOptions], report: type[SeriesReport], **more: Any) -> Experiment:
    return Experiment(name, options, partial(_tasks, report), run_growth, report, str, **more)


SCALING = _experiment("scaling", ScalingOptions, ScalingReport, unit="instances")
BACKENDS = _experiment("backends", BackendsOptions, BackendsReport, settled=too_much)
ENCODINGS = _experiment("encodings", EncodingsOptions, EncodingsReport, settled=too_much)
WIDENING = _experiment("widening", WideningOptions, WideningReport, settled=too_much)
