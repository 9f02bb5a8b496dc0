"""What PIKE is compared with: executives that guess intents (Kirk), or that reason about time only (Drake).

Kirk executes one candidate subplan, and plans anew when an uncontrollable choice is not what it guessed. Source: the
competing approach of [PIKE §6.2.1]. Before execution one intent and one adaptation to it are guessed: "An intent is
inferred by guessing any intent scenario such that there exists a corresponding adaptation scenario where the candidate
subplan admits a correct execution." Which one is left open there. Here values are tried in the order of the plan, or in
another one; first those of uncontrollable choices, one choice after the other, then the rest. The candidate has no
choices left, and is executed by PIKE's own executive: dispatch, temporal reasoning and monitoring are shared. An
outcome that contradicts the guess triggers a re-plan: what was done wrongly is undone, recovery activities are put
before the rest, and the choice is made as it was observed. Other guesses stay as they are if a correct execution allows
it, as in the paper, which backtracks "the last incorrect uncontrollable choice"; else they are guessed anew.

Defined for all team plans is what is wrong: events and activities whose guards the observed choices exclude, and what
was executed after them that has to come after their replacement. Recovery makes the world as if none of that had
happened. What is not wrong stays done, and commits: if the robot has fetched one thing for a guess, and what was
observed needs the other one, no candidate may be left, and the execution fails. PIKE's paper notes that such cases need
generative planning.

Drake: temporal reasoning only, no causal links [PIKE §2.3 and §3; Conrad and Williams 2011].
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from heapq import heappop, heappush
from math import ceil, floor
from random import Random
from types import MappingProxyType
from typing import Protocol, TypeAlias, assert_never

from robust.pike_bridge.model import (
    Activity,
    Assignment,
    Choice,
    Condition,
    Constraint,
    Effect,
    Event,
    Guard,
    TeamPlan,
    contradicts,
    guard,
)
from robust.pike_bridge.online.executive import PlanExecutive, Ranking, as_written
from robust.pike_bridge.online.progress import (
    Chosen,
    Completion,
    Decision,
    Dispatched,
    Estimate,
    Executed,
    Failed,
    Message,
    Monitor,
    Outcome,
    Progress,
    Rejected,
    Succeeded,
)
from robust.pike_bridge.online.reasoner import Reasoner
from robust.pike_bridge.online.semantic import OnlineSemantics
from robust.pike_bridge.scenarios import restrict
from robust.pike_bridge.semantics import Execution, faults
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula

# -- what is undone when a guess turns out wrong, and the candidate that is left after it ------------------------------


@dataclass(frozen=True, slots=True)
class Recovery:
    """An activity that undoes another one, and takes exactly `duration`."""

    action: str
    agent: str | None
    duration: Fraction


def kept_events(
    plan: TeamPlan, times: Mapping[str, Fraction], begun: Sequence[Activity], observed: Mapping[str, str]
) -> dict[str, Fraction]:
    """The executed events that may stay, with their times; the others are undone.

    Wrong are the events, and the activities that were begun, whose guards the observed choices exclude. Undone are
    wrong events and the starts of wrong activities; events that were executed although another one has to come first,
    which has not been executed or is undone itself; and the starts of activities whose ends are undone.
    """
    guards, known = plan.network.guards, guard(observed)
    wrong = {event for event in times if contradicts(guards[event], known)}
    wrong |= {activity.source for activity in begun if contradicts(activity.guard, known)}
    kept = dict(times)
    while wrong:
        kept = {event: time for event, time in kept.items() if event not in wrong}
        wrong = _too_early(plan, kept, known) | {
            activity.source
            for activity in begun
            if activity.source in kept and activity.target in times and activity.target not in kept
        }
    return kept


def _too_early(plan: TeamPlan, kept: Mapping[str, Fraction], known: Guard) -> set[str]:
    guards = plan.network.guards
    return {
        constraint.target
        for constraint in plan.network.temporal_constraints
        if constraint.target in kept
        and constraint.source not in kept
        and constraint.lower is not None
        and constraint.lower >= 0
        and constraint.guard | guards[constraint.source] <= known | guards[constraint.target]
    }


def recoveries(
    wrong: Iterable[Activity], times: Mapping[str, Fraction], durations: Mapping[str, Fraction], epsilon: Fraction
) -> list[Recovery]:
    """How activities that were begun are undone: the last one first. Those without a duration are undone at once.

    Durations are rounded up to the grid of ε, like all times of executions.
    """
    found = []
    for activity in sorted(wrong, key=lambda each: times[each.source], reverse=True):
        duration = durations.get(activity.action, Fraction(0))
        if duration > 0:
            on_grid = ceil(duration / epsilon) * epsilon
            found.append(Recovery(f"(recover {activity.action.strip('()')})", activity.agent, on_grid))
    return found


def candidate(
    plan: TeamPlan,
    scenario: Mapping[str, str],
    *,
    undo: Sequence[Recovery] = (),
    waiting: Container[str] = (),
    number: int = 0,
) -> TeamPlan:
    """The plan without choices in a scenario; what undoes wrong activities is put before all that is to come.

    Args:
        undo: activities that are executed first, one after the other.
        waiting: events that wait for them; those of other scenarios do not matter.
        number: of the candidate, for the names of events.
    """
    chosen = restrict(plan, guard(scenario))
    if not undo:
        return chosen
    network = chosen.network
    moments = [f"recovery {number}.{place}" for place in range(len(undo) + 1)]
    activities = tuple(
        Activity(one.action, begin, end, one.duration, one.duration, one.agent)
        for one, begin, end in zip(undo, moments, moments[1:], strict=False)
    )
    first = tuple(
        Constraint(moments[-1], event.name, Fraction(0), None) for event in network.events if event.name in waiting
    )
    return replace(
        chosen,
        network=replace(
            network,
            events=(*(Event(name) for name in moments), *network.events),
            constraints=(*network.constraints, *first),
            activities=(*network.activities, *activities),
        ),
    )


# -- a single intent, and an adaptation to it --------------------------------------------------------------------------

BrokenLinks = Set[tuple[Effect, Condition]]


@dataclass(frozen=True, slots=True)
class Facts:
    """What a candidate has to agree with.

    Attributes:
        known: choices that were observed, or that executed events settle.
        times: executed events.
        release: before it no event is executed that is still to come, except `running`.
        running: ends of activities that go on; they are not before `now`.
        broken: effects that do not support conditions any more.
    """

    known: Guard = frozenset()
    times: Mapping[str, Fraction] = field(default_factory=dict)
    now: Fraction = Fraction(0)
    release: Fraction = Fraction(0)
    running: Set[str] = frozenset()
    broken: BrokenLinks = frozenset()


class Guesser:
    """Guesses full scenarios of one plan, as often as asked, by one solver session that compiles nothing.

    Args:
        ranking: in which order values of a choice are tried.

    Raises:
        SolverError: if the solver is unknown or not installed.
    """

    def __init__(self, plan: TeamPlan, *, ranking: Ranking = as_written, solver: str = "z3") -> None:
        progress = Progress(plan)
        self._not_before = progress.structure.not_before
        self._semantics = OnlineSemantics(progress)
        self._session = Session(self._semantics.terms, solver=solver)
        self._session.add(*self._semantics.formulas)
        self._guards = plan.network.guards
        self._ranking = ranking
        self._choices = sorted(plan.network.choices, key=lambda choice: choice.controllable)

    def guess(self, facts: Facts, preferred: Mapping[str, str], deadline: Deadline) -> dict[str, str] | None:
        """A scenario that agrees with the facts and admits a correct execution; None if there is none.

        A choice keeps its preferred value if the choices before it let it.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        scenario: dict[str, str] = dict(facts.known)
        with ExitStack() as frames:
            frames.enter_context(self._session.frame(*self._formulas(facts)))
            if not self._possible(deadline):
                return None
            for choice in self._choices:
                if choice.name not in scenario:
                    value = self._first(choice, preferred.get(choice.name), deadline)
                    scenario[choice.name] = value
                    frames.enter_context(self._session.frame(self._value(choice.name, value)))
        return scenario

    def foremost(self, executed: Container[str], running: Set[str]) -> list[str]:
        """Events that wait for what comes first, if it does; all others that do come after one of them.

        Ends of `running` activities do not wait.
        """

        def waits(event: str) -> bool:
            return event not in executed and event not in running

        return [
            event
            for event in self._guards
            if waits(event) and not any(waits(earlier) for earlier in self._not_before[event])
        ]

    def _first(self, choice: Choice, preferred: str | None, deadline: Deadline) -> str:
        order = list(self._ranking(choice.domain))
        if preferred is not None:
            order.sort(key=lambda value: value != preferred)
        for value in order[:-1]:
            with self._session.frame(self._value(choice.name, value)):
                if self._possible(deadline):
                    return value
        return order[-1]  # some value is possible, and no other one is

    def _formulas(self, facts: Facts) -> Iterator[Formula]:
        yield self._semantics.guard(facts.known)
        for event, time in facts.times.items():
            yield self._semantics.guard(self._guards[event])
            yield self._semantics.at(event, time)
        for event in facts.running:
            yield self._semantics.unless(self._guards[event], self._semantics.not_before(event, facts.now))
        for event in self.foremost(facts.times, facts.running):
            yield self._semantics.unless(self._guards[event], self._semantics.not_before(event, facts.release))
        for effect, condition in facts.broken:
            yield self._semantics.void(effect, condition)

    def _value(self, choice: str, value: str) -> Formula:
        return self._semantics.guard(frozenset({Assignment(choice, value)}))

    def _possible(self, deadline: Deadline) -> bool:
        match self._session.check("a candidate subplan", deadline):
            case Verdict.SATISFIABLE:
                return True
            case Verdict.UNSATISFIABLE:
                return False
            case Verdict.UNKNOWN:
                raise OutOfTimeError


