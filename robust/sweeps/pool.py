"""Where tasks are done: in this process, in threads or processes of its own, or on a Dask cluster.

Threads are for work that waits for processes which it starts; everything else needs a pool of processes (joblib, with
loky).

A pool whose worker was killed (by a person, or by the system for want of memory) loses all tasks that were running,
and does not say which one it was. Each of these is then done again alone, so that the next loss tells. A Dask scheduler
gives the tasks of a worker that died to another one.
"""

from __future__ import annotations

import json
import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any

import robust
from robust.codec import plain
from robust.errors import InputError, RobustError, missing
from robust.processes import Processes
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

ATTEMPTS = 3
"""How often a task that runs alone may lose its worker before it is given up."""
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
class Outcome:
    """What came of one attempt: `text` is the record as JSON, or, if it `failed`, one line that says why."""

    text: str
    failed: bool = False


Outcomes = Generator[tuple[int, Outcome], None, None]


class ClusterLostError(Exception):
    """The scheduler is gone, and with it what had not been fetched; internal to sweeps, which return what they have."""


def text_of(value: object, *, ordered: bool = False) -> str:
    """The value as one line of JSON, `ordered` by key or not."""
    return json.dumps(plain(value), allow_nan=False, sort_keys=ordered, separators=(",", ":"))


def attempt(work: Work, task: Task) -> Outcome:
    """Do the task where it is called: in this process, or in one of a pool or a cluster.

    Whatever goes wrong with one task must not end the others: it is reported, never swallowed.
    """
    try:
        return Outcome(text_of(work(*task.given)))
    except Exception as error:
        lines = str(error).splitlines() or ["no message"]
        kind = "" if isinstance(error, RobustError) else f"{type(error).__name__}: "
        return Outcome(f"{kind}{lines[0]}", failed=True)


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
    if threads:
        return _in_threads(tasks, work, jobs, deadline)
    return _one_by_one(tasks, work, deadline) if jobs == 1 else _in_processes(tasks, work, jobs, deadline)


def _one_by_one(tasks: Iterable[Numbered], work: Work, deadline: Deadline) -> Outcomes:
    for number, task in tasks:
        deadline.enforce()
        yield number, attempt(work, task)


def _in_threads(tasks: Iterable[Numbered], work: Work, jobs: int, deadline: Deadline) -> Outcomes:
    """Whoever does not want more outcomes closes this generator, which ends what is running."""
    processes, source = Processes(), iter(tasks)
    running: dict[Future[Outcome], int] = {}
    with ThreadPoolExecutor(jobs, "robust-sweep") as threads:
        try:
            while True:
                while len(running) < jobs and (following := next(source, None)) is not None:
                    number, task = following
                    running[threads.submit(attempt, partial(work, processes=processes), task)] = number
                if not running:
                    return
                for future in _some_done(running, deadline):
                    yield running.pop(future), future.result()
        finally:
            processes.stop()


def _some_done(running: Iterable[Future[Outcome]], deadline: Deadline) -> Iterable[Future[Outcome]]:
    """Those that are done, once one is.

    Raises:
        OutOfTimeError: if the deadline passes before.
    """
    done = wait(running, timeout=deadline.remaining, return_when=FIRST_COMPLETED).done
    if not done:
        raise OutOfTimeError
    return done


# -- a pool of processes -----------------------------------------------------------------------------------------------


def _in_processes(tasks: Iterable[Numbered], work: Work, jobs: int, deadline: Deadline) -> Outcomes:
    waiting = iter(tasks)
    suspects: deque[Numbered] = deque()
    lost: dict[int, int] = {}
    while True:
        alone = bool(suspects)
        killed: list[Numbered] = []
        source = iter([suspects.popleft()]) if alone else waiting
        yield from _until_killed(source, work, jobs, killed, deadline)
        for number, task in killed:
            lost[number] = lost.get(number, 0) + alone
            if lost[number] < ATTEMPTS:
                suspects.append((number, task))
            else:
                yield number, Outcome(f"its process was killed {ATTEMPTS} times", failed=True)
        if not (alone or suspects):
            return


def _until_killed(
    source: Iterator[Numbered], work: Work, jobs: int, killed: list[Numbered], deadline: Deadline
) -> Outcomes:
    """Outcomes until the source is empty or a worker was killed; then `killed` are the tasks without outcome."""
    # A worker that is ended leaves a semaphore behind; what keeps track of them would tell users about it.
    os.environ.setdefault("PYTHONWARNINGS", "ignore:resource_tracker")
    try:
        from joblib.externals.loky import get_reusable_executor  # noqa: PLC0415 - an extra
        from joblib.externals.loky.process_executor import TerminatedWorkerError  # noqa: PLC0415
    except ImportError:
        raise missing("joblib, which more than one job needs", "experiments") from None

    executor = get_reusable_executor(max_workers=jobs)
    running: dict[Future[Outcome], Numbered] = {}
    try:
        while True:
            while len(running) < jobs and not killed:
                following = next(source, None)
                if following is None:
                    break
                try:
                    running[executor.submit(attempt, work, following[1])] = following
                except TerminatedWorkerError:  # just before
                    killed.append(following)
            if not running:
                return
            for future in _some_done(running, deadline):
                number, task = running.pop(future)
                try:
                    outcome = future.result()
                except TerminatedWorkerError:
                    killed.append((number, task))
                else:
                    yield number, outcome
    finally:
        executor.shutdown(kill_workers=bool(running))


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


def _fetched(distributed: Any, future: Any, address: str) -> Outcome:
    try:
        result: Outcome = future.result()
    except distributed.KilledWorker as error:
        return Outcome(f"its worker died again and again, the last one was {error.last_worker.address}", failed=True)
    except CancelledError:
        raise ClusterLostError(f"lost the Dask scheduler {address!r}") from None
    return result


def _version() -> str:
    return robust.__version__
