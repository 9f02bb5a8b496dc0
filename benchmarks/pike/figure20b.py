"""`robust bench figure20b`: the latency of executives on random plans with choices, by every back end [PIKE §6.2.2].

The semantic oracle finds the plans that admit a correct execution. Each of them is executed once by each back end, in a
process of its own: the same story each time, so that all must decide the same. Figure 20b is the slowest step of each
execution.

`python -m benchmarks.pike.figure20b SEED INDEX BACKEND LIMIT` is such a process, and prints one JSON object.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from statistics import median
from typing import Any, ClassVar

from robust.errors import InputError, did_you_mean
from robust.execute.drive import run_in_world
from robust.pike_bridge.generators.random_plans import random_plan
from robust.pike_bridge.model import Assignment, Condition, Effect, TeamPlan
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Decision, Message, Progress
from robust.pike_bridge.online.reasoner import Accompanied
from robust.pike_bridge.online.reasoners import SMT, make_reasoner, reasoner_names
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import SimulatedTeam, Story
from robust.pike_bridge.semantics import Existence, Oracle
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

from ..catalogue import Figure20bOptions
from ..engine.codec import plain, restored, text_of
from ..engine.experiment import Experiment, Report
from ..engine.measure import measured
from ..engine.show import BLACK, COLOURS, NOTHING, Cells, Table, canvas, number, quantile
from ..engine.sweep import Progress as Watching
from .figure20a_21 import GRACE, instance_name

TIMEOUT = "timeout"
SWIFT = 0.1
REACTIVE = 0.5
"""Seconds; what the paper counts."""
PAPER_SHARE = 0.853
"""Of the paper's executions whose slowest step took at most half a second."""


# -- one execution -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LatencyTask:
    """One back end on one plan."""

    seed: int
    index: int
    backend: str
    limit: float

    @property
    def label(self) -> str:
        return f"{instance_name(self.seed, self.index)}, {self.backend}"


@dataclass(frozen=True, slots=True)
class Execution:
    """One simulated execution: seconds of preparation, of each step, and of finding out when to look again.

    Attributes:
        outcome: `succeeded`, `failed`, `none` if something was still awaited in the end, `timeout` if the limit came
            first, None if something went wrong, which `message` says.
        preparation_seconds: to compile the plan, and to find out that a correct execution exists.
        decided: what was decided, in order.
    """

    backend: str
    instance: str
    outcome: str | None
    preparation_seconds: float | None = None
    step_seconds: tuple[float, ...] = ()
    wake_seconds: tuple[float, ...] = ()
    decisions: int = 0
    message: str | None = None
    decided: tuple[str, ...] = ()

    @property
    def executed(self) -> bool:
        """Whether it came to an end."""
        return self.outcome not in {None, TIMEOUT}

    @property
    def slowest(self) -> float | None:
        """Seconds of the slowest step, of an execution that came to an end."""
        return max(self.step_seconds, default=0.0) if self.executed else None


class _Timed:
    """An executive whose steps and wakes are measured, without what its companion does meanwhile."""

    def __init__(self, executive: PlanExecutive, judge: _TimedJudge) -> None:
        self._executive = executive
        self._judge = judge
        self.steps: list[float] = []
        self.wakes: list[float] = []
        self.decisions: list[str] = []

    def step(self, now: Fraction, messages: Sequence[Message]) -> list[Decision]:
        started, aside = time.perf_counter(), self._judge.seconds
        decisions = self._executive.step(now, messages)
        self.steps.append(round(time.perf_counter() - started - (self._judge.seconds - aside), 7))
        self.decisions += map(str, decisions)
        return decisions

    @property
    def wake(self) -> Fraction | None:
        started = time.perf_counter()
        wake = self._executive.wake
        self.wakes.append(round(time.perf_counter() - started, 7))
        return wake

    @property
    def ended(self) -> bool:
        return self._executive.ended


