"""The robot delivery domain: problems as in the paper, plans that are valid, envelopes that mean something."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import hypot
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robust
from benchmarks.generators import delivery
from robust.api import envelope
from robust.errors import InputError
from robust.execute.convert import check_plan, convert
from robust.execute.distances import InvalidPlanError
from robust.execute.planners.interface import check
from robust.irr.check import Answer
from robust.plan.load import load_plan
from robust.plan.model import Fluent
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.timed import TimedPlan, parse_timed_plan
from robust.smt.limits import Deadline
from tests.execute.planner_delivery import FIRST_ORDER, SECOND_ORDER

EPSILON = Fraction(1, 1000)


def first_problem(variant=delivery.DeliveryVariant.DURATIONS, **options):
    """The domain, and the first problem of the tables."""
    domain = parse_domain(delivery.delivery_domain(variant))
    return domain, parse_problem(delivery.table_problems(variant, **options)[0].text, domain)


def converted(steps, specs, domain, problem):
    return convert(domain, problem, parse_timed_plan(steps), specs=parse_specs(specs))


@pytest.mark.parametrize("variant", delivery.DeliveryVariant)
def test_the_hundred_problems(variant):
    problems = delivery.table_problems(variant)
    assert len({one.name for one in problems}) == len({one.deadlines for one in problems}) == 100
    domain = parse_domain(delivery.delivery_domain(variant))
    for one in (problems[0], problems[57], problems[99]):
        problem = parse_problem(one.text, domain)
        assert {literal.time for literal in problem.timed_literals} == set(one.deadlines)
        assert Fluent("distance", ("shelf", "base_station")) in problem.fluents
        assert (Fluent("battery", ("robot1",)) in problem.fluents) is (variant is delivery.DeliveryVariant.BATTERY)


def test_deadlines_are_half_normal_quantiles():
    """Against tabulated quantiles of the normal distribution."""
    problems = delivery.table_problems()
    assert problems[0].deadlines == (416 + Fraction("4.389"), 731 + Fraction("8.779"))  # 0.0627068 σ
    assert problems[-1].deadlines == (416 + Fraction("137.197"), 731 + Fraction("274.395"))  # 1.9599640 σ
    assert problems[1].deadlines[0] == problems[0].deadlines[0] < problems[10].deadlines[0]


@pytest.mark.parametrize(("steps", "deadline"), [(FIRST_ORDER, 416), (SECOND_ORDER, 731)])
def test_plans_just_meet_their_deadlines(steps, deadline):
    """The nominal plan the first one, and the plan for the other order after disposal the second one."""
    plan = parse_timed_plan(steps)
    check(plan, *first_problem(), EPSILON)
    assert deadline - 3 < max(step.time + (step.duration or 0) for step in plan.steps) < deadline


def test_the_battery_decides():
    """The nominal plan takes what its actions take, and is invalid with any less."""
    plan = parse_timed_plan(FIRST_ORDER)
    names = {"move": "moving", "collect": "collecting", "assemble": "assembling", "mount": "mounting"}
    names |= {"deliver": "delivering", **{f"prepare_{step}": step for step in delivery.PREPARATIONS}}
    need = sum(delivery.TASKS[names[step.action]] for step in plan.steps)
    check(plan, *first_problem(delivery.DeliveryVariant.BATTERY, battery=need), EPSILON)
    with pytest.raises(InvalidPlanError, match="battery"):
        check(plan, *first_problem(delivery.DeliveryVariant.BATTERY, battery=need - Fraction(1, 2)), EPSILON)


def test_a_window_that_has_closed():
    steps = parse_timed_plan(FIRST_ORDER).steps
    late = tuple(one if one.action != "deliver" else replace(one, time=Fraction(397)) for one in steps)
    with pytest.raises(InvalidPlanError, match=r"over all \(window_open order1\)"):
        check(TimedPlan(late), *first_problem(), EPSILON)


def test_everything_uncertain_is_a_parameter_of_its_own():
    """Each preparation time by the duration of its action, and each consumption by its fluent."""
    specs = [f"duration:{delivery.preparation_action(step)}" for step in delivery.PREPARATIONS]
    specs += [f"fluent:(battery_use {task})" for task in delivery.TASKS if task != "disposing"]
    conversion = converted(FIRST_ORDER, specs, *first_problem(delivery.DeliveryVariant.BATTERY))
    assert conversion.check.answer is Answer.PROVED
    assert len(conversion.plan.parameters) == 6 + 11


def test_the_box_of_a_nominal_plan_is_bounded_by_the_window():
    specs = ["long=duration:prepare_step6", "short=duration:prepare_step1"]
    found = envelope(converted(FIRST_ORDER, specs, *first_problem()).plan)
    upper = [found.box.intervals[name].upper for name in ("short", "long")]
    slack = Fraction("420.389") - 414 - EPSILON  # one separation is needed
    assert upper == [170 + slack, 170 + slack]


def test_the_box_of_consumption_is_bounded_by_the_battery():
    specs = ["fluent:(battery_use moving),lb=0"]
    found = envelope(converted(FIRST_ORDER, specs, *first_problem(delivery.DeliveryVariant.BATTERY)).plan)
    spent = sum(delivery.TASKS.values()) - delivery.TASKS["disposing"] - delivery.TASKS["moving"]
    interval = found.box.intervals["battery_use_moving"]
    assert (interval.lower, interval.upper) == (0, (360 - spent) / 4)


# -- scaling -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("parameters", range(1, 34))
def test_scaling_instances_have_valid_plans_and_so_many_parameters(parameters):
    instance = delivery.scaling_instance(parameters, seed=1)
    domain = parse_domain(instance.domain)
    plan = parse_timed_plan(instance.plan)
    check(plan, domain, parse_problem(instance.problem, domain), EPSILON)
    chosen = {spec.removeprefix("duration:") for spec in instance.specs}
    assert sum(step.action in chosen for step in plan.steps) == parameters


@pytest.mark.parametrize("parameters", [2, 7, 12])
def test_scaling_instances_convert_and_have_bounded_boxes(parameters):
    instance = delivery.scaling_instance(parameters, seed=2)
    domain = parse_domain(instance.domain)
    conversion = converted(instance.plan, instance.specs, domain, parse_problem(instance.problem, domain))
    assert conversion.check.answer is Answer.PROVED
    found = envelope(conversion.plan)
    assert len(found.box.intervals) == parameters
    for parameter in conversion.plan.parameters:
        interval = found.box.intervals[parameter.name]
        assert interval.upper is not None
        assert parameter.nominal < interval.upper


def test_the_same_seed_gives_the_same_instance():
    assert delivery.scaling_instance(20, 3) == delivery.scaling_instance(20, 3) != delivery.scaling_instance(20, 4)
    options = delivery.DeliveryOptions(
        delivery.DeliveryVariant.BATTERY, (delivery.Order(2, Fraction(900)), delivery.Order(1)), robots=2
    )
    assert (
        delivery.delivery_problem(options, 5)
        == delivery.delivery_problem(options, 5)
        != delivery.delivery_problem(options, 6)
    )


def test_the_shipped_example_is_generated_and_proved():
    folder = Path(robust.__file__).parent / "examples/delivery"
    first = delivery.table_problems()[0]
    assert (folder / "domain.pddl").read_text(encoding="utf-8") == delivery.delivery_domain(
        delivery.DeliveryVariant.DURATIONS
    )
    assert (folder / "problem.pddl").read_text(encoding="utf-8") == first.text
    assert (folder / "steps.plan").read_text(encoding="utf-8") == FIRST_ORDER
    parameters = folder / "plan.toml"
    plan = load_plan(folder / "domain.pddl", folder / "problem.pddl", folder / "plan.stn", parameter_file=parameters)
    assert len(plan.parameters) == 6
    assert check_plan(plan, EPSILON, "z3", Deadline()).answer is Answer.PROVED


# -- options -----------------------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 2**32), orders=st.integers(1, 5), robots=st.integers(1, 3))
@settings(max_examples=30)
def test_random_places(seed, orders, robots):
    options = delivery.DeliveryOptions(delivery.DeliveryVariant.DURATIONS, (delivery.Order(1),) * orders, robots=robots)
    where = delivery.places(options, seed)
    assert set(where) == set(options.place_names)
    points = list(where.values())
    assert len(set(points)) == len(points)
    for a in points:
        for b in points:
            assert 0 <= delivery.distance(a, b) - hypot(a[0] - b[0], a[1] - b[1]) < 1
            assert all(delivery.distance(a, b) <= delivery.distance(a, c) + delivery.distance(c, b) for c in points)


@pytest.mark.parametrize(
    "make",
    [
        lambda: delivery.Order(4),
        lambda: delivery.Order(1, Fraction(0)),
        lambda: delivery.Order(1, steps=7),
        lambda: delivery.DeliveryOptions(delivery.DeliveryVariant.DURATIONS, ()),
        lambda: delivery.DeliveryOptions(delivery.DeliveryVariant.DURATIONS, (delivery.Order(1),), robots=0),
        lambda: delivery.DeliveryOptions(delivery.DeliveryVariant.DURATIONS, (delivery.Order(1),), spindles=0),
        lambda: delivery.DeliveryOptions(
            delivery.DeliveryVariant.DURATIONS, (delivery.Order(1),), battery=Fraction(-1)
        ),
        lambda: delivery.DeliveryOptions(
            delivery.DeliveryVariant.DURATIONS, (delivery.Order(1),), places={"cellar": (0, 0)}
        ),
        lambda: delivery.scaling_instance(0, 1),
        lambda: delivery.scaling_instance(1001, 1),
    ],
)
def test_impossible_options(make):
    with pytest.raises(InputError, match=r"found .*expected"):
        make()
