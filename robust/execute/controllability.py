"""Weak, dynamic and strong controllability of a box: verdicts, reasons, and the widest controllable boxes.

A box promises that *for each* parameter value in it a schedule exists, and that every allowed schedule satisfies the
obligations. Whether a dispatcher can find the schedule is a question about the network alone:

- weakly controllable: it can if it knows all values beforehand. Exact.
- dynamically controllable: it can if it sees each contingent link end, at that moment. Exact if each parameter that
  varies is (part of) the length of one contingent link and stands nowhere else in the network; parameters that the
  network does not mention, such as rates and levels, do not matter. A parameter that several links share, or that
  stands in a requirement's bound, is beyond networks with uncertainty: CONTROLLABLE is then proved with independent and
  hidden values or by one schedule, NOT_CONTROLLABLE with values that are known beforehand, and UNKNOWN is between.
- strongly controllable: one schedule of what it executes suits all values. Exact, for all parameters.

Every box that is a decoupled robustness envelope is weakly controllable by definition. Here it is decided again, from
the network alone: by Farkas' lemma, a point without a schedule is a negative cycle, found by an SMT query. In general
the question is coNP-complete (Morris and Muscettola, 1999).
"""

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, replace
from enum import Enum
from fractions import Fraction
from itertools import product

from robust import errors, presented
from robust.encode import create_encoding, interface
from robust.encode.network import TemporalNetwork
from robust.encode.validity import Validity
from robust.execute import controllable_boxes as boxes
from robust.irr import exact, widen
from robust.irr.search import stops_at
from robust.irr.stops import JUST, Stop, declared_stop
from robust.network.dispatchable import waits
from robust.network.uncertain import Wait, explain
from robust.plan.model import ParametrizedPlan, TimePointKind
from robust.probability.measure import Bounds, SuccessProbabilities
from robust.qe.box import Box, Face, Growing, Side
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Satisfiability as SolverVerdict
from robust.smt.session import Session, Statistics, Terms


class Control(Enum):
    """Kinds of controllability: the dispatcher knows all values beforehand, those revealed so far, or none."""

    WEAK = "weak"
    DYNAMIC = "dynamic"
    STRONG = "strong"


class ControlVerdict(presented.VerdictEnum):
    """Whether a box has a kind of controllability, as far as that is known."""

    CONTROLLABLE = "controllable"
    NOT_CONTROLLABLE = "not controllable"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Finding(presented.NoTruthValue, ask="verdict"):
    """A verdict about one kind of controllability; `reason` says why it is not CONTROLLABLE."""

    kind: Control
    verdict: ControlVerdict
    reason: str | None
    seconds: float


MOST_CORNERS = 64
"""Number of corners of the box that are tried to refute dynamic controllability of vague parameters."""


