"""Every command that takes a plan takes what a planner prints, from a file or standard input, and says what it did."""

import json
import subprocess

import pytest

from tests.cli import inputs
from tests.cli.running import COMMAND, answer_of, assert_one_line, command, environment

LOG = """\
Planner 1.0 searching ...
0.000: (go a b) [5.000]
; Time 0.01
Best so far: nothing
0.000: (go a b) [4.999]

bye
"""
"""The last of two plans, whose duration is rounded; the domain demands 5."""


@pytest.fixture
def files(tmp_path):
    return (*inputs.write(tmp_path, plan=LOG).files[:2], tmp_path / "planner.log")


@pytest.fixture
def log(files):
    files[2].write_text(LOG)
    return files


@pytest.mark.parametrize("verb", ["check", "envelope", "region", "compare"])
def test_questions_take_logs(log, verb):
    ended = command(verb, *log, "--parameter", "duration:go")
    picked = "picked plan 2 of 2 (line 5); skipped 3 lines that are no step; 1 duration moved, by at most 0.001"
    assert (ended.code, ended.err) == (0, f"robust: {log[2]}: {picked}; made a network of 1 constraint\n")
    assert command(verb, *log, "--parameter", "duration:go", "--quiet").err == ""
    answer = answer_of(command(verb, *log, "--parameter", "duration:go", "--json"))
    assert answer["notes"] == [f"{log[2]}: {picked}; made a network of 1 constraint"]
    assert "dur_n0" in answer["parameters"]


def test_convert_and_execute_say_what_they_picked(log):
    picked = f"robust: {log[2]}: picked plan 1 of 2 (line 2); skipped 3 lines that are no step\n"
    assert command("convert", *log, "--plan-number", "1").err.startswith(picked)
    assert command("execute", *log, "--plan-number", "1").err == picked


def test_exactness_can_be_asked_for(log):
    ended = command("check", *log, "--tolerance", "0")
    assert_one_line(ended, 1)
    assert "the duration of (go a b) would have to change by 0.001, which --tolerance 0.001 allows" in ended.err


def test_standard_input_is_a_plan(log):
    words = ["check", *map(str, log[:2]), "-"]
    for text, code, said in (
        (LOG, 0, "<stdin>: picked plan 2 of 2"),
        (inputs.PLAN, 0, ""),
        ("nothing\n", 2, "<stdin>:2: empty plan: found no step"),
        ("0: (go a b [5]\n", 2, "<stdin>:1:1: found '0: (go a b [5]'"),
    ):
        done = subprocess.run(
            [*COMMAND, *words], input=text, env=environment(), capture_output=True, text=True, check=False
        )
        assert done.returncode == code
        assert said in done.stderr
        assert done.stderr.count("\n") == (1 if said else 0)


def test_a_number_that_no_plan_has(log):
    ended = command("envelope", *log, "--plan-number", "3")
    assert_one_line(ended)
    assert f"{log[2]}: found 2 plans, expected one with number 3" in ended.err
    assert_one_line(command("envelope", *log, "--plan-number", "0"))


def test_a_network_is_told_by_its_text(log, tmp_path):
    network = tmp_path / "network.txt"
    network.write_text(inputs.PLAN)
    whole = json.loads(command("check", *log[:2], network, "--json").out)
    assert (whole["verdict"], "notes" in whole) == ("proved", False)


def test_certificates_of_steps_are_about_the_network_beside_them(log, tmp_path):
    certificate, network = tmp_path / "steps.cert", tmp_path / "steps.stn"
    ended = command("certify", *log, "-o", certificate)
    assert ended.code == 0
    assert ended.err.endswith(f"; 1 duration moved, by at most 0.001; the certificate is about {network}\n")
    ended = command("verify", certificate, *log[:2], network)
    assert (ended.code, ended.out.splitlines()[0]) == (0, "established: valid for every schedule, epsilon = 1/1000")
