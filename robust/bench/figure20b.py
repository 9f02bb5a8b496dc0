"""`robust bench figure20b`: the latency of executives on random plans with choices, by every back end [PIKE §6.2.2].

The semantic oracle finds the plans that admit a correct execution. Each of them is executed once by each back end, in a
process of its own: the same story each time, so that all must decide the same. Figure 20b is the slowest step of each
execution.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.bench.batch import Progress, run_batch
from robust.bench.options import check_limit, plotting
from robust.bench.process import Measured, Processes
from robust.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "robust/bench-figure20b/1"
LIMIT = 60.0
PROBLEMS = 500
GRACE = 5.0
"""Seconds after its own limit until a process is ended."""
TIMEOUT = "timeout"
SWIFT = 0.1
REACTIVE = 0.5
"""Seconds; what the paper counts."""
PAPER_SHARE = 0.853
"""Of the paper's executions whose slowest step took at most half a second."""


@dataclass(frozen=True, slots=True)
class Execution:
    """One back end on one plan; `outcome` is `timeout` if the limit came first, None if something went wrong."""

    backend: str
    instance: str
    outcome: str | None
    preparation: float | None
    """Seconds of compilation, and of finding out that there is a correct execution; None if it was not told."""
    steps: tuple[float, ...]
    wakes: tuple[float, ...]
    decisions: tuple[str, ...]
    message: str | None = None
    """What went wrong, if it was not the limit."""

    @property
    def executed(self) -> bool:
        """Whether it came to an end."""
        return self.outcome not in {None, TIMEOUT}

    @property
    def slowest(self) -> float | None:
        """Seconds of the slowest step, of an execution that came to an end."""
        return max(self.steps, default=0.0) if self.executed else None

    def as_dict(self) -> dict[str, Any]:
        return {
            "backend": self.backend,
            "instance": self.instance,
            "outcome": self.outcome,
            "preparation_seconds": self.preparation,
            "step_seconds": [round(each, 7) for each in self.steps],
            "wake_seconds": [round(each, 7) for each in self.wakes],
            "decisions": len(self.decisions),
            "message": self.message,
        }


