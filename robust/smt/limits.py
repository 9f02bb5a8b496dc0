"""Time limits that are shared by everything that a computation starts.

Work inside this process that nothing can interrupt, such as a call of a solver's library, runs in a forked copy of the
process that can be ended at any moment.
"""

from __future__ import annotations

import os
import select
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from itertools import count
from types import FrameType
from typing import Any, Final, NoReturn, TypeVar

from robust.errors import InputError, SolverError

T = TypeVar("T")

LONGEST = 4_000_000
"""Seconds; z3 counts milliseconds in 32 bits."""

GLANCE = 0.2
"""Seconds between two looks for a lost Ctrl-C."""


class OutOfTimeError(Exception):
    """The deadline passed before the question was decided; internal to the searches, which return what they have.

    `reason` says so if it was not the deadline, but a solver that crashed or gave up.
    """

    def __init__(self, reason: str | None = None) -> None:
        super().__init__(reason)
        self.reason = reason


class DiedError(SolverError):
    """A copy of this process ended without an answer, such as by an abort of a solver's library."""


@dataclass(frozen=True, slots=True)
class Deadline:
    """A moment on the monotonic clock, or never; whoever works towards it asks `remaining` before each query.

    With `processor` it comes, too, when this thread has worked for so many seconds; with `idle`, as soon as that says
    that there is something else to do.
    """

    moment: float | None = None
    processor: float | None = None
    idle: Callable[[], bool] | None = None

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

    def within(self, seconds: float | None) -> Deadline:
        """This deadline, or that this thread works for so many seconds of processor time from now; None: this one."""
        if seconds is None:
            return self
        end = time.thread_time() + seconds
        return replace(self, processor=end if self.processor is None else min(end, self.processor))

    @property
    def on_clock(self) -> Deadline:
        """The deadline for work that others do, whose processor time is not this thread's."""
        return self if self.processor is None else Deadline.after(self.remaining)

    @property
    def remaining(self) -> float | None:
        """Seconds left, at least zero; None without a limit."""
        if self.idle is not None and not self.idle():
            return 0.0
        left = [] if self.moment is None else [self.moment - time.monotonic()]
        left += [] if self.processor is None else [self.processor - time.thread_time()]
        return max(0.0, min(left)) if left else None

    @property
    def passed(self) -> bool:
        return self.remaining == 0.0

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


@dataclass(slots=True)
class Question:
    """What is asked at once. Its formulas share the context of a solver, and no other question does: in a common
    context, models depend on everything that was translated before, and so would answers.

    Attributes:
        first: whether it is the first of this process, for which the solver's own context is as good as a new one.
        context: made when it is first needed.
    """

    first: bool
    context: Any = None


_question: ContextVar[Question | None] = ContextVar("question", default=None)
_questions = count()


def current_question() -> Question | None:
    """The question of the block of :func:`one_question` that is running."""
    return _question.get()


@contextmanager
def one_question() -> Iterator[None]:
    """A question, from its formulas to its answer: that depends on no question before it, and Ctrl-C is noted."""
    if _question.get() is not None:
        with _noticing_interrupts():
            yield
        return
    token = _question.set(Question(first=next(_questions) == 0))
    try:
        with _noticing_interrupts():
            yield
    finally:
        _question.reset(token)


@contextmanager
def _noticing_interrupts() -> Iterator[None]:
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
    """Raise KeyboardInterrupt if Ctrl-C was pressed in the block of :func:`one_question` that is running."""
    if _Notes.noticed:
        raise KeyboardInterrupt


@contextmanager
def uninterrupted() -> Iterator[None]:
    """A short block in which nothing raises KeyboardInterrupt in the main thread: a child is started or ended whole."""
    usual = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        # This raises the KeyboardInterrupt of a signal that came before, when they are blocked already.
        signal.pthread_sigmask(signal.SIG_BLOCK, _INTERRUPTING)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, usual)


# -- copies of this process --------------------------------------------------------------------------------------------

_HEADER = struct.Struct("!?Q")
"""Whether the work failed, and the size of what follows."""
_INTERRUPTING = frozenset({signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM})
"""What somebody sends, and what :mod:`robust.cli.guard` sends the main thread."""
_DIE_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of Linux's `prctl`."""


def from_copy(work: Callable[[], T], deadline: Deadline, task: str) -> T:
    """What `work` returns, computed in a copy of this process; see :func:`stream_from_copy`."""
    results = stream_from_copy(lambda: [work()], deadline, task)
    try:
        return next(results)
    finally:
        results.close()


def stream_from_copy(work: Callable[[], Iterable[T]], deadline: Deadline, task: str) -> Generator[T]:
    """What `work` yields, computed in a copy of this process; leaving the iteration early ends the copy.

    The items are pickled, and none is None. `task` names the work in messages.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the work failed; DiedError if the copy died.
    """
    import pickle  # noqa: PLC0415 - loaded with the first copy

    reader, writer = os.pipe()
    child, parent = 0, os.getpid()
    try:
        with uninterrupted():
            child = os.fork()
            if child == 0:
                os.close(reader)
                _run_in_copy(work, writer, parent)
            os.close(writer)
        while True:
            header = _read(reader, _HEADER.size, deadline)
            failed, size = _HEADER.unpack(header) if header else (False, 0)
            content = _read(reader, size, deadline) if header else b""
            if not content:
                ended, child = child, 0
                raise DiedError(f"{task} {_how_it_ended(ended)}")
            item = pickle.loads(content)  # noqa: S301 - written by our own copy
            if failed:
                raise SolverError(f"{task} failed: {item}")
            if item is None:
                return
            yield item
    finally:
        with uninterrupted():
            os.close(reader)
            if child:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)


def _how_it_ended(child: int) -> str:
    """What became of a copy that has closed its pipe."""
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code >= 0:
        return f"ended without an answer, with exit code {code}"
    memory = "; it may have run out of memory" if -code == signal.SIGKILL else ""
    return f"ended with signal {signal.Signals(-code).name}{memory}"


def _run_in_copy(work: Callable[[], Iterable[Any]], writer: int, parent: int) -> NoReturn:
    """Runs in the copy, which must never return into the caller's stack; None marks the end."""
    import ctypes  # noqa: PLC0415 - only copies ask for it
    import traceback  # noqa: PLC0415 - likewise

    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if sys.platform == "linux":
            ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL, 0, 0, 0)
            if os.getppid() != parent:  # which had died before
                os._exit(0)
        try:
            for item in work():
                _write(writer, False, item)
            _write(writer, False, None)
        except Exception:  # whatever it is, the caller must hear of it
            _write(writer, True, traceback.format_exc(limit=-1).strip().splitlines()[-1])
    finally:
        os._exit(0)


def _write(writer: int, failed: bool, item: Any) -> None:
    import pickle  # noqa: PLC0415 - as in the parent

    content = pickle.dumps(item)
    pending = memoryview(_HEADER.pack(failed, len(content)) + content)
    while pending:
        pending = pending[os.write(writer, pending) :]


def _read(reader: int, size: int, deadline: Deadline) -> bytes:
    """Nothing if the copy has died."""
    content = bytearray()
    while len(content) < size:
        if not has_input(reader, deadline):
            raise OutOfTimeError
        chunk = os.read(reader, min(1 << 20, size - len(content)))
        if not chunk:
            return b""
        content += chunk
    return bytes(content)
