"""Regions and polyhedra against z3, a grid of points, and shapes whose description and volume are known."""

import json
from collections.abc import Iterator
from fractions import Fraction
from functools import reduce
from itertools import combinations, pairwise, product

import pytest
import z3
from hypothesis import example, given
from hypothesis import strategies as st

from robust import Box, InputError, Interval, SolverError, UnsupportedError
from robust.qe.conjunctions import project_at
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import OutOfWorkError, Region, outside, outside_by_solver, outside_by_splitting
from robust.smt.session import Satisfiability, Session, Terms
from tests.plan.building import drawn
from tests.qe import polyhedra as shapes
from tests.qe.polyhedra import NAMES, SYMBOLS, as_z3, cube, eq, is_valid, le, lt, polygon, polyhedra, rectangle, same
from tests.tables import tables

TABLES = tables(__file__)

QUICK, region_z3, regions, spaces = drawn(30), shapes.region_z3, shapes.regions, shapes.spaces
PLANE = ("x", "y")
some = st.integers(0, 3).flatmap(lambda count: regions(NAMES[:count]))
pairs = spaces.flatmap(lambda names: st.tuples(regions(names), regions(names, 2)))
SQUARE = rectangle(0, 10, 0, 10)
HOLES = (rectangle(2, 3, 2, 3), polygon(le(5, x=1, y=-1), le("-49/10", x=-1, y=1)), polygon(eq(7, y=1)))
SLABS = Region.difference(SQUARE, HOLES)


def without_one(region: Region) -> Iterator[Region]:
    """The region without one of its pieces, or without one constraint of a piece or of the base."""

    def fewer(piece: Polyhedron) -> Iterator[Polyhedron]:
        for row in piece.constraints:
            yield Polyhedron(piece.parameters, tuple(other for other in piece.constraints if other is not row))

    for index, piece in enumerate(region.pieces):
        others = region.pieces[:index] + region.pieces[index + 1 :]
        yield Region(region.parameters, others, region.base)
        yield from (Region(region.parameters, (*others, less), region.base) for less in fewer(piece))
    if region.base is not None:
        yield from (Region(region.parameters, region.pieces, less) for less in fewer(region.base))


@QUICK
@example(SLABS)
@given(some)
def test_forms_describe_the_same_points_and_simple_ones_with_nothing_superfluous(region):
    meaning, simple = region_z3(region), region.simplified()
    assert simple.form == region.form
    assert same(region_z3(simple), meaning)
    assert not any(same(region_z3(less), meaning) for less in without_one(simple))
    assert same(region_z3(region.as_union()), meaning)
    assert same(region_z3(region.as_difference()), meaning)
    assert same(region_z3(region.complement()), z3.Not(meaning))
    disjoint = region.as_union(disjoint=True)
    assert same(region_z3(disjoint), meaning)
    assert all(left.is_disjoint_from(right) for left, right in combinations(disjoint.pieces, 2))
    assert region.is_empty == is_valid(z3.Not(meaning))
    assert region.is_universal == is_valid(meaning)
    point = region.some_point()
    assert point is None or point in region


@QUICK
@given(pairs, spaces.flatmap(lambda names: st.tuples(polyhedra(names, 5), st.lists(polyhedra(names, 3), max_size=4))))
def test_set_operations_and_both_ways_to_decide_coverage(pair, question):
    left, right = pair
    first, second = region_z3(left), region_z3(right)
    assert same(region_z3(left.union(right)), z3.Or(first, second))
    assert same(region_z3(left.intersection(right)), z3.And(first, second))
    assert same(region_z3(left.minus(right)), z3.And(first, z3.Not(second)))
    assert left.is_subset_of(right) == is_valid(z3.Implies(first, second))
    assert left.equals(right) == same(first, second)
    witness = right.point_outside(left)
    assert witness is None or (witness in left and witness not in right)
    piece, cover = question
    points = [decide(piece, cover) for decide in (outside_by_splitting, outside_by_solver, outside)]
    assert len({point is None for point in points}) == 1
    for point in points:
        assert point is None or (point in piece and not any(point in other for other in cover))


@QUICK
@given(regions(NAMES, 2, 3), st.sets(st.sampled_from(NAMES), min_size=1, max_size=2))
def test_projection_is_the_existential_quantifier(region, dropped):
    shadow = region.project([name for name in NAMES if name not in dropped])
    bound = [SYMBOLS[name] for name in sorted(dropped)]
    assert same(region_z3(shadow), z3.Exists(bound, region_z3(region)))


