"""The robot delivery domain: problems as in the paper, plans that are valid, envelopes that mean something."""

from fractions import Fraction
from itertools import product
from math import hypot
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robust
from benchmarks.generators import delivery
from benchmarks.generators.delivery import DeliveryOptions, DeliveryVariant, Order
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
from robust.plan.timed import parse_timed_plan
from robust.smt.limits import Deadline
from tests.execute.plans import EPSILON, FIRST_ORDER

DURATIONS, BATTERY = DeliveryVariant.DURATIONS, DeliveryVariant.BATTERY


def first_problem(variant=DURATIONS, **options):
    """The domain, and the first problem of the tables."""
    domain = parse_domain(delivery.delivery_domain(variant))
    return domain, parse_problem(delivery.table_problems(variant, **options)[0].text, domain)


def converted(steps, specs, domain, problem):
    conversion = convert(domain, problem, parse_timed_plan(steps), specs=parse_specs(specs))
    assert conversion.check.answer is Answer.PROVED
    return conversion.plan


@pytest.mark.parametrize("variant", DeliveryVariant)
def test_the_hundred_problems(variant):
    problems = delivery.table_problems(variant)
    assert len({entry.name for entry in problems}) == len({entry.deadlines for entry in problems}) == 100
    domain = parse_domain(delivery.delivery_domain(variant))
    for entry in (problems[0], problems[57], problems[99]):
        problem = parse_problem(entry.text, domain)
        assert {literal.time for literal in problem.timed_literals} == set(entry.deadlines)
        assert Fluent("distance", ("shelf", "base_station")) in problem.fluents
        assert (Fluent("battery", ("robot1",)) in problem.fluents) is (variant is BATTERY)


def test_deadlines_are_half_normal_quantiles():
    """Against tabulated quantiles of the normal distribution."""
    problems = delivery.table_problems()
    assert problems[0].deadlines == (416 + Fraction("4.389"), 731 + Fraction("8.779"))  # 0.0627068 σ
    assert problems[-1].deadlines == (416 + Fraction("137.197"), 731 + Fraction("274.395"))  # 1.9599640 σ
    assert problems[1].deadlines[0] == problems[0].deadlines[0] < problems[10].deadlines[0]


def test_the_nominal_plan_just_meets_its_deadline_and_its_battery_decides():
    """It takes what its actions take, and is invalid with any less."""
    plan = parse_timed_plan(FIRST_ORDER)
    check(plan, *first_problem(), EPSILON)
    assert 413 < max(step.time + (step.duration or 0) for step in plan.steps) < 416
    names = {"move": "moving", "collect": "collecting", "assemble": "assembling", "mount": "mounting"}
    names |= {"deliver": "delivering", **{f"prepare_{step}": step for step in delivery.PREPARATIONS}}
    need = sum(delivery.TASKS[names[step.action]] for step in plan.steps)
    check(plan, *first_problem(BATTERY, battery=need), EPSILON)
    with pytest.raises(InvalidPlanError, match="battery"):
        check(plan, *first_problem(BATTERY, battery=need - Fraction(1, 2)), EPSILON)


def test_everything_uncertain_is_a_parameter_of_its_own():
    """Each preparation time by the duration of its action, and each consumption by its fluent."""
    specs = [f"duration:{delivery.preparation_action(step)}" for step in delivery.PREPARATIONS]
    specs += [f"fluent:(battery_use {task})" for task in delivery.TASKS if task != "disposing"]
    assert len(converted(FIRST_ORDER, specs, *first_problem(BATTERY)).parameters) == 6 + 11


