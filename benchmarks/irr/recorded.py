"""`robust bench recorded`: every instance of a data set run as a user runs it, beside the recorded runs.

Our figures are measured on this machine, whole processes with start-up and reading; the recorded ones are those of the
recording's machine. What must agree is the answer: the box, fraction by fraction, and the number of checks. Ratios of
times are indicative only.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from ..catalogue import RecordedOptions
from ..engine.codec import plain
from ..engine.experiment import Experiment, Report, Results
from ..engine.measure import Ending, Run, ends_of, run_robust
from ..engine.show import AMBER, BLUE, GREEN, NOTHING, SHORTEST, Cells, Table, canvas, count, number, seconds_axis
from ..suite import RecordedInstance, read_suite
from .contenders import IRR

OURS = "status seconds cpu_s memory_mb checks queries search_s first_widening_s first_widening_wall_s box message"
_ABSENT = "absent"


@dataclass(frozen=True, slots=True)
class RecordedTask:
    """One instance, with `limit` seconds."""

    instance: RecordedInstance
    limit: float | None

    @property
    def label(self) -> str:
        return self.instance.name


def run_instance(task: RecordedTask) -> Run:
    """Run an instance with β = 1, the doubling schedule and the recorded turn order."""
    return run_robust("envelope", task.instance.files, [*IRR.options, *task.instance.order_options], limit=task.limit)


def envelope_as_dict(run: Run) -> dict[str, Any]:
    """A run of `robust envelope` as JSON."""
    return {**run.printed(*OURS.split()), "box": plain(run.box or {})}


@dataclass(frozen=True, slots=True)
class Difference:
    """One end of one interval that is not the recorded one; an end is `absent` where the parameter is."""

    parameter: str
    side: str
    ours: str
    recorded: str

    def __str__(self) -> str:
        return f"{self.parameter} {self.side}: {self.ours} instead of {self.recorded}"


@dataclass(frozen=True)
class RecordedRow:
    """One instance: our run and the recorded ones."""

    instance: RecordedInstance
    ours: Run

    @cached_property
    def recorded_box(self) -> Mapping[str, tuple[str, str]] | None:
        """As exact text."""
        box = self.instance.box
        return None if box is None else {name: ends_of(interval) for name, interval in box.intervals.items()}

    @property
    def differences(self) -> tuple[Difference, ...]:
        """The ends that differ; empty where nothing can be compared, because a box is missing on either side."""
        if self.recorded_box is None or not self.ours.complete:
            return ()
        return tuple(_differences(self.ours.box or {}, self.recorded_box))

    @property
    def box_agrees(self) -> bool | None:
        """Whether our complete box is the recorded one; None without a recorded box."""
        return None if self.recorded_box is None else self.ours.complete and not self.differences

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
        if not self.ours.complete:
            return self.ours.text
        if self.recorded_box is None:
            return "nothing recorded"
        if self.differences:
            return "; ".join(map(str, self.differences))
        return "equal box, other number of checks" if self.checks_agree is False else "equal"

    @property
    def recorded_seconds(self) -> float | None:
        """Of IRR, if it solved the instance."""
        irr = self.instance.irr
        return irr.wall_s if irr is not None and irr.solved else None

    @property
    def cells(self) -> Cells:
        """Name, seconds, first widening, checks, memory (ours / recorded IRR / recorded CCMMZ) and the verdict."""
        ours, irr, ccmmz = self.ours, self.instance.irr, self.instance.ccmmz
        recorded = [
            (run.wall_s if run.solved else None, run.status) if run else (None, NOTHING) for run in (irr, ccmmz)
        ]
        seconds = [number(value) if value is not None else status for value, status in recorded]
        memory = [number(run.memory_mb if run else None, 0) for run in (irr, ccmmz)]
        return (
            self.instance.name,
            " / ".join([number(ours.seconds), *seconds]),
            f"{number(ours.first_widening_wall_s)} / {number(irr.first_widening_s if irr else None)}",
            f"{count(ours.checks)} / {count(irr.checks if irr else None)}",
            " / ".join([number(ours.memory_mb, 0), *memory]),
            self.verdict,
        )


def _differences(ours: Mapping[str, Sequence[str]], recorded: Mapping[str, Sequence[str]]) -> Iterator[Difference]:
    for name in {**recorded, **ours}:
        for place, side in enumerate(("lower", "upper")):
            mine, theirs = (box[name][place] if name in box else _ABSENT for box in (ours, recorded))
            if mine != theirs:
                yield Difference(name, side, mine, theirs)


class RecordedReport(Report[RecordedRow]):
    """All instances in the order of the data set."""

    SETTINGS: ClassVar[Mapping[str, str]] = {"suite": "suite", **Report.SETTINGS}

    @property
    def agrees(self) -> bool:
        """Whether every instance was run, all comparable ones agree, and none ended in an error."""
        return self.complete and all(
            row.agrees is not False and row.ours.status is not Ending.ERROR for row in self.rows
        )

    @property
    def notes(self) -> tuple[str, ...]:
        notes = ["ours: measured on this machine, whole processes; recorded: measured on the recording's machine"]
        notes += self.jobs_notes
        if not self.complete:
            notes.append(f"incomplete: interrupted after {len(self.rows)} of {self.total} instances")
        return tuple(notes)

    @cached_property
    def totals(self) -> dict[str, Any]:
        """Counts over all rows; seconds over the instances that both we and the recorded IRR solved."""
        rows = self.rows
        both = [row for row in rows if row.ours.complete and row.recorded_seconds is not None]
        return {
            "instances": self.total,
            "run": len(rows),
            "compared": sum(row.recorded_box is not None for row in rows),
            "agreeing": sum(row.agrees is True for row in rows),
            "boxes_equal": sum(row.box_agrees is True for row in rows),
            "checks_equal": sum(row.checks_agree is True for row in rows),
            "solved": {
                "ours": sum(row.ours.complete for row in rows),
                "irr": sum(row.instance.irr is not None and row.instance.irr.solved for row in rows),
                "ccmmz": sum(row.instance.ccmmz is not None and row.instance.ccmmz.solved for row in rows),
            },
            "timeouts": sum(row.ours.status is Ending.TIMEOUT for row in rows),
            "errors": sum(row.ours.status is Ending.ERROR for row in rows),
            "seconds": {
                "instances": len(both),
                "ours": round(sum(row.ours.seconds for row in both), 2),
                "ours_cpu": round(sum(row.ours.cpu_s for row in both), 2),
                "irr": round(sum(row.recorded_seconds or 0.0 for row in both), 2),
            },
            "memory_mb": {"ours": round(max((row.ours.memory_mb for row in rows), default=0.0), 1)},
        }

    @property
    def findings(self) -> Mapping[str, Any]:
        return {"totals": self.totals}

    def printed(self, row: RecordedRow) -> dict[str, Any]:
        instance = row.instance
        return {
            "instance": instance.name,
            "parameters": len(row.ours.box or row.recorded_box or instance.order),
            "ours": envelope_as_dict(row.ours),
            "recorded": {
                "irr": plain(instance.irr),
                "irr_box": plain(row.recorded_box),
                "ccmmz": plain(instance.ccmmz),
            },
            "agrees": row.agrees,
            "box_agrees": row.box_agrees,
            "checks_agree": row.checks_agree,
            "differences": plain(row.differences),
        }

    @property
    def tables(self) -> list[Table]:
        """Ours beside the recorded runs, and totals."""
        totals = self.totals
        solved, seconds = totals["solved"], totals["seconds"]
        facts = (
            ("instances run", f"{totals['run']} of {totals['instances']}"),
            ("agreeing in box and checks", f"{totals['agreeing']} of {totals['compared']} with a recorded box"),
            ("solved", f"ours {solved['ours']}, recorded IRR {solved['irr']}, recorded CCMMZ {solved['ccmmz']}"),
            ("out of time, errors", f"{totals['timeouts']}, {totals['errors']}"),
            (
                f"seconds for {seconds['instances']} solved by both",
                f"ours {number(seconds['ours'])} (processor {number(seconds['ours_cpu'])}), "
                f"recorded IRR {number(seconds['irr'])}",
            ),
            ("greatest memory", f"ours {number(totals['memory_mb']['ours'], 0)} MiB"),
        )
        return [
            Table(
                "Ours / recorded IRR / recorded CCMMZ",
                ("instance", "seconds", "first widening", "checks", "MiB", "box and checks"),
                [row.cells for row in self.rows],
                self.notes,
                align="<>>>><",
                styles=[{True: "green", False: "red", None: "yellow"}[row.agrees] for row in self.rows],
            ),
            Table("Totals", ("", ""), facts, align="<", whole=False, header=False),
        ]

    def draw(self, path: Path) -> None:
        """How many instances are solved within which time: ours, recorded IRR, recorded CCMMZ."""
        ours = [row.ours for row in self.rows]
        irr = [run for row in self.rows if (run := row.instance.irr) is not None]
        ccmmz = [run for row in self.rows if (run := row.instance.ccmmz) is not None]
        lines: list[tuple[str, str, str, Sequence[float | None]]] = [
            ("robust, first widening", BLUE, "--", [run.first_widening_wall_s for run in ours]),
            ("robust, complete", BLUE, "-", [run.seconds for run in ours if run.complete]),
            ("IRR (recorded), first widening", AMBER, "--", [run.first_widening_s for run in irr]),
            ("IRR (recorded), complete", AMBER, "-", [run.wall_s for run in irr if run.solved]),
            ("CCMMZ (recorded)", GREEN, "-", [run.wall_s for run in ccmmz if run.solved]),
        ]
        known = [sorted(max(time, SHORTEST) for time in line[3] if time is not None) for line in lines]
        longest = max([times[-1] for times in known if times], default=1.0) * 1.6
        with canvas(path, 8, 4.8) as (_, [axes]):
            for (label, colour, style, _), times in zip(lines, known, strict=True):
                if times:
                    total = len(times)
                    counts = [0, *range(1, total + 1), total]
                    places = [times[0], *times, longest]
                    axes.step(places, counts, where="post", label=f"{label}: {total}", color=colour, linestyle=style)
            seconds_axis(axes, "x")
            axes.set(xlim=(None, longest), ylim=(0, self.total * 1.04), xlabel="time limit per instance")
            axes.axhline(self.total, color="0.75", linewidth=0.8, zorder=0)
            axes.set_ylabel(f"instances solved, of {self.total}")
            title = "Instances solved within a time limit (ours and recorded: different machines)"
            axes.set_title(title, fontsize=10, loc="left")
            if axes.get_legend_handles_labels()[0]:
                axes.legend(loc="lower right", fontsize=8, framealpha=1)


def _tasks(options: RecordedOptions, instances: Sequence[RecordedInstance]) -> list[RecordedTask]:
    return [RecordedTask(instance, options.limit) for instance in instances]


def _rows(_options: RecordedOptions, _instances: object, results: Results) -> list[RecordedRow]:
    return [RecordedRow(task.instance, run) for task, run in results]


RECORDED = Experiment(
    "recorded",
    RecordedOptions,
    _tasks,
    run_instance,
    Run,
    RecordedReport,
    lambda task, run: f"{task.label}: {RecordedRow(task.instance, run).verdict}, {run.seconds:.2f} s",
    prepare=lambda options, _: read_suite(options.suite),
    collect=_rows,
)
