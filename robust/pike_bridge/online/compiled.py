"""What executives with knowledge bases have in common: facts become assignments and conflicts [PIKE §3, §5.7]."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from robust.pike_bridge.compilation import Compilation
from robust.pike_bridge.environment import Environment, Vocabulary
from robust.pike_bridge.knowledge.interface import Commitment, Exclude, Require
from robust.pike_bridge.model import Condition, Effect, Guard, may_produce
from robust.pike_bridge.online.progress import Progress
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
