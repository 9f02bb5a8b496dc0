"""Nothing compiled: an incremental solver is asked each question, about time as well if it is given a network."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

from robust.errors import InputError
from robust.pike_bridge.knowledge.interface import Commitment, KnowledgeBase, KnowledgeStatistics, Narrowing, narrowing
from robust.pike_bridge.model import Assignment, Constraint, Guard, Tpnu
from robust.pike_bridge.theory import Formula, Theory, check_assignments, interpret, is_consistent
from robust.plan.polynomial import Polynomial
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula as Term
from robust.smt.terms import Terms


class Propositions:
    """Finite-domain variables as booleans, and formulas about them as terms; KeyError for unknown assignments.

    A variable with two values is one boolean; with more, each value is one, of which exactly one is true.
    """

    def __init__(self, terms: Terms, domains: Mapping[str, tuple[str, ...]]) -> None:
        self.terms = terms
        self._domains = domains
        self._values: dict[Assignment, Term] = {}
        self.axioms: list[Term] = []
        """What makes each variable have exactly one value, to be asserted."""
        for position, (variable, values) in enumerate(domains.items()):
            literals = self._literals(position, len(values))
            self._values.update(zip((Assignment(variable, value) for value in values), literals, strict=True))
        self.symbols = frozenset[Term]().union(*map(terms.variables, self._values.values()))

    def _literals(self, position: int, count: int) -> list[Term]:
        """One for each value of a variable."""
        terms = self.terms
        if count == 1:
            return [terms.true]
        if count == 2:
            symbol = terms.fresh_boolean(f"variable {position} ")
            return [symbol, terms.negation(symbol)]
        symbols = [terms.fresh_boolean(f"variable {position} value {at} ") for at in range(count)]
        self.axioms.append(terms.disjunction(symbols))
        for pair in combinations(symbols, 2):
            self.axioms.append(terms.disjunction(map(terms.negation, pair)))
        return symbols

    def environment(self, assignments: Iterable[Assignment]) -> Term:
        """The conjunction of assignments."""
        return self.terms.conjunction(self._values[each] for each in sorted(assignments))

    def excluded(self, environment: Guard) -> Term:
        """That not all assignments of an environment hold."""
        return self.terms.negation(self.environment(environment))

    def formula(self, formula: Formula) -> Term:
        """A formula as a term."""
        terms = self.terms
        return interpret(formula, self._values.__getitem__, terms.negation, terms.conjunction, terms.disjunction)

    def chosen(self, session: Session) -> Guard:
        """The assignments that the model of the last query makes; a variable that nothing is said of gets none."""
        values = session.values(self.symbols)

        def holds(literal: Term) -> bool:
            if literal is self.terms.true:
                return True
            negated = literal.is_not()
            value = values.get((literal.arg(0) if negated else literal).symbol_name())
            return value is not None and bool(value) != negated

        return frozenset(assignment for assignment, literal in self._values.items() if holds(literal))

    def model(self, session: Session) -> dict[str, str]:
        """The assignment of the last satisfiable query; variables that nothing is said of get their first value."""
        chosen = dict(self.chosen(session))
        return {variable: chosen.get(variable, values[0]) for variable, values in self._domains.items()}


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
            self._terms = Terms()
            self._propositions = Propositions(self._terms, theory.domains)
            self._formulas = [*self._propositions.axioms, *self._state(deadline)]
            if network is not None:
                self._formulas += _temporal(network, theory, self._propositions, deadline)
            self._session = self._start(deadline)
        self.statistics.sizes["formulas"] = len(self._formulas)

    def commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> None:
        deadline.enforce()
        terms = self._narrow(narrowing(commitments, self.theory))
        self._formulas += terms
        self._session.add(*terms)

    def _possible(self, asked: Narrowing, deadline: Deadline) -> bool:
        with self._session.frame(*self._narrow(asked)):
            return self._check(self._session, deadline)

    def _model(self, asked: Narrowing, preferred: Mapping[str, str], deadline: Deadline) -> Mapping[str, str] | None:
        """The model that the solver finds; it has preferences of its own."""
        with self._session.frame(*self._narrow(asked)):
            return self._propositions.model(self._session) if self._check(self._session, deadline) else None

    def _count(self, deadline: Deadline) -> int:
        """By listing."""
        return sum(1 for _ in self._enumerate(deadline))

    def _enumerate(self, deadline: Deadline) -> Iterator[Mapping[str, str]]:
        """Models as a session of its own finds them, each excluded once it is found."""
        session = self._start(deadline)
        while self._check(session, deadline):
            model = self._propositions.model(session)
            yield model
            session.add(self._propositions.excluded(frozenset(Assignment(*item) for item in model.items())))

    def _check(self, session: Session, deadline: Deadline) -> bool:
        match session.check("models left", deadline):
            case Verdict.SATISFIABLE:
                return True
            case Verdict.UNSATISFIABLE:
                return False
            case Verdict.UNKNOWN:
                raise OutOfTimeError

    def _start(self, deadline: Deadline) -> Session:
        session = Session(self._terms, solver=self._solver)
        session.add_all(self._formulas, deadline)
        return session

    def _state(self, deadline: Deadline) -> Iterator[Term]:
        for constraint in self.theory.constraints:
            deadline.enforce()
            yield self._propositions.formula(constraint)
        for conflict in filter(is_consistent, self.theory.conflicts):
            deadline.enforce()
            yield self._propositions.excluded(conflict)

    def _narrow(self, asked: Narrowing) -> list[Term]:
        if not asked.consistent:
            return [self._terms.false]
        required = self._propositions.environment(Assignment(*item) for item in asked.required.items())
        return [required, *map(self._propositions.excluded, asked.conflicts)]


def _temporal(network: Tpnu, theory: Theory, propositions: Propositions, deadline: Deadline) -> Iterator[Term]:
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
            bounds = propositions.terms.conjunction(_bounds(constraint, propositions.terms))
            yield propositions.terms.implication(propositions.environment(constraint.guard), bounds)


def _bounds(constraint: Constraint, terms: Terms) -> Iterator[Term]:
    source, target = (Polynomial.variable(f"time of {name}") for name in (constraint.source, constraint.target))
    if constraint.lower is not None:
        yield terms.at_least(target - source - constraint.lower)
    if constraint.upper is not None:
        yield terms.at_least(source - target + constraint.upper)
