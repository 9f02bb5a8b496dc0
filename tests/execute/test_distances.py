"""Longest paths and irredundant edges against brute force."""

from fractions import Fraction
from itertools import product

from hypothesis import given, settings
from hypothesis import strategies as st

from robust.execute.distances import DistanceEdge, EdgeNetwork, constraints_of, edge, is_implied
from robust.plan.model import ZERO, TimePoint, TimePointKind
from robust.plan.stn import STNConstraint
from tests.network.oracles import longest_paths, point

A, B, C, D = map(point, "abcd")
POINTS = (ZERO, A, B, C, D)
LITERAL = TimePoint(TimePointKind.TIMED_LITERAL, time=Fraction(7))


@st.composite
def networks(draw):
    """Edges that a drawn schedule satisfies."""
    times = {place: Fraction(draw(st.integers(0, 6)), draw(st.sampled_from([1, 3]))) for place in POINTS}
    pairs = draw(st.lists(st.tuples(st.sampled_from(POINTS), st.sampled_from(POINTS), st.integers(0, 2)), max_size=12))
    return [DistanceEdge(a, b, times[b] - times[a] - slack) for a, b, slack in pairs if a != b]


def follows(bound, edges):
    """Whether edges imply another one: by the longest path between its points."""
    least = longest_paths(POINTS, edges, bound.source).get(bound.target)
    return least is not None and least >= bound.weight


@settings(max_examples=200, deadline=None, derandomize=True)
@given(networks(), st.integers(0, 4), st.integers(-2, 3))
def test_implied_and_irredundant_edges_and_earliest_schedules(edges, split, slack):
    network, given_edges, others = EdgeNetwork(POINTS, edges), edges[:split], edges[split:]
    kept = network.needed(others, given_edges)
    assert set(kept) <= set(others)
    assert all(follows(other, [*given_edges, *kept]) for other in others)
    for bound in kept:
        assert not follows(bound, [*given_edges, *(other for other in kept if other != bound)])
    for a, b in product(POINTS, POINTS):
        bound = DistanceEdge(a, b, Fraction(slack))
        assert network.implies(bound) is follows(bound, edges)
    for bound in edges:
        rest, looser = [other for other in edges if other != bound], bound._replace(weight=bound.weight - slack)
        assert is_implied(looser, rest) is follows(looser, rest)
    nonnegative = [*edges, *(DistanceEdge(ZERO, place, Fraction(0)) for place in POINTS[1:])]
    assert EdgeNetwork(POINTS, nonnegative).earliest == longest_paths(POINTS, nonnegative, ZERO)


def test_contradictions_have_no_schedule():
    for first, second in ((A, B), (ZERO, A)):
        edges = [DistanceEdge(first, second, Fraction(1)), DistanceEdge(second, first, Fraction(0))]
        assert EdgeNetwork(POINTS, edges).earliest is None


def test_constraints_have_the_strongest_bounds_and_edges_the_times_of_timed_literals():
    bounds = [(A, B, 1), (A, B, 2), (B, A, -5), (ZERO, A, 0)]
    edges = [DistanceEdge(source, target, Fraction(weight)) for source, target, weight in bounds]
    first, second = STNConstraint(A, ZERO, Fraction(0), None), STNConstraint(B, A, Fraction(2), Fraction(5))
    assert constraints_of(edges, {ZERO: 0, A: 1, B: 2}) == (first, second)
    assert edge(LITERAL, A, Fraction(1)) == DistanceEdge(ZERO, A, Fraction(8))
    assert edge(A, LITERAL, Fraction(1)) == DistanceEdge(A, ZERO, Fraction(-6))
