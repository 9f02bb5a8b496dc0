"""Questions about many plans: each is a process of `robust`, as users run it, with its own time limit.

A suite of plans is a folder, or a list of lines, JSON or CSV. In a folder, each file whose suffix says that it is a
plan is one. Its problem and its domain are the PDDL files beside it, or in the nearest folder above within the suite,
whose names fit: without words such as `plan`, `problem` and `domain`, the name of the PDDL file is the beginning of
that of the plan, `plan_05_1.stn` of `problem_05.pddl`, and `problem.pddl` fits all. The longest such name counts; a
plan for which two fit equally well, or none, is named as one whose files are not known.

Tasks carry the texts of the files, so that workers of a cluster need no files, and so that a store recognizes a plan
that has changed. Answers hold boxes as exact text.
"""

import csv
import json
import os
import re
import shlex
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

from robust.errors import UNDECIDED, InputError, Location, RobustError, worst
from robust.json_text import Array, JsonText, Object, describe, parse_json
from robust.numbers import parse_end, plural, shorten
from robust.plan.pddl.forms import read_plan_text, read_text
from robust.presented import NoTruthValue, Presented
from robust.processes import ProcessEnd, Processes
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline
from robust.sweeps.sweep import Progress, Sweep, Task, run_sweep

PLAN_SUFFIXES = (".stn", ".plan", ".log", ".sol", ".soln", ".solution")
"""Of plans in a folder."""
NAMES = ("instance", "name")
"""Keys of JSON and columns of CSV that name a plan; the first that is there counts."""
PLANS = ("plan", "log")
"""Keys of JSON and columns of CSV that name the file of a plan."""
BESIDE = (".pddl", ".toml")
"""Of what belongs to plans."""
NAMED = 5
"""Files that were passed over, of which the names are said."""
_WORDS = frozenset(
    ["domain", "problem", "prob", "pfile", "p", "plan", "instance", "task", "solution", "sol", "log", "output"]
)
"""What names of files say of their kind; the rest says what belongs together."""
_PARTS = re.compile(r"[a-z]+|[0-9]+")
_DEFINED = re.compile(r"\(\s*define\s*\(\s*(domain|problem)\b", re.IGNORECASE)
_COMMENT = re.compile(r";[^\n]*")


@dataclass(frozen=True, slots=True)
class SuitePlan:
    """A plan of a suite, by a name that no other one has; `trouble` says in one line why its files are not known.

    Names of files are as the suite has them, relative to its folder.
    """

    name: str
    domain: str
    problem: str
    plan: str
    trouble: str | None = None


@dataclass(frozen=True, slots=True)
class Suite:
    """Plans, the folder that their files are relative to, and the files there that are neither plans nor of plans."""

    folder: Path
    instances: tuple[SuitePlan, ...]
    passed_over: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What was passed over."""
        if not self.passed_over:
            return ()
        more = len(self.passed_over) - NAMED
        names = ", ".join(self.passed_over[:NAMED]) + (f" and {more} more" if more > 0 else "")
        return (f"passed over {names}: names of plans end in {', '.join(PLAN_SUFFIXES)}",)


def read_suite(path: Path) -> Suite:
    """The plans of a folder, or of a list: JSON or CSV by its suffix, else lines of DOMAIN PROBLEM PLAN.

    Raises:
        InputError: if there is none, or the list is malformed; the message has the line.
    """
    if os.path.isdir(path):  # of no name at all, however long, does this raise
        files, defined = list(_files(path)), cache(_defined)
        plans = [_found(path, file, defined) for file in files if file.name.lower().endswith(PLAN_SUFFIXES)]
        if not plans:
            expected = f"files that end in {', '.join(PLAN_SUFFIXES)}, or a file with a list"
            raise InputError(f"found no plan, expected {expected}", Location(str(path)))
        others = (file for file in files if not file.name.lower().endswith((*PLAN_SUFFIXES, *BESIDE)))
        return Suite(path, _distinct(plans), tuple(os.path.relpath(file, path) for file in others))
    if not os.path.exists(path):
        raise InputError("found no such file or folder, expected a folder of plans or a list", Location(str(path)))
    readers = {".json": _from_json, ".csv": _from_csv}
    return Suite(path.parent, _distinct(readers.get(path.suffix.lower(), _from_lines)(path)))


def listed_files(path: Path) -> list[tuple[Path, Path, Path]]:
    """Domain, problem and plan on each line of a list; relative to it, quoted as in a shell, `#` before comments.

    Raises:
        InputError: if a line has other than three files, or there is none; the message has the line.
    """
    listed = []
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        place = Location(str(path), number)
        try:
            words = shlex.split(line, comments=True)
        except ValueError as error:
            raise InputError(f"found {shorten(line)}, expected quotes in pairs ({error})", place) from None
        if words and len(words) != 3:
            raise InputError(f"found {plural(len(words), 'file')}, expected DOMAIN PROBLEM PLAN", place)
        if words:
            domain, problem, plan = (path.parent / word for word in words)
            listed.append((domain, problem, plan))
    if not listed:
        raise InputError("found no plan, expected lines of DOMAIN PROBLEM PLAN", Location(str(path)))
    return listed


def _distinct(instances: Iterable[SuitePlan]) -> tuple[SuitePlan, ...]:
    """With a number behind names that were there before."""
    taken: dict[str, int] = {}
    distinct = []
    for instance in instances:
        count = taken[instance.name] = taken.get(instance.name, 0) + 1
        distinct.append(instance if count == 1 else replace(instance, name=f"{instance.name} ({count})"))
    return tuple(distinct)


# -- lists -------------------------------------------------------------------------------------------------------------


def _from_lines(path: Path) -> Iterator[SuitePlan]:
    for files in listed_files(path):
        domain, problem, plan = (os.path.relpath(file, path.parent) for file in files)
        yield SuitePlan(plan, domain, problem, plan)


def _from_json(path: Path) -> list[SuitePlan]:
    """A list of objects with `domain`, `problem` and `plan` or `log`; `instance` or `name` if they have one."""
    top = parse_json(read_text(path), str(path))
    if not isinstance(top, Array) or not top.items:
        place = Location(str(path), top.location.line, top.location.column)
        raise InputError(f"found {describe(top)}, expected a list of objects with domain, problem and plan", place)
    plans = []
    for item in top.items:
        if not isinstance(item, Object):
            raise InputError(f"found {describe(item)}, expected an object with domain, problem and plan", item.location)
        texts = {}
        for key in ("domain", "problem", *PLANS, *NAMES):
            value = item.members.get(key)
            if value is not None and not (isinstance(value, JsonText) and value.value):
                raise InputError(f"found {describe(value)} as {key}, expected a text", value.location)
            texts[key] = value.value if value is not None else None
        plans.append(_entry(texts, item.location))
    return plans


def _from_csv(path: Path) -> list[SuitePlan]:
    """A head with the keys of JSON, and a line for each plan."""
    rows = csv.DictReader(read_text(path).split("\n"), strict=True)
    plans = []
    try:
        for row in rows:
            place = Location(str(path), rows.line_num)
            if None in row:
                raise InputError(f"found more cells than the {len(rows.fieldnames or ())} of the head", place)
            plans.append(_entry(row, place))
    except csv.Error as error:
        raise InputError(f"found no CSV ({error})", Location(str(path), rows.reader.line_num)) from None
    if not plans:
        raise InputError("found no plan, expected a head with domain,problem,plan and lines below", Location(str(path)))
    return plans


def _entry(texts: Mapping[str, str | None], place: Location) -> SuitePlan:
    """A plan of a list, of texts by key; its name is that of the plan's file if it has none."""
    plan = next((texts[key] for key in PLANS if texts.get(key)), None)
    domain, problem = texts.get("domain"), texts.get("problem")
    for key, text in (("domain", domain), ("problem", problem), ("plan", plan)):
        if not text:
            raise InputError(f"found no {key}, expected domain, problem and plan", place)
    name = next((texts[key] for key in NAMES if texts.get(key)), None)
    return SuitePlan(name or plan or "", domain or "", problem or "", plan or "")


