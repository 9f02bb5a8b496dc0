"""The parametrized STN plan as written: the syntax tree of `.stn` files, its reader and its writer.

::

    parameter NAME [weight W] [default D] [lb L] [ub U];
    durative-action instance ID : (ACTION ARG ...);
    action instance ID : (ACTION ARG ...);
    c: TP - TP in [BOUND, BOUND];
    # comment

A time point `TP` is `.zero`, `ID.start`, `ID.end` or, for an instantaneous action, `ID`. A `BOUND` is a number, `inf`,
`+inf`, `-inf` or a parameter. `c: b - a in [l, u]` means l ≤ t_b − t_a ≤ u. Statements may stand in any order in which
everything is declared before it is used. Action and object names are lower-cased; identifiers of instances and
parameters are case-sensitive. All numbers are exact; time has the unit of the problem.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from os import PathLike
from pathlib import PurePath

from robust.errors import InputError, Location
from robust.plan.model import ParameterReference, TimePoint, TimePointKind
from robust.plan.numerals import format_number

STNBound = Fraction | ParameterReference | None
"""A bound of a constraint; None is the infinite one: −∞ below, +∞ above."""

RESERVED_NAMES = frozenset({"inf", "infinity", "nan", "zero"})
"""Names (in any case) that a reader of the plan could take for a bound or for the zero point."""


@dataclass(frozen=True, slots=True)
class ParameterDeclaration:
    """A parameter as declared; without a `default` it still needs a nominal value. Bounds of None are infinite."""

    name: str
    weight: Fraction = Fraction(1)
    default: Fraction | None = None
    lower: Fraction | None = None
    upper: Fraction | None = None
    location: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class InstanceDeclaration:
    """An action instance as declared: nothing has been checked against the domain."""

    identifier: str
    action: str
    arguments: tuple[str, ...]
    durative: bool
    location: Location | None = field(default=None, compare=False)

    @property
    def start(self) -> TimePoint:
        """The start, or the only time point of an instantaneous action."""
        return TimePoint(TimePointKind.START if self.durative else TimePointKind.INSTANT, self.identifier)

    @property
    def end(self) -> TimePoint:
        """The end, or the only time point of an instantaneous action."""
        return TimePoint(TimePointKind.END, self.identifier) if self.durative else self.start

    def __str__(self) -> str:
        return f"({' '.join((self.action, *self.arguments))})"


@dataclass(frozen=True, slots=True)
class STNConstraint:
    """`lower ≤ t_target − t_source ≤ upper`, written `c: target - source in [lower, upper]`."""

    target: TimePoint
    source: TimePoint
    lower: STNBound
    upper: STNBound
    location: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class STNPlan:
    """A plan as written, each kind of statement in the order of the file."""

    parameters: tuple[ParameterDeclaration, ...]
    instances: tuple[InstanceDeclaration, ...]
    constraints: tuple[STNConstraint, ...]
    file: str = field(default="<plan>", compare=False)

    @property
    def name(self) -> str:
        """The stem of the file's name."""
        return PurePath(self.file).stem


def parse_stn(text: str, file: str = "<plan>") -> STNPlan:
    """The plan that a text describes; InputError with line and column for anything that is not a plan."""
    from robust.plan.stn_reader import parse  # noqa: PLC0415 - the reader is built on the types of this module

    return parse(text, file)


def read_stn(path: str | PathLike[str]) -> STNPlan:
    """The plan in a file; InputError if it cannot be read or is not a plan."""
    from robust.plan.pddl.files import read_text  # noqa: PLC0415 - keeps the grammar of PDDL out of this import

    return parse_stn(read_text(path), str(path))


def write_stn(plan: STNPlan) -> str:
    """The plan as text: parameters, instances, constraints. Reading the text gives an equal plan."""
    lines = [_parameter_line(parameter) for parameter in plan.parameters]
    for instance in plan.instances:
        keyword = "durative-action" if instance.durative else "action"
        lines.append(f"{keyword} instance {instance.identifier} : {instance};")
    for constraint in plan.constraints:
        interval = f"[{_bound_text(constraint.lower, '-inf')}, {_bound_text(constraint.upper, 'inf')}]"
        lines.append(f"c: {constraint.target} - {constraint.source} in {interval};")
    return "".join(f"{line}\n" for line in lines)


def _parameter_line(parameter: ParameterDeclaration) -> str:
    words = [f"parameter {parameter.name} weight {format_number(parameter.weight)}"]
    given = (("default", parameter.default), ("lb", parameter.lower), ("ub", parameter.upper))
    words += [f"{word} {format_number(value)}" for word, value in given if value is not None]
    return f"{' '.join(words)};"


def _bound_text(bound: STNBound, infinite: str) -> str:
    match bound:
        case None:
            return infinite
        case ParameterReference(name):
            return name
        case Fraction():
            return format_number(bound)


def check_range(parameter: ParameterDeclaration, location: Location | None = None) -> None:
    """InputError unless weight > 0, lb ≤ ub and lb ≤ default ≤ ub, as far as they are given."""
    location = location or parameter.location
    name, lower, upper, default = parameter.name, parameter.lower, parameter.upper, parameter.default
    if parameter.weight <= 0:
        found = format_number(parameter.weight)
        raise InputError(f"found weight {found} for parameter {name!r}, expected a weight above 0", location)
    if lower is not None and upper is not None and lower > upper:
        found = f"lower bound {format_number(lower)} above upper bound {format_number(upper)}"
        raise InputError(f"found {found} for parameter {name!r}, expected lb ≤ ub", location)
    below = lower is not None and default is not None and default < lower
    above = upper is not None and default is not None and default > upper
    if default is not None and (below or above):
        interval = f"[{_bound_text(lower, '-inf')}, {_bound_text(upper, 'inf')}]"
        found = f"default {format_number(default)}"
        raise InputError(f"found {found} for parameter {name!r}, expected a value in {interval}", location)


def check_interval(constraint: STNConstraint, location: Location | None = None) -> None:
    """InputError if numeric bounds are the wrong way round, or keep a time point away from itself."""
    location = location or constraint.location
    lower, upper = constraint.lower, constraint.upper
    if isinstance(lower, Fraction) and isinstance(upper, Fraction) and lower > upper:
        found = f"lower bound {format_number(lower)} above upper bound {format_number(upper)}"
        raise InputError(f"found {found}, expected lower ≤ upper", location)
    if constraint.target == constraint.source:
        above, below = isinstance(lower, Fraction) and lower > 0, isinstance(upper, Fraction) and upper < 0
        if above or below:
            point = constraint.target
            message = f"found an interval without 0 between {point} and itself, expected one that contains 0"
            raise InputError(message, location)
