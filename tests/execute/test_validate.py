"""Verdicts about single schedules: in words, as the simulator decides, ε = 0; what would help."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest
from hypothesis import given

import robust
from robust import Answer, InputError, Mode, UnsupportedError
from robust.plan import model
from robust.plan.simulate import mutex_pairs, simulate
from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan
from robust.show.text import Words
from tests.encode.test_meaning import Drawing, on_a_grid
from tests.execute.plans import ERRAND, ERRANDS, converted, errand, errands, text_of
from tests.pddl_text import pddl_text
from tests.plan.building import RANDOM, F, assign, drawn, instant, plan_of
from tests.sampling import sample_schedules
from tests.strategies import plans

GOING = "0: (go home market) [7.5]\n"


def small(actions, init="", goal="(q)"):
    """A domain of actions over two atoms and two functions, and its problem."""
    return (
        f"(define (domain d) (:predicates (p) (q)) (:functions (f) (g)) {actions})",
        f"(define (problem x) (:domain d) (:init {init}) (:goal {goal}))",
    )


VERDICTS = re.findall(r"== (.*?) (\{.*?\})\n(.*?)\n--\n(.*?)\n(?===|\Z)", text_of("verdicts.txt"), re.DOTALL)
"""Names, options, plans and what is said of them: for the errand, or for actions of their own."""


@pytest.mark.parametrize(("options", "steps", "expected"), [pytest.param(*case, id=name) for name, *case in VERDICTS])
def test_verdicts_in_words(options, steps, expected):
    chosen = json.loads(options)
    own = {key: chosen.pop(key) for key in ("actions", "init", "goal") if key in chosen}
    texts = small(**own) if own else (ERRANDS.replace(*chosen.pop("errand", ("", ""))), ERRAND)
    assert str(robust.validate(*texts, parse_timed_plan(steps), **chosen)) == expected


@pytest.mark.parametrize(("duration", "tolerance"), [("1.7", Fraction(3, 10)), ("1.6", None)])
def test_tolerances_are_suggested_up_to_a_fifth_of_the_shortest_duration(duration, tolerance):
    verdict = robust.validate(ERRANDS, ERRAND, GOING + f"8: (shop market) [{duration}]")
    assert (verdict.valid, verdict.remedies.tolerance) == (False, tolerance)


def test_obligations_and_amounts_are_exact():
    domain, steps = ERRANDS.replace("(over all (open))", "(at start (open))"), GOING + "19.9995: (shop market) [2]"
    (breach,) = robust.validate(domain, ERRAND, steps, tolerance=0).violations
    assert (breach.obligation, breach.amount) == ("separation: n1.start, @20", Fraction(1, 2000))


def test_what_is_taken_for_a_text_a_path_or_what_reading_gives(tmp_path):
    files = [tmp_path / name for name in ("domain.pddl", "problem.pddl", "plan (1).txt")]
    for file, text in zip(files, (ERRANDS, ERRAND, GOING + "8: (shop market) [2]"), strict=True):
        file.write_text(text, encoding="utf-8")
    shop = "8: (shop market) [2]"
    for verdict in (robust.validate(ERRANDS, ERRAND, shop), robust.validate(errands, errand, parse_timed_plan(shop))):
        assert (verdict.valid, verdict.plan, verdict.steps) == (False, "<plan>", 1)
    for verdict in (robust.validate(*files), robust.validate(*map(str, files))):
        assert (verdict.valid, verdict.plan, verdict.steps, verdict.end) == (True, str(files[2]), 2, 10)
    with pytest.raises(InputError, match="no such file"):
        robust.validate(*files[:2], "plan.txt")
    log = f"{GOING}{shop}\n; Plan found:\n{shop}\nDone.\n"
    verdicts = [robust.validate(errands, errand, log, plan_number=number) for number in (1, 2, None)]
    assert [verdict.valid for verdict in verdicts] == [True, False, False]
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


def test_a_plan_that_a_program_made_begins_at_zero_and_what_cannot_be_decided_is_unsupported():
    steps = (TimedStep(Fraction(-1), "go", ("home", "market"), Fraction(15, 2)),)
    with pytest.raises(InputError, match="expected a time and a duration of at least 0"):
        robust.validate(errands, errand, TimedPlan(steps))
    texts = small(
        "(:durative-action a :parameters () :duration (= ?duration 2) :condition (over all (>= (* (f) (g)) 0))"
        ":effect (and (increase (f) (* #t 1)) (increase (g) (* #t 1)) (at end (q))))",
        "(= (f) 1) (= (g) 1)",
    )
    with pytest.raises(UnsupportedError, match="multiplies fluents"):
        robust.validate(*texts, "0: (a) [2]\n")


EPSILON = Fraction(1, 16)
"""Schedules are multiples of half of it."""
CHANGES = ("none", "moved", "beside another", "beside another", "swapped", "dropped", "duration", "duration")


def changed(plan, schedule, random):
    """The plan, or one with a step less, and the schedule with other times; None if a plan file cannot say it."""
    times, half = dict(schedule), EPSILON / 2

    def move(instance, by):
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
            move(first, between := times[second.start] - times[first.start])
            move(second, -between)
        case "dropped" if len(plan.instances) > 1:
            others = tuple(action for action in plan.instances if action != first)
            plan = replace(plan, instances=others, constraints=())
            times = {point: times[point] for point in plan.time_points}
        case "duration":
            bounded = [action for action in plan.instances if action.durations] or [first]
            times[random.choice(bounded).end] += half * random.choice([-8, -4, -2, -1, -1, 1, 1, 2, 4, 8])
    possible = all(0 <= times[action.start] <= times[action.end] for action in plan.instances)
    return (plan, times) if possible else None


def too_near(violations):
    """When separations break, and by how much; conjunctions are split where they are read, so others may be more."""
    near = (breach for breach in violations if breach.obligation.startswith("separation: "))
    return sorted((breach.time, breach.amount or Fraction(0)) for breach in near)


def check_remedies(texts, verdict):
    """What is said to help does, and a smaller tolerance or greater separation does not."""
    least, greatest = verdict.remedies.tolerance, verdict.remedies.epsilon
    if least is not None:
        assert robust.validate(*texts, epsilon=EPSILON, tolerance=least).valid
        assert not robust.validate(*texts, epsilon=EPSILON, tolerance=least * Fraction(99, 100)).valid
    if greatest is not None:
        assert greatest < EPSILON
        assert robust.validate(*texts, epsilon=greatest, tolerance=0).valid
        assert not robust.validate(*texts, epsilon=greatest * Fraction(101, 100), tolerance=0).valid
    near = too_near(verdict.violations)
    if near and len(near) == len(verdict.violations) and all(amount != EPSILON for _, amount in near):
        assert greatest is not None


@pytest.mark.parametrize(("examples", "least"), [(30, 25), pytest.param(2250, 2000, marks=pytest.mark.slow)])
def test_verdicts_and_separations_are_those_of_the_simulator_and_remedies_help(examples, least):
    seen = Counter()

    @drawn(examples)
    @given(plans(dyadic=True, infeasible=False), RANDOM)
    def check(drawn_plan, random):
        for schedule in sample_schedules(drawn_plan, drawn_plan.nominal, random, 1, epsilon=EPSILON):
            if (other := changed(drawn_plan, schedule, random)) is None:
                continue
            plan, times = other
            texts = pddl_text(plan, plan.nominal, times)
            violations = simulate(replace(plan, constraints=()), plan.nominal, times, epsilon=EPSILON).violations
            verdict = robust.validate(*texts, epsilon=EPSILON, tolerance=0)
            assert verdict.valid is not bool(violations)
            assert too_near(verdict.violations) == too_near(violations)
            check_remedies(texts, verdict)
            seen[verdict.valid] += 1

    check()
    assert seen.total() >= least
    assert min(seen[True], seen[False]) > least / 10


NEVER = Fraction(0)


def test_what_is_tied_is_broken_and_can_be_moved():
    steps = parse_timed_plan("0: (go home market) [7.5]\n7.5: (go market home) [7.5]")
    verdict = robust.validate(errands, errand, steps, epsilon=0, tolerance=0)
    words = "the end of (go home market) and the start of (go market home) have to be at different times"
    assert str(verdict.violations[0]) == f"at 7.5: {words}, but are at the same time (lines 1, 2)"
    assert verdict.remedies.epsilon is None
    moved = robust.validate(errands, errand, steps, epsilon=0, tolerance="0.01")
    assert not [breach for breach in moved.violations if breach.obligation.startswith("separation")]
    assert 0 < moved.shift < Fraction(1, 100)
    words = Words(plan_of(instant("a", assign(F, 1)), instant("b", assign(F, 2))), NEVER)
    assert words.obligation("separation: a, b").endswith("must be at different times")
    assert words.concerned("separation: a, b") == ("a", "b")
    twice = Words(plan_of(instant("a", assign(F, 1), assign(F, 2))))
    assert twice.obligation("effects of a agree").endswith("needs one change only of (f)")
    assert twice.concerned("effects of a agree") == ("a",)


def hunt(seed):
    """Judge and convert the schedules of a drawn plan, and execute what the networks allow."""
    random = Random(seed)  # noqa: S311 - no secret
    plan = Drawing(random).plan()
    schedules = list(on_a_grid(plan))
    for schedule in random.sample(schedules, min(3, len(schedules))):
        texts = pddl_text(plan, {}, schedule)
        if any(part.condition == model.Truth(value=False) for action in plan.instances for part in action.agreements):
            with pytest.raises(InputError, match="an assignment and another change"):
                robust.validate(*texts, epsilon=0, tolerance=0)
            yield "refused"
            continue
        verdict = robust.validate(*texts, epsilon=0, tolerance=0)
        simulation = simulate(replace(plan, constraints=()), {}, schedule, epsilon=NEVER)
        assert verdict.valid == (not simulation.violations)
        yield "valid" if verdict.valid else "invalid"
        yield from {breach.obligation.partition(" ")[0] for breach in verdict.violations} & {"effects", "separation:"}
        for mode in Mode if verdict.valid else ():
            conversion = converted(*texts, mode=mode, epsilon=NEVER, tolerance=NEVER)
            assert "at different times" in conversion.notes(parse_timed_plan(texts.plan))[-1]
            assert mode is Mode.ESTEREL or conversion.check.answer is Answer.PROVED
            if conversion.check.answer is Answer.PROVED:
                yield f"{mode.value}, proved"
                for times in sample_schedules(conversion.plan, {}, random, 3, epsilon=NEVER):
                    assert simulate(conversion.plan, {}, times, epsilon=NEVER).valid
                    assert all(times[a] != times[b] for a, b in mutex_pairs(conversion.plan))


@pytest.mark.parametrize("count", [15, pytest.param(1000, marks=pytest.mark.slow)])
def test_verdicts_and_networks_are_strict(count):
    seen = Counter(outcome for seed in range(count) for outcome in hunt(seed))
    kinds = ("valid", "invalid", "effects", "separation:", "causal, proved", "esterel, proved")
    assert min(seen[kind] for kind in kinds) >= count / 12, seen
