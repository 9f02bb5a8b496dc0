"""Questions to an executive at any time: why is something so, and why not otherwise?

Each answer is found when it is asked for, by a solver session of its own; deciding costs nothing more for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.execution import Execution, holds
from robust.pike_bridge.model import Activity, Assignment, may_produce, starts_with
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.messages import Failed
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasons import Conflict, Obstacle, Support, WhyChosen, WhyExecuted, WhyNot
from robust.pike_bridge.online.situation import Situation
from robust.pike_bridge.online.statements import Kind, Statement
from robust.plan.numerals import format_number
from robust.smt.limits import Deadline

Question: TypeAlias = str | Assignment
"""An event by its name, or a choice with a value."""

_FEW = 6
"""With so many inferences the simplest conflict is sought."""


def why(
    executive: PlanExecutive,
    question: Question,
    *,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> WhyExecuted | WhyChosen | WhyNot:
    """Why an event is executed, or may be, or a choice has a value, as far as the facts of now tell.

    What is not so, and cannot be now, is answered as by :func:`why_not`.

    Raises:
        InputError: if there is no such event, choice or value.
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """
    inquiry = Inquiry(executive.progress, solver=solver, deadline=deadline)
    inquiry.check(question)
    if isinstance(question, Assignment):
        return inquiry.chosen(question) if inquiry.holds(question) else inquiry.why_not_assignment(question)
    if question in executive.progress.times:
        return inquiry.executed(question)
    obstacle = inquiry.why_not_event(question)
    return inquiry.executed(question, obstacle.continuation) if obstacle.continuation is not None else obstacle


def why_not(
    executive: PlanExecutive,
    question: Question,
    *,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> WhyNot:
    """Why an event may not be executed now, or a choice not have a value.

    Raises:
        InputError: if there is no such event, choice or value.
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """
    inquiry = Inquiry(executive.progress, solver=solver, deadline=deadline)
    inquiry.check(question)
    if isinstance(executive.outcome, Failed):
        return inquiry.failed()
    if isinstance(question, Assignment):
        return inquiry.why_not_assignment(question)
    return inquiry.why_not_event(question)


def why_failed(
    executive: PlanExecutive,
    *,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> WhyNot:
    """Why no correct execution is left; that one is, if so.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """
    return Inquiry(executive.progress, solver=solver, deadline=deadline).failed()


class Inquiry:
    """All questions about one moment of an execution, which share a session."""

    def __init__(
        self,
        progress: Progress,
        *,
        solver: str = "z3",
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
    ) -> None:
        self.situation = Situation(progress, solver=solver, deadline=deadline)
        self._progress = self.situation.progress
        self._plan = progress.plan
        self._wording = self.situation.wording
        self._statements = self.situation.statements
        self._continuation: Execution | None = None
        self._sought = False

    @property
    def continuation(self) -> Execution | None:
        """A correct execution that is left."""
        if not self._sought:
            self._continuation = self.situation.continuation()
            self._sought = True
        return self._continuation

    def check(self, question: Question) -> None:
        """InputError if a question is about something that the plan does not have."""
        guards, domains = self._progress.structure.guards, self._plan.network.domains
        if isinstance(question, Assignment):
            if question.variable not in domains:
                raise InputError(f"unknown choice {question.variable}{did_you_mean(question.variable, domains)}")
            if question.value not in domains[question.variable]:
                expected = ", ".join(domains[question.variable])
                raise InputError(f"{question.variable} has no value {question.value}; expected one of {expected}")
        elif question not in guards:
            raise InputError(f"unknown event {question}{did_you_mean(question, guards)}")

    def holds(self, assignment: Assignment) -> bool:
        """Whether a choice is known to have a value, or can have no other."""
        known = self._progress.chosen.get(assignment.variable)
        if known is not None:
            return known == assignment.value
        domain = self._plan.network.domains[assignment.variable]
        others = [Assignment(assignment.variable, value) for value in domain if value != assignment.value]
        return self.continuation is not None and all(self._with(each) is None for each in others)

    # -- why ---------------------------------------------------------------------------------------------------------

    def executed(self, event: str, continuation: Execution | None = None) -> WhyExecuted:
        """Why an event was executed: what its activities need and serve in a continuation."""
        found = continuation or self.continuation
        places = [
            place
            for place, activity in enumerate(self._plan.network.activities)
            if activity.source == event and (found is None or holds(activity.guard, found.scenario))
        ]
        links = [] if found is None else list(self._links(found))
        return WhyExecuted(
            event,
            self._wording.event(event),
            tuple(link.support for link in links if link.consumer in places and link.producer is not None),
            tuple(link.support for link in links if link.producer in places),
            self.situation.latest(event),
            found,
        )

    def chosen(self, assignment: Assignment) -> WhyChosen:
        """Why a choice has a value: what excluded the others when it was made, and what the value serves."""
        domain = self._plan.network.domains[assignment.variable]
        inquiry = self._before(assignment.variable)
        others = [Assignment(assignment.variable, value) for value in domain if value != assignment.value]
        impossible, possible = {}, []
        for other in others:
            conflict = inquiry.conflict_with(other)
            if conflict is None:
                possible.append(other.value)
            else:
                impossible[other.value] = conflict
        found = self._with(assignment)
        serves = () if found is None else tuple(self._served_by(assignment, found))
        return WhyChosen(assignment.variable, assignment.value, tuple(possible), impossible, serves, found)

    def inferred(self, possible: Mapping[str, Sequence[str]]) -> dict[str, WhyChosen]:
        """Why choices have no other values than the given ones, each conflict resting on simpler ones before it.

        That a choice must have its value, which has been explained, is then a fact for the next.
        """
        domains = self._plan.network.domains
        found: dict[str, dict[str, Conflict]] = {
            choice: dict(self._excluded(choice, domains[choice], values)) for choice, values in possible.items()
        }
        ordered = sorted(found, key=lambda choice: sum(len(each.facts) for each in found[choice].values()))
        known: list[Assignment] = []
        answers = {}
        for choice in ordered:
            values = possible[choice]
            simplest = {
                value: self._simplest(Assignment(choice, value), conflict, known)
                for value, conflict in found[choice].items()
            }
            only = values[0] if len(values) == 1 else None
            answers[choice] = WhyChosen(choice, only, () if only else tuple(values), simplest)
            if only:
                known.append(Assignment(choice, only))
        return answers

    def _simplest(self, assignment: Assignment, conflict: Conflict, known: Sequence[Assignment]) -> Conflict:
        """Of conflicts that rest on one of the known choices, or on none, that with the fewest facts."""
        others = (self.conflict_with(assignment, [each]) for each in known[:_FEW])
        return min([conflict, *(each for each in others if each is not None)], key=lambda each: len(each.facts))

    def conflict_with(self, assignment: Assignment, known: Iterable[Assignment] = ()) -> Conflict | None:
        """Why a choice cannot have a value, where others that were inferred are facts; None if it can."""
        hypotheses = [
            *self._statements.assignments(Kind.ASSUMPTION, [assignment]),
            *self._statements.assignments(Kind.INFERENCE, known),
        ]
        return self._told(self.situation.conflict(hypotheses))

    # -- why not -----------------------------------------------------------------------------------------------------

    def why_not_assignment(self, assignment: Assignment) -> WhyNot:
        """Why a choice cannot have a value."""
        subject, known = str(assignment), self._progress.chosen.get(assignment.variable)
        if known == assignment.value:
            return WhyNot(subject, Obstacle.DONE, f"{assignment} is so already")
        if known is not None:
            return WhyNot(subject, Obstacle.EXCLUDED, f"{assignment.variable} = {known} has been decided")
        conflict = self.conflict_with(assignment)
        if conflict is not None:
            return WhyNot(subject, Obstacle.CONFLICT, f"{assignment} is impossible", conflict=conflict)
        return WhyNot(subject, Obstacle.NONE, f"{assignment} is possible", continuation=self._with(assignment))

    def why_not_event(self, event: str) -> WhyNot:
        """Why an event may not be executed now."""
        name, now = self._wording.event(event), format_number(self._progress.now)
        simple = self._simply_not(event)
        if simple is not None:
            return simple
        hypotheses = [self._statements.executed_now(event), *self._statements.unreported()]
        conflict = self._told(self.situation.conflict(hypotheses))
        if conflict is not None:
            return WhyNot(name, Obstacle.CONFLICT, f"{name} is impossible at {now}", conflict=conflict)
        found = self.situation.continuation(hypotheses)
        return WhyNot(name, Obstacle.NONE, f"{name} is possible at {now}", continuation=found)

    def failed(self) -> WhyNot:
        """Why no correct execution is left."""
        conflict = self._told(self.situation.conflict())
        if conflict is None:
            return WhyNot("the plan", Obstacle.NONE, "a correct execution is left", continuation=self.continuation)
        return WhyNot("the plan", Obstacle.ENDED, "these contradict each other", conflict=conflict)

    def _simply_not(self, event: str) -> WhyNot | None:
        """What speaks against an event without any reasoning."""
        progress, name = self._progress, self._wording.event(event)
        if event in progress.times:
            return WhyNot(name, Obstacle.DONE, f"{name} was executed at {format_number(progress.times[event])}")
        against = [
            f"{variable} = {progress.chosen[variable]}"
            for variable, value in sorted(progress.structure.guards[event])
            if progress.chosen.get(variable, value) != value
        ]
        if against:
            return WhyNot(name, Obstacle.EXCLUDED, f"{name} is not done, as {', '.join(against)}")
        if not progress.ours(event):
            return WhyNot(name, Obstacle.AWAITED, self._awaited(event))
        return self._too_early(event, name)

    def _awaited(self, event: str) -> str:
        progress = self._progress
        open_choices = [choice for choice in progress.structure.awaited[event] if choice not in progress.chosen]
        if open_choices:
            many = len(open_choices) > 1
            return (
                f"waiting to learn {' and '.join(open_choices)}, which {'are' if many else 'is'} not for us to choose"
            )
        activity = next(each for each in self._plan.network.activities if each.target == event)
        started = progress.times.get(activity.source)
        if started is None:
            return f"waiting for {activity.action}, which has not begun"
        return f"waiting for {activity.action} to end, begun at {format_number(started)}"

    def _too_early(self, event: str, name: str) -> WhyNot | None:
        progress = self._progress
        guard = progress.structure.guards[event]
        for constraint in progress.structure.incoming[event]:
            lower = constraint.lower
            if lower is None or lower < 0 or not progress.certain(constraint.guard, guard):
                continue
            source, earlier = self._wording.event(constraint.source), progress.times.get(constraint.source)
            if earlier is None and lower > 0:
                return WhyNot(name, Obstacle.EARLY, f"{name} comes after {source}, which is still to come")
            if earlier is not None and progress.now < earlier + lower:
                first = earlier + lower
                distance = f"at least {format_number(lower)} after {source} at {format_number(earlier)}"
                text = f"{name} is {distance}: {format_number(first)} or later"
                return WhyNot(name, Obstacle.EARLY, text, earliest=first)
        return None

    # -- helpers -----------------------------------------------------------------------------------------------------

    def _with(self, assignment: Assignment) -> Execution | None:
        if self.continuation is not None and self.continuation.scenario[assignment.variable] == assignment.value:
            return self.continuation
        return self.situation.continuation(self._statements.assignments(Kind.ASSUMPTION, [assignment]))

    def _before(self, choice: str) -> Inquiry:
        """The moment at which a choice was made, without it and what came after; broken links stay broken."""
        progress = self._progress
        if choice not in progress.chosen:
            return self
        names = list(progress.chosen)
        made = {name: progress.chosen[name] for name in names[: names.index(choice)]}
        event = next(each.event for each in self._plan.network.choices if each.name == choice)
        earlier = Progress(self._plan, progress.now, {}, made, set(progress.void))
        for name, time in progress.times.items():
            if earlier.certain(earlier.structure.guards[name]):
                earlier.times[name] = time
                if name == event:
                    earlier.now = time
                    break
        guards = earlier.structure.guards
        earlier.pending = {
            each: None for each in earlier.pending if each not in earlier.times and earlier.compatible(guards[each])
        }
        return Inquiry(earlier, solver=self.situation.solver, deadline=self.situation.deadline)

    def _excluded(self, choice: str, domain: Sequence[str], possible: Sequence[str]) -> Iterator[tuple[str, Conflict]]:
        for value in domain:
            if value not in possible:
                conflict = self.conflict_with(Assignment(choice, value))
                if conflict is not None:
                    yield value, conflict

    def _told(self, statements: Iterable[Statement] | None) -> Conflict | None:
        if statements is None:
            return None
        facts = [each.fact for each in statements]
        least: list[Activity] = [each.activity for each in facts if each.activity is not None]
        sequence = self._wording.sequence(least)
        if sequence is not None:
            facts.sort(key=lambda fact: sequence.index(fact.activity) if fact.activity in sequence else -1)
        return Conflict(tuple(facts), sequence is not None)

    def _links(self, execution: Execution) -> Iterator[_Link]:
        """The link that supports each condition of an execution: of effects that do, the latest."""
        for condition in self._plan.conditions:
            if not holds(condition.guard, execution.scenario):
                continue
            first = execution.schedule[condition.first]
            producers = [
                effect
                for effect in self._plan.effects
                if holds(effect.guard, execution.scenario)
                and may_produce(effect, condition)
                and (effect, condition) not in self._progress.void
                and (starts_with(effect, condition) or execution.schedule[effect.event] < first)
            ]
            effect = max(producers, key=lambda each: execution.schedule[each.event])
            support = Support(
                str(effect.literal),
                self._wording.producer(effect),
                self._wording.consumer(condition),
                execution.schedule[effect.event],
            )
            yield _Link(effect.activity, condition.activity, support)

    def _served_by(self, assignment: Assignment, execution: Execution) -> Iterator[Support]:
        """What activities that the assignment activates establish for activities that it does not."""
        activities = self._plan.network.activities
        for link in self._links(execution):
            inside = link.producer is not None and assignment in activities[link.producer].guard
            outside = link.consumer is None or assignment not in activities[link.consumer].guard
            if inside and outside:
                yield link.support


@dataclass(frozen=True, slots=True)
class _Link:
    """A causal link with the places of its activities."""

    producer: int | None
    consumer: int | None
    support: Support
