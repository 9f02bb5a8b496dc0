"""The executive: carries a plan with choices out, one step after the other [PIKE, Algorithms 1 to 3].

It is an :class:`robust.execute.drive.Executive`: told what has happened and how late it is, it decides what is done
now and when to look again. Whatever it decides, a correct execution remains possible; when none is left, it says so.
"""

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, partial
from typing import NamedTuple, assert_never

from robust.numbers import Number
from robust.pike_bridge import model, semantics
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online import semantic
from robust.pike_bridge.online.patience import Patience, openings, ranked_events, ranked_values, values_of
from robust.searching import Searching, Status, Stoppable
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

Ranking = Callable[[Sequence[str]], Sequence[str]]
"""Puts alternatives in the order in which they are tried."""


PAUSES = 20
"""Steps in a row that go on deciding at one time; then time goes on as well, and each one has twice as long."""
_ACTING, _LOOKING, _RANKING, _ALARM = 0.75, 0.1, 0.25, 0.1
"""Of the budget, at most for what is done, and at least for when to take the next step; the rest is for all else. What
is ranked gets at most this of it at a time, and so does how long what is withheld can wait."""
FlexibleRanking = Callable[[Sequence[str], semantic.SemanticReasoner, Deadline], Sequence[str]]
Preference = Callable[[str, Sequence[str], Mapping[str, str]], Sequence[str]]
"""Puts the values of a choice in the order in which they are tried, by the choices that are made."""


def as_written(alternatives: Sequence[str]) -> Sequence[str]:
    """The order of the plan."""
    return alternatives


class ReportError(Exception):
    """A message cannot be taken; it says why."""


def check_outcome(plan: model.TeamPlan, known: Mapping[str, str], message: said.Outcome) -> None:
    """ReportError if an outcome cannot be taken where the values of some choices are known."""
    name, value = message.choice, message.value
    choice = next((choice for choice in plan.network.choices if choice.name == name), None)
    if choice is None:
        raise ReportError(f"there is no choice {name!r}")
    if choice.controllable:
        raise ReportError(f"{name} is for the executive to choose")
    if value not in choice.domain:
        raise ReportError(f"expected one of {', '.join(choice.domain)}")
    if name in known:
        raise ReportError("known already" if known[name] == value else f"{name} = {known[name]} was observed before")


def named(plan: model.TeamPlan, message: said.Began | said.Ending) -> list[int]:
    """The places of the activities that a message may be about; ReportError if there are none."""
    activities = plan.network.activities
    if message.goal is not None:
        alike = [place for place in range(len(activities)) if said.goal_of(place) == message.goal]
    else:
        alike = [place for place, each in enumerate(activities) if each.action == message.action]
        alike = [place for place in alike if message.event in {None, activities[place].target}]
    if not alike:
        raise ReportError("there is no such activity")
    return alike


def ending(plan: model.TeamPlan, message: said.Ending, running: Container[int]) -> list[int]:
    """The places of the running activities whose end a message tells; ReportError if that is not one end."""
    ended = [place for place in named(plan, message) if place in running]
    if not ended:
        raise ReportError("it is not running")
    if len({plan.network.activities[place].target for place in ended}) > 1:
        raise ReportError("several run; say at which event it ends")
    return ended


@dataclass
class Thrift:
    """What the budget of steps gave away."""

    steps: int = 0
    """That were taken."""
    undecided: int = 0
    """Steps that ended before all was decided that could be done; the next one goes on."""
    followed: int = 0
    """Events that were executed as a known continuation has them, because waiting might have left none: whether they
    exclude what people may still choose was not decided."""
    stretched: int = 0
    """Steps that were given more time than the budget, because many before had decided nothing within it."""
    early: int = 0
    """How often a time before which nothing can be done took the place of the next time at which something can."""

    @property
    def anything(self) -> bool:
        """Whether something was given away."""
        return self.undecided + self.followed + self.early > 0  # what is stretched was undecided before


