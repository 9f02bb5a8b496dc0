"""Commands with deadlines, and without survivors.

A command runs below a watcher (:mod:`robust.watcher`), which kills everything that the command has started once it
ends, at the deadline, on Ctrl-C, and when this process dies, however that happens. What the command prints is read
while it runs; only the end of it is kept.
"""

import os
import select
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import BinaryIO

from robust.smt.limits import GLANCE, NEVER, Deadline, raise_if_interrupted, uninterrupted

_WATCHER = Path(__file__).with_name("watcher.py")
KEPT = 2**24
"""Bytes of each stream that are kept, of what a command prints: the last ones."""
_CHUNK = 2**16


@dataclass(frozen=True, slots=True)
class ProcessEnd:
    """The end of a command: exit code, output and cost.

    `exit_code` is negative where a signal ended it, as at the deadline, and 127 where it could not be started, which
    `last_line` explains. Of texts longer than `KEPT`, only the last lines are here. `seconds` is wall time, `cpu_s`
    what all its threads computed, and `memory_mb` the most that one of its processes had in memory.
    """

    exit_code: int
    timed_out: bool
    stdout: str
    stderr: str
    seconds: float = 0.0
    cpu_s: float = 0.0
    memory_mb: float = 0.0

    @property
    def last_line(self) -> str:
        """The last line on stderr, else on stdout; programs in Rust add a note, which says nothing."""
        for text in (self.stderr, self.stdout):
            lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("note: ")]
            if lines:
                return lines[-1]
        return "no message"


class StoppedError(Exception):
    """The command was ended, or not started, because :meth:`Processes.stop` was called."""


class Processes:
    """Runs commands from any number of threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._lifelines: set[BinaryIO] = set()
        self._stopped = False

    def run(
        self,
        command: Sequence[str],
        deadline: Deadline = NEVER,
        *,
        folder: Path | None = None,
        memory_mb: int = 0,
        variables: Mapping[str, str] | None = None,
        scratch: Path | None = None,
    ) -> ProcessEnd:
        """Run a command until it ends or the deadline passes; none of its descendants is left.

        Args:
            command: the program, and its arguments.
            deadline: when it is killed.
            folder: where it runs.
            memory_mb: the address space that each of its processes may have; without limit if zero.
            variables: what is added to the environment.
            scratch: a folder that is removed if this process dies before the command has ended.

        Raises:
            KeyboardInterrupt: on Ctrl-C, once everything has been killed.
            StoppedError: if stopped meanwhile or before.
        """
        with (
            _pipe() as (out, out_end),
            _pipe() as (err, err_end),
            _pipe() as (report, report_out),
            _pipe() as (lifeline_in, lifeline),
            self._registered(lifeline),
        ):
            numbers = (str(report_out.fileno()), str(lifeline_in.fileno()), str(memory_mb * 2**20))
            texts = {out.fileno(): _End(), err.fileno(): _End()}
            process = None
            try:
                with uninterrupted():
                    process = subprocess.Popen(  # noqa: S603 - our own commands, and the planner that the user names
                        (sys.executable, "-I", "-S", str(_WATCHER), *numbers, str(scratch or ""), *command),
                        stdin=subprocess.DEVNULL,
                        stdout=out_end,
                        stderr=err_end,
                        cwd=folder,
                        env={**os.environ, **(variables or {})},
                        pass_fds=(report_out.fileno(), lifeline_in.fileno()),
                        start_new_session=True,
                    )
                for end in (out_end, err_end, report_out):
                    end.close()
                timed_out = not _read_until_input(report.fileno(), texts, deadline)
            finally:
                with uninterrupted():
                    _let_go(lifeline)
                    if process is not None:
                        process.wait()
            if self._stopped:
                raise StoppedError
            _read_the_rest(texts)
            facts = report.read().split() or (-signal.SIGKILL, 0, 0, 0)  # if the watcher was killed
            return ProcessEnd(
                exit_code=int(facts[0]),
                timed_out=timed_out,
                stdout=texts[out.fileno()].text,
                stderr=texts[err.fileno()].text,
                seconds=float(facts[1]),
                cpu_s=float(facts[2]),
                memory_mb=int(facts[3]) / 2**20,
            )

    def stop(self) -> None:
        """End all running commands and start no more."""
        with self._lock:
            self._stopped = True
            for lifeline in self._lifelines:
                _let_go(lifeline)

    @contextmanager
    def _registered(self, lifeline: BinaryIO) -> Iterator[None]:
        with self._lock:
            if self._stopped:
                raise StoppedError
            self._lifelines.add(lifeline)
        try:
            yield
        finally:
            with self._lock:
                self._lifelines.discard(lifeline)


@contextmanager
def _pipe() -> Iterator[tuple[BinaryIO, BinaryIO]]:
    reader, writer = os.pipe()
    with open(reader, "rb") as source, open(writer, "wb") as sink:
        yield source, sink


class _End:
    """The end of a stream."""

    def __init__(self) -> None:
        self._chunks: deque[bytes] = deque()
        self._size = 0
        self._cut = False

    def add(self, chunk: bytes) -> None:
        """Append, and forget what is too far back."""
        self._chunks.append(chunk)
        self._size += len(chunk)
        while self._size - len(self._chunks[0]) >= KEPT:
            self._size -= len(self._chunks.popleft())
            self._cut = True

    @property
    def text(self) -> str:
        """The end of the stream, from the beginning of a line."""
        data = b"".join(self._chunks)
        if self._cut:
            data = data[data.find(b"\n", len(data) - KEPT) + 1 :]
        return data.decode("utf-8", "replace")


def _read_until_input(report: int, texts: Mapping[int, _End], deadline: Deadline) -> bool:
    """Read texts until the report can be read; False if the deadline passes first.

    Looks up now and then, so that a Ctrl-C that Python lost in a finaliser is not waited out.
    """
    open_ones = set(texts)
    while True:
        raise_if_interrupted()
        remaining = deadline.remaining
        wait = GLANCE if remaining is None else min(GLANCE, remaining)
        ready, _, _ = select.select([report, *open_ones], [], [], wait)
        for reader in open_ones & set(ready):
            if chunk := os.read(reader, _CHUNK):
                texts[reader].add(chunk)
            else:
                open_ones.remove(reader)
        if report in ready:
            return True
        if deadline.passed:
            return False


def _read_the_rest(texts: Mapping[int, _End]) -> None:
    """Read the rest of the pipes, without waiting for a process that has escaped with an end of one."""
    for reader, text in texts.items():
        for _ in range(KEPT // _CHUNK):
            if not select.select([reader], [], [], 0)[0] or not (chunk := os.read(reader, _CHUNK)):
                break
            text.add(chunk)


def _let_go(lifeline: BinaryIO) -> None:
    """Have the watcher end the command; the byte says that this process lives."""
    if not lifeline.closed:
        with suppress(BrokenPipeError):  # the watcher has ended
            os.write(lifeline.fileno(), b".")
        lifeline.close()