class _TimedJudge(SemanticReasoner):
    """Who advises the team, with the seconds that it takes to be told facts."""

    def __init__(self, progress: Progress) -> None:
        super().__init__(progress)
        self.seconds = 0.0

    def observed(self, assignment: Assignment) -> None:
        started = time.perf_counter()
        super().observed(assignment)
        self.seconds += time.perf_counter() - started

    def executed(self, event: str) -> None:
        started = time.perf_counter()
        super().executed(event)
        self.seconds += time.perf_counter() - started

    def voided(self, effect: Effect, condition: Condition) -> None:
        started = time.perf_counter()
        super().voided(effect, condition)
        self.seconds += time.perf_counter() - started

    def advanced(self) -> None:
        started = time.perf_counter()
        super().advanced()
        self.seconds += time.perf_counter() - started


def measure_latency(index: int, *, seed: int = 0, backend: str = SMT, deadline: Deadline = NEVER) -> Execution:
    """One simulated execution of the random plan of that number, with a rational team.

    The judge who advises the team is a reasoner of its own, so that its work is not the executive's. The story depends
    on nothing but the numbers, so that it is the same for all back ends as long as they decide the same.

    Args:
        backend: the name of a reasoner.
        deadline: for compilation and execution together; what was measured before it passes is kept.

    Raises:
        InputError: if there is no such reasoner.
    """
    plan = random_plan(seed, index).plan()
    return _Measurement(plan, backend, deadline).run(instance_name(seed, index), index)


class _Measurement:
    def __init__(self, plan: TeamPlan, backend: str, deadline: Deadline) -> None:
        self._plan = plan
        self._backend = backend
        self._deadline = deadline
        self._make = make_reasoner(backend, deadline=deadline)
        self._timed: _Timed | None = None
        self._preparation = 0.0

    def run(self, instance: str, seed: int) -> Execution:
        try:
            outcome = self._execute(seed)
        except OutOfTimeError:
            outcome = TIMEOUT
        timed = self._timed
        steps, wakes, decisions = (timed.steps, timed.wakes, timed.decisions) if timed else ([], [], [])
        return Execution(
            self._backend,
            instance,
            outcome,
            self._preparation,
            tuple(steps),
            tuple(wakes),
            len(decisions),
            decided=tuple(decisions),
        )

    def _execute(self, seed: int) -> str:
        judges: list[_TimedJudge] = []

        def both(progress: Progress) -> Accompanied:
            judges.append(_TimedJudge(progress))
            started = time.perf_counter()
            try:
                return Accompanied(self._make(progress), judges[0])
            finally:
                self._preparation = time.perf_counter() - started

        executive = PlanExecutive(self._plan, both, deadline=self._deadline)
        started = time.perf_counter()
        executive.prepare()
        self._preparation += time.perf_counter() - started
        timed = self._timed = _Timed(executive, judges[0])
        run_in_world(timed, SimulatedTeam(self._plan, executive, judges[0], Story(), seed=seed))
        return "none" if executive.outcome is None else type(executive.outcome).__name__.lower()


_CHILD = f"import sys; sys.path[:0] = sys.argv[1:2]; from {__name__} import main; main(sys.argv[2:])"


def run_execution(task: LatencyTask) -> Execution:
    """One execution as a process, so that executions do not disturb each other.

    Start and import are not counted in the limit, which the process keeps itself.
    """
    root = Path(__file__).parents[__name__.count(".")]
    words = (str(task.seed), str(task.index), task.backend, str(task.limit))
    found = measured((sys.executable, "-c", _CHILD, str(root), *words), limit=task.limit + GRACE)
    instance = instance_name(task.seed, task.index)
    if found.timed_out:
        return Execution(task.backend, instance, TIMEOUT)
    if found.exit_code != 0:
        return Execution(task.backend, instance, None, message=found.last_error)
    execution: Execution = restored(json.loads(found.stdout), Execution)
    return execution


def main(words: Sequence[str]) -> None:
    """What the process does."""
    # What the libraries brought is not looked at again by garbage collection, whose pauses would count as decisions.
    gc.freeze()
    seed, index, backend, limit = int(words[0]), int(words[1]), words[2], float(words[3])
    found = measure_latency(index, seed=seed, backend=backend, deadline=Deadline.after(limit))
    print(text_of(found))


# -- the report --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Admitting:
    """The plans that admit a correct execution, of those that the oracle `decided` in time."""

    problems: int
    decided: int
    admitting: tuple[str, ...]
    searched: bool = True
    """Whether all plans were looked at."""


