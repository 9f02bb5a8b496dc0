"""Wrong executives: an executive whose lines are changed on the way. Each must fail a case of the suite.

python benchmarks/conformance 'python benchmarks/conformance/mutants.py MUTANT COMMAND with {plan}'
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from typing import Any

Line = dict[str, Any]
OTHER = {"tea": "milk", "milk": "tea"}


class Mutant:
    """An executive as it is: asks the one that it stands for, and passes on what that says."""

    def __init__(self, command: list[str]) -> None:
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def answer(self) -> list[Line]:
        """What the executive says until its answer ends."""
        lines: list[Line] = []
        while not lines or lines[-1]["kind"] not in ("wake", "end", "error"):
            if self._process.stdout is None or not (text := self._process.stdout.readline()):
                sys.exit(1)
            lines.append(json.loads(text))
        return lines

    def ask(self, line: Line | str) -> list[Line]:
        if self._process.stdin is not None:
            self._process.stdin.write((line if isinstance(line, str) else json.dumps(line)) + "\n")
            self._process.stdin.flush()
        return self.answer()

    def told(self, line: Line) -> list[Line]:
        """The answer to a line."""
        return self.ask(line)

    def close(self) -> None:
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._process.wait()


def deaf(*kinds: str) -> type[Mutant]:
    """One that does not hear messages of some kinds."""

    class Deaf(Mutant):
        def told(self, line: Line) -> list[Line]:
            return self.ask({"kind": "tick", "time": line["time"]} if line["kind"] in kinds else line)

    return Deaf


def changing(change: Callable[[Line], list[Line]]) -> type[Mutant]:
    """One that says other lines instead of some."""

    class Changing(Mutant):
        def told(self, line: Line) -> list[Line]:
            return [changed for said in self.ask(line) for changed in change(said)]

    return Changing


def without(*kinds: str) -> type[Mutant]:
    """One that keeps decisions of some kinds to itself."""
    return changing(lambda said: [] if said["kind"] in kinds else [said])


class Hasty(Mutant):
    """Takes activities for done as soon as they are begun."""

    _begun: Line | None = None

    def told(self, line: Line) -> list[Line]:
        if line["kind"] == "tick" and self._begun is not None:
            line = {"kind": "completion", "time": line["time"], "action": self._begun["action"]}
        said = self.ask(line)
        self._begun = next((each for each in said if each["kind"] == "dispatched"), None)
        return said


class Sleepy(Mutant):
    """Does nothing unless something is reported."""

    def told(self, line: Line) -> list[Line]:
        return [{"kind": "wake", "time": None, "step": 0}] if line["kind"] == "tick" else self.ask(line)


class Confused(Mutant):
    """Takes a value of people's choices for another one."""

    def told(self, line: Line) -> list[Line]:
        return self.ask({**line, "value": OTHER.get(line["value"], line["value"])} if "value" in line else line)


class Timeless(Mutant):
    """Takes what is told for what happens now."""

    def told(self, line: Line) -> list[Line]:
        return self.ask({key: value for key, value in line.items() if key != "at"})


def _glad(said: Line) -> list[Line]:
    return [{**said, "kind": "succeeded"}] if said["kind"] == "failed" else [said]


def _stubborn(said: Line) -> list[Line]:
    if said["kind"] == "end":
        return [{"kind": "wake", "time": None, "step": said["step"]}]
    return [] if said["kind"] == "failed" else [said]


def _credulous(said: Line) -> list[Line]:
    if said["kind"] == "error":
        return [{"kind": "wake", "time": None, "step": 0}]
    return [] if said["kind"] == "rejected" else [said]


MUTANTS: Mapping[str, type[Mutant]] = {
    "deaf-to-outcomes": deaf("outcome"),
    "deaf-to-completions": deaf("completion"),
    "deaf-to-failures": deaf("failed", "aborted", "cancelled"),
    "deaf-to-beginnings": deaf("started"),
    "deaf-to-observations": deaf("estimate"),
    "deaf-to-retractions": deaf("retract"),
    "deaf-to-several": deaf("together"),
    "timeless": Timeless,
    "confused": Confused,
    "hasty": Hasty,
    "sleepy": Sleepy,
    "never-dispatches": without("dispatched"),
    "never-cancels": without("cancel"),
    "never-says-what-broke": without("violated"),
    "dispatches-twice": changing(lambda said: [said] * (2 if said["kind"] == "dispatched" else 1)),
    "glad": changing(_glad),
    "stubborn": changing(_stubborn),
    "credulous": changing(_credulous),
}


def main() -> None:
    mutant = MUTANTS[sys.argv[1]](sys.argv[2:])
    for said in mutant.answer():
        print(json.dumps(said), flush=True)
    for text in sys.stdin:
        try:
            answer = mutant.told(json.loads(text))
        except ValueError:
            answer = mutant.ask(text.rstrip("\n"))
        for said in answer:
            print(json.dumps(said), flush=True)
    mutant.close()


if __name__ == "__main__":
    main()
