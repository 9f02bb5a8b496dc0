"""What planners print, and whether it is a plan: time-triggered steps among other text, checked by the simulator."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction

from robust.errors import RobustError
from robust.execute.original import declarations, schedule_of, validated
from robust.plan.load import assemble
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.stn import STNPlan
from robust.plan.timed import TimedPlan, parse_timed_plan

_STEP = re.compile(r"\s*(?P<time>[0-9.]+)\s*:\s*\([^()]*\)\s*(?:\[[^\[\]]*\])?\s*(?:;.*)?")
_NO_PLAN = re.compile(
    r"no plan|no solution|unsolvable|unreachable|infeasible|cannot be solved|not solvable", re.IGNORECASE
)


def plan_texts(text: str) -> Iterator[str]:
    """The parts of a text that look like plans, the last one first: planners that go on looking improve on them.

    A plan ends where a line is neither a step nor blank nor a comment, or where the time of a step is before the last.
    """
    plans: list[list[str]] = []
    current: list[str] = []
    last = Fraction(0)
    for line in text.splitlines():
        match = _STEP.fullmatch(line)
        if match is None:
            if line.partition(";")[0].strip():
                current = []
            continue
        time = _time(match["time"])
        if not current or time < last:
            current = []
            plans.append(current)
        current.append(line)
        last = time
    return ("\n".join(lines) for lines in reversed(plans))


def _time(text: str) -> Fraction:
    try:
        return Fraction(text)
    except ValueError:
        return Fraction(0)  # not a number: for the reader to say so


def checked_plan(text: str, domain: Domain, problem: Problem, epsilon: Fraction, planner: str) -> TimedPlan:
    """The plan in a text, once the simulator has executed it.

    Raises:
        InputError: if it is not a plan of this problem.
        InvalidPlanError: if it breaks an obligation.
        UnsupportedError: if the simulator cannot decide.
    """
    plan = parse_timed_plan(text, f"<plan of {planner}>")
    check(plan, domain, problem, epsilon)
    return plan


def check(plan: TimedPlan, domain: Domain, problem: Problem, epsilon: Fraction) -> None:
    """Execute a plan in the simulator; errors as for :func:`checked_plan`."""
    instances = declarations(plan, domain, epsilon)
    bare = assemble(domain, problem, STNPlan((), instances, (), plan.file))
    validated(bare, schedule_of(plan, instances), epsilon, plan.file)


def last_valid_plan(
    text: str, domain: Domain, problem: Problem, epsilon: Fraction, planner: str
) -> tuple[TimedPlan | None, str]:
    """The last plan in a text that is valid; without one, what is wrong with the last, or an empty message."""
    message = ""
    for candidate in plan_texts(text):
        try:
            return checked_plan(candidate, domain, problem, epsilon, planner), ""
        except RobustError as error:
            message = message or " ".join(str(error).split())
    return None, message


def says_no_plan(text: str) -> bool:
    """Whether a planner says that it found none: in words, or by printing nothing."""
    return not text.strip() or _NO_PLAN.search(text) is not None
