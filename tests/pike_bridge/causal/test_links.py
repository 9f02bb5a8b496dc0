"""Open conditions: candidates, activities that share events, conditions over all, and questions asked twice."""

from __future__ import annotations

from fractions import Fraction

import pytest

from robust.pike_bridge.causal import Dominance, Encoding, Happening, OpenCondition, Reason, augment, open_conditions
from robust.pike_bridge.model import (
    ALWAYS,
    Activity,
    Choice,
    Condition,
    Constraint,
    Effect,
    Event,
    Guard,
    Literal,
    TeamPlan,
    Tpnu,
    guard,
)
from robust.plan.model import Atom
from tests.pike_bridge.networks import ExactPrecedence, Ignorance

P = Literal(Atom("p"))
X1 = guard({"x": "1"})
X2 = guard({"x": "2"})


def shared(conditions: tuple[Condition, ...], effects: tuple[Effect, ...], guards: tuple[Guard, ...] = ()) -> TeamPlan:
    """Activities from `a` to `b`, as many as guards, and one from `b` to `c`, the last."""
    network = Tpnu(
        "shared",
        (Choice("x", ("1", "2"), True, "a"),),
        (Event("a"), Event("b"), Event("c")),
        (Constraint("a", "c", Fraction(0), Fraction(9)),),
        (
            *(Activity("(do)", "a", "b", Fraction(1), None, guard=label) for label in guards),
            Activity("(use)", "b", "c", Fraction(1), None),
        ),
    )
    return TeamPlan(network, conditions, effects)


def only(plan: TeamPlan) -> OpenCondition:
    (question,) = open_conditions(plan, ExactPrecedence(plan.network))
    return question


def test_activities_that_share_an_event_have_effects_of_their_own() -> None:
    at_c = Condition(P, "c", "c", ALWAYS, 2)
    plan = shared((at_c,), (Effect(P, "b", X1, 0), Effect(P.negation, "b", X2, 1), Effect(P, "b", X1, 0)), (X1, X2))
    question = only(plan)
    assert question.producers == (Happening("b", X1),)
    assert question.threats == (Happening("b", X2),)
    result = augment(plan, ExactPrecedence(plan.network))
    assert [each.reason for each in result.additions] == [Reason.SUPPORT]


def test_producers_at_one_event_have_values_of_their_own() -> None:
    at_c = Condition(P, "c", "c", ALWAYS, 2)
    plan = shared((at_c,), (Effect(P, "b", X1, 0), Effect(P, "b", X2, 1)), (X1, X2))
    result = augment(plan, ExactPrecedence(plan.network))
    assert result.network.domains["s[(p) @ c]"] == ("b", "b[x = 2]", "none")


def test_of_happenings_at_one_event_the_more_general_is_enough() -> None:
    at_c = Condition(P, "c", "c", ALWAYS, 2)
    plan = shared((at_c,), (Effect(P, "b", X1, 0), Effect(P, "b", ALWAYS, 1)), (X1, ALWAYS))
    assert [link.label for link in augment(plan, ExactPrecedence(plan.network)).links] == [ALWAYS]


@pytest.mark.parametrize("dominance", [Dominance.EXACT, Dominance.ALGORITHM_5])
def test_of_happenings_that_differ_only_where_the_condition_is_not_activated_one_is_kept(dominance: Dominance) -> None:
    at_c = Condition(P, "c", "c", X1, 2)
    plan = shared((at_c,), (Effect(P, "b", X1, 0), Effect(P, "b", ALWAYS, 1)), (X1, ALWAYS))
    result = augment(plan, ExactPrecedence(plan.network), Encoding(dominance))
    assert len(result.links) == 1
    assert result.theory.conflicts == ()


def test_a_condition_over_all_may_be_supported_by_its_own_start() -> None:
    over_all = Condition(P, "b", "c", ALWAYS, 1)
    plan = shared((over_all,), (Effect(P, "b", ALWAYS, 1), Effect(P.negation, "c", ALWAYS, 1)), (X1,))
    question = only(plan)
    assert question.producers == (Happening("b", ALWAYS),)
    assert question.threats == ()
    result = augment(plan, Ignorance(plan.network))
    assert result.network.constraints == plan.network.constraints
    assert [each.reason for each in result.additions] == [Reason.SUPPORT]


def test_the_effect_of_another_activity_at_the_end_is_a_definite_threat() -> None:
    over_all = Condition(P, "b", "c", ALWAYS, 1)
    plan = shared((over_all,), (Effect(P, "b", ALWAYS, 1), Effect(P.negation, "c", X1, None)), (X1,))
    result = augment(plan, Ignorance(plan.network))
    assert result.theory.conflicts == (X1 | guard({"s[(p) @ b–c]": "b"}),)


def test_conditions_that_ask_the_same_share_a_variable() -> None:
    twice = (Condition(P, "b", "b", ALWAYS, 0), Condition(P, "b", "b", ALWAYS, 1), Condition(P, "b", "b", X1, 0))
    plan = shared(twice, (Effect(P, "a", ALWAYS, None),), (ALWAYS,))
    first, second = open_conditions(plan, ExactPrecedence(plan.network))
    assert first.conditions == twice[:2]
    assert second.conditions == twice[2:]
    variables = [choice.name for choice in augment(plan, ExactPrecedence(plan.network)).network.choices]
    assert variables == ["x", "s[(p) @ b]", "s[(p) @ b][x = 1]"]


def test_exemptions_keep_questions_apart() -> None:
    """Only one of two activities that end together may contradict the other's condition there."""
    ends = (Condition(P, "b", "b", ALWAYS, 0), Condition(P, "b", "b", ALWAYS, 1))
    effects = (Effect(P, "a", ALWAYS, None), Effect(P.negation, "b", ALWAYS, 1))
    plan = shared(ends, effects, (ALWAYS, ALWAYS))
    first, second = open_conditions(plan, ExactPrecedence(plan.network))
    assert (len(first.threats), len(second.threats)) == (1, 0)


def test_what_comes_after_the_condition_is_no_candidate() -> None:
    at_b = Condition(P, "b", "b", ALWAYS, 1)
    plan = shared((at_b,), (Effect(P, "c", ALWAYS, 1), Effect(P.negation, "c", ALWAYS, 1)), (X1,))
    assert only(plan).producers == only(plan).threats == ()
    (ignorant,) = open_conditions(plan, Ignorance(plan.network))
    assert ignorant.producers == ignorant.threats == (Happening("c", ALWAYS),)
