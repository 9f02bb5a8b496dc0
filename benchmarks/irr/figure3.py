"""`robust bench figure3`: how many instances each method solves within which time [IRR Fig. 3], and exact checks.

Every run is a whole process with a limit of its own: IRR in the recorded schedule and order, exact widening, the
optimal box (the recorded CCMMZ runs' "decoupled envelope generation") and the exact region by each elimination back
end. Beside them stand the recorded runs, which were measured on another machine. What the runs answer is checked: the
boxes, ours and the recorded ones, must be inside the exact region, and no recorded box wider than the optimal one.
Recorded boxes are also proved inside by `robust check`, which needs no region.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property, partial
from typing import Any, ClassVar

from robust.json_text import plain
from robust.qe.box import Box
from robust.qe.region import Region
from robust.sweeps.batch import box_of, ends_of

from ..catalogue import Figure3Options
from ..engine.experiment import Report, Results, Task
from ..engine.measure import COST, Run
from ..engine.show import NOTHING, OTHER, SHORTEST, STYLES, Columns, Panel, Series, Table
from ..suite import RecordedInstance
from . import contenders
from .contenders import IRR, OPTIMAL, RECORDED_BOX, REGIONS, WIDEN, Contender, Curve, run_cell
from .recorded import on_suite, recorded_curves, recorded_seconds

CONTENDERS = (IRR, WIDEN, OPTIMAL, *REGIONS, RECORDED_BOX)


def run_contender(instance: RecordedInstance, contender: Contender, limit: float | None) -> Run:
    """Run a method as a whole process; only IRR is told the order of turns, and only the check the recorded box."""
    extra: list[str] = []
    if contender.name == IRR.name:
        extra = instance.order_options
    elif contender.name == RECORDED_BOX.name and instance.box is not None:
        extra = [f"--at={name}={':'.join(ends_of(interval))}" for name, interval in instance.box.intervals.items()]
    return contender.run(instance.files, limit=limit, extra=extra)


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
    def name(self) -> str:
        return self.instance.name

    @property
    def group(self) -> str:
        """Its domain, the name without its numbers: instances that differ in these are of one domain."""
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


def _inside(box: Box | None, region: Region | None) -> bool | None:
    if box is None or region is None:
        return None
    return set(box.intervals) == set(region.parameters) and region.contains_box(box)


def _yes(answer: bool | None) -> str:
    return NOTHING if answer is None else "yes" if answer else "NO"


def _width(width: Fraction | None) -> str:
    return NOTHING if width is None else f"{float(width):.10g}"


def _pair(text: Callable[[Any], str], one: str, other: str, row: Figure3Row) -> str:
    return f"{text(getattr(row.checks, one))} / {text(getattr(row.checks, other))}"


CHECKS: Columns[Figure3Row] = {
    "instance": lambda row: row.name,
    "widening, s": lambda row: run_cell(row.runs.get(WIDEN.name)),
    "region, s": lambda row: run_cell(row.runs.get("project")),
    "optimal, s": lambda row: run_cell(row.runs.get(OPTIMAL.name)),
    "CCMMZ recorded, s": lambda row: recorded_seconds(row.instance.ccmmz),
    "recorded IRR box proved": lambda row: _yes(row.checks.recorded_box_proved),
    "IRR box, recorded / ours, in region": partial(_pair, _yes, "recorded_box_in_region", "irr_in_region"),
    "widening / optimal in region": partial(_pair, _yes, "widening_in_region", "optimal_in_region"),
    "total width, optimal / recorded CCMMZ": partial(_pair, _width, "optimal_width", "recorded_ccmmz_width"),
    "widths": lambda row: NOTHING if row.checks.widths is None else row.checks.widths.value,
}
"""Times of the exact methods, and what was checked about their answers."""


class Figure3Report(contenders.MethodsReport):
    """How many instances each method solves within which time [IRR Fig. 3] (`robust bench figure3`). The optimal box is
    what the recorded CCMMZ runs computed. Of exact widening, the exact region (`robust region --backend project`) and
    the optimal box (`robust envelope --method optimal`), from the same runs, each box, ours and the recorded one of
    IRR, is checked to be inside the exact region where that was found in time; the recorded box is also proved inside
    without it. The recorded optimiser was stopped after 30 improvements, so that its box can be smaller.
    """

    TITLE = "Instances solved over time, and exact methods"
    SETTINGS: ClassVar[Mapping[str, str]] = {"suite": "suite", **Report.SETTINGS, "own_limits_s": "own_limits"}
    LAYOUT = (4.2, 5.6, "below")
    CONTENDERS = CONTENDERS

    def sound(self) -> bool:
        """Whether no run ended in an error, and no answer contradicts another or a recorded one."""
        return not self.wrong and all(row.checks.hold for row in self.rows)

    def curves(self, group: str) -> list[Curve]:
        """Ours, IRR also with its first widening, then the recorded ones."""
        curves = super().curves(group)
        if IRR in self.contenders:
            first = [run.first_widening_cpu_s for run in self.runs(group, IRR.name)]
            curves.insert(self.contenders.index(IRR) + 1, Curve.of("irr-first", f"{IRR.label}, first widening", first))
        return curves + recorded_curves([row.instance for row in self.of(group=group)])

    def remarks(self) -> Sequence[str]:
        limits = contenders.limits_text(self.options.limit, self.options.own_limits)
        return [f"ours: processor time of whole processes on this machine, {limits}; recorded: on another machine"]

    @cached_property
    def totals(self) -> dict[str, Any]:
        """How often each check holds, and of how many."""
        checks = [row.checks for row in self.rows]
        known = {name: [one.boxes[name] for one in checks if one.boxes[name] is not None] for name in BOX_CHECKS}
        shares = {name: {"holds": sum(map(bool, found)), "of": len(found)} for name, found in known.items()}
        widths = {kind.value: sum(one.widths is kind for one in checks) for kind in WidthComparison}
        return {**shares, "widths": widths}

    def conclusions(self) -> Sequence[str]:
        """The checks in a sentence."""
        totals = self.totals
        parts = [f"{called}: {totals[key]['holds']} of {totals[key]['of']}" for key, called in BOX_CHECKS.items()]
        widths = ", ".join(f"{count} {kind}" for kind, count in totals["widths"].items())
        return [f"{'; '.join(parts)}. Total widths of the recorded CCMMZ boxes beside the optimal ones: {widths}."]

    def findings(self) -> Mapping[str, Any]:
        domains = []
        for name in self.groups:
            curves = [{"name": one.name, "recorded": one.recorded, "times_s": one.times} for one in self.curves(name)]
            domains.append({"domain": name, "instances": len(self.of(group=name)), "curves": curves})
        return {"totals": self.totals, "domains": domains}

    def printed(self, row: Figure3Row) -> dict[str, Any]:
        facts = {"envelope": ("first_widening_wall_s", "box"), "region": ("polyhedra",), "check": ("verdict",)}
        verbs = {one.name: one.verb for one in self.contenders}
        runs = {name: run.printed(*COST, *facts[verbs[name]]) for name, run in row.runs.items()}
        return {
            "instance": row.name,
            "domain": row.group,
            "runs": {name: {**run, "box": run["box"] or None} if "box" in run else run for name, run in runs.items()},
            "recorded": {"irr": plain(row.instance.irr), "ccmmz": plain(row.instance.ccmmz)},
            "checks": plain(row.checks),
        }

    def contents(self) -> list[Table]:
        """One table for each domain, and the checks."""
        solved = [*map(self.solved, self.groups)]
        return solved if self.contenders == (IRR,) else [*solved, Table.of("Exact methods", CHECKS, self.rows)]

    def panels(self) -> list[Panel]:
        """One panel for each domain: the time of each instance solved, in ascending order for each method."""
        return [self._panel(domain, len(self.of(group=domain))) for domain in self.groups]

    def _panel(self, domain: str, size: int) -> Panel:
        lines = []
        for curve in self.curves(domain):
            points = [(place, max(time, SHORTEST)) for place, time in enumerate(curve.times, 1)]
            if points:
                lines.append(Series(points, curve.label, *STYLES.get(curve.name, OTHER), 3.5, look={"linewidth": 1.2}))
        time, axes = "time for each (ours and recorded: different machines)", {"xlim": (0.5, size + 0.5)}
        return Panel(f"{domain}: {size}", lines, "instances solved", time, seconds="y", axes=axes)


def _tasks(options: Figure3Options, instances: Sequence[RecordedInstance]) -> list[Task]:
    return [
        Task(f"{instance.name}, {one.label}", (instance, one, options.own_limits.get(one.name, options.limit)))
        for instance in instances
        for one in options.contenders or CONTENDERS
        if one.name != RECORDED_BOX.name or instance.box is not None
    ]


def _rows(_options: Figure3Options, instances: Sequence[RecordedInstance], results: Results) -> list[Figure3Row]:
    runs = contenders.by_instance(results)
    return [Figure3Row(one, runs[one.name]) for one in instances if one.name in runs]


FIGURE3 = on_suite("figure3", Figure3Options, _tasks, run_contender, Figure3Report, lambda run: run.line, collect=_rows)
