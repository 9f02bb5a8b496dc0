"""Execution of controllable networks: whatever nature does, all requirements hold in the end."""

import random
from fractions import Fraction

import pytest

from robust.execute.controllability.dynamic import ContingentLink, RequirementLink, Stnu, Wait, dynamic, waits
from robust.execute.dispatch.network import NaturalLink, Windows, strategy
from robust.plan.model import ZERO
from robust.plan.polynomial import Polynomial
from robust.qe.box import Interval
from tests.execute.controllability_oracles import network, point, random_network


class Executing:
    """The strategy of a controllable network as the dispatcher follows it."""

    def __init__(self, stnu, network):
        self.stnu = stnu
        self.windows = Windows(network)
        self.index = self.windows.network.index
        self.happened(ZERO, Fraction(0))

    def happened(self, one, time):
        self.windows.happened(self.index[one], time)

    @property
    def times(self):
        return {self.stnu.points[number]: time for number, time in self.windows.times.items()}

    @property
    def waiting(self):
        return [one for one in self.stnu.executable if one not in self.times]

    def next_end(self, length):
        """When and where the next contingent link ends, if any is on."""
        times = self.times
        on = (link for link in self.stnu.contingents if link.source in times and link.target not in times)
        return min(((times[one.source] + length[one], str(one.target), one.target) for one in on), default=None)

    def ready(self, one, now):
        """When a time point may be executed if nothing is observed before; None waits for an observation."""
        ready = self.windows.ready(self.index[one])
        return None if ready is None else max(ready, now)

    def latest(self, one):
        return self.windows.window(self.index[one])[1]

    def next_decision(self, now=Fraction(0)):
        """The next moment at which something is to be executed unless an observation comes first, and what."""
        found = [(time, one) for one in self.waiting if (time := self.ready(one, now)) is not None]
        first = min((time for time, _ in found), default=None)
        return None if first is None else (first, [one for time, one in found if time == first])

    def execute(self, one, now):
        """Within what the strategy says."""
        latest = self.latest(one)
        assert self.ready(one, now) == now
        assert latest is None or now <= latest
        self.happened(one, now)


def strategic(answer):
    """The network that the dispatcher makes of a controllable one."""
    links = [
        NaturalLink(one.source, one.target, Polynomial.variable(one.name), Interval(one.lower, one.upper))
        for one in answer.form.stnu.contingents
    ]
    return strategy(answer, links)


def chosen_length(rng, link):
    """A length that nature may choose, often an extreme one."""
    if link.upper is None:
        return link.lower + Fraction(rng.choice([0, 1, 3, 1000, rng.randint(0, 200)]), 7)
    share = rng.choice([0, 1, Fraction(rng.randint(0, 60), 60)])
    return link.lower + (link.upper - link.lower) * share


def execute_early(dispatch, length):
    """Everything as early as possible: the moments at which something has happened."""
    now = Fraction(0)
    while dispatch.waiting or dispatch.next_end(length):
        decision, end = dispatch.next_decision(now), dispatch.next_end(length)
        if end is not None and (decision is None or end[0] <= decision[0]):
            now = end[0]
            dispatch.happened(end[2], now)
        else:
            now, points = decision
            dispatch.execute(points[0], now)
        yield now


def execute_somehow(rng, dispatch, length):
    """At any moment between earliest and latest; at one moment, executions and observations in any order."""
    now = Fraction(0)
    for _ in range(500):
        if len(dispatch.times) == len(dispatch.stnu.points):
            return
        end = dispatch.next_end(length)
        last = {p: late for p in dispatch.waiting if (late := dispatch.latest(p)) is not None}
        ready = [p for p in dispatch.waiting if (first := dispatch.ready(p, now)) is not None and first <= now]
        due = [p for p in ready if last.get(p) == now]
        is_end = end is not None and end[0] == now
        if is_end and (not due or rng.random() < 0.5):
            dispatch.happened(end[2], now)
        elif due or (ready and rng.random() < 0.3):
            dispatch.execute(rng.choice(due or ready), now)
        else:
            limit = min([*last.values(), *([end[0]] if end is not None else [])], default=now + 5)
            assert limit > now, "nothing may happen, and something has to"
            now += (limit - now) * Fraction(rng.choice([1, 2, 3, 4, 4]), 4)
    raise AssertionError("the execution does not end")


