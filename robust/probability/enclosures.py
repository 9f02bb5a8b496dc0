"""Enclosures of exp and of the normal distribution: two integers between which the true value lies, in units of 2⁻²⁵⁶.

Everything is integer arithmetic rounded outwards, with the remainders of the series bounded as is said beside them.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from math import isqrt
from typing import Final

Enclosure = tuple[int, int]
"""The true value is at least the first and at most the second, in units."""

BITS: Final = 256
UNIT: Final = 1 << BITS
"""One, in units of the last place."""
ZERO: Final[Enclosure] = (0, 0)
ONE: Final[Enclosure] = (UNIT, UNIT)

_PI: Final = 3_14159265358979323846264338327950288419716939937510, 10**50
"""π, cut off: it is less than one unit of the last digit greater."""
_FAR: Final = 13
"""Deviations beyond which the normal distribution is taken for 0 or 1, up to `_NEAR`: Φ(−13) < φ(13) / 13 < 2⁻¹²⁶."""
_NEAR: Final = UNIT >> 126


def ratio_down(numerator: int, denominator: int) -> int:
    """A quotient in units, rounded down."""
    return (numerator << BITS) // denominator


def ratio_up(numerator: int, denominator: int) -> int:
    """A quotient in units, rounded up."""
    return -((-numerator << BITS) // denominator)


def of(value: Fraction) -> Enclosure:
    """A rational number."""
    return ratio_down(value.numerator, value.denominator), ratio_up(value.numerator, value.denominator)


def product(left: Enclosure, right: Enclosure) -> Enclosure:
    """Of two numbers that are not negative."""
    return left[0] * right[0] >> BITS, -(-left[1] * right[1] >> BITS)


def quotient(left: Enclosure, right: Enclosure) -> Enclosure:
    """Of two numbers that are not negative, the second above 0."""
    return ratio_down(left[0], right[1]), ratio_up(left[1], right[0])


def difference(left: Enclosure, right: Enclosure) -> Enclosure:
    """Of two numbers, the second not greater than the first."""
    return max(0, left[0] - right[1]), max(0, left[1] - right[0])


@lru_cache(maxsize=1 << 14)
def exp_minus(value: Fraction) -> Enclosure:
    """e^−x of a number that is not negative.

    With y = x / 2^k ≤ 1/2 the terms y^n / n! of the series alternate and fall, so that each partial sum is farther from
    e^−y than the next term; e^−x is then squared k times. Beyond 128 it is below one unit.
    """
    if value > BITS:
        return 0, 1
    halvings = max(0, (2 * value.numerator // value.denominator).bit_length())
    least, most = ratio_down(value.numerator, value.denominator << halvings), 0
    most = least + 1
    total = [UNIT, UNIT]
    low, high, count = UNIT, UNIT, 0
    while high > 1:
        count += 1
        low, high = (low * least >> BITS) // count, -((-high * most >> BITS) // count)
        total[0] += -high if count % 2 else low
        total[1] += -low if count % 2 else high
    found: Enclosure = max(0, total[0] - high), min(UNIT, total[1] + high)
    for _ in range(halvings):
        found = product(found, found)
    return found


@lru_cache(maxsize=1)
def _root_of_two_pi() -> Enclosure:
    digits, scale = _PI
    least, most = ratio_down(2 * digits, scale), ratio_up(2 * (digits + 1), scale)
    return isqrt(least << BITS), isqrt(most << BITS) + 1


@lru_cache(maxsize=1 << 14)
def normal(place: Fraction) -> Enclosure:
    """Φ(z), the probability that a standard normal variable is at most z.

    Φ(z) − 1/2 = φ(z) Σ z^(2n+1) / (1 · 3 · … · (2n+1)) for z ≥ 0. All terms are positive, and from where z² / (2n+3) is
    at most 1/2 on, what follows a term is at most the term itself.
    """
    if place < 0:
        least, most = normal(-place)
        return UNIT - most, UNIT - least
    if place > _FAR:
        return UNIT - _NEAR, UNIT
    density = quotient(exp_minus(place * place / 2), _root_of_two_pi())
    square = of(place * place)
    term = of(place)
    total, count = term, 1
    while term[1] > 1 or 2 * square[1] > count * UNIT:
        count += 2
        low, high = product(term, square)
        term = low // count, -(-high // count)
        total = total[0] + term[0], total[1] + term[1]
    low, high = product(density, (total[0], total[1] + term[1]))
    return min(UNIT, UNIT // 2 + low), min(UNIT, UNIT // 2 + high)
