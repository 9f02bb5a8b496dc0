"""Options of questions about plans: those of the functions, and those that only their commands have."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust import backends
from robust.errors import InputError, Location
from robust.numbers import Number
from robust.options import declare, shared

if TYPE_CHECKING:
    from robust.irr.quantities import Cost
    from robust.irr.search import EnvelopeResult, Step
    from robust.probability.distributions import Distribution
    from robust.probability.measure import Bounds
    from robust.qe.box import Box
    from robust.qe.polyhedron import Polyhedron


def lag_option() -> Any:
    """The option for how late a tree's executor is."""
    return declare.option(
        None,
        "for --tree: nodes of the tree begin at most T after all that they wait for, in the plan's unit of time; "
        "default: any time after",
        metavar="T",
        read=declare.not_negative,
    )


class CheckOptions(shared.SearchOptions, shared.Export):
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
    on_obligation: Callable[[int, int, str], None] | None = declare.callback(
        "called with the number of obligations examined, their total, and the name of the next"
    )

    def check_combinations(self, given: Collection[str]) -> None:
        for name in ("lag", "within"):
            if self.tree is None and getattr(self, name) is not None:
                raise InputError("needs --tree FILE", declare.place_of(name))
        if self.tree is not None and self.encoding != "relational":
            raise InputError("cannot be combined with --encoding positions; leave one out", declare.place_of("tree"))


class CheckCommand(CheckOptions, shared.AskCommand):
    """Options of `robust check`."""


_FOR_RISK = ("method", ("risk",))


class EnvelopeOptions(shared.Separation, shared.Solving, shared.Export, shared.AnyBoxOptions):
    """Options of :func:`robust.envelope`."""

    method: str = shared.method_option(risk="the most probable box")
    distribution: Mapping[str, str | Distribution] | Sequence[str] = shared.distributions_option(_FOR_RISK)
    world: str | Path | None = shared.world_file(_FOR_RISK)
    within: Number = declare.option(
        "0.005",
        "for risk: search until no box can be more probable by more than this",
        metavar="W",
        read=declare.positive,
        needs=_FOR_RISK,
    )
    encoding: str = shared.encoding_option(rank=0)
    shape: str = shared.shape_option("box", "also widen a shape around the box: ")
    on_step: Callable[[Step], None] | None = declare.callback("called after each step with the best box so far")


EXPORTS = ("plansys2", "csv", "yaml")
"""Files that other tools read."""


class EnvelopeCommand(EnvelopeOptions, shared.Plot, shared.AskCommand):
    """Options of `robust envelope`."""

    export: str | None = declare.option(
        None,
        "print the result for other tools instead: by how many per cent actions may take longer, for PlanSys2's "
        "executor; or parameters and intervals as CSV or YAML",
        choices=EXPORTS,
        rank=shared.DRAWING,
    )
    output: Path | None = declare.output_option(
        "for --export: write the export to FILE, and print the answer as usual",
        read=declare.written_to("the export"),
        rank=shared.DRAWING,
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


class RegionOptions(EliminationOptions, shared.SearchOptions):
    """Options of :func:`robust.region`."""

    on_piece: Callable[[Polyhedron], None] | None = declare.callback(
        "called with each polyhedron of bad parameter values when it is found"
    )
    on_cell: Callable[[Polyhedron], None] | None = declare.callback(
        "called with each polyhedron of good parameter values when it is found"
    )


class RegionCommand(RegionOptions, shared.SliceOptions, shared.AskCommand):
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


class CompareOptions(shared.SearchOptions):
    """Options of :func:`robust.compare`."""

    beta: Number = declare.option("1", "the precision of irr", metavar="B", read=declare.positive)
    doubling: bool = declare.option(False, "steps of irr double until the first failure; ends are up to 2 B away")
    on_stage: Callable[[str], None] | None = declare.callback("called with the name of each stage")


class CompareCommand(CompareOptions, shared.SliceOptions, shared.AskCommand):
    """Options of `robust compare`."""

    html: Path | None = declare.path_option(
        "write an interactive page as one HTML file: sliders for the parameters, what breaks where, boxes, schedule",
        read=declare.written_to("the page"),
        rank=shared.DRAWING,
    )


class RiskOptions(shared.SearchOptions):
    """Options of :func:`robust.risk`."""

    distributions: Mapping[str, str | Distribution] | Sequence[str] = shared.distributions_option()
    factor: Sequence[str] = declare.option(
        (),
        "what durations share: weather*drive,fly=KIND:... multiplies those of these actions by a random number, "
        "weather+drive=KIND:... adds one; names and kinds as for distributions; may be repeated",
        metavar="NAME*ACTION,...=KIND:...",
        many=True,
    )
    world: str | Path | None = shared.world_file()
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
    on_bounds: Callable[[Bounds], None] | None = declare.callback("called with bounds that have changed")
    on_stage: Callable[[str], None] | None = declare.callback("called with the name of each stage")


class RiskCommand(RiskOptions, shared.Plot, shared.AskCommand):
    """Options of `robust risk`."""

    def check_combinations(self, given: Collection[str]) -> None:
        if not self.distributions and not self.factor and self.world is None:
            raise InputError("say by --distribution or --world how the parameters are distributed")


class RepairOptions(shared.Separation, shared.Solving):
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
    on_repair: Callable[[Cost], None] | None = declare.callback("called with the cost of each better repair")


class RepairCommand(RepairOptions, shared.AskCommand):
    """Options of `robust repair`."""

    output: Path | None = declare.output_option(
        "write the repaired plan to this file; PLAN must then be the file of a network (.stn)",
        metavar="PLAN.stn",
        read=declare.plan_file,
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.output is not None and str(self.plan) == "-":
            raise InputError("needs PLAN in a file, not on standard input", declare.place_of("output"))


class RankOptions(shared.MoreParameters, shared.Separation, shared.Solving):
    """Options of :func:`robust.rank`."""

    parameter: tuple[str, ...] = declare.option(
        ("duration:*",),
        "what deviates: duration:* for all actions that take time, or what other commands take; may be repeated",
        "--parameter",
        "--parametrize",
        metavar="SPEC",
        many=True,
        rank=shared.PARAMETERS,
    )
    deadline: Number = declare.option(
        "+10%",
        "every plan must end by T, or for +P% by P per cent after the last of them ends as planned",
        metavar="T",
        rank=shared.PARAMETERS,
    )
    distribution: Sequence[str] = shared.distributions_option()
    world: str | Path | None = shared.world_file()
    on_plan: Callable[[str], None] | None = declare.callback("called with the name of each plan that is asked about")


class RankCommand(RankOptions, shared.Planning, shared.Output):
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


class LearnCommand(LearnOptions, shared.Output):
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
        rank=shared.DRAWING,
    )
    as_box: bool = declare.option(
        False, "print only the promised intervals, for --at @FILE and --require @FILE", rank=shared.DRAWING
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.as_box and self.json:
            raise InputError("cannot be combined with --json; choose one", Location("--as-box"))


class ValidateOptions(shared.Separation, shared.PlanningOutput):
    """Options of :func:`robust.validate`."""


class ValidateCommand(ValidateOptions, shared.Output):
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
