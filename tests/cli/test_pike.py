"""`robust pike`: what follows from the kitchen, large plans, and errors that name the place; the rest is recorded."""

import re
from io import StringIO

import pytest
from rich.console import Console

from robust.pike_bridge.cross_check import CrossCheck, Crossed, Disagreement
from robust.show.pike import print_cross
from tests.cli.running import EXAMPLES, answer_of, command
from tests.pike_bridge.satisfiability import sat_plan
from tests.pike_bridge.stories import figure_23

KITCHEN = EXAMPLES / "kitchen" / "kitchen.tpnu.json"


def test_the_mug_tells_coffee_and_grounds_and_the_limit_cereal(tmp_path):
    """[PIKE §1.1]: nothing but the limit of seven minutes keeps Alice from a bagel with her coffee."""

    def left(file):
        ended = command("pike", "check", file, "--assume", "xA1=mug", "--all-scenarios", "--json")
        return answer_of(ended, "robust/pike-check/1")["scenarios"]

    mug = {"xA1": "mug", "xA2": "coffee", "xR1": "grounds"}
    assert left(KITCHEN) == [mug | {"xA3": "cereal", "xA4": "cereal", "xR2": "milk"}]
    limit = '"from": "e1", "to": "e44", "lower": null, "upper": 7'
    found = left(kitchen_with(tmp_path, lambda text: swap(text, limit, limit[:-1] + "20")))
    assert all(mug.items() <= one.items() for one in found)
    assert {one["xA4"] for one in found} == {"bagel", "cereal"}


def test_cross(tmp_path):
    file = sat_plan([[1, 2], [-1, 2]]).write(tmp_path)
    ended = command("pike", "check", file, "--cross", "--json")
    answer = answer_of(ended, "robust/pike-cross/1")
    assert (ended.code, answer["agree"], answer["scenarios"], answer["disagreements"]) == (0, True, 2, [])
    assert len(answer["questions"]) == 8
    assert command("pike", "check", file, "--cross").out.startswith("All agree: 2 team scenarios, ")


def test_one_disagreement_stands_for_all():
    found = [
        Disagreement("bdd (lazy)", f"could commit to {what}", "True", "False") for what in ("x = 1; y = 2", "x = 1")
    ]
    out = Console(file=StringIO())
    print_cross(out, Crossed(CrossCheck(2, {"bdd (lazy)": 7}, disagreements=found)), quiet=True)
    assert out.file.getvalue().splitlines() == [
        "2 disagreements with the oracle, the smallest:",
        "  bdd (lazy): could commit to x = 1: expected True, found False",
    ]


def test_until_when_people_can_choose():
    answer = answer_of(command("pike", "check", KITCHEN, "--patience", "--json"), "robust/pike-patience/1")
    latest = {(each["choice"], each["value"]): each["latest"] for each in answer["moments"]}
    assert latest["xA1", "mug"] == "1143/500"
    assert latest["xA4", "cereal"] == "6499/1000"
    assert command("pike", "check", KITCHEN, "--patience", "--assume", "xA1=mug", "--assume", "xA2=juice").code == 1


