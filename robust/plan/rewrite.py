"""Other numbers in the text of a plan, with everything else left as it was written: comments, order, blanks."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from robust.errors import InputError, Location
from robust.numbers import format_number
from robust.plan.stn import parse_stn

_COMMENT = re.compile(r"#[^\n]*")
_INTERVAL = re.compile(r"c\s*:[^\[;]*\[\s*(?P<lower>[^\s,]+)\s*,\s*(?P<upper>[^\s\]]+)\s*\]")
_DEFAULT = re.compile(r"[^;]*?\sdefault\s+(?P<default>[^\s;]+)")


@dataclass(frozen=True, slots=True)
class Number:
    """A number in the text: of the statement at `location` the `lower` or `upper` bound, or the `default`."""

    location: Location | None
    part: str


def rewritten(text: str, file: str, numbers: Mapping[Number, Fraction]) -> str:
    """The text of a plan with other numbers.

    Raises:
        InputError: if a number does not stand in the file, because something else says it.
    """
    # Of the same length, so that positions stay what they are.
    bare = _COMMENT.sub(lambda found: " " * len(found.group()), text)
    spans = sorted(((_span(bare, file, number), value) for number, value in numbers.items()), reverse=True)
    for (start, end), value in spans:
        text = f"{text[:start]}{format_number(value)}{text[end:]}"
    parse_stn(text, file)
    return text


def _span(bare: str, file: str, number: Number) -> tuple[int, int]:
    place = number.location
    pattern = _DEFAULT if number.part == "default" else _INTERVAL
    if place is not None and place.file == file and place.line is not None and place.column is not None:
        begin = sum(len(line) for line in bare.splitlines(keepends=True)[: place.line - 1]) + place.column - 1
        found = pattern.match(bare, begin)
        if found is not None:
            return found.span(number.part)
    raise InputError(
        f"found no {number.part} value to replace in this file, expected it in a statement of the plan, not in options",
        Location(file),
    )
