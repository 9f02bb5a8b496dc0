"""Questions about many plans: each is a process of `robust`, as users run it, with its own time limit.

Tasks carry the texts of the files, so that workers of a cluster need no files, and so that a store recognizes a plan
that has changed. Answers hold boxes as exact text.
"""

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from statistics import median
from typing import Any

from robust.errors import UNDECIDED, UNSUPPORTED, InputError, RobustError
from robust.numbers import parse_end
from robust.plan.pddl.forms import read_plan_text, read_text
from robust.presented import NoTruthValue, Presented
from robust.processes import ProcessEnd, Processes
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline
from robust.sweeps.suites import Suite, SuitePlan, read_suite
from robust.sweeps.sweep import Progress, Sweep, Task, run_sweep

COMMAND = (sys.executable, "-m", "robust")
"""The command line of this package, as found by this interpreter."""

Ends = tuple[str, str]
"""An interval as exact text: `1/3`, `7/4 (open)`, `-inf`; equal ends have equal texts."""
OPEN = " (open)"
"""What such a text ends in where the interval has not its end."""


def measured(command: Sequence[str], *, limit: float | None = None, processes: Processes | None = None) -> ProcessEnd:
    """Run a process to the end, or to the limit in seconds; it ends with this one, and when this one is interrupted.

    Raises:
        StoppedError: if `processes` are stopped.
    """
    return (processes or Processes()).run(command, Deadline.after(limit))


def complaint(ended: ProcessEnd) -> str:
    """The last line on stderr, or the exit code without one."""
    lines = [line.strip() for line in ended.stderr.splitlines() if line.strip()]
    return lines[-1] if lines else f"exit code {ended.exit_code} without a message"


def ends_of(interval: Interval) -> Ends:
    """The ends of an interval as text."""
    lower = "-inf" if interval.lower is None else str(interval.lower) + ("" if interval.lower_closed else OPEN)
    upper = "inf" if interval.upper is None else str(interval.upper) + ("" if interval.upper_closed else OPEN)
    return lower, upper


def box_of(texts: Mapping[str, Ends]) -> Box:
    """The box with ends as text."""

    def interval(lower: str, upper: str) -> Interval:
        closed = {"lower_closed": not lower.endswith(OPEN), "upper_closed": not upper.endswith(OPEN)}
        return Interval(parse_end(lower.removesuffix(OPEN)), parse_end(upper.removesuffix(OPEN)), **closed)

    return Box({name: interval(*ends) for name, ends in texts.items()})


GRACE = 5.0
"""Seconds beyond the limit of a plan after which its process is killed: until then it answers with what it knows."""
IRR, CCMMZ, REGION = "irr", "ccmmz", "region"
"""What is compared: IRR's box; the box of greatest total width, which CCMMZ asks for; the exact region, which CCMMZ
computes by eliminating time points."""

Named = tuple[str, str]
"""A file as people call it, and its text."""


@dataclass(frozen=True, slots=True)
class Asked:
    """A way to ask about a plan: its name, and the verb and options of the command line."""

    name: str
    verb: str
    options: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanTexts:
    """The files of a plan; `parameters` is a TOML file."""

    domain: Named
    problem: Named
    plan: Named
    parameters: Named | None = None


@dataclass(frozen=True, slots=True)
class PlanRun(NoTruthValue, ask="status"):
    """The answer of a process about a plan, and its cost.

    Attributes:
        status: the verdict of a check, how a search ended, or `error` or `unsupported`; a process that did not answer
            within its limit is a `timeout`.
        exit_code: of the command line.
        seconds: wall time of the whole process.
        cpu_s: processor time of the whole process.
        memory_mb: the most that it had in memory.
        search_s: of the search alone.
        first_widening_s: when the search had a box that is more than a point.
        message: one line that says what breaks, or what is wrong.
        tolerance: how much all durations that are parameters may differ at once, where that is known.
        box: the envelope, as exact text, where it is sound.
        region: the exact region, as JSON, where it is complete.
    """

    status: str
    exit_code: int
    seconds: float = 0.0
    cpu_s: float = 0.0
    memory_mb: float = 0.0
    search_s: float | None = None
    first_widening_s: float | None = None
    message: str | None = None
    tolerance: str | None = None
    box: dict[str, Ends] | None = None
    region: dict[str, Any] | None = None

    @property
    def solved(self) -> bool:
        """Whether the question is answered."""
        return self.exit_code in {0, 1}


