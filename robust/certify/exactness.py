"""Affine maps from polyhedra of parameter values to schedules, and the multipliers that show that they are right."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from robust.certify.circuit import PROPOSITION, Atom, Circuit, Conjunction, Constraint, constraint, contradiction
from robust.certify.ground import GroundPlan, Line, Step, cycle_sum, positive_cycle
from robust.encode.interface import Encoding, Obligation
from robust.encode.variables import Auxiliary, Linear, Range, TimeVariable, constant, variable
from robust.errors import UnsupportedError
from robust.irr.containment import within
from robust.plan.model import Relation
from robust.qe.box import Interval
from robust.qe.conjunctions import project
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import outside
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Value, Verdict
from robust.smt.terms import Formula, Terms

Form = Mapping[str, Fraction]
"""Coefficients by name, that of `""` is the constant."""

Half = tuple[Form, bool]
"""`form ≥ 0`, or `> 0`."""


def form_of(expression: Linear) -> dict[str, Fraction]:
    """A polynomial by the names of its unknowns."""
    form = {str(unknown): factor for unknown, factor in expression.coefficients()}
    return {**form, "": expression.constant_term} if expression.constant_term else form


def combined(left: Form, right: Form, factor: Fraction | int = 1) -> dict[str, Fraction]:
    """`left + factor · right`."""
    total = dict(left)
    for name, value in right.items():
        total[name] = total.get(name, Fraction(0)) + factor * value
    return {name: value for name, value in total.items() if value}


def substituted(form: Form, values: Mapping[str, Form]) -> dict[str, Fraction]:
    """A form with forms for some of its names."""
    total: dict[str, Fraction] = {}
    for name, factor in form.items():
        total = combined(total, values.get(name, {name: Fraction(1)}), factor)
    return total


def section(
    unknowns: Sequence[str],
    parameters: Sequence[str],
    where: Sequence[Half],
    required: Iterable[Half],
    *,
    solver: str,
    deadline: Deadline,
) -> dict[str, dict[str, Fraction]] | None:
    """Each unknown as an affine function of the parameters, such that what is required holds all over a polyhedron.

    By Farkas' lemma a required form is a sum of multiples of the polyhedron's sides and of something that is not
    negative; for fixed sides that is linear in the multipliers and in the coefficients of the functions.

    Returns:
        The functions; None if there are none, although each point may have values of its own.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    terms = Terms()
    columns = ("", *parameters)
    numbers = {(name, column): index for index, (name, column) in enumerate((n, c) for n in unknowns for c in columns)}
    sought = {key: variable(Auxiliary("coefficient", index)) for key, index in numbers.items()}
    conditions: list[Formula] = []
    count = 0
    for form, strict in dict.fromkeys((tuple(form.items()), strict) for form, strict in required):
        rest = {column: constant(0) for column in columns}
        for name, factor in form:
            if name in rest:
                rest[name] += factor
            else:
                for column in columns:
                    rest[column] += sought[name, column].scaled(factor)
        multipliers = []
        for side, _ in where:
            multiplier = variable(Auxiliary("multiplier", count))
            count += 1
            multipliers.append(multiplier)
            for name, factor in side.items():
                rest[name] -= multiplier.scaled(factor)
        if strict:
            sharpness = sum((m for m, (_, sharp) in zip(multipliers, where, strict=True) if sharp), rest[""])
            conditions.append(terms.greater(sharpness))
        conditions += [terms.at_least(each) for each in (rest[""], *multipliers)]
        conditions += [terms.equal(rest[column]) for column in parameters]
    session = Session(terms, solver=solver)
    session.add_all(conditions, deadline)
    verdict = session.check("a schedule that is affine on a polyhedron", deadline)
    if verdict is Verdict.UNKNOWN:
        raise OutOfTimeError(session.failure)
    if verdict is Verdict.UNSATISFIABLE:
        return None
    values = session.values([terms.real(each) for term in sought.values() for each in term.variables])
    found: dict[str, dict[str, Fraction]] = {name: {} for name in unknowns}
    for (name, column), term in sought.items():
        value = Fraction(values.get(str(next(iter(term.variables))), 0))
        if value:
            found[name][column] = value
    return found


