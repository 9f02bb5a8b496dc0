"""A single intent, and an adaptation to it: which candidate subplan Kirk executes [PIKE §6.2.1].

"An intent is inferred by guessing any intent scenario such that there exists a corresponding adaptation scenario where
the candidate subplan admits a correct execution." Which one is left open there. Here values are tried in the order of
the plan, or in another one; first those of uncontrollable choices, one choice after the other, then the rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from contextlib import ExitStack
from dataclasses import dataclass, field
from fractions import Fraction

from robust.pike_bridge.model import Assignment, Choice, Condition, Effect, Guard, TeamPlan
from robust.pike_bridge.online.executive import Ranking, as_written
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import OnlineSemantics
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula

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
        self._semantics = OnlineSemantics(Progress(plan))
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
        known = dict(facts.known)
        for event, label in self._guards.items():
            if event in facts.times:
                yield self._semantics.guard(label)
                yield self._semantics.at(event, facts.times[event])
            elif all(known.get(each.variable, each.value) == each.value for each in label):
                earliest = facts.now if event in facts.running else facts.release
                yield self._semantics.unless(label, self._semantics.not_before(event, earliest))
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
