"""Parameters of plans with choices: which bound of which activity or constraint is one, by option, TOML file or plan.

An option is `[NAME=]KIND:SUBJECT[,weight=W][,lb=L][,ub=U][,default=D]`:

=============================  ======================================================================================
`duration:ACTIVITY`            the activity takes exactly this long; nominal: its lower bound
`at-least:ACTIVITY`            its lower bound; the upper one stays
`at-most:ACTIVITY`             its upper bound; the lower one stays
`at-least:FROM:TO`             the lower bound of the constraint between two events; likewise `at-most:FROM:TO`
`hesitation:CHOICE`            how much later the choice is made than it can be made at the earliest; nominal: 0
=============================  ======================================================================================

ACTIVITY is a ground action, `(get human mug)`, in which `*` stands for anything, or the name of an action, `get`; where
it means several activities, all of them have this one parameter. In a TOML file, as in :mod:`robust.plan.parameters`,
and in a `.tpnu.json` file, the kind is a key and the subject its value.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fnmatch import fnmatchcase
from fractions import Fraction
from os import PathLike
from typing import TypeAlias

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import format_number, shorten
from robust.pike_bridge.model import Constraint, TeamPlan, Tpnu, check_choice
from robust.plan import model, stn
from robust.plan.parameters import ATTRIBUTES, attributes_of, kind_of, number_text, parameter_tables, set_attribute
from robust.plan.pddl.forms import read_text
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box

Bound: TypeAlias = Polynomial[model.ParameterReference]
"""A number, or a number and a parameter."""


class TeamParameterKind(Enum):
    """What a parameter is: what its name begins with, which bounds it is, lower (0) and upper (1), and in words."""

    DURATION = "duration", "", (0, 1), "the duration of"
    AT_LEAST = "at-least", "least_", (0,), "the least duration of"
    AT_MOST = "at-most", "most_", (1,), "the greatest duration of"
    HESITATION = "hesitation", "hesitation_", (0,), "how long after it is possible"

    def __new__(cls, value: str, _prefix: str, _sides: tuple[int, ...], _words: str) -> TeamParameterKind:
        kind = object.__new__(cls)
        kind._value_ = value
        return kind

    def __init__(self, _value: str, prefix: str, sides: tuple[int, ...], words: str) -> None:
        self.prefix, self.sides, self.words = prefix, sides, words


_KINDS: Mapping[str, TeamParameterKind] = {kind.value: kind for kind in TeamParameterKind}
_EXPECTED = "duration:ACTIVITY, at-least: or at-most:ACTIVITY or FROM:TO, or hesitation:CHOICE"


@dataclass(frozen=True, slots=True)
class TeamParameterSpec:
    """One specification, not yet looked up; `attributes` as of :class:`robust.plan.parameters.ParameterSpec`."""

    kind: TeamParameterKind
    subject: str
    name: str | None = None
    attributes: Mapping[str, Fraction | None] = field(default_factory=dict)
    location: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class TeamParameter:
    """A parameter with what it stands for."""

    parameter: model.Parameter
    kind: TeamParameterKind
    places: tuple[int, ...]
    """In `Tpnu.temporal_constraints`."""
    meaning: str
    """For people: `the duration of (make-coffee human)`."""

    @property
    def name(self) -> str:
        return self.parameter.name

    @property
    def words(self) -> str:
        """The name as words."""
        return self.name.replace("_", " ")


@dataclass(frozen=True)
class ParametricPlan:
    """A plan, some of whose bounds are parameters, in the plan's unit of time."""

    plan: TeamPlan
    parameters: tuple[TeamParameter, ...]
    bounds: tuple[tuple[Bound | None, Bound | None], ...]
    """Lower and upper bounds of `Tpnu.temporal_constraints`."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def declared(self) -> tuple[model.Parameter, ...]:
        """The parameters with their nominal values, weights and bounds."""
        return tuple(parameter.parameter for parameter in self.parameters)

    @property
    def declared_box(self) -> Box:
        """All values within the declared bounds."""
        return Box.declared(self.declared)

    @property
    def nominal(self) -> dict[str, Fraction]:
        """The nominal value of each parameter."""
        return {parameter.name: parameter.nominal for parameter in self.declared}

    def at(self, values: Mapping[str, Fraction]) -> TeamPlan:
        """The plan with values for all parameters, whether or not they are within their bounds."""
        known = {model.ParameterReference(name): value for name, value in values.items()}

        def number(bound: Bound | None) -> Fraction | None:
            return None if bound is None else bound.evaluate(known)

        network = self.plan.network
        split = len(network.constraints)
        constraints = tuple(
            replace(one, lower=number(lower), upper=number(upper))
            for one, (lower, upper) in zip(network.constraints, self.bounds[:split], strict=True)
        )
        activities = tuple(
            replace(one, lower=number(lower) or Fraction(0), upper=number(upper))
            for one, (lower, upper) in zip(network.activities, self.bounds[split:], strict=True)
        )
        return replace(self.plan, network=replace(network, constraints=constraints, activities=activities))


# -- what people write -------------------------------------------------------------------------------------------------


def parse_spec(text: str) -> TeamParameterSpec:
    """The specification in an option's text; InputError says what is wrong in which option."""
    location = Location(f"--parameter {shorten(text)}")
    head, *settings = _parts(text)
    attributes = attributes_of(settings, location)
    match = _SPEC.fullmatch(head)
    if match is None:
        raise InputError(f"found {shorten(head.strip())}, expected [NAME=]{_EXPECTED}", location)
    kind = _KINDS.get(match["kind"].lower())
    if kind is None:
        raise InputError(f"found {shorten(match['kind'])}, expected {_EXPECTED}", location)
    name = None if match["name"] is None else match["name"].strip()
    return _checked(TeamParameterSpec(kind, match["subject"].strip(), name, attributes, location))