@QUICK
@given(spaces.flatmap(regions), st.fractions(-2, 2, max_denominator=3))
def test_slices_and_sympy_agree_on_points(region, value):
    name = region.parameters[-1]
    cut = region.slice({name: value})
    assert cut.form == region.form
    for point in shapes.grid(cut.parameters):
        assert (point in cut) == ({**point, name: value} in region)
    expression = region.to_sympy()
    for point in shapes.grid(region.parameters, Fraction(3, 2), 1)[::2]:
        values = {s: point[s.name] for s in expression.free_symbols}
        assert bool(expression.subs(values)) == (point in region)


@QUICK
@given(some, st.integers(0, 3))
def test_documents_samples_and_formulas(region, seed):
    document = json.loads(json.dumps(region.as_dict()))
    assert document["schema"] == "robust/region/1"
    assert Region.from_dict({**document, "status": "complete"}) == region
    points = region.sample(4, seed=seed)
    assert all(point in region for point in points)
    assert len(points) == (0 if region.is_empty else 4)
    assert points == region.sample(4, seed=seed)
    solver = z3.Solver()
    declarations = "".join(f"(declare-const {name} Real)" for name in region.parameters)
    call = f"(here {' '.join(region.parameters)})" if region.parameters else "here"
    solver.from_string(f"{declarations}{region.to_smtlib('here')}(assert {call})")
    assert same(z3.And(solver.assertions()), region_z3(region))
    terms = Terms()
    session = Session(terms)
    session.add(region.to_formula(terms))
    assert (session.check("is the region empty").value == "unsat") == region.is_empty


def test_samples_reach_all_of_a_region_and_projections_of_long_chains_stay_small():
    points = Region.union_of(PLANE, [SQUARE]).sample(200)
    for name in PLANE:
        assert min(point[name] for point in points) < 2
        assert max(point[name] for point in points) > 8
    on_line = Region.union_of(PLANE, [SQUARE.restricted([eq(4, x=1, y=-1)])]).sample(20)
    assert all(point["x"] - point["y"] == 4 for point in on_line)
    assert len({point["x"] for point in on_line}) > 10
    names = tuple(f"t{i}" for i in range(12))
    sides = [le(0, t0=-1), le(0, t0=1)]
    for first, second in pairwise(names):
        sides += [le(5, **{second: 1, first: -1}), lt(-2, **{second: -1, first: 1})]
    shadow = Polyhedron(names, tuple(sides)).project(["t11"])
    assert shadow.extent("t11") == Interval(Fraction(22), Fraction(55), False, True)
    assert len(shadow.constraints) == 2


@QUICK
@given(some, st.lists(polyhedra(PLANE, 3), max_size=3))
def test_volumes_of_all_forms_agree_with_the_bounds_and_with_inclusion_and_exclusion(region, pieces):
    inside = region.intersection(Region.union_of(region.parameters, [cube(2, region.parameters)]))
    volume = inside.volume()
    assert volume == inside.as_union(disjoint=True).volume() == inside.simplified().volume()
    rough, fine = inside.volume_bounds(boxes=8), inside.volume_bounds(boxes=64)
    assert rough.lower <= fine.lower <= volume <= fine.upper <= rough.upper
    box, expected = rectangle(-2, 2, -2, 2), Fraction(0)
    for size in range(1, len(pieces) + 1):
        for chosen in combinations(pieces, size):
            expected -= (-1) ** size * reduce(Polyhedron.intersection, chosen, box).volume()
    assert Region.union_of(PLANE, [piece.restricted(box.constraints) for piece in pieces]).volume() == expected


HALVES = [polygon(lt(0, x=1)), polygon(lt(0, x=-1))]
ROW = [*(rectangle(i, i + 2, 0, 1) for i in range(5)), rectangle(1, 2, 0, 1), polygon(eq(1, x=1), eq(0, y=1))]
L_SHAPE = [rectangle(0, 1, 0, 1), rectangle(1, 2, 0, 1), rectangle(0, 1, 1, 2)]


