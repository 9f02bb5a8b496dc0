"""Labeled regions and boxes of plans with choices: searches that keep what they have found when they are ended.

A box for a strategy lies in the union of the polyhedra in which the choices that are assumed lead to a correct
execution. A box for whatever people choose lies in that union for every combination of their choices. Both are found by
exact widening, as for plans without choices, inside polyhedra instead of formulas.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from robust.errors import InputError, Location
from robust.irr.stops import JUST
from robust.irr.widen import Widening, faces_of, touching
from robust.numbers import Number, exact
from robust.pike_bridge.envelopes.parameters import ParametricPlan
from robust.pike_bridge.envelopes.pieces import (
    BoundStatement,
    Combination,
    ParametricQuestion,
    Piece,
    Pieces,
    Statement,
    combinations,
    question,
    waiting_question,
)
from robust.pike_bridge.model import ALWAYS, Guard, check_choice
from robust.pike_bridge.searches import Announce, PikeSearch, Stopped, unheard
from robust.plan.model import Parameter
from robust.presented import Presented
from robust.qe.box import Box, Face
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Point, Polyhedron
from robust.qe.region import Region, outside
from robust.searching import Status
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

ENUMERATING = 0.8
"""The share of the time that a box leaves to finding polyhedra."""


def uncontrollable(plan: ParametricPlan) -> tuple[str, ...]:
    """The choices of people and nature."""
    return tuple(one.name for one in plan.plan.network.choices if not one.controllable)


def checked_choices(plan: ParametricPlan, names: Sequence[str], where: str) -> tuple[str, ...]:
    """The names, if they are of choices; InputError, which says where they were found, if not."""
    for name in names:
        check_choice(plan.plan.network.domains, name, None, Location(where))
    return tuple(dict.fromkeys(names))


# -- labeled regions ---------------------------------------------------------------------------------------------------


@dataclass
class LabeledRegion(Presented, ask="combinations"):
    """For which parameter values which choices lead to a correct execution; `status` says whether this is all."""

    plan: ParametricPlan
    key: tuple[str, ...]
    """The choices that are told apart; the others are as it suits."""
    assume: Guard = ALWAYS
    pieces: tuple[Piece, ...] = ()
    status: Status = Status.COMPLETE
    queries: int = 0
    seconds: float = 0.0

    @property
    def cut_short(self) -> bool:
        """Whether something ended the search before it was done."""
        return self.status is not Status.COMPLETE

    @property
    def combinations(self) -> tuple[Combination, ...]:
        """Combinations of values that cover all there are, with the pieces of each; without, it is impossible."""
        return tuple(combinations(self.pieces, self.plan.plan.network.domains))

    def region(self, choices: Mapping[str, str]) -> Region:
        """The parameter values for which some correct execution has these choices."""
        known = dict(choices)
        fitting = [
            piece.polyhedron.restricted(self.plan.declared_box.constraints())
            for piece in self.pieces
            if all(known.get(variable, value) == value for variable, value in piece.label)
        ]
        return Region.union_of(self.plan.names, fitting)

    def possible(self, values: Mapping[str, Number]) -> tuple[Guard, ...]:
        """The combinations for which some correct execution exists with these parameter values.

        Raises:
            InputError: for parameters that are missing or unknown, and for what is no number.
        """
        for name in (*values, *self.plan.names):
            if name not in values or name not in self.plan.names:
                found = f"values of {', '.join(map(str, values))}" if values else "no values"
                raise InputError(f"found {found}, expected one of each parameter: {', '.join(self.plan.names)}")
        point = {name: exact(value, Location(f"value of {name}")) for name, value in values.items()}
        return tuple(each.choices for each in self.combinations if any(point in one for one in each.polyhedra))

    def exactly(self, deadline: Deadline = NEVER) -> tuple[tuple[tuple[Combination, ...], Region], ...]:
        """The parameter values cut into regions, with the combinations that are possible in each, and no others.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        whole = Polyhedron.of_box(self.plan.names, self.plan.declared_box)
        cells: list[tuple[tuple[Combination, ...], list[Polyhedron]]] = [((), [whole])]
        for combination in self.combinations:
            following = []
            for possible, parts in cells:
                inside: list[Polyhedron] = []
                left = parts
                for piece in combination.polyhedra:
                    deadline.enforce()
                    met = [part.intersection(piece) for part in left]
                    inside += [part for part in met if not part.is_empty]
                    left = [rest for part in left for rest in part.minus(piece)]
                following += [((*possible, combination), inside)] if inside else []
                following += [(possible, left)] if left else []
            cells = following
        return tuple((possible, Region.union_of(self.plan.names, parts)) for possible, parts in cells)


