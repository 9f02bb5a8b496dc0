"""Options of plans with choices: what the functions of :mod:`robust.pike` take, and what commands take in addition."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from robust.backends import DRAKE, KIRK, KNOWLEDGE_BASES, REASONERS, SMT, deciding
from robust.errors import InputError, Location, did_you_mean
from robust.numbers import Number, shorten
from robust.options import declare
from robust.options.batch import ASSUMED
from robust.options.shared import Force, Output, Paged, Separation, SliceOptions, Solving

if TYPE_CHECKING:
    from robust.pike_bridge.online.world import Disturbance, ExecutionStep

Assumptions = Mapping[str, str] | str | Sequence[str]
"""Values of choices that are made already, by name or as texts `NAME=VALUE`."""


class TeamPlanFile(Separation):
    """The file of the plan, and ε: how much earlier is "before"."""

    file: Path = declare.argument(..., "a plan with choices, .tpnu.json", "FILE")


class PikeCommand(TeamPlanFile, Output):
    """Options of all commands about a plan."""


class Assuming(declare.Options):
    """Choices that are made already."""

    assume: Assumptions = declare.option((), ASSUMED, metavar="NAME=VALUE", many=True)


class Staged(Solving):
    """A question that is answered in stages."""

    on_stage: Callable[[str], None] | None = declare.callback("called with the name of each stage")


class Compiled(Staged):
    """Options for compiling a knowledge base."""

    temporal: str = declare.option(
        "lazy",
        "lazy: order events by structure, find conflicts as they are needed; apsp: labeled all-pairs shortest paths",
        choices=("lazy", "apsp"),
    )


def witness_directory(path: str | Path, place: Location) -> Path:
    """InputError if it is a file."""
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise InputError(f"found file {str(path)!r}, expected a directory", place)
    return path


class ParametricOptions(Solving, Assuming):
    """Options for the bounds that are parameters."""

    parameters: str | Sequence[str] = declare.option(
        (),
        "make a bound a parameter: [NAME=]duration:ACTIVITY, at-least: or at-most:ACTIVITY or FROM:TO (events), or "
        "hesitation:CHOICE; then ,weight=W ,lb=L ,ub=U ,default=D; may be repeated",
        "--parameter",
        metavar="SPEC",
        many=True,
    )
    parameter_file: str | Path | None = declare.path_option("more parameters, in a TOML file", "--parameters")


def _names_or_none(value: str | Sequence[str], place: Location) -> tuple[str, ...]:
    """Names, or none of them."""
    return declare.names(value, place) if value else ()


# -- questions ---------------------------------------------------------------------------------------------------------


class PikeCheckOptions(Compiled, Assuming):
    """Options of :func:`robust.pike.check`."""

    backend: str = declare.option(
        "oracle",
        "oracle: a solver decides by the semantics; otherwise the knowledge base of this name answers",
        choices=("oracle", *KNOWLEDGE_BASES),
    )
    all_scenarios: bool = declare.option(False, "find every team scenario that admits a correct execution")


class MomentsOptions(Solving, Assuming):
    """Options of :func:`robust.pike.moments`."""


class CrossOptions(Staged, Force):
    """Options of :func:`robust.pike.cross_check`."""

    witness: str | Path | None = declare.path_option(
        "with --cross: where to write a small plan on which they differ",
        metavar="DIR",
        read=witness_directory,
        also=lambda folder: [folder / name for name in ("plan.tpnu.json", "domain.pddl", "problem.pddl")],
    )
    seed: int = declare.option(0, "with --cross: which sets of choices are tried", metavar="N")


class GameOptions(declare.Options):
    """Options of strategies: who decides what."""

    rational: bool = declare.option(
        False, "with a strategy: people choose only joint values that some correct execution has"
    )
    free: str | Sequence[str] = declare.option(
        (),
        "with a strategy: agents whose activities end when the executive tells them to; all others end as nature likes",
        metavar="A,B",
        read=_names_or_none,
    )
    hesitate: Number | None = declare.option(
        None,
        "with a strategy: how long people hesitate at most once they are asked",
        metavar="T",
        read=declare.not_negative,
    )


class ControllableOptions(ParametricOptions, Staged, GameOptions):
    """Options of :func:`robust.pike.controllable`."""

    repair: bool = declare.option(
        False,
        "with --controllable: find the least sum of changes of all parameters together, by their weights, after which "
        "the plan is controllable, instead of how far each can move alone",
    )


class PikeCheckCommand(PikeCheckOptions, CrossOptions, ControllableOptions, PikeCommand):
    """Options of `robust pike check`."""

    cross: bool = declare.option(False, "ask all back ends and the oracle the same questions, and compare")
    patience: bool = declare.option(
        False,
        "report the latest moment at which people can make each choice, with each value, if everything else is in its "
        "favour",
    )
    controllable: bool = declare.option(
        False,
        "decide whether some strategy succeeds whatever people choose and however long activities take, both seen only "
        "as they happen",
    )

    def check_combinations(self, given: Collection[str]) -> None:
        for alone in ("patience", "controllable"):
            others = ("cross", "backend", "all_scenarios", "temporal") if getattr(self, alone) else ()
            declare.refuse(others, given, f"cannot be combined with --{alone}; choose one")
        if self.patience and self.controllable:
            raise InputError("cannot be combined with --patience; choose one", declare.place_of("controllable"))
        if not self.controllable:
            about_it = ("rational", "free", "hesitate", "repair", "parameters", "parameter_file")
            declare.refuse(about_it, given, "needs --controllable")


class ChanceOptions(Compiled, Assuming):
    """Options of :func:`robust.pike.chance`."""

    backend: str = declare.option(
        "pitms",
        "pitms: exact, by the diagrams of the knowledge base; oracle: a solver is asked about one scenario after the "
        "other, which leaves bounds if time does not suffice",
        choices=("pitms", "oracle"),
    )
    learn: str | Path | Sequence[str | Path] = declare.option(
        (),
        "a journal of an earlier execution; probabilities of people's choices are learnt from all that are given",
        metavar="JOURNAL",
        many=True,
    )


class ChanceCommand(ChanceOptions, PikeCommand):
    """Options of `robust pike chance`."""


class KnowledgeBaseOptions(Compiled):
    """Options of :func:`robust.pike.knowledge_base`."""

    backend: str = declare.option("pitms", "the knowledge base to compile", choices=KNOWLEDGE_BASES)
    shortcut: bool = declare.option(True, "let a solver check first whether there is any correct execution")


CONTENTS = ("links", "labels", "distances")


def _contents(value: str | Sequence[str], place: Location) -> tuple[str, ...]:
    """Some of :data:`CONTENTS`."""
    wanted = _names_or_none(value, place)
    for name in wanted:
        if name not in CONTENTS:
            expected = f"one of {', '.join(CONTENTS)}"
            raise InputError(f"found {shorten(name)}, expected {expected}{did_you_mean(name, CONTENTS)}", place)
    return wanted


class PikeCompileOptions(KnowledgeBaseOptions):
    """Options of :func:`robust.pike.compile`."""

    implicants: bool = declare.option(False, "list the prime implicants (pitms, pitms-labels, bdd)")
    models: bool | None = declare.option(
        None,
        "count the models; if not given, all back ends but sat do, which lists them one by one",
        "--models/--no-models",
    )
    show: str | Sequence[str] = declare.option(
        (),
        "list links: labeled causal links, and how threats are kept away; labels: those of the knowledge base's nodes "
        "(pitms, pitms-labels, atms); distances: labeled shortest paths",
        metavar="A,B",
        read=_contents,
    )


class PikeCompileCommand(PikeCompileOptions, PikeCommand):
    """Options of `robust pike compile`."""


# -- executions --------------------------------------------------------------------------------------------------------


def _deciding_backend(name: str, place: Location) -> str:
    """InputError unless an executive can reason with the back end."""
    known = (SMT, *KNOWLEDGE_BASES)
    if name not in known:
        raise InputError(f"found unknown back end {shorten(name)}{did_you_mean(name, known)}", place)
    return name


def _number_or(
    word: str, read: Callable[[Number, Location], Fraction], numbers: str
) -> Callable[[Number, Location], Fraction | None]:
    """Reads a number, or the word, which is None."""

    def read_either(value: Number, place: Location) -> Fraction | None:
        if value == word:
            return None
        try:
            return read(value, place)
        except InputError:
            raise InputError(f"found {shorten(str(value))}, expected {word}, or {numbers}", place) from None

    return read_either


EAGER = "eager"
BUDGET = "0.1"
UNLIMITED = "none"
_SIMULATED = ("human", "pace", "outcome", "disturb", "delay", "seed", "infer", "recovery", "plot")
_COMPLETE = ("patience", "budget", "chance", "explain", "rank")
"""What is for executives that keep all that is possible."""
_SERVED = ("journal", "clock", "rate", "page", "early")


class StoryOptions(declare.Options):
    """Options of :func:`robust.pike.story`: what a simulated team does."""

    human: str = declare.option(
        "rational",
        "how people choose: rational, only what leaves a correct execution; careless, anything; likely, by the "
        "probabilities of the plan",
        choices=("rational", "careless", "likely"),
    )
    pace: str = declare.option(
        "cooperative",
        "how long activities take: cooperative, such that a correct execution remains if possible; least, as short as "
        "their bounds allow; random, any duration within them",
        choices=("cooperative", "least", "random"),
    )
    outcome: Mapping[str, str | tuple[str, Number]] | str | Sequence[str] = declare.option(
        (),
        "a value that people choose, and the time at which it becomes known; may be repeated",
        metavar="NAME=VALUE[@TIME]",
        many=True,
    )
    disturb: str | Sequence[str | Disturbance] = declare.option(
        (),
        "a literal that becomes true against the plan, such as '(not (atom))@3'; may be repeated",
        metavar="LITERAL@TIME",
        many=True,
    )
    delay: Number = declare.option(
        "0", "how long people hesitate at most before they choose", metavar="T", read=declare.not_negative
    )


class PikeRunOptions(StoryOptions, Solving):
    """Options of :func:`robust.pike.run`."""

    seed: int = declare.option(0, "seed of what is drawn at random", metavar="N")
    reasoner: str | None = declare.option(
        None,
        "what decides: smt, a solver, without compilation; windows, labeled execution windows and a knowledge base, as "
        f"PIKE does; {DRAKE}, windows without conditions and effects of activities; {KIRK}, a guess of all choices, "
        "made anew where it was wrong; if not given, smt, or windows with --backend",
        choices=REASONERS,
    )
    backend: str | None = declare.option(
        None,
        f"the knowledge base of windows, {DRAKE} and {KIRK}: {', '.join(KNOWLEDGE_BASES)}; pitms if not given, or smt "
        f"for {KIRK}",
        metavar="NAME",
        read=_deciding_backend,
    )
    patience: Number | None = declare.option(
        "0",
        "stop waiting for people's choices this long before the last possible moment; "
        f"{EAGER}: never wait, act as soon as possible",
        metavar=f"{EAGER}|MARGIN",
        read=_number_or(EAGER, declare.not_negative, "a number of at least 0"),
    )
    rank: str = declare.option(
        "written",
        "which of several events and values comes first: written, as in the plan; flexible, what leaves most values of "
        "people's open choices possible, then of the team's",
        choices=("written", "flexible"),
    )
    budget: Number | None = declare.option(
        BUDGET,
        "seconds of processor time to decide a step; only what is proved safe is done, and what could not be decided "
        f"waits; {UNLIMITED}: as long as it takes",
        metavar="S",
        read=_number_or(UNLIMITED, declare.positive, "a number above 0"),
    )
    chance: Number | None = declare.option(
        None,
        "choose what leaves people the most among what keeps success at least this likely, else what is most likely to "
        "succeed (1: always that), and report how likely success is",
        metavar="P",
        read=declare.share,
    )
    strategy: bool = declare.option(
        False,
        "find a strategy before the start, as pike check --controllable does, and follow it: for whatever people "
        "choose or, if there is none, for rational people; and for all durations and the delay",
    )
    recovery: Number = declare.option(
        "0.5",
        f"{KIRK}: how long it takes to undo an activity that was begun by mistake, as a share of its least duration",
        metavar="SHARE",
        read=declare.not_negative,
    )
    infer: bool = declare.option(True, "infer which values open choices can still have")
    explain: bool = declare.option(False, "give reasons below each decision and inference")
    on_step: Callable[[ExecutionStep], None] | None = declare.callback("called after each step")

    def check_combinations(self, given: Collection[str]) -> None:
        both = None not in (self.reasoner, self.backend) and self.reasoner != KIRK
        if both and (self.reasoner == SMT) != (self.backend == SMT):
            expected = SMT if self.reasoner == SMT else ", ".join(KNOWLEDGE_BASES)
            raise InputError(
                f"found {self.backend} with {declare.setting('reasoner', str(self.reasoner))}, expected {expected}",
                declare.place_of("backend"),
            )
        if self.strategy:
            decided = ("reasoner", "backend", "patience", "chance", "rank")
            declare.refuse(decided, given, "cannot be combined with --strategy; choose one")
        kirk = declare.setting("reasoner", KIRK)
        if self.reasoner == KIRK:
            declare.refuse(_COMPLETE, given, f"cannot be combined with {kirk}")
        else:
            declare.refuse(("recovery",), given, f"needs {kirk}")

    @property
    def deciding(self) -> str:
        """The name of what decides: smt, or the knowledge base of windows."""
        return deciding(self.reasoner, self.backend)

    @property
    def margin(self) -> Fraction | None:
        """The time before the last moment at which waiting ends; None: nothing is waited for, but by a strategy."""
        return None if self.strategy or self.patience is None else Fraction(self.patience)

    @property
    def thinking(self) -> float | None:
        """The budget of a step in seconds; None: as long as it takes."""
        return None if self.budget is None else float(self.budget)


class PikeRunCommand(PikeRunOptions, Paged, PikeCommand):
    """Options of `robust pike run`."""

    stdio: bool = declare.option(False, "serve a real team through lines of JSON instead of simulating one")
    journal: Path | None = declare.path_option(
        "with --stdio: record each step here before it is announced, and resume from this record"
    )
    clock: str = declare.option(
        "given", "with --stdio: given, messages say what time it is; real, the clock does", choices=("given", "real")
    )
    early: str = declare.option(
        "accept",
        "with --stdio: accept, an activity that ends before its least duration has ended if something correct is left; "
        "wait, it counts as ended once that is over",
        choices=("accept", "wait"),
    )
    rate: Number | None = declare.option(
        None, "with --clock real: seconds per unit of time; 1 if not given", metavar="S", read=declare.positive
    )
    plot: Path | None = declare.path_option(
        "draw which agent did what when: .svg, .png or .pdf", read=declare.plot_file
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.stdio:
            reason = "found together with --stdio, expected without: nothing is simulated then"
            declare.refuse(_SIMULATED, given, reason)
        else:
            declare.refuse(_SERVED, given, "expected only together with --stdio")
        if self.stdio and self.reasoner == KIRK:
            raise InputError(f"found {KIRK} together with --stdio, expected another one", declare.place_of("reasoner"))
        if self.rate is not None and self.clock != "real":
            raise InputError("needs --clock real", declare.place_of("rate"))
        super().check_combinations(given)


class PikePlotCommand(TeamPlanFile, Output, Assuming):
    """Options of `robust pike plot`."""

    output: Path = declare.path_option(
        "where to draw: .svg, .png or .pdf by suffix",
        "--output",
        "-o",
        "--plot",
        default=...,
        read=lambda path, _place: declare.plot_file(path, declare.place_of("plot")),
    )
    links: bool = declare.option(False, "draw the labeled causal links as well")


# -- envelopes ---------------------------------------------------------------------------------------------------------


class PikeRegionOptions(ParametricOptions):
    """Options of :func:`robust.pike.region`."""

    choices: str | Sequence[str] | None = declare.option(
        None,
        "choices distinguished in the answer, the others are existentially quantified; if not given, those of people "
        "and nature; '' for none",
        metavar="A,B",
        read=_names_or_none,
    )
    on_piece: Callable[[object], None] | None = declare.callback("called with each polyhedron that is found")


class PikeEnvelopeOptions(ParametricOptions, Staged):
    """Options of :func:`robust.pike.envelope`."""

    for_all: str | Sequence[str] = declare.option(
        (),
        "choices for which every combination of values must lead to a correct execution",
        metavar="A,B",
        read=_names_or_none,
    )
    patience: bool = declare.option(
        False, "with --for-all: choices become known only when they are made, and the team waits for them"
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.patience and not self.for_all:
            raise InputError("expected only together with --for-all", declare.place_of("patience"))


class PikeRegionCommand(PikeRegionOptions, PikeCommand, SliceOptions):
    """Options of `robust pike region`."""


class PikeEnvelopeCommand(PikeEnvelopeOptions, PikeCommand, SliceOptions):
    """Options of `robust pike envelope`."""


# -- new plans ---------------------------------------------------------------------------------------------------------

K_INTENTS, SAT = "k-intents", "sat"


def _structure(text: str, place: Location) -> tuple[int, ...]:
    """`2,3,2`: how many options each pair of choices has; or how many variables and clauses there are."""
    try:
        sizes = tuple(int(part) for part in text.split(","))
    except ValueError:
        sizes = ()
    if not sizes or min(sizes) < 1 or max(sizes) > 1000 or len(sizes) > 100:
        raise InputError(f"found {shorten(text)}, expected whole numbers of at least 1 such as 2,3,2", place)
    return sizes


class PikeNewCommand(Force, Output):
    """Options of `robust pike new`."""

    kind: str = declare.option(
        ...,
        "kitchen, wing, k-intents, or sat: a formula whose models are the correct scenarios",
        metavar="KIND",
        choices=("kitchen", "wing", K_INTENTS, SAT),
        argument=True,
    )
    output: Path = declare.output_option("the directory to write to", default=..., metavar="DIR")
    name: str = declare.option("", "of the .tpnu.json file, else that of the plan", metavar="NAME")
    structure: tuple[int, ...] = declare.option(
        "2,2",
        "k-intents: how many options each pair of choices has; sat: how many variables and clauses are drawn, of up "
        "to three literals",
        metavar="N,N",
        read=_structure,
    )
    seed: int = declare.option(0, "k-intents, sat: decides what is drawn", metavar="N")
    cnf: Path | None = declare.path_option("sat: the formula, in a DIMACS file; else one is drawn")

    def check_combinations(self, given: Collection[str]) -> None:
        for name, kinds in {"structure": (K_INTENTS, SAT), "seed": (K_INTENTS, SAT), "cnf": (SAT,)}.items():
            if name in given and self.kind not in kinds:
                raise InputError(f"expected only with {' or '.join(kinds)}, found {self.kind}", declare.place_of(name))
            if name in given and name != "cnf" and self.cnf is not None:
                raise InputError("cannot be combined with --cnf; choose one", declare.place_of(name))
        if self.kind == SAT and len(_structure(str(self.structure), declare.place_of("structure"))) != 2:
            raise InputError(
                "expected the numbers of variables and clauses, such as 20,90", declare.place_of("structure")
            )
        if "/" in self.name or self.name.startswith("."):
            raise InputError(f"found {shorten(self.name)}, expected a name without directory", declare.place_of("name"))
