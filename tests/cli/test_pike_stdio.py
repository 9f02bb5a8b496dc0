"""`robust pike run --stdio`: a process that any other drives, whatever happens to either; stories are recorded."""

import json
import signal
import subprocess
import time
from contextlib import suppress
from fractions import Fraction
from functools import cache

import jsonschema
import pytest

from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.online.service import CLOSING, read_journal
from robust.show.schemas import schema
from tests.cli.running import COMMAND, LOAD, REPOSITORY, environment
from tests.cli.running import process as robust_process
from tests.pike_bridge.online.examples import KITCHEN

OUTPUT = jsonschema.Draft202012Validator(schema("robust/pike-stdio/1"))
INPUT = jsonschema.Draft202012Validator(schema("robust/pike-stdio-input/1"))
TOLD = (REPOSITORY / "tests" / "recordings" / "inputs" / "kitchen-story.jsonl").read_text(encoding="utf-8").splitlines()
STORY = [line for line in map(json.loads, TOLD) if line["kind"] != "possible"]
"""What a team says that does everything in the least time, and chooses as soon as it can, beginning with the mug."""
OUTCOMES = [{name: line[name] for name in ("kind", "choice", "value")} for line in STORY if line["kind"] == "outcome"]
WRONG = {"kind": "together", "messages": [OUTCOMES[0], OUTCOMES[2] | {"value": "bagel"}]}


