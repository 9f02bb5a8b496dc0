"""Causal links, the examples of the paper, and its theorems [PIKE §4] on random plans.

Theorem 4.1, of distances and temporal conflicts, is in `test_temporal.py`.
"""

from dataclasses import replace
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
from robust.pike_bridge.labeled_apsp import LabeledDistances
from robust.pike_bridge.model import ALWAYS, EPSILON, Activity, Condition, Effect, TeamPlan, guard, may_produce
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, faults
from robust.pike_bridge.theory import Not, Require, Some, conjunction, is_consistent
from tests.pike_bridge import brute_force as brute
from tests.pike_bridge import plans
from tests.pike_bridge.brute_force import ExactPrecedence, HalfKnowledge, Ignorance, holds, scenarios
from tests.pike_bridge.knowledge.theories import is_model
from tests.pike_bridge.plans import P, constraint, network
from tests.sampling import often

NOT_P = P.negation
X1, X2 = guard({"x": "1"}), guard({"x": "2"})


def extends(augmented, scenario, times=None):
    """Whether some execution of the augmented plan extends a scenario of the original, at these times.

    That is what satisfies the theory and has a schedule: φ′_S of [PIKE, Theorem 4.6].
    """
    apart = ((source, target, later - time) for (source, time), (target, later) in pairwise((times or {}).items()))
    fixed = (constraint(source, target, gap, gap) for source, target, gap in apart)
    fixed_network = replace(augmented.network, constraints=(*augmented.network.constraints, *fixed))
    return SatKnowledgeBase(augmented.theory, fixed_network).could_commit([Require(guard(scenario))])


def shared(conditions, effects, guards=()):
    """Activities from `a` to `b`, as many as guards, and one from `b` to `c`, the last."""
    activities = [Activity("(do)", "a", "b", Fraction(1), None, guard=label) for label in guards]
    activities.append(Activity("(use)", "b", "c", Fraction(1), None))
    whole = network("a b c", ("a", "c", 0, 9), choices=[("x", "12", "a")], activities=activities)
    return TeamPlan(whole, conditions, effects)


AT_C = Condition(P, "c", "c", ALWAYS, 2)
OVER_ALL = Condition(P, "b", "c", ALWAYS, 1)
AT_B = tuple(Condition(P, "b", "b", ALWAYS, at) for at in (0, 1))
MADE_AT_B, UNDONE_AT_C = Effect(P, "b", ALWAYS, 1), Effect(NOT_P, "c", ALWAYS, 1)
SHARING = shared((AT_C,), (Effect(P, "b", X1, 0), Effect(NOT_P, "b", X2, 1), Effect(P, "b", X1, 0)), (X1, X2))
OWN_START = shared((OVER_ALL,), (MADE_AT_B, UNDONE_AT_C), (X1,))
ENDING_TOGETHER = shared(AT_B, (Effect(P, "a", ALWAYS, None), Effect(NOT_P, "b", ALWAYS, 1)), (ALWAYS, ALWAYS))
LATER = shared((AT_B[1],), (Effect(P, "c", ALWAYS, 1), UNDONE_AT_C), (X1,))


@pytest.mark.parametrize(
    ("plan", "precedence", "candidates"),
    [
        pytest.param(SHARING, ExactPrecedence, [("b", X1, "b", X2)], id="activities have effects of their own"),
        pytest.param(OWN_START, ExactPrecedence, [("b", ALWAYS)], id="the own start may support"),
        pytest.param(
            ENDING_TOGETHER, ExactPrecedence, [("a", ALWAYS, "b", ALWAYS), ("a", ALWAYS)], id="others may threaten"
        ),
        pytest.param(LATER, ExactPrecedence, [()], id="what comes after is no candidate"),
        pytest.param(LATER, Ignorance, [("c", ALWAYS, "c", ALWAYS)], id="unless nothing is known about it"),
    ],
)
def test_producers_and_threats(plan, precedence, candidates):
    """Events and guards of the one producer, if any, and of the one threat."""
    questions = open_conditions(plan, precedence(plan.network))
    happenings = [[*question.producers, *question.threats] for question in questions]
    assert [sum(((each.event, each.guard) for each in several), ()) for several in happenings] == candidates
    assert all(len(question.producers) <= 1 and len(question.threats) <= 1 for question in questions)


def added(result):
    count = len(result.plan.network.constraints)
    assert result.network.constraints[:count] == result.plan.network.constraints
    return set(result.network.constraints[count:])


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
    result = augmented(shared((replace(AT_C, guard=label),), effects, (X1, second)))
    assert ([link.label for link in result.links], result.theory.conflicts) == (labels, ())
    assert result.network.choices[1].domain == values