def multiples(where: Sequence[Half], form: Form) -> list[tuple[int, Fraction]]:
    """Positive multiples of the sides of a polyhedron, by number, that leave something not negative of a form.

    Raises:
        ValueError: if the form is negative somewhere in the polyhedron, or the polyhedron is empty.
    """
    if not form.keys() - {""} and form.get("", 0) >= 0:
        return []
    negated, scale = _constraint(combined({}, form, -1), True)
    sides = [_constraint(side, sharp) for side, sharp in where]
    found = contradiction([negated, *(each for each, _ in sides)])
    if found is None or 0 not in found.indices:
        raise ValueError(f"{dict(form)} is negative somewhere")
    weights = dict(zip(found.indices, found.multipliers, strict=True))
    unit = weights.pop(0) * scale
    return [(index - 1, weight * sides[index - 1][1] / Fraction(unit)) for index, weight in weights.items()]


def _constraint(form: Form, strict: bool) -> tuple[Constraint, int]:
    """`form ≥ 0` times a number, as integers, and that number."""
    scale = lcm(*(factor.denominator for factor in form.values()))
    factors = tuple((name, int(-factor * scale)) for name, factor in form.items() if name)
    return Constraint(factors, strict, int(form.get("", Fraction(0)) * scale)), scale


Point = Mapping[str, Fraction]
SPLITS = 12
"""How often a polyhedron is halved until one affine schedule is enough for what is left of it."""


@dataclass(frozen=True)
class Nowhere:
    """Values without any schedule: network constraints that form a circle."""

    polyhedron: Polyhedron
    steps: list[Step]


@dataclass(frozen=True)
class Broken:
    """Values for which a schedule breaks an obligation: times and values of other variables over the parameters."""

    polyhedron: Polyhedron
    obligation: Obligation
    conjuncts: tuple[int, ...]
    values: Mapping[str, Form]


def halves_of(polyhedron: Polyhedron) -> list[Half]:
    """The sides of a polyhedron, equations as two of them."""
    halves = (half for each in polyhedron.constraints for half in each.halves())
    forms = (({name: Fraction(factor) for name, factor in half.coefficients}, half) for half in halves)
    return [(combined({"": half.constant}, form, -1), half.is_strict) for form, half in forms]


def ranges_of(polyhedron: Polyhedron) -> dict[str, Range]:
    """The values that each parameter takes in a polyhedron that is not empty."""
    extents = {name: polyhedron.extent(name) for name in polyhedron.parameters}
    return {name: (each.lower, each.upper) for name, each in extents.items() if each is not None}


def network_halves(ground: GroundPlan) -> list[Half]:
    """All constraints of the network, over parameters and free time points."""
    places = ground.places
    gaps = [*places.values(), *(places[target] - places[source] - length for source, target, length in ground.edges)]
    return [(form, False) for form in map(form_of, gaps) if form]


def literal_of(circuit: Circuit, half: Half) -> int:
    """The literal of a circuit that says what a half says."""
    form, strict = half
    factors = {name: -factor for name, factor in form.items() if name}
    return circuit.at_most(factors, form.get("", Fraction(0)), strict=strict)


def network_roles(ground: GroundPlan, circuit: Circuit) -> dict[int, Line]:
    """What the network says, as literals, with their roles for the checker."""
    roles: dict[int, Line] = {}
    for point, time in ground.places.items():
        roles.setdefault(literal_of(circuit, (form_of(time), False)), ["z", point])
    for index, (source, target, length) in enumerate(ground.edges):
        gap = ground.places[target] - ground.places[source] - length
        roles.setdefault(literal_of(circuit, (form_of(gap), False)), ["n", index])
    return roles


def free_points(ground: GroundPlan) -> list[str]:
    """The variables of free time points, in the order in which certificates name them."""
    found = (v for place in ground.places.values() for v in place.variables if isinstance(v, TimeVariable))
    return list(dict.fromkeys(map(str, found)))


def scheduled(
    ground: GroundPlan, piece: Polyhedron, *, solver: str, deadline: Deadline, depth: int = SPLITS
) -> Iterator[tuple[Polyhedron, dict[str, dict[str, Fraction]]]]:
    """Parts of a polyhedron, each with a schedule that is affine in the parameters.

    Raises:
        UnsupportedError: if halving the polyhedron again and again does not lead to such parts.
        OutOfTimeError: if the deadline passes.
    """
    names = piece.parameters
    if piece.is_empty:
        return
    found = section(
        free_points(ground), names, halves_of(piece), network_halves(ground), solver=solver, deadline=deadline
    )
    if found is not None:
        yield piece, found
        return
    if not depth:
        raise UnsupportedError(f"no schedule that is affine in the parameters suits the piece {piece}")
    for half in halved(piece, SPLITS - depth):
        yield from scheduled(ground, half, solver=solver, deadline=deadline, depth=depth - 1)


