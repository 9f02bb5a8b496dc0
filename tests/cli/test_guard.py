"""The guard on its own: what it interrupts, what it leaves alone, and what it puts back."""

import signal
import sys
import threading
import time

import pytest

from robust.cli.guard import STOPS, Cause, Guard
from tests.children import eventually
from tests.cli.running import ran


def send(guard, number=signal.SIGINT):
    """A signal to the process, as its watcher gets it; here, threads of the test runner might take it instead."""
    signal.pthread_kill(guard._watcher.ident, number)


def test_puts_everything_back_and_does_nothing_in_another_thread():
    def now():
        handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGALRM)]
        return handlers, signal.pthread_sigmask(0, []), threading.active_count()

    before = now()
    with Guard():
        assert signal.pthread_sigmask(signal.SIG_BLOCK, []) >= STOPS
    assert now() == before
    errors = []

    def work():
        try:
            with Guard() as guard, guard.working(0.01):
                time.sleep(0.5)
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert errors == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupts_work_that_waits_and_leaves_what_follows_alone(number):
    def work():
        send(guard, number)
        time.sleep(10)

    with Guard() as guard:
        started = time.monotonic()
        with pytest.raises(KeyboardInterrupt), guard.working():
            work()
        assert time.monotonic() - started < 10
        assert guard.cause is Cause.INTERRUPTED
        time.sleep(0.5)


def test_interrupts_again_what_swallowed_the_first():
    swallowed = []

    def swallow_two():
        send(guard)
        while len(swallowed) < 2:
            try:
                time.sleep(10)
            except KeyboardInterrupt as error:
                swallowed.append(error)
        time.sleep(10)

    with Guard() as guard, pytest.raises(KeyboardInterrupt), guard.working():
        swallow_two()
    assert len(swallowed) == 2


def test_ends_work_at_the_limit_and_remembers_a_signal_before_work():
    with Guard() as guard:
        with pytest.raises(KeyboardInterrupt), guard.working(0.1):
            time.sleep(10)
        assert guard.cause is Cause.TIMEOUT
        assert 0.1 < guard.age < 1
        assert guard.remaining(None) is None
        assert 8 < guard.remaining(10) <= 10
        assert 0 < guard.remaining(1e-9) <= 1e-3
    with Guard() as guard:
        send(guard)
        assert eventually(lambda: guard.cause is not None, 5)
        with pytest.raises(KeyboardInterrupt), guard.working():
            pytest.fail("work began")


STUCK = """
import os, signal, threading, time
from robust.cli.guard import Guard
with Guard() as guard, guard.working({limit}, lambda: print("best so far", flush=True) is None):
    if not {limit}:
        os.kill(os.getpid(), signal.SIGINT)
    end = time.monotonic() + 20
    while time.monotonic() < end:
        try:
            time.sleep(20)
        except KeyboardInterrupt:
            pass
"""


@pytest.mark.parametrize("limit", [None, 0.1])
def test_answers_for_work_that_does_not_end(limit):
    started = time.monotonic()
    ended = ran(sys.executable, "-c", STUCK.format(limit=limit))
    assert time.monotonic() - started < 15
    assert (ended.code, ended.out, ended.err) == (3, "best so far\n", "")
