"""A single intent, and an adaptation to it: which candidate subplan Kirk executes [PIKE §6.2.1].

"An intent is inferred by guessing any intent scenario such that there exists a corresponding adaptation scenario where
the candidate subplan admits a correct execution." Which one is left open there. Here values are tried in the order of
the plan, or in another one; first those of uncontrollable choices, one choice after the other, then the rest.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Set
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
