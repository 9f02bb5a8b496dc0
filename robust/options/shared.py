"""Options that several questions about plans share: files, ε, solvers, limits, output."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from robust import backends
from robust.errors import InputError, Location
from robust.numbers import Number
from robust.options import declare

PARAMETERS, EPSILON, ENCODING, SOLVING, LIMIT, DRAWING, EXPORT, OUTPUT = range(1, 9)
"""Ranks."""


def separation(read: Callable[[Number, Location], Fraction]) -> Any:
    """ε, at least 0 or above it."""
    what = "separation of mutex time points, in the plan's unit of time"
    return declare.option("1/1000", what, metavar="E", read=read, rank=EPSILON)


class Separation(declare.Options):
    """ε."""

    epsilon: Number = separation(declare.not_negative)

    @property
    def separation(self) -> Fraction:
        """ε as a number."""
        return Fraction(self.epsilon)


class PlanningOutput(declare.Options):
    """The plan that is meant in a planner's output, and how exact its numbers are."""

    plan_number: int | None = declare.option(
        None,
        "number of the plan in a log that holds several, from 1; default: the last",
        metavar="N",
        read=declare.ordinal,
        rank=EPSILON,
    )
    tolerance: Number | None = declare.option(
        None,
        "how far exact times and durations may differ from printed ones, 0 for exactness; default: one unit of the "
        "last printed digit, and at most epsilon",
        metavar="T",
        read=declare.not_negative,
        rank=EPSILON,
    )

    @property
    def rounding(self) -> Fraction | None:
        """The tolerance as a number, or None for what printed digits say."""
        return None if self.tolerance is None else Fraction(self.tolerance)


class FromSteps(PlanningOutput):
    """How steps of a planner become a network."""

    mode: str = declare.option(
        "room",
        "how steps become a network: room: all room goes to the parameters, durations are as planned; causal: the "
        "least constrained network that is proved at nominal values; esterel: that of the Esterel transformer",
        choices=backends.CONVERSIONS,
        rank=EPSILON,
    )
    free_durations: bool = declare.option(
        False,
        "let durations vary that the domain leaves open, instead of those of the plan",
        needs=("mode", ("room",)),
        rank=EPSILON,
    )


class Limited(declare.Options):
    """A time limit."""

    timeout: Number | None = declare.option(
        None, "time limit in seconds; the answer is then what is known", metavar="S", read=declare.seconds, rank=LIMIT
    )

    @property
    def limit(self) -> float | None:
        """Seconds, or None without a limit."""
        return None if self.timeout is None else float(self.timeout)


class Solver(declare.Options):
    """The solver."""

    solver: str = declare.option("z3", "SMT solver", choices=backends.SOLVERS, rank=SOLVING)


class Solving(Solver, Limited):
    """The solver and the time limit."""


def encoding_option(rank: int = ENCODING) -> Any:
    """The option for encoding the plan as formulas."""
    return declare.option("relational", "how the plan is encoded as formulas", choices=backends.ENCODINGS, rank=rank)


class Encoded(declare.Options):
    """The encoding."""

    encoding: str = encoding_option()


def method_option(**others: str) -> Any:
    """The option for the method that finds a box; `others` are more methods, with what they find."""
    known = {
        "widen": "exact, no valid box contains the result",
        "irr": "step by step, up to a precision (IRR)",
        "optimal": "exact, the greatest total width of all boxes, which CCMMZ asks for",
        **others,
    }
    return declare.option("widen", "; ".join(f"{name}: {what}" for name, what in known.items()), choices=known)


def shape_option(default: str, introduction: str = "", needs: tuple[str, tuple[str, ...]] | None = None) -> Any:
    """The option for the template of a shape."""
    return declare.option(
        default,
        f"{introduction}octagon: bounds on sums and differences of two parameters; FILE: bounds on the linear forms in "
        "its lines, such as a + 2 b; it is proved by the exact region",
        metavar="SHAPE",
        needs=needs,
    )


_FOR_IRR = ("method", ("irr",))


class BoxOptions(declare.Options):
    """Options for finding a box around the nominal values."""

    method: str = method_option()
    beta: Number | None = declare.option(
        None,
        "for irr: no end of a complete box can move outwards by B; 1 if not given",
        metavar="B",
        read=declare.positive,
        needs=_FOR_IRR,
    )
    doubling: bool = declare.option(
        False, "for irr: steps double until the first failure; ends are up to 2 B away", needs=_FOR_IRR
    )

    @property
    def precision(self) -> Fraction:
        """β, of which methods other than irr make nothing."""
        return Fraction(self.beta or 1)


class AnyBoxOptions(BoxOptions):
    """Options for finding a box of a plan, wherever it lies."""

    contain_nominal: bool = declare.option(
        False, "for optimal: only boxes around the nominal values", needs=("method", ("optimal",))
    )
    order: str | Sequence[str] | None = declare.option(
        None,
        "the order in which parameters take turns (irr), or are widened one after the other (widen)",
        metavar="A,B,C",
        read=declare.names,
        needs=("method", ("widen", "irr")),
    )

    @property
    def from_nominal(self) -> bool:
        """Whether the box is to be around the nominal values."""
        return self.method != "optimal" or self.contain_nominal


class SearchOptions(Separation, Encoded, Solving):
    """Options of every question about a plan."""


class Force(declare.Options):
    """Permission to overwrite files that no option names: those in a folder, or beside a file, that one names."""

    force: bool = declare.option(False, "overwrite existing files that no option names", rank=EXPORT)


