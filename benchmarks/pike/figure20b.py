"""`robust bench figure20b`: the latency of executives on random plans with choices, by every back end [PIKE §6.2.2].

The semantic oracle finds the plans that admit a correct execution. Each of them is executed once by each back end, in a
process of its own: the same story each time, so that all must decide the same. Figure 20b is the slowest step of each
execution.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import cycle, zip_longest
from pathlib import Path
from typing import Any, ClassVar

from robust.backends import SMT
from robust.errors import InputError, RobustError, did_you_mean
from robust.execute.drive import run_in_world
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Decision
from robust.pike_bridge.online.reasoners import make_reasoner, reasoner_names
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import SimulatedTeam, Story
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.sweeps.batch import complaint, measured
from robust.sweeps.sweep import Progress as Watching
from robust.sweeps.sweep import restored, text_of

from ..catalogue import Figure20bOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import COLOURS, NOTHING, Columns, Panel, Series, Table, middle, number, quantile
from ..generators.team_plans import random_plan
from .baselines import Timed
from .figure20a_21 import GRACE, instance_name

TIMEOUT = "timeout"
SWIFT = 0.1
REACTIVE = 0.5
"""Seconds; what the paper counts."""
PAPER_SHARE = 0.853
"""Of the paper's executions whose slowest step took at most half a second."""


