"""Intervals and boxes against points of a grid that is finer than their ends."""

from fractions import Fraction
from itertools import product

import pytest

from robust.errors import InputError
from robust.qe.box import Box, Interval, Side

ENDS = (None, Fraction(0), Fraction(1), Fraction(2))
GRID = [Fraction(n, 2) for n in range(-4, 9)]


def intervals() -> list[Interval]:
    found = []
    for lower, upper, *closed in product(ENDS, ENDS, (False, True), (False, True)):
        try:
            found.append(Interval(lower, upper, *closed))
        except InputError:
            assert lower >= upper
            assert lower > upper or not all(closed)
    return found


INTERVALS = intervals()


def holds(interval: Interval, value: Fraction) -> bool:
    """As it is written: brackets belong to the interval, parentheses do not."""
    text = str(interval)
    lower, upper = (float(end) for end in text[1:-1].split(", "))
    above = value >= lower if text[0] == "[" else value > lower
    return above and (value <= upper if text[-1] == "]" else value < upper)


def test_membership_and_inclusion():
    assert len(INTERVALS) == 4 * (1 + 3 + 3 + 3) + 3
    inside = {id(one): {value for value in GRID if value in one} for one in INTERVALS}
    for one in INTERVALS:
        assert inside[id(one)] == {value for value in GRID if holds(one, value)}
        assert one.some_value() in one
        assert one.width == (None if None in (one.lower, one.upper) else one.upper - one.lower)
    for one, other in product(INTERVALS, INTERVALS):
        assert one.is_within(other) == (inside[id(one)] <= inside[id(other)]), (one, other)


def test_boxes_are_what_their_constraints_say():
    for one, other in product(INTERVALS[::3], INTERVALS[::2]):
        box = Box({"x": one, "y": other})
        sides = list(box.constraints())
        assert len(sides) == sum(end is not None for ends in box.ranges.values() for end in ends)
        for x, y in product(GRID[::2], GRID[1::3]):
            point = {"x": x, "y": y}
            assert (point in box) == (x in one and y in other) == all(side.evaluate(point) for side in sides)


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("closed", [False, True])
def test_one_end_moves_and_the_other_stays(side, closed):
    other = Side.LOWER if side is Side.UPPER else Side.UPPER
    for one in (Interval(Fraction(-5), Fraction(5), False, True), Interval(Fraction(-5), Fraction(5), True, False)):
        for end in (Fraction(1), None):
            moved = Box({"x": one}).moved(("x", side), end, closed=closed)["x"]
            assert (moved.end(side), moved.is_closed_at(side)) == (end, closed)
            assert (moved.end(other), moved.is_closed_at(other)) == (one.end(other), one.is_closed_at(other))


def test_widths_add_up():
    box = Box({"x": Interval(Fraction(1), Fraction(3)), "y": Interval(Fraction(0), Fraction(1, 2), False, False)})
    assert box.total_width == Fraction(5, 2)
    assert box.replace("y", Interval(Fraction(0), None)).total_width is None
    assert Box({}).total_width == 0
