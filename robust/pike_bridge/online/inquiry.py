"""Why, and why not: questions that an executive answers at any time, and the answers as data, as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import takewhile
from typing import Any, ClassVar, TypeAlias

from robust import json_text, presented
from robust.errors import InputError, did_you_mean
from robust.numbers import format_number
from robust.pike_bridge.model import ALWAYS, Assignment, Guard, TeamPlan, check_choice, may_produce, starts_with
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.explain import OF_PLAN, About, Fact, Situation, durations, listed
from robust.pike_bridge.online.progress import Chosen, Decision, Dispatched, Excluded, Executed, Failed, Progress
from robust.pike_bridge.semantics import Execution, holds
from robust.smt.limits import NEVER, Deadline

_FEW = 6
"""The most inferences among which the simplest conflict is sought."""


# -- answers -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Clash:
    """Facts that contradict each other, with what the plan demands; without any one of them they would not.

    Choices that are made are in the order of the plan.

    `sequence`: the plan puts the activities whose least durations are among them one after the other.
    """

    facts: tuple[Fact, ...]
    sequence: bool = False

    @property
    def choices(self) -> str:
        """The choices that it rests on: `xA1 = mug, xA2 = coffee`."""
        return ", ".join(self._texts(About.CHOICE, About.INFERENCE))

    @property
    def clauses(self) -> tuple[str, ...]:
        """All but choices and what was asked: first what has happened, then what the plan demands."""
        happened = (", ".join(self._texts(*kinds)) for kinds in ((About.EVENT, About.TIME), (About.REPORT,)))
        return (*self._texts(About.LINK), *filter(None, happened), *self._demanded())

    def under(self, head: str) -> tuple[str, ...]:
        """A heading with the choices that it rests on, then one line for each other fact."""
        given = f", as {self.choices}" if self.choices else ""
        clauses = self.clauses
        if clauses:
            return (f"{head}{given}:", *(f"  {clause}" for clause in clauses))
        return (f"{head}{given or ': the plan never allows it'}",)

    def _texts(self, *kinds: About) -> list[str]:
        return [fact.text for fact in self.facts if fact.kind in kinds]

    def _demanded(self) -> Iterator[str]:
        demands = [fact for fact in self.facts if fact.kind in OF_PLAN]
        yield from self._texts(About.CONDITION)
        least = [demand.activity for demand in demands if demand.activity]
        bounds = [demand for demand in demands if demand.kind is About.BOUND]
        total = sum((activity.lower for activity in least), Fraction(0))
        exceeded = self.sequence and len(bounds) == 1 and bounds[0].limit is not None and total > bounds[0].limit
        if least:
            yield durations(least) + (f": {format_number(total)} in all" if exceeded and len(least) > 1 else "")
        yield from (demand.text for demand in demands if demand.kind is About.DURATION and not demand.activity)
        yield from (f"but {bound.text}" if exceeded else bound.text for bound in bounds)
        if [demand.kind for demand in demands] == [About.ORDER]:
            yield "the plan demands another order of events"


@dataclass(frozen=True, slots=True)
class Support:
    """A causal link of a continuation: a producer establishes a literal for a consumer."""

    literal: str
    producer: str
    consumer: str
    time: Fraction
    """When it is established."""


class Explanation:
    """An answer; its `text` tells it."""

    __slots__ = ()
    KIND: ClassVar[str]
    SHOWN: ClassVar[tuple[str, ...]]
    """What of it is in JSON."""

    @property
    def lines(self) -> tuple[str, ...]:
        raise NotImplementedError

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    def as_dict(self) -> dict[str, Any]:
        """A reason of `robust/pike-run/1`."""
        return {"kind": self.KIND, **{name: answer(getattr(self, name)) for name in self.SHOWN}}


@dataclass(frozen=True, slots=True)
class WhyExecuted(Explanation):
    """Why an event was, or may be, executed: a continuation in which it is, and what it is good for there.

    Attributes:
        event: the event; `name` says what happens there.
        needs: what activities that begin there, or have conditions there, were given by other activities.
        serves: what its activities establish for others.
        latest: until when it can be executed; None if that is not limited.
        continuation: choices, and times of all their events; None if none is left.
    """

    KIND = "execution"
    SHOWN = ("event", "text", "needs", "serves", "latest")

    event: str
    name: str
    needs: tuple[Support, ...]
    serves: tuple[Support, ...]
    latest: Fraction | None
    continuation: Execution | None

    @property
    def parts(self) -> tuple[str, ...]:
        """What is to be said, apart."""
        needed = _grouped((need.producer, need) for need in self.needs)
        clauses = [*_served(self.serves), *(f"uses {what} from {whom}" for whom, what in needed)]
        if self.latest is not None:
            clauses.append(f"not later than {format_number(self.latest)}")
        return tuple(clauses)

    @property
    def lines(self) -> tuple[str, ...]:
        return ("; ".join(self.parts) or f"nothing speaks against {self.name}",)


@dataclass(frozen=True, slots=True)
class WhyChosen(Explanation):
    """Why a choice has a value, or must have it.

    Attributes:
        possible: the values that would have been possible as well, in the order of preference.
        impossible: for each other value why it is not.
        serves: what the activities of the value establish for others.
    """

    KIND = "choice"
    SHOWN = ("choice", "value", "text", "possible", "impossible", "serves")

    choice: str
    value: str | None
    """None if several values are possible."""
    possible: tuple[str, ...]
    impossible: Mapping[str, Clash]
    serves: tuple[Support, ...] = ()
    continuation: Execution | None = None

    @property
    def excluding(self) -> tuple[str, ...]:
        """Why it has no other value."""
        return _excluding(self.impossible)

    @property
    def parts(self) -> tuple[str, ...]:
        """What its value is good for, and what else would have been possible."""
        clauses = _served(self.serves)
        if self.possible:
            verb = "is" if len(self.possible) == 1 else "are"
            clauses.append(f"{listed(self.possible)} {verb} possible" + (", too" if self.value else ""))
        return tuple(clauses)

    @property
    def lines(self) -> tuple[str, ...]:
        return (*self.excluding, "; ".join(self.parts)) if self.parts else self.excluding


@dataclass(frozen=True, slots=True)
class WhyExcluded(Explanation):
    """What values of open choices an act leaves impossible, each with what contradicts it then.

    Attributes:
        event: what was executed.
        reason: why it could not wait.
        impossible: by the values.
    """

    KIND = "exclusion"
    SHOWN = ("event", "text", "reason", "impossible")

    event: str
    reason: str
    impossible: Mapping[str, Clash]

    @property
    def lines(self) -> tuple[str, ...]:
        return _excluding(self.impossible)


class Obstacle(presented.VerdictEnum):
    """Why something is not done, or cannot be."""

    NONE = "possible"
    DONE = "done"
    EXCLUDED = "excluded"
    AWAITED = "awaited"
    EARLY = "early"
    WITHHELD = "withheld"
    CONFLICT = "conflict"
    ENDED = "ended"


@dataclass(frozen=True, slots=True)
class WhyNot(Explanation, presented.NoTruthValue, ask="obstacle"):
    """Why an event is not executed now, a choice has not a value, or no correct execution is left.

    Attributes:
        subject: what was asked about, in words.
        reason: why not, in words, but for the conflict.
        earliest: from when on it is not too early any more, as far as is known.
        conflict: what contradicts it.
        continuation: a correct execution with it, if it is possible.
    """

    KIND = "obstacle"
    SHOWN = ("subject", "obstacle", "text", "earliest", "conflict")

    subject: str
    obstacle: Obstacle
    reason: str = ""
    earliest: Fraction | None = None
    conflict: Clash | None = None
    continuation: Execution | None = None

    @property
    def lines(self) -> tuple[str, ...]:
        return (self.reason,) if self.conflict is None else self.conflict.under(self.reason)


def answer(value: object) -> Any:
    """A part of a reason for JSON; continuations are in the order of time."""
    match value:
        case Clash(facts):
            return [fact.as_dict() for fact in facts]
        case Execution():
            schedule = sorted(value.schedule.items(), key=lambda item: (item[1], item[0]))
            return json_text.plain({"scenario": value.scenario, "schedule": dict(schedule)})
        case Mapping():
            return {key: answer(each) for key, each in value.items()}
        case _:
            return json_text.plain(value)


def _contradicted(clashes: Mapping[str, Clash | None]) -> dict[str, Clash]:
    """The values that something contradicts."""
    return {value: clash for value, clash in clashes.items() if clash is not None}


def _excluding(impossible: Mapping[str, Clash]) -> tuple[str, ...]:
    """What contradicts each of the values."""
    return tuple(line for values, clash in impossible.items() for line in clash.under(f"not {values}"))


def _served(supports: tuple[Support, ...]) -> list[str]:
    """`establishes (have mug) for (pour-coffee human)`, and so on, one for each consumer."""
    return [f"establishes {what} for {who}" for who, what in _grouped((link.consumer, link) for link in supports)]


def _grouped(links: Iterable[tuple[str, Support]]) -> list[tuple[str, str]]:
    """For each of the other ends of links the literals, listed."""
    literals: dict[str, dict[str, None]] = {}
    for end, link in links:
        literals.setdefault(end, {})[link.literal] = None
    return [(end, listed(list(names))) for end, names in literals.items()]


# -- questions ---------------------------------------------------------------------------------------------------------

Question: TypeAlias = str | Assignment
"""An event by its name, or a choice with a value."""


def why(executive: PlanExecutive, question: Question, *, solver: str = "z3", deadline: Deadline = NEVER) -> Explanation:
    """Why an event is executed, or may be, or a choice has a value, as far as the facts of now tell.

    What is not so, and cannot be now, is answered as by :func:`why_not`.

    Args:
        executive: the execution, which goes on unchanged.
        question: the name of an event, or a choice with a value.
        solver: `z3` or `cvc5`.
        deadline: when to give up.

    Returns:
        The facts that it follows from, with times in the plan's unit; `str` of it is for people.

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


