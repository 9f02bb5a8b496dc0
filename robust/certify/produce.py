"""Certificates of each kind, made: all that the checker asks for, in its order."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from robust.certify import bad, tape
from robust.certify.checker import choices, reader
from robust.certify.hints import KnownFacts, Line, NotRefutedError, refutation
from robust.encode import create_encoding, interface
from robust.errors import Location, RefutedError, UnsupportedError
from robust.irr.templates import Shape
from robust.plan.model import ParametrizedPlan
from robust.plan.pddl.forms import read_text
from robust.qe.box import Box
from robust.qe.lifted import LiftedRegion
from robust.qe.region import Region
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
        """That the plan is valid at the nominal values; errors as of :meth:`of_box`."""
        return [tape.header("plan"), *self._good(Box.nominal(self.plan.parameters))]

    def of_box(self, box: Box, *, maximal: bool = False) -> list[Line]:
        """That the plan is valid all over a box, and perhaps that no other valid box contains it.

        Raises:
            RefutedError: if an obligation breaks somewhere in the box.
            UnsupportedError: if the box is not maximal, or schedules or witnesses cannot be written down.
            OutOfTimeError: if the deadline passes.
        """
        lines = [tape.header("maximal" if maximal else "box", box), *self._good(box)]
        if maximal:
            encoding = create_encoding(self.encoding, self.plan, self.epsilon, self.deadline)
            faces = bad.face_lines(self.ground, encoding, box, solver=self.solver, deadline=self.deadline)
            lines += supported(lambda: [*faces])
        return lines

    def of_shape(self, shape: Shape) -> list[Line]:
        """That the plan is valid all over a shape; errors as of :meth:`of_box`."""
        return supported(lambda: bad.shape_lines(self.ground, self.epsilon, shape, **self._conduct))

    def of_region(self, region: Region) -> list[Line]:
        """That a region is the whole envelope; errors as of :meth:`of_box`."""
        ground, epsilon, deadline = self.ground, self.epsilon, self.deadline
        if isinstance(region, LiftedRegion) and not region.is_empty:
            lines = supported(lambda: bad.lifted_lines(ground, epsilon, region, deadline=deadline))
        else:
            lines = supported(lambda: bad.region_lines(ground, epsilon, region, deadline=deadline))
        return [tape.header("region"), *lines]

    def _good(self, box: Box) -> list[Line]:
        return supported(lambda: tape.good_lines(self.ground, self.epsilon, box, **self._conduct))

    @property
    def _conduct(self) -> dict[str, Any]:
        return {"solver": self.solver, "deadline": self.deadline, "on_obligation": self.on_obligation}


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
    return [[tape.FORMAT, "knowledge", [list(choice) for choice in assumed.items()]], line]


def execution(
    network: Path, epsilon: Fraction, scenario: Mapping[str, str], schedule: Mapping[str, Fraction]
) -> list[Line]:
    """That these choices and times are a correct execution of a plan with choices; errors of files as of
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