def uncovered(
    everything: Polyhedron, cover: Sequence[Polyhedron], likely: Sequence[Polyhedron]
) -> Iterator[dict[str, Fraction]]:
    """Points that no polyhedron of a growing cover contains, until there are none; first in some likely polyhedra.

    They are inside of what is not covered where that has an inside: what is true at a corner may be true nowhere else.
    """
    for polyhedron in likely:
        point = polyhedron.intersection(everything).interior_point()
        if point is not None and not any(point in other for other in cover):
            yield point
    while (point := outside(everything, cover)) is not None:
        sides = [
            next(half for each in other.constraints for half in each.negation() if half.evaluate(point))
            for other in cover
        ]
        around = Polyhedron(everything.parameters, (*everything.constraints, *sides))
        yield around.interior_point() or point


def halved(polyhedron: Polyhedron, turn: int) -> tuple[Polyhedron, Polyhedron]:
    """Two parts, cut through the middle along the parameter whose turn it is."""
    name = polyhedron.parameters[turn % len(polyhedron.parameters)]
    extent = polyhedron.extent(name)
    low, high = (None, None) if extent is None else (extent.lower, extent.upper)
    if low is not None and high is not None:
        middle = (low + high) / 2
    else:
        end = low if low is not None else high
        middle = Fraction(0) if end is None else end + (2**turn if low is not None else -(2**turn))
    sides = (LinearConstraint.of({name: 1}, relation, middle) for relation in ("<=", ">"))
    below, above = (Polyhedron(polyhedron.parameters, (*polyhedron.constraints, side)) for side in sides)
    return below, above


