"""`robust pike`: commands on plans with choices."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from robust.commands.app import EPILOG, app, configure_logging, guard_of, refuse
from robust.commands.options import Epsilon, Json, Quiet, Solver, SolverOption, Timeout, Verbose


class CheckBackend(StrEnum):
    """Who answers."""

    ORACLE = "oracle"
    PITMS = "pitms"
    ATMS = "atms"
    SAT = "sat"
    BDD = "bdd"


class CompileBackend(StrEnum):
    """What is compiled."""

    PITMS = "pitms"
    ATMS = "atms"
    SAT = "sat"
    BDD = "bdd"


class TemporalReasoning(StrEnum):
    """How events are ordered and temporal conflicts found."""

    LAZY = "lazy"
    APSP = "apsp"


class HumanKind(StrEnum):
    """How uncontrollable choices are made."""

    RATIONAL = "rational"
    CARELESS = "careless"


class ClockKind(StrEnum):
    """Whose time it is."""

    GIVEN = "given"
    REAL = "real"


class PaceKind(StrEnum):
    """How long activities take."""

    COOPERATIVE = "cooperative"
    LEAST = "least"
    RANDOM = "random"


pike_app = typer.Typer(
    name="pike",
    help="Plans with choices: which still lead to a correct execution?",
    no_args_is_help=True,
    rich_markup_mode=None,
)
app.add_typer(pike_app)

File = Annotated[Path, typer.Argument(metavar="FILE", help="a plan with choices, .tpnu.json", show_default=False)]
Temporal = Annotated[
    TemporalReasoning,
    typer.Option(
        "--temporal",
        help="lazy: order by structure, conflicts as they are needed; apsp: labeled all-pairs shortest paths",
    ),
]
Assume = Annotated[
    list[str] | None,
    typer.Option("--assume", metavar="NAME=VALUE", help="a choice that is made already; may be repeated"),
]


@pike_app.command(epilog=EPILOG, short_help="Does a correct execution exist, and in which scenarios?")
def check(
    context: typer.Context,
    file: File,
    *,
    backend: Annotated[CheckBackend, typer.Option("--backend", help="who answers")] = CheckBackend.ORACLE,
    assume: Assume = None,
    all_scenarios: Annotated[
        bool, typer.Option("--all-scenarios", help="find every team scenario that admits a correct execution")
    ] = False,
    cross: Annotated[
        bool, typer.Option("--cross", help="ask all back ends and the oracle the same questions, and compare")
    ] = False,
    witness: Annotated[
        Path | None,
        typer.Option("--witness", metavar="DIR", help="with --cross: where to write a small plan on which they differ"),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="with --cross: which sets of choices are tried")] = 0,
    temporal: Temporal = TemporalReasoning.LAZY,
    epsilon: Epsilon = "1/1000",
    solver: SolverOption = Solver.Z3,
    timeout: Timeout = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Is there a correct execution of a plan with choices, given some of the choices? If so, show one."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.pike.checking import PikeCheckRequest, run_pike_check  # noqa: PLC0415 - heavy
        from robust.report.pike.crossing import PikeCrossRequest, run_pike_cross  # noqa: PLC0415

    progress = not (quiet or verbose)
    if cross:
        crossing = PikeCrossRequest(
            file=file,
            witness=witness,
            seed=seed,
            solver=solver.value,
            epsilon=epsilon,
            timeout=timeout,
            json=json,
            quiet=quiet,
            progress=progress,
        )
        return run_pike_cross(crossing, guard_of(context))
    request = PikeCheckRequest(
        file=file,
        backend=backend.value,
        assume=tuple(assume or ()),
        all_scenarios=all_scenarios,
        temporal=temporal.value,
        solver=solver.value,
        epsilon=epsilon,
        timeout=timeout,
        json=json,
        quiet=quiet,
        progress=progress,
    )
    return run_pike_check(request, guard_of(context))


@pike_app.command(name="compile", epilog=EPILOG, short_help="Compile the knowledge base of all correct executions.")
def compile_(
    context: typer.Context,
    file: File,
    *,
    backend: Annotated[CompileBackend, typer.Option("--backend", help="what is compiled")] = CompileBackend.PITMS,
    temporal: Temporal = TemporalReasoning.LAZY,
    shortcut: Annotated[
        bool,
        typer.Option(
            "--shortcut/--no-shortcut", help="whether a solver may find that there is no correct execution at all"
        ),
    ] = True,
    implicants: Annotated[bool, typer.Option("--implicants", help="list the prime implicants (pitms, bdd)")] = False,
    models: Annotated[bool, typer.Option("--models/--no-models", help="whether models are counted")] = True,
    epsilon: Epsilon = "1/1000",
    solver: SolverOption = Solver.Z3,
    timeout: Timeout = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Compile a plan with choices for execution: sizes, and seconds of each stage."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.pike.compiling import PikeCompileRequest, run_pike_compile  # noqa: PLC0415 - heavy

    request = PikeCompileRequest(
        file=file,
        backend=backend.value,
        temporal=temporal.value,
        shortcut=shortcut,
        implicants=implicants,
        models=models,
        solver=solver.value,
        epsilon=epsilon,
        timeout=timeout,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_pike_compile(request, guard_of(context))


_SIMULATED = {
    "human": "--human",
    "pace": "--pace",
    "outcome": "--outcome",
    "disturb": "--disturb",
    "delay": "--delay",
    "seed": "--seed",
    "infer": "--infer",
    "picture": "--plot",
}
_SERVED = {"journal": "--journal", "clock": "--clock", "rate": "--rate"}


@pike_app.command(epilog=EPILOG, short_help="Execute a plan with choices with a simulated team.")
def run(
    context: typer.Context,
    file: File,
    *,
    human: Annotated[
        HumanKind,
        typer.Option("--human", help="how uncontrollable choices are made: among what remains correct, or anyhow"),
    ] = HumanKind.RATIONAL,
    pace: Annotated[
        PaceKind,
        typer.Option(
            "--pace", help="how long activities take: so that a correct execution is left if possible, or regardless"
        ),
    ] = PaceKind.COOPERATIVE,
    outcome: Annotated[
        list[str] | None,
        typer.Option(
            "--outcome", metavar="NAME=VALUE[@TIME]", help="what is chosen, and when it is known; may be repeated"
        ),
    ] = None,
    disturb: Annotated[
        list[str] | None,
        typer.Option("--disturb", metavar="LITERAL@TIME", help="what goes wrong: '(not (atom))@3'; may be repeated"),
    ] = None,
    delay: Annotated[str, typer.Option("--delay", metavar="T", help="humans hesitate this long at most")] = "0",
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="decides what is left open")] = 0,
    backend: Annotated[
        str, typer.Option("--backend", metavar="NAME", help="who decides; smt asks a solver and compiles nothing")
    ] = "smt",
    stdio: Annotated[
        bool, typer.Option("--stdio", help="simulate nothing, but serve a real team through lines of JSON")
    ] = False,
    journal: Annotated[
        Path | None,
        typer.Option("--journal", metavar="FILE", help="as a service: write each step here first, and go on from it"),
    ] = None,
    clock: Annotated[
        ClockKind, typer.Option("--clock", help="as a service: the time that messages give, or real time")
    ] = ClockKind.GIVEN,
    rate: Annotated[
        str | None, typer.Option("--rate", metavar="S", help="in real time: seconds that a unit of time lasts, else 1")
    ] = None,
    infer: Annotated[
        bool, typer.Option("--infer/--no-infer", help="find out which values open choices may still have")
    ] = True,
    explain: Annotated[bool, typer.Option("--explain", help="say why, below each decision and inference")] = False,
    picture: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE", help="draw who did what when: .svg, .png or .pdf")
    ] = None,
    epsilon: Epsilon = "1/1000",
    solver: SolverOption = Solver.Z3,
    timeout: Timeout = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Execute a plan with choices: dispatch, recognise intent, adapt, watch for what goes wrong."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.pike.running import PikeRunRequest, run_pike_run  # noqa: PLC0415 - heavy
        from robust.report.pike.serving import PikeServeRequest, run_pike_serve  # noqa: PLC0415

    if stdio:
        refuse(context, _SIMULATED, "found together with --stdio, expected without: nothing is simulated then")
        serving = PikeServeRequest(
            file=file,
            journal=journal,
            clock=clock.value,
            rate=rate,
            backend=backend,
            solver=solver.value,
            epsilon=epsilon,
            timeout=timeout,
        )
        return run_pike_serve(serving, guard_of(context))
    refuse(context, _SERVED, "expected only together with --stdio")
    request = PikeRunRequest(
        file=file,
        human=human.value,
        pace=pace.value,
        outcomes=tuple(outcome or ()),
        disturbances=tuple(disturb or ()),
        delay=delay,
        seed=seed,
        infer=infer,
        explain=explain,
        plot=picture,
        backend=backend,
        solver=solver.value,
        epsilon=epsilon,
        timeout=timeout,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_pike_run(request, guard_of(context))


@pike_app.command(epilog=EPILOG, short_help="Draw a plan with choices.")
def plot(
    context: typer.Context,
    file: File,
    *,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", "--plot", metavar="FILE", help="where to draw: .svg, .png or .pdf by suffix"),
    ],
    assume: Assume = None,
    links: Annotated[bool, typer.Option("--links", help="draw the labeled causal links as well")] = False,
    epsilon: Epsilon = "1/1000",
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Draw events, activities, choices and guards of a plan; with assumptions, only what they leave."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.pike.drawing import PikePlotRequest, run_pike_plot  # noqa: PLC0415 - heavy

    request = PikePlotRequest(
        file=file,
        output=output,
        assume=tuple(assume or ()),
        links=links,
        epsilon=epsilon,
        json=json,
        quiet=quiet,
        progress=not (quiet or verbose),
    )
    return run_pike_plot(request, guard_of(context))
