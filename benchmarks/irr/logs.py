"""`robust bench logs`: what temporal planners printed, converted and checked as a user does it, beside VAL.

A data set is a directory with `plans.json`: a list of logs, each with its `name`, the number of `steps` of its last
plan, the paths `domain`, `problem` and `log` in the directory, and what VAL said of that plan when it was recorded
(`val`: `valid`, `invalid`, or `refused` where it cannot read the problem). VAL validates one schedule, that of the
printed steps; `robust check` proves the converted plan for every schedule that its network allows.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, ClassVar, Literal

from msgspec import Meta

from robust.draw.style import BLUE, GREEN, VERMILION
from robust.errors import InputError, Location, RobustError
from robust.json_text import Count, Rational, Seconds, from_json
from robust.numbers import format_number
from robust.plan.pddl.forms import read_text
from robust.plan.timed import TimedPlan, read_timed_plan, write_timed_plan
from robust.processes import ProcessEnd
from robust.sweeps.batch import COMMAND, complaint, measured

from ..catalogue import LogsOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import NOTHING, Columns, Panel, Series, Table, number
from ..suite import directory_with

FILE_NAME = "plans.json"
TOLERANCE = "0.001"
"""VAL's option -t."""
CONVERT_S, CONVERT_MB, CHECK_S = 3.0, 150.0, 2.0
"""What a log may take: seconds of processor time, MiB of memory."""
Verdict = Literal["valid", "invalid", "refused"]
_VERDICTS: Mapping[int, Verdict] = {0: "valid", 1: "invalid"}


@dataclass(frozen=True, slots=True)
class Log:
    """An entry of a data set; paths are relative to its directory."""

    name: Annotated[str, Meta(min_length=1)]
    steps: Count
    domain: str
    problem: str
    log: str
    val: Verdict


@dataclass(frozen=True, slots=True)
class Cost:
    """Of a whole process: seconds of processor time, and the most memory in MiB."""

    cpu_s: Seconds
    memory_mb: Seconds

    @staticmethod
    def of(found: ProcessEnd) -> Cost:
        return Cost(round(found.cpu_s, 4), round(found.memory_mb, 1))


@dataclass(frozen=True, slots=True)
class Proof:
    """What `robust check` says of the converted plan: obligations proved by shortest paths, and by the solver."""

    cost: Cost
    verdict: str
    by_paths: Count
    by_solver: Count


@dataclass(frozen=True)
class LogRow:
    """One log. `verdict` is that of `robust convert`, and `reason` why it is not `proved`.

    `shift` is how far a start or a duration is from where it was printed. `val` is VAL's verdict now, None without it.
    """

    name: str
    steps: Count
    convert: Cost
    verdict: str
    reason: str | None
    constraints: Count
    shift: Rational | None
    check: Proof | None
    recorded: Verdict
    val: Verdict | None
    val_s: Seconds | None

    @property
    def holds(self) -> bool:
        """Whether valid plans are proved twice, invalid ones refused with the reason, and VAL says what it said."""
        proved = self.verdict == "proved" and self.check is not None and self.check.verdict == "proved"
        refused = self.verdict == "invalid" and self.reason is not None
        expected = {"valid": proved, "invalid": refused, "refused": proved or refused}[self.recorded]
        return expected and self.val in {None, self.recorded}

    @property
    def within(self) -> bool:
        """Whether it took no more than it may."""
        late = self.convert.cpu_s > CONVERT_S or self.convert.memory_mb > CONVERT_MB
        return not late and (self.check is None or self.check.cost.cpu_s <= CHECK_S)


def measure_log(directory: Path, log: Log, validator: Path | None, limit: float | None) -> LogRow:
    """Convert a log, check what is written, and validate the printed steps with VAL if it is there.

    Raises:
        RobustError: if a command ends without an answer, or not in time, or the log has another number of steps.
    """
    pddl = [str((directory / name).resolve()) for name in (log.domain, log.problem)]
    printed = directory / log.log
    with TemporaryDirectory(prefix="robust-bench-") as folder:
        network, steps = Path(folder, "plan.stn"), Path(folder, "plan.txt")
        words = ["convert", *pddl, str(printed.resolve()), "--output", str(network)]
        convert, answer = _answer(words, limit)
        timed = read_timed_plan(printed)
        if len(timed.steps) != log.steps:
            raise RobustError(f"found {len(timed.steps)} steps, expected {log.steps}")
        proved = answer["verdict"] == "proved"
        checked = _answer(["check", *pddl, str(network)], limit) if proved else None
        steps.write_text(write_timed_plan(timed), encoding="utf-8")
        val = None if validator is None else measured([str(validator), "-t", TOLERANCE, *pddl, str(steps)], limit=limit)
    return LogRow(
        log.name,
        log.steps,
        Cost.of(convert),
        str(answer["verdict"]),
        None if proved else _reason(answer["violations"]),
        answer["constraints"],
        _shift(timed, answer["schedule"]) if proved else None,
        None if checked is None else _proof(*checked),
        log.val,
        None if val is None else _VERDICTS.get(val.exit_code, "refused"),
        None if val is None else round(val.cpu_s, 4),
    )


def _answer(words: Sequence[str], limit: float | None) -> tuple[ProcessEnd, dict[str, Any]]:
    found = measured([*COMMAND, *words, "--json"], limit=limit)
    answer = json.loads(found.stdout) if found.stdout.strip() else {}
    if "verdict" not in answer:
        reason = "out of time" if found.timed_out else answer.get("error", {}).get("message") or complaint(found)
        raise RobustError(f"robust {words[0]}: {reason}")
    return found, answer


def _reason(violations: Sequence[Mapping[str, str]]) -> str:
    """The first obligation that breaks, and how."""
    first = min(violations, key=lambda one: Fraction(one["time"]))
    return f"{first['obligation']}: {first['detail']}"


