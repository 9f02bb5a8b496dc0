"""The checker's reader and semantics against those of this package, which share no code."""

from __future__ import annotations

import json
import re
import tomllib
import warnings
from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random

import pytest

from benchmarks.suite import read_deliveries, read_suite
from robust.certify.checker import reader
from robust.certify.checker.formulas import FALSE, TRUE, Formulas, mutex
from robust.certify.hints import KnownFacts, model
from robust.errors import InputError, RobustError
from robust.plan.load import load_plan
from robust.plan.model import ZERO, Atom, Bound, ParametrizedPlan
from robust.plan.pddl.reader import read_domain, read_problem
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import mutex_pairs, simulate
from robust.smt.limits import Deadline
from tests.certify import elaborate, tools
from tests.certify.texts import Texts, changed, random_texts, tangled_texts
from tests.certify.tools import CHECKER, Checker
from tests.sampling import sample_parameters, sample_schedules

PLANNERS = Path(__file__).resolve().parents[3] / "shared" / "planner-logs"
LABEL = re.compile(r"(\S+?)(?: \S+)?: (non-negative duration|duration|at start|at end|over all)?")


def compare(plan: ParametrizedPlan, ground: reader.Ground, by: Checker = CHECKER) -> None:
    """Time points, parameters, network, initial state, effects and mutex pairs are the same."""
    assert [str(point) for point in plan.time_points] == ground.points
    parameters = {name: (p.nominal, p.lower, p.upper) for name, p in ground.parameters.items()}
    nominal = {p.name: p.nominal if p.has_nominal else None for p in plan.parameters}
    assert parameters == {p.name: (nominal[p.name], p.lower, p.upper) for p in plan.parameters}
    assert network(plan) == {(ground.points[a], ground.points[b], frozenset(w.items())) for a, b, w in ground.edges}
    assert {str(atom) for atom in plan.initial_atoms} == {name for name, v in ground.model.initial.items() if v is True}
    values = {name: value for name, value in ground.model.initial.items() if isinstance(value, Fraction)}
    values |= {name: Fraction(0) for kind, name in ground.varied if kind == "fluent"}
    assert {str(fluent): value.constant_term for fluent, value in plan.initial_fluents.items()} == values
    effects = [(ground.points[point], effect) for point, every in enumerate(ground.effects) for effect in every]
    certain = {(point, effect.kind, effect.target) for point, effect in effects if effect.when is True}
    guarded = {(point, effect.kind, effect.target) for point, effect in effects}  # the checker knows no numbers yet
    flows = {(ground.points[start], "flow", fluent) for start, _, fluent, _ in ground.flows}
    assert certain | flows <= written(plan) <= guarded | flows
    ours = {frozenset(map(str, pair)) for pair in mutex_pairs(plan)}
    assert ours <= {frozenset((ground.points[a], ground.points[b])) for a, b in by.formulas.mutex(ground)}


def network(plan: ParametrizedPlan) -> set[tuple[str, str, frozenset[tuple[str, Fraction]]]]:
    """From where to where it takes at least how long: the coefficients of parameters, and the number by itself."""
    found = [(one.source, one.target, one.lower) for one in plan.constraints if one.lower is not None]
    found += [(one.target, one.source, -one.upper) for one in plan.constraints if one.upper is not None]
    for literal in plan.timed_literals:
        time: Bound = Polynomial.constant(literal.time)
        found += [(ZERO, literal.point, time), (literal.point, ZERO, -time)]
    found += [(ZERO, point, Polynomial.constant(Fraction(0))) for point in plan.time_points[1:]]
    return {
        (str(a), str(b), frozenset(("".join(map(str, names)), factor) for names, factor in length.terms.items()))
        for a, b, length in found
    }


def written(plan: ParametrizedPlan) -> set[tuple[str, str, str]]:
    """What happens at which time point."""
    found = set()
    for one in plan.instances:
        for effect in one.atom_effects:
            found.add((str(one.at(effect.timing)), "add" if effect.value else "delete", str(effect.atom)))
        for change in one.numeric_effects:
            found.add((str(one.at(change.timing)), change.operator.value, str(change.fluent)))
        found |= {(str(one.start), "flow", str(flow.fluent)) for flow in one.continuous_effects}
    for literal in plan.timed_literals:
        kind = "assign" if not isinstance(literal.target, Atom) else "add" if literal.value else "delete"
        found.add((str(literal.point), kind, str(literal.target)))
    return found


def key(label: str) -> object:
    """What an obligation is about, as far as both sides say it alike."""
    if label.startswith(("separation", "goal", "effects of")):
        return "goal" if label.startswith("goal") else label
    match = LABEL.match(label)
    assert match is not None
    return match[1], match[2] or "condition"


