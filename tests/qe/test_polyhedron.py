"""Polyhedra against z3, a grid of points, and shapes with known answers."""

from fractions import Fraction
from itertools import combinations, pairwise, product

import pytest
import z3
from hypothesis import example, given
from hypothesis import strategies as st

from robust.errors import InputError, UnsupportedError
from robust.qe.box import Interval
from robust.qe.conjunctions import project_at
from robust.qe.polyhedron import Polyhedron
from tests.plan.building import drawn
from tests.qe import polyhedra as shapes
from tests.qe.polyhedra import NAMES, SYMBOLS, as_z3, cube, eq, is_valid, le, lt, polygon, polyhedra, rectangle, same

QUICK = drawn(50)
SQUARE = rectangle(0, 1, 0, 1)
LINE, POINT = polygon(eq(1, x=1, y=1)), polygon(le(2, x=1, y=1), le(-1, x=-1), le(-1, y=-1))
COUPLED = Polyhedron(NAMES, (eq(0, y=1, z=1), eq(0, x=1, z=1), lt(1, y=1)))
WITHOUT_CORNER = SQUARE.restricted([lt(2, x=1, y=1)])
SHAPES = (
    Polyhedron(()),
    Polyhedron.nothing(()),
    Polyhedron.nothing(NAMES),
    Polyhedron.universe(NAMES),
    polygon(le(1, x=1), lt(-1, x=-1)),
    POINT,
    LINE,
    LINE.restricted([le(0, x=-1), lt(0, y=-1)]),
    polygon(lt(0, x=1)),
    WITHOUT_CORNER,
    WITHOUT_CORNER.restricted([lt(1, x=1)]),
    COUPLED,
)
"""Empty by strictness, flat, unbounded, or with a side that excludes a corner only."""


def of_every_shape(test):
    for shape in SHAPES:
        test = example(shape)(test)
    return test


some = st.integers(0, 3).flatmap(lambda count: polyhedra(NAMES[:count]))
pairs = shapes.spaces.flatmap(lambda names: st.tuples(polyhedra(names), polyhedra(names, 4)))


@QUICK
@of_every_shape
@given(some)
def test_membership_points_and_emptiness(polyhedron):
    inside = as_z3(polyhedron)
    assert polyhedron.is_empty == is_valid(z3.Not(inside))
    assert polyhedron.is_empty == (polyhedron.dimension == -1)
    for point in shapes.grid(polyhedron.parameters, reach=2):
        values = [(SYMBOLS[name], shapes.number(value)) for name, value in point.items()]
        assert (point in polyhedron) == z3.is_true(z3.simplify(z3.substitute(inside, *values)))
    if not polyhedron.is_empty:
        assert polyhedron.some_point() in polyhedron
        assert polyhedron.interior_point() in polyhedron


@QUICK
@of_every_shape
@given(some)
def test_simplification_keeps_the_set_and_nothing_else(polyhedron):
    simple = polyhedron.simplified()
    assert same(as_z3(simple), as_z3(polyhedron))
    for index in range(len(simple.constraints)):
        fewer = Polyhedron(simple.parameters, simple.constraints[:index] + simple.constraints[index + 1 :])
        assert not same(as_z3(fewer), as_z3(polyhedron))
    interior = simple.interior_point()
    assert all(c.is_equality or c.value(interior) < c.constant for c in simple.constraints if interior)


@QUICK
@example((SQUARE, WITHOUT_CORNER))
@example((WITHOUT_CORNER.restricted([lt(3, x=2, y=1)]), WITHOUT_CORNER))
@given(pairs)
def test_subsets_and_differences(pair):
    left, right = pair
    assert left.is_subset_of(right) == is_valid(z3.Implies(as_z3(left), as_z3(right)))
    assert left.equals(right) == same(as_z3(left), as_z3(right))
    assert same(as_z3(left.intersection(right)), z3.And(as_z3(left), as_z3(right)))
    pieces = left.minus(right)
    assert same(z3.Or([as_z3(piece) for piece in pieces]), z3.And(as_z3(left), z3.Not(as_z3(right))))
    assert all(first.is_disjoint_from(second) for first, second in combinations(pieces, 2))
    assert same(z3.Or([as_z3(piece) for piece in right.complement()]), z3.Not(as_z3(right)))


