"""All parameter values for which correct executions exist, as polyhedra, each with the choices that it needs.

A solver finds choices, times and parameter values. The formulas that its model satisfies are a network of differences
between times, whose bounds are linear in the parameters. The network has a solution if and only if no cycle is
negative: these inequalities are a polyhedron of parameter values with the same choices and the same order of events.
The polyhedron is excluded together with the choices of interest that it needs, and the solver is asked again until
nothing remains. Every polyhedron is right at any moment, though they may not be all.

The cycles come from eliminating the times one after the other: each path through an event becomes an edge past it. Of
several edges between two events, those that others dominate within the parameters' bounds are dropped as they come up;
cycles about a single parameter narrow its bounds on the way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, permutations, product
from itertools import combinations as pairs
from math import lcm
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

from robust.errors import SolverError
from robust.network.differences import Elimination, reachable
from robust.pike_bridge.envelopes.parameters import ParametricPlan
from robust.pike_bridge.knowledge.sat import satisfiable
from robust.pike_bridge.model import ALWAYS, Assignment, Choice, Event, Guard, contradicts
from robust.pike_bridge.semantics import Semantics, environment_alike, mentions
from robust.plan.model import Parameter, ParameterReference
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box
from robust.qe.constraint import LinearConstraint
from robust.qe.nnf import FormulaReader, Leaf, Nnf, conjunction, implicant
from robust.qe.polyhedron import Point, Polyhedron
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Formula, Session, Terms, Value

Range = tuple[Fraction | int | None, Fraction | int | None]


class ParametricEdge(NamedTuple):
    """`t(target) − t(source) ≤ constant + Σ factor · parameter`, or < if it is strict."""

    source: str
    target: str
    constant: Fraction
    factors: Mapping[str, int]
    strict: bool
    origin: int
    """The number of the statement that says so."""


@dataclass(frozen=True, slots=True)
class CycleCondition:
    """An inequality that the parameters must satisfy, and the origins of the edges that it comes from."""

    constraint: LinearConstraint
    origins: tuple[int, ...]


class _Weight(NamedTuple):
    """A bound in integers: the constant first, then a factor for each parameter."""

    form: tuple[int, ...]
    strict: bool
    origins: tuple[int, ...]

    def then(self, other: _Weight) -> _Weight:
        """The weight of a path along both edges."""
        form = tuple([a + b for a, b in zip(self.form, other.form, strict=True)])
        return _Weight(form, self.strict or other.strict, self.origins + other.origins)


class _ParametricElimination(Elimination[list[_Weight]]):
    """Edges by both ends; of several between two events, those that are the tightest somewhere."""

    def __init__(self, size: int, ranges: list[Range]) -> None:
        super().__init__(size)
        self.ranges = ranges
        self.cycles: list[_Weight] = []
        self._zero = _Weight((0,) * (len(ranges) + 1), False, ())
        self.ends: dict[tuple[int, bool], _Weight] = {}
        """The cycles that `ranges` come from, by the parameter and whether it is the lower end."""

    def put(self, source: int, target: int, weight: _Weight) -> None:
        """Add an edge, or a cycle."""
        if source != target:
            self._keep(self.after[source].get(target) or self.connect(source, target, []), weight)
        elif not self._implies(self._zero, weight) and not self._tighten(weight):
            self._keep(self.cycles, weight)

    def join(self, source: int, first: list[_Weight], node: int, second: list[_Weight], target: int) -> None:
        for weight, other in product(first, second):
            self.put(source, target, weight.then(other))

    def _keep(self, edges: list[_Weight], weight: _Weight) -> None:
        if any(self._implies(edge, weight) for edge in edges):
            return
        edges[:] = [edge for edge in edges if not self._implies(weight, edge)]
        edges.append(weight)

    def _tighten(self, cycle: _Weight) -> bool:
        """Whether a cycle is about one parameter alone: then it makes all later comparisons stronger."""
        mentioned = [(at, factor) for at, factor in enumerate(cycle.form[1:]) if factor]
        if len(mentioned) != 1:
            return False
        [(at, factor)] = mentioned
        lower, upper = self.ranges[at]
        end = Fraction(-cycle.form[0], factor)
        if factor > 0:
            self.ranges[at] = (end if lower is None else max(lower, end), upper)
        else:
            self.ranges[at] = (lower, end if upper is None else min(upper, end))
        self.ends[at, factor > 0] = cycle
        return True

    def cost(self, event: int) -> int:
        """How many edges eliminating an event makes, about."""
        return sum(map(len, self.before[event].values())) * sum(map(len, self.after[event].values()))

    def _implies(self, one: _Weight, other: _Weight) -> bool:
        """Whether the first bound is at least as tight as the second wherever the parameters may be."""
        greatest = self._greatest([a - b for a, b in zip(one.form, other.form, strict=True)])
        return greatest is not None and (greatest < 0 or (greatest == 0 and (one.strict or not other.strict)))

    def _greatest(self, form: Sequence[int]) -> Fraction | int | None:
        """The greatest value of a form within the parameters' bounds; None if there is none."""
        total: Fraction | int = form[0]
        for factor, (lower, upper) in zip(form[1:], self.ranges, strict=True):
            if factor:
                end = upper if factor > 0 else lower
                if end is None:
                    return None
                total += factor * end
        return total


