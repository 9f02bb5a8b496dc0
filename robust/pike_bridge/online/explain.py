"""Events, times and what a plan demands in the words of its activities, for explanations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from itertools import pairwise

import networkx

from robust.numbers import format_number
from robust.pike_bridge.model import (
    ALWAYS,
    GOAL,
    INITIAL,
    Activity,
    Assignment,
    Condition,
    Constraint,
    Effect,
    Guard,
    guard_text,
    may_produce,
    may_threaten,
)
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import OnlineSemantics, SemanticReasoner
from robust.pike_bridge.semantics import Execution, holds
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula

_MOST = 4
"""So many activities are named one by one."""


class Wording:
    """Names the events of one plan, and tells its demands."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._plan = progress.plan
        self._network = progress.plan.network
        self._names = {INITIAL: "the initial state", GOAL: "the goal"}
        self._name_ends_of_activities()
        self._name_ends_of_plan()
        for choice in self._network.choices:
            if choice.event is not None:
                self._names.setdefault(choice.event, f"the choice of {choice.name}")

    def event(self, name: str) -> str:
        """`start of (get human mug)`; the event's own name if no activity starts or ends there."""
        return self._names.get(name, name)

    def actor(self, activity: int | None, otherwise: str) -> str:
        """The action of an activity by its place, or else what is not an activity."""
        return otherwise if activity is None else self._network.activities[activity].action

    def consumer(self, condition: Condition) -> str:
        """Who has a condition."""
        return self.actor(condition.activity, "the goal")

    def producer(self, effect: Effect) -> str:
        """Who has an effect."""
        return self.actor(effect.activity, "the initial state")

    def condition(self, condition: Condition) -> str:
        """Who needs what, who establishes that, and who undoes it."""
        producers = [
            each
            for each in self._plan.effects
            if may_produce(each, condition)
            and _compatible(each.guard, condition.guard)
            and not self._after(each.event, condition.first)
        ]
        threats = [
            each
            for each in self._plan.effects
            if may_threaten(each, condition)
            and _compatible(each.guard, condition.guard)
            and not self._after(each.event, condition.last)
        ]
        text = f"{self.consumer(condition)} needs {condition.literal}, which "
        if producers:
            text += f"only {self._causes(producers, condition)}"
        else:
            text += "nothing establishes"
        undoing = list(dict.fromkeys(self.producer(each) for each in threats if each.event != INITIAL))
        if producers and undoing:
            text += f"; {listed(undoing)} {'undoes' if len(undoing) == 1 else 'undo'} it"
        return text

    def bound(self, constraint: Constraint, *, upper: bool) -> str:
        """One bound of a constraint, told as a distance from the earlier event to the later."""
        source, target = self.event(constraint.source), self.event(constraint.target)
        bound = constraint.upper if upper else constraint.lower
        if bound is None:
            raise ValueError(f"{constraint} has no such bound")
        if bound < 0:
            source, target, bound, upper = target, source, -bound, not upper
        if not upper and bound == 0:
            text = f"{target} is not before {source}"
        else:
            text = f"at {'most' if upper else 'least'} {format_number(bound)} from {source} to {target}"
        return _given(text, constraint.guard)

    def sequence(self, activities: Sequence[Activity]) -> list[Activity] | None:
        """The order of activities, if the plan demands that they be one after the other whenever all are done."""
        union: Guard = frozenset().union(*(each.guard for each in activities))
        if not _compatible(union, union):
            return None
        graph = networkx.DiGraph()
        graph.add_nodes_from(event.name for event in self._network.events)
        for constraint in self._network.temporal_constraints:
            if constraint.lower is not None and constraint.lower >= 0 and constraint.guard <= union:
                graph.add_edge(constraint.source, constraint.target)
        later = {each: networkx.descendants(graph, each.target) | {each.target} for each in activities}
        ordered = sorted(activities, key=lambda each: len(later[each]), reverse=True)
        return ordered if all(other.source in later[one] for one, other in pairwise(ordered)) else None

    def _causes(self, producers: Iterable[Effect], condition: Condition) -> str:
        """`(p1) establishes, if x = 1`; `(p1) if x = 1 and (p2) establish`."""
        causes = list(dict.fromkeys((self.producer(each), each.guard - condition.guard) for each in producers))
        if len(causes) == 1:
            who, label = causes[0]
            return f"{who} establishes" + (f", if {guard_text(label)}" if label else "")
        return listed([who + (f" if {guard_text(label)}" if label else "") for who, label in causes]) + " establish"

    def _after(self, event: str, other: str) -> bool:
        """Whether the plan puts an event later than another, whenever it has it."""
        before, reached, ahead = self._progress.structure.before, {event}, [event]
        while ahead:
            for earlier in before[ahead.pop()]:
                if earlier == other:
                    return True
                if earlier not in reached:
                    reached.add(earlier)
                    ahead.append(earlier)
        return False

    def _name_ends_of_activities(self) -> None:
        ends: dict[str, list[str]] = {}
        for activity in self._network.activities:
            ends.setdefault(activity.source, []).append(f"start of {activity.action}")
            ends.setdefault(activity.target, []).append(f"end of {activity.action}")
        for event, names in ends.items():
            self._names.setdefault(event, " and ".join(dict.fromkeys(names[:2])))

    def _name_ends_of_plan(self) -> None:
        """An event that is before all others, or after them, but for the initial state and the goal."""
        graph = networkx.DiGraph()
        graph.add_nodes_from(event.name for event in self._network.events)
        for constraint in self._network.temporal_constraints:
            if constraint.lower is not None and constraint.lower >= 0:
                graph.add_edge(constraint.source, constraint.target)
        inner = set(graph) - {INITIAL, GOAL}
        if len(inner) < 2 or not networkx.is_directed_acyclic_graph(graph):
            return
        for event in inner:
            if networkx.ancestors(graph, event) <= {INITIAL} and networkx.descendants(graph, event) >= inner - {event}:
                self._names.setdefault(event, f"the beginning ({event})")
            if networkx.descendants(graph, event) <= {GOAL} and networkx.ancestors(graph, event) >= inner - {event}:
                self._names.setdefault(event, f"the end ({event})")


