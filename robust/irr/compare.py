"""Every method on one plan: the exact envelope and the boxes, how much of it they cover, and what stops them."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, replace
from fractions import Fraction
from functools import partial
from operator import itemgetter

from robust.encode import create_encoding, interface
from robust.errors import UnsupportedError
from robust.irr import check, stops, widen
from robust.irr.corners import with_inner
from robust.irr.exact import BoxMethod
from robust.irr.proposals import tolerance
from robust.irr.questions import CheckQuestion, Manner
from robust.irr.search import EnvelopeResult
from robust.irr.slices import EnvelopeRegion
from robust.plan.model import ParametrizedPlan
from robust.presented import Presented
from robust.qe import compute, estimate, lifted
from robust.qe.box import Box, Face, Growing, Side
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.searching import DECIDED, Searching, Status
from robust.smt.limits import Deadline, OutOfTimeError

Values = dict[str, Fraction]

METHODS = ("irr", "widen", "optimal", "optimal-nominal")
"""The boxes of a comparison; the last is the optimal one around the nominal point."""
METHODS_OF_RATES = ("irr", "widen")
"""Those of plans in which rates multiply times that vary."""
EXACT_DIMENSION = 3
"""Parameters up to which volumes are exact."""
CELLS = 300
"""Boxes from which volumes are bounded otherwise."""
MANY = 60
"""Polyhedra up to which a region is taken apart for its exact volume and bounding box."""


@dataclass(frozen=True, slots=True)
class RatioBounds:
    """A ratio that is at least `lower` and at most `upper` (None: no bound is known); exact if both are the same."""

    lower: Fraction
    upper: Fraction | None

    @property
    def is_exact(self) -> bool:
        return self.lower == self.upper


@dataclass(frozen=True, slots=True)
class FaceWitness:
    """A point just outside a face at which the plan is refuted, and the obligation (or contradiction) that breaks."""

    values: dict[str, Fraction]
    obligation: str


@dataclass(frozen=True, slots=True)
class FaceGap:
    """How far one finite face could move outwards alone; None without limit.

    If the region is not complete the gap is an upper bound. Beyond `end` by the gap, `witness` breaks an obligation;
    None where there is nothing that breaks, or no time was left to confirm it.
    """

    parameter: str
    side: Side
    end: Fraction
    closed: bool
    gap: Fraction | None
    witness: FaceWitness | None


@dataclass(frozen=True)
class Entry:
    """One box: volume as a share of the region's, total width as a share of that of the region's bounding box."""

    method: str
    result: EnvelopeResult
    volume_share: RatioBounds | None = None
    width_share: RatioBounds | None = None
    faces: tuple[FaceGap, ...] = ()


@dataclass(frozen=True)
class Comparison(Presented, ask="status"):
    """What was found; stages that time ran out for are missing or have a status of their own.

    `volume` is the region's, with an upper bound None where it may be infinite.
    """

    plan: ParametrizedPlan
    beta: Fraction
    region: compute.RegionResult | None
    volume: estimate.VolumeBounds | None
    entries: tuple[Entry, ...]
    interrupted: bool
    seconds: float

    @property
    def status(self) -> Status:
        """COMPLETE if every stage is; else the worst of them."""
        stages = {entry.result.status for entry in self.entries}
        if self.region is not None:
            stages.add(self.region.status)
        if self.interrupted:
            stages.add(Status.INTERRUPTED)
        asked = METHODS if self.region is None or not self.region.sliced else METHODS_OF_RATES
        if self.region is None or len(self.entries) < len(asked):
            stages.add(Status.TIMEOUT)
        worst_first = Status.INTERRUPTED, Status.UNKNOWN, Status.TIMEOUT, Status.INVALID
        return next((status for status in worst_first if status in stages), Status.COMPLETE)

    @property
    def cut_short(self) -> bool:
        """Whether something ended it before it was done."""
        return self.status not in DECIDED


@dataclass(eq=False)
class Comparing(Searching[Comparison]):
    """One comparison.

    Args:
        plan: the plan.
        beta: the precision of IRR.
        doubling: whether IRR doubles its steps, as in its published runs.
        epsilon: the separation of mutex time points.
        encoding: `relational` or `positions`.
        solver: `z3` or `cvc5`.
        timeout: seconds for all stages: the region comes first and may use half of them, each of the others an equal
            part of what is left then.
        on_stage: called with the name of each stage that begins.
    """

    plan: ParametrizedPlan
    _: KW_ONLY
    beta: Fraction = Fraction(1)
    doubling: bool = False
    epsilon: Fraction = interface.EPSILON
    encoding: str = "relational"
    solver: str = "z3"
    timeout: float | None = None
    on_stage: Callable[[str], None] | None = None

    def __post_init__(self) -> None:
        super().__init__()
        self._region: compute.RegionResult | None = None
        self._volume: estimate.VolumeBounds | None = None
        self._entries: dict[str, Entry] = {}
        self._interrupted = False

    def _search(self) -> None:
        """Compare.

        Raises:
            InputError: wrong options, or a network without any schedule.
            UnsupportedError: an expression that is not linear.
        """
        # The region can take any time, so that it comes last; but of a time that is limited a box may take more than
        # its part, as far as its solver does not heed the limit, and the region is what all else is measured by.
        stages = (*METHODS, "region") if self.timeout is None else ("region", *METHODS)
        for number, stage in enumerate(stages):
            limit = self._begin(stage, Fraction(1, 2 if stage == "region" else len(METHODS) + 2 - number))
            if stage == "region":
                search = compute.RegionSearch(
                    self.plan, epsilon=self.epsilon, solver=self.solver, encoding=self.encoding, timeout=limit
                )
                self._region = EnvelopeRegion(search).run()
                self._interrupted = self._region.status is Status.INTERRUPTED
            else:
                self._find_box(stage, limit)
            if self._interrupted:
                return
        if self._region is not None:
            self._measure(self._region, Deadline.after(self._begin("faces and witnesses", Fraction(1))))

    def _find_box(self, method: str, limit: float | None) -> None:
        deadline = Deadline.after(limit)
        try:
            encoding = create_encoding(self.encoding, self.plan, self.epsilon, deadline)
        except OutOfTimeError:
            return  # not even encoded: there is no box
        name, _, around = method.partition("-")
        box_method = BoxMethod(name, self.beta, doubling=self.doubling, contain_nominal=bool(around))
        try:
            search = box_method.search(encoding, solver=self.solver, deadline=deadline)
            result = search.run()
        except UnsupportedError:
            if method in METHODS_OF_RATES:
                raise
            return
        result = with_inner(result, search.questions, deadline)
        if method == "widen" and result.verified and not result.cut_short:
            with suppress(OutOfTimeError):
                known = tolerance(self.plan, self.epsilon, deadline, self.solver, result.box)
                result = replace(result, tolerance=known)
        self._entries[method] = Entry(method, result)
        self._interrupted = result.status is Status.INTERRUPTED

    def _result(self, status: Status, reason: str | None = None) -> Comparison:
        return Comparison(
            self.plan,
            self.beta,
            self._region,
            self._volume,
            tuple(self._entries.values()),
            self._interrupted or status is Status.INTERRUPTED,
            self._seconds(),
        )

    def _begin(self, stage: str, share: Fraction) -> float | None:
        """The seconds that the stage may take, a share of what is left."""
        if self.on_stage is not None:
            self.on_stage(stage)
        if self.timeout is None:
            return None
        return max(1e-3, (self.timeout - self._seconds()) * float(share))

    # -- measures ----------------------------------------------------------------------------------------------------

    def _measure(self, result: compute.RegionResult, deadline: Deadline) -> None:
        region = result.region
        bad_for: Callable[[Box, Face, Fraction], Sequence[Polyhedron]]
        if isinstance(region, lifted.LiftedRegion):
            self._volume = estimate.VolumeBounds(Fraction(0), None)
            extents = {name: extent for name in region.parameters if (extent := region.extent(name)) is not None}
            width = Box(extents).total_width
            bad_for = partial(sides_beyond, region)
        else:
            short = region.short_union(MANY)
            self._volume = volume_of(region, short)
            if result.sliced:
                proved = result.inner()
                self._volume = replace(self._volume, lower=volume_of(proved, proved).lower)
            width = bounding_width(short)
            pieces = region.complement().as_union().pieces
            bad_for = lambda *_: pieces  # noqa: E731 - one of two
        formulas = create_encoding(self.encoding, self.plan, self.epsilon, deadline)
        confirm = partial(self._witness, encoding=None if result.sliced else formulas, deadline=deadline)
        for method, entry in self._entries.items():
            if not entry.result.verified:
                continue
            box = entry.result.box
            self._entries[method] = Entry(
                method,
                entry.result,
                volume_share(box, self._volume, exact=result.is_exact or result.sliced),
                width_share(box, width, exact=result.is_exact),
                tuple(
                    _nearer(
                        _known_gap(entry.result, (name, side), end),
                        face_gap(box, (name, side), end, bad_for(box, (name, side), end), confirm),
                    )
                    for name, side in widen.faces_of(self.plan.parameters)
                    if (end := box[name].end(side)) is not None
                ),
            )

    def _witness(self, values: Values, encoding: interface.Encoding | None, deadline: Deadline) -> FaceWitness | None:
        """The point with what breaks there; None if there is no time to confirm it."""
        asked: Searching[check.CheckResult] | CheckQuestion
        if encoding is None:  # products of parameters are none at a point
            manner = Manner(encoding=self.encoding, solver=self.solver, epsilon=self.epsilon, deadline=deadline)
            asked = CheckQuestion(self.plan, manner, Box.point(values))
        else:
            asked = check.Checker(encoding, Box.point(values), solver=self.solver, deadline=deadline)
        try:
            result = asked.run()
        except OutOfTimeError:
            return None
        if result.interrupted:
            raise KeyboardInterrupt
        match result.answer:
            case check.Answer.REFUTED:
                broken = [name for name, answer in result.obligations.items() if answer is check.Answer.REFUTED]
                return FaceWitness(values, broken[0] if broken else result.reason or "no schedule")
            case check.Answer.UNKNOWN:
                return None
            case check.Answer.PROVED:
                raise ValueError(f"the plan is valid at {values}, which the region excludes")


def _known_gap(result: EnvelopeResult, face: Face, end: Fraction) -> FaceGap | None:
    """What a search that decides at corners of rates has executed beyond a face, if anything."""
    name, side = face
    for point in () if result.inner is None else result.inner.outer:
        if (point.parameter, point.side) == face and (shown := point.counterexample) is not None:
            witness = FaceWitness(dict(shown.parameters), shown.obligation)
            return FaceGap(name, side, end, result.box[name].is_closed_at(side), point.gap, witness)
    return None


def _nearer(known: FaceGap | None, found: FaceGap) -> FaceGap:
    """The lesser of two upper bounds of a gap."""
    if known is None or known.gap is None or (found.gap is not None and found.gap < known.gap):
        return found
    return known


def face_gap(
    box: Box, face: Face, end: Fraction, bad: Sequence[Polyhedron], confirm: Callable[[Values], FaceWitness | None]
) -> FaceGap:
    """How far the face could move, and a point beyond that the box would hold if it were moved a little more."""
    name, side = face
    growing = Growing(box, {face: (end, Fraction(1))})
    met = ((widen.least_stretch(piece, growing), piece) for piece in bad)
    nearest = min(((least.value, piece) for least, piece in met if least is not None), key=itemgetter(0), default=None)
    if nearest is None:
        return FaceGap(name, side, end, box[name].is_closed_at(side), None, None)
    gap, piece = nearest
    moved = box.moved(face, end + side.sign * (gap + stops.JUST))
    point = piece.restricted(moved.constraints()).some_point()
    if point is None:
        raise ValueError("the piece is met within the gap")
    return FaceGap(name, side, end, box[name].is_closed_at(side), gap, confirm(point))


def sides_beyond(region: lifted.LiftedRegion, box: Box, face: Face, end: Fraction) -> Sequence[Polyhedron]:
    """Half-spaces outside of a region that tell how far a face of a box inside may move from where it ends.

    Raises:
        UnsupportedError: if it takes all inequalities of the region, which are too many.
    """
    side = face[1]
    growing = Growing(box, {face: (end, Fraction(1))})
    while True:
        sides = region.known_sides()
        met = (widen.least_stretch(piece, growing) for piece in sides)
        gap = min((least.value for least in met if least is not None), default=None)
        moved = box.moved(face, None if gap is None else end + side.sign * gap)
        if region.contains_box(moved):
            return sides
        if len(region.known_sides()) == len(sides):
            return [*sides, *region.base.complement()] if gap is None else sides


def volume_of(region: Region, short: Region | None) -> estimate.VolumeBounds:
    """The volume of the region, exactly for few parameters and polyhedra."""
    if short is not None and len(region.parameters) <= EXACT_DIMENSION:
        volume = short.volume()
        return estimate.VolumeBounds(Fraction(0) if volume is None else volume, volume)
    return region.volume_bounds(boxes=CELLS)


def bounding_width(short: Region | None) -> Fraction | None:
    """The total width of the region's bounding box; None if not finite or not known."""
    cell = None if short is None or not short.pieces else estimate.bounding_cell(short.pieces)
    return None if cell is None else sum((upper - lower for _, lower, upper in cell), Fraction(0))


def volume_share(box: Box, volume: estimate.VolumeBounds, *, exact: bool) -> RatioBounds | None:
    """Volume of the box as a share of the region's; None where there is no finite one, or the region has no inside.

    Of an outer bound only the lower end counts: the envelope may be smaller.
    """
    size = box.volume
    if size is None or not box.intervals or volume.upper is None or not volume.upper:
        return None
    # The box is inside, so that the region is at least as large.
    least = max(volume.lower, size)
    lower = size / volume.upper
    return RatioBounds(lower, size / least if exact and least else None)


def width_share(box: Box, width: Fraction | None, *, exact: bool) -> RatioBounds | None:
    """Total width of the box as a share of that of the region's bounding box; None where there is no finite one."""
    size = box.total_width
    if size is None or not width:
        return None
    return RatioBounds(size / width, size / width if exact else None)
