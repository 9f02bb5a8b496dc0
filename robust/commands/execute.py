"""The command `robust execute`: its options. What it computes is in :mod:`robust.execute.replanning`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from robust.commands.app import EPILOG, app, configure_logging, guard_of
from robust.commands.options import (
    Domain,
    Epsilon,
    Json,
    Parameters,
    PlotFile,
    Problem,
    Quiet,
    Solver,
    SolverOption,
    Timeout,
    Verbose,
)


class BoxMethod(StrEnum):
    """How the box is computed."""

    WIDEN = "widen"
    IRR = "irr"
    OPTIMAL = "optimal"


class Shrink(StrEnum):
    """Which part of the box is used."""

    DYNAMIC = "dynamic"
    STRONG = "strong"


@app.command(epilog=EPILOG, short_help="Execute in simulated worlds, and plan anew when needed.")
def execute(
    context: typer.Context,
    domain: Domain,
    problem: Problem,
    plan: Annotated[
        Path | None,
        typer.Argument(
            metavar="PLAN",
            help="network (.stn), or steps as planners print them; the planner is asked if left out",
            show_default=False,
        ),
    ] = None,
    *,
    executor: Annotated[
        str,
        typer.Option(
            "--executor",
            metavar="NAME",
            help="dreex: go on while observations are in the box; blex:X: while they are within X per cent",
        ),
    ] = "dreex",
    planner: Annotated[
        str | None,
        typer.Option("--planner", metavar="NAME", help="who plans and re-plans: aries, kairos or command:TEMPLATE"),
    ] = None,
    world: Annotated[
        Path | None, typer.Option("--world", metavar="FILE", help="what nature draws, in a TOML file")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="of the first run; the next ones count up")] = 0,
    runs: Annotated[int, typer.Option("--runs", metavar="N", help="how many runs")] = 1,
    parametrize: Annotated[
        list[str] | None,
        typer.Option(
            "--parametrize",
            metavar="SPEC",
            help="make a quantity of every plan a parameter: duration:ACTION, duration:ID, start:ID or "
            "'fluent:(f a)'; then ,weight=W ,lb=L ,ub=U; may be repeated",
        ),
    ] = None,
    parameters: Parameters = None,
    method: Annotated[BoxMethod, typer.Option("--method", help="how the box is computed")] = BoxMethod.WIDEN,
    controllability: Annotated[
        Shrink | None, typer.Option("--controllability", help="use the part of the box that is controllable so")
    ] = None,
    replans: Annotated[int, typer.Option("--replans", metavar="N", help="re-plans after which a run fails")] = 10,
    planner_limit: Annotated[
        str, typer.Option("--planner-limit", metavar="S", help="seconds that the planner has each time")
    ] = "7",
    planning_time: Annotated[
        str, typer.Option("--planning-time", metavar="T", help="how long re-planning takes in the simulated world")
    ] = "0",
    stop_running: Annotated[
        bool, typer.Option("--stop-running", help="stop running actions to re-plan, instead of waiting for them")
    ] = False,
    epsilon: Epsilon = "1/1000",
    solver: SolverOption = Solver.Z3,
    timeout: Timeout = None,
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Execute a plan in simulated worlds, and plan anew from the state reached when an observation leaves the box."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.executing import ExecuteRequest, run_execute  # noqa: PLC0415 - heavy

    request = ExecuteRequest(
        domain=domain,
        problem=problem,
        plan=plan,
        executor=executor,
        planner=planner,
        world=world,
        seed=seed,
        runs=runs,
        specs=tuple(parametrize or ()),
        spec_file=parameters,
        method=method.value,
        controllability=None if controllability is None else controllability.value,
        replans=replans,
        planner_limit=planner_limit,
        planning_time=planning_time,
        stop_running=stop_running,
        epsilon=epsilon,
        solver=solver.value,
        timeout=timeout,
        plot=plot,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_execute(request, guard_of(context))
