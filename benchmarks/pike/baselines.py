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
from itertools import accumulate, chain, count
from math import ceil, floor
from random import Random
from time import process_time
from typing import Generic, TypeAlias, TypeVar

from robust.execute.drive import Executive
from robust.pike_bridge import model
from robust.pike_bridge.knowledge.sat import satisfiable
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.executive import PlanExecutive, Ranking, as_written, objection
from robust.pike_bridge.online.reasoners import without_states
from robust.pike_bridge.online.semantic import OnlineSemantics, Reasoner
from robust.pike_bridge.semantics import Execution, faults, restrict
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Formula, Session

# -- what is undone when a guess turns out wrong, and the candidate that is left after it ------------------------------


@dataclass(frozen=True, slots=True)
class Recovery:
    """An activity that undoes another one, and takes exactly `duration`."""

    action: str
    agent: str | None
    duration: Fraction


def kept_events(
    plan: model.TeamPlan, times: Mapping[str, Fraction], begun: Sequence[model.Activity], observed: Mapping[str, str]
) -> dict[str, Fraction]:
    """The executed events that may stay, with their times; the others are undone.

    Wrong are the events, and the activities that were begun, whose guards the observed choices exclude. Undone are
    wrong events and the starts of wrong activities; events that were executed although another one has to come first,
    which has not been executed or is undone itself; and the starts of activities whose ends are undone.
    """
    guards, known = plan.network.guards, model.guard(observed)
    wrong = {event for event in times if model.contradicts(guards[event], known)}
    wrong |= {activity.source for activity in begun if model.contradicts(activity.guard, known)}
    kept = dict(times)
    while wrong:
        kept = {event: time for event, time in kept.items() if event not in wrong}
        wrong = _too_early(plan, kept, known) | {
            activity.source
            for activity in begun
            if activity.source in kept and activity.target in times and activity.target not in kept
        }
    return kept


def _too_early(plan: model.TeamPlan, kept: Mapping[str, Fraction], known: model.Guard) -> set[str]:
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
    wrong: Iterable[model.Activity], times: Mapping[str, Fraction], durations: Mapping[str, Fraction], epsilon: Fraction
) -> list[Recovery]:
    """How activities that were begun are undone: the last one first. Those without a duration are undone at once.

    Durations are rounded up to the grid of ε, like all times of executions.
    """
    ordered = sorted(wrong, key=lambda each: times[each.source], reverse=True)
    steps = [(each, ceil(durations.get(each.action, 0) / epsilon)) for each in ordered]
    return [
        Recovery(f"(recover {each.action.strip('()')})", each.agent, count * epsilon)
        for each, count in steps
        if count > 0
    ]


def candidate(
    plan: model.TeamPlan,
    scenario: Mapping[str, str],
    *,
    undo: Sequence[Recovery] = (),
    waiting: Container[str] = (),
    number: int = 0,
) -> model.TeamPlan:
    """The plan without choices in a scenario; what undoes wrong activities is put before all that is to come.

    Args:
        undo: activities that are executed first, one after the other.
        waiting: events that wait for them; those of other scenarios do not matter.
        number: of the candidate, for the names of events.
    """
    chosen = restrict(plan, model.guard(scenario))
    if not undo:
        return chosen
    network = chosen.network
    moments = [f"recovery {number}.{place}" for place in range(len(undo) + 1)]
    activities = tuple(
        model.Activity(one.action, begin, end, one.duration, one.duration, one.agent)
        for one, begin, end in zip(undo, moments, moments[1:], strict=False)
    )
    first = tuple(
        model.Constraint(moments[-1], event.name, Fraction(0), None)
        for event in network.events
        if event.name in waiting
    )
    longer = replace(
        network,
        events=(*map(model.Event, moments), *network.events),
        constraints=(*network.constraints, *first),
        activities=(*network.activities, *activities),
    )
    return replace(chosen, network=longer)


# -- a single intent, and an adaptation to it --------------------------------------------------------------------------

BrokenLinks = Set[tuple[model.Effect, model.Condition]]


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

    known: model.Guard = frozenset()
    times: Mapping[str, Fraction] = field(default_factory=dict)
    now: Fraction = Fraction(0)
    release: Fraction = Fraction(0)
    running: Set[str] = frozenset()
    broken: BrokenLinks = frozenset()


