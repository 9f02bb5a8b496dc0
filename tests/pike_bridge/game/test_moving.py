"""The least change of bounds after which a plan is controllable: against all changes on the grid, and by hand."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import product
from random import Random

import jsonschema

from robust import pike
from robust.irr.conflicts import RepairStatus
from robust.pike_bridge.envelopes.parameters import specifications
from robust.pike_bridge.game.controllability import DecidingControllability
from robust.pike_bridge.game.rules import GameRules
from tests.pike_bridge.game.minimax import limited, longest
from tests.pike_bridge.game.test_controllability import KITCHEN, NO, WING, YES, bound, depending, plan_of, work
from tests.pike_bridge.game.test_dividing import chained
from tests.sampling import often
from tests.schemas import schema


def repaired(plan, *texts, **options):
    return pike.controllable(pike.parametrize(plan, specifications(texts, None, ())), repair=True, **options)


def in_sequence(most):
    activities = [work("a", "a.end", 1, 4), work("b", "b.end", 1, 5)]
    constraints = [bound("a.end", "b"), bound("a", "b.end", 0, most)]
    return plan_of("a a.end b b.end", (), constraints, activities)


def test_a_sum_of_bounds_has_one_conflict():
    """Both activities take 9 at worst, and 7 are left: 2 of either, or of the limit."""
    texts = "limit=at-most:a:b.end,weight=3", "first=at-most:(work a),weight=2", "second=at-most:(work b),weight=2.5"
    found = repaired(in_sequence(7), *texts)
    assert found.repair.status is RepairStatus.OPTIMAL
    assert [(each.parameter.name, each.old, each.new) for each in found.repair.changes] == [("first", 4, 2)]
    assert (found.repair.cost, found.repair.conflicts) == (4, 1)
    assert "in all 4:\n  first: 4 to 2" in str(found)
    jsonschema.validate(found.as_dict(), schema("robust/pike-controllable/1"))
    [first, second] = repaired(in_sequence(4), *texts).repair.changes  # 5 too little, of which the first has 3
    assert (first.new, second.new) == (1, 3)


def test_nothing_has_to_change_or_nothing_helps():
    assert repaired(in_sequence(9), "limit=at-most:a:b.end").repair.status is RepairStatus.UNNEEDED
    assert repaired(in_sequence(4), "first=at-most:(work a)").repair.status is RepairStatus.IMPOSSIBLE
    assert "No bound has to be changed." in str(pike.controllable(WING, ["limit=at-most:e1:e58"], repair=True))


def test_several_situations_move_bounds_by_the_grid():
    found = repaired(depending(3, 4), "most=at-most:(work begin)")
    assert found.repair.status is RepairStatus.OPTIMAL
    assert [(each.old, each.new) for each in found.repair.changes] == [(4, 2)]


def test_what_is_least_is_not_known_for_rational_people():
    found = pike.controllable(KITCHEN, ["limit=at-most:e1:e44"], rational=True, repair=True)
    assert found.repair.status is RepairStatus.FEASIBLE
    [change] = found.repair.changes
    assert (change.new, found.repair.bound) == (Fraction("14.517"), None)


def compared(seeds, wanted):
    """How repairs of random plans end; they repair, and no cheaper change on the grid does."""
    counts = Counter()
    for seed in seeds:
        random = Random(f"repair/{seed}")  # noqa: S311 - reproducible
        plan = chained(random)
        nature = [each for each in plan.network.activities if each.lower != each.upper]
        if not plan.network.choices or len(nature) < 2 or len(plan.network.events) > 14:
            continue
        limit = random.randint(longest(plan) // 2, longest(plan))
        plan = limited(plan, limit)
        chosen = random.sample(nature, 2)
        activities = [
            replace(each, action=f"(moved{chosen.index(each)})") if each in chosen else each
            for each in plan.network.activities
        ]
        plan = replace(plan, network=replace(plan.network, activities=tuple(activities)))
        weights = [random.randint(1, 3) for _ in range(3)]
        texts = [f"m{at}=at-most:(moved{at}),weight={weights[at]}" for at in range(2)]
        texts.append(f"limit=at-most:e_initial:e_goal,weight={weights[2]}")
        parametric = pike.parametrize(plan, specifications(texts, None, ()))
        found = pike.controllable(parametric, repair=True, timeout=60)
        if found.repair is None or found.repair.status.is_open:
            counts["unknown"] += 1
            continue
        moved = {each.parameter.name: each.new for each in found.repair.changes}
        if found.repair.status is not RepairStatus.IMPOSSIBLE:
            assert _verdict(parametric, moved) is YES, seed
        rooms = [int(each.upper - each.lower) for each in chosen]
        for eased in product(*(range(room + 1) for room in rooms), range(6)):
            cost = sum(weight * each for weight, each in zip(weights, eased, strict=True))
            if found.repair.status is RepairStatus.IMPOSSIBLE or cost < found.repair.cost:
                values = {"m0": chosen[0].upper - eased[0], "m1": chosen[1].upper - eased[1], "limit": limit + eased[2]}
                assert _verdict(parametric, values) is NO, seed
        counts[found.repair.status] += 1
        if sum(counts.values()) == wanted:
            break
    return counts


def _verdict(parametric, values):
    plan = parametric.at({**parametric.nominal, **{name: Fraction(value) for name, value in values.items()}})
    return DecidingControllability(plan, GameRules()).run().verdict


def test_repairs_cost_what_the_cheapest_change_on_the_grid_costs():
    counts = compared(range(often(60, 3000)), often(2, 150))
    assert counts[RepairStatus.OPTIMAL]
    assert not counts["unknown"]
