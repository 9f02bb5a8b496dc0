"""The moment at which an explanation is asked for: what is possible then, and minimal conflicts of what is not.

A conflict is minimal: without any one of its facts, be it of the plan or of what has happened, the others could be met.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

from robust.pike_bridge.execution import Execution, holds
from robust.pike_bridge.model import Assignment
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.statements import Fact, Kind, Statement, Statements
from robust.pike_bridge.online.wording import Wording
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula

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
