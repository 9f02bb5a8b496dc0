"""What all long questions about plans with choices have in common: whatever ends one, its answer says what is known."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, Literal, TypeAlias, TypeVar

from robust.presented import Presented
from robust.smt.limits import OutOfTimeError

Known = TypeVar("Known")
Stopped: TypeAlias = Literal["timeout", "interrupted"]
"""What ended a question before it was answered."""
Announce: TypeAlias = Callable[[str], None]
"""Called with the name of each stage that begins."""


def unheard(_stage: str) -> None:
    """An :data:`Announce` for nobody."""


class Stoppable(Presented):
    """An answer whose `status` says what ended the question: `complete`, or :data:`Stopped`."""

    status: str

    @property
    def cut_short(self) -> bool:
        """Whether something ended the question before it was answered."""
        return self.status != "complete"


class PikeSearch(ABC, Generic[Known]):
    """One question, asked once."""

    def run(self) -> Known:
        """Answer the question; a deadline or Ctrl-C ends that with what is known, if anything is.

        Raises:
            InputError: for what is unknown or wrong.
            SolverError: if a solver is unknown, not installed or fails, or an answer is not confirmed.
        """
        try:
            self._search()
        except OutOfTimeError:
            return self._answer("timeout")
        except KeyboardInterrupt:
            if not self._begun:
                raise
            return self._answer("interrupted")
        return self._answer(None)

    def so_far(self, *, timed_out: bool) -> Known | None:
        """What is known by now; None: nothing."""
        return self._answer("timeout" if timed_out else "interrupted") if self._begun else None

    @property
    def _begun(self) -> bool:
        """Whether anything is known that is worth an answer."""
        return True

    @abstractmethod
    def _search(self) -> None:
        """Find out everything; OutOfTimeError if the deadline passes."""

    @abstractmethod
    def _answer(self, stopped: Stopped | None) -> Known:
        """What is known; `stopped` says what ended the search, None that it ended by itself."""
