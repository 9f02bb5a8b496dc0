"""Values of options, exactly and checked before anything is computed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

from robust.errors import InputError, Location, did_you_mean
from robust.irr.box import Interval
from robust.numbers import EXPECTED_NUMBER, parse_number, shorten

PLOT_SUFFIXES = (".svg", ".png", ".pdf")


def positive(text: str, option: str) -> Fraction:
    """InputError unless the text is a number above 0."""
    value = parse_number(text, Location(option))
    if value <= 0:
        raise InputError(f"found {shorten(text)}, expected a number above 0", Location(option))
    return value


def not_negative(text: str, option: str) -> Fraction:
    """InputError unless the text is a number of at least 0."""
    value = parse_number(text, Location(option))
    if value < 0:
        raise InputError(f"found {shorten(text)}, expected a number of at least 0", Location(option))
    return value


def seconds(text: str | None, option: str) -> float | None:
    """A time limit; None is none."""
    if text is None:
        return None
    value = positive(text, option)
    return float(min(value, Fraction(10) ** 9))


def names(text: str | None, option: str) -> tuple[str, ...]:
    """Names with commas between them."""
    if text is None:
        return ()
    found = tuple(name.strip() for name in text.split(","))
    if not all(found):
        raise InputError(f"found {shorten(text)}, expected names such as a,b,c", Location(option))
    return found


def settings(texts: Sequence[str], known: Sequence[str]) -> dict[str, Fraction | Interval]:
    """`NAME=VALUE` and `NAME=LOW:HIGH`, each parameter at most once."""
    found: dict[str, Fraction | Interval] = {}
    for text in texts:
        place = Location(f"--at {shorten(text)}")
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name:
            raise InputError(f"found {shorten(text)}, expected NAME=VALUE or NAME=LOW:HIGH", place)
        if name not in known:
            raise InputError(f"found unknown parameter {shorten(name)}{did_you_mean(name, known)}", place)
        if name in found:
            raise InputError(f"found a second value for {shorten(name)}, expected one", place)
        found[name] = _setting(value, place)
    return found


def _setting(text: str, place: Location) -> Fraction | Interval:
    low, colon, high = (part.strip() for part in text.partition(":"))
    if not colon:
        return parse_number(low, place)
    lower, upper = _end(low, place), _end(high, place)
    if low in {"inf", "+inf"} or high == "-inf" or (lower is not None and upper is not None and lower > upper):
        raise InputError(f"found {shorten(text)}, expected LOW:HIGH with LOW not above HIGH", place)
    return Interval(lower, upper, lower_closed=lower is not None, upper_closed=upper is not None)


def _end(text: str, place: Location) -> Fraction | None:
    if text in {"inf", "+inf", "-inf"}:
        return None
    if not text:
        raise InputError(f"found an empty end of an interval, expected {EXPECTED_NUMBER}, inf or -inf", place)
    return parse_number(text, place)


def plot_file(path: Path | None) -> Path | None:
    """InputError unless a plot can be written to the path and its suffix names a format."""
    if path is None:
        return None
    place = Location("--plot")
    if path.suffix.lower() not in PLOT_SUFFIXES:
        raise InputError(f"found {shorten(str(path))}, expected a name that ends in {', '.join(PLOT_SUFFIXES)}", place)
    if not path.parent.is_dir():
        raise InputError(f"found no directory {shorten(str(path.parent))}, expected one to write the plot to", place)
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise InputError(f"cannot write {shorten(str(path))}, expected a file that can be written", place)
    return path
