"""The statements of [PIKE §5, Appendix C] about labels and labeled values, on random instances; for tests only.

Every function checks a statement on what its seed gives, and says how often its premise held there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import prod
from random import Random

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from robust.pike_bridge.compile import Compiling, Temporal
from robust.pike_bridge.knowledge.interface import Effort, KnowledgeStatistics
from robust.pike_bridge.knowledge.labels import Label, consensus, environments, insert
from robust.pike_bridge.knowledge.network import NodeKind
from robust.pike_bridge.knowledge.tms import PiTms
from robust.pike_bridge.model import Assignment, Choice, Constraint, Event, Guard, TeamPlan, Tpnu, Vocabulary
from robust.pike_bridge.semantics import Existence, Oracle
from robust.pike_bridge.temporal.distance_graph import LabeledNumbers
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory, is_model, satisfies
from tests.pike_bridge.brute_force import candidate_subplan
from tests.pike_bridge.knowledge.theories import models, prime_implicants, scenarios
from tests.pike_bridge.plans import contested_plans, networks, team_plans, tiny_plans
from tests.pike_bridge.sweeps import ORDERED, random_differences, random_plan
from tests.pike_bridge.theorems import (
    consistent_executions_are_correct,
    dominated_links_are_irrelevant,
    executions_correspond,
    models_are_correct_scenarios,
    partial_executions_correspond,
    temporal_conflicts_are_inconsistency,
)

Domains = dict[str, tuple[str, ...]]


def random_domains(random: Random, most: int = 4) -> Domains:
    return {name: ("1", "2", "3")[: random.choice((2, 2, 3))] for name in "xyzw"[: random.randint(2, most)]}


def random_environment(random: Random, domains: Domains, share: float = 0.5) -> Guard:
    return frozenset(
        Assignment(name, random.choice(values)) for name, values in domains.items() if random.random() < share
    )


def consensus_gives_implicants(random: Random) -> Counter[str]:
    """Lemma 5.1: the conjunction of an environment for each value of a variable is an implicant, and is found."""
    domains = random_domains(random)
    name = random.choice(list(domains))
    others = {other: values for other, values in domains.items() if other != name}
    parts = {value: random_environment(random, others, 0.4) for value in domains[name]}
    known = [part | {Assignment(name, value)} for value, part in parts.items()]
    known += [random_environment(random, domains) for _ in range(random.randint(0, 3))]
    known = [each for each in known if each]
    vocabulary = Vocabulary(domains)
    label = _label(known, vocabulary)
    found = {vocabulary.decode(each) for each in environments(_consensus(label, vocabulary, name))}
    for environment in found:
        assert _implies(domains, environment, known)
        assert all(each.variable != name for each in environment)
    both: Guard = frozenset().union(*parts.values())
    seen = Counter({"environments": len(found)})
    if len(dict(both)) == len(both):
        assert _implies(domains, both, known)
        kept = {vocabulary.decode(each) for each in environments(label)}
        assert any(each <= both for each in found | kept)
        seen["premise"] = 1
    return seen


def _label(known: Iterable[Guard], vocabulary: Vocabulary) -> Label:
    label: Label = {}
    for each in known:
        scope = sum(vocabulary.field(variable) for variable, _ in each)
        insert(label, vocabulary.encode(each) & vocabulary.made, scope)
    return label


def _consensus(label: Label, vocabulary: Vocabulary, name: str) -> Label:
    return consensus(label, vocabulary.field(name), Effort(KnowledgeStatistics()))


def _implies(domains: Domains, environment: Guard, known: Iterable[Guard]) -> bool:
    """Whether every scenario of an environment is one of a disjunction's."""
    several = list(known)
    return all(
        any(each <= frozenset(scenario.items()) for each in several)
        for scenario in scenarios(domains)
        if environment <= frozenset(scenario.items())
    )


