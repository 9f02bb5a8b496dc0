"""Enclosures against mpmath with 90 digits: the true value is inside, and they are narrow."""

from fractions import Fraction
from random import Random

import mpmath
import pytest

from robust.errors import InputError, Location
from robust.probability.distributions import UNIT, Below, Distribution, exp_minus, normal, parse_distribution

F = Fraction
PLACE = Location("here")


@pytest.fixture(autouse=True)
def digits():
    with mpmath.workdps(90):
        yield


def real(value: Fraction) -> mpmath.mpf:
    return mpmath.mpf(value.numerator) / value.denominator


def width_around(enclosure, true) -> int:
    assert enclosure[0] <= true * UNIT <= enclosure[1]
    return enclosure[1] - enclosure[0]


def places(low: float, high: float):
    random = Random(3)  # noqa: S311 - reproducible
    return [F(random.uniform(low, high)) for _ in range(200)] + [F(0), F(1, 3), F(1, 10**40), F(1), F(2)]


def test_exp_holds_the_true_value():
    for value in places(0, 140):
        assert width_around(exp_minus(value), mpmath.exp(-real(value))) < 2**10


def test_the_normal_distribution_holds_the_true_value():
    for value in [*places(-15, 15), F(13), F(-13), F(1301, 100), F(-20)]:
        narrow = width_around(normal(value), mpmath.ncdf(real(value)))
        assert narrow < UNIT >> 120


def cumulative(kind: str, at: Fraction) -> mpmath.mpf:
    """The probability of less than that, by formulas of mpmath."""
    phi = mpmath.ncdf
    x = real(at)
    return {
        "uniform:2:5": lambda: min(max((x - 2) / 3, 0), 1),
        "normal:3:2": lambda: phi((x - 3) / 2),
        "normal:3:2:1": lambda: phi((x - 3) / 2) - phi((2 - x - 3) / 2) if x > 1 else mpmath.mpf(0),
        "normal:3:2:1:clip": lambda: phi((x - 3) / 2) if x > 1 else mpmath.mpf(0),
        "half-normal:1:2": lambda: 2 * phi((x - 1) / 2) - 1 if x > 1 else mpmath.mpf(0),
        "truncated-normal:3:2:1:6": lambda: min(max(
            (phi((x - 3) / 2) - phi(-1)) / (phi(mpmath.mpf(3) / 2) - phi(-1)), 0), 1),
        "triangular:1:2:6": lambda: mpmath.mpf(0) if x < 1 else (x - 1) ** 2 / 5 if x < 2 else
            1 - (6 - x) ** 2 / 20 if x < 6 else mpmath.mpf(1),
        "exponential:3:1": lambda: 1 - mpmath.exp(-(x - 1) / 2) if x > 1 else mpmath.mpf(0),
        "constant:3": lambda: mpmath.mpf(x > 3),
    }[kind]()  # fmt: skip


KINDS = (
    "uniform:2:5",
    "normal:3:2",
    "normal:3:2:1",
    "normal:3:2:1:clip",
    "half-normal:1:2",
    "truncated-normal:3:2:1:6",
    "triangular:1:2:6",
    "exponential:3:1",
    "constant:3",
)


@pytest.mark.parametrize("kind", KINDS)
def test_probabilities_of_intervals_hold_the_true_value(kind):
    one = parse_distribution(kind, None, PLACE)
    assert str(one) == kind
    random = Random(kind)  # noqa: S311 - reproducible
    for _ in range(40):
        low, high = sorted(F(random.randint(-4000, 12000), 999) for _ in range(2))
        for lower, upper in ((low, high), (None, high), (low, None)):
            least, most = one.between(lower, upper)
            for value, mass in one.atoms:
                if (lower is None or lower < value) and (upper is None or value < upper):
                    least, most = least + mass[0], most + mass[1]
            true = (1 if upper is None else cumulative(kind, upper)) - (0 if lower is None else cumulative(kind, lower))
            # An atom below or at an open end counts with what is above it only.
            assert width_around((least, most), true) < UNIT >> 100
    whole = one.between(None, None)
    total = [whole[side] + sum(mass[side] for _, mass in one.atoms) for side in (0, 1)]
    assert total[0] <= UNIT <= total[1]


