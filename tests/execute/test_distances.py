"""Longest paths and irredundant edges against brute force."""

from fractions import Fraction
from itertools import product

from hypothesis import given, settings
from hypothesis import strategies as st

from robust.execute.distances import DistanceEdge, EdgeNetwork, constraints_of, edge, is_implied
from robust.plan.model import ZERO, TimePoint, TimePointKind
from robust.plan.stn import STNConstraint
from tests.network.oracles import longest_paths

POINTS = (ZERO, *(TimePoint(TimePointKind.INSTANT, name) for name in "abcd"))
A, B = POINTS[1:3]


def implied(edges, source, target):
    """The longest path, None if there is none."""
    return longest_paths(POINTS, [(one.source, one.target, one.weight) for one in edges], source).get(target)


@st.composite
def networks(draw):
    """Edges that a drawn schedule satisfies."""
    times = {point: Fraction(draw(st.integers(0, 6)), draw(st.sampled_from([1, 3]))) for point in POINTS}
    pairs = draw(st.lists(st.tuples(st.sampled_from(POINTS), st.sampled_from(POINTS), st.integers(0, 2)), max_size=12))
    return [DistanceEdge(a, b, times[b] - times[a] - slack) for a, b, slack in pairs if a != b]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(networks(), st.integers(0, 4))
def test_irredundant_edges_imply_all_and_are_needed(edges, split):
    given_ones, others = edges[:split], edges[split:]
    kept = EdgeNetwork(POINTS, edges).needed(others, given_ones)
    assert set(kept) <= set(others)
    for one in others:
        assert implied((*given_ones, *kept), one.source, one.target) >= one.weight
    for one in kept:
        rest = implied([*given_ones, *(other for other in kept if other != one)], one.source, one.target)
        assert rest is None or rest < one.weight


@settings(max_examples=200, deadline=None, derandomize=True)
@given(networks(), st.integers(-2, 3))
def test_longest_paths_implied_edges_and_earliest_schedules(edges, slack):
    network = EdgeNetwork(POINTS, edges)
    for a, b in product(POINTS, POINTS):
        least = implied(edges, a, b) if a != b else 0
        assert network.implies(DistanceEdge(a, b, Fraction(slack))) is (least is not None and least >= slack)
    nonnegative = [*edges, *(DistanceEdge(ZERO, point, Fraction(0)) for point in POINTS[1:])]
    possible = all((implied(nonnegative, point, ZERO) or Fraction(-1)) <= 0 for point in POINTS)
    schedule = {point: implied(nonnegative, ZERO, point) for point in POINTS}
    assert EdgeNetwork(POINTS, nonnegative).earliest == (schedule if possible else None)
    for one in edges:
        rest = [other for other in edges if other != one]
        looser = DistanceEdge(one.source, one.target, one.weight - slack)
        known = implied(rest, one.source, one.target)
        assert is_implied(looser, rest) is (known is not None and known >= looser.weight)


def test_contradictions_have_no_schedule():
    assert EdgeNetwork(POINTS, [DistanceEdge(A, B, Fraction(1)), DistanceEdge(B, A, Fraction(0))]).earliest is None
    assert (
        EdgeNetwork(POINTS, [DistanceEdge(A, ZERO, Fraction(0)), DistanceEdge(ZERO, A, Fraction(1))]).earliest is None
    )


def test_constraints_have_the_strongest_bounds_and_edges_the_times_of_timed_literals():
    edges = [
        DistanceEdge(A, B, Fraction(1)),
        DistanceEdge(A, B, Fraction(2)),
        DistanceEdge(B, A, Fraction(-5)),
        DistanceEdge(ZERO, A, Fraction(0)),
    ]
    first, second = STNConstraint(A, ZERO, Fraction(0), None), STNConstraint(B, A, Fraction(2), Fraction(5))
    assert constraints_of(edges, {ZERO: 0, A: 1, B: 2}) == (first, second)
    literal = TimePoint(TimePointKind.TIMED_LITERAL, time=Fraction(7))
    assert edge(literal, A, Fraction(1)) == DistanceEdge(ZERO, A, Fraction(8))
    assert edge(A, literal, Fraction(1)) == DistanceEdge(A, ZERO, Fraction(-6))
