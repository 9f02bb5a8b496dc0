"""JSON text with the place of every value, so that messages about a document can point into it.

Numbers stay text, to be read exactly; a key occurs once in an object; parsing does not recurse. What other programs
send and people write becomes values of types by :class:`JsonTypes`, and these become JSON by it.

What is printed or kept is declared once, as a class: a result itself where JSON says the same (:func:`printed`), or
else a record (:class:`JsonObject`). Exact numbers are strings (`"1/3"`), infinite ends of intervals are `"inf"` or
`"-inf"`, seconds are JSON numbers. The published schema of a class is generated from it, see `tests/schemas.py`; fields
that it does not have are errors.
"""

from __future__ import annotations

import json
import re
import typing
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from enum import Enum
from fractions import Fraction
from functools import cache, singledispatch
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, TypeAlias, TypeVar, Union, assert_never, get_args, get_origin

import msgspec
from msgspec import UNSET, Meta, Struct

from robust.errors import InputError, Location, closest
from robust.numbers import EXPECTED_NUMBER, is_number, parse_number, shorten

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
class JsonText:
    """A string."""

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
    """A list."""

    items: tuple[Json, ...]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Object:
    """`keys` are the keys with their places, in the order of the text."""

    members: dict[str, Json]
    keys: tuple[JsonText, ...]
    location: Location = field(compare=False)


Json: TypeAlias = JsonText | Numeral | Constant | Array | Object


def parse_json(text: str, file: str, *, infinite: bool = False) -> Json:
    """The value of a document; `file` is its name in messages.

    With `infinite`, `Infinity` and `-Infinity` are numbers, as Python and JavaScript write them.

    Raises:
        InputError: at the place where the text is no JSON, repeats a key, or is nested too deeply.
    """
    return _Parser(text, file, infinite).document()


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


def describe(value: Json) -> str:
    """A short quotation of a value, for messages."""
    match value:
        case JsonText(text):
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
            case JsonText() | Numeral() | Constant():
                pass
            case _:
                assert_never(value)


@dataclass(slots=True)
class _Open:
    """An array or object whose end has not been read; `key` is the one whose value comes next."""

    closing: str
    location: Location
    items: list[Json] = field(default_factory=list)
    keys: list[JsonText] = field(default_factory=list)
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
    def __init__(self, text: str, file: str, infinite: bool = False) -> None:
        self._text = text
        self._file = file
        self._infinite = infinite
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
            first = next(earlier.location for earlier in opened.keys if earlier.value == key.value)
            where = "" if first.line == key.location.line else f"; the first is in line {first.line}"
            raise InputError(f"found a second {shorten(key.value)}, expected one{where}", key.location)
        opened.keys.append(key)
        if self._peek() != ":":
            raise self._fault("':' after the key")
        self._at += 1

    def _string(self) -> JsonText:
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
        return JsonText(value, location)

    def _scalar(self) -> Json:
        location = self._location()
        match = _NUMBER_LIKE.match(self._text, self._at)
        word = match.group() if match else ""
        if word in _WORDS:
            value: Json = Constant(_WORDS[word], location)
        elif _NUMBER.fullmatch(word) or (self._infinite and word.removeprefix("-") == "Infinity"):
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
        token = shorten(word) if word else "the end of the file"
        return InputError(f"found {token}, expected {expected}", self._location())

    def _location(self) -> Location:
        line = bisect_right(self._lines, self._at)
        return Location(self._file, line, self._at - self._lines[line - 1] + 1)


# -- values of types -------------------------------------------------------------------------------------------------


class Tagged:
    """A dataclass that is one of several: its `kind` in JSON is `KIND`, or else the name of the class in lower case."""

    __slots__ = ()
    KIND: ClassVar[str] = ""

    @classmethod
    def kind(cls) -> str:
        """The first member of the object."""
        return cls.KIND or cls.__name__.lower()


def named(name: str) -> dict[str, str]:
    """The metadata of a field that has another name in JSON."""
    return {"json": name}