@QUICK
@example(COUPLED, {"y", "z"})
@example(COUPLED, {"y"})
@example(Polyhedron.nothing(NAMES), set(NAMES))
@given(polyhedra(NAMES), st.sets(st.sampled_from(NAMES), max_size=3))
def test_projection_is_the_existential_quantifier(polyhedron, dropped):
    kept = [name for name in NAMES if name not in dropped]
    shadow = polyhedron.project(kept)
    assert shadow.parameters == tuple(kept)
    bound = [SYMBOLS[name] for name in sorted(dropped)]
    assert same(as_z3(shadow), z3.Exists(bound, as_z3(polyhedron)) if bound else as_z3(polyhedron))


@pytest.mark.parametrize(
    ("x", "expected"), [(2, {le(0, x=-1), le(10, x=1), le(16, x=1)}), (-1, {le(0, x=1), le(16, x=-1)})]
)
def test_projection_at_a_point_puts_what_is_eliminated_at_its_tightest_bound(x, expected):
    """y is at least x/2 and at least 0; at most 5 and at most x + 16, at most 8."""
    rows = [le(0, x=1, y=-2), le(0, y=-1), le(5, y=1), le(16, x=-1, y=1), lt(8, y=1)]
    point = {"x": Fraction(x), "y": Fraction(3)}
    found = project_at(rows, {"y"}, point)
    exact = polygon(*rows).project(["x"])
    shadow = Polyhedron(("x",), tuple(found))
    assert {"x": Fraction(x)} in shadow
    assert shadow.is_subset_of(exact)
    for constraint in expected:
        assert shadow.satisfies(constraint)
    assert {"x": Fraction(-x)} not in shadow


@QUICK
@of_every_shape
@given(some)
def test_bounding_boxes_and_vertices(polyhedron):
    box = polyhedron.bounding_box()
    assert (box is None) == polyhedron.is_empty
    for name, extent in (box or {}).items():
        for sign, end, closed in ((1, extent.upper, extent.upper_closed), (-1, extent.lower, extent.lower_closed)):
            if end is None:
                assert not closed
                assert not is_valid(z3.Implies(as_z3(polyhedron), sign * SYMBOLS[name] < 1000))
            else:
                beyond = z3.Implies(as_z3(polyhedron), sign * (SYMBOLS[name] - shapes.number(end)) < 0)
                assert is_valid(z3.Implies(as_z3(polyhedron), sign * (SYMBOLS[name] - shapes.number(end)) <= 0))
                assert is_valid(beyond) == (not closed)
    vertices = polyhedron.vertices()
    assert all(vertex in polyhedron.closure() for vertex in vertices)
    if polyhedron.is_bounded and vertices:
        for name, extent in box.items():
            assert extent.lower == min(vertex[name] for vertex in vertices)
            assert extent.upper == max(vertex[name] for vertex in vertices)


def test_volumes_of_shapes():
    signs = (1, -1)
    tetrahedron = Polyhedron(NAMES, (le(1, x=1, y=1, z=1), *(le(0, **{n: -1}) for n in NAMES)))
    octahedron = Polyhedron(NAMES, tuple(le(1, x=a, y=b, z=c) for a, b, c in product(signs, signs, signs)))
    pyramid = Polyhedron(NAMES, (*(le(0, z=1, **{n: s}) for n in "xy" for s in signs), le(2, z=-1)))
    assert (len(cube(1).vertices()), len(octahedron.vertices())) == (8, 6)
    for shape, volume in (
        (cube(2), 8),
        (cube(2).restricted([le(3, x=1, y=1, z=1)]), 4),
        (tetrahedron, Fraction(1, 6)),
        (octahedron, Fraction(4, 3)),
        (pyramid, Fraction(32, 3)),
        (pyramid.restricted([lt(1, x=1), lt(0, z=1)]), 9),
        (cube(3, "abcd"), 81),
        (Polyhedron.universe(NAMES), None),
        (polygon(lt(0, x=1)), None),
        *((shape, 0) for shape in (POINT, LINE, Polyhedron.nothing(()))),
        (Polyhedron(()), 1),
    ):
        assert shape.volume() == volume


