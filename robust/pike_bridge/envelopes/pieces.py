"""All parameter values for which correct executions exist, as polyhedra, each with the choices that it is about.

A solver finds choices, times and parameter values. What its model makes true of the plan's formulas is a network of
differences between times, whose cycles are a polyhedron of parameter values with the same choices and the same order of
events. It is excluded, with what it needs of the choices of interest, and the solver is asked again, until nothing is
left. What is found by then is right at any moment, though not all there is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, TypeAlias

from robust.pike_bridge.envelopes.differences import CycleCondition, ParametricEdge, cycles
from robust.pike_bridge.envelopes.parameters import ParametricPlan
from robust.pike_bridge.knowledge.sat import satisfiable
from robust.pike_bridge.model import ALWAYS, Assignment, Guard, contradicts
from robust.pike_bridge.semantics import Semantics, environment_alike, mentions
from robust.plan.model import Parameter
from robust.plan.polynomial import Polynomial
from robust.qe.constraint import LinearConstraint
from robust.qe.nnf import Leaf, Nnf, Reader, conjunction, implicant
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Session, Value
from robust.smt.terms import Formula, Terms


@dataclass(frozen=True, slots=True)
class BoundStatement:
    """A bound of a temporal constraint: its lower one, or its upper one."""

    place: int
    """In `Tpnu.temporal_constraints`."""
    upper: bool


@dataclass(frozen=True, slots=True)
class OrderStatement:
    """That an event is before another, so that what one activity needs is there."""

    earlier: str
    later: str


@dataclass(frozen=True, slots=True)
class WaitingStatement:
    """That nothing is done differently before it is known what is different: all that joins copies of a plan."""


Statement: TypeAlias = BoundStatement | OrderStatement | WaitingStatement


@dataclass(frozen=True, slots=True)
class Piece:
    """Parameter values, within their bounds, for which some correct execution exists whatever a label leaves open.

    `because` has the statements behind each constraint of the polyhedron.
    """

    label: Guard
    polyhedron: Polyhedron
    because: Mapping[LinearConstraint, tuple[Statement, ...]]


class ParametricSemantics(Semantics):
    """The formulas of a plan with parameters for bounds, or of a copy of it.

    Args:
        parametric: the plan.
        terms: where formulas are built.
        reader: reads them.
        copies: by event, the name of the copy that its time is of.
        given: choices that are made in this copy: nothing is said of what they exclude.
        shared: by choice, a copy that makes it alike.
    """

    def __init__(
        self,
        parametric: ParametricPlan,
        terms: Terms,
        reader: Reader,
        *,
        copies: Mapping[str, str] = MappingProxyType({}),
        given: Guard = ALWAYS,
        shared: Mapping[str, ParametricSemantics] = MappingProxyType({}),
    ) -> None:
        self._copies = copies
        self._given = dict(given)
        self._shared = shared
        plan = parametric.plan
        bare = replace(plan.network, constraints=(), activities=())
        conditions = tuple(one for one in plan.conditions if not contradicts(given, one.guard))
        effects = tuple(one for one in plan.effects if not contradicts(given, one.guard))
        super().__init__(replace(plan, network=bare, conditions=conditions, effects=effects), terms)
        self.statements: dict[Leaf, Statement] = {}
        """What each inequality of times says."""
        bounds = []
        for place, one in enumerate(plan.network.temporal_constraints):
            if contradicts(given, one.guard):
                continue
            difference: Polynomial[Any] = self._time(one.target) - self._time(one.source)
            lower, upper = parametric.bounds[place]
            sides = [] if lower is None else [(self.terms.at_least(difference - lower), False)]
            sides += [] if upper is None else [(self.terms.at_least(upper - difference), True)]
            for formula, is_upper in sides:
                self._note(reader, formula, BoundStatement(place, is_upper))
            bounds.append(self.unless(one.guard, self.terms.conjunction(formula for formula, _ in sides)))
        for (earlier, later), formula in self._orders.items():
            self._note(reader, formula, OrderStatement(earlier, later))
        self.formulas = (*self.formulas, *bounds)

    def _declare(self, variable: str) -> Iterator[Formula]:
        assignments = [Assignment(variable, value) for value in self._domains[variable]]
        if variable in self._given:
            self._values.update((each, self.terms.truth(self._given[variable] == each.value)) for each in assignments)
        elif variable in self._shared:
            self._values.update((each, self._shared[variable].guard([each])) for each in assignments)
        else:
            yield from super()._declare(variable)

    def _note(self, reader: Reader, formula: Formula, statement: Statement) -> None:
        found = reader.read(formula)
        if isinstance(found, LinearConstraint):
            self.statements.setdefault(found, statement)

    def difference(self, earlier: str, later: str) -> Polynomial[str]:
        """How much later an event is than another."""
        return self._time(later) - self._time(earlier)

    def clock(self, event: str) -> Polynomial[str]:
        """The time of an event."""
        return self._time(event)

    def active(self, event: str) -> Formula:
        """That an event is activated."""
        return self.guard(self._events[event])

    def _time(self, event: str) -> Polynomial[str]:
        super()._time(event)  # an unknown event is an error
        return Polynomial.variable(f"time of {event}{self._copies.get(event, '')}")


@dataclass(frozen=True)
class Question:
    """Formulas over choices, times and parameters, and what their models are about.

    `label` says of a model which choices of interest it needs, and `exclude` is the formula of a label.
    """

    terms: Terms
    reader: Reader
    formulas: tuple[Formula, ...]
    statements: Mapping[Leaf, Statement]
    choices: frozenset[Formula]
    """Symbols, whether or not a formula mentions them."""
    label: Callable[[Mapping[str, Value]], Guard]
    guard: Callable[[Guard], Formula]


def question(parametric: ParametricPlan, key: Sequence[str], assume: Guard = ALWAYS) -> Question:
    """For which parameter values is there a correct execution, with which values of some choices?

    Args:
        key: the choices of interest; the others are as it suits.
        assume: choices that are made already.
    """
    terms = Terms()
    reader = Reader(terms)
    semantics = ParametricSemantics(parametric, terms, reader)
    mentioned = mentions(parametric.plan, assume)

    def label(values: Mapping[str, Value]) -> Guard:
        alike = environment_alike(semantics.chosen(values), mentioned)
        return frozenset(one for one in alike if one.variable in key and one not in assume)

    formulas = (*semantics.formulas, semantics.guard(assume))
    return Question(terms, reader, formulas, semantics.statements, semantics.choices, label, semantics.guard)


class Pieces:
    """Finds all pieces; `found` are those by now, and `queries` counts the questions to the solver."""

    def __init__(self, asked: Question, parameters: Sequence[Parameter], *, solver: str = "z3") -> None:
        self._asked = asked
        self._parameters = tuple(parameters)
        self._names = tuple(one.name for one in parameters)
        self._solver = solver
        self.found: list[Piece] = []
        self.queries = 0

    def search(self, deadline: Deadline = NEVER) -> Iterator[Piece]:
        """Each piece as it is found.

        Raises:
            OutOfTimeError: if the deadline passes first.
            SolverError: if the solver is unknown, not installed, or fails.
        """
        asked, terms = self._asked, self._asked.terms
        session = Session(terms, solver=self._solver)
        session.add_all(asked.formulas, deadline)
        session.add(*(one.to_formula(terms) for one in declared_bounds(self._parameters)))
        whole = conjunction(asked.reader.read(formula) for formula in asked.formulas)
        symbols = asked.choices.union(*map(terms.variables, asked.formulas))
        while True:
            self.queries += 1
            if not satisfiable(session, "parameter values with another correct execution", deadline):
                return
            piece = self._piece(whole, session.values(symbols), deadline)
            self.found.append(piece)
            yield piece
            inside = terms.conjunction((asked.guard(piece.label), piece.polyhedron.to_formula(terms)))
            session.add(terms.negation(inside))

    def _piece(self, whole: Nnf, values: Mapping[str, Value], deadline: Deadline) -> Piece:
        chosen: dict[Leaf, None] = {}
        if not implicant(whole, values, chosen):
            raise ValueError("the solver's model does not satisfy the plan's formulas")
        statements: list[Statement] = []
        edges: list[ParametricEdge] = []
        found: list[CycleCondition] = []
        for leaf in chosen:
            if not isinstance(leaf, LinearConstraint):
                continue
            statements.append(self._asked.statements.get(leaf, WaitingStatement()))
            for half in leaf.halves():
                edge = self._edge(half, len(statements) - 1)
                if edge is None:
                    found.append(CycleCondition(half, (len(statements) - 1,)))
                else:
                    edges.append(edge)
        found += cycles(edges, self._parameters, deadline)
        because = {cycle.constraint: tuple(dict.fromkeys(statements[at] for at in cycle.origins)) for cycle in found}
        polyhedron = Polyhedron(self._names, tuple(because))
        return Piece(self._asked.label(values), polyhedron, because)

    def _edge(self, constraint: LinearConstraint, origin: int) -> ParametricEdge | None:
        """The edge that an inequality is; None if it is about parameters only."""
        factors = dict(constraint.coefficients)
        own = {name: -factors.pop(name) for name in self._names if name in factors}
        if not factors:
            return None
        [target] = [name for name, factor in factors.items() if factor == 1]
        [source] = [name for name, factor in factors.items() if factor == -1]
        return ParametricEdge(source, target, constraint.constant, own, constraint.is_strict, origin)


def declared_bounds(parameters: Iterable[Parameter]) -> Iterator[LinearConstraint]:
    """The declared bounds as constraints."""
    for one in parameters:
        if one.lower is not None:
            yield LinearConstraint.of({one.name: 1}, ">=", one.lower)
        if one.upper is not None:
            yield LinearConstraint.of({one.name: 1}, "<=", one.upper)


# -- by combinations of choices ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Combination:
    """Values of choices, and the polyhedra in which some correct execution has them; choices left out do not matter."""

    choices: Guard
    pieces: tuple[Piece, ...]

    @property
    def polyhedra(self) -> tuple[Polyhedron, ...]:
        """Of the pieces."""
        return tuple(piece.polyhedron for piece in self.pieces)


def combinations(pieces: Sequence[Piece], domains: Mapping[str, tuple[str, ...]]) -> Iterator[Combination]:
    """Combinations of values that cover all there are, each once, with the pieces of each.

    Choices are told apart only where that makes a difference.
    """
    pending: list[tuple[Guard, tuple[Piece, ...]]] = [(ALWAYS, tuple(pieces))]
    while pending:
        chosen, possible = pending.pop()
        decided = {one.variable for one in chosen}
        open_choices = [one.variable for piece in possible for one in piece.label if one.variable not in decided]
        if not open_choices:
            yield Combination(chosen, possible)
            continue
        order = list(domains)
        name = max(dict.fromkeys(open_choices), key=lambda each: (open_choices.count(each), -order.index(each)))
        for value in reversed(domains[name]):
            more = chosen | {Assignment(name, value)}
            pending.append((more, tuple(one for one in possible if not contradicts(one.label, more))))