# -- one execution -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Execution:
    """One simulated execution: seconds of the processor for its preparation, each step, and when to look again.

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


@dataclass(frozen=True, slots=True)
class Manner:
    """How long humans hesitate at most, and whether the executive waits for what they may still choose."""

    delay: Fraction = Fraction(0)
    patient: bool = False


AS_IN_THE_PAPER = Manner()


def measure_latency(
    index: int, *, seed: int = 0, backend: str = SMT, manner: Manner = AS_IN_THE_PAPER, deadline: Deadline = NEVER
) -> Execution:
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
    name, make = instance_name(seed, index), make_reasoner(backend, deadline=deadline)
    timed: Timed[Decision] | None = None
    started = time.process_time()
    try:
        executive = PlanExecutive(plan, make, patience=Fraction(0) if manner.patient else None, deadline=deadline)
        executive.prepare()
        # What is there already is not looked at again by garbage collection, whose pauses would count as decisions.
        gc.freeze()
        preparation = time.process_time() - started
        timed = Timed(executive)
        judge = SemanticReasoner(executive.progress)
        run_in_world(timed, SimulatedTeam(plan, executive, judge, Story(delay=manner.delay), seed=index))
        outcome = "none" if executive.outcome is None else type(executive.outcome).__name__.lower()
    except OutOfTimeError:
        outcome = TIMEOUT
    if timed is None:
        return Execution(backend, name, outcome, time.process_time() - started)
    decided = tuple(timed.decisions)
    steps, wakes = tuple(timed.steps), tuple(timed.wakes)
    return Execution(backend, name, outcome, preparation, steps, wakes, len(decided), decided=decided)


_CHILD = f"import sys; sys.path[:0] = sys.argv[1:2]; from {__name__} import main; main(sys.argv[2:])"


def run_execution(seed: int, index: int, backend: str, limit: float, manner: Manner = AS_IN_THE_PAPER) -> Execution:
    """One execution as a process, so that executions do not disturb each other.

    Start and import are not counted in the limit, which the process keeps itself.
    """
    words = map(
        str, (Path(__file__).parents[__name__.count(".")], seed, index, backend, limit, manner.delay, manner.patient)
    )
    found = measured((sys.executable, "-c", _CHILD, *words), limit=limit + GRACE)
    if found.timed_out:
        return Execution(backend, instance_name(seed, index), TIMEOUT)
    if found.exit_code != 0:
        return Execution(backend, instance_name(seed, index), None, message=complaint(found))
    execution: Execution = restored(json.loads(found.stdout), Execution)
    return execution


def main(words: Sequence[str]) -> None:
    """What the process does."""
    gc.freeze()  # what the libraries brought
    seed, index, backend, limit, delay, patient = words
    try:
        found = measure_latency(
            int(index),
            seed=int(seed),
            backend=backend,
            manner=Manner(Fraction(delay), patient == str(True)),
            deadline=Deadline.after(float(limit)),
        )
    except RobustError as error:
        raise SystemExit(f"robust: error: {error}") from None
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
    differing: tuple[str, ...] = ()
    """Where decisions are known to differ, of executions that are read again."""


@dataclass(frozen=True, slots=True)
class Latencies:
    """What a back end did with the plans."""

    name: str
    runs: Sequence[Execution]

    @property
    def ended(self) -> list[Execution]:
        return [run for run in self.runs if run.executed]

    @property
    def prepared(self) -> list[float]:
        """Seconds of preparation, of executions that came to an end."""
        return [run.preparation_seconds for run in self.ended if run.preparation_seconds is not None]

    @property
    def steps(self) -> list[float]:
        return [seconds for run in self.ended for seconds in run.step_seconds]

    @property
    def slowest(self) -> list[float]:
        """The slowest step of each execution, in ascending order."""
        return sorted(run.slowest for run in self.ended if run.slowest is not None)

    def share(self, swift: Callable[[float], bool]) -> str:
        """How many executions never took longer."""
        count, total = sum(map(swift, self.slowest)), len(self.slowest)
        return f"{count} ({count / total:.1%})" if total else NOTHING


def _milliseconds(seconds: float | None) -> str:
    return number(None if seconds is None else seconds * 1000, 1)


def _most(values: Iterable[float]) -> str:
    return _milliseconds(max(values, default=None))


EXECUTED: Columns[Latencies] = {
    "back end": lambda one: one.name,
    "executed": lambda one: len(one.ended),
    "of": lambda one: len(one.runs),
    "succeeded": lambda one: sum(run.outcome == "succeeded" for run in one.ended),
    "out of time": lambda one: sum(run.outcome == TIMEOUT for run in one.runs),
    "preparation, ms: median": lambda one: _milliseconds(middle(one.prepared)),
    "most": lambda one: _most(one.prepared),
    "slowest look ahead, ms": lambda one: _most(seconds for run in one.ended for seconds in run.wake_seconds),
}
STEPS: Columns[Latencies] = {
    "back end": lambda one: one.name,
    "steps": lambda one: len(one.steps),
    "median step, ms": lambda one: _milliseconds(middle(one.steps)),
    "slowest step of each execution, ms: median": lambda one: _milliseconds(middle(one.slowest)),
    "90 %": lambda one: _milliseconds(quantile(one.slowest, 0.9)),
    "most": lambda one: _most(one.slowest),
    f"under {SWIFT} s": lambda one: one.share(lambda seconds: seconds < SWIFT),
    f"up to {REACTIVE} s": lambda one: one.share(lambda seconds: seconds <= REACTIVE),
}


class LatencyReport(Report[Execution]):
    """One simulated execution of each random plan that admits a correct one [PIKE, Figure 20b] (`robust bench
    figure20b`). `smt` is ours and compiles nothing: each question goes to the semantic oracle's formula, and its
    preparation is to state that formula and to find one correct execution. The others are the paper's executive:
    labeled execution windows over labeled shortest paths, which are counted in the preparation, with a knowledge base
    each; the paper's own is `pitms`. Humans choose what remains correct, activities end while that leaves a correct
    execution.
    """

    TITLE = "Latency of the executive"
    SETTINGS: ClassVar[Mapping[str, str]] = {name: name for name in ("seed", "limit", "jobs", "delay", "patient")}
    ROWS = "executions"
    RAN = (("backends", "backend"),)
    FACTS = Admitting
    NOTED = False
    LAYOUT = (5.5, 4.2, "lower right")

    @classmethod
    def read_facts(cls, answer: Mapping[str, Any]) -> Any:
        return replace(super().read_facts(answer), differing=tuple(answer["differences"]))

    @property
    def complete(self) -> bool:
        return self.finished and self.facts.searched

    @property
    def latencies(self) -> list[Latencies]:
        return [Latencies(name, self.of(backend=name)) for name in _chosen(self.options.backends)]

    @property
    def differences(self) -> list[str]:
        """Where two back ends decided differently; a time-out has only a beginning in common with the others.

        Decisions are not printed, only where they differ.
        """
        found = list(self.facts.differing)
        for instance in dict.fromkeys(each.instance for each in self.rows):
            told = [each for each in self.of(instance=instance) if each.outcome is not None]
            for each in told:
                longest = max(told, key=lambda one: (one.executed, len(one.decided)))
                if (place := _difference(longest, each)) is not None:
                    names = f"{longest.backend} and {each.backend}"
                    found.append(f"{instance}: {names} differ from decision {place + 1} on")
        return found

    def sound(self) -> bool:
        """Whether nothing failed, and all decided the same; too late is not wrong."""
        return not self.differences and all(each.message is None for each in self.rows)

    def as_dict(self) -> dict[str, Any]:
        answer = super().as_dict()
        del answer["searched"], answer["differing"]
        return answer

    def findings(self) -> Mapping[str, Any]:
        return {"differences": self.differences}

    def printed(self, row: Execution) -> dict[str, Any]:
        answer: dict[str, Any] = super().printed(row)
        del answer["decided"]
        return answer

    def remarks(self) -> Sequence[str]:
        facts, options, differences = self.facts, self.options, self.differences
        return [
            f"{facts.problems} plans of seed {options.seed}: {len(facts.admitting)} of {facts.decided} decided ones "
            "admit a correct execution",
            f"limit {options.limit:g} s for each compilation and execution, {options.jobs} at a time",
            f"humans hesitate for {options.delay} units of time at most; "
            + ("the executive waits for them as long as it can" if options.patient else "the executive is eager"),
            f"the paper: the slowest step took up to {REACTIVE} s in {PAPER_SHARE:.1%} of 75 executions",
            *([] if differences else ["all back ends made the same decisions at the same times"]),
            *(f"different decisions: {difference}" for difference in differences),
            *(f"{run.instance}, {run.backend}: {run.message}" for run in self.rows if run.message is not None),
        ]

    def contents(self) -> list[Table]:
        """Executions and preparation, then steps, and the slowest one of each execution [PIKE, Figure 20b]."""
        return [
            Table.of("Executions of random plans with choices", EXECUTED, self.latencies),
            Table.of("Latency of their steps", STEPS, self.latencies),
        ]

    def panels(self) -> list[Panel]:
        """The share of executions over the seconds of their slowest step, one line for each back end."""
        lines = [Series([(REACTIVE, 0), (REACTIVE, 1.02)], line=":")]
        for one, colour in zip(self.latencies, cycle(COLOURS), strict=False):
            from_none = (*one.slowest[:1], *one.slowest)
            shares = [(seconds, place / len(one.runs)) for place, seconds in enumerate(from_none)]
            lines.append(Series(shares, one.name, colour, "-", steps=True))
        axes = {"ylim": (0, 1.02)}
        return [Panel("", lines, "seconds of the slowest step", "share of executions", log="x", axes=axes)]


def _difference(one: Execution, other: Execution) -> int | None:
    """The place of the first decision that is not the same."""
    pairs = zip_longest(one.decided, other.decided) if other.executed else zip(one.decided, other.decided, strict=False)
    return next((place for place, (first, second) in enumerate(pairs) if first != second), None)


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
    decided, searched = 0, False
    with suppress(KeyboardInterrupt):
        for index in range(options.problems):
            plan = random_plan(options.seed, index).plan()
            verdict = Oracle(plan).decide(deadline=Deadline.after(options.limit)).verdict
            decided += verdict is not ExecutionExistence.UNKNOWN
            name = instance_name(options.seed, index)
            if verdict is ExecutionExistence.EXISTS:
                admitting.append(name)
            if watching is not None:
                watching(index + 1, options.problems, f"{name}: correct execution {verdict.value}")
        searched = True
    return Admitting(options.problems, decided, tuple(admitting), searched)


def _tasks(options: Figure20bOptions, facts: Admitting) -> list[Task]:
    names = {instance_name(options.seed, index): index for index in range(options.problems)}
    manner = Manner(Fraction(options.delay), options.patient)
    return [
        Task(f"{name}, {backend}", (options.seed, names[name], backend, options.limit, manner))
        for name in facts.admitting
        for backend in _chosen(options.backends)
    ]


def _describe(execution: Execution) -> str:
    slowest = "" if execution.slowest is None else f", slowest step {execution.slowest * 1000:.1f} ms"
    return f"{execution.message or execution.outcome or 'nothing'}{slowest}"


FIGURE20B = Experiment("figure20b", Figure20bOptions, _tasks, run_execution, LatencyReport, _describe, prepare=_search)
