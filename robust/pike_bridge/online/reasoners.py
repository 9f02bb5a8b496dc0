"""Reasoners of executives by name."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.compile import Compilation, Compiling, Temporal
from robust.pike_bridge.knowledge import knowledge_bases
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import Reasoner
from robust.smt.limits import Deadline

if TYPE_CHECKING:
    from robust.pike_bridge.online.dispatching import DistanceTable

SMT = "smt"
"""The reasoner that compiles nothing."""


def reasoner_names() -> tuple[str, ...]:
    """What :func:`make_reasoner` knows: `smt`, and the knowledge bases."""
    return (SMT, *knowledge_bases())


@dataclass
class CompiledReasoners:
    """Makes reasoners that compile the plan first, each anew, because executions narrow what is compiled.

    Args:
        backend: the name of a knowledge base.
        temporal: LAZY looks at the times of one scenario after the other; APSP keeps labeled execution windows
            [PIKE §3], for which the labeled distances of the augmented plan are computed. They decide the same.
        solver: `z3` or `cvc5`, for what is asked of solvers.
        deadline: for compiling.

    Making a reasoner raises OutOfTimeError if the deadline passes, and InputError if the back end or the solver is
    unknown; afterwards `compilation` and `seconds` are those of the last one.
    """

    backend: str
    temporal: Temporal = Temporal.LAZY
    solver: str = "z3"
    deadline: Deadline = Deadline()  # noqa: RUF009 - immutable
    compilation: Compilation | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    """By stage: those of :class:`~robust.pike_bridge.compile.Compiling`, and windows."""

    def __call__(self, progress: Progress) -> Reasoner:
        compiling = Compiling(
            progress.plan, self.backend, temporal=self.temporal, solver=self.solver, deadline=self.deadline
        )
        self.seconds = compiling.seconds
        self.compilation = compiling.run()
        match self.temporal:
            case Temporal.LAZY:
                from robust.pike_bridge.online.lazy import LazyReasoner  # noqa: PLC0415 - only what is used

                return LazyReasoner(progress, self.compilation)
            case Temporal.APSP:
                from robust.pike_bridge.online.dispatching import WindowReasoner  # noqa: PLC0415

                started = time.perf_counter()
                try:
                    table = self._table(self.compilation)
                finally:
                    compiling.seconds["windows"] = time.perf_counter() - started
                return WindowReasoner(progress, self.compilation, table)

    def _table(self, compilation: Compilation) -> DistanceTable:
        from robust.pike_bridge.online.dispatching import DistanceTable  # noqa: PLC0415
        from robust.pike_bridge.temporal.labeled_apsp import labeled_distances  # noqa: PLC0415

        network = compilation.augmented.network
        # A back end that reasons about time itself needs no conflicts, and so had no distances.
        distances = compilation.distances or labeled_distances(network, self.deadline)
        return DistanceTable(network, distances, self.deadline)


def make_reasoner(
    name: str,
    *,
    solver: str = "z3",
    temporal: Temporal = Temporal.LAZY,
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> Callable[[Progress], Reasoner]:
    """What makes the reasoner of that name for an execution.

    Args:
        name: one of :func:`reasoner_names`; for all but `smt` it is a :class:`CompiledReasoners`.
        solver: `z3` or `cvc5`, for what is asked of solvers.
        temporal: how compiled reasoners find out about time.
        deadline: for what is compiled before; the reasoner is not made, with OutOfTimeError, if it passes.

    Raises:
        InputError: if there is no such reasoner.
    """
    if name not in reasoner_names():
        raise InputError(f"unknown reasoner {name!r}{did_you_mean(name, reasoner_names())}")
    if name != SMT:
        return CompiledReasoners(name, temporal=temporal, solver=solver, deadline=deadline)
    from robust.pike_bridge.online.semantic import SemanticReasoner  # noqa: PLC0415 - imports solvers
    from robust.smt.terms import Terms  # noqa: PLC0415

    terms = Terms()  # shared: executives that plan anew ask about one candidate after the other
    return lambda progress: SemanticReasoner(progress, solver=solver, terms=terms)
