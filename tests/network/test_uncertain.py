"""Dynamic controllability: against all reductions, a game and certificates; and networks without uncertainty."""

from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import pairwise, product
from random import Random
from time import perf_counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError
from robust.network import uncertain
from robust.network.differences import DifferenceNetwork, Distances, Elimination, delay, following
from robust.network.dispatchable import DispatchNetwork, Windows, strategy, waits
from robust.network.uncertain import EdgeStep, Stnu, UncertainLink, Way, dynamic
from robust.plan.model import ZERO
from robust.smt.limits import Deadline, OutOfTimeError
from tests.network import oracles
from tests.network.oracles import longest_paths, network, point, random_network
from tests.sampling import often


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("oracle", "seeds", "sizes"),
    [
        (oracles.dynamic_by_reductions, range(300), (4, 3, 7, 5)),
        slow(oracles.dynamic_by_reductions, range(1000, 21_000), (5, 4, 9, 6)),
        (partial(oracles.dynamic_by_game, horizon=30), range(200), (2, 2, 5, 3)),
        slow(partial(oracles.dynamic_by_game, horizon=30), range(1000, 9000), (3, 2, 6, 3)),
    ],
)
def test_verdicts_are_those_of_reductions_and_of_a_game(oracle, seeds, sizes):
    verdicts = []
    for seed in seeds:
        rng = Random(seed)  # noqa: S311
        stnu = random_network(rng, *(rng.randint(1, most) for most in sizes[:3]), sizes[3])
        answer = dynamic(stnu)
        assert answer.is_controllable is oracle(stnu), (seed, *map(str, stnu.links))
        if answer.is_controllable:
            assert oracles.weak_by_corners(stnu), seed
        else:
            confirm(stnu, answer.cycle)
        verdicts.append(answer.is_controllable)
    assert len(verdicts) // 10 < sum(verdicts) < len(verdicts) * 9 // 10


def confirm(stnu, cycle):
    """Check a certificate from its definition alone."""
    weight = uncertain.weight_in(stnu)
    places = [stnu.ends(step) for step in cycle.steps]
    assert all(places[i - 1][1] == places[i][0] for i in range(len(places)))
    assert all(uncertain.total(piece, weight) < (0, 0) for piece in cycle.pieces)
    lower = [at for at, step in enumerate(cycle.steps) if step.way is Way.SHORTEST]
    assert lower == [at for at, _ in cycle.moats]
    twice = cycle.steps * 2
    for at, length in cycle.moats:
        moat = twice[at + 1 : at + 1 + length]
        assert uncertain.total(moat, weight) < (0, 0)
        assert EdgeStep(cycle.steps[at].link, Way.LONGEST) not in moat


def test_what_may_never_end_is_what_may_take_very_long():
    seen = set()
    for seed in range(often(250, 400)):
        stnu = random_network(Random(seed), 3, 3, 5, 5, unbounded=True)  # noqa: S311
        endless = {link for link in stnu.contingents if link.upper is None}
        links = (replace(link, upper=Fraction(10_000)) if link in endless else link for link in stnu.links)
        controllable = dynamic(stnu).is_controllable
        assert controllable is dynamic(Stnu(stnu.points, tuple(links))).is_controllable, seed
        seen.add((controllable, bool(endless)))
    assert len(seen) == 4


LONG_OR_SHORT = "c as long as 10, c as short as 1 cannot be met with c - x in [1, 3]"


@pytest.mark.parametrize(
    ("requirements", "contingents", "text"),
    [
        ([("x", "c", 1, 3)], [("Z", "c", 1, 10)], LONG_OR_SHORT),
        ([("Z", "x", 3, 2)], [], "contradiction: x - .zero in [3, 2]"),
        ([("c", "x", 0, 1), ("Z", "x", 0, 99)], [("Z", "c", 1, None)], "c is unbounded cannot be met with "),
        (
            [("Z", "x", 5, None), ("Z", "x", None, 3)],
            [],
            "contradiction: x - .zero in [-inf, 3]; x - .zero in [5, inf]",
        ),
    ],
)
def test_the_explanation_names_what_contradicts(requirements, contingents, text):
    stnu = network(requirements, contingents)
    assert uncertain.explain(stnu, dynamic(stnu).cycle).startswith(text)


def test_a_walk_that_proves_nothing_is_no_certificate():
    stnu = network([("x", "c", -5, 3)], [("Z", "c", 1, 10)])
    with pytest.raises(ValueError, match="not negative"):
        uncertain.negative_cycle([EdgeStep(0, Way.AT_MOST), EdgeStep(0, Way.AT_LEAST)], uncertain.weight_in(stnu))


def natural(source, target, lower, upper):
    """A contingent link."""
    return UncertainLink(source, target, Fraction(lower), None if upper is None else Fraction(upper), True)


X, C, D = map(point, "xcd")