def durations(activities: Iterable[Activity], *, upper: bool = False) -> str:
    """`(get human mug) takes at least 0.5, (pour-coffee human) 0.2`."""

    def parts() -> Iterator[str]:
        for at, activity in enumerate(activities):
            bound = activity.upper if upper else activity.lower
            verb = f"takes at {'most' if upper else 'least'} " if at == 0 else ""
            yield f"{activity.action} {verb}{format_number(bound or Fraction(0))}"

    return ", ".join(parts())


def listed(names: Sequence[str]) -> str:
    """`a, b and c`; of many only the first few."""
    if len(names) > _MOST:
        names = [*names[: _MOST - 1], f"{len(names) - _MOST + 1} more"]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _given(text: str, guard: Guard) -> str:
    return f"{text} ({guard_text(guard)})" if guard else text


def _compatible(one: Guard, other: Guard) -> bool:
    both = one | other
    return len({variable for variable, _ in both}) == len(both)


class Kind(Enum):
    """What a fact is about: what has happened, what is asked, or what the plan demands."""

    EVENT = "event"
    LINK = "link"
    CHOICE = "choice"
    TIME = "time"
    INFERENCE = "inference"
    REPORT = "report"
    ASSUMPTION = "assumption"
    CONDITION = "condition"
    DURATION = "duration"
    BOUND = "bound"
    ORDER = "order"


OF_PLAN = frozenset({Kind.CONDITION, Kind.DURATION, Kind.BOUND, Kind.ORDER})
"""The kinds of what the plan demands."""


@dataclass(frozen=True, slots=True)
class Fact:
    """Something that has happened, is assumed, or is demanded by the plan, in words."""

    kind: Kind
    text: str
    activity: Activity | None = field(default=None, compare=False)
    """Of a least duration: whose it is."""
    limit: Fraction | None = field(default=None, compare=False)
    """Of an upper bound of the plan that is not a duration: how much."""

    def as_dict(self) -> dict[str, str]:
        """As in `robust/pike-run/1`."""
        return {"about": self.kind.value, "fact": self.text}


@dataclass(frozen=True, slots=True)
class Statement:
    """A fact as words and as a formula."""

    fact: Fact
    formula: Formula


