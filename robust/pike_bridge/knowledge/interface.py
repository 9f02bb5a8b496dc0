"""What every knowledge base answers, what is committed to, and the effort that compiling and asking take."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final, Protocol, TypeAlias, assert_never, runtime_checkable

from robust.pike_bridge.model import Assignment, Guard
from robust.pike_bridge.theory import Theory, check_assignments, check_theory, is_consistent
from robust.smt.limits import NEVER, Deadline, OutOfTimeError


@dataclass(frozen=True, slots=True)
class Require:
    """All assignments of the environment hold."""

    environment: Guard


@dataclass(frozen=True, slots=True)
class Exclude:
    """The environment is a conflict: not all of its assignments hold. Of the empty environment this is false."""

    environment: Guard


Commitment: TypeAlias = Require | Exclude
"""The constraints that execution adds are assignments and conflicts, nothing else [PIKE §3, §5.7]."""


@dataclass(frozen=True, slots=True)
class Narrowing:
    """What commitments come to: the conjunction of all assignments, and the conflicts that it does not resolve."""

    required: Mapping[str, str]
    conflicts: tuple[Guard, ...]
    """Without what is required already; a conflict that is manifested has become the empty environment."""
    consistent: bool
    """Whether no variable got two values, and no conflict is manifested."""


def narrowing(commitments: Sequence[Commitment], theory: Theory) -> Narrowing:
    """The conjunction of commitments.

    Raises:
        InputError: if a variable or a value is unknown.
    """
    required: dict[str, str] = {}
    excluded: list[Guard] = []
    consistent = True
    for commitment in commitments:
        check_assignments(commitment.environment, theory, "a commitment")
        match commitment:
            case Require(environment):
                for variable, value in environment:
                    consistent = required.setdefault(variable, value) == value and consistent
            case Exclude(environment):
                if is_consistent(environment):
                    excluded.append(environment)
            case _:
                assert_never(commitment)
    made = frozenset(Assignment(*item) for item in required.items())
    conflicts = tuple(dict.fromkeys(each - made for each in excluded if is_consistent(each | made)))
    return Narrowing(required, conflicts, consistent and frozenset() not in conflicts)


@dataclass(slots=True)
class KnowledgeStatistics:
    """What compiling and asking cost; counters that mean nothing for a back end stay zero."""

    seconds: float = 0.0
    """For compilation."""
    environments_created: int = 0
    environments_subsumed: int = 0
    propagations: int = 0
    queries: int = 0
    sizes: dict[str, int] = field(default_factory=dict)
    """Of what was compiled: nodes, justifications, decision-diagram nodes, clauses."""


class KnowledgeBase(ABC):
    """The models of a theory that execution narrows. Model: an assignment to all variables of the theory.

    Every method may take long and raises OutOfTimeError if its deadline passes (the knowledge base stays as it was
    before the call), KeyboardInterrupt on Ctrl-C, and InputError for commitments about unknown variables or values.

    Raises:
        InputError: if the theory mentions an unknown variable or value, or has a variable without values.
    """

    name: str

    def __init__(self, theory: Theory, statistics: KnowledgeStatistics | None) -> None:
        check_theory(theory)
        self.theory = theory
        self.statistics = statistics or KnowledgeStatistics()

    def satisfiable(self, deadline: Deadline = NEVER) -> bool:
        """CorrectTeamPlanExists? of [PIKE §2.3]: whether a model is left."""
        return self.could_commit((), deadline)

    def could_commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> bool:
        """CouldCommitToAdditionalConstraints?: whether a model satisfies the commitments as well."""
        asked = self._asked(commitments, deadline)
        return asked.consistent and self._possible(asked, deadline)

    @abstractmethod
    def commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> None:
        """CommitToConstraints: from now on only models that satisfy the commitments count."""

    def count_models(self, deadline: Deadline = NEVER) -> int:
        """How many models are left."""
        self._asked((), deadline)
        return self._count(deadline)

    @abstractmethod
    def _possible(self, asked: Narrowing, deadline: Deadline) -> bool:
        """Whether a model satisfies what is asked, which does not contradict itself."""

    @abstractmethod
    def _count(self, deadline: Deadline) -> int: ...

    def _asked(self, commitments: Sequence[Commitment], deadline: Deadline) -> Narrowing:
        """Count a query, and say what its commitments come to."""
        deadline.enforce()
        self.statistics.queries += 1
        return narrowing(commitments, self.theory)

    @contextmanager
    def _compiling(self, deadline: Deadline) -> Iterator[None]:
        """Measure how long compiling takes, also if it ends early."""
        started = time.perf_counter()
        try:
            deadline.enforce()
            yield
        finally:
            self.statistics.seconds += time.perf_counter() - started


@runtime_checkable
class HasImplicants(Protocol):
    """A knowledge base that knows all prime implicants of what is left of its theory [PIKE §5.1.2]."""

    def implicant_count(self, deadline: Deadline = NEVER) -> int:
        """How many there are; OutOfTimeError if the deadline passes."""
        ...

    def prime_implicants(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """Every one, once; there may be very many. OutOfTimeError if the deadline passes."""
        ...


LARGEST_LABEL: Final = 4_000_000
"""Environments of one label; about half a gigabyte at a hundred assignments each."""
GLANCE: Final = 2_000
"""Environments that are created between two looks at the clock."""


class OutOfSpaceError(OutOfTimeError):
    """What is compiled grew beyond its limit, which ends a search with this reason."""

    def __init__(self) -> None:
        super().__init__("what is compiled became too large")


@dataclass(slots=True)
class Effort:
    """Counts what label propagation does, and ends it in time."""

    statistics: KnowledgeStatistics
    deadline: Deadline = NEVER
    largest_label: int = LARGEST_LABEL
    _unseen: int = field(default=0, init=False)

    def create(self, environments: int) -> None:
        """Note environments that were created.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        self.statistics.environments_created += environments
        self.pass_by(environments)

    def pass_by(self, environments: int) -> None:
        """Note environments that were looked at.

        Raises:
            OutOfTimeError: if the deadline has passed.
        """
        self._unseen += environments
        if self._unseen >= GLANCE:
            self._unseen = 0
            self.deadline.enforce()

    def subsume(self, environments: int) -> None:
        """Note environments that were dropped, because others entail less."""
        self.statistics.environments_subsumed += environments

    def hold(self, environments: int) -> None:
        """Note the size of a label.

        Raises:
            OutOfSpaceError: if it is too large.
        """
        if environments > self.largest_label:
            raise OutOfSpaceError
