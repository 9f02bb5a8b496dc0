"""The specification of the verified checker, by its executable reading, against the simulator: the same verdicts.

`proofs/kernel/coq/Evaluate.v` decides what `Spec.v` says of a schedule, and is proved to; the simulator shares nothing
with it but the texts of plans. Both say of each schedule whether the network allows it, and what it breaks.
"""

import re
import shutil
import subprocess
from collections import Counter
from fractions import Fraction
from itertools import combinations
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.suite import read_deliveries, read_suite
from robust.certify.checker import reader
from robust.certify.kernel.terms import PlanTerms, listed
from robust.errors import RobustError
from robust.plan.model import ZERO
from robust.plan.simulate import simulate
from robust.reading import load_plan
from tests.certify import tools
from tests.certify.test_reader import key, separations
from tests.certify.texts import random_texts, tangled_texts
from tests.pddl_text import pddl_text
from tests.plan.building import drawn
from tests.sampling import QUANTUM, sample_parameters, sample_schedule, sample_schedules
from tests.strategies import plans

BUILT = Path(__file__).parents[2] / "proofs" / "kernel" / "robust-kernel"
KERNEL = str(BUILT) if BUILT.is_file() else shutil.which("robust-kernel")
pytestmark = pytest.mark.skipif(KERNEL is None, reason="the kernel is not built (make -C proofs/kernel)")

EPSILONS = (Fraction(1, 1000), Fraction(1, 1000), Fraction(1, 2), Fraction(0))
SHAKEN = 0.2
NUMERIC = {"assign", "increase"}
KIND = re.compile(r"separation|effects|goal|[a-z -]+$")


def specified(ground, parameters, schedules, epsilon, folder):
    """Of each schedule whether the network allows it, and what it breaks: how often each obligation's `key`."""
    values = listed(parameters[name] for name in ground.parameters)
    lines = [listed((values, listed(schedule))) for schedule in schedules]
    path = folder / "plan.kernel"
    sections = ["(texts)", *PlanTerms(ground).sections(), f"(epsilon {epsilon})", *lines]
    path.write_text("\n".join(sections), encoding="utf-8")
    said = subprocess.run([KERNEL, "--evaluate", path], capture_output=True, text=True, timeout=60, check=True).stdout
    return [_read(ground, line) for line in said.splitlines()]


def _read(ground, line):
    allowed, valid, _, near, duties, agreements = re.findall(r"\((?:[^()]|\([^()]*\))*\)|\w+", line[1:-1])
    broken = Counter(
        key(duty.label) for duty, met in zip(ground.duties, re.findall("[tf]", duties), strict=True) if met == "f"
    )
    pairs = re.findall(r"(\d+) (\d+) ([tf])", near)
    broken.update(f"separation: {ground.points[int(a)]}, {ground.points[int(b)]}" for a, b, met in pairs if met == "f")
    agree = zip(_agreements(ground), re.findall("[tf]", agreements), strict=True)
    broken.update({f"effects of {ground.points[point]} agree" for point, met in agree if met == "f"})
    assert (valid == "t") is (not broken)
    return allowed == "t", broken


def _agreements(ground):
    """The time points of pairs of effects that are a conflict if both happen."""
    for point, effects in enumerate(ground.effects):
        for one, other in combinations([each for each in effects if each.kind in NUMERIC], 2):
            if one.target == other.target and "assign" in (one.kind, other.kind):
                yield point


def simulated(plan, parameters, schedule, epsilon):
    result = simulate(plan, parameters, schedule, epsilon=epsilon)
    broken = Counter(key(violation.obligation) for violation in result.violations)
    return not [why for why in result.network_violations if not why.startswith("parameter ")], broken


def shaken(plan, schedule, random):
    """A schedule with some time points moved, perhaps to others, so that the network need not allow it."""
    moved = dict(schedule)
    free = [point for point in plan.time_points if point != ZERO and point.time is None]
    for point in random.sample(free, min(len(free), random.randint(1, 2))):
        near = random.choice([*schedule.values()])
        moved[point] = random.choice([near, near, moved[point] + QUANTUM * random.randint(-9, 9)])
    return moved


def compare(texts, plan, random, folder, parameters, schedules, epsilon):
    """How many schedules are valid, broken, and not allowed; AssertionError where the two differ."""
    try:
        wanted = [simulated(plan, parameters, schedule, epsilon) for schedule in schedules]
        ground = reader.ground(*texts)
        times = [[schedule[point] for point in plan.time_points] for schedule in schedules]
        found = specified(ground, parameters, times, epsilon, folder)
    except (RobustError, reader.Unsupported):
        return Counter(unsupported=len(schedules))
    counts = Counter()
    for (allowed, want), (keeps, got) in zip(wanted, found, strict=True):
        assert keeps is allowed
        # A text mentions what its polynomial cancels, which makes more time points mutex; and it may say things twice.
        assert want - got == Counter()
        assert set(want) - separations(want) == set(got) - separations(got)
        counts.update(["broken" if got else "valid", *(["not allowed"] if not allowed else [])])
        counts.update({KIND.match(str(label[1] if isinstance(label, tuple) else label))[0] for label in got})
    return counts


