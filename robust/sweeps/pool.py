"""Where tasks are done: in this process, in processes that its threads wait for, or on a Dask cluster.

Work that only waits for processes which it starts is done in the threads themselves; any other task has a process of
its own, and is done again if that is killed (by a person, or by the system for want of memory). A Dask scheduler gives
the tasks of a worker that died to another one.
"""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import robust
from robust.codec import plain
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
    """What came of one attempt: `text` is the record as JSON, or, if it `failed`, one line that says why."""

    text: str
    failed: bool = False


Outcomes = Generator[tuple[int, TaskOutcome], None, None]


class ClusterLostError(Exception):
    """The scheduler is gone, and with it what had not been fetched; internal to sweeps, which return what they have."""


def text_of(value: object, *, ordered: bool = False) -> str:
    """The value as one line of JSON, `ordered` by key or not."""
    return json.dumps(plain(value), allow_nan=False, sort_keys=ordered, separators=(",", ":"))


def attempt(work: Work, task: Task) -> TaskOutcome:
    """Do the task where it is called: in this process, or in one of a pool or a cluster.

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
    "import sys; sys.path[:] = sys.argv[2:]; from robust.sweeps.pool import attempt_here; attempt_here(sys.argv[1])"
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
    """What the process of a task does: read it from a file, and write its outcome beside that."""
    work, task = pickle.loads(Path(folder, "task").read_bytes())  # noqa: S301 - written by the process that waits
    Path(folder, "outcome").write_text(text_of(attempt(work, task)), encoding="utf-8")


def _some_done(running: Iterable[Future[TaskOutcome]], deadline: Deadline) -> Iterable[Future[TaskOutcome]]:
    """Those that are done, once one is.

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
                found = f"robust {version}" if isinstance(version, str) else f"no such robust ({version})"
                raise InputError(
                    f"found {found} on worker {worker}, expected {robust.__version__} as here; install that there"
                )
        yield client


def _fetched(distributed: Any, future: Any, address: str) -> TaskOutcome:
    try:
        result: TaskOutcome = future.result()
    except distributed.KilledWorker as error:
        return TaskOutcome(
            f"its worker died again and again, the last one was {error.last_worker.address}", failed=True
        )
    except CancelledError:
        raise ClusterLostError(f"lost the Dask scheduler {address!r}") from None
    return result


def _version() -> str:
    return robust.__version__
