"""Laws of sums: convolutions whose rounding is bounded by a proof.

A law F is an array: F[k] is the probability of at most k places. What is added to it has differences y[j] and the law
Y[k] = y[0] + … + y[k]. Only where F changes is anything transformed: if F = a before place p and F = b from q on,

    (F * y)[k] = a Y[k] + (b − a) Y[k − q] + Σ_{p ≤ i < q} (F[i] − a) y[k − i].

Real sequences of length 2n are multiplied modulo z²ⁿ + 1, as complex ones x[k] + i x[k + n] modulo zⁿ − i: with weights
ωᵏ, ω²ⁿ = −1, that is a cyclic convolution of length n [Crandall and Fagin 1994].

**Rounding**, u = 2⁻⁵³. Real and imaginary parts are arrays of their own, and all that is done with them is to add,
subtract and multiply two numbers: each result is rounded by u of its size at most (what underflows is below 2⁻¹⁰⁰⁰). So
complex sums are rounded by u of their size, and products pq by √8 u |pq| < 3u |pq|: either part by at most 2u times a
sum of two products, which is at most |p||q|, but for terms in u².

- *Roots* are products of entries of two tables, which come from integers and are wrong by 0.71u: roots are within 5u,
  and a product with a root is rounded by 9u of its size.
- *Transforms* of length n = 2ᵐ multiply by matrices, one after the other: m of sums and differences of two entries (a
  factor i exchanges parts), and m / 2 diagonal ones of roots or weights. Each is unitary but for a factor. So it does
  not enlarge, relative to the length |·|₂ of the vector, what was wrong before, and adds u or 9u of that length. With
  m ≤ 20 a transform is wrong by η ≤ (1 + u)²⁰ (1 + 9u)¹⁰ − 1 < 110.1u of its length.
- *Products.* For exact transforms X and Y, |X|₂ = √n |x|₂. By Cauchy and Schwarz, products are wrong by at most
  ((1 + η)² (1 + 3u) − 1) n |x|₂ |y|₂ in sum, hence by 224u |x|₂ |y|₂ in each place when transformed back exactly. The
  transform back rounds by η |x * y|₂ (1 + 10⁻⁹) ≤ 111u |x|₂ |y|₁. To divide by n is exact.
- *Laws.* |x|₂ ≤ √(2n), and |y|₂ ≤ |y|₁ ≤ 1. So the sum above is wrong by at most 335u √(2n) < 6·10⁻¹¹. Differences are
  rounded by u of their size; these, two more products, and sums of three terms add less than 10u.

`ROUNDED` = 2⁻³³ > 10⁻¹⁰ bounds all of that.
"""

from functools import cache
from math import isqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
ROUNDED = 2.0**-33
"""By how much a place of a convolution may be wrong."""
LONGEST = 20
"""Binary logarithm of the greatest length of a transform."""
TOGETHER = 1 << 14
"""Places that are transformed together, so that they stay close to the processor."""
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


class _Pass(NamedTuple):
    """Of a transform: vectors are seen as (…, `radix`, `inner`, `trailing`), and multiplied by roots but for the first;
    `turned` if the two halves of the index change places before."""

    radix: int
    inner: int
    trailing: int
    roots: Array
    turned: int

    def forth(self, now: Array, other: Array) -> tuple[Array, Array]:
        """Where the result is, and room for the next; both arrays change."""
        x, y = (each.reshape(2, -1, self.radix, self.inner, self.trailing) for each in (now, other))
        half = self.radix // 2
        np.add(x[:, :, :half], x[:, :, half:], out=y[:, :, :half])
        np.subtract(x[:, :, :half], x[:, :, half:], out=y[:, :, half:])
        if half == 2:  # y = a + c, b + d, a − c, b − d; result a + c + (b + d), − (b + d), a − c − i(b − d), + i(b − d)
            np.add(y[:, :, 0], y[:, :, 1], out=x[:, :, 0])
            np.subtract(y[:, :, 0], y[:, :, 1], out=x[:, :, 1])
            np.add(y[0, :, 2], y[1, :, 3], out=x[0, :, 2])
            np.subtract(y[1, :, 2], y[0, :, 3], out=x[1, :, 2])
            np.subtract(y[0, :, 2], y[1, :, 3], out=x[0, :, 3])
            np.add(y[1, :, 2], y[0, :, 3], out=x[1, :, 3])
            now, other, x, y = other, now, y, x
        if self.inner == 1:
            return other, now
        np.copyto(x[:, :, 0], y[:, :, 0])
        _multiply(y[:, :, 1:], self.roots, x[:, :, 1:])
        return now, other

    def back(self, now: Array, other: Array) -> tuple[Array, Array]:
        """The inverse of :meth:`forth` but for a factor; both arrays change."""
        x, y = (each.reshape(2, -1, self.radix, self.inner, self.trailing) for each in (now, other))
        if self.inner > 1:
            np.copyto(y[:, :, 0], x[:, :, 0])
            _multiply(x[:, :, 1:], _conjugate(self.roots), y[:, :, 1:])
            now, other, x, y = other, now, y, x
        half = self.radix // 2
        if half == 2:
            np.add(x[:, :, 0], x[:, :, 1], out=y[:, :, 0])
            np.subtract(x[:, :, 0], x[:, :, 1], out=y[:, :, 1])
            np.add(x[:, :, 2], x[:, :, 3], out=y[:, :, 2])
            np.subtract(x[1, :, 3], x[1, :, 2], out=y[0, :, 3])
            np.subtract(x[0, :, 2], x[0, :, 3], out=y[1, :, 3])
            now, other, x, y = other, now, y, x
        np.add(x[:, :, :half], x[:, :, half:], out=y[:, :, :half])
        np.subtract(x[:, :, :half], x[:, :, half:], out=y[:, :, half:])
        return other, now


