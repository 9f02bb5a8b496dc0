"""The commands of `robust`: options to calls, results to text or JSON. What they compute is elsewhere."""

from __future__ import annotations

import logging
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from robust import __version__
from robust.convert_command import register as register_convert
from robust.report.guard import Guard

CommandLineError: type[Exception] = typer.BadParameter.__mro__[2]
"""What the command line parser raises for wrong usage; `typer` has no public name for it."""

_EPILOG = "Exit codes: 0 proved or done, 1 refuted, 2 bad input, 3 unknown, out of time or interrupted, 4 unsupported."

app = typer.Typer(
    name="robust",
    help="Verify temporal plans: are they valid for every schedule, and how far may reality deviate?",
    epilog=_EPILOG,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
bench_app = typer.Typer(
    name="bench",
    help="Measure: recorded data sets, the figures of the paper, scaling studies.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
app.add_typer(bench_app)


class Solver(StrEnum):
    """Which solver is asked."""

    Z3 = "z3"
    CVC5 = "cvc5"


class Method(StrEnum):
    """How the box is searched."""

    WIDEN = "widen"
    IRR = "irr"
    OPTIMAL = "optimal"


class Encoding(StrEnum):
    """How the plan becomes formulas."""

    RELATIONAL = "relational"
    POSITIONS = "positions"


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


Domain = Annotated[Path, typer.Argument(metavar="DOMAIN", help="PDDL domain", show_default=False)]
Problem = Annotated[Path, typer.Argument(metavar="PROBLEM", help="PDDL problem", show_default=False)]
Plan = Annotated[Path, typer.Argument(metavar="PLAN", help="parametrized plan (.stn)", show_default=False)]
Parameter = Annotated[
    list[str] | None,
    typer.Option(
        "--parameter",
        metavar="SPEC",
        help="make a quantity a parameter: duration:ID, start:ID, 'fluent:(f a)', or NAME of an existing one; "
        "then ,weight=W ,lb=L ,ub=U ,default=D; may be repeated",
    ),
]
Parameters = Annotated[
    Path | None, typer.Option("--parameters", metavar="FILE", help="more parameters, in a TOML file")
]
Epsilon = Annotated[
    str, typer.Option("--epsilon", metavar="E", help="separation of mutex time points, in the plan's unit of time")
]
EncodingOption = Annotated[Encoding, typer.Option("--encoding", help="how the plan becomes formulas")]
SolverOption = Annotated[Solver, typer.Option("--solver", help="the solver that is asked")]
Timeout = Annotated[
    str | None, typer.Option("--timeout", metavar="S", help="seconds after which what is known by then is printed")
]
Smt2 = Annotated[Path | None, typer.Option("--smt2", metavar="DIR", help="write every query to DIR as SMT-LIB")]
Json = Annotated[bool, typer.Option("--json", help="print one JSON object on stdout")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="only the answer, no progress")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="log what is done on stderr")]
PlotFile = Annotated[
    Path | None, typer.Option("--plot", metavar="FILE", help="draw the result: .svg, .png or .pdf by suffix")
]
Axes = Annotated[
    str | None,
    typer.Option("--axes", metavar="A,B", help="the one or two parameters to draw, others are at their nominal values"),
]
Limit = Annotated[str | None, typer.Option("--limit", metavar="S", help="seconds after which an instance is killed")]
Jobs = Annotated[int, typer.Option("--jobs", metavar="N", help="processes at a time; more than 1 disturbs timings")]


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"robust {__version__}")
        raise typer.Exit


@app.callback()
def _top(
    _version: Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", is_eager=True, callback=_show_version)
    ] = False,
) -> None:
    pass


@app.command(epilog=_EPILOG, short_help="Is a plan valid for every schedule it allows?")
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
    _configure_logging(verbose)
    with _guard(context).working():
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
    return run_check(request, _guard(context))