class Statements:
    """The statements of one plan and its execution so far; formulas are over `semantics.terms`."""

    def __init__(self, progress: Progress) -> None:
        self.semantics = OnlineSemantics(progress)
        self.wording = Wording(progress)
        self._progress = progress
        self._plan = progress.plan
        self._terms = self.semantics.terms

    @property
    def domains(self) -> tuple[Formula, ...]:
        """That each choice has one value: what is never in question."""
        network = self._plan.network
        return self.semantics.formulas[: -len(network.temporal_constraints) - len(self._plan.conditions) or None]

    def of_plan(self) -> list[Statement]:
        """What the plan demands: conditions, bounds, and all mere orders of events as one statement."""
        return [*self._conditions(), *self._durations(), *self._bounds(), self._order()]

    def happened(self) -> list[Statement]:
        """What has happened: choices, the present time, broken links, events; the latest first."""
        return [
            *reversed(list(self._choices())),
            self._time(),
            *self._broken(),
            *reversed(list(self._events())),
        ]

    def assignments(self, kind: Kind, assignments: Iterable[Assignment]) -> list[Statement]:
        """That choices are so."""
        suffix = ", if it were so" if kind is Kind.ASSUMPTION else ""
        return [
            Statement(Fact(kind, f"{each}{suffix}"), self.semantics.guard(frozenset({each}))) for each in assignments
        ]

    def executed_now(self, event: str) -> Statement:
        """That the executive executes a pending event now."""
        progress = self._progress
        guard = progress.structure.guards[event]
        theirs = (self.semantics.guard(label) for label in progress.external(event) if progress.compatible(label))
        formula = self._terms.conjunction(
            (
                self.semantics.guard(guard),
                *(self._terms.negation(each) for each in theirs),
                self.semantics.at(event, progress.now),
            )
        )
        text = f"{self.wording.event(event)} at {format_number(progress.now)}, if it were so"
        return Statement(Fact(Kind.ASSUMPTION, text), formula)

    def unreported(self) -> list[Statement]:
        """That what is for others to report comes later than now."""
        progress, found = self._progress, []
        later = Polynomial.constant(progress.now + self._plan.epsilon)
        for event in progress.pending:
            labels = [label for label in progress.external(event) if progress.compatible(label)]
            if labels:
                guard = progress.structure.guards[event]
                difference = self._terms.at_least(self.semantics.time_of(event) - later)
                formula = self._terms.conjunction(self.semantics.unless(guard | each, difference) for each in labels)
                found.append(Statement(Fact(Kind.REPORT, f"{self.wording.event(event)} is not reported yet"), formula))
        return found

    def _conditions(self) -> Iterator[Statement]:
        conditions = self._plan.conditions
        formulas = self.semantics.formulas[len(self.semantics.formulas) - len(conditions) :]
        for condition, formula in zip(conditions, formulas, strict=True):
            yield Statement(Fact(Kind.CONDITION, self.wording.condition(condition)), formula)

    def _durations(self) -> Iterator[Statement]:
        activities = self._plan.network.activities
        for each in activities:
            formula = self._least(each.duration, each.lower)
            yield Statement(Fact(Kind.DURATION, durations([each]), activity=each), formula)
        for each in activities:
            if each.upper is not None:
                formula = self._greatest(each.duration, each.upper)
                yield Statement(Fact(Kind.DURATION, durations([each], upper=True)), formula)

    def _bounds(self) -> Iterator[Statement]:
        for each in self._plan.network.constraints:
            if each.upper is not None:
                fact = Fact(Kind.BOUND, self.wording.bound(each, upper=True), limit=each.upper)
                yield Statement(fact, self._greatest(each, each.upper))
            if each.lower is not None and not 0 <= each.lower <= self._plan.epsilon:
                yield Statement(Fact(Kind.BOUND, self.wording.bound(each, upper=False)), self._least(each, each.lower))

    def _order(self) -> Statement:
        orders = (
            self._least(each, each.lower)
            for each in self._plan.network.constraints
            if each.lower is not None and 0 <= each.lower <= self._plan.epsilon
        )
        return Statement(Fact(Kind.ORDER, "the order of the plan"), self._terms.conjunction(orders))

    def _least(self, constraint: Constraint, bound: Fraction) -> Formula:
        difference = self._difference(constraint) - bound
        return self.semantics.unless(constraint.guard, self._terms.at_least(difference))

    def _greatest(self, constraint: Constraint, bound: Fraction) -> Formula:
        difference = -self._difference(constraint) + bound
        return self.semantics.unless(constraint.guard, self._terms.at_least(difference))

    def _difference(self, constraint: Constraint) -> Polynomial[str]:
        return self.semantics.time_of(constraint.target) - self.semantics.time_of(constraint.source)

    def _choices(self) -> Iterator[Statement]:
        chosen = (Assignment(*item) for item in self._progress.chosen.items())
        yield from self.assignments(Kind.CHOICE, chosen)

    def _time(self) -> Statement:
        """It is enough to say so of all pending events."""
        progress = self._progress
        now, guards = Polynomial.constant(progress.now), progress.structure.guards
        later = (
            self.semantics.unless(guards[event], self._terms.at_least(self.semantics.time_of(event) - now))
            for event in progress.pending
        )
        text = f"it is {format_number(progress.now)} already"
        return Statement(Fact(Kind.TIME, text), self._terms.conjunction(later))

    def _broken(self) -> Iterator[Statement]:
        for effect, condition in sorted(self._progress.void, key=str):
            yield Statement(
                Fact(Kind.LINK, self._broken_text(effect, condition)), self.semantics.void(effect, condition)
            )

    def _broken_text(self, effect: Effect, condition: Condition) -> str:
        by, whom = self.wording.producer(effect), self.wording.consumer(condition)
        return f"{effect.literal} from {by} does not hold any more for {whom}"

    def _events(self) -> Iterator[Statement]:
        guards: dict[str, Guard] = self._progress.structure.guards
        for event, time in self._progress.times.items():
            formula = self._terms.conjunction((self.semantics.guard(guards[event]), self.semantics.at(event, time)))
            yield Statement(Fact(Kind.EVENT, f"{self.wording.event(event)} at {format_number(time)}"), formula)


