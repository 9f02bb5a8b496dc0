"""`robust watch`: lines in, lines out, journals that survive, clocks."""

import json
import os
import signal
import subprocess
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import jsonschema
import pytest

from robust import Monitor, load_plan
from robust.cli.lines import LineWriter
from robust.execute.messages import MessageKind, MonitorMessage
from robust.show.execution import outlook_line
from robust.smt.limits import Deadline
from tests.cli.running import assert_one_line, process, started
from tests.execute.test_monitor import replay
from tests.sampling import often
from tests.schemas import schema

WORKSHOP = Path(__file__).parents[2] / "robust" / "examples" / "workshop"
FILES = [str(WORKSHOP / name) for name in ("domain.pddl", "problem.pddl", "plan.log")]
SAID = [
    '{"start": "saw ann chair", "at": 0.001}',
    '{"end": "n0", "at": "13"}',
    '{"start": "n1", "at": 13.5, "arrived": 14}',
    '{"tick": 20}',
]


GENERATING = [
    '{"start": "shift", "at": 0}',
    '{"value": "fuel gen", "is": 45, "at": 5.5}',
    '{"start": "pour_1", "at": 20}',
    '{"end": "pour_1", "at": 31}',
    '{"tick": 90}',
]
OPTIONS = ("--deadline", "90", "-q")


def watched(*options, said=SAID):
    """The exit code and the lines that come out."""
    ended = process("watch", *FILES, *OPTIONS, *options, input="\n".join(said))
    assert ended.err == ""
    return ended.code, [json.loads(line) for line in ended.out.splitlines()]


def spoken(running, *said):
    """The answers to lines of a process that goes on."""
    for line in said:
        running.stdin.write(line + "\n")
        running.stdin.flush()
    return [json.loads(running.stdout.readline()) for _ in said]


def test_what_is_said_is_answered_line_by_line():
    code, lines = watched()
    assert code == 3, "it is not over"
    for line in lines:
        jsonschema.validate(line, schema("robust/watch/1"))
    assert [line["message"] for line in lines] == [0, 1, 2, 3, 4]
    assert {line["prospect"] for line in lines} == {"on track"}
    assert [look["step"] for look in lines[1]["running"]] == ["n0"]
    assert lines[1]["warnings"] == ["fails unless n0 ends by 24.996"]
    assert lines[4]["time"] == "20"
    (running,) = lines[4]["running"]
    assert (running["step"], running["since"]) == ("n1", "27/2")


def test_a_plan_that_cannot_be_in_time_is_broken_and_says_why():
    code, lines = watched(said=['{"tick": 40}'])
    assert (code, lines[-1]["prospect"]) == (3, "at risk")
    assert "n0 takes as long as planned, 12" in lines[-1]["reasons"]
    code, lines = watched(said=[*SAID, '{"tick": 95}'])
    assert (code, lines[-1]["prospect"]) == (1, "broken")
    assert any("deadline" in reason for reason in lines[-1]["reasons"])


def test_decimals_are_rounded_to_the_safe_side():
    _, exact = watched(said=['{"start": "n0", "at": "1/3"}'])
    _, decimal = watched("--numbers", "decimal", said=['{"start": "n0", "at": "1/3"}'])
    for line in decimal:
        jsonschema.validate(line, schema("robust/watch/1"))
    assert exact[1]["running"][0]["since"] == "1/3"
    assert decimal[1]["running"][0]["since"] == 0.333333
    assert decimal[1]["running"][0]["end"][0] == 12.333334


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("nonsense", "input:1:1: found 'nonsense', expected a JSON value"),
        (
            '{"foo": 1}',
            "input:1:1: found 'foo', expected one of start, end, failed, cancelled, value, fact, tick, retract",
        ),
        ('{"start": "n0"}', "input:1:1: found no 'at', expected the time when it happened"),
        ('{"start": "n0", "end": "n0", "at": 1}', "input:1:1: found 2 of these, expected one of start"),
        ('{"start": "n0", "at": "NaN"}', "input:1:23: found 'NaN', expected"),
        ('{"tick": 1, "step": 2}', "input:1:13: found 'step' with tick, expected only tick"),
        ('{"start": "n0", "at": 1} {}', "input:1:26: found"),
        ("x" * (1 << 20) + "x", "found a line of more than 1048576 bytes"),
    ],
)
def test_a_line_that_is_no_message_is_answered_and_the_run_goes_on(line, message):
    code, lines = watched(said=[line, *SAID])
    assert code == 3
    assert lines[1]["error"].startswith(message) or message in lines[1]["error"]
    assert [each.get("message") for each in lines] == [0, None, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ('{"start": "saw an chair", "at": 1}', "did you mean 'saw ann chair' or"),
        ('{"end": "n0", "at": 14}', "found n0 end at 14 and at 13, expected one time; retract what was wrong first"),
        ('{"start": "n0", "at": -1}', "found time -1, expected at least 0"),
        ('{"start": "n2", "at": 3, "arrived": 2}', "found time 3, expected at least 0 and at most 2, when it arrived"),
        (
            '{"tick": 19.9}',
            "found tick 19.9 after tick 20, expected a clock that does not go back; retract message 4 if",
        ),
        ('{"retract": 77}', "found message '77', expected the number of one that was taken"),
        ('{"start": "n1", "at": 12}', "found n1 start at 13.5 and at 12, expected one time"),
    ],
)
def test_what_contradicts_is_refused_with_the_reason(line, reason):
    _, lines = watched(said=[*SAID, line])
    assert reason in lines[-1]["refused"]
    assert {**lines[-1], "message": 0, "refused": 0} == {**lines[-2], "message": 0, "refused": 0}


