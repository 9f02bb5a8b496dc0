"""One planner process with everything it starts: output, exit code, a deadline, and an end to all of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from robust.smt.limits import Deadline, has_input

_WATCHER = Path(__file__).with_name("watcher.py")

MEMORY_MB = 8192
"""The address space that each process of a planner may have; more than any needs here, and less than a machine has."""


@dataclass(frozen=True, slots=True)
class Ended:
    """How a process ended: `exit_code` is None at the deadline, and negative where another signal ended it."""

    exit_code: int | None
    stdout: str
    stderr: str

    @property
    def timed_out(self) -> bool:
        return self.exit_code is None

    @property
    def last_line(self) -> str:
        """The last line on stderr, else on stdout; programs in Rust add a note, which says nothing."""
        for text in (self.stderr, self.stdout):
            lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("note: ")]
            if lines:
                return lines[-1]
        return "no message"


def run(
    command: Sequence[str],
    folder: Path,
    deadline: Deadline,
    *,
    memory_mb: int = MEMORY_MB,
    variables: Mapping[str, str] | None = None,
) -> Ended:
    """Run a command in a folder until it ends or the deadline passes; nothing of its process group is left.

    `variables` are added to the environment.

    Output goes to files in `folder`, so that a child that keeps its standard output open is not waited for.

    Raises:
        KeyboardInterrupt: on Ctrl-C, once the group has been killed.
    """
    out, err = folder / "stdout", folder / "stderr"
    with (
        _pipe() as (report, report_out),
        _pipe() as (lifeline_in, _),
        out.open("wb") as stdout,
        err.open("wb") as stderr,
    ):
        numbers = (str(report_out.fileno()), str(lifeline_in.fileno()), str(memory_mb * 2**20))
        process = subprocess.Popen(  # noqa: S603 - the planner that the user names
            (sys.executable, "-I", "-S", str(_WATCHER), *numbers, *command),
            stdin=subprocess.DEVNULL,
            stdout=stdout,
            stderr=stderr,
            cwd=folder,
            env={**os.environ, **(variables or {})},
            pass_fds=(report_out.fileno(), lifeline_in.fileno()),
            start_new_session=True,
        )
        try:
            report_out.close()
            code = report.read() if has_input(report.fileno(), deadline) else b""
            timed_out = not code and deadline.passed
        finally:
            _kill(process)
    return Ended(None if timed_out else int(code or -signal.SIGKILL), _text(out), _text(err))


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End the whole group. Its leader has not been waited for yet, so its number cannot be another's by now."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass  # the group has ended by itself
    finally:
        process.wait()


@contextmanager
def _pipe() -> Iterator[tuple[BinaryIO, BinaryIO]]:
    reader, writer = os.pipe()
    with open(reader, "rb") as source, open(writer, "wb") as sink:
        yield source, sink


def _text(path: Path) -> str:
    return path.read_bytes().decode("utf-8", "replace")
