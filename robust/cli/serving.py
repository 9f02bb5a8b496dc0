"""`robust pike run --stdio`: any process drives an executive through lines of JSON, in its own time or in real time."""

from __future__ import annotations

import asyncio
import json
import os
import select
import sys
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field
from fractions import Fraction
from math import floor
from typing import TYPE_CHECKING, Any

from robust.cli.guard import UNDECIDED, Cause, GivenUpError, Run
from robust.cli.output import drop_output
from robust.cli.pike_options import PikeRunCommand, check_backend
from robust.errors import InputError, Location
from robust.smt.limits import GLANCE, NEVER, Deadline, OutOfTimeError, has_input

if TYPE_CHECKING:
    from robust.execute.drive import WallClock
    from robust.pike_bridge.model import TeamPlan
    from robust.pike_bridge.online.journal import Journal
    from robust.pike_bridge.online.service import Request, Service

REAL = "real"
_TOLERANCE = Fraction(1)
"""Seconds by which decisions in real time may be late, for thinking and writing, and still count as on time."""
_LOOK = 0.05
"""Seconds between two looks for signals and the deadline, in real time."""


def serve(options: PikeRunCommand, run: Run) -> int:
    """Serve until the input ends; the exit code says how the execution ended.

    Raises:
        RobustError: wrong options or files, or a journal that does not fit or cannot be written.
        GivenUpError: if interrupted or out of time before the plan was read.
    """
    server = _Server(options, run, Fraction(options.rate or 1), Deadline.after(run.remaining))
    try:
        run.only(server.prepare)
    except OutOfTimeError:
        run.guard.cause = run.guard.cause or Cause.TIMEOUT
        raise GivenUpError from None
    try:
        return server.serve()
    finally:
        server.close()


