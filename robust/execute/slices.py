"""What is left of the robustness envelope while a plan is executed.

A parameter that has been observed is a fact. What is left is the slice of the envelope at the facts: the values of the
parameters that are still unknown with which the plan remains valid, that is, with which every schedule that the network
allows succeeds. An observation outside of the box that was promised leaves the box, but need not leave the envelope.

What happened is a fact too, and the schedule that has been begun must be one that can be continued. So the network is
taken with all past time points fixed where they were, and with those that are to be executed from now on. A box in
what is left under which this network is dynamically controllable is a promise, of the same kind as that with which the
execution began: as long as the values that are still unknown are inside, the plan succeeds. It is looked for in this
order, and then grown until the envelope or controllability stops every face:

1. what remains of the box that was promised before, if it is still a promise; so no promise is ever taken back;
2. the planned values of what is unknown;
3. the middle of the widest cube in what is left, in the units of weights.

The third finds a promise wherever some values are left for which the schedule can be continued: a point without a
schedule is a cycle of the network whose length is a linear expression over parameters, and is cut off with all points
for which that is negative. So nothing is left when nothing is found, of an envelope that is known exactly. An envelope
that is known only in part, as a union of what has been proved, is searched part by part.

A parameter that several actions reveal is no fact before the last of them: until then it keeps an interval around all
values that were seen.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, partial

from robust.errors import InputError
from robust.execute import controllable_boxes as boxes
from robust.irr.widen import Obstacle
from robust.plan.model import ZERO, Parameter, TimePoint, TimePointKind
from robust.plan.polynomial import Polynomial
from robust.presented import NoTruthValue, VerdictEnum
from robust.qe import inner, simplex
from robust.qe.box import Box, Interval, Side
from robust.qe.compute import RegionResult
from robust.qe.constraint import LinearConstraint
from robust.qe.lifted import LiftedRegion
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region, outside
from robust.smt.limits import Deadline, OutOfTimeError

_STRETCH = "λ"
"""The variable for half of a cube's width; no parameter can have this name."""


@dataclass(frozen=True)
class Observations:
    """Observations up to a moment of an execution.

    `seen` are the values that were revealed, as the least interval around them; `settled` are parameters of which
    nothing more will be revealed. `possible` are the values that are still possible for what is going on: an action
    that has not ended lasts at least until now. `times` is what has happened.
    """

    now: Fraction
    seen: Mapping[str, Interval] = field(default_factory=dict)
    settled: frozenset[str] = frozenset()
    possible: Mapping[str, Interval] = field(default_factory=dict)
    times: Mapping[TimePoint, Fraction] = field(default_factory=dict)


class SliceAnswer(VerdictEnum):
    """Result of a search for a box in the remainder of the envelope."""

    PROMISED = "promised"
    """There is a box with which the plan succeeds."""
    NOTHING = "nothing is left"
    """No box was found; no value is left if the envelope is known exactly."""
    OUT_OF_TIME = "out of time"
    """No answer in time: only the box that was promised before counts."""


@dataclass(frozen=True)
class Remainder(NoTruthValue, ask="answer"):
    """The remainder of the envelope at `time`, `after` an observation, in words.

    `box` is the promise, with the values that were seen; None if there is none. `kept` says whether it holds the
    promise before. `seconds` is wall time.
    """

    time: Fraction
    after: str
    answer: SliceAnswer
    box: Box | None
    kept: bool
    seconds: float


