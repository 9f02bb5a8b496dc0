"""Convolutions and roots of unity against exact integers and fractions."""

from fractions import Fraction
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.probability import convolution
from robust.probability.convolution import LONGEST, ROUNDED, Increments
from robust.probability.distributions import UNIT, exp_minus, normal
from robust.probability.random_durations import decay, normal_cdf

F = Fraction
U = 2.0**-53
PLACES = 60
"""Decimals of exact numbers."""


def arctangent(inverse: int) -> Fraction:
    return sum((F((-1) ** n, (2 * n + 1) * inverse ** (2 * n + 1)) for n in range(PLACES)), F(0))


TURN = 8 * (4 * arctangent(5) - arctangent(239))  # Machin


def root(power: int, order: int) -> tuple[Fraction, Fraction]:
    """exp(−2πi power / 2^order) by series."""
    angle = F(round(-TURN * F(power, 1 << order) * 10**PLACES), 10**PLACES)
    angle -= round(angle / TURN) * TURN
    parts, term = [F(0), F(0)], F(1)
    for number in range(PLACES):
        parts[number % 2] += term * (-1) ** (number // 2)
        term = F(round(term * angle / (number + 1) * 10**PLACES), 10**PLACES)
    return parts[0], parts[1]


@pytest.mark.parametrize("order", [0, 1, 2, 5, 11, 12, 17, LONGEST + 2])
def test_roots_of_unity_are_within_what_the_proof_takes(order):
    random = Random(order)  # noqa: S311 - reproducible
    powers = np.array([0, *(random.randrange(1 << order) for _ in range(12)), (1 << order) - 1])
    found = convolution.roots(order, powers)
    for number, power in enumerate(powers):
        errors = [abs(F(float(found[part, number])) - exact) for part, exact in enumerate(root(int(power), order))]
        assert errors[0] ** 2 + errors[1] ** 2 <= F(5 * U) ** 2


def test_roots_of_greater_orders_are_refused():
    with pytest.raises(ValueError, match="not longer"):
        convolution.roots(LONGEST + 3, np.arange(2))


def exact_sums(law: list[int], other: list[int]) -> list[int]:
    """Σ law[i] (other[k − i] − other[k − i − 1]), by one product of integers whose digits do not meet."""
    steps = [one - before for one, before in zip(other, [0, *other], strict=False)]
    width = 20  # bytes, of sums of up to 2³² products of numbers up to 2⁵⁰
    whole, other_whole = (
        int.from_bytes(b"".join(one.to_bytes(width, "little") for one in row), "little") for row in (law, steps)
    )
    digits = (whole * other_whole).to_bytes(2 * width * len(law), "little")
    return [int.from_bytes(digits[at : at + width], "little") for at in range(0, width * len(law), width)]


def drawn_law(random: Random, size: int) -> list[int]:
    """Multiples of 2⁻⁵⁰: probabilities of places of a part, and perhaps something below and above it."""
    first, last = sorted(random.choices(range(size + 1), k=2))
    steps = [0] * size
    for place in range(first, last):
        steps[place] = random.randrange(1 << random.choice((2, 10, 30)))
    if random.random() < 0.3:
        steps[0] += random.randrange(1 << 30)
    whole = max(1, sum(steps)) * random.choice((1, 1, 2))
    law, total = [], 0
    for step in steps:
        total += step
        law.append((total << 50) // whole)
    return law


def hunt(seed: int, size: int) -> float:
    """The greatest error, in the bound of the proof; rows of laws with one or several others."""
    random = Random(f"{seed} {size}")  # noqa: S311 - reproducible
    laws = [drawn_law(random, size) for _ in range(random.randint(1, 3))]
    others = [drawn_law(random, size) for _ in range(random.choice((1, len(laws))))]
    increments = Increments(np.array(others) / 2.0**50)
    worst = 0.0
    for _ in range(2):  # the second time with transforms that are known
        found = increments.convolved(np.array(laws) / 2.0**50)
        assert found.shape == (max(len(laws), len(others)), size)
        for row, sums in enumerate(found):
            exact = exact_sums(laws[row], others[row if len(others) > 1 else 0])
            errors = [abs(F(float(one)) - F(total, 1 << 100)) for one, total in zip(sums, exact, strict=True)]
            worst = max(worst, float(max(errors)) / (6605 * U * (4 * size) ** 0.5))
    return worst


@given(st.integers(0, 10**9), st.integers(1, 70))
@settings(max_examples=60, deadline=None)
def test_convolutions_are_within_what_the_proof_says(seed, size):
    assert hunt(seed, size) <= 1


@pytest.mark.parametrize("size", [128, 1000, 1025, 9000])
def test_long_convolutions_are_within_what_the_proof_says(size):
    assert hunt(0, size) <= 1
    assert 6605 * U * (2 << LONGEST) ** 0.5 < 0.99 * ROUNDED


@pytest.mark.slow
def test_convolutions_are_within_what_the_proof_says_very_often():
    for size in (*range(1, 300), 2048, 4095, 4097, 20_000):
        for seed in range(20 if size < 300 else 2):
            assert hunt(seed, size) <= 1


@pytest.mark.parametrize("order", range(13))
def test_transforms_are_sums_over_roots_and_come_back(order):
    """Against sums with roots of NumPy, in whatever order; what comes back is what was given."""
    size = 1 << order
    given = np.random.default_rng(order).random((3, 2 * size))
    transform = convolution._transformed(given)
    if order < 8:
        k = np.arange(size)
        folded = given[:, :size] + 1j * given[:, size:]
        sums = (folded * np.exp(0.5j * np.pi * k / size)) @ np.exp(-2j * np.pi * np.outer(k, k) / size)
        for row, expected in zip(transform[0] + 1j * transform[1], sums, strict=True):
            assert np.abs(row[:, None] - expected).min(axis=1).max() < 1e-10
            assert np.abs(row[:, None] - expected).min(axis=0).max() < 1e-10
    assert np.abs(convolution._restored(transform) - given).max() < 1e-13


def test_rows_that_are_transformed_in_parts_are_as_by_themselves(monkeypatch):
    given = np.random.default_rng(0).random((5, 64))
    whole = convolution._transformed(given)
    monkeypatch.setattr(convolution, "TOGETHER", 64)
    assert np.abs(convolution._transformed(given) - whole).max() < 1e-13
    apart = [convolution._restored(whole[:, row : row + 1]) for row in range(5)]
    assert np.abs(convolution._restored(whole) - np.concatenate(apart)).max() < 1e-15


def test_what_never_ends_in_time_leaves_nothing():
    law = np.linspace(0, 1, 20)
    assert not Increments(np.zeros(20)).convolved(law).any()
    assert not Increments(law).convolved(np.zeros(20)).any()


def test_what_is_fixed_moves_places():
    fixed = Increments(np.array([0.0, 0.0, 1.0, 1.0]))
    assert fixed.is_fixed
    assert fixed.convolved(np.array([0.25, 0.5, 1.0, 1.0])).tolist() == [0.0, 0.0, 0.25, 0.5]
    assert not Increments(np.array([0.0, 0.5, 1.0])).is_fixed
    assert not Increments(np.array([0.0, 0.5, 0.5])).is_fixed


def test_functions_of_laws_are_as_exact_as_they_say():
    random = Random("functions")  # noqa: S311 - reproducible
    places = [0.0, 1 / 128, 1 / 64, 39.999, 45.0, *(random.uniform(0, 42) for _ in range(300))]
    for place, value in zip(places, decay(np.array(places)), strict=True):
        assert abs(Fraction(float(value)) - Fraction(exp_minus(Fraction(place))[0], UNIT)) < Fraction(1, 2**48)
    places = [0.0, -1 / 128, 8.9, -8.9, *(random.uniform(-8.9, 8.9) for _ in range(300))]
    for place, value in zip(places, normal_cdf(np.array(places)), strict=True):
        assert abs(Fraction(float(value)) - Fraction(normal(Fraction(place))[0], UNIT)) < Fraction(1, 2**48)
