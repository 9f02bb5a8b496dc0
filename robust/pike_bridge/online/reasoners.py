"""Reasoners of executives by name."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.compile import Compilation, Compiling, Temporal
from robust.pike_bridge.online import SMT, reasoner_names
from robust.pike_bridge.online.knowledge_reasoners import DistanceTable, LazyReasoner, WindowReasoner
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import Reasoner
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.temporal.labeled_apsp import labeled_distances
from robust.smt.limits import NEVER, Deadline
from robust.smt.terms import Terms

__all__ = ["SMT", "CompiledReasoners", "make_reasoner", "reasoner_names"]


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
    deadline: Deadline = NEVER
    compilation: Compilation | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    """By stage: those of :class:`~robust.pike_bridge.compile.Compiling`, and windows."""

    def __call__(self, progress: Progress) -> Reasoner:
        compiling = Compiling(
            progress.plan, self.backend, temporal=self.temporal, solver=self.solver, deadline=self.deadline
        )
        self.seconds = compiling.seconds
        self.compilation = compiling.run()
        if self.temporal is Temporal.LAZY:
            return LazyReasoner(progress, self.compilation)
        started = time.perf_counter()
        try:
            return WindowReasoner(progress, self.compilation, self._table(self.compilation))
        finally:
            compiling.seconds["windows"] = time.perf_counter() - started

    def _table(self, compilation: Compilation) -> DistanceTable:
        network = compilation.augmented.network
        # A back end that reasons about time itself needs no conflicts, and so had no distances.
        distances = compilation.distances or labeled_distances(network, self.deadline)
        return DistanceTable(network, distances, self.deadline)


def make_reasoner(
    name: str, *, solver: str = "z3", temporal: Temporal = Temporal.LAZY, deadline: Deadline = NEVER
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
    terms = Terms()  # shared: executives that plan anew ask about one candidate after the other
    return lambda progress: SemanticReasoner(progress, solver=solver, terms=terms)