@QUICK
@given(shapes.spaces.flatmap(lambda names: st.tuples(polyhedra(names, 4), polyhedra(names, 2))))
def test_volumes_add_up(pair):
    whole = pair[0].restricted(cube(2, pair[0].parameters).constraints)
    parts = [piece.volume() for piece in whole.minus(pair[1])]
    assert sum(parts) + whole.intersection(pair[1]).volume() == whole.volume()


def test_answers_without_a_choice():
    everything, nothing = Polyhedron(()), Polyhedron.nothing(())
    assert (everything.dimension, everything.is_universal, everything.vertices()) == (0, True, [{}])
    assert cube(1).project(()) == everything
    assert everything.minus(nothing) == [everything]
    assert (str(everything), str(nothing)) == ("true", "false")
    empty = SHAPES[4]
    assert empty.simplified() == Polyhedron.nothing(("x", "y"))
    assert empty.closure().is_empty
    assert empty.some_point() is empty.interior_point() is empty.maximize({"x": 1}) is None
    assert (POINT.dimension, POINT.simplified()) == (0, polygon(eq(1, x=1), eq(1, y=1)))
    assert POINT.vertices() == [{"x": 1, "y": 1}]
    assert POINT.bounding_box()["x"] == Interval(Fraction(1), Fraction(1), True, True)
    segment = SHAPES[7]
    assert (LINE.dimension, LINE.is_bounded, LINE.vertices()) == (1, False, [])
    assert segment.vertices() == [{"x": 0, "y": 1}, {"x": 1, "y": 0}]
    assert segment.extent("x") == Interval(Fraction(0), Fraction(1), True, False)
    assert segment.slice({"x": Fraction(1, 3)}).vertices() == [{"y": Fraction(2, 3)}]
    assert polygon(lt(0, x=1)).extent("x") == Interval(None, Fraction(0), False, False)
    assert Polyhedron.universe(NAMES).complement() == []
    assert [piece.is_universal for piece in Polyhedron.nothing(NAMES).complement()] == [True]
    assert len(WITHOUT_CORNER.simplified().constraints) == 5
    assert COUPLED.project(["x"]) == Polyhedron(("x",), (lt(1, x=1),))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: polygon(le(1, z=1)), InputError, "'z', which is not a parameter"),
        (lambda: Polyhedron(("x", "x")), InputError, "a name occurs twice"),
        (lambda: rectangle(0, 1, 0, 1).project(["a"]), InputError, "'a' is not a parameter"),
        (lambda: rectangle(0, 1, 0, 1).slice({"a": Fraction(1)}), InputError, "'a' is not a parameter"),
        (lambda: rectangle(0, 1, 0, 1).intersection(cube(1)), InputError, "the same parameters"),
        (lambda: cube(1, "abcd").vertices(), UnsupportedError, "dimension 4"),
    ],
)
def test_errors(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_projection_of_a_long_chain_stays_small():
    names = tuple(f"t{i}" for i in range(12))
    sides = [le(0, t0=-1), le(0, t0=1)]
    for first, second in pairwise(names):
        sides += [le(5, **{second: 1, first: -1}), lt(-2, **{second: -1, first: 1})]
    shadow = Polyhedron(names, tuple(sides)).project(["t11"])
    assert shadow.extent("t11") == Interval(Fraction(22), Fraction(55), False, True)
    assert len(shadow.constraints) == 2