def compared(texts, plan, random, folder, count=3):
    """What comes of some schedules, with parameters and a separation that are drawn."""
    parameters, epsilon = sample_parameters(plan, random), random.choice(EPSILONS)
    schedules = sample_schedules(plan, parameters, random, count, epsilon=epsilon or QUANTUM)
    schedules = [shaken(plan, each, random) if random.random() < SHAKEN else each for each in schedules]
    return compare(texts, plan, random, folder, parameters, schedules, epsilon)


@pytest.mark.parametrize(
    ("make", "seeds", "least"),
    [
        (random_texts, range(20), 12),
        (tangled_texts, range(8), 12),
        pytest.param(random_texts, range(1000, 1800), 700, marks=pytest.mark.slow),
        pytest.param(tangled_texts, range(1000, 1700), 1300, marks=pytest.mark.slow),
    ],
)
def test_it_means_what_the_simulator_does(make, seeds, least, tmp_path):
    total = Counter()
    for seed in seeds:
        try:
            plan = tools.assembled(texts := make(seed))
        except RobustError:
            continue
        total += compared(texts, plan, Random(seed), tmp_path)
    assert total["valid"] + total["broken"] > least
    assert total["unsupported"] < least / 10
    if least > 100:
        kinds = {"goal", "duration", "non-negative duration", "over all", "at start", "at end", "separation", "effects"}
        assert all(total[kind] > 1 for kind in {*kinds, "valid", "not allowed"}), total


RISING = """(define (domain d) (:predicates (p)) (:functions (f))
 (:durative-action a :parameters () :duration (= ?duration 4) :condition (over all CONDITION)
  :effect (increase (f) (* #t 1))))"""
FROM_0 = "(define (problem x) (:domain d) (:init (= (f) 0)) (:goal (and)))"
STEP = "durative-action instance i : (a); c: i.start - .zero in [0, 0]; c: i.end - i.start in [4, 4];"


@pytest.mark.parametrize(
    ("condition", "verdict"),
    [
        ("(or (< (f) 3) (> (f) 3))", "broken"),
        ("(or (< (f) 1) (> (f) 1.5))", "broken"),
        ("(or (<= (f) 3) (>= (f) 3))", "valid"),
        ("(and (> (f) 0) (< (f) 4))", "valid"),
        ("(<= (f) 3.9)", "broken"),
    ],
)
def test_every_instant_inside_counts(condition, verdict, tmp_path):
    """The fluent rises from 0 to 4: what is false at one instant, or between two zeros of comparisons, is broken."""
    texts = (RISING.replace("CONDITION", condition), FROM_0, STEP)
    plan = tools.assembled(texts)
    schedule = sample_schedule(plan, {}, Random(0))
    assert compare(texts, plan, Random(0), tmp_path, {}, [schedule], tools.EPSILON)[verdict] == 1


@drawn(5, 200)
@given(plans(linear=True, dyadic=True), st.randoms(use_true_random=False))
def test_plans_without_texts(tmp_path_factory, plan, random):
    parameters = sample_parameters(plan, random)
    schedule = sample_schedule(plan, parameters, random)
    if schedule is None:
        return
    files = pddl_text(plan, parameters, schedule)
    kinds = {True: "durative-action", False: "action"}
    steps = [f"{kinds[i.durative]} instance {i.identifier} : ({i.identifier});" for i in plan.instances]
    texts = (files.domain, files.problem, "\n".join(steps))
    read = tools.assembled(texts)
    named = {str(point): time for point, time in schedule.items()}
    moved = {point: named[str(point)] for point in read.time_points}
    schedules = [moved, shaken(read, moved, random)]
    folder = tmp_path_factory.mktemp("plans", numbered=True)
    compare(texts, read, random, folder, {}, schedules, random.choice(EPSILONS))


@pytest.mark.parametrize("every", [15, pytest.param(1, marks=pytest.mark.slow)])
def test_recorded_plans(dataset, every, tmp_path):
    recorded = [one.files for one in read_suite(dataset)] + [files for _, files in read_deliveries(dataset)]
    total = Counter()
    for files in recorded[::every]:
        texts = [path.read_text(encoding="utf-8") for path in files]
        total += compared(texts, load_plan(*files), Random(3), tmp_path, 2)
    assert total["unsupported"] == 0
    assert total["valid"] + total["broken"] > 60 // every
