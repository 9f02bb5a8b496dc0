"""What contradicts what: the facts of an execution and the demands of its plan, in words and as formulas.

A :class:`Situation` is a moment of an execution; it finds continuations and minimal conflicts. :class:`Wording` names
events, bounds and conditions in the words of the plan's activities.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from itertools import pairwise, takewhile

from robust.network.differences import reachable
from robust.numbers import format_number
from robust.pike_bridge import model
from robust.pike_bridge.knowledge.sat import satisfiable
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import OnlineSemantics, SemanticReasoner
from robust.pike_bridge.semantics import Execution
from robust.qe.eliminate.enumerate import minimal
from robust.smt import limits, session
from robust.smt.session import Session

_MOST = 4
"""The most activities that are named one by one."""


class Wording:
    """Names the events of one plan, and tells its demands."""

    def __init__(self, progress: Progress) -> None:
        self._before = progress.structure.before
        """From each event to those that are earlier whenever it is executed."""
        self._plan = progress.plan
        self._network = progress.plan.network
        self._names = {model.INITIAL: "the initial state", model.GOAL: "the goal"}
        self._name_ends_of_activities()
        self._name_ends_of_plan()
        for choice in self._network.choices:
            if choice.event is not None:
                self._names.setdefault(choice.event, f"the choice of {choice.name}")

    def event(self, name: str) -> str:
        """`start of (get human mug)`; the event's own name if no activity starts or ends there."""
        return self._names.get(name, name)

    def consumer(self, condition: model.Condition) -> str:
        """The action that has a condition, or the goal."""
        return self._plan.actor(condition.activity)

    def producer(self, effect: model.Effect) -> str:
        """The action that has an effect, or the initial state."""
        return self._plan.actor(effect.activity, "the initial state")

    def condition(self, condition: model.Condition) -> str:
        """The action that needs a literal, those that establish it, and those that undo it."""
        producers = self._relevant(condition, model.may_produce, condition.first)
        threats = self._relevant(condition, model.may_threaten, condition.last)
        text = f"{self.consumer(condition)} needs {condition.literal}, which "
        if producers:
            text += f"only {self._causes(producers, condition)}"
        else:
            text += "nothing establishes"
        undoing = list(dict.fromkeys(self.producer(threat) for threat in threats if threat.event != model.INITIAL))
        if producers and undoing:
            text += f"; {listed(undoing)} {'undoes' if len(undoing) == 1 else 'undo'} it"
        return text

    def bound(self, constraint: model.Constraint, bound: Fraction, *, upper: bool) -> str:
        """One bound of a constraint, told as a distance from the earlier event to the later."""
        source, target = self.event(constraint.source), self.event(constraint.target)
        if bound < 0:
            source, target, bound, upper = target, source, -bound, not upper
        if not upper and bound == 0:
            text = f"{target} is not before {source}"
        else:
            text = f"at {'most' if upper else 'least'} {format_number(bound)} from {source} to {target}"
        return f"{text} ({model.guard_text(constraint.guard)})" if constraint.guard else text

    def sequence(self, activities: Sequence[model.Activity]) -> list[model.Activity] | None:
        """The order of activities, if the plan demands that they be one after the other whenever all are done."""
        union: model.Guard = frozenset().union(*(activity.guard for activity in activities))
        if len(dict(union)) < len(union):
            return None
        graph = self._order(lambda constraint: constraint.guard <= union)
        later = {activity: reachable(graph, activity.target) for activity in activities}
        ordered = sorted(activities, key=lambda activity: len(later[activity]), reverse=True)
        return ordered if all(other.source in later[one] for one, other in pairwise(ordered)) else None

    def _relevant(
        self, condition: model.Condition, matters: Callable[[model.Effect, model.Condition], bool], until: str
    ) -> list[model.Effect]:
        """Effects that matter to a condition, where the plan does not put them after an event."""
        return [
            effect
            for effect in self._plan.effects
            if matters(effect, condition)
            and not model.contradicts(effect.guard, condition.guard)
            and not self._after(effect.event, until)
        ]

    def _order(self, counts: Callable[[model.Constraint], bool] = lambda _: True) -> dict[str, set[str]]:
        """The events that the constraints that count put after each event, or at the same time."""
        graph: dict[str, set[str]] = {event.name: set() for event in self._network.events}
        for constraint in self._network.temporal_constraints:
            if constraint.lower is not None and constraint.lower >= 0 and counts(constraint):
                graph[constraint.source].add(constraint.target)
        return graph

    def _causes(self, producers: Iterable[model.Effect], condition: model.Condition) -> str:
        """`(p1) establishes, if x = 1`; `(p1) if x = 1 and (p2) establish`."""
        causes = list(dict.fromkeys((self.producer(each), each.guard - condition.guard) for each in producers))
        if len(causes) == 1:
            who, label = causes[0]
            return f"{who} establishes" + (f", if {model.guard_text(label)}" if label else "")
        return (
            listed([who + (f" if {model.guard_text(label)}" if label else "") for who, label in causes]) + " establish"
        )

    def _after(self, event: str, other: str) -> bool:
        """Whether the plan puts an event later than another, whenever it has it."""
        return event != other and other in reachable(self._before, event)

    def _name_ends_of_activities(self) -> None:
        ends: dict[str, list[str]] = {}
        for activity in self._network.activities:
            ends.setdefault(activity.source, []).append(f"start of {activity.action}")
            ends.setdefault(activity.target, []).append(f"end of {activity.action}")
        for event, names in ends.items():
            self._names.setdefault(event, " and ".join(dict.fromkeys(names[:2])))

    def _name_ends_of_plan(self) -> None:
        """An event that is before all others, or after them, but for the initial state and the goal."""
        graph = self._order()
        inner = set(graph) - {model.INITIAL, model.GOAL}
        following = {event: set().union(*(reachable(graph, each) for each in graph[event])) for event in graph}
        if len(inner) < 2 or any(event in following[event] for event in graph):
            return
        for event in inner:
            before, after = {each for each in graph if event in following[each]}, following[event]
            if before <= {model.INITIAL} and after >= inner - {event}:
                self._names.setdefault(event, f"the beginning ({event})")
            if after <= {model.GOAL} and before >= inner - {event}:
                self._names.setdefault(event, f"the end ({event})")


