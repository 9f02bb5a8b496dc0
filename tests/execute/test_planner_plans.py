"""What planners print for domains like those of the competitions: read, converted and proved, as VAL says."""

from fractions import Fraction

import pytest

from robust.encode.interface import EPSILON
from robust.execute.convert import check_plan, convert
from robust.irr.check import Answer
from robust.plan.load import assemble
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn, write_stn
from robust.plan.timed import parse_timed_plan, write_timed_plan
from robust.smt.limits import NEVER
from tests.execute.planner_plans import PLANS
from tests.pddl_text import PddlText
from tests.val import run_val


@pytest.mark.parametrize("name", PLANS)
def test_read_converted_and_proved(name):
    printed = PLANS[name]
    domain = parse_domain(printed.domain)
    problem = parse_problem(printed.problem, domain)
    timed = parse_timed_plan(printed.log)
    assert len(timed.steps) == printed.steps
    found = convert(domain, problem, timed)
    assert found.check.answer is Answer.PROVED
    assert found.snapped.shift <= Fraction(1, 1000)
    again = assemble(domain, problem, parse_stn(write_stn(found.stn)))
    assert check_plan(again, EPSILON, "z3", NEVER).answer is Answer.PROVED


@pytest.mark.parametrize("name", [name for name, printed in PLANS.items() if printed.val])
def test_val_agrees(name):
    printed = PLANS[name]
    steps = write_timed_plan(parse_timed_plan(printed.log))
    verdict = run_val(PddlText(printed.domain, printed.problem, steps), tolerance=Fraction(1, 1000))
    assert verdict.valid, verdict.report
