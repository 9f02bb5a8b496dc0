"""The statements of [PIKE §5, Appendix C] about labels and labeled values, on random instances; for tests only.

Every function checks a statement on what its seed gives, and says how often its premise held there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from fractions import Fraction
from itertools import product
from math import prod
from random import Random

from robust.pike_bridge.compile import Compiling, Temporal
from robust.pike_bridge.knowledge.interface import Effort, KnowledgeStatistics
from robust.pike_bridge.knowledge.labels import Label, consensus, environments, insert
from robust.pike_bridge.knowledge.network import Kind
from robust.pike_bridge.knowledge.tms import PiTms
from robust.pike_bridge.model import Assignment, Choice, Constraint, Event, Guard, TeamPlan, Tpnu, Vocabulary
from robust.pike_bridge.semantics import Existence, Oracle
from robust.pike_bridge.temporal.distance_graph import LabeledNumbers
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory, is_model, satisfies
from tests.pike_bridge.knowledge.theories import models, prime_implicants, scenarios
from tests.pike_bridge.networks import candidate_subplan

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
        if label.node.kind is not Kind.CONTRADICTION:
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