def why_not(executive: PlanExecutive, question: Question, *, solver: str = "z3", deadline: Deadline = NEVER) -> WhyNot:
    """Why an event may not be executed now, or a choice not have a value.

    Args:
        executive: the execution, which goes on unchanged.
        question: the name of an event, or a choice with a value.
        solver: `z3` or `cvc5`.
        deadline: when to give up.

    Returns:
        The facts and bounds that exclude it, none of which could be left out; or that nothing does.

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
    if question in executive.withheld:
        return inquiry.withheld(question, executive.withheld_until)
    return inquiry.why_not_event(question)


def why_failed(executive: PlanExecutive, *, solver: str = "z3", deadline: Deadline = NEVER) -> WhyNot:
    """Why no correct execution is left; that one is, if so.

    Args:
        executive: the execution, which goes on unchanged.
        solver: `z3` or `cvc5`.
        deadline: when to give up.

    Returns:
        The facts and bounds that contradict each other, none of which could be left out; or that nothing does.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """
    return Inquiry(executive.progress, solver=solver, deadline=deadline).failed()


def why_none(plan: TeamPlan, assume: Guard = ALWAYS, *, solver: str = "z3", deadline: Deadline = NEVER) -> WhyNot:
    """Why a plan has no correct execution with these choices; that it has one, if so. As :func:`why_failed`."""
    known = dict(assume)
    chosen = {name: known[name] for name in plan.network.domains if name in known}
    return Inquiry(Progress(plan, chosen=chosen), solver=solver, deadline=deadline).failed()


class Inquiry(Situation):
    """All questions about one moment of an execution, which share a session."""

    @cached_property
    def continuation(self) -> Execution | None:
        """A correct execution that is left."""
        return self.continued()

    def check(self, question: Question) -> None:
        """InputError if a question is about something that the plan does not have."""
        guards, domains = self.progress.structure.guards, self._plan.network.domains
        if isinstance(question, Assignment):
            check_choice(domains, *question)
        elif question not in guards:
            raise InputError(f"unknown event {question}{did_you_mean(question, guards)}")

    def holds(self, assignment: Assignment) -> bool:
        """Whether a choice is known to have a value, or can have no other."""
        known = self.progress.chosen.get(assignment.variable)
        if known is not None:
            return known == assignment.value
        domain = self._plan.network.domains[assignment.variable]
        others = [Assignment(assignment.variable, value) for value in domain if value != assignment.value]
        return self.continuation is not None and all(self._with(each) is None for each in others)

    # -- why ---------------------------------------------------------------------------------------------------------

    def executed(self, event: str, continuation: Execution | None = None) -> WhyExecuted:
        """Why an event was executed: what its activities need and serve in a continuation."""
        execution = continuation or self.continuation
        places = [
            place
            for place, activity in enumerate(self._plan.network.activities)
            if activity.source == event and (execution is None or holds(activity.guard, execution.scenario))
        ]
        supports = [] if execution is None else list(self._supports(execution))
        return WhyExecuted(
            event,
            self.wording.event(event),
            tuple(each for by, to, each in supports if to in places and by is not None),
            tuple(each for by, _, each in supports if by in places),
            self.latest(event),
            execution,
        )

    def chosen(self, assignment: Assignment) -> WhyChosen:
        """Why a choice has a value: what excluded the others when it was made, and what the value serves."""
        choice, inquiry = assignment.variable, self._before(assignment.variable)
        clashes = {
            value: inquiry.conflict_with(Assignment(choice, value))
            for value in self._plan.network.domains[choice]
            if value != assignment.value
        }
        possible = tuple(value for value, clash in clashes.items() if clash is None)
        impossible = _contradicted(clashes)
        continuation = self._with(assignment)
        serves = () if continuation is None else tuple(self._served_by(assignment, continuation))
        return WhyChosen(choice, assignment.value, possible, impossible, serves, continuation)

    def inferred(self, possible: Mapping[str, Sequence[str]]) -> dict[str, WhyChosen]:
        """Why choices have no other values than the given ones, each conflict resting on simpler ones before it.

        That a choice must have its value, which has been explained, is then a fact for the next.
        """
        domains = self._plan.network.domains
        clashes: dict[str, dict[str, Clash]] = {}
        for choice, values in possible.items():
            others = (value for value in domains[choice] if value not in values)
            clashes[choice] = _contradicted({each: self.conflict_with(Assignment(choice, each)) for each in others})
        ordered = sorted(clashes, key=lambda choice: sum(len(each.facts) for each in clashes[choice].values()))
        known: list[Assignment] = []
        answers = {}
        for choice in ordered:
            values = possible[choice]
            simplest = {
                value: self._simplest(Assignment(choice, value), conflict, known)
                for value, conflict in clashes[choice].items()
            }
            only = values[0] if len(values) == 1 else None
            answers[choice] = WhyChosen(choice, only, () if only else tuple(values), simplest)
            if only:
                known.append(Assignment(choice, only))
        return answers

    def _simplest(self, assignment: Assignment, conflict: Clash, known: Sequence[Assignment]) -> Clash:
        """The conflict with the fewest facts, of those that rest on one of the known choices, or on none."""
        others = (self.conflict_with(assignment, [each]) for each in known[:_FEW])
        return min([conflict, *(each for each in others if each is not None)], key=lambda each: len(each.facts))

    def conflict_with(self, assignment: Assignment, known: Iterable[Assignment] = ()) -> Clash | None:
        """Why a choice cannot have a value, where others that were inferred are facts; None if it can."""
        hypotheses = [*self.assignments(About.ASSUMPTION, [assignment]), *self.assignments(About.INFERENCE, known)]
        return self._clash(hypotheses)

    def step(self, decisions: Sequence[Decision], inferred: Mapping[str, tuple[str, ...]]) -> StepReasons:
        """The reasons of the step that has just been taken: of decisions, and of values that are still possible.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        reasons: list[Explanation | None] = []
        event = ""
        for decision in decisions:
            reason: Explanation | None = None
            match decision:
                case Executed():
                    event = decision.event
                case Dispatched():  # it begins at the event that was executed before
                    reason = self.executed(event)
                case Chosen(choice, value, observed=False):
                    reason = self.chosen(Assignment(choice, value))
                case Failed():
                    reason = self.failed()
                case Excluded():
                    reason = self.excluded(decision)
                case _:
                    pass
            reasons.append(reason)
        return StepReasons(self.continuation, tuple(reasons), self.inferred(inferred))

    def excluded(self, excluded: Excluded) -> WhyExcluded:
        """Why an act excludes values of open choices: what contradicts them if it is done, as things were then."""
        progress, event = self.progress, excluded.event
        earlier = dict(takewhile(lambda each: each[0] != event, progress.times.items()))
        later = progress.times.keys() - earlier.keys()
        choices = self._plan.network.choices
        undecided = {choice.name for choice in choices if choice.controllable and choice.event in later}
        chosen = {name: value for name, value in progress.chosen.items() if name not in undecided}
        then = Inquiry(progress.rewound(excluded.time, earlier, chosen), solver=self.solver, deadline=self.deadline)
        ours = [Assignment(name, progress.chosen[name]) for name in undecided if name in progress.chosen]
        decided = [
            assignment for assignment in ours if assignment.variable in progress.structure.made_at.get(event, ())
        ]
        done = [*then.assignments(About.CHOICE, decided), then.executed_now(event), *then.unreported()]
        clashes = {values: then._clash([*then.meaning(values), *done]) for values in excluded.lost}
        return WhyExcluded(event, excluded.reason, _contradicted(clashes))

    def meaning(self, values: str) -> list[Fact]:
        """The statement that open choices have values, `x = 1, y = 2`, and come up."""
        named = [Assignment(*each.split(" = ", 1)) for each in values.split(", ")]
        events = {choice.name: choice.event for choice in self._plan.network.choices}
        guards = (self.progress.structure.guards[events[assignment.variable] or ""] for assignment in named)
        return self.assignments(About.ASSUMPTION, sorted(frozenset(named).union(*guards)))

    # -- why not -----------------------------------------------------------------------------------------------------

    def why_not_assignment(self, assignment: Assignment) -> WhyNot:
        """Why a choice cannot have a value."""
        subject, known = str(assignment), self.progress.chosen.get(assignment.variable)
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
        name, now = self.wording.event(event), format_number(self.progress.now)
        simple = self._simply_not(event)
        if simple is not None:
            return simple
        hypotheses = [self.executed_now(event), *self.unreported()]
        conflict = self._clash(hypotheses)
        if conflict is not None:
            return WhyNot(name, Obstacle.CONFLICT, f"{name} is impossible at {now}", conflict=conflict)
        found = self.continued(hypotheses)
        return WhyNot(name, Obstacle.NONE, f"{name} is possible at {now}", continuation=found)

    def withheld(self, event: str, until: Fraction | None) -> WhyNot:
        """Why an event waits that could be executed."""
        limit = "" if until is None else f" until {format_number(until)}"
        name = self.wording.event(event)
        text = f"{name} waits{limit}: it would exclude what others may still choose"
        return WhyNot(name, Obstacle.WITHHELD, text, earliest=until, continuation=self.continuation)

    def failed(self) -> WhyNot:
        """Why no correct execution is left."""
        conflict = self._clash()
        if conflict is None:
            return WhyNot("the plan", Obstacle.NONE, "a correct execution is left", continuation=self.continuation)
        return WhyNot("the plan", Obstacle.ENDED, "these contradict each other", conflict=conflict)

    def _simply_not(self, event: str) -> WhyNot | None:
        """What speaks against an event without any reasoning."""
        progress, name = self.progress, self.wording.event(event)
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
        progress = self.progress
        open_choices = [choice for choice in progress.structure.awaited[event] if choice not in progress.chosen]
        if open_choices:
            many = len(open_choices) > 1
            return (
                f"waiting to learn {' and '.join(open_choices)}, which {'are' if many else 'is'} not for us to choose"
            )
        activity = next(activity for activity in self._plan.network.activities if activity.target == event)
        started = progress.times.get(activity.source)
        if started is None:
            return f"waiting for {activity.action}, which has not begun"
        return f"waiting for {activity.action} to end, begun at {format_number(started)}"

    def _too_early(self, event: str, name: str) -> WhyNot | None:
        progress = self.progress
        for source, lower in progress.lower_bounds(event):
            earlier, words = progress.times.get(source), self.wording.event(source)
            if earlier is None and lower > 0:
                return WhyNot(name, Obstacle.EARLY, f"{name} comes after {words}, which is still to come")
            if earlier is not None and progress.now < earlier + lower:
                first = earlier + lower
                distance = f"at least {format_number(lower)} after {words} at {format_number(earlier)}"
                text = f"{name} is {distance}: {format_number(first)} or later"
                return WhyNot(name, Obstacle.EARLY, text, earliest=first)
        return None

    # -- helpers -----------------------------------------------------------------------------------------------------

    def _with(self, assignment: Assignment) -> Execution | None:
        if self.continuation is not None and self.continuation.scenario[assignment.variable] == assignment.value:
            return self.continuation
        return self.continued(self.assignments(About.ASSUMPTION, [assignment]))

    def _before(self, choice: str) -> Inquiry:
        """The moment at which a choice was made, without it and what came after; broken links stay broken."""
        progress = self.progress
        if choice not in progress.chosen:
            return self
        chosen = dict(takewhile(lambda each: each[0] != choice, progress.chosen.items()))
        event = next(each.event for each in self._plan.network.choices if each.name == choice)
        guards = progress.structure.guards
        names = [name for name in progress.times if chosen.items() >= guards[name]]
        if event in names:
            names = names[: names.index(event) + 1]
        times = {name: progress.times[name] for name in names}
        earlier = progress.rewound(times.get(event or "", progress.now), times, chosen)
        return Inquiry(earlier, solver=self.solver, deadline=self.deadline)

    def _clash(self, hypotheses: Sequence[Fact] = ()) -> Clash | None:
        """A minimal conflict as it is told; None if there is none."""
        conflict = self.conflict(hypotheses)
        if conflict is None:
            return None
        places = {name: place for place, name in enumerate(self._plan.network.domains)}

        def turn(fact: Fact) -> tuple[bool, bool, int]:
            """What is asked comes first, then choices as the plan has them; all else stays in its order."""
            return fact.kind is not About.ASSUMPTION, fact.choice is None, places.get(fact.choice or "", -1)

        facts = sorted(conflict, key=turn)
        sequence = self.wording.sequence([fact.activity for fact in facts if fact.activity is not None])
        if sequence is not None:
            facts.sort(key=lambda fact: sequence.index(fact.activity) if fact.activity in sequence else -1)
        return Clash(tuple(facts), sequence is not None)

    def _supports(self, execution: Execution) -> Iterator[tuple[int | None, int | None, Support]]:
        """What supports each condition of an execution: of effects that do, the latest; with the activities of both."""
        for condition in self._plan.conditions:
            if not holds(condition.guard, execution.scenario):
                continue
            producers = [
                effect
                for effect in self._plan.effects
                if holds(effect.guard, execution.scenario)
                and may_produce(effect, condition)
                and (effect, condition) not in self.progress.void
                and (starts_with(effect, condition) or self._precedes(execution, effect.event, condition.first))
            ]
            effect = max(producers, key=lambda producer: execution.schedule[producer.event])
            by, whom = self.wording.producer(effect), self.wording.consumer(condition)
            support = Support(str(effect.literal), by, whom, execution.schedule[effect.event])
            yield effect.activity, condition.activity, support

    def _precedes(self, execution: Execution, earlier: str, later: str) -> bool:
        difference = execution.schedule[later] - execution.schedule[earlier]
        return difference >= self._plan.separation or self.progress.settled(earlier, later)

    def _served_by(self, assignment: Assignment, execution: Execution) -> Iterator[Support]:
        """What activities that the assignment activates establish for activities that it does not."""
        activities = self._plan.network.activities
        inside = {place for place, activity in enumerate(activities) if assignment in activity.guard}
        return (each for by, to, each in self._supports(execution) if by in inside and to not in inside)


@dataclass(frozen=True, slots=True)
class StepReasons:
    """Why each decision of a step was taken (None: it was reported, or speaks for itself), and each inference.

    One continuation supports all that was executed.
    """

    continuation: Execution | None = None
    decisions: tuple[Explanation | None, ...] = ()
    inferences: Mapping[str, Explanation] = field(default_factory=dict)
