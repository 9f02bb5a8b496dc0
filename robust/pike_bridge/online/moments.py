"""How long people have: until when each value of each choice that is theirs can be chosen at the latest."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import NamedTuple

from robust.pike_bridge.model import ALWAYS, Guard, TeamPlan
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.patience import openings, values_of
from robust.pike_bridge.online.progress import Succeeded
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.scenarios import restrict
from robust.presented import Presented
from robust.smt.limits import NEVER, Deadline, OutOfTimeError


class Moment(NamedTuple):
    """Until when a choice can get a value; `latest` None: at any time, or, if it is not possible, at none."""

    choice: str
    value: str
    possible: bool
    latest: Fraction | None


@dataclass
class Moments(Presented, ask="feasible"):
    """What was asked for, as far as it is known; `status` says what ended it."""

    feasible: bool | None = None
    """Whether a correct execution exists at all under the assumptions."""
    moments: list[Moment] = field(default_factory=list)
    status: str = "complete"

    @property
    def cut_short(self) -> bool:
        """Whether something ended it before it was done."""
        return self.status != "complete"


@dataclass
class LatestMoments:
    """Finds, for each uncontrollable choice and value, the greatest time that its event has in a correct execution.

    A patient executive begins at 0; its first steps are taken, as far as nothing is begun and nobody can choose. From
    then on whatever is left open, by whomever, is as it suits the value best.

    Args:
        assume: choices that are made already.
    """

    plan: TeamPlan
    assume: Guard = ALWAYS
    solver: str = "z3"
    deadline: Deadline = NEVER

    def __post_init__(self) -> None:
        self._known = Moments()

    def run(self) -> Moments:
        """Find them; a deadline or Ctrl-C ends it with what is known.

        Raises:
            SolverError: if the solver is unknown or not installed.
        """
        known = self._known
        try:
            executive = self._begun()
            reasoner = SemanticReasoner(executive.progress, solver=self.solver)
            known.feasible = not executive.ended or isinstance(executive.outcome, Succeeded)
            progress = executive.progress
            for each in values_of(openings(progress), progress):
                [(choice, value)] = each.values
                possible = known.feasible and reasoner.could(each.guard, self.deadline)
                latest = reasoner.latest(each.guard, each.events, self.deadline) if possible else None
                known.moments.append(Moment(choice, value, possible, latest))
        except OutOfTimeError:
            known.status = "timeout"
        except KeyboardInterrupt:
            known.status = "interrupted"
        return known

    def _begun(self) -> PlanExecutive:
        """An executive that has done what it does before anyone else can."""
        plan = restrict(self.plan, self.assume)
        reasoner = partial(SemanticReasoner, solver=self.solver)
        executive = PlanExecutive(plan, reasoner, deadline=self.deadline)
        now: Fraction | None = Fraction(0)
        while now is not None and not executive.ended:
            executive.step(now)
            progress = executive.progress
            if executive.running or any(each.event in progress.frontier for each in openings(progress)):
                break
            now = executive.wake
        return executive

    def so_far(self, *, timed_out: bool) -> Moments | None:
        """What is known by now; None before it is known whether the plan is feasible."""
        if self._known.feasible is None:
            return None
        self._known.status = "timeout" if timed_out else "interrupted"
        return self._known
