"""Plans for the first problem of the tables, by hand: the first order, and the second one after giving it up."""

from __future__ import annotations

from fractions import Fraction

from benchmarks.generators.delivery import PREPARATIONS
from robust.plan.timed import TimedPlan, TimedStep, write_timed_plan

_GAP = Fraction(1, 1000)


def _plan(*parts: tuple[str, int]) -> str:
    """Steps one after the other, a gap between them; `prepare SPINDLE` stands for all preparation steps at once."""
    now, steps = Fraction(0), []
    for text, duration in parts:
        name, *arguments = text.split()
        if name == "prepare":
            for i, (step, length) in enumerate(PREPARATIONS.items()):
                start = now + (len(PREPARATIONS) - 1 - i) * _GAP  # the longest one first
                steps.append(TimedStep(start, f"prepare_{step}", ("robot1", *arguments, "base_station"), length))
        else:
            steps.append(TimedStep(now, name, ("robot1", *arguments), Fraction(duration)))
        now += duration + _GAP
    return write_timed_plan(TimedPlan(tuple(steps)))


def _base(spindle: str, start: str, length: int) -> tuple[tuple[str, int], ...]:
    return (
        (f"move {start} shelf", length),
        (f"collect {spindle} shelf", 15),
        ("move shelf base_station", 15),
        (f"prepare {spindle}", 170),
    )


FIRST_ORDER = _plan(
    *_base("spindle1_1", "dock1", 20),
    ("assemble spindle1_1 base_station level0", 40),
    ("move base_station ring_station", 35),
    ("mount spindle1_1 ring_station level0 level1", 35),
    ("move ring_station gate1", 60),
    ("deliver spindle1_1 order1 gate1 level1", 24),
)
SECOND_ORDER = _plan(
    *_base("spindle1_1", "dock1", 20),
    ("dispose spindle1_1 base_station", 10),
    *_base("spindle2_1", "base_station", 15),
    ("assemble spindle2_1 base_station level0", 40),
    ("move base_station ring_station", 35),
    *((f"mount spindle2_1 ring_station level{i} level{i + 1}", 35) for i in range(3)),
    ("move ring_station gate2", 80),
    ("deliver spindle2_1 order2 gate2 level3", 24),
)
