"""A plan while it runs: what may start and until when, how long steps may still take, and when nothing is left.

Shortest paths decide it where they decide the plan (:mod:`robust.irr.proposals`): the network, what its obligations
demand of times, and what nature chooses, in two networks. In the first, durations that are parameters may be anything
that is declared: if it has no schedule with what has happened, no continuation that the plan allows succeeds, however
kind nature is. In the second, steps take at least as long as planned: its windows say what is expected, and if it alone
has no schedule, only shorter steps help.

Messages say what happened, when, and perhaps when that became known. They may come late, repeatedly and in any order:
what a message means does not depend on those that came before, unless they contradict it; then it is refused.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from hashlib import sha256
from math import lcm
from typing import Any

from robust import json_text, records
from robust.encode.interface import EPSILON
from robust.errors import InputError, UnsupportedError, did_you_mean
from robust.irr.proposals import DECLARED, SlackPlan
from robust.network.differences import Bound, DifferenceNetwork, windows
from robust.network.slack import FaceNumber, OutsideFragmentError
from robust.numbers import Number, format_number, parse_number, shorten
from robust.plan import model
from robust.presented import NoTruthValue, VerdictEnum

TICKS = 10**6
"""Times on clocks are in millionths of a unit, so that networks need not be written anew for them."""
TICK = Fraction(1, 1000)
"""How long after a moment it is certain that it has passed, on clocks."""


class Prospect(VerdictEnum):
    """What is ahead of a plan that runs."""

    ON_TRACK = "on track"
    """It succeeds if steps take as long as planned."""
    AT_RISK = "at risk"
    """It succeeds only if some steps take less time than planned."""
    BROKEN = "broken"
    """No continuation that the plan allows succeeds."""
    DONE = "done"
    """All has happened as the plan allows."""


class MessageKind(Enum):
    """What a message says."""

    START = "start"
    END = "end"
    FAILED = "failed"
    CANCELLED = "cancelled"
    TICK = "tick"
    RETRACT = "retract"


@dataclass(frozen=True, slots=True)
class MonitorMessage:
    """What happened: to a step, by its identifier or as `drive r1 a b`; a tick says what time it is at least.

    Attributes:
        kind: what it is.
        step: of which step; of a retraction, the number of the message that was wrong.
        at: when it happened, in the plan's unit of time.
        arrived: when it became known; nothing earlier than that, if given.
    """

    kind: MessageKind
    step: str = ""
    at: Fraction | None = None
    arrived: Fraction | None = None

    def as_dict(self) -> dict[str, Any]:
        """As a line of JSON says it."""
        if self.kind is MessageKind.TICK:
            return {"tick": str(self.at)}
        times = {"at": self.at, "arrived": self.arrived}
        return {self.kind.value: self.step, **{name: str(time) for name, time in times.items() if time is not None}}


@dataclass(frozen=True, slots=True)
class StepOutlook:
    """A step that runs or is coming, and its windows: times at which it may start and end.

    Attributes:
        step: its identifier.
        name: the ground action.
        since: when it started; None if it has not.
        start: the earliest and latest start; None is no limit.
        end: the earliest and latest end.
        slack: how much longer than planned it may take if all other steps take as long as planned, from now on for one
            that runs; None is no limit.
    """

    step: str
    name: str
    since: Fraction | None
    start: tuple[Fraction, Fraction | None]
    end: tuple[Fraction, Fraction | None]
    slack: Fraction | None


@dataclass(frozen=True, slots=True)
class Outlook(NoTruthValue, ask="prospect"):
    """The answer to a message.

    Attributes:
        message: its number, from 1; 0 before any.
        time: what time it is at least.
        prospect: what is ahead.
        reasons: of a plan that is broken or at risk, what contradicts itself, in the plan's words.
        running: steps that have started and not ended, in the order of their starts.
        startable: steps that may start now; `start` says until when.
        coming: all other steps to come, in the order of their earliest starts.
        refused: why the message changed nothing; None if it was taken.
    """

    message: int
    time: Fraction
    prospect: Prospect
    reasons: tuple[str, ...] = ()
    running: tuple[StepOutlook, ...] = ()
    startable: tuple[StepOutlook, ...] = ()
    coming: tuple[StepOutlook, ...] = ()
    refused: str | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What fails unless it happens in time."""
        return tuple(
            f"fails unless {look.step} ends by {format_number(look.end[1])}"
            for look in self.running
            if look.end[1] is not None
        )

    @property
    def wake(self) -> Fraction | None:
        """When something changes if nothing happens before: a step may start, or cannot any more; None if never."""
        times = [look.start[0] for look in self.coming]
        times += [look.start[1] for look in (*self.startable, *self.coming) if look.start[1] is not None]
        times += [look.end[1] for look in self.running if look.end[1] is not None]
        return min((time + TICK for time in times if time >= self.time), default=None)