def test_a_journal_survives_and_is_resumed(tmp_path):
    journal = tmp_path / "run.journal"
    with started("watch", *FILES, *OPTIONS, "--journal", journal, stdin=subprocess.PIPE) as running:
        running.stdout.readline()
        before = spoken(running, *SAID)
        running.send_signal(signal.SIGKILL)
    _, after = watched("--journal", journal, said=[])
    assert after == before[-1:], "as if nothing had happened"
    content = journal.read_bytes()
    journal.write_bytes(content[:-3])
    _, cut = watched("--journal", journal, said=SAID[-1:])
    assert cut[-1] == after[-1], "a line that was cut off is dropped"
    journal.write_bytes(content.replace(b"13", b"14", 1))
    assert_one_line(process("watch", *FILES, *OPTIONS, "--journal", journal), says="the journal was changed here")


def test_a_journal_in_use_is_nobody_elses_and_a_closed_pipe_leaves_it_whole(tmp_path):
    journal = tmp_path / "run.journal"
    with started("watch", *FILES, *OPTIONS, "--journal", journal, stdin=subprocess.PIPE) as running:
        running.stdout.readline()
        assert_one_line(
            process("watch", *FILES, *OPTIONS, "--journal", journal, input=""),
            says="found a journal that another process writes",
        )
        spoken(running, *SAID[:2])
        running.stdout.close()
        running.stdin.write(SAID[2] + "\n")
        running.stdin.close()
        assert running.wait(30) == 128 + signal.SIGPIPE
        assert running.stderr.read() == ""
    _, (after,) = watched("--journal", journal, said=[])
    assert after["message"] == 3, "what was heard is kept, whether it could be answered or not"
    assert [look["since"] for look in after["running"]] == ["27/2"]


def chatter(random, deadline):
    """What is said of a run, as messages: of a robot, with what is repeated, late and contradicts."""
    monitor = Monitor(load_plan(*FILES, parameters=["duration:*"], deadline=deadline), seconds=None)
    said = []
    for message in replay(monitor, random, random.choice([0.1, 0.4])):
        said.append(message)
        late = random.choice(said)
        wrong = MonitorMessage(MessageKind.START, "n0", Fraction(-1))
        said += random.choice([[], [late], [wrong], [replace(late, at=late.at + 1)]])
    return said


@pytest.mark.parametrize("first", range(0, often(2, 40), 2))
def test_nothing_is_lost_whatever_is_killed(tmp_path, first):
    """Five kills each: what was answered is in the journal, and what is ahead is as if nothing had happened."""
    for seed in range(first, first + often(1, 2)):
        random, journal = Random(seed), tmp_path / f"{seed}.journal"  # noqa: S311 - reproducible
        options = (*FILES, *OPTIONS, "--journal", journal, "--answer-limit", 60)
        messages, heard = chatter(random, "90"), 0
        for _ in range(5):
            with started("watch", *options, stdin=subprocess.PIPE) as running:
                resumed = json.loads(running.stdout.readline())
                assert heard <= resumed["message"] <= len(messages)
                heard = resumed["message"]
                fresh = Monitor(load_plan(*FILES, parameters=["duration:*"], deadline="90"), seconds=None)
                for message in messages[:heard]:
                    fresh.tell(message)
                assert resumed == json.loads(json.dumps(outlook_line(fresh.outlook(), "exact", 10)))
                coming = messages[heard : heard + random.randrange(12)]
                running.stdin.write("".join(f"{json.dumps(message.as_dict())}\n" for message in coming))
                running.stdin.flush()
                for _ in range(random.randint(0, len(coming))):
                    heard = json.loads(running.stdout.readline())["message"]
                running.send_signal(signal.SIGKILL)
                assert "Traceback" not in running.stderr.read()


def test_real_time_passes_without_messages():
    clock = ("--clock", "real", "--rate", "0.01")
    with started("watch", *FILES, *OPTIONS, *clock, stdin=subprocess.PIPE) as running:
        running.stdout.readline()
        lines = spoken(running, '{"start": "n0"}')
        while lines[-1]["prospect"] != "broken":
            lines.append(json.loads(running.stdout.readline()))
        running.stdin.close()
        assert running.wait(30) == 1
    assert "on track" in {line["prospect"] for line in lines}
    assert Fraction(lines[-1]["time"]) > 24