class Guesser:
    """Guesses full scenarios of one plan, as often as asked, by one solver session that compiles nothing.

    Args:
        ranking: in which order values of a choice are tried.
    """

    def __init__(self, plan: model.TeamPlan, *, ranking: Ranking = as_written) -> None:
        progress = said.Progress(plan)
        self._not_before = progress.structure.not_before
        self._semantics = OnlineSemantics(progress)
        self._session = Session(self._semantics.terms)
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

    def _first(self, choice: model.Choice, preferred: str | None, deadline: Deadline) -> str:
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
            yield self._semantics.not_earlier(event, facts.now)
        for event in self.foremost(facts.times, facts.running):
            yield self._semantics.not_earlier(event, facts.release)
        for effect, condition in facts.broken:
            yield self._semantics.void(effect, condition)

    def _value(self, choice: str, value: str) -> Formula:
        return self._semantics.guard(frozenset({model.Assignment(choice, value)}))

    def _possible(self, deadline: Deadline) -> bool:
        return satisfiable(self._session, "a candidate subplan", deadline)


# -- Kirk --------------------------------------------------------------------------------------------------------------


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


KirkDecision: TypeAlias = said.Decision | Replanned
Made = TypeVar("Made")


class Kirk:
    """Executes one plan once.

    Args:
        plan: the plan.
        reasoner: makes the reasoning for each candidate, as for :class:`PlanExecutive`.
        recovery: how long it takes to undo each action that was begun; nothing for those that are missing.
        ranking: in which order events and guesses are tried.

    `replans` counts guesses after the first one, `recovered` is the time of all recovery activities.

    Raises:
        OutOfTimeError: if the deadline passes before the first guess.
    """

    def __init__(
        self,
        plan: model.TeamPlan,
        reasoner: Callable[[said.Progress], Reasoner],
        *,
        recovery: Mapping[str, Fraction] | None = None,
        ranking: Ranking = as_written,
        deadline: Deadline = NEVER,
    ) -> None:
        self.plan = plan
        self.replans = 0
        self.recovered = Fraction(0)
        self.outcome: said.Failed | said.Succeeded | None = None
        self.observed: dict[str, str] = {}
        self._reasoner = reasoner
        self._durations = recovery or {}
        self._ranking = ranking
        self._deadline = deadline
        self._guesser = Guesser(plan, ranking=ranking)
        self._events = frozenset(event.name for event in plan.network.events)
        self._estimates: list[tuple[Fraction, said.Estimate]] = []
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
    def progress(self) -> said.Progress:
        """Of the candidate that is executed now."""
        return self._inner.progress

    @property
    def running(self) -> Iterator[model.Activity]:
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

    def step(self, now: Fraction, messages: Sequence[said.Message] = ()) -> list[KirkDecision]:
        """Take note of what has happened, plan anew if that contradicts the guess, and do what can be done now.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        if self.ended:
            return [said.Rejected(str(message), "the execution has ended", self.progress.now) for message in messages]
        time = max(now, self.progress.now)
        others = [each for each in messages if not isinstance(each, said.Outcome)]
        self._estimates += [(time, each) for each in others if isinstance(each, said.Estimate)]
        taken = (self._take(each, time) for each in messages if isinstance(each, said.Outcome))
        decisions: list[KirkDecision] = list(chain.from_iterable(taken))
        if self._guess is not None and model.contradicts(model.guard(self.observed), model.guard(self._guess)):
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

    def _take(self, message: said.Outcome, time: Fraction) -> Iterator[said.Decision]:
        reason = objection(self.plan, self.observed, message)
        if reason is not None:
            yield said.Rejected(str(message), reason, time)
        else:
            self.observed[message.choice] = message.value
            yield said.Chosen(message.choice, message.value, time, observed=True)

    def _note(self, now: Fraction, messages: Sequence[said.Message]) -> Iterator[said.Decision]:
        """Let the candidate know what has happened, without going on with it."""
        before = set(self._inner.progress.times)
        self._inner.repeat(now, messages, ())
        for event, time in self._inner.progress.times.items():
            if event not in before:
                yield said.Executed(event, time, reported=True)

    def _follow(self, now: Fraction, messages: Sequence[said.Message]) -> Iterator[said.Decision]:
        """A step of the candidate; its end is that of the execution, if it is a success or there was no guess."""
        for decision in self._inner.step(now, messages):
            if isinstance(decision, said.Succeeded):
                scenario = sorted(((self._guess or {}) | self.observed).items())
                self.outcome = replace(decision, scenario=tuple(model.Assignment(*each) for each in scenario))
                yield self.outcome
            elif not isinstance(decision, said.Failed):
                yield decision
            elif self._guess is None:  # else it is that of the candidate; another one may be left
                self.outcome = decision
                yield decision

    # -- planning anew -----------------------------------------------------------------------------------------------

    def _replan(self, now: Fraction) -> Iterator[KirkDecision]:
        guessed = self._guess or {}
        old = model.guard(guessed)
        executed = {event: time for event, time in self.progress.times.items() if event in self._events}
        begun = [each for each in self.plan.network.activities if each.source in executed and each.guard <= old]
        kept = kept_events(self.plan, executed, begun, self.observed)
        wrong = [each for each in begun if each.source not in kept]
        new = recoveries(wrong, executed, self._durations, self.plan.epsilon)
        left = [replace(one, duration=min(one.duration, end - now)) for one, end in self._recovery if end > now]
        undo = [*new, *left]
        going_on = {activity.target for activity in self.running if activity.source in kept}
        duration = sum((one.duration for one in undo), Fraction(0))
        known = model.guard(self.observed).union(*(self.plan.network.guards[event] for event in kept))
        facts = Facts(known, kept, now, now + duration, going_on, self._broken(kept, old))
        found = self._guesser.guess(facts, guessed, self._deadline)
        if found is None or found == guessed:
            self.outcome = said.Failed(now, "no candidate is left that agrees with what has happened")
            yield self.outcome
            return
        abandoned = tuple((each.action, each.target) for each in self.running if each.target not in going_on)
        self.replans += 1
        self.recovered += sum((one.duration for one in new), Fraction(0))
        self._guess = found
        waiting = frozenset(self._guesser.foremost(kept, going_on))
        self._inner = self._executive(candidate(self.plan, found, undo=undo, waiting=waiting, number=self.replans))
        self._resume(kept)
        _, *ends = accumulate((one.duration for one in undo), initial=now)
        self._recovery = list(zip(undo, ends, strict=True))
        yield Replanned(now, tuple(event for event in executed if event not in kept), abandoned, duration)

    def _executive(self, plan: model.TeamPlan) -> PlanExecutive:
        return PlanExecutive(plan, self._reasoner, ranking=self._ranking, patience=None, deadline=self._deadline)

    def _resume(self, kept: Mapping[str, Fraction]) -> None:
        """Tell a new candidate what has happened before."""
        for time, event in self._history(kept):
            if isinstance(event, said.Estimate):
                self._inner.repeat(time, [event], ())
            else:
                self._inner.repeat(time, (), [said.Executed(event, time)])
        activities, running = self._inner.plan.network.activities, self._inner.running
        for place in [each for each in running if activities[each].target in kept]:
            del running[place]

    def _history(self, kept: Mapping[str, Fraction]) -> list[tuple[Fraction, str | said.Estimate]]:
        """What was executed and seen, in order; what is seen at the time of an event is seen after it."""
        events = ((time, event) for event, time in kept.items())
        return sorted([*events, *self._estimates], key=lambda each: each[0])

    def _broken(self, kept: Mapping[str, Fraction], old: model.Guard) -> BrokenLinks:
        """The causal links of the whole plan that estimates have broken."""
        if not self._estimates:
            return frozenset()
        progress = said.Progress(self.plan, chosen=dict(old) | self.observed)
        monitor = said.ExecutionMonitor(progress)
        for time, event in self._history(kept):
            progress.now = time
            if isinstance(event, said.Estimate):
                for _, broken in monitor.compare(event):
                    progress.void.update(broken)
            else:
                progress.times[event] = time
                del progress.pending[event]
                monitor.executed(event)
        return progress.void


# -- executives by mode ------------------------------------------------------------------------------------------------


class Mode(Enum):
    """PIKE keeps all hypotheses; DRAKE does so for choices and times, without what activities need, do
    or are to reach; KIRK follows one guess and plans anew."""

    PIKE = "pike"
    DRAKE = "drake"
    KIRK = "kirk"


class Concurrent(PlanExecutive):
    """PIKE's executive as one among others: it assumes nothing, and never plans anew."""

    replans = 0
    recovered = Fraction(0)

    @property
    def assumed(self) -> Mapping[str, str]:
        return {}