class LatencyReport(Report[Execution]):
    """All executions."""

    SETTINGS: ClassVar[Mapping[str, str]] = {"seed": "seed", "limit": "limit", "jobs": "jobs"}
    ROWS = "executions"
    ROW = Execution
    FACTS = Admitting
    NOTED = False

    @classmethod
    def read_options(cls, answer: Mapping[str, Any]) -> dict[str, Any]:
        ran = tuple(dict.fromkeys(run["backend"] for run in answer["executions"]))
        return {**super().read_options(answer), "backends": ran}

    @property
    def complete(self) -> bool:
        return self.finished and self.facts.searched

    @property
    def backends(self) -> tuple[str, ...]:
        return _chosen(self.options.backends)

    def of(self, backend: str) -> list[Execution]:
        return [each for each in self.rows if each.backend == backend]

    @property
    def differences(self) -> list[str]:
        """Where two back ends decided differently; a time-out has only a beginning in common with the others."""
        found = []
        for instance in dict.fromkeys(each.instance for each in self.rows):
            told = [each for each in self.rows if each.instance == instance and each.outcome is not None]
            longest = max(told, key=lambda each: (each.executed, len(each.decided)), default=None)
            for each in told:
                place = None if longest is None else _difference(longest, each)
                if longest is not None and place is not None:
                    found.append(
                        f"{instance}: {longest.backend} and {each.backend} differ from decision {place + 1} on"
                    )
        return found

    @property
    def agrees(self) -> bool:
        """Whether everything was run, nothing failed, and all decided the same; too late is not wrong."""
        return self.complete and not self.differences and all(each.message is None for each in self.rows)

    def as_dict(self) -> dict[str, Any]:
        answer = super().as_dict()
        del answer["searched"]
        return answer

    @property
    def findings(self) -> Mapping[str, Any]:
        return {"differences": self.differences}

    def printed(self, row: Execution) -> dict[str, Any]:
        answer: dict[str, Any] = plain(row)
        del answer["decided"]
        return answer

    @property
    def notes(self) -> tuple[str, ...]:
        facts, options = self.facts, self.options
        found = [
            f"{facts.problems} plans of seed {options.seed}: {len(facts.admitting)} of {facts.decided} decided ones "
            "admit a correct execution",
            f"limit {options.limit:g} s for each compilation and execution, {options.jobs} at a time",
            f"the paper: the slowest step took up to {REACTIVE} s in {PAPER_SHARE:.1%} of 75 executions",
        ]
        found += [f"different decisions: {difference}" for difference in self.differences]
        found += [f"{run.instance}, {run.backend}: {run.message}" for run in self.rows if run.message is not None]
        if not self.complete:
            found.append("interrupted: not all executions were measured")
        return tuple(found)

    @property
    def executed(self) -> Table:
        """How many executions came to an end, and what was spent besides the steps."""
        rows: list[Cells] = []
        for backend in self.backends:
            runs = self.of(backend)
            ended = [run for run in runs if run.executed]
            prepared = sorted(run.preparation_seconds for run in ended if run.preparation_seconds is not None)
            rows.append(
                (
                    backend,
                    str(len(ended)),
                    str(len(runs)),
                    str(sum(run.outcome == "succeeded" for run in ended)),
                    str(sum(run.outcome == TIMEOUT for run in runs)),
                    _milliseconds(median(prepared) if prepared else None),
                    _milliseconds(prepared[-1] if prepared else None),
                    _milliseconds(max((seconds for run in ended for seconds in run.wake_seconds), default=None)),
                )
            )
        headings = (
            *("back end", "executed", "of", "succeeded", "out of time"),
            *("preparation, ms: median", "most", "slowest look ahead, ms"),
        )
        return Table("Executions of random plans with choices", headings, rows)

    @property
    def steps(self) -> Table:
        """Steps, and the slowest one of each execution [PIKE, Figure 20b]."""
        rows: list[Cells] = []
        for backend in self.backends:
            ended = [run for run in self.of(backend) if run.executed]
            steps = [seconds for run in ended for seconds in run.step_seconds]
            slowest = sorted(run.slowest for run in ended if run.slowest is not None)
            rows.append(
                (
                    backend,
                    str(len(steps)),
                    _milliseconds(median(steps) if steps else None),
                    _milliseconds(median(slowest) if slowest else None),
                    _milliseconds(quantile(slowest, 0.9)),
                    _milliseconds(slowest[-1] if slowest else None),
                    _share(sum(each < SWIFT for each in slowest), len(slowest)),
                    _share(sum(each <= REACTIVE for each in slowest), len(slowest)),
                )
            )
        headings = (
            *("back end", "steps", "median step, ms", "slowest step of each execution, ms: median"),
            *("90 %", "most", f"under {SWIFT} s", f"up to {REACTIVE} s"),
        )
        return Table("Latency of their steps", headings, rows, self.notes)

    @property
    def tables(self) -> list[Table]:
        """Executions and preparation, then steps."""
        return [self.executed, self.steps]

    def draw(self, path: Path) -> None:
        """The share of executions over the seconds of their slowest step, one line for each back end."""
        with canvas(path, 5.5, 4.2) as (_, [axes]):
            for place, backend in enumerate(self.backends):
                runs = self.of(backend)
                slowest = sorted(run.slowest for run in runs if run.slowest is not None)
                shares = [(at + 1) / len(runs) for at in range(len(slowest))]
                axes.step(slowest, shares, where="post", color=COLOURS[place % len(COLOURS)], label=backend)
            axes.axvline(REACTIVE, color=BLACK, linewidth=0.6, linestyle=":")
            axes.set(xscale="log", xlabel="seconds of the slowest step", ylabel="share of executions", ylim=(0, 1.02))
            axes.legend(loc="lower right")