def agree(plan: ParametrizedPlan, ground: reader.Ground, random: Random, schedules: int = 4) -> Counter[str]:
    """The formulas against the simulator: which obligations some schedules break."""
    found: Counter[str] = Counter()
    parameters = sample_parameters(plan, random)
    for schedule in sample_schedules(plan, parameters, random, schedules):
        try:
            simulated = simulate(plan, parameters, schedule)
            got = broken(ground, plan, parameters, schedule)
        except (RobustError, reader.Unsupported):
            found["unsupported"] += 1
            continue
        want = {key(each.obligation) for each in simulated.violations}
        if any(isinstance(each, tuple) and each[1] == "non-negative duration" for each in want):
            found["negative duration"] += 1  # flows of negative length have no meaning
            continue
        # A text mentions what its polynomial cancels: then more time points are mutex.
        separations = {each for each in got if str(each).startswith("separation")}
        assert want - separations == got - separations
        found["broken" if want else "valid"] += 1
    return found


def broken(
    ground: reader.Ground, plan: ParametrizedPlan, parameters: dict, schedule: dict, by: Checker = CHECKER
) -> set[object]:
    """The obligations that one schedule breaks."""
    times = {f"@{number}": schedule[point] for number, point in enumerate(plan.time_points) if number}
    given = {name: {"": value} if value else {} for name, value in {**parameters, **times}.items()}
    formulas = by.formulas.Formulas(ground, tools.EPSILON, given)
    found = set()
    for label, literal in ((label, make()) for label, make in formulas.obligations()):
        if literal == TRUE or (literal != FALSE and model(formulas, KnownFacts([]), literal, Deadline.after(60))):
            found.add(key(label))
    return found


def judge_texts(texts: Texts, seed: int) -> Counter[str]:
    try:
        plan = tools.assembled(texts)
    except InputError:
        return Counter(["wrong"])
    ground = reader.ground(*texts)
    compare(plan, ground)
    return agree(plan, ground, Random(seed))


def test_random_texts() -> None:
    total = sum((judge_texts(random_texts(seed), seed) for seed in range(150)), Counter())
    assert total["broken"] > 100
    assert total["valid"] > 20
    assert total["wrong"] < 20


@pytest.mark.slow
def test_many_random_texts() -> None:
    total = sum((judge_texts(random_texts(seed), seed) for seed in range(1000, 4000)), Counter())
    assert total["broken"] > 2500
    assert total["valid"] > 800


