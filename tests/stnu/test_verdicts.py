"""Verdicts, witnesses and executions of random networks, against rules of the literature, brute force and nature."""

import json
import time
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from benchmarks.irr.stnu import team_network
from robust import stnu
from robust.errors import InputError
from robust.network.dispatchable import Windows
from robust.plan.model import ZERO
from tests.network import oracles
from tests.network.test_uncertain import Executing, chosen_length
from tests.stnu.networks import corners, explicit, network, random_network

SHARED = Path(__file__).resolve().parents[3] / "shared" / "stnu"


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


def drawn(seeds, *shape, **more):
    """Networks of seeds that do not contradict themselves, with the generator that goes on."""
    for seed in seeds:
        rng = Random(seed)  # noqa: S311
        links = random_network(rng, *shape, **more)
        with suppress(InputError):
            yield seed, rng, links, network(*links)


def judged(seeds, *shape, oracle, **more):
    """How many networks are controllable and not, all of them judged in the same way by an oracle."""
    seen = {True: 0, False: 0}
    for seed, _, links, found in drawn(seeds, *shape, **more):
        result = stnu.check(found)
        assert result.is_controllable is oracle(oracles.network(*explicit(links))), (seed, *map(str, found.links))
        if not result.is_controllable:
            assert stnu.refutes(found, result.cycle), seed
        seen[result.is_controllable] += 1
    return seen


@pytest.mark.parametrize(("seeds", "least"), [(range(150), 20), slow(range(1000, 3000), 300)], ids=["short", "long"])
def test_verdicts_against_the_rules_of_morris_and_muscettola(seeds, least):
    seen = judged(seeds, 4, 3, 6, 5, oracle=oracles.dynamic_by_reductions)
    assert min(seen.values()) >= least, seen


@pytest.mark.parametrize(("seeds", "least"), [(range(150), 20), slow(range(1000, 3000), 300)], ids=["short", "long"])
def test_verdicts_against_the_game_of_nature_and_dispatcher(seeds, least):
    seen = judged(seeds, 2, 2, 4, 2, oracle=lambda one: oracles.dynamic_by_game(one, 20), chained=False)
    assert min(seen.values()) >= least, seen


@pytest.mark.parametrize(("seeds", "least"), [(range(150), 300), slow(range(1000, 3000), 4000)], ids=["short", "long"])
def test_the_minimal_network_is_executed_whatever_nature_draws(seeds, least):
    """At all extreme lengths, and some between: all requirements hold, and each link takes as long as was drawn."""
    runs = 0
    for seed, rng, _, found in drawn(seeds, 4, 3, 5, 6):
        result = stnu.dispatch(found)
        if result.tables is None:
            continue
        ends = {link.target: (link.lower, link.upper) for link in result.tables.natural.values()}
        between = [
            {end: low + (high - low) * Fraction(rng.randint(0, 12), 12) for end, (low, high) in ends.items()}
            for _ in range(3)
        ]
        for lengths in (*corners(ends), *between):
            done = result.execute_with(lengths)
            times = {event.point: event.time for event in done.events}
            assert not done.violated, (seed, lengths, done.events)
            for link in found.links:
                distance = times[link.target] - times[link.source]
                assert link.lower is None or distance >= link.lower, (seed, str(link))
                assert link.upper is None or distance <= link.upper, (seed, str(link))
            runs += 1
    assert runs >= least


class AtAnyTime(Executing):
    """Executes a minimal network."""

    def __init__(self, found, tables):
        self.stnu, self.windows, self.index = found.examined.stnu, Windows(tables), tables.index
        self.happened(ZERO, Fraction(0))


