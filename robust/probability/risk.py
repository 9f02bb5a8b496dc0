"""The probability that a plan succeeds when its parameters are random, from below and from above.

A run with parameter values in the envelope succeeds, whatever schedule its network allows; any other counts as failed,
also if only some schedules fail, and if a parameter is outside of its declared bounds. With few parameters the
envelope is computed, or bounds of it, and its probability by subdivision. With many, boxes found by widening bound the
probability from below as well, and random points estimate it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from robust.encode import create_encoding
from robust.encode.interface import EPSILON
from robust.errors import InputError
from robust.irr.containment import Containment
from robust.irr.exact import ExactSearch
from robust.irr.irr import IncrementalRobustification
from robust.irr.search import EnvelopeResult
from robust.irr.widen import DiscoveredBadSet
from robust.plan.model import ParametrizedPlan
from robust.presented import Presented, VerdictEnum
from robust.probability.blame import Attribution, Share
from robust.probability.distributions import Distribution
from robust.probability.measure import Bounds, Measure, RegionMeasure, box_probability
from robust.probability.packing import Estimate, Packing, Points
from robust.qe.box import Box
from robust.qe.compute import RegionResult, RegionSearch
from robust.qe.polyhedron import Polyhedron
from robust.searching import Searching, Status
from robust.smt.limits import Deadline, OutOfTimeError

METHODS = ("irr", "widen", "optimal")
"""The boxes whose probability is told."""
MANY = 6
"""Parameters from which on no stage may take longer than `EFFORT`, and random points are drawn."""
EFFORT = 30.0
"""Seconds of a stage, with many parameters."""
FINER = 10
"""How much closer bounds of shares are to be."""
TICK = 0.5
"""Seconds between two looks at bounds that are being computed."""
DRAWS = 10_000
"""Random points of an estimate."""


class RiskStatus(VerdictEnum):
    """How a search ended: COMPLETE if the bounds are as close as was asked; WIDE if they are not, although nothing
    ended it, because there are too many parameters."""

    COMPLETE = "complete"
    WIDE = "wide"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"
    UNKNOWN = "unknown"


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
    """

    status: RiskStatus
    plan: ParametrizedPlan
    distributions: Mapping[str, Distribution]
    within: Fraction
    probability: Bounds
    region: RegionResult | None
    kept: tuple[Kept, ...]
    shares: tuple[Share, ...] | None
    disjoint: tuple[Box, ...]
    estimate: Estimate | None
    cells: int
    seconds: float
    reason: str | None = None

    @property
    def cut_short(self) -> bool:
        """Whether something ended the search before it was done."""
        return self.status is not RiskStatus.COMPLETE

    @property
    def best(self) -> Kept | None:
        """The most probable of the boxes that were compared."""
        return max(self.kept, key=lambda one: one.probability.lower, default=None)


