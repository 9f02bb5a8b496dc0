"""Greatest lower bounds of networks, against the closure that Floyd and Warshall compute."""

from itertools import product

from hypothesis import given
from hypothesis import strategies as st

from robust.network.differences import Bound, DifferenceNetwork

SIZE = 6
points = st.integers(0, SIZE - 1)
bounds = st.lists(st.tuples(points, points, st.integers(-6, 4)), max_size=14)


def closure(network: list[Bound]) -> dict[tuple[int, int], int]:
    """The greatest lower bound of each pair that has one, by the textbook."""
    known = {(point, point): 0 for point in range(SIZE)}
    for source, target, weight in network:
        known[source, target] = max(weight, known.get((source, target), weight))
    for middle, source, target in product(range(SIZE), repeat=3):
        if (source, middle) in known and (middle, target) in known:
            length = known[source, middle] + known[middle, target]
            known[source, target] = max(length, known.get((source, target), length))
    return known


def is_consistent(network: list[Bound]) -> bool:
    known = closure(network)
    return all(known[point, point] == 0 for point in range(SIZE))


@given(bounds, st.integers(1, 3))
def test_bounds_are_those_of_the_closure(network: list[Bound], near: int) -> None:
    paths = DifferenceNetwork(SIZE, network, near=near)
    assert (paths.schedule is not None) == is_consistent(network)
    if paths.schedule is None:
        return
    assert all(paths.schedule[target] - paths.schedule[source] >= weight for source, target, weight in network)
    known = closure(network)
    for pair in product(range(SIZE), repeat=2):
        assert paths.least(*pair) == known.get(pair)
        for weight in range(-3, 5):
            assert paths.at_least(*pair, weight) == (pair in known and known[pair] >= weight)
        together = pair in known and pair[::-1] in known and known[pair] + known[pair[::-1]] == 0
        assert (paths.component[pair[0]] == paths.component[pair[1]]) == together


@given(bounds, st.integers(0, 3))
def test_no_bound_that_is_needed_can_go(network: list[Bound], given_count: int) -> None:
    if not is_consistent(network):
        return
    paths, given_bounds = DifferenceNetwork(SIZE, network), network[:given_count]
    kept = paths.needed(network, given_bounds)
    assert closure(kept + given_bounds) == closure(network)
    if not given_bounds:
        for bound in kept:
            assert closure([one for one in kept if one != bound]) != closure(network)


def test_a_known_schedule_is_taken() -> None:
    assert DifferenceNetwork(2, [(0, 1, 3)], schedule=[5, 9]).schedule == [5, 9]
    assert DifferenceNetwork(2, [(0, 1, 3)]).schedule == [0, 3]