def test_a_slow_reader_does_not_keep_time_from_passing():
    with started("watch", *FILES, *OPTIONS, "--clock", "real", "--rate", "0.001", stdin=subprocess.PIPE) as running:
        running.stdout.readline()
        running.stdin.write("\n".join(['{"tick": 1}'] * 400 + ['{"end": "n0"}', '{"start": "n0"}', ""]))
        running.stdin.close()
        time.sleep(1)
        lines = [json.loads(line) for line in running.stdout]
        assert running.wait(30) in {0, 1, 3}
    assert len(lines) < 400, "what was not read in time is not said any more"
    assert lines[-1]["message"] >= 402
    numbers = [line["message"] for line in lines]
    assert numbers == sorted(numbers), "more than one line says what follows from a message if time passes"


def test_who_reads_nothing_keeps_no_message_from_being_taken(tmp_path):
    journal = tmp_path / "journal.jsonl"
    with started("watch", *FILES, *OPTIONS, "--journal", str(journal), stdin=subprocess.PIPE) as running:
        said = [f'{" " * 500}{{"tick": {number}}}' for number in range(300)]  # more than pipes hold
        running.stdin.write("\n".join([*said[:150], "nonsense", *said[150:], ""]))
        running.stdin.close()
        patient = time.monotonic() + 60
        while not journal.exists() or len(journal.read_text().splitlines()) < 301:
            assert time.monotonic() < patient
            time.sleep(0.05)
        lines = [json.loads(line) for line in running.stdout]
        assert running.wait(60) == 1
    assert [line.get("message") for line in lines] == [*range(151), None, *range(151, 301)]


@pytest.mark.parametrize("room", [0, 100, 1 << 20])
def test_of_what_nobody_reads_the_oldest_is_left_out_unless_it_has_to_stay(room):
    source, target = os.pipe()
    writer = LineWriter(target, lambda: False, Deadline.after(60), room)
    os.set_blocking(source, False)
    for number in range(20_000):
        writer.offer({"number": number}, stays=number % 1000 == 0)
    assert writer.is_behind
    text = b""
    while writer.is_behind:
        writer.go_on()
        text += os.read(source, 1 << 20)
    found = [json.loads(line)["number"] for line in text.splitlines()]
    assert found == sorted(found)
    assert {number for number in range(20_000) if number % 1000 == 0} <= {*found}
    first = next(number for number in range(20_000) if number not in found) if room < 1 << 20 else 20_000
    behind = [number for number in found if number > first and number % 1000]
    assert found[-1] == 19_999
    assert sum(len(json.dumps({"number": number})) + 1 for number in behind[:-1]) <= room or room == 1 << 20
    assert (len(found) == 20_000) == (room == 1 << 20)
    os.close(source)
    with pytest.raises(BrokenPipeError):
        writer.write({})
    os.close(target)


def test_plans_with_continuous_effects_are_followed_by_slices():
    directory = WORKSHOP.parent / "generator"
    files = [str(directory / name) for name in ("domain.pddl", "problem.pddl", "plan.stn")]
    ended = process("watch", *files, "-q", input="\n".join(GENERATING))
    lines = [json.loads(line) for line in ended.out.splitlines()]
    assert ended.err == ""
    for line in lines:
        jsonschema.validate(line, schema("robust/watch/1"))
    assert [line["prospect"] for line in lines] == ["on track"] * 5 + ["broken"]


def test_by_a_clock_success_is_said_after_the_answer():
    words = (*OPTIONS, "--clock", "real", "--rate", "0.05", "--distribution", "*=truncated-normal::15%")
    with started("watch", *FILES, *words, stdin=subprocess.PIPE) as running:
        first = json.loads(running.stdout.readline())
        running.stdin.write('{"start": "n0"}\n')
        running.stdin.flush()
        lines = [first]
        while lines[-1]["message"] == 0 or lines[-1]["success"] == first["success"]:
            lines.append(json.loads(running.stdout.readline()))
        running.stdin.close()
    assert Fraction(first["success"]["lower"]) > Fraction(9, 10)
    last, before = lines[-1], lines[-2]
    assert last["message"] == before["message"] > 0
    assert last["success"]["time"] == last["time"]
    assert {**last, "success": None} == {**before, "success": None}


def test_by_a_clock_other_orders_are_looked_for_after_the_answer():
    with started("watch", *FILES, *OPTIONS, "--clock", "real", "--rate", "1", stdin=subprocess.PIPE) as running:
        running.stdin.write('{"start": "n1", "at": 0}\n')
        running.stdin.close()
        lines = [json.loads(line) for line in running.stdout]
    first, second = (line for line in lines if line["message"] == 1)
    assert (first["prospect"], first["replan"], first["startable"]) == ("undecided", False, [])
    assert (second["prospect"], second["replan"], second["reordered"]) == ("on track", False, True)
