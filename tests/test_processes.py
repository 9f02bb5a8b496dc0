"""Commands are measured one by one, and end with all they have started: at a limit, when stopped, with their parent."""

import os
import signal
import subprocess
import sys
import time
import tracemalloc
from functools import partial
from pathlib import Path
from threading import Thread

import pytest

from robust.errors import SolverError
from robust.processes import KEPT, Processes, StoppedError
from robust.smt.limits import Deadline, OutOfTimeError, from_copy, stream_from_copy, uninterrupted
from robust.watcher import CANNOT_START
from tests.children import WAIT, Told, eventually, interrupted_after, is_running
from tests.cli.running import environment, ran
from tests.tables import text_in_data


def python(code):
    return [sys.executable, "-S", "-c", code]


def run(code, seconds=None, **options):
    return Processes().run(python(code), Deadline.after(seconds), **options)


@pytest.fixture
def told(tmp_path):
    return Told(tmp_path)


def test_output_exit_code_time_and_surroundings_and_a_command_that_does_not_exist(tmp_path):
    code = "import os; print(os.getcwd(), os.environ['ROBUST_TEST'], 'PATH' in os.environ, os.read(0, 9))"
    ended = Processes().run(python(code), folder=tmp_path, variables={"ROBUST_TEST": "yes"})
    assert ended.stdout == f"{tmp_path} yes True b''\n"
    ended = run("import sys, time; print('out'); print('first\\nlast', file=sys.stderr); time.sleep(0.2); sys.exit(3)")
    assert (ended.stdout, ended.exit_code, ended.timed_out, ended.last_line) == ("out\n", 3, False, "last")
    assert 0.2 <= ended.seconds < 5
    assert run("import os; os._exit(7)").last_line == "no message"
    assert run("print('so far'); import os; print('note: none', file=os.sys.stderr)").last_line == "so far"
    killed = run("import os; os.kill(os.getpid(), 11)")
    assert (killed.exit_code, killed.timed_out) == (-11, False)
    ended = run("import sys; print('x' * 10**6); print('y' * 10**6, file=sys.stderr)")  # more than a pipe holds
    assert (len(ended.stdout), len(ended.stderr)) == (10**6 + 1, 10**6 + 1)
    ended = Processes().run([str(tmp_path / "absent")])
    assert ended.exit_code == CANNOT_START
    assert ended.last_line == f"cannot start '{tmp_path / 'absent'}': No such file or directory"


def test_the_end_of_what_is_printed_is_kept_and_no_more():
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        ended = run("for n in range(4 * 10**5): print(f'line {n:0244}')\nprint('the end')")
        assert tracemalloc.get_traced_memory()[1] - before < 5 * KEPT
    finally:
        tracemalloc.stop()
    lines = ended.stdout.splitlines()
    assert KEPT * 0.9 < len(ended.stdout) <= KEPT
    assert lines[-2:] == [f"line {4 * 10**5 - 1:0244}", "the end"]
    assert all(len(line) == 249 for line in lines[:-1])
    assert ended.exit_code == 0


def test_signals_are_those_of_a_new_process():
    """Blocked or ignored ones are not inherited from here."""
    usual = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
    try:
        assert run("import signal as s; print(s.pthread_sigmask(s.SIG_BLOCK, []))").stdout == "set()\n"
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, usual)
    assert Processes().run(["grep", "SigIgn", "/proc/self/status"]).stdout.split() == ["SigIgn:", "0" * 16]


def test_memory_is_that_of_the_process_and_not_of_its_parent_and_has_a_limit():
    ballast = bytearray(300 * 2**20)
    assert run("pass").memory_mb < 100
    assert 200 < run("x = bytearray(200 * 2**20)").memory_mb < 300
    assert run("pass").memory_mb < 100  # the maximum over earlier ones does not count
    assert len(ballast) > 0
    code = "x = bytearray(400 * 2**20)"
    assert run(code, memory_mb=1000).exit_code == 0
    assert run(code, memory_mb=300).last_line == "MemoryError"


def test_the_limits_of_time_and_of_the_size_of_files(tmp_path):
    filling = ["sh", "-c", "exec head -c 300M /dev/zero > zeros"]
    ended = Processes().run(filling, Deadline.after(60), folder=tmp_path)
    assert (ended.exit_code, ended.timed_out) == (-signal.SIGXFSZ, False)
    started = time.monotonic()
    ended = run(f"print('early', flush=True); {WAIT}", 0.5)
    assert (ended.timed_out, ended.exit_code, ended.stdout) == (True, -signal.SIGKILL, "early\n")
    assert 0.1 <= ended.seconds < 10
    assert ended.memory_mb > 1
    ended = Processes().run(["yes", "x" * 999], Deadline.after(1))
    assert ended.timed_out
    assert len(ended.stdout) <= KEPT
    assert set(ended.stdout.splitlines()[:-1]) == {"x" * 999}
    assert time.monotonic() - started < 20


@pytest.mark.parametrize("session", [False, True], ids=["same session", "session of its own"])
@pytest.mark.parametrize("limit", [None, 2], ids=["ends by itself", "at the limit"])
def test_descendants_end_with_the_command(told, session, limit):
    """Nor is one waited for that keeps the command's output open."""
    code = f"""
import os, subprocess, sys, time
child = subprocess.Popen([sys.executable, '-S', '-c', {told.code!r}], start_new_session={session})
while not (os.path.exists({str(told.path)!r}) and open({str(told.path)!r}).read()):
    time.sleep(0.02)
time.sleep({0 if limit is None else 60})
"""
    started = time.monotonic()
    ended = run(code, limit)
    assert time.monotonic() - started < 30
    assert ended.timed_out == (limit is not None)
    assert told.gone()


