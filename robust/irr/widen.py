"""Exact widening: all faces of a box move outwards together until bad values stop them, one after the other.

How far a face may go is a linear program over the bad polyhedra that boxes have run into so far; a box that misses all
of them is checked against the envelope, and what is bad in it adds a polyhedron.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.encode.interface import Encoding, Facet
from robust.irr.containment import Question, Questions
from robust.plan.model import Parameter, Relation
from robust.qe.box import Box, Face, Interval, Side
from robust.qe.conjunctions import project
from robust.qe.constraint import LinearConstraint
from robust.qe.nnf import Leaf, Nnf, Reader, conjunction, implicant, names_in
from robust.qe.polyhedron import Polyhedron
from robust.qe.simplex import feasible_point, maximize
from robust.smt.export import Exporter
from robust.smt.limits import Deadline
from robust.smt.session import Session


@dataclass(frozen=True, slots=True)
class Limit:
    """Where a face stands: None is infinitely far out; `closed` tells whether the value itself belongs to the box."""

    value: Fraction | None
    closed: bool = True


@dataclass(frozen=True, slots=True)
class Least:
    """An infimum and whether it is attained."""

    value: Fraction
    attained: bool


STRETCH = "\u03bb"
"""The variable by which moving faces are scaled; no parameter can have this name."""


def box_of(parameters: Sequence[Parameter], limits: Mapping[Face, Limit]) -> Box:
    """The box whose faces stand at the limits."""
    intervals = {}
    for parameter in parameters:
        low, high = limits[parameter.name, Side.LOWER], limits[parameter.name, Side.UPPER]
        intervals[parameter.name] = Interval(low.value, high.value, low.closed, high.closed)
    return Box(intervals)


def least_stretch(
    piece: Polyhedron,
    fixed: Mapping[Face, Limit],
    moving: Mapping[Face, tuple[Fraction, Fraction]],
) -> Least | None:
    """The least λ ≥ 0 at which a box meets a bad polyhedron; None if it never does.

    Args:
        piece: bad parameter values.
        fixed: faces that stand still.
        moving: faces that stand at `base ± λ · speed`, as pairs (base, speed).
    """
    # Sides of other parameters leave room for every value: a box is nowhere empty.
    used = {name for constraint in piece.constraints for name, _ in constraint.coefficients}
    constraints = [*piece.constraints, LinearConstraint.of({STRETCH: 1}, ">=", 0)]
    for (name, side), limit in fixed.items():
        if name in used and limit.value is not None:
            relation = "<=" if limit.closed else "<"
            constraints.append(LinearConstraint.of({name: side.sign}, relation, side.sign * limit.value))
    for (name, side), (base, speed) in moving.items():
        if name in used:
            constraints.append(LinearConstraint.of({name: side.sign, STRETCH: -speed}, "<=", side.sign * base))
    names = [*(name for name in piece.parameters if name in used), STRETCH]
    best = maximize(names, constraints, {STRETCH: Fraction(-1)})
    if best is None:
        return None
    if best.value is None:
        raise ValueError("the stretch is not bounded below")
    return Least(-best.value, best.attained)


class DiscoveredBadSet(Questions[Polyhedron]):
    """The parameter values outside the envelope, discovered polyhedron by polyhedron as boxes run into them.

    A model of a query is generalised to its implicant, a conjunction of inequalities, which is projected exactly onto
    the parameters; a facet of enc_valid that the box breaks is a polyhedron as it is.
    """

    def __init__(self, encoding: Encoding, *, solver: str = "z3", exporter: Exporter | None = None) -> None:
        super().__init__(encoding, solver=solver, exporter=exporter)
        self._reader = Reader(encoding.terms)
        self._formulas: dict[str, Nnf] = {}
        self.reasons: dict[Polyhedron, str] = {}
        """The obligation, or the statements of the network, that each polyhedron breaks."""
        self.existence: set[Polyhedron] = set()
        """The polyhedra that leave no schedule."""
        self.checks = 0

    def piece_in(self, box: Box, deadline: Deadline) -> Polyhedron | None:
        """A polyhedron of bad values that meets the box; None if the box is inside the envelope.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        self.checks += 1
        return self._look_in(box, deadline)

    def _of_facet(self, facet: Facet, box: Box) -> Polyhedron:
        inside = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
        piece = Polyhedron(self._names, tuple(inside.negation()))
        if facet.obligation is None:
            self.existence.add(piece)
        self.reasons[piece] = facet.obligation or f"no schedule: {'; '.join(facet.origins)}"
        return piece

    def _of_model(self, question: Question, session: Session, box: Box) -> Polyhedron:
        """All parameter values that break the obligation in the way that the model does."""
        terms, name = self.encoding.terms, question.obligation.name
        if name not in self._formulas:
            formulas = self.encoding.query(question.obligation)
            self._formulas[name] = conjunction(self._reader.read(formula) for formula in formulas)
        symbols = {symbol for formula in session.assertions for symbol in terms.variables(formula)}
        chosen: dict[Leaf, None] = {}
        if not implicant(self._formulas[name], session.values(symbols), chosen):
            raise ValueError(f"the solver's model does not satisfy the query of {name!r}")
        constraints = [leaf for leaf in chosen if isinstance(leaf, LinearConstraint)]
        projected = project(constraints, names_in(conjunction(constraints)).difference(self._names))
        if projected is None:
            raise ValueError(f"the implicant of {name!r} is contradictory, although it has a model")
        piece = Polyhedron(self._names, projected)
        self.reasons[piece] = name
        return piece


