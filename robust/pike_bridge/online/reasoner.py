"""What an executive asks of its reasoning: the queries of [PIKE, Algorithms 1 to 3] about the partial execution.

All reasoners mean the same by them. A *continuation* is a correct execution that agrees with all that has happened, and
in which every pending event has the present time or a later one. An event is *executable* now if some continuation
executes it now, in which whatever is not the executive's to execute comes later: what is not reported has not happened.
Times are on the grid that the plan's bounds and its ε are on; "strictly before" is by ε at least.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from fractions import Fraction
from math import ceil, floor

from robust.pike_bridge.model import Assignment, Condition, Effect, Guard
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.semantics import Execution, holds
from robust.smt.limits import Deadline


class Reasoner(ABC):
    """Answers about one execution, whose facts are in `progress`; it is told of each new one after it is noted there.

    Questions raise OutOfTimeError if their deadline passes, and change nothing then.
    """

    name: str

    def __init__(self, progress: Progress) -> None:
        self.progress = progress

    @abstractmethod
    def observed(self, assignment: Assignment) -> None:
        """A choice has a value."""

    @abstractmethod
    def executed(self, event: str) -> None:
        """An event has its time, now, and is not pending any more."""

    @abstractmethod
    def voided(self, effect: Effect, condition: Condition) -> None:
        """An effect does not support a condition any more [PIKE §3, CheckActivatedCausalLinks]."""

    @abstractmethod
    def advanced(self) -> None:
        """Time has passed: windows may be missed [PIKE, Algorithm 1, line 6]."""

    @abstractmethod
    def possible(self, deadline: Deadline) -> bool:
        """CorrectTeamPlanExists?: whether there is a continuation."""

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

    @property
    def witness(self) -> Execution | None:
        """A continuation, if one is known; choices that do not matter may be missing from it."""
        return self._witness

    def observed(self, assignment: Assignment) -> None:
        if self._witness and self._witness.scenario.get(assignment.variable) != assignment.value:
            self._witness = None

    def executed(self, event: str) -> None:
        if self._witness and self._witness.schedule.get(event) != self.progress.now:
            self._witness = None

    def voided(self, effect: Effect, condition: Condition) -> None:
        self._witness = None

    def advanced(self) -> None:
        if self._witness and any(time < self.progress.now for _, time in self._ahead(self._witness)):
            self._witness = None

    def possible(self, deadline: Deadline) -> bool:
        return self._witness is not None or self._find_continuation(frozenset(), deadline)

    def executable(self, event: str, deadline: Deadline) -> bool:
        return self._executes_now(event) or self._find_execution(event, deadline)

    def could(self, environment: Guard, deadline: Deadline) -> bool:
        if self._witness is not None and _agrees(environment, self._witness.scenario):
            return True
        if not self.progress.compatible(environment):
            return False
        return self._find_continuation(environment, deadline)

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """When something is executable first; if nothing is without a message, when it is too late for any."""
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

    def _executes_now(self, event: str) -> bool:
        """Whether the witness shows an event to be executable."""
        return self._executes_at(event, self.progress.now)

    def _executes_at(self, event: str, moment: Fraction) -> bool:
        """Whether the witness shows that an event would be executable at a moment, if it has nothing before."""
        witness = self._witness
        if witness is None or witness.schedule.get(event) != moment:
            return False
        return not any(
            time < moment or any(holds(label, witness.scenario) for label in self.progress.external(name))
            for name, time in self._ahead(witness)
            if time <= moment
        )

    def _ahead(self, witness: Execution) -> list[tuple[str, Fraction]]:
        return [(name, time) for name, time in witness.schedule.items() if name in self.progress.pending]


def _agrees(environment: Guard, scenario: Mapping[str, str]) -> bool:
    return all(scenario.get(variable) == value for variable, value in environment)


class Accompanied(Reasoner):
    """Answers are the first one's; the companion is told the same facts."""

    def __init__(self, deciding: Reasoner, companion: Reasoner) -> None:
        super().__init__(deciding.progress)
        self.name = deciding.name
        self.deciding = deciding
        self.companion = companion

    def observed(self, assignment: Assignment) -> None:
        self.deciding.observed(assignment)
        self.companion.observed(assignment)

    def executed(self, event: str) -> None:
        self.deciding.executed(event)
        self.companion.executed(event)

    def voided(self, effect: Effect, condition: Condition) -> None:
        self.deciding.voided(effect, condition)
        self.companion.voided(effect, condition)

    def advanced(self) -> None:
        self.deciding.advanced()
        self.companion.advanced()

    def possible(self, deadline: Deadline) -> bool:
        return self.deciding.possible(deadline)

    def executable(self, event: str, deadline: Deadline) -> bool:
        return self.deciding.executable(event, deadline)

    def could(self, environment: Guard, deadline: Deadline) -> bool:
        return self.deciding.could(environment, deadline)

    def next_time(self, deadline: Deadline) -> Fraction | None:
        return self.deciding.next_time(deadline)
