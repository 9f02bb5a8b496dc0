"""Kirk and people in a simulated world: when choices are seen, who stops what was begun by mistake, and whole runs.

People learn nothing of guesses: what they choose shows when somebody acts on it. A re-plan abandons activities, and
whoever does them stops.
"""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from fractions import Fraction
from functools import partial
from heapq import heapify
from typing import Protocol

from robust.backends import KIRK
from robust.pike_bridge import model
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.kirk import Kirk, Replanned
from robust.pike_bridge.online.world import (
    Ending,
    ExecutionRecord,
    ExecutionStep,
    Planned,
    Rehearsal,
    SimulatedTeam,
    Watched,
)
from robust.pike_bridge.semantics import Execution, faults


class Guessing(Watched, Protocol):
    """An executive that may assume how others choose."""

    @property
    def assumed(self) -> Mapping[str, str]: ...


def execution_faults(plan: model.TeamPlan, executive: Guessing) -> tuple[str, ...]:
    """What is wrong, by the whole plan, with an execution that its executive takes for a success.

    Choices that were not made count as their first value; recovery activities are no part of the plan.
    """
    if not isinstance(executive.outcome, said.Succeeded):
        return ()
    scenario = {name: domain[0] for name, domain in plan.network.domains.items()} | dict(executive.outcome.scenario)
    events = plan.network.guards
    times = {event: time for event, time in executive.progress.times.items() if event in events}
    return tuple(str(fault) for fault in faults(plan, Execution(scenario, times)))


def is_seen(plan: model.TeamPlan, executive: Guessing, choice: model.Choice) -> bool:
    """Whether somebody acts on a choice of others by now, so that it is seen how it was made.

    An executive that waits for people learns what they do as soon as they can choose: once all events before the
    choice's own have been executed. One that has assumed an outcome learns the true one when it executes the first
    event that depends on the assumption, which may begin the wrong activity; if no event does, at the choice's own.
    """
    if choice.event is None:
        return True
    progress, assumed = executive.progress, executive.assumed.get(choice.name)
    if assumed is not None:
        guess = model.Assignment(choice.name, assumed)
        acting = [each.name for each in plan.network.events if guess in each.guard]
        return any(each in progress.times for each in acting or [choice.event])
    return progress.comes_next(choice.event)


class KirkTeam(SimulatedTeam):
    """A simulated team that stops what was begun by mistake, and whose choices are seen when somebody acts on them.

    It is advised about choices by the whole plan, about the rest by the candidate under way.
    """

    executive: Kirk

    def replanned(self, now: Fraction, abandoned: Sequence[tuple[str, str]]) -> None:
        """Whoever does what is abandoned stops."""
        ends = {end for _, end in abandoned}
        self._agenda = [each for each in self._agenda if self._ends(each[2]) not in ends]
        heapify(self._agenda)
        self._waiting = [end for end in self._waiting if end not in ends]
        for end in ends:
            self._running.pop(end, None)

    def _ends(self, planned: Planned) -> str | None:
        """The event at which an activity ends when what is planned happens."""
        if isinstance(planned, said.Completion):
            return planned.event
        return planned.args[0] if isinstance(planned, partial) and planned.func == self._complete else None

    def _is_due(self, choice: model.Choice) -> bool:
        return choice.event is not None and is_seen(self.plan, self.executive, choice)

    def _is_correct(self, made: model.Assignment, now: Fraction) -> bool:
        return self.executive.could(frozenset({made}), now)


@dataclass
class KirkRehearsal(Rehearsal):
    """Executes a plan with Kirk and a simulated team.

    Args:
        recovery: how long it takes to undo an activity that was begun by mistake, as a share of its least duration.
    """

    _: KW_ONLY
    recovery: Fraction = Fraction(1, 2)

    def _meet(self) -> None:
        durations = {each.action: each.lower * self.recovery for each in self.plan.network.activities}
        self._driven = self._kirk = Kirk(self.plan, self._deciding(), recovery=durations, deadline=self.deadline)
        self._world = self._team = KirkTeam(self.plan, self._kirk, self._judge(), self.story, seed=self.seed)

    def step(self, now: Fraction, messages: Sequence[said.Message]) -> list[said.Decision]:
        """One step of Kirk, recorded; a re-plan is told as what is cancelled and that there is another plan."""
        started = clock.perf_counter()
        made = self._kirk.step(now, messages)
        seconds = clock.perf_counter() - started
        decisions: list[said.Decision] = []
        guess = self._kirk.guess if not self._steps else {}
        for each in made:
            if isinstance(each, Replanned):
                self._team.judge = self._judge()
                self._team.replanned(now, each.abandoned)
                decisions += (said.Cancel(action, self._agent(action), now, end) for action, end in each.abandoned)
                decisions.append(said.Resumed(now, (), planned=True))
                guess = self._kirk.guess
            else:
                decisions.append(each)
        if messages or decisions:
            step = ExecutionStep(now, tuple(messages), tuple(decisions), seconds=seconds, guess=guess)
            self._steps.append(step)
            self.on_step(step)
        return decisions

    def _agent(self, action: str) -> str | None:
        return next((each.agent for each in self.plan.network.activities if each.action == action), None)

    def _faults(self) -> tuple[str, ...]:
        broken = any(isinstance(each, said.Violated) for step in self._steps for each in step.decisions)
        return () if broken else execution_faults(self.plan, self._kirk)

    def _record(self, ending: Ending) -> ExecutionRecord:
        kirk = self._kirk
        choices, times = {**kirk.guess, **kirk.observed}, dict(kirk.progress.times)
        return ExecutionRecord(
            ending,
            kirk.progress.now,
            tuple(self._steps),
            choices,
            times,
            plan=self.plan,
            seed=self.seed,
            reasoner=KIRK,
            backend=self.backend,
            replans=kirk.replans,
            recovered=kirk.recovered,
        )
