"""Kairos, a temporal and numeric planner of the extra `planners`; it reads PDDL files and comes with a command."""

from __future__ import annotations

from fractions import Fraction

from robust.encode.interface import EPSILON
from robust.errors import UnsupportedError
from robust.execute.planners.command import CommandPlanner, program
from robust.execute.planners.interface import PlannerStatus
from robust.execute.planners.process import Ended
from robust.plan.numerals import format_number

_MEMORY_MB = 2048
_STATUSES = {10: PlannerStatus.NO_PLAN, 11: PlannerStatus.TIMEOUT, 14: PlannerStatus.NO_PLAN}


def kairos_planner(*, epsilon: Fraction = EPSILON) -> CommandPlanner:
    """The first plan that Kairos finds; one thread, so that the same problem gives the same plan.

    Raises:
        UnsupportedError: if the package is not installed.
    """
    command = program("kairos")
    if command is None:
        expected = "it to be installed: pip install 'robust[planners]'"
        raise UnsupportedError(f"found no planner kairos (package kairos-planner), expected {expected}")
    options = ("--no-anytime", "--threads", "1", "--memory", str(_MEMORY_MB), "--epsilon", format_number(epsilon))
    arguments = (command, "solve", "{domain}", "{problem}", "--timeout", "{timeout}", *options)
    return CommandPlanner("kairos", arguments, epsilon, _verdict)


def _verdict(ended: Ended) -> PlannerStatus | None:
    return _STATUSES.get(ended.exit_code or 0)
