"""Tasks of a sweep: frozen data with a key that is the same in every run and on every machine."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol


class Task(Protocol):
    """A frozen dataclass of what JSON can say, fractions, paths, enums, tuples and further such dataclasses."""

    @property
    def label(self) -> str:
        """What people call it; need not be unique."""
        ...


Work = Callable[[Any], Any]
"""Does one task and returns what JSON can say; picklable, because other processes call it."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one attempt: `text` is the result as JSON, or, if it `failed`, one line that says why."""

    text: str
    failed: bool = False


def key_of(task: Task) -> str:
    """A digest of the task's class and all its fields.

    Raises:
        TypeError: if a field holds what has no stable form.
    """
    text = json.dumps(_plain(task), sort_keys=True, ensure_ascii=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()[:32]


def attempt(work: Work, task: Task) -> Outcome:
    """Do the task where it is called: in this process, or in one of a pool or a cluster.

    Whatever goes wrong with one task must not end the others: it is reported, never swallowed.
    """
    try:
        return Outcome(json.dumps(work(task), allow_nan=False))
    except Exception as error:
        lines = str(error).splitlines() or ["no message"]
        return Outcome(f"{type(error).__name__}: {lines[0]}", failed=True)


def _plain(value: object) -> Any:  # noqa: PLR0911 (one for each kind)
    match value:
        case None | bool() | int() | str():
            return value
        case float() if math.isfinite(value):
            return value
        case Fraction():
            return {"fraction": str(value)}
        case Path():
            return {"path": str(value)}
        case Enum():
            return {type(value).__name__: _plain(value.value)}
        case tuple() | list():
            return [_plain(one) for one in value]
        case _ if is_dataclass(value) and not isinstance(value, type):
            parts = {one.name: _plain(getattr(value, one.name)) for one in fields(value)}
            return {"": type(value).__qualname__, **parts}
        case _:
            raise TypeError(f"{value!r} in a task has no stable form")
