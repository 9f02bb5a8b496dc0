"""Statistics of success and failure: intervals of a proportion, and paired comparison. Exact where the tests are."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from math import atan, comb, cos, pi, sin, sqrt
from statistics import NormalDist

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Proportion:
    """`successes` of `trials`, at least one trial, with the confidence interval of Wilson's score.

    Source: E. B. Wilson (1927), *Probable inference, the law of succession, and statistical inference*. It keeps to
    [0, 1], and says something where all or none succeed.
    """

    successes: int
    trials: int

    def __post_init__(self) -> None:
        if self.trials < 1 or not 0 <= self.successes <= self.trials:
            raise ValueError(f"{self.successes} of {self.trials} is no proportion")

    @property
    def share(self) -> Fraction:
        return Fraction(self.successes, self.trials)

    def interval(self, confidence: float = CONFIDENCE) -> tuple[float, float]:
        """The interval of the proportions that such an outcome does not reject."""
        z = NormalDist().inv_cdf((1 + confidence) / 2)
        share, trials = self.successes / self.trials, self.trials
        middle = (share + z * z / (2 * trials)) / (1 + z * z / trials)
        half = z / (1 + z * z / trials) * sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
        lower = 0.0 if self.successes == 0 else max(0.0, middle - half)
        upper = 1.0 if self.successes == trials else min(1.0, middle + half)
        return lower, upper


@dataclass(frozen=True, slots=True)
class Pairing:
    """Two executors on the same cases: how often only the `first` succeeds, only the `second`, both, neither."""

    first: int
    second: int
    both: int
    neither: int

    @staticmethod
    def of(outcomes: Iterable[tuple[bool, bool]]) -> Pairing:
        """From the success of both in each case."""
        counts = {(True, False): 0, (False, True): 0, (True, True): 0, (False, False): 0}
        for outcome in outcomes:
            counts[outcome] += 1
        return Pairing(counts[True, False], counts[False, True], counts[True, True], counts[False, False])

    @property
    def p_value(self) -> Fraction:
        """McNemar's exact test, two-sided: how likely so uneven a split is if either is as likely to win a case.

        Source: Q. McNemar (1947), with the binomial distribution in place of its approximation.
        """
        differing = self.first + self.second
        fewer = min(self.first, self.second)
        tail = Fraction(sum(comb(differing, k) for k in range(fewer + 1)), 2**differing)
        return min(Fraction(1), 2 * tail)


@dataclass(frozen=True, slots=True)
class Mean:
    """The mean of at least one value, with a confidence interval by Student's t; None for a single value."""

    value: float
    interval: tuple[float, float] | None

    @staticmethod
    def of(values: Iterable[float], confidence: float = CONFIDENCE) -> Mean | None:
        """None without values."""
        known = list(values)
        count = len(known)
        if not known:
            return None
        mean = sum(known) / count
        if count == 1:
            return Mean(mean, None)
        deviation = sqrt(sum((value - mean) ** 2 for value in known) / (count - 1))
        half = student_quantile((1 + confidence) / 2, count - 1) * deviation / sqrt(count)
        return Mean(mean, (mean - half, mean + half))


def student_quantile(probability: float, degrees: int) -> float:
    """The quantile of Student's t distribution, for a probability of at least one half.

    Its distribution function is a finite sum for whole degrees of freedom (Abramowitz and Stegun, 26.7.3 and 26.7.4),
    which bisection inverts.
    """
    if degrees < 1 or not 0.5 <= probability < 1:
        raise ValueError(f"no quantile for probability {probability} and {degrees} degrees of freedom")
    low, high = 0.0, 1.0
    while _student(high, degrees) < probability:
        high *= 2
    while high - low > 1e-12 * high:
        middle = (low + high) / 2
        if _student(middle, degrees) < probability:
            low = middle
        else:
            high = middle
    return high


def _student(t: float, degrees: int) -> float:
    """The distribution function of Student's t at t ≥ 0."""
    angle = atan(t / sqrt(degrees))
    square = cos(angle) ** 2
    term, total = 1.0, 0.0
    odd = degrees % 2
    for k in range(degrees // 2):
        total += term
        term *= square * (2 * k + 1 + odd) / (2 * k + 2 + odd)
    if odd:
        return 0.5 + (angle + sin(angle) * cos(angle) * total) / pi
    return 0.5 + sin(angle) * total / 2
