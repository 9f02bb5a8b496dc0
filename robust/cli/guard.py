"""Ctrl-C, SIGTERM, SIGHUP and time limits: whatever the program is doing, it answers within a second.

Signals are blocked in the main thread and received by a watcher thread. Neither a solver that handles SIGINT by itself
nor a finalizer that swallows `KeyboardInterrupt` can then hide one. The watcher interrupts the main thread only while
work is going on that may be given up, and again until that has ended; if it does not end in time, the watcher answers.

A :class:`Run` is one guarded run of one command: what a search has found is its answer, however it ends, and is printed
before any file is written.
"""

from __future__ import annotations

import inspect
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sized
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from robust.cli.output import Display, answering, complain, noting_warnings, print_json
from robust.errors import UNDECIDED, RobustError, SolverError, refused
from robust.options.declare import Options, as_typed
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.searching import AnytimeSearch, SearchResult
    from robust.show.console import Console

STOPS = frozenset({signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
_NUDGE = signal.SIGALRM
_AGAIN = 0.15
"""Seconds until an interruption without effect is repeated."""
_PATIENCE = 0.7
"""Seconds until the watcher gives up waiting for the main thread."""
_GRACE = 0.25
"""Seconds after a time limit in which searches stop by themselves."""
_TICK = 0.05
"""Seconds between two looks at the clock."""


class Cause(Enum):
    """The cause for which work was given up."""

    INTERRUPTED = "interrupted"
    TIMEOUT = "timeout"

    @property
    def message(self) -> str:
        """For people."""
        return "out of time" if self is Cause.TIMEOUT else "interrupted"


class GivenUpError(Exception):
    """Work was given up before there was anything to show; not `KeyboardInterrupt`, which typer answers itself.

    `cause` is why, where the work found that out by itself rather than by the guard.
    """

    def __init__(self, cause: Cause | None = None) -> None:
        super().__init__(cause)
        self.cause = cause


class Guard:
    """Interrupts the main thread; a context manager that puts the signals back as they were.

    `cause` is why, once that is so. Without a main thread of its own, or on systems without `sigtimedwait`, it does
    nothing and Ctrl-C raises `KeyboardInterrupt` as usual.
    """

    def __init__(self) -> None:
        self.cause: Cause | None = None
        self.answered = False
        """Whether an answer has been printed, which the exit code is about then."""
        self.started = time.monotonic()
        self._limit: float | None = None
        self._main = threading.main_thread().ident or 0
        self._working = False
        self._since: float | None = None  # when the work under way was interrupted first
        self._nudged = 0.0
        self._closed = False
        self._on_stuck: Callable[[], bool] | None = None
        # Of nohup, SIGHUP stays ignored; a blocked signal is received even if it is ignored.
        ignored = {signal.SIGHUP} if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN else set()
        self._stops = STOPS - ignored
        self._watcher: threading.Thread | None = None
        self._released = threading.Event()

    def __enter__(self) -> Guard:
        if not hasattr(signal, "sigtimedwait") or threading.current_thread() is not threading.main_thread():
            return self
        self._mask = signal.pthread_sigmask(signal.SIG_BLOCK, STOPS)
        self._handlers = {
            _NUDGE: signal.signal(_NUDGE, self._interrupt_main),
            # These run only if a thread that was there before takes the signal. z3 replaces that of SIGINT during its
            # queries, which is what the watcher's own SIGINT is for.
            **{
                number: signal.signal(number, self._note)
                for number in STOPS
                if signal.getsignal(number) != signal.SIG_IGN
            },
        }
        self._unraisable, sys.unraisablehook = sys.unraisablehook, self._on_unraisable
        self._released.clear()
        self._watcher = threading.Thread(target=self._watch, name="robust-guard", daemon=True)
        self._watcher.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop watching: from now on, signals do what they did before."""
        if self._watcher is None:
            return
        self._closed = True
        signal.pthread_kill(self._watcher.ident or 0, signal.SIGTERM)
        self._released.set()
        self._watcher.join()
        self._watcher, self._closed = None, False
        sys.unraisablehook = self._unraisable
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, self._mask)

    @contextmanager
    def handed_over(self) -> Iterator[None]:
        """For work that starts processes, and returns what it has: the signals raise `KeyboardInterrupt` in it.

        What it returns is safe again from signals afterwards.
        """
        if self._watcher is None:
            yield
            return
        mask = self._mask
        self.close()
        usual = {number: signal.signal(number, signal.default_int_handler) for number in self._stops}
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_BLOCK, STOPS)
            for number, handler in usual.items():
                signal.signal(number, handler)
            self.__enter__()
            self._mask = mask

    @contextmanager
    def working(self, limit: float | None = None, on_stuck: Callable[[], bool] | None = None) -> Iterator[None]:
        """Work that Ctrl-C and the time limit end with `KeyboardInterrupt`.

        Args:
            limit: seconds since the guard was made; work should keep to it by itself, or is interrupted a little later.
            on_stuck: called in another thread if the work does not end when interrupted; the process ends afterwards.
                It returns whether it has printed an answer.
        """
        self._limit = limit
        self._on_stuck = on_stuck
        self._since = None
        self._working = True
        try:
            if self.cause is not None:
                raise KeyboardInterrupt
            yield
        finally:
            self._working = False

    def why(self, error: BaseException | None = None) -> Cause:
        """The cause for which work was given up; whatever ended it may have established that by itself."""
        return self.cause or getattr(error, "cause", None) or Cause.INTERRUPTED

    def remaining(self, limit: float | None) -> float | None:
        """Seconds of the limit that are left, a tiny number if none are."""
        return None if limit is None else max(1e-3, limit - self.age)

    # -- the main thread -------------------------------------------------------------------------------------------

    def _interrupt_main(self, _number: int, _frame: FrameType | None) -> None:
        if self._working and self.cause is not None:
            raise KeyboardInterrupt

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        self.cause = self.cause or Cause.INTERRUPTED

    def _on_unraisable(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Finalizers that are interrupted, or find half-made objects then, are not worth a traceback."""
        if self.cause is None:
            self._unraisable(unraisable)

    # -- the watcher -----------------------------------------------------------------------------------------------

    def _watch(self) -> None:
        while True:
            received = signal.sigtimedwait(self._stops, _TICK)
            if self._closed:
                self._released.wait()  # a thread that has ended must not be sent the signal that wakes it
                return
            if received is not None:
                self._on_stop()
            elif self._working and self._limit is not None and self.age > self._limit + _GRACE:
                self.cause = self.cause or Cause.TIMEOUT
            if self._working and self.cause is not None:
                self._interrupt()

    @property
    def age(self) -> float:
        """Seconds since the guard was made."""
        return time.monotonic() - self.started

    def _on_stop(self) -> None:
        if self.cause is not None and not self._working:
            os._exit(UNDECIDED)  # the second one: not even the answer is wanted
        self.cause = Cause.INTERRUPTED

    def _interrupt(self) -> None:
        now = time.monotonic()
        if self._since is None:
            self._since = self._nudged = now
            self._nudge()
        elif now - self._since > _PATIENCE:
            if self._on_stuck is None or not self._on_stuck():
                os.write(2, f"robust: {self.why().message}\n".encode())
            os._exit(UNDECIDED)
        elif now - self._nudged > _AGAIN:
            self._nudged = now
            self._nudge()

    def _nudge(self) -> None:
        signal.pthread_kill(self._main, _NUDGE)  # ends what waits in the system and raises KeyboardInterrupt
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)  # ends a query of z3
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])


