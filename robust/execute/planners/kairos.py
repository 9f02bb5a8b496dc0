"""Kairos, a temporal and numeric planner of the extra `planners`; it reads PDDL files and comes with a command."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from fractions import Fraction

from robust.encode.interface import EPSILON
from robust.errors import UnsupportedError
from robust.execute.planners.command import CommandPlanner, Ended, program
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.numbers import format_number
from robust.plan.pddl.syntax import Domain, Problem
from robust.smt.limits import Deadline

_MEMORY_MB = 2048
_LONGEST_FIRST = 30.0
"""Seconds for the first search at most."""


@dataclass(frozen=True, slots=True)
class KairosPlanner:
    """The first plan that Kairos finds; one thread, so that the same problem gives the same plan.

    Its own choice of searches can spend most of the time on one that leads nowhere where plans have deadlines and use
    resources. So the search that is best there is tried first, for half of the time, and then its own choice.
    """

    first: CommandPlanner
    second: CommandPlanner
    name: str = "kairos"

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`."""
        start = time.monotonic()
        remaining = deadline.remaining
        share = _LONGEST_FIRST if remaining is None else min(_LONGEST_FIRST, remaining / 2)
        answer = self.first.solve(domain, problem, Deadline.after(share))
        if answer.status in (PlannerStatus.TIMEOUT, PlannerStatus.NO_PLAN):
            answer = self.second.solve(domain, problem, deadline)
        return replace(answer, seconds=time.monotonic() - start)


def kairos_planner(*, epsilon: Fraction = EPSILON) -> KairosPlanner:
    """Kairos, with plans whose mutex time points are `epsilon` apart.

    Raises:
        UnsupportedError: if the package is not installed.
    """
    command = program("kairos")
    if command is None:
        expected = "it to be installed: pip install 'robust[planners]'"
        raise UnsupportedError(f"found no planner kairos (package kairos-planner), expected {expected}")
    options = ("--no-anytime", "--threads", "1", "--memory", str(_MEMORY_MB), "--epsilon", format_number(epsilon))
    arguments = (command, "solve", "{domain}", "{problem}", "--timeout", "{timeout}", *options)
    first = CommandPlanner("kairos", (*arguments, "--search", "eager-lama"), epsilon, _verdict)
    return KairosPlanner(first, CommandPlanner("kairos", arguments, epsilon, _verdict))


def _verdict(ended: Ended) -> PlannerStatus | None:
    """What the documented exit codes say: unsolvable (proved), out of time, no plan found."""
    match ended.exit_code:
        case 10 | 14:
            return PlannerStatus.NO_PLAN
        case 11:
            return PlannerStatus.TIMEOUT
        case _:
            return None
