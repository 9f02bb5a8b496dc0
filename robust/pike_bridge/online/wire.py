"""Lines of JSON as typed fields; what is wrong is one message: the line, what was found and what was expected."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from typing import Any, TypeAlias, assert_never

from robust.errors import InputError, Location, did_you_mean
from robust.json_text import Array, Constant, Json, Numeral, Object, Text, describe, parse_json
from robust.numbers import EXPECTED_NUMBER, parse_number, shorten
from robust.pike_bridge.model import Assignment, TeamPlan
from robust.pike_bridge.online.progress import (
    Chosen,
    Completion,
    Decision,
    Dispatched,
    Estimate,
    Executed,
    Failed,
    Message,
    Outcome,
    Rejected,
    Succeeded,
    Violated,
)
from robust.plan.model import Atom

_ATOM = re.compile(r"\(\s*([^\s()]+(?:\s+[^\s()]+)*)\s*\)")


@contextmanager
def in_line(file: str, number: int) -> Iterator[None]:
    """Errors about the text of one line say which line of the file it is; lines count from 1."""
    try:
        yield
    except InputError as error:
        column = error.location.column if error.location is not None else None
        raise InputError(error.message, Location(file, number, column)) from None


def parse_line(text: str, file: str) -> Object:
    """The object that a line is; places in it are as if it were the first.

    Raises:
        InputError: if the line is no JSON object.
    """
    if not text.strip():
        raise InputError("found an empty line, expected a JSON object", Location(file, 1))
    value = parse_json(text, file)
    if not isinstance(value, Object):
        raise InputError(f"found {describe(value)}, expected a JSON object", value.location)
    return value


def parse_atom(text: str, location: Location | None = None) -> Atom:
    """`(predicate argument ...)`; upper and lower case are the same.

    Raises:
        InputError: for any other text.
    """
    match = _ATOM.fullmatch(text.strip())
    if match is None:
        raise InputError(f"found {shorten(text)}, expected an atom such as '(at cup table)'", location)
    predicate, *arguments = match.group(1).lower().split()
    return Atom(predicate, tuple(arguments))


class Fields:
    """The members of an object, each read once; :meth:`end` complains about those that nobody has read.

    Every method raises InputError, at the place of the value, if it is not what is expected.
    """

    def __init__(self, value: Object) -> None:
        self._object = value
        self._read: list[str] = []

    @staticmethod
    def of(value: Json) -> Fields:
        """The fields of what must be an object."""
        if not isinstance(value, Object):
            raise _unexpected(value, "an object")
        return Fields(value)

    @property
    def location(self) -> Location:
        """Where the object begins."""
        return self._object.location

    def where(self, name: str) -> Location:
        """Where a value is that is there."""
        return self._object.members[name].location

    def has(self, name: str) -> bool:
        """Whether there is such a value, and it is not null."""
        self._read.append(name)
        value = self._object.members.get(name)
        return value is not None and not (isinstance(value, Constant) and value.value is None)

    def text(self, name: str) -> str:
        value = self._value(name, "a text")
        if not isinstance(value, Text):
            raise _unexpected(value, f"a text for {name!r}")
        return value.value

    def optional_text(self, name: str) -> str | None:
        return self.text(name) if self.has(name) else None

    def one_of(self, name: str, known: Sequence[str]) -> str:
        """A text that is one of those known."""
        found = self.text(name)
        if found not in known:
            raise InputError(
                f"found {name} {shorten(found)}, expected one of {', '.join(known)}{_close(found, known)}",
                self.where(name),
            )
        return found

    def number(self, name: str) -> Fraction:
        """Exactly, from a JSON number or from a text such as `"1/3"`."""
        value = self._value(name, EXPECTED_NUMBER)
        match value:
            case Text(text) | Numeral(text):
                return parse_number(text, value.location)
            case _:
                raise _unexpected(value, f"{EXPECTED_NUMBER} for {name!r}")

    def optional_number(self, name: str) -> Fraction | None:
        return self.number(name) if self.has(name) else None

    def flag(self, name: str) -> bool:
        """`true` or `false`; false if it is missing."""
        if not self.has(name):
            return False
        value = self._object.members[name]
        if not isinstance(value, Constant) or value.value is None:
            raise _unexpected(value, f"true or false for {name!r}")
        return value.value

    def items(self, name: str) -> tuple[Json, ...]:
        """A list; empty if it is missing."""
        if not self.has(name):
            return ()
        value = self._object.members[name]
        if not isinstance(value, Array):
            raise _unexpected(value, f"a list for {name!r}")
        return value.items

    def texts(self, name: str) -> tuple[str, ...]:
        """A list of texts; empty if it is missing."""
        return tuple(_text(each) for each in self.items(name))

    def atom(self, name: str) -> Atom:
        return parse_atom(self.text(name), self.where(name))

    def atoms(self, name: str) -> frozenset[Atom]:
        """A list of atoms; empty if it is missing."""
        return frozenset(parse_atom(_text(each), each.location) for each in self.items(name))

    def assignments(self, name: str) -> dict[str, str]:
        """An object whose values are texts; empty if it is missing."""
        if not self.has(name):
            return {}
        value = self._object.members[name]
        if not isinstance(value, Object):
            raise _unexpected(value, f"an object for {name!r}")
        return {key: _text(each) for key, each in value.members.items()}

    def end(self) -> None:
        """InputError if there is a field that was not asked for."""
        for key in self._object.keys:
            if key.value not in self._read:
                known = list(dict.fromkeys(self._read))
                expected = f"found unknown field {shorten(key.value)}, expected only {', '.join(known)}"
                raise InputError(expected + _close(key.value, known), key.location)

    def _value(self, name: str, expected: str) -> Json:
        self._read.append(name)
        value = self._object.members.get(name)
        if value is None:
            raise InputError(f"found no field {name!r}, expected {expected}", self.location)
        return value


def _text(value: Json) -> str:
    if not isinstance(value, Text):
        raise _unexpected(value, "a text")
    return value.value


def _unexpected(value: Json, expected: str) -> InputError:
    return InputError(f"found {describe(value)}, expected {expected}", value.location)


def _close(name: str, known: Sequence[str]) -> str:
    """The suggestion alone: what is known has been said."""
    suggestion = did_you_mean(name, known)
    return suggestion if "did you mean" in suggestion else ""


Encoded: TypeAlias = dict[str, Any]


# -- messages ----------------------------------------------------------------------------------------------------------


def encode_message(message: Message) -> Encoded:
    """A message as a JSON object; lists are sorted."""
    match message:
        case Outcome(choice, value):
            return {"kind": "outcome", "choice": choice, "value": value}
        case Completion(action, event):
            return {"kind": "completion", "action": action, "event": event}
        case Estimate(true, false, complete):
            return {
                "kind": "estimate",
                "true": sorted(str(atom) for atom in true),
                "false": sorted(str(atom) for atom in false),
                "complete": complete,
            }
        case _:
            assert_never(message)


def decode_message(fields: Fields) -> Message:
    """The message that an object is; the caller calls `end`, after what else it has read.

    Raises:
        InputError: if the kind is unknown, or a field missing or wrong.
    """
    return _MESSAGES[fields.one_of("kind", MESSAGE_KINDS)](fields)


def _estimate(fields: Fields) -> Estimate:
    return Estimate(fields.atoms("true"), fields.atoms("false"), fields.flag("complete"))


_MESSAGES: Mapping[str, Callable[[Fields], Message]] = {
    "outcome": lambda fields: Outcome(fields.text("choice"), fields.text("value")),
    "completion": lambda fields: Completion(fields.text("action"), fields.optional_text("event")),
    "estimate": _estimate,
}
MESSAGE_KINDS = tuple(_MESSAGES)


def check_message(plan: TeamPlan, message: Message, location: Location | None = None) -> None:
    """What can be said of a message by the plan alone, whatever has happened.

    Atoms that nothing in the plan is about are allowed: those who look at the world see more than a plan needs.

    Raises:
        InputError: if it names a choice, a value, an activity or an event that the plan does not have, or makes a
            choice that is for the executive.
    """
    match message:
        case Outcome(choice, value):
            _check_outcome(plan, choice, value, location)
        case Completion(action, event):
            actions = {each.action for each in plan.network.activities}
            if action not in actions:
                raise _unknown("activity", action, actions, location)
            ends = {each.target for each in plan.network.activities if each.action == action}
            if event is not None and event not in ends:
                raise InputError(
                    f"found event {shorten(event)}, expected where {action} ends: {', '.join(sorted(ends))}", location
                )
        case Estimate():
            pass
        case _:
            assert_never(message)


def _check_outcome(plan: TeamPlan, name: str, value: str, location: Location | None) -> None:
    choice = next((each for each in plan.network.choices if each.name == name), None)
    if choice is None:
        raise _unknown("choice", name, plan.network.domains, location)
    if choice.controllable:
        raise InputError(f"found choice {name}, expected one that is not for the executive to make", location)
    if value not in choice.domain:
        raise InputError(f"found {name} = {shorten(value)}, expected one of {', '.join(choice.domain)}", location)


def _unknown(what: str, name: str, known: Mapping[str, Any] | set[str], location: Location | None) -> InputError:
    suggestion = did_you_mean(name, known)
    return InputError(f"found unknown {what} {shorten(name)}, expected one of the plan{suggestion}", location)


# -- decisions ---------------------------------------------------------------------------------------------------------


def encode_decision(decision: Decision) -> Encoded:  # noqa: PLR0911 - one for each kind
    """A decision as a JSON object."""
    match decision:
        case Executed(event, time, reported):
            return {"kind": "executed", "event": event, "time": str(time), "reported": reported}
        case Dispatched(action, agent, time, end, lower, upper):
            limits = {"lower": str(lower), "upper": None if upper is None else str(upper)}
            return {"kind": "dispatched", "action": action, "agent": agent, "time": str(time), "end": end, **limits}
        case Chosen(choice, value, time, observed):
            return {"kind": "chosen", "choice": choice, "value": value, "time": str(time), "observed": observed}
        case Violated(atom, expected, producer, consumers, time):
            return {
                "kind": "violated",
                "atom": str(atom),
                "expected": expected,
                "producer": producer,
                "consumers": list(consumers),
                "time": str(time),
            }
        case Rejected(message, reason, time):
            return {"kind": "rejected", "message": message, "reason": reason, "time": str(time)}
        case Failed(time, reason):
            return {"kind": "failed", "time": str(time), "reason": reason}
        case Succeeded(time, scenario):
            return {"kind": "succeeded", "time": str(time), "choices": dict(scenario)}
        case _:
            assert_never(decision)


def decode_decision(fields: Fields) -> Decision:
    """The decision that an object is.

    Raises:
        InputError: if the kind is unknown, or a field missing, wrong or unknown.
    """
    decode = _DECISIONS[fields.one_of("kind", tuple(_DECISIONS))]
    decision = decode(fields, fields.number("time"))
    fields.end()
    return decision


def _dispatched(fields: Fields, time: Fraction) -> Dispatched:
    return Dispatched(
        fields.text("action"),
        fields.optional_text("agent"),
        time,
        fields.text("end"),
        fields.number("lower"),
        fields.optional_number("upper"),
    )


def _violated(fields: Fields, time: Fraction) -> Violated:
    return Violated(
        fields.atom("atom"), fields.flag("expected"), fields.text("producer"), fields.texts("consumers"), time
    )


def _succeeded(fields: Fields, time: Fraction) -> Succeeded:
    return Succeeded(time, tuple(Assignment(*item) for item in fields.assignments("choices").items()))


_DECISIONS: Mapping[str, Callable[[Fields, Fraction], Decision]] = {
    "executed": lambda fields, time: Executed(fields.text("event"), time, fields.flag("reported")),
    "dispatched": _dispatched,
    "chosen": lambda fields, time: Chosen(fields.text("choice"), fields.text("value"), time, fields.flag("observed")),
    "violated": _violated,
    "rejected": lambda fields, time: Rejected(fields.text("message"), fields.text("reason"), time),
    "failed": lambda fields, time: Failed(time, fields.text("reason")),
    "succeeded": _succeeded,
}
