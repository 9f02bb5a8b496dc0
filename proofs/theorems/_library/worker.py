"""A process that asks one solver, problem after problem: JSON lines in, JSON lines out.

Runs as a file of its own, so that a parent can end it at any moment. Imports a solver and the standard library only.
"""

from __future__ import annotations

import json
import math
import resource
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

_EFFORT = "200000"
"""The steps after which cvc5 gives a search up: seconds of work, and the same number of them on every machine."""
SEARCHES: tuple[dict[str, str], ...] = (
    {},
    {"mbqi": "true", "rlimit-per": _EFFORT},
    {"finite-model-find": "true", "rlimit-per": _EFFORT},
)
"""Options of cvc5, tried in turn until it knows: as it comes for refutations, then searches for models."""


def ask_z3(script: str, values: str, *, model: bool) -> tuple[str, str]:
    """The verdict of z3 on a script, and the values that a second command asks for."""
    del model  # z3 needs no other search for models
    import z3  # noqa: PLC0415 - one solver per process

    context = z3.Context()
    verdict = z3.Z3_eval_smtlib2_string(context.ref(), f"{script}(check-sat)").strip()
    told = z3.Z3_eval_smtlib2_string(context.ref(), values) if verdict == "sat" and values else ""
    return verdict, told


def ask_cvc5(script: str, values: str, *, model: bool) -> tuple[str, str]:
    """The verdict of cvc5 on a script; `model` says that a model is looked for, so that such searches come first."""
    verdict, told = "unknown", ""
    for options in reversed(SEARCHES) if model else SEARCHES:
        verdict, told = _once_cvc5(script, values, options)
        if not verdict.startswith("unknown"):
            break
    return verdict, told


def _once_cvc5(script: str, values: str, options: dict[str, str]) -> tuple[str, str]:
    import cvc5  # noqa: PLC0415 - one solver per process

    solver = cvc5.Solver(cvc5.TermManager())
    for name, value in options.items():
        solver.setOption(name, value)
    parser = cvc5.InputParser(solver)
    symbols = parser.getSymbolManager()

    def run(text: str) -> str:
        parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, text, "problem")
        answers = []
        while not (command := parser.nextCommand()).isNull():
            answers.append(command.invoke(solver, symbols))
        return "".join(answers).strip()

    verdict = run(f"{script}(check-sat)")
    return verdict, run(values) if verdict == "sat" and values else ""


def _allow(seconds: float) -> None:
    """Have the system end this process when it has computed for that much longer; waiting does not count."""
    limit = math.ceil(time.process_time() + seconds)
    resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def main() -> None:
    """Answer until the input ends."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which then ends this process
    ask: Callable[..., tuple[str, str]] = {"z3": ask_z3, "cvc5": ask_cvc5}[sys.argv[1]]
    for line in sys.stdin:
        question: dict[str, Any] = json.loads(line)
        _allow(question["seconds"])
        started = time.process_time()
        try:
            verdict, told = ask(question["script"], question["values"], model=question["model"])
            answer = {"verdict": verdict, "values": told}
        except Exception as error:  # whatever a solver raises is its answer
            answer = {"verdict": f"error: {error}", "values": ""}
        sys.stdout.write(json.dumps({**answer, "seconds": time.process_time() - started}) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
