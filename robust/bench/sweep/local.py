"""Tasks on this machine: one after another in this process, or in a pool of processes (joblib, with loky).

A pool whose worker was killed (by a person, or by the system for want of memory) loses all tasks that were running,
and does not say which one it was. Each of these is then done again alone, so that the next loss tells.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator
from contextlib import closing

from robust.bench.sweep.task import Outcome, Task, Work, attempt
from robust.smt.limits import Deadline

ATTEMPTS = 3
"""How often a task that runs alone may lose its worker before it is given up."""

Numbered = tuple[int, Task]
Outcomes = Generator[tuple[int, Outcome], None, None]


def one_by_one(tasks: list[Numbered], work: Work, deadline: Deadline) -> Outcomes:
    """Do the tasks in this process; none is started after the deadline."""
    for number, task in tasks:
        if deadline.passed:
            return
        yield number, attempt(work, task)


def in_processes(tasks: list[Numbered], work: Work, jobs: int, deadline: Deadline) -> Outcomes:
    """Do the tasks in `jobs` processes, as they finish; none is started after the deadline."""
    waiting = deque(tasks)
    suspects: deque[Numbered] = deque()
    lost: dict[int, int] = {}
    while (waiting or suspects) and not deadline.passed:
        alone = deque([suspects.popleft()]) if suspects else None
        running: dict[int, Task] = {}
        broken = yield from _until_broken(_started(alone or waiting, running, deadline), running, work, jobs)
        for number, task in running.items() if broken else ():
            lost[number] = lost.get(number, 0) + (alone is not None)
            if lost[number] < ATTEMPTS:
                suspects.append((number, task))
            else:
                yield number, Outcome(f"its process was killed {ATTEMPTS} times", failed=True)


def _started(queue: deque[Numbered], running: dict[int, Task], deadline: Deadline) -> Iterator[Numbered]:
    while queue and not deadline.passed:
        number, task = queue.popleft()
        running[number] = task
        yield number, task


def _until_broken(
    source: Iterator[Numbered], running: dict[int, Task], work: Work, jobs: int
) -> Generator[tuple[int, Outcome], None, bool]:
    """Outcomes until the source is empty or a worker was killed; returns whether one was."""
    from joblib import Parallel, delayed  # noqa: PLC0415 - not needed for one job
    from joblib.externals.loky.process_executor import TerminatedWorkerError  # noqa: PLC0415

    pool = Parallel(n_jobs=jobs, backend="loky", return_as="generator_unordered", batch_size=1, pre_dispatch=jobs)
    try:
        with closing(pool(delayed(_numbered)(work, number, task) for number, task in source)) as outcomes:
            for number, outcome in outcomes:
                del running[number]
                yield number, outcome
    except TerminatedWorkerError:
        return True
    return False


def _numbered(work: Work, number: int, task: Task) -> tuple[int, Outcome]:
    return number, attempt(work, task)
