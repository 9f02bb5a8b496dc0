"""Regions against z3, and shapes whose description and volume are known."""

import json
from collections.abc import Iterator
from fractions import Fraction
from itertools import combinations

import pytest
import z3
from hypothesis import example, given
from hypothesis import strategies as st

from robust.errors import InputError, SolverError
from robust.qe.box import Box, Interval
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import OutOfWorkError, Region, outside, outside_by_solver, outside_by_splitting
from robust.smt.session import Session
from robust.smt.terms import Terms
from tests.plan.building import drawn
from tests.qe import polyhedra as shapes
from tests.qe.polyhedra import NAMES, cube, eq, is_valid, le, lt, polygon, rectangle, region_z3, regions, same, spaces

QUICK = drawn(30)
PLANE = ("x", "y")
some = st.integers(0, 3).flatmap(lambda count: regions(NAMES[:count]))
pairs = spaces.flatmap(lambda names: st.tuples(regions(names), regions(names, 2)))
SQUARE = rectangle(0, 10, 0, 10)
HOLES = (rectangle(2, 3, 2, 3), polygon(le(5, x=1, y=-1), le("-49/10", x=-1, y=1)), polygon(eq(7, y=1)))
SLABS = Region.difference(SQUARE, HOLES)


def without_one(region: Region) -> Iterator[Region]:
    """The region without one of its pieces, or without one constraint of a piece or of the base."""
    for index, piece in enumerate(region.pieces):
        others = region.pieces[:index] + region.pieces[index + 1 :]
        yield Region(region.parameters, others, region.base)
        for fewer in without_constraint(piece):
            yield Region(region.parameters, (*others, fewer), region.base)
    for fewer in without_constraint(region.base) if region.base is not None else ():
        yield Region(region.parameters, region.pieces, fewer)


def without_constraint(piece: Polyhedron) -> Iterator[Polyhedron]:
    for row in piece.constraints:
        yield Polyhedron(piece.parameters, tuple(other for other in piece.constraints if other is not row))


@QUICK
@example(SLABS)
@given(some)
def test_simplification_keeps_the_set_and_nothing_superfluous(region):
    simple = region.simplified()
    assert simple.form == region.form
    assert same(region_z3(simple), region_z3(region))
    assert not any(same(region_z3(less), region_z3(region)) for less in without_one(simple))


@QUICK
@example(SLABS)
@given(some)
def test_forms_describe_the_same_points(region):
    meaning = region_z3(region)
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
@given(pairs)
def test_set_operations(pair):
    left, right = pair
    first, second = region_z3(left), region_z3(right)
    assert same(region_z3(left.union(right)), z3.Or(first, second))
    assert same(region_z3(left.intersection(right)), z3.And(first, second))
    assert same(region_z3(left.minus(right)), z3.And(first, z3.Not(second)))
    assert left.is_subset_of(right) == is_valid(z3.Implies(first, second))
    assert left.equals(right) == same(first, second)
    witness = right.point_outside(left)
    assert witness is None or (witness in left and witness not in right)


@QUICK
@given(
    spaces.flatmap(
        lambda names: st.tuples(shapes.polyhedra(names, 5), st.lists(shapes.polyhedra(names, 3), max_size=4))
    )
)
def test_both_ways_to_decide_coverage_agree(question):
    piece, cover = question
    points = [outside_by_splitting(piece, cover), outside_by_solver(piece, cover), outside(piece, cover)]
    assert len({point is None for point in points}) == 1
    for point in points:
        assert point is None or (point in piece and not any(point in other for other in cover))


@drawn(25)
@given(regions(NAMES, 2, 3), st.sets(st.sampled_from(NAMES), min_size=1, max_size=2))
def test_projection_is_the_existential_quantifier(region, dropped):
    shadow = region.project([name for name in NAMES if name not in dropped])
    bound = [shapes.SYMBOLS[name] for name in sorted(dropped)]
    assert same(region_z3(shadow), z3.Exists(bound, region_z3(region)))


@QUICK
@given(spaces.flatmap(regions), st.fractions(-2, 2, max_denominator=3))
def test_slices_and_membership(region, value):
    name = region.parameters[-1]
    cut = region.slice({name: value})
    assert cut.form == region.form
    for point in shapes.grid(cut.parameters):
        assert (point in cut) == ({**point, name: value} in region)


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


def test_samples_reach_all_of_a_region():
    points = Region.union_of(PLANE, [SQUARE]).sample(200)
    for name in PLANE:
        assert min(point[name] for point in points) < 2
        assert max(point[name] for point in points) > 8
    on_line = Region.union_of(PLANE, [SQUARE.restricted([eq(4, x=1, y=-1)])]).sample(20)
    assert all(point["x"] - point["y"] == 4 for point in on_line)
    assert len({point["x"] for point in on_line}) > 10


@QUICK
@given(some)
def test_volumes_of_all_forms_agree_with_the_bounds(region):
    inside = region.intersection(Region.union_of(region.parameters, [cube(2, region.parameters)]))
    volume = inside.volume()
    assert volume == inside.as_union(disjoint=True).volume() == inside.simplified().volume()
    rough, fine = inside.volume_bounds(boxes=8), inside.volume_bounds(boxes=64)
    assert rough.lower <= fine.lower <= volume <= fine.upper <= rough.upper