EXAMPLES = sorted(tools.EXAMPLES.rglob("*.stn"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_examples(path) -> None:
    files = (path.parent / "domain.pddl", path.parent / "problem.pddl", path)
    plan, ground = load_plan(*files), tools.grounded(files)
    compare(plan, ground)
    agree(plan, ground, Random(1), 2)


def test_recorded_plans(dataset) -> None:
    plans = [one.files for one in read_suite(dataset)] + [files for _, files in read_deliveries(dataset)]
    total: Counter[str] = Counter()
    for files in plans:
        plan, ground = load_plan(*files), tools.grounded(files)
        compare(plan, ground)
        total += agree(plan, ground, Random(2), 1)
    assert len(plans) == 61
    assert sum(total.values()) > 50


@pytest.fixture(scope="module")
def logs() -> Path:
    if not PLANNERS.is_dir():
        pytest.skip(f"no logs of planners at {PLANNERS}")
    return PLANNERS


def test_domains_of_planner_logs(logs) -> None:
    """Every domain and problem is read; plans of logs become networks first."""
    pairs = {(logs / one["domain"], logs / one["problem"]) for one in json.loads((logs / "plans.json").read_text())}
    for domain, problem in sorted(pairs):
        texts = [path.read_text(encoding="utf-8") for path in (domain, problem)]
        model_of = reader.Model(*texts)
        guessed = {"in_crate as in", "in_storearea as in", "type area as below object and surface"}
        guessed = guessed if "in_storearea" in texts[1] else set()
        assert model_of.guessed == guessed
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ours = read_problem(problem, read_domain(domain))
        assert {str(atom) for atom in ours.atoms} == {name for name, v in model_of.initial.items() if v is True}
        assert set(map(str, ours.fluents)) == {n for n, v in model_of.initial.items() if isinstance(v, Fraction)}
        assert ours.objects.keys() == model_of.objects.keys()


DOMAIN = """(define (domain d) (:types t) (:predicates (p ?x - t) (q)) (:functions (f))
 (:durative-action a :parameters (?x - t) :duration (= ?duration 2)
  :condition (at start (q)) :effect (at end (p ?x))))"""
PROBLEM = "(define (problem x) (:domain d) (:objects o - t) (:init (q) (= (f) 1)) (:goal (p o)))"
PLAN = "durative-action instance i : (a o); c: i.end - i.start in [2, 2];"


WRONG = [
    ("(:types t)", "(:types t) (:derived (q) (p ?x))"),
    ("(:types t)", "(:types t) (:types t)"),
    ("(at start (q))", "(at start (preference x (q)))"),
    ("(at start (q))", "(at start (z))"),
    ("(at start (q))", "(at start (p ?y))"),
    ("(at start (q))", "(q)"),
    ("(= ?duration 2)", "(= 2 ?duration)"),
    ("(= ?duration 2)", "(= ?duration 1/2)"),
    ("(at end (p ?x))", "(over all (p ?x))"),
    ("(:domain d)", "(:domain e)"),
    ("(:init (q)", "(:init (q) (not (q))"),
    ("(= (f) 1)", "(= (f) nan)"),
    ("(a o)", "(a q)"),
    ("[2, 2]", "[2, k]"),
    ("[2, 2]", "[two, 2]"),
    ("i.end - i.start", "i.ende - i.start"),
    ("c: i", "c i"),
    ("[2, 2];", "[2, 2]"),
    ("durative-action instance", "action instance"),
    ("(define (problem", "(define (domain"),
]


@pytest.mark.parametrize(("old", "new"), WRONG)
def test_what_is_not_known_proves_nothing(old, new) -> None:
    texts = (DOMAIN, PROBLEM, PLAN)
    reader.ground(*texts)
    changed = [text.replace(old, new) for text in texts]
    assert changed != list(texts)
    with pytest.raises(reader.Unsupported):
        reader.ground(*changed)


EVALUATED = ("no initial value", "division by", "assignment and another change")
"""What is found out where values are computed, not by what reads a text."""


def drawn(seed: int) -> tuple[str, list[str]]:
    """The first change, and texts that both readers know before they are changed once or twice."""
    random, texts = Random(seed), None
    while texts is None:
        texts = known_texts(random.choice([0, 0, 0, 1, 1, 1, 1, 2, 2, 3]), random.randrange(500))
    name, texts = changed(texts, random)
    return name, changed(texts, random)[1] if random.random() < 0.2 else texts


@cache
def known_texts(kind: int, number: int) -> list[str] | None:
    """Texts of a kind, if both readers know them."""
    if kind > 1:
        return [[*elaborate.TEXTS, ""], [*elaborate.VARIED, elaborate.BESIDE]][kind - 2]
    texts = [*[random_texts, tangled_texts][kind](number), ""]
    return None if isinstance(read_here(texts)[0], str) or isinstance(read_there(texts)[0], str) else texts


def read_here(texts: Sequence[str]) -> tuple[ParametrizedPlan | str, list[str]]:
    """The plan, or why this package refuses the texts; and what it says of repairs."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            return tools.assembled(texts), [str(one.message) for one in said]
        except RobustError as error:
            return str(error), []


def read_there(texts: Sequence[str]) -> tuple[reader.Ground | str, bool]:
    """What the checker reads, or why it does not; and whether all obligations and effects have a meaning."""
    try:
        ground = reader.ground(*texts)
    except (reader.Unsupported, tomllib.TOMLDecodeError) as error:
        return str(error), False
    try:
        formulas = Formulas(ground, tools.EPSILON)
        for _, make in formulas.obligations():
            make()
        formulas.evaluate()
    except reader.Unsupported:
        return ground, False
    return ground, True


def judge_changed(seed: int) -> Counter[tuple[str, str]]:
    """What both readers make of changed texts; AssertionError if the checker reads anything that it must not."""
    name, texts = drawn(seed)
    (plan, repairs), (ground, formulated) = read_here(texts), read_there(texts)
    if isinstance(plan, str):
        known = isinstance(ground, str) or (not formulated and any(each in plan for each in EVALUATED))
        assert known, (seed, name, plan)
        return Counter([(name, "refused by both")])
    state = "repaired, " if repairs else ""
    if isinstance(ground, str):
        return Counter([(name, f"{state}refused by the checker")])
    for repair in repairs:
        named = repair.split("'")[1]
        assert f"{named} as " in " ".join(ground.model.guessed), (seed, name, repair)
    compare(plan, ground)
    found = agree(plan, ground, Random(seed), 2) if formulated else Counter(unsupported=1)
    return Counter([(name, f"{state}read by both")]) + Counter({("schedules", each): found[each] for each in found})


def test_what_is_refused_or_repaired_here_proves_nothing() -> None:
    total = sum(map(judge_changed, range(150)), Counter[tuple[str, str]]())
    states = Counter(state for _, state in total.elements())
    assert states["refused by both"] > 80
    assert states["read by both"] > 10
    assert states["repaired, read by both"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("first", range(10_000, 30_000, 2_500))
def test_what_is_refused_or_repaired_here_proves_nothing_20_000_times(first) -> None:
    total = sum(map(judge_changed, range(first, first + 2_500)), Counter[tuple[str, str]]())
    assert len({name for name, state in total if state == "refused by both"}) == 8


def test_what_a_text_mentions_is_read() -> None:
    """Also where the polynomial cancels, and where objects decide the condition."""
    domain = """(define (domain d) (:predicates (p) (q)) (:functions (f) (g))
     (:action a :parameters () :precondition (and (>= (- (f) (f)) 0) (or (q) (>= 1 0))) :effect (p))
     (:action b :parameters () :precondition () :effect (and (increase (f) 1) (not (q)))))"""
    problem = "(define (problem x) (:domain d) (:init (= (f) 1)) (:goal (p)))"
    ground = reader.ground(domain, problem, "action instance i : (a); action instance j : (b);")
    assert mutex(ground) == [(1, 2)]
