"""`robust compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robust.commands.app import EPILOG, app, configure_logging, guard_of
from robust.commands.options import (
    Axes,
    Domain,
    Encoding,
    EncodingOption,
    Epsilon,
    Json,
    Parameter,
    Parameters,
    Plan,
    PlotFile,
    Problem,
    Quiet,
    Solver,
    SolverOption,
    Timeout,
    Verbose,
)


@app.command(epilog=EPILOG, short_help="The exact region beside the boxes of all methods.")
def compare(
    context: typer.Context,
    domain: Domain,
    problem: Problem,
    plan: Plan,
    *,
    beta: Annotated[str, typer.Option("--beta", metavar="B", help="the precision of irr")] = "1",
    parameter: Parameter = None,
    parameters: Parameters = None,
    epsilon: Epsilon = "1/1000",
    encoding: EncodingOption = Encoding.RELATIONAL,
    solver: SolverOption = Solver.Z3,
    timeout: Timeout = None,
    plot: PlotFile = None,
    axes: Axes = None,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="write a report with a drawing as one HTML file")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """How much of the exact region does each box cover, and what breaks just outside each of its faces?"""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.comparing import CompareRequest, run_compare  # noqa: PLC0415 - heavy

    request = CompareRequest(
        files=(domain, problem, plan),
        beta=beta,
        specs=tuple(parameter or ()),
        parameter_file=parameters,
        epsilon=epsilon,
        encoding=encoding.value,
        solver=solver.value,
        timeout=timeout,
        plot=plot,
        axes=axes,
        html=html,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_compare(request, guard_of(context))
