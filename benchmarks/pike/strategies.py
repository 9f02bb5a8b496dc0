"""`robust bench strategies`: whether plans with choices are controllable, and executions that follow the strategy.

Kitchen and wing, and blocks of 13 activities for two people and a robot with one limit over all, which is a little
more, or a little less, than all of them need at worst.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from time import process_time
from typing import ClassVar

from robust.pike_bridge.action_model import shipped
from robust.pike_bridge.game.controllability import DecidingControllability
from robust.pike_bridge.game.following import StrategyRehearsal
from robust.pike_bridge.game.rules import GameRules
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online.world import Ending, Human, Pace, Story
from robust.smt.limits import Deadline

from ..catalogue import StrategiesOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import Columns, Table
from ..engine.show import number as rounded
from ..generators.team_plans import blocks

PLANS = ("kitchen", "wing", "blocks-1", "blocks-4", "blocks-8", "blocks-16")
LIMITS = {"enough": Fraction("1.01"), "too little": Fraction(1)}
"""As shares of what activities take at worst, without the ε between them."""


@dataclass(frozen=True, slots=True)
class DecidedPlan:
    """One plan, for people who choose only what some correct execution has if they are rational.

    Attributes:
        limit: how much time there is for all.
        situations: that break it; parts of the plan that take too long together are one.
        seconds: of processor time, for the verdict.
        succeeded: of the executions, with random lengths and choices.
        fallen: executions that left the strategy.
    """

    plan: str
    activities: int
    rational: bool
    limit: str
    verdict: str
    reason: str | None
    parts: int
    cases: int
    policies: int
    situations: int
    seconds: float
    executions: int
    succeeded: int
    fallen: int


def _plan(name: str, limit: str) -> TeamPlan:
    count = name.removeprefix("blocks-")
    return blocks(int(count), slack=LIMITS[limit]).plan() if count != name else shipped(name).plan()


def measure(name: str, rational: bool, limit: str, runs: int, seconds: float | None) -> DecidedPlan:
    """The verdict and the executions of a plan."""
    plan, started = _plan(name, limit), process_time()
    found = DecidingControllability(plan, GameRules(rational=rational), deadline=Deadline.after(seconds)).run()
    taken = process_time() - started
    human = Human.RATIONAL if rational else Human.CARELESS
    succeeded = fallen = 0
    for seed in range(runs if found.strategy is not None else 0):
        story = Story(human=human, pace=Pace.RANDOM)
        rehearsal = StrategyRehearsal(plan, story, seed, infer=False, known_strategy=found.strategy)
        succeeded += rehearsal.run().ending is Ending.SUCCEEDED
        fallen += not rehearsal.was_followed
    return DecidedPlan(
        name,
        len(plan.network.activities),
        rational,
        limit,
        found.verdict.value,
        found.reason,
        found.parts,
        found.cases,
        found.policies,
        len(found.situations),
        round(taken, 3),
        0 if found.strategy is None else runs,
        succeeded,
        fallen,
    )


# -- the report --------------------------------------------------------------------------------------------------------

COLUMNS: Columns[DecidedPlan] = {
    "plan": lambda one: one.plan,
    "activities": lambda one: str(one.activities),
    "people": lambda one: "rational" if one.rational else "any",
    "limit": lambda one: one.limit if one.plan.startswith("blocks") else "its own",
    "verdict": lambda one: one.verdict,
    "parts": lambda one: str(one.parts),
    "cases": lambda one: str(one.cases),
    "policies tried": lambda one: str(one.policies),
    "situations": lambda one: str(one.situations),
    "seconds": lambda one: rounded(one.seconds, 2),
    "executions": lambda one: str(one.executions),
    "succeeded": lambda one: str(one.succeeded),
    "left the strategy": lambda one: str(one.fallen),
}


class StrategiesReport(Report[DecidedPlan]):
    """Whether some strategy succeeds whatever people choose and however long activities take (`robust bench
    strategies`), in processor time, and executions that follow it, with random choices and lengths. Blocks have one
    limit over all: *enough* is 1 % more than activities take at worst, *too little* leaves nothing for the ε between
    them. *Rational* people choose only what some correct execution has. *Cases* are joint values of people's choices,
    in each of the parts that are decided apart.
    """

    TITLE = "Whatever happens"
    SETTINGS: ClassVar[Mapping[str, str]] = {name: name for name in ("runs", "limit", "jobs")}
    ROWS = "plans"

    def sound(self) -> bool:
        """Whether all executions of controllable plans succeeded."""
        return all(one.succeeded == one.executions and not one.fallen for one in self.rows)

    def contents(self) -> list[Table]:
        return [Table.of("Whether plans with choices are controllable", COLUMNS, self.rows)]


def _tasks(options: StrategiesOptions, _: object) -> list[Task]:
    kinds: Sequence[tuple[str, bool, str]] = [
        (name, rational, limit)
        for name in options.plans or PLANS
        for rational in (False, True)
        for limit in (LIMITS if name.startswith("blocks") and rational else ("enough",))
    ]
    return [Task(" ".join(map(str, kind)), (*kind, options.runs, options.limit)) for kind in kinds]


def _describe(one: DecidedPlan) -> str:
    return f"{one.verdict}, {one.seconds:.2f} s"


STRATEGIES = Experiment("strategies", StrategiesOptions, _tasks, measure, StrategiesReport, _describe)