# -- Kirk --------------------------------------------------------------------------------------------------------------

FREE: Mapping[str, Fraction] = MappingProxyType({})
"""Nothing takes time to undo."""


@dataclass(frozen=True, slots=True)
class Replanned:
    """A guess was wrong, or could not be followed: another candidate is executed from now on.

    Attributes:
        undone: executed events that do not count any more.
        abandoned: actions that were running, with their ends; whoever does them is to stop.
        recovery: how long it takes to undo what was wrong.
    """

    time: Fraction
    undone: tuple[str, ...]
    abandoned: tuple[tuple[str, str], ...]
    recovery: Fraction


KirkDecision: TypeAlias = Decision | Replanned


class Kirk:
    """Executes one plan once.

    Args:
        plan: the plan.
        reasoner: makes the reasoning for each candidate, as for :class:`PlanExecutive`.
        recovery: how long it takes to undo each action that was begun; nothing for those that are missing.
        ranking: in which order events and guesses are tried.
        monitor: whether state estimates are compared with what later activities need.
        solver: with which candidates are found.

    `replans` counts guesses after the first one, `recovered` is the time of all recovery activities.

    Raises:
        SolverError: if the solver is unknown or not installed.
        OutOfTimeError: if the deadline passes before the first guess.
    """

    def __init__(
        self,
        plan: TeamPlan,
        reasoner: Callable[[Progress], Reasoner],
        *,
        recovery: Mapping[str, Fraction] = FREE,
        ranking: Ranking = as_written,
        monitor: bool = True,
        solver: str = "z3",
        deadline: Deadline = NEVER,
    ) -> None:
        self.plan = plan
        self.replans = 0
        self.recovered = Fraction(0)
        self.outcome: Failed | Succeeded | None = None
        self.observed: dict[str, str] = {}
        self._reasoner = reasoner
        self._durations = recovery
        self._ranking = ranking
        self._monitor = monitor
        self._deadline = deadline
        self._guesser = Guesser(plan, ranking=ranking, solver=solver)
        self._events = frozenset(event.name for event in plan.network.events)
        self._estimates: list[tuple[Fraction, Estimate]] = []
        self._recovery: list[tuple[Recovery, Fraction]] = []
        """What is or was undone last, and until when."""
        guessed = self._guesser.guess(Facts(), {}, deadline)
        self._guess: dict[str, str] | None = guessed
        self._inner = self._executive(plan if guessed is None else candidate(plan, guessed))

    # -- what those who drive it need ------------------------------------------------------------------------------

    @property
    def ended(self) -> bool:
        """Whether the execution has succeeded or failed."""
        return self.outcome is not None

    @property
    def wake(self) -> Fraction | None:
        """When to step again if nothing is reported before."""
        return None if self.ended else self._inner.wake

    @property
    def progress(self) -> Progress:
        """Of the candidate that is executed now."""
        return self._inner.progress

    @property
    def running(self) -> Iterator[Activity]:
        """The activities that run, of the candidate that is executed now."""
        return (self._inner.plan.network.activities[place] for place in self._inner.running)

    @property
    def assumed(self) -> Mapping[str, str]:
        """The guesses about uncontrollable choices that have not been observed."""
        if self._guess is None:
            return {}
        return {
            choice.name: self._guess[choice.name]
            for choice in self.plan.network.choices
            if not choice.controllable and choice.name not in self.observed
        }

    def prepare(self) -> bool:
        """Find out whether the plan admits a correct execution at all, before the first step.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        return self._guess is not None and self._inner.prepare()

    def step(self, now: Fraction, messages: Sequence[Message] = ()) -> list[KirkDecision]:
        """Take note of what has happened, plan anew if that contradicts the guess, and do what can be done now.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        if self.ended:
            return [Rejected(str(message), "the execution has ended", self.progress.now) for message in messages]
        decisions: list[KirkDecision] = []
        time = max(now, self.progress.now)
        others: list[Completion | Estimate] = []
        for message in messages:
            if isinstance(message, Outcome):
                decisions += self._take(message, time)
            else:
                others.append(message)
                if isinstance(message, Estimate):
                    self._estimates.append((time, message))
        if self._guess is not None and contradicts(guard(self.observed), guard(self._guess)):
            decisions += self._note(time, others)
            decisions += self._replan(time)
            others = []
        while not self.ended:
            decisions += self._follow(now, others)
            others = []
            if self._inner.outcome is None or self.ended:
                return decisions
            decisions += self._replan(time)
        return decisions

    # -- outcomes ----------------------------------------------------------------------------------------------------

    def _take(self, message: Outcome, time: Fraction) -> Iterator[Decision]:
        name, value = message.choice, message.value
        choice = next((each for each in self.plan.network.choices if each.name == name), None)
        known = self.observed.get(name)
        reason = None
        if choice is None:
            reason = f"there is no choice {name!r}"
        elif choice.controllable:
            reason = f"{name} is for the executive to choose"
        elif value not in choice.domain:
            reason = f"expected one of {', '.join(choice.domain)}"
        elif known is not None:
            reason = "known already" if known == value else f"{name} = {known} was observed before"
        if reason is not None:
            yield Rejected(str(message), reason, time)
        else:
            self.observed[name] = value
            yield Chosen(name, value, time, observed=True)

    def _note(self, now: Fraction, messages: Sequence[Message]) -> Iterator[Decision]:
        """Let the candidate know what has happened, without going on with it."""
        before = set(self._inner.progress.times)
        self._inner.repeat(now, messages, ())
        for event, time in self._inner.progress.times.items():
            if event not in before:
                yield Executed(event, time, reported=True)

    def _follow(self, now: Fraction, messages: Sequence[Message]) -> Iterator[Decision]:
        """A step of the candidate; its end is that of the execution, if it is a success or there was no guess."""
        for decision in self._inner.step(now, messages):
            match decision:
                case Succeeded(time):
                    scenario = (self._guess or {}) | self.observed
                    self.outcome = Succeeded(time, tuple(Assignment(*each) for each in sorted(scenario.items())))
                    yield self.outcome
                case Failed() if self._guess is None:
                    self.outcome = decision
                    yield decision
                case Failed():
                    pass  # of the candidate; another one may be left
                case _:
                    yield decision

    # -- planning anew -----------------------------------------------------------------------------------------------

    def _replan(self, now: Fraction) -> Iterator[KirkDecision]:
        guessed = self._guess or {}
        old = guard(guessed)
        executed = {event: time for event, time in self.progress.times.items() if event in self._events}
        begun = [each for each in self.plan.network.activities if each.source in executed and each.guard <= old]
        kept = kept_events(self.plan, executed, begun, self.observed)
        wrong = [each for each in begun if each.source not in kept]
        new = recoveries(wrong, executed, self._durations, self.plan.epsilon)
        undo = [*new, *self._unfinished(now)]
        going_on = {activity.target for activity in self.running if activity.source in kept}
        duration = sum((one.duration for one in undo), Fraction(0))
        facts = Facts(self._known(kept), kept, now, now + duration, going_on, self._broken(kept, old))
        found = self._guesser.guess(facts, guessed, self._deadline)
        if found is None or found == guessed:
            self.outcome = Failed(now, "no candidate is left that agrees with what has happened")
            yield self.outcome
            return
        abandoned = tuple((each.action, each.target) for each in self.running if each.target not in going_on)
        self.replans += 1
        self.recovered += sum((one.duration for one in new), Fraction(0))
        self._guess = found
        waiting = frozenset(self._guesser.foremost(kept, going_on))
        self._inner = self._executive(candidate(self.plan, found, undo=undo, waiting=waiting, number=self.replans))
        self._resume(kept)
        self._recovery = _scheduled(undo, now)
        yield Replanned(now, tuple(event for event in executed if event not in kept), abandoned, duration)

    def _executive(self, plan: TeamPlan) -> PlanExecutive:
        return PlanExecutive(
            plan, self._reasoner, ranking=self._ranking, monitor=self._monitor, deadline=self._deadline
        )

    def _resume(self, kept: Mapping[str, Fraction]) -> None:
        """Tell a new candidate what has happened before."""
        for time, event in self._history(kept):
            if isinstance(event, Estimate):
                self._inner.repeat(time, [event], ())
            else:
                self._inner.repeat(time, (), [Executed(event, time)])
        activities, running = self._inner.plan.network.activities, self._inner.running
        for place in [each for each in running if activities[each].target in kept]:
            del running[place]

    def _history(self, kept: Mapping[str, Fraction]) -> list[tuple[Fraction, str | Estimate]]:
        """What was executed and seen, in order; what is seen at the time of an event is seen after it."""
        events: list[tuple[Fraction, str | Estimate]] = [(time, event) for event, time in kept.items()]
        return sorted([*events, *self._estimates], key=lambda each: each[0])

    def _known(self, kept: Mapping[str, Fraction]) -> Guard:
        """What was observed, and what executed events settle."""
        guards = self.plan.network.guards
        return guard(self.observed).union(*(guards[event] for event in kept))

    def _broken(self, kept: Mapping[str, Fraction], old: Guard) -> BrokenLinks:
        """The causal links of the whole plan that estimates have broken."""
        if not (self._monitor and self._estimates):
            return frozenset()
        progress = Progress(self.plan, chosen=dict(old) | self.observed)
        monitor = Monitor(progress)
        for time, event in self._history(kept):
            progress.now = time
            if isinstance(event, Estimate):
                for violation in monitor.compare(event):
                    progress.void.update(violation.broken)
            else:
                progress.times[event] = time
                del progress.pending[event]
                monitor.executed(event)
        return progress.void

    def _unfinished(self, now: Fraction) -> list[Recovery]:
        """What is left of an earlier recovery."""
        return [
            Recovery(one.action, one.agent, min(one.duration, end - now)) for one, end in self._recovery if end > now
        ]


