"""What is ahead of a plan that runs, by shortest paths (:mod:`robust.irr.proposals`).

The network, what its obligations demand of times, and what nature chooses are one network of points, three times over.
Of what is *possible*, durations that are parameters may be anything that is declared: if that has no schedule
with what has happened, no continuation in the plan's order succeeds, however kind nature is. As *expected*, steps take
at least as long as planned. As *promised*, steps that have not ended take as long as a box allows: an end is as late as
the box has it, and a step that has to wait for something at its end starts so late that it does even if it is short.
Starts that keep to this are in time whatever lengths the box has, so the box is a promise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from heapq import heappop, heappush
from math import floor, lcm

from robust.execute.messages import StepProgress, time_text
from robust.irr.proposals import DECLARED, SlackPlan
from robust.network.differences import UNBOUNDED, Bound, DifferenceNetwork, delay, following, strong_components
from robust.network.live import LiveNetwork
from robust.network.slack import FaceNumber, OutsideFragmentError
from robust.plan import model
from robust.presented import VerdictEnum
from robust.smt.limits import Deadline

TICKS = 10**6
"""Times on clocks are in millionths of a unit, so that networks need not be written anew for them."""
FINEST = 1 << 200
"""Parts of a unit, in which all times together can be said."""
MOST = Fraction(10)
"""By how much of what is planned promises go beyond it, at most."""


class Prospect(VerdictEnum):
    """What is ahead of a plan that runs."""

    ON_TRACK = "on track"
    """It succeeds if steps take as long as planned."""
    AT_RISK = "at risk"
    """It succeeds only if some steps take less time than planned."""
    UNDECIDED = "undecided"
    """Nothing is left in the plan's order, and it is not known in time whether another one succeeds."""
    BROKEN = "broken"
    """No continuation of these steps succeeds."""
    DONE = "done"
    """All has happened as the plan allows."""


Window = tuple[Fraction, Fraction | None]
"""The least and the greatest value; None is no limit."""
OPEN = {Prospect.ON_TRACK, Prospect.AT_RISK}


@dataclass(frozen=True, slots=True)
class StepAhead:
    """When a step that has not ended starts and ends, and how long it may take in all; None is no limit."""

    start: Window
    end: Window
    most: Fraction | None


@dataclass(frozen=True, slots=True)
class PlanForecast:
    """What is ahead: of each step that has not ended, which may start now, and what durations are promised.

    `free` are the steps whose starts wait for nothing but time: those that may start now, and some that may later.
    `exact` says whether windows are all that is left, or only the promised part of it, `pending` whether other orders
    have not been looked for yet.
    """

    prospect: Prospect
    reasons: tuple[str, ...] = ()
    steps: Mapping[str, StepAhead] | None = None
    ready: frozenset[str] = frozenset()
    free: frozenset[str] = frozenset()
    promise: Mapping[str, Window] | None = None
    exact: bool = True
    pending: bool = False


@dataclass(frozen=True, slots=True)
class FollowedPlan:
    """A plan that is followed while it is executed, or what is left of one.

    Attributes:
        plan: the plan.
        epsilon: the separation of mutex time points.
        lasting: the steps of which parameters are durations, by parameter.
        planned: how long they take as planned, by step; as their parameters have it if not given.
        running: of what is left of a plan, the steps that run: their starts are behind, and in the plan they begin now.
    """

    plan: model.ParametrizedPlan
    epsilon: Fraction
    lasting: Mapping[str, str]
    planned: Mapping[str, Fraction] = field(default_factory=dict)
    running: Mapping[str, StepProgress] | None = None


