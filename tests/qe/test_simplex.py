"""Exact linear programs against z3's optimiser, and constraints against boxes in integers against linear programs."""

from collections import Counter
from fractions import Fraction
from itertools import product
from pathlib import Path
from unittest.mock import Mock

import pytest
import z3
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError, UnsupportedError
from robust.irr.widen import Least, least_stretch
from robust.plan.model import Duration, ParameterReference, Relation
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Face, Growing, Interval, Side
from robust.qe.constraint import LinearConstraint, Sense, trim
from robust.qe.polyhedron import Polyhedron
from robust.qe.simplex import Tableau, feasible_point, maximize, tableau
from robust.smt.session import Terms
from tests.plan.building import drawn, groups
from tests.qe import polyhedra
from tests.qe.polyhedra import NAMES, constraints, eq, grid, le, lt, number, polygon


@drawn(40, 60)
@given(polyhedra.polyhedra(NAMES), st.tuples(*(st.fractions(-2, 2, max_denominator=3) for _ in NAMES)))
def test_optima_agree_with_z3(polyhedron, weights):
    objective = dict(zip(NAMES, weights, strict=True))
    form = z3.Sum([number(weight) * polyhedra.SYMBOLS[name] for name, weight in objective.items()])
    inside = polyhedra.as_z3(polyhedron)
    point = feasible_point(NAMES, polyhedron.constraints)
    result = maximize(NAMES, polyhedron.constraints, objective)
    if point is None:
        assert polyhedra.is_valid(z3.Not(inside))
        assert result is None
        return
    assert point in polyhedron
    assert result is not None
    optimiser = z3.Optimize()
    optimiser.add(polyhedra.as_z3(polyhedron.closure()))
    handle = optimiser.maximize(form)
    assert optimiser.check() == z3.sat
    bound = optimiser.upper(handle)
    if result.value is None:
        assert str(bound) == "oo"
    else:
        assert Fraction(str(bound)) == result.value
        assert sum(weight * result.point[name] for name, weight in objective.items()) == result.value
        assert result.attained == (not polyhedra.is_valid(z3.Implies(inside, form != number(result.value))))
        assert not result.attained or result.point in polyhedron.closure()


def test_strict_and_closed_ends_no_parameters_and_contradictory_equalities():
    over = {"x": Fraction(2)}
    assert maximize(("x",), [lt(3, x=1)], over).value == 6
    assert not maximize(("x",), [lt(3, x=1)], over).attained
    assert maximize(("x",), [le(3, x=1)], over).attained
    assert maximize(("x",), [le(3, x=-1)], over).value is None
    assert maximize(("x",), [lt(3, x=1), le(-3, x=-1)], over) is None
    sides = [le(1, x=1), le(1, y=1), lt(2, x=1, y=1)]
    assert maximize(("x", "y"), sides, {"x": Fraction(1)}).attained
    corner = maximize(("x", "y"), sides, {"x": Fraction(1), "y": Fraction(2)})
    assert (corner.value, corner.attained) == (3, False)
    assert feasible_point((), []) == {}
    assert feasible_point((), [le(-1)]) is None
    assert maximize((), [], {}).value == 0
    assert feasible_point(("x", "y"), [eq(1, x=1, y=1), eq(3, x=2, y=2)]) is None
    assert feasible_point(("x", "y"), [eq(1, x=1, y=1), eq(2, x=2, y=2)]) is not None


def test_a_copy_is_independent_and_conflicts_name_their_constraints():
    solved = tableau(("x",), [le(3, x=1)])
    assert solved.restore()
    twin = solved.copy()
    twin.add((-1,), Sense.LESS, -3)
    assert not twin.restore()
    assert solved.restore()
    assert solved.point() == (Fraction(3),)
    solved = Tableau(2)
    first = solved.add((1, 0), Sense.AT_MOST, 1)
    solved.add((0, 1), Sense.AT_MOST, 1)
    second = solved.add((-1, 0), Sense.LESS, -1)
    assert not solved.restore()
    assert solved.conflict == {first, second}
    assert solved.only_strictly


