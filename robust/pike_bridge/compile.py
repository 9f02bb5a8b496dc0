"""Offline compilation: from a team plan to a knowledge base of all its correct executions [PIKE, Algorithm 4]."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum

from robust.errors import InputError, SolverError, did_you_mean
from robust.pike_bridge.causal import AugmentedPlan, Encoding, augment
from robust.pike_bridge.knowledge import create_knowledge_base, reasons_about_time
from robust.pike_bridge.knowledge.interface import Commitment, KnowledgeBase, KnowledgeStatistics, Require
from robust.pike_bridge.model import ALWAYS, Assignment, Guard, TeamPlan
from robust.pike_bridge.model import guard as conjunction
from robust.pike_bridge.semantics import Execution, Existence, Oracle, faults
from robust.pike_bridge.temporal.distance_graph import Precedence
from robust.pike_bridge.temporal.labeled_apsp import LabeledDistances, labeled_distances
from robust.pike_bridge.temporal.schedule import Schedule, schedule, temporal_conflicts
from robust.pike_bridge.temporal.structural import structural_precedence
from robust.smt.limits import Deadline, OutOfTimeError


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


ORACLE = "oracle"


class Verdict(Enum):
    """Whether a correct execution exists under the assumptions: PROVED says yes, and shows one."""

    PROVED = "proved"
    REFUTED = "refuted"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class PikeCheck:
    """The answer. `scenarios` is None unless all were asked for; `complete` says whether none is missing."""

    backend: str
    verdict: Verdict
    execution: Execution | None = None
    scenarios: tuple[Mapping[str, str], ...] | None = None
    complete: bool = True
    interrupted: bool = False
    seconds: Mapping[str, float] | None = None
    """By stage."""


def checked_assumptions(plan: TeamPlan, assume: Mapping[str, str]) -> Guard:
    """The environment of assumptions.

    Raises:
        InputError: if there is no such choice or value.
    """
    domains = plan.network.domains
    for name, value in assume.items():
        if name not in domains:
            raise InputError(f"assumed {name}={value}, but there is no choice {name!r}{did_you_mean(name, domains)}")
        if value not in domains[name]:
            raise InputError(
                f"assumed {name}={value}, but {value!r} is not a value of {name}{did_you_mean(value, domains[name])}"
            )
    return conjunction(assume)


@dataclass
class Checking:
    """One check; `so_far` is what is known at any moment.

    Args:
        plan: the plan.
        backend: `oracle`, or the name of a knowledge base.
        assume: choices that are made already.
        all_scenarios: whether every team scenario is wanted.
        solver: `z3` or `cvc5`.
        temporal: how events are ordered and temporal conflicts found; of no concern to the oracle.
    """

    plan: TeamPlan
    backend: str = ORACLE
    assume: Guard = ALWAYS
    all_scenarios: bool = False
    solver: str = "z3"
    temporal: Temporal = Temporal.LAZY
    deadline: Deadline = Deadline()  # noqa: RUF009 - immutable
    on_stage: Callable[[str], None] | None = None

    def __post_init__(self) -> None:
        self._verdict = Verdict.UNKNOWN
        self._execution: Execution | None = None
        self._scenarios: list[Mapping[str, str]] = []
        self._complete = not self.all_scenarios
        self._seconds: dict[str, float] = {}

    def run(self) -> PikeCheck:
        """Check; a deadline or Ctrl-C ends it with what is known.

        Raises:
            InputError: an unknown back end or solver.
            SolverError: if a back end's answer is not confirmed.
        """
        interrupted = False
        try:
            for execution in self._executions():
                self._found(execution)
            self._complete = True
            if self._execution is None:
                self._verdict = Verdict.REFUTED
        except OutOfTimeError:
            pass  # the answer says what is missing
        except KeyboardInterrupt:
            interrupted = True
        return self.so_far(interrupted=interrupted)

    def so_far(self, *, interrupted: bool = False) -> PikeCheck:
        """What is known by now."""
        return PikeCheck(
            backend=self.backend,
            verdict=self._verdict,
            execution=self._execution,
            scenarios=tuple(self._scenarios) if self.all_scenarios else None,
            complete=self._complete,
            interrupted=interrupted,
            seconds=dict(self._seconds),
        )

    def _found(self, execution: Execution) -> None:
        self._verdict = Verdict.PROVED
        self._execution = self._execution or execution
        self._scenarios.append(execution.scenario)

    def _executions(self) -> Iterator[Execution]:
        """One execution, or one of each scenario."""
        return self._by_oracle() if self.backend == ORACLE else self._by_knowledge()

    def _by_oracle(self) -> Iterator[Execution]:
        self._begin("formula")
        started = time.perf_counter()
        oracle = Oracle(self.plan, solver=self.solver)
        self._seconds["formula"] = time.perf_counter() - started
        self._begin("search")
        started = time.perf_counter()
        try:
            if self.all_scenarios:
                yield from oracle.scenarios(self.assume, deadline=self.deadline)
                return
            answer = oracle.decide(self.assume, deadline=self.deadline)
            if answer.verdict is Existence.UNKNOWN:
                raise OutOfTimeError
            if answer.witness is not None:
                yield answer.witness
        finally:
            self._seconds["search"] = time.perf_counter() - started

    def _by_knowledge(self) -> Iterator[Execution]:
        compilation = Compiling(
            self.plan,
            self.backend,
            temporal=self.temporal,
            solver=self.solver,
            deadline=self.deadline,
            on_stage=self.on_stage,
            seconds=self._seconds,
        ).run()
        self._begin("search")
        started = time.perf_counter()
        try:
            knowledge = compilation.knowledge
            knowledge.commit([Require(self.assume)], self.deadline)
            if self.all_scenarios:
                for scenario in scenarios(knowledge, self.plan.network.domains, self.deadline):
                    yield execution_in(compilation, scenario, self.deadline)
            elif knowledge.satisfiable(self.deadline):
                yield execution_in(compilation, ALWAYS, self.deadline)
        finally:
            self._seconds["search"] = time.perf_counter() - started

    def _begin(self, stage: str) -> None:
        if self.on_stage is not None:
            self.on_stage(stage)


def scenarios(knowledge: KnowledgeBase, domains: Mapping[str, tuple[str, ...]], deadline: Deadline) -> Iterator[Guard]:
    """Every assignment to the given variables that some model of the knowledge base extends.

    Variable by variable, never entering an environment that could not be committed to: at most as many queries per
    scenario as there are values.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    names = list(domains)
    # Last in, first out: the next environment is the one with most assignments and the earliest values.
    open_environments: list[tuple[int, Guard]] = [(0, ALWAYS)] if knowledge.satisfiable(deadline) else []
    while open_environments:
        depth, environment = open_environments.pop()
        if depth == len(names):
            yield environment
            continue
        for value in reversed(domains[names[depth]]):
            extended = environment | {Assignment(names[depth], value)}
            if knowledge.could_commit([Require(extended)], deadline):
                open_environments.append((depth + 1, extended))


