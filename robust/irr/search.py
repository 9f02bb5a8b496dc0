"""What every search for a box keeps and returns: the best box so far, how it came about, and how the search ended.

The first of the searches is Incremental Rectangular-Robustification [IRR §4, Algorithm 1], in two schedules:

* the default follows Algorithm 1 with Δ ≥ β/2 in lines 6 and 7, which gives the promised gap: no face of the final box
  can move outwards by β;
* `doubling` is the schedule of the recorded runs: a successful step doubles Δ until it is halved for the first time,
  and the run ends as soon as every Δ < β, so faces can be up to 2β away.
"""

import logging
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import cycle, product
from typing import Any, TypedDict, Unpack

from robust.errors import InputError, did_you_mean
from robust.irr import containment, templates
from robust.irr import stops as stopping
from robust.irr.check import Counterexample, require_some_schedule
from robust.irr.containment import Containment, Margins
from robust.irr.stops import APPROACHED, CUT_SHORT, NO_SCHEDULE, NOT_EXAMINED, Advice, Stop, Tolerance, advice
from robust.plan.model import Parameter, ParametrizedPlan
from robust.presented import Presented
from robust.qe.box import Box, Face, Side
from robust.searching import DECIDED, Searching, Status
from robust.smt import limits, session

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Step:
    """One containment check of a search: its number, seconds since the start, what was tried and what came of it.

    Searches that move all faces at once have no single `parameter`, `side` and `delta`.
    """

    check: int
    seconds: float
    parameter: str | None
    side: Side | None
    delta: Fraction | None
    accepted: bool
    box: Box
    """The best box after the step."""


@dataclass(frozen=True, slots=True)
class OuterPoint:
    """A point that breaks the plan, beyond one side of a box and within it in all other parameters.

    Attributes:
        gap: how far beyond that side.
        counterexample: an execution, which the simulator confirms. None: the point leaves no schedule, or there was no
            time to execute it.
    """

    parameter: str
    side: Side
    gap: Fraction
    counterexample: Counterexample | None


@dataclass(frozen=True, slots=True)
class InnerBox:
    """Of a box that is sound, but not the widest: what is known of how far it may be from that.

    Attributes:
        rates: the parameters that multiply times that vary, at whose ends the box was decided.
        outer: what is just beyond sides.
    """

    rates: tuple[str, ...]
    outer: tuple[OuterPoint, ...]


@dataclass(frozen=True)
class EnvelopeResult(Presented, ask="verified"):
    """A decoupled robustness envelope [IRR, Definition 3] and how it was found; seconds are by the clock.

    `reason` and `values` explain INVALID: what breaks at the nominal point, with which parameter values; of UNKNOWN,
    `reason` says which failure of a solver ended the search. `checks`
    counts the rectangles tried as in [IRR §5]; queries about unbounded directions are in `unbounded_checks`. The box is
    empty, and not `verified`, if no values are known to be inside: INVALID, or stopped before that was decided. `bound`
    is what no box can be wider than, where the widest one was looked for. `stops` says what ends each finite side of a
    verified box: an obligation, statements of the network, a declared bound, or why that is not known. `advice` is
    about parameters for which an action's own duration leaves no room. `doubling` and `contain_nominal` are as
    they were asked for; methods that know no other boxes always contain the nominal point. `plan` is what it is about.
    `fallback` says why shortest paths did not find the box, where that was tried and solvers had to. `tolerance` is how
    much all durations that are parameters may differ at once, where shortest paths decide it. `shape` is what else was
    asked for: around the box, and inside the envelope. `inner` says how far a box may be from the widest one where
    rates and times vary together.
    """

    status: Status
    method: str
    encoding: str
    solver: str
    beta: Fraction | None
    parameters: tuple[Parameter, ...]
    box: Box
    checks: int
    unbounded_checks: int
    first_widening_seconds: float | None
    seconds: float
    trace: tuple[Step, ...] = ()
    reason: str | None = None
    values: Mapping[str, Fraction] = field(default_factory=dict)
    bound: Fraction | None = None
    statistics: session.Statistics = field(default_factory=session.Statistics)
    stops: Mapping[Face, Stop] = field(default_factory=dict)
    advice: tuple[Advice, ...] = ()
    doubling: bool = False
    contain_nominal: bool = True
    plan: ParametrizedPlan | None = field(default=None, repr=False, compare=False)
    fallback: str | None = None
    tolerance: Tolerance | None = None
    shape: templates.Shape | None = None
    inner: InnerBox | None = None

    @property
    def cut_short(self) -> bool:
        """Whether something ended the search before it was done."""
        return self.status not in DECIDED

    @property
    def verified(self) -> bool:
        """Whether the plan is proved for all values in the box; if not, there are none in it."""
        return not self.box.is_empty

    def convergence(self) -> tuple[tuple[int, Fraction], ...]:
        """[IRR §5, Convergence]: after each check, Σ(u − l) as a share of the final one, between 0 and 1.

        Empty if a side is infinite or the final box is a point.
        """
        final = self.box.total_width
        if not final:
            return ()
        widths = ((step.check, step.box.total_width) for step in self.trace)
        return tuple((check, width / final) for check, width in widths if width is not None)