@pytest.mark.parametrize("kind", KINDS[:-1])
def test_densities_are_lines_up_to_the_factor_that_is_said(kind):
    """Ratios of probabilities of small intervals to those of the weights differ by no more than the factor."""
    one = parse_distribution(kind, None, PLACE)
    random, met = Random(kind), 0  # noqa: S311 - reproducible
    for _ in range(60):
        low = F(random.randint(1001, 4900), 1000)
        high = low + F(random.randint(1, 900), 1000)
        if high > 5 or any(low < at < high for at in one.breaks) or low < (one.support[0] or 0):
            continue
        found = one.weights(low, high)
        if found is None:
            continue
        first, last, ratio = found
        met += 1
        shares = []
        for step in range(10):
            left, right = F(step, 10), F(step + 1, 10)
            mass = one.between(low + (high - low) * left, low + (high - low) * right)
            line = first + (last - first) * (left + right) / 2
            shares.append([F(end, UNIT) / line for end in mass])
        assert max(least for least, _ in shares) <= ratio * min(most for _, most in shares)
        assert ratio < 3
    assert met > 20


@pytest.mark.parametrize("kind", KINDS)
def test_draws_follow_the_distribution(kind):
    """The share of draws below each decile is the decile's, up to five standard errors."""
    one = parse_distribution(kind, None, PLACE)
    random = Random(5)  # noqa: S311 - reproducible
    drawn = [one.draw(random, None) for _ in range(4000)]
    for at in (F(3, 2), F(5, 2), F(7, 2), F(9, 2)):
        expected = float(cumulative(kind, at))
        assert (
            abs(sum(value < at for value in drawn) / 4000 - expected) <= 5 * (expected * (1 - expected) / 4000) ** 0.5
        )
    on_grid = [one.draw(random) for _ in range(20)]
    assert all(1000 % value.denominator == 0 for value in on_grid)


def test_what_is_left_out_is_planned():
    assert parse_distribution("normal::5", F(30), PLACE).numbers == {"mean": 30, "deviation": 5}
    assert parse_distribution("constant", F(7), PLACE).numbers == {"value": 7}
    assert parse_distribution("normal:1:2:0:clip", None, PLACE).below is Below.CLIP
    assert parse_distribution("triangular:1::4", F(2), PLACE).numbers["mode"] == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("norml:1:2", "found distribution 'norml', expected one of constant"),
        ("normal:1:0", "found deviation 0, expected a number above 0"),
        ("normal:1:-1", "found deviation -1, expected a number above 0"),
        ("normal::1", "found no 'mean', expected normal:MEAN:DEVIATION:MINIMUM:BELOW"),
        ("normal:1", "found no 'deviation'"),
        ("normal:1:2:3:4", "found '4' for 'below', expected fold or clip"),
        ("normal:1:2:3:clip:5", "found 5 numbers, expected normal:MEAN"),
        ("normal:a:2", "found 'a', expected a number"),
        ("uniform:3:2", "found lower above upper"),
        ("triangular:1:5:4", "found mode above upper"),
        ("exponential:1:2", "found mean below minimum"),
        ("truncated-normal:0:1:50:60", "found almost nothing between minimum and maximum"),
        ("truncated-normal:0:1:5:4", "found minimum above maximum"),
    ],
)
def test_wrong_distributions_are_named(text, message):
    with pytest.raises(InputError) as caught:
        parse_distribution(text, None, PLACE)
    assert message in str(caught.value)
    assert str(caught.value).startswith("here: ")


def test_what_is_not_random_is_a_constant():
    assert Distribution("normal", {"mean": F(3), "deviation": F(0)}).settled.numbers == {"value": 3}
    assert Distribution("uniform", {"lower": F(3), "upper": F(3)}).settled.numbers == {"value": 3}
    assert Distribution("normal", {"mean": F(1), "deviation": F(0), "minimum": F(2)}).settled.numbers == {"value": 3}
