"""`robust bench stnu`: how the time of verdicts, dispatchable networks and repairs grows with the size of a network.

The networks are schedules of teams: each agent has activities of uncertain durations one after the other, with short
breaks between them, some of which have to wait for others. Processor times of one process that has
started already.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import Any

from robust import stnu
from robust.draw.style import BLUE, ORANGE, VERMILION
from robust.errors import InputError

from ..catalogue import StnuOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import Columns, Panel, Series, Table, middle, number

AGENTS = 5
MEETINGS, TIGHT = 3, (6, 8, 10, 15)
"""How many activities have to begin soon after that of another agent, and how soon."""
BREAKS = ((5, 10, 20), (2, 5, 10))
"""The longest breaks, of networks with even seeds, most of which are controllable, and of the others."""
DISPATCHED = 200
"""Time points up to which a minimal dispatchable network is made: it takes all shortest paths."""


@dataclass(frozen=True, slots=True)
class StnuRow:
    """One network; processor seconds, None where nothing was asked. `repair_gap` is 0 for an optimal repair."""

    size: int
    seed: int
    links: int
    contingent: int
    controllable: bool
    witnessed: bool
    check_s: float
    dispatch_s: float | None
    repair_s: float | None
    repair_gap: float | None
    conflicts: int | None


def team_network(size: int, seed: int) -> stnu.Network:
    """A schedule of a team with that many time points, two for each activity."""
    rng = Random(seed)  # noqa: S311 - an experiment
    activities = size // 2
    nodes = [f"{kind}{at}" for at in range(activities) for kind in ("s", "e")]
    tight = set(rng.sample(range(activities), MEETINGS))
    links = []
    for at in range(activities):
        low = rng.randint(5, 20)
        links.append(_link(f"s{at}", f"e{at}", low, low + rng.randint(1, 6), contingent=True))
        before = at - AGENTS
        if before >= 0:
            slack = rng.choice(BREAKS[seed % 2])
            links.append(_link(f"e{before}", f"s{at}", 0, slack))
            other = before - before % AGENTS + rng.randrange(AGENTS)
            if other != before and (at in tight or rng.random() < 0.2):
                links.append(_link(f"e{other}", f"s{at}", 0, rng.choice(TIGHT) if at in tight else None))
    return stnu.Network(f"team {size} {seed}", tuple(nodes), tuple(links))


def _link(source: str, target: str, lower: int, upper: int | None, *, contingent: bool = False) -> stnu.Link:
    return stnu.Link(source, target, Fraction(lower), None if upper is None else Fraction(upper), contingent)


def measure(size: int, seed: int, limit: float | None) -> StnuRow:
    """Ask everything about one network."""
    network = team_network(size, seed)
    check_s, checked = _timed(lambda: stnu.check(network))
    dispatch_s = repair_s = gap = conflicts = None
    if checked.is_controllable and size <= DISPATCHED:
        dispatch_s, _ = _timed(lambda: stnu.dispatch(network))
    if not checked.is_controllable:
        repair_s, repaired = _timed(lambda: stnu.repair(network, timeout=limit))
        gap = None if repaired.gap is None else float(repaired.gap)
        conflicts = repaired.conflicts
    return StnuRow(
        size=size,
        seed=seed,
        links=len(network.links),
        contingent=len(network.contingents),
        controllable=checked.is_controllable,
        witnessed=checked.is_controllable or stnu.refutes(network, checked.cycle),
        check_s=check_s,
        dispatch_s=dispatch_s,
        repair_s=repair_s,
        repair_gap=gap,
        conflicts=conflicts,
    )


def _timed(work: Any) -> tuple[float, Any]:
    started = time.process_time()
    found = work()
    return round(time.process_time() - started, 6), found


Group = tuple[int, Sequence[StnuRow]]
COLUMNS: Columns[Group] = {
    "time points": lambda one: one[0],
    "networks": lambda one: len(one[1]),
    "controllable": lambda one: sum(row.controllable for row in one[1]),
    "check ms": lambda one: _milliseconds([row.check_s for row in one[1]]),
    "slowest": lambda one: number(1000 * max(row.check_s for row in one[1]), 1),
    "dispatch ms": lambda one: _milliseconds([row.dispatch_s for row in one[1]]),
    "repair ms": lambda one: _milliseconds([row.repair_s for row in one[1]]),
    "optimal": lambda one: f"{sum(r.repair_gap == 0 for r in one[1])}/{sum(not r.controllable for r in one[1])}",
}


def _milliseconds(seconds: Sequence[float | None]) -> str:
    found = middle(1000 * one for one in seconds if one is not None)
    return number(found, 1)


class StnuReport(Report[StnuRow]):
    """Schedules of teams of five, medians (`robust bench stnu`). All figures are ours."""

    TITLE = "Networks with uncertainty"
    LAYOUT = (5, 4, "upper left")

    def sound(self) -> bool:
        """Whether every witness holds."""
        return all(row.witnessed for row in self.rows)

    def remarks(self) -> Sequence[str]:
        limit = self.options.limit
        stopped = "" if limit is None else f", repairs stopped at {limit:g} s"
        return [f"processor time in one process, without its start; dispatch up to {DISPATCHED} time points{stopped}"]

    def groups(self) -> list[Group]:
        """The rows of each size."""
        return [(size, self.of(size=size)) for size in sorted({row.size for row in self.rows})]

    def contents(self) -> list[Table]:
        return [Table.of("Schedules of teams", COLUMNS, self.groups(), whole=False)]

    def panels(self) -> list[Panel]:
        lines = []
        for name, colour, marker in (("check_s", BLUE, "o"), ("dispatch_s", ORANGE, "s"), ("repair_s", VERMILION, "^")):
            found = [
                (size, middle(s for row in rows if (s := getattr(row, name)) is not None))
                for size, rows in self.groups()
            ]
            points = [(float(size), seconds) for size, seconds in found if seconds is not None]
            if points:
                lines.append(Series(points, name.removesuffix("_s"), colour, "-", marker))
        return [Panel("Schedules of teams of five", lines, "time points", "time", seconds="y", log="x")]


def _tasks(options: StnuOptions, _: object) -> list[Task]:
    if options.networks < 1:
        raise InputError(f"--networks: found {options.networks}, expected at least 1")
    return [
        Task(f"{size} time points, seed {options.seed + number}", (size, options.seed + number, options.limit))
        for size in options.sizes
        for number in range(options.networks)
    ]


def _describe(row: StnuRow) -> str:
    return f"{'controllable' if row.controllable else 'uncontrollable'}, {1000 * row.check_s:.1f} ms"


STNU = Experiment("stnu", StnuOptions, _tasks, measure, StnuReport, _describe, unit="networks")
