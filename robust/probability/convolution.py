"""Laws of sums: convolutions whose rounding is bounded by a proof.

A law F is an array: F[k] is the probability of at most k places. What is added to it has differences y[j] and the law
Y[k] = y[0] + … + y[k]. Only where F changes is anything transformed: if F = a before place p and F = b from q on,

    (F * y)[k] = a Y[k] + (b − a) Y[k − q] + Σ_{p ≤ i < q} (F[i] − a) y[k − i].

Real sequences of length 2n are multiplied modulo z²ⁿ + 1, as complex ones x[k] + i x[k + n] modulo zⁿ − i: with weights
ωᵏ, ω²ⁿ = −1, that is a cyclic convolution of length n [Crandall and Fagin 1994].

**Rounding**, u = 2⁻⁵³. Real and imaginary parts are arrays of their own, and all that is done with them is to add,
subtract and multiply two numbers, and to multiply real matrices as everybody does: each entry is a sum of products,
added in whatever order, fused or not. A sum of k products is wrong by γ = ku / (1 − ku) times that of their sizes at
most [Higham 2002, §3.1], and any other result by u of its size (what underflows is below 2⁻¹⁰⁰⁰). So products pq of
complex numbers are rounded by √8 u |pq| < 3u |pq|: either part by at most 2u times a sum of two products, which is at
most |p||q|, but for terms in u².

- *Roots* are products of entries of two tables, which come from integers and are wrong by 0.71u: roots are within 5u,
  and a product with a root is rounded by 9u of its size.
- *Transforms* of length n = 2ᵐ multiply by matrices, one after the other: s ≤ 4 of blocks of r ≤ 32 rows of roots, and
  between them diagonal ones of roots. Each is unitary but for a factor √r or 1. So it does not enlarge, relative to the
  length |·|₂ of the vector, what was wrong before, and adds 9u of that length if it is diagonal. With parts one below
  the other a block is a real matrix of 2r rows with a Frobenius norm of √2 r; its roots add 5u√r to what is wrong, and
  its sums of 2r products γ√(2r): together less than 541u. So a transform is wrong by η < (4 · 541 + 3 · 9 + 1) u
  < 2200u of its length.
- *Products.* For exact transforms X and Y, |X|₂ = √n |x|₂. By Cauchy and Schwarz, products are wrong by at most
  ((1 + η)² (1 + 3u) − 1) n |x|₂ |y|₂ in sum, hence by 4404u |x|₂ |y|₂ in each place when transformed back exactly. The
  transform back rounds by η |x * y|₂ (1 + 10⁻⁹) ≤ 2201u |x|₂ |y|₁. To divide by n is exact.
- *Laws.* |x|₂ ≤ √(2n), and |y|₂ ≤ |y|₁ ≤ 1. So the sum above is wrong by at most 6605u √(2n) < 1.07·10⁻⁹. Differences
  are rounded by u of their size; these, two more products, and sums of three terms add less than 10u.

`ROUNDED` bounds all of that.
"""

from functools import cache
from math import isqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
ROUNDED = 1.1e-9
"""By how much a place of a convolution may be wrong."""
LONGEST = 20
"""Binary logarithm of the greatest length of a transform."""
TOGETHER = 1 << 14
"""Places that are transformed together, so that they stay close to the processor."""
BLOCK = 64
"""Rows or columns of a product of matrices at most: what is larger is shared out to several processors, which costs."""
_RADIX = 5
_BITS = 160
_HALF = LONGEST // 2 + 1


@cache
def _tables() -> tuple[Array, Array]:
    """exp(−2πi k / 2²²) for multiples k of 2¹¹, and for k below 2¹¹; parts on the first axis.

    By half angles from π/2 in integers: cos² x/2 = (1 + cos x) / 2, sin x/2 = sin x / (2 cos x/2). Each half is wrong
    by at most as much as the angle and three units of 2⁻¹⁶⁰ more, hence none by more than 2⁷ units, and the 2¹¹ powers
    of one by less than 2²⁰ units. Divided, parts are rounded correctly, by u / 2 at most: entries are within
    u / √2 + 2⁻¹⁴⁰.
    """
    one = 1 << _BITS
    cosine, sine = 0, one
    generators = []
    for _ in range(2 * _HALF - 2):
        cosine = isqrt((one + cosine) * one >> 1)
        sine = sine * one // (2 * cosine)
        generators.append((cosine, sine))
    tables = []
    for step in (generators[_HALF - 3], generators[-1]):
        powers = [(one, 0)]
        for _ in range((1 << _HALF) - 1):
            real, imaginary = powers[-1]
            powers.append((
                (real * step[0] - imaginary * step[1]) >> _BITS, (real * step[1] + imaginary * step[0]) >> _BITS,
            ))  # fmt: skip
        tables.append(np.array([[real / one for real, _ in powers], [-part / one for _, part in powers]]))
    return tables[0], tables[1]


