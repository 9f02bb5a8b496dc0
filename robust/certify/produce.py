"""Certificates of each kind, made: all that the checker asks for, in its order.

Proofs of another solver come beside them: those of cvc5, obligation by obligation, in the Alethe format.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from robust import errors, records
from robust.certify import bad, tape
from robust.certify.checker import choices, reader
from robust.certify.checker.corners import corners
from robust.certify.checker.formulas import PRODUCT, Formulas
from robust.certify.hints import KnownFacts, Line, NotRefutedError, refutation
from robust.encode import create_encoding, interface
from robust.encode.interface import Encoding
from robust.errors import Location, RefutedError, UnsupportedError
from robust.irr.check import within
from robust.irr.rates import multiplied, rates_of
from robust.irr.templates import Shape
from robust.plan.model import ParametrizedPlan
from robust.plan.pddl.forms import read_text
from robust.qe.box import Box
from robust.qe.lifted import LiftedRegion
from robust.qe.region import Region
from robust.smt import limits, session
from robust.smt.limits import NEVER, Deadline

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


@dataclass
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

    files: tuple[Path, ...]
    plan: ParametrizedPlan
    epsilon: Fraction = interface.EPSILON
    encoding: str = field(default="relational", kw_only=True)
    solver: str = field(default="z3", kw_only=True)
    deadline: Deadline = field(default=NEVER, kw_only=True)
    on_obligation: tape.Progress | None = field(default=None, kw_only=True)
    ground: reader.Ground = field(init=False)

    def __post_init__(self) -> None:
        beside = self.files[2].with_suffix(".toml")
        texts = [read_text(path) for path in (*self.files, *([beside] if beside.is_file() else []))]
        self.ground = supported(lambda: reader.ground(*texts))

    def of_plan(self) -> list[Line]:
        """Certify that the plan is valid at the nominal values; errors as of :meth:`of_box`."""
        box = Box.nominal(self.plan.parameters)
        return self._at_corners(box) or [tape.header("plan"), *self._good(box)]

    def of_box(self, box: Box, *, maximal: bool = False) -> list[Line]:
        """Certify that the plan is valid all over a box, and perhaps that no other valid box contains it.

        Raises:
            RefutedError: if an obligation breaks somewhere in the box.
            UnsupportedError: if the box is not maximal, or schedules or witnesses cannot be written down.
            OutOfTimeError: if the deadline passes.
        """
        if (at_corners := self._at_corners(box)) is not None:
            if maximal:
                message = f"the box is not the widest, but on a grid: {rates_of(self.plan).reason}; use --kind box"
                raise UnsupportedError(message)
            return at_corners
        lines = [tape.header("maximal" if maximal else "box", box), *self._good(box)]
        if maximal:
            encoding = create_encoding(self.encoding, self.plan, self.epsilon, self.deadline)
            faces = bad.face_lines(self.ground, encoding, box, solver=self.solver, deadline=self.deadline)
            lines += supported(lambda: [*faces])
        return lines

    def of_shape(self, shape: Shape) -> list[Line]:
        """Certify that the plan is valid all over a shape; errors as of :meth:`of_box`."""
        return supported(lambda: bad.shape_lines(self.ground, self.epsilon, shape, **self._conduct))

    def of_region(self, region: Region) -> list[Line]:
        """Certify that a region is the whole envelope; errors as of :meth:`of_box`."""
        ground, epsilon, deadline = self.ground, self.epsilon, self.deadline
        if isinstance(region, LiftedRegion) and not region.is_empty:
            lines = supported(lambda: bad.lifted_lines(ground, epsilon, region, deadline=deadline))
        else:
            lines = supported(lambda: bad.region_lines(ground, epsilon, region, deadline=deadline))
        return [tape.header("region"), *lines]

    def _at_corners(self, box: Box) -> list[Line] | None:
        """Lines that say a box is good at the corners of its rates; None if no product of two unknowns is in the way.

        Raises:
            UnsupportedError: if corners do not decide, or a rate has no end.
        """
        try:
            for _, broken in Formulas(self.ground, self.epsilon).obligations():
                broken()
        except reader.Unsupported as products:
            if PRODUCT not in str(products) or not multiplied(self.plan):
                return None
        else:
            return None
        names = rates_of(self.plan).names
        endless = next((name for name in names if box[name].width is None), None)
        if endless is not None:
            expected = f"`lb=` and `ub=` of the parameter, or --box FILE with {endless} between two numbers"
            raise UnsupportedError(f"{endless} multiplies a time that varies and has no end, expected {expected}")
        rest = box.without(names)
        lines: list[Line] = [[tape.FORMAT, "corners", [[*names], tape.stated(box)]]]
        for given in corners(box, [*names]):
            lines += supported(partial(tape.good_lines, self.ground, self.epsilon, rest, given=given, **self._conduct))
        return lines

    def _good(self, box: Box) -> list[Line]:
        return supported(lambda: tape.good_lines(self.ground, self.epsilon, box, **self._conduct))

    @property
    def _conduct(self) -> dict[str, Any]:
        return {"solver": self.solver, "deadline": self.deadline, "on_obligation": self.on_obligation}


def knowledge(
    network: Path, epsilon: Fraction, deadline: Deadline, assumed: Mapping[str, str] = NO_CHOICES
) -> list[Line]:
    """Certify that a plan with choices has no correct execution, perhaps with some of its choices as assumed.

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
    return [[tape.FORMAT, "knowledge", [list(choice) for choice in assumed.items()]], line]


def execution(
    network: Path, epsilon: Fraction, scenario: Mapping[str, str], schedule: Mapping[str, Fraction]
) -> list[Line]:
    """Certify that choices and times are a correct execution of a plan with choices; errors of files as of
    :func:`knowledge`."""
    stated = stated_choices(network, epsilon)
    values = [values.index(scenario[name]) for name, values in stated.domains.items()]
    times = [str(schedule[event]) if event in schedule else None for event in stated.guards]
    return [tape.header("execution"), ["execution", values, times]]


def stated_choices(network: Path, epsilon: Fraction) -> choices.Choices:
    """What the checker makes of a network and its PDDL."""
    document = supported(lambda: choices.network_of(read_text(network)))
    texts = [read_text(network.parent / document[key]) for key in ("domain", "problem")]
    return supported(lambda: choices.Choices((document, texts[0], texts[1]), epsilon))


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
    import cvc5  # noqa: PLC0415 - most certificates are made without it

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
        raise errors.RefutedError(f"a schedule breaks {name!r}; `robust check` shows one")
    text = solver.proofToString(solver.getProof()[0], cvc5.ProofFormat.ALETHE).decode()
    if not text.lstrip().startswith("("):
        raise errors.SolverError(f"cvc5 has no Alethe proof of {name!r}: {text[:200]}")
    return str(text)
