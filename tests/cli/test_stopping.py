"""Ctrl-C, SIGTERM, time limits and readers that leave: an answer within a second, and no traceback."""

import os
import pty
import signal
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path

import pytest

from benchmarks.generators.sizes import write_instance
from tests.cli.running import COMMAND, LOAD, answer_of, environment, example, process, stopped

WITHIN = 3 * LOAD
STARTED = 3 * LOAD
"""Seconds until a process has read a small plan and decided its nominal point, generously."""

ENDLESS = ("--method", "irr", "--beta", f"1/{10**299}")


@pytest.fixture(scope="module")
def long(tmp_path_factory) -> tuple[Path, Path, Path]:
    """A plan whose box takes much longer than any of these tests."""
    return write_instance(tmp_path_factory.mktemp("long"), 4, 4)


@pytest.fixture(scope="module")
def slow_to_encode(tmp_path_factory) -> tuple[Path, Path, Path]:
    """A plan that takes long before its first query is even asked."""
    return write_instance(tmp_path_factory.mktemp("slow"), 60, 60)


def assert_prompt(ended):
    assert ended.code == 3, ended
    assert "Traceback" not in ended.err
    assert "Exception ignored" not in ended.err
    assert ended.seconds < WITHIN


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_best_box_so_far(long, number):
    ended = stopped("envelope", *long, *ENDLESS, "--verbose", after="check 9:", number=number)
    assert_prompt(ended)
    assert "start_4" in ended.out
    assert "interrupted: the best box so far; sound, not maximal" in ended.out


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_the_best_box_so_far_as_json(long, solver):
    ended = stopped("envelope", *long, *ENDLESS, "--json", "--solver", solver, "--verbose", after="check 3:")
    assert_prompt(ended)
    answer = answer_of(ended)
    assert (answer["schema"], answer["status"]) == ("robust/envelope/1", "interrupted")
    assert answer["verified"]
    assert answer["checks"] >= 3
    widths = [Fraction(one["upper"]) - Fraction(one["lower"]) for one in answer["parameters"].values()]
    assert max(widths) > 0


def test_interrupted_while_encoding(slow_to_encode):
    ended = stopped("envelope", *slow_to_encode, "--json", after=1.5)
    assert_prompt(ended)
    answer = answer_of(ended)
    if answer["schema"] == "robust/envelope/1":
        assert (answer["status"], answer["verified"], answer["checks"]) == ("interrupted", False, 0)
    else:
        assert answer["error"]["kind"] == "interrupted"


@pytest.mark.parametrize("after", [0.3, 0.6])
def test_interrupted_while_starting(slow_to_encode, after):
    ended = stopped("check", *slow_to_encode, after=after * LOAD)
    assert_prompt(ended)
    assert ended.err in {"robust: interrupted\n", ""}
    assert (ended.out == "") == (ended.err != "")
    if ended.out:
        assert ended.out.startswith("unknown: interrupted\n")


def test_time_limit_of_envelope(long):
    started = time.perf_counter()
    ended = process("envelope", *long, *ENDLESS, "--timeout", STARTED, "--json")
    assert time.perf_counter() - started < STARTED + WITHIN
    answer = answer_of(ended)
    assert (ended.code, answer["status"], answer["verified"]) == (3, "timeout", True)


def test_time_limit_while_encoding(slow_to_encode):
    started = time.perf_counter()
    ended = process("check", *slow_to_encode, "--timeout", "1.5", "--json")
    assert time.perf_counter() - started < 1.5 + WITHIN
    answer = answer_of(ended)
    assert ended.code == 3
    if answer["schema"] == "robust/check/1":
        assert (answer["verdict"], answer["timeout"], answer["interrupted"]) == ("unknown", True, False)


def test_time_limit_while_reading():
    ended = process("check", *example(), "--timeout", "1e-9")
    assert ended.code == 3
    assert ended.err in {"robust: out of time\n", ""}
    answer = answer_of(process("check", *example(), "--timeout", "1e-9", "--json"))
    assert answer["schema"] == "robust/error/1" or answer["timeout"]


@pytest.mark.parametrize("closed", ["check", "envelope", "demo"])
def test_reader_that_leaves(closed):
    words = [*COMMAND, closed, *(() if closed == "demo" else example("plan-flexible-wait.stn"))]
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as stream:
        done = subprocess.run(
            words, check=False, stdout=stream, stderr=subprocess.PIPE, text=True, env=environment(), timeout=60
        )
    assert done.stderr == ""
    assert done.returncode == 141  # as of other tools, which SIGPIPE ends


def on_terminal(*arguments: object) -> tuple[int, str, str]:
    """Run with stderr on a terminal, as in `robust ... > file`; exit code, stdout and what the terminal got."""
    ours, theirs = pty.openpty()
    words = [*COMMAND, *map(str, arguments)]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=theirs, text=True, env=environment(TERM="xterm-256color")
    ) as running:
        os.close(theirs)
        shown = b""
        while True:
            try:
                chunk = os.read(ours, 65536)
            except OSError:
                break
            if not chunk:
                break
            shown += chunk
        out, _ = running.communicate(timeout=30)
    os.close(ours)
    return running.returncode, out, shown.decode("utf-8", "replace")


@pytest.mark.skipif(sys.platform != "linux", reason="terminals end differently elsewhere")
def test_progress_on_a_terminal_only(long):
    code, out, shown = on_terminal("envelope", *long, *ENDLESS, "--timeout", STARTED)
    assert code == 3
    assert "start_1" in shown
    assert "Δ = " in shown
    assert "Ctrl-C keeps this box" in shown
    assert "\x1b" not in out
    assert "out of time: the best box so far" in out
    assert on_terminal("check", *long, "--quiet")[2] == ""