@dataclass(frozen=True)
class Slices:
    """The envelope of a plan, ready to be asked what is left of it.

    Args:
        parameters: the parameters.
        region: the envelope, or a part of it.
        exact: whether it is all of it.
        stnu: the network of the plan.
        seconds: wall time for each answer, of which half is for looking, and half for making what is found ready for
            dispatch; None is without limit.
        growth: wall time after which nothing is made wider, but for what is new, once. None: as long as it is looked.
    """

    parameters: tuple[Parameter, ...]
    region: Region
    exact: bool
    stnu: boxes.ParametricStnu
    seconds: float | None
    growth: float | None = None

    def __post_init__(self) -> None:
        self.parts  # noqa: B018 - worked out before the execution begins

    def after(
        self,
        facts: Observations,
        what: str,
        promised: Box,
        met: list[boxes.Obstruction] | None = None,
        idle: Callable[[], bool] | None = None,
    ) -> tuple[Remainder, boxes.ParametricStnu]:
        """The remainder once `what` has been observed, and the network with the events so far.

        Obstructions that boxes have `met` go on to hold as more happens, and need not be met again: new ones are added.
        What is found counts as soon as `idle` says that there is something else to do.
        """
        started = time.perf_counter()
        network = continued(self.stnu, facts)
        deadline = replace(Deadline.after(None if self.seconds is None else self.seconds / 2), idle=idle)
        box, kept = None, False
        try:
            known, hurry = [] if met is None else met, None if self.growth is None else Deadline.after(self.growth)
            box, kept = _Promising(self, facts, boxes.Dynamically(network, deadline), known, hurry).run(promised)
            answer = SliceAnswer.NOTHING if box is None else SliceAnswer.PROMISED
        except OutOfTimeError:
            answer = SliceAnswer.OUT_OF_TIME
        return Remainder(facts.now, what, answer, box, kept, time.perf_counter() - started), network

    @cached_property
    def parts(self) -> tuple[tuple[Polyhedron, tuple[Polyhedron, ...], tuple[Polyhedron, ...]], ...]:
        """Polyhedra with what is to be removed from each, and all that is outside of the rest."""
        return tuple((base, removed, (*base.complement(), *removed)) for base, removed in self.region.parts())


def sliceable(found: RegionResult, box: Callable[[], Box]) -> tuple[Region, bool]:
    """The envelope, and that it is all of it; or else a box inside of it with the part that was proved.

    Of an envelope with too many inequalities without times only the box is sliced.
    """
    if found.is_exact and not isinstance(found.region, LiftedRegion):
        return found.region, True
    names = found.region.parameters
    others = () if found.is_exact else found.inner().as_union().pieces
    return Region.union_of(names, (Polyhedron.of_box(names, box()), *others)), False


def continued(stnu: boxes.ParametricStnu, facts: Observations) -> boxes.ParametricStnu:
    """The network with what has happened where it was, and what is to be executed from now on.

    Lengths that have been revealed are no longer nature's to choose, and time points that have happened are counted
    from zero where something else depends on them.
    """
    times = facts.times
    links = [_from_zero(link, times) for link in stnu.links if not _is_over(link, times)]
    bounded = {link.target for link in links if link.is_contingent or _is_after(link, times)}
    mentioned = {point for link in links for point in (link.source, link.target)}
    now = Polynomial[str].constant(facts.now)
    for point in stnu.points:
        if point in times and point in mentioned and point != ZERO:
            at = Polynomial[str].constant(times[point])
            links.append(boxes.ParametricLink(ZERO, point, at, at, origin=f"{point} was at {times[point]}"))
        elif point not in times and point not in bounded and point.kind is not TimePointKind.TIMED_LITERAL:
            links.append(boxes.ParametricLink(ZERO, point, now, None, origin=f"{point} is not before now"))
    return boxes.ParametricStnu(stnu.points, tuple(links), stnu.vague)


def _is_after(link: boxes.ParametricLink, times: Mapping[TimePoint, Fraction]) -> bool:
    """Whether the target is later, for sure, than something that does not happen before now."""
    is_open = link.source not in times and link.source.kind is not TimePointKind.TIMED_LITERAL
    return is_open and link.lower is not None and link.lower.is_constant and link.lower.constant_term > 0


def _is_over(link: boxes.ParametricLink, times: Mapping[TimePoint, Fraction]) -> bool:
    """Whether a link says nothing any more: its length was revealed, or both ends happened as it demands."""
    if link.target not in times or link.is_contingent:
        return link.target in times
    if link.source not in times or not boxes.is_constant(link):
        return False
    length = times[link.target] - times[link.source]
    long_enough = link.lower is None or link.lower.constant_term <= length
    return long_enough and (link.upper is None or length <= link.upper.constant_term)


