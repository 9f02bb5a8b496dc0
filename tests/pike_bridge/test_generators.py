"""Generated plans: the paper's examples give its results, and families are reproducible and as described."""

import re
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import product
from math import prod
from statistics import mean

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.generators.team_plans import random_plan
from benchmarks.pike.figure17_18 import closest_factors, random_k_intents
from robust.errors import InputError
from robust.pike_bridge import action_model, builder, causal, labeled_apsp, model
from robust.pike_bridge.compile import Compiling
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from tests.pike_bridge import stories
from tests.sampling import often


def scenarios(instance):
    return [dict(each.scenario) for each in Oracle(instance.plan()).scenarios()]


def test_the_kitchen_infers_what_the_story_tells_and_the_wing_adapts_to_what_the_human_picks():
    """[PIKE §1.1]: nothing but cereal is left when the toaster breaks, and coffee with a bagel takes too long."""
    names = ("xA1", "xA2", "xR1", "xA4", "xR2")
    instance = stories.kitchen()
    rows = [tuple(each[name] for name in names) for each in scenarios(instance)]
    glass = [row for row in rows if row[0] == "glass"]
    assert len(rows) == 3
    assert [row for row in rows if row[0] == "mug"] == [("mug", "coffee", "grounds", "cereal", "milk")]
    assert {row[:4] for row in glass} == {("glass", "juice", "juice", food) for food in ("bagel", "cereal")}
    broken = replace(instance, problem=instance.problem.replace("(working toaster)", ""))
    assert {each["xA4"] for each in scenarios(broken) if each["xA1"] == "glass"} == {"cereal"}
    activities, oracle = instance.plan().network.activities, Oracle(instance.plan())
    coffee, bagel = (next(a.guard for a in activities if name in a.action) for name in ("make-coffee", "toast"))
    verdicts = [oracle.decide(environment).verdict for environment in (coffee, bagel, coffee | bagel)]
    assert verdicts == [ExecutionExistence.EXISTS, ExecutionExistence.EXISTS, ExecutionExistence.NONE]
    other = {"pliers": "cleco", "cleco": "pliers", "both": "wait"}
    rows = [tuple(each[name] for name in ("h1", "h2", "b1", "b2")) for each in scenarios(stories.wing())]
    assert sorted(rows) == sorted(
        (first, second, other[first], other[second]) for first, second in product(other, repeat=2)
    )


@pytest.mark.parametrize(("figure", "producers"), [("7a", ["(p2)"]), ("7b", ["(p1)", "(p2)"]), ("8", ["(p3)", "(p4)"])])
def test_figures_7_and_8_dominance(figure, producers):
    plan = stories.figure(figure).plan()
    ends = {activity.target: activity.action for activity in plan.network.activities}
    links = causal.augment(plan, labeled_apsp.LabeledDistances(plan.network)).links
    assert sorted(ends[link.producer.event] for link in links) == producers


@pytest.mark.parametrize(
    ("consumed", "threatened", "exists"),
    [(3, 1, True), (3, 2, False), (3, 3, False), (3, 4, True), (5, 6, True), ("2.9", 4, False), ("5.1", 6, False)],
)
def test_figure_9_bounds_the_time_from_producer_to_consumer(consumed, threatened, exists):
    """[PIKE §4.3, Figures 9 and 10]: the producer is at 2. Times are relative: what comes before may be negative."""
    plan = stories.figure("9").plan()
    producer, consumer, threat = plan.network.activities
    executed = {producer.target: Fraction(2), consumer.source: Fraction(consumed), threat.target: Fraction(threatened)}
    assert (Oracle(plan).decide(schedule=executed).verdict is ExecutionExistence.EXISTS) == exists


@pytest.mark.parametrize(("figure", "dominated", "further"), [("6a", 0, 2), ("7a", 1, 1), ("13", 0, 2)])
def test_orders_between_elements_must_be_strict(figure, dominated, further):
    """With [0, ∞] for [ε, ∞], fewer links are dominated and more orderings are added than the paper says."""
    plan = stories.figure(figure).plan()
    network = plan.network
    # The events of the initial state and of the goal stay before and after all others.
    strict = {
        each
        for each in network.constraints
        if each.lower == model.EPSILON and not {each.source, each.target} & {model.INITIAL, model.GOAL}
    }
    loose = (replace(each, lower=Fraction(0)) if each in strict else each for each in network.constraints)
    counts = []
    for variant in (network, replace(network, constraints=tuple(loose))):
        augmented = causal.augment(replace(plan, network=variant), labeled_apsp.LabeledDistances(variant))
        counts.append((len(augmented.links), len(augmented.network.constraints) - len(variant.constraints)))
    (strict_links, strict_orderings), (loose_links, loose_orderings) = counts
    assert (loose_links - strict_links, loose_orderings - strict_orderings) == (dominated, further)


literals = st.sampled_from([sign * variable for variable in (1, 2, 3) for sign in (1, -1)])


