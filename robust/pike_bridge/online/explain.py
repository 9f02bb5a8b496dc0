"""Why no correct execution is left: as few facts as contradict each other, of all that have happened.

A conflict is minimal: without any one of its facts, some correct execution would be left. What the plan demands goes
without saying here; :mod:`robust.pike_bridge.online.reasons` names that, too.
"""

from __future__ import annotations

from robust.pike_bridge.model import ALWAYS, Guard
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.situation import Situation
from robust.pike_bridge.online.statements import Fact, Kind
from robust.smt.limits import Deadline

__all__ = ["Fact", "Kind", "conflict"]


def conflict(
    progress: Progress,
    environment: Guard = ALWAYS,
    *,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> tuple[Fact, ...] | None:
    """Why no correct execution continues what has happened in an environment; None if one does.

    No facts at all: the plan never had a correct execution.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """
    situation = Situation(progress, solver=solver, deadline=deadline)
    return situation.facts(situation.statements.assignments(Kind.ASSUMPTION, sorted(environment)))
