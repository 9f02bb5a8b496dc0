"""Logs of planners on the competitions' domains: converted and proved, or refused, as VAL says."""

import json
import os
import warnings
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path

import pytest

from robust.encode.interface import EPSILON
from robust.errors import InputWarning
from robust.execute.convert import Conversion, check_plan, convert
from robust.execute.distances import InvalidPlanError
from robust.irr.check import Answer
from robust.plan.load import assemble
from robust.plan.pddl.reader import read_domain, read_problem
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.stn import parse_stn, write_stn
from robust.plan.timed import TimedPlan, read_timed_plan
from robust.smt.limits import NEVER

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "planner-logs"
FOLDER = Path(os.environ.get("ROBUST_PLANNER_LOGS") or BESIDE)
LISTED = json.loads((FOLDER / "plans.json").read_text()) if (FOLDER / "plans.json").is_file() else []
LONG = 140
REFUSED = {
    "map-analyzer-2014-3": ("separation: n4.start, n16.end", Fraction(0)),
    "map-analyzer-2014-5": ("n14 move_vehicle_road: at start (at_jun car3 junction0-1)", None),
    "map-analyzer-2014-7": ("n15 move_vehicle_road: at start (at_jun car0 junction0-1)", None),
}
"""The first obligation that breaks, and how far the time points of a separation are apart."""
pytestmark = pytest.mark.skipif(not LISTED, reason=f"no logs at {FOLDER}; set ROBUST_PLANNER_LOGS to run this test")


def named(*verdicts: str) -> list[object]:
    """The logs with these verdicts of VAL; long ones are slow."""
    return [
        pytest.param(one["name"], marks=pytest.mark.slow if one["steps"] > LONG else ())
        for one in LISTED
        if one["val"] in verdicts
    ]


@dataclass(frozen=True)
class Read:
    """A log and what it is about."""

    domain: Domain
    problem: Problem
    timed: TimedPlan
    steps: int


def read(name: str) -> Read:
    one = next(one for one in LISTED if one["name"] == name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)  # storage declares an object twice
        domain = read_domain(FOLDER / one["domain"])
        problem = read_problem(FOLDER / one["problem"], domain)
    return Read(domain, problem, read_timed_plan(FOLDER / one["log"]), one["steps"])


@cache
def converted(name: str) -> tuple[Read, Conversion]:
    given = read(name)
    return given, convert(given.domain, given.problem, given.timed)


@pytest.mark.parametrize("name", named("valid", "refused"))
def test_what_is_written_is_proved_again(name):
    given, found = converted(name)
    assert len(given.timed.steps) == given.steps
    assert (found.check.answer, found.cut_short) == (Answer.PROVED, False)
    written = assemble(given.domain, given.problem, parse_stn(write_stn(found.stn)))
    again = check_plan(written, EPSILON, "z3", NEVER)
    assert again.answer is Answer.PROVED
    assert again.settled == len(again.obligations), "paths prove what has neither parameters nor continuous change"


@pytest.mark.parametrize("name", named("valid", "refused"))
def test_exact_times_are_the_printed_ones_but_for_rounding(name):
    """Starts and durations differ by one unit of the last digit at most, and not at all if that is enough."""
    given, found = converted(name)
    times, moved = found.schedule, Fraction(0)
    for step, instance, units in zip(given.timed.steps, found.plan.instances, given.timed.units, strict=True):
        away = abs(times[instance.start] - step.time)
        assert away <= min(units[0], EPSILON)
        moved = max(moved, away)
        if instance.durative:
            away = abs(times[instance.end] - times[instance.start] - (step.duration or 0))
            assert away <= min(units[1], EPSILON)
            moved = max(moved, away)
    assert found.snapped.shift == moved
    starts = [(step.time, times[one.start]) for step, one in zip(given.timed.steps, found.plan.instances, strict=True)]
    assert all(a[1] <= b[1] for a in starts for b in starts if a[0] < b[0] - EPSILON)


@pytest.mark.parametrize("name", named("invalid"))
def test_invalid_plans_are_refused_with_what_breaks(name):
    given = read(name)
    obligation, apart = REFUSED[name]
    with pytest.raises(InvalidPlanError) as refused:
        convert(given.domain, given.problem, given.timed)
    first = min(refused.value.violations, key=lambda one: one.time)
    assert first.obligation == obligation
    assert obligation in str(refused.value)
    if apart is not None:
        assert f"are {apart} apart, less than 0.001" in str(refused.value)
        assert "starts would have to move by up to 0.0005, which --tolerance 0.0005 allows" in str(refused.value)
