"""What durations share: factors such as weather, and covariances of normal durations, often factors and noise."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from itertools import combinations
from math import isqrt
from typing import NamedTuple

from robust.errors import InputError, Location
from robust.probability.distributions import Distribution
from robust.qe.box import Interval
from robust.qe.conjunctions import linked

Matrix = tuple[tuple[Fraction, ...], ...]
Loadings = dict[int, Fraction]
"""What one unit of a factor adds to quantities, by their numbers."""


@dataclass(frozen=True)
class SharedFactor:
    """What several parameters have in common: it multiplies those that it `scales`, and of the others one unit adds
    what `shifts` says."""

    name: str
    distribution: Distribution
    scales: frozenset[str] = frozenset()
    shifts: Mapping[str, Fraction] = field(default_factory=dict)

    @property
    def parameters(self) -> frozenset[str]:
        """All that depend on it."""
        return self.scales | self.shifts.keys()

    @property
    def is_rising(self) -> bool:
        """Whether no parameter is less when the factor is more."""
        return all(share >= 0 for share in self.shifts.values())

    def __str__(self) -> str:
        sign = "*" if self.scales else "+"
        shares = {share for share in self.shifts.values() if share != 1}
        names = [f"{self.shifts[n]}·{n}" if shares and n in self.shifts else n for n in sorted(self.parameters)]
        return f"{self.name}{sign}{','.join(names)}={self.distribution}"


Given = tuple[tuple[SharedFactor, Fraction], ...]
"""Values of some factors."""


def influenced(own: Distribution, name: str, values: Given) -> Distribution:
    """The distribution of a parameter, from its own, for values of factors."""
    scale, shift = Fraction(1), Fraction(0)
    for factor, value in values:
        if name in factor.scales:
            scale *= value
        shift += factor.shifts.get(name, Fraction(0)) * value
    return own.moved(scale, shift) if scale != 1 or shift else own


def shared_range(
    factors: Sequence[SharedFactor], own: Interval, name: str, range_of: Callable[[Distribution], Interval]
) -> Interval:
    """Between which values a parameter is, by the ranges of its own values, which are not negative, and of factors."""
    low, high = own.lower, own.upper
    for factor in factors:
        between = range_of(factor.distribution)
        if name in factor.scales:
            low = (
                None
                if low is None or between.lower is None
                else low * (between.lower if low >= 0 else between.upper or 0)
            )
            high = None if high is None or between.upper is None else high * between.upper
    for factor in factors:
        between, share = range_of(factor.distribution), factor.shifts.get(name, Fraction(0))
        if share:
            least, most = (between.lower, between.upper) if share > 0 else (between.upper, between.lower)
            low = None if low is None or least is None else low + share * least
            high = None if high is None or most is None else high + share * most
    return Interval(low, high)


# -- covariances -----------------------------------------------------------------------------------------------------


def require_covariance(matrix: Matrix, place: Location) -> None:
    """InputError unless a matrix is symmetric and positive semidefinite, which elimination decides exactly."""
    size = len(matrix)
    for row in range(size):
        for column in range(row):
            if matrix[row][column] != matrix[column][row]:
                found = f"{matrix[row][column]} and {matrix[column][row]} in rows {row + 1} and {column + 1}"
                raise InputError(f"found {found} of a covariance matrix, expected it to be symmetric", place)
    rest = [list(row) for row in matrix]
    for pivot in range(size):
        ends = rest[pivot][pivot]
        if ends < 0 or (not ends and any(rest[pivot][pivot:])):
            raise InputError("found a matrix that is not positive semidefinite, expected covariances", place)
        for row in range(pivot + 1, size) if ends else ():
            share = rest[row][pivot] / ends
            rest[row] = [one - share * other for one, other in zip(rest[row], rest[pivot], strict=True)]


@lru_cache(maxsize=16)
def root(matrix: Matrix) -> tuple[tuple[float, ...], ...]:
    """A lower triangular L with L Lᵀ = the matrix, in floats, for draws [Cholesky]."""
    size = len(matrix)
    rows = [[0.0] * size for _ in range(size)]
    for row in range(size):
        for column in range(row + 1):
            rest = float(matrix[row][column]) - sum(rows[row][k] * rows[column][k] for k in range(column))
            if row == column:
                rows[row][row] = max(rest, 0.0) ** 0.5
            elif rows[column][column] > 1e-9 * float(matrix[column][column]) ** 0.5:
                rows[row][column] = rest / rows[column][column]
    return tuple(map(tuple, rows))


def one_factor(matrix: Matrix) -> list[tuple[Loadings, Fraction]] | None:
    """Factors with their variances so that all covariances of different quantities come from them; None if not found.

    Each group of correlated quantities gets one: covariances are products of loadings times its variance if and only if
    all tetrads vanish [Spearman 1904], and quantities have the rest of their variance by themselves.
    """
    factors: list[tuple[Loadings, Fraction]] = []
    for group in _groups(matrix):
        loadings, variance = _loadings(matrix, group)
        for first in group:
            for second in group:
                shared = loadings[first] * loadings[second] * variance
                if (matrix[first][second] != shared) if first != second else (matrix[first][first] < shared):
                    return None
        factors.append((loadings, variance))
    return factors


def _loadings(matrix: Matrix, group: Sequence[int]) -> tuple[Loadings, Fraction]:
    """The loadings that the covariances with one quantity, and of two others, demand."""
    first, second, *others = group
    variance = abs(matrix[first][second])
    if others and matrix[second][others[0]]:
        third = others[0]
        variance = abs(matrix[first][second] * matrix[first][third] / matrix[second][third])
    elif not others:  # of two quantities, all that the first varies
        variance = matrix[first][first]
    if not variance:
        return dict.fromkeys(group, Fraction(0)), variance
    return {number: Fraction(1) if number == first else matrix[first][number] / variance for number in group}, variance


def _groups(matrix: Matrix) -> list[list[int]]:
    """Quantities that are correlated, directly or through others; single ones left out."""
    correlated = (pair for pair in combinations(range(len(matrix)), 2) if matrix[pair[0]][pair[1]])
    return sorted(map(sorted, set(linked(correlated).values())))


class Joint(NamedTuple):
    """Jointly normal parameters with their covariances."""

    names: tuple[str, ...]
    matrix: Matrix


def deviation(variance: Fraction) -> Fraction:
    """Its square root but for a relative error below 2⁻⁶⁰, which is less than what one rounding of a law is given."""
    scale = 1 << 80
    while variance and variance * scale * scale < 1 << 140:
        scale <<= 40
    return Fraction(isqrt(int(variance * scale * scale)), scale)
