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

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import PurePath
from typing import Any, NoReturn

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import format_number, is_number, parse_number, shorten
from robust.plan.model import ZERO, NamedAction, ParameterReference, TimePoint
from robust.plan.pddl.forms import LARGEST, too_large

STNBound = Fraction | ParameterReference | None
"""A bound of a constraint; None is the infinite one: −∞ below, +∞ above."""

RESERVED_NAMES = frozenset({"inf", "infinity", "nan", "zero"})
"""Names (in any case) that a reader of the plan could take for a bound or for the zero point."""


_TELLTALE = re.compile(r"^\s*(?:(?:durative-)?action\s+instance\s|c\s*:)", re.IGNORECASE | re.MULTILINE)
_STEP = re.compile(r"^\s*\d[\d.]*\s*:\s*\(.*", re.MULTILINE)
"""A line of a time-triggered plan."""


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
class InstanceDeclaration(NamedAction):
    """An action instance as declared: nothing has been checked against the domain."""

    identifier: str
    action: str
    arguments: tuple[str, ...]
    durative: bool
    location: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class STNConstraint:
    """`lower ≤ t_target − t_source ≤ upper`, written `c: target - source in [lower, upper]`.

    `name` is what demands it, if that is no statement of the plan; it is written as a comment.
    """

    target: TimePoint
    source: TimePoint
    lower: STNBound
    upper: STNBound
    location: Location | None = field(default=None, compare=False)
    name: str | None = field(default=None, compare=False)


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
    if len(text) > LARGEST:
        raise too_large(LARGEST, Location(file))
    if not _TELLTALE.search(text) and (step := _STEP.search(text)):
        line = text.count("\n", 0, step.start() + len(step[0]) - len(step[0].lstrip())) + 1
        raise InputError(
            f"found a step, {shorten(step[0].strip())}, expected a plan with a network because of the name .stn; "
            "rename the file if it is what a planner printed",
            Location(file, line),
        )
    return _StnParser(_Scanner(text, file)).plan()


def is_network(text: str, file: str = "") -> bool:
    """Whether a text is meant to be a plan with a network, by its file's name or by a line that only these have."""
    return file.lower().endswith(".stn") or _TELLTALE.search(text) is not None


def write_stn(plan: STNPlan) -> str:
    """The plan as text: parameters, instances, constraints. Reading the text gives an equal plan."""
    lines = [_parameter_line(parameter) for parameter in plan.parameters]
    for instance in plan.instances:
        keyword = "durative-action" if instance.durative else "action"
        lines.append(f"{keyword} instance {instance.identifier} : {instance};")
    for constraint in plan.constraints:
        interval = f"[{_bound_text(constraint.lower, '-inf')}, {_bound_text(constraint.upper, 'inf')}]"
        comment = "" if constraint.name is None else f"  # {constraint.name}"
        lines.append(f"c: {constraint.target} - {constraint.source} in {interval};{comment}")
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


_BLANK = re.compile(r"(?:\s|#[^\n]*)*")
_KEYWORD = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_IDENTIFIER = re.compile(r"[A-Za-z0-9_]+(?:-+[A-Za-z0-9_]+)*")
_TIME_POINT = re.compile(rf"(?P<zero>\.zero\b)|(?P<instance>{_IDENTIFIER.pattern})(?:\.(?P<end>[A-Za-z0-9_]+))?")
_SYMBOL = re.compile(r"[A-Za-z0-9_-]+")
_WORD = re.compile(r"[^\s\[\](),;:#]+")
_ANYTHING = re.compile(rf"{_WORD.pattern}|.", re.DOTALL)
_PARAMETER_NAME = re.compile(r"[A-Za-z_](?:[A-Za-z0-9_.-]*[A-Za-z0-9_])?")

_STATEMENTS = ("parameter", "durative-action", "action", "c")
_ATTRIBUTES = {"weight": "weight", "default": "default", "lb": "lower", "ub": "upper"}
_EXPECTED_BOUND = "a number, a fraction a/b, inf, -inf or a parameter name"


def is_parameter_name(name: str) -> bool:
    """Whether a parameter may have this name: one that cannot be taken for a number, a bound or the zero point."""
    return _PARAMETER_NAME.fullmatch(name) is not None and name.lower() not in RESERVED_NAMES


