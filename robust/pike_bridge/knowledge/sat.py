"""Nothing compiled: an incremental solver is asked each question, about time as well if it is given a network."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import assert_never

from robust.errors import InputError
from robust.pike_bridge.knowledge.interface import (
    Commitment,
    KnowledgeBase,
    KnowledgeStatistics,
    check_assignments,
    check_theory,
    fold,
    is_consistent,
    narrowing,
)
from robust.pike_bridge.model import Assignment, Constraint, Guard, Tpnu
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula as Term
from robust.smt.terms import Terms

NEVER = Deadline()


class Encoding:
    """Finite-domain variables as booleans, and formulas about them as terms.

    A variable with two values is one boolean; with more, each value is one, of which exactly one is true.
    """

    def __init__(self, domains: Mapping[str, tuple[str, ...]]) -> None:
        self.terms = Terms()
        self._domains = domains
        self._values: dict[Assignment, Term] = {}
        self.axioms: list[Term] = []
        """What makes each variable have exactly one value."""
        for position, (variable, values) in enumerate(domains.items()):
            self._declare(position, variable, values)
        self.symbols = frozenset().union(*map(self.terms.variables, self._values.values()))

    def assignment(self, assignment: Assignment) -> Term:
        """The literal of an assignment."""
        return self._values[assignment]

    def environment(self, assignments: Iterable[Assignment]) -> Term:
        """The conjunction of assignments."""
        return self.terms.conjunction(self._values[each] for each in sorted(assignments))

    def formula(self, formula: Formula) -> Term:
        """A formula as a term."""
        return fold(formula, self._combine)

    def model(self, session: Session) -> dict[str, str]:
        """The assignment of the last satisfiable check; variables that nothing is said of get their first value."""
        values = session.values(self.symbols)

        def holds(literal: Term) -> bool:
            if literal.is_not():
                return not values.get(literal.arg(0).symbol_name(), False)
            return literal is self.terms.true or bool(values.get(literal.symbol_name(), False))

        return {
            variable: next((each for each in domain if holds(self._values[Assignment(variable, each)])), domain[0])
            for variable, domain in self._domains.items()
        }

    def _declare(self, position: int, variable: str, values: tuple[str, ...]) -> None:
        assignments = [Assignment(variable, value) for value in values]
        if len(values) == 1:
            self._values[assignments[0]] = self.terms.true
            return
        count = 1 if len(values) == 2 else len(values)
        symbols = [self.terms.fresh_boolean(f"variable {position} value {at} ") for at in range(count)]
        if count == 1:
            symbols.append(self.terms.negation(symbols[0]))
        else:
            self.axioms.append(self.terms.disjunction(symbols))
            for pair in combinations(symbols, 2):
                self.axioms.append(self.terms.disjunction(map(self.terms.negation, pair)))
        self._values.update(zip(assignments, symbols, strict=True))

    def _combine(self, formula: Formula, parts: list[Term]) -> Term:
        match formula:
            case Is(assignment):
                return self._values[assignment]
            case Not():
                return self.terms.negation(parts[0])
            case All():
                return self.terms.conjunction(parts)
            case Some():
                return self.terms.disjunction(parts)
            case _:
                assert_never(formula)


class SatKnowledgeBase(KnowledgeBase):
    """One incremental solver session.

    Args:
        theory: what is to be satisfied.
        network: if given, models are those that admit times for its events, too. Its choices are variables of the
            theory; temporal conflicts need not be known then.
        solver: `z3` or `cvc5`.
        deadline: for stating the theory.
        statistics: counters to add to.

    Raises:
        InputError: if the theory or the network mentions an unknown variable, value or event.
        SolverError: if the solver is unknown or not installed.
        OutOfTimeError: if the deadline passes.
    """

    name = "sat"

    def __init__(
        self,
        theory: Theory,
        network: Tpnu | None = None,
        *,
        solver: str = "z3",
        deadline: Deadline = NEVER,
        statistics: KnowledgeStatistics | None = None,
    ) -> None:
        check_theory(theory)
        self.theory = theory
        self.statistics = statistics or KnowledgeStatistics()
        self._solver = solver
        started = time.perf_counter()
        self._encoding = Encoding(theory.domains)
        self._terms = self._encoding.terms
        self._formulas = [*self._encoding.axioms, *self._state(deadline)]
        if network is not None:
            self._formulas += _temporal(network, theory, self._encoding, deadline)
        self._session = self._start(deadline)
        self.statistics.sizes["formulas"] = len(self._formulas)
        self.statistics.seconds += time.perf_counter() - started

    def satisfiable(self, deadline: Deadline = NEVER) -> bool:
        return self._ask((), deadline)

    def could_commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> bool:
        return self._ask(self._narrow(commitments), deadline)

    def commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> None:
        deadline.enforce()
        terms = self._narrow(commitments)
        self._formulas += terms
        self._session.add(*terms)

    def find_model(
        self, commitments: Sequence[Commitment], preferred: Mapping[str, str], deadline: Deadline = NEVER
    ) -> Mapping[str, str] | None:
        """The model that the solver finds; it has preferences of its own."""
        deadline.enforce()
        self.statistics.queries += 1
        with self._session.frame(*self._narrow(commitments)):
            return self._encoding.model(self._session) if self._check(self._session, deadline) else None

    def count_models(self, deadline: Deadline = NEVER) -> int:
        """Counts by listing; see :meth:`models`."""
        return sum(1 for _ in self.models(deadline))

    def models(self, deadline: Deadline = NEVER) -> Iterator[Mapping[str, str]]:
        """Models as a session of its own finds them, each excluded once it is found."""
        deadline.enforce()
        self.statistics.queries += 1
        return self._enumerate(self._start(deadline), deadline)

    def model(self, required: Mapping[str, str], deadline: Deadline = NEVER) -> Mapping[str, str] | None:
        """A model in which variables have the required values; None if there is none.

        Raises:
            InputError: if a variable or a value is unknown.
            OutOfTimeError: if the deadline passes.
        """
        assignments = {Assignment(*item) for item in required.items()}
        check_assignments(assignments, self.theory, "a requirement")
        with self._session.frame(self._encoding.environment(assignments)):
            return self._encoding.model(self._session) if self._check(self._session, deadline) else None

    def _ask(self, terms: Iterable[Term], deadline: Deadline) -> bool:
        deadline.enforce()
        self.statistics.queries += 1
        with self._session.frame(*terms):
            return self._check(self._session, deadline)

    def _check(self, session: Session, deadline: Deadline) -> bool:
        match session.check("models left", deadline):
            case Verdict.SATISFIABLE:
                return True
            case Verdict.UNSATISFIABLE:
                return False
            case Verdict.UNKNOWN:
                raise OutOfTimeError

    def _enumerate(self, session: Session, deadline: Deadline) -> Iterator[Mapping[str, str]]:
        while self._check(session, deadline):
            model = self._encoding.model(session)
            yield model
            found = self._encoding.environment(Assignment(*item) for item in model.items())
            session.add(self._terms.negation(found))

    def _start(self, deadline: Deadline) -> Session:
        session = Session(self._terms, solver=self._solver)
        session.add_all(self._formulas, deadline)
        return session

    def _state(self, deadline: Deadline) -> Iterator[Term]:
        for constraint in self.theory.constraints:
            deadline.enforce()
            yield self._encoding.formula(constraint)
        for conflict in filter(is_consistent, self.theory.conflicts):
            deadline.enforce()
            yield self._excluded(conflict)

    def _excluded(self, environment: Guard) -> Term:
        return self._terms.negation(self._encoding.environment(environment))

    def _narrow(self, commitments: Sequence[Commitment]) -> list[Term]:
        asked = narrowing(commitments, self.theory)
        if not asked.consistent:
            return [self._terms.false]
        required = self._encoding.environment(Assignment(*item) for item in asked.required.items())
        return [required, *map(self._excluded, asked.conflicts)]


def _temporal(network: Tpnu, theory: Theory, encoding: Encoding, deadline: Deadline) -> Iterator[Term]:
    """Each temporal constraint of a network, if its guard holds; times of other events do not matter."""
    events = {event.name for event in network.events}
    for constraint in network.temporal_constraints:
        deadline.enforce()
        where = f"the constraint from {constraint.source} to {constraint.target}"
        check_assignments(constraint.guard, theory, where)
        for name in (constraint.source, constraint.target):
            if name not in events:
                raise InputError(f"{where} mentions {name}, which is not an event of the network")
        if is_consistent(constraint.guard):
            bounds = encoding.terms.conjunction(_bounds(constraint, encoding.terms))
            yield encoding.terms.implication(encoding.environment(constraint.guard), bounds)


def _bounds(constraint: Constraint, terms: Terms) -> Iterator[Term]:
    source, target = (Polynomial.variable(f"time of {name}") for name in (constraint.source, constraint.target))
    if constraint.lower is not None:
        yield terms.at_least(target - source - constraint.lower)
    if constraint.upper is not None:
        yield terms.at_least(source - target + constraint.upper)
