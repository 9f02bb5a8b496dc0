"""`robust bench risk`: bounds of the probability of success, how close they get in which time, and random points.

Of deliveries, preparations last twice as long as planned on average, with the planned duration as deviation. Random
points are judged one by one, each by the questions of the containment check at that point alone: no region and no
subdivision takes part. Of job shops, and of what planners printed (`plans.json`, see :mod:`benchmarks.irr.logs`), every
duration is random, and all has to end soon after it does in the plan; random draws of the longest paths are beside.
Of recorded instances, the exact probability is compared with those of the box of exact widening and of the octagon.
Processor times of one process that has started already.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Annotated, Any

from msgspec import Meta

import robust
from robust.draw.style import BLUE, GREEN, VERMILION
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError, Location
from robust.execute.learned import distributions_of
from robust.irr.containment import Containment
from robust.json_text import from_json
from robust.plan.model import ParametrizedPlan
from robust.plan.pddl.forms import read_text
from robust.probability.measure import Bounds, Measure, box_probability
from robust.probability.packing import SampledEstimate
from robust.probability.risk import RiskResult
from robust.qe.box import Box
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

from ..catalogue import RiskOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import NOTHING, Columns, Panel, Series, Table, family, middle, number
from ..generators.shops import shop_files
from ..suite import directory_with, read_suite
from .figure4 import own_instance
from .logs import FILE_NAME

LATER, DEVIATION = Fraction(2), Fraction(1)
"""The mean and the deviation of a duration of a delivery, as multiples of the planned one."""
CHECKED = 4
"""Parameters up to which random points are judged one by one, and instances are recorded ones with octagons."""
EVERY = "truncated-normal::15%"
"""Every duration: about as planned, with that share of it as deviation."""
SOON = "+5%"
"""Of job shops and of what planners printed: how much later than planned all may end."""
SPREAD = Fraction(1, 4)
"""The deviation of a duration of a recorded instance, as a share of the planned one."""
SECONDS = (0.3, 1, 3, 10, 60)
"""Times by which the table says how close bounds were."""
CLOSE = 0.001, 0.005, 0.01
DELIVERY, SHOP, LOG, RECORDED = "delivery", "job shop", "planner", "recorded"


@dataclass(frozen=True, slots=True)
class RiskRow:
    """One plan: bounds of the probability, and how many of the random points succeed, with their interval.

    `points_lower` and `points_upper` are None where no points were drawn. `progress` are times at which bounds became
    closer, with their distance. `box` and `octagon` are shares of the probability that those keep, at least, of
    recorded instances.
    """

    kind: str
    name: str
    parameters: int
    status: str
    lower: float
    upper: float
    cells: int
    seconds: float
    draws: int
    successes: int
    points_lower: float | None
    points_upper: float | None
    progress: tuple[tuple[float, float], ...] = ()
    box: float | None = None
    octagon: float | None = None

    @property
    def width(self) -> float:
        """How far the bounds are from each other."""
        return self.upper - self.lower

    @property
    def agrees(self) -> bool:
        """Whether bounds and interval have a value in common, and an octagon keeps what its box does."""
        if self.box is not None and self.octagon is not None and self.box > self.octagon + 1e-3:
            return False
        if self.points_lower is None or self.points_upper is None:
            return True
        return self.lower <= self.points_upper and self.points_lower <= self.upper

    def width_at(self, seconds: float) -> float:
        """How far the bounds were from each other at that time."""
        return min((width for when, width in self.progress if when <= seconds), default=1.0)


@dataclass(frozen=True, slots=True)
class PlannerLog:
    """An entry of `plans.json`; paths are relative to its directory."""

    name: Annotated[str, Meta(min_length=1)]
    domain: str
    problem: str
    log: str


def delivery(parameters: int, seed: int) -> ParametrizedPlan:
    """The plan with so many uncertain durations of that seed."""
    instance = own_instance(parameters, seed)
    with TemporaryDirectory() as directory:
        files = instance.write(Path(directory))
        specs = [text.removeprefix("--parameter=") for text in instance.options]
        return robust.load_plan(*files, parameters=specs)


def _bounded(
    named: tuple[str, str], plan: ParametrizedPlan, kinds: dict[str, str], within: Fraction, limit: float | None
) -> tuple[RiskRow, RiskResult]:
    """The row of that kind and name, with bounds and what they are part of."""
    started = time.process_time()
    progress: list[tuple[float, float]] = []

    def note(bounds: Bounds) -> None:
        width = float(bounds.width)
        if not progress or width < progress[-1][1]:
            progress.append((round(time.process_time() - started, 3), width))

    found = robust.risk(plan, kinds, within=within, timeout=limit, on_bounds=note)
    seconds, points = round(time.process_time() - started, 6), found.estimate
    known = RiskRow(
        kind=named[0],
        name=named[1],
        parameters=len(plan.parameters),
        status=found.status.value,
        lower=float(found.probability.lower),
        upper=float(found.probability.upper),
        cells=found.cells,
        seconds=seconds,
        draws=0 if points is None else points.draws,
        successes=0 if points is None else points.successes,
        points_lower=None if points is None else points.lower,
        points_upper=None if points is None else points.upper,
        progress=tuple(progress),
    )
    return known, found


def delivered(parameters: int, seed: int, draws: int, within: Fraction, limit: float | None) -> RiskRow:
    """Bounds of a delivery, and random points if there are few parameters."""
    plan = delivery(parameters, seed)
    kinds = {one.name: f"normal:{one.nominal * LATER}:{one.nominal * DEVIATION}:0" for one in plan.parameters}
    row, _ = _bounded((DELIVERY, f"seed {seed}"), plan, kinds, within, limit)
    if parameters > CHECKED or not draws:
        return row
    points = judged(plan, kinds, draws, seed)
    return replace(row, draws=draws, successes=points.successes, points_lower=points.lower, points_upper=points.upper)


def with_every_duration(
    kind: str, name: str, files: Sequence[str | Path], within: Fraction, limit: float | None
) -> RiskRow:
    """Bounds of what a planner printed, with every duration random."""
    plan = robust.load_plan(*files, parameters=["duration:*"], deadline=SOON)
    return _bounded((kind, name), plan, {"*": EVERY}, within, limit)[0]


def shop(parts: int, seed: int, within: Fraction, limit: float | None) -> RiskRow:
    """Bounds of a job shop."""
    with TemporaryDirectory() as directory:
        return with_every_duration(SHOP, f"seed {seed}", shop_files(parts, seed, Path(directory)), within, limit)


def recorded(name: str, files: Sequence[str | Path], within: Fraction, limit: float | None) -> RiskRow:
    """Bounds of a recorded instance, and what its box and its octagon keep."""
    plan = robust.load_plan(*files)
    kinds = {one.name: f"normal:{one.nominal}:{one.nominal * SPREAD}" for one in plan.parameters}
    row, found = _bounded((RECORDED, name), plan, kinds, within, limit)
    shape = robust.envelope(plan, shape="octagon", timeout=limit)
    if shape.shape is None or not row.lower:
        return row
    octagon = Measure([(shape.shape.polyhedron, ())], found.distributions)
    with suppress(OutOfTimeError):
        octagon.run(within, Deadline.after(limit))
    box = box_probability(shape.box, found.distributions).lower
    return replace(row, box=float(box) / row.upper, octagon=float(octagon.bounds.lower) / row.upper)


def measure(kind: str, *values: Any) -> RiskRow:
    """One plan of that kind."""
    makers: Mapping[str, Callable[..., RiskRow]] = {
        DELIVERY: delivered,
        SHOP: shop,
        LOG: partial(with_every_duration, LOG),
        RECORDED: recorded,
    }
    return makers[kind](*values)


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
    "width": lambda one: number(middle(row.width for row in one[1]), 5),
    "widest": lambda one: number(max(row.width for row in one[1]), 5),
    "cells": lambda one: number(middle(float(row.cells) for row in one[1]), 0),
    "s": lambda one: number(middle(row.seconds for row in one[1]), 2),
    "points agree": lambda one: _agreement(one[1]),
}
EVERY_COLUMNS: Columns[RiskRow] = {
    "plan": lambda row: f"{row.name}" if row.kind == LOG else f"{row.kind}, {row.name}",
    "durations": lambda row: row.parameters,
    "probability, from": lambda row: number(row.lower, 4),
    "to": lambda row: number(row.upper, 4),
    **family("gap, {:g} s", SECONDS, lambda seconds, row: number(row.width_at(seconds), 4)),
    "gap": lambda row: number(row.width, 5),
    "s": lambda row: number(row.seconds, 2),
    "draws": lambda row: number(row.successes / row.draws, 4) if row.draws else NOTHING,
}
TIME_COLUMNS: Columns[tuple[float, Sequence[RiskRow]]] = {
    "s": lambda one: f"{one[0]:g}",
    "median gap": lambda one: number(middle(row.width_at(one[0]) for row in one[1]), 5),
    "greatest": lambda one: number(max(row.width_at(one[0]) for row in one[1]), 5),
    **family("≤ {:g}", CLOSE, lambda most, one: f"{sum(row.width_at(one[0]) <= most for row in one[1])}/{len(one[1])}"),
}
KEPT_COLUMNS: Columns[RiskRow] = {
    "instance": lambda row: row.name,
    "parameters": lambda row: row.parameters,
    "probability, from": lambda row: number(row.lower, 4),
    "to": lambda row: number(row.upper, 4),
    "kept by the box": lambda row: _percent(row.box),
    "kept by the octagon": lambda row: _percent(row.octagon),
}


def _agreement(rows: Sequence[RiskRow]) -> str:
    drawn = [row for row in rows if row.draws]
    return f"{sum(row.agrees for row in drawn)}/{len(drawn)}" if drawn else ""


def _percent(share: float | None) -> str:
    return NOTHING if share is None else f"{100 * share:.1f} %"


class RiskReport(Report[RiskRow]):
    """Plans whose durations are random (`robust bench risk`). All figures are ours."""

    TITLE = "Probabilities of success"
    LAYOUT = (5, 4, "best")

    def sound(self) -> bool:
        """Whether random points agree with all bounds, and octagons keep at least what boxes do."""
        return all(row.agrees for row in self.rows)

    def remarks(self) -> Sequence[str]:
        limit, drawn = self.options.limit, [row for row in self.rows if row.draws]
        stopped = "" if limit is None else f", stopped at {limit:g} s of wall time"
        count, asked = self.options.draws, self.options.within
        said = [
            f"bounds at most {asked} apart, processor time with all boxes and shares{stopped}; of each number of "
            "parameters of deliveries, medians",
            f"of deliveries with up to {CHECKED} parameters {count} random points each, checked one by one; of plans "
            "whose durations are all random, draws of longest paths; the interval of Clopper and Pearson (99.9 %) "
            f"meets the bounds on {sum(row.agrees for row in drawn)} of {len(drawn)} plans",
        ]
        if self.every():
            said.append(f"every duration random: {EVERY}, everything ends at most {SOON} later than planned")
        if self.of(kind=RECORDED):
            said.append(
                "recorded instances: normal durations, their deviation a quarter of what is planned; shares of the "
                "upper bound that the box of exact widening and the octagon keep at least"
            )
        return said

    def every(self) -> list[RiskRow]:
        """The plans with every duration random, by their number."""
        return sorted((*self.of(kind=SHOP), *self.of(kind=LOG)), key=lambda row: (row.kind, row.parameters))

    def groups(self) -> list[Group]:
        """The deliveries of each number of parameters."""
        deliveries = self.of(kind=DELIVERY)
        return [
            (size, [row for row in deliveries if row.parameters == size])
            for size in sorted({row.parameters for row in deliveries})
        ]

    def contents(self) -> list[Table]:
        over_time = [(seconds, self.every()) for seconds in SECONDS if self.every()]
        tables = [
            Table.of("Deliveries", COLUMNS, self.groups(), whole=False),
            Table.of("Every duration random", EVERY_COLUMNS, self.every(), whole=False),
            Table.of("Gap over time, every duration random", TIME_COLUMNS, over_time, whole=False),
            Table.of("What boxes and octagons keep", KEPT_COLUMNS, self.of(kind=RECORDED)),
        ]
        return [table for table in tables if table.rows]

    def panels(self) -> list[Panel]:
        named = {DELIVERY: (BLUE, "s"), SHOP: (VERMILION, "o"), LOG: (GREEN, "^")}
        over_time, over_size = [], []
        for kind, (colour, marker) in named.items():
            rows = self.of(kind=kind)
            points = [(float(row.parameters), max(row.width, LEAST)) for row in rows]
            over_size += [Series(points, kind, colour, "", marker)] if points else []
            for row in rows if kind != DELIVERY else ():
                steps = [*((when, max(width, LEAST)) for when, width in row.progress), (row.seconds, row.width)]
                over_time.append(Series(steps, None, colour, "-", steps=True))
        return [
            Panel("Gap over the number of random durations", over_size, "random durations", "gap", log="y"),
            Panel("Gap over time, every duration random", over_time, "processor time", "gap", log="y", seconds="x"),
        ]


LEAST = 1e-6
"""The least distance that the figure shows."""


def _tasks(options: RiskOptions, _: object) -> list[Task]:
    for name, count in (("plans", options.plans), ("shops", options.shops)):
        if count < 0:
            raise InputError(f"--{name}: found {count}, expected at least 0")
    asked = Fraction(options.within), options.limit
    tasks = [
        Task(
            f"{size} parameters, seed {options.seed + index}",
            (DELIVERY, size, options.seed + index, options.draws, *asked),
        )
        for size in options.sizes
        for index in range(options.plans)
    ]
    tasks += [
        Task(f"job shop of {parts} parts, seed {options.seed + index}", (SHOP, parts, options.seed + index, *asked))
        for parts in options.parts
        for index in range(options.shops)
    ]
    if options.logs is not None:
        directory = directory_with(FILE_NAME, options.logs)
        file = directory / FILE_NAME
        for one in from_json(list[PlannerLog], read_text(file), Location(str(file))):
            files = [str(directory / name) for name in (one.domain, one.problem, one.log)]
            tasks.append(Task(one.name, (LOG, one.name, files, *asked)))
    if options.suite is not None:
        for instance in read_suite(options.suite):
            plan = robust.load_plan(*instance.files)
            if 1 < len(plan.parameters) <= CHECKED and all(one.nominal > 0 for one in plan.parameters):
                tasks.append(Task(instance.name, (RECORDED, instance.name, [*map(str, instance.files)], *asked)))
    if not tasks:
        raise InputError("found no plan, expected at least one of --plans, --shops, --logs and --suite")
    return tasks


def _describe(row: RiskRow) -> str:
    points = f", {row.successes} of {row.draws} points" if row.draws else ""
    return f"{row.lower:.4f} to {row.upper:.4f}, {row.seconds:.2f} s{points}"


RISK = Experiment("risk", RiskOptions, _tasks, measure, RiskReport, _describe, unit="plans")
