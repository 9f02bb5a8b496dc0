"""The optimal box: known optima, and on drawn plans inside, maximal and no narrower than what other methods find."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given

from robust.api import envelope
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError
from robust.irr.containment import Containment
from robust.irr.search import Status
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Box
from robust.smt.limits import Deadline
from tests.irr.building import drawn, parametric, shipped
from tests.irr.test_widen import ends, searched


def weighted(plan: ParametrizedPlan, box: Box) -> Fraction | None:
    widths = [box[parameter.name].width for parameter in plan.parameters]
    if any(width is None for width in widths):
        return None
    return sum((p.weight * (w or 0) for p, w in zip(plan.parameters, widths, strict=True)), Fraction(0))


@pytest.mark.parametrize("contain_nominal", [False, True])
@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_navigation(contain_nominal, solver):
    plan = shipped("two_sample_navigation")
    result = envelope(plan, method="optimal", contain_nominal=contain_nominal, solver=solver)
    assert (result.status, result.bound, result.box.total_width) == (Status.COMPLETE, 25, 25)
    assert Containment(RelationalEncoding(plan)).refute(result.box, Deadline()) is None


def test_generator():
    """Either square, or the long strip that crosses both: all have total width 92."""
    plan = shipped("generator")
    result = envelope(plan, method="optimal")
    assert (result.bound, result.box.total_width) == (92, 92)
    assert Containment(RelationalEncoding(plan)).refute(result.box, Deadline()) is None


def test_weights_count():
    """to_crater counts three times: the widest box has no width elsewhere."""
    plan = shipped("two_sample_navigation", "to_crater,weight=3")
    result = envelope(plan, method="optimal")
    assert result.bound == weighted(plan, result.box)
    assert result.bound > 25
    assert result.box["to_ridge"].width == 0


def test_around_the_nominal_point():
    plan = shipped("two_sample_navigation", "to_crater,weight=3")
    free, around = (envelope(plan, method="optimal", contain_nominal=one) for one in (False, True))
    assert plan.nominal in around.box
    assert around.bound <= free.bound


def test_declared_bounds_and_single_point():
    plan = shipped("two_sample_navigation", "to_ridge,lb=30,ub=30", "to_crater,lb=38,ub=41")
    assert ends(envelope(plan, method="optimal")) == {"to_ridge": (30, 30), "to_crater": (38, 41)}


def test_unbounded_side():
    plan = shipped("two_sample_navigation", "fluent:(charge scout),lb=0")
    result = envelope(plan, method="optimal", timeout=30)
    assert result.box["charge_scout"].upper is None
    assert result.bound is None


def test_out_of_time_is_said():
    result = envelope(shipped("generator"), method="optimal", timeout=0)
    assert (result.status, result.verified) == (Status.TIMEOUT, False)


def test_options_of_other_methods():
    with pytest.raises(InputError, match=r"order: found it with method=.optimal., expected method=.widen. or .irr."):
        envelope(shipped("generator"), method="optimal", order=["start_1"])


@drawn(12)
@given(parametric())
def test_no_other_box_is_wider(plan):
    best = searched(plan, "optimal")
    around = searched(plan, "optimal", contain_nominal=True)
    if best is None:
        return
    containment = Containment(RelationalEncoding(plan))
    assert containment.refute(best.box, Deadline()) is None
    width = weighted(plan, best.box)
    others = [searched(plan, "widen"), searched(plan, "irr"), around]
    for other in others:
        if other is None:
            continue
        assert containment.refute(other.box, Deadline()) is None
        own = weighted(plan, other.box)
        if width is not None:
            assert own is not None
            # An optimum that is only approached is given up to a millionth.
            assert width >= own - max(own, Fraction(1)) / 10**6
            assert best.bound is None or best.bound >= own
    if around is not None:
        assert plan.nominal in around.box
