"""Repairs: controllable, no cheaper, in the right directions; against another optimiser and brute force over a grid."""

from collections import Counter
from fractions import Fraction
from itertools import product
from random import Random

import pytest
import z3

from robust import stnu
from robust.errors import InputError
from robust.irr.conflicts import Candidate
from robust.smt.limits import Deadline
from robust.stnu import RepairStatus, Side
from robust.stnu.repairs import NetworkRepairSearch
from tests.network import oracles
from tests.stnu.networks import explicit, network, random_network

LATE = network(("A", "C", 1, 10, "contingent"), ("C", "D", 1, 2), ("A", "D", None, 8))
ONE = Fraction(1)


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


def refuted(seeds, *shape):
    """Random networks that are not controllable, with random weights."""
    for seed in seeds:
        rng = Random(seed)  # noqa: S311
        try:
            found = network(*random_network(rng, *shape))
        except InputError:
            continue
        if not stnu.check(found).is_controllable:
            weights = {(link.source, link.target): Fraction(rng.randint(1, 4)) for link in found.links}
            yield seed, found, weights


def controllable(found):
    """By the rules of the literature instead of the package's algorithm."""
    links = [
        (one.source, one.target, one.lower, one.upper, *(["contingent"] if one.is_contingent else []))
        for one in found.links
    ]
    return oracles.dynamic_by_reductions(oracles.network(*explicit(links)))


@pytest.mark.parametrize(("seeds", "least"), [(range(150), 50), slow(range(1000, 3000), 600)], ids=["short", "long"])
def test_a_repaired_network_is_controllable_and_a_cent_less_is_not_enough(seeds, least):
    repaired = 0
    for seed, found, weights in refuted(seeds, 4, 3, 6, 5):
        result = stnu.repair(found, weights=weights)
        assert result.status is RepairStatus.OPTIMAL, seed
        assert controllable(result.network), seed
        assert result.cost == result.bound > 0
        assert result.cost == sum(one.amount * weights[one.link.source, one.link.target] for one in result.changes)
        for one in result.changes:
            assert (one.new > one.old) is ((one.side is Side.UPPER) != one.link.is_contingent), (seed, str(one))
            assert one.serves
        for one in result.changes:
            others = tuple(other for other in result.changes if other is not one)
            assert not controllable(changed(found, others, one, Fraction(99, 100))), (seed, str(one))
        repaired += 1
    assert repaired >= least


def changed(found, others, last, share):
    """The network with all changes but the last, of which it has only a share."""
    sides = {(one.link, one.side): one.new for one in others}
    sides[last.link, last.side] = last.old + (last.new - last.old) * share
    links = []
    for link in found.links:
        lower, upper = (sides.get((link, side), link.bound(side)) for side in (Side.LOWER, Side.UPPER))
        links.append(stnu.Link(link.source, link.target, lower, upper, link.is_contingent))
    return found.with_links(links)


def by_z3(found, weights):
    """The cheapest changes, by z3's optimisation over all conflicts that the changes of its answers leave."""
    search = NetworkRepairSearch(found, ONE, ONE, weights, Deadline())
    optimiser = z3.Optimize()
    names = {}
    for number, link in enumerate(found.links):
        for side in Side:
            if link.bound(side) is not None:
                name = f"{number}.{side.value}"
                names[name] = z3.Real(name), weights[link.source, link.target]
                optimiser.add(names[name][0] >= 0)
        both = [names[f"{number}.{side.value}"][0] for side in Side if f"{number}.{side.value}" in names]
        if link.is_contingent:
            optimiser.add(sum(both) <= z3.RealVal(str(link.upper - link.lower)))
    cost = optimiser.minimize(z3.Sum([variable * z3.RealVal(str(weight)) for variable, weight in names.values()]))
    while True:
        assert optimiser.check() == z3.sat
        model = optimiser.model()
        point = {name: Fraction(str(model.eval(one, model_completion=True))) for name, (one, _) in names.items()}
        conflict = search.violated(search_candidate(point))
        if conflict is None:
            return Fraction(str(cost.value()))
        optimiser.add(z3.Or([inequality(one, names) for one in search.clauses[conflict].choices]))


def search_candidate(point):
    return Candidate({}, {name: value for name, value in point.items() if value}, Fraction(0))


def inequality(constraint, names):
    left = z3.Sum([names[name][0] * factor for name, factor in constraint.coefficients])
    return left <= z3.RealVal(str(constraint.constant))


@pytest.mark.parametrize(("seeds", "least"), [(range(60), 20), slow(range(1000, 1500), 150)], ids=["short", "long"])
def test_costs_are_those_of_another_optimiser(seeds, least):
    compared = 0
    for seed, found, weights in refuted(seeds, 4, 3, 6, 5):
        assert stnu.repair(found, weights=weights).cost == by_z3(found, weights), seed
        compared += 1
    assert compared >= least


FAR = 6
"""What changes cost at most that a grid looks for where there is no repair."""


