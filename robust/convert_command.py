"""The command `robust convert`: its options. What it computes is in :mod:`robust.execute.convert`."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from robust.report.guard import Guard


class ConversionMode(StrEnum):
    """How the network is made."""

    CAUSAL = "causal"
    ESTEREL = "esterel"


class ConversionSolver(StrEnum):
    """Which solver proves it."""

    Z3 = "z3"
    CVC5 = "cvc5"


def register(
    app: typer.Typer, guard_of: Callable[[typer.Context], Guard], configure_logging: Callable[[bool], None], epilog: str
) -> None:
    """Add the command to an application; `guard_of` finds the guard of a run, `configure_logging` heeds --verbose."""

    @app.command(epilog=epilog, short_help="Make a flexible plan of a planner's output.")
    def convert(
        context: typer.Context,
        domain: Annotated[Path, typer.Argument(metavar="DOMAIN", help="PDDL domain", show_default=False)],
        problem: Annotated[Path, typer.Argument(metavar="PROBLEM", help="PDDL problem", show_default=False)],
        plan: Annotated[
            Path, typer.Argument(metavar="TIMED_PLAN", help="steps as planners print them", show_default=False)
        ],
        *,
        output: Annotated[
            Path | None,
            typer.Option("--output", "-o", metavar="PLAN.stn", help="write the plan here instead of on stdout"),
        ] = None,
        mode: Annotated[
            ConversionMode,
            typer.Option(
                "--mode",
                help="causal: the least constrained network that is proved valid; "
                "esterel: the network of the Esterel transformer",
            ),
        ] = ConversionMode.CAUSAL,
        parametrize: Annotated[
            list[str] | None,
            typer.Option(
                "--parametrize",
                metavar="SPEC",
                help="make a quantity a parameter: duration:ACTION, duration:ID, start:ID or 'fluent:(f a)'; "
                "then ,weight=W ,lb=L ,ub=U; may be repeated",
            ),
        ] = None,
        epsilon: Annotated[
            str,
            typer.Option("--epsilon", metavar="E", help="separation of mutex time points, in the plan's unit of time"),
        ] = "1/1000",
        solver: Annotated[
            ConversionSolver, typer.Option("--solver", help="the solver that is asked")
        ] = ConversionSolver.Z3,
        timeout: Annotated[
            str | None, typer.Option("--timeout", metavar="S", help="seconds after which nothing more is proved")
        ] = None,
        json: Annotated[bool, typer.Option("--json", help="print one JSON object on stdout")] = False,
        quiet: Annotated[bool, typer.Option("--quiet", "-q", help="only the answer, no progress")] = False,
        verbose: Annotated[bool, typer.Option("--verbose", "-v", help="log what is done on stderr")] = False,
    ) -> int:
        """Make a plan with a temporal network of a time-triggered plan, and prove it; steps are called n0, n1, ..."""
        configure_logging(verbose)
        with guard_of(context).working():
            from robust.report.converting import ConvertRequest, run_convert  # noqa: PLC0415 - heavy

        request = ConvertRequest(
            files=(domain, problem, plan),
            output=output,
            mode=mode.value,
            specs=tuple(parametrize or ()),
            epsilon=epsilon,
            solver=solver.value,
            timeout=timeout,
            json=json,
            quiet=quiet,
            progress=not (quiet or verbose),
        )
        return run_convert(request, guard_of(context))
