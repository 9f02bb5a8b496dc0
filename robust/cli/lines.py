"""Lines of JSON between processes: read one by one, and written whole, whatever interrupts."""

from __future__ import annotations

import errno
import json
import os
import queue
import select
import threading
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from robust.errors import InputError
from robust.smt.limits import GLANCE, Deadline, OutOfTimeError, has_input

LONGEST = 1 << 20
"""Bytes of a line; what is longer is no message."""
_CHUNK = 1 << 16
_ATOMIC = 512
"""Bytes that a pipe takes at once, if it takes any (PIPE_BUF is at least that)."""


Heard = TypeVar("Heard")


def listening(read: Callable[[], Heard]) -> queue.SimpleQueue[Heard | OSError]:
    """What is read, one after the other, in a thread: not every input can be waited for otherwise; None is its end."""
    inbox: queue.SimpleQueue[Heard | OSError] = queue.SimpleQueue()

    def listen() -> None:
        try:
            while True:
                inbox.put(heard := read())
                if heard is None:
                    return
        except OSError as error:
            inbox.put(error)

    threading.Thread(target=listen, daemon=True).start()
    return inbox


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

    def wait(self, seconds: float) -> bool:
        """Whether something has come by then that was not read, or the input has ended."""
        ready = b"\n" in self._pending or self._ended
        return ready or bool(select.select([self._descriptor], [], [], seconds)[0])


class LineWriter:
    """Writes JSON objects to a file descriptor, a line for each.

    What a signal cuts off is completed before anything else is written. What was offered, and nobody has read, waits:
    objects that need not stay in `room` bytes; if these do not suffice, the oldest are left out, never the last.
    """

    def __init__(self, descriptor: int, stopped: Callable[[], bool], deadline: Deadline, room: int = 0) -> None:
        self._descriptor = descriptor
        self._stopped = stopped
        self._deadline = deadline
        self._room = room
        self._pending = memoryview(b"")
        self._waiting = deque[list[bytes]]()
        """Lines that have not been begun, each alone in a list; one that was left out is empty."""
        self._passing = deque[list[bytes]]()
        """Those of them that may be left out."""
        self._size = 0

    @property
    def is_behind(self) -> bool:
        """Whether something that was offered has not been read."""
        return bool(self._pending or self._waiting)

    def offer(self, value: Mapping[str, Any], *, stays: bool = False) -> None:
        """Write an object as far as it is read at once; later ones may replace it unless it `stays`.

        Raises:
            BrokenPipeError: if nobody reads any more.
        """
        line = [json.dumps(value).encode() + b"\n"]
        self._waiting.append(line)
        if not stays:
            self._passing.append(line)
            self._size += len(line[0])
            while self._size > self._room and len(self._passing) > 1:
                oldest = self._passing.popleft()
                self._size -= len(oldest[0])
                oldest[0] = b""
        self.go_on()

    def go_on(self) -> None:
        """Write what was offered as far as it is read at once; BrokenPipeError if nobody reads any more."""
        while self.is_behind and self._is_writable(0.0):
            self._advance()

    def write(self, value: Mapping[str, Any]) -> None:
        """Write an object, and wait until it is read.

        Raises:
            BrokenPipeError: if nobody reads any more.
            KeyboardInterrupt, OutOfTimeError: if nobody has read until it was stopped, or until the deadline.
        """
        self.offer(value, stays=True)
        self.finish()

    def finish(self) -> None:
        """Wait until all that was offered is read; errors as for :meth:`write`."""
        while self.is_behind:
            if self._is_writable(GLANCE):
                self._advance()
            elif self._stopped():
                raise KeyboardInterrupt
            elif self._deadline.passed:
                raise OutOfTimeError

    def write_last(self, value: Mapping[str, Any]) -> None:
        """Write an object if somebody reads it now, before the process ends."""
        try:
            self.offer(value, stays=True)
        except BrokenPipeError:
            self._pending = memoryview(b"")
            self._waiting.clear()

    def _is_writable(self, seconds: float) -> bool:
        return bool(select.select([], [self._descriptor], [], seconds)[1])

    def _advance(self) -> None:
        if not self._pending:
            line = self._waiting.popleft()
            self._pending = memoryview(line[0])
            if self._passing and self._passing[0] is line:
                self._size -= len(self._passing.popleft()[0])
        try:
            written = os.write(self._descriptor, self._pending[:_ATOMIC])
        except OSError as error:
            if error.errno in {errno.EPIPE, errno.EIO}:  # nobody reads any more, or the terminal is gone
                raise
            raise InputError(f"cannot write to standard output: {(error.strerror or str(error)).lower()}") from None
        self._pending = self._pending[written:]
