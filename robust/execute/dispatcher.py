"""The dispatcher: executes a plan under a box of parameter values, one message at a time [IRR §3, Algorithm 2].

Time points that are the dispatcher's to choose are executed as early as their windows and waits allow; the others are
waited for. When an observation leaves the box, a window is missed, an observation does not come, or the world is not in
the state that an action needs, the plan is given up: nothing more is started. By default the actions that are running
are then waited for, so that the state from which the next plan starts is one that the model describes.

What a dispatcher is told are messages, what it decides are decisions. Times are in the plan's unit, exact, from the
plan's time zero.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from time import perf_counter

from robust.errors import did_you_mean
from robust.execute.dispatchable import Dispatchable, Guarantee, Means, NaturalLink
from robust.execute.slices import Observations, Remainder
from robust.network.dispatchable import Windows
from robust.numbers import format_number
from robust.plan import model, timeline
from robust.qe.box import Interval

# -- messages ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class InstanceEvent:
    """An event in the execution of an instance."""

    instance: str
    time: Fraction


class Started(InstanceEvent):
    """An instance whose start is not the dispatcher's to choose has started."""


class Completed(InstanceEvent):
    """An instance has ended."""


@dataclass(frozen=True)
class DispatchFailed(InstanceEvent):
    """An instance could not start, or was ended by a condition that does not hold: `reason` says which."""

    reason: str

    def __str__(self) -> str:
        return f"{self.instance} failed: {self.reason}"


@dataclass(frozen=True, slots=True)
class Observed:
    """The value of a parameter; `instance` is the one that revealed it, where several may."""

    parameter: str
    value: Fraction
    instance: str | None = None


@dataclass(frozen=True, slots=True)
class StateEstimate:
    """The state of the world at a moment; conditions of what starts at that moment are looked up in it."""

    time: Fraction
    atoms: frozenset[model.Atom]
    fluents: Mapping[model.Fluent, Fraction] = field(default_factory=dict)


Message = InstanceEvent | Observed | StateEstimate

# -- what is kept of them ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Observation:
    """An observed value at `time`: of a parameter, or of a duration that is not as planned.

    `inside` says whether the box allows it.
    """

    time: Fraction
    what: str
    value: Fraction
    inside: bool


# -- decisions ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Dispatch:
    """An instance starts now, or one whose duration is the dispatcher's to choose ends."""

    point: model.TimePoint
    time: Fraction

    def __str__(self) -> str:
        return f"{'end' if self.point.kind is model.TimePointKind.END else 'start'} {self.point.instance}"


@dataclass(frozen=True, slots=True)
class LeftBox:
    """An observation is outside of the box: the plan is no longer guaranteed to succeed.

    `parameter` is None for a duration that is no parameter; `what` names either for people. `value` is None if all that
    is known is that it exceeds the upper end, because the observation is overdue.
    """

    parameter: str | None
    what: str
    value: Fraction | None
    interval: Interval
    time: Fraction

    def __str__(self) -> str:
        if self.value is None:
            bound = "no end" if self.interval.upper is None else format_number(self.interval.upper)
            return f"{self.what} exceeds {bound}"
        return f"{self.what} = {format_number(self.value)} is outside {self.interval.written(format_number)}"


@dataclass(frozen=True, slots=True)
class Missed:
    """A time point can no longer happen, or has happened, within what the network allows; `constraint` says why."""

    point: model.TimePoint
    constraint: str
    time: Fraction

    def __str__(self) -> str:
        return f"{self.point} missed: {self.constraint}"


@dataclass(frozen=True, slots=True)
class Unobserved:
    """A parameter should have been revealed by `due`, and was not."""

    parameter: str
    due: Fraction
    time: Fraction

    def __str__(self) -> str:
        return f"{self.parameter} was not observed by {format_number(self.due)}"


@dataclass(frozen=True, slots=True)
class MessageRejected:
    """A message that changes nothing, and why; execution goes on."""

    message: str
    reason: str
    time: Fraction

    def __str__(self) -> str:
        return f"rejected {self.message}: {self.reason}"


@dataclass(frozen=True, slots=True)
class DispatchSucceeded:
    """All time points have happened, and every observation was inside the box."""

    time: Fraction

    def __str__(self) -> str:
        return "all done"


Ending = LeftBox | Missed | Unobserved | DispatchFailed
"""Why a plan is given up."""
Decision = Dispatch | Ending | MessageRejected | DispatchSucceeded


# -- the dispatcher ----------------------------------------------------------------------------------------------------