class LabeledRegionSearch(PikeSearch[LabeledRegion]):
    """Finds a labeled region.

    Args:
        plan: the plan with its parameters.
        key: the choices that are told apart; those of people and nature, if not given.
        assume: choices that are made already.
        on_piece: called with each piece as it is found.

    Raises:
        InputError: if a choice is unknown.
    """

    def __init__(
        self,
        plan: ParametricPlan,
        key: Sequence[str] | None = None,
        *,
        assume: Guard = ALWAYS,
        solver: str = "z3",
        deadline: Deadline = NEVER,
        on_piece: Callable[[Piece], None] = lambda _piece: None,
    ) -> None:
        names = uncontrollable(plan) if key is None else checked_choices(plan, key, "choices")
        made = {one.variable for one in assume}
        self._known = LabeledRegion(plan, tuple(name for name in names if name not in made), assume)
        asked = question(plan, self._known.key, assume)
        self._pieces = Pieces(asked, plan.declared, solver=solver)
        self._deadline = deadline
        self._on_piece = on_piece
        self._started = time.perf_counter()

    def _search(self) -> None:
        for piece in self._pieces.search(self._deadline):
            self._on_piece(piece)

    def _answer(self, stopped: Stopped | None) -> LabeledRegion:
        known = self._known
        known.pieces, known.queries = tuple(self._pieces.found), self._pieces.queries
        known.status, known.seconds = Status(stopped or "complete"), time.perf_counter() - self._started
        return known


# -- boxes -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class TeamStop:
    """What ends a side of a box: with which choices, by which inequality, and the statements behind it."""

    choices: Guard
    constraint: LinearConstraint | None
    """None for a declared bound, and where nothing is known."""
    statements: tuple[Statement, ...] = ()
    declared: bool = False
    own: bool = False
    """Whether it is the other bound of the same activity or constraint."""


@dataclass
class TeamEnvelope(Presented, ask="verified"):
    """A box of parameter values, and what it promises.

    Of the choices in `for_all`, every combination leads to a correct execution for all values in the box, if what
    people will choose is known beforehand; with `waiting`, also if it becomes known only when they choose. INVALID:
    that is not even so at the nominal values, with the choices in `broken`. The box is empty, and not `verified`, if
    what is promised is not known of any values.
    """

    plan: ParametricPlan
    assume: Guard
    for_all: tuple[str, ...]
    waiting: bool
    box: Box
    status: Status = Status.COMPLETE
    combinations: tuple[Combination, ...] = ()
    stops: dict[Face, TeamStop] = field(default_factory=dict)
    broken: Guard | None = None
    possible: bool = True
    """Of the broken choices: whether other parameter values would help."""
    needed: tuple[LinearConstraint, ...] = ()
    """What the nominal values break, of a polyhedron of the broken choices."""
    queries: int = 0
    boxes: int = 0
    seconds: float = 0.0

    @property
    def cut_short(self) -> bool:
        """Whether something ended the search before it was done."""
        return self.status not in {Status.COMPLETE, Status.INVALID}

    @property
    def verified(self) -> bool:
        """Whether what is promised holds for all values in the box; if not, there are none in it."""
        return not self.box.is_empty

    @property
    def region(self) -> Region:
        """The parameter values for which what the box promises is so, as far as polyhedra were found."""
        region = Region.union_of(self.plan.names, [Polyhedron.of_box(self.plan.names, self.plan.declared_box)])
        for each in self.combinations:
            region = region.intersection(Region.union_of(self.plan.names, each.polyhedra))
        return region


