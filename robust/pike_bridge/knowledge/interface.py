"""What a knowledge base is to those who ask [PIKE §2.3, §5.7]."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias, runtime_checkable

from robust.pike_bridge.model import Guard
from robust.smt.limits import Deadline


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
    before the call), and KeyboardInterrupt on Ctrl-C.
    """

    name: str
    statistics: KnowledgeStatistics

    @abstractmethod
    def satisfiable(self, deadline: Deadline = ...) -> bool:
        """CorrectTeamPlanExists? of [PIKE §2.3]: whether a model is left."""

    @abstractmethod
    def could_commit(self, commitments: Sequence[Commitment], deadline: Deadline = ...) -> bool:
        """CouldCommitToAdditionalConstraints?: whether a model satisfies the commitments as well."""

    @abstractmethod
    def commit(self, commitments: Sequence[Commitment], deadline: Deadline = ...) -> None:
        """CommitToConstraints: from now on only models that satisfy the commitments count."""

    @abstractmethod
    def find_model(
        self, commitments: Sequence[Commitment], preferred: Mapping[str, str], deadline: Deadline = ...
    ) -> Mapping[str, str] | None:
        """A model that satisfies the commitments as well; None if there is none.

        Args:
            preferred: values that variables keep where that costs nothing; each back end tries in its own way.
        """

    @abstractmethod
    def count_models(self, deadline: Deadline = ...) -> int:
        """How many models are left."""

    @abstractmethod
    def models(self, deadline: Deadline = ...) -> Iterator[Mapping[str, str]]:
        """Every model that is left, once, in any order."""


@runtime_checkable
class HasImplicants(Protocol):
    """A knowledge base that knows all prime implicants of what is left of its theory [PIKE §5.1.2]."""

    def implicant_count(self, deadline: Deadline = ...) -> int:
        """How many there are; OutOfTimeError if the deadline passes."""
        ...

    def prime_implicants(self, deadline: Deadline = ...) -> Iterator[Guard]:
        """Every one, once; there may be very many. OutOfTimeError if the deadline passes."""
        ...