def _proof(found: ProcessEnd, answer: Mapping[str, Any]) -> Proof:
    proved = sum(one["verdict"] == "proved" for one in answer["obligations"])
    return Proof(Cost.of(found), str(answer["verdict"]), answer["settled"], proved - answer["settled"])


def _shift(timed: TimedPlan, schedule: Mapping[str, str]) -> Fraction:
    """How far a start or a duration is from where it was printed, at most."""
    away = [Fraction(0)]
    for place, step in enumerate(timed.steps):
        name, instant = f"n{place}", f"n{place}" in schedule
        start = Fraction(schedule[name if instant else f"{name}.start"])
        away.append(abs(start - step.time))
        if not instant:
            away.append(abs(Fraction(schedule[f"{name}.end"]) - start - (step.duration or 0)))
    return max(away)


# -- the report --------------------------------------------------------------------------------------------------------

COLUMNS: Columns[LogRow] = {
    "log": lambda row: row.name,
    "steps": lambda row: row.steps,
    "convert": lambda row: row.convert.cpu_s,
    "MiB": lambda row: number(row.convert.memory_mb, 0),
    "verdict": lambda row: row.verdict,
    "constraints": lambda row: row.constraints,
    "shift": lambda row: NOTHING if row.shift is None else format_number(row.shift),
    "check": lambda row: None if row.check is None else row.check.cost.cpu_s,
    "by paths": lambda row: None if row.check is None else row.check.by_paths,
    "by solver": lambda row: None if row.check is None else row.check.by_solver,
    "VAL": lambda row: row.val_s,
    "VAL says": lambda row: row.val or row.recorded,
}


class LogReport(Report[LogRow]):
    """Logs of temporal planners, converted and checked (`robust bench logs`): processor time of whole processes on this
    machine, and VAL's time to validate the one schedule that was printed."""

    TITLE = "Logs of planners"
    SETTINGS: ClassVar[Mapping[str, str]] = {"suite": "suite", "limit_s": "limit", "jobs": "jobs"}
    LAYOUT = (5.6, 4.4, "upper left")

    def sound(self) -> bool:
        """Whether each log is proved, or refused with the reason, as VAL says, and took no more than it may."""
        return all(row.holds and row.within for row in self.rows)

    def remarks(self) -> Sequence[str]:
        notes = [
            "processor time of whole processes; shift: how far a start or a duration is from what was printed",
            f"limits: convert at most {CONVERT_S:g} s and {CONVERT_MB:g} MiB, check at most {CHECK_S:g} s",
        ]
        if any(row.val is None for row in self.rows):
            notes.append("VAL was not found: its verdicts are the recorded ones (option --validator)")
        return [*notes, *(f"{row.name}: {row.verdict}: {row.reason}" for row in self.rows if row.reason is not None)]

    def contents(self) -> list[Table]:
        return [Table.of("Logs of planners", COLUMNS, self.rows, left=("log", "verdict", "VAL says"), whole=False)]

    def conclusions(self) -> Sequence[str]:
        """How many are as they should be, and the most that one took."""
        said = Counter(row.recorded for row in self.rows)
        right = Counter(row.recorded for row in self.rows if row.holds)
        most = {
            "convert": (max((row.convert.cpu_s for row in self.rows), default=0), "s"),
            "convert, memory": (max((row.convert.memory_mb for row in self.rows), default=0), "MiB"),
            "check": (max((row.check.cost.cpu_s for row in self.rows if row.check is not None), default=0), "s"),
        }
        listed = ", ".join(f"{right[one]} of {count} that VAL calls {one}" for one, count in said.items())
        return [
            f"as they should be: {listed}",
            "at most " + ", ".join(f"{name} {number(value)} {unit}" for name, (value, unit) in most.items()),
            f"within the limits: {sum(row.within for row in self.rows)} of {len(self.rows)}",
        ]

    def panels(self) -> list[Panel]:
        """Seconds over the number of steps."""
        rows = sorted(self.rows, key=lambda row: row.steps)
        converted = [(row.steps, row.convert.cpu_s) for row in rows]
        checked = [(row.steps, row.check.cost.cpu_s) for row in rows if row.check is not None]
        validated = [(row.steps, row.val_s) for row in rows if row.val_s]
        dots = [
            Series(converted, "robust convert", BLUE, marker="o"),
            Series(checked, "robust check", GREEN, marker="s"),
            Series(validated, "VAL, one schedule", VERMILION, marker="^"),
        ]
        return [Panel("Logs of planners", dots, "steps", "processor time", seconds="y", log="x")]


def _prepare(options: LogsOptions, _: object) -> tuple[Log, ...]:
    directory = directory_with(FILE_NAME, options.suite)
    place = Location(str(directory / FILE_NAME))
    found: tuple[Log, ...] = from_json(tuple[Log, ...], read_text(directory / FILE_NAME), place)
    if not found:
        raise InputError("found an empty list, expected at least one log", place)
    return found


def _tasks(options: LogsOptions, logs: tuple[Log, ...]) -> list[Task]:
    directory = directory_with(FILE_NAME, options.suite)
    validator = None if options.validator is None or not options.validator.is_file() else options.validator.resolve()
    return [Task(log.name, (directory, log, validator, options.limit)) for log in logs]


def _describe(row: LogRow) -> str:
    return (
        f"{row.steps} steps, {row.verdict}, {number(row.convert.cpu_s)} s{'' if row.holds else ', NOT as it should be'}"
    )


LOGS = Experiment(
    "logs", LogsOptions, _tasks, measure_log, LogReport, _describe, prepare=_prepare, lenient=True, unit="logs"
)
