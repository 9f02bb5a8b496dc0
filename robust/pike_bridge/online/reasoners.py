"""Reasoners of executives by name."""

from __future__ import annotations

from collections.abc import Callable

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import Reasoner
from robust.smt.limits import Deadline

SMT = "smt"
"""The reasoner that compiles nothing."""


def reasoner_names() -> tuple[str, ...]:
    """What :func:`make_reasoner` knows."""
    return (SMT,)


def make_reasoner(
    name: str,
    *,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> Callable[[Progress], Reasoner]:
    """What makes the reasoner of that name for an execution; `deadline` is for what it compiles before.

    Raises:
        InputError: if there is no such reasoner.
    """
    if name not in reasoner_names():
        raise InputError(f"unknown reasoner {name!r}{did_you_mean(name, reasoner_names())}")
    from robust.pike_bridge.online.semantic import SemanticReasoner  # noqa: PLC0415 - imports solvers
    from robust.smt.terms import Terms  # noqa: PLC0415

    terms = Terms()  # shared: executives that plan anew ask about one candidate after the other
    return lambda progress: SemanticReasoner(progress, solver=solver, terms=terms)