def swap(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


def kitchen_with(place, change, **files):
    """A copy of the kitchen whose plan is changed, and whose other files are as given; None for none."""
    for name in ("domain", "problem"):
        content = files.get(name, (KITCHEN.parent / f"{name}.pddl").read_bytes())
        if content is not None:
            (place / f"{name}.pddl").write_bytes(content.encode() if isinstance(content, str) else content)
    file = place / "plan.tpnu.json"
    file.write_text(change(KITCHEN.read_text()))
    return file


def test_a_million_candidate_subplans(tmp_path):
    """Few questions need all of them; those that do end in time, with what is known by then."""
    file = figure_23(20).write(tmp_path)
    assert command("pike", "check", file).code == 0
    answer = answer_of(command("pike", "compile", file, "--json"), "robust/pike-compile/1")
    assert (answer["candidate_subplans"], answer["models"], answer["prime_implicants"]) == (2**20, 2**20, 1)
    ended = command("pike", "check", file, "--all-scenarios", "--timeout", "2", "--json")
    answer = answer_of(ended, "robust/pike-check/1")
    assert (ended.code, answer["verdict"], answer["complete"]) == (3, "proved", False)
    assert 0 < len(answer["scenarios"]) < 2**20
    ended = command("pike", "check", file, "--cross", "--timeout", "1")
    assert (ended.code, ended.out.count("\n")) == (3, 1)
    assert ended.out.startswith("Undecided: out of time")


BAD = {
    "unknown key": (
        lambda text: swap(text, '"guard"', '"gaurd"'), {},
        r"plan.tpnu.json:\d+:\d+: found key 'gaurd', expected one of an event; did you mean 'guard'\?",
    ),
    "dangling value": (
        lambda text: swap(text, '"xA1": "mug"', '"xA1": "mgu"'), {},
        r"plan.tpnu.json:\d+:\d+: found xA1 = 'mgu' .*, expected a value of xA1; did you mean 'mug'\?",
    ),
    "unknown action": (lambda text: swap(text, "(get human mug)", "(get human jug)"), {}, r"plan.tpnu.json:.*jug.*"),
    "syntax": (lambda text: swap(text, "]", ""), {}, r"plan.tpnu.json:7:62: found ':', expected ',' or '\]'"),
    "not a number": (
        lambda text: swap(text, '"upper": 7', '"upper": NaN'), {}, r"plan.tpnu.json:106:\d+: found 'NaN', expected",
    ),
    "no domain": (str, {"domain": None}, r"domain.pddl: found no such file, expected a readable text file"),
    "binary": (str, {"domain": b"\xff\xfe"}, r"domain.pddl: found byte 0xff in line 1, expected a UTF-8 text file"),
    "swapped": (
        str, {"domain": (KITCHEN.parent / "problem.pddl").read_text()},
        r"domain.pddl:1:9: found a problem, expected a domain; are the files in the right order\?",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("change", "files", "message"), BAD.values(), ids=BAD)
def test_bad_plans_are_refused_by_every_command(tmp_path, change, files, message):
    file = kitchen_with(tmp_path, change, **files)
    drawing = tmp_path / "plan.svg"
    for arguments in (["check", file], ["compile", file], ["plot", file, "-o", drawing]):
        ended = command("pike", *arguments)
        assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)
        assert re.fullmatch(f"robust: error: .*{message}.*\n", ended.err), ended.err
    assert not drawing.exists()


@pytest.mark.parametrize("backend", ["oracle", "pitms", "bdd"])
def test_a_plan_without_choices(tmp_path, backend):
    assert command("pike", "check", sat_plan([]).write(tmp_path), "--backend", backend).code == 0


def test_reasons_as_json():
    words = ("--outcome", "xA1=mug", "--outcome", "xA3=bagel", "--explain", "--json")
    ended = command("pike", "run", KITCHEN, *words)
    answer = answer_of(ended, "robust/pike-run/1")
    inferred = next(step["why"]["inferences"] for step in answer["steps"] if step["possible"])
    assert {fact["fact"] for fact in inferred["xR1"]["impossible"]["juice"]} >= {"xA2 = coffee"}
    failure = answer["steps"][-1]["decisions"][-1]
    assert (ended.code, failure["what"]) == (1, "failed")
    assert {"about": "choice", "fact": "xA3 = bagel"} in failure["why"]["conflict"]
    first = answer["steps"][0]["why"]["continuation"]
    assert first["scenario"].keys() == {"xA1", "xA2", "xA3", "xA4", "xR1", "xR2"}


def test_a_chart_says_what_happened(tmp_path):
    picture = tmp_path / "run.svg"
    assert command("pike", "run", KITCHEN, "--outcome", "xA1=mug", "--plot", picture, "--quiet").code == 0
    text = picture.read_text(encoding="utf-8")
    assert "(make-coffee human)" in text
    assert "xA3 must be cereal" in text


# -- who decides -------------------------------------------------------------------------------------------------------


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
    ended = command("pike", "run", KITCHEN, "--outcome", "xA1=mug", "--json", *words)
    answer = answer_of(ended, "robust/pike-run/1")
    assert (answer["reasoner"], answer["backend"]) == who
    assert (ended.code, answer["choices"]["xR1"], answer["choices"]["xA2"]) == (0, "grounds", "coffee")


def test_drake_takes_for_a_success_what_is_none():
    words = ("--reasoner", "drake", "--outcome", "xA1=glass", "--outcome", "xA2=coffee")
    ended = command("pike", "run", KITCHEN, "--json", *words)
    answer = answer_of(ended, "robust/pike-run/1")
    assert (ended.code, answer["status"], answer["reasoner"]) == (1, "failed", "drake")
    assert any("(have mug)" in fault for fault in answer["faults"])
    assert "says otherwise" in command("pike", "run", KITCHEN, *words).out
