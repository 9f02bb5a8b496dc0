"""Certificates of each kind, made and checked: all that the checker asks for, in its order.

The checker runs as a process of its own, with limits of time and memory. Proofs of another solver can be exported
too: those of cvc5, obligation by obligation, in the Alethe format.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import cvc5

from robust.certify import checker
from robust.certify.bad import face_lines, region_lines
from robust.certify.checker import choices, reader
from robust.certify.hints import KnownFacts, Line, NotRefutedError, refutation
from robust.certify.tape import FORMAT, Progress, good_lines, header
from robust.encode import create_encoding
from robust.encode.interface import EPSILON, Encoding
from robust.errors import Location, RefutedError, RobustError, SolverError, UnsupportedError
from robust.irr.containment import within
from robust.plan.model import ParametrizedPlan
from robust.plan.pddl.forms import read_text
from robust.presented import NoTruthValue, VerdictEnum
from robust.processes import Processes
from robust.qe.box import Box
from robust.qe.region import Region
from robust.records import Folder
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import smtlib

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
        InputError: if the directory cannot be made. A file that cannot be written is a warning.
        RefutedError: if an obligation breaks in the box.
        SolverError: if cvc5 has no proof in this format.
        OutOfTimeError: if the deadline passes.
    """
    holes, folder = 0, Folder(directory, "proofs")
    for index, obligation in enumerate(encoding.obligations):
        if obligation.violation is encoding.terms.false:
            continue
        formulas = [*encoding.query(obligation), *within(encoding, box.intervals)]
        problem = smtlib(encoding.terms, formulas, obligation.name, "unsat")
        proof = prove(problem, obligation.name, deadline)
        holes += len(_HOLE.findall(proof))
        folder.write(f"{index:04d}.smt2", problem)
        folder.write(f"{index:04d}.alethe", proof)
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
        raise RefutedError(f"found a schedule that breaks {name!r}, expected none; `robust check` shows one")
    text = solver.proofToString(solver.getProof()[0], cvc5.ProofFormat.ALETHE).decode()
    if not text.lstrip().startswith("("):
        raise SolverError(f"cvc5 has no Alethe proof of {name!r}: {text[:200]}")
    return str(text)


T = TypeVar("T")
NO_CHOICES: Mapping[str, str] = MappingProxyType({})


def supported(read: Callable[[], T]) -> T:
    """What the checker makes of files.

    Raises:
        UnsupportedError: if it does not know what they mean.
    """
    try:
        return read()
    except reader.Unsupported as error:
        raise UnsupportedError(f"the checker of certificates does not read this: {error}") from None


class PlanCertificate:
    """Makes certificates of one plan.

    Args:
        files: domain, problem and plan; parameters that a TOML file of the plan's name beside it adds count.
        plan: the same, as this package reads it.
        epsilon: the separation of mutex time points.
        encoding: how the plan becomes formulas, which only guide the search for bad values near to a box.
        solver: `z3` or `cvc5`, likewise.
        deadline: when to give up, with OutOfTimeError.
        on_obligation: called with the number examined so far, of how many, and the obligation's name.

    Raises:
        UnsupportedError: if the checker does not know what the files mean.
        InputError: if a file cannot be read.
    """

    def __init__(
        self,
        files: tuple[Path, ...],
        plan: ParametrizedPlan,
        epsilon: Fraction = EPSILON,
        *,
        encoding: str = "relational",
        solver: str = "z3",
        deadline: Deadline = NEVER,
        on_obligation: Progress | None = None,
    ) -> None:
        beside = files[2].with_suffix(".toml")
        texts = [read_text(path) for path in (*files, *([beside] if beside.is_file() else []))]
        self.ground = supported(lambda: reader.ground(*texts))
        self._plan = plan
        self._epsilon = epsilon
        self._encoding = encoding
        self._solver = solver
        self._deadline = deadline
        self._on_obligation = on_obligation

    def of_plan(self) -> list[Line]:
        """That the plan is valid at the nominal values; errors as of :meth:`of_box`."""
        return [header("plan"), *self._good(Box.nominal(self._plan.parameters))]

    def of_box(self, box: Box, *, maximal: bool = False) -> list[Line]:
        """That the plan is valid all over a box, and perhaps that no other valid box contains it.

        Raises:
            RefutedError: if an obligation breaks somewhere in the box.
            UnsupportedError: if the box is not maximal, or schedules or witnesses cannot be written down.
            OutOfTimeError: if the deadline passes.
        """
        lines = [header("maximal" if maximal else "box", box), *self._good(box)]
        if maximal:
            encoding = create_encoding(self._encoding, self._plan, self._epsilon, self._deadline)
            lines += supported(
                lambda: [*face_lines(self.ground, encoding, box, solver=self._solver, deadline=self._deadline)]
            )
        return lines

    def of_region(self, region: Region) -> list[Line]:
        """That a region is the whole envelope; errors as of :meth:`of_box`."""
        lines = supported(lambda: region_lines(self.ground, self._epsilon, region, deadline=self._deadline))
        return [header("region"), *lines]

    def _good(self, box: Box) -> list[Line]:
        return supported(
            lambda: good_lines(
                self.ground,
                self._epsilon,
                box,
                solver=self._solver,
                deadline=self._deadline,
                on_obligation=self._on_obligation,
            )
        )


