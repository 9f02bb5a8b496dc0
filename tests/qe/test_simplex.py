"""Exact linear programs against z3's optimiser."""

from fractions import Fraction

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.qe.constraint import Sense
from robust.qe.simplex import Tableau, feasible_point, maximize, tableau
from tests.qe.polyhedra import NAMES, SYMBOLS, as_z3, eq, is_valid, le, lt, number, polyhedra


@settings(deadline=None, max_examples=60)
@given(polyhedra(NAMES), st.tuples(*(st.fractions(-2, 2, max_denominator=3) for _ in NAMES)))
def test_optima_agree_with_z3(polyhedron, weights):
    objective = dict(zip(NAMES, weights, strict=True))
    form = z3.Sum([number(weight) * SYMBOLS[name] for name, weight in objective.items()])
    inside = as_z3(polyhedron)
    point = feasible_point(NAMES, polyhedron.constraints)
    result = maximize(NAMES, polyhedron.constraints, objective)
    if point is None:
        assert is_valid(z3.Not(inside))
        assert result is None
        return
    assert point in polyhedron
    assert result is not None
    optimiser = z3.Optimize()
    optimiser.add(as_z3(polyhedron.closure()))
    handle = optimiser.maximize(form)
    assert optimiser.check() == z3.sat
    bound = optimiser.upper(handle)
    if result.value is None:
        assert str(bound) == "oo"
    else:
        assert Fraction(str(bound)) == result.value
        assert sum(weight * result.point[name] for name, weight in objective.items()) == result.value
        assert result.attained == (not is_valid(z3.Implies(inside, form != number(result.value))))
        assert not result.attained or result.point in polyhedron.closure()


def test_strict_and_closed_ends():
    over = {"x": Fraction(2)}
    assert maximize(("x",), [lt(3, x=1)], over).value == 6
    assert not maximize(("x",), [lt(3, x=1)], over).attained
    assert maximize(("x",), [le(3, x=1)], over).attained
    assert maximize(("x",), [le(3, x=-1)], over).value is None
    assert maximize(("x",), [lt(3, x=1), le(-3, x=-1)], over) is None


def test_bounds_that_only_a_corner_excludes():
    sides = [le(1, x=1), le(1, y=1), lt(2, x=1, y=1)]
    assert maximize(("x", "y"), sides, {"x": Fraction(1)}).attained
    corner = maximize(("x", "y"), sides, {"x": Fraction(1), "y": Fraction(2)})
    assert corner.value == 3
    assert not corner.attained


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
    other = solved.add((0, 1), Sense.AT_MOST, 1)
    second = solved.add((-1, 0), Sense.LESS, -1)
    assert not solved.restore()
    assert solved.conflict == {first, second}
    assert other not in solved.conflict
    assert solved.only_strictly


# Rows of coefficients and a bound, and an objective, over five variables that are not negative and add up to at most 1.
# The simplex method goes round in a circle for ever if instead of Bland's rule it takes:
CIRCLES = {
    "last column": (
        "0 3 -3 -1 -3 1; 0 1 0 2 0 0; -1 3 2 0 1 0; 2 -1 0 1 -2 1; -2 3 0 1 -3 0; -1 0 -1 2 0 0; "
        "0 -2 2 -1 -3 0; -2 -2 0 -3 2 0",
        "0 0 -3 -2 -2",
    ),
    "first column": (
        "-3 3 -2 -1 -1 1; -3 -1 -1 2 1 0; -1 1 -3 -3 -3 0; 2 -3 0 -3 1 0; 3 0 1 1 3 1; "
        "1 0 3 -3 -2 0; -3 -1 3 -2 1 1; -1 -1 -3 -1 -3 0; 2 2 0 -1 3 1",
        "-1 2 -2 1 -2",
    ),
    "last violated row": (
        "0 -2 -3 -2 -2 1; -2 -3 2 1 1 0; 3 0 -2 2 -1 0; 3 0 -3 -1 0 1; 3 -1 -2 -1 0 0; "
        "-2 -1 -2 1 -3 0; -2 3 0 0 -1 0; 2 0 -2 0 1 0; 3 3 0 -2 1 0; 0 -2 0 3 3 1",
        "3 0 0 0 0",
    ),
    "last row of a tie": (
        "3 3 -1 1 3 0; 3 -3 2 0 -3 0; -3 0 -3 1 -3 0; -1 0 -2 3 1 0; 0 2 -2 0 3 0; -2 3 0 3 -2 0; 2 -3 -2 3 -3 0",
        "3 -3 -1 2 3",
    ),
    "largest coefficient": (
        "0 1 -1 1 1 0; -1 2 -1 3 3 1; 2 1 -1 3 0 1; 2 0 0 2 -2 1; -3 -1 -2 0 -2 1; 3 -1 -2 -2 0 0; "
        "-1 -1 3 1 2 0; 3 -3 -3 2 -3 1; 3 3 -3 -2 -3 0; 3 0 -3 0 0 0",
        "1 2 -1 0 2",
    ),
}


class Counting(Tableau):
    """Ends where Bland's rule would have been done long ago."""

    pivots = 0

    def _pivot(self, leaving: int, column: int) -> None:
        self.pivots += 1
        assert self.pivots < 60
        super()._pivot(leaving, column)


@pytest.mark.parametrize("rule", CIRCLES)
def test_degenerate_programs_end(rule):
    rows, objective = CIRCLES[rule]
    sides = [[int(number) for number in row.split()] for row in rows.split(";")]
    sides += [[-int(i == j) for i in range(5)] + [0] for j in range(5)]
    counting, forms = Counting(5), [(*side[:5], side[5]) for side in [*sides, [1] * 6]]
    for *form, bound in forms:
        counting.add(form, Sense.AT_MOST, bound)
    assert counting.restore()
    optimum = counting.maximize([int(number) for number in objective.split()])
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
