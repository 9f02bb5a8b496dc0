"""What a planner is asked, and what it may answer [IRR §3, Alg. 2].

A planner is given a domain, a problem and a deadline. It answers with a plan that the simulator has executed without a
violation, or says in one line why there is none. A planner that fails is an answer, not an exception: a run that
re-plans goes on, or ends as failed, and knows why.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.timed import TimedPlan
from robust.smt.limits import Deadline


class PlannerStatus(Enum):
    """How a call of a planner ended."""

    SOLVED = "solved"
    """The plan is valid."""
    NO_PLAN = "no plan"
    """The planner proved that there is none, or gave up and said so."""
    TIMEOUT = "timeout"
    """The deadline passed; the planner and all its children were killed."""
    CRASHED = "crashed"
    """The planner ended with an error, was killed by someone else, or could not be started."""
    NONSENSE = "nonsense"
    """What was printed is no plan of this problem, or the plan is not valid."""


@dataclass(frozen=True, slots=True)
class PlannerAnswer:
    """What a planner said; `plan` is given exactly when it is `SOLVED`.

    `seconds` is wall time from the call to the answer, the check of the plan included. `message` is one line: why there
    is no plan.
    """

    planner: str
    status: PlannerStatus
    plan: TimedPlan | None
    seconds: float
    message: str = ""

    def __post_init__(self) -> None:
        if (self.plan is not None) is not (self.status is PlannerStatus.SOLVED):
            raise ValueError(f"status {self.status.value!r} with plan {self.plan}: a plan goes with 'solved' only")


class Planner(Protocol):
    """Something that plans; an instance can be asked any number of times and keeps nothing between calls."""

    @property
    def name(self) -> str:
        """What reports call it."""
        ...

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """A checked plan, or why there is none; never later than shortly after the deadline.

        Raises:
            UnsupportedError: if it is known beforehand that the planner cannot read this domain or problem.
            KeyboardInterrupt: on Ctrl-C, once the planner and all its children have ended.
        """
        ...