def is_exact(number: object) -> bool:
    """Whether a number is exact: integers and fractions are, floats and texts are not."""
    return isinstance(number, Fraction | int) and not isinstance(number, bool)


def flaw(message: Message, dispatchable: Dispatchable) -> str | None:
    """The fault of a message by itself, in one line; None if it has none."""
    match message:
        case InstanceEvent():
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
    """Messages in order, which may have arrived in any: events by time, starts first, then states and levels."""

    def key(message: Message) -> tuple[int, Fraction, int]:
        if isinstance(message, InstanceEvent) and is_exact(message.time):
            return 0, Fraction(message.time), not isinstance(message, Started)
        return 1, Fraction(0), 0

    return sorted(messages, key=key)


Variables = Collection[model.NumericVariable]


def unmet(
    instance: model.ActionInstance,
    timing: model.Timing,
    reading: timeline.Reading,
    is_known: Callable[[Variables], bool],
) -> str | None:
    """The first condition of an instance, of a given timing, that is false, as a reason; None if all are met.

    Conditions that compare variables whose values are not known (`is_known`) count as met.
    """
    for part in instance.demands:
        variables = {name for test in model.comparisons(part.condition) for name in test.expression.variables}
        if part.timing is timing and is_known(variables) and not reading.holds(part.condition):
            return f"{part.text} does not hold"
    return None