def labels_are_prime_implicants(random: Random) -> Counter[str]:
    """Invariant 5.2: each node's label has all prime implicants of its constraint and all conflicts, no more."""
    domains = random_domains(random)
    constraints = tuple(_formula(random, domains, 3) for _ in range(random.randint(0, 3)))
    conflicts = tuple(random_environment(random, domains, 0.6) for _ in range(random.randint(0, 3)))
    theory = Theory(domains, constraints, tuple(filter(None, conflicts)))
    knowledge = PiTms(theory, shortcut=False)
    without = models(Theory(domains, (), knowledge.simplified.conflicts))
    seen: Counter[str] = Counter()
    for label in knowledge.labels():
        if label.node.kind is not NodeKind.CONTRADICTION:
            holding = [model for model in without if satisfies(model, label.node.formula)]
            assert label.environments == prime_implicants(domains, holding)
            seen["nodes"] += 1
    goal = set(knowledge.prime_implicants())
    assert goal == prime_implicants(domains, models(theory))
    seen["implicants"] = len(goal)
    seen["premise"] = int(len(goal) > 1)
    return seen


def _formula(random: Random, domains: Domains, depth: int) -> Formula:
    kind = random.choice((Is, All, Some, Some, Not)) if depth else Is
    if kind is Is:
        name = random.choice(list(domains))
        return Is(Assignment(name, random.choice(domains[name])))
    if kind is Not:
        return Not(_formula(random, domains, depth - 1))
    return kind(tuple(_formula(random, domains, depth - 1) for _ in range(random.randint(1, 3))))


def implicants_of_plans(plan: TeamPlan, random: Random, *, most: int = 100) -> Counter[str]:
    """Invariant 5.2 for the goal of a compiled plan: its implicants cover what the oracle calls correct."""
    compiled = Compiling(plan, "pitms", Temporal(random.choice(("lazy", "apsp"))), shortcut=False).run()
    network, theory = compiled.augmented.network, compiled.augmented.theory
    seen: Counter[str] = Counter()
    if prod(map(len, network.domains.values())) > most:
        return seen
    left = [
        each
        for each in scenarios(network.domains)
        if is_model(each, theory) and candidate_subplan(network, each).consistent
    ]
    assert isinstance(compiled.knowledge, PiTms)
    goal = set(compiled.knowledge.prime_implicants())
    assert goal == prime_implicants(network.domains, left)
    covered = {
        frozenset(scenario.items())
        for scenario in scenarios(plan.network.domains)
        if any(_compatible(each, scenario) for each in goal)
    }
    assert covered == {frozenset(each.scenario.items()) for each in Oracle(plan).scenarios()}
    seen["implicants"], seen["models"] = len(goal), len(left)
    seen["premise"] = int(len(goal) > 1)
    return seen


def _compatible(environment: Guard, scenario: dict[str, str]) -> bool:
    return all(scenario.get(name, value) == value for name, value in environment)


def completions_follow(random: Random) -> Counter[str]:
    """Theorem C.1: by cases on a variable, the greatest of the cases' values holds; all that follows so is found.

    The oracle is asked of a plan with these bounds between two events.
    """
    domains = random_domains(random, 3)
    vocabulary = Vocabulary(domains)
    name = random.choice(list(domains))
    pairs = [
        (random.randint(-4, 4), random_environment(random, domains, 0.4) | _case(random, name, domains))
        for _ in range(random.randint(2, 7))
    ]
    pairs = [(value, label) for value, label in pairs if len(dict(label)) == len(label)]
    known = LabeledNumbers(vocabulary, [(value, vocabulary.encode(label)) for value, label in pairs])
    found = [(value, vocabulary.decode(label)) for value, label in known.completions(name)]
    kept = [(value, vocabulary.decode(label)) for value, label in known]
    oracle = Oracle(_bounded(domains, pairs))
    for value, label in found:
        assert _worst(domains, pairs, label, value) is not None
        assert not _reaches(oracle, label, value + 1)
    seen: Counter[str] = Counter()
    cases = [
        [(value, label - {Assignment(name, option)}) for value, label in pairs if Assignment(name, option) in label]
        for option in domains[name]
    ]
    for chosen in product(*cases):
        value = max(bound for bound, _ in chosen)
        label: Guard = frozenset().union(*(part for _, part in chosen))
        if len(dict(label)) == len(label):
            assert any(bound <= value and weaker <= label for bound, weaker in [*found, *kept])
            seen["cases"] += 1
    known.close()
    environment = random_environment(random, domains, 0.4)
    tightest = known.query(vocabulary.encode(environment))
    assert tightest == _worst(domains, pairs, environment, None)
    assert _reaches(oracle, environment, 99 if tightest is None else tightest)
    assert tightest is None or not _reaches(oracle, environment, tightest + 1)
    seen["premise"] = int(seen["cases"] > 0)
    return seen


