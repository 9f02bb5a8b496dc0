"""Sweeps: every task once, whatever happens to its workers; what is done stays done.

Records are kept in a file as they arrive, with the key of their task (:mod:`robust.records`), so that a run that ends
early can be resumed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import msgspec

import robust
from robust.errors import InputError
from robust.files import unwritten
from robust.records import RecordFile, RecordFormat
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.sweeps.pool import ClusterLostError, Task, TaskOutcome, Work, outcomes_of, text_of

SCHEMA = "robust/sweep-store/3"
Progress = Callable[[int, int, str], None]
"""Called after each task with the number of tasks done, their total, and one line about the task."""


Value = TypeVar("Value")


def key_of(work: Work, task: Task) -> str:
    """A digest of what is done with which arguments, the same in every run and on every machine."""
    return sha256(text_of({work.__qualname__: task.given}, ordered=True).encode()).hexdigest()[:32]


def restored(value: object, kind: type[Value] | Any) -> Value:
    """A value of that type from what JSON says.

    Raises:
        msgspec.ValidationError: if it is no such value.
    """
    return msgspec.convert(value, kind, dec_hook=lambda wanted, text: wanted(text))


class Store(RecordFile):
    """The results of a file, by key; only one process at a time may have it open.

    Raises:
        InputError: if the file cannot be written, is no store, was written by another version, or is in use.
    """

    def __init__(self, path: Path) -> None:
        self.results: dict[str, Any] = {}
        form = RecordFormat("store of results", {"schema": SCHEMA, "robust": robust.__version__})
        super().__init__(path, form, self._accept)

    def add(self, key: str, label: str, result: Any) -> None:
        """Keep a result.

        Raises:
            InputError: if it cannot be written.
        """
        self.append({"key": key, "task": label, "result": result})
        self.results[key] = result

    def _accept(self, number: int, line: str) -> None:
        try:
            value = json.loads(line)
            if number > 1:
                self.results.setdefault(restored(value["key"], str), value["result"])
                return
        except (ValueError, KeyError, TypeError, msgspec.ValidationError):
            raise InputError(f"found no result, expected those of a store of results ({SCHEMA})") from None
        if (found := value.get("robust")) != robust.__version__:
            raise InputError(
                f"found results of robust {found}, expected those of {robust.__version__}; "
                "choose another file, so that results of different versions are not mixed"
            )


@dataclass(frozen=True, slots=True)
class TaskFailure:
    """A task without record, and why; not in the store, so that a later run tries it again."""

    task: str
    reason: str


@dataclass(frozen=True)
class Sweep:
    """Records in the order of the tasks; `resumed` of them were in the store already.

    `complete` is false where Ctrl-C, the deadline (`timed_out`) or the loss of the cluster (`lost` says so) came before
    the last task; failed tasks do not count as missing.
    """

    results: tuple[tuple[Task, Any], ...]
    failures: tuple[TaskFailure, ...]
    total: int
    resumed: int
    complete: bool
    store: Path | None
    lost: str | None = None
    timed_out: bool = False

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
    tasks: Sequence[Task],
    work: Work,
    *,
    record: Any = Any,
    store: Path | None = None,
    jobs: int = 1,
    cluster: str | None = None,
    describe: Callable[[Any], str] = lambda _: "done",
    on_result: Progress | None = None,
    settled: Callable[[Task, Sequence[Any]], Any | None] | None = None,
    threads: bool = False,
    deadline: Deadline = NEVER,
) -> Sweep:
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
        describe: some words about a record.
        on_result: called after each new record with the number done, the total and that line.
        settled: the record of a task that earlier records settle, before it is started here; None for the others.
        threads: do the work here in threads, because all it does is to wait for processes; see :data:`Work`.
        deadline: when to give up what is not done by then.

    Returns:
        What there is, also after Ctrl-C, which ends what is running, as the deadline does.

    Raises:
        InputError: if `jobs` is not positive, the store is unusable, or the cluster cannot be reached. A record that
            the store has no room for is a warning.
        UnsupportedError: if a cluster is wanted and Dask is not installed.
    """
    if jobs < 1:
        raise InputError(f"jobs is {jobs}; expected at least 1")
    if cluster is not None and jobs > 1:
        raise InputError(f"found both jobs {jobs} and cluster {cluster!r}, expected one of them")
    distinct = {key_of(work, task): task for task in tasks}
    failures: list[TaskFailure] = []

    def tell(line: str) -> None:
        if on_result is not None:
            on_result(len(done) + len(failures), len(distinct), line)

    def keep(key: str, found: Any) -> None:
        done[key] = found
        tell(f"{distinct[key].label}: {describe(found)}")

    def take(key: str, outcome: TaskOutcome) -> None:
        label = distinct[key].label
        if outcome.failed:
            failures.append(TaskFailure(label, outcome.text))
            tell(f"{label}: {outcome.text}")
        elif key not in done:
            value = json.loads(outcome.text)
            if opened is not None:
                try:
                    opened.add(key, label, value)
                except InputError as error:
                    unwritten(error)
            keep(key, restored(value, record))

    def begun(pending: Sequence[tuple[int, str]]) -> Iterator[tuple[int, Task]]:
        """Tasks to start, asked for when there is a place for one."""
        for number, key in pending:
            found = None if settled is None else settled(distinct[key], list(done.values()))
            if found is None:
                yield number, distinct[key]
            else:
                keep(key, found)

    with Store(store) if store is not None else nullcontext() as opened:
        known = {} if opened is None else {key: opened.results[key] for key in distinct if key in opened.results}
        done = {key: restored(value, record) for key, value in known.items()}
        keys = list(distinct)
        pending = [(number, key) for number, key in enumerate(keys) if key not in done]
        ended: BaseException | None = None
        try:
            if pending:
                source = outcomes_of(begun(pending), work, jobs, cluster, threads=threads, deadline=deadline)
                with closing(source) as outcomes:
                    for number, outcome in outcomes:
                        take(keys[number], outcome)
        except (KeyboardInterrupt, OutOfTimeError, ClusterLostError) as error:
            ended = error
    lost = str(ended) if isinstance(ended, ClusterLostError) else None
    timed_out = isinstance(ended, OutOfTimeError)
    complete = ended is None and len(done) + len(failures) == len(distinct)
    results = tuple((distinct[key], done[key]) for key in keys if key in done)
    return Sweep(results, tuple(failures), len(distinct), len(known), complete, store, lost, timed_out)