def _scheduled(undo: Sequence[Recovery], now: Fraction) -> list[tuple[Recovery, Fraction]]:
    """Each recovery with its end, one after the other."""
    found = []
    for one in undo:
        now += one.duration
        found.append((one, now))
    return found


# -- executives by mode ------------------------------------------------------------------------------------------------


def without_causes(plan: TeamPlan) -> TeamPlan:
    """The plan as Drake sees it: choices and times, but nothing that activities need, do or are to reach."""
    return replace(plan, conditions=(), effects=())


class Mode(Enum):
    """PIKE keeps all hypotheses; DRAKE does so without causal links; KIRK follows one guess and plans anew."""

    PIKE = "pike"
    DRAKE = "drake"
    KIRK = "kirk"


class TeamExecutive(Protocol):
    """What executes a plan with choices: an :class:`robust.execute.drive.Executive` that can be looked at."""

    @property
    def progress(self) -> Progress:
        """What has been executed, of the plan as the executive sees it; its event names are those of the plan."""

    @property
    def assumed(self) -> Mapping[str, str]:
        """Uncontrollable choices that it does not wait for, with the values that it counts on."""

    @property
    def replans(self) -> int: ...

    @property
    def recovered(self) -> Fraction:
        """How long recovery activities take that were planned so far."""

    @property
    def outcome(self) -> Failed | Succeeded | None: ...

    @property
    def ended(self) -> bool: ...

    @property
    def wake(self) -> Fraction | None: ...

    def prepare(self) -> bool: ...

    def step(self, now: Fraction, messages: Sequence[Message] = ()) -> Sequence[KirkDecision]: ...


