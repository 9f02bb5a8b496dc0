"""A line through points by least squares, and how well it fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from statistics import fmean

from robust.bench.execution_statistics import CONFIDENCE, student_quantile

PARAMETERS = 2
"""Of a line; with no more points than that, it says nothing about their spread."""


@dataclass(frozen=True, slots=True)
class LineFit:
    """`interval` is the confidence interval of the slope by Student's t, None for two points. `r_squared` is the share
    of the variance that the line explains; 1 where there is none."""

    slope: float
    intercept: float
    r_squared: float
    interval: tuple[float, float] | None

    @staticmethod
    def of(points: Sequence[tuple[float, float]], confidence: float = CONFIDENCE) -> LineFit | None:
        """None unless the points have two different abscissas."""
        if len({x for x, _ in points}) < PARAMETERS:
            return None
        middle, height = fmean(x for x, _ in points), fmean(y for _, y in points)
        spread = sum((x - middle) ** 2 for x, _ in points)
        slope = sum((x - middle) * (y - height) for x, y in points) / spread
        intercept = height - slope * middle
        residual = sum((y - intercept - slope * x) ** 2 for x, y in points)
        variance = sum((y - height) ** 2 for _, y in points)
        degrees = len(points) - PARAMETERS
        interval = None
        if degrees:
            half = student_quantile((1 + confidence) / 2, degrees) * sqrt(residual / degrees / spread)
            interval = (slope - half, slope + half)
        return LineFit(slope, intercept, 1 - residual / variance if variance else 1.0, interval)
