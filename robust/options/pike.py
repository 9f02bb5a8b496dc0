"""Options of plans with choices: what the functions of :mod:`robust.pike` take, and what commands take in addition."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from robust.backends import DRAKE, KNOWLEDGE_BASES, REASONERS, SMT, deciding
from robust.errors import InputError, Location, did_you_mean
from robust.numbers import Number, shorten
from robust.options.commands import ASSUMED
from robust.options.declare import (
    Options,
    argument,
    names,
    not_negative,
    option,
    place_of,
    plot_file,
    positive,
    setting,
)
from robust.options.shared import Force, Output, Separation, Slice, Solving

if TYPE_CHECKING:
    from robust.pike_bridge.online.world import Disturbance, ExecutionStep

Assumptions = Mapping[str, str] | str | Sequence[str]
"""Values of choices that are made already, by name or as texts `NAME=VALUE`."""


class TeamPlanFile(Separation):
    """Where the plan is, and ε: how much earlier is "before"."""

    file: Path = argument(..., "a plan with choices, .tpnu.json", "FILE")


class PikeCommand(TeamPlanFile, Output):
    """What all commands about a plan take."""


class Assuming(Options):
    """Which choices are made already."""

    assume: Assumptions = option((), ASSUMED, metavar="NAME=VALUE", many=True)


class Staged(Solving):
    """A question that is answered in stages."""

    on_stage: Callable[[str], None] | None = option(None, "called with the name of each stage", shown=False)


class Compiled(Staged):
    """How a knowledge base is compiled."""

    temporal: str = option(
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


# -- questions ---------------------------------------------------------------------------------------------------------


class PikeCheckOptions(Compiled, Assuming):
    """Of :func:`robust.pike.check`."""

    backend: str = option(
        "oracle",
        "oracle: ask a solver about the semantics themselves; else ask a knowledge base",
        choices=("oracle", *KNOWLEDGE_BASES),
    )
    all_scenarios: bool = option(False, "find every team scenario that admits a correct execution")


class MomentsOptions(Solving, Assuming):
    """Of :func:`robust.pike.moments`."""


class CrossOptions(Staged, Force):
    """Of :func:`robust.pike.cross_check`."""

    witness: str | Path | None = option(
        None,
        "with --cross: where to write a small plan on which they differ",
        metavar="DIR",
        path=True,
        read=witness_directory,
        also=lambda folder: [folder / name for name in ("plan.tpnu.json", "domain.pddl", "problem.pddl")],
    )
    seed: int = option(0, "with --cross: which sets of choices are tried", metavar="N")


class PikeCheckCommand(PikeCheckOptions, CrossOptions, PikeCommand):
    """Of `robust pike check`."""

    cross: bool = option(False, "ask all back ends and the oracle the same questions, and compare")
    patience: bool = option(
        False, "find out until when people can make each choice, with each value, if all else suits it"
    )

    def check_combinations(self, given: Collection[str]) -> None:
        for name in ("cross", "backend", "all_scenarios", "temporal") if self.patience else ():
            if name in given:
                raise InputError("found together with --patience, expected without", place_of(name))


class KnowledgeBaseOptions(Compiled):
    """Of :func:`robust.pike.knowledge_base`."""

    backend: str = option("pitms", "what is compiled", choices=KNOWLEDGE_BASES)
    shortcut: bool = option(True, "whether a solver may find that there is no correct execution at all")


class PikeCompileOptions(KnowledgeBaseOptions):
    """Of :func:`robust.pike.compile`."""

    implicants: bool = option(False, "list the prime implicants (pitms, bdd)")
    models: bool = option(True, "whether models are counted")


class PikeCompileCommand(PikeCompileOptions, PikeCommand):
    """Of `robust pike compile`."""


# -- executions --------------------------------------------------------------------------------------------------------


def _deciding_backend(name: str, place: Location) -> str:
    """InputError unless an executive can reason with the back end."""
    known = (SMT, *KNOWLEDGE_BASES)
    if name not in known:
        raise InputError(f"found unknown back end {shorten(name)}{did_you_mean(name, known)}", place)
    return name


def _margin(value: Number, place: Location) -> Fraction | None:
    """How long before the last moment waiting ends; None for `eager`."""
    if value == EAGER:
        return None
    try:
        return not_negative(value, place)
    except InputError:
        expected = f"{EAGER}, or a number of at least 0"
        raise InputError(f"found {shorten(str(value))}, expected {expected}", place) from None


EAGER = "eager"
_SIMULATED = ("human", "pace", "outcome", "disturb", "delay", "seed", "infer", "plot")
_SERVED = ("journal", "clock", "rate")


class StoryOptions(Options):
    """Of :func:`robust.pike.story`: what a simulated team does."""

    human: str = option(
        "rational",
        "how uncontrollable choices are made: among what remains correct, or anyhow",
        choices=("rational", "careless"),
    )
    pace: str = option(
        "cooperative",
        "how long activities take: so that a correct execution is left if possible, or regardless",
        choices=("cooperative", "least", "random"),
    )
    outcome: Mapping[str, str | tuple[str, Number]] | str | Sequence[str] = option(
        (), "what is chosen, and when it is known; may be repeated", metavar="NAME=VALUE[@TIME]", many=True
    )
    disturb: str | Sequence[str | Disturbance] = option(
        (), "what goes wrong: '(not (atom))@3'; may be repeated", metavar="LITERAL@TIME", many=True
    )
    delay: Number = option("0", "humans hesitate this long at most", metavar="T", read=not_negative)


class PikeRunOptions(StoryOptions, Solving):
    """Of :func:`robust.pike.run`."""

    seed: int = option(0, "decides what is left open", metavar="N")
    reasoner: str | None = option(
        None,
        "who decides: smt asks a solver and compiles nothing; windows: labeled execution windows and a knowledge base, "
        f"as PIKE does; {DRAKE}: the same without what activities need and do; else smt, or windows with --backend",
        choices=REASONERS,
    )
    backend: str | None = option(
        None,
        f"the knowledge base of windows and {DRAKE}: {', '.join(KNOWLEDGE_BASES)}, else pitms",
        metavar="NAME",
        read=_deciding_backend,
    )
    patience: Number | None = option(
        "0",
        "how long before the last moment to stop waiting for what people may still choose; "
        f"{EAGER}: do not wait, act as soon as possible",
        metavar=f"{EAGER}|MARGIN",
        read=_margin,
    )
    infer: bool = option(True, "find out which values open choices may still have")
    explain: bool = option(False, "say why, below each decision and inference")
    on_step: Callable[[ExecutionStep], None] | None = option(None, "called after each step", shown=False)

    def check_combinations(self, given: Collection[str]) -> None:
        if None not in (self.reasoner, self.backend) and (self.reasoner == SMT) != (self.backend == SMT):
            expected = SMT if self.reasoner == SMT else ", ".join(KNOWLEDGE_BASES)
            raise InputError(
                f"found {self.backend} with {setting('reasoner', str(self.reasoner))}, expected {expected}",
                place_of("backend"),
            )

    @property
    def deciding(self) -> str:
        """The name of what decides: smt, or the knowledge base of windows."""
        return deciding(self.reasoner, self.backend)

    @property
    def margin(self) -> Fraction | None:
        """How long before the last moment waiting ends; None: nothing is waited for."""
        return None if self.patience is None else Fraction(self.patience)


class PikeRunCommand(PikeRunOptions, PikeCommand):
    """Of `robust pike run`."""

    stdio: bool = option(False, "simulate nothing, but serve a real team through lines of JSON")
    journal: Path | None = option(
        None, "as a service: write each step here first, and go on from it", metavar="FILE", path=True
    )
    clock: str = option("given", "as a service: the time that messages give, or real time", choices=("given", "real"))
    rate: Number | None = option(
        None, "in real time: seconds that a unit of time lasts, else 1", metavar="S", read=positive
    )
    plot: Path | None = option(
        None, "draw who did what when: .svg, .png or .pdf", metavar="FILE", path=True, read=plot_file
    )

    def check_combinations(self, given: Collection[str]) -> None:
        for name in _SIMULATED if self.stdio else _SERVED:
            if name in given:
                reason = "found together with --stdio, expected without: nothing is simulated then"
                raise InputError(reason if self.stdio else "expected only together with --stdio", place_of(name))
        if self.rate is not None and self.clock != "real":
            raise InputError("found a rate, expected none unless with --clock real", place_of("rate"))
        super().check_combinations(given)


class PikePlotCommand(TeamPlanFile, Output, Assuming):
    """Of `robust pike plot`."""

    output: Path = option(
        ...,
        "where to draw: .svg, .png or .pdf by suffix",
        "--output",
        "-o",
        "--plot",
        metavar="FILE",
        path=True,
        read=lambda path, _place: plot_file(path, place_of("plot")),
    )
    links: bool = option(False, "draw the labeled causal links as well")


# -- envelopes ---------------------------------------------------------------------------------------------------------


class ParametricOptions(Solving, Assuming):
    """Which bounds are parameters."""

    parameters: str | Sequence[str] = option(
        (),
        "make a bound a parameter: [NAME=]duration:ACTIVITY, at-least: or at-most:ACTIVITY or FROM:TO (events), or "
        "hesitation:CHOICE; then ,weight=W ,lb=L ,ub=U ,default=D; may be repeated",
        "--parameter",
        metavar="SPEC",
        many=True,
    )
    parameter_file: str | Path | None = option(
        None, "more parameters, in a TOML file", "--parameters", metavar="FILE", path=True
    )


def _names_or_none(value: str | Sequence[str], place: Location) -> tuple[str, ...]:
    """Names, or none of them."""
    return names(value, place) if value else ()


class PikeRegionOptions(ParametricOptions):
    """Of :func:`robust.pike.region`."""

    choices: str | Sequence[str] | None = option(
        None,
        "choices distinguished in the answer, the others are existentially quantified; if not given, those of people "
        "and nature; '' for none",
        metavar="A,B",
        read=_names_or_none,
    )
    on_piece: Callable[[object], None] | None = option(None, "called with each polyhedron that is found", shown=False)


class PikeEnvelopeOptions(ParametricOptions, Staged):
    """Of :func:`robust.pike.envelope`."""

    for_all: str | Sequence[str] = option(
        (),
        "choices of which every combination of values must lead to a correct execution",
        metavar="A,B",
        read=_names_or_none,
    )
    patience: bool = option(False, "with --for-all: what is chosen becomes known only then, and the team waits for it")

    def check_combinations(self, given: Collection[str]) -> None:
        if self.patience and not self.for_all:
            raise InputError("expected only together with --for-all", place_of("patience"))


class PikeRegionCommand(PikeRegionOptions, PikeCommand, Slice):
    """Of `robust pike region`."""


class PikeEnvelopeCommand(PikeEnvelopeOptions, PikeCommand, Slice):
    """Of `robust pike envelope`."""


# -- new plans ---------------------------------------------------------------------------------------------------------

K_INTENTS = "k-intents"


def _structure(text: str, place: Location) -> tuple[int, ...]:
    """`2,3,2`: how many options each pair of choices has."""
    try:
        sizes = tuple(int(part) for part in text.split(","))
    except ValueError:
        sizes = ()
    if not sizes or min(sizes) < 1 or max(sizes) > 1000 or len(sizes) > 100:
        raise InputError(f"found {shorten(text)}, expected whole numbers of at least 1 such as 2,3,2", place)
    return sizes


class PikeNewCommand(Force, Output):
    """Of `robust pike new`."""

    kind: str = option(
        ..., "kitchen, wing or k-intents", metavar="KIND", choices=("kitchen", "wing", K_INTENTS), argument=True
    )
    output: Path = option(..., "the directory to write to", "--output", "-o", metavar="DIR", path=True)
    name: str = option("", "of the .tpnu.json file, else that of the plan", metavar="NAME")
    structure: tuple[int, ...] = option(
        "2,2", "k-intents: how many options each pair of choices has", metavar="N,N", read=_structure
    )
    seed: int = option(0, "k-intents: decides what is drawn", metavar="N")

    def check_combinations(self, given: Collection[str]) -> None:
        for name in ("structure", "seed"):
            if name in given and self.kind != K_INTENTS:
                raise InputError(f"expected only with {K_INTENTS}, found {self.kind}", place_of(name))
        if "/" in self.name or self.name.startswith("."):
            raise InputError(f"found {shorten(self.name)}, expected a name without directory", place_of("name"))
