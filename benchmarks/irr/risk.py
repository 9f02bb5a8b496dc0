"""`robust bench risk`: bounds of the probability of success, how close they get in which time, and random points.

The plans are deliveries whose preparations last twice as long as planned on average, with the planned duration as
deviation. Random points are judged one by one, each by the questions of the containment check at that point
alone: no region and no subdivision takes part. Processor times of one process that has started already.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import robust
from robust.draw.style import BLUE, VERMILION
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError
from robust.execute.learned import distributions_of
from robust.irr.containment import Containment
from robust.json_text import plain
from robust.plan.model import ParametrizedPlan
from robust.probability.packing import SampledEstimate
from robust.qe.box import Box
from robust.smt.limits import NEVER

from ..catalogue import RiskOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import Columns, Panel, Series, Table, middle, number
from .figure4 import own_instance

LATER, DEVIATION = Fraction(2), Fraction(1)
"""The mean and the deviation of a duration, as multiples of the planned one."""
CHECKED = 4
"""Parameters up to which random points are drawn."""


@dataclass(frozen=True, slots=True)
class RiskRow:
    """One plan: bounds of the probability, and how many of the random points succeed, with their interval.

    `points_lower` and `points_upper` are None where no points were drawn.
    """

    parameters: int
    seed: int
    status: str
    lower: float
    upper: float
    cells: int
    seconds: float
    draws: int
    successes: int
    points_lower: float | None
    points_upper: float | None

    @property
    def agrees(self) -> bool:
        """Whether bounds and interval have a value in common."""
        if self.points_lower is None or self.points_upper is None:
            return True
        return self.lower <= self.points_upper and self.points_lower <= self.upper


def delivery(parameters: int, seed: int) -> ParametrizedPlan:
    """The plan with so many uncertain durations of that seed."""
    instance = own_instance(parameters, seed)
    with TemporaryDirectory() as directory:
        files = instance.write(Path(directory))
        specs = [text.removeprefix("--parameter=") for text in instance.options]
        return robust.load_plan(*files, parameters=specs)


def measure(parameters: int, seed: int, draws: int, within: Fraction, limit: float | None) -> RiskRow:
    """Bounds, and random points if there are few parameters."""
    plan = delivery(parameters, seed)
    kinds = {one.name: f"normal:{one.nominal * LATER}:{one.nominal * DEVIATION}:0" for one in plan.parameters}
    started = time.process_time()
    found = robust.risk(plan, kinds, within=within, timeout=limit)
    seconds = round(time.process_time() - started, 6)
    points = None if parameters > CHECKED or not draws else judged(plan, kinds, draws, seed)
    return RiskRow(
        parameters=parameters,
        seed=seed,
        status=found.status.value,
        lower=float(found.probability.lower),
        upper=float(found.probability.upper),
        cells=found.cells,
        seconds=seconds,
        draws=0 if points is None else points.draws,
        successes=0 if points is None else points.successes,
        points_lower=None if points is None else points.lower,
        points_upper=None if points is None else points.upper,
    )


def judged(plan: ParametrizedPlan, kinds: dict[str, str], draws: int, seed: int) -> SampledEstimate:
    """So many random points, each asked about by itself."""
    random = Random(seed)  # noqa: S311 - an experiment
    distributions = {name: one.settled for name, one in distributions_of(plan, kinds).items()}
    checker = Containment(RelationalEncoding(plan))
    successes = 0
    for _ in range(draws):
        point = {name: one.draw(random, None) for name, one in distributions.items()}
        checker.__dict__.pop("_refuted", None)  # what was refuted before says nothing of other points
        successes += checker.contains(Box.point(point), NEVER)
    return SampledEstimate.of(successes, draws)


Group = tuple[int, Sequence[RiskRow]]
COLUMNS: Columns[Group] = {
    "parameters": lambda one: one[0],
    "plans": lambda one: len(one[1]),
    "complete": lambda one: sum(row.status == "complete" for row in one[1]),
    "probability, from": lambda one: number(min(row.lower for row in one[1]), 4),
    "to": lambda one: number(max(row.upper for row in one[1]), 4),
    "width": lambda one: number(middle(row.upper - row.lower for row in one[1]), 5),
    "widest": lambda one: number(max(row.upper - row.lower for row in one[1]), 5),
    "cells": lambda one: number(middle(float(row.cells) for row in one[1]), 0),
    "s": lambda one: number(middle(row.seconds for row in one[1]), 2),
    "points agree": lambda one: _agreement(one[1]),
}


def _agreement(rows: Sequence[RiskRow]) -> str:
    drawn = [row for row in rows if row.draws]
    return f"{sum(row.agrees for row in drawn)}/{len(drawn)}" if drawn else ""


class RiskReport(Report[RiskRow]):
    """Delivery plans whose durations are normal, medians (`robust bench risk`). All figures are ours."""

    TITLE = "Probabilities of success"
    LAYOUT = (5, 4, "upper left")

    def sound(self) -> bool:
        """Whether random points agree with all bounds."""
        return all(row.agrees for row in self.rows)

    def remarks(self) -> Sequence[str]:
        limit, drawn = self.options.limit, [row for row in self.rows if row.draws]
        stopped = "" if limit is None else f", stopped at {limit:g} s of wall time"
        count = self.options.draws
        return [
            f"bounds at most {self.options.within} apart, processor time with all boxes and shares{stopped}",
            f"up to {CHECKED} parameters {count} random points each, checked one by one; their interval of Clopper and "
            f"Pearson (99.9 %) meets the bounds on {sum(row.agrees for row in drawn)} of {len(drawn)} plans",
        ]

    def printed(self, row: RiskRow) -> Any:
        return plain(row)

    def groups(self) -> list[Group]:
        """The rows of each number of parameters."""
        return [(size, self.of(parameters=size)) for size in sorted({row.parameters for row in self.rows})]

    def contents(self) -> list[Table]:
        return [Table.of("Deliveries", COLUMNS, self.groups(), whole=False)]

    def panels(self) -> list[Panel]:
        found = [(size, rows) for size, rows in self.groups()]
        times = [(float(size), middle(row.seconds for row in rows) or 0.0) for size, rows in found]
        widths = [(float(size), max(row.upper - row.lower for row in rows)) for size, rows in found]
        return [
            Panel("Time", [Series(times, "s", BLUE, "-", "o")], "parameters", "time", seconds="y"),
            Panel("Width of the bounds", [Series(widths, "widest", VERMILION, "-", "s")], "parameters", "width"),
        ]


def _tasks(options: RiskOptions, _: object) -> list[Task]:
    if options.plans < 1:
        raise InputError(f"--plans: found {options.plans}, expected at least 1")
    settings = options.draws, Fraction(options.within), options.limit
    return [
        Task(f"{size} parameters, seed {options.seed + index}", (size, options.seed + index, *settings))
        for size in options.sizes
        for index in range(options.plans)
    ]


def _describe(row: RiskRow) -> str:
    points = f", {row.successes} of {row.draws} points" if row.draws else ""
    return f"{row.lower:.4f} to {row.upper:.4f}, {row.seconds:.2f} s{points}"


RISK = Experiment("risk", RiskOptions, _tasks, measure, RiskReport, _describe, unit="plans")
