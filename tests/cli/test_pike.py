"""`robust pike`: answers, exit codes, and errors that name the place."""

import json
import re

import pytest

from benchmarks.generators.pike import sat_plan
from robust.pike_bridge.generators.stories import figure_23
from tests.cli.running import EXAMPLES, answer_of, command

KITCHEN = EXAMPLES / "kitchen" / "kitchen.tpnu.json"


@pytest.mark.parametrize("backend", ["oracle", "pitms", "atms", "sat", "bdd"])
def test_check(backend):
    ended = command("pike", "check", KITCHEN, "--backend", backend, "--assume", "xA1=mug", "--all-scenarios", "--json")
    answer = answer_of(ended, "robust/pike-check/1")
    assert (ended.code, ended.err, answer["verdict"], answer["complete"]) == (0, "", "proved", True)
    assert answer["scenarios"] == [answer["scenario"]]
    assert answer["scenario"]["xA4"] == "cereal"
    assert answer["schedule"]["e_initial"] == "0"
    refuted = command("pike", "check", KITCHEN, "--backend", backend, "--assume", "xA1=mug", "--assume", "xR1=juice")
    assert (refuted.code, refuted.out) == (1, "No correct execution exists.\n")


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


def test_check_in_words():
    ended = command("pike", "check", KITCHEN, "--assume", "xA1=glass", "--all-scenarios")
    assert "A correct execution exists.\n" in ended.out
    assert "(get human glass)  [human]" in ended.out
    assert "2 team scenarios:\n" in ended.out
    late = command("pike", "check", KITCHEN, "--timeout", "0.000001", "--json")
    assert late.code == 3


def test_compile():
    ended = command("pike", "compile", KITCHEN, "--implicants", "--json")
    answer = answer_of(ended, "robust/pike-compile/1")
    assert (ended.code, answer["status"], answer["satisfiable"]) == (0, "complete", True)
    assert answer["prime_implicants"] == len(answer["implicants"]) == 3
    assert answer["models"] >= 3
    assert set(answer["seconds"]) == {"precedence", "links", "conflicts", "knowledge"}
    text = command("pike", "compile", KITCHEN, "--backend", "bdd", "--temporal", "apsp")
    assert text.out.startswith("Compiled: a correct execution exists.\n")
    assert "\n  prime implicants: 3\n" in text.out


def test_every_back_end_that_knows_implicants_reports_the_same():
    found = [
        answer_of(
            command("pike", "compile", KITCHEN, "--backend", backend, "--implicants", "--json"), "robust/pike-compile/1"
        )
        for backend in ("pitms", "bdd")
    ]
    assert [answer["prime_implicants"] for answer in found] == [3, 3]
    assert sorted(map(str, found[0]["implicants"])) == sorted(map(str, found[1]["implicants"]))
    for backend in ("atms", "sat"):
        answer = answer_of(
            command("pike", "compile", KITCHEN, "--backend", backend, "--no-models", "--json"), "robust/pike-compile/1"
        )
        assert (answer["satisfiable"], answer["prime_implicants"]) == (True, None)
        refused = command("pike", "compile", KITCHEN, "--backend", backend, "--implicants")
        assert (refused.code, refused.out) == (4, "")
        assert "expected --backend pitms or bdd" in refused.err


def test_unsatisfiable_and_empty_plans(tmp_path):
    wrong = sat_plan([[1], [-1]]).write(tmp_path / "wrong")
    nothing = sat_plan([]).write(tmp_path / "nothing")
    for shortcut in ("--shortcut", "--no-shortcut"):
        answer = answer_of(command("pike", "compile", wrong, shortcut, "--json"), "robust/pike-compile/1")
        assert (answer["satisfiable"], answer["prime_implicants"], answer["models"]) == (False, 0, 0)
    for backend in ("oracle", "pitms", "bdd"):
        assert command("pike", "check", wrong, "--backend", backend).code == 1
        assert command("pike", "check", nothing, "--backend", backend).code == 0


def test_cross(tmp_path):
    file = sat_plan([[1, 2], [-1, 2]]).write(tmp_path)
    ended = command("pike", "check", file, "--cross", "--json")
    answer = answer_of(ended, "robust/pike-cross/1")
    assert (ended.code, answer["agree"], answer["scenarios"], answer["disagreements"]) == (0, True, 2, [])
    assert len(answer["questions"]) == 8
    assert command("pike", "check", file, "--cross").out.startswith("All agree: 2 team scenarios, ")


