"""Theories of propositional state logic over finite-domain variables [PIKE §5.3], and questions about their models.

Formulas may be very deep, so that everything here goes through them without recursion, by :func:`interpret`. All
knowledge bases have one interface; the effort that compiling and asking take is counted. The variables that constraints
have in common tell independent groups of constraints, and orders of variables for decision diagrams.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush
from typing import Final, Protocol, TypeAlias, TypeVar, assert_never, runtime_checkable

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.model import Assignment, Guard
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

T = TypeVar("T")
Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True, slots=True)
class Is:
    """`variable = value`."""

    assignment: Assignment


@dataclass(frozen=True, slots=True)
class Not:
    operand: Formula


@dataclass(frozen=True, slots=True)
class All:
    """A conjunction; true without operands."""

    operands: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Some:
    """A disjunction; false without operands."""

    operands: tuple[Formula, ...]


Formula: TypeAlias = Is | Not | All | Some


def conjunction(guard: Guard) -> All:
    """The conjunction of a guard's assignments, in sorted order."""
    return All(tuple(Is(assignment) for assignment in sorted(guard)))


@dataclass(frozen=True, slots=True)
class Theory:
    """Constraints over finite-domain variables; conflicts are environments that must not hold.

    A model is an assignment to all variables that satisfies every constraint and resolves every conflict.
    """

    domains: Mapping[str, tuple[str, ...]]
    constraints: tuple[Formula, ...] = ()
    conflicts: tuple[Guard, ...] = ()


TRUE: Final = All(())
FALSE: Final = Some(())


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


def _bottom_up(formula: Formula) -> list[Formula]:
    """All subformulas, each after its operands; repeated ones as often as they occur."""
    order: list[Formula] = []
    stack: list[Formula] = [formula]
    while stack:
        one = stack.pop()
        order.append(one)
        stack.extend(operands(one))
    return order[::-1]


