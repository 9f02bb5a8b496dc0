"""Proofs of another solver: those of cvc5, obligation by obligation, in the Alethe format."""

import re
from pathlib import Path

import cvc5

from robust import errors, records
from robust.encode.interface import Encoding
from robust.irr.check import within
from robust.qe.box import Box
from robust.smt import limits, session

_OPTIONS = {"produce-proofs": "true", "proof-format-mode": "alethe", "proof-granularity": "dsl-rewrite"}
_HOLE = re.compile(r":rule (?:hole|trust)\b")


def export(encoding: Encoding, box: Box, directory: Path, deadline: limits.Deadline) -> int:
    """Write a problem and a proof for each obligation whose formula is not constant; the number of holes in all.

    Args:
        encoding: the plan's formulas.
        box: the parameter values that the proofs are about.
        directory: where to; it is made if it does not exist.
        deadline: when to give up.

    Raises:
        InputError: if the directory cannot be made. A file that cannot be written is a warning.
        RefutedError: if an obligation breaks in the box.
        SolverError: if cvc5 has no proof in this format.
        OutOfTimeError: if the deadline passes.
    """
    holes, folder = 0, records.Folder(directory, "proofs")
    for index, obligation in enumerate(encoding.obligations):
        if obligation.violation is None:
            continue
        formulas = [*encoding.query(obligation), *within(encoding, box.intervals)]
        problem = session.smtlib(encoding.terms, formulas, obligation.name, "unsat")
        proof = prove(problem, obligation.name, deadline)
        holes += len(_HOLE.findall(proof))
        folder.write(f"{index:04d}.smt2", problem)
        folder.write(f"{index:04d}.alethe", proof)
    return holes


def prove(problem: str, name: str, deadline: limits.Deadline) -> str:
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
        raise limits.OutOfTimeError
    if result.isSat():
        raise errors.RefutedError(f"found a schedule that breaks {name!r}, expected none; `robust check` shows one")
    text = solver.proofToString(solver.getProof()[0], cvc5.ProofFormat.ALETHE).decode()
    if not text.lstrip().startswith("("):
        raise errors.SolverError(f"cvc5 has no Alethe proof of {name!r}: {text[:200]}")
    return str(text)
