"""`robust pike`: plans with choices."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import TYPE_CHECKING

from robust.cli.build import action
from robust.cli.guard import Cause, GivenUpError, Run
from robust.cli.pike_options import (
    PikeCheckCommand,
    PikeCompileCommand,
    PikePlotCommand,
    PikeRunCommand,
    assumptions,
    check_backend,
)
from robust.cli.plans import CODES
from robust.errors import InputError, Location, UnsupportedError, did_you_mean
from robust.numbers import parse_number, shorten
from robust.options import place_of
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from rich.console import Console

    from robust.api import Search
    from robust.pike_bridge.compile import PikeCheck, Sizes
    from robust.pike_bridge.cross_check import Crossed
    from robust.pike_bridge.model import TeamPlan
    from robust.pike_bridge.online.world import Disturbance, ExecutionRecord, Story
    from robust.show.documents import Document

# -- check, compile and plot -------------------------------------------------------------------------------------------


@action(PikeCheckCommand)
def check(options: PikeCheckCommand, run: Run) -> int:
    """Is there a correct execution of a plan with choices, given some of the choices? If so, show one."""
    if options.cross:
        return _cross(options, run)
    plan: TeamPlan | None = None

    def begin() -> Search[PikeCheck]:
        nonlocal plan
        from robust.pike_bridge.compile import Checking, Temporal, checked_assumptions

        plan = options.load()
        return Checking(
            plan,
            backend=options.backend,
            assume=checked_assumptions(plan, assumptions(options.assume)),
            all_scenarios=options.all_scenarios,
            solver=options.solver,
            temporal=Temporal(options.temporal),
            deadline=Deadline.after(run.remaining),
            on_stage=run.display.say,
        )

    def show(result: PikeCheck) -> None:
        from robust.show import pike

        run.answer(
            lambda: pike.check_document(result),
            lambda out: pike.print_check(out, result, plan, quiet=options.quiet),
        )

    result = run.best(begin, show)
    show(result)
    found = result.verdict.value
    return CODES[found] if result.complete or found == "refuted" else CODES["unknown"]


def _cross(options: PikeCheckCommand, run: Run) -> int:
    def begin() -> Search[Crossed]:
        from robust.pike_bridge.cross_check import Crossing

        return Crossing(
            options.load(),
            witness=options.witness,
            seed=options.seed,
            solver=options.solver,
            deadline=Deadline.after(run.remaining),
            on_stage=run.display.say,
        )

    def show(crossed: Crossed) -> None:
        from robust.show import pike

        run.answer(
            lambda: pike.cross_document(crossed),
            lambda out: pike.print_cross(out, crossed, quiet=options.quiet),
        )

    crossed = run.best(begin, show)
    show(crossed)
    return 1 if crossed.outcome is not None and not crossed.outcome.agree else CODES[crossed.status]


@action(PikeCompileCommand)
def compile_(options: PikeCompileCommand, run: Run) -> int:
    """Compile a plan with choices for execution: sizes, and seconds of each stage."""

    def begin() -> Search[Sizes]:
        from robust.pike_bridge.compile import Measuring, Temporal
        from robust.pike_bridge.knowledge import knowledge_bases

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

    def show(sizes: Sizes) -> None:
        from robust.show import pike

        run.answer(
            lambda: pike.compile_document(sizes),
            lambda out: pike.print_sizes(out, sizes, quiet=options.quiet),
        )

    sizes = run.best(begin, show)
    show(sizes)
    return CODES[sizes.status]


@action(PikePlotCommand)
def plot(options: PikePlotCommand, run: Run) -> int:
    """Draw events, activities, choices and guards of a plan; with assumptions, only what they leave."""
    plan, links = run.only(lambda: _draw(options, run))
    network = plan.network

    def drawn() -> Document:
        from robust.show.documents import document
        from robust.show.pike import PikePlot

        return document(
            PikePlot(
                plot=str(options.output),
                events=len(network.events),
                activities=len(network.activities),
                choices=len(network.choices),
                links=links,
            )
        )

    def tell(out: Console) -> None:
        if not options.quiet:
            out.print(
                f"{options.output}: {len(network.events)} events, {len(network.activities)} activities, "
                f"{len(network.choices)} choices" + ("" if links is None else f", {links} labeled causal links")
            )

    run.answer(drawn, tell)
    return 0


def _draw(options: PikePlotCommand, run: Run) -> tuple[TeamPlan, int | None]:
    """The plan that is drawn, and how many links."""
    from robust.pike_bridge.compile import checked_assumptions
    from robust.pike_bridge.scenarios import restrict

    plan = options.load()
    plan = restrict(plan, checked_assumptions(plan, assumptions(options.assume)))
    links = None
    if options.links:
        from robust.pike_bridge.causal import augment
        from robust.pike_bridge.temporal.structural import structural_precedence

        run.display.say("links")
        links = augment(plan, structural_precedence(plan.network)).links
    run.display.say("drawing")
    from robust.show.network import Link, plot_network

    arrows = [Link(link.producer.event, link.consumer.first, str(link.consumer.literal)) for link in links or ()]
    plot_network(plan.network, options.output, links=arrows, epsilon=Fraction(options.epsilon))
    return plan, None if links is None else len(links)


# -- run ---------------------------------------------------------------------------------------------------------------


@action(PikeRunCommand)
def run(options: PikeRunCommand, run: Run) -> int:
    """Execute a plan with choices: dispatch, recognise intent, adapt, watch for what goes wrong."""
    if options.stdio:
        from robust.cli.serving import serve

        return serve(options, run)
    plan: TeamPlan | None = None

    def begin() -> Search[ExecutionRecord]:
        nonlocal plan
        from robust.pike_bridge.online.world import Rehearsal

        check_backend(options.backend)
        plan = options.load()
        told = story(plan, options)
        run.display.say("executing")
        return Rehearsal(
            plan,
            told,
            seed=options.seed,
            infer=options.infer,
            explain=options.explain,
            solver=options.solver,
            backend=options.backend,
            deadline=Deadline.after(run.remaining),
        )

    def show(record: ExecutionRecord) -> None:
        from robust.show import pike

        run.answer(
            lambda: pike.run_document(record, seed=options.seed, backend=options.backend),
            lambda out: pike.print_run(out, record, seed=options.seed, explained=options.explain, quiet=options.quiet),
        )

    try:
        record = run.best(begin, show)
    except OutOfTimeError:  # while the back end was compiling
        run.guard.cause = run.guard.cause or Cause.TIMEOUT
        raise GivenUpError from None
    if options.plot is not None and plan is not None:
        from robust.show.gantt import draw_chart
        from robust.show.pike import run_chart

        draw_chart(run_chart(plan, record), options.plot)
    show(record)
    return {"succeeded": 0, "failed": 1}.get(record.ending.value, CODES["unknown"])


_ATOM = re.compile(r"\(\s*([^\s()]+(?:\s+[^\s()]+)*)\s*\)")
_NEGATION = re.compile(r"\(\s*not\s*(\(.*\))\s*\)", re.IGNORECASE)


def story(plan: TeamPlan, options: PikeRunCommand) -> Story:
    """What is known beforehand of a simulated execution.

    Raises:
        InputError: if a choice, a value, an atom or a time is not what it should be.
    """
    from robust.pike_bridge.online.world import Human, Pace, Story

    return Story(
        human=Human(options.human),
        pace=Pace(options.pace),
        outcomes=dict(_outcome(plan, text) for text in options.outcome),
        disturbances=tuple(_disturbance(plan, text) for text in options.disturb),
        delay=Fraction(options.delay),
    )


def _outcome(plan: TeamPlan, text: str) -> tuple[str, tuple[str, Fraction | None]]:
    """`NAME=VALUE`, or `NAME=VALUE@TIME`."""
    from robust.pike_bridge.compile import checked_assumptions

    place = place_of("outcome", text)
    assignment, at, time = (part.strip() for part in text.partition("@"))
    name, equals, value = (part.strip() for part in assignment.partition("="))
    if not equals or not name or not value:
        raise InputError(f"found {shorten(text)}, expected NAME=VALUE or NAME=VALUE@TIME", place)
    checked_assumptions(plan, {name: value})
    if next(each.controllable for each in plan.network.choices if each.name == name):
        raise InputError(f"{name} is for the executive to choose; expected an uncontrollable choice", place)
    return name, (value, _time(time, place) if at else None)


def _disturbance(plan: TeamPlan, text: str) -> Disturbance:
    """`(atom)@TIME` or `(not (atom))@TIME`."""
    from robust.pike_bridge.model import Literal
    from robust.pike_bridge.online.world import Disturbance
    from robust.plan.model import Atom

    place = place_of("disturb", text)
    literal, at, time = (part.strip() for part in text.rpartition("@"))
    literal, time = (literal, time) if at else (text, "")
    negated = _NEGATION.fullmatch(literal)
    atom = _ATOM.fullmatch(negated.group(1) if negated else literal)
    if atom is None or not time:
        raise InputError(f"found {shorten(text)}, expected '(atom)@TIME' or '(not (atom))@TIME'", place)
    predicate, *arguments = atom.group(1).lower().split()
    wanted = Atom(predicate, tuple(arguments))
    known = {str(effect.literal.atom) for effect in plan.effects}
    if str(wanted) not in known:
        raise InputError(f"nothing in the plan is about {wanted}{did_you_mean(str(wanted), known)}", place)
    return Disturbance(_time(time, place), Literal(wanted, negated is None))


def _time(text: str, place: Location) -> Fraction:
    time = parse_number(text, place)
    if time < 0:
        raise InputError(f"found time {shorten(text)}, expected 0 or later", place)
    return time
