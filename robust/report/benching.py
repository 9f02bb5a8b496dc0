"""`robust bench`: runs benchmarks and prints their reports."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from robust.errors import Location
from robust.numbers import parse_number
from robust.report import options
from robust.report.guard import UNDECIDED, Guard
from robust.report.output import answering, print_json
from robust.report.progress import Display
from robust.report.terminal import console

if TYPE_CHECKING:
    from rich.table import Table


class Report(Protocol):
    """What every benchmark returns."""

    @property
    def agrees(self) -> bool: ...
    @property
    def complete(self) -> bool: ...
    def as_dict(self) -> dict[str, Any]: ...
    def tables(self) -> Sequence[Table]: ...


@dataclass(frozen=True)
class BenchRequest:
    """The options as they were typed."""

    jobs: int = 1
    limit: str | None = None
    plot: Path | None = None
    json: bool = False
    progress: bool = False
    cluster: str | None = None
    store: Path | None = None


@dataclass(frozen=True)
class Cases:
    """Which cases of the execution experiments."""

    problems: int
    runs: int
    columns: tuple[int, ...]
    planner: str | None
    drain: bool | None
    seed: int
    battery: str | None = None


def bench_recorded(suite: Path, request: BenchRequest, guard: Guard) -> int:
    """Run a data set beside its recorded runs."""
    from robust.bench.recorded import run_recorded  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    plot = options.plot_file(request.plot)
    return _run(
        request,
        guard,
        lambda display: run_recorded(suite, jobs=request.jobs, limit=limit, plot=plot, on_result=display.batch),
    )


def bench_scaling(request: BenchRequest, guard: Guard) -> int:
    """Run generated instances of growing size."""
    from robust.bench.scaling import run_scaling  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    plot = options.plot_file(request.plot)
    return _run(
        request,
        guard,
        lambda display: run_scaling(jobs=request.jobs, limit=limit, plot=plot, on_result=display.batch),
    )


def bench_figure3(suite: Path, request: BenchRequest, guard: Guard) -> int:
    """Run every method on a data set, beside its recorded runs."""
    from robust.bench.figure3 import run_figure3  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    plot = options.plot_file(request.plot)
    return _run(
        request,
        guard,
        lambda display: run_figure3(suite, jobs=request.jobs, limit=limit, plot=plot, on_result=display.batch),
    )


def bench_figure5(suite: Path, request: BenchRequest, guard: Guard) -> int:
    """Run IRR on a data set and follow its convergence."""
    from robust.bench.figure5 import run_figure5  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    plot = options.plot_file(request.plot)
    return _run(
        request,
        guard,
        lambda display: run_figure5(suite, jobs=request.jobs, limit=limit, plot=plot, on_result=display.batch),
    )


def bench_backends(request: BenchRequest, guard: Guard) -> int:
    """Run every elimination back end on generated plans."""
    from robust.bench.growth import run_backends  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    plot = options.plot_file(request.plot)
    return _run(
        request,
        guard,
        lambda display: run_backends(jobs=request.jobs, limit=limit, plot=plot, on_result=display.batch),
    )


def bench_encodings(request: BenchRequest, guard: Guard) -> int:
    """Run both encodings on generated plans."""
    from robust.bench.growth import run_encodings  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    plot = options.plot_file(request.plot)
    return _run(
        request,
        guard,
        lambda display: run_encodings(jobs=request.jobs, limit=limit, plot=plot, on_result=display.batch),
    )


def bench_team_plans(  # noqa: PLR0917 (what the commands were told)
    figure: str, instances: int, seed: int, backends: tuple[str, ...], request: BenchRequest, guard: Guard
) -> int:
    """Compile random plans with choices by every back end, or only by those named."""
    from robust.bench.team_plans import chosen, run_team_plans  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    plot = options.plot_file(request.plot)
    contenders = chosen(backends)
    return _run(
        request,
        guard,
        lambda display: run_team_plans(
            figure=figure,
            contenders=contenders,
            instances=instances,
            seed=seed,
            limit=limit,
            jobs=request.jobs,
            plot=plot,
            on_result=display.batch,
        ),
    )


def bench_figure20b(problems: int, seed: int, backends: tuple[str, ...], request: BenchRequest, guard: Guard) -> int:
    """Execute random plans with choices by every back end, or only by those named."""
    from robust.bench.figure20b import chosen, run_figure20b  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    plot = options.plot_file(request.plot)
    names = chosen(backends)
    return _run(
        request,
        guard,
        lambda display: run_figure20b(
            backends=names,
            problems=problems,
            seed=seed,
            limit=limit,
            jobs=request.jobs,
            plot=plot,
            on_result=display.batch,
        ),
    )


def bench_k_intents(  # noqa: PLR0917 (what the commands were told)
    figure: str, problems: int, seed: int, largest: int, reasoner: str, request: BenchRequest, guard: Guard
) -> int:
    """Execute k-intents problems by PIKE and by Kirk."""
    from robust.bench.k_intents import run_k_intents  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    plot = options.plot_file(request.plot)
    return _run(
        request,
        guard,
        lambda display: run_k_intents(
            figure=figure,
            problems=problems,
            seed=seed,
            largest=largest,
            reasoner=reasoner,
            limit=limit,
            jobs=request.jobs,
            cluster=request.cluster,
            store=request.store,
            plot=plot,
            on_result=display.batch,
        ),
    )


def bench_figure4(suite: Path | None, baseline_limit: str | None, request: BenchRequest, guard: Guard) -> int:
    """Run every method on the delivery plans."""
    from robust.bench.figure4 import run_figure4  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    others = options.seconds(baseline_limit, "--baseline-limit")
    plot = options.plot_file(request.plot)
    return _run(
        request,
        guard,
        lambda display: run_figure4(
            suite,
            limit=limit,
            baseline_limit=others,
            jobs=request.jobs,
            cluster=request.cluster,
            store=request.store,
            plot=plot,
            on_result=display.batch,
        ),
    )


def bench_conversions(  # noqa: PLR0917 (what the command was told)
    drawn: int, delivery: int, planned: int, planner: str, seed: int, request: BenchRequest, guard: Guard
) -> int:
    """Convert plans and judge what is left in them."""
    from robust.bench.conversions import run_conversions  # noqa: PLC0415 - only what is asked for

    limit = options.seconds(request.limit, "--limit")
    return _run(
        request,
        guard,
        lambda display: run_conversions(
            drawn=drawn,
            delivery=delivery,
            planned=planned,
            planner=planner,
            seed=seed,
            limit=limit,
            jobs=request.jobs,
            cluster=request.cluster,
            store=request.store,
            on_result=display.batch,
        ),
    )


def bench_table(table: int, cases: Cases, request: BenchRequest, guard: Guard) -> int:
    """Run every executor on the delivery problems."""
    from robust.bench.execution_runs import BATTERY, run_table  # noqa: PLC0415 - only what is asked for
    from robust.execute.replan import PLANNER_SECONDS  # noqa: PLC0415

    planner_s = options.seconds(request.limit, "--planner-limit") or PLANNER_SECONDS
    battery = BATTERY if cases.battery is None else parse_number(cases.battery, Location("--battery"))
    return _run(
        request,
        guard,
        lambda display: run_table(
            table,
            problems=cases.problems,
            runs=cases.runs,
            columns=cases.columns or None,
            planner=cases.planner,
            planner_s=planner_s,
            drain=cases.drain,
            battery=battery,
            seed=cases.seed,
            jobs=request.jobs,
            cluster=request.cluster,
            store=request.store,
            on_result=display.batch,
        ),
    )


def _run(request: BenchRequest, guard: Guard, work: Callable[[Display], Report]) -> int:
    guard.hand_over()
    with Display(shown=request.progress, what="running") as display:
        report = work(display)
    if request.json:
        print_json(report.as_dict())
    else:
        with answering():
            out = console()
            for table in report.tables():
                out.print(table, markup=True)
    if not report.complete:
        return UNDECIDED
    return 0 if report.agrees else 1