@dataclass
class Controllability:
    """Decides the controllability of one box of a plan.

    Args:
        plan: the plan whose network it is.
        box: the box; where it is not closed, its closure is as controllable.
        solver: for weak controllability, `z3` or `cvc5`.
        deadline: when to give up.

    Raises:
        UnsupportedError: for a bound that is not linear in the parameters.
    """

    plan: ParametrizedPlan
    box: Box
    _: KW_ONLY
    solver: str = "z3"
    deadline: Deadline = NEVER

    def __post_init__(self) -> None:
        self.network = boxes.parametric_stnu(self.plan, self.box)

    def finding(self, kind: Control) -> Finding:
        """The verdict about one kind; UNKNOWN if time runs out."""
        started = time.perf_counter()
        try:
            deciding = {Control.WEAK: self._weak, Control.DYNAMIC: self._dynamic, Control.STRONG: self._strong}
            verdict, reason = deciding[kind]()
        except OutOfTimeError as stopped:
            verdict, reason = ControlVerdict.UNKNOWN, stopped.reason or "out of time"
        return Finding(kind, verdict, reason, time.perf_counter() - started)

    def findings(self) -> tuple[Finding, ...]:
        """The verdicts about all kinds, weak first."""
        return tuple(self.finding(kind) for kind in Control)

    def shrunk(self, kind: Control) -> boxes.Shrunk:
        """The max–min fair part of the box that is controllable: see :mod:`robust.execute.controllable_boxes`.

        Of a box with vague parameters, it is the part that is dynamically controllable without knowing them, unless one
        schedule suits the whole box.

        Raises:
            InputError: if not even the nominal values leave a schedule.
            OutOfTimeError: if the deadline passes first.
        """
        if kind is Control.WEAK or (kind is Control.DYNAMIC and self._is_strong_only()):
            return boxes.Shrunk(self.box, ())
        wanted = (boxes.Dynamically if kind is Control.DYNAMIC else boxes.Strongly)(self.network, self.deadline)
        return boxes.shrink(self.plan.parameters, self.box, wanted)

    def waits(self) -> tuple[Wait, ...]:
        """The waits of a dynamically controllable box; none where one schedule is valid for all values.

        Raises:
            InputError: if a contingent link may end before it starts, or a requirement is infinitely strong.
            OutOfTimeError: if the deadline passes first.
        """
        if self._is_strong_only():
            return ()
        answer = self.network.dynamic(boxes.ends_of(self.box), self.deadline)
        return () if answer.cycle is not None else waits(answer)

    def _is_strong_only(self) -> bool:
        """Whether it takes a fixed schedule to know that the box is dynamically controllable."""
        ends = boxes.ends_of(self.box)
        return not _is_exact(self.network, ends) and bool(self._obstacle(ends)) and self.strong_answer().is_controllable

    def strong_answer(self) -> boxes.StrongAnswer:
        """The one schedule that is valid for all values, or why there is none."""
        return boxes.strong(self.network, boxes.ends_of(self.box))

    # -- verdicts ------------------------------------------------------------------------------------------------------

    def _weak(self) -> tuple[ControlVerdict, str | None]:
        """Whether every point of the closure of the box has a schedule: none is lost at open ends."""
        terms, statistics = Terms(), Statistics()
        validity = Validity(TemporalNetwork(self.plan), (), terms)

        def session() -> Session:
            return Session(terms, solver=self.solver, statistics=statistics)

        facet = validity.broken_facet(self.box.grid, session, self.deadline)
        match facet:
            case None:
                return ControlVerdict.CONTROLLABLE, None
            case interface.Facet():
                return ControlVerdict.NOT_CONTROLLABLE, f"contradiction: {'; '.join(facet.origins)}"
            case SolverVerdict():
                raise OutOfTimeError(statistics.failure)

    def _strong(self) -> tuple[ControlVerdict, str | None]:
        answer = self.strong_answer()
        if answer.is_controllable:
            return ControlVerdict.CONTROLLABLE, None
        needed = "; ".join(dict.fromkeys(edge.origin for edge in answer.cycle))
        if answer.endless:
            names = ", ".join(sorted({name for name, _ in answer.endless}))
            return ControlVerdict.NOT_CONTROLLABLE, f"no time is late enough for all values of {names}: {needed}"
        mentioned = {name for edge in answer.cycle for (name, _), _ in edge.form.coefficients()}
        names = ", ".join(sorted(mentioned)) or "the parameters"
        return ControlVerdict.NOT_CONTROLLABLE, f"no schedule suits all values of {names}: {needed}"

    def _dynamic(self) -> tuple[ControlVerdict, str | None]:
        ends = boxes.ends_of(self.box)
        reason = self._obstacle(ends)
        if reason is None:
            return ControlVerdict.CONTROLLABLE, None
        if _is_exact(self.network, ends):
            return ControlVerdict.NOT_CONTROLLABLE, reason
        if self.strong_answer().is_controllable:
            return ControlVerdict.CONTROLLABLE, None
        for known, part in self._corners(self.network.vague):
            network, ends = boxes.parametric_stnu(self.plan, part), boxes.ends_of(part)
            if _is_exact(network, ends):
                answer = network.dynamic(ends, self.deadline)
                if answer.cycle is not None:
                    beforehand = ", ".join(f"{name} = {value}" for name, value in known.items())
                    why = explain(answer.form.stnu, answer.cycle)
                    return (ControlVerdict.NOT_CONTROLLABLE, f"{why}, even if {beforehand} is known" if known else why)
        return ControlVerdict.UNKNOWN, "; ".join(self.network.vague.values()) or reason

    def _obstacle(self, ends: boxes.Ends) -> str | None:
        """Why dynamic controllability is not proved; None if it is."""
        for index, _ in self.network.early(ends):
            return f"{self.network.links[index].origin} may end before it starts"
        endless = self.network.endless(ends)
        if endless:
            return f"no time is late enough for all values of {', '.join(sorted({name for name, _ in endless}))}"
        answer = self.network.dynamic(ends, self.deadline)
        return None if answer.cycle is None else explain(answer.form.stnu, answer.cycle)

    def _corners(self, vague: Mapping[str, str]) -> Iterator[tuple[dict[str, Fraction], Box]]:
        """The box with extreme values of vague parameters known; both ends of all at once if they are many."""
        nominal = {parameter.name: parameter.nominal for parameter in self.plan.parameters}
        values = []
        for name in vague:
            interval = self.box[name]
            known = [end for end in (interval.lower, interval.upper) if end is not None]
            values.append(known or [nominal[name]])
        few = 2 ** len(vague) <= MOST_CORNERS
        corners: Iterable[tuple[Fraction, ...]] = (
            product(*values) if few else zip(*((known[0], known[-1]) for known in values), strict=True)
        )
        for corner in corners:
            chosen = dict(zip(vague, corner, strict=True))
            yield chosen, self.box.changed(Box.point(chosen).intervals)