class JsonTypes:
    """Writes values of declared types as JSON, and reads them with the place of whatever is wrong.

    A dataclass is an object with its fields, those of :class:`Tagged` classes with their kind; only fields with a
    default, or that may be None, can be missing. Tuples and sets are lists, sets sorted; tuples of pairs with names and
    mappings of texts are objects. Fractions are texts such as `"1/3"`, and read from JSON numbers as well, exactly.

    Args:
        texts: further types that are texts: how each is read, at its place. They are written by `str`.
    """

    def __init__(self, texts: Mapping[type, Callable[[str, Location], Any]]) -> None:
        self._texts = texts

    def write(self, kind: Any, value: Any) -> Any:
        """A value of a type, as what `json.dumps` takes."""
        if value is None or kind in {str, bool, int}:
            return value
        if kind is Fraction or kind in self._texts:
            return str(value)
        if members := _members(kind):
            return self.write(type(value) if any(map(_is_record, members)) else members[0], value)
        if _is_record(kind):
            written = {name: self.write(hint, getattr(value, member.name)) for name, member, hint in _fields(kind)}
            return {"kind": kind.kind(), **written} if issubclass(kind, Tagged) else written
        if _is_object(kind):
            return dict(value)
        items = [self.write(get_args(kind)[0], item) for item in value]
        return sorted(items) if get_origin(kind) is frozenset else items

    def read(self, kind: Any, value: Json, *, name: str = "", beside: Sequence[str] = ()) -> Any:  # noqa: PLR0911 - shapes
        """A value of a type; `name`: of the member that it is, for messages; `beside`: members that others read.

        Raises:
            InputError: at the place of whatever is not as expected, which says what was found.
        """
        if members := _members(kind):
            tagged = {member.kind(): member for member in members if _is_record(member)}
            kind = tagged[self._kind_of(value, tuple(tagged))] if tagged else members[0]
        if _is_record(kind) and kind not in self._texts:
            return self._record(kind, value, beside)
        match value:
            case JsonText(text) if kind is str:
                return text
            case JsonText(text) if kind in self._texts:
                return self._texts[kind](text, value.location)
            case JsonText(text) | Numeral(text) if kind is Fraction:
                return parse_number(text, value.location)
            case Constant(bool(constant)) if kind is bool:
                return constant
            case Array(items) if get_origin(kind) in {tuple, frozenset} and not _is_object(kind):
                return get_origin(kind)(self.read(get_args(kind)[0], item) for item in items)
            case Object(members=entries) if _is_object(kind):
                pairs = {key: self.read(str, item) for key, item in entries.items()}
                return pairs if get_origin(kind) is Mapping else tuple(map(get_args(kind)[0]._make, pairs.items()))
        expected = f"{self._expected(kind)} for {name!r}" if name else self._expected(kind)
        raise InputError(f"found {describe(value)}, expected {expected}", value.location)

    def member(self, kind: Any, value: Object, name: str) -> Any:
        """A member of an object; None where it is missing and may be.

        Raises:
            InputError: at the place of whatever is not as expected.
        """
        if NoneType in get_args(kind) and not _is_given(value, name):
            return None
        if name not in value.members:
            raise InputError(f"found no field {name!r}, expected {self._expected(kind)}", value.location)
        return self.read(kind, value.members[name], name=name)

    def _kind_of(self, value: Json, known: Sequence[str]) -> str:
        tag: str = self.member(str, as_object(value), "kind")
        if tag not in known:
            expected = f"found kind {shorten(tag)}, expected one of {', '.join(known)}{closest(tag, known)}"
            raise InputError(expected, as_object(value).members["kind"].location)
        return tag

    def _record(self, kind: Any, value: Json, beside: Sequence[str]) -> Any:
        record = as_object(value)
        known = ["kind"] if issubclass(kind, Tagged) else []
        values = {}
        for name, member, hint in _fields(kind):
            known.append(name)
            if _is_given(record, name) or (member.default is MISSING and member.default_factory is MISSING):
                values[member.name] = self.member(hint, record, name)
        known += beside
        for key in record.keys:
            if key.value not in known:
                expected = f"found unknown field {shorten(key.value)}, expected only {', '.join(known)}"
                raise InputError(expected + closest(key.value, known), key.location)
        return kind(**values)

    def _expected(self, kind: Any) -> str:
        if kind in self._texts:
            return "a text"
        if any(_is_object(each) or _is_record(each) for each in (kind, *_members(kind))):
            return "an object"
        if get_origin(kind) in {tuple, frozenset}:
            return "a list"
        return {Fraction: EXPECTED_NUMBER, bool: "true or false"}.get(kind, "a text")


def as_object(value: Json) -> Object:
    """The value; InputError if it is no object."""
    if not isinstance(value, Object):
        raise InputError(f"found {describe(value)}, expected an object", value.location)
    return value


def _is_record(kind: Any) -> bool:
    return is_dataclass(kind)


@cache
def _fields(kind: Any) -> tuple[tuple[str, Field[Any], Any], ...]:
    """The fields of a dataclass with their names in JSON and their types."""
    hints = typing.get_type_hints(kind)
    return tuple((member.metadata.get("json", member.name), member, hints[member.name]) for member in fields(kind))


