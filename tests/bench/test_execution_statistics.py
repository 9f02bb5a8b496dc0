"""Statistics against published values, scipy where it is there, and brute force."""

from fractions import Fraction
from itertools import product

import pytest

from robust.bench.execution_statistics import Mean, Pairing, Proportion, student_quantile


def test_wilson_intervals():
    # Newcombe (1998), Table I, method 3: 81/263, 15/148, 0/20, 1/29.
    for successes, trials, lower, upper in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ):
        assert Proportion(successes, trials).interval() == pytest.approx((lower, upper), abs=5e-5)
        low, high = Proportion(trials - successes, trials).interval()
        assert (1 - high, 1 - low) == pytest.approx((lower, upper), abs=5e-5)
    assert Proportion(92, 100).share == Fraction(23, 25)
    assert Proportion(5, 5).interval()[1] == 1
    for successes, trials in ((0, 0), (-1, 3), (4, 3)):
        with pytest.raises(ValueError, match="no proportion"):
            Proportion(successes, trials)


def test_mcnemar_by_brute_force():
    assert Pairing.of([(True, False)] * 6 + [(False, True)] + [(True, True), (False, False)]) == Pairing(6, 1, 1, 1)
    for first, second in product(range(7), repeat=2):
        count = first + second
        observed = abs(first - second)
        as_uneven = sum(abs(2 * sum(wins) - count) >= observed for wins in product((0, 1), repeat=count))
        assert Pairing(first, second, 3, 4).p_value == Fraction(as_uneven, 2**count)
    assert Pairing(121, 59, 0, 0).p_value == pytest.approx(4.434e-06, rel=2e-2)


def test_student_quantiles():
    # Tables of the 97.5 % quantile.
    for degrees, value in ((1, 12.7062), (2, 4.3027), (3, 3.1824), (4, 2.7764), (10, 2.2281), (99, 1.9842)):
        assert student_quantile(0.975, degrees) == pytest.approx(value, abs=1e-4)
    assert student_quantile(0.5, 7) == pytest.approx(0, abs=1e-9)
    stats = pytest.importorskip("scipy.stats")
    for degrees in range(1, 40):
        for probability in (0.6, 0.9, 0.975, 0.995):
            assert student_quantile(probability, degrees) == pytest.approx(stats.t.ppf(probability, degrees), rel=1e-7)
    with pytest.raises(ValueError, match="no quantile"):
        student_quantile(0.3, 2)


def test_means():
    assert Mean.of([]) is None
    assert Mean.of([2.0]) == Mean(2.0, None)
    mean = Mean.of([1.0, 2.0, 3.0])
    assert mean is not None
    assert mean.value == 2
    assert mean.interval == pytest.approx((2 - 4.3027 / 3**0.5, 2 + 4.3027 / 3**0.5), abs=1e-4)