def evaluate(key: Key, known: dict[Key, T], step: Callable[[Key], T | list[Key]], deadline: Deadline) -> T:
    """The value of a key, by depth-first search without recursion.

    Args:
        known: values so far, to which all new ones are added.
        step: the value of a key, or the keys whose values must be known first.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    stack = [key]
    while stack:
        deadline.enforce()
        one = stack[-1]
        if one in known:
            stack.pop()
            continue
        result = step(one)
        if isinstance(result, list):
            stack += result
        else:
            known[one] = result
            stack.pop()
    return known[key]


def interpret(
    formula: Formula,
    assignment: Callable[[Assignment], T],
    negation: Callable[[T], T],
    conjunction: Callable[[list[T]], T],
    disjunction: Callable[[list[T]], T],
) -> T:
    """The value of a formula, bottom up, where each connective is given by what it does to values."""
    values: dict[int, T] = {}  # by identity: hashing a deep formula would recurse
    for one in _bottom_up(formula):
        if id(one) not in values:
            parts = [values[id(operand)] for operand in operands(one)]
            match one:
                case Is(made):
                    values[id(one)] = assignment(made)
                case Not():
                    values[id(one)] = negation(parts[0])
                case All():
                    values[id(one)] = conjunction(parts)
                case Some():
                    values[id(one)] = disjunction(parts)
                case _:
                    assert_never(one)
    return values[id(formula)]


def joined(kind: type[All | Some], formulas: Iterable[Formula]) -> Formula:
    """All or some of the formulas, with constants folded and nested junctions of the same kind flattened."""
    parts: list[Formula] = []
    for formula in formulas:
        if formula == (FALSE if kind is All else TRUE):
            return formula
        parts.extend(formula.operands if isinstance(formula, kind) else (formula,))
    return parts[0] if len(parts) == 1 else kind(tuple(parts))


def normal_form(formula: Formula, literal: Callable[[Assignment, bool], Formula]) -> Formula:
    """The formula with negations pushed inwards by De Morgan's laws, and constants folded [PIKE §5.3].

    Args:
        literal: what an assignment (True) or its negation (False) becomes.
    """
    # The value of a formula is its normal form with that of its negation.
    both: tuple[Formula, Formula] = interpret(
        formula,
        lambda made: (literal(made, True), literal(made, False)),
        lambda pair: (pair[1], pair[0]),
        lambda pairs: (joined(All, (each[0] for each in pairs)), joined(Some, (each[1] for each in pairs))),
        lambda pairs: (joined(Some, (each[0] for each in pairs)), joined(All, (each[1] for each in pairs))),
    )
    return both[0]


def assignments_of(formula: Formula) -> set[Assignment]:
    """Every assignment that a formula mentions."""
    return {one.assignment for one in _bottom_up(formula) if isinstance(one, Is)}


def is_consistent(environment: Guard) -> bool:
    """Whether no variable has two values."""
    return len({assignment.variable for assignment in environment}) == len(environment)


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


# -- knowledge bases --------------------------------------------------------------------------------------------------


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
        """CouldCommitToAdditionalConstraints? of [PIKE §2.3]: whether a model satisfies the commitments as well."""
        asked = self._asked(commitments, deadline)
        return asked.consistent and self._possible(asked, deadline)

    def commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> None:
        """CommitToConstraints of [PIKE §2.3]: from now on only models that satisfy the commitments count."""
        deadline.enforce()
        self._narrow(narrowing(commitments, self.theory), deadline)

    def count_models(self, deadline: Deadline = NEVER) -> int:
        """How many models are left."""
        self._asked((), deadline)
        return self._count(deadline)

    @abstractmethod
    def _narrow(self, asked: Narrowing, deadline: Deadline) -> None:
        """Keep those models that satisfy what is asked."""

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


# -- orders of variables ----------------------------------------------------------------------------------------------

ROUNDS = 40
"""Of the FORCE heuristic."""
FIRST_TRY: Final = 500_000
"""The space that each order gets in the first round of a race."""
MORE: Final = 4
"""Times as much in each further round."""


def race(
    variables: Sequence[str],
    groups: Sequence[Collection[str]],
    largest: int,
    compile_in: Callable[[Sequence[str], int], T],
) -> T:
    """What is compiled in the first of two orders that needs little space: each is given some, and more in each round.

    Elimination is better for plans, whose supports depend on few choices; FORCE is better for constraints in a row.

    Args:
        groups: the variables of each constraint.
        compile_in: compiles in an order and a space; OutOfSpaceError if that is too small.

    Raises:
        OutOfSpaceError: if both orders need more than the largest space.
    """
    orders = (elimination_order(variables, groups), force_order(variables, groups))
    space = min(FIRST_TRY, largest)
    while True:
        for order in orders:
            try:
                return compile_in(order, space)
            except OutOfSpaceError:
                continue
        if space == largest:
            raise OutOfSpaceError
        space = min(MORE * space, largest)


def connected(items: Iterable[T], about: Callable[[T], frozenset[Key]]) -> list[list[T]]:
    """Groups of items that share variables, directly or through others; what has none is a group of its own."""
    groups: list[tuple[frozenset[Key], list[T]]] = []
    for item in items:
        variables, members = about(item), [item]
        apart = []
        for known, others in groups:
            if known & variables:
                variables, members = variables | known, others + members
            else:
                apart.append((known, others))
        groups = [*apart, (variables, members)]
    return [members for _, members in groups]


def elimination_order(variables: Sequence[str], groups: Sequence[Collection[str]]) -> list[str]:
    """Each variable as soon after those that decide about it as they allow.

    Variables are eliminated, that with the fewest neighbours first, of equals the last one; its neighbours become
    neighbours of each other. Of these, the one that is eliminated next is its parent. The order lists each variable
    before its children, small subtrees first: what is below a variable depends on its ancestors only (the pseudo-trees
    of Freuder and Quinn, 1985). Choices have many neighbours, and the supports of a condition few, so that these follow
    the last choice that they hang on.
    """
    place = {variable: at for at, variable in enumerate(variables)}
    graph: dict[str, set[str]] = {variable: set() for variable in variables}
    for group in groups:
        for variable in group:
            graph[variable].update(group)
    for variable, neighbours in graph.items():
        neighbours.discard(variable)
    queue = [(len(neighbours), -place[variable], variable) for variable, neighbours in graph.items()]
    heapify(queue)
    eliminated: dict[str, set[str]] = {}
    while queue:
        count, _, variable = heappop(queue)
        if variable in eliminated or count != len(graph[variable]):
            continue  # an earlier state of it
        neighbours = eliminated[variable] = graph.pop(variable)
        for other in neighbours:
            graph[other] |= neighbours
            graph[other] -= {variable, other}
            heappush(queue, (len(graph[other]), -place[other], other))
    return _parents_first(eliminated, place)


def _parents_first(eliminated: dict[str, set[str]], place: dict[str, int]) -> list[str]:
    """The variables of a forest; the parent of each is the first to be eliminated of its given neighbours."""
    when = {variable: at for at, variable in enumerate(eliminated)}
    children: dict[str | None, list[str]] = {}
    weight = dict.fromkeys(eliminated, 1)
    for variable, neighbours in eliminated.items():
        parent = min(neighbours, key=when.__getitem__, default=None)
        children.setdefault(parent, []).append(variable)
        if parent is not None:
            weight[parent] += weight[variable]
    order: list[str] = []
    stack: list[str | None] = [None]
    while stack:
        one = stack.pop()
        if one is not None:
            order.append(one)
        stack += sorted(children.get(one, ()), key=lambda child: (-weight[child], -place[child]))
    return order


def force_order(variables: Sequence[str], groups: Sequence[Collection[str]]) -> list[str]:
    """An order that keeps each group within a small span.

    The FORCE heuristic (Aloul, Markov and Sakallah, 2003): move each variable to the mean of the centres of its groups,
    sort, and repeat; the order with the least sum of spans is the result.
    """
    order = list(variables)
    best, least = order, _spans(order, groups)
    by_variable: dict[str, list[int]] = {variable: [] for variable in variables}
    for index, group in enumerate(groups):
        for variable in group:
            by_variable[variable].append(index)
    for _ in range(ROUNDS):
        place = {variable: at for at, variable in enumerate(order)}
        centres = [sum(place[variable] for variable in group) / len(group) if group else 0.0 for group in groups]
        target = {
            variable: sum(centres[index] for index in indices) / len(indices) if indices else float(place[variable])
            for variable, indices in by_variable.items()
        }
        order = sorted(order, key=lambda variable: (target[variable], place[variable]))
        total = _spans(order, groups)
        if total >= least:
            break
        best, least = order, total
    return best


def _spans(order: Sequence[str], groups: Sequence[Collection[str]]) -> int:
    place = {variable: at for at, variable in enumerate(order)}
    return sum(max(map(place.__getitem__, group)) - min(map(place.__getitem__, group)) for group in groups if group)