@dataclass(frozen=True)
class BatchRow(NoTruthValue, ask="exit_code"):
    """A plan with the answers to questions that are done, by the names of questions."""

    instance: SuitePlan
    runs: Mapping[str, PlanRun]

    @property
    def exit_code(self) -> int:
        return worst(run.exit_code for run in self.runs.values())

    @property
    def volume_ratio(self) -> Fraction | None:
        """Volume of IRR's box as a share of that of CCMMZ's."""
        boxes = self._boxes
        return None if boxes is None else volume_ratio(*boxes)

    @property
    def width_ratio(self) -> Fraction | None:
        """Total width of IRR's box as a share of that of CCMMZ's; None if one is infinite, or that is a point."""
        if self._boxes is None:
            return None
        irr, ccmmz = (box.total_width for box in self._boxes)
        return None if irr is None or not ccmmz else irr / ccmmz

    @property
    def _boxes(self) -> tuple[Box, Box] | None:
        """Those of IRR and CCMMZ, if both are complete."""
        runs = (self.runs.get(name) for name in (IRR, CCMMZ))
        boxes = [box_of(run.box) for run in runs if run is not None and run.exit_code == 0 and run.box is not None]
        return (boxes[0], boxes[1]) if len(boxes) == 2 else None


@dataclass(frozen=True, slots=True)
class Solved:
    """Summary of one question: number of plans answered, time, and number of plans that no other question answers."""

    plans: int
    seconds: float
    median_s: float | None
    alone: int


@dataclass(frozen=True)
class Batch(Presented, ask="exit_code"):
    """The result of a batch, complete or not.

    Attributes:
        verb: `check`, `envelope`, `region` or `compare`.
        suite: where the plans are from.
        asked: what was asked about each.
        plans: those about which something is known, in the order of the suite.
        total: how many plans there are.
        status: `complete`, or `timeout`, `interrupted` or `lost` (the cluster) if something ended it before.
        notes: what was resumed, and what is missing and how to get it.
        seconds: wall time of all.
    """

    verb: str
    suite: str
    asked: tuple[Asked, ...]
    plans: tuple[BatchRow, ...]
    total: int
    status: str
    notes: tuple[str, ...]
    seconds: float

    @property
    def exit_code(self) -> int:
        """1 if a plan is refuted; else 2 if one cannot be read; else 4 if one is unsupported; else 3 if one is open."""
        codes = [row.exit_code for row in self.plans]
        return worst([*codes, 0 if self.status == "complete" else UNDECIDED])

    def runs(self, name: str) -> list[PlanRun]:
        """The answers to one question."""
        return [row.runs[name] for row in self.plans if name in row.runs]

    def solved(self, name: str) -> Solved:
        """The summary of one question."""
        answered = [row for row in self.plans if name in row.runs and row.runs[name].solved]
        seconds = [row.runs[name].seconds for row in answered]
        alone = [row for row in answered if not any(run.solved for other, run in row.runs.items() if other != name)]
        return Solved(len(answered), sum(seconds), median(seconds) if seconds else None, len(alone))


def worst(codes: Iterable[int]) -> int:
    """The exit code of several answers: refuted, else unreadable, else unsupported, else unknown."""
    present = set(codes)
    return next((code for code in (1, RobustError.exit_code, UNSUPPORTED, UNDECIDED) if code in present), 0)


def volume_ratio(box: Box, other: Box) -> Fraction | None:
    """The volume of a box as a share of another's, over the parameters that are not single values in both.

    None if one of them is infinite, if the other has no volume, or if both are points.
    """
    names = [name for name in other.intervals if any(either[name].width != 0 for either in (box, other))]
    volume, other_volume = (Box({name: either[name] for name in names}).volume for either in (box, other))
    return None if not names or volume is None or not other_volume else volume / other_volume


# -- a batch -----------------------------------------------------------------------------------------------------------