_SPEC = re.compile(r"\s*(?:(?P<name>[^=:]*)=)?\s*(?P<kind>[^=:()\s]*)\s*:(?P<subject>.*)", re.DOTALL)


def _parts(text: str) -> list[str]:
    """The specification and its settings; names of events may contain commas."""
    parts = re.split(r",(?=\s*[A-Za-z]+\s*=)", text)
    return parts if "," not in parts[-1] or len(parts) == 1 else [*parts[:-1], *parts[-1].split(",")]


def read_parameter_file(path: str | PathLike[str]) -> tuple[TeamParameterSpec, ...]:
    """The specifications in a TOML file; InputError if it cannot be read, or names the parameter that is wrong."""
    file = str(path)
    return tuple(_of_table(name, table, file) for name, table in parameter_tables(read_text(path), file).items())


def _of_table(name: str, table: object, file: str) -> TeamParameterSpec:
    location = Location(f"{file}: [parameters.{name if name.isprintable() else repr(name)}]")
    if not isinstance(table, dict):
        raise InputError(f"found {kind_of(table)}, expected a table with keys such as duration and weight", location)
    members: dict[str, str] = {}
    for key, value in table.items():
        if key in _KINDS and not isinstance(value, str):
            raise InputError(f"found {kind_of(value)} as {key!r}, expected a text in quotes", location)
        members[key] = str(value) if key in _KINDS else number_text(key, value, location)
    return of_members({"name": name, **members}, location)


def of_members(members: Mapping[str, str], location: Location | None) -> TeamParameterSpec:
    """The specification in keys and texts: a name, one of the kinds, and attributes.

    Raises:
        InputError: at the location, for unknown keys, wrong values, and none or several kinds.
    """
    attributes: dict[str, Fraction | None] = {}
    for key, value in members.items():
        if key in ATTRIBUTES:
            set_attribute(attributes, key, value, location or Location("parameters"))
        elif key not in {"name", *_KINDS}:
            known = ("name", *_KINDS, "weight", "lower", "upper", "default")
            message = f"found key {shorten(key)}, expected one of {', '.join(known)}{did_you_mean(key, known)}"
            raise InputError(message, location)
    kinds = [kind for text, kind in _KINDS.items() if text in members]
    if len(kinds) != 1:
        several = " and ".join(kind.value for kind in kinds) or "none of them"
        raise InputError(f"found {several}, expected one of {', '.join(_KINDS)}", location)
    [kind] = kinds
    return _checked(TeamParameterSpec(kind, members[kind.value].strip(), members.get("name"), attributes, location))


