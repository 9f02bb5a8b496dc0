"""Generated plans: the paper's examples give its results, and families are reproducible and as described."""

from __future__ import annotations

from itertools import product
from statistics import mean

import pytest

from benchmarks.generators.pike import (
    assignment,
    closest_factors,
    k_intents,
    random_clauses,
    random_k_intents,
    sat_plan,
    satisfies,
)
from robust.errors import InputError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.causal import augment
from robust.pike_bridge.compile import Checking, PlanVerdict
from robust.pike_bridge.generators import stories as figures
from robust.pike_bridge.generators.random_plans import random_plan
from robust.pike_bridge.generators.stories import kitchen, wing
from robust.pike_bridge.semantics import Existence, Oracle
from robust.pike_bridge.temporal.labeled_apsp import labeled_distances
from tests.cli.running import EXAMPLES


def scenarios(instance):
    return [dict(one.scenario) for one in Oracle(instance.plan()).scenarios()]


def values(instance, *names):
    return sorted(tuple(one[name] for name in names) for one in scenarios(instance))


# -- the paper's examples ---------------------------------------------------------------------------------------------


def test_kitchen_infers_what_the_story_tells():
    found = scenarios(kitchen())
    mug = [one for one in found if one["xA1"] == "mug"]
    assert [(one["xA2"], one["xR1"], one["xA4"], one["xR2"]) for one in mug] == [
        ("coffee", "grounds", "cereal", "milk")
    ]
    glass = [one for one in found if one["xA1"] == "glass"]
    assert {(one["xA2"], one["xR1"]) for one in glass} == {("juice", "juice")}
    assert {one["xA4"] for one in glass} == {"bagel", "cereal"}
    assert len(found) == 3


def test_coffee_and_bagel_take_too_long_only_because_of_the_limit():
    plan = kitchen().plan()
    coffee = next(a for a in plan.network.activities if "make-coffee" in a.action).guard
    bagel = next(a for a in plan.network.activities if "toast" in a.action).guard
    assert Oracle(plan).decide(coffee | bagel).verdict is Existence.NONE
    assert Oracle(plan).decide(coffee).verdict is Existence.EXISTS
    assert Oracle(plan).decide(bagel).verdict is Existence.EXISTS


def test_wing_adapts_to_what_the_human_picks():
    expected = {"pliers": "cleco", "cleco": "pliers", "both": "wait"}
    found = scenarios(wing())
    assert len(found) == 9
    for one in found:
        assert (one["b1"], one["b2"]) == (expected[one["h1"]], expected[one["h2"]])


@pytest.mark.parametrize(("generate", "name"), [(kitchen, "kitchen"), (wing, "wing")])
def test_shipped_examples_are_what_is_generated(generate, name):
    assert load_team_plan(EXAMPLES / name / f"{name}.tpnu.json") == generate().plan()


def test_figure_6():
    assert scenarios(figures.figure_6a()) == [{}]
    found = values(figures.figure_6b(), "x", "y", "z")
    assert found == [one for one in product("12", repeat=3) if one[2] == "2" or "1" in one[:2]]


def test_figures_7_and_8_dominance():
    def producers(instance):
        plan = instance.plan()
        augmented = augment(plan, labeled_distances(plan.network))
        ends = {activity.target: activity.action for activity in plan.network.activities}
        return sorted(ends[link.producer.event] for link in augmented.links)

    assert producers(figures.figure_7a()) == ["(p2)"]
    assert producers(figures.figure_7b()) == ["(p1)", "(p2)"]
    assert producers(figures.figure_8()) == ["(p3)", "(p4)"]


def test_figure_9_has_two_separate_ways():
    plan = figures.figure_9().plan()
    times = {activity.action: activity for activity in plan.network.activities}
    threat, producer, consumer = times["(t1)"].target, times["(p1)"].target, times["(c)"].source
    oracle = Oracle(plan)
    schedule = oracle.decide().witness.schedule
    assert not schedule[producer] <= schedule[threat] <= schedule[consumer]


