"""Tasks on a Dask cluster: the scheduler gives those of a worker that died to another one."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import robust
from robust.bench.sweep.local import Numbered, Outcomes
from robust.bench.sweep.task import Outcome, Work, attempt
from robust.errors import InputError, UnsupportedError
from robust.smt.limits import Deadline

PATIENCE = 30.0
"""Seconds to wait for the scheduler, and then for a first worker."""


class ClusterLostError(Exception):
    """The scheduler is gone, and with it what had not been fetched; internal to sweeps, which return what they have."""


def on_cluster(tasks: list[Numbered], work: Work, address: str, deadline: Deadline) -> Outcomes:
    """Do the tasks on the workers of a scheduler, as they finish; what runs at the deadline is given up.

    Raises:
        UnsupportedError: if Dask is not installed.
        InputError: if there is no scheduler, no worker, or one with another version of this package.
        ClusterLostError: if the scheduler does not answer any more.
    """
    distributed = _distributed()
    with _connected(distributed, address) as client:
        futures = {
            client.submit(attempt, work, task, pure=False, key=f"robust-sweep-{client.id}-{number}"): number
            for number, task in tasks
        }
        try:
            for future in distributed.as_completed(list(futures), loop=client.loop, timeout=deadline.remaining):
                number = futures.pop(future)
                yield number, _outcome(distributed, future, address)
                future.release()  # or the cluster would compute it again when the worker that holds it dies
        except TimeoutError:
            return
        finally:
            client.cancel(list(futures), force=True)


def _distributed() -> Any:
    try:
        return import_module("distributed")  # an extra, and slow to import
    except ImportError:
        raise UnsupportedError(
            "found no Dask, which `--cluster` needs; install it with `pip install 'robust[cluster]'`"
        ) from None


@contextmanager
def _connected(distributed: Any, address: str) -> Iterator[Any]:
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"found no Dask scheduler at {address!r} ({str(error).splitlines()[0]}), expected one; "
            "start it with `dask scheduler`, and give the address that it prints"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise InputError(
                f"found no worker at the Dask scheduler {address!r}, expected at least one; start it with "
                f"`dask worker {address}`"
            ) from None
        for worker, version in client.run(_version).items():
            if version != robust.__version__:
                raise InputError(
                    f"found robust {version} on worker {worker}, expected {robust.__version__} as here; install that"
                )
        yield client


def _outcome(distributed: Any, future: Any, address: str) -> Outcome:
    try:
        result: Outcome = future.result()
    except distributed.KilledWorker as error:
        return Outcome(f"its worker died again and again, the last one was {error.last_worker.address}", failed=True)
    except CancelledError:
        raise ClusterLostError(f"lost the Dask scheduler {address!r}") from None
    return result


def _version() -> str:
    return robust.__version__
