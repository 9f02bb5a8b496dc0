"""The πTMS: labels of all prime implicants [PIKE §5.2 to §5.7]."""

from __future__ import annotations

from collections.abc import Iterator

from robust.pike_bridge.knowledge.goal import Joining
from robust.pike_bridge.knowledge.labels import split
from robust.pike_bridge.knowledge.tms import NEVER, LabelKnowledgeBase
from robust.pike_bridge.model import Guard
from robust.smt.limits import Deadline


class PiTms(LabelKnowledgeBase):
    """The knowledge base of [PIKE §5]: the goal's label holds the prime implicants of the theory, and no others."""

    name = "pitms"
    consensus = True

    def prime_implicants(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """Every prime implicant of what is left of the theory, once; there may be very many.

        Raises:
            OutOfTimeError: if the deadline passes before all are listed.
        """
        for implicant in self.goal():
            deadline.enforce()
            yield implicant

    def implicant_count(self, deadline: Deadline = NEVER) -> int:
        """How many prime implicants what is left of the theory has.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        deadline.enforce()
        return self.goal_size()

    def _create_joining(self) -> Joining:
        return Joining(self._vocabulary, split, resolved=True)