def test_figures_11_and_13():
    found = values(figures.figure_11(), "u", "v", "w")
    assert set(found) == {one for one in product("12", repeat=3) if one[2] == "2" or "1" in one[:2]}
    assert len(found) == 4 * len(set(found))  # threats can always be kept out of the way
    assert len(values(figures.figure_13(), "x", "y", "z")) == 8


@pytest.mark.parametrize("choices", range(1, 13))
def test_figure_23_has_one_labeled_value(choices):
    network = figures.figure_23(choices).network
    ends = [event.name for event in network.events if not event.guard]
    distances = labeled_distances(network)
    assert len(distances.labeled(ends[-1], ends[0])) == 1
    assert len(distances.labeled(ends[0], ends[-1])) <= 1


# -- satisfiability ---------------------------------------------------------------------------------------------------


def brute_force(clauses):
    names = sorted({abs(literal) for clause in clauses for literal in clause})
    for row in product((True, False), repeat=len(names)):
        found = dict(zip(names, row, strict=True))
        if satisfies(found, clauses):
            yield found


def ordered(rows):
    return sorted(sorted(row.items()) for row in rows)


@pytest.mark.parametrize("seed", range(12))
def test_satisfiability_both_ways(seed):
    clauses = random_clauses(seed, variables=4, clauses=10 + seed, width=3)
    found = [assignment(one) for one in scenarios(sat_plan(clauses))]
    assert ordered(found) == ordered(brute_force(clauses))


@pytest.mark.parametrize("backend", ["pitms", "sat", "bdd"])
def test_odd_clauses(backend):
    for clauses in ([], [[]], [[1, -1]], [[1, 1]], [[1], [-1]], [[1, 2], [-1], [-2, 3]]):
        verdict = Checking(sat_plan(clauses).plan(), backend).run().verdict
        assert (verdict is PlanVerdict.PROVED) == any(True for _ in brute_force(clauses))
    with pytest.raises(InputError, match="literal 0"):
        sat_plan([[0]])
    with pytest.raises(InputError, match="width"):
        random_clauses(1, variables=2, clauses=1)


# -- families ---------------------------------------------------------------------------------------------------------


def test_k_intents():
    problem = k_intents((3, 2), seed=4)
    assert problem.intents == 6
    activities = problem.instance.network.activities
    assert {one.upper - one.lower for one in activities} == {1}
    assert all(1 <= one.lower <= 1.5 and problem.recovery[one.action] == one.lower / 2 for one in activities)
    assert len({one.lower for one in activities if one.action.startswith("(h-1")}) == 1
    found = scenarios(problem.instance)
    assert len(found) == 6
    assert all(one["x1"] == one["y1"] and one["x2"] == one["y2"] for one in found)
    assert k_intents((3, 2), seed=4) == problem
    with pytest.raises(InputError):
        k_intents(())


def test_random_k_intents():
    problems = [random_k_intents(1, index) for index in range(200)]
    assert {count for problem in problems for count in problem.structure} == {2, 3}
    assert min(problem.intents for problem in problems) < 10
    assert max(problem.intents for problem in problems) > 3000
    assert problems[7] == random_k_intents(1, 7)
    for wanted, factors in ((2, [2]), (5, [2, 2]), (18, [2, 3, 3]), (100, [2, 2, 2, 2, 2, 3])):
        assert sorted(closest_factors(wanted)) == factors


def test_random_plans_are_reproducible_and_of_the_described_shape(tmp_path):
    plans = [random_plan(0, index) for index in range(60)]
    assert random_plan(0, 5) == plans[5]
    assert random_plan(1, 5) != plans[5]
    files = [random_plan(0, 5).write(tmp_path / name) for name in ("one", "other")]
    for name in ("plan.tpnu.json", "domain.pddl", "problem.pddl"):
        one, other = (file.with_name(name).read_bytes() for file in files)
        assert one == other
    sizes = [len(plan.network.activities) for plan in plans]
    assert 30 < mean(sizes) < 65
    for plan in plans[:10]:
        team = plan.plan()
        owned: dict[int | None, int] = {}
        for condition in team.conditions:
            owned[condition.activity] = owned.get(condition.activity, 0) + 1
        assert all(1 <= owned[at] <= 4 for at in range(len(team.network.activities)))
        assert load_team_plan(plan.write(tmp_path / plan.name)) == team