class Exactness:
    """Explains why parameter values are bad.

    Args:
        encoding: the plan's formulas.
        ground: the plan as certificates state it.
        circuit: of the conjuncts of formulas.
        implied: literals that say what the network says.
        solver: `z3` or `cvc5`.
        deadline: when to give up, with OutOfTimeError.
    """

    def __init__(
        self,
        encoding: Encoding,
        ground: GroundPlan,
        circuit: Circuit,
        implied: Iterable[int] = (),
        *,
        solver: str,
        deadline: Deadline,
    ) -> None:
        self._encoding = encoding
        self._ground = ground
        self._circuit = circuit
        self._solver = solver
        self._deadline = deadline
        self._names = tuple(parameter.name for parameter in encoding.plan.parameters)
        self._network = network_halves(ground)
        self._implied = frozenset(implied)
        self._sessions: dict[str, Session] = {}

    def explain(self, point: Point, conjuncts: Mapping[str, Sequence[int]]) -> Nowhere | Broken:
        """A polyhedron around a point that is not in the envelope, and why it is bad.

        Args:
            conjuncts: for each obligation that can break, the literals that are true together where it does.

        Raises:
            UnsupportedError: if nothing breaks there, or what does cannot be written down.
            OutOfTimeError: if the deadline passes.
        """
        steps = positive_cycle(self._ground, point)
        if steps is not None:
            total = LinearConstraint.from_polynomial(cycle_sum(self._ground, steps), Relation.GREATER)
            return Nowhere(Polyhedron(self._names, (total,)), steps)
        for obligation in self._encoding.obligations:
            if obligation.name in conjuncts:
                model = self._model(obligation, point)
                if model is not None:
                    return self._generalised(obligation, tuple(conjuncts[obligation.name]), model, point)
        raise UnsupportedError(f"nothing breaks at {dict(point)}, which is outside of the region")

    def _model(self, obligation: Obligation, point: Point) -> dict[str, Value] | None:
        session = self._sessions.get(obligation.name)
        if session is None:
            session = Session(self._encoding.terms, solver=self._solver)
            session.add_all(self._encoding.query(obligation), self._deadline)
            self._sessions[obligation.name] = session
        intervals = {name: Interval(point[name], point[name]) for name in self._names}
        with session.frame(*within(self._encoding, intervals)):
            verdict = session.check(f"{obligation.name}: outside", self._deadline)
            if verdict is Verdict.UNKNOWN:
                raise OutOfTimeError(session.failure)
            if verdict is Verdict.UNSATISFIABLE:
                return None
            terms = self._encoding.terms
            symbols = {symbol for formula in session.assertions for symbol in terms.variables(formula)}
            return {**session.values(symbols), **point}

    def _generalised(
        self, obligation: Obligation, conjuncts: tuple[int, ...], model: Mapping[str, Value], point: Point
    ) -> Broken:
        leaves = list(self._leaves(conjuncts, model))
        required = [*self._network, *(self._half(literal) for literal in leaves if not self._proposition(literal))]
        hidden = sorted({name for form, _ in required for name in form} - {"", *self._names})
        constraints = [
            LinearConstraint.of(
                {name: -factor for name, factor in form.items() if name},
                Sense.LESS if strict else Sense.AT_MOST,
                form.get("", Fraction(0)),
            )
            for form, strict in required
        ]
        projected = project(constraints, hidden)
        polyhedron = Polyhedron.nothing(self._names) if projected is None else Polyhedron(self._names, projected)
        chosen = {
            name: {"": Fraction(1)} if literal_is_true else {}
            for name, literal_is_true in (self._choice(literal) for literal in leaves if self._proposition(literal))
        }
        for turn in range(SPLITS + 1):
            found = section(
                [*dict.fromkeys([*free_points(self._ground), *hidden])],
                self._names,
                halves_of(polyhedron),
                required,
                solver=self._solver,
                deadline=self._deadline,
            )
            if found is not None:
                return Broken(polyhedron, obligation, conjuncts, {**found, **chosen})
            polyhedron = next(half for half in halved(polyhedron, turn) if point in half)
        raise UnsupportedError(f"no affine schedule that breaks {obligation.name!r} near {dict(point)} was found")

    def _atom(self, literal: int) -> Atom:
        node = self._circuit.node(literal)
        if not isinstance(node, Atom):
            raise TypeError(f"{node} is not a linear atom")
        return node

    def _proposition(self, literal: int) -> bool:
        return self._atom(literal).is_proposition

    def _half(self, literal: int) -> Half:
        """What a literal of an atom says."""
        said = constraint(self._atom(literal), literal > 0)
        return combined(
            {"": Fraction(said.bound)}, {name: Fraction(f) for name, f in said.coefficients}, -1
        ), said.strict

    def _choice(self, literal: int) -> tuple[str, bool]:
        """A proposition's variable, and whether a literal says that it is above zero."""
        said = constraint(self._atom(literal), literal > 0)
        return said.coefficients[0][0], said.coefficients[0][1] < 0

    def _leaves(self, conjuncts: Sequence[int], model: Mapping[str, Value]) -> Iterator[int]:
        """Literals of atoms, true in the model, that are enough to make the conjuncts true."""
        truths: dict[int, bool] = {}
        cost: dict[int, int] = {}
        pending = [abs(literal) for literal in conjuncts]
        while pending:
            number = pending[-1]
            node = self._circuit.node(number)
            missing = [abs(each) for each in getattr(node, "inputs", ()) if abs(each) not in truths]
            if missing and number not in truths:
                pending += missing
                continue
            pending.pop()
            if isinstance(node, Conjunction):
                false = [abs(each) for each in node.inputs if truths[abs(each)] != (each > 0)]
                truths[number] = not false
                costs = [cost[abs(each)] for each in node.inputs]
                cost[number] = min(cost[each] for each in false) if false else sum(costs)
            else:
                truths[number] = self._holds(node, model)
                literal = number if truths[number] else -number
                cost[number] = 0 if node.is_proposition or literal in self._implied else 1
        seen = dict.fromkeys(conjuncts)
        queue = list(seen)
        for literal in queue:
            if truths[abs(literal)] != (literal > 0):
                raise ValueError("the solver's model does not make the formula true")
            node = self._circuit.node(literal)
            if isinstance(node, Atom):
                yield literal
                continue
            wrong = [-each for each in node.inputs if truths[abs(each)] != (each > 0)]
            needed = (
                node.inputs if literal > 0 else (min(wrong, key=lambda each: 0 if each in seen else cost[abs(each)]),)
            )
            queue += [each for each in needed if each not in seen]
            seen.update(dict.fromkeys(needed))

    @staticmethod
    def _holds(atom: Atom, model: Mapping[str, Value]) -> bool:
        """Whether an atom is true in a model; symbols without a value are zero, or false."""
        values = (factor * Fraction(model.get(name.removeprefix(PROPOSITION), 0)) for name, factor in atom.coefficients)
        total = sum(values, Fraction(0))
        return total < atom.bound or (total == atom.bound and not atom.strict)
