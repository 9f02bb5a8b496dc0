"""What the paper says about its examples beyond their scenarios, and satisfiability of odd formulas as plans."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import product

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.generators.pike import assignment, sat_plan, satisfies
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.causal import augment
from robust.pike_bridge.generators.stories import figure_6a, figure_7a, figure_9, figure_13, kitchen
from robust.pike_bridge.model import EPSILON, GOAL, INITIAL
from robust.pike_bridge.semantics import Existence, Oracle
from robust.pike_bridge.temporal.labeled_apsp import labeled_distances

ENDS = {INITIAL, GOAL}
literals = st.sampled_from([sign * variable for variable in (1, 2, 3) for sign in (1, -1)])
formulas = st.lists(st.lists(literals, max_size=4), max_size=6)


def foods(instance: Instance, **chosen: str) -> set[str]:
    """What Alice may still eat."""
    found = (execution.scenario for execution in Oracle(instance.plan()).scenarios())
    return {one["xA4"] for one in found if chosen.items() <= one.items()}


def test_without_a_toaster_there_is_cereal_only() -> None:
    """[PIKE §1.1]: the toaster breaks, and nothing but cereal is left."""
    whole = kitchen()
    broken = replace(whole, problem=whole.problem.replace("(working toaster)", ""))
    assert broken != whole
    assert foods(whole, xA1="glass") == {"bagel", "cereal"}
    assert foods(broken, xA1="glass") == {"cereal"}


@pytest.mark.parametrize(
    ("consumed", "threatened", "expected"),
    [
        (3, 1, Existence.EXISTS),
        (3, 2, Existence.NONE),
        (3, 3, Existence.NONE),
        (3, 4, Existence.EXISTS),
        (5, 6, Existence.EXISTS),
        ("2.9", 4, Existence.NONE),
        ("5.1", 6, Existence.NONE),
    ],
)
def test_figure_9_bounds_the_time_from_producer_to_consumer(
    consumed: int | str, threatened: int, expected: Existence
) -> None:
    """[PIKE §4.3, Figures 9 and 10]: the producer is at 2."""
    plan = figure_9().plan()
    activities = {activity.action: activity for activity in plan.network.activities}
    executed: Mapping[str, Fraction] = {
        activities["(p1)"].target: Fraction(2),
        activities["(c)"].source: Fraction(consumed),
        activities["(t1)"].target: Fraction(threatened),
    }
    # Times are relative: what comes before may be negative.
    assert Oracle(plan).decide(schedule=executed).verdict is expected


@pytest.mark.parametrize(("example", "dominated", "further"), [(figure_6a, 0, 2), (figure_7a, 1, 1), (figure_13, 0, 2)])
def test_orders_between_elements_must_be_strict(example: Callable[[], Instance], dominated: int, further: int) -> None:
    """With [0, ∞] for [ε, ∞], fewer links are dominated and more orderings are added than the paper says."""
    plan = example().plan()
    # The events of the initial state and of the goal stay before and after all others.
    loose = tuple(
        replace(one, lower=Fraction(0)) if one.lower == EPSILON and {one.source, one.target}.isdisjoint(ENDS) else one
        for one in plan.network.constraints
    )
    found = []
    for network in (plan.network, replace(plan.network, constraints=loose)):
        augmented = augment(replace(plan, network=network), labeled_distances(network))
        found.append((len(augmented.links), len(augmented.network.constraints) - len(network.constraints)))
    (strict_links, strict_orderings), (loose_links, loose_orderings) = found
    assert (loose_links - strict_links, loose_orderings - strict_orderings) == (dominated, further)


@settings(max_examples=60)
@given(formulas)
def test_plans_are_correct_in_the_models_of_their_formula(clauses: list[list[int]]) -> None:
    """[PIKE, Appendix B]: empty and repeated clauses, tautologies and repeated literals included."""
    variables = sorted({abs(literal) for clause in clauses for literal in clause})
    found = [assignment(one.scenario) for one in Oracle(sat_plan(clauses).plan()).scenarios()]
    rows = [dict(zip(variables, row, strict=True)) for row in product((False, True), repeat=len(variables))]
    assert sorted(map(str, found)) == sorted(str(row) for row in rows if satisfies(row, clauses))
    assert bool(found) == (_solver(clauses).check() == z3.sat)


def _solver(clauses: list[list[int]]) -> z3.Solver:
    solver = z3.Solver()
    for clause in clauses:
        symbols = [z3.Bool(f"x{abs(literal)}") for literal in clause]
        signed = [one if literal > 0 else z3.Not(one) for one, literal in zip(symbols, clause, strict=True)]
        solver.add(z3.Or([z3.BoolVal(False), *signed]))
    return solver
