"""Numbers as text: what plan files and options accept, how rationals are printed exactly, and as people read them.

A number is an integer, a decimal (`0.25`, `-3`, `1e-3`) or a fraction `a/b`. Numerator and denominator of a reduced
number have at most 300 digits: far more than any plan needs, and few enough that no input can exhaust memory.
"""

import os
import re
from decimal import Decimal
from fractions import Fraction
from numbers import Rational, Real

from robust.errors import LONGEST_PATH, InputError, Location

_NUMBER = re.compile(r"[+-]?(?:[0-9]+/[0-9]+|(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE](?P<exponent>[+-]?[0-9]+))?)")
_LIMIT = 10**300
_LONGEST_TEXT = 2000  # the longest text of a number within the limit, 2^-996 in full, has about 1300 characters
_LARGEST_EXPONENT = 1000

Number = int | str | Fraction | Decimal | float
"""An exact number: a text such as `1/3`, and a float is what it is printed as."""
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


def exact(value: Number, place: Location | None = None) -> Fraction:
    """InputError unless it is a number."""
    if isinstance(value, bool) or not isinstance(value, str | Decimal | Real):
        raise InputError(f"found {shorten(repr(value))}, expected {EXPECTED_NUMBER}", place)
    if isinstance(value, Rational):
        return Fraction(int(value.numerator), int(value.denominator))
    return parse_number(str(value).lower(), place)


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


def one_line(text: str) -> str:
    """A text in one line, whatever names and input texts it contains."""
    return "".join(character if character.isprintable() else " " for character in text)


def shorten(text: str) -> str:
    """Input text quoted for a one-line message: escaped, and cut when long."""
    return repr(text if len(text) <= 40 else f"{text[:37]}...")


def quoted(path: str | os.PathLike[str]) -> str:
    """The name of a file quoted for a one-line message: whole, unless no system has such names."""
    text = str(path)
    return repr(text) if len(text) <= LONGEST_PATH else shorten(text)


def _too_large(text: str, location: Location | None) -> InputError:
    return InputError(f"found {shorten(text)}, expected a number of at most 300 digits", location)


def parse_end(text: str) -> Fraction | None:
    """The end of an interval: a number, or None for an infinite one."""
    return None if text in {"inf", "+inf", "-inf"} else parse_number(text)


# -- as people read them -----------------------------------------------------------------------------------------------

_LONGEST_EXACT = 9
_DIGITS = 6


def readable(value: Fraction) -> str:
    """The exact decimal or fraction where that is short, otherwise an approximation marked by `≈`."""
    exact = format_number(value)
    if len(exact) <= _LONGEST_EXACT:
        return exact.replace("-", "−")
    return "≈" + f"{approximate(value):.{_DIGITS}g}".replace("-", "−")


def readable_values(text: str) -> str:
    """A text in which exact values, after `=`, `since` or `until`, are shown as :func:`readable` shows them."""
    return _VALUE.sub(lambda match: readable(Fraction(match[0])), text)


_VALUE = re.compile(r"(?:(?<= = )|(?<= since )|(?<= until ))-?[0-9]+(?:\.[0-9]+|/0*[1-9][0-9]*)(?= |$)")
_MANTISSAS = 900
"""Numbers of three digits."""


def decimal_index(value: Fraction) -> int:
    """The number of the greatest decimal with three significant digits that is not above a value > 0.

    Such decimals have numbers in their order, see :func:`decimal_at`.
    """
    exponent = len(str(value.numerator)) - len(str(value.denominator)) - 3
    while value / Fraction(10) ** exponent >= 1000:
        exponent += 1
    return exponent * _MANTISSAS + int(value / Fraction(10) ** exponent) - 100


def decimal_at(index: int) -> Fraction:
    """The decimal with three significant digits that has this number: `decimal_at(decimal_index(3)) = 3`."""
    exponent, mantissa = divmod(index, _MANTISSAS)
    return (mantissa + 100) * Fraction(10) ** exponent


def round_up(value: Fraction) -> Fraction:
    """The least decimal with three significant digits that is not below a value ≥ 0."""
    if value == 0:
        return value
    index = decimal_index(value)
    below = decimal_at(index)
    return below if below == value else decimal_at(index + 1)


def end(value: Fraction | None, *, upper: bool, closed: bool = True) -> str:
    """An end of an interval; infinite ends are ±∞, open finite ends are marked by `<`: all values up to there."""
    if value is None:
        return "∞" if upper else "−∞"
    return readable(value) if closed else f"{'<' if upper else '>'} {readable(value)}"


def exact_end(value: Fraction | None, *, upper: bool) -> str:
    """An end of an interval in JSON: a rational, `inf` or `-inf`."""
    if value is None:
        return "inf" if upper else "-inf"
    return str(value)


def approximate(value: Fraction) -> float:
    """The nearest float; numbers beyond floats become infinite."""
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def duration(seconds: float) -> str:
    """Seconds of computing time."""
    if seconds < 60:
        return f"{seconds:.2f} s"
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def plural(count: int, noun: str) -> str:
    if count == 1:
        return f"1 {noun}"
    return f"{count} {noun[:-1]}ies" if noun.endswith(("ty", "cy")) else f"{count} {noun}s"
