"""Parameters declared beside the plan: which quantity becomes a parameter, by option or TOML file.

An option is `SPEC[,weight=W][,lb=L][,ub=U][,default=D]` with one of these SPECs:

====================================  ================================================================================
`[NAME=]duration:ID`                  the duration of instance ID; the parameter is called `dur_ID` unless named
`[NAME=]duration:ACTION`              one such parameter for each instance of the action (a NAME only if there is one)
`[NAME=]start:ID`                     the start time of instance ID, from zero (`start_ID`)
`[NAME=]fluent:(charge auv)`          the initial value of a ground numeric fluent (`charge_auv`)
`NAME`                                new weight, bounds or nominal value for an existing parameter
====================================  ================================================================================

Numbers are exact; `lb=-inf` and `ub=inf` remove a bound. An identifier of an instance goes before an action of the same
name. A NAME that the plan declares and does not use yet is taken with its attributes; any other NAME must be new.

The same as TOML, one table for each parameter (floats are read from their text, so they are exact too)::

    [parameters.endurance]
    fluent = "(charge auv)"      # or duration = "n3", or start = "n3", or none of them for an existing parameter
    weight = 2
    lower = "1/3"                # also: lb
    upper = 1500.5               # also: ub
    default = 1000
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from os import PathLike

from robust.errors import InputError, Location, did_you_mean
from robust.plan.numerals import shorten
from robust.plan.stn_reader import attribute_value, bad_parameter_name, is_parameter_name

_SPEC = re.compile(r"\s*(?:(?P<name>[^=:]*)=)?\s*(?P<target>[^=:()\s]*)\s*:(?P<subject>.*)", re.DOTALL)
_FLUENT = re.compile(r"\(\s*[A-Za-z0-9_-]+(?:\s+[A-Za-z0-9_-]+)*\s*\)")
_FIELDS = {
    "weight": "weight",
    "default": "default",
    "lb": "lower",
    "lower": "lower",
    "ub": "upper",
    "upper": "upper",
}


class Target(Enum):
    """What a specification makes a parameter of."""

    DURATION = "duration"
    START = "start"
    FLUENT = "fluent"
    EXISTING = "existing parameter"


_TARGETS: Mapping[str, Target] = {target.value: target for target in Target if target is not Target.EXISTING}


@dataclass(frozen=True, slots=True)
class ParameterSpec:
    """One specification, not yet looked up in a plan.

    `subject` is an instance, an action, a ground fluent `(f a b)` in lower case, or an existing parameter. `attributes`
    has the given ones of weight, default, lower and upper; a bound of None is the infinite one.
    """

    target: Target
    subject: str
    name: str | None = None
    attributes: Mapping[str, Fraction | None] = field(default_factory=dict)
    location: Location | None = field(default=None, compare=False)


def parse_spec(text: str) -> ParameterSpec:
    """The specification in an option's text; InputError says what is wrong in which option."""
    location = Location(f"--parameter {shorten(text)}")
    head, *settings = text.split(",")
    attributes: dict[str, Fraction | None] = {}
    for setting in settings:
        word, equals, value = (part.strip() for part in setting.partition("="))
        if word not in _FIELDS or not equals:
            hint = did_you_mean(word, ("weight", "lb", "ub", "default"))
            message = f"found {shorten(setting.strip())}, expected weight=W, lb=L, ub=U or default=D{hint}"
            raise InputError(message, location)
        _set_attribute(attributes, word, value, location)
    match = _SPEC.fullmatch(head)
    if match is None:
        name = head.strip()
        if "=" in name:
            expected = "[NAME=]duration:ID, [NAME=]start:ID, [NAME=]fluent:(F ARG ...) or a parameter's name"
            raise InputError(f"found {shorten(name)}, expected {expected}", location)
        return ParameterSpec(Target.EXISTING, _checked_name(name, location), None, attributes, location)
    target = _TARGETS.get(match["target"].lower())
    if target is None:
        hint = did_you_mean(match["target"], _TARGETS)
        raise InputError(f"found {shorten(match['target'])}, expected 'duration', 'start' or 'fluent'{hint}", location)
    given = match["name"]
    parameter = None if given is None else _checked_name(given.strip(), location)
    return ParameterSpec(target, _checked_subject(target, match["subject"], location), parameter, attributes, location)


def parse_specs(texts: Sequence[str]) -> tuple[ParameterSpec, ...]:
    """The specifications of several options."""
    return tuple(parse_spec(text) for text in texts)


