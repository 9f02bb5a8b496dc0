"""Greatest lower bounds of networks, against the closure that Floyd and Warshall compute."""

from fractions import Fraction
from itertools import pairwise, product

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robust.network.differences import DifferenceNetwork, Distances, Elimination, delay, following

SIZE = 6
points = st.integers(0, SIZE - 1)
bounds = st.lists(st.tuples(points, points, st.integers(-6, 4)), max_size=14)


def closure(network):
    """The greatest lower bound of each pair that has one, by the textbook."""
    known = {(point, point): 0 for point in range(SIZE)}
    for source, target, weight in network:
        known[source, target] = max(weight, known.get((source, target), weight))
    for middle, source, target in product(range(SIZE), repeat=3):
        if (source, middle) in known and (middle, target) in known:
            length = known[source, middle] + known[middle, target]
            known[source, target] = max(length, known.get((source, target), length))
    return known


def is_consistent(network):
    known = closure(network)
    return all(known[point, point] == 0 for point in range(SIZE))


@given(bounds)
def test_bounds_are_those_of_the_closure_and_contradictions_are_cycles_that_add_up(network):
    paths, known = DifferenceNetwork(SIZE, network), closure(network)
    assert (paths.schedule is not None) == (paths.cycle is None) == is_consistent(network)
    if paths.schedule is None or paths.cycle is not None:
        assert paths.cycle is not None
        steps = [network[origin] for origin in paths.cycle.origins]
        assert all(steps[at - 1][1] == step[0] for at, step in enumerate(steps))
        assert len({source for source, _, _ in steps}) == len(steps)
        assert sum(weight for _, _, weight in steps) > 0
        return
    assert all(paths.schedule[target] - paths.schedule[source] >= weight for source, target, weight in network)
    assert set(paths.closure()) == {(*pair, weight) for pair, weight in known.items()}
    for pair in product(range(SIZE), repeat=2):
        assert paths.least(*pair) == known.get(pair)
        for weight in range(-3, 5):
            assert paths.at_least(*pair, weight) == (pair in known and known[pair] >= weight)
        together = pair in known and pair[::-1] in known and known[pair] + known[pair[::-1]] == 0
        assert (paths.component[pair[0]] == paths.component[pair[1]]) == together


@given(bounds, st.integers(0, 3))
def test_no_bound_that_is_needed_can_go(network, given_count):
    assume(is_consistent(network))
    given_bounds = network[:given_count]
    kept = DifferenceNetwork(SIZE, network).needed(network, given_bounds)
    assert closure(kept + given_bounds) == closure(network)
    for bound in kept if not given_bounds else ():
        assert closure([other for other in kept if other != bound]) != closure(network)


@given(bounds)
def test_paths_to_the_source_add_up_to_what_is_known(network):
    assume(is_consistent(network))
    paths, known = DifferenceNetwork(SIZE, network), closure(network)
    for source in range(SIZE):
        arrivals = paths.arrivals(source)
        for target in range(SIZE):
            place, total, steps = target, 0, 0
            while arrivals[place] != (-1, -1) and steps <= SIZE:
                before, origin = arrivals[place]
                assert network[origin][:2] == (before, place)
                place, total, steps = before, total + network[origin][2], steps + 1
            assert (place == source) == ((source, target) in known)
            assert place != source or total == known[source, target]


@given(bounds, st.lists(st.integers(-9, 9), min_size=SIZE, max_size=SIZE))
def test_delays_are_the_least_from_any_times(network, first):
    times, known = list(first), closure(network)
    if delay(times, following(SIZE, network), range(SIZE)) is not None:
        assert not is_consistent(network)
    else:
        assert times == [max(first[a] + known[a, b] for a in range(SIZE) if (a, b) in known) for b in range(SIZE)]


class Sums(Elimination[int]):
    """Shortest paths, and whether a cycle is negative."""

    negative = False

    def join(self, source, first, node, second, target):
        if source == target:
            self.negative |= first + second < 0
        else:
            self.connect(source, target, min(first + second, self.after[source].get(target, first + second)))


@given(bounds, st.permutations(range(SIZE)))
def test_elimination_keeps_distances_and_finds_contradictions(network, order):
    known, sums = closure(network), Sums(SIZE)
    for source, target, weight in network:
        sums.join(source, -weight, source, 0, target)
    for node in order[2:]:
        sums.eliminate(node)
    if not sums.negative and is_consistent(network):
        assert all(sums.after[a].get(b) == (-known[a, b] if (a, b) in known else None) for a, b in pairwise(order[:2]))
    sums.eliminate(order[1])
    assert sums.negative != is_consistent(network)


def test_points_with_names_have_their_own_unit():
    distances = Distances("abc", [("a", "b", Fraction(1, 2)), ("b", "c", Fraction(-1, 3))], [Fraction(1, 4)])
    assert (distances.scale, distances.in_units("b", "a", Fraction(3, 4))) == (12, (1, 0, 9))
    assert distances.times == {"a": 0, "b": Fraction(1, 2), "c": Fraction(1, 6)}
    assert (distances.least("a", "c"), distances.least("c", "a")) == (Fraction(1, 6), None)
    with pytest.raises(ValueError, match="without schedule"):
        Distances("a", [("a", "a", Fraction(1))]).times  # noqa: B018 - the access is the test