def _is_exact(network: boxes.ParametricStnu, ends: boxes.Ends) -> bool:
    """Whether the network of a box says all about dynamic controllability."""
    return not network.vague and next(network.early(ends), None) is None


def shrink(plan: ParametrizedPlan, box: Box, kind: Control, *, deadline: Deadline = NEVER) -> Box:
    """The largest part of a box, max–min fair around the nominal point, that has a kind of controllability. Exact.

    Raises:
        InputError: if not even the nominal values leave a schedule.
        UnsupportedError: for a bound that is not linear in the parameters.
        OutOfTimeError: if the deadline passes first.
    """
    return Controllability(plan, box, deadline=deadline).shrunk(kind).box


def served(plan: ParametrizedPlan, box: Box, deadline: Deadline = NEVER) -> SuccessProbabilities:
    """How probably executors and fixed schedules succeed with values of a box for all of which the plan is proved.

    Where the box is dynamically controllable, our dispatcher and the best executor do for sure; where it is strongly
    controllable, so does one schedule. Else that is open.
    """
    certain, unknown = Bounds(Fraction(1), Fraction(1)), Bounds(Fraction(0), Fraction(1))
    dynamically = strongly = unknown
    starts: dict[str, Fraction] = {}
    with suppress(errors.UnsupportedError, OutOfTimeError):
        known = Controllability(plan, box, deadline=deadline)
        if (schedule := known.strong_answer().schedule) is not None:
            dynamically = strongly = certain
            starts = {str(point): time for point, time in schedule.items() if point.kind is TimePointKind.START}
        elif known.finding(Control.DYNAMIC).verdict is ControlVerdict.CONTROLLABLE:
            dynamically = certain
    return SuccessProbabilities(certain, dynamically, strongly, dynamically, strongly, starts)


@dataclass(frozen=True)
class Widest:
    """A box inside the envelope that is controllable, and no box around it is both.

    `stops` says of each finite face why it cannot move outwards: what breaks in the envelope, or what a dispatcher
    could no longer do. `cut` are faces that could be at any finite place, but must not be infinite. `bound` is the
    weighted total width that no such box exceeds, if the widest of all was asked for and that is finite.
    """

    box: Box
    stops: Mapping[Face, Stop]
    cut: tuple[Face, ...]
    bound: Fraction | None = None


@dataclass(frozen=True)
class Objective:
    """The quantity to maximize, and the encoding of the envelope.

    With `optimal` it is the greatest weighted total width of all controllable boxes in the envelope, or of those around
    the nominal point (`contain_nominal`). Else it is a box around the one that shrinking leaves, max–min fair.
    """

    epsilon: Fraction
    encoding: str
    optimal: bool = False
    contain_nominal: bool = False


