"""The best of many choices by conflicts: of each clause of inequalities, the best point satisfies one.

What a point must satisfy is discovered conflict by conflict, a clause each. A solver looks for better and better
choices of one inequality for each known clause, exact linear programming makes the best of each choice, and when there
is no better one, its cost is a lower bound. If nothing conflicts with it, it is optimal; else it adds a clause. Going
on from there with the cheapest inequality of one clause after the other finds a good point early, if not the best.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from robust.encode.interface import variable
from robust.plan.model import ParameterReference
from robust.plan.polynomial import Polynomial
from robust.presented import VerdictEnum
from robust.qe import simplex
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.enumerate import satisfiable
from robust.searching import DECIDED, Searching, Status
from robust.smt.limits import Deadline
from robust.smt.session import Formula, Session, Terms


class Comparable(Protocol):
    """What costs can be, such as a number."""

    def __ge__(self, other: Any, /) -> bool: ...


CostT = TypeVar("CostT", bound=Comparable)
RepairT = TypeVar("RepairT")
Point = Mapping[str, Fraction]
Chosen = Mapping[int, LinearConstraint]
"""One inequality of each clause, by the number of the clause."""


@dataclass(frozen=True, slots=True)
class Clause:
    """A good point satisfies one of these inequalities; `reason` says what is wrong with points that do not."""

    choices: tuple[LinearConstraint, ...]
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Candidate(Generic[CostT]):
    """The best point under the inequalities that were chosen; `cost` is the infimum, and if it is not `attained`, the
    point costs a little more or is only approached."""

    chosen: Chosen
    point: Point
    cost: CostT
    attained: bool = True


class MasterProblem(ABC, Generic[CostT]):
    """The master problem: the best point that satisfies one inequality of each clause.

    Args:
        solver: `z3` or `cvc5`.
        deadline: when to stop.
        lowest: what no point costs less than, if that is known.
    """

    QUESTION: ClassVar[str]
    """What the solver is asked, for the log."""

    def __init__(self, *, solver: str, deadline: Deadline, lowest: CostT | None = None) -> None:
        self.deadline = deadline
        self.terms = Terms()
        self.session = Session(self.terms, solver=solver)
        self.clauses: list[Clause] = []
        self.best: Candidate[CostT] | None = None
        """The best point that is known to be good."""
        self.lowest = lowest
        self._asserted = 0

    @abstractmethod
    def cheapest(self, chosen: Chosen, point: Point) -> Candidate[CostT] | None:
        """The best point under inequalities that hold at the given point; None if there is none."""

    @abstractmethod
    def cheaper(self, cost: CostT) -> Formula:
        """The formula that a point costs less."""

    @abstractmethod
    def symbols(self) -> Iterable[str]:
        """The variables of the formulas."""

    def always(self) -> Iterable[LinearConstraint]:
        """What holds of all points, unless it is asserted together with the clauses."""
        return ()

    def holds(self, choice: LinearConstraint, point: Point) -> bool:
        """Whether an inequality holds at a point."""
        return choice.evaluate(point)

    def point_of(self, model: Point) -> Point:
        """The point that a model stands for."""
        return model

    def formula(self, clause: Clause) -> Formula:
        """The clause for the solver."""
        return self.terms.disjunction(choice.to_formula(self.terms) for choice in clause.choices)

    def best_known(self) -> Candidate[CostT] | None:
        """The best candidate that satisfies every known clause; None if none is better than the best good one.

        Raises:
            OutOfTimeError: if the deadline passes first, or the solver fails.
        """
        for clause in self.clauses[self._asserted :]:
            self.session.add(self.formula(clause))
        self._asserted = len(self.clauses)
        always = [constraint.to_formula(self.terms) for constraint in self.always()]
        symbols = [self.terms.real(ParameterReference(name)) for name in self.symbols()]
        beaten, candidate = self.best, None
        while candidate is None or candidate.cost != self.lowest:
            beating = [] if beaten is None else [self.cheaper(beaten.cost)]
            with self.session.frame(*always, *beating):
                if not satisfiable(self.session, self.QUESTION, self.deadline):
                    break
                values = self.session.values(symbols)
            point = self.point_of({name: Fraction(value) for name, value in values.items()})
            beaten = candidate = self.cheapest(self._chosen(point), point)
            if candidate is None:
                raise ValueError("a model satisfies the inequalities that were chosen by it")
        return candidate

    def _chosen(self, point: Point) -> Chosen:
        """An inequality of each clause that holds at a point."""
        return {
            number: next(choice for choice in clause.choices if self.holds(choice, point))
            for number, clause in enumerate(self.clauses)
        }


class ConflictSearch(MasterProblem[CostT]):
    """A search for the best point in which nothing conflicts; the separator adds clauses to the master problem."""

    def __init__(self, *, solver: str, deadline: Deadline, lowest: CostT) -> None:
        super().__init__(solver=solver, deadline=deadline, lowest=lowest)
        self.examined = 0
        """Points for which the separator was asked."""

    @abstractmethod
    def conflict_at(self, candidate: Candidate[CostT]) -> Clause | None:
        """The separator: a clause that the point does not satisfy; None if the point is good."""

    @abstractmethod
    def step(self, candidate: Candidate[CostT], number: int) -> Candidate[CostT] | None:
        """The cheapest candidate that satisfies one more clause, by its number; None if there is none."""

    def accept(self, candidate: Candidate[CostT]) -> None:
        """Keep a candidate that is good, and better than those before it."""
        self.best = candidate

    def is_hopeless(self) -> bool:
        """Whether no point can be good, for all that is soon known; asked once, after the first conflict."""
        return False

    def search(self) -> None:
        """Find the best point, and prove that there is none better; if none is found, there is no good one.

        Raises:
            OutOfTimeError: if the deadline passes first; no point costs less than `lowest`.
        """
        while self.best is None or self.best.cost != self.lowest:
            is_first = not self.clauses
            candidate = self.best_known()
            if candidate is None:
                break
            self.lowest = candidate.cost
            if self.violated(candidate) is None:
                self.accept(candidate)
            elif is_first and self.is_hopeless():
                return
            else:
                self._dive(candidate)
        if self.best is not None:
            self.lowest = self.best.cost

    def violated(self, candidate: Candidate[CostT]) -> int | None:
        """The number of a clause that the candidate does not satisfy, perhaps a new one; None if it is good."""
        self.deadline.enforce()
        for number, clause in enumerate(self.clauses):
            if not any(self.holds(choice, candidate.point) for choice in clause.choices):
                return number
        self.examined += 1
        conflict = self.conflict_at(candidate)
        if conflict is None:
            return None
        self.clauses.append(conflict)
        return len(self.clauses) - 1

    def _dive(self, candidate: Candidate[CostT]) -> None:
        """Satisfy one clause after the other as cheaply as possible; the end is good, if there is one."""
        while (number := self.violated(candidate)) is not None:
            step = self.step(candidate, number)
            if step is None or (self.best is not None and step.cost >= self.best.cost):
                return
            candidate = step
        self.accept(candidate)


class RepairStatus(VerdictEnum):
    """How a search for a repair ended."""

    UNNEEDED = "unneeded"
    """Nothing has to be changed."""
    OPTIMAL = "optimal"
    FEASIBLE = "feasible"
    """A repair, but perhaps not the cheapest."""
    IMPOSSIBLE = "impossible"
    """No allowed change repairs it."""
    UNKNOWN = "unknown"

    @property
    def is_open(self) -> bool:
        """Whether something ended the search before it was done."""
        return self in {RepairStatus.FEASIBLE, RepairStatus.UNKNOWN}


class RepairSearching(ConflictSearch[CostT], Searching[RepairT]):
    """A search for the least change by which nothing is wrong; points are changes, and no change is empty."""

    QUESTION = "cheaper changes that no known conflict forbids"

    def __init__(self, *, solver: str, deadline: Deadline, lowest: CostT) -> None:
        Searching.__init__(self)
        ConflictSearch.__init__(self, solver=solver, deadline=deadline, lowest=lowest)

    def _search(self) -> None:
        self.search()

    def repaired(self, status: Status) -> RepairStatus:
        """What is known of repairs when the search ends like this."""
        if status not in DECIDED:
            return RepairStatus.UNKNOWN if self.best is None else RepairStatus.FEASIBLE
        if self.best is None:
            return RepairStatus.IMPOSSIBLE
        return RepairStatus.OPTIMAL if self.best.point else RepairStatus.UNNEEDED


class WeightedRepairSearching(RepairSearching[Fraction, RepairT]):
    """A search for the least weighted sum of changes, each of which is not negative; those not in a point are 0.

    `weight` is what a unit of each change costs.
    """

    def __init__(self, *, solver: str, deadline: Deadline) -> None:
        super().__init__(solver=solver, deadline=deadline, lowest=Fraction(0))
        self.weight: dict[str, Fraction] = {}

    @abstractmethod
    def limits(self, names: Sequence[str]) -> Iterator[LinearConstraint]:
        """What holds of the changes with some names, in addition to that they are not negative."""

    def room(self, _name: str, _point: Point) -> Fraction | float:
        """How much more can be changed at a point."""
        return inf

    def rank(self, _name: str) -> int:
        """Of changes with equal costs, which comes first: that with the least rank."""
        return 0

    def symbols(self) -> list[str]:
        return sorted({n for clause in self.clauses for choice in clause.choices for n in choice.parameters})

    def always(self) -> Iterator[LinearConstraint]:
        return self._limits(self.symbols())

    def _limits(self, names: Sequence[str]) -> Iterator[LinearConstraint]:
        yield from (LinearConstraint.of({name: 1}, ">=", 0) for name in names)
        yield from self.limits(names)

    def holds(self, choice: LinearConstraint, point: Point) -> bool:
        return choice.evaluate(_Zeros(point))

    def cheaper(self, cost: Fraction) -> Formula:
        price = (variable(ParameterReference(name)).scaled(self.weight[name]) for name in self.symbols())
        return self.terms.greater(Polynomial.constant(cost) - sum(price, Polynomial({})))

    def cheapest(self, chosen: Chosen, _point: Point) -> Candidate[Fraction] | None:
        """The cheapest changes that satisfy inequalities; None if none do."""
        names = sorted({name for choice in chosen.values() for name in choice.parameters})
        constraints = [*chosen.values(), *self._limits(names)]
        best = simplex.maximize(names, constraints, {name: -self.weight[name] for name in names})
        if best is None or best.value is None:
            return None
        return Candidate(chosen, {name: value for name, value in best.point.items() if value}, -best.value)

    def accept(self, candidate: Candidate[Fraction]) -> None:
        """Keep the best repair so far, or a cheaper one under its inequalities."""
        self.best = candidate
        if candidate.cost == self.lowest:
            return
        polished = self.cheapest(candidate.chosen, candidate.point)
        if polished is not None and polished.cost < candidate.cost and self.violated(polished) is None:
            self.best = polished

    def step(self, candidate: Candidate[Fraction], number: int) -> Candidate[Fraction] | None:
        """A candidate with one more change, which resolves the conflict."""
        best: tuple[Fraction, int] | None = None
        cheapest: Candidate[Fraction] | None = None
        for choice in self.clauses[number].choices:
            missing = choice.value(_Zeros(candidate.point)) - choice.constant
            for name, factor in choice.coefficients:
                amount = missing / -factor
                rank = amount * self.weight[name], self.rank(name)
                if factor < 0 and amount <= self.room(name, candidate.point) and (best is None or rank < best):
                    best = rank
                    point = {**candidate.point, name: candidate.point.get(name, Fraction(0)) + amount}
                    cheapest = Candidate({**candidate.chosen, number: choice}, point, candidate.cost + rank[0])
        return cheapest


class _Zeros(dict[str, Fraction]):
    """Changes that are not mentioned are none."""

    def __missing__(self, _name: str) -> Fraction:
        return Fraction(0)
