"""`robust watch --planner`: another plan while the run goes on; every failure is an answer."""

import json
import shlex
import signal
import subprocess
import sys
import time

import jsonschema
import pytest

import robust
from tests.cli.running import EXAMPLES, assert_one_line, command, process, started
from tests.schemas import schema

WORKSHOP = EXAMPLES / "workshop"
FILES = [str(WORKSHOP / name) for name in ("domain.pddl", "problem.pddl", "plan.log")]
OPTIONS = ("--deadline", "110", "-q", "--coming", "3", "--planning-time", "2")
FAILED = ['{"start": "n0", "at": 0}', '{"end": "n0", "at": 13}', '{"failed": "saw bob table", "at": 14}']
PLAN = """0: (paint ann chair) [20]
0: (saw bob table) [18]
20.01: (pack ann chair) [6]
20.01: (paint bob table) [26]
26.02: (saw ann shelf) [9]
46.02: (pack bob table) [8]
46.02: (paint ann shelf) [14]
60.03: (pack ann shelf) [5]
"""


def planner(tmp_path, what=f"print({PLAN!r})", limit=20):
    """Options for a planner that is a program of ours."""
    script = tmp_path / "planner.py"
    script.write_text(f"import os, sys, time\n{what}\n")
    words = (sys.executable, str(script), "{domain}", "{problem}")
    return ("--planner", "command:" + shlex.join(words).replace("'{", "{").replace("}'", "}"), "--planner-limit", limit)


def watched(*options, said=FAILED):
    """The exit code and the lines that come out."""
    ended = process("watch", *FILES, *OPTIONS, *options, input="\n".join(said))
    assert ended.err == ""
    lines = [json.loads(line) for line in ended.out.splitlines()]
    for line in lines if "decimal" not in options else ():
        jsonschema.validate(line, schema("robust/watch/1"))
    return ended.code, lines


def news(lines):
    return [line["planning"] for line in lines if "planning" in line]


def test_a_plan_that_is_broken_is_followed_by_another(tmp_path):
    code, lines = watched(*planner(tmp_path))
    assert code == 3
    assert [line["prospect"] for line in lines] == ["on track"] * 3 + ["broken"] * 2 + ["on track"]
    asked, found = news(lines)
    assert asked == {"status": "asked", "begins": "1601/100", "limit_s": 20}
    assert (found["status"], found["plans"], found["begins"]) == ("found", 1, "1601/100")
    assert [look["name"] for look in lines[-1]["coming"]] == ["paint ann chair", "saw bob table", "pack ann chair"]
    assert [look["start"][0] for look in lines[-1]["coming"][:2]] == ["1601/100"] * 2
    for what, name in {"domain": "d.pddl", "problem": "p.pddl", "plan": "q.stn", "parameters": "q.toml"}.items():
        (tmp_path / name).write_text(found[what])
    read = robust.load_plan(*(tmp_path / name for name in ("d.pddl", "p.pddl", "q.stn")))
    assert robust.check(read).answer is robust.Answer.PROVED


def test_the_run_goes_on_with_the_new_plan_and_can_be_asked_for_one(tmp_path):
    more = ['{"start": "paint ann chair", "at": 17}', '{"replan": true}']
    log = planner(tmp_path, f"print(open({FILES[2]!r}).read())")
    _, lines = watched("--numbers", "decimal", *log, said=['{"replan": true}'])
    assert [each["status"] for each in news(lines)] == ["asked", "found"]
    assert news(lines)[0]["begins"] == 2.01
    with started("watch", *FILES, *OPTIONS, *planner(tmp_path), stdin=subprocess.PIPE) as running:
        running.stdin.write("\n".join(FAILED) + "\n")
        running.stdin.flush()
        lines = [json.loads(running.stdout.readline()) for _ in range(6)]
        assert news(lines)[-1]["status"] == "found"
        running.stdin.write("\n".join(more) + "\n")
        running.stdin.close()
        lines = [json.loads(line) for line in running.stdout.read().splitlines()]
    assert [look["step"] for look in lines[0]["running"]] == ["n9"]
    assert [each["status"] for each in news(lines)] == ["asked", "failed"]
    assert "nonsense" in news(lines)[1]["reason"], "the plan is none from there"
    assert lines[-1]["prospect"] == "on track", "of the plan that it had"