def durations(activities: Iterable[model.Activity], *, upper: bool = False) -> str:
    """`(get human mug) takes at least 0.5, (pour-coffee human) 0.2`."""

    verb = f"takes at {'most' if upper else 'least'} "
    bounds = [
        (activity.action, (activity.upper if upper else activity.lower) or Fraction(0)) for activity in activities
    ]
    return ", ".join(
        f"{action} {'' if at else verb}{format_number(bound)}" for at, (action, bound) in enumerate(bounds)
    )


def listed(names: Sequence[str]) -> str:
    """`a, b and c`; of many only the first few."""
    if len(names) > _MOST:
        names = [*names[: _MOST - 1], f"{len(names) - _MOST + 1} more"]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


class About(Enum):
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


OF_PLAN = frozenset({About.CONDITION, About.DURATION, About.BOUND, About.ORDER})
"""What the plan demands."""
_KEPT = (
    {About.ASSUMPTION},
    {About.INFERENCE},
    {About.CHOICE},
    {About.ORDER},
    OF_PLAN - {About.ORDER},
    {About.LINK},
    {About.REPORT},
    {About.TIME},
    {About.EVENT},
)
"""Which kinds conflicts are made of rather than of the ones after them."""
_PREFERENCE = {kind: place for place, kinds in enumerate(_KEPT) for kind in kinds}


@dataclass(frozen=True, slots=True)
class Fact:
    """Something that has happened, is assumed, or is demanded by the plan: in words, and as a formula."""

    kind: About
    text: str
    formula: session.Formula = field(compare=False, repr=False)
    activity: model.Activity | None = field(default=None, compare=False)
    """Of a least duration: whose it is."""
    limit: Fraction | None = field(default=None, compare=False)
    """Of an upper bound of the plan that is not a duration: how much."""
    choice: str | None = field(default=None, compare=False)
    """Of a choice that has a value: its name."""

    def as_dict(self) -> dict[str, str]:
        """The explanation as in `robust/pike-run/1`."""
        return {"about": self.kind.value, "fact": self.text}