class PlanExecutive:
    """Executes one plan once [PIKE, Algorithm 1]; all times are in the plan's unit.

    Args:
        plan: the plan.
        reasoner: makes the reasoning for the progress that it is given.
        ranking: in which order events are tried, and values of choices; the first that may be is taken.
        preference: in which order values of choices are tried instead, by what is known.
        flexible: whether events that can be executed, and values without a preference, are tried in the order of how
            much they leave open, as :mod:`~robust.pike_bridge.online.patience` counts it.
        progress: what has happened so far; nothing, if not given.
        monitor: whether state estimates are compared with what later activities need.
        patience: how long before the last moment the executive ceases to keep all that people may still decide, as
            :mod:`~robust.pike_bridge.online.patience` says; None: it acts as soon as it can [PIKE §3].
        solver: `z3` or `cvc5`, which is asked about patience where the reasoner asks none itself.
        budget: seconds of processor time for a step with the question when to take the next one; None: as long as it
            takes. Only what is proved to leave a correct execution is done within it. What could not be decided waits,
            and the executive wants to go on at the same time; see `thrift`.

    After each step `progress` holds what has been executed; `wake` and `ended` are for the driver.
    """

    def __init__(
        self,
        plan: model.TeamPlan,
        reasoner: Callable[[said.Progress], semantic.Reasoner],
        *,
        ranking: Ranking = as_written,
        preference: Preference | None = None,
        flexible: bool = False,
        progress: said.Progress | None = None,
        monitor: bool = True,
        patience: Fraction | None = Fraction(0),
        solver: str = "z3",
        budget: float | None = None,
        deadline: Deadline = NEVER,
    ) -> None:
        self.plan = plan
        self.budget = budget
        self.thrift = Thrift()
        """What the budget gave away so far."""
        self.progress = progress or said.Progress(plan)
        self.running: dict[int, Fraction] = {}
        """When each activity that runs was dispatched, by its place in the plan."""
        self.outcome: said.Failed | said.Succeeded | None = None
        self._monitor = said.ExecutionMonitor(self.progress) if monitor else None
        self._ranking, self._preference, self._flexible = ranking, preference, flexible
        self._make, self._margin, self._solver = reasoner, patience, solver
        self._values: Mapping[str, str] = {}
        """Of the choices that are made at the event that is being executed, as far as they are decided."""
        self._deadline = self._limit = deadline
        """Of everything, and of the step that is taken."""
        self._left = budget
        """Of the budget, for the question when to take the next step."""
        self._pauses = 0
        """Steps in a row that were not decided."""
        self._refused: tuple[object, set[str]] = (None, set())
        """Events that cannot be executed as long as nothing happens."""
        self._wake: tuple[Fraction | None] | None = None
        """When to step again, once it is known."""
        self._changed = True
        self._recorded: Mapping[str, str] | None = None
        """The choices of the step that is being repeated."""
        self._own = frozenset(choice.name for choice in plan.network.choices if choice.controllable)
        self._activities: dict[str, list[int]] = {}
        for place, activity in enumerate(plan.network.activities):
            self._activities.setdefault(activity.source, []).append(place)
            if activity.source in self.progress.times and self._runs(activity):
                self.running[place] = self.progress.times[activity.source]
        if self._monitor is not None:
            for event in self.progress.times:
                self._monitor.executed(event)

    @cached_property
    def reasoner(self) -> semantic.Reasoner:
        """What answers, from the first question on: whoever repeats what was decided asks none."""
        return self._make(self.progress)

    @cached_property
    def _patience(self) -> Patience:
        shared = None if self.reasoner.view is None else self.reasoner
        patience = Patience(self.progress, self._margin, reasoner=shared, solver=self._solver, deadline=self._deadline)
        patience.alarm_time = self._share(_ALARM)
        return patience

    @property
    def ended(self) -> bool:
        """Whether the execution has succeeded or failed."""
        return self.outcome is not None

    @property
    def wake(self) -> Fraction | None:
        """When to step again if nothing is reported before; it is found out when it is asked for."""
        if self.ended:
            return None
        if self._wake is None:
            self._wake = (self._next_time(),)
        return self._wake[0]

    @property
    def withheld(self) -> frozenset[str]:
        """Events that could be executed now but would exclude what people may still decide."""
        return frozenset() if self.ended else self._patience.withheld

    @property
    def withheld_until(self) -> Fraction | None:
        """When that is thought over if nothing happens before; None if nothing is withheld, or any time is early
        enough.
        """
        return self._patience.alarm if self.withheld else None

    @property
    def undecided(self) -> bool:
        """Whether the last step was too short to decide all; the next one goes on."""
        return not self.ended and self._pauses > 0

    def _next_time(self) -> Fraction | None:
        if self._pauses:
            return self.progress.now + (0 if self._pauses <= PAUSES else self.progress.grid)
        self._limit = self._patience.deadline = self._deadline.within(self._left)
        try:
            return self._time_to_act()
        except OutOfTimeError as stopped:
            self._only_budget(stopped)
            self.thrift.early += 1
            bounds = [self._patience.alarm] if self._patience.withheld else []
            bounds.append(self.reasoner.not_before())
            return min((moment for moment in bounds if moment is not None), default=None)

    def _time_to_act(self) -> Fraction | None:
        if not self._patience.withheld:
            return self.reasoner.next_time(self._limit)
        self.thrift.early += self._patience.early
        moments = (self._patience.alarm, self._patience.opening())
        return min((moment for moment in moments if moment is not None), default=None)

    def prepare(self) -> bool:
        """Find out whether the plan admits a correct execution at all, before the first step.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        return self.reasoner.possible(self._deadline)

    def step(self, now: Number, messages: Sequence[said.Message] = ()) -> list[said.Decision]:
        """Take note of what has happened, and do what can be done now [PIKE, Algorithm 1, lines 3 to 18].

        A time before that of the last step counts as that time. Messages after the end are rejected.

        Raises:
            InputError: if `now` is no number, or a message is none.
            OutOfTimeError: if the deadline passes.
        """
        now = said.require_step(now, messages)
        if self.ended:
            return [self._rejected(message, "the execution has ended") for message in messages]
        decisions: list[said.Decision] = []
        self._advance(now, decisions)
        for message in messages:
            try:
                decisions += self._take(message)
            except ReportError as error:
                decisions.append(self._rejected(message, str(error)))
        self._wake = None
        self.reasoner.begin()
        stretch = max(0, self._pauses + 1 - PAUSES)
        self._limit = self._patience.deadline = self._deadline.within(self._share(_ACTING * 2.0**stretch))
        self.thrift.steps += 1
        self.thrift.stretched += stretch > 0
        try:
            finished = self._act(decisions)
            self._pauses = 0
        except OutOfTimeError as stopped:
            self._only_budget(stopped)
            finished = False
            self._pauses += 1
            self.thrift.undecided += 1
            decisions += self._follow()
        self._left = None if self.budget is None else max(self._limit.remaining or 0.0, self.budget * _LOOKING)
        if finished:
            scenario = tuple(model.Assignment(*each) for each in sorted(self.progress.chosen.items()))
            self.outcome = said.Succeeded(self.progress.now, scenario)
            decisions.append(self.outcome)
        return decisions

    def _share(self, share: float) -> float | None:
        return None if self.budget is None else share * self.budget

    def _only_budget(self, stopped: OutOfTimeError) -> None:
        """Go on if it was the budget that ended a question, and nothing else."""
        if self.budget is None or stopped.reason is not None:
            raise stopped
        self._deadline.enforce()

    def _act(self, decisions: list[said.Decision]) -> bool:
        """Decide what can be done now, and do it; whether everything is done."""
        if self._changed and not self.reasoner.possible(self._limit):
            self.outcome = said.Failed(self.progress.now, "no correct execution is left")
            decisions.append(self.outcome)
            return False
        self._changed = False
        for decision in self._execute_all():
            decisions.append(decision)
        return self._is_finished()

    def _follow(self) -> Iterator[said.Decision]:
        """What a known continuation does now, where waiting might leave none."""
        while (due := self.reasoner.due()) is not None:
            event, self._values = due
            self.thrift.followed += 1
            yield from self._mark(event)
            self._values = {}

    def repeat(
        self,
        now: Fraction,
        messages: Sequence[said.Message],
        decisions: Iterable[said.Decision],
        *,
        undecided: bool = False,
    ) -> None:
        """Take an earlier step again as it was decided then, to resume from a record of it; nothing is asked.

        If it was `undecided`, the next one goes on.
        """
        if self.ended:
            return
        decisions = tuple(decisions)
        self._recorded = {each.choice: each.value for each in decisions if isinstance(each, said.Chosen)}
        self._advance(now, [])
        for message in messages:
            with suppress(ReportError):
                list(self._take(message))
        for decision in decisions:  # all others follow from the messages or from the events
            if isinstance(decision, said.Executed) and not decision.reported:
                list(self._mark(decision.event))
            elif isinstance(decision, said.Failed | said.Succeeded):
                self.outcome = decision
        self._recorded = None
        self._pauses = self._pauses + 1 if undecided else 0
        self._wake = None

    def possible_values(self, choice: str) -> tuple[str, ...]:
        """The values that a choice may still have [PIKE §1.1: inferred intent].

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        if choice in self.progress.chosen:
            return (self.progress.chosen[choice],)
        return tuple(self._possible(choice, self.plan.network.domains[choice], self._deadline))

    def violations(self, estimate: said.Estimate) -> list[said.Violated]:
        """What is seen otherwise than later activities rely on, which are said once [PIKE, Algorithm 1, line 3]."""
        return [] if self._monitor is None else [violation for violation, _ in self._monitor.compare(estimate)]

    # -- what has happened -------------------------------------------------------------------------------------------

    def _advance(self, now: Fraction, decisions: list[said.Decision]) -> None:
        if now < self.progress.now:
            reason = f"the clock went back from {self.progress.now} to {now}"
            decisions.append(said.Rejected("time", reason, self.progress.now))
        elif now > self.progress.now:
            self.progress.now = now
            self._changed = True

    def _take(self, message: said.Message) -> Iterator[said.Decision]:
        match message:
            case said.Outcome(choice, value):
                check_outcome(self.plan, self.progress.chosen, message)
                self._choose(choice, value)
                yield said.Chosen(choice, value, self.progress.now, observed=True)
            case said.Completion():
                activities, ended = self.plan.network.activities, ending(self.plan, message, self.running)
                for place in ended:
                    del self.running[place]
                end = activities[ended[0]].target
                if not any(activities[place].target == end for place in self.running):
                    yield from self._mark(end, reported=True)
            case said.Estimate(true, false):
                if true & false:
                    raise ReportError(f"{min(true & false)} is said to be both true and false")
                for violation, broken in () if self._monitor is None else self._monitor.compare(message):
                    self.progress.void.update(broken)
                    self._changed = True
                    yield violation
            case said.Began():
                pass  # what was dispatched has begun
            case said.NotAchieved() | said.Retract():
                raise ReportError("the paper's executive knows of no failures; expected a field executive")
            case _:
                assert_never(message)

    # -- what is done ------------------------------------------------------------------------------------------------

    def _execute_all(self) -> Iterator[said.Decision]:
        """[PIKE, Algorithm 1, lines 10 to 18]: events are executed as long as there are executable ones."""
        refused = self._refused[1] if self._refused[0] == self.progress.moment else set()
        self._refused = self.progress.moment, refused
        while True:
            act = self._patience.decide(self._by_flexibility(self._executable(refused), ranked_events), self._ranked)
            if act is None:
                return
            if act.excluded is not None:
                yield act.excluded
            # What was refused stays so: executing something leaves no more continuations than there were.
            self._values = dict(act.values)
            yield from self._mark(act.event)
            self._values = {}
            self._refused = self.progress.moment, refused

    def _executable(self, refused: set[str]) -> Iterator[str]:
        for event in self._ranking(list(self.progress.frontier)):
            if event in refused or not self.progress.ours(event) or self.progress.blocked(event):
                continue
            if self.reasoner.executable(event, self._limit):
                yield event
            else:
                refused.add(event)

    def _mark(self, event: str, *, reported: bool = False) -> Iterator[said.Decision]:
        """ExecuteEvent [PIKE, Algorithm 3]."""
        now = self.progress.now
        self.progress.times[event] = now
        if reported:
            self.progress.reported.add(event)
        del self.progress.pending[event]
        self._changed = True
        for assignment in sorted(self.progress.structure.guards[event]):
            if assignment.variable not in self.progress.chosen:  # an event's guard holds because it was executed
                self._choose(*assignment)
                if assignment.variable in self._own:  # it was open again after a failure
                    yield said.Chosen(*assignment, now)
        if self._monitor is not None:
            self._monitor.executed(event)
        yield said.Executed(event, now, reported)
        for choice in self.progress.structure.made_at.get(event, ()):
            if choice not in self.progress.chosen:
                value = self._decide(choice)
                if value is not None:
                    self._choose(choice, value)
                    yield said.Chosen(choice, value, now)
        for place in self._activities.get(event, ()):
            activity = self.plan.network.activities[place]
            if self._runs(activity):
                self.running[place] = now
                action, end, goal = activity.action, activity.target, said.goal_of(place)
                yield said.Dispatched(action, activity.agent, now, end, activity.lower, activity.upper, goal)

    def _runs(self, activity: model.Activity) -> bool:
        """Whether an activity that has begun has not ended."""
        return self.progress.certain(activity.guard) and activity.target in self.progress.pending

    def _decide(self, choice: str) -> str | None:
        """The first value that could be committed to; None if the execution has failed already."""
        if self._recorded is not None:
            return self._recorded.get(choice)
        if choice in self._values:
            return self._values[choice]
        try:
            return next(self._possible(choice, self._ranked(choice), self._limit), None)
        except OutOfTimeError as stopped:
            self._only_budget(stopped)
        # The event is executed: its choice is not put off. What showed that it could be has a value for it, too.
        known = self.reasoner.known
        if known is not None and choice in known.scenario:
            return known.scenario[choice]
        return next(self._possible(choice, self._ranked(choice), self._deadline), None)

    def _by_flexibility(self, alternatives: Iterable[str], rank: FlexibleRanking) -> Iterable[str]:
        """Alternatives by what they leave open, if that is wanted, and if it can be found out in time."""
        if not self._flexible:
            return alternatives
        known = list(alternatives)
        try:
            return (
                known if len(known) < 2 else rank(known, self._patience.view, self._limit.within(self._share(_RANKING)))
            )
        except OutOfTimeError as stopped:
            self._only_budget(stopped)
            return known

    def _ranked(self, choice: str) -> Sequence[str]:
        """The values of a choice in the order in which they are tried."""
        values, known = self.plan.network.domains[choice], self.progress.chosen
        if choice in known or choice not in self._own:
            return self._ranking(values)
        if self._preference is not None:
            return self._preference(choice, values, known)
        return list(self._by_flexibility(self._ranking(values), partial(ranked_values, choice)))

    def _choose(self, choice: str, value: str) -> None:
        self.progress.chosen[choice] = value
        self._changed = True
        guards = self.progress.structure.guards
        for event in [event for event in self.progress.pending if not self.progress.compatible(guards[event])]:
            del self.progress.pending[event]

    def _possible(self, choice: str, values: Iterable[str], deadline: Deadline) -> Iterator[str]:
        return (
            value for value in values if self.reasoner.could(frozenset({model.Assignment(choice, value)}), deadline)
        )

    def _is_finished(self) -> bool:
        """Whether no pending event can be activated any more."""
        guards = self.progress.structure.guards
        for event in list(self.progress.pending):
            if self.reasoner.could(guards[event], self._limit):
                return False
            del self.progress.pending[event]
        return True

    def _rejected(self, message: said.Message, reason: str) -> said.Rejected:
        return said.Rejected(str(message), reason, self.progress.now)


