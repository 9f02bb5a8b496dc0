"""`robust pike`: plans with choices."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from robust.backends import DRAKE
from robust.cli.guard import Run, action
from robust.errors import UNDECIDED, InputError, exit_code_of
from robust.options import declare
from robust.options import pike as asking
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.api import AnytimeSearch
    from robust.pike_bridge.action_model import Instance
    from robust.pike_bridge.envelopes.parameters import ParametricPlan
    from robust.pike_bridge.envelopes.search import LabeledRegion
    from robust.pike_bridge.model import TeamPlan
    from robust.pike_bridge.online.world import ExecutionRecord
    from robust.show.pike import PikePlot
    from robust.show.pike_envelopes import Cells

Asked = TypeVar("Asked", bound=asking.Staged)


def load(options: asking.TeamPlanFile) -> TeamPlan:
    """The plan of a command."""
    from robust.pike_bridge.action_model import load_team_plan

    return load_team_plan(options.file, epsilon=options.separation)


# -- check, compile and plot -------------------------------------------------------------------------------------------


def _within(options: Asked, run: Run) -> Asked:
    """The options with the time that remains, and with each stage displayed."""
    return options.changed(timeout=run.remaining, on_stage=run.display.say)


@action(asking.PikeCheckCommand)
def check(options: asking.PikeCheckCommand, run: Run) -> int:
    """Is there a correct execution of a plan with choices, given some of the choices? If so, show one."""
    if options.cross:
        return _cross(options, run)
    if options.patience:
        return _patience(options, run)
    from robust.pike import searching_check

    result = run.reply(lambda: searching_check(load(options), _within(options, run)))
    verdict = result.verdict.value
    return exit_code_of(verdict) if result.complete or verdict == "refuted" else UNDECIDED


def _cross(options: asking.PikeCheckCommand, run: Run) -> int:
    from robust.pike import searching_differences

    crossed = run.reply(lambda: searching_differences(load(options), _within(options, run)))
    return 1 if crossed.outcome is not None and not crossed.outcome.agree else exit_code_of(crossed.status)


def _patience(options: asking.PikeCheckCommand, run: Run) -> int:
    from robust.pike import searching_moments

    asked = asking.MomentsOptions(assume=options.assume, solver=options.solver, timeout=run.remaining)
    moments = run.reply(lambda: searching_moments(load(options), asked))
    return 1 if moments.feasible is False else exit_code_of(moments.status)


@action(asking.PikeCompileCommand)
def compile_(options: asking.PikeCompileCommand, run: Run) -> int:
    """Compile a plan with choices for execution: sizes, and seconds of each stage."""
    from robust.pike import searching_sizes

    sizes = run.reply(lambda: searching_sizes(load(options), _within(options, run)))
    return exit_code_of(sizes.status)


@action(asking.PikePlotCommand)
def plot(options: asking.PikePlotCommand, run: Run) -> int:
    """Draw events, activities, choices and guards of a plan; with assumptions, only what they leave."""
    from robust.show import pike
    from robust.show.documents import document

    drawn, draw = run.only(lambda: _drawing(options, run))
    run.answer(lambda: document(drawn), lambda out: pike.print_plot(out, drawn, quiet=options.quiet))
    run.write(lambda: run.only(draw))
    return 0


def _drawing(options: asking.PikePlotCommand, run: Run) -> tuple[PikePlot, Callable[[], object]]:
    """What there is to see in a drawing of the plan, and what draws it."""
    from robust.pike import assumed
    from robust.pike_bridge.semantics import restrict
    from robust.show import pike

    plan = load(options)
    plan = restrict(plan, assumed(plan, options.assume))
    links = None
    if options.links:
        from robust.pike_bridge.causal import augment
        from robust.pike_bridge.distance_graph import StructuralPrecedence

        run.display.say("links")
        links = augment(plan, StructuralPrecedence(plan.network, epsilon=plan.separation)).links
    from robust.draw.tpnu import DrawnLink, plot_network

    arrows = [DrawnLink(link.producer.event, link.consumer.first, str(link.consumer.literal)) for link in links or ()]
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


@action(asking.PikeRunCommand)
def run(options: asking.PikeRunCommand, run: Run) -> int:
    """Execute a plan with choices: dispatch, recognise intent, adapt, watch for what goes wrong."""
    if options.stdio:
        from robust.cli.serving import serve
        from robust.pike_bridge.online.reasoners import without_states

        seen = without_states if options.reasoner == DRAKE else lambda plan: plan
        return serve(run, options, lambda: seen(load(options)))
    from robust.pike import searching_execution

    def begin() -> AnytimeSearch[ExecutionRecord]:
        search = searching_execution(load(options), options.changed(timeout=run.remaining))
        run.display.say("executing")
        return search

    record = run.reply(begin)
    if options.plot is not None:
        run.write(partial(record.plot, options.plot))
    return exit_code_of(record.ending.value)


# -- envelopes ---------------------------------------------------------------------------------------------------------


def _parametric(options: asking.PikeRegionCommand | asking.PikeEnvelopeCommand) -> ParametricPlan:
    """The plan with its parameters; InputError if there are none, or one is wrong."""
    from robust.pike import parametric

    plan = parametric(options.file, options)
    if not plan.parameters:
        raise InputError(
            "found no parameters, expected some: --parameter duration:ACTIVITY, or a file",
            declare.place_of("parameters"),
        )
    if options.plot is not None:
        from robust.draw.plane import shown_team_axes

        shown_team_axes(plan, tuple(options.axes or ()))
    return plan


@action(asking.PikeRegionCommand)
def region(options: asking.PikeRegionCommand, run: Run) -> int:
    """For which durations and limits does each choice of a plan lead to a correct execution?"""
    from robust.pike import searching_region
    from robust.show import pike_envelopes as show

    count, drawn = 0, tuple(options.axes or ())

    def on_piece(_piece: object) -> None:
        nonlocal count
        count += 1
        run.display.say(f"polyhedra: {count}")

    cells: Cells | None = None

    def answer(result: LabeledRegion) -> None:
        run.answer(
            lambda: show.region_document(result, cells), lambda out: show.print_region(out, result, quiet=options.quiet)
        )

    def asked() -> asking.PikeRegionOptions:
        return options.changed(timeout=run.remaining, on_piece=on_piece)

    result = run.best(lambda: searching_region(_parametric(options), asked()), answer)
    if not result.cut_short and (options.json or options.plot is not None):
        cells = run.also("cutting", lambda: _cells(result, run))
    answer(result)
    if options.plot is not None:
        from robust.draw.plane import plot_cells

        run.write(partial(plot_cells, result, cells, options.plot, drawn))
    if result.cut_short:
        return exit_code_of(result.status.value)
    return 0 if result.pieces else 1


def _cells(result: LabeledRegion, run: Run) -> Cells | None:
    """The region cut by what is possible; None if there is no time."""
    try:
        return result.exactly(Deadline.after(run.remaining))
    except OutOfTimeError:
        return None


@action(asking.PikeEnvelopeCommand)
def envelope(options: asking.PikeEnvelopeCommand, run: Run) -> int:
    """How far may durations and limits of a plan with choices deviate: for some choices, or whatever people choose?"""
    from robust.pike import searching_envelope

    result = run.reply(lambda: searching_envelope(_parametric(options), _within(options, run)))
    if options.plot is not None and result.combinations:
        run.write(partial(result.plot, options.plot, axes=tuple(options.axes or ())))
    return exit_code_of(result.status.value)


# -- new ---------------------------------------------------------------------------------------------------------------


@action(asking.PikeNewCommand)
def new(options: asking.PikeNewCommand, run: Run) -> int:
    """Write an example plan with choices and its PDDL files, and suggest what to try next."""
    from robust.pike_bridge.action_model import shipped
    from robust.pike_bridge.builder import k_intents
    from robust.show import pike as show

    def write() -> tuple[Instance, Path]:
        generated = options.kind == asking.K_INTENTS
        instance = k_intents(options.structure, options.seed).instance if generated else shipped(options.kind)
        name = options.name or instance.name
        files = [options.output / file for file in (f"{name}.tpnu.json", "domain.pddl", "problem.pddl")]
        declare.refuse_replacing(files, declare.place_of("output"), force=options.force)
        return instance, instance.write(options.output, name)

    instance, path = run.only(write)
    run.answer(
        lambda: show.new_document(instance, path), lambda out: show.print_new(out, instance, path, quiet=options.quiet)
    )
    return 0
