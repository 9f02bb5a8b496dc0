"""IRR on drawn plans: every accepted box is inside the envelope, every face of a complete one is near its border."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import pairwise, product
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.api import check, envelope
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError
from robust.irr.check import Answer
from robust.irr.containment import Containment
from robust.irr.search import EnvelopeResult, Status
from robust.plan.model import ParametrizedPlan
from robust.plan.simulate import simulate
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline
from tests.irr.building import accepted_boxes, drawn, parametric
from tests.sampling import Network, sample_schedules

RANDOM = st.randoms(use_true_random=True)
BETA = Fraction(1, 2)
FAR = Fraction(40)
MOST_CHECKS = 200


def run_irr(plan: ParametrizedPlan, **options) -> EnvelopeResult | None:
    """The result; None if no parameter values leave a schedule."""
    try:
        return envelope(plan, method="irr", beta=BETA, **options)
    except InputError:
        assert not Network(plan, plan.nominal).consistent
        return None


def points_of(box: Box, random: Random, count: int) -> list[dict[str, Fraction]]:
    """Two corners, the middle and random points; infinite ends are far out."""
    ends = {}
    for name, interval in box.intervals.items():
        middle = interval.some_value()
        low = middle - FAR if interval.lower is None else interval.lower
        ends[name] = (low, middle + FAR if interval.upper is None else interval.upper)
    corners = [dict(zip(ends, corner, strict=True)) for corner in product(*ends.values())]
    inside = [{n: low + (high - low) * Fraction(random.randint(0, 8), 8) for n, (low, high) in ends.items()}]
    inside += [{n: (low + high) / 2 for n, (low, high) in ends.items()}]
    points = [*random.sample(corners, min(2, len(corners))), *inside]
    return points[:count]


def assert_inside(plan: ParametrizedPlan, box: Box, random: Random, count: int = 4) -> None:
    for point in points_of(box, random, count):
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
        grown = []
        if interval.upper is not None and interval.upper != parameter.upper:
            grown.append(Interval(interval.lower, interval.upper + gap))
        if interval.lower is not None and interval.lower != parameter.lower:
            grown.append(Interval(interval.lower - gap, interval.upper))
        for wider in grown:
            faces += 1
            at = result.box.replace(parameter.name, wider)
            assert check(plan, at=at.intervals).answer is Answer.REFUTED, at
    return faces


def judge(plan: ParametrizedPlan, random: Random, solver: str = "z3") -> str:
    result = run_irr(plan, solver=solver, on_step=_limited())
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
    accepted = accepted_boxes(result)
    for box in [result.box, *random.sample(accepted, min(2, len(accepted)))]:
        assert_inside(plan, box, random)
    if result.status is not Status.COMPLETE:
        return result.status.value
    faces = assert_faces_are_near_the_border(plan, result, BETA)
    infinite = any(i.lower is None or i.upper is None for i in result.box.intervals.values())
    return f"complete{', faces' if faces else ''}{', infinite' if infinite else ''}"


def _limited():
    def stop(step):
        if step.check >= MOST_CHECKS:
            raise KeyboardInterrupt

    return stop


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_boxes_are_inside_and_reach_the_border(solver) -> None:
    outcomes: Counter[str] = Counter()

    @drawn(14 if solver == "z3" else 6)
    @given(parametric(), RANDOM)
    def run(plan, random) -> None:
        outcomes[judge(plan, random, solver)] += 1

    run()
    assert sum(n for name, n in outcomes.items() if "complete" in name) >= 2, outcomes
    assert any("faces" in name for name in outcomes), outcomes
    assert "interrupted" not in outcomes, "a run on a small plan needs too many checks"


@pytest.mark.slow
@settings(drawn(1500), derandomize=False)
@given(parametric(), RANDOM)
def test_many_boxes_are_inside_and_reach_the_border(plan, random) -> None:
    judge(plan, random)


def test_doubling_ends_inside_within_twice_the_precision() -> None:
    outcomes: Counter[str] = Counter()

    @drawn(10)
    @given(parametric(instances=2), RANDOM)
    def run(plan, random) -> None:
        result = run_irr(plan, doubling=True, on_step=_limited())
        if result is None or result.status is Status.INVALID:
            return
        assert_trace_is_monotone(plan, result)
        assert_inside(plan, result.box, random)
        if result.status is Status.COMPLETE:
            outcomes["faces"] += assert_faces_are_near_the_border(plan, result, 2 * BETA)
        outcomes[result.status.value] += 1

    run()
    assert outcomes["complete"] >= 2, outcomes
    assert outcomes["faces"] >= 1, outcomes


@drawn(10)
@given(parametric(instances=2), RANDOM)
def test_any_order_gives_a_maximal_box(plan, random) -> None:
    names = [parameter.name for parameter in plan.parameters]
    random.shuffle(names)
    result = run_irr(plan, order=names[: random.randint(1, len(names))], on_step=_limited())
    if result is not None and result.status is Status.COMPLETE:
        assert result.trace == () or result.trace[0].parameter == names[0]
        assert list(result.box.intervals) == [parameter.name for parameter in plan.parameters]
        assert_inside(plan, result.box, random, count=2)
        assert_faces_are_near_the_border(plan, result, BETA)


@drawn(10)
@given(parametric(instances=2))
def test_solvers_take_the_same_steps(plan) -> None:
    """Answers do not depend on which counterexample a solver finds, so neither does the search."""
    one, two = (run_irr(plan, solver=solver, on_step=_limited()) for solver in ("z3", "cvc5"))
    if one is None or two is None:
        assert one is two
        return
    assert (one.status, one.box, one.checks, one.unbounded_checks) == (
        two.status,
        two.box,
        two.checks,
        two.unbounded_checks,
    )
    assert [(s.parameter, s.side, s.delta, s.accepted) for s in one.trace] == [
        (s.parameter, s.side, s.delta, s.accepted) for s in two.trace
    ]


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
