"""Linear constraints: normal form, negation, substitution and documents; intervals and boxes."""

from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError, UnsupportedError
from robust.plan.model import Duration, ParameterReference, Relation
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Interval, Side
from robust.qe.constraint import LinearConstraint, Sense, trim
from robust.smt.terms import Terms
from tests.plan.building import drawn
from tests.qe.polyhedra import NAMES, constraints, eq, grid, le, lt

GRID = grid(NAMES, reach=2)


def test_equal_half_spaces_are_equal_objects():
    assert le(3, x="2/3", y=-2) == le("9/2", y=-3, x=1)
    assert hash(le(3, x=6)) == hash(le("1/2", x=1))
    assert le(3, x=6) != lt(3, x=6)
    assert eq(2, x=-1, y=3) == eq(-2, x=1, y=-3)
    assert LinearConstraint.of({"x": 2}, ">=", 4) == le(-4, x=-2)
    assert LinearConstraint.of({"x": 2}, ">", 4) == lt(-2, x=-1)


def test_coefficients_are_coprime_integers_of_different_parameters():
    constraint = le("1/2", x="4/3", y=2, z=0)
    assert constraint.coefficients == (("x", Fraction(2)), ("y", Fraction(3)))
    assert constraint.constant == Fraction(3, 4)
    with pytest.raises(InputError, match="names a parameter twice: x, x"):
        LinearConstraint((("x", Fraction(1)), ("x", Fraction(2))), Sense.LESS, Fraction(1))


@pytest.mark.parametrize(("constraint", "truth"), [(le(0), True), (lt(0), False), (le(-2), False), (eq(1), False)])
def test_constants_are_decided(constraint, truth):
    assert constraint.is_true is truth
    assert constraint.is_false is not truth
    assert constraint.evaluate({}) is truth


@drawn(80)
@given(constraints(NAMES), st.fractions(-3, 3, max_denominator=4))
def test_negation_substitution_and_documents(constraint, value):
    reduced = constraint.substitute({"y": value})
    assert "y" not in reduced.parameters
    for point in GRID:
        holding = [side.evaluate(point) for side in constraint.negation()]
        assert sum(holding) == (0 if constraint.evaluate(point) else 1)
        assert reduced.evaluate(point) == constraint.evaluate({**point, "y": value})
    assert LinearConstraint.from_dict(constraint.as_dict()) == constraint
    relations = {Sense.AT_MOST: Relation.AT_LEAST, Sense.LESS: Relation.GREATER, Sense.EQUAL: Relation.EQUAL}
    assert LinearConstraint.from_polynomial(constraint.as_polynomial(), relations[constraint.relation]) == constraint
    for half in constraint.halves() if constraint.coefficients else ():
        assert half.opposite(half.relation).opposite(half.relation) == half


@pytest.mark.parametrize(
    "document",
    [
        {},
        {"coefficients": {"x": "1"}, "relation": ">=", "constant": "1"},
        {"coefficients": {"x": 0.1}, "relation": "<=", "constant": "1"},
        {"coefficients": {"x": "1/0"}, "relation": "<=", "constant": "1"},
        {"coefficients": ["x"], "relation": "<=", "constant": "1"},
        {"coefficients": {"x": "1"}, "relation": "<=", "constant": True},
    ],
)
def test_bad_documents_are_refused(document):
    with pytest.raises(InputError, match="cannot read the constraint"):
        LinearConstraint.from_dict(document)


def test_only_linear_expressions_over_parameters():
    x = Polynomial.variable(ParameterReference("x"))
    for expression, relation in [
        (x * x, Relation.AT_LEAST),
        (x, Relation.DIFFERENT),
        (Polynomial.variable(Duration()), Relation.EQUAL),
    ]:
        with pytest.raises(UnsupportedError, match="not a constraint of a polyhedron"):
            LinearConstraint.from_polynomial(expression, relation)


def test_texts_and_formulas():
    assert str(le("7/4", x=2, y=-1)) == "2·x - y ≤ 7/4"
    assert str(lt(-3, x=-1)) == "x > 3"
    assert str(eq(0, x=1, y=1)) == "x + y = 0"
    assert str(le(1)) == "true"
    assert str(LinearConstraint.false()) == "false"
    terms = Terms()
    assert str(le(4, x=-1).to_formula(terms)) == "(0.0 <= (x + 4.0))"
    assert le(4).to_formula(terms) is terms.true


def test_trim_keeps_the_tightest():
    assert trim([le(3, x=1), lt(2, x=1), le(2, x=1), le(5), le(1, x=-1)]) == (lt(2, x=1), le(1, x=-1))
    assert trim([eq(1, x=1), eq(2, x=1)]) == (LinearConstraint.false(),)
    assert trim([eq(2, x=1), eq(1, x=1)]) == (LinearConstraint.false(),)
    assert trim([eq(1, x=1), eq(2, x=2), lt(0)]) == (LinearConstraint.false(),)


# -- intervals and boxes, against points of a grid that is finer than their ends ---------------------------------------

ENDS = (None, Fraction(0), Fraction(1), Fraction(2))
HALVES = [Fraction(n, 2) for n in range(-4, 9)]


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
    inside = {id(one): {value for value in HALVES if value in one} for one in INTERVALS}
    for one in INTERVALS:
        assert inside[id(one)] == {value for value in HALVES if holds(one, value)}
        assert one.some_value() in one
        assert one.width == (None if None in (one.lower, one.upper) else one.upper - one.lower)
    for one, other in product(INTERVALS, INTERVALS):
        assert one.is_within(other) == (inside[id(one)] <= inside[id(other)]), (one, other)


def test_boxes_are_what_their_constraints_say():
    for one, other in product(INTERVALS[::3], INTERVALS[::2]):
        box = Box({"x": one, "y": other})
        sides = list(box.constraints())
        assert len(sides) == sum(end is not None for ends in box.ranges.values() for end in ends)
        for x, y in product(HALVES[::2], HALVES[1::3]):
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
