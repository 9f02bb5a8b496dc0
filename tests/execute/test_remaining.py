"""What has happened to a plan: the state that it is in, with what was observed, and what broke."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from random import Random

import pytest

from robust import ParametrizedPlan, convert, load_plan
from robust.execute.messages import StepProgress
from robust.execute.monitor import Monitor
from robust.execute.remaining import History
from robust.plan.model import Fluent, TimedLiteral
from robust.probability.distributions import Distribution
from tests.sampling import often

LEVEL = Fluent("level", ())
TAKEN, RATES, ADDED = (1, 0, 2), (-1, 2, -3), (5, 1, 0)
"""What each step takes from the level at its start, changes it by per unit of time, and adds to it at its end."""


@cache
def draining() -> ParametrizedPlan:
    actions = [
        f"""(:durative-action work{number} :duration (and (>= ?duration 1) (<= ?duration 40))
        :condition (at start (>= (level) -1000))
        :effect (and (at start (decrease (level) {TAKEN[number]})) (increase (level) (* #t {RATES[number]}))
        (at end (increase (level) {ADDED[number]}))))"""
        for number in range(3)
    ]
    return convert(
        f"(define (domain d) (:functions (level)) {' '.join(actions)})",
        "(define (problem p) (:domain d) (:init (= (level) 100)) (:goal (>= (level) -1000)))",
        "".join(f"{number / 10}: (work{number}) [10]\n" for number in range(3)),
    ).plan


def level(steps: list[StepProgress], observed: list[TimedLiteral], time: Fraction) -> Fraction:
    """By hand: from the last observation on, or from the beginning."""
    since, value = observed[-1].time if observed else Fraction(-1), Fraction(observed[-1].value if observed else 100)
    for number, step in enumerate(steps):
        if step.start is None or step.start > time:
            continue
        end = time if step.end is None or step.end > time else step.end
        value += RATES[number] * max(Fraction(0), end - max(since, step.start))
        value -= TAKEN[number] if step.start > since else 0
        value += ADDED[number] if step.end is not None and since < step.end <= time else 0
    return value


@pytest.mark.parametrize("seed", range(often(60, 2000)))
def test_what_was_observed_is_so_when_it_was_and_counts_from_then_on(seed):
    random, plan = Random(seed), draining()  # noqa: S311 - reproducible
    steps = []
    for _ in range(3):
        start = Fraction(random.randrange(20), 2)
        end = random.choice([None, start + Fraction(random.randrange(1, 12), 2)])
        steps.append(random.choice([StepProgress(start, end), StepProgress(start, end), StepProgress()]))
    last = max((time for step in steps for time in (step.start, step.end) if time is not None), default=Fraction(0))
    times = sorted({Fraction(random.randrange(2 * int(last) + 4), 2) for _ in range(random.randrange(4))})
    observed: list[TimedLiteral] = []
    surprises = []
    for time in times:
        expected = level(steps, observed, time)
        value = expected + random.choice([0, 0, 3])
        if value != expected:
            surprises.append(LEVEL)
        observed.append(TimedLiteral(time, LEVEL, value))
    now = max([last, *times]) + Fraction(random.randrange(3), 2)
    names = [instance.identifier for instance in plan.instances]
    history = History(plan, dict.fromkeys(names, Fraction(10)), dict(zip(names, steps, strict=True)), observed, now, ())
    assert history.state.fluents[LEVEL] == level(steps, observed, now)
    assert [target for target, _ in history.surprises] == surprises


def test_what_runs_keeps_nothing_away_from_the_present():
    """It is not over, so that it does not touch what it changes all the time then."""
    monitor = Monitor(draining(), reorder=False)
    monitor.say("start", "work0", at=0)
    monitor.say("start", "work1", at=2)
    outlook = monitor.say("value", "level", at=2, observed=95)
    assert (outlook.prospect.value, outlook.reasons) == ("on track", ("(level) is 95 and not 97",))
    assert monitor.say("value", "level", at=3, observed=96).reasons == ("(level) is 95 and not 97",)


def test_what_is_observed_and_harmless_changes_no_window_and_no_probability(tmp_path):
    texts = {
        "domain.pddl": """(define (domain d) (:predicates (a)) (:functions (level))
        (:durative-action one :duration (and (>= ?duration 5) (<= ?duration 20)) :effect (at end (a)))
        (:durative-action two :duration (and (>= ?duration 5) (<= ?duration 20))
        :condition (and (at start (a)) (at start (>= (level) 3))) :effect (at end (decrease (level) 1))))""",
        "problem.pddl": "(define (problem p) (:domain d) (:init (= (level) 10)) (:goal (and (a) (>= (level) 1))))",
        "plan.txt": "0: (one) [10]\n10.001: (two) [10]\n",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    plan = load_plan(*(tmp_path / name for name in texts), parameters=["duration:*"], deadline=25)
    law = Distribution("uniform", {"lower": Fraction(5), "upper": Fraction(20)})
    monitor, other = (Monitor(plan, distributions={each.name: law for each in plan.parameters}) for _ in range(2))
    for each in (monitor, other):
        each.say("start", "one", at=0)
    assert monitor.say("value", "level", at=8, observed=7).reasons == ("(level) is 7 and not 10",)
    other.say("tick", at=8)
    for kind, step, at in (("tick", "", 9), ("end", "one", 12), ("start", "two", 13), ("tick", "", 15)):
        surprised, undisturbed = (each.say(kind, step, at=at) for each in (monitor, other))
        assert replace(surprised, reasons=()) == undisturbed
