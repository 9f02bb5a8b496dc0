"""Options of questions about plans: those of the functions, and those that only their commands have.

First those that several questions share: files, ε, solvers, limits, output.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust import backends
from robust.errors import InputError, Location
from robust.numbers import Number, exact, shorten
from robust.options import declare

if TYPE_CHECKING:
    from robust.irr.quantities import Cost
    from robust.irr.search import EnvelopeResult, Step
    from robust.probability.distributions import Distribution
    from robust.probability.measure import Bounds
    from robust.qe.box import Box
    from robust.qe.polyhedron import Polyhedron


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
        None, "time limit in seconds; the result so far is printed then", metavar="S", read=declare.seconds, rank=LIMIT
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
    def precision(self) -> Fraction | None:
        """β, for methods that have one."""
        return Fraction(self.beta or 1) if self.method == "irr" else None


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


WIDTHS = ("equal", "relative")


def port(value: int | str, place: Location) -> int:
    """InputError unless it can be the number of a port."""
    number = exact(value, place)
    if number.denominator != 1 or not 0 <= number < 1 << 16:
        raise InputError(f"found {shorten(str(value))}, expected a port from 0 to 65535", place)
    return int(number)


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
        choices=WIDTHS,
        rank=PARAMETERS,
    )

    @property
    def relative(self) -> bool:
        """Whether weights are in proportion to nominal values."""
        return self.widths == "relative"


class PlanParameters(Demands):
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


class AskCommand(PlanFiles, FromSteps, PlanParameters, Separation, Solving, Output):
    """Options of every question about a plan on the command line."""


def lag_option() -> Any:
    """The option for how late a tree's executor is."""
    return declare.option(
        None,
        "for --tree: nodes of the tree begin at most T after all that they wait for, in the plan's unit of time; "
        "default: any time after",
        metavar="T",
        read=declare.not_negative,
    )


class CheckOptions(SearchOptions, Export):
    """Options of :func:`robust.check`."""

    tree: str | Path | None = declare.path_option(
        "decide about the executions of a behavior tree of PlanSys2, in XML, instead of the schedules that the network "
        "of the plan allows"
    )
    lag: Number | None = lag_option()
    within: str | None = declare.option(
        None,
        "for --tree: plan: also decide whether the executions are all schedules of the plan's network",
        choices=("plan",),
    )

    at: declare.Settings | Box | EnvelopeResult = declare.option(
        (),
        "value of a parameter instead of its nominal one, or NAME=LOW:HIGH for all values between; duration:ACTION "
        "means all parameters that are durations of the action, and @FILE the lines of a file; may be repeated",
        metavar="NAME=VALUE",
        many=True,
    )
    every: bool = declare.option(False, "examine all obligations instead of stopping at the first that breaks", "--all")
    on_obligation: Callable[[int, int, str], None] | None = declare.option(
        None, "called with the number of obligations examined, their total, and the name of the next", shown=False
    )

    @property
    def latest(self) -> Fraction | None:
        """How late nodes of a tree begin at most."""
        return None if self.lag is None else Fraction(self.lag)

    def check_combinations(self, given: Collection[str]) -> None:
        for name in ("lag", "within"):
            if self.tree is None and getattr(self, name) is not None:
                raise InputError("needs --tree FILE", declare.place_of(name))
        if self.tree is not None and self.encoding != "relational":
            raise InputError("cannot be combined with --encoding positions; leave one out", declare.place_of("tree"))


class CheckCommand(CheckOptions, AskCommand):
    """Options of `robust check`."""


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


_FOR_RISK = ("method", ("risk",))


class EnvelopeOptions(Separation, Solving, Export, AnyBoxOptions):
    """Options of :func:`robust.envelope`."""

    method: str = method_option(risk="the most probable box")
    distribution: Mapping[str, str | Distribution] | Sequence[str] = distributions_option(_FOR_RISK)
    world: str | Path | None = world_file(_FOR_RISK)
    within: Number = declare.option(
        "0.005",
        "for risk: search until no box can be more probable by more than this",
        metavar="W",
        read=declare.positive,
        needs=_FOR_RISK,
    )
    encoding: str = encoding_option(rank=0)
    shape: str = shape_option("box", "also widen a shape around the box: ")
    on_step: Callable[[Step], None] | None = declare.option(
        None, "called after each step with the best box so far", shown=False
    )


EXPORTS = ("plansys2", "csv", "yaml")
"""Files that other tools read."""