class UnionBadSet:
    """The parameter values that are outside the bounds, or in no polyhedron of some combination."""

    def __init__(self, parameters: Sequence[Parameter], alternatives: Sequence[Combination]) -> None:
        self._names = tuple(one.name for one in parameters)
        sides = Box.declared(parameters).constraints()
        self._bounds = [Polyhedron(self._names, tuple(side.negation())) for side in sides]
        self._alternatives = alternatives
        self.stops: dict[Polyhedron, TeamStop] = {one: TeamStop(ALWAYS, None, declared=True) for one in self._bounds}
        """Why each polyhedron that was found is bad."""
        self._sides: dict[Polyhedron, tuple[tuple[LinearConstraint, tuple[Statement, ...]], ...]] = {}
        self.checks = 0

    def piece_in(self, box: Box, deadline: Deadline) -> Polyhedron | None:
        """A polyhedron of bad values that meets the box; None if there is none.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        self.checks += 1
        for bound in self._bounds:
            if bound.meets(box):
                return bound
        asked = Polyhedron.of_box(self._names, box)
        for combination in self._alternatives:
            deadline.enforce()
            point = outside(asked, combination.polyhedra)
            if point is not None:
                return self._around(point, combination)
        return None

    def _around(self, point: Point, combination: Combination) -> Polyhedron:
        """What breaks, of each polyhedron of a combination, an inequality that the point breaks."""
        chosen: dict[LinearConstraint, tuple[LinearConstraint, tuple[Statement, ...]]] = {}
        for piece in combination.pieces:
            broken = {
                side: (one, piece.because.get(one, ()))
                for one in piece.polyhedron.constraints
                for side in one.negation()
                if side.evaluate(point)
            }
            if not broken.keys() & chosen.keys():
                side = next(iter(broken))
                chosen[side] = broken[side]
        bad = Polyhedron(self._names, tuple(chosen))
        self.stops.setdefault(bad, TeamStop(combination.choices, None))
        self._sides.setdefault(bad, tuple(chosen.values()))
        return bad

    def stop(self, piece: Polyhedron, face: Face, box: Box) -> TeamStop:
        """Why a box ends at a polyhedron, by the inequality that holds the face back: the whole box satisfies it."""
        stop = self.stops[piece]
        name, side = face
        towards = [
            (constraint, statements)
            for constraint, statements in self._sides.get(piece, ())
            if any(known == name and factor * side.sign > 0 for known, factor in constraint.coefficients)
        ]
        for constraint, statements in towards:
            if all(not Polyhedron(self._names, (beyond,)).meets(box) for beyond in constraint.negation()):
                return TeamStop(stop.choices, constraint, statements)
        return TeamStop(stop.choices, *towards[0]) if towards else stop


class TeamEnvelopeSearch(PikeSearch[TeamEnvelope]):
    """Finds a box of parameter values around the nominal ones.

    Args:
        plan: the plan with its parameters.
        assume: choices that are made already.
        for_all: choices of which every combination of values must lead to a correct execution.
        waiting: whether what they will be becomes known only when they are made.

    Raises:
        InputError: if a choice is unknown, or assumed and asked about for all values.
    """

    def __init__(
        self,
        plan: ParametricPlan,
        *,
        assume: Guard = ALWAYS,
        for_all: Sequence[str] = (),
        waiting: bool = False,
        solver: str = "z3",
        deadline: Deadline = NEVER,
        on_stage: Announce = unheard,
    ) -> None:
        names = checked_choices(plan, for_all, "--for-all")
        for one in assume:
            if one.variable in names:
                raise InputError(f"--for-all: found {one.variable!r}, which is assumed to be {one.value}; expected one")
        self._known = TeamEnvelope(plan, assume, names, waiting, Box.nothing(plan.declared))
        self._solver = solver
        self._deadline = deadline
        self._say = on_stage
        self._started = time.perf_counter()
        self._bad = UnionBadSet(plan.declared, ())

    def _search(self) -> None:
        """Find a box; whenever that is ended, what is promised holds for all values in the best one by then."""
        known, remaining = self._known, self._deadline.remaining
        known.combinations = self._alternatives(Deadline.after(None if remaining is None else remaining * ENUMERATING))
        self._bad = UnionBadSet(known.plan.declared, known.combinations)
        if self._is_inside():
            self._say("widening")
            self._widen()

    def _answer(self, stopped: Stopped | None) -> TeamEnvelope:
        known = self._known
        known.status = known.status if stopped is None else Status(stopped)
        known.seconds, known.boxes = time.perf_counter() - self._started, self._bad.checks
        return known

    # -- polyhedra -----------------------------------------------------------------------------------------------------

    def _alternatives(self, deadline: Deadline) -> tuple[Combination, ...]:
        """The combinations in all of which the box must be, as far as they are found in time."""
        known = self._known
        self._say("choices and polyhedra")
        pieces = self._enumerated(question(known.plan, known.for_all, known.assume), deadline)
        alternatives = tuple(combinations(pieces, known.plan.plan.network.domains))
        if not known.waiting or len(alternatives) < 2 or not all(each.pieces for each in alternatives):
            return alternatives
        self._say("waiting")
        asked = waiting_question(known.plan, [each.choices for each in alternatives], known.assume)
        return (Combination(ALWAYS, tuple(self._enumerated(asked, deadline))),)

    def _enumerated(self, asked: ParametricQuestion, deadline: Deadline) -> list[Piece]:
        """All pieces, or those that are found in time."""
        search = Pieces(asked, self._known.plan.declared, solver=self._solver)
        try:
            for number, _ in enumerate(search.search(deadline), 1):
                self._say(f"polyhedra: {number}")
        except OutOfTimeError:
            self._known.status = Status.TIMEOUT
        self._known.queries += search.queries
        return search.found

    def _is_inside(self) -> bool:
        """Whether the nominal values are; if not, what is broken is noted."""
        known = self._known
        nominal = known.plan.nominal
        for each in known.combinations:
            if not any(nominal in one for one in each.polyhedra):
                if known.status is Status.COMPLETE:
                    known.status = Status.INVALID
                known.broken, known.possible = each.choices, bool(each.pieces)
                if each.pieces:
                    known.needed = _fewest_broken(each.polyhedra, nominal)
                return False
        known.box = Box.nominal(known.plan.declared)
        return True

    # -- boxes ---------------------------------------------------------------------------------------------------------

    def _widen(self) -> None:
        known, parameters = self._known, self._known.plan.declared
        pieces: list[Polyhedron] = []
        Widening(
            bad=self._bad,
            parameters=parameters,
            pieces=pieces,
            groups=[faces_of(parameters)],
            deadline=self._deadline,
            on_box=self._keep,
        ).run()
        for face in faces_of(parameters):
            end = known.box[face[0]].end(face[1])
            if end is not None:
                known.stops[face] = self._stop(face, end, pieces)

    def _keep(self, box: Box) -> None:
        self._known.box = box

    def _stop(self, face: Face, end: Fraction, pieces: Sequence[Polyhedron]) -> TeamStop:
        box = self._known.box
        touched = [self._bad.stop(piece, face, box) for piece in touching(pieces, box, face)]
        if not touched:
            piece = self._bad.piece_in(box.moved(face, end + face[1].sign * JUST), self._deadline)
            touched = [] if piece is None else [self._bad.stop(piece, face, box)]
        stop = min(touched, key=lambda one: (not one.declared, len(one.statements)), default=TeamStop(ALWAYS, None))
        return TeamStop(stop.choices, stop.constraint, stop.statements, stop.declared, self._is_own(stop, face))

    def _is_own(self, stop: TeamStop, face: Face) -> bool:
        """Whether all that holds a face back are bounds of the one thing that the parameter is about."""
        parameter = next(one for one in self._known.plan.parameters if one.name == face[0])
        places = {one.place if isinstance(one, BoundStatement) else None for one in stop.statements}
        return len(places) == 1 and places <= set(parameter.places)


def _fewest_broken(polyhedra: Sequence[Polyhedron], values: Point) -> tuple[LinearConstraint, ...]:
    """What the values break, of the polyhedron of which they break fewest inequalities, and by least."""

    def broken(one: Polyhedron) -> tuple[LinearConstraint, ...]:
        return tuple(constraint for constraint in one.constraints if not constraint.evaluate(values))

    def cost(constraints: tuple[LinearConstraint, ...]) -> tuple[int, Fraction]:
        return len(constraints), sum((one.value(values) - one.constant for one in constraints), Fraction(0))

    return min(map(broken, polyhedra), key=cost)