@dataclass
class _Server:
    options: PikeRunCommand
    run: Run
    rate: Fraction
    deadline: Deadline
    service: Service = field(init=False)
    plan: TeamPlan = field(init=False)
    journal: Journal | None = field(init=False, default=None)
    closed: bool = field(init=False, default=False)
    """Whether no more requests will come, in real time."""
    failure: OSError | None = field(init=False, default=None)
    """Why the input could not be read, in real time."""

    def prepare(self) -> None:
        """Read the plan and the journal, and make what decides."""
        check_backend(self.options.backend)
        from robust.pike_bridge.online.executive import PlanExecutive
        from robust.pike_bridge.online.journal import Journal
        from robust.pike_bridge.online.reasoners import make_reasoner
        from robust.pike_bridge.online.service import Service

        if sys.stdin is None:  # closed by the caller, as in `robust ... <&-`
            raise InputError("found no standard input, expected lines of JSON", Location("--stdio"))
        self.reader = LineReader(sys.stdin.fileno())
        sys.stdout.flush()
        self.writer = LineWriter(sys.stdout.fileno(), lambda: self.run.guard.cause is not None, self.deadline)
        self.plan = self.options.load()
        if self.options.journal is not None:
            self.journal = Journal(self.options.journal, self.plan)
        reasoner = make_reasoner(self.options.backend, solver=self.options.solver, deadline=self.deadline)
        self.service = Service(
            PlanExecutive(self.plan, reasoner, deadline=self.deadline),
            self.journal,
            solver=self.options.solver,
            deadline=self.deadline,
            thinking=self.thinking,
            tolerance=_TOLERANCE / self.rate if self.options.clock == REAL else Fraction(0),
        )

    def close(self) -> None:
        """Let others have the journal."""
        if self.journal is not None:
            self.journal.close()

    def thinking(self) -> AbstractContextManager[None]:
        """Where signals and the time limit interrupt; everywhere else they wait until what is written is written."""
        return self.run.working(self._on_stuck)

    def serve(self) -> int:
        """Until the input ends, or something else ends it; returns the exit code."""
        try:
            self.announce(self.service.greet())
            if self.options.clock == REAL:
                asyncio.run(self._serve_real_time())
            else:
                self._serve_given_time()
        except BrokenPipeError:
            drop_output()
        except InputError as error:
            self.writer.write_last({"kind": "error", "line": None, "message": str(error)})
            raise
        except OutOfTimeError:
            self._end("timeout")
        except KeyboardInterrupt:
            self._end("timeout" if self.run.guard.cause is Cause.TIMEOUT else "interrupted")
        else:
            self._end("waiting")
        return self._code()

    def announce(self, answers: Iterable[dict[str, Any]]) -> None:
        """Write an answer, object by object as it becomes known."""
        for answer in answers:
            self.writer.write(answer)

    def read(self, *, timed: bool) -> Request | None:
        """The next request that is not an empty line; None at the end of the input."""
        from robust.pike_bridge.online.service import INPUT, Wrong, read_request

        while True:
            try:
                text = self.reader.read(self.deadline if timed else NEVER)
            except InputError as error:
                number = self.reader.number
                return Wrong(number, f"{Location(INPUT, number)}: {error}")
            if text is None:
                return None
            if text.strip():
                return read_request(text, self.reader.number, self.plan, timed=timed)

    def _serve_given_time(self) -> None:
        while True:
            with self.run.working():
                request = self.read(timed=True)
            if request is None:
                return
            self.announce(self.service.answer(request))

    async def _serve_real_time(self) -> None:
        from robust.execute.drive import WallClock, drive

        clock = WallClock(self.rate, self.service.time)
        inbox: asyncio.Queue[_Arrived | None] = asyncio.Queue()
        loop = asyncio.get_running_loop()
        threading.Thread(target=self._listen, args=(loop, inbox, clock), daemon=True).start()
        watching = asyncio.create_task(self._watch(inbox))
        try:
            await drive(_RealTime(self), inbox, lambda _now, _decisions: None, clock)
            while self.service.ended and not (self.closed and inbox.empty()):
                arrived = await inbox.get()
                if arrived is not None:  # a question about how it ended
                    self.announce(self.service.answer(arrived.request))
        finally:
            watching.cancel()
        self._raise_if_stopped()

    def _listen(self, loop: asyncio.AbstractEventLoop, inbox: asyncio.Queue[_Arrived | None], clock: WallClock) -> None:
        """Note when each request arrives, in a thread: not every input can be waited for otherwise."""
        with suppress(RuntimeError):  # the loop is closed: all is over
            try:
                while (request := self.read(timed=False)) is not None:
                    loop.call_soon_threadsafe(inbox.put_nowait, _Arrived(clock.now(), request))
            except OSError as error:
                self.failure = error
            loop.call_soon_threadsafe(self._close, inbox)

    def _close(self, inbox: asyncio.Queue[_Arrived | None]) -> None:
        self.closed = True
        inbox.put_nowait(None)

    async def _watch(self, inbox: asyncio.Queue[_Arrived | None]) -> None:
        """Close the inbox when a signal or the deadline comes."""
        while self.run.guard.cause is None and not self.deadline.passed:
            await asyncio.sleep(_LOOK)
        self._close(inbox)

    def _raise_if_stopped(self) -> None:
        if self.failure is not None:
            raise self.failure
        if self.run.guard.cause is not None:
            raise KeyboardInterrupt
        if self.deadline.passed:
            raise OutOfTimeError

    def _end(self, outcome: str) -> None:
        """The last line; where the execution has ended it has been written before."""
        if not self.service.ended:
            self.writer.write_last(self.service.end(outcome))

    def _code(self) -> int:
        from robust.pike_bridge.online.progress import Failed, Succeeded

        match self.service.executive.outcome:
            case Succeeded():
                return 0
            case Failed():
                return 1
            case None:
                return UNDECIDED

    def _on_stuck(self) -> bool:
        """A solver does not heed the signal: the answer comes from another thread, and the process ends."""
        self._end((self.run.guard.cause or Cause.INTERRUPTED).value)
        return True


@dataclass(frozen=True, slots=True)
class _Arrived:
    """A request, and when it arrived."""

    time: Fraction
    request: Request