def test_definite_threats_shared_variables_and_what_is_supported_anyway():
    for plan, precedence in (SHARING, ExactPrecedence), (OWN_START, Ignorance):
        result = augment(plan, precedence(plan.network))
        assert (added(result), result.theory.conflicts) == (set(), ())
    plan = shared((OVER_ALL,), (MADE_AT_B, Effect(NOT_P, "c", X1, None)), (X1,))
    result = augment(plan, Ignorance(plan.network))
    assert result.theory.conflicts == (X1 | guard({"s[(p) @ b–c]": "b"}),)
    plan = shared((*AT_B, Condition(P, "b", "b", X1, 0)), (Effect(P, "a", ALWAYS, None),), (ALWAYS,))
    questions = open_conditions(plan, ExactPrecedence(plan.network))
    assert [question.conditions for question in questions] == [plan.conditions[:2], plan.conditions[2:]]
    assert list(augmented(plan).network.domains) == ["x", "s[(p) @ b]", "s[(p) @ b][x = 1]"]


S = "s[(p) @ c]"


def example(effects, order, guards=None, bounds=()):
    """A plan whose event `c` needs p, which other events make true or false, and in which some events are ordered."""
    names = dict.fromkeys([*effects, "c", *(name for pair in order for name in pair)])
    guards = {name: (guards or {}).get(name, ALWAYS) for name in names}
    variables = sorted({variable for label in guards.values() for variable, _ in label})
    ordered = ((earlier, later, EPSILON, None, guards[earlier] | guards[later]) for earlier, later in order)
    figure = network(
        {name: dict(label) for name, label in guards.items()},
        *ordered,
        *bounds,
        choices=[(variable, "12", None) for variable in variables],
    )
    happening = (Effect(P if produced else NOT_P, name, guards[name], None) for name, produced in effects.items())
    return TeamPlan(figure, (Condition(P, "c", "c", guards["c"], None),), tuple(happening))


def augmented(plan):
    return augment(plan, ExactPrecedence(plan.network))


def ordering(earlier, later, **label):
    return constraint(earlier, later, EPSILON, None, label)


def supports(when, *alternatives):
    return Some((Not(conjunction(when)), Some(tuple(map(conjunction, alternatives)))))


TWO, BOTH_BEFORE = {"p1": True, "p2": True}, [("p1", "c"), ("p2", "c")]
LABELS = {name: guard({variable: "1"}) for name, variable in (("p1", "x"), ("p2", "y"), ("c", "z"))}
LABELS_11 = {
    name: guard({variable: "1"}) for name, variable in zip(("p1", "p2", "t1", "t2", "c"), "uvxyw", strict=True)
}
LABELS_13 = {name: guard({variable: "1"}) for name, variable in (("p1", "y"), ("t1", "x"), ("c", "z"))}
O_9, O_13 = "o[(p) @ c, p1, t1]", {"z": "1", "x": "1"}
S_P1, S_P2 = guard({S: "p1"}), guard({S: "p2"})


def everything_of_figure_11():
    """Orderings and choices where everything is possible."""
    orderings, choices = set(), {}
    for producer, variable in (("p1", "u"), ("p2", "v")):
        link = {S: producer, variable: "1", "w": "1"}
        orderings.add(ordering(producer, "c", **link))
        for threat, other in (("t1", "x"), ("t2", "y")):
            choices[name := f"o[(p) @ c, {producer}, {threat}]"] = ("before", "after")
            orderings.add(ordering(threat, producer, **link, **{other: "1", name: "before"}))
            orderings.add(ordering("c", threat, **link, **{other: "1", name: "after"}))
    return orderings, choices


FIGURES = {
    "6b: labels are the guards of producers": (
        example(TWO, BOTH_BEFORE, LABELS), {"p1": LABELS["p1"], "p2": LABELS["p2"]}, set(), {},
        supports(LABELS["c"], S_P1 | LABELS["p1"], S_P2 | LABELS["p2"]),
    ),
    "11: two producers and two threats, unordered, each in a choice of its own": (
        example(TWO | {"t1": False, "t2": False}, [], LABELS_11), {"p1": LABELS_11["p1"], "p2": LABELS_11["p2"]},
        *everything_of_figure_11(),
        supports(LABELS_11["c"], S_P1 | LABELS_11["p1"], S_P2 | LABELS_11["p2"]),
    ),
    "13, §4.4: the threat comes after the producer that is certain": (
        example(TWO | {"t1": False}, [*BOTH_BEFORE, ("p2", "t1")], LABELS_13), {"p1": LABELS_13["p1"], "p2": ALWAYS},
        {
            ordering("c", "t1", **O_13, **{S: "p2"}),
            ordering("t1", "p1", **O_13, **{"y": "1", S: "p1", O_9: "before"}),
            ordering("c", "t1", **O_13, **{"y": "1", S: "p1", O_9: "after"}),
        },
        {O_9: ("before", "after")},
        supports(LABELS_13["c"], S_P1 | LABELS_13["p1"], S_P2),
    ),
}  # fmt: skip


