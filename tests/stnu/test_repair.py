"""Repairs: controllable, no cheaper, in the right directions; against another optimiser and brute force over a grid."""

from collections import Counter
from fractions import Fraction
from itertools import product
from random import Random

import pytest
import z3

from robust import stnu
from robust.irr.conflicts import Candidate
from robust.smt.limits import NEVER
from robust.stnu import RepairStatus, Side
from robust.stnu.repairs import NetworkRepairSearch
from tests.network import oracles
from tests.stnu.networks import drawn, dynamic_by_reductions, network, short_and_long

LATE = network(("A", "C", 1, 10, "contingent"), ("C", "D", 1, 2), ("A", "D", None, 8))
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


@short_and_long((100, 35), (3000, 600))
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


@short_and_long((45, 15), (1500, 150))
def test_costs_are_those_of_another_optimiser(seeds, least):
    compared = 0
    for seed, found, weights in refuted(seeds, 4, 3, 6, 5):
        assert stnu.repair(found, weights=weights).cost == by_z3(found, weights), seed
        compared += 1
    assert compared >= least


FAR = 6
"""What changes cost at most that a grid looks for where there is no repair."""


@pytest.mark.parametrize("frozen", ["nothing", "requirements", "any"])
@short_and_long((60, 5), (1300, 40))
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