class Phase(Enum):
    """Phases of an execution."""

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
        """The reason why the plan was given up."""
        self.observed: dict[str, Fraction] = {}
        """The first value that was observed of each parameter."""
        self.observations: list[Observation] = []
        """All values that were taken note of."""
        self.rejected: list[MessageRejected] = []
        """All messages that changed nothing, although they should have."""
        self.remainders: list[Remainder] = []
        """The remainders of the envelope after observations, for executors that slice it."""
        self._patience = patience or dispatchable.epsilon or Fraction(1, 1000)
        self._drain = drain
        self._windows = Windows(dispatchable.network)
        self._points, self._index = dispatchable.network.points, dispatchable.network.index
        self._pending = list(dispatchable.ours)
        self._literals = list(dispatchable.literals)
        self._open = {link.target: link for link in dispatchable.network.natural.values()}
        self._limits: dict[model.TimePoint, Fraction] = {}
        """Latest times of reports about the time points that are waited for."""
        self._seen: dict[tuple[str, str | None], Fraction] = {}
        self._due: dict[tuple[str, str | None], Fraction] = {}
        self._estimate: StateEstimate | None = None
        self._last_change = Fraction(0)
        self._failed: set[str] = set()
        self._now = Fraction(0)
        self.wake: Fraction | None = None
        """When to step again if no message comes before."""
        self._begun = False
        self._decisions: list[Decision] = []
        """The decisions of the current step."""

    # -- the executive -----------------------------------------------------------------------------------------------

    @property
    def ended(self) -> bool:
        return self.phase is Phase.ENDED

    def step(self, now: Fraction, messages: Sequence[Message] = ()) -> Sequence[Decision]:
        """Take note of messages, then decide; the decisions of one step are in the order in which they were made."""
        decisions = self._decisions = []
        self._now = now
        if not self._begun:
            self._begun = True
            self._happen(model.ZERO, Fraction(0))
            if self.dispatchable.guarantee is not Guarantee.DYNAMIC:
                self._slice("the beginning")
        for message in in_order(messages):
            if not self.ended:
                self._take(message)
        if self.phase is Phase.DISPATCHING:
            self._advance()
        if self.phase is Phase.DRAINING:
            self._drain_running()
        self.wake = None if self.ended else self._next_wake()
        return decisions

    # -- observers ---------------------------------------------------------------------------------------------------

    @property
    def times(self) -> dict[model.TimePoint, Fraction]:
        """Times of the time points that have happened."""
        return {self._points[number]: time for number, time in self._windows.times.items()}

    @property
    def running(self) -> tuple[str, ...]:
        """The instances that have started and not ended."""
        return tuple(instance.identifier for instance in self.dispatchable.plan.instances if self._is_running(instance))

    def window(self, point: model.TimePoint) -> tuple[Fraction, Fraction | None]:
        """MinMaxDispatchTime: the least and the greatest time of a time point, as far as is known now."""
        return self._windows.window(self._index[point])

    # -- messages ----------------------------------------------------------------------------------------------------

    def _take(self, message: Message) -> None:
        wrong = flaw(message, self.dispatchable)
        if wrong is None:
            match message:
                case Started(instance, time):
                    wrong = self._event(self.dispatchable.plan.instance[instance].start, Fraction(time))
                case Completed(instance, time):
                    wrong = self._event(self.dispatchable.plan.instance[instance].end, Fraction(time))
                case DispatchFailed():
                    wrong = self._fail(message)
                case Observed():
                    wrong = self._observe(message)
                case StateEstimate(time):
                    wrong = self._future(Fraction(time))
                    if wrong is None and (self._estimate is None or self._estimate.time <= time):
                        self._estimate = message
        if wrong is not None:
            self.rejected.append(MessageRejected(str(message), wrong, self._now))
            self._decisions.append(self.rejected[-1])

    def _future(self, time: Fraction) -> str | None:
        return f"found time {format_number(time)}, which is yet to come" if time > self._now else None

    def _event(self, point: model.TimePoint, time: Fraction) -> str | None:
        """A time point that was not, or not only, the dispatcher's to choose; returns what is wrong with that."""
        known = self._time(point)
        if known is not None:
            same = time == known
            return None if same else f"{point} has happened at {format_number(known)} already; the first time stands"
        if point.kind is model.TimePointKind.END and point.instance in self._failed:
            return f"{point.instance} has failed already"
        link = self._open.get(point)
        source = None if link is None else link.source
        if link is None and point.kind is model.TimePointKind.END:  # starts do not come by themselves
            source = self.dispatchable.plan.instance[point.instance or ""].start
        begin = None if source is None else self._time(source)
        if begin is None:
            return f"{point} cannot happen before {source}" if source else f"{point} is the dispatcher's to choose"
        if time < begin:
            return f"found time {format_number(time)}, expected one from {format_number(begin)} on"
        if time > self._now:
            return self._future(time)
        self._natural(point, link, time, time - begin)
        return None

    def _natural(self, point: model.TimePoint, link: NaturalLink | None, time: Fraction, length: Fraction) -> None:
        number = self._index[point]
        if number in self._pending:
            self._pending.remove(number)
        self._happen(point, time)
        lower, upper = self._windows.window(number)
        if link is not None:
            value = length if link.parameter is None else link.revealed(length)
            departure = self._departure(link, value, time)
            if self._learn(departure, value, link.target.instance, inside=length in link.allowed):
                return
        if self.phase is Phase.DISPATCHING and (time < lower or (upper is not None and time > upper)):
            self._give_up(Missed(point, self._why(number, time), self._now))

    def _learn(self, departure: LeftBox, value: Fraction, instance: str | None, *, inside: bool) -> bool:
        """Take note of a value that an instance has revealed; `departure` is what it amounts to if it is not inside.

        Returns whether another promise was found in what is left.
        """
        name = departure.parameter
        if name is not None:
            self.observed.setdefault(name, value)
            self._seen[name, instance] = value
        if name is not None or not inside:
            self.observations.append(Observation(departure.time, departure.what, value, inside))
        if name is not None and self._slice(f"{departure.what} = {format_number(value)}"):
            return True
        if not inside:
            self._give_up(departure)
        elif name is not None:
            self._tighten(name)
        return False

    def _departure(self, link: NaturalLink, value: Fraction | None, time: Fraction) -> LeftBox:
        """The ending for a length that is not allowed; a value of None says that its report is overdue."""
        name = link.parameter
        interval = link.allowed if name is None else self.dispatchable.box[name]
        return LeftBox(name, name or f"the time from {link.source} to {link.target}", value, interval, time)

    def _fail(self, message: DispatchFailed) -> str | None:
        instance = self.dispatchable.plan.instance[message.instance]
        if instance.durative and self._is_done(instance):
            return f"{message.instance} has ended already"
        if message.time > self._now:
            return self._future(message.time)
        exceeded = self._exceeded(message.time, instance.end)
        self._failed.add(message.instance)
        self._open.pop(instance.end, None)
        self._limits.pop(instance.end, None)
        self._give_up(exceeded or message)
        return None

    def _observe(self, message: Observed) -> str | None:
        name, value = message.parameter, Fraction(message.value)
        key = (name, message.instance)
        if key not in self._due and message.instance is None:
            key = next((due for due in self._due if due[0] == name), key)
        known = self._seen.get(key, self.observed.get(name) if message.instance is None else None)
        if known is not None and key not in self._due:
            stands = f"{name} = {format_number(known)} was observed already; the first value stands"
            return None if known == value else stands
        timed = next((revelation for revelation in self.dispatchable.revelations if revelation.parameter == name), None)
        if timed is not None and timed.means is Means.TIME:
            return f"{name} is revealed by the time of {timed.point}, which has not happened"
        self._due.pop(key, None)
        departure = LeftBox(name, name, value, self.dispatchable.box[name], self._now)
        self._learn(departure, value, key[1], inside=value in self.dispatchable.box[name])
        return None

    # -- decisions ---------------------------------------------------------------------------------------------------

    def _advance(self) -> None:
        self._pass_literals()
        ending = self._overdue()
        if ending is not None:
            self._give_up(ending)
            return
        while self.phase is Phase.DISPATCHING:
            ready = next(filter(self._is_ready, self._pending), None)
            if ready is None:
                break
            self._execute(ready)
        if self.phase is not Phase.DISPATCHING:
            return
        stuck = next(filter(self._is_stuck, self._pending), None)
        if stuck is not None:
            self._give_up(self._missed(stuck))
        elif not self._pending and not self._open and not self._due:
            self.phase = Phase.ENDED
            self._decisions.append(DispatchSucceeded(self._now))

    def _pass_literals(self) -> None:
        while self._literals and self._literals[0][0] <= self._now:
            time, number = self._literals.pop(0)
            self._happen(self._points[number], time)

    def _overdue(self) -> Ending | None:
        """The ending for an event that should have happened by now; None if none is overdue."""
        for target in [*self._limits]:
            if self._now >= self._limits.get(target, self._now + 1):
                departure = self._departure(self._open[target], None, self._now)
                if departure.parameter is None or not self._slice(str(departure)):
                    return departure
        late = next((number for number in self._pending if self._windows.is_late(number, self._now)), None)
        if late is not None:
            exceeded = self._exceeded(self._now)
            if exceeded is None:
                return self._missed(late)
            if exceeded.parameter is None or not self._slice(str(exceeded)):
                return exceeded
        for (name, _), due in self._due.items():
            if self._now >= due + self._patience:
                return Unobserved(name, due, self._now)
        return None

    def _exceeded(self, time: Fraction, failed: model.TimePoint | None = None) -> LeftBox | None:
        """The ending for a length that exceeds what is allowed, although its report is not overdue yet.

        What has `failed` at the last moment allowed has not ended in time.
        """
        for target, link in self._open.items():
            begun, upper = self._time(link.source), link.allowed.upper
            last = None if begun is None or upper is None else begun + upper
            if last is not None and (time > last or (time == last and target == failed)):
                return self._departure(link, None, time)
        return None

    def _execute(self, number: int) -> None:
        point = self._points[number]
        if self._windows.is_late(number, self._now):
            self._give_up(self._missed(number))
            return
        instance = self.dispatchable.plan.instance[point.instance or ""]
        reason = None if point.kind is model.TimePointKind.END else self._contradiction(instance)
        if reason is not None:
            self._give_up(DispatchFailed(instance.identifier, self._now, reason))
            return
        self._dispatch(number)

    def _dispatch(self, number: int) -> None:
        self._pending.remove(number)
        self._happen(self._points[number], self._now)
        self._decisions.append(Dispatch(self._points[number], self._now))

    def _is_ready(self, number: int) -> bool:
        ready = self._windows.ready(number)
        return ready is not None and ready <= self._now

    def _contradiction(self, instance: model.ActionInstance) -> str | None:
        """Why an instance cannot start, as far as the last known state tells: it lasts until something happens."""
        estimate = self._estimate
        if estimate is None or estimate.time < self._last_change:
            return None

        def is_known(variables: Variables) -> bool:
            """Fluents may have changed since the estimate."""
            fluents = {variable for variable in variables if isinstance(variable, model.Fluent)}
            lasting = not fluents or (estimate.time == self._now and estimate.fluents.keys() >= fluents)
            return lasting and model.Duration() not in variables

        values = {**self.dispatchable.plan.nominal, **self.observed}
        reading = timeline.Reading(timeline.State(estimate.atoms, estimate.fluents), values)
        return unmet(instance, model.Timing.AT_START, reading, is_known)

    def _is_stuck(self, number: int) -> bool:
        """Whether no schedule allows a time point any more; BLEX finds out when its time has come."""
        return self.dispatchable.network.closed and self._windows.is_late(number, self._windows.lower[number])

    def _missed(self, number: int) -> Missed:
        return Missed(self._points[number], self._why(number, None), self._now)

    def _why(self, number: int, time: Fraction | None) -> str:
        lower, upper = self._windows.window(number)
        cause = self._windows.cause[number]
        since = "" if cause is None else f", because of {self._points[cause]}"
        if time is not None and time < lower:
            return f"possible from {format_number(lower)} on"
        return f"possible until {'ever' if upper is None else format_number(upper)}{since}"

    def _give_up(self, ending: Ending) -> None:
        if self.phase is not Phase.DISPATCHING:
            return
        self.ending = ending
        self._decisions.append(ending)
        self.phase = Phase.DRAINING if self._drain else Phase.ENDED

    def _drain_running(self) -> None:
        for number in filter(self._ends_running, tuple(self._pending)):
            if self._windows.lower[number] <= self._now:
                self._dispatch(number)
        if not self.running:
            self.phase = Phase.ENDED

    # -- what has happened -------------------------------------------------------------------------------------------

    def _happen(self, point: model.TimePoint, time: Fraction) -> None:
        self._windows.happened(self._index[point], time)
        self._open.pop(point, None)
        self._limits.pop(point, None)
        self._expect(point)
        self._last_change = max(self._last_change, time)
        for revelation in self.dispatchable.expected.get(point, ()):
            if (revelation.parameter, revelation.instance) not in self._seen:
                self._due[revelation.parameter, revelation.instance] = time

    def _expect(self, point: model.TimePoint) -> None:
        """Note the latest times of reports about natural links that begin with a time point."""
        for link in self.dispatchable.followers.get(point, ()):
            if link.allowed.upper is not None and link.target in self._open:
                begun = self._windows.times[self._index[point]]
                self._limits[link.target] = begun + link.allowed.upper + self._patience

    def _tighten(self, name: str) -> None:
        """Replace an observed parameter by its value wherever else it bounds the network."""
        edges = []
        for link in self.dispatchable.shared:
            source, target = self._index[link.source], self._index[link.target]
            for bound, first, second, sign in ((link.upper, source, target, 1), (link.lower, target, source, -1)):
                if bound is not None and name in bound.variables and bound.variables <= self.observed.keys():
                    edges.append((first, second, sign * bound.evaluate(self.observed)))
        if edges:
            self._windows = self._windows.over(self._windows.network.tightened(edges))

    # -- what is left of the envelope --------------------------------------------------------------------------------

    def _slice(self, what: str) -> bool:
        """Look for a box in what is left of the envelope, after an observation, and go on with it; False if none is."""
        slices = self.dispatchable.slices
        if slices is None or self.phase is not Phase.DISPATCHING:
            return False
        started = perf_counter()
        remainder, network = slices.after(self._facts(), what, self.dispatchable.box)
        if remainder.box is None:
            self.remainders.append(remainder)
            return False
        self.dispatchable = self.dispatchable.continued(network, remainder.box)
        self._windows = self._windows.over(self.dispatchable.network)
        self._open = {point: self.dispatchable.network.natural[point] for point in self._open}
        self._limits = {}
        for point in self.times:
            self._expect(point)
        self.remainders.append(replace(remainder, seconds=perf_counter() - started))
        return True

    def _facts(self) -> Observations:
        """The observations so far."""
        values: dict[str, list[Fraction]] = {}
        for (name, _), value in self._seen.items():
            values.setdefault(name, []).append(value)
        reveals = Counter(revelation.parameter for revelation in self.dispatchable.revelations)
        possible = {}
        for link in self._open.values():
            begun, varying = self._time(link.source), link.parameter
            if begun is not None and varying is not None and reveals[varying] == 1:
                ((_, factor),) = link.length.coefficients()
                end = link.revealed(self._now - begun)
                possible[varying] = Interval(end, None) if factor > 0 else Interval(None, end)
        return Observations(
            now=self._now,
            seen={name: Interval(min(seen), max(seen)) for name, seen in values.items()},
            settled=frozenset(name for name, seen in values.items() if len(seen) >= reveals[name]),
            possible=possible,
            times=self.times,
        )

    def _time(self, point: model.TimePoint) -> Fraction | None:
        """When a time point happened."""
        return self._windows.times.get(self._index[point])

    def _is_done(self, instance: model.ActionInstance) -> bool:
        return self._time(instance.end) is not None

    def _is_running(self, instance: model.ActionInstance) -> bool:
        started = self._time(instance.start) is not None
        return started and not self._is_done(instance) and instance.identifier not in self._failed

    def _next_wake(self) -> Fraction | None:
        if self.phase is Phase.DRAINING:
            moments = [self._windows.lower[number] for number in filter(self._ends_running, self._pending)]
        else:
            moments = [*self._limits.values(), *(due + self._patience for due in self._due.values())]
            moments += [time for time, _ in self._literals[:1]]
            moments += self._windows.moments(self._pending, self._patience)
        return min((moment for moment in moments if moment > self._now), default=None)

    def _ends_running(self, number: int) -> bool:
        point = self._points[number]
        instance = self.dispatchable.plan.instance[point.instance or ""]
        return point.kind is model.TimePointKind.END and self._is_running(instance)
