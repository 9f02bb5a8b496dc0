"""`robust bench rates`: how often PIKE, Kirk and Drake carry a plan out correctly, with the same people.

The paper compares PIKE with Kirk by re-plans and time in a domain where both arrive [PIKE §6.2.1]. Here what counts is
whether they arrive at all: people mean something that some correct execution has, which is drawn before, and activities
take any time within their bounds. All executives meet the same people and the same lengths.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from random import Random
from statistics import fmean
from typing import ClassVar

from robust.backends import SMT
from robust.pike_bridge.action_model import shipped
from robust.pike_bridge.builder import k_intents
from robust.pike_bridge.model import ALWAYS, Assignment, TeamPlan
from robust.pike_bridge.semantics import ExecutionExistence, Oracle

from ..catalogue import RatesOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import Columns, Table, number
from ..generators.team_plans import blocks
from .baselines import Mode, draw_script
from .figure17_18 import TeamExecution, execute

PLANS: Mapping[str, Callable[[], TeamPlan]] = {
    "kitchen": lambda: shipped("kitchen").plan(),
    "wing": lambda: shipped("wing").plan(),
    "k-intents 3,3": k_intents((3, 3)).instance.plan,
    "2 blocks": lambda: blocks(2).plan(),
}
MODES = (Mode.PIKE, Mode.EAGER, Mode.KIRK, Mode.DRAKE)


def draw_intent(plan: TeamPlan, seed: int | str) -> dict[str, str]:
    """What people mean: values of their choices that some correct execution has, drawn one after the other."""
    random, oracle = Random(f"intent/{seed}"), Oracle(plan)  # noqa: S311 - reproducible
    meant = ALWAYS
    for choice in plan.network.choices:
        for value in () if choice.controllable else random.sample(choice.domain, len(choice.domain)):
            more = meant | {Assignment(choice.name, value)}
            if oracle.decide(more).verdict is ExecutionExistence.EXISTS:
                meant = more
                break
    return dict(meant)


@dataclass(frozen=True, slots=True)
class RatedRun:
    """One plan, carried out by all, with the same people."""

    plan: str
    seed: int
    meant: Mapping[str, str]
    executions: Mapping[str, TeamExecution]
    """By mode."""


def measure(name: str, seed: int, limit: float | None) -> RatedRun:
    """All executions of a plan with one intent and one length of each activity."""
    plan = PLANS[name]()
    meant = draw_intent(plan, f"{name}/{seed}")
    script = replace(draw_script(plan, f"{name}/{seed}"), outcomes=meant)
    recovery = {each.action: each.lower / 2 for each in plan.network.activities}
    executions = {mode.value: execute(mode, plan, script, SMT, recovery=recovery, limit=limit) for mode in MODES}
    return RatedRun(name, seed, meant, executions)


# -- the report --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class PlanRate:
    """All executions of a plan by one executive."""

    plan: str
    mode: str
    executions: Sequence[TeamExecution]

    @property
    def succeeded(self) -> list[TeamExecution]:
        return [each for each in self.executions if each.succeeded]

    @property
    def time(self) -> float | None:
        return fmean(float(each.time) for each in self.succeeded) if self.succeeded else None


NAMES = {"pike": "PIKE, patient", "eager": "PIKE, eager as in the paper", "kirk": "Kirk", "drake": "Drake"}
COLUMNS: Columns[PlanRate] = {
    "plan": lambda one: one.plan,
    "executive": lambda one: NAMES[one.mode],
    "executions": lambda one: len(one.executions),
    "succeeded": lambda one: len(one.succeeded),
    "succeeded, %": lambda one: number(100 * len(one.succeeded) / len(one.executions), 1),
    "re-plans, mean": lambda one: number(fmean(each.replans for each in one.executions), 2),
    "time of successes, mean": lambda one: (
        number(fmean(float(e.time) for e in one.succeeded), 2) if one.succeeded else None
    ),
}


class RatesReport(Report[RatedRun]):
    """How often executions succeed (`robust bench rates`). People mean something that some correct execution has, and
    activities take any time within their bounds, uniformly; all executives meet the same. PIKE waits for people as long
    as it can (*patient*), or acts as soon as it can (*eager*). Kirk guesses all choices, and plans anew, with
    recoveries of half of the least duration, where people choose otherwise. Drake knows choices and times only. A
    success counts if a referee confirms it.
    """

    TITLE = "Who arrives"
    SETTINGS: ClassVar[Mapping[str, str]] = {name: name for name in ("seed", "runs", "limit", "jobs")}
    ROWS = "executions"

    def sound(self) -> bool:
        """Whether only Drake took for a success what was none, and PIKE never planned anew."""
        others = [
            (mode, each) for run in self.rows for mode, each in run.executions.items() if mode != Mode.DRAKE.value
        ]
        return not any(each.outcome == "incorrect" or (mode != "kirk" and each.replans) for mode, each in others)

    def contents(self) -> list[Table]:
        rates = [
            PlanRate(name, mode.value, [run.executions[mode.value] for run in runs])
            for name in PLANS
            if (runs := [run for run in self.rows if run.plan == name])
            for mode in MODES
        ]
        return [Table.of("How often executions succeed", COLUMNS, rates)]


def _tasks(options: RatesOptions, _: object) -> list[Task]:
    return [
        Task(f"{name} {options.seed + at}", (name, options.seed + at, options.limit))
        for name in options.plans or PLANS
        for at in range(options.runs)
    ]


def _describe(run: RatedRun) -> str:
    return ", ".join(f"{mode} {each.outcome}" for mode, each in run.executions.items())


RATES = Experiment("rates", RatesOptions, _tasks, measure, RatesReport, _describe)
