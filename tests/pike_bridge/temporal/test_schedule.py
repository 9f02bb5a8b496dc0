"""Schedules of single scenarios, against Floyd and Warshall's algorithm."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.pike_bridge.model import Assignment, Choice, Constraint, Event, Tpnu, guard
from robust.pike_bridge.temporal.schedule import (
    NegativeCycle,
    Schedule,
    most_general,
    negative_cycle,
    schedule,
    temporal_conflicts,
)
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory, implies, is_model
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.strategies import networks, structured
from tests.pike_bridge.temporal.brute_force import distances, holding, scenarios

A, B, C = Event("a"), Event("b"), Event("c")


def test_the_schedule_is_the_earliest() -> None:
    network = Tpnu(
        "plan",
        (),
        (A, B, C),
        (Constraint("a", "b", Fraction(1, 3), Fraction(2)), Constraint("b", "c", Fraction(1, 2), None)),
        (),
    )
    assert schedule(network, frozenset()) == Schedule({"a": Fraction(0), "b": Fraction(1, 3), "c": Fraction(5, 6)})


def test_contradicting_constraints_are_named() -> None:
    slow = Constraint("a", "b", Fraction(3), None)
    late = Constraint("a", "b", None, Fraction(5, 2))
    cycle = negative_cycle(Tpnu("plan", (), (A, B), (slow, late), ()), frozenset())
    assert cycle is not None
    assert cycle.total == Fraction(-1, 2)
    assert {step.constraint for step in cycle.steps} == {slow, late}


def test_unknown_assignments_are_refused() -> None:
    with pytest.raises(KeyError):
        schedule(Tpnu("plan", (), (A,), (), ()), guard({"x": "1"}))


@given(networks())
def test_a_schedule_exists_unless_there_is_a_negative_cycle(network: Tpnu) -> None:
    for scenario in scenarios(network):
        shortest = distances(network, scenario)
        found = schedule(network, scenario)
        assert isinstance(found, NegativeCycle) == (shortest is None)
        if isinstance(found, NegativeCycle):
            check_cycle(found)
            assert found.guard <= scenario
        else:
            assert set(found.times) == {event.name for event in network.events if event.guard <= scenario}
            for entry in holding(network, scenario):
                elapsed = found.times[entry.target] - found.times[entry.source]
                assert entry.lower is None or entry.lower <= elapsed
                assert entry.upper is None or elapsed <= entry.upper
            assert min(found.times.values(), default=Fraction(0)) == 0


def check_cycle(cycle: NegativeCycle) -> None:
    """The steps lead in a circle, say what their constraints say, and contradict each other."""
    assert cycle.total < 0
    for step, following in zip(cycle.steps, cycle.steps[1:] + cycle.steps[:1], strict=True):
        assert step.target == following.source
        entry = step.constraint
        assert (step.source, step.target, step.bound) in {
            (entry.source, entry.target, entry.upper),
            (entry.target, entry.source, None if entry.lower is None else -entry.lower),
        }
        assert entry.guard <= cycle.guard
    assert len({step.source for step in cycle.steps}) == len(cycle.steps)


any_network = st.one_of(networks(), structured())


@st.composite
def theories(draw: st.DrawFn, network: Tpnu) -> Theory:
    """A few clauses over the network's choices and one more."""
    domains = {**network.domains, "own": ("a", "b", "c")}
    assignments = [Assignment(variable, value) for variable, values in domains.items() for value in values]
    literals = st.sampled_from(assignments).flatmap(lambda entry: st.sampled_from((Is(entry), Not(Is(entry)))))
    operands = st.lists(literals, min_size=1, max_size=3).map(tuple)
    clauses: st.SearchStrategy[Formula] = st.one_of(operands.map(Some), st.builds(implies, literals, operands.map(All)))
    conflicts = st.lists(st.sampled_from(assignments).map(lambda entry: frozenset({entry})), max_size=1)
    return Theory(domains, tuple(draw(st.lists(clauses, max_size=3))), tuple(draw(conflicts)))


networks_with_theories = any_network.flatmap(lambda network: st.tuples(st.just(network), theories(network)))


def deadlines_of_three() -> Tpnu:
    """Two of three choices must be fast, that is have the value 1."""
    return Tpnu(
        "deadline",
        tuple(Choice(name, ("1", "2"), controllable=True, event=None) for name in "xyz"),
        tuple(Event(f"e{at}") for at in range(4)),
        (
            *(
                Constraint(f"e{at}", f"e{at + 1}", Fraction(lower), None, guard({name: value}))
                for at, name in enumerate("xyz")
                for value, lower in (("1", 1), ("2", 2))
            ),
            Constraint("e0", "e3", None, Fraction(4)),
        ),
        (),
    )


def test_conflicts_of_a_deadline() -> None:
    network = deadlines_of_three()
    found = temporal_conflicts(network, Theory(network.domains))
    assert [scenario for scenario in scenarios(network) if any(conflict <= scenario for conflict in found)] == [
        scenario for scenario in scenarios(network) if sum(value == "2" for _, value in scenario) >= 2
    ]


def test_a_theory_that_leaves_nothing_open_needs_no_conflicts() -> None:
    network = deadlines_of_three()
    fast = tuple(Is(Assignment(name, "1")) for name in "xyz")
    assert temporal_conflicts(network, Theory(network.domains, fast)) == ()


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_a_plan_that_is_never_possible_has_the_empty_conflict(solver: str) -> None:
    slow = Constraint("a", "b", Fraction(3), Fraction(2))
    network = Tpnu("impossible", (), (Event("a"), Event("b")), (slow,), ())
    assert temporal_conflicts(network, Theory({}), solver=solver) == (frozenset(),)


@given(networks_with_theories)
@settings(max_examples=60)
def test_models_that_resolve_the_conflicts_are_those_with_a_schedule(drawn: tuple[Tpnu, Theory]) -> None:
    network, theory = drawn
    found = temporal_conflicts(network, theory)
    for conflict in found:
        assert all(distances(network, scenario) is None for scenario in scenarios(network, conflict))
        assert not any(other < conflict for other in found)
    for scenario in scenarios(network):
        possible = any(is_model({**dict(scenario), "own": own}, theory) for own in theory.domains["own"])
        if possible:
            assert any(conflict <= scenario for conflict in found) == (distances(network, scenario) is None)


def test_deadlines_hold() -> None:
    network = deadlines_of_three()
    with pytest.raises(OutOfTimeError):
        temporal_conflicts(network, Theory(network.domains), Deadline.after(0))


def test_most_general_environments_are_kept() -> None:
    assert most_general([0b111, 0b011, 0b100, 0b110, 0b011]) == [0b011, 0b100]
