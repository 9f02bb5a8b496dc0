"""One problem of the k-intents domain, executed by PIKE and by Kirk in the same world [PIKE §6.2.1]."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from robust.execute.drive import run_in_world
from robust.pike_bridge.generators.k_intents import random_k_intents
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online.baselines.interface import Mode, TeamExecutive, execution_faults, make_executive
from robust.pike_bridge.online.baselines.kirk import KirkDecision
from robust.pike_bridge.online.baselines.script import Script, ScriptedTeam, draw_script
from robust.pike_bridge.online.progress import Message, Succeeded
from robust.pike_bridge.online.reasoners import make_reasoner
from robust.smt.limits import Deadline, OutOfTimeError


@dataclass(frozen=True, slots=True)
class KIntentsTask:
    """A problem of a seed; each executive has `limit` seconds for it."""

    seed: int
    index: int
    largest: int
    reasoner: str
    limit: float | None

    @property
    def label(self) -> str:
        return f"k-intents {self.seed}/{self.index}"


class _Timed:
    """An executive whose computing is measured."""

    def __init__(self, executive: TeamExecutive) -> None:
        self._executive = executive
        self.seconds = 0.0

    def step(self, now: Fraction, messages: Sequence[Message]) -> Sequence[KirkDecision]:
        started = time.perf_counter()
        decisions = self._executive.step(now, messages)
        self.seconds += time.perf_counter() - started
        return decisions

    @property
    def wake(self) -> Fraction | None:
        started = time.perf_counter()
        wake = self._executive.wake
        self.seconds += time.perf_counter() - started
        return wake

    @property
    def ended(self) -> bool:
        return self._executive.ended


def do(task: KIntentsTask) -> dict[str, Any]:
    """Draw the problem and its world, and execute it by both; times as exact texts, seconds as floats."""
    problem = random_k_intents(task.seed, task.index, task.largest)
    plan = problem.instance.plan()
    script = draw_script(plan, f"{task.seed}/{task.index}")

    def executed(mode: Mode) -> dict[str, Any]:
        deadline = Deadline.after(task.limit)
        reasoner = make_reasoner(task.reasoner, deadline=deadline)
        recovery = problem.recovery if mode is Mode.KIRK else {}
        return execute(plan, script, lambda: make_executive(mode, plan, reasoner, recovery=recovery, deadline=deadline))

    return {"structure": list(problem.structure), **{mode.value: executed(mode) for mode in (Mode.PIKE, Mode.KIRK)}}


def execute(plan: TeamPlan, script: Script, make: Callable[[], TeamExecutive]) -> dict[str, Any]:
    """One execution.

    `seconds` is the computing during execution: steps, re-plans, and finding out when to look again. What is computed
    before, such as the first guess, does not count [PIKE §6.2.1].
    """
    executive: TeamExecutive | None = None
    seconds = 0.0
    try:
        executive = make()
        executive.prepare()
        timed = _Timed(executive)
        run_in_world(timed, ScriptedTeam(plan, executive, script))
        seconds = timed.seconds
    except OutOfTimeError:
        outcome = "timeout"
    else:
        outcome = "waiting" if executive.outcome is None else type(executive.outcome).__name__.lower()
        if isinstance(executive.outcome, Succeeded) and execution_faults(plan, executive):
            outcome = "incorrect"
    return {
        "outcome": outcome,
        "time": None if executive is None else str(executive.progress.now),
        "replans": 0 if executive is None else executive.replans,
        "recovery": "0" if executive is None else str(executive.recovered),
        "seconds": seconds,
    }
