"""What is there before anything is computed, and whatever is wrong: one line that says so; most of it is recorded."""

import os
import re
import subprocess
import sys

import pytest
from matplotlib.figure import Figure

import robust
import robust.api
from tests.cli import inputs
from tests.cli.running import COMMAND, EXAMPLES, answer_of, assert_one_line, command, environment, example, process

# -- start -----------------------------------------------------------------------------------------------------------


HEAVY = ("pysmt", "z3", "cvc5", "sympy", "matplotlib", "rich")


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["check", "--help"], ["bench", "scaling", "--help"]])
def test_nothing_heavy_is_imported(arguments):
    script = (
        "import sys; from robust.cli import run; "
        f"code = run({arguments!r}); "
        f"print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr); sys.exit(code)"
    )
    words = [sys.executable, "-W", "error", "-c", script]
    done = subprocess.run(words, check=False, capture_output=True, text=True, env=environment())
    assert (done.returncode, done.stderr) == (0, "[]\n")


def test_help_loads_little():
    """What takes time at the start is loading modules; seconds would depend on what else the machine does."""
    script = (
        "import sys; before = set(sys.modules); from robust.cli import run; run(['--help']); "
        "print(*sorted(set(sys.modules) - before), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True, env=environment())
    loaded = done.stderr.split()
    assert "robust.cli" in loaded
    assert len([name for name in loaded if name.startswith("robust")]) < 30
    assert len(loaded) < 250


# -- what is wrong ---------------------------------------------------------------------------------------------------


def test_the_unchanged_input_is_right(tmp_path):
    assert command("check", *inputs.write(tmp_path).files).code == 0


def test_plan_without_instances(tmp_path):
    ended = command("check", *inputs.write(tmp_path, plan="# nothing\n").files)
    assert_one_line(ended)
    assert "plan.stn" in ended.err
    assert "expected at least one" in ended.err


def test_what_is_to_be_said_of_the_input_is_a_line_for_each(tmp_path):
    found = inputs.write(tmp_path, problem=inputs.PROBLEM.replace("- place", "-place"))
    ended = command("check", *found.files, "--json")
    assert ended.code == 0
    answer_of(ended, "robust/check/1")
    lines = ended.err.splitlines()
    assert len(lines) == 1
    assert re.fullmatch(r"robust: warning: .*problem\.pddl:\d+:\d+: found '-place', took it for '- place'", lines[0])
    assert command("check", *found.files, "--quiet").err == ""


def test_file_name_with_line_break(tmp_path):
    domain, problem, _ = inputs.write(tmp_path).files
    assert_one_line(command("check", domain, problem, tmp_path / "a\nb.stn"))


def test_plot_that_cannot_be_written_in_the_end(monkeypatch, tmp_path):
    def fail(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", fail)
    ended = command("envelope", *example(), "--plot", tmp_path / "box.svg")
    assert ended.code == 2
    assert ended.err.startswith("robust: error: --plot: cannot write")
    assert "no space left on device" in ended.err


def test_internal_errors_are_one_line_and_the_traceback_is_on_request(monkeypatch):
    def fail(*_arguments, **_options):
        raise ZeroDivisionError("first\nsecond")

    monkeypatch.setattr(robust.api, "searching_check", fail)
    ended = command("check", *example())
    assert ended.code == 3
    assert ended.err == (
        "robust: internal error: ZeroDivisionError: first second; please report this, with the output of --verbose\n"
    )
    verbose = command("check", *example(), "--verbose")
    assert verbose.code == 3
    assert "Traceback" in verbose.err
    assert verbose.err.splitlines()[-1].startswith("robust: internal error: ZeroDivisionError")


def test_output_device_that_is_full():
    words = [*COMMAND, "check", *example()]
    with open("/dev/full", "w") as full:
        done = subprocess.run(words, stdout=full, check=False, stderr=subprocess.PIPE, text=True, env=environment())
    assert done.returncode == 2
    assert done.stderr == "robust: error: cannot write to standard output: no space left on device\n"


def closing(stream, *words):
    line = " ".join([*COMMAND, *words, stream])
    return subprocess.run(["sh", "-c", line], check=False, capture_output=True, text=True, env=environment())


def test_closed_streams():
    """Without stdout there is nobody to answer to; messages may get lost."""
    done = closing(">&-", "check", *example())
    assert done.returncode == 2
    assert done.stderr.startswith("robust: error: found standard output closed, expected somewhere to write")
    done = closing("2>&-", "check", "none", "none", "none")
    assert (done.returncode, done.stdout) == (2, "")
    for stream in ("2>&-", "2>/dev/full"):
        done = closing(stream, "check", *example("plan-flexible-wait.stn"))
        assert done.returncode == 1
        assert done.stdout.startswith("refuted")


@pytest.mark.parametrize("words", [("check", *example(), "--quiet"), ("check", *example(), "--json"), ("--help",)])
def test_an_answer_that_a_full_device_does_not_take_is_no_success(words):
    done = closing(">/dev/full", *words)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "no space left on device" in done.stderr.lower()


@pytest.mark.parametrize("words", [("stnu", "check", str(EXAMPLES / "handover" / "handover.stnu"), "-q"), ("--help",)])
def test_an_answer_that_nobody_reads_is_no_success(words):
    """As of other tools, which SIGPIPE ends without a word."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as gone:
        done = subprocess.run(
            [*COMMAND, *words], stdout=gone, stderr=subprocess.PIPE, check=False, text=True, env=environment()
        )
    assert (done.returncode, done.stderr) == (141, "")


def test_streams_without_unicode():
    ended = process("check", *example("plan-flexible-wait.stn"), PYTHONIOENCODING="ascii")
    assert ended.code == 1
    assert ended.err == ""
    assert "(charge scout) = 170" in ended.out
