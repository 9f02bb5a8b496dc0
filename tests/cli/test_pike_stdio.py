"""`robust pike run --stdio`: a process that any other drives, whatever happens to either of them."""

import json
import signal
import subprocess
import time
from fractions import Fraction
from functools import cache

import pytest

from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.online.journal import read_journal
from robust.pike_bridge.online.progress import Progress
from tests.cli.running import COMMAND, LOAD, environment
from tests.cli.running import process as robust_process
from tests.cli.stdio_driving import Process, Team
from tests.pike_bridge.online.examples import KITCHEN

MUG = {"xA1": "mug"}
START = [{"kind": "tick", "time": 0}, {"kind": "tick", "time": "1/1000"}]


def team(process):
    return Team(process, MUG, before())


@cache
def before():
    plan = load_team_plan(KITCHEN)
    not_before = Progress(plan).structure.not_before
    return {each.name: set(not_before[each.event]) for each in plan.network.choices if not each.controllable}


@cache
def undisturbed():
    """The decisions of the story with a mug, by a process that nothing happens to."""
    with Process(KITCHEN) as process:
        driver = team(process)
        driver.run()
        assert driver.closing["outcome"] == "succeeded"
        assert process.finish() == ([], "", 0)
        return driver.decisions


# -- a story -----------------------------------------------------------------------------------------------------------


def test_the_story_of_the_paper():
    decisions = undisturbed()
    assert [line["step"] for line in decisions] == sorted(line["step"] for line in decisions)
    chosen = {line["choice"]: line["value"] for line in decisions if line["kind"] == "chosen"}
    assert chosen == {"xA1": "mug", "xR1": "grounds", "xA2": "coffee", "xA3": "cereal", "xR2": "milk", "xA4": "cereal"}
    assert "(make-coffee human)" in {line["action"] for line in decisions if line["kind"] == "dispatched"}
    assert decisions[-1]["kind"] == "succeeded"


def test_hello_and_questions():
    with Process(KITCHEN) as process:
        assert process.greeting == [
            {
                "kind": "hello",
                "schema": "robust/pike-stdio/1",
                "plan": "kitchen",
                "epsilon": "1/1000",
                "grid": "1/1000",
                "backend": "smt",
                "resumed": False,
                "steps": 0,
            },
            {"kind": "wake", "time": "0", "step": 0},
        ]
        for line in START:
            process.ask(line)
        process.ask({"kind": "outcome", "choice": "xA1", "value": "mug", "time": "1/1000"})
        values = process.ask({"kind": "possible"})[-1]["values"]
        assert values == {"xR1": ["grounds"], "xA2": ["coffee"], "xA3": ["cereal"], "xR2": ["milk"], "xA4": ["cereal"]}
        assert process.ask({"kind": "why"}) == [{"kind": "why", "line": 5, "possible": True, "conflict": None}]
        facts = process.ask({"kind": "why", "assume": {"xA3": "bagel"}})[-1]["conflict"]
        assert [fact["fact"] for fact in facts] == ["xA1 = mug", "xA3 = bagel, if it were so"]
        state = process.ask({"kind": "state"})[-1]
        assert (state["choices"], state["schedule"], state["outcome"]) == (
            MUG,
            {"e_initial": "0", "e1": "1/1000"},
            None,
        )
        lines, err, code = process.finish()
        assert lines == [{"kind": "end", "outcome": "waiting", "time": "1/1000", "step": 3}]
        assert (err, code) == ("", 3)


def test_a_failure_can_be_asked_about():
    with Process(KITCHEN) as process:
        for line in START:
            process.ask(line)
        outcomes = [
            {"kind": "outcome", "choice": "xA1", "value": "mug"},
            {"kind": "outcome", "choice": "xA3", "value": "bagel"},
        ]
        *_, failed, end = process.ask({"kind": "together", "messages": outcomes, "time": "1/1000"})
        assert (failed["kind"], end["outcome"]) == ("failed", "failed")
        assert {fact["fact"] for fact in process.ask({"kind": "why"})[-1]["conflict"]} == {"xA1 = mug", "xA3 = bagel"}
        late = process.ask({"kind": "tick", "time": 9})
        assert late == [end]
        assert process.finish() == ([], "", 1)


# -- processes that die ------------------------------------------------------------------------------------------------


