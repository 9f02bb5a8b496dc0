"""Statistics of success and failure: intervals of proportions and means, paired comparison, a line through points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import sqrt
from statistics import fmean, stdev

from robust.errors import missing

try:
    from scipy.stats import binomtest, linregress
    from scipy.stats import t as student
except ImportError:  # an extra
    raise missing("scipy, which this experiment needs", "experiments") from None

CONFIDENCE = 0.95
Bounds = tuple[float, float]


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

    @property
    def interval(self) -> Bounds:
        """The proportions that such an outcome does not reject."""
        low, high = binomtest(self.successes, self.trials).proportion_ci(CONFIDENCE, method="wilson")
        return float(low), float(high)


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
        counts = Counter(outcomes)
        return Pairing(counts[True, False], counts[False, True], counts[True, True], counts[False, False])

    @property
    def p_value(self) -> float:
        """McNemar's exact test, two-sided: how likely so uneven a split is if either is as likely to win a case.

        Source: Q. McNemar (1947), with the binomial distribution in place of its approximation.
        """
        differing = self.first + self.second
        return float(binomtest(self.first, differing).pvalue) if differing else 1.0


@dataclass(frozen=True, slots=True)
class Mean:
    """The mean of at least one value, with a confidence interval by Student's t; None for a single value."""

    value: float
    interval: Bounds | None

    @staticmethod
    def of(values: Iterable[float]) -> Mean | None:
        """None without values."""
        known = list(values)
        if not known:
            return None
        mean, degrees = fmean(known), len(known) - 1
        return Mean(mean, _around(mean, stdev(known) / sqrt(len(known)), degrees) if degrees else None)


@dataclass(frozen=True, slots=True)
class LineFit:
    """A line by least squares. `interval` is the confidence interval of the slope by Student's t, None for two points.
    `r_squared` is the share of the variance that the line explains; 1 where there is none."""

    slope: float
    interval: Bounds | None
    intercept: float
    r_squared: float

    @staticmethod
    def of(points: Sequence[tuple[float, float]]) -> LineFit | None:
        """None unless the points have two different abscissas."""
        if len({x for x, _ in points}) < 2:
            return None
        fit = linregress([x for x, _ in points], [y for _, y in points])
        degrees = len(points) - 2
        slope = float(fit.slope)
        explained = float(fit.rvalue) ** 2 if len({y for _, y in points}) > 1 else 1.0
        interval = _around(slope, float(fit.stderr), degrees) if degrees else None
        return LineFit(slope, interval, float(fit.intercept), explained)


def _around(middle: float, error: float, degrees: int) -> Bounds:
    low, high = student.interval(CONFIDENCE, degrees, middle, error) if error else (middle, middle)
    return float(low), float(high)