def _difference(one: Execution, other: Execution) -> int | None:
    """The place of the first decision that is not the same."""
    for place, (first, second) in enumerate(zip(one.decided, other.decided, strict=False)):
        if first != second:
            return place
    if other.executed and len(one.decided) != len(other.decided):
        return min(len(one.decided), len(other.decided))
    return None


def _milliseconds(seconds: float | None) -> str:
    return number(None if seconds is None else seconds * 1000, 1)


def _share(count: int, total: int) -> str:
    return f"{count} ({count / total:.1%})" if total else NOTHING


# -- the experiment ----------------------------------------------------------------------------------------------------


def _chosen(names: Sequence[str]) -> tuple[str, ...]:
    """The back ends of these names, all without names."""
    known = reasoner_names()
    for name in names:
        if name not in known:
            raise InputError(f"--backend: unknown back end {name!r}{did_you_mean(name, known)}")
    return tuple(name for name in known if not names or name in names)


def _search(options: Figure20bOptions, watching: Watching | None) -> Admitting:
    """Ask the oracle about each plan; Ctrl-C ends the search with what is known."""
    if options.problems < 1:
        raise InputError(f"problems is {options.problems}; expected at least 1")
    _chosen(options.backends)
    admitting: list[str] = []
    decided = 0
    try:
        for index in range(options.problems):
            plan = random_plan(options.seed, index).plan()
            verdict = Oracle(plan).decide(deadline=Deadline.after(options.limit)).verdict
            decided += verdict is not Existence.UNKNOWN
            name = instance_name(options.seed, index)
            if verdict is Existence.EXISTS:
                admitting.append(name)
            if watching is not None:
                watching(index + 1, options.problems, f"{name}: correct execution {verdict.value}")
    except KeyboardInterrupt:
        return Admitting(options.problems, decided, tuple(admitting), searched=False)
    return Admitting(options.problems, decided, tuple(admitting))


def _tasks(options: Figure20bOptions, facts: Admitting) -> list[LatencyTask]:
    backends = _chosen(options.backends)
    names = {instance_name(options.seed, index): index for index in range(options.problems)}
    return [
        LatencyTask(options.seed, names[name], backend, options.limit)
        for name in facts.admitting
        for backend in backends
    ]


def _describe(task: LatencyTask, execution: Execution) -> str:
    outcome = execution.message or execution.outcome or "nothing"
    if execution.slowest is not None:
        outcome += f", slowest step {execution.slowest * 1000:.1f} ms"
    return f"{task.label}: {outcome}"


FIGURE20B = Experiment(
    "figure20b", Figure20bOptions, _tasks, run_execution, Execution, LatencyReport, _describe, prepare=_search
)
