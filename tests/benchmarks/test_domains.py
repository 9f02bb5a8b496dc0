"""The shipped domains: every nominal plan is valid, every plan that is said to be invalid is not."""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from benchmarks.generators.sizes import generator_instance, main, write_instance
from robust.plan.load import load_plan
from robust.plan.model import TimePoint, TimePointKind
from robust.plan.simulate import Simulation, simulate
from tests.benchmarks.schedules import Edge, NoScheduleError, earliest, read_plan, val_accepts

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "robust" / "examples"
DOMAINS = ROOT / "benchmarks" / "domains"


class Example(NamedTuple):
    """A plan; `breaking` edges pick a schedule that the plan allows and that fails."""

    directory: Path
    domain: str
    problem: str
    plan: str
    breaking: tuple[Edge, ...] = ()

    @property
    def files(self) -> tuple[Path, Path, Path]:
        return self.directory / self.domain, self.directory / self.problem, self.directory / self.plan

    def __str__(self) -> str:
        return f"{self.directory.name}/{self.plan}"


NAVIGATION = EXAMPLES / "two_sample_navigation"
ROBOTS = DOMAINS / "robot_delivery"

VALID = [
    Example(NAVIGATION, "domain.pddl", "problem.pddl", "plan.stn"),
    Example(EXAMPLES / "generator", "domain.pddl", "problem.pddl", "plan.stn"),
    Example(EXAMPLES / "delivery", "domain.pddl", "problem.pddl", "plan.stn"),
    Example(DOMAINS / "generator", "domain.pddl", "problem-5.pddl", "plan-5-2.stn"),
    Example(DOMAINS / "generator", "domain.pddl", "problem-5.pddl", "plan-5-4.stn"),
    Example(DOMAINS / "generator", "domain.pddl", "problem-5.pddl", "plan-5-pauses-3.stn"),
    Example(DOMAINS / "generator", "domain.pddl", "problem-8.pddl", "plan-8-3.stn"),
    Example(DOMAINS / "solar_rover", "domain.pddl", "problem.pddl", "plan-2.stn"),
    Example(DOMAINS / "solar_rover", "domain.pddl", "problem.pddl", "plan-3.stn"),
    Example(DOMAINS / "solar_rover", "domain.pddl", "problem.pddl", "plan-4.stn"),
    Example(DOMAINS / "solar_rover", "domain-yield.pddl", "problem-yield.pddl", "plan-yield.stn"),
    Example(DOMAINS / "auv_survey", "domain.pddl", "problem-one-vehicle.pddl", "one-vehicle-2.stn"),
    Example(DOMAINS / "auv_survey", "domain.pddl", "problem-one-vehicle.pddl", "one-vehicle-4.stn"),
    Example(DOMAINS / "auv_survey", "domain.pddl", "problem-one-vehicle.pddl", "one-vehicle-6.stn"),
    Example(DOMAINS / "auv_survey", "domain.pddl", "problem-two-vehicles.pddl", "two-vehicles-5.stn"),
    Example(ROBOTS, "domain.pddl", "problem-one-order.pddl", "one-order-2.stn"),
    Example(ROBOTS, "domain.pddl", "problem-one-order.pddl", "one-order-5.stn"),
    Example(ROBOTS, "domain.pddl", "problem-one-order.pddl", "one-order-preparation-3.stn"),
    Example(ROBOTS, "domain.pddl", "problem-two-orders.pddl", "two-orders-10.stn"),
    Example(ROBOTS, "domain-battery.pddl", "problem-battery.pddl", "one-order-battery-6.stn"),
]
INVALID = [
    Example(
        NAVIGATION,
        "domain.pddl",
        "problem.pddl",
        "plan-flexible-wait.stn",
        (Edge("sample_1.end", "drive_2.start", Fraction(17), None),),
    ),
    Example(
        ROBOTS,
        "domain.pddl",
        "problem-one-order.pddl",
        "one-order-missing-edge.stn",
        (Edge("p4.start", "p3.end", Fraction(1), None),),
    ),
]


def test_every_plan_file_is_listed() -> None:
    shipped = {*EXAMPLES.rglob("*.stn"), *DOMAINS.rglob("*.stn")}
    assert shipped == {example.files[2] for example in (*VALID, *INVALID)}


@pytest.mark.parametrize("example", [*VALID, *INVALID], ids=str)
def test_val_accepts_the_earliest_nominal_schedule(example: Example, tmp_path: Path) -> None:
    domain, problem, path = example.files
    plan = read_plan(path)
    assert val_accepts(domain, problem, plan, earliest(plan), tmp_path)


@pytest.mark.parametrize("example", INVALID, ids=str)
def test_val_rejects_another_schedule_of_an_invalid_plan(example: Example, tmp_path: Path) -> None:
    domain, problem, path = example.files
    plan = read_plan(path)
    assert not val_accepts(domain, problem, plan, earliest(plan, example.breaking), tmp_path)


load = cache(load_plan)


def simulation(example: Example, values: dict[str, Fraction] | None = None) -> Simulation:
    """What the simulator says about the earliest schedule, or the one that `breaking` picks."""
    file = read_plan(example.files[2], values)
    plan = load(*example.files)
    assert values or plan.nominal == file.parameters
    kinds = {"start": TimePointKind.START, "end": TimePointKind.END}
    schedule = {
        TimePoint(kinds[end], name): time
        for point, time in earliest(file, example.breaking).items()
        for name, end in [point.split(".")]
        if name
    }
    return simulate(plan, file.parameters, schedule)


