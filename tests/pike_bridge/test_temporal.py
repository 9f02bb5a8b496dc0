"""Labeled shortest paths, precedence by structure, schedules of scenarios and temporal conflicts, against brute force.

Structure is sound in every scenario, and complete where nothing depends on choices.
"""

from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.pike_bridge.builder import act, build, choose, sequence
from robust.pike_bridge.distance_graph import StructuralPrecedence
from robust.pike_bridge.labeled_apsp import LabeledDistances, most_general, schedule, temporal_conflicts
from robust.pike_bridge.model import EPSILON, Assignment, guard
from robust.pike_bridge.theory import Is, Theory
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge import stories
from tests.pike_bridge.brute_force import broken_constraints, check_precedence, distances, environments, extending
from tests.pike_bridge.knowledge.theories import is_model, theories
from tests.pike_bridge.plans import network as handmade
from tests.pike_bridge.plans import networks


def figure_23(count):
    """One choice after the other, each of two activities of [2, 4]."""
    return handmade(
        " ".join(f"e{at}" for at in range(count + 1)),
        *((f"e{at}", f"e{at + 1}", 2, 4, {f"x{at}": value}) for at in range(count) for value in "12"),
        choices=[(f"x{at}", "12", f"e{at}") for at in range(count)],
    )


@pytest.mark.parametrize("count", range(1, 13))
def test_completions_leave_one_value_in_figure_23_and_its_program(count):
    found = LabeledDistances(figure_23(count))
    assert found.labeled(f"e{count}", "e0") == ((Fraction(-2 * count), 0),)
    assert found.labeled("e0", f"e{count}") == ((Fraction(4 * count), 0),)
    length = count * (2 + 2 * EPSILON) + (count - 1) * EPSILON
    assert LabeledDistances(stories.figure_23(count).network).labeled(f"e{6 * count}", "e1") == ((-length, 0),)
    if count < 8:
        without = LabeledDistances(figure_23(count), completions=False)
        assert len(without.labeled(f"e{count}", "e0")) == 2**count


@given(networks, st.booleans())
def test_distances_and_conflicts_are_exact_in_each_scenario(network, completions):
    found = LabeledDistances(network, completions=completions)
    conflicts = [found.vocabulary.decode(conflict) for conflict in found.conflicts]
    assert not any(one < other for one in conflicts for other in conflicts)
    for scenario in extending(network):
        shortest = distances(network, scenario)
        environment = found.vocabulary.encode(scenario)
        assert found.conflicting(environment) == (shortest is None)
        assert any(conflict <= scenario for conflict in conflicts) == (shortest is None)
        for first, second in active_pairs(network, scenario):
            if shortest is not None:
                assert found.query(first, second, environment) == shortest.get((first, second))


@given(networks)
def test_completions_are_tightest_in_each_environment(network):
    found = LabeledDistances(network)
    table = {scenario: distances(network, scenario) for scenario in extending(network)}
    for environment in environments(network):
        encoded = found.vocabulary.encode(environment)
        shortest = [table[scenario] for scenario in extending(network, environment)]
        assert found.conflicting(encoded) == all(entry is None for entry in shortest)
        for pair in () if found.conflicting(encoded) else active_pairs(network, environment):
            lengths = [entry.get(pair) for entry in shortest if entry is not None]
            assert found.query(*pair, encoded) == (None if None in lengths else max(lengths))


def active_pairs(network, environment):
    names = [event.name for event in network.events if event.guard <= environment]
    return list(product(names, names))


@given(networks)
def test_precedence_is_sound_and_with_completions_complete(network):
    check_precedence(network, LabeledDistances(network), complete=True)
    check_precedence(network, LabeledDistances(network, completions=False), complete=False)
    check_precedence(network, StructuralPrecedence(network), complete=False)


def test_structure_orders_what_is_in_and_around_choices():
    branches = {"1": sequence(act("(one)", 1, 2), act("(other)", 1, 2)), "2": act("(slow)", 3, 5)}
    network = build("plan", sequence(act("(before)", 1, 2), choose("x", branches), act("(after)", 1, 2)))
    found = StructuralPrecedence(network)
    before, one, other, slow, after = (activity.source for activity in network.activities)
    for first, second in ((before, one), (before, slow), (one, other), (other, after), (slow, after), (before, after)):
        assert found.precedes(first, second, 0)
        assert not found.precedes(second, first, 0)
    assert not found.precedes(one, slow, 0)


