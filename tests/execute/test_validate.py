"""Verdicts about single schedules: in words, against VAL on drawn plans and on logs of planners; what would help."""

import json
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest
from hypothesis import Phase, given, settings

import robust
from robust.errors import InputError, InputWarning, UnsupportedError
from robust.execute.validate import Breach, Verdict
from robust.numbers import Number
from robust.plan import model
from robust.plan.simulate import Violation, simulate
from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan
from tests.execute.plans import ERRAND, ERRANDS, ROOT, errand, errands
from tests.pddl_text import PddlText, pddl_text
from tests.plan.building import RANDOM, drawn
from tests.sampling import sample_schedules
from tests.strategies import plans
from tests.val import judged_by_val, run_val

LOGS = ROOT.parent / "shared" / "planner-logs"

# -- in words ----------------------------------------------------------------------------------------------------------


def lines(steps: str, **options: Number | None) -> list[str]:
    """What is said of a plan for the errand."""
    return str(robust.validate(errands, errand, parse_timed_plan(steps), **options)).splitlines()


GOING = "0: (go home market) [7.5]\n"
LONG = "  at 0: (go home market) demands (= ?duration (distance home market)), but ?duration = 7.75 != "
TIED = "the end of (go home market) and the start of (go market home) have to be 0.001 apart, but are at the same time"
VERDICTS = {
    "valid": (GOING + "7.5: (shop market) [2]", {}, ["valid: 2 steps, ends at 9.5"]),
    "too long": (
        "0: (go home market) [7.75]\n7.75: (shop market) [2]", {},
        [
            "invalid: 2 steps, ends at 9.75; 1 violation",
            LONG + "(distance home market) = 7.5, by 0.25 (line 1)",
            "  tolerance=0.25 would make it valid",
        ],
    ),
    "too short": (
        GOING + "7.5: (shop market) [1.2]", {},
        [
            "invalid: 2 steps, ends at 8.7; 1 violation",
            "  at 7.5: (shop market) demands (>= ?duration 2), but ?duration = 1.2 < 2, by 0.8 (line 2)",
            "  tolerance=0.8 would make it valid",
        ],
    ),
    "nowhere to shop": (
        "0: (shop market) [2]", {},
        [
            "invalid: 1 step, ends at 2; 1 violation",
            "  at 1: (shop market) demands (at market) throughout, but (at market) is false (line 1)",
        ],
    ),
    "too late": (
        GOING + "18.5: (shop market) [2]", {},
        [
            "invalid: 2 steps, ends at 20.5; 1 violation",
            "  at 20: (shop market) demands (open) throughout, but (open) is false since 20 (line 2)",
        ],
    ),
    "nothing bought": (
        GOING, {},
        [
            "invalid: 1 step, ends at 7.5; 1 violation",
            "  at 20: the goal demands (done market), but (done market) is false",
        ],
    ),
    "at the same time": (
        GOING + "7.5: (shop market) [2]\n7.500: (go market home) [7.5]", {"tolerance": 0},
        [
            "invalid: 3 steps, ends at 15; 2 violations",
            f"  at 7.5: {TIED} (lines 1, 3)",
            "  at 7.5: (go market home) demands (at market) at its start, but (at market) is false until 7.5 (line 3)",
        ],
    ),
    "too near": (
        GOING + "7.5: (shop market) [2]\n9.5: (go market home) [7.5]\n17.0005: (go home market) [7.5]", {},
        [
            "invalid: 4 steps, ends at 24.5005; 1 violation",
            "  at 17.0005: the end of (go market home) and the start of (go home market) have to be 0.001 apart, "
            "but are 0.0005 apart (lines 3, 4)",
            "  tolerance=0.0005 would make it valid",
            "  epsilon=0.0006 would make it valid",
        ],
    ),
    "rounded": (
        "0.000: (go home market) [7.4999]\n7.500: (shop market) [2.000]", {},
        ["valid: 2 steps, ends at 9.5; 1 duration moved, by at most 0.0001"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", VERDICTS)
def test_verdicts_in_words(name):
    steps, options, expected = VERDICTS[name]
    assert lines(steps, **options) == expected


def test_what_is_taken_for_a_text_a_path_or_what_reading_gives(tmp_path):
    files = [tmp_path / name for name in ("domain.pddl", "problem.pddl", "plan (1).txt")]
    for file, text in zip(files, (ERRANDS, ERRAND, GOING + "8: (shop market) [2]"), strict=True):
        file.write_text(text, encoding="utf-8")
    given = ((ERRANDS, ERRAND, "8: (shop market) [2]"), (errands, errand, parse_timed_plan("8: (shop market) [2]")))
    for found in (robust.validate(*each) for each in given):
        assert (found.valid, found.plan, found.steps) == (False, "<plan>", 1)
    for found in (robust.validate(*files), robust.validate(*map(str, files))):
        assert (found.valid, found.plan, found.steps, found.end) == (True, str(files[2]), 2, 10)
    with pytest.raises(InputError, match="no such file"):
        robust.validate(*files[:2], "plan.txt")


def test_a_plan_of_a_log():
    log = f"{GOING}8: (shop market) [2]\n; Plan found:\n8: (shop market) [2]\nDone.\n"
    verdicts = [robust.validate(errands, errand, log, plan_number=number) for number in (1, 2, None)]
    assert [one.valid for one in verdicts] == [True, False, False]
    assert verdicts[0].note == "picked plan 1 of 2 (lines 1 to 2); skipped 1 line that is no step"
    assert verdicts[2].violations[0].lines == (4,)


@pytest.mark.parametrize(
    ("plan", "options", "says"),
    [
        ("action instance a : (go home market);\n", {}, "robust check DOMAIN PROBLEM <plan> judges all schedules"),
        ("nothing\n", {}, "empty plan: found no step"),
        (GOING, {"plan_number": 2}, "found 1 plan, expected one with number 2"),
        (GOING, {"plan_number": 0}, "plan_number: found '0', expected a whole number from 1"),
        (GOING, {"tolerance": -1}, "tolerance: found '-1', expected a number of at least 0"),
        (GOING, {"epsilon": "x"}, "epsilon: found 'x', expected a number"),
        ("0: (go home) [7.5]\n", {}, "found 'go' with 1 argument"),
        ("0: (fly home market) [7.5]\n", {}, "fly"),
    ],
)
def test_what_cannot_be_judged_is_an_error(plan, options, says):
    with pytest.raises(InputError) as error:
        robust.validate(ERRANDS, ERRAND, plan, **options)
    assert says in str(error.value)


def test_a_plan_that_a_program_made_begins_at_zero():
    steps = (TimedStep(Fraction(-1), "go", ("home", "market"), Fraction(15, 2)),)
    with pytest.raises(InputError, match="expected a time and a duration of at least 0"):
        robust.validate(errands, errand, TimedPlan(steps))


def test_since_when_and_until_when_a_condition_is_false():
    domain = """(define (domain d) (:predicates (p) (q)) (:action on :parameters () :precondition () :effect (p))
    (:action off :parameters () :precondition () :effect (not (p)))
    (:action use :parameters () :precondition (p) :effect (q)))"""
    problem = "(define (problem x) (:domain d) (:init) (:goal (and (q) (not (p)))))"
    off, on = "(p) is false since 2 until 5 (line 3)", "(p) is true since 5"
    found = robust.validate(domain, problem, "1: (on)\n2: (off)\n4: (use)\n5: (on)\n")
    assert [one.words.partition("but ")[2] for one in found.violations] == [off, on]
    found = robust.validate(domain, problem, "1: (use)\n", tolerance=0)
    assert [one.detail for one in found.violations] == ["(p) is false"]


def test_what_cannot_be_decided_is_unsupported():
    domain = """(define (domain d) (:predicates (p)) (:functions (f) (g))
    (:durative-action a :parameters () :duration (= ?duration 2) :condition (over all (>= (* (f) (g)) 0))
     :effect (and (increase (f) (* #t 1)) (increase (g) (* #t 1)) (at end (p)))))"""
    problem = "(define (problem x) (:domain d) (:init (= (f) 1) (= (g) 1)) (:goal (p)))"
    with pytest.raises(UnsupportedError, match="multiplies fluents"):
        robust.validate(domain, problem, "0: (a) [2]\n")


def test_names_of_instances_say_nothing_and_timed_literals_have_words():
    (found,) = robust.validate(ERRANDS.replace("(over all (open))", "(at start (open))"), ERRAND,
        GOING + "19.9995: (shop market) [2]", tolerance=0).violations  # fmt: skip
    assert found.obligation == "separation: n1.start, @20"
    assert str(found) == (
        "at 20: the start of (shop market) and what :init says of time 20 have to be 0.001 apart, but are 0.0005 apart "
        "(line 2)"
    )
    assert found.amount == Fraction(1, 2000)


def test_times_that_may_not_move_need_not_where_nothing_breaks():
    """The first action ends a little after the second starts, whose condition it makes true once more."""
    domain = """(define (domain d) (:predicates (p) (q))
    (:durative-action a :parameters () :duration (= ?duration (/ 16 3)) :condition () :effect (at end (p)))
    (:durative-action b :parameters () :duration (= ?duration 1) :condition (over all (p)) :effect (at end (q))))"""
    problem = "(define (problem x) (:domain d) (:init (p)) (:goal (q)))"
    found = robust.validate(domain, problem, "0/1: (a) [5.333]\n5333/1000: (b) [1.0]\n")
    assert str(found) == "valid: 2 steps, ends at 6.333; 1 duration moved, by at most 0.000334"
    assert found.shift == Fraction(1, 3000)


def test_durations_of_instantaneous_actions_bound_the_separation_that_helps():
    domain = """(define (domain d) (:predicates (p) (q)) (:action a :parameters () :precondition () :effect (p))
    (:action b :parameters () :precondition (p) :effect (q)))"""
    problem = "(define (problem x) (:domain d) (:init) (:goal (q)))"
    for printed, helps in (("0.0001", Fraction(1, 2000)), ("0.0009", None)):
        plan = f"0: (a) [{printed}]\n0.0005: (b) [{printed}]\n"
        found = robust.validate(domain, problem, plan, tolerance=0)
        assert (found.valid, found.remedies.epsilon) == (False, helps)


# -- against VAL -------------------------------------------------------------------------------------------------------

EPSILON = Fraction(1, 16)
"""Schedules are multiples of half of it: binary fractions keep VAL's floats exact."""
CHANGES = ("none", "moved", "beside another", "beside another", "swapped", "dropped", "duration", "duration")


def changed(
    plan: model.ParametrizedPlan, schedule: dict[model.TimePoint, Fraction], random: Random
) -> tuple[model.ParametrizedPlan, dict[model.TimePoint, Fraction]] | None:
    """The plan, or one with a step less, and the schedule with other times; None if a plan file cannot say it."""
    times, half = dict(schedule), EPSILON / 2

    def move(instance: model.ActionInstance, by: Fraction) -> None:
        times.update({point: times[point] + by for point in instance.time_points})

    first, second = (random.choice(plan.instances) for _ in range(2))
    match random.choice(CHANGES):
        case "moved":
            move(first, half * random.randint(-4, 4))
            move(second, half * random.randint(-4, 4))
        case "beside another":
            near, far = random.choice(first.time_points), random.choice(second.time_points)
            if first != second:
                move(first, times[far] - times[near] + half * random.randint(-2, 2))
        case "swapped":
            between = times[second.start] - times[first.start]
            move(first, between)
            move(second, -between)
        case "dropped" if len(plan.instances) > 1:
            plan = replace(plan, instances=tuple(one for one in plan.instances if one != first), constraints=())
            times = {point: times[point] for point in plan.time_points}
        case "duration":
            bounded = [one for one in plan.instances if one.durations] or [first]
            times[random.choice(bounded).end] += half * random.choice([-8, -4, -2, -1, -1, 1, 1, 2, 4, 8])
    possible = all(0 <= times[one.start] <= times[one.end] for one in plan.instances)
    return (plan, times) if possible else None


NO_SEPARATION = "VAL separates happenings only if they are at the same time"
LENIENT = "VAL grants its tolerance to durations"
FEWER_PAIRS = "VAL knows fewer mutex pairs, and others; see tests/val.py"


def why_val_differs(plan: model.ParametrizedPlan, violations: tuple[Violation, ...], *, valid: bool) -> str | None:
    """The class of a difference between VAL's verdict and ours; None if there is no reason for one."""
    near = [one for one in violations if one.obligation.startswith("separation: ") and one.amount != EPSILON]
    length = [one for one in violations if ": duration " in one.obligation and (one.amount or 0) < EPSILON]
    rest = [one for one in violations if one not in near and one not in length]
    if not judged_by_val(plan, rest):
        return FEWER_PAIRS
    if not valid or rest:
        return None
    return LENIENT if length else NO_SEPARATION if near else None


def compare_with_val(examples: int) -> Counter[str | tuple[bool, bool]]:
    """How often VAL's verdict and ours (ours first) are what, and why they differ."""
    found: Counter[str | tuple[bool, bool]] = Counter()

    @settings(drawn(examples), phases=(Phase.generate,))  # what VAL says of smaller plans would be counted as well
    @given(plans(dyadic=True, infeasible=False), RANDOM)
    def check(drawn_plan: model.ParametrizedPlan, random: Random) -> None:
        for schedule in sample_schedules(drawn_plan, drawn_plan.nominal, random, 1, epsilon=EPSILON):
            other = changed(drawn_plan, schedule, random)
            if other is not None:
                compare_one(*other, found)

    check()
    return found


def compare_one(
    plan: model.ParametrizedPlan, times: dict[model.TimePoint, Fraction], found: Counter[str | tuple[bool, bool]]
) -> None:
    texts = pddl_text(plan, plan.nominal, times)
    violations = simulate(replace(plan, constraints=()), plan.nominal, times, epsilon=EPSILON).violations
    verdict = robust.validate(*texts, epsilon=EPSILON, tolerance=0)
    assert verdict.valid is not bool(violations)
    assert too_near(verdict.violations) == too_near(violations)
    check_remedies(texts, verdict)
    try:
        val = run_val(texts, tolerance=EPSILON)
    except AssertionError:
        found["VAL cannot read it"] += 1
        return
    found[verdict.valid, val.valid] += 1
    if verdict.valid != val.valid:
        reason = why_val_differs(plan, violations, valid=val.valid)
        assert reason, f"{verdict}\n{''.join(texts)}{val.report}"
        found[reason] += 1


def too_near(violations: Sequence[Violation | Breach]) -> Counter[tuple[Fraction, Fraction | None]]:
    """When separations break, and by how much; conjunctions are split where they are read, so others may be more."""
    return Counter((one.time, one.amount) for one in violations if one.obligation.startswith("separation: "))


def check_remedies(texts: PddlText, verdict: Verdict) -> None:
    """What is said to help does, and a smaller tolerance or greater separation does not."""
    least, greatest = verdict.remedies.tolerance, verdict.remedies.epsilon
    if least is not None:
        assert robust.validate(*texts, epsilon=EPSILON, tolerance=least).valid
        assert not robust.validate(*texts, epsilon=EPSILON, tolerance=least * Fraction(99, 100)).valid
    if greatest is not None:
        assert greatest < EPSILON
        assert robust.validate(*texts, epsilon=greatest, tolerance=0).valid
        assert not robust.validate(*texts, epsilon=greatest * Fraction(101, 100), tolerance=0).valid
    near = [one for one in verdict.violations if one.obligation.startswith("separation: ")]
    if near and len(near) == len(verdict.violations) and all(one.amount != EPSILON for one in near):
        assert greatest is not None


@pytest.mark.parametrize(("examples", "least"), [(60, 50), pytest.param(2250, 2000, marks=pytest.mark.slow)])
def test_verdicts_agree_with_val(examples, least):
    found = compare_with_val(examples)
    classes = found[NO_SEPARATION], found[LENIENT], found[FEWER_PAIRS]
    verdicts = {key: count for key, count in found.items() if isinstance(key, tuple)}
    assert sum(verdicts.values()) >= least
    assert found[False, True] + found[True, False] == sum(classes)
    assert min(found[True, True], found[False, False]) > least / 10
    assert sum(classes) < least / 10
    assert found["VAL cannot read it"] <= least / 50
    if examples > 1000:
        assert all(classes)


# -- logs of planners --------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not LOGS.is_dir(), reason="the logs of planners are not there")
def test_verdicts_about_logs_are_those_of_val():
    """All that VAL can read; it refuses `storage`, whose predicates are used under other names than declared."""
    found: Counter[tuple[str, bool]] = Counter()
    for entry in json.loads((LOGS / "plans.json").read_text(encoding="utf-8")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore" if "storage" in entry["name"] else "error", InputWarning)
            verdict = robust.validate(*(LOGS / entry[name] for name in ("domain", "problem", "log")))
        assert verdict.steps == entry["steps"]
        found[entry["val"], verdict.valid] += 1
    assert found == {("valid", True): 26, ("invalid", False): 3, ("refused", True): 4}