def roots(order: int, powers: npt.NDArray[np.int64]) -> Array:
    """exp(−2πi k / 2^order) for powers k, with an error of 5u; parts on the first axis.

    Raises:
        ValueError: if the order is greater than that of the tables.
    """
    if order > 2 * _HALF:
        raise ValueError(f"convolutions are not longer than 2 to the power of {LONGEST + 1}")
    coarse, fine = _tables()
    places = (powers << (2 * _HALF - order)) & ((1 << 2 * _HALF) - 1)
    return _product(coarse[:, places >> _HALF], fine[:, places & ((1 << _HALF) - 1)])


class Increments:
    """What a law adds to another, with its transforms, which are computed once.

    Args:
        law: one, or one in each row.
    """

    def __init__(self, law: Array) -> None:
        self.law = np.atleast_2d(law)
        steps = np.diff(self.law, prepend=0.0, axis=-1)
        self.first, self._last = _support(steps)
        self._steps = steps[:, self.first : self._last]
        self._transforms: dict[tuple[int, int], Array] = {}

    @property
    def is_fixed(self) -> bool:
        """Whether it adds a fixed number of places."""
        return self._steps.shape == (1, 1) and bool(self._steps[0, 0] == 1)

    def convolved(self, law: Array) -> Array:
        """The law of the sum, within `ROUNDED` in each place, for each row of either."""
        whole, size = np.atleast_2d(law), law.shape[-1]
        least, greatest = whole[:, :1], whole[:, -1:]
        begin, end = _support(whole != least)
        end = max(begin, min(end, _support(whole != greatest)[1]))
        total = least * self.law
        if end + self.first < size:
            total[:, end:] += (greatest - least) * self.law[:, : size - end]
        count = min(size - begin - self.first, end - begin + self._last - self.first - 1)
        if end > begin and count > 0 and self._steps.size:
            product = self._times(whole[:, begin : min(end, begin + count)] - least, count)
            total[:, begin + self.first : begin + self.first + count] += product
        return total if law.ndim > 1 or len(total) > 1 else total[0]

    def _times(self, window: Array, count: int) -> Array:
        """The first places of the product of a window and the steps."""
        used = min(count, self._steps.shape[-1])
        if self._steps.shape[-1] == 1:
            return window * self._steps
        order = max(0, (window.shape[-1] + used - 2).bit_length() - 1)
        if (order, used) not in self._transforms:
            self._transforms[order, used] = _transformed(_padded(self._steps[:, :used], order))
        transform = _transformed(_padded(window, order))
        return _restored(_product(transform, self._transforms[order, used]))[:, :count]


def _support(different: npt.NDArray[np.generic]) -> tuple[int, int]:
    """From where on some row is not zero, and up to where."""
    places = np.flatnonzero(different.any(axis=0))
    return (int(places[0]), int(places[-1]) + 1) if len(places) else (0, 0)


def _padded(rows: Array, order: int) -> Array:
    whole = np.zeros((len(rows), 2 << order))
    whole[:, : rows.shape[-1]] = rows
    return whole


def _product(first: Array, second: Array) -> Array:
    real = first[0] * second[0] - first[1] * second[1]
    return np.stack((real, first[0] * second[1] + first[1] * second[0]))


def _multiply(vectors: Array, factors: Array, result: Array) -> None:
    """The product, parts on the first axis; the vectors change."""
    np.multiply(vectors, factors[0], out=result)
    vectors *= factors[1]
    result[0] -= vectors[1]
    result[1] += vectors[0]


