"""The interface of planners, and planners that are programs [IRR §3, Alg. 2].

A planner is given a domain, a problem and a deadline. It answers with a plan that the simulator has executed without a
violation, or with one line that says why there is none. A failure is an answer, not an exception, so that execution
with re-planning goes on, or ends as failed with a reason.

Programs read PDDL files and print a time-triggered plan: any program by its command line, and Kairos, a temporal and
numeric planner of the extra `planners`.
"""

import re
import shlex
import shutil
import string
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Protocol

from robust import numbers, presented
from robust.encode.interface import EPSILON
from robust.errors import InputError, RobustError, did_you_mean, missing
from robust.execute.distances import declarations, schedule_of, validated
from robust.plan import load, stn, timed
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.pddl.write import domain_text, problem_text
from robust.processes import KEPT, ProcessEnd, Processes
from robust.smt.limits import Deadline


class PlannerStatus(presented.VerdictEnum):
    """Status of a call of a planner."""

    SOLVED = "solved"
    """The plan is valid."""
    NO_PLAN = "no plan"
    """The planner proved that there is none, or gave up and said so."""
    TIMEOUT = "timeout"
    """The deadline passed; the planner and all its children were killed."""
    CRASHED = "crashed"
    """The planner ended with an error, was killed by someone else, or could not be started."""
    NONSENSE = "nonsense"
    """The output is no plan of this problem, or the plan is not valid."""


@dataclass(frozen=True, slots=True)
class PlannerAnswer(presented.NoTruthValue, ask="status"):
    """Answer of a planner; `plan` is given exactly when the status is `SOLVED`.

    `message` is one line: why there is no plan. `seconds` is wall time from the call to the answer, the check of the
    plan included; planners of :mod:`robust.execute.planners` know it. `others` are valid plans that the planner printed
    before, the last one first.
    """

    planner: str
    status: PlannerStatus
    plan: timed.TimedPlan | None
    seconds: float = 0.0
    message: str = ""
    others: tuple[timed.TimedPlan, ...] = ()

    def __post_init__(self) -> None:
        if (self.plan is not None) is not (self.status is PlannerStatus.SOLVED):
            raise ValueError(f"status {self.status.value!r} with plan {self.plan}: a plan goes with 'solved' only")


class Planner(Protocol):
    """Something that plans; an instance can be asked any number of times and keeps nothing between calls."""

    @property
    def name(self) -> str:
        """Name in reports."""
        ...

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """A checked plan, or why there is none; never later than shortly after the deadline.

        Raises:
            UnsupportedError: if it is known beforehand that the planner cannot read this domain or problem.
            KeyboardInterrupt: on Ctrl-C, once the planner and all its children have ended.
        """
        ...


_NO_PLAN = re.compile(
    r"no plan|no solution|unsolvable|unreachable|infeasible|cannot be solved|not solvable", re.IGNORECASE
)


Renaming = Callable[[timed.TimedPlan], timed.TimedPlan]
"""From the names and times of a planner to those of a problem."""


def check(plan: timed.TimedPlan, domain: Domain, problem: Problem, epsilon: Fraction) -> None:
    """Execute a plan in the simulator.

    Raises:
        InputError: if it is not a plan of this problem.
        InvalidPlanError: if it breaks an obligation.
        UnsupportedError: if the simulator cannot decide.
    """
    instances = declarations(plan, domain, epsilon)
    bare = load.assemble(domain, problem, stn.STNPlan((), instances, (), plan.file))
    validated(bare, schedule_of(plan, instances), epsilon, plan.file)


MOST = 8
"""Valid plans that are taken from what a planner printed: the last ones."""


def valid_plans(
    text: str, domain: Domain, problem: Problem, epsilon: Fraction, planner: str, *, renamed: Renaming | None = None
) -> tuple[tuple[timed.TimedPlan, ...], str]:
    """The valid plans in a text, the last one first; without one, what is wrong with the last, or an empty message."""
    plans: list[timed.TimedPlan] = []
    message = ""
    for printed in timed.plans_in(text, f"<plan of {planner}>"):
        try:
            if isinstance(printed, InputError):
                raise printed
            plan = printed if renamed is None else renamed(printed)
            check(plan, domain, problem, epsilon)
        except RobustError as error:
            message = message or " ".join(str(error).split())
        else:
            plans.append(plan)
        if len(plans) == MOST:
            break
    return tuple(plans), "" if plans else message


def says_no_plan(text: str) -> bool:
    """Whether a planner says that it found none: in words, or by printing nothing."""
    return not text.strip() or _NO_PLAN.search(text) is not None