def run_batch(
    verb: str,
    questions: Sequence[tuple[str, str, tuple[str, ...]]],
    path: Path,
    *,
    parameters: Path | None = None,
    limit: float | None = None,
    timeout: float | None = None,
    jobs: int = 1,
    cluster: str | None = None,
    store: Path | None = None,
    on_result: Progress | None = None,
) -> Batch:
    """Ask about all plans of a suite.

    Args:
        verb: what the batch is called.
        questions: what is asked about each plan: a name, a verb, and options as they are typed.
        path: the suite.
        parameters: a file of parameters for all plans, in place of the files next to them.
        limit: seconds for each plan and question.
        timeout: seconds for all.
        jobs: processes at a time on this machine.
        cluster: the address of a Dask scheduler whose workers run the processes instead.
        store: a file that keeps answers as they arrive, and from which a later run resumes.
        on_result: called after each answer.

    Raises:
        InputError: a suite that is malformed or empty, a store that is unusable, or a cluster that cannot be reached.
        UnsupportedError: if a cluster is wanted and Dask is not installed.
    """
    began, deadline = time.perf_counter(), Deadline.after(timeout)
    asked = tuple(Asked(*question) for question in questions)
    suite = read_suite(path)
    given = None if parameters is None else (parameters.name, read_text(parameters))
    texts: dict[str, PlanTexts] = {}
    troubles: dict[str, PlanRun] = {}
    reading = _SuiteReading(suite, given)
    for instance in suite.instances:
        try:
            texts[instance.name] = reading.texts(instance)
        except InputError as error:
            troubles[instance.name] = PlanRun("error", error.exit_code, message=reading.shown(error))
    tasks = [
        Task(_label(instance, question, asked), (instance.name, texts[instance.name], question, limit))
        for instance in suite.instances
        if instance.name in texts
        for question in asked
    ]
    sweep = run_sweep(
        tasks,
        run_plan,
        record=PlanRun,
        store=store,
        jobs=jobs,
        cluster=cluster,
        describe=_line,
        on_result=on_result,
        threads=True,
        deadline=deadline,
    )
    known = {task.label: run for task, run in sweep.results}
    known |= {failure.task: PlanRun("error", UNDECIDED, message=failure.reason) for failure in sweep.failures}
    rows = []
    for instance in suite.instances:
        labels = {question.name: _label(instance, question, asked) for question in asked}
        answers = {name: troubles.get(instance.name, known.get(label)) for name, label in labels.items()}
        runs = {name: run for name, run in answers.items() if run is not None}
        if runs:
            rows.append(BatchRow(instance, runs))
    seconds = time.perf_counter() - began
    return Batch(verb, str(path), asked, tuple(rows), len(suite.instances), _ended(sweep), sweep.notes, seconds)


def _label(instance: SuitePlan, question: Asked, asked: Sequence[Asked]) -> str:
    """What a task is called."""
    return f"{instance.name}: {question.name}" if len(asked) > 1 else instance.name


def _ended(sweep: Sweep) -> str:
    if sweep.complete:
        return "complete"
    if sweep.lost is not None:
        return "lost"
    return "timeout" if sweep.timed_out else "interrupted"


def _line(run: PlanRun) -> str:
    said = f": {run.message}" if run.message else ""
    return f"{run.status}{said}, {run.seconds:.2f} s"


class _SuiteReading:
    """Reads the files of a suite; domains and problems of several plans once."""

    def __init__(self, suite: Suite, parameters: Named | None) -> None:
        self._folder = suite.folder
        self._parameters = parameters
        self._read: dict[str, str] = {}

    def texts(self, instance: SuitePlan) -> PlanTexts:
        """InputError if a file cannot be read, or is not known."""
        if instance.trouble is not None:
            raise InputError(instance.trouble)
        beside = Path(instance.plan).with_suffix(".toml")
        parameters = self._parameters
        if parameters is None and (self._folder / beside).is_file():
            parameters = self._named(str(beside))
        plan = instance.plan, read_plan_text(self._folder / instance.plan)[0]
        return PlanTexts(self._named(instance.domain), self._named(instance.problem), plan, parameters)

    def shown(self, error: RobustError) -> str:
        """An error about a file of the suite, as the suite calls it."""
        return str(error).replace(f"{self._folder}{os.sep}", "")

    def _named(self, name: str) -> Named:
        if name not in self._read:
            self._read[name] = read_text(self._folder / name)
        return name, self._read[name]


# -- one plan ----------------------------------------------------------------------------------------------------------


