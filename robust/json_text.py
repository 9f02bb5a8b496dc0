"""JSON text with the place of every value, so that messages about a document can point into it.

Numbers stay text, to be read exactly; a key occurs once in an object; parsing does not recurse.
"""

from __future__ import annotations

import json
import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TypeAlias, assert_never

from robust.errors import InputError, Location
from robust.numbers import shorten

DEEPEST = 100
"""Values nested more deeply are refused: no document needs them."""

_BLANK = re.compile(r"[ \t\n\r]*")
_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?")
_STRING = re.compile(r'"(?:[^"\\\x00-\x1f]|\\.)*"')
_NUMBER_LIKE = re.compile(r"[-+.0-9a-zA-Z_]+")
_SURROGATE = re.compile("[\ud800-\udfff]")
_WORDS = {"true": True, "false": False, "null": None}
Key: TypeAlias = str | int
JsonPath: TypeAlias = tuple[Key, ...]
"""The keys and positions that lead to a value from the top of a document."""


@dataclass(frozen=True, slots=True)
class Text:
    value: str
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Numeral:
    """A number as it is written."""

    text: str
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Constant:
    """`true`, `false` or `null`."""

    value: bool | None
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Array:
    items: tuple[Json, ...]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Object:
    """`keys` are the keys with their places, in the order of the text."""

    members: dict[str, Json]
    keys: tuple[Text, ...]
    location: Location = field(compare=False)


Json: TypeAlias = Text | Numeral | Constant | Array | Object


def parse_json(text: str, file: str) -> Json:
    """The value of a document; `file` is its name in messages.

    Raises:
        InputError: at the place where the text is no JSON, repeats a key, or is nested too deeply.
    """
    return _Parser(text, file).document()


def describe(value: Json) -> str:
    """A short quotation of a value, for messages."""
    match value:
        case Text(text):
            return shorten(text)
        case Numeral(text):
            return text if len(text) <= 40 else f"{text[:37]}..."
        case Constant(constant):
            return {True: "true", False: "false", None: "null"}[constant]
        case Array(items):
            return "a list" if items else "an empty list"
        case Object(members):
            return "an object" if members else "an empty object"
        case _:
            assert_never(value)


def walk(top: Json) -> Iterator[tuple[JsonPath, Json]]:
    """Every value of a document with the path that leads to it; outer values first."""
    pending: list[tuple[JsonPath, Json]] = [((), top)]
    while pending:
        path, value = pending.pop()
        yield path, value
        match value:
            case Array(items):
                pending.extend(((*path, at), item) for at, item in enumerate(items))
            case Object(members):
                pending.extend(((*path, key), member) for key, member in members.items())
            case Text() | Numeral() | Constant():
                pass
            case _:
                assert_never(value)


@dataclass(slots=True)
class _Open:
    """An array or object whose end has not been read; `key` is the one whose value comes next."""

    closing: str
    location: Location
    items: list[Json] = field(default_factory=list)
    keys: list[Text] = field(default_factory=list)
    members: dict[str, Json] = field(default_factory=dict)

    def add(self, value: Json) -> None:
        if self.closing == "]":
            self.items.append(value)
        else:
            self.members[self.keys[-1].value] = value

    def close(self) -> Json:
        if self.closing == "]":
            return Array(tuple(self.items), self.location)
        return Object(self.members, tuple(self.keys), self.location)


class _Parser:
    def __init__(self, text: str, file: str) -> None:
        self._text = text
        self._file = file
        self._at = 0
        self._lines = [0, *(match.end() for match in re.finditer("\n", text))]
        self._open: list[_Open] = []

    def document(self) -> Json:
        if not self._peek():
            raise InputError("found an empty file, expected a JSON document", Location(self._file, 1, 1))
        value: Json | None = None
        while value is None or self._open:
            value = self._begin() if value is None else self._after(value)
        if self._peek():
            raise self._fault("the end of the document")
        return value

    def _begin(self) -> Json | None:
        """Read a value; None if it is an array or object and its first value comes next."""
        character = self._peek()
        if character == '"':
            return self._string()
        if character not in {"[", "{"}:
            return self._scalar()
        if len(self._open) == DEEPEST:
            raise InputError(f"found values nested more than {DEEPEST} deep, expected fewer", self._location())
        opened = _Open("]" if character == "[" else "}", self._location())
        self._at += 1
        if self._peek() == opened.closing:
            self._at += 1
            return opened.close()
        self._open.append(opened)
        self._key(opened)
        return None

    def _after(self, value: Json) -> Json | None:
        """Put a value where it belongs; None if another one comes next, otherwise what ends here."""
        opened = self._open[-1]
        opened.add(value)
        character = self._peek()
        if character == opened.closing:
            self._at += 1
            return self._open.pop().close()
        if character != ",":
            since = "" if character else f" to end what begins in line {opened.location.line}"
            raise self._fault(f"',' or '{opened.closing}'{since}")
        self._at += 1
        if self._peek() == opened.closing:
            raise self._fault("another value after ','")
        self._key(opened)
        return None

    def _key(self, opened: _Open) -> None:
        """Read a key and its colon, if values of the container have keys."""
        if opened.closing == "]":
            return
        if self._peek() != '"':
            raise self._fault('a key in quotes, as in "name"')
        key = self._string()
        if key.value in opened.members:
            first = next(one.location for one in opened.keys if one.value == key.value)
            message = f"found a second {shorten(key.value)}, expected one; the first is in line {first.line}"
            raise InputError(message, key.location)
        opened.keys.append(key)
        if self._peek() != ":":
            raise self._fault("':' after the key")
        self._at += 1

    def _string(self) -> Text:
        location = self._location()
        match = _STRING.match(self._text, self._at)
        if match is None:
            expected = "a string that ends in this line; write \\n for a line end"
            raise InputError(
                "found a string without an end, or with a control character, expected " + expected, location
            )
        try:
            value: str = json.loads(match.group())
        except json.JSONDecodeError as error:
            message = f"found an invalid escape in {shorten(match.group())}, expected JSON's, such as \\n or \\u00e9"
            self._at += error.pos
            raise InputError(message, self._location()) from None
        if _SURROGATE.search(value):
            raise InputError("found half a surrogate pair, expected a string of Unicode characters", location)
        self._at = match.end()
        return Text(value, location)

    def _scalar(self) -> Json:
        location = self._location()
        match = _NUMBER_LIKE.match(self._text, self._at)
        word = match.group() if match else ""
        if word in _WORDS:
            value: Json = Constant(_WORDS[word], location)
        elif _NUMBER.fullmatch(word):
            value = Numeral(word, location)
        else:
            raise self._fault("a JSON value")
        self._at += len(word)
        return value

    def _peek(self) -> str:
        """The next character that is not blank; empty at the end."""
        match = _BLANK.match(self._text, self._at)
        self._at = match.end() if match else self._at
        return self._text[self._at : self._at + 1]

    def _fault(self, expected: str) -> InputError:
        match = _NUMBER_LIKE.match(self._text, self._at)
        word = match.group() if match else self._text[self._at : self._at + 1]
        found = shorten(word) if word else "the end of the file"
        return InputError(f"found {found}, expected {expected}", self._location())

    def _location(self) -> Location:
        line = bisect_right(self._lines, self._at)
        return Location(self._file, line, self._at - self._lines[line - 1] + 1)
