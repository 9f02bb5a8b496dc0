"""`robust convert`: plans on stdout or in files, parameters, JSON, and what is wrong with a plan."""

import json
from pathlib import Path

import pytest

from robust.plan.load import load_plan
from robust.plan.stn import parse_stn
from tests.cli import inputs
from tests.cli.running import answer_of, assert_one_line, command, example

STEPS = "; found by a planner\n2.000: (GO a b)  [5.0]\n"
INEQUALITY = inputs.DOMAIN.replace(":duration (= ?duration 5)", ":duration (and (>= ?duration 1) (<= ?duration 9))")


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    written = inputs.write(tmp_path, plan=STEPS)
    return list(written.files)


def test_the_plan_is_printed(files):
    ended = command("convert", *files)
    assert ended.code == 0
    assert ended.out == "durative-action instance n0 : (go a b);\nc: n0.end - n0.start in [5, 5];\n"
    assert ended.err == "proved: 1 instance, 1 constraint, 0 parameters\n"
    assert command("convert", *files, "--quiet").err == ""


def test_the_shipped_plan():
    ended = command("convert", *example("steps.plan"), "--parametrize", "duration:drive", "--quiet")
    assert ended.code == 0
    assert "c: n1.start - .zero in [21, inf];" in ended.out.splitlines()


def test_the_plan_is_written_and_can_be_checked(files, tmp_path):
    target = tmp_path / "converted.stn"
    ended = command("convert", *files, "-o", target)
    assert (ended.code, ended.err) == (0, "")
    assert ended.out == f"proved: 1 instance, 1 constraint, 0 parameters\nplan: {target}\n"
    assert command("check", *files[:2], target).code == 0


def test_esterel(files):
    ended = command("convert", *files, "--mode", "esterel", "--quiet")
    assert "c: n0.start - .zero in [0.001, inf];" in ended.out.splitlines()


def test_parameters_in_the_plan(tmp_path):
    written = inputs.write(tmp_path, domain=INEQUALITY, plan=STEPS)
    target = tmp_path / "converted.stn"
    ended = command("convert", *written.files, "-o", target, "--parametrize", "duration:go,weight=2")
    assert ended.code == 0
    assert "parameter dur_n0 weight 2 default 5;" in target.read_text()
    assert not target.with_suffix(".toml").exists()
    envelope = json.loads(command("envelope", *written.files[:2], target, "--json").out)
    assert (envelope["parameters"]["dur_n0"]["lower"], envelope["parameters"]["dur_n0"]["upper"]) == ("1", "9")


def test_parameters_beside_the_plan(files, tmp_path):
    target = tmp_path / "converted.stn"
    options = ["--parametrize", "duration:n0", "--parametrize", "fluent:(fuel),ub=7/3,default=2"]
    ended = command("convert", *files, "-o", target, *options)
    beside = target.with_suffix(".toml")
    assert ended.out.endswith(f"parameters: {beside}, for --parameters\n")
    plan = load_plan(*files[:2], target, parameter_file=beside)
    assert {one.name: one.nominal for one in plan.parameters} == {"dur_n0": 5, "fuel": 2}
    assert command("check", *files[:2], target, "--parameters", beside, "--at", "dur_n0=7", "--at", "fuel=1").code == 0


def test_parameters_beside_a_printed_plan(files):
    ended = command("convert", *files, "--parametrize", "duration:go")
    assert "reading this plan needs --parameter dur_n0=duration:n0\n" in ended.err
    assert "[dur_n0, dur_n0]" in ended.out


def test_json(files, tmp_path):
    target = tmp_path / "converted.stn"
    answer = answer_of(command("convert", *files, "--json", "-o", target, "--parametrize", "duration:go"))
    assert answer["verdict"] == "proved"
    assert answer["schedule"] == {".zero": "0", "n0.start": "2", "n0.end": "7"}
    assert answer["files"] == {"plan": str(target), "parameters": str(target.with_suffix(".toml"))}
    assert parse_stn(answer["stn"]).instances[0].action == "go"
    assert answer["parameters"] == ["dur_n0"]


def test_an_invalid_plan(files):
    files[2].write_text("0: (go a b) [4]\n")
    ended = command("convert", *files)
    assert_one_line(ended, 1)
    assert f"{files[2]}:1:1: invalid plan: found 'n0 go: duration (= ?duration 5)' broken at time 0" in ended.err
    ended = command("convert", *files, "--json")
    assert ended.code == 1
    answer = answer_of(ended)
    assert answer["verdict"] == "invalid"
    assert [one["obligation"] for one in answer["violations"]] == ["n0 go: duration (= ?duration 5)"]


WRONG = [
    ("", "empty plan: found no step"),
    ("; nothing\n", "empty plan: found no step"),
    ("0: (fly a b) [5]\n", "found action 'fly'"),
    ("0: (go a c) [5]\n", "found 'c'"),
    ("0: (go a) [5]\n", "found 'go' with 1 argument"),
    ("0: (go a b)\n", "found 'go' used as an instantaneous action"),
    ("0: (go a b) [-5]\n", "found duration '-5'"),
    ("Plan found:\n0: (go a b) [5]\n", "found 'Plan found:'"),
    ("soon: (go a b) [5]\n", "found 'soon' as time"),
]


@pytest.mark.parametrize(("text", "says"), WRONG)
def test_wrong_plans(files, text, says):
    files[2].write_text(text)
    ended = command("convert", *files)
    assert_one_line(ended)
    assert str(files[2]) in ended.err
    assert says in ended.err
    assert "expected" in ended.err


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--parametrize", "duration:fly"], "found 'fly', expected an instance of the plan or an action that it uses"),
        (["--parametrize", "duration:go,default=6"], "expected the plan's own 5"),
        (["--parametrize", "speed:go"], "found 'speed'"),
        (["--mode", "free"], "'free' is not one of"),
        (["--epsilon", "-1"], "expected a number of at least 0"),
        (["--timeout", "0"], "expected a number above 0"),
        (["-o", "nowhere/plan.stn"], "found no directory"),
        (["-o", "plan.toml"], "parameters go to .toml files"),
        (["-o", "/"], "cannot write"),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_wrong_options(files, options, says):
    ended = command("convert", *files, *options)
    assert_one_line(ended)
    assert says in ended.err


def test_missing_file(files, tmp_path):
    ended = command("convert", *files[:2], tmp_path / "absent.plan")
    assert_one_line(ended)
    assert "absent.plan: found no such file" in ended.err
