"""Whole processes, as a user runs them: wall time, peak memory, a time limit, and an end to all of them at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import BinaryIO

from robust.errors import RobustError

COMMAND = (sys.executable, "-m", "robust")
"""The command line of this package, as found by this interpreter."""

_LAUNCHER = Path(__file__).with_name("launch.py")


@dataclass(frozen=True, slots=True)
class Measured:
    """One process: what it printed, and what it cost.

    `seconds` is wall time, `cpu_s` what all its threads computed; `exit_code` is negative where a signal ended it."""

    exit_code: int
    timed_out: bool
    seconds: float
    cpu_s: float
    memory_mb: float
    stdout: str
    stderr: str

    @property
    def last_error(self) -> str:
        """The last line on stderr, or what is known without one."""
        lines = [line.strip() for line in self.stderr.splitlines() if line.strip()]
        return lines[-1] if lines else f"exit code {self.exit_code} without a message"


class StoppedError(Exception):
    """The process was ended, or not started, because :meth:`Processes.stop` was called."""


class Processes:
    """Runs processes from any number of threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._lifelines: set[BinaryIO] = set()
        self._stopped = False

    def run(self, command: Sequence[str], *, limit: float | None = None) -> Measured:
        """Run to the end, or to the limit in seconds.

        Raises:
            StoppedError: if stopped meanwhile or before.
        """
        report_in, report_out = os.pipe()
        lifeline_in, lifeline_out = os.pipe()
        with open(report_in, "rb") as report, open(lifeline_out, "wb") as lifeline:
            try:
                self._register(lifeline)
                output, errors = self._communicate(command, limit, report_out, lifeline_in, lifeline)
            finally:
                os.close(report_out)
                os.close(lifeline_in)
                with self._lock:
                    self._lifelines.discard(lifeline)
            measured = report.read()
        return self._measured(measured, output, errors, command)

    def stop(self) -> None:
        """End all running processes and start no more."""
        with self._lock:
            self._stopped = True
            for lifeline in self._lifelines:
                lifeline.close()

    def _register(self, lifeline: BinaryIO) -> None:
        with self._lock:
            if self._stopped:
                raise StoppedError
            self._lifelines.add(lifeline)

    @staticmethod
    def _communicate(
        command: Sequence[str], limit: float | None, report: int, lifeline_in: int, lifeline: BinaryIO
    ) -> tuple[bytes, bytes]:
        launcher = (sys.executable, "-I", "-S", str(_LAUNCHER), str(report), str(lifeline_in), str(limit or 0))
        with subprocess.Popen(  # noqa: S603 - our own command
            [*launcher, *command],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=(report, lifeline_in),
            start_new_session=True,
        ) as process:
            try:
                return process.communicate()
            except BaseException:
                lifeline.close()
                process.wait()
                raise

    def _measured(self, report: bytes, output: bytes, errors: bytes, command: Sequence[str]) -> Measured:
        if not report:
            if self._stopped:
                raise StoppedError
            text = errors.decode("utf-8", "replace").strip().splitlines() or ["no message"]
            raise RobustError(f"cannot run {command[0]!r}: {text[-1]}")
        facts = json.loads(report)
        return Measured(
            exit_code=facts["exit_code"],
            timed_out=facts["timed_out"],
            seconds=facts["seconds"],
            cpu_s=facts["cpu_s"],
            memory_mb=facts["memory_bytes"] / 2**20,
            stdout=output.decode("utf-8", "replace"),
            stderr=errors.decode("utf-8", "replace"),
        )
