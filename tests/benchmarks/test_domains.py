"""The shipped domains: every nominal plan is valid, every plan that is said to be invalid is not."""

from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from benchmarks.generators.sizes import generator_instance, main, write_instance
from robust import reading
from robust.plan.model import ZERO, TimePoint
from robust.plan.simulate import Simulation, simulate
from tests.irr.building import schedule_of
from tests.tables import text_in_data
from tests.val import validate

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "robust" / "examples"
DOMAINS = ROOT / "benchmarks" / "domains"
SHIPPED = text_in_data(__file__, "shipped.txt")


class Example(NamedTuple):
    """A plan; `late`, so much after the other point, is what the plan allows and an `obligation` does not."""

    domain: Path
    problem: Path
    plan: Path
    late: tuple[str, str, int] | None = None
    obligation: str = ""

    def __str__(self) -> str:
        return f"{self.plan.parent.name}/{self.plan.name}"

    def simulated(self, values: Mapping[str, Fraction] | None = None, *later: tuple) -> tuple[Simulation, bool]:
        """What the simulator and VAL say about the earliest schedule in which this and that is late."""
        plan = load_plan(*self[:3])
        points = {str(point): point for point in plan.time_points}
        values = plan.nominal if values is None else values
        schedule = schedule_of(plan, values, *((points[a], points[b], Fraction(by)) for a, b, by in later))
        assert schedule is not None
        said = validate(plan, values, schedule, tolerance=Fraction("0.0005"))
        assert ("Plan valid" in said.report) is said.valid, said.report
        return simulate(plan, values, schedule), said.valid


load_plan = cache(reading.load_plan)


def examples_in(folder, domain, problem, plans, *breaking):
    place = ROOT / folder
    return [
        Example(place / f"{domain}.pddl", place / f"{problem}.pddl", place / f"{plan}.stn", *breaking) for plan in plans
    ]


VALID = [
    example
    for folder, domain, problem, plans in (line.split(maxsplit=3) for line in SHIPPED.strip().splitlines())
    for example in examples_in(folder, domain, problem, plans.split())
]
NAVIGATION, GENERATOR = VALID[:2]
INVALID = [
    *examples_in(
        "robust/examples/two_sample_navigation", "domain", "problem", ["plan-flexible-wait"],
        ("sample_1.end", "drive_2.start", 17), "drive_3 drive: over all (daylight)",
    ),
    *examples_in(
        "benchmarks/domains/robot_delivery", "domain", "problem-one-order", ["one-order-missing-edge"],
        ("p4.start", "p3.end", 1), "p4 join-base: at start (prepared first cap)",
    ),
]  # fmt: skip


def test_every_plan_file_is_listed():
    assert {*EXAMPLES.rglob("*.stn"), *DOMAINS.rglob("*.stn")} == {one.plan for one in (*VALID, *INVALID)}


@pytest.mark.parametrize("example", [*VALID, *INVALID], ids=str)
def test_val_and_the_simulator_accept_the_earliest_nominal_schedule(example):
    simulation, accepted = example.simulated()
    assert (simulation.valid, accepted) == (True, True)


@pytest.mark.parametrize("example", INVALID, ids=str)
def test_val_rejects_another_schedule_of_an_invalid_plan_and_the_simulator_says_why(example):
    simulation, accepted = example.simulated(None, example.late)
    assert (simulation.network_violations, accepted) == ((), False)
    assert [violation.obligation for violation in simulation.violations] == [example.obligation]


@pytest.mark.parametrize("example", VALID, ids=str)
def test_the_simulator_accepts_delayed_nominal_schedules(example):
    plan = load_plan(*example[:3])
    at_once = schedule_of(plan, plan.nominal)
    for instance in plan.instances:
        for delay in ("0.0005", "4", "55"):
            late: tuple[TimePoint, TimePoint, Fraction] = (
                ZERO,
                instance.start,
                at_once[instance.start] + Fraction(delay),
            )
            schedule = schedule_of(plan, plan.nominal, late)
            assert schedule is None or simulate(plan, plan.nominal, schedule).valid


@pytest.mark.parametrize("shift", [Fraction(-1, 20), Fraction(1, 20), Fraction(0)])
@pytest.mark.parametrize("vertex", [(20, 40), (20, 54), (42, 43), (50, 35), (50, 10)])
def test_navigation_is_valid_exactly_within_the_pentagon_of_its_header(vertex, shift):
    """Corners belong to it, by the simulator; VAL does not count exactly."""
    centre = Fraction(182, 5)
    ridge, crater = (Fraction(v) + shift * (v - centre) for v in vertex)
    simulation, accepted = NAVIGATION.simulated({"to_ridge": ridge, "to_crater": crater})
    assert simulation.valid is (shift <= 0)
    assert not shift or accepted is (shift < 0)


@pytest.mark.parametrize("second", [39, 41, 49, 51, 85, 87])
@pytest.mark.parametrize("first", [3, 5, 39, 41, 49, 51])
def test_envelope_of_the_generator_example_is_that_of_its_header(first, second):
    inside = 4 <= min(first, second) <= 50 and 40 <= max(first, second) <= 86
    for one, other in ((first, second), (second, first)):
        simulation, accepted = GENERATOR.simulated({"start_1": Fraction(one), "start_2": Fraction(other)})
        assert accepted is simulation.valid is inside


@pytest.mark.parametrize(("refuels", "parameters"), [(1, 0), (5, 1), (5, 5), (12, 12), (40, 1), (40, 12)])
def test_generated_instances_are_valid(refuels, parameters, tmp_path):
    generated = Example(*write_instance(tmp_path / "instance", refuels, parameters))
    plan = load_plan(*generated[:3])
    assert (len(plan.parameters), len(plan.instances)) == (parameters, refuels + 1)
    assert generated.simulated()[1]


@pytest.mark.parametrize(("start", "valid"), [("4.5", True), ("3.5", False), ("49.5", True), ("50.5", False)])
def test_a_pouring_may_move_as_far_as_documented(start, valid, tmp_path):
    generated = Example(*write_instance(tmp_path / "instance", 3, 1))
    assert generated.simulated({"start_1": Fraction(start)})[1] is valid


def test_shipped_generator_files_are_the_generated_ones():
    directory = DOMAINS / "generator"
    for refuels, parameters in [(5, 2), (5, 4), (8, 3)]:
        _, problem, plan = generator_instance(refuels, parameters)
        assert (directory / f"problem-{refuels}.pddl").read_text(encoding="utf-8") == problem
        assert (directory / f"plan-{refuels}-{parameters}.stn").read_text(encoding="utf-8") == plan
    assert (EXAMPLES / "generator" / "domain.pddl").read_bytes() == (directory / "domain.pddl").read_bytes()
    for refuels, parameters in [(0, 0), (5, 6), (5, -1)]:
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
