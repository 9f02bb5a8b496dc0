"""Proofs that a problem has no plan, which are quick, and asked for before any planner is.

A planner that looks for a plan where deadlines are out of reach uses up its time, and is none the wiser.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from fractions import Fraction
from math import inf

from robust.errors import RobustError
from robust.execute.planners.earliest import EarliestTimes
from robust.execute.planners.interface import Planner, PlannerAnswer, PlannerStatus
from robust.execute.planners.relaxed import RelaxedProblem, TooLargeError, relaxed_problem
from robust.plan.numerals import format_number
from robust.plan.pddl.syntax import Domain, Problem
from robust.smt.limits import Deadline, OutOfTimeError

NAME = "reachability"
_SHARE = 0.25
_LONGEST = 10.0
"""Of the time for a plan, no more than this share, and no more than so many seconds."""


def unreachable(domain: Domain, problem: Problem, deadline: Deadline) -> str | None:
    """Why a problem has no plan, in one line; None if that is not found out, which says nothing.

    The proof is that of :class:`robust.execute.planners.earliest.EarliestTimes`, as far as it gets by the deadline.
    """
    try:
        relaxed = relaxed_problem(domain, problem, deadline)
        times = EarliestTimes(relaxed, deadline)
    except (TooLargeError, OutOfTimeError, RobustError):
        return None  # it is for the planner to say what is wrong with the problem
    return _reason(relaxed, times) if times.condition(relaxed.goal) == inf else None


def _reason(problem: RelaxedProblem, times: EarliestTimes) -> str:
    late = sorted(times.too_late.items(), key=lambda item: str(problem.facts[item[0]]))
    if not late:
        return "the goal is out of reach, whatever is done"
    parts = [
        f"{problem.facts[fact]} ends at {_number(problem.last[fact], problem)}, "
        f"and what needs it would end at {_number(int(moment), problem)} or later"
        for fact, moment in late
    ]
    return f"the goal is out of reach: {'; '.join(parts)}"


def _number(ticks: int, problem: RelaxedProblem) -> str:
    return format_number(Fraction(ticks, problem.ticks))


@dataclass(frozen=True, slots=True)
class ReachabilityFirst:
    """A planner that is only asked if no proof is found that there is no plan."""

    planner: Planner

    @property
    def name(self) -> str:
        return self.planner.name

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`; a proof answers in the name of `reachability`."""
        start = time.monotonic()
        remaining = deadline.remaining
        share = _LONGEST if remaining is None else min(_LONGEST, remaining * _SHARE)
        reason = unreachable(domain, problem, Deadline.after(share))
        if reason is None:
            return self.planner.solve(domain, problem, deadline)
        return PlannerAnswer(NAME, PlannerStatus.NO_PLAN, None, time.monotonic() - start, reason)