def test_stop_ends_running_commands_and_refuses_new_ones(told):
    processes, outcomes = Processes(), []

    def work():
        try:
            processes.run(python(told.code))
        except StoppedError:
            outcomes.append("stopped")

    thread = Thread(target=work)
    thread.start()
    assert told.begun()
    processes.stop()
    thread.join(10)
    assert outcomes == ["stopped"]
    assert told.gone()
    with pytest.raises(StoppedError):
        processes.run(python("pass"))


def parent(call):
    """A process that makes that call."""
    code = "import sys; from pathlib import Path; from robust.processes import *; from robust.smt.limits import *; "
    return subprocess.Popen([sys.executable, "-c", code + call], env=environment())


def test_copies_end_with_their_parent(told):
    with parent(f"from_copy(lambda: exec({told.code!r}), Deadline(), 'x')") as process:
        assert told.begun()
        process.kill()
    assert told.gone()


FORKING_AWAY = text_in_data(__file__, "forking-away.txt")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_those_who_fork_away_end_with_the_parent_and_so_does_its_folder(told, tmp_path, number):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    (scratch / "file").touch()
    away = FORKING_AWAY.format(told=told.code.replace("; ", "\n        "))
    with parent(f"Processes().run([sys.executable, '-S', '-c', {away!r}], scratch=Path({str(scratch)!r}))") as process:
        assert told.begun()
        assert scratch.exists()
        process.send_signal(number)
    assert told.gone()
    assert eventually(lambda: not scratch.exists())


def test_a_folder_stays_as_long_as_the_parent_lives(told, tmp_path):
    for deadline, code in ((Deadline.after(0.3), WAIT), (Deadline(), "pass")):
        Processes().run(python(code), deadline, scratch=tmp_path)
        assert tmp_path.exists()
    with pytest.raises(KeyboardInterrupt), interrupted_after(1.5):
        Processes().run(python(told.code), scratch=tmp_path)
    assert tmp_path.exists()
    assert told.gone()


def test_no_descriptor_and_no_child_is_left():
    def children():
        return set(Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="ascii").split())

    run("pass")
    before, others = len(os.listdir("/proc/self/fd")), children()
    for _ in range(3):
        run("pass")
        assert from_copy(lambda: 1, Deadline(), "counting") == 1
    assert len(os.listdir("/proc/self/fd")) <= before
    assert children() <= others  # of other tests


@pytest.mark.parametrize("start", ["fork", "command"])
def test_an_interrupt_while_a_child_starts_leaves_none(told, monkeypatch, start):
    """It comes when the child is there, and its number is not known yet."""
    owner, name = (os, "fork") if start == "fork" else (subprocess.Popen, "__init__")
    original = getattr(owner, name)

    def begin(*given, **options):
        child = original(*given, **options)
        if child != 0:
            assert told.begun()
            signal.raise_signal(signal.SIGINT)
        return child

    monkeypatch.setattr(owner, name, begin)
    call = partial(from_copy, partial(exec, told.code), Deadline(), "waiting")
    if start == "command":
        call = partial(Processes().run, python(told.code))
    with pytest.raises(KeyboardInterrupt):
        call()
    assert not is_running(int(told.path.read_text(encoding="utf-8")))


def test_a_copy_whose_parent_dies_at_once_does_not_begin(told):
    """The parent is gone before the copy can ask the system to end with it."""
    code = f"""
import ctypes, os, time
from robust.smt import limits
class Late:
    def __init__(self, _):
        time.sleep(1)
    def prctl(self, *_):
        pass
fork, ctypes.CDLL = os.fork, Late
os.fork = lambda: fork() and os._exit(0)
limits.from_copy(lambda: exec({told.code!r}), limits.Deadline(), "x")
"""
    ran(sys.executable, "-c", code, stdout=None, stderr=None)
    assert not eventually(told.path.exists, 2)


def test_the_copy_is_ended_by_the_deadline_and_by_interruption_and_its_failures_are_told():
    def endless():
        yield 1
        while True:
            pass

    started = time.monotonic()
    items = stream_from_copy(endless, Deadline.after(0.3), "waiting")
    assert next(items) == 1
    with pytest.raises(OutOfTimeError):
        next(items)
    items = stream_from_copy(endless, Deadline(), "waiting")
    assert next(items) == 1
    with pytest.raises(KeyboardInterrupt), interrupted_after(0.3):
        next(items)
    assert time.monotonic() - started < 20

    def failing():
        yield 1
        raise ValueError("not this one")

    items = stream_from_copy(failing, Deadline(), "dividing")
    assert next(items) == 1
    with pytest.raises(SolverError, match="dividing failed: ValueError: not this one"):
        next(items)
    with pytest.raises(SolverError, match="dividing ended without an answer, with exit code 0"):
        from_copy(lambda: os._exit(0), Deadline(), "dividing")
    assert list(stream_from_copy(lambda: [1, "two"], Deadline(), "counting")) == [1, "two"]
    assert len(from_copy(lambda: bytes(3 * 2**20), Deadline(), "copying")) == 3 * 2**20


def test_a_signal_that_comes_while_signals_are_being_blocked_leaves_none_blocked(monkeypatch):
    usual, block = signal.pthread_sigmask(signal.SIG_BLOCK, ()), signal.pthread_sigmask

    def interrupted(how, signals):
        before = block(how, signals)
        if how == signal.SIG_BLOCK and signals:
            raise KeyboardInterrupt  # as Python does for a signal that was pending
        return before

    monkeypatch.setattr(signal, "pthread_sigmask", interrupted)
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        pass
    monkeypatch.undo()
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == usual