@pytest.mark.parametrize(
    ("what", "reason"),
    [
        ("print('no plan')", "python: no plan: no plan"),
        ("sys.exit('ouch')", "python: crashed: exit code 1: ouch"),
        ("print('0: (paint ann table) [20]')", "python: nonsense:"),
        ("time.sleep(60)", "python: timeout: no valid plan before the deadline"),
        (f"print({PLAN.replace('20.01', '95')!r})", "python: nonsense:"),
    ],
)
def test_without_a_plan_the_reason_is_said_and_the_run_goes_on(tmp_path, what, reason):
    _, lines = watched(*planner(tmp_path, what, 2), said=[*FAILED, '{"tick": 15}'])
    assert [line["message"] for line in lines if "planning" not in line] == [0, 1, 2, 3, 4]
    assert [each["status"] for each in news(lines)] == ["asked", "failed"], "a tick is no reason to ask again"
    said = news(lines)[1]["reason"].replace("python3", "python")
    assert said.startswith(reason)
    assert "\n" not in said


def test_answers_go_on_while_a_planner_thinks_and_what_it_does_not_know_of_is_thought_over(tmp_path):
    slow = planner(tmp_path, f"time.sleep(1.5)\nprint({PLAN!r})")
    with started("watch", *FILES, *OPTIONS, *slow, stdin=subprocess.PIPE) as running:
        running.stdin.write("\n".join(FAILED) + "\n")
        running.stdin.flush()
        for _ in range(5):
            running.stdout.readline()
        begun = time.monotonic()
        for line in ('{"start": "n2", "at": 15}', '{"replan": true}'):
            running.stdin.write(line + "\n")
            running.stdin.flush()
            answer = json.loads(running.stdout.readline())
        assert time.monotonic() - begun < 1
        assert answer["error"] == "another plan has been asked for already; expected its answer first"
        running.stdin.close()
        lines = [json.loads(line) for line in running.stdout.read().splitlines()]
    assert [each["status"] for each in news(lines)] == ["overtaken", "asked", "failed"]


def test_a_journal_holds_plans_and_what_was_asked(tmp_path):
    journal = ("--journal", tmp_path / "run.journal")
    _, lines = watched(*journal, *planner(tmp_path), said=[*FAILED])
    _, resumed = watched(*journal, said=['{"start": "paint ann chair", "at": 17}'])
    assert {**resumed[0], "planning": 0} == {**lines[-1], "planning": 0}
    assert [look["step"] for look in resumed[1]["running"]] == ["n9"]


def test_a_plan_that_was_asked_for_when_the_process_died_is_asked_for_again(tmp_path):
    journal = ("--journal", tmp_path / "run.journal")
    slow = planner(tmp_path, "time.sleep(60)")
    with started("watch", *FILES, *OPTIONS, *journal, *slow, stdin=subprocess.PIPE) as running:
        running.stdin.write("\n".join(FAILED) + "\n")
        running.stdin.flush()
        lines = [json.loads(running.stdout.readline()) for _ in range(5)]
        assert news(lines)[-1]["status"] == "asked"
        running.send_signal(signal.SIGKILL)
    _, lines = watched(*journal, *planner(tmp_path), said=[])
    assert [each["status"] for each in news(lines)] == ["asked", "found"]
    assert lines[-1]["prospect"] == "on track"
    _, again = watched(*journal, said=[])
    assert {**again[0], "planning": 0} == {**lines[-1], "planning": 0}


def test_nobody_to_ask(tmp_path):
    _, lines = watched(said=[*FAILED, '{"replan": true}'])
    assert news(lines) == []
    assert lines[-1]["error"] == "found a message that asks for another plan, expected it with --planner NAME"
    assert_one_line(command("watch", *FILES, "-q", "--planner", "nobody"), says="expected aries, kairos or command:TEM")