Window = tuple[Fraction, Fraction | None]
"""The earliest and the latest time; None is no limit."""


@dataclass
class Monitor:
    """Follows a plan that others execute.

    Args:
        plan: the plan, with the durations that may vary as parameters.
        epsilon: the separation of mutex time points.
        lateness: how late messages may come: what has not been heard of may have happened as long ago as that.

    Raises:
        UnsupportedError: if shortest paths do not decide about the plan.
    """

    plan: model.ParametrizedPlan
    epsilon: Fraction = EPSILON
    lateness: Fraction = Fraction(0)
    taken: dict[int, MonitorMessage] = field(default_factory=dict, init=False)
    """What has been said and was neither refused nor taken back, by number."""
    time: Fraction = field(default=Fraction(0), init=False)
    """What time it is at least."""

    @property
    def count(self) -> int:
        """The number of the last message."""
        return self._count

    @property
    def ended(self) -> Sequence[tuple[str, str, Fraction, Fraction]]:
        """Steps that are over: identifier, name, start and end, in the order of their starts."""
        known = ((step, progress.start, progress.end) for step, progress in self._progress.items())
        over = [(step, self._name[step], a, b) for step, a, b in known if a is not None and b is not None]
        return sorted(over, key=lambda each: each[2:])

    def __post_init__(self) -> None:
        try:
            self._slack = SlackPlan(self.plan, self.epsilon)
        except OutsideFragmentError as error:
            raise UnsupportedError(f"cannot watch this plan: {error}") from None
        self._count = 0
        self._said: dict[str, list[MonitorMessage]] = {step.identifier: [] for step in self.plan.instances}
        self._progress = {step: _Progress() for step in self._said}
        self._scale = lcm(self._slack.scale, TICKS, *(room.denominator for room, _ in self._limits.values()))
        self._bounds = self._scaled_bounds()

    # -- the networks --------------------------------------------------------------------------------------------------

    @cached_property
    def _number(self) -> Mapping[model.TimePoint, int]:
        return {point: number for number, point in enumerate(self.plan.time_points)}

    @cached_property
    def _limits(self) -> Mapping[tuple[FaceNumber, bool], tuple[Fraction, str]]:
        """How far faces may move, in units of the slack plan, and what says so; whether it is only declared."""
        limits: dict[tuple[FaceNumber, bool], tuple[Fraction, str]] = {}
        for form in self._slack.forms:
            if len(form.factors) > 1:
                raise UnsupportedError(f"cannot watch this plan: {form.name!r} is about several durations")
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
        for number, parameter in enumerate(self.plan.parameters):
            if parameter.name not in self.plan.lasting or any(len(uses.get(2 * number + k, ())) > 1 for k in (0, 1)):
                raise UnsupportedError(f"cannot watch this plan: {parameter.name} is not the duration of one step")
        return {face: self.plan.lasting[self.plan.parameters[face >> 1].name] for face in uses}

    def _scaled_bounds(self) -> Sequence[_LiveBound]:
        """All bounds, in ticks of which as many are a unit as `_scale` says."""
        factor = self._scale // self._slack.scale
        every = []
        for bound in self._slack.bounds:
            ends, origin = (bound.source, bound.target), bound.origin
            if bound.face is None:
                every.append(_LiveBound((*ends, bound.weight * factor), origin))
                continue
            step = self._step_of[bound.face]
            for declared in (True, False):
                if (bound.face, declared) in self._limits:
                    room, said = self._limits[bound.face, declared]
                    every.append(
                        _LiveBound((*ends, int((bound.weight - room) * factor)), said, step if declared else None)
                    )
            if not bound.face & 1:
                planned = f"{step} takes as long as planned, {_text(Fraction(bound.weight, self._slack.scale))}"
                every.append(_LiveBound((*ends, bound.weight * factor), planned, step, expected=True))
        for demand in self._slack.requirements(exact=True):
            said = "; ".join(dict.fromkeys(demand.names))
            every.append(_LiveBound((demand.source, demand.target, demand.weight * factor), said))
        return every

    def _counting(self, *, expected: bool) -> list[_LiveBound]:
        """The bounds that count now, of what is possible or of what is expected."""
        ended = {step for step, known in self._progress.items() if known.end is not None}
        return [each for each in self._bounds if each.step not in ended and (expected or not each.expected)]

    def _windows(self, times: Mapping[int, int], *, expected: bool) -> Sequence[tuple[int, int | None]] | None:
        bounds = [each.bound for each in self._counting(expected=expected)]
        return windows(self._slack.times, bounds, times, int(self._now * self._scale))

    @property
    def _now(self) -> Fraction:
        """Nothing that has not been heard of happened before."""
        return max(self.time - self.lateness, Fraction(0))

    def _times(self) -> dict[int, int]:
        """What has happened, in ticks."""
        times = {}
        for step, known in self._progress.items():
            instance = self.plan.instance[step]
            for point, time in ((instance.start, known.start), (instance.end, known.end)):
                if time is not None:
                    times[self._number[point]] = int(time * self._scale)
        return times

    # -- messages ------------------------------------------------------------------------------------------------------

    def say(self, kind: str, step: str = "", *, at: Number | None = None, arrived: Number | None = None) -> Outlook:
        """Tell what happened: `monitor.say("start", "drive r1 a b", at="12.5")`; floats are what they print.

        Raises:
            ValueError: for another kind than `start`, `end`, `failed`, `cancelled`, `tick` and `retract`.
        """
        happened, known = (None if time is None else parse_number(str(time)) for time in (at, arrived))
        return self.tell(MonitorMessage(MessageKind(kind), step, happened, known))

    async def told(self, message: MonitorMessage) -> Outlook:
        """As :meth:`tell`, in another thread, so that an event loop goes on; one message at a time."""
        return await asyncio.to_thread(self.tell, message)

    def tell(self, message: MonitorMessage) -> Outlook:
        """What is ahead once this is known.

        A message that contradicts what is known is refused: the answer says why, and all is as before.
        """
        self._count += 1
        return self.outlook(self._take(message))

    def continued(self, plan: model.ParametrizedPlan, after: int) -> Monitor | None:
        """A monitor of another plan of the same run, in which what runs goes on; messages go on being counted.

        None if a message after the one with this number is about a step that the other plan does not have.

        Raises:
            UnsupportedError: if shortest paths do not decide about the other plan.
        """
        other = Monitor(plan, self.epsilon, self.lateness)
        for number, message in sorted(self.taken.items()):
            other._count = number
            known = message.kind is MessageKind.TICK or message.step in plan.instance
            if other._take(message) is not None if known else number > after:
                return None
        other._count, other.time = self._count, self.time
        return other

    def _take(self, message: MonitorMessage) -> str | None:
        """Take a message in; why it is refused, if it is."""
        if message.kind is MessageKind.RETRACT:
            wrong = self.taken.pop(int(message.step), None) if message.step.isdecimal() else None
            if wrong is None:
                return f"found message {shorten(message.step)}, expected the number of one that was taken"
            if wrong.kind is not MessageKind.TICK:
                self._said[wrong.step].remove(wrong)
                self._follow(wrong.step, _Progress.of(self._said[wrong.step], self.plan.instance[wrong.step]))
            self.time = max(map(_time, self.taken.values()), default=Fraction(0))
            return None
        if message.at is None or message.at < 0 or (message.arrived is not None and message.arrived < message.at):
            latest = "" if message.arrived is None else f" and at most {_text(message.arrived)}, when it arrived"
            return f"found time {_text(message.at)}, expected at least 0{latest}"
        if message.kind is not MessageKind.TICK:
            step = message.step if message.step in self._said else self._meant(message)
            if step is None:
                names = [name for each in self.plan.instances for name in (each.identifier, str(each)[1:-1])]
                return f"found {shorten(message.step)}, expected a step of the plan{did_you_mean(message.step, names)}"
            message = replace(message, step=step)
            try:
                self._follow(step, _Progress.of([*self._said[step], message], self.plan.instance[step]))
            except _ContradictionError as error:
                return f"{error}; retract what was wrong first"
            self._said[step].append(message)
        self.taken[self._count] = message
        self.time = max(self.time, _time(message))
        return None

    def _follow(self, step: str, progress: _Progress) -> None:
        """Take note of how far a step is; networks become finer if they are too coarse for its times."""
        self._progress[step] = progress
        finer = lcm(self._scale, *(time.denominator for time in (progress.start, progress.end) if time is not None))
        if finer != self._scale:
            self._scale = finer
            self._bounds = self._scaled_bounds()

    def _meant(self, message: MonitorMessage) -> str | None:
        """The step that a name means: of those so called the first that is not yet as far, or that said the same."""
        called = message.step.strip().strip("()").lower().split()
        named = [each for each in self.plan.instances if [each.action, *each.arguments] == called]
        named.sort(key=lambda each: self._slack.times[self._number[each.start]])
        for step in (each.identifier for each in named):
            known, starts = self._progress[step], message.kind is MessageKind.START
            is_open = known.end is None and (known.start is None or not starts)
            if is_open or replace(message, step=step) in self._said[step]:
                return step
        return named[-1].identifier if named else None

    # -- answers -------------------------------------------------------------------------------------------------------

    def outlook(self, refused: str | None = None) -> Outlook:
        """What is ahead by all that is known."""
        failed = [f"{step} {known.failure}" for step, known in self._progress.items() if known.failure]
        times = self._times()
        possible = None if failed else self._windows(times, expected=False)
        if possible is None:
            reasons = failed or self._reasons(expected=False)
            return Outlook(self._count, self.time, Prospect.BROKEN, tuple(reasons), refused=refused)
        if all(known.end is not None for known in self._progress.values()):
            return Outlook(self._count, self.time, Prospect.DONE, refused=refused)
        expected = self._windows(times, expected=True)
        looks = [self._look(step, expected or possible) for step in self.plan.instances if self._is_open(step)]
        running = sorted((look for look in looks if look.since is not None), key=lambda look: look.start)
        startable = [look for look in looks if look.since is None and self._may_start(look, possible, times)]
        rest = [look for look in looks if look.since is None and look not in startable]
        return Outlook(
            self._count,
            self.time,
            Prospect.AT_RISK if expected is None else Prospect.ON_TRACK,
            tuple(self._reasons(expected=True)) if expected is None else (),
            tuple(running),
            tuple(startable),
            tuple(sorted(rest, key=lambda look: look.start[0])),
            refused,
        )

    def _is_open(self, instance: model.ActionInstance) -> bool:
        return self._progress[instance.identifier].end is None

    def _look(self, instance: model.ActionInstance, known: Sequence[tuple[int, int | None]]) -> StepOutlook:
        step = instance.identifier
        start, end = (self._unscaled(known[self._number[point]]) for point in (instance.start, instance.end))
        slack = None if end[1] is None else end[1] - start[0] - self.planned[step]
        return StepOutlook(step, self._name[step], self._progress[step].start, start, end, slack)

    def _unscaled(self, window: tuple[int, int | None]) -> Window:
        low, high = window
        return Fraction(low, self._scale), None if high is None else Fraction(high, self._scale)

    @cached_property
    def _name(self) -> Mapping[str, str]:
        return {instance.identifier: str(instance)[1:-1] for instance in self.plan.instances}

    @cached_property
    def planned(self) -> Mapping[str, Fraction]:
        """Planned durations; of steps whose duration is no parameter, by the schedule that the plan is judged by."""
        times, scale = self._slack.times, self._slack.scale
        length = {s.identifier: times[self._number[s.end]] - times[self._number[s.start]] for s in self.plan.instances}
        values = self.plan.nominal
        nominal = {step: values[name] for name, step in self.plan.lasting.items()}
        return {step: Fraction(ticks, scale) for step, ticks in length.items()} | nominal

    def _may_start(
        self, look: StepOutlook, possible: Sequence[tuple[int, int | None]], times: Mapping[int, int]
    ) -> bool:
        """Whether it may start now: all that it waits for has happened, and nothing demands that it is later."""
        point = self._number[self.plan.instance[look.step].start]
        return possible[point][0] <= self.time * self._scale and all(a in times for a in self._waits_for[point])

    @cached_property
    def _waits_for(self) -> Mapping[int, Sequence[int]]:
        """The points of steps before each point, as bounds say, unless both are at one time."""
        before: dict[int, set[int]] = {number: set() for number in self._number.values()}
        for source, target, weight in (each.bound for each in self._bounds):
            if weight >= 0 and self.plan.time_points[source].instance is not None:
                before[target].add(source)
        return {point: [a for a in others if point not in before[a]] for point, others in before.items()}

    def _reasons(self, *, expected: bool) -> Sequence[str]:
        """What contradicts itself, in the order of time, as far as it is not just what has happened."""
        counting = self._counting(expected=expected)
        bounds, times, now = [each.bound for each in counting], self._times(), int(self._now * self._scale)
        for point in range(1, len(self._slack.times)):
            bounds += [(0, point, times.get(point, now)), *([(point, 0, -times[point])] if point in times else [])]
        cycle = DifferenceNetwork(len(self._slack.times), bounds).cycle
        origins = (number for number in cycle.origins if number < len(counting)) if cycle is not None else ()
        return list(dict.fromkeys(counting[number].origin for number in origins))


