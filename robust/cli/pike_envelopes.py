"""`robust pike region` and `robust pike envelope`: how far durations and limits of plans with choices may deviate."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from robust.cli.build import action
from robust.cli.guard import Run
from robust.cli.pike import load
from robust.errors import InputError, exit_code_of
from robust.options.declare import place_of
from robust.options.pike import PikeEnvelopeCommand, PikeRegionCommand
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.api import Search
    from robust.pike_bridge.envelopes.parameters import ParametricPlan
    from robust.pike_bridge.envelopes.search import LabeledRegion, TeamEnvelope
    from robust.show.pike_envelopes import Cells


def _parametric(options: PikeRegionCommand | PikeEnvelopeCommand) -> ParametricPlan:
    """The plan with its parameters: those in its own file, in the TOML file, and of options.

    Raises:
        InputError: if there are none, or one is wrong.
    """
    from robust.pike_bridge.envelopes.parameters import parametrize, specifications
    from robust.pike_bridge.files import read_tpnu

    plan = load(options)
    specs = specifications(tuple(options.parameters), options.parameter_file, read_tpnu(options.file).parameters)
    if not specs:
        raise InputError(
            "found no parameters, expected some: --parameter duration:ACTIVITY, or a file", place_of("parameters")
        )
    found = parametrize(plan, specs)
    if options.plot is not None:
        from robust.draw.plane import shown_team_axes

        shown_team_axes(found, tuple(options.axes or ()))
    return found


@action(PikeRegionCommand)
def region(options: PikeRegionCommand, run: Run) -> int:
    """For which durations and limits of a plan with choices does which choice lead to a correct execution?"""
    from robust.pike import searching_region
    from robust.show import pike_envelopes as show

    count, drawn = 0, tuple(options.axes or ())

    def on_piece(_piece: object) -> None:
        nonlocal count
        count += 1
        run.display.say(f"polyhedra: {count}")

    def begin() -> Search[LabeledRegion]:
        return searching_region(_parametric(options), options.changed(timeout=run.remaining, on_piece=on_piece))

    cells: Cells | None = None

    def answer(found: LabeledRegion) -> None:
        run.answer(
            lambda: show.region_document(found, cells),
            lambda out: show.print_region(out, found, quiet=options.quiet),
        )

    found = run.best(begin, answer)
    if not found.cut_short and (options.json or options.plot is not None):
        cells = run.also("cutting", lambda: _cells(found, run))
    answer(found)
    if options.plot is not None:
        from robust.draw.plane import plot_cells

        run.write(partial(plot_cells, found, cells, options.plot, drawn))
    if found.cut_short:
        return exit_code_of(found.status.value)
    return 0 if found.pieces else 1


def _cells(found: LabeledRegion, run: Run) -> Cells | None:
    """The region cut by what is possible; None if there is no time."""
    try:
        return found.exactly(Deadline.after(run.remaining))
    except OutOfTimeError:
        return None


@action(PikeEnvelopeCommand)
def envelope(options: PikeEnvelopeCommand, run: Run) -> int:
    """How far may durations and limits of a plan with choices deviate: for some choices, or whatever people choose?"""
    from robust.pike import searching_envelope

    def begin() -> Search[TeamEnvelope]:
        asked = options.changed(timeout=run.remaining, on_stage=run.display.say)
        return searching_envelope(_parametric(options), asked)

    found = run.reply(begin)
    if options.plot is not None and found.combinations:
        run.write(partial(found.plot, options.plot, axes=tuple(options.axes or ())))
    return exit_code_of(found.status.value)
