"""Sweeps: every task is done once, whatever happens to its workers, and its record is kept.

Records are kept in a file as they arrive, with the key of their task (:mod:`robust.records`), so that a run that ends
early can be resumed.

Tasks are done in this process, in processes that its threads wait for, or on a Dask cluster. Work that only waits for
processes which it starts is done in the threads themselves; any other task has a process of its own, and is done again
if that is killed (by a person, or by the system for want of memory). A Dask scheduler gives the tasks of a worker that
died to another one.
"""

import json
import pickle
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import msgspec

import robust
from robust import json_text, records
from robust.errors import InputError, RobustError, missing
from robust.processes import Processes
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

ATTEMPTS = 3
"""How often the process of a task may be killed before the task is given up."""
PATIENCE = 30.0
"""Seconds to wait for a scheduler, and then for a first worker."""


@dataclass(frozen=True, slots=True)
class Task:
    """The arguments of a function, made of what JSON can say, fractions, paths, enums, tuples and dataclasses; and what
    people call it, which need not be unique."""

    label: str
    given: tuple[Any, ...]


Work = Callable[..., Any]
"""Returns the record of a task; picklable, because other processes call it. In threads, it is also given `processes`,
by which it runs all that it starts."""
Numbered = tuple[int, Task]


@dataclass(frozen=True, slots=True)
class TaskOutcome:
    """The outcome of one attempt: `text` is the record as JSON, or, if it `failed`, one line that says why."""

    text: str
    failed: bool = False


Outcomes = Generator[tuple[int, TaskOutcome], None, None]


class ClusterLostError(Exception):
    """The scheduler is gone, and with it what had not been fetched; internal to sweeps, which return what they have."""


def text_of(value: object, *, ordered: bool = False) -> str:
    """The value as one line of JSON, `ordered` by key or not."""
    return json.dumps(json_text.plain(value), allow_nan=False, sort_keys=ordered, separators=(",", ":"))


def attempt(work: Work, task: Task) -> TaskOutcome:
    """Do a task in this process, which may be one of a pool or a cluster.

    Whatever goes wrong with one task must not end the others: it is reported, never swallowed.
    """
    try:
        return TaskOutcome(text_of(work(*task.given)))
    except Exception as error:
        lines = str(error).splitlines() or ["no message"]
        kind = "" if isinstance(error, RobustError) else f"{type(error).__name__}: "
        return TaskOutcome(f"{kind}{lines[0]}", failed=True)


def outcomes_of(
    tasks: Iterable[Numbered],
    work: Work,
    jobs: int,
    cluster: str | None,
    *,
    threads: bool = False,
    deadline: Deadline = NEVER,
) -> Outcomes:
    """The outcomes as they arrive, of tasks here in `threads` or else in processes.

    Raises:
        OutOfTimeError: when the deadline passes; what is running then is ended, but for a task in this process.
        UnsupportedError: if a cluster is wanted and Dask is not installed.
        InputError: if there is no scheduler, no worker, or one with another version of this package.
        ClusterLostError: if the scheduler does not answer any more.
    """
    if cluster is not None:
        return _on_cluster(list(tasks), work, cluster, deadline)
    if threads or jobs > 1:
        return _in_threads(tasks, work, jobs, deadline, apart=not threads)
    return _one_by_one(tasks, work, deadline)


def _one_by_one(tasks: Iterable[Numbered], work: Work, deadline: Deadline) -> Outcomes:
    for number, task in tasks:
        deadline.enforce()
        yield number, attempt(work, task)


def _in_threads(tasks: Iterable[Numbered], work: Work, jobs: int, deadline: Deadline, *, apart: bool) -> Outcomes:
    """In threads, or `apart` in processes that they wait for; closing this generator ends what is running."""
    processes, source = Processes(), iter(tasks)
    running: dict[Future[TaskOutcome], int] = {}
    do = partial(_attempt_apart, work, processes) if apart else partial(attempt, partial(work, processes=processes))
    with ThreadPoolExecutor(jobs, "robust-sweep") as threads:
        try:
            while True:
                while len(running) < jobs and (following := next(source, None)) is not None:
                    number, task = following
                    running[threads.submit(do, task)] = number
                if not running:
                    return
                for future in _some_done(running, deadline):
                    yield running.pop(future), future.result()
        finally:
            processes.stop()


_APART = (
    "import sys; sys.path[:] = sys.argv[2:]; from robust.sweeps.sweep import attempt_here; attempt_here(sys.argv[1])"
)


def _attempt_apart(work: Work, processes: Processes, task: Task) -> TaskOutcome:
    """Do the task in a process of its own, again if that is killed."""
    with TemporaryDirectory(prefix="robust-sweep-") as folder:
        given, outcome = Path(folder, "task"), Path(folder, "outcome")
        given.write_bytes(pickle.dumps((work, task)))
        command = (sys.executable, "-c", _APART, folder, *sys.path)
        for _ in range(ATTEMPTS):
            ended = processes.run(command, scratch=Path(folder))
            if ended.exit_code == 0:
                return TaskOutcome(**json.loads(outcome.read_text(encoding="utf-8")))
            if ended.exit_code > 0:
                return TaskOutcome(f"its process ended: {ended.last_line}", failed=True)
        return TaskOutcome(f"its process was killed {ATTEMPTS} times", failed=True)