def widest(
    plan: ParametrizedPlan,
    start: Box,
    kind: Control,
    objective: Objective,
    *,
    solver: str = "z3",
    deadline: Deadline = NEVER,
) -> Widest:
    """The widest box that a dispatcher can serve. Exact: each face is stopped by an obligation or by a cycle.

    Faces grow from a box that is inside the envelope and controllable, so the result is nowhere narrower than that. The
    widest of all is found by cutting planes over the ends of boxes: each obstacle that a best box meets is a clause.

    Raises:
        OutOfTimeError: if the deadline passes first.
        UnsupportedError: for an expression that is not linear.
    """
    bad = widen.DiscoveredBadSet(create_encoding(objective.encoding, plan, objective.epsilon, deadline), solver=solver)
    network = boxes.parametric_stnu(plan, start)
    wanted: boxes.Property = (boxes.Dynamically if kind is Control.DYNAMIC else boxes.Strongly)(network, deadline)
    if kind is Control.DYNAMIC and wanted.reason(boxes.ends_of(start)) is not None:
        wanted = boxes.Strongly(network, deadline)  # a fixed schedule is all that is known of vague parameters
    growing = boxes.GrowingBox(bad, wanted, plan.parameters, start, [])
    growing.grow(deadline)
    box, bound = growing.box, None
    if objective.optimal:
        search = exact.OptimalBox(
            bad=bad, pieces=growing.met, contain_nominal=objective.contain_nominal, deadline=deadline, inside=growing
        )
        box, bound = search.run(), search.bound
    obstructions = [obstacle for obstacle in growing.met if isinstance(obstacle, boxes.Obstruction)]
    stops: dict[Face, Stop] = {}
    reach: dict[Face, Fraction] = {}  # each finite face stops because beyond it there is no control, or else no plan
    for parameter, side in product(plan.parameters, Side):
        face, end = (parameter.name, side), box[parameter.name].end(side)
        if end is not None:
            stop = declared_stop(parameter, side, end)
            if stop is None and _obstructed(box, face, end, obstructions):
                beyond = Controllability(plan, box.moved(face, end + side.sign * JUST), deadline=deadline)
                stop = Stop(f"not {ADVERBS[kind]} controllable beyond: {beyond.finding(kind).reason}")
            if stop is None:
                reach[face] = JUST
            else:
                stops[face] = stop
    return Widest(box, {**stops, **dict(stops_at(bad, box, reach, deadline))}, growing.cut(box), bound)


def _obstructed(box: Box, face: Face, end: Fraction, obstructions: Iterable[boxes.Obstruction]) -> bool:
    """Whether one of some reasons keeps a face of a box where it is."""
    growing = Growing(box, {face: (end, Fraction(1))})
    least = (reason.least_stretch(growing) for reason in obstructions if face[0] in reason.mentioned)
    return any(stretch is not None and not stretch[0] for stretch in least)


ADVERBS = {Control.WEAK: "weakly", Control.DYNAMIC: "dynamically", Control.STRONG: "strongly"}


@dataclass(frozen=True)
class ControllabilityReport(presented.NoTruthValue, ask="was_controllable"):
    """The verdicts about a box, and the part of it that has the wanted kind of controllability.

    `shrunk` and `lost` are None, with a `failure`, if there is no such part or time ran out. `widest` is the widest box
    that is as wanted, which need not be inside the other; None if it was not asked for, or there was no time. `waits`
    are those of its strategy, if dynamic controllability was wanted.
    """

    wanted: Control
    findings: tuple[Finding, ...]
    box: Box
    shrunk: boxes.Shrunk | None
    lost: boxes.Loss | None
    failure: str | None
    waits: tuple[str, ...]
    widest: Widest | None = None

    @property
    def was_controllable(self) -> bool:
        """Whether the box itself has the wanted kind of controllability."""
        verdicts = {finding.kind: finding.verdict for finding in self.findings}
        return verdicts.get(self.wanted) is ControlVerdict.CONTROLLABLE


def assess(
    plan: ParametrizedPlan,
    box: Box,
    wanted: str,
    *,
    solver: str,
    timeout: float | None,
    objective: Objective | None = None,
) -> ControllabilityReport:
    """Decide all kinds for a box that is inside the envelope, shrink it to the wanted kind, and find the widest one."""
    kind = Control(wanted)
    deadline = Deadline.after(timeout)
    asked = Controllability(plan, box, solver=solver, deadline=deadline)
    findings = asked.findings()
    try:
        shrunk = asked.shrunk(kind)
        inside = Controllability(plan, shrunk.box, solver=solver, deadline=deadline)
        strategy = inside.waits() if kind is Control.DYNAMIC else ()
    except OutOfTimeError:
        return ControllabilityReport(kind, findings, box, None, None, "out of time", ())
    except errors.RobustError as error:
        return ControllabilityReport(kind, findings, box, None, None, error.message, ())
    lost = boxes.loss(box, shrunk.box)
    report = ControllabilityReport(kind, findings, box, shrunk, lost, None, tuple(map(str, strategy)))
    if objective is None or kind is Control.WEAK or report.was_controllable:
        return report
    with suppress(OutOfTimeError):
        return replace(report, widest=widest(plan, shrunk.box, kind, objective, solver=solver, deadline=deadline))
    return report
