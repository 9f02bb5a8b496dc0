"""An executive as a service: requests come in as lines of JSON, decisions go out as JSON objects; journals.

The answer to each request ends with one object of a kind that :data:`CLOSING` names, so that the client knows when to
go on. There is no clock and no stream in here.

A journal is a :mod:`file of records <robust.records>`, one for each step, after one that identifies the plan. A step is
on disk before it is announced; so a line that a crash has cut off can be dropped, and all other steps are repeated by
:meth:`PlanExecutive.repeat` without any search.
"""

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, fields, is_dataclass
from fractions import Fraction
from hashlib import sha256
from typing import Any, TypeAlias, assert_never

from robust import json_text, records
from robust.errors import InputError, Location, did_you_mean
from robust.numbers import shorten
from robust.pike_bridge.compile import checked_assumptions
from robust.pike_bridge.likelihood import LikelyChoices, chance_answer
from robust.pike_bridge.model import TeamPlan, check_choice, guard
from robust.pike_bridge.online import explain
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.field import FieldExecutive, FieldState, TeamExecutive
from robust.pike_bridge.online.progress import JSON, Decision, Executed, Message
from robust.smt.limits import NEVER, Deadline

JOURNAL_SCHEMA = "robust/pike-journal/1"


@dataclass(frozen=True, slots=True)
class JournalStep:
    """What happened at one moment, in the plan's unit of time, and what was decided."""

    time: Fraction
    messages: tuple[Message, ...] = ()
    decisions: tuple[Decision, ...] = ()
    undecided: bool = False
    """Whether its budget did not suffice, so that the next one goes on."""


class Journal(records.RecordFile):
    """A journal that can be written to; a context manager. `steps` are those that were there when it was opened.

    One process at a time: the file is locked until it is closed, or its process is no more.
    """

    def __init__(self, path: str | os.PathLike[str], plan: TeamPlan) -> None:
        """Open a journal of this plan, or begin one.

        A line that was cut off is removed.

        Raises:
            InputError: if the file is no journal, is of another plan, or is damaged, with the line; if it is in use, or
                cannot be opened.
        """
        steps: list[JournalStep] = []
        super().__init__(path, _format(plan), _accepting(plan, str(path), steps))
        self.steps = tuple(steps)

    def write(self, step: JournalStep) -> None:
        """Add a step; when this returns, it is on disk.

        Raises:
            InputError: if it cannot be written; then the journal is as it was.
        """
        self.append(JSON.write(JournalStep, step))


def read_journal(path: str | os.PathLike[str], plan: TeamPlan) -> tuple[JournalStep, ...]:
    """The steps of a journal, which may be in use; a last line that is not complete is left out.

    Args:
        path: the file that :class:`Journal` writes.
        plan: the plan that was executed.

    Returns:
        For each step its time, in the plan's unit, what was reported, and what was decided.

    Raises:
        InputError: if the file cannot be read, is no journal, is of another plan, or is damaged; the message has the
            line.
    """
    steps: list[JournalStep] = []
    records.read_records(path, _format(plan), _accepting(plan, str(path), steps))
    return tuple(steps)


def resume(executive: TeamExecutive, steps: Iterable[JournalStep], file: str = "journal") -> None:
    """Bring an executive that has done nothing yet to where the steps end.

    Args:
        executive: the executive, which is changed.
        steps: what :func:`read_journal` returns.
        file: the name of the journal in messages.

    Raises:
        InputError: if a step does not fit what came before it.
    """
    for line, step in enumerate(steps, 2):
        retracts = any(isinstance(message, said.Retract) for message in step.messages)  # then it was not, perhaps
        known = executive.progress.times.keys() - (executive.progress.reported if retracts else set())
        pending = executive.plan.network.guards.keys() - known
        acts = (each.event for each in step.decisions if isinstance(each, Executed) and not each.reported)
        for event in acts:
            if event not in pending:
                raise InputError(
                    f"found event {shorten(event)} executed, expected one of the plan that was not yet",
                    Location(file, line),
                )
            pending.remove(event)
        with records.in_line(file, line):
            executive.repeat(step.time, step.messages, step.decisions, undecided=step.undecided)


def plan_digest(plan: TeamPlan) -> str:
    """A checksum of all that an execution depends on: network, conditions, effects and ε, not what is likely."""
    return sha256(json.dumps(_canonical(plan), separators=(",", ":")).encode()).hexdigest()


