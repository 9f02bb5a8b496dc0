"""`robust convert`, `execute` and `demo`: files that go together, and untimely ends; the rest is recorded."""

import json
import re
import shlex
import signal
import sys
import time
from pathlib import Path

import pytest

from robust.plan.load import load_plan
from tests.cli import inputs
from tests.cli.running import NAVIGATION, answer_of, assert_one_line, command, example, stopped

# -- convert ---------------------------------------------------------------------------------------------------------


STEPS = "; found by a planner\n2.000: (GO a b)  [5.0]\n"
INEQUALITY = inputs.DOMAIN.replace(":duration (= ?duration 5)", ":duration (and (>= ?duration 1) (<= ?duration 9))")


def test_parameters_in_the_plan(tmp_path):
    files = inputs.write(tmp_path, domain=INEQUALITY, plan=STEPS).files
    target = tmp_path / "converted.stn"
    ended = command("convert", *files, "-o", target, "--parametrize", "duration:go,weight=2")
    assert ended.code == 0
    assert "parameter dur_n0 weight 2 default 5;" in target.read_text()
    assert not target.with_suffix(".toml").exists()
    envelope = json.loads(command("envelope", *files[:2], target, "--json").out)
    assert (envelope["parameters"]["dur_n0"]["lower"], envelope["parameters"]["dur_n0"]["upper"]) == ("1", "9")


def test_parameters_beside_the_plan(tmp_path):
    files = inputs.write(tmp_path, plan=STEPS).files
    target = tmp_path / "converted.stn"
    options = ["--parametrize", "duration:n0", "--parametrize", "fluent:(fuel),ub=7/3,default=2"]
    ended = command("convert", *files, "-o", target, *options)
    beside = target.with_suffix(".toml")
    assert ended.out.endswith(f"parameters: {beside}, found there by whoever reads the plan\n")
    plan = load_plan(*files[:2], target, parameter_file=beside)
    assert {one.name: one.nominal for one in plan.parameters} == {"dur_n0": 5, "fuel": 2}
    ended = command("check", *files[:2], target, "--at", "dur_n0=7", "--at", "fuel=1")
    assert (ended.code, ended.err) == (0, f"robust: took the parameters of {beside}\n")
    narrower = json.loads(
        command("envelope", *files[:2], target, "--parameter", "fluent:(fuel),ub=1,default=1", "--json").out
    )
    assert narrower["notes"] == [f"took the parameters of {beside}"]
    assert narrower["parameters"]["fuel"]["upper"] == "1"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("; nothing\n", "empty plan: found no step"),
        ("0: (go a) [5]\n", "found 'go' with 1 argument"),
        ("Plan found:\n0: (go a b [5]\n", "found '0: (go a b [5]'"),
    ],
)
def test_wrong_plans(tmp_path, text, says):
    files = inputs.write(tmp_path, plan=text).files
    ended = command("convert", *files)
    assert_one_line(ended)
    assert all(part in ended.err for part in (str(files[2]), says, "expected"))


# -- execute ---------------------------------------------------------------------------------------------------------


def test_a_plan_that_the_planner_repeats_in_vain_is_given_up(tmp_path):
    (tmp_path / "planner.py").write_text("import sys; sys.stdout.write(open(sys.argv[1]).read())", encoding="utf-8")
    steps = NAVIGATION / "steps.plan"
    planner = f"command:{sys.executable} {tmp_path / 'planner.py'} {steps} {{domain}} {{problem}}"
    file = tmp_path / "world.toml"
    file.write_text('[[draw]]\nduration = "drive"\ndistribution = "constant"\nvalue = 37\n', encoding="utf-8")
    ended = command("execute", *example(), "--world", file, "--planner", planner)
    assert ended.code == 1
    assert "nonsense" in ended.out


def test_execution_out_of_time():
    arguments = ["execute", *example(), "--runs", "1000000", "--timeout", "2.5", "--json"]
    ended = command(*arguments)
    assert ended.code == 3
    answer = answer_of(ended)
    assert answer["status"] in {"timeout", "interrupted"}
    assert 0 < len(answer["runs"]) < 1000000


def test_execution_interrupted():
    ended = stopped("execute", *example(), "--runs", "1000000", "--quiet", after=3.0, number=signal.SIGINT)
    assert ended.code == 3
    assert ended.seconds < 30


# -- demo ------------------------------------------------------------------------------------------------------------


def test_commands_of_the_tour_work_as_shown(monkeypatch):
    """What the tour says is what the commands print, up to what solvers decide.

    That is times, the number of checks, and which obligation is named where several end the same side.
    """
    before, started = Path.cwd(), time.process_time()
    lines = command("demo").out.splitlines()
    assert time.process_time() - started < 3
    assert Path.cwd() == before
    shown = [shlex.split(line.removeprefix("$ ")) for line in lines if line.startswith("$ ")]
    assert [words[0] for words in shown] == ["cd", "robust", "robust", "robust", "cd", "robust"]
    tour = {_untimed(line) for line in lines}
    sides = {side for line in lines for side in _sides(line)}
    for program, *arguments in shown:
        if program == "cd":
            monkeypatch.chdir(arguments[0])
        else:
            printed = command(*arguments).out.splitlines()
            assert [line for line in printed if not _sides(line) and _untimed(line) not in tour] == []
            assert {side for line in printed for side in _sides(line)} <= sides
    assert sides


def _sides(line: str) -> list[str]:
    """The sides in a line that says what ends them, such as `a ≥ 4, b ≥ 40: because`."""
    ended = re.fullmatch(r"  (\w+ [<≤=≥>] \S+(?:, \w+ [<≤=≥>] \S+)*): .*", line)
    return ended[1].split(", ") if ended else []


def _untimed(line: str) -> str:
    return re.sub(r"\d+ checks", "CHECKS", re.sub(r"\d+\.\d+ s", "TIME", line))
