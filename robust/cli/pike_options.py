"""The options of `robust pike`, each once, as in :mod:`robust.options`."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from robust.backends import KNOWLEDGE_BASES
from robust.errors import InputError, Location, did_you_mean
from robust.numbers import shorten
from robust.options import (
    EPSILON,
    Number,
    Options,
    Output,
    Solving,
    argument,
    not_negative,
    option,
    place_of,
    plot_file,
    positive,
)

if TYPE_CHECKING:
    from robust.pike_bridge.model import TeamPlan


class TeamPlanFile(Options):
    """Where the plan is, and ε, which its knowledge bases need above 0."""

    file: Path = argument(..., "a plan with choices, .tpnu.json", "FILE")
    epsilon: Number = option(
        "1/1000",
        "separation of mutex time points, in the plan's unit of time",
        metavar="E",
        read=positive,
        rank=EPSILON,
    )

    def load(self) -> TeamPlan:
        """The plan."""
        from robust.pike_bridge.action_model import load_team_plan

        return load_team_plan(self.file, epsilon=Fraction(self.epsilon))


class PikeOptions(TeamPlanFile, Solving, Output):
    """What most commands take."""


def _assume() -> tuple[str, ...]:
    found: tuple[str, ...] = option(
        (), "a choice that is made already; may be repeated", metavar="NAME=VALUE", many=True
    )
    return found


def _temporal() -> str:
    found: str = option(
        "lazy",
        "lazy: order by structure, conflicts as they are needed; apsp: labeled all-pairs shortest paths",
        choices=("lazy", "apsp"),
    )
    return found


def witness_directory(path: Path, _place: Location) -> Path:
    """InputError if it is a file."""
    if path.exists() and not path.is_dir():
        raise InputError(f"--witness: found file {str(path)!r}, expected a directory")
    return path


class PikeCheckCommand(PikeOptions):
    """Of `robust pike check`."""

    backend: str = option("oracle", "who answers", choices=("oracle", *KNOWLEDGE_BASES))
    assume: tuple[str, ...] = _assume()
    all_scenarios: bool = option(False, "find every team scenario that admits a correct execution")
    cross: bool = option(False, "ask all back ends and the oracle the same questions, and compare")
    witness: Path | None = option(
        None,
        "with --cross: where to write a small plan on which they differ",
        metavar="DIR",
        path=True,
        read=witness_directory,
    )
    seed: int = option(0, "with --cross: which sets of choices are tried", metavar="N")
    temporal: str = _temporal()


class PikeCompileCommand(PikeOptions):
    """Of `robust pike compile`."""

    backend: str = option("pitms", "what is compiled", choices=KNOWLEDGE_BASES)
    temporal: str = _temporal()
    shortcut: bool = option(True, "whether a solver may find that there is no correct execution at all")
    implicants: bool = option(False, "list the prime implicants (pitms, bdd)")
    models: bool = option(True, "whether models are counted")


_SIMULATED = ("human", "pace", "outcome", "disturb", "delay", "seed", "infer", "plot")
_SERVED = ("journal", "clock", "rate")


class PikeRunCommand(PikeOptions):
    """Of `robust pike run`."""

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
    outcome: tuple[str, ...] = option(
        (), "what is chosen, and when it is known; may be repeated", metavar="NAME=VALUE[@TIME]", many=True
    )
    disturb: tuple[str, ...] = option(
        (), "what goes wrong: '(not (atom))@3'; may be repeated", metavar="LITERAL@TIME", many=True
    )
    delay: Number = option("0", "humans hesitate this long at most", metavar="T", read=not_negative)
    seed: int = option(0, "decides what is left open", metavar="N")
    backend: str = option("smt", "who decides; smt asks a solver and compiles nothing", metavar="NAME")
    stdio: bool = option(False, "simulate nothing, but serve a real team through lines of JSON")
    journal: Path | None = option(
        None, "as a service: write each step here first, and go on from it", metavar="FILE", path=True
    )
    clock: str = option("given", "as a service: the time that messages give, or real time", choices=("given", "real"))
    rate: Number | None = option(
        None, "in real time: seconds that a unit of time lasts, else 1", metavar="S", read=positive
    )
    infer: bool = option(True, "find out which values open choices may still have")
    explain: bool = option(False, "say why, below each decision and inference")
    plot: Path | None = option(
        None, "draw who did what when: .svg, .png or .pdf", metavar="FILE", path=True, read=plot_file
    )

    def check_combinations(self, given: Collection[str]) -> None:
        names = _SIMULATED if self.stdio else _SERVED
        for name in names:
            if name in given:
                reason = "found together with --stdio, expected without: nothing is simulated then"
                raise InputError(reason if self.stdio else "expected only together with --stdio", place_of(name))
        if self.rate is not None and self.clock != "real":
            raise InputError("found a rate, expected none unless with --clock real", place_of("rate"))


class PikePlotCommand(TeamPlanFile, Output):
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
    assume: tuple[str, ...] = _assume()
    links: bool = option(False, "draw the labeled causal links as well")


def assumptions(texts: Sequence[str]) -> dict[str, str]:
    """`NAME=VALUE`, each choice at most once.

    Raises:
        InputError: for any other text, and for two different values of one choice.
    """
    found: dict[str, str] = {}
    for text in texts:
        place = place_of("assume", text)
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name or not value:
            raise InputError(f"found {shorten(text)}, expected NAME=VALUE", place)
        if found.setdefault(name, value) != value:
            raise InputError(f"found a second value for {shorten(name)}, expected one", place)
    return found


def check_backend(name: str) -> None:
    """InputError unless an executive can reason with the back end."""
    from robust.pike_bridge.online.reasoners import reasoner_names

    known = reasoner_names()
    if name not in known:
        raise InputError(f"found unknown back end {shorten(name)}{did_you_mean(name, known)}", place_of("backend"))
