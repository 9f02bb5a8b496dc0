"""Labeled regions and boxes of plans with choices: searches that keep what they have found when they are ended.

A box for a strategy lies in the union of the polyhedra in which the choices that are assumed lead to a correct
execution. A box for whatever people choose lies in that union for every combination of their choices. Both are found by
exact widening, as for plans without choices, inside polyhedra instead of formulas.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from fractions import Fraction

from robust.errors import InputError, Location
from robust.irr.stops import JUST
from robust.irr.widen import Widening, faces_of, touching
from robust.numbers import Number, exact
from robust.pike_bridge.envelopes import pieces
from robust.pike_bridge.envelopes.parameters import ParametricPlan
from robust.pike_bridge.envelopes.pieces import Combination, GoodPiece, Statement
from robust.pike_bridge.model import ALWAYS, Guard, check_choice, contradicts, guard
from robust.plan.model import Parameter
from robust.qe.box import Box, Face
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Point, Polyhedron
from robust.qe.region import Region, outside
from robust.searching import Announce, Searching, Status, Stoppable, stopped_as, unheard
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

ENUMERATING = 0.8
"""The share of the time that a box leaves to finding polyhedra."""


def checked_choices(plan: ParametricPlan, names: Sequence[str], where: str) -> tuple[str, ...]:
    """The names, if they are of choices; InputError, which says where they were found, if not."""
    for name in names:
        check_choice(plan.plan.network.domains, name, None, Location(where))
    return tuple(dict.fromkeys(names))


# -- labeled regions ---------------------------------------------------------------------------------------------------


@dataclass
class LabeledRegion(Stoppable, ask="combinations"):
    """For which parameter values which choices lead to a correct execution.

    Attributes:
        key: the choices that are distinguished; the others are existentially quantified.
        pieces: polyhedra of parameter values, each with the choices that it needs.
        status: whether these are all; if a solver failed, `reason` says how.
    """

    plan: ParametricPlan
    key: tuple[str, ...]
    assume: Guard = ALWAYS
    pieces: tuple[GoodPiece, ...] = ()
    status: Status = Status.COMPLETE
    reason: str | None = None
    queries: int = 0
    seconds: float = 0.0

    @property
    def combinations(self) -> tuple[Combination, ...]:
        """Combinations of values that cover all there are, with the pieces of each; without, it is impossible."""
        return tuple(pieces.combinations(self.pieces, self.plan.plan.network.domains))

    def region(self, choices: Mapping[str, str]) -> Region:
        """The parameter values for which some correct execution has these choices."""
        wanted, bounds = guard(choices), self.plan.declared_box.constraints()
        fitting = (piece.polyhedron for piece in self.pieces if not contradicts(wanted, piece.label))
        return Region.union_of(self.plan.names, [polyhedron.restricted(bounds) for polyhedron in fitting])

    def possible(self, values: Mapping[str, Number]) -> tuple[Guard, ...]:
        """The combinations for which some correct execution exists with these parameter values.

        Raises:
            InputError: for parameters that are missing or unknown, and for what is no number.
        """
        for name in (*values, *self.plan.names):
            if name not in values or name not in self.plan.names:
                given = f"values of {', '.join(map(str, values))}" if values else "no values"
                raise InputError(f"found {given}, expected one of each parameter: {', '.join(self.plan.names)}")
        point = {name: exact(value, Location(f"value of {name}")) for name, value in values.items()}
        return tuple(combination.choices for combination in self.combinations if combination.allows(point))

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
                rest = parts
                for polyhedron in combination.polyhedra:
                    deadline.enforce()
                    common = [part.intersection(polyhedron) for part in rest]
                    inside += [part for part in common if not part.is_empty]
                    rest = [outer for part in rest for outer in part.minus(polyhedron)]
                following += [((*possible, combination), inside)] if inside else []
                following += [(possible, rest)] if rest else []
            cells = following
        return tuple((possible, Region.union_of(self.plan.names, parts)) for possible, parts in cells)


@dataclass
class LabeledRegionSearch(Searching[LabeledRegion]):
    """Finds a labeled region.

    Args:
        plan: the plan with its parameters.
        key: the choices to distinguish; if not given, those of people and nature.
        assume: choices that are made already.
        on_piece: called with each piece as it is found.

    Raises:
        InputError: if a choice is unknown.
    """

    plan: ParametricPlan
    key: Sequence[str] | None = None
    _: KW_ONLY
    assume: Guard = ALWAYS
    solver: str = "z3"
    deadline: Deadline = NEVER
    on_piece: Callable[[GoodPiece], None] = lambda _piece: None

    def __post_init__(self) -> None:
        super().__init__()
        plan, assume = self.plan, self.assume
        asked_for = plan.plan.network.uncontrollable if self.key is None else self.key
        names = checked_choices(plan, asked_for, "choices")
        self._known = LabeledRegion(plan, tuple(name for name in names if name not in dict(assume)), assume)
        asked = pieces.question(plan, self._known.key, assume)
        self._pieces = pieces.GoodPieces(asked, plan.declared, solver=self.solver)

    def _search(self) -> None:
        for piece in self._pieces.search(self.deadline):
            self.on_piece(piece)

    def _result(self, status: Status, reason: str | None = None) -> LabeledRegion:
        known = self._known
        known.pieces, known.queries = tuple(self._pieces.found), self._pieces.queries
        known.status, known.reason, known.seconds = status, reason, self._seconds()
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
class TeamEnvelope(Stoppable, ask="verified"):
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
    reason: str | None = None
    """If a solver failed: how."""
    broken: Guard | None = None
    possible: bool = True
    """Of the broken choices: whether other parameter values would help."""
    needed: tuple[LinearConstraint, ...] = ()
    """What the nominal values break, of a polyhedron of the broken choices."""
    queries: int = 0
    boxes: int = 0
    seconds: float = 0.0

    @property
    def verified(self) -> bool:
        """Whether what is promised holds for all values in the box; if not, there are none in it."""
        return not self.box.is_empty

    @property
    def region(self) -> Region:
        """The parameter values for which what the box promises is so, as far as polyhedra were found."""
        region = Region.union_of(self.plan.names, [Polyhedron.of_box(self.plan.names, self.plan.declared_box)])
        for combination in self.combinations:
            region = region.intersection(Region.union_of(self.plan.names, combination.polyhedra))
        return region


class UnionBadSet:
    """The parameter values that are outside the bounds, or in no polyhedron of some combination."""

    def __init__(self, parameters: Sequence[Parameter], alternatives: Sequence[Combination]) -> None:
        self._names = tuple(parameter.name for parameter in parameters)
        sides = Box.declared(parameters).constraints()
        self._bounds = [Polyhedron(self._names, tuple(side.negation())) for side in sides]
        self._alternatives = alternatives
        self.stops = {bound: TeamStop(ALWAYS, None, declared=True) for bound in self._bounds}
        """Why each bad piece is bad."""
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
                side: (constraint, piece.because.get(constraint, ()))
                for constraint in piece.polyhedron.constraints
                for side in constraint.negation()
                if side.evaluate(point)
            }
            if not broken.keys() & chosen.keys():
                side = next(iter(broken))
                chosen[side] = broken[side]
        bad = Polyhedron(self._names, tuple(chosen))
        self.stops.setdefault(bad, TeamStop(combination.choices, None))
        self._sides.setdefault(bad, tuple(chosen.values()))
        return bad

    def stop(self, bad: Polyhedron, face: Face, box: Box) -> TeamStop:
        """Why a box ends at a bad piece, by the inequality that holds the face back: the whole box satisfies it."""
        stop = self.stops[bad]
        name, side = face
        towards = [
            (constraint, statements)
            for constraint, statements in self._sides.get(bad, ())
            if any(known == name and factor * side.sign > 0 for known, factor in constraint.coefficients)
        ]
        for constraint, statements in towards:
            if all(not Polyhedron(self._names, (beyond,)).meets(box) for beyond in constraint.negation()):
                return TeamStop(stop.choices, constraint, statements)
        return TeamStop(stop.choices, *towards[0]) if towards else stop


@dataclass
class TeamEnvelopeSearch(Searching[TeamEnvelope]):
    """Finds a box of parameter values around the nominal ones.

    Args:
        plan: the plan with its parameters.
        assume: choices that are made already.
        for_all: choices of which every combination of values must lead to a correct execution.
        waiting: whether what they will be becomes known only when they are made.

    Raises:
        InputError: if a choice is unknown, or assumed and asked about for all values.
    """

    plan: ParametricPlan
    _: KW_ONLY
    assume: Guard = ALWAYS
    for_all: Sequence[str] = ()
    waiting: bool = False
    solver: str = "z3"
    deadline: Deadline = NEVER
    on_stage: Announce = unheard

    def __post_init__(self) -> None:
        super().__init__()
        names = checked_choices(self.plan, self.for_all, "for_all")
        for variable, value in sorted(self.assume):
            if variable in names:
                message = f"found {variable!r}, which is assumed to be {value}, expected a choice that is not assumed"
                raise InputError(message, Location("for_all"))
        self._known = TeamEnvelope(self.plan, self.assume, names, self.waiting, Box.nothing(self.plan.declared))
        self._bad = UnionBadSet(self.plan.declared, ())

    def _search(self) -> None:
        """Find a box; whenever that is ended, what is promised holds for all values in the best one by then."""
        known, remaining = self._known, self.deadline.remaining
        known.combinations = self._alternatives(Deadline.after(None if remaining is None else remaining * ENUMERATING))
        self._bad = UnionBadSet(known.plan.declared, known.combinations)
        if self._is_inside():
            self.on_stage("widening")
            self._widen()

    def _result(self, status: Status, reason: str | None = None) -> TeamEnvelope:
        known = self._known
        if status is not Status.COMPLETE:
            known.status, known.reason = status, reason
        known.seconds, known.boxes = self._seconds(), self._bad.checks
        return known

    # -- polyhedra -----------------------------------------------------------------------------------------------------

    def _alternatives(self, deadline: Deadline) -> tuple[Combination, ...]:
        """The combinations in all of which the box must be, as far as they are found in time."""
        known = self._known
        self.on_stage("choices and polyhedra")
        good = self._enumerated(pieces.question(known.plan, known.for_all, known.assume), deadline)
        alternatives = tuple(pieces.combinations(good, known.plan.plan.network.domains))
        if not known.waiting or len(alternatives) < 2 or not all(alternative.pieces for alternative in alternatives):
            return alternatives
        self.on_stage("waiting")
        asked = pieces.waiting_question(known.plan, [alternative.choices for alternative in alternatives], known.assume)
        return (Combination(ALWAYS, tuple(self._enumerated(asked, deadline))),)

    def _enumerated(self, asked: pieces.ParametricQuestion, deadline: Deadline) -> list[GoodPiece]:
        """All good pieces, or those that are found in time and before a solver fails."""
        known = self._known
        search = pieces.GoodPieces(asked, known.plan.declared, solver=self.solver)
        try:
            for number, _ in enumerate(search.search(deadline), 1):
                self.on_stage(f"polyhedra: {number}")
        except OutOfTimeError as stopped:
            known.status, known.reason = stopped_as(stopped)
        known.queries += search.queries
        return search.found

    def _is_inside(self) -> bool:
        """Whether the nominal values are; if not, what is broken is noted."""
        known, nominal = self._known, self._known.plan.nominal
        broken = next((combination for combination in known.combinations if not combination.allows(nominal)), None)
        if broken is None:
            known.box = Box.nominal(known.plan.declared)
            return True
        if known.status is Status.COMPLETE:
            known.status = Status.INVALID
        known.broken, known.possible = broken.choices, bool(broken.pieces)
        known.needed = _fewest_broken(broken.polyhedra, nominal) if broken.pieces else ()
        return False

    # -- boxes ---------------------------------------------------------------------------------------------------------

    def _widen(self) -> None:
        known, parameters = self._known, self._known.plan.declared
        bad_pieces: list[Polyhedron] = []
        Widening(
            bad=self._bad,
            parameters=parameters,
            pieces=bad_pieces,
            groups=[faces_of(parameters)],
            deadline=self.deadline,
            on_box=self._keep,
        ).run()
        for face in faces_of(parameters):
            end = known.box[face[0]].end(face[1])
            if end is not None:
                known.stops[face] = self._stop(face, end, bad_pieces)

    def _keep(self, box: Box) -> None:
        self._known.box = box

    def _stop(self, face: Face, end: Fraction, bad_pieces: Sequence[Polyhedron]) -> TeamStop:
        box = self._known.box
        touched = list(touching(bad_pieces, box, face))
        if not touched:
            beyond = self._bad.piece_in(box.moved(face, end + face[1].sign * JUST), self.deadline)
            touched = [] if beyond is None else [beyond]
        stops = (self._bad.stop(bad, face, box) for bad in touched)
        stop = min(stops, key=lambda each: (not each.declared, len(each.statements)), default=TeamStop(ALWAYS, None))
        # Its own bounds hold a face back if all statements are about what the parameter is about.
        parameter = next(parameter for parameter in self._known.plan.parameters if parameter.name == face[0])
        places = {each.place if isinstance(each, pieces.BoundStatement) else None for each in stop.statements}
        return replace(stop, own=len(places) == 1 and places <= set(parameter.places))


def _fewest_broken(polyhedra: Sequence[Polyhedron], values: Point) -> tuple[LinearConstraint, ...]:
    """What the values break, of the polyhedron of which they break fewest inequalities, and by least."""

    def cost(broken: tuple[LinearConstraint, ...]) -> tuple[int, Fraction]:
        return len(broken), sum((constraint.value(values) - constraint.constant for constraint in broken), Fraction(0))

    return min((tuple(side for side in one.constraints if not side.evaluate(values)) for one in polyhedra), key=cost)
