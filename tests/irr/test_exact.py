"""Exact widening and optimal boxes: known ones, and on drawn plans inside and maximal, and the optimum the widest."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import pytest
from hypothesis import given, settings

from robust.api import envelope
from robust.errors import InputError
from robust.irr.search import EnvelopeResult
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Box, Side
from robust.searching import Status
from tests.encode.asking import Judge
from tests.irr.building import parametric, shipped, weighted
from tests.plan.building import drawn

TINY = Fraction(1, 10**6)


def searched(plan: ParametrizedPlan, method: str, **options: object) -> EnvelopeResult | None:
    """A complete result; None if the plan is invalid."""
    try:
        result = envelope(plan, method=method, timeout=20, **options)  # type: ignore[arg-type]
    except InputError:
        return None
    return result if result.status is Status.COMPLETE and result.verified else None


def wider(box: Box) -> Iterator[Box]:
    """Each finite face a tiny bit farther out; open ends closed."""
    for name, interval in box.intervals.items():
        for side in Side:
            end = interval.end(side)
            if end is not None:
                yield box.moved((name, side), end + side.sign * TINY)
                if not interval.is_closed_at(side):
                    yield box.moved((name, side), end)


def assert_maximal(plan: ParametrizedPlan, box: Box) -> None:
    judge = Judge(plan)
    assert judge.contains(box), f"{box} is not inside"
    for more in wider(box):
        assert not judge.contains(more), f"{box} is not maximal: {more}"


# -- known boxes -----------------------------------------------------------------------------------------------------


# With weights, both upper ends move until to_ridge + 2 to_crater ≤ 128 stops them at 30 + 2λ and 40 + λ: λ = 9/2;
# the lower ones until to_ridge + to_crater ≥ 60 does, at λ = 10/3.
# In the other order to_crater goes from 30 (60 − 30) to 49 ((128 − 30) / 2); to_ridge then has no room on either side.
@pytest.mark.parametrize(
    ("specs", "options", "ridge", "crater"),
    [
        ((), {"solver": "z3"}, (25, 36), (35, 46)),
        ((), {"solver": "cvc5"}, (25, 36), (35, 46)),
        (("to_ridge,weight=2",), {}, (Fraction(70, 3), 39), (Fraction(110, 3), Fraction(89, 2))),
        ((), {"order": ["to_ridge"]}, (20, 45), (40, 40)),
        ((), {"order": ["to_crater"]}, (30, 30), (30, 49)),
        (("to_ridge,lb=28,ub=31",), {}, (28, 31), (32, Fraction(97, 2))),
        (("to_ridge,lb=30,ub=30", "to_crater,lb=40,ub=40"), {}, (30, 30), (40, 40)),
        (("to_ridge,lb=30,ub=30", "to_crater,lb=38,ub=41"), {"method": "optimal"}, (30, 30), (38, 41)),
    ],
)
def test_known_boxes(specs, options, ridge, crater) -> None:
    plan = shipped("two_sample_navigation", *specs)
    result = envelope(plan, **options)
    assert (result.status, result.beta) == (Status.COMPLETE, None)
    assert (result.bound is None) == ("method" not in options)
    assert result.box.ranges == {"to_ridge": ridge, "to_crater": crater}
    if not specs:
        assert_maximal(plan, result.box)


def test_generator() -> None:
    """Optimal is either square, or the long strip that crosses both: all have total width 92."""
    plan = shipped("generator")
    result = envelope(plan)
    assert result.box.ranges == {"start_1": (4, 50), "start_2": (40, 86)}
    assert_maximal(plan, result.box)
    best = envelope(plan, method="optimal")
    assert (best.bound, best.box.total_width) == (92, 92)
    assert Judge(plan).contains(best.box)


def test_unbounded_and_declared_beside_the_plan() -> None:
    plan = shipped("two_sample_navigation", "fluent:(charge scout),lb=0")
    box = envelope(plan).box
    assert box["charge_scout"].upper is None
    assert_maximal(plan, box)
    best = envelope(plan, method="optimal", timeout=30)
    assert (best.box["charge_scout"].upper, best.bound) == (None, None)


def test_steps_are_growing_boxes() -> None:
    boxes: list[Box] = []
    envelope(shipped("two_sample_navigation"), on_step=lambda step: boxes.append(step.box))
    assert boxes
    widths = [box.total_width for box in boxes]
    assert widths == sorted(widths)


# -- drawn plans -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("count", "ordered"), [(25, False), (10, True), pytest.param(300, False, marks=pytest.mark.slow)]
)
def test_the_box_is_inside_and_maximal(count, ordered) -> None:
    @settings(drawn(count))
    @given(parametric())
    def run(plan) -> None:
        order = [parameter.name for parameter in reversed(plan.parameters)] if ordered else ()
        result = searched(plan, "widen", order=order)
        if result is not None:
            assert plan.nominal in result.box
            assert_maximal(plan, result.box)

    run()


@drawn(12)
@given(parametric())
def test_no_other_box_is_wider(plan) -> None:
    best = searched(plan, "optimal")
    around = searched(plan, "optimal", contain_nominal=True)
    if best is None:
        return
    judge = Judge(plan)
    assert judge.contains(best.box)
    width = weighted(plan, best.box)
    for other in (searched(plan, "widen"), searched(plan, "irr"), around):
        if other is None:
            continue
        assert judge.contains(other.box)
        own = weighted(plan, other.box)
        if width is not None:
            assert own is not None
            # An optimum that is only approached is given up to a millionth.
            assert width >= own - max(own, Fraction(1)) / 10**6
            assert best.bound is None or best.bound >= own
    assert around is None or plan.nominal in around.box