class Process:
    """`robust pike run FILE --stdio ...`; a context manager. `greeting` is what it says at first."""

    def __init__(self, *arguments, greeted=True):
        words = [str(argument) for argument in arguments]
        self.running = subprocess.Popen(
            [*COMMAND, "pike", "run", *words, "--stdio"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment(),
        )
        self.greeting = self.answer() if greeted else []

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        self.kill()

    def send(self, line):
        """Write a line, an object or raw text, without waiting for the answer."""
        if isinstance(line, dict):
            INPUT.validate(line)
            line = json.dumps(line)
        self.running.stdin.write(line if isinstance(line, bytes) else line.encode() + b"\n")
        self.running.stdin.flush()

    def line(self):
        """The next line; None at the end."""
        text = self.running.stdout.readline()
        if not text.endswith(b"\n"):
            return None
        value = json.loads(text)
        OUTPUT.validate(value)
        return value

    def answer(self):
        """The lines up to the next one that closes an answer, or to the end."""
        lines = []
        while not (lines and lines[-1]["kind"] in CLOSING) and (line := self.line()) is not None:
            lines.append(line)
        return lines

    def ask(self, line):
        self.send(line)
        return self.answer()

    def rest(self):
        """The lines up to the end."""
        return list(iter(self.line, None))

    def finish(self):
        """Close the input; the lines that still come, what is said on stderr, and the exit code."""
        self.running.stdin.close()
        return self.rest(), self.running.stderr.read().decode(), self.running.wait(30)

    def stop(self, number=signal.SIGTERM):
        """Like :meth:`finish`, by a signal."""
        self.running.send_signal(number)
        return self.rest(), self.running.stderr.read().decode(), self.running.wait(30)

    def kill(self):
        self.running.kill()
        self.running.wait(30)
        for stream in (self.running.stdin, self.running.stdout, self.running.stderr):
            with suppress(BrokenPipeError):
                stream.close()


def decisions(lines):
    """What the executive has decided, whether it says so again or not."""
    said = (line for line in lines if line["kind"] not in {"hello", *CLOSING})
    return [{key: value for key, value in line.items() if key != "repeated"} for line in said]


def told(process):
    """The decisions of the whole story, by a process that nothing happens to."""
    lines = [*process.greeting, *(line for said in STORY for line in process.ask(said))]
    assert (lines[-1]["kind"], lines[-1]["outcome"]) == ("end", "succeeded")
    assert process.finish() == ([], "", 0)
    return decisions(lines)


@cache
def undisturbed():
    with Process(KITCHEN) as process:
        return told(process)


# -- processes that die ------------------------------------------------------------------------------------------------


def test_killed_and_resumed_again_and_again(tmp_path):
    """After an answer, before it, or while it is worked on: the execution is the one that nothing happened to."""
    journal = tmp_path / "journal"
    arguments = (KITCHEN, "--journal", journal)
    moments = {3: None, 4: 0.0, 8: 0.004, 13: 0.015, 18: 0.04}  # None: once it has answered
    process = Process(*arguments)
    lines = process.greeting
    for number, said in enumerate(STORY, 1):
        if number in moments:
            if moments[number] is None:
                lines += process.ask(said)
            else:
                process.send(said)
                time.sleep(moments[number])
            process.kill()
            process = Process(*arguments)
            hello, *repeated, _ = process.greeting
            assert all(line["repeated"] for line in repeated)
            assert decisions(repeated)[: len(decisions(lines))] == decisions(lines)
            assert hello["steps"] in {number - 1, number}
            lines = process.greeting
            if hello["steps"] == number:
                continue
        lines += process.ask(said)
    assert decisions(lines) == undisturbed()
    assert process.finish() == ([], "", 0)
    process.kill()
    recorded = [decision for step in read_journal(journal, load_team_plan(KITCHEN)) for decision in step.decisions]
    assert len(recorded) == len(undisturbed())
    with Process(*arguments) as over:
        assert decisions(over.greeting) == undisturbed()
        assert over.greeting[-1]["outcome"] == "succeeded"
        assert over.finish() == ([], "", 0)


# -- drivers that err --------------------------------------------------------------------------------------------------

NOISE = [
    (b"\xff\xfe\n", "found bytes that are no UTF-8"),
    ("{", "found the end of the file, expected"),
    ('{"kind": "tick"}', "found no field 'time', expected a number"),
    ('{"kind": "tick", "time": -1}', "found time -1, expected 0 or later"),
    ('{"kind": "outcome", "choice": "xB", "value": "mug", "time": 0}', "found unknown choice 'xB', expected one of"),
    ('{"kind": "outcome", "choice": "xA1", "value": "cup", "time": 0}', "found xA1 = 'cup', expected one of mug, gla"),
    ('{"kind": "completion", "action": "(fly human)", "time": 0}', "found unknown activity '(fly human)'"),
    ('{"kind": "completion", "action": "(get human mug)", "event": "e1", "time": 0}', "found event 'e1', expected wh"),
    ('{"kind": "why", "assume": {"xB": "mug"}}', "found unknown choice 'xB'"),
    (b"[" * 200 + b"\n", "nested more than 100 deep"),
    (b"x" * (1 << 20) + b"xx\n", "found a line of more than 1048576 bytes"),
]


def test_bad_lines_are_named_and_change_nothing():
    with Process(KITCHEN) as process:
        for number, (line, said) in enumerate(NOISE, 1):
            (error,) = process.ask(line)
            assert (error["kind"], error["line"]) == ("error", number)
            assert said in error["message"]
            assert error["message"].startswith(f"input:{number}:")
        assert told(process) == undisturbed()


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
            process.ask(STORY[0])
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
        last = process.rest()[-1]
        assert (last["kind"], last["outcome"]) == ("end", "timeout")
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
        process.send(STORY[0])
        assert process.running.wait(30) == 141
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
    decided = []
    with Process(patient, "--clock", "real", "--rate", RATE, "--journal", journal) as process:
        begun = time.monotonic()
        process.send({"kind": "together", "messages": OUTCOMES})  # people say beforehand what they will do
        ended = None
        while ended is None:
            line = process.line()
            assert line is not None, process.running.stderr.read()
            decided.append(line)
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
    chosen = {line["choice"]: line["value"] for line in decided if line["kind"] == "chosen"}
    assert chosen == story
    times = [Fraction(line["time"]) for line in decided if "step" in line and line["kind"] != "wake"]
    assert times == sorted(times)
    assert all((1000 * each).denominator == 1 for each in times)
    assert times[-1] * RATE <= seconds + 1
    assert read_journal(journal, load_team_plan(patient))


def test_in_real_time_the_input_may_end_with_the_execution():
    with Process(KITCHEN, "--clock", "real") as process:
        process.send(WRONG)
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
