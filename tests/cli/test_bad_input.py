"""Whatever is wrong with the input: one line that says where, what was found and what was expected."""

import subprocess
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import robust.api
from tests.cli import inputs
from tests.cli.bad_inputs import BAD_INPUTS, BadInput
from tests.cli.running import COMMAND, assert_one_line, command, environment, example, process

TEXTS = {"domain": inputs.DOMAIN, "problem": inputs.PROBLEM, "plan": inputs.PLAN}


def test_the_unchanged_input_is_right(tmp_path):
    assert command("check", *inputs.write(tmp_path).files).code == 0


@pytest.mark.parametrize("bad", BAD_INPUTS, ids=lambda bad: bad.name.replace(" ", "-"))
@pytest.mark.parametrize("verb", ["check", "envelope"])
def test_bad_input_is_one_line(tmp_path: Path, bad: BadInput, verb: str):
    assert bad.old in TEXTS[bad.file]
    texts = {**TEXTS, bad.file: TEXTS[bad.file].replace(bad.old, bad.new)}
    ended = command(verb, *inputs.write(tmp_path, **texts).files)
    assert_one_line(ended, bad.code)
    assert bad.place in ended.err
    assert bad.says in ended.err
    assert "expected" in ended.err


def test_missing_file(tmp_path):
    domain, problem, plan = inputs.write(tmp_path).files
    ended = command("check", domain, problem, tmp_path / "plann.stn")
    assert_one_line(ended)
    assert "plann.stn: found no such file" in ended.err
    assert plan.name in ended.err


def test_directory(tmp_path):
    domain, problem, _ = inputs.write(tmp_path).files
    ended = command("check", domain, problem, tmp_path)
    assert_one_line(ended)
    assert str(tmp_path) in ended.err
    assert "directory" in ended.err


@pytest.mark.parametrize("which", [0, 1, 2])
def test_binary_file(tmp_path, which):
    files = inputs.write(tmp_path).files
    files[which].write_bytes(bytes(range(256)) * 8)
    ended = command("check", *files)
    assert_one_line(ended)
    assert str(files[which]) in ended.err


@pytest.mark.parametrize("which", [0, 1, 2])
def test_empty_file(tmp_path, which):
    files = inputs.write(tmp_path).files
    files[which].write_text("")
    ended = command("check", *files)
    assert_one_line(ended)
    assert str(files[which]) in ended.err
    assert "expected" in ended.err


def test_plan_without_instances(tmp_path):
    ended = command("check", *inputs.write(tmp_path, plan="# nothing\n").files)
    assert_one_line(ended)
    assert "plan.stn" in ended.err
    assert "expected at least one" in ended.err


def test_files_in_the_wrong_order(tmp_path):
    domain, problem, plan = inputs.write(tmp_path).files
    assert_one_line(command("check", problem, domain, plan))
    assert_one_line(command("check", plan, domain, problem))


def test_file_name_with_line_break(tmp_path):
    domain, problem, _ = inputs.write(tmp_path).files
    assert_one_line(command("check", domain, problem, tmp_path / "a\nb.stn"))


def test_missing_argument():
    ended = command("check", "domain.pddl")
    assert_one_line(ended)
    assert "Missing argument 'PROBLEM'" in ended.err
    assert "Try 'robust check --help'." in ended.err


def test_unknown_command():
    ended = command("chekc")
    assert_one_line(ended)
    assert "Did you mean 'check'?" in ended.err


def test_smt2_directory_that_is_a_file(tmp_path):
    (tmp_path / "file").write_text("")
    ended = command("check", *example(), "--smt2", tmp_path / "file")
    assert_one_line(ended)
    assert "expected a directory" in ended.err


def test_plot_that_is_a_directory(tmp_path):
    (tmp_path / "box.svg").mkdir()
    ended = command("envelope", *example(), "--plot", tmp_path / "box.svg")
    assert_one_line(ended)
    assert "cannot write" in ended.err


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
    assert done.stderr == "robust: error: No space left on device\n"


def test_closed_streams():
    line = " ".join([*COMMAND, "check", *example(), ">&-"])
    done = subprocess.run(["sh", "-c", line], check=False, capture_output=True, text=True, env=environment())
    assert (done.returncode, done.stderr) == (0, "")


def test_streams_without_unicode():
    ended = process("check", *example("plan-flexible-wait.stn"), PYTHONIOENCODING="ascii")
    assert ended.code == 1
    assert ended.err == ""
    assert "(charge scout) = 170" in ended.out
