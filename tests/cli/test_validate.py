"""`robust validate`: any number of plans, some of which cannot be read; lists; standard input; untimely ends."""

import signal

import pytest

from tests.cli import inputs
from tests.cli.running import answer_of, assert_one_line, command, process, stopped

GOING = "0: (go a b) [5]\n"
TOO_LONG = "0: (go a b) [5.25]\n"
UNREADABLE = "0: (go a b [5]\n"
ROUNDED = "0.000: (go a b) [4.9999]\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A directory with a problem and plans, which is the working directory."""
    inputs.write(tmp_path)
    (tmp_path / "lists").mkdir()
    texts = {"good": GOING, "long": TOO_LONG, "bad": UNREADABLE, "rounded": ROUNDED}
    for name, text in texts.items():
        (tmp_path / f"{name}.txt").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def judged(*arguments):
    return command("validate", "domain.pddl", "problem.pddl", *arguments)


def test_one_plan(here):
    ended = judged("good.txt")
    assert (ended.code, ended.out, ended.err) == (0, "valid: 1 step, ends at 5\n", "")
    ended = judged("long.txt")
    assert (ended.code, ended.err) == (1, "")
    assert ended.out.splitlines() == [
        "invalid: 1 step, ends at 5.25; 1 violation",
        "  at 0: (go a b) demands (= ?duration 5), but ?duration = 5.25 != 5, by 0.25 (line 1)",
        "  --tolerance 0.25 would make it valid",
    ]
    assert judged("long.txt", "--quiet").out == "invalid: 1 step, ends at 5.25; 1 violation\n"
    assert judged("long.txt", "--tolerance", "0.25").code == 0
    assert_one_line(judged("bad.txt"))
    assert_one_line(judged("gone.txt"))
    ended = judged("plan.stn")
    assert_one_line(ended)
    assert "robust check DOMAIN PROBLEM plan.stn judges all schedules of the network" in ended.err


def test_others_are_judged_beside_a_plan_that_cannot_be_read(here):
    ended = judged("long.txt", "bad.txt", "good.txt", "gone.txt", "plan.stn", "rounded.txt", "--quiet")
    assert (ended.code, ended.err) == (2, "")
    assert [line.split(": ")[:2] for line in ended.out.splitlines()[:-1]] == [
        ["long.txt", "invalid"],
        ["error", "bad.txt:1:1"],
        ["good.txt", "valid"],
        ["error", "gone.txt"],
        ["error", "plan.stn"],
        ["rounded.txt", "valid"],
    ]
    assert ended.out.splitlines()[-1] == "2 valid, 1 invalid, 3 errors"
    assert judged("long.txt", "good.txt").code == 1
    assert judged("good.txt", "good.txt").code == 0


def test_json(here):
    ended = judged("long.txt", "bad.txt", "rounded.txt", "--json", "--tolerance", "1/1000")
    answer = answer_of(ended, "robust/validate/1")
    assert (ended.code, answer["status"], answer["valid"]) == (2, "complete", 1)
    assert (answer["epsilon"], answer["tolerance"]) == ("1/1000", "1/1000")
    long, bad, rounded = answer["plans"]
    (violation,) = long["violations"]
    assert (violation["time"], violation["amount"], violation["lines"]) == ("0", "1/4", [1])
    assert violation["obligation"] == "n0 go: duration (= ?duration 5)"
    assert (long["end"], long["remedies"]) == ("21/4", {"tolerance": "1/4", "epsilon": None})
    assert (bad["verdict"], bad["steps"], bad["error"][:9]) == ("error", None, "bad.txt:1")
    assert (rounded["verdict"], rounded["violations"], rounded["error"]) == ("valid", [], None)
    assert rounded["shift"] == {"durations": 1, "starts": 0, "most": "1/10000"}
    assert answer_of(judged("good.txt", "--json"))["plans"][0]["shift"] is None


def test_what_is_wrong_with_the_problem_is_said_once(here):
    (here / "problem.pddl").write_text("(define", encoding="utf-8")
    ended = judged("good.txt", "long.txt", "gone.txt")
    assert_one_line(ended)
    assert "problem.pddl" in ended.err


