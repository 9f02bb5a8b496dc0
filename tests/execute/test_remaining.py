"""What has happened to a plan: the state that it is in, with what was observed, and what broke."""

from fractions import Fraction
from functools import cache
from random import Random

import pytest

from robust import ParametrizedPlan, convert
from robust.execute.messages import StepProgress
from robust.execute.monitor import Monitor
from robust.execute.remaining import History
from robust.plan.model import Fluent, TimedLiteral
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
    history = History(plan, dict.fromkeys(names, Fraction(10)), dict(zip(names, steps, strict=True)), observed, now)
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
