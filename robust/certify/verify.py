"""The checker as a separate process: the one file that needs nothing of this package."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import cvc5

from robust.encode.interface import Encoding
from robust.errors import InputError, RefutedError, RobustError, SolverError
from robust.irr.containment import within
from robust.processes import Processes
from robust.qe.box import Box
from robust.smt.export import smtlib
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

_PACKAGED = Path(__file__).resolve().with_name("checker.py")
_CHECKOUT = Path(__file__).resolve().parents[2] / "proofs" / "checker" / "check.py"


class CheckerMissingError(RobustError):
    """The installation lacks the checker."""


class Outcome(Enum):
    """What the checker says of a certificate; the values are its exit codes."""

    ESTABLISHED = 0
    REJECTED = 1
    UNREADABLE = 2


@dataclass(frozen=True)
class Verification:
    """The checker's verdict, and what it printed."""

    outcome: Outcome
    lines: tuple[str, ...]


def checker_path() -> Path:
    """Where the checker is: beside this module if the package was built, else in the checkout.

    Raises:
        CheckerMissingError: if it is in neither place.
    """
    for path in (_PACKAGED, _CHECKOUT):
        if path.is_file():
            return path
    raise CheckerMissingError(f"found no checker at {_PACKAGED}; expected an installation that includes it")


def verify(
    certificate: Path,
    files: Mapping[str, Path],
    deadline: Deadline = NEVER,
) -> Verification:
    """Check a certificate, and that it is about the given files, by kind: `domain`, `problem`, `plan`, `network`.

    Raises:
        CheckerMissingError: if there is no checker, or it ended in a way that it never should.
        OutOfTimeError: if the deadline passes.
    """
    words = [sys.executable, "-I", str(checker_path()), str(certificate)]
    words += [word for name, path in files.items() for word in (f"--{name}", str(path))]
    ended = Processes().run(words, deadline)
    if ended.timed_out:
        raise OutOfTimeError
    if ended.exit_code not in (0, 1, 2) or ended.stderr:
        raise CheckerMissingError(f"the checker failed with exit code {ended.exit_code}; please report this as a bug")
    return Verification(Outcome(ended.exit_code), tuple(ended.stdout.splitlines()))


_OPTIONS = {"produce-proofs": "true", "proof-format-mode": "alethe", "proof-granularity": "dsl-rewrite"}
_HOLE = re.compile(r":rule (?:hole|trust)\b")


def export(encoding: Encoding, box: Box, directory: Path, deadline: Deadline) -> int:
    """Write a problem and a proof for each obligation whose formula is not constant; the number of holes in all.

    Args:
        encoding: the plan's formulas.
        box: the parameter values that the proofs are about.
        directory: where to; it is made if it does not exist.
        deadline: when to give up.

    Raises:
        InputError: if the directory cannot be written.
        RefutedError: if an obligation breaks in the box.
        SolverError: if cvc5 has no proof in this format.
        OutOfTimeError: if the deadline passes.
    """
    holes = 0
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for index, obligation in enumerate(encoding.obligations):
            if obligation.violation is encoding.terms.false:
                continue
            formulas = [*encoding.query(obligation), *within(encoding, box.intervals)]
            problem = smtlib(encoding.terms, formulas, obligation.name, "unsat")
            proof = prove(problem, obligation.name, deadline)
            holes += len(_HOLE.findall(proof))
            (directory / f"{index:04d}.smt2").write_text(problem, encoding="utf-8")
            (directory / f"{index:04d}.alethe").write_text(proof, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{directory}: cannot write proofs there ({error.strerror}); expected a directory") from None
    return holes


def prove(problem: str, name: str, deadline: Deadline) -> str:
    """The Alethe proof that an SMT-LIB problem is unsatisfiable.

    Raises:
        RefutedError: if it is satisfiable.
        SolverError: if there is no proof in this format.
        OutOfTimeError: if the deadline passes.
    """
    deadline.enforce()
    manager = cvc5.TermManager()
    solver = cvc5.Solver(manager)
    for option, value in _OPTIONS.items():
        solver.setOption(option, value)
    if deadline.remaining is not None:
        solver.setOption("tlimit-per", str(max(1, int(1000 * deadline.remaining))))
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, problem.replace("(check-sat)", ""), name)
    symbols = parser.getSymbolManager()
    while not (command := parser.nextCommand()).isNull():
        command.invoke(solver, symbols)
    result = solver.checkSat()
    if result.isUnknown():
        raise OutOfTimeError
    if result.isSat():
        raise RefutedError(f"{name!r} breaks for some of these values; expected values for which it holds")
    text = solver.proofToString(solver.getProof()[0], cvc5.ProofFormat.ALETHE).decode()
    if not text.lstrip().startswith("("):
        raise SolverError(f"cvc5 has no Alethe proof of {name!r}: {text[:200]}")
    return str(text)
