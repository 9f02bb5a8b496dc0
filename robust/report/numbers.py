"""Numbers as people read them."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from robust.numbers import format_number

if TYPE_CHECKING:
    from robust.irr.box import Interval

_LONGEST = 9
_DIGITS = 6


def readable(value: Fraction) -> str:
    """The exact decimal or fraction where that is short, otherwise an approximation marked by `≈`."""
    exact = format_number(value)
    if len(exact) <= _LONGEST:
        return exact.replace("-", "−")
    return "≈" + f"{approximate(value):.{_DIGITS}g}".replace("-", "−")


def end(value: Fraction | None, *, upper: bool, closed: bool = True) -> str:
    """An end of an interval; infinite ends are ±∞, open finite ends are marked by `<`: all values up to there."""
    if value is None:
        return "∞" if upper else "−∞"
    return readable(value) if closed else f"{'<' if upper else '>'} {readable(value)}"


def interval_text(interval: Interval) -> str:
    """`[1, 2)`, `(−∞, 3]`."""
    opening = "[" if interval.lower is not None and interval.lower_closed else "("
    closing = "]" if interval.upper is not None and interval.upper_closed else ")"
    return f"{opening}{end(interval.lower, upper=False)}, {end(interval.upper, upper=True)}{closing}"


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
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
