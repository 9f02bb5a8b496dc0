"""The simulator: on plans whose outcome is known by hand [docs/semantics.md], against VAL, and on drawn plans."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest
from hypothesis import given

import robust
from robust.errors import InputError, UnsupportedError
from robust.plan import model
from robust.plan.model import ZERO, Holds, ParametrizedPlan
from robust.plan.simulate import Violation, simulate
from robust.plan.timeline import TimedExecution
from tests.plan import building
from tests.plan.building import END, START, F, G, P, Q, action, add, assign, at_least, flow, increase, instant, plan_of
from tests.sampling import sample_parameters, sample_schedule, sample_schedules
from tests.strategies import plans
from tests.val import judged_by_val, validate

f, g = building.value(F), building.value(G)


@pytest.mark.parametrize("example", building.EXAMPLES.values(), ids=building.EXAMPLES)
def test_examples(example):
    result = simulate(example.plan, example.parameters, building.schedule_of(example.plan, example.times))
    assert result.network_violations == ()
    assert result.valid == (not example.broken)
    assert len(result.violations) == len(example.broken)
    for violation, expected in zip(result.violations, example.broken, strict=True):
        dated = violation.since is None or violation.since <= violation.time
        known = replace(violation, since=None) if isinstance(expected, Violation) else violation.obligation
        assert (known, dated) == (expected, True)


def test_epsilon_says_how_far_apart_and_effects_come_first():
    schedule = building.schedule_of(building.CONTRADICTORY, {"a": 1, "b": 2})
    assert simulate(building.CONTRADICTORY, {}, schedule, epsilon=Fraction(1)).valid
    closer = simulate(building.CONTRADICTORY, {}, schedule, epsilon=Fraction(3, 2))
    assert building.broken(closer) == ["separation: a, b"]
    rated = plan_of(action("a", assign(G, 3), flow(F, g)), goal=at_least(f, 6))
    assert building.run(rated, {"a": (0, 2)}).valid, "a rate is read after the start effects"
    assert building.run(plan_of(instant("a", assign(F, 1)), f=None, goal=at_least(f, 1)), {"a": 1}).valid


RATE = r"a \(act\): the rate"
PRODUCT = action("a", (building.ALL, at_least(f * g, 0)), flow(F, 1), flow(G, 1))
VALUELESS = (
    instant("a", (START, model.Or((model.Truth(True), at_least(f, 0))))),
    *(instant("a", increase(F, 1)), instant("a", assign(G, f)), action("a", flow(F, 1))),
)


def test_what_cannot_be_simulated():
    for plan, error, message in (
        (plan_of(PRODUCT), UnsupportedError, "linear in time"),
        (plan_of(action("a", flow(F, g)), instant("b", increase(G, 1))), UnsupportedError, RATE),
        (plan_of(action("a", flow(F, g)), action("b", flow(G, 1))), UnsupportedError, RATE),
        *((plan_of(instance, f=None), InputError, r"numeric fluent \(f\) .* no value") for instance in VALUELESS),
        (plan_of(goal=at_least(building.DURATION, 0)), InputError, r"\?duration"),
    ):
        times = {i.identifier: ((1, 2) if i.identifier == "b" else (0, 3)) if i.durative else 1 for i in plan.instances}
        with pytest.raises(error, match=message):
            building.run(plan, times)


def test_network_violations_traces_and_missing_names():
    a, literal = instant("a"), model.TimedLiteral(Fraction(2), P, True)
    times = (building.between(ZERO, a.start, 2, building.reference("k") + 1),)
    parameters = (model.Parameter("k", Fraction(3), lower=Fraction(1), upper=Fraction(5)),)
    plan = plan_of(a, constraints=times, parameters=parameters, literals=(literal,))
    assert building.run(plan, {"a": 4}, k=3).valid
    for time, k, violations in (
        (5, 3, ("a - .zero = 5 > k + 1 = 4",)),
        (1, 3, ("a - .zero = 1 < 2",)),
        (2, 6, ("parameter k = 6 > upper bound 5",)),
        (0, 0, ("parameter k = 0 < lower bound 1", "a - .zero = 0 < 2")),
    ):
        assert building.run(plan, {"a": time}, k=k).network_violations == violations
    shifted = {a.start: Fraction(-1), literal.point: Fraction(3), ZERO: Fraction(1)}
    result = simulate(plan, {"k": Fraction(3)}, shifted)
    assert result.network_violations[:3] == (".zero = 1, expected 0", "a = -1 < 0", "@2 = 3, expected 2")
    assert result.violations == ()
    assert not result.valid
    plan = plan_of(action("a", add(P), building.delete(Q), flow(F, 2), increase(G, 1, END)), atoms=(Q,), g=5)
    start, end = plan.instances[0].time_points
    steps = building.run(plan, {"a": (1, 3)}).trace
    assert [(step.time, step.points) for step in steps] == [(0, (ZERO,)), (1, (start,)), (3, (end,))]
    assert [step.atoms_changed for step in steps] == [(), ((P, True), (Q, False)), ()]
    assert [dict(step.fluents) for step in steps] == [{F: 0, G: 5}, {}, {F: 4, G: 6}]
    deep: model.Condition = Holds(P)
    for _ in range(3000):
        deep = model.Or((model.And((deep, model.Truth(True))),))
    plan = plan_of(instant("a", (START, deep)), atoms=(P,))
    assert building.run(plan, {"a": 1}).valid
    happenings = TimedExecution(plan, {}, {ZERO: Fraction(0), plan.instances[0].start: Fraction(1)}).happenings
    assert happenings[0].time == 0
    plan = plan_of(instant("abc"), parameters=(model.Parameter("k", Fraction(1)),))
    for name, parameters, message in (
        ("", {"k": 1}, "no value for time point 'abc'"),
        ("abc", {}, "no value for parameter 'k'"),
        ("abc", {"k": 1, "kk": 1}, "unknown parameter 'kk'; did you mean 'k'"),
        ("abd", {"k": 1}, "unknown time point 'abd'; did you mean 'abc'"),
    ):
        schedule = {model.TimePoint(model.TimePointKind.INSTANT, name): Fraction(1)} if name else {}
        with pytest.raises(InputError, match=message):
            simulate(plan, parameters, schedule)


MUTEX = (building.TEXTS / "mutex.txt").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("row", MUTEX)
def test_mutex_pairs(row):
    """Found by putting everything at one time, timed literals too, which are no pairs among themselves."""
    actions, pairs, *literals = row.split(" | ")
    plan = building.read_plan(actions, f"(p) (q) {' '.join(literals)}")
    at_two = {point: Fraction(2) for instance in plan.instances for point in instance.time_points}
    labels = building.broken(simulate(plan, {}, at_two))
    separated = [label.removeprefix("separation: ") for label in labels if label.startswith("separation")]
    assert separated == (pairs.split("; ") if pairs != "none" else [])
    both = tuple(model.TimedLiteral(Fraction(2), P, truth) for truth in (False, True))
    labels = building.broken(building.run(plan_of(instant("a", (START, Holds(P))), literals=both), {"a": 2}))
    assert [label for label in labels if label.startswith("separation")] == ["separation: a, @2"]


CONTINUOUS = {"instances": 3, "atoms": 1, "fluents": 1, "durative_only": True, "conditional": False, "parameters": 0}

# VAL merges happenings that are nearer than half its tolerance and separates no others, so times are multiples of 1/8
# and mutex time points are to be 1/8 apart: separated unless simultaneous. Binary fractions keep VAL's floats exact.
EPSILON = Fraction(1, 8)


@pytest.mark.parametrize("count", [30, pytest.param(600, marks=pytest.mark.slow)])
@pytest.mark.parametrize("options", [{}, {"tame": False, "instances": 3, "atoms": 2}, CONTINUOUS])
def test_simulator_agrees_with_val(options, count):
    agreed: Counter[bool] = Counter()

    @building.drawn(count)
    @given(plans(dyadic=True, **options), building.RANDOM)
    def check(plan: ParametrizedPlan, random: Random) -> None:
        for parameters in (plan.nominal, sample_parameters(plan, random)):
            for schedule in sample_schedules(plan, parameters, random, 2, epsilon=EPSILON):
                if any(schedule[i.end] < schedule[i.start] for i in plan.instances):
                    continue  # a plan file cannot say a negative duration
                simulation = simulate(plan, parameters, schedule, epsilon=EPSILON)
                assert simulation.network_violations == ()
                if judged_by_val(plan, simulation.violations):
                    verdict = validate(plan, parameters, schedule)
                    assert verdict.valid == simulation.valid, f"{simulation.violations}\n{verdict.report}"
                    agreed[verdict.valid] += 1

    check()
    assert agreed[True] > count / 8
    assert agreed[False] > count / 20


@pytest.mark.parametrize("case", building.OVER_ALL)
def test_delicate_over_all_conditions(case):
    """Known by hand, and by VAL, which does not look at the one instant to which something jumps."""
    plan, times, holds = building.delicate(case)
    assert ("i act: over all c0" not in building.broken(building.run(plan, times))) is holds
    schedule = {ZERO: Fraction(0), **building.schedule_of(plan, times)}
    simulation = simulate(plan, {}, schedule, epsilon=EPSILON)
    if building.RESET not in plan.instances and judged_by_val(plan, simulation.violations):
        assert validate(plan, {}, schedule).valid == simulation.valid


@pytest.mark.parametrize("count", [50, pytest.param(1000, marks=pytest.mark.slow)])
def test_drawn_plans_and_schedules(count):
    """Schedules satisfy the network and repeat; many plans are valid at nominal values, some have no schedule."""
    kinds: Counter[str] = Counter()

    @building.drawn(count)
    @given(plans(), building.RANDOM)
    def check(plan: ParametrizedPlan, random: Random) -> None:
        parameters = sample_parameters(plan, random)
        sampled = sample_schedules(plan, parameters, random, 5)
        for schedule in sampled:
            assert set(schedule) == set(plan.time_points)
            assert simulate(plan, parameters, schedule).network_violations == ()
        seed = random.randint(0, 1000)
        first, second = (sample_schedule(plan, plan.nominal, Random(seed)) for _ in range(2))  # noqa: S311
        assert first == second
        schedules = sample_schedules(plan, plan.nominal, random, 8)
        valid = all(simulate(plan, plan.nominal, schedule).valid for schedule in schedules)
        kinds["valid" if valid and schedules else "invalid" if schedules else "infeasible"] += 1
        kinds["infeasible elsewhere"] += not sampled

    check()
    assert kinds["valid"] >= 0.4 * count
    assert kinds["invalid"] >= 0.1 * count
    assert kinds["infeasible"] + kinds["infeasible elsewhere"] >= 1


REMEMBERING = """(define (domain d) (:requirements :durative-actions :conditional-effects)
  (:predicates (ready) (calm) (done) (was) (done))
  (:durative-action go :duration (= ?duration 5) :effect (and {effects}))
  (:durative-action drop :duration (= ?duration 2) :effect (at end (not (ready))))
  (:action stir :effect (not (calm))))"""
MIXED = "(when (and (at start (ready)) (at end (calm))) (at end (done)))"
BY_HAND = "(when (at start (ready)) (at start (was))) (when (at end (and (was) (calm))) (at end (done)))"


@pytest.mark.parametrize("drop", range(-3, 5))
def test_conditional_effects_remember_what_held_at_the_start(drop):
    """As with a predicate that remembers it, executed, and proved in both encodings."""
    problem = "(define (problem p) (:domain d) (:init (ready) (calm)) (:goal (done)))"
    for stir in (Fraction(5), Fraction(11)):
        steps = sorted(
            [(Fraction(4), "(go) [5]"), (4 + Fraction(drop) + Fraction(1, 3), "(drop) [2]"), (stir, "(stir)")]
        )
        plan = "\n".join(f"{float(time):.4f}: {step}" for time, step in steps)
        verdicts = [robust.validate(REMEMBERING.format(effects=each), problem, plan).valid for each in (MIXED, BY_HAND)]
        # `ready` is lost two units after the drop has begun, and `calm` when the pot is stirred.
        assert verdicts == [drop + 2 >= 0 and stir > 9] * 2
        if verdicts[0]:
            network = robust.convert(REMEMBERING.format(effects=MIXED), problem, plan).plan
            assert {robust.check(network, encoding=name).answer.value for name in ("relational", "positions")} == {
                "proved"
            }
