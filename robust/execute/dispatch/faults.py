"""Messages that cannot be what they claim: numbers that are none, names that nobody knows."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction

from robust.errors import did_you_mean
from robust.execute.dispatch.messages import Completed, Failed, Message, Observed, Started, StateEstimate
from robust.execute.dispatch.prepare import Dispatchable


def is_exact(number: object) -> bool:
    """Whether it is a number without rounding: floats, NaN among them, and texts are not."""
    return isinstance(number, Fraction | int) and not isinstance(number, bool)


def flaw(message: Message, dispatchable: Dispatchable) -> str | None:
    """What is wrong with a message by itself, in one line; None if nothing is."""
    match message:
        case Started() | Completed() | Failed():
            return _bad_time(message.time) or _unknown("instance", message.instance, dispatchable.plan.instance)
        case Observed(parameter, value):
            number = None if is_exact(value) else f"found {value!r} for {parameter!r}, expected an exact number"
            return _unknown("parameter", parameter, dispatchable.box.intervals) or number
        case StateEstimate(time):
            return _bad_time(time)
    return f"found {type(message).__name__}, expected a message"


def _bad_time(time: object) -> str | None:
    return None if is_exact(time) else f"found time {time!r}, expected an exact number"


def _unknown(kind: str, name: str, known: Collection[str]) -> str | None:
    return None if name in known else f"found {kind} {name!r}, expected one of the plan{did_you_mean(name, known)}"


def in_order(messages: Sequence[Message]) -> list[Message]:
    """Events by their time, starts first, then what is known about states and levels: they may arrive in any order."""

    def key(message: Message) -> tuple[int, Fraction, int]:
        match message:
            case Started(_, time) if is_exact(time):
                return 0, Fraction(time), 0
            case Completed(_, time) | Failed(_, time) if is_exact(time):
                return 0, Fraction(time), 1
            case _:
                return 1, Fraction(0), 0

    return sorted(messages, key=key)
