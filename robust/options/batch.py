"""Options of commands that convert, execute and certify plans, of those about networks, and of batches."""

from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from robust.backends import OFFERED
from robust.errors import InputError, Location
from robust.numbers import Number, shorten
from robust.options import declare, shared, verbs


def stnu_file(path: Path, place: Location) -> Path:
    """InputError unless a network can be written there."""
    if path.suffix.lower() not in declare.STNU_SUFFIXES:
        raise InputError(f"found {shorten(str(path))}, expected a name that ends in .stnu or .json", place)
    return declare.writable(path, place, "the network")


class ConvertCommand(
    shared.PlanFiles,
    shared.FromSteps,
    shared.PlanParameters,
    shared.Separation,
    shared.Solving,
    shared.Force,
    shared.Output,
):
    """Options of `robust convert`."""

    written = (*declare.Options.written, "tree")

    plan: Path = declare.argument(..., "time-triggered plan or log of a planner; - is standard input", "TIMED_PLAN")
    output: Path | None = declare.output_option(
        "write the plan to this file instead of stdout", metavar="PLAN.stn", read=declare.plan_file, also=declare.beside
    )
    stnu: Path | None = declare.path_option(
        "also write the network with uncertainty for the values in the box: .stnu or .json by suffix; TIMED_PLAN may "
        "then be a network (.stn), which is not converted",
        read=stnu_file,
    )
    box: Path | None = declare.path_option(
        "for --stnu: the values of parameters, as printed by robust envelope --json; default: nominal values"
    )
    tree: Path | None = declare.path_option(
        "also write a behavior tree for PlanSys2's executor, in XML, if all its executions are valid; TIMED_PLAN may "
        "then be a network (.stn), which is not converted",
        read=declare.written_to("the tree"),
    )
    lag: Number | None = verbs.lag_option()

    def check_combinations(self, given: Collection[str]) -> None:
        if self.lag is not None and self.tree is None:
            raise InputError("needs --tree FILE", declare.place_of("lag"))
        if self.tree is not None and self.stnu is not None:
            raise InputError("cannot be combined with --stnu; choose one", declare.place_of("tree"))
        if self.box is not None and self.stnu is None:
            raise InputError("needs --stnu FILE", declare.place_of("box"))


class Planners(declare.Options):
    """The planners that are asked for plans while one is executed, and their time limit."""

    planner: str | None = declare.option(
        None, "planner for plans and re-plans: aries, kairos or command:TEMPLATE", metavar="NAME"
    )
    planner_limit: Number = declare.option(
        "7", "time limit of each call of the planner, in seconds", metavar="S", read=declare.seconds
    )


class ExecuteCommand(
    Planners,
    shared.FromSteps,
    shared.PlanParameters,
    shared.Separation,
    shared.Solving,
    shared.BoxOptions,
    shared.Plot,
    shared.Planning,
    shared.Output,
):
    """Options of `robust execute`."""

    plan: Path | None = declare.argument(
        None,
        "network (.stn), time-triggered plan or log of a planner; - is standard input; default: ask the planner",
        "PLAN",
    )
    executor: str = declare.option(
        "dreex",
        "when to give a plan up: dreex: when an observation leaves the box; slice: when nothing of the envelope "
        "remains, with slice:S up to S seconds to decide; blex:X: when an observation is off by more than X per cent",
        metavar="NAME",
    )
    world: Path | None = declare.path_option("distributions that nature draws from, in a TOML file")
    seed: int = declare.option(0, "random seed of the first run; later runs count up", metavar="N")
    runs: int = declare.option(1, "number of runs", metavar="N")
    controllability: str | None = declare.option(
        None, "use only the part of the box with this kind of controllability", choices=("dynamic", "strong")
    )
    replans: int = declare.option(10, "number of re-plans after which a run fails", metavar="N")
    planning_time: Number = declare.option(
        "0",
        "how long re-planning takes in the simulated world, in the plan's unit of time",
        metavar="T",
        read=declare.not_negative,
    )
    stop_running: bool = declare.option(False, "stop running actions to re-plan, instead of waiting for them")

    def check_combinations(self, given: Collection[str]) -> None:
        if self.runs < 1:
            raise InputError(f"found {self.runs}, expected at least 1 run", declare.place_of("runs"))
        if self.replans < 0:
            raise InputError(f"found {self.replans}, expected at least 0 re-plans", declare.place_of("replans"))
        if self.plan is None and self.planner is None:
            raise InputError("give PLAN or --planner: without either there is no plan to execute")


