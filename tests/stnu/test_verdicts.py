"""Verdicts, executions and repairs of random networks, against rules of the literature, optimisers and brute force."""

import json
import time
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path
from random import Random

import pytest
import z3

from benchmarks.irr.stnu import team_network
from robust import InputError, stnu
from robust.execute.controllability import Control, Controllability, ControlVerdict
from robust.irr.conflicts import Candidate
from robust.network.dispatchable import Windows
from robust.plan.model import ZERO
from robust.smt.limits import NEVER
from robust.stnu import RepairStatus, Side
from robust.stnu.graphml import graphml, parse_graphml
from robust.stnu.network import network_of_plan
from robust.stnu.network_json import network_json, parse_network_json
from robust.stnu.verdicts import NetworkRepairSearch
from tests.execute.plans import box_of
from tests.execute.test_controllability_boxes import MEET, random_box
from tests.network import oracles
from tests.network.test_uncertain import Executing, chosen_length
from tests.stnu.networks import corners, drawn, dynamic_by_reductions, network, short_and_long

SHARED = Path(__file__).resolve().parents[3] / "shared" / "stnu"
LATE = network(("A", "C", 1, 10, "contingent"), ("C", "D", 1, 2), ("A", "D", None, 8))


@pytest.mark.parametrize("shape", [(4, 3, 6, 5), (2, 2, 4, 2)])
@short_and_long((150, 20), (3000, 300))
def test_verdicts_against_the_rules_of_morris_and_muscettola(seeds, least, shape):
    seen = Counter()
    for seed, _, found in drawn(seeds, *shape):
        result = stnu.check(found)
        assert result.is_controllable is dynamic_by_reductions(found), (seed, *map(str, found.links))
        assert result.is_controllable or stnu.refutes(found, result.cycle), seed
        seen[result.is_controllable] += 1
    assert min(seen[True], seen[False]) >= least, seen


class AtAnyTime(Executing):
    """Executes a minimal network."""

    def __init__(self, found, tables):
        self.stnu, self.windows, self.index = found.examined.stnu, Windows(tables), tables.index
        self.happened(ZERO, Fraction(0))


@short_and_long((70, 14), (3000, 400))
def test_the_minimal_network_is_executed_whatever_nature_draws(seeds, least):
    """At all extreme lengths, and some between: all requirements hold, and each link takes as long as was drawn; also
    at any times that its neighbours allow each time point, in any order."""
    controllable = 0
    for seed, rng, found in drawn(seeds, 4, 3, 5, 6):
        result = stnu.dispatch(found)
        if result.tables is None:
            continue
        controllable += 1
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
        links = found.examined.stnu.links
        for _ in range(6):
            lengths = {link: chosen_length(rng, link) for link in links if link.is_contingent}
            one = AtAnyTime(found, result.tables)
            list(one.run(lengths, rng))
            assert all(oracles.satisfies(link, one.times) for link in links if not link.is_contingent), seed
    assert controllable >= least


@pytest.mark.skipif(not SHARED.is_dir(), reason="the networks are not here")
def test_networks_with_known_controllability():
    verdicts = json.loads((SHARED / "verdicts.json").read_text(encoding="utf-8"))
    assert len(verdicts) == 6
    for name, expected in verdicts.items():
        result = stnu.check(stnu.load(SHARED / name))
        assert result.verdict.value == expected, name
        assert stnu.refutes(result.network, result.cycle) is not result.is_controllable
        assert parse_network_json(network_json(result.network), "again").links == result.network.links


def test_the_network_of_a_plan_is_as_controllable_as_the_box():
    """Written and read again, too."""
    seen = Counter()
    for seed in range(150):
        _, plan, box = random_box(seed, 2)
        controllable = Controllability(plan, box).finding(Control.DYNAMIC).verdict is ControlVerdict.CONTROLLABLE
        try:
            found = network_of_plan(plan, box, "plan")
        except InputError as error:
            assert "contradiction" in error.message  # noqa: PT017 - the others are judged
            assert not controllable
            continue
        for again in (found, parse_graphml(graphml(found)[0], "plan"), parse_network_json(network_json(found), "plan")):
            assert stnu.check(again).is_controllable is controllable, seed
        seen[controllable] += 1
    assert min(seen[True], seen[False]) > 20
    found = network_of_plan(MEET, box_of(p=(1, 3), q=(2, 2)), "plan")
    links = {link.ends: (link.lower, link.upper) for link in found.links}
    assert found.origin == found.nodes[0] == "Z"
    assert (links["a.start => a.end"], links["b.start => b.end"]) == ((1, 3), (2, 2))
    assert links["a.end -> b.start"] == (-1, 2)