def cycles(
    edges: Iterable[ParametricEdge], parameters: Sequence[Parameter], deadline: Deadline = NEVER
) -> tuple[CycleCondition, ...]:
    """The inequalities over the parameters, within their bounds, under which the network has a solution.

    Those that hold throughout the bounds are left out; one that never holds is `0 ≤ −1`.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    edges = list(edges)
    limits = [end for parameter in parameters for end in (parameter.lower, parameter.upper) if end is not None]
    unit = lcm(*(number.denominator for number in (*(edge.constant for edge in edges), *limits)))

    def scaled(end: Fraction | None) -> int | None:
        return None if end is None else int(end * unit)

    same = _representatives(edges)
    ends = [(_at(same, edge.source), _at(same, edge.target)) for edge in edges]
    numbers = {event: number for number, event in enumerate(dict.fromkeys(moment.event for moment in chain(*ends)))}
    ranges: list[Range] = [(scaled(parameter.lower), scaled(parameter.upper)) for parameter in parameters]
    graph = _ParametricElimination(len(numbers), ranges)
    for edge, (source, target) in zip(edges, ends, strict=True):
        form = (int(edge.constant * unit), *(edge.factors.get(parameter.name, 0) for parameter in parameters))
        origins = (*source.there, edge.origin, *target.back)
        graph.put(numbers[source.event], numbers[target.event], _Weight(form, edge.strict, origins))
    while graph.remaining:
        deadline.enforce()
        graph.eliminate(min(graph.remaining, key=graph.cost))
    return tuple(_cycle(weight, parameters, unit) for weight in (*graph.ends.values(), *graph.cycles))


class _Moment(NamedTuple):
    """An event that stands for others at the same time, and what says so: on the way `there` from it, and `back`."""

    event: str
    there: tuple[int, ...] = ()
    back: tuple[int, ...] = ()


def _at(same: Mapping[str, _Moment], event: str) -> _Moment:
    return same.get(event) or _Moment(event)


def _representatives(edges: Iterable[ParametricEdge]) -> dict[str, _Moment]:
    """For each event that is at the same time as another, one for all of those."""
    at_most = {
        (edge.source, edge.target): edge.origin
        for edge in edges
        if not (edge.constant or edge.strict or any(edge.factors.values()))
    }
    beside: dict[str, list[str]] = {}
    for source, target in at_most:
        if source != target and (target, source) in at_most:
            beside.setdefault(source, []).append(target)
    moments: dict[str, _Moment] = {}
    for first in beside:
        pending = [] if first in moments else [first]
        moments.setdefault(first, _Moment(first))
        while pending:
            event = pending.pop()
            _, there, back = moments[event]
            for other in beside[event]:
                if other not in moments:
                    moments[other] = _Moment(first, (*there, at_most[event, other]), (at_most[other, event], *back))
                    pending.append(other)
    return moments


def _cycle(weight: _Weight, parameters: Sequence[Parameter], unit: int) -> CycleCondition:
    """With scaled parameters and scaled constant, factors are as they were."""
    factors = {one.name: factor for one, factor in zip(parameters, weight.form[1:], strict=True)}
    constraint = LinearConstraint.of(factors, ">" if weight.strict else ">=", -Fraction(weight.form[0], unit))
    return CycleCondition(constraint, tuple(dict.fromkeys(weight.origins)))


@dataclass(frozen=True, slots=True)
class BoundStatement:
    """A bound of a temporal constraint: its lower one, or its upper one."""

    place: int
    """In `Tpnu.temporal_constraints`."""
    upper: bool


@dataclass(frozen=True, slots=True)
class OrderStatement:
    """The statement that an event is before another, so that what one activity needs is there."""

    earlier: str
    later: str


@dataclass(frozen=True, slots=True)
class WaitingStatement:
    """The statement that nothing is done differently before a difference is known: all that joins copies of a plan."""


Statement: TypeAlias = BoundStatement | OrderStatement | WaitingStatement


@dataclass(frozen=True, slots=True)
class GoodPiece:
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
        reader: FormulaReader,
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
        conditions = tuple(condition for condition in plan.conditions if not contradicts(given, condition.guard))
        effects = tuple(effect for effect in plan.effects if not contradicts(given, effect.guard))
        super().__init__(replace(plan, network=bare, conditions=conditions, effects=effects), terms)
        self.statements: dict[Leaf, Statement] = {}
        """What each inequality of times says."""
        bounds = []
        for place, one in enumerate(plan.network.temporal_constraints):
            if contradicts(given, one.guard):
                continue
            difference: Polynomial[Any] = self.difference(one.source, one.target)
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
            given = self._given[variable]
            self._values.update((each, self.terms.truth(each.value == given)) for each in assignments)
        elif variable in self._shared:
            self._values.update((assignment, self._shared[variable].guard([assignment])) for assignment in assignments)
        else:
            yield from super()._declare(variable)

    def _note(self, reader: FormulaReader, formula: Formula, statement: Statement) -> None:
        leaf = reader.read(formula)
        if isinstance(leaf, LinearConstraint):
            self.statements.setdefault(leaf, statement)

    def active(self, event: str) -> Formula:
        """The formula that an event is activated."""
        return self.guard(self._events[event])

    def time_of(self, event: str) -> Polynomial[str]:
        super().time_of(event)  # an unknown event is an error
        return Polynomial.variable(f"time of {event}{self._copies.get(event, '')}")


@dataclass(frozen=True)
class ParametricQuestion:
    """Formulas over choices, times and parameters, and what their models are about.

    `label` says of a model which choices of interest it needs, and `exclude` is the formula of a label.
    """

    terms: Terms
    reader: FormulaReader
    formulas: tuple[Formula, ...]
    statements: Mapping[Leaf, Statement]
    choices: frozenset[Formula]
    """Symbols, whether or not a formula mentions them."""
    label: Callable[[Mapping[str, Value]], Guard]
    guard: Callable[[Guard], Formula]


def question(parametric: ParametricPlan, key: Sequence[str], assume: Guard = ALWAYS) -> ParametricQuestion:
    """For which parameter values is there a correct execution, with which values of some choices?

    Args:
        key: the choices of interest; the others are existentially quantified.
        assume: choices that are made already.
    """
    terms = Terms()
    reader = FormulaReader(terms)
    semantics = ParametricSemantics(parametric, terms, reader)
    mentioned = mentions(parametric.plan, assume)

    def label(values: Mapping[str, Value]) -> Guard:
        alike = environment_alike(semantics.chosen(values), mentioned)
        return frozenset(each for each in alike if each.variable in key and each not in assume)

    formulas = (*semantics.formulas, semantics.guard(assume))
    return ParametricQuestion(terms, reader, formulas, semantics.statements, semantics.choices, label, semantics.guard)


class GoodPieces:
    """Finds all good pieces; `found` are those by now, and `queries` counts the questions to the solver."""

    def __init__(self, asked: ParametricQuestion, parameters: Sequence[Parameter], *, solver: str = "z3") -> None:
        self._asked = asked
        self._parameters = tuple(parameters)
        self._names = tuple(parameter.name for parameter in parameters)
        self._solver = solver
        self.found: list[GoodPiece] = []
        self.queries = 0

    def search(self, deadline: Deadline = NEVER) -> Iterator[GoodPiece]:
        """Each piece as it is found.

        Raises:
            OutOfTimeError: if the deadline passes first, or the solver fails, with a reason then.
            SolverError: if the solver is unknown or not installed.
        """
        asked, terms = self._asked, self._asked.terms
        session = Session(terms, solver=self._solver)
        session.add_all(asked.formulas, deadline)
        session.add(*(constraint.to_formula(terms) for constraint in Box.declared(self._parameters).constraints()))
        whole = conjunction(asked.reader.read(formula) for formula in asked.formulas)
        symbols = asked.choices.union(*map(terms.variables, asked.formulas))
        while True:
            self.queries += 1
            try:
                if not satisfiable(session, "parameter values with another correct execution", deadline):
                    return
            except SolverError as failure:
                raise OutOfTimeError(failure.message) from failure
            piece = self._piece(whole, session.values(symbols), deadline)
            self.found.append(piece)
            yield piece
            inside = terms.conjunction((asked.guard(piece.label), piece.polyhedron.to_formula(terms)))
            session.add(terms.negation(inside))

    def _piece(self, whole: Nnf, values: Mapping[str, Value], deadline: Deadline) -> GoodPiece:
        chosen: dict[Leaf, None] = {}
        if not implicant(whole, values, chosen):
            raise ValueError("the solver's model does not satisfy the plan's formulas")
        statements: list[Statement] = []
        edges: list[ParametricEdge] = []
        conditions: list[CycleCondition] = []
        for leaf in chosen:
            if not isinstance(leaf, LinearConstraint):
                continue
            statements.append(self._asked.statements.get(leaf, WaitingStatement()))
            for half in leaf.halves():
                edge = self._edge(half, len(statements) - 1)
                if edge is None:
                    conditions.append(CycleCondition(half, (len(statements) - 1,)))
                else:
                    edges.append(edge)
        conditions += cycles(edges, self._parameters, deadline)
        because = {
            cycle.constraint: tuple(dict.fromkeys(statements[at] for at in cycle.origins)) for cycle in conditions
        }
        polyhedron = Polyhedron(self._names, tuple(because))
        return GoodPiece(self._asked.label(values), polyhedron, because)

    def _edge(self, constraint: LinearConstraint, origin: int) -> ParametricEdge | None:
        """The edge that an inequality is; None if it is about parameters only."""
        factors = dict(constraint.coefficients)
        own = {name: -factors.pop(name) for name in self._names if name in factors}
        if not factors:
            return None
        [target] = [name for name, factor in factors.items() if factor == 1]
        [source] = [name for name, factor in factors.items() if factor == -1]
        return ParametricEdge(source, target, constraint.constant, own, constraint.is_strict, origin)


# -- by combinations of choices ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Combination:
    """Values of choices, and the polyhedra in which some correct execution has them; choices left out do not matter."""

    choices: Guard
    pieces: tuple[GoodPiece, ...]

    @property
    def polyhedra(self) -> tuple[Polyhedron, ...]:
        """The polyhedra of the pieces."""
        return tuple(piece.polyhedron for piece in self.pieces)

    def allows(self, values: Point) -> bool:
        """Whether some piece has these parameter values."""
        return any(values in polyhedron for polyhedron in self.polyhedra)


def combinations(pieces: Sequence[GoodPiece], domains: Mapping[str, tuple[str, ...]]) -> Iterator[Combination]:
    """Combinations of values that cover all there are, each once, with the pieces of each.

    Values of a choice are distinguished only where that makes a difference.
    """
    pending: list[tuple[Guard, tuple[GoodPiece, ...]]] = [(ALWAYS, tuple(pieces))]
    while pending:
        chosen, possible = pending.pop()
        decided = {assignment.variable for assignment in chosen}
        mentioned = Counter(variable for piece in possible for variable, _ in piece.label if variable not in decided)
        if not mentioned:
            yield Combination(chosen, possible)
            continue
        name = max((name for name in domains if name in mentioned), key=mentioned.__getitem__)
        for value in reversed(domains[name]):
            more = chosen | {Assignment(name, value)}
            pending.append((more, tuple(piece for piece in possible if not contradicts(piece.label, more))))


# -- executions that wait ----------------------------------------------------------------------------------------------


def waiting_question(
    parametric: ParametricPlan, alternatives: Sequence[Guard], assume: Guard = ALWAYS
) -> ParametricQuestion:
    """For which parameter values can one wait, and have a correct execution whichever alternative is chosen?

    What is done until it is known what someone has chosen is the same, whatever that will be. There is one copy of the
    plan for each combination of choices, and any two of them go together until a choice that they differ in is made.
    What is done differently, or at another time, comes at least ε after such a choice; what the choice itself activates
    may begin at once. Choices that nobody asked about are made like those of the executive: they may depend on what is
    known, and on nothing else.

    Args:
        alternatives: combinations of values, of which any two have different values of some choice.
        assume: choices that are made already, and known from the beginning.
    """
    return _Waiting(parametric, alternatives, assume).question()


class _CertainOrder:
    """Which events are no later than others, whatever the parameters are, by lower bounds that are not negative."""

    def __init__(self, parametric: ParametricPlan) -> None:
        network = parametric.plan.network
        self._guards = network.guards
        bounded = ((parameter.name, parameter.lower) for parameter in parametric.declared)
        least = {ParameterReference(name): lower for name, lower in bounded if lower is not None}
        self._after: dict[str, list[tuple[str, Guard]]] = {}
        for one, (lower, _) in zip(network.temporal_constraints, parametric.bounds, strict=True):
            # Bounds are numbers to which parameters are added.
            if lower is not None and lower.variables <= least.keys() and lower.evaluate(least) >= 0:
                label = one.guard | self._guards[one.target]
                self._after.setdefault(one.source, []).append((one.target, label))

    def no_later(self, event: str, other: str) -> bool:
        """Whether the event is not after the other one whenever both are executed."""
        both = self._guards[event] | self._guards[other]
        after = {each: [target for target, label in edges if label <= both] for each, edges in self._after.items()}
        return other in reachable(after, event)


class _Waiting:
    def __init__(self, parametric: ParametricPlan, alternatives: Sequence[Guard], assume: Guard) -> None:
        self._plan = parametric.plan
        self._terms = Terms()
        self._reader = FormulaReader(self._terms)
        self._alternatives = alternatives
        self._order = _CertainOrder(parametric)
        self._statements: dict[Leaf, Statement] = {}
        self._decided_at: dict[str, list[Choice]] = {}
        asked = {assignment.variable for alternative in alternatives for assignment in alternative}
        for choice in self._plan.network.choices:
            if choice.event is not None and choice.name not in asked:
                self._decided_at.setdefault(choice.event, []).append(choice)
        self._copies: list[ParametricSemantics] = []
        alike = {event.name: self._alike(event.name) for event in self._plan.network.events}
        for number, alternative in enumerate(alternatives):
            self._copies.append(
                ParametricSemantics(
                    parametric,
                    self._terms,
                    self._reader,
                    copies={event: f" ({first[number]})" for event, first in alike.items()},
                    given=alternative | assume,
                    shared={
                        choice.name: self._copies[alike[event][number]]
                        for event, choices in self._decided_at.items()
                        for choice in choices
                        if alike[event][number] < number and not self._plan.network.guards[event]
                    },
                )
            )

    def _alike(self, event: str) -> list[int]:
        """For each copy the first one of those which all have the event, if they do, at one time.

        So it is if the event is never after what tells two copies apart.
        """
        groups: list[list[int]] = []
        representatives = []
        for number in range(len(self._alternatives)):
            group = next((group for group in groups if all(self._untold(event, one, number) for one in group)), None)
            if group is None:
                groups.append(group := [])
            group.append(number)
            representatives.append(group[0])
        return representatives

    def _untold(self, event: str, one: int, other: int) -> bool:
        """Whether an event is never after a choice that distinguishes two copies."""
        names = self._telling(one, other)
        told_at = (choice.event for choice in self._plan.network.choices if choice.name in names)
        return all(each is None or self._order.no_later(event, each) for each in told_at)

    def question(self) -> ParametricQuestion:
        """The formulas of all copies, and what joins them."""
        formulas: list[Formula] = []
        for copy in self._copies:
            formulas += copy.formulas
            self._statements |= copy.statements
        for one, other in self._neighbours():
            formulas += self._together(one, other)
        terms = self._terms
        return ParametricQuestion(
            terms,
            self._reader,
            tuple(dict.fromkeys(formulas)),  # those of what copies share are the same
            self._statements,
            frozenset(),
            lambda _values: ALWAYS,
            lambda _label: terms.true,
        )

    def _neighbours(self) -> Iterator[tuple[int, int]]:
        """The pairs that have to go together for all pairs to do so.

        Two copies go together if both do with a third one that differs from each of them in some of the choices only in
        which they differ from each other: until one of these is made, all three are alike.
        """
        numbers = range(len(self._copies))
        telling = {pair: self._telling(*pair) for pair in permutations(numbers, 2)}
        for one, other in pairs(numbers, 2):
            apart = telling[one, other]
            if not any(
                telling[one, third] < apart and telling[third, other] < apart
                for third in numbers
                if third not in {one, other}
            ):
                yield one, other

    def _telling(self, one: int, other: int) -> frozenset[str]:
        """The choices that distinguish two copies."""
        values, others = dict(self._alternatives[one]), dict(self._alternatives[other])
        return frozenset(name for name in values.keys() & others.keys() if values[name] != others[name])

    def _together(self, one: int, other: int) -> Iterator[Formula]:
        """What both copies do alike until a choice distinguishes them."""
        names = self._telling(one, other)
        telling = [choice for choice in self._plan.network.choices if choice.name in names]
        for event in self._plan.network.events:
            yield self._event_together(event, one, other, telling)

    def _event_together(self, event: Event, one: int, other: int, telling: Sequence[Choice]) -> Formula:
        terms, first, second = self._terms, self._copies[one], self._copies[other]
        here, there = first.active(event.name), second.active(event.name)
        neither = terms.conjunction((terms.negation(here), terms.negation(there)))
        if neither is terms.true:
            return neither
        same = [terms.equal(first.time_of(event.name) - second.time_of(event.name))]
        for choice in self._decided_at.get(event.name, ()):
            for value in choice.domain:
                made, other = (each.guard([Assignment(choice.name, value)]) for each in (first, second))
                same.append(terms.true if made is other else terms.equivalence(made, other))
        if here is there and all(each is terms.true for each in same):
            return terms.true
        alike = [here, there, *same]
        apart = (self._after(first, event, telling, there), self._after(second, event, telling, here))
        return terms.disjunction((neither, terms.conjunction(alike), terms.conjunction(apart)))

    def _after(
        self, copy: ParametricSemantics, event: Event, telling: Sequence[Choice], active_in_other: Formula
    ) -> Formula:
        """The formula that the event, if it comes in one copy, comes after a choice that tells both copies apart."""
        terms, epsilon = self._terms, self._plan.epsilon
        if copy.active(event.name) is terms.false:
            return terms.true
        ways = [terms.negation(copy.active(event.name))]
        for choice in telling:
            if choice.event is None or choice.event == event.name:
                continue
            later = copy.difference(choice.event, event.name)
            known = copy.active(choice.event)
            apart = terms.at_least(later - epsilon) if epsilon else terms.greater(later)
            at_once = terms.at_least(later)
            ways.append(terms.conjunction((known, apart)))
            ways.append(terms.conjunction((known, terms.negation(active_in_other), at_once)))
        return terms.disjunction(ways)
