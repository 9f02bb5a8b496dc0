"""An executive's questions put to a knowledge base, about time by labeled execution windows [PIKE, Algorithms 1 to 3].

See :mod:`robust.pike_bridge.online.windows` for why the answers are exact.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from robust.pike_bridge.compilation import Compilation
from robust.pike_bridge.environment import Environment
from robust.pike_bridge.knowledge.interface import Commitment, Require
from robust.pike_bridge.model import Assignment, Condition, Effect, Guard
from robust.pike_bridge.online.compiled import Facts, external
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import Reasoner
from robust.pike_bridge.online.windows import DistanceTable, Windows
from robust.smt.limits import Deadline


class WindowReasoner(Reasoner):
    """Answers from a knowledge base and execution windows."""

    def __init__(self, progress: Progress, compilation: Compilation, table: DistanceTable) -> None:
        super().__init__(progress)
        self.name = compilation.backend
        self._facts = Facts(compilation, progress)
        self._table = table
        self._windows = Windows(table)
        self._epsilon = progress.plan.epsilon

    def observed(self, assignment: Assignment) -> None:
        self._facts.require(frozenset({assignment}))

    def executed(self, event: str) -> None:
        facts, now = self._facts, self.progress.now
        facts.require(self.progress.structure.guards[event])
        facts.exclude(self._windows.early(event, now))
        facts.exclude(self._windows.missed(event, now))
        self._windows.executed(event, now, facts.known)
        self._miss()

    def voided(self, effect: Effect, condition: Condition) -> None:
        self._facts.void(effect, condition)

    def advanced(self) -> None:
        self._miss()

    def possible(self, deadline: Deadline) -> bool:
        self._facts.settle(deadline)
        return self._facts.knowledge.satisfiable(deadline)

    def executable(self, event: str, deadline: Deadline) -> bool:
        return self._executable_at(event, self.progress.now, deadline)

    def could(self, environment: Guard, deadline: Deadline) -> bool:
        if not self.progress.compatible(environment):
            return False
        return self._ask([Require(environment)], deadline)

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """When something is executable first; if nothing is without a message, when it is too late for any."""
        soonest = self.progress.now + self.progress.grid
        openings = {
            (max(bound, soonest), event)
            for event in self.progress.frontier
            if self.progress.ours(event)
            for bound, label in self._windows.lower[event]
            if bound > self.progress.now and self._facts.possible(label | self._table.guards[event])
        }
        for moment, event in sorted(openings):
            if self._executable_at(event, moment, deadline):
                return self._opening(moment)
        return self._too_late(deadline)

    def _too_late(self, deadline: Deadline) -> Fraction | None:
        """The least time by which nothing is left if nothing happens before; None if there is always something."""
        closings = sorted(
            {
                bound
                for event in self.progress.pending
                for bound, label in self._windows.upper[event]
                if self._facts.possible(label | self._table.guards[event])
            }
        )
        first, last = 0, len(closings)
        # The answer is among closings[first:last + 1], where that after the last one is never.
        while first < last:
            middle = (first + last) // 2
            if self._possible_after(closings[middle], deadline):
                first = middle + 1
            else:
                last = middle
        return None if first == len(closings) else self._closing(closings[first])

    def _possible_after(self, moment: Fraction, deadline: Deadline) -> bool:
        """Whether there is a continuation in which nothing happens until after a time."""
        excluded = self._facts.excluding(self._missed(moment + self.progress.grid), 0)
        return excluded is not None and self._ask(excluded, deadline)

    def _executable_at(self, event: str, moment: Fraction, deadline: Deadline) -> bool:
        """CanExecuteEventNow?, if nothing happens before a time that is not in the past [PIKE, Algorithm 2]."""
        guard = self._table.guards[event]
        if not self._facts.possible(guard):
            return False
        excluded = self._facts.excluding(self._required(event, moment), guard)
        if excluded is None:
            return False
        return self._ask([Require(self.progress.structure.guards[event]), *excluded], deadline)

    def _required(self, event: str, moment: Fraction) -> Iterator[Environment]:
        """GetConstraintsRequiredToExecute: what must not hold [PIKE §3, constraints 2 to 6]."""
        yield from external(self.progress, self._facts.vocabulary, event)
        yield from self._windows.early(event, moment)
        if moment > self.progress.now:
            yield from self._missed(moment)
        theirs = {
            other: labels
            for other in self.progress.pending
            if other != event and (labels := external(self.progress, self._facts.vocabulary, other))
        }
        for other, labels in theirs.items():
            for label in self._windows.missed(other, moment + self._epsilon):
                yield from (label | each for each in labels)
        for other, distance, label in self._table.after[event]:
            if distance < self._epsilon and other in self.progress.pending:
                whole = label | self._table.guards[other]
                if distance < 0:
                    yield whole
                else:
                    yield from (whole | each for each in theirs.get(other, ()))

    def _missed(self, moment: Fraction) -> Iterator[Environment]:
        for event in self.progress.pending:
            yield from self._windows.missed(event, moment)

    def _miss(self) -> None:
        """Windows that are missed by now [PIKE, Algorithm 1, line 6]."""
        self._facts.exclude(self._missed(self.progress.now))

    def _ask(self, commitments: list[Commitment], deadline: Deadline) -> bool:
        self._facts.settle(deadline)
        return self._facts.knowledge.could_commit(commitments, deadline)
