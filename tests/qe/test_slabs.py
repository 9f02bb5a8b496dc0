"""Constraints against boxes in integers, beside the simplex method on the same questions."""

from collections import Counter
from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st

from robust.irr.widen import Least, least_stretch
from robust.qe.box import Box, Face, Interval, Side
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.simplex import feasible_point, maximize
from robust.qe.slabs import Growing
from tests.qe.polyhedra import NAMES, constraints, eq, le, lt, polygon

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
    first = draw(constraints(NAMES[:2]))
    facing = LinearConstraint(
        tuple((name, -factor) for name, factor in first.coefficients),
        first.relation,
        Fraction(draw(st.integers(-3, 6))),
    )
    other = draw(constraints(draw(st.sampled_from([NAMES[2:], NAMES]))))
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


def test_boxes_meet_pieces_as_the_simplex_method_says() -> None:
    seen: Counter[tuple[bool, bool]] = Counter()

    @settings(deadline=None, max_examples=400, derandomize=True)
    @given(pieces(), boxes)
    def run(piece: Polyhedron, box: Box) -> None:
        meets = feasible_point(NAMES, [*piece.constraints, *box.constraints()]) is not None
        assert piece.meets(box) is meets
        seen[piece.slabs.exact, meets] += 1

    run()
    assert all(seen[exact, meets] >= 15 for exact in (True, False) for meets in (True, False)), seen


def test_stretches_are_those_of_linear_programs() -> None:
    seen: Counter[tuple[bool, str]] = Counter()

    @settings(deadline=None, max_examples=400, derandomize=True)
    @given(pieces(), boxes, speeds, st.lists(st.booleans(), min_size=6, max_size=6))
    def run(piece: Polyhedron, box: Box, pace: list[Fraction], moved: list[bool]) -> None:
        faces = [(name, side) for name in NAMES for side in Side]
        moving = {
            face: (end, speed)
            for face, speed, chosen in zip(faces, pace, moved, strict=True)
            if chosen and (end := box[face[0]].end(face[1])) is not None
        }
        found = least_stretch(piece, Growing(box, moving))
        assert found == by_simplex(piece, box, moving)
        kind = "never" if found is None else "at once" if found == Least(Fraction(0), True) else "later"
        seen[piece.slabs.exact, kind] += 1

    run()
    assert all(seen[exact, kind] >= 5 for exact in (True, False) for kind in ("never", "at once", "later")), seen


def test_what_is_decided_without_a_search() -> None:
    facing = (le(3, x=1, y=2), lt(-1, x=-1, y=-2))
    assert polygon(*facing).slabs.exact
    assert polygon(eq(2, x=1), le(1, y=1)).slabs.exact
    assert not polygon(*facing, le(1, y=1)).slabs.exact
    assert not polygon(le(3, x=1), le(3, x=1, y=1)).slabs.exact
    assert not polygon(le(1, x=1), lt(-1, x=-1)).slabs.exact
    nothing, universe = Polyhedron.nothing(NAMES), Polyhedron.universe(NAMES)
    box = Box.point(dict.fromkeys(NAMES, Fraction(1)))
    assert (nothing.meets(box), universe.meets(box)) == (False, True)