@pytest.mark.parametrize("example", [*VALID, *(example._replace(breaking=()) for example in INVALID)], ids=str)
def test_simulator_accepts_the_earliest_nominal_schedule(example: Example) -> None:
    result = simulation(example)
    assert (result.network_violations, result.violations) == ((), ())


@pytest.mark.parametrize("example", VALID, ids=str)
def test_simulator_accepts_delayed_nominal_schedules(example: Example) -> None:
    file = read_plan(example.files[2])
    at_once = earliest(file)
    for instance in file.instances:
        for delay in ("0.0005", "4", "55"):
            edge = Edge(".zero", f"{instance}.start", at_once[f"{instance}.start"] + Fraction(delay), None)
            with suppress(NoScheduleError):
                result = simulation(example._replace(breaking=(edge,)))
                assert (result.network_violations, result.violations) == ((), ())


@pytest.mark.parametrize(
    ("example", "obligation"),
    [
        (INVALID[0], "drive_3 drive: over all (daylight)"),
        (INVALID[1], "p4 join-base: at start (prepared first cap)"),
    ],
    ids=str,
)
def test_simulator_names_what_breaks_in_an_invalid_plan(example: Example, obligation: str) -> None:
    result = simulation(example)
    assert result.network_violations == ()
    assert [violation.obligation for violation in result.violations] == [obligation]


PENTAGON = [(20, 40), (20, 54), (42, 43), (50, 35), (50, 10)]
CENTRE = (Fraction(182, 5), Fraction(182, 5))


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize("vertex", PENTAGON)
def test_navigation_is_valid_exactly_within_the_pentagon_of_its_header(
    vertex: tuple[int, int], inside: bool, tmp_path: Path
) -> None:
    shift = Fraction(1, 20) * (-1 if inside else 1)
    point = [Fraction(v) + shift * (v - c) for v, c in zip(vertex, CENTRE, strict=True)]
    values = dict(zip(("to_ridge", "to_crater"), point, strict=True))
    domain, problem, path = VALID[0].files
    plan = read_plan(path, values)
    assert val_accepts(domain, problem, plan, earliest(plan), tmp_path) is inside


@pytest.mark.parametrize("vertex", PENTAGON)
def test_corners_of_the_pentagon_belong_to_it(vertex: tuple[int, int]) -> None:
    values = dict(zip(("to_ridge", "to_crater"), map(Fraction, vertex), strict=True))
    assert simulation(VALID[0], values).valid


@pytest.mark.parametrize("second", [39, 41, 49, 51, 85, 87])
@pytest.mark.parametrize("first", [3, 5, 39, 41, 49, 51])
def test_envelope_of_the_generator_example_is_that_of_its_header(first: int, second: int, tmp_path: Path) -> None:
    example = VALID[1]
    inside = 4 <= min(first, second) <= 50 and 40 <= max(first, second) <= 86
    for values in (
        {"start_1": Fraction(first), "start_2": Fraction(second)},
        {"start_1": Fraction(second), "start_2": Fraction(first)},
    ):
        domain, problem, path = example.files
        plan = read_plan(path, values)
        assert val_accepts(domain, problem, plan, earliest(plan), tmp_path) is inside
        assert simulation(example, values).valid is inside


@pytest.mark.parametrize(("refuels", "parameters"), [(1, 0), (5, 1), (5, 5), (12, 12), (40, 1), (40, 12)])
def test_generated_instances_are_valid(refuels: int, parameters: int, tmp_path: Path) -> None:
    domain, problem, path = write_instance(tmp_path / "instance", refuels, parameters)
    plan = read_plan(path)
    assert len(plan.parameters) == parameters
    assert len(plan.instances) == refuels + 1
    assert val_accepts(domain, problem, plan, earliest(plan), tmp_path)


@pytest.mark.parametrize(("start", "valid"), [("4.5", True), ("3.5", False), ("49.5", True), ("50.5", False)])
def test_a_pouring_may_move_as_far_as_documented(start: str, valid: bool, tmp_path: Path) -> None:
    domain, problem, path = write_instance(tmp_path / "instance", 3, 1)
    plan = read_plan(path, {"start_1": Fraction(start)})
    assert val_accepts(domain, problem, plan, earliest(plan), tmp_path) is valid


def test_shipped_generator_files_are_the_generated_ones() -> None:
    for refuels, parameters in [(5, 2), (5, 4), (8, 3)]:
        _, problem, plan = generator_instance(refuels, parameters)
        directory = DOMAINS / "generator"
        assert (directory / f"problem-{refuels}.pddl").read_text(encoding="utf-8") == problem
        assert (directory / f"plan-{refuels}-{parameters}.stn").read_text(encoding="utf-8") == plan
    copies = [directory / "generator" / "domain.pddl" for directory in (EXAMPLES, DOMAINS)]
    assert copies[0].read_text(encoding="utf-8") == copies[1].read_text(encoding="utf-8")


@pytest.mark.parametrize(("refuels", "parameters"), [(0, 0), (5, 6), (5, -1)])
def test_impossible_sizes_are_rejected(refuels: int, parameters: int) -> None:
    with pytest.raises(ValueError, match="expected"):
        generator_instance(refuels, parameters)


def test_command_line_writes_the_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--refuels", "6", "--parameters", "2", "--output", str(tmp_path)]) == 0
    names = ["domain.pddl", "problem-6.pddl", "plan-6-2.stn"]
    assert capsys.readouterr().out.split() == [str(tmp_path / name) for name in names]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)


def test_command_line_explains_a_wrong_size(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--refuels", "2", "--parameters", "3", "--output", str(tmp_path)])
    assert stop.value.code == 2
    assert "expected 0 to 2" in capsys.readouterr().err
