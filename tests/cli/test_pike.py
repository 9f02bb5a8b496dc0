"""`robust pike`: answers, exit codes, and errors that name the place."""

import json

import jsonschema
import pytest

from robust.pike_bridge.generators.sat_reduction import sat_plan
from robust.report.schemas import schema
from tests.cli.running import EXAMPLES, command

KITCHEN = EXAMPLES / "kitchen" / "kitchen.tpnu.json"


def answer_of(ended, name):
    answer = json.loads(ended.out)
    jsonschema.validate(answer, schema(f"robust/pike-{name}/1"), cls=jsonschema.Draft202012Validator)
    return answer


@pytest.mark.parametrize("backend", ["oracle", "pitms", "atms", "sat", "bdd"])
def test_check(backend):
    ended = command("pike", "check", KITCHEN, "--backend", backend, "--assume", "xA1=mug", "--all-scenarios", "--json")
    answer = answer_of(ended, "check")
    assert (ended.code, ended.err, answer["verdict"], answer["complete"]) == (0, "", "proved", True)
    assert answer["scenarios"] == [answer["scenario"]]
    assert answer["scenario"]["xA4"] == "cereal"
    assert answer["schedule"]["e_initial"] == "0"
    refuted = command("pike", "check", KITCHEN, "--backend", backend, "--assume", "xA1=mug", "--assume", "xR1=juice")
    assert (refuted.code, refuted.out) == (1, "No correct execution exists.\n")


def test_check_in_words():
    ended = command("pike", "check", KITCHEN, "--assume", "xA1=glass", "--all-scenarios")
    assert "A correct execution exists.\n" in ended.out
    assert "(get human glass)  [human]" in ended.out
    assert "2 team scenarios:\n" in ended.out
    late = command("pike", "check", KITCHEN, "--timeout", "0.000001", "--json")
    assert late.code == 3


def test_compile():
    ended = command("pike", "compile", KITCHEN, "--implicants", "--json")
    answer = answer_of(ended, "compile")
    assert (ended.code, answer["status"], answer["satisfiable"]) == (0, "complete", True)
    assert answer["prime_implicants"] == len(answer["implicants"]) == 3
    assert answer["models"] >= 3
    assert set(answer["seconds"]) == {"precedence", "links", "conflicts", "knowledge"}
    text = command("pike", "compile", KITCHEN, "--backend", "bdd", "--temporal", "apsp")
    assert text.out.startswith("Compiled: a correct execution exists.\n")
    assert "\n  prime implicants: 3\n" in text.out


def test_every_back_end_that_knows_implicants_reports_the_same():
    found = [
        answer_of(command("pike", "compile", KITCHEN, "--backend", backend, "--implicants", "--json"), "compile")
        for backend in ("pitms", "bdd")
    ]
    assert [answer["prime_implicants"] for answer in found] == [3, 3]
    assert sorted(map(str, found[0]["implicants"])) == sorted(map(str, found[1]["implicants"]))
    for backend in ("atms", "sat"):
        assert answer_of(command("pike", "compile", KITCHEN, "--backend", backend, "--json"), "compile")["models"] >= 3
        refused = command("pike", "compile", KITCHEN, "--backend", backend, "--implicants")
        assert (refused.code, refused.out) == (4, "")
        assert "expected --backend pitms or bdd" in refused.err


def test_unsatisfiable_and_empty_plans(tmp_path):
    wrong = sat_plan([[1], [-1]]).write(tmp_path / "wrong")
    nothing = sat_plan([]).write(tmp_path / "nothing")
    for shortcut in ("--shortcut", "--no-shortcut"):
        answer = answer_of(command("pike", "compile", wrong, shortcut, "--json"), "compile")
        assert (answer["satisfiable"], answer["prime_implicants"], answer["models"]) == (False, 0, 0)
    for backend in ("oracle", "pitms", "bdd"):
        assert command("pike", "check", wrong, "--backend", backend).code == 1
        assert command("pike", "check", nothing, "--backend", backend).code == 0


def test_cross(tmp_path):
    file = sat_plan([[1, 2], [-1, 2]]).write(tmp_path)
    ended = command("pike", "check", file, "--cross", "--json")
    answer = answer_of(ended, "cross")
    assert (ended.code, answer["agree"], answer["scenarios"], answer["disagreements"]) == (0, True, 2, [])
    assert len(answer["questions"]) == 8
    assert command("pike", "check", file, "--cross").out.startswith("All agree: 2 team scenarios, ")


def test_plot(tmp_path):
    ended = command("pike", "plot", KITCHEN, "-o", tmp_path / "plan.svg", "--links", "--assume", "xA1=mug", "--json")
    answer = answer_of(ended, "plot")
    assert (ended.code, answer["choices"]) == (0, 5)
    assert (tmp_path / "plan.svg").read_text().startswith("<?xml")
    assert command("pike", "plot", KITCHEN, "-o", tmp_path / "plan.gif").code == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("tpnu/1", "tpnu/2"), "tpnu.json:"),
        (('"at": "e3"', '"at": "e99"'), "e99"),
        (('"choices"', '"chioces"'), "chioces"),
        (("kitchen.pddl", "none.pddl"), "none.pddl"),
        (("(get human mug)", "(get human jug)"), "jug"),
        (('"lower"', '"lowest"'), "lowest"),
    ],
)
def test_bad_input(tmp_path, change, message):
    text = KITCHEN.read_text()
    for name in ("domain.pddl", "problem.pddl"):
        (tmp_path / name).write_text((KITCHEN.parent / name).read_text())
    old, new = change
    if old == "kitchen.pddl":
        old = "domain.pddl"
    if old == '"at": "e3"':
        old = text[text.index('"at": "') :].split(",")[0].split("}")[0]
    assert old in text
    file = tmp_path / "plan.tpnu.json"
    file.write_text(text.replace(old, new, 1))
    ended = command("pike", "check", file)
    assert (ended.code, ended.out) == (2, "")
    assert ended.err.startswith("robust: error: ")
    assert ended.err.count("\n") == 1
    assert message in ended.err


def test_wrong_options(tmp_path):
    for arguments in (
        [tmp_path / "none.tpnu.json"],
        [KITCHEN, "--assume", "xA1"],
        [KITCHEN, "--assume", "xA1=jug"],
        [KITCHEN, "--assume", "xA1=mug", "--assume", "xA1=glass"],
        [KITCHEN, "--epsilon", "0"],
    ):
        ended = command("pike", "check", *arguments)
        assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1), arguments