class Concurrent(PlanExecutive):
    """PIKE's executive as one among others: it assumes nothing, and never plans anew."""

    replans = 0
    recovered = Fraction(0)

    @property
    def assumed(self) -> Mapping[str, str]:
        return {}


def make_executive(
    mode: Mode,
    plan: TeamPlan,
    reasoner: Callable[[Progress], Reasoner],
    *,
    recovery: Mapping[str, Fraction] = FREE,
    ranking: Ranking = as_written,
    monitor: bool = True,
    solver: str = "z3",
    deadline: Deadline = NEVER,
) -> TeamExecutive:
    """The executive of a mode.

    Args:
        reasoner: as :func:`robust.pike_bridge.online.reasoners.make_reasoner` makes it.
        recovery: for KIRK, how long it takes to undo each action that was begun.
        ranking: in which order events, values and guesses are tried.
        monitor: whether state estimates are compared with what later activities need; never so for DRAKE.
        solver: for KIRK, with which candidates are found.

    Raises:
        SolverError: if the solver is unknown or not installed.
        OutOfTimeError: if the deadline passes before the first guess of KIRK.
    """
    match mode:
        case Mode.PIKE:
            return Concurrent(plan, reasoner, ranking=ranking, monitor=monitor, deadline=deadline)
        case Mode.DRAKE:
            return Concurrent(without_causes(plan), reasoner, ranking=ranking, monitor=False, deadline=deadline)
        case Mode.KIRK:
            return Kirk(
                plan,
                reasoner,
                recovery=recovery,
                ranking=ranking,
                monitor=monitor,
                solver=solver,
                deadline=deadline,
            )
        case _:
            assert_never(mode)