def test_pieces_are_merged():
    for pieces, union in (
        ([rectangle(0, 1, 0, 1), rectangle(1, 3, 0, 1).restricted([lt(-1, x=-1)])], [rectangle(0, 3, 0, 1)]),
        (ROW, [rectangle(0, 6, 0, 1)]),
        (HALVES, HALVES),
        ([*HALVES, polygon(eq(0, x=1))], [Polyhedron.universe(PLANE)]),
        (L_SHAPE, [rectangle(0, 2, 0, 1), rectangle(0, 1, 0, 2)]),
    ):
        simple = Region.union_of(PLANE, pieces).simplified()
        assert len(simple.pieces) == len(union)
        assert simple.equals(Region.union_of(PLANE, union))


def test_differences_keep_their_form_and_contain_boxes():
    assert Region.union_of(PLANE, [SQUARE]).as_difference() == Region(PLANE, (), SQUARE)
    simple = SLABS.simplified()
    assert (simple.form, len(simple.pieces)) == ("difference", 3)
    slab, hole = HOLES[1].intersection(SQUARE).volume(), HOLES[0].volume()
    assert SLABS.volume() == 100 - slab - hole + HOLES[0].intersection(HOLES[1]).volume()
    halves = [polygon(lt(-4, x=-1)), polygon(lt(20, y=1), lt(-3, y=-1))]
    region = Region.difference(SQUARE, halves).simplified()
    assert region.pieces == (), "removing a half-space makes a side"
    assert region.base.equals(rectangle(0, 4, 0, 3))
    assert Region.difference(SQUARE, [Polyhedron.universe(PLANE)]).simplified().is_empty
    with pytest.raises(InputError, match="the same parameters"):
        Region.union_of(["x"], [SQUARE])
    turned = Region.union_of(["y", "x"], [SQUARE])
    assert turned.pieces[0].parameters == ("y", "x")
    assert turned.equals(Region.union_of(PLANE, [SQUARE]))
    inside = Box({"x": Interval(Fraction(0), Fraction(4)), "y": Interval(Fraction(7), Fraction(10), False)})
    assert SLABS.contains_box(inside)
    assert not SLABS.contains_box(inside.replace("y", Interval(Fraction(7), Fraction(10))))
    assert not SLABS.contains_box(inside.replace("y", Interval(Fraction(8), None)))
    half = Region.union_of(PLANE, [polygon(le(0, x=-1)), polygon(lt(0, x=1))])
    assert half.contains_box(inside.replace("x", Interval(None, None)))
    assert Region.of_box(PLANE, inside).volume() == 12
    with pytest.raises(InputError, match="'z', which is not a parameter"):
        SLABS.contains_box(Box({"z": Interval(Fraction(0), Fraction(1))}))


def test_without_parameters_or_volume():
    true, false = Region.universe(()), Region.nothing(())
    assert (true.volume(), false.volume()) == (1, 0)
    assert true.volume_bounds().upper == true.volume_bounds().lower == 1
    assert false.volume_bounds().upper == true.complement().volume_bounds().upper == 0
    assert (str(true), str(false)) == ("{ true }", "∅")
    assert true.to_smtlib() == "(define-fun region () Bool\n  true)\n"
    assert Region.universe(PLANE).volume() is Region.universe(PLANE).volume_bounds().upper is None
    assert Region.nothing(PLANE).volume() == 0
    assert Region.nothing(PLANE).project(["x"]).is_empty
    line = Region.union_of(PLANE, [polygon(eq(1, x=1, y=1))])
    assert line.volume() == line.volume_bounds().upper == 0
    assert not line.is_empty
    assert line.project(["x"]).simplified() == Region.universe(["x"])
    assert line.complement().simplified().form == "difference"
    assert len(line.complement().as_union().simplified().pieces) == 2
    point = Region.union_of(PLANE, [polygon(eq(1, x=1), eq(2, y=1))])
    assert point.sample(1) == [{"x": 1, "y": 2}]
    assert point.is_subset_of(line.complement())
    # In five dimensions.
    names = tuple("abcde")
    ball = cube(1, names).restricted([le(2, **dict.fromkeys(names, 1))])
    region = Region.difference(ball, [Polyhedron(names, (lt("1/2", a=1, b=1), lt("-1/4", c=-1)))])
    bounds = region.volume_bounds(boxes=200)
    assert bounds.lower < bounds.upper
    assert bounds.upper - bounds.lower < Fraction(1, 50)
    # Within the simplex count: vol{Σ ≤ 2} = (2^5 − 5·1^5)/5! is exact for one half-space.
    assert Region.union_of(names, [ball]).volume_bounds(boxes=1).lower == Fraction(27, 120)


