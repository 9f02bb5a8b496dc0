"""The πTMS: labels of all prime implicants [PIKE §5.2 to §5.7]."""

from __future__ import annotations

from collections.abc import Iterator

from robust.pike_bridge.knowledge.goal import Joining
from robust.pike_bridge.knowledge.labels import split
from robust.pike_bridge.knowledge.tms import LabelKnowledgeBase
from robust.pike_bridge.model import Guard


class PiTms(LabelKnowledgeBase):
    """The knowledge base of [PIKE §5]: the goal's label holds the prime implicants of the theory, and no others."""

    name = "pitms"
    consensus = True

    def prime_implicants(self) -> Iterator[Guard]:
        """Every prime implicant of what is left of the theory, once; there may be very many."""
        return self.goal()

    def implicant_count(self) -> int:
        """How many prime implicants what is left of the theory has."""
        return self.goal_size()

    def _create_joining(self) -> Joining:
        return Joining(self._vocabulary, split, resolved=True)
