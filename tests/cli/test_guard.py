"""The guard on its own: what it interrupts, what it leaves alone, and what it puts back."""

import signal
import subprocess
import sys
import threading
import time

import pytest

from robust.cli.guard import STOPS, Cause, Guard
from tests.cli.running import environment


def send(guard: Guard, number: signal.Signals = signal.SIGINT) -> None:
    """A signal to the process, as its watcher gets it; here, threads of the test runner might take it instead."""
    signal.pthread_kill(guard._watcher.ident, number)


def test_puts_everything_back():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM), signal.pthread_sigmask(0, [])
    threads = threading.active_count()
    with Guard():
        assert signal.pthread_sigmask(signal.SIG_BLOCK, []) >= STOPS
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM), signal.pthread_sigmask(0, [])) == before
    assert threading.active_count() == threads


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupts_work_that_waits_and_leaves_what_follows_alone(number):
    with Guard() as guard:
        started = time.monotonic()
        with pytest.raises(KeyboardInterrupt), guard.working():  # noqa: PT012 - the signal comes while it works
            send(guard, number)
            time.sleep(10)
        assert time.monotonic() - started < 10
        assert guard.cause is Cause.INTERRUPTED
        time.sleep(0.5)


def test_interrupts_again_what_swallowed_the_first():
    swallowed = []

    def swallow_two(guard):
        send(guard)
        while len(swallowed) < 2:
            try:
                time.sleep(10)
            except KeyboardInterrupt as error:
                swallowed.append(error)
        time.sleep(10)

    with Guard() as guard, pytest.raises(KeyboardInterrupt), guard.working():
        swallow_two(guard)
    assert len(swallowed) == 2


def test_ends_work_at_the_limit():
    with Guard() as guard:
        with pytest.raises(KeyboardInterrupt), guard.working(0.1):
            time.sleep(10)
        assert guard.cause is Cause.TIMEOUT
        assert 0.1 < guard.age < 1


def test_signal_before_work_is_remembered():
    with Guard() as guard:
        send(guard)
        deadline = time.monotonic() + 5
        while guard.cause is None and time.monotonic() < deadline:
            time.sleep(0.01)
        with pytest.raises(KeyboardInterrupt), guard.working():
            pytest.fail("work began")


def test_remaining():
    guard = Guard()
    assert guard.remaining(None) is None
    assert 9 < (guard.remaining(10) or 0) <= 10
    assert 0 < (guard.remaining(1e-9) or 0) <= 1e-3


def test_does_nothing_in_another_thread():
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


STUCK = """
import signal, time
from robust.cli.guard import Guard
with Guard() as guard, guard.working({limit}, lambda: print("best so far", flush=True) is None):
    end = time.monotonic() + 20
    while time.monotonic() < end:
        try:
            print("ready", flush=True)
            time.sleep(20)
        except KeyboardInterrupt:
            pass
"""


@pytest.mark.parametrize("limit", ["None", "0.1"])
def test_answers_for_work_that_does_not_end(limit):
    words = [sys.executable, "-c", STUCK.format(limit=limit)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment()) as stuck:
        assert stuck.stdout.readline() == "ready\n"
        if limit == "None":
            stuck.send_signal(signal.SIGINT)
        started = time.monotonic()
        out, err = stuck.communicate(timeout=10)
        assert time.monotonic() - started < 9
    assert stuck.returncode == 3
    assert out.endswith("best so far\n")
    assert err == ""
