"""`robust bench scaling`: how time grows with the number of actions and of parameters.

Instances of the generating-set domain: its actions are not ordered, every one of them changes the same fluent
continuously, and the envelope is not convex. Each is run as a whole process with β = 1 and the default schedule of IRR.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Protocol

from robust.bench.batch import Progress, run_batch
from robust.bench.generator import write_instance
from robust.bench.options import check_limit, plotting
from robust.bench.process import Processes
from robust.bench.run import EnvelopeRun, Outcome, run_envelope

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "robust/bench-scaling/1"


class _Sized(Protocol):
    @property
    def refuels(self) -> int: ...
    @property
    def parameters(self) -> int: ...


@dataclass(frozen=True, slots=True)
class Point:
    """The size of one instance."""

    refuels: int
    parameters: int


@dataclass(frozen=True, slots=True)
class Series:
    """Instances of which one size grows: `axis` is `refuels` or `parameters`."""

    name: str
    title: str
    axis: str
    points: tuple[Point, ...]

    def size(self, sized: _Sized) -> int:
        """The size that grows."""
        return sized.refuels if self.axis == "refuels" else sized.parameters


SERIES = (
    Series(
        "refuels",
        "More actions: refuelings with 2 parameters",
        "refuels",
        tuple(Point(refuels, 2) for refuels in (5, 10, 15, 20, 30, 40)),
    ),
    Series(
        "parameters",
        "More parameters: 12 refuelings",
        "parameters",
        tuple(Point(12, parameters) for parameters in (1, 2, 4, 6, 8, 10, 12)),
    ),
)


@dataclass(frozen=True, slots=True)
class ScalingRow:
    """One instance of a series and our run."""

    series: str
    refuels: int
    parameters: int
    ours: EnvelopeRun

    def as_dict(self) -> dict[str, Any]:
        sizes = {"series": self.series, "refuels": self.refuels, "parameters": self.parameters}
        return {**sizes, **self.ours.as_dict()}


@dataclass(frozen=True)
class ScalingReport:
    """All rows, series by series; `complete` is false where Ctrl-C came before the last one."""

    series: tuple[Series, ...]
    rows: tuple[ScalingRow, ...]
    complete: bool
    limit: float | None
    jobs: int

    def rows_of(self, series: Series) -> tuple[ScalingRow, ...]:
        return tuple(row for row in self.rows if row.series == series.name)

    @property
    def agrees(self) -> bool:
        """Whether every instance was run and none failed: each answer is a box, or came too late."""
        expected = {Outcome.COMPLETE, Outcome.TIMEOUT}
        return self.complete and all(row.ours.outcome in expected for row in self.rows)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures has to know."""
        notes = ["measured on this machine, whole processes; β = 1"]
        if self.jobs > 1:
            notes.append(f"{self.jobs} processes ran at a time and disturbed each other's timings")
        if not self.complete:
            total = sum(len(series.points) for series in self.series)
            notes.append(f"incomplete: interrupted after {len(self.rows)} of {total} instances")
        return tuple(notes)

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; boxes as exact text, times in seconds, memory in MiB."""
        return {
            "schema": SCHEMA,
            "complete": self.complete,
            "agrees": self.agrees,
            "limit_s": self.limit,
            "jobs": self.jobs,
            "notes": list(self.notes),
            "rows": [row.as_dict() for row in self.rows],
        }

    def tables(self) -> list[Table]:
        """One table for each series."""
        from robust.bench.tables import scaling_tables  # noqa: PLC0415 - rich only when something is shown

        return scaling_tables(self)


def run_scaling(
    *,
    limit: float | None = None,
    jobs: int = 1,
    plot: Path | None = None,
    on_result: Progress | None = None,
    series: Sequence[Series] = SERIES,
) -> ScalingReport:
    """Run generated instances of growing size.

    Args:
        limit: seconds after which an instance is killed; None never.
        jobs: processes at a time; more than one disturbs the timings.
        plot: where to draw seconds over size (SVG, PNG or PDF by suffix).
        on_result: called after each instance with the number done, their total and a line about the instance.
        series: the sizes.

    Returns:
        A report; Ctrl-C ends the running processes and returns what is there, marked incomplete.

    Raises:
        InputError: wrong options.
    """
    check_limit(limit)
    plots = plotting(plot)
    points = [(one.name, point) for one in series for point in one.points]
    with TemporaryDirectory(prefix="robust-scaling-") as directory:
        files = [write_instance(Path(directory), point.refuels, point.parameters) for _, point in points]
        work = partial(_run, points, files, limit)
        batch = run_batch(len(points), work, jobs=jobs, describe=_describe, on_result=on_result)
    report = ScalingReport(tuple(series), batch.results, batch.complete, limit, jobs)
    if plots is not None and plot is not None and report.rows:
        plots.plot_scaling(report, plot)
    return report


def _run(
    points: Sequence[tuple[str, Point]],
    files: Sequence[tuple[Path, Path, Path]],
    limit: float | None,
    processes: Processes,
    index: int,
) -> ScalingRow:
    name, point = points[index]
    run = run_envelope(processes, files[index], ["--method", "irr", "--beta", "1"], limit=limit)
    return ScalingRow(name, point.refuels, point.parameters, run)


def _describe(row: ScalingRow) -> str:
    return f"{row.refuels} refuels, {row.parameters} parameters: {row.ours.outcome.value}, {row.ours.seconds:.2f} s"
