"""Why no correct execution is left: as few facts as contradict each other, of all that have happened.

Each fact is put to the semantics by itself. A conflict is minimal: without any one of its facts, some correct execution
would be left.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

from robust.pike_bridge.model import ALWAYS, Assignment, Guard
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import OnlineSemantics
from robust.plan.numerals import format_number
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula


class Kind(Enum):
    """What a fact is about."""

    EVENT = "event"
    LINK = "link"
    CHOICE = "choice"
    TIME = "time"
    ASSUMPTION = "assumption"


@dataclass(frozen=True, slots=True)
class Fact:
    """Something that has happened, or is assumed, in words."""

    kind: Kind
    text: str


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
    semantics = OnlineSemantics(progress)
    session = Session(semantics.terms, solver=solver)
    session.add(*semantics.formulas)
    facts = list(_facts(progress, environment, semantics))
    if not _contradict(session, [formula for _, formula in facts], deadline):
        return None
    kept = facts
    # What is tried first is left out first, if either of two facts would do: events before choices.
    for fact in facts:
        fewer = [each for each in kept if each is not fact]
        if _contradict(session, [formula for _, formula in fewer], deadline):
            kept = fewer
    return tuple(fact for fact, _ in kept)


def _facts(progress: Progress, environment: Guard, semantics: OnlineSemantics) -> Iterator[tuple[Fact, Formula]]:
    terms, guards = semantics.terms, progress.structure.guards
    for event, time in progress.times.items():
        happened = terms.conjunction((semantics.guard(guards[event]), semantics.at(event, time)))
        yield Fact(Kind.EVENT, f"{event} at {format_number(time)}"), happened
    for effect, condition in sorted(progress.void, key=str):
        place = (
            "the goal" if condition.activity is None else progress.plan.network.activities[condition.activity].action
        )
        text = f"{effect.literal}, established at {effect.event} for {place}, does not hold any more"
        yield Fact(Kind.LINK, text), semantics.void(effect, condition)
    now = Polynomial.constant(progress.now)
    later = (
        semantics.unless(guards[event], terms.at_least(semantics.time_of(event) - now)) for event in progress.pending
    )
    yield Fact(Kind.TIME, f"it is {format_number(progress.now)} already"), terms.conjunction(later)
    for choice, value in progress.chosen.items():
        assignment = Assignment(choice, value)
        yield Fact(Kind.CHOICE, str(assignment)), semantics.guard(frozenset({assignment}))
    for assignment in sorted(environment):
        yield Fact(Kind.ASSUMPTION, f"{assignment}, if it were so"), semantics.guard(frozenset({assignment}))


def _contradict(session: Session, facts: list[Formula], deadline: Deadline) -> bool:
    with session.frame(*facts):
        match session.check("a conflict", deadline):
            case Verdict.UNSATISFIABLE:
                return True
            case Verdict.SATISFIABLE:
                return False
            case Verdict.UNKNOWN:
                raise OutOfTimeError
