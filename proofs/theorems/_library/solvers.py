"""Both solvers behind one question: in processes of their own, with a limit of processor time per problem.

Processor time, so that what is proved on an idle machine is proved on a busy one, too.
"""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO

from proofs.theorems._library.model import Problem

SOLVERS = ("z3", "cvc5")
WORKER = Path(__file__).with_name("worker.py")


@dataclass(frozen=True, slots=True)
class Answer:
    """What a solver said: `sat`, `unsat`, `unknown`, `timeout` or an error, and the values of a model.

    `seconds` is processor time.
    """

    verdict: str
    seconds: float
    values: dict[str, str] = field(default_factory=dict)


class Solver:
    """One solver in a process of its own, started when first asked and after a time-out."""

    def __init__(self, name: str, limit: float) -> None:
        self.name = name
        self._limit = limit
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Solver:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def ask(self, problem: Problem) -> Answer:
        """The solver's verdict, with values if the problem is satisfiable."""
        terms = list(problem.show.values())
        values = f"(get-value ({' '.join(terms)}))" if terms else ""
        question = {"script": problem.script, "values": values, "model": problem.expected == "sat"}
        line = self._exchange(json.dumps({**question, "seconds": self._limit}))
        if not line:
            return Answer(self._end(), self._limit)
        answer = json.loads(line)
        told = read_values(answer["values"]) if answer["values"] else []
        return Answer(answer["verdict"], answer["seconds"], dict(zip(problem.show, told, strict=False)))

    def _end(self) -> str:
        """What became of a process that has closed its output, as a verdict."""
        code = 0 if self._process is None else self._process.wait()
        self.close()
        return "timeout" if code == -signal.SIGXCPU else f"error: {self.name} ended with exit code {code}"

    def _exchange(self, question: str) -> str:
        """The line that answers; empty if the process ended."""
        process = self._process = self._process or subprocess.Popen(  # noqa: S603 - our own file
            [sys.executable, "-P", str(WORKER), self.name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        source, target = _pipes(process)
        target.write(question + "\n")
        target.flush()
        return source.readline()


def _pipes(process: subprocess.Popen[str]) -> tuple[IO[str], IO[str]]:
    if process.stdout is None or process.stdin is None:
        raise ValueError("the process of a solver has no pipes")
    return process.stdout, process.stdin


def read_values(text: str) -> list[str]:
    """The values in an answer to `get-value`, in order, numbers as fractions."""
    tokens = re.findall(r"\(|\)|\|[^|]*\||[^\s()]+", text)
    position = 0

    def read() -> str | list[object]:
        nonlocal position
        token: str = tokens[position]
        position += 1
        if token != "(":  # noqa: S105 - a parenthesis
            return token
        items: list[object] = []
        while tokens[position] != ")":
            items.append(read())
        position += 1
        return items

    pairs = read()
    return [_text(pair[1]) for pair in pairs if isinstance(pair, list)]


def _text(value: object) -> str:
    match value:
        case ["-", number]:
            return f"-{_text(number)}"
        case ["/", above, below]:
            return f"{_text(above)}/{_text(below)}"
        case ["as", name, _]:
            return _text(name)
        case str():
            return re.sub(r"\.0$", "", value.strip("|"))
        case list():
            return f"({' '.join(map(_text, value))})"
        case _:
            raise ValueError(f"solver returned {value!r} as a value; expected a term")
