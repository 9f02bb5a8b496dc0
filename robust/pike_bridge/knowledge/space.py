"""How much a compilation may spend: time by its deadline, and space by the size of what it builds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from robust.pike_bridge.knowledge.interface import KnowledgeStatistics
from robust.smt.limits import Deadline, OutOfTimeError

LARGEST_LABEL: Final = 4_000_000
"""Environments of one label; about half a gigabyte at a hundred assignments each."""
GLANCE: Final = 2_000
"""Environments that are created between two looks at the clock."""


class OutOfSpaceError(OutOfTimeError):
    """What is compiled grew beyond its limit, which ends it as its deadline would."""


@dataclass(slots=True)
class Effort:
    """Counts what label propagation does, and ends it in time."""

    statistics: KnowledgeStatistics
    deadline: Deadline = Deadline()  # noqa: RUF009 - immutable
    largest_label: int = LARGEST_LABEL
    _unseen: int = field(default=0, init=False)

    def create(self, environments: int) -> None:
        """Note environments that were created.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        self.statistics.environments_created += environments
        self.pass_by(environments)

    def pass_by(self, environments: int) -> None:
        """Note environments that were looked at.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        self._unseen += environments
        if self._unseen >= GLANCE:
            self._unseen = 0
            self.deadline.enforce()

    def subsume(self, environments: int) -> None:
        """Note environments that were dropped, because others entail less."""
        self.statistics.environments_subsumed += environments

    def hold(self, environments: int) -> None:
        """Note the size of a label.

        Raises:
            OutOfSpaceError: if it is too large.
        """
        if environments > self.largest_label:
            raise OutOfSpaceError