@pytest.mark.parametrize(("seeds", "least"), [(range(150), 200), slow(range(1000, 3000), 2500)], ids=["short", "long"])
def test_the_minimal_network_is_dispatchable(seeds, least):
    """Executed at any times that its neighbours allow each time point, in any order, it satisfies all requirements."""
    runs = 0
    for seed, rng, _, found in drawn(seeds, 4, 3, 5, 6):
        tables = stnu.dispatch(found).tables
        for _ in range(6 if tables is not None else 0):
            links = found.examined.stnu.links
            lengths = {link: chosen_length(rng, link) for link in links if link.is_contingent}
            one = AtAnyTime(found, tables)
            list(one.run(lengths, rng))
            assert all(oracles.satisfies(link, one.times) for link in links if not link.is_contingent), seed
            runs += 1
    assert runs >= least


def test_networks_that_are_not_controllable_have_no_strategy_at_the_extremes_of_nature():
    """Where no schedule suits some extreme lengths even if they are known beforehand, there is no control either."""
    hopeless = 0
    for seed, _, links, found in drawn(range(200), 3, 2, 6, 4):
        if not oracles.weak_by_corners(oracles.network(*explicit(links))):
            assert not stnu.check(found).is_controllable, seed
            hopeless += 1
    assert hopeless > 50


@pytest.mark.skipif(not SHARED.is_dir(), reason="the networks are not here")
def test_networks_with_known_controllability():
    verdicts = json.loads((SHARED / "verdicts.json").read_text(encoding="utf-8"))
    assert len(verdicts) == 6
    for name, expected in verdicts.items():
        result = stnu.check(stnu.load(SHARED / name))
        assert result.verdict.value == expected, name
        assert stnu.refutes(result.network, result.cycle) is not result.is_controllable


# -- witnesses ---------------------------------------------------------------------------------------------------------

LATE = network(("A", "C", 1, 10, "contingent"), ("C", "D", 1, 2), ("A", "D", None, 8))


def test_a_witness_is_a_closed_walk_through_the_network():
    result = stnu.check(LATE)
    assert result.verdict is stnu.Verdict.UNCONTROLLABLE
    assert sum(edge.value for edge in result.cycle) == -3
    assert result.reason == "A => C as long as 10 cannot be met with A -> D in [-inf, 8]; C -> D in [1, 2]"


def test_what_is_no_witness_is_refused():
    cycle = stnu.check(LATE).cycle
    assert stnu.refutes(LATE, cycle)
    assert not stnu.refutes(LATE, ())
    assert not stnu.refutes(LATE, cycle[:-1])
    assert not stnu.refutes(LATE, (replace(cycle[0], value=cycle[0].value - 1), *cycle[1:]))
    assert not stnu.refutes(network(("A", "C", 1, 7, "contingent"), *[("C", "D", 1, 2), ("A", "D", None, 8)]), cycle)


def test_a_lower_case_edge_that_cannot_be_reduced_away_refutes_nothing():
    """D has to be 1 before C, which is a matter of C's length; a negative walk that only uses C twice is none."""
    near = network(("A", "C", 1, 3, "contingent"), ("C", "D", 0, 1))
    edges = {(edge.source, edge.target, edge.case): edge for edge in _edges(near)}
    walk = (edges["C", "A", "upper"], edges["A", "C", "lower"])
    assert sum(edge.value for edge in walk) < 0
    assert not stnu.refutes(near, walk)


def _edges(found):
    link = found.links[0]
    yield stnu.Edge(link.source, link.target, link.lower, "lower", str(link))
    yield stnu.Edge(link.target, link.source, -link.upper, "upper", str(link))


def test_a_link_that_may_end_before_it_starts_settles_its_source_beforehand():
    """C is between 2 before A and 3 after it, and A is settled 2 before it happens."""
    late = network(("A", "C", -2, 3, "contingent"), ("B", "C", 4, 9))
    result = stnu.dispatch(late)
    assert result.checked.is_controllable
    for length in (0, 5):
        times = {
            event.point: event.time
            for event in result.execute_with(dict.fromkeys(result.tables.natural, Fraction(length))).events
        }
        assert times["A"] - times["commit(A,C)"] == 2
        assert times["C"] - times["A"] == length - 2
    waiting = network(("A", "C", -2, 3, "contingent"), ("C", "A", 0, 9))
    assert not stnu.check(waiting).is_controllable


