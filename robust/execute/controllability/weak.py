"""Weak controllability: a schedule exists for all values in a box, if they are known beforehand.

Every box that is a decoupled robustness envelope is weakly controllable by definition. Here it is decided again, from
the network alone: by Farkas' lemma, a point without a schedule is a negative cycle, found by an SMT query. In general
the question is coNP-complete (Morris and Muscettola, 1999).
"""

from __future__ import annotations

from dataclasses import dataclass

from robust.encode.interface import Facet
from robust.encode.network import TemporalNetwork
from robust.encode.validity import Validity
from robust.irr.box import Box
from robust.plan.model import ParametrizedPlan
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Terms


@dataclass(frozen=True, slots=True)
class WeakAnswer:
    """Whether every point of the box has a schedule; if not, the statements that some point contradicts."""

    is_controllable: bool
    contradiction: tuple[str, ...] = ()


def weak(
    plan: ParametrizedPlan,
    box: Box,
    *,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> WeakAnswer:
    """Whether every point of the closure of a box has a schedule: none is lost at open ends.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    terms = Terms()
    validity = Validity(TemporalNetwork(plan), (), terms)
    found = validity.broken_facet(box.ranges, lambda: Session(terms, solver=solver), deadline)
    match found:
        case None:
            return WeakAnswer(True)
        case Facet():
            return WeakAnswer(False, found.origins)
        case Verdict():
            raise OutOfTimeError
