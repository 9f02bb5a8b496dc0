"""Journals: what an executive has been told and has decided, on disk before anyone hears of it.

A journal is a :mod:`file of records <robust.records>`, one for each step, after one that says of which plan it is. Only
what has reached the disk is announced; so a line that a crash has cut off can be dropped, and everything else can be
taken again by :meth:`PlanExecutive.repeat`, without any search.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, fields, is_dataclass
from fractions import Fraction
from hashlib import sha256

from robust.errors import InputError, Location
from robust.json_text import parse_line
from robust.numbers import shorten
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import JSON, Decision, Executed, Message
from robust.records import Accept, RecordFile, RecordFormat, read_records

SCHEMA = "robust/pike-journal/1"


@dataclass(frozen=True, slots=True)
class JournalStep:
    """What happened at one moment, and what was decided."""

    time: Fraction
    messages: tuple[Message, ...] = ()
    decisions: tuple[Decision, ...] = ()


class Journal(RecordFile):
    """A journal that can be written to; a context manager. `steps` are those that were there when it was opened.

    One process at a time: the file is locked until it is closed, or its process is no more.
    """

    def __init__(self, path: str | os.PathLike[str], plan: TeamPlan) -> None:
        """Open a journal of this plan, or begin one.

        A line that was cut off is removed.

        Raises:
            InputError: if the file is no journal, is of another plan, or is damaged, with the line; if it is in use, or
                cannot be opened.
        """
        steps: list[JournalStep] = []
        super().__init__(path, _format(plan), _accepting(plan, str(path), steps))
        self.steps = tuple(steps)

    def write(self, step: JournalStep) -> None:
        """Add a step; when this returns, it is on disk.

        Raises:
            InputError: if it cannot be written; then the journal is as it was.
        """
        self.append(JSON.write(JournalStep, step))


def read_journal(path: str | os.PathLike[str], plan: TeamPlan) -> tuple[JournalStep, ...]:
    """The steps of a journal, which may be in use; a last line that is not complete is left out.

    Raises:
        InputError: if the file is no journal, is of another plan, or is damaged; the message has the line.
        OSError: if it cannot be read.
    """
    steps: list[JournalStep] = []
    read_records(path, _format(plan), _accepting(plan, str(path), steps))
    return tuple(steps)


def resume(executive: PlanExecutive, steps: Iterable[JournalStep], file: str = "journal") -> None:
    """Bring an executive that has done nothing yet to where the steps end.

    Raises:
        InputError: if a step does not fit what came before it; `file` is the name of the journal in the message.
    """
    for line, step in enumerate(steps, 2):
        left = set(executive.plan.network.guards) - executive.progress.times.keys()
        for event in (each.event for each in step.decisions if isinstance(each, Executed)):
            if event not in left:
                raise InputError(
                    f"found event {shorten(event)} executed, expected one of the plan that was not yet",
                    Location(file, line),
                )
            left.remove(event)
        executive.repeat(step.time, step.messages, step.decisions)


def plan_digest(plan: TeamPlan) -> str:
    """A checksum of all that an execution depends on: network, conditions, effects and ε."""
    return sha256(json.dumps(_canonical(plan), separators=(",", ":")).encode()).hexdigest()


def _canonical(value: object) -> object:
    """A value as lists of texts, the same in every process."""
    if is_dataclass(value):
        return [_canonical(getattr(value, field.name)) for field in fields(value) if field.compare]
    if isinstance(value, frozenset):
        return sorted((_canonical(item) for item in value), key=repr)
    if isinstance(value, tuple):
        return [_canonical(item) for item in value]
    return None if value is None else str(value)


@dataclass(frozen=True, slots=True)
class _Header:
    """The first line of a journal: of which plan it is."""

    schema: str
    plan: str
    digest: str
    epsilon: Fraction


def _format(plan: TeamPlan) -> RecordFormat:
    header = _Header(SCHEMA, plan.name, plan_digest(plan), plan.epsilon)
    return RecordFormat("journal", JSON.write(_Header, header), chained=True)


def _accepting(plan: TeamPlan, file: str, steps: list[JournalStep]) -> Accept:
    """Takes the lines of a journal of a plan, and adds what they say to the steps."""

    def accept(number: int, text: str) -> None:
        line = parse_line(text, file)
        if number == 1:
            _check_header(JSON.read(_Header, line), plan)
            return
        step: JournalStep = JSON.read(JournalStep, line)
        if steps and step.time < steps[-1].time:
            message = f"found time {step.time}, expected {steps[-1].time} or later"
            raise InputError(message, line.members["time"].location)
        steps.append(step)

    return accept


def _check_header(found: _Header, plan: TeamPlan) -> None:
    name = shorten(found.plan)
    if found.plan != plan.name:
        raise InputError(f"found a journal of plan {name}, expected one of {shorten(plan.name)}")
    if found.epsilon != plan.epsilon:
        raise InputError(f"found a journal with ε = {found.epsilon}, expected one with {plan.epsilon}")
    if found.digest != plan_digest(plan):
        raise InputError(f"found a journal of another version of plan {name}, expected one of this plan")