def _multiply(vectors: Array, factors: Array, result: Array) -> None:
    """The product; the vectors change."""
    np.multiply(vectors, factors[0], out=result)
    vectors *= factors[1]
    result[0] -= vectors[1]
    result[1] += vectors[0]


@cache
def _passes(order: int) -> tuple[Array, tuple[_Pass, ...]]:
    """The weights and the passes of a transform of length 2^order.

    After half of the passes the rest of the index comes first, so that what is done at once stays long.
    """
    weights = _conjugate(roots(order + 2, np.arange(1 << order)))
    passes, left, trailing = [], order, 1
    while left:
        turned = 0
        if trailing == 1 and left <= (order + 1) // 2 and left < order:
            trailing, turned = 1 << (order - left), 1 << left
        bits = 1 if left % 2 else 2
        inner = 1 << (left - bits)
        powers = np.array([1] if bits == 1 else [2, 1, 3])[:, None] * np.arange(inner)
        passes.append(_Pass(1 << bits, inner, trailing, roots(left, powers)[:, None, ..., None], turned))
        left -= bits
    return weights[:, None], tuple(passes)


def _transformed(sequences: Array) -> Array:
    """Of real sequences of length 2n, in rows: parts, rows, and n places in an order of their own."""
    rows, length = sequences.shape[0], sequences.shape[1] // 2
    weights, passes = _passes(length.bit_length() - 1)
    whole = np.empty((2, rows, length))
    for begin in range(0, rows, max(1, TOGETHER // length)):
        part = sequences[begin : begin + max(1, TOGETHER // length)]
        other = part.reshape(-1, 2, length).swapaxes(0, 1).copy("C")
        now = np.empty_like(other)
        _multiply(other, weights, now)
        for step in passes:
            if step.turned:
                source = now.reshape(2, len(part), -1, step.turned).swapaxes(2, 3)
                np.copyto(other.reshape(source.shape), source)
                now, other = other, now
            now, other = step.forth(now, other)
        whole[:, begin : begin + len(part)] = now
    return whole


def _restored(vectors: Array) -> Array:
    """The real sequences of transforms."""
    _, rows, length = vectors.shape
    weights, passes = _passes(length.bit_length() - 1)
    whole = np.empty((rows, 2, length))
    scaled = _conjugate(weights) / length
    for begin in range(0, rows, max(1, TOGETHER // length)):
        now = vectors[:, begin : begin + max(1, TOGETHER // length)].copy("C")
        count = now.shape[1]
        other = np.empty_like(now)
        for step in reversed(passes):
            now, other = step.back(now, other)
            if step.turned:
                source = now.reshape(2, count, step.turned, -1).swapaxes(2, 3)
                np.copyto(other.reshape(source.shape), source)
                now, other = other, now
        _multiply(now, scaled, other)
        whole[begin : begin + count] = other.swapaxes(0, 1)
    return whole.reshape(rows, -1)


def _conjugate(factors: Array) -> Array:
    return np.stack((factors[0], -factors[1]))
