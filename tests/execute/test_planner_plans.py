"""What planners print for domains like those of the competitions: read, converted and proved, or refused, as VAL says.

The plans in `planner_plans` are small and valid, with the constructs of the domains after which they are named and the
layouts of many planners. The logs beside the repository are of planners on the competitions' own domains.
"""

import json
import os
import warnings
from dataclasses import replace
from fractions import Fraction
from functools import cache, partial
from itertools import product
from math import hypot
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robust
from benchmarks.generators import delivery
from benchmarks.generators.delivery import DeliveryOptions, DeliveryVariant, Order
from robust import Answer, Box, InputError, InputWarning, InvalidPlanError, envelope
from robust.execute.causal import check_plan
from robust.execute.convert import Settings, convert
from robust.execute.planners.interface import check
from robust.plan.load import assemble
from robust.plan.model import Fluent
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem, read_domain, read_problem
from robust.plan.stn import parse_stn, write_stn
from robust.plan.timed import parse_timed_plan, read_timed_plan
from robust.reading import load_plan
from robust.smt.limits import NEVER, Deadline
from tests.execute.plans import EPSILON, FIRST_ORDER, ROOT

PRINTED = Path(__file__).parent / "planner_plans"
STEPS = {"airport": 3, "crew": 5, "depots": 4, "driverlog": 4, "elevators": 3, "floor-tile": 4, "match-cellar": 3}
STEPS |= {"no-declarations": 4, "pipesworld": 2, "rich": 3, "roads": 4, "satellite": 6, "sokoban": 2, "tms": 3}
STEPS |= {"trucks": 4, "umts": 4, "untyped": 4, "zeno": 3}
"""How many steps the last plan of each log has."""
FOLDER = Path(os.environ.get("ROBUST_PLANNER_LOGS") or ROOT.parent / "shared" / "planner-logs")
LISTED = json.loads((FOLDER / "plans.json").read_text()) if (FOLDER / "plans.json").is_file() else []
LOGS = {entry["name"]: entry for entry in LISTED}
LONG = 100
REFUSED = {
    "map-analyzer-2014-3": ("separation: n4.start, n16.end", Fraction(0)),
    "map-analyzer-2014-5": ("n14 move_vehicle_road: at start (at_jun car3 junction0-1)", None),
    "map-analyzer-2014-7": ("n15 move_vehicle_road: at start (at_jun car0 junction0-1)", None),
}
"""The first obligation that breaks, and how far the time points of a separation are apart."""
needs_logs = pytest.mark.skipif(not LISTED, reason=f"no logs at {FOLDER}; set ROBUST_PLANNER_LOGS to run this test")


def named(*verdicts):
    """The logs with these verdicts of VAL; long ones are slow."""
    return [
        pytest.param(name, marks=[needs_logs, *([pytest.mark.slow] if entry["steps"] > LONG else [])])
        for name, entry in LOGS.items()
        if entry["val"] in verdicts
    ]


def read(name):
    """What a planner printed and what it is about."""
    files = [PRINTED / name / file for file in ("domain.pddl", "problem.pddl", "planner.log")]
    if name in LOGS:
        files = [FOLDER / LOGS[name][kind] for kind in ("domain", "problem", "log")]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if "storage" in name else "error", InputWarning)  # declares an object twice
        domain = read_domain(files[0])
        return domain, read_problem(files[1], domain), read_timed_plan(files[2])


@cache
def converted(name):
    given = read(name)
    return given, convert(*given)


