"""A world whose future is drawn before, the same for every executive: for paired comparisons.

Outcomes and durations belong to choices and activities, not to the order in which they are asked for, so that two
executives which do different things meet the same humans and the same nature.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from heapq import heappop, heappush
from math import ceil, floor
from random import Random

from robust.pike_bridge.model import Assignment, TeamPlan
from robust.pike_bridge.online.baselines.interface import TeamExecutive
from robust.pike_bridge.online.baselines.kirk import KirkDecision, Replanned
from robust.pike_bridge.online.progress import Completion, Dispatched, Message, Outcome


@dataclass(frozen=True, slots=True)
class Script:
    """What humans choose, and how long each activity takes, by the event at which it ends and its action."""

    outcomes: Mapping[str, str]
    durations: Mapping[tuple[str, str], Fraction]


def draw_script(plan: TeamPlan, seed: int | str, slack: Fraction = Fraction(5)) -> Script:
    """Uniform draws: a value for each uncontrollable choice, a duration on the grid of ε for each activity.

    Args:
        slack: how much longer than its least duration an activity without an upper bound takes at most.
    """
    random = Random(f"script/{seed}")  # noqa: S311 - reproducible
    outcomes = {each.name: random.choice(each.domain) for each in plan.network.choices if not each.controllable}
    durations = {}
    for each in plan.network.activities:
        upper = each.lower + slack if each.upper is None else each.upper
        steps = random.randint(0, floor((upper - each.lower) / plan.epsilon))
        durations[each.target, each.action] = each.lower + steps * plan.epsilon
    return Script(outcomes, durations)


class ScriptedTeam:
    """The world of one execution, a :class:`robust.execute.drive.World`.

    A choice is seen when somebody acts on it. An executive that waits for a human learns what they do as soon as they
    can choose: once all events before the choice's own have been executed. One that has assumed an outcome learns the
    true one when it executes the first event that depends on the assumption, which may begin the wrong activity; if no
    event does, at the choice's own. Both times are later by `notice`.

    Activities take the time of the script; those that are not in it, such as recoveries, their least.
    """

    def __init__(
        self, plan: TeamPlan, executive: TeamExecutive, script: Script, *, notice: Fraction = Fraction(0)
    ) -> None:
        self._plan = plan
        self._executive = executive
        self._script = script
        self._notice = notice
        self._epsilon = plan.epsilon
        self._agenda: list[tuple[Fraction, int, Message]] = []
        self._stopped: set[int] = set()
        self._running: dict[str, int] = {}
        self._told: set[str] = set()
        self._number = 0

    def receive(self, now: Fraction, decisions: Sequence[KirkDecision]) -> None:
        """Begin and stop activities, and make choices whose time has come."""
        for decision in decisions:
            match decision:
                case Dispatched(action, _, _, end, lower):
                    duration = self._script.durations.get((end, action), lower)
                    self._running[end] = self._plan_for(now + duration, Completion(action, end))
                case Replanned():
                    self._stopped.update(self._running[end] for _, end in decision.abandoned)
                case _:
                    pass
        if not self._executive.ended:
            for choice, value in self._script.outcomes.items():
                if choice not in self._told and self._seen(choice):
                    self._told.add(choice)
                    self._plan_for(now + self._notice, Outcome(choice, value))

    @property
    def next_time(self) -> Fraction | None:
        while self._agenda and self._agenda[0][1] in self._stopped:
            heappop(self._agenda)
        return self._agenda[0][0] if self._agenda else None

    def messages(self, now: Fraction) -> Sequence[Message]:
        found: list[Message] = []
        while (time := self.next_time) is not None and time <= now:
            found.append(heappop(self._agenda)[2])
        return found

    def _seen(self, choice: str) -> bool:
        event = next(each.event for each in self._plan.network.choices if each.name == choice)
        progress = self._executive.progress
        assumed = self._executive.assumed.get(choice)
        if assumed is not None:
            guess = Assignment(choice, assumed)
            acting = [each.name for each in self._plan.network.events if guess in each.guard]
            return event is None or any(each in progress.times for each in acting or [event])
        if event is None:
            return True
        return event in progress.pending and not any(
            earlier in progress.pending for earlier in progress.structure.not_before[event]
        )

    def _plan_for(self, time: Fraction, message: Message) -> int:
        self._number += 1
        heappush(self._agenda, (ceil(time / self._epsilon) * self._epsilon, self._number, message))
        return self._number
