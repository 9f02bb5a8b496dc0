"""The robot delivery domain: problems as in the paper, plans that are valid, envelopes that mean something."""

from __future__ import annotations

from fractions import Fraction
from math import hypot
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robust
from robust.api import envelope
from robust.errors import InputError
from robust.execute.convert import check_plan, convert
from robust.execute.delivery import (
    PREPARATIONS,
    TASKS,
    DeliveryOptions,
    DeliveryVariant,
    Order,
    delivery_domain,
    delivery_problem,
    scaling_instance,
    table_problems,
)
from robust.execute.delivery.domain import preparation_action
from robust.execute.delivery.problem import distance, places
from robust.execute.distances import InvalidPlanError
from robust.execute.planners.interface import check, checked_plan
from robust.irr.check import Answer
from robust.plan.load import load_plan
from robust.plan.model import Fluent
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.timed import TimedPlan, parse_timed_plan
from robust.smt.limits import Deadline
from tests.execute.planner_delivery import FIRST_ORDER, SECOND_ORDER

EPSILON = Fraction(1, 1000)


@pytest.mark.parametrize("variant", DeliveryVariant)
def test_the_hundred_problems(variant):
    problems = table_problems(variant)
    assert len({one.name for one in problems}) == len({one.deadlines for one in problems}) == 100
    domain = parse_domain(delivery_domain(variant))
    for one in (problems[0], problems[57], problems[99]):
        problem = parse_problem(one.text, domain)
        assert {literal.time for literal in problem.timed_literals} == set(one.deadlines)
        assert Fluent("distance", ("shelf", "base_station")) in problem.fluents
        assert (Fluent("battery", ("robot1",)) in problem.fluents) is (variant is DeliveryVariant.BATTERY)


def test_deadlines_are_half_normal_quantiles():
    """Against tabulated quantiles of the normal distribution."""
    problems = table_problems()
    assert problems[0].deadlines == (416 + Fraction("4.389"), 731 + Fraction("8.779"))  # 0.0627068 σ
    assert problems[-1].deadlines == (416 + Fraction("137.197"), 731 + Fraction("274.395"))  # 1.9599640 σ
    assert problems[1].deadlines[0] == problems[0].deadlines[0] < problems[10].deadlines[0]


def test_the_nominal_plan_just_meets_the_first_deadline():
    domain = parse_domain(delivery_domain(DeliveryVariant.DURATIONS))
    problem = parse_problem(table_problems()[0].text, domain)
    plan = checked_plan(FIRST_ORDER, domain, problem, EPSILON, "hand")
    assert 413 < max(step.time + (step.duration or 0) for step in plan.steps) < 416


def test_the_other_order_after_disposal_just_meets_the_second_deadline():
    domain = parse_domain(delivery_domain(DeliveryVariant.DURATIONS))
    problem = parse_problem(table_problems()[0].text, domain)
    plan = checked_plan(SECOND_ORDER, domain, problem, EPSILON, "hand")
    assert 728 < max(step.time + (step.duration or 0) for step in plan.steps) < 731


def test_the_battery_decides():
    """The nominal plan takes what its actions take, and is invalid with any less."""
    domain = parse_domain(delivery_domain(DeliveryVariant.BATTERY))
    plan = parse_timed_plan(FIRST_ORDER)
    names = {"move": "moving", "collect": "collecting", "assemble": "assembling", "mount": "mounting"}
    names |= {"deliver": "delivering", **{f"prepare_{step}": step for step in PREPARATIONS}}
    need = sum(TASKS[names[step.action]] for step in plan.steps)
    for charge in (need, need - Fraction(1, 2)):
        text = table_problems(DeliveryVariant.BATTERY, battery=charge)[0].text
        problem = parse_problem(text, domain)
        if charge == need:
            check(plan, domain, problem, EPSILON)
        else:
            with pytest.raises(InvalidPlanError, match="battery"):
                check(plan, domain, problem, EPSILON)


def test_a_window_that_has_closed():
    domain = parse_domain(delivery_domain(DeliveryVariant.DURATIONS))
    problem = parse_problem(table_problems()[0].text, domain)
    steps = parse_timed_plan(FIRST_ORDER).steps
    late = tuple(one if one.action != "deliver" else type(one)(Fraction(397), *_rest(one)) for one in steps)
    with pytest.raises(InvalidPlanError, match=r"over all \(window_open order1\)"):
        check(TimedPlan(late), domain, problem, EPSILON)


def _rest(step):
    return step.action, step.arguments, step.duration


def test_everything_uncertain_is_a_parameter_of_its_own():
    """Each preparation time by the duration of its action, and each consumption by its fluent."""
    domain = parse_domain(delivery_domain(DeliveryVariant.BATTERY))
    problem = parse_problem(table_problems(DeliveryVariant.BATTERY)[0].text, domain)
    plan = parse_timed_plan(FIRST_ORDER)
    specs = [f"duration:{preparation_action(step)}" for step in PREPARATIONS]
    specs += [f"fluent:(battery_use {task})" for task in TASKS if task != "disposing"]
    conversion = convert(domain, problem, plan, specs=parse_specs(specs))
    assert conversion.check.answer is Answer.PROVED
    assert len(conversion.plan.parameters) == 6 + 11