class EnvelopeCommand(EnvelopeOptions, Plot, AskCommand):
    """Options of `robust envelope`."""

    export: str | None = declare.option(
        None,
        "print the result for other tools instead: by how many per cent actions may take longer, for PlanSys2's "
        "executor; or parameters and intervals as CSV or YAML",
        choices=EXPORTS,
        rank=DRAWING,
    )
    output: Path | None = declare.output_option(
        "for --export: write the export to FILE, and print the answer as usual",
        read=declare.written_to("the export"),
        rank=DRAWING,
    )

    controllability: str | None = declare.option(
        None,
        "decide whether a dispatcher can execute the plan when values are seen only on observation (dynamic) or never "
        "(strong); report the controllable part of the box, and the widest controllable box",
        choices=("weak", "dynamic", "strong"),
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.output is not None and self.export is None:
            raise InputError(f"needs --export {', '.join(EXPORTS[:-1])} or {EXPORTS[-1]}", declare.place_of("output"))
        if self.export is not None and self.output is None and self.json:
            raise InputError("needs --output FILE when combined with --json", declare.place_of("export"))
        if self.export == "plansys2" and not self.from_nominal:
            needed = "--contain-nominal, or another method than optimal: percentages are of planned durations"
            raise InputError(f"plansys2 needs {needed}", declare.place_of("export"))


class EliminationOptions(declare.Options):
    """Options for computing an exact region."""

    backend: str = declare.option("project", "quantifier-elimination back end", choices=backends.OFFERED)
    splitting: str = declare.option(
        "full",
        "elimination problems: monolithic: one; partial: one for the network and one for all obligations; full: one "
        "for each obligation",
        choices=backends.SPLITTINGS,
    )
    learning: bool = declare.option(True, "let later elimination problems use what earlier ones have excluded")


class RegionOptions(EliminationOptions, SearchOptions):
    """Options of :func:`robust.region`."""

    on_piece: Callable[[Polyhedron], None] | None = declare.option(
        None, "called with each polyhedron of bad parameter values when it is found", shown=False
    )
    on_cell: Callable[[Polyhedron], None] | None = declare.option(
        None, "called with each polyhedron of good parameter values when it is found", shown=False
    )


class RegionCommand(RegionOptions, SliceOptions, AskCommand):
    """Options of `robust region`."""

    form: str | None = declare.option(
        None,
        "a union of polyhedra, or the difference of one polyhedron and others; default: a union, unless it is long",
        choices=("union", "difference"),
    )
    latex: bool = declare.option(False, "print a formula for LaTeX's math mode")

    def check_combinations(self, given: Collection[str]) -> None:
        if self.latex and self.json:
            raise InputError("cannot be combined with --json; choose one", Location("--latex"))


class CompareOptions(SearchOptions):
    """Options of :func:`robust.compare`."""

    beta: Number = declare.option("1", "the precision of irr", metavar="B", read=declare.positive)
    doubling: bool = declare.option(False, "steps of irr double until the first failure; ends are up to 2 B away")
    on_stage: Callable[[str], None] | None = declare.option(None, "called with the name of each stage", shown=False)


class CompareCommand(CompareOptions, SliceOptions, AskCommand):
    """Options of `robust compare`."""

    html: Path | None = declare.path_option(
        "write an interactive page as one HTML file: sliders for the parameters, what breaks where, boxes, schedule",
        read=declare.written_to("the page"),
        rank=DRAWING,
    )


class RiskOptions(SearchOptions):
    """Options of :func:`robust.risk`."""

    distributions: Mapping[str, str | Distribution] | Sequence[str] = distributions_option()
    factor: Sequence[str] = declare.option(
        (),
        "what durations share: weather*drive,fly=KIND:... multiplies those of these actions by a random number, "
        "weather+drive=KIND:... adds one; names and kinds as for --distribution; may be repeated",
        metavar="NAME*ACTION,...=KIND:...",
        many=True,
    )
    world: str | Path | None = world_file()
    within: Number = declare.option(
        "0.001", "how close the bounds of the probability must be", metavar="W", read=declare.positive
    )
    draws: int | None = declare.option(
        None,
        "also estimate from N random samples; default: 10000 where longest paths decide about the plan, and with more "
        "than 6 parameters if the bounds are not close",
        metavar="N",
        read=declare.ordinal,
    )
    on_bounds: Callable[[Bounds], None] | None = declare.option(
        None, "called with bounds that have changed", shown=False
    )
    on_stage: Callable[[str], None] | None = declare.option(None, "called with the name of each stage", shown=False)


class RiskCommand(RiskOptions, Plot, AskCommand):
    """Options of `robust risk`."""

    def check_combinations(self, given: Collection[str]) -> None:
        if not self.distributions and not self.factor and self.world is None:
            raise InputError("say by --distribution or --world how the parameters are distributed")


class RepairOptions(Separation, Solving):
    """Options of :func:`robust.repair`."""

    require: declare.Settings | Box | EnvelopeResult = declare.option(
        (),
        "values of a parameter for all of which the plan must be valid, NAME=LOW:HIGH or NAME=VALUE; other parameters "
        "have their nominal values; duration:ACTION means all parameters that are durations of the action, and @FILE "
        "the lines of a file; may be repeated",
        metavar="NAME=LOW:HIGH",
        many=True,
    )
    change: str = declare.option(
        "bounds",
        "what may change: bounds of the plan's network, nominal values of parameters that are not required, or both",
        choices=("bounds", "nominal", "both"),
    )
    count: bool = declare.option(
        False, "minimize the number of changes first, then the sum of weighted amounts; default: the sum alone"
    )
    reorder: bool = declare.option(False, "allow changes that reverse the order of two time points")
    on_repair: Callable[[Cost], None] | None = declare.option(
        None, "called with the cost of each better repair", shown=False
    )


class RepairCommand(RepairOptions, AskCommand):
    """Options of `robust repair`."""

    output: Path | None = declare.output_option(
        "write the repaired plan to this file; PLAN must then be the file of a network (.stn)",
        metavar="PLAN.stn",
        read=declare.plan_file,
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.output is not None and str(self.plan) == "-":
            raise InputError("needs PLAN in a file, not on standard input", declare.place_of("output"))


class RankOptions(PlanParameters, Separation, Solving):
    """Options of :func:`robust.rank`."""

    parameter: tuple[str, ...] = declare.option(
        ("duration:*",),
        "what deviates: duration:* for all actions that take time, or what other commands take; may be repeated",
        "--parameter",
        "--parametrize",
        metavar="SPEC",
        many=True,
        rank=PARAMETERS,
    )
    deadline: Number = declare.option(
        "+10%",
        "every plan must end by T, or for +P% by P per cent after the last of them ends as planned",
        metavar="T",
        rank=PARAMETERS,
    )
    distribution: Sequence[str] = distributions_option()
    world: str | Path | None = world_file()
    on_plan: Callable[[str], None] | None = declare.option(
        None, "called with the name of each plan that is asked about", shown=False
    )


class RankCommand(RankOptions, Planning, Output):
    """Options of `robust rank`."""

    plans: tuple[Path, ...] = declare.argument(
        ...,
        "networks (.stn), time-triggered plans or logs of planners, each with one plan or several",
        "PLAN",
        many=True,
    )


class LearnOptions(declare.Options):
    """Options of :func:`robust.learn`."""

    cover: Number = declare.option(
        "0.95", "share of future runs that a limit covers", metavar="P", read=declare.proper_share
    )
    confidence: Number = declare.option("0.95", "confidence with which it does", metavar="C", read=declare.proper_share)
    pool: bool = declare.option(False, "take all ground instances of an action together")
    domain: str | Path | None = declare.path_option("PDDL domain; logs may contain no other actions")


class LearnCommand(LearnOptions, Output):
    """Options of `robust learn`."""

    logs: tuple[Path, ...] = declare.argument(
        ...,
        "logs in the order of time: CSV, messages of PlanSys2's ActionExecutionInfo, output of robust execute --json, "
        "or journals of robust pike run",
        "LOG",
        many=True,
    )
    output: Path | None = declare.output_option(
        "write the observed durations as distributions, for --world of other commands",
        metavar="WORLD.toml",
        read=declare.written_to("the world"),
        rank=DRAWING,
    )
    as_box: bool = declare.option(
        False, "print only the promised intervals, for --at @FILE and --require @FILE", rank=DRAWING
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.as_box and self.json:
            raise InputError("cannot be combined with --json; choose one", Location("--as-box"))


class ValidateOptions(Separation, PlanningOutput):
    """Options of :func:`robust.validate`."""


class ValidateCommand(ValidateOptions, Output):
    """Options of `robust validate`."""

    domain: Path | None = declare.argument(None, "PDDL domain", "DOMAIN")
    problem: Path | None = declare.argument(None, "PDDL problem", "PROBLEM")
    plans: tuple[Path, ...] = declare.argument(
        (), "time-triggered plans or logs of planners; - is standard input", "PLAN", many=True
    )
    suite: Path | None = declare.path_option(
        "judge the plans listed in FILE: DOMAIN PROBLEM PLAN on each line, relative to FILE; # begins a comment",
        "--list",
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if (self.suite is None and not self.plans) or (self.suite is not None and self.domain is not None):
            fault = "no plan is named" if self.suite is None else "files cannot be combined with --list"
            raise InputError(f"{fault}; give DOMAIN PROBLEM PLAN..., or --list FILE")
