"""`robust bench`: one command for each benchmark."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robust.commands.app import app, configure_logging, guard_of
from robust.commands.options import Jobs, Json, Limit, PlotFile, Quiet, Verbose

bench_app = typer.Typer(
    name="bench",
    help="Measure: recorded data sets, the figures of the paper, scaling studies.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
app.add_typer(bench_app)


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
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_recorded  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_recorded(suite, request, guard_of(context))


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
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_scaling  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_scaling(request, guard_of(context))


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
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_figure3  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_figure3(suite, request, guard_of(context))


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
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_figure5  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_figure5(suite, request, guard_of(context))


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
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_backends  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_backends(request, guard_of(context))


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
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_encodings  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_encodings(request, guard_of(context))


Cluster = Annotated[
    str | None,
    typer.Option("--cluster", metavar="ADDRESS", help="run on the workers of this Dask scheduler (extra cluster)"),
]
Store = Annotated[
    Path | None,
    typer.Option("--store", metavar="FILE", help="keep results as they arrive; a run with the same FILE resumes"),
]


@bench_app.command(short_help="Time over the parameters of delivery plans, by every method.")
def figure4(
    context: typer.Context,
    *,
    suite: Annotated[Path | None, typer.Option("--suite", metavar="DIR", help="a data set with recorded plans")] = None,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    store: Store = None,
    limit: Limit = "10",
    baseline_limit: Annotated[
        str, typer.Option("--baseline-limit", metavar="S", help="the same for all but IRR and exact widening")
    ] = "10",
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Run every method on delivery plans of 1 to 33 parameters, and ask whether the boxes are controllable."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_figure4  # noqa: PLC0415 - heavy

    shown = not (quiet or verbose)
    request = BenchRequest(jobs, limit, plot, json, shown, cluster, store)
    return bench_figure4(suite, baseline_limit, request, guard_of(context))


@bench_app.command(short_help="Converted plans: proved, and what they could do without.")
def conversions(
    context: typer.Context,
    *,
    drawn: Annotated[int, typer.Option("--drawn", metavar="N", help="how many plans are drawn at random")] = 150,
    delivery: Annotated[int, typer.Option("--delivery", metavar="N", help="how many delivery plans")] = 50,
    planned: Annotated[int, typer.Option("--planned", metavar="N", help="how many plans a planner makes")] = 100,
    planner: Annotated[str, typer.Option("--planner", metavar="NAME", help="which planner")] = "aries",
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="which plans and problems")] = 0,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    store: Store = None,
    limit: Annotated[
        str | None, typer.Option("--limit", metavar="S", help="seconds to convert a plan, and as many to judge it")
    ] = "60",
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Convert time-triggered plans, and remove each constraint in turn: is the plan still proved valid without it?"""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_conversions  # noqa: PLC0415 - heavy

    shown = not (quiet or verbose)
    request = BenchRequest(jobs, limit, None, json, shown, cluster, store)
    return bench_conversions(drawn, delivery, planned, planner, seed, request, guard_of(context))


Problems = Annotated[int, typer.Option("--problems", metavar="N", help="how many of the hundred problems")]
Runs = Annotated[int, typer.Option("--runs", metavar="N", help="simulated worlds for each problem")]
PlannerName = Annotated[
    str | None, typer.Option("--planner", metavar="NAME", help="who plans; else aries for table 1, kairos for table 2")
]
PlannerLimit = Annotated[str, typer.Option("--planner-limit", metavar="S", help="seconds for each plan")]
Drain = Annotated[
    bool | None,
    typer.Option(
        "--drain/--stop", help="wait for what runs when a plan is given up (else for table 2), or stop it (for table 1)"
    ),
]
Worlds = Annotated[int, typer.Option("--seed", metavar="N", help="which simulated worlds")]


@bench_app.command(short_help="Executors under uncertain durations.")
def table1(
    context: typer.Context,
    *,
    problems: Problems = 100,
    runs: Runs = 1,
    parameters: Annotated[
        list[int] | None,
        typer.Option("--parameters", metavar="N", help="only with N uncertain durations, 1 to 5; may be repeated"),
    ] = None,
    planner: PlannerName = None,
    planner_limit: PlannerLimit = "7",
    drain: Drain = None,
    seed: Worlds = 0,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    store: Store = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Execute delivery plans whose durations are uncertain: coverage and re-plans, and the paper's."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, Cases, bench_table  # noqa: PLC0415 - heavy

    cases = Cases(problems, runs, tuple(parameters or ()), planner, drain, seed)
    request = BenchRequest(jobs, planner_limit, None, json, not (quiet or verbose), cluster, store)
    return bench_table(1, cases, request, guard_of(context))


@bench_app.command(short_help="Executors under uncertain consumption.")
def table2(
    context: typer.Context,
    *,
    problems: Problems = 100,
    runs: Runs = 1,
    planner: PlannerName = None,
    planner_limit: PlannerLimit = "7",
    drain: Drain = None,
    battery: Annotated[
        str | None, typer.Option("--battery", metavar="B", help="the charge at the beginning; else 520")
    ] = None,
    seed: Worlds = 0,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    store: Store = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Execute delivery plans whose consumption is uncertain: coverage and re-plans, and the paper's."""
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, Cases, bench_table  # noqa: PLC0415 - heavy

    cases = Cases(problems, runs, (), planner, drain, seed, battery)
    request = BenchRequest(jobs, planner_limit, None, json, not (quiet or verbose), cluster, store)
    return bench_table(2, cases, request, guard_of(context))


Instances = Annotated[int, typer.Option("--instances", metavar="N", help="how many random plans")]
Seed = Annotated[int, typer.Option("--seed", metavar="N", help="which random plans")]
Backends = Annotated[
    list[str] | None,
    typer.Option("--backend", metavar="NAME", help="only this one of those in the table; may be repeated"),
]


@bench_app.command(short_help="Compilation of plans with choices, by every back end.")
def figure20a(
    context: typer.Context,
    *,
    instances: Instances = 500,
    seed: Seed = 0,
    backend: Backends = None,
    jobs: Jobs = 1,
    limit: Limit = "60",
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Compile random plans with choices: time over the number of candidate subplans, for every back end."""
    return _team_plans(context, "figure20a", instances, seed, backend, jobs, limit, plot, json, quiet, verbose)


@bench_app.command(short_help="Prime implicants beside models of plans with choices.")
def figure21(
    context: typer.Context,
    *,
    instances: Instances = 500,
    seed: Seed = 0,
    jobs: Jobs = 1,
    limit: Limit = "60",
    plot: PlotFile = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Compile random plans with choices: the number of prime implicants over that of models."""
    return _team_plans(context, "figure21", instances, seed, ["pitms"], jobs, limit, plot, json, quiet, verbose)


def _team_plans(  # noqa: PLR0917 (the options of both commands)
    context: typer.Context,
    figure: str,
    instances: int,
    seed: int,
    backend: list[str] | None,
    jobs: int,
    limit: str | None,
    plot: Path | None,
    json: bool,
    quiet: bool,
    verbose: bool,
) -> int:
    configure_logging(verbose)
    with guard_of(context).working():
        from robust.report.benching import BenchRequest, bench_team_plans  # noqa: PLC0415 - heavy

    request = BenchRequest(jobs=jobs, limit=limit, plot=plot, json=json, progress=not (quiet or verbose))
    return bench_team_plans(figure, instances, seed, tuple(backend or ()), request, guard_of(context))