def test_killed_and_resumed_again_and_again(tmp_path):
    """After an answer, before it, or while it is worked on: the execution is the one that nothing happened to."""
    journal = tmp_path / "journal"
    arguments = (KITCHEN, "--journal", journal)
    moments = {2: None, 3: 0.0, 7: 0.004, 12: 0.015, 17: 0.04}
    process = Process(*arguments)
    driver = team(process)
    driver.hear(process.greeting)
    while driver.closing["kind"] != "end":
        if driver.sent in moments:
            last = driver.say_and_kill(moments.pop(driver.sent))
            process = Process(*arguments)
            driver.go_on(process, last)
        else:
            driver.step()
    assert not moments
    assert driver.decisions == undisturbed()
    assert process.finish() == ([], "", 0)
    process.kill()
    recorded = [decision for step in read_journal(journal, load_team_plan(KITCHEN)) for decision in step.decisions]
    assert len(recorded) == len(driver.decisions)
    with Process(*arguments) as over:
        *repeated, end = over.greeting
        assert [line["kind"] for line in repeated[1:]] == [line["kind"] for line in driver.decisions]
        assert end["outcome"] == "succeeded"
        assert over.finish() == ([], "", 0)


def test_a_journal_that_was_cut_off_in_its_last_line(tmp_path):
    journal = tmp_path / "journal"
    with Process(KITCHEN, "--journal", journal) as process:
        for line in START:
            process.ask(line)
    content = journal.read_bytes()
    journal.write_bytes(content[:-20])
    with Process(KITCHEN, "--journal", journal) as process:
        assert process.greeting[0]["steps"] == 1
        process.ask(START[1])
        assert journal.read_bytes() == content


def test_journals_that_do_not_fit(tmp_path):
    journal = tmp_path / "journal"
    Process(KITCHEN, "--journal", journal).kill()
    content = journal.read_bytes()
    ended = robust_process("pike", "run", KITCHEN, "--stdio", "--journal", journal, "--epsilon", "1/500")
    assert (ended.code, ended.out) == (2, "")
    assert ended.err == f"robust: error: {journal}:1: found a journal with ε = 1/1000, expected one with 1/500\n"
    journal.write_bytes(content + b"{}\n" + content)
    ended = robust_process("pike", "run", KITCHEN, "--stdio", "--journal", journal)
    assert ended.code == 2
    assert ended.err.startswith(f"robust: error: {journal}:2:1: found no field 'checksum'")
    assert len(ended.err.splitlines()) == 1


# -- drivers that err --------------------------------------------------------------------------------------------------

NOISE = [
    (b"\xff\xfe\n", "found bytes that are no UTF-8"),
    ("{", "found the end of the file, expected"),
    ("[]", "found an empty list, expected a JSON object"),
    ('{"kind": "tik", "time": 0}', "found kind 'tik', expected one of outcome"),
    ('{"kind": "tick"}', "found no field 'time', expected a number"),
    ('{"kind": "tick", "time": NaN}', "found 'NaN', expected a JSON value"),
    ('{"kind": "tick", "time": "inf"}', "found 'inf', expected a number"),
    ('{"kind": "tick", "time": true}', "found true, expected a number"),
    ('{"kind": "tick", "time": -1}', "found time -1, expected 0 or later"),
    ('{"kind": "tick", "time": 1e999999}', "expected a number of at most 300 digits"),
    ('{"kind": "outcome", "choice": "xB", "value": "mug", "time": 0}', "found unknown choice 'xB'"),
    ('{"kind": "outcome", "choice": "xA1", "value": "cup", "time": 0}', "expected one of mug, glass"),
    ('{"kind": "outcome", "choice": "xR1", "value": "juice", "time": 0}', "not for the executive to make"),
    ('{"kind": "completion", "action": "(fly human)", "time": 0}', "found unknown activity '(fly human)'"),
    ('{"kind": "estimate", "true": ["toaster"], "time": 0}', "expected an atom such as"),
    ('{"kind": "together", "messages": [{"kind": "tick"}], "time": 0}', "found kind 'tick', expected one of"),
    ('{"kind": "why", "assume": {"xB": "mug"}}', "there is no choice 'xB'"),
    (b"[" * 200 + b"\n", "nested more than 100 deep"),
    (b"x" * (1 << 20) + b"xx\n", "found a line of more than 1048576 bytes"),
]