@dataclass(frozen=True)
class LatencyReport:
    """All executions; `complete` is false where Ctrl-C came before the last one."""

    backends: tuple[str, ...]
    problems: int
    decided: int
    """How many of them the oracle decided in time."""
    admitting: tuple[str, ...]
    """The plans that admit a correct execution."""
    executions: tuple[Execution, ...]
    complete: bool
    limit: float
    seed: int
    jobs: int

    def of(self, backend: str) -> list[Execution]:
        return [each for each in self.executions if each.backend == backend]

    @property
    def differences(self) -> list[str]:
        """Where two back ends decided differently; a time-out has only a beginning in common with the others."""
        found = []
        for instance in dict.fromkeys(each.instance for each in self.executions):
            told = [each for each in self.executions if each.instance == instance and each.outcome is not None]
            longest = max(told, key=lambda each: (each.executed, len(each.decisions)), default=None)
            for each in told:
                assert longest is not None  # noqa: S101 - it is one of them
                place = _difference(longest, each)
                if place is not None:
                    found.append(
                        f"{instance}: {longest.backend} and {each.backend} differ from decision {place + 1} on"
                    )
        return found

    @property
    def agrees(self) -> bool:
        """Whether everything was run, nothing failed, and all decided the same; too late is not wrong."""
        return self.complete and not self.differences and all(each.message is None for each in self.executions)

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; times in seconds."""
        return {
            "schema": SCHEMA,
            "complete": self.complete,
            "agrees": self.agrees,
            "seed": self.seed,
            "limit": self.limit,
            "jobs": self.jobs,
            "problems": self.problems,
            "decided": self.decided,
            "admitting": list(self.admitting),
            "differences": self.differences,
            "executions": [each.as_dict() for each in self.executions],
        }

    def tables(self) -> Sequence[Table]:
        """Tables for people."""
        from robust.bench.latency_tables import latency_tables  # noqa: PLC0415 - not needed for JSON

        return latency_tables(self)


def _difference(one: Execution, other: Execution) -> int | None:
    """The place of the first decision that is not the same."""
    for place, (first, second) in enumerate(zip(one.decisions, other.decisions, strict=False)):
        if first != second:
            return place
    if other.executed and len(one.decisions) != len(other.decisions):
        return min(len(one.decisions), len(other.decisions))
    return None


def chosen(names: Sequence[str]) -> tuple[str, ...]:
    """The back ends of these names, all without names.

    Raises:
        InputError: if there is no such back end.
    """
    from robust.pike_bridge.online.reasoners import reasoner_names  # noqa: PLC0415 - imports solvers

    known = reasoner_names()
    for name in names:
        if name not in known:
            raise InputError(f"--backend: unknown back end {name!r}{did_you_mean(name, known)}")
    return tuple(name for name in known if not names or name in names)


@dataclass(frozen=True, slots=True)
class Search:
    """The plans that admit a correct execution, as far as the oracle decided."""

    admitting: tuple[int, ...]
    decided: int
    complete: bool


def run_figure20b(
    *,
    backends: Sequence[str],
    problems: int = PROBLEMS,
    seed: int = 0,
    limit: float | None = LIMIT,
    jobs: int = 1,
    plot: Path | None = None,
    on_result: Progress | None = None,
) -> LatencyReport:
    """Find the random plans that admit a correct execution, and let each back end execute each of them once.

    Args:
        backends: names of reasoners.
        problems: how many plans are looked at.
        limit: seconds for the oracle's decision about a plan, and for each compilation with its execution.

    Raises:
        InputError: wrong options.
    """
    check_limit(limit)
    if problems < 1:
        raise InputError(f"problems is {problems}; expected at least 1")
    limit = limit or LIMIT
    drawing = plotting(plot, "robust.bench.latency_plots")
    search = _search(seed, problems, limit, on_result)
    work = [(index, backend) for index in search.admitting for backend in backends]

    def one(processes: Processes, place: int) -> Execution:
        index, backend = work[place]
        command = (sys.executable, "-m", "robust.bench.latency_process", str(seed), str(index), backend, str(limit))
        # Start and import are not counted in the limit, which the process keeps itself.
        return _read(processes.run(command, limit=limit + GRACE), _instance(seed, index), backend)

    batch = run_batch(len(work), one, jobs=jobs, describe=_describe, on_result=on_result)
    report = LatencyReport(
        tuple(backends),
        problems,
        search.decided,
        tuple(_instance(seed, index) for index in search.admitting),
        batch.results,
        batch.complete and search.complete,
        limit,
        seed,
        jobs,
    )
    if drawing is not None and plot is not None:
        drawing.plot_figure20b(report, plot)
    return report


def _search(seed: int, problems: int, limit: float, on_result: Progress | None) -> Search:
    """Ask the oracle about each plan; Ctrl-C ends the search with what is known."""
    from robust.pike_bridge.generators.random_plans import random_plan  # noqa: PLC0415 - imports the grammar
    from robust.pike_bridge.semantics import Existence, Oracle  # noqa: PLC0415 - imports solvers
    from robust.smt.limits import Deadline  # noqa: PLC0415

    admitting, decided = [], 0
    try:
        for index in range(problems):
            verdict = Oracle(random_plan(seed, index).plan()).decide(deadline=Deadline.after(limit)).verdict
            decided += verdict is not Existence.UNKNOWN
            if verdict is Existence.EXISTS:
                admitting.append(index)
            if on_result is not None:
                on_result(index + 1, problems, f"{_instance(seed, index)}: correct execution {verdict.value}")
    except KeyboardInterrupt:
        return Search(tuple(admitting), decided, complete=False)
    return Search(tuple(admitting), decided, complete=True)


def _instance(seed: int, index: int) -> str:
    return f"random_{seed}_{index:03}"


def _read(measured: Measured, instance: str, backend: str) -> Execution:
    if measured.timed_out:
        return Execution(backend, instance, TIMEOUT, None, (), (), ())
    if measured.exit_code != 0:
        return Execution(backend, instance, None, None, (), (), (), measured.last_error)
    told = json.loads(measured.stdout)
    return Execution(
        backend,
        instance,
        told["outcome"],
        told["preparation"],
        tuple(told["steps"]),
        tuple(told["wakes"]),
        tuple(told["decisions"]),
    )


def _describe(execution: Execution) -> str:
    outcome = execution.message or execution.outcome or "nothing"
    if execution.slowest is not None:
        outcome += f", slowest step {execution.slowest * 1000:.1f} ms"
    return f"{execution.instance}, {execution.backend}: {outcome}"
