"""ε = 0, and effects that disagree, where plans are judged, moved, converted and executed: as the simulator decides."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

import robust
from robust.errors import InputError
from robust.execute import replan
from robust.execute.convert import Mode
from robust.irr.check import Answer
from robust.plan import model
from robust.plan.simulate import mutex_pairs, simulate
from robust.plan.timed import parse_timed_plan
from robust.show.text import Words
from tests.encode.test_conflicts import Drawing, on_a_grid
from tests.execute.plans import converted, errand, errands
from tests.pddl_text import pddl_text
from tests.plan.building import F, assign, instant, plan_of
from tests.sampling import sample_schedules

NEVER = Fraction(0)


def test_what_is_tied_is_broken_and_can_be_moved() -> None:
    steps = parse_timed_plan("0: (go home market) [7.5]\n7.5: (go market home) [7.5]")
    verdict = robust.validate(errands, errand, steps, epsilon=0, tolerance=0)
    words = "the end of (go home market) and the start of (go market home) have to be at different times"
    assert str(verdict.violations[0]) == f"at 7.5: {words}, but are at the same time (lines 1, 2)"
    assert verdict.remedies.epsilon is None
    moved = robust.validate(errands, errand, steps, epsilon=0, tolerance="0.01")
    assert not [breach for breach in moved.violations if breach.obligation.startswith("separation")]
    assert 0 < moved.shift < Fraction(1, 100)


def test_words_of_what_is_separated() -> None:
    words = Words(plan_of(instant("a", assign(F, 1)), instant("b", assign(F, 2))), NEVER)
    assert words.obligation("separation: a, b").endswith("must be at different times")
    assert words.concerned("separation: a, b") == ("a", "b")
    twice = Words(plan_of(instant("a", assign(F, 1), assign(F, 2))))
    assert twice.obligation("effects of a agree").endswith("needs one change only of (f)")
    assert twice.concerned("effects of a agree") == ("a",)


def test_the_next_plan_begins_later() -> None:
    assert replan.origin_after(Fraction(3), (), NEVER) > 3
    soon = model.TimedLiteral(replan.origin_after(Fraction(3), (), NEVER), F, Fraction(1))
    assert replan.origin_after(Fraction(3), (soon,), NEVER) > soon.time


def hunt(seed: int) -> Iterator[str]:
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


@pytest.mark.parametrize("count", [25, pytest.param(1000, marks=pytest.mark.slow)])
def test_verdicts_and_networks_are_strict(count: int) -> None:
    seen = Counter(outcome for seed in range(count) for outcome in hunt(seed))
    kinds = ("valid", "invalid", "effects", "separation:", "causal, proved", "esterel, proved")
    assert min(seen[kind] for kind in kinds) >= count / 12, seen
