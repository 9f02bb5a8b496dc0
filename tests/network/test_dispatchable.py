"""MinMaxDispatchTime: windows of all time points after any history, by an independent method."""

from fractions import Fraction
from random import Random

import pytest

from robust.errors import InputError
from robust.network.dispatchable import DispatchNetwork, Windows
from robust.plan.model import ZERO
from tests.network.oracles import longest_paths, point


def windows_after(count, edges, *times, waits=()):
    """The windows of a network whose first time points happen at these times."""
    bounds = [(source, target, Fraction(weight)) for source, target, weight in edges]
    points = (ZERO, *(point(f"p{number}") for number in range(1, count)))
    windows = Windows(DispatchNetwork(points, (), bounds, waits, closed=True))
    for number, time in enumerate(times):
        windows.happened(number, Fraction(time))
    return windows


def test_a_closed_network_without_schedule_is_refused():
    with pytest.raises(InputError, match="no schedule"):
        windows_after(2, [(0, 1, 3), (1, 0, -4)])


def bounds_of(count, edges, fixed):
    """Least and greatest times of points that are not fixed; edges are (a, b, most of b - a)."""
    known = [(a, b, sign * time) for number, time in fixed.items() for a, b, sign in ((0, number, 1), (number, 0, -1))]
    greatest = longest_paths(range(count), [(a, b, -most) for a, b, most in [*edges, *known]], 0)
    least = longest_paths(range(count), [(b, a, -most) for a, b, most in [*edges, *known]], 0)
    future = (number for number in range(count) if number not in fixed)
    return {number: (least.get(number), -greatest[number] if number in greatest else None) for number in future}


@pytest.mark.parametrize("seed", range(60))
def test_windows_are_those_of_the_network_with_the_past_fixed_and_with_tighter_bounds(seed):
    random = Random(seed)  # noqa: S311 - reproducible
    count = random.randint(3, 8)
    hidden = [Fraction(0), *(Fraction(random.randint(0, 60), random.choice([1, 2, 3])) for _ in range(count - 1))]
    edges = [(number, 0, Fraction(0)) for number in range(1, count)]
    for _ in range(random.randint(count, 3 * count)):
        x, y = random.sample(range(count), 2)
        edges.append((x, y, hidden[y] - hidden[x] + Fraction(random.randint(0, 20), random.choice([1, 2, 7]))))
    windows, fixed = windows_after(count, edges), {}
    for number in (0, *random.sample(range(1, count), count - 1)):
        lower, upper = windows.window(number) if number else (Fraction(0), Fraction(0))
        share = Fraction(random.randint(0, 5), 5)
        fixed[number] = lower + (min(upper, lower + 9) - lower if upper is not None else 4) * share
        windows.happened(number, fixed[number])
        expected = bounds_of(count, edges, fixed)
        assert {other: windows.window(other) for other in expected} == expected, (seed, number)
        assert windows.times == fixed
    x, y = random.sample(range(count), 2)
    more = (x, y, hidden[y] - hidden[x])
    windows = windows_after(count, edges, 0)
    tightened = windows.over(windows.network.tightened([more]))
    expected = bounds_of(count, [*edges, more], {0: Fraction(0)})
    assert {other: tightened.window(other) for other in expected} == expected


def test_who_comes_first_blocks_unless_both_coincide():
    windows = windows_after(3, [(1, 0, 0), (2, 1, -1)], 0)
    assert (windows.ready(1), windows.ready(2)) == (0, None)
    windows.happened(1, Fraction(2))
    assert windows.ready(2) == 3
    windows = windows_after(3, [(1, 0, 0), (1, 2, 0), (2, 1, 0)], 0)
    assert (windows.ready(1), windows.ready(2)) == (0, 0)


@pytest.mark.parametrize("happens", [True, False])
def test_a_wait_ends_with_what_is_waited_for_or_by_itself(happens):
    edges = [(1, 0, 0), (2, 1, 0), (3, 1, 0)]
    windows = windows_after(4, edges, 0, waits=[(3, 1, 2, Fraction(10))])
    assert windows.ready(3) is None
    windows.happened(1, Fraction(1))
    assert windows.ready(3) == 11
    if happens:
        windows.happened(2, Fraction(4))
        assert windows.ready(3) == 1
    assert windows_after(4, edges, 0, 1, waits=[(3, 1, 2, None)]).ready(3) is None
