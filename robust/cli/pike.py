"""`robust pike`: plans with choices. Its options are declared here, each once, as in :mod:`robust.options`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.backends import DRAKE, KNOWLEDGE_BASES, REASONERS, SMT, deciding
from robust.cli.build import action
from robust.cli.guard import Run
from robust.errors import UNDECIDED, InputError, Location, UnsupportedError, did_you_mean, exit_code_of
from robust.numbers import Number, shorten
from robust.options.commands import ASSUMED
from robust.options.declare import argument, named_values, not_negative, option, ordinal, place_of, plot_file, positive
from robust.options.shared import Force, Output, Separation, Solving
from robust.smt.limits import Deadline

if TYPE_CHECKING:
    from robust.api import Search
    from robust.pike_bridge.compile import PikeCheck, Sizes
    from robust.pike_bridge.cross_check import Crossed
    from robust.pike_bridge.model import Guard, TeamPlan
    from robust.pike_bridge.online.moments import Moments
    from robust.pike_bridge.online.world import ExecutionRecord
    from robust.show.pike import PikePlot

# -- options -----------------------------------------------------------------------------------------------------------


class TeamPlanFile(Separation):
    """Where the plan is, and ε: how much earlier is "before"."""

    file: Path = argument(..., "a plan with choices, .tpnu.json", "FILE")

    def load(self) -> TeamPlan:
        """The plan."""
        from robust.pike_bridge.action_model import load_team_plan

        return load_team_plan(self.file, epsilon=self.separation)


class PikeOptions(TeamPlanFile, Solving, Output):
    """What most commands take."""


ASSUME: Any = option((), ASSUMED, metavar="NAME=VALUE", many=True)
_TEMPORAL: Any = option(
    "lazy",
    "lazy: order by structure, conflicts as they are needed; apsp: labeled all-pairs shortest paths",
    choices=("lazy", "apsp"),
)


def witness_directory(path: Path, _place: Location) -> Path:
    """InputError if it is a file."""
    if path.exists() and not path.is_dir():
        raise InputError(f"--witness: found file {str(path)!r}, expected a directory")
    return path


class PikeCheckCommand(PikeOptions, Force):
    """Of `robust pike check`."""

    file: Path | None = argument(None, "a plan with choices, .tpnu.json; none with --random", "FILE")  # type: ignore[assignment]

    backend: str = option("oracle", "who answers", choices=("oracle", *KNOWLEDGE_BASES))
    assume: tuple[str, ...] = ASSUME
    all_scenarios: bool = option(False, "find every team scenario that admits a correct execution")
    cross: bool = option(False, "ask all back ends and the oracle the same questions, and compare")
    patience: bool = option(
        False, "find out until when people can make each choice, with each value, if all else suits it"
    )
    witness: Path | None = option(
        None,
        "with --cross: where to write a small plan on which they differ",
        metavar="DIR",
        path=True,
        read=witness_directory,
        also=lambda folder: [folder / name for name in ("plan.tpnu.json", "domain.pddl", "problem.pddl")],
    )
    random: int | None = option(
        None, "with --cross: compare on so many random plans instead of a file", metavar="N", read=ordinal
    )
    sizes: str = option("small", "with --random: how large they are", choices=("small", "medium", "paper"))
    seed: int = option(0, "with --cross: which sets of choices are tried, and which random plans", metavar="N")
    temporal: str = _TEMPORAL

    def check_combinations(self, given: Collection[str]) -> None:
        if self.random is not None and not self.cross:
            raise InputError("expected only together with --cross", place_of("random"))
        if self.random is None and "sizes" in given:
            raise InputError("expected only together with --random", place_of("sizes"))
        if (self.file is None) == (self.random is None):
            found = "neither" if self.file is None else "both"
            raise InputError(f"found {found} of FILE and --random, expected one of them")
        for name in ("cross", "backend", "all_scenarios", "temporal") if self.patience else ():
            if name in given:
                raise InputError("found together with --patience, expected without", place_of(name))


class PikeCompileCommand(PikeOptions):
    """Of `robust pike compile`."""

    backend: str = option("pitms", "what is compiled", choices=KNOWLEDGE_BASES)
    temporal: str = _TEMPORAL
    shortcut: bool = option(True, "whether a solver may find that there is no correct execution at all")
    implicants: bool = option(False, "list the prime implicants (pitms, bdd)")
    models: bool = option(True, "whether models are counted")


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
    stdio: bool = option(False, "simulate nothing, but serve a real team through lines of JSON")
    journal: Path | None = option(
        None, "as a service: write each step here first, and go on from it", metavar="FILE", path=True
    )
    clock: str = option("given", "as a service: the time that messages give, or real time", choices=("given", "real"))
    rate: Number | None = option(
        None, "in real time: seconds that a unit of time lasts, else 1", metavar="S", read=positive
    )
    patience: Fraction | None = option(
        "0",
        "how long before the last moment to stop waiting for what people may still choose; "
        f"{EAGER}: do not wait, act as soon as possible",
        metavar=f"{EAGER}|MARGIN",
        read=_margin,
    )
    infer: bool = option(True, "find out which values open choices may still have")
    explain: bool = option(False, "say why, below each decision and inference")
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
        if None not in (self.reasoner, self.backend) and (self.reasoner == SMT) != (self.backend == SMT):
            expected = SMT if self.reasoner == SMT else ", ".join(KNOWLEDGE_BASES)
            raise InputError(
                f"found {self.backend} with --reasoner {self.reasoner}, expected {expected}", place_of("backend")
            )

    def seen(self) -> TeamPlan:
        """The plan as the executive sees it."""
        from robust.pike_bridge.online.reasoners import without_states

        return without_states(self.load()) if self.reasoner == DRAKE else self.load()

    @property
    def deciding(self) -> str:
        """The name of what decides: smt, or the knowledge base of windows."""
        return deciding(self.reasoner, self.backend)


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
    assume: tuple[str, ...] = ASSUME
    links: bool = option(False, "draw the labeled causal links as well")


def assumed(plan: TeamPlan, texts: Sequence[str]) -> Guard:
    """`NAME=VALUE` of choices of the plan, each at most once.

    Raises:
        InputError: for any other text, and for two different values of one choice.
    """
    from robust.pike_bridge.compile import checked_assumptions

    return checked_assumptions(plan, named_values(texts, "assume"))


# -- check, compile and plot -------------------------------------------------------------------------------------------


@action(PikeCheckCommand)
def check(options: PikeCheckCommand, run: Run) -> int:
    """Is there a correct execution of a plan with choices, given some of the choices? If so, show one."""
    if options.cross:
        return _cross(options, run)
    if options.patience:
        return _patience(options, run)
    from robust.pike_bridge.compile import Checking, Temporal

    def begin() -> Search[PikeCheck]:
        plan = options.load()
        return Checking(
            plan,
            backend=options.backend,
            assume=assumed(plan, options.assume),
            all_scenarios=options.all_scenarios,
            solver=options.solver,
            temporal=Temporal(options.temporal),
            deadline=Deadline.after(run.remaining),
            on_stage=run.display.say,
        )

    result = run.reply(begin)
    found = result.verdict.value
    return exit_code_of(found) if result.complete or found == "refuted" else UNDECIDED


def _cross(options: PikeCheckCommand, run: Run) -> int:
    if options.random is not None:
        return _cross_random(options, options.random, run)
    from robust.pike_bridge.cross_check import Crossing

    def begin() -> Search[Crossed]:
        return Crossing(
            options.load(),
            witness=options.witness,
            seed=options.seed,
            solver=options.solver,
            deadline=Deadline.after(run.remaining),
            on_stage=run.display.say,
        )

    crossed = run.reply(begin)
    return 1 if crossed.outcome is not None and not crossed.outcome.agree else exit_code_of(crossed.status)


def _cross_random(options: PikeCheckCommand, number: int, run: Run) -> int:
    from robust.pike_bridge.cross_random import RandomCrossed, RandomCrossing

    def begin() -> Search[RandomCrossed]:
        return RandomCrossing(
            number,
            options.seed,
            options.sizes,
            witness=options.witness,
            epsilon=options.separation,
            solver=options.solver,
            deadline=Deadline.after(run.remaining),
            on_stage=run.display.say,
        )

    crossed = run.reply(begin)
    return 1 if not crossed.agree else exit_code_of(crossed.status)


def _patience(options: PikeCheckCommand, run: Run) -> int:
    from robust.pike_bridge.online.moments import LatestMoments

    def begin() -> Search[Moments]:
        plan = options.load()
        return LatestMoments(
            plan, assumed(plan, options.assume), options.solver, deadline=Deadline.after(run.remaining)
        )

    found = run.reply(begin)
    return 1 if found.feasible is False else exit_code_of(found.status)


@action(PikeCompileCommand)
def compile_(options: PikeCompileCommand, run: Run) -> int:
    """Compile a plan with choices for execution: sizes, and seconds of each stage."""

    from robust.pike_bridge.compile import Measuring, Temporal
    from robust.pike_bridge.knowledge import knowledge_bases

    def begin() -> Search[Sizes]:
        able = [name for name, registration in knowledge_bases().items() if registration.knows_implicants]
        if options.implicants and options.backend not in able:
            raise UnsupportedError(
                f"--implicants: back end {options.backend} has no prime implicants; "
                f"expected --backend {' or '.join(able)}"
            )
        return Measuring(
            options.load(),
            options.backend,
            temporal=Temporal(options.temporal),
            solver=options.solver,
            shortcut=options.shortcut,
            implicants=options.implicants,
            models=options.models,
            deadline=Deadline.after(run.remaining),
            on_stage=run.display.say,
        )

    sizes = run.reply(begin)
    return exit_code_of(sizes.status)


@action(PikePlotCommand)
def plot(options: PikePlotCommand, run: Run) -> int:
    """Draw events, activities, choices and guards of a plan; with assumptions, only what they leave."""
    from robust.show import pike
    from robust.show.documents import document

    drawn, draw = run.only(lambda: _drawing(options, run))
    run.answer(lambda: document(drawn), lambda out: pike.print_plot(out, drawn, quiet=options.quiet))
    run.write(lambda: run.only(draw))
    return 0


def _drawing(options: PikePlotCommand, run: Run) -> tuple[PikePlot, Callable[[], object]]:
    """What there is to see in a drawing of the plan, and what draws it."""
    from robust.pike_bridge.scenarios import restrict
    from robust.show import pike

    plan = options.load()
    plan = restrict(plan, assumed(plan, options.assume))
    links = None
    if options.links:
        from robust.pike_bridge.causal import augment
        from robust.pike_bridge.temporal.structural import StructuralPrecedence

        run.display.say("links")
        links = augment(plan, StructuralPrecedence(plan.network, epsilon=plan.separation)).links
    from robust.show.network import Link, plot_network

    arrows = [Link(link.producer.event, link.consumer.first, str(link.consumer.literal)) for link in links or ()]
    draw = partial(plot_network, plan.network, options.output, links=arrows, epsilon=options.separation)
    drawn = pike.PikePlot(
        plot=str(options.output),
        events=len(plan.network.events),
        activities=len(plan.network.activities),
        choices=len(plan.network.choices),
        links=None if links is None else len(links),
    )
    return drawn, draw


# -- run ---------------------------------------------------------------------------------------------------------------


@action(PikeRunCommand)
def run(options: PikeRunCommand, run: Run) -> int:
    """Execute a plan with choices: dispatch, recognise intent, adapt, watch for what goes wrong."""
    if options.stdio:
        from robust.cli.serving import serve

        rate = Fraction(options.rate or 1) if options.clock == "real" else None
        return serve(
            run,
            options.seen,
            backend=options.deciding,
            solver=options.solver,
            journal=options.journal,
            rate=rate,
            patience=options.patience,
        )
    from robust.pike import story
    from robust.pike_bridge.online.world import Rehearsal

    def begin() -> Search[ExecutionRecord]:
        plan = options.load()
        told = story(
            plan,
            human=options.human,
            pace=options.pace,
            outcome=options.outcome,
            disturb=options.disturb,
            delay=options.delay,
        )
        run.display.say("executing")
        return Rehearsal(
            plan,
            told,
            seed=options.seed,
            infer=options.infer,
            explain=options.explain,
            solver=options.solver,
            backend=options.deciding,
            drake=options.reasoner == DRAKE,
            patience=options.patience,
            deadline=Deadline.after(run.remaining),
        )

    record = run.reply(begin)
    if options.plot is not None:
        run.write(partial(record.plot, options.plot))
    return exit_code_of(record.ending.value)
