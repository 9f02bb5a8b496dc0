"""How long the executive of plans with choices takes to decide, on random plans [PIKE §6.2.2, Figure 20b]."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.execute.drive import simulate
from robust.pike_bridge.generators.random_plans import random_plan
from robust.pike_bridge.online.companion import Accompanied
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.messages import Decision, Message
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import SimulatedTeam, Story


@dataclass(frozen=True, slots=True)
class Latency:
    """One execution: seconds of preparation, of each step, and of finding out when to look again."""

    instance: str
    activities: int
    outcome: str
    preparation: float
    steps: tuple[float, ...]
    wakes: tuple[float, ...]


class _Timed:
    """An executive whose steps and wakes are measured."""

    def __init__(self, executive: PlanExecutive) -> None:
        self._executive = executive
        self.steps: list[float] = []
        self.wakes: list[float] = []

    def step(self, now: Fraction, messages: Sequence[Message]) -> list[Decision]:
        started = time.perf_counter()
        decisions = self._executive.step(now, messages)
        self.steps.append(time.perf_counter() - started)
        return decisions

    @property
    def wake(self) -> Fraction | None:
        started = time.perf_counter()
        wake = self._executive.wake
        self.wakes.append(time.perf_counter() - started)
        return wake

    @property
    def ended(self) -> bool:
        return self._executive.ended


def measure_latencies(
    indices: Sequence[int], *, seed: int = 0, on_result: Callable[[Latency], None] | None = None
) -> list[Latency]:
    """One simulated execution of each of the random plans of these numbers, with a rational team.

    The judge who advises the team is a reasoner of its own, so that its work is not the executive's.
    """
    found: list[Latency] = []
    for index in indices:
        latency = _measure(index, seed)
        found.append(latency)
        if on_result is not None:
            on_result(latency)
    return found


def _measure(index: int, seed: int) -> Latency:
    plan = random_plan(seed, index).plan()
    judges: list[SemanticReasoner] = []

    def both(progress: Progress) -> Accompanied:
        judges.append(SemanticReasoner(progress))
        return Accompanied(SemanticReasoner(progress), judges[0])

    started = time.perf_counter()
    executive = PlanExecutive(plan, both)
    executive.prepare()
    preparation = time.perf_counter() - started
    timed = _Timed(executive)
    simulate(timed, SimulatedTeam(plan, executive, judges[0], Story(), seed=index))
    outcome = "none" if executive.outcome is None else type(executive.outcome).__name__.lower()
    activities = len(plan.network.activities)
    return Latency(
        f"random_{seed}_{index:03}", activities, outcome, preparation, tuple(timed.steps), tuple(timed.wakes)
    )