@pytest.mark.parametrize("name", [*STEPS, *named("valid", "refused")])
def test_what_is_written_is_proved_again(name):
    """At the printed times, but for rounding: by a unit of the last digit at most, not at all if that is enough."""
    given, conversion = converted(name)
    domain, problem, timed = given
    assert len(conversion.plan.instances) == len(timed.steps) == (LOGS[name]["steps"] if name in LOGS else STEPS[name])
    assert (conversion.check.answer, conversion.cut_short) == (Answer.PROVED, False)
    assert robust.validate(*given).valid
    again = check_plan(assemble(domain, problem, parse_stn(write_stn(conversion.stn))), EPSILON, "z3", NEVER)
    assert again.answer is Answer.PROVED
    if name in LOGS:
        assert again.settled == len(again.obligations), "paths prove what has neither parameters nor continuous change"
    times, moved, starts = conversion.schedule, Fraction(0), []
    for step, instance, units in zip(timed.steps, conversion.plan.instances, timed.units, strict=True):
        starts.append((step.time, times[instance.start]))
        changes = [times[instance.start] - step.time]
        if instance.durative:
            changes.append(times[instance.end] - times[instance.start] - (step.duration or 0))
        assert all(abs(change) <= min(unit, EPSILON) for change, unit in zip(changes, units, strict=False))
        moved = max(moved, *map(abs, changes))
    assert conversion.snapped.shift == moved
    assert all(a[1] <= b[1] for a in starts for b in starts if a[0] < b[0] - EPSILON)


@pytest.mark.parametrize("name", named("invalid"))
def test_invalid_plans_are_refused_with_what_breaks(name):
    given, (obligation, apart) = read(name), REFUSED[name]
    with pytest.raises(InvalidPlanError) as refused:
        convert(*given)
    assert min(refused.value.violations, key=lambda violation: violation.time).obligation == obligation
    assert obligation in str(refused.value)
    assert not robust.validate(*given).valid
    if apart is not None:
        assert f"are {apart} apart, less than 0.001" in str(refused.value)
        assert "starts would have to move by up to 0.0005, which --tolerance 0.0005 allows" in str(refused.value)


def bounds(plan):
    """Each side of each constraint by itself."""
    sides = [side for both in plan.constraints for side in (replace(both, upper=None), replace(both, lower=None))]
    return [side for side in sides if side.lower is not None or side.upper is not None]


def test_no_bound_can_be_left_out():
    every = [(name, bound) for name in STEPS for bound in bounds(converted(name)[1].plan)]
    for name, bound in Random(14).sample(every, 20):  # noqa: S311 (not for secrets)
        plan = converted(name)[1].plan
        rest = tuple(other for other in bounds(plan) if other != bound)
        result = check_plan(replace(plan, constraints=rest), EPSILON, "z3", NEVER)
        assert result.answer is Answer.REFUTED, (name, bound)
        for broken in result.counterexamples.values():
            assert broken.obligation in {violation.obligation for violation in broken.simulation.violations}


DURATIONS, BATTERY = DeliveryVariant.DURATIONS, DeliveryVariant.BATTERY


def first_problem(variant=DURATIONS, **options):
    """The domain, and the first problem of the tables."""
    domain = parse_domain(delivery.delivery_domain(variant))
    return domain, parse_problem(delivery.table_problems(variant, **options)[0].text, domain)


def conversion_of(steps, specs, domain, problem):
    conversion = convert(domain, problem, parse_timed_plan(steps), Settings(specs=parse_specs(specs)))
    assert conversion.check.answer is Answer.PROVED
    return conversion.plan


@pytest.mark.parametrize("variant", DeliveryVariant)
def test_the_hundred_problems_have_deadlines_at_half_normal_quantiles(variant):
    """Against tabulated quantiles of the normal distribution."""
    problems = delivery.table_problems(variant)
    assert len({entry.name for entry in problems}) == len({entry.deadlines for entry in problems}) == 100
    domain = parse_domain(delivery.delivery_domain(variant))
    for entry in (problems[0], problems[57], problems[99]):
        problem = parse_problem(entry.text, domain)
        assert {literal.time for literal in problem.timed_literals} == set(entry.deadlines)
        assert Fluent("distance", ("shelf", "base_station")) in problem.fluents
        assert (Fluent("battery", ("robot1",)) in problem.fluents) is (variant is BATTERY)
    assert problems[0].deadlines == (416 + Fraction("4.389"), 731 + Fraction("8.779"))  # 0.0627068 σ
    assert problems[-1].deadlines == (416 + Fraction("137.197"), 731 + Fraction("274.395"))  # 1.9599640 σ
    assert problems[1].deadlines[0] == problems[0].deadlines[0] < problems[10].deadlines[0]