def _canonical(value: object) -> object:
    """A value as lists of texts, the same in every process."""
    if is_dataclass(value):
        return [
            _canonical(getattr(value, field.name))
            for field in fields(value)
            if field.compare and field.name != "probability"
        ]
    if isinstance(value, frozenset):
        return sorted((_canonical(item) for item in value), key=repr)
    if isinstance(value, tuple):
        return [_canonical(item) for item in value]
    return None if value is None else str(value)


@dataclass(frozen=True, slots=True)
class _Header:
    """The first line of a journal: of which plan it is."""

    schema: str
    plan: str
    digest: str
    epsilon: Fraction


def _format(plan: TeamPlan) -> records.RecordFormat:
    header = _Header(JOURNAL_SCHEMA, plan.name, plan_digest(plan), plan.epsilon)
    return records.RecordFormat("journal", JSON.write(_Header, header), chained=True)


def _accepting(plan: TeamPlan, file: str, steps: list[JournalStep]) -> records.Accept:
    """Takes the lines of a journal of a plan, and adds what they say to the steps."""

    def accept(number: int, text: str) -> None:
        line = json_text.parse_line(text, file)
        if number == 1:
            _check_header(JSON.read(_Header, line), plan)
            return
        step: JournalStep = JSON.read(JournalStep, line)
        if steps and step.time < steps[-1].time:
            message = f"found time {step.time}, expected {steps[-1].time} or later"
            raise InputError(message, line.members["time"].location)
        steps.append(step)

    return accept


def _check_header(header: _Header, plan: TeamPlan) -> None:
    name = shorten(header.plan)
    if header.plan != plan.name:
        raise InputError(f"found a journal of plan {name}, expected one of {shorten(plan.name)}")
    if header.epsilon != plan.epsilon:
        raise InputError(f"found a journal with ε = {header.epsilon}, expected one with {plan.epsilon}")
    if header.digest != plan_digest(plan):
        raise InputError(f"found a journal of another version of plan {name}, expected one of this plan")


SCHEMA = "robust/pike-stdio/1"
INPUT = "input"
"""What error messages call the lines that come in."""
CLOSING = ("wake", "end", "possible", "state", "why", "chance", "error")
"""The last object of an answer is of one of these kinds."""
Encoded: TypeAlias = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Tick(json_text.Tagged):
    """Nothing but time."""


@dataclass(frozen=True, slots=True)
class Together(json_text.Tagged):
    """Several messages about one moment."""

    messages: tuple[said.Message, ...] = ()


@dataclass(frozen=True, slots=True)
class AskPossible(json_text.Tagged):
    """Which values have open choices left?"""

    KIND = "possible"


@dataclass(frozen=True, slots=True)
class AskState(json_text.Tagged):
    """What has happened so far?"""

    KIND = "state"


@dataclass(frozen=True, slots=True)
class AskWhy(json_text.Tagged):
    """Why is no correct execution left, under assumptions?"""

    KIND = "why"
    assume: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class AskChance(json_text.Tagged):
    """How likely is success by now, and what may people choose?"""

    KIND = "chance"


Query: TypeAlias = AskPossible | AskState | AskWhy | AskChance
News: TypeAlias = said.Message | Tick | Together


@dataclass(frozen=True, slots=True)
class Request:
    """What a line says: what has happened at one moment; a question, which changes nothing; or why it is wrong."""

    line: int
    content: tuple[said.Message, ...] | Query | str
    time: Fraction | None = None
    """Of messages; None where it is the moment of arrival."""


def read_request(text: bytes, line: int, plan: TeamPlan, *, timed: bool) -> Request:
    """What a line asks for; `timed` says whether it gives the time, or the clock does."""
    try:
        with records.in_line(INPUT, line):
            return _request(text, line, plan, timed=timed)
    except InputError as error:
        return Request(line, str(error))


def _request(text: bytes, line: int, plan: TeamPlan, *, timed: bool) -> Request:
    try:
        line_object = json_text.parse_line(text.decode(), INPUT)
    except UnicodeDecodeError:
        raise InputError("found bytes that are no UTF-8, expected a JSON object") from None
    request: News | Query = said.JSON.read(News | Query, line_object, beside=("time",))
    asked = isinstance(request, Query)
    if "time" in line_object.members and (asked or not timed):
        reason = "questions have none" if asked else "the clock is real"
        raise InputError(f"found a time, expected none: {reason}", line_object.members["time"].location)
    match request:
        case AskWhy() | AskPossible() | AskState() | AskChance():
            checked_assumptions(plan, request.assume if isinstance(request, AskWhy) else {})
            return Request(line, request)
        case Together(messages):
            listed = line_object.members.get("messages")
            places = [each.location for each in listed.items] if isinstance(listed, json_text.Array) else []
        case Tick():
            messages, places = (), []
        case _:
            messages, places = (request,), [line_object.location]
    for message, place in zip(messages, places, strict=True):
        check_message(plan, message, place)
    return Request(line, messages, said.JSON.member(Fraction, line_object, "time") if timed else None)


