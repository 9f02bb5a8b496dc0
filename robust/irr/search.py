"""What every search for a box keeps and returns: the best box so far, how it came about, and how the search ended."""

import logging
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import Any, TypedDict, Unpack

from robust.irr import containment, proposals, templates
from robust.irr.stops import APPROACHED, CUT_SHORT, NO_SCHEDULE, NOT_EXAMINED, Advice, Stop, advice, declared_stop
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


@dataclass(frozen=True)
class EnvelopeResult(Presented, ask="verified"):
    """A decoupled robustness envelope and how it was found.

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
    asked for: around the box, and inside the envelope.
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
    tolerance: proposals.Tolerance | None = None
    shape: templates.Shape | None = None

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
        self._questions = questions
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
                self._stops.update(stops_at(self._questions, self.box, margins, self.deadline))
            except (limits.OutOfTimeError, KeyboardInterrupt):
                log.info("no time was left to find out what ends all sides")  # the box is complete without
        return status, reason

    def _result(self, status: Status, reason: str | None = None) -> EnvelopeResult:
        return EnvelopeResult(
            status=status,
            method=self.method,
            encoding=self.encoding.name,
            solver=self._questions.solver,
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
            statistics=self._questions.statistics,
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
                stops[face] = declared_stop(parameter, side, end) or self._stops.get(face, unknown)
        return stops

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
