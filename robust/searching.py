"""Searches that know at any moment what they have found, and how they end."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

from robust.presented import Presented, VerdictEnum
from robust.smt.limits import OutOfTimeError

Result = TypeVar("Result")
Result_co = TypeVar("Result_co", covariant=True)


class Status(VerdictEnum):
    """How a search ended."""

    COMPLETE = "complete"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"
    INVALID = "invalid"
    UNKNOWN = "unknown"


DECIDED = (Status.COMPLETE, Status.INVALID)
"""Nothing ended the search before it was done."""
Announce: TypeAlias = Callable[[str], None]
"""Called with the name of each stage that begins."""


def unheard(_stage: str) -> None:
    """An :data:`Announce` for nobody."""


class SearchResult(Protocol):
    """The result of a search."""

    @property
    def cut_short(self) -> bool:
        """Whether something ended the search before it was done."""

    def as_dict(self) -> dict[str, Any]:
        """The document that is printed for programs."""


class AnytimeSearch(Protocol[Result_co]):
    """A computation that knows at any moment what it has found."""

    def run(self) -> Result_co:
        """The final result; out of time or interrupted, what is known by then."""

    def so_far(self, *, timed_out: bool) -> Result_co | None:
        """The result so far if the search is given up now, out of time or interrupted; None if there is none."""


class Stoppable(Presented):
    """A result whose `status` says how the search for it ended, as a :class:`Status` or its value."""

    status: Status | str

    @property
    def cut_short(self) -> bool:
        """Whether something ended the search before it was done."""
        return Status(self.status) not in DECIDED


def stopped_as(stopped: OutOfTimeError) -> tuple[Status, str | None]:
    """How a search ended, and which failure of a solver ended it if it is UNKNOWN."""
    return Status.TIMEOUT if stopped.reason is None else Status.UNKNOWN, stopped.reason


class Searching(ABC, Generic[Result]):
    """A search that can be given up; subclasses say how to search, and what to make of what is known."""

    def __init__(self) -> None:
        self._started = time.perf_counter()

    def run(self) -> Result:
        """What is found until the search is done, out of time, interrupted by Ctrl-C or ended by a failed solver.

        Raises:
            KeyboardInterrupt: if nothing is known that is worth an answer.
        """
        return self._result(*self._ending())

    def so_far(self, *, timed_out: bool) -> Result | None:
        """What is known if the search is given up now, out of time or else interrupted; None: nothing."""
        return self._result(Status.TIMEOUT if timed_out else Status.INTERRUPTED) if self._begun else None

    @property
    def _begun(self) -> bool:
        """Whether anything is known that is worth an answer."""
        return True

    def _ending(self) -> tuple[Status, str | None]:
        """Search; how that ended, and which failure of a solver ended it if it is UNKNOWN."""
        try:
            self._search()
        except OutOfTimeError as stopped:
            return stopped_as(stopped)
        except KeyboardInterrupt:
            if not self._begun:
                raise
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