@pytest.mark.parametrize(
    ("links", "message"),
    [
        ([natural(ZERO, C, 3, 2)], "expected 0 <= lower <= upper"),
        ([natural(ZERO, C, -1, 2)], "expected 0 <= lower <= upper"),
        ([natural(X, ZERO, 0, 2)], "which happens at time zero"),
        ([natural(ZERO, C, 1, None)] * 2, "where another one ends already"),
        ([UncertainLink(ZERO, D, None, None)], "not in the network"),
        ([natural(X, C, 1, 2), natural(C, X, 1, 2)], "go round in a circle"),
    ],
)
def test_networks_that_make_no_sense(links, message):
    with pytest.raises(InputError, match=message):
        Stnu((ZERO, X, C), tuple(links))
    with pytest.raises(InputError, match="the network begins with"):
        Stnu((X, ZERO), ())


def test_long_plans_do_not_exhaust_the_stack():
    requirements = [(f"c{i}", f"x{i + 1}", 0, 1) for i in range(400)]
    chain = network(requirements, [("Z" if i == 0 else f"x{i}", f"c{i}", 1, 1 + i % 3) for i in range(400)])
    started = perf_counter()
    assert dynamic(chain).is_controllable
    assert perf_counter() - started < 20
    with pytest.raises(OutOfTimeError):
        dynamic(chain, Deadline.after(0))


class Executing:
    """The strategy of a controllable network as the dispatcher follows it."""

    def __init__(self, stnu, answer):
        self.stnu, self.windows = stnu, Windows(strategy(answer, answer.form.stnu.contingents))
        self.index = self.windows.network.index
        self.happened(ZERO, Fraction(0))

    def happened(self, where, time):
        self.windows.happened(self.index[where], time)

    @property
    def times(self):
        return {self.stnu.points[number]: time for number, time in self.windows.times.items()}

    def run(self, length, rng=None):
        """The moments at which something happens: as early as possible, or at any that is allowed, in any order."""
        now = Fraction(0)
        for _ in range(500):
            times = self.times
            if len(times) == len(self.stnu.points):
                return
            on = (link for link in self.stnu.contingents if link.source in times and link.target not in times)
            ends = ((times[link.source] + length[link], str(link.target), link.target) for link in on)
            end, _, ending = min(ends, default=(None, "", None))
            waiting = {where: self.index[where] for where in self.stnu.executable if where not in times}
            first = {where: at for where, i in waiting.items() if (at := self.windows.ready(i)) is not None}
            last = {where: at for where, i in waiting.items() if (at := self.windows.window(i)[1]) is not None}
            ready = [where for where, time in first.items() if time <= now]
            due = [where for where in ready if last.get(where) == now]
            if end == now and (rng is None or not due or rng.random() < 0.5):
                self.happened(ending, now)
                yield now
            elif ready and (rng is None or due or rng.random() < 0.3):
                chosen = ready[0] if rng is None else rng.choice(due or ready)
                assert chosen not in last or now <= last[chosen]
                self.happened(chosen, now)
                yield now
            else:
                moments = (last if rng else first).values()
                limit = min(moments if end is None else (end, *moments), default=now + 5)
                assert limit > now, "nothing may happen, and something has to"
                now += (limit - now) * (Fraction(rng.choice([1, 2, 3, 4, 4]), 4) if rng else 1)
        raise AssertionError("the execution does not end")


def chosen_length(rng, link):
    """A length that nature may choose, often an extreme one."""
    if link.upper is None:
        return link.lower + Fraction(rng.choice([0, 1, 3, 1000, rng.randint(0, 200)]), 7)
    share = rng.choice([0, 1, Fraction(rng.randint(0, 60), 60)])
    return link.lower + (link.upper - link.lower) * share


@pytest.mark.parametrize(
    ("seeds", "expected"), [(range(350), 500), slow(range(10_000, 60_000), 50_000)], ids=["short", "long"]
)
def test_all_requirements_hold_whatever_nature_does(seeds, expected):
    executed, with_waits = 0, 0
    for seed in seeds:
        rng = Random(seed)  # noqa: S311
        stnu = random_network(rng, 1 + seed % 4, 1 + seed % 3, 1 + seed % 7, 6, unbounded=seed % 5 == 0)
        answer = dynamic(stnu)
        for run in range(6 if answer.cycle is None else 0):
            dispatch = Executing(stnu, answer)
            length = {link: chosen_length(rng, link) for link in stnu.contingents}
            list(dispatch.run(length, rng if run % 2 else None))
            times = dispatch.times
            broken = [link for link in stnu.links if not link.is_contingent and not oracles.satisfies(link, times)]
            assert not broken, (seed, run, *map(str, stnu.links))
            assert all(times[link.target] - times[link.source] == length[link] for link in stnu.contingents)
            executed += 1
        with_waits += answer.cycle is None and bool(waits(answer))
    assert executed > expected
    assert with_waits >= expected / 100