def test_a_witness_is_a_closed_walk_through_the_network():
    result = stnu.check(LATE)
    assert result.verdict is stnu.Verdict.UNCONTROLLABLE
    assert sum(edge.value for edge in result.cycle) == -3
    assert result.reason == "A => C as long as 10 cannot be met with A -> D in [-inf, 8]; C -> D in [1, 2]"
    first, *rest = result.cycle
    for network_, cycle, refutes in (
        (LATE, result.cycle, True),
        (LATE, (), False),
        (LATE, result.cycle[:-1], False),
        (LATE, (replace(first, value=first.value - 1), *rest), False),
        (network(("A", "C", 1, 7, "contingent"), ("C", "D", 1, 2), ("A", "D", None, 8)), result.cycle, False),
    ):
        assert stnu.refutes(network_, cycle) is refutes
    late = stnu.check(LATE, timeout=0)
    assert (late.verdict, late.reason) == (stnu.Verdict.UNKNOWN, "out of time")


def test_a_lower_case_edge_that_cannot_be_reduced_away_refutes_nothing():
    """D has to be 1 before C, which is a matter of C's length; a negative walk that only uses C twice is none."""
    near = network(("A", "C", 1, 3, "contingent"), ("C", "D", 0, 1))
    link = near.links[0]
    upper = stnu.Edge(link.target, link.source, -link.upper, "upper", str(link))
    lower = stnu.Edge(link.source, link.target, link.lower, "lower", str(link))
    assert upper.value + lower.value < 0
    assert not stnu.refutes(near, (upper, lower))


def test_a_link_that_may_end_before_it_starts_settles_its_source_beforehand():
    """C is between 2 before A and 3 after it, and A is settled 2 before it happens."""
    result = stnu.dispatch(network(("A", "C", -2, 3, "contingent"), ("B", "C", 4, 9)))
    assert result.checked.is_controllable
    for length in (0, 5):
        done = result.execute_with(dict.fromkeys(result.tables.natural, Fraction(length)))
        times = {event.point: event.time for event in done.events}
        assert (times["A"] - times["commit(A,C)"], times["C"] - times["A"]) == (2, length - 2)
    assert not stnu.check(network(("A", "C", -2, 3, "contingent"), ("C", "A", 0, 9))).is_controllable


def test_decisions_have_names_that_no_time_point_has():
    """Neither a time point of the file nor the decision of another link is taken for it."""
    named = network(("A", "C", -2, 3, "contingent"), ("A", "commit(A,C)", 5, 5))
    alike = network(("a,b", "c", -2, 3, "contingent"), ("a", "b,c", -1, 4, "contingent"), ("a,b", "a", 4, 4))
    assert (list(named.decisions.values()), len(set(alike.decisions.values()))) == (["commit(A,C)'"], 2)
    for found in (named, alike):
        assert stnu.check(found).is_controllable
        assert not stnu.dispatch(found).execute(seed=1).violated
    refuted = stnu.check(network(("A", "C", -2, 3, "contingent"), ("A", "C", 0, 3), ("A", "commit(A,C)", 5, 5)))
    assert not refuted.is_controllable
    assert stnu.refutes(refuted.network, refuted.cycle)


@pytest.mark.parametrize("origin", [None, "Z"])
def test_an_origin_is_first(origin):
    before = network(("Z", "A", -5, 5), ("A", "B", 4, 4), ("Z", "B", None, 3), origin=origin)
    assert stnu.check(before).is_controllable is (origin is None)


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


def closure(size, edges):
    """Shortest paths."""
    longest = oracles.closure(range(size), [(a, b, -weight) for a, b, weight in edges])
    return {pair: -weight for pair, weight in longest.items()}


def vee_distances(size, edges):
    """Shortest paths whose negative edges come first: what a dispatcher sees who looks at neighbours only."""
    after = closure(size, [edge for edge in edges if edge[2] >= 0])
    paths = {}
    for (a, b), first in closure(size, [edge for edge in edges if edge[2] < 0]).items():
        for c in range(size):
            if (b, c) in after:
                paths[a, c] = min(first + after[b, c], paths.get((a, c), first + after[b, c]))
    return paths


def test_no_requirement_of_a_minimal_network_can_be_left_out():
    """A network is dispatchable if negative edges come first on a shortest path between any two (Morris, 2014)."""
    removed = 0
    for seed, _, found in drawn(range(70), 3, 2, 5, 6):
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
    assert removed > 25


ONE = Fraction(1)


def refuted(seeds, *shape):
    """Random networks that are not controllable, with random weights."""
    for seed, rng, found in drawn(seeds, *shape):
        if not stnu.check(found).is_controllable:
            yield seed, found, {(link.source, link.target): Fraction(rng.randint(1, 4)) for link in found.links}


