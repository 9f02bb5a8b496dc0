"""`robust bench recorded`: every instance of a data set run as a user runs it, beside the recorded runs.

Our figures are measured on this machine, whole processes with start-up and reading; the recorded ones are those of the
recording's machine. What must agree is the answer: the box, fraction by fraction, and the number of checks. Ratios of
times are indicative only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.bench.batch import Progress, run_batch
from robust.bench.options import check_limit, plotting
from robust.bench.process import Processes
from robust.bench.run import EnvelopeRun, Intervals, Outcome, box_as_dict, run_envelope, side_text
from robust.bench.suite import RecordedInstance, read_suite
from robust.irr.box import Side

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "robust/bench-recorded/1"
_ABSENT = "absent"


@dataclass(frozen=True, slots=True)
class Difference:
    """One end of one interval that is not the recorded one; an end is `absent` where the parameter is."""

    parameter: str
    side: Side
    ours: str
    recorded: str

    def __str__(self) -> str:
        return f"{self.parameter} {self.side.value}: {self.ours} instead of {self.recorded}"


@dataclass(frozen=True, slots=True)
class RecordedRow:
    """One instance: our run and the recorded ones."""

    instance: RecordedInstance
    ours: EnvelopeRun

    @property
    def comparable(self) -> bool:
        """Whether there is a recorded box to compare with."""
        return self.instance.box is not None

    @property
    def differences(self) -> tuple[Difference, ...]:
        """The ends that differ; empty where nothing can be compared, because a box is missing on either side."""
        if self.instance.box is None or self.ours.outcome is not Outcome.COMPLETE:
            return ()
        return tuple(_differences(self.ours.box, self.instance.box))

    @property
    def box_agrees(self) -> bool | None:
        """Whether our complete box is the recorded one; None without a recorded box."""
        if not self.comparable:
            return None
        return self.ours.outcome is Outcome.COMPLETE and not self.differences

    @property
    def checks_agree(self) -> bool | None:
        """Whether the same number of rectangles was tried; None without a recorded number."""
        irr = self.instance.irr
        return None if irr is None or irr.checks is None else self.ours.checks == irr.checks

    @property
    def agrees(self) -> bool | None:
        """Whether box and checks agree; None where there is no recorded box."""
        return None if self.box_agrees is None else self.box_agrees and self.checks_agree is not False

    @property
    def verdict(self) -> str:
        """One line about the comparison, for people."""
        if self.ours.outcome is not Outcome.COMPLETE:
            return self.ours.text
        if not self.comparable:
            return "nothing recorded"
        if self.differences:
            return "; ".join(map(str, self.differences))
        if self.checks_agree is False:
            return "equal box, other number of checks"
        return "equal"

    def as_dict(self) -> dict[str, Any]:
        instance = self.instance
        return {
            "instance": instance.name,
            "parameters": len(self.ours.box or instance.box or instance.order),
            "ours": self.ours.as_dict(),
            "recorded": {
                "irr": instance.irr.as_dict() if instance.irr else None,
                "irr_box": None if instance.box is None else box_as_dict(instance.box),
                "ccmmz": instance.ccmmz.as_dict() if instance.ccmmz else None,
            },
            "agrees": self.agrees,
            "box_agrees": self.box_agrees,
            "checks_agree": self.checks_agree,
            "differences": [
                {"parameter": one.parameter, "side": one.side.value, "ours": one.ours, "recorded": one.recorded}
                for one in self.differences
            ],
        }


@dataclass(frozen=True)
class RecordedReport:
    """All rows in the order of the data set; `complete` is false where Ctrl-C came before the last one."""

    suite: Path
    instances: int
    rows: tuple[RecordedRow, ...]
    complete: bool
    limit: float | None
    jobs: int

    @property
    def agrees(self) -> bool:
        """Whether every instance was run, all comparable ones agree, and none ended in an error."""
        sound = all(row.agrees is not False and row.ours.outcome is not Outcome.ERROR for row in self.rows)
        return self.complete and sound

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures has to know."""
        notes = ["ours: measured on this machine, whole processes; recorded: measured on the recording's machine"]
        if self.jobs > 1:
            notes.append(f"{self.jobs} processes ran at a time and disturbed each other's timings")
        if not self.complete:
            notes.append(f"incomplete: interrupted after {len(self.rows)} of {self.instances} instances")
        return tuple(notes)

    @property
    def totals(self) -> dict[str, Any]:
        """Counts over all rows; seconds over the instances that both we and the recorded IRR solved."""
        rows = self.rows
        irr = [row.instance.irr for row in rows]
        ccmmz = [row.instance.ccmmz for row in rows]
        both = [row for row in rows if row.ours.outcome is Outcome.COMPLETE and _recorded_seconds(row) is not None]
        return {
            "instances": self.instances,
            "run": len(rows),
            "compared": sum(row.comparable for row in rows),
            "agreeing": sum(row.agrees is True for row in rows),
            "boxes_equal": sum(row.box_agrees is True for row in rows),
            "checks_equal": sum(row.checks_agree is True for row in rows),
            "solved": {
                "ours": sum(row.ours.outcome is Outcome.COMPLETE for row in rows),
                "irr": sum(run is not None and run.solved for run in irr),
                "ccmmz": sum(run is not None and run.solved for run in ccmmz),
            },
            "timeouts": sum(row.ours.outcome is Outcome.TIMEOUT for row in rows),
            "errors": sum(row.ours.outcome is Outcome.ERROR for row in rows),
            "seconds": {
                "instances": len(both),
                "ours": round(sum(row.ours.seconds for row in both), 2),
                "ours_cpu": round(sum(row.ours.cpu_s for row in both), 2),
                "irr": round(sum(_recorded_seconds(row) or 0.0 for row in both), 2),
            },
            "memory_mb": {"ours": round(max((row.ours.memory_mb for row in rows), default=0.0), 1)},
        }

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; boxes as exact text, times in seconds, memory in MiB."""
        return {
            "schema": SCHEMA,
            "suite": str(self.suite),
            "complete": self.complete,
            "agrees": self.agrees,
            "limit_s": self.limit,
            "jobs": self.jobs,
            "notes": list(self.notes),
            "totals": self.totals,
            "rows": [row.as_dict() for row in self.rows],
        }

    def tables(self) -> list[Table]:
        """One row for each instance, and totals."""
        from robust.bench.tables import recorded_tables  # noqa: PLC0415 - rich only when something is shown

        return recorded_tables(self)


def run_recorded(
    suite: Path,
    *,
    jobs: int = 1,
    limit: float | None = None,
    plot: Path | None = None,
    on_result: Progress | None = None,
) -> RecordedReport:
    """Run every instance of a data set with β = 1, the doubling schedule and the recorded turn order.

    Args:
        suite: the directory of the data set, see :mod:`robust.bench.suite`.
        jobs: processes at a time; more than one disturbs the timings.
        limit: seconds after which an instance is killed; None never.
        plot: where to draw the number of instances solved over time (SVG, PNG or PDF by suffix).
        on_result: called after each instance with the number done, their total and a line about the instance.

    Returns:
        A report; Ctrl-C ends the running processes and returns what is there, marked incomplete.

    Raises:
        InputError: wrong options, or a data set that is missing or malformed.
    """
    check_limit(limit)
    plots = plotting(plot)
    instances = read_suite(suite)
    batch = run_batch(
        len(instances), partial(_run, instances, limit), jobs=jobs, describe=_describe, on_result=on_result
    )
    report = RecordedReport(suite, len(instances), batch.results, batch.complete, limit, jobs)
    if plots is not None and plot is not None and report.rows:
        plots.plot_recorded(report, plot)
    return report


def _run(instances: tuple[RecordedInstance, ...], limit: float | None, processes: Processes, index: int) -> RecordedRow:
    instance = instances[index]
    options = ["--method", "irr", "--beta", "1", "--doubling"]
    if instance.order:
        options.append(f"--order={','.join(instance.order)}")
    return RecordedRow(instance, run_envelope(processes, instance.files, options, limit=limit))


def _describe(row: RecordedRow) -> str:
    return f"{row.instance.name}: {row.verdict}, {row.ours.seconds:.2f} s"


def _recorded_seconds(row: RecordedRow) -> float | None:
    irr = row.instance.irr
    return irr.wall_s if irr is not None and irr.solved else None


def _differences(ours: Intervals, recorded: Intervals) -> Iterator[Difference]:
    for name in {**recorded, **ours}:
        for side in (Side.LOWER, Side.UPPER):
            mine = side_text(ours[name], side) if name in ours else _ABSENT
            theirs = side_text(recorded[name], side) if name in recorded else _ABSENT
            if mine != theirs:
                yield Difference(name, side, mine, theirs)
