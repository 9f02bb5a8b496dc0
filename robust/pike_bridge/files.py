"""`.tpnu.json` to plans with choices, with the place of everything that is written."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from pathlib import Path as FilePath
from typing import Final, TypeAlias, TypeVar

from robust.errors import InputError, Location, did_you_mean
from robust.json_text import Array, Constant, Json, Numeral, Object, Text, describe, parse_json, walk
from robust.numbers import EXPECTED_NUMBER, format_number, is_number, parse_number, shorten
from robust.pike_bridge.model import Activity, Choice, Constraint, Event, Guard, Tpnu
from robust.pike_bridge.model import guard as conjunction
from robust.pike_bridge.validate import NOWHERE, Places
from robust.plan.pddl.forms import read_text

FORMAT: Final = "tpnu/1"
SCHEMA_FILE: Final = FilePath(__file__).with_name("tpnu.schema.json")
"""The JSON Schema of the format."""

_ACTION = re.compile(r"\( *[^ ()]+(?: +[^ ()]+)* *\)")
_UNPRINTABLE = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class TpnuDocument:
    """A network as it is written in a file.

    `domain` and `problem` are as written; :meth:`beside` gives their paths. `places` says where everything is.
    """

    network: Tpnu
    domain: str
    problem: str
    places: Places = NOWHERE

    def beside(self, path: str) -> FilePath:
        """The path of a file that the document names."""
        return FilePath(self.places.file or "").parent / path


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
    top = _Fields(
        value,
        "a plan with choices",
        required=("format", "name", "domain", "problem", "events"),
        optional=("choices", "constraints", "activities"),
    )
    top.read("format", _format)
    network = Tpnu(
        name=top.read("name", _text),
        choices=top.optional("choices", _list(_choice), ()),
        events=top.read("events", _list(_event)),
        constraints=top.optional("constraints", _list(_constraint), ()),
        activities=top.optional("activities", _list(_activity), ()),
    )
    return TpnuDocument(network, top.read("domain", _text), top.read("problem", _text), places)


# -- the parts of a plan ---------------------------------------------------------------------------------------------


def _choice(value: Json) -> Choice:
    fields = _Fields(value, "a choice", required=("name", "domain", "controllable", "at"))
    return Choice(
        name=fields.read("name", _text),
        domain=fields.read("domain", _domain),
        controllable=fields.read("controllable", _boolean),
        event=fields.read("at", _text),
    )


def _event(value: Json) -> Event:
    fields = _Fields(value, "an event", required=("name",), optional=("guard",))
    return Event(fields.read("name", _text), fields.guard())


def _constraint(value: Json) -> Constraint:
    fields = _Fields(value, "a constraint", required=("from", "to", "lower", "upper"), optional=("guard",))
    return Constraint(
        source=fields.read("from", _text),
        target=fields.read("to", _text),
        lower=fields.read("lower", _bound),
        upper=fields.read("upper", _bound),
        guard=fields.guard(),
    )


def _activity(value: Json) -> Activity:
    required = ("action", "from", "to", "lower", "upper")
    fields = _Fields(value, "an activity", required=required, optional=("agent", "guard"))
    return Activity(
        action=fields.read("action", _action),
        source=fields.read("from", _text),
        target=fields.read("to", _text),
        lower=fields.read("lower", _number),
        upper=fields.read("upper", _bound),
        agent=fields.optional("agent", _text_or_null, None),
        guard=fields.guard(),
        location=value.location,
    )


# -- values ----------------------------------------------------------------------------------------------------------


class _Fields:
    """The members of an object, whose keys are checked."""

    def __init__(self, value: Json, what: str, *, required: tuple[str, ...], optional: tuple[str, ...] = ()) -> None:
        if not isinstance(value, Object):
            raise _fault(value, f"{what}: an object in braces")
        known = (*required, *optional)
        for key in value.keys:
            if key.value not in known:
                hint = did_you_mean(key.value, known)
                raise InputError(f"found key {shorten(key.value)}, expected one of {what}{hint}", key.location)
        for name in required:
            if name not in value.members:
                raise InputError(
                    f"found {what} without {name!r}, expected all of {', '.join(required)}", value.location
                )
        self._members = value.members

    def read(self, key: str, reader: Callable[[Json], T]) -> T:
        return reader(self._members[key])

    def optional(self, key: str, reader: Callable[[Json], T], default: T) -> T:
        return self.read(key, reader) if key in self._members else default

    def guard(self) -> Guard:
        return self.optional("guard", _guard, frozenset())


def _fault(value: Json, expected: str) -> InputError:
    return InputError(f"found {describe(value)}, expected {expected}", value.location)


def _list(reader: Callable[[Json], T]) -> Callable[[Json], tuple[T, ...]]:
    def read(value: Json) -> tuple[T, ...]:
        if not isinstance(value, Array):
            raise _fault(value, "a list in brackets")
        return tuple(reader(item) for item in value.items)

    return read


def _text(value: Json) -> str:
    """Names are shown in messages of one line, so that they have no control characters."""
    if not isinstance(value, Text):
        raise _fault(value, "a text in quotes")
    if not value.value or _UNPRINTABLE.search(value.value):
        raise _fault(value, "a text that is not empty and has no control characters")
    return value.value


def _text_or_null(value: Json) -> str | None:
    return None if isinstance(value, Constant) and value.value is None else _text(value)


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
    if isinstance(value, Constant) and value.value is None:
        return None
    if isinstance(value, (Numeral, Text)):
        return _number(value)
    raise _fault(value, "a number, or null for no bound")


def _domain(value: Json) -> tuple[str, ...]:
    values = _list(_text)(value)
    if not values:
        raise _fault(value, "at least one value to choose")
    if isinstance(value, Array):
        for at, (item, text) in enumerate(zip(value.items, values, strict=True)):
            if text in values[:at]:
                raise InputError(f"found a second {shorten(text)}, expected each value once", item.location)
    return values


def _guard(value: Json) -> Guard:
    if not isinstance(value, Object):
        raise _fault(value, 'a guard: an object such as {"x": "a"}')
    for key in value.keys:
        _text(key)
    return conjunction({name: _text(member) for name, member in value.members.items()})


def _action(value: Json) -> str:
    """A ground action in lower case with single blanks."""
    text = _text(value)
    if not _ACTION.fullmatch(text):
        raise _fault(value, "a ground action such as '(get human mug)'")
    return f"({' '.join(word for word in text.lower().strip('()').split(' ') if word)})"


_Value: TypeAlias = str | bool | Fraction | tuple[str, ...] | dict[str, str] | None


def write_tpnu(path: str | os.PathLike[str], network: Tpnu, *, domain: str, problem: str) -> None:
    """Write a network as a `.tpnu.json` file.

    Args:
        domain: the path of the domain as it is to be written: relative to the file.
        problem: the path of the problem, likewise.

    Raises:
        InputError: if the file cannot be written, or the network is not one that :func:`tpnu_text` can write.
    """
    text = tpnu_text(network, domain=domain, problem=problem)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise InputError(f"cannot write ({reason}), expected a file that can be written", Location(str(path))) from None


def tpnu_text(network: Tpnu, *, domain: str, problem: str) -> str:
    """The text of the `.tpnu.json` file of a network; reading it gives the same network.

    Raises:
        InputError: if the network has what the format cannot say: a choice that no event decides or without values, a
            guard with two values of one choice, an empty name, or an action that is no PDDL in lower case.
    """
    heads = {"format": FORMAT, "name": network.name, "domain": domain, "problem": problem}
    lists = {
        "choices": [_choice_object(choice) for choice in network.choices],
        "events": [_event_object(event) for event in network.events],
        "constraints": [_constraint_object(constraint) for constraint in network.constraints],
        "activities": [_activity_object(activity) for activity in network.activities],
    }
    members = [f"  {_json(key)}: {_json(value)}" for key, value in heads.items()]
    members += [f"  {_json(key)}: {_rows(rows)}" for key, rows in lists.items()]
    text = "{\n" + ",\n".join(members) + "\n}\n"
    if parse_tpnu(text, network.name).network != network:
        expected = "actions in lower case with single blanks, and one value of a choice in each guard"
        raise InputError(f"plan {network.name!r} would not be read as it was written; expected {expected}")
    return text


def _choice_object(choice: Choice) -> dict[str, _Value]:
    if choice.event is None:
        raise InputError(f"choice {choice.name!r} has no event; expected one to write the plan to a file")
    return {
        "name": choice.name,
        "domain": choice.domain,
        "controllable": choice.controllable,
        "at": choice.event,
    }


def _event_object(event: Event) -> dict[str, _Value]:
    return {"name": event.name, **_guard_object(event.guard)}


def _constraint_object(constraint: Constraint) -> dict[str, _Value]:
    return {
        "from": constraint.source,
        "to": constraint.target,
        "lower": constraint.lower,
        "upper": constraint.upper,
        **_guard_object(constraint.guard),
    }


def _activity_object(activity: Activity) -> dict[str, _Value]:
    return {
        "action": activity.action,
        "from": activity.source,
        "to": activity.target,
        "lower": activity.lower,
        "upper": activity.upper,
        **({} if activity.agent is None else {"agent": activity.agent}),
        **_guard_object(activity.guard),
    }


def _guard_object(guard: Guard) -> dict[str, _Value]:
    return {"guard": dict(sorted(guard))} if guard else {}


def _rows(rows: Iterable[Mapping[str, _Value]]) -> str:
    lines = [f"    {{{', '.join(f'{_json(key)}: {_json(value)}' for key, value in row.items())}}}" for row in rows]
    return "[\n" + ",\n".join(lines) + "\n  ]" if lines else "[]"


def _json(value: _Value) -> str:
    """JSON text; fractions that are no decimals are texts."""
    if isinstance(value, Fraction):
        text = format_number(value)
        return f'"{text}"' if "/" in text else text
    return json.dumps(value, ensure_ascii=False)


__all__ = ["FORMAT", "SCHEMA_FILE", "TpnuDocument", "parse_tpnu", "read_tpnu", "tpnu_text", "write_tpnu"]
