"""`robust bench figure3`: how many instances each method solves within which time [IRR Fig. 3], and exact checks.

Every run is a whole process with a limit of its own: IRR in the recorded schedule and order, exact widening, the
optimal box (the recorded CCMMZ runs' "decoupled envelope generation") and the exact region by each elimination back
end. Beside them stand the recorded runs, which were measured on another machine. What the runs answer is checked: the
boxes, ours and the recorded ones, must be inside the exact region, and no recorded box wider than the optimal one.
Recorded boxes are also proved inside by `robust check`, which needs no region.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from robust.qe.box import Box
from robust.qe.region import Region

from ..catalogue import Figure3Options
from ..engine.codec import plain
from ..engine.experiment import Experiment, Report, Results
from ..engine.measure import COST, FAILURES, Run, box_of
from ..engine.show import NOTHING, OTHER, SHORTEST, STYLES, Cells, Table, canvas, legend_below, number, seconds_axis
from ..suite import RecordedInstance, read_suite
from .contenders import IRR, OPTIMAL, RECORDED_BOX, REGIONS, WIDEN, Contender, recorded_cell, run_cell

CONTENDERS = (IRR, WIDEN, OPTIMAL, *REGIONS, RECORDED_BOX)
MARKS = (0.5, 1, 2, 5, 10, 60, 600, 3600)
"""Seconds at which the tables count what is solved."""
CURVE_HEADINGS = ("method", *(f"{mark:g} s" for mark in MARKS), "slowest solved, s")
CHECK_HEADINGS = (
    "instance",
    "widening, s",
    "region, s",
    "optimal, s",
    "CCMMZ recorded, s",
    "recorded IRR box proved",
    "IRR box, recorded / ours, in region",
    "widening / optimal in region",
    "total width, optimal / recorded CCMMZ",
    "widths",
)


@dataclass(frozen=True, slots=True)
class Figure3Task:
    """One method on one instance."""

    instance: RecordedInstance
    contender: Contender
    limit: float | None

    @property
    def label(self) -> str:
        return f"{self.instance.name}, {self.contender.label}"


def run_contender(task: Figure3Task) -> Run:
    """Run a method as a whole process; only IRR is told the order of turns, and only the check the recorded box."""
    instance, contender = task.instance, task.contender
    extra: list[str] = []
    if contender.name == IRR.name:
        extra = instance.order_options
    elif contender.name == RECORDED_BOX.name and instance.box is not None:
        for name, interval in instance.box.intervals.items():
            lower = "-inf" if interval.lower is None else str(interval.lower)
            upper = "inf" if interval.upper is None else str(interval.upper)
            extra.append(f"--at={name}={lower}:{upper}")
    return contender.run(instance.files, limit=task.limit, extra=extra)


class WidthComparison(Enum):
    """The optimal box's total width beside the recorded one's; a wider recorded box contradicts the optimum."""

    EQUAL = "equal"
    NOT_OPTIMAL = "recorded not optimal"
    WIDER = "recorded wider"


def compare_widths(optimal: Box, recorded: Box) -> WidthComparison:
    """Total widths, an infinite one being the greatest."""
    ours, theirs = optimal.total_width, recorded.total_width
    if ours == theirs:
        return WidthComparison.EQUAL
    wider = ours is not None and (theirs is None or theirs > ours)
    return WidthComparison.WIDER if wider else WidthComparison.NOT_OPTIMAL


@dataclass(frozen=True)
class Checks:
    """What the answers about one instance say about each other; None where something is missing.

    Each box is inside the exact region or not; `recorded_box_proved` says the same of the recorded box, without the
    region. An infinite width is None.
    """

    recorded_box_proved: bool | None
    recorded_box_in_region: bool | None
    irr_in_region: bool | None
    widening_in_region: bool | None
    optimal_in_region: bool | None
    optimal_width: Fraction | None
    recorded_ccmmz_width: Fraction | None
    widths: WidthComparison | None

    @property
    def boxes(self) -> dict[str, bool | None]:
        """Whether each box is inside, by the name of the check."""
        return {name: getattr(self, name) for name in BOX_CHECKS}

    @property
    def hold(self) -> bool:
        """Whether nothing contradicts anything."""
        return False not in self.boxes.values() and self.widths is not WidthComparison.WIDER


BOX_CHECKS = {
    "recorded_box_proved": "Recorded IRR boxes proved inside the envelope by `robust check`",
    "recorded_box_in_region": "recorded IRR boxes inside the exact region",
    "irr_in_region": "our IRR boxes inside it",
    "widening_in_region": "boxes of exact widening inside it",
    "optimal_in_region": "optimal boxes inside it",
}


@dataclass(frozen=True)
class Figure3Row:
    """One instance and its runs by the names of the contenders."""

    instance: RecordedInstance
    runs: Mapping[str, Run]

    @property
    def domain(self) -> str:
        """The name without its numbers: instances that differ in these are of one domain."""
        return re.sub(r"(_\d+)+$", "", self.instance.name)

    @cached_property
    def checks(self) -> Checks:
        """Compare boxes, widths and the region; exact, and computed once."""
        region = next((Region.from_dict(run.region) for run in self.runs.values() if run.region is not None), None)
        recorded, ccmmz, optimal = self.instance.box, self.instance.ccmmz_box, self._box(OPTIMAL)
        proof = self.runs.get(RECORDED_BOX.name)
        return Checks(
            {"proved": True, "refuted": False}.get((proof and proof.verdict) or ""),
            _inside(recorded, region),
            _inside(self._box(IRR), region),
            _inside(self._box(WIDEN), region),
            _inside(optimal, region),
            None if optimal is None else optimal.total_width,
            None if ccmmz is None else ccmmz.total_width,
            None if optimal is None or ccmmz is None else compare_widths(optimal, ccmmz),
        )

    def _box(self, contender: Contender) -> Box | None:
        run = self.runs.get(contender.name)
        return box_of(run.box) if run is not None and run.complete and run.box is not None else None

    @property
    def cells(self) -> Cells:
        """Times of the exact methods, and what was checked about their answers."""
        checks = self.checks
        return (
            self.instance.name,
            *(run_cell(self.runs.get(name)) for name in (WIDEN.name, "project", OPTIMAL.name)),
            recorded_cell(self.instance.ccmmz),
            _yes(checks.recorded_box_proved),
            f"{_yes(checks.recorded_box_in_region)} / {_yes(checks.irr_in_region)}",
            f"{_yes(checks.widening_in_region)} / {_yes(checks.optimal_in_region)}",
            f"{_width(checks.optimal_width)} / {_width(checks.recorded_ccmmz_width)}",
            NOTHING if checks.widths is None else checks.widths.value,
        )


def _inside(box: Box | None, region: Region | None) -> bool | None:
    if box is None or region is None:
        return None
    return set(box.intervals) == set(region.parameters) and region.contains_box(box)


def _yes(answer: bool | None) -> str:
    return NOTHING if answer is None else "yes" if answer else "NO"


def _width(width: Fraction | None) -> str:
    return NOTHING if width is None else f"{float(width):.10g}"


@dataclass(frozen=True, slots=True)
class Curve:
    """Seconds of the solved instances in ascending order, of one method in one domain."""

    name: str
    label: str
    times: tuple[float, ...]
    recorded: bool = False

    @staticmethod
    def of(name: str, label: str, times: Iterable[float | None], *, recorded: bool = False) -> Curve:
        """Without times that are not known."""
        return Curve(name, label, tuple(sorted(time for time in times if time is not None)), recorded)

    def solved_within(self, seconds: float) -> int:
        return sum(time <= seconds for time in self.times)

    @property
    def cells(self) -> Cells:
        counts = (str(self.solved_within(mark)) for mark in MARKS)
        return (self.label, *counts, number(self.times[-1] if self.times else None))


class Figure3Report(Report[Figure3Row]):
    """All instances in the order of the data set."""

    SETTINGS: ClassVar[Mapping[str, str]] = {
        "suite": "suite",
        "limit_s": "limit",
        "own_limits_s": "own_limits",
        "jobs": "jobs",
    }

    @property
    def contenders(self) -> tuple[Contender, ...]:
        return self.options.contenders or CONTENDERS

    @property
    def agrees(self) -> bool:
        """Whether every run was made, none ended in an error, and no answer contradicts another or a recorded one."""
        sound = all(run.status not in FAILURES for row in self.rows for run in row.runs.values())
        return self.complete and sound and all(row.checks.hold for row in self.rows)

    @property
    def domains(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(row.domain for row in self.rows))

    def rows_of(self, domain: str) -> list[Figure3Row]:
        return [row for row in self.rows if row.domain == domain]

    def curves(self, domain: str) -> list[Curve]:
        """Ours in the order of the contenders, IRR with its first widening, then the recorded ones."""
        rows = self.rows_of(domain)
        curves = []
        for one in self.contenders:
            runs = [row.runs[one.name] for row in rows if one.name in row.runs]
            if one.verb != "check":
                curves.append(Curve.of(one.name, one.label, [run.seconds for run in runs if run.complete]))
            if one.name == IRR.name:
                first = [run.first_widening_wall_s for run in runs]
                curves.append(Curve.of("irr-first", f"{one.label}, first widening", first))
        irr = [row.instance.irr for row in rows if row.instance.irr is not None]
        ccmmz = [row.instance.ccmmz for row in rows if row.instance.ccmmz is not None]
        recorded = (
            ("recorded-irr", "IRR (recorded)", [run.wall_s for run in irr if run.solved]),
            ("recorded-irr-first", "IRR (recorded), first widening", [run.first_widening_s for run in irr]),
            ("recorded-ccmmz", "CCMMZ (recorded)", [run.wall_s for run in ccmmz if run.solved]),
        )
        return curves + [Curve.of(*line, recorded=True) for line in recorded]

    @property
    def notes(self) -> tuple[str, ...]:
        limit = "no limit" if self.options.limit is None else f"a limit of {self.options.limit:g} s"
        own = "".join(f", {name} {seconds:g} s" for name, seconds in (self.options.own_limits or {}).items())
        notes = [f"ours: measured on this machine, whole processes, {limit} each{own}; recorded: on another machine"]
        notes += self.jobs_notes
        if not self.complete:
            notes.append(f"incomplete: interrupted after {sum(len(row.runs) for row in self.rows)} runs")
        return tuple(notes)

    @cached_property
    def totals(self) -> dict[str, Any]:
        """How often each check holds, and of how many."""
        checks = [row.checks for row in self.rows]
        known = {name: [one.boxes[name] for one in checks if one.boxes[name] is not None] for name in BOX_CHECKS}
        shares = {name: {"holds": sum(map(bool, found)), "of": len(found)} for name, found in known.items()}
        return {
            **shares,
            "widths": {kind.value: sum(one.widths is kind for one in checks) for kind in WidthComparison},
        }

    @property
    def totals_text(self) -> str:
        """The checks in a sentence."""
        totals = self.totals
        parts = [f"{called}: {totals[key]['holds']} of {totals[key]['of']}" for key, called in BOX_CHECKS.items()]
        widths = ", ".join(f"{count} {kind}" for kind, count in totals["widths"].items())
        return f"{'; '.join(parts)}. Total widths of the recorded CCMMZ boxes beside the optimal ones: {widths}."

    @property
    def settings(self) -> Mapping[str, Any]:
        return {**super().settings, "own_limits_s": dict(self.options.own_limits or {})}

    @property
    def findings(self) -> Mapping[str, Any]:
        domains = [
            {
                "domain": domain,
                "instances": len(self.rows_of(domain)),
                "curves": [
                    {"name": one.name, "recorded": one.recorded, "times_s": one.times} for one in self.curves(domain)
                ],
            }
            for domain in self.domains
        ]
        return {"totals": self.totals, "domains": domains}

    def printed(self, row: Figure3Row) -> dict[str, Any]:
        facts = {"envelope": ("first_widening_wall_s", "box"), "region": ("polyhedra",), "check": ("verdict",)}
        verbs = {one.name: one.verb for one in self.contenders}
        runs = {name: run.printed(*COST, *facts[verbs[name]]) for name, run in row.runs.items()}
        return {
            "instance": row.instance.name,
            "domain": row.domain,
            "runs": {name: {**run, "box": run["box"] or None} if "box" in run else run for name, run in runs.items()},
            "recorded": {"irr": plain(row.instance.irr), "ccmmz": plain(row.instance.ccmmz)},
            "checks": plain(row.checks),
        }

    def curve_table(self, domain: str, *notes: str) -> Table:
        """For each method of a domain, how many instances are solved within which time."""
        title = f"{domain}: solved within, of {len(self.rows_of(domain))}"
        return Table(title, CURVE_HEADINGS, [one.cells for one in self.curves(domain)], notes, whole=False)

    @property
    def check_table(self) -> Table:
        """Times of the exact methods, and what was checked about their answers."""
        notes = (self.totals_text, *self.notes)
        return Table("Exact methods", CHECK_HEADINGS, [row.cells for row in self.rows], notes, whole=False)

    @property
    def tables(self) -> list[Table]:
        """One table for each domain, and the checks."""
        if self.contenders != (IRR,):
            return [*map(self.curve_table, self.domains), self.check_table]
        *others, last = self.domains
        return [*map(self.curve_table, others), self.curve_table(last, self.totals_text, *self.notes)]

    def draw(self, path: Path) -> None:
        """One panel for each domain: the time of each instance solved, in ascending order for each method."""
        domains = self.domains
        with canvas(path, max(5.5, 4.2 * len(domains)), 5.6, len(domains)) as (figure, panels):
            for axes, domain in zip(panels, domains, strict=True):
                for curve in self.curves(domain):
                    if curve.times:
                        colour, line, marker = STYLES.get(curve.name, OTHER)
                        style: dict[str, Any] = {
                            "color": colour,
                            "linestyle": line,
                            "marker": marker,
                            "label": curve.label,
                        }
                        times = [max(time, SHORTEST) for time in curve.times]
                        axes.plot(range(1, len(times) + 1), times, markersize=3.5, linewidth=1.2, **style)
                count = len(self.rows_of(domain))
                seconds_axis(axes)
                axes.set(xlim=(0.5, count + 0.5), xlabel="instances solved")
                axes.set_title(f"{domain}: {count}", fontsize=9, loc="left")
            panels[0].set_ylabel("time for each (ours and recorded: different machines)")
            legend_below(figure, panels)


def _tasks(options: Figure3Options, instances: Sequence[RecordedInstance]) -> list[Figure3Task]:
    limits = options.own_limits or {}
    return [
        Figure3Task(instance, contender, limits.get(contender.name, options.limit))
        for instance in instances
        for contender in options.contenders or CONTENDERS
        if contender.name != RECORDED_BOX.name or instance.box is not None
    ]


def _rows(_options: Figure3Options, instances: Sequence[RecordedInstance], results: Results) -> list[Figure3Row]:
    runs: dict[str, dict[str, Run]] = {}
    for task, run in results:
        runs.setdefault(task.instance.name, {})[task.contender.name] = run
    return [Figure3Row(one, runs[one.name]) for one in instances if one.name in runs]


FIGURE3 = Experiment(
    "figure3",
    Figure3Options,
    _tasks,
    run_contender,
    Run,
    Figure3Report,
    lambda task, run: f"{task.label}: {run.text}, {run.seconds:.2f} s",
    prepare=lambda options, _: read_suite(options.suite),
    collect=_rows,
)
