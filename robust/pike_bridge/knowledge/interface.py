"""Traversals of propositional formulas that no depth can break, and their normal forms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol, TypeAlias, TypeVar, assert_never, runtime_checkable

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.model import Assignment, Guard
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory
from robust.smt.limits import Deadline, OutOfTimeError

T = TypeVar("T")

TRUE = All(())
FALSE = Some(())


def operands(formula: Formula) -> tuple[Formula, ...]:
    """The immediate subformulas."""
    match formula:
        case Is():
            return ()
        case Not(operand):
            return (operand,)
        case All(parts) | Some(parts):
            return parts
        case _:
            assert_never(formula)


def fold(formula: Formula, combine: Callable[[Formula, list[T]], T]) -> T:
    """The value of a formula, computed from those of its operands, bottom up."""
    order: list[Formula] = []
    stack: list[Formula] = [formula]
    while stack:
        one = stack.pop()
        order.append(one)
        stack.extend(operands(one))
    values: dict[int, T] = {}  # by identity: hashing a deep formula would recurse
    for one in reversed(order):
        if id(one) not in values:
            values[id(one)] = combine(one, [values[id(operand)] for operand in operands(one)])
    return values[id(formula)]


def conjunction_of(formulas: Iterable[Formula]) -> Formula:
    """All of the formulas, with constants folded and nested conjunctions flattened."""
    parts: list[Formula] = []
    for formula in formulas:
        if formula == FALSE:
            return FALSE
        parts.extend(formula.operands if isinstance(formula, All) else (formula,))
    return parts[0] if len(parts) == 1 else All(tuple(parts))


def disjunction_of(formulas: Iterable[Formula]) -> Formula:
    """Some of the formulas, with constants folded and nested disjunctions flattened."""
    parts: list[Formula] = []
    for formula in formulas:
        if formula == TRUE:
            return TRUE
        parts.extend(formula.operands if isinstance(formula, Some) else (formula,))
    return parts[0] if len(parts) == 1 else Some(tuple(parts))


def normal_form(formula: Formula, literal: Callable[[Assignment, bool], Formula]) -> Formula:
    """The formula with negations pushed inwards by De Morgan's laws, and constants folded [PIKE §5.3].

    Args:
        literal: what an assignment (True) or its negation (False) becomes.
    """

    def both(one: Formula, parts: list[tuple[Formula, Formula]]) -> tuple[Formula, Formula]:
        """The normal forms of a formula and of its negation."""
        match one:
            case Is(assignment):
                return literal(assignment, True), literal(assignment, False)
            case Not():
                return parts[0][1], parts[0][0]
            case All():
                return conjunction_of(part[0] for part in parts), disjunction_of(part[1] for part in parts)
            case Some():
                return disjunction_of(part[0] for part in parts), conjunction_of(part[1] for part in parts)
            case _:
                assert_never(one)

    return fold(formula, both)[0]


def assignments_of(formula: Formula) -> set[Assignment]:
    """Every assignment that a formula mentions."""
    found: set[Assignment] = set()
    stack = [formula]
    while stack:
        one = stack.pop()
        if isinstance(one, Is):
            found.add(one.assignment)
        stack.extend(operands(one))
    return found


def check_assignments(assignments: Iterable[Assignment], theory: Theory, where: str) -> None:
    """Reject what is not an assignment to a variable of the theory.

    Raises:
        InputError: naming the first such variable or value.
    """
    for variable, value in sorted(assignments):
        if variable not in theory.domains:
            raise InputError(f"{where} mentions unknown variable {variable!r}{did_you_mean(variable, theory.domains)}")
        if value not in theory.domains[variable]:
            hint = did_you_mean(value, theory.domains[variable])
            raise InputError(f"{where} has {variable} = {value}, but {value!r} is not a value of {variable}{hint}")


def check_theory(theory: Theory) -> None:
    """Reject theories whose variables have no values or repeat them, and formulas about other variables or values.

    Raises:
        InputError: naming what is wrong.
    """
    for variable, values in theory.domains.items():
        if not values or len(set(values)) < len(values):
            raise InputError(f"variable {variable!r} has the values {values!r}; expected at least one, all different")
    for formula in theory.constraints:
        check_assignments(assignments_of(formula), theory, "a constraint")
    for conflict in theory.conflicts:
        check_assignments(conflict, theory, "a conflict")


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
    conflicts = tuple(dict.fromkeys(_left(each, required) for each in excluded if not _resolves(required, each)))
    return Narrowing(required, conflicts, consistent and frozenset() not in conflicts)


def is_consistent(environment: Guard) -> bool:
    """Whether no variable has two values."""
    return len({assignment.variable for assignment in environment}) == len(environment)


def _resolves(required: Mapping[str, str], conflict: Guard) -> bool:
    return any(required.get(variable, value) != value for variable, value in conflict)


def _left(conflict: Guard, required: Mapping[str, str]) -> Guard:
    return frozenset(Assignment(variable, value) for variable, value in conflict if variable not in required)


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


LARGEST_LABEL: Final = 4_000_000
"""Environments of one label; about half a gigabyte at a hundred assignments each."""
GLANCE: Final = 2_000
"""Environments that are created between two looks at the clock."""


class OutOfSpaceError(OutOfTimeError):
    """What is compiled grew beyond its limit, which ends it as its deadline would."""


@dataclass(slots=True)
class Effort:
    """Counts what label propagation does, and ends it in time."""

    statistics: KnowledgeStatistics
    deadline: Deadline = Deadline()  # noqa: RUF009 - immutable
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
