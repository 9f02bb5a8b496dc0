"""Interrupts at any instant: nothing that a command has started outlives it."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest

from tests.children import eventually
from tests.cli.running import COMMAND, EXAMPLES, environment, example

MARK = "ROBUST_TEST_RUN"
PLANNER = f"command:{sys.executable} -S -c while(1):pass {{domain}} {{problem}}"
COMMANDS: dict[str, Sequence[object]] = {
    "check cvc5": ("check", *example("plan-flexible-wait.stn"), "--solver", "cvc5"),
    "envelope cvc5": ("envelope", *example(), "--solver", "cvc5"),
    "region z3": ("region", *example(), "--backend", "z3"),
    "batch": ("batch", "check", EXAMPLES / "delivery", "--jobs", 2),
    "bench": ("bench", "scaling", "--limit", 5, "--jobs", 2),
    "execute": ("execute", *example()[:2], "--planner", PLANNER),
    "certify": ("certify", *example(), "-o", os.devnull),
}
"""Commands that start processes: copies, watchers, whole commands, planners, the checker."""
STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
GRACE = 2.0
"""Seconds; who was sent SIGKILL needs a moment on a busy machine."""


def marked(mark: str) -> list[int]:
    """The processes that were started with the variable of that value, or are descendants of one."""
    found = []
    for process in Path("/proc").iterdir():
        with suppress(OSError, ValueError):
            if f"{MARK}={mark}\0".encode() in (process / "environ").read_bytes():
                found.append(int(process.name))
    return found


def survivors(words: Sequence[object], after: float, numbers: Sequence[signal.Signals], mark: str) -> list[int]:
    """What is left of a command that gets signals after some seconds."""
    environ = environment(**{MARK: mark})
    started = time.monotonic()
    with subprocess.Popen(
        [*COMMAND, *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environ
    ) as run:
        time.sleep(after)
        for number in numbers:
            run.send_signal(number)
            time.sleep(0.05)
        run.communicate(timeout=60)
    assert time.monotonic() - started < 60
    eventually(lambda: not marked(mark), GRACE)
    return marked(mark)


def hunt(number: int, seed: int, longest: float) -> None:
    """So many interrupts, at instants and by signals that are drawn; every third is told twice."""
    draw = random.Random(seed)  # noqa: S311 - no secret
    for count in range(number):
        name = draw.choice(list(COMMANDS))
        after, told = draw.uniform(0.1, longest), [draw.choice(STOPS) for _ in range(1 + (count % 3 == 0))]
        left = survivors(COMMANDS[name], after, told, f"{os.getpid()}-{seed}-{count}")
        assert not left, (name, after, told, [Path(f"/proc/{each}/cmdline").read_bytes() for each in left])


@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
def test_nothing_outlives_an_interrupt():
    hunt(3, 1, 3.0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
@pytest.mark.parametrize("seed", range(2, 7))
def test_nothing_outlives_interrupts(seed):
    hunt(100, seed, 6.0)