class WatchCommand(Planners, shared.Paged, shared.AskCommand):
    """Options of `robust watch`."""

    clock: str = declare.option(
        "given", "given: messages say what time it is; real: the clock does", choices=("given", "real")
    )
    rate: Number | None = declare.option(
        None,
        "for --clock real: seconds per unit of time; 1 if not given",
        metavar="S",
        read=declare.positive,
        needs=("clock", ("real",)),
    )
    lateness: Number = declare.option(
        "0",
        "how late messages may come, in the plan's unit of time: an event not yet reported may be this old",
        metavar="T",
        read=declare.not_negative,
    )
    journal: Path | None = declare.path_option(
        "record each message here before it is answered, and resume from this record"
    )
    numbers: str = declare.option(
        "exact",
        "exact: texts such as 1/3; decimal: JSON numbers, rounded such that what they promise holds",
        choices=("exact", "decimal"),
    )
    distribution: Sequence[str] = shared.distributions_option()
    world: str | Path | None = shared.world_file()
    answer_limit: Number = declare.option(
        "1",
        "time limit of each answer, in seconds: what is not found by then is as it was promised last, or undecided",
        metavar="S",
        read=declare.seconds,
    )
    coming: int = declare.option(10, "how many of the steps to come that may not start yet are listed", metavar="N")
    planning_time: Number | None = declare.option(
        None,
        "how long after it is asked for another plan begins, in the plan's unit of time; default: --planner-limit, at "
        "--rate seconds a unit",
        metavar="T",
        read=declare.not_negative,
    )


WITH_CHOICES = ("execution", "knowledge")
CERTIFICATES = ("plan", "box", "maximal", "shape", "region", *WITH_CHOICES)
ASSUMED = "a choice that has already been made; may be repeated"