MEMORY_MB = 8192
"""The address space that each process of a planner may have; more than any needs here, and less than a machine has."""


_FIELDS = ("domain", "problem", "output", "timeout")
_FILES = 16
"""Plan files that are read, of those that an anytime planner numbers: the last ones."""
_FOREVER = 10**6
"""Seconds, for planners that want a number where there is no deadline."""

Judge = Callable[[ProcessEnd], PlannerStatus | None]
"""The status of a run without valid plan, by exit code and output; None if they say nothing special."""


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
        plans = valid_plans(printed, domain, problem, self.epsilon, self.name)
        return judged(self.name, ended, plans, self.verdict)


def command_planner(template: str, *, epsilon: Fraction = EPSILON) -> CommandPlanner:
    """The planner that a command line starts; words are split as a shell does, but no shell runs.

    Raises:
        InputError: for an empty template, unbalanced quotes, a field that does not exist or none for the problem.
    """
    place = f"planner template {template!r}"
    try:
        arguments = tuple(shlex.split(template))
        parsed = (part for argument in arguments for part in string.Formatter().parse(argument))
        names = [name for _, name, _, _ in parsed if name is not None]
    except ValueError as error:
        raise InputError(f"{place}: found {error}, expected words and fields such as {{domain}}") from None
    if not arguments:
        raise InputError(f"{place}: found no command, expected one such as 'planner {{domain}} {{problem}}'")
    for name in names:
        if name not in _FIELDS:
            known = ", ".join(f"{{{field_name}}}" for field_name in _FIELDS)
            raise InputError(f"{place}: found field {{{name}}}, expected one of {known}{did_you_mean(name, _FIELDS)}")
    absent = next((name for name in ("domain", "problem") if name not in names), None)
    if absent:
        raise InputError(f"{place}: found no {{{absent}}}, expected it where the planner takes that file")
    return CommandPlanner(Path(arguments[0]).name, arguments, epsilon)


def judged(
    name: str, ended: ProcessEnd, printed: tuple[tuple[timed.TimedPlan, ...], str], verdict: Judge
) -> PlannerAnswer:
    """The answer that a run of a process amounts to; `printed` is valid plans, or what is wrong with the last one."""
    plans, wrong = printed
    if plans:
        return PlannerAnswer(name, PlannerStatus.SOLVED, plans[0], others=plans[1:])
    status = PlannerStatus.TIMEOUT if ended.timed_out else verdict(ended)
    if status is None:
        nothing = not wrong and says_no_plan(ended.stdout + ended.stderr)
        outcome = PlannerStatus.NO_PLAN if nothing else PlannerStatus.NONSENSE
        status = outcome if wrong or not ended.exit_code else PlannerStatus.CRASHED
    return PlannerAnswer(name, status, None, message=_message(status, ended, wrong))


def _message(status: PlannerStatus, ended: ProcessEnd, wrong: str) -> str:
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


def _plan_text(folder: Path, ended: ProcessEnd) -> str:
    """The text that the planner wrote into `{output}`, the last of several numbered files, or else printed."""
    written = sorted(filter(Path.is_file, folder.glob("plan*")), key=lambda path: path.stat().st_mtime_ns)
    texts = [_end_of(path) for path in written[-_FILES:]]
    return "\n.\n".join(texts) if any(text.strip() for text in texts) else ended.stdout


def _end_of(path: Path) -> str:
    """The last of what a file holds, as much as is kept of what a command prints."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - KEPT))
        return file.read(KEPT).decode("utf-8", "replace")


def program(name: str) -> str | None:
    """The path of a program in the folder of this interpreter, or on the search path; None if there is none."""
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
    options = f"--no-anytime --threads 1 --memory {_MEMORY_MB} --epsilon {numbers.format_number(epsilon)}".split()
    arguments = (command, "solve", "{domain}", "{problem}", "--timeout", "{timeout}", *options)
    first = CommandPlanner("kairos", (*arguments, "--search", "eager-lama"), epsilon, _verdict)
    return KairosPlanner(first, CommandPlanner("kairos", arguments, epsilon, _verdict))


def _verdict(ended: ProcessEnd) -> PlannerStatus | None:
    """The status that a documented exit code stands for: unsolvable (proved), out of time, no plan found."""
    match ended.exit_code:
        case 10 | 14:
            return PlannerStatus.NO_PLAN
        case 11:
            return PlannerStatus.TIMEOUT
        case _:
            return None
