"""The solver as a knowledge base that reasons about time."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given, settings

from robust.errors import InputError
from robust.pike_bridge.knowledge import create_knowledge_base
from robust.pike_bridge.knowledge.interface import Exclude, Require
from robust.pike_bridge.knowledge.sat import SatKnowledgeBase
from robust.pike_bridge.model import Assignment, Choice, Constraint, Event, Tpnu, guard
from robust.pike_bridge.theory import Is, Theory
from tests.pike_bridge.knowledge.theories import listed, scenarios
from tests.pike_bridge.networks import candidate_subplan
from tests.pike_bridge.strategies import networks


@settings(max_examples=60, deadline=None)
@given(networks())
def test_models_are_the_temporally_consistent_scenarios(network):
    knowledge = create_knowledge_base("sat", Theory(network.domains), network=network)
    expected = [each for each in scenarios(network.domains) if candidate_subplan(network, each).consistent]
    assert listed(knowledge.models()) == listed(expected)
    assert knowledge.satisfiable() == bool(expected)


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_a_choice_may_be_too_slow(solver):
    network = Tpnu(
        "late",
        (Choice("100% sure", ("slow", "fast"), True, "a"),),
        (Event("a"), Event("b")),
        (
            Constraint("a", "b", None, Fraction(5)),
            Constraint("a", "b", Fraction(6), None, guard({"100% sure": "slow"})),
        ),
        (),
    )
    knowledge = SatKnowledgeBase(Theory(network.domains), network, solver=solver)
    assert not knowledge.could_commit([Require(guard({"100% sure": "slow"}))])
    assert knowledge.model({"100% sure": "slow"}) is None
    assert knowledge.model({}) == {"100% sure": "fast"}
    assert not knowledge.could_commit([Exclude(guard({"100% sure": "fast"}))])
    knowledge.commit([Exclude(guard({"100% sure": "slow"}))])
    assert knowledge.count_models() == 1


def test_networks_that_do_not_fit():
    events = (Event("a"),)
    with pytest.raises(InputError, match="from a to b mentions b, which is not an event"):
        SatKnowledgeBase(Theory({}), Tpnu("n", (), events, (Constraint("a", "b", None, None),), ()))
    guarded = Constraint("a", "a", None, None, guard({"x": "1"}))
    with pytest.raises(InputError, match="from a to a mentions unknown variable 'x'"):
        SatKnowledgeBase(Theory({}), Tpnu("n", (), events, (guarded,), ()))


def test_constraints_and_time_together():
    network = Tpnu("n", (), (Event("a"), Event("b")), (Constraint("a", "b", Fraction(2), Fraction(1)),), ())
    assert not SatKnowledgeBase(Theory({"x": ("1", "2")}, (Is(Assignment("x", "1")),)), network).satisfiable()