class CertifyCommand(shared.FromSteps, shared.PlanParameters, shared.SearchOptions, shared.Force, shared.Output):
    """Options of `robust certify`; one file is a plan with choices, three are a domain, a problem and a plan."""

    files: tuple[Path, ...] = declare.argument(..., "DOMAIN PROBLEM PLAN, or NETWORK (.tpnu.json)", "FILES", many=True)
    output: Path = declare.output_option(
        "file of the certificate", default=..., metavar="CERT", read=declare.written_to("the certificate")
    )
    kind: str | None = declare.option(
        None,
        "plan (default): valid at the nominal values; box: everywhere in a box; maximal: and no larger box is valid; "
        "shape: everywhere in a shape around it; region: everywhere in the robustness envelope; of a NETWORK: "
        "execution: one that is correct; knowledge: none is correct; default: whichever holds",
        choices=CERTIFICATES,
    )
    shape: str = shared.shape_option("octagon", needs=("kind", ("shape",)))
    box: Path | None = declare.path_option("the box, as printed by robust envelope --json; default: widening finds one")
    assume: tuple[str, ...] = declare.option((), ASSUMED, metavar="NAME=VALUE", many=True)
    alethe: Path | None = declare.path_option(
        "also write cvc5's proofs to DIR, in the Alethe format",
        metavar="DIR",
        also=lambda folder: (*folder.glob("*.smt2"), *folder.glob("*.alethe")),
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if len(self.files) == 1:
            if self.alethe is not None:
                raise InputError("--alethe does not apply to plans with choices; give DOMAIN PROBLEM PLAN")
            if self.kind not in {None, *WITH_CHOICES}:
                raise InputError(f"--kind {self.kind} does not apply to plans with choices; use execution or knowledge")
            return
        kind = self.kind or "plan"
        if kind in WITH_CHOICES or self.assume:
            word = "--assume" if self.assume else f"--kind {kind}"
            raise InputError(f"{word} applies only to a plan with choices; give its .tpnu.json file")
        if kind in {"plan", "shape", "region"} and self.box is not None:
            raise InputError(f"--box needs --kind box or maximal, not {kind}")
        if kind in {"shape", "region"} and self.alethe is not None:
            raise InputError(f"--alethe needs --kind plan, box or maximal, not {kind}")


class VerifyCommand(shared.Separation, shared.Limited, shared.Json):
    """Options of `robust verify`."""

    certificate: Path = declare.argument(..., "a certificate", "CERT")
    files: tuple[Path, ...] = declare.argument(..., "DOMAIN PROBLEM PLAN, or NETWORK (.tpnu.json)", "FILES", many=True)
    kind: str | None = declare.option(None, "fail unless at least this is established", choices=CERTIFICATES)
    box: tuple[str, ...] = declare.option(
        (),
        "fail unless all of this box is established: FILE as printed by robust envelope --json; or NAME=LOW:HIGH or "
        "NAME=VALUE for one parameter, which may be repeated: others have their nominal values",
        metavar="FILE|NAME=LOW:HIGH",
        many=True,
    )
    assume: tuple[str, ...] = declare.option(
        (),
        "fail unless the certificate establishes an execution with this choice, or that there is none; may be repeated",
        metavar="NAME=VALUE",
        many=True,
    )
    checker: str | None = declare.option(
        None,
        "who checks: python; kernel: robust-kernel, which is proved right in Coq; both; default: both where "
        "robust-kernel is on the PATH and knows what the plan says, otherwise python",
        choices=("python", "kernel", "both"),
    )
    timeout: Number | None = declare.option(
        None,
        "time limit in seconds; default: 4 seconds of processor time, and 1 for every 10 kB of the files beyond 120 kB",
        metavar="S",
        read=declare.seconds,
        rank=shared.LIMIT,
    )


# -- networks with uncertainty -----------------------------------------------------------------------------------------


class StnuFiles(shared.Limited, shared.Output):
    """Options of all of `robust stnu`."""

    files: tuple[Path, ...] = declare.argument(
        ..., "networks: GraphML as the CSTNU tool writes it (.stnu), JSON, .cctp or text", "FILE", many=True
    )
    quantile: Number = declare.option(
        "0",
        "random lengths are from their quantile Q to 1 - Q; default: any length that their distributions allow",
        metavar="Q",
        read=declare.not_negative,
    )


class StnuCheckCommand(StnuFiles):
    """Options of `robust stnu check`."""


class StnuDispatchCommand(StnuFiles):
    """Options of `robust stnu dispatch`."""

    runs: int = declare.option(1, "number of simulated executions, each as early as possible", metavar="N")
    seed: int = declare.option(
        0, "random seed of the first execution, whose durations are drawn uniformly; later ones count up", metavar="N"
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.runs < 0:
            raise InputError(f"found {self.runs}, expected at least 0 runs", declare.place_of("runs"))


def _link_weights(values: Sequence[str], place: Location) -> tuple[tuple[str, Fraction | None], ...]:
    """`NAME=W` each; None is infinite."""
    weights = []
    for text in values:
        name, equals, value = text.rpartition("=")
        if not equals or not name:
            expected = "requirement=W, contingent=W or SOURCE:TARGET=W"
            raise InputError(f"found {shorten(text)}, expected {expected}", place)
        weights.append((name, None if value == "inf" else declare.positive(value, place)))
    return tuple(weights)


class StnuRiskCommand(shared.Limited, shared.Output):
    """Options of `robust stnu risk`."""

    file: Path = declare.argument(..., "a network all of whose contingent links have distributions", "FILE")
    within: Number = declare.option(
        "0.001", "how close the bounds of the probability must be", metavar="W", read=declare.positive
    )


class StnuRepairCommand(StnuFiles):
    """Options of `robust stnu repair`."""

    weight: tuple[Any, ...] = declare.option(
        (),
        "cost of a unit of change, above 0 or inf: of all links as requirement=W or contingent=W, of one link as "
        "SOURCE:TARGET=W; default: 1; may be repeated",
        metavar="LINK=W",
        many=True,
        read=_link_weights,
    )
    output: Path | None = declare.output_option(
        "write the repaired network to this file: .stnu or .json by suffix", read=stnu_file
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.output is not None and len(self.files) > 1:
            raise InputError("needs exactly one network", declare.place_of("output"))


class DemoCommand(shared.Colored):
    """Options of `robust demo`."""


Question = tuple[str, str, tuple[str, ...]]
"""Its name, and what is typed: the verb, and options."""
PLACES = shared.SOLVING
"""Rank of where and how many at a time."""


class BatchOptions(shared.Separation, shared.FromSteps, shared.PlanParameters, shared.Encoded, shared.Solver):
    """Options of all questions about many plans; options of single plans keep their meaning."""

    jobs: int = declare.option(
        1,
        "number of processes at a time on this machine; more than 1 disturbs timings",
        metavar="N",
        read=declare.ordinal,
        rank=PLACES,
    )
    cluster: str | None = declare.option(
        None,
        "run on the workers of this Dask scheduler instead, which are sent the texts of the files (extra cluster)",
        metavar="ADDRESS",
        rank=PLACES,
    )
    store: Path | None = declare.path_option(
        "keep answers as they arrive; the same command with the same FILE asks only what is missing",
        read=lambda path, _: Path(path),
        rank=PLACES,
    )
    limit: Number | None = declare.option(
        None,
        "time limit of each plan in seconds; its result so far is its answer then",
        metavar="S",
        read=declare.seconds,
        rank=shared.LIMIT,
    )
    timeout: Number | None = declare.option(
        None,
        "time limit of all plans in seconds; the plans answered by then are shown",
        metavar="S",
        read=declare.seconds,
        rank=shared.LIMIT,
    )
    on_result: Callable[[int, int, str], None] | None = declare.callback(
        "called after each answer with their number, the total and a line about it"
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.cluster is not None and self.jobs != 1:
            raise InputError(
                f"cannot be combined with {declare.spelled('cluster')}; choose one", declare.place_of("jobs")
            )

    @property
    def asked(self) -> tuple[Question, ...]:
        """The questions that are asked about each plan."""
        return (self._ask("check"),)

    def _ask(self, verb: str, *words: str, name: str | None = None) -> Question:
        kinds = (shared.Separation, shared.Solver, shared.Encoded, shared.FromSteps, shared.PlanParameters)
        return name or verb, verb, (*declare.typed(self, *kinds), *words)


class BatchCheckOptions(BatchOptions):
    """Options of `robust.batch("check", ...)`."""


class BatchEnvelopeOptions(BatchOptions, shared.AnyBoxOptions):
    """Options of `robust.batch("envelope", ...)`."""

    @property
    def asked(self) -> tuple[Question, ...]:
        return (self._ask("envelope", *declare.typed(self, shared.AnyBoxOptions)),)


class BatchRegionOptions(BatchOptions, verbs.EliminationOptions):
    """Options of `robust.batch("region", ...)`."""

    @property
    def asked(self) -> tuple[Question, ...]:
        return (self._ask("region", *declare.typed(self, verbs.EliminationOptions)),)


class BatchCompareOptions(BatchOptions):
    """Options of `robust.batch("compare", ...)`."""

    beta: Number | None = declare.option("1", "the precision of IRR", metavar="B", read=declare.positive)
    doubling: bool = declare.option(True, "double the steps of IRR until the first failure, as in its published runs")
    region: str | None = declare.option(
        None,
        "also compute the exact region of each plan, the first step of CCMMZ, with this elimination back end",
        choices=OFFERED,
    )

    @property
    def asked(self) -> tuple[Question, ...]:
        irr = shared.BoxOptions(method="irr", beta=self.beta, doubling=self.doubling)
        questions = (
            self._ask("envelope", *declare.typed(irr, shared.BoxOptions), name="irr"),
            self._ask("envelope", "--method=optimal", name="ccmmz"),
        )
        return questions if self.region is None else (*questions, self._ask("region", f"--backend={self.region}"))


class AnyBatchOptions(BatchEnvelopeOptions, BatchRegionOptions, BatchCompareOptions):
    """Options of :func:`robust.batch` for any verb; each verb takes only its own."""


BATCHES: dict[str, type[BatchOptions]] = {
    "check": BatchCheckOptions,
    "envelope": BatchEnvelopeOptions,
    "region": BatchRegionOptions,
    "compare": BatchCompareOptions,
}
"""Options by verb."""


class BatchCommand(BatchOptions, shared.Output):
    """Options of all commands of `robust batch`."""

    suite: Path = declare.argument(
        ..., "folder of plans with their problems and domains, or a list of them (lines, .json, .csv)", "SUITE"
    )
    csv: Path | None = declare.path_option(
        "write a CSV file with a line for each plan", read=declare.written_to("the table"), rank=shared.DRAWING
    )
    html: Path | None = declare.path_option(
        "write the table as a self-contained HTML page", read=declare.written_to("the table"), rank=shared.DRAWING
    )


class BatchCheckCommand(BatchCheckOptions, BatchCommand):
    """Options of `robust batch check`."""


class BatchEnvelopeCommand(BatchEnvelopeOptions, BatchCommand):
    """Options of `robust batch envelope`."""


class BatchRegionCommand(BatchRegionOptions, BatchCommand):
    """Options of `robust batch region`."""


class BatchCompareCommand(BatchCompareOptions, BatchCommand):
    """Options of `robust batch compare`."""
