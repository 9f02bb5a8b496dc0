"""Arguments and options that several commands share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Solver(StrEnum):
    """Which solver is asked."""

    Z3 = "z3"
    CVC5 = "cvc5"


class Encoding(StrEnum):
    """How the plan becomes formulas."""

    RELATIONAL = "relational"
    POSITIONS = "positions"


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
