"""Many runs, one after another or several at a time, with progress and an orderly end on Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import Generic, TypeVar

from robust.bench.process import Processes, StoppedError
from robust.errors import InputError

Result = TypeVar("Result")
Progress = Callable[[int, int, str], None]
"""Called after each run with the number of runs done, their total, and one line about the run."""


@dataclass(frozen=True)
class Batch(Generic[Result]):
    """Results in the order of the runs; `complete` is false where Ctrl-C came before the last one."""

    results: tuple[Result, ...]
    complete: bool


def run_batch(
    total: int,
    work: Callable[[Processes, int], Result],
    *,
    jobs: int = 1,
    describe: Callable[[Result], str],
    on_result: Progress | None = None,
) -> Batch[Result]:
    """Do `work` for 0 … total − 1 with `jobs` threads; the work itself is done by processes that the threads wait for.

    Ctrl-C ends the processes and returns the results so far.

    Raises:
        InputError: if `jobs` is not positive.
    """
    if jobs < 1:
        raise InputError(f"jobs is {jobs}; expected at least 1")
    processes = Processes()
    results: dict[int, Result] = {}
    complete = True
    try:
        with closing(_outcomes(total, work, processes, jobs)) as outcomes:
            for index, result in outcomes:
                results[index] = result
                if on_result is not None:
                    on_result(len(results), total, describe(result))
    except KeyboardInterrupt:
        complete = False
    finally:
        processes.stop()
    return Batch(tuple(results[index] for index in sorted(results)), complete and len(results) == total)


def _outcomes(
    total: int, work: Callable[[Processes, int], Result], processes: Processes, jobs: int
) -> Generator[tuple[int, Result], None, None]:
    if jobs == 1:
        for index in range(total):
            yield index, work(processes, index)
        return

    def one(index: int) -> tuple[int, Result] | None:
        with suppress(StoppedError):
            return index, work(processes, index)
        return None

    from joblib import Parallel, delayed  # noqa: PLC0415 - not needed for one job

    pool = Parallel(n_jobs=jobs, backend="threading", return_as="generator_unordered", batch_size=1)
    outcomes = pool(delayed(one)(index) for index in range(total))
    try:
        for outcome in outcomes:
            if outcome is not None:
                yield outcome
    finally:
        processes.stop()
        for _ in outcomes:  # nothing starts any more, and joblib warns about results that nobody takes
            pass