@pytest.mark.parametrize("frozen", ["nothing", "requirements", "any"])
@pytest.mark.parametrize(("seeds", "least"), [(range(60), 5), slow(range(1000, 1300), 40)], ids=["short", "long"])
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
            assert controllable(result.network), seed
            assert not any((one.link.source, one.link.target) in kept for one in result.changes), seed
        most = FAR if result.cost is None else -(-result.cost // 1) - 1
        bounds = [(at, side) for at, link in enumerate(found.links) for side in Side if link.bound(side) is not None]
        moving = [b for b in bounds if (found.links[b[0]].source, found.links[b[0]].target) not in kept]
        for amounts in product(range(int(most) + 1), repeat=len(moving)):
            if 0 < sum(amounts) <= most:
                other = with_amounts(found, {**dict.fromkeys(bounds, 0), **dict(zip(moving, amounts, strict=True))})
                assert other is None or not controllable(other), (seed, amounts)
        compared += most > 0
    assert compared >= least


def consistent(found):
    """Whether some times satisfy all links, as if nature let the dispatcher choose."""
    links = [(link.source, link.target, link.lower, link.upper) for link in found.links]
    free = oracles.network(links, [])
    return oracles.consistent(free.points, oracles.lengths(free)[0])


@pytest.mark.parametrize(
    ("seeds", "shape", "least"),
    [
        (range(200), (2, 1, 3, 3), 20),
        slow(range(1000, 3000), (2, 2, 3, 5), 400),
        slow(range(1000, 3000), (2, 2, 3, 8), 400),
        slow(range(1000, 3000), (4, 3, 6, 5), 400),
    ],
)
def test_contingent_links_can_be_tightened_wherever_some_times_satisfy_all_links(seeds, shape, least):
    outcomes = Counter()
    for seed, found, _ in refuted(seeds, *shape):
        result = stnu.repair(found, requirement=None)
        expected = RepairStatus.OPTIMAL if consistent(found) else RepairStatus.IMPOSSIBLE
        assert result.status is expected, seed
        assert result.network is None or controllable(result.network), seed
        outcomes[expected] += 1
    assert min(outcomes[RepairStatus.OPTIMAL], outcomes[RepairStatus.IMPOSSIBLE]) >= least, outcomes


def with_amounts(found, amounts):
    """The network with bounds moved in the direction in which a repair may; None if a contingent link is empty then."""
    links = []
    for at, link in enumerate(found.links):
        sign = -1 if link.is_contingent else 1
        lower = None if link.lower is None else link.lower - sign * amounts[at, Side.LOWER]
        upper = None if link.upper is None else link.upper + sign * amounts[at, Side.UPPER]
        if lower is not None and upper is not None and lower > upper:
            return None
        links.append(stnu.Link(link.source, link.target, lower, upper, link.is_contingent))
    return found.with_links(links)


# -- one network -------------------------------------------------------------------------------------------------------


def test_one_bound():
    result = stnu.repair(LATE)
    assert (result.status, result.cost, result.bound, result.gap) == (RepairStatus.OPTIMAL, 3, 3, 0)
    assert sum(one.amount for one in result.changes) == 3
    assert stnu.repair(LATE, contingent=None).changes[0].link.is_contingent is False
    (only,) = stnu.repair(LATE, requirement=None).changes
    assert (str(only), only.amount) == ("A => C: upper bound 10 to 7", 3)
    assert only.serves == ("A => C as long as 10 cannot be met with A -> D in [-inf, 8]; C -> D in [1, 2]",)


def test_an_inequality_that_holds_without_changes_is_a_choice():
    """The lower bound moves too far for `n1 -> n2` if it moves alone."""
    tight = network(("n1", "n2", None, 5), ("n0", "n2", 4, 4), ("n1", "n2", 4, 6, "contingent"))
    result = stnu.repair(tight, requirement=None)
    assert (result.status, result.cost) == (RepairStatus.OPTIMAL, 2)
    assert [str(one) for one in result.changes] == ["n1 => n2: lower bound 4 to 5", "n1 => n2: upper bound 6 to 5"]


def test_weights_decide_which():
    dear = {("A", "D"): Fraction(5), ("C", "D"): Fraction(7)}
    (only,) = stnu.repair(LATE, weights=dear).changes
    assert (only.link.ends, only.cost) == ("A => C", 3)
    (only,) = stnu.repair(LATE, weights={("A", "C"): None, ("C", "D"): None}).changes
    assert str(only) == "A -> D: upper bound 8 to 11"


def test_nothing_to_repair_and_nothing_that_helps():
    fine = stnu.repair(network(("A", "C", 1, 7, "contingent"), ("A", "D", None, 8)))
    assert (fine.status, fine.cost, fine.changes) == (RepairStatus.UNNEEDED, 0, ())
    hopeless = stnu.repair(LATE, requirement=None, contingent=None)
    assert (hopeless.status, hopeless.network, hopeless.cost, hopeless.gap) == (
        RepairStatus.IMPOSSIBLE,
        None,
        None,
        None,
    )
    endless = network(("A", "C", 1, None, "contingent"), ("A", "D", None, 8), ("C", "D", 0, None))
    assert stnu.repair(endless).status is RepairStatus.IMPOSSIBLE


def test_out_of_time():
    result = stnu.repair(LATE, timeout=0)
    assert (result.status, result.bound, result.cut_short) == (RepairStatus.UNKNOWN, 0, True)


def test_the_best_so_far_and_its_gap():
    """After the dive, a repair is known before it is proved to be the cheapest."""
    gaps = 0
    for seed, found, weights in refuted(range(40), 4, 3, 6, 5):
        search = NetworkRepairSearch(found, ONE, ONE, weights, Deadline())
        best = search.run()
        again = NetworkRepairSearch(found, ONE, ONE, weights, Deadline())
        again._dive(search_candidate({}))
        early = again.so_far(timed_out=False)
        assert early.status is RepairStatus.FEASIBLE, seed
        assert early.interrupted
        assert controllable(early.network), seed
        assert early.cost >= best.cost >= early.bound, seed
        gaps += early.gap > 0
    assert gaps > 10