class Risk(Searching[RiskResult]):
    """One search for the probability of success.

    Args:
        plan: the plan.
        distributions: of its parameters, which are independent.
        within: how close the bounds are to be.
        draws: how many random points are drawn where bounds are not close; if not given, only with many parameters.
        epsilon: the separation of mutex time points.
        encoding: `relational` or `positions`.
        solver: `z3` or `cvc5`.
        timeout: seconds after which what is known is returned.
        on_bounds: called with the bounds when they have changed.
        on_stage: called with the name of each stage that begins.

    Raises:
        InputError: if a parameter has no distribution, or one is of no parameter.
    """

    def __init__(
        self,
        plan: ParametrizedPlan,
        distributions: Mapping[str, Distribution],
        *,
        within: Fraction = Fraction(1, 1000),
        draws: int | None = None,
        epsilon: Fraction = EPSILON,
        encoding: str = "relational",
        solver: str = "z3",
        timeout: float | None = None,
        on_bounds: Callable[[Bounds], None] | None = None,
        on_stage: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__()
        names = [parameter.name for parameter in plan.parameters]
        missing = [name for name in names if name not in distributions]
        if missing:
            raise InputError(f"found no distribution of parameter {missing[0]!r}, expected one of each parameter")
        self._plan = plan
        self._distributions = {name: distributions[name] for name in names}
        self._within = within
        self._many = len(names) > MANY
        self._draws = draws
        self._epsilon, self._encoding, self._solver = epsilon, encoding, solver
        self._deadline = Deadline.after(timeout)
        self._on_bounds = on_bounds or (lambda _: None)
        self._on_stage = on_stage or (lambda _: None)
        self._region: RegionResult | None = None
        self._bounds = Bounds(Fraction(0), Fraction(1))
        self._cells = 0
        self._kept: list[Kept] = []
        self._attribution: Attribution | None = None
        self._packing: Packing | None = None
        self._points: Points | None = None

    def _result(self, status: Status, reason: str | None = None) -> RiskResult:
        ended = RiskStatus(status.value)
        if status is Status.COMPLETE and self._bounds.width > self._within:
            # With few parameters only the time that a stage may take can have ended it early.
            ended = RiskStatus.WIDE if self._many else RiskStatus.TIMEOUT
        failing = 1 - self._bounds.lower
        return RiskResult(
            ended,
            self._plan,
            self._distributions,
            self._within,
            self._bounds,
            self._region,
            tuple(self._kept),
            None if self._attribution is None else self._attribution.shares(failing),
            () if self._packing is None else tuple(self._packing.boxes),
            None if self._points is None else self._points.estimate,
            self._cells,
            self._seconds(),
            reason,
        )

    # -- stages --------------------------------------------------------------------------------------------------------

    def _search(self) -> None:
        """All stages.

        Raises:
            UnsupportedError: an expression that is not linear.
            SolverError: a solver is not installed.
        """
        self._on_stage("envelope")
        search = RegionSearch(
            self._plan,
            epsilon=self._epsilon,
            encoding=self._encoding,
            solver=self._solver,
            timeout=self._share(Fraction(1, 3)),
        )
        self._region = region = search.run()
        if region.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        self._on_stage("probability")
        self._measure(region)
        self._on_stage("boxes")
        for method in METHODS if self._bounds.upper else ():
            self._keep(method)
        self._on_stage("what fails")
        self._attribute()
        if self._draws or (self._many and self._bounds.width > self._within):
            self._go_without_region(region)
        self._deadline.enforce()

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
        self._bounds = Bounds(max(lower, self._bounds.lower), min(upper, self._bounds.upper))
        self._on_bounds(self._bounds)

    def _measure(self, region: RegionResult) -> None:
        """The probability of the envelope, or of what is known to hold it and what is known to be in it."""
        outer = region.region.as_difference()
        whole = RegionMeasure(outer.base or Polyhedron.universe(outer.parameters), outer.pieces, self._distributions)
        deadline = Deadline.after(self._share(Fraction(1, 2)))
        inner = None if region.is_exact else Measure(region.inner().parts(), self._distributions)
        within = self._within if inner is None else self._within / 4
        measures: list[Measure | RegionMeasure] = [whole] if inner is None else [whole, inner]

        def tell() -> None:
            self._know(measures[-1].bounds.lower, whole.bounds.upper)
            self._cells = sum(one.cells for one in measures)

        width = Fraction(1)
        try:
            while width > within and self._bounds.width > self._within:
                width = max(width / 2, within)
                for one in measures:
                    _run_telling(one, width, deadline, tell)
                tell()
        except OutOfTimeError:
            pass
        finally:
            tell()

    def _keep(self, method: str) -> None:
        """The box of a method, and its probability: it is inside, so that success is at least as probable."""
        if method != "optimal" and not self._plan.has_nominal:
            return
        deadline = Deadline.after(self._share(Fraction(1, 3)))
        try:
            encoding = create_encoding(self._encoding, self._plan, self._epsilon, deadline)
        except OutOfTimeError:
            return
        if method == "irr":
            containment = Containment(encoding, solver=self._solver)
            found = IncrementalRobustification(containment, beta=Fraction(1), deadline=deadline).run()
        else:
            found = ExactSearch(encoding, method=method, solver=self._solver, deadline=deadline).run()
        if found.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if found.verified:
            probability = box_probability(found.box, self._distributions)
            self._kept.append(Kept(method, found, probability))
            self._know(probability.lower, self._bounds.upper)

    def _attribute(self) -> None:
        """Which obligation takes how much."""
        deadline = Deadline.after(self._share(Fraction(1, 2)))
        self._attribution = Attribution(
            self._plan, self._distributions, epsilon=self._epsilon, solver=self._solver, deadline=deadline
        )
        try:
            self._attribution.run(self._within / FINER)
        except OutOfTimeError as stopped:
            if stopped.reason is not None:
                raise

    def _go_without_region(self, region: RegionResult) -> None:
        """Boxes without common points, and random points."""
        encoding = create_encoding(self._encoding, self._plan, self._epsilon, self._deadline)
        bad = DiscoveredBadSet(encoding, solver=self._solver)
        if self._many:
            self._on_stage("boxes without common points")
            self._packing = Packing(bad, self._plan.parameters, self._distributions)
            try:
                self._packing.run(Deadline.after(self._share(Fraction(1, 2))))
            except OutOfTimeError as stopped:
                if stopped.reason is not None:
                    raise
            self._know(self._packing.lower, self._bounds.upper)
        self._on_stage("random points")
        good = () if self._packing is None else self._packing.boxes
        known = region.region if region.is_exact else None
        self._points = Points(bad, self._distributions, good=good, region=known)
        try:
            self._points.run(self._draws or DRAWS, Deadline.after(self._share(Fraction(9, 10))))
        except OutOfTimeError as stopped:
            if stopped.reason is not None:
                raise


def _run_telling(one: Measure | RegionMeasure, within: Fraction, deadline: Deadline, tell: Callable[[], None]) -> None:
    """Until the bounds are close, and tell them now and then; OutOfTimeError if the deadline passes first."""
    while True:
        left = deadline.remaining
        try:
            one.run(within, Deadline.after(TICK if left is None else min(TICK, left)))
        except OutOfTimeError:
            deadline.enforce()
            tell()
        else:
            return