def test_what_cannot_be_decided_is_the_worst(here):
    squared = inputs.DOMAIN.replace("(at start (>= (fuel) 1))", "(over all (>= (* (fuel) (fuel)) 1))")
    moving = squared.replace("(at end (decrease (fuel) 1))", "(increase (fuel) (* #t 1))")
    (here / "other.pddl").write_text(moving, encoding="utf-8")
    ended = command("validate", "other.pddl", "problem.pddl", "good.txt", "gone.txt", "--json")
    assert ended.code == 4
    assert [one["verdict"] for one in answer_of(ended)["plans"]] == ["unsupported", "error"]


LIST = """# plans of one trip
../domain.pddl ../problem.pddl ../good.txt
../domain.pddl ../problem.pddl '../long.txt'   # by a quarter

../gone.pddl ../problem.pddl ../good.txt
"""


def test_a_list(here):
    (here / "lists" / "all.txt").write_text(LIST, encoding="utf-8")
    ended = command("validate", "--list", "lists/all.txt", "--json")
    plans = answer_of(ended)["plans"]
    assert ended.code == 2
    assert [(one["plan"], one["verdict"]) for one in plans] == [
        ("lists/../good.txt", "valid"),
        ("lists/../long.txt", "invalid"),
        ("lists/../good.txt", "error"),
    ]
    assert plans[2]["error"].startswith("lists/../gone.pddl: found no such file")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("\n# nothing\n", "all.txt: found no plan, expected lines of DOMAIN PROBLEM PLAN"),
        ("domain.pddl good.txt\n", "all.txt:1: found 2 files, expected DOMAIN PROBLEM PLAN"),
        ("\na 'b c\n", 'all.txt:2: found "a \'b c", expected quotes in pairs'),
    ],
)
def test_wrong_lists(here, text, says):
    (here / "all.txt").write_text(text, encoding="utf-8")
    ended = command("validate", "--list", "all.txt")
    assert_one_line(ended)
    assert says in ended.err


@pytest.mark.parametrize("arguments", [(), ("domain.pddl",), ("domain.pddl", "problem.pddl", "--quiet")])
def test_nothing_to_judge(here, arguments):
    ended = command("validate", *arguments)
    assert_one_line(ended)
    assert "expected DOMAIN PROBLEM PLAN..., or else --list FILE" in ended.err
    assert "beside --list" in command("validate", *arguments, "a", "b", "c", "--list", "d").err


def test_standard_input_and_what_of_a_log_was_picked(here):
    log = f"Reading ...\n{GOING}\n; Plan found: better\n{TOO_LONG}"
    arguments = ("validate", "domain.pddl", "problem.pddl", "-")
    ended = process(*arguments, given=log)
    assert (ended.code, ended.err) == (
        1, "robust: <stdin>: picked plan 2 of 2 (line 5); skipped 1 line that is no step\n",
    )  # fmt: skip
    assert "(line 5)" in ended.out
    assert answer_of(process(*arguments, "--json", given=log))["notes"] == [ended.err[8:-1]]
    ended = process(*arguments, "--plan-number", "1", "--quiet", given=log)
    assert (ended.code, ended.out, ended.err) == (0, "valid: 1 step, ends at 5\n", "")
    ended = process(*arguments, given="nothing\n")
    assert (ended.code, ended.out) == (2, "")
    assert ended.err.startswith("robust: error: <stdin>:2: empty plan")


def test_interrupted_it_tells_what_was_judged(here):
    """A list that nobody has the time for."""
    line = "domain.pddl problem.pddl long.txt\n"
    (here / "all.txt").write_text(line * 20_000, encoding="utf-8")
    arguments = ("validate", "--list", here / "all.txt", "--json", "--verbose")
    ended = stopped(*arguments, after="plan 9 of 20000", number=signal.SIGINT)
    answer = answer_of(ended)
    assert (ended.code, answer["status"], answer["valid"]) == (3, "interrupted", 0)
    assert 8 <= len(answer["plans"]) < 20_000
    assert f"robust: interrupted after {len(answer['plans'])} plans" in ended.err
