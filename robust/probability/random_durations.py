"""Random durations: their laws on a lattice, with every rounding outwards, and random draws of them."""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from math import ceil, floor

import numpy as np

from robust.probability import lattice, measure
from robust.probability.convolution import Array
from robust.probability.distributions import UNIT, Below, Distribution, Enclosure, exp_minus, normal
from robust.qe.box import Interval

FAR = Fraction(13, 2)
"""Deviations beyond which a duration is charged to the lower bound, and not looked at."""
_SPACING = 64
_END = 9
_LAST = 40


@cache
def _normal_table() -> tuple[Array, Array]:
    """Φ and φ at multiples of 1/64, to the last digit of floats."""
    places = [Fraction(number, _SPACING) for number in range(_END * _SPACING + 1)]
    values = np.array([normal(place)[0] / UNIT for place in places])
    densities = np.array([exp_minus(place * place / 2)[0] / UNIT for place in places])
    return values, densities / np.sqrt(2 * np.pi)


def normal_cdf(place: Array) -> Array:
    """Φ, but for less than 2⁻⁴⁸.

    From the nearest multiple of 1/64, at most 1/128 away, by Taylor's polynomial: the next term is at most
    (1/128)⁶ / 720 · max |φ⁽⁵⁾| < 2⁻⁵⁰, since |φ⁽⁵⁾| < 2.4. Beyond 9 deviations there is less than 2⁻⁶⁰.
    """
    values, densities = _normal_table()
    size = np.minimum(np.abs(place), _END - 1e-9)
    number = np.rint(size * _SPACING).astype(np.int64)
    at = number / _SPACING
    d, square = size - at, at * at
    series = 1 + d * (
        -at / 2 + d * ((square - 1) / 6 + d * ((3 - square) * at / 24 + d * (square * (square - 6) + 3) / 120))
    )
    value = values[number] + densities[number] * d * series
    return np.asarray(np.where(place < 0, 1 - value, value))


@cache
def _exponential_table() -> Array:
    """exp(−x) at multiples of 1/64, to the last digit of floats."""
    return np.array([exp_minus(Fraction(number, _SPACING))[0] / UNIT for number in range(_LAST * _SPACING + 1)])


def decay(place: Array) -> Array:
    """exp(−x) for x ≥ 0, but for less than 2⁻⁴⁸.

    From the nearest multiple of 1/64, at most 1/128 away, by Taylor's polynomial: what follows is at most
    (1/128)⁶ / 720 · exp(1/128) < 2⁻⁵¹. Beyond 40 there is less than 2⁻⁵⁷.
    """
    size = np.minimum(place, _LAST)
    number = np.rint(size * _SPACING).astype(np.int64)
    d = number / _SPACING - size
    return np.asarray(_exponential_table()[number] * (1 + d * (1 + d * (1 / 2 + d * (1 / 6 + d * (1 / 24 + d / 120))))))


def cumulative(distribution: Distribution, values: Array) -> tuple[Array, float]:
    """P(X ≤ x) of the part with a density, and by how much that may be wrong.

    z = (x − m) / s is rounded by at most 2⁻⁵⁰ (|x| + |m|) / s, and no function here is steeper than 2 in z. The error
    of exp and Φ is less than 2⁻⁴⁵.
    """
    numbers, scale = distribution.numbers, float(distribution.scale)
    lower, upper = (None if end is None else float(end) for end in distribution.support)
    middle = float(next((numbers[key] for key in ("mean", "origin", "lower") if key in numbers), 0))
    error = 2.0**-48 * (float(np.max(np.abs(values))) + abs(middle) + abs(lower or 0.0)) / scale + 2.0**-40
    match distribution.kind:
        case "constant" | "empirical":
            return np.zeros_like(values), 0.0
        case "uniform":
            law = (values - middle) / scale
        case "triangular":
            mode, low, high = (float(numbers[key]) for key in ("mode", "lower", "upper"))
            rising = (values - low) ** 2 / (scale * (mode - low)) if mode > low else np.zeros_like(values)
            falling = 1 - (high - values) ** 2 / (scale * (high - mode)) if high > mode else np.ones_like(values)
            steepest = scale / min(side for side in (mode - low, high - mode) if side > 0)
            law, error = np.where(values <= mode, rising, falling), error * max(1.0, steepest)
        case "exponential":
            law = 1 - decay(np.maximum(values - float(lower or 0), 0) / scale)
        case "half-normal":
            law = 2 * normal_cdf((values - middle) / scale) - 1
        case "truncated-normal":
            first, last = (part[0] / UNIT for part in distribution.truncation)
            law = (normal_cdf((values - middle) / scale) - first) / (last - first)
            error /= last - first
        case _:
            law = normal_cdf((values - middle) / scale)
            if lower is not None and distribution.below is Below.FOLD:
                law -= normal_cdf((2 * lower - values - middle) / scale)
            elif lower is not None:
                law -= normal_cdf(np.array((lower - middle) / scale))
    law = np.clip(law, 0, 1)
    if lower is not None:
        law = np.where(values < lower, 0.0, law)
    if upper is not None:
        law = np.where(values >= upper, 1.0, law)
    return law, error


