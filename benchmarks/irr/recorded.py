"""`robust bench recorded`: every instance of a data set run as a user runs it, beside the recorded runs.

Our figures are measured on this machine, whole processes with start-up and reading; the recorded ones are those of the
recording's machine. What must agree is the answer: the box, fraction by fraction, and the number of checks. Ratios of
times are indicative only.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar

from robust.json_text import plain
from robust.sweeps.batch import ends_of

from ..catalogue import RecordedOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.measure import Ending, Run
from ..engine.show import NOTHING, SHORTEST, STYLES, Columns, Panel, Series, Table, cell, number
from ..suite import RecordedInstance, RecordedRun, read_suite
from .contenders import IRR, Curve

OURS = "status seconds cpu_s memory_mb checks queries search_s first_widening_s first_widening_wall_s box message"
_ABSENT = "absent"


def run_instance(instance: RecordedInstance, limit: float | None) -> RecordedRow:
    """Run an instance with β = 1, the doubling schedule and the recorded turn order."""
    return RecordedRow(instance, IRR.run(instance.files, limit=limit, extra=instance.order_options))


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
        return None if self.irr.checks is None else self.ours.checks == self.irr.checks

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
    def irr(self) -> RecordedRun:
        return self.instance.irr or _UNKNOWN

    @property
    def ccmmz(self) -> RecordedRun:
        return self.instance.ccmmz or _UNKNOWN

    @property
    def recorded_seconds(self) -> float | None:
        """Of IRR, if it solved the instance."""
        return self.irr.wall_s if self.irr.solved else None


def _differences(ours: Mapping[str, Sequence[str]], recorded: Mapping[str, Sequence[str]]) -> Iterator[Difference]:
    for name in {**recorded, **ours}:
        for place, side in enumerate(("lower", "upper")):
            mine, theirs = (box[name][place] if name in box else _ABSENT for box in (ours, recorded))
            if mine != theirs:
                yield Difference(name, side, mine, theirs)


def recorded_curves(instances: Sequence[RecordedInstance]) -> list[Curve]:
    """What the recorded runs solved, and when IRR's were wider for the first time."""
    irr = [one.irr for one in instances if one.irr is not None]
    ccmmz = [one.ccmmz for one in instances if one.ccmmz is not None]
    lines = (
        ("recorded-irr", "IRR (recorded)", [run.wall_s for run in irr if run.solved]),
        ("recorded-irr-first", "IRR (recorded), first widening", [run.first_widening_s for run in irr]),
        ("recorded-ccmmz", "CCMMZ (recorded)", [run.wall_s for run in ccmmz if run.solved]),
    )
    return [Curve.of(*line, recorded=True) for line in lines]


# -- the report --------------------------------------------------------------------------------------------------------

_UNKNOWN = RecordedRun(NOTHING)


def recorded_seconds(run: RecordedRun | None) -> str:
    """Seconds of a run that solved its instance, else how it ended."""
    if run is None:
        return NOTHING
    return number(run.wall_s) if run.solved and run.wall_s is not None else run.status


COLUMNS: Columns[RecordedRow] = {
    "instance": lambda row: row.instance.name,
    "seconds": lambda row: f"{number(row.ours.cpu_s)} / {recorded_seconds(row.irr)} / {recorded_seconds(row.ccmmz)}",
    "first widening": lambda row: f"{number(row.ours.first_widening_cpu_s)} / {number(row.irr.first_widening_s)}",
    "checks": lambda row: f"{cell(row.ours.checks)} / {cell(row.irr.checks)}",
    "MiB": lambda row: " / ".join(number(run.memory_mb, 0) for run in (row.ours, row.irr, row.ccmmz)),
    "box and checks": lambda row: row.verdict,
}
"""Ours / recorded IRR / recorded CCMMZ."""


