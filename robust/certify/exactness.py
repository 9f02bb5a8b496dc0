"""Why a region is the whole envelope: everything outside of its pieces is in polyhedra of bad parameter values.

A polyhedron is bad because a circle of network constraints leaves no schedule in it, or because a schedule that is
affine in the parameters breaks one obligation all over it. Both are found at a point that nothing explains yet, and
generalised: the circle's sum, or the exact projection of what makes the formula of the broken obligation true there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.certify.circuit import Circuit, Conjunction
from robust.certify.cycles import Step, cycle_sum, positive_cycle
from robust.certify.ground import GroundPlan, Line
from robust.certify.linear import PROPOSITION, Atom, constraint
from robust.certify.sections import Form, Half, combined, form_of, section
from robust.encode.interface import Encoding, Obligation
from robust.encode.variables import Range, TimeVariable
from robust.errors import UnsupportedError
from robust.irr.box import Interval
from robust.irr.containment import within
from robust.plan.model import Relation
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.cover import outside
from robust.qe.polyhedron import Polyhedron
from robust.qe.projection import eliminate
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Value, Verdict

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
    return [(combined({"": half.constant}, dict(half.coefficients), -1), half.is_strict) for half in halves]


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
                raise OutOfTimeError
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
        polyhedron = Polyhedron(self._names, eliminate([*self._names, *hidden], constraints, hidden))
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
