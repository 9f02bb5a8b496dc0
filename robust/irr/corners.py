"""Boxes where rates and durations vary at once, and checks of plans in them: decided at the corners of the rates.

Which corners these are, and why they decide, is in :mod:`robust.irr.rates`. The widest box is looked for on a grid of
four significant digits of each nominal value: all sides move at once, in proportion to the weights of their parameters,
then those that can go on alone. So each side of the result, moved by one step of the grid, takes in a point that breaks
the plan; :func:`with_inner` executes it.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Any, Unpack

from robust.encode import create_encoding
from robust.encode.interface import Encoding, Facet
from robust.errors import SolverError, UnsupportedError
from robust.irr.check import Answer, Checker, CheckResult, Counterexample, NoScheduleError, require_some_schedule
from robust.irr.containment import Containment, Margins, Questions, Refutation
from robust.irr.rates import Rates, multiplied, part_of, rates_of
from robust.irr.search import BoxSearch, Conduct, EnvelopeResult, InnerBox, OuterPoint
from robust.irr.stops import NO_SCHEDULE, Stop
from robust.plan import model
from robust.plan.model import Parameter, ParametrizedPlan
from robust.plan.simulate import simulate
from robust.qe.box import Box, Face, Interval, Side
from robust.searching import Searching, Status
from robust.smt import limits
from robust.smt.session import Statistics

log = logging.getLogger(__name__)

DIGITS = 4
"""Significant digits of the grid."""
FARTHEST = 1000
"""How far a side is looked for, in multiples of the nominal value."""
UNLIMITED = Stop(f"nothing up to {FARTHEST} times the nominal value")


class CornerContainment(Containment):
    """Decides boxes at the corners of their rates, each by a plan that is linear."""

    def __init__(
        self, encoding: Encoding, rates: Rates, *, solver: str = "z3", statistics: Statistics | None = None
    ) -> None:
        super().__init__(encoding, solver=solver, statistics=statistics)
        self.rates = rates
        self._at: dict[tuple[tuple[Fraction, ...], frozenset[str]], Containment] = {}

    @property
    def refutations(self) -> Sequence[Refutation]:
        """The points that were found to break the plan."""
        return self._refuted

    @property
    def reason(self) -> str:
        """Why no exact method found the box."""
        return self.rates.reason

    def contains(self, box: Box, deadline: limits.Deadline) -> bool:
        return self.rates.is_decided(box) and self.refute(box, deadline) is None

    def refute(self, box: Box, deadline: limits.Deadline) -> Refutation | None:
        if (known := self._met_before(box)) is not None:
            return known
        rest = box.without(self.rates.names)
        found = self._apart.refute(rest, deadline)
        if found is not None:
            values = {name: box[name].some_value() for name in self.rates.names}
            return self._noted(Refutation(found.reason, {**found.values, **values}, found.facet))
        corners = self.rates.corners(box)
        for corner in sorted(corners, key=self._rank):
            limits.raise_if_interrupted()
            met = self._containment(corner, corners[corner], deadline)._broken_in(rest, deadline)
            if met is not None:
                found = met()
                values = dict(zip(self.rates.names, corner, strict=True))
                return self._noted(Refutation(found.reason, {**found.values, **values}))
        self._at = {key: known for key, known in self._at.items() if key[0] in corners}
        return None

    def _noted(self, refutation: Refutation) -> Refutation:
        self._refuted.append(refutation)
        return refutation

    @cached_property
    def _apart(self) -> Containment:
        """What does not depend on rates: the network, and demands at any values of them."""
        dependent = self.rates.dependent
        return self._of(self.rates.usual, lambda name: name not in dependent)

    def _containment(
        self, corner: tuple[Fraction, ...], demands: frozenset[str], deadline: limits.Deadline
    ) -> Containment:
        """What demands need at a corner."""
        deadline.enforce()
        if (corner, demands) not in self._at:
            values = dict(zip(self.rates.names, corner, strict=True))
            self._at[corner, demands] = self._of(values, demands.__contains__)
        return self._at[corner, demands]

    def _of(self, values: Mapping[str, Fraction], counts: Callable[[str], bool]) -> Containment:
        """The plan at values of rates with some of its demands."""
        plan = part_of(self.encoding.plan, {name: values[name] for name in self.rates.names}, counts)
        return Containment(
            create_encoding(self.encoding.name, plan, self.encoding.epsilon),
            solver=self.solver,
            statistics=self.statistics,
        )

    def ended_by_network(self, box: Box, reach: Margins, deadline: limits.Deadline) -> dict[Face, Facet | None]:
        return {}  # obligations and the network end sides alike

    def ended_by(self, box: Box, reach: Margins, deadline: limits.Deadline) -> dict[Face, tuple[str, ...]]:
        ended: dict[Face, tuple[str, ...]] = {}
        for face, step in reach.items():
            end = box[face[0]].end(face[1])
            met = None if end is None else self.refute(box.moved(face, end + face[1].sign * step), deadline)
            ended[face] = () if met is None else (met.reason,)
        return ended

    def _rank(self, corner: tuple[Fraction, ...]) -> int:
        """Corners like the one that was refuted last come first."""
        if not self._refuted:
            return 0
        last, nominal = self._refuted[-1].values, self.encoding.plan.nominal
        pairs = zip(self.rates.names, corner, strict=True)
        return sum((value > nominal[name]) != (last[name] > nominal[name]) for name, value in pairs)


class CornerChecker(Searching[CheckResult]):
    """Examines the obligations of a plan in which unknowns are multiplied, over a box of parameter values.

    What has one value in the box is written into the plan. If products are left, the plan is examined at the corners of
    its rates, which is exact; where these do not decide, a point of the box may refute it all the same.

    Args:
        plan: the plan.
        box: the parameter values.
        ask: begins a check of a linear plan over a box.
        nothing: the answer as long as nothing is known.
    """

    def __init__(
        self,
        plan: ParametrizedPlan,
        box: Box,
        ask: Callable[[ParametrizedPlan, Box], Searching[CheckResult]],
        nothing: CheckResult,
    ) -> None:
        super().__init__()
        self._plan = plan
        self._box = box
        self._ask = ask
        self._nothing = nothing
        self._undecided: str | None = None
        """Why the corners are not all that counts."""
        self._known: CheckResult | None = None

    def _search(self) -> None:
        if (left := self._out_of_bounds()) is not None:
            self._known = replace(self._nothing, answer=Answer.REFUTED, reason=left)
            return
        ends = {name: (interval.lower, interval.upper) for name, interval in self._box.intervals.items()}
        fixed = {name: low for name, (low, high) in ends.items() if low is not None and low == high}
        try:
            self._examine(fixed)
        except UnsupportedError as products:
            if self._known is not None:
                raise
            self._at_corners(fixed, products)

    def _out_of_bounds(self) -> str | None:
        """Which value of the box a declared bound excludes: those that are written into a plan have no bounds there."""
        for known in self._plan.parameters:
            interval, name = self._box[known.name], known.name
            for side, bound, word in ((Side.LOWER, known.lower, "lb"), (Side.UPPER, known.upper, "ub")):
                if bound is not None and not interval.is_within(Interval(None, None).with_end(side, bound)):
                    end = interval.end(side)
                    value = bound + side.sign if end is None else end
                    return f"no schedule with {name} = {value}: parameter {name} {word} {bound} cannot hold"
        return None

    def _at_corners(self, fixed: Mapping[str, Fraction], products: UnsupportedError) -> None:
        plan = model.at_values(self._plan, fixed)
        rest = self._box.without(fixed)
        try:
            rates = rates_of(plan)
        except UnsupportedError as undecided:
            names = multiplied(plan)
            if not names:
                raise products from None
            self._undecided = f"{undecided.message}; with one value each for {', '.join(names)} by --at it is decided"
            sides = tuple((name, tuple(Side)) for name in names)
            every = Rates(names, {sides: frozenset()}, plan.nominal)
            for corner in every.corners(rest):
                if not self._examine({**fixed, **dict(zip(names, corner, strict=True))}):
                    return
            return
        if (far := rates.endless(rest)) is not None:
            self._undecided = f"{far} multiplies a time that varies and has no end; give it one by --at {far}=LOW:HIGH"
        anywhere = {name: rest[name].some_value() for name in rates.names}
        if not self._examine({**fixed, **anywhere}, lambda name: name not in rates.dependent):
            return
        for corner, demands in rates.corners(rest).items():
            if not self._examine({**fixed, **dict(zip(rates.names, corner, strict=True))}, demands.__contains__):
                return

    def _examine(self, values: Mapping[str, Fraction], counts: Callable[[str], bool] = lambda _: True) -> bool:
        """Add what is found with these values; False if that is enough."""
        limits.raise_if_interrupted()
        rest = self._box.without(values)
        try:
            found = self._ask(part_of(self._plan, values, counts), rest).run()
        except NoScheduleError as none:
            found = self._without_schedule(values, none.why)
        if found.answer is Answer.REFUTED and any(value not in self._box[name] for name, value in values.items()):
            self._undecided = "the plan breaks where an open end of the box is; give closed ends"
            return True
        examples = {name: self._confirmed(shown, values) for name, shown in found.counterexamples.items()}
        known = replace(found, counterexamples=examples)
        if self._known is not None:
            both = {name: self._worse(name, found) for name in {**self._known.obligations, **found.obligations}}
            answer = max(self._known.answer, found.answer, key=_ORDER.index)
            examples = {**examples, **self._known.counterexamples}
            known = replace(known, answer=answer, obligations=both, counterexamples=examples)
            known = replace(known, reason=self._known.reason or found.reason, settled=self._known.settled)
        self._known = known
        if found.interrupted:
            raise KeyboardInterrupt
        if found.timed_out:
            raise limits.OutOfTimeError
        return known.answer is not Answer.REFUTED or self._nothing.every

    def _without_schedule(self, values: Mapping[str, Fraction], why: str) -> CheckResult:
        """The refutation by values that leave no schedule.

        Raises:
            NoScheduleError: if no other values leave one either.
        """
        encoding = create_encoding("relational", self._plan, self._nothing.epsilon)
        session = Containment(encoding, solver=self._nothing.solver).open_session()
        require_some_schedule(encoding, session, limits.NEVER)
        where = ", ".join(f"{name} = {value}" for name, value in values.items())
        return replace(self._nothing, answer=Answer.REFUTED, reason=f"no schedule with {where}: {why}")

    def _worse(self, name: str, found: CheckResult) -> Answer:
        """The worst verdict on an obligation so far."""
        earlier = {} if self._known is None else self._known.obligations
        return max((each[name] for each in (earlier, found.obligations) if name in each), key=_ORDER.index)

    def _confirmed(self, shown: Counterexample, values: Mapping[str, Fraction]) -> Counterexample:
        """A counterexample of a plan with values written into it, executed in the plan itself.

        Raises:
            SolverError: if the simulator does not confirm it.
        """
        parameters = {name: {**shown.parameters, **values}[name] for name in self._box.intervals}
        simulation = simulate(self._plan, parameters, shown.schedule, epsilon=self._nothing.epsilon)
        if simulation.network_violations or not any(v.obligation == shown.obligation for v in simulation.violations):
            raise SolverError(f"the simulator does not confirm that {shown.obligation!r} breaks; please report this")
        return replace(shown, parameters=parameters, simulation=simulation)

    def _result(self, status: Status, reason: str | None = None) -> CheckResult:
        known = self._nothing if self._known is None else self._known
        cut = status is not Status.COMPLETE
        answer, why = known.answer, known.reason
        if answer is Answer.PROVED and (cut or self._undecided):
            answer, why = Answer.UNKNOWN, reason or self._undecided
        stopped = cut and answer is Answer.UNKNOWN
        return replace(
            known,
            answer=answer,
            reason=why,
            box=self._box,
            plan=self._plan,
            seconds=self._seconds(),
            interrupted=stopped and status is Status.INTERRUPTED,
            timed_out=stopped and status is Status.TIMEOUT,
        )


_ORDER = (Answer.PROVED, Answer.UNKNOWN, Answer.REFUTED)


class CornerWidening(BoxSearch):
    """Widening on a grid, by a containment that decides at corners of rates.

    Args:
        corners: decides boxes.
        conduct: see :class:`Conduct`; `on_step` is called with every box that is inside.
    """

    def __init__(self, corners: CornerContainment, **conduct: Unpack[Conduct]) -> None:
        super().__init__(corners, method="widen", **conduct)
        self._corners = corners
        self.fallback = corners.reason
        self._checks = 0
        parameters = self.encoding.plan.parameters
        self._parameters = {parameter.name: parameter for parameter in parameters}
        self.steps = {parameter.name: grid_step(parameter) for parameter in parameters}

    @property
    def checks(self) -> int:
        return self._checks

    def _search(self) -> None:
        self._verify_nominal(self._corners)
        faces = product((parameter.name for parameter in self.encoding.plan.parameters), Side)
        active = [face for face in faces if not self._released(face)]
        while active:
            self._together(active)
            active = [face for face in active if self._alone(face)]

    def _margins(self) -> Margins:
        return {}

    def _released(self, face: Face) -> bool:
        """Move a side that can break nothing to its end at once; or one that nothing breaks at all, however far."""
        name, side = face
        limit = self._limit(face)
        end = self.box[name].end(side)
        if end == limit:
            return True
        if name in self._corners.rates.names and side in self._corners.rates.breaking(name):
            return False
        return self._try(self.box.moved(face, limit)) is None

    def _limit(self, face: Face) -> Fraction | None:
        parameter = self._parameters[face[0]]
        return parameter.upper if face[1] is Side.UPPER else parameter.lower

    def _place(self, face: Face, distance: Fraction) -> Fraction:
        """Where a side is that moves so far from the nominal value: on the grid, at the declared bound at most."""
        name, side = face
        nominal, step, limit = self._parameters[name].nominal, self.steps[name], self._limit(face)
        end = step * (
            math.floor((nominal + distance) / step) if side.sign > 0 else math.ceil((nominal - distance) / step)
        )
        if limit is not None and side.sign * end >= side.sign * limit:
            end = limit
        known = self.box[name].end(side)
        return end if known is None or side.sign * end > side.sign * known else known

    def _moved(self, faces: Sequence[Face], scale: Fraction) -> Box:
        box = self.box
        for face in faces:
            box = box.moved(face, self._place(face, scale * self._parameters[face[0]].weight))
        return box

    def _together(self, faces: Sequence[Face]) -> None:
        """Move sides at once as far as the grid allows: doubling, then bisection."""
        reached = min(abs(self._end(face) - self._parameters[face[0]].nominal) / self._weight(face) for face in faces)
        finest = min(self.steps[name] / self._weight((name, side)) for name, side in faces)
        farthest = max(
            FARTHEST * max(abs(self._parameters[n].nominal), self.steps[n]) / self._weight((n, s)) for n, s in faces
        )
        good, step, bad = reached, max(reached, finest), None
        while bad is None and good < farthest:
            candidate = self._moved(faces, good + step)
            if self._try(candidate) is None:
                good, step = good + step, 2 * step
            else:
                bad = good + step
        while bad is not None and bad - good > finest:
            middle = (good + bad) / 2
            if self._moved(faces, middle) == self.box or self._try(self._moved(faces, middle)) is None:
                good = middle
            else:
                bad = middle

    def _alone(self, face: Face) -> bool:
        """Move one side by a step; False if it cannot, now or ever."""
        name, end = face[0], self._end(face)
        if end == self._limit(face):
            return False
        if abs(end) > FARTHEST * max(abs(self._parameters[name].nominal), self.steps[name]):
            self._stops[face] = UNLIMITED
            return False
        moved = self._next(face, end)
        refutation = self._try(self.box.moved(face, moved))
        if refutation is None:
            return True
        facet = refutation.facet
        of_network = () if facet is None or facet.obligation else facet.origins
        self._stops[face] = Stop(NO_SCHEDULE, of_network) if of_network else Stop(refutation.reason)
        return False

    def _next(self, face: Face, end: Fraction) -> Fraction:
        name, side = face
        step, limit = self.steps[name], self._limit(face)
        moved = step * ((math.floor(end / step) + 1) if side.sign > 0 else (math.ceil(end / step) - 1))
        return limit if limit is not None and side.sign * moved > side.sign * limit else moved

    def _end(self, face: Face) -> Fraction:
        end = self.box[face[0]].end(face[1])
        if end is None:
            raise ValueError("a side that is unbounded does not move")
        return end

    def _weight(self, face: Face) -> Fraction:
        return self._parameters[face[0]].weight

    def _try(self, box: Box) -> Refutation | None:
        self._checks += 1
        refutation = self._corners.refute(box, self.deadline) if self._corners.rates.is_decided(box) else _INFINITE
        if refutation is None:
            self._accept(box)
        self._record(self._checks, accepted=refutation is None)
        return refutation


_INFINITE = Refutation("a rate without an end", {})


def grid_step(parameter: Parameter) -> Fraction:
    """A step of the grid: one in the last of the significant digits of the nominal value."""
    size = abs(parameter.nominal) or parameter.weight
    exponent = math.floor(math.log10(size)) if size else 0
    while Fraction(10) ** exponent > size:
        exponent -= 1
    return Fraction(10) ** (exponent - DIGITS + 1)


def corner_containment(
    encoding: Encoding, *, solver: str = "z3", statistics: Statistics | None = None
) -> CornerContainment | None:
    """What decides boxes of a plan with products of two unknowns; None if there are none in the way.

    Raises:
        UnsupportedError: if corners do not decide them.
    """
    try:
        encoding.obligations  # noqa: B018 - which is where products are met
    except UnsupportedError as products:
        if not multiplied(encoding.plan):
            raise
        try:
            rates = rates_of(encoding.plan)
        except UnsupportedError as undecided:
            raise UnsupportedError(f"{products.message}; {undecided.message}", products.location) from None
        return CornerContainment(encoding, rates, solver=solver, statistics=statistics)
    return None


def with_inner(result: EnvelopeResult, corners: Questions[Any] | None, deadline: limits.Deadline) -> EnvelopeResult:
    """A box that was decided at corners, with how far its sides are from points that break the plan.

    Each of these is executed if there is time. Other boxes are as they are.
    """
    if not isinstance(corners, CornerContainment) or not result.verified:
        return result
    nearest: dict[Face, tuple[Fraction, Refutation]] = {}
    for refutation in corners.refutations:
        outside = [name for name, interval in result.box.intervals.items() if refutation.values[name] not in interval]
        if len(outside) != 1:
            continue
        (name,) = outside
        value = refutation.values[name]
        for side in Side:
            end = result.box[name].end(side)
            if end is not None and side.sign * value > side.sign * end:
                gap = abs(value - end)
                if (name, side) not in nearest or gap < nearest[name, side][0]:
                    nearest[name, side] = gap, refutation
    points = []
    for (name, side), (gap, refutation) in nearest.items():
        shown = None
        try:
            shown = None if refutation.facet is not None else _executed(corners, refutation, deadline)
        except (limits.OutOfTimeError, KeyboardInterrupt):
            log.info("no time was left to execute what is beyond the sides")
        points.append(OuterPoint(name, side, gap, shown))
    return replace(result, inner=InnerBox(corners.rates.names, tuple(points)))


def _executed(corners: CornerContainment, refutation: Refutation, deadline: limits.Deadline) -> Counterexample | None:
    """A schedule at a point with which the obligation breaks, confirmed by the simulator."""
    encoding = corners.encoding
    fixed = create_encoding("relational", model.at_values(encoding.plan, refutation.values), encoding.epsilon)
    checked = Checker(fixed, Box({}), solver=corners.solver, deadline=deadline).run()
    shown = next(iter(checked.counterexamples.values()), None)
    return None if shown is None else replace(shown, parameters=refutation.values)
