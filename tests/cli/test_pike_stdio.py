"""`robust pike run --stdio`: a process that any other drives, whatever happens to either; stories are recorded."""

import json
import signal
import time
from contextlib import ExitStack, suppress
from fractions import Fraction
from functools import cache
from random import Random

import jsonschema
import pytest

from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.cross_check import propositional
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.service import CLOSING, read_journal
from tests.cli.running import COMMAND, EXAMPLES, LOAD, process, ran, started
from tests.pike_bridge.game.test_controllability import depending
from tests.pike_bridge.online.examples import KITCHEN
from tests.recordings.recordings import INPUTS
from tests.sampling import often
from tests.schemas import schema

OUTPUT = jsonschema.Draft202012Validator(schema("robust/pike-stdio/1"))
INPUT = jsonschema.Draft202012Validator(schema("robust/pike-stdio-input/1"))
TOLD = map(json.loads, (INPUTS / "kitchen-story.jsonl").read_text(encoding="utf-8").splitlines())
STORY = [line for line in TOLD if line["kind"] != "possible"]
"""What a team says that does everything in the least time, and chooses as soon as it can, beginning with the mug."""
OUTCOMES = [{name: line[name] for name in ("kind", "choice", "value")} for line in STORY if line["kind"] == "outcome"]


WING = EXAMPLES / "wing" / "wing.tpnu.json"


class Process:
    """`robust pike run FILE --stdio ...`; a context manager. `greeting` is what it says at first."""

    def __init__(self, *arguments, plan=KITCHEN):
        self.running = started("pike", "run", plan, *arguments, "--stdio", stdin=-1, text=False)
        with ExitStack() as failed:
            failed.callback(self.kill)
            self.greeting = self.answer()
            failed.pop_all()

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

    def finish(self, number=None):
        """Close the input, or send a signal; the lines that still come, what is said on stderr, and the exit code."""
        if number is None:
            self.running.stdin.close()
        else:
            self.running.send_signal(number)
        return list(iter(self.line, None)), self.running.stderr.read().decode(), self.running.wait(30)

    def kill(self):
        self.running.kill()
        self.running.wait(30)
        for stream in (self.running.stdin, self.running.stdout, self.running.stderr):
            with suppress(BrokenPipeError):
                stream.close()


@pytest.fixture
def journal(tmp_path):
    return tmp_path / "journal"


def steps_of(journal, plan=KITCHEN):
    return read_journal(journal, load_team_plan(plan))


def decisions(lines):
    """What the executive has decided, whether it says so again or not."""
    kept = (line for line in lines if line["kind"] not in {"hello", *CLOSING})
    return [{key: value for key, value in line.items() if key != "repeated"} for line in kept]


def told(run):
    """The decisions of the whole story, by a process that nothing happens to."""
    lines = [*run.greeting, *(line for said in STORY for line in run.ask(said))]
    assert (lines[-1]["kind"], lines[-1]["outcome"]) == ("end", "succeeded")
    assert run.finish() == ([], "", 0)
    return decisions(lines)


TO_THE_END = ("--budget", "none")
"""The team of the story goes on as if each step had decided all, however busy the machine is."""


@cache
def undisturbed():
    with Process(*TO_THE_END) as run:
        return told(run)


@pytest.fixture
def resuming(journal):
    """Starts processes that go on with the story of one journal; none is left at the end."""
    with ExitStack() as running:
        yield lambda: running.enter_context(Process("--journal", journal, *TO_THE_END))


@pytest.mark.parametrize("seed", range(often(1, 40)))
def test_killed_and_resumed_again_and_again(seed, resuming, journal):
    """After an answer, before it, or while it is worked on: the execution is the one that nothing happened to."""
    moments, random = {3: None, 4: 0.0, 8: 0.004, 13: 0.015, 18: 0.04}, Random(seed)  # noqa: S311 - reproducible
    if seed:
        delays = (None, *(random.random() * most for most in (0.0, 0.01, 0.02, 0.05)))  # None: once it has answered
        moments = dict(zip(random.sample(range(1, len(STORY)), 5), random.sample(delays, 5), strict=True))
    run = resuming()
    lines = run.greeting
    for number, said in enumerate(STORY, 1):
        if number in moments:
            if moments[number] is None:
                lines += run.ask(said)
            else:
                run.send(said)
                time.sleep(moments[number])
            run.kill()
            run = resuming()
            hello, *repeated, _ = run.greeting
            assert all(line["repeated"] for line in repeated)
            assert decisions(repeated)[: len(decisions(lines))] == decisions(lines)
            assert hello["steps"] in {number - 1, number}
            lines = run.greeting
            if hello["steps"] == number:
                continue
        lines += run.ask(said)
    assert decisions(lines) == undisturbed()
    assert run.finish() == ([], "", 0)
    run.kill()
    assert sum(len(step.decisions) for step in steps_of(journal)) == len(undisturbed())
    over = resuming()
    assert decisions(over.greeting) == undisturbed()
    assert over.greeting[-1]["outcome"] == "succeeded"
    assert over.finish() == ([], "", 0)