@app.command(epilog=_EPILOG, short_help="How far may parameters deviate?")
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
    _configure_logging(verbose)
    with _guard(context).working():
        from robust.report.enveloping import EnvelopeRequest, run_envelope  # noqa: PLC0415 - heavy

    request = EnvelopeRequest(
        files=(domain, problem, plan),
        method=method.value,
        encoding=encoding.value,
        beta=beta,
        doubling=doubling,
        contain_nominal=contain_nominal,
        order=order,
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
    return run_envelope(request, _guard(context))


@app.command(epilog=_EPILOG, short_help="All parameter values for which a plan is valid.")
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
    _configure_logging(verbose)
    with _guard(context).working():
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
    return run_region(request, _guard(context))


@app.command(epilog=_EPILOG, short_help="The exact region beside the boxes of all methods.")
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
    _configure_logging(verbose)
    with _guard(context).working():
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
    return run_compare(request, _guard(context))


@app.command(short_help="Take a tour on shipped examples.")
def demo(context: typer.Context) -> int:
    """Take a tour: check and envelope on examples that come with the program."""
    with _guard(context).working():
        from robust.report.demo import run_demo  # noqa: PLC0415 - heavy

    return run_demo(_guard(context))


@bench_app.command(short_help="Compare with recorded runs.")
def recorded(
    context: typer.Context,
    *,
    suite: Annotated[Path, typer.Option("--suite", metavar="DIR", help="the data set", show_default=False)],
    jobs: Jobs = 1,
    limit: Limit = None,
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Run a data set and compare boxes and numbers of checks with the recorded ones."""
    _configure_logging(verbose)
    with _guard(context).working():
        from robust.report.benching import BenchRequest, bench_recorded  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_recorded(suite, request, _guard(context))


@bench_app.command(short_help="Time over the size of a plan.")
def scaling(
    context: typer.Context,
    *,
    jobs: Jobs = 1,
    limit: Limit = None,
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Time over size: generated plans with more and more actions and parameters."""
    _configure_logging(verbose)
    with _guard(context).working():
        from robust.report.benching import BenchRequest, bench_scaling  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_scaling(request, _guard(context))


@bench_app.command(short_help="Instances solved over time, by every method.")
def figure3(
    context: typer.Context,
    *,
    suite: Annotated[Path, typer.Option("--suite", metavar="DIR", help="the data set", show_default=False)],
    jobs: Jobs = 1,
    limit: Limit = "10",
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Run a data set by every method: how many instances are solved within which time, beside the recorded runs."""
    _configure_logging(verbose)
    with _guard(context).working():
        from robust.report.benching import BenchRequest, bench_figure3  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_figure3(suite, request, _guard(context))


@bench_app.command(short_help="Convergence of IRR by steps.")
def figure5(
    context: typer.Context,
    *,
    suite: Annotated[Path, typer.Option("--suite", metavar="DIR", help="the data set", show_default=False)],
    jobs: Jobs = 1,
    limit: Limit = "10",
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Run IRR on a data set: how near the final box is after how many steps."""
    _configure_logging(verbose)
    with _guard(context).working():
        from robust.report.benching import BenchRequest, bench_figure5  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_figure5(suite, request, _guard(context))


@bench_app.command(short_help="Time of each elimination back end over size.")
def backends(
    context: typer.Context,
    *,
    jobs: Jobs = 1,
    limit: Limit = "10",
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Time over size: each elimination back end on plans with more and more parameters and unordered time points."""
    _configure_logging(verbose)
    with _guard(context).working():
        from robust.report.benching import BenchRequest, bench_backends  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_backends(request, _guard(context))


@bench_app.command(short_help="Time of both encodings over size.")
def encodings(
    context: typer.Context,
    *,
    jobs: Jobs = 1,
    limit: Limit = "10",
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Time over size: both encodings on plans with more and more unordered time points."""
    _configure_logging(verbose)
    with _guard(context).working():
        from robust.report.benching import BenchRequest, bench_encodings  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_encodings(request, _guard(context))


def _guard(context: typer.Context) -> Guard:
    """The guard of this run; a fresh one, which does nothing, where the application is called by other means."""
    found = context.find_object(Guard)
    return found if isinstance(found, Guard) else Guard()


def _configure_logging(verbose: bool) -> None:
    if verbose:
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(logging.Formatter("%(relativeCreated)7.0f ms  %(name)s: %(message)s"))
        logger = logging.getLogger("robust")
        logger.handlers[:] = [handler]
        logger.setLevel(logging.DEBUG)


register_convert(app, _guard, _configure_logging, _EPILOG)