class OutsideError(Exception):
    """The nominal point is outside the envelope, or there is none; internal, reported as INVALID."""

    def __init__(self, reason: str, values: Mapping[str, Fraction]) -> None:
        super().__init__(reason)
        self.reason = reason
        self.values = values


class Conduct(TypedDict, total=False):
    """What every search for a box can be given; subclasses of :class:`BoxSearch` hand it on as it is."""

    deadline: limits.Deadline
    """When to stop with the best box so far."""
    on_step: Callable[[Step], None] | None
    """Called with each step."""


class BoxSearch(Searching[EnvelopeResult]):
    """One search from the nominal point outwards; subclasses accept boxes, record steps, and say how to search.

    Args:
        questions: what is asked of boxes.
        method: the name of the search.
        conduct: see :class:`Conduct`.
    """

    def __init__(self, questions: containment.Questions[Any], *, method: str, **conduct: Unpack[Conduct]) -> None:
        super().__init__()
        self.questions = questions
        self.encoding = encoding = questions.encoding
        self.method = method
        self.deadline = conduct.get("deadline", limits.NEVER)
        self.beta: Fraction | None = None
        self.doubling = False
        self.contain_nominal = True
        self.unbounded_checks = 0
        self.fallback: str | None = None
        self.box = Box.nominal(encoding.plan.parameters)
        self.verified = False
        self._on_step = conduct.get("on_step")
        self._first_widening: float | None = None
        self._trace: list[Step] = []
        self._stops: dict[Face, Stop] = {}
        self._outside: Mapping[str, Fraction] = {}
        """Values at which the plan breaks, if it is INVALID."""

    @property
    @abstractmethod
    def checks(self) -> int:
        """How many rectangles have been tried."""

    @property
    def bound(self) -> Fraction | None:
        """What no box can be wider than, as far as that is known."""
        return None

    def _ending(self) -> tuple[Status, str | None]:
        """All values in the box are inside the envelope, however the search ends.

        Raises:
            InputError: if the network has no schedule, whatever the parameter values.
        """
        try:
            status, reason = super()._ending()
        except OutsideError as outside:
            self._outside = outside.values
            return Status.INVALID, outside.reason
        if status is Status.COMPLETE and (margins := self._margins()):
            try:
                self._stops.update(stops_at(self.questions, self.box, margins, self.deadline))
            except (limits.OutOfTimeError, KeyboardInterrupt):
                log.info("no time was left to find out what ends all sides")  # the box is complete without
        return status, reason

    def _result(self, status: Status, reason: str | None = None) -> EnvelopeResult:
        return EnvelopeResult(
            status=status,
            method=self.method,
            encoding=self.encoding.name,
            solver=self.questions.solver,
            beta=self.beta,
            parameters=self.encoding.plan.parameters,
            box=self.box if self.verified else Box.nothing(self.encoding.plan.parameters),
            checks=self.checks,
            unbounded_checks=self.unbounded_checks,
            first_widening_seconds=self._first_widening,
            seconds=self._seconds(),
            trace=tuple(self._trace),
            reason=reason,
            values=self._outside,
            bound=self.bound,
            statistics=self.questions.statistics,
            stops=self._all_stops(status) if self.verified else {},
            advice=advice(self.encoding.plan, self.box, reason) if status in DECIDED else (),
            doubling=self.doubling,
            contain_nominal=self.contain_nominal,
            plan=self.encoding.plan,
            fallback=self.fallback,
        )

    @abstractmethod
    def _margins(self) -> containment.Margins:
        """How far beyond the sides of a complete box to look for what ends them, unless it is a declared bound."""

    def _all_stops(self, status: Status) -> dict[Face, Stop]:
        """What ends each finite side, or why that is not known."""
        unknown = NOT_EXAMINED if status is Status.COMPLETE else CUT_SHORT
        stops: dict[Face, Stop] = {}
        for parameter, side in product(self.encoding.plan.parameters, Side):
            face = parameter.name, side
            if (end := self.box[parameter.name].end(side)) is not None:
                stops[face] = stopping.declared_stop(parameter, side, end) or self._stops.get(face, unknown)
        return stops

    def _verify_nominal(self, containment: Containment) -> None:
        """Make sure that the nominal point, where the search begins, is inside.

        Raises:
            OutsideError: if it is not.
            InputError: if no parameter values leave a schedule.
        """
        refutation = containment.refute(self.box, self.deadline)
        if refutation is not None:
            if refutation.facet is not None:
                require_some_schedule(self.encoding, containment.open_session(), self.deadline)
            raise OutsideError(refutation.reason, refutation.values)
        self.verified = True

    def _accept(self, box: Box) -> None:
        """Keep a box that is inside the envelope, and better than those before it."""
        self.box = box
        if self._first_widening is None and any(interval.width != 0 for interval in box.intervals.values()):
            self._first_widening = self._seconds()

    def _record(self, check: int, *, accepted: bool, face: Face | None = None, delta: Fraction | None = None) -> None:
        """Note a step, with the face that was tried and how far where it was one."""
        name, side = face or (None, None)
        step = Step(check, self._seconds(), name, side, delta, accepted, self.box)
        self._trace.append(step)
        if self._on_step is not None:
            self._on_step(step)


