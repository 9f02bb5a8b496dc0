"""Labeled shortest paths, scenario by scenario against Floyd and Warshall's algorithm, and the paper's Figure 23."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.pike_bridge.builder import act, build, choose, sequence
from robust.pike_bridge.model import EPSILON, Assignment, Choice, Constraint, Event, Guard, Tpnu
from robust.pike_bridge.temporal.labeled_apsp import LabeledDistances, labeled_distances
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.strategies import networks, structured
from tests.pike_bridge.temporal.brute_force import check_precedence, distances, environments, scenarios

any_network = st.one_of(networks(), structured())


def figure_23(count: int) -> Tpnu:
    """One choice after the other, each of two activities of [2, 4]."""
    return Tpnu(
        "figure 23",
        tuple(Choice(f"x{at}", ("1", "2"), controllable=True, event=f"e{at}") for at in range(count)),
        tuple(Event(f"e{at}") for at in range(count + 1)),
        tuple(
            Constraint(f"e{at}", f"e{at + 1}", Fraction(2), Fraction(4), frozenset({Assignment(f"x{at}", value)}))
            for at in range(count)
            for value in ("1", "2")
        ),
        (),
    )


@pytest.mark.parametrize("count", range(1, 13))
def test_completions_leave_one_value_in_figure_23(count: int) -> None:
    found = labeled_distances(figure_23(count))
    assert found.labeled(f"e{count}", "e0") == ((Fraction(-2 * count), 0),)
    assert found.labeled("e0", f"e{count}") == ((Fraction(4 * count), 0),)


@pytest.mark.parametrize("count", range(1, 8))
def test_without_completions_figure_23_has_a_value_for_every_scenario(count: int) -> None:
    found = labeled_distances(figure_23(count), completions=False)
    assert len(found.labeled(f"e{count}", "e0")) == 2**count


@pytest.mark.parametrize("count", [1, 4, 12])
def test_completions_leave_one_value_for_built_programs(count: int) -> None:
    network = build(
        "choices", sequence(*(choose(f"x{at}", {"1": act("(a)", 2, 4), "2": act("(b)", 2, 4)}) for at in range(count)))
    )
    length = count * (2 + 2 * EPSILON) + (count - 1) * EPSILON
    assert labeled_distances(network).labeled(f"e{6 * count}", "e1") == ((-length, 0),)


@given(any_network, st.booleans())
def test_distances_are_exact_in_each_scenario(network: Tpnu, completions: bool) -> None:
    found = labeled_distances(network, completions=completions)
    for scenario in scenarios(network):
        shortest = distances(network, scenario)
        environment = found.vocabulary.encode(scenario)
        assert found.conflicting(environment) == (shortest is None)
        for first, second in active_pairs(network, scenario):
            if shortest is not None:
                assert found.query(first, second, environment) == shortest.get((first, second))


@given(any_network)
def test_completions_are_tightest_in_each_environment(network: Tpnu) -> None:
    found = labeled_distances(network)
    table = {scenario: distances(network, scenario) for scenario in scenarios(network)}
    for environment in environments(network):
        encoded = found.vocabulary.encode(environment)
        shortest = [table[scenario] for scenario in scenarios(network, environment)]
        assert found.conflicting(encoded) == all(entry is None for entry in shortest)
        if not found.conflicting(encoded):
            for pair in active_pairs(network, environment):
                lengths = [entry.get(pair) for entry in shortest if entry is not None]
                assert found.query(*pair, encoded) == (None if None in lengths else max(filter(is_number, lengths)))


@given(any_network, st.booleans())
def test_precedence_is_sound_and_with_completions_complete(network: Tpnu, completions: bool) -> None:
    check_precedence(network, labeled_distances(network, completions=completions), complete=completions)


@given(any_network, st.booleans())
def test_conflicts_exclude_the_scenarios_without_schedule(network: Tpnu, completions: bool) -> None:
    found = labeled_distances(network, completions=completions)
    conflicts = [found.vocabulary.decode(conflict) for conflict in found.conflicts]
    for scenario in scenarios(network):
        assert any(conflict <= scenario for conflict in conflicts) == (distances(network, scenario) is None)
    assert not any(one < other for one in conflicts for other in conflicts)


@given(any_network)
def test_prime_conflicts_are_minimal(network: Tpnu) -> None:
    found = labeled_distances(network)
    for conflict in found.prime_conflicts:
        guard = found.vocabulary.decode(conflict)
        assert all(distances(network, scenario) is None for scenario in scenarios(network, guard))
        for assignment in guard:
            weaker = scenarios(network, guard - {assignment})
            assert any(distances(network, scenario) is not None for scenario in weaker)


def test_deadlines_hold() -> None:
    with pytest.raises(OutOfTimeError):
        labeled_distances(figure_23(3), Deadline.after(0))


def test_unknown_events_are_refused() -> None:
    with pytest.raises(KeyError):
        LabeledDistances(figure_23(1)).query("e0", "nowhere")


def active_pairs(network: Tpnu, environment: Guard) -> list[tuple[str, str]]:
    names = [event.name for event in network.events if event.guard <= environment]
    return list(product(names, names))


def is_number(value: Fraction | None) -> bool:
    return value is not None