@pytest.mark.parametrize(("plan", "links", "orderings", "choices", "formula"), FIGURES.values(), ids=FIGURES)
def test_figures_of_the_paper(plan, links, orderings, choices, formula):
    result = augmented(plan)
    assert {link.producer.event: link.label for link in result.links} == links
    assert (added(result), result.theory.conflicts, result.theory.constraints) == (orderings, (), (formula,))
    assert result.network.domains == plan.network.domains | {S: (*links, "none")} | choices
    if links == {"p1": LABELS["p1"], "p2": LABELS["p2"]}:
        for scenario in scenarios(plan.network.domains):
            assert extends(result, scenario) == ("1" in (scenario["x"], scenario["y"]) or scenario["z"] == "2")


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


@settings(max_examples=often(50, 100))
@given(plans.plans)
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


def dominated_links_are_irrelevant(plan, _):
    """Without the effects of what is dominated, the same executions meet the condition.

    The paper takes the effect of one dominated producer away. That matters to other conditions, which it may not be
    dominated for, so that each condition is looked at alone. What pruning drops is then taken away all at once.
    """
    premise = False
    everything = scenarios(plan.network.domains)
    ranked = [(scenario, ranks) for scenario in everything for ranks in brute.weak_orders(plan, scenario)]
    for condition in plan.conditions:
        alone = replace(plan, conditions=(condition,))
        met = [_meets(alone, condition, scenario, ranks) for scenario, ranks in ranked]
        dominated = set(dominated_by_definition(alone, condition))
        taken = [{weak} for weak in dominated]
        for question in open_conditions(alone, precedence := LabeledDistances(plan.network)):
            kept = prune(question, Contexts(precedence, question.guard))
            assert dominated.isdisjoint(kept.producers)
            taken.append({*question.producers, *question.threats} - {*kept.producers, *kept.threats})
        for happenings in filter(None, taken):
            removed = _without(alone, condition, happenings)
            assert [_meets(removed, condition, scenario, ranks) for scenario, ranks in ranked] == met
        if dominated:
            assert oracle_scenarios(_without(alone, condition, dominated)) == oracle_scenarios(alone)
            premise = True
    return premise


def dominated_by_definition(plan, condition):
    """The producers that Definition 4.5 says another one dominates, scenario by scenario."""
    exact = ExactPrecedence(plan.network)
    producers = {LabeledHappening(each.event, each.guard) for each in plan.effects if may_produce(each, condition)}
    for weak, strong in product(sorted(producers, key=str), repeat=2):
        everything = weak.guard | strong.guard | condition.guard
        label = exact.vocabulary.encode(everything)
        possible = is_consistent(everything) and not exact.conflicting(label)
        pairs = (weak.event, strong.event), (strong.event, condition.first)
        in_order = all(exact.precedes(*pair, label) for pair in pairs)
        if possible and in_order and strong.event != condition.first and strong.guard <= weak.guard:
            yield weak


def _without(plan, condition, happenings):
    """The plan without these effects on the atom of its condition."""

    def stays(effect):
        about = effect.literal.atom == condition.literal.atom
        return not (about and LabeledHappening(effect.event, effect.guard) in happenings)

    return replace(plan, effects=tuple(filter(stays, plan.effects)))


def oracle_scenarios(plan):
    return {guard(each.scenario) for each in Oracle(plan).scenarios()}


def _meets(plan, condition, scenario, ranks):
    return not holds(condition.guard, scenario) or brute.is_met(plan, scenario, condition, ranks)


def _small(network):
    return prod(map(len, network.domains.values())) <= MOST_SCENARIOS


def augmented_somehow(plan, random):
    """The plan, augmented with one of the ways to order events."""
    known = (LabeledDistances, partial(LabeledDistances, completions=False), StructuralPrecedence)
    precedence = random.choice((*known, ExactPrecedence, HalfKnowledge, Ignorance))
    return augment(plan, precedence(plan.network))