class _Stage(NamedTuple):
    """Of a transform: a matrix for each r places, whose real parts come before their imaginary ones, and the roots by
    which the products are multiplied, for each of them and each of the places beside; none in the last stage."""

    matrix: Array
    roots: Array | None

    def forth(self, x: Array) -> Array:
        """Of arrays (…, parts, r, places beside): arrays (…, r, parts, places beside)."""
        if self.roots is None:
            return _in_blocks(x, self.matrix.T)
        y = _in_columns(self.matrix, x.reshape(-1, len(self.matrix), self.roots.shape[-1]))
        radix, beside = self.roots.shape[1:]
        z = np.empty((len(y), radix, 2, beside))
        _multiply(y.reshape(-1, 2, radix, beside).swapaxes(0, 1), self.roots[:, None], np.moveaxis(z, 2, 0))
        return z

    def back(self, z: Array) -> Array:
        """The inverse of :meth:`forth` but for a factor; what is given may change."""
        if self.roots is None:
            return _in_blocks(z, self.matrix)
        radix, beside = self.roots.shape[1:]
        z = z.reshape(-1, radix, 2, beside)
        y = np.empty((len(z), 2, radix, beside))
        _multiply(np.moveaxis(z, 2, 0), _conjugate(self.roots)[:, None], y.swapaxes(0, 1))
        return _in_columns(self.matrix.T, y.reshape(-1, len(self.matrix), beside))


def _in_columns(matrix: Array, vectors: Array) -> Array:
    """A matrix times each of many others, some columns at a time."""
    count, height, width = vectors.shape
    result = np.empty_like(vectors)
    views = (each.reshape(count, height, -1, min(BLOCK, width)).swapaxes(1, 2) for each in (vectors, result))
    np.matmul(matrix, next(views), out=next(views))
    return result


def _in_blocks(vectors: Array, matrix: Array) -> Array:
    """Rows times a matrix, some rows at a time."""
    rows = vectors.reshape(-1, len(matrix))
    block = min(BLOCK, len(rows) & -len(rows))
    return (rows.reshape(-1, block, len(matrix)) @ matrix).reshape(rows.shape)


@cache
def _stages(order: int) -> tuple[_Stage, ...]:
    """Of a transform of length 2^order; the weights are in the first one."""
    count = max(1, -(-order // _RADIX))
    stages, left = [], order
    for number in range(count):
        bits = order // count + (number < order % count)
        left -= bits
        # Of place k₀ 2^left + k₁, a matrix makes j of k₀, and a root goes by j and k₁; weights are in the first stage.
        j, k = np.arange(1 << bits), np.arange(1 << left)
        weight = int(number == 0)
        powers = (j[:, None] << 2) * j - weight * j
        real, imaginary = roots(bits + 2, powers)
        matrix = np.block([[real, -imaginary], [imaginary, real]])
        turned = roots(left + bits + 2, (j[:, None] << 2) * k - weight * k) if left else None
        stages.append(_Stage(matrix, turned))
    return tuple(stages)


def _transformed(sequences: Array) -> Array:
    """Of real sequences of length 2n: parts, rows, and n places in an order of their own."""
    rows, length = sequences.shape[0], sequences.shape[1] // 2
    stages = _stages(length.bit_length() - 1)
    whole = np.empty((2, rows, length))
    together = max(1, TOGETHER // length)
    for begin in range(0, rows, together):
        now = sequences[begin : begin + together]
        count = len(now)
        for stage in stages:
            now = stage.forth(now)
        radix = len(stages[-1].matrix) // 2
        whole[:, begin : begin + count] = np.moveaxis(now.reshape(count, -1, 2, radix), 2, 0).reshape(2, count, length)
    return whole


def _restored(vectors: Array) -> Array:
    """The real sequences of transforms."""
    _, rows, length = vectors.shape
    stages = _stages(length.bit_length() - 1)
    radix = len(stages[-1].matrix) // 2
    whole = np.empty((rows, 2 * length))
    together = max(1, TOGETHER // length)
    for begin in range(0, rows, together):
        part = vectors[:, begin : begin + together]
        now = np.moveaxis(part.reshape(2, part.shape[1], -1, radix), 0, 2).copy("C")
        for stage in reversed(stages):
            now = stage.back(now)
        np.divide(now.reshape(-1, 2 * length), length, out=whole[begin : begin + together])
    return whole


def _conjugate(factors: Array) -> Array:
    return np.stack((factors[0], -factors[1]))
