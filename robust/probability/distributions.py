"""What a random quantity may be: how it is written, drawn from, and how probable its values are, exactly enclosed.

A distribution is a part that has a density, and values that have a probability of their own (`atoms`): a constant and
an empirical distribution are nothing else, and a normal distribution that is clipped to its minimum has one there. On
the command line it is `normal:30:5`, the numbers of :data:`KEYS` in their order; an empty or missing one is left out,
where it may be. An empirical one is `empirical:12,13.5,20:3,1,1`, values and how often each of them occurs.

A probability is enclosed by two integers, in units of 2⁻²⁵⁶. Everything is integer arithmetic rounded outwards, with
the remainders of the series for exp and the normal distribution bounded where they are computed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from functools import cached_property, lru_cache, reduce
from math import isqrt, lcm
from random import Random
from statistics import NormalDist
from typing import Final

from robust.errors import InputError, Location, closest
from robust.numbers import format_number, parse_number, shorten

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
    """The product of two numbers that are not negative."""
    return left[0] * right[0] >> BITS, -(-left[1] * right[1] >> BITS)


def product_of(factors: Iterable[Enclosure]) -> Enclosure:
    """The product of numbers that are not negative: how probable it is that independent events all happen."""
    return reduce(product, factors, ONE)


def quotient(left: Enclosure, right: Enclosure) -> Enclosure:
    """The quotient of two numbers that are not negative, the second above 0."""
    return ratio_down(left[0], right[1]), ratio_up(left[1], right[0])


def difference(left: Enclosure, right: Enclosure) -> Enclosure:
    """The difference of two numbers, the second not greater than the first."""
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
    power: Enclosure = max(0, total[0] - high), min(UNIT, total[1] + high)
    for _ in range(halvings):
        power = product(power, power)
    return power


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


KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "constant": ("value",),
    "uniform": ("lower", "upper"),
    "normal": ("mean", "deviation", "minimum", "below"),
    "half-normal": ("origin", "deviation"),
    "truncated-normal": ("mean", "deviation", "minimum", "maximum"),
    "triangular": ("lower", "mode", "upper"),
    "exponential": ("mean", "minimum"),
    "empirical": ("values", "weights"),
}
"""The distributions with the numbers that each takes."""
PLANNED: Final = frozenset({"value", "mean", "origin", "mode"})
"""Keys that mean the planned value if they are left out."""
OPTIONAL: Final = PLANNED | {"minimum", "maximum", "below", "weights"}
"""Keys that may be left out."""
LISTS: Final = frozenset({"values", "weights"})
"""Keys of lists of numbers."""
DISCRETE: Final = frozenset({"constant", "empirical"})
"""Distributions without a density."""
GRID = 1000
"""How many values there are from one integer to the next in simulated worlds."""
LEAST_SHARE = 10**9
"""A normal distribution that keeps less than one over that when it is truncated is taken for a mistake."""


class Below(Enum):
    """What becomes of draws below the minimum: folded up, to as far above it as they were below, or clipped to it."""

    FOLD = "fold"
    CLIP = "clip"


def on_grid(value: float, grid: int | None = GRID) -> Fraction:
    """The nearest multiple of 1/1000, or the exact value of the float without a grid."""
    return Fraction(value) if grid is None else Fraction(round(value * grid), grid)


Weights = tuple[int, int, Fraction]
"""Of a density over an interval: in proportion to a linear function with these values at the ends, up to a factor
between two numbers whose ratio is the third."""
_FINE: Final = 1 << 40


Shares = tuple[tuple[Fraction, Fraction], ...]
"""Different values in ascending order, and how probable each is."""


def shares_of(values: Sequence[Fraction], weights: Sequence[Fraction] | None, place: Location) -> Shares:
    """Values that were observed, with how often each was, or once each; they may occur in any order and repeatedly.

    Raises:
        InputError: no value, a weight that is not positive, or another number of weights than of values.
    """
    if not values:
        raise InputError("found no value of an empirical distribution, expected at least one", place)
    if weights is not None and len(weights) != len(values):
        raise InputError(f"found {len(weights)} weights, expected {len(values)}, one for each value", place)
    total: dict[Fraction, Fraction] = defaultdict(Fraction)
    for value, weight in zip(values, weights or [Fraction(1)] * len(values), strict=True):
        if weight <= 0:
            raise InputError(f"found weight {weight}, expected a number above 0", place)
        total[value] += weight
    whole = sum(total.values())
    return tuple((value, total[value] / whole) for value in sorted(total))


@dataclass(frozen=True)
class Distribution:
    """One of :data:`KEYS` with its numbers, in the unit of what is random; an empirical one has `shares` instead."""

    kind: str
    numbers: Mapping[str, Fraction] = field(hash=False)
    below: Below = Below.FOLD
    shares: Shares = ()

    # -- drawing -------------------------------------------------------------------------------------------------------

    def draw(self, random: Random, grid: int | None = GRID) -> Fraction:
        """One value, a multiple of 1/1000; or as exactly as floats are, without a grid.

        A normal distribution may have a minimum [IRR §5, "described by a normal distribution with a minimum value"]; a
        half-normal one is its origin plus the absolute value of a normal variable with mean 0; an exponential one is
        never below its minimum, and `mean` is its mean.
        """
        numbers = self.numbers
        match self.kind:
            case "constant":
                drawn = numbers["value"]
            case "uniform":
                drawn = on_grid(random.uniform(float(numbers["lower"]), float(numbers["upper"])), grid)
            case "half-normal":
                drawn = numbers["origin"] + abs(on_grid(random.gauss(0.0, float(numbers["deviation"])), grid))
            case "triangular":
                ends = float(numbers["lower"]), float(numbers["upper"])
                drawn = on_grid(random.triangular(*ends, float(numbers["mode"])), grid)
            case "exponential":
                drawn = self._start + on_grid(random.expovariate(1 / float(self.scale)), grid)
            case "truncated-normal":
                drawn = on_grid(self._truncated(random), grid)
            case "empirical":
                values, weights = zip(*self.shares, strict=True)
                (drawn,) = random.choices(values, [float(weight) for weight in weights])
            case _:
                return self._reflected(on_grid(random.gauss(float(numbers["mean"]), float(numbers["deviation"])), grid))
        return self._within(drawn)

    def _reflected(self, drawn: Fraction) -> Fraction:
        """A draw of a normal variable that has a minimum, or none."""
        minimum = self.numbers.get("minimum", drawn)
        if drawn >= minimum:
            return drawn
        return minimum if self.below is Below.CLIP else 2 * minimum - drawn

    def _within(self, value: Fraction) -> Fraction:
        lower, upper = self.support
        above = value if lower is None else max(value, lower)
        return above if upper is None else min(above, upper)

    def _truncated(self, random: Random) -> float:
        plain = NormalDist(float(self.numbers["mean"]), float(self.scale))
        ends = self.support
        low, high = (rest if end is None else plain.cdf(float(end)) for end, rest in zip(ends, (0, 1), strict=True))
        return plain.inv_cdf(min(max(low + (high - low) * random.random(), 1e-300), 1 - 1e-16))

    # -- probabilities -------------------------------------------------------------------------------------------------

    @cached_property
    def settled(self) -> Distribution:
        """The distribution; a constant, if there is nothing random about it."""
        numbers, value = self.numbers, None
        if self.kind in {"uniform", "triangular"} and numbers["lower"] == numbers["upper"]:
            value = numbers["lower"]
        elif numbers.get("deviation") == 0:
            value = numbers["origin"] if self.kind == "half-normal" else self._within(self._reflected(numbers["mean"]))
        elif self.kind == "exponential" and numbers["mean"] == self._start:
            value = numbers["mean"]
        elif len(self.shares) == 1:
            value = self.shares[0][0]
        return self if value is None else Distribution("constant", {"value": value})

    @cached_property
    def scale(self) -> Fraction:
        """How wide it is, roughly: a deviation, or the length of its support."""
        match self.kind:
            case "constant":
                return Fraction(1)
            case "uniform" | "triangular":
                return self.numbers["upper"] - self.numbers["lower"]
            case "exponential":
                return self.numbers["mean"] - self._start
            case "empirical":
                return self.shares[-1][0] - self.shares[0][0]
        return self.numbers["deviation"]

    def moved(self, factor: Fraction, shift: Fraction) -> Distribution:
        """The distribution of `factor` times a value plus `shift`; the factor is above 0."""
        numbers = {key: value * factor + (0 if key == "deviation" else shift) for key, value in self.numbers.items()}
        if self.kind == "exponential":
            numbers["minimum"] = self._start * factor + shift
        shares = tuple((value * factor + shift, share) for value, share in self.shares)
        return Distribution(self.kind, numbers, self.below, shares)

    def irregular(self, steepness: Fraction) -> Enclosure | None:
        """How probable a value is, at most, at which x ↦ p(x^q) x^(q − 1) is not log-concave for the density p.

        Here q = 1 + steepness, and values are positive unless that is 1. The function is log-concave for most kinds;
        with a normal density where x (2q − 1) ≥ mean · (q − 1), as its logarithm has the second derivative
        −q x^((q − 2)/q) (x q + (x − mean)(q − 1)) / deviation² or less. What was folded or clipped counts as well. None
        for values that have a probability of their own.
        """
        if self.kind == "constant":
            return ZERO
        lower = self.support[0]
        if self.kind not in {"normal", "truncated-normal"}:
            return None if self.kind == "empirical" or (steepness and (lower is None or lower < 0)) else ZERO
        ends = [] if lower is None else [lower]
        if steepness:
            ends.append(max(Fraction(0), self.numbers["mean"] * steepness / (1 + 2 * steepness)))
        if not ends or (max(ends) == lower and self.kind == "truncated-normal"):
            return ZERO
        return self._normal(max(ends)) if self.kind == "normal" else self.between(None, max(ends))

    @property
    def exact_values(self) -> Iterable[Fraction]:
        """The numbers of which it is made, except for probabilities."""
        return (*self.numbers.values(), *(value for value, _ in self.shares))

    @property
    def _start(self) -> Fraction:
        return self.numbers.get("minimum", Fraction(0))

    @cached_property
    def centre(self) -> Fraction:
        """A value in the middle, from which searches begin."""
        match self.kind:
            case "uniform":
                return (self.numbers["lower"] + self.numbers["upper"]) / 2
            case "half-normal":
                return self.numbers["origin"] + self.scale * Fraction(2, 3)
            case "exponential":
                return self._start + self.scale * Fraction(2, 3)
            case "empirical":
                return self.shares[len(self.shares) // 2][0]
        return self._within(next(self.numbers[key] for key in ("value", "mode", "mean") if key in self.numbers))

    @cached_property
    def support(self) -> tuple[Fraction | None, Fraction | None]:
        """Between which values it is; None without an end."""
        numbers = self.numbers
        match self.kind:
            case "constant":
                return numbers["value"], numbers["value"]
            case "uniform" | "triangular":
                return numbers["lower"], numbers["upper"]
            case "half-normal":
                return numbers["origin"], None
            case "exponential":
                return self._start, None
            case "empirical":
                return self.shares[0][0], self.shares[-1][0]
        return numbers.get("minimum"), numbers.get("maximum")

    @cached_property
    def breaks(self) -> tuple[Fraction, ...]:
        """Values inside the support where the density is no smooth function."""
        if self.kind != "triangular":
            return ()
        return tuple(mode for mode in (self.numbers["mode"],) if mode not in self.support)

    @cached_property
    def atoms(self) -> tuple[tuple[Fraction, Enclosure], ...]:
        """Values that have a probability of their own."""
        if self.kind == "constant":
            return ((self.numbers["value"], ONE),)
        if self.kind == "normal" and self.below is Below.CLIP and "minimum" in self.numbers:
            return ((self.numbers["minimum"], self._normal(self.numbers["minimum"])),)
        return tuple((value, of(share)) for value, share in self.shares)

    def between(self, lower: Fraction | None, upper: Fraction | None) -> Enclosure:
        """The probability of the part with a density between two values; None is infinitely far."""
        if self.kind in DISCRETE:
            return ZERO
        least = self.support[0] if lower is None else lower
        return difference(ONE if upper is None else self._up_to(upper), ZERO if least is None else self._up_to(least))

    def interval(self, quantile: Fraction) -> tuple[Fraction, Fraction | None]:
        """An interval below which a value is with probability `quantile` at most, and above which as well.

        Its ends are multiples of a millionth of the scale's power of ten; None is no upper end, for a quantile of 0.
        """
        low, high = self.support
        grid = Fraction(10) ** (len(str(int(self.scale))) - 7)
        most = int(quantile * UNIT)

        def last(sign: int, end: Fraction | None) -> Fraction | None:
            """The multiple of the grid nearest to the centre beyond which there is little enough."""

            def beyond(steps: int) -> bool:
                place = self.centre + sign * steps * grid
                dense = self.between(None, place) if sign < 0 else self.between(place, None)
                return dense[1] + sum(share[1] for value, share in self.atoms if sign * (value - place) > 0) <= most

            if quantile <= 0 and end is None:
                return None
            reach = int(abs(end - self.centre) / grid) + 1 if end is not None else 1
            while end is None and not beyond(reach):
                reach *= 2
            least = 0
            while reach - least > 1:
                middle = (least + reach) // 2
                least, reach = (least, middle) if beyond(middle) else (middle, reach)
            found = self.centre + sign * reach * grid
            return found if end is None else max(found, end) if sign < 0 else min(found, end)

        return last(-1, low) or Fraction(0), last(1, high)

    def _normal(self, value: Fraction) -> Enclosure:
        return normal((value - self.numbers.get("mean", self.numbers.get("origin", value))) / self.scale)

    def _up_to(self, value: Fraction) -> Enclosure:
        """The probability of at most a value, if it is not below the support."""
        lower, upper = self.support
        if upper is not None and value >= upper:
            return ONE
        if lower is not None and value <= lower:
            # Of a clipped distribution, what is below the minimum lies on it.
            return self._normal(lower) if self.atoms and self.kind == "normal" else ZERO
        match self.kind:
            case "uniform":
                share = of((value - self.numbers["lower"]) / self.scale)
            case "triangular":
                share = of(self._triangle(value))
            case "exponential":
                share = difference(ONE, exp_minus((value - self._start) / self.scale))
            case "half-normal":
                low, high = self._normal(value)
                share = max(0, 2 * low - UNIT), min(UNIT, 2 * high - UNIT)
            case "truncated-normal":
                first, last = self.truncation
                low, high = quotient(difference(self._normal(value), first), difference(last, first))
                share = low, min(UNIT, high)
            case _:
                share = self._normal(value)
                if lower is not None and self.below is Below.FOLD:
                    share = difference(share, self._normal(2 * lower - value))
        return share

    @cached_property
    def truncation(self) -> tuple[Enclosure, Enclosure]:
        """The probabilities of less than the minimum and of at most the maximum, if there were neither."""
        lower, upper = self.support
        return (ZERO if lower is None else self._normal(lower)), (ONE if upper is None else self._normal(upper))

    def _triangle(self, value: Fraction) -> Fraction:
        lower, mode, upper = (self.numbers[key] for key in ("lower", "mode", "upper"))
        if value <= mode:
            return (value - lower) ** 2 / ((upper - lower) * (mode - lower))
        return 1 - (upper - value) ** 2 / ((upper - lower) * (upper - mode))

    # -- densities -----------------------------------------------------------------------------------------------------

    def weights(self, lower: Fraction, upper: Fraction) -> Weights | None:
        """The density between two values of the support, without a break in between; None where it varies too much.

        A function with second derivative at most M differs from its interpolation over a length h by at most M h² / 8.
        For φ it is (z² − 1) φ, for e^−x it is e^−x.
        """
        match self.kind:
            case "uniform":
                return 1, 1, Fraction(1)
            case "triangular":
                return self._linear(lower, upper)
            case "exponential":
                ends = ((lower - self._start) / self.scale, (upper - self._start) / self.scale)
                return _interpolated(ends[1] - ends[0], [(ends[0], ends[1], ends[0], Fraction(1))])
        centres = [self.numbers.get("mean", self.numbers.get("origin", Fraction(0)))]
        minimum = self.numbers.get("minimum")
        if self.kind == "normal" and minimum is not None and self.below is Below.FOLD:
            centres.append(2 * minimum - centres[0])
        length = (upper - lower) / self.scale
        return _interpolated(length, [self._bell(lower, upper, centre) for centre in centres])

    def _linear(self, lower: Fraction, upper: Fraction) -> Weights:
        ends = self.numbers["lower"], self.numbers["upper"]
        rising = upper <= self.numbers["mode"]
        first, last = (lower - ends[0], upper - ends[0]) if rising else (ends[1] - lower, ends[1] - upper)
        scale = lcm(first.denominator, last.denominator)
        return int(first * scale), int(last * scale), Fraction(1)

    def _bell(self, lower: Fraction, upper: Fraction, centre: Fraction) -> Component:
        first, last = ((end - centre) / self.scale for end in (lower, upper))
        squares = first * first, last * last
        nearest = Fraction(0) if first <= 0 <= last else min(squares)
        bend = max(abs(max(squares) - 1), abs(nearest - 1))
        return squares[0] / 2, squares[1] / 2, nearest / 2, bend

    # -- as text, and for pictures -------------------------------------------------------------------------------------

    def density(self, value: Fraction) -> float:
        """How dense it is around a value: for pictures, never for a verdict."""
        step = self.scale / 1000
        return float(Fraction(self.between(value - step, value + step)[0], UNIT) / (2 * step))

    def __str__(self) -> str:
        parts = [self.kind]
        if self.shares:
            scale = lcm(*(share.denominator for _, share in self.shares))
            columns = zip(*((value, share * scale) for value, share in self.shares), strict=True)
            values, weights = (",".join(map(format_number, column)) for column in columns)
            return ":".join((self.kind, values) if len(set(weights.split(","))) == 1 else (self.kind, values, weights))
        for key in KEYS[self.kind]:
            if key in self.numbers:
                parts.append(format_number(self.numbers[key]))
            elif key == "below" and self.below is Below.CLIP:
                parts.append(self.below.value)
            elif key != "below":
                parts.append("")
        return ":".join(parts).rstrip(":")


Component = tuple[Fraction, Fraction, Fraction, Fraction]
"""Of a summand e^−x of a density: x at both ends and the least, and the greatest second derivative over its value."""
_STEEP: Final = 30


def _interpolated(length: Fraction, components: Iterable[Component]) -> Weights | None:
    """Weights for a sum of such functions over a length."""
    summands = list(components)
    base = min(min(first, last) for first, last, _, _ in summands)
    if max(base - least for _, _, least, _ in summands) > _STEEP:
        return None
    ends, error = [0, 0], Fraction(0)
    for first, last, least, bend in summands:
        for place, value in enumerate((first, last)):
            ends[place] += _weight(value - base)
        above, below = max(least - base, Fraction(0)), max(base - least, Fraction(0))
        highest = Fraction(exp_minus(above)[1], exp_minus(below)[0])
        error += min(length * length / 8 * bend, Fraction(1)) * highest
    # Each weight is rounded by less than one unit for each component.
    floor = Fraction(min(ends) - len(summands), _FINE)
    error += Fraction(2 * len(summands), _FINE)
    if floor <= 2 * error:
        return None
    return ends[0], ends[1], _rounded_up((floor + error) / (floor - error))


@lru_cache(maxsize=1 << 14)
def _weight(exponent: Fraction) -> int:
    return exp_minus(exponent)[0] * _FINE // UNIT


def _rounded_up(value: Fraction) -> Fraction:
    """With a short denominator, which what is computed with it inherits."""
    return Fraction(-(-value.numerator * _FINE // value.denominator), _FINE)


# -- as they are written -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Amount:
    """A number as it is written; a relative one is a share of the planned value, such as `15%`."""

    value: Fraction
    relative: bool = False

    def at(self, planned: Fraction) -> Fraction:
        """The number for a quantity with this planned value."""
        return self.value * planned if self.relative else self.value


def parse_amount(text: str, place: Location) -> Amount:
    """`3`, `1/3` or `15%`; InputError for anything else."""
    share, percent, rest = text.strip().partition("%")
    return Amount(parse_number(share, place) / 100, True) if percent and not rest else Amount(parse_number(text, place))


@dataclass(frozen=True, slots=True)
class DistributionForm:
    """A distribution as it is written: the amounts of its keys, one each except for values and weights."""

    kind: str
    amounts: Mapping[str, tuple[Amount, ...]]
    below: Below = Below.FOLD

    def at(self, planned: Fraction | None, place: Location) -> Distribution:
        """The distribution of a quantity with this planned value, which is what is left out of :data:`PLANNED`.

        Raises:
            InputError: the planned value is needed and there is none, or an empirical distribution is wrong.
        """
        if planned is None:
            missing = [key for key in KEYS[self.kind] if key in PLANNED and key not in self.amounts]
            if missing:
                expected = ":".join((self.kind, *map(str.upper, KEYS[self.kind])))
                raise InputError(f"found no {missing[0]!r}, expected {expected}", place)
            if shares := [key for key, amounts in self.amounts.items() if any(amount.relative for amount in amounts)]:
                raise InputError(f"found a share as {shares[0]!r}, but no planned value: expected a number", place)
        unit = planned or Fraction(0)
        known = {key: [amount.at(unit) for amount in amounts] for key, amounts in self.amounts.items()}
        if self.kind == "empirical":
            return Distribution(self.kind, {}, shares=shares_of(known.get("values", ()), known.get("weights"), place))
        numbers = dict.fromkeys(PLANNED.intersection(KEYS[self.kind]), unit) | {key: n for key, (n,) in known.items()}
        for ends in (("lower", "upper"), ("minimum", "maximum")):  # a negative unit turns the ends round
            if unit < 0 and all(end in known and self.amounts[end][0].relative for end in ends):
                numbers |= {ends[0]: numbers[ends[1]], ends[1]: numbers[ends[0]]}
        if unit < 0 and "deviation" in numbers:
            numbers["deviation"] = abs(numbers["deviation"])
        return Distribution(self.kind, numbers, self.below)


def parse_distribution(text: str, planned: Fraction | None, place: Location) -> Distribution:
    """`normal:30:5`, `normal::15%` and the like; InputError says what is wrong.

    Args:
        text: the name and the numbers of :data:`KEYS`, or shares of the planned value.
        planned: stands for numbers that are left out and mean the planned value; None if there is none.
        place: what an error message is about.
    """
    distribution = parse_form(text, place).at(planned, place)
    if distribution.numbers.get("deviation", 1) <= 0:
        raise InputError(f"found deviation {distribution.numbers['deviation']}, expected a number above 0", place)
    require_possible(distribution.kind, distribution.numbers, place)
    return distribution


def parse_form(text: str, place: Location) -> DistributionForm:
    """A distribution of which shares of a planned value are left open; InputError says what is wrong."""
    kind, *given = (part.strip() for part in text.split(":"))
    if kind not in KEYS:
        hint = closest(kind, KEYS)
        raise InputError(f"found distribution {shorten(kind)}, expected one of {', '.join(KEYS)}{hint}", place)
    keys = KEYS[kind]
    expected = ":".join((kind, *map(str.upper, keys)))
    if len(given) > len(keys):
        raise InputError(f"found {len(given)} numbers, expected {expected}", place)
    below = Below.FOLD
    amounts: dict[str, tuple[Amount, ...]] = {}
    for key, part in zip(keys, given, strict=False):
        if key == "below" and part:
            if part not in {"fold", "clip"}:
                raise InputError(f"found {shorten(part)} for 'below', expected fold or clip", place)
            below = Below(part)
        elif part:
            texts = part.split(",") if key in LISTS else [part]
            amounts[key] = tuple(parse_amount(one, place) for one in texts)
    missing = [key for key in keys if key not in amounts and key not in OPTIONAL | LISTS]
    if missing:
        raise InputError(f"found no {missing[0]!r}, expected {expected}", place)
    return DistributionForm(kind, amounts, below)


def require_possible(kind: str, numbers: Mapping[str, Fraction], place: Location) -> None:
    """InputError unless there is such a distribution, as far as its numbers are known."""
    for least, most in (("lower", "upper"), ("lower", "mode"), ("mode", "upper"), ("minimum", "maximum")):
        if least in numbers and most in numbers and numbers[least] > numbers[most]:
            raise InputError(f"found {least} above {most}, expected {least} ≤ {most}", place)
    if numbers.get("deviation", Fraction(0)) < 0:
        raise InputError(f"found deviation {numbers['deviation']}, expected at least 0", place)
    if kind == "exponential" and "mean" in numbers and numbers["mean"] < numbers.get("minimum", 0):
        raise InputError("found mean below minimum, expected minimum ≤ mean; minimum is 0 if left out", place)
    if kind == "truncated-normal" and numbers.get("deviation") and "mean" in numbers:
        distribution = Distribution(kind, numbers)
        first, last = distribution.truncation
        if difference(last, first)[0] < UNIT // LEAST_SHARE:
            raise InputError("found almost nothing between minimum and maximum, expected values near the mean", place)
