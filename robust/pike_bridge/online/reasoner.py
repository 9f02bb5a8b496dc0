"""What an executive asks of its reasoning: the queries of [PIKE, Algorithms 1 to 3] about the partial execution.

All reasoners mean the same by them. A *continuation* is a correct execution that agrees with all that has happened, and
in which every pending event has the present time or a later one. An event is *executable* now if some continuation
executes it now, in which whatever is not the executive's to execute comes later: what is not reported has not happened.
Times are on the grid that the plan's bounds and its ε are on; "strictly before" is by ε at least.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Set
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from math import ceil, floor

from robust.pike_bridge.model import ALWAYS, Condition, Effect, Guard, guard
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.semantics import Execution, holds
from robust.smt.limits import Deadline


@dataclass(frozen=True, slots=True)
class News:
    """What has happened since a reasoner was asked last."""

    chosen: Guard
    """Choices that were made or observed."""
    times: Mapping[str, Fraction]
    """Events that were executed, in their order."""
    void: Set[tuple[Effect, Condition]]
    """Effects that do not support conditions any more [PIKE §3, CheckActivatedCausalLinks]."""
    later: bool
    """Whether time has passed: windows may be missed [PIKE, Algorithm 1, line 6]."""


class Reasoner(ABC):
    """Answers about one execution. Its facts are in `progress`, where they only grow; each question looks for new ones.

    Questions raise OutOfTimeError if their deadline passes, and change nothing then.
    """

    name: str

    def __init__(self, progress: Progress) -> None:
        self.progress = progress
        self._seen: tuple[int, int, Set[tuple[Effect, Condition]], Fraction | None] = (0, 0, frozenset(), None)
        """How many choices and events are known, which broken links, and the time."""

    def catch_up(self) -> None:
        """Learn what has happened; questions begin with it."""
        progress, seen = self.progress, self._seen
        self._seen = (len(progress.chosen), len(progress.times), frozenset(progress.void), progress.now)
        if self._seen != seen:
            choices, events, void, now = seen
            chosen = guard(dict(islice(progress.chosen.items(), choices, None)))
            times = dict(islice(progress.times.items(), events, None))
            self._learn(News(chosen, times, progress.void - void, progress.now != now))

    @abstractmethod
    def _learn(self, news: News) -> None:
        """Take note of what has happened."""

    def possible(self, deadline: Deadline) -> bool:
        """CorrectTeamPlanExists?: whether there is a continuation."""
        return self.could(ALWAYS, deadline)

    @abstractmethod
    def executable(self, event: str, deadline: Deadline) -> bool:
        """CanExecuteEventNow? [PIKE, Algorithm 2]."""

    @abstractmethod
    def could(self, environment: Guard, deadline: Deadline) -> bool:
        """Whether there is a continuation in the environment."""

    @abstractmethod
    def next_time(self, deadline: Deadline) -> Fraction | None:
        """A time from which on more may be executable or lost, though nothing happens before; None: never."""

    def _opening(self, moment: Fraction) -> Fraction:
        """When to look again if something is executable from a moment on."""
        grid = self.progress.grid
        return max(self.progress.now + grid, floor(moment / grid) * grid)

    def _closing(self, moment: Fraction) -> Fraction:
        """When to look again if nothing is possible after a moment."""
        grid = self.progress.grid
        return ceil(moment / grid) * grid + grid


class WitnessedReasoner(Reasoner):
    """A reasoner that keeps a continuation in mind, and asks nothing that it answers."""

    def __init__(self, progress: Progress) -> None:
        super().__init__(progress)
        self._witness: Execution | None = None
        """A continuation, if one is known; choices that do not matter may be missing from it."""

    def _learn(self, news: News) -> None:
        witness, now = self._witness, self.progress.now
        if witness is not None and (
            news.void
            or not agrees(news.chosen, witness.scenario)
            or any(witness.schedule.get(event) != time for event, time in news.times.items())
            or (news.later and any(time < now for _, time in self._ahead(witness)))
        ):
            self._witness = None

    def executable(self, event: str, deadline: Deadline) -> bool:
        self.catch_up()
        return self._executes_at(event, self.progress.now) or self._find_execution(event, deadline)

    def could(self, environment: Guard, deadline: Deadline) -> bool:
        self.catch_up()
        if self._witness is not None and agrees(environment, self._witness.scenario):
            return True
        return self.progress.compatible(environment) and self._find_continuation(environment, deadline)

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """When something is executable first; if nothing is without a message, when it is too late for any."""
        self.catch_up()
        earliest = self._earliest_execution(deadline)
        if earliest is not None:
            return self._opening(earliest)
        last = self.quiet_until(deadline)
        return None if last is None else self._closing(last)

    @abstractmethod
    def quiet_until(self, deadline: Deadline) -> Fraction | None:
        """The greatest time before which nothing need be executed; None if nothing ever need, or nothing is correct."""

    @abstractmethod
    def _earliest_execution(self, deadline: Deadline) -> Fraction | None:
        """The least time after now at which an event is executable if nothing happens before."""

    @abstractmethod
    def _find_continuation(self, environment: Guard, deadline: Deadline) -> bool:
        """Look for a continuation in the environment, and make it the witness."""

    @abstractmethod
    def _find_execution(self, event: str, deadline: Deadline) -> bool:
        """Look for a continuation that shows an event to be executable, and make it the witness."""

    def _executes_at(self, event: str, moment: Fraction) -> bool:
        """Whether the witness shows that an event would be executable at a moment, if it has nothing before."""
        witness, progress = self._witness, self.progress
        if witness is None or witness.schedule.get(event) != moment:
            return False
        later = moment + progress.plan.separation
        return not any(
            time < moment or any(holds(label, witness.scenario) for label in progress.external(name))
            for name, time in self._ahead(witness)
            if time < later
        )

    def _ahead(self, witness: Execution) -> list[tuple[str, Fraction]]:
        return [(name, time) for name, time in witness.schedule.items() if name in self.progress.pending]


def agrees(environment: Guard, scenario: Mapping[str, str]) -> bool:
    """Whether a scenario, in which choices may be missing, has all assignments of an environment."""
    return all(scenario.get(variable) == value for variable, value in environment)
