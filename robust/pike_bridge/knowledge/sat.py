"""Choices and times as formulas of a solver, and the knowledge base that asks an incremental solver each question."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, combinations

from robust.errors import InputError, SolverError, did_you_mean
from robust.pike_bridge.model import Assignment, Constraint, Guard, Tpnu, guard
from robust.pike_bridge.theory import KnowledgeBase, KnowledgeStatistics, Narrowing, Theory, interpret
from robust.plan.polynomial import Polynomial
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Formula as Term
from robust.smt.session import Satisfiability, Session, Terms, Value


class Propositions:
    """Finite-domain variables as booleans, and what is said of them and of the times of events as terms.

    A variable with two values is one boolean; with more, each value is one, of which exactly one is true. A guard is a
    conjunction, and the time of an event that is not activated does not matter.
    """

    def __init__(self, domains: Mapping[str, tuple[str, ...]], terms: Terms | None = None) -> None:
        self.terms = terms or Terms()
        self._domains = domains
        self._values: dict[Assignment, Term] = {}
        self.domains = tuple(formula for variable in domains for formula in self._declare(variable))
        """That each variable has exactly one value, to be asserted."""
        self.choices = frozenset[Term]().union(*map(self.terms.variables, self._values.values()))
        """The symbols of variables."""

    def _declare(self, variable: str) -> Iterator[Term]:
        """Symbols for a variable's values; what makes exactly one of them true."""
        terms, values = self.terms, self._domains[variable]
        if len(values) == 1:
            literals = [terms.true]
        elif len(values) == 2:
            symbol = self._symbol(variable, values[0])
            literals = [symbol, terms.negation(symbol)]
        else:
            literals = [self._symbol(variable, value) for value in values]
            yield terms.disjunction(literals)
            for pair in combinations(literals, 2):
                yield terms.disjunction(map(terms.negation, pair))
        self._values.update(zip((Assignment(variable, value) for value in values), literals, strict=True))

    def _symbol(self, variable: str, value: str) -> Term:
        return self.terms.fresh_boolean(f"{variable}={value} ".replace("%", "%%"))  # names are templates

    def guard(self, conjunction: Iterable[Assignment]) -> Term:
        """All assignments of a conjunction; InputError if one is unknown."""
        return self.terms.conjunction(map(self._assignment, sorted(conjunction)))

    def excluded(self, environment: Guard) -> Term:
        """The formula that not all assignments of an environment hold."""
        return self.terms.negation(self.guard(environment))

    def unless(self, guard: Guard, consequence: Term) -> Term:
        """The consequence, unless the guard does not hold."""
        return self.terms.implication(self.guard(guard), consequence)

    def theory(self, theory: Theory) -> Iterator[Term]:
        """Each constraint and each conflict of a theory about these variables, and that they have values."""
        yield from self.domains
        terms = self.terms
        for formula in theory.constraints:
            yield interpret(formula, self._assignment, terms.negation, terms.conjunction, terms.disjunction)
        yield from map(self.excluded, theory.conflicts)

    def constraint(self, constraint: Constraint) -> Term:
        """A temporal constraint, if its guard holds."""
        difference = self.difference(constraint.source, constraint.target)
        bounds = []
        if constraint.lower is not None:
            bounds.append(self.terms.at_least(difference - constraint.lower))
        if constraint.upper is not None:
            bounds.append(self.terms.at_least(-difference + constraint.upper))
        return self.unless(constraint.guard, self.terms.conjunction(bounds))

    def assigned(self, values: Mapping[str, Value]) -> dict[str, str]:
        """The assignments that a solver's model makes; a variable that nothing is said of gets none."""

        def holds(literal: Term) -> bool:
            if literal is self.terms.true:
                return True
            negated = literal.is_not()
            value = values.get((literal.arg(0) if negated else literal).symbol_name())
            return value is not None and bool(value) != negated

        return dict(assignment for assignment, literal in self._values.items() if holds(literal))

    def chosen(self, values: Mapping[str, Value]) -> dict[str, str]:
        """The assignment of a solver's model; a variable that nothing is said of gets its first value."""
        return {name: domain[0] for name, domain in self._domains.items()} | self.assigned(values)

    def _assignment(self, assignment: Assignment) -> Term:
        if assignment not in self._values:
            known = [str(each) for each in self._values]
            raise InputError(f"unknown assignment {assignment}{did_you_mean(str(assignment), known)}")
        return self._values[assignment]

    def time_of(self, event: str) -> Polynomial[str]:
        """The event's time as an expression."""
        return Polynomial.variable(f"time of {event}")

    def difference(self, earlier: str, later: str) -> Polynomial[str]:
        """How much later an event is than another."""
        return self.time_of(later) - self.time_of(earlier)


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
        super().__init__(theory, statistics)
        self._solver = solver
        with self._compiling(deadline):
            self._propositions = Propositions(theory.domains)
            self._formulas: list[Term] = []
            times = () if network is None else network.temporal_constraints
            for formula in chain(self._propositions.theory(theory), map(self._propositions.constraint, times)):
                deadline.enforce()
                self._formulas.append(formula)
            self._session = self._start(deadline)
        self.statistics.sizes["formulas"] = len(self._formulas)

    def _narrow(self, asked: Narrowing, deadline: Deadline) -> None:
        terms = self._formulated(asked)
        self._formulas += terms
        self._session.add(*terms)

    def _possible(self, asked: Narrowing, deadline: Deadline) -> bool:
        with self._session.frame(*self._formulated(asked)):
            return satisfiable(self._session, "models left", deadline)

    def _count(self, deadline: Deadline) -> int:
        """By listing, in a session of its own, which excludes each model once it is found."""
        session = self._start(deadline)
        count = 0
        while satisfiable(session, "models left", deadline):
            count += 1
            model = self._propositions.chosen(session.values(self._propositions.choices))
            session.add(self._propositions.excluded(guard(model)))
        return count

    def _start(self, deadline: Deadline) -> Session:
        session = Session(self._propositions.terms, solver=self._solver)
        session.add_all(self._formulas, deadline)
        return session

    def _formulated(self, asked: Narrowing) -> list[Term]:
        if not asked.consistent:
            return [self._propositions.terms.false]
        return [self._propositions.guard(guard(asked.required)), *map(self._propositions.excluded, asked.conflicts)]


_RETRIES = 8
"""Of a question that a solver gave up by the clock while there is processor time left."""


def satisfiable(session: Session, question: str, deadline: Deadline) -> bool:
    """The solver's answer; OutOfTimeError if the deadline passes, SolverError if the solver fails or gives up."""
    verdict = session.check(question, deadline)
    for _ in range(_RETRIES):  # the clock is ahead of the processor, if that has other work
        if verdict is not Satisfiability.UNKNOWN or deadline.processor is None or deadline.passed:
            break
        verdict = session.check(question, deadline)
    match verdict:
        case Satisfiability.SATISFIABLE:
            return True
        case Satisfiability.UNSATISFIABLE:
            return False
        case Satisfiability.UNKNOWN if session.failure is not None or deadline.remaining is None:
            raise SolverError(session.failure or f"the solver gave up, asked: {question}")
        case Satisfiability.UNKNOWN:
            raise OutOfTimeError
