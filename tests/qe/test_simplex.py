"""Exact linear programs against z3's optimiser, and constraints against boxes in integers against linear programs."""

from collections import Counter
from fractions import Fraction
from pathlib import Path

import pytest
import z3
from hypothesis import given
from hypothesis import strategies as st

from robust.irr.widen import Least, least_stretch
from robust.qe.box import Box, Face, Interval, Side
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.polyhedron import Polyhedron
from robust.qe.simplex import Tableau, feasible_point, maximize, tableau
from robust.qe.slabs import Growing
from tests.plan.building import drawn, groups
from tests.qe import polyhedra
from tests.qe.polyhedra import NAMES, eq, le, lt, number, polygon


@drawn(60)
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


def test_strict_and_closed_ends():
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


def test_no_parameters_and_contradictory_equalities():
    assert feasible_point((), []) == {}
    assert feasible_point((), [le(-1)]) is None
    assert maximize((), [], {}).value == 0
    assert feasible_point(("x", "y"), [eq(1, x=1, y=1), eq(3, x=2, y=2)]) is None
    assert feasible_point(("x", "y"), [eq(1, x=1, y=1), eq(2, x=2, y=2)]) is not None


def test_a_copy_is_independent():
    solved = tableau(("x",), [le(3, x=1)])
    assert solved.restore()
    twin = solved.copy()
    twin.add((-1,), Sense.LESS, -3)
    assert not twin.restore()
    assert solved.restore()
    assert solved.point() == (Fraction(3),)


def test_conflicts_name_their_constraints():
    solved = Tableau(2)
    first = solved.add((1, 0), Sense.AT_MOST, 1)
    solved.add((0, 1), Sense.AT_MOST, 1)
    second = solved.add((-1, 0), Sense.LESS, -1)
    assert not solved.restore()
    assert solved.conflict == {first, second}
    assert solved.only_strictly


CIRCLES = groups(Path(__file__).with_name("circles.txt"))


class Counting(Tableau):
    """Ends where Bland's rule would have been done long ago."""

    pivots = 0

    def _pivot(self, leaving: int, column: int) -> None:
        self.pivots += 1
        assert self.pivots < 60
        super()._pivot(leaving, column)


@pytest.mark.parametrize("rule", CIRCLES)
def test_degenerate_programs_end(rule):
    *forms, objective = ([int(number) for number in row.split()] for row in CIRCLES[rule].splitlines())
    forms += [*([-int(i == j) for i in range(5)] + [0] for j in range(5)), [1] * 6]
    counting = Counting(5)
    for *form, bound in forms:
        counting.add(form, Sense.AT_MOST, bound)
    assert counting.restore()
    optimum = counting.maximize(objective)
    assert optimum.is_attained
    assert all(sum(c * x for c, x in zip(form, optimum.point, strict=False)) <= form[5] for form in forms)


@pytest.mark.parametrize(
    ("sides", "objective", "bound"),
    [
        ([((0, 2), "<=", 1), ((0, -1), "<=", 0), ((0, -1), "<", 0)], (0, -2), 0),
        ([((0, 2), "<=", 2), ((0, -1), "<", 0), ((0, -2), "<=", 0)], (0, -2), 0),
        ([((1, 1), "<", 2), ((1, -1), "<=", 2), ((-1, -1), "<", 0), ((-1, -2), "<=", 1)], (0, -1), 1),
    ],
)
def test_of_equal_bounds_the_strict_one_decides(sides, objective, bound):
    """The ratio test compares multiples of the infinitesimal as well, in proportion to the coefficients."""
    solved = Tableau(2)
    for form, sense, constant in sides:
        solved.add(form, Sense(sense), constant)
    assert solved.restore()
    optimum = solved.maximize(objective)
    assert (optimum.value, optimum.is_attained) == (bound, False)


# -- constraints against boxes, in integers ----------------------------------------------------------------------------

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
    for name, interval in box.intervals.items():
        for side in Side:
            end, sign = interval.end(side), side.sign
            if (name, side) in moving:
                base, speed = moving[name, side]
                rows.append(LinearConstraint.of({name: sign, STRETCH: -speed}, "<=", sign * base))
            elif end is not None:
                relation = "<=" if interval.is_closed_at(side) else "<"
                rows.append(LinearConstraint.of({name: sign}, relation, sign * end))
    best = maximize([*NAMES, STRETCH], rows, {STRETCH: Fraction(-1)})
    return None if best is None else Least(-best.value, best.attained)


@pytest.mark.parametrize("count", [150, pytest.param(3000, marks=pytest.mark.slow)])
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