def check_message(plan: TeamPlan, message: said.Message, location: Location | None = None) -> None:
    """What can be said of a message by the plan alone, whatever has happened.

    Atoms that nothing in the plan mentions are allowed: sensors see more of the world than a plan needs.

    Raises:
        InputError: if it names a choice, a value, an activity or an event that the plan does not have, or makes a
            choice that is for the executive.
    """
    match message:
        case said.Outcome(name, value):
            check_choice(plan.network.domains, name, None, location)
            if name in (choice.name for choice in plan.network.choices if choice.controllable):
                raise InputError(f"found choice {name}, expected one that is not for the executive to make", location)
            check_choice(plan.network.domains, name, value, location)
        case said.Completion() | said.Began() | said.NotAchieved():
            _check_activity(plan, message, location)
        case said.Estimate():
            pass
        case said.Retract():
            check_message(plan, message.message, location)
        case _:
            assert_never(message)
    for name, value in message.outcomes.items() if isinstance(message, said.Completion) else ():
        check_message(plan, said.Outcome(name, value), location)


def _check_activity(
    plan: TeamPlan, message: said.Completion | said.Began | said.NotAchieved, location: Location | None
) -> None:
    """InputError if it names an activity, an event or a goal that the plan does not have."""
    activities = plan.network.activities
    ends = {activity.target for activity in activities if activity.action == message.action}
    if not ends:
        suggestion = did_you_mean(message.action, {activity.action for activity in activities})
        reason = f"found unknown activity {shorten(message.action)}, expected one of the plan{suggestion}"
        raise InputError(reason, location)
    if message.event is not None and message.event not in ends:
        expected = f"where {message.action} ends: {', '.join(sorted(ends))}"
        raise InputError(f"found event {shorten(message.event)}, expected {expected}", location)
    goals = [said.goal_of(place) for place, each in enumerate(activities) if each.action == message.action]
    if message.goal is not None and message.goal not in goals:
        expected = f"that of a dispatch of {message.action}: {', '.join(goals)}"
        raise InputError(f"found goal {shorten(message.goal)}, expected {expected}", location)