# -- one run of one command --------------------------------------------------------------------------------------------


Found = TypeVar("Found")
Known = TypeVar("Known", bound="SearchResult")


def _given_up(stopped: OutOfTimeError) -> Exception:
    """The error of a command that has nothing to show: out of time, or the failure of a solver."""
    return GivenUpError(Cause.TIMEOUT) if stopped.reason is None else SolverError(stopped.reason)


class Run:
    """One run of one command: its display, its time limit, and its answer; a context manager."""

    def __init__(self, guard: Guard, options: Options) -> None:
        self.guard = guard
        self._json = bool(getattr(options, "json", False))
        self._limit: float | None = getattr(options, "limit", None)
        talks = getattr(options, "quiet", False) or getattr(options, "verbose", False)
        self._quiet = bool(getattr(options, "quiet", False))
        self._notes: list[str] = []
        self._writes: list[Callable[[], object]] = []
        self._failed = 0
        given = (getattr(options, name, None) for name in options.written)
        self._files = [path for path in given if isinstance(path, Path)]
        self._color: str = getattr(options, "color", "auto")
        self.display = Display(shown=hasattr(options, "quiet") and not talks, what="reading", color=self._color)

    def __enter__(self) -> Run:
        self.display.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.display.stop()

    @property
    def remaining(self) -> float | None:
        """Seconds of the time limit that are left."""
        return self.guard.remaining(self._limit)

    def note(self, text: str) -> None:
        """Say on stderr what was done with the input, unless that is not wanted; an answer in JSON has it as well."""
        self._notes.append(text)
        if not self._quiet:
            self.display.stop()
            complain(text)
            self.display.start()

    def write(self, work: Callable[[], object]) -> None:
        """Have files written, or a picture drawn, when the answer has been printed: none of it may cost the answer."""
        self._writes.append(work)

    def unwritten(self, error: RobustError) -> None:
        """Say that a file was not written, which makes the exit code that of bad input."""
        self._failed = error.exit_code
        self.display.stop()
        complain(f"error: {error}")

    @contextmanager
    def naming_what_is_not_written(self) -> Iterator[None]:
        """Name each file that was asked for and is not written, unless an error says what is wrong."""
        before = {path: _state(path) for path in self._files if path.is_file() or not path.exists()}

        def name_them() -> None:
            self.display.stop()
            for path, state in before.items() if not self._failed else ():
                if _state(path) == state:
                    complain(f"{path} was not written: the answer has nothing for it")

        try:
            yield
        except (KeyboardInterrupt, GivenUpError):
            name_them()
            raise
        name_them()

    def finish(self, code: int) -> int:
        """Write files, each whatever becomes of the others; the exit code."""
        for work in self._writes:
            try:
                work()
            except RobustError as error:
                self.unwritten(error)
            except OSError as error:
                self.unwritten(refused(error))
        return self._failed or code

    def working(self, on_stuck: Callable[[], bool] | None = None) -> AbstractContextManager[None]:
        """Work that may be given up, see :meth:`Guard.working`."""
        return self.guard.working(self._limit, on_stuck)

    def enforce(self, deadline: Deadline) -> None:
        """Raise what ends the run, where no work is going on: an interruption, or the deadline."""
        if self.guard.cause is not None:
            raise KeyboardInterrupt
        deadline.enforce()

    @property
    def timed_out(self) -> bool:
        """Whether the time limit has ended what was going on."""
        return self.guard.cause is Cause.TIMEOUT

    def best(self, begin: Callable[[], AnytimeSearch[Known]], show: Callable[[Known], None]) -> Known:
        """The result of a search when it ends or is ended; if it does not react to that, `show` and exit.

        Raises:
            GivenUpError: if nothing is known.
        """
        search: AnytimeSearch[Known] | None = None

        def so_far() -> Known | None:
            return None if search is None else search.so_far(timed_out=self.timed_out)

        def on_stuck() -> bool:
            if (known := so_far()) is not None:
                show(known)
            return known is not None

        try:
            with self.working(on_stuck):
                search = begin()
                result = search.run()
        except KeyboardInterrupt:
            if (known := so_far()) is None:
                raise GivenUpError from None
            return known
        except OutOfTimeError as stopped:
            raise _given_up(stopped) from None
        if self.guard.cause is not None and result.cut_short:
            # What was interrupted by the time limit is out of time.
            return result if (known := so_far()) is None else known
        return result

    def reply(self, begin: Callable[[], AnytimeSearch[Known]]) -> Known:
        """The result of a search as by :meth:`best`, printed as the answer."""
        result = self.best(begin, self.show)
        self.show(result)
        return result

    def show(self, found: SearchResult) -> None:
        """Print a result as an answer."""
        from robust.show.presenting import print_result

        self.answer(found.as_dict, lambda out: print_result(out, found, quiet=self._quiet))

    def only(self, work: Callable[[], Found]) -> Found:
        """The result of the work.

        Raises:
            GivenUpError: if it was interrupted, or is out of time.
        """
        try:
            with self.working():
                return work()
        except KeyboardInterrupt:
            raise GivenUpError from None
        except OutOfTimeError as stopped:
            raise _given_up(stopped) from None

    def several(self, work: Callable[[], object], found: Sized) -> Cause | None:
        """Do work that adds to what is found, one after the other; why it was given up, if it was.

        Raises:
            GivenUpError: if nothing had been found by then.
        """
        try:
            self.only(work)
        except GivenUpError as error:
            if not found:
                raise
            return self.guard.why(error)
        return None

    def also(self, what: str, work: Callable[[], Found]) -> Found | None:
        """The result of the work; None if it was interrupted, which leaves the answer as it is."""
        self.display.say(what)
        try:
            return self.only(work)
        except GivenUpError:
            return None

    def answer(self, document: Callable[[], Mapping[str, Any]], text: Callable[[Console], None]) -> None:
        """Print one JSON object, or a text for people."""
        self.display.stop()
        if self._json:
            print_json({**document(), "notes": self._notes} if self._notes else document())
        else:
            with answering():
                text(self.console())
        self.guard.answered = True

    def console(self) -> Console:
        """The console for answers for people."""
        from robust.show.console import console

        return console(color=self._color)