def bad_parameter_name(name: str) -> str:
    """The message about a name that :func:`is_parameter_name` refuses."""
    expected = "a parameter name: letters, digits, '_', '-' and '.', beginning with a letter or '_'"
    reserved = name.lower() in RESERVED_NAMES or name.lower() in {"+inf", "-inf", ".zero"} or is_number(name)
    why = ", which cannot be told from a bound" if reserved else ""
    return f"found {shorten(name)}{why}, expected {expected}"


class _Scanner:
    """A position in the text, always past blanks and comments; `taken` is where the last match began."""

    def __init__(self, text: str, file: str) -> None:
        self.text = text
        self.file = file
        self._line_starts = [0, *(match.end() for match in re.finditer("\n", text))]
        self._skip(0)
        self.taken = self.location

    def _skip(self, position: int) -> None:
        blank = _BLANK.match(self.text, position)
        self._position = blank.end() if blank else position

    @property
    def at_end(self) -> bool:
        return self._position == len(self.text)

    @property
    def location(self) -> Location:
        line = bisect_right(self._line_starts, self._position)
        return Location(self.file, line, self._position - self._line_starts[line - 1] + 1)

    def peek(self, pattern: re.Pattern[str]) -> str:
        """What `pattern` matches here, empty if nothing."""
        match = pattern.match(self.text, self._position)
        return match.group() if match else ""

    def take(self, pattern: re.Pattern[str], expected: str) -> re.Match[str]:
        match = pattern.match(self.text, self._position)
        if match is None:
            self.fail(expected)
        self.taken = self.location
        self._skip(match.end())
        return match

    def literal(self, text: str, alternative: str = "") -> None:
        if not self.text.startswith(text, self._position):
            self.fail(f"{alternative}{text!r}")
        self._skip(self._position + len(text))

    def keyword(self, keyword: str) -> None:
        if self.peek(_KEYWORD) != keyword:
            self.fail(repr(keyword))
        self._skip(self._position + len(keyword))

    def fail(self, expected: str, hint: str = "") -> NoReturn:
        found = "end of file" if self.at_end else shorten(self.peek(_ANYTHING))
        raise InputError(f"found {found}, expected {expected}{hint}", self.location)


