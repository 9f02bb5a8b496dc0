"""Any planner that reads PDDL files and prints a time-triggered plan, by the command that starts it."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import string
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import BinaryIO

from robust.encode.interface import EPSILON
from robust.errors import InputError, did_you_mean
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus, last_valid_plan, says_no_plan
from robust.execute.planners.pddl_text import domain_text, problem_text
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.timed import TimedPlan
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


_FIELDS = ("domain", "problem", "output", "timeout")
_FOREVER = 10**6
"""Seconds, for planners that want a number where there is no deadline."""

Verdict = Callable[[Ended], PlannerStatus | None]
"""What a planner's exit code and text say about a run without valid plan; None if they say nothing special."""


def no_verdict(_: Ended) -> PlannerStatus | None:
    return None


@dataclass(frozen=True, slots=True)
class CommandPlanner:
    """Starts a program anew for each question.

    `arguments` is its command line with `{domain}`, `{problem}` and `{output}` for files, and `{timeout}` for the
    seconds that are left. The plan is read from `{output}` if the planner wrote it, or a file that begins with this
    name, and else from its standard output. A planner that has printed several plans is taken at its last valid one,
    whatever its exit code: the plan is checked, and an anytime planner is usually ended by the deadline.
    """

    name: str
    arguments: tuple[str, ...]
    epsilon: Fraction = EPSILON
    verdict: Verdict = no_verdict
    memory_mb: int = MEMORY_MB

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`."""
        start = time.monotonic()
        texts = {"domain": domain_text(domain), "problem": problem_text(problem, domain)}
        with tempfile.TemporaryDirectory(prefix="robust-planner-") as name:
            folder = Path(name)
            files = {"output": str(folder / "plan")}
            for what, text in texts.items():
                path = folder / f"{what}.pddl"
                path.write_text(text, encoding="utf-8")
                files[what] = str(path)
            ended = run(self._command(files, deadline), folder, deadline, memory_mb=self.memory_mb)
            printed = _plan_text(folder, ended)
        answer = judged(
            self.name, ended, last_valid_plan(printed, domain, problem, self.epsilon, self.name), self.verdict
        )
        return replace(answer, seconds=time.monotonic() - start)

    def _command(self, files: Mapping[str, str], deadline: Deadline) -> tuple[str, ...]:
        remaining = _FOREVER if deadline.remaining is None else deadline.remaining
        values = {**files, "timeout": f"{remaining:.3f}"}
        return tuple(argument.format_map(values) for argument in self.arguments)


def command_planner(template: str, *, epsilon: Fraction = EPSILON, name: str | None = None) -> CommandPlanner:
    """The planner that a command line starts; words are split as a shell does, but no shell runs.

    Raises:
        InputError: for an empty template, unbalanced quotes, a field that does not exist or none for the problem.
    """
    place = f"planner template {template!r}"
    try:
        arguments = tuple(shlex.split(template))
        fields = [
            field
            for argument in arguments
            for _, field, _, _ in string.Formatter().parse(argument)
            if field is not None
        ]
    except ValueError as error:
        raise InputError(f"{place}: found {error}, expected words and fields such as {{domain}}") from None
    if not arguments:
        raise InputError(f"{place}: found no command, expected one such as 'planner {{domain}} {{problem}}'")
    for field in fields:
        if field not in _FIELDS:
            known = ", ".join(f"{{{one}}}" for one in _FIELDS)
            raise InputError(f"{place}: found field {{{field}}}, expected one of {known}{did_you_mean(field, _FIELDS)}")
    missing = next((one for one in ("domain", "problem") if one not in fields), None)
    if missing:
        raise InputError(f"{place}: found no {{{missing}}}, expected it where the planner takes that file")
    return CommandPlanner(name or Path(arguments[0]).name, arguments, epsilon)


def judged(name: str, ended: Ended, found: tuple[TimedPlan | None, str], verdict: Verdict) -> PlannerAnswer:
    """The answer that a run of a process amounts to; `found` is a valid plan, or what is wrong with the last one."""
    plan, wrong = found
    if plan is not None:
        return PlannerAnswer(name, PlannerStatus.SOLVED, plan, 0.0)
    status = PlannerStatus.TIMEOUT if ended.timed_out else verdict(ended)
    if status is None:
        status = _usual(ended, wrong)
    return PlannerAnswer(name, status, None, 0.0, _message(status, ended, wrong))


def _usual(ended: Ended, wrong: str) -> PlannerStatus:
    if wrong:
        return PlannerStatus.NONSENSE
    if ended.exit_code:
        return PlannerStatus.CRASHED
    return PlannerStatus.NO_PLAN if says_no_plan(ended.stdout + ended.stderr) else PlannerStatus.NONSENSE


def _message(status: PlannerStatus, ended: Ended, wrong: str) -> str:
    match status:
        case PlannerStatus.TIMEOUT:
            return "no valid plan before the deadline"
        case PlannerStatus.CRASHED:
            code = ended.exit_code or 0
            how = f"killed by signal {-code}" if code < 0 else f"exit code {code}"
            return f"{how}: {ended.last_line}"
        case PlannerStatus.NONSENSE:
            return wrong or f"found no plan in what it printed, ending with {ended.last_line!r}"
        case _:
            return ended.last_line


def _plan_text(folder: Path, ended: Ended) -> str:
    """What the planner wrote into `{output}`, else what it printed; the last of several numbered files."""
    written = sorted(
        (path for path in folder.glob("plan*") if path.is_file()), key=lambda path: path.stat().st_mtime_ns
    )
    texts = [path.read_bytes().decode("utf-8", "replace") for path in written]
    return "\n.\n".join(texts) if any(text.strip() for text in texts) else ended.stdout


def program(name: str) -> str | None:
    """A program beside this interpreter, where packages put theirs, or on the path; None if there is none."""
    path = Path(sys.executable).parent / name
    return str(path) if path.is_file() else shutil.which(name)
