"""A plan while it runs: what may start and until when, how long steps may still take, and when nothing is left.

Messages say what happened, when, and perhaps when that became known (:mod:`robust.execute.messages`); forecasts say
what is ahead (:mod:`robust.execute.forecast`). What messages mean together does not depend on their order. Where the
plan's order leaves nothing, or something was observed that the plan did not expect, the rest of the plan is judged anew
from where it is, in whatever order a solver finds (:mod:`robust.execute.reorder`), before it is called broken.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from math import lcm

from robust.encode.interface import EPSILON
from robust.errors import Location, did_you_mean
from robust.execute import messages
from robust.execute.forecast import (
    FINEST,
    OPEN,
    FollowedPlan,
    Forecaster,
    PathForecaster,
    PlanForecast,
    Prospect,
    StepAhead,
    Window,
)
from robust.execute.messages import OBSERVED, STEPS, MessageKind, MonitorMessage, StepProgress, time_text
from robust.execute.remaining import History, MonitorState, read_by, variables
from robust.network.slack import OutsideFragmentError
from robust.numbers import Number, exact, format_number, parse_number, shorten
from robust.plan import model
from robust.plan.simulate import mutex_pairs
from robust.presented import Presented
from robust.probability.distributions import Distribution
from robust.smt.limits import NEVER, Deadline

TICK = Fraction(1, 1000)
"""Clocks are read in multiples of this: a moment has passed at the next one."""
SECONDS = 1.0
"""For an answer, unless said otherwise."""


@dataclass(frozen=True, slots=True)
class StepOutlook:
    """A step that runs or is coming, and its windows: times at which it may start and end.

    Attributes:
        step: its identifier.
        name: the ground action.
        since: when it started; None if it has not.
        start: the earliest and latest start; None is no limit.
        end: the earliest and latest end.
        slack: how much longer than planned it may take if all other steps take as long as planned; None is no limit.
        left: how long it may still take, from now on for one that runs, from its start on for one to come.
    """

    step: str
    name: str
    since: Fraction | None
    start: Window
    end: Window
    slack: Fraction | None
    left: Fraction | None


@dataclass(frozen=True, slots=True)
class SuccessOutlook:
    """Certified bounds of the probability that the plan succeeds in the order that it follows, by what was known at a
    time; of durations that are still open, given how long steps have run."""

    lower: Fraction
    upper: Fraction
    time: Fraction


@dataclass(frozen=True, slots=True)
class Outlook(Presented, ask="prospect"):
    """The answer to a message; all times are in the plan's unit.

    Attributes:
        message: its number, from 1; 0 before any.
        time: what time it is at least.
        prospect: what is ahead.
        reasons: of a plan that is not on track, what contradicts itself, in the plan's words; of one that goes on in
            another order, what it left the first one for.
        running: steps that have started and not ended, in the order of their starts.
        startable: steps that may start now; `start` says until when.
        coming: all other steps to come, in the order of their earliest starts.
        refused: why the message changed nothing; None if it was taken.
        assumed: what answers rest on although it does not fit what was said: steps whose ends are known, and whose
            starts are awaited, count as not started.
        replan: whether only another plan helps, as far as is known.
        promise: durations of steps that have not ended, by step: as long as all are within, and steps start as they
            may, the plan succeeds; None if nothing is promised.
        success: the probability of success, where durations have distributions; None if it is not known.
        reordered: whether the plan goes on in another order than its own.
        exact: whether windows and slack are all that is left; else they are what is promised, and more may be left.
        wake: when something changes if nothing happens before: a step may start, cannot start or end any more, or is
            too late for the plan; None if never.
    """

    message: int
    time: Fraction
    prospect: Prospect
    reasons: tuple[str, ...] = ()
    running: tuple[StepOutlook, ...] = ()
    startable: tuple[StepOutlook, ...] = ()
    coming: tuple[StepOutlook, ...] = ()
    refused: str | None = None
    replan: bool = False
    promise: Mapping[str, Window] | None = None
    success: SuccessOutlook | None = None
    reordered: bool = False
    exact: bool = True
    wake: Fraction | None = None
    assumed: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What fails unless it happens in time."""
        return tuple(
            f"{'fails' if self.exact else 'no longer promised'} unless {look.step} ends by {format_number(look.end[1])}"
            for look in self.running
            if look.end[1] is not None
        )


