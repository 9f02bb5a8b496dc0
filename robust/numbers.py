"""Numbers as text, exactly: what plan files and options accept, and how rationals are printed.

A number is an integer, a decimal (`0.25`, `-3`, `1e-3`) or a fraction `a/b`. Numerator and denominator of a reduced
number have at most 300 digits: far more than any plan needs, and few enough that no input can exhaust memory.
"""

from __future__ import annotations

import re
from fractions import Fraction

from robust.errors import InputError, Location

_NUMBER = re.compile(r"[+-]?(?:[0-9]+/[0-9]+|(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE](?P<exponent>[+-]?[0-9]+))?)")
_LIMIT = 10**300
_LONGEST_TEXT = 2000  # the longest text of a number within the limit, 2^-996 in full, has about 1300 characters
_LARGEST_EXPONENT = 1000

EXPECTED_NUMBER = "a number such as 5, -0.25, 1e-3 or 1/3"


def is_number(text: str) -> bool:
    """Whether the text has the form of a number; :func:`parse_number` may still refuse its size or a division by 0."""
    return _NUMBER.fullmatch(text) is not None


def parse_number(text: str, location: Location | None = None) -> Fraction:
    """The exact value of a number; InputError for any other text, a zero denominator or an enormous number."""
    match = _NUMBER.fullmatch(text)
    if match is None:
        raise InputError(f"found {shorten(text)}, expected {EXPECTED_NUMBER}", location)
    exponent = match["exponent"] or "0"
    if len(text) > _LONGEST_TEXT or len(exponent) > 6 or abs(int(exponent)) > _LARGEST_EXPONENT:
        raise _too_large(text, location)
    try:
        value = Fraction(text)
    except ZeroDivisionError:
        raise InputError(f"found {shorten(text)}, expected a fraction whose denominator is not 0", location) from None
    if abs(value.numerator) >= _LIMIT or value.denominator >= _LIMIT:
        raise _too_large(text, location)
    return value


def format_number(value: Fraction) -> str:
    """The shortest exact text: a decimal where the expansion is finite, otherwise a fraction."""
    rest, twos, fives = value.denominator, 0, 0
    while rest % 2 == 0:
        rest, twos = rest // 2, twos + 1
    while rest % 5 == 0:
        rest, fives = rest // 5, fives + 1
    if rest != 1:
        return f"{value.numerator}/{value.denominator}"
    places = max(twos, fives)
    digits = str(abs(value.numerator) * 10**places // value.denominator).rjust(places + 1, "0")
    sign = "-" if value < 0 else ""
    return f"{sign}{digits[:-places]}.{digits[-places:]}" if places else f"{sign}{digits}"


def shorten(text: str) -> str:
    """Input text quoted for a one-line message: escaped, and cut when long."""
    return repr(text if len(text) <= 40 else f"{text[:37]}...")


def _too_large(text: str, location: Location | None) -> InputError:
    return InputError(f"found {shorten(text)}, expected a number of at most 300 digits", location)