@cache
def _members(kind: Any) -> tuple[Any, ...]:
    """The members of a union, without None; empty if the type is no union."""
    union = get_origin(kind) in {Union, UnionType}
    return tuple(member for member in get_args(kind) if member is not NoneType) if union else ()


@cache
def _is_object(kind: Any) -> bool:
    """Whether the type is a mapping, or a tuple of pairs with names."""
    return get_origin(kind) is Mapping or (get_origin(kind) is tuple and hasattr(get_args(kind)[0], "_make"))


def _is_given(value: Object, name: str) -> bool:
    member = value.members.get(name)
    return member is not None and not (isinstance(member, Constant) and member.value is None)


# -- records -------------------------------------------------------------------------------------------------------

Rational = Annotated[Fraction, Meta(description="a rational: an integer or a reduced fraction")]
End = Annotated[str, Meta(pattern="^(-?inf|-?[0-9]+(/[1-9][0-9]*)?)$", description="a rational, inf or -inf")]
Seconds = Annotated[float, Meta(ge=0, description="seconds")]
Count = Annotated[int, Meta(ge=0)]


class JsonObject(Struct, kw_only=True, forbid_unknown_fields=True):
    """An object of JSON; other fields than its own are errors."""


Decoded = TypeVar("Decoded")
Record = TypeVar("Record", bound=JsonObject)


def one_of(*values: str | int) -> Meta:
    """The permitted values of a type, for its schema."""
    return Meta(extra_json_schema={"enum": list(values)})


@singledispatch
def wire(value: Any) -> Any:
    """The representation of a value in JSON: itself, unless a function is registered for its type.

    The annotation of what that function returns is what the schema says of the type.
    """
    return value


_NAMES: dict[str, Mapping[str, str | None]] = {}


def on_wire(kind: str, /, **names: str | None) -> None:
    """Give fields of the results of a class other names in JSON; None leaves one out."""
    _NAMES[kind] = names


def is_result(kind: type) -> bool:
    """Whether values of the class are objects of their fields: dataclasses, and named tuples that are declared so."""
    return is_dataclass(kind) or kind.__name__ in _NAMES


def members_of(kind: type) -> Iterator[tuple[str, str]]:
    """The fields of a result that are in JSON, with their names there."""
    names = _NAMES.get(kind.__name__, {})
    for name in getattr(kind, "_fields", None) or [member.name for member in fields(kind)]:
        if (shown := names.get(name, name)) is not None:
            yield name, shown


def like(kind: type[Record], source: object, /, **others: Any) -> Record:
    """A record with what an object holds under the same names, and with the others; seconds to the microsecond."""
    wanted = [name for name in kind.__struct_fields__ if name not in others and hasattr(source, name)]
    return kind(**{name: _rounded(getattr(source, name)) for name in wanted}, **others)


def _rounded(value: Any) -> Any:
    return round(value, 6) if isinstance(value, float) else value


def plain(value: object) -> Any:
    """A record, or anything made of some, as dictionaries, lists, texts and numbers that can be read again."""
    return msgspec.to_builtins(value, enc_hook=_plain)


def _plain(value: object) -> Any:
    match value:
        case Fraction() | Path():
            return str(value)
        case Mapping():
            return dict(value)
        case _:
            raise NotImplementedError(f"{type(value).__name__} has no JSON")


def printed(value: object) -> Any:  # noqa: PLR0911 - one for each kind of value
    """A record, a result, or anything made of some, as dictionaries, lists, texts and numbers: what `--json` prints.

    Results are their fields, see :func:`on_wire`, with seconds to the microsecond.
    """
    match value := wire(value):
        case None | bool() | int() | float() | str():
            return value
        case Fraction() | Path():
            return str(value)
        case Enum():
            return value.value
        case Mapping():
            return {name if isinstance(name, str) else str(name): printed(item) for name, item in value.items()}
        case Struct():
            tag = value.__struct_config__.tag
            members = ((name, getattr(value, name)) for name in value.__struct_fields__)
            given = {name: printed(item) for name, item in members if item is not UNSET}
            return {value.__struct_config__.tag_field: tag, **given} if tag else given
        case _ if is_result(type(value)):
            return {shown: printed(_rounded(getattr(value, name))) for name, shown in members_of(type(value))}
        case list() | tuple() | set() | frozenset():
            return [printed(item) for item in value]
        case _:
            raise NotImplementedError(f"{type(value).__name__} has no JSON")


def from_json(kind: type[Decoded], text: str | bytes, place: Location) -> Decoded:
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