def _from_zero(link: boxes.ParametricLink, times: Mapping[TimePoint, Fraction]) -> boxes.ParametricLink:
    """A requirement, one end of which has happened, as one on when the other happens; other links as they are."""
    if link.is_contingent or (link.source in times) == (link.target in times):
        return link
    begun = link.source in times
    point, known = (link.target, link.source) if begun else (link.source, link.target)
    bounds = (link.lower, link.upper) if begun else (link.upper, link.lower)
    lower, upper = (None if bound is None else (bound if begun else -bound) + times[known] for bound in bounds)
    return boxes.ParametricLink(ZERO, point, lower, upper, origin=link.origin)


@dataclass(frozen=True)
class _Promising:
    """The search for a promise in what is left."""

    slices: Slices
    facts: Observations
    wanted: boxes.Dynamically
    met: list[boxes.Obstruction]
    hurry: Deadline | None

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.slices.parameters)

    @property
    def _open(self) -> tuple[str, ...]:
        return tuple(name for name in self._names if name not in self.facts.seen)

    @cached_property
    def _weight(self) -> dict[str, Fraction]:
        return {parameter.name: parameter.weight for parameter in self.slices.parameters}

    def run(self, promised: Box) -> tuple[Box | None, bool]:
        """The box, None if nothing is left, and whether it holds what was promised before."""
        before = len(self.met)  # what a promise breaks, the planned values probably break as well
        for find, kept in ((partial(self._remainder, promised), True), (self._planned, False)):
            candidate = find()
            for _, _, bad in self.slices.parts if candidate is not None else ():
                if candidate is not None and self._holds(candidate, [*bad, *self.met[before:]]):
                    return self._grown(candidate, bad, kept=kept), kept
        for base, removed, bad in self.slices.parts:
            centre = self._centre(base, removed)
            if centre is not None:
                return self._grown(centre, bad), False
        return None, False

    # -- boxes to start from -------------------------------------------------------------------------------------------

    def _remainder(self, promised: Box) -> Box | None:
        """The rest of a promise, with the values that were seen; None if it excludes a value that must be inside."""
        intervals = {}
        for name, interval in promised.intervals.items():
            seen, possible = self.facts.seen.get(name), self.facts.possible.get(name)
            rest: Interval | None = interval if possible is None else _common(interval, possible)
            if seen is not None:
                rest = seen if name in self.facts.settled else _around(interval, seen)
            if rest is None:
                return None
            intervals[name] = rest
        return Box(intervals)

    def _planned(self) -> Box:
        intervals = {}
        for parameter in self.slices.parameters:
            value = parameter.nominal
            possible = self.facts.possible.get(parameter.name, _ANYTHING)
            for side in Side:
                end = possible.end(side)
                if end is not None and side.sign * value > side.sign * end:
                    value = end
            intervals[parameter.name] = self.facts.seen.get(parameter.name, Interval(value, value))
        return Box(intervals)

    def _holds(self, box: Box, bad: Sequence[Obstacle]) -> bool:
        """Whether a box is left, and the schedule can be continued for sure."""
        return not any(piece.meets(box) for piece in bad) and self._cut(box) is None

    def _cut(self, box: Box) -> Polynomial[str] | None:
        """An expression over parameters that is negative in a point of the box without a schedule.

        Of a box that is no point, it may be negative although there are schedules.
        """
        ends = boxes.ends_of(box)
        if self.wanted.endless(ends):
            return Polynomial[str]({})
        reason = self.wanted.reason(ends)
        if reason is None:
            return None
        self.met.append(boxes.Obstruction(reason))
        return sum((form.substitute(lambda face: Polynomial.variable(face[0])) for form in reason), Polynomial[str]({}))

    def _centre(self, base: Polyhedron, removed: Sequence[Polyhedron]) -> Box | None:
        """The middle of the widest cube in some convex part of what is left, with the values that were seen."""
        part = base.restricted(Box({**self.facts.possible, **self.facts.seen}).constraints())
        while True:
            self.wanted.deadline.enforce()
            point = outside(part, removed)
            if point is None:
                return None
            cell = [*part.constraints, *(inner.outer_side(piece, point) for piece in removed)]
            box = self._middle(cell)
            condition = None if box is None else self._cut(box)
            if box is not None and condition is None:
                return box
            # what was seen of a parameter may not be within one convex part
            if condition is None or condition.is_constant:
                return None
            factors, constant = dict(condition.coefficients()), condition.constant_term
            part = part.restricted([LinearConstraint.of(factors, ">=", -constant)])

    def _middle(self, cell: Sequence[LinearConstraint]) -> Box | None:
        """The middle of the widest cube in a convex cell, as far as parameters are unknown."""
        constraints = [LinearConstraint.of({_STRETCH: 1}, ">=", 0), LinearConstraint.of({_STRETCH: 1}, "<=", _MOST)]
        for half in (half for constraint in cell for half in constraint.halves()):
            factors = {name: Fraction(factor) for name, factor in half.coefficients if name not in self.facts.seen}
            ends = (
                factor * (self.facts.seen[name].end(Side.UPPER if factor > 0 else Side.LOWER) or 0)
                for name, factor in half.coefficients
                if name in self.facts.seen
            )
            constant = half.constant - sum(ends)
            if factors:
                factors[_STRETCH] = sum((abs(f) * self._weight[name] for name, f in factors.items()), Fraction(0))
            constraints.append(LinearConstraint.of(factors, half.relation, constant))
        best = simplex.maximize([*self._open, _STRETCH], constraints, {_STRETCH: Fraction(1)})
        if best is None:
            return None
        stretched = Polyhedron((*self._open, _STRETCH), tuple(constraints))
        point = best.point if best.attained else stretched.interior_point()
        if point is None:
            return None
        return Box({n: self.facts.seen.get(n) or Interval(point[n], point[n]) for n in self._names})

    # -- growing -------------------------------------------------------------------------------------------------------

    def _grown(self, start: Box, bad: Sequence[Polyhedron], *, kept: bool = False) -> Box:
        hurry = self.hurry or self.wanted.deadline
        is_new = self.hurry is not None and not (kept and any(start[name].width != 0 for name in self._open))
        if hurry.passed and not is_new:
            return start
        possible = Box({name: self.facts.possible[name] for name in self._open if name in self.facts.possible})
        beyond = (half for bound in possible.constraints() for half in bound.negation())
        inside = boxes.KnownSet((*bad, *(Polyhedron(self._names, (half,)) for half in beyond)))
        parameters = [self._in_haste(parameter) for parameter in self.slices.parameters]
        met: list[Obstacle] = [*inside.pieces, *self.met]
        growing = boxes.GrowingBox(inside, self.wanted, parameters, start, met, self.facts.settled)
        with suppress(OutOfTimeError):  # a promise was found; time decides how wide it becomes
            if is_new:
                growing.leap(self.wanted.deadline)
            if not hurry.passed:
                growing.grow(hurry)
        self.met[:] = [each for each in growing.met if isinstance(each, boxes.Obstruction)]
        return growing.box

    def _in_haste(self, parameter: Parameter) -> Parameter:
        """A parameter that exceeds its plan gets a greater weight, or its value would soon leave the interval again."""
        if parameter.name in self.facts.seen or parameter.nominal in self.facts.possible.get(parameter.name, _ANYTHING):
            return parameter
        others = [self._weight[name] for name in self._open if name != parameter.name]
        return replace(parameter, weight=sum(others, Fraction(0)) or parameter.weight)


_ANYTHING = Interval(None, None)
_MOST = Fraction(1_000_000)
"""Half the width of cubes at most, in units of weights: what is left may be unbounded."""


def _common(interval: Interval, other: Interval) -> Interval | None:
    """The values of both intervals; None if there are none."""
    both = interval, other
    lower, is_open = max(((i.lower, not i.lower_closed) for i in both if i.lower is not None), default=(None, False))
    upper, is_closed = min(((i.upper, i.upper_closed) for i in both if i.upper is not None), default=(None, True))
    with suppress(InputError):
        return Interval(lower, upper, not is_open, is_closed)
    return None


def _around(interval: Interval, seen: Interval) -> Interval:
    """The least interval around one and finitely many values."""
    for side in Side:
        end, new = interval.end(side), seen.end(side)
        if end is not None and new is not None and side.sign * new >= side.sign * end:
            interval = interval.with_end(side, new)
    return interval