def with_bounds(found, bound_of):
    """The network with other bounds of its links; None if a link is empty then."""
    links = []
    for at, link in enumerate(found.links):
        lower, upper = (None if link.bound(side) is None else bound_of(at, link, side) for side in Side)
        if lower is not None and upper is not None and lower > upper:
            return None
        links.append(stnu.Link(link.source, link.target, lower, upper, link.is_contingent))
    return found.with_links(links)


@short_and_long((60, 20), (3000, 600))
def test_a_repaired_network_is_controllable_and_a_cent_less_is_not_enough(seeds, least):
    repaired = 0
    for seed, found, weights in refuted(seeds, 4, 3, 6, 5):
        result = stnu.repair(found, weights=weights)
        assert result.status is RepairStatus.OPTIMAL, seed
        assert dynamic_by_reductions(result.network), seed
        assert result.cost == result.bound > 0
        assert result.cost == sum(one.amount * weights[one.link.source, one.link.target] for one in result.changes)
        new = {(one.link, one.side): one.new for one in result.changes}
        for one in result.changes:
            assert (one.new > one.old) is ((one.side is Side.UPPER) != one.link.is_contingent), (seed, str(one))
            assert one.serves
            less = new | {(one.link, one.side): one.old + (one.new - one.old) * Fraction(99, 100)}
            nearly = with_bounds(found, lambda _, link, side, less=less: less.get((link, side), link.bound(side)))
            assert not dynamic_by_reductions(nearly), (seed, str(one))
        repaired += 1
    assert repaired >= least


def by_z3(found, weights):
    """The cheapest changes, by z3's optimisation over all conflicts that the changes of its answers leave."""
    search = NetworkRepairSearch(found, ONE, ONE, weights, NEVER)
    optimiser = z3.Optimize()
    names, costs = {}, []
    for number, link in enumerate(found.links):
        both = {
            f"{number}.{side.value}": z3.Real(f"{number}.{side.value}") for side in Side if link.bound(side) is not None
        }
        optimiser.add(*(one >= 0 for one in both.values()))
        costs += [one * z3.RealVal(str(weights[link.source, link.target])) for one in both.values()]
        if link.is_contingent:
            optimiser.add(sum(both.values()) <= z3.RealVal(str(link.upper - link.lower)))
        names |= both
    cost = optimiser.minimize(z3.Sum(costs))
    while True:
        assert optimiser.check() == z3.sat
        model = optimiser.model()
        point = {name: Fraction(str(model.eval(one, model_completion=True))) for name, one in names.items()}
        conflict = search.violated(candidate(point))
        if conflict is None:
            return Fraction(str(cost.value()))
        optimiser.add(z3.Or([
            z3.Sum([names[name] * factor for name, factor in one.coefficients]) <= z3.RealVal(str(one.constant))
            for one in search.clauses[conflict].choices
        ]))  # fmt: skip


def candidate(point):
    return Candidate({}, {name: value for name, value in point.items() if value}, Fraction(0))


@short_and_long((30, 10), (1500, 150))
def test_costs_are_those_of_another_optimiser(seeds, least):
    compared = 0
    for seed, found, weights in refuted(seeds, 4, 3, 6, 5):
        assert stnu.repair(found, weights=weights).cost == by_z3(found, weights), seed
        compared += 1
    assert compared >= least


FAR = 6
"""What changes cost at most that a grid looks for where there is no repair."""


