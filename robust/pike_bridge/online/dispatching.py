"""What executives with knowledge bases have in common: facts become assignments and conflicts [PIKE §3, §5.7]."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from typing import NamedTuple

from robust.pike_bridge.compile import Compilation
from robust.pike_bridge.knowledge.interface import Commitment, Exclude, Require
from robust.pike_bridge.model import Assignment, Condition, Effect, Environment, Guard, Tpnu, Vocabulary, may_produce
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import Reasoner
from robust.pike_bridge.temporal.distance_graph import LabeledValueSet
from robust.pike_bridge.temporal.labeled_apsp import LabeledDistances
from robust.smt.limits import Deadline


class Facts:
    """What a knowledge base is told of one execution.

    Facts wait until something is asked, because only questions have deadlines.
    """

    def __init__(self, compilation: Compilation, progress: Progress) -> None:
        self._progress = progress
        self.knowledge = compilation.knowledge
        self.vocabulary = Vocabulary(compilation.augmented.network.domains)
        self.known: Environment = 0
        """All assignments that hold by what has happened."""
        self.consistent = True
        """Whether these do not contradict each other."""
        self._conflicts: list[Environment] = []
        self._waiting: list[Commitment] = []
        self._links: dict[tuple[str, Guard], list[tuple[Condition, Environment]]] = {}
        for link in compilation.augmented.links:
            # A condition without support variable has this support only, so that it cannot be met at all.
            chosen = self.vocabulary.encode(link.selection | link.consumer.guard)
            broken = self._links.setdefault((link.producer.event, link.producer.guard), [])
            broken += ((condition, chosen) for condition in link.consumer.conditions)

    def require(self, environment: Guard) -> None:
        """All assignments of the environment hold."""
        encoded = self.vocabulary.encode(environment)
        if self.known & encoded != encoded:
            self.known |= encoded
            self.consistent = self.vocabulary.consistent(self.known)
            self._waiting.append(Require(environment))

    def exclude(self, labels: Iterable[Environment]) -> None:
        """None of the environments holds."""
        for label in labels:
            if self.possible(label) and not any(label & each == each for each in self._conflicts):
                self._conflicts = [each for each in self._conflicts if each & label != label]
                self._conflicts.append(label)
                self._waiting.append(Exclude(self.vocabulary.decode(label)))

    def void(self, effect: Effect, condition: Condition) -> None:
        """The effect does not support the condition; a link is broken once no effect at its event does."""
        alike = [
            each
            for each in self._progress.plan.effects
            if (each.event, each.guard) == (effect.event, effect.guard) and may_produce(each, condition)
        ]
        if all((each, condition) in self._progress.void for each in alike):
            links = self._links.get((effect.event, effect.guard), ())
            self.exclude(chosen for each, chosen in links if each == condition)

    def possible(self, environment: Environment) -> bool:
        """Whether the assignments that are known do not contradict the environment."""
        return self.vocabulary.consistent(self.known | environment)

    def settle(self, deadline: Deadline) -> None:
        """Tell the knowledge base what waits.

        Raises:
            OutOfTimeError: if the deadline passes; then it goes on waiting.
        """
        if self._waiting:
            self.knowledge.commit(self._waiting, deadline)
            self._waiting = []

    def excluding(self, labels: Iterable[Environment], given: Environment) -> list[Commitment] | None:
        """As commitments that none of the labels holds, when `given` does; None if that cannot be."""
        whole = self.known | given
        open_labels: list[Environment] = []
        for label in sorted(self._left(labels, whole), key=int.bit_count):
            if not label:
                return None
            if not any(label & each == each for each in open_labels):
                open_labels.append(label)
        return [Exclude(self.vocabulary.decode(label)) for label in open_labels]

    def _left(self, labels: Iterable[Environment], whole: Environment) -> Iterator[Environment]:
        for label in labels:
            if self.vocabulary.consistent(whole | label):
                yield label & ~whole & self.vocabulary.made


def external(progress: Progress, vocabulary: Vocabulary, event: str) -> list[Environment]:
    """In which environments an event is not the executive's to execute."""
    return [vocabulary.encode(label) for label in progress.external(event) if progress.compatible(label)]


class Reach(NamedTuple):
    """A labeled distance to or from an event; the label is without the guards of both ends."""

    event: str
    distance: Fraction
    label: Environment


class DistanceTable:
    """All labeled distances of a network, so that none has to be found while it is executed.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """

    def __init__(self, network: Tpnu, distances: LabeledDistances, deadline: Deadline) -> None:
        self.vocabulary: Vocabulary = distances.vocabulary
        self.guards: Mapping[str, Environment] = {
            event.name: self.vocabulary.encode(event.guard) for event in network.events
        }
        self.after: dict[str, list[Reach]] = {event: [] for event in self.guards}
        """D(event, other) for every other event."""
        self.before: dict[str, list[Reach]] = {event: [] for event in self.guards}
        """D(other, event) for every other event."""
        for source in self.guards:
            deadline.enforce()
            for target in self.guards:
                if source != target:
                    for distance, label in distances.labeled(source, target):
                        self.after[source].append(Reach(target, distance, label))
                        self.before[target].append(Reach(source, distance, label))


class Windows:
    """Execution windows of pending events: labeled value sets that each execution tightens.

    Bounds are absolute times; labels are without the guard of the event itself.
    """

    def __init__(self, table: DistanceTable) -> None:
        self._table = table
        self.lower: dict[str, LabeledValueSet[Fraction]] = {}
        """(l, φ): in φ, the event is at l or later."""
        self.upper: dict[str, LabeledValueSet[Fraction]] = {}
        """(u, φ): in φ, the event is at u or earlier."""
        for event in table.guards:
            self.lower[event] = LabeledValueSet(table.vocabulary, operator.gt)
            self.upper[event] = LabeledValueSet(table.vocabulary, operator.lt)

    def executed(self, event: str, time: Fraction, known: Environment) -> None:
        """Propagate a time to the windows of all other events [PIKE, Equation 1]; what is known not to be is left out.

        `known` says which assignments hold for certain; labels are kept without them.
        """
        del self.lower[event], self.upper[event]
        for windows, reaches, sign in ((self.upper, self._table.after, 1), (self.lower, self._table.before, -1)):
            for other, distance, label in reaches[event]:
                window = windows.get(other)
                if window is not None and self._table.vocabulary.consistent(label | known):
                    window.add(time + sign * distance, label & ~known)

    def drop(self, event: str) -> None:
        """The event is not activated."""
        self.lower.pop(event, None)
        self.upper.pop(event, None)

    def missed(self, event: str, now: Fraction) -> Iterator[Environment]:
        """Where the event would have had to be executed before now [PIKE, Algorithm 1, line 6]."""
        guard = self._table.guards[event]
        for bound, label in self.upper.get(event, ()):
            if bound < now:
                yield label | guard

    def early(self, event: str, now: Fraction) -> Iterator[Environment]:
        """Where the event must not be executed yet [PIKE §3, constraint 3]."""
        guard = self._table.guards[event]
        for bound, label in self.lower.get(event, ()):
            if bound > now:
                yield label | guard


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