class _RealTime:
    """A service for :func:`robust.execute.drive.drive`; it announces by itself. Times are on the grid of the plan."""

    def __init__(self, server: _Server) -> None:
        self._server = server
        self._service = server.service
        self._grid = server.service.executive.progress.grid

    def step(self, now: Fraction, messages: Sequence[_Arrived]) -> Sequence[None]:
        for arrived in messages:
            moment = self._on_grid(arrived.time)
            self._server.announce(self._service.due(moment))
            self._server.announce(self._service.answer(arrived.request, moment))
        self._server.announce(self._service.due(self._on_grid(now)))
        return ()

    @property
    def wake(self) -> Fraction | None:
        return self._service.wake

    @property
    def ended(self) -> bool:
        return self._service.ended

    def _on_grid(self, time: Fraction) -> Fraction:
        """Rounded down: what is due at a time on the grid is late by less than a step then, not early."""
        return floor(time / self._grid) * self._grid


# -- lines -------------------------------------------------------------------------------------------------------------

LONGEST = 1 << 20
"""Bytes of a line; what is longer is no message."""
_CHUNK = 1 << 16
_ATOMIC = 512
"""Bytes that a pipe takes at once, if it takes any (PIPE_BUF is at least that)."""


class LineReader:
    """Reads lines from a file descriptor, and counts them from 1."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._pending = bytearray()
        self._ended = False
        self._skipping = False
        self.number = 0

    def read(self, deadline: Deadline) -> bytes | None:
        """The next line without its end; None at the end of the input.

        Raises:
            InputError: if the line is too long; the next call reads the line after it.
            OutOfTimeError: if the deadline passes.
        """
        while True:
            line, end, rest = self._pending.partition(b"\n")
            if end or (self._ended and line):
                self._pending = rest
                self.number += 1
                if self._skipping or len(line) > LONGEST:
                    self._skipping = False
                    raise InputError(f"found a line of more than {LONGEST} bytes, expected a shorter one")
                return bytes(line).removesuffix(b"\r")
            if self._ended:
                return None
            if len(line) > LONGEST:
                self._skipping = True
                self._pending.clear()
                self._pending += b"."  # so that it counts as a line, whatever comes
            if not has_input(self._descriptor, deadline):
                raise OutOfTimeError
            chunk = os.read(self._descriptor, _CHUNK)
            self._ended = not chunk
            self._pending += chunk


class LineWriter:
    """Writes JSON objects to a file descriptor, a line for each.

    What a signal cuts off is completed before anything else is written.
    """

    def __init__(self, descriptor: int, stopped: Callable[[], bool], deadline: Deadline) -> None:
        self._descriptor = descriptor
        self._stopped = stopped
        self._deadline = deadline
        self._pending = memoryview(b"")

    def write(self, value: Mapping[str, Any]) -> None:
        """Write an object, and wait for whoever reads.

        Raises:
            BrokenPipeError: if nobody reads any more.
            KeyboardInterrupt, OutOfTimeError: if nobody has read until it was stopped, or until the deadline.
        """
        self._pending = memoryview(bytes(self._pending) + json.dumps(value).encode() + b"\n")
        while self._pending:
            if self._is_writable(GLANCE):
                self._advance()
            elif self._stopped():
                raise KeyboardInterrupt
            elif self._deadline.passed:
                raise OutOfTimeError

    def write_last(self, value: Mapping[str, Any]) -> None:
        """Write an object if somebody reads it now; for those who are leaving."""
        self._pending = memoryview(bytes(self._pending) + json.dumps(value).encode() + b"\n")
        try:
            while self._pending and self._is_writable(0.0):
                self._advance()
        except BrokenPipeError:
            self._pending = memoryview(b"")

    def _is_writable(self, seconds: float) -> bool:
        return bool(select.select([], [self._descriptor], [], seconds)[1])

    def _advance(self) -> None:
        self._pending = self._pending[os.write(self._descriptor, self._pending[:_ATOMIC]) :]