def knowledge(
    network: Path, epsilon: Fraction, deadline: Deadline, assumed: Mapping[str, str] = NO_CHOICES
) -> list[Line]:
    """That a plan with choices has no correct execution, perhaps with some of its choices as assumed.

    Raises:
        RefutedError: if it has one.
        UnsupportedError: if the checker does not know what the files mean.
        InputError: if a file cannot be read.
        OutOfTimeError: if the deadline passes.
    """
    stated = stated_choices(network, epsilon)
    literal = stated.circuit.all([*stated.parts, stated.holds(dict(assumed))])
    try:
        line = refutation(stated.formulas, KnownFacts([]), literal, deadline)
    except NotRefutedError:
        raise RefutedError(
            "the plan has a correct execution, so that its knowledge base is not empty; expected a plan without any",
            Location(str(network)),
        ) from None
    return [[FORMAT, "knowledge", [list(choice) for choice in assumed.items()]], line]


def execution(
    network: Path, epsilon: Fraction, scenario: Mapping[str, str], schedule: Mapping[str, Fraction]
) -> list[Line]:
    """That these choices and times are a correct execution of a plan with choices; errors of files as of
    :func:`knowledge`."""
    stated = stated_choices(network, epsilon)
    values = [values.index(scenario[name]) for name, values in stated.domains.items()]
    times = [str(schedule[event]) if event in schedule else None for event in stated.guards]
    return [header("execution"), ["execution", values, times]]


def stated_choices(network: Path, epsilon: Fraction) -> choices.Choices:
    """What the checker makes of a network and its PDDL."""
    document = supported(lambda: choices.network_of(read_text(network)))
    texts = [read_text(network.parent / document[key]) for key in ("domain", "problem")]
    return supported(lambda: choices.Choices((document, texts[0], texts[1]), epsilon))


FOLDER = Path(checker.__file__).resolve().parent
"""The checker: a package that needs nothing of this one."""

MEMORY_MB = 4096
OUT_OF_TIME = 3
"""The checker's exit code once it has taken the processor time that it may."""
_START = "import runpy, sys; sys.path.insert(0, sys.argv.pop(1)); runpy.run_module('checker', run_name='__main__')"


class CheckerFailedError(RobustError):
    """The checker ended in a way that it never should."""


class CheckerOutcome(VerdictEnum):
    """What the checker says of a certificate; the values are its exit codes."""

    ESTABLISHED = 0
    REJECTED = 1
    UNREADABLE = 2
    UNSUPPORTED = 4


@dataclass(frozen=True)
class Verification(NoTruthValue, ask="outcome"):
    """The checker's verdict, and its answer: `claim` and `files` (digests) among others, or `reason`."""

    outcome: CheckerOutcome
    answer: Mapping[str, Any]


def verify(
    certificate: Path,
    files: Sequence[Path],
    *,
    epsilon: Fraction,
    kind: str | None = None,
    box: str | None = None,
    assume: Sequence[str] = (),
    deadline: Deadline = NEVER,
) -> Verification:
    """Check a certificate of a domain, a problem and a plan, or of a network.

    Args:
        epsilon: how far apart mutex time points have to be.
        kind: what has to be established, at least.
        box: the box that has to be established, in JSON, or a file of it; parameters that it leaves out have their
            nominal values.
        assume: `NAME=VALUE` of choices: those of an execution that has to be established, or those that are made
            already if it has to be established that there is none.
        deadline: when to give up; without one, the checker limits its processor time by the sizes of the files.

    Raises:
        CheckerFailedError: if the checker ended in a way that it never should.
        OutOfTimeError: if the deadline passes, or the checker ends because it has taken long enough.
    """
    words = [sys.executable, "-I", "-c", _START, str(FOLDER.parent), str(certificate), *map(str, files)]
    words += ["--json", f"--epsilon={epsilon}"]
    words += [f"--kind={kind}"] if kind is not None else []
    words += [f"--box={box}"] if box is not None else []
    words += [f"--assume={text}" for text in assume]
    if deadline.remaining is not None:
        words.append(f"--seconds={max(ceil(deadline.remaining), 1)}")
    ended = Processes().run(words, deadline, memory_mb=MEMORY_MB)
    if ended.timed_out or ended.exit_code == OUT_OF_TIME:
        raise OutOfTimeError
    if ended.exit_code not in {outcome.value for outcome in CheckerOutcome} or ended.stderr:
        message = f"the checker failed with exit code {ended.exit_code} ({ended.last_line})"
        raise CheckerFailedError(f"{message}; please report this as a bug")
    return Verification(CheckerOutcome(ended.exit_code), json.loads(ended.stdout))