TeamExecutive: TypeAlias = Concurrent | Kirk
"""What executes a plan with choices: an :class:`robust.execute.drive.Executive` that can be looked at."""


def make_executive(
    mode: Mode,
    plan: model.TeamPlan,
    reasoner: Callable[[said.Progress], Reasoner],
    *,
    recovery: Mapping[str, Fraction] | None = None,
    ranking: Ranking = as_written,
    deadline: Deadline = NEVER,
) -> TeamExecutive:
    """The executive of a mode.

    Args:
        reasoner: as :func:`robust.pike_bridge.online.reasoners.make_reasoner` makes it.
        recovery: for KIRK, how long it takes to undo each action that was begun.
        ranking: in which order events, values and guesses are tried.

    Raises:
        OutOfTimeError: if the deadline passes before the first guess of KIRK.
    """
    if mode is Mode.KIRK:
        return Kirk(plan, reasoner, recovery=recovery, ranking=ranking, deadline=deadline)
    seen = plan if mode is Mode.PIKE else without_states(plan)
    return Concurrent(seen, reasoner, ranking=ranking, deadline=deadline)


class Timed(Generic[Made]):
    """An executive of any kind whose steps and wakes are measured, in seconds of the processor, which others that run
    do not prolong; `decisions` are what it decided.
    """

    def __init__(self, executive: Executive[said.Message, Made]) -> None:
        self._executive = executive
        self.steps: list[float] = []
        self.wakes: list[float] = []
        self.decisions: list[str] = []

    def step(self, now: Fraction, messages: Sequence[said.Message]) -> Sequence[Made]:
        started = process_time()
        decisions = self._executive.step(now, messages)
        self.steps.append(round(process_time() - started, 7))
        self.decisions += map(str, decisions)
        return decisions

    @property
    def wake(self) -> Fraction | None:
        started = process_time()
        wake = self._executive.wake
        self.wakes.append(round(process_time() - started, 7))
        return wake

    @property
    def ended(self) -> bool:
        return self._executive.ended