@pytest.mark.parametrize("frozen", ["nothing", "requirements", "any"])
@short_and_long((40, 3), (1300, 40))
def test_no_cheaper_changes_on_a_grid(seeds, least, frozen):
    """All changes in whole units that cost less leave the network uncontrollable, by the rules of the literature."""
    compared = 0
    for seed, found, _ in refuted(seeds, 2, 1, 3, 3):
        rng = Random(seed)  # noqa: S311
        kept = {
            (link.source, link.target)
            for link in found.links
            if frozen != "nothing" and (not link.is_contingent if frozen == "requirements" else rng.random() < 0.4)
        }
        result = stnu.repair(found, weights=dict.fromkeys(kept))
        assert result.status in {RepairStatus.OPTIMAL, RepairStatus.IMPOSSIBLE}, seed
        if result.network is not None:
            assert dynamic_by_reductions(result.network), seed
            assert not any((one.link.source, one.link.target) in kept for one in result.changes), seed
        most = FAR if result.cost is None else -(-result.cost // 1) - 1
        moving = [
            (at, side)
            for (at, link), side in product(enumerate(found.links), Side)
            if link.bound(side) is not None and (link.source, link.target) not in kept
        ]
        for amounts in product(range(int(most) + 1), repeat=len(moving)):
            if 0 < sum(amounts) <= most:
                by = dict(zip(moving, amounts, strict=True))

                def moved(at, link, side, by=by):
                    outwards = (side is Side.UPPER) != link.is_contingent
                    return link.bound(side) + by.get((at, side), 0) * (1 if outwards else -1)

                other = with_bounds(found, moved)
                assert other is None or not dynamic_by_reductions(other), (seed, amounts)
        compared += most > 0
    assert compared >= least


def consistent(found):
    """Whether some times satisfy all links, as if nature let the dispatcher choose."""
    free = oracles.network([(link.source, link.target, link.lower, link.upper) for link in found.links], [])
    return oracles.consistent(free.points, oracles.lengths(free)[0])


@pytest.mark.parametrize(
    ("seeds", "shape", "least"),
    [
        (range(200), (2, 1, 3, 3), 20),
        *(
            pytest.param(range(1000, 3000), shape, 400, marks=pytest.mark.slow)
            for shape in ((2, 2, 3, 5), (2, 2, 3, 8), (4, 3, 6, 5))
        ),
    ],
)
def test_contingent_links_can_be_tightened_wherever_some_times_satisfy_all_links(seeds, shape, least):
    outcomes = Counter()
    for seed, found, _ in refuted(seeds, *shape):
        result = stnu.repair(found, requirement=None)
        expected = RepairStatus.OPTIMAL if consistent(found) else RepairStatus.IMPOSSIBLE
        assert result.status is expected, seed
        assert result.network is None or dynamic_by_reductions(result.network), seed
        outcomes[expected] += 1
    assert min(outcomes[RepairStatus.OPTIMAL], outcomes[RepairStatus.IMPOSSIBLE]) >= least, outcomes


def test_the_best_so_far_and_its_gap():
    """After the dive, a repair is known before it is proved to be the cheapest."""
    gaps = 0
    for seed, found, weights in refuted(range(40), 4, 3, 6, 5):
        best = NetworkRepairSearch(found, ONE, ONE, weights, NEVER).run()
        again = NetworkRepairSearch(found, ONE, ONE, weights, NEVER)
        again._dive(candidate({}))
        early = again.so_far(timed_out=False)
        assert (early.status, early.interrupted) == (RepairStatus.FEASIBLE, True), seed
        assert dynamic_by_reductions(early.network), seed
        assert early.cost >= best.cost >= early.bound, seed
        gaps += early.gap > 0
    assert gaps > 10


def test_one_bound():
    result = stnu.repair(LATE)
    assert (result.status, result.cost, result.bound, result.gap) == (RepairStatus.OPTIMAL, 3, 3, 0)
    assert sum(one.amount for one in result.changes) == 3
    assert stnu.repair(LATE, contingent=None).changes[0].link.is_contingent is False
    (only,) = stnu.repair(LATE, requirement=None).changes
    assert (str(only), only.amount) == ("A => C: upper bound 10 to 7", 3)
    assert only.serves == ("A => C as long as 10 cannot be met with A -> D in [-inf, 8]; C -> D in [1, 2]",)
    (only,) = stnu.repair(LATE, weights={("A", "D"): Fraction(5), ("C", "D"): Fraction(7)}).changes
    assert (only.link.ends, only.cost) == ("A => C", 3)
    (only,) = stnu.repair(LATE, weights={("A", "C"): None, ("C", "D"): None}).changes
    assert str(only) == "A -> D: upper bound 8 to 11"


def test_an_inequality_that_holds_without_changes_is_a_choice():
    """The lower bound moves too far for `n1 -> n2` if it moves alone."""
    tight = network(("n1", "n2", None, 5), ("n0", "n2", 4, 4), ("n1", "n2", 4, 6, "contingent"))
    result = stnu.repair(tight, requirement=None)
    assert (result.status, result.cost) == (RepairStatus.OPTIMAL, 2)
    assert [str(one) for one in result.changes] == ["n1 => n2: lower bound 4 to 5", "n1 => n2: upper bound 6 to 5"]


def test_nothing_to_repair_nothing_that_helps_and_no_time():
    fine = stnu.repair(network(("A", "C", 1, 7, "contingent"), ("A", "D", None, 8)))
    assert (fine.status, fine.cost, fine.changes) == (RepairStatus.UNNEEDED, 0, ())
    hopeless = stnu.repair(LATE, requirement=None, contingent=None)
    assert hopeless.status is RepairStatus.IMPOSSIBLE
    assert hopeless.network is hopeless.cost is hopeless.gap is None
    endless = network(("A", "C", 1, None, "contingent"), ("A", "D", None, 8), ("C", "D", 0, None))
    assert stnu.repair(endless).status is RepairStatus.IMPOSSIBLE
    late = stnu.repair(LATE, timeout=0)
    assert (late.status, late.bound, late.cut_short) == (RepairStatus.UNKNOWN, 0, True)
