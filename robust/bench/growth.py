"""`robust bench backends` and `robust bench encodings`: how the time of each alternative grows with a plan's size.

Every run is a whole process with a limit of its own. An alternative that has run out of time, or failed, is not tried
on larger plans of the same series.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import TYPE_CHECKING, Any

from robust.bench.batch import Progress, run_batch
from robust.bench.contenders import REGIONS, Contender, RegionRun, Run, cost_as_dict
from robust.bench.generator import write_instance
from robust.bench.options import check_limit, plotting
from robust.bench.process import Processes
from robust.bench.run import Outcome
from robust.bench.unordered import time_points, write_unordered

if TYPE_CHECKING:
    from rich.table import Table

LIMIT = 10.0
Files = tuple[Path, Path, Path]


@dataclass(frozen=True, slots=True)
class Ladder:
    """Plans of growing size: how to write one, and the sizes."""

    name: str
    title: str
    axis: str
    sizes: tuple[int, ...]
    write: Callable[[Path, int], Files]


def _one_parameter(directory: Path, points: int) -> Files:
    return write_unordered(directory, points // 2, 1)


def _all_parameters(directory: Path, parameters: int) -> Files:
    return write_unordered(directory, parameters, parameters)


def _refuels(directory: Path, parameters: int) -> Files:
    return write_instance(directory, max(4, parameters), parameters)


REFUELS = Ladder(
    "refuels",
    "Parameters: starts of refuelings (4 or as many as parameters), whose envelope is not convex",
    "parameters",
    tuple(range(1, 7)),
    _refuels,
)
PARAMETERS = Ladder(
    "parameters",
    "Parameters: as many unordered jobs as parameters",
    "parameters",
    tuple(range(1, 9)),
    _all_parameters,
)
POINTS = Ladder(
    "points",
    "Unordered time points: jobs in any order, 1 parameter",
    "unordered time points",
    tuple(time_points(jobs) for jobs in (1, 2, 3, 4, 6, 8, 12, 16)),
    _one_parameter,
)
BACKEND_LADDERS = (REFUELS, PARAMETERS, POINTS)
ENCODING_LADDERS = (POINTS,)
ENCODINGS = tuple(
    Contender(name, name, "envelope", ("--method", "irr", "--beta", "1", "--encoding", name))
    for name in ("relational", "positions")
)


@dataclass(frozen=True, slots=True)
class GrowthRow:
    """One alternative on one plan; `run` is None where it was not tried, because a smaller one was too much already."""

    ladder: str
    contender: str
    size: int
    run: Run | None

    @property
    def done(self) -> bool:
        return self.run is not None and self.run.outcome is Outcome.COMPLETE

    def as_dict(self) -> dict[str, Any]:
        place = {"series": self.ladder, "contender": self.contender, "size": self.size}
        if self.run is None:
            nothing = dict.fromkeys(("seconds", "cpu_s", "memory_mb", "search_s", "message", "polyhedra"))
            return {**place, "status": "not run", **nothing}
        polyhedra = self.run.polyhedra if isinstance(self.run, RegionRun) else None
        return {**place, **cost_as_dict(self.run), "polyhedra": polyhedra}


@dataclass(frozen=True)
class GrowthReport:
    """All rows, series by series; `complete` is false where Ctrl-C came before the last one."""

    schema: str
    title: str
    ladders: tuple[Ladder, ...]
    contenders: tuple[Contender, ...]
    rows: tuple[GrowthRow, ...]
    complete: bool
    limit: float | None
    jobs: int

    def row(self, ladder: Ladder, contender: Contender, size: int) -> GrowthRow | None:
        place = (ladder.name, contender.name, size)
        return next((row for row in self.rows if (row.ladder, row.contender, row.size) == place), None)

    def rows_of(self, ladder: Ladder, contender: Contender) -> tuple[GrowthRow, ...]:
        return tuple(row for row in self.rows if row.ladder == ladder.name and row.contender == contender.name)

    @property
    def agrees(self) -> bool:
        """Whether everything was run and nothing failed; too late or unsupported is not wrong."""
        failures = {Outcome.ERROR, Outcome.INVALID}
        return self.complete and all(row.run is None or row.run.outcome not in failures for row in self.rows)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures has to know."""
        limit = "without a limit" if self.limit is None else f"stopped at {self.limit:g} s"
        notes = [f"seconds of whole processes on this machine, {limit}; what ran out of time is not tried any larger"]
        for message in dict.fromkeys(_complaint(row) for row in self.rows):
            if message:
                notes.append(message)
        if self.jobs > 1:
            notes.append(f"{self.jobs} processes ran at a time and disturbed each other's timings")
        if not self.complete:
            total = len(self.contenders) * sum(len(ladder.sizes) for ladder in self.ladders)
            notes.append(f"incomplete: interrupted after {len(self.rows)} of {total} runs")
        return tuple(notes)

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; times in seconds, memory in MiB."""
        return {
            "schema": self.schema,
            "complete": self.complete,
            "agrees": self.agrees,
            "limit_s": self.limit,
            "jobs": self.jobs,
            "notes": list(self.notes),
            "series": [{"name": one.name, "title": one.title, "axis": one.axis} for one in self.ladders],
            "rows": [row.as_dict() for row in self.rows],
        }

    def tables(self) -> list[Table]:
        """One table for each series."""
        from robust.bench.figure_tables import growth_tables  # noqa: PLC0415 - rich only when something is shown

        return growth_tables(self)


def run_backends(
    *,
    limit: float | None = LIMIT,
    jobs: int = 1,
    plot: Path | None = None,
    on_result: Progress | None = None,
    ladders: Sequence[Ladder] = BACKEND_LADDERS,
    contenders: Sequence[Contender] = REGIONS,
) -> GrowthReport:
    """Run `robust region` with every elimination back end on generated plans of growing size.

    Args:
        limit: seconds after which a run is killed; None never.
        jobs: processes at a time; more than one disturbs the timings.
        plot: where to draw seconds over size (SVG, PNG or PDF by suffix).
        on_result: called after each run with the number done, their total and a line about the run.
        ladders: the plans.
        contenders: what to run.

    Returns:
        A report; Ctrl-C ends the running processes and returns what is there, marked incomplete.

    Raises:
        InputError: wrong options.
    """
    study = _Study("robust/bench-backends/1", "Elimination back ends", tuple(ladders), tuple(contenders), limit)
    return study.report(jobs, plot, on_result)


def run_encodings(
    *,
    limit: float | None = LIMIT,
    jobs: int = 1,
    plot: Path | None = None,
    on_result: Progress | None = None,
    ladders: Sequence[Ladder] = ENCODING_LADDERS,
    contenders: Sequence[Contender] = ENCODINGS,
) -> GrowthReport:
    """Run IRR in both encodings on generated plans with more and more unordered time points.

    The arguments, the report and the errors are those of :func:`run_backends`.
    """
    study = _Study("robust/bench-encodings/1", "Encodings", tuple(ladders), tuple(contenders), limit)
    return study.report(jobs, plot, on_result)


@dataclass
class _Study:
    """The runs of one report, smallest plans first; remembers from which size on an alternative is not tried."""

    schema: str
    title: str
    ladders: tuple[Ladder, ...]
    contenders: tuple[Contender, ...]
    limit: float | None
    _lock: Lock = field(default_factory=Lock)
    _stopped: set[tuple[str, str]] = field(default_factory=set)

    def report(self, jobs: int, plot: Path | None, on_result: Progress | None) -> GrowthReport:
        check_limit(self.limit)
        figures = plotting(plot, "robust.bench.figures")
        with TemporaryDirectory(prefix="robust-bench-") as directory:
            points = [
                (ladder, contender, size, ladder.write(Path(directory) / ladder.name, size))
                for ladder in self.ladders
                for size in ladder.sizes
                for contender in self.contenders
            ]
            batch = run_batch(
                len(points), partial(self._run, points), jobs=jobs, describe=_describe, on_result=on_result
            )
        report = GrowthReport(
            self.schema, self.title, self.ladders, self.contenders, batch.results, batch.complete, self.limit, jobs
        )
        if figures is not None and plot is not None and report.rows:
            figures.plot_growth(report, plot)
        return report

    def _run(
        self, points: Sequence[tuple[Ladder, Contender, int, Files]], processes: Processes, index: int
    ) -> GrowthRow:
        ladder, contender, size, files = points[index]
        series = (ladder.name, contender.name)
        with self._lock:
            if series in self._stopped:
                return GrowthRow(*series, size, None)
        row = GrowthRow(*series, size, contender.run(processes, files, limit=self.limit))
        if not row.done:
            with self._lock:
                self._stopped.add(series)
        return row


def _describe(row: GrowthRow) -> str:
    ended = "not run" if row.run is None else f"{row.run.text}, {row.run.seconds:.2f} s"
    return f"{row.ladder} {row.size}, {row.contender}: {ended}"


def _complaint(row: GrowthRow) -> str | None:
    if row.run is None or row.run.outcome not in {Outcome.ERROR, Outcome.UNSUPPORTED, Outcome.INVALID}:
        return None
    return f"{row.contender}: {row.run.text}"