class _StnParser:
    """One method per rule; what is declared so far is what a statement may refer to."""

    def __init__(self, scanner: _Scanner) -> None:
        self.scanner = scanner
        self.parameters: dict[str, ParameterDeclaration] = {}
        self.instances: dict[str, InstanceDeclaration] = {}
        self.constraints: list[STNConstraint] = []

    def plan(self) -> STNPlan:
        while not self.scanner.at_end:
            self.statement()
        if not self.instances:
            expected = "expected at least one 'durative-action instance ID : (...);'"
            raise InputError(f"empty plan: found no action instance, {expected}", self.scanner.location)
        parameters, instances = tuple(self.parameters.values()), tuple(self.instances.values())
        return STNPlan(parameters, instances, tuple(self.constraints), self.scanner.file)

    def statement(self) -> None:
        location = self.scanner.location
        keyword = self.scanner.peek(_KEYWORD)
        if keyword not in _STATEMENTS:
            hint = did_you_mean(keyword, _STATEMENTS) if len(keyword) > 1 else ""
            self.scanner.fail("'parameter', 'durative-action', 'action' or 'c:'", hint)
        self.scanner.keyword(keyword)
        match keyword:
            case "parameter":
                self.parameter()
            case "c":
                self.constraint(location)
            case _:
                self.instance(durative=keyword == "durative-action")
        self.scanner.literal(";")

    def parameter(self) -> None:
        name = self.scanner.take(_WORD, "a parameter name").group()
        place = self.scanner.taken
        if not is_parameter_name(name):
            raise InputError(bad_parameter_name(name), place)
        if name in self.parameters:
            raise _declared_twice("parameter", name, self.parameters[name].location, place)
        values: dict[str, Any] = {}
        while word := self.scanner.peek(_WORD):
            attribute = _ATTRIBUTES.get(word)
            if attribute is None:
                self.scanner.fail("'weight', 'default', 'lb', 'ub' or ';'", did_you_mean(word, _ATTRIBUTES))
            if attribute in values:
                self.scanner.fail(f"{word!r} at most once in the declaration of {name!r}")
            self.scanner.keyword(word)
            text = self.scanner.take(_WORD, f"the value of {word!r}").group()
            values[attribute] = attribute_value(word, text, self.scanner.taken)
        declaration = ParameterDeclaration(name, **values, location=place)
        check_range(declaration)
        self.parameters[name] = declaration

    def instance(self, *, durative: bool) -> None:
        self.scanner.keyword("instance")
        identifier = self.scanner.take(_IDENTIFIER, "an instance identifier of letters, digits, '_' and '-'").group()
        place = self.scanner.taken
        if identifier in self.instances:
            raise _declared_twice("instance", identifier, self.instances[identifier].location, place)
        self.scanner.literal(":")
        self.scanner.literal("(")
        action = self.scanner.take(_SYMBOL, "an action name").group().lower()
        arguments: list[str] = []
        while self.scanner.peek(_SYMBOL):
            arguments.append(self.scanner.take(_SYMBOL, "an object").group().lower())
        self.scanner.literal(")", alternative="an object or ")
        self.instances[identifier] = InstanceDeclaration(identifier, action, tuple(arguments), durative, place)

    def constraint(self, location: Location) -> None:
        self.scanner.literal(":")
        target = self.time_point()
        self.scanner.literal("-")
        source = self.time_point()
        self.scanner.keyword("in")
        self.scanner.literal("[")
        place = self.scanner.location
        lower = self.bound(excluded="inf")
        self.scanner.literal(",")
        upper = self.bound(excluded="-inf")
        self.scanner.literal("]")
        constraint = STNConstraint(target, source, lower, upper, location)
        check_interval(constraint, place)
        self.constraints.append(constraint)

    def time_point(self) -> TimePoint:
        token = self.scanner.take(_TIME_POINT, "a time point: '.zero', 'ID.start', 'ID.end' or 'ID'")
        if token["zero"]:
            return ZERO
        identifier, end = token["instance"], token["end"]
        instance = self.instances.get(identifier)
        if instance is None:
            hint = did_you_mean(identifier, self.instances)
            if "-" in identifier:
                hint += " (a minus between time points needs blanks around it)"
            found = f"found time point {shorten(token.group())} of an instance that is not declared above"
            raise InputError(f"{found}, expected a declared instance{hint}", self.scanner.taken)
        points: dict[str | None, TimePoint] = {None: instance.start}
        if instance.durative:
            points = {"start": instance.start, "end": instance.end}
        if end in points:
            return points[end]
        expected = f"'{identifier}', since {identifier} is instantaneous"
        if instance.durative:
            expected = f"'{identifier}.start' or '{identifier}.end', since {identifier} is durative"
        raise InputError(f"found time point {shorten(token.group())}, expected {expected}", self.scanner.taken)

    def bound(self, *, excluded: str) -> STNBound:
        text = self.scanner.take(_WORD, _EXPECTED_BOUND).group()
        if text in ("inf", "+inf", "-inf"):
            if text.removeprefix("+") == excluded:
                side, infinite = ("lower", "-inf") if excluded == "inf" else ("upper", "inf")
                expected = f"a {side} bound that some time can meet (use '{infinite}' for none)"
                raise InputError(f"found {side} bound {text!r}, expected {expected}", self.scanner.taken)
            return None
        if is_number(text):
            return parse_number(text, self.scanner.taken)
        if text in self.parameters:
            return ParameterReference(text)
        expected = _EXPECTED_BOUND
        if _PARAMETER_NAME.fullmatch(text):
            hint = did_you_mean(text, [*self.parameters, "inf"])
            expected = f"a bound: no such parameter is declared above{hint}"
        raise InputError(f"found {shorten(text)}, expected {expected}", self.scanner.taken)


def attribute_value(word: str, text: str, location: Location | None) -> Fraction | None:
    """The value of a parameter's attribute; None is the infinite value that `lb -inf` and `ub inf` mean."""
    infinities = {"lb": ("-inf",), "lower": ("-inf",), "ub": ("inf", "+inf"), "upper": ("inf", "+inf")}.get(word, ())
    if text in infinities:
        return None
    if not is_number(text):
        unbounded = f" or {infinities[0]}" if infinities else ""
        expected = f"a number such as 5, -0.25, 1e-3 or 1/3{unbounded}"
        raise InputError(f"found {shorten(text)} as {word!r}, expected {expected}", location)
    value = parse_number(text, location)
    if word == "weight" and value <= 0:
        raise InputError(f"found weight {shorten(text)}, expected a weight above 0", location)
    return value


def _declared_twice(kind: str, name: str, first: Location | None, second: Location) -> InputError:
    place = f" (first in line {first.line})" if first else ""
    return InputError(f"found a second declaration of {kind} {name!r}{place}, expected one", second)