def stops_at(
    questions: containment.Questions[Any], box: Box, reach: containment.Margins, deadline: limits.Deadline
) -> Iterator[tuple[Face, Stop]]:
    """What ends sides of a box within the reach; the same, whatever solvers were asked before.

    Of the network, these are all statements that contradict each other at a point; facets leave out what is rigid.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    network = questions.ended_by_network(box, reach, deadline)
    for face, facet in network.items():
        yield face, Stop(NO_SCHEDULE, () if facet is None else facet.origins)
    rest = {face: step for face, step in reach.items() if face not in network}
    for face, names in questions.ended_by(box, rest, deadline).items():
        yield face, Stop(names[0], also=names[1:]) if names else APPROACHED


STREAK = 8
"""Successes in a row in one direction after which a query asks whether it is bounded at all."""


@dataclass(slots=True)
class _Turn:
    """The state of one parameter: Δ, the sides not yet at their limit, and those of them still to be tried (Θ).

    `limits` are the declared bounds.
    """

    parameter: Parameter
    limits: Mapping[Side, Fraction | None]
    delta: Fraction
    available: list[Side]
    untried: list[Side]
    halved: bool = False
    streak: int = 0
    """Successes in a row in the direction tried last."""


class IncrementalRobustification(BoxSearch):
    """One run of IRR.

    Args:
        containment: decides boxes.
        beta: the precision β > 0, in the parameters' units.
        doubling: use the schedule of the recorded runs.
        order: the turn order of the parameters; names left out follow in the plan's order.
        conduct: see :class:`Conduct`; `on_step` is called after each check, also the failed ones.

    Raises:
        InputError: if `order` names unknown or repeated parameters.
    """

    def __init__(
        self,
        containment: Containment,
        *,
        beta: Fraction = Fraction(1),
        doubling: bool = False,
        order: Sequence[str] = (),
        **conduct: Unpack[Conduct],
    ) -> None:
        super().__init__(containment, method="irr", **conduct)
        self.beta = self._precision = beta
        self._containment = containment
        self.doubling = doubling
        self._failures: dict[Face, Fraction | None] = {}
        """Where each face was tried last, and could not be."""
        self._parameters = ordered(self.encoding.plan.parameters, order)

    @property
    def checks(self) -> int:
        return len(self._trace)

    # -- Algorithm 1 ---------------------------------------------------------------------------------------------

    def _search(self) -> None:
        self._verify_nominal(self._containment)
        turns = [self._first_turn(parameter) for parameter in self._parameters]
        least = self._precision / 2
        # The recorded runs try parameters down to β/2 as well, but end as soon as every Δ is below β.
        enough = self._precision if self.doubling else least
        for turn in cycle(turns):
            if not any(other.available and other.delta >= enough for other in turns):
                return
            if turn.available and turn.delta >= least:
                self._attempt(turn)

    def _margins(self) -> Margins:
        """The last attempt of every side that can end has failed; failures of longer steps say nothing of ends."""
        margins = {}
        for (name, side), tried in self._failures.items():
            end = self.box[name].end(side)
            if end is not None and tried is not None:
                margins[name, side] = abs(tried - end)
        return margins

    def _first_turn(self, parameter: Parameter) -> _Turn:
        """Lines 4 and 5; the default schedule has nothing to try where the nominal value is at a declared bound."""
        limits = {Side.UPPER: parameter.upper, Side.LOWER: parameter.lower}
        if self.doubling:
            sides, delta = list(limits), max(parameter.nominal, Fraction(1)) * parameter.weight
        else:
            sides = [side for side, limit in limits.items() if limit != parameter.nominal]
            delta = max(parameter.nominal * parameter.weight, self._precision)
        return _Turn(parameter, limits, delta, sides, list(sides))

    def _attempt(self, turn: _Turn) -> None:
        """Lines 7 to 16 for one parameter: try one side, keep the wider box or note the failure."""
        name, side = turn.parameter.name, turn.untried[0]
        candidate = self._grown(turn, side)
        refutation = self._containment.refute(candidate, self.deadline)
        accepted = refutation is None
        if refutation is None:
            self._accept(candidate)
            self._note_success(turn, side)
        else:
            self._failures[name, side] = candidate[name].end(side)
        number = self.checks + 1
        self._record(number, accepted=accepted, face=(name, side), delta=turn.delta)
        log.info("check %d: %s %s %s", number, name, side.value, "grown" if accepted else "blocked")
        if accepted:
            self._look_for_the_limit(turn, side)
        else:
            turn.streak = 0
            turn.untried.remove(side)
            self._reopen_if_exhausted(turn)

    def _grown(self, turn: _Turn, side: Side) -> Box:
        """Line 10; the default schedule steps exactly onto a declared bound instead of over it."""
        name, limit = turn.parameter.name, turn.limits[side]
        end = self.box[name].end(side)
        if end is None:
            raise ValueError("a side that is unbounded is not tried again")
        moved = end + side.sign * turn.delta
        if limit is not None and not self.doubling and side.sign * moved > side.sign * limit:
            moved = limit
        return self.box.moved((name, side), moved)

    def _note_success(self, turn: _Turn, side: Side) -> None:
        turn.streak += 1
        if self.doubling:
            if not turn.halved:
                turn.delta *= 2
            return
        # Take turns between the sides as well.
        turn.untried.append(turn.untried.pop(0))
        if self.box[turn.parameter.name].end(side) == turn.limits[side]:
            self._close(turn, side)

    def _close(self, turn: _Turn, side: Side) -> None:
        """The side is at its limit for good."""
        turn.streak = 0
        turn.available.remove(side)
        turn.untried.remove(side)
        if turn.available:
            self._reopen_if_exhausted(turn)

    def _reopen_if_exhausted(self, turn: _Turn) -> None:
        """Lines 15 and 16."""
        if not turn.untried:
            turn.delta /= 2
            turn.halved = True
            turn.untried = list(turn.available)

    def _look_for_the_limit(self, turn: _Turn, side: Side) -> None:
        """Guarantee termination where the envelope is unbounded: one query settles a direction that keeps growing."""
        if turn.streak == 0 or turn.streak % STREAK or side not in turn.available:
            return
        candidate = self.box.moved((turn.parameter.name, side), turn.limits[side])
        self.unbounded_checks += 1
        if self._containment.contains(candidate, self.deadline):
            self._accept(candidate)
            self._close(turn, side)


def ordered(parameters: Sequence[Parameter], order: Sequence[str]) -> list[Parameter]:
    """The parameters in an order; names left out follow in the plan's order.

    Raises:
        InputError: if the order names unknown or repeated parameters.
    """
    known = {parameter.name: parameter for parameter in parameters}
    for name in order:
        if name not in known:
            raise InputError(f"the order names unknown parameter {name!r}{did_you_mean(name, known)}")
        if order.count(name) > 1:
            raise InputError(f"the order names parameter {name!r} more than once; expected each at most once")
    return [*(known[name] for name in order), *(known[name] for name in known if name not in order)]
