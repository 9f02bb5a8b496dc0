"""Time limits that are shared by everything that a computation starts."""

from __future__ import annotations

import select
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Final

from robust.errors import InputError

LONGEST = 4_000_000
"""Seconds; z3 counts milliseconds in 32 bits."""

GLANCE = 0.2
"""Seconds between two looks for a lost Ctrl-C."""


class OutOfTimeError(Exception):
    """The deadline passed before the question was decided; internal to the searches, which return what they have."""


@dataclass(frozen=True, slots=True)
class Deadline:
    """A moment on the monotonic clock, or never; whoever works towards it asks `remaining` before each query."""

    moment: float | None = None

    @staticmethod
    def after(seconds: float | None) -> Deadline:
        """The moment `seconds` from now; None, and more than solvers can count, is never.

        Raises:
            InputError: if `seconds` is negative or not a number.
        """
        if seconds is None or seconds > LONGEST:
            return NEVER
        if not seconds >= 0:
            raise InputError(f"time limit is {seconds}; expected seconds, at least 0")
        return Deadline(time.monotonic() + seconds)

    @property
    def remaining(self) -> float | None:
        """Seconds left, at least zero; None without a limit."""
        return None if self.moment is None else max(0.0, self.moment - time.monotonic())

    @property
    def passed(self) -> bool:
        return self.moment is not None and time.monotonic() >= self.moment

    def enforce(self) -> None:
        """For long computations outside of solvers, to be called now and then.

        Raises:
            OutOfTimeError: if the moment has passed.
            KeyboardInterrupt: if Ctrl-C was pressed and got lost.
        """
        raise_if_interrupted()
        if self.passed:
            raise OutOfTimeError


NEVER: Final = Deadline()
"""No limit."""


def has_input(reader: int, deadline: Deadline) -> bool:
    """Wait until a file descriptor can be read; False if the deadline passes first.

    Looks up now and then, so that a Ctrl-C that Python lost in a finaliser is not waited out.
    """
    while True:
        raise_if_interrupted()
        remaining = deadline.remaining
        ready, _, _ = select.select([reader], [], [], GLANCE if remaining is None else min(GLANCE, remaining))
        if ready:
            return True
        if deadline.passed:
            return False


class _Notes:
    noticed = False


@contextmanager
def noticing_interrupts() -> Iterator[None]:
    """Note Ctrl-C within the block; it still raises KeyboardInterrupt at once wherever Python can.

    Does nothing outside of the main thread, and where the program handles the signal in its own way.
    """
    usual = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or usual is not signal.default_int_handler:
        yield
        return
    _Notes.noticed = False
    signal.signal(signal.SIGINT, _note)
    try:
        yield
    finally:
        _Notes.noticed = False
        signal.signal(signal.SIGINT, usual)


def _note(number: int, frame: FrameType | None) -> None:
    _Notes.noticed = True
    signal.default_int_handler(number, frame)


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt if Ctrl-C was pressed in the block of :func:`noticing_interrupts` that is running."""
    if _Notes.noticed:
        raise KeyboardInterrupt