def test_text_and_latex():
    odd = Polyhedron(("a_b", "y"), (lt("-7/2", a_b=-1, y=2),))
    outside_of_strip = Region.union_of(PLANE, [polygon(le(-1, x=1)), polygon(le(-1, x=-1))])
    for region, latex in (
        (Region.union_of(("a_b", "y"), [odd]), r"\mathit{a\_b} - 2 y > \frac{7}{2}"),
        (Region.union_of(PLANE, [polygon(le(1, x=1), le(2, y=1))]), r"x \le 1 \land y \le 2"),
        (outside_of_strip, r"\left(x \le -1\right) \lor \left(x \ge 1\right)"),
        (outside_of_strip.complement(), r"\neg \left(x \le -1\right) \land \neg \left(x \ge 1\right)"),
        (Region.nothing(PLANE), r"\bot"),
        (Region.universe(PLANE), r"\top"),
    ):
        assert region.to_latex() == latex
    assert str(outside_of_strip) == "{ x ≤ -1 }\n∪ { x ≥ 1 }"
    assert str(Region.difference(SQUARE.restricted([lt("7/2", x=1, y=-2)]), HOLES[2:])).splitlines()[1] == "∖ { y = 7 }"
    assert "|my x|" in Region.universe(["my x"]).to_smtlib()
    shape = polygon(lt("-3/4", x=2, y=-3), eq("5/2", y=-1))
    assert Region.difference(shape, HOLES[2:]).to_smtlib("f") == (
        "(define-fun f ((x Real) (y Real)) Bool\n"
        "  (and (< (+ (* 2.0 x) (* (- 3.0) y)) (- (/ 3 4))) (= y (- (/ 5 2))) (not (= y 7.0))))\n"
    )


@pytest.mark.parametrize("document", TABLES["documents have one layout and others are refused"])
def test_documents_have_one_layout_and_others_are_refused(document):
    with pytest.raises(InputError, match="cannot read a region"):
        Region.from_dict(document)
    polyhedra_list = [{"constraints": [le(9, dur_1=1).as_dict()]}]
    assert polyhedra_list[0]["constraints"][0] == {"coefficients": {"dur_1": "1"}, "relation": "<=", "constant": "9"}
    union = Region.from_dict({"parameters": ["dur_1"], "polyhedra": polyhedra_list})
    assert union == Region.union_of(["dur_1"], [Polyhedron(("dur_1",), (le(9, dur_1=1),))])
    assert union.as_dict()["polyhedra"] == polyhedra_list
    difference = union.complement().as_dict()
    assert (difference["form"], difference["base"], difference["minus"]) == ("difference", [], polyhedra_list)


def test_splitting_and_solving_may_remain_undecided(monkeypatch):
    cover = [rectangle(i, i + 1, j, j + 1) for i in range(3) for j in range(3)]
    with pytest.raises(OutOfWorkError):
        outside_by_splitting(rectangle(0, 3, 0, 3), cover, limit=3)
    assert outside(rectangle(0, 3, 0, 3), cover) is None
    monkeypatch.setattr(Session, "check", lambda *_: Satisfiability.UNKNOWN)
    with pytest.raises(SolverError, match="could not decide"):
        outside_by_solver(SQUARE, [])


OFTEN = drawn(50)
UNIT = rectangle(0, 1, 0, 1)
LINE, POINT = polygon(eq(1, x=1, y=1)), polygon(le(2, x=1, y=1), le(-1, x=-1), le(-1, y=-1))
COUPLED = Polyhedron(NAMES, (eq(0, y=1, z=1), eq(0, x=1, z=1), lt(1, y=1)))
WITHOUT_CORNER = UNIT.restricted([lt(2, x=1, y=1)])
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


any_polyhedron = st.integers(0, 3).flatmap(lambda count: polyhedra(NAMES[:count]))
two = shapes.spaces.flatmap(lambda names: st.tuples(polyhedra(names), polyhedra(names, 4)))