def _checked(spec: TeamParameterSpec) -> TeamParameterSpec:
    if spec.name is not None and not stn.is_parameter_name(spec.name):
        raise InputError(stn.bad_parameter_name(spec.name), spec.location)
    if not spec.subject:
        raise InputError(f"found nothing after {spec.kind.value!r}, expected {_EXPECTED}", spec.location)
    return spec


def specifications(
    texts: Sequence[str], file: str | PathLike[str] | None, own: Sequence[TeamParameterSpec] = ()
) -> tuple[TeamParameterSpec, ...]:
    """Parameters of the plan's file, of a TOML file and of options; later ones replace earlier ones of the same bound.

    Raises:
        InputError: if a file cannot be read, a specification is wrong, or one source has two of the same bound.
    """
    specs: dict[tuple[TeamParameterKind, str], TeamParameterSpec] = {}
    for source in (own, () if file is None else read_parameter_file(file), [parse_spec(text) for text in texts]):
        seen = set()
        for spec in source:
            bound = spec.kind, spec.subject
            if bound in seen:
                message = f"found a second parameter {spec.kind.value}:{spec.subject}, expected one for a bound"
                raise InputError(message, spec.location)
            seen.add(bound)
            specs[bound] = spec
    return tuple(specs.values())


# -- looked up in a plan -----------------------------------------------------------------------------------------------


def parametrize(plan: TeamPlan, specs: Iterable[TeamParameterSpec]) -> ParametricPlan:
    """The plan with parameters in place of bounds.

    Args:
        plan: what :func:`robust.pike.load` returns.
        specs: what :func:`specifications` reads from texts such as `duration:ACTIVITY`.

    Returns:
        The plan, its parameters with nominal values in the plan's unit of time, and where they stand.

    Raises:
        InputError: for what is not in the plan, for a name or a bound used twice, and for missing nominal values.
    """
    work = _Parametrization(plan)
    for spec in specs:
        work.apply(spec)
    return ParametricPlan(plan, tuple(work.parameters), tuple((lower, upper) for lower, upper in work.bounds))