def test_the_boxes_of_a_nominal_plan_are_bounded_by_the_window_and_by_the_battery():
    specs = ["long=duration:prepare_step6", "short=duration:prepare_step1"]
    box = envelope(converted(FIRST_ORDER, specs, *first_problem())).box
    most = 170 + Fraction("420.389") - 414 - EPSILON  # one separation is needed
    assert [box[name].upper for name in ("short", "long")] == [most, most]
    plan = converted(FIRST_ORDER, ["fluent:(battery_use moving),lb=0"], *first_problem(BATTERY))
    moving = envelope(plan).box["battery_use_moving"]
    spent = sum(delivery.TASKS.values()) - delivery.TASKS["disposing"] - delivery.TASKS["moving"]
    assert (moving.lower, moving.upper) == (0, (360 - spent) / 4)


def test_scaling_instances_have_valid_plans_and_the_parameters_that_were_asked_for():
    for parameters in range(1, 34):
        instance = delivery.scaling_instance(parameters, seed=1)
        domain = parse_domain(instance.domain)
        steps, problem = parse_timed_plan(instance.plan), parse_problem(instance.problem, domain)
        check(steps, domain, problem, EPSILON)
        chosen = {spec.removeprefix("duration:") for spec in instance.specs}
        assert sum(step.action in chosen for step in steps.steps) == parameters
        if parameters in {2, 7, 12}:
            plan = converted(instance.plan, instance.specs, domain, problem)
            box = envelope(plan).box
            assert len(box.intervals) == len(plan.nominal) == parameters
            assert all(plan.nominal[name] < interval.upper for name, interval in box.intervals.items())


def test_the_same_seed_gives_the_same_instance():
    assert delivery.scaling_instance(20, 3) == delivery.scaling_instance(20, 3) != delivery.scaling_instance(20, 4)
    options = DeliveryOptions(BATTERY, (Order(2, Fraction(900)), Order(1)), robots=2)
    first, same, other = (delivery.delivery_problem(options, seed) for seed in (5, 5, 6))
    assert first == same != other


def test_the_shipped_example_is_generated_and_proved():
    folder = Path(robust.__file__).parent / "examples/delivery"
    files = [folder / name for name in ("domain.pddl", "problem.pddl", "plan.stn")]
    for file, text in zip(
        files, (delivery.delivery_domain(DURATIONS), delivery.table_problems()[0].text), strict=False
    ):
        assert "".join(file.read_text(encoding="utf-8").split()) == "".join(text.split())  # but for white space
    plan = load_plan(*files, parameter_file=folder / "plan.toml")
    assert len(plan.parameters) == 6
    assert check_plan(plan, EPSILON, "z3", Deadline()).answer is Answer.PROVED


@given(seed=st.integers(0, 2**32), orders=st.integers(1, 5), robots=st.integers(1, 3))
@settings(max_examples=30)
def test_random_places(seed, orders, robots):
    options = DeliveryOptions(DURATIONS, (Order(1),) * orders, robots=robots)
    where = delivery.places(options, seed)
    assert set(where) == set(options.place_names)
    points = list(where.values())
    assert len(set(points)) == len(points)
    for a, b in product(points, repeat=2):
        assert 0 <= delivery.distance(a, b) - hypot(a[0] - b[0], a[1] - b[1]) < 1
        assert all(delivery.distance(a, b) <= delivery.distance(a, c) + delivery.distance(c, b) for c in points)


IMPOSSIBLE = {
    Order: [{"rings": 4}, {"rings": 1, "deadline": Fraction(0)}, {"rings": 1, "steps": 7}],
    DeliveryOptions: [
        {"variant": DURATIONS, "orders": (Order(1),), **wrong}
        for wrong in ({"orders": ()}, {"robots": 0}, {"spindles": 0}, {"battery": -1}, {"places": {"cellar": (0, 0)}})
    ],
    delivery.scaling_instance: [{"parameters": 0, "seed": 1}, {"parameters": 1001, "seed": 1}],
}


@pytest.mark.parametrize("make", IMPOSSIBLE)
def test_impossible_options(make):
    for options in IMPOSSIBLE[make]:
        with pytest.raises(InputError, match=r"found .*expected"):
            make(**options)