CIRCLES = groups(Path(__file__).with_name("circles.txt"))


@pytest.mark.parametrize("rule", CIRCLES)
def test_degenerate_programs_end(rule, monkeypatch):
    """Where Bland's rule would have been done long ago."""
    *forms, objective = ([int(number) for number in row.split()] for row in CIRCLES[rule].splitlines())
    forms += [*([-int(i == j) for i in range(5)] + [0] for j in range(5)), [1] * 6]
    pivots = Mock(side_effect=Tableau._pivot)
    monkeypatch.setattr(Tableau, "_pivot", lambda *arguments: pivots(*arguments) if pivots.call_count < 60 else 1 / 0)
    solved = Tableau(5)
    for *form, bound in forms:
        solved.add(form, Sense.AT_MOST, bound)
    assert solved.restore()
    optimum = solved.maximize(objective)
    assert optimum.is_attained
    assert all(sum(c * x for c, x in zip(form, optimum.point, strict=False)) <= form[5] for form in forms)


def test_of_equal_bounds_the_strict_one_decides():
    """The ratio test compares multiples of the infinitesimal as well, in proportion to the coefficients."""
    for sides, objective, bound in (
        ([((0, 2), "<=", 1), ((0, -1), "<=", 0), ((0, -1), "<", 0)], (0, -2), 0),
        ([((0, 2), "<=", 2), ((0, -1), "<", 0), ((0, -2), "<=", 0)], (0, -2), 0),
        ([((1, 1), "<", 2), ((1, -1), "<=", 2), ((-1, -1), "<", 0), ((-1, -2), "<=", 1)], (0, -1), 1),
    ):
        solved = Tableau(2)
        for form, sense, constant in sides:
            solved.add(form, Sense(sense), constant)
        assert solved.restore()
        optimum = solved.maximize(objective)
        assert (optimum.value, optimum.is_attained) == (bound, False)


ends = st.none() | st.fractions(-3, 3, max_denominator=3)
STRETCH = "stretch"


@st.composite
def intervals(draw: st.DrawFn) -> Interval:
    low, high = draw(ends), draw(ends)
    if low is not None and high is not None and low >= high:
        return Interval(high, low) if draw(st.booleans()) else Interval(low, low)
    return Interval(low, high, draw(st.booleans()), draw(st.booleans()))


@st.composite
def pieces(draw: st.DrawFn) -> Polyhedron:
    """Often what faces itself, or speaks of other parameters."""
    first = draw(polyhedra.constraints(NAMES[:2]))
    negated = tuple((name, -factor) for name, factor in first.coefficients)
    facing = LinearConstraint(negated, first.relation, Fraction(draw(st.integers(-3, 6))))
    other = draw(polyhedra.constraints(draw(st.sampled_from([NAMES[2:], NAMES]))))
    return Polyhedron(NAMES, tuple(draw(st.lists(st.sampled_from([first, facing, other]), min_size=1, max_size=3))))


boxes = st.tuples(*(intervals() for _ in NAMES)).map(lambda each: Box(dict(zip(NAMES, each, strict=True))))
speeds = st.lists(st.fractions(Fraction(1, 3), 3, max_denominator=3), min_size=6, max_size=6)


def by_simplex(piece: Polyhedron, box: Box, moving: dict[Face, tuple[Fraction, Fraction]]) -> Least | None:
    """The least stretch as a linear program."""
    rows = [*piece.constraints, le(0, **{STRETCH: -1})]
    for name, side in product(box.intervals, Side):
        base, speed = moving.get((name, side), (box[name].end(side), 0))
        if base is not None:
            relation = "<=" if speed or box[name].is_closed_at(side) else "<"
            rows.append(LinearConstraint.of({name: side.sign, STRETCH: -speed}, relation, side.sign * base))
    best = maximize([*NAMES, STRETCH], rows, {STRETCH: Fraction(-1)})
    return None if best is None else Least(-best.value, best.attained)


