"""Which assignments no model makes, as a solver tells."""

from __future__ import annotations

from collections.abc import Mapping

from robust.pike_bridge.knowledge.sat import SatKnowledgeBase
from robust.pike_bridge.model import Assignment
from robust.pike_bridge.theory import Theory
from robust.smt.limits import Deadline


def impossible_assignments(theory: Theory, solver: str, deadline: Deadline) -> list[Assignment]:
    """All assignments that no model of a theory makes; these are all assignments if there is no model.

    Each query either shows an assignment to be impossible, or finds a model with others that are not.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """
    knowledge = SatKnowledgeBase(theory, solver=solver)
    every = [Assignment(variable, value) for variable, values in theory.domains.items() for value in values]
    model: Mapping[str, str] | None = knowledge.model({}, deadline)
    if model is None:
        return every
    seen = set(model.items())
    impossible = []
    for assignment in every:
        if assignment in seen:
            continue
        model = knowledge.model(dict([assignment]), deadline)
        if model is None:
            impossible.append(assignment)
        else:
            seen.update(model.items())
    return impossible
