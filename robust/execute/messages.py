"""What happens to a plan that others execute, as it is told: messages, what they say together, and their journal.

Messages may come late, repeatedly and in any order: what a message means does not depend on those that came before,
unless they contradict it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from hashlib import sha256
from typing import Any

from robust import json_text, records
from robust.errors import InputError
from robust.numbers import format_number, shorten
from robust.plan import model


class MessageKind(Enum):
    """What a message says."""

    START = "start"
    END = "end"
    FAILED = "failed"
    CANCELLED = "cancelled"
    VALUE = "value"
    FACT = "fact"
    TICK = "tick"
    RETRACT = "retract"


STEPS = {MessageKind.START, MessageKind.END, MessageKind.FAILED, MessageKind.CANCELLED}
"""What happens to steps."""
OBSERVED = {MessageKind.VALUE: Fraction, MessageKind.FACT: bool}
"""What is observed of the state, and of which type it is."""


@dataclass(frozen=True, slots=True)
class MonitorMessage:
    """What happened: to a step, by its identifier or as `drive r1 a b`; a tick says what time it is at least.

    Attributes:
        kind: what it is.
        step: of which step; the fluent or the atom that was observed; of a retraction, the number of the message that
            was wrong.
        at: when it happened, in the plan's unit of time.
        arrived: when it became known; nothing earlier than that, if given.
        observed: the number that a fluent has, or whether an atom is true, right after what happens at that time.
    """

    kind: MessageKind
    step: str = ""
    at: Fraction | None = None
    arrived: Fraction | None = None
    observed: Fraction | bool | None = None

    def as_dict(self) -> dict[str, Any]:
        """The message as a line of JSON says it."""
        if self.kind is MessageKind.TICK:
            return {"tick": str(self.at)}
        rest = {"is": self.observed, "at": self.at, "arrived": self.arrived}
        known = {name: each for name, each in rest.items() if each is not None}
        return {self.kind.value: self.step} | {n: v if isinstance(v, bool) else str(v) for n, v in known.items()}

    @property
    def time(self) -> Fraction:
        """What time it is at least once this is known, in the plan's unit."""
        return max(self.at or Fraction(0), self.arrived or Fraction(0))


class ContradictionError(Exception):
    """Messages about a step contradict each other; internal, the message says how."""


_ORDER = tuple(MessageKind)


@dataclass(frozen=True, slots=True)
class StepProgress:
    """How far a step is.

    Attributes:
        start: when it started; None if it has not, or failed since.
        end: when it ended.
        failure: the last failure in words, if it has not started since; empty if there is none.
        attempts: starts and ends of attempts that failed or were cancelled.
        unbegun: the end that was said of a step whose start was not, which counts as not started.
    """

    start: Fraction | None = None
    end: Fraction | None = None
    failure: str = ""
    attempts: tuple[tuple[Fraction, Fraction], ...] = ()
    unbegun: Fraction | None = None

    @classmethod
    def of(cls, messages: Iterable[MonitorMessage], instance: model.ActionInstance) -> StepProgress:
        """What messages about a step say together, in whatever order they came.

        Raises:
            ContradictionError: if they cannot all be right.
        """
        start: Fraction | None = None
        end: Fraction | None = None
        failure, attempts = "", list[tuple[Fraction, Fraction]]()
        for message in sorted(messages, key=lambda each: (each.at or Fraction(0), _ORDER.index(each.kind))):
            at = message.at or Fraction(0)
            known = {MessageKind.START: start, MessageKind.END: end}.get(message.kind)
            if known not in (None, at):
                said = f"found {message.step} {message.kind.value} at {time_text(at)} and at {time_text(known)}"
                raise ContradictionError(f"{said}, expected one time")
            if message.kind is MessageKind.START:
                if end is not None and instance.durative:
                    raise ContradictionError(f"found {message.step} end at {time_text(end)}, before its start")
                start, failure = at, ""
                end = end if instance.durative else start
            elif message.kind is MessageKind.END:
                end = at
            else:
                if start is not None:
                    attempts.append((start, at))
                start, end, failure = None, None, f"{message.kind.value} at {time_text(at)}"
        known, unbegun = (None, end) if start is None else (end, None)
        return cls(start, known, failure, tuple(attempts), unbegun)

    def by(self, time: Fraction) -> StepProgress:
        """How far the step was at a time after all attempts that failed."""
        start, end = (None if at is None or at > time else at for at in (self.start, self.end))
        return self if (start, end) == (self.start, self.end) else replace(self, start=start, end=end)

    @property
    def is_running(self) -> bool:
        return self.start is not None and self.end is None

    def times(self, instance: model.ActionInstance) -> dict[model.TimePoint, Fraction]:
        """When the time points of the step happened, as far as they have."""
        both = ((instance.start, self.start), (instance.end, self.end))
        return {point: time for point, time in both if time is not None}