class _Parametrization:
    """The bounds while specifications are applied one by one."""

    def __init__(self, plan: TeamPlan) -> None:
        self._network: Tpnu = plan.network
        self._constraints: tuple[Constraint, ...] = plan.network.temporal_constraints
        self.bounds: list[list[Bound | None]] = [[_number(one.lower), _number(one.upper)] for one in self._constraints]
        self.parameters: list[TeamParameter] = []
        self._taken: dict[tuple[int, int], str] = {}

    def apply(self, spec: TeamParameterSpec) -> None:
        """Replace bounds, or raise InputError."""
        places, what, short = self._subject(spec)
        name = spec.name or spec.kind.prefix + re.sub(r"\W+", "_", short).strip("_")
        if any(parameter.name == name for parameter in self.parameters):
            remedy = f"write NAME={spec.kind.value}:{spec.subject} with another name"
            raise InputError(f"found parameter {name!r} twice, expected a new name: {remedy}", spec.location)
        given = spec.attributes
        durations = min(places) >= len(self._network.constraints)
        lower = Fraction(0) if durations or spec.kind is TeamParameterKind.HESITATION else None
        declaration = stn.ParameterDeclaration(
            name,
            weight=given.get("weight") or Fraction(1),
            default=given.get("default", self._nominal(spec, places, what)),
            lower=given.get("lower", lower),
            upper=given.get("upper"),
            location=spec.location,
        )
        stn.check_range(declaration, spec.location)
        if declaration.default is None:
            example = f"{spec.kind.value}:{spec.subject},default=D"
            raise InputError(f"found no one value for {what}, expected a nominal value: {example}", spec.location)
        parameter = model.Parameter(
            name, declaration.default, declaration.weight, declaration.lower, declaration.upper, spec.location
        )
        self._replace(spec, name, places)
        self.parameters.append(TeamParameter(parameter, spec.kind, places, what))

    def _replace(self, spec: TeamParameterSpec, name: str, places: tuple[int, ...]) -> None:
        parameter: Bound = Polynomial.variable(model.ParameterReference(name))
        for place in places:
            for side in spec.kind.sides:
                other = self._taken.setdefault((place, side), name)
                if other != name and spec.kind is not TeamParameterKind.HESITATION:
                    message = f"found a bound that parameter {other!r} is already, expected one parameter for a bound"
                    raise InputError(message, spec.location)
                before = self.bounds[place][side]
                late = spec.kind is TeamParameterKind.HESITATION and before is not None
                self.bounds[place][side] = before + parameter if late and before is not None else parameter

    def _nominal(self, spec: TeamParameterSpec, places: tuple[int, ...], what: str) -> Fraction | None:
        """The value that the plan has, if it has exactly one."""
        if spec.kind is TeamParameterKind.HESITATION:
            return Fraction(0)
        bounded = [self._constraints[place] for place in places]
        values = {bound.upper if spec.kind is TeamParameterKind.AT_MOST else bound.lower for bound in bounded}
        if len(values) > 1 and "default" not in spec.attributes:
            shown = ", ".join(sorted("none" if value is None else format_number(value) for value in values))
            message = f"found several values of {what} ({shown}), expected a nominal value: default=D"
            raise InputError(message, spec.location)
        return values.pop() if len(values) == 1 else None

    def _subject(self, spec: TeamParameterSpec) -> tuple[tuple[int, ...], str, str]:
        """The temporal constraints that are meant, what their parameter is for people, and a short name of them."""
        if spec.kind is TeamParameterKind.HESITATION:
            return self._before_choice(spec)
        subject = spec.subject
        if not subject.startswith("(") and ":" in subject and spec.kind is not TeamParameterKind.DURATION:
            return self._between(spec)
        action = " ".join(subject.lower().strip("() ").split())
        pattern = [f"({action})"] if subject.startswith("(") else [f"({action})", f"({action} *)"]
        first = len(self._network.constraints)
        actions_at = {
            first + at: one.action
            for at, one in enumerate(self._network.activities)
            if any(fnmatchcase(one.action, each) for each in pattern)
        }
        if not actions_at:
            known = [activity.action for activity in self._network.activities]
            known += [] if subject.startswith("(") else [one.strip("()").split()[0] for one in known]
            hint = did_you_mean(subject.lower(), known)
            raise InputError(f"found no activity {shorten(subject)}, expected one of the plan{hint}", spec.location)
        actions = list(dict.fromkeys(actions_at.values()))
        whose = actions[0] if len(actions) == 1 else f"each of {', '.join(actions)}"
        short = actions[0] if len(actions) == 1 else action.replace("*", "")
        return tuple(actions_at), f"{spec.kind.words} {whose}", short

    def _between(self, spec: TeamParameterSpec) -> tuple[tuple[int, ...], str, str]:
        """The constraints from one event to another that have the bound; if none has it, all of them."""
        source, _, target = (part.strip() for part in spec.subject.partition(":"))
        events = [event.name for event in self._network.events]
        for event in (source, target):
            if event not in events:
                raise InputError(f"found unknown event {shorten(event)}{did_you_mean(event, events)}", spec.location)
        there = [
            place for place, one in enumerate(self._network.constraints) if (one.source, one.target) == (source, target)
        ]
        if not there:
            message = f"found no constraint from {source} to {target}, expected one of the plan"
            raise InputError(message, spec.location)
        [side] = spec.kind.sides
        bounded = [place for place in there if self.bounds[place][side] is not None]
        extreme = "least" if spec.kind is TeamParameterKind.AT_LEAST else "greatest"
        return tuple(bounded or there), f"the {extreme} time from {source} to {target}", f"{source}_{target}"

    def _before_choice(self, spec: TeamParameterSpec) -> tuple[tuple[int, ...], str, str]:
        """The constraints that say how early a choice's event can be."""
        check_choice(self._network.domains, spec.subject, None, spec.location)
        choice = next(choice for choice in self._network.choices if choice.name == spec.subject)
        places = tuple(
            place
            for place, one in enumerate(self._network.constraints)
            if one.target == choice.event and one.lower is not None and one.lower >= 0
        )
        if not places:
            message = (
                f"found nothing that event {choice.event} of choice {choice.name} comes after, expected a constraint"
            )
            raise InputError(message, spec.location)
        return places, f"{spec.kind.words} {choice.name} is chosen", choice.name


def _number(bound: Fraction | None) -> Bound | None:
    return None if bound is None else Polynomial.constant(bound)