_PREFERENCE = {
    Kind.ASSUMPTION: 0,
    Kind.INFERENCE: 1,
    Kind.CHOICE: 2,
    Kind.ORDER: 3,
    Kind.DURATION: 4,
    Kind.BOUND: 4,
    Kind.CONDITION: 4,
    Kind.LINK: 5,
    Kind.REPORT: 6,
    Kind.TIME: 7,
    Kind.EVENT: 8,
}


class Situation:
    """An execution as it stands when this is made; later steps of the executive do not change it.

    Raises:
        SolverError: if the solver is unknown or not installed.
    """

    def __init__(
        self,
        progress: Progress,
        *,
        solver: str = "z3",
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
    ) -> None:
        self.progress = snapshot(progress)
        self.statements = Statements(self.progress)
        self.deadline = deadline
        self.solver = solver
        self._happened = self.statements.happened()
        self._of_plan = self.statements.of_plan()
        self._session = Session(self.statements.semantics.terms, solver=solver)
        self._session.add(*self.statements.domains)

    @property
    def wording(self) -> Wording:
        """The words of the plan."""
        return self.statements.wording

    def continuation(self, hypotheses: Iterable[Statement] = ()) -> Execution | None:
        """A correct execution that continues this one under hypotheses; None if there is none.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        with self._session.frame(*_formulas([*self._of_plan, *self._happened, *hypotheses])):
            return None if self._contradictory() else self._model()

    def conflict(self, hypotheses: Sequence[Statement] = ()) -> tuple[Statement, ...] | None:
        """A minimal conflict of hypotheses, what has happened, and the plan; None if there is none.

        Choices are kept rather than what the plan demands, and that rather than times; of a conflict with conditions
        and one with durations, where these would do alike, the smaller is taken.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        every = [*hypotheses, *self._happened, *self._of_plan]
        found: list[list[Statement]] = []
        for late in (Kind.CONDITION, Kind.DURATION):
            ordered = sorted(every, key=lambda each: (_PREFERENCE[each.fact.kind], each.fact.kind is late))
            conflict = self._minimal(ordered)
            if conflict is None:
                return None
            found.append(conflict)
        by_conditions, by_durations = found
        return tuple(by_durations if len(by_durations) < len(by_conditions) else by_conditions)

    def facts(self, hypotheses: Sequence[Statement] = ()) -> tuple[Fact, ...] | None:
        """As few of what has happened as contradict the plan, which is not in question; in the order of time.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        with self._session.frame(*_formulas(self._of_plan)):
            found = self._minimal([*hypotheses, *self._happened])
        return None if found is None else tuple(each.fact for each in reversed(found))

    def latest(self, event: str) -> Fraction | None:
        """Until when the event could be executed, or could have been, after what was executed before it.

        None if it may be any time, or never.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        moment = self.progress.times.get(event, self.progress.now)
        found = replayed(self.progress, event, solver=self.solver).times_of(event, moment, self.deadline)
        return None if found is None else found[1]

    def _minimal(self, statements: Sequence[Statement]) -> list[Statement] | None:
        """QuickXplain [Junker 2004]: earlier statements are kept rather than later ones."""
        with self._session.frame(*_formulas(statements)):
            if not self._contradictory():
                return None
        return self._needed(list(statements), grown=True) if statements else []

    def _needed(self, statements: list[Statement], *, grown: bool) -> list[Statement]:
        """Of statements that contradict what is asserted, as few as do; `grown`: more is asserted than before."""
        if grown and self._contradictory():
            return []
        if len(statements) == 1:
            return statements
        half = len(statements) // 2
        first, second = statements[:half], statements[half:]
        with self._session.frame(*_formulas(first)):
            late = self._needed(second, grown=True)
        with self._session.frame(*_formulas(late)):
            early = self._needed(first, grown=bool(late))
        return [*early, *late]

    def _contradictory(self) -> bool:
        match self._session.check("an explanation", self.deadline):
            case Verdict.UNSATISFIABLE:
                return True
            case Verdict.SATISFIABLE:
                return False
            case Verdict.UNKNOWN:
                raise OutOfTimeError

    def _model(self) -> Execution:
        semantics = self.statements.semantics
        scenario = semantics.chosen(self._session.values(semantics.choices))
        activated = [name for name, guard in self.progress.structure.guards.items() if holds(guard, scenario)]
        values = self._session.values(semantics.times(activated))
        return Execution(scenario, {name: semantics.time(name, values) for name in activated})


