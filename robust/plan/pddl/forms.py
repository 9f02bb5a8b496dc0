"""Input files as text, and the text of PDDL as nested parenthesised forms.

Whatever can go wrong with a file is an error that names it, with line and column. This module decides what a word is
and which parentheses belong together; the typed builders (:mod:`robust.plan.pddl.reader`) decide what a form means,
because only they know what is expected at a place.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from pathlib import Path
from typing import BinaryIO, TypeGuard

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import shorten

LARGEST = 2**23
"""Bytes of a file that people or their tools write: reading takes up to a hundred times as much memory."""
LARGEST_LOG = 2**26
"""Bytes of what a planner prints."""
LONGEST_LINE = 2**20
"""Bytes of a line of that."""


def read_text(path: str | os.PathLike[str], most: int = LARGEST, *, expected: str = "a readable text file") -> str:
    """The text of an input file, limited in bytes: UTF-8 with or without a byte order mark, any line ends.

    Raises:
        InputError: if the file cannot be read, is too large or is no text; the message says what is `expected`.
    """
    return _decode(read_bytes(path, expected, most), Location(os.fspath(path)))


def read_plan_text(path: str | os.PathLike[str]) -> tuple[str, str]:
    """The text of a plan, or of a planner's log that holds it, and what to call its file; `-` is standard input.

    Raises:
        InputError: if it cannot be read, it or one of its lines is too large, or it is no text.
    """
    if not isinstance(path, str | os.PathLike) or os.fspath(path) != "-":
        data, place = read_bytes(path, most=LARGEST_LOG), Location(os.fspath(path))
    elif sys.stdin is None:
        raise InputError("found a closed standard input, expected a plan", Location("<stdin>"))
    else:
        place = Location("<stdin>")
        data = _limited(sys.stdin.buffer, LARGEST_LOG, place)
    _refuse_long_lines(data, place)
    return _decode(data, place), place.file


def _is_form(line: str) -> bool:
    """Whether a line has a parenthesis and ends as a form, a step or a statement of PDDL does."""
    return "(" in line and line.rstrip().endswith((")", "]", ";"))


def is_text(source: object, is_written: Callable[[str], bool] = _is_form) -> TypeGuard[str]:
    """Whether an input is a text rather than a path: a string with a line break.

    A string of one line is a text if it is written as one, such as a form of PDDL, and no file has that name.
    """
    if not isinstance(source, str) or "\n" in source:
        return isinstance(source, str)
    return is_written(source) and not os.path.exists(source)


def plan_text(plan: str | os.PathLike[str]) -> tuple[str, str]:
    """The text of a plan and what to call it, of a path, as :func:`read_plan_text`, or of a text."""
    return (plan, "<plan>") if is_text(plan) else read_plan_text(plan)


def read_bytes(path: str | os.PathLike[str], expected: str = "a readable text file", most: int = LARGEST) -> bytes:
    """What an input file holds.

    Raises:
        InputError: if it cannot be read, or is larger than that; the message says what is `expected`.
    """
    if not isinstance(path, str | os.PathLike) or not os.fspath(path):
        raise InputError(f"found {shorten(repr(path))}, expected the path of {expected}")
    where = Location(os.fspath(path))
    try:
        with open(path, "rb") as file:
            if os.fstat(file.fileno()).st_size > most:
                raise too_large(most, where)
            return _limited(file, most, where)
    except FileNotFoundError:
        found = "a link to a file that does not exist" if Path(path).is_symlink() else "no such file"
        expected += _similar(Path(path))
    except IsADirectoryError:
        found = "a directory"
    except PermissionError:
        found = "a file that you may not read"
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read ({reason.lower()}), expected {expected}", where) from None
    raise InputError(f"found {found}, expected {expected}", where)


def _limited(file: BinaryIO, most: int, where: Location) -> bytes:
    """What is in a file that may have no end; InputError if that is too much."""
    data = file.read(most + 1)
    if len(data) > most:
        raise too_large(most, where)
    return data


def too_large(most: int, where: Location) -> InputError:
    """The error for an input of more than `most` bytes."""
    return InputError(f"found more than {most >> 20} MB, expected a smaller file", where)


def _refuse_long_lines(data: bytes, where: Location) -> None:
    begin = 0
    while len(data) - begin > LONGEST_LINE:
        window = begin, begin + LONGEST_LINE + 1
        end = max(data.rfind(b"\n", *window), data.rfind(b"\r", *window))
        if end < 0:
            line = data.count(b"\n", 0, begin) + 1
            message = f"found a line of more than {LONGEST_LINE >> 20} MB, expected steps or a network"
            raise InputError(message, Location(where.file, line))
        begin = end + 1


def _decode(data: bytes, where: Location) -> str:
    if b"\0" in data:
        raise InputError("found binary data, expected a UTF-8 text file", where)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        message = f"found byte 0x{data[error.start]:02x} in line {line}, expected a UTF-8 text file"
        raise InputError(message, where) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _similar(path: Path) -> str:
    """A hint at files of a similar name in the same directory."""
    try:
        names = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        return f"; the directory {Location(str(path.parent))} does not exist either" if not path.parent.exists() else ""
    hint = did_you_mean(path.name, set(names) - {path.name})
    return hint if hint.startswith("; did you mean") else ""


DEEPEST = 120
"""Forms nested more deeply are refused: the builders recurse, and nobody writes such a file."""

MOST_DIGITS = 400
"""Numbers of more digits, or of a larger exponent, are refused rather than computed."""


class Kind(Enum):
    """The kinds of words with their form; of those that match, the first counts."""

    NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
    OPERATOR = r"(?:<=|>=|[-+*/=<>])"
    TIME = r"#[tT]"
    VARIABLE = r"\?[A-Za-z0-9_][A-Za-z0-9_-]*"
    KEYWORD = r":[A-Za-z0-9_][A-Za-z0-9_-]*"
    NAME = r"[A-Za-z0-9_][A-Za-z0-9_-]*"
    DASHED = r"-[A-Za-z_][A-Za-z0-9_-]*"
    """A type after a `-` without a blank; of no meaning elsewhere."""


@dataclass(frozen=True, slots=True)
class Word:
    """A word in lower case."""

    kind: Kind
    text: str
    location: Location


@dataclass(frozen=True, slots=True)
class Form:
    """A parenthesised sequence; `location` is that of its opening parenthesis."""

    items: tuple[Item, ...]
    location: Location

    @property
    def head(self) -> str:
        """The first word, or nothing if there is none."""
        return self.items[0].text if self.items and isinstance(self.items[0], Word) else ""

    @property
    def rest(self) -> tuple[Item, ...]:
        return self.items[1:]


Item = Word | Form


def is_word(item: Item | None, *kinds: Kind) -> TypeGuard[Word]:
    """Whether an item is a word of one of these kinds."""
    return isinstance(item, Word) and item.kind in kinds


def walk(item: Item) -> Iterator[Item]:
    """An item and all items inside it."""
    pending = [item]
    while pending:
        current = pending.pop()
        yield current
        if isinstance(current, Form):
            pending.extend(current.items)


def fault(item: Item | Location, expected: str, *, found: str | None = None, hint: str = "") -> InputError:
    """The error at `item` that something else was expected; `hint` is appended as it is."""
    location = item if isinstance(item, Location) else item.location
    if found is None:
        found = "nothing" if isinstance(item, Location) else describe(item)
    return InputError(f"found {found}, expected {expected}{hint}", location)


def describe(item: Item) -> str:
    """A short quotation of `item`, for messages."""
    if isinstance(item, Word):
        return quote(item.text)
    more = " …" if len(item.items) > 3 else ""
    return quote(f"({' '.join(map(_quotable, item.items[:3]))}{more})")


def quote(text: str) -> str:
    short = text if len(text) <= 60 else text[:59] + "…"
    return f"'{short}'" if short.isprintable() else ascii(short)


def _quotable(item: Item) -> str:
    if isinstance(item, Word):
        return item.text
    return f"({item.head} …)" if len(item.items) > 1 else f"({item.head})"


def number(word: Word) -> Fraction:
    """The exact value of a NUMBER."""
    mantissa, _, exponent = word.text.partition("e")
    if len(mantissa) > MOST_DIGITS or len(exponent) > 6 or abs(int(exponent or 0)) > MOST_DIGITS:
        raise fault(word, f"a number of at most {MOST_DIGITS} digits")
    return Fraction(word.text)


# A word ends where white space, a parenthesis or a comment begins; an operator also where a variable begins.
_WORDS = "|".join(rf"(?P<{kind.name}>{kind.value})(?=[\s();{'?#' * (kind is Kind.OPERATOR)}]|\Z)" for kind in Kind)
_TOKEN = re.compile(rf"(?:\s+|;.*)|(?P<OPEN>\()|(?P<CLOSE>\))|{_WORDS}|(?P<BAD>[^\s();]+)")


@dataclass(slots=True)
class _OpenForm:
    """A form whose end has not been read."""

    items: list[Item]
    location: Location

    def __str__(self) -> str:
        return f"'({self.items[0].text if self.items and isinstance(self.items[0], Word) else ''}'"


def read_forms(text: str, file: str) -> tuple[Item, ...]:
    """The forms of a file; parentheses match, and words are well formed."""
    top: list[Item] = []
    stack: list[_OpenForm] = []
    astray: tuple[_OpenForm, _OpenForm] | None = None
    closed: Location | None = None
    for match, location in _tokens(text, file):
        items = stack[-1].items if stack else top
        match match.lastgroup:
            case "OPEN":
                stack.append(_OpenForm([], location))
                if len(stack) > DEEPEST:
                    raise fault(location, f"at most {DEEPEST} of them", found="too many nested forms")
            case "CLOSE" if not stack:
                hint = f"; the form before it ended in line {closed.line}, column {closed.column}" if closed else ""
                raise fault(location, "the end of the file", found="a surplus ')'", hint=hint)
            case "CLOSE":
                form = stack.pop()
                (stack[-1].items if stack else top).append(Form(tuple(form.items), form.location))
                closed = closed if stack else location
            case "BAD":
                raise _bad_word(match.group(), location)
            case kind:
                word = Word(Kind[kind or ""], match.group().lower(), location)
                # A section inside a section: the parenthesis that is missing belongs to the outer one.
                if word.kind is Kind.KEYWORD and not items and len(stack) > 2 and word.text != ":synth-parameters":
                    astray = astray or (stack[1], stack[-1])
                items.append(word)
    if stack:
        raise _unclosed(stack, astray)
    return tuple(top)


def _tokens(text: str, file: str) -> Iterator[tuple[re.Match[str], Location]]:
    """Words and parentheses with their places; none of them spans lines."""
    for number, line in enumerate(text.split("\n"), start=1):
        for match in _TOKEN.finditer(line):
            if match.lastgroup is not None:
                yield match, Location(file, number, match.start() + 1)


def _bad_word(word: str, where: Location) -> InputError:
    is_fraction = re.fullmatch(r"[+-]?[\d.]+/[\d.]+", word)
    hint = f"; write a fraction as (/ {' '.join(word.split('/'))})" if is_fraction else ""
    expected = "a name (of letters, digits, '-' and '_'), a ?variable, a :keyword, a number or an operator"
    return fault(where, expected, found=quote(word.lower()), hint=hint)


def _unclosed(stack: list[_OpenForm], astray: tuple[_OpenForm, _OpenForm] | None) -> InputError:
    """The file ends before all forms do; `astray` is the first section found inside of another one."""
    opened, where = stack[-1], "the end of the file"
    if astray is not None:
        opened, inner = astray
        where = f"{inner} in line {inner.location.line}, column {inner.location.column}"
    return fault(opened.location, f"')' to close the {opened} that is opened here", found=where)
