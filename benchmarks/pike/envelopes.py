"""`robust bench envelopes`: labeled regions and boxes of plans with choices, and the oracle told values instead.

The stories with one to three parameters, as regions, as boxes for whatever people choose, and as boxes for a team that
waits; random plans with up to three parameters as regions. At random points of the random plans' parameters the oracle,
told the values, says which combinations of choices are possible: as many as fit the number of questions for a point.
Processor times of one process that has started already.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import Any

from robust import pike
from robust.errors import InputError
from robust.pike_bridge.action_model import shipped
from robust.pike_bridge.envelopes.parameters import TeamParameterKind, TeamParameterSpec, parametrize, specifications
from robust.pike_bridge.envelopes.search import LabeledRegion, TeamEnvelope
from robust.pike_bridge.model import TeamPlan, guard
from robust.pike_bridge.semantics import ExecutionExistence, Oracle

from ..catalogue import EnvelopeOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import Columns, Table, middle, number
from ..generators.team_plans import MEDIUM, random_plan

STORIES: dict[str, tuple[str, ...]] = {
    "kitchen": ("coffee=duration:make-coffee", "limit=at-most:e1:e44", "late=hesitation:xA1"),
    "wing": ("pick=duration:(pick human *)", "limit=at-most:e1:e58", "fasten=duration:fasten"),
}
"""The parameters of a story; the first ones, for fewer."""
FOR_ALL = {"kitchen": ("xA1",), "wing": ("h1", "h2")}
ASKED = 6
"""Combinations that the oracle is asked about at each point."""


@dataclass(frozen=True, slots=True)
class EnvelopeRow:
    """One question about one plan; processor seconds, None if it was out of time."""

    instance: str
    question: str
    activities: int
    parameters: int
    combinations: int
    possible: int
    polyhedra: int
    queries: int
    seconds: float | None
    points: int = 0
    compared: int = 0
    """Combinations that the oracle was asked about."""
    differences: int = 0


def story(name: str, parameters: int, question: str, limit: float | None) -> EnvelopeRow:
    """A story with the first of its parameters: its region, or a box for whatever people choose."""
    plan = parametrize(shipped(name).plan(), specifications(STORIES[name][:parameters], None))
    started = time.process_time()
    if question == "region":
        region = pike.region(plan, timeout=limit)
        return _row(name, question, region, time.process_time() - started, len(region.pieces))
    box = pike.envelope(plan, for_all=FOR_ALL[name], patience=question == "waiting", timeout=limit)
    seconds = time.process_time() - started
    return _row(name, question, box, seconds, sum(len(each.pieces) for each in box.combinations))


def _row(
    instance: str, question: str, found: LabeledRegion | TeamEnvelope, seconds: float, polyhedra: int, **compared: int
) -> EnvelopeRow:
    return EnvelopeRow(
        instance=instance,
        question=question,
        activities=len(found.plan.plan.network.activities),
        parameters=len(found.plan.names),
        combinations=len(found.combinations),
        possible=sum(bool(each.pieces) for each in found.combinations),
        polyhedra=polyhedra,
        queries=found.queries,
        seconds=None if found.cut_short else round(seconds, 4),
        **compared,
    )


def random_region(seed: int, index: int, points: int, limit: float | None) -> EnvelopeRow:
    """The region of a random plan, and how often the oracle differs from it."""
    random = Random(f"envelopes/{seed}/{index}")  # noqa: S311 - reproducible
    team = random_plan(seed, index, MEDIUM).plan()
    plan = parametrize(team, _random_parameters(team, random))
    started = time.process_time()
    found = pike.region(plan, timeout=limit)
    seconds = time.process_time() - started
    asked = [_compare(found, random) for _ in range(0 if found.cut_short else points)]
    compared, differences = (sum(counts) for counts in zip((0, 0), *asked, strict=True))
    counted = {"points": len(asked), "compared": compared, "differences": differences}
    return _row(f"random {index}", "region", found, seconds, len(found.pieces), **counted)


def _random_parameters(team: TeamPlan, random: Random) -> list[TeamParameterSpec]:
    """Up to two durations, least or greatest ones, and the limit on the whole plan."""
    activities = team.network.activities
    specs = []
    for at, one in enumerate(random.sample(activities, min(2, len(activities)))):
        kind = TeamParameterKind[random.choice(("DURATION", "DURATION", "AT_LEAST", "AT_MOST"))]
        specs.append(TeamParameterSpec(kind, one.action, f"g{at}", {"default": one.lower}))
    [limit] = [one for one in team.network.constraints if one.upper is not None]
    specs.append(TeamParameterSpec(TeamParameterKind.AT_MOST, f"{limit.source}:{limit.target}", "limit"))
    return specs


def _compare(found: LabeledRegion, random: Random) -> tuple[int, int]:
    """At a random point: of how many combinations the oracle was asked, and how often it said something else."""
    values = {
        one.name: max(
            one.lower or Fraction(0), one.nominal + Fraction(random.randint(-20, 40), random.choice((1, 2, 4)))
        )
        for one in found.plan.declared
    }
    possible, combinations = set(found.possible(values)), found.combinations
    asked = random.sample(combinations, min(ASKED, len(combinations)))
    oracle, domains = Oracle(found.plan.at(values)), found.plan.plan.network.domains
    wrong = 0
    for each in asked:
        whole = guard({name: random.choice(domains[name]) for name in found.key} | dict(each.choices))
        exists = oracle.decide(whole).verdict is ExecutionExistence.EXISTS
        wrong += exists is not (each.choices in possible)
    return len(asked), wrong


def measure(work: str, arguments: tuple[Any, ...]) -> EnvelopeRow:
    """One row."""
    return story(*arguments) if work == "story" else random_region(*arguments)


Group = tuple[str, Sequence[EnvelopeRow]]
STORY: Columns[EnvelopeRow] = {
    "plan": lambda row: row.instance,
    "question": lambda row: row.question,
    "parameters": lambda row: row.parameters,
    "combinations": lambda row: row.combinations,
    "possible": lambda row: row.possible,
    "polyhedra": lambda row: row.polyhedra,
    "queries": lambda row: row.queries,
    "s": lambda row: number(row.seconds, 2),
}
RANDOM: Columns[Group] = {
    "activities": lambda one: one[0],
    "plans": lambda one: len(one[1]),
    "complete": lambda one: sum(row.seconds is not None for row in one[1]),
    "polyhedra": lambda one: middle(row.polyhedra for row in one[1]),
    "most": lambda one: max(row.polyhedra for row in one[1]),
    "median s": lambda one: number(middle(row.seconds for row in one[1] if row.seconds is not None), 2),
    "slowest s": lambda one: number(max((row.seconds for row in one[1] if row.seconds is not None), default=None), 2),
    "points": lambda one: sum(row.points for row in one[1]),
    "compared": lambda one: sum(row.compared for row in one[1]),
    "differences": lambda one: sum(row.differences for row in one[1]),
}
SIZES = (10, 20, 40, 80)


class EnvelopeReport(Report[EnvelopeRow]):
    """Polyhedra by choices, boxes whatever is chosen, and the oracle that is told values (`robust bench envelopes`).
    All figures are ours.
    """

    TITLE = "Envelopes of plans with choices"

    def sound(self) -> bool:
        """Whether the oracle never differs."""
        return not any(row.differences for row in self.rows)

    def remarks(self) -> Sequence[str]:
        limit = self.options.limit
        stopped = "" if limit is None else f"; stopped at {limit:g} s"
        return [f"processor time in one process, without its start{stopped}"]

    def groups(self) -> list[Group]:
        """Random plans by the number of their activities."""
        rows = [row for row in self.rows if row.instance.startswith("random")]
        found: list[Group] = []
        for low, high in zip((0, *SIZES), (*SIZES, None), strict=True):
            inside = [row for row in rows if row.activities > low and (high is None or row.activities <= high)]
            if inside:
                found.append((f"{low + 1} to {high}" if high is not None else f"more than {low}", inside))
        return found

    def contents(self) -> list[Table]:
        stories = [row for row in self.rows if not row.instance.startswith("random")]
        return [
            Table.of("Stories", STORY, stories, whole=False),
            Table.of("Random plans with up to three parameters", RANDOM, self.groups(), whole=False),
        ]


def _tasks(options: EnvelopeOptions, _: object) -> list[Task]:
    if options.plans < 0 or options.points < 0:
        raise InputError("--plans and --points: found a number below 0, expected at least 0")
    stories = [
        Task(f"{name}, {question}, {count} parameters", ("story", (name, count, question, options.limit)))
        for name in STORIES
        for question in ("region", "for all", "waiting")
        for count in range(1, 4)
    ]
    return stories[:: options.every] + [
        Task(f"random plan {index}", ("random", (options.seed, index, options.points, options.limit)))
        for index in range(options.plans)
    ]


def _describe(row: EnvelopeRow) -> str:
    took = "out of time" if row.seconds is None else f"{row.seconds:.2f} s"
    return f"{row.polyhedra} polyhedra, {took}{f', {row.differences} differences' if row.differences else ''}"


ENVELOPES = Experiment("envelopes", EnvelopeOptions, _tasks, measure, EnvelopeReport, _describe, unit="questions")
