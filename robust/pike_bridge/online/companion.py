"""Two reasoners about one execution: one that decides, and one that listens, for those who want to ask or compare."""

from __future__ import annotations

from fractions import Fraction

from robust.errors import SolverError
from robust.pike_bridge.model import Assignment, Condition, Effect, Guard
from robust.pike_bridge.online.reasoner import Reasoner
from robust.smt.limits import Deadline


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


class Compared(Accompanied):
    """Each question goes to both; the companion knows better.

    Questions raise SolverError if the answers differ.
    """

    def possible(self, deadline: Deadline) -> bool:
        return self._same("possible", super().possible(deadline), self.companion.possible(deadline))

    def executable(self, event: str, deadline: Deadline) -> bool:
        theirs = self.companion.executable(event, deadline)
        return self._same(f"{event} executable", super().executable(event, deadline), theirs)

    def could(self, environment: Guard, deadline: Deadline) -> bool:
        theirs = self.companion.could(environment, deadline)
        return self._same(f"could {sorted(environment)}", super().could(environment, deadline), theirs)

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """The earlier of both; the companion's is exact, and no other may be later."""
        ours, theirs = super().next_time(deadline), self.companion.next_time(deadline)
        if theirs is not None and (ours is None or ours > theirs):
            raise SolverError(f"{self.name} would look again at {ours}, {self.companion.name} at {theirs}")
        return ours

    def _same(self, question: str, ours: bool, theirs: bool) -> bool:
        if ours != theirs:
            now = self.progress.now
            raise SolverError(f"{question} at {now}? {self.name}: {ours}, {self.companion.name}: {theirs}")
        return ours