def run_plan(
    _name: str, texts: PlanTexts, asked: Asked, limit: float | None, *, processes: Processes | None = None
) -> PlanRun:
    """Ask about one plan, in a process that is killed a little after the limit."""
    with tempfile.TemporaryDirectory(prefix="robust-batch-") as folder:
        called: dict[str, str] = {}
        files = []
        for place, (name, text) in enumerate((texts.domain, texts.problem, texts.plan)):
            path = Path(folder, str(place), Path(name).name)
            path.parent.mkdir()
            path.write_text(text, encoding="utf-8")
            called[str(path)] = name
            files.append(str(path))
        options = [*asked.options, "--json"]
        if texts.parameters is not None:
            beside = Path(files[-1]).with_suffix(".toml")
            beside.write_text(texts.parameters[1], encoding="utf-8")
            called[str(beside)] = texts.parameters[0]
        if limit is not None:
            options += ["--timeout", str(limit)]
        killed = None if limit is None else limit + GRACE
        ended = measured([*COMMAND, asked.verb, *files, *options], limit=killed, processes=processes)
    run = _read_run(asked.verb, ended)
    message = run.message
    for temporary, name in called.items():  # the names that people know for files
        message = None if message is None else message.replace(temporary, name)
    return replace(run, message=message)


def _read_run(verb: str, ended: ProcessEnd) -> PlanRun:
    """What a process answered, or why that is no answer.

    Raises:
        RobustError: if there is none, because something killed the process; so that a later run tries again.
    """
    cost: dict[str, Any] = {
        "seconds": round(ended.seconds, 4),
        "cpu_s": round(ended.cpu_s, 4),
        "memory_mb": round(ended.memory_mb, 1),
    }
    if ended.timed_out:
        return PlanRun("timeout", UNDECIDED, **cost, message="no answer within the limit")
    if not ended.stdout.strip():
        raise RobustError(complaint(ended))
    try:
        answer = json.loads(ended.stdout)
        if "error" in answer:
            return _refused(answer["error"], ended.exit_code, cost)
        return _READERS[verb](answer, ended.exit_code, cost)
    except (ValueError, KeyError, TypeError, AttributeError, RobustError) as error:
        message = f"the answer is not that of `robust {verb} --json` ({type(error).__name__}: {error})"
        return PlanRun("error", UNDECIDED, **cost, message=message)


Json = Mapping[str, Any]


def _refused(error: Json, code: int, cost: Json) -> PlanRun:
    place = ":".join(str(error[key]) for key in ("file", "line", "column") if error[key] is not None)
    message = f"{place}: {error['message']}" if place else error["message"]
    kind = error["kind"]
    status = kind if kind in {"timeout", "interrupted", "unsupported"} else "error"
    return PlanRun(status, code, **cost, message=message)


def _check(answer: Json, code: int, cost: Json) -> PlanRun:
    example = answer["counterexample"]
    message = answer["reason"]
    if example is not None:
        violation = next((item for item in example["violations"] if item["obligation"] == example["obligation"]), None)
        message = example["obligation"] + (f": {violation['detail']}" if violation is not None else "")
    return PlanRun(
        answer["verdict"], code, **cost, search_s=answer["seconds"], message=message, tolerance=_ratio(answer)
    )


def _ratio(answer: Json) -> str | None:
    tolerance = answer["tolerance"]
    return None if tolerance is None else str(tolerance["ratio"])


def _envelope(answer: Json, code: int, cost: Json) -> PlanRun:
    box = {name: ends_of(Interval.from_dict(ends)) for name, ends in answer["parameters"].items() if answer["verified"]}
    return PlanRun(
        answer["status"],
        code,
        **cost,
        search_s=answer["seconds"],
        first_widening_s=answer["first_widening_s"],
        message=answer["reason"],
        tolerance=_ratio(answer),
        box=box if answer["verified"] else None,
    )


def _region(answer: Json, code: int, cost: Json) -> PlanRun:
    region = dict(answer) if answer["status"] == "complete" else None
    status = answer["status"]
    message = answer.get("reason") or (None if region else "only an outer and an inner bound are known")
    return PlanRun(status, code, **cost, search_s=answer["seconds"], message=message, region=region)


_READERS: Mapping[str, Callable[[Json, int, Json], PlanRun]] = {
    "check": _check,
    "envelope": _envelope,
    "region": _region,
}
