"""A team on the other side of `robust pike run --stdio`, which drives a process through pipes; it may die any time."""

import json
import signal
import subprocess
import time
from dataclasses import dataclass, field
from fractions import Fraction
from heapq import heappop, heappush

import jsonschema

from robust.show.schemas import schema
from tests.cli.running import COMMAND, environment

CLOSING = {"wake", "end", "possible", "state", "why", "error"}
OUTPUT = jsonschema.Draft202012Validator(schema("robust/pike-stdio/1"))
INPUT = jsonschema.Draft202012Validator(schema("robust/pike-stdio-input/1"))


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
        while not lines or lines[-1]["kind"] not in CLOSING:
            line = self.line()
            if line is None:
                return lines
            lines.append(line)
        return lines

    def ask(self, line):
        self.send(line)
        return self.answer()

    def finish(self):
        """Close the input; the lines that still come, what is said on stderr, and the exit code."""
        self.running.stdin.close()
        lines = []
        while (line := self.line()) is not None:
            lines.append(line)
        return lines, self.running.stderr.read().decode(), self.running.wait(30)

    def stop(self, number=signal.SIGTERM):
        """Like :meth:`finish`, by a signal."""
        self.running.send_signal(number)
        lines = []
        while (line := self.line()) is not None:
            lines.append(line)
        return lines, self.running.stderr.read().decode(), self.running.wait(30)

    def kill(self):
        self.running.kill()
        self.running.wait(30)
        for stream in (self.running.stdin, self.running.stdout, self.running.stderr):
            try:
                stream.close()
            except BrokenPipeError:
                continue


@dataclass
class Team:
    """Does what is dispatched in the least time, and makes choices as soon as all before them has happened.

    It lives on while processes come and go; `decisions` are all that it has been told, once each.
    """

    process: Process
    outcomes: dict
    before: dict
    """The events before each uncontrollable choice."""
    now: Fraction = Fraction(0)
    decisions: list = field(default_factory=list)
    agenda: list = field(default_factory=list)
    sent: int = 0
    """Lines that are steps."""
    closing: dict | None = None
    due: set = field(default_factory=set)

    def hear(self, answer):
        for line in answer[:-1]:
            if line["kind"] != "hello":
                self.decisions.append({key: value for key, value in line.items() if key != "repeated"})
            if line["kind"] == "dispatched":
                due = Fraction(line["time"]) + Fraction(line["lower"])
                message = {"kind": "completion", "action": line["action"], "event": line["end"]}
                self.plan_for(due, message)
        executed = {line["event"] for line in self.decisions if line["kind"] == "executed"}
        for choice in sorted(self.before.keys() - self.due):
            if executed >= self.before[choice]:
                self.due.add(choice)
                self.plan_for(self.now, {"kind": "outcome", "choice": choice})
        self.closing = answer[-1]

    def plan_for(self, due, message):
        heappush(self.agenda, (due, len(self.decisions) + len(self.due), message))

    def next_line(self):
        """What is said next, of what has been heard."""
        wake = self.closing["time"]
        times = [Fraction(wake)] if wake is not None else []
        times += [self.agenda[0][0]] if self.agenda else []
        self.now = max(self.now, min(times))
        if not self.agenda or self.agenda[0][0] > self.now:
            return {"kind": "tick", "time": str(self.now)}
        message = {**heappop(self.agenda)[2], "time": str(self.now)}
        if message["kind"] == "outcome":
            message["value"] = self.value(message["choice"])
        return message

    def value(self, choice):
        """What is wanted, or else the first of what is possible."""
        if choice in self.outcomes:
            return self.outcomes[choice]
        return self.process.ask({"kind": "possible"})[-1]["values"][choice][0]

    def step(self):
        self.sent += 1
        self.hear(self.process.ask(self.next_line()))

    def run(self):
        """To the end of the execution."""
        self.hear(self.process.greeting)
        while self.closing["kind"] != "end":
            self.step()

    def say_and_kill(self, seconds=None):
        """Say the next line, and kill the process: at once, after some seconds, or (None) when it has answered."""
        line = self.next_line()
        self.sent += 1
        if seconds is None:
            self.hear(self.process.ask(line))
        else:
            self.process.send(line)
            time.sleep(seconds)
        self.process.kill()
        return line

    def go_on(self, process, last):
        """With another process that resumes: told again is only what no journal knows."""
        self.process = process
        hello, *repeated, closing = process.greeting
        assert all(line.get("repeated") for line in repeated)
        known = len(self.decisions)
        plain = [{key: value for key, value in line.items() if key != "repeated"} for line in repeated]
        assert plain[:known] == self.decisions
        self.hear([*plain[known:], closing])
        assert hello["steps"] in {self.sent - 1, self.sent}
        if hello["steps"] < self.sent:
            self.hear(process.ask(last))
        return hello["steps"]