@pytest.mark.parametrize("count", [80, pytest.param(3000, marks=pytest.mark.slow)])
def test_boxes_meet_pieces_and_stretch_as_linear_programs_say(count) -> None:
    kinds: Counter[tuple[bool, object]] = Counter()

    @drawn(count)
    @given(pieces(), boxes)
    def meet(piece: Polyhedron, box: Box) -> None:
        meets = feasible_point(NAMES, [*piece.constraints, *box.constraints()]) is not None
        assert piece.meets(box) is meets
        kinds[piece.slabs.exact, meets] += 1

    @drawn(count)
    @given(pieces(), boxes, speeds, st.lists(st.booleans(), min_size=6, max_size=6))
    def stretch(piece: Polyhedron, box: Box, pace: list[Fraction], moved: list[bool]) -> None:
        faces = [(name, side) for name in NAMES for side in Side]
        moving = {
            face: (end, speed)
            for face, speed, chosen in zip(faces, pace, moved, strict=True)
            if chosen and (end := box[face[0]].end(face[1])) is not None
        }
        least = least_stretch(piece, Growing(box, moving))
        assert least == by_simplex(piece, box, moving)
        kind = "never" if least is None else "at once" if least == Least(Fraction(0), True) else "later"
        kinds[piece.slabs.exact, kind] += 1

    meet()
    stretch()
    assert len(kinds) >= 9, kinds  # of 2 · 2 and 2 · 3


def test_what_is_decided_without_a_search() -> None:
    facing = (le(3, x=1, y=2), lt(-1, x=-1, y=-2))
    assert polygon(*facing).slabs.exact
    assert polygon(eq(2, x=1), le(1, y=1)).slabs.exact
    assert not polygon(*facing, le(1, y=1)).slabs.exact
    assert not polygon(le(3, x=1), le(3, x=1, y=1)).slabs.exact
    assert not polygon(le(1, x=1), lt(-1, x=-1)).slabs.exact
    box = Box.point(dict.fromkeys(NAMES, Fraction(1)))
    assert not Polyhedron.nothing(NAMES).meets(box)
    assert Polyhedron.universe(NAMES).meets(box)


GRID = grid(NAMES, reach=2)


def test_equal_half_spaces_are_equal_objects_of_coprime_integers():
    assert le(3, x="2/3", y=-2) == le("9/2", y=-3, x=1)
    assert hash(le(3, x=6)) == hash(le("1/2", x=1))
    assert le(3, x=6) != lt(3, x=6)
    assert eq(2, x=-1, y=3) == eq(-2, x=1, y=-3)
    assert LinearConstraint.of({"x": 2}, ">=", 4) == le(-4, x=-2)
    assert LinearConstraint.of({"x": 2}, ">", 4) == lt(-2, x=-1)
    constraint = le("1/2", x="4/3", y=2, z=0)
    assert constraint.coefficients == (("x", Fraction(2)), ("y", Fraction(3)))
    assert constraint.constant == Fraction(3, 4)
    with pytest.raises(InputError, match="names a parameter twice: x, x"):
        LinearConstraint((("x", Fraction(1)), ("x", Fraction(2))), Sense.LESS, Fraction(1))


@drawn(40, 80)
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


def test_bad_documents_and_what_is_not_linear_over_parameters_are_refused():
    good = {"coefficients": {"x": "1"}, "relation": "<=", "constant": "1"}
    assert LinearConstraint.from_dict(good) == le(1, x=1)
    changes = [{"coefficients": bad} for bad in ({"x": 0.1}, {"x": "1/0"}, ["x"])]
    changes += [{"relation": ">="}, {"constant": True}]
    for document in ({}, *(good | change for change in changes)):
        with pytest.raises(InputError, match="cannot read the constraint"):
            LinearConstraint.from_dict(document)
    x, duration = Polynomial.variable(ParameterReference("x")), Polynomial.variable(Duration())
    for expression, relation in ((x * x, Relation.AT_LEAST), (x, Relation.DIFFERENT), (duration, Relation.EQUAL)):
        with pytest.raises(UnsupportedError, match="not a constraint of a polyhedron"):
            LinearConstraint.from_polynomial(expression, relation)