def test_a_wait_ends_with_the_observation_or_by_itself():
    stnu = network([("x", "c", -5, 3)], [("Z", "c", 1, 10)])
    (wait,) = waits(dynamic(stnu))
    assert (wait, str(wait)) == (uncertain.Wait(X, ZERO, Fraction(7), C), "x waits for c, at most 7 after .zero")
    dispatch = Executing(stnu, dynamic(stnu))
    windows, number = dispatch.windows, dispatch.index[X]
    assert windows.ready(number) == 7
    dispatch.happened(C, Fraction(2))
    assert (max(windows.ready(number), 2), windows.window(number)[1]) == (2, 7)
    endless = network([("x", "c", None, 3)], [("Z", "c", 1, None)])
    assert [str(wait) for wait in waits(dynamic(endless))] == ["x waits for c"]
    dispatch = Executing(endless, dynamic(endless))
    assert dispatch.windows.ready(dispatch.index[X]) is None
    # It is not implied by that of an end that comes at the same time.
    together = network([("x", "c", None, 1)], [("x", "d", 0, 0), ("Z", "c", 5, 10)])
    assert [str(wait) for wait in waits(dynamic(together))] == ["x waits for c, at most 9 after .zero"]


def windows_after(count, edges, *times, waits=()):
    """The windows of a network whose first time points happen at these times."""
    bounds = [(source, target, Fraction(weight)) for source, target, weight in edges]
    points = (ZERO, *(point(f"p{number}") for number in range(1, count)))
    windows = Windows(DispatchNetwork(points, (), bounds, waits, closed=True))
    for number, time in enumerate(times):
        windows.happened(number, Fraction(time))
    return windows


def bounds_of(count, edges, fixed):
    """Least and greatest times of points that are not fixed; edges are (a, b, most of b - a)."""
    known = [(a, b, sign * time) for number, time in fixed.items() for a, b, sign in ((0, number, 1), (number, 0, -1))]
    greatest = longest_paths(range(count), [(a, b, -most) for a, b, most in [*edges, *known]], 0)
    least = longest_paths(range(count), [(b, a, -most) for a, b, most in [*edges, *known]], 0)
    future = (number for number in range(count) if number not in fixed)
    return {number: (least.get(number), -greatest[number] if number in greatest else None) for number in future}


@pytest.mark.parametrize("seed", range(often(30, 60)))
def test_windows_are_those_of_the_network_with_the_past_fixed_and_with_tighter_bounds(seed):
    random = Random(seed)  # noqa: S311 - reproducible
    count = random.randint(3, 8)
    hidden = [Fraction(0), *(Fraction(random.randint(0, 60), random.choice([1, 2, 3])) for _ in range(count - 1))]
    edges = [(number, 0, Fraction(0)) for number in range(1, count)]
    for _ in range(random.randint(count, 3 * count)):
        x, y = random.sample(range(count), 2)
        edges.append((x, y, hidden[y] - hidden[x] + Fraction(random.randint(0, 20), random.choice([1, 2, 7]))))
    windows, fixed = windows_after(count, edges), {}
    for number in (0, *random.sample(range(1, count), count - 1)):
        lower, upper = windows.window(number) if number else (Fraction(0), Fraction(0))
        share = Fraction(random.randint(0, 5), 5)
        fixed[number] = lower + (min(upper, lower + 9) - lower if upper is not None else 4) * share
        windows.happened(number, fixed[number])
        expected = bounds_of(count, edges, fixed)
        assert {other: windows.window(other) for other in expected} == expected, (seed, number)
        assert windows.times == fixed
    x, y = random.sample(range(count), 2)
    more = (x, y, hidden[y] - hidden[x])
    windows = windows_after(count, edges, 0)
    tightened = windows.over(windows.network.tightened([more]))
    expected = bounds_of(count, [*edges, more], {0: Fraction(0)})
    assert {other: tightened.window(other) for other in expected} == expected


def test_who_comes_first_blocks_unless_both_coincide():
    with pytest.raises(InputError, match="no schedule"):
        windows_after(2, [(0, 1, 3), (1, 0, -4)])
    windows = windows_after(3, [(1, 0, 0), (2, 1, -1)], 0)
    assert (windows.ready(1), windows.ready(2)) == (0, None)
    windows.happened(1, Fraction(2))
    assert windows.ready(2) == 3
    windows = windows_after(3, [(1, 0, 0), (1, 2, 0), (2, 1, 0)], 0)
    assert (windows.ready(1), windows.ready(2)) == (0, 0)


SIZE = 6
points = st.integers(0, SIZE - 1)
bounds = st.lists(st.tuples(points, points, st.integers(-6, 4)), max_size=14)


consistent = st.builds(
    lambda times, steps: [(source, target, times[target] - times[source] - slack) for source, target, slack in steps],
    st.lists(st.integers(0, 5), min_size=SIZE, max_size=SIZE),
    st.lists(st.tuples(points, points, st.integers(0, 3)), max_size=14),
)
"""Bounds that a schedule keeps, many of them exactly."""
closure = partial(oracles.closure, range(SIZE))


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


@given(consistent, st.integers(0, 3))
def test_no_bound_that_is_needed_can_go(network, given_count):
    given_bounds = network[:given_count]
    kept = DifferenceNetwork(SIZE, network).needed(network, given_bounds)
    assert closure(kept + given_bounds) == closure(network)
    for bound in kept if not given_bounds else ():
        assert closure([other for other in kept if other != bound]) != closure(network)


@given(consistent)
def test_paths_to_the_source_add_up_to_what_is_known(network):
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