def test_bad_lines_are_named_and_change_nothing():
    with Process(KITCHEN) as process:
        driver = team(process)
        for number, (line, said) in enumerate(NOISE, 1):
            (error,) = process.ask(line)
            assert (error["kind"], error["line"]) == ("error", number)
            assert said in error["message"]
            assert error["message"].startswith(f"input:{number}:")
        driver.run()
        assert driver.decisions == undisturbed()
        assert process.finish() == ([], "", 0)


def test_a_last_line_without_an_end_and_empty_lines():
    with Process(KITCHEN) as process:
        process.send(b'\n\r\n{"kind": "tick", "time": 0}\r\n')
        assert process.answer()[-1] == {"kind": "wake", "time": "1/1000", "step": 1}
        process.send(b'{"kind": "state"')
        lines, _, code = process.finish()
        assert [line["kind"] for line in lines] == ["error", "end"]
        assert lines[0]["line"] == 4
        assert code == 3


# -- ends that nobody asked for ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("clock", ["given", "real"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals(tmp_path, clock, number):
    journal = tmp_path / "journal"
    with Process(KITCHEN, "--journal", journal, "--clock", clock) as process:
        if clock == "given":
            process.ask(START[0])
        else:
            process.answer()
        lines, err, code = process.stop(number)
        assert [(line["kind"], line.get("outcome")) for line in lines][-1] == ("end", "interrupted")
        assert (err, code) == ("", 3)
    assert len(read_journal(journal, load_team_plan(KITCHEN))) == lines[-1]["step"]


@pytest.mark.parametrize("clock", [["given"], ["real", "--rate", "100"]])
def test_time_limits(clock):
    """In real time slowly: at its own rate the plan fails after two seconds if nobody reports anything."""
    started = time.monotonic()
    with Process(KITCHEN, "--timeout", 3 * LOAD, "--clock", *clock) as process:
        lines = []
        while (line := process.line()) is not None:
            lines.append(line)
        assert (lines[-1]["kind"], lines[-1]["outcome"]) == ("end", "timeout")
        assert process.running.wait(30) == 3
    assert 2.5 < time.monotonic() - started < 20 * LOAD


def test_a_time_limit_before_anything_is_known():
    ended = robust_process("pike", "run", KITCHEN, "--stdio", "--timeout", "1e-9")
    assert (ended.code, ended.out) == (3, "")
    assert ended.err == "robust: out of time\n"


def test_a_driver_that_stops_reading_and_one_that_leaves(tmp_path):
    journal = tmp_path / "journal"
    with Process(KITCHEN, "--journal", journal) as process:
        process.running.stdout.close()
        process.send(START[0])
        assert process.running.wait(30) == 3
        assert process.running.stderr.read() == b""
    assert len(read_journal(journal, load_team_plan(KITCHEN))) == 1
    with Process(KITCHEN, "--journal", journal) as process:
        assert process.greeting[0]["steps"] == 1
        process.send(b'{"kind": "state"}\n' * 2000)  # more answers than a pipe holds
        time.sleep(1.5)
        process.running.send_signal(signal.SIGTERM)
        assert process.running.wait(30) == 3


