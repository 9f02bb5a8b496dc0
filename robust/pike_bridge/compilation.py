"""Offline compilation: from a team plan to a knowledge base of all its correct executions [PIKE, Algorithm 4]."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum

from robust.pike_bridge.causal.augment import AugmentedPlan, Encoding, augment
from robust.pike_bridge.knowledge import create_knowledge_base, reasons_about_time
from robust.pike_bridge.knowledge.interface import KnowledgeBase, KnowledgeStatistics
from robust.pike_bridge.model import Guard, TeamPlan
from robust.pike_bridge.temporal.circulation import temporal_conflicts
from robust.pike_bridge.temporal.interface import Precedence
from robust.pike_bridge.temporal.labeled_apsp import LabeledDistances, labeled_distances
from robust.pike_bridge.temporal.structural import structural_precedence
from robust.smt.limits import Deadline


class Temporal(Enum):
    """How events are ordered, and temporal conflicts found.

    APSP is the paper's way: labeled all-pairs shortest paths of the plan, and again of the augmented plan. LAZY orders
    events by the structure of the plan and finds only such conflicts as the other constraints leave open.
    """

    LAZY = "lazy"
    APSP = "apsp"


@dataclass(frozen=True)
class Compilation:
    """What offline compilation leaves for execution."""

    backend: str
    augmented: AugmentedPlan
    conflicts: tuple[Guard, ...]
    """Temporal conflicts of the augmented plan; none if the back end reasons about time itself."""
    knowledge: KnowledgeBase
    distances: LabeledDistances | None = None
    """Of the augmented plan, where they were computed to find the conflicts."""


@dataclass
class Compiling:
    """One compilation; what has been found stays readable when a deadline or Ctrl-C ends it.

    Args:
        plan: the plan.
        backend: the name of a knowledge base.
        temporal: how events are ordered and temporal conflicts found.
        encoding: how conditions become choices.
        solver: `z3` or `cvc5`, for what is asked of solvers.
        shortcut: whether a theory without models may be recognised by a solver instead of being compiled.
        on_stage: called with the name of each stage that begins.
    """

    plan: TeamPlan
    backend: str
    temporal: Temporal = Temporal.LAZY
    encoding: Encoding = Encoding()  # noqa: RUF009 - immutable
    solver: str = "z3"
    shortcut: bool = True
    deadline: Deadline = Deadline()  # noqa: RUF009 - immutable
    on_stage: Callable[[str], None] | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    """By stage: precedence, links, conflicts, knowledge."""
    statistics: KnowledgeStatistics = field(default_factory=KnowledgeStatistics)
    augmented: AugmentedPlan | None = None
    conflicts: tuple[Guard, ...] | None = None
    knowledge: KnowledgeBase | None = None
    distances: LabeledDistances | None = None

    def run(self) -> Compilation:
        """Compile.

        Raises:
            OutOfTimeError: if the deadline passes first.
            InputError: an unknown back end or solver.
        """
        timed = reasons_about_time(self.backend)
        with self._stage("precedence"):
            precedence = self._precedence()
        with self._stage("links"):
            augmented = self.augmented = augment(self.plan, precedence, self.encoding)
        with self._stage("conflicts"):
            conflicts = self.conflicts = () if timed else self._conflicts(augmented)
        with self._stage("knowledge"):
            theory = replace(augmented.theory, conflicts=(*augmented.theory.conflicts, *conflicts))
            knowledge = self.knowledge = create_knowledge_base(
                self.backend,
                theory,
                network=augmented.network if timed else None,
                solver=self.solver,
                shortcut=self.shortcut,
                deadline=self.deadline,
                statistics=self.statistics,
            )
        return Compilation(self.backend, augmented, conflicts, knowledge, self.distances)

    def _precedence(self) -> Precedence:
        match self.temporal:
            case Temporal.APSP:
                return labeled_distances(self.plan.network, self.deadline)
            case Temporal.LAZY:
                return structural_precedence(self.plan.network, self.deadline)

    def _conflicts(self, augmented: AugmentedPlan) -> tuple[Guard, ...]:
        match self.temporal:
            case Temporal.APSP:
                distances = self.distances = labeled_distances(augmented.network, self.deadline)
                return tuple(distances.vocabulary.decode(conflict) for conflict in distances.conflicts)
            case Temporal.LAZY:
                return temporal_conflicts(augmented.network, augmented.theory, self.deadline, solver=self.solver)

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        if self.on_stage is not None:
            self.on_stage(name)
        started = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = time.perf_counter() - started


def compile_plan(
    plan: TeamPlan,
    *,
    backend: str,
    temporal: Temporal = Temporal.LAZY,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> Compilation:
    """Compile a plan; see :class:`Compiling` for more options, and for what is known after a time-out.

    Raises:
        OutOfTimeError: if the deadline passes first.
        InputError: an unknown back end or solver.
    """
    return Compiling(plan, backend, temporal=temporal, solver=solver, deadline=deadline).run()