@OFTEN
@of_every_shape
@given(any_polyhedron)
def test_membership_points_emptiness_and_simplification(polyhedron):
    inside, simple = as_z3(polyhedron), polyhedron.simplified()
    assert polyhedron.is_empty == is_valid(z3.Not(inside))
    assert polyhedron.is_empty == (polyhedron.dimension == -1)
    for point in shapes.grid(polyhedron.parameters, reach=2):
        values = [(SYMBOLS[name], shapes.number(value)) for name, value in point.items()]
        assert (point in polyhedron) == z3.is_true(z3.simplify(z3.substitute(inside, *values)))
    if not polyhedron.is_empty:
        assert polyhedron.some_point() in polyhedron
        assert polyhedron.interior_point() in polyhedron
    assert same(as_z3(simple), inside)
    for index in range(len(simple.constraints)):
        fewer = Polyhedron(simple.parameters, simple.constraints[:index] + simple.constraints[index + 1 :])
        assert not same(as_z3(fewer), inside)
    interior = simple.interior_point()
    assert all(c.is_equality or c.value(interior) < c.constant for c in simple.constraints if interior)


@OFTEN
@example((UNIT, WITHOUT_CORNER))
@example((WITHOUT_CORNER.restricted([lt(3, x=2, y=1)]), WITHOUT_CORNER))
@given(two)
def test_subsets_differences_and_sums_of_volumes(pair):
    left, right = pair
    assert left.is_subset_of(right) == is_valid(z3.Implies(as_z3(left), as_z3(right)))
    assert left.equals(right) == same(as_z3(left), as_z3(right))
    assert same(as_z3(left.intersection(right)), z3.And(as_z3(left), as_z3(right)))
    pieces = left.minus(right)
    assert same(z3.Or([as_z3(piece) for piece in pieces]), z3.And(as_z3(left), z3.Not(as_z3(right))))
    assert all(first.is_disjoint_from(second) for first, second in combinations(pieces, 2))
    assert same(z3.Or([as_z3(piece) for piece in right.complement()]), z3.Not(as_z3(right)))
    whole = left.restricted(cube(2, left.parameters).constraints)
    parts = [piece.volume() for piece in whole.minus(right)]
    assert sum(parts) + whole.intersection(right).volume() == whole.volume()


@OFTEN
@example(COUPLED, {"y", "z"})
@example(COUPLED, {"y"})
@example(Polyhedron.nothing(NAMES), set(NAMES))
@given(polyhedra(NAMES), st.sets(st.sampled_from(NAMES), max_size=3))
def test_projection_of_polyhedra_is_the_existential_quantifier(polyhedron, dropped):
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
    shadow = Polyhedron(("x",), tuple(project_at(rows, {"y"}, {"x": Fraction(x), "y": Fraction(3)})))
    assert {"x": Fraction(x)} in shadow
    assert shadow.is_subset_of(polygon(*rows).project(["x"]))
    assert all(map(shadow.satisfies, expected))
    assert {"x": Fraction(-x)} not in shadow


@OFTEN
@of_every_shape
@given(any_polyhedron)
def test_bounding_boxes_and_vertices(polyhedron):
    box, inside = polyhedron.bounding_box(), as_z3(polyhedron)
    assert (box is None) == polyhedron.is_empty
    for name, extent in (box or {}).items():
        for sign, end, closed in ((1, extent.upper, extent.upper_closed), (-1, extent.lower, extent.lower_closed)):
            if end is None:
                assert not closed
                assert not is_valid(z3.Implies(inside, sign * SYMBOLS[name] < 1000))
            else:
                beyond = sign * (SYMBOLS[name] - shapes.number(end))
                assert is_valid(z3.Implies(inside, beyond <= 0))
                assert is_valid(z3.Implies(inside, beyond < 0)) == (not closed)
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


def test_errors():
    for call, message in (
        (lambda: polygon(le(1, z=1)), "'z', which is not a parameter"),
        (lambda: Polyhedron(("x", "x")), "a name occurs twice"),
        (lambda: UNIT.project(["a"]), "'a' is not a parameter"),
        (lambda: UNIT.slice({"a": Fraction(1)}), "'a' is not a parameter"),
        (lambda: UNIT.intersection(cube(1)), "the same parameters"),
        (lambda: cube(1, "abcd").vertices(), "dimension 4"),
    ):
        with pytest.raises(UnsupportedError if "dimension" in message else InputError, match=message):
            call()
