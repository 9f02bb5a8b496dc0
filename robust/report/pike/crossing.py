"""`robust pike check --cross`: all back ends and the oracle against each other, on one plan."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.errors import InputError
from robust.report import options
from robust.report.guard import Cause, Guard
from robust.report.numbers import plural
from robust.report.output import answering, print_json
from robust.report.pike.requests import guarded
from robust.report.progress import Display
from robust.report.terminal import console
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from rich.console import Console

    from robust.pike_bridge.cross_check import CrossCheck
    from robust.pike_bridge.model import TeamPlan

SCHEMA = "robust/pike-cross/1"
BACKENDS = ("bdd", "pitms", "atms", "sat")
SUBJECT_LIMIT = 60.0
"""Seconds for each back end, unless the whole has fewer."""
SHRINK_LIMIT = 120.0


@dataclass(frozen=True)
class PikeCrossRequest:
    """The options as they were typed."""

    file: Path
    witness: Path | None = None
    """Directory for a plan on which they differ."""
    seed: int = 0
    solver: str = "z3"
    epsilon: str = "1/1000"
    timeout: str | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


@dataclass
class Crossed:
    """The outcome; `outcome` is None if not even the oracle has finished."""

    outcome: CrossCheck | None = None
    status: str = "complete"
    written: Path | None = None
    stages: list[str] = field(default_factory=list)


@dataclass
class _Run:
    request: PikeCrossRequest
    guard: Guard
    display: Display
    epsilon: Fraction
    limit: float | None
    crossed: Crossed = field(default_factory=Crossed)

    def cross(self) -> Crossed:
        from robust.pike_bridge.action_model import load_team_plan  # noqa: PLC0415 - imports the grammar
        from robust.pike_bridge.cross_check import cross_check, subjects  # noqa: PLC0415 - imports solvers

        request = self.request
        plan = load_team_plan(request.file, epsilon=self.epsilon)
        try:
            outcome = self.crossed.outcome = cross_check(
                plan,
                tuple(subjects(BACKENDS)),
                solver=request.solver,
                seed=request.seed,
                deadline=Deadline.after(self.guard.remaining(self.limit)),
                limit=SUBJECT_LIMIT,
                on_subject=self.display.say,
            )
        except OutOfTimeError:
            self.crossed.status = "timeout"
            return self.crossed
        if outcome.out_of_time:
            self.crossed.status = "timeout"
        if not outcome.agree and request.witness is not None:
            self.display.say("shrinking")
            self.crossed.written = self._shrunk(plan, outcome)
        return self.crossed

    def _shrunk(self, plan: TeamPlan, outcome: CrossCheck) -> Path:
        """The smallest plan found on which the first subject still differs from the oracle, as files."""
        from robust.pike_bridge.cross_check import (  # noqa: PLC0415
            differing,
            shrink,
            subjects,
        )
        from robust.pike_bridge.theory import propositional  # noqa: PLC0415

        request = self.request
        [subject] = [one for one in subjects(BACKENDS) if one.name == outcome.disagreements[0].backend]

        def shows(smaller: TeamPlan) -> bool:
            return differing(smaller, subject, solver=request.solver, seed=request.seed, limit=10)

        smallest = shrink(plan, shows, Deadline.after(SHRINK_LIMIT))
        if request.witness is None:
            raise ValueError("only with a directory to write to")
        return propositional(smallest).write(request.witness)

    def known(self) -> Crossed | None:
        if self.crossed.outcome is None:
            return None
        self.crossed.status = "timeout" if self.guard.cause is Cause.TIMEOUT else "interrupted"
        return self.crossed

    def show(self, crossed: Crossed) -> None:
        if self.request.json:
            print_json(cross_answer(crossed))
            return
        with answering():
            _print(console(), crossed, quiet=self.request.quiet)


def run_pike_cross(request: PikeCrossRequest, guard: Guard) -> int:
    """Cross-check and print.

    Raises:
        RobustError: wrong input, or input that is not supported.
        GivenUpError: if interrupted before the oracle has finished.
    """
    if request.witness is not None and request.witness.exists() and not request.witness.is_dir():
        raise InputError(f"--witness: found file {str(request.witness)!r}, expected a directory")
    with Display(shown=request.progress, what="reading") as display:
        run = _Run(
            request,
            guard,
            display,
            epsilon=options.positive(request.epsilon, "--epsilon"),
            limit=options.seconds(request.timeout, "--timeout"),
        )
        crossed = guarded(guard, run.limit, display, run.cross, run.known, run.show)
    run.show(crossed)
    if crossed.outcome is not None and not crossed.outcome.agree:
        return 1
    return 0 if crossed.status == "complete" else 3


def cross_answer(crossed: Crossed) -> dict[str, Any]:
    """`robust/pike-cross/1`."""
    outcome = crossed.outcome
    return {
        "schema": SCHEMA,
        "status": crossed.status,
        "agree": None if outcome is None else outcome.agree,
        "scenarios": None if outcome is None else outcome.scenarios,
        "questions": {} if outcome is None else outcome.questions,
        "out_of_time": [] if outcome is None else outcome.out_of_time,
        "disagreements": []
        if outcome is None
        else [
            {"backend": one.backend, "question": one.question, "expected": one.expected, "found": one.found}
            for one in outcome.disagreements
        ],
        "witness": None if crossed.written is None else str(crossed.written),
    }


def _print(out: Console, crossed: Crossed, *, quiet: bool) -> None:
    outcome = crossed.outcome
    if outcome is None:
        out.print("Undecided: out of time before the oracle had found every scenario.")
        return
    asked = sum(outcome.questions.values())
    if outcome.agree:
        out.print(f"All agree: {plural(outcome.scenarios, 'team scenario')}, {plural(asked, 'question')}.")
    else:
        out.print(f"{plural(len(outcome.disagreements), 'disagreement')} with the oracle:")
        for one in outcome.disagreements:
            out.print(f"  {one}")
    if not quiet:
        for name, count in outcome.questions.items():
            late = "; out of time" if name in outcome.out_of_time else ""
            out.print(f"  {name}: {plural(count, 'question')}{late}")
    if crossed.written is not None:
        out.print(f"The smallest plan found that shows it: {crossed.written}")
