"""`robust pike check`: does a plan with choices admit a correct execution, and in which team scenarios?"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.numbers import format_number
from robust.report import options
from robust.report.guard import Cause, Guard
from robust.report.numbers import plural
from robust.report.output import answering, print_json
from robust.report.pike.requests import assumptions, guarded
from robust.report.progress import Display
from robust.report.terminal import console
from robust.smt.limits import Deadline

if TYPE_CHECKING:
    from rich.console import Console

    from robust.pike_bridge.compile import Checking, PikeCheck
    from robust.pike_bridge.model import TeamPlan
    from robust.pike_bridge.semantics import Execution

SCHEMA = "robust/pike-check/1"
_CODES = {"proved": 0, "refuted": 1, "unknown": 3}


@dataclass(frozen=True)
class PikeCheckRequest:
    """The options as they were typed."""

    file: Path
    backend: str = "oracle"
    assume: tuple[str, ...] = ()
    all_scenarios: bool = False
    temporal: str = "lazy"
    solver: str = "z3"
    epsilon: str = "1/1000"
    timeout: str | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


@dataclass
class _Run:
    request: PikeCheckRequest
    guard: Guard
    display: Display
    epsilon: Fraction
    limit: float | None
    checking: Checking | None = None

    def check(self) -> PikeCheck:
        from robust.pike_bridge.action_model import load_team_plan  # noqa: PLC0415 - imports the grammar
        from robust.pike_bridge.compile import (  # noqa: PLC0415 - imports solvers
            Checking,
            Temporal,
            checked_assumptions,
        )

        request = self.request
        plan = load_team_plan(request.file, epsilon=self.epsilon)
        self.checking = Checking(
            plan,
            backend=request.backend,
            assume=checked_assumptions(plan, assumptions(request.assume)),
            all_scenarios=request.all_scenarios,
            solver=request.solver,
            temporal=Temporal(request.temporal),
            deadline=Deadline.after(self.guard.remaining(self.limit)),
            on_stage=self.display.say,
        )
        return self.checking.run()

    def known(self) -> PikeCheck | None:
        return None if self.checking is None else self.checking.so_far(interrupted=True)

    def show(self, result: PikeCheck) -> None:
        timed_out = self.guard.cause is Cause.TIMEOUT
        if self.request.json:
            print_json(check_answer(result, timed_out=timed_out))
            return
        plan = None if self.checking is None else self.checking.plan
        with answering():
            _print(console(), result, plan, quiet=self.request.quiet)


def run_pike_check(request: PikeCheckRequest, guard: Guard) -> int:
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
            epsilon=options.positive(request.epsilon, "--epsilon"),
            limit=options.seconds(request.timeout, "--timeout"),
        )
        result = guarded(guard, run.limit, display, run.check, run.known, run.show)
    run.show(result)
    return _CODES[result.verdict.value] if result.complete or result.verdict.value == "refuted" else 3


def check_answer(result: PikeCheck, *, timed_out: bool) -> dict[str, Any]:
    """`robust/pike-check/1`."""
    answer: dict[str, Any] = {
        "schema": SCHEMA,
        "verdict": result.verdict.value,
        "backend": result.backend,
        "scenario": None,
        "schedule": None,
    }
    if result.execution is not None:
        answer["scenario"] = dict(result.execution.scenario)
        answer["schedule"] = {event: str(when) for event, when in in_order(result.execution.schedule)}
    if result.scenarios is not None:
        answer["scenarios"] = [dict(scenario) for scenario in result.scenarios]
    answer |= {
        "complete": result.complete,
        "interrupted": result.interrupted and not timed_out,
        "seconds": {stage: round(spent, 6) for stage, spent in (result.seconds or {}).items()},
    }
    return answer


def in_order(schedule: Mapping[str, Fraction]) -> list[tuple[str, Fraction]]:
    """Events by time."""
    return sorted(schedule.items(), key=lambda item: (item[1], item[0]))


def _print(out: Console, result: PikeCheck, plan: TeamPlan | None, *, quiet: bool) -> None:
    out.print(_headline(result))
    if quiet:
        return
    if result.execution is not None:
        for line in execution_lines(result.execution, plan):
            out.print(f"  {line}")
    if result.scenarios is not None:
        missing = "" if result.complete else " so far"
        out.print(f"{plural(len(result.scenarios), 'team scenario')}{missing}:")
        for scenario in result.scenarios:
            out.print(f"  {scenario_text(scenario)}")


def _headline(result: PikeCheck) -> str:
    match result.verdict.value:
        case "proved":
            return "A correct execution exists."
        case "refuted":
            return "No correct execution exists."
        case _:
            return "Undecided: interrupted." if result.interrupted else "Undecided: out of time."


def scenario_text(scenario: Mapping[str, str]) -> str:
    """`x = 1, y = 2`."""
    return ", ".join(f"{name} = {value}" for name, value in scenario.items()) or "no choices"


def execution_lines(execution: Execution, plan: TeamPlan | None) -> Iterable[str]:
    """The choices, and the activities by the time at which they start."""
    yield scenario_text(execution.scenario)
    if plan is None:
        return
    schedule = execution.schedule
    rows = [
        (schedule[activity.source], schedule[activity.target], activity)
        for activity in plan.network.activities
        if all(execution.scenario[variable] == value for variable, value in activity.guard)
    ]
    for start, end, activity in sorted(rows, key=lambda row: row[:2]):
        agent = "" if activity.agent is None else f"  [{activity.agent}]"
        yield f"{format_number(start)} – {format_number(end)}  {activity.action}{agent}"
