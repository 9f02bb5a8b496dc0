"""Execution of controllable networks: whatever nature does, all requirements hold in the end."""

import random
from fractions import Fraction

import pytest

from robust.errors import InputError, RefutedError
from robust.execute.controllability.dispatching import DynamicDispatch
from robust.execute.controllability.dynamic import Wait, dynamic, waits
from robust.execute.controllability.stnu import ContingentLink, RequirementLink, Stnu
from robust.plan.model import ZERO
from tests.execute.controllability_oracles import network, point, random_network


def chosen_length(rng, link):
    """A length that nature may choose, often an extreme one."""
    if link.upper is None:
        return link.lower + Fraction(rng.choice([0, 1, 3, 1000, rng.randint(0, 200)]), 7)
    share = rng.choice([0, 1, Fraction(rng.randint(0, 60), 60)])
    return link.lower + (link.upper - link.lower) * share


def next_end(dispatch, length):
    """When and where the next contingent link ends, if any is on."""
    ends = ((dispatch.times[link.source] + length[link], str(link.target), link.target) for link in dispatch.pending)
    return min(ends, default=None)


def execute_early(dispatch, length):
    """Everything as early as possible."""
    now = Fraction(0)
    while len(dispatch.times) < len(dispatch.stnu.points):
        decision, end = dispatch.next_decision(now), next_end(dispatch, length)
        if end is not None and (decision is None or end[0] <= decision[0]):
            now = end[0]
            dispatch.observe(end[2], now)
        else:
            now, points = decision
            for one in points:
                dispatch.execute(one, now)


def execute_somehow(rng, dispatch, length):
    """At any moment between earliest and latest; at one moment, executions and observations in any order."""
    now = Fraction(0)
    for _ in range(500):
        if len(dispatch.times) == len(dispatch.stnu.points):
            return
        end = next_end(dispatch, length)
        last = {p: late for p in dispatch.waiting if (late := dispatch.latest(p)) is not None}
        ready = [p for p in dispatch.waiting if (first := dispatch.earliest(p, now)) is not None and first <= now]
        due = [p for p in ready if last.get(p) == now]
        is_end = end is not None and end[0] == now
        if is_end and (not due or rng.random() < 0.5):
            dispatch.observe(end[2], now)
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
    for run in range(runs):
        dispatch = DynamicDispatch(answer)
        length = {link: chosen_length(rng, link) for link in stnu.contingents}
        if run % 2:
            execute_somehow(rng, dispatch, length)
        else:
            execute_early(dispatch, length)
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
    for seed in range(250):
        rng = random.Random(seed)  # noqa: S311
        stnu = random_network(rng, 3, 2, 5, 5)
        answer = dynamic(stnu)
        if answer.cycle is None:
            dispatch = DynamicDispatch(answer)
            length = {link: chosen_length(rng, link) for link in stnu.contingents}
            now = Fraction(0)
            while (decision := dispatch.next_decision(now)) is not None:
                end = next_end(dispatch, length)
                if end is not None and end[0] <= decision[0]:
                    now = end[0]
                    dispatch.observe(end[2], now)
                else:
                    now = decision[0]
                    dispatch.execute(decision[1][0], now)
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
    dispatch = DynamicDispatch(stnu)
    assert dispatch.next_decision() == (7, (point("x"),))
    with pytest.raises(InputError, match=r"found x executed at 6; expected a time in \[7, "):
        dispatch.execute(point("x"), Fraction(6))
    dispatch.observe(point("c"), Fraction(2))
    assert dispatch.next_decision(Fraction(2)) == (2, (point("x"),))
    assert dispatch.latest(point("x")) == 7
    dispatch.execute(point("x"), Fraction(3))
    assert dispatch.next_decision(Fraction(3)) is None


def test_what_may_never_end_is_waited_for():
    stnu = network([("c", "x", 1, 4)], [("Z", "c", 1, None)])
    assert [str(wait) for wait in waits(dynamic(network([("x", "c", None, 3)], [("Z", "c", 1, None)])))] == [
        "x waits for c"
    ]
    dispatch = DynamicDispatch(stnu)
    assert dispatch.next_decision(Fraction(10**9)) is None
    with pytest.raises(InputError, match="expected an observation first"):
        dispatch.execute(point("x"), Fraction(5))
    dispatch.observe(point("c"), Fraction(10**9))
    assert dispatch.next_decision(Fraction(10**9)) == (10**9 + 1, (point("x"),))
    assert dispatch.latest(point("x")) == 10**9 + 4


def test_a_network_that_is_not_controllable_is_not_dispatched():
    with pytest.raises(RefutedError, match="is not dynamically controllable: c as long as 9"):
        DynamicDispatch(network([("x", "c", 1, 2)], [("Z", "c", 5, 9)]))


def test_false_reports_are_refused():
    dispatch = DynamicDispatch(network([("c", "x", 0, 1)], [("y", "c", 2, 3)]))
    with pytest.raises(InputError, match="expected y before it"):
        dispatch.observe(point("c"), Fraction(2))
    dispatch.execute(point("y"), Fraction(0))
    with pytest.raises(InputError, match="found y again at 1; it happened at 0"):
        dispatch.execute(point("y"), Fraction(1))
    with pytest.raises(InputError, match="expected it to be observed"):
        dispatch.execute(point("c"), Fraction(2))
    with pytest.raises(InputError, match="expected the end of a contingent link"):
        dispatch.observe(point("x"), Fraction(2))
    with pytest.raises(InputError, match="found c of length 4; expected what"):
        dispatch.observe(point("c"), Fraction(4))
    with pytest.raises(InputError, match="expected a time point of the network"):
        dispatch.execute(point("z"), Fraction(4))
