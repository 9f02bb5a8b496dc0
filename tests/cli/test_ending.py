"""What a run has started and made is gone when it ends, however that happens; files that never come do not hold it."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.children import eventually, is_running
from tests.cli.running import COMMAND, LOAD, NAVIGATION, answer_of, environment, example, process

PLANNER = """
import os, sys, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        with open(sys.argv[1] + ".part", "w") as file:
            file.write(str(os.getpid()))
        os.rename(sys.argv[1] + ".part", sys.argv[1])
        time.sleep(300)
    os._exit(0)
while True:
    print("thinking " * 1000)
    time.sleep(0.001)
"""
"""A planner whose work goes on in a process that has left it, while it prints without end (some MB a second)."""


class Run:
    """`robust execute` with that planner; its temporary files are below `temporary`."""

    def __init__(self, folder: Path, *options: object) -> None:
        self.told, self.temporary = folder / "told", folder / "temporary"
        self.temporary.mkdir()
        planner = folder / "planner.py"
        planner.write_text(PLANNER, encoding="utf-8")
        template = f"command:{sys.executable} -S {planner} {self.told} {{domain}} {{problem}}"
        files = (NAVIGATION / "domain.pddl", NAVIGATION / "problem.pddl")
        words = [*COMMAND, "execute", *files, "--planner", template, "--planner-limit", 200, *options]
        self.words = list(map(str, words))
        self.environment = environment(TMPDIR=str(self.temporary))

    def start(self, *before: str) -> subprocess.Popen[str]:
        """Start it, by a command that ends by running it."""
        words = [*before, *self.words]
        return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=self.environment)

    def is_planning(self) -> bool:
        return eventually(self.told.exists, 60) and any(self.temporary.iterdir())

    def leaves_nothing(self) -> bool:
        planner = int(self.told.read_text(encoding="utf-8"))
        return eventually(lambda: not is_running(planner)) and eventually(lambda: not any(self.temporary.iterdir()))


@pytest.fixture
def run(tmp_path) -> Run:
    return Run(tmp_path)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_planner_and_all_that_it_has_started(run, number):
    with run.start() as process:
        assert run.is_planning()
        process.send_signal(number)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 3
    assert "Traceback" not in errors
    assert run.leaves_nothing()


def test_nothing_is_left_of_a_run_that_is_killed(run):
    with run.start() as process:
        assert run.is_planning()
        process.kill()
    assert run.leaves_nothing()


def test_a_time_limit_ends_the_planner_and_all_that_it_has_started(tmp_path):
    run = Run(tmp_path, "--timeout", 4 * LOAD)
    with run.start() as process:
        assert run.is_planning()
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 3
    assert "Traceback" not in errors
    assert run.leaves_nothing()


@pytest.mark.skipif(sys.platform != "linux", reason="terminals end differently elsewhere")
def test_a_terminal_that_closes_ends_the_run(run):
    """The run gets SIGHUP, and has nowhere to print."""
    child, terminal = os.forkpty()
    if child == 0:
        os.execvpe(run.words[0], run.words, run.environment)  # noqa: S606
    assert run.is_planning()
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 3
    assert run.leaves_nothing()


def test_sighup_stays_ignored_where_it_was(run):
    with run.start("nohup") as process:
        assert run.is_planning()
        process.send_signal(signal.SIGHUP)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(2)
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)
    assert process.returncode == 3
    assert run.leaves_nothing()


@pytest.fixture
def fifo(tmp_path) -> Path:
    """A file that never comes."""
    path = tmp_path / "certificate"
    os.mkfifo(path)
    return path


def test_a_time_limit_ends_verify_of_a_file_that_never_comes(fifo):
    ended = process("verify", fifo, *example(), "--timeout", 1, "--json")
    assert ended.code == 3
    assert answer_of(ended)["error"]["kind"] == "timeout"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_first_signal_ends_verify_of_a_file_that_never_comes(fifo, number):
    with subprocess.Popen(
        [*COMMAND, "verify", str(fifo), *example()],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    ) as run:
        with pytest.raises(subprocess.TimeoutExpired):
            run.wait(2 * LOAD)
        run.send_signal(number)
        out, errors = run.communicate(timeout=3 * LOAD)
    assert (run.returncode, out, errors) == (3, "", "robust: interrupted\n")
