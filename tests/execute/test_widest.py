"""The widest boxes that a dispatcher can serve: by hand, beside shrinking, and face by face with other means."""

from fractions import Fraction
from functools import cache
from itertools import product
from random import Random

import pytest

from robust.api import envelope
from robust.execute.controllability import Control, Controllability, ControlVerdict, Objective, shrink, widest
from robust.qe.box import Box, Side
from tests.encode.asking import Judge
from tests.execute import plans
from tests.execute.plans import EPSILON, box_of, interval

F = Fraction
GROWN = Objective(EPSILON, "relational")
AROUND = Objective(EPSILON, "relational", optimal=True, contain_nominal=True)
ANYWHERE = Objective(EPSILON, "relational", optimal=True)
KINDS = pytest.mark.parametrize("kind", [Control.DYNAMIC, Control.STRONG], ids=lambda kind: kind.value)


@cache
def overlapping():
    """The second task must start from 1 to 2 before the first one ends; the third comes after it, and ends by 30."""
    constraints = (
        "w1.end - w2.start in [1, 2]",
        "w2.end - w2.start in [4, 4]",
        "w3.end - w3.start in [third, third]",
        "w3.start - w1.end in [0.001, inf]",
        "w3.end - .zero in [0, 30]",
    )
    text = "parameter third default 5;" + plans.working(*constraints, on="abc")
    return plans.tasks(text, problem=plans.nothing_else("abc"))


def test_what_one_parameter_gives_back_another_one_takes():
    plan = overlapping()
    box = envelope(plan).box
    assert box["third"] == interval("[1, 24999/2000]")
    shrunk = shrink(plan, box, Control.DYNAMIC)
    assert shrunk["first"] == interval("[19/2, 21/2]")
    result = widest(plan, shrunk, Control.DYNAMIC, GROWN)
    assert result.box == box_of(first="[19/2, 21/2]", third="[1, 19499/1000]")
    assert {(face[0], face[1].value): stop.name.partition(":")[0] for face, stop in result.stops.items()} == {
        ("first", "lower"): "not dynamically controllable beyond",
        ("first", "upper"): "not dynamically controllable beyond",
        ("third", "lower"): "w3 work",
        ("third", "upper"): "not dynamically controllable beyond",
    }
    assert "w1.end - w2.start in [1, 2]" in result.stops["first", Side.UPPER].name


def test_the_widest_of_all_is_proved_by_cutting_planes():
    plan = overlapping()
    start = Box.nominal(plan.parameters)
    around, anywhere = (widest(plan, start, Control.DYNAMIC, objective) for objective in (AROUND, ANYWHERE))
    assert around.box == box_of(first="[9, 10]", third="[1, 19999/1000]")
    # what is certain of the first is all for the third
    assert anywhere.box == box_of(first="[1, 1]", third="[1, 28999/1000]")
    assert (around.bound, anywhere.bound) == (F(19999, 1000), F(27999, 1000))


@KINDS
@pytest.mark.parametrize("plan", plans.PLANS, ids=lambda plan: plan[3])
def test_it_is_nowhere_narrower_than_what_shrinking_leaves(plan, kind):
    loaded = plans.with_box(*plan)
    shrunk = shrink(loaded.plan, loaded.box, kind)
    box = widest(loaded.plan, shrunk, kind, GROWN).box
    assert all(part.is_within(box[name]) for name, part in shrunk.intervals.items())
    if (plan[3], kind) == ("plan-yield", Control.STRONG):
        assert (shrunk.total_width, box.total_width) == (F(35, 18), F(7, 3))


def stands(judge, box, kind):
    """Whether a box is in the envelope and controllable, asked of what widening does not use."""
    return judge.contains(box) and Controllability(judge.plan, box).finding(kind).verdict is ControlVerdict.CONTROLLABLE


@KINDS
@pytest.mark.parametrize("seed", [*range(10), *(pytest.param(n, marks=pytest.mark.slow) for n in range(10, 60))])
def test_no_face_can_move_outwards(seed, kind):
    plan, valid = plans.drawn_with_box(Random(f"widest {seed}"))  # noqa: S311 - reproducible
    shrunk = shrink(plan, valid, kind)
    result = widest(plan, shrunk, kind, GROWN)
    box, judge = result.box, Judge(plan, EPSILON)
    assert all(part.is_within(box[name]) for name, part in shrunk.intervals.items())
    assert stands(judge, box, kind)
    for (name, side), stop in result.stops.items():
        assert stop.name
        end = box[name].end(side)
        assert not stands(judge, box.moved((name, side), end + side.sign * F(1, 10**6)), kind), (name, side, stop)
    best = widest(plan, shrunk, kind, AROUND)
    assert stands(judge, best.box, kind)
    if None not in {box.total_width, best.box.total_width}:
        assert best.box.total_width >= box.total_width


@KINDS
def test_no_box_on_a_grid_is_wider_than_the_widest(kind):
    """All boxes around the nominal point whose ends are integers, of a plan with two parameters."""
    plan = overlapping()
    best = widest(plan, Box.nominal(plan.parameters), kind, AROUND).bound
    judge = Judge(plan, EPSILON)
    tried = 0
    for low, high, least, most in product((8, 9, 10), (10, 11, 12), (1, 3, 5), range(5, 22, 2)):
        box = box_of(first=(low, high), third=(least, most))
        if box.total_width > best:
            tried += 1
            assert not stands(judge, box, kind), box
    assert tried > 3
