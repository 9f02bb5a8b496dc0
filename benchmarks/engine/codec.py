"""Tasks and records as JSON and back, from their types: exact fractions and paths as text, enums by their values."""

from __future__ import annotations

import json
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import msgspec

Value = TypeVar("Value")


def plain(value: object) -> Any:
    """What JSON can say.

    Raises:
        TypeError: if some part of the value has no stable form.
    """
    return msgspec.to_builtins(value, enc_hook=_text)


def text_of(value: object, *, ordered: bool = False) -> str:
    """The value as one line of JSON; `ordered` by key, it is the same in every run and on every machine.

    Raises:
        TypeError: if some part of the value has no stable form.
    """
    try:
        return json.dumps(plain(value), allow_nan=False, sort_keys=ordered, separators=(",", ":"))
    except ValueError as error:
        raise TypeError(f"{value!r} has no stable form: {error}") from None


def restored(value: object, kind: type[Value] | Any) -> Value:
    """A value of that type from what JSON says.

    Raises:
        msgspec.ValidationError: if it is no such value.
    """
    return msgspec.convert(value, kind, dec_hook=lambda wanted, text: wanted(text))


def key_of(task: object) -> str:
    """A digest of the class of a task and all its fields.

    Raises:
        TypeError: if a field holds what has no stable form.
    """
    return sha256(text_of({type(task).__qualname__: task}, ordered=True).encode()).hexdigest()[:32]


def _text(value: object) -> str:
    if isinstance(value, Fraction | Path):
        return str(value)
    raise TypeError(f"{value!r} has no stable form")
