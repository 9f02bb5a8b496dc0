"""Precedence by structure: sound in every scenario, and complete where nothing depends on choices."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.pike_bridge.builder import act, build, choose, sequence
from robust.pike_bridge.model import Choice, Constraint, Event, Tpnu, guard
from robust.pike_bridge.temporal.distance_graph import Precedence
from robust.pike_bridge.temporal.structural import structural_precedence
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.strategies import networks, structured
from tests.pike_bridge.temporal.brute_force import check_precedence

any_network = st.one_of(networks(), structured())


@given(any_network, st.booleans())
def test_precedence_is_sound(network: Tpnu, contextual: bool) -> None:
    check_precedence(network, structural_precedence(network, contextual=contextual), complete=False)


def test_order_in_and_around_choices() -> None:
    network = build(
        "plan",
        sequence(
            act("(before)", 1, 2),
            choose("x", {"1": sequence(act("(one)", 1, 2), act("(other)", 1, 2)), "2": act("(slow)", 3, 5)}),
            act("(after)", 1, 2),
        ),
    )
    found: Precedence = structural_precedence(network)
    before, one, other, slow, after = (activity.source for activity in network.activities)
    for first, second in ((before, one), (before, slow), (one, other), (other, after), (slow, after), (before, after)):
        assert found.precedes(first, second, 0)
        assert not found.precedes(second, first, 0)
    assert not found.precedes(one, slow, 0)


def test_cases_of_a_choice_are_covered_together() -> None:
    # No constraint leads from a to b in every scenario, but one in each.
    network = two_events(
        Constraint("a", "b", Fraction(1), None, guard({"x": "1"})),
        Constraint("a", "b", Fraction(2), None, guard({"x": "2"})),
    )
    assert structural_precedence(network).precedes("a", "b", 0)


def test_contexts_count_if_asked_to() -> None:
    network = two_events(Constraint("a", "b", Fraction(1), None, guard({"x": "1"})))
    blind, seeing = structural_precedence(network), structural_precedence(network, contextual=True)
    context = seeing.vocabulary.assign("x", "1")
    assert not blind.precedes("a", "b", context)
    assert seeing.precedes("a", "b", context)
    assert not seeing.precedes("a", "b", 0)


def test_impossible_contexts_order_nothing() -> None:
    network = build("choice", choose("x", {"1": act("(a)", 1, 1), "2": act("(b)", 1, 1)}))
    found = structural_precedence(network)
    activity = network.activities[0]
    assert found.precedes(activity.source, activity.target, 0)
    assert not found.precedes(activity.source, activity.target, found.vocabulary.assign("x", "2"))
    assert found.conflicting(found.vocabulary.assign("x", "1") | found.vocabulary.assign("x", "2"))


def test_deadlines_hold() -> None:
    network = build("plan", act("(a)", 1, 1))
    with pytest.raises(OutOfTimeError):
        structural_precedence(network, Deadline.after(0)).precedes("e1", "e2", 0)


def two_events(*constraints: Constraint) -> Tpnu:
    choice = Choice("x", ("1", "2"), controllable=True, event=None)
    return Tpnu("two events", (choice,), (Event("a"), Event("b")), constraints, ())
