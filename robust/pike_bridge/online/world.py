"""Simulated humans and worlds for executives: seeded, and on the grid of the plan's numbers.

A world decides uncontrollable choices, how long activities take, and what goes wrong with the state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import partial
from heapq import heappop, heappush
from math import ceil, floor
from random import Random

from robust.pike_bridge.model import ALWAYS, Assignment, Literal, TeamPlan
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.messages import Completion, Decision, Dispatched, Estimate, Message, Outcome
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.smt.limits import Deadline

NEVER = Deadline()


class Human(Enum):
    """How uncontrollable choices are made: among what remains correct, or anyhow."""

    RATIONAL = "rational"
    CARELESS = "careless"


class Pace(Enum):
    """How long activities take, between their bounds.

    Agents that cooperate end their activities while that leaves a correct execution, if there is such a time, and act
    otherwise than they meant to when something else has happened; PIKE counts on them [PIKE, Definition 2.8].
    """

    COOPERATIVE = "cooperative"
    LEAST = "least"
    RANDOM = "random"


@dataclass(frozen=True, slots=True)
class Disturbance:
    """From a time on, until an effect says otherwise, the literal holds, whatever was planned."""

    time: Fraction
    literal: Literal


@dataclass(frozen=True, slots=True)
class Story:
    """What is known beforehand of an execution; the seed decides the rest.

    Attributes:
        outcomes: values of uncontrollable choices, and when they are made known; the time None leaves that open.
        disturbances: what goes wrong.
        slack: how much longer than its least duration an activity without an upper bound takes at most.
        delay: how long after a choice is possible it is made at most.
    """

    human: Human = Human.RATIONAL
    pace: Pace = Pace.COOPERATIVE
    outcomes: Mapping[str, tuple[str, Fraction | None]] | None = None
    disturbances: tuple[Disturbance, ...] = ()
    slack: Fraction = Fraction(5)
    delay: Fraction = Fraction(0)


class SimulatedTeam:
    """The world of one execution, a :class:`robust.execute.drive.World`.

    An uncontrollable choice is made once all events before its own have been executed. Rational humans and cooperative
    agents are advised by `judge`, a reasoner that the executive tells what happens; it is asked only when they act.
    """

    def __init__(
        self,
        plan: TeamPlan,
        executive: PlanExecutive,
        judge: SemanticReasoner,
        story: Story = Story(),
        *,
        seed: int = 0,
    ) -> None:
        self._plan = plan
        self._executive = executive
        self._judge = judge
        self._story = story
        self._random = Random(seed)  # noqa: S311 - reproducible
        self._agenda: list[tuple[Fraction, int, Callable[[Fraction], Message | None]]] = []
        self._due: set[str] = set()
        self._running: dict[str, Completion] = {}
        """What cooperative agents do, by the event at which it ends."""
        self._waiting: list[str] = []
        """Activities that cannot end before something else has happened."""
        self._advised = True
        self._number = 0
        for disturbance in story.disturbances:
            self._plan_for(disturbance.time, partial(_seen, disturbance.literal))
        for name, (value, time) in (story.outcomes or {}).items():
            if time is not None:
                self._due.add(name)
                self._plan_for(time, partial(_announced, name, value))

    def receive(self, now: Fraction, decisions: Sequence[Decision]) -> None:
        """Begin what was dispatched, and make choices whose time has come."""
        self._advised = False
        if decisions:
            for end in self._waiting:
                self._plan_for(now, partial(self._complete, end))
            self._waiting.clear()
        for decision in decisions:
            if isinstance(decision, Dispatched):
                self._begin(now, decision)
        progress = self._executive.progress
        for choice in self._plan.network.choices:
            if choice.controllable or choice.name in self._due or choice.event is None:
                continue
            if choice.event in progress.pending and not any(
                earlier in progress.pending for earlier in progress.structure.not_before[choice.event]
            ):
                self._due.add(choice.name)
                self._plan_for(now + self._drawn(self._story.delay), partial(self._choose, choice.name))

    @property
    def next_time(self) -> Fraction | None:
        if not self._advised and self._running:
            self._hurry()
        self._advised = True
        return self._agenda[0][0] if self._agenda else None

    def messages(self, now: Fraction) -> Sequence[Message]:
        found: list[Message] = []
        while self._agenda and self._agenda[0][0] <= now:
            message = heappop(self._agenda)[2](now)
            if message is not None:
                found.append(message)
        return found

    def _begin(self, now: Fraction, activity: Dispatched) -> None:
        completion = Completion(activity.action, activity.end)
        first = now + activity.lower
        last = first + self._story.slack if activity.upper is None else now + activity.upper
        match self._story.pace:
            case Pace.LEAST:
                self._plan_for(first, lambda _: completion)
            case Pace.RANDOM:
                self._plan_for(first + self._drawn(last - first), lambda _: completion)
            case Pace.COOPERATIVE:
                found = self._judge.times_of(activity.end, now, NEVER)
                if found is not None:
                    first, last = found[0], min(last, found[1] or last)
                time = first + self._drawn(max(last - first, Fraction(0)))
                self._running[activity.end] = completion
                self._plan_for(time, partial(self._complete, activity.end))

    def _complete(self, end: str, now: Fraction) -> Message | None:
        """End an activity, unless that is better done later, or is done already."""
        if end in self._running and not self._judge.allows(now, ALWAYS, end, NEVER):
            found = self._judge.times_of(end, now, NEVER, first=True)
            if found is not None:
                self._plan_for(found[0], partial(self._complete, end))
                return None
            if self._judge.possible(NEVER):
                self._waiting.append(end)
                return None
        return self._running.pop(end, None)

    def _hurry(self) -> None:
        """End an activity before it was meant to, where nothing correct would be left if all waited for the next."""
        wake = self._executive.wake
        if self._executive.ended or (self._agenda and self._judge.allows(self._agenda[0][0], ALWAYS, None, NEVER)):
            return
        latest = self._judge.quiet_until(NEVER)
        if wake is not None and (latest is None or wake <= latest):
            return
        for end in self._running:
            found = self._judge.times_of(end, self._executive.progress.now, NEVER, first=True)
            if found is not None:
                times = found[:1] if latest is None else (min(latest, found[1] or latest), found[0])
                time = next((each for each in times if self._judge.allows(each, ALWAYS, end, NEVER)), None)
                if time is not None:
                    self._plan_for(time, partial(self._complete, end))
                    return

    def _choose(self, choice: str, now: Fraction) -> Message:
        wanted = (self._story.outcomes or {}).get(choice)
        if wanted is not None:
            return Outcome(choice, wanted[0])
        values: Sequence[str] = self._plan.network.domains[choice]
        if self._story.human is Human.RATIONAL:
            correct = [
                each for each in values if self._judge.allows(now, frozenset({Assignment(choice, each)}), None, NEVER)
            ]
            values = correct or values
        return Outcome(choice, self._random.choice(values))

    def _drawn(self, greatest: Fraction) -> Fraction:
        """A random time on the grid, from 0 to the greatest."""
        grid = self._executive.progress.grid
        return self._random.randint(0, floor(greatest / grid)) * grid

    def _plan_for(self, time: Fraction, message: Callable[[Fraction], Message | None]) -> None:
        self._number += 1
        grid = self._executive.progress.grid
        on_grid = ceil(time / grid) * grid
        heappush(self._agenda, (on_grid, self._number, message))


def _announced(choice: str, value: str, _now: Fraction) -> Outcome:
    return Outcome(choice, value)


def _seen(literal: Literal, _now: Fraction) -> Estimate:
    atoms = frozenset({literal.atom})
    return Estimate(true=atoms) if literal.positive else Estimate(false=atoms)
