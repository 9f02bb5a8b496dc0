"""`robust stnu dispatch`, `convert`, `execute` and `demo`: what the recorded answers do not show."""

import re
import shlex
import sys
import time
from pathlib import Path

import pytest

from robust import stnu
from tests.cli import inputs
from tests.cli.running import NAVIGATION, answer_of, command, example

FINE, LATE = (inputs.INPUTS / "networks" / f"{name}.json" for name in ("fine", "late"))


def test_executions_of_networks_follow_from_their_seeds():
    ended = command("stnu", "dispatch", FINE, LATE, "--runs", "20", "--seed", "7", "--json")
    fine, late = answer_of(ended, "robust/stnu-dispatch/1")["results"]
    assert (ended.code, late["executions"]) == (1, [])
    assert [run["seed"] for run in fine["executions"]] == list(range(7, 27))
    assert not any(run["violated"] for run in fine["executions"])
    (again,) = answer_of(command("stnu", "dispatch", FINE, "--seed", "9", "--json"))["results"]
    assert again["executions"] == [fine["executions"][2]]


@pytest.mark.parametrize("words", [(example(), "plan.json"), (example("steps.plan"), "plan.stnu")])
def test_the_network_of_a_plan_is_controllable(tmp_path, words):
    files, name = words
    box = tmp_path / "box.json"
    box.write_text(command("envelope", *example(), "--json").out, encoding="utf-8")
    options = ("--box", box) if name == "plan.json" else ("-o", tmp_path / "plan.stn")
    assert command("convert", *files, "--stnu", tmp_path / name, *options).code == 0
    network = stnu.load(tmp_path / name)
    assert stnu.check(network).is_controllable
    if name == "plan.json":
        drive = next(link for link in network.contingents if link.source == "drive_1.start")
        assert (drive.lower, drive.upper, network.origin) == (25, 36, "0")


@pytest.mark.parametrize(("verb", "key"), [("check", "verdict"), ("repair", "repair")])
def test_networks_out_of_time(verb, key):
    """The limit passes while the file is read, or when nothing is known."""
    ended = command("stnu", verb, LATE, "--timeout", "0.000001", "--json")
    answer = answer_of(ended)
    assert ended.code == 3
    if "error" in answer:
        assert answer["error"]["kind"] == "timeout"
    else:
        assert (answer["status"], answer["results"][0][key]) == ("timeout", "unknown")


def test_a_plan_that_the_planner_repeats_in_vain_is_given_up(tmp_path):
    (tmp_path / "planner.py").write_text("import sys; sys.stdout.write(open(sys.argv[1]).read())", encoding="utf-8")
    planner = f"command:{sys.executable} {tmp_path / 'planner.py'} {NAVIGATION / 'steps.plan'} {{domain}} {{problem}}"
    world = tmp_path / "world.toml"
    world.write_text('[[draw]]\nduration = "drive"\ndistribution = "constant"\nvalue = 37\n', encoding="utf-8")
    ended = command("execute", *example(), "--world", world, "--planner", planner)
    assert ended.code == 1
    assert "nonsense" in ended.out


def sides(line):
    """The sides in a line that says what ends them, such as `a ≥ 4, b ≥ 40: because`."""
    ended = re.fullmatch(r"  (\w+ [<≤=≥>] \S+(?:, \w+ [<≤=≥>] \S+)*): .*", line)
    return ended[1].split(", ") if ended else []


def untimed(line):
    return re.sub(r"\d+ checks", "CHECKS", re.sub(r"\d+\.\d+ s", "TIME", line))


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
    tour = {untimed(line) for line in lines}
    ends = {side for line in lines for side in sides(line)}
    for program, *arguments in shown:
        if program == "cd":
            monkeypatch.chdir(arguments[0])
        else:
            printed = command(*arguments).out.splitlines()
            assert [line for line in printed if not sides(line) and untimed(line) not in tour] == []
            assert {side for line in printed for side in sides(line)} <= ends
    assert ends
