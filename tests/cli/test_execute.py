"""`robust execute`: timelines, tables, JSON, drawings, and what is wrong with the input."""

import signal
import sys

import pytest

from tests.cli.running import NAVIGATION, answer_of, command, example, stopped

WORLD = """
[[draw]]
duration = "drive"
distribution = "normal"
deviation = 4
minimum = 10
"""
PLANNER = """
import sys
sys.stdout.write(open(sys.argv[1]).read())
"""


@pytest.fixture
def world(tmp_path):
    file = tmp_path / "world.toml"
    file.write_text(WORLD, encoding="utf-8")
    return file


@pytest.fixture
def planner(tmp_path):
    """A planner that always has the shipped plan."""
    program = tmp_path / "planner.py"
    program.write_text(PLANNER, encoding="utf-8")
    return f"command:{sys.executable} {program} {NAVIGATION / 'steps.plan'} {{domain}} {{problem}}"


def test_a_timeline(world):
    ended = command("execute", *example("steps.plan"), "--parametrize", "duration:drive", "--world", world)
    assert ended.code in {0, 1}
    lines = ended.out.splitlines()
    assert lines[0].split()[0] == ("succeeded" if ended.code == 0 else "failed")
    assert "plan 1, from 0: dynamically controllable: the plan succeeds while observations are inside" in lines
    assert "  dur_n0 in [1, 34.5]" in lines
    assert "         0  start     n0 (drive scout base ridge)" in lines


def test_without_a_world_everything_is_as_planned():
    ended = command("execute", *example())
    assert (ended.code, ended.out.splitlines()[0]) == (0, "succeeded at 114 with 0 re-plans (dreex, seed 0)")
    assert command("execute", *example(), "--quiet").out.splitlines() == ended.out.splitlines()[:1]


def test_many_runs_make_a_table(world):
    arguments = ["execute", *example("steps.plan"), "--parametrize", "duration:drive", "--world", world, "--runs", "12"]
    ended = command(*arguments, "--json")
    answer = answer_of(ended)
    summary = answer["summary"]
    assert (answer["status"], summary["runs"], len(answer["runs"])) == ("complete", 12, 12)
    succeeded = [run for run in answer["runs"] if run["status"] == "succeeded"]
    assert summary["succeeded"] == len(succeeded)
    assert ended.code == (0 if len(succeeded) == 12 else 1)
    assert [run["seed"] for run in answer["runs"]] == list(range(12))
    # within a dynamically controllable box, runs succeed; outside, only if what is missed is not needed any more
    assert all(run["status"] == "succeeded" for run in answer["runs"] if run["inside"])
    assert any(run["status"] == "failed" for run in answer["runs"])
    table = command(*arguments)
    assert table.code == ended.code
    row = next(line.split() for line in table.out.splitlines() if line.split()[:1] == ["dreex"])
    assert row[1:3] == ["12", str(len(succeeded))]


def test_the_same_seed_is_the_same_run(world):
    arguments = ["execute", *example("steps.plan"), "--parametrize", "duration:drive", "--world", world, "--json"]
    runs = [answer_of(command(*arguments, "--seed", seed))["runs"][0] for seed in ("4", "4", "5")]
    plans = [[(plan["executed"], plan["observations"]) for plan in run["plans"]] for run in runs]
    assert plans[0] == plans[1] != plans[2]


def test_blex(world):
    ended = command(
        *("execute", *example("steps.plan"), "--parametrize", "duration:drive", "--world", world),
        *("--executor", "blex:60", "--json"),
    )
    (run,) = answer_of(ended)["runs"]
    assert run["plans"][0]["guarantee"] == "none"
    assert run["plans"][0]["box"]["dur_n0"]["upper"] == "48"


def test_a_planner_is_asked_for_the_plan(world, planner):
    ended = command(
        "execute", *example()[:2], "--planner", planner, "--parametrize", "duration:drive", "--world", world, "--json"
    )
    answer = answer_of(ended)
    assert (answer["plan"], answer["planner"]) == (None, planner)
    assert answer["runs"][0]["plans"][0]["executed"][0]["action"] == "(drive scout base ridge)"


def test_a_run_that_cannot_go_on_says_why(tmp_path, planner):
    file = tmp_path / "world.toml"
    file.write_text('[[draw]]\nduration = "drive"\ndistribution = "constant"\nvalue = 60\n', encoding="utf-8")
    arguments = ["execute", *example(), "--world", file]
    ended = command(*arguments)
    assert ended.code == 1
    first = ended.out.splitlines()[0]
    assert first == (
        "failed at 60 with 0 re-plans (dreex, seed 0): to_ridge exceeds 36; there is no planner to ask for another plan"
    )
    with_planner = command(*arguments, "--planner", planner)
    assert with_planner.code == 1
    assert "reachability: no plan" in with_planner.out
    file.write_text(file.read_text(encoding="utf-8").replace("60", "37"), encoding="utf-8")
    with_planner = command(*arguments, "--planner", planner)
    assert with_planner.code == 1
    assert "nonsense" in with_planner.out


@pytest.mark.parametrize("suffix", ["svg", "png", "pdf"])
def test_a_gantt_chart(world, tmp_path, suffix):
    file = tmp_path / f"run.{suffix}"
    ended = command("execute", *example(), "--plot", file)
    assert ended.code == 0
    content = file.read_bytes()
    assert content.startswith({"svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}[suffix])
    if suffix == "svg":
        assert b"drive base ridge" in content


def test_a_rule_that_has_no_say_is_refused(world):
    ended = command("execute", *example("steps.plan"), "--world", world)
    assert ended.code == 2
    assert "--parametrize duration:drive" in ended.err


def test_out_of_time(world):
    arguments = ["execute", *example(), "--runs", "1000000", "--timeout", "2.5", "--json"]
    ended = command(*arguments)
    assert ended.code == 3
    answer = answer_of(ended)
    assert answer["status"] in {"timeout", "interrupted"}
    assert 0 < len(answer["runs"]) < 1000000


def test_interrupted():
    ended = stopped("execute", *example(), "--runs", "1000000", "--quiet", after=3.0, number=signal.SIGINT)
    assert ended.code == 3
    assert ended.seconds < 30
