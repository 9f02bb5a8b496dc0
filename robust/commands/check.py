"""`robust check`."""

from __future__ import annotations

from typing import Annotated

import typer

from robust.commands.app import EPILOG, app, configure_logging, guard_of
from robust.commands.options import (
    Domain,
    Encoding,
    EncodingOption,
    Epsilon,
    Json,
    Parameter,
    Parameters,
    Plan,
    Problem,
    Quiet,
    Smt2,
    Solver,
    SolverOption,
    Timeout,
    Verbose,
)


@app.command(epilog=EPILOG, short_help="Is a plan valid for every schedule it allows?")
def check(
    context: typer.Context,
    domain: Domain,
    problem: Problem,
    plan: Plan,
    *,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="NAME=VALUE",
            help="value of a parameter instead of its nominal one, or NAME=LOW:HIGH for all values between; "
            "may be repeated",
        ),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="examine all obligations instead of stopping at the first that breaks")
    ] = False,
    parameter: Parameter = None,
    parameters: Parameters = None,
    epsilon: Epsilon = "1/1000",
    encoding: EncodingOption = Encoding.RELATIONAL,
    solver: SolverOption = Solver.Z3,
    timeout: Timeout = None,
    smt2: Smt2 = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Is the plan valid for every schedule that its network allows? If not, show one that fails."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.checking import CheckRequest, run_check  # noqa: PLC0415 - heavy

    request = CheckRequest(
        files=(domain, problem, plan),
        at=tuple(at or ()),
        every=every,
        specs=tuple(parameter or ()),
        parameter_file=parameters,
        epsilon=epsilon,
        encoding=encoding.value,
        solver=solver.value,
        timeout=timeout,
        smt2=smt2,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_check(request, guard_of(context))
