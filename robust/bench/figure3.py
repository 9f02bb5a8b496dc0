"""`robust bench figure3`: how many instances each method solves within which time [IRR Fig. 3], and exact checks.

Every run is a whole process with a limit of its own: IRR in the recorded schedule and order, exact widening, the
optimal box (the recorded CCMMZ runs' "decoupled envelope generation") and the exact region by each elimination back
end. Beside them stand the recorded runs, which were measured on another machine. What the runs answer is checked: the
boxes, ours and the recorded ones, must be inside the exact region, and no recorded box wider than the optimal one.
Recorded boxes are also proved inside by `robust check`, which needs no region.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.bench.batch import Progress, run_batch
from robust.bench.contenders import (
    IRR,
    OPTIMAL,
    RECORDED_BOX,
    REGIONS,
    WIDEN,
    CheckRun,
    Contender,
    RegionRun,
    Run,
    cost_as_dict,
)
from robust.bench.options import check_limit, plotting
from robust.bench.process import Processes
from robust.bench.run import EnvelopeRun, Intervals, Outcome, box_as_dict
from robust.bench.suite import RecordedInstance, read_suite
from robust.irr.box import Box, Interval
from robust.qe.region import Region

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "robust/bench-figure3/1"
LIMIT = 10.0
CONTENDERS = (IRR, WIDEN, OPTIMAL, *REGIONS, RECORDED_BOX)
MARKS = (0.5, 1, 2, 5, 10, 60, 600, 3600)
"""Seconds at which the tables count what is solved."""


class WidthComparison(Enum):
    """The optimal box's total width beside the recorded one's; a wider recorded box contradicts the optimum."""

    EQUAL = "equal"
    NOT_OPTIMAL = "recorded not optimal"
    WIDER = "recorded wider"


@dataclass(frozen=True)
class Checks:
    """What the answers about one instance say about each other; None where something is missing.

    Each box is inside the exact region or not; `recorded_proved` says the same of the recorded box, without the region.
    An infinite width is None.
    """

    recorded_proved: bool | None = None
    recorded_inside: bool | None = None
    irr_inside: bool | None = None
    widening_inside: bool | None = None
    optimal_inside: bool | None = None
    optimal_width: Fraction | None = None
    recorded_width: Fraction | None = None
    widths: WidthComparison | None = None

    @property
    def hold(self) -> bool:
        """Whether nothing contradicts anything."""
        boxes = (self.recorded_proved, self.recorded_inside, self.irr_inside, self.widening_inside, self.optimal_inside)
        return False not in boxes and self.widths is not WidthComparison.WIDER

    def as_dict(self) -> dict[str, Any]:
        return {
            "recorded_box_proved": self.recorded_proved,
            "recorded_box_in_region": self.recorded_inside,
            "irr_in_region": self.irr_inside,
            "widening_in_region": self.widening_inside,
            "optimal_in_region": self.optimal_inside,
            "optimal_width": _text(self.optimal_width),
            "recorded_ccmmz_width": _text(self.recorded_width),
            "widths": None if self.widths is None else self.widths.value,
        }


@dataclass(frozen=True)
class Figure3Row:
    """One instance and its runs by the names of the contenders."""

    instance: RecordedInstance
    runs: Mapping[str, Run]

    @property
    def domain(self) -> str:
        return domain_of(self.instance)

    @cached_property
    def checks(self) -> Checks:
        """Compare boxes, widths and the region; exact, and computed once."""
        boxes = {name: _box(self.runs.get(name)) for name in (IRR.name, WIDEN.name, OPTIMAL.name)}
        recorded = None if self.instance.box is None else Box(self.instance.box)
        region = next(self._regions(), None)
        optimal, ccmmz = boxes[OPTIMAL.name], self.instance.ccmmz_box
        proof = self.runs.get(RECORDED_BOX.name)
        return Checks(
            recorded_proved=proof.proved if isinstance(proof, CheckRun) else None,
            recorded_inside=_inside(recorded, region),
            irr_inside=_inside(boxes[IRR.name], region),
            widening_inside=_inside(boxes[WIDEN.name], region),
            optimal_inside=_inside(optimal, region),
            optimal_width=None if optimal is None else optimal.total_width,
            recorded_width=None if ccmmz is None else Box(ccmmz).total_width,
            widths=None if optimal is None or ccmmz is None else compare_widths(optimal, Box(ccmmz)),
        )

    def _regions(self) -> Iterator[Region]:
        for run in self.runs.values():
            if isinstance(run, RegionRun) and run.region is not None:
                yield run.region

    def as_dict(self) -> dict[str, Any]:
        instance = self.instance
        return {
            "instance": instance.name,
            "domain": self.domain,
            "runs": {name: _run_as_dict(run) for name, run in self.runs.items()},
            "recorded": {
                "irr": instance.irr.as_dict() if instance.irr else None,
                "ccmmz": instance.ccmmz.as_dict() if instance.ccmmz else None,
            },
            "checks": self.checks.as_dict(),
        }


@dataclass(frozen=True, slots=True)
class Curve:
    """Seconds of the solved instances in ascending order, of one method in one domain."""

    name: str
    label: str
    times: tuple[float, ...]
    recorded: bool = False

    def solved_within(self, seconds: float) -> int:
        return sum(time <= seconds for time in self.times)


@dataclass(frozen=True)
class Figure3Report:
    """All rows in the order of the data set; `complete` is false where Ctrl-C came before the last run."""

    suite: Path
    instances: int
    contenders: tuple[Contender, ...]
    rows: tuple[Figure3Row, ...]
    complete: bool
    limit: float | None
    own_limits: Mapping[str, float]
    jobs: int

    @property
    def agrees(self) -> bool:
        """Whether every run was made, none ended in an error, and no answer contradicts another or a recorded one."""
        failures = {Outcome.ERROR, Outcome.INVALID}
        sound = all(run.outcome not in failures for row in self.rows for run in row.runs.values())
        return self.complete and sound and all(row.checks.hold for row in self.rows)

    @property
    def domains(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(row.domain for row in self.rows))

    def rows_of(self, domain: str) -> tuple[Figure3Row, ...]:
        return tuple(row for row in self.rows if row.domain == domain)

    def curves(self, domain: str) -> tuple[Curve, ...]:
        """Ours in the order of the contenders, IRR with its first widening, then the recorded ones."""
        rows = self.rows_of(domain)
        curves = []
        for contender in self.contenders:
            if contender.verb == "check":
                continue
            runs = [row.runs[contender.name] for row in rows if contender.name in row.runs]
            complete = [run.seconds for run in runs if run.outcome is Outcome.COMPLETE]
            curves.append(Curve(contender.name, contender.label, _ascending(complete)))
            if contender.name == IRR.name:
                first = [run.first_widening_wall_s for run in runs if isinstance(run, EnvelopeRun)]
                curves.append(Curve("irr-first", f"{contender.label}, first widening", _ascending(first)))
        irr = [row.instance.irr for row in rows if row.instance.irr is not None]
        ccmmz = [row.instance.ccmmz for row in rows if row.instance.ccmmz is not None]
        recorded = (
            ("recorded-irr", "IRR (recorded)", [run.wall_s for run in irr if run.solved]),
            ("recorded-irr-first", "IRR (recorded), first widening", [run.first_widening_s for run in irr]),
            ("recorded-ccmmz", "CCMMZ (recorded)", [run.wall_s for run in ccmmz if run.solved]),
        )
        curves += [Curve(name, label, _ascending(times), recorded=True) for name, label, times in recorded]
        return tuple(curves)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures has to know."""
        limit = "no limit" if self.limit is None else f"a limit of {self.limit:g} s"
        own = "".join(f", {name} {seconds:g} s" for name, seconds in self.own_limits.items())
        notes = [f"ours: measured on this machine, whole processes, {limit} each{own}; recorded: on another machine"]
        if self.jobs > 1:
            notes.append(f"{self.jobs} processes ran at a time and disturbed each other's timings")
        if not self.complete:
            done = sum(len(row.runs) for row in self.rows)
            notes.append(f"incomplete: interrupted after {done} runs")
        return tuple(notes)

    @property
    def totals(self) -> dict[str, Any]:
        """How often each check holds, and of how many."""
        checks = [row.checks for row in self.rows]
        widths = [one.widths for one in checks]
        return {
            "recorded_box_proved": _share(one.recorded_proved for one in checks),
            "recorded_box_in_region": _share(one.recorded_inside for one in checks),
            "irr_in_region": _share(one.irr_inside for one in checks),
            "widening_in_region": _share(one.widening_inside for one in checks),
            "optimal_in_region": _share(one.optimal_inside for one in checks),
            "widths": {kind.value: sum(width is kind for width in widths) for kind in WidthComparison},
        }

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; times in seconds, memory in MiB, boxes and widths as exact text."""
        return {
            "schema": SCHEMA,
            "suite": str(self.suite),
            "complete": self.complete,
            "agrees": self.agrees,
            "limit_s": self.limit,
            "own_limits_s": dict(self.own_limits),
            "jobs": self.jobs,
            "notes": list(self.notes),
            "totals": self.totals,
            "domains": [
                {
                    "domain": domain,
                    "instances": len(self.rows_of(domain)),
                    "curves": [
                        {"name": one.name, "recorded": one.recorded, "times_s": [round(time, 4) for time in one.times]}
                        for one in self.curves(domain)
                    ],
                }
                for domain in self.domains
            ],
            "rows": [row.as_dict() for row in self.rows],
        }

    def tables(self) -> list[Table]:
        """One table for each domain, and the checks."""
        from robust.bench.figure_tables import figure3_tables  # noqa: PLC0415 - rich only when something is shown

        return figure3_tables(self)


def run_figure3(
    suite: Path,
    *,
    jobs: int = 1,
    limit: float | None = LIMIT,
    own_limits: Mapping[str, float] | None = None,
    plot: Path | None = None,
    on_result: Progress | None = None,
    contenders: Sequence[Contender] = CONTENDERS,
) -> Figure3Report:
    """Run every method on every instance of a data set.

    Args:
        suite: the directory of the data set, see :mod:`robust.bench.suite`.
        jobs: processes at a time; more than one disturbs the timings.
        limit: seconds after which a run is killed; None never.
        own_limits: other limits for some contenders, by name.
        plot: where to draw the figure (SVG, PNG or PDF by suffix).
        on_result: called after each run with the number done, their total and a line about the run.
        contenders: what to run.

    Returns:
        A report; Ctrl-C ends the running processes and returns what is there, marked incomplete.

    Raises:
        InputError: wrong options, or a data set that is missing or malformed.
    """
    limits = dict(own_limits or {})
    for seconds in (limit, *limits.values()):
        check_limit(seconds)
    figures = plotting(plot, "robust.bench.figures")
    instances = read_suite(suite)
    points = [
        (instance, contender)
        for instance in instances
        for contender in contenders
        if contender.name != RECORDED_BOX.name or instance.box is not None
    ]
    batch = run_batch(
        len(points), partial(_run, points, limit, limits), jobs=jobs, describe=_describe, on_result=on_result
    )
    runs: dict[str, dict[str, Run]] = {}
    for instance, contender, run in batch.results:
        runs.setdefault(instance.name, {})[contender.name] = run
    rows = tuple(Figure3Row(one, runs[one.name]) for one in instances if one.name in runs)
    report = Figure3Report(suite, len(instances), tuple(contenders), rows, batch.complete, limit, limits, jobs)
    if figures is not None and plot is not None and report.rows:
        figures.plot_figure3(report, plot)
    return report


_Point = tuple[RecordedInstance, Contender]
_Result = tuple[RecordedInstance, Contender, Run]


def _run(
    points: Sequence[_Point], limit: float | None, limits: Mapping[str, float], processes: Processes, index: int
) -> _Result:
    instance, contender = points[index]
    extra: list[str] = []
    if contender.name == IRR.name:
        extra = order_options(instance)
    elif contender.name == RECORDED_BOX.name:
        extra = [f"--at={name}={interval_text(interval)}" for name, interval in (instance.box or {}).items()]
    limit = limits.get(contender.name, limit)
    return instance, contender, contender.run(processes, instance.files, limit=limit, extra=extra)


def order_options(instance: RecordedInstance) -> list[str]:
    """The recorded order of turns as an option."""
    return [f"--order={','.join(instance.order)}"] if instance.order else []


def interval_text(interval: Interval) -> str:
    """An interval as `robust check --at` reads it."""
    lower = "-inf" if interval.lower is None else str(interval.lower)
    upper = "inf" if interval.upper is None else str(interval.upper)
    return f"{lower}:{upper}"


def domain_of(instance: RecordedInstance) -> str:
    """The name without its numbers: instances that differ in these are of one domain."""
    return re.sub(r"(_\d+)+$", "", instance.name)


def compare_widths(optimal: Box, recorded: Box) -> WidthComparison:
    """Total widths, an infinite one being the greatest."""
    ours, theirs = optimal.total_width, recorded.total_width
    if ours == theirs:
        return WidthComparison.EQUAL
    if ours is None:
        return WidthComparison.NOT_OPTIMAL
    return WidthComparison.WIDER if theirs is None or theirs > ours else WidthComparison.NOT_OPTIMAL


def _describe(result: _Result) -> str:
    instance, contender, run = result
    return f"{instance.name}, {contender.label}: {run.text}, {run.seconds:.2f} s"


def _box(run: Run | None) -> Box | None:
    return Box(run.box) if isinstance(run, EnvelopeRun) and run.outcome is Outcome.COMPLETE else None


def _inside(box: Box | None, region: Region | None) -> bool | None:
    if box is None or region is None:
        return None
    return set(box.intervals) == set(region.parameters) and region.contains_box(box)


def _ascending(times: Iterable[float | None]) -> tuple[float, ...]:
    return tuple(sorted(time for time in times if time is not None))


def _share(answers: Iterable[bool | None]) -> dict[str, int]:
    known = [answer for answer in answers if answer is not None]
    return {"holds": sum(known), "of": len(known)}


def _run_as_dict(run: Run) -> dict[str, Any]:
    if isinstance(run, EnvelopeRun):
        facts: Mapping[str, Any] = {
            "first_widening_wall_s": _rounded(run.first_widening_wall_s),
            "box": _boxes(run.box),
        }
    elif isinstance(run, RegionRun):
        facts = {"polyhedra": run.polyhedra}
    else:
        facts = {"verdict": run.verdict}
    return {**cost_as_dict(run), **facts}


def _boxes(box: Intervals) -> dict[str, list[str]] | None:
    return box_as_dict(box) or None


def _rounded(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds, 4)


def _text(width: Fraction | None) -> str | None:
    return None if width is None else str(width)
