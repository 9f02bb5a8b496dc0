"""Both solvers behind one question: in processes of their own, with a time limit per problem."""

from __future__ import annotations

import json
import re
import selectors
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO

from proofs.theorems._library.model import Problem

SOLVERS = ("z3", "cvc5")
WORKER = Path(__file__).with_name("worker.py")


@dataclass(frozen=True, slots=True)
class Answer:
    """What a solver said: `sat`, `unsat`, `unknown`, `timeout` or an error, and the values of a model."""

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
        started = time.perf_counter()
        line = self._exchange(
            json.dumps({"script": problem.script, "values": values, "model": problem.expected == "sat"})
        )
        seconds = time.perf_counter() - started
        if line is None:
            self.close()
            return Answer("timeout", seconds)
        if not line:
            self.close()
            return Answer(f"error: {self.name} ended", seconds)
        answer = json.loads(line)
        told = read_values(answer["values"]) if answer["values"] else []
        return Answer(answer["verdict"], seconds, dict(zip(problem.show, told, strict=False)))

    def _exchange(self, question: str) -> str | None:
        """The line that answers; None when time is up, empty if the process ended."""
        process = self._process = self._process or subprocess.Popen(  # noqa: S603 - our own file
            [sys.executable, "-P", str(WORKER), self.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        source, target = _pipes(process)
        target.write(question + "\n")
        target.flush()
        with selectors.DefaultSelector() as selector:
            selector.register(source, selectors.EVENT_READ)
            return source.readline() if selector.select(self._limit) else None


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
