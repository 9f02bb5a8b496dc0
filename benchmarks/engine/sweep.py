"""Sweeps: every task once, whatever happens to its workers; what is done stays done."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from robust.errors import InputError
from robust.smt.limits import NEVER, Deadline

from .codec import key_of, restored
from .pool import ClusterLostError, Outcome, Work, outcomes_of
from .store import Store

Progress = Callable[[int, int, str], None]
"""Called after each task with the number of tasks done, their total, and one line about the task."""


class Task(Protocol):
    """A frozen dataclass of what JSON can say, fractions, paths, enums, tuples and further such dataclasses."""

    @property
    def label(self) -> str:
        """What people call it; need not be unique."""
        ...


AnyTask = TypeVar("AnyTask", bound=Task)


@dataclass(frozen=True, slots=True)
class Failure:
    """A task without record, and why; not in the store, so that a later run tries it again."""

    task: str
    reason: str


@dataclass(frozen=True)
class Sweep(Generic[AnyTask]):
    """Records in the order of the tasks; `resumed` of them were in the store already.

    `complete` is false where Ctrl-C, the deadline or the loss of the cluster (`lost` says so) came before the last
    task; failed tasks do not count as missing.
    """

    results: tuple[tuple[AnyTask, Any], ...]
    failures: tuple[Failure, ...]
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
            notes.append(f"{len(self.failures)} of {self.total} tasks failed; {first.task}: {first.reason}")
        if self.lost is not None:
            notes.append(self.lost)
        if not self.complete:
            remedy = "with --store FILE an interrupted run can be resumed"
            if self.store is not None:
                remedy = f"run the same command again, with --store {self.store}, to resume"
            notes.append(f"incomplete: {len(self.results)} of {self.total} tasks done; {remedy}")
        return tuple(notes)


def run_sweep(
    tasks: Sequence[AnyTask],
    work: Work,
    *,
    record: Any = Any,
    store: Path | None = None,
    jobs: int = 1,
    cluster: str | None = None,
    describe: Callable[[AnyTask, Any], str] | None = None,
    on_result: Progress | None = None,
    settled: Callable[[AnyTask, Sequence[Any]], Any | None] | None = None,
    deadline: Deadline | None = None,
) -> Sweep[AnyTask]:
    """Do `work` for every task, each once; records go through JSON, so that new and stored ones are alike.

    A task whose worker is killed is done again, at most a few times. A task that raises an error is a failure, and the
    others go on.

    Args:
        tasks: what to do; tasks with equal keys are one task.
        work: does one task; picklable unless everything runs in this process, which it does for one job.
        record: the type of the records.
        store: a file that keeps records as they arrive, and from which a later run of the same tasks resumes.
        jobs: processes at a time on this machine.
        cluster: the address of a Dask scheduler whose workers do the tasks instead.
        describe: one line about a record.
        on_result: called after each new record with the number done, the total and that line.
        settled: the record of a task that earlier records settle, before it is started here; None for the others.
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
        done = {key: restored(value, record) for key, value in known.items()}
        state = _State(distinct, done, record, opened, describe or (lambda task, _: task.label), on_result, settled)
        complete = state.follow(work, jobs, cluster, deadline or NEVER)
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


@dataclass
class _State(Generic[AnyTask]):
    """What is done so far, by key."""

    tasks: dict[str, AnyTask]
    done: dict[str, Any]
    record: Any
    store: Store | None
    describe: Callable[[AnyTask, Any], str]
    on_result: Progress | None
    settled: Callable[[AnyTask, Sequence[Any]], Any | None] | None
    failures: list[Failure] = field(default_factory=list)
    lost: str | None = None

    def follow(self, work: Work, jobs: int, cluster: str | None, deadline: Deadline) -> bool:
        """Do what is not done; whether nothing is missing in the end."""
        keys = list(self.tasks)
        pending = [(number, key) for number, key in enumerate(keys) if key not in self.done]
        try:
            if pending:
                with closing(outcomes_of(self._open(pending), work, jobs, cluster, deadline)) as outcomes:
                    for number, outcome in outcomes:
                        self._take(keys[number], outcome)
        except KeyboardInterrupt:
            return False
        except ClusterLostError as error:
            self.lost = str(error)
        return len(self.done) + len(self.failures) == len(self.tasks)

    def _open(self, pending: Sequence[tuple[int, str]]) -> Iterator[tuple[int, AnyTask]]:
        """Tasks to start, asked for when there is a place for one."""
        for number, key in pending:
            task = self.tasks[key]
            found = None if self.settled is None else self.settled(task, list(self.done.values()))
            if found is None:
                yield number, task
            else:
                self._keep(key, found)

    def _take(self, key: str, outcome: Outcome) -> None:
        task = self.tasks[key]
        if outcome.failed:
            self.failures.append(Failure(task.label, outcome.text))
            self._tell(f"{task.label}: {outcome.text}")
        elif key not in self.done:
            value = json.loads(outcome.text)
            if self.store is not None:
                self.store.add(key, task.label, value)
            self._keep(key, restored(value, self.record))

    def _keep(self, key: str, found: Any) -> None:
        self.done[key] = found
        self._tell(self.describe(self.tasks[key], found))

    def _tell(self, line: str) -> None:
        if self.on_result is not None:
            self.on_result(len(self.done) + len(self.failures), len(self.tasks), line)
