"""`.tpnu.json` files of plans with choices: read with the place of everything that is written, and written.

What an object of the format has is said once, in the tables below, from which it is read and written. A published JSON
Schema says the same.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

from robust.errors import InputError, Location, did_you_mean
from robust.files import atomic_write
from robust.json_text import Array, Constant, Json, Numeral, Object, Text, describe, parse_json, walk
from robust.numbers import EXPECTED_NUMBER, format_number, is_number, parse_number, shorten
from robust.pike_bridge import model
from robust.pike_bridge.envelopes.parameters import TeamParameterSpec, of_members
from robust.pike_bridge.validate import NOWHERE, Places
from robust.plan.pddl.forms import read_text

FORMAT: Final = "tpnu/1"
SCHEMA_FILE: Final = Path(__file__).with_name("tpnu.schema.json")
"""The JSON Schema of the format."""

_KINDS_OF_PARAMETERS = ("duration", "at-least", "at-most", "hesitation")
_NUMBERS_OF_PARAMETERS = (("default", None), ("lower", "-inf"), ("upper", "inf"), ("weight", None))
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class TpnuDocument:
    """A network as it is written in a file.

    `domain` and `problem` are as written; :meth:`beside` gives their paths. `places` says where everything is.
    """

    network: model.Tpnu
    domain: str
    problem: str
    places: Places = NOWHERE
    parameters: tuple[TeamParameterSpec, ...] = ()
    """Bounds that are to be varied; the network has their nominal values."""

    def beside(self, path: str) -> Path:
        """The path of a file that the document names."""
        return Path(self.places.file or "").parent / path


def read_tpnu(path: str | os.PathLike[str]) -> TpnuDocument:
    """Read a `.tpnu.json` file.

    Raises:
        InputError: with line and column, if the file cannot be read or is not of the format.
    """
    return parse_tpnu(read_text(path), os.fspath(path))


def parse_tpnu(text: str, file: str = "<tpnu>") -> TpnuDocument:
    """Read the text of a `.tpnu.json` file; `file` is its name in messages, and what paths are relative to.

    Raises:
        InputError: with line and column, if the text is not of the format.
    """
    value = parse_json(text, file)
    places = Places(file, {path: inner.location for path, inner in walk(value)})
    found = _DOCUMENT.read(value)
    lists = {key: found.get(key, ()) for key in ("choices", "events", "constraints", "activities")}
    return TpnuDocument(
        model.Tpnu(found["name"], **lists), found["domain"], found["problem"], places, found.get("parameters", ())
    )


def write_tpnu(path: str | os.PathLike[str], network: model.Tpnu, *, domain: str, problem: str) -> None:
    """Write a network as a `.tpnu.json` file.

    Args:
        domain: the path of the domain as it is to be written: relative to the file.
        problem: the path of the problem, likewise.

    Raises:
        InputError: if the file cannot be written, or the network is not one that :func:`tpnu_text` can write.
    """
    text = tpnu_text(network, domain=domain, problem=problem)
    try:
        atomic_write(path, text, None)
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise InputError(f"cannot write ({reason}), expected a file that can be written", Location(str(path))) from None


def tpnu_text(network: model.Tpnu, *, domain: str, problem: str) -> str:
    """The text of the `.tpnu.json` file of a network; reading it gives the same network.

    Raises:
        InputError: if the network has what the format cannot say: a choice that no event decides or without values, a
            guard with two values of one choice, an empty name, or an action that is no PDDL in lower case.
    """
    for choice in network.choices:
        if choice.event is None:
            raise InputError(f"choice {choice.name!r} has no event; expected one to write the plan to a file")
    heads = {"format": FORMAT, "name": network.name, "domain": domain, "problem": problem}
    members = [f"  {_json(key)}: {_json(value)}" for key, value in heads.items()]
    for key, part in _LISTS.items():
        rows = [f"    {part.text(each)}" for each in getattr(network, key)]
        members.append(f"  {_json(key)}: " + ("[\n" + ",\n".join(rows) + "\n  ]" if rows else "[]"))
    text = "{\n" + ",\n".join(members) + "\n}\n"
    if parse_tpnu(text, network.name).network != network:
        expected = "actions in lower case with single blanks, and one value of a choice in each guard"
        raise InputError(f"plan {network.name!r} would not be read as it was written; expected {expected}")
    return text


# -- values ----------------------------------------------------------------------------------------------------------


def _fault(value: Json, expected: str) -> InputError:
    return InputError(f"found {describe(value)}, expected {expected}", value.location)


def _list(reader: Callable[[Json], T]) -> Callable[[Json], tuple[T, ...]]:
    def read(value: Json) -> tuple[T, ...]:
        if not isinstance(value, Array):
            raise _fault(value, "a list in brackets")
        return tuple(reader(item) for item in value.items)

    return read


def _text(value: Json) -> str:
    if not isinstance(value, Text):
        raise _fault(value, "a text in quotes")
    if not model.is_name(value.value):
        raise _fault(value, model.PROPER_NAME)
    return value.value


def _text_or_null(value: Json) -> str | None:
    return None if _is_null(value) else _text(value)


def _is_null(value: Json) -> bool:
    return isinstance(value, Constant) and value.value is None


def _format(value: Json) -> str:
    if not isinstance(value, Text) or value.value != FORMAT:
        raise _fault(value, f"{FORMAT!r}, the format that this version reads")
    return value.value


def _boolean(value: Json) -> bool:
    if not isinstance(value, Constant) or value.value is None:
        raise _fault(value, "true or false")
    return value.value


def _number(value: Json) -> Fraction:
    if isinstance(value, Numeral):
        return parse_number(value.text, value.location)
    if isinstance(value, Text) and is_number(value.value):
        return parse_number(value.value, value.location)
    raise _fault(value, f"{EXPECTED_NUMBER}, fractions in quotes")


def _bound(value: Json) -> Fraction | None:
    if _is_null(value):
        return None
    if isinstance(value, (Numeral, Text)):
        return _number(value)
    raise _fault(value, "a number, or null for no bound")


def _number_text(infinite: str | None, value: Json) -> str:
    """The text of a number; null for no bound, where that can be."""
    if infinite is not None and _is_null(value):
        return infinite
    return format_number(_number(value))


def _domain(value: Json) -> tuple[str, ...]:
    values = _list(_text)(value)
    if not values:
        raise _fault(value, "at least one value to choose")
    if isinstance(value, Array):
        for at, (item, text) in enumerate(zip(value.items, values, strict=True)):
            if text in values[:at]:
                raise InputError(f"found a second {shorten(text)}, expected each value once", item.location)
    return values


def _guard(value: Json) -> model.Guard:
    if not isinstance(value, Object):
        raise _fault(value, 'a guard: an object such as {"x": "a"}')
    for key in value.keys:
        _text(key)
    return model.guard({name: _text(member) for name, member in value.members.items()})


def _action(value: Json) -> str:
    action = model.as_ground_action(_text(value))
    if action is None:
        raise _fault(value, model.PROPER_ACTION)
    return action


def _json(value: object) -> str:
    """JSON text; guards are objects, and fractions that are no decimals texts."""
    match value:
        case Fraction():
            text = format_number(value)
            return f'"{text}"' if "/" in text else text
        case frozenset():
            return json.dumps(dict(sorted(value)), ensure_ascii=False)
        case _:
            return json.dumps(value, ensure_ascii=False)


# -- objects ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Member:
    """A key of an object, the field that it is, and how its value is read."""

    key: str
    field: str
    read: Callable[[Json], object]
    required: bool = True
    """What is not may be missing, and is not written if it is None or empty."""


@dataclass(frozen=True, slots=True)
class _Part:
    """A kind of object: what messages call it, and its members, the required ones first."""

    what: str
    members: tuple[_Member, ...]
    make: Callable[..., Any] = dict
    located: bool = False
    """Whether it keeps its place."""

    def read(self, value: Json) -> Any:
        """What is made of the fields that are there; InputError if keys are unknown or missing, or values wrong."""
        if not isinstance(value, Object):
            raise _fault(value, f"{self.what}: an object in braces")
        known = {member.key: member for member in self.members}
        for key in value.keys:
            if key.value not in known:
                hint = did_you_mean(key.value, known)
                raise InputError(f"found key {shorten(key.value)}, expected one of {self.what}{hint}", key.location)
        required = [member.key for member in self.members if member.required]
        for name in required:
            if name not in value.members:
                message = f"found {self.what} without {name!r}, expected all of {', '.join(required)}"
                raise InputError(message, value.location)
        found = {each.field: each.read(value.members[each.key]) for each in self.members if each.key in value.members}
        return self.make(**found, **({"location": value.location} if self.located else {}))

    def text(self, part: object) -> str:
        """The object in one line."""
        found = ((member, getattr(part, member.field)) for member in self.members)
        written = (f"{_json(member.key)}: {_json(value)}" for member, value in found if member.required or value)
        return f"{{{', '.join(written)}}}"


_GUARD_MEMBER = _Member("guard", "guard", _guard, required=False)
_ENDS = (_Member("from", "source", _text), _Member("to", "target", _text))
_LISTS: Final[Mapping[str, _Part]] = {
    "choices": _Part(
        "a choice",
        (
            _Member("name", "name", _text),
            _Member("domain", "domain", _domain),
            _Member("controllable", "controllable", _boolean),
            _Member("at", "event", _text),
        ),
        model.Choice,
    ),
    "events": _Part("an event", (_Member("name", "name", _text), _GUARD_MEMBER), model.Event),
    "constraints": _Part(
        "a constraint",
        (*_ENDS, _Member("lower", "lower", _bound), _Member("upper", "upper", _bound), _GUARD_MEMBER),
        model.Constraint,
    ),
    "activities": _Part(
        "an activity",
        (
            _Member("action", "action", _action),
            *_ENDS,
            _Member("lower", "lower", _number),
            _Member("upper", "upper", _bound),
            _Member("agent", "agent", _text_or_null, required=False),
            _GUARD_MEMBER,
        ),
        model.Activity,
        located=True,
    ),
}


def _parameter(*, location: Location, **members: str) -> TeamParameterSpec:
    return of_members({key.replace("_", "-"): value for key, value in members.items()}, location)


_PARAMETER: Final = _Part(
    "a parameter",
    (
        _Member("name", "name", _text),
        *(_Member(key, key.replace("-", "_"), _text, False) for key in _KINDS_OF_PARAMETERS),
        *(_Member(key, key, partial(_number_text, infinite), False) for key, infinite in _NUMBERS_OF_PARAMETERS),
    ),
    _parameter,
    located=True,
)
_DOCUMENT: Final = _Part(
    "a plan with choices",
    (
        _Member("format", "format", _format),
        *(_Member(key, key, _text) for key in ("name", "domain", "problem")),
        *(
            _Member(key, key, _list(_LISTS[key].read), required=key == "events")
            for key in ("events", "choices", "constraints", "activities")
        ),
        _Member("parameters", "parameters", _list(_PARAMETER.read), required=False),
    ),
)
