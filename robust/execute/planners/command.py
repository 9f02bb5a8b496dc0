"""Planners that are programs which read PDDL files and print a time-triggered plan: any, by its command, and Kairos.

Kairos is a temporal and numeric planner of the extra `planners`.
"""

from __future__ import annotations

import shlex
import shutil
import string
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from robust.encode.interface import EPSILON
from robust.errors import InputError, did_you_mean, missing
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus, last_valid_plan, says_no_plan
from robust.numbers import format_number
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.pddl.write import domain_text, problem_text
from robust.plan.timed import TimedPlan
from robust.processes import KEPT, Ended, Processes
from robust.smt.limits import Deadline

MEMORY_MB = 8192
"""The address space that each process of a planner may have; more than any needs here, and less than a machine has."""


_FIELDS = ("domain", "problem", "output", "timeout")
_FILES = 16
"""Plan files that are read, of those that an anytime planner numbers: the last ones."""
_FOREVER = 10**6
"""Seconds, for planners that want a number where there is no deadline."""

Judge = Callable[[Ended], PlannerStatus | None]
"""What a planner's exit code and text say about a run without valid plan; None if they say nothing special."""


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
    verdict: Judge = lambda _: None

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`."""
        remaining = _FOREVER if deadline.remaining is None else deadline.remaining
        with tempfile.TemporaryDirectory(prefix="robust-planner-") as name:
            folder = Path(name)
            files = {"domain": folder / "domain.pddl", "problem": folder / "problem.pddl", "output": folder / "plan"}
            files["domain"].write_text(domain_text(domain), encoding="utf-8")
            files["problem"].write_text(problem_text(problem, domain), encoding="utf-8")
            fields = {**files, "timeout": f"{remaining:.3f}"}
            command = tuple(argument.format_map(fields) for argument in self.arguments)
            ended = Processes().run(command, deadline, folder=folder, memory_mb=MEMORY_MB, scratch=folder)
            printed = _plan_text(folder, ended)
        found = last_valid_plan(printed, domain, problem, self.epsilon, self.name)
        return judged(self.name, ended, found, self.verdict)


def command_planner(template: str, *, epsilon: Fraction = EPSILON) -> CommandPlanner:
    """The planner that a command line starts; words are split as a shell does, but no shell runs.

    Raises:
        InputError: for an empty template, unbalanced quotes, a field that does not exist or none for the problem.
    """
    place = f"planner template {template!r}"
    try:
        arguments = tuple(shlex.split(template))
        parsed = (part for argument in arguments for part in string.Formatter().parse(argument))
        fields = [field for _, field, _, _ in parsed if field is not None]
    except ValueError as error:
        raise InputError(f"{place}: found {error}, expected words and fields such as {{domain}}") from None
    if not arguments:
        raise InputError(f"{place}: found no command, expected one such as 'planner {{domain}} {{problem}}'")
    for field in fields:
        if field not in _FIELDS:
            known = ", ".join(f"{{{one}}}" for one in _FIELDS)
            raise InputError(f"{place}: found field {{{field}}}, expected one of {known}{did_you_mean(field, _FIELDS)}")
    absent = next((one for one in ("domain", "problem") if one not in fields), None)
    if absent:
        raise InputError(f"{place}: found no {{{absent}}}, expected it where the planner takes that file")
    return CommandPlanner(Path(arguments[0]).name, arguments, epsilon)


def judged(name: str, ended: Ended, found: tuple[TimedPlan | None, str], verdict: Judge) -> PlannerAnswer:
    """The answer that a run of a process amounts to; `found` is a valid plan, or what is wrong with the last one."""
    plan, wrong = found
    if plan is not None:
        return PlannerAnswer(name, PlannerStatus.SOLVED, plan)
    status = PlannerStatus.TIMEOUT if ended.timed_out else verdict(ended)
    if status is None:
        nothing = not wrong and says_no_plan(ended.stdout + ended.stderr)
        told = PlannerStatus.NO_PLAN if nothing else PlannerStatus.NONSENSE
        status = told if wrong or not ended.exit_code else PlannerStatus.CRASHED
    return PlannerAnswer(name, status, None, message=_message(status, ended, wrong))


def _message(status: PlannerStatus, ended: Ended, wrong: str) -> str:
    code = ended.exit_code
    match status:
        case PlannerStatus.TIMEOUT:
            return "no valid plan before the deadline"
        case PlannerStatus.CRASHED:
            return f"{f'killed by signal {-code}' if code < 0 else f'exit code {code}'}: {ended.last_line}"
        case PlannerStatus.NONSENSE:
            return wrong or f"found no plan in what it printed, ending with {ended.last_line!r}"
        case _:
            return ended.last_line


def _plan_text(folder: Path, ended: Ended) -> str:
    """What the planner wrote into `{output}`, else what it printed; the last of several numbered files."""
    written = sorted(filter(Path.is_file, folder.glob("plan*")), key=lambda path: path.stat().st_mtime_ns)
    texts = [_end_of(path) for path in written[-_FILES:]]
    return "\n.\n".join(texts) if any(text.strip() for text in texts) else ended.stdout


def _end_of(path: Path) -> str:
    """The last of what a file holds, as much as is kept of what a command prints."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - KEPT))
        return file.read(KEPT).decode("utf-8", "replace")


def program(name: str) -> str | None:
    """A program beside this interpreter, where packages put theirs, or on the path; None if there is none."""
    path = Path(sys.executable).parent / name
    return str(path) if path.is_file() else shutil.which(name)


_MEMORY_MB = 2048
_LONGEST_FIRST = 30.0
"""Seconds for the first search at most."""


@dataclass(frozen=True, slots=True)
class KairosPlanner:
    """The first plan that Kairos finds; one thread, so that the same problem gives the same plan.

    Its own choice of searches can spend most of the time on one that leads nowhere where plans have deadlines and use
    resources. So the search that is best there is tried first, for half of the time, and then its own choice.
    """

    first: CommandPlanner
    second: CommandPlanner
    name: str = "kairos"

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`."""
        remaining = deadline.remaining
        share = _LONGEST_FIRST if remaining is None else min(_LONGEST_FIRST, remaining / 2)
        answer = self.first.solve(domain, problem, Deadline.after(share))
        if answer.status in (PlannerStatus.TIMEOUT, PlannerStatus.NO_PLAN):
            answer = self.second.solve(domain, problem, deadline)
        return answer


def kairos_planner(*, epsilon: Fraction = EPSILON) -> KairosPlanner:
    """Kairos, with plans whose mutex time points are `epsilon` apart.

    Raises:
        UnsupportedError: if the package is not installed.
    """
    command = program("kairos")
    if command is None:
        raise missing("planner kairos (package kairos-planner)", "planners")
    options = ("--no-anytime", "--threads", "1", "--memory", str(_MEMORY_MB), "--epsilon", format_number(epsilon))
    arguments = (command, "solve", "{domain}", "{problem}", "--timeout", "{timeout}", *options)
    first = CommandPlanner("kairos", (*arguments, "--search", "eager-lama"), epsilon, _verdict)
    return KairosPlanner(first, CommandPlanner("kairos", arguments, epsilon, _verdict))


def _verdict(ended: Ended) -> PlannerStatus | None:
    """What the documented exit codes say: unsolvable (proved), out of time, no plan found."""
    match ended.exit_code:
        case 10 | 14:
            return PlannerStatus.NO_PLAN
        case 11:
            return PlannerStatus.TIMEOUT
        case _:
            return None
