"""What a planner is asked, and what it may answer [IRR §3, Alg. 2].

A planner is given a domain, a problem and a deadline. It answers with a plan that the simulator has executed without a
violation, or says in one line why there is none. A planner that fails is an answer, not an exception: a run that re-
plans goes on, or ends as failed, and knows why.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Protocol

from robust.errors import InputError, RobustError
from robust.execute.distances import declarations, schedule_of, validated
from robust.plan.load import assemble
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.stn import STNPlan
from robust.plan.timed import TimedPlan, plans_in
from robust.presented import NoTruthValue, VerdictEnum
from robust.smt.limits import Deadline


class PlannerStatus(VerdictEnum):
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
class PlannerAnswer(NoTruthValue, ask="status"):
    """What a planner said; `plan` is given exactly when it is `SOLVED`.

    `message` is one line: why there is no plan. `seconds` is wall time from the call to the answer, the check of the
    plan included; planners of :mod:`robust.execute.planners.registry` know it.
    """

    planner: str
    status: PlannerStatus
    plan: TimedPlan | None
    seconds: float = 0.0
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


_NO_PLAN = re.compile(
    r"no plan|no solution|unsolvable|unreachable|infeasible|cannot be solved|not solvable", re.IGNORECASE
)


Renaming = Callable[[TimedPlan], TimedPlan]
"""From the names and times of a planner to those of a problem."""


def check(plan: TimedPlan, domain: Domain, problem: Problem, epsilon: Fraction) -> None:
    """Execute a plan in the simulator.

    Raises:
        InputError: if it is not a plan of this problem.
        InvalidPlanError: if it breaks an obligation.
        UnsupportedError: if the simulator cannot decide.
    """
    instances = declarations(plan, domain, epsilon)
    bare = assemble(domain, problem, STNPlan((), instances, (), plan.file))
    validated(bare, schedule_of(plan, instances), epsilon, plan.file)


def last_valid_plan(
    text: str, domain: Domain, problem: Problem, epsilon: Fraction, planner: str, *, renamed: Renaming | None = None
) -> tuple[TimedPlan | None, str]:
    """The last plan in a text that is valid; without one, what is wrong with the last, or an empty message."""
    message = ""
    for found in plans_in(text, f"<plan of {planner}>"):
        try:
            if isinstance(found, InputError):
                raise found
            plan = found if renamed is None else renamed(found)
            check(plan, domain, problem, epsilon)
        except RobustError as error:
            message = message or " ".join(str(error).split())
        else:
            return plan, ""
    return None, message


def says_no_plan(text: str) -> bool:
    """Whether a planner says that it found none: in words, or by printing nothing."""
    return not text.strip() or _NO_PLAN.search(text) is not None


@dataclass(frozen=True, slots=True)
class RememberingPlanner:
    """Asks a planner once for each problem, whatever the answer is; the first deadline counts.

    One that draws lots, or races its strategies, then has the same plan for everyone who comes to the same state.
    """

    planner: Planner
    answers: dict[Hashable, tuple[Domain, PlannerAnswer]] = field(default_factory=dict, repr=False)

    @property
    def name(self) -> str:
        return self.planner.name

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`."""
        question = _question(domain, problem)
        if question not in self.answers:
            # the domain is kept, so that its number is not given to another one
            self.answers[question] = domain, self.planner.solve(domain, problem, deadline)
        return self.answers[question][1]


def _question(domain: Domain, problem: Problem) -> Hashable:
    fluents = frozenset(problem.fluents.items())
    objects = tuple((name, one.types) for name, one in problem.objects.items())
    return id(domain), objects, problem.atoms, fluents, problem.timed_literals, problem.goal