def attempt_here(folder: str) -> None:
    """The process of a task: read the task from a file, and write its outcome into the same folder."""
    work, task = pickle.loads(Path(folder, "task").read_bytes())  # noqa: S301 - written by the process that waits
    Path(folder, "outcome").write_text(text_of(attempt(work, task)), encoding="utf-8")


def _some_done(running: Iterable[Future[TaskOutcome]], deadline: Deadline) -> Iterable[Future[TaskOutcome]]:
    """The tasks that are done, once one is.

    Raises:
        OutOfTimeError: if the deadline passes before.
    """
    done = wait(running, timeout=deadline.remaining, return_when=FIRST_COMPLETED).done
    if not done:
        raise OutOfTimeError
    return done


# -- a cluster ---------------------------------------------------------------------------------------------------------


def _on_cluster(tasks: list[Numbered], work: Work, address: str, deadline: Deadline) -> Outcomes:
    try:
        distributed = import_module("distributed")  # an extra, and slow to import
    except ImportError:
        raise missing("Dask, which `--cluster` needs", "cluster") from None
    with _connected(distributed, address) as client:
        futures = {
            client.submit(attempt, work, task, pure=False, key=f"robust-sweep-{client.id}-{number}"): number
            for number, task in tasks
        }
        try:
            arriving = distributed.as_completed(list(futures), loop=client.loop, timeout=deadline.remaining)
            for future in arriving:
                number = futures.pop(future)
                yield number, _fetched(distributed, future, address)
                future.release()  # or the cluster would compute it again when the worker that holds it dies
        except TimeoutError:
            raise OutOfTimeError from None
        finally:
            client.cancel(list(futures), force=True)


@contextmanager
def _connected(distributed: Any, address: str) -> Iterator[Any]:
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError, RuntimeError, TypeError) as error:
        # The last two are said of TLS: it is demanded and the address is without, or the other way round.
        raise InputError(
            f"found no Dask scheduler at {address!r} ({(str(error).splitlines() or ['no message'])[0]}), expected one; "
            "start it with `dask scheduler`, give the address that it prints, and for tls:// configure the certificates"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise InputError(
                f"found no worker at the Dask scheduler {address!r}, expected at least one; start it with "
                f"`dask worker {address}`"
            ) from None
        for worker, version in client.run(_version, on_error="return").items():
            if version != robust.__version__:
                installed = f"robust {version}" if isinstance(version, str) else f"no such robust ({version})"
                raise InputError(
                    f"found {installed} on worker {worker}, expected {robust.__version__} as here; install that there"
                )
        yield client


def _fetched(distributed: Any, future: Any, address: str) -> TaskOutcome:
    try:
        result: TaskOutcome = future.result()
    except distributed.KilledWorker as error:
        reason = f"its worker died again and again, the last one was {error.last_worker.address}"
        return TaskOutcome(reason, failed=True)
    except CancelledError:
        raise ClusterLostError(f"lost the Dask scheduler {address!r}") from None
    return result


def _version() -> str:
    return robust.__version__


SCHEMA = "robust/sweep-store/3"
Progress = Callable[[int, int, str], None]
"""Called after each task with the number of tasks done, their total, and one line about the task."""


Value = TypeVar("Value")


def key_of(work: Work, task: Task) -> str:
    """A digest of what is done with which arguments, the same in every run and on every machine."""
    return sha256(text_of({work.__qualname__: task.given}, ordered=True).encode()).hexdigest()[:32]


def restored(value: object, kind: type[Value] | Any) -> Value:
    """A value of a type from its JSON.

    Raises:
        msgspec.ValidationError: if it is no such value.
    """
    return msgspec.convert(value, kind, dec_hook=lambda wanted, text: wanted(text))


class Store(records.RecordFile):
    """The results of a file, by key; only one process at a time may have it open.

    Raises:
        InputError: if the file cannot be written, is no store, was written by another version, or is in use.
    """

    def __init__(self, path: Path) -> None:
        self.results: dict[str, Any] = {}
        form = records.RecordFormat("store of results", {"schema": SCHEMA, "robust": robust.__version__})
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
        if (writer := value.get("robust")) != robust.__version__:
            raise InputError(
                f"found results of robust {writer}, expected those of {robust.__version__}; "
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
        """Notes for the user: results from the store, failures, and missing results with the way to get them."""
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
        raise InputError(f"jobs {jobs} cannot be combined with cluster {cluster!r}; choose one")
    distinct = {key_of(work, task): task for task in tasks}
    failures: list[TaskFailure] = []

    def tell(line: str) -> None:
        if on_result is not None:
            on_result(len(done) + len(failures), len(distinct), line)

    def keep(key: str, result: Any) -> None:
        done[key] = result
        tell(f"{distinct[key].label}: {describe(result)}")

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
                    records.unwritten(error)
            keep(key, restored(value, record))

    def begun(pending: Sequence[tuple[int, str]]) -> Iterator[tuple[int, Task]]:
        """Tasks to start, asked for when there is a place for one."""
        for number, key in pending:
            result = None if settled is None else settled(distinct[key], list(done.values()))
            if result is None:
                yield number, distinct[key]
            else:
                keep(key, result)

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
