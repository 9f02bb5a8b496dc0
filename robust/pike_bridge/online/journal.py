"""Journals: what an executive has been told and has decided, on disk before anyone hears of it.

A journal is a file of JSON lines, one for each step, after one that says of which plan it is. A line is complete once
it ends; then it has reached the disk, and only then its decisions are announced. So a line that a crash has cut off was
never announced and can be dropped, and everything else can be taken again by :meth:`PlanExecutive.repeat`, without any
search. Each line carries a checksum of all lines up to it: no other damage goes unnoticed.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from types import TracebackType
from typing import Any

from robust.errors import InputError, Location
from robust.numbers import shorten
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Decision, Executed, Message
from robust.pike_bridge.online.wire import (
    Fields,
    decode_decision,
    decode_message,
    encode_decision,
    encode_message,
    in_line,
    parse_line,
)

SCHEMA = "robust/pike-journal/1"
_DIGITS = 16
"""Of each checksum."""


@dataclass(frozen=True, slots=True)
class JournalStep:
    """What happened at one moment, and what was decided."""

    time: Fraction
    messages: tuple[Message, ...] = ()
    decisions: tuple[Decision, ...] = ()


class Journal:
    """A journal that can be written to; a context manager. `steps` are those that were there when it was opened.

    One process at a time: the file is locked until it is closed, or its process is no more.
    """

    def __init__(self, path: str | os.PathLike[str], plan: TeamPlan) -> None:
        """Open a journal of this plan, or begin one.

        A line that was cut off is removed.

        Raises:
            InputError: if the file is no journal, is of another plan, or is damaged; the message has the line.
            OSError: if it cannot be read or written.
        """
        self.path = Path(path)
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            self._lock()
            self._open(plan)
        except BaseException:
            os.close(self._file)
            raise

    def write(self, step: JournalStep) -> None:
        """Add a step; when this returns, it is on disk.

        Raises:
            InputError: if it cannot be written; then the journal is as it was.
        """
        self._append(_encode_step(step))

    def close(self) -> None:
        """Let others have it."""
        os.close(self._file)

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                "found a journal that another process writes, expected one that is free", Location(str(self.path))
            ) from None

    def _open(self, plan: TeamPlan) -> None:
        content = self.path.read_bytes()
        lines = _Lines(str(self.path), plan)
        self.steps = lines.read(content)
        self._length, self._checksum = lines.length, lines.checksum
        if lines.length < len(content):
            os.ftruncate(self._file, lines.length)
        os.lseek(self._file, 0, os.SEEK_END)
        if not lines.length:
            self._append(_header(plan))
            _synchronize_directory(self.path)

    def _append(self, entry: Mapping[str, Any]) -> None:
        line, checksum = _line(entry, self._checksum)
        try:
            remaining = memoryview(line)
            while remaining:
                remaining = remaining[os.write(self._file, remaining) :]
            os.fsync(self._file)
        except OSError as error:
            os.ftruncate(self._file, self._length)
            os.lseek(self._file, 0, os.SEEK_END)
            raise InputError(f"cannot be written: {error.strerror}", Location(str(self.path))) from error
        self._length += len(line)
        self._checksum = checksum


def read_journal(path: str | os.PathLike[str], plan: TeamPlan) -> tuple[JournalStep, ...]:
    """The steps of a journal, which may be in use; a last line that is not complete is left out.

    Raises:
        InputError: if the file is no journal, is of another plan, or is damaged; the message has the line.
        OSError: if it cannot be read.
    """
    return _Lines(str(path), plan).read(Path(path).read_bytes())


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


class _Lines:
    """Reads the lines of a journal; `length` is that of all complete ones, `checksum` theirs."""

    def __init__(self, file: str, plan: TeamPlan) -> None:
        self.length = 0
        self.checksum = ""
        self._file = file
        self._plan = plan

    def read(self, content: bytes) -> tuple[JournalStep, ...]:
        lines = content.split(b"\n")
        *complete, rest = lines
        first = _line(_header(self._plan), "")[0]
        if not complete and not first.startswith(rest):
            raise InputError(f"found no journal, expected one of {SCHEMA}", Location(self._file, 1))
        steps: list[JournalStep] = []
        for number, line in enumerate(complete, 1):
            with in_line(self._file, number):
                fields = self._entry(line)
                if number == 1:
                    self._check_header(fields)
                else:
                    steps.append(_decode_step(fields, steps[-1:]))
                fields.end()
            self.length += len(line) + 1
        return tuple(steps)

    def _entry(self, line: bytes) -> Fields:
        try:
            text = line.decode()
        except UnicodeDecodeError:
            raise InputError("found bytes that are no UTF-8, expected a JSON object") from None
        fields = Fields(parse_line(text, self._file))
        if not self.checksum:
            fields.one_of("schema", (SCHEMA,))
        body, _, _ = text.rpartition(', "checksum": ')
        expected = _checksum(self.checksum, body)
        found = fields.text("checksum")
        if found != expected:
            raise InputError(f"found checksum {shorten(found)}, expected {expected}: the journal was changed here")
        self.checksum = expected
        return fields

    def _check_header(self, fields: Fields) -> None:
        name, digest, epsilon = fields.text("plan"), fields.text("digest"), fields.number("epsilon")
        if name != self._plan.name:
            raise InputError(f"found a journal of plan {shorten(name)}, expected one of {shorten(self._plan.name)}")
        if epsilon != self._plan.epsilon:
            raise InputError(f"found a journal with ε = {epsilon}, expected one with {self._plan.epsilon}")
        if digest != plan_digest(self._plan):
            raise InputError(f"found a journal of another version of plan {shorten(name)}, expected one of this plan")


def _header(plan: TeamPlan) -> dict[str, Any]:
    return {"schema": SCHEMA, "plan": plan.name, "digest": plan_digest(plan), "epsilon": str(plan.epsilon)}


def _encode_step(step: JournalStep) -> dict[str, Any]:
    return {
        "time": str(step.time),
        "messages": [encode_message(message) for message in step.messages],
        "decisions": [encode_decision(decision) for decision in step.decisions],
    }


def _decode_step(fields: Fields, before: Sequence[JournalStep]) -> JournalStep:
    time = fields.number("time")
    if any(time < step.time for step in before):
        raise InputError(f"found time {time}, expected {before[-1].time} or later", fields.where("time"))
    messages: list[Message] = []
    for item in fields.items("messages"):
        message = Fields.of(item)
        messages.append(decode_message(message))
        message.end()
    decisions = tuple(decode_decision(Fields.of(item)) for item in fields.items("decisions"))
    return JournalStep(time, tuple(messages), decisions)


def _line(entry: Mapping[str, Any], before: str) -> tuple[bytes, str]:
    """A line with its checksum, which follows from what was written before."""
    body = json.dumps(entry)[:-1]
    checksum = _checksum(before, body)
    return f'{body}, "checksum": "{checksum}"}}\n'.encode(), checksum


def _checksum(before: str, body: str) -> str:
    return sha256(f"{before}\n{body}".encode()).hexdigest()[:_DIGITS]


def _synchronize_directory(path: Path) -> None:
    """Make sure that the file is found after a crash of the machine."""
    directory = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)
