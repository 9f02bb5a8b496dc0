"""Kirk: an executive that guesses what people choose, executes one candidate subplan, and plans anew when it was wrong.

Source: the competing approach of [PIKE §6.2.1]. Before execution one intent and one adaptation to it are guessed: "An
intent is inferred by guessing any intent scenario such that there exists a corresponding adaptation scenario where the
candidate subplan admits a correct execution." Which one is left open there. Here values are tried in the order of the
plan, or in another one; first those of uncontrollable choices, one choice after the other, then the rest. The candidate
has no choices left, and is executed by PIKE's own executive: dispatch, temporal reasoning and monitoring are shared. An
outcome that contradicts the guess triggers a re-plan: what was done wrongly is undone, recovery activities are put
before the rest, and the choice is made as it was observed. Other guesses stay as they are if a correct execution allows
it, as in the paper, which backtracks "the last incorrect uncontrollable choice"; else they are guessed anew.

Defined for all team plans is what is wrong: events and activities whose guards the observed choices exclude, and what
was executed after them that has to come after their replacement. Recovery makes the world as if none of that had
happened. What is not wrong stays done, and commits; but if no candidate is left that way, what was done for the guess
is undone as well where another scenario excludes it: the robot puts down the grounds before it fetches the juice [PIKE,
Example 6.1]. Where no single scenario found in that way can be followed any more, the execution fails; PIKE's paper
notes that the general case needs generative planning.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import accumulate
from math import ceil
from typing import NamedTuple, TypeAlias

from robust.pike_bridge import model
from robust.pike_bridge.knowledge.sat import satisfiable
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.executive import PlanExecutive, Ranking, ReportError, as_written, check_outcome
from robust.pike_bridge.online.semantic import OnlineSemantics, Reasoner
from robust.pike_bridge.semantics import restrict
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
        order = sorted(self._ranking(choice.domain), key=lambda value: value != preferred)
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


class _Repair(NamedTuple):
    """What follows from choices that were guessed wrongly."""

    facts: Facts
    undone: tuple[str, ...]
    """Executed events that do not count any more."""
    new: list[Recovery]
    left: list[Recovery]
    """What is being undone already, with the time that it still takes."""


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
        self._make = reasoner
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
    def reasoner(self) -> Reasoner:
        """What answers about the candidate that is executed now."""
        return self._inner.reasoner

    @property
    def running(self) -> Iterator[model.Activity]:
        """The activities that run, of the candidate that is executed now."""
        return (self._inner.plan.network.activities[place] for place in self._inner.running)

    @property
    def guess(self) -> Mapping[str, str]:
        """The scenario of the candidate that is executed now; nothing if there is none."""
        known = self._guess or {}
        return {choice.name: known[choice.name] for choice in self.plan.network.choices if choice.name in known}

    @property
    def assumed(self) -> Mapping[str, str]:
        """The guesses about uncontrollable choices that have not been observed."""
        theirs = self.plan.network.uncontrollable
        return {name: value for name, value in self.guess.items() if name in theirs and name not in self.observed}

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
        outcomes = (each for each in messages if isinstance(each, said.Outcome))
        decisions: list[KirkDecision] = [self._take(each, time) for each in outcomes]
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

    def _take(self, message: said.Outcome, time: Fraction) -> said.Decision:
        try:
            check_outcome(self.plan, self.observed, message)
        except ReportError as error:
            return said.Rejected(str(message), str(error), time)
        self.observed[message.choice] = message.value
        return said.Chosen(message.choice, message.value, time, observed=True)

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

    def could(self, environment: model.Guard, now: Fraction) -> bool:
        """Whether a candidate is left if choices of others were observed now that are not known yet.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        if self._guess is None or model.contradicts(environment, model.guard(self.observed)):
            return False
        return self._found(now, self.observed | dict(environment)) is not None

    def _found(self, now: Fraction, observed: Mapping[str, str]) -> tuple[dict[str, str], _Repair] | None:
        """Another scenario that agrees with what was observed, and what is undone for it; None if there is none.

        What the executive did for its guess is undone only if nothing is left otherwise.
        """
        guessed = self.guess
        repair = self._repair(now, observed)
        found = self._guesser.guess(repair.facts, guessed, self._deadline)
        if found is None:
            wanted = self._guesser.guess(Facts(model.guard(observed)), guessed, self._deadline)
            if wanted is None:
                return None
            repair = self._repair(now, wanted)
            found = self._guesser.guess(repair.facts, guessed, self._deadline)
        return None if found is None else (found, repair)

    def _repair(self, now: Fraction, observed: Mapping[str, str]) -> _Repair:
        old = model.guard(self._guess or {})
        executed = {event: time for event, time in self.progress.times.items() if event in self._events}
        begun = [each for each in self.plan.network.activities if each.source in executed and each.guard <= old]
        kept = kept_events(self.plan, executed, begun, observed)
        wrong = [each for each in begun if each.source not in kept]
        new = recoveries(wrong, executed, self._durations, self.plan.epsilon)
        left = [replace(one, duration=min(one.duration, end - now)) for one, end in self._recovery if end > now]
        duration = sum((one.duration for one in (*new, *left)), Fraction(0))
        going_on = frozenset(activity.target for activity in self.running if activity.source in kept)
        known = model.guard(observed).union(*(self.plan.network.guards[event] for event in kept))
        facts = Facts(known, kept, now, now + duration, going_on, self._broken(kept, old))
        return _Repair(facts, tuple(event for event in executed if event not in kept), new, left)

    def _replan(self, now: Fraction) -> Iterator[KirkDecision]:
        another = self._found(now, self.observed)
        if another is None or another[0] == self._guess:
            self.outcome = said.Failed(now, "no candidate is left that agrees with what has happened")
            yield self.outcome
            return
        found, (facts, undone, new, left) = another
        going_on, undo = facts.running, [*new, *left]
        abandoned = tuple((each.action, each.target) for each in self.running if each.target not in going_on)
        self.replans += 1
        self.recovered += sum((one.duration for one in new), Fraction(0))
        self._guess = found
        waiting = frozenset(self._guesser.foremost(facts.times, going_on))
        self._inner = self._executive(candidate(self.plan, found, undo=undo, waiting=waiting, number=self.replans))
        self._resume(facts.times)
        _, *ends = accumulate((one.duration for one in undo), initial=now)
        self._recovery = list(zip(undo, ends, strict=True))
        yield Replanned(now, undone, abandoned, facts.release - now)

    def _executive(self, plan: model.TeamPlan) -> PlanExecutive:
        return PlanExecutive(plan, self._make, ranking=self._ranking, patience=None, deadline=self._deadline)

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