def test_the_box_of_a_nominal_plan_is_bounded_by_the_window():
    domain = parse_domain(delivery_domain(DeliveryVariant.DURATIONS))
    problem = parse_problem(table_problems()[0].text, domain)
    specs = parse_specs(["long=duration:prepare_step6", "short=duration:prepare_step1"])
    conversion = convert(domain, problem, parse_timed_plan(FIRST_ORDER), specs=specs)
    found = envelope(conversion.plan)
    upper = [found.box.intervals[name].upper for name in ("short", "long")]
    slack = Fraction("420.389") - 414 - EPSILON  # one separation is needed
    assert upper == [170 + slack, 170 + slack]


def test_the_box_of_consumption_is_bounded_by_the_battery():
    domain = parse_domain(delivery_domain(DeliveryVariant.BATTERY))
    problem = parse_problem(table_problems(DeliveryVariant.BATTERY)[0].text, domain)
    conversion = convert(
        domain, problem, parse_timed_plan(FIRST_ORDER), specs=parse_specs(["fluent:(battery_use moving),lb=0"])
    )
    found = envelope(conversion.plan)
    spent = sum(TASKS.values()) - TASKS["disposing"] - TASKS["moving"]
    interval = found.box.intervals["battery_use_moving"]
    assert (interval.lower, interval.upper) == (0, (360 - spent) / 4)


# -- scaling -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("parameters", range(1, 34))
def test_scaling_instances_have_valid_plans_and_so_many_parameters(parameters):
    instance = scaling_instance(parameters, seed=1)
    domain = parse_domain(instance.domain)
    problem = parse_problem(instance.problem, domain)
    plan = checked_plan(instance.plan, domain, problem, EPSILON, "scheduler")
    chosen = {spec.removeprefix("duration:") for spec in instance.specs}
    assert sum(step.action in chosen for step in plan.steps) == parameters


@pytest.mark.parametrize("parameters", [2, 7, 12])
def test_scaling_instances_convert_and_have_bounded_boxes(parameters):
    instance = scaling_instance(parameters, seed=2)
    domain = parse_domain(instance.domain)
    problem = parse_problem(instance.problem, domain)
    conversion = convert(domain, problem, parse_timed_plan(instance.plan), specs=parse_specs(instance.specs))
    assert conversion.check.answer is Answer.PROVED
    found = envelope(conversion.plan)
    assert len(found.box.intervals) == parameters
    for parameter in conversion.plan.parameters:
        interval = found.box.intervals[parameter.name]
        assert interval.upper is not None
        assert parameter.nominal < interval.upper


def test_the_same_seed_gives_the_same_instance():
    assert scaling_instance(20, 3) == scaling_instance(20, 3) != scaling_instance(20, 4)
    options = DeliveryOptions(DeliveryVariant.BATTERY, (Order(2, Fraction(900)), Order(1)), robots=2)
    assert delivery_problem(options, 5) == delivery_problem(options, 5) != delivery_problem(options, 6)


def test_the_shipped_example_is_generated_and_proved():
    folder = Path(robust.__file__).parent / "examples/delivery"
    first = table_problems()[0]
    assert (folder / "domain.pddl").read_text(encoding="utf-8") == delivery_domain(DeliveryVariant.DURATIONS)
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
    options = DeliveryOptions(DeliveryVariant.DURATIONS, (Order(1),) * orders, robots=robots)
    where = places(options, seed)
    assert set(where) == set(options.place_names)
    points = list(where.values())
    assert len(set(points)) == len(points)
    for a in points:
        for b in points:
            assert 0 <= distance(a, b) - hypot(a[0] - b[0], a[1] - b[1]) < 1
            assert all(distance(a, b) <= distance(a, c) + distance(c, b) for c in points)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Order(4),
        lambda: Order(1, Fraction(0)),
        lambda: Order(1, steps=7),
        lambda: DeliveryOptions(DeliveryVariant.DURATIONS, ()),
        lambda: DeliveryOptions(DeliveryVariant.DURATIONS, (Order(1),), robots=0),
        lambda: DeliveryOptions(DeliveryVariant.DURATIONS, (Order(1),), spindles=0),
        lambda: DeliveryOptions(DeliveryVariant.DURATIONS, (Order(1),), battery=Fraction(-1)),
        lambda: DeliveryOptions(DeliveryVariant.DURATIONS, (Order(1),), places={"cellar": (0, 0)}),
        lambda: scaling_instance(0, 1),
        lambda: scaling_instance(1001, 1),
    ],
)
def test_impossible_options(make):
    with pytest.raises(InputError, match=r"found .*expected"):
        make()
