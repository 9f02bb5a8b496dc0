"""An executive's questions put to a knowledge base, about time scenario by scenario: no labeled distances are needed.

A model of the knowledge base is a scenario of the augmented plan. If it has times that agree with what has happened,
it shows a continuation; if not, the negative cycle is a conflict that the knowledge base learns, and the next model is
looked at.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction

from robust.pike_bridge.compilation import Compilation
from robust.pike_bridge.environment import Environment
from robust.pike_bridge.execution import Execution
from robust.pike_bridge.knowledge.interface import Commitment, Exclude, Require
from robust.pike_bridge.model import Assignment, Condition, Effect, Guard
from robust.pike_bridge.online.compiled import Facts, external
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import WitnessedReasoner
from robust.pike_bridge.online.scenario_times import Assumption, Contradiction, Later, ScenarioTimes
from robust.smt.limits import Deadline


class LazyReasoner(WitnessedReasoner):
    """Answers from a knowledge base and the times of single scenarios."""

    def __init__(self, progress: Progress, compilation: Compilation) -> None:
        super().__init__(progress)
        self.name = compilation.backend
        self._facts = Facts(compilation, progress)
        self._times = ScenarioTimes(compilation.augmented.network, progress.plan.epsilon)
        self._choices = tuple(progress.plan.network.domains)
        self._preferred: dict[str, str] = {}
        """The last model that had times."""

    def observed(self, assignment: Assignment) -> None:
        super().observed(assignment)
        self._facts.require(frozenset({assignment}))

    def executed(self, event: str) -> None:
        super().executed(event)
        self._facts.require(self.progress.structure.guards[event])
        self._facts.exclude(self._times.executed(event, self.progress.now))

    def voided(self, effect: Effect, condition: Condition) -> None:
        super().voided(effect, condition)
        self._facts.void(effect, condition)

    def advanced(self) -> None:
        super().advanced()
        self._times.now = self.progress.now

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """When something is executable first; if nothing is without a message, when it is too late for any."""
        earliest = self._earliest_execution(deadline)
        if earliest is not None:
            return self._opening(earliest)
        last = self._last(deadline)
        return None if last is None else self._closing(last)

    def _find_continuation(self, environment: Guard, deadline: Deadline) -> bool:
        return self._witnessed(self._find([Require(environment)], Assumption(self.progress.now), deadline))

    def _find_execution(self, event: str, deadline: Deadline) -> bool:
        asked = self._ours(event)
        if asked is None:
            return False
        assumed = Assumption(self.progress.now, event, self._later(event))
        return self._witnessed(self._find(asked, assumed, deadline))

    def _witnessed(self, found: Execution | None) -> bool:
        if found is None:
            return False
        choices = {name: found.scenario[name] for name in self._choices}
        self._witness = Execution(choices, found.schedule)
        return True

    def _find(self, asked: Iterable[Commitment], assumed: Assumption, deadline: Deadline) -> Execution | None:
        """A model of all variables with times, under an assumption; None if there is none."""
        commitments = list(asked)
        while True:
            deadline.enforce()
            self._facts.settle(deadline)
            model = self._facts.knowledge.find_model(commitments, self._preferred, deadline)
            if model is None:
                return None
            times = self._times.earliest(self._scenario(model), assumed)
            if not isinstance(times, Contradiction):
                self._preferred = dict(model)
                return Execution(model, times)
            if times.assumed:
                commitments.append(Exclude(self._facts.vocabulary.decode(times.environment)))
            else:
                self._facts.exclude([times.environment])

    def _scenario(self, model: Mapping[str, str]) -> Environment:
        return self._facts.vocabulary.encode(Assignment(*item) for item in model.items())

    def _ours(self, event: str) -> list[Commitment] | None:
        """That the event is activated and the executive's to execute; None if it is not."""
        guard = self.progress.structure.guards[event]
        labels = external(self.progress, self._facts.vocabulary, event)
        excluded = self._facts.excluding(labels, self._facts.vocabulary.encode(guard))
        return None if excluded is None else [Require(guard), *excluded]

    def _later(self, event: str) -> tuple[Later, ...]:
        """What comes after the event if that is executed, because it is not the executive's to execute."""
        return tuple(
            Later(other, label)
            for other in self.progress.pending
            if other != event
            for label in external(self.progress, self._facts.vocabulary, other)
        )

    def _earliest_execution(self, deadline: Deadline) -> Fraction | None:
        """The least time after now at which an event is executable if nothing happens before."""
        soonest = self.progress.now + self.progress.grid
        best: Fraction | None = None
        candidates = [event for event in self.progress.frontier if self.progress.ours(event)]
        for event in sorted(candidates, key=lambda each: self.progress.earliest(each) or soonest):
            least = max(self.progress.earliest(event) or soonest, soonest)
            asked = self._ours(event)
            while asked is not None and (best is None or best > least):
                latest = None if best is None else best - self.progress.grid
                assumed = Assumption(soonest, event, self._later(event), open_end=True, latest=latest)
                found = self._find(asked, assumed, deadline)
                if found is None:
                    break
                best = found.schedule[event]
        return best

    def _last(self, deadline: Deadline) -> Fraction | None:
        """The greatest time before which nothing need be executed; None if there is none."""
        best, soonest = None, self.progress.now
        while True:
            found = self._find([], Assumption(soonest), deadline)
            if found is None:
                return best
            best = self._times.deadline(self._scenario(found.scenario))
            if best is None:
                return None
            soonest = best + self.progress.grid
