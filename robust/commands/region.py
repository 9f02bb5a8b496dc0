"""`robust region`."""

from __future__ import annotations

from enum import StrEnum
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


class Eliminator(StrEnum):
    """How time points are eliminated."""

    PROJECT = "project"
    Z3 = "z3"
    CVC5 = "cvc5"
    FOURIER_MOTZKIN = "fourier-motzkin"
    LOOS_WEISPFENNING = "loos-weispfenning"


class Splitting(StrEnum):
    """Into how many problems the elimination is split."""

    MONOLITHIC = "monolithic"
    PARTIAL = "partial"
    FULL = "full"


class Form(StrEnum):
    """How a region is shown."""

    UNION = "union"
    DIFFERENCE = "difference"


@app.command(epilog=EPILOG, short_help="All parameter values for which a plan is valid.")
def region(
    context: typer.Context,
    domain: Domain,
    problem: Problem,
    plan: Plan,
    *,
    backend: Annotated[Eliminator, typer.Option("--backend", help="who eliminates time points")] = Eliminator.PROJECT,
    splitting: Annotated[
        Splitting,
        typer.Option("--splitting", help="one problem for all, for the plan and its network, or for each part"),
    ] = Splitting.FULL,
    learning: Annotated[
        bool, typer.Option("--learning/--no-learning", help="tell later problems what earlier ones have excluded")
    ] = True,
    form: Annotated[
        Form | None,
        typer.Option(
            "--form",
            help="as a union of polyhedra or as one without others; if not given, a union unless very many are cut out",
        ),
    ] = None,
    latex: Annotated[bool, typer.Option("--latex", help="print a formula for LaTeX's mathematical mode")] = False,
    parameter: Parameter = None,
    parameters: Parameters = None,
    epsilon: Epsilon = "1/1000",
    encoding: EncodingOption = Encoding.RELATIONAL,
    solver: SolverOption = Solver.Z3,
    timeout: Timeout = None,
    plot: PlotFile = None,
    axes: Axes = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """For exactly which parameter values is the plan valid? Out of time, an outer bound is printed."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.regions import RegionRequest, run_region  # noqa: PLC0415 - heavy

    request = RegionRequest(
        files=(domain, problem, plan),
        backend=backend.value,
        splitting=splitting.value,
        learning=learning,
        form=None if form is None else form.value,
        latex=latex,
        specs=tuple(parameter or ()),
        parameter_file=parameters,
        epsilon=epsilon,
        encoding=encoding.value,
        solver=solver.value,
        timeout=timeout,
        plot=plot,
        axes=axes,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_region(request, guard_of(context))
