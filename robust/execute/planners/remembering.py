"""A planner that answers the same question with the same answer: experiments that compare executors need one."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field

from robust.execute.planners.interface import Planner, PlannerAnswer
from robust.plan.pddl.syntax import Domain, Problem
from robust.smt.limits import Deadline


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
