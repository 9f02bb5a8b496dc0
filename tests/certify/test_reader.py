"""The checker's reader and semantics against those of this package, which share no code."""

from __future__ import annotations

import json
import tomllib
import warnings
from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from random import Random

import pytest

from benchmarks.suite import read_deliveries, read_suite
from robust.certify.checker import reader
from robust.certify.checker.formulas import mutex
from robust.errors import InputError, RobustError
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan
from robust.plan.pddl.reader import read_domain, read_problem
from tests.certify import meaning, tools
from tests.certify.meaning import compare, meaningless, reading
from tests.certify.texts import Texts, changed, random_texts, tangled_texts

PLANNERS = Path(__file__).resolve().parents[3] / "shared" / "planner-logs"
pytestmark = pytest.mark.filterwarnings("ignore::robust.errors.InputWarning")


def judged_texts(texts: Texts, seed: int) -> Counter[str]:
    try:
        plan = tools.assembled(texts)
    except InputError:
        return Counter(["wrong"])
    return judged(plan, reader.ground(*texts), Random(seed))


def judged(plan: ParametrizedPlan, ground: reader.Ground, random: Random, schedules: int = 4) -> Counter[str]:
    """How many schedules are valid, and how many break something, according to the simulator and the checker."""
    compare(plan, ground)
    return reading(plan, ground, random, schedules).counts


@pytest.mark.parametrize(
    ("seeds", "broken", "valid"),
    [(range(150), 100, 20), pytest.param(range(1000, 4000), 2500, 800, marks=pytest.mark.slow)],
)
def test_random_texts(seeds: range, broken: int, valid: int) -> None:
    total = sum((judged_texts(random_texts(seed), seed) for seed in seeds), Counter[str]())
    assert total["broken"] > broken
    assert total["valid"] > valid
    assert total["wrong"] < len(seeds) / 7


def test_examples() -> None:
    for path in sorted(tools.EXAMPLES.rglob("*.stn")):
        files = (path.parent / "domain.pddl", path.parent / "problem.pddl", path)
        judged(load_plan(*files), tools.grounded(files), Random(1), 2)


def test_recorded_plans(dataset: Path) -> None:
    """All are read alike; schedules of the small ones break the same."""
    plans = [one.files for one in read_suite(dataset)] + [files for _, files in read_deliveries(dataset)]
    total = sum((judged(load_plan(*files), tools.grounded(files), Random(2), 1) for files in plans), Counter[str]())
    assert len(plans) == 61
    assert sum(total.values()) > 50


@pytest.fixture(scope="module")
def logs() -> Path:
    if not PLANNERS.is_dir():
        pytest.skip(f"no logs of planners at {PLANNERS}")
    return PLANNERS


def test_domains_of_planner_logs(logs: Path) -> None:
    """Every domain and problem is read; plans of logs become networks first."""
    pairs = {(logs / one["domain"], logs / one["problem"]) for one in json.loads((logs / "plans.json").read_text())}
    for domain, problem in sorted(pairs):
        texts = [path.read_text(encoding="utf-8") for path in (domain, problem)]
        model_of = reader.Model(*texts)
        guessed = {"in_crate as in", "in_storearea as in", "type area as below object and surface"}
        assert model_of.guessed == (guessed if "in_storearea" in texts[1] else set())
        ours = read_problem(problem, read_domain(domain))
        assert {str(atom) for atom in ours.atoms} == {name for name, v in model_of.initial.items() if v is True}
        assert set(map(str, ours.fluents)) == {name for name, v in model_of.initial.items() if type(v) is not bool}
        assert ours.objects.keys() == model_of.objects.keys()


def test_what_a_text_mentions_is_read() -> None:
    """Also where the polynomial cancels, and where objects decide the condition."""
    domain = """(define (domain d) (:predicates (p) (q)) (:functions (f) (g))
     (:action a :parameters () :precondition (and (>= (- (f) (f)) 0) (or (q) (>= 1 0))) :effect (p))
     (:action b :parameters () :precondition () :effect (and (increase (f) 1) (not (q)))))"""
    problem = "(define (problem x) (:domain d) (:init (= (f) 1)) (:goal (p)))"
    ground = reader.ground(domain, problem, "action instance i : (a); action instance j : (b);")
    assert mutex(ground) == [(1, 2)]


# -- a text that has everything ----------------------------------------------------------------------------------------

ONLY_HERE = {
    "(:objects t1 -truck", "(:objects t1 - ship t1 - truck",
    "(at start (exists (?slack) (busy)))", "(at start (exists (?limit) (busy)))",
    "(when (at start (busy)) (and (at start (busy))))", "(decrease (fuel ?v) (* #t))", "(decrease (fuel ?v) #t)",
    "(decrease (fuel ?v) (* #t (rate) (rate)))", "(?limit ?y)",
    "  :synth-parameters ?much ?limit",
}  # fmt: skip
"""What this package understands, and the checker need not."""


def test_both_readers_read_the_same() -> None:
    same = (texts for _, texts in meaning.changed_texts(meaning.SAME))
    for texts in (meaning.TEXTS, *meaning.OTHERS.values(), *same):
        compare(tools.assembled(texts), reader.ground(*texts))


def test_this_package_refuses_what_is_wrong_too() -> None:
    understood = set()
    for new, texts in meaning.changed_texts(meaning.WRONG):
        try:
            tools.assembled(texts)
        except RobustError:
            continue
        understood.add(new)
    assert understood == ONLY_HERE


# -- texts that are changed at random ----------------------------------------------------------------------------------

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
        return [[*meaning.TEXTS, ""], meaning.OTHERS["beside"]][kind - 2]
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
    return ground, not meaningless(tools.CHECKER, texts)


def judged_change(seed: int) -> tuple[str, str]:
    """The change, and what both readers make of it; AssertionError if the checker reads anything that it must not."""
    name, texts = drawn(seed)
    (plan, repairs), (ground, formulated) = read_here(texts), read_there(texts)
    if isinstance(plan, str):
        known = isinstance(ground, str) or (not formulated and any(reason in plan for reason in EVALUATED))
        assert known, (seed, name, plan)
        return name, "refused by both"
    state = "repaired, " if repairs else ""
    if isinstance(ground, str):
        return name, f"{state}refused by the checker"
    for repair in repairs:
        named = repair.split("'")[1]
        assert f"{named} as " in " ".join(ground.model.guessed), (seed, name, repair)
    compare(plan, ground)
    if formulated:
        reading(plan, ground, Random(seed), 2)
    return name, f"{state}read by both"


@pytest.mark.parametrize(
    ("first", "count"),
    [(0, 150), *(pytest.param(first, 2_500, marks=pytest.mark.slow) for first in range(10_000, 30_000, 2_500))],
)
def test_what_is_refused_or_repaired_here_proves_nothing(first: int, count: int) -> None:
    changes = [judged_change(seed) for seed in range(first, first + count)]
    states = Counter(state for _, state in changes)
    assert states["refused by both"] > 80
    assert states["read by both"] > 10
    assert states["repaired, read by both"] > 0
    assert len({name for name, state in changes if state == "refused by both"}) == 8