@QUICK
@given(st.lists(shapes.polyhedra(PLANE, 3), max_size=3))
def test_volume_by_inclusion_and_exclusion(pieces):
    clipped = [piece.restricted(rectangle(-2, 2, -2, 2).constraints) for piece in pieces]
    expected = Fraction(0)
    for size in range(1, len(clipped) + 1):
        for chosen in combinations(clipped, size):
            common = rectangle(-2, 2, -2, 2)
            for piece in chosen:
                common = common.intersection(piece)
            expected -= (-1) ** size * common.volume()
    assert Region.union_of(PLANE, clipped).volume() == expected


@QUICK
@given(spaces.flatmap(regions))
def test_sympy_agrees_on_points(region):
    expression = region.to_sympy()
    for point in shapes.grid(region.parameters, Fraction(3, 2), 1)[::2]:
        values = {s: point[s.name] for s in expression.free_symbols}
        assert bool(expression.subs(values)) == (point in region)


HALVES = [polygon(lt(0, x=1)), polygon(lt(0, x=-1))]
ROW = [*(rectangle(i, i + 2, 0, 1) for i in range(5)), rectangle(1, 2, 0, 1), polygon(eq(1, x=1), eq(0, y=1))]


@pytest.mark.parametrize(
    ("pieces", "count", "union"),
    [
        ([rectangle(0, 1, 0, 1), rectangle(1, 3, 0, 1).restricted([lt(-1, x=-1)])], 1, [rectangle(0, 3, 0, 1)]),
        (ROW, 1, [rectangle(0, 6, 0, 1)]),
        (HALVES, 2, HALVES),
        ([*HALVES, polygon(eq(0, x=1))], 1, [Polyhedron.universe(PLANE)]),
        (
            [rectangle(0, 1, 0, 1), rectangle(1, 2, 0, 1), rectangle(0, 1, 1, 2)],
            2,
            [rectangle(0, 2, 0, 1), rectangle(0, 1, 0, 2)],
        ),
    ],
    ids=["glued across a facet", "overlaps and chains", "a missing seam", "a seam", "an L of overlapping rectangles"],
)
def test_pieces_are_merged(pieces, count, union):
    simple = Region.union_of(PLANE, pieces).simplified()
    assert len(simple.pieces) == count
    assert simple.equals(Region.union_of(PLANE, union))


def test_differences_keep_their_form():
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


def test_boxes():
    region = SLABS
    inside = Box({"x": Interval(Fraction(0), Fraction(4)), "y": Interval(Fraction(7), Fraction(10), False)})
    assert region.contains_box(inside)
    assert not region.contains_box(inside.replace("y", Interval(Fraction(7), Fraction(10))))
    assert not region.contains_box(inside.replace("y", Interval(Fraction(8), None)))
    half = Region.union_of(PLANE, [polygon(le(0, x=-1)), polygon(lt(0, x=1))])
    assert half.contains_box(inside.replace("x", Interval(None, None)))
    assert Region.of_box(PLANE, inside).volume() == 12
    with pytest.raises(InputError, match="'z', which is not a parameter"):
        region.contains_box(Box({"z": Interval(Fraction(0), Fraction(1))}))


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


def test_volume_bounds_in_five_dimensions():
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


def test_document_layout():
    union = Region.union_of(["dur_1"], [Polyhedron(("dur_1",), (le(9, dur_1=1),))])
    constraint = {"coefficients": {"dur_1": "1"}, "relation": "<=", "constant": "9"}
    polyhedra_list = [{"constraints": [constraint]}]
    assert union.as_dict()["polyhedra"] == polyhedra_list
    assert Region.from_dict({"parameters": ["dur_1"], "polyhedra": polyhedra_list}) == union
    difference = union.complement().as_dict()
    assert (difference["form"], difference["base"], difference["minus"]) == ("difference", [], polyhedra_list)


@pytest.mark.parametrize(
    "document",
    [
        [],
        {},
        {"parameters": ["x"], "polyhedra": [{}]},
        {"parameters": ["x"], "polyhedra": {}},
        {"parameters": ["x"], "form": "difference", "minus": []},
        {"parameters": ["x"], "form": "intersection", "polyhedra": []},
        {"schema": "robust/region/2", "parameters": ["x"], "polyhedra": []},
    ],
)
def test_bad_documents_are_refused(document):
    with pytest.raises(InputError, match="cannot read a region"):
        Region.from_dict(document)


def test_pieces_must_be_over_the_parameters():
    with pytest.raises(InputError, match="the same parameters"):
        Region.union_of(["x"], [SQUARE])
    turned = Region.union_of(["y", "x"], [SQUARE])
    assert turned.pieces[0].parameters == ("y", "x")
    assert turned.equals(Region.union_of(PLANE, [SQUARE]))


def test_splitting_stops_at_its_limit():
    cover = [rectangle(i, i + 1, j, j + 1) for i in range(3) for j in range(3)]
    with pytest.raises(OutOfWorkError):
        outside_by_splitting(rectangle(0, 3, 0, 3), cover, limit=3)
    assert outside(rectangle(0, 3, 0, 3), cover) is None


def test_an_undecided_query_is_an_error(monkeypatch):
    from robust.qe import region as cover  # noqa: PLC0415

    monkeypatch.setattr(cover.Session, "check", lambda *_: cover.Satisfiability.UNKNOWN)
    with pytest.raises(SolverError, match="could not decide"):
        outside_by_solver(SQUARE, [])
