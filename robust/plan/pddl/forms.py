"""Read input files; whatever can go wrong with a file is an error that names it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from robust.errors import InputError, Location, did_you_mean

if TYPE_CHECKING:
    from lark import Lark, Token, Tree


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of an input file: UTF-8 with or without a byte order mark, any line ends.

    Raises:
        InputError: if the file cannot be read or is no text.
    """
    return _decode(read_bytes(path), Location(os.fspath(path)))


def read_bytes(path: str | os.PathLike[str], expected: str = "a readable text file") -> bytes:
    """What an input file holds.

    Raises:
        InputError: if it cannot be read; the message says that it is `expected`.
    """
    where = Location(os.fspath(path))
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"found no such file, expected {expected}{_similar(Path(path))}", where) from None
    except IsADirectoryError:
        raise InputError(f"found a directory, expected {expected}", where) from None
    except PermissionError:
        raise InputError(f"found a file that you may not read, expected {expected}", where) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read ({reason.lower()}), expected {expected}", where) from None


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
        return f"; the directory {path.parent} does not exist either" if not path.parent.exists() else ""
    hint = did_you_mean(path.name, names)
    return hint if hint.startswith("; did you mean") else ""


DEEPEST = 120
"""Forms nested more deeply are refused: the builders recurse, and nobody writes such a file."""

MOST_DIGITS = 400
"""Numbers of more digits, or of a larger exponent, are refused rather than computed."""


class Kind(Enum):
    NUMBER = "number"
    VARIABLE = "variable"
    NAME = "name"
    KEYWORD = "keyword"
    OPERATOR = "operator"
    TIME = "#t"


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
    text = " ".join(_quotable(inner) for inner in item.items[:3])
    if len(item.items) > 3:
        text += " …"
    return quote(f"({text})")


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


def read_forms(text: str, file: str) -> tuple[Item, ...]:
    """The forms of a file; parentheses match, and words are well formed."""
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken  # noqa: PLC0415 (lark takes 50 ms to import)

    parser = _parser()
    try:
        tree = parser.parse(text)
    except UnexpectedCharacters as error:
        raise _bad_word(text, error.pos_in_stream or 0, Location(file, error.line, error.column)) from None
    except UnexpectedToken:
        raise _unbalanced(parser.lex(text), file) from None
    return _convert(tree, file)


@cache
def _parser() -> Lark:
    from lark import Lark  # noqa: PLC0415 (as above)

    return Lark.open("grammar.lark", rel_to=__file__, start="file", parser="lalr", lexer="basic")


def _convert(tree: Tree[Token], file: str) -> tuple[Item, ...]:
    """Trees to forms, without recursion."""
    top: list[Item] = []
    stack: list[tuple[Iterator[Tree[Token] | Token], list[Item], Location | None]] = [(iter(tree.children), top, None)]
    while stack:
        children, items, opened = stack[-1]
        for child in children:
            if hasattr(child, "children"):
                inner = iter(child.children[1:-1])
                stack.append((inner, [], _location(child.children[0], file)))
                break
            items.append(Word(Kind[child.type], child.lower(), _location(child, file)))
        else:
            stack.pop()
            if opened is not None:
                stack[-1][1].append(Form(tuple(items), opened))
        if len(stack) > DEEPEST + 1:
            raise fault(stack[-1][2] or Location(file), f"at most {DEEPEST} of them", found="too many nested forms")
    return tuple(top)


def _location(token: Token | Tree[Token], file: str) -> Location:
    return Location(file, getattr(token, "line", None), getattr(token, "column", None))


def _bad_word(text: str, position: int, where: Location) -> InputError:
    # The lexer stops at the first character of a word that is none: quote the whole word.
    match = re.compile(r"[^\s();]+").match(text, position)
    word = match.group() if match else text[position : position + 1]
    hint = ""
    if word.startswith("-") and len(word) > 1:
        hint = "; a '-' before a type is followed by a blank"
    elif re.fullmatch(r"[+-]?[\d.]+/[\d.]+", word):
        hint = f"; write a fraction as (/ {' '.join(word.split('/'))})"
    expected = "a name (of letters, digits, '-' and '_'), a ?variable, a :keyword, a number or an operator"
    return fault(where, expected, found=quote(word.lower()), hint=hint)


def _unbalanced(tokens: Iterator[Token], file: str) -> InputError:
    """What is wrong with the parentheses of a text that the grammar refused."""
    stack: list[Token] = []
    heads: dict[int, str] = {}  # by the position of the parenthesis: the word that follows it
    closed: Token | None = None
    astray: tuple[Token, Token, str] | None = None
    previous: Token | None = None
    for token in tokens:
        if previous is not None and previous.type == "LPAR" and token.type not in ("LPAR", "RPAR"):
            heads[previous.start_pos or 0] = token.lower()
            # A section inside a section: the parenthesis that is missing belongs to the outer one.
            section = token.type == "KEYWORD" and token.lower() != ":synth-parameters"
            if section and len(stack) > 2 and astray is None:
                astray = (stack[1], previous, token.lower())
        if token.type == "LPAR":
            stack.append(token)
        elif token.type == "RPAR":
            if not stack:
                return _surplus(token, closed, file)
            stack.pop()
            closed = token if not stack else closed
        previous = token
    if astray is not None:
        opened, found, keyword = astray
        where = f"'({keyword}' in line {found.line}, column {found.column}"
    else:
        opened, where = stack[-1], "the end of the file"
    form = f"'({heads.get(opened.start_pos or 0, '')}'"
    return fault(_location(opened, file), f"')' to close the {form} that is opened here", found=where)


def _surplus(token: Token, closed: Token | None, file: str) -> InputError:
    hint = f"; the form before it ended in line {closed.line}, column {closed.column}" if closed else ""
    return fault(_location(token, file), "the end of the file", found="a surplus ')'", hint=hint)