class Widening:
    """One run of exact widening from the nominal point, which must be inside the envelope.

    Args:
        bad: the bad set.
        parameters: the parameters, with nominal values, weights and declared bounds.
        pieces: bad polyhedra that are known; those that boxes run into are added.
        groups: the faces that move together, group after group.
        deadline: when to stop with the best box so far.
        on_box: called with every box that is known to be inside; each contains those before.
    """

    def __init__(
        self,
        bad: DiscoveredBadSet,
        parameters: Sequence[Parameter],
        pieces: list[Polyhedron],
        *,
        groups: Sequence[Sequence[Face]],
        deadline: Deadline,
        on_box: Callable[[Box], None],
    ) -> None:
        self._bad = bad
        self._parameters = parameters
        self._groups = groups
        self._deadline = deadline
        self._on_box = on_box
        self._nominal = {parameter.name: parameter.nominal for parameter in parameters}
        self._weight = {parameter.name: parameter.weight for parameter in parameters}
        self._limits = {face: Limit(self._nominal[face[0]]) for face in faces_of(parameters)}
        self._pieces = pieces

    def run(self) -> None:
        """Move all faces as far as they go.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        for group in self._groups:
            moving = list(group)
            while moving:
                moving = self._round(moving)

    # -- one round: move until something blocks, then tell who is blocked -------------------------------------------

    def _round(self, moving: list[Face]) -> list[Face]:
        """Move faces outwards together; returns those that may go on."""
        least = self._farthest(moving)
        if least is None:
            self._limits.update({face: Limit(None) for face in moving})
            return []
        going, stuck = self._split(moving, least)
        self._limits.update({face: self._at(face, least.value, closed=not least.attained) for face in stuck})
        return going

    def _farthest(self, moving: list[Face]) -> Least | None:
        """The least stretch at which the box meets bad values, confirmed; None if it never does."""
        while True:
            least = self._least_stretch(moving)
            if least is None:
                limits = {face: Limit(None) for face in moving}
            else:
                limits = {face: self._at(face, least.value, closed=not least.attained) for face in moving}
            if self._is_inside(self._with(limits)):
                return least

    def _split(self, moving: list[Face], least: Least) -> tuple[list[Face], list[Face]]:
        """Which faces can still go beyond the stretch while the others stay there, confirmed."""
        while True:
            # Pieces farther out leave room for everybody.
            near = [piece for piece, found in self._stretches(moving) if found == least]
            going: list[Face] = []
            for face in moving:
                if self._can_go([*going, face], moving, least, near):
                    going.append(face)
            if self._is_inside(self._with(self._ahead(going, moving, least))):
                return going, [face for face in moving if face not in going]

    def _can_go(self, going: list[Face], moving: list[Face], least: Least, near: list[Polyhedron]) -> bool:
        if least.attained:
            # The value itself is bad for someone: who may include it?
            box = self._with(self._ahead(going, moving, least))
            bounds = list(box.constraints())
            return all(feasible_point(piece.parameters, [*piece.constraints, *bounds]) is None for piece in near)
        room = self._room(going, moving, least, near)
        return room is None or room > 0

    def _room(
        self, going: list[Face], moving: list[Face], least: Least, pieces: Iterable[Polyhedron]
    ) -> Fraction | None:
        """How much farther some faces can go, by what is known, while the others stay; None is without limit."""
        limits = {face: limit for face, limit in self._limits.items() if face not in moving}
        limits |= {face: self._at(face, least.value, closed=True) for face in moving if face not in going}
        speeds = {face: (self._place(face, least.value), self._weight[face[0]]) for face in going}
        found = [found.value for piece in pieces if (found := least_stretch(piece, limits, speeds)) is not None]
        return min(found, default=None)

    def _ahead(self, going: list[Face], moving: list[Face], least: Least) -> dict[Face, Limit]:
        """Limits with `going` a little farther than the other moving faces: by half the room that is known."""
        if least.attained:
            return {face: self._at(face, least.value, closed=face in going) for face in moving}
        room = self._room(going, moving, least, self._pieces) if going else None
        step = Fraction(1) if room is None else room / 2
        return {face: self._at(face, least.value + (step if face in going else 0), closed=True) for face in moving}

    # -- parts -----------------------------------------------------------------------------------------------------

    def _stretches(self, moving: list[Face]) -> Iterator[tuple[Polyhedron, Least]]:
        """At which stretch each known piece meets the box, if ever."""
        fixed = {face: limit for face, limit in self._limits.items() if face not in moving}
        speeds = {face: (self._nominal[face[0]], self._weight[face[0]]) for face in moving}
        for piece in self._pieces:
            least = least_stretch(piece, fixed, speeds)
            if least is not None:
                yield piece, least

    def _least_stretch(self, moving: list[Face]) -> Least | None:
        found = (least for _, least in self._stretches(moving))
        return min(found, key=lambda least: (least.value, not least.attained), default=None)

    def _place(self, face: Face, stretch: Fraction) -> Fraction:
        name, side = face
        return self._nominal[name] + side.sign * stretch * self._weight[name]

    def _at(self, face: Face, stretch: Fraction, *, closed: bool) -> Limit:
        return Limit(self._place(face, stretch), closed)

    def _with(self, limits: dict[Face, Limit]) -> Box:
        return box_of(self._parameters, {**self._limits, **limits})

    def _is_inside(self, box: Box) -> bool:
        """Ask; a box that is inside is reported, a bad polyhedron that meets it is remembered."""
        piece = self._bad.piece_in(box, self._deadline)
        if piece is not None:
            self._pieces.append(piece)
            return False
        self._on_box(box)
        return True


def faces_of(parameters: Sequence[Parameter]) -> list[Face]:
    """Both faces of every parameter."""
    return [(parameter.name, side) for parameter in parameters for side in (Side.UPPER, Side.LOWER)]