def execution_in(compilation: Compilation, environment: Guard, deadline: Deadline) -> Execution:
    """A correct execution in an environment that could be committed to, confirmed by the referee.

    Raises:
        SolverError: if there is none after all, so that the back end or the augmented plan is wrong.
        OutOfTimeError: if the deadline passes first.
    """
    model = extension(compilation.knowledge, compilation.augmented.theory.domains, environment, deadline)
    found = schedule(compilation.augmented.network, conjunction(model))
    if not isinstance(found, Schedule):
        raise SolverError(
            f"{compilation.backend} allows choices that have no schedule: {found.guard and sorted(found.guard)}; "
            "please report this"
        )
    plan = compilation.augmented.plan
    start = min(found.times.values(), default=None)
    execution = Execution(
        {name: model[name] for name in plan.network.domains},
        {event: when - (start or 0) for event, when in found.times.items()},
    )
    wrong = faults(plan, execution)
    if wrong:
        raise SolverError(
            f"{compilation.backend} gave an execution that is not correct: {wrong[0]}; please report this"
        )
    return execution


def extension(
    knowledge: KnowledgeBase, domains: Mapping[str, tuple[str, ...]], environment: Guard, deadline: Deadline
) -> dict[str, str]:
    """A model of the knowledge base in an environment, found by asking for one value after the other.

    Raises:
        SolverError: if the back end contradicts itself: no value of some variable could be committed to.
        OutOfTimeError: if the deadline passes first.
    """
    model = dict(environment)
    for name, values in domains.items():
        if name in model:
            continue
        for value in values:
            commitments: list[Commitment] = [Require(conjunction({**model, name: value}))]
            if knowledge.could_commit(commitments, deadline):
                model[name] = value
                break
        else:
            raise SolverError(
                f"{knowledge.name} allows an environment, but no value of {name} in it; please report this"
            )
    return model