def test_a_journal_that_cannot_be_written_any_more(tmp_path):
    """A limit for the size of files takes the place of a full disk."""
    journal = tmp_path / "journal"
    words = " ".join([*COMMAND, "pike", "run", str(KITCHEN), "--stdio", "--journal", str(journal)])
    lines = "".join(f'{{"kind": "tick", "time": {number}}}\n' for number in range(40))
    done = subprocess.run(
        ["bash", "-c", f"trap '' XFSZ; ulimit -f 1; exec {words}"],
        input=lines,
        capture_output=True,
        text=True,
        env=environment(),
        timeout=60,
        check=False,
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert answers[-1]["kind"] == "error"
    assert answers[-1]["line"] is None
    assert "cannot be written: File too large" in answers[-1]["message"]
    assert done.returncode == 2
    assert done.stderr == f"robust: error: {answers[-1]['message']}\n"
    announced = [line["step"] for line in answers if "step" in line]
    assert max(announced) == len(read_journal(journal, load_team_plan(KITCHEN)))


# -- real time ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def patient(tmp_path):
    """The kitchen, where everything may take long."""
    plan = json.loads(KITCHEN.read_text(encoding="utf-8"))
    for constraint in (*plan["activities"], *plan["constraints"]):
        constraint["upper"] = constraint["upper"] and 1000
    for name in ("domain", "problem"):
        plan[name] = str(KITCHEN.parent / plan[name])
    path = tmp_path / "patient.tpnu.json"
    path.write_text(json.dumps(plan), encoding="utf-8")
    return path


RATE = Fraction(1, 20)
"""Seconds for a unit of time."""


def test_real_time_makes_the_same_choices(patient, tmp_path):
    journal = tmp_path / "journal"
    story = {line["choice"]: line["value"] for line in undisturbed() if line["kind"] == "chosen"}
    plans = [{"kind": "outcome", "choice": choice, "value": story[choice]} for choice in before()]
    decisions = []
    with Process(patient, "--clock", "real", "--rate", RATE, "--journal", journal) as process:
        begun = time.monotonic()
        process.send({"kind": "together", "messages": plans})  # people say beforehand what they will do
        ended = None
        while ended is None:
            line = process.line()
            assert line is not None, process.running.stderr.read()
            decisions.append(line)
            match line["kind"]:
                case "dispatched":
                    time.sleep(float(Fraction(line["lower"]) * RATE))
                    process.send({"kind": "completion", "action": line["action"], "event": line["end"]})
                case "end":
                    ended = line
                case "error":
                    raise AssertionError(line)
        seconds = time.monotonic() - begun
        assert ended["outcome"] == "succeeded"
        assert process.finish() == ([], "", 0)
    chosen = {line["choice"]: line["value"] for line in decisions if line["kind"] == "chosen"}
    assert chosen == story
    times = [Fraction(line["time"]) for line in decisions if "step" in line and line["kind"] != "wake"]
    assert times == sorted(times)
    assert all((1000 * each).denominator == 1 for each in times)
    assert times[-1] * RATE <= seconds + 1
    assert read_journal(journal, load_team_plan(patient))


def test_in_real_time_the_input_may_end_with_the_execution():
    outcomes = [
        {"kind": "outcome", "choice": "xA1", "value": "mug"},
        {"kind": "outcome", "choice": "xA3", "value": "bagel"},
    ]
    with Process(KITCHEN, "--clock", "real") as process:
        process.send({"kind": "together", "messages": outcomes})
        process.send({"kind": "why"})
        lines, err, code = process.finish()
        assert [line["kind"] for line in lines][-3:] == ["failed", "end", "why"]
        assert (err, code) == ("", 1)


def test_real_time_goes_on_where_the_journal_ends(tmp_path):
    arguments = (KITCHEN, "--clock", "real", "--rate", "2", "--journal", tmp_path / "journal")
    with Process(*arguments) as process:
        first = [process.line() for _ in range(5)]
        process.kill()
    with Process(*arguments) as process:
        hello, *repeated = process.greeting
        last = Fraction(repeated[-2]["time"])
        assert hello["resumed"]
        told = [{**line, "repeated": True} for line in first if line["kind"] not in {"hello", "wake"}]
        assert told
        assert repeated[: len(told)] == told
        process.send({"kind": "outcome", "choice": "xA1", "value": "mug"})
        while (line := process.line())["kind"] != "chosen" or line["choice"] != "xA1":
            assert line["kind"] in {"executed", "wake", "chosen", "dispatched"}
        assert last <= Fraction(line["time"]) <= last + 2


def test_without_an_input():
    words = [*COMMAND, "pike", "run", str(KITCHEN), "--stdio"]
    done = subprocess.run(
        ["bash", "-c", 'exec "$@" <&-', "-", *words], capture_output=True, env=environment(), check=False
    )
    assert (done.returncode, done.stdout) == (2, b"")
    assert done.stderr == b"robust: error: --stdio: found no standard input, expected lines of JSON\n"


def test_in_real_time_messages_have_no_time():
    with Process(KITCHEN, "--clock", "real", "--rate", 100) as process:
        process.send('{"kind": "tick", "time": 1}')
        while (line := process.line())["kind"] != "error":
            assert line["kind"] in {"executed", "wake"}
        assert line["message"] == "input:1:26: found a time, expected none: the clock is real"
