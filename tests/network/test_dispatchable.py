"""MinMaxDispatchTime: windows of all time points after any history, by an independent method."""

from fractions import Fraction
from random import Random

import pytest

from robust.errors import InputError
from robust.network.dispatchable import DispatchNetwork, Windows
from robust.plan.model import ZERO, TimePoint, TimePointKind
from tests.network.oracles import longest_paths


def windows_after(count, edges, *times, waits=()):
    """The windows of a network whose first time points happen at these times."""
    bounds = [(source, target, Fraction(weight)) for source, target, weight in edges]
    points = (ZERO, *(TimePoint(TimePointKind.INSTANT, f"p{number}") for number in range(1, count)))
    windows = Windows(DispatchNetwork(points, (), bounds, waits, closed=True))
    for point, time in enumerate(times):
        windows.happened(point, Fraction(time))
    return windows


def random_edges(random, count):
    """Bounds around a hidden schedule, so that there is one."""
    hidden = [Fraction(0), *(Fraction(random.randint(0, 60), random.choice([1, 2, 3])) for _ in range(count - 1))]
    edges = [(y, 0, Fraction(0)) for y in range(1, count)]
    for _ in range(random.randint(count, 3 * count)):
        x, y = random.sample(range(count), 2)
        edges.append((x, y, hidden[y] - hidden[x] + Fraction(random.randint(0, 20), random.choice([1, 2, 7]))))
    return edges, hidden


def test_a_closed_network_without_schedule_is_refused():
    with pytest.raises(InputError, match="no schedule"):
        windows_after(2, [(0, 1, 3), (1, 0, -4)])


def bounds_of(count, edges, fixed):
    """Least and greatest times of all points, given those that are fixed; edges are (a, b, most of b - a)."""
    every = [*edges]
    for point, time in fixed.items():
        every += [(0, point, time), (point, 0, -time)]
    greatest = longest_paths(range(count), [(a, b, -most) for a, b, most in every], 0)
    least = longest_paths(range(count), [(b, a, -most) for a, b, most in every], 0)
    return [(least.get(point), -greatest[point] if point in greatest else None) for point in range(count)]


@pytest.mark.parametrize("seed", range(60))
def test_windows_are_those_of_the_network_with_the_past_fixed(seed):
    random = Random(seed)  # noqa: S311 - reproducible
    count = random.randint(3, 8)
    edges, _ = random_edges(random, count)
    windows = windows_after(count, edges)
    fixed = {}
    for point in (0, *random.sample(range(1, count), count - 1)):
        lower, upper = windows.window(point) if point else (Fraction(0), Fraction(0))
        share = Fraction(random.randint(0, 5), 5)
        fixed[point] = lower + (min(upper, lower + 9) - lower if upper is not None else 4) * share
        windows.happened(point, fixed[point])
        expected = bounds_of(count, edges, fixed)
        future = [other for other in range(count) if other not in fixed]
        assert [windows.window(other) for other in future] == [expected[other] for other in future], (seed, point)
        assert windows.times == fixed


@pytest.mark.parametrize("seed", range(20))
def test_a_tightened_network_is_the_network_with_more_edges(seed):
    random = Random(f"tighten {seed}")  # noqa: S311 - reproducible
    count = random.randint(3, 7)
    edges, hidden = random_edges(random, count)
    x, y = random.sample(range(count), 2)
    more = (x, y, hidden[y] - hidden[x])
    windows = windows_after(count, edges, 0)
    tightened = windows.over(windows.network.tightened([more]))
    expected = bounds_of(count, [*edges, more], {0: Fraction(0)})
    assert [tightened.window(other) for other in range(1, count)] == expected[1:]


def test_who_comes_first_blocks_unless_both_coincide():
    windows = windows_after(3, [(1, 0, 0), (2, 1, -1)], 0)
    assert (windows.ready(1), windows.ready(2)) == (0, None)
    windows.happened(1, Fraction(2))
    assert windows.ready(2) == 3
    windows = windows_after(3, [(1, 0, 0), (1, 2, 0), (2, 1, 0)], 0)
    assert (windows.ready(1), windows.ready(2)) == (0, 0)


def test_a_wait_ends_with_what_is_waited_for_or_by_itself():
    edges = [(1, 0, 0), (2, 1, 0), (3, 1, 0)]
    for happens in (True, False):
        windows = windows_after(4, edges, 0, waits=[(3, 1, 2, Fraction(10))])
        assert windows.ready(3) is None
        windows.happened(1, Fraction(1))
        assert windows.ready(3) == 11
        if happens:
            windows.happened(2, Fraction(4))
            assert windows.ready(3) == 1
    assert windows_after(4, edges, 0, 1, waits=[(3, 1, 2, None)]).ready(3) is None