def test_plot(tmp_path):
    ended = command("pike", "plot", KITCHEN, "-o", tmp_path / "plan.svg", "--links", "--assume", "xA1=mug", "--json")
    answer = answer_of(ended, "robust/pike-plot/1")
    assert (ended.code, answer["choices"]) == (0, 5)
    assert (tmp_path / "plan.svg").read_text().startswith("<?xml")
    assert command("pike", "plot", KITCHEN, "-o", tmp_path / "plan.gif").code == 2


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


def changed(change):
    """A change of the text of a plan, by a change of what it says."""

    def apply(text):
        plan = json.loads(text)
        change(plan)
        return json.dumps(plan, indent=1)

    return apply


def late_choice(constraint):
    """A new choice, an event that depends on it, and perhaps a constraint that has the wrong order."""

    def change(plan):
        plan["choices"].append({"name": "y", "domain": ["1", "2"], "controllable": True, "at": "n1"})
        plan["events"] += [{"name": "n1"}, {"name": "n2", "guard": {"y": "1"}}]
        if constraint:
            wrong = {"from": "n2", "to": "n1", "lower": 1, "upper": None, "guard": {"y": "1"}}
            plan["constraints"].append(wrong)

    return changed(change)


def cyclic(plan):
    plan["choices"][0]["at"], plan["choices"][1]["at"] = "e9", "e3"


def never_holding(plan):
    plan["choices"].append({"name": "y", "domain": ["1", "2"], "controllable": True, "at": "n1"})
    plan["constraints"].append({"from": "e3", "to": "n1", "lower": 0, "upper": None, "guard": {"xA1": "mug"}})
    plan["events"] += [{"name": "n1", "guard": {"xA1": "mug"}}, {"name": "n2", "guard": {"xA1": "glass", "y": "1"}}]


SAME = str
BAD = {
    "unknown key": (
        changed(lambda plan: plan["events"][2].update(gaurd={})), {},
        r"plan.tpnu.json:\d+:\d+: found key 'gaurd', expected one of an event; did you mean 'guard'\?",
    ),
    "twice": (
        lambda text: swap(text, '"name": "kitchen",', '"name": "kitchen", "name": "x",'), {},
        r"plan.tpnu.json:3:22: found a second 'name', expected one; the first is in line 3",
    ),
    "dangling event": (
        changed(lambda plan: plan["choices"][0].update(at="e99")), {},
        r"plan.tpnu.json:\d+:\d+: found event 'e99', expected one of the plan; did you mean",
    ),
    "dangling value": (
        changed(lambda plan: plan["events"][2].update(guard={"xA1": "mgu"})), {},
        r"plan.tpnu.json:\d+:\d+: found xA1 = 'mgu' .*, expected a value of xA1; did you mean 'mug'\?",
    ),
    "cycle": (changed(cyclic), {}, r"plan.tpnu.json:\d+:\d+: found choice 'xA1' .*xA1 needs xR1 needs xA1"),
    "never": (changed(never_holding), {}, r"plan.tpnu.json:\d+:\d+: .*which never holds: .* expected a guard that can"),
    "unordered": (
        late_choice(constraint=False), {}, r"plan.tpnu.json:\d+:\d+: .* may come before .*: add a constraint from n1",
    ),
    "too late": (
        late_choice(constraint=True), {},
        r"plan.tpnu.json:\d+:\d+: .* is ordered before the choice, expected event n1 first: let",
    ),
    "syntax": (lambda text: swap(text, "]", ""), {}, r"plan.tpnu.json:7:62: found ':', expected ',' or '\]'"),
    "empty": (lambda _: "", {}, r"plan.tpnu.json:1:1: found an empty file, expected a JSON document"),
    "not a number": (
        lambda text: swap(text, '"upper": 7', '"upper": NaN'), {}, r"plan.tpnu.json:106:\d+: found 'NaN', expected",
    ),
    "no domain": (SAME, {"domain": None}, r"domain.pddl: found no such file, expected a readable text file"),
    "binary": (SAME, {"domain": b"\xff\xfe"}, r"domain.pddl: found byte 0xff in line 1, expected a UTF-8 text file"),
    "cut off": (
        SAME, {"domain": (KITCHEN.parent / "domain.pddl").read_text()[:-20]},
        r"domain.pddl:\d+:\d+: found the end of the file, expected '\)' to close",
    ),
    "swapped": (
        SAME, {"domain": (KITCHEN.parent / "problem.pddl").read_text()},
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
    ended = command("pike", "check", file, "--cross", "--timeout", "1")
    assert (ended.code, ended.out.count("\n")) == (3, 1)
    assert ended.out.startswith("Undecided: out of time")


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
