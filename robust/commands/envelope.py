"""`robust envelope`."""

from __future__ import annotations

from enum import StrEnum
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
    PlotFile,
    Problem,
    Quiet,
    Smt2,
    Solver,
    SolverOption,
    Timeout,
    Verbose,
)


class Controllability(StrEnum):
    """What a dispatcher may know of the values in the box."""

    WEAK = "weak"
    DYNAMIC = "dynamic"
    STRONG = "strong"


class Method(StrEnum):
    """How the box is searched."""

    WIDEN = "widen"
    IRR = "irr"
    OPTIMAL = "optimal"


@app.command(epilog=EPILOG, short_help="How far may parameters deviate?")
def envelope(
    context: typer.Context,
    domain: Domain,
    problem: Problem,
    plan: Plan,
    *,
    method: Annotated[
        Method,
        typer.Option(
            "--method",
            help="widen: exact, no valid box contains the result; irr: step by step, up to a precision; "
            "optimal: exact, the greatest total width of all boxes",
        ),
    ] = Method.WIDEN,
    beta: Annotated[
        str | None,
        typer.Option(
            "--beta", metavar="B", help="for irr: no end of a complete box can move outwards by B; 1 if not given"
        ),
    ] = None,
    doubling: Annotated[
        bool, typer.Option("--doubling", help="for irr: steps double until the first failure; ends are up to 2 B away")
    ] = False,
    contain_nominal: Annotated[
        bool, typer.Option("--contain-nominal", help="for optimal: only boxes around the nominal values")
    ] = False,
    encoding: EncodingOption = Encoding.RELATIONAL,
    order: Annotated[
        str | None,
        typer.Option(
            "--order",
            metavar="A,B,C",
            help="parameters in the order in which they take turns (irr), or are widened one after the other (widen)",
        ),
    ] = None,
    controllability: Annotated[
        Controllability | None,
        typer.Option(
            "--controllability",
            help="also tell whether values may be unknown until they are observed (dynamic), or for ever (strong), and "
            "shrink the box to the part where they may",
        ),
    ] = None,
    parameter: Parameter = None,
    parameters: Parameters = None,
    epsilon: Epsilon = "1/1000",
    solver: SolverOption = Solver.Z3,
    timeout: Timeout = None,
    plot: PlotFile = None,
    smt2: Smt2 = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """How far may parameters deviate, all at once, before the plan can fail? Ctrl-C prints the best box so far."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.enveloping import EnvelopeRequest, run_envelope  # noqa: PLC0415 - heavy

    request = EnvelopeRequest(
        files=(domain, problem, plan),
        method=method.value,
        encoding=encoding.value,
        beta=beta,
        doubling=doubling,
        contain_nominal=contain_nominal,
        order=order,
        controllability=None if controllability is None else controllability.value,
        specs=tuple(parameter or ()),
        parameter_file=parameters,
        epsilon=epsilon,
        solver=solver.value,
        timeout=timeout,
        plot=plot,
        smt2=smt2,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_envelope(request, guard_of(context))
