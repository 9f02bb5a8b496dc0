"""Probabilities as text: decimals rounded outwards, so that what is printed is as certain as what was found."""

from __future__ import annotations

from fractions import Fraction
from math import floor
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta

from robust.codec import JsonObject

if TYPE_CHECKING:
    from robust.irr.search import EnvelopeResult
    from robust.probability.measure import Bounds

DIGITS = 9
"""Decimals of probabilities in JSON, rounded outwards."""


def decimal(value: Fraction, places: int, *, up: bool) -> str:
    """A probability as a decimal, rounded up or down."""
    scaled = value * 10**places
    whole = -floor(-scaled) if up else floor(scaled)
    return f"{whole // 10**places}.{whole % 10**places:0{places}d}"


def places_for(within: Fraction) -> int:
    """Decimals for people: one more than is asked for."""
    places = 4
    while Fraction(1, 10 ** (places - 1)) > within and places < DIGITS:
        places += 1
    return places


def bounds_text(bounds: Bounds, places: int) -> str:
    """`0.8588 to 0.8590`, rounded outwards; `0.5275` where both are the same."""
    lower, upper = decimal(bounds.lower, places, up=False), decimal(bounds.upper, places, up=True)
    if bounds.width < Fraction(1, 10**DIGITS):
        return f"{float(bounds.lower):.{places}f}"
    return lower if lower == upper else f"{lower} to {upper}"


def greatest_text(result: EnvelopeResult, probability: Bounds) -> str:
    """How probable a box is, and how much more probable another may be."""
    own = f"probability of the box: {bounds_text(probability, 4)}"
    if result.bound is None:
        return f"{own}; {'' if result.cut_short else 'a local optimum: '}how probable others may be is not known"
    return f"{own}; no box has more than {decimal(min(Fraction(1), result.bound), 4, up=True)}"


Probability = Annotated[str, Meta(pattern=r"^[01]\.[0-9]+$", description="a decimal")]


class Range(JsonObject):
    """bounds, rounded outwards: the probability is certainly between them"""

    lower: Probability
    upper: Probability


def range_of(bounds: Bounds) -> Range:
    """Bounds as decimals."""
    return Range(lower=decimal(bounds.lower, DIGITS, up=False), upper=decimal(bounds.upper, DIGITS, up=True))
