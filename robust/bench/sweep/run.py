"""Sweeps: every task once, whatever happens to its workers; what is done stays done."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from robust.bench.batch import Progress
from robust.bench.sweep.cluster import ClusterLostError, on_cluster
from robust.bench.sweep.local import Outcomes, in_processes, one_by_one
from robust.bench.sweep.store import Store
from robust.bench.sweep.task import Outcome, Task, Work, key_of
from robust.errors import InputError
from robust.smt.limits import Deadline

AnyTask = TypeVar("AnyTask", bound=Task)


@dataclass(frozen=True, slots=True)
class Failure(Generic[AnyTask]):
    """A task without result, and why; not in the store, so that a later run tries it again."""

    task: AnyTask
    reason: str


@dataclass(frozen=True)
class Sweep(Generic[AnyTask]):
    """Results in the order of the tasks; `resumed` of them were in the store already.

    `complete` is false where Ctrl-C, the deadline or the loss of the cluster (`lost` says so) came before the last
    task; failed tasks do not count as missing.
    """

    results: tuple[tuple[AnyTask, Any], ...]
    failures: tuple[Failure[AnyTask], ...]
    total: int
    resumed: int
    complete: bool
    store: Path | None
    lost: str | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader has to know: what was taken from the store, what is missing and how to get it."""
        notes = []
        if self.resumed:
            notes.append(f"{self.resumed} of {self.total} results are from {self.store}")
        if self.failures:
            first = self.failures[0]
            notes.append(f"{len(self.failures)} of {self.total} tasks failed; {first.task.label}: {first.reason}")
        if self.lost is not None:
            notes.append(self.lost)
        if not self.complete:
            notes.append(f"incomplete: {len(self.results)} of {self.total} tasks done; {self._remedy}")
        return tuple(notes)

    @property
    def _remedy(self) -> str:
        if self.store is None:
            return "with --store FILE an interrupted run can be resumed"
        return f"run the same command again, with --store {self.store}, to resume"


def run_sweep(
    tasks: Sequence[AnyTask],
    work: Work,
    *,
    store: Path | None = None,
    jobs: int = 1,
    cluster: str | None = None,
    describe: Callable[[AnyTask, Any], str] | None = None,
    on_result: Progress | None = None,
    deadline: Deadline | None = None,
) -> Sweep[AnyTask]:
    """Do `work` for every task, each once; results go through JSON, so that new and stored ones are alike.

    A task whose worker is killed is done again, at most a few times. A task that raises an error is a failure, and the
    others go on.

    Args:
        tasks: what to do; tasks with equal keys are one task.
        work: does one task; picklable unless everything runs in this process, which it does for one job.
        store: a file that keeps results as they arrive, and from which a later run of the same tasks resumes.
        jobs: processes at a time on this machine.
        cluster: the address of a Dask scheduler whose workers do the tasks instead.
        describe: one line about a result.
        on_result: called after each new result with the number done, the total and that line.
        deadline: nothing is started after it.

    Returns:
        What there is, also after Ctrl-C, which ends what is running.

    Raises:
        InputError: if `jobs` is not positive, the store is unusable, or the cluster cannot be reached.
        UnsupportedError: if a cluster is wanted and Dask is not installed.
    """
    if jobs < 1:
        raise InputError(f"jobs is {jobs}; expected at least 1")
    if cluster is not None and jobs > 1:
        raise InputError(f"found both jobs {jobs} and cluster {cluster!r}, expected one of them")
    distinct = {key_of(task): task for task in tasks}
    with Store(store) if store is not None else nullcontext() as opened:
        known = {} if opened is None else {key: opened.results[key] for key in distinct if key in opened.results}
        state = _State(distinct, opened, dict(known), describe, on_result)
        complete = state.follow(work, jobs, cluster, deadline or Deadline())
    keys = [key for key in distinct if key in state.done]
    return Sweep(
        results=tuple((distinct[key], state.done[key]) for key in keys),
        failures=tuple(state.failures),
        total=len(distinct),
        resumed=len(known),
        complete=complete,
        store=store,
        lost=state.lost,
    )


class _State(Generic[AnyTask]):
    """What is done so far."""

    def __init__(
        self,
        tasks: dict[str, AnyTask],
        store: Store | None,
        done: dict[str, Any],
        describe: Callable[[AnyTask, Any], str] | None,
        on_result: Progress | None,
    ) -> None:
        self.tasks = tasks
        self.done = done
        self.failures: list[Failure[AnyTask]] = []
        self.lost: str | None = None
        self._keys = list(tasks)
        self._store = store
        self._describe = describe
        self._on_result = on_result

    def follow(self, work: Work, jobs: int, cluster: str | None, deadline: Deadline) -> bool:
        """Do what is not done; whether nothing is missing in the end."""
        pending = [(number, self.tasks[key]) for number, key in enumerate(self._keys) if key not in self.done]
        try:
            with closing(_outcomes(pending, work, jobs, cluster, deadline)) as outcomes:
                for number, outcome in outcomes:
                    self._take(self._keys[number], outcome)
        except KeyboardInterrupt:
            return False
        except ClusterLostError as error:
            self.lost = str(error)
        return len(self.done) + len(self.failures) == len(self.tasks)

    def _take(self, key: str, outcome: Outcome) -> None:
        task = self.tasks[key]
        if outcome.failed:
            self.failures.append(Failure(task, outcome.text))
            line = f"{task.label}: {outcome.text}"
        elif key in self.done:
            return
        else:
            result = json.loads(outcome.text)
            if self._store is not None:
                self._store.add(key, task.label, result)
            self.done[key] = result
            line = task.label if self._describe is None else self._describe(task, result)
        if self._on_result is not None:
            self._on_result(len(self.done) + len(self.failures), len(self.tasks), line)


def _outcomes(
    pending: list[tuple[int, Any]], work: Work, jobs: int, cluster: str | None, deadline: Deadline
) -> Outcomes:
    if not pending:
        return one_by_one([], work, deadline)
    if cluster is not None:
        return on_cluster(pending, work, cluster, deadline)
    if jobs == 1:
        return one_by_one(pending, work, deadline)
    return in_processes(pending, work, jobs, deadline)