def execution_faults(plan: TeamPlan, executive: TeamExecutive) -> tuple[str, ...]:
    """What is wrong, by the whole plan, with an execution that its executive takes for a success.

    Choices that were not made count as their first value; recovery activities are no part of the plan.
    """
    if not isinstance(executive.outcome, Succeeded):
        return ()
    scenario = {name: domain[0] for name, domain in plan.network.domains.items()} | dict(executive.outcome.scenario)
    events = plan.network.guards
    times = {event: time for event, time in executive.progress.times.items() if event in events}
    return tuple(str(fault) for fault in faults(plan, Execution(scenario, times)))


# -- a world whose future is drawn before, the same for every executive: for paired comparisons ------------------------


@dataclass(frozen=True, slots=True)
class Script:
    """What humans choose, and how long each activity takes, by the event at which it ends and its action."""

    outcomes: Mapping[str, str]
    durations: Mapping[tuple[str, str], Fraction]


def draw_script(plan: TeamPlan, seed: int | str, slack: Fraction = Fraction(5)) -> Script:
    """Uniform draws: a value for each uncontrollable choice, a duration on the grid of ε for each activity.

    Args:
        slack: how much longer than its least duration an activity without an upper bound takes at most.
    """
    random = Random(f"script/{seed}")  # noqa: S311 - reproducible
    outcomes = {each.name: random.choice(each.domain) for each in plan.network.choices if not each.controllable}
    durations = {}
    for each in plan.network.activities:
        upper = each.lower + slack if each.upper is None else each.upper
        steps = random.randint(0, floor((upper - each.lower) / plan.epsilon))
        durations[each.target, each.action] = each.lower + steps * plan.epsilon
    return Script(outcomes, durations)