def test_the_nominal_plan_just_meets_its_deadline_and_its_battery_decides():
    plan = parse_timed_plan(FIRST_ORDER)
    check(plan, *first_problem(), EPSILON)
    assert 413 < max(step.time + (step.duration or 0) for step in plan.steps) < 416
    names = {"move": "moving", "collect": "collecting", "assemble": "assembling", "mount": "mounting"}
    names |= {"deliver": "delivering", **{f"prepare_{step}": step for step in delivery.PREPARATIONS}}
    need = sum(delivery.TASKS[names[step.action]] for step in plan.steps)
    check(plan, *first_problem(BATTERY, battery=need), EPSILON)
    with pytest.raises(InvalidPlanError, match="battery"):
        check(plan, *first_problem(BATTERY, battery=need - Fraction(1, 2)), EPSILON)


def test_the_boxes_of_a_nominal_plan_are_bounded_by_the_window_and_by_the_battery():
    specs = ["long=duration:prepare_step6", "short=duration:prepare_step1"]
    box = envelope(conversion_of(FIRST_ORDER, specs, *first_problem())).box
    most = 170 + Fraction("420.389") - 414 - EPSILON  # one separation is needed
    assert [box[name].upper for name in ("short", "long")] == [most, most]
    plan = conversion_of(FIRST_ORDER, ["fluent:(battery_use moving),lb=0"], *first_problem(BATTERY))
    moving = envelope(plan).box["battery_use_moving"]
    spent = sum(delivery.TASKS.values()) - delivery.TASKS["disposing"] - delivery.TASKS["moving"]
    assert (moving.lower, moving.upper) == (0, (360 - spent) / 4)
    # everything uncertain is a parameter of its own: preparation times and consumptions
    specs = [f"duration:{delivery.preparation_action(step)}" for step in delivery.PREPARATIONS]
    specs += [f"fluent:(battery_use {task})" for task in delivery.TASKS if task != "disposing"]
    assert len(conversion_of(FIRST_ORDER, specs, *first_problem(BATTERY)).parameters) == 6 + 11


def test_scaling_instances_have_valid_plans_and_the_parameters_that_were_asked_for():
    for parameters in range(1, 34):
        instance = delivery.scaling_instance(parameters, seed=1)
        domain = parse_domain(instance.domain)
        steps, problem = parse_timed_plan(instance.plan), parse_problem(instance.problem, domain)
        check(steps, domain, problem, EPSILON)
        chosen = {spec.removeprefix("duration:") for spec in instance.specs}
        assert sum(step.action in chosen for step in steps.steps) == parameters
        if parameters in {2, 7, 12}:
            plan = conversion_of(instance.plan, instance.specs, domain, problem)
            box = envelope(plan).box
            assert len(box.intervals) == len(plan.nominal) == parameters
            assert all(plan.nominal[name] < interval.upper for name, interval in box.intervals.items())


def test_the_same_seed_gives_the_same_instance():
    options = DeliveryOptions(BATTERY, (Order(2, Fraction(900)), Order(1)), robots=2)
    for make in (partial(delivery.scaling_instance, 20), partial(delivery.delivery_problem, options)):
        assert make(5) == make(5) != make(6)


def test_the_shipped_example_is_generated_and_proved():
    folder = Path(robust.__file__).parent / "examples/delivery"
    files = [folder / name for name in ("domain.pddl", "problem.pddl", "plan.stn")]
    texts = delivery.delivery_domain(DURATIONS), delivery.table_problems()[0].text
    for file, text in zip(files, texts, strict=False):  # but for white space
        assert file.read_text(encoding="utf-8").split() == text.split()
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


@pytest.mark.parametrize("name", ["crew", "satellite", "elevators", "driverlog"])
def test_durations_that_are_parameters_leave_nothing_more_to_solvers(name, monkeypatch):
    """Values are proved as numbers, and what would help with an unknown name is looked for only if one is unknown."""
    monkeypatch.setattr("robust.plan.timeline.did_you_mean", None)
    given, plain = converted(name)
    specs = parse_specs([f"duration:{instance.identifier}" for instance in plain.plan.instances if instance.durative])
    varied = convert(*given, Settings(specs=specs))
    assert len(varied.plan.parameters) == len(specs)
    assert varied.check.statistics.queries == plain.check.statistics.queries
    assert varied.check.box == Box.nominal(varied.plan.parameters)
