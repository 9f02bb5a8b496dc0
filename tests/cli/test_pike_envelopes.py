"""`robust pike region`, `envelope` and `new`, and comparisons on random plans; wrong options are recorded."""

import json

import pytest
from matplotlib.image import imread

from tests.cli.running import EXAMPLES, answer_of, command

KITCHEN, WING = (EXAMPLES / name / f"{name}.tpnu.json" for name in ("kitchen", "wing"))
COFFEE = ("--parameter", "coffee=duration:make-coffee")
LIMIT = ("--parameter", "limit=at-most:e1:e44")


def test_a_region_says_for_each_combination_what_is_possible():
    answer = answer_of(command("pike", "region", KITCHEN, *COFFEE, *LIMIT, "--json"), "robust/pike-region/1")
    assert answer["status"] == "complete"
    assert len(answer["combinations"]) == 10
    assert sum(bool(each["polyhedra"]) for each in answer["combinations"]) == 4
    assert max(len(cell["possible"]) for cell in answer["exactly"]) == 4


def test_a_region_of_chosen_choices_and_of_none():
    ended = command("pike", "region", KITCHEN, *COFFEE, "--choices", "xA1")
    assert ended.out.startswith("With xA1 = mug: coffee may take 0.001 to 5.284")
    assert "With xA1 = glass: anything goes." in ended.out
    anything = command("pike", "region", KITCHEN, *COFFEE, "--choices", "", "--assume", "xA1=mug")
    assert "With any choices: coffee may take" in anything.out


def test_no_parameter_values_at_all_is_a_refutation():
    ended = command("pike", "region", KITCHEN, *COFFEE, "--assume", "xA1=mug", "--assume", "xA2=juice")
    assert (ended.code, "No parameter values lead to a correct execution." in ended.out) == (1, True)


def test_an_envelope_for_whatever_is_chosen():
    ended = command("pike", "envelope", KITCHEN, *COFFEE, *LIMIT, "--for-all", "xA1")
    promise = (
        "Whatever xA1 will be, if it is known beforehand: coffee may take 0.001 to 4.142; limit must be at least 5.858."
    )
    assert (ended.code, ended.out.splitlines()[0]) == (0, promise)
    answer = answer_of(
        command("pike", "envelope", KITCHEN, *COFFEE, *LIMIT, "--for-all", "xA1", "--json"), "robust/pike-envelope/1"
    )
    stopped = answer["parameters"]["coffee"]["stopped_above"]
    assert stopped["choices"] == {"xA1": "mug"}
    assert "(make-coffee human) takes at least coffee" in stopped["statements"]


def test_patience_waits_and_impossible_combinations_are_named():
    late = ("--parameter", "hesitation:xA1")
    ended = command("pike", "envelope", KITCHEN, *late, "--for-all", "xA1", "--patience", "-q")
    assert "even if the team learns of it only then, and waits: hesitation xA1 may be up to 2.283." in ended.out
    assert command("pike", "envelope", KITCHEN, "--parameter", "duration:get").code == 0
    ended = command("pike", "envelope", KITCHEN, *COFFEE, "--for-all", "xA1,xA2", "-q")
    assert (ended.code, "no correct execution with xA1 = mug, xA2 = juice, whatever" in ended.out) == (1, True)


def test_pictures_are_drawn(tmp_path):
    for name, words in (("region", ()), ("envelope", ("--assume", "xA1=mug"))):
        picture = tmp_path / f"{name}.png"
        assert command("pike", name, KITCHEN, *COFFEE, *LIMIT, *words, "--plot", picture).code == 0
        assert imread(picture).std() > 0.05
    svg = tmp_path / "region.svg"
    command("pike", "region", KITCHEN, *COFFEE, *LIMIT, "--plot", svg)
    assert "coffee: the duration of (make-coffee human)" in svg.read_text()


def test_parameters_of_files(tmp_path):
    plan = json.loads(KITCHEN.read_text())
    plan["parameters"] = [{"name": "limit", "at-most": "e1:e44", "upper": 20}]
    for name in ("domain.pddl", "problem.pddl"):
        (tmp_path / name).write_bytes((KITCHEN.parent / name).read_bytes())
    file = tmp_path / "plan.tpnu.json"
    file.write_text(json.dumps(plan))
    toml = tmp_path / "more.toml"
    toml.write_text('[parameters.coffee]\nduration = "make-coffee"\nweight = 0.5\n')
    ended = command("pike", "envelope", file, "--parameters", toml, "--for-all", "xA1", "--json")
    answer = answer_of(ended, "robust/pike-envelope/1")
    assert list(answer["parameters"]) == ["limit", "coffee"]
    assert answer["parameters"]["limit"]["upper"] == "20"
    assert answer["parameters"]["limit"]["stopped_above"]["reason"] == "declared bound"


def test_out_of_time_keeps_what_is_known():
    ended = command(
        "pike", "region", WING, "--parameter", "pick=duration:(pick human *)", "--timeout", "0.001", "--json"
    )
    assert ended.code == 3


@pytest.mark.parametrize("words", [("kitchen",), ("wing",), ("k-intents", "--structure", "2,3")])
def test_new_plans_can_be_checked(words, tmp_path):
    answer = answer_of(command("pike", "new", *words, "-o", tmp_path, "--json"), "robust/pike-new/1")
    assert command("pike", "check", answer["files"][0]).code in (0, 1)
    again = command("pike", "new", *words, "-o", tmp_path)
    assert (again.code, "--force replaces them" in again.err) == (2, True)
    assert command("pike", "new", *words, "-o", tmp_path, "--force").code == 0


def test_new_plans_say_what_to_type_next(tmp_path):
    ended = command("pike", "new", "kitchen", "-o", tmp_path, "--name", "mine")
    lines = [line.split() for line in ended.out.splitlines()[1:]]
    assert {line[2] for line in lines} == {"check", "run", "region", "plot"}
    assert all(str(tmp_path / "mine.tpnu.json") in line for line in lines)