@pytest.mark.parametrize(("values", "ordered"), [("12", True), ("1", False)])
def test_structure_covers_the_cases_of_a_choice_together(values, ordered):
    """No constraint leads from a to b in every scenario, but one in each."""
    network = handmade("a b", *(("a", "b", value, None, {"x": value}) for value in values), choices=[("x", "12", None)])
    assert StructuralPrecedence(network).precedes("a", "b", 0) == ordered


def test_impossible_contexts_order_nothing():
    network = build("choice", choose("x", {"1": act("(a)", 1, 1), "2": act("(b)", 1, 1)}))
    found = StructuralPrecedence(network)
    activity = network.activities[0]
    assert found.precedes(activity.source, activity.target, 0)
    assert not found.precedes(activity.source, activity.target, found.vocabulary.assign("x", "2"))
    assert found.conflicting(found.vocabulary.assign("x", "1") | found.vocabulary.assign("x", "2"))


def test_deadlines_and_unknown_events():
    with pytest.raises(OutOfTimeError):
        LabeledDistances(figure_23(3), Deadline.after(0))
    with pytest.raises(OutOfTimeError):
        StructuralPrecedence(figure_23(3), Deadline.after(0)).precedes("e1", "e2", 0)
    for kind in (LabeledDistances, StructuralPrecedence):
        with pytest.raises(KeyError):
            kind(figure_23(1)).precedes("e1", "nowhere", 0)


def test_the_schedule_is_the_earliest():
    network = handmade("a b c", ("a", "b", "1/3", 2), ("b", "c", "1/2", None))
    assert schedule(network, frozenset()) == {"a": Fraction(0), "b": Fraction(1, 3), "c": Fraction(5, 6)}
    with pytest.raises(KeyError):
        schedule(network, guard({"x": "1"}))


@given(networks)
def test_a_schedule_exists_unless_there_is_a_negative_cycle(network):
    for scenario in extending(network):
        found = schedule(network, scenario)
        assert isinstance(found, frozenset) == (distances(network, scenario) is None)
        if isinstance(found, frozenset):
            assert found <= scenario
            assert all(distances(network, each) is None for each in extending(network, found))
        else:
            assert set(found) == {event.name for event in network.events if event.guard <= scenario}
            assert min(found.values(), default=0) == 0
            assert not broken_constraints(network, dict(scenario), found)


def test_what_a_theory_leaves_open_has_conflicts():
    network = handmade("a b", ("a", "b", None, 4), ("a", "b", 5, None, {"x": "2"}), choices=[("x", "12", None)])
    assert temporal_conflicts(network, Theory(network.domains)) == (guard({"x": "2"}),)
    assert temporal_conflicts(network, Theory(network.domains, (Is(Assignment("x", "1")),))) == ()
    with pytest.raises(OutOfTimeError):
        temporal_conflicts(network, Theory(network.domains), Deadline.after(0))


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_a_plan_that_is_never_possible_has_the_empty_conflict(solver):
    assert temporal_conflicts(handmade("a b", ("a", "b", 3, 2)), Theory({}), solver=solver) == (frozenset(),)


@given(networks, st.data())
@settings(max_examples=60)
def test_models_that_resolve_the_conflicts_are_those_with_a_schedule(network, data):
    """The theory is about the network's choices and one more."""
    theory = data.draw(theories(of={**network.domains, "own": ("a", "b", "c")}))
    found = temporal_conflicts(network, theory)
    for conflict in found:
        assert all(distances(network, scenario) is None for scenario in extending(network, conflict))
        assert not any(other < conflict for other in found)
    for scenario in extending(network):
        if any(is_model({**dict(scenario), "own": own}, theory) for own in theory.domains["own"]):
            assert any(conflict <= scenario for conflict in found) == (distances(network, scenario) is None)


def test_most_general_environments_are_kept():
    assert most_general([0b111, 0b011, 0b100, 0b110, 0b011]) == [0b011, 0b100]
