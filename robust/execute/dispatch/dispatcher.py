"""The dispatcher: executes a plan under a box of parameter values, one message at a time [IRR §3, Algorithm 2].

Time points that are the dispatcher's to choose are executed as early as their windows and waits allow; the others are
waited for. When an observation leaves the box, a window is missed, an observation does not come, or the world is not in
the state that an action needs, the plan is given up: nothing more is started. By default the actions that are running
are then waited for, so that the state from which the next plan starts is one that the model describes.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from fractions import Fraction

from robust.execute.controllability.parametric import ParametricLink
from robust.execute.dispatch.faults import flaw, in_order
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
from robust.execute.dispatch.network import NaturalLink
from robust.execute.dispatch.observability import Means
from robust.execute.dispatch.prepare import Dispatchable
from robust.execute.dispatch.states import unmet
from robust.execute.dispatch.windows import Windows
from robust.plan.model import ZERO, ActionInstance, TimePoint, TimePointKind
from robust.plan.numerals import format_number


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
