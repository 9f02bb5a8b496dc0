"""What an executive is told and what it announces, as JSON objects and back; exact numbers are texts.

One table of kinds for all that goes through pipes (`robust pike run --stdio`) or into journals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, TypeAlias, assert_never

from robust.errors import InputError, Location, did_you_mean
from robust.pike_bridge.model import Assignment, TeamPlan
from robust.pike_bridge.online.fields import Fields
from robust.pike_bridge.online.messages import (
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
from robust.plan.numerals import shorten

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
