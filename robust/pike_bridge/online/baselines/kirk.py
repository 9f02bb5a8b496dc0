"""Kirk: executes one candidate subplan, and plans anew when an uncontrollable choice is not what it guessed.

Source: the competing approach of [PIKE §6.2.1]. Before execution one intent and one adaptation to it are guessed
(:mod:`guess`). The candidate has no choices left, and is executed by PIKE's own executive: dispatch, temporal reasoning
and monitoring are shared. An outcome that contradicts the guess triggers a re-plan: what was done wrongly is undone
(:mod:`backtrack`), recovery activities are put before the rest, and the choice is made as it was observed. Other
guesses stay as they are if a correct execution allows it, as in the paper, which backtracks "the last incorrect
uncontrollable choice"; else they are guessed anew.

Defined for all team plans is what is wrong: events and activities whose guards the observed choices exclude, and what
was executed after them that has to come after their replacement. Recovery makes the world as if none of that had
happened. What is not wrong stays done, and commits: if the robot has fetched one thing for a guess, and what was
observed needs the other one, no candidate may be left, and the execution fails. PIKE's paper notes that such cases need
generative planning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import TypeAlias

from robust.pike_bridge.model import Activity, Assignment, Guard, TeamPlan, guard
from robust.pike_bridge.online.baselines.backtrack import Recovery, candidate, kept_events, recoveries
from robust.pike_bridge.online.baselines.guess import BrokenLinks, Facts, Guesser
from robust.pike_bridge.online.executive import PlanExecutive, Ranking, as_written
from robust.pike_bridge.online.progress import (
    Chosen,
    Completion,
    Decision,
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
from robust.pike_bridge.scenarios import contradicts
from robust.smt.limits import Deadline

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
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
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
