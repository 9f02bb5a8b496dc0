"""`robust pike`: what follows from the kitchen, large plans, plans that are new, and pictures; the rest is recorded."""

from dataclasses import replace

import pytest
from matplotlib.image import imread

from robust import pike
from robust.pike_bridge.cross_check import Disagreement
from tests.cli.running import EXAMPLES, answer_of, command
from tests.pike_bridge.stories import figure_23, sat_plan

KITCHEN, WING = (EXAMPLES / name / f"{name}.tpnu.json" for name in ("kitchen", "wing"))
COFFEE = ("--parameter", "coffee=duration:make-coffee")
LIMIT = ("--parameter", "limit=at-most:e1:e44")


def asked(*words):
    """A question about the kitchen: its exit code, and its answer for programs."""
    ended = command("pike", words[0], KITCHEN, *words[1:], "--json")
    return ended.code, answer_of(ended)


def test_knowledge_bases_are_held_against_the_oracle_and_the_smallest_disagreement_is_told_first(tmp_path):
    file = sat_plan([[1, 2], [-1, 2]]).write(tmp_path)
    ended = command("pike", "check", file, "--cross", "--json")
    answer = answer_of(ended, "robust/pike-cross/1")
    assert (ended.code, answer["agree"], answer["scenarios"], answer["disagreements"]) == (0, True, 2, [])
    assert len(answer["questions"]) == 10
    assert command("pike", "check", file, "--cross").out.startswith("All agree: 2 team scenarios, ")
    file = sat_plan([]).write(tmp_path)  # a plan without choices
    for backend in ("oracle", "pitms", "bdd"):
        assert command("pike", "check", file, "--backend", backend).code == 0
    assert "3 events, 0 activities, 0 choices" in command("pike", "plot", file, "-o", tmp_path / "plan.svg").out
    nothing = command("pike", "check", sat_plan([[1], [-1]]).write(tmp_path / "none"), "--all-scenarios")
    assert (nothing.code, nothing.out.splitlines()) == (
        1,
        [
            "No correct execution exists.",
            "  these contradict each other:",
            "    (clause-1) needs (clause-holds-1), which only (assign-1) establishes, if v1 = true",
            "    (clause-2) needs (clause-holds-2), which only (assign-not-1) establishes, if v1 = false",
        ],
    )
    crossed = pike.cross_check(file)
    differing = [
        Disagreement("bdd (lazy)", f"could commit to {what}", "True", "False") for what in ("x = 1; y = 2", "x = 1")
    ]
    lines = str(replace(crossed, outcome=replace(crossed.outcome, disagreements=differing))).splitlines()
    assert lines[0] == "2 disagreements with the oracle, the smallest:"
    assert lines[1] == "  bdd (lazy): could commit to x = 1: expected True, found False"


def test_a_million_candidate_subplans(tmp_path):
    """Few questions need all of them; those that do end in time, with what is known by then."""
    file = figure_23(20).write(tmp_path)
    assert command("pike", "check", file).code == 0
    answer = answer_of(command("pike", "compile", file, "--json"), "robust/pike-compile/1")
    assert (answer["candidate_subplans"], answer["models"], answer["prime_implicants"]) == (2**20, 2**20, 1)
    ended = command("pike", "check", file, "--all-scenarios", "--timeout", "1", "--json")
    answer = answer_of(ended, "robust/pike-check/1")
    assert (ended.code, answer["verdict"], answer["complete"]) == (3, "proved", False)
    assert 0 < len(answer["scenarios"]) < 2**20
    ended = command("pike", "check", file, "--cross", "--timeout", "0.5")
    assert (ended.code, ended.out.count("\n")) == (3, 1)
    assert ended.out.startswith("Undecided: out of time")


@pytest.mark.parametrize(
    ("words", "who"),
    [
        ((), ("smt", "smt")),
        (("--reasoner", "windows"), ("windows", "pitms")),
        (("--backend", "bdd"), ("windows", "bdd")),
        (("--reasoner", "windows", "--backend", "sat"), ("windows", "sat")),
    ],
)
def test_all_who_decide_decide_the_same(words, who):
    code, answer = asked("run", "--outcome", "xA1=mug", *words)
    assert (answer["reasoner"], answer["backend"]) == who
    assert (code, answer["choices"]["xR1"], answer["choices"]["xA2"]) == (0, "grounds", "coffee")


def test_reasons_as_json():
    code, answer = asked("run", "--outcome", "xA1=mug", "--outcome", "xA3=bagel", "--explain")
    inferred = next(step["why"]["inferences"] for step in answer["steps"] if step["possible"])
    assert {fact["fact"] for fact in inferred["xR1"]["impossible"]["juice"]} >= {"xA2 = coffee"}
    failure = answer["steps"][-1]["decisions"][-1]
    assert (code, failure["what"]) == (1, "failed")
    assert {"about": "choice", "fact": "xA3 = bagel"} in failure["why"]["conflict"]
    scenario = answer["steps"][0]["why"]["continuation"]["scenario"]
    assert scenario.keys() == {"xA1", "xA2", "xA3", "xA4", "xR1", "xR2"}


def test_pictures_are_drawn_and_a_chart_says_what_happened(tmp_path):
    picture = tmp_path / "run.svg"
    assert command("pike", "run", KITCHEN, "--outcome", "xA1=mug", "--plot", picture, "--quiet").code == 0
    text = picture.read_text(encoding="utf-8")
    assert "(make-coffee human)" in text
    assert "xA3 must be cereal" in text
    for name, words in (("region", ()), ("envelope", ("--assume", "xA1=mug"))):
        picture = tmp_path / f"{name}.png"
        assert command("pike", name, KITCHEN, *COFFEE, *LIMIT, *words, "--plot", picture).code == 0
        assert imread(picture).std() > 0.05
    svg = tmp_path / "region.svg"
    command("pike", "region", KITCHEN, *COFFEE, *LIMIT, "--plot", svg)
    assert "coffee: the duration of (make-coffee human)" in svg.read_text()


@pytest.mark.parametrize(
    "words",
    [("kitchen", "--name", "mine"), ("wing",), ("k-intents", "--structure", "2,3"), ("sat", "--structure", "4,9")],
)
def test_new_plans_can_be_checked_and_say_what_to_type_next(words, tmp_path):
    answer = answer_of(command("pike", "new", *words, "-o", tmp_path, "--json"), "robust/pike-new/1")
    assert command("pike", "check", answer["files"][0]).code in (0, 1)
    again = command("pike", "new", *words, "-o", tmp_path)
    assert (again.code, "--force replaces them" in again.err) == (2, True)
    ended = command("pike", "new", *words, "-o", tmp_path, "--force")
    assert ended.code == 0
    lines = [line.split() for line in ended.out.splitlines()[1:]]
    assert {line[2] for line in lines} >= {"check", "run", "plot"}
    assert all(answer["files"][0] in line for line in lines)
