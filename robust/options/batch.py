"""Options of what is asked about many plans at once: of :func:`robust.batch`, and of the commands of `robust batch`.

Options of commands that make, execute and certify plans, and of those about networks with uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from robust.backends import OFFERED
from robust.errors import InputError, Location
from robust.numbers import Number, shorten
from robust.options.declare import (
    STNU_SUFFIXES,
    argument,
    beside,
    not_negative,
    option,
    ordinal,
    place_of,
    plan_file,
    positive,
    seconds,
    typed,
    writable,
)
from robust.options.shared import (
    DRAWING,
    LIMIT,
    SOLVING,
    AnyBoxOptions,
    BoxOptions,
    Colored,
    Encoded,
    Force,
    Json,
    Limited,
    Output,
    PlanFiles,
    Planning,
    PlanningOutput,
    PlanParameters,
    Plot,
    SearchOptions,
    Separation,
    Solver,
    Solving,
)
from robust.options.verbs import EliminationOptions


def stnu_file(path: Path, place: Location) -> Path:
    """InputError unless a network can be written there."""
    if path.suffix.lower() not in STNU_SUFFIXES:
        raise InputError(f"found {shorten(str(path))}, expected a name that ends in .stnu or .json", place)
    return writable(path, place, "the network")


class ConvertCommand(PlanFiles, PlanningOutput, PlanParameters, Separation, Solving, Force, Output):
    """Of `robust convert`."""

    plan: Path = argument(..., "time-triggered plan or log of a planner; - is standard input", "TIMED_PLAN")
    output: Path | None = option(
        None,
        "write the plan here instead of on stdout",
        "--output",
        "-o",
        metavar="PLAN.stn",
        path=True,
        read=plan_file,
        also=beside,
    )
    mode: str = option(
        "causal",
        "causal: the least constrained network that is proved valid; esterel: the network of the Esterel transformer",
        choices=("causal", "esterel"),
    )
    stnu: Path | None = option(
        None,
        "also write the network with uncertainty under the box: .stnu or .json by suffix; TIMED_PLAN may be a network "
        "(.stn) then, which is not converted",
        metavar="FILE",
        path=True,
        read=stnu_file,
    )
    box: Path | None = option(
        None,
        "for --stnu: the values that parameters may have, an answer of robust envelope in JSON; else nominal ones",
        metavar="FILE",
        path=True,
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.box is not None and self.stnu is None:
            raise InputError("found it without --stnu, expected it only together", place_of("box"))


class ExecuteCommand(PlanningOutput, PlanParameters, Separation, Solving, BoxOptions, Plot, Planning, Output):
    """Of `robust execute`."""

    plan: Path | None = argument(
        None,
        "network (.stn), time-triggered plan or log of a planner, - is standard input; left out, the planner is asked",
        "PLAN",
    )
    executor: str = option(
        "dreex",
        "dreex: go on while observations are in the box; slice: while something is left of the envelope, with "
        "slice:S up to S seconds to find out; blex:X: while observations are within X per cent",
        metavar="NAME",
    )
    planner: str | None = option(None, "who plans and re-plans: aries, kairos or command:TEMPLATE", metavar="NAME")
    world: Path | None = option(None, "what nature draws, in a TOML file", metavar="FILE", path=True)
    seed: int = option(0, "of the first run; the next ones count up", metavar="N")
    runs: int = option(1, "how many runs", metavar="N")
    controllability: str | None = option(
        None, "use the part of the box that is controllable so", choices=("dynamic", "strong")
    )
    replans: int = option(10, "re-plans after which a run fails", metavar="N")
    planner_limit: Number = option("7", "seconds that the planner has each time", metavar="S", read=seconds)
    planning_time: Number = option(
        "0", "how long re-planning takes in the simulated world", metavar="T", read=not_negative
    )
    stop_running: bool = option(False, "stop running actions to re-plan, instead of waiting for them")

    def check_combinations(self, given: Collection[str]) -> None:
        if self.runs < 1:
            raise InputError(f"found {self.runs}, expected at least 1 run", place_of("runs"))
        if self.replans < 0:
            raise InputError(f"found {self.replans}, expected at least 0 re-plans", place_of("replans"))
        if self.plan is None and self.planner is None:
            raise InputError("found neither PLAN nor --planner, expected one of them: where is the plan to come from?")


WITH_CHOICES = ("execution", "knowledge")
CERTIFICATES = ("plan", "box", "maximal", "region", *WITH_CHOICES)
ASSUMED = "a choice that is made already; may be repeated"


class CertifyCommand(PlanningOutput, PlanParameters, SearchOptions, Force, Output):
    """Of `robust certify`; one file is a plan with choices, three are a domain, a problem and a plan."""

    files: tuple[Path, ...] = argument(..., "DOMAIN PROBLEM PLAN, or NETWORK (.tpnu.json)", "FILES", many=True)
    output: Path = option(
        ...,
        "where to write the certificate",
        "--output",
        "-o",
        metavar="CERT",
        path=True,
        read=lambda path, place: writable(path, place, "the certificate"),
    )
    kind: str | None = option(
        None,
        "plan (default): valid at the nominal values; box: all over a box; maximal: and no valid box contains it; "
        "region: all over the robustness envelope; of a NETWORK execution: this one is correct; knowledge: none is; "
        "if not given, whichever is true",
        choices=CERTIFICATES,
    )
    box: Path | None = option(
        None,
        "the box, an answer of robust envelope in JSON; else widening finds it",
        metavar="FILE",
        path=True,
    )
    assume: tuple[str, ...] = option((), ASSUMED, metavar="NAME=VALUE", many=True)
    alethe: Path | None = option(
        None,
        "also write cvc5's proofs to DIR, in the Alethe format",
        metavar="DIR",
        path=True,
        also=lambda folder: (*folder.glob("*.smt2"), *folder.glob("*.alethe")),
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if len(self.files) == 1:
            if self.alethe is not None:
                raise InputError("found --alethe with a plan with choices; expected it with DOMAIN PROBLEM PLAN")
            if self.kind not in {None, *WITH_CHOICES}:
                raise InputError(f"found --kind {self.kind} with a plan with choices; expected execution or knowledge")
            return
        kind = self.kind or "plan"
        if kind in WITH_CHOICES or self.assume:
            found = "--assume" if self.assume else f"--kind {kind}"
            raise InputError(f"found {found} with DOMAIN PROBLEM PLAN; expected it with a plan with choices")
        if kind in {"plan", "region"} and self.box is not None:
            raise InputError(f"found --box with --kind {kind}; expected it with box or maximal")
        if kind == "region" and self.alethe is not None:
            raise InputError("found --alethe with --kind region; expected it with plan, box or maximal")


class VerifyCommand(Separation, Limited, Json):
    """Of `robust verify`."""

    certificate: Path = argument(..., "a certificate", "CERT")
    files: tuple[Path, ...] = argument(..., "DOMAIN PROBLEM PLAN, or NETWORK (.tpnu.json)", "FILES", many=True)
    kind: str | None = option(
        None,
        "fail unless this, or more, is established",
        choices=CERTIFICATES,
    )
    box: tuple[str, ...] = option(
        (),
        "fail unless all of this box is established: an answer of robust envelope in JSON; or the values of one "
        "parameter, NAME=LOW:HIGH or NAME=VALUE: others have their nominal values; may be repeated then",
        metavar="FILE|NAME=LOW:HIGH",
        many=True,
    )
    assume: tuple[str, ...] = option(
        (),
        "fail unless an execution with this choice is established, or, if it is made already, that there is none",
        metavar="NAME=VALUE",
        many=True,
    )
    timeout: Number | None = option(
        None,
        "seconds after which the check is given up; if not given 4 seconds of processor time, and 1 for every 10 kB "
        "that the files have beyond 120 kB",
        metavar="S",
        read=seconds,
        rank=LIMIT,
    )


# -- networks with uncertainty -----------------------------------------------------------------------------------------


class StnuFiles(Limited, Output):
    """Of all of `robust stnu`."""

    files: tuple[Path, ...] = argument(
        ..., "networks: GraphML as the CSTNU tool writes it (.stnu), or JSON", "FILE", many=True
    )


class StnuCheckCommand(StnuFiles):
    """Of `robust stnu check`."""


class StnuDispatchCommand(StnuFiles):
    """Of `robust stnu dispatch`."""

    runs: int = option(1, "how many executions are simulated, as early as possible", metavar="N")
    seed: int = option(0, "which durations the first one draws, uniformly; the next ones count up", metavar="N")

    def check_combinations(self, given: Collection[str]) -> None:
        if self.runs < 0:
            raise InputError(f"found {self.runs}, expected at least 0 runs", place_of("runs"))


def _link_weights(values: Sequence[str], place: Location) -> tuple[tuple[str, Fraction | None], ...]:
    """`NAME=W` each; None is infinite."""
    found = []
    for text in values:
        name, equals, value = text.rpartition("=")
        if not equals or not name:
            expected = "requirement=W, contingent=W or SOURCE:TARGET=W"
            raise InputError(f"found {shorten(text)}, expected {expected}", place)
        found.append((name, None if value == "inf" else positive(value, place)))
    return tuple(found)


class StnuRepairCommand(StnuFiles):
    """Of `robust stnu repair`."""

    weight: tuple[Any, ...] = option(
        (),
        "what a unit of change costs, above 0 or inf: of all links as requirement=W or contingent=W, of one as "
        "SOURCE:TARGET=W; 1 if not given; may be repeated",
        metavar="LINK=W",
        many=True,
        read=_link_weights,
    )
    output: Path | None = option(
        None,
        "write the repaired network here: .stnu or .json by suffix",
        "--output",
        "-o",
        metavar="FILE",
        path=True,
        read=stnu_file,
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.output is not None and len(self.files) > 1:
            raise InputError("found several networks, expected one to write", place_of("output"))


class DemoCommand(Colored):
    """Of `robust demo`."""


Question = tuple[str, str, tuple[str, ...]]
"""Its name, and what is typed: the verb, and options."""
PLACES = SOLVING
"""Rank of where and how many at a time."""


def _table_file(path: Path, place: Location) -> Path:
    return writable(Path(path), place, "the table")


def _file(path: str | Path, _: Location) -> Path:
    return Path(path)


class BatchOptions(Separation, PlanningOutput, PlanParameters, Encoded, Solver):
    """What all questions about many plans have in common; those of single plans have the same meaning there."""

    jobs: int = option(
        1, "processes at a time on this machine; more than 1 disturbs timings", metavar="N", read=ordinal, rank=PLACES
    )
    cluster: str | None = option(
        None,
        "run on the workers of this Dask scheduler instead, which get the texts of the files (extra cluster)",
        metavar="ADDRESS",
        rank=PLACES,
    )
    store: Path | None = option(
        None,
        "keep answers as they arrive; the same command with the same FILE asks only what is not there",
        metavar="FILE",
        path=True,
        read=_file,
        rank=PLACES,
    )
    limit: Number | None = option(
        None,
        "seconds for each plan, after which what is known of it is its answer",
        metavar="S",
        read=seconds,
        rank=LIMIT,
    )
    timeout: Number | None = option(
        None,
        "seconds for all plans, after which those that are answered are shown",
        metavar="S",
        read=seconds,
        rank=LIMIT,
    )
    on_result: Callable[[int, int, str], None] | None = option(
        None, "called after each answer with their number, the total and a line about it", shown=False
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.cluster is not None and self.jobs != 1:
            raise InputError("found it with a cluster, expected one of the two", place_of("jobs"))

    @property
    def asked(self) -> tuple[Question, ...]:
        """What is asked about each plan."""
        return (self._ask("check"),)

    def _ask(self, verb: str, *words: str, name: str | None = None) -> Question:
        return name or verb, verb, (*typed(self, Separation, Solver, Encoded, PlanningOutput, PlanParameters), *words)


class BatchCheckOptions(BatchOptions):
    """Of `robust.batch("check", ...)`."""


class BatchEnvelopeOptions(BatchOptions, AnyBoxOptions):
    """Of `robust.batch("envelope", ...)`."""

    @property
    def asked(self) -> tuple[Question, ...]:
        return (self._ask("envelope", *typed(self, AnyBoxOptions)),)


class BatchRegionOptions(BatchOptions, EliminationOptions):
    """Of `robust.batch("region", ...)`."""

    @property
    def asked(self) -> tuple[Question, ...]:
        return (self._ask("region", *typed(self, EliminationOptions)),)


class BatchCompareOptions(BatchOptions):
    """Of `robust.batch("compare", ...)`."""

    beta: Number | None = option("1", "the precision of IRR", metavar="B", read=positive)
    doubling: bool = option(True, "whether steps of IRR double until the first failure, as in its published runs")
    region: str | None = option(
        None,
        "also compute the exact region of each plan, with which CCMMZ begins: the quantifier-elimination back end",
        choices=OFFERED,
    )

    @property
    def asked(self) -> tuple[Question, ...]:
        irr = BoxOptions(method="irr", beta=self.beta, doubling=self.doubling)
        found = (
            self._ask("envelope", *typed(irr, BoxOptions), name="irr"),
            self._ask("envelope", "--method=optimal", name="ccmmz"),
        )
        return found if self.region is None else (*found, self._ask("region", f"--backend={self.region}"))


class AnyBatchOptions(BatchEnvelopeOptions, BatchRegionOptions, BatchCompareOptions):
    """What :func:`robust.batch` takes for one verb or another; each verb takes its own only."""


BATCHES: dict[str, type[BatchOptions]] = {
    "check": BatchCheckOptions,
    "envelope": BatchEnvelopeOptions,
    "region": BatchRegionOptions,
    "compare": BatchCompareOptions,
}
"""Options by verb."""


class BatchCommand(BatchOptions, Output):
    """What all commands of `robust batch` have."""

    suite: Path = argument(
        ..., "folder of plans with their problems and domains, or a list of them (lines, .json, .csv)", "SUITE"
    )
    csv: Path | None = option(
        None, "write a line for each plan as CSV", metavar="FILE", path=True, read=_table_file, rank=DRAWING
    )
    html: Path | None = option(
        None,
        "write the table as one HTML page that needs no network",
        metavar="FILE",
        path=True,
        read=_table_file,
        rank=DRAWING,
    )


class BatchCheckCommand(BatchCheckOptions, BatchCommand):
    """Of `robust batch check`."""


class BatchEnvelopeCommand(BatchEnvelopeOptions, BatchCommand):
    """Of `robust batch envelope`."""


class BatchRegionCommand(BatchRegionOptions, BatchCommand):
    """Of `robust batch region`."""


class BatchCompareCommand(BatchCompareOptions, BatchCommand):
    """Of `robust batch compare`."""
