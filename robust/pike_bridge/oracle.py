"""The semantic oracle of team plans: one formula over choices and event times that says what a correct execution is.

It states [PIKE, Definitions 2.5 to 2.8] outright, and shares nothing with causal links, labeled shortest paths and
knowledge bases, so that each can be held against the other. What it finds, the referee in
:mod:`robust.pike_bridge.execution` confirms.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from itertools import product
from types import MappingProxyType
from typing import TypeAlias, assert_never

from robust.errors import InputError, SolverError
from robust.pike_bridge.execution import Execution, faults, holds
from robust.pike_bridge.knowledge.interface import Commitment, Exclude, Require
from robust.pike_bridge.model import Guard, TeamPlan, guard
from robust.pike_bridge.semantics import Semantics
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.statistics import Statistics
from robust.smt.terms import Formula

Assumption: TypeAlias = Guard | Sequence[Commitment]
"""An environment, or what execution has committed to."""

NO_TIMES: Mapping[str, Fraction] = MappingProxyType({})


class Existence(Enum):
    """Whether a correct execution exists; UNKNOWN if the time was not enough."""

    EXISTS = "exists"
    NONE = "none"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Answer:
    """A verdict; if it is EXISTS, with a correct execution as witness."""

    verdict: Existence
    witness: Execution | None = None


class Oracle:
    """One incremental solver session for questions about the correct executions of a plan.

    Raises:
        SolverError: if the solver is unknown or not installed.
        InputError: if a guard, a constraint, a condition or an effect mentions an unknown choice, value or event.
    """

    def __init__(self, plan: TeamPlan, *, solver: str = "z3", statistics: Statistics | None = None) -> None:
        self.plan = plan
        self.statistics = statistics or Statistics()
        self._solver = solver
        self._semantics = Semantics(plan)
        self._session = self._start()

    def decide(
        self,
        assume: Assumption = frozenset(),
        schedule: Mapping[str, Fraction] = NO_TIMES,
        *,
        now: Fraction | None = None,
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
    ) -> Answer:
        """Whether the partial execution is correct [PIKE, Definition 2.8]: whether a correct execution extends it.

        The events of `schedule` are executed at their times, and therefore activated. Any other activated event may
        have any time or, with `now`, any time from then on.

        Raises:
            InputError: if an assumption or the schedule mentions an unknown choice, value or event.
            SolverError: if the witness is not correct: the solver or this package has a fault.
        """
        with self._session.frame(*self._assumptions(assume), *self._executed(schedule, now)):
            verdict = self._session.check("correct execution", deadline)
            match verdict:
                case Verdict.SATISFIABLE:
                    return Answer(Existence.EXISTS, self._witness(self._session, movable=not schedule and now is None))
                case Verdict.UNSATISFIABLE:
                    return Answer(Existence.NONE)
                case Verdict.UNKNOWN:
                    return Answer(Existence.UNKNOWN)
                case _:
                    assert_never(verdict)

    def could_commit(
        self,
        commitments: Sequence[Commitment],
        schedule: Mapping[str, Fraction] = NO_TIMES,
        *,
        now: Fraction | None = None,
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
    ) -> bool:
        """As :meth:`decide`, in the manner of knowledge bases.

        Raises:
            OutOfTimeError: if the deadline passes.
            InputError: as :meth:`decide`.
            SolverError: as :meth:`decide`.
        """
        answer = self.decide(commitments, schedule, now=now, deadline=deadline)
        if answer.verdict is Existence.UNKNOWN:
            raise OutOfTimeError
        return answer.verdict is Existence.EXISTS

    def scenarios(
        self,
        assume: Assumption = frozenset(),
        *,
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
    ) -> Iterator[Execution]:
        """Each team scenario that admits a correct execution, once, with such an execution, as they are found.

        Choices that a scenario never comes to have a value in it, too [PIKE, Definition 2.2].

        Raises:
            OutOfTimeError: if the deadline passes before all are found.
            InputError: as :meth:`decide`.
            SolverError: as :meth:`decide`.
        """
        session = self._start()
        session.add(*self._assumptions(assume))
        mentioned = _by_choice((*_guards(self.plan), *_environments(assume)))
        seen: list[Guard] = []
        while True:
            match session.check("another scenario", deadline):
                case Verdict.UNKNOWN:
                    raise OutOfTimeError
                case Verdict.UNSATISFIABLE:
                    return
                case Verdict.SATISFIABLE:
                    witness = self._witness(session, movable=True)
                    alike = self._alike(witness.scenario, mentioned)
                    for scenario in self._extensions(alike):
                        if not any(holds(earlier, scenario) for earlier in seen):
                            deadline.enforce()
                            yield self._confirmed(Execution(scenario, witness.schedule))
                    seen.append(alike)
                    session.add(self._semantics.terms.negation(self._semantics.guard(alike)))

    def _alike(self, scenario: Mapping[str, str], mentioned: Mapping[str, set[Guard]]) -> Guard:
        """An environment of the scenario throughout which every guard in question has the same truth.

        Left out are choices that only such guards mention as are false for another reason.
        """
        kept = dict(scenario)
        for name in scenario:
            others = ([each for each in label if each.variable != name] for label in mentioned.get(name, ()))
            if all(any(kept.get(variable, value) != value for variable, value in rest) for rest in others):
                del kept[name]
        return guard(kept)

    def _extensions(self, environment: Guard) -> Iterator[dict[str, str]]:
        chosen = dict(environment)
        choices = self.plan.network.choices
        for values in product(*((chosen[each.name],) if each.name in chosen else each.domain for each in choices)):
            yield {choice.name: value for choice, value in zip(choices, values, strict=True)}

    def _start(self) -> Session:
        session = Session(self._semantics.terms, solver=self._solver, statistics=self.statistics)
        session.add(*self._semantics.formulas)
        return session

    def _assumptions(self, assume: Assumption) -> Iterator[Formula]:
        if isinstance(assume, frozenset):
            yield self._semantics.guard(assume)
            return
        for commitment in assume:
            match commitment:
                case Require(environment):
                    yield self._semantics.guard(environment)
                case Exclude(environment):
                    yield self._semantics.terms.negation(self._semantics.guard(environment))
                case _:
                    assert_never(commitment)

    def _executed(self, schedule: Mapping[str, Fraction], now: Fraction | None) -> Iterable[Formula]:
        guards = self.plan.network.guards
        for name in schedule:
            if name not in guards:
                raise InputError(f"the schedule gives a time to {name}; expected an event of the plan")
        for name, time in schedule.items():
            yield self._semantics.guard(guards[name])
            yield self._semantics.at(name, time)
        if now is not None:
            for name, label in guards.items():
                if name not in schedule:
                    yield self._semantics.unless(label, self._semantics.not_before(name, now))

    def _witness(self, session: Session, *, movable: bool) -> Execution:
        """The execution of the last model, confirmed; if nothing fixes its times, it starts at zero."""
        scenario = self._semantics.chosen(session.values(self._semantics.choices))
        activated = [event.name for event in self.plan.network.events if holds(event.guard, scenario)]
        values = session.values(self._semantics.times(activated))
        times = {name: self._semantics.time(name, values) for name in activated}
        start = min(times.values(), default=Fraction(0)) if movable else Fraction(0)
        return self._confirmed(Execution(scenario, {name: time - start for name, time in times.items()}))

    def _confirmed(self, execution: Execution) -> Execution:
        found = faults(self.plan, execution)
        if found:
            raise SolverError(f"{self._solver} gave an execution that is not correct: {found[0]}; please report this")
        return execution


def _guards(plan: TeamPlan) -> set[Guard]:
    """Every guard that makes a difference to what a scenario activates."""
    network = plan.network
    found = {each.guard for each in network.events} | {each.guard for each in network.temporal_constraints}
    return found | {each.guard for each in plan.conditions} | {each.guard for each in plan.effects}


def _environments(assume: Assumption) -> Iterator[Guard]:
    if isinstance(assume, frozenset):
        yield assume
    else:
        yield from (commitment.environment for commitment in assume)


def _by_choice(guards: Iterable[Guard]) -> dict[str, set[Guard]]:
    """The guards that mention each choice."""
    found: dict[str, set[Guard]] = {}
    for label in guards:
        for variable, _ in label:
            found.setdefault(variable, set()).add(label)
    return found