@dataclass
class Monitor:
    """Follows a plan that others execute [docs/commands.md#robust-watch]; all times are in the plan's unit.

    Args:
        plan: the plan, with the durations that may vary as parameters.
        epsilon: the separation of mutex time points.
        lateness: how late messages may come: what has not been heard of may have happened as long ago as that.
        seconds: for an answer, by the clock: what is not found by then is as it was promised last, or is said to be
            undecided.
        reorder: whether other orders of steps than the plan's are as good as its own; not if they are statements of the
            plan, as in network files.
        distributions: those of durations, independent of each other, by parameter; for the probability of success. If
            one is missing, nothing is known of it from below.
        eager: whether answers wait for what takes long: for a solver that looks for other orders, and for the
            probability of success. If not, a plan whose order leaves nothing is undecided until :meth:`assess` has
            looked, and the probability is the one that it found last. No answer waits for promises of plans with
            conditions on numbers to become as wide as may be: :meth:`assess` makes them so.

    Raises:
        InputError: if `plan` is none, or a number is none.
        UnsupportedError: if the plan has conditions that nobody here can follow.
    """

    plan: model.ParametrizedPlan
    """That of a conversion if one is given."""
    epsilon: Fraction = EPSILON
    lateness: Fraction = Fraction(0)
    seconds: float | None = SECONDS
    reorder: bool = True
    distributions: Mapping[str, Distribution] = field(default_factory=dict)
    eager: bool = True
    count: int = field(default=0, init=False, repr=False, compare=False)
    """The number of the last message."""
    taken: dict[int, MonitorMessage] = field(default_factory=dict, init=False)
    """What has been said and was neither refused nor taken back, by number."""
    time: Fraction = field(default=Fraction(0), init=False)
    """What time it is at least."""

    def __post_init__(self) -> None:
        self.plan = model.plan_itself(self.plan)
        self.epsilon = exact(self.epsilon, Location("epsilon"))
        self.lateness = exact(self.lateness, Location("lateness"))
        self._own = _forecaster(FollowedPlan(self.plan, self.epsilon, self.plan.lasting))
        self._latest_tick = 0
        self._fineness = 1
        self._observed: dict[int, model.TimedLiteral] = {}
        """What has been observed of the state and not taken back, by the number of the message."""
        self._surprised: tuple[object, Sequence[str]] = (None, ())
        self._last_history: tuple[object, History] | None = None
        self._said: dict[str, list[MonitorMessage]] = {step.identifier: [] for step in self.plan.instances}
        self._progress = {step: StepProgress() for step in self._said}
        self._other: Forecaster | None = None
        self._seen_by_other = frozenset[model.TimedLiteral]()
        self._lost: PlanForecast | None = None
        self._lost_since = Fraction(0)
        self._in_order = True
        self._last_success: SuccessOutlook | None = None
        self._lock = asyncio.Lock()
        if not self.eager:
            import robust.execute.reorder  # noqa: F401, PLC0415 - loads solvers before anything happens
        self.retired: frozenset[str] = frozenset()
        """Identifiers of steps of plans that this run followed before."""
        named = ((self.plan.lasting.get(name), each) for name, each in self.distributions.items())
        self.chances = {str(self.plan.instance[step]): each for step, each in named if step is not None}
        """The distributions of durations by ground action, those of plans before included."""

    @property
    def ended(self) -> Sequence[tuple[str, str, Fraction, Fraction]]:
        """Steps that are over: identifier, name, start and end, in the order of their starts."""
        known = ((step, progress.start, progress.end) for step, progress in self._progress.items())
        over = [(step, self._name[step], a, b) for step, a, b in known if a is not None and b is not None]
        return sorted(over, key=lambda each: each[2:])

    @property
    def planned(self) -> Mapping[str, Fraction]:
        """Planned durations, by step."""
        return self._own.planned

    @property
    def state(self) -> MonitorState:
        """Where the plan is, by all that is known.

        Raises:
            UnsupportedError: if a continuous effect's rate changes while it acts.
        """
        return self._history_until(self.time).state

    def _history_until(self, time: Fraction) -> History:
        numbers = sorted(self._observed, key=lambda k: (self._observed[k].time, self.taken[k].arrived or Fraction(0)))
        observed = tuple(self._observed[number] for number in numbers)
        known = time, tuple(self._progress.values()), observed
        if self._last_history is None or known != self._last_history[0]:
            history = History(self.plan, self.planned, dict(self._progress), observed, time, self._mutex)
            self._last_history = known, history
        return self._last_history[1]

    @property
    def _now(self) -> Fraction:
        """Nothing that has not been heard of happened before."""
        return max(self.time - self.lateness, Fraction(0))

    @property
    def _judged_from(self) -> Fraction:
        """From when on the rest of the plan is judged: after all that was observed, and after attempts that failed."""
        attempts = (end for known in self._progress.values() for _, end in known.attempts)
        return max((self._now, *attempts, *(known.time for known in self._observed.values())))

    # -- messages ------------------------------------------------------------------------------------------------------

    def say(
        self,
        kind: str,
        step: str = "",
        *,
        at: Number | None = None,
        arrived: Number | None = None,
        observed: Number | bool | None = None,
    ) -> Outlook:
        """Tell what happened: `monitor.say("start", "drive r1 a b", at="12.5")`; floats are what they print.

        Raises:
            ValueError: for a kind that is no :class:`MessageKind`.
        """
        happened, known = (None if time is None else parse_number(str(time)) for time in (at, arrived))
        seen = observed if observed is None or isinstance(observed, bool) else parse_number(str(observed))
        return self.tell(MonitorMessage(MessageKind(kind), step, happened, known, seen))

    async def told(self, message: MonitorMessage) -> Outlook:
        """As :meth:`tell`, in another thread, so that an event loop goes on; messages are taken one after the other."""
        async with self._lock:
            return await asyncio.to_thread(self.tell, message)

    def tell(self, message: MonitorMessage) -> Outlook:
        """What is ahead once this is known.

        A message that contradicts what is known is refused: the answer says why, and all is as before.
        """
        refused = self.take(message)
        return self.outlook(refused)

    def take(self, message: MonitorMessage) -> str | None:
        """Take a message without an answer; why it is refused, if it is."""
        self.count += 1
        refused = self._take(message)
        if refused is None:
            is_later = message.kind in {MessageKind.START, MessageKind.END} and (message.at or 0) >= self._lost_since
            if not is_later and message.kind is not MessageKind.TICK:
                self._lost = None
            self._own.pass_time(self._now)
            if self._other is not None:
                self._other.pass_time(self._now)
        return refused

    def continued(self, plan: model.ParametrizedPlan, after: int) -> Monitor | None:
        """A monitor of another plan of the same run, in which what runs goes on; messages go on being counted.

        Durations are distributed as those of the same ground actions were.

        None if a message after the one with this number is about a step that the other plan does not have.

        Raises:
            UnsupportedError: if the other plan has conditions that nobody here can follow.
        """
        steps = {name: str(plan.instance[step]) for name, step in plan.lasting.items()}
        known = {name: self.chances[action] for name, action in steps.items() if action in self.chances}
        other = Monitor(plan, self.epsilon, self.lateness, self.seconds, self.reorder, known, self.eager)
        other.chances = self.chances | other.chances
        other.retired = self.retired | self.plan.instance.keys()
        for number, message in sorted(self.taken.items()):
            is_known = message.step in plan.instance or message.kind not in STEPS
            other.count = number - 1
            if other.take(message) is not None if is_known else number > after:
                return None
        other.count, other.time = self.count, self.time
        return other

    def _take(self, message: MonitorMessage) -> str | None:
        if message.kind is MessageKind.RETRACT:
            return self._retract(message)
        wrong = _wrong_times(message)
        if wrong is None and message.kind is MessageKind.TICK:
            wrong = self._wrong_clock(message)
        elif wrong is None and message.kind in OBSERVED:
            wrong = self._wrong_observation(message)
        elif wrong is None:
            step = message.step if message.step in self._said else self._meant(message)
            if step is None:
                names = [name for each in self.plan.instances for name in (each.identifier, str(each)[1:-1])]
                return f"found {shorten(message.step)}, expected a step of the plan{did_you_mean(message.step, names)}"
            message = replace(message, step=step)
            fineness = lcm(self._fineness, (message.at or Fraction(0)).denominator)
            if fineness > FINEST:
                return "found a time that has no common unit of 60 digits with those before, expected a coarser one"
            try:
                progress = StepProgress.of([*self._said[step], message], self.plan.instance[step])
            except messages.ContradictionError as error:
                return f"{error}; retract what was wrong first"
            self._said[step].append(message)
            self._fineness = fineness
            self._follow(step, progress)
        if wrong is None:
            self.taken[self.count] = message
            self.time = max(self.time, message.time)
            self._note_ticks({self._latest_tick, self.count})
        return wrong

    def _note_ticks(self, numbers: Iterable[int]) -> None:
        """Find the message with the latest tick."""
        ticks = [number for number in numbers if number and self.taken[number].kind is MessageKind.TICK]
        self._latest_tick = max(ticks, key=lambda number: self.taken[number].time, default=0)

    def _wrong_clock(self, message: MonitorMessage) -> str | None:
        """Clocks do not go back, by more than messages may be late."""
        latest = self.taken[self._latest_tick].time if self._latest_tick else Fraction(0)
        if message.time >= latest - self.lateness:
            return None
        found = f"found tick {time_text(message.at)} after tick {time_text(latest)}"
        return f"{found}, expected a clock that does not go back; retract message {self._latest_tick} if that was wrong"

    def _wrong_observation(self, message: MonitorMessage) -> str | None:
        variable = self._variables.get(_bare(message.step))
        if not isinstance(variable, model.Fluent if message.kind is MessageKind.VALUE else model.Atom):
            what = "a fluent" if message.kind is MessageKind.VALUE else "an atom"
            return f"found {shorten(message.step)}, expected {what} of the plan"
        if message.observed is None or type(message.observed) is not OBSERVED[message.kind]:
            return f"found {message.observed} for {variable}, expected {_WANTED[message.kind]}"
        literal = model.TimedLiteral(message.at or Fraction(0), variable, message.observed)
        for known in self._observed.values():
            if known.point == literal.point and known.target == variable and known != literal:
                return f"found two values of {variable} at {time_text(message.at)}; retract what was wrong first"
        self._observed[self.count] = literal
        return None

    def _retract(self, message: MonitorMessage) -> str | None:
        number = int(message.step) if message.step.isdecimal() else 0
        wrong = self.taken.get(number)
        if wrong is None:
            return f"found message {shorten(message.step)}, expected the number of one that was taken"
        if wrong.kind in STEPS:
            rest = list(self._said[wrong.step])
            rest.remove(wrong)
            try:
                progress = StepProgress.of(rest, self.plan.instance[wrong.step])
            except messages.ContradictionError as error:
                return f"{error}: without message {number} the others contradict each other; retract them first"
            self._said[wrong.step] = rest
            times = (known.at for several in self._said.values() for known in several)
            self._fineness = lcm(*(at.denominator for at in times if at is not None))
            self._follow(wrong.step, progress)
        del self.taken[number]
        self._observed.pop(number, None)
        if number == self._latest_tick:
            self._note_ticks(self.taken)
        self.time = max((known.time for known in self.taken.values()), default=Fraction(0))
        self._other = None
        return None

    def _follow(self, step: str, progress: StepProgress) -> None:
        before, self._progress[step] = self._progress[step], progress
        if progress == before:
            return
        self._own.follow(step, progress)
        if self._other is not None:
            was_over = before.end is not None  # and is no longer part of the rest
            if was_over or before.start not in (None, progress.start) or progress.attempts != before.attempts:
                self._other = None
            else:
                self._other.follow(step, progress)

    def _meant(self, message: MonitorMessage) -> str | None:
        """The step that a name means: of those so called the first that is not yet as far, or that said the same."""
        called = _bare(message.step).split()
        named = [each for each in self.plan.instances if [each.action, *each.arguments] == called]
        named.sort(key=lambda each: self._own.order(each.start))
        for step in (each.identifier for each in named):
            known, starts = self._progress[step], message.kind is MessageKind.START
            is_open = known.end is None and (known.start is None or not starts)
            if is_open or replace(message, step=step) in self._said[step]:
                return step
        return named[-1].identifier if named else None

    # -- answers -------------------------------------------------------------------------------------------------------

    def outlook(self, refused: str | None = None) -> Outlook:
        """What is ahead by all that is known."""
        return self._outlook(refused, Deadline.after(self.seconds), waits=self.eager)

    def assess(self, deadline: Deadline = NEVER) -> Outlook:
        """What is ahead, with what only eager answers wait for and promises as wide as can be, as far as that is found
        by the deadline.

        Later answers have it, too.
        """
        before = self._last_success
        outlook = self._outlook(None, deadline, waits=True, widening=True)
        if deadline.passed:
            self._last_success = before
        return replace(outlook, success=self._last_success)

    def _outlook(self, refused: str | None, deadline: Deadline, *, waits: bool, widening: bool = False) -> Outlook:
        forecast = self._forecast(deadline, waits=waits, widening=widening)
        prospect = forecast.prospect
        if prospect in OPEN and all(known.end is not None for known in self._progress.values()):
            return Outlook(self.count, self.time, Prospect.DONE, refused=refused, assumed=self._assumed)
        looks = [self._look(step, ahead) for step, ahead in (forecast.steps or {}).items()]
        running = sorted((look for look in looks if look.since is not None), key=lambda look: look.start)
        startable = [look for look in looks if look.since is None and look.step in forecast.ready]
        rest = [look for look in looks if look.since is None and look.step not in forecast.ready]
        return Outlook(
            self.count,
            self.time,
            prospect,
            forecast.reasons,
            tuple(running),
            tuple(startable),
            tuple(sorted(rest, key=lambda look: look.start[0])),
            refused,
            prospect not in OPEN and not forecast.pending,
            forecast.promise,
            self._success(forecast, deadline) if waits else self._last_success,
            self._other is not None and not self._in_order,
            forecast.exact,
            self._wake(looks, forecast),
            self._assumed,
        )

    @property
    def _assumed(self) -> tuple[str, ...]:
        unbegun = ((step, known.unbegun) for step, known in self._progress.items() if known.unbegun is not None)
        return tuple(
            f"{step} has not started: its end at {time_text(at)} was said, its start was not" for step, at in unbegun
        )

    def _wake(self, looks: Sequence[StepOutlook], forecast: PlanForecast) -> Fraction | None:
        """The first moment to come at which time alone opens or closes a window.

        The start of a step that waits for another one moves with the present, and is no such moment.
        """
        opening = [look.start[0] for look in looks if look.step in forecast.free and look.start[0] > self.time]
        limits = [look.end[1] if look.since is not None else look.start[1] for look in looks]
        closing = [time + self.lateness for time in limits if time is not None]
        if forecast.prospect is Prospect.UNDECIDED and self._judged_from > self._now:
            closing.append(self._judged_from + self.lateness)
        first = min((time for time in (*opening, *closing) if time >= self.time), default=None)
        return None if first is None else (first // TICK + 1) * TICK

    def _success(self, forecast: PlanForecast, deadline: Deadline) -> SuccessOutlook | None:
        """Bounds of the probability of success; those before, where none were found in time."""
        if not self.distributions:
            return None
        from robust.execute.chances import RunChances  # noqa: PLC0415 - where it is asked for

        lasting = self.plan.lasting
        known = {lasting[name]: each for name, each in self.distributions.items() if name in lasting}
        followed = self._own if self._other is None else self._other
        bounds = RunChances(known, self._progress, self._now).bounds(followed, forecast, deadline)
        if bounds is not None:
            self._last_success = SuccessOutlook(bounds.lower, bounds.upper, self.time)
        return self._last_success

    def _look(self, step: str, ahead: StepAhead) -> StepOutlook:
        since, most, planned = self._progress[step].start, ahead.most, self.planned[step]
        start = ahead.start if since is None else (since, since)
        slack = None if most is None else most - planned
        left = most if since is None or most is None else max(Fraction(0), most + since - self.time)
        return StepOutlook(step, self._name[step], since, start, ahead.end, slack, left)

    @cached_property
    def _mutex(self) -> Sequence[tuple[model.TimePoint, model.TimePoint]]:
        return tuple(mutex_pairs(self.plan))

    @cached_property
    def _variables(self) -> Mapping[str, model.Atom | model.Fluent]:
        return variables(self.plan)

    @cached_property
    def _name(self) -> Mapping[str, str]:
        return {instance.identifier: str(instance)[1:-1] for instance in self.plan.instances}

    @property
    def _surprises(self) -> Sequence[str]:
        """What was observed, is not as the plan says, and is read by what is to come."""
        if not self._observed:
            return ()
        known = frozenset(self._observed.values()), tuple(self._progress.values())
        if known != self._surprised[0]:
            steps = (step for step in self.plan.instances if self._progress[step.identifier].end is None)
            read = set(read_by(steps, self.plan.goal))
            every = self._history_until(self.time).surprises
            self._surprised = known, [text for variable, text in every if variable in read]
        return self._surprised[1]

    def _forecast(self, deadline: Deadline, *, waits: bool, widening: bool) -> PlanForecast:
        """The forecast: in the plan's own order if that is left, else as the rest of the plan is judged."""

        def look(forecaster: Forecaster) -> PlanForecast:
            return forecaster.look(self.time, deadline, widening=widening)

        failed = [f"{step} {known.failure}" for step, known in self._progress.items() if known.failure]
        if failed:
            return PlanForecast(Prospect.BROKEN, tuple(failed))
        again = [f"{step} was attempted before" for step, known in self._progress.items() if known.attempts]
        if self._lost is not None:
            return self._lost
        causes = (*again, *self._surprises)
        in_order = bool(causes)
        if not causes:
            own = look(self._own)
            if own.prospect in OPEN or not self.reorder:
                self._other = None
                return own if own.prospect in OPEN else self._lose(own, self._now)
            causes = own.reasons
        seen = frozenset(self._observed.values())
        other = None if self._other is None or self._seen_by_other != seen else look(self._other)
        if other is None or other.prospect not in OPEN:
            from robust.execute.reorder import reordered  # noqa: PLC0415 - loads solvers, which few plans need

            moment = self._judged_from
            history = self._history_until(moment)
            judged = reordered(
                history,
                _forecaster,
                self.epsilon,
                free=self.reorder,
                in_order=in_order,
                searching=waits,
                deadline=deadline,
            )
            self._other, self._seen_by_other = judged.forecaster, seen
            self._in_order = judged.in_order
            if self._other is None:
                # what happened before may be heard yet
                is_late = judged.prospect is Prospect.BROKEN and moment > self._now
                prospect = Prospect.UNDECIDED if is_late else judged.prospect
                return self._lose(PlanForecast(prospect, (*judged.reasons, *causes), pending=judged.pending), moment)
            self._other.pass_time(self._now)
            other = look(self._other)
        return replace(other, reasons=(*causes, *other.reasons))

    def _lose(self, forecast: PlanForecast, moment: Fraction) -> PlanForecast:
        """Keep that nothing was left at a moment: what happens later cannot change it."""
        if forecast.prospect is Prospect.BROKEN:
            self._lost, self._lost_since = forecast, moment
        return forecast


def _bare(name: str) -> str:
    """The name of a step, an atom or a fluent without brackets."""
    return " ".join(name.strip().strip("()").lower().split())


def _wrong_times(message: MonitorMessage) -> str | None:
    if message.at is None or message.at < 0 or (message.arrived is not None and message.arrived < message.at):
        latest = "" if message.arrived is None else f" and at most {time_text(message.arrived)}, when it arrived"
        return f"found time {time_text(message.at)}, expected at least 0{latest}"
    times = (message.at, message.arrived or message.at)
    if any(max(time, Fraction(time.denominator)) > FINEST for time in times):
        return "found a time of more than 60 digits, expected a shorter one"
    return None


_WANTED = {MessageKind.VALUE: "a number", MessageKind.FACT: "true or false"}


def _forecaster(followed: FollowedPlan) -> Forecaster:
    """By shortest paths where they decide about the plan, else by slices."""
    try:
        return PathForecaster(followed)
    except OutsideFragmentError:
        from robust.execute.slice_forecast import SliceForecaster  # noqa: PLC0415 - loads solvers, which few plans need

        return SliceForecaster(followed)
