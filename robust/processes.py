"""Commands that end when they have to.

A command runs below a watcher (:mod:`robust.watcher`), which kills everything that the command has started once it
ends, at the deadline, on Ctrl-C, and when this process dies, however that happens.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import BinaryIO

from robust.smt.limits import NEVER, Deadline, has_input

_WATCHER = Path(__file__).with_name("watcher.py")


@dataclass(frozen=True, slots=True)
class Ended:
    """How a command ended, what it printed and what it cost.

    `exit_code` is negative where a signal ended it, as at the deadline, and 127 where it could not be started, which
    `last_line` explains. `seconds` is wall time, `cpu_s` what all its threads computed, and `memory_mb` the most that
    one of its processes had in memory.
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
    ) -> Ended:
        """Run a command until it ends or the deadline passes; none of its descendants is left.

        Args:
            command: the program, and its arguments.
            deadline: when it is killed.
            folder: where it runs.
            memory_mb: the address space that each of its processes may have; without limit if zero.
            variables: what is added to the environment.

        Raises:
            KeyboardInterrupt: on Ctrl-C, once everything has been killed.
            StoppedError: if stopped meanwhile or before.
        """
        with (
            tempfile.TemporaryFile() as out,
            tempfile.TemporaryFile() as err,
            _pipe() as (report, report_out),
            _pipe() as (lifeline_in, lifeline),
            self._registered(lifeline),
        ):
            numbers = (str(report_out.fileno()), str(lifeline_in.fileno()), str(memory_mb * 2**20))
            process = subprocess.Popen(  # noqa: S603 - our own commands, and the planner that the user names
                (sys.executable, "-I", "-S", str(_WATCHER), *numbers, *command),
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                cwd=folder,
                env={**os.environ, **(variables or {})},
                pass_fds=(report_out.fileno(), lifeline_in.fileno()),
                start_new_session=True,
            )
            try:
                report_out.close()
                timed_out = not has_input(report.fileno(), deadline)
            finally:
                lifeline.close()
                process.wait()
            if self._stopped:
                raise StoppedError
            facts = report.read().split() or (-signal.SIGKILL, 0, 0, 0)  # if somebody has killed the watcher
            return Ended(
                exit_code=int(facts[0]),
                timed_out=timed_out,
                stdout=_text(out),
                stderr=_text(err),
                seconds=float(facts[1]),
                cpu_s=float(facts[2]),
                memory_mb=int(facts[3]) / 2**20,
            )

    def stop(self) -> None:
        """End all running commands and start no more."""
        with self._lock:
            self._stopped = True
            for lifeline in self._lifelines:
                lifeline.close()

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


def _text(file: BinaryIO) -> str:
    file.seek(0)
    return file.read().decode("utf-8", "replace")