# -- folders -----------------------------------------------------------------------------------------------------------


Defined = Callable[[Path], Mapping[str, Sequence[Path]]]
"""The PDDL files of a folder by what they define."""


def _files(folder: Path) -> Iterator[Path]:
    for directory, inner, files in os.walk(folder):
        inner[:] = sorted(name for name in inner if not name.startswith("."))
        yield from (Path(directory, file) for file in sorted(files) if not file.startswith("."))


def _found(folder: Path, plan: Path, defined: Defined) -> SuitePlan:
    name = os.path.relpath(plan, folder)
    above = [plan.parent, *plan.parent.parents]
    del above[above.index(folder) + 1 :]
    files = {}
    for kind in ("domain", "problem"):
        fitting: Sequence[Path] = ()
        for directory in above:
            if fitting := _best(plan, defined(directory).get(kind, ())):
                break
        if len(fitting) != 1:
            names = ", ".join(file.name for file in fitting) or "none"
            where = "of a fitting name beside it or above"
            trouble = f"found {names}, expected one {kind} {where}; a list may say which"
            return SuitePlan(name, "", "", name, trouble)
        files[kind] = os.path.relpath(fitting[0], folder)
    return SuitePlan(name, files["domain"], files["problem"], name)


def _best(plan: Path, candidates: Iterable[Path]) -> list[Path]:
    """The one whose name fits best, or those of which none does."""
    words = _parts(plan)
    fitting = {file: parts for file in candidates if _fits(parts := _parts(file), words)}
    best = [path for path, parts in fitting.items() if all(set(parts) >= set(other) for other in fitting.values())]
    return best or list(fitting)


def _fits(parts: Sequence[str], plan: Sequence[str]) -> bool:
    """Whether they are the beginning of what the plan has, or words of it."""
    return plan[: len(parts)] == parts or (set(parts) <= set(plan) and not any(part.isdigit() for part in parts))


def _parts(file: Path) -> tuple[str, ...]:
    """`plan_g01_w05.stn` has g, 01, w, 05."""
    return tuple(part for part in _PARTS.findall(file.stem.lower()) if part not in _WORDS)


def _defined(directory: Path) -> Mapping[str, Sequence[Path]]:
    """Files of a directory by what they define; those that cannot be read define nothing."""
    files: dict[str, tuple[Path, ...]] = {}
    for file in sorted(directory.glob("*.[pP][dD][dD][lL]")):
        try:
            match = _DEFINED.search(_COMMENT.sub("", read_text(file)))
        except InputError:
            continue
        if match is not None:
            kind = match[1].lower()
            files[kind] = (*files.get(kind, ()), file)
    return files


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
        """The boxes of IRR and CCMMZ, if both are complete."""
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
        notes: what was passed over and resumed, and what is missing and how to get it.
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
    notes = (*suite.notes, *sweep.notes)
    return Batch(verb, str(path), asked, tuple(rows), len(suite.instances), _ended(sweep), notes, seconds)


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
