"""`robust execute`: from options to simulated executions, as a timeline, a table, JSON or a Gantt chart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.errors import InputError, Location
from robust.report import options
from robust.report.guard import UNDECIDED, Cause, GivenUpError, Guard
from robust.report.output import answering, print_json
from robust.report.progress import Display

if TYPE_CHECKING:
    from robust.execute.replan import Mission, Options, Prepared, Run
    from robust.plan.parameters import ParameterSpec
    from robust.plan.pddl.syntax import Domain, Problem


@dataclass(frozen=True)
class ExecuteRequest:
    """The options as they were typed."""

    domain: Path
    problem: Path
    plan: Path | None = None
    executor: str = "dreex"
    planner: str | None = None
    world: Path | None = None
    seed: int = 0
    runs: int = 1
    specs: tuple[str, ...] = ()
    spec_file: Path | None = None
    method: str = "widen"
    controllability: str | None = None
    replans: int = 10
    planner_limit: str = "7"
    planning_time: str = "0"
    stop_running: bool = False
    epsilon: str = "1/1000"
    solver: str = "z3"
    timeout: str | None = None
    plot: Path | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


def run_execute(request: ExecuteRequest, guard: Guard) -> int:
    """Execute, and print what happened; 0 if all runs succeeded, 1 if some failed, 3 if not all were made.

    Raises:
        RobustError: wrong input, input that is not supported, or no plan to begin with.
        GivenUpError: if interrupted before any run was made.
    """
    limit = options.seconds(request.timeout, "--timeout")
    plot = options.plot_file(request.plot)
    _check_counts(request)
    runs: list[Run] = []
    stopped = False
    try:
        with Display(shown=request.progress, what="reading") as display, guard.working(limit):
            _execute_all(request, runs, display, guard.remaining(limit))
    except KeyboardInterrupt:
        if not runs:
            raise GivenUpError from None
        stopped = True
    cause = (guard.cause or Cause.INTERRUPTED) if stopped else None
    if plot is not None:
        from robust.report.timelines import plot_run  # noqa: PLC0415 - only what is asked for

        plot_run(runs[0], request.executor, plot)
    _print(request, runs, cause)
    if stopped:
        return UNDECIDED
    return 0 if all(not run.reason for run in runs) else 1


def _check_counts(request: ExecuteRequest) -> None:
    if request.runs < 1:
        raise InputError(f"found {request.runs}, expected at least 1 run", Location("--runs"))
    if request.replans < 0:
        raise InputError(f"found {request.replans}, expected at least 0 re-plans", Location("--replans"))
    if request.plan is None and request.planner is None:
        raise InputError("found neither PLAN nor --planner, expected one of them: where is the plan to come from?")


def _execute_all(request: ExecuteRequest, runs: list[Run], display: Display, limit: float | None) -> None:
    from robust.execute.replan import execute, first_plan  # noqa: PLC0415 - imports solvers

    mission = _mission(request, limit)
    display.say("preparing the plan")
    prepared = first_plan(mission) if request.plan is None else _prepared(request.plan, mission)
    for number in range(request.runs):
        display.say(f"run {number + 1} of {request.runs}")
        runs.append(execute(mission, request.seed + number, prepared))


def _mission(request: ExecuteRequest, limit: float | None) -> Mission:
    from robust.execute.planners.registry import create_planner  # noqa: PLC0415 - imports solvers
    from robust.execute.replan import Mission  # noqa: PLC0415 - likewise
    from robust.execute.worlds.rules import Rules, read_rules  # noqa: PLC0415 - likewise

    settings = _settings(request, limit)
    domain, problem = _read(request)
    planner = None if request.planner is None else create_planner(request.planner, epsilon=settings.epsilon)
    return Mission(
        domain=domain,
        problem=problem,
        planner=planner,
        rules=Rules() if request.world is None else read_rules(request.world),
        options=settings,
        replans=request.replans,
        planner_seconds=options.seconds(request.planner_limit, "--planner-limit") or 0.0,
        planning_time=options.not_negative(request.planning_time, "--planning-time"),
        drain=not request.stop_running,
    )


def _settings(request: ExecuteRequest, limit: float | None) -> Options:
    from robust.execute.dispatch.network import parse_executor  # noqa: PLC0415 - imports solvers
    from robust.execute.replan import Options  # noqa: PLC0415 - likewise

    return Options(
        executor=parse_executor(request.executor),
        specs=_specs(request),
        method=request.method,
        epsilon=options.not_negative(request.epsilon, "--epsilon"),
        solver=request.solver,
        timeout=limit,
        controllability=request.controllability,
    )


def _specs(request: ExecuteRequest) -> tuple[ParameterSpec, ...]:
    from robust.plan.parameters import parse_specs, read_parameter_file  # noqa: PLC0415 - imports the grammar

    beside = () if request.spec_file is None else read_parameter_file(request.spec_file)
    return (*beside, *parse_specs(request.specs))


def _read(request: ExecuteRequest) -> tuple[Domain, Problem]:
    from robust.plan.pddl.reader import read_domain, read_problem  # noqa: PLC0415 - imports the grammar

    domain = read_domain(request.domain)
    return domain, read_problem(request.problem, domain)


def _prepared(file: Path, mission: Mission) -> Prepared:
    """The plan in a file: a network, or steps as planners print them."""
    from robust.execute.replan import prepare_plan, prepare_timed  # noqa: PLC0415 - imports solvers
    from robust.plan.load import assemble  # noqa: PLC0415 - imports the grammar
    from robust.plan.stn import read_stn  # noqa: PLC0415 - likewise
    from robust.plan.timed import read_timed_plan  # noqa: PLC0415 - likewise

    if file.suffix.lower() == ".stn":
        plan = assemble(mission.domain, mission.problem, read_stn(file), mission.options.specs)
        return prepare_plan(plan, mission.options)
    return prepare_timed(mission.domain, mission.problem, read_timed_plan(file), mission.options)


def _print(request: ExecuteRequest, runs: Sequence[Run], cause: Cause | None) -> None:
    from robust.report import timelines  # noqa: PLC0415 - imports solvers
    from robust.report.terminal import console  # noqa: PLC0415 - likewise

    if request.json:
        print_json(_answer(request, runs, cause))
        return
    with answering():
        out = console()
        if request.runs == 1 and runs:
            timelines.print_run(out, runs[0], request.executor, quiet=request.quiet)
        else:
            timelines.print_runs(out, runs, request.executor, quiet=request.quiet)
        if cause is not None:
            out.print(f"{cause.message} after {len(runs)} of {request.runs} runs")


def _answer(request: ExecuteRequest, runs: Sequence[Run], cause: Cause | None) -> dict[str, Any]:
    from robust.report.timelines import EXECUTE, run_answer, summary  # noqa: PLC0415 - imports solvers

    status = "complete" if cause is None else cause.value
    return {
        "schema": EXECUTE,
        "status": status,
        "executor": request.executor,
        "planner": request.planner,
        "plan": None if request.plan is None else str(request.plan),
        "world": None if request.world is None else str(request.world),
        "epsilon": str(options.not_negative(request.epsilon, "--epsilon")),
        "summary": summary(runs),
        "runs": [run_answer(run) for run in runs],
    }
