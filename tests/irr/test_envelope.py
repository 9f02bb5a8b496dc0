"""IRR on drawn plans: every accepted box is inside the envelope, every face of a complete one is near its border."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given, settings

from robust.api import check, envelope
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError
from robust.irr.check import Answer
from robust.irr.containment import Containment
from robust.irr.search import EnvelopeResult
from robust.plan.model import ParametrizedPlan
from robust.plan.simulate import simulate
from robust.qe.box import Box, Interval, Side
from robust.searching import Status
from robust.smt.limits import Deadline
from tests.encode.asking import sampled
from tests.irr.building import parametric
from tests.plan.building import RANDOM, drawn
from tests.sampling import Network, sample_schedules

BETA = Fraction(1, 2)
MOST_CHECKS = 200


def accepted_boxes(result: EnvelopeResult) -> list[Box]:
    return [step.box for step in result.trace if step.accepted]


def run_irr(plan: ParametrizedPlan, **options) -> EnvelopeResult | None:
    """The result; None if no parameter values leave a schedule."""
    try:
        return envelope(plan, method="irr", beta=BETA, on_step=_stop, **options)
    except InputError:
        assert not Network(plan, plan.nominal).consistent
        return None


def assert_inside(plan: ParametrizedPlan, box: Box, random: Random, count: int = 4) -> None:
    points = sampled(box.ranges, random, 1)
    for point in random.sample(points, min(count, len(points))):
        schedules = sample_schedules(plan, point, random, 4)
        assert schedules, f"no schedule at {point} of {box}"
        for schedule in schedules:
            assert simulate(plan, point, schedule).valid, (point, schedule)
        assert check(plan, at=point).answer is Answer.PROVED, point


def assert_trace_is_monotone(plan: ParametrizedPlan, result: EnvelopeResult) -> None:
    boxes = [Box.nominal(plan.parameters), *accepted_boxes(result), result.box]
    for smaller, larger in pairwise(boxes):
        for name, interval in smaller.intervals.items():
            assert interval.is_within(larger[name])
    assert [step.check for step in result.trace] == list(range(1, result.checks + 1))
    for before, step in pairwise(result.trace):
        if not step.accepted:
            # A query about an unbounded direction may follow an accepted step, never a failed one.
            assert step.box == before.box or before.accepted
    for parameter in plan.parameters:
        interval = result.box[parameter.name]
        assert interval.is_within(Interval(parameter.lower, parameter.upper))
        assert parameter.nominal in interval


def assert_faces_are_near_the_border(plan: ParametrizedPlan, result: EnvelopeResult, gap: Fraction) -> int:
    """Grow each side by `gap`; how many faces there were to grow."""
    faces = 0
    for parameter in plan.parameters:
        interval = result.box[parameter.name]
        for side, declared in ((Side.UPPER, parameter.upper), (Side.LOWER, parameter.lower)):
            end = interval.end(side)
            if end is not None and end != declared:
                faces += 1
                at = result.box.replace(parameter.name, interval.with_end(side, end + side.sign * gap))
                assert check(plan, at=at.intervals).answer is Answer.REFUTED, at
    return faces


def judge(plan: ParametrizedPlan, random: Random, *, shuffled: bool = False, **options) -> str:
    names = [parameter.name for parameter in plan.parameters]
    if shuffled:
        random.shuffle(names)
        options["order"] = names[: random.randint(1, len(names))]
    result = run_irr(plan, **options)
    if result is None:
        return "no schedule"
    nominal = check(plan)
    if result.status is Status.INVALID:
        assert nominal.answer is Answer.REFUTED
        assert not result.verified
        assert result.values == plan.nominal
        assert result.reason in {*nominal.obligations, nominal.reason} or "no schedule" in result.reason
        return "invalid"
    assert nominal.answer is Answer.PROVED
    assert result.verified
    assert_trace_is_monotone(plan, result)
    assert result.trace == () or result.trace[0].parameter == names[0]
    assert list(result.box.intervals) == [parameter.name for parameter in plan.parameters]
    accepted = accepted_boxes(result)
    for box in [result.box, *random.sample(accepted, min(2, len(accepted)))]:
        assert_inside(plan, box, random)
    if result.status is not Status.COMPLETE:
        return result.status.value
    faces = assert_faces_are_near_the_border(plan, result, 2 * BETA if "doubling" in options else BETA)
    infinite = any(i.lower is None or i.upper is None for i in result.box.intervals.values())
    return f"complete{', faces' if faces else ''}{', infinite' if infinite else ''}"


def _stop(step) -> None:
    if step.check >= MOST_CHECKS:
        raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("count", "options"),
    [
        (14, {}),
        (6, {"solver": "cvc5"}),
        (10, {"doubling": True}),
        (10, {"shuffled": True}),
        pytest.param(1500, {}, marks=pytest.mark.slow),
    ],
    ids=["plain", "cvc5", "doubling", "any order", "many"],
)
def test_boxes_are_inside_and_reach_the_border(count, options) -> None:
    outcomes: Counter[str] = Counter()

    @settings(drawn(count), derandomize=count < 100)
    @given(parametric(), RANDOM)
    def run(plan, random) -> None:
        outcomes[judge(plan, random, **options)] += 1

    run()
    assert sum(n for name, n in outcomes.items() if "complete" in name) >= 2, outcomes
    assert any("faces" in name for name in outcomes), outcomes
    assert count > 100 or "interrupted" not in outcomes, "a run on a small plan needs too many checks"


@drawn(10)
@given(parametric(instances=2))
def test_solvers_take_the_same_steps(plan) -> None:
    """Answers do not depend on which counterexample a solver finds, so neither does the search."""
    one, two = (run_irr(plan, solver=solver) for solver in ("z3", "cvc5"))
    if one is None or two is None:
        assert one is two
        return
    first, second = ((each.status, each.box, each.checks, each.unbounded_checks) for each in (one, two))
    assert first == second
    assert [replace(step, seconds=0) for step in one.trace] == [replace(step, seconds=0) for step in two.trace]


def test_refutations_are_in_the_box_and_real() -> None:
    """Containment answers a sequence of boxes, remembering: each refutation is checked from scratch."""
    outcomes: Counter[bool] = Counter()

    @drawn(20)
    @given(parametric(), RANDOM)
    def run(plan, random) -> None:
        containment = Containment(RelationalEncoding(plan))
        for _ in range(4):
            ends = {}
            for parameter in plan.parameters:
                low = parameter.nominal - Fraction(random.randint(0, 4), 2)
                high = parameter.nominal + Fraction(random.randint(0, 4), 2)
                ends[parameter.name] = Interval(
                    None if random.random() < 0.1 else low, None if random.random() < 0.1 else high
                )
            box = Box(ends)
            refutation = containment.refute(box, Deadline())
            outcomes[refutation is None] += 1
            if refutation is None:
                assert_inside(plan, box, random, count=2)
                continue
            assert refutation.values in box
            try:
                result = check(plan, at=refutation.values)
            except InputError:
                assert refutation.facet is not None
                continue
            assert result.answer is Answer.REFUTED, refutation
            if not Network(plan, refutation.values).consistent:
                assert not result.counterexamples

    run()
    assert outcomes[True] >= 3, outcomes
    assert outcomes[False] >= 3, outcomes