def snapshot(progress: Progress) -> Progress:
    """A copy that later steps leave as it is."""
    copied = Progress(progress.plan, progress.now, dict(progress.times), dict(progress.chosen), set(progress.void))
    copied.pending = dict(progress.pending)
    return copied


def replayed(progress: Progress, event: str, *, solver: str = "z3") -> SemanticReasoner:
    """A reasoner for an execution just before an event, while the choices and broken links of now stand."""
    earlier = Progress(progress.plan)
    reasoner = SemanticReasoner(earlier, solver=solver)
    for name, time in progress.times.items():
        if name == event:
            break
        earlier.now = earlier.times[name] = time
        del earlier.pending[name]
        reasoner.executed(name)
    earlier.now = progress.times.get(event, progress.now)
    reasoner.advanced()
    for choice, value in progress.chosen.items():
        earlier.chosen[choice] = value
        reasoner.observed(Assignment(choice, value))
    for effect, condition in progress.void:
        earlier.void.add((effect, condition))
        reasoner.voided(effect, condition)
    guards = earlier.structure.guards
    earlier.pending = {each: None for each in earlier.pending if earlier.compatible(guards[each])}
    return reasoner


def _formulas(statements: Iterable[Statement]) -> list[Formula]:
    return [each.formula for each in statements]


__all__ = ["Fact", "Kind", "conflict"]


def conflict(
    progress: Progress,
    environment: Guard = ALWAYS,
    *,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> tuple[Fact, ...] | None:
    """Why no correct execution continues what has happened in an environment; None if one does.

    No facts at all: the plan never had a correct execution.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """
    situation = Situation(progress, solver=solver, deadline=deadline)
    return situation.facts(situation.statements.assignments(Kind.ASSUMPTION, sorted(environment)))
