"""An executive for robots and people as they are: early, late, wrong about what they saw, and not always successful.

As long as everything happens as the plan has it, a :class:`PlanExecutive` decides. What that does not know is written
into the plan, and the rest is judged anew, as if the plan had always been like this:

- An activity that took less or more time than it may has bounds which allow that; one that is overdue has no upper
  bound. Where nothing correct is left if an early end counts, it counts once the least duration is over.
- An activity that failed, was aborted or cancelled has none of its effects at its end, and needs nothing until then.
- What is seen to be so, and is not by what was done, is an effect of an event of its own: it supports what needs it,
  and breaks what it contradicts. If all that may have caused it needs the same values of people's choices, they are
  taken to have these.
- What happened earlier than it was told has the time at which it happened; so has what had to be before it.

All messages and all own acts are kept. What has happened is derived from them in the order of their times, whatever
order they came in, so that a message may be late, or be taken back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias, assert_never

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import Number, shorten
from robust.pike_bridge import model
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.course import COMPLETED, Course, FieldNote, outcomes
from robust.pike_bridge.online.executive import PlanExecutive, ReportError, Thrift, check_outcome, ending, named
from robust.pike_bridge.online.semantic import Reasoner
from robust.plan.model import Atom
from robust.presented import NoTruthValue


@dataclass(frozen=True, slots=True)
class FieldState:
    """Where an execution has come to, in the plan's unit of time, to be handed over.

    Attributes:
        time: now.
        choices: values of choices that are made.
        schedule: times of events that have happened.
        running: when each activity that runs began, by its goal id.
        ended: how and when activities have ended, by their goal ids: as what reports of it are called.
        facts: what is true and what is false, of the atoms that conditions are about.
    """

    time: Fraction
    choices: Mapping[str, str]
    schedule: Mapping[str, Fraction]
    running: Mapping[str, Fraction]
    ended: Mapping[str, tuple[str, Fraction]]
    facts: Mapping[Atom, bool]


_ENDINGS = (said.Completion, *said.NOT_ACHIEVED)


def _check_state(plan: model.TeamPlan, state: FieldState) -> None:
    """InputError if a state cannot be one of an execution of the plan."""
    place, network = Location("state"), plan.network
    for name, value in state.choices.items():
        model.check_choice(network.domains, name, value, place)
    goals = [said.goal_of(number) for number in range(len(network.activities))]
    for what, names, known in (
        ("event", state.schedule, network.guards),
        ("goal", [*state.running, *state.ended], goals),
        ("end", [how for how, _ in state.ended.values()], [report.kind() for report in _ENDINGS]),
    ):
        for name in names:
            if name not in known:
                raise InputError(f"found unknown {what} {shorten(name)}{did_you_mean(name, known)}", place)
    times = *state.schedule.values(), *state.running.values(), *(at for _, at in state.ended.values())
    if (latest := max(times, default=state.time)) > state.time:
        raise InputError(f"found time {latest}, expected none after that of the state, {state.time}", place)


Planner: TypeAlias = Callable[[FieldState], model.TeamPlan | None]
"""Makes another plan for where an execution has come to, with times from then on; None if it has none."""


class FieldExecutive(NoTruthValue, ask="outcome"):
    """Executes a plan whatever robots and people report; an :class:`robust.execute.drive.Executive`.

    Args:
        plan: the plan.
        reasoner: makes the reasoning for the progress that it is given.
        early: `accept` takes an activity that ends early as ended if something correct is left then, and `wait` counts
            it as ended once its least duration is over.
        planner: asked for another plan where nothing of this one is left.
        options: those of :class:`PlanExecutive`.

    Raises:
        InputError: for another `early`.

    After a failure, reports may show that something is left after all.
    """

    def __init__(
        self,
        plan: model.TeamPlan,
        reasoner: Callable[[said.Progress], Reasoner],
        *,
        early: str = "accept",
        planner: Planner | None = None,
        **options: Any,
    ) -> None:
        self._make: Callable[[model.TeamPlan, said.Progress], PlanExecutive] = lambda judged, progress: PlanExecutive(
            judged, reasoner, progress=progress, **options
        )
        if early not in {"accept", "wait"}:
            raise InputError(f"found {shorten(early)}, expected accept or wait", Location("early"))
        self._waits, self._planner = early == "wait", planner
        self._begin(plan, Fraction(0))

    def _begin(self, plan: model.TeamPlan, now: Fraction) -> None:
        self.plan = plan
        """As it was written."""
        self._structure = said.Structure(plan)
        self.notes: list[FieldNote] = []
        """All reports that were taken and not taken back, as they came."""
        self.mended = False
        """Whether it went on after a failure with what is left from there on."""
        self._course = Course(plan, self._structure, {}, {})
        """What has happened; its own acts and choices are those that no note is about."""
        self._acts: dict[str, Fraction] = {}
        self._choices: dict[str, str] = {}
        self._past: frozenset[str] = frozenset()
        """Events that happened before a failure that was mended: what they were to keep to is of no account."""
        self._held: set[int] = set()
        """Activities whose early end counts when their least duration is over."""
        self._early: set[int] = set()
        """Activities whose early end has counted at once."""
        self._overdue: set[int] = set()
        self._deviated: set[tuple[int, bool]] = set()
        """Activities whose deviation was announced, and whether they count as ended later."""
        self._recorded: said.Failed | said.Succeeded | None = None
        """How an execution ended that is repeated."""
        self._stale = False
        """Whether notes or acts were added that the executive does not know of."""
        self._executive: PlanExecutive = self._make(plan, said.Progress(plan, now))
        self._executive.reasoner  # noqa: B018 - if it cannot be made for the plan, that is better known now

    # -- what drivers see ----------------------------------------------------------------------------------------------

    @property
    def progress(self) -> said.Progress:
        """What has happened, in the plan as it has come to be."""
        if self._stale:
            self.judge_anew(self._executive.progress.now)
        return self._executive.progress

    @property
    def reasoner(self) -> Reasoner:
        """What answers now."""
        return self._executive.reasoner

    @property
    def running(self) -> Mapping[int, Fraction]:
        """When each activity that runs began, by its place in the plan."""
        return self._executive.running

    @property
    def outcome(self) -> said.Failed | said.Succeeded | None:
        """How the execution ended, if it has."""
        return self._recorded or self._executive.outcome

    @property
    def ended(self) -> bool:
        """Whether the execution has succeeded or failed; reports may revive one that has failed."""
        return self.outcome is not None

    @property
    def undecided(self) -> bool:
        """Whether the budget of the last step did not suffice."""
        return self._executive.undecided

    @property
    def thrift(self) -> Thrift:
        """What the budget gave away so far."""
        return self._executive.thrift

    @property
    def withheld(self) -> frozenset[str]:
        """The decisions withheld, as of :class:`PlanExecutive`."""
        return self._executive.withheld

    @property
    def wake(self) -> Fraction | None:
        """When to step again if nothing is reported before."""
        if self.ended:
            return None
        moments = [self._executive.wake, *self._awaited]
        return min((moment for moment in moments if moment is not None), default=None)

    def prepare(self) -> bool:
        """Prepare as by :meth:`PlanExecutive.prepare`."""
        return self._executive.prepare()

    def possible_values(self, choice: str) -> tuple[str, ...]:
        """The values that :meth:`PlanExecutive.possible_values` gives."""
        return self._executive.possible_values(choice)

    @classmethod
    def resumed(
        cls, plan: model.TeamPlan, reasoner: Callable[[said.Progress], Reasoner], state: FieldState, **options: Any
    ) -> FieldExecutive:
        """An executive that goes on from where another one, perhaps of another program, has come to.

        Raises:
            InputError: if the state names a choice, a value, an event or a goal that the plan does not have, or a time
                that is not yet.
        """
        executive = cls(plan, reasoner, **options)
        _check_state(plan, state)
        reports = {report.kind(): report for report in _ENDINGS}
        places = {said.goal_of(place): place for place in range(len(plan.network.activities))}
        acts = frozenset(state.schedule)
        executive._acts = dict(state.schedule)
        executive._choices = {name: value for name, value in state.choices.items() if executive._is_ours(name)}
        told: list[tuple[said.Report, tuple[int, ...]]] = [
            (said.Outcome(*item), ()) for item in state.choices.items() if item[0] not in executive._choices
        ]
        for goal, since in state.running.items():
            activity = plan.network.activities[places[goal]]
            if state.schedule.get(activity.source) != since:  # it was not begun when it was dispatched
                told.append((said.Began(activity.action, goal=goal, at=since), (places[goal],)))
        for goal, (how, at) in state.ended.items():
            action = plan.network.activities[places[goal]].action
            told.append((reports[how](action, goal=goal, at=at), (places[goal],)))
        for report, about in told:
            executive.notes.append(FieldNote(report, state.time if report.at is None else report.at, about, acts))
        true, false = (
            frozenset(atom for atom, holds in state.facts.items() if holds is side) for side in (True, False)
        )
        executive.notes.append(FieldNote(said.Estimate(true, false), state.time, acts=acts))
        executive.judge_anew(state.time)
        early = executive._course.early()
        executive._held = {place for place in early if plan.network.activities[place].target not in state.schedule}
        executive._early = early - executive._held
        executive.judge_anew(state.time)
        return executive

    def state(self) -> FieldState:
        """Where the execution has come to."""
        progress = self.progress
        return FieldState(
            progress.now,
            dict(progress.chosen),
            {event: time for event, time in progress.times.items() if event in self._structure.guards},
            {said.goal_of(place): self._course.begun.get(place, since) for place, since in self.running.items()},
            {said.goal_of(place): end for place, end in self._course.ended.items()},
            self._course.facts(progress.now),
        )

    def step(self, now: Number, messages: Sequence[said.Message] = ()) -> list[said.Decision]:
        """Take note of what has happened, and do what can be done now, as :meth:`PlanExecutive.step`.

        Raises:
            InputError: if `now` is no number, or a message is none.
            OutOfTimeError: if the deadline passes.
        """
        now = said.require_step(now, messages)
        if isinstance(self.outcome, said.Succeeded) or (self.ended and not messages):
            return [said.Rejected(str(message), "the execution has ended", now) for message in messages]
        before, running, now = self.progress, self.running, max(now, self.progress.now)
        decisions: list[said.Decision] = []
        taken: list[said.Message] = []
        anew = self.ended | self._is_overdue(now) | self._counts(now)
        for message in messages:
            try:
                anew |= self._take(message, now)
                taken.append(message)
            except ReportError as error:
                decisions.append(said.Rejected(str(message), str(error), now))
        self._stale = True  # until the step is done: if it is out of time, the next one begins with what is noted
        if anew:
            estimates = (message for message in taken if isinstance(message, said.Estimate))
            broken = [violation for each in estimates for violation in self._executive.violations(each)]
            self._judge_with_early_ends(now)
            seen = {literal for _, literal in self._course.seen}
            decisions += (each for each in broken if model.Literal(each.atom, not each.expected) in seen)
            decisions += self._changes(before, running)
            taken = []
        news = [message for message in taken if not isinstance(message, said.Estimate)]  # these are as they should be
        acted = self._acted(self._executive.step(now, news))
        self._drop(each.message for each in acted if isinstance(each, said.Rejected))
        decisions += acted
        self._stale = False
        if isinstance(self.outcome, said.Failed):
            decisions[-1:] = self._mended(now, self.outcome)
        return decisions

    def repeat(
        self,
        now: Fraction,
        messages: Sequence[said.Message],
        decisions: Iterable[said.Decision],
        *,
        undecided: bool = False,
    ) -> None:
        """Take an earlier step again as it was decided then; nothing is asked.

        If it was `undecided`, the next one goes on.

        Raises:
            InputError: if a planner made another plan then, which no record has, or if a message was taken that
                contradicts what came before it.
        """
        if isinstance(self.outcome, said.Succeeded) or (self.ended and not messages):
            return  # nothing was taken any more
        decisions = tuple(decisions)
        self._is_overdue(now)
        refused = [each.message for each in decisions if isinstance(each, said.Rejected)]
        for message in messages:
            try:
                self._take(message, now)
            except ReportError as error:
                if str(message) not in refused:
                    raise InputError(f"found {message} taken, expected it to be rejected: {error}") from None
                refused.remove(str(message))
        self._drop(refused)
        self.judge_anew(now)
        for decision in decisions:
            match decision:
                case said.Resumed(planned=True):
                    raise InputError(f"found another plan of a planner at {now}, expected an execution of one plan")
                case said.Resumed():
                    self._release()
                case said.Deviated() if decision.counts is not None:
                    self._held |= self._course.early() - self._early
        self._early = self._course.early() - self._held
        self._acted(decisions)
        self.judge_anew(now)
        self._executive.repeat(now, (), (), undecided=undecided)
        self._newly_deviated(now)  # it was announced then
        ends = (decision for decision in decisions if isinstance(decision, said.Failed | said.Succeeded))
        self._recorded = next(ends, None)

    def _drop(self, refused: Iterable[str]) -> None:
        """Forget what was noted last and then rejected, because something happened at that moment."""
        for text in refused:
            note = next((note for note in reversed(self.notes) if str(note.report) == text), None)
            if note is not None:
                self.notes.remove(note)

    # -- what is told --------------------------------------------------------------------------------------------------

    def _take(self, message: said.Message, now: Fraction) -> bool:
        """Note a message; whether more follows from it than from the same as the plan has it.

        Raises:
            ReportError: if it contradicts what is known.
        """
        if isinstance(message, said.Retract):
            note = next((note for note in reversed(self.notes) if note.report == message.message), None)
            if note is None:
                raise ReportError("nobody has said that")
            self.notes.remove(note)
            self.judge_anew(now)  # what comes next is held against what is known without it
            return True
        at = now if message.at is None else message.at
        if not 0 <= at <= now:
            raise ReportError(f"found a time that is {'not yet' if at > now else 'before the beginning'}")
        note = FieldNote(message, at, self._places(message, at), frozenset(self._acts))
        usual = at == now and self._is_usual(note)
        self.notes.append(note)
        self._course.chosen |= self._shown(note)
        if isinstance(message, said.Began):
            self._course.begun.update(dict.fromkeys(note.places, at))
        elif isinstance(message, said.Completion | said.NotAchieved):
            self._course.ended.update(dict.fromkeys(note.places, (message.kind(), at)))
            if self._waits:
                self._held |= self._course.early()
        return not usual

    def _shown(self, note: FieldNote) -> Mapping[str, str]:
        """The values of choices that follow from a message."""
        begun = note.places if isinstance(note.report, said.Began) else ()
        sources = (self.plan.network.activities[place].source for place in begun)
        return dict(pair for event in sources for pair in self._structure.guards[event]) | dict(outcomes(note.report))

    def _places(self, message: said.Report, at: Fraction) -> tuple[int, ...]:
        """The activities that a message is about; ReportError if it contradicts what is known."""
        match message:
            case said.Outcome(choice, value):
                self._object(choice, value, message)
                return ()
            case said.Estimate(true, false):
                if true & false:
                    raise ReportError(f"{min(true & false)} is said to be both true and false")
                return ()
            case said.Began():
                return self._beginning(message)
            case said.Completion():
                for choice, value in message.outcomes.items():
                    if self._course.chosen.get(choice) != value or self._is_ours(choice):
                        self._object(choice, value, said.Outcome(choice, value))
                return self._ending(message, at)
            case said.NotAchieved():
                return self._ending(message, at)
            case _:
                assert_never(message)

    def _is_usual(self, note: FieldNote) -> bool:
        """Whether a note of now is of what the plan has."""
        match note.report:
            case said.Outcome(choice):
                return note.report.at is None and choice not in self._course.inferred
            case said.Estimate():
                return not self._course.unexpected(note.report, note)
            case said.Began():
                return all(self.running.get(place) == note.at for place in note.places)
            case said.Completion():
                return not note.report.outcomes and all(self._is_usual_end(place, note.at) for place in note.places)
            case _:
                return False

    def _is_ours(self, choice: str) -> bool:
        return choice in self.plan.network.domains and choice not in self.plan.network.uncontrollable

    def _object(self, choice: str, value: str, message: said.Outcome) -> None:
        known = {name: each for name, each in self._course.chosen.items() if name not in self._course.inferred}
        check_outcome(self.plan, known, message)

    def _beginning(self, message: said.Began) -> tuple[int, ...]:
        alike, course = named(self.plan, message), self._course
        activities = self.plan.network.activities
        dispatched = [place for place in alike if place in self.running and place not in course.begun]
        coming = [
            place
            for place in alike
            if activities[place].source in self.progress.pending
            and not model.contradicts(
                model.guard(course.chosen), activities[place].guard | self._structure.guards[activities[place].source]
            )
        ]
        candidates = dispatched or coming
        if not candidates:
            raise ReportError("it has begun already, or cannot begin any more")
        if len({activities[place].target for place in candidates}) > 1:
            raise ReportError("there are several; say at which event it ends")
        if not dispatched:
            before = self._structure.preceding(activities[candidates[0]].source)
            unfinished = next(
                (event for event in before if event in self.progress.pending and self._structure.ends[event]), None
            )
            if unfinished is not None:
                raise ReportError(f"what ends at {unfinished} is before it, and has not ended")
        return tuple(candidates)

    def _ending(self, message: said.Ending, at: Fraction) -> tuple[int, ...]:
        ended = ending(self.plan, message, self.running.keys() - self._course.ended.keys())
        if any(at < self.running[place] for place in ended):
            raise ReportError("found an end before the beginning")
        return tuple(ended)

    def _is_usual_end(self, place: int, at: Fraction) -> bool:
        """Whether an activity ends within its bounds."""
        activity, lasted = self.plan.network.activities[place], at - self.running[place]
        return place not in self._course.begun and _within(lasted, activity.lower, activity.upper)

    def _is_overdue(self, now: Fraction) -> bool:
        """Whether an activity has become overdue."""
        activities = self.plan.network.activities
        late = {
            place
            for place, since in self.running.items()
            if (upper := activities[place].upper) is not None and now - self._course.begun.get(place, since) > upper
        }
        new, self._overdue = late - self._overdue, late
        return bool(new)

    def _counts(self, now: Fraction) -> bool:
        """Whether an early end has begun to count."""
        return any(moment <= now for moment in self._awaited)

    @property
    def _awaited(self) -> list[Fraction]:
        """When early ends will count that do not yet."""
        course, now = self._course, self._executive.progress.now
        activities = self.plan.network.activities
        held = (place for place in self._held & course.ended.keys() if activities[place].target not in course.times)
        return [moment for moment in map(course.counts_from, held) if moment > now]

    # -- what follows --------------------------------------------------------------------------------------------------

    def judge_anew(self, now: Fraction) -> None:
        """Derive what has happened and the plan that it shows, for an executive of their own."""
        self._stale, self._recorded = False, None
        course = self._course = Course(self.plan, self._structure, dict(self._acts), dict(self._choices))
        course.take(self.notes, self._held, now)
        plan = course.as_it_shows(self._past, now)
        times = dict(sorted(course.times.items(), key=lambda item: item[1]))
        progress = said.Progress(plan, now, times, dict(course.chosen), set(), course.reported)
        thrift, self._executive = self._executive.thrift, self._make(plan, progress)
        self._executive.thrift = thrift
        for place in course.ended:  # it may be at an event where others end that still run
            self._executive.running.pop(place, None)

    def _judge_with_early_ends(self, now: Fraction) -> None:
        """Early ends count at once if something correct is left then, and else later if something is left so."""
        self.judge_anew(now)
        new = self._course.early() - self._held - self._early
        if new and not self._executive.prepare():
            self._held |= new
            self.judge_anew(now)
            if not self._executive.prepare():
                self._held -= new
                self.judge_anew(now)
        self._early = self._course.early() - self._held

    # -- what is announced ---------------------------------------------------------------------------------------------

    def _acted(self, decisions: Sequence[said.Decision]) -> Sequence[said.Decision]:
        """Take note of what the executive has done."""
        for decision in decisions:
            if isinstance(decision, said.Executed):
                self._course.times[decision.event] = decision.time
                for variable, value in self._structure.guards[decision.event]:
                    self._course.chosen.setdefault(variable, value)
                if not decision.reported:
                    self._acts[decision.event] = decision.time
            elif isinstance(decision, said.Chosen):
                self._course.chosen[decision.choice] = decision.value
                if not decision.observed:
                    self._choices[decision.choice] = decision.value
        return decisions

    def _changes(self, before: said.Progress, running: Mapping[int, Fraction]) -> Iterator[said.Decision]:
        """What has turned out to be so, beside what a message says outright."""
        progress, activities = self._executive.progress, self.plan.network.activities
        for place in running:
            if activities[place].source not in progress.times:  # what it began with was not so
                yield said.Cancel(activities[place].action, activities[place].agent, progress.now, said.goal_of(place))
        for event, time in progress.times.items():
            if before.times.get(event) != time and event in self._structure.guards:
                yield said.Executed(event, time, reported=True)
        for choice, value in progress.chosen.items():
            if before.chosen.get(choice) != value:
                yield said.Chosen(choice, value, progress.now, observed=True)
        for place, since in self.running.items():
            if before.times.get(activities[place].source) != since and place not in self._course.begun:
                each = activities[place]
                goal, limits = said.goal_of(place), (each.lower, each.upper)
                yield said.Dispatched(each.action, each.agent, progress.now, each.target, *limits, goal)
        for place in self._newly_deviated(progress.now):
            each = activities[place]
            counts = self._course.counts_from(place) if place in self._held else None
            lasted = self._lasted(place, progress.now)
            yield said.Deviated(each.action, progress.now, lasted, each.lower, each.upper, counts)

    def _newly_deviated(self, now: Fraction) -> list[int]:
        """Activities that did not keep to their bounds, or do not by now, which is announced once."""
        activities = self.plan.network.activities
        outside = {
            (place, place in self._held)
            for place in self._overdue.union(self._course.ended)
            if activities[place].source in self._course.times
            and not _within(self._lasted(place, now), activities[place].lower, activities[place].upper)
        }
        new, self._deviated = sorted(place for place, _ in outside - self._deviated), outside
        return new

    def _lasted(self, place: int, now: Fraction) -> Fraction:
        """How long an activity took, or has taken by now."""
        begun = self._course.begun.get(place, self._course.times[self.plan.network.activities[place].source])
        return self._course.ended.get(place, (COMPLETED, now))[1] - begun

    # -- what is left after a failure ----------------------------------------------------------------------------------

    def _mended(self, now: Fraction, failed: said.Failed) -> Sequence[said.Decision]:
        """How it goes on after a failure, if it does."""
        before = self._past, dict(self._choices), self.mended
        released = self._release()
        if released or self._past != before[0]:  # else that is what has failed
            self.judge_anew(now)
            announced = [said.Resumed(now, released), *self._acted(self._executive.step(now))]
            if not isinstance(self.outcome, said.Failed):
                return announced
        self._past, self._choices, self.mended = before
        self.judge_anew(now)
        self._recorded = failed
        plan = None if self._planner is None else self._planner(self.state())
        if plan is not None:  # nothing of this one is kept
            self._begin(plan, now)
            return [said.Resumed(now, (), planned=True), *self._acted(self._executive.step(now))]
        activities = self.plan.network.activities
        running = ((activities[place], said.goal_of(place)) for place in self.running)
        return [*(said.Cancel(each.action, each.agent, now, goal) for each, goal in running), failed]

    def _release(self) -> tuple[str, ...]:
        """Let the plan be what is left from here on: what was chosen and nobody has acted upon is open again."""
        self._past, self.mended = frozenset(self._course.times), True
        guards = self._structure.guards
        acted_upon = {variable for event in self._past & guards.keys() for variable, _ in guards[event]}
        released = tuple(choice for choice in self._choices if choice not in acted_upon)
        for choice in released:
            del self._choices[choice]
        return released


TeamExecutive: TypeAlias = PlanExecutive | FieldExecutive


def _within(lasted: Fraction, lower: Fraction, upper: Fraction | None) -> bool:
    return lower <= lasted and (upper is None or lasted <= upper)
