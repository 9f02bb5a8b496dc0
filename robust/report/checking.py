"""`robust check`: from options to a verdict on the terminal."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from robust.irr.box import Box, Interval
from robust.irr.check import Answer, CheckResult
from robust.plan.model import ParametrizedPlan
from robust.report import options
from robust.report.answers import check_answer
from robust.report.guard import Cause, GivenUpError, Guard
from robust.report.output import answering, print_json
from robust.report.progress import Display
from robust.report.terminal import console, print_check

_CODES = {Answer.PROVED: 0, Answer.REFUTED: 1, Answer.UNKNOWN: 3}


@dataclass(frozen=True)
class CheckRequest:
    """The options as they were typed."""

    files: tuple[Path, Path, Path]
    at: tuple[str, ...] = ()
    every: bool = False
    specs: tuple[str, ...] = ()
    parameter_file: Path | None = None
    epsilon: str = "1/1000"
    encoding: str = "relational"
    solver: str = "z3"
    timeout: str | None = None
    smt2: Path | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


@dataclass
class _Run:
    """One run: the checked options, and the box once it is known."""

    request: CheckRequest
    guard: Guard
    display: Display
    epsilon: Fraction
    limit: float | None
    box: Box | None = None

    def check(self) -> CheckResult:
        from robust.api import check  # noqa: PLC0415 - imports solvers, which Ctrl-C is to be able to end
        from robust.plan.load import load_plan  # noqa: PLC0415 - imports the grammar

        request = self.request
        plan = load_plan(*request.files, parameters=request.specs, parameter_file=request.parameter_file)
        at = options.settings(request.at, [parameter.name for parameter in plan.parameters])
        self.box = _box(plan, at)
        self.display.say("encoding")
        return check(
            plan,
            at=at,
            every=request.every,
            epsilon=self.epsilon,
            encoding=request.encoding,
            solver=request.solver,
            timeout=self.guard.remaining(self.limit),
            smt2=request.smt2,
            on_obligation=self.display.obligation,
        )

    def nothing(self) -> CheckResult | None:
        """Given up before the check returned; None if the plan was not even read."""
        if self.box is None:
            return None
        return CheckResult(Answer.UNKNOWN, self.box, {}, {}, self.guard.age, interrupted=True)

    def print(self, result: CheckResult) -> None:
        request, timed_out = self.request, _timed_out(result, self.guard, self.limit)
        if request.json:
            print_json(
                check_answer(result, request.encoding, solver=request.solver, epsilon=self.epsilon, timed_out=timed_out)
            )
            return
        with answering():
            print_check(console(), result, every=request.every, quiet=request.quiet, timed_out=timed_out)


def run_check(request: CheckRequest, guard: Guard) -> int:
    """Check and print.

    Raises:
        RobustError: wrong input, or input that is not supported.
        GivenUpError: if interrupted while files were being read.
    """
    with Display(shown=request.progress, what="reading") as display:
        run = _Run(
            request,
            guard,
            display,
            epsilon=options.not_negative(request.epsilon, "--epsilon"),
            limit=options.seconds(request.timeout, "--timeout"),
        )
        result = _check(run)
    run.print(result)
    return _CODES[result.answer]


def _check(run: _Run) -> CheckResult:
    def on_stuck() -> bool:
        run.display.stop()
        known = run.nothing()
        if known is not None:
            run.print(known)
        return known is not None

    try:
        with run.guard.working(run.limit, on_stuck):
            return run.check()
    except KeyboardInterrupt:
        known = run.nothing()
        if known is None:
            raise GivenUpError from None
        return known


def _box(plan: ParametrizedPlan, at: dict[str, Fraction | Interval]) -> Box:
    box = Box.nominal(plan.parameters)
    for name, value in at.items():
        box = box.replace(name, value if isinstance(value, Interval) else Interval(value, value))
    return box


def _timed_out(result: CheckResult, guard: Guard, limit: float | None) -> bool:
    if guard.cause is not None:
        return guard.cause is Cause.TIMEOUT
    return result.answer is Answer.UNKNOWN and not result.interrupted and limit is not None
