"""Factors that several durations share, such as weather: probabilities by conditioning on their values.

A duration is its own random value times the factors that scale it, plus multiples of those that shift it. Given the
factors, durations are independent again. So the probability of success is the average of a function g of one factor,
itself the average of a function of the next. Each is bounded between points at which it is known, from both sides:

- g falls where more of a factor makes every duration longer, but for durations that are too short;
- g is log-concave. For a factor that shifts: all that success demands is linear in durations and factor together, and
  what is left after integrating a log-concave density over a convex set is log-concave [Prékopa 1973]. For one that
  scales: with f = u^−s and x = y^(1 + s), f·x = y^(1 + s) / u^s is convex in (y, u), so that g is log-concave in u if
  y has a log-concave density: see :meth:`~robust.probability.distributions.Distribution.irregular`, which says how
  improbable values are at which that fails; they are charged to both sides.

Between two points log g is at least linear, and at most what continues the neighbouring chords. So bounds are apart by
the square of the distance between points, and a dozen points are enough where monotony alone takes hundreds.
"""

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from robust.probability.convolution import Array
from robust.probability.distributions import DISCRETE, UNIT, ZERO, Distribution
from robust.probability.random_durations import RandomDuration, cumulative, drawn
from robust.probability.sharing import Given, SharedFactor
from robust.qe.box import Interval

PLACES = 1 << 15
"""Intervals of values of a factor."""
STEEPNESS = Fraction(1, 10)
"""The exponent s of a factor that scales."""
SLACK = 1e-7
"""Covers the rounding of interpolated values: log g is above −30 where it counts, and its places are known to 10⁻¹⁰."""
FLOOR = 1e-12
"""Lower bounds below this count as nothing."""
CHORDS = 6
"""Chords that are continued from each side; the longer ones matter less that values are not known exactly."""
POINTS = 200
"""Most values of one factor at which a probability is computed."""


class Conditional(NamedTuple):
    """Bounds of a probability for one value of a factor: from below with all demands, from above without those that
    durations are long enough; `short` is how probably one of these breaks. With a factor that is not rising all
    demands count, and `short` is 0.
    """

    lower: float
    upper: float
    short: float = 0.0


