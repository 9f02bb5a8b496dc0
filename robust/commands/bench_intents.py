"""`robust bench figure17` and `figure18`: plans with choices executed by PIKE, and by one who guesses intents."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robust.commands.app import configure_logging, guard_of
from robust.commands.bench import Cluster, Seed, Store, bench_app
from robust.commands.options import Jobs, Json, PlotFile, Quiet, Verbose

IntentProblems = Annotated[int, typer.Option("--problems", metavar="N", help="how many random problems")]
Largest = Annotated[int, typer.Option("--largest", metavar="K", help="how many intents a problem has at most")]
ReasonerName = Annotated[str, typer.Option("--backend", metavar="NAME", help="how both executives reason")]
ExecutionLimit = Annotated[str | None, typer.Option("--limit", metavar="S", help="seconds to compute an execution")]


@bench_app.command(short_help="Re-plans of an executive that guesses what humans intend.")
def figure17(
    context: typer.Context,
    *,
    problems: IntentProblems = 2000,
    seed: Seed = 0,
    largest: Largest = 10_000,
    reasoner: ReasonerName = "smt",
    jobs: Jobs = 1,
    cluster: Cluster = None,
    store: Store = None,
    limit: ExecutionLimit = "60",
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Execute plans with choices by PIKE, and by one who guesses intents: re-plans over the number of intents."""
    return _k_intents(
        context,
        "figure17",
        (problems, seed, largest, reasoner),
        jobs,
        cluster,
        store,
        limit,
        plot,
        json,
        quiet,
        verbose,
    )


@bench_app.command(short_help="Time to completion of an executive that guesses what humans intend.")
def figure18(
    context: typer.Context,
    *,
    problems: IntentProblems = 2000,
    seed: Seed = 0,
    largest: Largest = 10_000,
    reasoner: ReasonerName = "smt",
    jobs: Jobs = 1,
    cluster: Cluster = None,
    store: Store = None,
    limit: ExecutionLimit = "60",
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Execute plans with choices by PIKE, and by one who guesses intents: the times until all is done."""
    return _k_intents(
        context,
        "figure18",
        (problems, seed, largest, reasoner),
        jobs,
        cluster,
        store,
        limit,
        plot,
        json,
        quiet,
        verbose,
    )


def _k_intents(  # noqa: PLR0917 (the options of both commands)
    context: typer.Context,
    figure: str,
    which: tuple[int, int, int, str],
    jobs: int,
    cluster: str | None,
    store: Path | None,
    limit: str | None,
    plot: Path | None,
    json: bool,
    quiet: bool,
    verbose: bool,
) -> int:
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_k_intents  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs, limit, plot, json, not (quiet or verbose), cluster, store)
    return bench_k_intents(figure, *which, request, guard_of(context))
