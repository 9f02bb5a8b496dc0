"""Tasks for sweeps of tests, in a module that is quick to load: each process of a pool and of a cluster loads it."""

import os
import signal
import time
from collections import Counter
from dataclasses import dataclass

from robust.sweeps.sweep import Task, run_sweep


@dataclass(frozen=True)
class Squared:
    square: int


def square(number, log, seconds=0.0, *_):
    """Leaves a line in a file for each attempt."""
    with log.open("a") as file:
        file.write(f"{number} {os.getpid()}\n")
    time.sleep(seconds)
    if number < 0:
        raise ValueError("negative\nsecond line")
    return Squared(number**2)


def deadly(number, log, seconds=0.0):
    """Kills its own process for some numbers: always for 3, the first time for 5."""
    made = attempts(log) if log.exists() else Counter()
    result = square(number, log, seconds)
    if number == 3 or (number == 5 and not made[5]):
        os.kill(os.getpid(), signal.SIGKILL)
    return result


def task(number, log, *more):
    return Task(f"square {number}", (number, log, *more))


def attempts(log):
    return Counter(int(line.split()[0]) for line in log.read_text().splitlines())


def sweep_of(some, work=square, **options):
    return run_sweep(some, work, record=Squared, **options)