def _case(random: Random, name: str, domains: Domains) -> Guard:
    return frozenset({Assignment(name, random.choice(domains[name]))}) if random.random() < 0.8 else frozenset()


def _worst(domains: Domains, pairs: list[tuple[int, Guard]], environment: Guard, most: int | None) -> int | None:
    """The greatest, over an environment's scenarios, of the least value that holds; None if some has none, or more."""
    worst: int | None = None
    for scenario in scenarios(domains):
        if environment <= frozenset(scenario.items()):
            least = min((value for value, label in pairs if label <= frozenset(scenario.items())), default=None)
            if least is None or (most is not None and least > most):
                return None
            worst = least if worst is None else max(worst, least)
    return worst


def _bounded(domains: Domains, pairs: list[tuple[int, Guard]]) -> TeamPlan:
    """Two events, the second of them at most so much after the first as the labeled values say."""
    choices = tuple(Choice(name, values, True, None) for name, values in domains.items())
    bounds = tuple(Constraint("a", "b", None, Fraction(value), label) for value, label in pairs)
    return TeamPlan(Tpnu("bounds", choices, (Event("a"), Event("b")), bounds, ()), (), ())


def _reaches(oracle: Oracle, environment: Guard, value: int) -> bool:
    times = {"a": Fraction(0), "b": Fraction(value)}
    return oracle.decide(environment, times).verdict is Existence.EXISTS


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
    "theorem 4.3": Sweep(lambda random: executions_correspond(random_plan(random), random), 60, 2000, 0.3),
    "theorem 4.4": Sweep(lambda random: partial_executions_correspond(random_plan(random), random), 50, 2000, 0.6),
    "theorem 4.5": Sweep(
        lambda random: consistent_executions_are_correct(random_plan(random), random), 200, 10000, 0.06
    ),
    "theorem 4.6": Sweep(lambda random: models_are_correct_scenarios(random_plan(random), random), 80, 2500, 0.3),
    "lemma 5.1": Sweep(consensus_gives_implicants, 500, 20000, 0.5),
    "invariant 5.2": Sweep(labels_are_prime_implicants, 200, 5000, 0.3),
    "invariant 5.2 of plans": Sweep(
        lambda random: implicants_of_plans(random_plan(random, events=4), random), 40, 2000, 0.15
    ),
    "theorem C.1": Sweep(completions_follow, 80, 4000, 0.3),
}


def run(name: str, seed: str, count: int, record: Callable[[str, object], None]) -> None:
    sweep, seen = SWEEPS[name], Counter[str]()
    for index in range(count):
        try:
            seen += sweep.check(Random(f"{name} {seed} {index}"))  # noqa: S311 - no secrets
        except AssertionError as error:
            error.add_note(f"{name}, seed {seed!r}, instance {index}")
            raise
    for what, number in {"instances": count, **seen}.items():
        record(what, number)
    print(f"\n{name}: {count} instances, {dict(seen)}")  # noqa: T201 - for `pytest -s`
    assert seen["premise"] >= sweep.share * count


@pytest.mark.parametrize("name", SWEEPS)
def test_sweep(name, record_property):
    run(name, "quick", SWEEPS[name].quick, record_property)


@pytest.mark.slow
@pytest.mark.parametrize("name", SWEEPS)
def test_long_sweep(name, record_property):
    run(name, "slow", SWEEPS[name].slow, record_property)


@settings(max_examples=40)
@given(networks(events=4))
def test_theorem_4_1(network):
    temporal_conflicts_are_inconsistency(network)


@settings(max_examples=40)
@given(st.one_of(tiny_plans(), contested_plans()))
def test_theorem_4_2(plan):
    seen = dominated_links_are_irrelevant(plan)
    event("something is dominated" if seen["premise"] else "nothing is")


@settings(max_examples=20)
@given(st.one_of(tiny_plans(), contested_plans()).filter(lambda plan: plan.network.choices), st.randoms())
def test_theorems_4_3_to_4_6(plan: TeamPlan, random: Random):
    for check in (executions_correspond, partial_executions_correspond):
        check(plan, random, most=3)
    consistent_executions_are_correct(plan, random)
    models_are_correct_scenarios(plan, random)


@settings(max_examples=20)
@given(team_plans(), st.randoms())
def test_invariant_5_2_of_plans(plan: TeamPlan, random: Random):
    implicants_of_plans(plan, random)
