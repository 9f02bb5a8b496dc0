"""Work that cannot be interrupted, in a forked copy of the process that can be ended at any moment."""

from __future__ import annotations

import os
import pickle
import signal
import struct
import traceback
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from robust.errors import SolverError
from robust.smt.limits import Deadline, OutOfTimeError, has_input

HEADER = struct.Struct("!?Q")


def stream_from_copy(work: Callable[[], Iterable[Any]], deadline: Deadline) -> Iterator[Any]:
    """What `work` yields, computed in a copy of this process; leaving the iteration early ends the copy.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the work failed or the copy died.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _run(work, writer)
    os.close(writer)
    try:
        while True:
            failed, size = HEADER.unpack(_read(reader, HEADER.size, deadline))
            item = pickle.loads(_read(reader, size, deadline))  # noqa: S301 - written by our own copy
            if failed:
                raise SolverError(f"quantifier elimination failed: {item}")
            if item is None:
                return
            yield item
    finally:
        os.close(reader)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def _run(work: Callable[[], Iterable[Any]], writer: int) -> None:
    """Runs in the copy, which must never return into the caller's stack; None marks the end."""
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            for item in work():
                _write(writer, False, item)
            _write(writer, False, None)
        except Exception:  # whatever it is, the caller must hear of it
            _write(writer, True, traceback.format_exc(limit=-1).strip().splitlines()[-1])
    finally:
        os._exit(0)


def _write(writer: int, failed: bool, item: Any) -> None:
    content = pickle.dumps(item)
    pending = memoryview(HEADER.pack(failed, len(content)) + content)
    while pending:
        pending = pending[os.write(writer, pending) :]


def _read(reader: int, size: int, deadline: Deadline) -> bytes:
    content = bytearray()
    while len(content) < size:
        if not has_input(reader, deadline):
            raise OutOfTimeError
        chunk = os.read(reader, min(1 << 20, size - len(content)))
        if not chunk:
            raise SolverError("the process that eliminates quantifiers died; it may have run out of memory")
        content += chunk
    return bytes(content)