def test_an_origin_is_first():
    before = network(("Z", "A", -5, 5), ("A", "B", 4, 4), ("Z", "B", None, 3))
    assert stnu.check(before).is_controllable
    assert not stnu.check(
        network(*[(a.source, a.target, a.lower, a.upper) for a in before.links], origin="Z")
    ).is_controllable


def test_out_of_time():
    result = stnu.check(LATE, timeout=0)
    assert (result.verdict, result.reason) == (stnu.Verdict.UNKNOWN, "out of time")


# -- minimal networks --------------------------------------------------------------------------------------------------


def vee_distances(size, edges):
    """Shortest paths whose negative edges come first: what a dispatcher sees who looks at neighbours only."""
    before = closure(size, [edge for edge in edges if edge[2] < 0])
    after = closure(size, [edge for edge in edges if edge[2] >= 0])
    found = {}
    for (a, b), first in before.items():
        for c in range(size):
            if (b, c) in after:
                found[a, c] = min(first + after[b, c], found.get((a, c), first + after[b, c]))
    return found


def closure(size, edges):
    found = {(a, a): Fraction(0) for a in range(size)}
    for a, b, weight in edges:
        found[a, b] = min(weight, found.get((a, b), weight))
    for b in range(size):
        for a in range(size):
            for c in range(size):
                if (a, b) in found and (b, c) in found:
                    whole = found[a, b] + found[b, c]
                    found[a, c] = min(whole, found.get((a, c), whole))
    return found


def test_no_requirement_of_a_minimal_network_can_be_left_out():
    """A network is dispatchable if negative edges come first on a shortest path between any two (Morris, 2014)."""
    removed = 0
    for seed, _, _, found in drawn(range(120), 3, 2, 5, 6):
        tables = stnu.dispatch(found).tables
        if tables is None:
            continue
        size = len(tables.points)
        edges = [(a, b, weight) for a, reached in enumerate(tables.above) for b, weight in reached]
        whole = closure(size, edges)
        assert vee_distances(size, edges) == whole, seed
        rigid = {(a, b) for (a, b), gap in whole.items() if a != b and whole.get((b, a)) == -gap}
        links = [(tables.index[link.source], tables.index[link.target]) for link in tables.natural.values()]
        kept = rigid | {*links, *((b, a) for a, b in links)}
        for edge in edges:
            if edge[:2] not in kept and not any(edge[0] in pair or edge[1] in pair for pair in rigid):
                assert vee_distances(size, [one for one in edges if one != edge]) != whole, (seed, edge)
                removed += 1
    assert removed > 50


def test_a_hundred_time_points_take_less_than_50_ms():
    """Of processor time; about 5 ms where it was measured."""
    for seed in range(6):
        found = team_network(100, seed)
        seconds = []
        for _ in range(3):
            started = time.process_time()
            stnu.check(found.with_links(found.links))
            seconds.append(time.process_time() - started)
        assert min(seconds) < 0.05, seed


def test_decisions_have_names_that_no_time_point_has():
    """Neither a time point of the file nor the decision of another link is taken for it."""
    named = network(("A", "C", -2, 3, "contingent"), ("A", "commit(A,C)", 5, 5))
    alike = network(("a,b", "c", -2, 3, "contingent"), ("a", "b,c", -1, 4, "contingent"), ("a,b", "a", 4, 4))
    assert list(named.decisions.values()) == ["commit(A,C)'"]
    assert len(set(alike.decisions.values())) == 2
    for found in (named, alike):
        assert stnu.check(found).is_controllable
        assert not stnu.dispatch(found).execute(seed=1).violated
    refuted = stnu.check(network(("A", "C", -2, 3, "contingent"), ("A", "C", 0, 3), ("A", "commit(A,C)", 5, 5)))
    assert not refuted.is_controllable
    assert stnu.refutes(refuted.network, refuted.cycle)