def parse_parameter_file(text: str, file: str = "<parameters>") -> tuple[ParameterSpec, ...]:
    """The specifications in a TOML text; InputError names the parameter and the key that is wrong."""
    document = _toml(text, file)
    for key in document:
        if key != "parameters":
            message = (
                f"found key {shorten(key)}, expected only tables [parameters.NAME]{did_you_mean(key, ['parameters'])}"
            )
            raise InputError(message, Location(file))
    tables = document.get("parameters", {})
    if not isinstance(tables, dict):
        raise InputError("found a value for 'parameters', expected tables [parameters.NAME]", Location(file))
    return tuple(_spec_of_table(name, table, file) for name, table in tables.items())


def read_parameter_file(path: str | PathLike[str]) -> tuple[ParameterSpec, ...]:
    """The specifications in a TOML file; InputError if it cannot be read or is wrong."""
    from robust.plan.pddl.files import read_text  # noqa: PLC0415 - keeps the grammar of PDDL out of this import

    return parse_parameter_file(read_text(path), str(path))


@dataclass(frozen=True, slots=True)
class _Decimal:
    """The text of a TOML float."""

    text: str


def _toml(text: str, file: str) -> dict[str, object]:
    as_text: Callable[[str], _Decimal] = _Decimal
    try:
        return tomllib.loads(text, parse_float=as_text)
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        place = re.search(r" \(at line (\d+), column (\d+)\)$", reason)
        location = Location(file, int(place[1]), int(place[2])) if place else Location(file)
        reason = reason[: place.start()] if place else reason
        raise InputError(
            f"found text that is not TOML ({reason}), expected tables [parameters.NAME]", location
        ) from None


def _spec_of_table(name: str, table: object, file: str) -> ParameterSpec:
    location = Location(f"{file}: [parameters.{name if name.isprintable() else repr(name)}]")
    if not isinstance(table, dict):
        raise InputError(f"found {_kind(table)}, expected a table with keys such as duration and weight", location)
    _checked_name(name, location)
    targets: list[tuple[Target, str]] = []
    attributes: dict[str, Fraction | None] = {}
    for key, value in table.items():
        if key in _TARGETS:
            if not isinstance(value, str):
                raise InputError(f"found {_kind(value)} as {key!r}, expected a text in quotes", location)
            targets.append((_TARGETS[key], value))
        elif key in _FIELDS:
            _set_attribute(attributes, key, _number_text(key, value, location), location)
        elif isinstance(value, dict):
            quoted = shorten(f"{name}.{key}")
            message = f"found table {shorten(key)}, expected a key; a name with a dot is quoted: [parameters.{quoted}]"
            raise InputError(message, location)
        else:
            known = (*_TARGETS, "weight", "lower", "upper", "default")
            message = f"found key {shorten(key)}, expected one of {', '.join(known)}"
            raise InputError(message + (did_you_mean(key, known) if len(known) > 8 else ""), location)
    if len(targets) > 1:
        keys = " and ".join(target.value for target, _ in targets)
        raise InputError(f"found {keys}, expected one of them: a parameter stands for one quantity", location)
    if not targets:
        return ParameterSpec(Target.EXISTING, name, None, attributes, location)
    target, subject = targets[0]
    return ParameterSpec(target, _checked_subject(target, subject, location), name, attributes, location)


def _number_text(key: str, value: object, location: Location) -> str:
    match value:
        case bool():
            pass
        case int():
            return str(value)
        case str():
            return value
        case _Decimal(text):
            return text.replace("_", "")
    raise InputError(f'found {_kind(value)} as {key!r}, expected a number, or one in quotes such as "1/3"', location)


def _kind(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case _Decimal(text):
            return text
        case int() | str():
            return shorten(str(value))
        case dict():
            return "a table"
        case list():
            return "a list"
    return f"a {type(value).__name__}"


def _set_attribute(attributes: dict[str, Fraction | None], word: str, text: str, location: Location) -> None:
    if _FIELDS[word] in attributes:
        raise InputError(f"found a second value for {word!r}, expected each attribute at most once", location)
    attributes[_FIELDS[word]] = attribute_value(word, text, location)


def _checked_name(name: str, location: Location) -> str:
    if not is_parameter_name(name):
        raise InputError(bad_parameter_name(name), location)
    return name


def _checked_subject(target: Target, text: str, location: Location) -> str:
    subject = text.strip()
    if target is not Target.FLUENT:
        if not subject:
            raise InputError(f"found nothing after '{target.value}', expected an instance identifier", location)
        return subject
    if _FLUENT.fullmatch(subject) is None:
        raise InputError(f"found {shorten(subject)}, expected a ground fluent such as '(charge auv)'", location)
    return f"({' '.join(subject[1:-1].lower().split())})"