def execution_faults(plan: model.TeamPlan, executive: TeamExecutive) -> tuple[str, ...]:
    """What is wrong, by the whole plan, with an execution that its executive takes for a success.

    Choices that were not made count as their first value; recovery activities are no part of the plan.
    """
    if not isinstance(executive.outcome, said.Succeeded):
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


def draw_script(plan: model.TeamPlan, seed: int | str, slack: Fraction = Fraction(5)) -> Script:
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
        self, plan: model.TeamPlan, executive: TeamExecutive, script: Script, *, notice: Fraction = Fraction(0)
    ) -> None:
        self._plan = plan
        self._executive = executive
        self._script = script
        self._notice = notice
        self._agenda: list[tuple[Fraction, int, said.Message]] = []
        self._stopped: set[int] = set()
        self._running: dict[str, int] = {}
        self._told: set[str] = set()
        self._numbers = count()

    def receive(self, now: Fraction, decisions: Sequence[KirkDecision]) -> None:
        """Begin and stop activities, and make choices whose time has come."""
        for decision in decisions:
            if isinstance(decision, said.Dispatched):
                duration = self._script.durations.get((decision.end, decision.action), decision.lower)
                self._running[decision.end] = self._plan_for(
                    now + duration, said.Completion(decision.action, decision.end)
                )
            elif isinstance(decision, Replanned):
                self._stopped.update(self._running[end] for _, end in decision.abandoned)
        if not self._executive.ended:
            for choice, value in self._script.outcomes.items():
                if choice not in self._told and self._seen(choice):
                    self._told.add(choice)
                    self._plan_for(now + self._notice, said.Outcome(choice, value))

    @property
    def next_time(self) -> Fraction | None:
        while self._agenda and self._agenda[0][1] in self._stopped:
            heappop(self._agenda)
        return self._agenda[0][0] if self._agenda else None

    def messages(self, now: Fraction) -> Sequence[said.Message]:
        found: list[said.Message] = []
        while (time := self.next_time) is not None and time <= now:
            found.append(heappop(self._agenda)[2])
        return found

    def _seen(self, choice: str) -> bool:
        event = next(each.event for each in self._plan.network.choices if each.name == choice)
        if event is None:
            return True
        progress = self._executive.progress
        assumed = self._executive.assumed.get(choice)
        if assumed is not None:
            guess = model.Assignment(choice, assumed)
            acting = [each.name for each in self._plan.network.events if guess in each.guard]
            return any(each in progress.times for each in acting or [event])
        return event in progress.pending and not any(
            earlier in progress.pending for earlier in progress.structure.not_before[event]
        )

    def _plan_for(self, time: Fraction, message: said.Message) -> int:
        number = next(self._numbers)
        heappush(self._agenda, (ceil(time / self._plan.epsilon) * self._plan.epsilon, number, message))
        return number