class RecordedReport(Report[RecordedRow]):
    """Incremental robustification with β = 1, the doubling schedule and the recorded order of turns (`robust bench
    recorded`). Columns with slashes: ours / recorded IRR / recorded CCMMZ. Our first widening counts from the start of
    the process; from when the recorded one counts is not documented. Boxes are compared fraction by fraction.
    """

    TITLE = "Recorded instances"
    SETTINGS: ClassVar[Mapping[str, str]] = {"suite": "suite", **Report.SETTINGS}
    LAYOUT = (8, 4.8, "lower right")

    def sound(self) -> bool:
        """Whether all comparable instances agree, and none ended in an error."""
        return all(row.agrees is not False and row.ours.status is not Ending.ERROR for row in self.rows)

    def remarks(self) -> Sequence[str]:
        return [
            "ours: processor time of whole processes on this machine; recorded: measured on the recording's machine"
        ]

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
                "irr": sum(row.irr.solved for row in rows),
                "ccmmz": sum(row.ccmmz.solved for row in rows),
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

    def findings(self) -> Mapping[str, Any]:
        return {"totals": self.totals}

    def printed(self, row: RecordedRow) -> dict[str, Any]:
        instance = row.instance
        found: dict[str, Any] = {
            "instance": instance.name,
            "parameters": len(row.ours.box or row.recorded_box or instance.order),
            "ours": envelope_as_dict(row.ours),
            "recorded": {"irr": instance.irr, "irr_box": row.recorded_box, "ccmmz": instance.ccmmz},
            **{name: getattr(row, name) for name in ("agrees", "box_agrees", "checks_agree", "differences")},
        }
        return dict(plain(found))

    def contents(self) -> list[Table]:
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
                f"ours {number(seconds['ours_cpu'])} of the processor ({number(seconds['ours'])} by the clock), "
                f"recorded IRR {number(seconds['irr'])}",
            ),
            ("greatest memory", f"ours {number(totals['memory_mb']['ours'], 0)} MiB"),
        )
        styles = [{True: "green", False: "red", None: "yellow"}[row.agrees] for row in self.rows]
        title = "Ours / recorded IRR / recorded CCMMZ"
        return [
            Table.of(title, COLUMNS, self.rows, left=("instance", "box and checks"), styles=styles),
            Table("Totals", ("", ""), facts, left=("",), whole=False, header=False),
        ]

    def panels(self) -> list[Panel]:
        """How many instances are solved within which time: ours, recorded IRR, recorded CCMMZ."""
        ours = [row.ours for row in self.rows]
        curves = [
            Curve.of("irr-first", "robust, first widening", [run.first_widening_cpu_s for run in ours]),
            Curve.of("irr", "robust, complete", [run.cpu_s for run in ours if run.complete]),
            *recorded_curves([row.instance for row in self.rows]),
        ]
        longest = max([SHORTEST, *(time for curve in curves for time in curve.times)]) * 1.6
        lines = []
        for curve in curves:
            colour, style, _ = STYLES[curve.name]
            steps = [(max(time, SHORTEST), place) for place, time in enumerate(curve.times, 1)]
            if steps:
                steps = [(steps[0][0], 0), *steps, (longest, len(steps))]
                lines.append(Series(steps, f"{curve.label}: {len(curve.times)}", colour, style, steps=True))
        all_of_them = Series([(SHORTEST, self.total), (longest, self.total)], None, "0.75", "-")
        title = "Instances solved within a time limit (ours and recorded: different machines)"
        labels = ("time limit per instance", f"instances solved, of {self.total}")
        axes = {"xlim": (SHORTEST, longest), "ylim": (0, self.total * 1.04)}
        return [Panel(title, [*lines, all_of_them], *labels, seconds="x", axes=axes)]


def _tasks(options: RecordedOptions, instances: Sequence[RecordedInstance]) -> list[Task]:
    return [Task(one.name, (one, options.limit)) for one in instances]


def _describe(row: RecordedRow) -> str:
    return f"{row.verdict}, {row.ours.cpu_s:.2f} s"


def _prepare(options: RecordedOptions, _: object) -> tuple[RecordedInstance, ...]:
    """The instances that are asked for."""
    found = read_suite(options.suite)
    count = min(options.instances or len(found), len(found))
    return tuple(found[number * len(found) // count] for number in range(count))


on_suite = partial(Experiment, prepare=_prepare)
"""An experiment about the instances of a data set."""
RECORDED = on_suite("recorded", RecordedOptions, _tasks, run_instance, RecordedReport, _describe, unit="instances")
