"""Generated plans: the paper's examples give its results, and families are reproducible and as described."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import product
from statistics import mean

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.generators.team_plans import random_plan
from benchmarks.pike.figure17_18 import closest_factors, random_k_intents
from robust.errors import InputError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.builder import k_intents
from robust.pike_bridge.causal import augment
from robust.pike_bridge.labeled_apsp import LabeledDistances
from robust.pike_bridge.model import EPSILON, GOAL, INITIAL
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from tests.pike_bridge import stories
from tests.pike_bridge.satisfiability import assignment, random_clauses, sat_plan, satisfies


def scenarios(instance):
    return [dict(one.scenario) for one in Oracle(instance.plan()).scenarios()]


def values(instance, *names):
    return sorted(tuple(one[name] for name in names) for one in scenarios(instance))


def test_kitchen_infers_what_the_story_tells():
    """[PIKE §1.1]: also that nothing but cereal is left when the toaster breaks."""
    names = ("xA1", "xA2", "xR1", "xA4", "xR2")
    found = [tuple(one[name] for name in names) for one in scenarios(stories.kitchen())]
    assert [one for one in found if one[0] == "mug"] == [("mug", "coffee", "grounds", "cereal", "milk")]
    glass = [one for one in found if one[0] == "glass"]
    assert {one[:4] for one in glass} == {("glass", "juice", "juice", food) for food in ("bagel", "cereal")}
    assert len(found) == 3
    broken = replace(stories.kitchen(), problem=stories.kitchen().problem.replace("(working toaster)", ""))
    assert {one["xA4"] for one in scenarios(broken) if one["xA1"] == "glass"} == {"cereal"}


def test_coffee_and_bagel_take_too_long_only_because_of_the_limit():
    plan = stories.kitchen().plan()
    coffee = next(a for a in plan.network.activities if "make-coffee" in a.action).guard
    bagel = next(a for a in plan.network.activities if "toast" in a.action).guard
    assert Oracle(plan).decide(coffee | bagel).verdict is ExecutionExistence.NONE
    assert Oracle(plan).decide(coffee).verdict is ExecutionExistence.EXISTS
    assert Oracle(plan).decide(bagel).verdict is ExecutionExistence.EXISTS


def test_wing_adapts_to_what_the_human_picks():
    expected = {"pliers": "cleco", "cleco": "pliers", "both": "wait"}
    found = scenarios(stories.wing())
    assert len(found) == 9
    for one in found:
        assert (one["b1"], one["b2"]) == (expected[one["h1"]], expected[one["h2"]])


def test_figure_6():
    assert scenarios(stories.figure_6a()) == [{}]
    found = values(stories.figure_6b(), "x", "y", "z")
    assert found == [one for one in product("12", repeat=3) if one[2] == "2" or "1" in one[:2]]


@pytest.mark.parametrize(("figure", "producers"), [("7a", ["(p2)"]), ("7b", ["(p1)", "(p2)"]), ("8", ["(p3)", "(p4)"])])
def test_figures_7_and_8_dominance(figure, producers):
    plan = getattr(stories, f"figure_{figure}")().plan()
    ends = {activity.target: activity.action for activity in plan.network.activities}
    links = augment(plan, LabeledDistances(plan.network)).links
    assert sorted(ends[link.producer.event] for link in links) == producers


@pytest.mark.parametrize(
    ("consumed", "threatened", "expected"),
    [
        (3, 1, ExecutionExistence.EXISTS),
        (3, 2, ExecutionExistence.NONE),
        (3, 3, ExecutionExistence.NONE),
        (3, 4, ExecutionExistence.EXISTS),
        (5, 6, ExecutionExistence.EXISTS),
        ("2.9", 4, ExecutionExistence.NONE),
        ("5.1", 6, ExecutionExistence.NONE),
    ],
)
def test_figure_9_bounds_the_time_from_producer_to_consumer(consumed, threatened, expected):
    """[PIKE §4.3, Figures 9 and 10]: the producer is at 2."""
    plan = stories.figure_9().plan()
    activities = {activity.action: activity for activity in plan.network.activities}
    executed = {
        activities["(p1)"].target: Fraction(2),
        activities["(c)"].source: Fraction(consumed),
        activities["(t1)"].target: Fraction(threatened),
    }
    # Times are relative: what comes before may be negative.
    assert Oracle(plan).decide(schedule=executed).verdict is expected


def test_figures_11_and_13():
    found = values(stories.figure_11(), "u", "v", "w")
    assert set(found) == {one for one in product("12", repeat=3) if one[2] == "2" or "1" in one[:2]}
    assert len(found) == 4 * len(set(found))  # threats can always be kept out of the way
    assert len(values(stories.figure_13(), "x", "y", "z")) == 8


@pytest.mark.parametrize(("figure", "dominated", "further"), [("6a", 0, 2), ("7a", 1, 1), ("13", 0, 2)])
def test_orders_between_elements_must_be_strict(figure, dominated, further):
    """With [0, ∞] for [ε, ∞], fewer links are dominated and more orderings are added than the paper says."""
    plan = getattr(stories, f"figure_{figure}")().plan()
    # The events of the initial state and of the goal stay before and after all others.
    loose = tuple(
        replace(one, lower=Fraction(0))
        if one.lower == EPSILON and {one.source, one.target}.isdisjoint({INITIAL, GOAL})
        else one
        for one in plan.network.constraints
    )
    found = []
    for network in (plan.network, replace(plan.network, constraints=loose)):
        augmented = augment(replace(plan, network=network), LabeledDistances(network))
        found.append((len(augmented.links), len(augmented.network.constraints) - len(network.constraints)))
    (strict_links, strict_orderings), (loose_links, loose_orderings) = found
    assert (loose_links - strict_links, loose_orderings - strict_orderings) == (dominated, further)


literals = st.sampled_from([sign * variable for variable in (1, 2, 3) for sign in (1, -1)])


@settings(max_examples=60)
@given(st.lists(st.lists(literals, max_size=4), max_size=6))
def test_plans_are_correct_in_the_models_of_their_formula(clauses):
    """[PIKE, Appendix B]: empty and repeated clauses, tautologies and repeated literals included."""
    names = sorted({abs(literal) for clause in clauses for literal in clause})
    rows = (dict(zip(names, row, strict=True)) for row in product((True, False), repeat=len(names)))
    found = [sorted(assignment(one).items()) for one in scenarios(sat_plan(clauses))]
    assert sorted(found) == sorted(sorted(row.items()) for row in rows if satisfies(row, clauses))


def test_wrong_clauses():
    with pytest.raises(InputError, match="literal 0"):
        sat_plan([[0]])
    with pytest.raises(InputError, match="width"):
        random_clauses(1, variables=2, clauses=1)


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
    intents = sorted(problem.intents for problem in problems)
    assert intents[0] < 10
    assert intents[-1] > 3000
    assert problems[7] == random_k_intents(1, 7)
    for wanted, factors in ((2, [2]), (5, [2, 2]), (18, [2, 3, 3]), (100, [2, 2, 2, 2, 2, 3])):
        assert sorted(closest_factors(wanted)) == factors


def test_random_plans_are_reproducible_and_of_the_described_shape(tmp_path):
    plans = [random_plan(0, index) for index in range(30)]
    assert random_plan(0, 5) == plans[5]
    assert random_plan(1, 5) != plans[5]
    files = [random_plan(0, 5).write(tmp_path / name) for name in ("one", "other")]
    for name in ("plan.tpnu.json", "domain.pddl", "problem.pddl"):
        assert len({file.with_name(name).read_bytes() for file in files}) == 1
    assert 30 < mean(len(plan.network.activities) for plan in plans) < 65
    for plan in plans[:10]:
        team = plan.plan()
        owned = Counter(condition.activity for condition in team.conditions)
        assert all(1 <= owned[at] <= 4 for at in range(len(team.network.activities)))
        assert load_team_plan(plan.write(tmp_path / plan.name)) == team
