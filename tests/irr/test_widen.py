"""Exact widening: known boxes, and on drawn plans inside, maximal, with ends closed exactly where they can be."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import pytest
from hypothesis import given

from robust.api import envelope
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError
from robust.irr.containment import Containment
from robust.irr.search import EnvelopeResult, Status
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline
from tests.irr.building import drawn, parametric, shipped

TINY = Fraction(1, 10**6)


def ends(result: EnvelopeResult) -> dict[str, tuple[Fraction | None, Fraction | None]]:
    return result.box.ranges


def searched(plan: ParametrizedPlan, method: str, **options: object) -> EnvelopeResult | None:
    """A complete result; None if the plan is invalid."""
    try:
        result = envelope(plan, method=method, timeout=20, **options)  # type: ignore[arg-type]
    except InputError:
        return None
    return result if result.status is Status.COMPLETE and result.verified else None


def wider(box: Box) -> Iterator[Box]:
    """Each finite face a tiny bit farther out; open ends closed."""
    for name, i in box.intervals.items():
        if i.lower is not None:
            yield box.replace(name, Interval(i.lower - TINY, i.upper, True, i.upper_closed))
            if not i.lower_closed:
                yield box.replace(name, Interval(i.lower, i.upper, True, i.upper_closed))
        if i.upper is not None:
            yield box.replace(name, Interval(i.lower, i.upper + TINY, i.lower_closed, True))
            if not i.upper_closed:
                yield box.replace(name, Interval(i.lower, i.upper, i.lower_closed, True))


def assert_maximal(plan: ParametrizedPlan, box: Box) -> None:
    containment = Containment(RelationalEncoding(plan))
    assert containment.refute(box, Deadline()) is None, f"{box} is not inside"
    for more in wider(box):
        assert containment.refute(more, Deadline()) is not None, f"{box} is not maximal: {more}"


# -- known boxes -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_navigation(solver):
    result = envelope(shipped("two_sample_navigation"), solver=solver)
    assert (result.status, result.beta, result.bound) == (Status.COMPLETE, None, None)
    assert ends(result) == {"to_ridge": (25, 36), "to_crater": (35, 46)}
    assert_maximal(shipped("two_sample_navigation"), result.box)


def test_generator():
    result = envelope(shipped("generator"))
    assert ends(result) == {"start_1": (4, 50), "start_2": (40, 86)}
    assert_maximal(shipped("generator"), result.box)


def test_weights_are_speeds():
    """Both upper ends move until to_ridge + 2 to_crater ≤ 128 stops them at 30 + 2λ and 40 + λ: λ = 9/2."""
    box = envelope(shipped("two_sample_navigation", "to_ridge,weight=2")).box
    assert (box["to_ridge"].upper, box["to_crater"].upper) == (39, Fraction(89, 2))


def test_parameter_by_parameter():
    plan = shipped("two_sample_navigation")
    assert ends(envelope(plan, order=["to_ridge"])) == {"to_ridge": (20, 45), "to_crater": (40, 40)}
    # to_crater from 30 (60 − 30) to 49 ((128 − 30) / 2); to_ridge then has no room on either side.
    assert ends(envelope(plan, order=["to_crater"])) == {"to_ridge": (30, 30), "to_crater": (30, 49)}
    with pytest.raises(InputError, match="unknown parameter"):
        envelope(plan, order=["to_rigde"])


def test_declared_bounds_are_ends():
    box = envelope(shipped("two_sample_navigation", "to_ridge,lb=28,ub=31")).box
    assert (box["to_ridge"].lower, box["to_ridge"].upper) == (28, 31)


def test_single_point():
    box = envelope(shipped("two_sample_navigation", "to_ridge,lb=30,ub=30", "to_crater,lb=40,ub=40")).box
    assert box.total_width == 0


def test_unbounded_and_declared_beside_the_plan():
    plan = shipped("two_sample_navigation", "fluent:(charge scout),lb=0")
    box = envelope(plan).box
    assert box["charge_scout"].upper is None
    assert_maximal(plan, box)


def test_out_of_time_is_said():
    result = envelope(shipped("generator"), timeout=0)
    assert (result.status, result.verified) == (Status.TIMEOUT, False)


def test_steps_are_growing_boxes():
    boxes: list[Box] = []
    envelope(shipped("two_sample_navigation"), on_step=lambda step: boxes.append(step.box))
    assert boxes
    widths = [box.total_width for box in boxes]
    assert widths == sorted(widths)


@pytest.mark.parametrize("options", [{"beta": Fraction(1)}, {"doubling": True}, {"contain_nominal": True}])
def test_options_of_other_methods(options):
    with pytest.raises(InputError, match="with method='widen'"):
        envelope(shipped("two_sample_navigation"), **options)


# -- drawn plans -----------------------------------------------------------------------------------------------------


@drawn(25)
@given(parametric())
def test_the_box_is_inside_and_maximal(plan):
    result = searched(plan, "widen")
    if result is not None:
        assert plan.nominal in result.box
        assert_maximal(plan, result.box)


@pytest.mark.slow
@drawn(300)
@given(parametric())
def test_the_box_is_inside_and_maximal_on_many_plans(plan):
    result = searched(plan, "widen")
    if result is not None:
        assert_maximal(plan, result.box)


@drawn(10)
@given(parametric())
def test_an_order_gives_a_maximal_box_too(plan):
    result = searched(plan, "widen", order=[parameter.name for parameter in reversed(plan.parameters)])
    if result is not None:
        assert_maximal(plan, result.box)