class Forecaster(ABC):
    """Forecasts what is ahead of a plan while it is executed."""

    def __init__(self, followed: FollowedPlan) -> None:
        self._plan = followed.plan
        self._lasting = followed.lasting
        self._planned_else = followed.planned
        self._progress: dict[str, StepProgress] = dict(followed.running or {})
        self._begun = frozenset(self._progress)
        self._now = Fraction(0)
        starts = {self._plan.instance[step].start for step in self._begun}
        fixed = (item for item in self._plan.constraints if item.source == model.ZERO and item.target in starts)
        self._behind = {item.target: item.lower.constant_term for item in fixed if item.lower is not None}
        """When starts that were behind when this began are in the plan."""

    @cached_property
    def planned(self) -> Mapping[str, Fraction]:
        """Planned durations; of steps whose duration is no parameter, by the schedule that orders the plan."""
        length = {s.identifier: self.order(s.end) - self.order(s.start) for s in self._plan.instances}
        nominal = {self._lasting[name]: v for name, v in self._plan.nominal.items() if name in self._lasting}
        return {step: self._planned_else.get(step, time) for step, time in (length | nominal).items()}

    def follow(self, step: str, known: StepProgress) -> None:
        """How far a step is now."""
        self._progress[step] = known

    @abstractmethod
    def pass_time(self, now: Fraction) -> None:
        """What has not happened does not happen before."""

    @abstractmethod
    def order(self, point: model.TimePoint) -> Fraction:
        """When a point happens in the schedule that orders the plan."""

    @abstractmethod
    def look(self, time: Fraction, deadline: Deadline, *, widening: bool = False) -> PlanForecast:
        """The forecast at a time; what is not found by the deadline is as it was promised last.

        With `widening`, promises become as wide as there is time for, and not only as wide as is found at once.
        """

    def _known(self, step: str) -> StepProgress:
        return self._progress.get(step, _NOT_BEGUN)

    def _moments(self, step: str) -> Mapping[model.TimePoint, Fraction]:
        """When the points of a step happened, without a start that was behind when this began."""
        instance = self._plan.instance[step]
        times = self._known(step).times(instance)
        return {point: time for point, time in times.items() if step not in self._begun or point != instance.start}

    @property
    def _happened(self) -> dict[model.TimePoint, Fraction]:
        """When points happened."""
        times = dict(self._behind)
        for step in self._progress:
            times |= self._moments(step)
        return times


_NOT_BEGUN = StepProgress()


