"""Numbers as people read them."""

from fractions import Fraction

import pytest

from robust.numbers import approximate, duration, end, exact_end, plural, readable


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("7/4", "1.75"),
        ("-3", "−3"),
        ("1/3", "1/3"),
        ("1/1000", "0.001"),
        ("123456789", "123456789"),
        ("100000/3", "100000/3"),
        ("1000000/7", "1000000/7"),
        ("10000000/7", "≈1.42857e+06"),
        ("-12345678901/1000", "≈−1.23457e+07"),
        ("1/3000000000", "≈3.33333e−10"),
        (f"{10**400}", "≈inf"),
    ],
)
def test_readable(value, text):
    assert readable(Fraction(value)) == text


def test_ends():
    assert end(None, upper=True) == "∞"
    assert end(None, upper=False) == "−∞"
    assert end(Fraction(2), upper=True, closed=False) == "< 2"
    assert exact_end(None, upper=True) == "inf"
    assert exact_end(None, upper=False) == "-inf"
    assert exact_end(Fraction(7, 4), upper=False) == "7/4"


def test_others():
    assert approximate(Fraction(-(10**400))) == float("-inf")
    assert [duration(seconds) for seconds in (0.123, 61, 7300)] == ["0.12 s", "1 min 1 s", "2 h 1 min"]
    assert [plural(count, "check") for count in (0, 1, 2)] == ["0 checks", "1 check", "2 checks"]