@dataclass
class Service:
    """Answers requests about one executive, which has done nothing yet.

    Args:
        thinking: entered wherever solvers work and may be interrupted; never while a step is written or announced.
        tolerance: how much later than it was due a step counts as on time, where time is real.
        likely: what knows how likely success is; None: nobody does.
    """

    executive: TeamExecutive
    journal: Journal | None = None
    solver: str = "z3"
    deadline: Deadline = NEVER
    thinking: Callable[[], AbstractContextManager[None]] = nullcontext
    tolerance: Fraction = Fraction(0)
    likely: LikelyChoices | None = None
    steps: int = field(init=False, default=0)
    time: Fraction = field(init=False, default=Fraction(0))
    """Of the last step."""

    @property
    def ended(self) -> bool:
        """Whether the execution has succeeded or failed; questions are answered all the same."""
        return self.executive.ended

    @property
    def wake(self) -> Fraction | None:
        """When the next step is due if nothing is told before; the first one is due at once."""
        return self.executive.wake if self.steps else self.time

    def greet(self) -> Iterator[Encoded]:
        """A greeting, the decisions that the journal holds, and when to go on.

        Raises:
            InputError: if the journal does not fit the plan.
            OutOfTimeError: if the deadline passes.
        """
        plan = self.executive.plan
        before = self.journal.steps if self.journal is not None else ()
        yield {
            "kind": "hello",
            "schema": SCHEMA,
            "plan": plan.name,
            "epsilon": str(plan.epsilon),
            "grid": str(self.executive.progress.grid),
            "backend": self.executive.reasoner.name,
            "resumed": bool(before),
            "steps": len(before),
        }
        if self.journal is not None:
            resume(self.executive, before, str(self.journal.path))
        for step in before:
            self.steps, self.time = self.steps + 1, step.time
            for decision in step.decisions:
                yield {**self._numbered(decision), "repeated": True}
        yield self._closing()

    def answer(self, request: Request, now: Fraction | None = None) -> Iterator[Encoded]:
        """What is said to a request; `now` is when it arrived, where time is real.

        Raises:
            InputError: if the journal cannot be written.
            OutOfTimeError: if the deadline passes; then the step that was under way is as if it had not begun.
        """
        match request.content:
            case str(message):
                yield {"kind": "error", "line": request.line, "message": message}
            case tuple(messages):
                moment = request.time if request.time is not None else max(now or self.time, self.time)
                if moment < self.time:
                    message = f"{Location(INPUT, request.line)}: found time {moment}, expected {self.time} or later"
                    yield {"kind": "error", "line": request.line, "message": message}
                else:
                    yield from self.step(moment, messages)
            case query:
                with self.thinking():
                    answer = self._replied(query)
                yield {"kind": query.kind(), "line": request.line, **answer}

    def due(self, now: Fraction) -> Iterator[Encoded]:
        """Take the steps that are due by now, each at its time, or now if that is long ago.

        Raises:
            InputError: if the journal cannot be written.
            OutOfTimeError: if the deadline passes.
        """
        while not self.ended and (wake := self.wake) is not None and wake <= now:
            yield from self.step(now if now - wake > self.tolerance else wake, ())
            if self.executive.undecided:  # messages are heard before it thinks on
                return

    def step(self, moment: Fraction, messages: tuple[said.Message, ...]) -> Iterator[Encoded]:
        """Take a step, write it down, and then announce it.

        Raises:
            InputError: if the journal cannot be written.
            OutOfTimeError: if the deadline passes.
        """
        over = self.ended and not (messages and isinstance(self.executive, FieldExecutive))
        with self.thinking():
            decisions = self.executive.step(moment, messages)
        if not over:
            if self.journal is not None:
                self.journal.write(JournalStep(moment, messages, tuple(decisions), self.executive.undecided))
            self.steps, self.time = self.steps + 1, moment
        for decision in decisions:
            yield self._numbered(decision)
        yield self._closing()

    def end(self, outcome: str) -> Encoded:
        """The last words about an execution."""
        return {"kind": "end", "outcome": outcome, "time": str(self.time), "step": self.steps}

    def _numbered(self, decision: said.Decision) -> Encoded:
        return {**said.JSON.write(said.Decision, decision), "step": self.steps}

    def _closing(self) -> Encoded:
        if self.executive.outcome is not None:
            return self.end(self.executive.outcome.kind())
        with self.thinking():
            wake = self.wake
        return {"kind": "wake", "time": None if wake is None else str(wake), "step": self.steps}

    def _replied(self, query: Query) -> Encoded:
        progress = self.executive.progress
        match query:
            case AskPossible():
                open_choices = [name for name in self.executive.plan.network.domains if name not in progress.chosen]
                return {"values": {name: list(self.executive.possible_values(name)) for name in open_choices}}
            case AskWhy(assume):
                facts = explain.conflict(progress, guard(assume), solver=self.solver, deadline=self.deadline)
                reasons = None if facts is None else [fact.as_dict() for fact in facts]
                return {"possible": facts is None, "conflict": reasons}
            case AskState():
                return self._state()
            case AskChance():
                if self.likely is None:
                    return {"success": None, "intents": {}}
                forecast = self.likely.forecast(progress.chosen)
                return chance_answer(forecast.success, forecast.intents())

    def _state(self) -> Encoded:
        progress, activities = self.executive.progress, self.executive.plan.network.activities
        outcome = self.executive.outcome
        state = self.executive.state() if isinstance(self.executive, FieldExecutive) else None
        begun = {said.goal_of(place): since for place, since in self.executive.running.items()}
        return {
            "time": str(self.time),
            "step": self.steps,
            "outcome": None if outcome is None else outcome.kind(),
            "choices": dict(progress.chosen),
            "schedule": {event: str(time) for event, time in progress.times.items()},
            "running": [
                {
                    "action": activities[place].action,
                    "agent": activities[place].agent,
                    "end": activities[place].target,
                    "goal": goal,
                    "since": str(since if state is None else state.running[goal]),
                }
                for place, (goal, since) in zip(self.executive.running, begun.items(), strict=True)
            ],
            **({} if state is None else self._field_state(state)),
        }

    @staticmethod
    def _field_state(state: FieldState) -> Encoded:
        return {
            "ended": {goal: {"how": how, "at": str(at)} for goal, (how, at) in state.ended.items()},
            "facts": {str(atom): holds for atom, holds in state.facts.items()},
        }