class PathForecaster(Forecaster):
    """Forecasts by shortest paths.

    Raises:
        OutsideFragmentError: if shortest paths do not decide about the plan.
    """

    def __init__(self, followed: FollowedPlan) -> None:
        super().__init__(followed)
        self._slack = SlackPlan(followed.plan, followed.epsilon)
        self._number = {point: number for number, point in enumerate(self._plan.time_points)}
        self._scale = lcm(self._slack.scale, TICKS, *(room.denominator for room, _ in self._limits.values()))
        self._write()

    # -- the networks --------------------------------------------------------------------------------------------------

    @cached_property
    def _limits(self) -> Mapping[tuple[FaceNumber, bool], tuple[Fraction, str]]:
        """How far faces may move, in units of the slack plan, and what says so; whether it is only declared."""
        limits: dict[tuple[FaceNumber, bool], tuple[Fraction, str]] = {}
        for form in self._slack.forms:
            if len(form.factors) > 1:
                raise OutsideFragmentError(f"{form.name!r} is about several durations")
            ((face, slope),) = form.factors.items()
            key, limit = (face, form.name == DECLARED), (form.budget / slope, form.name)
            limits[key] = min(limit, limits.get(key, limit))
        return limits

    @cached_property
    def _step_of(self) -> Mapping[FaceNumber, str]:
        """The step of whose duration a face is an end."""
        uses: dict[FaceNumber, set[frozenset[int]]] = {}
        for bound in self._slack.bounds:
            if bound.face is not None:
                uses.setdefault(bound.face, set()).add(frozenset((bound.source, bound.target)))
        for number, parameter in enumerate(self._plan.parameters):
            if parameter.name not in self._lasting or any(len(uses.get(2 * number + k, ())) > 1 for k in (0, 1)):
                raise OutsideFragmentError(f"{parameter.name} is not the duration of one step")
        return {face: self._lasting[self._plan.parameters[face >> 1].name] for face in uses}

    def _write(self) -> None:
        """All bounds, in ticks of which as many are a unit as `_scale` says."""
        factor = self._scale // self._slack.scale
        self._bounds: list[_LiveBound] = []
        self._links: list[tuple[int, int, int, str]] = []
        for bound in self._slack.bounds:
            ends, origin = (bound.source, bound.target), bound.origin
            if bound.face is None:
                self._bounds.append(_LiveBound((*ends, bound.weight * factor), origin))
                continue
            step = self._step_of[bound.face]
            for declared in (True, False):
                if (bound.face, declared) in self._limits:
                    room, said = self._limits[bound.face, declared]
                    owner = step if declared else None
                    self._bounds.append(_LiveBound((*ends, int((bound.weight - room) * factor)), said, owner))
            if not bound.face & 1:
                offset = bound.weight * factor - int(self._plan.parameters[bound.face >> 1].nominal * self._scale)
                said = f"{step} takes as long as planned, {time_text(self.planned[step])}"
                weight = offset + self._ticks(self.planned[step])
                self._bounds.append(_LiveBound((*ends, weight), said, step, expected=True))
                self._links.append((*ends, offset, step))
        for demand in self._slack.requirements(exact=True):
            said = "; ".join(dict.fromkeys(demand.names))
            self._bounds.append(_LiveBound((demand.source, demand.target, demand.weight * factor), said))
        ended = set(self._ended)
        counting = [each for each in self._bounds if each.step not in ended]
        now = self._times(), self._ticks(self._now)
        order = self._slack.times
        self._possible = LiveNetwork(order, [(each.bound, each.step) for each in counting if not each.expected], *now)
        self._expected = LiveNetwork(order, [(each.bound, each.step) for each in counting], *now)
        self._promise: dict[str, tuple[int, int]] = {}
        self._planned_ticks = {step: self._ticks(length) for step, length in self.planned.items()}
        self._bounds_of_lengths = self._declared()

    @property
    def _ended(self) -> list[str]:
        return [step for step, known in self._progress.items() if known.end is not None]

    def _ticks(self, time: Fraction) -> int:
        return floor(time * self._scale)

    def _times(self) -> dict[int, int]:
        """What has happened, and when timed literals come, in ticks."""
        times = {self._number[literal.point]: self._ticks(literal.time) for literal in self._plan.timed_literals}
        return times | {self._number[point]: self._ticks(time) for point, time in self._happened.items()}

    # -- what happens --------------------------------------------------------------------------------------------------

    def follow(self, step: str, known: StepProgress) -> None:
        """How far a step is now; networks become finer if they are too coarse for its times."""
        before = self._known(step)
        super().follow(step, known)
        finer = lcm(self._scale, *(time.denominator for time in (known.start, known.end) if time is not None))
        if finer != self._scale or before.start not in (None, known.start) or before.end not in (None, known.end):
            self._scale = finer
            self._write()
            return
        for point, time in self._moments(step).items():
            number = self._number[point]
            for network in self._networks:
                if number not in network.times:
                    network.happen(number, self._ticks(time), step if known.end is not None else None)

    @property
    def _networks(self) -> Iterable[LiveNetwork]:
        return self._possible, self._expected

    def pass_time(self, now: Fraction) -> None:
        """What has not happened does not happen before."""
        earlier, self._now = self._now, now
        if now < earlier:
            self._write()
        for network in self._networks:
            network.lift(self._ticks(now))

    def order(self, point: model.TimePoint) -> Fraction:
        """When a point happens in the schedule that the plan is judged by."""
        return Fraction(self._slack.times[self._number[point]], self._slack.scale)

    # -- what is ahead -------------------------------------------------------------------------------------------------

    def look(self, time: Fraction, deadline: Deadline, *, widening: bool = False) -> PlanForecast:
        """The forecast at a time; a promise that has to be looked for is, up to the deadline, and is the widest."""
        if not self._possible.open:
            return PlanForecast(Prospect.BROKEN, tuple(self._reasons(expected=False)))
        on_track = self._expected.open
        network = self._expected if on_track else self._possible
        steps, ready, free = {}, [], []
        for instance in self._plan.instances:
            name, known = instance.identifier, self._progress.get(instance.identifier, _NOT_BEGUN)
            if known.end is not None:
                continue
            begin, end = self._number[instance.start], self._number[instance.end]
            least, most = network.window(begin), network.window(end)
            longest = self._longest(network, begin, end)
            if name in self._begun and known.start is not None and longest is not None:
                longest += Fraction(network.earliest[begin], self._scale) - known.start
            steps[name] = StepAhead(self._window(least), self._window(most), longest)
            if known.start is None:
                happened = self._possible.times
                if all(point in happened for point in self._waits_for[begin]):
                    free.append(name)
                    if self._possible.earliest[begin] <= self._ticks(time):
                        ready.append(name)
        promise = self._find_promise(deadline) if on_track else None
        reasons = () if on_track else tuple(self._reasons(expected=True))
        prospect = Prospect.ON_TRACK if on_track else Prospect.AT_RISK
        return PlanForecast(prospect, reasons, steps, frozenset(ready), frozenset(free), promise)

    def _window(self, window: tuple[int, int | None]) -> Window:
        low, high = window
        return Fraction(low, self._scale), None if high is None else Fraction(high, self._scale)

    def _longest(self, network: LiveNetwork, begin: int, end: int) -> Fraction | None:
        """How long a step may take: by what keeps its end near its start, or by when it starts and has to end."""
        latest = network.latest[end]
        most = latest - network.earliest[begin]
        if begin not in network.times and self._component[begin] == self._component[end] and begin != end:
            reach = network.latest[end] - network.earliest[end]
            most -= reach - self._distance(network, end, begin, reach)
        return None if most > UNBOUNDED // 2 else Fraction(most, self._scale)

    @cached_property
    def _component(self) -> Sequence[int]:
        """Points that bounds lead to and fro between, without zero, have one number."""
        steps: list[list[int]] = [[] for _ in self._slack.times]
        for source, target, _ in (each.bound for each in self._bounds):
            if source and target:
                steps[source].append(target)
        return strong_components(steps)

    def _distance(self, network: LiveNetwork, source: int, target: int, most: int) -> int:
        """The least slack of a path between two points of a component [Dijkstra]; `most` if it is not less."""
        component, earliest = self._component, network.earliest
        heap, done = [(0, source)], set[int]()
        while heap and heap[0][0] < most:
            slack, point = heappop(heap)
            if point == target:
                return slack
            if point not in done:
                done.add(point)
                for other, weight in network.following(point):
                    if component[other] == component[source]:
                        heappush(heap, (slack + earliest[other] - earliest[point] - weight, other))
        return most

    @cached_property
    def _waits_for(self) -> Mapping[int, Sequence[int]]:
        """The points of steps before each point, as bounds say, unless both are at one time."""
        before: dict[int, set[int]] = {number: set() for number in self._number.values()}
        for source, target, weight in (each.bound for each in self._bounds):
            if weight >= 0 and self._plan.time_points[source].instance is not None:
                before[target].add(source)
        return {point: [a for a in others if point not in before[a]] for point, others in before.items()}

    def _reasons(self, *, expected: bool) -> Sequence[str]:
        """What contradicts itself, in the order of time, as far as it is not just what has happened."""
        ended = set(self._ended)
        counting = [each for each in self._bounds if each.step not in ended and (expected or not each.expected)]
        cycle = DifferenceNetwork(len(self._slack.times), [*(each.bound for each in counting), *self._facts()]).cycle
        origins = (number for number in cycle.origins if number < len(counting)) if cycle is not None else ()
        return list(dict.fromkeys(counting[number].origin for number in origins))

    def _facts(self) -> list[Bound]:
        times, now = self._possible.times, self._ticks(self._now)
        bounds: list[Bound] = [(0, point, times.get(point, now)) for point in range(1, len(self._slack.times))]
        return [*bounds, *((point, 0, -time) for point, time in times.items())]

    def demands(self) -> Iterator[tuple[int, int, Fraction, str | None]]:
        """Source and target of each distance that is demanded if anything is to be left, the least that it may be, and
        the step whose duration is part of it; what has happened counts from zero, and nothing more happens before now.
        """
        ended, times = set(self._ended), self._possible.times
        links = [(source, target, offset, step) for source, target, offset, step in self._links if step not in ended]
        every = (each for each in self._bounds if not each.expected and each.step not in ended)
        for source, target, weight, step in (*links, *((*each.bound, None) for each in every)):
            distance = weight + times.get(source, 0) - times.get(target, 0)
            a, b = (0 if point in times else point for point in (source, target))
            if a or b:
                yield a, b, Fraction(distance, self._scale), step
        for point in range(1, len(self._slack.times)):
            if point not in times:
                yield 0, point, self._now, None

    def lengths(self, step: str) -> Window:
        """Where the duration of a step has to be, as far as it is declared or demanded for itself alone."""
        return self._window(self._bounds_of_lengths[step])

    # -- promises ------------------------------------------------------------------------------------------------------

    def _find_promise(self, deadline: Deadline) -> Mapping[str, Window] | None:
        """The widest promise that is equally wide relative to plans; None if there is none, or not in time."""
        share = MOST
        while not deadline.passed:
            bounds = self._stretched(share)
            narrower = self._narrower(share, bounds)
            if narrower is None:
                return {step: self._window(lengths) for step, lengths in self._promise.items()}
            if not 0 <= narrower < share:
                return None
            share = narrower
        return None

    def _lasted(self, step: str) -> int:
        """How long a step has taken by now, in ticks."""
        known = self._known(step)
        if known.start is None:
            return 0
        return max(0, self._ticks((self._now if known.end is None else known.end) - known.start))

    def _declared(self) -> Mapping[str, tuple[int, int | None]]:
        """Where the lengths of steps have to be, in ticks."""
        found = {}
        for number, parameter in enumerate(self._plan.parameters):
            ends: list[int | None] = []
            for face in (2 * number, 2 * number + 1):
                known = [self._limits[face, said][0] for said in (True, False) if (face, said) in self._limits]
                room = min(known) / self._slack.scale if known else None
                ends.append(None if room is None else self._ticks(parameter.nominal + (room if face & 1 else -room)))
            found[self._lasting[parameter.name]] = max(0, ends[0] or 0), ends[1]
        return found

    def _stretched(self, share: Fraction) -> list[_PromisedBound]:
        """The bounds of a promise that goes beyond the plan by a share of it."""
        self._promise = {}
        more, of = share.numerator, share.denominator
        links: dict[int, tuple[int, int, int]] = {}
        bounds: list[_PromisedBound] = []
        for source, target, offset, step in self._links:
            if self._known(step).end is not None:
                continue
            planned, lasted = self._planned_ticks[step], self._lasted(step)
            least, most = self._bounds_of_lengths[step]
            likely = max(planned, lasted)
            shorter, high = planned - planned * more // of, likely + likely * more // of
            low = max(shorter, least, lasted)
            rising = most is None or high <= most
            if most is not None:
                high = min(high, max(most, low))
            self._promise[step] = low, high
            links[target] = source, offset + low, planned if low == shorter else 0
            bounds.append(((source, target, offset + high), likely if rising else 0))
        for each in self._bounds:
            source, target, weight = each.bound
            if each.step is not None:
                continue
            start, low, slope = links.get(target, (source, 0, 0))
            if start == source:
                bounds.append((each.bound, 0))
            elif start or source:
                bounds.append(((source, start, weight - low), slope))
        return bounds

    def _narrower(self, share: Fraction, bounds: Sequence[_PromisedBound]) -> Fraction | None:
        """A share at which a contradiction is none [Newton]; None if there is no contradiction; −1 if it stays."""
        every = [*(bound for bound, _ in bounds), *self._facts()]
        times = list(self._expected.earliest)
        cycle = delay(times, following(len(times), every), sorted(range(len(times)), key=times.__getitem__))
        if cycle is None:
            return None
        excess = sum(every[number][2] for number in cycle.origins)
        slope = sum(bounds[number][1] for number in cycle.origins if number < len(bounds))
        return share - Fraction(excess, slope) if slope else Fraction(-1)


_PromisedBound = tuple[Bound, int]
"""A bound, and how it grows with the share that a promise goes beyond the plan."""


@dataclass(frozen=True, slots=True)
class _LiveBound:
    """A bound in ticks and what says so; `step`: of whose duration it is declared or, if `expected`, planned, so that
    it no longer counts once the step has ended."""

    bound: Bound
    origin: str
    step: str | None = None
    expected: bool = False