class Export(Force):
    """Queries as files."""

    smt2: str | Path | None = declare.path_option(
        "write every query to DIR as SMT-LIB", metavar="DIR", also=lambda folder: folder.glob("*.smt2"), rank=EXPORT
    )


class Colored(declare.Options):
    """An answer for people."""

    color: str = declare.option(
        "auto",
        "auto: on a terminal, respecting NO_COLOR and FORCE_COLOR; always and never: regardless of both",
        choices=("auto", "always", "never"),
        rank=OUTPUT,
    )


class Json(Colored):
    """An answer for programs."""

    json: bool = declare.option(False, "print one JSON object on stdout", rank=OUTPUT)


class Output(Json):
    """Options for the form of a command's answer."""

    quiet: bool = declare.option(
        False, "only the answer: no progress, no notes, no warnings", "--quiet", "-q", rank=OUTPUT
    )
    verbose: bool = declare.option(False, "log each step on stderr", "--verbose", "-v", rank=OUTPUT)


class Plot(declare.Options):
    """A picture."""

    plot: Path | None = declare.path_option(
        "draw the result: .svg, .png or .pdf by suffix", read=declare.plot_file, rank=DRAWING
    )


class SliceOptions(Plot):
    """A picture of one or two parameters."""

    axes: str | Sequence[str] | None = declare.option(
        None,
        "the one or two parameters to draw; the others have their nominal values",
        metavar="A,B",
        read=declare.names,
        rank=DRAWING,
    )


class Planning(declare.Options):
    """The files of the planning problem."""

    domain: Path = declare.argument(..., "PDDL domain", "DOMAIN")
    problem: Path = declare.argument(..., "PDDL problem", "PROBLEM")


class PlanFiles(Planning):
    """The files of the planning problem and the plan."""

    plan: Path = declare.argument(
        ..., "network (.stn), time-triggered plan or log of a planner; - is standard input", "PLAN"
    )


port = declare.whole_number(lambda number: 0 <= number < 1 << 16, "a port from 0 to 65535")


class Paged(declare.Options):
    """A page that shows what runs."""

    page: int | None = declare.option(
        None, "show the run on a page at http://127.0.0.1:PORT; 0 takes any free port", metavar="PORT", read=port
    )
    page_host: str = declare.option(
        "127.0.0.1",
        "with --page: the address it is served at; 0.0.0.0 shows it to all who can reach this machine",
        metavar="HOST",
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if "page_host" in given and self.page is None:
            raise InputError("expected only together with --page", declare.place_of("page_host"))
        super().check_combinations(given)


class Demands(declare.Options):
    """What is asked of a plan in addition to what it says."""

    deadline: Number | None = declare.option(
        None,
        "every action must end by T, or, with +P%, by P per cent after the planned end; later schedules are invalid",
        metavar="T",
        rank=PARAMETERS,
    )
    widths: str = declare.option(
        "equal",
        "sides of boxes move at equal speed, or relative to the nominal values of their parameters",
        choices=("equal", "relative"),
        rank=PARAMETERS,
    )

    @property
    def relative(self) -> bool:
        """Whether weights are in proportion to nominal values."""
        return self.widths == "relative"


class MoreParameters(declare.Options):
    """Parameters in addition to those that the plan declares."""

    parameter: tuple[str, ...] = declare.option(
        (),
        "make a quantity a parameter: duration:* for all actions that take time, duration:ACTION or "
        "'duration:(drive r1 a b)' for all their instances, duration:ID, shared:ACTION for one of all instances, "
        "start:ID, 'fluent:(f a)', or NAME of an existing one; then ,weight=W ,lb=L ,ub=U ,default=D; may be repeated",
        "--parameter",
        "--parametrize",
        metavar="SPEC",
        many=True,
        rank=PARAMETERS,
    )
    parameters: Path | None = declare.path_option(
        "more parameters, in a TOML file; default: PLAN.toml beside PLAN.stn", rank=PARAMETERS
    )


class PlanParameters(MoreParameters, Demands):
    """The parameters of a plan, and what is asked of it in addition to what it says."""


class AskCommand(PlanFiles, FromSteps, PlanParameters, Separation, Solving, Output):
    """Options of every question about a plan on the command line."""


def distributions_option(needs: tuple[str, tuple[str, ...]] | None = None) -> Any:
    """The option for the distributions of parameters."""
    return declare.option(
        (),
        "how parameters are distributed; NAME is a parameter, an action, a ground action, a step or * for all, "
        "the most precise one counts, and parameters without a rule are as planned. KIND:... is normal:MEAN:DEVIATION, "
        "truncated-normal:MEAN:DEVIATION:MINIMUM:MAXIMUM, half-normal:ORIGIN:DEVIATION, uniform:LOWER:UPPER, "
        "triangular:LOWER:MODE:UPPER, exponential:MEAN, empirical:VALUE,VALUE,... or constant:VALUE; an empty mean, "
        "mode, origin or value is the planned one, and 15% is a share of it; may be repeated",
        "--distribution",
        metavar="NAME=KIND:...",
        many=True,
        needs=needs,
    )


def world_file(needs: tuple[str, tuple[str, ...]] | None = None) -> Any:
    """Distributions in a file."""
    return declare.path_option(
        "the distributions of parameters and durations, in a TOML file; without a rule, parameters are as planned",
        needs=needs,
    )
