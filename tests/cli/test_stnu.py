"""`robust stnu`: several files, exit codes, answers for people and programs, untimely ends; exports of plans."""

import json
import os
from fractions import Fraction

import pytest

from benchmarks.irr.stnu import team_network
from robust import stnu
from robust.stnu.files import network_json
from tests.cli.running import LOAD, NAVIGATION, answer_of, assert_one_line, command, example, stopped

FINE = """{"nodes": [{"node_id": "A"}, {"node_id": "C"}, {"node_id": "D"}], "constraints": [
{"first_node": "A", "second_node": "C", "type": "stcu", "min_duration": 1, "max_duration": 7},
{"first_node": "C", "second_node": "D", "type": "stc", "min_duration": 1, "max_duration": 2},
{"first_node": "A", "second_node": "D", "type": "stc", "min_duration": "-inf", "max_duration": 8}]}
"""
LATE = FINE.replace('"max_duration": 7', '"max_duration": 10')
BAD = FINE.replace('"stcu"', '"stu"')


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A directory with networks, which is the working directory."""
    for name, text in {"fine": FINE, "late": LATE, "bad": BAD}.items():
        (tmp_path / f"{name}.json").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_check_one(here):
    ended = command("stnu", "check", "fine.json")
    assert (ended.code, ended.out) == (0, "controllable: 3 time points, 3 links, 1 contingent\n")
    ended = command("stnu", "check", "late.json")
    assert ended.code == 1
    assert ended.out.splitlines() == [
        "uncontrollable: A => C as long as 10 cannot be met with A -> D in [-inf, 8]; C -> D in [1, 2]",
        "  D - A <= 8  (A -> D in [-inf, 8])",
        "  C - D <= -1  (C -> D in [1, 2])",
        "  A - C <= -10  (A => C in [1, 10], as long as may be)",
        "  a semi-reducible cycle of length -3, checked",
    ]
    assert command("stnu", "check", "late.json", "--quiet").out.count("\n") == 1
    assert_one_line(command("stnu", "check", "bad.json"))
    assert_one_line(command("stnu", "check", "gone.json"))
    (here / "empty.json").write_text("", encoding="utf-8")
    (here / "plan.stn").write_text("# a plan\n", encoding="utf-8")
    for name, found in (("empty.json", "an empty file"), ("plan.stn", "'# a plan'")):
        ended = command("stnu", "check", name)
        assert_one_line(ended)
        assert ended.err.endswith(f"{name}:1: found {found}, expected a network as GraphML (.stnu) or JSON\n")
    assert command("stnu", "check").code == 2


def test_check_many(here):
    ended = command("stnu", "check", "fine.json", "late.json", "--json")
    assert ended.code == 1
    fine, late = answer_of(ended, "robust/stnu-check/1")["results"]
    assert (fine["file"], fine["verdict"], fine["cycle"]) == ("fine.json", "controllable", [])
    assert (late["verdict"], [edge["value"] for edge in late["cycle"]]) == ("uncontrollable", ["8", "-1", "-10"])
    assert [edge["case"] for edge in late["cycle"]] == ["ordinary", "ordinary", "upper"]
    assert command("stnu", "check", "fine.json", "fine.json").code == 0
    ended = command("stnu", "check", "bad.json", "late.json", "fine.json")
    assert ended.code == 2
    assert ended.out.splitlines()[0].startswith("error: bad.json:2:")
    assert ended.out.splitlines()[-1] == "1 error, 1 uncontrollable, 1 controllable"
    (bad, _) = answer_of(command("stnu", "check", "bad.json", "late.json", "--json"))["results"]
    assert (bad["verdict"], bad["error"][:11]) == ("unknown", "bad.json:2:")


def chain(length):
    """One contingent link after the other, the last of which is too late."""
    kinds = ("stcu", "stc")
    constraints = [
        {"first_node": at, "second_node": at + 1, "type": kinds[at % 2], "min_duration": 0, "max_duration": 2}
        for at in range(length)
    ]
    end = {"first_node": 0, "second_node": length, "type": "stc", "min_duration": 0, "max_duration": length / 2}
    nodes = [{"node_id": at} for at in range(length + 1)]
    return json.dumps({"nodes": nodes, "constraints": [*constraints, end]})


@pytest.mark.parametrize(("verb", "key"), [("check", "verdict"), ("repair", "repair")])
def test_out_of_time(here, verb, key):
    """The limit passes while the file is read, when nothing is known, or afterwards."""
    (here / "long.json").write_text(chain(300), encoding="utf-8")
    ended = command("stnu", verb, "long.json", "--timeout", "0.000001", "--json")
    answer = answer_of(ended)
    assert ended.code == 3
    if "error" in answer:
        assert answer["error"]["kind"] == "timeout"
    else:
        assert (answer["status"], answer["results"][0][key]) == ("timeout", "unknown")


def test_dispatch(here):
    ended = command("stnu", "dispatch", "fine.json")
    assert ended.code == 0
    lines = ended.out.splitlines()
    assert lines[0].startswith("controllable: minimal dispatchable with ")
    assert lines[1] == "  A => C in [1, 7]"
    assert lines[-1] == "1 execution, 0 with a violated requirement"
    ended = command("stnu", "dispatch", "fine.json", "late.json", "--runs", "20", "--seed", "7", "--json")
    fine, late = answer_of(ended, "robust/stnu-dispatch/1")["results"]
    assert ended.code == 1
    assert [run["seed"] for run in fine["executions"]] == list(range(7, 27))
    assert not any(run["violated"] for run in fine["executions"])
    assert [event["point"] for event in fine["executions"][0]["events"]] == ["A", "C", "D"]
    assert (late["verdict"], late["executions"]) == ("uncontrollable", [])
    again = answer_of(command("stnu", "dispatch", "fine.json", "--seed", "9", "--json"))["results"][0]
    assert again["executions"][0] == fine["executions"][2]
    assert_one_line(command("stnu", "dispatch", "fine.json", "--runs", "-1"))


def test_repair(here):
    ended = command("stnu", "repair", "late.json", "--weight", "requirement=inf", "-o", "repaired.stnu")
    assert ended.code == 0
    assert ended.out.splitlines() == [
        "optimal: 1 change at cost 3",
        "  A => C: upper bound 10 to 7",
        "    for: A => C as long as 10 cannot be met with A -> D in [-inf, 8]; C -> D in [1, 2]",
        "network: repaired.stnu",
    ]
    assert stnu.check(stnu.load("repaired.stnu")).is_controllable
    answer = answer_of(command("stnu", "repair", "late.json", "--weight", "A:D=1/2", "--json"), "robust/stnu-repair/1")
    (change,) = answer["results"][0]["changes"]
    assert (change["source"], change["target"], change["new"], change["cost"]) == ("A", "D", "11", "3/2")
    frozen = ("--weight", "requirement=inf", "--weight", "contingent=inf")
    ended = command("stnu", "repair", "late.json", "fine.json", *frozen, "--json")
    assert ended.code == 1
    assert [one["repair"] for one in answer_of(ended)["results"]] == ["impossible", "unneeded"]
    third = ("--weight", "requirement=inf", "-o", "thirds.stnu")
    (here / "third.json").write_text(LATE.replace('"max_duration": 8', '"max_duration": "25/3"'), encoding="utf-8")
    ended = command("stnu", "repair", "third.json", *third)
    assert "thirds.stnu: times are in units of 1/3" in ended.err


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("--weight", "A:E=1"), "found unknown link 'A:E'"),
        (("--weight", "A:D"), "expected requirement=W, contingent=W or SOURCE:TARGET=W"),
        (("--weight", "A:D=0"), "expected a number above 0"),
        (("-o", "a.txt"), "expected a name that ends in .stnu or .json"),
        (("fine.json", "-o", "a.stnu"), "needs exactly one network"),
    ],
)
def test_what_is_asked_wrongly(here, given, says):
    ended = command("stnu", "repair", "late.json", *given)
    assert_one_line(ended)
    assert says in ended.err


# -- exports -----------------------------------------------------------------------------------------------------------


def test_the_network_of_a_plan_under_a_box(tmp_path):
    box, target = tmp_path / "box.json", tmp_path / "plan.json"
    box.write_text(command("envelope", *example(), "--json").out, encoding="utf-8")
    ended = command("convert", *example(), "--stnu", target, "--box", box)
    assert (ended.code, ended.out) == (0, f"network: {target}, 15 time points, 28 links, 5 contingent\n")
    found = stnu.load(target)
    drive = next(link for link in found.contingents if link.source == "drive_1.start")
    assert (drive.lower, drive.upper, found.origin) == (25, 36, "0")
    assert stnu.check(found).is_controllable
    answer = answer_of(
        command("convert", *example(), "--stnu", tmp_path / "plan.stnu", "--json"), "robust/stnu-export/1"
    )
    assert (answer["time_points"], answer["contingent"]) == (15, 5)
    assert stnu.load(tmp_path / "plan.stnu").origin == "Z"


def test_a_converted_plan_and_its_network(tmp_path):
    steps = NAVIGATION / "steps.plan"
    target = tmp_path / "plan.stnu"
    ended = command("convert", *example()[:2], steps, "-o", tmp_path / "plan.stn", "--stnu", target, "--json")
    assert (ended.code, answer_of(ended)["files"]["stnu"]) == (0, str(target))
    assert stnu.check(stnu.load(target)).is_controllable
    assert_one_line(command("convert", *example(), "--box", "box.json"))
    ended = command("convert", *example(), "--stnu", target, "-o", tmp_path / "other.stn")
    assert_one_line(ended)
    assert "PLAN is a network already" in ended.err


# -- untimely ends -----------------------------------------------------------------------------------------------------


def test_ctrl_c_prints_the_best_repair_so_far(here):
    """A schedule of a team that takes long to repair: what is known is a repair, or at least a bound."""
    (here / "team.json").write_text(network_json(team_network(1200, 1)), encoding="utf-8")
    ended = stopped("stnu", "repair", "team.json", "--json", after=4 * LOAD)
    answer = answer_of(ended, "robust/stnu-repair/1")
    (one,) = answer["results"]
    assert (ended.code, answer["status"], one["error"]) == (3, "interrupted", None)
    assert ended.seconds < 2 * LOAD
    assert one["repair"] in {"feasible", "unknown"}
    assert (one["repair"] == "feasible") is (one["cost"] is not None)
    assert one["cost"] is None or Fraction(one["cost"]) - Fraction(one["bound"]) == Fraction(one["gap"]) > 0


def test_ctrl_c_prints_the_verdicts_so_far(here):
    """The second network never comes."""
    os.mkfifo(here / "late.pipe")
    ended = stopped("stnu", "check", "fine.json", "late.pipe", "--json", after=2 * LOAD)
    answer = answer_of(ended, "robust/stnu-check/1")
    assert (ended.code, answer["status"]) == (3, "interrupted")
    assert [one["verdict"] for one in answer["results"]] == ["controllable"]