EPILOG = "Exit codes: 0 proved or done, 1 refuted, 2 bad input, 3 unknown, out of time or interrupted, 4 unsupported."
Given = TypeVar("Given", bound=Options)


@dataclass(frozen=True, slots=True)
class Action(Generic[Given]):
    """The action of a command: `carry_out` returns the exit code."""

    options: type[Given]
    carry_out: Callable[[Given, Run], int]
    epilog: str | None
    help: str


def action(
    options: type[Given], *, epilog: str | None = EPILOG
) -> Callable[[Callable[[Given, Run], int]], Action[Given]]:
    """Make a function of options and a run the action of a command, whose help text is the docstring."""
    return lambda carry_out: Action(options, carry_out, epilog, inspect.getdoc(carry_out) or "")


def carry_out(guard: Guard, asked: Action[Any], given: Mapping[str, Any]) -> int:
    """Run an action with the options that were given; its exit code."""
    with as_typed(given, asked.options):
        options = asked.options(**given)
        if getattr(options, "verbose", False):
            _log_to_stderr()
        shown = not getattr(options, "quiet", False)
        with Run(guard, options) as run, noting_warnings(run.unwritten, shown=shown), run.naming_what_is_not_written():
            return run.finish(asked.carry_out(options, run))


def _state(path: Path) -> tuple[int, int] | None:
    """The part of a file's status that changes when it is written; None if there is no file."""
    return (status.st_ino, status.st_mtime_ns) if path.exists() and (status := path.stat()) else None


def _log_to_stderr() -> None:
    """Send the log to stderr, for `--verbose`."""
    import logging

    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(relativeCreated)7.0f ms  %(name)s: %(message)s"))
    logger = logging.getLogger("robust")
    logger.handlers[:] = [handler]
    logger.setLevel(logging.DEBUG)
