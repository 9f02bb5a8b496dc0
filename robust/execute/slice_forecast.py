"""What is ahead of a plan that runs whose effects or conditions are about numbers and time: by a solver and by slices.

A solver says whether some times and durations that are left keep every obligation, and whether steps may take as long
as planned. What is promised is a box in the slice of the envelope at what was observed
(:mod:`robust.execute.slices`), and windows are those of a dispatcher under this promise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from math import lcm

from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import constant, least, variable
from robust.errors import InputError
from robust.execute import controllable_boxes as boxes
from robust.execute.dispatchable import Dreex, dispatch_network, first_windows
from robust.execute.forecast import FollowedPlan, Forecaster, PlanForecast, Prospect, StepAhead, Window
from robust.execute.slices import Observations, SliceAnswer, Slices, continued, sliceable
from robust.irr.exact import ExactSearch
from robust.irr.stops import NO_SCHEDULE
from robust.network.differences import DifferenceNetwork
from robust.plan import model
from robust.qe.box import Box, Interval
from robust.qe.compute import RegionSearch
from robust.qe.eliminate.enumerate import satisfiable
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Formula, Satisfiability, Session

REGION_SECONDS = 5.0
"""For the envelope, once, before the execution begins."""
LATER_SECONDS = 0.5
"""For the envelope of the rest of a plan."""
FIRST_SECONDS = 5.0
"""For the first promise, once, before the execution begins."""
SLICE_SECONDS = 0.2
"""For a promise, of which half is for making it as wide as may be, where there is time for that."""
GROWTH_SECONDS = 0.002
"""Where an answer is awaited, no promise is made wider after this, but for a new one, once."""


class SliceForecaster(Forecaster):
    """Forecasts by a solver and by slices.

    Raises:
        UnsupportedError: if the plan cannot be encoded.
        InputError: if its network has no schedule.
    """

    def __init__(self, followed: FollowedPlan) -> None:
        super().__init__(followed)
        plan, is_rest = followed.plan, followed.running is not None
        self._encoding = RelationalEncoding(plan, followed.epsilon)
        terms, places = self._encoding.terms, self._encoding.places
        forward = [terms.at_least(places[step.end] - places[step.start]) for step in plan.instances if step.durative]
        self._valid = [*self._encoding.valid_formulas(self._encoding.obligations), *forward]
        self._open_session({})
        self._box = Box.nominal(plan.parameters)
        self._stnu = boxes.parametric_stnu(plan, self._box)
        self._tables, _ = dispatch_network(self._stnu, self._box, Dreex())
        self._order = {point: low for point, (low, _) in first_windows(self._stnu, self._box).items()}
        self._stnu = self._stnu.without_implied_orders(self._order)
        self._last: PlanForecast | None = None
        self._last_asked: tuple[Mapping[model.TimePoint, Fraction], Fraction, Fraction] | None = None
        self._is_widened = False
        self._seconds = LATER_SECONDS if is_rest else REGION_SECONDS
        if not is_rest:
            self._waits_for, self._as_planned  # noqa: B018 - worked out before the execution begins
            self._promise(self._happened, replace(self._patient_slices, seconds=FIRST_SECONDS))

    @cached_property
    def _slices(self) -> Slices:
        """The envelope; else the part of it that was found in time, and a box, which is found sooner."""
        deadline = Deadline.after(self._seconds)
        seconds, epsilon = self._seconds and self._seconds / 2, self._encoding.epsilon
        search = RegionSearch(self._plan, epsilon=epsilon, timeout=seconds).run()

        def box() -> Box:
            found = ExactSearch(self._encoding, deadline=deadline).run()
            return found.box if found.verified else self._box

        return Slices(self._plan.parameters, *sliceable(search, box), self._stnu, SLICE_SECONDS, GROWTH_SECONDS)

    @cached_property
    def _patient_slices(self) -> Slices:
        return replace(self._slices, growth=None)

    @cached_property
    def _lengths(self) -> Mapping[str, tuple[model.TimePoint, model.TimePoint, Fraction]]:
        """The points whose distance is a parameter, or that much longer, by parameter."""
        found: dict[str, tuple[model.TimePoint, model.TimePoint, Fraction]] = {}
        for item in self._plan.constraints:
            if item.lower is not None and item.lower == item.upper:
                names = [str(known) for known in item.lower.variables]
                if len(names) == 1 and dict(item.lower.coefficients()) == {model.ParameterReference(names[0]): 1}:
                    found.setdefault(names[0], (item.source, item.target, item.lower.constant_term))
        return found

    def order(self, point: model.TimePoint) -> Fraction:
        """When a point happens in the earliest schedule."""
        return self._order[point]

    def pass_time(self, now: Fraction) -> None:
        """What has not happened does not happen before."""
        if now < self._now:
            self._forget()
        self._now = now

    def _forget(self) -> None:
        """What boxes met, and that nothing is left, goes on to hold while more happens; here something did not."""
        self._met: list[boxes.Obstruction] = []
        self._is_nothing_left = False

    # -- what is ahead -------------------------------------------------------------------------------------------------

    def look(self, time: Fraction, deadline: Deadline, *, widening: bool = False) -> PlanForecast:
        """The forecast at a time; what is not found by the deadline is as it was promised last.

        With `widening`, promises become as wide as there is time for, and not only as wide as is found at once.
        """
        times = self._happened
        asked = times, self._now, time
        if self._last is not None and self._last_asked == asked and (not widening or self._is_widened):
            return self._last
        expected = [formula for step, formula in self._as_planned.items() if self._known(step).end is None]
        try:
            self._state(times)
            still = self._not_before_now(times)
            if self._is_possible([*still, *expected], deadline):
                prospect = Prospect.ON_TRACK
            elif self._is_possible(still, deadline):
                prospect = Prospect.AT_RISK
            else:
                return PlanForecast(Prospect.BROKEN, self._reasons(times, deadline))
        except OutOfTimeError:
            return self._last or PlanForecast(Prospect.UNDECIDED)
        slices, idle = (self._patient_slices, deadline.idle) if widening else (self._slices, None)
        promised, network = self._promise(times, slices, idle)
        steps = self._windows(times, network, self._box if promised is None else promised)
        promise = (
            None
            if promised is None
            else {
                self._lasting[name]: (promised[name].lower or Fraction(0), promised[name].upper) for name in self._open
            }
        )
        reasons = (
            () if prospect is Prospect.ON_TRACK else ("no durations are left of which all are at least as planned",)
        )
        happened = frozenset(times)
        free = frozenset(s for s in steps if self._known(s).start is None and self._waits_for[s] <= happened)
        ready = frozenset(step for step in free if steps[step].start[0] <= time)
        self._last = PlanForecast(prospect, reasons, steps, ready, free, promise, exact=False)
        self._last_asked, self._is_widened = asked, widening
        return self._last

    @cached_property
    def _waits_for(self) -> Mapping[str, frozenset[model.TimePoint]]:
        """What has to have happened before each step."""
        tables = self._tables
        blockers = {step.identifier: tables.blockers[tables.index[step.start]] for step in self._plan.instances}
        points = ((step, (tables.points[number] for number in known)) for step, known in blockers.items())
        return {step: frozenset(p for p in known if p.instance is not None) for step, known in points}

    @property
    def _open(self) -> list[str]:
        """The parameters that are durations of steps that have not ended."""
        names = self._plan.nominal
        return [name for name, step in self._lasting.items() if name in names and self._known(step).end is None]

    def _open_session(self, times: Mapping[model.TimePoint, Fraction]) -> None:
        """A session that holds the plan, and what has happened."""
        self._forget()
        self._session = Session(self._encoding.terms)
        self._session.add(*self._valid, *self._facts(times))
        self._stated = dict(times)

    def _state(self, times: Mapping[model.TimePoint, Fraction]) -> None:
        """Tell the solver what has happened since; all of it, if something that it was told was wrong."""
        if any(times.get(point) != time for point, time in self._stated.items()):
            self._open_session(times)
            return
        new = {point: time for point, time in times.items() if point not in self._stated}
        self._session.add(*self._facts(new))
        self._stated |= new

    def _facts(self, times: Mapping[model.TimePoint, Fraction]) -> list[Formula]:
        terms, places = self._encoding.terms, self._encoding.places
        return [terms.equal(places[point] - constant(time)) for point, time in times.items()]

    def _not_before_now(self, times: Mapping[model.TimePoint, Fraction]) -> list[Formula]:
        """That points still happen, where the plan does not already have them after others of these."""
        terms, places = self._encoding.terms, self._encoding.places
        still = {p for p in self._plan.time_points if p not in times and p != model.ZERO and p.time is None}
        later = {second for first, second in self._orders if first in still and second in still}
        return [terms.at_least(places[point] - constant(self._now)) for point in still - later]

    @cached_property
    def _orders(self) -> Sequence[tuple[model.TimePoint, model.TimePoint]]:
        """Pairs of points of which the second is never before the first; no circles."""
        order = self._order
        found = [(step.start, step.end) for step in self._plan.instances if step.durative]
        for item in self._plan.constraints:
            ways = (item.source, item.target, item.lower, 1), (item.target, item.source, item.upper, -1)
            for first, second, bound, sign in ways:
                if bound is not None and bound.is_constant and sign * bound.constant_term >= 0:
                    found.append((first, second))
        return [(a, b) for a, b in found if (order[a], a) < (order[b], b)]

    @cached_property
    def _as_planned(self) -> Mapping[str, Formula]:
        """That steps take as long as planned, or longer."""
        terms, names = self._encoding.terms, [name for name in self._lasting if name in self._plan.nominal]
        steps = ((self._lasting[name], variable(model.ParameterReference(name))) for name in names)
        return {step: terms.at_least(length - constant(self.planned[step])) for step, length in steps}

    def _is_possible(self, facts: Sequence[Formula], deadline: Deadline) -> bool:
        with self._session.frame(self._encoding.terms.conjunction(facts)):
            return satisfiable(self._session, "possible", deadline)

    def _reasons(self, times: Mapping[model.TimePoint, Fraction], deadline: Deadline) -> tuple[str, ...]:
        """What contradicts what has happened: bounds of the network, or else the first obligation that cannot be kept
        together with those before it.
        """
        chain = self._contradicting_bounds(times)
        if chain:
            return chain
        encoding, terms = self._encoding, self._encoding.terms
        session = Session(terms)
        session.add(*self._facts(times), *self._not_before_now(times), *encoding.network_formulas())
        if session.check("possible", deadline) is not Satisfiability.SATISFIABLE:
            return (NO_SCHEDULE,)
        known = [
            (each.name, terms.negation(each.violation)) for each in encoding.obligations if each.violation is not None
        ]
        session.add(*encoding.definitions(formula for _, formula in known))
        kept, low, high = 0, 0, len(known)
        while low < high and not deadline.passed:
            middle = (low + high) // 2
            more = terms.conjunction(formula for _, formula in known[kept:middle])
            with session.frame(more):
                is_kept = session.check("possible", deadline) is not Satisfiability.UNSATISFIABLE
            if is_kept:
                session.add(more)
                kept, low = middle, middle + 1
            else:
                high = middle
        return (known[high - 1][0],) if 0 < high <= len(known) and low == high else (NO_SCHEDULE,)

    def _contradicting_bounds(self, times: Mapping[model.TimePoint, Fraction]) -> tuple[str, ...]:
        """Bounds of the network that cannot be kept, whatever values parameters have, in the order of time."""
        network = self._encoding.network
        known = [(each, w) for each in network.differences if (w := least(each.weight, network.ranges)) is not None]
        bounds = [(each.source, each.target, weight) for each, weight in known]
        bounds += [(model.ZERO, point, times.get(point, self._now)) for point in self._plan.time_points[1:]]
        bounds += [(point, model.ZERO, -time) for point, time in times.items()]
        scale = lcm(*(weight.denominator for *_, weight in bounds))
        place = {point: number for number, point in enumerate(self._plan.time_points)}
        scaled = [(place[source], place[target], int(weight * scale)) for source, target, weight in bounds]
        cycle = DifferenceNetwork(len(place), scaled).cycle
        numbers = [] if cycle is None else [number for number in cycle.origins if number < len(known)]
        return tuple(dict.fromkeys("; ".join(known[number][0].origins) for number in numbers))

    # -- promises and windows ------------------------------------------------------------------------------------------

    def _promise(
        self, times: Mapping[model.TimePoint, Fraction], slices: Slices, idle: Callable[[], bool] | None = None
    ) -> tuple[Box | None, boxes.ParametricStnu]:
        """A box that is promised, None if there is none, and the network of what is left."""
        happened = {model.ZERO: Fraction(0), **times}
        seen, possible = {}, {}
        for name, (source, target, offset) in self._lengths.items():
            if source in happened:
                length = happened.get(target, self._now) - happened[source] - offset
                possible[name] = Interval(length, length if target in happened else None)
            if source in happened and target in happened:
                seen[name] = possible[name]
        facts = Observations(self._now, seen, frozenset(seen), possible, happened)
        if self._is_nothing_left:
            return None, continued(self._stnu, facts)
        remainder, network = slices.after(facts, "", self._box, self._met, idle)
        self._is_nothing_left = remainder.answer is SliceAnswer.NOTHING
        if remainder.answer is SliceAnswer.PROMISED and remainder.box is not None:
            self._box = remainder.box
            return self._box, network
        return None, network

    def _windows(
        self, times: Mapping[model.TimePoint, Fraction], network: boxes.ParametricStnu, box: Box
    ) -> dict[str, StepAhead]:
        """Windows of a dispatcher under a box; only lower bounds where no schedule is left for some of its values."""
        lower: Mapping[model.TimePoint, Window] = {}
        with suppress(InputError):
            lower = first_windows(network, box)
        most = {self._lasting[name]: box[name].upper for name in self._open}
        found = {}
        for instance in self._plan.instances:
            known = self._known(instance.identifier)
            if known.end is None:
                start, end = (lower.get(p, (times.get(p, self._now), None)) for p in (instance.start, instance.end))
                found[instance.identifier] = StepAhead(start, end, most.get(instance.identifier))
        return found
