"""Causal links, the examples of the paper, and its theorems [PIKE §4, Invariant 5.2] on random plans.

Every sweep checks a statement on what its seed gives, and says how often its premise held there.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from itertools import pairwise, product
from math import prod
from random import Random

import pytest
from hypothesis import given, settings

from robust.pike_bridge.causal import Contexts, LabeledHappening, augment, open_conditions, prune
from robust.pike_bridge.compile import Compiling, Temporal
from robust.pike_bridge.distance_graph import StructuralPrecedence
from robust.pike_bridge.knowledge.sat import SatKnowledgeBase
from robust.pike_bridge.knowledge.tms import PiTms
from robust.pike_bridge.labeled_apsp import LabeledDistances, temporal_conflicts
from robust.pike_bridge.model import ALWAYS, EPSILON, INITIAL, Activity, Condition, Effect, TeamPlan, guard, may_produce
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, faults
from robust.pike_bridge.theory import Not, Require, Some, Theory, conjunction, is_consistent
from tests.pike_bridge.brute_force import (
    ExactPrecedence,
    HalfKnowledge,
    Ignorance,
    admits_correct_execution,
    broken_constraints,
    candidate_subplan,
    correct_orders,
    correct_scenarios,
    holds,
    is_met,
    scenarios,
    weak_orders,
)
from tests.pike_bridge.knowledge.theories import is_model, models, prime_implicants
from tests.pike_bridge.plans import (
    ORDERED,
    P,
    constraint,
    network,
    plans,
    random_differences,
    random_plan,
    random_schedule,
    random_times,
)


def extends(augmented, scenario, times=None):
    """Whether some execution of the augmented plan extends a scenario of the original, at these times.

    That is what satisfies the theory and has a schedule: φ′_S of [PIKE, Theorem 4.6].
    """
    times = times or {}
    apart = ((one, other, times[other] - times[one]) for one, other in pairwise(times))
    fixed = (constraint(one, other, gap, gap) for one, other, gap in apart)
    network = replace(augmented.network, constraints=(*augmented.network.constraints, *fixed))
    return SatKnowledgeBase(augmented.theory, network).could_commit([Require(guard(scenario))])


X1 = guard({"x": "1"})
X2 = guard({"x": "2"})


def shared(conditions, effects, guards=()):
    """Activities from `a` to `b`, as many as guards, and one from `b` to `c`, the last."""
    activities = [Activity("(do)", "a", "b", Fraction(1), None, guard=label) for label in guards]
    activities.append(Activity("(use)", "b", "c", Fraction(1), None))
    whole = network("a b c", ("a", "c", 0, 9), choices=[("x", "12", "a")], activities=activities)
    return TeamPlan(whole, conditions, effects)


AT_C = Condition(P, "c", "c", ALWAYS, 2)
OVER_ALL = Condition(P, "b", "c", ALWAYS, 1)
AT_B = [Condition(P, "b", "b", ALWAYS, at) for at in (0, 1)]
MADE_AT_B, UNDONE_AT_C = Effect(P, "b", ALWAYS, 1), Effect(P.negation, "c", ALWAYS, 1)
SHARING = shared((AT_C,), (Effect(P, "b", X1, 0), Effect(P.negation, "b", X2, 1), Effect(P, "b", X1, 0)), (X1, X2))
OWN_START = shared((OVER_ALL,), (MADE_AT_B, UNDONE_AT_C), (X1,))
ENDING_TOGETHER = shared(
    tuple(AT_B), (Effect(P, "a", ALWAYS, None), Effect(P.negation, "b", ALWAYS, 1)), (ALWAYS, ALWAYS)
)
LATER = shared((AT_B[1],), (Effect(P, "c", ALWAYS, 1), UNDONE_AT_C), (X1,))


@pytest.mark.parametrize(
    ("plan", "precedence", "candidates"),
    [
        pytest.param(SHARING, ExactPrecedence, [("b", X1, "b", X2)], id="activities have effects of their own"),
        pytest.param(OWN_START, ExactPrecedence, [("b", ALWAYS)], id="the own start may support"),
        pytest.param(
            ENDING_TOGETHER,
            ExactPrecedence,
            [("a", ALWAYS, "b", ALWAYS), ("a", ALWAYS)],
            id="only another may threaten",
        ),
        pytest.param(LATER, ExactPrecedence, [()], id="what comes after is no candidate"),
        pytest.param(LATER, Ignorance, [("c", ALWAYS, "c", ALWAYS)], id="unless nothing is known about it"),
    ],
)
def test_producers_and_threats(plan, precedence, candidates):
    """Events and guards of the one producer, if any, and of the one threat."""
    found = open_conditions(plan, precedence(plan.network))
    happenings = [[*question.producers, *question.threats] for question in found]
    assert [sum(((each.event, each.guard) for each in several), ()) for several in happenings] == candidates
    assert all(len(question.producers) <= 1 and len(question.threats) <= 1 for question in found)


def test_what_is_supported_anyway_adds_nothing():
    for plan, precedence in (SHARING, ExactPrecedence), (OWN_START, Ignorance):
        result = augment(plan, precedence(plan.network))
        assert (added(result), result.theory.conflicts) == (set(), ())


@pytest.mark.parametrize(
    ("label", "second", "labels", "values"),
    [
        pytest.param(ALWAYS, X2, [X1, X2], ("b", "b[x = 2]", "none"), id="values of their own"),
        pytest.param(ALWAYS, ALWAYS, [ALWAYS], ("b", "none"), id="the more general is enough"),
        pytest.param(X1, ALWAYS, [X1], ("b", "none"), id="one is kept if the condition does not tell them apart"),
    ],
)
def test_two_producers_at_one_event(label, second, labels, values):
    effects = (Effect(P, "b", X1, 0), Effect(P, "b", second, 1))
    plan = shared((replace(AT_C, guard=label),), effects, (X1, second))
    result = augment(plan, ExactPrecedence(plan.network))
    assert ([link.label for link in result.links], result.theory.conflicts) == (labels, ())
    assert result.network.choices[1].domain == values


def test_the_effect_of_another_activity_at_the_end_is_a_definite_threat():
    plan = shared((OVER_ALL,), (MADE_AT_B, Effect(P.negation, "c", X1, None)), (X1,))
    result = augment(plan, Ignorance(plan.network))
    assert result.theory.conflicts == (X1 | guard({"s[(p) @ b–c]": "b"}),)


def test_conditions_that_ask_the_same_share_a_variable():
    twice = (*AT_B, Condition(P, "b", "b", X1, 0))
    plan = shared(twice, (Effect(P, "a", ALWAYS, None),), (ALWAYS,))
    questions = open_conditions(plan, ExactPrecedence(plan.network))
    assert [question.conditions for question in questions] == [twice[:2], twice[2:]]
    variables = [choice.name for choice in augment(plan, ExactPrecedence(plan.network)).network.choices]
    assert variables == ["x", "s[(p) @ b]", "s[(p) @ b][x = 1]"]


S = "s[(p) @ c]"


def example(effects, order, guards=None, bounds=()):
    """A plan whose event `c` needs p, which other events make true or false, and in which some events are ordered."""
    labels = guards or {}
    variables = {variable for label in labels.values() for variable, _ in label}
    names = dict.fromkeys([*effects, "c", *(name for pair in order for name in pair)])
    guards = {name: labels.get(name, ALWAYS) for name in names}
    figure = network(
        {name: dict(label) for name, label in guards.items()},
        *((one, other, EPSILON, None, guards[one] | guards[other]) for one, other in order),
        *bounds,
        choices=[(variable, "12", None) for variable in sorted(variables)],
    )
    made = (Effect(P if made else P.negation, name, guards[name], None) for name, made in effects.items())
    return TeamPlan(figure, (Condition(P, "c", "c", guards["c"], None),), tuple(made))


def augmented(plan):
    return augment(plan, ExactPrecedence(plan.network))


def added(result):
    assert result.network.constraints[: len(result.plan.network.constraints)] == result.plan.network.constraints
    return set(result.network.constraints[len(result.plan.network.constraints) :])


def ordering(earlier, later, **label):
    return constraint(earlier, later, EPSILON, None, label)


def links(result):
    return {link.producer.event: link.label for link in result.links}


def equivalent(formulas, expected, result):
    domains = result.theory.domains
    return models(Theory(domains, tuple(formulas))) == models(Theory(domains, (expected,)))


def supports(when, *alternatives):
    return Some((Not(conjunction(when)), Some(tuple(conjunction(each) for each in alternatives))))


def test_figure_6a_two_unordered_producers():
    result = augmented(example({"p1": True, "p2": True}, [("p1", "c"), ("p2", "c")]))
    assert links(result) == {"p1": frozenset(), "p2": frozenset()}
    assert result.network.domains == {S: ("p1", "p2", "none")}
    assert added(result) == set()
    assert equivalent(result.theory.constraints, supports(frozenset(), guard({S: "p1"}), guard({S: "p2"})), result)


def test_figure_6b_labels_are_the_guards_of_producers():
    labels = {"p1": guard({"x": "1"}), "p2": guard({"y": "1"}), "c": guard({"z": "1"})}
    result = augmented(example({"p1": True, "p2": True}, [("p1", "c"), ("p2", "c")], labels))
    assert links(result) == {"p1": labels["p1"], "p2": labels["p2"]}
    expected = supports(labels["c"], guard({S: "p1", "x": "1"}), guard({S: "p2", "y": "1"}))
    assert equivalent(result.theory.constraints, expected, result)
    for each in scenarios(result.plan.network.domains):
        assert extends(result, each) == ("1" in (each["x"], each["y"]) or each["z"] == "2")


def test_figure_9_a_threat_on_either_side():
    """The producer is between 1 and 3 before the consumer; the threat is at any time after the initial event."""
    order = [(INITIAL, "p1"), (INITIAL, "t1"), (INITIAL, "c")]
    result = augmented(example({"p1": True, "t1": False}, order, bounds=[("p1", "c", 1, 3)]))
    variable = "o[(p) @ c, p1, t1]"
    assert result.network.domains == {S: ("p1", "none"), variable: ("before", "after")}
    assert added(result) == {
        ordering("t1", "p1", **{S: "p1", variable: "before"}),
        ordering("c", "t1", **{S: "p1", variable: "after"}),
    }
    assert result.theory.constraints == (conjunction(guard({S: "p1"})),)


def test_figure_11_everything_is_possible():
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


def test_figure_13_the_constraints_at_the_end_of_section_4_4():
    """Two producers precede the consumer, and a threat comes after the one that is certain, wherever it will."""
    labels = {"p1": guard({"y": "1"}), "t1": guard({"x": "1"}), "c": guard({"z": "1"})}
    order = [("p1", "c"), ("p2", "c"), ("p2", "t1")]
    result = augmented(example({"p1": True, "p2": True, "t1": False}, order, labels))
    o = "o[(p) @ c, p1, t1]"
    both = {"z": "1", "x": "1"}
    assert added(result) == {
        ordering("c", "t1", **both, **{S: "p2"}),
        ordering("t1", "p1", **both, **{"y": "1", S: "p1", o: "before"}),
        ordering("c", "t1", **both, **{"y": "1", S: "p1", o: "after"}),
    }
    assert result.theory.conflicts == ()
    assert result.theory.constraints == (supports(labels["c"], guard({S: "p1", "y": "1"}), guard({S: "p2"})),)
    assert set(result.network.domains) == {"x", "y", "z", S, o}


def test_a_condition_without_candidates_is_a_conflict():
    label = guard({"z": "1"})
    result = augmented(example({"t1": False}, [], {"c": label}))
    assert result.theory.conflicts == (label,)
    assert result.links == ()


BEFORE, AFTER = ("t", "p"), ("c", "t")


@pytest.mark.parametrize(
    ("order", "expected", "avoided"),
    [
        ([("t", "p"), ("p", "c")], set(), False),  # C1
        ([("p", "c"), ("t", "c")], {BEFORE}, False),  # C2
        ([("p", "c"), ("p", "t"), ("t", "c")], set(), True),  # C3
        ([("p", "c")], {BEFORE, AFTER}, False),  # C5
        ([("p", "c"), ("p", "t")], {AFTER}, False),  # C6
        ([("p", "c"), ("c", "t")], set(), False),  # C9
        ([], {("p", "c"), BEFORE, AFTER}, False),
    ],
)
def test_figure_12_cases(order, expected, avoided):
    result = augmented(example({"p": True, "t": False}, order))
    assert {(each.source, each.target) for each in added(result)} == expected
    assert bool(result.theory.conflicts) == avoided


def test_algorithm_5_selects_links_that_are_threatened():
    """A certain producer dominates the threat before it, which then may lie between another producer and the consumer.

    The execution is correct, since the certain producer is later; the selected link is not what supports the condition.
    """
    plan = example({"p1": True, "t1": False, "p2": True}, [("t1", "p2"), ("p2", "c"), ("p1", "c")])
    times = {"p1": Fraction(1), "t1": Fraction(2), "p2": Fraction(3), "c": Fraction(4)}
    for selected in ("p1", "p2"):
        assert extends(augmented(plan), {S: selected}, times)
    assert augmented(plan).links[0].consumer.threats == ()


@settings(max_examples=200)
@given(plans)
def test_augmented_plans_are_well_formed_and_knowledge_spares_variables(plan):
    results = [augment(plan, each(plan.network)) for each in (ExactPrecedence, HalfKnowledge, Ignorance)]
    sizes = [len(result.network.choices) for result in results]
    assert sizes[0] == min(sizes)  # what is known in part may spare none
    for result in results:
        guards = result.network.guards
        assert result.theory.domains == result.network.domains
        assert len(result.network.domains) == len(result.network.choices)
        for each in result.network.constraints:
            assert guards[each.source] | guards[each.target] <= each.guard
            assert is_consistent(each.guard)
        for choice in result.network.choices[len(plan.network.choices) :]:
            assert len(set(choice.domain)) == len(choice.domain) >= 2


MOST_SCENARIOS = 600
"""Augmented plans with more scenarios than this are asked of a solver only, or left out."""


def temporal_conflicts_are_inconsistency(network):
    """Theorem 4.1: a candidate subplan has no schedule if and only if it entails a temporal conflict."""
    oracle = Oracle(TeamPlan(network, (), ()))
    found = [LabeledDistances(network, completions=completions) for completions in (True, False)]
    conflicts = [[each.vocabulary.decode(one) for one in each.conflicts] for each in found]
    conflicts.append(list(temporal_conflicts(network, Theory(network.domains, (), ()))))
    seen = Counter()
    for scenario in scenarios(network.domains):
        environment = guard(scenario)
        consistent = candidate_subplan(network, scenario).consistent
        assert (oracle.decide(environment).verdict is ExecutionExistence.EXISTS) == consistent
        for several in conflicts:
            assert any(one <= environment for one in several) != consistent
        seen["consistent subplans" if consistent else "inconsistent subplans"] += 1
    seen["premise"] = int(bool(seen["consistent subplans"] and seen["inconsistent subplans"]))
    return seen


def dominated_links_are_irrelevant(plan):
    """Theorem 4.2: without the effects of what is dominated, the same executions meet the condition.

    The paper takes the effect of one dominated producer away. That matters to other conditions, which it may not be
    dominated for, so that each condition is looked at alone. What pruning drops is then taken away all at once.
    """
    seen = Counter()
    orders = [(scenario, list(weak_orders(plan, scenario))) for scenario in scenarios(plan.network.domains)]
    ranked = [(scenario, ranks) for scenario, several in orders for ranks, _ in several]
    for condition in plan.conditions:
        alone = replace(plan, conditions=(condition,))
        met = [_meets(alone, condition, scenario, ranks) for scenario, ranks in ranked]
        seen["executions"] += len(met)
        dominated = set(dominated_by_definition(alone, condition))
        taken = [{one} for one in dominated]
        for question in open_conditions(alone, precedence := LabeledDistances(plan.network)):
            contexts = Contexts(precedence, question.guard)
            kept = prune(question, contexts)
            assert dominated.isdisjoint(kept.producers)
            taken.append({*question.producers, *question.threats} - {*kept.producers, *kept.threats})
        for happenings in filter(None, taken):
            removed = _without(alone, condition, happenings)
            assert [_meets(removed, condition, scenario, ranks) for scenario, ranks in ranked] == met
        if dominated:
            left = Oracle(_without(alone, condition, dominated))
            assert _found(left) == _found(Oracle(alone))
            seen["dominated links"] += len(dominated)
        seen["pruned candidates"] += len(taken[-1]) if taken else 0
    seen["premise"] = int(seen["dominated links"] > 0)
    return seen


def dominated_by_definition(plan, condition):
    """The producers that Definition 4.5 says another one dominates, scenario by scenario."""
    exact = ExactPrecedence(plan.network)
    producers = {LabeledHappening(each.event, each.guard) for each in plan.effects if may_produce(each, condition)}
    for weak, strong in product(sorted(producers, key=str), repeat=2):
        everything = weak.guard | strong.guard | condition.guard
        possible = not exact.conflicting(exact.vocabulary.encode(everything)) and len(dict(everything)) == len(
            everything
        )
        if possible and strong.event != condition.first and strong.guard <= weak.guard:
            label = exact.vocabulary.encode(everything)
            if exact.precedes(weak.event, strong.event, label) and exact.precedes(strong.event, condition.first, label):
                yield weak


def _without(plan, condition, happenings):
    """The plan without these effects on the atom of its condition."""
    kept = tuple(
        each
        for each in plan.effects
        if each.literal.atom != condition.literal.atom or LabeledHappening(each.event, each.guard) not in happenings
    )
    return replace(plan, effects=kept)


def _meets(plan, condition, scenario, ranks):
    return not holds(condition.guard, scenario) or is_met(plan, scenario, condition, ranks)


def _found(oracle):
    return {guard(each.scenario) for each in oracle.scenarios()}


def _size(network):
    """How many scenarios there are."""
    return prod(map(len, network.domains.values()))


def augmented_somehow(plan, random):
    """The plan, augmented with one of the ways to order events."""
    known = (LabeledDistances, partial(LabeledDistances, completions=False), StructuralPrecedence)
    precedence = random.choice((*known, ExactPrecedence, HalfKnowledge, Ignorance))
    return augment(plan, precedence(plan.network))


def executions_correspond(plan, random, *, most=4):
    """Theorem 4.3: an execution is correct if and only if it extends to a model of KB that the same times satisfy."""
    result, oracle = augmented_somehow(plan, random), Oracle(plan)
    seen = Counter()
    for scenario in scenarios(plan.network.domains):
        assert extends(result, scenario) == admits_correct_execution(plan, scenario)
        for schedule in _schedules(plan, scenario, random, most):
            correct = _correct(plan, scenario, schedule)
            assert (faults(plan, Execution(scenario, schedule)) == ()) == correct
            verdict = oracle.decide(guard(scenario), schedule).verdict
            assert (verdict is ExecutionExistence.EXISTS) == correct
            assert extends(result, scenario, schedule) == correct
            if _size(result.network) <= MOST_SCENARIOS:
                extensions = _models(result, scenario)
                assert any(not broken_constraints(result.network, each, schedule) for each in extensions) == correct
            on_time = not broken_constraints(plan.network, scenario, schedule)
            seen["correct" if correct else "on time, but incomplete" if on_time else "not on time"] += 1
    seen["premise"] = int(bool(seen["correct"] and seen["on time, but incomplete"]))
    return seen


def partial_executions_correspond(plan, random, *, most=4):
    """Theorem 4.4: a partial execution extends to a correct one of the plan if and only if to one of the other."""
    result, oracle = augmented_somehow(plan, random), Oracle(plan)
    everything = list(scenarios(plan.network.domains))
    seen = Counter()
    for _ in range(most):
        begun = random.choice(everything)
        whole = next(_schedules(plan, begun, random, 1), {})
        # What has been executed by some moment; the choices that activate it have been made, and perhaps another one.
        now = random.choice(sorted(whole.values()) or [Fraction(0)])
        executed = {
            event: time for event, time in whole.items() if time < now or (time == now and random.random() < 0.6)
        }
        chosen = frozenset().union(*(plan.network.guards[event] for event in executed))
        if random.random() < 0.3:
            chosen |= guard({name: begun[name] for name in random.sample(list(begun), 1)})
        extending = [each for each in everything if chosen <= guard(each)]
        correct = any(next(correct_orders(plan, each, executed), None) is not None for each in extending)
        assert (oracle.decide(chosen, executed).verdict is ExecutionExistence.EXISTS) == correct
        assert extends(result, dict(chosen), executed) == correct
        if _size(result.network) <= MOST_SCENARIOS:
            possible = (each for scenario in extending for each in _models(result, scenario))
            subplans = (candidate_subplan(result.network, each).at_times(executed) for each in possible)
            assert any(subplan.consistent for subplan in subplans) == correct
        kind = "whole" if len(executed) == len(whole) else "empty" if not executed else "partial"
        seen[f"{kind}, {'' if correct else 'not '}correct"] += 1
    seen["premise"] = int(bool(seen["partial, correct"] or seen["partial, not correct"]))
    return seen


def consistent_executions_are_correct(plan, random, *, most=40):
    """Theorem 4.5: a schedule of the augmented plan under any model of KB meets all conditions.

    The same is not so of schedules of the original plan, which is counted, too: else there were nothing to show.
    """
    result = augmented_somehow(plan, random)
    seen = Counter()
    if _size(result.network) > MOST_SCENARIOS:
        return seen
    found = [each for scenario in scenarios(plan.network.domains) for each in _models(result, scenario)]
    for model in random.sample(found, min(most, len(found))):
        scenario = {name: model[name] for name in plan.network.domains}
        subplan = candidate_subplan(result.network, model)
        schedule = random_schedule(subplan, random) if subplan.consistent else None
        if schedule is not None:
            assert _correct(plan, scenario, schedule)
            assert faults(plan, Execution(scenario, schedule)) == ()
            seen["executions"] += any(holds(each.guard, scenario) for each in plan.conditions)
        free = candidate_subplan(plan.network, scenario)
        schedule = random_schedule(free, random) if free.consistent else None
        seen["others that are not"] += schedule is not None and not _correct(plan, scenario, schedule)
    seen["premise"] = int(bool(seen["executions"] and seen["others that are not"]))
    return seen


def models_are_correct_scenarios(plan, random):
    """Theorem 4.6: the models of every compiled KB are what satisfies the constraints and has a schedule.

    Literally, the theorem says that each scenario of T′ with a correct execution satisfies KB; but a support variable
    may have a value that KB forbids without any event of the execution being another. So it is about the team scenarios
    of the original plan, as Theorem 4.3 has it: those with a correct execution are those that extend to a model.
    """
    seen = Counter()
    correct = correct_scenarios(plan)
    assert _found(Oracle(plan)) == correct
    backend, temporal = random.choice(("pitms", "atms", "bdd", "sat")), random.choice(list(Temporal))
    compiled = Compiling(plan, backend, temporal).compile()
    result = compiled.augmented
    if _size(result.network) > MOST_SCENARIOS:
        return seen
    models = [
        (guard(scenario), each)
        for scenario in scenarios(plan.network.domains)
        for each in _models(result, scenario)
        if candidate_subplan(result.network, each).consistent
    ]
    assert compiled.knowledge.count_models() == len(models)
    assert all(compiled.knowledge.could_commit([Require(guard(each))]) for _, each in models)
    assert {scenario for scenario, _ in models} == correct
    seen["models"] = len(models)
    total = _size(plan.network)
    seen["none"], seen["all"] = int(not correct), int(len(correct) == total)
    seen["premise"] = int(0 < len(correct) < total)
    return seen


def _schedules(plan, scenario, random, most):
    """Times for the events of a scenario: mostly such as satisfy the constraints."""
    subplan = candidate_subplan(plan.network, scenario)
    for _ in range(most):
        drawn = random_schedule(subplan, random) if subplan.consistent and random.random() < 0.85 else None
        yield random_times(subplan, random) if drawn is None else drawn


def _models(result, scenario):
    """The extensions of a scenario that satisfy the constraints of KB, temporal conflicts aside."""
    domains = {name: values for name, values in result.network.domains.items() if name not in scenario}
    for added in scenarios(domains):
        whole = scenario | added
        if is_model(whole, result.theory):
            yield whole


def _correct(plan, scenario, times):
    """Definitions 2.5 and 2.6, outright."""
    return not broken_constraints(plan.network, scenario, times) and all(
        is_met(plan, scenario, condition, times) for condition in plan.conditions if holds(condition.guard, scenario)
    )


def implicants_of_plans(plan, random, *, most=100):
    """Invariant 5.2 for the goal of a compiled plan: its implicants cover what the oracle calls correct."""
    compiled = Compiling(plan, "pitms", Temporal(random.choice(("lazy", "apsp"))), shortcut=False).compile()
    network, theory = compiled.augmented.network, compiled.augmented.theory
    seen = Counter()
    if _size(network) > most:
        return seen
    left = [
        each
        for each in scenarios(network.domains)
        if is_model(each, theory) and candidate_subplan(network, each).consistent
    ]
    assert isinstance(compiled.knowledge, PiTms)
    goal = set(compiled.knowledge.prime_implicants())
    assert goal == prime_implicants(network.domains, left)
    team = map(guard, scenarios(plan.network.domains))
    covered = {scenario for scenario in team if any(is_consistent(each | scenario) for each in goal)}
    assert covered == _found(Oracle(plan))
    seen["implicants"], seen["models"] = len(goal), len(left)
    seen["premise"] = int(len(goal) > 1)
    return seen


@dataclass(frozen=True)
class Sweep:
    """A theorem checked on one random instance after another."""

    check: Callable[[Random], Counter[str]]
    quick: int
    slow: int
    share: float
    """Of how many instances the premise must have held, at least: of fewer, the sweep would show little."""


SWEEPS = {
    "theorem 4.1": Sweep(
        lambda random: temporal_conflicts_are_inconsistency(random_differences(random)), 60, 2000, 0.3
    ),
    "theorem 4.2": Sweep(
        lambda random: dominated_links_are_irrelevant(random_plan(random, style=ORDERED)), 120, 6000, 0.07
    ),
    "theorem 4.3": Sweep(lambda random: executions_correspond(random_plan(random), random), 20, 2500, 0.3),
    "theorem 4.4": Sweep(lambda random: partial_executions_correspond(random_plan(random), random), 25, 2000, 0.6),
    "theorem 4.5": Sweep(
        lambda random: consistent_executions_are_correct(random_plan(random), random), 200, 10000, 0.06
    ),
    "theorem 4.6": Sweep(lambda random: models_are_correct_scenarios(random_plan(random), random), 40, 2500, 0.3),
    "invariant 5.2": Sweep(lambda random: implicants_of_plans(random_plan(random, events=4), random), 40, 2000, 0.15),
}


KINDS = ["quick", pytest.param("slow", marks=pytest.mark.slow)]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", SWEEPS)
def test_sweep(name, kind, record_property):
    sweep, seen, count = SWEEPS[name], Counter(), getattr(SWEEPS[name], kind)
    for index in range(count):
        try:
            seen += sweep.check(Random(f"{name} {kind} {index}"))  # noqa: S311 - no secrets
        except AssertionError as error:
            error.add_note(f"{name}, seed {kind!r}, instance {index}")
            raise
    for what, number in {"instances": count, **seen}.items():
        record_property(what, number)
    print(f"\n{name}: {count} instances, {dict(seen)}")  # noqa: T201 - for `pytest -s`
    assert seen["premise"] >= sweep.share * count
