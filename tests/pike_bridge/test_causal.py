"""Causal links, the paper's examples of them, and augmented plans against the oracle, the referee and brute force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import product

import pytest
import z3
from hypothesis import event, given, settings
from hypothesis import strategies as st

from robust.pike_bridge.causal import (
    AdditionReason,
    AugmentedPlan,
    Dominance,
    Happening,
    LinkEncoding,
    OpenCondition,
    augment,
    open_conditions,
)
from robust.pike_bridge.model import (
    ALWAYS,
    EPSILON,
    INITIAL,
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
from robust.pike_bridge.semantics import Execution, Oracle, faults
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, conjunction, is_model
from robust.plan.model import Atom
from tests.pike_bridge.brute_force import (
    ExactPrecedence,
    HalfKnowledge,
    Ignorance,
    correct_orders,
    correct_scenarios,
    holds,
    scenarios,
)
from tests.pike_bridge.plans import contested_plans, team_plans, tiny_plans


class AugmentedModels:
    """What satisfies the theory and gives the augmented network a schedule: φ′_S of [PIKE, Theorem 4.6]."""

    def __init__(self, augmented: AugmentedPlan) -> None:
        self.augmented = augmented
        self.context = z3.Context()
        self.solver = z3.Solver(ctx=self.context)
        network = augmented.network
        self.values = {
            (choice.name, value): z3.Bool(f"{choice.name}={value}", self.context)
            for choice in network.choices
            for value in choice.domain
        }
        self.times = {event.name: z3.Real(event.name, self.context) for event in network.events}
        for choice in network.choices:
            literals = [(self.values[choice.name, value], 1) for value in choice.domain]
            self.solver.add(z3.PbEq(literals, 1, self.context))
        for constraint in network.temporal_constraints:
            difference = self.times[constraint.target] - self.times[constraint.source]
            if constraint.lower is not None:
                self._if(constraint.guard, difference >= self._number(constraint.lower))
            if constraint.upper is not None:
                self._if(constraint.guard, difference <= self._number(constraint.upper))
        for formula in augmented.theory.constraints:
            self.solver.add(self._formula(formula))
        for conflict in augmented.theory.conflicts:
            self._if(conflict, z3.BoolVal(False, self.context))

    def extend(self, scenario: Mapping[str, str], schedule: Mapping[str, Fraction] | None = None) -> Execution | None:
        """Some execution of the augmented plan that extends a scenario of the original, perhaps with given times."""
        self.solver.push()
        self.solver.add(self._guard(frozenset(scenario.items())))
        for name, time in (schedule or {}).items():
            self.solver.add(self.times[name] == self._number(time))
        found = self._execution() if self.solver.check() == z3.sat else None
        self.solver.pop()
        return found

    def projections(self) -> set[frozenset[tuple[str, str]]]:
        """The scenarios of the original plan that have a model."""
        domains = self.augmented.plan.network.domains
        return {frozenset(each.items()) for each in scenarios(domains) if self.extend(each) is not None}

    def _execution(self) -> Execution:
        model = self.solver.model()
        scenario = {
            name: value
            for (name, value), symbol in self.values.items()
            if z3.is_true(model.eval(symbol, model_completion=True))
        }
        times = {
            event.name: model.eval(self.times[event.name], model_completion=True).as_fraction()
            for event in self.augmented.network.events
            if holds(event.guard, scenario)
        }
        return Execution(scenario, {name: Fraction(time) for name, time in times.items()})

    def _if(self, guard: Guard, consequence: z3.BoolRef) -> None:
        self.solver.add(z3.Implies(self._guard(guard), consequence, self.context))

    def _guard(self, guard: Guard) -> z3.BoolRef:
        return z3.And([z3.BoolVal(True, self.context), *(self.values[tuple(each)] for each in guard)])

    def _number(self, number: Fraction) -> z3.ArithRef:
        return z3.RealVal(str(number), self.context)

    def _formula(self, formula: Formula) -> z3.BoolRef:
        match formula:
            case Is(assignment):
                return self.values[tuple(assignment)]
            case Not(operand):
                return z3.Not(self._formula(operand), self.context)
            case All(operands):
                return z3.And([z3.BoolVal(True, self.context), *map(self._formula, operands)])
            case Some(operands):
                return z3.Or([z3.BoolVal(False, self.context), *map(self._formula, operands)])


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
    assert [each.reason for each in result.additions] == [AdditionReason.SUPPORT]


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
    result = augment(plan, ExactPrecedence(plan.network), LinkEncoding(dominance))
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
    assert [each.reason for each in result.additions] == [AdditionReason.SUPPORT]


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


def augmented(plan: TeamPlan, encoding: LinkEncoding = LinkEncoding()) -> AugmentedPlan:  # noqa: B008 - immutable
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
    assert set(links(augmented(plan, LinkEncoding(Dominance.NOTHING)))) == {"p1", "p2", "p3", "p4", "p5"}
    for dominance in (Dominance.EXACT, Dominance.ALGORITHM_5):
        assert set(links(augmented(plan, LinkEncoding(dominance)))) == {"p3", "p4", "p5"}


def test_figure_9_a_threat_on_either_side() -> None:
    """The producer is between 1 and 3 before the consumer; the threat is at any time after the initial event."""
    bound = Constraint("p1", "c", Fraction(1), Fraction(3))
    order = [(INITIAL, "p1"), (INITIAL, "t1"), (INITIAL, "c")]
    result = augmented(example({"p1": True, "t1": False}, order, bounds=[bound]), LinkEncoding(sole_supports=False))
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
        (AdditionReason.SUPPORT, None),
        (AdditionReason.THREAT_AFTER, "p2"),
        (AdditionReason.THREAT_BEFORE, "p1"),
        (AdditionReason.THREAT_AFTER, "p1"),
    }


def test_options_add_or_spare_what_they_say() -> None:
    result = augmented(figure_13(), LinkEncoding(idle_supports=False))
    idle = Some((conjunction(guard({"z": "1"})), Is(next(iter(guard({S: "none"}))))))
    assert idle in result.theory.constraints
    alone = example({"p1": True}, [("p1", "c")], {"p1": guard({"x": "1"})})
    spared = augmented(alone, LinkEncoding(sole_supports=False))
    assert spared.network == alone.network
    assert spared.theory.constraints == (conjunction(guard({"x": "1"})),)


def test_a_condition_without_candidates_is_a_conflict() -> None:
    label = guard({"z": "1"})
    result = augmented(example({"t1": False}, [], {"c": label}))
    assert result.theory.conflicts == (label,)
    assert result.additions[0].reason is AdditionReason.SUPPORT
    assert result.links == ()


@pytest.mark.parametrize(
    ("order", "expected"),
    [
        ([("t", "p"), ("p", "c")], set()),  # C1
        ([("p", "c"), ("t", "c")], {("t", "p", AdditionReason.THREAT_BEFORE)}),  # C2
        ([("p", "c"), ("p", "t"), ("t", "c")], {(None, None, AdditionReason.DEFINITE_THREAT)}),  # C3
        ([("p", "c")], {("t", "p", AdditionReason.THREAT_BEFORE), ("c", "t", AdditionReason.THREAT_AFTER)}),  # C5
        ([("p", "c"), ("p", "t")], {("c", "t", AdditionReason.THREAT_AFTER)}),  # C6
        ([("p", "c"), ("c", "t")], set()),  # C9
        (
            [],
            {
                ("p", "c", AdditionReason.PRODUCER_FIRST),
                ("t", "p", AdditionReason.THREAT_BEFORE),
                ("c", "t", AdditionReason.THREAT_AFTER),
            },
        ),
    ],
)
def test_figure_12_cases(
    order: list[tuple[str, str]], expected: set[tuple[str | None, str | None, AdditionReason]]
) -> None:
    result = augmented(example({"p": True, "t": False}, order), LinkEncoding(Dominance.NOTHING))
    found = {
        (each.statement.source, each.statement.target, each.reason)
        if isinstance(each.statement, Constraint)
        else (None, None, each.reason)
        for each in result.additions
        if each.reason is not AdditionReason.SUPPORT
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
    exact = AugmentedModels(augmented(plan, LinkEncoding(Dominance.EXACT)))
    assert exact.extend(selected, times) is None
    assert exact.extend({S: "p2"}, times) is not None
    assert augmented(plan).links[0].consumer.threats == ()
    assert exact.augmented.links[0].consumer.threats == (Happening("t1", frozenset()),)


encodings = st.builds(LinkEncoding, st.sampled_from(Dominance), st.booleans(), st.booleans())
precedences = st.sampled_from((ExactPrecedence, HalfKnowledge, Ignorance))


@settings(max_examples=300)
@given(st.one_of(team_plans(), contested_plans()), precedences, encodings)
def test_models_are_the_scenarios_with_a_correct_execution(
    plan: TeamPlan, precedence: type, encoding: LinkEncoding
) -> None:
    augmented = augment(plan, precedence(plan.network), encoding)
    correct = {frozenset(execution.scenario.items()) for execution in Oracle(plan).scenarios()}
    assert AugmentedModels(augmented).projections() == correct
    event(f"{min(3, len(augmented.network.choices) - len(plan.network.choices))} variables, {bool(correct)}")


@settings(max_examples=400)
@given(st.one_of(tiny_plans(), contested_plans(), contested_plans()), precedences, encodings)
def test_models_are_those_of_brute_force(plan: TeamPlan, precedence: type, encoding: LinkEncoding) -> None:
    augmented = augment(plan, precedence(plan.network), encoding)
    assert AugmentedModels(augmented).projections() == correct_scenarios(plan)


@settings(max_examples=200)
@given(st.one_of(team_plans(), contested_plans()), precedences, encodings)
def test_consistent_executions_of_the_augmented_plan_are_correct(
    plan: TeamPlan, precedence: type, encoding: LinkEncoding
) -> None:
    """[PIKE, Theorem 4.5]"""
    augmented = augment(plan, precedence(plan.network), encoding)
    models = AugmentedModels(augmented)
    for scenario in models.projections():
        found = models.extend(dict(scenario))
        assert found is not None
        assert is_model(found.scenario, augmented.theory)
        original = {choice.name: found.scenario[choice.name] for choice in plan.network.choices}
        assert faults(plan, Execution(original, found.schedule)) == ()
        if encoding.dominance is not Dominance.ALGORITHM_5:
            assert threatened_links(augmented, found) == []


def threatened_links(augmented: AugmentedPlan, execution: Execution) -> list[str]:
    """The links that an execution selects although some threat lies in their interval."""
    times = execution.schedule
    return [
        f"{link.producer} {effect}"
        for link in augmented.links
        if holds(link.selection | link.consumer.guard, execution.scenario)
        for effect in augmented.plan.effects
        if effect.literal == link.consumer.literal.negation
        and holds(effect.guard, execution.scenario)
        and times[link.producer.event] <= times[effect.event] <= times[link.consumer.last]
        and not any(
            effect.event == condition.last and effect.activity == condition.activity
            for condition in link.consumer.conditions
        )
    ]


@settings(max_examples=150)
@given(st.one_of(tiny_plans(), contested_plans(), contested_plans()), precedences, encodings)
def test_correct_executions_are_executions_of_the_augmented_plan(
    plan: TeamPlan, precedence: type, encoding: LinkEncoding
) -> None:
    """[PIKE, Theorem 4.3], for events that are ε apart if they are not simultaneous."""
    models = AugmentedModels(augment(plan, precedence(plan.network), encoding))
    for scenario in correct_scenarios(plan):
        for ordered in correct_orders(plan, dict(scenario)):
            schedule = ordered.schedule()
            gaps = [abs(one - other) for one, other in product(schedule.values(), repeat=2)]
            if all(gap == 0 or gap >= EPSILON for gap in gaps):
                assert models.extend(dict(scenario), schedule) is not None
                break


@settings(max_examples=200)
@given(team_plans(), encodings)
def test_knowledge_spares_variables(plan: TeamPlan, encoding: LinkEncoding) -> None:
    sizes = [
        len(augment(plan, precedence(plan.network), encoding).network.choices)
        for precedence in (ExactPrecedence, HalfKnowledge, Ignorance)
    ]
    assert sizes == sorted(sizes)


@settings(max_examples=200)
@given(st.one_of(team_plans(), contested_plans()), precedences, encodings)
def test_additions_are_well_formed(plan: TeamPlan, precedence: type, encoding: LinkEncoding) -> None:
    augmented = augment(plan, precedence(plan.network), encoding)
    guards = augmented.network.guards
    assert augmented.theory.domains == augmented.network.domains
    assert len(augmented.network.domains) == len(augmented.network.choices)
    for constraint in augmented.network.constraints:
        assert guards[constraint.source] | guards[constraint.target] <= constraint.guard
        assert len({variable for variable, _ in constraint.guard}) == len(constraint.guard)
    for choice in augmented.network.choices[len(plan.network.choices) :]:
        assert len(set(choice.domain)) == len(choice.domain) >= 2


@pytest.mark.slow
@settings(max_examples=1500)
@given(st.one_of(team_plans(), contested_plans()), precedences, encodings)
def test_many_models_are_the_scenarios_with_a_correct_execution(
    plan: TeamPlan, precedence: type, encoding: LinkEncoding
) -> None:
    augmented = augment(plan, precedence(plan.network), encoding)
    correct = {frozenset(execution.scenario.items()) for execution in Oracle(plan).scenarios()}
    assert AugmentedModels(augmented).projections() == correct
