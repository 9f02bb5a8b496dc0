"""Processes are measured one by one, killed at the limit, and all ended when asked to stop."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Thread

import pytest

from robust.bench.process import Processes, StoppedError
from robust.errors import RobustError


def python(code: str) -> list[str]:
    return [sys.executable, "-S", "-c", code]


def eventually(holds: Callable[[], bool], seconds: float = 10) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if holds():
            return True
        time.sleep(0.02)
    return holds()


def is_running(pid: int) -> bool:
    """Whether the process exists and is not only waiting to be collected."""
    with suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    return False


def test_output_exit_code_and_time() -> None:
    code = "import sys, time; print('out'); print('first\\nlast', file=sys.stderr); time.sleep(0.2); sys.exit(3)"
    measured = Processes().run(python(code))
    assert (measured.stdout, measured.exit_code, measured.timed_out) == ("out\n", 3, False)
    assert measured.last_error == "last"
    assert 0.2 <= measured.seconds < 5


def test_a_silent_failure_still_has_a_message() -> None:
    assert Processes().run(python("import os; os._exit(7)")).last_error == "exit code 7 without a message"


def test_more_output_than_a_pipe_holds() -> None:
    measured = Processes().run(python("import sys; print('x' * 10**6); print('y' * 10**6, file=sys.stderr)"))
    assert (len(measured.stdout), len(measured.stderr)) == (10**6 + 1, 10**6 + 1)


def test_memory_is_that_of_the_process_and_not_of_its_parent() -> None:
    ballast = bytearray(300 * 2**20)
    processes = Processes()
    assert processes.run(python("pass")).memory_mb < 100
    assert 200 < processes.run(python("x = bytearray(200 * 2**20)")).memory_mb < 300
    assert processes.run(python("pass")).memory_mb < 100  # the maximum over earlier ones does not count
    assert len(ballast) > 0


def test_the_limit_kills() -> None:
    started = time.monotonic()
    measured = Processes().run(python("import time; print('early', flush=True); time.sleep(60)"), limit=0.5)
    assert measured.timed_out
    assert measured.exit_code < 0
    assert measured.stdout == "early\n"
    assert 0.5 <= measured.seconds < 10
    assert time.monotonic() - started < 20
    assert measured.memory_mb > 1


def test_the_limit_kills_what_the_process_has_started(tmp_path: Path) -> None:
    child = f"import os, time; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-S', '-c', {child!r}])"
    assert Processes().run(python(code), limit=2).timed_out
    pid = int((tmp_path / "pid").read_text(encoding="utf-8"))
    assert eventually(lambda: not is_running(pid))


def test_a_command_that_does_not_exist(tmp_path: Path) -> None:
    with pytest.raises(RobustError, match=r"cannot run.*absent"):
        Processes().run([str(tmp_path / "absent")])


def test_stop_ends_running_processes_and_refuses_new_ones(tmp_path: Path) -> None:
    processes, outcomes = Processes(), list[str]()
    code = f"import os, time; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(60)"

    def run() -> None:
        try:
            processes.run(python(code))
        except StoppedError:
            outcomes.append("stopped")

    thread = Thread(target=run)
    thread.start()
    assert eventually((tmp_path / "pid").exists)
    assert eventually(lambda: (tmp_path / "pid").read_text(encoding="utf-8") != "")
    processes.stop()
    thread.join(10)
    assert outcomes == ["stopped"]
    pid = int((tmp_path / "pid").read_text(encoding="utf-8"))
    assert eventually(lambda: not is_running(pid))
    with pytest.raises(StoppedError):
        processes.run(python("pass"))


def test_children_end_with_their_parent(tmp_path: Path) -> None:
    child = f"import os, time; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    code = f"import sys; from robust.bench.process import Processes; Processes().run([sys.executable, '-c', {child!r}])"
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    with subprocess.Popen([sys.executable, "-c", code], env=environment) as parent:
        assert eventually(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text(encoding="utf-8") != "")
        parent.kill()
    pid = int((tmp_path / "pid").read_text(encoding="utf-8"))
    assert eventually(lambda: not is_running(pid))


def test_no_descriptor_is_left_open() -> None:
    processes = Processes()
    processes.run(python("pass"))
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        processes.run(python("pass"))
    assert len(os.listdir("/proc/self/fd")) == before