def executions_correspond(plan, random):
    """An execution, or a part of one, extends to a correct one of the plan if and only if to one of the other."""
    result, oracle = augmented_somehow(plan, random), Oracle(plan)
    everything = list(scenarios(plan.network.domains))
    premise = False
    for _ in range(6):
        begun = random.choice(everything)
        whole = _schedule(plan, begun, random)
        # What has been executed by some moment; the choices that activate it have been made, and perhaps another one.
        now = random.choice(sorted(whole.values()) or [Fraction(0)])
        executed = {
            event: time for event, time in whole.items() if time < now or (time == now and random.random() < 0.6)
        }
        chosen = frozenset().union(*(plan.network.guards[event] for event in executed))
        if random.random() < 0.3:
            chosen |= guard({name: begun[name] for name in random.sample(list(begun), 1)})
        if random.random() < 0.5:
            executed, chosen = whole, guard(begun)
        extending = [each for each in everything if chosen <= guard(each)]
        correct = any(brute.admits_correct_execution(plan, each, executed) for each in extending)
        if chosen == guard(begun) and executed == whole:
            assert (faults(plan, Execution(begun, whole)) == ()) == correct == brute.is_correct(plan, begun, whole)
        assert (oracle.decide(chosen, executed).verdict is ExecutionExistence.EXISTS) == correct
        assert extends(result, dict(chosen), executed) == correct
        if _small(result.network):
            models = (each for scenario in extending for each in _models(result, scenario))
            subplans = (brute.candidate_subplan(result.network, each).at_times(executed) for each in models)
            assert any(subplan.consistent for subplan in subplans) == correct
        premise |= 0 < len(executed) < len(whole)
    return premise


def consistent_executions_are_correct(plan, random):
    """A schedule of the augmented plan under any model of KB meets all conditions.

    The same is not so of schedules of the original plan: else there were nothing to show.
    """
    result = augmented_somehow(plan, random)
    executions = others = False
    if not _small(result.network):
        return False
    models = [each for scenario in scenarios(plan.network.domains) for each in _models(result, scenario)]
    for model in random.sample(models, min(40, len(models))):
        scenario = {name: model[name] for name in plan.network.domains}
        subplans = map(brute.candidate_subplan, (result.network, plan.network), (model, scenario))
        schedule, free = (plans.random_schedule(each, random) if each.consistent else None for each in subplans)
        if schedule is not None:
            assert brute.is_correct(plan, scenario, schedule)
            assert faults(plan, Execution(scenario, schedule)) == ()
            executions |= any(holds(each.guard, scenario) for each in plan.conditions)
        others |= free is not None and not brute.is_correct(plan, scenario, free)
    return executions and others


def models_are_correct_scenarios(plan, random):
    """The models of every compiled KB are what satisfies the constraints and has a schedule.

    Literally, the theorem says that each scenario of T′ with a correct execution satisfies KB; but a support variable
    may have a value that KB forbids without any event of the execution being another. So it is about the team scenarios
    of the original plan, as Theorem 4.3 has it: those with a correct execution are those that extend to a model.
    """
    correct = brute.correct_scenarios(plan)
    assert oracle_scenarios(plan) == correct
    backend, temporal = random.choice(("pitms", "atms", "bdd", "sat")), random.choice(list(Temporal))
    compiled = Compiling(plan, backend, temporal).compile()
    result, everything = compiled.augmented, list(scenarios(plan.network.domains))
    if not _small(result.network):
        return False
    models = [
        (guard(scenario), model)
        for scenario in everything
        for model in _models(result, scenario)
        if brute.candidate_subplan(result.network, model).consistent
    ]
    assert compiled.knowledge.count_models() == len(models)
    assert all(compiled.knowledge.could_commit([Require(guard(each))]) for _, each in models)
    assert {scenario for scenario, _ in models} == correct
    return 0 < len(correct) < len(everything)


def _schedule(plan, scenario, random):
    """Times for the events of a scenario: mostly such as satisfy the constraints."""
    subplan = brute.candidate_subplan(plan.network, scenario)
    drawn = plans.random_schedule(subplan, random) if subplan.consistent and random.random() < 0.85 else None
    return plans.random_times(subplan, random) if drawn is None else drawn


def _models(result, scenario):
    """The extensions of a scenario that satisfy the constraints of KB, temporal conflicts aside."""
    domains = {name: values for name, values in result.network.domains.items() if name not in scenario}
    return (whole for more in scenarios(domains) if is_model(whole := scenario | more, result.theory))


SWEEPS = {
    "theorem 4.2": (dominated_links_are_irrelevant, 40, 6000, 0.07),
    "theorems 4.3 and 4.4": (executions_correspond, 10, 4000, 0.5),
    "theorem 4.5": (consistent_executions_are_correct, 65, 10000, 0.06),
    "theorem 4.6": (models_are_correct_scenarios, 20, 2500, 0.3),
}
"""Statements about random instances that tell whether their premise holds; how many; in what share at least it does."""


@pytest.mark.parametrize("kind", ["quick", pytest.param("slow", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SWEEPS)
def test_sweep(name, kind):
    (check, quick, slow, share), premises = SWEEPS[name], 0
    count, style = quick if kind == "quick" else slow, plans.ORDERED if name == "theorem 4.2" else None
    for index in range(count):
        random = Random(f"{name} {kind} {index}")  # noqa: S311 - no secrets
        try:
            premises += check(plans.random_plan(random, style=style), random)
        except AssertionError as error:
            error.add_note(f"{name}, seed {kind!r}, instance {index}")
            raise
    assert premises >= share * count
