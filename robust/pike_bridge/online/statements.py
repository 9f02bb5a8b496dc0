"""What a plan demands and what has happened, one statement at a time, each as words and as a formula.

Together the statements of a plan are its semantics; those of an execution are the partial execution so far. So any of
them can be left out of a question, to find out which ones an answer rests on.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction

from robust.pike_bridge.model import Activity, Assignment, Condition, Constraint, Effect, Guard
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import OnlineSemantics
from robust.pike_bridge.online.wording import Wording, durations
from robust.plan.numerals import format_number
from robust.plan.polynomial import Polynomial
from robust.smt.terms import Formula


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
