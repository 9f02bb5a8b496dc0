"""What planners print for domains like those of the competitions: read, converted and proved, or refused, as VAL says.

The plans in `planner_plans` have the constructs of the temporal competitions and the layouts of many planners. Each is
valid, and what its planner printed of it may be rounded. They are small, but have what the domains after which they are
named have. The logs beside the repository are of planners on the competitions' own domains.
"""

import json
import os
import warnings
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random

import pytest

from robust.encode.interface import EPSILON
from robust.errors import InputWarning
from robust.execute.convert import Conversion, check_plan, convert
from robust.execute.distances import InvalidPlanError
from robust.irr.check import Answer
from robust.plan.load import assemble
from robust.plan.model import ParametrizedPlan, TemporalConstraint
from robust.plan.pddl.reader import read_domain, read_problem
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.stn import parse_stn, write_stn
from robust.plan.timed import TimedPlan, read_timed_plan, write_timed_plan
from robust.smt.limits import NEVER
from tests.execute.plans import ROOT
from tests.pddl_text import PddlText
from tests.val import run_val

PRINTED = Path(__file__).parent / "planner_plans"
STEPS = {
    name: count
    for count, names in {
        2: "pipesworld sokoban",
        3: "airport elevators match-cellar rich tms zeno",
        4: "depots driverlog floor-tile no-declarations roads trucks umts untyped",
        5: "crew",
        6: "satellite",
    }.items()
    for name in names.split()
}
"""How many steps the last plan of each log has."""
FOLDER = Path(os.environ.get("ROBUST_PLANNER_LOGS") or ROOT.parent / "shared" / "planner-logs")
LISTED = json.loads((FOLDER / "plans.json").read_text()) if (FOLDER / "plans.json").is_file() else []
LOGS = {entry["name"]: entry for entry in LISTED}
LONG = 140
REFUSED = {
    "map-analyzer-2014-3": ("separation: n4.start, n16.end", Fraction(0)),
    "map-analyzer-2014-5": ("n14 move_vehicle_road: at start (at_jun car3 junction0-1)", None),
    "map-analyzer-2014-7": ("n15 move_vehicle_road: at start (at_jun car0 junction0-1)", None),
}
"""The first obligation that breaks, and how far the time points of a separation are apart."""
needs_logs = pytest.mark.skipif(not LISTED, reason=f"no logs at {FOLDER}; set ROBUST_PLANNER_LOGS to run this test")


def named(*verdicts: str) -> list[object]:
    """The logs with these verdicts of VAL; long ones are slow."""
    return [
        pytest.param(name, marks=[needs_logs, *([pytest.mark.slow] if entry["steps"] > LONG else [])])
        for name, entry in LOGS.items()
        if entry["val"] in verdicts
    ]


def files_of(name: str) -> tuple[Path, Path, Path]:
    if name in STEPS:
        return PRINTED / name / "domain.pddl", PRINTED / name / "problem.pddl", PRINTED / name / "planner.log"
    return FOLDER / LOGS[name]["domain"], FOLDER / LOGS[name]["problem"], FOLDER / LOGS[name]["log"]


@dataclass(frozen=True)
class Read:
    """What a planner printed and what it is about."""

    domain: Domain
    problem: Problem
    timed: TimedPlan


def read(name: str) -> Read:
    domain_file, problem_file, log = files_of(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if "storage" in name else "error", InputWarning)  # declares an object twice
        domain = read_domain(domain_file)
        return Read(domain, read_problem(problem_file, domain), read_timed_plan(log))


@cache
def converted(name: str) -> tuple[Read, Conversion]:
    given = read(name)
    return given, convert(given.domain, given.problem, given.timed)


@pytest.mark.parametrize("name", [*STEPS, *named("valid", "refused")])
def test_what_is_written_is_proved_again(name):
    given, conversion = converted(name)
    assert len(conversion.plan.instances) == len(given.timed.steps)
    assert len(given.timed.steps) == (STEPS[name] if name in STEPS else LOGS[name]["steps"])
    assert (conversion.check.answer, conversion.cut_short) == (Answer.PROVED, False)
    written = assemble(given.domain, given.problem, parse_stn(write_stn(conversion.stn)))
    again = check_plan(written, EPSILON, "z3", NEVER)
    assert again.answer is Answer.PROVED
    if name in LOGS:
        assert again.settled == len(again.obligations), "paths prove what has neither parameters nor continuous change"


@pytest.mark.parametrize("name", [*STEPS, *named("valid", "refused")])
def test_exact_times_are_the_printed_ones_but_for_rounding(name):
    """Starts and durations differ by one unit of the last digit at most, and not at all if that is enough."""
    given, conversion = converted(name)
    times, moved = conversion.schedule, Fraction(0)
    starts = []
    for step, instance, units in zip(given.timed.steps, conversion.plan.instances, given.timed.units, strict=True):
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
    given = read(name)
    obligation, apart = REFUSED[name]
    with pytest.raises(InvalidPlanError) as refused:
        convert(given.domain, given.problem, given.timed)
    assert min(refused.value.violations, key=lambda violation: violation.time).obligation == obligation
    assert obligation in str(refused.value)
    if apart is not None:
        assert f"are {apart} apart, less than 0.001" in str(refused.value)
        assert "starts would have to move by up to 0.0005, which --tolerance 0.0005 allows" in str(refused.value)


@pytest.mark.parametrize("name", sorted(set(STEPS) - {"no-declarations"}))  # VAL wants declarations
def test_val_agrees(name):
    domain, problem, log = files_of(name)
    steps = write_timed_plan(read_timed_plan(log))
    verdict = run_val(PddlText(domain.read_text(), problem.read_text(), steps), tolerance=Fraction(1, 1000))
    assert verdict.valid, verdict.report


def bounds(plan: ParametrizedPlan) -> list[TemporalConstraint]:
    """Each side of each constraint by itself."""
    sides = [side for both in plan.constraints for side in (replace(both, upper=None), replace(both, lower=None))]
    return [side for side in sides if side.lower is not None or side.upper is not None]


def test_no_bound_can_be_left_out():
    """Without any of them there is a schedule that breaks something, as the simulator confirms."""
    every = [(name, bound) for name in STEPS for bound in bounds(converted(name)[1].plan)]
    for name, bound in Random(14).sample(every, 20):  # noqa: S311 (not for secrets)
        plan = converted(name)[1].plan
        rest = tuple(other for other in bounds(plan) if other != bound)
        result = check_plan(replace(plan, constraints=rest), EPSILON, "z3", NEVER)
        assert result.answer is Answer.REFUTED, (name, bound)
        for broken in result.counterexamples.values():
            assert broken.obligation in {violation.obligation for violation in broken.simulation.violations}
