"""What PIKE is compared with: executives that guess intents (Kirk), or that reason about time only (Drake).

Kirk is :mod:`robust.pike_bridge.online.kirk`. Drake: temporal reasoning only, no causal links [PIKE §2.3 and §3; Conrad
and Williams 2011].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from heapq import heappop, heappush
from itertools import count
from math import ceil, floor
from random import Random
from time import process_time
from typing import Generic, TypeAlias, TypeVar

from robust.execute.drive import Executive
from robust.pike_bridge import model
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.kirk import Kirk, KirkDecision, Replanned
from robust.pike_bridge.online.kirk_world import is_seen
from robust.pike_bridge.online.reasoners import without_states
from robust.pike_bridge.online.semantic import Reasoner
from robust.smt.limits import NEVER, Deadline

# -- executives by mode ------------------------------------------------------------------------------------------------


class Mode(Enum):
    """PIKE keeps all hypotheses, and waits for people as long as it can; EAGER is PIKE that acts as soon as it can
    [PIKE §3]; DRAKE is PIKE for choices and times, without what activities need, do or are to reach; KIRK follows one
    guess and plans anew."""

    PIKE = "pike"
    EAGER = "eager"
    DRAKE = "drake"
    KIRK = "kirk"


class Concurrent(PlanExecutive):
    """PIKE's executive as one among others: it assumes nothing, and never plans anew."""

    replans = 0
    recovered = Fraction(0)

    @property
    def assumed(self) -> Mapping[str, str]:
        return {}


Made = TypeVar("Made")
TeamExecutive: TypeAlias = Concurrent | Kirk
"""What executes a plan with choices: an :class:`robust.execute.drive.Executive` that can be looked at."""


def make_executive(
    mode: Mode,
    plan: model.TeamPlan,
    reasoner: Callable[[said.Progress], Reasoner],
    *,
    recovery: Mapping[str, Fraction] | None = None,
    deadline: Deadline = NEVER,
) -> TeamExecutive:
    """The executive of a mode.

    Args:
        reasoner: as :func:`robust.pike_bridge.online.reasoners.make_reasoner` makes it.
        recovery: for KIRK, how long it takes to undo each action that was begun.

    Raises:
        OutOfTimeError: if the deadline passes before the first guess of KIRK.
    """
    if mode is Mode.KIRK:
        return Kirk(plan, reasoner, recovery=recovery, deadline=deadline)
    seen = without_states(plan) if mode is Mode.DRAKE else plan
    patience = None if mode is Mode.EAGER else Fraction(0)
    return Concurrent(seen, reasoner, patience=patience, deadline=deadline)


class Timed(Generic[Made]):
    """An executive of any kind whose steps and wakes are measured, in seconds of the processor, which others that run
    do not prolong; `decisions` are what it decided.
    """

    def __init__(self, executive: Executive[said.Message, Made]) -> None:
        self._executive = executive
        self.steps: list[float] = []
        self.wakes: list[float] = []
        self.decisions: list[str] = []

    def step(self, now: Fraction, messages: Sequence[said.Message]) -> Sequence[Made]:
        started = process_time()
        decisions = self._executive.step(now, messages)
        self.steps.append(round(process_time() - started, 7))
        self.decisions += map(str, decisions)
        return decisions

    @property
    def wake(self) -> Fraction | None:
        started = process_time()
        wake = self._executive.wake
        self.wakes.append(round(process_time() - started, 7))
        return wake

    @property
    def ended(self) -> bool:
        return self._executive.ended


# -- a world whose future is drawn before, the same for every executive: for paired comparisons ------------------------


@dataclass(frozen=True, slots=True)
class Script:
    """What humans choose, and how long each activity takes, by the event at which it ends and its action."""

    outcomes: Mapping[str, str]
    durations: Mapping[tuple[str, str], Fraction]


SLACK = Fraction(5)
"""How much longer than its least duration an activity without an upper bound takes at most."""


def draw_script(plan: model.TeamPlan, seed: int | str) -> Script:
    """Uniform draws: a value for each uncontrollable choice, a duration on the grid of ε for each activity."""
    random = Random(f"script/{seed}")  # noqa: S311 - reproducible
    outcomes = {each.name: random.choice(each.domain) for each in plan.network.choices if not each.controllable}
    durations = {}
    for each in plan.network.activities:
        upper = each.lower + SLACK if each.upper is None else each.upper
        steps = random.randint(0, floor((upper - each.lower) / plan.epsilon))
        durations[each.target, each.action] = each.lower + steps * plan.epsilon
    return Script(outcomes, durations)


class ScriptedTeam:
    """The world of one execution, a :class:`robust.execute.drive.World`.

    A choice is seen when somebody acts on it, as :func:`~robust.pike_bridge.online.kirk_world.is_seen` says; and is
    told of later by `notice`.

    Activities take the time of the script; those that are not in it, such as recoveries, their least.
    """

    def __init__(
        self, plan: model.TeamPlan, executive: TeamExecutive, script: Script, *, notice: Fraction = Fraction(0)
    ) -> None:
        self._plan = plan
        self._executive = executive
        self._script = script
        self._notice = notice
        self._agenda: list[tuple[Fraction, int, said.Message]] = []
        self._stopped: set[int] = set()
        self._running: dict[str, int] = {}
        self._told: set[str] = set()
        self._numbers = count()

    def receive(self, now: Fraction, decisions: Sequence[KirkDecision]) -> None:
        """Begin and stop activities, and make choices whose time has come."""
        for decision in decisions:
            if isinstance(decision, said.Dispatched):
                duration = self._script.durations.get((decision.end, decision.action), decision.lower)
                self._running[decision.end] = self._plan_for(
                    now + duration, said.Completion(decision.action, decision.end)
                )
            elif isinstance(decision, Replanned):
                self._stopped.update(self._running[end] for _, end in decision.abandoned)
        if not self._executive.ended:
            for choice in self._plan.network.choices:
                name = choice.name
                if name in self._script.outcomes.keys() - self._told and is_seen(self._plan, self._executive, choice):
                    self._told.add(name)
                    self._plan_for(now + self._notice, said.Outcome(name, self._script.outcomes[name]))

    @property
    def next_time(self) -> Fraction | None:
        while self._agenda and self._agenda[0][1] in self._stopped:
            heappop(self._agenda)
        return self._agenda[0][0] if self._agenda else None

    def messages(self, now: Fraction) -> Sequence[said.Message]:
        found: list[said.Message] = []
        while (time := self.next_time) is not None and time <= now:
            found.append(heappop(self._agenda)[2])
        return found

    def _plan_for(self, time: Fraction, message: said.Message) -> int:
        number = next(self._numbers)
        heappush(self._agenda, (ceil(time / self._plan.epsilon) * self._plan.epsilon, number, message))
        return number
