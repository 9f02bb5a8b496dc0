"""The command `robust convert`: its options. What it computes is in :mod:`robust.execute.convert`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from robust.commands.app import EPILOG, app, configure_logging, guard_of
from robust.commands.options import Domain, Epsilon, Json, Problem, Quiet, Solver, SolverOption, Verbose


class ConversionMode(StrEnum):
    """How the network is made."""

    CAUSAL = "causal"
    ESTEREL = "esterel"


@app.command(epilog=EPILOG, short_help="Make a flexible plan of a planner's output.")
def convert(
    context: typer.Context,
    domain: Domain,
    problem: Problem,
    plan: Annotated[
        Path, typer.Argument(metavar="TIMED_PLAN", help="steps as planners print them", show_default=False)
    ],
    *,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="PLAN.stn", help="write the plan here instead of on stdout"),
    ] = None,
    mode: Annotated[
        ConversionMode,
        typer.Option(
            "--mode",
            help="causal: the least constrained network that is proved valid; "
            "esterel: the network of the Esterel transformer",
        ),
    ] = ConversionMode.CAUSAL,
    parametrize: Annotated[
        list[str] | None,
        typer.Option(
            "--parametrize",
            metavar="SPEC",
            help="make a quantity a parameter: duration:ACTION, duration:ID, start:ID or 'fluent:(f a)'; "
            "then ,weight=W ,lb=L ,ub=U; may be repeated",
        ),
    ] = None,
    epsilon: Epsilon = "1/1000",
    solver: SolverOption = Solver.Z3,
    timeout: Annotated[
        str | None, typer.Option("--timeout", metavar="S", help="seconds after which nothing more is proved")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Make a plan with a temporal network of a time-triggered plan, and prove it; steps are called n0, n1, ..."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.converting import ConvertRequest, run_convert  # noqa: PLC0415 - heavy

    request = ConvertRequest(
        files=(domain, problem, plan),
        output=output,
        mode=mode.value,
        specs=tuple(parametrize or ()),
        epsilon=epsilon,
        solver=solver.value,
        timeout=timeout,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_convert(request, guard_of(context))