class ScriptedTeam:
    """The world of one execution, a :class:`robust.execute.drive.World`.

    A choice is seen when somebody acts on it. An executive that waits for a human learns what they do as soon as they
    can choose: once all events before the choice's own have been executed. One that has assumed an outcome learns the
    true one when it executes the first event that depends on the assumption, which may begin the wrong activity; if no
    event does, at the choice's own. Both times are later by `notice`.

    Activities take the time of the script; those that are not in it, such as recoveries, their least.
    """

    def __init__(
        self, plan: TeamPlan, executive: TeamExecutive, script: Script, *, notice: Fraction = Fraction(0)
    ) -> None:
        self._plan = plan
        self._executive = executive
        self._script = script
        self._notice = notice
        self._epsilon = plan.epsilon
        self._agenda: list[tuple[Fraction, int, Message]] = []
        self._stopped: set[int] = set()
        self._running: dict[str, int] = {}
        self._told: set[str] = set()
        self._number = 0

    def receive(self, now: Fraction, decisions: Sequence[KirkDecision]) -> None:
        """Begin and stop activities, and make choices whose time has come."""
        for decision in decisions:
            match decision:
                case Dispatched(action, _, _, end, lower):
                    duration = self._script.durations.get((end, action), lower)
                    self._running[end] = self._plan_for(now + duration, Completion(action, end))
                case Replanned():
                    self._stopped.update(self._running[end] for _, end in decision.abandoned)
                case _:
                    pass
        if not self._executive.ended:
            for choice, value in self._script.outcomes.items():
                if choice not in self._told and self._seen(choice):
                    self._told.add(choice)
                    self._plan_for(now + self._notice, Outcome(choice, value))

    @property
    def next_time(self) -> Fraction | None:
        while self._agenda and self._agenda[0][1] in self._stopped:
            heappop(self._agenda)
        return self._agenda[0][0] if self._agenda else None

    def messages(self, now: Fraction) -> Sequence[Message]:
        found: list[Message] = []
        while (time := self.next_time) is not None and time <= now:
            found.append(heappop(self._agenda)[2])
        return found

    def _seen(self, choice: str) -> bool:
        event = next(each.event for each in self._plan.network.choices if each.name == choice)
        progress = self._executive.progress
        assumed = self._executive.assumed.get(choice)
        if assumed is not None:
            guess = Assignment(choice, assumed)
            acting = [each.name for each in self._plan.network.events if guess in each.guard]
            return event is None or any(each in progress.times for each in acting or [event])
        if event is None:
            return True
        return event in progress.pending and not any(
            earlier in progress.pending for earlier in progress.structure.not_before[event]
        )

    def _plan_for(self, time: Fraction, message: Message) -> int:
        self._number += 1
        heappush(self._agenda, (ceil(time / self._epsilon) * self._epsilon, self._number, message))
        return self._number
