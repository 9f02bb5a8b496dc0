"""`robust certify` and `robust verify`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from robust.commands.app import EPILOG, app, configure_logging, guard_of
from robust.commands.options import (
    Encoding,
    EncodingOption,
    Epsilon,
    Json,
    Parameter,
    Parameters,
    Quiet,
    Solver,
    SolverOption,
    Timeout,
    Verbose,
)


class Kind(StrEnum):
    """What is certified."""

    PLAN = "plan"
    BOX = "box"
    MAXIMAL = "maximal"
    REGION = "region"


@app.command(epilog=EPILOG, short_help="Write down why a plan is valid, for a checker without solver.")
def certify(
    context: typer.Context,
    files: Annotated[list[Path], typer.Argument(metavar="FILES", help="DOMAIN PROBLEM PLAN, or NETWORK (.tpnu.json)")],
    *,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="CERT", help="where to write the certificate")],
    kind: Annotated[
        Kind,
        typer.Option(
            "--kind",
            help="plan: valid at the nominal values; box: all over a box; maximal: and no valid box contains "
            "it; region: all over the robustness envelope",
        ),
    ] = Kind.PLAN,
    box: Annotated[
        Path | None,
        typer.Option(
            "--box", metavar="FILE", help="the box, an answer of robust envelope in JSON; else widening finds it"
        ),
    ] = None,
    alethe: Annotated[
        Path | None,
        typer.Option("--alethe", metavar="DIR", help="also write cvc5's proofs to DIR, in the Alethe format"),
    ] = None,
    parameter: Parameter = None,
    parameters: Parameters = None,
    epsilon: Epsilon = "1/1000",
    encoding: EncodingOption = Encoding.RELATIONAL,
    solver: SolverOption = Solver.Z3,
    timeout: Timeout = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Write a certificate that a plan is valid, or that a plan with choices has no correct execution, and check it."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.certifying import CertifyRequest, run_certify  # noqa: PLC0415 - heavy

    request = CertifyRequest(
        files=tuple(files),
        output=output,
        kind=kind.value,
        box=box,
        alethe=alethe,
        specs=tuple(parameter or ()),
        parameter_file=parameters,
        epsilon=epsilon,
        encoding=encoding.value,
        solver=solver.value,
        timeout=timeout,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_certify(request, guard_of(context))


@app.command(epilog=EPILOG, short_help="Check a certificate, in a process of its own.")
def verify(
    context: typer.Context,
    certificate: Annotated[Path, typer.Argument(metavar="CERT", help="a certificate", show_default=False)],
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILES]", help="the input files that it is said to be about", show_default=False),
    ] = None,
    *,
    parameter: Parameter = None,
    parameters: Parameters = None,
    timeout: Timeout = None,
    json: Json = False,
) -> int:
    """Say what a certificate establishes, and what is still trusted; 1 if it is rejected."""
    with guard_of(context).working():
        from robust.report.certifying import VerifyRequest, run_verify  # noqa: PLC0415 - heavy

    request = VerifyRequest(
        certificate=certificate,
        files=tuple(files or ()),
        specs=tuple(parameter or ()),
        parameter_file=parameters,
        timeout=timeout,
        json=json,
    )
    return run_verify(request, guard_of(context))
