"""Messages that cannot be what they claim: numbers that are none, names that nobody knows."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from enum import Enum
from fractions import Fraction
from math import lcm

from robust.errors import did_you_mean
from robust.execute.controllability.strong import ParametricLink
from robust.execute.dispatch.messages import (
    Completed,
    Contradicted,
    Decision,
    Dispatch,
    Ending,
    Failed,
    Finish,
    LeftBox,
    Message,
    Missed,
    Observation,
    Observed,
    Rejected,
    Started,
    StateEstimate,
    Succeeded,
    Unobserved,
)
from robust.execute.dispatch.network import DispatchNetwork, NaturalLink, Tables
from robust.execute.dispatch.prepare import Dispatchable, Means
from robust.numbers import format_number
from robust.plan.model import (
    ZERO,
    ActionInstance,
    Comparison,
    Condition,
    Duration,
    Fluent,
    TimePoint,
    TimePointKind,
    Timing,
)
from robust.plan.timeline import Reading, State, leaves


def is_exact(number: object) -> bool:
    """Whether it is a number without rounding: floats, NaN among them, and texts are not."""
    return isinstance(number, Fraction | int) and not isinstance(number, bool)


def flaw(message: Message, dispatchable: Dispatchable) -> str | None:
    """What is wrong with a message by itself, in one line; None if nothing is."""
    match message:
        case Started() | Completed() | Failed():
            return _bad_time(message.time) or _unknown("instance", message.instance, dispatchable.plan.instance)
        case Observed(parameter, value):
            number = None if is_exact(value) else f"found {value!r} for {parameter!r}, expected an exact number"
            return _unknown("parameter", parameter, dispatchable.box.intervals) or number
        case StateEstimate(time):
            return _bad_time(time)
    return f"found {type(message).__name__}, expected a message"


def _bad_time(time: object) -> str | None:
    return None if is_exact(time) else f"found time {time!r}, expected an exact number"


def _unknown(kind: str, name: str, known: Collection[str]) -> str | None:
    return None if name in known else f"found {kind} {name!r}, expected one of the plan{did_you_mean(name, known)}"


def in_order(messages: Sequence[Message]) -> list[Message]:
    """Events by their time, starts first, then what is known about states and levels: they may arrive in any order."""

    def key(message: Message) -> tuple[int, Fraction, int]:
        match message:
            case Started(_, time) if is_exact(time):
                return 0, Fraction(time), 0
            case Completed(_, time) | Failed(_, time) if is_exact(time):
                return 0, Fraction(time), 1
            case _:
                return 1, Fraction(0), 0

    return sorted(messages, key=key)


def unmet(
    instance: ActionInstance, estimate: StateEstimate, parameters: Mapping[str, Fraction], *, numbers: bool
) -> str | None:
    """The first condition at the start of an instance that does not hold in a state, as it is written in PDDL.

    Conditions on `?duration`, on fluents that the estimate has no value of and, unless `numbers` is given, on any
    fluents are passed over: nothing contradicts them.
    """
    reading = Reading(State(estimate.atoms, estimate.fluents), parameters)
    for part in instance.conditions:
        readable = part.timing is Timing.AT_START and _is_readable(part.condition, estimate, numbers=numbers)
        if readable and not reading.holds(part.condition):
            return f"{part.text} does not hold"
    return None


def _is_readable(condition: Condition, estimate: StateEstimate, *, numbers: bool) -> bool:
    for leaf in leaves(condition):
        if isinstance(leaf, Comparison):
            fluents = [one for one in leaf.expression.variables if isinstance(one, Fluent)]
            if any(isinstance(one, Duration) for one in leaf.expression.variables):
                return False
            if fluents and (not numbers or not estimate.fluents.keys() >= set(fluents)):
                return False
    return True


class Windows:
    """The windows of one execution; time points are numbered as in the network. Arithmetic is in integers, exactly."""

    def __init__(self, network: DispatchNetwork, denominator: int = 1) -> None:
        self.network = network
        self._tables: Tables = network.scaled(denominator)
        self._times: dict[int, int] = {}
        size = len(network.points)
        self._lower = [0] * size
        self._upper: list[int | None] = [None] * size
        self._cause: list[int | None] = [None] * size
        self._blockers = [set(blockers) for blockers in network.blockers]
        self._blocked: list[list[int]] = [[] for _ in range(size)]
        for point, blockers in enumerate(self._blockers):
            for blocker in blockers:
                self._blocked[blocker].append(point)
        self._waits: list[list[int]] = [[] for _ in range(size)]
        for number, wait in enumerate(self._tables.waits):
            self._waits[wait.point].append(number)

    # -- what has happened -------------------------------------------------------------------------------------------

    def happened(self, point: int, time: Fraction) -> None:
        """A time point has happened; its time need not be in its window."""
        ticks = self._ticks(time)
        self._times[point] = ticks
        for other, weight in self._tables.above[point]:
            latest = ticks + weight
            known = self._upper[other]
            if known is None or latest < known:
                self._upper[other] = latest
                self._cause[other] = point
        for other, weight in self._tables.below[point]:
            self._lower[other] = max(self._lower[other], ticks + weight)
        for other in self._blocked[point]:
            self._blockers[other].discard(point)

    def has_happened(self, point: int) -> bool:
        return point in self._times

    def time(self, point: int) -> Fraction | None:
        """When a time point happened."""
        ticks = self._times.get(point)
        return None if ticks is None else Fraction(ticks, self._tables.scale)

    @property
    def times(self) -> dict[int, Fraction]:
        return {point: Fraction(ticks, self._tables.scale) for point, ticks in self._times.items()}

    # -- what may happen ---------------------------------------------------------------------------------------------

    def window(self, point: int) -> tuple[Fraction, Fraction | None]:
        """The least and the greatest time at which a time point may happen; None is never too late."""
        upper = self._upper[point]
        scale = self._tables.scale
        return Fraction(self._lower[point], scale), None if upper is None else Fraction(upper, scale)

    def is_late(self, point: int, now: Fraction) -> bool:
        """Whether its greatest time has passed."""
        return self.first_late((point,), now) is not None

    def first_late(self, points: Iterable[int], now: Fraction) -> int | None:
        """The first of these whose greatest time has passed."""
        ticks = self._ticks(now)
        for point in points:
            upper = self._upper[point]
            if upper is not None and upper < ticks:
                return point
        return None

    def first_empty(self, points: Iterable[int]) -> int | None:
        """The first of these that no time is left for."""
        for point in points:
            upper = self._upper[point]
            if upper is not None and upper < self._lower[point]:
                return point
        return None

    def first_ready(self, points: Iterable[int], now: Fraction) -> int | None:
        """The first of these that can be dispatched."""
        ticks = self._ticks(now)
        for point in points:
            ready = self._ready(point)
            if ready is not None and ready <= ticks:
                return point
        return None

    def next_moment(self, points: Iterable[int], now: Fraction, patience: Fraction) -> Fraction | None:
        """When the first of these becomes ready, or its greatest time plus `patience` comes, after now."""
        ticks, grace = self._ticks(now), self._ticks(patience)
        ticks = self._ticks(now)  # in the units that patience may have asked for
        found: int | None = None
        for point in points:
            ready, upper = self._ready(point), self._upper[point]
            for moment in (ready, None if upper is None else upper + grace):
                if moment is not None and moment > ticks and (found is None or moment < found):
                    found = moment
        return None if found is None else Fraction(found, self._tables.scale)

    def ready(self, point: int) -> Fraction | None:
        """From when on a time point can be dispatched, if nothing else happens; None if it waits for something."""
        ready = self._ready(point)
        return None if ready is None else Fraction(ready, self._tables.scale)

    def _ready(self, point: int) -> int | None:
        if self._blockers[point]:
            return None
        ready = self._lower[point]
        for number in self._waits[point]:
            wait = self._tables.waits[number]
            if wait.end in self._times:
                continue
            if wait.delay is None:
                return None
            ready = max(ready, self._times[wait.activation] + wait.delay)
        return ready

    def cause(self, point: int) -> int | None:
        """What its greatest time follows from."""
        return self._cause[point]

    def over(self, network: DispatchNetwork) -> Windows:
        """The same history in another network with the same time points."""
        fresh = Windows(network, self._tables.scale)
        for point, ticks in self._times.items():
            fresh.happened(point, Fraction(ticks, self._tables.scale))
        return fresh

    # -- units -------------------------------------------------------------------------------------------------------

    def _ticks(self, time: Fraction) -> int:
        if self._tables.scale % time.denominator:
            self._rescale(time.denominator)
        return time.numerator * (self._tables.scale // time.denominator)

    def _rescale(self, denominator: int) -> None:
        tables = self.network.scaled(lcm(self._tables.scale, denominator))
        factor = tables.scale // self._tables.scale
        self._times = {point: ticks * factor for point, ticks in self._times.items()}
        self._lower = _times(self._lower, factor)
        self._upper = [None if ticks is None else ticks * factor for ticks in self._upper]
        self._tables = tables


def _times(numbers: Iterable[int], factor: int) -> list[int]:
    return [number * factor for number in numbers]


class Phase(Enum):
    """What a dispatcher is doing."""

    DISPATCHING = "dispatching"
    DRAINING = "waiting for running actions"
    ENDED = "ended"


class Dispatcher:
    """One execution; see :class:`robust.execute.drive.Executive`.

    Args:
        dispatchable: the plan and its box.
        patience: how long after it is due an observation may arrive, above 0; by default the separation of mutex time
            points.
        drain: whether to wait for running actions when the plan is given up.
    """

    def __init__(self, dispatchable: Dispatchable, *, patience: Fraction | None = None, drain: bool = True) -> None:
        self.dispatchable = dispatchable
        self.phase = Phase.DISPATCHING
        self.ending: Ending | None = None
        """Why the plan was given up."""
        self.observed: dict[str, Fraction] = {}
        """The first value that was observed of each parameter."""
        self.observations: list[Observation] = []
        """All values that were taken note of."""
        self.rejected: list[Rejected] = []
        """All messages that changed nothing, although they should have."""
        self._patience = patience or dispatchable.epsilon or Fraction(1, 1000)
        self._drain = drain
        self._windows = Windows(dispatchable.network)
        self._points = dispatchable.network.points
        self._left = list(dispatchable.ours)
        self._literals = list(dispatchable.literals)
        self._open = {link.target: link for link in dispatchable.network.natural.values()}
        self._limits: dict[TimePoint, Fraction] = {}
        """By when what is waited for should have been reported."""
        self._seen: dict[tuple[str, str | None], Fraction] = {}
        self._due: dict[tuple[str, str | None], Fraction] = {}
        self._estimate: StateEstimate | None = None
        self._last_change = Fraction(0)
        self._failed: set[str] = set()
        self._now = Fraction(0)
        self._wake: Fraction | None = None
        self._begun = False

    # -- the executive -----------------------------------------------------------------------------------------------

    @property
    def wake(self) -> Fraction | None:
        return self._wake

    @property
    def ended(self) -> bool:
        return self.phase is Phase.ENDED

    def step(self, now: Fraction, messages: Sequence[Message] = ()) -> Sequence[Decision]:
        """Take note of messages, then decide; the decisions of one step are in the order in which they were made."""
        decisions: list[Decision] = []
        self._now = now
        if not self._begun:
            self._begun = True
            self._happen(ZERO, Fraction(0))
        for message in in_order(messages):
            if not self.ended:
                self._take(message, decisions)
        if self.phase is Phase.DISPATCHING:
            self._advance(decisions)
        if self.phase is Phase.DRAINING:
            self._drain_running(decisions)
        self._wake = None if self.ended else self._next_wake()
        return decisions

    # -- for those who look on ---------------------------------------------------------------------------------------

    @property
    def times(self) -> dict[TimePoint, Fraction]:
        """What has happened, and when."""
        return {self._points[number]: time for number, time in self._windows.times.items()}

    @property
    def running(self) -> tuple[str, ...]:
        """The instances that have started and not ended."""
        return tuple(one.identifier for one in self.dispatchable.plan.instances if self._is_running(one))

    def window(self, point: TimePoint) -> tuple[Fraction, Fraction | None]:
        """MinMaxDispatchTime: the least and the greatest time of a time point, as far as is known now."""
        return self._windows.window(self.dispatchable.network.index[point])

    # -- messages ----------------------------------------------------------------------------------------------------

    def _take(self, message: Message, decisions: list[Decision]) -> None:
        wrong = flaw(message, self.dispatchable)
        if wrong is None:
            match message:
                case Started(instance, time):
                    wrong = self._event(self.dispatchable.plan.instance[instance].start, Fraction(time), decisions)
                case Completed(instance, time):
                    wrong = self._event(self.dispatchable.plan.instance[instance].end, Fraction(time), decisions)
                case Failed():
                    wrong = self._fail(message, decisions)
                case Observed():
                    wrong = self._observe(message, decisions)
                case StateEstimate(time):
                    wrong = self._future(Fraction(time))
                    if wrong is None and (self._estimate is None or self._estimate.time <= time):
                        self._estimate = message
        if wrong is not None:
            self.rejected.append(Rejected(str(message), wrong, self._now))
            decisions.append(self.rejected[-1])

    def _future(self, time: Fraction) -> str | None:
        return f"found time {format_number(time)}, which is yet to come" if time > self._now else None

    def _event(self, point: TimePoint, time: Fraction, decisions: list[Decision]) -> str | None:
        """A time point that was not, or not only, the dispatcher's to choose; returns what is wrong with that."""
        number = self.dispatchable.network.index[point]
        known = self._windows.time(number)
        if known is not None:
            same = time == known
            return None if same else f"{point} has happened at {format_number(known)} already; the first time stands"
        if point.kind is TimePointKind.END and point.instance in self._failed:
            return f"{point.instance} has failed already"
        link = self._open.get(point)
        source = self._before(point) if link is None else link.source
        begin = None if source is None else self._windows.time(self.dispatchable.network.index[source])
        if begin is None:
            return f"{point} cannot happen before {source}" if source else f"{point} is the dispatcher's to choose"
        if time < begin:
            return f"found time {format_number(time)}, expected one from {format_number(begin)} on"
        if time > self._now:
            return self._future(time)
        self._natural(point, link, time, time - begin, decisions)
        return None

    def _before(self, point: TimePoint) -> TimePoint | None:
        """The start of the instance that a time point ends; None for starts, which do not come by themselves."""
        ends = point.kind is TimePointKind.END and point.instance is not None
        return self.dispatchable.plan.instance[point.instance or ""].start if ends else None

    def _natural(
        self, point: TimePoint, link: NaturalLink | None, time: Fraction, length: Fraction, decisions: list[Decision]
    ) -> None:
        number = self.dispatchable.network.index[point]
        if number in self._left:
            self._left.remove(number)
        self._happen(point, time)
        lower, upper = self._windows.window(number)
        if link is not None:
            self._reveal(link, length, time, decisions)
        if self.phase is Phase.DISPATCHING and (time < lower or (upper is not None and time > upper)):
            self._give_up(Missed(point, self._why(number, time), self._now), decisions)

    def _reveal(self, link: NaturalLink, length: Fraction, time: Fraction, decisions: list[Decision]) -> None:
        name = link.parameter
        value = length if name is None else link.revealed(length)
        if name is not None:
            self.observed.setdefault(name, value)
            self._seen[name, link.target.instance] = value
        inside = length in link.allowed
        what = name or f"the time from {link.source} to {link.target}"
        if name is not None or not inside:
            self.observations.append(Observation(time, what, value, inside))
        if not inside:
            interval = link.allowed if name is None else self.dispatchable.box[name]
            self._give_up(LeftBox(name, what, value, interval, time), decisions)
        elif name is not None:
            self._tighten(name)

    def _fail(self, message: Failed, decisions: list[Decision]) -> str | None:
        instance = self.dispatchable.plan.instance[message.instance]
        if instance.durative and self._is_done(instance):
            return f"{message.instance} has ended already"
        if message.time > self._now:
            return self._future(message.time)
        self._failed.add(message.instance)
        self._open.pop(instance.end, None)
        self._limits.pop(instance.end, None)
        self._give_up(Contradicted(message.instance, message.reason, message.time), decisions)
        return None

    def _observe(self, message: Observed, decisions: list[Decision]) -> str | None:
        name, value = message.parameter, Fraction(message.value)
        key = (name, message.instance)
        if key not in self._due and message.instance is None:
            key = next((one for one in self._due if one[0] == name), key)
        known = self._seen.get(key, self.observed.get(name) if message.instance is None else None)
        if known is not None and key not in self._due:
            stands = f"{name} = {format_number(known)} was observed already; the first value stands"
            return None if known == value else stands
        timed = [one for one in self.dispatchable.observability.revelations if one.parameter == name]
        if timed and timed[0].means is Means.TIME:
            return f"{name} is revealed by the time of {timed[0].point}, which has not happened"
        self._due.pop(key, None)
        self._seen[key] = value
        self.observed.setdefault(name, value)
        inside = value in self.dispatchable.box[name]
        self.observations.append(Observation(self._now, name, value, inside))
        if not inside:
            self._give_up(LeftBox(name, name, value, self.dispatchable.box[name], self._now), decisions)
        else:
            self._tighten(name)
        return None

    # -- decisions ---------------------------------------------------------------------------------------------------

    def _advance(self, decisions: list[Decision]) -> None:
        self._pass_literals()
        ending = self._overdue()
        if ending is not None:
            self._give_up(ending, decisions)
            return
        while self.phase is Phase.DISPATCHING:
            number = self._windows.first_ready(self._left, self._now)
            if number is None:
                break
            self._execute(number, decisions)
        if self.phase is not Phase.DISPATCHING:
            return
        stuck = self._stuck()
        if stuck is not None:
            self._give_up(stuck, decisions)
        elif not self._left and not self._open and not self._due:
            self.phase = Phase.ENDED
            decisions.append(Succeeded(self._now))

    def _pass_literals(self) -> None:
        while self._literals and self._literals[0][0] <= self._now:
            time, number = self._literals.pop(0)
            self._happen(self._points[number], time)

    def _overdue(self) -> Ending | None:
        """What should have happened by now and has not."""
        for target, limit in self._limits.items():
            if self._now >= limit:
                link = self._open[target]
                name = link.parameter
                interval = link.allowed if name is None else self.dispatchable.box[name]
                what = name or f"the time from {link.source} to {link.target}"
                return LeftBox(name, what, None, interval, self._now)
        late = self._windows.first_late(self._left, self._now)
        if late is not None:
            return Missed(self._points[late], self._why(late, None), self._now)
        for (name, _), due in self._due.items():
            if self._now >= due + self._patience:
                return Unobserved(name, due, self._now)
        return None

    def _execute(self, number: int, decisions: list[Decision]) -> None:
        point = self._points[number]
        if self._windows.is_late(number, self._now):
            self._give_up(Missed(point, self._why(number, None), self._now), decisions)
            return
        instance = self.dispatchable.plan.instance[point.instance or ""]
        reason = None if point.kind is TimePointKind.END else self._contradiction(instance)
        if reason is not None:
            self._give_up(Contradicted(instance.identifier, reason, self._now), decisions)
            return
        self._left.remove(number)
        self._happen(point, self._now)
        kind = Finish if point.kind is TimePointKind.END else Dispatch
        decisions.append(kind(point, self._now))

    def _contradiction(self, instance: ActionInstance) -> str | None:
        """Why an instance cannot start, as far as the last known state tells: it lasts until something happens."""
        estimate = self._estimate
        if estimate is None or estimate.time < self._last_change:
            return None
        values = {**self.dispatchable.plan.nominal, **self.observed}
        return unmet(instance, estimate, values, numbers=estimate.time == self._now)

    def _stuck(self) -> Missed | None:
        """A time point that no schedule allows any more; BLEX finds out when its time has come."""
        if not self.dispatchable.network.closed:
            return None
        number = self._windows.first_empty(self._left)
        return None if number is None else Missed(self._points[number], self._why(number, None), self._now)

    def _why(self, number: int, time: Fraction | None) -> str:
        lower, upper = self._windows.window(number)
        cause = self._windows.cause(number)
        since = "" if cause is None else f", because of {self._points[cause]}"
        if time is not None and time < lower:
            return f"possible from {format_number(lower)} on"
        return f"possible until {'ever' if upper is None else format_number(upper)}{since}"

    def _give_up(self, ending: Ending, decisions: list[Decision]) -> None:
        if self.phase is not Phase.DISPATCHING:
            return
        self.ending = ending
        decisions.append(ending)
        self.phase = Phase.DRAINING if self._drain else Phase.ENDED

    def _drain_running(self, decisions: list[Decision]) -> None:
        for number in tuple(self._left):
            point = self._points[number]
            instance = self.dispatchable.plan.instance[point.instance or ""]
            if point.kind is TimePointKind.END and self._is_running(instance):
                lower, _ = self._windows.window(number)
                if lower <= self._now:
                    self._left.remove(number)
                    self._happen(point, self._now)
                    decisions.append(Finish(point, self._now))
        if not self.running:
            self.phase = Phase.ENDED

    # -- what has happened -------------------------------------------------------------------------------------------

    def _happen(self, point: TimePoint, time: Fraction) -> None:
        number = self.dispatchable.network.index[point]
        self._windows.happened(number, time)
        self._open.pop(point, None)
        self._limits.pop(point, None)
        for link in self.dispatchable.followers.get(point, ()):
            if link.allowed.upper is not None and link.target in self._open:
                self._limits[link.target] = time + link.allowed.upper + self._patience
        self._last_change = max(self._last_change, time)
        for one in self.dispatchable.expected.get(point, ()):
            if (one.parameter, one.instance) not in self._seen:
                self._due[one.parameter, one.instance] = time

    def _tighten(self, name: str) -> None:
        """Replace an observed parameter by its value wherever else it bounds the network."""
        edges = []
        for link in self.dispatchable.shared:
            for bound, forwards in ((link.upper, True), (link.lower, False)):
                if bound is not None and name in bound.variables and bound.variables <= self.observed.keys():
                    edges.append(self._edge(link, bound.evaluate(self.observed), forwards=forwards))
        if edges:
            self._windows = self._windows.over(self._windows.network.tightened(edges))

    def _edge(self, link: ParametricLink, value: Fraction, *, forwards: bool) -> tuple[int, int, Fraction]:
        index = self.dispatchable.network.index
        source, target = index[link.source], index[link.target]
        return (source, target, value) if forwards else (target, source, -value)

    def _is_done(self, instance: ActionInstance) -> bool:
        return self._windows.has_happened(self.dispatchable.network.index[instance.end])

    def _is_running(self, instance: ActionInstance) -> bool:
        started = self._windows.has_happened(self.dispatchable.network.index[instance.start])
        return started and not self._is_done(instance) and instance.identifier not in self._failed

    def _next_wake(self) -> Fraction | None:
        if self.phase is Phase.DRAINING:
            moments = [self._windows.window(number)[0] for number in self._left if self._ends_running(number)]
            return min((moment for moment in moments if moment > self._now), default=None)
        found = [*self._limits.values(), *(due + self._patience for due in self._due.values())]
        found += [time for time, _ in self._literals[:1]]
        later = [moment for moment in found if moment > self._now]
        moment = self._windows.next_moment(self._left, self._now, self._patience)
        return min(later if moment is None else [*later, moment], default=None)

    def _ends_running(self, number: int) -> bool:
        point = self._points[number]
        instance = self.dispatchable.plan.instance[point.instance or ""]
        return point.kind is TimePointKind.END and self._is_running(instance)