# -- how long people have ----------------------------------------------------------------------------------------------


class Moment(NamedTuple):
    """Until when a choice can get a value, in the plan's unit of time.

    `latest` None: at any time, or, if it is not possible, at none.
    """

    choice: str
    value: str
    possible: bool
    latest: Fraction | None


@dataclass
class Moments(Stoppable, ask="feasible"):
    """Until when each value of each choice that is people's can be chosen at the latest, as far as that is known."""

    feasible: bool | None = None
    """Whether a correct execution exists at all under the assumptions."""
    moments: list[Moment] = field(default_factory=list)
    status: str = "complete"


@dataclass
class LatestMoments(Searching[Moments]):
    """Finds, for each uncontrollable choice and value, the greatest time that its event has in a correct execution.

    A patient executive begins at 0; its first steps are taken, as far as nothing is begun and nobody can choose. From
    then on, everything that is open is assumed to be decided in favour of the value.

    Args:
        assume: choices that are made already.
    """

    plan: model.TeamPlan
    assume: model.Guard = model.ALWAYS
    solver: str = "z3"
    deadline: Deadline = NEVER

    def __post_init__(self) -> None:
        self._known = Moments()

    @property
    def _begun(self) -> bool:
        return self._known.feasible is not None

    def _result(self, status: Status, reason: str | None = None) -> Moments:
        self._known.status = status.value
        return self._known

    def _search(self) -> None:
        executive = self._beginning()
        progress, known = executive.progress, self._known
        reasoner = semantic.SemanticReasoner(progress, solver=self.solver)
        known.feasible = not executive.ended or isinstance(executive.outcome, said.Succeeded)
        for intent in values_of(openings(progress), progress):
            [(choice, value)] = intent.values
            possible = known.feasible and reasoner.could(intent.guard, self.deadline)
            latest = reasoner.latest(intent.guard, intent.events, self.deadline) if possible else None
            known.moments.append(Moment(choice, value, possible, latest))

    def _beginning(self) -> PlanExecutive:
        """An executive that has done what it does before anyone else can."""
        plan = semantics.restrict(self.plan, self.assume)
        executive = PlanExecutive(plan, partial(semantic.SemanticReasoner, solver=self.solver), deadline=self.deadline)
        now: Fraction | None = Fraction(0)
        while now is not None and not executive.ended:
            executive.step(now)
            progress = executive.progress
            if executive.running or any(progress.comes_next(opening.event) for opening in openings(progress)):
                break
            now = executive.wake
        return executive