class FactorAverage:
    """Bounds of the average of a function of a factor, closer with each value at which it is known.

    Args:
        factor: the factor.
        at: bounds for a value of the factor.
        doubt: how probable values are with which the function is not log-concave; None if it never is.
        check: called now and then, to raise what ends the search.
    """

    def __init__(
        self,
        factor: SharedFactor,
        at: Callable[[Fraction], Conditional],
        doubt: float | None,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self._factor, self._at, self._doubt, self._check = factor, at, doubt, check
        whole = RandomDuration(factor.name, factor.distribution.settled, Interval(None, None))
        known = whole.distribution
        atoms = {value: mass for value, mass in known.atoms if whole.least <= value <= whole.most}
        is_dense = known.kind not in DISCRETE
        step = (whole.most - whole.least) / PLACES
        self._value: Callable[[int], Fraction] = lambda place: whole.least + place * step
        self._places: Array = float(whole.least) + np.arange(PLACES + 1, dtype=np.float64) * float(step)
        ends = [atoms.get(whole.least, ZERO)] + [ZERO] * PLACES  # what is clipped lies on the least value
        if not is_dense:
            values = sorted(atoms)
            self._value = values.__getitem__
            self._places = np.array([float(value) for value in values])
            ends = [atoms[value] for value in values]
        law, error = cumulative(known, self._places)
        between = np.diff(law)
        self._between = np.maximum(between - 2 * error, 0), between + 2 * error
        self._on = tuple(np.array([end[side] / UNIT for end in ends]) for side in (0, 1))
        self._rest = max(0.0, 1 - float(self._between[0].sum() + self._on[0].sum())) + 1e-12
        self._coordinates = self._places ** -float(1 / STEEPNESS) if factor.scales else self._places
        self._known: dict[int, Conditional] = {}
        self._is_rising = factor.is_rising
        self.lower, self.upper, self.short = 0.0, 1.0, 0.0

    def run(self, within: float, tell: Callable[[], None] = lambda: None) -> None:
        """Look at values until bounds are close, or values no longer bring them closer."""
        last = len(self._places) - 1
        for first in dict.fromkeys((last // 2, 0, last)):
            self._look(first)
        while True:
            gaps = self._bound()
            tell()
            if self.upper - self.lower <= within or len(self._known) >= POINTS:
                return
            if sum(gap for gap, _ in gaps) < within / 10:
                return
            place = next((p for gap, p in sorted(gaps, reverse=True) if p is not None and gap > within / 1000), None)
            if place is None:
                return
            self._look(place)

    def _look(self, place: int) -> None:
        self._check()
        self._known[place] = self._at(self._value(place))

    def _bound(self) -> list[tuple[float, int | None]]:
        """The bounds by all that is known; how much is open between values, and the place in the middle of each."""
        places = sorted(self._known)
        lower = upper = short = 0.0
        open_: list[tuple[float, int | None]] = []
        for number, place in enumerate(places):
            known = self._known[place]
            lower += float(self._on[0][place]) * known.lower
            upper += float(self._on[1][place]) * known.upper
            short += float(self._on[1][place]) * known.short
            if place == places[-1]:
                break
            after = places[number + 1]
            least, most, small = self._gap(places, number)
            inner = slice(place + 1, after)
            parts = []
            for values, side in ((least, 0), (most, 1)):
                pick = np.minimum if side == 0 else np.maximum
                part = float(self._between[side][place:after] @ pick(values[:-1], values[1:]))
                parts.append(part + float(self._on[side][inner] @ values[1:-1]))
            lower, upper = lower + parts[0], upper + parts[1]
            short += small * float(self._between[1][place:after].sum() + self._on[1][inner].sum())
            mass = self._between[1][place:after] + self._on[1][place + 1 : after + 1]
            whole, other = float(mass.sum()), self._known[after]
            at = place + 1 + int(np.searchsorted(np.cumsum(mass), whole / 2))
            unknown = parts[1] - parts[0] - whole * (known.upper - known.lower + other.upper - other.lower) / 2
            middle = min(max(at, place + 1), after - 1) if after - place > 1 else None
            open_.append((unknown + whole * (known.short + other.short), middle))
        self.short = short + self._rest
        self.lower = max(self.lower, lower - short - SLACK)
        self.upper = min(self.upper, upper + self._rest + SLACK)
        return open_

    def _gap(self, places: Sequence[int], number: int) -> tuple[Array, Array, float]:
        """Bounds at all values from one that is known to the next, and of how probably something is too short."""
        first, last = places[number : number + 2]
        left, right = self._known[first], self._known[last]
        shape = last - first + 1
        if self._is_rising:
            least, most = np.full(shape, right.lower), np.full(shape, left.upper)
        else:
            least, most = np.zeros(shape), np.ones(shape)
        if self._doubt is not None:
            inside = self._coordinates[first : last + 1]
            share = np.clip((inside - inside[0]) / (inside[-1] - inside[0]), 0, 1)
            ends = [known.lower - self._doubt for known in (left, right)]
            if min(ends) > FLOOR:
                least = np.maximum(least, np.exp((1 - share) * np.log(ends[0]) + share * np.log(ends[1])))
            for far in places[max(0, number - CHORDS) : number]:
                most = np.minimum(most, self._continued(far, first, inside) + self._doubt)
            for far in places[number + 2 : number + 2 + CHORDS]:
                most = np.minimum(most, self._continued(far, last, inside) + self._doubt)
        return least, most, left.short

    def _continued(self, far: int, near: int, inside: Array) -> Array:
        """What the chord between two values is at most where it goes on beyond the nearer one."""
        low = self._known[far].lower - (self._doubt or 0.0)
        high = max(self._known[near].upper, FLOOR)
        if low <= FLOOR:
            return np.ones(len(inside))
        begin, end = self._coordinates[far], self._coordinates[near]
        reach = np.maximum((inside - end) / (end - begin), 0)
        return np.asarray(np.exp(np.minimum(np.log(high) + reach * (np.log(high) - np.log(low)), 0)))


def doubts(factors: Sequence[SharedFactor], distributions: Mapping[str, Distribution]) -> list[float | None]:
    """For each factor, how probable values are with which probabilities are not log-concave in it; None if never.

    The factors after it are averaged over, so that they have to be log-concave, too.
    """
    charge = 0.0
    for name, known in distributions.items():
        count = sum(name in factor.scales for factor in factors)
        share = known.irregular(STEEPNESS * count)
        if share is None:
            return [None] * len(factors)
        charge += share[1] / UNIT * (1 + 2.0**-50)
    known_: list[float | None] = []
    for number, factor in enumerate(factors):
        inner = factors[number + 1 :]
        regular = all(not other.scales and other.distribution.irregular(Fraction(0)) == (0, 0) for other in inner)
        known_.append(charge if regular and not (factor.scales and not _positive(factor)) else None)
    return known_


def _positive(factor: SharedFactor) -> bool:
    lower = factor.distribution.support[0]
    return lower is not None and lower > 0


class SharedAverage:
    """The average over all factors, one after the other; those that scale first.

    Args:
        factors: independent ones.
        distributions: of the parameters, without factors.
        at: bounds for values of all factors.
        check: called now and then, to raise what ends the search.
    """

    def __init__(
        self,
        factors: Sequence[SharedFactor],
        distributions: Mapping[str, Distribution],
        at: Callable[[Given], Conditional],
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self._factors = sorted(factors, key=lambda factor: not factor.scales)
        self._doubts = doubts(self._factors, distributions)
        self._evaluate, self._check = at, check
        self.lower, self.upper = 0.0, 1.0

    def run(self, within: float, tell: Callable[[], None] = lambda: None) -> None:
        """Bounds that are as close, if they can be."""
        outer = self._average((), within)

        def told() -> None:
            self.lower, self.upper = max(self.lower, outer.lower), min(self.upper, outer.upper)
            tell()

        outer.run(within, told)

    def _average(self, known: Given, within: float) -> FactorAverage:
        number = len(known)
        factor = self._factors[number]

        def at(value: Fraction) -> Conditional:
            values = (*known, (factor, value))
            if len(values) == len(self._factors):
                return self._evaluate(values)
            inner = self._average(values, within / 3)
            inner.run(within / 3)
            return Conditional(inner.lower, inner.upper, inner.short)

        return FactorAverage(factor, at, self._doubts[number], self._check)


def draw_factors(
    factors: Sequence[SharedFactor], random: np.random.Generator, count: int
) -> Callable[[str, Array], Array]:
    """Random values of factors; how they change those of a parameter."""
    values = {factor.name: drawn(factor.distribution, random, count) for factor in factors}

    def change(name: str, own: Array) -> Array:
        for factor in factors:
            if name in factor.scales:
                own = own * values[factor.name]
        return own + sum(
            (float(factor.shifts[name]) * values[factor.name] for factor in factors if name in factor.shifts),
            np.zeros(count),
        )

    return change