@dataclass(frozen=True)
class RandomDuration:
    """A duration that has to be in an interval; all about it is said under that condition.

    `least` and `most` are ends of a range outside of which it is with probability `tail` at most.
    """

    name: str
    distribution: Distribution
    interval: Interval

    @cached_property
    def mass(self) -> Enclosure:
        """The probability to be in the interval."""
        return measure.interval_probability(self.interval, self.distribution)

    @cached_property
    def range(self) -> Interval:
        """Where it is, but for a little."""
        known, ends = self.distribution, []
        reach = FAR * known.scale * (3 if known.kind == "exponential" else 1)
        for own, end, sign in zip(known.support, (self.interval.lower, self.interval.upper), (-1, 1), strict=True):
            inner = max if sign < 0 else min
            ends.append(inner([value for value in (own, end, known.centre + sign * reach) if value is not None]))
        return Interval(ends[0], ends[1])

    @cached_property
    def tail(self) -> float:
        """The probability to be outside of the range."""
        inside = measure.interval_probability(self.range, self.distribution)[0]
        return max(0.0, float(Fraction(self.mass[1] - inside, max(1, self.mass[0])))) + 2.0**-60

    @property
    def least(self) -> Fraction:
        """The lower end of the range."""
        return self.range.lower or Fraction(0)

    @property
    def most(self) -> Fraction:
        """The upper end of the range."""
        return self.range.upper or Fraction(0)

    def law(self, unit: Fraction, size: int, *, upper: bool) -> tuple[int, Array]:
        """The law on a lattice from a place on, up to where nothing is left; below that place there is nothing.

        Lower laws have what is below the range at its least value, and what is above nowhere; upper laws have all that
        is above at its greatest value, and what is below at the place.
        """
        first = max(0, floor(self.least / unit) - 1)
        last = max(first, min(size - 1, ceil(self.most / unit)))
        # The places are rounded to the safe side: floats are off by 2⁻⁵² of their size at most.
        places = (
            (np.arange(first, last + 1) + upper).astype(np.float64)
            * float(unit)
            * (1 + (1 if upper else -1) * 2.0**-50)
        )
        law, error = cumulative(self.distribution, places)
        mass = np.zeros(len(places))
        for value, (least, most) in self.distribution.atoms:
            at = (floor if upper else ceil)(value / unit) - first
            if value in self.interval and at < len(mass):
                mass[max(0, at)] += (most if upper else least) / UNIT
        ends = [
            None if end is None else cumulative(self.distribution, np.array([float(end)]))
            for end in (self.interval.lower, self.interval.upper)
        ]
        before = 0.0 if ends[0] is None else float(ends[0][0][0])
        if ends[1] is not None:
            law = np.minimum(law, float(ends[1][0][0]))
        error += sum(0.0 if end is None else end[1] for end in ends) + 2.0**-40
        whole = (self.mass[0] if upper else self.mass[1]) / UNIT
        step = (error / whole + lattice.STEP) * (1 if upper else -1)
        law = np.clip((np.maximum(law - before, 0) + np.cumsum(mass)) / whole + step, 0, 1)
        if upper and last < size - 1:
            law[-1] = 1.0
        return first, np.maximum.accumulate(law)


def drawn(distribution: Distribution, random: np.random.Generator, count: int) -> Array:
    """Random values; floats."""
    numbers = {key: float(value) for key, value in distribution.numbers.items()}
    low, high = distribution.support
    least, greatest = (-np.inf if low is None else float(low)), (np.inf if high is None else float(high))
    match distribution.kind:
        case "constant":
            values = np.full(count, numbers["value"])
        case "empirical":
            known, shares = (np.array(list(map(float, column))) for column in zip(*distribution.shares, strict=True))
            values = random.choice(known, count, p=shares / shares.sum())
        case "uniform":
            values = random.uniform(numbers["lower"], numbers["upper"], count)
        case "triangular":
            values = random.triangular(numbers["lower"], numbers["mode"], numbers["upper"], count)
        case "exponential":
            values = least + random.exponential(float(distribution.scale), count)
        case "half-normal":
            values = numbers["origin"] + np.abs(random.normal(0, numbers["deviation"], count))
        case kind:
            values = random.normal(numbers["mean"], numbers["deviation"], count)
            while kind == "truncated-normal" and (outside := (values < least) | (values > greatest)).any():
                values[outside] = random.normal(numbers["mean"], numbers["deviation"], int(outside.sum()))
            if kind == "normal" and low is not None and distribution.below is Below.FOLD:
                values = np.where(values < least, 2 * least - values, values)
            values = np.maximum(values, least)
    return values