def test_a_line_that_is_too_long_changes_nothing_and_nothing_is_done_without_input_or_time():
    with Process(*TO_THE_END) as run:
        (error,) = run.ask(b"x" * (1 << 20) + b"xx\n")
        assert (error["kind"], error["line"]) == ("error", 1)
        assert error["message"].startswith("input:1: found a line of more than 1048576 bytes")
        assert told(run) == undisturbed()
    ended = process("pike", "run", KITCHEN, "--stdio", "--timeout", "1e-9")
    assert (ended.code, ended.out, ended.err) == (3, "", "robust: out of time\n")
    ended = ran("bash", "-c", 'exec "$@" <&-', "-", *COMMAND, "pike", "run", KITCHEN, "--stdio")
    assert (ended.code, ended.out) == (2, "")
    assert ended.err == "robust: error: --stdio: standard input is closed; send lines of JSON\n"


@pytest.mark.parametrize("clock", ["given", "real"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals(journal, clock, number):
    with Process("--journal", journal, "--clock", clock) as run:
        if clock == "given":
            run.ask(STORY[0])
        else:
            run.answer()
        lines, err, code = run.finish(number)
        assert (lines[-1]["kind"], lines[-1]["outcome"]) == ("end", "interrupted")
        assert (err, code) == ("", 3)
    assert len(steps_of(journal)) == lines[-1]["step"]


def test_time_limits():
    """In real time slowly: at its own rate the plan fails after two seconds if nobody reports anything."""
    begun, words = time.monotonic(), ("--timeout", 3 * LOAD, "--clock")
    with Process(*words, "given") as given, Process(*words, "real", "--rate", "100") as real:
        for run in (given, real):
            *_, last = iter(run.line, None)
            assert (last["kind"], last["outcome"]) == ("end", "timeout")
            assert run.running.wait(30) == 3
    assert 2.5 < time.monotonic() - begun < 20 * LOAD


def test_a_driver_that_stops_reading_and_one_that_leaves(journal):
    with Process("--journal", journal) as run:
        run.running.stdout.close()
        run.send(STORY[0])
        assert run.running.wait(30) == 141
        assert run.running.stderr.read() == b""
    assert len(steps_of(journal)) == 1
    with Process("--journal", journal) as run:
        assert run.greeting[0]["steps"] == 1
        run.send(b'{"kind": "state"}\n' * 2000)  # more answers than a pipe holds
        time.sleep(1.5)
        run.running.send_signal(signal.SIGTERM)
        assert run.running.wait(30) == 3


def test_a_journal_that_cannot_be_written_any_more(journal):
    """A limit for the size of files takes the place of a full disk."""
    words = " ".join([*COMMAND, "pike", "run", str(KITCHEN), "--stdio", "--journal", str(journal)])
    lines = "".join(f'{{"kind": "tick", "time": {number}}}\n' for number in range(40))
    ended = ran("bash", "-c", f"trap '' XFSZ; ulimit -f 1; exec {words}", input=lines)
    answers = [json.loads(line) for line in ended.out.splitlines()]
    assert (answers[-1]["kind"], answers[-1]["line"]) == ("error", None)
    assert "cannot be written: File too large" in answers[-1]["message"]
    assert (ended.code, ended.err) == (2, f"robust: error: {answers[-1]['message']}\n")
    assert max(line["step"] for line in answers if "step" in line) == len(steps_of(journal))


RATE = Fraction(1, 20)
"""Seconds for a unit of time."""


def test_real_time_makes_the_same_choices(tmp_path, journal):
    """In a kitchen where everything may take long."""
    plan = json.loads(KITCHEN.read_text(encoding="utf-8"))
    for constraint in (*plan["activities"], *plan["constraints"]):
        constraint["upper"] = constraint["upper"] and 1000
    plan |= {name: str(KITCHEN.parent / plan[name]) for name in ("domain", "problem")}
    patient = tmp_path / "patient.tpnu.json"
    patient.write_text(json.dumps(plan), encoding="utf-8")
    decided = []
    with Process("--clock", "real", "--rate", RATE, "--journal", journal, *TO_THE_END, plan=patient) as run:
        decided += run.greeting
        begun = time.monotonic()
        run.send({"kind": "together", "messages": OUTCOMES})  # people say beforehand what they will do
        while decided[-1]["kind"] != "end":
            line = run.line()
            assert line is not None, run.running.stderr.read()
            assert line["kind"] != "error", line
            decided.append(line)
            if line["kind"] == "dispatched":
                time.sleep(float(Fraction(line["lower"]) * RATE))
                run.send({"kind": "completion", "action": line["action"], "event": line["end"]})
        seconds = time.monotonic() - begun
        assert decided[-1]["outcome"] == "succeeded"
        assert run.finish() == ([], "", 0)

    def chosen(lines):
        return {line["choice"]: line["value"] for line in lines if line["kind"] == "chosen"}

    assert chosen(decided) == chosen(undisturbed())
    times = [Fraction(line["time"]) for line in decided if "step" in line and line["kind"] != "wake"]
    assert times == sorted(times)
    assert all((1000 * moment).denominator == 1 for moment in times)
    assert times[-1] * RATE <= seconds + 1
    assert steps_of(journal, patient)


def test_in_real_time_the_input_may_end_with_the_execution_and_messages_have_no_time():
    with Process("--clock", "real") as run:
        run.send({"kind": "together", "messages": [OUTCOMES[0], OUTCOMES[2] | {"value": "bagel"}]})
        run.send({"kind": "why"})
        lines, err, code = run.finish()
        assert [line["kind"] for line in lines][-3:] == ["failed", "end", "why"]
        assert (err, code) == ("", 1)
    with Process("--clock", "real", "--rate", 100) as run:
        run.send('{"kind": "tick", "time": 1}')
        while (line := run.line())["kind"] != "error":
            assert line["kind"] in {"executed", "wake"}
        assert line["message"] == "input:1:26: found a time, expected none: the clock is real"


def test_real_time_goes_on_where_the_journal_ends(journal):
    arguments = ("--clock", "real", "--rate", "2", "--journal", journal, *TO_THE_END)
    with Process(*arguments) as run:
        first = [run.line() for _ in range(5)]
    with Process(*arguments) as run:
        hello, *repeated = run.greeting
        last = Fraction(repeated[-2]["time"])
        assert hello["resumed"]
        before = [{**line, "repeated": True} for line in first if line["kind"] not in {"hello", "wake"}]
        assert before
        assert repeated[: len(before)] == before
        run.send({"kind": "outcome", "choice": "xA1", "value": "mug"})
        while (line := run.line())["kind"] != "chosen" or line["choice"] != "xA1":
            assert line["kind"] in {"executed", "wake", "chosen", "dispatched"}
        assert last <= Fraction(line["time"]) <= last + 2


# -- strategies --------------------------------------------------------------------------------------------------------


def followed(run, plan, random):
    """All that is decided when people choose at random as soon as they can, and activities take random times."""
    progress = Progress(plan)
    open_choices = {each.name: each for each in plan.network.choices if not each.controllable}
    due, lines = [], list(run.greeting)
    executed = {line["event"] for line in lines if line["kind"] == "executed"}
    new = lines
    while new[-1]["kind"] != "end":
        for line in new:
            if line["kind"] == "executed":
                executed.add(line["event"])
            elif line["kind"] == "dispatched":
                low, high = Fraction(line["lower"]), Fraction(line["upper"])
                end = Fraction(line["time"]) + low + (high - low) * random.randint(0, 10) / 10
                due.append((end, {"kind": "completion", "action": line["action"], "event": line["end"]}))
        wake = new[-1]["time"]
        for name, choice in list(open_choices.items()):
            if executed.issuperset(progress.structure.not_before[choice.event]):
                del open_choices[name]
                value = random.choice(choice.domain)
                due.append((Fraction(wake or 0), {"kind": "outcome", "choice": name, "value": value}))
        due.sort(key=lambda each: each[0])
        if due and (wake is None or due[0][0] <= Fraction(wake)):
            time, message = due.pop(0)
        else:
            time, message = Fraction(wake), {"kind": "tick"}
        new = run.ask({**message, "time": str(time)})
        lines += new
    return lines


@pytest.mark.parametrize("length", ["3/2", "3"])
def test_a_strategy_is_followed_and_goes_on_after_a_kill(length, tmp_path, journal):
    """What is right depends on how long the work takes, which shows when it ends."""
    file = propositional(depending(2, 4)).write(tmp_path)
    arguments = ("--strategy", "--epsilon", "0", "--journal", journal)
    with Process(*arguments, plan=file) as run:
        assert run.greeting[0]["backend"] == "strategy"
        lines = run.ask({"kind": "tick", "time": "0"})
        assert [line["action"] for line in lines if line["kind"] == "dispatched"] == ["(act-0)"]
    with Process(*arguments, plan=file) as run:
        assert run.greeting[0]["resumed"]
        lines = run.ask({"kind": "completion", "action": "(act-0)", "time": length})
        [chosen] = [line for line in lines if line["kind"] == "chosen"]
        assert chosen["value"] == ("a" if Fraction(length) <= 2 else "b")
        assert (lines[-1]["kind"], lines[-1]["outcome"]) == ("end", "succeeded")
        assert run.finish() == ([], "", 0)


@pytest.mark.parametrize("seed", range(often(1, 10)))
def test_the_wing_succeeds_by_its_strategy_whatever_people_do(seed):
    with Process("--strategy", plan=WING) as run:
        lines = followed(run, load_team_plan(WING), Random(seed))  # noqa: S311 - reproducible
        assert (lines[-1]["kind"], lines[-1]["outcome"]) == ("end", "succeeded")
        assert run.finish() == ([], "", 0)


def test_without_a_strategy_nothing_is_served():
    ended = process("pike", "run", KITCHEN, "--stdio", "--strategy", stdin=-3)
    assert (ended.code, ended.out) == (1, "")
    assert ended.err.startswith("robust: error: --strategy: the plan is not controllable")
