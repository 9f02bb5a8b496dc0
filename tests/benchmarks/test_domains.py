"""The shipped domains: every nominal plan is valid, every plan that is said to be invalid is not."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from networkx import NetworkXUnbounded

from benchmarks.generators.sizes import generator_instance, main, write_instance
from robust.plan.load import load_plan
from robust.plan.model import TimePoint, TimePointKind
from robust.plan.simulate import Simulation, simulate
from tests.benchmarks.schedules import Edge, earliest, read_plan, val_accepts

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "robust" / "examples"
DOMAINS = ROOT / "benchmarks" / "domains"


class Example(NamedTuple):
    """A plan; `breaking` picks a schedule that the plan allows, and that fails because of an `obligation`."""

    domain: Path
    problem: Path
    plan: Path
    breaking: tuple[Edge, ...] = ()
    obligation: str = ""

    def __str__(self) -> str:
        return f"{self.plan.parent.name}/{self.plan.name}"


def example(folder: str, domain: str, problem: str, plan: str, *breaking: Any) -> Example:
    place = ROOT / folder
    return Example(place / f"{domain}.pddl", place / f"{problem}.pddl", place / f"{plan}.stn", *breaking)


SHIPPED = """
robust/examples/two_sample_navigation  domain  problem     plan
robust/examples/generator              domain  problem     plan
robust/examples/delivery               domain  problem     plan
benchmarks/domains/generator       domain          problem-5             plan-5-2 plan-5-4 plan-5-pauses-3
benchmarks/domains/generator       domain          problem-8             plan-8-3
benchmarks/domains/solar_rover     domain          problem               plan-2 plan-3 plan-4
benchmarks/domains/solar_rover     domain-yield    problem-yield         plan-yield
benchmarks/domains/auv_survey      domain          problem-one-vehicle   one-vehicle-2 one-vehicle-4 one-vehicle-6
benchmarks/domains/auv_survey      domain          problem-two-vehicles  two-vehicles-5
benchmarks/domains/robot_delivery  domain          problem-one-order     one-order-2 one-order-5 one-order-preparation-3
benchmarks/domains/robot_delivery  domain          problem-two-orders    two-orders-10
benchmarks/domains/robot_delivery  domain-battery  problem-battery       one-order-battery-6
"""
VALID = [
    example(*files, plan)
    for *files, plans in (line.split(maxsplit=3) for line in SHIPPED.strip().splitlines())
    for plan in plans.split()
]
INVALID = [
    example(
        "robust/examples/two_sample_navigation",
        "domain",
        "problem",
        "plan-flexible-wait",
        (Edge("sample_1.end", "drive_2.start", Fraction(17), None),),
        "drive_3 drive: over all (daylight)",
    ),
    example(
        "benchmarks/domains/robot_delivery",
        "domain",
        "problem-one-order",
        "one-order-missing-edge",
        (Edge("p4.start", "p3.end", Fraction(1), None),),
        "p4 join-base: at start (prepared first cap)",
    ),
]


def val(example: Example, values: Mapping[str, Fraction] | None = None) -> bool:
    """Does VAL accept the earliest schedule, or the one that `breaking` picks."""
    plan = read_plan(example.plan, values)
    return val_accepts(example.domain, example.problem, plan, earliest(plan, example.breaking))


load = cache(load_plan)


def simulation(example: Example, values: Mapping[str, Fraction] | None = None) -> Simulation:
    """What the simulator says about the same schedule."""
    file = read_plan(example.plan, values)
    plan = load(*example[:3])
    assert values or plan.nominal == file.parameters
    kinds = {"start": TimePointKind.START, "end": TimePointKind.END}
    schedule = {
        TimePoint(kinds[end], name): time
        for point, time in earliest(file, example.breaking).items()
        for name, end in [point.split(".")]
        if name
    }
    return simulate(plan, file.parameters, schedule)


def test_every_plan_file_is_listed():
    assert {*EXAMPLES.rglob("*.stn"), *DOMAINS.rglob("*.stn")} == {one.plan for one in (*VALID, *INVALID)}


@pytest.mark.parametrize("example", [*VALID, *INVALID], ids=str)
def test_val_and_the_simulator_accept_the_earliest_nominal_schedule(example):
    at_once = example._replace(breaking=())
    assert val(at_once)
    assert simulation(at_once).valid


@pytest.mark.parametrize("example", INVALID, ids=str)
def test_val_rejects_another_schedule_of_an_invalid_plan_and_the_simulator_says_why(example):
    assert not val(example)
    result = simulation(example)
    assert result.network_violations == ()
    assert [violation.obligation for violation in result.violations] == [example.obligation]


@pytest.mark.parametrize("example", VALID, ids=str)
def test_simulator_accepts_delayed_nominal_schedules(example):
    file = read_plan(example.plan)
    at_once = earliest(file)
    for instance in file.instances:
        for delay in ("0.0005", "4", "55"):
            edge = Edge(".zero", f"{instance}.start", at_once[f"{instance}.start"] + Fraction(delay), None)
            with suppress(NetworkXUnbounded):
                assert simulation(example._replace(breaking=(edge,))).valid


PENTAGON = [(20, 40), (20, 54), (42, 43), (50, 35), (50, 10)]
CENTRE = (Fraction(182, 5), Fraction(182, 5))


@pytest.mark.parametrize("shift", [Fraction(-1, 20), Fraction(1, 20), Fraction(0)])
@pytest.mark.parametrize("vertex", PENTAGON)
def test_navigation_is_valid_exactly_within_the_pentagon_of_its_header(vertex, shift):
    """Corners belong to it, by the simulator; VAL does not count exactly."""
    point = [Fraction(v) + shift * (v - c) for v, c in zip(vertex, CENTRE, strict=True)]
    values = dict(zip(("to_ridge", "to_crater"), point, strict=True))
    assert simulation(VALID[0], values).valid is (shift <= 0)
    assert not shift or val(VALID[0], values) is (shift < 0)


@pytest.mark.parametrize("second", [39, 41, 49, 51, 85, 87])
@pytest.mark.parametrize("first", [3, 5, 39, 41, 49, 51])
def test_envelope_of_the_generator_example_is_that_of_its_header(first, second):
    inside = 4 <= min(first, second) <= 50 and 40 <= max(first, second) <= 86
    for pair in ((first, second), (second, first)):
        values = dict(zip(("start_1", "start_2"), map(Fraction, pair), strict=True))
        assert val(VALID[1], values) is simulation(VALID[1], values).valid is inside


@pytest.mark.parametrize(("refuels", "parameters"), [(1, 0), (5, 1), (5, 5), (12, 12), (40, 1), (40, 12)])
def test_generated_instances_are_valid(refuels, parameters, tmp_path):
    generated = Example(*write_instance(tmp_path / "instance", refuels, parameters))
    plan = read_plan(generated.plan)
    assert (len(plan.parameters), len(plan.instances)) == (parameters, refuels + 1)
    assert val(generated)


@pytest.mark.parametrize(("start", "valid"), [("4.5", True), ("3.5", False), ("49.5", True), ("50.5", False)])
def test_a_pouring_may_move_as_far_as_documented(start, valid, tmp_path):
    assert val(Example(*write_instance(tmp_path / "instance", 3, 1)), {"start_1": Fraction(start)}) is valid


def test_shipped_generator_files_are_the_generated_ones():
    for refuels, parameters in [(5, 2), (5, 4), (8, 3)]:
        _, problem, plan = generator_instance(refuels, parameters)
        directory = DOMAINS / "generator"
        assert (directory / f"problem-{refuels}.pddl").read_text(encoding="utf-8") == problem
        assert (directory / f"plan-{refuels}-{parameters}.stn").read_text(encoding="utf-8") == plan
    copies = [directory / "generator" / "domain.pddl" for directory in (EXAMPLES, DOMAINS)]
    assert copies[0].read_text(encoding="utf-8") == copies[1].read_text(encoding="utf-8")


@pytest.mark.parametrize(("refuels", "parameters"), [(0, 0), (5, 6), (5, -1)])
def test_impossible_sizes_are_rejected(refuels, parameters):
    with pytest.raises(ValueError, match="expected"):
        generator_instance(refuels, parameters)


def test_command_line(tmp_path, capsys):
    assert main(["--refuels", "6", "--parameters", "2", "--output", str(tmp_path)]) == 0
    names = ["domain.pddl", "problem-6.pddl", "plan-6-2.stn"]
    assert capsys.readouterr().out.split() == [str(tmp_path / name) for name in names]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    with pytest.raises(SystemExit, match="2"):
        main(["--refuels", "2", "--parameters", "3", "--output", str(tmp_path)])
    assert "expected 0 to 2" in capsys.readouterr().err
