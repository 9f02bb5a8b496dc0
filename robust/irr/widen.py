"""Exact widening: all faces of a box move outwards together until bad values stop them, one after the other.

How far a face may go is a linear program over the bad polyhedra that boxes have run into so far; a box that misses all
of them is checked against the envelope, and what is bad in it adds a polyhedron.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Protocol, cast

from robust.encode.interface import Encoding, Facet
from robust.irr.containment import Margins, ObligationQuestion, Questions
from robust.plan.model import Parameter, Relation
from robust.qe.box import Box, Face, Growing, Side
from robust.qe.conjunctions import Conjunction, irredundant, project
from robust.qe.constraint import LinearConstraint
from robust.qe.nnf import Leaf, Model, Nnf, conjunction, implicant, names_in
from robust.qe.polyhedron import Polyhedron
from robust.qe.simplex import maximize
from robust.smt.limits import Deadline
from robust.smt.session import Exporter, Session


@dataclass(frozen=True, slots=True)
class Least:
    """An infimum and whether it is attained."""

    value: Fraction
    attained: bool


class Meeting(Protocol):
    """When growing boxes meet something: exactly then, or not before, as `exact` says."""

    exact: bool

    @property
    def faces(self) -> Set[Face]:
        """The faces that come closer to it as they move outwards."""

    def least_stretch(self, growing: Growing) -> tuple[Fraction, bool] | None:
        """The least λ ≥ 0, and whether the box meets it at that λ; None if it never does."""


class FaceObstacle(Protocol):
    """Why boxes are not as wanted, in terms of where their faces stand; boxes around such boxes are not so either."""

    @property
    def mentioned(self) -> frozenset[str]:
        """The parameters whose faces matter."""

    @property
    def slabs(self) -> Meeting:
        """When boxes meet it, exactly."""

    @property
    def rooms(self) -> Sequence[tuple[Mapping[Face, Fraction], Fraction]]:
        """Linear forms over faces, each with its constant: a box misses it if and only if one is not negative."""

    def meets(self, box: Box) -> bool:
        """Whether a box does."""


Obstacle = Polyhedron | FaceObstacle
"""What boxes must not meet, and what stops them when they grow."""


class BadSet(Protocol):
    """Where boxes must not go."""

    def piece_in(self, box: Box, deadline: Deadline) -> Obstacle | None:
        """Something that the box meets; None if the box is as wanted. OutOfTimeError if the deadline passes first."""


def _stops(piece: Obstacle, growing: Growing) -> bool:
    """Whether the box meets a bad polyhedron as soon as it grows."""
    bound = piece.slabs.least_stretch(growing)
    if bound is None or bound[0] > 0:
        return False
    least = least_stretch(piece, growing)
    return least is not None and not least.value


STRETCH = "\u03bb"
"""The variable by which moving faces are scaled; no parameter can have this name."""


def least_stretch(piece: Obstacle, growing: Growing) -> Least | None:
    """The least λ ≥ 0 at which a box meets a bad polyhedron; None if it never does."""
    least = piece.slabs.least_stretch(growing)
    if least is None or piece.slabs.exact or not isinstance(piece, Polyhedron):
        return None if least is None else Least(*least)
    # Sides of other parameters leave room for every value: a box is nowhere empty.
    used = [name for name in piece.parameters if name in piece.mentioned]
    box, moving = growing.box, growing.moving
    constraints = [*piece.constraints, LinearConstraint.of({STRETCH: 1}, ">=", 0)]
    for name, side in product(used, Side):
        end, sign = box[name].end(side), side.sign
        if (name, side) in moving:
            base, speed = moving[name, side]
            constraints.append(LinearConstraint.of({name: sign, STRETCH: -speed}, "<=", sign * base))
        elif end is not None:
            relation = "<=" if box[name].is_closed_at(side) else "<"
            constraints.append(LinearConstraint.of({name: sign}, relation, sign * end))
    best = maximize([*used, STRETCH], constraints, {STRETCH: Fraction(-1)})
    if best is None:
        return None
    if best.value is None:
        raise ValueError("the stretch is not bounded below")
    return Least(-best.value, best.attained)


def first(stretches: Iterable[Least | None]) -> Least | None:
    """The least of some stretches, an attained one before others; None if there is none."""
    known = (least for least in stretches if least is not None)
    return min(known, key=lambda least: (least.value, not least.attained), default=None)


def touching(pieces: Iterable[Polyhedron], box: Box, face: Face) -> Iterator[Polyhedron]:
    """The polyhedra, of some that a box misses, that it meets as soon as the face moves outwards alone."""
    end = box[face[0]].end(face[1])
    if end is None:
        return
    growing = Growing(box, {face: (end, Fraction(1))})
    for piece in pieces:
        if _may_touch(piece, box, face):
            if len(piece.constraints) == 1 and not piece.constraints[0].is_equality:
                yield piece  # what one constraint allows is all there is to it
                continue
            least = least_stretch(piece, growing)
            if least is not None and least.value == 0:
                yield piece


def _may_touch(piece: Polyhedron, box: Box, face: Face) -> bool:
    """Whether each constraint by itself allows it, and one of them asks for it."""
    name, side = face
    halves = [half for constraint in piece.constraints for half in constraint.halves()]
    towards = any(factor * side.sign < 0 for half in halves for known, factor in half.coefficients if known == name)
    return towards and all(_is_within_reach(half, box) for half in halves)


def _is_within_reach(half: LinearConstraint, box: Box) -> bool:
    """Whether the closed box has a point that satisfies `form ≤ constant`."""
    least = box.values_of(half.coefficients, 0).lower
    return least is None or least <= half.constant


class DiscoveredBadSet(Questions[Polyhedron]):
    """The parameter values outside the envelope, discovered polyhedron by polyhedron as boxes run into them.

    A model of a query is generalised to its implicant, a conjunction of inequalities, which is projected exactly onto
    the parameters; a facet of enc_valid that the box breaks is a polyhedron as it is.
    """

    PROVING = True

    def __init__(self, encoding: Encoding, *, solver: str = "z3", exporter: Exporter | None = None) -> None:
        super().__init__(encoding, solver=solver, exporter=exporter)
        self._formulas: dict[str, Nnf] = {}
        self._needed: dict[Polyhedron, Polyhedron] = {}
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

    def _known_ends(self, question: ObligationQuestion, box: Box, reach: Margins) -> Iterable[Face]:
        pieces = [piece for piece, reason in self.reasons.items() if reason == question.obligation.name]
        return (face for face in reach if next(touching(pieces, box, face), None) is not None)

    def _distance(self, obstacle: Polyhedron | Facet, face: Face, step: Fraction, box: Box) -> Fraction | None:
        piece = self._outside(obstacle) if isinstance(obstacle, Facet) else obstacle
        end = box[face[0]].end(face[1])
        least = None if end is None else least_stretch(piece, Growing(box, {face: (end, Fraction(1))}))
        return None if least is None else least.value

    def _outside(self, facet: Facet) -> Polyhedron:
        inside = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
        return Polyhedron(self._names, tuple(inside.negation()))

    def _of_facet(self, facet: Facet, box: Box) -> Polyhedron:
        piece = self._outside(facet)
        if facet.obligation is None:
            self.existence.add(piece)
        self.reasons[piece] = facet.obligation or f"no schedule: {'; '.join(facet.origins)}"
        return piece

    def _of_piece(self, question: ObligationQuestion, piece: Polyhedron, box: Box) -> Polyhedron:
        needed = self._needed.get(piece)
        if needed is None:
            needed = self._needed[piece] = Polyhedron(self._names, irredundant(piece.constraints) or ())
            self.reasons[needed] = question.obligation.name
        return needed

    def _of_model(self, question: ObligationQuestion, session: Session, box: Box) -> Polyhedron:
        """All parameter values that break the obligation in the way that the model does."""
        terms, name = self.encoding.terms, question.obligation.name
        if name not in self._formulas:
            formulas = self.encoding.query(question.obligation)
            self._formulas[name] = conjunction(self.reader.read(formula) for formula in formulas)
        symbols = {symbol for formula in session.assertions for symbol in terms.variables(formula)}
        chosen: dict[Leaf, None] = {}
        if not implicant(self._formulas[name], session.values(symbols), chosen):
            raise ValueError(f"the solver's model does not satisfy the query of {name!r}")
        constraints = [leaf for leaf in chosen if isinstance(leaf, LinearConstraint)]
        projected = self._projection(constraints, session.values(symbols))
        if projected is None:
            raise ValueError(f"the implicant of {name!r} is contradictory, although it has a model")
        piece = Polyhedron(self._names, projected)
        self.reasons[piece] = name
        return piece

    def _projection(self, constraints: Sequence[LinearConstraint], _model: Model) -> Conjunction | None:
        """What the constraints, which the model satisfies, say of the parameters; None if they contradict."""
        return project(constraints, names_in(conjunction(constraints)).difference(self._names))


@dataclass(eq=False, kw_only=True)
class Widening:
    """One run of exact widening from the nominal point, or from a box, which must be inside the envelope.

    Args:
        bad: the bad set.
        parameters: the parameters, with nominal values, weights and declared bounds.
        pieces: obstacles that are known; those that boxes run into are added.
        groups: the faces that move together, group after group; they have to be finite in the box to start from.
        deadline: when to stop with the best box so far.
        on_box: called with every box that is known to be inside; each contains those before.
        start: the box to start from, if it is not the nominal point.
    """

    bad: BadSet
    parameters: Sequence[Parameter]
    pieces: list[Polyhedron] | list[Obstacle]
    groups: Sequence[Sequence[Face]]
    deadline: Deadline
    on_box: Callable[[Box], None]
    start: Box | None = None

    def __post_init__(self) -> None:
        self._weight = {parameter.name: parameter.weight for parameter in self.parameters}
        self._box = Box.nominal(self.parameters) if self.start is None else self.start
        self._base = {
            (name, side): end
            for name, interval in self._box.intervals.items()
            for side in Side
            if (end := interval.end(side)) is not None
        }
        self._met: list[Least | None] = []
        """The stretches of the pieces in this round, as far as they were asked for."""

    def run(self) -> None:
        """Move all faces as far as they go.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        for group in self.groups:
            moving = list(group)
            while moving:
                moving = self._round(moving)

    # -- one round: move until something blocks, then find out which faces are blocked ---------------------------------

    def _round(self, moving: list[Face]) -> list[Face]:
        """Move faces outwards together; returns those that may go on."""
        least = self._farthest(moving)
        if least is None:
            self._box = self._stretched(moving, None)
            return []
        going, stuck = self._split(moving, least)
        self._box = self._stretched(stuck, least)
        return going

    def _farthest(self, moving: list[Face]) -> Least | None:
        """The least stretch at which the box meets bad values, confirmed; None if it never does."""
        self._met = []
        while True:
            least = self._least_stretch(moving)
            if self._is_inside(self._stretched(moving, least)):
                return least

    def _split(self, moving: list[Face], least: Least) -> tuple[list[Face], list[Face]]:
        """Which faces can still go beyond the stretch while the others stay there, confirmed."""
        while True:
            # Pieces farther out leave room for all faces.
            near = [piece for piece, stretch in self._stretches(moving) if stretch == least]
            going: list[Face] = []
            for face in moving:
                self.deadline.enforce()
                # A piece that does not stop the faces that go does not stop a face that it does not mention.
                around = [piece for piece in near if face[0] in piece.mentioned]
                if self._can_go([*going, face], moving, least, around):
                    going.append(face)
            if self._is_inside(self._ahead(going, moving, least)):
                return going, [face for face in moving if face not in going]

    def _can_go(self, going: list[Face], moving: list[Face], least: Least, near: list[Obstacle]) -> bool:
        if least.attained:
            # The value itself is bad for some face: which faces may include it?
            ahead = self._ahead(going, moving, least)
            return not any(piece.meets(ahead) for piece in near)
        growing = self._beyond(going, moving, least) if near else None
        return growing is None or not any(_stops(piece, growing) for piece in near)

    def _beyond(self, going: list[Face], moving: list[Face], least: Least) -> Growing:
        """Some faces go farther, while the others stay."""
        box = self._stretched([face for face in moving if face not in going], Least(least.value, attained=False))
        return Growing(box, {face: (self._place(face, least.value), self._weight[face[0]]) for face in going})

    def _room(self, going: list[Face], moving: list[Face], least: Least) -> Fraction | None:
        """How much farther some faces can go, by what is known, while the others stay; None is without limit."""
        growing = self._beyond(going, moving, least)
        room: Fraction | None = None
        for piece in self.pieces:
            near = piece.slabs.least_stretch(growing)
            if near is not None and (room is None or near[0] < room):
                nearest = least_stretch(piece, growing)
                if nearest is not None and (room is None or nearest.value < room):
                    room = nearest.value
        return room

    def _ahead(self, going: list[Face], moving: list[Face], least: Least) -> Box:
        """The box with `going` a little farther than the other moving faces: by half the room that is known."""
        step = Fraction(0)
        if not least.attained:
            room = self._room(going, moving, least) if going else None
            step = Fraction(1) if room is None else room / 2
        stuck = self._stretched([face for face in moving if face not in going], least)
        return self._stretched(going, Least(least.value + step, attained=False), stuck)

    # -- parts -----------------------------------------------------------------------------------------------------

    def _stretches(self, moving: list[Face]) -> Iterator[tuple[Obstacle, Least]]:
        """At which stretch each known piece meets the box, if ever."""
        # Within a round the box and what moves are the same, so only new pieces are asked.
        if len(self._met) < len(self.pieces):
            growing = Growing(self._box, {face: (self._base[face], self._weight[face[0]]) for face in moving})
            self._met += [least_stretch(piece, growing) for piece in self.pieces[len(self._met) :]]
        for piece, least in zip(self.pieces, self._met, strict=True):
            if least is not None:
                yield piece, least

    def _least_stretch(self, moving: list[Face]) -> Least | None:
        return first(least for _, least in self._stretches(moving))

    def _place(self, face: Face, stretch: Fraction) -> Fraction:
        name, side = face
        return self._base[face] + side.sign * stretch * self._weight[name]

    def _stretched(self, faces: Iterable[Face], least: Least | None, box: Box | None = None) -> Box:
        """The box with some faces at a stretch, without their ends if bad values attain it; None: infinitely far."""
        ends = {face: None if least is None else self._place(face, least.value) for face in faces}
        return (box or self._box).with_faces(ends, closed=least is None or not least.attained)

    def _is_inside(self, box: Box) -> bool:
        """Ask; a box that is inside is reported, a bad polyhedron that meets it is remembered."""
        piece = self.bad.piece_in(box, self.deadline)
        if piece is not None:
            cast("list[Obstacle]", self.pieces).append(piece)
            return False
        self.on_box(box)
        return True


def faces_of(parameters: Sequence[Parameter]) -> list[Face]:
    """Both faces of every parameter."""
    return [(parameter.name, side) for parameter in parameters for side in (Side.UPPER, Side.LOWER)]
