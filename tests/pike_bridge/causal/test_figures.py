"""The examples of [PIKE, Figures 6 to 13], with the links and constraints that the paper gives for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

import pytest

from robust.pike_bridge.causal import AugmentedPlan, Dominance, Encoding, Happening, Reason, augment
from robust.pike_bridge.model import (
    EPSILON,
    INITIAL,
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
from robust.pike_bridge.theory import Formula, Is, Not, Some, conjunction, is_model
from robust.plan.model import Atom
from tests.pike_bridge.causal.models import AugmentedModels
from tests.pike_bridge.networks import ExactPrecedence, scenarios

P = Literal(Atom("p"))
S = "s[(p) @ c]"


def example(
    effects: Mapping[str, bool],
    order: Sequence[tuple[str, str]],
    guards: Mapping[str, Guard] | None = None,
    bounds: Sequence[Constraint] = (),
) -> TeamPlan:
    """A plan whose event `c` needs p, which other events make true or false, and in which some events are ordered."""
    labels = guards or {}
    variables = {variable for label in labels.values() for variable, _ in label}
    names = dict.fromkeys([*effects, "c", *(name for pair in order for name in pair)])
    events = {name: Event(name, labels.get(name, frozenset())) for name in names}
    network = Tpnu(
        "figure",
        tuple(Choice(variable, ("1", "2"), True, None) for variable in sorted(variables)),
        tuple(events.values()),
        (*(Constraint(a, b, EPSILON, None, events[a].guard | events[b].guard) for a, b in order), *bounds),
        (),
    )
    return TeamPlan(
        network,
        (Condition(P, "c", "c", events["c"].guard, None),),
        tuple(
            Effect(P if positive else P.negation, name, events[name].guard, None) for name, positive in effects.items()
        ),
    )


def augmented(plan: TeamPlan, encoding: Encoding = Encoding()) -> AugmentedPlan:  # noqa: B008 - immutable
    return augment(plan, ExactPrecedence(plan.network), encoding)


def added(result: AugmentedPlan) -> set[Constraint]:
    assert result.network.constraints[: len(result.plan.network.constraints)] == result.plan.network.constraints
    return set(result.network.constraints[len(result.plan.network.constraints) :])


def ordering(earlier: str, later: str, **label: str) -> Constraint:
    return Constraint(earlier, later, EPSILON, None, guard(label))


def links(result: AugmentedPlan) -> dict[str, Guard]:
    return {link.producer.event: link.label for link in result.links}


def equivalent(formulas: Sequence[Formula], expected: Formula, result: AugmentedPlan) -> bool:
    theory = result.theory
    return all(
        is_model(scenario, type(theory)(theory.domains, tuple(formulas)))
        == is_model(scenario, type(theory)(theory.domains, (expected,)))
        for scenario in scenarios(theory.domains)
    )


def supports(when: Guard, *alternatives: Guard) -> Formula:
    return Some((Not(conjunction(when)), Some(tuple(conjunction(each) for each in alternatives))))


def test_figure_6a_two_unordered_producers() -> None:
    result = augmented(example({"p1": True, "p2": True}, [("p1", "c"), ("p2", "c")]))
    assert links(result) == {"p1": frozenset(), "p2": frozenset()}
    assert result.network.domains == {S: ("p1", "p2", "none")}
    assert added(result) == set()
    assert equivalent(result.theory.constraints, supports(frozenset(), guard({S: "p1"}), guard({S: "p2"})), result)


def test_figure_6b_labels_are_the_guards_of_producers() -> None:
    labels = {"p1": guard({"x": "1"}), "p2": guard({"y": "1"}), "c": guard({"z": "1"})}
    result = augmented(example({"p1": True, "p2": True}, [("p1", "c"), ("p2", "c")], labels))
    assert links(result) == {"p1": labels["p1"], "p2": labels["p2"]}
    expected = supports(labels["c"], guard({S: "p1", "x": "1"}), guard({S: "p2", "y": "1"}))
    assert equivalent(result.theory.constraints, expected, result)
    correct = {
        frozenset(each.items())
        for each in scenarios(result.plan.network.domains)
        if "1" in (each["x"], each["y"]) or each["z"] == "2"
    }
    assert AugmentedModels(result).projections() == correct


def test_figure_7a_a_later_producer_dominates() -> None:
    result = augmented(example({"p1": True, "p2": True}, [("p1", "p2"), ("p2", "c")], {"p1": guard({"x": "1"})}))
    assert links(result) == {"p2": frozenset()}


def test_figure_7b_a_later_producer_that_may_be_missing_does_not_dominate() -> None:
    label = guard({"x": "1"})
    result = augmented(example({"p1": True, "p2": True}, [("p1", "p2"), ("p2", "c"), ("p1", "c")], {"p2": label}))
    assert links(result) == {"p1": frozenset(), "p2": label}


def test_figure_8_a_sequence_of_producers_keeps_the_last_certain_one_and_what_follows() -> None:
    labels = {"p2": guard({"x": "1"}), "p4": guard({"y": "1"}), "p5": guard({"z": "1"})}
    order = [(f"p{at}", name) for at in range(1, 6) for name in (*(f"p{later}" for later in range(at + 1, 6)), "c")]
    plan = example({f"p{at}": True for at in range(1, 6)}, order, labels)
    assert set(links(augmented(plan, Encoding(Dominance.NOTHING)))) == {"p1", "p2", "p3", "p4", "p5"}
    for dominance in (Dominance.EXACT, Dominance.ALGORITHM_5):
        assert set(links(augmented(plan, Encoding(dominance)))) == {"p3", "p4", "p5"}


def test_figure_9_a_threat_on_either_side() -> None:
    """The producer is between 1 and 3 before the consumer; the threat is at any time after the initial event."""
    bound = Constraint("p1", "c", Fraction(1), Fraction(3))
    order = [(INITIAL, "p1"), (INITIAL, "t1"), (INITIAL, "c")]
    result = augmented(example({"p1": True, "t1": False}, order, bounds=[bound]), Encoding(sole_supports=False))
    (variable,) = result.network.domains
    assert result.network.domains == {variable: ("before", "after")}
    assert variable == "o[(p) @ c, p1, t1]"
    assert added(result) == {ordering("t1", "p1", **{variable: "before"}), ordering("c", "t1", **{variable: "after"})}
    assert result.theory.constraints == ()
    full = augmented(result.plan)
    assert {variable: len(domain) for variable, domain in full.network.domains.items()} == {S: 2, variable: 2}


def test_figure_11_everything_is_possible() -> None:
    """Two producers and two threats of one consumer, unordered, each in a choice of its own."""
    labels = {
        "p1": guard({"u": "1"}), "p2": guard({"v": "1"}), "t1": guard({"x": "1"}), "t2": guard({"y": "1"}),
        "c": guard({"w": "1"}),
    }  # fmt: skip
    result = augmented(example({"p1": True, "p2": True, "t1": False, "t2": False}, [], labels))
    expected = set()
    for producer, variable in (("p1", "u"), ("p2", "v")):
        link = {S: producer, variable: "1", "w": "1"}
        expected.add(ordering(producer, "c", **link))
        for threat, other in (("t1", "x"), ("t2", "y")):
            name = f"o[(p) @ c, {producer}, {threat}]"
            assert result.network.domains[name] == ("before", "after")
            context = link | {other: "1"}
            expected |= {
                ordering(threat, producer, **context, **{name: "before"}),
                ordering("c", threat, **context, **{name: "after"}),
            }
    assert added(result) == expected
    assert len(result.network.choices) == 5 + 1 + 4
    assert result.theory.conflicts == ()
    formula = supports(labels["c"], guard({S: "p1", "u": "1"}), guard({S: "p2", "v": "1"}))
    assert equivalent(result.theory.constraints, formula, result)


def figure_13() -> TeamPlan:
    """Two producers precede the consumer, and a threat comes after the one that is certain, wherever it will."""
    labels = {"p1": guard({"y": "1"}), "t1": guard({"x": "1"}), "c": guard({"z": "1"})}
    return example({"p1": True, "p2": True, "t1": False}, [("p1", "c"), ("p2", "c"), ("p2", "t1")], labels)


def test_figure_13_the_constraints_at_the_end_of_section_4_4() -> None:
    result = augmented(figure_13())
    o = "o[(p) @ c, p1, t1]"
    both = {"z": "1", "x": "1"}
    assert added(result) == {
        ordering("c", "t1", **both, **{S: "p2"}),
        ordering("t1", "p1", **both, **{"y": "1", S: "p1", o: "before"}),
        ordering("c", "t1", **both, **{"y": "1", S: "p1", o: "after"}),
    }
    assert result.theory.conflicts == ()
    assert result.theory.constraints == (
        Some(
            (
                Not(conjunction(guard({"z": "1"}))),
                Some((conjunction(guard({S: "p1", "y": "1"})), conjunction(guard({S: "p2"})))),
            )
        ),
    )
    assert set(result.network.domains) == {"x", "y", "z", S, o}
    assert {(each.reason, each.producer and each.producer.event) for each in result.additions} == {
        (Reason.SUPPORT, None),
        (Reason.THREAT_AFTER, "p2"),
        (Reason.THREAT_BEFORE, "p1"),
        (Reason.THREAT_AFTER, "p1"),
    }


def test_options_add_or_spare_what_they_say() -> None:
    result = augmented(figure_13(), Encoding(idle_supports=False))
    idle = Some((conjunction(guard({"z": "1"})), Is(next(iter(guard({S: "none"}))))))
    assert idle in result.theory.constraints
    alone = example({"p1": True}, [("p1", "c")], {"p1": guard({"x": "1"})})
    spared = augmented(alone, Encoding(sole_supports=False))
    assert spared.network == alone.network
    assert spared.theory.constraints == (conjunction(guard({"x": "1"})),)


def test_a_condition_without_candidates_is_a_conflict() -> None:
    label = guard({"z": "1"})
    result = augmented(example({"t1": False}, [], {"c": label}))
    assert result.theory.conflicts == (label,)
    assert result.additions[0].reason is Reason.SUPPORT
    assert result.links == ()


@pytest.mark.parametrize(
    ("order", "expected"),
    [
        ([("t", "p"), ("p", "c")], set()),  # C1
        ([("p", "c"), ("t", "c")], {("t", "p", Reason.THREAT_BEFORE)}),  # C2
        ([("p", "c"), ("p", "t"), ("t", "c")], {(None, None, Reason.DEFINITE_THREAT)}),  # C3
        ([("p", "c")], {("t", "p", Reason.THREAT_BEFORE), ("c", "t", Reason.THREAT_AFTER)}),  # C5
        ([("p", "c"), ("p", "t")], {("c", "t", Reason.THREAT_AFTER)}),  # C6
        ([("p", "c"), ("c", "t")], set()),  # C9
        ([], {("p", "c", Reason.PRODUCER_FIRST), ("t", "p", Reason.THREAT_BEFORE), ("c", "t", Reason.THREAT_AFTER)}),
    ],
)
def test_figure_12_cases(order: list[tuple[str, str]], expected: set[tuple[str | None, str | None, Reason]]) -> None:
    result = augmented(example({"p": True, "t": False}, order), Encoding(Dominance.NOTHING))
    found = {
        (each.statement.source, each.statement.target, each.reason)
        if isinstance(each.statement, Constraint)
        else (None, None, each.reason)
        for each in result.additions
        if each.reason is not Reason.SUPPORT
    }
    assert found == expected


def test_algorithm_5_selects_links_that_are_threatened() -> None:
    """A certain producer dominates the threat before it, which then may lie between another producer and the consumer.

    The execution is correct, since the certain producer is later; the selected link is not what supports the condition.
    """
    plan = example({"p1": True, "t1": False, "p2": True}, [("t1", "p2"), ("p2", "c"), ("p1", "c")])
    times = {"p1": Fraction(1), "t1": Fraction(2), "p2": Fraction(3), "c": Fraction(4)}
    selected = {S: "p1"}
    assert AugmentedModels(augmented(plan)).extend(selected, times) is not None
    exact = AugmentedModels(augmented(plan, Encoding(Dominance.EXACT)))
    assert exact.extend(selected, times) is None
    assert exact.extend({S: "p2"}, times) is not None
    assert augmented(plan).links[0].consumer.threats == ()
    assert exact.augmented.links[0].consumer.threats == (Happening("t1", frozenset()),)