JOURNAL = "robust/watch-journal/1"


def read_message(text: bytes, line: int, now: Fraction | None = None) -> MonitorMessage:
    """What a line says; times that it does not say are now.

    Raises:
        InputError: with the line and what is wrong in it.
    """
    with records.in_line("input", line):
        try:
            return message_of(json_text.parse_line(text.decode(), "input"), now)
        except UnicodeDecodeError:
            raise InputError("found bytes that are no UTF-8, expected a JSON object") from None


def message_of(line: json_text.Object, now: Fraction | None = None) -> MonitorMessage:
    """What a line of a journal or of the input says; see :func:`read_message`."""
    types = json_text.JsonTypes({})
    kinds = {kind.value: kind for kind in MessageKind}
    said = [key for key in line.keys if key.value in kinds]
    if len(said) != 1:
        other = next((key for key in line.keys if key.value not in {*kinds, "at", "arrived", "is"}), None)
        found = f"found {shorten(other.value)}" if other and not said else f"found {len(said)} of these"
        raise InputError(f"{found}, expected one of {', '.join(kinds)}", line.location)
    kind, name = kinds[said[0].value], said[0].value
    known = {name} if kind in {MessageKind.TICK, MessageKind.RETRACT} else {name, "at", "arrived"}
    known |= {"is"} if kind in OBSERVED else set()
    if (unknown := next((key for key in line.keys if key.value not in known), None)) is not None:
        raise InputError(
            f"found {shorten(unknown.value)} with {name}, expected only {', '.join(sorted(known))}", unknown.location
        )
    if kind is MessageKind.TICK:
        return MonitorMessage(kind, at=types.member(Fraction, line, name))
    if kind is MessageKind.RETRACT:
        number = types.member(Fraction, line, name)
        return MonitorMessage(kind, str(number))
    at, arrived = (types.member(Fraction | None, line, key) for key in ("at", "arrived"))
    if at is None and now is None:
        raise InputError("found no 'at', expected the time when it happened", line.location)
    observed = types.member(OBSERVED[kind], line, "is") if kind in OBSERVED else None
    return MonitorMessage(kind, types.member(str, line, name), now if at is None else at, arrived or now, observed)


def read_journal(
    path: str | os.PathLike[str],
    plan: model.ParametrizedPlan,
    epsilon: Fraction,
    take: Callable[[json_text.Object], object],
) -> records.RecordFile:
    """Open or begin the journal of a plan's messages, and take each of those that it holds.

    Raises:
        InputError: if it is none, of another plan, damaged or in use.
    """
    steps = [[step.identifier, str(step)] for step in plan.instances]
    digest = sha256(repr([steps, plan.constraints, plan.parameters, epsilon]).encode()).hexdigest()
    header = {"schema": JOURNAL, "plan": digest}

    def accept(number: int, text: str) -> None:
        line = json_text.parse_line(text, str(path))
        if number > 1:
            take(line)
        elif json_text.JsonTypes({}).member(str, line, "plan") != digest:
            raise InputError("found a journal of another plan, expected one of this plan")

    return records.RecordFile(path, records.RecordFormat("journal", header, chained=True), accept)


def time_text(time: Fraction | None) -> str:
    """A time, for people."""
    return "none" if time is None else format_number(time)
