"""The probability that a plan succeeds when its parameters are random, from below and from above.

A run with parameter values in the envelope succeeds, whatever schedule its network allows; any other counts as failed,
also if only some schedules fail, and if a parameter is outside of its declared bounds. With few parameters the
envelope is computed, or bounds of it, and its probability by subdivision. With many that are all durations, laws of
longest paths bound the probability, and random draws say what is late. Where there is more to the plan than that, boxes
found by widening bound the probability from below, and random points estimate it.

Each failing value is counted for the first thing that goes wrong with it. First come declared bounds, then demands on
durations, then whether there is a schedule at all, then every other obligation in the order in which they are examined:
the same values may break several, but are counted once, so that shares add up. What breaks an obligation is enumerated
apart from what breaks those before it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, field
from fractions import Fraction

from robust.encode import create_encoding, interface
from robust.errors import InputError, UnsupportedError
from robust.irr import exact, proposals, slices, widen
from robust.irr.search import EnvelopeResult
from robust.network.slack import OutsideFragmentError
from robust.plan.model import ParametrizedPlan
from robust.presented import Presented, VerdictEnum
from robust.probability.distributions import Distribution
from robust.probability.measure import Bounds, Measure, RegionMeasure, SuccessProbabilities, box_probability
from robust.probability.packing import LatenessDraws, Packing, Points, SampledEstimate
from robust.probability.sharing import Joint, SharedFactor, shared_range
from robust.qe import compute, lifted
from robust.qe.box import Box, Interval
from robust.qe.conjunctions import Conjunction
from robust.qe.polyhedron import Polyhedron
from robust.searching import Searching, Status
from robust.smt.limits import Deadline, OutOfTimeError

METHODS = ("irr", "widen", "optimal")
"""The methods whose boxes are compared by their probability."""
MANY = 6
"""Parameters from which on no stage may take longer than `EFFORT`, and random points are drawn."""
FEW = 4
"""Parameters up to which the envelope is computed first, whatever the plan is like."""
EFFORT = 30.0
"""Seconds of a stage, with many parameters."""
FINER = 10
"""How much closer bounds of shares are to be."""
TICK = 0.5
"""Seconds between two looks at bounds that are being computed."""
FINE_SLICES = 40
"""Slices of rates, where these multiply times that vary."""
DRAWS = 10_000
"""Random points of an estimate."""
DECLARED = "declared bounds"
NO_SCHEDULE = "no schedule"
NOTHING = Bounds(Fraction(0), Fraction(0))


class RiskStatus(VerdictEnum):
    """How a search ended: COMPLETE if the bounds are as close as was asked; WIDE if they are not, although nothing
    ended it, because there are too many parameters, or some multiply times that vary."""

    COMPLETE = "complete"
    WIDE = "wide"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class BlameShare:
    """How much of the probability an obligation takes, by its name, as the first that breaks."""

    name: str
    probability: Bounds


@dataclass(frozen=True)
class Kept:
    """A box, and how probable it is."""

    method: str
    result: EnvelopeResult
    probability: Bounds


@dataclass(frozen=True)
class RiskResult(Presented, ask="probability"):
    """The probability of success, and what it consists of.

    `shares` are of failing values, by what breaks first; None before that is known. `disjoint` are boxes that together
    bound the probability from below, `estimate` is one by random points: both only where bounds were not close
    without. `region` is what was measured. `reason` says which failure of a solver ended a search that is UNKNOWN.
    `probabilities` and `late` are known where longest paths decide about the plan, the first also where all values
    succeed. `distributions` are those of
    parameters before `factors` scale or shift them; `joints` are normal ones with other covariances.
    """

    status: RiskStatus
    plan: ParametrizedPlan
    distributions: Mapping[str, Distribution]
    within: Fraction
    probability: Bounds
    region: compute.RegionResult | None
    kept: tuple[Kept, ...]
    shares: tuple[BlameShare, ...] | None
    disjoint: tuple[Box, ...]
    estimate: SampledEstimate | None
    cells: int
    seconds: float
    reason: str | None = None
    probabilities: SuccessProbabilities | None = None
    late: LatenessDraws | None = None
    factors: tuple[SharedFactor, ...] = ()
    joints: tuple[Joint, ...] = ()

    @property
    def cut_short(self) -> bool:
        """Whether something ended the search before it was done."""
        return self.status is not RiskStatus.COMPLETE

    @property
    def best(self) -> Kept | None:
        """The most probable of the boxes that were compared."""
        return max(self.kept, key=lambda kept: kept.probability.lower, default=None)


@dataclass(eq=False)
class Risk(Searching[RiskResult]):
    """One search for the probability of success.

    Args:
        plan: the plan.
        distributions: of its parameters, by themselves.
        factors: what parameters share.
        joints: jointly normal parameters, whose covariances are no factors.
        within: how close the bounds are to be.
        draws: how many random points are drawn where bounds are not close; if not given, only with many parameters.
        epsilon: the separation of mutex time points.
        encoding: `relational` or `positions`.
        solver: `z3` or `cvc5`.
        timeout: seconds after which what is known is returned.
        on_bounds: called with the bounds when they have changed.
        on_stage: called with the name of each stage that begins.
        serving: what executors and fixed schedules can do in a box for whose values the plan is proved; asked where
            longest paths do not decide.

    Raises:
        InputError: if a parameter has no distribution, or one is of no parameter.
    """

    plan: ParametrizedPlan
    distributions: Mapping[str, Distribution]
    _: KW_ONLY
    factors: Sequence[SharedFactor] = ()
    joints: Sequence[Joint] = ()
    within: Fraction = Fraction(1, 1000)
    draws: int | None = None
    epsilon: Fraction = interface.EPSILON
    encoding: str = "relational"
    solver: str = "z3"
    timeout: float | None = None
    on_bounds: Callable[[Bounds], None] | None = None
    on_stage: Callable[[str], None] | None = None
    serving: Callable[[Box, Deadline], SuccessProbabilities] | None = None

    def __post_init__(self) -> None:
        super().__init__()
        names = [parameter.name for parameter in self.plan.parameters]
        missing = [name for name in names if name not in self.distributions]
        if missing:
            raise InputError(f"found no distribution of parameter {missing[0]!r}, expected one of each parameter")
        self._distributions = {name: self.distributions[name] for name in names}
        self._many = len(names) > MANY
        self._deadline = Deadline.after(self.timeout)
        self._on_stage = self.on_stage or (lambda _: None)
        self._region: compute.RegionResult | None = None
        self._bounds = Bounds(Fraction(0), Fraction(1))
        self._cells = 0
        self._kept: list[Kept] = []
        self._attribution: Attribution | None = None
        self._packing: Packing | None = None
        self._points: Points | None = None
        self._probabilities: SuccessProbabilities | None = None
        self._late: LatenessDraws | None = None

    def _result(self, status: Status, reason: str | None = None) -> RiskResult:
        ended = RiskStatus(status.value)
        if status is Status.COMPLETE and self._bounds.width > self.within:
            # With few parameters only the time that a stage may take can have ended it early, or slices of rates.
            wide = self._many or (self._region is not None and self._region.sliced)
            ended = RiskStatus.WIDE if wide else RiskStatus.TIMEOUT
        failing = 1 - self._bounds.lower
        return RiskResult(
            ended,
            self.plan,
            self._distributions,
            self.within,
            self._bounds,
            self._region,
            tuple(self._kept),
            None if self._attribution is None else self._attribution.shares(failing),
            () if self._packing is None else tuple(self._packing.boxes),
            self._estimate,
            self._cells,
            self._seconds(),
            reason,
            self._probabilities,
            self._late,
            tuple(self.factors),
            tuple(self.joints),
        )

    @property
    def _estimate(self) -> SampledEstimate | None:
        if self._late is not None:
            return SampledEstimate.of(self._late.successes, self._late.draws)
        return None if self._points is None else self._points.estimate

    # -- stages --------------------------------------------------------------------------------------------------------

    def _search(self) -> None:
        """All stages.

        Raises:
            UnsupportedError: an expression that is not linear.
            SolverError: a solver is not installed.
        """
        if len(self._distributions) > FEW or self.factors or self.joints:
            supports = self._supports()
            if certain := self._is_certain(supports):
                self._know(Fraction(1), Fraction(1))
            if self._by_longest_paths(certain=certain):
                return
            if certain:
                if self.serving is not None:
                    self._on_stage("executors")
                    self._probabilities = self.serving(supports, self._deadline)
                return
        if self.factors or self.joints:
            raise UnsupportedError(
                "found durations that depend on each other in a plan in which more than the lengths "
                "of chains of actions decides about success, expected independent ones"
            )
        self._on_stage("envelope")
        search = compute.RegionSearch(
            self.plan,
            epsilon=self.epsilon,
            encoding=self.encoding,
            solver=self.solver,
            timeout=self._share(Fraction(1, 3)),
        )
        self._region = region = slices.EnvelopeRegion(search, importance=self._important, most=FINE_SLICES).run()
        if region.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        self._on_stage("probability")
        if not isinstance(region.region, lifted.LiftedRegion):
            self._measure(region)
        self._on_stage("boxes")
        methods = [name for name in METHODS if name != "optimal" or not region.sliced]
        for method in methods if self._bounds.upper else ():
            self._keep(method)
        if region.sliced:
            return
        self._on_stage("what fails")
        self._attribute()
        if self.draws or (self._many and self._bounds.width > self.within):
            self._go_without_region(region)
        self._deadline.enforce()

    def _important(self, known: slices.RateSlice) -> Fraction:
        """About how probable it is that values are between the bounds of a slice."""
        rates = {name: self._distributions[name] for name in known.rates}
        return box_probability(known.rates, rates).upper * known.share

    def _supports(self) -> Box:
        """All values that can be drawn."""

        def support(known: Distribution) -> Interval:
            return Interval(*known.support)

        return Box(
            {name: shared_range(self.factors, support(own), name, support) for name, own in self._distributions.items()}
        )

    def _is_certain(self, supports: Box) -> bool:
        """Whether the plan is proved for all values that can be drawn: the cheap question first."""
        self._on_stage("all values at once")
        deadline = Deadline.after(self._share(Fraction(1, 10)))
        try:
            return proposals.is_inside(self.plan, supports, self.epsilon, deadline, solver=self.solver)
        except OutOfTimeError:
            return False

    def _by_longest_paths(self, *, certain: bool) -> bool:
        """Whether longest paths decide about the plan, and how probably all of them are in time.

        If that is `certain`, only how probably executors and fixed schedules succeed is left to find.
        """
        from robust.probability.success import Lateness  # noqa: PLC0415 - numpy takes a tenth of a second

        self._on_stage("longest paths")
        try:
            search = Lateness(
                self.plan,
                self._distributions,
                self.epsilon,
                self._deadline,
                solver=self.solver,
                factors=self.factors,
                joints=self.joints,
                certain=certain,
            )
        except OutsideFragmentError:
            return False
        late = self._late = None if certain else search.draw(self.draws or DRAWS)

        def tell(bounds: Bounds) -> None:
            self._cells, self._probabilities = search.cells, search.probabilities
            self._know(bounds.lower, bounds.upper)

        search.run(self.within, tell)
        if late is None:
            return True
        self._on_stage("what is late")
        with _ending_early():
            search.attribute(late, self.within)
        self._late = search.draw(self.draws or DRAWS)
        return True

    def _share(self, part: Fraction) -> float | None:
        """The seconds that a stage may take."""
        remaining = self._deadline.remaining
        if remaining is not None:
            remaining *= float(part)
        if not self._many:
            return remaining
        return EFFORT if remaining is None else min(EFFORT, remaining)

    def _know(self, lower: Fraction, upper: Fraction) -> None:
        """Bounds that hold, beside those that are known."""
        self._bounds = self._bounds.within(Bounds(lower, upper))
        if self.on_bounds is not None:
            self.on_bounds(self._bounds)

    def _measure(self, region: compute.RegionResult) -> None:
        """The probability of the envelope, or of what is known to hold it and what is known to be in it."""
        outer = region.region.as_difference()
        whole = RegionMeasure(outer.base or Polyhedron.universe(outer.parameters), outer.pieces, self._distributions)
        deadline = Deadline.after(self._share(Fraction(1, 2)))
        inner = None if region.is_exact else Measure(region.inner().parts(), self._distributions)
        within = self.within if inner is None else self.within / 4
        measures: list[Measure | RegionMeasure] = [whole] if inner is None else [whole, inner]

        def tell() -> None:
            self._know(measures[-1].bounds.lower, whole.bounds.upper)
            self._cells = sum(measure.cells for measure in measures)

        width = Fraction(1)
        try:
            while width > within and self._bounds.width > self.within:
                if region.sliced and width < self._bounds.width / FINER:
                    break  # what is left lies between the bounds of slices
                width = max(width / 2, within)
                for measure in measures:
                    _run_telling(measure, width, deadline, tell)
                tell()
        except OutOfTimeError:
            pass
        finally:
            tell()

    def _keep(self, method: str) -> None:
        """The box of a method, and its probability: it is inside, so that success is at least as probable."""
        if method != "optimal" and not self.plan.has_nominal:
            return
        deadline = Deadline.after(self._share(Fraction(1, 3)))
        try:
            encoding = create_encoding(self.encoding, self.plan, self.epsilon, deadline)
        except OutOfTimeError:
            return
        asked = exact.BoxMethod(method, contain_nominal=False)
        result = asked.search(encoding, solver=self.solver, deadline=deadline).run()
        if result.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if result.verified:
            probability = box_probability(result.box, self._distributions)
            self._kept.append(Kept(method, result, probability))
            self._know(probability.lower, self._bounds.upper)

    def _attribute(self) -> None:
        """Which obligation takes how much."""
        deadline = Deadline.after(self._share(Fraction(1, 2)))
        self._attribution = Attribution(
            self.plan, self._distributions, epsilon=self.epsilon, solver=self.solver, deadline=deadline
        )
        with _ending_early():
            self._attribution.run(self.within / FINER)

    def _go_without_region(self, region: compute.RegionResult) -> None:
        """Boxes without common points, and random points."""
        encoding = create_encoding(self.encoding, self.plan, self.epsilon, self._deadline)
        bad = widen.DiscoveredBadSet(encoding, solver=self.solver)
        if self._many:
            self._on_stage("boxes without common points")
            self._packing = Packing(bad, self.plan.parameters, self._distributions)
            with _ending_early():
                self._packing.run(Deadline.after(self._share(Fraction(1, 2))))
            self._know(self._packing.lower, self._bounds.upper)
        self._on_stage("random points")
        good = () if self._packing is None else self._packing.boxes
        known = region.region if region.is_exact else None
        self._points = Points(bad, self._distributions, good=good, region=known)
        with _ending_early():
            self._points.run(self.draws or DRAWS, Deadline.after(self._share(Fraction(9, 10))))


@contextmanager
def _ending_early() -> Iterator[None]:
    """A stage whose time may be out before it is done, but whose solver may not fail."""
    try:
        yield
    except OutOfTimeError as stopped:
        if stopped.reason is not None:
            raise


def _run_telling(
    measure: Measure | RegionMeasure, within: Fraction, deadline: Deadline, tell: Callable[[], None]
) -> None:
    """Until the bounds are close, and tell them now and then; OutOfTimeError if the deadline passes first."""
    while True:
        left = deadline.remaining
        try:
            measure.run(within, Deadline.after(TICK if left is None else min(TICK, left)))
        except OutOfTimeError:
            deadline.enforce()
            tell()
        else:
            return


# -- what takes the failing values -------------------------------------------------------------------------------------


@dataclass
class FirstBroken:
    """What breaks an obligation first: `pieces` without `earlier`; all of it, if it is `complete`."""

    name: str
    earlier: tuple[Polyhedron, ...]
    pieces: list[Polyhedron] = field(default_factory=list)
    complete: bool = False
    bounds: Bounds | None = None


@dataclass(eq=False)
class Attribution:
    """Finds the shares, obligation by obligation.

    Args:
        plan: the plan.
        distributions: of its parameters.
        epsilon: the separation of mutex time points.
        solver: `z3` or `cvc5`.
        deadline: when to stop.
    """

    plan: ParametrizedPlan
    distributions: Mapping[str, Distribution]
    _: KW_ONLY
    epsilon: Fraction
    solver: str
    deadline: Deadline

    def __post_init__(self) -> None:
        self._names = tuple(parameter.name for parameter in self.plan.parameters)
        self._within = Polyhedron(self._names, compute.declared_bounds(self.plan))
        self._broken: list[FirstBroken] = []

    def run(self, within: Fraction) -> None:
        """Enumerate, and measure.

        Raises:
            OutOfTimeError: if the deadline passes first.
            UnsupportedError: an expression that is not linear.
        """
        for cause in self._enumerated():
            parts = [(self._within.restricted(piece.constraints), cause.earlier) for piece in cause.pieces]
            measure = Measure(parts, self.distributions)
            try:
                measure.run(within, self.deadline)
            finally:
                cause.bounds = measure.bounds

    def shares(self, failing: Fraction) -> tuple[BlameShare, ...]:
        """The shares that are known, without empty ones; `failing` is the most that all take together."""
        inside = box_probability(Box.declared(self.plan.parameters), self.distributions)
        shares = {DECLARED: Bounds(1 - inside.upper, 1 - inside.lower)}
        for cause in self._broken:
            known = cause.bounds or (NOTHING if cause.complete and not cause.pieces else Bounds(Fraction(0), failing))
            upper = known.upper if cause.complete else failing
            before = shares.get(cause.name, NOTHING)
            shares[cause.name] = Bounds(before.lower + known.lower, min(failing, before.upper + upper))
        return tuple(BlameShare(name, bounds) for name, bounds in shares.items() if bounds.upper)

    def _enumerated(self) -> Iterator[FirstBroken]:
        """Each thing that can go wrong, when all about it is known."""
        causes = compute.Causes(self.plan, self.epsilon, self.solver, self.deadline)
        known = causes.outside
        for name, halves in causes.demands().items():
            yield self._found(name, halves, known)
        yield self._found(NO_SCHEDULE, causes.without_schedule(), known)
        for obligation in causes.obligations:
            yield self._found(obligation.name, causes.pieces(obligation, known), known)

    def _found(self, name: str, pieces: Iterable[Conjunction], known: list[Conjunction]) -> FirstBroken:
        cause = FirstBroken(name, tuple(piece for earlier in self._broken for piece in earlier.pieces))
        self._broken.append(cause)
        for piece in pieces:
            polyhedron = Polyhedron(self._names, piece)
            if piece not in known and not polyhedron.is_disjoint_from(self._within):
                cause.pieces.append(polyhedron)
                known.append(piece)
        cause.complete = True
        return cause
