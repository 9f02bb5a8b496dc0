"""What planners print for domains like those of the competitions: read, converted and proved, as VAL says.

The plans in `planner_plans` have the constructs of the temporal competitions and the layouts of many planners. Each is
valid, and what its planner printed of it may be rounded. They are small, but have what the domains after which they are
named have.
"""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random

import pytest

from robust.encode.interface import EPSILON
from robust.execute.convert import Conversion, check_plan, convert
from robust.irr.check import Answer
from robust.plan.load import assemble
from robust.plan.model import ParametrizedPlan, TemporalConstraint
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn, write_stn
from robust.plan.timed import parse_timed_plan, write_timed_plan
from robust.smt.limits import NEVER
from tests.pddl_text import PddlText
from tests.val import run_val

STEPS: dict[str, int] = {}
for count, names in {
    2: "pipesworld sokoban",
    3: "airport elevators match-cellar rich tms zeno",
    4: "depots driverlog floor-tile no-declarations roads trucks umts untyped",
    5: "crew",
    6: "satellite",
}.items():
    STEPS |= dict.fromkeys(names.split(), count)
"""How many steps the last plan of each log has."""


@cache
def printed(name: str) -> PddlText:
    """The texts of a domain and a problem, and what the planner printed."""
    directory = Path(__file__).parent / "planner_plans" / name
    return PddlText(*((directory / file).read_text() for file in ("domain.pddl", "problem.pddl", "planner.log")))


@cache
def converted(name: str) -> Conversion:
    text = printed(name)
    domain = parse_domain(text.domain)
    return convert(domain, parse_problem(text.problem, domain), parse_timed_plan(text.plan))


@pytest.mark.parametrize("name", STEPS)
def test_read_converted_and_proved(name):
    text, found = printed(name), converted(name)
    assert len(found.plan.instances) == STEPS[name]
    assert found.check.answer is Answer.PROVED
    assert found.snapped.shift <= Fraction(1, 1000)
    domain = parse_domain(text.domain)
    again = assemble(domain, parse_problem(text.problem, domain), parse_stn(write_stn(found.stn)))
    assert check_plan(again, EPSILON, "z3", NEVER).answer is Answer.PROVED


@pytest.mark.parametrize("name", sorted(set(STEPS) - {"no-declarations"}))  # VAL wants declarations
def test_val_agrees(name):
    text = printed(name)
    steps = write_timed_plan(parse_timed_plan(text.plan))
    verdict = run_val(text._replace(plan=steps), tolerance=Fraction(1, 1000))
    assert verdict.valid, verdict.report


def bounds(plan: ParametrizedPlan) -> list[TemporalConstraint]:
    """Each side of each constraint by itself."""
    sides = [side for one in plan.constraints for side in (replace(one, upper=None), replace(one, lower=None))]
    return [one for one in sides if one.lower is not None or one.upper is not None]


def test_no_bound_can_be_left_out():
    """Without any of them there is a schedule that breaks something, as the simulator confirms."""
    every = [(name, one) for name in STEPS for one in bounds(converted(name).plan)]
    for name, one in Random(14).sample(every, 20):  # noqa: S311 (not for secrets)
        plan = converted(name).plan
        rest = tuple(other for other in bounds(plan) if other != one)
        result = check_plan(replace(plan, constraints=rest), EPSILON, "z3", NEVER)
        assert result.answer is Answer.REFUTED, (name, one)
        for broken in result.counterexamples.values():
            assert broken.obligation in {violation.obligation for violation in broken.simulation.violations}
