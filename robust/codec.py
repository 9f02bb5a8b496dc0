"""JSON from types, and back: what is printed, kept or sent is declared once, as a class.

Exact numbers are strings (`"1/3"`), an end of an interval that is none is `"inf"` or `"-inf"`, seconds are JSON
numbers. The schema of a class is generated from it; fields that it does not have are errors.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import Enum
from fractions import Fraction
from pathlib import Path
from textwrap import dedent
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta, Struct

from robust.errors import InputError, Location
from robust.numbers import is_number, parse_number

Rational = Annotated[Fraction, Meta(description="a rational: an integer or a reduced fraction")]
End = Annotated[str, Meta(pattern="^(-?inf|-?[0-9]+(/[1-9][0-9]*)?)$", description="a rational, inf or -inf")]
Seconds = Annotated[float, Meta(ge=0, description="seconds")]
Count = Annotated[int, Meta(ge=0)]


class JsonObject(Struct, kw_only=True, forbid_unknown_fields=True):
    """An object of JSON; other fields than its own are errors."""


Made = TypeVar("Made")
MadeObject = TypeVar("MadeObject", bound=JsonObject)


def one_of(*values: str | int) -> Meta:
    """All that there may be."""
    return Meta(extra_json_schema={"enum": list(values)})


def like(kind: type[MadeObject], source: object, /, **others: Any) -> MadeObject:
    """A record with what an object holds under the same names, and with the others; seconds to the microsecond."""
    wanted = [name for name in kind.__struct_fields__ if name not in others and hasattr(source, name)]
    held = {name: getattr(source, name) for name in wanted}
    rounded = {name: round(value, 6) if isinstance(value, float) else value for name, value in held.items()}
    return kind(**rounded, **others)


def plain(value: object) -> Any:
    """A record, or anything made of some, as dictionaries, lists, texts and numbers."""
    return msgspec.to_builtins(value, enc_hook=_plain)


def _plain(value: object) -> Any:
    match value:
        case Fraction() | Path():
            return str(value)
        case Enum():
            return value.value
        case Mapping():
            return dict(value)
        case _:
            raise NotImplementedError(f"{type(value).__name__} has no JSON")


def from_json(kind: type[Made], text: str | bytes, place: Location) -> Made:
    """Read a record, and Fractions exactly.

    Raises:
        InputError: if the text is no JSON, or not of that type; the message says where in it.
    """
    try:
        return msgspec.json.decode(text, type=kind, dec_hook=_exact)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{error}", place) from None


def _exact(kind: type, value: Any) -> Any:
    if kind is Fraction and (isinstance(value, int) or (isinstance(value, str) and is_number(value))):
        return Fraction(value) if isinstance(value, int) else parse_number(value)
    raise ValueError(f"found {value!r}, expected {'a rational' if kind is Fraction else kind.__name__}")


def schema_of(kind: type[JsonObject], title: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a class; its `RULES` are what types cannot say.

    Descriptions are those of docstrings: of an object the text, of its fields what stands below `Attributes:`.
    """
    (found,), parts = msgspec.json.schema_components([kind], schema_hook=_schema, ref_template="#/$defs/{name}")
    for part in parts.values():
        del part["title"]
        text, _, said = part.pop("description", "").partition("Attributes:\n")
        if text.strip():
            part["description"] = text.strip()
        for name, words in _FIELD.findall(dedent(said)):
            part["properties"][name]["description"] = " ".join(words.split())
    top = parts.pop(found["$ref"].rsplit("/", 1)[1]) | getattr(kind, "RULES", {})
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    whole: dict[str, Any] = head | top | ({"$defs": parts} if parts else {})
    return whole


_FIELD = re.compile(r"^(\w+): (.*(?:\n .*)*)", re.MULTILINE)


def _schema(kind: type) -> dict[str, Any]:
    if kind is Fraction:
        return {"type": "string", "pattern": "^-?[0-9]+(/[1-9][0-9]*)?$"}
    raise NotImplementedError(kind.__name__)
