"""How long the executive of plans with choices takes to decide, on random plans [PIKE §6.2.2, Figure 20b]."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.execute.drive import run_in_world
from robust.pike_bridge.generators.random_plans import random_plan
from robust.pike_bridge.model import Assignment, Condition, Effect, TeamPlan
from robust.pike_bridge.online.companion import Accompanied
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Decision, Message, Progress
from robust.pike_bridge.online.reasoners import SMT, make_reasoner
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import SimulatedTeam, Story
from robust.smt.limits import Deadline, OutOfTimeError

TIMEOUT = "timeout"
NO_DEADLINE = Deadline()


@dataclass(frozen=True, slots=True)
class Latency:
    """One execution: seconds of preparation, of each step, and of finding out when to look again."""

    instance: str
    activities: int
    outcome: str
    """`succeeded`, `failed`, `none` if something was still awaited in the end, or `timeout`."""
    preparation: float
    """To compile the plan, and to find out that a correct execution exists."""
    steps: tuple[float, ...]
    wakes: tuple[float, ...]
    decisions: tuple[str, ...] = ()
    """What was decided, in order."""


class _Timed:
    """An executive whose steps and wakes are measured, without what its companion does meanwhile."""

    def __init__(self, executive: PlanExecutive, judge: _TimedJudge) -> None:
        self._executive = executive
        self._judge = judge
        self.steps: list[float] = []
        self.wakes: list[float] = []
        self.decisions: list[str] = []

    def step(self, now: Fraction, messages: Sequence[Message]) -> list[Decision]:
        started, aside = time.perf_counter(), self._judge.seconds
        decisions = self._executive.step(now, messages)
        self.steps.append(time.perf_counter() - started - (self._judge.seconds - aside))
        self.decisions += map(str, decisions)
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


class _TimedJudge(SemanticReasoner):
    """Who advises the team, with the seconds that it takes to be told facts."""

    def __init__(self, progress: Progress) -> None:
        super().__init__(progress)
        self.seconds = 0.0

    def observed(self, assignment: Assignment) -> None:
        started = time.perf_counter()
        super().observed(assignment)
        self.seconds += time.perf_counter() - started

    def executed(self, event: str) -> None:
        started = time.perf_counter()
        super().executed(event)
        self.seconds += time.perf_counter() - started

    def voided(self, effect: Effect, condition: Condition) -> None:
        started = time.perf_counter()
        super().voided(effect, condition)
        self.seconds += time.perf_counter() - started

    def advanced(self) -> None:
        started = time.perf_counter()
        super().advanced()
        self.seconds += time.perf_counter() - started


def measure_latencies(
    indices: Sequence[int], *, seed: int = 0, on_result: Callable[[Latency], None] | None = None
) -> list[Latency]:
    """One simulated execution of each of the random plans of these numbers, with a rational team, by `smt`."""
    found: list[Latency] = []
    for index in indices:
        latency = measure_latency(index, seed=seed)
        found.append(latency)
        if on_result is not None:
            on_result(latency)
    return found


def measure_latency(index: int, *, seed: int = 0, backend: str = SMT, deadline: Deadline = NO_DEADLINE) -> Latency:
    """One simulated execution of the random plan of that number, with a rational team.

    The judge who advises the team is a reasoner of its own, so that its work is not the executive's. The story depends
    on nothing but the numbers, so that it is the same for all back ends as long as they decide the same.

    Args:
        backend: the name of a reasoner.
        deadline: for compilation and execution together; what was measured before it passes is kept.

    Raises:
        InputError: if there is no such reasoner.
    """
    plan = random_plan(seed, index).plan()
    return _Measurement(f"random_{seed}_{index:03}", plan, backend, deadline).run(index)


class _Measurement:
    def __init__(self, instance: str, plan: TeamPlan, backend: str, deadline: Deadline) -> None:
        self._instance = instance
        self._plan = plan
        self._deadline = deadline
        self._make = make_reasoner(backend, deadline=deadline)
        self._timed: _Timed | None = None
        self._preparation = 0.0

    def run(self, seed: int) -> Latency:
        try:
            outcome = self._execute(seed)
        except OutOfTimeError:
            outcome = TIMEOUT
        timed = self._timed
        steps, wakes, decisions = (timed.steps, timed.wakes, timed.decisions) if timed else ([], [], [])
        activities = len(self._plan.network.activities)
        return Latency(
            self._instance, activities, outcome, self._preparation, tuple(steps), tuple(wakes), tuple(decisions)
        )

    def _execute(self, seed: int) -> str:
        judges: list[_TimedJudge] = []

        def both(progress: Progress) -> Accompanied:
            judges.append(_TimedJudge(progress))
            started = time.perf_counter()
            try:
                return Accompanied(self._make(progress), judges[0])
            finally:
                self._preparation = time.perf_counter() - started

        executive = PlanExecutive(self._plan, both, deadline=self._deadline)
        started = time.perf_counter()
        executive.prepare()
        self._preparation += time.perf_counter() - started
        timed = self._timed = _Timed(executive, judges[0])
        run_in_world(timed, SimulatedTeam(self._plan, executive, judges[0], Story(), seed=seed))
        return "none" if executive.outcome is None else type(executive.outcome).__name__.lower()
