"""Searches that know at any moment what they have found, and how they end."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Generic, TypeVar

from robust.presented import VerdictEnum
from robust.smt.limits import OutOfTimeError

Result = TypeVar("Result")


class Status(VerdictEnum):
    """How a search ended."""

    COMPLETE = "complete"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"
    INVALID = "invalid"
    UNKNOWN = "unknown"


DECIDED = (Status.COMPLETE, Status.INVALID)
"""Nothing ended the search before it was done."""


class Searching(ABC, Generic[Result]):
    """A search that can be given up; subclasses say how to search, and what to make of what is known."""

    def __init__(self) -> None:
        self._started = time.perf_counter()

    def run(self) -> Result:
        """What is found until the search is done, out of time, interrupted by Ctrl-C or ended by a failed solver."""
        return self._result(*self._ending())

    def so_far(self, *, timed_out: bool) -> Result:
        """What is known if the search is given up now, because time is out or else by an interruption."""
        return self._result(Status.TIMEOUT if timed_out else Status.INTERRUPTED)

    def _ending(self) -> tuple[Status, str | None]:
        """Search; how that ended, and which failure of a solver ended it if it is UNKNOWN."""
        try:
            self._search()
        except OutOfTimeError as stopped:
            return Status.TIMEOUT if stopped.reason is None else Status.UNKNOWN, stopped.reason
        except KeyboardInterrupt:
            return Status.INTERRUPTED, None
        return Status.COMPLETE, None

    def _seconds(self) -> float:
        """Since the search was made."""
        return time.perf_counter() - self._started

    @abstractmethod
    def _search(self) -> None:
        """Find everything, unless an exception ends the search."""

    @abstractmethod
    def _result(self, status: Status, reason: str | None = None) -> Result:
        """What is known by now."""
