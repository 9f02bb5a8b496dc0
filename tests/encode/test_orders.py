"""What is known of the order of time points, against brute-force Floyd–Warshall."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from robust.encode.network import Orders, common_scale
from robust.plan.model import TimePoint, TimePointKind

POINTS = [TimePoint(TimePointKind.INSTANT, name) for name in "abcde"]
A, B, C = POINTS[:3]
WEIGHTS = st.fractions(-3, 2, max_denominator=6)
EDGES = st.lists(st.tuples(st.sampled_from(POINTS), st.sampled_from(POINTS), WEIGHTS), max_size=12)
Known = dict[tuple[TimePoint, TimePoint], Fraction]


def longest(edges: list[tuple[TimePoint, TimePoint, Fraction]]) -> Known | None:
    """Longest paths; None if there is a positive cycle."""
    known: Known = {(point, point): Fraction(0) for point in POINTS}
    for a, b, weight in edges:
        known[a, b] = max(weight, known.get((a, b), weight))
    for middle, a, b in product(POINTS, POINTS, POINTS):
        if (a, middle) in known and (middle, b) in known:
            through = known[a, middle] + known[middle, b]
            known[a, b] = max(through, known.get((a, b), through))
    return None if any(known[point, point] > 0 for point in POINTS) else known


def orders_of(edges, *more) -> Orders:
    return Orders(POINTS, edges, common_scale(weight for _, _, weight in (*edges, *more)))


def assert_same(orders: Orders, known: Known) -> None:
    for a, b in product(POINTS, POINTS):
        assert orders.least(a, b) == known.get((a, b))
        assert orders.surely_before(a, b) == (known.get((a, b), Fraction(-1)) > 0)
        assert orders.surely_not_after(a, b) == (known.get((a, b), Fraction(-1)) >= 0)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(EDGES)
def test_bounds_are_longest_paths(edges) -> None:
    known = longest(edges)
    orders = orders_of(edges)
    assert orders.consistent == (known is not None)
    if known is not None:
        assert_same(orders, known)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(EDGES, st.lists(st.tuples(st.sampled_from(POINTS), st.sampled_from(POINTS), WEIGHTS), min_size=1, max_size=5))
def test_learning_is_the_same_as_having_known(edges, lessons) -> None:
    known = longest(edges)
    assume(known is not None)
    orders = orders_of(edges, *lessons)
    for lesson in lessons:
        first, second, weight = lesson
        together = longest([*edges, lesson])
        is_new = known.get((first, second)) is None or known[first, second] < weight
        assert orders.learn(*lesson) == (is_new and together is not None)
        if together is not None:
            known, edges = together, [*edges, lesson]
        assert_same(orders, known)


def test_equal_times_are_not_before_each_other() -> None:
    orders = orders_of([(A, B, Fraction(0)), (B, A, Fraction(0))])
    assert orders.surely_not_after(A, B)
    assert orders.surely_not_after(B, A)
    assert not orders.surely_before(A, B)
    assert orders.surely_not_after(C, C)
    assert orders.least(A, C) is None


def test_a_contradiction_is_told_and_not_learnt() -> None:
    assert not orders_of([(A, B, Fraction(1)), (B, A, Fraction(-1, 2))]).consistent
    orders = orders_of([(A, B, Fraction(1))])
    assert not orders.learn(B, A, Fraction(0))
    assert orders.least(B, A) is None
    assert orders.least(A, B) == 1


@pytest.mark.parametrize(("numbers", "scale"), [([], 1), ([Fraction(1, 4), Fraction(5, 6)], 12), ([Fraction(-3)], 1)])
def test_common_scale(numbers, scale) -> None:
    assert common_scale(numbers) == scale