@dataclass(frozen=True, slots=True)
class _LiveBound:
    """A bound in ticks and what says so; `step`: of whose duration it is declared or, if `expected`, planned, so that
    it no longer counts once the step has ended."""

    bound: Bound
    origin: str
    step: str | None = None
    expected: bool = False


class _ContradictionError(Exception):
    """Messages about a step contradict each other; internal, the message says how."""


_ORDER = tuple(MessageKind)


@dataclass(frozen=True, slots=True)
class _Progress:
    """How far a step is: when it started and ended, and the last failure, if it has not started since."""

    start: Fraction | None = None
    end: Fraction | None = None
    failure: str = ""

    @classmethod
    def of(cls, messages: Iterable[MonitorMessage], instance: model.ActionInstance) -> _Progress:
        """What messages about a step say together, in whatever order they came.

        Raises:
            _ContradictionError: if they cannot all be right.
        """
        start: Fraction | None = None
        end: Fraction | None = None
        failure = ""
        for message in sorted(messages, key=lambda each: (each.at or Fraction(0), _ORDER.index(each.kind))):
            known = {MessageKind.START: start, MessageKind.END: end}.get(message.kind)
            if known not in (None, message.at):
                said = f"found {message.step} {message.kind.value} at {_text(message.at)} and at {_text(known)}"
                raise _ContradictionError(f"{said}, expected one time")
            if message.kind is MessageKind.START:
                if end is not None and instance.durative:
                    raise _ContradictionError(f"found {message.step} end at {_text(end)}, before its start")
                start, failure = message.at, ""
                end = end if instance.durative else start
            elif message.kind is MessageKind.END:
                end = message.at
            else:
                start, end, failure = None, None, f"{message.kind.value} at {_text(message.at)}"
        return cls(start, end if start is not None else None, failure)