def test_texts_formulas_constants_and_trimming():
    for constraint, truth in ((le(0), True), (lt(0), False), (le(-2), False), (eq(1), False)):
        assert constraint.is_true is constraint.evaluate({}) is truth
        assert constraint.is_false is not truth
    assert str(le("7/4", x=2, y=-1)) == "2·x - y ≤ 7/4"
    assert str(lt(-3, x=-1)) == "x > 3"
    assert str(eq(0, x=1, y=1)) == "x + y = 0"
    assert str(le(1)) == "true"
    assert str(LinearConstraint.false()) == "false"
    terms = Terms()
    assert str(le(4, x=-1).to_formula(terms)) == "(0.0 <= (x + 4.0))"
    assert le(4).to_formula(terms) is terms.true
    # Of several constraints of one form the tightest is kept.
    assert trim([le(3, x=1), lt(2, x=1), le(2, x=1), le(5), le(1, x=-1)]) == (lt(2, x=1), le(1, x=-1))
    assert trim([eq(1, x=1), eq(2, x=1)]) == (LinearConstraint.false(),)
    assert trim([eq(2, x=1), eq(1, x=1)]) == (LinearConstraint.false(),)
    assert trim([eq(1, x=1), eq(2, x=2), lt(0)]) == (LinearConstraint.false(),)


HALVES = [Fraction(n, 2) for n in range(-4, 9)]
ENDS, INTERVALS = (None, *map(Fraction, range(3))), []
for low, high, *sides in product(ENDS, ENDS, (False, True), (False, True)):
    if None in (low, high) or low < high or (low == high and all(sides)):
        INTERVALS.append(Interval(low, high, *sides))
    else:
        with pytest.raises(InputError):
            Interval(low, high, *sides)


def holds(interval: Interval, value: Fraction) -> bool:
    """As it is written: brackets belong to the interval, parentheses do not."""
    text = str(interval)
    lower, upper = (float(end) for end in text[1:-1].split(", "))
    above = value >= lower if text[0] == "[" else value > lower
    return above and (value <= upper if text[-1] == "]" else value < upper)


def test_membership_and_inclusion_and_boxes_are_what_their_constraints_say():
    """Of points of a grid that is finer than the ends."""
    assert len(INTERVALS) == 4 * (1 + 3 + 3 + 3) + 3
    inside = {id(one): {value for value in HALVES if value in one} for one in INTERVALS}
    for one in INTERVALS:
        assert inside[id(one)] == {value for value in HALVES if holds(one, value)}
        assert one.some_value() in one
        assert one.width == (None if None in (one.lower, one.upper) else one.upper - one.lower)
    for one, other in product(INTERVALS, INTERVALS):
        assert one.is_within(other) == (inside[id(one)] <= inside[id(other)]), (one, other)
    for one, other in product(INTERVALS[::3], INTERVALS[::2]):
        box = Box({"x": one, "y": other})
        sides = list(box.constraints())
        assert len(sides) == sum(end is not None for ends in box.ranges.values() for end in ends)
        for x, y in product(HALVES[::2], HALVES[1::3]):
            point = {"x": x, "y": y}
            assert (point in box) == (x in one and y in other) == all(side.evaluate(point) for side in sides)


@pytest.mark.parametrize(("side", "other"), [(Side.LOWER, Side.UPPER), (Side.UPPER, Side.LOWER)])
def test_one_end_moves_and_the_other_stays(side, other):
    for closed, end, first in product((False, True), (Fraction(1), None), (False, True)):
        interval = Interval(Fraction(-5), Fraction(5), first, not first)
        moved = Box({"x": interval}).moved(("x", side), end, closed=closed)["x"]
        assert (moved.end(side), moved.is_closed_at(side)) == (end, closed)
        assert (moved.end(other), moved.is_closed_at(other)) == (interval.end(other), interval.is_closed_at(other))
    # Widths add up.
    box = Box({"x": Interval(Fraction(1), Fraction(3)), "y": Interval(Fraction(0), Fraction(1, 2), False, False)})
    assert box.total_width == Fraction(5, 2)
    assert box.replace("y", Interval(Fraction(0), None)).total_width is None
    assert Box({}).total_width == 0