def models(formula):
    """Every assignment that meets all clauses, as scenarios of the plan."""
    names = range(1, formula.variables + 1)
    rows = (dict(zip(names, row, strict=True)) for row in product((False, True), repeat=formula.variables))
    met = [row for row in rows if all(any(row[abs(each)] == (each > 0) for each in c) for c in formula.clauses)]
    return [{f"v{name}": str(value).lower() for name, value in row.items()} for row in met]


@settings(max_examples=often(18, 35))
@given(st.lists(st.lists(literals, max_size=4), max_size=6))
def test_plans_are_correct_in_the_models_of_their_formula(clauses):
    """[PIKE, Appendix B]: empty and repeated clauses, tautologies and repeated literals included."""
    formula = builder.ClauseFormula(3, tuple(map(tuple, clauses)))
    drawn = scenarios(builder.satisfiability(formula))
    assert sorted(sorted(each.items()) for each in drawn) == sorted(sorted(each.items()) for each in models(formula))


@pytest.mark.parametrize(("variables", "clauses", "seed"), [(6, 20, 1), (8, 34, 2), (20, 85, 0), (20, 95, 3)])
def test_plans_are_consistent_if_a_solver_finds_their_formula_satisfiable(variables, clauses, seed):
    """Each model has as many in the knowledge base as there are ways to take a true literal of each clause."""
    formula = builder.random_clauses(variables, clauses, seed)
    text = f"c drawn\np cnf {variables} {clauses}\n" + "".join(f"{' '.join(map(str, c))} 0\n" for c in formula.clauses)
    assert builder.read_dimacs(text, "drawn.cnf") == formula
    solver = z3.Solver()
    solver.from_string(text.removeprefix("c drawn\n"))  # z3 takes this form, too
    plan = builder.satisfiability(builder.read_dimacs(text, "drawn.cnf")).plan()
    exists = Oracle(plan).decide().verdict is ExecutionExistence.EXISTS
    assert exists == (solver.check() == z3.sat) == (clauses < 95)
    knowledge = Compiling(plan, "bdd").compile().knowledge
    assert knowledge.satisfiable() == exists
    if variables < 10:
        met = [
            [sum(each[f"v{abs(v)}"] == str(v > 0).lower() for v in c) for c in formula.clauses]
            for each in models(formula)
        ]
        assert knowledge.count_models() == sum(map(prod, met))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "found 0 clauses, expected 'p cnf VARIABLES CLAUSES'"),
        ("p cnf 2\n", "f.cnf:1: found 'p cnf 2', expected 'p cnf VARIABLES CLAUSES'"),
        ("c\n\np cnf 2 1\n1 3 0\n", "f.cnf:4: found '3', expected 0, or a variable up to 2"),
        ("p cnf 2 1\n1 x 0\n", "f.cnf:2: found 'x', expected 0, or a variable up to 2"),
        (
            "p cnf 2 2\n1 2\n0 -1\n",
            "f.cnf: found 1 clause and one that does not end, expected 2 clauses, each ended by 0",
        ),
    ],
)
def test_formulas_that_are_none(text, message):
    with pytest.raises(InputError, match=re.escape(message)):
        builder.read_dimacs(text, "f.cnf")


def test_k_intents_and_random_plans_are_reproducible_and_of_the_described_shape(tmp_path):
    problem = builder.k_intents((3, 2), seed=4)
    assert problem.intents == 6
    activities = problem.instance.network.activities
    assert {each.upper - each.lower for each in activities} == {1}
    assert all(1 <= each.lower <= 1.5 and problem.recovery[each.action] == each.lower / 2 for each in activities)
    assert len({each.lower for each in activities if each.action.startswith("(h-1")}) == 1
    rows = scenarios(problem.instance)
    assert len(rows) == 6
    assert all(each["x1"] == each["y1"] and each["x2"] == each["y2"] for each in rows)
    assert builder.k_intents((3, 2), seed=4) == problem
    with pytest.raises(InputError):
        builder.k_intents(())
    problems = [random_k_intents(1, index) for index in range(200)]
    assert {count for problem in problems for count in problem.structure} == {2, 3}
    intents = sorted(problem.intents for problem in problems)
    assert intents[0] < 10
    assert intents[-1] > 3000
    assert problems[7] == random_k_intents(1, 7)
    for wanted, factors in ((2, [2]), (5, [2, 2]), (18, [2, 3, 3]), (100, [2, 2, 2, 2, 2, 3])):
        assert sorted(closest_factors(wanted)) == factors
    plans = [random_plan(0, index) for index in range(30)]
    assert random_plan(0, 5) == plans[5]
    assert random_plan(1, 5) != plans[5]
    assert 30 < mean(len(plan.network.activities) for plan in plans) < 65
    files = [plans[5].write(tmp_path / name) for name in ("one", "other")]
    for name in ("plan.tpnu.json", "domain.pddl", "problem.pddl"):
        assert len({file.with_name(name).read_bytes() for file in files}) == 1
    for plan in plans[:3]:
        team = plan.plan()
        owned = Counter(condition.activity for condition in team.conditions)
        assert all(1 <= owned[at] <= 4 for at in range(len(team.network.activities)))
        assert action_model.load_team_plan(plan.write(tmp_path / plan.name)) == team
