"""Check all theorems with both solvers: `python -m proofs`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from proofs.theorems._library.catalogue import load, names
from proofs.theorems._library.model import Kind, Problem, Theorem, problems
from proofs.theorems._library.page import page
from proofs.theorems._library.solvers import SOLVERS, Answer, Solver

PAGE = Path(__file__).resolve().parents[1] / "docs" / "theorems.md"
LIMIT = 30.0
"""Seconds of processor time for one problem and one solver."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One problem with each solver's answer."""

    problem: Problem
    answers: dict[str, Answer]

    @property
    def as_expected(self) -> bool:
        return all(answer.verdict == self.problem.expected for answer in self.answers.values())


def check(theorem: Theorem, solvers: Sequence[Solver]) -> Iterator[Outcome]:
    """All problems of a theorem, each asked of all solvers."""
    for problem in problems(theorem):
        yield Outcome(problem, {solver.name: solver.ask(problem) for solver in solvers})


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; 0 if everything is as stated, 1 if not, 2 for arguments that make no sense, 130 after Ctrl-C."""
    options = _parser().parse_args(arguments)
    unknown = sorted(set(options.theorem) - set(names()))
    if unknown:
        _complain(f"unknown theorem {unknown[0]}; known are {', '.join(names())}")
        return 2
    if options.write_docs and options.theorem:
        _complain("--write-docs is for all theorems; leave the names out")
        return 2
    if options.write_docs and not PAGE.parent.is_dir():
        _complain(f"found no folder {PAGE.parent} for the page; --write-docs is for a checkout of the source")
        return 2
    theorems = [load(name) for name in options.theorem or names()]
    if options.smt2 is not None:
        return _write_problems(theorems, options.smt2)
    try:
        return _check_all(theorems, options)
    except KeyboardInterrupt:
        _complain("interrupted")
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m proofs", description="Check all theorems with both solvers.")
    parser.add_argument("theorem", nargs="*", help="names of theorems; all if there is none")
    parser.add_argument("--json", action="store_true", help="print JSON, with countermodels")
    parser.add_argument("--models", action="store_true", help="print the countermodels, and models of the assumptions")
    parser.add_argument("--write-docs", action="store_true", help="write docs/theorems.md if everything is as stated")
    parser.add_argument("--smt2", type=Path, metavar="DIR", help="write the problems as SMT-LIB 2 and stop")
    parser.add_argument(
        "--timeout", type=float, default=LIMIT, metavar="S", help="seconds of processor time per problem and solver"
    )
    return parser


def _check_all(theorems: Sequence[Theorem], options: argparse.Namespace) -> int:
    documents = []
    good = True
    with Solver("z3", options.timeout) as z3, Solver("cvc5", options.timeout) as cvc5:
        if not options.json:
            _say(_row("theorem", "source", "scope", "z3", "cvc5", "seconds", "broken"))
        for theorem in theorems:
            outcomes = list(check(theorem, (z3, cvc5)))
            good = good and all(outcome.as_expected for outcome in outcomes)
            documents.append(_document(theorem, outcomes))
            if not options.json:
                _print(theorem, outcomes, models=options.models)
    if options.json:
        _say(json.dumps({"schema": "robust/proofs/1", "proved": good, "theorems": documents}, indent=1))
    if options.write_docs and good:
        PAGE.write_text(page(theorems), encoding="utf-8")
    if not good:
        _complain("not everything is as stated")
    return 0 if good else 1


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _complain(text: str) -> None:
    sys.stderr.write(f"{text}\n")


def _row(name: str, source: str, scope: str, *columns: str) -> str:
    return f"{name:<26} {source:<34} {scope:<21} " + " ".join(f"{column:<12}" for column in columns).rstrip()


def _print(theorem: Theorem, outcomes: Sequence[Outcome], *, models: bool) -> None:
    verdicts = [_summary([each for each in outcomes if each.problem.kind is Kind.CLAIM], name) for name in SOLVERS]
    seconds = sum(answer.seconds for outcome in outcomes for answer in outcome.answers.values())
    wrong = [outcome for outcome in outcomes if outcome.problem.kind in (Kind.BROKEN, Kind.PRINTED)]
    refuted = " ".join(sorted({_summary(wrong, name) for name in SOLVERS}))
    _say(_row(theorem.name, theorem.source, theorem.scope.value, *verdicts, f"{seconds:.2f}", refuted))
    for outcome in outcomes:
        if not outcome.as_expected:
            told = ", ".join(f"{name}: {answer.verdict}" for name, answer in outcome.answers.items())
            _say(f"  {outcome.problem.name}: expected {outcome.problem.expected}, found {told}")
        elif models and outcome.problem.kind is not Kind.CLAIM:
            _say(f"  {outcome.problem.name}: {outcome.problem.words}")
            for name, answer in outcome.answers.items():
                _say(f"    {name}: " + ", ".join(f"{term} = {value}" for term, value in answer.values.items()))


def _summary(outcomes: Sequence[Outcome], solver: str) -> str:
    """The verdicts with how often each was found."""
    verdicts = [outcome.answers[solver].verdict.split(":")[0] for outcome in outcomes]
    return " ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in dict.fromkeys(verdicts))


def _document(theorem: Theorem, outcomes: Sequence[Outcome]) -> dict[str, object]:
    return {
        "name": theorem.name,
        "source": theorem.source,
        "words": theorem.words,
        "scope": theorem.scope.value,
        "bound": theorem.bound,
        "problems": [
            {
                "name": outcome.problem.name,
                "kind": outcome.problem.kind.value,
                "words": outcome.problem.words,
                "expected": outcome.problem.expected,
                "answers": {
                    name: {"verdict": answer.verdict, "seconds": round(answer.seconds, 3), "model": answer.values}
                    for name, answer in outcome.answers.items()
                },
            }
            for outcome in outcomes
        ],
    }


def _write_problems(theorems: Sequence[Theorem], directory: Path) -> int:
    directory.mkdir(parents=True, exist_ok=True)
    for theorem in theorems:
        for problem in problems(theorem):
            (directory / f"{problem.name}.smt2").write_text(
                f"(set-info :status {problem.expected})\n{problem.smt2}", encoding="utf-8"
            )
    return 0