JOURNAL = "robust/watch-journal/1"


def read_message(text: bytes, line: int, now: Fraction | None = None) -> MonitorMessage:
    """What a line says; times that it does not say are now.

    Raises:
        InputError: with the line and what is wrong in it.
    """
    with records.in_line("input", line):
        try:
            return message_of(json_text.parse_line(text.decode(), "input"), now)
        except UnicodeDecodeError:
            raise InputError("found bytes that are no UTF-8, expected a JSON object") from None


def message_of(line: json_text.Object, now: Fraction | None = None) -> MonitorMessage:
    """What a line of a journal or of the input says; see :func:`read_message`."""
    types = json_text.JsonTypes({})
    kinds = {kind.value: kind for kind in MessageKind}
    said = [key for key in line.keys if key.value in kinds]
    if len(said) != 1:
        other = next((key for key in line.keys if key.value not in {*kinds, "at", "arrived"}), None)
        found = f"found {shorten(other.value)}" if other and not said else f"found {len(said)} of these"
        raise InputError(f"{found}, expected one of {', '.join(kinds)}", line.location)
    kind, name = kinds[said[0].value], said[0].value
    known = {name} if kind in {MessageKind.TICK, MessageKind.RETRACT} else {name, "at", "arrived"}
    if (unknown := next((key for key in line.keys if key.value not in known), None)) is not None:
        raise InputError(
            f"found {shorten(unknown.value)} with {name}, expected only {', '.join(sorted(known))}", unknown.location
        )
    if kind is MessageKind.TICK:
        return MonitorMessage(kind, at=types.member(Fraction, line, name))
    if kind is MessageKind.RETRACT:
        number = types.member(Fraction, line, name)
        return MonitorMessage(kind, str(number))
    at, arrived = (types.member(Fraction | None, line, key) for key in ("at", "arrived"))
    if at is None and now is None:
        raise InputError("found no 'at', expected the time when it happened", line.location)
    return MonitorMessage(kind, types.member(str, line, name), now if at is None else at, arrived or now)


def read_journal(
    path: str | os.PathLike[str],
    plan: model.ParametrizedPlan,
    epsilon: Fraction,
    take: Callable[[json_text.Object], object],
) -> records.RecordFile:
    """Open or begin the journal of a plan's messages, and take each of those that it holds.

    Raises:
        InputError: if it is none, of another plan, damaged or in use.
    """
    steps = [[step.identifier, str(step)] for step in plan.instances]
    digest = sha256(repr([steps, plan.constraints, plan.parameters, epsilon]).encode()).hexdigest()
    header = {"schema": JOURNAL, "plan": digest}

    def accept(number: int, text: str) -> None:
        line = json_text.parse_line(text, str(path))
        if number > 1:
            take(line)
        elif json_text.JsonTypes({}).member(str, line, "plan") != digest:
            raise InputError("found a journal of another plan, expected one of this plan")

    return records.RecordFile(path, records.RecordFormat("journal", header, chained=True), accept)


def _time(message: MonitorMessage) -> Fraction:
    """What time it is at least once this is known."""
    return max(message.at or Fraction(0), message.arrived or Fraction(0))


def _text(time: Fraction | None) -> str:
    return "none" if time is None else format_number(time)
