"""Schedules of single scenarios, against Floyd and Warshall's algorithm."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given

from robust.pike_bridge.model import Constraint, Event, Tpnu, guard
from robust.pike_bridge.temporal.schedule import NegativeCycle, Schedule, negative_cycle, schedule
from tests.pike_bridge.strategies import networks
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