def simulate(seed, shape, runs, *, unbounded=False):
    """Executions of one random network; how many there were, and whether it has waits."""
    rng = random.Random(seed)  # noqa: S311
    stnu = random_network(rng, *shape, unbounded=unbounded)
    answer = dynamic(stnu)
    if answer.cycle is not None:
        return 0, False
    network = strategic(answer)
    for run in range(runs):
        dispatch = Executing(stnu, network)
        length = {link: chosen_length(rng, link) for link in stnu.contingents}
        if run % 2:
            execute_somehow(rng, dispatch, length)
        else:
            list(execute_early(dispatch, length))
        times = dispatch.times
        broken = [link for link in stnu.links if isinstance(link, RequirementLink) and not link.holds(times)]
        assert not broken, (seed, run, *map(str, stnu.links))
        assert all(times[link.target] - times[link.source] == length[link] for link in stnu.contingents)
    return runs, bool(waits(answer))


def simulate_many(seeds, runs):
    executed, with_waits = 0, 0
    for seed in seeds:
        shape = (1 + seed % 4, 1 + seed % 3, 1 + seed % 7, 6)
        count, has_waits = simulate(seed, shape, runs, unbounded=seed % 5 == 0)
        executed += count
        with_waits += has_waits
    return executed, with_waits


def test_all_requirements_hold_whatever_nature_does():
    executed, with_waits = simulate_many(range(2000), 6)
    assert executed > 3000
    assert with_waits > 40


@pytest.mark.slow
def test_all_requirements_hold_whatever_nature_does_at_length():
    executed, _ = simulate_many(range(10_000, 60_000), 6)
    assert executed > 50_000


def test_the_rest_stays_controllable():
    """After each step of an execution, what is left is still dynamically controllable, decided anew."""
    asked = 0
    for seed in range(300):
        rng = random.Random(seed)  # noqa: S311
        stnu = random_network(rng, 3, 2, 5, 5)
        answer = dynamic(stnu)
        if answer.cycle is None:
            dispatch = Executing(stnu, strategic(answer))
            length = {link: chosen_length(rng, link) for link in stnu.contingents}
            for now in execute_early(dispatch, length):
                assert dynamic(rest_of(stnu, dispatch.times, now)).is_controllable, seed
                asked += 1
    assert asked > 150


def rest_of(stnu, times, now):
    """The network with what has happened as facts, and all else not before now."""
    links = [RequirementLink(ZERO, one, time, time) for one, time in times.items()]
    links += [RequirementLink(ZERO, one, now, None) for one in stnu.points if one not in times]
    for link in stnu.links:
        if not isinstance(link, ContingentLink):
            links.append(link)
        elif link.target not in times:
            least = max(link.lower, now - times[link.source]) if link.source in times else link.lower
            links.append(ContingentLink(link.source, link.target, least, link.upper))
    return Stnu(stnu.points, tuple(links))


def test_a_wait_ends_with_the_observation_or_by_itself():
    stnu = network([("x", "c", -5, 3)], [("Z", "c", 1, 10)])
    assert waits(dynamic(stnu)) == (Wait(point("x"), ZERO, Fraction(7), point("c")),)
    assert str(waits(dynamic(stnu))[0]) == "x waits for c, at most 7 after .zero"
    dispatch = Executing(stnu, strategic(dynamic(stnu)))
    assert dispatch.next_decision() == (7, [point("x")])
    dispatch.happened(point("c"), Fraction(2))
    assert dispatch.next_decision(Fraction(2)) == (2, [point("x")])
    assert dispatch.latest(point("x")) == 7
    dispatch.execute(point("x"), Fraction(3))
    assert dispatch.next_decision(Fraction(3)) is None


def test_what_may_never_end_is_waited_for():
    stnu = network([("c", "x", 1, 4)], [("Z", "c", 1, None)])
    assert [str(wait) for wait in waits(dynamic(network([("x", "c", None, 3)], [("Z", "c", 1, None)])))] == [
        "x waits for c"
    ]
    dispatch = Executing(stnu, strategic(dynamic(stnu)))
    assert dispatch.next_decision(Fraction(10**9)) is None
    dispatch.happened(point("c"), Fraction(10**9))
    assert dispatch.next_decision(Fraction(10**9)) == (10**9 + 1, [point("x")])
    assert dispatch.latest(point("x")) == 10**9 + 4
