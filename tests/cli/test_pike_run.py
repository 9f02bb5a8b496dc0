"""`robust pike run`, as users run it."""

import json

import jsonschema

from robust.cli import run as robust
from robust.show.schemas import schema
from tests.pike_bridge.online.examples import KITCHEN


def run(capsys, *arguments):
    code = robust(["pike", "run", str(KITCHEN), *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_a_story_as_json(capsys):
    code, out, _ = run(capsys, "--outcome", "xA1=mug", "--json")
    answer = json.loads(out)
    jsonschema.validate(answer, schema("robust/pike-run/1"))
    assert code == 0
    assert answer["status"] == "succeeded"
    assert answer["choices"]["xA2"] == "coffee"
    possible = next(step["possible"] for step in answer["steps"] if step["possible"])
    assert possible["xA3"] == ["cereal"]
    assert answer["conflict"] == []


def test_a_failure_names_the_facts_that_contradict_each_other(capsys):
    code, out, _ = run(capsys, "--outcome", "xA1=mug", "--outcome", "xA3=bagel")
    assert code == 1
    assert out.startswith("failed at ")
    assert "observed  xA3 = bagel" in out
    assert out.rstrip().splitlines()[-2:] == ["  xA2 = coffee", "  xA3 = bagel"]


def test_reasons_are_told_below_each_decision_and_inference(capsys):
    code, out, _ = run(capsys, "--outcome", "xA1=mug", "--explain")
    assert code == 0
    lines = [line.strip() for line in out.splitlines()]
    at = lines.index("so        xA2 must be coffee")
    assert lines[at + 1 : at + 3] == [
        "not juice, as xA1 = mug:",
        "(pour-juice human) needs (have glass), which only (get human glass) establishes, if xA1 = glass",
    ]
    assert "as inferred; establishes (have grounds) for (make-coffee human)" in lines


def test_reasons_as_json(capsys):
    code, out, _ = run(capsys, "--outcome", "xA1=mug", "--outcome", "xA3=bagel", "--explain", "--json")
    answer = json.loads(out)
    jsonschema.validate(answer, schema("robust/pike-run/1"))
    assert code == 1
    inferred = next(step["why"]["inferences"] for step in answer["steps"] if step["possible"])
    assert {fact["fact"] for fact in inferred["xR1"]["impossible"]["juice"]} >= {"xA2 = coffee"}
    failure = answer["steps"][-1]["decisions"][-1]
    assert failure["what"] == "failed"
    assert {"about": "choice", "fact": "xA3 = bagel"} in failure["why"]["conflict"]
    first = answer["steps"][0]["why"]["continuation"]
    assert first["scenario"].keys() == {"xA1", "xA2", "xA3", "xA4", "xR1", "xR2"}


def test_the_same_seed_gives_the_same_execution(capsys):
    steps = []
    for _ in range(2):
        _, out, _ = run(capsys, "--seed", "5", "--json")
        steps.append([(step["time"], step["messages"], step["decisions"]) for step in json.loads(out)["steps"]])
    assert steps[0] == steps[1]


def test_a_chart_is_drawn(capsys, tmp_path):
    picture = tmp_path / "run.svg"
    code, _, _ = run(capsys, "--outcome", "xA1=mug", "--plot", str(picture), "--quiet")
    assert code == 0
    text = picture.read_text(encoding="utf-8")
    assert "(make-coffee human)" in text
    assert "xA3 must be cereal" in text


def test_a_time_out_says_what_has_happened(capsys):
    code, out, err = run(capsys, "--timeout", "0.000001", "--json")
    assert code == 3
    assert json.loads(out or err)