class Situation:
    """An execution as it stands when this is made; later steps of the executive do not change it.

    What has happened and what the plan demands are formal facts, one for each thing that can be named in an answer;
    their formulas are over `semantics.terms`. That each choice has one value is never in question.

    Raises:
        SolverError: if the solver is unknown or not installed.
    """

    def __init__(self, progress: Progress, *, solver: str = "z3", deadline: limits.Deadline = limits.NEVER) -> None:
        self.progress = progress.copy()
        self.semantics = OnlineSemantics(self.progress)
        self.wording = Wording(self.progress)
        self.deadline = deadline
        self.solver = solver
        self._plan = progress.plan
        self._terms = self.semantics.terms
        self._happened = [
            *reversed(self.assignments(About.CHOICE, (model.Assignment(*each) for each in progress.chosen.items()))),
            self._time(),
            *self._broken(),
            *reversed(list(self._events())),
        ]
        """The latest first."""
        self._of_plan = [*self._conditions(), *self._durations(), *self._bounds(), self._order()]
        self._session = Session(self._terms, solver=solver)
        self._session.add(*self.semantics.domains)

    # -- hypotheses --------------------------------------------------------------------------------------------------

    def assignments(self, kind: About, assignments: Iterable[model.Assignment]) -> list[Fact]:
        """The statement that choices are so."""
        suffix = ", if it were so" if kind is About.ASSUMPTION else ""
        return [
            Fact(kind, f"{assignment}{suffix}", self.semantics.guard([assignment]), choice=assignment.variable)
            for assignment in assignments
        ]

    def executed_now(self, event: str) -> Fact:
        """The statement that the executive executes a pending event now."""
        now = self.progress.now
        formula = self._terms.conjunction((self.semantics.ours(event), self.semantics.at(event, now)))
        text = f"{self.wording.event(event)} at {format_number(now)}, if it were so"
        return Fact(About.ASSUMPTION, text, formula)

    def unreported(self) -> list[Fact]:
        """The statement that what is for others to report comes later than now."""
        later = self.progress.now + self._plan.separation
        return [
            Fact(About.REPORT, f"{self.wording.event(event)} is not reported yet", self._terms.conjunction(formulas))
            for event in self.progress.pending
            if (formulas := self.semantics.not_ours_before(event, later))
        ]

    # -- questions ---------------------------------------------------------------------------------------------------

    def continued(self, hypotheses: Iterable[Fact] = ()) -> Execution | None:
        """A correct execution that continues this one under hypotheses; None if there is none.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        with self._given([*self._of_plan, *self._happened, *hypotheses]):
            return None if self._contradictory() else self.semantics.continuation(self._session)

    def conflict(self, hypotheses: Sequence[Fact] = ()) -> tuple[Fact, ...] | None:
        """A minimal conflict of hypotheses, what has happened, and the plan; None if there is none.

        Choices are kept rather than what the plan demands, and that rather than times; of a conflict with conditions
        and one with durations, where these would do alike, the smaller is taken.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        every = [*hypotheses, *self._happened, *self._of_plan]
        conflicts: list[list[Fact]] = []
        for late in (About.CONDITION, About.DURATION):
            ordered = sorted(every, key=lambda each: (_PREFERENCE[each.kind], each.kind is late))
            conflict = self._minimal(ordered)
            if conflict is None:
                return None
            conflicts.append(conflict)
        by_conditions, by_durations = conflicts
        return tuple(by_durations if len(by_durations) < len(by_conditions) else by_conditions)

    def facts(self, hypotheses: Sequence[Fact] = ()) -> tuple[Fact, ...] | None:
        """The fewest facts that contradict the plan, which is not in question; in the order of time.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        with self._given(self._of_plan):
            conflict_facts = self._minimal([*hypotheses, *self._happened])
        return None if conflict_facts is None else tuple(reversed(conflict_facts))

    def latest(self, event: str) -> Fraction | None:
        """Until when the event could be executed, or could have been, after what was executed before it.

        None if it may be any time, or never.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        progress = self.progress
        moment = progress.times.get(event, progress.now)
        before = dict(takewhile(lambda each: each[0] != event, progress.times.items()))
        reasoner = SemanticReasoner(progress.rewound(moment, before, progress.chosen), solver=self.solver)
        span = reasoner.times_of(event, moment, self.deadline)
        return None if span is None else span[1]

    def _minimal(self, facts: Sequence[Fact]) -> list[Fact] | None:
        """A minimal set of contradictory facts, earlier ones rather than later ones; None if they are none."""

        def enough(part: Iterable[Fact]) -> bool:
            with self._given(part):
                return self._contradictory()

        return list(minimal(tuple(reversed(facts)), enough))[::-1] if enough(facts) else None

    def _given(self, facts: Iterable[Fact]) -> AbstractContextManager[None]:
        return self._session.frame(*(fact.formula for fact in facts))

    def _contradictory(self) -> bool:
        return not satisfiable(self._session, "an explanation", self.deadline)

    # -- what the plan demands ---------------------------------------------------------------------------------------

    def _conditions(self) -> Iterator[Fact]:
        for condition, formula in zip(self._plan.conditions, self.semantics.conditions, strict=True):
            yield Fact(About.CONDITION, self.wording.condition(condition), formula)

    def _durations(self) -> Iterator[Fact]:
        activities = self._plan.network.activities
        for each in activities:
            least = self._apart(each.duration, each.lower, least=True)
            yield Fact(About.DURATION, durations([each]), least, activity=each)
        for each in activities:
            if each.upper is not None:
                most = self._apart(each.duration, each.upper, least=False)
                yield Fact(About.DURATION, durations([each], upper=True), most)

    def _bounds(self) -> Iterator[Fact]:
        for constraint in self._plan.network.constraints:
            if constraint.upper is not None:
                text = self.wording.bound(constraint, constraint.upper, upper=True)
                yield Fact(
                    About.BOUND, text, self._apart(constraint, constraint.upper, least=False), limit=constraint.upper
                )
            if constraint.lower is not None and not self._merely_orders(constraint.lower):
                text = self.wording.bound(constraint, constraint.lower, upper=False)
                yield Fact(About.BOUND, text, self._apart(constraint, constraint.lower, least=True))

    def _order(self) -> Fact:
        """All mere orders of events as one fact."""
        orders = (
            self._apart(constraint, constraint.lower, least=True)
            for constraint in self._plan.network.constraints
            if constraint.lower is not None and self._merely_orders(constraint.lower)
        )
        return Fact(About.ORDER, "the order of the plan", self._terms.conjunction(orders))

    def _merely_orders(self, lower: Fraction) -> bool:
        return 0 <= lower <= self._plan.separation

    def _apart(self, constraint: model.Constraint, bound: Fraction, *, least: bool) -> session.Formula:
        """The statement that the events are at least, or at most, so far apart."""
        semantics = self.semantics
        difference = semantics.difference(constraint.source, constraint.target) - bound
        return semantics.unless(constraint.guard, self._terms.at_least(difference if least else -difference))

    # -- what has happened -------------------------------------------------------------------------------------------

    def _time(self) -> Fact:
        """It is enough to say so of all pending events."""
        now = self.progress.now
        later = (self.semantics.not_earlier(event, now) for event in self.progress.pending)
        return Fact(About.TIME, f"it is {format_number(now)} already", self._terms.conjunction(later))

    def _broken(self) -> Iterator[Fact]:
        for effect, condition in sorted(self.progress.void, key=str):
            by, whom = self.wording.producer(effect), self.wording.consumer(condition)
            text = f"{effect.literal} from {by} does not hold any more for {whom}"
            yield Fact(About.LINK, text, self.semantics.void(effect, condition))

    def _events(self) -> Iterator[Fact]:
        guards = self.progress.structure.guards
        for event, time in self.progress.times.items():
            formula = self._terms.conjunction((self.semantics.guard(guards[event]), self.semantics.at(event, time)))
            yield Fact(About.EVENT, f"{self.wording.event(event)} at {format_number(time)}", formula)


def conflict(
    progress: Progress,
    environment: model.Guard = model.ALWAYS,
    *,
    solver: str = "z3",
    deadline: limits.Deadline = limits.NEVER,
) -> tuple[Fact, ...] | None:
    """Why no correct execution continues what has happened in an environment; None if one does.

    No facts at all: the plan never had a correct execution.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """
    situation = Situation(progress, solver=solver, deadline=deadline)
    return situation.facts(situation.assignments(About.ASSUMPTION, sorted(environment)))
